//! Conversion of files between containers, packings, and panorama and cube, with what it cost. The sphere stays turned as it was: what was
//! looked up with a vector still is.
//!
//! Nothing is lost in silence: rounding is measured by reading the packed texels again; what the new packing has no room for (values beyond its
//! largest, below zero, not finite) and what the new container has no place for (mips, faces, channels) is refused, unless a [`Conversion`]
//! says that it may go. Certificates stay behind: they are about the file that they came in.

use crate::certificate::{self, Certificate};
use crate::environment::{Orientation, Panorama, SphereLayout, SphereMap, atlas};
use crate::error::{Error, Result};
use crate::format::{self, Container, Decoded, FormatSpec, Grid, Image, Packing, Texture, colour_order, source};
use crate::pack::{PackReport, TexelFormat};
use glam::DVec3;
use serde::Serialize;
use std::borrow::Cow;

/// What a picture of the sphere is to become.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// What it is.
    Keep,
    /// A map of the sphere of that size ([`SphereLayout::shape`]); 0 is the usual one: of a panorama's width W, a cube's edge is W/4 and an octahedral
    /// map's W/2; a panorama is four times as wide as the edge of either.
    Map(SphereLayout, usize),
}

/// What to make of a file.
#[derive(Debug, Clone)]
pub struct Conversion {
    /// The container and packing.
    pub format: FormatSpec,
    /// Panorama, cube or octahedral map; an atlas is more than one map and is baked.
    pub shape: Shape,
    /// How the sphere lies in the input; nothing for what its certificate says, else a cube for what has six faces, an atlas for what is
    /// packed as one, and a panorama for any other picture. Of an atlas it is the largest mirror that is converted.
    pub from: Option<SphereLayout>,
    /// Only that layer of an array texture.
    pub layer: Option<usize>,
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
    /// Root mean square over the sphere of what a bilinear lookup of the new shape differs by from the old texels, in parts of theirs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resampling_rms: Option<f64>,
    /// What else is different.
    pub notes: Vec<String>,
    /// What bare texels are, to be written beside them: see [`format::raw::Layout`].
    #[serde(skip)]
    pub layout: Option<String>,
}

/// Values before packing.
struct Content {
    /// What the result will be like, without levels and of no matter which format.
    like: Texture,
    /// Channels of the values.
    channels: Vec<String>,
    levels: Vec<Vec<f64>>,
    /// The levels of a texture as they are packed, as long as they are what they were: packed again, blocks and codes of a factor come out otherwise.
    packed: Vec<Vec<u8>>,
    notes: Vec<String>,
}

/// The file that a decoded one becomes, and what that changed.
///
/// **Errors**: what would be lost without being allowed to; what the container cannot hold.
pub fn convert(decoded: Decoded, conversion: &Conversion) -> Result<(Vec<u8>, Report)> {
    let (said, turned) = said_of(&decoded);
    let from = conversion.from.or(said);
    let mut decoded = decoded;
    if let (Some(SphereLayout::Atlas), Decoded::Texture(texture)) = (from, &mut decoded) {
        texture.format = atlas::format_of(texture);
    }
    if let Some(layer) = conversion.layer {
        decoded = layer_of(decoded, layer)?;
    }
    let mut content = Content::of(decoded)?;
    if let Some(level) = conversion.level {
        content.keep_level(level)?;
    }
    let reshaped = content.reshape(from, conversion.shape)?;
    if let (Some(_), Some(turned)) = (reshaped, turned.filter(|turned| !turned.is_identity())) {
        content.notes.push(format!("the sphere stays turned as it was: the world's x,y,z are {turned} of it"));
    }
    if let Some(n) = conversion.channels {
        content.keep_channels(n)?;
    }
    if conversion.format.container() == Container::Exr && content.like.depth > 0 && content.levels.len() == 1 {
        content = content.into_slices();
    }
    let mut texture = Texture { levels: vec![], ..content.like.clone() };
    texture.format = content.texel_format(conversion.format)?;
    content.notes.extend(conversion.format.size_warning([texture.width, texture.height]));
    let is_raw = conversion.format.container() == Container::Raw;
    if is_raw {
        content
            .notes
            .push(format!("bare texels do not say that they are {}: the layout beside them does", texture.text()));
    }
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
        flux_change: reshaped.map(|change| change.flux),
        resampling_rms: reshaped.map(|change| change.rms),
        notes: content.notes.clone(),
        layout: None,
    };
    let is_copied = !content.packed.is_empty() && texture.format == content.like.format;
    let mut squares = 0.0;
    for (level, values) in content.levels.iter().enumerate() {
        let packing = if is_copied {
            texture.levels.push(std::mem::take(&mut content.packed[level]));
            as_it_is(values)
        } else {
            texture.push_level(values)?
        };
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
    if !conversion.clamp && !is_copied {
        refuse_clamping(conversion.format, texture.format, &report.packing)?;
    }
    let file = format::encode(conversion.format, &texture)?;
    if is_raw {
        report.layout = Some(format::raw::Layout::of(&texture, conversion.format).to_json()?);
    }
    Ok((file, report))
}

