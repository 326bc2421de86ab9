//! A table as numbers on a grid, whoever wrote it and in whatever file: what judging and recognising it need, and no more.

use super::{Array, Decoded, FileKind, Image, Texture, decode, embedded, literals};
use crate::error::{Error, Result};
use crate::pack::{Number, TexelFormat, binary16};
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// How finely a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(into = "String")]
pub enum Stored {
    /// Half floats.
    F16,
    /// Floats.
    F32,
    /// Doubles.
    F64,
    /// Unsigned integers of so many bits that stand for 0 to 1.
    Unorm(u32),
    /// Decimals with so many places after the point.
    Decimal(u32),
    /// A channel of a texel format whose channels are rounded together, or unlike each other.
    Packed(TexelFormat, usize),
}

/// Values that must be there before their all being multiples of 1/255 proves anything.
const ENOUGH_LEVELS: usize = 8;
/// Places that some of a table's floats have at least, if each is printed as the shortest decimal that is read as it.
const FLOAT_PLACES: u32 = 7;
/// Places that a decimal has at most before it says nothing about rounding.
const MOST_PLACES: u32 = 17;

impl Stored {
    /// The distance of neighbouring numbers at `value`, on its own: correct rounding is off by at most half of it.
    pub fn step(self, value: f64) -> f64 {
        self.step_beside(value, value.abs())
    }

    /// The same in a texel whose largest channel is `brightest`: some formats round the channels of a texel by that. BC6H promises no
    /// step; seven bits are what its endpoints have at least.
    pub fn step_beside(self, value: f64, brightest: f64) -> f64 {
        match self {
            Self::F16 => Number::F16.ulp(value),
            Self::F32 => Number::F32.ulp(value),
            Self::F64 => f64::EPSILON * value.abs(),
            Self::Unorm(bits) => 1.0 / ((1_u64 << bits.min(52)) - 1) as f64,
            Self::Decimal(places) => 10_f64.powi(-(places as i32)),
            Self::Packed(format, channel) => {
                format.step(channel, value, brightest.max(value.abs())).unwrap_or_else(|| value.abs().max(1e-6) / 128.0)
            }
        }
    }

    /// The nearest number that is stored so in a texel whose largest channel is `brightest`.
    pub fn round_beside(self, value: f64, brightest: f64) -> f64 {
        match self {
            Self::F16 | Self::F32 => {
                let number = if self == Self::F16 { Number::F16 } else { Number::F32 };
                f64::from(number.unpack(&number.pack(&[value]).0)[0])
            }
            Self::F64 => value,
            Self::Unorm(_) => {
                let step = self.step(value);
                (value.clamp(0.0, 1.0) / step).round() * step
            }
            Self::Decimal(_) | Self::Packed(..) => {
                let step = self.step_beside(value, brightest);
                (value / step).round() * step
            }
        }
    }

    /// What decimals with that many places really are: halves where every one is a half as far as the places tell.
    pub(crate) fn of_decimals(values: &[f64], places: i32) -> Self {
        let places = places.clamp(0, MOST_PLACES as i32) as u32;
        let printed = 0.5 * 10_f64.powi(-(places as i32)) * (1.0 + 1e-9);
        let is_half = |v: f64| {
            let half = f64::from(half::f16::from_f64(v));
            // Printed as a float, it has no more places than tell it from other floats.
            let as_float = places >= FLOAT_PLACES && half == f64::from(v as f32);
            // Decimals coarser than halves cannot tell.
            as_float || ((half - v).abs() <= printed && printed < 0.25 * binary16::ulp(v))
        };
        let telling = values.iter().filter(|v| v.fract() != 0.0).count();
        if telling >= 2 && values.iter().all(|&v| v == 0.0 || v.fract() == 0.0 || is_half(v)) {
            return Self::F16;
        }
        if places >= 9 { Self::F32 } else { Self::Decimal(places) }
    }

    /// A number on its own.
    fn of_number(number: Number) -> Self {
        match number {
            Number::F16 => Self::F16,
            Number::F32 => Self::F32,
            Number::Unorm8 => Self::Unorm(8),
            Number::Unorm16 => Self::Unorm(16),
        }
    }

