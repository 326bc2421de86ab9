//! The deterministic road: one file per kind of integrand, and the ladder of rules that all of them climb.

mod beckmann;
mod charlie;
mod dielectric;
mod dielectric_average;
#[cfg(test)]
mod evaluations;
mod facet_weight;
mod ggx;
mod limit;
mod ltc;
mod ltc_fit;

pub use beckmann::{beckmann_albedo_average, beckmann_reflection};
pub use charlie::{charlie_albedo_average, charlie_split};
pub use dielectric::dielectric_scattering;
pub use dielectric_average::dielectric_scattering_average;
pub use facet_weight::{ggx_dielectric_weight, ggx_power_weight, schlick_scattering};
pub use ggx::{ggx_albedo, ggx_albedo_average, ggx_reflection, ggx_split};
pub use ltc::Surface;
pub(crate) use ltc::not_below;
pub(crate) use ltc_fit::solve;
pub use ltc_fit::{LtcDistance, LtcFit, ltc_distance, ltc_fit, ltc_fit_quickly};

use super::Estimate;
use crate::math::quadrature::GradedRules;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::sync::LazyLock;

/// A rule of the ladder: the accuracy e^(−digits) at which an integral is computed.
struct Rung {
    /// For integrands that are analytic in the whole strip that a graded rule assumes.
    rules: GradedRules,
    /// For Gaussians and their like, which grow beyond the middle half of that strip: twice the digits make up for half the strip.
    doubled: GradedRules,
    /// Over half a circle, ∫ f(y) dψ from 0 to π with y = sin²(ψ/2), for integrands with a pole at negative y: see [`near_pole`].
    circle: GradedRules,
    /// [`Rung::doubled`] in y = sin²(πx/2).
    doubled_circle: GradedRules,
    /// [`Rung::rules`] in sin(πx/2): over a quarter of a circle, graded to where the sine is 0.
    quarter: GradedRules,
    /// The same of twice the digits, for polynomials of so high a degree in sines and cosines that they grow as Gaussians do.
    doubled_quarter: GradedRules,
    /// The same over an eighth, in sin(πx/4).
    eighth: GradedRules,
}

/// The scale of [`Rung::circle`] for a pole at y = −1/`ratio`: τ = tan(ψ/4) keeps it on the imaginary axis, at
/// w = 1/(ρ + √(ρ² + 1)) with ρ² = `ratio`.
#[inline]
fn near_pole(ratio: f64) -> f64 {
    1.0 / (ratio.sqrt() + (ratio + 1.0).sqrt())
}

/// y and dψ/dτ at τ = tan(ψ/4).
#[inline]
fn quarter_tangent(tau: f64) -> (f64, f64) {
    let q = 1.0 / (1.0 + tau * tau);
    (4.0 * tau * tau * q * q, 4.0 * q)
}

/// An angle by the sine and cosine of its half: exact where it is small, and cheap.
#[derive(Clone, Copy)]
struct HalfAngle {
    sin_half: f64,
    cos_half: f64,
}

impl HalfAngle {
    #[inline]
    fn of(angle: f64) -> Self {
        let (sin_half, cos_half) = (0.5 * angle).sin_cos();
        Self { sin_half, cos_half }
    }

    #[inline]
    fn sin(self) -> f64 {
        2.0 * self.sin_half * self.cos_half
    }

    #[inline]
    fn cos(self) -> f64 {
        (self.cos_half - self.sin_half) * (self.cos_half + self.sin_half)
    }
}

/// Accuracies, coarse to fine: each is computed when first used.
static LADDER: LazyLock<Vec<Rung>> = LazyLock::new(|| [9.0, 14.0, 19.0, 25.0, 32.0, 40.0, 50.0].map(Rung::new).into());

impl Rung {
    fn new(digits: f64) -> Self {
        Self {
            rules: GradedRules::new(digits),
            doubled: GradedRules::new(2.0 * digits),
            circle: GradedRules::mapped(digits, quarter_tangent),
            doubled_circle: GradedRules::mapped(2.0 * digits, |x| ((FRAC_PI_2 * x).sin().powi(2), 1.0)),
            quarter: GradedRules::mapped(digits, |x| ((FRAC_PI_2 * x).sin(), 1.0)),
            doubled_quarter: GradedRules::mapped(2.0 * digits, |x| ((FRAC_PI_2 * x).sin(), 1.0)),
            eighth: GradedRules::mapped(digits, |x| ((FRAC_PI_4 * x).sin(), 1.0)),
        }
    }

    /// The error of an integrand of height 1 that the rung is made for.
    fn promise(&self) -> f64 {
        (-self.rules.digits()).exp()
    }
}

