//! OpenEXR (`.exr`).
//!
//! - **Written**: one part, scanlines, ZIP in blocks of 16 lines, all channels f16 or f32 (rounded once from what the image
//!   holds), metadata as text attributes. The same image gives the same bytes, for any number of threads.
//! - **Read**: the first part, its largest level, f16 and f32 channels in any compression; text attributes as metadata,
//!   sorted by key.
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

pub use read::{decode, decode_with_number};

use super::{Image, Texture};
use crate::colour::Primaries;
use crate::error::{Error, Result};
use crate::pack::{Number, PackReport};
use ::exr::block::UncompressedBlock;
use ::exr::meta::attribute::{self, AttributeValue, ChannelDescription, Chromaticities, LineOrder, SampleType, Text};
use ::exr::meta::header::{Header, standard_names};
use ::exr::meta::{BlockDescription, MetaData, Requirements, magic_number};
use ::exr::prelude::Compression;
use rayon::prelude::*;

/// What every OpenEXR file begins with.
pub const MAGIC: [u8; 4] = magic_number::BYTES;

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
    check_names("channel", image.channels.iter().map(String::as_str), |_| false)?;
    check_names("metadata key", image.metadata.iter().map(|(key, _)| key.as_str()), |key| {
        standard_names::ALL.contains(&key) && !STANDARD_TEXTS.contains(&key)
    })?;
    if image.width.max(image.height) > i32::MAX as usize {
        return Err(Error::usage(
            format!("a picture of {} × {} texels, where OpenEXR ends at 2147483647", image.width, image.height),
            "use a smaller size",
        ));
    }
    let (packed, report) = number.pack(&image.texels);
    // The format wants channels in the order of their names' bytes.
    let mut order: Vec<usize> = (0..image.channels.len()).collect();
    order.sort_by_key(|&channel| image.channels[channel].as_bytes());
    let header = header(image, number, &order);
    let (width, n_channels) = (image.width, image.channels.len());
    let file = assemble(&header, &image.metadata, |channel, x, y| {
        let at = ((y * width + x) * n_channels + order[channel]) * number.bytes();
        &packed[at..at + number.bytes()]
    });
    Ok((file.map_err(internal)?, report))
}

/// The file that holds `texture`, a picture of halves or f32.
///
/// **Errors**: as [`encode`]; also another texel format, mips, faces or slices.
pub fn encode_texture(texture: &Texture) -> Result<Vec<u8>> {
    texture.check_is_picture("exr")?;
    let number = texture
        .format
        .number()
        .filter(|number| number.is_signed())
        .ok_or_else(|| Error::usage(format!("OpenEXR cannot hold {}", texture.format), "use f16 or f32"))?;
    let image = Image {
        width: texture.width,
        height: texture.height,
        channels: texture.channel_names(),
        texels: texture.values(0),
        metadata: texture.metadata.clone(),
        primaries: Some(texture.primaries).filter(|&primaries| primaries != Primaries::REC709),
    };
    Ok(encode(&image, number)?.0)
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

fn header<T>(image: &Image<T>, number: Number, order: &[usize]) -> Header {
    let sample_type = match number {
        Number::F16 => SampleType::F16,
        _ => SampleType::F32, // encode has refused what is neither
    };
    let channels = order
        .iter()
        .map(|&channel| ChannelDescription::new(text(&image.channels[channel]), sample_type, false))
        .collect();
    let mut header = Header::new(text(""), (image.width, image.height), channels).with_encoding(
        Compression::ZIP16,
        BlockDescription::ScanLines,
        LineOrder::Increasing,
    );
    header.own_attributes.layer_name = None; // a single part needs none
    header.shared_attributes.chromaticities = image.primaries.map(|primaries| {
        let [red, green, blue, white] = primaries.chromaticities().map(|[x, y]| ::exr::math::Vec2(x as f32, y as f32));
        Chromaticities { red, green, blue, white }
    });
    header
}

/// As UTF-8; the crate's own conversion knows Latin-1 only.
fn text(string: &str) -> Text {
    Text::from_slice_unchecked(string.as_bytes())
}

/// The file: magic number, version, attributes by name, where each block is, blocks; `packed` finds the number of a
/// channel (as the header counts), a column and a row.
fn assemble<'a>(
    header: &Header,
    metadata: &[(String, String)],
    packed: impl Fn(usize, usize, usize) -> &'a [u8] + Sync,
) -> ::exr::error::Result<Vec<u8>> {
    let headers = std::slice::from_ref(header);
    MetaData::validate(headers, true)?;
    let mut attributes: Vec<(Vec<u8>, AttributeValue)> =
        header.all_named_attributes().map(|(name, value)| (name.to_vec(), value)).collect();
    for (key, value) in metadata {
        attributes.push((key.as_bytes().to_vec(), AttributeValue::Text(text(value))));
    }
    attributes.sort_by(|(a, _), (b, _)| a.cmp(b));
    let channels = header.channels.list.iter().map(|channel| channel.name.as_slice().len());
    let names = attributes.iter().map(|(name, _)| name.len()).chain(channels);
    let requirements = Requirements {
        file_format_version: 2,
        is_single_layer_and_tiled: false,
        has_long_names: names.max() > Some(MAX_SHORT_NAME),
        has_deep_data: false,
        has_multiple_layers: false,
    };
    let mut file = Vec::new();
    magic_number::write(&mut file)?;
    requirements.write(&mut file)?;
    for (name, value) in &attributes {
        attribute::write(name, value, &mut file)?;
    }
    file.push(0);

    let blocks: Vec<_> = ::exr::block::enumerate_ordered_header_block_indices(headers).collect();
    let chunks: Vec<Vec<u8>> = blocks
        .par_iter()
        .map(|&(_, block)| {
            let block = UncompressedBlock::from_lines(&header.channels, block, |line| {
                let (channel, start) = (line.location.channel, line.location.position);
                let size = line.value.len() / line.location.sample_count;
                for (i, sample) in line.value.chunks_exact_mut(size).enumerate() {
                    sample.copy_from_slice(packed(channel, start.x() + i, start.y()));
                    to_native(sample);
                }
            });
            let mut bytes = Vec::new();
            block.compress_to_chunk(headers)?.write(&mut bytes, 1)?;
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
