//! Containers: one file per file format, pure translation between bytes and [`Texture`] or [`Image`].
//!
//! Only [`read_image`], [`read`] and [`atomic`] touch the disk. What a file is, its first bytes say, not its name: [`FileKind`].
//!
//! # Reading any file
//!
//! [`decode`] takes the bytes of whatever Kiln writes or reads and gives a [`Decoded`]. Its values come as f32 per channel, whatever is stored
//! ([`Decoded::values`], [`Texture::face`]), and its texel format says what one step of the packing is there:
//! [`TexelFormat::ulp`](crate::pack::TexelFormat::ulp) where each channel is rounded on its own,
//! [`TexelFormat::step`](crate::pack::TexelFormat::step) where it depends on the texel's largest channel, nothing for texels in blocks.
//!
//! # Writing any file
//!
//! A [`FormatSpec`] names a container and a packing; [`FormatSpec::texel`] is the texel format for a number of channels. Pack values into a
//! [`Texture`] of that format ([`Texture::flat`], [`Texture::push_level`]), then [`encode`] it.

pub mod atomic;
pub mod dds;
mod embedded;
pub mod env;
pub mod exr;
pub mod grid;
pub mod hdr;
mod kind;
pub mod ktx1;
pub mod ktx2;
pub mod literals;
pub(crate) mod memory;
pub mod npy;
pub mod png;
pub mod raw;
pub mod source;
mod spec;
mod texture;

pub use grid::Grid;
pub use kind::FileKind;
pub use spec::{Container, FormatSpec, Packing, Variant};
pub use texture::Texture;

use crate::colour::Primaries;
use crate::error::{Error, Result};
use crate::pack::{Number, TexelFormat};
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

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Decoded {
    /// A picture of named channels, and how they were stored: of several, the coarsest.
    Picture(Image, TexelFormat),
    /// A texture.
    Texture(Texture),
    /// An array of numbers, and how they were stored.
    Array(Array),
}

/// The letters of colour, as textures have their channels.
const RGBA: [&str; 4] = ["R", "G", "B", "A"];

/// Where red, green, blue and alpha stand among channels that are nothing else, in that order; upper or lower case. OpenEXR sorts
/// channels by their names, which textures do not.
pub(crate) fn colour_order(names: &[String]) -> Option<Vec<usize>> {
    let letter = |name: &String| RGBA.iter().position(|letter| name.eq_ignore_ascii_case(letter));
    let letters: Vec<usize> = names.iter().map(letter).collect::<Option<_>>()?;
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by_key(|&channel| letters[channel]);
    Some(order)
}

/// An array of numbers, last axis fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Lengths of the axes.
    pub shape: Vec<usize>,
    /// The numbers.
    pub values: Vec<f64>,
    /// How they were stored; nothing for what Kiln does not write (integers, f64).
    pub number: Option<Number>,
    /// Names along the last axis, where the file says them.
    pub channels: Vec<String>,
    /// Key/value pairs, where the file has such.
    pub metadata: Vec<(String, String)>,
}

impl Array {
    /// Columns, rows, pictures (whatever stands before) and channels. The last of three axes or more is that of the channels.
    pub fn extent(&self) -> [usize; 4] {
        let (channels, rest) = match &self.shape[..] {
            [rest @ .., last] if rest.len() >= 2 => (*last, rest),
            all => (1, all),
        };
        let from_end = |i: usize| rest.len().checked_sub(i).and_then(|at| rest.get(at)).copied().unwrap_or(1);
        let pictures = rest.iter().rev().skip(2).product();
        [from_end(1), from_end(2), pictures, channels]
    }

    /// What the metadata says under `key`.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|(known, _)| known == key).map(|(_, value)| value.as_str())
    }
}

impl Decoded {
    /// How texels were stored; nothing for an array of numbers that Kiln does not write. What an array has no three axes for is of one channel.
    pub fn format(&self) -> Option<TexelFormat> {
        match self {
            Self::Picture(_, format) => Some(*format),
            Self::Texture(texture) => Some(texture.format),
            Self::Array(array) => array.number.map(|number| TexelFormat::Plain { channels: array.extent()[3], number }),
        }
    }

    /// All values of level 0, channel fastest.
    pub fn values(&self) -> Vec<f64> {
        let wide = |values: &[f32]| values.iter().map(|&v| f64::from(v)).collect();
        match self {
            Self::Picture(image, _) => wide(&image.texels),
            Self::Texture(texture) => wide(&texture.values(0)),
            Self::Array(array) => array.values.clone(),
        }
    }