    /// What floats really are: bytes or words where every one is a multiple of 1/255 or 1/65535, halves where every one is a half.
    fn of_floats(values: &[f64], container: Self) -> Self {
        if matches!(container, Self::Unorm(_)) {
            return container;
        }
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        for bits in [8, 16] {
            let stored = Self::Unorm(bits);
            let step = stored.step(0.0);
            if container == Self::F16 && bits == 16 {
                continue; // a half is coarser than that
            }
            let slack = |v: f64| 0.5 * container.step(v) + 1e-3 * step;
            let mut levels: Vec<i64> = finite().map(|v| (v / step).round() as i64).collect();
            let fits = finite()
                .all(|v| (0.0..=1.0 + step / 4.0).contains(&v) && (v - (v / step).round() * step).abs() <= slack(v));
            levels.sort_unstable();
            levels.dedup();
            if fits && levels.len() >= ENOUGH_LEVELS {
                return stored;
            }
        }
        let is_half = |v: f64| f64::from(half::f16::from_f64(v)) == v;
        if container == Self::F32 && finite().all(is_half) { Self::F16 } else { container }
    }
}

impl fmt::Display for Stored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::F16 => f.write_str("half floats"),
            Self::F32 => f.write_str("floats"),
            Self::F64 => f.write_str("doubles"),
            Self::Unorm(bits) => write!(f, "{bits} bits"),
            Self::Decimal(places) => write!(f, "decimals with {places} places"),
            Self::Packed(format, _) => write!(f, "{format}"),
        }
    }
}

impl From<Stored> for String {
    fn from(stored: Stored) -> Self {
        stored.to_string()
    }
}

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

/// What a file does not say of itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Described {
    /// Width, height, depth and channels.
    pub shape: Option<Shape>,
    /// Which array of a source text, or which file in base64 within it.
    pub array: Option<String>,
    /// What four bytes a texel are the codes of, where the file does not say it.
    pub packing: Option<TexelFormat>,
    /// Whether the channels follow each other as whole planes.
    pub planar: bool,
    /// How the numbers of a file without a header are stored.
    pub number: Option<RawNumber>,
    /// Which layer of an array of textures, or slice of a volume, from 0; all where nothing is said.
    pub layer: Option<usize>,
}

/// The shape of numbers without one: `64x64`, `64x64x2`, `16x16x16x2`; of three or four sizes the last is that of a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Texels along x, y and z.
    pub size: [usize; 3],
    /// Channels.
    pub channels: usize,
}

/// How a number of a file without a header is stored, little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RawNumber {
    /// A half float.
    F16,
    /// A float.
    F32,
    /// A double.
    F64,
    /// A byte that stands for 0 to 1.
    U8,
    /// A word that stands for 0 to 1.
    U16,
}

impl RawNumber {
    /// Bytes that it takes.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::F16 | Self::U16 => 2,
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn stored(self) -> Stored {
        match self {
            Self::F16 => Stored::F16,
            Self::F32 => Stored::F32,
            Self::F64 => Stored::F64,
            Self::U8 => Stored::Unorm(8),
            Self::U16 => Stored::Unorm(16),
        }
    }

    fn read(self, bytes: &[u8]) -> Vec<f64> {
        let word = |b: &[u8]| u16::from_le_bytes([b[0], b[1]]);
        match self {
            Self::U8 => bytes.iter().map(|&b| f64::from(b) / 255.0).collect(),
            Self::U16 => bytes.chunks_exact(2).map(|b| f64::from(word(b)) / 65535.0).collect(),
            Self::F16 => bytes.chunks_exact(2).map(|b| f64::from(half::f16::from_bits(word(b)))).collect(),
            Self::F32 => {
                bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect()
            }
            Self::F64 => bytes
                .chunks_exact(8)
                .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]))
                .collect(),
        }
    }
}

impl std::str::FromStr for RawNumber {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "f16" => Ok(Self::F16),
            "f32" => Ok(Self::F32),
            "f64" => Ok(Self::F64),
            "u8" => Ok(Self::U8),
            "u16" => Ok(Self::U16),
            _ => Err(Error::usage(format!("no number is called {text:?}"), "use f16, f32, f64, u8 or u16")),
        }
    }
}