/// A layer of what a file holds.
fn layer_of(decoded: Decoded, layer: usize) -> Result<Decoded> {
    let Decoded::Texture(texture) = decoded else {
        return Err(Error::usage(format!("layer {layer} of what is no array texture"), "leave --layer out"));
    };
    texture.layer(layer).map(Decoded::Texture).ok_or_else(|| {
        let way_out = match texture.array_layers {
            0 => "leave --layer out".to_owned(),
            layers => format!("give --layer 0 to {}", layers - 1),
        };
        Error::usage(format!("layer {layer} of {}", texture.text()), way_out)
    })
}

/// What is told of values that stay as they are.
fn as_it_is(values: &[f64]) -> PackReport {
    let count = |of: fn(f64) -> bool| values.iter().filter(|&&value| of(value)).count() as u64;
    PackReport {
        negative: count(|value| value < 0.0),
        nonfinite: count(|value| !value.is_finite()),
        ..PackReport::default()
    }
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
            Decoded::Picture(image, format) => Self::of_picture(image, format),
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
                Ok(Self { like, channels: names, levels: vec![array.values], packed: vec![], notes: vec![] }
                    .without_certificate())
            }
        }
    }

    fn of_texture(texture: Texture) -> Self {
        let levels = (0..texture.levels.len()).map(|level| wide(&texture.values(level))).collect();
        // A texture has no names for its channels, but its certificate may.
        let n = texture.format.channels();
        let named = || Certificate::from_json(texture.metadata(certificate::KEY)?).ok()?.table.map(|t| t.channels);
        let channels = named().filter(|names| names.len() == n).unwrap_or_else(|| texture.channel_names());
        let packed = texture.levels;
        let like = Texture { levels: vec![], ..texture };
        Self { like, channels, levels, packed, notes: vec![] }.without_certificate()
    }

    /// A picture's channels come in the order of colour, or of the table that its certificate names; an OpenEXR has them by name.
    fn of_picture(image: Image, format: TexelFormat) -> Result<Self> {
        let grid = Grid::of_image(&image, "OpenEXR", format)?;
        if grid.size[2] > 1 {
            return Ok(Self::of_slices(image, grid, format));
        }
        let n = image.channels.len();
        let of_certificate = || {
            let table = Certificate::from_json(image.metadata(certificate::KEY)?).ok()?.table?;
            table.channels.iter().map(|name| image.channel_index(name)).collect::<Option<Vec<usize>>>()
        };
        // Colour in a layer of its own, `diffuse.R` and so on, or alone.
        let layer = || image.colour_channels().ok().filter(|[r, _, b]| r != b && n == 3).map(Vec::from);
        let colour = || colour_order(&image.channels).or_else(layer);
        let order =
            of_certificate().filter(|order| order.len() == n).or_else(colour).unwrap_or_else(|| (0..n).collect());
        let values = image.texels.chunks_exact(n).flat_map(|t| order.iter().map(|&c| f64::from(t[c]))).collect();
        let channels = order.iter().map(|&c| image.channels[c].clone()).collect();
        let mut like = Texture::empty(format, image.width, image.height);
        like.primaries = image.primaries.unwrap_or(like.primaries);
        like.metadata = image.metadata;
        Ok(Self { like, channels, levels: vec![values], packed: vec![], notes: vec![] }.without_certificate())
    }

    /// A volume whose slices were layers of channels; channels in the order of the table that the certificate names, else in the file's.
    fn of_slices(image: Image, grid: Grid, format: TexelFormat) -> Self {
        let n = grid.channels.len();
        let table = image.metadata(certificate::KEY).and_then(|json| Certificate::from_json(json).ok()?.table);
        let place = |name: &String| grid.channels.iter().position(|channel| channel.name == *name);
        let order = table.and_then(|table| table.channels.iter().map(place).collect::<Option<Vec<usize>>>());
        let order = order.filter(|order| order.len() == n).unwrap_or_else(|| (0..n).collect());
        let values = grid.values.chunks_exact(n).flat_map(|t| order.iter().map(|&c| t[c])).collect();
        let channels = order.iter().map(|&c| grid.channels[c].name.clone()).collect();
        let [width, height, depth] = grid.size;
        let like = Texture { depth, metadata: image.metadata, ..Texture::empty(format, width, height) };
        Self { like, channels, levels: vec![values], packed: vec![], notes: vec![] }.without_certificate()
    }

    /// The slices of a volume as layers of channels, `slice00.` and so on: what OpenEXR has for one.
    fn into_slices(mut self) -> Self {
        let (depth, n) = (self.like.depth, self.channels.len());
        let texels = self.like.width * self.like.height;
        let digits = (depth - 1).to_string().len().max(2);
        let (old, names) = (self.levels.swap_remove(0), std::mem::take(&mut self.channels));
        let layers = |texel| (0..depth).flat_map(move |z| (0..n).map(move |c| (z * texels + texel) * n + c));
        self.levels = vec![(0..texels).flat_map(layers).map(|at| old[at]).collect()];
        self.channels =
            (0..depth).flat_map(|z| names.iter().map(move |name| format!("slice{z:0digits$}.{name}"))).collect();
        self.notes.push(format!("{depth} slices are layers of channels, slice{:0digits$} and so on", 0));
        self.like.depth = 0;
        self
    }

    fn without_certificate(mut self) -> Self {
        const OURS: [&str; 2] = [certificate::KEY, certificate::LAYERS_KEY];
        let certified = self.like.metadata.iter().any(|(key, _)| OURS.contains(&key.as_str()));
        self.like.metadata.retain(|(key, _)| !OURS.contains(&key.as_str()) && key != "KTXwriter" && key != "Software");
        if certified {
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
        if !self.packed.is_empty() {
            self.packed = vec![self.packed.swap_remove(level)];
        }
        Ok(())
    }

    fn keep_channels(&mut self, n: usize) -> Result<()> {
        let old = self.channels.len();
        if n == 0 || n > old {
            return Err(Error::usage(format!("{n} channels of {old}"), format!("give --channels 1 to {old}")));
        }
        self.channels.truncate(n);
        if n < old {
            self.packed.clear();
        }
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

    /// Brings a map of the sphere to another layout or size, through the panorama that it is.
    fn reshape(&mut self, from: Option<SphereLayout>, shape: Shape) -> Result<Option<Reshaped>> {
        let Shape::Map(to, size) = shape else { return Ok(None) };
        let own = if self.like.faces == 6 { SphereLayout::Cube } else { SphereLayout::Equirect };
        let from = from.unwrap_or(own);
        if (from == SphereLayout::Cube) != (own == SphereLayout::Cube) {
            return Err(Error::usage(
                format!("{}, which is not {}", self.like.text(), from.article()),
                "correct --from, or leave it out",
            ));
        }
        if from == to && size == 0 {
            return Err(Error::usage(
                format!("{} that is to become {}", from.article(), to.article()),
                "leave --shape out, or give a --size",
            ));
        }
        if self.levels.len() > 1 || self.like.layers(0) != self.like.faces {
            return Err(Error::unsupported(
                format!(
                    "{} and {} levels, of which one {} is wanted",
                    self.like.text(),
                    self.levels.len(),
                    from.noun()
                ),
                if self.like.array_layers > 0 {
                    "choose one with --layer 0 and --level 0"
                } else {
                    "choose a level with --level 0"
                },
            ));
        }
        let before = Sphere::new(from, self.like.width, self.like.height, self.colour()?)?;
        let panorama = before.panorama()?;
        let map = match (to, size) {
            (SphereLayout::Equirect, 0) => None,
            (_, 0) => {
                let usual = panorama.width() / if to == SphereLayout::Cube { 4 } else { 2 };
                Some(SphereMap::area_average(&panorama, to, usual.max(1), &Orientation::default())?)
            }
            _ => Some(SphereMap::area_average(&panorama, to, size, &Orientation::default())?),
        };
        let after = match map {
            Some(map) => Sphere::Map(map),
            None => Sphere::Panorama(panorama.into_owned()),
        };
        let ([width, height], faces) = after.shape();
        self.like = Texture {
            faces,
            metadata: self.like.metadata.clone(),
            primaries: self.like.primaries,
            ..Texture::empty(self.like.format, width, height)
        };
        self.levels = vec![wide(after.texels().as_flattened())];
        self.packed.clear();
        self.channels = ["R", "G", "B"].map(str::to_owned).to_vec();
        let (old, new) = (before.mean(), after.mean());
        let change = |c: usize| if old[c] == new[c] { 0.0 } else { (new[c] / old[c] - 1.0).abs() };
        let flux = (0..3).map(change).fold(0.0, f64::max);
        Ok(Some(Reshaped { flux, rms: before.difference(&after) }))
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

/// What another shape changed.
#[derive(Debug, Clone, Copy)]
struct Reshaped {
    /// Of the mean over the sphere at most, relative.
    flux: f64,
    /// See [`Report::resampling_rms`].
    rms: f64,
}

/// A picture of the sphere; panoramas of any proportions.
enum Sphere {
    Panorama(Panorama),
    Map(SphereMap),
}

impl Sphere {
    fn new(layout: SphereLayout, width: usize, height: usize, texels: Vec<[f32; 3]>) -> Result<Self> {
        if layout == SphereLayout::Equirect {
            return Panorama::new(width, height, texels).map(Self::Panorama);
        }
        if layout == SphereLayout::Atlas {
            let mirror = atlas::specular(0);
            let texels = atlas::cut(&texels, &mirror)?;
            return Ok(Self::Map(SphereMap { layout, size: mirror.size, texels }));
        }
        if width != height {
            return Err(Error::invalid(
                format!("{} of {width} × {height}, which is no square", layout.article()),
                "correct --from, or leave it out",
            ));
        }
        Ok(Self::Map(SphereMap { layout, size: width, texels }))
    }

    fn panorama(&self) -> Result<Cow<'_, Panorama>> {
        match self {
            Self::Panorama(panorama) => Ok(Cow::Borrowed(panorama)),
            Self::Map(map) => map.to_panorama().map(Cow::Owned),
        }
    }

    fn shape(&self) -> ([usize; 2], usize) {
        match self {
            Self::Panorama(panorama) => ([panorama.width(), panorama.height()], 1),
            Self::Map(map) => map.layout.shape(map.size),
        }
    }

    fn texels(&self) -> &[[f32; 3]] {
        match self {
            Self::Panorama(panorama) => panorama.texels(),
            Self::Map(map) => &map.texels,
        }
    }

    fn mean(&self) -> [f64; 3] {
        match self {
            Self::Panorama(panorama) => panorama.mean(),
            Self::Map(map) => map.mean(),
        }
    }

    /// Direction of the centre of a texel.
    fn direction(&self, index: usize) -> DVec3 {
        match self {
            Self::Panorama(panorama) => {
                let width = panorama.width();
                panorama.texel_box(index % width, index / width).middle()
            }
            Self::Map(map) => map.direction(index),
        }
    }

    fn filtered(&self, direction: DVec3) -> [f64; 3] {
        match self {
            Self::Panorama(panorama) => panorama.filtered(direction),
            Self::Map(map) => map.filtered(direction),
        }
    }

    /// Root mean square of what `other` shows bilinearly at the texels of this, minus these, in parts of these.
    fn difference(&self, other: &Self) -> f64 {
        /// Texels that are looked at: so many of a large picture that their mean is known to a thousandth or so.
        const MOST: usize = 1 << 20;
        let texels = self.texels();
        let weights = match self {
            Self::Panorama(panorama) => (0..panorama.height()).map(|row| panorama.solid_angle(row)).collect(),
            Self::Map(map) => map.layout.solid_angles(map.size),
        };
        let run = texels.len() / weights.len();
        // A step that shares no factor with the width walks through all columns.
        let step = texels.len().div_ceil(MOST) | 1;
        let (mut off, mut all) = (0.0, 0.0);
        for index in (0..texels.len()).step_by(step) {
            let (seen, weight) = (other.filtered(self.direction(index)), weights[index / run]);
            for c in 0..3 {
                let value = f64::from(texels[index][c]);
                off += weight * (seen[c] - value).powi(2);
                all += weight * value * value;
            }
        }
        if off == 0.0 { 0.0 } else { (off / all).sqrt() }
    }
}

/// How the sphere lies in a file that says so, and how it is turned.
fn said_of(decoded: &Decoded) -> (Option<SphereLayout>, Option<Orientation>) {
    let certified = || Certificate::from_json(decoded.metadata(certificate::KEY)?).ok()?.environment;
    match (certified(), decoded) {
        (Some(recipe), _) => (Some(recipe.layout), Some(recipe.orientation)),
        (None, Decoded::Texture(texture)) if atlas::is(texture) => {
            (Some(SphereLayout::Atlas), atlas::ORIENTATION.parse().ok())
        }
        _ => (None, None),
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
    // The same packing where the container has it, or the same numbers of more channels: nothing is lost then.
    let same = decoded.format().into_iter().flat_map(|format| match format {
        TexelFormat::Plain { number, .. } => {
            (channels..=4).map(|channels| TexelFormat::Plain { channels, number }).collect()
        }
        other => vec![other],
    });
    same.map(|format| FormatSpec::new(container, format))
        .find_map(Result::ok)
        .map_or_else(|| FormatSpec::usual(container, channels), Ok)
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}
