//! Texel formats: what a value becomes in a file, and by how much that changes it.
//!
//! One file per number format. Each states, at its head, its rounding and what becomes of negatives, overflow and NaN;
//! nothing is changed in silence: a [`PackReport`] counts it.

pub mod binary16;
pub mod binary32;

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// How one number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Number {
    /// IEEE 754 binary16.
    F16,
    /// IEEE 754 binary32.
    F32,
}

/// Channels × number: `r16f`, `rg16f`, `rgba16f`, `r32f`, `rg32f`, `rgba32f`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct TexelFormat {
    /// 1, 2 or 4.
    pub channels: usize,
    /// How each channel is stored.
    pub number: Number,
}

/// What packing did to the values.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct PackReport {
    /// Largest |unpacked − value| over the finite values that did not overflow.
    pub max_abs_error: f64,
    /// Values beyond the largest finite number of the format, stored as that number.
    pub overflowed: u64,
    /// Values below zero (stored as they are by the float formats).
    pub negative: u64,
    /// NaN and infinities (stored as they are by the float formats; a baked table never has any).
    pub nonfinite: u64,
}

impl PackReport {
    /// The two reports as one.
    pub fn merge(self, other: Self) -> Self {
        Self {
            max_abs_error: self.max_abs_error.max(other.max_abs_error),
            overflowed: self.overflowed + other.overflowed,
            negative: self.negative + other.negative,
            nonfinite: self.nonfinite + other.nonfinite,
        }
    }
}

impl Number {
    /// Bytes that one number takes.
    pub fn bytes(self) -> usize {
        match self {
            Self::F16 => 2,
            Self::F32 => 4,
        }
    }

    /// Packs `values`, little-endian.
    pub fn pack<T: Copy + Into<f64>>(self, values: &[T]) -> (Vec<u8>, PackReport) {
        match self {
            Self::F16 => binary16::pack(values),
            Self::F32 => binary32::pack(values),
        }
    }

    /// Unpacks little-endian `bytes`; a trailing partial number is ignored.
    pub fn unpack(self, bytes: &[u8]) -> Vec<f32> {
        match self {
            Self::F16 => binary16::unpack(bytes),
            Self::F32 => binary32::unpack(bytes),
        }
    }

    /// Spacing of the format's numbers at `value`: one unit in the last place.
    pub fn ulp(self, value: f64) -> f64 {
        match self {
            Self::F16 => binary16::ulp(value),
            Self::F32 => binary32::ulp(value),
        }
    }
}
