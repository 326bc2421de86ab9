//! Containers: one file per file format, pure translation between bytes and [`Image`] or [`ktx2::Texture`].
//!
//! Only [`read_image`] and [`atomic`] touch the disk. What a file is, its first bytes say, not its name: [`FileKind`].

pub mod atomic;
pub mod exr;
pub mod grid;
pub mod hdr;
mod kind;
pub mod ktx2;
pub mod literals;
pub(crate) mod memory;
mod spec;

pub use grid::Grid;
pub use kind::FileKind;
pub use spec::{Container, FormatSpec};

use crate::colour::Primaries;
use crate::error::{Error, Result};
use std::path::Path;

/// A two-dimensional picture of named channels, linear, row 0 at the top.
///
/// Readers give `Image<f32>`; a table's master is an `Image<f64>`, so that packing it rounds once.
#[derive(Debug, Clone, PartialEq)]
pub struct Image<T = f32> {
    /// Texels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Names of the channels, in the order in which they are interleaved.
    pub channels: Vec<String>,
    /// `height × width × channels` values, channel fastest.
    pub texels: Vec<T>,
    /// Key/value pairs that the container carries (text attributes); those of an EXR come sorted by key.
    pub metadata: Vec<(String, String)>,
    /// What red, green and blue are, where the file says it: an EXR's `chromaticities`, a Radiance HDR's `PRIMARIES`.
    pub primaries: Option<Primaries>,
}

impl<T: Copy> Image<T> {
    /// An image without metadata.
    ///
    /// **Shape**: `texels` is height × width × channels, channel fastest.
    ///
    /// **Errors**: a size or a number of channels that is zero, or another number of texels than they make.
    pub fn new(width: usize, height: usize, channels: &[&str], texels: Vec<T>) -> Result<Self> {
        let channels = channels.iter().map(|&name| name.to_owned()).collect();
        let image = Self { width, height, channels, texels, metadata: Vec::new(), primaries: None };
        image.check_shape()?;
        Ok(image)
    }

    /// Where the channel called `name` is among the channels.
    pub fn channel_index(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|channel| channel == name)
    }

    /// The values of the channel called `name`, row by row.
    pub fn channel(&self, name: &str) -> Option<Vec<T>> {
        let index = self.channel_index(name)?;
        Some(self.texels.chunks_exact(self.channels.len()).map(|texel| texel[index]).collect())
    }

    /// What the metadata says under `key`.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|(known, _)| known == key).map(|(_, value)| value.as_str())
    }

    /// The picture in colour, row by row: the channels `R`, `G`, `B`; failing these, those of the only layer that has them
    /// (`sky.R`, `sky.G`, `sky.B`); failing these, a luminance `Y` as grey.
    ///
    /// **Errors**: none of them there, or colour in several layers.
    pub fn rgb(&self) -> Result<Vec<[T; 3]>> {
        let [r, g, b] = self.colour_channels()?;
        Ok(self.texels.chunks_exact(self.channels.len()).map(|texel| [texel[r], texel[g], texel[b]]).collect())
    }

    /// Where red, green and blue are among the channels, as [`Image::rgb`] finds them; upper or lower case.
    ///
    /// **Errors**: as [`Image::rgb`].
    pub fn colour_channels(&self) -> Result<[usize; 3]> {
        let in_layer = |prefix: &str| {
            let find = |letter| {
                let wanted = format!("{prefix}{letter}");
                self.channels.iter().position(|name| name.eq_ignore_ascii_case(&wanted))
            };
            Some([find("R")?, find("G")?, find("B")?])
        };
        if let Some(indices) = in_layer("") {
            return Ok(indices);
        }
        let layers: Vec<&str> = self
            .channels
            .iter()
            .filter_map(|name| name.strip_suffix('R').filter(|prefix| prefix.ends_with('.')))
            .filter(|prefix| in_layer(prefix).is_some())
            .collect();
        match layers[..] {
            [layer] => in_layer(layer),
            [] => self.channel_index("Y").map(|grey| [grey; 3]),
            _ => {
                let names: Vec<&str> = layers.iter().map(|layer| layer.trim_end_matches('.')).collect();
                return Err(Error::unsupported(
                    format!("colour in {} layers ({}), where one was wanted", names.len(), names.join(", ")),
                    "save the wanted layer alone, with channels R, G and B",
                ));
            }
        }
        .ok_or_else(|| {
            Error::invalid(
                format!("no colour among the channels {}", self.channels.join(", ")),
                "save the picture with channels named R, G and B, or Y for grey",
            )
        })
    }

    fn check_shape(&self) -> Result<()> {
        let (width, height, channels) = (self.width, self.height, self.channels.len());
        let wanted = width.checked_mul(height).and_then(|texels| texels.checked_mul(channels));
        if wanted != Some(self.texels.len()) || self.texels.is_empty() {
            return Err(Error::usage(
                format!(
                    "an image of {width} × {height} texels of {channels} channels with {} values",
                    self.texels.len()
                ),
                "give width × height × channels values, at least one",
            ));
        }
        Ok(())
    }
}

