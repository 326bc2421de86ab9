//! Reading OpenEXR; what is read and what refused stands at the head of the parent module.

use super::contain::contained;
use super::{CHANNELS_KEY, FACES, LEVELS_KEY, order_told, to_native};
use crate::colour::Primaries;
use crate::error::{Error, Result};
use crate::format::{Image, Texture, colour_order, memory};
use crate::pack::{Number, TexelFormat};
use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock};
use ::exr::math::RoundingMode;
use ::exr::meta::attribute::{AttributeValue, IntegerBounds, LevelMode, SampleType};
use ::exr::meta::header::{Header, standard_names};
use ::exr::meta::{BlockDescription, MetaData};
use ::exr::prelude::Compression;
use rayon::prelude::*;
use std::collections::HashSet;
use std::io::Cursor;

const DAMAGED: &str = "the file is damaged; copy or download it again";

/// Blocks decompressed at once: enough to keep every thread busy, few enough that a table of contents which names one block
/// a million times does not fill the memory.
const BLOCKS_AT_ONCE: usize = 64;

/// The picture in `bytes`: the first part's display window, its channels sorted by name as the format has them.
///
/// **Errors**: see the head of the parent module; also truncated or contradictory data.
pub fn decode(bytes: &[u8]) -> Result<Image> {
    decode_with_number(bytes).map(|(image, _)| image)
}

/// The same, and how its channels are stored: as halves, if any of them is.
///
/// **Errors**: as [`decode`].
pub fn decode_with_number(bytes: &[u8]) -> Result<(Image, Number)> {
    contained(|| decode_uncontained(bytes)).unwrap_or_else(|| Err(panicked()))
}

fn decode_uncontained(bytes: &[u8]) -> Result<(Image, Number)> {
    let reader = ::exr::block::read(Cursor::new(bytes), false).map_err(translate)?;
    let header = reader.headers().first().ok_or_else(|| Error::invalid("an OpenEXR without a part", DAMAGED))?.clone();
    check_size(reader.headers(), bytes.len())?;
    let numbers = check_channels(&header)?;
    let view = View::of(&header)?;

    let meta_data = reader.meta_data().clone();
    let mut chunks = reader
        .filter_chunks(false, |_, _, block| block.layer == 0 && block.level.x() == 0 && block.level.y() == 0)
        .map_err(translate)?;
    let n_blocks = chunks.len();
    let room = (view.width as u128) * (view.height as u128) * (4 * numbers.len() as u128);
    let size = format!("an OpenEXR of {} × {} texels and {} channels", view.width, view.height, numbers.len());
    memory::check_room(room, &size)?;
    let mut texels = vec![0.0; view.width * view.height * numbers.len()];
    for_blocks(&mut chunks, n_blocks, &meta_data, |block| view.place(block, &numbers, &mut texels))?;
    let mut metadata = metadata(&header);
    let mut channels = names(&header);
    if let Some(order) = order_told(&metadata, &channels) {
        texels = texels.chunks_exact(order.len()).flat_map(|texel| order.iter().map(|&c| texel[c])).collect();
        channels = order.iter().map(|&c| channels[c].clone()).collect();
    }
    metadata.retain(|(key, _)| key != CHANNELS_KEY);
    let primaries = primaries(&header)?;
    let image = Image { width: view.width, height: view.height, channels, texels, metadata, primaries };
    Ok((image, if numbers.contains(&Number::F16) { Number::F16 } else { Number::F32 }))
}

/// The texture in `bytes`: mips, or six parts that are called as the faces of a cube are; nothing for what is one picture.
///
/// **Errors**: as [`decode`]; also faces of several sizes or with other channels.
pub fn decode_texture(bytes: &[u8]) -> Result<Option<Texture>> {
    contained(|| texture_uncontained(bytes)).unwrap_or_else(|| Err(panicked()))
}

