//! RGB9E5: three mantissas of 9 bits and one exponent of 5, in a little-endian word; value = m · 2^(e − 24).
//!
//! - **Rounding**: the exponent is the least that holds the largest channel; each mantissa is the nearest, ties away from zero as the format's
//!   specification has it.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond [`MAX`] are stored as that and counted.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as [`MAX`].
//!
//! **Source**: EXT_texture_shared_exponent, whose formula this is, in f64.

use super::factor::largest;
use super::{PackReport, triple};

/// The largest value: 511 · 2⁷.
pub const MAX: f64 = 65408.0;

/// The words of texels of three values, and what that changed.
pub fn pack<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    triple::pack(values, [MAX; 3], |texel| {
        let exponent = exponent(largest(texel));
        let unit = unit(exponent);
        // Division by a power of two is exact.
        let mantissas = texel.map(|value| (value / unit).round());
        let [r, g, b] = mantissas.map(|m| m as u32);
        let word = exponent << 27 | b << 18 | g << 9 | r;
        (word.to_le_bytes(), mantissas.map(|m| m * unit))
    })
}

/// The values of little-endian words, exactly.
pub fn unpack(bytes: &[u8]) -> Vec<f32> {
    triple::unpack(bytes, |code| {
        let word = u32::from_le_bytes(code);
        [0, 9, 18].map(|shift| f64::from(word >> shift & 0x1ff) * unit(word >> 27))
    })
}

/// The distance between values that a channel can have, in a texel whose largest channel is `brightest`.
pub fn step(brightest: f64) -> f64 {
    unit(exponent(brightest.min(MAX)))
}

fn unit(exponent: u32) -> f64 {
    2_f64.powi(exponent as i32 - 24)
}

/// The least exponent under which `brightest` rounds to a mantissa of 9 bits.
fn exponent(brightest: f64) -> u32 {
    let mut exponent = 0;
    while (brightest / unit(exponent)).round() > 511.0 && exponent < 31 {
        exponent += 1;
    }
    exponent
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::tests::Random;

    /// The formula of the specification, step by step.
    fn by_the_specification(rgb: [f64; 3]) -> u32 {
        let max = rgb.into_iter().fold(0.0, f64::max);
        let preliminary = (max.log2().floor()).max(-16.0) as i32 + 1 + 15;
        let scaled = |e: i32, v: f64| (v / 2_f64.powi(e - 15 - 9) + 0.5).floor();
        let exponent = if scaled(preliminary, max) == 512.0 { preliminary + 1 } else { preliminary };
        let [r, g, b] = rgb.map(|v| scaled(exponent, v) as u32);
        (exponent as u32) << 27 | b << 18 | g << 9 | r
    }

    #[test]
    fn words_are_those_of_the_specification() {
        let mut random = Random(13);
        for _ in 0..50_000 {
            let scale = 2_f64.powi(random.below(36) as i32 - 20);
            let rgb = [0; 3].map(|_| (random.unit() * scale).min(MAX));
            let (bytes, report) = pack(&rgb);
            let got = u32::from_le_bytes(bytes[..].try_into().unwrap());
            assert_eq!(got, by_the_specification(rgb), "{rgb:?}: {got:#010x}");
            let half = 0.5 * step(largest(rgb));
            assert!(report.max_abs_error <= half, "{rgb:?}: off by {}, half a step is {half}", report.max_abs_error);
        }
    }

    #[test]
    fn a_largest_channel_that_rounds_up_takes_the_next_exponent() {
        let word = |value: f64| u32::from_le_bytes(pack(&[value, 0.0, 0.0]).0[..].try_into().unwrap());
        assert_eq!(word(511.49 * 2_f64.powi(-9)) >> 27, 15);
        assert_eq!((word(511.5 * 2_f64.powi(-9)) >> 27, word(511.5 * 2_f64.powi(-9)) & 0x1ff), (16, 256));
    }

    #[test]
    fn every_word_is_worth_what_its_packing_is_worth() {
        let mut random = Random(14);
        for _ in 0..20_000 {
            let word = (random.next() as u32).to_le_bytes();
            let values = unpack(&word);
            let (again, report) = pack(&values);
            assert_eq!(unpack(&again), values, "{word:?}");
            assert_eq!(report, PackReport::default());
        }
    }

    #[test]
    fn what_does_not_fit_is_clamped_and_counted() {
        let (bytes, report) = pack(&[65409.0, -1.0, f64::NAN, f64::INFINITY, 0.0, f64::NEG_INFINITY]);
        assert_eq!(unpack(&bytes), [65408.0, 0.0, 0.0, 65408.0, 0.0, 0.0]);
        assert_eq!(report, PackReport { overflowed: 1, negative: 2, nonfinite: 3, ..PackReport::default() });
    }
}
