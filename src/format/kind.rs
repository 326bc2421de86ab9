//! What a file is, by its first bytes.

use super::{exr, hdr, ktx2};

/// What a file seems to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// OpenEXR.
    Exr,
    /// Radiance HDR.
    Hdr,
    /// KTX, version 2.
    Ktx2,
    /// Nothing in it.
    Empty,
    /// Something that Kiln does not read, in words and with its article: `a PNG picture`.
    Other(&'static str),
}

/// The beginnings of files that people have by mistake.
const OTHERS: [(&[u8], &str); 17] = [
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"DDS ", "a DDS texture"),
    (b"\xabKTX 11\xbb", "a KTX texture of version 1"),
    (b"II*\0", "a TIFF picture"),
    (b"MM\0*", "a TIFF picture"),
    (b"GIF8", "a GIF picture"),
    (b"8BPS", "a Photoshop document"),
    (b"PF\n", "a PFM picture"),
    (b"Pf\n", "a PFM picture"),
    (b"\x93NUMPY", "a NumPy array"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive"),
    (b"version https://git-lfs", "a Git LFS pointer instead of the file (`git lfs pull` fetches it)"),
    (b"<!DOCTYPE html", "a web page (a download that went wrong?)"),
    (b"<html", "a web page (a download that went wrong?)"),
];

impl FileKind {
    /// What `bytes`, the whole file or its beginning, seem to be.
    pub fn of(bytes: &[u8]) -> Self {
        if bytes.is_empty() {
            Self::Empty
        } else if bytes.starts_with(&exr::MAGIC) {
            Self::Exr
        } else if bytes.starts_with(hdr::MAGIC) {
            Self::Hdr
        } else if bytes.starts_with(&ktx2::MAGIC) {
            Self::Ktx2
        } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
            Self::Other("a WebP picture")
        } else if let Some((_, kind)) = OTHERS.iter().find(|(magic, _)| bytes.starts_with(magic)) {
            Self::Other(kind)
        } else if bytes.iter().take(512).all(|&byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace()) {
            Self::Other("a text file")
        } else {
            Self::Other("a file of an unknown kind")
        }
    }
}
