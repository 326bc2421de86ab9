//! Lobes of GGX and Beckmann so narrow, or seen so flatly, that f64 does not hold what the rules of `ggx.rs` and `beckmann.rs` need.
//!
//! - Near the horizon everything but Fresnel's factor depends on the ratio of the cosine and the width alone, to the order of the larger
//!   of the two: what is smaller than rounding is scaled up. So mu = 0 with alpha → 0 is a limit of its own, and not the mirror.
//! - A cosine that is nothing beside the width is 0.
//! - A lobe that is narrow beside its cosine is a mirror with the masking of the lobe, to the order of (alpha/mu)² ln(mu/alpha): it is
//!   symmetric to first order, and G2 is smooth on the scale of mu. Whether Fresnel's factor is so, too, is looked at.
//!
//! Derived here; tests compare each with the rules where both work.

use super::ROUNDING;
use crate::integrate::Estimate;
use crate::math::frame::sine_of_cosine;

/// The cosine and the width below which both are scaled up until the larger is this: below the rounding of any value.
const SMALLEST: f64 = 1e-20;
/// What scaling is off by, in parts of [`SMALLEST`] and of what Fresnel's factor changes over it: the heavy tail of normals makes
/// cosines of the order of the width larger by up to ln(1/alpha).
const TAIL: f64 = 64.0;

/// The part of alpha below which mu is nothing.
const FLAT: f64 = 1e-20;

/// The part of mu below which alpha makes a mirror: its square is below the rounding of any value …
const NARROW: f64 = 1e-8;
/// … and the multiple of that square, with its logarithm, that the mirror is off by.
const MIRROR_ERROR: f64 = 100.0 * NARROW * NARROW;
/// How far from the mirror direction Fresnel's factor is looked at: these powers of 2 times the width, up to the size of mu.
const LOOKS: [i32; 13] = [1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25];
/// What the mirror is off by, in parts of how Fresnel's factor bends over that many widths, of the lobe that lies as far out: it falls
/// off as the square.
const BEND: f64 = 4.0;
/// The error above which a bend was found: the rules do better.
const STRAIGHT: f64 = 1e-12;

/// The narrowest lobe that rules are asked for.
pub(super) const NARROWEST: f64 = NARROW * SMALLEST;

/// A lobe and its view, scaled up where both are next to nothing.
pub(super) struct Limit {
    mu: f64,
    alpha: f64,
    is_scaled: bool,
}

impl Limit {
    pub(super) fn of(mu: f64, alpha: f64) -> Self {
        let limit = Self::not_flat(mu, alpha);
        Self { mu: if limit.mu < FLAT * limit.alpha { 0.0 } else { limit.mu }, ..limit }
    }

    /// The same for what is not at mu = 0 what it tends to there.
    pub(super) fn not_flat(mu: f64, alpha: f64) -> Self {
        let size = mu.max(alpha);
        let is_scaled = size < SMALLEST;
        let [mu, alpha] = if is_scaled { [mu, alpha].map(|v| v / size * SMALLEST) } else { [mu, alpha] };
        Self { mu, alpha, is_scaled }
    }

    /// ∫ f cosθ_i F dω_i for the Fresnel factors `fresnel` of wo·h, by `by_rules` of mu and alpha unless the lobe is
    /// a mirror, which masks by `visibility` of mu and alpha.
    pub(super) fn reflection<const K: usize>(
        &self,
        visibility: impl Fn(f64, f64) -> f64,
        fresnel: impl Fn(f64) -> [f64; K],
        by_rules: impl FnOnce(f64, f64) -> [Estimate; K],
    ) -> [Estimate; K] {
        let &Self { mu, alpha, .. } = self;
        let mirror = (alpha < NARROW * mu)
            .then(|| self.mirror(visibility, &fresnel))
            .filter(|mirror| alpha < NARROWEST || mirror.iter().all(|e| e.error <= STRAIGHT));
        self.scaled_back(mirror.unwrap_or_else(|| by_rules(mu, alpha)), fresnel)
    }

    /// What is no factor of a mirror, such as what goes through: by `by_rules` of mu and alpha, from what a smooth surface makes of a
    /// cosine. A lobe too narrow for the rules is between the narrowest of theirs and that.
    pub(super) fn scattering<const K: usize>(
        &self,
        smooth: impl Fn(f64) -> [f64; K],
        by_rules: impl FnOnce(f64, f64) -> [Estimate; K],
    ) -> [Estimate; K] {
        let mut estimates = by_rules(self.mu, self.alpha.max(NARROWEST));
        if self.alpha < NARROWEST {
            for (estimate, smooth) in estimates.iter_mut().zip(smooth(self.mu)) {
                estimate.error += (estimate.value - smooth).abs();
            }
        }
        self.scaled_back(estimates, smooth)
    }

