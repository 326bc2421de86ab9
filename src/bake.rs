//! Baking: from a recipe to the bytes of its files, each with its certificate.
//!
//! Pure: nothing here touches a disk. Files are written by [`Baked::write`], all or none.

mod array;
mod environment;
mod shader;
mod table;

pub use array::{BakedArray, array};
pub use environment::{
    DEFAULT_SAMPLES, EngineSh, SH_SCHEMA, SUN_SCHEMA, ShFile, Source, SunFile, environment, environment_texels,
    is_current, source,
};
pub(crate) use environment::{IRRADIANCE, precision};
pub use shader::{combined_shader, shader_of};
pub(crate) use table::values as table_values;
pub use table::{table, table_by_one_witness};

use crate::certificate::{self, Certificate};
use crate::error::{Error, Result};
use crate::format::atomic::Staged;
use std::path::{Path, PathBuf};

/// Files ready to be written, and what is known of them.
#[derive(Debug)]
pub struct Baked {
    /// Path within the output folder, and content.
    pub files: Vec<(PathBuf, Vec<u8>)>,
    /// Where the certificate goes, within the output folder.
    pub certificate_path: PathBuf,
    /// What is known of the files; embedded in them too.
    pub certificate: Certificate,
}

impl Baked {
    /// Writes everything below `folder`, which is created if it is missing; the paths written.
    ///
    /// **Errors**: what the system refuses; then nothing new stands under a final name.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let json = self.certificate.to_pretty_json()?.into_bytes();
        write(self.files.iter().chain([&(self.certificate_path.clone(), json)]), folder)
    }
}

/// Writes files below `folder`, all or none.
fn write<'a>(files: impl IntoIterator<Item = &'a (PathBuf, Vec<u8>)>, folder: &Path) -> Result<Vec<PathBuf>> {
    let files: Vec<(PathBuf, &[u8])> =
        files.into_iter().map(|(path, bytes)| (folder.join(path), bytes.as_slice())).collect();
    for (path, _) in &files {
        if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
            std::fs::create_dir_all(parent).map_err(|e| Error::writing(parent, e))?;
        }
    }
    let mut staged = Staged::default();
    staged.add_all(&files)?;
    staged.commit()?;
    Ok(files.into_iter().map(|(path, _)| path).collect())
}

/// A bake that does not pass its own checks is not written.
fn refuse_failures(certificate: &Certificate) -> Result<()> {
    let Some(failed) = certificate.checks.iter().find(|c| !c.passed) else { return Ok(()) };
    Err(Error::invalid(
        format!(
            "the bake fails its own check \"{}\" on {}: {:e} where at most {:e} is right, {}",
            failed.name, failed.subject, failed.figure, failed.limit, failed.detail
        ),
        "report this as a bug, with the recipe; nothing was written",
    ))
}

/// Digest of texels as a reader sees them: f32, little-endian, in the order of the recipe's channels.
pub(crate) fn texel_digest<'a>(levels: impl IntoIterator<Item = &'a [f32]>) -> String {
    const TOGETHER: usize = 4096;
    let mut digest = certificate::Digest::default();
    let mut bytes = [[0; 4]; TOGETHER];
    for values in levels.into_iter().flat_map(|level| level.chunks(TOGETHER)) {
        let bytes = &mut bytes[..values.len()];
        bytes.iter_mut().zip(values).for_each(|(bytes, value)| *bytes = value.to_le_bytes());
        digest.add(bytes.as_flattened());
    }
    digest.finish()
}
