//! KTX 1 (`.ktx`), as Filament's tools write it and its loader reads it.
//!
//! - **Written**: two- and three-dimensional textures, arrays and cube maps with their mips, little-endian; rows, faces and levels padded to four
//!   bytes; metadata as NUL-terminated text, such as Filament's `sh`, nine lines of three numbers.
//! - **R11F_G11F_B10F** has the type 0x8C3A, as Filament's cmgen writes it: its engine stops at the 0x8C3B that the format asks for. Both are read.
//! - **Codes of four bytes** (RGBM, RGBP, RGBD) are RGBA8; the key `kiln.packing` says what they stand for.
//! - **Colour**: the format says nothing of primaries.
//! - **Read**: the same, little-endian only. Sizes are checked against the length of the file before anything is allocated for them.
//!
//! **Source**: Khronos, *KTX File Format Specification* 1.0; the type of R11F_G11F_B10F from files that cmgen wrote.

use super::{Texture, ktx2};
use crate::error::{Error, Result};
use crate::pack::{Number, TexelFormat};

/// What every KTX 1 file begins with.
pub const MAGIC: [u8; 12] = *b"\xabKTX 11\xbb\r\n\x1a\n";

/// The key of Filament's nine coefficients of the irradiance.
pub const SH_KEY: &str = "sh";

const DAMAGED: &str = "the file is damaged; copy or download it again";
/// Bytes of identifier and header.
const HEADER: usize = 64;
/// Marks a file of this machine's byte order.
const ENDIANNESS: u32 = 0x0403_0201;
/// Rows, faces, levels and pairs are padded to this.
const ALIGNMENT: usize = 4;

/// What OpenGL calls a texel format.
struct Gl {
    format: TexelFormat,
    /// 0 for compressed texels.
    kind: u32,
    /// Bytes of what another byte order would swap.
    type_size: u32,
    /// 0 for compressed texels.
    layout: u32,
    internal: u32,
    base: u32,
}

const RED: u32 = 0x1903;
const RG: u32 = 0x8227;
const RGB: u32 = 0x1907;
const RGBA: u32 = 0x1908;
const UNSIGNED_BYTE: u32 = 0x1401;
const UNSIGNED_SHORT: u32 = 0x1403;
const FLOAT: u32 = 0x1406;
const HALF_FLOAT: u32 = 0x140b;
const UNSIGNED_INT_5_9_9_9_REV: u32 = 0x8c3e;
/// What cmgen writes for the type of R11F_G11F_B10F: the name of the format.
const R11F_G11F_B10F: u32 = 0x8c3a;
const UNSIGNED_INT_10F_11F_11F_REV: u32 = 0x8c3b;

fn gl(format: TexelFormat) -> Result<Gl> {
    use TexelFormat::{B10g11r11, Bc6h, Plain, Rgb9e5, Rgbd, Rgbe, Rgbm, Rgbp, UastcHdr};
    let (kind, type_size, layout, internal, base) = match format {
        Plain { channels: channels @ 1..=4, number } => {
            let layout = [RED, RG, RGB, RGBA][channels - 1];
            let (kind, internal) = match number {
                Number::Unorm8 => (UNSIGNED_BYTE, [0x8229, 0x822b, 0x8051, 0x8058]),
                Number::Unorm16 => (UNSIGNED_SHORT, [0x822a, 0x822c, 0x8054, 0x805b]),
                Number::F16 => (HALF_FLOAT, [0x822d, 0x822f, 0x881b, 0x881a]),
                Number::F32 => (FLOAT, [0x822e, 0x8230, 0x8815, 0x8814]),
            };
            (kind, number.bytes() as u32, layout, internal[channels - 1], layout)
        }
        Rgbm | Rgbp | Rgbd => (UNSIGNED_BYTE, 1, RGBA, 0x8058, RGBA),
        Rgb9e5 => (UNSIGNED_INT_5_9_9_9_REV, 4, RGB, 0x8c3d, RGB),
        B10g11r11 => (R11F_G11F_B10F, 4, RGB, R11F_G11F_B10F, RGB),
        Bc6h => (0, 1, 0, 0x8e8f, RGB),
        UastcHdr | Rgbe | Plain { .. } => {
            return Err(Error::usage(
                format!("KTX 1 has no texel format {format}"),
                format!("use one of {}", TexelFormat::names()),
            ));
        }
    };
    Ok(Gl { format, kind, type_size, layout, internal, base })
}