impl std::str::FromStr for Shape {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || {
            Error::usage(
                format!("shape {text:?} is no shape"),
                "write WIDTHxHEIGHT, WIDTHxHEIGHTxCHANNELS or WIDTHxHEIGHTxDEPTHxCHANNELS, such as 64x64x2",
            )
        };
        let parts: Vec<usize> = text
            .split(['x', 'X', '×'])
            .map(|part| part.trim().parse().ok().filter(|&n| n > 0))
            .collect::<Option<_>>()
            .ok_or_else(wrong)?;
        match parts[..] {
            [w] => Ok(Self { size: [w, 1, 1], channels: 1 }),
            [w, h] => Ok(Self { size: [w, h, 1], channels: 1 }),
            [w, h, c] => Ok(Self { size: [w, h, 1], channels: c }),
            [w, h, d, c] => Ok(Self { size: [w, h, d], channels: c }),
            _ => Err(wrong()),
        }
    }
}

impl Shape {
    fn len(&self) -> Option<usize> {
        self.size.iter().try_fold(self.channels, |n, &s| n.checked_mul(s))
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [w, h, d] = self.size;
        match (d, self.channels) {
            (1, c) => write!(f, "{w}x{h}x{c}"),
            (d, c) => write!(f, "{w}x{h}x{d}x{c}"),
        }
    }
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
        roughness(&self.values, Shape { size: self.size, channels: self.channels.len() }, false)
    }

    /// The values of channel `c`, in the order of the texels.
    pub fn channel(&self, c: usize) -> Vec<f64> {
        self.values.iter().copied().skip(c).step_by(self.channels.len()).collect()
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

    fn of_image(image: &Image, source: &str, format: TexelFormat) -> Result<Self> {
        let n = image.channels.len();
        let mut values: Vec<f64> = image.texels.iter().map(|&v| f64::from(v)).collect();
        let (mut names, mut size) = (image.channels.clone(), [image.width, image.height, 1]);
        // `slice00.name`, `slice01.name` …: layers of a volume.
        let slices: Option<Vec<(usize, &str)>> = image
            .channels
            .iter()
            .map(|name| {
                let (slice, rest) = name.strip_prefix("slice")?.split_once('.')?;
                Some((slice.parse().ok()?, rest))
            })
            .collect();
        if let Some(slices) = slices {
            let depth = slices.iter().map(|(z, _)| z + 1).max().unwrap_or(1);
            let mut channels: Vec<&str> = vec![];
            for (_, name) in &slices {
                if !channels.contains(name) {
                    channels.push(name);
                }
            }
            if depth * channels.len() != n {
                return Err(Error::invalid(
                    format!("{n} layers, which do not make {depth} slices of {} channels", channels.len()),
                    "save every slice with the same channels",
                ));
            }
            let mut volume = vec![0.0; values.len()];
            let texels = image.width * image.height;
            for (from, (z, name)) in slices.iter().enumerate() {
                let to = channels.iter().position(|c| c == name).unwrap_or(0);
                for texel in 0..texels {
                    volume[(z * texels + texel) * channels.len() + to] = values[texel * n + from];
                }
            }
            (values, size[2]) = (volume, depth);
            names = channels.into_iter().map(str::to_owned).collect();
        }
        // OpenEXR sorts channels by name; a table's are red first.
        let mut order: Vec<usize> = (0..names.len()).collect();
        if names.iter().all(|name| RGBA.contains(&name.as_str())) {
            order.sort_by_key(|&c| RGBA.iter().position(|letter| *letter == names[c]));
        }
        let values = values.chunks_exact(names.len()).flat_map(|t| order.iter().map(|&c| t[c])).collect();
        let names = order.iter().map(|&c| names[c].clone()).collect();
        Self::of_named(size, names, values, source.to_owned(), format)
    }

    fn of_texture(texture: &Texture, source: &str) -> Result<Self> {
        if texture.faces != 1 {
            return Err(Error::unsupported(
                "a cube map, where a table was wanted",
                "give a two- or three-dimensional texture",
            ));
        }
        Self::of_level(texture, 0, source)
    }

    fn of_level(texture: &Texture, level: usize, source: &str) -> Result<Self> {
        let values = texture.values(level).into_iter().map(f64::from).collect();
        let n = texture.format.channels();
        let names = if texture.channels.len() == n { texture.channels.clone() } else { letters(n) };
        let [width, height] = texture.level_size(level);
        let size = [width, height, texture.layers(level)];
        Self::of_named(size, names, values, format!("{source}, {}", texture.format), texture.format)
    }

    /// An array whose axes are known; the last is that of a texel where the file names its channels, or where it is short.
    fn of_numbers(array: Array, source: &str, described: &Described) -> Result<Self> {
        let stored = array.number.map_or(Stored::F64, Stored::of_number);
        let named = (!array.channels.is_empty()).then_some(array.channels);
        let mut shape = array.shape;
        if let (Some(names), None) = (&named, described.shape) {
            // [rows, columns, channels]: sizes before the texel's, the slowest first.
            if shape.last() == Some(&names.len()) && shape.len() <= 4 {
                let channels = shape.pop().unwrap_or(1);
                shape.reverse();
                shape.resize(3, 1);
                let shape = Shape { size: [shape[0], shape[1], shape[2]], channels };
                let grid = Self::of_flat(array.values, stored, shape, false, source.to_owned())?;
                let channels = grid.channels.iter().zip(names);
                let channels = channels.map(|(c, name)| GridChannel { name: name.clone(), stored: c.stored }).collect();
                return Ok(Self { channels, ..grid });
            }
        }
        Self::of_array(literals::Array { name: String::new(), values: array.values, shape, stored }, described)
            .map(|grid| Self { source: source.to_owned(), ..grid })
    }

    fn of_other(bytes: &[u8], kind: &'static str, described: &Described) -> Result<Self> {
        let looks_like_text = kind == "a text file" || !bytes.iter().take(4096).any(|&b| b == 0);
        if described.number.is_none()
            && (looks_like_text || described.array.is_some())
            && let Ok(text) = std::str::from_utf8(bytes)
        {
            if let Some(file) = embedded::choose(text, described.array.as_deref())? {
                let grid = Self::decode(&file.bytes, &Described { array: None, ..described.clone() })?;
                return Ok(Self { source: format!("{} in the string {} of a text", grid.source, file.name), ..grid });
            }
            return Self::of_array(literals::choose(text, described.array.as_deref())?, described);
        }
        if kind != "a file of an unknown kind" && described.number.is_none() {
            return Err(Error::unsupported(
                format!("{kind}, which Kiln does not read"),
                "give a KTX2, KTX, DDS, EXR, HDR, PNG or NPY file, source text, or the bare numbers with --shape",
            ));
        }
        let Some(shape) = described.shape else {
            return Err(Error::usage(
                "a file of an unknown kind",
                "if it holds bare numbers, say how many: --shape 64x64x2, and --number f16, f32, f64, u8 or u16",
            ));
        };
        let n = shape.len().unwrap_or(usize::MAX);
        let number = match described.number {
            Some(number) => number,
            None if n.checked_mul(2) == Some(bytes.len()) => RawNumber::F16,
            None if n.checked_mul(4) == Some(bytes.len()) => RawNumber::F32,
            None if n.checked_mul(8) == Some(bytes.len()) => RawNumber::F64,
            None => RawNumber::U8,
        };
        if n.checked_mul(number.bytes()) != Some(bytes.len()) {
            return Err(Error::invalid(
                format!("{} bytes, which are not {shape} numbers of {} bytes", bytes.len(), number.bytes()),
                "correct --shape or --number",
            ));
        }
        Self::of_flat(number.read(bytes), number.stored(), shape, described.planar, "bare numbers".to_owned())
    }

    fn of_array(array: literals::Array, described: &Described) -> Result<Self> {
        let source = match array.name.as_str() {
            "" => "source text".to_owned(),
            name => format!("source text, array {name}"),
        };
        let shape = match (described.shape, &array.shape[..]) {
            (Some(shape), _) => shape,
            (None, &[w]) => guess_shape(&array.values, w, described.planar)?,
            (None, &[h, w]) if w <= 4 && h > 8 => guess_shape(&array.values, h * w, described.planar)?,
            (None, &[h, w]) => Shape { size: [w, h, 1], channels: 1 },
            (None, &[h, w, c]) if c <= 4 => Shape { size: [w, h, 1], channels: c },
            (None, &[d, h, w]) => Shape { size: [w, h, d], channels: 1 },
            (None, &[d, h, w, c]) => Shape { size: [w, h, d], channels: c },
            (None, shape) => {
                return Err(Error::unsupported(
                    format!("an array of {} dimensions, where a table has four at most", shape.len()),
                    "say what it is with --shape WIDTHxHEIGHTxDEPTHxCHANNELS",
                ));
            }
        };
        if shape.len() != Some(array.values.len()) {
            return Err(Error::invalid(
                format!("{} numbers, which are not {shape}", array.values.len()),
                "correct --shape",
            ));
        }
        Self::of_flat(array.values, array.stored, shape, described.planar, source)
    }

    fn of_flat(values: Vec<f64>, stored: Stored, shape: Shape, planar: bool, source: String) -> Result<Self> {
        let values = if planar { interleaved(&values, shape.channels) } else { values };
        let names = letters(shape.channels);
        if stored == Stored::F32 {
            let format = TexelFormat::Plain { channels: shape.channels, number: Number::F32 };
            return Self::of_named(shape.size, names, values, source, format);
        }
        Self::new(shape.size, names, values, source, |_| stored)
    }

    /// Channels of floats, each as finely stored as its values show.
    fn of_named(
        size: [usize; 3],
        names: Vec<String>,
        values: Vec<f64>,
        source: String,
        format: TexelFormat,
    ) -> Result<Self> {
        let n = names.len();
        let kinds: Vec<Stored> = (0..n)
            .map(|c| {
                let channel: Vec<f64> = values.iter().copied().skip(c).step_by(n).collect();
                match format {
                    TexelFormat::Plain { number, .. } => Stored::of_floats(&channel, Stored::of_number(number)),
                    _ => Stored::Packed(format, c),
                }
            })
            .collect();
        Self::new(size, names, values, source, |c| kinds[c])
    }

    fn new(
        size: [usize; 3],
        names: Vec<String>,
        values: Vec<f64>,
        source: String,
        stored: impl Fn(usize) -> Stored,
    ) -> Result<Self> {
        let wanted = Shape { size, channels: names.len() }.len();
        if wanted != Some(values.len()) || values.is_empty() {
            return Err(Error::invalid(
                format!(
                    "{} numbers for {} texels of {} channels",
                    values.len(),
                    size.map(|s| s.to_string()).join(" × "),
                    names.len()
                ),
                "copy or export it again",
            ));
        }
        let channels = names.into_iter().enumerate().map(|(c, name)| GridChannel { name, stored: stored(c) }).collect();
        Ok(Self { size, channels, values, source })
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

const RGBA: [&str; 4] = ["R", "G", "B", "A"];

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
            Decoded::Texture(texture) => {
                let level = |level| Grid::of_level(&texture, level, kind.text())?.only(described.layer);
                (0..texture.levels.len()).map(level).collect()
            }
            _ => Ok(vec![Grid::decode(&bytes, described).map_err(|e| e.in_file(path))?]),
        },
    }
}

