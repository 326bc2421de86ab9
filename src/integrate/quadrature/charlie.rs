//! Sheen, integrated over the elevation and azimuth of the incident direction.
//!
//! In the coordinates of GGX (see `ggx.rs`: C, δ, b, y) the half-vector has
//!
//! ```text
//! sin²θ_h = (C² sin²δ + b y)/(C² + b y).
//! ```
//!
//! D is a power of it, n/2 = 1/2α. Opposite to wo, at ψ = π, it is largest, where sinθ_h = cos((e_o + e_i)/2): what is left of it
//! decides how far both integrals reach. Where the half-vector meets the normal (δ = 0, y = 0) the power has a branch point, however
//! mild: of order n in ψ and n + 1 in the elevation, so that the rules need to resolve it the less the larger n is. In ψ it lies
//! at ±2i asinh(C |sinδ|/√b), and the rule is graded to it; in the middle half of the strip the base stays below 1, so that no n is
//! too large. In the elevation the branch point, the horizon and the seams of the fitted Λ (which is mirrored about μ = 1/2, and
//! has powers near 1/5 of μ and of 1 − μ) are ends of panels. Derived here; checked against Monte Carlo.

use super::{Half, Rung, Sum, Trust, climb_with, halves};
use crate::integrate::Estimate;
use crate::math::frame::{elevation, sine_of_cosine};
use crate::model::charlie::{Charlie, Visibility};
use crate::model::fresnel::schlick_weight;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI, TAU};

/// ∫ f cosθ_i dω_i of the sheen seen at cosine `mu`, its directional albedo, and the same with Schlick's weight (1 − wo·h)⁵.
///
/// `mu` in (0, 1], or 0 with [`Visibility::Neubelt`]; the width in (0, 1].
pub fn charlie_split(mu: f64, lobe: &Charlie, tolerance: f64) -> [Estimate; 2] {
    climb_with(TRUST, tolerance, |rung| Sum { values: split_on(mu, lobe, rung), defect: 0.0 })
}

/// 2 ∫ E(mu) mu dmu: the average albedo.
pub fn charlie_albedo_average(lobe: &Charlie, tolerance: f64) -> Estimate {
    climb_with(TRUST, tolerance, |rung| {
        let flux = |mu: f64| mu * split_on(mu, lobe, rung)[0];
        let average = if lobe.visibility == Visibility::Neubelt {
            // E is smooth up to normal incidence, and has a logarithm of mu/√alpha, on whose scale it fades, at the horizon.
            2.0 * rung.doubled.at_scale(lobe.alpha.sqrt() * accuracy(rung, HORIZON)).integrate(flux)
        } else {
            // mu = x/2 below the seam of the fitted Λ, mu = 1 − x/2 above it.
            let rule = rung.doubled.at_scale(2.0 * AVERAGE_SCALE);
            rule.integrate(|x| flux(0.5 * x) + flux(1.0 - 0.5 * x))
        };
        Sum { values: [average], defect: 0.0 }
    })[0]
}

/// A power of what the rung is accurate to: how near a seam that hides behind it must be resolved.
fn accuracy(rung: &Rung, power: f64) -> f64 {
    (-rung.rules.digits() * power).exp()
}

/// Rules of twice the digits on both floors leave more than one rung to spare.
const TRUST: Trust = Trust { safety: 4.0, lead: 8.0 };

/// How near the ends the average must resolve mu·E, where powers of the cosine make up Λ.
const AVERAGE_SCALE: f64 = 1e-7;
/// How near a seam the elevation must be resolved, as the power of the rung's accuracy: at the horizon, where J has a branch point
/// of second order when wo grazes it, …
const HORIZON: f64 = 0.4;
/// … where the fitted visibility has a small power of the cosine, but is itself next to nothing, …
const FITTED_HORIZON: f64 = 0.25;
/// … and at the zenith, where it has a small power of 1 − μ in a Λ that is next to nothing.
const FITTED_ZENITH: f64 = 0.3;

/// Further than any elevation: as smooth as the panel is long.
const FAR: f64 = PI;

/// What is left of D where it is cut off, in powers of e below the accuracy of the rung.
const CUT: f64 = 5.0;