fn texture_uncontained(bytes: &[u8]) -> Result<Option<Texture>> {
    let reader = ::exr::block::read(Cursor::new(bytes), false).map_err(translate)?;
    let headers = reader.headers().to_vec();
    let Some(header) = headers.first() else { return Ok(None) };
    let name = |header: &Header| header.own_attributes.layer_name.as_ref().map(|name| string(name.as_slice()));
    let is_cube =
        headers.len() == 6 && headers.iter().zip(FACES).all(|(header, face)| name(header).as_deref() == Some(face));
    let n_levels = match header.blocks {
        BlockDescription::Tiles(tiles)
            if tiles.level_mode == LevelMode::MipMap && tiles.rounding_mode == RoundingMode::Down =>
        {
            header.layer_size.x().max(header.layer_size.y()).max(1).ilog2() as usize + 1
        }
        _ => 1,
    };
    // What crops its picture is no texture.
    let (data, display) = (header.data_window(), header.shared_attributes.display_window);
    if (!is_cube && (n_levels == 1 || headers.len() > 1)) || data != display {
        return Ok(None);
    }
    check_size(&headers, bytes.len())?;
    let numbers = check_channels(header)?;
    let alike = |other: &Header| {
        (other.layer_size, other.blocks, other.data_window()) == (header.layer_size, header.blocks, data)
            && other.channels == header.channels
    };
    if !headers.iter().all(alike) || is_cube && data.size.x() != data.size.y() {
        return Err(Error::invalid("faces of an OpenEXR that are not alike and square", "save the cube again"));
    }
    let mut metadata = metadata(header);
    let meant = metadata.iter().find(|(key, _)| key == LEVELS_KEY).and_then(|(_, levels)| levels.parse::<usize>().ok());
    let kept = meant.unwrap_or(n_levels).clamp(1, n_levels);

    let names = names(header);
    let order = order_told(&metadata, &names).or_else(|| colour_order(&names));
    let order = order.unwrap_or_else(|| (0..names.len()).collect());
    metadata.retain(|(key, _)| key != CHANNELS_KEY);
    let channels: Vec<String> = order.iter().map(|&channel| names[channel].clone()).collect();
    let number = if numbers.contains(&Number::F32) { Number::F32 } else { Number::F16 };
    let format = TexelFormat::Plain { channels: channels.len(), number };
    let [width, height] = [data.size.x(), data.size.y()];
    let empty = Texture { faces: headers.len(), channels, metadata, ..Texture::empty(format, width, height) };
    let empty = Texture { primaries: primaries(header)?.unwrap_or(empty.primaries), ..empty };
    let room = (width as u128) * (height as u128) * (8 * (numbers.len() * headers.len()) as u128);
    memory::check_room(room, &format!("an OpenEXR of {width} × {height} texels in {} parts", headers.len()))?;
    let sizes: Vec<[usize; 2]> = (0..kept).map(|level| empty.level_size(level)).collect();
    let mut levels: Vec<Vec<f32>> =
        sizes.iter().map(|[w, h]| vec![0.0; w * h * headers.len() * numbers.len()]).collect();

    let meta_data = reader.meta_data().clone();
    let mut chunks = reader
        .filter_chunks(false, |_, _, block| block.level.x() == block.level.y() && block.level.x() < kept)
        .map_err(translate)?;
    let n_blocks = chunks.len();
    for_blocks(&mut chunks, n_blocks, &meta_data, |block| {
        let (part, level) = (block.index.layer, block.index.level.x());
        let [width, height] = sizes[level];
        let area = width * height * numbers.len();
        let view = View { width, height, offset: [0, 0] };
        view.place(block, &numbers, &mut levels[level][part * area..(part + 1) * area]);
    })?;
    let mut texture = empty;
    for level in levels {
        let sorted: Vec<f32> =
            level.chunks_exact(order.len()).flat_map(|texel| order.iter().map(|&c| texel[c])).collect();
        texture.push_level(&sorted)?;
    }
    Ok(Some(texture))
}

