//! A table as numbers on a grid, whoever wrote it and in whatever file: what judging and recognising it need, and no more.

mod described;
mod reading;
mod shape;
mod stored;

pub use described::{Described, RawNumber, Shape};
pub use stored::Stored;

use super::{Decoded, FileKind, RGBA, Texture, decode};
use crate::error::{Error, Result};
use crate::pack::TexelFormat;
use serde::Serialize;
use std::path::Path;

/// One channel of a grid.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GridChannel {
    /// Its name in the file, or its letter.
    pub name: String,
    /// How finely it is stored.
    pub stored: Stored,
}

/// Numbers on a grid of up to three dimensions.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Texels along x, y and z.
    pub size: [usize; 3],
    /// The channels.
    pub channels: Vec<GridChannel>,
    /// The values, channel fastest, then x, y, z.
    pub values: Vec<f64>,
    /// What kind of file they come from, in words.
    pub source: String,
}

impl Grid {
    /// The numbers in the file at `path`.
    ///
    /// **Errors**: a file that cannot be read, that Kiln does not read, or that needs what `described` does not say.
    pub fn read(path: &Path, described: &Described) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::reading(path, e))?;
        Self::decode(&bytes, described).map_err(|e| e.in_file(path))
    }

    /// The numbers in `bytes`.
    ///
    /// **Errors**: as [`Grid::read`].
    pub fn decode(bytes: &[u8], described: &Described) -> Result<Self> {
        let grid = match FileKind::of(bytes) {
            FileKind::Other(kind) => Self::of_other(bytes, kind, described),
            // Kiln's own source text is text all the same, if an array of it is asked for.
            FileKind::Source if described.array.is_some() => Self::of_other(bytes, "a text file", described),
            kind => match decode(bytes)? {
                Decoded::Picture(image, format) => Self::of_image(&image, kind.text(), format),
                Decoded::Texture(texture) => Self::of_texture(&texture, kind.text()),
                Decoded::Array(array) => Self::of_numbers(array, kind.text(), described),
            },
        }?;
        let grid = match described.packing.filter(|&packing| !grid.is_packed(packing)) {
            Some(packing) => grid.unpacked(packing).ok_or_else(|| {
                Error::usage(
                    format!("{packing} of {}", grid.summary()),
                    "leave --packing out, or give a file of four channels of 8 bits",
                )
            })?,
            None => grid,
        };
        grid.shaped(described.shape)?.only(described.layer)
    }

    /// The grid, or that layer of it alone.
    fn only(self, layer: Option<usize>) -> Result<Self> {
        let Some(layer) = layer else { return Ok(self) };
        let [w, h, layers] = self.size;
        if layer >= layers {
            let way_out =
                if layers == 1 { "leave --layer out".to_owned() } else { format!("give one from 0 to {}", layers - 1) };
            return Err(Error::usage(format!("layer {layer} of {layers}"), way_out));
        }
        let n = w * h * self.channels.len();
        let values = self.values[layer * n..(layer + 1) * n].to_vec();
        Ok(Self { size: [w, h, 1], values, source: format!("{}, layer {layer}", self.source), ..self })
    }

    /// Whether every channel is one of that packing.
    fn is_packed(&self, packing: TexelFormat) -> bool {
        self.channels.iter().all(|c| matches!(c.stored, Stored::Packed(format, _) if format == packing))
    }

    /// What the values are if their bytes are codes of that packing; nothing where they are no codes of four bytes.
    pub fn unpacked(&self, packing: TexelFormat) -> Option<Self> {
        let bytes = self.channels.len() == 4 && self.channels.iter().all(|c| c.stored == Stored::Unorm(8));
        if !bytes || !PACKINGS.contains(&packing) {
            return None;
        }
        let codes: Vec<u8> = self.values.iter().map(|v| (v * 255.0).round() as u8).collect();
        let values =
            packing.unpack(self.size[0], self.size[1] * self.size[2], &codes).into_iter().map(f64::from).collect();
        let source = format!("{} as {packing}", self.source);
        Self::of_named(self.size, letters(3), values, source, packing).ok()
    }

    /// Number of texels.
    pub fn texels(&self) -> usize {
        self.size.iter().product()
    }

    /// The largest channel of every texel, which those that are no numbers are not.
    pub fn brightest(&self) -> Vec<f64> {
        let largest = |texel: &[f64]| texel.iter().fold(0.0, |most, v| f64::max(most, v.abs()));
        self.values.chunks_exact(self.channels.len()).map(largest).collect()
    }

    /// The mean distance of neighbouring texels, in parts of that of any two.
    pub(crate) fn roughness(&self) -> f64 {
        shape::roughness(&self.values, Shape { size: self.size, channels: self.channels.len() }, false)
    }

    /// The values of channel `c`, in the order of the texels.
    pub fn channel(&self, c: usize) -> Vec<f64> {
        self.values.iter().copied().skip(c).step_by(self.channels.len()).collect()
    }

    /// How many values of channel `c` are NaN or infinite.
    pub fn not_finite(&self, c: usize) -> usize {
        self.channel(c).iter().filter(|v| !v.is_finite()).count()
    }

    /// `64 × 64 texels of 2 channels, half floats (KTX2)`.
    pub fn summary(&self) -> String {
        let sizes: Vec<String> =
            self.size.iter().enumerate().filter(|&(i, &s)| i == 0 || s > 1).map(|(_, s)| s.to_string()).collect();
        let n = self.channels.len();
        let mut kinds: Vec<String> = vec![];
        for channel in &self.channels {
            let kind = channel.stored.to_string();
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        let plural = if n == 1 { "" } else { "s" };
        format!("{} texels of {n} channel{plural}, {} ({})", sizes.join(" × "), kinds.join(" and "), self.source)
    }

    /// The grid in the shape that the user gives: slices of a volume that lie side by side or below each other are put in order.
    fn shaped(self, shape: Option<Shape>) -> Result<Self> {
        let Some(shape) = shape.filter(|s| s.size != self.size) else { return Ok(self) };
        let ([w, h, d], [width, height, _]) = (shape.size, self.size);
        let columns = width / w.max(1);
        if self.size[2] != 1 || !width.is_multiple_of(w) || !height.is_multiple_of(h) || columns * (height / h) < d {
            return Err(Error::invalid(
                format!(
                    "{} texels, which are not slices of {w} × {h}, {d} of them",
                    self.size.map(|s| s.to_string()).join(" × ")
                ),
                "correct --shape, or leave it out",
            ));
        }
        let n = self.channels.len();
        let mut values = Vec::with_capacity(w * h * d * n);
        for z in 0..d {
            for y in 0..h {
                let at = ((z / columns * h + y) * width + z % columns * w) * n;
                values.extend_from_slice(&self.values[at..at + w * n]);
            }
        }
        Ok(Self { size: shape.size, values, ..self })
    }
}

