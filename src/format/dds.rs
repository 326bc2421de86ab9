//! DirectDraw surfaces (`.dds`).
//!
//! - **Written**: two- and three-dimensional textures, arrays and cube maps with their mips, with the DX10 header; or, for lone textures of f16 and
//!   f32, with the header of Direct3D 9 alone, whose FourCC is then a number (113 for RGBA16F), which PlayCanvas and older programs want.
//! - **Order**: layer, face, level; a level of a three-dimensional texture is its slices.
//! - **Colour, metadata**: the format has neither; a certificate stands beside it.
//! - **Read**: the same. Other formats are refused by name; sizes are checked against the length of the file before anything is allocated for
//!   them.
//!
//! **Source**: Microsoft, *Programming guide for DDS* and the list of DXGI formats.

use super::Texture;
use crate::error::{Error, Result};
use crate::pack::{Number, TexelFormat};

/// What every DDS file begins with.
pub const MAGIC: &[u8; 4] = b"DDS ";

const DAMAGED: &str = "the file is damaged; copy or download it again";
/// Bytes of magic and header, and of the second header.
const HEADER: usize = 128;
const HEADER_DX10: usize = 20;

const FLAGS: u32 = 0x1 | 0x2 | 0x4 | 0x1000; // caps, height, width, pixel format
const FLAG_PITCH: u32 = 0x8;
const FLAG_MIPS: u32 = 0x2_0000;
const FLAG_LINEAR_SIZE: u32 = 0x8_0000;
const FLAG_DEPTH: u32 = 0x80_0000;
const PIXEL_FOURCC: u32 = 0x4;
const CAPS_TEXTURE: u32 = 0x1000;
const CAPS_COMPLEX: u32 = 0x8;
const CAPS_MIPS: u32 = 0x40_0000;
/// A cube with all its six faces.
const CAPS2_CUBE: u32 = 0xfe00;
const CAPS2_IS_CUBE: u32 = 0x200;
const CAPS2_VOLUME: u32 = 0x20_0000;
const DX10: u32 = u32::from_le_bytes(*b"DX10");
const DIMENSION_2D: u32 = 3;
const DIMENSION_3D: u32 = 4;
const MISC_CUBE: u32 = 4;

/// The number that DXGI has for a texel format.
fn dxgi(format: TexelFormat) -> Option<u32> {
    use Number::{F16, F32, Unorm8, Unorm16};
    use TexelFormat::{B10g11r11, Bc6h, Plain, Rgb9e5};
    Some(match format {
        Plain { channels: 4, number: F32 } => 2,
        Plain { channels: 3, number: F32 } => 6,
        Plain { channels: 4, number: F16 } => 10,
        Plain { channels: 4, number: Unorm16 } => 11,
        Plain { channels: 2, number: F32 } => 16,
        B10g11r11 => 26,
        Plain { channels: 4, number: Unorm8 } => 28,
        Plain { channels: 2, number: F16 } => 34,
        Plain { channels: 2, number: Unorm16 } => 35,
        Plain { channels: 1, number: F32 } => 41,
        Plain { channels: 2, number: Unorm8 } => 49,
        Plain { channels: 1, number: F16 } => 54,
        Plain { channels: 1, number: Unorm16 } => 56,
        Plain { channels: 1, number: Unorm8 } => 61,
        Rgb9e5 => 67,
        Bc6h => 95,
        _ => return None,
    })
}

/// The number that Direct3D 9 has for a texel format, in the place of the FourCC.
fn d3d9(format: TexelFormat) -> Option<u32> {
    let TexelFormat::Plain { channels, number } = format else { return None };
    Some(match (channels, number) {
        (1, Number::F16) => 111,
        (2, Number::F16) => 112,
        (4, Number::F16) => 113,
        (1, Number::F32) => 114,
        (2, Number::F32) => 115,
        (4, Number::F32) => 116,
        _ => return None,
    })
}