/// The picture in the file at `path`, an OpenEXR or a Radiance HDR, whatever its extension says.
///
/// **Errors**: a path that cannot be read; a file of another kind, which the message names; a broken file.
pub fn read_image(path: &Path) -> Result<Image> {
    let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
    decode_image(&bytes).map_err(|error| error.in_file(path))
}

/// The picture in `bytes`, an OpenEXR or a Radiance HDR.
///
/// **Errors**: as [`read_image`], without a path.
pub fn decode_image(bytes: &[u8]) -> Result<Image> {
    const WAY_OUT: &str = "give an OpenEXR (.exr) or Radiance HDR (.hdr) file";
    match FileKind::of(bytes) {
        FileKind::Exr => exr::decode(bytes),
        FileKind::Hdr => hdr::decode(bytes),
        FileKind::Ktx2 => Err(Error::unsupported("a KTX2 texture, where a picture was wanted", WAY_OUT)),
        FileKind::Empty => Err(Error::invalid("an empty file", "copy or download it again")),
        FileKind::Other(kind) => Err(Error::unsupported(format!("{kind}, which Kiln does not read"), WAY_OUT)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(channels: &[&str]) -> Image {
        let texels = (0..2 * channels.len()).map(|i| i as f32).collect();
        Image::new(2, 1, channels, texels).unwrap()
    }

    #[test]
    fn colour_is_found_by_name_in_any_order() {
        assert_eq!(image(&["B", "G", "R"]).rgb().unwrap(), [[2.0, 1.0, 0.0], [5.0, 4.0, 3.0]]);
        assert_eq!(image(&["A", "sky.B", "sky.G", "sky.R"]).rgb().unwrap()[0], [3.0, 2.0, 1.0]);
        assert_eq!(image(&["A", "Y"]).rgb().unwrap(), [[1.0; 3], [3.0; 3]]);
    }

    #[test]
    fn plain_colour_wins_over_a_layer() {
        assert_eq!(image(&["B", "G", "R", "a.B", "a.G", "a.R"]).rgb().unwrap()[0], [2.0, 1.0, 0.0]);
    }

    #[test]
    fn missing_or_ambiguous_colour_is_refused() {
        let none = image(&["R", "G", "depth"]).rgb().unwrap_err().to_string();
        assert!(none.contains("R, G, depth; save"), "{none}");
        let two = image(&["a.R", "a.G", "a.B", "b.R", "b.G", "b.B"]).rgb().unwrap_err().to_string();
        assert!(two.contains("(a, b)"), "{two}");
    }

    #[test]
    fn a_channel_comes_out_row_by_row() {
        assert_eq!(image(&["ggx.scale", "ggx.bias"]).channel("ggx.bias"), Some(vec![1.0, 3.0]));
        assert_eq!(image(&["Y"]).channel("R"), None);
    }

    #[test]
    fn images_of_no_texels_or_too_few_are_refused() {
        assert!(Image::<f32>::new(0, 1, &["Y"], vec![]).is_err());
        assert!(Image::new(2, 2, &["Y"], vec![1.0_f32; 3]).is_err());
        assert!(Image::new(usize::MAX, 2, &["Y"], vec![1.0_f32; 3]).is_err());
    }
}
