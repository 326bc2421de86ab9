//! RGBM as PlayCanvas has it: four bytes, value = (8 · m/255 · c/255)², up to [`MAX`].
//!
//! - **Rounding**: m is the least that holds the largest channel, and 1 for black; each channel then takes the byte whose value is nearest. The
//!   square root in the curve makes steps that grow with the value.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond 64 are stored as 64 and counted.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as 64.
//!
//! Others have an RGBM of another range, or without the square; theirs cannot be told apart from the bytes.
//!
//! **Source**: PlayCanvas 1.57, shader chunk `encode`, whose m is the same but for black.

use super::factor::{Curve, curve, largest};
use super::{PackReport, triple};
use std::sync::LazyLock;

/// The largest value.
pub const MAX: f64 = 64.0;

static CURVE: LazyLock<Curve> = LazyLock::new(|| curve(|x| x * x));

/// The codes of texels of three values, and what that changed.
pub fn pack<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    triple::pack(values, [MAX; 3], |texel| {
        let m = multiplier(largest(texel));
        CURVE.texel(texel, m, factor(m))
    })
}

/// The values of codes.
pub fn unpack(bytes: &[u8]) -> Vec<f32> {
    triple::unpack(bytes, |code| CURVE.value(code, factor(code[3])))
}

/// The distance between values that a channel can have at `value`, in a texel whose largest channel is `brightest`, or is stored as that.
pub fn step(value: f64, brightest: f64) -> f64 {
    let m = multiplier(brightest);
    CURVE.step(value, CURVE.factor_of(brightest, [0, 1, 2].map(|n| factor(m.saturating_add(n)))))
}

fn factor(m: u8) -> f64 {
    MAX * (f64::from(m) / 255.0).powi(2)
}

/// The least m whose factor reaches `brightest`.
fn multiplier(brightest: f64) -> u8 {
    let estimate = ((brightest / MAX).clamp(0.0, 1.0).sqrt() * 255.0).ceil().max(1.0) as u8;
    // The root is rounded: it may be one too many or too few.
    let fits = |m: u8| factor(m) >= brightest;
    match estimate {
        2.. if fits(estimate - 1) => estimate - 1,
        ..=254 if !fits(estimate) => estimate + 1,
        _ => estimate,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::factor::tests::check;

    #[test]
    fn every_channel_takes_the_nearest_byte_under_the_least_multiplier() {
        check(
            pack,
            unpack,
            step,
            MAX,
            |m| MAX * (f64::from(m) / 255.0).powi(2),
            |x| x * x,
            |factors| (1..=255_u8).min_by(|&a, &b| factors(a).total_cmp(&factors(b))),
        );
        assert_eq!(pack(&[64.0, 16.0, 0.0]).0, [255, 127, 0, 255], "128 is a hair farther from 16");
        assert_eq!(pack(&[0.0; 3]).0, [0, 0, 0, 1]);
    }
}
