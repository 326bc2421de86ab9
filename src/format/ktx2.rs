//! KTX 2.0 (`.ktx2`): two- and three-dimensional textures, arrays and cube maps, with any number of mips.
//!
//! - **Written**: levels, smallest first in the file and largest first in its index, each aligned to lcm(block size, 4), or compressed by
//!   Zstandard and not aligned; a basic data format descriptor (linear, straight alpha); the pair `KTXwriter` always, and metadata as
//!   NUL-terminated UTF-8, all sorted by key.
//! - **Codes of four bytes** (RGBM, RGBP, RGBD) are R8G8B8A8_UNORM to the format; the key `kiln.packing` says what they stand for.
//! - **UASTC HDR 4x4** is ASTC_4x4_SFLOAT_BLOCK to Vulkan, with a colour model of its own; ASTC that does not bear that is refused, as it may hold
//!   blocks that the subset has not.
//! - **Colour**: the descriptor names the primaries; those that it has no name for stand under the key `kiln.primaries`, x and y of
//!   red, green, blue and white.
//! - **Read**: the same. Other supercompression and other formats are refused; sizes are checked against the length of the file before
//!   anything is allocated for them.
//!
//! **Source**: Khronos, *KTX File Format Specification* 2.0 and *Data Format Specification* 1.4, basic descriptor block; the
//! `ktx2` crate lays out the header and the descriptor.

mod primaries;
mod read;

pub use read::decode;

use super::Texture;
use crate::colour::Primaries;
use crate::error::{Error, Result};
use crate::pack::{Number, TexelFormat};
use ::ktx2::dfd::{Basic, Block, ChannelTypeQualifiers};
use ::ktx2::{ColorModel, Format, Header, Index, LevelIndex, SupercompressionScheme};
use std::borrow::Cow;

/// What every KTX2 file begins with.
pub const MAGIC: [u8; 12] = ::ktx2::MAGIC;

/// The key under which the file names the program that wrote it.
const WRITER_KEY: &str = "KTXwriter";

/// The key of what codes of four bytes stand for.
pub(super) const PACKING_KEY: &str = "kiln.packing";

/// The colour model of UASTC HDR 4x4. Its texels are ASTC's to Vulkan; this tells readers that a transcoder takes them.
const UASTC_HDR_MODEL: u8 = 167;

/// How hard Zstandard tries. Measured on half-float and RGB9E5 environments and a DFG of 60 KB to 1 MB: at 9 the levels are 6 to 19 % larger, and done in
/// a twentieth of the time (which at 19 is 0.6 s a megabyte); at 22 they are the same to the byte.
const ZSTD_LEVEL: i32 = 19;

/// The keys beginning with `KTX` that the specification defines for text; others are reserved.
const STANDARD_KEYS: [&str; 3] = ["KTXorientation", "KTXswizzle", "KTXwriterScParams"];

/// The file that holds `texture`.
///
/// **Errors**: sizes or levels that contradict each other; a texel format that no Vulkan format is; keys that are empty, doubled or reserved
/// (`KTX…`); keys or values with a NUL in them; more than 4 GiB of metadata.
pub fn encode(texture: &Texture) -> Result<Vec<u8>> {
    encode_with(texture, false)
}

/// The same, its levels compressed by Zstandard.
///
/// **Errors**: as [`encode`].
pub fn encode_zstd(texture: &Texture) -> Result<Vec<u8>> {
    encode_with(texture, true)
}

