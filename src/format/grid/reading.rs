//! A grid from what each kind of file holds.

use super::{Described, Grid, GridChannel, RawNumber, Shape, Stored, interleaved, letters, shape, stored};
use crate::error::{Error, Result};
use crate::format::{Array, Image, Texture, colour_order, embedded, literals};
use crate::pack::{Number, TexelFormat};

impl Grid {
    pub(crate) fn of_image(image: &Image, source: &str, format: TexelFormat) -> Result<Self> {
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
        let order = colour_order(&names).unwrap_or_else(|| (0..names.len()).collect());
        let values = values.chunks_exact(names.len()).flat_map(|t| order.iter().map(|&c| t[c])).collect();
        let names = order.iter().map(|&c| names[c].clone()).collect();
        Self::of_named(size, names, values, source.to_owned(), format)
    }

    pub(super) fn of_texture(texture: &Texture, source: &str) -> Result<Self> {
        if texture.faces != 1 {
            return Err(Error::unsupported(
                "a cube map, where a table was wanted",
                "give a two- or three-dimensional texture",
            ));
        }
        Self::of_level(texture, 0, source)
    }

    pub(super) fn of_level(texture: &Texture, level: usize, source: &str) -> Result<Self> {
        let values = texture.values(level).into_iter().map(f64::from).collect();
        let n = texture.format.channels();
        let names = if texture.channels.len() == n { texture.channels.clone() } else { letters(n) };
        let [width, height] = texture.level_size(level);
        let size = [width, height, texture.layers(level)];
        Self::of_named(size, names, values, format!("{source}, {}", texture.format), texture.format)
    }

    /// An array whose axes are known; the last is that of a texel where the file names its channels, or where it is short.
    pub(super) fn of_numbers(array: Array, source: &str, described: &Described) -> Result<Self> {
        // Whole numbers are bytes or words that stand for 0 to 1; one of zeros and ones alone is just that.
        let largest = array.values.iter().copied().fold(0.0, f64::max);
        let is_whole = array.number.is_none() && array.values.iter().all(|v| *v >= 0.0 && v.fract() == 0.0);
        let bits = (is_whole && (2.0..=65535.0).contains(&largest)).then_some(if largest <= 255.0 { 8 } else { 16 });
        let stored = match (array.number, bits) {
            (Some(number), _) => Stored::of_number(number),
            (None, Some(bits)) => Stored::Unorm(bits),
            (None, None) => Stored::F64,
        };
        let unit = if bits.is_some() { stored.step(0.0) } else { 1.0 };
        let array = Array { values: array.values.into_iter().map(|v| v * unit).collect(), ..array };
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

    pub(super) fn of_other(bytes: &[u8], kind: &'static str, described: &Described) -> Result<Self> {
        let is_unknown = kind == "a file of an unknown kind";
        let looks_like_text = kind == "a text file" || (is_unknown && !bytes.iter().take(4096).any(|&b| b == 0));
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
        if !is_unknown && described.number.is_none() {
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
            let sizes = described.number.map_or("1, 2, 4 or 8".to_owned(), |number| number.bytes().to_string());
            return Err(Error::invalid(
                format!("{} bytes, which are not {shape} numbers of {sizes} each", bytes.len()),
                "correct --shape or --number",
            ));
        }
        Self::of_flat(number.read(bytes), number.stored(), shape, described.planar, "bare numbers".to_owned())
    }

    pub(super) fn of_array(array: literals::Array, described: &Described) -> Result<Self> {
        let source = match array.name.as_str() {
            "" => "source text".to_owned(),
            name => format!("source text, array {name}"),
        };
        let shape = match (described.shape, &array.shape[..]) {
            (Some(shape), _) => shape,
            (None, &[w]) => shape::guess(&array.values, w, described.planar)?,
            (None, &[h, w]) if w <= 4 && h > 8 => shape::guess(&array.values, h * w, described.planar)?,
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
            return Self::of_named(shape.size, names, stored::as_floats(values), source, format);
        }
        Self::new(shape.size, names, values, source, |_| stored)
    }

    /// Channels of floats, each as finely stored as its values show.
    pub(super) fn of_named(
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

    pub(super) fn new(
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
}