/// The file that holds `texture`.
///
/// **Errors**: sizes or levels that contradict each other; a texel format that OpenGL has no name for; keys that are empty or hold a NUL.
pub fn encode(texture: &Texture) -> Result<Vec<u8>> {
    texture.check()?;
    let gl = gl(texture.format)?;
    let pairs = key_values(texture)?;
    let mut file = MAGIC.to_vec();
    let header = [
        ENDIANNESS,
        gl.kind,
        gl.type_size,
        gl.layout,
        gl.internal,
        gl.base,
        to_u32(texture.width)?,
        to_u32(texture.height)?,
        to_u32(texture.depth)?,
        to_u32(texture.array_layers)?,
        to_u32(texture.faces)?,
        to_u32(texture.levels.len())?,
        to_u32(pairs.len())?,
    ];
    header.iter().for_each(|word| file.extend(word.to_le_bytes()));
    file.extend(pairs);
    for (level, bytes) in texture.levels.iter().enumerate() {
        let picture = padded_picture_bytes(texture, level).ok_or_else(too_large)?;
        file.extend(to_u32(image_size(texture, level, picture)?)?.to_le_bytes());
        let row = row_bytes(texture, level);
        for row in bytes.chunks_exact(row) {
            file.extend_from_slice(row);
            file.resize(file.len().next_multiple_of(ALIGNMENT), 0);
        }
    }
    Ok(file)
}

/// What a level's size is said to be: that of one face where it is a cube that is no array.
fn image_size(texture: &Texture, level: usize, picture: usize) -> Result<usize> {
    let is_lone_cube = texture.faces == 6 && texture.array_layers == 0;
    let pictures = if is_lone_cube { 1 } else { texture.layers(level) };
    picture.checked_mul(pictures).ok_or_else(too_large)
}

/// Bytes of a row of texels, or of blocks.
fn row_bytes(texture: &Texture, level: usize) -> usize {
    texture.level_size(level)[0].div_ceil(texture.format.block()) * texture.format.block_bytes()
}

/// Bytes of a picture whose rows are padded; nothing where that overflows.
fn padded_picture_bytes(texture: &Texture, level: usize) -> Option<usize> {
    let [width, height] = texture.level_size(level);
    let blocks = width.div_ceil(texture.format.block()).checked_mul(texture.format.block_bytes())?;
    blocks.checked_next_multiple_of(ALIGNMENT)?.checked_mul(height.div_ceil(texture.format.block()))
}

fn key_values(texture: &Texture) -> Result<Vec<u8>> {
    let own = [("KTXwriter".to_owned(), concat!("kiln ", env!("CARGO_PKG_VERSION")).to_owned())];
    let metadata = texture.metadata.iter().filter(|(key, _)| key != "KTXwriter" && key != ktx2::PACKING_KEY);
    let mut data = Vec::new();
    for (key, value) in own.iter().chain(metadata).chain(&ktx2::packing_pair(texture.format)) {
        if key.is_empty() || key.contains('\0') || value.contains('\0') {
            return Err(Error::usage(
                format!("metadata `{}` has an empty key or holds a NUL", key.escape_debug()),
                "use another key or value",
            ));
        }
        data.extend(to_u32(key.len() + value.len() + 2)?.to_le_bytes());
        data.extend_from_slice(&[key.as_bytes(), &[0], value.as_bytes(), &[0]].concat());
        data.resize(data.len().next_multiple_of(ALIGNMENT), 0);
    }
    Ok(data)
}

/// The texture in `bytes`.
///
/// **Errors**: another byte order, another texel format, a one-dimensional texture; truncated or contradictory data.
pub fn decode(bytes: &[u8]) -> Result<Texture> {
    let broken = |what: &str| Error::invalid(format!("the KTX {what}"), DAMAGED);
    if !bytes.starts_with(&MAGIC) || bytes.len() < HEADER {
        return Err(broken("ends within its header"));
    }
    let word = |i: usize| word_at(bytes, MAGIC.len() + 4 * i).unwrap_or(0);
    if word(0) != ENDIANNESS {
        return Err(Error::unsupported("a KTX of another byte order", "write it again on a little-endian machine"));
    }
    let stored = format_of(word(1), word(4))?;
    let [width, height, depth, array_layers, faces] = [6, 7, 8, 9, 10].map(|i| word(i) as usize);
    if width == 0 {
        return Err(broken("has no width"));
    }
    if height == 0 {
        return Err(Error::unsupported("a one-dimensional KTX", "export it again with a height of 1"));
    }
    let pairs_length = word(12) as usize;
    let pairs = bytes[HEADER..].get(..pairs_length).ok_or_else(|| broken("ends within its key/value data"))?;
    let mut metadata = read_pairs(pairs).ok_or_else(|| broken("has broken key/value data"))?;
    let format = ktx2::packing_of(stored, &mut metadata);
    let mut texture = Texture { depth, array_layers, faces, metadata, ..Texture::empty(format, width, height) };
    let mut rest = &bytes[HEADER + pairs_length..];
    for level in 0..(word(11) as usize).max(1) {
        let picture = padded_picture_bytes(&texture, level).ok_or_else(too_large)?;
        let size = word_at(rest, 0).ok_or_else(|| broken(&format!("ends before level {level}")))? as usize;
        if size != image_size(&texture, level, picture)? {
            return Err(broken(&format!("says that level {level} of {} takes {size} bytes", texture.text())));
        }
        let length = picture.checked_mul(texture.layers(level)).ok_or_else(too_large)?;
        let data = rest[4..].get(..length).ok_or_else(|| broken(&format!("ends within level {level}")))?;
        let row = row_bytes(&texture, level);
        let level_bytes = data.chunks_exact(row.next_multiple_of(ALIGNMENT)).flat_map(|padded| &padded[..row]);
        texture.levels.push(level_bytes.copied().collect());
        rest = &rest[4 + length..];
    }
    texture.check().map_err(|error| Error::invalid(format!("the KTX contradicts itself: {error}"), DAMAGED))?;
    Ok(texture)
}

