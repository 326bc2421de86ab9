//! RGBD as Babylon.js has it: four bytes, value = (c/255)^2.2 · 255/d, up to [`MAX`].
//!
//! - **Rounding**: d is the greatest divisor that still holds the largest channel (255 for anything up to 1); each channel then takes the byte whose
//!   value is nearest.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond 255 are stored as 255 and counted.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as 255.
//!
//! The gamma of 2.2 is that of Babylon's `toLinearSpace`, not the sRGB curve. d = 0, which no writer makes, reads as 1.
//!
//! **Source**: Babylon.js, shader include `helperFunctions`, `toRGBD` and `fromRGBD`; its d is the same.

use super::factor::{Curve, curve, largest};
use super::{PackReport, triple};
use std::sync::LazyLock;

/// The largest value.
pub const MAX: f64 = 255.0;

// The libm crate gives the same bits on every machine.
static CURVE: LazyLock<Curve> = LazyLock::new(|| curve(|x| libm::pow(x, 2.2)));

/// The codes of texels of three values, and what that changed.
pub fn pack<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    triple::pack(values, [MAX; 3], |texel| {
        let d = divisor(largest(texel));
        CURVE.texel(texel, d, factor(d))
    })
}

/// The values of codes.
pub fn unpack(bytes: &[u8]) -> Vec<f32> {
    triple::unpack(bytes, |code| CURVE.value(code, factor(code[3])))
}

/// The distance between values that a channel can have at `value`, in a texel whose largest channel is `brightest`, or is stored as that.
pub fn step(value: f64, brightest: f64) -> f64 {
    let d = divisor(brightest);
    CURVE.step(value, CURVE.factor_of(brightest, [0, 1, 2].map(|n| factor(d.saturating_sub(n)))))
}

fn factor(d: u8) -> f64 {
    255.0 / f64::from(d.max(1))
}

/// The greatest d whose factor reaches `brightest`.
fn divisor(brightest: f64) -> u8 {
    let estimate = (255.0 / brightest.max(1.0)).floor().clamp(1.0, 255.0) as u8;
    // The quotient is rounded: it may be one too few or too many.
    let fits = |d: u8| factor(d) >= brightest;
    match estimate {
        ..=254 if fits(estimate + 1) => estimate + 1,
        2.. if !fits(estimate) => estimate - 1,
        _ => estimate,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::factor::tests::check;

    #[test]
    fn every_channel_takes_the_nearest_byte_under_the_least_factor() {
        check(
            pack,
            unpack,
            step,
            MAX,
            |d| 255.0 / f64::from(d.max(1)),
            |x| libm::pow(x, 2.2),
            |factors| (1..=255_u8).min_by(|&a, &b| factors(a).total_cmp(&factors(b))),
        );
        assert_eq!(pack(&[255.0, 0.0, 0.0]).0, [255, 0, 0, 1]);
        assert_eq!(pack(&[1.0, 0.0, 0.0]).0, [255, 0, 0, 255]);
    }
}
