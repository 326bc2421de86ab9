//! The names of output formats: `exr:f32`, `ktx2:rg16f`.

use crate::error::{Error, Result};
use crate::pack::{Number, TexelFormat};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A file format that Kiln writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Container {
    /// OpenEXR: any channels, by name.
    Exr,
    /// KTX, version 2: what a graphics interface takes as it is.
    Ktx2,
}

/// A container and what a value becomes in it: `exr:f32`, `ktx2:rg16f`; `exr` alone is `exr:f32`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum FormatSpec {
    /// OpenEXR, all channels of one number format.
    Exr(Number),
    /// KTX2, in a texel format.
    Ktx2(TexelFormat),
}

impl Container {
    /// Every container that there is.
    pub const ALL: [Self; 2] = [Self::Exr, Self::Ktx2];

    /// The extension of its files, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Ktx2 => "ktx2",
        }
    }
}

impl FormatSpec {
    /// The container.
    pub fn container(self) -> Container {
        match self {
            Self::Exr(_) => Container::Exr,
            Self::Ktx2(_) => Container::Ktx2,
        }
    }

    /// The extension of its files, without the dot.
    pub fn extension(self) -> &'static str {
        self.container().extension()
    }

    /// How one number is stored.
    pub fn number(self) -> Number {
        match self {
            Self::Exr(number) => number,
            Self::Ktx2(texel) => texel.number,
        }
    }

    /// Every format that there is.
    pub fn all() -> Vec<Self> {
        let exr = [Number::F32, Number::F16].map(Self::Exr);
        exr.into_iter().chain(TexelFormat::ALL.map(Self::Ktx2)).collect()
    }

    fn names() -> String {
        let names: Vec<String> = Self::all().iter().map(Self::to_string).collect();
        names.join(", ")
    }
}

impl fmt::Display for Container {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.extension())
    }
}

impl fmt::Display for FormatSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exr(number) => write!(f, "exr:{number}"),
            Self::Ktx2(texel) => write!(f, "ktx2:{texel}"),
        }
    }
}

impl FromStr for FormatSpec {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "exr" => return Ok(Self::Exr(Number::F32)),
            "ktx2" => {
                let choices = TexelFormat::ALL.map(|texel| Self::Ktx2(texel).to_string()).join(", ");
                return Err(Error::usage("format `ktx2` without a texel format", format!("choose one of {choices}")));
            }
            _ => {}
        }
        Self::all().into_iter().find(|spec| spec.to_string() == name).ok_or_else(|| {
            Error::usage(format!("unknown format `{name}`"), format!("use exr or one of {}", Self::names()))
        })
    }
}

impl TryFrom<String> for FormatSpec {
    type Error = Error;

    fn try_from(name: String) -> Result<Self> {
        name.parse()
    }
}

impl From<FormatSpec> for String {
    fn from(spec: FormatSpec) -> Self {
        spec.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_what_their_names_say() {
        for spec in FormatSpec::all() {
            assert_eq!(spec.to_string().parse::<FormatSpec>().unwrap(), spec);
            let json = serde_json::to_string(&spec).unwrap();
            assert_eq!(serde_json::from_str::<FormatSpec>(&json).unwrap(), spec);
        }
        assert_eq!("exr".parse::<FormatSpec>().unwrap(), FormatSpec::Exr(Number::F32));
        let spec: FormatSpec = "ktx2:rg16f".parse().unwrap();
        assert_eq!((spec.extension(), spec.container(), spec.number()), ("ktx2", Container::Ktx2, Number::F16));
    }

    #[test]
    fn unknown_formats_are_refused_with_the_list_of_known_ones() {
        for name in ["", "png", "exr:f64", "ktx2:", "ktx2:rgb16f", "dds:rg16f", "EXR"] {
            let message = name.parse::<FormatSpec>().unwrap_err().to_string();
            assert!(message.contains("; use exr or one of exr:f32, exr:f16, ktx2:r16f"), "{message}");
        }
        let message = "ktx2".parse::<FormatSpec>().unwrap_err().to_string();
        assert!(message.contains("; choose one of ktx2:r16f, ktx2:rg16f"), "{message}");
        assert!(serde_json::from_str::<FormatSpec>("\"png\"").is_err());
    }
}