/// The file that holds `texture`.
///
/// **Errors**: sizes or levels that contradict each other; a texel format that DXGI has no number for.
pub fn encode(texture: &Texture) -> Result<Vec<u8>> {
    let format = dxgi(texture.format).ok_or_else(|| {
        Error::usage(
            format!("DDS cannot hold {}", texture.format),
            "use r, rg or rgba of f16, f32 or unorm, rgb9e5, b10g11r11 or bc6h",
        )
    })?;
    let cubes = texture.array_layers.max(1);
    let (dimension, misc) = match (texture.depth, texture.faces) {
        (0, 6) => (DIMENSION_2D, MISC_CUBE),
        (0, _) => (DIMENSION_2D, 0),
        _ => (DIMENSION_3D, 0),
    };
    // Format, dimension, flags, array size (in cubes), alpha: unknown.
    let second = [format, dimension, misc, to_u32(cubes)?, 0];
    assemble(texture, DX10, &second)
}

/// The same with the header of Direct3D 9 alone.
///
/// **Errors**: as [`encode`]; also arrays, which that header does not know, and any format but r, rg and rgba of f16 and f32.
pub fn encode_legacy(texture: &Texture) -> Result<Vec<u8>> {
    let fourcc = d3d9(texture.format).ok_or_else(|| {
        Error::usage(format!("the header of Direct3D 9 has no {}", texture.format), "leave +legacy out")
    })?;
    if texture.array_layers > 0 {
        return Err(Error::usage("an array with the header of Direct3D 9", "leave +legacy out"));
    }
    assemble(texture, fourcc, &[])
}

fn assemble(texture: &Texture, fourcc: u32, second: &[u32]) -> Result<Vec<u8>> {
    texture.check()?;
    let Texture { format, width, height, depth, faces, .. } = *texture;
    let has_mips = texture.levels.len() > 1;
    let compressed = format.block() > 1;
    let pitch = if compressed { texture.picture_bytes(0).unwrap_or(0) } else { width * format.block_bytes() };
    let mut flags = FLAGS | if compressed { FLAG_LINEAR_SIZE } else { FLAG_PITCH };
    let mut caps = CAPS_TEXTURE;
    if has_mips {
        (flags, caps) = (flags | FLAG_MIPS, caps | CAPS_MIPS | CAPS_COMPLEX);
    }
    let mut caps2 = 0;
    if faces == 6 {
        (caps, caps2) = (caps | CAPS_COMPLEX, CAPS2_CUBE);
    }
    if depth > 0 {
        (flags, caps, caps2) = (flags | FLAG_DEPTH, caps | CAPS_COMPLEX, CAPS2_VOLUME);
    }
    let mut words = vec![124, flags, to_u32(height)?, to_u32(width)?, to_u32(pitch)?, to_u32(depth)?];
    words.push(to_u32(texture.levels.len())?);
    words.extend([0; 11]);
    words.extend([32, PIXEL_FOURCC, fourcc, 0, 0, 0, 0, 0]);
    words.extend([caps, caps2, 0, 0, 0]);
    words.extend_from_slice(second);
    let mut file = MAGIC.to_vec();
    words.iter().for_each(|word| file.extend(word.to_le_bytes()));
    // One element after the other, each with all its levels.
    for element in 0..texture.array_layers.max(1) * faces {
        for (level, bytes) in texture.levels.iter().enumerate() {
            let size = bytes.len() / (texture.array_layers.max(1) * faces);
            debug_assert_eq!(Some(size), texture.picture_bytes(level).map(|n| n * texture.level_box(level)[2]));
            file.extend_from_slice(&bytes[element * size..(element + 1) * size]);
        }
    }
    Ok(file)
}

