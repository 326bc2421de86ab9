//! IEEE 754 binary16, little-endian.
//!
//! - **Rounding**: once, from f64 to the nearest half, ties to even. Subnormals are kept.
//! - **Negatives**: stored as they are, −0 included; values below zero are counted.
//! - **Overflow**: a finite value beyond ±65504 is stored as ±65504 and counted (rounding alone would let 65519.9 pass for
//!   65504, and turn 65520 into infinity).
//! - **NaN, infinity**: stored as what they are and counted; every NaN becomes the one quiet NaN, so that the bytes do not
//!   depend on the machine.

use super::{PackReport, spacing};
use half::f16;
use half::slice::HalfFloatSliceExt as _;

/// Largest finite half.
pub const MAX: f64 = 65504.0;

/// Values that are converted together: one call is eight conversions where the processor has them.
const TOGETHER: usize = 256;

/// The little-endian halves nearest to `values`, and what that changed.
pub fn pack<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    let mut report = PackReport::default();
    let mut bytes = Vec::with_capacity(2 * values.len());
    let (mut wanted, mut singles) = ([0.0_f64; TOGETHER], [0.0_f32; TOGETHER]);
    let (mut halves, mut back) = ([f16::ZERO; TOGETHER], [0.0_f32; TOGETHER]);
    for values in values.chunks(TOGETHER) {
        let n = values.len();
        let (wanted, singles) = (&mut wanted[..n], &mut singles[..n]);
        let (halves, back) = (&mut halves[..n], &mut back[..n]);
        for ((value, wanted), single) in values.iter().zip(&mut *wanted).zip(&mut *singles) {
            *wanted = (*value).into();
            let is_beyond = wanted.is_finite() && wanted.abs() > MAX;
            report.negative += u64::from(*wanted < 0.0);
            report.nonfinite += u64::from(!wanted.is_finite());
            report.overflowed += u64::from(is_beyond);
            *single = before_half(if is_beyond { MAX.copysign(*wanted) } else { *wanted });
        }
        halves.convert_from_f32_slice(singles);
        halves.convert_to_f32_slice(back);
        for (wanted, back) in wanted.iter().zip(&*back) {
            // (A value beyond, or none, is counted instead.)
            let off = (f64::from(*back) - wanted).abs();
            let off = if wanted.abs() <= MAX { off } else { 0.0 };
            report.max_abs_error = if off > report.max_abs_error { off } else { report.max_abs_error };
        }
        bytes.extend(halves.iter().flat_map(|half| half.to_le_bytes()));
    }
    (bytes, report)
}

/// The values of little-endian halves, exactly; a trailing odd byte is ignored.
pub fn unpack(bytes: &[u8]) -> Vec<f32> {
    let (pairs, _) = bytes.as_chunks::<2>();
    let mut values = vec![0.0; pairs.len()];
    let mut halves = [f16::ZERO; TOGETHER];
    for (values, pairs) in values.chunks_mut(TOGETHER).zip(pairs.chunks(TOGETHER)) {
        let halves = &mut halves[..pairs.len()];
        halves.iter_mut().zip(pairs).for_each(|(half, pair)| *half = f16::from_le_bytes(*pair));
        halves.convert_to_f32_slice(values);
    }
    values
}

/// Spacing of the halves at `value`: 2⁻²⁴ for subnormals, 32 from 32768 on, NaN for what is not finite.
///
/// At a power of two it is the spacing above it.
pub fn ulp(value: f64) -> f64 {
    spacing(value, -14, 15, 10)
}

/// The half nearest to `value`, ties to even.
///
/// `half::f16::from_f64` does not do: where the processor has F16C it rounds to f32 first and so rounds twice, elsewhere
/// it drops the low 32 bits of the mantissa. Going through f32 by *round to odd* is exact: an f32 has 13 bits more than a
/// half, so every tie between halves is an f32 with an even last bit, and a value beside a tie becomes an f32 beside it, on
/// the same side.
pub(super) fn nearest(value: f64) -> f16 {
    f16::from_f32(before_half(value))
}

/// The f32 whose nearest half is that of `value`; every NaN is the same.
fn before_half(value: f64) -> f32 {
    if value.is_nan() { f32::NAN } else { round_to_odd(value) }
}

