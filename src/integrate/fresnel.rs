//! Averages of Fresnel reflectance over the cosine-weighted hemisphere, 2 ∫ F μ dμ, and over the half-vectors of a diffuse lobe.

use super::Estimate;
use super::cosine::between_singularities;
use super::quadrature::climb_rules as climb;
use crate::math::frame::elevation;
use crate::math::quadrature::GradedRules;
use crate::model::fresnel;
use std::f64::consts::{FRAC_PI_2, PI};

/// The average reflectance of a dielectric of relative index `eta`.
///
/// From the denser side, light beyond the critical angle is all reflected, 1 − η² of it; for the rest μ dμ = η² μ_t dμ_t by
/// Snell's law, and the reflectance is that of the way back: F_avg(η) = 1 − η² + η² F_avg(1/η).
pub fn dielectric_average(eta: f64, tolerance: f64) -> Estimate {
    if eta == 0.0 || eta == f64::INFINITY {
        return Estimate::bound(1.0, 0.0);
    }
    if eta < 1.0 {
        let outside = dielectric_average(1.0 / eta, tolerance);
        let eta2 = eta * eta;
        let value = (1.0 - eta) * (1.0 + eta) + eta2 * outside.value;
        return Estimate::bound(value, eta2 * outside.error + 4.0 * f64::EPSILON);
    }
    // The branch point of g, ±i√(η² − 1), and the pole of r∥ at −1/√(η² + 1).
    let singularities = [(0.0, ((eta - 1.0) * (eta + 1.0)).sqrt()), (0.0, 1.0 / (eta * eta + 1.0).sqrt())];
    climb(tolerance, |rules| {
        [2.0 * between_singularities(rules, &singularities, |mu| mu * fresnel::dielectric(mu, eta))]
    })[0]
}

/// The average reflectance of a conductor of complex index n + ik.
pub fn conductor_average(n: f64, k: f64, tolerance: f64) -> Estimate {
    let (re, im) = (n * n - k * k, 2.0 * n * k);
    // The branch point √(1 − m²) of w and the pole 1/√(m² + 1) of r∥.
    let branch = complex_root(1.0 - re, -im);
    let norm = (re + 1.0).powi(2) + im * im;
    let pole = complex_root((re + 1.0) / norm, -im / norm);
    let singularities =
        [branch, pole].map(|(re, im)| if re.is_finite() && im.is_finite() { (re, im) } else { (FAR, 0.0) });
    climb(tolerance, |rules| {
        [2.0 * between_singularities(rules, &singularities, |mu| mu * fresnel::conductor(mu, n, k))]
    })[0]
}

/// Far from the interval of integration: where a pole goes when m² = −1.
const FAR: f64 = 1e3;

/// The square root with positive real part.
fn complex_root(re: f64, im: f64) -> (f64, f64) {
    let larger = (0.5 * (re.hypot(im) + re.abs())).sqrt();
    let smaller = if larger > 0.0 { 0.5 * im.abs() / larger } else { 0.0 };
    if re >= 0.0 { (larger, smaller) } else { (smaller, larger) }
}

/// 1/π ∫ (1 − wo·h)⁵ cosθ_i dω_i: Schlick's weight on the half-vectors between `mu` and a cosine-weighted hemisphere.
///
/// With e the elevations, (wo·h)² = sin²((e_o + e_i)/2) + cos e_o cos e_i sin²(χ/2), χ the azimuth from the far side; what is not
/// smooth is the square root, where both directions graze the surface on opposite sides. As in [`super::quadrature`],
/// τ = tan(χ/4) and rules graded to the branch points at τ = ±i w and e_i = −e_o undo it.
pub fn schlick_under_cosine(mu: f64, tolerance: f64) -> Estimate {
    let e_o = elevation(mu);
    climb(tolerance, |rules| [2.0 / PI * over_elevation(e_o, rules)])[0]
}

fn over_elevation(e_o: f64, rules: &GradedRules) -> f64 {
    // At e_o = 0 the branch point reaches the end of the interval: the smallest scale that a rule has resolves it.
    let rule = rules.at_scale(e_o / FRAC_PI_2);
    let ring = |e_i: f64| {
        let (mu_i, cos_i) = e_i.sin_cos();
        let (c, b) = ((0.5 * (e_o + e_i)).sin(), e_o.cos() * cos_i);
        let rho = b.sqrt() / c;
        let azimuth = rules.at_scale(1.0 / (rho + (rho * rho + 1.0).sqrt())).integrate(|tau| {
            let q = 1.0 / (1.0 + tau * tau);
            let sine = 2.0 * tau * q; // sin(χ/2)
            let cosine = (c * c + b * sine * sine).sqrt().min(1.0); // at most 1 but for rounding
            4.0 * q * fresnel::schlick_weight(cosine)
        });
        azimuth * mu_i * cos_i
    };
    FRAC_PI_2 * rule.integrate(|x| ring(FRAC_PI_2 * x))
}
