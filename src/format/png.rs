//! PNG (`.png`): pictures of 8 and 16 bits.
//!
//! - **Written**: one, three or four channels of 8 or 16 bits, or codes of four bytes (RGBM, RGBP, RGBD; the key `kiln.packing` says which);
//!   metadata as international text. No `gAMA`, `sRGB` or profile: values are numbers, and a program that believed those would bend them.
//! - **Read**: the same, also palettes and fewer bits, widened to 8; grey with alpha has two channels. Numbers are what is stored, between 0
//!   and 1, whatever curve the file claims. Sizes are checked against the length of the file before anything is allocated for them.

use super::{Texture, ktx2, memory};
use crate::error::{Error, Result};
use crate::pack::{Number, TexelFormat};
use ::png::{BitDepth, ColorType, Compression, Decoder, Encoder, Limits, Transformations};
use std::io::Cursor;

const DAMAGED: &str = "the file is damaged; copy or download it again";

/// The most that deflate can do.
const MAX_RATIO: u64 = 1032;
/// The longest keyword that a text may have.
const MAX_KEY: usize = 79;

/// The file that holds `texture`, a picture.
///
/// **Errors**: a texel format that PNG does not have, mips, faces or slices; keys of metadata that are empty, beyond 79 characters or not of
/// Latin-1.
pub fn encode(texture: &Texture) -> Result<Vec<u8>> {
    texture.check_is_picture("png")?;
    let (colour, depth) = kind(texture.format).ok_or_else(|| {
        Error::usage(
            format!("PNG cannot hold {}", texture.format),
            "use r8unorm, rgb8unorm, rgba8unorm or their 16 bits",
        )
    })?;
    let internal = |error: ::png::EncodingError| {
        Error::unsupported(format!("a PNG that cannot be written: {error}"), "use a smaller size, or another container")
    };
    let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, size(texture.width), size(texture.height));
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::High);
    let own = [("Software".to_owned(), concat!("kiln ", env!("CARGO_PKG_VERSION")).to_owned())];
    let metadata = texture.metadata.iter().filter(|(key, _)| key != "Software" && key != ktx2::PACKING_KEY);
    for (key, value) in own.iter().chain(metadata).chain(&ktx2::packing_pair(texture.format)) {
        let fits = !key.is_empty() && key.chars().count() <= MAX_KEY && key.chars().all(|c| matches!(c, ' '..='~'));
        if !fits || value.contains('\0') {
            return Err(Error::usage(
                format!("metadata `{}`, which PNG cannot carry", key.escape_debug()),
                "use a key of 1 to 79 letters and a value without NUL",
            ));
        }
        encoder.add_itxt_chunk(key.clone(), value.clone()).map_err(internal)?;
    }
    let mut writer = encoder.write_header().map_err(internal)?;
    writer.write_image_data(&big_endian(&texture.levels[0], depth)).map_err(internal)?;
    writer.finish().map_err(internal)?;
    Ok(file)
}

/// The picture in `bytes`.
///
/// **Errors**: truncated or contradictory data; a size that the file cannot hold.
pub fn decode(bytes: &[u8]) -> Result<Texture> {
    let broken = |error: ::png::DecodingError| Error::invalid(format!("the PNG is broken: {error}"), DAMAGED);
    let limits = Limits { bytes: bytes.len().saturating_mul(MAX_RATIO as usize) };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::EXPAND);
    let info = decoder.read_header_info().map_err(broken)?;
    let (width, height) = (info.width as usize, info.height as usize);
    check_size(info, bytes.len())?;
    let mut reader = decoder.read_info().map_err(broken)?;
    let (colour, depth) = reader.output_color_type();
    let number = if depth == BitDepth::Sixteen { Number::Unorm16 } else { Number::Unorm8 };
    let stored = TexelFormat::new(colour.samples(), number)?;
    let size = reader.output_buffer_size().ok_or_else(|| Error::invalid("a PNG without end", DAMAGED))?;
    if stored.bytes(width, height) != Some(size) {
        return Err(Error::invalid(
            format!("a PNG of {size} bytes for {width} × {height} texels of {stored}"),
            DAMAGED,
        ));
    }
    let mut texels = vec![0; size];
    reader.next_frame(&mut texels).map_err(broken)?;
    // Texts may stand behind the picture.
    reader.finish().map_err(broken)?;
    let mut metadata = texts(reader.info());
    let format = ktx2::packing_of(stored, &mut metadata);
    Ok(Texture { levels: vec![big_endian(&texels, depth)], metadata, ..Texture::empty(format, width, height) })
}

/// A square picture of codes of four bytes, alone.
pub(super) fn encode_codes(size: usize, codes: &[u8]) -> Result<Vec<u8>> {
    let format = TexelFormat::Plain { channels: 4, number: Number::Unorm8 };
    encode(&Texture { levels: vec![codes.to_vec()], ..Texture::empty(format, size, size) })
}

