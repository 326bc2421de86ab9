//! Texel formats: what a value becomes in a file, and by how much that changes it.
//!
//! One file per packing. Each states, at its head, its rounding and what becomes of negatives, overflow and NaN;
//! nothing is changed in silence: a [`PackReport`] counts it. [`TexelFormat`] is the list of them all.
//!
//! | what is stored | files | one step at a value |
//! | --- | --- | --- |
//! | a number per channel | [`binary16`], [`binary32`], [`unorm`], [`b10g11r11`] | [`TexelFormat::ulp`], whatever the other channels hold |
//! | three mantissas, one exponent | [`rgb9e5`], [`rgbe`] | [`TexelFormat::step`], by the texel's largest channel |
//! | three codes, one factor | [`rgbm`], [`rgbp`], [`rgbd`] | [`TexelFormat::step`], likewise |
//! | blocks of 4 × 4 | [`bc6h`], [`uastc_hdr`] | none: what a block can hold, its sixteen texels decide |

pub mod b10g11r11;
pub mod bc6h;
pub mod binary16;
pub mod binary32;
pub mod blocks;
mod factor;
pub mod rgb9e5;
pub mod rgbd;
pub mod rgbe;
pub mod rgbm;
pub mod rgbp;
mod texel;
mod triple;
pub mod uastc_hdr;
pub mod unorm;

pub use texel::TexelFormat;

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
    /// 0 to 1 in 255 steps.
    Unorm8,
    /// 0 to 1 in 65535 steps.
    Unorm16,
}

/// What packing did to the values.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct PackReport {
    /// Largest |unpacked − value| over the finite values that the format has room for: neither overflowed, nor negative in a format
    /// without a sign.
    pub max_abs_error: f64,
    /// Values beyond the largest finite number of the format, stored as that number.
    pub overflowed: u64,
    /// Values below zero (stored as they are by f16 and f32, as 0 by every other format).
    pub negative: u64,
    /// NaN and infinities (stored as they are by f16 and f32; elsewhere NaN as 0, infinity as the largest number; a baked table never
    /// has any).
    pub nonfinite: u64,
    /// Of [`blocks`], the largest |unpacked − value| in parts of the brightest that is read of its block, or of the value where that is larger:
    /// at most 1, for none is below zero. Here values that the format has no room for are the nearest that it has. 0 of every other format.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub max_block_error: f64,
    /// Of [`uastc_hdr`], the same of what a machine without ASTC sees, for which the blocks are transcoded; 0 of every other format.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub max_transcoded_error: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl PackReport {
    /// The two reports as one.
    pub fn merge(self, other: Self) -> Self {
        Self {
            max_abs_error: self.max_abs_error.max(other.max_abs_error),
            overflowed: self.overflowed + other.overflowed,
            negative: self.negative + other.negative,
            nonfinite: self.nonfinite + other.nonfinite,
            max_block_error: self.max_block_error.max(other.max_block_error),
            max_transcoded_error: self.max_transcoded_error.max(other.max_transcoded_error),
        }
    }
}

impl Number {
    /// Every number format that there is.
    pub const ALL: [Self; 4] = [Self::F32, Self::F16, Self::Unorm8, Self::Unorm16];

    /// Bytes that one number takes.
    pub fn bytes(self) -> usize {
        match self {
            Self::Unorm8 => 1,
            Self::F16 | Self::Unorm16 => 2,
            Self::F32 => 4,
        }
    }

    /// The largest finite number.
    pub fn largest(self) -> f64 {
        match self {
            Self::F16 => binary16::MAX,
            Self::F32 => f64::from(f32::MAX),
            Self::Unorm8 | Self::Unorm16 => 1.0,
        }
    }

    /// Whether values below zero keep their sign.
    pub fn is_signed(self) -> bool {
        matches!(self, Self::F16 | Self::F32)
    }

    /// Packs `values`, little-endian.
    pub fn pack<T: Copy + Into<f64>>(self, values: &[T]) -> (Vec<u8>, PackReport) {
        match self {
            Self::F16 => binary16::pack(values),
            Self::F32 => binary32::pack(values),
            Self::Unorm8 => unorm::pack8(values),
            Self::Unorm16 => unorm::pack16(values),
        }
    }

    /// Unpacks little-endian `bytes`; a trailing partial number is ignored.
    pub fn unpack(self, bytes: &[u8]) -> Vec<f32> {
        match self {
            Self::F16 => binary16::unpack(bytes),
            Self::F32 => binary32::unpack(bytes),
            Self::Unorm8 => unorm::unpack8(bytes),
            Self::Unorm16 => unorm::unpack16(bytes),
        }
    }