    /// Key/value pairs.
    pub fn metadata_mut(&mut self) -> &mut Vec<(String, String)> {
        match self {
            Self::Picture(image, _) => &mut image.metadata,
            Self::Texture(texture) => &mut texture.metadata,
            Self::Array(array) => &mut array.metadata,
        }
    }

    /// What the metadata says under `key`.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        let metadata = match self {
            Self::Picture(image, _) => &image.metadata,
            Self::Texture(texture) => &texture.metadata,
            Self::Array(array) => &array.metadata,
        };
        metadata.iter().find(|(known, _)| known == key).map(|(_, value)| value.as_str())
    }
}

/// The file of that format that holds `texture`, which must be packed as the format says: see [`FormatSpec::texel`].
///
/// **Errors**: a texture that the container cannot hold, with those that can.
pub fn encode(spec: FormatSpec, texture: &Texture) -> Result<Vec<u8>> {
    let wanted = spec.texel(texture.format.channels())?;
    if wanted != texture.format {
        return Err(Error::usage(
            format!("{} of {} for a file of {spec}", texture.text(), texture.format),
            format!("pack it as {wanted}"),
        ));
    }
    match (spec.container(), spec.variant()) {
        (Container::Ktx2, Variant::Zstd) => ktx2::encode_zstd(texture),
        (Container::Ktx2, _) => ktx2::encode(texture),
        (Container::Exr, _) => exr::encode_texture(texture),
        (Container::Ktx1, _) => ktx1::encode(texture),
        (Container::Dds, Variant::Legacy) => dds::encode_legacy(texture),
        (Container::Dds, _) => dds::encode(texture),
        (Container::Hdr, _) => hdr::encode(texture),
        (Container::Png, _) => png::encode(texture),
        (Container::Env, _) => env::encode(texture),
        (Container::Npy, _) => npy::encode(texture),
        (Container::Raw, _) => raw::encode(texture),
        (language, _) => source::encode(language, texture).map(String::into_bytes),
    }
}

/// What `bytes` hold, by their beginning.
///
/// **Errors**: a kind that Kiln does not read, which the message names; a broken file.
pub fn decode(bytes: &[u8]) -> Result<Decoded> {
    match FileKind::of(bytes) {
        FileKind::Exr => {
            if let Some(texture) = exr::decode_texture(bytes)? {
                return Ok(Decoded::Texture(texture));
            }
            let (image, number) = exr::decode_with_number(bytes)?;
            let format = TexelFormat::Plain { channels: image.channels.len(), number };
            Ok(Decoded::Picture(image, format))
        }
        FileKind::Hdr => hdr::decode(bytes).map(|image| Decoded::Picture(image, TexelFormat::Rgbe)),
        FileKind::Ktx2 => ktx2::decode(bytes).map(Decoded::Texture),
        FileKind::Ktx1 => ktx1::decode(bytes).map(Decoded::Texture),
        FileKind::Dds => dds::decode(bytes).map(Decoded::Texture),
        FileKind::Png => png::decode(bytes).map(Decoded::Texture),
        FileKind::Env => env::decode(bytes).map(Decoded::Texture),
        FileKind::Npy => npy::decode(bytes).map(Decoded::Array),
        FileKind::Source => source::decode(bytes).map(Decoded::Array),
        FileKind::Empty => Err(Error::invalid("an empty file", "copy or download it again")),
        FileKind::Other(kind) => Err(Error::unsupported(
            format!("{kind}, which Kiln does not read"),
            "give an .exr, .hdr, .ktx2, .ktx, .dds, .png, .env or .npy",
        )),
    }
}

/// JSON without a letter beyond ASCII, which some readers take for something else.
fn ascii_json(json: &str) -> String {
    let mut ascii = String::with_capacity(json.len());
    for c in json.chars() {
        if c.is_ascii() {
            ascii.push(c);
        } else {
            c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| ascii += &format!("\\u{unit:04x}"));
        }
    }
    ascii
}

/// What the file at `path` holds, whatever its extension says.
///
/// **Errors**: a path that cannot be read; otherwise as [`decode`].
pub fn read(path: &Path) -> Result<Decoded> {
    let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
    decode(&bytes).map_err(|error| error.in_file(path))
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
        FileKind::Empty => Err(Error::invalid("an empty file", "copy or download it again")),
        FileKind::Other(kind) => Err(Error::unsupported(format!("{kind}, which Kiln does not read"), WAY_OUT)),
        kind => Err(Error::unsupported(format!("{}, where a picture was wanted", kind.text()), WAY_OUT)),
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
