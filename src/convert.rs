//! Conversion of files between containers, packings, and panorama and cube, with what it cost.
//!
//! Nothing is lost in silence: rounding is measured by reading the packed texels again; what the new packing has no room for (values beyond its
//! largest, below zero, not finite) and what the new container has no place for (mips, faces, channels) is refused, unless a [`Conversion`]
//! says that it may go. Certificates stay behind: they are about the file that they came in.

use crate::certificate::{self, Certificate};
use crate::environment::{Cube, Panorama, area_average, from_cube};
use crate::error::{Error, Result};
use crate::format::{self, Container, Decoded, FormatSpec, Image, Packing, Texture, source};
use crate::pack::{PackReport, TexelFormat};
use serde::Serialize;

/// What a picture of the sphere is to become.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// What it is.
    Keep,
    /// A cube of that many texels along an edge; 0 is a quarter of the panorama's width.
    Cube(usize),
    /// A panorama of four times the cube's edge.
    Panorama,
}

/// What to make of a file.
#[derive(Debug, Clone)]
pub struct Conversion {
    /// The container and packing.
    pub format: FormatSpec,
    /// Panorama or cube.
    pub shape: Shape,
    /// Only that level of mips.
    pub level: Option<usize>,
    /// Only that many channels, the first.
    pub channels: Option<usize>,
    /// Whether values that the packing has no room for may be brought to what it has.
    pub clamp: bool,
    /// What an array in source code is called; `table` where nothing says it.
    pub name: Option<String>,
}

/// What a conversion did.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// How texels are stored now.
    pub format: String,
    /// What packing changed.
    pub packing: PackReport,
    /// Root mean square of what packing changed, over the finite values.
    pub rms_error: f64,
    /// Largest |unpacked − value|, clamped values included.
    pub max_error: f64,
    /// Values.
    pub count: u64,
    /// By how much the mean over the sphere changed at most, relative, where the shape changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flux_change: Option<f64>,
    /// What else is different.
    pub notes: Vec<String>,
}

/// Values before packing.
struct Content {
    /// What the result will be like, without levels and of no matter which format.
    like: Texture,
    /// Channels of the values.
    channels: Vec<String>,
    levels: Vec<Vec<f64>>,
    notes: Vec<String>,
}

/// The file that a decoded one becomes, and what that changed.
///
/// **Errors**: what would be lost without being allowed to; what the container cannot hold.
pub fn convert(decoded: Decoded, conversion: &Conversion) -> Result<(Vec<u8>, Report)> {
    let mut content = Content::of(decoded)?;
    if let Some(level) = conversion.level {
        content.keep_level(level)?;
    }
    let flux_change = content.reshape(conversion.shape)?;
    if let Some(n) = conversion.channels {
        content.keep_channels(n)?;
    }
    let mut texture = Texture { levels: vec![], ..content.like.clone() };
    texture.format = content.texel_format(conversion.format)?;
    content.fit_channels(texture.format.channels());
    texture.channels = content.channels.clone();
    if conversion.format.container().is_source() {
        texture.metadata.retain(|(key, _)| key != source::NAME_KEY);
        texture.metadata.extend(conversion.name.iter().map(|name| (source::NAME_KEY.to_owned(), name.clone())));
    }
    let mut report = Report {
        format: texture.format.to_string(),
        packing: PackReport::default(),
        rms_error: 0.0,
        max_error: 0.0,
        count: 0,
        flux_change,
        notes: content.notes.clone(),
    };
    let mut squares = 0.0;
    for (level, values) in content.levels.iter().enumerate() {
        let packing = texture.push_level(values)?;
        report.packing = report.packing.merge(packing);
        for (value, back) in values.iter().zip(texture.values(level)) {
            if value.is_finite() {
                let off = (f64::from(back) - value).abs();
                (squares, report.max_error, report.count) =
                    (squares + off * off, report.max_error.max(off), report.count + 1);
            }
        }
    }
    report.rms_error = (squares / report.count.max(1) as f64).sqrt();
    if !conversion.clamp {
        refuse_clamping(conversion.format, texture.format, &report.packing)?;
    }
    let file = format::encode(conversion.format, &texture)?;
    Ok((file, report))
}

fn refuse_clamping(spec: FormatSpec, format: TexelFormat, packing: &PackReport) -> Result<()> {
    let negative = if format.is_signed() { 0 } else { packing.negative };
    let nonfinite = if format.is_signed() { 0 } else { packing.nonfinite };
    if packing.overflowed + negative + nonfinite == 0 {
        return Ok(());
    }
    Err(Error::unsupported(
        format!(
            "{spec} has no room for {} values beyond {}, {negative} below zero and {nonfinite} that are not finite",
            packing.overflowed,
            format.largest(0)
        ),
        "choose an f32 format, or bring them to the nearest that it has with --clamp",
    ))
}