/// `value` as an f32: itself if it is one, else of its two neighbours the one whose last bit is 1.
fn round_to_odd(value: f64) -> f32 {
    let near = value as f32;
    if f64::from(near) == value {
        return near;
    }
    // Bit patterns of one sign are ordered by magnitude, so one less is the neighbour towards zero.
    let bits = near.to_bits();
    let towards_zero = if f64::from(near).abs() > value.abs() { bits - 1 } else { bits };
    f32::from_bits(towards_zero | 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::tests::Random;

    /// The oracle: nearest of all finite halves by f64 distance (exact here: both are near each other), ties to even.
    fn nearest_by_search(value: f64) -> u16 {
        let (mut best, mut best_distance) = (0_u16, f64::INFINITY);
        for bits in 0..=0x7bff_u16 {
            let distance = (f16::from_bits(bits).to_f64() - value.abs()).abs();
            if distance < best_distance || (distance == best_distance && bits % 2 == 0) {
                (best, best_distance) = (bits, distance);
            }
        }
        if value.is_sign_negative() { best | 0x8000 } else { best }
    }

    fn packed(value: f64) -> u16 {
        let (bytes, _) = pack(&[value]);
        u16::from_le_bytes([bytes[0], bytes[1]])
    }

    fn assert_nearest(value: f64) {
        let (got, wanted) = (packed(value), nearest_by_search(value));
        assert_eq!(got, wanted, "{value:e}: got {got:#06x}, wanted {wanted:#06x}");
    }

    #[test]
    fn random_values_go_to_the_nearest_half() {
        let mut random = Random(1);
        for _ in 0..400 {
            let exponent = (random.below(44) as i32) - 27;
            let value = (1.0 + random.unit()) * 2_f64.powi(exponent);
            assert_nearest(value.min(MAX));
            assert_nearest(-value.min(MAX));
        }
    }

    #[test]
    fn ties_go_to_even_and_one_f64_ulp_beside_a_tie_does_not() {
        let mut random = Random(2);
        let mut lower: Vec<u16> = (0..200).map(|_| random.below(0x7bff) as u16).collect();
        lower.extend([0, 1, 2, 0x3fe, 0x3ff, 0x400, 0x401, 0x3bff, 0x3c00, 0x7bfd, 0x7bfe]);
        for bits in lower {
            let tie = 0.5 * (f16::from_bits(bits).to_f64() + f16::from_bits(bits + 1).to_f64());
            let even = if bits % 2 == 0 { bits } else { bits + 1 };
            for (value, wanted) in [(tie.next_down(), bits), (tie, even), (tie.next_up(), bits + 1)] {
                assert_eq!(packed(value), wanted, "{value:e} beside the tie above {bits:#06x}");
                assert_eq!(packed(-value), wanted | 0x8000, "{:e} beside the tie above {bits:#06x}", -value);
            }
            assert_nearest(tie);
            assert_nearest(tie.next_up());
        }
    }

    #[test]
    fn every_half_survives_the_round_trip() {
        for bits in 0..=u16::MAX {
            let half = f16::from_bits(bits);
            let (bytes, report) = pack(&[half.to_f64()]);
            let back = u16::from_le_bytes([bytes[0], bytes[1]]);
            if half.is_nan() {
                assert!(unpack(&bytes)[0].is_nan() && report.nonfinite == 1, "{bits:#06x}");
            } else {
                assert_eq!(back, bits);
                assert_eq!(report.max_abs_error, 0.0, "{bits:#06x}");
                assert_eq!(unpack(&bytes)[0].to_bits(), half.to_f32().to_bits());
            }
        }
    }

    #[test]
    fn values_beyond_65504_clamp_and_are_counted() {
        for value in [65504.0_f64.next_up(), 65519.9, 65520.0, 65520.0_f64.next_up(), 1e30, f64::MAX] {
            for value in [value, -value] {
                let (bytes, report) = pack(&[value]);
                assert_eq!(unpack(&bytes)[0], 65504.0_f32.copysign(value as f32), "{value:e}");
                assert_eq!((report.overflowed, report.max_abs_error), (1, 0.0), "{value:e}");
            }
        }
        assert_eq!(pack(&[65504.0_f64, 65504.0_f64.next_down()]).1.overflowed, 0);
    }

    #[test]
    fn what_is_not_finite_is_stored_and_counted() {
        let (bytes, report) = pack(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, -1e-300, 0.0]);
        let back = unpack(&bytes);
        assert!(back[0].is_nan());
        assert_eq!(back[1..3], [f32::INFINITY, f32::NEG_INFINITY]);
        assert!(back[3].to_bits() == (-0.0_f32).to_bits() && back[4].to_bits() == (-0.0_f32).to_bits());
        // Minus infinity and −1e-300 are below zero, −0 is not.
        assert_eq!((report.nonfinite, report.negative, report.overflowed), (3, 2, 0));
    }

    #[test]
    fn the_report_holds_the_largest_error_which_is_at_most_half_an_ulp() {
        let mut random = Random(3);
        let values: Vec<f64> = (0..1000).map(|_| 60000.0 * random.unit().powi(8)).collect();
        let (bytes, report) = pack(&values);
        let errors = values.iter().zip(unpack(&bytes)).map(|(&v, u)| {
            let error = (f64::from(u) - v).abs();
            assert!(error <= 0.5 * ulp(v), "{v:e}: error {error:e}, ulp {:e}", ulp(v));
            error
        });
        assert_eq!(report.max_abs_error, errors.fold(0.0, f64::max));
    }

    #[test]
    fn ulp_is_the_distance_to_the_next_half() {
        for bits in (0..0x7bff_u16).step_by(7) {
            let (here, next) = (f16::from_bits(bits).to_f64(), f16::from_bits(bits + 1).to_f64());
            assert_eq!(ulp(here), next - here, "{bits:#06x}");
            assert_eq!(ulp(-here), next - here, "{bits:#06x}");
        }
        assert_eq!(ulp(1e9), 32.0);
        assert!(ulp(f64::NAN).is_nan() && ulp(f64::INFINITY).is_nan());
    }
}