/// What four bytes may be the codes of.
pub const PACKINGS: [TexelFormat; 3] = [TexelFormat::Rgbd, TexelFormat::Rgbm, TexelFormat::Rgbp];

/// The levels of the file at `path`, level 0 first, to be compared with another file's: of a cube, faces are slices.
///
/// **Errors**: as [`Grid::read`].
pub fn levels(path: &Path, described: &Described) -> Result<Vec<Grid>> {
    let bytes = std::fs::read(path).map_err(|e| Error::reading(path, e))?;
    match FileKind::of(&bytes) {
        FileKind::Other(_) | FileKind::Source | FileKind::Npy => {
            Ok(vec![Grid::decode(&bytes, described).map_err(|e| e.in_file(path))?])
        }
        kind => match decode(&bytes).map_err(|e| e.in_file(path))? {
            Decoded::Texture(texture) => levels_of(&texture, kind.text(), described),
            _ => Ok(vec![Grid::decode(&bytes, described).map_err(|e| e.in_file(path))?]),
        },
    }
}

/// The same of a texture from a file of that kind, in words.
///
/// **Errors**: a layer that it has not.
pub fn levels_of(texture: &Texture, source: &str, described: &Described) -> Result<Vec<Grid>> {
    let level = |level| Grid::of_level(texture, level, source)?.only(described.layer);
    (0..texture.levels.len()).map(level).collect()
}

