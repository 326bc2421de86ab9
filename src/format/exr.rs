//! OpenEXR (`.exr`).
//!
//! - **Written**: scanlines, ZIP in blocks of 16 lines, all channels f16 or f32 (rounded once from what the image
//!   holds), metadata as text attributes. The same image gives the same bytes, for any number of threads.
//! - **Mips** are OpenEXR's own: tiles of 64², levels rounded down. The format knows complete chains only, down to one texel: what lacks at the
//!   end of a shorter one is filled with averages of 2 × 2 texels, and the text attribute [`LEVELS_KEY`] tells how many levels are meant.
//! - **Cubes** are six parts, called `+X`, `-X`, `+Y`, `-Y`, `+Z`, `-Z`. The standard attribute `envmap` is not written: it stands for maps whose
//!   outermost texels lie on the edges of the cube, or on the poles, and for faces turned otherwise.
//! - **Read**: mips and six parts of those names as a texture; else the first part, its largest level. f16 and f32 channels in any compression; text
//!   attributes as metadata, sorted by key.
//! - **Colour**: the attribute `chromaticities`, read and written where the image has primaries.
//! - **Windows**: the picture is the display window. What the data window leaves of it is black, as OpenEXR defines it; what
//!   lies outside (overscan) is dropped. Windows that do not meet are refused.
//! - **Refused**: deep data, u32 channels, subsampled channels (luminance and chroma); sizes that the length of the file
//!   cannot hold, before anything is allocated for them.
//!
//! The file is put together here from the `exr` crate's parts, because its own writer takes custom attributes out of a
//! hash map, in another order at every run.

mod contain;
mod read;

pub use read::{decode, decode_texture, decode_with_number};

use super::{Image, Texture, colour_order};
use crate::colour::Primaries;
use crate::error::{Error, Result};
use crate::pack::{Number, PackReport};
use ::exr::block::UncompressedBlock;
use ::exr::math::{RoundingMode, Vec2};
use ::exr::meta::attribute::{
    self, AttributeValue, ChannelDescription, Chromaticities, LevelMode, LineOrder, SampleType, Text, TileDescription,
};
use ::exr::meta::header::{Header, standard_names};
use ::exr::meta::{BlockDescription, MetaData, Requirements, magic_number};
use ::exr::prelude::Compression;
use rayon::prelude::*;

/// What every OpenEXR file begins with.
pub const MAGIC: [u8; 4] = magic_number::BYTES;

/// The names of the parts that are the faces of a cube.
const FACES: [&str; 6] = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];

/// The text attribute that tells how many levels are meant, where the last ones only complete the chain.
pub const LEVELS_KEY: &str = "KilnLevels";

/// The text attribute that tells in which order channels are meant, where that is neither the one of their names, in which OpenEXR has them,
/// nor red, green, blue, alpha: a list in JSON.
pub const CHANNELS_KEY: &str = "KilnChannels";

/// Texels along the edge of a tile.
const TILE: usize = 64;

/// Standard attributes that hold text and that metadata may therefore set.
const STANDARD_TEXTS: [&[u8]; 6] = [
    standard_names::OWNER,
    standard_names::COMMENTS,
    standard_names::CAPTURE_DATE,
    standard_names::SOFTWARE,
    standard_names::RENDERING_TRANSFORM,
    standard_names::LOOK_MOD_TRANSFORM,
];

/// Names longer than this need a flag in the header; none may exceed [`MAX_NAME`].
const MAX_SHORT_NAME: usize = 31;
const MAX_NAME: usize = 255;

/// The file that holds `image` with all channels stored as `number`, and what packing changed.
///
/// **Errors**: channel names or metadata keys that are empty, doubled, too long or hold a NUL; a key that OpenEXR has
/// defined as something other than text (`compression`; `owner` is allowed); a size beyond 2³¹ − 1.
pub fn encode<T: Copy + Into<f64>>(image: &Image<T>, number: Number) -> Result<(Vec<u8>, PackReport)> {
    image.check_shape()?;
    if !number.is_signed() {
        return Err(Error::usage(format!("OpenEXR cannot hold {number}"), "use f16 or f32"));
    }
    let (packed, report) = number.pack(&image.texels);
    let contents = Contents {
        size: [image.width, image.height],
        channels: &image.channels,
        number,
        primaries: image.primaries,
        levels: 1,
        names: &[""],
    };
    Ok((contents.encode(&image.metadata, |_, _| &packed)?, report))
}