/// What is known of an integral's convergence before it is computed.
struct Trust {
    /// What the indicators of error are multiplied with to be a bound; tests scan the whole domain for values that break it.
    safety: f64,
    /// By how many powers of e a rung is better than the e^(−digits) that it is named after.
    lead: f64,
}

impl Trust {
    /// The rules promise e^(−digits) for an integrand of height 1; measured on GGX, a rung is that much better.
    const USUAL: Self = Self { safety: 4.0, lead: 4.0 };

    /// The rung from which to start for a tolerance; the next one confirms it.
    fn first_rung(&self, tolerance: f64) -> usize {
        let digits = -tolerance.ln() - self.lead;
        LADDER.iter().position(|r| r.rules.digits() >= digits).unwrap_or(LADDER.len()).min(LADDER.len() - 2)
    }
}

/// Climbs the ladder until two neighbouring rungs agree to `tolerance`: the finer value, with their difference as its bound.
///
/// Convergence is geometric, so the finer value is far better than the difference; rounding adds its own floor. A tolerance that the
/// coarsest rung promises by itself takes that rung alone.
fn climb<const K: usize>(tolerance: f64, integral: impl Fn(&Rung) -> Sum<K>) -> [Estimate; K] {
    climb_with(Trust::USUAL, tolerance, integral)
}

/// The same with its own trust.
fn climb_with<const K: usize>(trust: Trust, tolerance: f64, integral: impl Fn(&Rung) -> Sum<K>) -> [Estimate; K] {
    let Trust { safety, .. } = trust;
    let first = trust.first_rung(tolerance);
    let lowest = integral(&LADDER[first]);
    // What the coarsest rung promises needs no second one to confirm it, where that is all that is asked for.
    let promised = lowest.estimates(safety, safety * (lowest.defect + lowest.height() * LADDER[first].promise()));
    if first == 0 && promised.iter().all(|e| e.error <= tolerance) {
        return promised;
    }
    let mut coarse = lowest.values;
    let mut best = coarse.map(|v| Estimate::bound(v, f64::INFINITY));
    for rung in &LADDER[first + 1..] {
        let fine = integral(rung);
        // One component may agree by chance: the largest difference speaks for all.
        let difference = (0..K).map(|k| (fine.values[k] - coarse[k]).abs()).fold(0.0, f64::max);
        let error = safety * (difference + fine.defect + BY_CHANCE * fine.height() * rung.promise());
        // Past the point where rounding rules, a finer rung may look worse: keep the better of the two.
        for (b, c) in best.iter_mut().zip(fine.estimates(safety, error)) {
            if c.error < b.error {
                *b = c;
            }
        }
        if best.iter().all(|e| e.error <= tolerance) {
            break;
        }
        coarse = fine.values;
    }
    best
}

/// [`climb`] for an integral that needs the plain rules only and knows no defect of its own.
pub(super) fn climb_rules<const K: usize>(
    tolerance: f64,
    integral: impl Fn(&GradedRules) -> [f64; K],
) -> [Estimate; K] {
    climb(tolerance, |rung| Sum { values: integral(&rung.rules), defect: 0.0 })
}

/// A part of a panel, to be integrated by a rule that is graded towards one of the panel's ends.
struct Half {
    from_low: bool,
    length: f64,
    scale: f64,
}

/// The rules for a panel of this length whose integrand must be resolved down to the scales `at_low` and `at_high` at its ends: two
/// that meet in the middle, or one where the other end is as smooth as the panel is long.
#[inline]
fn halves(length: f64, at_low: f64, at_high: f64) -> impl Iterator<Item = Half> {
    let (low, high) = (at_low < length, at_high < length || at_low >= length);
    let length = if low && high { 0.5 * length } else { length };
    [(low, true, at_low), (high, false, at_high)]
        .into_iter()
        .filter_map(move |(wanted, from_low, scale)| wanted.then_some(Half { from_low, length, scale }))
}

/// The part of a rung's promise below which agreement is taken for chance.
const BY_CHANCE: f64 = 0.025;

/// Values of an integral by one rule, and what is known to be wrong with them.
struct Sum<const K: usize> {
    values: [f64; K],
    /// Σ |azimuth rule − closed form| with F = 1: the error of the inner rule where it can be seen exactly.
    defect: f64,
}

impl<const K: usize> Sum<K> {
    /// How large the integrand is taken to be: 1, or the largest of the values.
    fn height(&self) -> f64 {
        self.values.iter().fold(1.0_f64, |most, v| most.max(v.abs()))
    }

    /// The values, with that bound and what rounding adds.
    fn estimates(&self, safety: f64, error: f64) -> [Estimate; K] {
        self.values.map(|v| Estimate::bound(v, error + safety * ROUNDING * v.abs()))
    }
}

/// Relative rounding error of a sum of a few thousand positive terms, each good to a few ulp, before the factor of safety.
const ROUNDING: f64 = 5e-15;
