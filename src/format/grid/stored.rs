//! How finely numbers are stored, whatever the file calls them.

use crate::pack::{Number, TexelFormat, binary16};
use serde::Serialize;
use std::fmt;

/// How finely a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(into = "String")]
pub enum Stored {
    /// Half floats.
    F16,
    /// Floats.
    F32,
    /// Doubles.
    F64,
    /// Unsigned integers of so many bits that stand for 0 to 1.
    Unorm(u32),
    /// Decimals with so many places after the point.
    Decimal(u32),
    /// A channel of a texel format whose channels are rounded together, or unlike each other.
    Packed(TexelFormat, usize),
}

/// Values that must be there before their all being multiples of 1/255 proves anything.
const ENOUGH_LEVELS: usize = 8;
/// Places that some of a table's floats have at least, if each is printed as the shortest decimal that is read as it.
const FLOAT_PLACES: u32 = 7;
/// Places that a decimal has at most before it says nothing about rounding.
const MOST_PLACES: u32 = 17;

/// The floats whose digits these are, as few as tell each from its neighbours, or nine; the same numbers where some are no such digits.
pub(super) fn as_floats(values: Vec<f64>) -> Vec<f64> {
    /// Half a unit of the ninth digit, at most.
    const NINE_DIGITS: f64 = 5e-9;
    let is_float = |&value: &f64| {
        let float = value as f32;
        !value.is_finite()
            || (value - f64::from(float)).abs() <= NINE_DIGITS * value.abs()
            || float.to_string().parse() == Ok(value)
    };
    if values.iter().all(is_float) { values.iter().map(|&v| f64::from(v as f32)).collect() } else { values }
}

impl Stored {
    /// The distance of neighbouring numbers at `value`, on its own: correct rounding is off by at most half of it.
    pub fn step(self, value: f64) -> f64 {
        self.step_beside(value, value.abs())
    }

    /// The same in a texel whose largest channel is `brightest`: some formats round the channels of a texel by that. BC6H promises no
    /// step; seven bits are what its endpoints have at least.
    pub fn step_beside(self, value: f64, brightest: f64) -> f64 {
        match self {
            Self::F16 => Number::F16.ulp(value),
            Self::F32 => Number::F32.ulp(value),
            Self::F64 => f64::EPSILON * value.abs(),
            Self::Unorm(bits) => 1.0 / ((1_u64 << bits.min(52)) - 1) as f64,
            Self::Decimal(places) => 10_f64.powi(-(places as i32)),
            Self::Packed(format, channel) => {
                format.step(channel, value, brightest.max(value.abs())).unwrap_or_else(|| value.abs().max(1e-6) / 128.0)
            }
        }
    }

    /// The nearest number that is stored so in a texel whose largest channel is `brightest`.
    pub fn round_beside(self, value: f64, brightest: f64) -> f64 {
        match self {
            Self::F16 | Self::F32 => {
                let number = if self == Self::F16 { Number::F16 } else { Number::F32 };
                f64::from(number.unpack(&number.pack(&[value]).0)[0])
            }
            Self::F64 => value,
            Self::Unorm(_) => {
                let step = self.step(value);
                (value.clamp(0.0, 1.0) / step).round() * step
            }
            Self::Decimal(_) | Self::Packed(..) => {
                let step = self.step_beside(value, brightest);
                (value / step).round() * step
            }
        }
    }

    /// What decimals with that many places really are: halves where every one is a half as far as the places tell.
    pub(crate) fn of_decimals(values: &[f64], places: i32) -> Self {
        let places = places.clamp(0, MOST_PLACES as i32) as u32;
        let printed = 0.5 * 10_f64.powi(-(places as i32)) * (1.0 + 1e-9);
        let is_half = |v: f64| {
            let half = f64::from(half::f16::from_f64(v));
            // Printed as a float, it has no more places than tell it from other floats.
            let as_float = places >= FLOAT_PLACES && half == f64::from(v as f32);
            // Decimals coarser than halves cannot tell.
            as_float || ((half - v).abs() <= printed && printed < 0.25 * binary16::ulp(v))
        };
        let telling = values.iter().filter(|v| v.fract() != 0.0).count();
        if telling >= 2 && values.iter().all(|&v| v == 0.0 || v.fract() == 0.0 || is_half(v)) {
            return Self::F16;
        }
        if places >= 9 { Self::F32 } else { Self::Decimal(places) }
    }

    /// A number on its own.
    pub(super) fn of_number(number: Number) -> Self {
        match number {
            Number::F16 => Self::F16,
            Number::F32 => Self::F32,
            Number::Unorm8 => Self::Unorm(8),
            Number::Unorm16 => Self::Unorm(16),
        }
    }