impl Content {
    fn of(decoded: Decoded) -> Result<Self> {
        match decoded {
            Decoded::Picture(image, format) => Ok(Self::of_picture(image, format)),
            Decoded::Texture(texture) => Ok(Self::of_texture(texture)),
            Decoded::Array(array) => {
                let [width, height, pictures, channels] = array.extent();
                let number = array.number.unwrap_or(crate::pack::Number::F32);
                let like = Texture {
                    depth: if array.shape.len() > 3 { pictures } else { 0 },
                    ..Texture::empty(TexelFormat::Plain { channels, number }, width, height)
                };
                let names = if array.channels.len() == channels { array.channels } else { like.channel_names() };
                let like = Texture { metadata: array.metadata, ..like };
                if array.values.is_empty() {
                    return Err(Error::unsupported("an array of nothing", "convert another"));
                }
                Ok(Self { like, channels: names, levels: vec![array.values], notes: vec![] }.without_certificate())
            }
        }
    }

    fn of_texture(texture: Texture) -> Self {
        let levels = (0..texture.levels.len()).map(|level| wide(&texture.values(level))).collect();
        // A texture has no names for its channels, but its certificate may.
        let n = texture.format.channels();
        let named = || Certificate::from_json(texture.metadata(certificate::KEY)?).ok()?.table.map(|t| t.channels);
        let channels = named().filter(|names| names.len() == n).unwrap_or_else(|| texture.channel_names());
        Self { like: Texture { levels: vec![], ..texture }, channels, levels, notes: vec![] }.without_certificate()
    }

    /// A picture's channels come in the order of colour, or of the table that its certificate names; an OpenEXR has them by name.
    fn of_picture(image: Image, format: TexelFormat) -> Self {
        let n = image.channels.len();
        let of_certificate = || {
            let table = Certificate::from_json(image.metadata(certificate::KEY)?).ok()?.table?;
            table.channels.iter().map(|name| image.channel_index(name)).collect::<Option<Vec<usize>>>()
        };
        let alpha = || image.channels.iter().position(|name| name.eq_ignore_ascii_case("A"));
        let colour = || {
            let rgb = image.colour_channels().ok().filter(|[r, _, b]| r != b)?;
            (n == 3 || n == 4 && alpha().is_some()).then(|| rgb.into_iter().chain(alpha()).collect::<Vec<usize>>())
        };
        let order =
            of_certificate().filter(|order| order.len() == n).or_else(colour).unwrap_or_else(|| (0..n).collect());
        let values = image.texels.chunks_exact(n).flat_map(|t| order.iter().map(|&c| f64::from(t[c]))).collect();
        let channels = order.iter().map(|&c| image.channels[c].clone()).collect();
        let mut like = Texture::empty(format, image.width, image.height);
        like.primaries = image.primaries.unwrap_or(like.primaries);
        like.metadata = image.metadata;
        Self { like, channels, levels: vec![values], notes: vec![] }.without_certificate()
    }

    fn without_certificate(mut self) -> Self {
        let before = self.like.metadata.len();
        self.like.metadata.retain(|(key, _)| key != certificate::KEY && key != "KTXwriter" && key != "Software");
        if self.like.metadata.len() < before && before > 0 {
            self.notes.push("the certificate stays behind: it is about the file that was converted".to_owned());
        }
        self
    }

    fn keep_level(&mut self, level: usize) -> Result<()> {
        if level >= self.levels.len() {
            return Err(Error::usage(
                format!("level {level} of a texture with {}", self.levels.len()),
                format!("give --level 0 to {}", self.levels.len() - 1),
            ));
        }
        let [width, height, depth] = self.like.level_box(level);
        (self.like.width, self.like.height) = (width, height);
        if self.like.depth > 0 {
            self.like.depth = depth;
        }
        self.levels = vec![self.levels.swap_remove(level)];
        Ok(())
    }

    fn keep_channels(&mut self, n: usize) -> Result<()> {
        let old = self.channels.len();
        if n == 0 || n > old {
            return Err(Error::usage(format!("{n} channels of {old}"), format!("give --channels 1 to {old}")));
        }
        self.channels.truncate(n);
        for level in &mut self.levels {
            *level = level.chunks_exact(old).flat_map(|t| t[..n].iter().copied()).collect();
        }
        Ok(())
    }

