//! KTX 2.0 (`.ktx2`): two- and three-dimensional textures and cube maps of float texels, with any number of mips.
//!
//! - **Written**: uncompressed levels, smallest first in the file and largest first in its index, each aligned to
//!   lcm(texel size, 4); a basic data format descriptor (RGBSDA, linear, straight alpha, signed floats); the pair
//!   `KTXwriter` always, and metadata as NUL-terminated UTF-8, all sorted by key.
//! - **Colour**: the descriptor names the primaries; those that it has no name for stand under the key `kiln.primaries`, x and y of
//!   red, green, blue and white.
//! - **Read**: the same. Supercompression, other formats and arrays are refused; sizes are checked against the
//!   length of the file before anything is allocated for them.
//!
//! **Source**: Khronos, *KTX File Format Specification* 2.0 and *Data Format Specification* 1.4, basic descriptor block; the
//! `ktx2` crate lays out the header and the descriptor.

mod primaries;
mod read;

pub use read::decode;

use crate::colour::Primaries;
use crate::error::{Error, Result};
use crate::pack::{Number, PackReport, TexelFormat};
use ::ktx2::dfd::{Basic, Block};
use ::ktx2::{Format, Header, Index, LevelIndex};

/// What every KTX2 file begins with.
pub const MAGIC: [u8; 12] = ::ktx2::MAGIC;

/// The key under which the file names the program that wrote it.
const WRITER_KEY: &str = "KTXwriter";

/// The keys beginning with `KTX` that the specification defines for text; others are reserved.
const STANDARD_KEYS: [&str; 3] = ["KTXorientation", "KTXswizzle", "KTXwriterScParams"];

/// What a KTX2 file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// How a texel is stored.
    pub format: TexelFormat,
    /// Texels in a row of level 0.
    pub width: usize,
    /// Rows of level 0.
    pub height: usize,
    /// Slices of level 0 of a three-dimensional texture; 0 for any other.
    pub depth: usize,
    /// 1, or 6 for a cube map: +X −X +Y −Y +Z −Z.
    pub faces: usize,
    /// The packed texels, level 0 first; a level is its faces or slices, each its rows, a row its texels.
    pub levels: Vec<Vec<u8>>,
    /// Key/value pairs, sorted by key in the file. `KTXwriter` is set by [`encode`], whatever stands here.
    pub metadata: Vec<(String, String)>,
    /// What red, green and blue are; Rec. 709 where a file does not say.
    pub primaries: Primaries,
}

impl Texture {
    /// A two-dimensional texture of one level, without metadata, and what packing changed.
    ///
    /// **Shape**: `values` is height × width × channels, channel fastest.
    ///
    /// **Errors**: another number of values than that.
    pub fn flat<T: Copy + Into<f64>>(
        format: TexelFormat,
        width: usize,
        height: usize,
        values: &[T],
    ) -> Result<(Self, PackReport)> {
        let (level, report) = format.number.pack(values);
        let texture = Self {
            format,
            width,
            height,
            depth: 0,
            faces: 1,
            levels: vec![level],
            metadata: Vec::new(),
            primaries: Primaries::REC709,
        };
        texture.check()?;
        Ok((texture, report))
    }

    /// The same as slices of a three-dimensional texture.
    ///
    /// **Shape**: `values` is depth × height × width × channels, channel fastest.
    ///
    /// **Errors**: another number of values than that.
    pub fn volume<T: Copy + Into<f64>>(
        format: TexelFormat,
        [width, height, depth]: [usize; 3],
        values: &[T],
    ) -> Result<(Self, PackReport)> {
        let (level, report) = format.number.pack(values);
        let texture = Self {
            format,
            width,
            height,
            depth,
            faces: 1,
            levels: vec![level],
            metadata: Vec::new(),
            primaries: Primaries::REC709,
        };
        texture.check()?;
        Ok((texture, report))
    }

    /// Width and height of a level: halved each time, rounded down, but not below 1.
    pub fn level_size(&self, level: usize) -> [usize; 2] {
        let [width, height, _] = self.level_box(level);
        [width, height]
    }

    /// Width, height and number of slices of a level.
    fn level_box(&self, level: usize) -> [usize; 3] {
        [self.width, self.height, self.depth].map(|size| size.checked_shr(level as u32).unwrap_or(0).max(1))
    }

    /// Faces, or slices, of a level.
    pub fn layers(&self, level: usize) -> usize {
        self.faces * self.level_box(level)[2]
    }

    /// The values of one face, or slice, of one level, row by row, channel fastest; none where there is no such face or level.
    pub fn face(&self, level: usize, face: usize) -> Option<Vec<f32>> {
        let [width, height] = self.level_size(level);
        let size = width * height * self.format.bytes();
        let bytes = self.levels.get(level)?.get(face.checked_mul(size)?..face.checked_add(1)?.checked_mul(size)?)?;
        Some(self.format.number.unpack(bytes))
    }

