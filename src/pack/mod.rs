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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
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

    /// Whether every value from `low` to `high` packs to the same number.
    pub fn rounds_alike(self, low: f64, high: f64) -> bool {
        self.pack(&[low]).0 == self.pack(&[high]).0
    }

    /// Spacing of the format's numbers at `value`: one unit in the last place.
    pub fn ulp(self, value: f64) -> f64 {
        match self {
            Self::F16 => binary16::ulp(value),
            Self::F32 => binary32::ulp(value),
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::F16 => "f16",
            Self::F32 => "f32",
        })
    }
}

impl FromStr for Number {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "f16" => Ok(Self::F16),
            "f32" => Ok(Self::F32),
            _ => Err(Error::usage(format!("unknown number format `{name}`"), "use f16 or f32")),
        }
    }
}

impl TexelFormat {
    /// Every texel format that there is.
    pub const ALL: [Self; 6] = {
        use Number::{F16, F32};
        [Self::of(1, F16), Self::of(2, F16), Self::of(4, F16), Self::of(1, F32), Self::of(2, F32), Self::of(4, F32)]
    };

    const fn of(channels: usize, number: Number) -> Self {
        Self { channels, number }
    }

    /// The format of `channels` numbers each.
    ///
    /// **Errors**: any count but 1, 2 or 4.
    pub fn new(channels: usize, number: Number) -> Result<Self> {
        match channels {
            1 | 2 | 4 => Ok(Self { channels, number }),
            _ => Err(Error::usage(
                format!("a texel of {channels} channels, where formats have 1, 2 or 4"),
                "add channels, or split them over several files",
            )),
        }
    }

    /// Bytes that one texel takes.
    pub fn bytes(self) -> usize {
        self.channels * self.number.bytes()
    }

    /// The names of all texel formats, separated by commas.
    pub fn names() -> String {
        Self::ALL.map(|format| format.to_string()).join(", ")
    }
}

impl fmt::Display for TexelFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A slice of the channels' letters: r, rg, (rgb), rgba.
        let letters = &"rgba"[..self.channels.min(4)];
        write!(f, "{letters}{}f", 8 * self.number.bytes())
    }
}

impl FromStr for TexelFormat {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|format| format.to_string() == name).ok_or_else(|| {
            Error::usage(format!("unknown texel format `{name}`"), format!("use one of {}", Self::names()))
        })
    }
}

impl TryFrom<String> for TexelFormat {
    type Error = Error;

    fn try_from(name: String) -> Result<Self> {
        name.parse()
    }
}

impl From<TexelFormat> for String {
    fn from(format: TexelFormat) -> Self {
        format.to_string()
    }
}

/// Packs each value by `nearest`, which gives its bytes and the value that they stand for; finite values beyond `max` are
/// brought back to it first.
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
    fn texel_formats_are_what_their_names_say() {
        for format in TexelFormat::ALL {
            assert_eq!(format.to_string().parse::<TexelFormat>().unwrap(), format);
            let json = serde_json::to_string(&format).unwrap();
            assert_eq!(json, format!("\"{format}\""));
            assert_eq!(serde_json::from_str::<TexelFormat>(&json).unwrap(), format);
        }
        assert_eq!(TexelFormat::names(), "r16f, rg16f, rgba16f, r32f, rg32f, rgba32f");
        assert_eq!("rg16f".parse::<TexelFormat>().unwrap().bytes(), 4);
        assert_eq!("rgba32f".parse::<TexelFormat>().unwrap().bytes(), 16);
    }

    #[test]
    fn unknown_formats_are_refused_with_the_list_of_known_ones() {
        for name in ["rgb16f", "", "RG16F", "rg16", "rg8", "bc6h"] {
            let message = name.parse::<TexelFormat>().unwrap_err().to_string();
            assert!(message.contains("; use one of r16f, rg16f"), "{message}");
        }
        assert!(TexelFormat::new(3, Number::F16).is_err());
        assert!("f64".parse::<Number>().unwrap_err().to_string().ends_with("; use f16 or f32"));
    }

    #[test]
    fn reports_merge_by_largest_error_and_summed_counts() {
        let a = PackReport { max_abs_error: 0.5, overflowed: 1, negative: 2, nonfinite: 3 };
        let b = PackReport { max_abs_error: 0.25, overflowed: 10, negative: 20, nonfinite: 30 };
        assert_eq!(a.merge(b), PackReport { max_abs_error: 0.5, overflowed: 11, negative: 22, nonfinite: 33 });
    }
}
