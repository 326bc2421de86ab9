//! Reading KTX2; what is read and what refused stands at the head of the parent module.

use super::{MAGIC, UASTC_HDR_MODEL, descriptor, packing_of, primaries::primaries, vk_format};
use crate::error::{Error, Result};
use crate::format::{Texture, memory};
use crate::pack::TexelFormat;
use ::ktx2::{Header, LevelIndex};

pub(super) const DAMAGED: &str = "the file is damaged; copy or download it again";

/// The texture in `bytes`. Values of metadata that are not UTF-8 come as `0x` and hexadecimal digits.
///
/// **Errors**: see the head of the parent module; also truncated or contradictory data.
pub fn decode(bytes: &[u8]) -> Result<Texture> {
    let header = header(bytes)?;
    let (stored, is_zstd) = check_kind(&header, bytes)?;
    let n_levels = header.level_count.max(1) as usize; // 0 asks the loader to make mips
    let mut metadata = metadata(&header, bytes)?;
    let format = packing_of(stored, &mut metadata);
    let mut texture = Texture {
        depth: header.pixel_depth as usize,
        array_layers: header.layer_count as usize,
        faces: header.face_count as usize,
        metadata,
        ..Texture::empty(format, header.pixel_width as usize, header.pixel_height as usize)
    };
    texture.primaries = primaries(&header, bytes, &mut texture.metadata)?;
    if stored == TexelFormat::UastcHdr {
        check_is_uastc(&header, bytes)?;
    }
    let (_, type_size) = descriptor(stored, vk_format(stored)?, texture.primaries)?;
    // Writers of compressed levels do not agree on it.
    if !is_zstd && header.type_size != type_size {
        return Err(Error::invalid(
            format!(
                "the KTX2 says that numbers of {} bytes make up its {stored} texels, not of {type_size}",
                header.type_size
            ),
            DAMAGED,
        ));
    }
    let index = bytes[Header::LENGTH..].chunks_exact(LevelIndex::LENGTH).take(n_levels);
    if index.len() < n_levels {
        return Err(Error::invalid(format!("the KTX2 ends within the index of its {n_levels} levels"), DAMAGED));
    }
    for (level, entry) in index.enumerate() {
        let entry =
            entry.try_into().map(LevelIndex::from_bytes).map_err(|_| Error::invalid("a torn index", DAMAGED))?;
        let wanted = texture.level_bytes(level);
        let length = if is_zstd { entry.uncompressed_byte_length } else { entry.byte_length };
        let Some(wanted) = wanted.filter(|&n| n as u64 == length) else {
            let [width, height] = texture.level_size(level);
            return Err(Error::invalid(
                format!("level {level} of the KTX2 has {length} bytes for {width} × {height} texels of {format}"),
                DAMAGED,
            ));
        };
        let data = section(bytes, entry.byte_offset, entry.byte_length).ok_or_else(|| {
            Error::invalid(
                format!(
                    "level {level} of the KTX2 needs {} bytes from {} on, where the file has {}",
                    entry.byte_length,
                    entry.byte_offset,
                    bytes.len()
                ),
                DAMAGED,
            )
        })?;
        texture.levels.push(if is_zstd { decompress(data, wanted, level)? } else { data.to_vec() });
    }
    texture.check().map_err(|error| Error::invalid(format!("the KTX2 contradicts itself: {error}"), DAMAGED))?;
    Ok(texture)
}

/// A level of `wanted` bytes.
fn decompress(data: &[u8], wanted: usize, level: usize) -> Result<Vec<u8>> {
    /// A block of four bytes stands for 128 KiB at most.
    const MAX_RATIO: usize = 1 << 15;
    let broken = |why: String| Error::invalid(format!("level {level} of the KTX2 {why}"), DAMAGED);
    if wanted / MAX_RATIO > data.len() {
        return Err(broken(format!("promises {wanted} bytes in {}, which cannot hold them", data.len())));
    }
    memory::check_room(wanted as u128, &format!("level {level} of the KTX2"))?;
    let level = zstd::bulk::decompress(data, wanted).map_err(|error| broken(format!("is no Zstandard: {error}")))?;
    if level.len() == wanted { Ok(level) } else { Err(broken(format!("has {} bytes, not {wanted}", level.len()))) }
}