/// The file that holds `texture`, a picture or a cube of halves or f32, with or without mips.
///
/// **Errors**: as [`encode`]; also another texel format, slices or layers.
pub fn encode_texture(texture: &Texture) -> Result<Vec<u8>> {
    texture.check()?;
    if texture.depth > 0 || texture.array_layers > 0 {
        return Err(Error::unsupported(
            format!("{} in exr, which Kiln writes pictures and cubes to", texture.text()),
            "use ktx2, ktx1 or dds",
        ));
    }
    let number = texture
        .format
        .number()
        .filter(|number| number.is_signed())
        .ok_or_else(|| Error::usage(format!("OpenEXR cannot hold {}", texture.format), "use f16 or f32"))?;
    let channels = texture.channel_names();
    let n_levels = texture.levels.len();
    let contents = Contents {
        size: [texture.width, texture.height],
        channels: &channels,
        number,
        primaries: Some(texture.primaries).filter(|&primaries| primaries != Primaries::REC709),
        levels: n_levels,
        names: if texture.faces == 6 { &FACES } else { &[""] },
    };
    let mut metadata = texture.metadata.clone();
    metadata.retain(|(key, _)| key != LEVELS_KEY && key != CHANNELS_KEY);
    metadata.extend(order_to_tell(&channels));
    if n_levels == 1 {
        return contents.encode(&metadata, |face, _| texture.picture(0, face).unwrap_or_default());
    }
    let tails: Vec<Vec<Vec<u8>>> = (0..texture.faces).map(|face| tail(texture, face, number)).collect();
    if !tails[0].is_empty() {
        metadata.push((LEVELS_KEY.to_owned(), n_levels.to_string()));
    }
    contents.encode(&metadata, |face, level| {
        let beyond = || level.checked_sub(n_levels).and_then(|i| tails[face].get(i)).map(Vec::as_slice);
        texture.picture(level, face).or_else(beyond).unwrap_or_default()
    })
}

/// The attribute that tells the order of the channels, where a reader would not find it without.
fn order_to_tell(channels: &[String]) -> Option<(String, String)> {
    let mut sorted = channels.to_vec();
    sorted.sort_unstable();
    let found = colour_order(&sorted).map(|order| order.into_iter().map(|i| sorted[i].clone()).collect());
    (found.unwrap_or(sorted) != channels).then(|| (CHANNELS_KEY.to_owned(), serde_json::json!(channels).to_string()))
}

/// Where the channels stand in the file, in the order that they are meant in.
fn order_told(metadata: &[(String, String)], channels: &[String]) -> Option<Vec<usize>> {
    let (_, told) = metadata.iter().find(|(key, _)| key == CHANNELS_KEY)?;
    let told: Vec<String> = serde_json::from_str(told).ok()?;
    let order = told.iter().map(|name| channels.iter().position(|c| c == name)).collect::<Option<Vec<usize>>>()?;
    let is_whole = order.len() == channels.len() && (0..channels.len()).all(|channel| order.contains(&channel));
    is_whole.then_some(order)
}

