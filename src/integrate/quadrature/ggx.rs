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
//! With F = 1 the azimuth integral is closed form. Where f64 does not hold what the rules need, `limit.rs` stands in. Derived here;
//! checked against the closed forms at alpha = 1 and against Monte Carlo.

use super::limit::{Limit, NARROWEST};
use super::{HalfAngle, Rung, Sum, climb, near_pole};
use crate::integrate::Estimate;
use crate::math::frame::{elevation, sine_of_cosine};
use crate::math::quadrature::{GradedRules, Rule};
use crate::model::fresnel::{f82_dip, schlick_weight};
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
    Limit::of(mu, alpha).reflection(straight(smith), &fresnel, |mu, alpha| {
        climb(tolerance, |rung| reflection_on(mu, alpha, smith, rung, &fresnel))
    })
}

/// The visibility of what is reflected straight on, by cosine and width.
pub(super) fn straight(smith: Smith) -> impl Fn(f64, f64) -> f64 {
    move |mu, alpha| {
        let l = squeezed(alpha, (mu, sine_of_cosine(mu)));
        smith.visibility(alpha, (mu, l), (mu, l))
    }
}

/// ℓ of a direction of these cosine and sine: see [`crate::model::ggx::Ggx::l`].
#[inline]
fn squeezed(alpha: f64, (cosine, sine): (f64, f64)) -> f64 {
    (alpha * alpha * sine * sine + cosine * cosine).sqrt()
}

/// [`ggx_reflection`] by one rung of the ladder.
pub(super) fn reflection_on<const K: usize>(
    mu: f64,
    alpha: f64,
    smith: Smith,
    rung: &Rung,
    fresnel: impl Fn(f64) -> [f64; K],
) -> Sum<K> {
    over_elevation(mu, alpha, smith, &rung.rules, |at| azimuth(&at, rung, &fresnel))
}

/// The integrals of the split sum, which share their elevations: with F = 1, with Schlick's weight (1 − wo·h)⁵, and with the shape
/// of the dip that the F82 tint takes.
pub fn ggx_split(mu: f64, alpha: f64, smith: Smith, tolerance: f64) -> [Estimate; 3] {
    let weights = |cosine| [schlick_weight(cosine), f82_dip(cosine)];
    let with_one = |cosine| {
        let [schlick, dip] = weights(cosine);
        [1.0, schlick, dip]
    };
    Limit::of(mu, alpha).reflection(straight(smith), with_one, |mu, alpha| {
        climb(tolerance, |rung| {
            over_elevation(mu, alpha, smith, &rung.rules, |at| {
                let Sum { values: [schlick, dip], defect } = azimuth(&at, rung, weights);
                Sum { values: [azimuth_closed_form(&at), schlick, dip], defect }
            })
        })
    })
}

/// The same with F = 1: the directional albedo, whose azimuth integral is closed form.
pub fn ggx_albedo(mu: f64, alpha: f64, smith: Smith, tolerance: f64) -> Estimate {
    let [albedo] = Limit::of(mu, alpha).reflection(
        straight(smith),
        |_| [1.0],
        |mu, alpha| climb(tolerance, |Rung { rules, .. }| albedo_on(mu, alpha, smith, rules)),
    );
    albedo
}

/// 2 ∫ E(mu) mu dmu: the average albedo.
pub fn ggx_albedo_average(alpha: f64, smith: Smith, tolerance: f64) -> Estimate {
    // E differs from the mirror's by alpha/mu at most, in the average by alpha itself; Schlick's k for lamps by the root of alpha.
    let error = if alpha < NARROWEST { NARROWEST.sqrt() } else { 0.0 };
    let alpha = alpha.max(NARROWEST);
    let [average] = climb(tolerance, |Rung { rules, .. }| {
        // E has its dip near mu = alpha and is not analytic at the horizon; mu itself is the smooth variable at normal incidence.
        let rule = rules.at_scale(AVERAGE_SCALE * alpha);
        let average = 2.0 * rule.integrate(|mu| mu * albedo_on(mu, alpha, smith, rules).values[0]);
        Sum { values: [average], defect: 0.0 }
    });
    Estimate::bound(average.value, average.error + error)
}

/// How far below alpha the average must resolve E: the non-analytic part of mu·E at mu = 0 is of third order.
const AVERAGE_SCALE: f64 = 1e-4;

