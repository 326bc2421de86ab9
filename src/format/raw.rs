//! Raw texels (`.raw`): levels, largest first, each its array layers, faces, slices, rows, texels; nothing before, between or after them.
//!
//! What they are, only the certificate beside the file says.

use super::Texture;
use crate::error::{Error, Result};
use crate::pack::TexelFormat;

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
