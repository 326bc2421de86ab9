//! Unsigned normalised integers of 8 and 16 bits (little-endian): n stands for n/255, n/65535.
//!
//! - **Rounding**: once, from f64 to the nearest n, ties to even; decided exactly, also where value × 255 is no f64.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values above 1 are stored as 1 and counted.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as 1.

use super::PackReport;

/// Spacing of the numbers of 8 bits.
pub const STEP8: f64 = 1.0 / 255.0;
/// Spacing of the numbers of 16 bits.
pub const STEP16: f64 = 1.0 / 65535.0;

/// The bytes nearest to `values`, and what that changed.
pub fn pack8<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    pack(values, u8::MAX.into(), |n| [n as u8])
}

/// The same in 16 bits.
pub fn pack16<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    pack(values, u16::MAX.into(), |n| (n as u16).to_le_bytes())
}

/// The values of bytes, to the nearest f32.
pub fn unpack8(bytes: &[u8]) -> Vec<f32> {
    bytes.iter().map(|&byte| value(byte.into(), u8::MAX.into()) as f32).collect()
}

/// The values of little-endian words, to the nearest f32; a trailing odd byte is ignored.
pub fn unpack16(bytes: &[u8]) -> Vec<f32> {
    let words = bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
    words.map(|word| value(word.into(), u16::MAX.into()) as f32).collect()
}

fn value(n: u32, max: u32) -> f64 {
    f64::from(n) / f64::from(max)
}

fn pack<T: Copy + Into<f64>, const N: usize>(
    values: &[T],
    max: u32,
    bytes: impl Fn(u32) -> [u8; N],
) -> (Vec<u8>, PackReport) {
    let mut report = PackReport::default();
    let mut packed = Vec::with_capacity(values.len() * N);
    for &given in values {
        let given = given.into();
        report.negative += u64::from(given < 0.0);
        report.nonfinite += u64::from(!given.is_finite());
        report.overflowed += u64::from(given > 1.0 && given.is_finite());
        // NaN compares with nothing, and becomes 0.
        let n = if given >= 1.0 {
            max
        } else if given > 0.0 {
            nearest(given, max)
        } else {
            0
        };
        if (0.0..=1.0).contains(&given) {
            report.max_abs_error = report.max_abs_error.max((value(n, max) - given).abs());
        }
        packed.extend_from_slice(&bytes(n));
    }
    (packed, report)
}

/// The n with n/max nearest to `value`, which is between 0 and 1; ties to even.
fn nearest(value: f64, max: u32) -> u32 {
    // The product may round up to a whole number or to a tie, never past it.
    let below = (value * f64::from(max)).floor();
    // How far the exact product is beyond the tie above `below`: a fused multiplication rounds once and keeps the sign.
    let beyond = value.mul_add(f64::from(max), -(below + 0.5));
    let below = below as u32;
    match beyond.total_cmp(&0.0) {
        _ if beyond == 0.0 => below + below % 2,
        std::cmp::Ordering::Less => below,
        _ => below + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::tests::Random;

    /// The oracle, in whole numbers: value = m·2^e, and the n that makes |n·2^−e·2 − 2·max·m·…| least.
    fn nearest_by_integers(value: f64, max: u32) -> u32 {
        // value = m / 2^s with s at least 0, so that n is nearest where |n·2^s − m·max| is least.
        let bits = value.to_bits();
        let (exponent, mantissa) = ((bits >> 52) as i32, bits & ((1 << 52) - 1));
        let shift = 1075 - exponent;
        if shift > 110 {
            return 0; // below 2^−57, which is far below half a step
        }
        let product = (u128::from(mantissa) | 1 << 52) * u128::from(max);
        let (whole, rest) = ((product >> shift) as u32, product & ((1 << shift) - 1));
        match rest.cmp(&(1 << (shift - 1))) {
            std::cmp::Ordering::Less => whole,
            std::cmp::Ordering::Equal => whole + whole % 2,
            std::cmp::Ordering::Greater => whole + 1,
        }
    }

    #[test]
    fn values_go_to_the_nearest_step_also_beside_a_tie() {
        let mut random = Random(11);
        for max in [255_u32, 65535] {
            for _ in 0..20_000 {
                let n = random.below(u64::from(max)) as u32;
                let tie = (f64::from(n) + 0.5) / f64::from(max);
                for value in [random.unit(), tie.next_down(), tie, tie.next_up(), random.unit() * 1e-5] {
                    if value > 0.0 && value < 1.0 {
                        let wanted = nearest_by_integers(value, max);
                        assert_eq!(nearest(value, max), wanted, "{value:e} of {max}");
                    }
                }
            }
        }
        assert_eq!(nearest(0.5, 255), 128, "127.5 to the even one");
    }

    #[test]
    fn every_code_survives_the_round_trip() {
        let all: Vec<u8> = (0..=255).collect();
        let (packed, report) = pack8(&unpack8(&all));
        assert_eq!((packed, report.overflowed, report.negative), (all, 0, 0));
        let all: Vec<u8> = (0..=u16::MAX).flat_map(u16::to_le_bytes).collect();
        let (packed, report) = pack16(&unpack16(&all));
        assert!(packed == all && report.max_abs_error < 1e-7, "{report:?}");
    }

    #[test]
    fn what_does_not_fit_is_clamped_and_counted() {
        let (packed, report) = pack8(&[-0.5, 1.5, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 1.0]);
        assert_eq!(packed, [0, 255, 0, 255, 0, 0, 255]);
        let wanted = PackReport { overflowed: 1, negative: 2, nonfinite: 3, ..PackReport::default() };
        assert_eq!(report, wanted);
    }

    #[test]
    fn the_error_is_at_most_half_a_step() {
        let mut random = Random(12);
        let values: Vec<f64> = (0..5000).map(|_| random.unit()).collect();
        let (eight, sixteen) = (pack8(&values).1.max_abs_error, pack16(&values).1.max_abs_error);
        assert!(eight <= 0.5 * STEP8 && eight > 0.49 * STEP8, "{eight}");
        assert!(sixteen <= 0.5 * STEP16 && sixteen > 0.49 * STEP16, "{sixteen}");
    }
}