fn letters(n: usize) -> Vec<String> {
    (0..n).map(|c| if n <= 4 { RGBA[c].to_owned() } else { c.to_string() }).collect()
}

fn interleaved(values: &[f64], channels: usize) -> Vec<f64> {
    let texels = values.len() / channels.max(1);
    (0..texels).flat_map(|t| (0..channels).map(move |c| values[c * texels + t])).collect()
}

/// How much smoother the best shape must be than the next before it is taken for granted.
const CLEARLY_SMOOTHER: f64 = 1.3;

/// The shape in which flat numbers are smoothest: of one dimension, of a square or a cube, with one to four channels.
fn guess_shape(values: &[f64], n: usize, planar: bool) -> Result<Shape> {
    let mut shapes = vec![];
    for channels in 1..=4 {
        if !n.is_multiple_of(channels) {
            continue;
        }
        let texels = n / channels;
        let side = (texels as f64).sqrt().round() as usize;
        let edge = (texels as f64).cbrt().round() as usize;
        if side * side == texels && side > 1 {
            shapes.push(Shape { size: [side, side, 1], channels });
        }
        if edge * edge * edge == texels && edge > 1 {
            shapes.push(Shape { size: [edge; 3], channels });
        }
        if texels <= LONGEST_ROW && texels > 1 {
            shapes.push(Shape { size: [texels, 1, 1], channels });
        }
    }
    let mut rated: Vec<(f64, Shape)> = shapes.into_iter().map(|s| (roughness(values, s, planar), s)).collect();
    rated.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A smooth axis looks as smooth when it is cut into channels, or into shorter axes: take it whole.
    let best = rated.first().map_or(0.0, |r| r.0);
    let fewest = alike(&rated, best).map(|s| s.channels).min();
    let whole: Vec<Shape> = alike(&rated, best).filter(|s| Some(s.channels) == fewest).copied().collect();
    match rated[..] {
        [(_, only)] => Ok(only),
        [(best, shape), (next, _), ..] if next > CLEARLY_SMOOTHER * best => Ok(shape),
        _ if whole.len() == 1 => Ok(whole[0]),
        _ => Err(Error::usage(
            format!("{n} numbers without a shape"),
            format!(
                "give it as WIDTHxHEIGHTxCHANNELS, such as --shape {}",
                rated.first().map_or("64x64x2".to_owned(), |r| r.1.to_string())
            ),
        )),
    }
}

