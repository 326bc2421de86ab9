//! Baking several tables into the layers of one array texture.

use super::table::{file_name, judged_table};
use crate::certificate::{self, Certificate, LAYERS_KEY};
use crate::error::Result;
use crate::format::{self, Texture};
use crate::recipe::ArrayRecipe;
use crate::table::Progress;
use std::path::{Path, PathBuf};

/// A baked array texture.
#[derive(Debug)]
pub struct BakedArray {
    /// The file, and the certificate of each layer beside it.
    pub files: Vec<(PathBuf, Vec<u8>)>,
    /// The certificates of the layers; embedded in the file too.
    pub certificates: Vec<Certificate>,
}

impl BakedArray {
    /// Writes everything below `folder`, all or nothing; the paths written.
    ///
    /// **Errors**: as [`Baked::write`](super::Baked::write).
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        super::write(&self.files, folder)
    }
}

/// Integrates, checks and packs the tables of an array.
///
/// **Errors**: those of [`ArrayRecipe::check`] and of [`table`](super::table()).
pub fn array(recipe: &ArrayRecipe, progress: Progress) -> Result<BakedArray> {
    recipe.check()?;
    let (mut texture, mut certificates): (Option<Texture>, Vec<Certificate>) = (None, vec![]);
    for (layer, table) in recipe.tables().iter().enumerate() {
        let (_, picture, mut certificate) = judged_table(table, true, progress)?;
        certificate.layer = Some(layer);
        certificate.files[0].file = file_name(&recipe.file)?;
        certificates.push(certificate);
        match &mut texture {
            Some(texture) => {
                texture.levels[0].extend_from_slice(&picture.levels[0]);
                texture.array_layers += 1;
            }
            // Channels mean something else in every layer, and have no names.
            None => texture = Some(Texture { array_layers: 1, channels: vec![], ..picture }),
        }
    }
    let mut texture = texture.ok_or_else(|| crate::Error::usage("an array without layers", "add a [[array.layer]]"))?;
    texture.metadata = vec![(LAYERS_KEY.to_owned(), Certificate::list_to_json(&certificates)?)];
    let mut files = vec![(PathBuf::from(&recipe.file), format::encode(recipe.format, &texture)?)];
    for (layer, certificate) in recipe.layers.iter().zip(&certificates) {
        let beside = Path::new(&recipe.file).with_extension(&layer.name);
        files.push((certificate::beside(&beside), certificate.to_pretty_json()?.into_bytes()));
    }
    Ok(BakedArray { files, certificates })
}
