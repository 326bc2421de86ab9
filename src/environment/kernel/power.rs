//! Powers of numbers in [0, 1], as arithmetic alone.
//!
//! A sheen kernel is a power, and takes one per texel: this one is inlined into loops, which processors run for several texels at once, and
//! has the same bits on all of them. ln x from 2 artanh((m − 1)/(m + 1)) with m in [√½, √2), eˣ from its Taylor series after reduction
//! by multiples of ln 2.

use std::f64::consts::LOG2_E;

/// 2⁵² · 1.5: added to a small number, it leaves the nearest integer in the lowest bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts, the first with zeros at its end, so that products with exponents are exact.
const LN2_HIGH: f64 = 0.693_147_180_369_123_8;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// The bits of √½.
const ROOT_HALF: u64 = 0x3FE6_A09E_667F_3BCD;
/// e to a lower power than this is 0 in what follows.
const LEAST: f64 = -700.0;

/// `x` to the power `p` > 0, for x in [0, 1]: within 4 + 2 |ln xᵖ| units of the last place, and 1e-304 in place of anything smaller.
#[inline(always)]
pub(crate) fn power(x: f64, p: f64) -> f64 {
    exp_of_negative(p * ln(x))
}

/// ln x for x in (0, 1]; a huge negative number for 0.
#[inline(always)]
fn ln(x: f64) -> f64 {
    /// 1/(2k + 1).
    const ODD: [f64; 11] = [
        1.0,
        1.0 / 3.0,
        1.0 / 5.0,
        1.0 / 7.0,
        1.0 / 9.0,
        1.0 / 11.0,
        1.0 / 13.0,
        1.0 / 15.0,
        1.0 / 17.0,
        1.0 / 19.0,
        1.0 / 21.0,
    ];
    // The exponent plus 1024, which is positive; integers become floating-point by their bits, as vectors have no instruction for it.
    let steps = x.to_bits().wrapping_sub(ROOT_HALF).wrapping_add(1024 << 52) >> 52;
    let m = f64::from_bits(x.to_bits().wrapping_sub(steps << 52).wrapping_add(1024 << 52));
    let exponent = f64::from_bits(0x4330_0000_0000_0000 | steps) - 4_503_599_627_371_520.0;
    let f = (m - 1.0) / (m + 1.0);
    let f2 = f * f;
    let mut series = ODD[10];
    series = series * f2 + ODD[9];
    series = series * f2 + ODD[8];
    series = series * f2 + ODD[7];
    series = series * f2 + ODD[6];
    series = series * f2 + ODD[5];
    series = series * f2 + ODD[4];
    series = series * f2 + ODD[3];
    series = series * f2 + ODD[2];
    series = series * f2 + ODD[1];
    series = series * f2 * f + f;
    let ln = exponent * LN2_HIGH + (2.0 * series + exponent * LN2_LOW);
    if x >= f64::MIN_POSITIVE { ln } else { -1e300 }
}

/// eˣ for x ≤ 0.
#[inline(always)]
pub(crate) fn exp_of_negative(x: f64) -> f64 {
    let x = if x > LEAST { x } else { LEAST };
    let rounded = x * LOG2_E + ROUNDER;
    let k = rounded - ROUNDER;
    let r = x - k * LN2_HIGH - k * LN2_LOW;
    let mut series = 1.0 / 6_227_020_800.0;
    series = series * r + 1.0 / 479_001_600.0;
    series = series * r + 1.0 / 39_916_800.0;
    series = series * r + 1.0 / 3_628_800.0;
    series = series * r + 1.0 / 362_880.0;
    series = series * r + 1.0 / 40_320.0;
    series = series * r + 1.0 / 5_040.0;
    series = series * r + 1.0 / 720.0;
    series = series * r + 1.0 / 120.0;
    series = series * r + 1.0 / 24.0;
    series = series * r + 1.0 / 6.0;
    series = series * r + 0.5;
    series = series * r * r + r + 1.0;
    series * f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_those_of_the_library() {
        for i in 0..=20_000 {
            let x = f64::from(i) / 20_000.0;
            for x in [x, x * 1e-6, x * 1e-100, 1.0 - x * 1e-7] {
                for p in [0.5, 0.51, 1.0, 1.7, 8.0, 100.0, 5000.0] {
                    let (got, wanted) = (power(x, p), x.powf(p));
                    let rounding = (4.0 + 2.0 * wanted.max(1e-304).ln().abs()) * f64::EPSILON;
                    assert!((got - wanted).abs() <= rounding * wanted + 1.1e-304, "{x} to the {p}: {got}, {wanted}");
                }
            }
        }
        assert_eq!(power(1.0, 3.3), 1.0);
    }
}
