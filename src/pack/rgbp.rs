//! RGBP as PlayCanvas has it in its environment atlases: four bytes, value = ((8 − 7 · p/255) · c/255)², up to [`MAX`].
//!
//! - **Rounding**: p is the greatest whose factor still holds the largest channel (255 for anything up to 1); each channel then takes the byte whose
//!   value is nearest.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond 64 are stored as 64 and counted.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as 64.
//!
//! **Source**: PlayCanvas 1.57, shader chunk `encode`. Its p is rounded up, so that the largest channel may clip by up to 7/255 of its root;
//! ours is rounded down.

use super::factor::{Curve, curve, largest};
use super::{PackReport, triple};
use std::sync::LazyLock;

/// The largest value.
pub const MAX: f64 = 64.0;

static CURVE: LazyLock<Curve> = LazyLock::new(|| curve(|x| x * x));

/// The codes of texels of three values, and what that changed.
pub fn pack<T: Copy + Into<f64>>(values: &[T]) -> (Vec<u8>, PackReport) {
    triple::pack(values, [MAX; 3], |texel| {
        let p = fourth(largest(texel));
        CURVE.texel(texel, p, factor(p))
    })
}

/// The values of codes.
pub fn unpack(bytes: &[u8]) -> Vec<f32> {
    triple::unpack(bytes, |code| CURVE.value(code, factor(code[3])))
}

/// The distance between values that a channel can have at `value`, in a texel whose largest channel is `brightest`, or is stored as that.
pub fn step(value: f64, brightest: f64) -> f64 {
    let p = fourth(brightest);
    CURVE.step(value, CURVE.factor_of(brightest, [0, 1, 2].map(|n| factor(p.saturating_sub(n)))))
}

fn factor(p: u8) -> f64 {
    (8.0 - 7.0 * f64::from(p) / 255.0).powi(2)
}

/// The greatest p whose factor reaches `brightest`.
fn fourth(brightest: f64) -> u8 {
    let estimate = ((8.0 - brightest.clamp(1.0, MAX).sqrt()) / 7.0 * 255.0).floor() as u8;
    // The root is rounded: it may be one too few or too many.
    let fits = |p: u8| factor(p) >= brightest;
    match estimate {
        ..=254 if fits(estimate + 1) => estimate + 1,
        1.. if !fits(estimate) => estimate - 1,
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
            |p| (8.0 - 7.0 * f64::from(p) / 255.0).powi(2),
            |x| x * x,
            |factors| (0..=255_u8).min_by(|&a, &b| factors(a).total_cmp(&factors(b))),
        );
        assert_eq!(pack(&[64.0, 16.0, 0.0]).0, [255, 127, 0, 0], "128 is a hair farther from 16");
        assert_eq!(pack(&[1.0, 0.25, 0.0]).0, [255, 127, 0, 255]);
    }
}