/// Decompresses all blocks, some at once, and hands them on in their order.
///
/// **Errors**: damaged blocks; fewer different ones than the `n_blocks` that were announced.
fn for_blocks(
    chunks: &mut impl Iterator<Item = ::exr::error::Result<Chunk>>,
    n_blocks: usize,
    meta_data: &MetaData,
    mut place: impl FnMut(&UncompressedBlock),
) -> Result<()> {
    let mut seen = HashSet::new();
    loop {
        let batch: Vec<Chunk> =
            chunks.by_ref().take(BLOCKS_AT_ONCE).collect::<::exr::error::Result<_>>().map_err(translate)?;
        if batch.is_empty() {
            break;
        }
        let blocks: Vec<UncompressedBlock> =
            batch.into_par_iter().map(|chunk| decompress(chunk, meta_data)).collect::<Result<_>>()?;
        for block in &blocks {
            let (index, at) = (block.index, block.index.pixel_position);
            seen.insert((index.layer, index.level.x(), at.x(), at.y()));
            place(block);
        }
    }
    if seen.len() != n_blocks {
        let missing = n_blocks - seen.len();
        return Err(Error::invalid(format!("{missing} of the {n_blocks} blocks of the OpenEXR are missing"), DAMAGED));
    }
    Ok(())
}

/// Refuses sizes that `n_bytes` cannot hold, so that what is allocated for them stays in proportion to the file.
fn check_size(headers: &[Header], n_bytes: usize) -> Result<()> {
    let n_blocks = headers.iter().fold(0_usize, |sum, header| sum.saturating_add(header.chunk_count));
    let [width, height] = [headers[0].layer_size.x(), headers[0].layer_size.y()];
    // (Of several parts, the first alone bounds what is allocated for it, and each of a cube is like it.)
    let size = (width as u128) * (height as u128) * (headers[0].channels.bytes_per_pixel as u128);
    let most = (n_bytes as u128) * max_ratio(headers[0].compression);
    // Every block takes eight bytes of the table of contents alone.
    if n_blocks > n_bytes / 8 || size > most {
        return Err(Error::invalid(
            format!("{width} × {height} texels in an OpenEXR of {n_bytes} bytes, which cannot hold them"),
            DAMAGED,
        ));
    }
    if size == 0 {
        return Err(Error::invalid(format!("an OpenEXR of {width} × {height} texels, without content"), DAMAGED));
    }
    Ok(())
}

/// No honest file of this compression shrinks further.
fn max_ratio(compression: Compression) -> u128 {
    /// The most that deflate can do.
    const DEFLATE: u128 = 1032;
    match compression {
        Compression::Uncompressed => 1,
        Compression::RLE => 64,                     // 128 equal bytes in two
        Compression::B44 | Compression::B44A => 16, // at best 4 × 4 halves in three bytes
        Compression::ZIP1 | Compression::ZIP16 | Compression::PIZ => DEFLATE,
        Compression::PXR24 => 2 * DEFLATE, // drops a byte of four before
        _ => 64 * DEFLATE,                 // DWA keeps one coefficient of a block of 8 × 8, then deflates
    }
}

/// How each channel is stored.
fn check_channels(header: &Header) -> Result<Vec<Number>> {
    let number = |channel: &::exr::meta::attribute::ChannelDescription| {
        let name = string(channel.name.as_slice());
        if channel.sampling.x() != 1 || channel.sampling.y() != 1 {
            return Err(Error::unsupported(
                format!("channel `{name}` of the OpenEXR is subsampled (luminance and chroma)"),
                "save the picture with full-size channels R, G and B",
            ));
        }
        match channel.sample_type {
            SampleType::F16 => Ok(Number::F16),
            SampleType::F32 => Ok(Number::F32),
            SampleType::U32 => Err(Error::unsupported(
                format!("channel `{name}` of the OpenEXR holds u32 integers, where f16 or f32 is wanted"),
                "save the picture without that channel, or as half or float",
            )),
        }
    };
    header.channels.list.iter().map(number).collect()
}