/// The levels of a face that its chain lacks down to one texel: averages of 2 × 2 texels, packed.
fn tail(texture: &Texture, face: usize, number: Number) -> Vec<Vec<u8>> {
    let n = texture.format.channels();
    let last = texture.levels.len() - 1;
    let mut size = texture.level_size(last);
    let mut values: Vec<f64> = texture.face(last, face).unwrap_or_default().iter().map(|&v| f64::from(v)).collect();
    let mut levels = vec![];
    while size[0].max(size[1]) > 1 {
        let [width, height] = size.map(|s| (s / 2).max(1));
        let at = |x: usize, y: usize, c: usize| values[(y.min(size[1] - 1) * size[0] + x.min(size[0] - 1)) * n + c];
        let mean = |x: usize, y: usize, c: usize| {
            0.25 * [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[i, j]| at(2 * x + i, 2 * y + j, c)).iter().sum::<f64>()
        };
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        values = places.flat_map(|(x, y)| (0..n).map(move |c| (x, y, c))).map(|(x, y, c)| mean(x, y, c)).collect();
        size = [width, height];
        levels.push(number.pack(&values).0);
    }
    levels
}

fn check_names<'a>(
    what: &str,
    names: impl Iterator<Item = &'a str> + Clone,
    reserved: impl Fn(&[u8]) -> bool,
) -> Result<()> {
    for (i, name) in names.clone().enumerate() {
        let fault = if name.is_empty() || name.contains('\0') {
            "is empty or holds a NUL"
        } else if name.len() > MAX_NAME {
            "is longer than 255 bytes"
        } else if names.clone().take(i).any(|earlier| earlier == name) {
            "is there twice"
        } else if reserved(name.as_bytes()) {
            "means something else in OpenEXR"
        } else {
            continue;
        };
        return Err(Error::usage(format!("{what} `{}` {fault}", name.escape_debug()), "use another name"));
    }
    Ok(())
}

/// What a file is to hold, but for the texels.
struct Contents<'a> {
    size: [usize; 2],
    channels: &'a [String],
    number: Number,
    primaries: Option<Primaries>,
    /// More than one for mips.
    levels: usize,
    /// Of the parts; one without a name for a file of a single part.
    names: &'a [&'a str],
}

impl Contents<'_> {
    /// The file; `packed` finds the packed texels of a part and a level.
    fn encode<'a>(
        &self,
        metadata: &[(String, String)],
        packed: impl Fn(usize, usize) -> &'a [u8] + Sync,
    ) -> Result<Vec<u8>> {
        check_names("channel", self.channels.iter().map(String::as_str), |_| false)?;
        check_names("metadata key", metadata.iter().map(|(key, _)| key.as_str()), |key| {
            standard_names::ALL.contains(&key) && !STANDARD_TEXTS.contains(&key)
        })?;
        let [width, height] = self.size;
        if width.max(height) > i32::MAX as usize {
            return Err(Error::usage(
                format!("a picture of {width} × {height} texels, where OpenEXR ends at 2147483647"),
                "use a smaller size",
            ));
        }
        // The format wants channels in the order of their names' bytes.
        let mut order: Vec<usize> = (0..self.channels.len()).collect();
        order.sort_by_key(|&channel| self.channels[channel].as_bytes());
        let headers: Vec<Header> = self.names.iter().map(|name| self.header(name, &order)).collect();
        let (bytes, n_channels) = (self.number.bytes(), self.channels.len());
        let file = assemble(&headers, metadata, |part, level, channel, [x, y]| {
            let at = ((y * (width >> level).max(1) + x) * n_channels + order[channel]) * bytes;
            &packed(part, level)[at..at + bytes]
        });
        file.map_err(internal)
    }

    fn header(&self, name: &str, order: &[usize]) -> Header {
        let sample_type = match self.number {
            Number::F16 => SampleType::F16,
            _ => SampleType::F32, // what is neither has been refused
        };
        let channels = order
            .iter()
            .map(|&channel| ChannelDescription::new(text(&self.channels[channel]), sample_type, false))
            .collect();
        let blocks = match self.levels {
            1 => BlockDescription::ScanLines,
            _ => BlockDescription::Tiles(TileDescription {
                tile_size: Vec2(TILE, TILE),
                level_mode: LevelMode::MipMap,
                rounding_mode: RoundingMode::Down,
            }),
        };
        let mut header = Header::new(text(name), (self.size[0], self.size[1]), channels).with_encoding(
            Compression::ZIP16,
            blocks,
            LineOrder::Increasing,
        );
        if name.is_empty() {
            header.own_attributes.layer_name = None; // a single part needs none
        }
        header.shared_attributes.chromaticities = self.primaries.map(|primaries| {
            let [red, green, blue, white] = primaries.chromaticities().map(|[x, y]| Vec2(x as f32, y as f32));
            Chromaticities { red, green, blue, white }
        });
        header
    }
}

