//! RGBE, the pixels of Radiance HDR: three mantissas of 8 bits and one exponent, a byte each; value = m · 2^(e − 136), black is e = 0.
//!
//! - **Rounding**: the exponent is the least that holds the largest channel; each mantissa is the nearest, ties to even. (Radiance's own writer
//!   truncates, and its reader adds half a step; most readers, ours among them, do not.)
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond [`MAX`] are stored as that and counted; nothing wraps around. Values below 2⁻¹³⁶ are 0.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as [`MAX`].
//!
//! The code (1, 1, 1, 1), 2⁻¹³⁵, is stored as black: rows that are not compressed take it for a repetition.
//!
//! **Source**: Ward, "Real Pixels", Graphics Gems II (1991).

use super::factor::largest;
use super::{PackReport, triple};

/// The largest value: 255 · 2¹¹⁹.
pub const MAX: f64 = 255.0 * (1_u128 << 119) as f64;

/// The codes of texels of three values, and what that changed.
pub fn pack<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    triple::pack(values, [MAX; 3], nearest)
}

/// The values of codes; those below the range of f32 are rounded to it.
pub fn unpack(bytes: &[u8]) -> Vec<f32> {
    triple::unpack(bytes, value)
}

/// What a code stands for.
pub fn value([r, g, b, e]: [u8; 4]) -> [f64; 3] {
    if e == 0 { [0.0; 3] } else { [r, g, b].map(|m| f64::from(m) * unit(e)) }
}

/// The distance between values that a channel can have, in a texel whose largest channel is `brightest`.
pub fn step(brightest: f64) -> f64 {
    unit(exponent(brightest.min(MAX)))
}

fn unit(exponent: u8) -> f64 {
    2_f64.powi(i32::from(exponent) - 136)
}

/// The least exponent under which `brightest` rounds to a byte.
fn exponent(brightest: f64) -> u8 {
    // value = f · 2^(binary + 1) with f from 1/2 to 1.
    let binary = if brightest > 0.0 { (brightest.to_bits() >> 52) as i32 - 1023 } else { -1023 };
    let estimate = (binary + 129).clamp(1, 255) as u8;
    if (brightest / unit(estimate)).round_ties_even() > 255.0 { estimate.saturating_add(1) } else { estimate }
}

fn nearest(texel: [f64; 3]) -> ([u8; 4], [f64; 3]) {
    let e = exponent(largest(texel));
    let [r, g, b] = texel.map(|value| (value / unit(e)).round_ties_even().min(255.0) as u8);
    let code = match [r, g, b] {
        [0, 0, 0] => [0; 4],
        [1, 1, 1] => [0; 4], // only ever with the least exponent: see the head
        _ => [r, g, b, e],
    };
    (code, value(code))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::tests::Random;

    /// The oracle: of all exponents the least under which all three mantissas fit, and of all mantissas the nearest.
    fn by_search(texel: [f64; 3]) -> [f64; 3] {
        let steps = |e: i32, v: f64| v / 2_f64.powi(e - 136);
        let fits = |e: &i32| texel.iter().all(|&v| steps(*e, v) < 255.5);
        let e = (1..=255).find(fits).unwrap();
        texel.map(|v| {
            let low = steps(e, v).floor();
            let rest = steps(e, v) - low;
            let up = rest > 0.5 || (rest == 0.5 && low % 2.0 == 1.0);
            (low + f64::from(u8::from(up))) * 2_f64.powi(e - 136)
        })
    }

    #[test]
    fn mantissas_are_the_nearest_under_the_least_exponent() {
        let mut random = Random(17);
        for _ in 0..20_000 {
            let scale = 2_f64.powi(random.below(240) as i32 - 118);
            let texel = [0; 3].map(|_| random.unit() * scale).map(|v| v.min(MAX));
            let (bytes, report) = pack(&texel);
            let got = value([bytes[0], bytes[1], bytes[2], bytes[3]]);
            assert_eq!(got, by_search(texel), "{texel:?}");
            assert!(report.max_abs_error <= 0.5 * step(largest(texel)), "{texel:?}: {report:?}");
        }
    }

    #[test]
    fn a_mantissa_that_rounds_up_takes_the_next_exponent_and_nothing_wraps_around() {
        assert_eq!(pack(&[255.5, 1.0, 0.0]).0, [128, 0, 0, 137]);
        assert_eq!(pack(&[255.4, 1.0, 0.0]).0, [255, 1, 0, 136]);
        assert_eq!(pack(&[1e-39, 0.0, 0.0]).0, [44, 0, 0, 1]);
        assert_eq!(pack(&[1e-45, 0.0, 0.0]).0, [0; 4]);
        assert_eq!(pack(&[2_f64.powi(-135); 3]).0, [0; 4]);
        let (bytes, report) = pack(&[1e300, f64::INFINITY, -1.0]);
        assert_eq!((bytes, report.overflowed, report.nonfinite, report.negative), (vec![255, 255, 0, 255], 1, 1, 1));
    }

    #[test]
    fn every_normalised_code_survives_the_round_trip() {
        let mut random = Random(18);
        for _ in 0..20_000 {
            let code = [random.next() as u8 | 128, random.next() as u8, random.next() as u8, random.next() as u8 | 1];
            assert_eq!(pack(&value(code)).0, code);
        }
    }
}