fn decompress(chunk: Chunk, meta_data: &MetaData) -> Result<UncompressedBlock> {
    check_dwa_counters(&chunk, &meta_data.headers[0])?;
    // Contained again, because this runs on other threads, which would print the panic.
    let block = contained(|| UncompressedBlock::decompress_chunk(chunk, meta_data, false));
    let block = block.ok_or_else(panicked)?.map_err(translate)?;
    let [width, lines] = [block.index.pixel_size.x(), block.index.pixel_size.y()];
    let wanted = width * lines * meta_data.headers[0].channels.bytes_per_pixel;
    if block.data.len() != wanted {
        return Err(Error::invalid(
            format!("a block of the OpenEXR with {} bytes, where {wanted} are wanted", block.data.len()),
            DAMAGED,
        ));
    }
    Ok(block)
}

/// Refuses blocks of DWA compression whose counters are beyond what the block can hold: the crate allocates what they say,
/// be it a terabyte, and failing at that cannot be contained.
///
/// Such a block begins with eleven u64: of them 1, 6 and 7 count the bytes of its other, run-length and raw sections
/// uncompressed, 8 and 9 the 16-bit coefficients of its cosine transform.
fn check_dwa_counters(chunk: &Chunk, header: &Header) -> Result<()> {
    let (CompressedBlock::ScanLine(CompressedScanLineBlock { compressed_pixels_le: bytes, .. })
    | CompressedBlock::Tile(CompressedTileBlock { compressed_pixels_le: bytes, .. })) = &chunk.compressed_block
    else {
        return Ok(()); // deep data, which the crate refuses
    };
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let tile = header.get_block_data_indices(&chunk.compressed_block).map_err(translate)?;
    let size = header.get_absolute_block_pixel_coordinates(tile).map_err(translate)?.size;
    let n_bytes =
        |width: usize, height: usize| (width as u128) * (height as u128) * (header.channels.bytes_per_pixel as u128);
    if bytes.len() as u128 == n_bytes(size.x(), size.y()) {
        return Ok(()); // stored as it was, because compression made it no smaller
    }
    // The transform works on whole squares of 8 × 8; runs of one byte take two.
    let most = 2 * n_bytes(size.x() + 7, size.y() + 7);
    for counter in [1, 6, 7, 8, 9] {
        let count = bytes.get(8 * counter..).and_then(|rest| rest.first_chunk().copied()).map_or(0, u64::from_le_bytes);
        if u128::from(count) > most {
            return Err(Error::invalid(format!("a block of the OpenEXR that promises {count} bytes"), DAMAGED));
        }
    }
    Ok(())
}

/// The display window, and where the data window lies in it.
struct View {
    width: usize,
    height: usize,
    /// From the display window's first texel to the data window's.
    offset: [i64; 2],
}

impl View {
    fn of(header: &Header) -> Result<Self> {
        /// How much larger the display window may be than what the data window covers of it.
        const MAX_EMPTINESS: i128 = 16;
        let (display, data) = (header.shared_attributes.display_window, header.data_window());
        let [width, height] = [display.size.x(), display.size.y()];
        let offset = [
            i64::from(data.position.x()) - i64::from(display.position.x()),
            i64::from(data.position.y()) - i64::from(display.position.y()),
        ];
        let covered = |offset: i64, data: usize, display: usize| {
            i128::from((offset + data as i64).min(display as i64) - offset.max(0)).max(0)
        };
        let covered = covered(offset[0], data.size.x(), width) * covered(offset[1], data.size.y(), height);
        if covered == 0 || (width as i128) * (height as i128) > MAX_EMPTINESS * covered {
            return Err(Error::unsupported(
                format!(
                    "{} in {}, which leaves nothing or next to nothing to see",
                    window("data", data),
                    window("display", display)
                ),
                "save the picture uncropped, with equal data and display windows",
            ));
        }
        Ok(Self { width, height, offset })
    }

