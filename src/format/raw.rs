//! Raw texels (`.raw`): levels, largest first, each its array layers, faces, slices, rows, texels; nothing before, between or after them.
//!
//! What they are, only the certificate beside the file says, or, of what was converted and has none, the layout beside it.

use super::{FormatSpec, Packing, Texture};
use crate::error::{Error, Result};
use crate::pack::TexelFormat;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What bare texels are: `NAME.raw.layout.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// Texels in a row of level 0.
    pub width: usize,
    /// Rows of level 0.
    pub height: usize,
    /// Slices of a volume; 0 for what is none.
    #[serde(default)]
    pub depth: usize,
    /// Layers of an array; 0 for what is none.
    #[serde(default)]
    pub array_layers: usize,
    /// 1, or 6 for a cube.
    pub faces: usize,
    /// Levels.
    pub levels: usize,
    /// How a texel is stored, such as `raw:rgba16f`.
    pub format: FormatSpec,
}

impl Layout {
    /// That of `texture`, written as `format`.
    pub fn of(texture: &Texture, format: FormatSpec) -> Self {
        let &Texture { width, height, depth, array_layers, faces, .. } = texture;
        Self { width, height, depth, array_layers, faces, levels: texture.levels.len(), format }
    }

    /// As a file.
    ///
    /// **Errors**: none that numbers and names can cause.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(self)
            .map_err(|e| Error::unsupported(format!("a layout that JSON cannot hold: {e}"), "report this as a bug"))
    }

    /// The texture in `bytes`.
    ///
    /// **Errors**: a format of no texels; another number of bytes than the layout takes.
    pub fn decode(&self, bytes: &[u8]) -> Result<Texture> {
        let Packing::Texel(format) = self.format.packing() else {
            return Err(Error::invalid(
                format!("{} says nothing of texels", self.format),
                "give one such as raw:rgba16f",
            ));
        };
        let &Self { width, height, depth, array_layers, faces, .. } = self;
        decode(bytes, &Texture { depth, array_layers, faces, ..Texture::empty(format, width, height) }, self.levels)
    }
}

/// Where the layout of bare texels stands: `table.raw` → `table.raw.layout.json`.
pub fn layout_beside(file: &Path) -> PathBuf {
    let mut name = file.file_name().unwrap_or_default().to_owned();
    name.push(".layout.json");
    file.with_file_name(name)
}

/// The file that holds `texture`.
///
/// **Errors**: sizes or levels that contradict each other.
pub fn encode(texture: &Texture) -> Result<Vec<u8>> {
    texture.check()?;
    Ok(texture.levels.concat())
}

/// The texture in `bytes`: of the size, format and number of levels of `like`, whose levels do not matter.
///
/// **Errors**: another number of bytes than these take.
pub fn decode(bytes: &[u8], like: &Texture, n_levels: usize) -> Result<Texture> {
    let mut texture = Texture { levels: vec![], ..like.clone() };
    let mut rest = bytes;
    for level in 0..n_levels {
        let taken = texture.level_bytes(level).and_then(|n| rest.split_at_checked(n));
        let Some((level, after)) = taken else { return Err(other_size(bytes.len(), &texture)) };
        texture.levels.push(level.to_vec());
        rest = after;
    }
    if !rest.is_empty() {
        return Err(other_size(bytes.len(), &texture));
    }
    texture.check()?;
    Ok(texture)
}

fn other_size(n_bytes: usize, texture: &Texture) -> Error {
    let format: TexelFormat = texture.format;
    Error::invalid(
        format!("{n_bytes} bytes, which {} of {format} does not take", texture.text()),
        "give the size and the texel format that the file was written with",
    )
}