/// The texture in `bytes`.
///
/// **Errors**: texels of another format; truncated or contradictory data.
pub fn decode(bytes: &[u8]) -> Result<Texture> {
    let broken = |what: String| Error::invalid(format!("the DDS {what}"), DAMAGED);
    if !bytes.starts_with(MAGIC) || bytes.len() < HEADER {
        return Err(broken("ends within its header".to_owned()));
    }
    let word = |i: usize| bytes.get(4 * i..4 * i + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let (flags, height, width, depth, mips) = (word(2), word(3), word(4), word(6), word(7));
    let (caps2, fourcc) = (word(28), word(21));
    let has_fourcc = word(20) & PIXEL_FOURCC != 0;
    let (format, data, is_cube, is_volume, layers) = if has_fourcc && fourcc == DX10 {
        if bytes.len() < HEADER + HEADER_DX10 {
            return Err(broken("ends within its second header".to_owned()));
        }
        let format = TexelFormat::ALL.into_iter().find(|&format| dxgi(format) == Some(word(32)));
        let format = format.ok_or_else(|| other_format(format!("DXGI's number {}", word(32))))?;
        let is_volume = word(33) == DIMENSION_3D;
        if !is_volume && word(33) != DIMENSION_2D {
            return Err(Error::unsupported("a one-dimensional DDS", "export it again with two dimensions"));
        }
        (format, &bytes[HEADER + HEADER_DX10..], word(34) & MISC_CUBE != 0, is_volume, word(35))
    } else {
        let format = TexelFormat::ALL.into_iter().find(|&format| has_fourcc && d3d9(format) == Some(fourcc));
        let format = format.ok_or_else(|| other_format(legacy_name(has_fourcc, fourcc)))?;
        let is_cube = caps2 & CAPS2_IS_CUBE != 0;
        if is_cube && caps2 & CAPS2_CUBE != CAPS2_CUBE {
            return Err(Error::unsupported("a DDS cube without all its faces", "export it again with six faces"));
        }
        (format, &bytes[HEADER..], is_cube, caps2 & CAPS2_VOLUME != 0, 1)
    };
    let (layers, faces) = (layers.max(1) as usize, if is_cube { 6 } else { 1 });
    let n_levels = if flags & FLAG_MIPS != 0 || mips > 1 { mips.max(1) as usize } else { 1 };
    let texture = Texture {
        depth: if is_volume { (depth as usize).max(1) } else { 0 },
        array_layers: if layers > 1 { layers } else { 0 },
        faces,
        ..Texture::empty(format, width as usize, height as usize)
    };
    read_levels(texture, data, n_levels, layers.saturating_mul(faces))
}

fn read_levels(mut texture: Texture, data: &[u8], n_levels: usize, elements: usize) -> Result<Texture> {
    let broken = |what: String| Error::invalid(format!("the DDS {what}"), DAMAGED);
    /// A texture of 2³² texels has 33 levels.
    const MOST_LEVELS: usize = 33;
    if n_levels > MOST_LEVELS {
        return Err(broken(format!("has {n_levels} levels, more than any size halves into")));
    }
    let sizes: Option<Vec<usize>> =
        (0..n_levels).map(|level| texture.picture_bytes(level)?.checked_mul(texture.level_box(level)[2])).collect();
    let per_element = sizes.as_ref().and_then(|sizes| sizes.iter().try_fold(0_usize, |sum, &n| sum.checked_add(n)));
    let wanted = per_element.and_then(|n| n.checked_mul(elements));
    let (Some(sizes), Some(per_element)) = (sizes, per_element.filter(|_| wanted.is_some_and(|n| n <= data.len())))
    else {
        return Err(broken(format!("has {} bytes for {} of {}", data.len(), texture.text(), texture.format)));
    };
    texture.levels = sizes.iter().map(|size| Vec::with_capacity(size * elements)).collect();
    for element in data.chunks_exact(per_element.max(1)).take(elements) {
        let mut rest = element;
        for (level, &size) in sizes.iter().enumerate() {
            let (taken, after) = rest.split_at(size);
            texture.levels[level].extend_from_slice(taken);
            rest = after;
        }
    }
    texture.check().map_err(|error| Error::invalid(format!("the DDS contradicts itself: {error}"), DAMAGED))?;
    Ok(texture)
}

fn legacy_name(has_fourcc: bool, fourcc: u32) -> String {
    let letters = fourcc.to_le_bytes();
    if !has_fourcc {
        "colour masks".to_owned()
    } else if letters.iter().all(u8::is_ascii_graphic) {
        String::from_utf8_lossy(&letters).into_owned()
    } else {
        format!("Direct3D's number {fourcc}")
    }
}

fn other_format(name: String) -> Error {
    Error::unsupported(
        format!("the DDS's texel format is {name}"),
        "convert it to r, rg or rgba of f16, f32 or unorm, to rgb9e5, b10g11r11 or bc6h",
    )
}

fn to_u32(n: usize) -> Result<u32> {
    u32::try_from(n).map_err(|_| Error::usage(format!("a size of {n} in a DDS"), "use a smaller size"))
}