    /// The texel format of the result: as many channels as there are; an alpha of ones may go where the packing is of three channels, and one that
    /// nobody needs may come.
    fn texel_format(&mut self, spec: FormatSpec) -> Result<TexelFormat> {
        let n = self.channels.len();
        let format = match spec.packing() {
            Packing::Number(number) => return Ok(TexelFormat::Plain { channels: n, number }),
            Packing::Texel(format) => format,
        };
        if format.channels() >= n {
            return Ok(format);
        }
        if n == 4 && format.channels() == 3 && self.levels.iter().flatten().skip(3).step_by(4).all(|&a| a == 1.0) {
            self.keep_channels(3)?;
            self.notes.push("alpha, which is 1 everywhere, is left out".to_owned());
            return Ok(format);
        }
        Err(Error::unsupported(
            format!("{spec} holds {} channels, and there are {n}: {}", format.channels(), self.channels.join(", ")),
            format!("choose another format, or drop the last with --channels {}", format.channels()),
        ))
    }

    /// Fills channels that there are not: alpha with 1, others with 0.
    fn fit_channels(&mut self, n: usize) {
        let old = self.channels.len();
        if n == old {
            return;
        }
        let fill = |c: usize| if c == 3 && old == 3 { 1.0 } else { 0.0 };
        for level in &mut self.levels {
            let texels = level.chunks_exact(old);
            *level = texels.flat_map(|t| (0..n).map(|c| t.get(c).copied().unwrap_or_else(|| fill(c)))).collect();
        }
        self.notes.push(format!("{} of {n} channels were not there and are filled up", n - old));
        self.channels.clear();
    }

    /// Turns a panorama into a cube or back; the largest relative change of the mean over the sphere.
    fn reshape(&mut self, shape: Shape) -> Result<Option<f64>> {
        let is_cube = self.like.faces == 6;
        match shape {
            Shape::Keep => return Ok(None),
            Shape::Cube(_) if is_cube => {
                return Err(Error::usage("a cube that is to become a cube", "leave --shape out"));
            }
            Shape::Panorama if !is_cube => {
                return Err(Error::usage("no cube, where one is to become a panorama", "leave --shape out"));
            }
            _ => {}
        }
        if self.levels.len() > 1 || self.like.layers(0) != self.like.faces {
            return Err(Error::unsupported(
                format!(
                    "{} and {} levels, of which one cube or panorama is wanted",
                    self.like.text(),
                    self.levels.len()
                ),
                "choose a level with --level 0",
            ));
        }
        let colour = self.colour()?;
        let (before, after, texels) = if let Shape::Cube(size) = shape {
            let panorama = Panorama::new(self.like.width, self.like.height, colour)?;
            let size = if size == 0 { (self.like.width / 4).max(1) } else { size };
            let cube = area_average(&panorama, size);
            self.like = Texture {
                metadata: self.like.metadata.clone(),
                primaries: self.like.primaries,
                ..Texture::empty_cube(self.like.format, size)
            };
            (panorama.mean(), cube.mean(), cube.texels)
        } else {
            let cube = Cube { size: self.like.width, texels: colour };
            let panorama = from_cube(&cube)?;
            let [width, height] = [panorama.width(), panorama.height()];
            self.like = Texture {
                metadata: self.like.metadata.clone(),
                primaries: self.like.primaries,
                ..Texture::empty(self.like.format, width, height)
            };
            (cube.mean(), panorama.mean(), panorama.texels().to_vec())
        };
        self.levels = vec![wide(texels.as_flattened())];
        self.channels = ["R", "G", "B"].map(str::to_owned).to_vec();
        let change = |c: usize| if before[c] == after[c] { 0.0 } else { (after[c] / before[c] - 1.0).abs() };
        Ok(Some((0..3).map(change).fold(0.0, f64::max)))
    }

    /// The texels of the only level as colour.
    fn colour(&self) -> Result<Vec<[f32; 3]>> {
        let n = self.channels.len();
        let values = self.levels.first().map(Vec::as_slice).unwrap_or_default();
        match n {
            1 => Ok(values.iter().map(|&v| [v as f32; 3]).collect()),
            3 | 4 => Ok(values.chunks_exact(n).map(|t| [t[0] as f32, t[1] as f32, t[2] as f32]).collect()),
            _ => {
                Err(Error::unsupported(format!("{n} channels, where colour is wanted"), "give a picture of R, G and B"))
            }
        }
    }
}

/// The usual format for what a file holds, in a container.
///
/// **Errors**: those of [`FormatSpec::usual`].
pub fn usual_format(container: Container, decoded: &Decoded) -> Result<FormatSpec> {
    let channels = match decoded {
        Decoded::Picture(image, _) => image.channels.len(),
        Decoded::Texture(texture) => texture.format.channels(),
        Decoded::Array(array) => array.extent()[3],
    };
    // The same packing where the container has it: nothing is lost then.
    if let Some(format) = decoded.format()
        && let Ok(spec) = FormatSpec::new(container, format)
    {
        return Ok(spec);
    }
    FormatSpec::usual(container, channels)
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}