    /// What the metadata says under `key`.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|(known, _)| known == key).map(|(_, value)| value.as_str())
    }

    /// Bytes of a level; nothing where that overflows.
    fn level_bytes(&self, level: usize) -> Option<usize> {
        let [width, height, depth] = self.level_box(level);
        width.checked_mul(height)?.checked_mul(depth)?.checked_mul(self.format.bytes())?.checked_mul(self.faces)
    }

    /// Refuses what no KTX2 file can hold.
    fn check(&self) -> Result<()> {
        let Self { width, height, depth, faces, .. } = *self;
        let slices = if depth > 0 { format!(" × {depth}") } else { String::new() };
        let size = format!("a texture of {width} × {height}{slices} texels");
        let largest = width.max(height).max(depth);
        if width.min(height) == 0 || largest > u32::MAX as usize {
            return Err(Error::usage(size, "give a width and a height from 1 to 4294967295"));
        }
        if faces != 1 && (faces != 6 || width != height || depth > 0) {
            return Err(Error::usage(format!("{size} with {faces} faces"), "give one face, or six square ones"));
        }
        let max_levels = (largest.ilog2() + 1) as usize;
        if !(1..=max_levels).contains(&self.levels.len()) {
            let n = self.levels.len();
            return Err(Error::usage(format!("{size} with {n} mip levels"), format!("give 1 to {max_levels} levels")));
        }
        for (level, bytes) in self.levels.iter().enumerate() {
            let wanted = self.level_bytes(level);
            if wanted != Some(bytes.len()) {
                let wanted = wanted.map_or_else(|| "too many".to_owned(), |n| n.to_string());
                return Err(Error::usage(
                    format!("level {level} of {size} holds {} bytes, where {wanted} are wanted", bytes.len()),
                    "give width × height × faces texels, halving the size at each level",
                ));
            }
        }
        Ok(())
    }
}

/// The file that holds `texture`.
///
/// **Errors**: sizes or levels that contradict each other; keys that are empty, doubled or reserved (`KTX…`); keys or
/// values with a NUL in them; more than 4 GiB of metadata.
pub fn encode(texture: &Texture) -> Result<Vec<u8>> {
    texture.check()?;
    let (descriptor, type_size) = descriptor(texture.format, texture.primaries)?;
    let mut metadata: Vec<(String, String)> =
        texture.metadata.iter().filter(|(key, _)| key != primaries::KEY).cloned().collect();
    metadata.extend(primaries::pair(texture.primaries));
    let key_values = key_values(&metadata)?;
    // Header, level index, descriptor, key/values, then the levels.
    let descriptor_at = Header::LENGTH + LevelIndex::LENGTH * texture.levels.len();
    let key_values_at = descriptor_at + descriptor.len();
    let header = Header {
        format: Some(vk_format(texture.format)),
        type_size,
        pixel_width: to_u32(texture.width)?,
        pixel_height: to_u32(texture.height)?,
        pixel_depth: to_u32(texture.depth)?,
        layer_count: 0,
        face_count: to_u32(texture.faces)?,
        level_count: to_u32(texture.levels.len())?,
        supercompression_scheme: None,
        index: Index {
            dfd_byte_offset: to_u32(descriptor_at)?,
            dfd_byte_length: to_u32(descriptor.len())?,
            kvd_byte_offset: to_u32(key_values_at)?,
            kvd_byte_length: to_u32(key_values.len())?,
            sgd_byte_offset: 0,
            sgd_byte_length: 0,
        },
    };
    let alignment = lcm(texture.format.bytes(), 4);
    let mut levels = Vec::new();
    let mut index = vec![[0; LevelIndex::LENGTH]; texture.levels.len()];
    for (level, bytes) in texture.levels.iter().enumerate().rev() {
        let end = key_values_at + key_values.len() + levels.len();
        levels.resize(levels.len() + end.next_multiple_of(alignment) - end, 0);
        let at = end.next_multiple_of(alignment) as u64;
        let length = bytes.len() as u64;
        index[level] = LevelIndex { byte_offset: at, byte_length: length, uncompressed_byte_length: length }.as_bytes();
        levels.extend_from_slice(bytes);
    }
    Ok([&header.as_bytes()[..], index.as_flattened(), &descriptor, &key_values, &levels].concat())
}

/// The data format descriptor, its total length before it, and the size of one number.
fn descriptor(format: TexelFormat, primaries: Primaries) -> Result<(Vec<u8>, u32)> {
    let (mut basic, type_size) = Basic::from_format(vk_format(format)).map_err(|error| {
        Error::unsupported(format!("KTX2 cannot describe the texel format {format}: {error:?}"), "use another format")
    })?;
    basic.color_primaries = primaries::name(primaries);
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

fn vk_format(format: TexelFormat) -> Format {
    match (format.channels, format.number) {
        (1, Number::F16) => Format::R16_SFLOAT,
        (1, Number::F32) => Format::R32_SFLOAT,
        (2, Number::F16) => Format::R16G16_SFLOAT,
        (2, Number::F32) => Format::R32G32_SFLOAT,
        (_, Number::F16) => Format::R16G16B16A16_SFLOAT,
        (_, Number::F32) => Format::R32G32B32A32_SFLOAT,
    }
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
        Texture { format, width: 4, height: 4, depth: 0, faces: 6, levels, metadata, primaries: Primaries::ACESCG }
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
        let texture = Texture {
            format,
            width: 2,
            height: 2,
            depth: 0,
            faces: 6,
            levels: vec![level0, level1],
            metadata: vec![],
            primaries: Primaries::REC709,
        };
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
        for format in TexelFormat::ALL {
            let levels = [(5, 3), (2, 1), (1, 1)].map(|(w, h)| vec![0; w * h * format.bytes()]).to_vec();
            let texture = Texture {
                format,
                width: 5,
                height: 3,
                depth: 0,
                faces: 1,
                levels,
                metadata: vec![],
                primaries: Primaries::REC709,
            };
            let file = encode(&texture).unwrap();
            let reader = ::ktx2::Reader::new(&file).unwrap();
            let offsets: Vec<usize> =
                reader.levels().map(|level| level.data.as_ptr() as usize - file.as_ptr() as usize).collect();
            assert!(offsets.iter().all(|at| at % lcm(format.bytes(), 4) == 0), "{format}: {offsets:?}");
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
