//! Where a panorama comes from: a file, or a built-in environment.

use std::path::Path;

use super::builtin::{DEFAULT_WIDTH, builtin};
use super::panorama::{InputReport, Negatives, NonFinite, Panorama};
use crate::error::Result;
use crate::format::read_image;

/// What a built-in environment's name begins with.
pub const BUILTIN_PREFIX: &str = "builtin:";

/// The panorama that `input` names: `builtin:NAME`, or the path of an `.hdr` or `.exr`.
///
/// **Errors**: a file that cannot be read, is not a panorama, or holds values that the policies refuse.
pub fn load(input: &str, nonfinite: NonFinite, negatives: Negatives) -> Result<(Panorama, InputReport)> {
    if let Some(name) = input.strip_prefix(BUILTIN_PREFIX) {
        let panorama = builtin(name, DEFAULT_WIDTH)?;
        let min = panorama.min().into_iter().fold(f32::INFINITY, f32::min);
        return Ok((panorama, InputReport { nonfinite: 0, negative: 0, min }));
    }
    let path = Path::new(input);
    let image = read_image(path)?;
    Panorama::from_image(&image, nonfinite, negatives).map_err(|e| e.in_file(path))
}