/// The shapes that are about as smooth as the best.
fn alike(rated: &[(f64, Shape)], best: f64) -> impl Iterator<Item = &Shape> {
    rated.iter().filter(move |(roughness, _)| *roughness <= CLEARLY_SMOOTHER * best).map(|(_, shape)| shape)
}

/// Texels of a table over one axis at most, where nothing says that it is one.
const LONGEST_ROW: usize = 1024;

/// The mean distance of neighbouring texels, along all dimensions and in parts of the mean distance of any two: small where the
/// shape is right.
fn roughness(values: &[f64], shape: Shape, planar: bool) -> f64 {
    let interleaved;
    let values = if planar {
        interleaved = self::interleaved(values, shape.channels);
        &interleaved
    } else {
        values
    };
    let (n, [w, h, d]) = (shape.channels, shape.size);
    let mut total = 0.0;
    for c in 0..n {
        let channel: Vec<f64> = values.iter().copied().skip(c).step_by(n).collect();
        let mean = channel.iter().sum::<f64>() / channel.len() as f64;
        let spread = channel.iter().map(|v| (v - mean).abs()).sum::<f64>() / channel.len() as f64;
        let mut worst = 0.0_f64;
        for (stride, size) in [(1, w), (w, h), (w * h, d)] {
            if size < 2 {
                continue;
            }
            // Distances in texture coordinates, not in texels: or else finer shapes always look smoother.
            let (mut sum, mut pairs) = (0.0, 0.0);
            for i in (0..channel.len()).filter(|i| i / stride % size + 1 < size) {
                sum += (channel[i + stride] - channel[i]).abs();
                pairs += 1.0;
            }
            worst = worst.max(sum / pairs * size as f64);
        }
        total += worst / spread.max(1e-12);
    }
    total / n as f64
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
    fn floats_that_were_bytes_or_halves_are_known() {
        let bytes: Vec<f64> = (0..50).map(|i| f64::from((i * 5) as f32 / 255.0)).collect();
        assert_eq!(Stored::of_floats(&bytes, Stored::F32), Stored::Unorm(8));
        let halves: Vec<f64> = (0..50).map(|i| f64::from(half::f16::from_f64(0.013 * f64::from(i)))).collect();
        assert_eq!(Stored::of_floats(&halves, Stored::F32), Stored::F16);
        // As Rust and JavaScript print floats: 0.9995117 is 0.99951171875.
        assert_eq!(Stored::of_decimals(&[0.93115234, 0.9897461, 0.9995117, 1.0], 8), Stored::F16);
        assert_eq!(Stored::of_decimals(&[0.93115234, 0.9897461, 0.9995118, 1.0], 8), Stored::Decimal(8));
        let floats: Vec<f64> = (0..50).map(|i| f64::from(0.013_f32 * i as f32)).collect();
        assert_eq!(Stored::of_floats(&floats, Stored::F32), Stored::F32);
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

    #[test]
    fn rounding_is_to_the_nearest_that_is_stored() {
        let round = |stored: Stored, v: f64| stored.round_beside(v, v);
        assert_eq!(round(Stored::Unorm(8), 0.5), 128.0 / 255.0);
        assert_eq!(round(Stored::Decimal(2), 0.126), 0.13);
        assert!((round(Stored::F16, 0.1) - 0.1).abs() <= 0.5 * Stored::F16.step(0.1));
        // A common exponent: beside 1.0, the nine bits of a small channel end where those of the large one do.
        let green = Stored::Packed(TexelFormat::Rgb9e5, 1);
        assert!(green.step(0.01) < 0.1 * green.step_beside(0.01, 1.0));
        assert_eq!(green.round_beside(0.01, 1.0), (0.01 * 256.0_f64).round() / 256.0);
    }
}
