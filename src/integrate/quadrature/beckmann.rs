//! Beckmann reflection, integrated over the elevation and azimuth of the incident direction.
//!
//! In the coordinates of GGX (see `ggx.rs`: C, δ, b, y) the half-vector has h_z = C cosδ/(wo·h), hence
//!
//! ```text
//! tan²θ_h = tan²δ + b y/(C² cos²δ),      1/cos⁴θ_h = (C² + b y)²/(C cosδ)⁴:
//! ```
//!
//! a Gaussian in tanδ times one in √y. Both are cut off where nothing is left of them; what remains is as wide as a few standard
//! deviations, and the rules are graded to one. The branch point of the Fresnel factor, at y = −C²/b, is never nearer than the
//! Gaussian's width. Derived here; checked against Monte Carlo.

use super::limit::Limit;
use super::{Rung, Sum, climb, quarter_tangent};
use crate::integrate::Estimate;
use crate::math::frame::{elevation, sine_of_cosine};
use crate::math::quadrature::Rule;
use crate::model::beckmann::Beckmann;
use std::f64::consts::{FRAC_PI_2, PI};

/// ∫ f cosθ_i F(wo·h) dω_i for Beckmann's lobe seen at cosine `mu`, for `K` Fresnel factors at once.
///
/// **Shape**: one estimate of kind bound per component of `fresnel`, which takes wo·h. `mu` in [0, 1], the width in (0, 1].
pub fn beckmann_reflection<const K: usize>(
    mu: f64,
    lobe: &Beckmann,
    tolerance: f64,
    fresnel: impl Fn(f64) -> [f64; K],
) -> [Estimate; K] {
    let of = |alpha| Beckmann { alpha, ..*lobe };
    let straight = |mu, alpha| of(alpha).visibility(mu, mu);
    Limit::of(mu, lobe.alpha).reflection(straight, &fresnel, |mu, alpha| {
        climb(tolerance, |rung| Sum { values: over_elevation(mu, &of(alpha), rung, &fresnel), defect: 0.0 })
    })
}

/// 2 ∫ E(mu) mu dmu with F = 1: the average albedo.
pub fn beckmann_albedo_average(lobe: &Beckmann, tolerance: f64) -> Estimate {
    climb(tolerance, |rung| {
        let rule = rung.doubled.at_scale(AVERAGE_SCALE * lobe.alpha);
        let average = 2.0 * rule.integrate(|mu| mu * over_elevation(mu, lobe, rung, &|_| [1.0])[0]);
        Sum { values: [average], defect: 0.0 }
    })[0]
}

/// How far below alpha the average must resolve E.
const AVERAGE_SCALE: f64 = 1e-2;

/// What is left of a Gaussian where it is cut off, in powers of e below the accuracy of the rung: enough for the factors that
/// grow meanwhile.
const CUT: f64 = 10.0;

/// How far below the width the pole of G2 must be resolved when it comes to lie at the horizon itself.
const BRANCH: f64 = 1e-5;

/// How near τ = ±i, where y is infinite, the rule may come.
const POLE: f64 = 0.5;

fn over_elevation<const K: usize>(
    mu: f64,
    lobe: &Beckmann,
    rung: &Rung,
    fresnel: &impl Fn(f64) -> [f64; K],
) -> [f64; K] {
    let alpha = lobe.alpha;
    let (e_o, rules) = (elevation(mu), &rung.doubled);
    let (sin_o, cos_o, l_o) = (mu, sine_of_cosine(mu), lobe.l(mu));
    let cut = rung.rules.digits() + CUT;
    let mut sum = [0.0; K];
    // d = e_i − e_o is passed beside e_i: one of the two is the node itself and therefore exact.
    let mut add = |e_i: f64, d: f64, weight: f64| {
        let (mu_i, cos_i) = e_i.sin_cos();
        let (sin_d, cos_d) = (0.5 * d).sin_cos();
        let c = sin_o * cos_d + cos_o * sin_d; // sin(e_o + d/2)
        let ridge = (c * cos_d).powi(2);
        let v = lobe.smith.visibility(alpha, (mu, l_o), (mu_i, lobe.l(mu_i)));
        let gauss = (-(sin_d / (alpha * cos_d)).powi(2)).exp();
        let weight = weight * v * mu_i * cos_i * gauss / (PI * alpha * alpha * ridge * ridge);
        // Over the azimuth, both halves of the circle.
        let b = cos_o * cos_i;
        let kappa = b / (alpha * alpha * ridge);
        // In τ = tan(ψ/4), which makes y rational.
        let end = (0.5 * (cut / kappa).min(1.0).sqrt().asin()).tan();
        let rule = rules.at_scale((0.5 / kappa.sqrt()).min(POLE) / end);
        for (x, w) in rule.iter() {
            let (y, step) = quarter_tangent(end * x);
            let cosine2 = c * c + b * y;
            let f = fresnel(cosine2.sqrt().min(1.0)); // at most 1 but for rounding
            let weight = 2.0 * end * w * step * weight * (-kappa * y).exp() * cosine2 * cosine2;
            for k in 0..K {
                sum[k] += weight * f[k];
            }
        }
    };
    let mut panel = |rule: &Rule, length: f64, place: &dyn Fn(f64) -> (f64, f64)| {
        for (x, w) in rule.iter() {
            let (e_i, d) = place(x * length);
            add(e_i, d, w * length);
        }
    };
    let width = 2.0 * alpha.atan();
    let reach = 2.0 * (alpha * cut.sqrt()).atan();
    // From the peak up to the zenith.
    let above = (FRAC_PI_2 - e_o).min(reach);
    if above > 0.0 {
        panel(rules.at_scale(width.min((2.0 * e_o).max(BRANCH * width)) / above), above, &|t| (e_o + t, t));
    }
    // From the peak halfway down to the horizon, and from the horizon halfway up to the peak if the peak reaches there.
    let half = 0.5 * e_o;
    if half > 0.0 {
        let below = half.min(reach);
        panel(rules.at_scale(width / below), below, &|t| (e_o - t, -t));
        if reach > half {
            panel(rules.at_scale((0.5 * width).min(e_o) / half), half, &|t| (t, t - e_o));
        }
    }
    sum
}