    /// `estimates` of what was scaled up, as those of what it was: `fresnel` does not scale.
    fn scaled_back<const K: usize>(
        &self,
        mut estimates: [Estimate; K],
        fresnel: impl Fn(f64) -> [f64; K],
    ) -> [Estimate; K] {
        if self.is_scaled {
            let (scaled, at_horizon) = (fresnel(SMALLEST), fresnel(0.0));
            for (k, estimate) in estimates.iter_mut().enumerate() {
                estimate.error += TAIL * (SMALLEST + (scaled[k] - at_horizon[k]).abs());
            }
        }
        estimates
    }

    fn mirror<const K: usize>(
        &self,
        visibility: impl Fn(f64, f64) -> f64,
        fresnel: impl Fn(f64) -> [f64; K],
    ) -> [Estimate; K] {
        let &Self { mu, alpha, .. } = self;
        let sine = sine_of_cosine(mu);
        let g2 = 4.0 * mu * mu * visibility(mu, alpha);
        let there = fresnel(mu);
        let mut bends = [0.0; K];
        for look in LOOKS {
            let widths = 2.0_f64.powi(look);
            let (sin, cos) = (widths * alpha).sin_cos();
            // Cosines of angles on both sides: above 1 by rounding only.
            let beside = [sine, -sine].map(|sine| fresnel((mu * cos + sine * sin).min(1.0)));
            for (k, bend) in bends.iter_mut().enumerate() {
                *bend += (beside[0][k] - 2.0 * there[k] + beside[1][k]).abs() / (widths * widths);
            }
        }
        std::array::from_fn(|k| {
            let value = g2 * there[k];
            Estimate::bound(value, MIRROR_ERROR + ROUNDING * value.abs() + BEND * bends[k])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::ggx::{reflection_on, straight};
    use super::super::{LADDER, climb};
    use super::*;
    use crate::integrate::quadrature::{beckmann_reflection, ggx_albedo_average, ggx_split};
    use crate::model::beckmann::Beckmann;
    use crate::model::fresnel::{conductor, f82_dip, schlick_weight};
    use crate::model::ggx::Smith;

    const WEIGHTS: fn(f64) -> [f64; 3] = |cosine| [1.0, schlick_weight(cosine), f82_dip(cosine)];

    /// The albedo, bias and dip by the rules alone.
    fn by_rules(mu: f64, alpha: f64, smith: Smith) -> [Estimate; 3] {
        climb(1e-12, |rung| reflection_on(mu, alpha, smith, rung, WEIGHTS))
    }

    fn assert_near(name: &str, got: [f64; 3], wanted: [Estimate; 3], tolerance: impl Fn(usize) -> f64) {
        for k in 0..3 {
            let (off, tolerance) = ((got[k] - wanted[k].value).abs(), wanted[k].error + tolerance(k));
            assert!(off <= tolerance, "{name}, {k}: got {}, wanted {:?} to {tolerance:e}", got[k], wanted[k]);
        }
    }

    #[test]
    fn mirror_meets_the_rules_as_the_lobe_narrows() {
        for smith in Smith::ALL {
            for mu in [1e-6, 1e-3, 0.3, 1.0] {
                for ratio in [1e-2, 1e-4, 1e-5, 1e-7] {
                    let limit = Limit { mu, alpha: ratio * mu, is_scaled: false };
                    let name = format!("{smith:?} at mu {mu:e}, alpha {ratio:e} mu");
                    let tolerance = |_| MIRROR_ERROR * (ratio / NARROW).powi(2);
                    let mirror = limit.mirror(straight(smith), WEIGHTS).map(|e| e.value);
                    assert_near(&name, mirror, by_rules(mu, limit.alpha, smith), tolerance);
                }
            }
        }
    }

    #[test]
    fn so_it_is_with_beckmann() {
        for smith in [Smith::Correlated, Smith::Separable] {
            let split = |mu: f64, alpha: f64| beckmann_reflection(mu, &Beckmann { alpha, smith }, 1e-7, WEIGHTS);
            for mu in [0.0, 5e-324, 1e-300, 1e-24, 1e-14, 1e-8, 1e-3, 0.3, 1.0] {
                for alpha in ALPHAS {
                    let place = format!("{smith:?} at mu {mu:e}, alpha {alpha:e}");
                    let split = split(mu, alpha);
                    assert!(split.iter().all(|e| e.error <= 1e-7), "{place}: {split:?}");
                    let [e, bias, _] = split.map(|e| e.value);
                    assert!(e <= 1.0 + 1e-7 && e > 0.9, "{place}: {e}");
                    if mu > 1e9 * alpha {
                        assert!(
                            (e - 1.0).abs() < 1e-7 && (bias - schlick_weight(mu)).abs() < 1e-7,
                            "{place}: {e}, {bias}"
                        );
                    }
                }
            }
            // On either side of where the mirror takes over, the lobe masks alike.
            for mu in [1e-6, 0.03, 0.5] {
                let [rules, mirror] = [1.01, 0.99].map(|part| split(mu, part * NARROW * mu));
                for (rules, mirror) in rules.iter().zip(&mirror) {
                    assert!((rules.value - mirror.value).abs() < 1e-8, "{smith:?} at mu {mu}: {rules:?}, {mirror:?}");
                }
            }
        }
    }

    #[test]
    fn mirror_knows_where_a_critical_angle_bends_what_it_reflects() {
        let (n, alpha) = (0.7_f64, 1e-6);
        let critical = sine_of_cosine(n).acos();
        for widths in [-100.0, -10.0, -1.0, -0.1, 0.0, 0.1, 1.0, 10.0, 100.0] {
            let mu = (critical + widths * alpha).cos();
            let fresnel = |cosine| [conductor(cosine, n, 0.0)];
            let [mirror] = Limit::of(mu, alpha).mirror(straight(Smith::Correlated), fresnel);
            // The rules do not know of that angle either: two tell how well they see it.
            let [coarse, fine] = [&LADDER[2], &LADDER[5]]
                .map(|rung| reflection_on(mu, alpha, Smith::Correlated, rung, fresnel).values[0]);
            let off = (mirror.value - fine).abs() + (fine - coarse).abs();
            assert!(off <= mirror.error, "{widths} widths: {coarse}, {fine}, {mirror:?}");
        }
    }

    #[test]
    fn near_the_horizon_the_ratio_of_cosine_and_width_is_all_that_matters() {
        let at_horizon = WEIGHTS(0.0);
        for smith in Smith::ALL {
            for [mu, alpha] in [[0.0, 1.0], [0.01, 1.0], [1.0, 1.0], [1.0, 1e-3]] {
                let scaled = |size: f64| by_rules(size * mu, size * alpha, smith);
                for size in [1e-5, 1e-8] {
                    let here = WEIGHTS(size);
                    let tolerance = |k: usize| TAIL * (size + (here[k] - at_horizon[k]).abs());
                    let name = format!("{smith:?} at {size:e} times ({mu}, {alpha})");
                    assert_near(&name, scaled(size).map(|e| e.value), scaled(SMALLEST), tolerance);
                }
            }
        }
    }

    #[test]
    fn a_cosine_that_is_nothing_beside_the_width_is_0() {
        for smith in Smith::ALL {
            for alpha in [1e-12, 1e-3, 1.0] {
                // As far as it is nothing: the largest slope is that of Schlick's G1 for lamps, 1/k.
                let got = by_rules(1e-13 * alpha, alpha, smith).map(|e| e.value);
                assert_near(&format!("{smith:?} at alpha {alpha:e}"), got, by_rules(0.0, alpha, smith), |_| 1e-11);
            }
        }
    }

    const ALPHAS: [f64; 10] = [5e-324, 1e-300, 1e-160, 1e-24, 5.55e-17, 1e-16, 3.6e-15, 1e-11, 1e-8, 1e-5];

    #[test]
    fn every_width_and_cosine_has_its_value() {
        for smith in Smith::ALL {
            for mu in [0.0, 5e-324, 1e-300, 1e-24, 1e-20, 1e-14, 1e-11, 1e-8, 1e-6, 0.0039, 0.3, 1.0] {
                for alpha in ALPHAS {
                    let place = format!("{smith:?} at mu {mu:e}, alpha {alpha:e}");
                    let split = ggx_split(mu, alpha, smith, 1e-7);
                    for (k, most) in [1.0, 1.0, 0.06].into_iter().enumerate() {
                        let Estimate { value, error, .. } = split[k];
                        assert!(error <= 1e-7 && value >= -error && value <= most + error, "{place}: {split:?}");
                    }
                    let [e, bias, _] = split.map(|e| e.value);
                    // Far above the width a mirror; where both are next to nothing, Fresnel's factor is that of the horizon.
                    if mu > 1e9 * alpha && smith != Smith::SchlickDirect {
                        assert!((e - 1.0).abs() < 1e-7, "{place}: {e}");
                        assert!((bias - schlick_weight(mu)).abs() < 1e-7, "{place}: {bias}");
                    }
                    if mu == 0.0 && matches!(smith, Smith::Correlated | Smith::ApproxCorrelated) {
                        assert!((e - 1.0).abs() < 1e-7, "{place}: {e}");
                    }
                    if mu.max(alpha) <= 1e-10 {
                        assert!((e - bias).abs() < 1e-7, "{place}: {e} and {bias}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_width_has_its_average() {
        for smith in Smith::ALL {
            let of = |alpha| ggx_albedo_average(alpha, smith, 1e-9);
            let narrow = of(NARROWEST).value;
            for alpha in ALPHAS {
                let average = of(alpha);
                // Schlick's k for lamps changes with the root of alpha, everything else with alpha.
                let tolerance = 2e-9 + 40.0 * alpha.sqrt();
                assert!(average.error <= 1e-9, "{smith:?} at {alpha:e}: {average:?}");
                assert!((average.value - narrow).abs() <= tolerance, "{smith:?} at {alpha:e}: {average:?}, {narrow}");
            }
        }
    }
}
