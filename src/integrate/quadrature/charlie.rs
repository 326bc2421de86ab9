//! Sheen, integrated over the elevation and azimuth of the incident direction.
//!
//! In the coordinates of GGX (see `ggx.rs`: C, δ, b, y) the half-vector has
//!
//! ```text
//! sin²θ_h = (C² sin²δ + b y)/(C² + b y).
//! ```
//!
//! D is a power of it, n/2 = 1/2α: where the half-vector meets the normal (δ = 0, y = 0) that is a branch point, however mild.
//! In ψ it lies at ±2i asinh(C |sinδ|/√b), and the rule is graded to it; in the middle half of the strip the base stays below 1,
//! so that no n is too large. In the elevation the branch point, the horizon and the seams of the fitted Λ (which is mirrored
//! about μ = 1/2, and has powers near 1/5 of μ and of 1 − μ) are ends of panels graded to both ends.

use super::{Rung, Sum, climb};
use crate::integrate::Estimate;
use crate::math::frame::{elevation, sine_of_cosine};
use crate::model::charlie::{Charlie, Visibility};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI, TAU};

/// ∫ f cosθ_i dω_i of the sheen seen at cosine `mu`: its directional albedo.
///
/// `mu` in (0, 1], or 0 with [`Visibility::Neubelt`]; the width in (0, 1].
pub fn charlie_albedo(mu: f64, lobe: &Charlie, tolerance: f64) -> Estimate {
    climb(tolerance, |rung| Sum { values: [albedo_on(mu, lobe, rung)], defect: 0.0 })[0]
}

/// 2 ∫ E(mu) mu dmu: the average albedo.
pub fn charlie_albedo_average(lobe: &Charlie, tolerance: f64) -> Estimate {
    climb(tolerance, |rung| {
        let rule = rung.doubled.at_scale(2.0 * AVERAGE_SCALE);
        let flux = |mu: f64| mu * albedo_on(mu, lobe, rung);
        // mu = x/2 below the seam of the fitted Λ, mu = 1 − x/2 above it.
        let average = rule.integrate(|x| flux(0.5 * x) + flux(1.0 - 0.5 * x));
        Sum { values: [average], defect: 0.0 }
    })[0]
}

/// How near the ends the average must resolve mu·E.
const AVERAGE_SCALE: f64 = 1e-7;
/// How near its branch points an elevation must be resolved: they are of second order at least, so that the third power counts.
const BRANCH: f64 = 1e-5;
/// The same at the horizon, where the visibility varies over elevations like that of `wo` or like a small power.
const HORIZON: f64 = 1e-9;

fn albedo_on(mu: f64, lobe: &Charlie, rung: &Rung) -> f64 {
    let (e_o, rules) = (elevation(mu), &rung.doubled);
    let (sin_o, cos_o) = (mu, sine_of_cosine(mu));
    let n = 1.0 / lobe.alpha;
    let mut sum = 0.0;
    // d = e_i − e_o is passed beside e_i: one of the two is the node itself and therefore exact.
    let mut add = |e_i: f64, d: f64, weight: f64| {
        let (mu_i, cos_i) = e_i.sin_cos();
        let (sin_d, cos_d) = (0.5 * d).sin_cos();
        let c = sin_o * cos_d + cos_o * sin_d; // sin(e_o + d/2)
        let (c2, b) = (c * c, cos_o * cos_i);
        let least = c2 * sin_d * sin_d;
        let rule = rules.at_scale(2.0 * (least / b).sqrt().asinh() / PI);
        let ring: f64 = rule
            .iter()
            .map(|(x, w)| {
                let by = b * (FRAC_PI_2 * x).sin().powi(2);
                w * ((least + by) / (c2 + by)).powf(0.5 * n)
            })
            .sum();
        sum += weight * lobe.visibility.times_cosine(lobe.alpha, mu, mu_i) * cos_i * TAU * ring;
    };
    let fitted = lobe.visibility != Visibility::Neubelt;
    // Where the integrand has seams, and how near each must be resolved.
    let mut seams =
        vec![(0.0, if fitted { HORIZON } else { e_o.clamp(HORIZON, BRANCH) }), (e_o, e_o.clamp(HORIZON, BRANCH))];
    if fitted {
        seams.push((FRAC_PI_6, 1.0));
    }
    seams.push((FRAC_PI_2, if fitted { BRANCH } else { 1.0 }));
    seams.sort_by(|a, b| a.0.total_cmp(&b.0));
    for pair in seams.windows(2) {
        let [(low, at_low), (high, at_high)] = [pair[0], pair[1]];
        let half = 0.5 * (high - low);
        if half <= 0.0 {
            continue;
        }
        for (from, scale, sign) in [(low, at_low, 1.0), (high, at_high, -1.0)] {
            for (x, w) in rules.at_scale(scale / half).iter() {
                let t = sign * x * half;
                let (e_i, d) = if from == e_o { (e_o + t, t) } else { (from + t, from + t - e_o) };
                add(e_i, d, w * half);
            }
        }
    }
    (2.0 + n) / TAU * sum
}