fn encode_with(texture: &Texture, zstd: bool) -> Result<Vec<u8>> {
    texture.check()?;
    let format = vk_format(texture.format)?;
    let (descriptor, type_size) = descriptor(texture.format, format, texture.primaries)?;
    let mut metadata: Vec<(String, String)> =
        texture.metadata.iter().filter(|(key, _)| key != primaries::KEY && key != PACKING_KEY).cloned().collect();
    metadata.extend(primaries::pair(texture.primaries));
    metadata.extend(packing_pair(texture.format));
    let key_values = key_values(&metadata)?;
    // Header, level index, descriptor, key/values, then the levels.
    let descriptor_at = Header::LENGTH + LevelIndex::LENGTH * texture.levels.len();
    let key_values_at = descriptor_at + descriptor.len();
    let header = Header {
        format: Some(format),
        type_size,
        pixel_width: to_u32(texture.width)?,
        pixel_height: to_u32(texture.height)?,
        pixel_depth: to_u32(texture.depth)?,
        layer_count: to_u32(texture.array_layers)?,
        face_count: to_u32(texture.faces)?,
        level_count: to_u32(texture.levels.len())?,
        supercompression_scheme: zstd.then_some(SupercompressionScheme::Zstandard),
        index: Index {
            dfd_byte_offset: to_u32(descriptor_at)?,
            dfd_byte_length: to_u32(descriptor.len())?,
            kvd_byte_offset: to_u32(key_values_at)?,
            kvd_byte_length: to_u32(key_values.len())?,
            sgd_byte_offset: 0,
            sgd_byte_length: 0,
        },
    };
    let alignment = if zstd { 1 } else { lcm(texture.format.block_bytes(), 4) };
    let mut file =
        Vec::with_capacity(key_values_at + key_values.len() + texture.levels.iter().map(Vec::len).sum::<usize>());
    file.extend_from_slice(&header.as_bytes()[..]);
    // The index is known after the levels that follow it.
    file.resize(descriptor_at, 0);
    file.extend_from_slice(&descriptor);
    file.extend_from_slice(&key_values);
    let mut index = vec![[0; LevelIndex::LENGTH]; texture.levels.len()];
    for (level, bytes) in texture.levels.iter().enumerate().rev() {
        file.resize(file.len().next_multiple_of(alignment), 0);
        let stored = if zstd { Cow::Owned(compress(bytes)?) } else { Cow::Borrowed(&bytes[..]) };
        index[level] = LevelIndex {
            byte_offset: file.len() as u64,
            byte_length: stored.len() as u64,
            uncompressed_byte_length: bytes.len() as u64,
        }
        .as_bytes();
        file.extend_from_slice(&stored);
    }
    file[Header::LENGTH..descriptor_at].copy_from_slice(index.as_flattened());
    Ok(file)
}

fn compress(bytes: &[u8]) -> Result<Vec<u8>> {
    zstd::bulk::compress(bytes, ZSTD_LEVEL)
        .map_err(|error| Error::unsupported(format!("Zstandard does not compress a level: {error}"), "leave +zstd out"))
}

/// What codes of four bytes stand for, as metadata.
pub(super) fn packing_pair(format: TexelFormat) -> Option<(String, String)> {
    let is_code = matches!(format, TexelFormat::Rgbm | TexelFormat::Rgbp | TexelFormat::Rgbd);
    is_code.then(|| (PACKING_KEY.to_owned(), format.to_string()))
}

/// The texel format of a file whose texels are `stored`, by its metadata; the pair is taken out of it.
pub(super) fn packing_of(stored: TexelFormat, metadata: &mut Vec<(String, String)>) -> TexelFormat {
    let named = metadata.iter().position(|(key, _)| key == PACKING_KEY).map(|at| metadata.remove(at).1);
    let format = named.and_then(|name| name.parse().ok()).filter(|&format| packing_pair(format).is_some());
    let is_rgba8 = stored == TexelFormat::Plain { channels: 4, number: Number::Unorm8 };
    format.filter(|_| is_rgba8).unwrap_or(stored)
}

/// The data format descriptor, its total length before it, and the size of one number.
fn descriptor(format: TexelFormat, vk: Format, primaries: Primaries) -> Result<(Vec<u8>, u32)> {
    let (mut basic, type_size) = Basic::from_format(vk).map_err(|error| {
        Error::unsupported(format!("KTX2 cannot describe the texel format {format}: {error:?}"), "use another format")
    })?;
    basic.color_primaries = primaries::name(primaries);
    if format == TexelFormat::UastcHdr {
        basic.color_model = ColorModel::new(UASTC_HDR_MODEL);
        for sample in &mut basic.sample_information {
            // As Basis Universal writes it: nothing is below zero.
            sample.channel_type_qualifiers = ChannelTypeQualifiers::FLOAT;
            sample.lower = 0;
        }
    }
    let block = Block::Basic(basic).to_vec();
    let total = to_u32(block.len() + 4)?;
    Ok(([&total.to_le_bytes()[..], &block].concat(), type_size))
}

