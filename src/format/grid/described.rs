//! What a user says of a file that does not say it itself: its shape, how numbers are stored, which array is meant.

use super::Stored;
use crate::error::{Error, Result};
use crate::pack::TexelFormat;
use std::fmt;
use std::str::FromStr;

/// What a file does not say of itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Described {
    /// Width, height, depth and channels.
    pub shape: Option<Shape>,
    /// Which array of a source text, or which file in base64 within it.
    pub array: Option<String>,
    /// What four bytes a texel are the codes of, where the file does not say it.
    pub packing: Option<TexelFormat>,
    /// Whether the channels follow each other as whole planes.
    pub planar: bool,
    /// How the numbers of a file without a header are stored.
    pub number: Option<RawNumber>,
    /// Which layer of an array of textures, or slice of a volume, from 0; all where nothing is said.
    pub layer: Option<usize>,
}

/// The shape of numbers without one: `64x64`, `64x64x2`, `16x16x16x2`; of three or four sizes the last is that of a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Texels along x, y and z.
    pub size: [usize; 3],
    /// Channels.
    pub channels: usize,
}

/// How a number of a file without a header is stored, little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RawNumber {
    /// A half float.
    F16,
    /// A float.
    F32,
    /// A double.
    F64,
    /// A byte that stands for 0 to 1.
    U8,
    /// A word that stands for 0 to 1.
    U16,
}

impl RawNumber {
    /// Bytes that it takes.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::F16 | Self::U16 => 2,
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn stored(self) -> Stored {
        match self {
            Self::F16 => Stored::F16,
            Self::F32 => Stored::F32,
            Self::F64 => Stored::F64,
            Self::U8 => Stored::Unorm(8),
            Self::U16 => Stored::Unorm(16),
        }
    }

    pub(super) fn read(self, bytes: &[u8]) -> Vec<f64> {
        let word = |b: &[u8]| u16::from_le_bytes([b[0], b[1]]);
        match self {
            Self::U8 => bytes.iter().map(|&b| f64::from(b) / 255.0).collect(),
            Self::U16 => bytes.chunks_exact(2).map(|b| f64::from(word(b)) / 65535.0).collect(),
            Self::F16 => bytes.chunks_exact(2).map(|b| f64::from(half::f16::from_bits(word(b)))).collect(),
            Self::F32 => {
                bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect()
            }
            Self::F64 => bytes
                .chunks_exact(8)
                .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]))
                .collect(),
        }
    }
}

impl FromStr for RawNumber {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "f16" => Ok(Self::F16),
            "f32" => Ok(Self::F32),
            "f64" => Ok(Self::F64),
            "u8" => Ok(Self::U8),
            "u16" => Ok(Self::U16),
            _ => Err(Error::usage(format!("no number is called {text:?}"), "use f16, f32, f64, u8 or u16")),
        }
    }
}

impl FromStr for Shape {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || {
            Error::usage(
                format!("shape {text:?} is no shape"),
                "write WIDTHxHEIGHT, WIDTHxHEIGHTxCHANNELS or WIDTHxHEIGHTxDEPTHxCHANNELS, such as 64x64x2",
            )
        };
        let parts: Vec<usize> = text
            .split(['x', 'X', '×'])
            .map(|part| part.trim().parse().ok().filter(|&n| n > 0))
            .collect::<Option<_>>()
            .ok_or_else(wrong)?;
        match parts[..] {
            [w] => Ok(Self { size: [w, 1, 1], channels: 1 }),
            [w, h] => Ok(Self { size: [w, h, 1], channels: 1 }),
            [w, h, c] => Ok(Self { size: [w, h, 1], channels: c }),
            [w, h, d, c] => Ok(Self { size: [w, h, d], channels: c }),
            _ => Err(wrong()),
        }
    }
}

impl Shape {
    pub(super) fn len(&self) -> Option<usize> {
        self.size.iter().try_fold(self.channels, |n, &s| n.checked_mul(s))
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [w, h, d] = self.size;
        match (d, self.channels) {
            (1, c) => write!(f, "{w}x{h}x{c}"),
            (d, c) => write!(f, "{w}x{h}x{d}x{c}"),
        }
    }
}