pub(super) fn albedo_on(mu: f64, alpha: f64, smith: Smith, rules: &GradedRules) -> Sum<1> {
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
    let l_o = squeezed(alpha, (mu, cos_o));
    // asinh(α/√(1−α²)) = atanh(α), infinite at α = 1, where no pole is left.
    let width = alpha.atanh().min(FAR);
    let pole = smith.pole_below_horizon(alpha, mu);
    let mut sum = Sum { values: [0.0; K], defect: 0.0 };
    // One sine and one cosine per node, of half the distance t from the end of its panel: everything else follows by addition
    // theorems, in which nothing cancels by more than half.
    let mut panel = |rule: &Rule, length: f64, place: &dyn Fn(HalfAngle) -> Place| {
        for (x, w) in rule.iter() {
            let Place { mu_i, cos_i, c, sin_d, cos_d } = place(HalfAngle::of(x * length));
            let c2 = c * c;
            let m = 4.0 * c2 * (sin_d * sin_d + alpha * alpha * cos_d * cos_d);
            let ring = ring(Ring { c2, b: cos_o * cos_i, m });
            let l_i = squeezed(alpha, (mu_i, cos_i));
            let weight = w * length * smith.visibility(alpha, (mu, l_o), (mu_i, l_i)) * mu_i * cos_i;
            for k in 0..K {
                sum.values[k] += weight * ring.values[k];
            }
            sum.defect += weight * ring.defect;
        }
    };
    // From the peak up to the zenith.
    let above = FRAC_PI_2 - e_o;
    if above > 0.0 {
        // Beside the peak's own poles stands that of G2 at −e_o, which becomes a branch point of the whole when e_o is 0.
        let nearest = (2.0 * width).min((2.0 * e_o).min(e_o + pole).max(BRANCH * width.min(1.0)));
        panel(rules.at_scale(nearest / above), above, &|t| Place {
            mu_i: sin_o * t.cos() + cos_o * t.sin(),
            cos_i: (cos_o * t.cos() - sin_o * t.sin()).max(0.0), // below 0 by rounding only, at the zenith
            c: sin_o * t.cos_half + cos_o * t.sin_half,
            sin_d: t.sin_half,
            cos_d: t.cos_half,
        });
    }
    // From the peak halfway down to the horizon, and from the horizon halfway up to the peak.
    let half = 0.5 * e_o;
    if half > 0.0 {
        panel(rules.at_scale(2.0 * width / half), half, &|t| Place {
            mu_i: sin_o * t.cos() - cos_o * t.sin(),
            cos_i: cos_o * t.cos() + sin_o * t.sin(),
            c: sin_o * t.cos_half - cos_o * t.sin_half,
            sin_d: -t.sin_half,
            cos_d: t.cos_half,
        });
        let (sin_half, cos_half) = half.sin_cos();
        panel(rules.at_scale(width.min(e_o).min(pole) / half), half, &|t| Place {
            mu_i: t.sin(),
            cos_i: t.cos(),
            c: sin_half * t.cos_half + cos_half * t.sin_half,
            sin_d: cos_half * t.sin_half - sin_half * t.cos_half,
            cos_d: cos_half * t.cos_half + sin_half * t.sin_half,
        });
    }
    let factor = alpha * alpha / PI;
    Sum { values: sum.values.map(|v| factor * v), defect: factor * sum.defect }
}

/// Where one elevation of the incident direction is: its sine and cosine, C, and the sine and cosine of δ.
struct Place {
    mu_i: f64,
    cos_i: f64,
    c: f64,
    sin_d: f64,
    cos_d: f64,
}

/// How far below the width a branch point of second order at the horizon itself must be resolved, for its third power to vanish.
const BRANCH: f64 = 1e-7;

/// Wider than any interval of angles.
const FAR: f64 = 10.0;

/// ∫ r² F dφ over the full circle, by a rule in τ = tan(ψ/4) that is graded to the pole of r.
fn azimuth<const K: usize>(at: &Ring, rung: &Rung, fresnel: impl Fn(f64) -> [f64; K]) -> Sum<K> {
    let (plain, values) = rung.circle.at_scale(near_pole(4.0 * at.b / at.m)).moments(|y| {
        let by = at.b * y;
        let cosine2 = at.c2 + by;
        let r = 4.0 * cosine2 / (at.m + 4.0 * by);
        (r * r, fresnel(cosine2.sqrt()))
    });
    // Both halves of the circle.
    Sum { values: values.map(|v| 2.0 * v), defect: (2.0 * plain - azimuth_closed_form(at)).abs() }
}

/// ∫ r² dφ over the full circle: r = 1 + q/(m + 4by) with q = 4C² − m, and the integrals of 1/(m + 4by) and of its square are
/// elementary.
fn azimuth_closed_form(at: &Ring) -> f64 {
    let q = 4.0 * at.c2 - at.m;
    let product = at.m * (at.m + 4.0 * at.b);
    let first = 1.0 / product.sqrt();
    TAU * (1.0 + q * first * (2.0 + q * (at.m + 2.0 * at.b) * first * first))
}