/// The key/value data: sorted, each pair with its length before it and padded to four bytes, the last one too.
fn key_values(metadata: &[(String, String)]) -> Result<Vec<u8>> {
    let writer = concat!("kiln ", env!("CARGO_PKG_VERSION"));
    let mut pairs: Vec<(&str, &str)> =
        metadata.iter().map(|(key, value)| (&key[..], &value[..])).filter(|&(key, _)| key != WRITER_KEY).collect();
    pairs.push((WRITER_KEY, writer));
    // By code point, which is the order of the UTF-8 bytes.
    pairs.sort_unstable();
    let mut data = Vec::new();
    for (i, &(key, value)) in pairs.iter().enumerate() {
        let reserved = key.get(..3).is_some_and(|start| start.eq_ignore_ascii_case("ktx"));
        let fault = if key.is_empty() || key.contains('\0') || key.starts_with('\u{feff}') {
            "has a key that is empty, holds a NUL or begins with a byte order mark"
        } else if value.contains('\0') {
            "has a value with a NUL in it"
        } else if i > 0 && pairs[i - 1].0 == key {
            "is there twice"
        } else if reserved && key != WRITER_KEY && !STANDARD_KEYS.contains(&key) {
            "has a key that KTX reserves"
        } else {
            let length = key.len() + 1 + value.len() + 1;
            data.extend_from_slice(&to_u32(length)?.to_le_bytes());
            data.extend_from_slice(key.as_bytes());
            data.push(0);
            data.extend_from_slice(value.as_bytes());
            data.push(0);
            data.resize(data.len().next_multiple_of(4), 0);
            continue;
        };
        return Err(Error::usage(format!("metadata `{}` {fault}", key.escape_debug()), "use another key or value"));
    }
    Ok(data)
}

/// The Vulkan format of a texel format.
///
/// **Errors**: RGBE, and more than four channels: they have none.
fn vk_format(format: TexelFormat) -> Result<Format> {
    use Number::{F16, F32, Unorm8, Unorm16};
    use TexelFormat::{B10g11r11, Bc6h, Plain, Rgb9e5, Rgbd, Rgbe, Rgbm, Rgbp, UastcHdr};
    Ok(match format {
        Plain { channels: 1, number: F16 } => Format::R16_SFLOAT,
        Plain { channels: 2, number: F16 } => Format::R16G16_SFLOAT,
        Plain { channels: 3, number: F16 } => Format::R16G16B16_SFLOAT,
        Plain { channels: 4, number: F16 } => Format::R16G16B16A16_SFLOAT,
        Plain { channels: 1, number: F32 } => Format::R32_SFLOAT,
        Plain { channels: 2, number: F32 } => Format::R32G32_SFLOAT,
        Plain { channels: 3, number: F32 } => Format::R32G32B32_SFLOAT,
        Plain { channels: 4, number: F32 } => Format::R32G32B32A32_SFLOAT,
        Plain { channels: 1, number: Unorm8 } => Format::R8_UNORM,
        Plain { channels: 2, number: Unorm8 } => Format::R8G8_UNORM,
        Plain { channels: 3, number: Unorm8 } => Format::R8G8B8_UNORM,
        Plain { channels: 4, number: Unorm8 } | Rgbm | Rgbp | Rgbd => Format::R8G8B8A8_UNORM,
        Plain { channels: 1, number: Unorm16 } => Format::R16_UNORM,
        Plain { channels: 2, number: Unorm16 } => Format::R16G16_UNORM,
        Plain { channels: 3, number: Unorm16 } => Format::R16G16B16_UNORM,
        Plain { channels: 4, number: Unorm16 } => Format::R16G16B16A16_UNORM,
        Rgb9e5 => Format::E5B9G9R9_UFLOAT_PACK32,
        B10g11r11 => Format::B10G11R11_UFLOAT_PACK32,
        Bc6h => Format::BC6H_UFLOAT_BLOCK,
        UastcHdr => Format::ASTC_4x4_SFLOAT_BLOCK,
        Rgbe | Plain { .. } => {
            return Err(Error::usage(
                format!("KTX2 has no texel format {format}"),
                format!("use one of {}", TexelFormat::names()),
            ));
        }
    })
}

fn to_u32(n: usize) -> Result<u32> {
    u32::try_from(n).map_err(|_| {
        Error::usage(format!("{n} bytes in the head of a KTX2 file, which ends at 4 GiB"), "carry less metadata")
    })
}