/// The codes of a square picture of that size; without alpha the fourth byte is 255.
pub(super) fn decode_codes(size: usize, bytes: &[u8]) -> Result<Vec<u8>> {
    let texture = decode(bytes)?;
    let is_size = texture.width == size && texture.height == size;
    match texture.format.block_bytes() {
        4 if is_size && texture.format.channels() >= 3 => Ok(texture.levels.concat()),
        3 if is_size => Ok(texture.levels[0].chunks_exact(3).flat_map(|t| [t[0], t[1], t[2], 255]).collect()),
        _ => Err(Error::invalid(
            format!(
                "a face of {} × {} texels of {}, not {size}² of colour",
                texture.width, texture.height, texture.format
            ),
            DAMAGED,
        )),
    }
}

fn check_size(info: &::png::Info<'_>, n_bytes: usize) -> Result<()> {
    let (width, height) = (u64::from(info.width), u64::from(info.height));
    let bits = (info.color_type.samples() as u64) * (info.bit_depth as u64);
    let wanted = u128::from(width) * u128::from(height) * u128::from(bits) / 8;
    if wanted > u128::from(n_bytes as u64) * u128::from(MAX_RATIO) {
        return Err(Error::invalid(
            format!("{width} × {height} texels in a PNG of {n_bytes} bytes, which cannot hold them"),
            DAMAGED,
        ));
    }
    // Small palettes are widened to four bytes.
    memory::check_room(u128::from(width) * u128::from(height) * 8, &format!("a PNG of {width} × {height} texels"))
}

/// Colour type and depth of a texel format.
fn kind(format: TexelFormat) -> Option<(ColorType, BitDepth)> {
    let (channels, number) = match format {
        TexelFormat::Plain { channels, number } => (channels, number),
        TexelFormat::Rgbm | TexelFormat::Rgbp | TexelFormat::Rgbd => (4, Number::Unorm8),
        _ => return None,
    };
    let colour = match channels {
        1 => ColorType::Grayscale,
        2 => ColorType::GrayscaleAlpha,
        3 => ColorType::Rgb,
        4 => ColorType::Rgba,
        _ => return None,
    };
    match number {
        Number::Unorm8 => Some((colour, BitDepth::Eight)),
        Number::Unorm16 => Some((colour, BitDepth::Sixteen)),
        _ => None,
    }
}

/// Between little-endian, as packed, and the file's byte order; its own inverse.
fn big_endian(texels: &[u8], depth: BitDepth) -> Vec<u8> {
    match depth {
        BitDepth::Sixteen => texels.chunks_exact(2).flat_map(|pair| [pair[1], pair[0]]).collect(),
        _ => texels.to_vec(),
    }
}

/// The texts of all three kinds; those that cannot be read are left out.
fn texts(info: &::png::Info<'_>) -> Vec<(String, String)> {
    let plain = info.uncompressed_latin1_text.iter().map(|t| (t.keyword.clone(), t.text.clone()));
    let small = info.compressed_latin1_text.iter().filter_map(|t| Some((t.keyword.clone(), t.get_text().ok()?)));
    let international = info.utf8_text.iter().filter_map(|t| Some((t.keyword.clone(), t.get_text().ok()?)));
    plain.chain(small).chain(international).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        for name in
            ["r8unorm", "rgb8unorm", "rgba8unorm", "r16unorm", "rgb16unorm", "rgba16unorm", "rgbm", "rgbp", "rgbd"]
        {
            let format: TexelFormat = name.parse().unwrap();
            let values: Vec<f64> = (0..15 * format.channels()).map(|i| f64::from(i as u32) / 60.0).collect();
            let (mut texture, _) = Texture::flat(format, 5, 3, &values).unwrap();
            texture.metadata = vec![("kiln.certificate".into(), "{\"µ\":\"≤\"}".into())];
            let mut back = decode(&encode(&texture).unwrap()).unwrap();
            assert_eq!(back.metadata.remove(0).0, "Software");
            assert_eq!(back, texture, "{name}");
        }
    }

    #[test]
    fn what_png_does_not_have_is_refused() {
        let (half, _) = Texture::flat("rgba16f".parse().unwrap(), 1, 1, &[0.0; 4]).unwrap();
        assert!(encode(&half).unwrap_err().to_string().contains("PNG cannot hold rgba16f; use r8unorm"));
        let (volume, _) = Texture::volume("r8unorm".parse().unwrap(), [1, 1, 2], &[0.0; 2]).unwrap();
        assert!(encode(&volume).unwrap_err().to_string().contains("one picture; use ktx2"));
    }
}
