//! What a file is, by its first bytes.

use super::{dds, env, exr, hdr, ktx1, ktx2, npy, source};

/// What a file seems to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// OpenEXR.
    Exr,
    /// Radiance HDR.
    Hdr,
    /// KTX, version 2.
    Ktx2,
    /// KTX, version 1.
    Ktx1,
    /// DirectDraw surface.
    Dds,
    /// PNG.
    Png,
    /// Babylon.js' environment.
    Env,
    /// NumPy's array.
    Npy,
    /// Source code that Kiln wrote.
    Source,
    /// Nothing in it.
    Empty,
    /// Something that Kiln does not read, in words and with its article: `a JPEG picture`.
    Other(&'static str),
}

/// The beginnings of files that Kiln reads.
const OURS: [(&[u8], FileKind); 9] = [
    (&exr::MAGIC, FileKind::Exr),
    (hdr::MAGIC, FileKind::Hdr),
    (&ktx2::MAGIC, FileKind::Ktx2),
    (&ktx1::MAGIC, FileKind::Ktx1),
    (dds::MAGIC, FileKind::Dds),
    (b"\x89PNG\r\n\x1a\n", FileKind::Png),
    (&env::MAGIC, FileKind::Env),
    (npy::MAGIC, FileKind::Npy),
    (source::MAGIC.as_bytes(), FileKind::Source),
];

/// The beginnings of files that people have by mistake.
const OTHERS: [(&[u8], &str); 13] = [
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"II*\0", "a TIFF picture"),
    (b"MM\0*", "a TIFF picture"),
    (b"GIF8", "a GIF picture"),
    (b"8BPS", "a Photoshop document"),
    (b"PF\n", "a PFM picture"),
    (b"Pf\n", "a PFM picture"),
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
        } else if let Some((_, kind)) = OURS.iter().find(|(magic, _)| bytes.starts_with(magic)) {
            *kind
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

    /// The name of the format.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exr => "OpenEXR",
            Self::Hdr => "Radiance HDR",
            Self::Ktx2 => "KTX2",
            Self::Ktx1 => "KTX 1",
            Self::Dds => "DDS",
            Self::Png => "PNG",
            Self::Env => "Babylon.js environment",
            Self::Npy => "NumPy array",
            Self::Source => "source code",
            Self::Empty => "nothing",
            Self::Other(kind) => kind,
        }
    }

    /// What it is, in words and with its article.
    pub fn text(self) -> &'static str {
        match self {
            Self::Exr => "an OpenEXR",
            Self::Hdr => "a Radiance HDR",
            Self::Ktx2 => "a KTX2 texture",
            Self::Ktx1 => "a KTX texture of version 1",
            Self::Dds => "a DDS texture",
            Self::Png => "a PNG picture",
            Self::Env => "a Babylon.js environment",
            Self::Npy => "a NumPy array",
            Self::Source => "source code",
            Self::Empty => "an empty file",
            Self::Other(kind) => kind,
        }
    }
}