    /// Copies what is to be seen of `block` into the picture; `numbers` say how its channels are stored.
    fn place(&self, block: &UncompressedBlock, numbers: &[Number], texels: &mut [f32]) {
        let [width, lines] = [block.index.pixel_size.x(), block.index.pixel_size.y()];
        let start = [block.index.pixel_position.x(), block.index.pixel_position.y()];
        let inside = |at: i64, size: usize| usize::try_from(at).ok().filter(|&at| at < size);
        let mut rest = &block.data[..];
        // A block is its lines, a line its channels, a channel its numbers.
        for line in 0..lines {
            let y = inside((start[1] + line) as i64 + self.offset[1], self.height);
            for (channel, number) in numbers.iter().enumerate() {
                let (bytes, after) = rest.split_at(width * number.bytes());
                rest = after;
                let Some(y) = y else { continue };
                for (i, sample) in bytes.chunks_exact(number.bytes()).enumerate() {
                    if let Some(x) = inside((start[0] + i) as i64 + self.offset[0], self.width) {
                        texels[(y * self.width + x) * numbers.len() + channel] = value(*number, sample);
                    }
                }
            }
        }
    }
}

fn window(name: &str, bounds: IntegerBounds) -> String {
    let (size, at) = (bounds.size, bounds.position);
    format!("{name} window {} × {} at ({}, {})", size.x(), size.y(), at.x(), at.y())
}

/// The number in `sample`, in the byte order of the machine.
fn value(number: Number, sample: &[u8]) -> f32 {
    let mut bytes = [0; 4];
    let bytes = &mut bytes[..sample.len()];
    bytes.copy_from_slice(sample);
    to_native(bytes);
    match (number, &*bytes) {
        (Number::F16, &[a, b]) => half::f16::from_le_bytes([a, b]).to_f32(),
        (Number::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => f32::NAN, // cannot be: samples are cut to the number's size
    }
}

/// What the file says that its red, green and blue are.
fn primaries(header: &Header) -> Result<Option<Primaries>> {
    let xy = |v: ::exr::math::Vec2<f32>| [f64::from(v.x()), f64::from(v.y())];
    let said = header.shared_attributes.chromaticities;
    said.map_or(Ok(None), |c| Primaries::stated([xy(c.red), xy(c.green), xy(c.blue), xy(c.white)]))
}

/// The names of the channels, in the file's order.
fn names(header: &Header) -> Vec<String> {
    header.channels.list.iter().map(|channel| string(channel.name.as_slice())).collect()
}

/// The text attributes, but those that name the part.
fn metadata(header: &Header) -> Vec<(String, String)> {
    let mut pairs: Vec<(String, String)> = header
        .all_named_attributes()
        .filter(|(name, _)| ![standard_names::NAME, standard_names::VIEW].contains(name))
        .filter_map(|(name, value)| match value {
            AttributeValue::Text(text) => Some((string(name), string(text.as_slice()))),
            _ => None,
        })
        .collect();
    pairs.sort();
    pairs
}

/// Text as UTF-8, failing that as Latin-1, which older programs wrote.
fn string(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    }
}

fn panicked() -> Error {
    Error::invalid("the OpenEXR is broken in a way that its reader did not foresee", DAMAGED)
}

fn translate(error: ::exr::error::Error) -> Error {
    match error {
        ::exr::error::Error::NotSupported(what) => Error::unsupported(
            format!("the OpenEXR needs something that Kiln does not read: {what}"),
            "save it again as one flat part of half or float channels",
        ),
        other => Error::invalid(format!("the OpenEXR is broken: {other}"), DAMAGED),
    }
}
