//! GGX reflection, integrated over the elevation and azimuth of the incident direction.
//!
//! In these coordinates the horizon is an end of the interval and nothing has a kink. With e the elevations of both directions
//! above the horizon, C = sin((e_o + e_i)/2), δ = (e_i − e_o)/2, ψ the azimuth from the mirror direction, y = sin²(ψ/2) and
//! b = cos e_o cos e_i, the half-vector h has
//!
//! ```text
//! (wo·h)² = C² + b y,      D(h) = α²/π · r²,      r = (4C² + 4by) / (m + 4by),      m = 4C² (sin²δ + α² cos²δ),
//! ```
//!
//! all without cancellation. G2 depends on e_i alone. What makes the integrand hard is known exactly:
//!
//! - in ψ, the pole of r at sin²(ψ/2) = −m/4b: the substitution τ = tan(ψ/4) keeps it on the imaginary axis, at
//!   w = 1/(ρ + √(ρ² + 1)) with ρ² = 4b/m, and a rule graded to w undoes it;
//! - in e_i, the peak around e_o, with poles at e_o ± 2i asinh(α/√(1 − α²)), and the horizon, where G2 has branch points at
//!   ± i asinh(α/√(1 − α²)) and a pole at −e_o, or where an approximation of G2 has its own: three panels, graded to e_o from
//!   both sides and to the horizon.
//!
//! With F = 1 the azimuth integral is closed form. Derived here; checked against the closed forms at alpha = 1 and against Monte Carlo.

use super::{Rung, Sum, climb};
use crate::integrate::Estimate;
use crate::math::frame::{elevation, sine_of_cosine};
use crate::math::quadrature::{GradedRules, Rule};
use crate::model::ggx::Smith;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// ∫ f cosθ_i F(wo·h) dω_i for GGX of width `alpha` seen at cosine `mu`, for `K` Fresnel factors at once.
///
/// **Shape**: one estimate of kind bound per component of `fresnel`, which takes wo·h. `mu` in [0, 1], `alpha` in (0, 1].
pub fn ggx_reflection<const K: usize>(
    mu: f64,
    alpha: f64,
    smith: Smith,
    tolerance: f64,
    fresnel: impl Fn(f64) -> [f64; K],
) -> [Estimate; K] {
    climb(tolerance, |Rung { rules, .. }| over_elevation(mu, alpha, smith, rules, |at| azimuth(&at, rules, &fresnel)))
}

/// The same with F = 1: the directional albedo, whose azimuth integral is closed form.
pub fn ggx_albedo(mu: f64, alpha: f64, smith: Smith, tolerance: f64) -> Estimate {
    climb(tolerance, |Rung { rules, .. }| albedo_on(mu, alpha, smith, rules))[0]
}

/// 2 ∫ E(mu) mu dmu: the average albedo.
pub fn ggx_albedo_average(alpha: f64, smith: Smith, tolerance: f64) -> Estimate {
    climb(tolerance, |Rung { rules, .. }| {
        // E has its dip near mu = alpha and is not analytic at the horizon; mu itself is the smooth variable at normal incidence.
        let rule = rules.at_scale(AVERAGE_SCALE * alpha);
        let average = 2.0 * rule.integrate(|mu| mu * albedo_on(mu, alpha, smith, rules).values[0]);
        Sum { values: [average], defect: 0.0 }
    })[0]
}

/// How far below alpha the average must resolve E: the non-analytic part of mu·E at mu = 0 is of third order.
const AVERAGE_SCALE: f64 = 1e-4;

fn albedo_on(mu: f64, alpha: f64, smith: Smith, rules: &GradedRules) -> Sum<1> {
    over_elevation(mu, alpha, smith, rules, |at| Sum { values: [azimuth_closed_form(&at)], defect: 0.0 })
}

/// What the azimuth integral depends on, at one elevation of the incident direction.
struct Ring {
    /// C².
    c2: f64,
    /// b = cos e_o cos e_i.
    b: f64,
    /// m, the smallest denominator of r.
    m: f64,
}