fn lcm(a: usize, b: usize) -> usize {
    let (mut gcd, mut rest) = (a, b);
    while rest != 0 {
        (gcd, rest) = (rest, gcd % rest);
    }
    a / gcd * b
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Texture {
        let format = "rg16f".parse().unwrap();
        let levels = [4_usize, 2, 1].map(|size| (0..6 * size * size * 4).map(|i| i as u8).collect()).to_vec();
        let metadata = vec![("b".into(), "β".into()), ("a".into(), String::new())];
        Texture { levels, metadata, primaries: Primaries::ACESCG, ..Texture::empty_cube(format, 4) }
    }

    #[test]
    fn what_is_written_is_read_again() {
        let texture = cube();
        let back = decode(&encode(&texture).unwrap()).unwrap();
        let writer = concat!("kiln ", env!("CARGO_PKG_VERSION"));
        let wanted = [(WRITER_KEY, writer), ("a", ""), ("b", "β")].map(|(k, v)| (k.to_owned(), v.to_owned()));
        assert_eq!(back.metadata, wanted);
        assert_eq!(Texture { metadata: texture.metadata.clone(), ..back }, texture);
    }

    #[test]
    fn a_face_is_found_by_level_and_number() {
        let format = "r32f".parse().unwrap();
        let values: Vec<f32> = (0..24).map(|i| i as f32).collect();
        let (level0, _) = Number::F32.pack(&values);
        let (level1, _) = Number::F32.pack(&values[..6]);
        let texture = Texture { levels: vec![level0, level1], ..Texture::empty_cube(format, 2) };
        assert_eq!(texture.face(0, 5).unwrap(), [20.0, 21.0, 22.0, 23.0]);
        assert_eq!(texture.face(1, 2).unwrap(), [2.0]);
        assert_eq!((texture.face(1, 6), texture.face(2, 0)), (None, None));
    }

    #[test]
    fn a_volume_keeps_its_slices_in_order() {
        let values: Vec<f32> = (0..24).map(|i| i as f32).collect();
        let (texture, _) = Texture::volume("r32f".parse().unwrap(), [4, 3, 2], &values).unwrap();
        let back = decode(&encode(&texture).unwrap()).unwrap();
        assert_eq!((back.depth, back.faces, back.layers(0)), (2, 1, 2));
        assert_eq!((back.face(0, 1).unwrap(), back.face(0, 2)), (values[12..].to_vec(), None));
        let flat = Texture { depth: 0, ..texture.clone() };
        assert!(encode(&flat).unwrap_err().to_string().contains("4 × 3 texels holds 96 bytes"));
        assert!(encode(&Texture { faces: 6, ..texture }).is_err());
    }

    #[test]
    fn levels_are_aligned_and_the_smallest_comes_first() {
        for format in TexelFormat::ALL.into_iter().filter(|&format| format != TexelFormat::Rgbe) {
            let levels = [(5, 3), (2, 1), (1, 1)].map(|(w, h)| vec![0; format.bytes(w, h).unwrap()]).to_vec();
            let texture = Texture { levels, ..Texture::empty(format, 5, 3) };
            let file = encode(&texture).unwrap();
            let reader = ::ktx2::Reader::new(&file).unwrap();
            let offsets: Vec<usize> =
                reader.levels().map(|level| level.data.as_ptr() as usize - file.as_ptr() as usize).collect();
            assert!(offsets.iter().all(|at| at % lcm(format.block_bytes(), 4) == 0), "{format}: {offsets:?}");
            assert!(offsets.is_sorted_by(|a, b| a > b), "{format}: {offsets:?}");
        }
    }

    #[test]
    fn contradictory_textures_are_refused() {
        type Breaks = fn(&mut Texture);
        let broken: [(&str, Breaks); 8] = [
            ("no level", |t| t.levels.clear()),
            ("too many levels", |t| t.levels.push(vec![0; 24])),
            ("a level too short", |t| t.levels[1].truncate(5)),
            ("two faces", |t| t.faces = 2),
            ("a cube that is not square", |t| t.width = 8),
            ("nothing", |t| t.width = 0),
            ("a reserved key", |t| t.metadata.push(("ktxFoo".into(), String::new()))),
            ("a key twice", |t| t.metadata.push(("a".into(), "2".into()))),
        ];
        for (what, breaks) in broken {
            let mut texture = cube();
            breaks(&mut texture);
            let message = encode(&texture).expect_err(what).to_string();
            assert!(message.contains("; "), "{what}: {message}");
        }
    }
}
