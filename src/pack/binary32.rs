//! IEEE 754 binary32, little-endian.
//!
//! - **Rounding**: once, from f64 to the nearest f32, ties to even. Subnormals are kept.
//! - **Negatives**: stored as they are, −0 included; values below zero are counted.
//! - **Overflow**: a finite value beyond ±`f32::MAX` is stored as ±`f32::MAX` and counted.
//! - **NaN, infinity**: stored as what they are and counted; every NaN becomes the one quiet NaN, so that the bytes do not
//!   depend on the machine.

use super::{PackReport, pack_each, spacing};

/// The little-endian f32 nearest to `values`, and what that changed.
pub fn pack<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    pack_each(values, f64::from(f32::MAX), |value| {
        let single = if value.is_nan() { f32::NAN } else { value as f32 };
        (single.to_le_bytes(), f64::from(single))
    })
}

/// The values of little-endian f32; up to three trailing bytes are ignored.
pub fn unpack(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect()
}

/// Spacing of the f32 at `value`: 2⁻¹⁴⁹ for subnormals, NaN for what is not finite.
///
/// At a power of two it is the spacing above it.
pub fn ulp(value: f64) -> f64 {
    spacing(value, -126, 127, 23)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::tests::Random;

    #[test]
    fn values_go_to_the_nearest_f32_with_ties_to_even() {
        let mut random = Random(4);
        for _ in 0..10_000 {
            let bits = random.below(u64::from(f32::MAX.to_bits())) as u32;
            let (lower, upper) = (f64::from(f32::from_bits(bits)), f64::from(f32::from_bits(bits + 1)));
            let tie = 0.5 * (lower + upper);
            let even = if bits.is_multiple_of(2) { lower } else { upper };
            for (value, wanted) in [(tie.next_down(), lower), (tie, even), (tie.next_up(), upper)] {
                let (bytes, report) = pack(&[value]);
                let got = f64::from(unpack(&bytes)[0]);
                assert_eq!(got, wanted, "{value:e}");
                assert_eq!(report.max_abs_error, (got - value).abs(), "{value:e}");
                assert!(report.max_abs_error <= 0.5 * ulp(value), "{value:e}");
            }
        }
    }

    #[test]
    fn f32_survive_bit_by_bit() {
        let values = [0.0, -0.0, 1.0, -1.5, f32::MIN_POSITIVE, 1e-45, f32::MAX, f32::INFINITY, f32::NEG_INFINITY];
        let (bytes, report) = pack(&values);
        for (value, back) in values.iter().zip(unpack(&bytes)) {
            assert_eq!(value.to_bits(), back.to_bits(), "{value:e}");
        }
        let wanted = PackReport { negative: 2, nonfinite: 2, ..PackReport::default() };
        assert_eq!(report, wanted);
    }

    #[test]
    fn values_beyond_the_largest_f32_clamp_and_are_counted() {
        let max = f64::from(f32::MAX);
        let (bytes, report) = pack(&[max.next_up(), -1e300, max, f64::NAN]);
        let back = unpack(&bytes);
        assert_eq!(back[..3], [f32::MAX, f32::MIN, f32::MAX]);
        assert!(back[3].is_nan());
        assert_eq!((report.overflowed, report.negative, report.nonfinite, report.max_abs_error), (2, 1, 1, 0.0));
    }

    #[test]
    fn ulp_is_the_distance_to_the_next_f32() {
        for bits in (0..f32::MAX.to_bits()).step_by(99_991) {
            let (here, next) = (f64::from(f32::from_bits(bits)), f64::from(f32::from_bits(bits + 1)));
            assert_eq!(ulp(here), next - here, "{bits:#010x}");
        }
    }
}