/// Integrates V μ_i D over the elevations, the azimuth part of D given by `ring`.
fn over_elevation<const K: usize>(
    mu: f64,
    alpha: f64,
    smith: Smith,
    rules: &GradedRules,
    ring: impl Fn(Ring) -> Sum<K>,
) -> Sum<K> {
    let e_o = elevation(mu);
    let (sin_o, cos_o) = (mu, sine_of_cosine(mu));
    let ell = |mu: f64| (alpha * alpha * (1.0 - mu) * (1.0 + mu) + mu * mu).sqrt();
    let l_o = ell(mu);
    // asinh(α/√(1−α²)) = atanh(α), infinite at α = 1, where no pole is left.
    let width = alpha.atanh().min(FAR);
    let pole = smith.pole_below_horizon(alpha, mu);
    let mut sum = Sum { values: [0.0; K], defect: 0.0 };
    // d = e_i − e_o is passed beside e_i: one of the two is the node itself and therefore exact.
    let mut add = |e_i: f64, d: f64, weight: f64| {
        let (mu_i, cos_i) = e_i.sin_cos();
        let (sin_d, cos_d) = (0.5 * d).sin_cos();
        let c = sin_o * cos_d + cos_o * sin_d; // sin(e_o + d/2)
        let c2 = c * c;
        let m = 4.0 * c2 * (sin_d * sin_d + alpha * alpha * cos_d * cos_d);
        let ring = ring(Ring { c2, b: cos_o * cos_i, m });
        let v = smith.visibility(alpha, (mu, l_o), (mu_i, ell(mu_i)));
        let weight = weight * v * mu_i * cos_i * alpha * alpha / PI;
        for k in 0..K {
            sum.values[k] += weight * ring.values[k];
        }
        sum.defect += weight * ring.defect;
    };
    let mut panel = |rule: &Rule, length: f64, place: &dyn Fn(f64) -> (f64, f64)| {
        for (x, w) in rule.iter() {
            let (e_i, d) = place(x * length);
            add(e_i, d, w * length);
        }
    };
    // From the peak up to the zenith.
    let above = FRAC_PI_2 - e_o;
    if above > 0.0 {
        // Beside the peak's own poles stands that of G2 at −e_o, which becomes a branch point of the whole when e_o is 0.
        let nearest = (2.0 * width).min((2.0 * e_o).max(BRANCH * width.min(1.0))).min(e_o + pole);
        panel(rules.at_scale(nearest / above), above, &|t| (e_o + t, t));
    }
    // From the peak halfway down to the horizon, and from the horizon halfway up to the peak.
    let half = 0.5 * e_o;
    if half > 0.0 {
        panel(rules.at_scale(2.0 * width / half), half, &|t| (e_o - t, -t));
        panel(rules.at_scale(width.min(e_o).min(pole) / half), half, &|t| (t, t - e_o));
    }
    sum
}

/// How far below the width a branch point of second order at the horizon itself must be resolved, for its third power to vanish.
const BRANCH: f64 = 1e-7;

/// Wider than any interval of angles.
const FAR: f64 = 10.0;

/// ∫ r² F dφ over the full circle, by a rule in τ = tan(ψ/4) that is graded to the pole of r.
fn azimuth<const K: usize>(at: &Ring, rules: &GradedRules, fresnel: impl Fn(f64) -> [f64; K]) -> Sum<K> {
    let rho = (4.0 * at.b / at.m).sqrt();
    let rule = rules.at_scale(1.0 / (rho + (rho * rho + 1.0).sqrt()));
    let (mut values, mut plain) = ([0.0; K], 0.0);
    for (tau, w) in rule.iter() {
        let t2 = tau * tau;
        let q = 1.0 / (1.0 + t2);
        let by = at.b * 4.0 * t2 * q * q;
        let cosine2 = at.c2 + by;
        let r = 4.0 * cosine2 / (at.m + 4.0 * by);
        let weight = w * q * r * r;
        let f = fresnel(cosine2.sqrt());
        for k in 0..K {
            values[k] += weight * f[k];
        }
        plain += weight;
    }
    // dψ = 4 dτ/(1 + τ²), and both halves of the circle
    Sum { values: values.map(|v| 8.0 * v), defect: (8.0 * plain - azimuth_closed_form(at)).abs() }
}

/// ∫ r² dφ over the full circle: r = 1 + q/(m + 4by) with q = 4C² − m, and the integrals of 1/(m + 4by) and of its square are
/// elementary.
fn azimuth_closed_form(at: &Ring) -> f64 {
    let q = 4.0 * at.c2 - at.m;
    let product = at.m * (at.m + 4.0 * at.b);
    let first = 1.0 / product.sqrt();
    TAU * (1.0 + q * first * (2.0 + q * (at.m + 2.0 * at.b) * first * first))
}