/// The texel format of an internal format and a type.
fn format_of(kind: u32, internal: u32) -> Result<TexelFormat> {
    let is_it = |gl: &Gl| {
        let same_kind = gl.kind == kind || gl.kind == R11F_G11F_B10F && kind == UNSIGNED_INT_10F_11F_11F_REV;
        gl.internal == internal && same_kind
    };
    let known = TexelFormat::ALL.into_iter().filter_map(|format| gl(format).ok()).find(is_it);
    known.map(|gl| gl.format).ok_or_else(|| {
        Error::unsupported(
            format!("the KTX's texel format has glInternalFormat {internal:#06x} and glType {kind:#06x}"),
            format!("convert it to one of {}", TexelFormat::names()),
        )
    })
}

fn read_pairs(mut rest: &[u8]) -> Option<Vec<(String, String)>> {
    let mut pairs = vec![];
    while !rest.is_empty() {
        let length = word_at(rest, 0)? as usize;
        let pair = rest[4..].get(..length)?;
        let end = pair.iter().position(|&byte| byte == 0)?;
        let value = &pair[end + 1..];
        let value = String::from_utf8_lossy(value.strip_suffix(&[0]).unwrap_or(value)).into_owned();
        pairs.push((String::from_utf8_lossy(&pair[..end]).into_owned(), value));
        rest = rest.get(4 + length.next_multiple_of(ALIGNMENT)..).unwrap_or_default();
    }
    Some(pairs)
}

fn word_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..)?.first_chunk().copied()?))
}

fn too_large() -> Error {
    Error::usage("a level that no KTX can hold", "use a smaller size")
}

fn to_u32(n: usize) -> Result<u32> {
    u32::try_from(n).map_err(|_| Error::usage(format!("{n} bytes in a KTX, which ends at 4 GiB"), "use ktx2"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(mut texture: Texture, n: usize) -> Texture {
        for level in 0..n {
            let texels: usize =
                texture.level_box(level).iter().product::<usize>() * texture.faces * texture.array_layers.max(1);
            let most = texture.format.largest(0).min(40.0);
            let values: Vec<f64> =
                (0..texels * texture.format.channels()).map(|i| most * (i % 17) as f64 / 17.0).collect();
            texture.push_level(&values).unwrap();
        }
        texture
    }

    #[test]
    fn every_kind_of_texture_is_read_again() {
        for format in TexelFormat::ALL.into_iter().filter(|&f| gl(f).is_ok()) {
            let kinds = [
                levels(Texture::empty_cube(format, 5), 3),
                levels(Texture { depth: 3, ..Texture::empty(format, 5, 2) }, 2),
                levels(Texture { array_layers: 2, ..Texture::empty_cube(format, 2) }, 2),
            ];
            for mut texture in kinds {
                texture.metadata = vec![("sh".into(), "1 2 3\n".into())];
                let mut back = decode(&encode(&texture).unwrap()).unwrap();
                assert_eq!(back.metadata.remove(0).0, "KTXwriter");
                assert_eq!(back, texture, "{format}");
            }
        }
    }

    /// Offsets and constants by the specification, and by files of cmgen.
    #[test]
    fn a_cube_of_r11f_g11f_b10f_is_what_cmgen_writes() {
        let texture = levels(Texture::empty_cube(TexelFormat::B10g11r11, 2), 2);
        let file = encode(&texture).unwrap();
        let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap());
        assert_eq!([12, 16, 20, 24, 28, 32].map(word), [0x0403_0201, 0x8c3a, 4, 0x1907, 0x8c3a, 0x1907]);
        assert_eq!([36, 40, 44, 48, 52, 56].map(word), [2, 2, 0, 0, 6, 2]);
        let first = 64 + word(60) as usize;
        assert_eq!((word(first), word(first + 4 + 6 * 16)), (16, 4), "the size of one face");
        assert_eq!(file.len(), first + 4 + 6 * 16 + 4 + 6 * 4);
        let mut by_the_specification = file.clone();
        by_the_specification[16] = 0x3b;
        assert_eq!(decode(&by_the_specification).unwrap().levels, texture.levels);
    }

    #[test]
    fn rows_are_padded_to_four_bytes() {
        let (texture, _) = Texture::flat("rgb8unorm".parse().unwrap(), 3, 2, &[1.0; 18]).unwrap();
        let file = encode(&texture).unwrap();
        assert_eq!(
            file[file.len() - 28..],
            [&24_u32.to_le_bytes()[..], &[255; 9], &[0; 3], &[255; 9], &[0; 3]].concat()
        );
    }
}