fn split_on(mu: f64, lobe: &Charlie, rung: &Rung) -> [f64; 2] {
    let e_o = elevation(mu);
    let (sin_o, cos_o) = (mu, sine_of_cosine(mu));
    let n = 1.0 / lobe.alpha;
    let digits = rung.rules.digits();
    let accuracy = |power: f64| accuracy(rung, power);
    // D is worth something where its exponent is above −cut.
    let cut = digits + CUT + (2.0 + n).ln();
    let highest = (-(-2.0 * cut / n).exp_m1()).sqrt(); // C
    let reach = (2.0 * highest.asin() - e_o).min(FRAC_PI_2);
    if reach <= 0.0 {
        return [0.0; 2];
    }
    let mut sum = [0.0; 2];
    // d = e_i − e_o is passed beside e_i: one of the two is the node itself and therefore exact.
    let mut add = |e_i: f64, d: f64, weight: f64| {
        let (mu_i, cos_i) = e_i.sin_cos();
        let (sin_d, cos_d) = (0.5 * d).sin_cos();
        let c = sin_o * cos_d + cos_o * sin_d; // sin(e_o + d/2)
        let ring = Ring { n, c2: c * c, b: cos_o * cos_i, sin2: sin_d * sin_d, cos2: cos_d * cos_d };
        let weight = weight * lobe.visibility.times_cosine(lobe.alpha, mu, mu_i) * cos_i;
        sum.iter_mut().zip(ring.integrals(rung, cut)).for_each(|(sum, integral)| *sum += weight * integral);
    };
    let fitted = lobe.visibility != Visibility::Neubelt;
    // Where the integrand has seams, and how near each must be resolved.
    let at_horizon =
        if fitted { (e_o.min(1e-2) * accuracy(FITTED_HORIZON)).max(1e-14) } else { e_o.max(accuracy(HORIZON)) };
    let at_normal = (2.0 * accuracy(1.0 / (n + 2.0))).min(e_o.max(accuracy(HORIZON)));
    let mut seams = vec![(0.0, at_horizon), (e_o, at_normal)];
    if fitted {
        seams.push((FRAC_PI_6, FRAC_PI_6));
    }
    seams.retain(|seam| seam.0 < reach);
    seams.push((reach, if fitted && reach == FRAC_PI_2 { accuracy(FITTED_ZENITH) } else { FAR }));
    seams.sort_by(|a, b| a.0.total_cmp(&b.0));
    for pair in seams.windows(2) {
        let [(low, at_low), (high, at_high)] = [pair[0], pair[1]];
        if high <= low {
            continue;
        }
        for Half { from_low, length, scale } in halves(high - low, at_low, at_high) {
            let (from, sign) = if from_low { (low, 1.0) } else { (high, -1.0) };
            for (x, w) in rung.doubled.at_scale(scale / length).iter() {
                let t = sign * x * length;
                let (e_i, d) = if from == e_o { (e_o + t, t) } else { (from + t, from + t - e_o) };
                add(e_i, d, w * length);
            }
        }
    }
    sum.map(|sum| (2.0 + n) / TAU * sum)
}

/// What the azimuth integral depends on, at one elevation of the incident direction.
struct Ring {
    n: f64,
    /// C².
    c2: f64,
    /// b = cos e_o cos e_i.
    b: f64,
    /// sin²δ and cos²δ.
    sin2: f64,
    cos2: f64,
}

/// How far in sin² from ψ = π D may reach to fade like a Gaussian.
const NARROW: f64 = 0.5;

impl Ring {
    /// ∫ sinⁿθ_h dψ over the full circle, and the same with Schlick's weight of wo·h, which is √(C² + by).
    fn integrals(&self, rung: &Rung, cut: f64) -> [f64; 2] {
        let &Self { n, c2, b, sin2, cos2 } = self;
        let fading = c2 * cos2;
        // sinⁿθ_h where the denominator C² + by is this
        let power = |denominator: f64| {
            let cosine2 = fading / denominator;
            let ln = if cosine2 < 0.5 { (-cosine2).ln_1p() } else { (1.0 - cosine2).max(0.0).ln() };
            ((0.5 * n * ln).exp(), [schlick_weight(denominator.sqrt().min(1.0))]) // at most 1 but for rounding
        };
        // What is left above the cut at ψ = π, and the sin²((π − ψ)/2) where it is used up.
        let ln_most = (-c2.min(1.0)).ln_1p();
        let left = 2.0 * cut / n + ln_most;
        if left <= 0.0 {
            return [0.0; 2];
        }
        let faded = -(ln_most - left).exp_m1();
        let end2 = cos2 * (1.0 - c2 / faded) / b;
        if end2 < NARROW {
            let end = 2.0 * end2.max(0.0).sqrt().asin();
            let rule = rung.doubled.at_scale(2.0 / (0.5 * n * left).sqrt());
            // C² + b is cos²δ: at ψ = π the half-vector lies in the plane of incidence.
            let (plain, [weighted]) = rule.moments(|x| power(cos2 - b * (0.5 * end * x).sin().powi(2)));
            return [plain, weighted].map(|v| 2.0 * end * v);
        }
        // In y: the branch point, the scale below which its order hides it, and where D fades.
        let order = c2 / b * (-2.0 * rung.rules.digits() / (n + 1.0)).exp();
        let nearest = (c2 * sin2 / b).max(order).max(1.0 - end2).min(1.0);
        let scale = 2.0 * nearest.sqrt().asinh() / PI;
        let (plain, [weighted]) = rung.doubled_circle.at_scale(scale).moments(|y| power(c2 + b * y));
        [plain, weighted].map(|v| TAU * v)
    }
}
