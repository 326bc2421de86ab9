//! B10G11R11: unsigned floats of 11, 11 and 10 bits (exponents of 5 bits, mantissas of 6, 6 and 5), red lowest, in a little-endian word.
//!
//! - **Rounding**: once, from f64 to the nearest, ties to even; through a half it would round twice. Subnormals are kept.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond [`MAX`] are stored as that and counted.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as the largest value, though the format has codes for NaN and +∞: they would spread
//!   in a shader. Read, they are what they are.
//!
//! **Source**: Khronos, *Data Format Specification* 1.4, unsigned 11- and 10-bit floating-point numbers.

use super::{PackReport, spacing, triple};

/// The largest values of red, green and blue.
pub const MAX: [f64; 3] = [65024.0, 65024.0, 64512.0];
/// Bits of the mantissas.
const MANTISSA: [i32; 3] = [6, 6, 5];
/// Where the channels begin in the word.
const SHIFT: [u32; 3] = [0, 11, 22];

/// The words of texels of three values, and what that changed.
pub fn pack<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    triple::pack(values, MAX, |texel| {
        let codes = [0, 1, 2].map(|c| nearest(texel[c], MANTISSA[c]));
        let word = codes[0] | codes[1] << SHIFT[1] | codes[2] << SHIFT[2];
        (word.to_le_bytes(), [0, 1, 2].map(|c| value(codes[c], MANTISSA[c])))
    })
}

/// The values of little-endian words, exactly.
pub fn unpack(bytes: &[u8]) -> Vec<f32> {
    triple::unpack(bytes, |code| {
        let word = u32::from_le_bytes(code);
        [0, 1, 2].map(|c| value(word >> SHIFT[c] & ((32 << MANTISSA[c]) - 1), MANTISSA[c]))
    })
}

/// Spacing of the numbers of a channel (0 red, 1 green, 2 blue) at `value`, which is that of the largest beyond it.
pub fn ulp(channel: usize, value: f64) -> f64 {
    spacing(value, -14, 15, MANTISSA[channel.min(2)])
}

/// The code nearest to `value`, which is between 0 and the largest.
fn nearest(value: f64, mantissa: i32) -> u32 {
    let step = spacing(value, -14, 15, mantissa);
    // Division by a power of two is exact; codes are in the order of their values, so that rounding up to the next binade carries.
    let steps = (value / step).round_ties_even() as u32;
    let smallest_step = spacing(0.0, -14, 15, mantissa);
    let binade = ((step / smallest_step).to_bits() >> 52) as u32 - 1023;
    steps + (binade << mantissa)
}

fn value(code: u32, mantissa: i32) -> f64 {
    let (exponent, fraction) = (code >> mantissa, f64::from(code & ((1 << mantissa) - 1)));
    let unit = 2_f64.powi(-14 - mantissa);
    match exponent {
        0 => fraction * unit,
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (fraction + f64::from(1_u32 << mantissa)) * unit * 2_f64.powi(exponent as i32 - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::tests::Random;

    /// The oracle: the nearest of all finite codes, ties to the even one.
    fn nearest_by_search(target: f64, mantissa: i32) -> u32 {
        let (mut best, mut best_distance) = (0, f64::INFINITY);
        for code in 0..31 << mantissa {
            let distance = (value(code, mantissa) - target).abs();
            if distance < best_distance || (distance == best_distance && code % 2 == 0) {
                (best, best_distance) = (code, distance);
            }
        }
        best
    }

    #[test]
    fn values_go_to_the_nearest_code_also_beside_a_tie() {
        let mut random = Random(15);
        for mantissa in [5, 6] {
            let last = (31_u32 << mantissa) - 1;
            for _ in 0..300 {
                let code = random.below(u64::from(last)) as u32;
                let tie = 0.5 * (value(code, mantissa) + value(code + 1, mantissa));
                for target in [tie.next_down(), tie, tie.next_up(), random.unit() * tie] {
                    assert_eq!(nearest(target, mantissa), nearest_by_search(target, mantissa), "{target:e}");
                }
            }
            assert_eq!(nearest(value(last, mantissa), mantissa), last);
        }
    }

    #[test]
    fn a_value_that_a_half_would_round_twice_is_rounded_once() {
        // A hair above the tie of 11 bits; as a half it is the tie, and would go to even.
        let value = 1.0 + 2_f64.powi(-7) + 2_f64.powi(-20);
        assert_eq!(unpack(&pack(&[value, 0.0, 0.0]).0)[0], 1.0 + 2_f32.powi(-6));
        assert_eq!(half::f16::from_f64(value).to_f64(), 1.0 + 2_f64.powi(-7));
    }

    #[test]
    fn every_finite_word_survives_the_round_trip() {
        let mut random = Random(16);
        for _ in 0..20_000 {
            let word = random.next() as u32;
            let values = unpack(&word.to_le_bytes());
            if values.iter().all(|v| v.is_finite()) {
                let (again, report) = pack(&values);
                assert_eq!(again, word.to_le_bytes(), "{word:#010x}");
                assert_eq!(report, PackReport::default());
            }
        }
        let special = unpack(&(31_u32 << 6 | (31 << 6 | 1) << 11).to_le_bytes());
        assert!(special[0] == f32::INFINITY && special[1].is_nan() && special[2] == 0.0);
    }

    #[test]
    fn what_does_not_fit_is_clamped_and_counted() {
        let (bytes, report) = pack(&[65025.0, 65024.0, 64513.0, -1.0, f64::NAN, f64::INFINITY]);
        assert_eq!(unpack(&bytes), [65024.0, 65024.0, 64512.0, 0.0, 0.0, 64512.0]);
        assert_eq!(report, PackReport { overflowed: 2, negative: 1, nonfinite: 2, ..PackReport::default() });
    }
}