fn header(bytes: &[u8]) -> Result<Header> {
    if !bytes.starts_with(&MAGIC) {
        return Err(Error::invalid("no KTX2 identifier at the beginning", "give a .ktx2 file, version 2 of KTX"));
    }
    let head: &[u8; Header::LENGTH] =
        bytes.first_chunk().ok_or_else(|| Error::invalid("the KTX2 ends within its header", DAMAGED))?;
    Header::from_bytes(head).map_err(|error| Error::invalid(format!("the KTX2's header is broken: {error}"), DAMAGED))
}

/// The texel format and whether levels are compressed; refuses every kind of texture that Kiln does not write.
fn check_kind(header: &Header, bytes: &[u8]) -> Result<(TexelFormat, bool)> {
    if header.pixel_height == 0 {
        return Err(Error::unsupported(
            "the KTX2 is one-dimensional, where a texture of two or three dimensions or a cube map is wanted",
            "export it again with a height of 1",
        ));
    }
    if header.face_count != 1 && (header.face_count != 6 || header.pixel_width != header.pixel_height) {
        let Header { pixel_width, pixel_height, face_count, .. } = header;
        return Err(Error::invalid(
            format!("the KTX2 has {face_count} faces of {pixel_width} × {pixel_height} texels, neither one nor a cube"),
            DAMAGED,
        ));
    }
    // The crate reads scheme 0 and every other absent one as none; the bytes tell.
    let [scheme, vk] = [44, 12].map(|at| u32_at(bytes, at));
    let is_zstd = scheme == Some(2);
    if scheme != Some(0) && !is_zstd {
        return Err(Error::unsupported(
            format!("the KTX2 is supercompressed (scheme {})", scheme.unwrap_or_default()),
            "export it again with Zstandard, or without supercompression",
        ));
    }
    let is_it = |format: &TexelFormat| vk_format(*format).is_ok_and(|known| Some(known.value()) == vk);
    TexelFormat::ALL.into_iter().find(is_it).map(|format| (format, is_zstd)).ok_or_else(|| {
        let name = header.format.map_or_else(|| "undefined".to_owned(), |format| format!("{format:?}"));
        Error::unsupported(
            format!("the KTX2's texel format is {name} (vkFormat {})", vk.unwrap_or_default()),
            format!("convert it to one of {}", TexelFormat::names()),
        )
    })
}

/// ASTC that is not said to be UASTC HDR 4x4 may be anything that ASTC has.
fn check_is_uastc(header: &Header, bytes: &[u8]) -> Result<()> {
    /// Where the colour model stands in the descriptor: behind its length and the block's head.
    const AT: usize = 12;
    let index = &header.index;
    let descriptor = section(bytes, index.dfd_byte_offset.into(), index.dfd_byte_length.into()).unwrap_or_default();
    match descriptor.get(AT) {
        Some(&UASTC_HDR_MODEL) => Ok(()),
        _ => Err(Error::unsupported(
            "the KTX2 holds ASTC of the HDR profile, of which Kiln reads the subset UASTC HDR 4x4 alone",
            "export it as UASTC HDR 4x4, or without compression",
        )),
    }
}

fn metadata(header: &Header, bytes: &[u8]) -> Result<Vec<(String, String)>> {
    let broken = || Error::invalid("the KTX2's key/value data are broken", DAMAGED);
    let (offset, length) = (header.index.kvd_byte_offset, header.index.kvd_byte_length);
    let mut rest = section(bytes, offset.into(), length.into()).ok_or_else(broken)?;
    let mut pairs = Vec::new();
    while !rest.is_empty() {
        let length = u32_at(rest, 0).ok_or_else(broken)? as usize;
        let pair = rest[4..].get(..length).ok_or_else(broken)?;
        let end = pair.iter().position(|&byte| byte == 0).ok_or_else(broken)?;
        let key = std::str::from_utf8(&pair[..end]).map_err(|_| broken())?;
        pairs.push((key.to_owned(), text(&pair[end + 1..])));
        // Padding is missing after the last pair in files of some writers.
        rest = rest.get(4 + length.next_multiple_of(4)..).unwrap_or_default();
    }
    Ok(pairs)
}

fn text(value: &[u8]) -> String {
    match std::str::from_utf8(value.strip_suffix(&[0]).unwrap_or(value)) {
        Ok(text) => text.to_owned(),
        Err(_) => value.iter().fold("0x".to_owned(), |hex, byte| format!("{hex}{byte:02x}")),
    }
}

/// `length` bytes from `offset` on, if they are all there.
pub(super) fn section(bytes: &[u8], offset: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(offset).ok()?;
    bytes.get(start..start.checked_add(usize::try_from(length).ok()?)?)
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..)?.first_chunk().copied()?))
}