/// As UTF-8; the crate's own conversion knows Latin-1 only.
fn text(string: &str) -> Text {
    Text::from_slice_unchecked(string.as_bytes())
}

/// The file: magic number, version, each part's attributes by name, where each block is, blocks; `packed` finds the number of a
/// part, a level, a channel (as the header counts), a column and a row. Metadata belongs to the first part.
fn assemble<'a>(
    headers: &[Header],
    metadata: &[(String, String)],
    packed: impl Fn(usize, usize, usize, [usize; 2]) -> &'a [u8] + Sync,
) -> ::exr::error::Result<Vec<u8>> {
    MetaData::validate(headers, true)?;
    let named = |part: usize, header: &Header| {
        let own = header.all_named_attributes().map(|(name, value)| (name.to_vec(), value));
        let ours = metadata.iter().filter(|_| part == 0);
        let ours = ours.map(|(key, value)| (key.as_bytes().to_vec(), AttributeValue::Text(text(value))));
        let mut attributes: Vec<(Vec<u8>, AttributeValue)> = own.chain(ours).collect();
        attributes.sort_by(|(a, _), (b, _)| a.cmp(b));
        attributes
    };
    let attributes: Vec<Vec<_>> = headers.iter().enumerate().map(|(part, header)| named(part, header)).collect();
    let channels = headers[0].channels.list.iter().map(|channel| channel.name.as_slice().len());
    let names = attributes.iter().flatten().map(|(name, _)| name.len()).chain(channels);
    let requirements = Requirements {
        file_format_version: 2,
        is_single_layer_and_tiled: headers.len() == 1 && headers[0].blocks.has_tiles(),
        has_long_names: names.max() > Some(MAX_SHORT_NAME),
        has_deep_data: false,
        has_multiple_layers: headers.len() > 1,
    };
    let mut file = Vec::new();
    magic_number::write(&mut file)?;
    requirements.write(&mut file)?;
    for attributes in &attributes {
        for (name, value) in attributes {
            attribute::write(name, value, &mut file)?;
        }
        file.push(0);
    }
    if headers.len() > 1 {
        file.push(0); // no further part
    }

    let blocks: Vec<_> = ::exr::block::enumerate_ordered_header_block_indices(headers).collect();
    let chunks: Vec<Vec<u8>> = blocks
        .par_iter()
        .map(|&(_, block)| {
            let block = UncompressedBlock::from_lines(&headers[block.layer].channels, block, |line| {
                let (part, level) = (line.location.layer, line.location.level.x());
                let (channel, start) = (line.location.channel, line.location.position);
                let size = line.value.len() / line.location.sample_count;
                for (i, sample) in line.value.chunks_exact_mut(size).enumerate() {
                    sample.copy_from_slice(packed(part, level, channel, [start.x() + i, start.y()]));
                    to_native(sample);
                }
            });
            let mut bytes = Vec::new();
            block.compress_to_chunk(headers)?.write(&mut bytes, headers.len())?;
            Ok(bytes)
        })
        .collect::<::exr::error::Result<_>>()?;
    let mut at = file.len() + 8 * chunks.len();
    for chunk in &chunks {
        file.extend_from_slice(&(at as u64).to_le_bytes());
        at += chunk.len();
    }
    file.extend(chunks.into_iter().flatten());
    Ok(file)
}

/// Between little-endian, as packed, and the byte order of the machine, which the crate's blocks have; its own inverse.
fn to_native(number: &mut [u8]) {
    if cfg!(target_endian = "big") {
        number.reverse();
    }
}

/// An error of the crate where the input was checked beforehand.
fn internal(error: ::exr::error::Error) -> Error {
    Error::invalid(format!("OpenEXR could not be written: {error}"), "report this with the command that did it")
}