    /// What floats really are: bytes or words where every one is a multiple of 1/255 or 1/65535, halves where every one is a half.
    pub(super) fn of_floats(values: &[f64], container: Self) -> Self {
        if matches!(container, Self::Unorm(_)) {
            return container;
        }
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        for bits in [8, 16] {
            let stored = Self::Unorm(bits);
            let step = stored.step(0.0);
            if container == Self::F16 && bits == 16 {
                continue; // a half is coarser than that
            }
            let slack = |v: f64| 0.5 * container.step(v) + 1e-3 * step;
            let mut levels: Vec<i64> = finite().map(|v| (v / step).round() as i64).collect();
            let fits = finite()
                .all(|v| (0.0..=1.0 + step / 4.0).contains(&v) && (v - (v / step).round() * step).abs() <= slack(v));
            levels.sort_unstable();
            levels.dedup();
            if fits && levels.len() >= ENOUGH_LEVELS {
                return stored;
            }
        }
        let is_half = |v: f64| f64::from(half::f16::from_f64(v)) == v;
        if container == Self::F32 && finite().all(is_half) { Self::F16 } else { container }
    }
}

impl fmt::Display for Stored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::F16 => f.write_str("half floats"),
            Self::F32 => f.write_str("floats"),
            Self::F64 => f.write_str("doubles"),
            Self::Unorm(bits) => write!(f, "{bits} bits"),
            Self::Decimal(places) => write!(f, "decimals with {places} places"),
            Self::Packed(format, _) => write!(f, "{format}"),
        }
    }
}

impl From<Stored> for String {
    fn from(stored: Stored) -> Self {
        stored.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_of_floats_are_the_floats() {
        let floats: Vec<f32> = vec![645.185_4, 0.1, 0.0, -3.0e-5, 2.5e7, f32::NAN, f32::INFINITY];
        let printed = |digits: &dyn Fn(f32) -> String| floats.iter().map(|v| digits(*v).parse().unwrap()).collect();
        for digits in [&|v: f32| v.to_string(), &|v: f32| format!("{v:.8e}")] as [&dyn Fn(f32) -> String; 2] {
            let read = as_floats(printed(digits));
            assert!(read.iter().zip(&floats).all(|(a, b)| a.total_cmp(&f64::from(*b)).is_eq()), "{read:?}");
        }
        // Of numbers with more digits, each is what it is.
        let doubles: Vec<f64> = (1..20).map(|i| 1.0 / f64::from(i)).collect();
        assert_eq!(as_floats(doubles.clone()), doubles);
    }

    #[test]
    fn floats_that_were_bytes_or_halves_are_known() {
        let bytes: Vec<f64> = (0..50).map(|i| f64::from((i * 5) as f32 / 255.0)).collect();
        assert_eq!(Stored::of_floats(&bytes, Stored::F32), Stored::Unorm(8));
        let halves: Vec<f64> = (0..50).map(|i| f64::from(half::f16::from_f64(0.013 * f64::from(i)))).collect();
        assert_eq!(Stored::of_floats(&halves, Stored::F32), Stored::F16);
        // As Rust and JavaScript print floats: 0.9995117 is 0.99951171875.
        assert_eq!(Stored::of_decimals(&[0.93115234, 0.9897461, 0.9995117, 1.0], 8), Stored::F16);
        assert_eq!(Stored::of_decimals(&[0.93115234, 0.9897461, 0.9995118, 1.0], 8), Stored::Decimal(8));
        let floats: Vec<f64> = (0..50).map(|i| f64::from(0.013_f32 * i as f32)).collect();
        assert_eq!(Stored::of_floats(&floats, Stored::F32), Stored::F32);
    }

    #[test]
    fn rounding_is_to_the_nearest_that_is_stored() {
        let round = |stored: Stored, v: f64| stored.round_beside(v, v);
        assert_eq!(round(Stored::Unorm(8), 0.5), 128.0 / 255.0);
        assert_eq!(round(Stored::Decimal(2), 0.126), 0.13);
        assert!((round(Stored::F16, 0.1) - 0.1).abs() <= 0.5 * Stored::F16.step(0.1));
        // A common exponent: beside 1.0, the nine bits of a small channel end where those of the large one do.
        let green = Stored::Packed(TexelFormat::Rgb9e5, 1);
        assert!(green.step(0.01) < 0.1 * green.step_beside(0.01, 1.0));
        assert_eq!(green.round_beside(0.01, 1.0), (0.01 * 256.0_f64).round() / 256.0);
    }
}