    /// Whether every value from `low` to `high` packs to the same number: a zero of either sign is the same one, and NaN is none.
    pub fn rounds_alike(self, low: f64, high: f64) -> bool {
        let packed = |value: f64| self.unpack(&self.pack(&[value]).0);
        packed(low) == packed(high)
    }

    /// Spacing of the format's numbers at `value`: one unit in the last place.
    pub fn ulp(self, value: f64) -> f64 {
        match self {
            Self::F16 => binary16::ulp(value),
            Self::F32 => binary32::ulp(value),
            Self::Unorm8 => unorm::STEP8,
            Self::Unorm16 => unorm::STEP16,
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::F16 => "f16",
            Self::F32 => "f32",
            Self::Unorm8 => "unorm8",
            Self::Unorm16 => "unorm16",
        })
    }
}

impl FromStr for Number {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|number| number.to_string() == name).ok_or_else(|| {
            let names = Self::ALL.map(|number| number.to_string()).join(", ");
            Error::usage(format!("unknown number format `{name}`"), format!("use one of {names}"))
        })
    }
}

/// Packs each value by `nearest`, which gives its bytes and the value that they stand for, and takes whatever is not finite; finite values
/// beyond `±max` are brought back to it first.
fn pack_each<T: Copy + Into<f64>, const N: usize>(
    values: &[T],
    max: f64,
    nearest: impl Fn(f64) -> ([u8; N], f64),
) -> (Vec<u8>, PackReport) {
    let mut report = PackReport::default();
    let mut bytes = Vec::with_capacity(values.len() * N);
    for &value in values {
        let value = value.into();
        report.negative += u64::from(value < 0.0);
        let (packed, unpacked) = if !value.is_finite() {
            report.nonfinite += 1;
            nearest(value)
        } else if value.abs() > max {
            // Prevents a finite value from becoming infinity.
            report.overflowed += 1;
            nearest(max.copysign(value))
        } else {
            let (packed, unpacked) = nearest(value);
            report.max_abs_error = report.max_abs_error.max((unpacked - value).abs());
            (packed, unpacked)
        };
        debug_assert_eq!(unpacked.is_finite(), value.is_finite());
        bytes.extend_from_slice(&packed);
    }
    (bytes, report)
}

/// Distance between neighbours of a binary format at `value`: exponents `min..=max`, `mantissa` stored bits.
fn spacing(value: f64, min: i32, max: i32, mantissa: i32) -> f64 {
    if !value.is_finite() {
        return f64::NAN;
    }
    let biased = (value.to_bits() >> 52) & 0x7ff;
    let exponent = (biased as i32 - 1023).clamp(min, max);
    f64::from_bits(((exponent - mantissa + 1023) as u64) << 52)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// SplitMix64: small, and the same everywhere.
    pub(crate) struct Random(pub u64);

    impl Random {
        pub(crate) fn next(&mut self) -> u64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        }

        pub(crate) fn below(&mut self, n: u64) -> u64 {
            self.next() % n
        }

        pub(crate) fn unit(&mut self) -> f64 {
            (self.next() >> 11) as f64 * 2_f64.powi(-53)
        }
    }

    #[test]
    fn number_formats_are_what_their_names_say() {
        for number in Number::ALL {
            assert_eq!(number.to_string().parse::<Number>().unwrap(), number);
            assert_eq!(serde_json::to_string(&number).unwrap(), format!("\"{number}\""));
        }
        assert!("f64".parse::<Number>().unwrap_err().to_string().ends_with("; use one of f32, f16, unorm8, unorm16"));
    }

    #[test]
    fn values_round_alike_where_no_tie_lies_between_them() {
        let tie = 2.0_f64.powi(-25); // between 0 and the smallest half
        assert!(Number::F16.rounds_alike(-1e-20, 1e-20) && Number::F16.rounds_alike(-tie, tie));
        assert!(!Number::F16.rounds_alike(tie, tie.next_up()) && !Number::F16.rounds_alike(f64::NAN, f64::NAN));
        assert!(Number::Unorm8.rounds_alike(-1.0, 1e-3) && !Number::Unorm8.rounds_alike(0.0, 2e-3));
    }

    #[test]
    fn reports_merge_by_largest_error_and_summed_counts() {
        let report = |max_abs_error,
                      [overflowed, negative, nonfinite]: [u64; 3],
                      [max_block_error, max_transcoded_error]: [f64; 2]| {
            PackReport { max_abs_error, overflowed, negative, nonfinite, max_block_error, max_transcoded_error }
        };
        let merged = report(0.5, [1, 2, 3], [0.0, 0.5]).merge(report(0.25, [10, 20, 30], [0.125, 0.25]));
        assert_eq!(merged, report(0.5, [11, 22, 33], [0.125, 0.5]));
    }
}