fn letters(n: usize) -> Vec<String> {
    (0..n).map(|c| if n <= 4 { RGBA[c].to_owned() } else { c.to_string() }).collect()
}

fn interleaved(values: &[f64], channels: usize) -> Vec<f64> {
    let texels = values.len() / channels.max(1);
    (0..texels).flat_map(|t| (0..channels).map(move |c| values[c * texels + t])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(text: &str, shape: Option<&str>) -> Result<Grid> {
        let described = Described { shape: shape.map(|s| s.parse().unwrap()), ..Described::default() };
        Grid::decode(text.as_bytes(), &described)
    }

    fn smooth(x: usize, y: usize, z: usize, c: usize) -> f64 {
        0.1 + 0.05 * x as f64 + 0.003 * (y * y) as f64 + 0.02 * z as f64 + 0.3 * c as f64
    }

    #[test]
    fn flat_numbers_take_the_shape_in_which_they_are_smooth() {
        for [w, h, d, channels] in
            [[16, 16, 1, 2], [16, 16, 1, 1], [16, 16, 1, 3], [8, 8, 8, 1], [32, 1, 1, 1], [16, 16, 1, 4]]
        {
            let mut numbers = vec![];
            for i in 0..w * h * d * channels {
                let (c, t) = (i % channels, i / channels);
                numbers.push(format!("{:.6}", smooth(t % w, t / w % h, t / (w * h), c)));
            }
            let got = grid(&format!("[{}]", numbers.join(",")), None).unwrap();
            assert_eq!((got.size, got.channels.len()), ([w, h, d], channels));
        }
    }

    #[test]
    fn shapes_are_checked_against_the_numbers() {
        let wrong = grid("[0.5, 0.25, 0.125, 1.0]", Some("3x2")).unwrap_err().to_string();
        assert!(wrong.contains("4 numbers, which are not 3x2x1"), "{wrong}");
        assert_eq!(grid("[0.5, 0.25, 0.125, 1.0]", Some("2x1x2")).unwrap().size, [2, 1, 1]);
        assert!("2xx3".parse::<Shape>().is_err() && "0x3".parse::<Shape>().is_err());
    }

    #[test]
    fn bare_numbers_need_a_shape_and_their_size_tells_what_they_are() {
        let values = [0.5_f32, 0.25, 0.75, 1.0, 0.3, 0.1];
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let described = |shape: &str| Described { shape: Some(shape.parse().unwrap()), ..Described::default() };
        let got = Grid::decode(&bytes, &described("3x1x2")).unwrap();
        assert_eq!((got.size, got.values[2]), ([3, 1, 1], 0.75));
        assert!(Grid::decode(&bytes, &described("5x1x1")).unwrap_err().to_string().contains("correct --shape"));
        assert!(Grid::decode(&bytes, &Described::default()).unwrap_err().to_string().contains("--shape 64x64x2"));
    }

    #[test]
    fn a_layer_can_be_looked_at_alone() {
        let text = "float a[2][2][2][1] = {1.5, 2, 5, 6, 3, 4, 7, 8};";
        let layer = |layer| {
            let described =
                Described { layer: Some(layer), shape: Some("2x2x2x1".parse().unwrap()), ..Described::default() };
            Grid::decode(text.as_bytes(), &described)
        };
        let second = layer(1).unwrap();
        assert_eq!((second.size, second.values), ([2, 2, 1], vec![3.0, 4.0, 7.0, 8.0]));
        let beyond = layer(2).unwrap_err().to_string();
        assert!(beyond.contains("layer 2 of 2; give one from 0 to 1"), "{beyond}");
    }

    #[test]
    fn an_atlas_is_cut_into_slices() {
        // Two slices of 2 × 2 side by side.
        let text = "float a[2][4] = {1.5, 2, 5, 6, 3, 4, 7, 8};";
        let flat = grid(text, None).unwrap();
        assert_eq!(flat.size, [4, 2, 1]);
        let cut = flat.shaped(Some("2x2x2x1".parse().unwrap())).unwrap();
        assert_eq!((cut.size, cut.values), ([2, 2, 2], vec![1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]));
    }
}
