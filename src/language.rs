//! Shading languages that Kiln writes code in.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A shading language.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Language {
    /// OpenGL's and WebGL 2's.
    Glsl,
    /// Direct3D's.
    Hlsl,
    /// WebGPU's.
    Wgsl,
}

impl Language {
    /// Every language that there is.
    pub const ALL: [Self; 3] = [Self::Glsl, Self::Hlsl, Self::Wgsl];

    /// What a user writes, and the extension of its files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Glsl => "glsl",
            Self::Hlsl => "hlsl",
            Self::Wgsl => "wgsl",
        }
    }
}

impl fmt::Display for Language {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Language {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|language| language.name() == name).ok_or_else(|| {
            Error::usage(
                format!("no shading language is called {name:?}"),
                "use glsl, hlsl or wgsl, or several: glsl,wgsl",
            )
        })
    }
}

impl TryFrom<String> for Language {
    type Error = Error;

    fn try_from(name: String) -> Result<Self> {
        name.parse()
    }
}

impl From<Language> for String {
    fn from(language: Language) -> Self {
        language.name().to_owned()
    }
}
