//! Fresnel reflectance: of dielectrics and conductors, exactly; Schlick's approximation; the tint of metals at 82°.
//!
//! `mu` is the cosine of the incident direction to the (microfacet) normal, in [0, 1]; all reflectances are of power.
//!
//! With η = n_t/n_i, g = η cosθ_t = √(η² − 1 + μ²), the amplitudes r⊥ = (μ − g)/(μ + g) and r∥ = (η²μ − g)/(η²μ + g) become
//!
//! ```text
//! r⊥ = −(η² − 1)/(μ + g)²,      r∥ = (η² − 1)((η² + 1) μ² − 1)/(η²μ + g)²:
//! ```
//!
//! nothing cancels when η is nearly 1, and Brewster's angle, μ² = 1/(1 + η²), can be read off. In this sign convention r∥ = −r⊥
//! at normal incidence. A conductor is the same with the complex index n + ik relative to the medium of incidence.
//!
//! **Source**: Lagarde 2013, "Memo on Fresnel equations" (definitions, n − ik there); the cancelled form is derived here.

use crate::math::exact::difference_of_squares;

/// Schlick's weight (1 − mu)⁵: the reflectance is f0 + (f90 − f0)·weight.
///
/// **Source**: Schlick 1994, "An Inexpensive BRDF Model for Physically-based Rendering", eq. 15 (as quoted by every
/// engine that uses the split sum; `mu` is the cosine to the microfacet normal).
#[inline]
pub fn schlick_weight(mu: f64) -> f64 {
    let x = 1.0 - mu;
    let x2 = x * x;
    x2 * x2 * x
}

/// Schlick's reflectance f0 + (1 − f0)(1 − mu)⁵.
pub fn schlick(f0: f64, mu: f64) -> f64 {
    f0 + (1.0 - f0) * schlick_weight(mu)
}

/// The average 2 ∫ F μ dμ of Schlick's reflectance: (20 f0 + 1)/21.
pub fn schlick_average(f0: f64) -> f64 {
    (20.0 * f0 + 1.0) / 21.0
}

/// The cosine, nearly that of 82°, at which metals dip below Schlick's reflectance.
pub const MU_82: f64 = 1.0 / 7.0;

/// Schlick's reflectance with a dip at 82°: `f82` is what remains there, as a part of Schlick's value.
///
/// It is not clamped: where f0 and f82 are both small, the dip reaches below 0 (−0.127 at worst, for f0 = f82 = 0).
///
/// **Source**: the `generalized_schlick` model of MaterialX (`mx_fresnel_hoffman_schlick`, with F90 = 1 and exponent 5) and the
/// GLSL beside Portsmouth, Kutz and Hill 2024 (`FresnelConductorF82`): F = schlick − a μ (1 − μ)⁶, a such that
/// F(1/7) = f82 · schlick(1/7).
pub fn f82_tint(f0: f64, f82: f64, mu: f64) -> f64 {
    schlick(f0, mu) - (1.0 - f82) * schlick(f0, MU_82) * f82_dip(mu) / f82_dip(MU_82)
}

/// mu (1 − mu)⁶, the shape of the dip that [`f82_tint`] takes from Schlick's reflectance; largest at [`MU_82`].
#[inline]
pub fn f82_dip(mu: f64) -> f64 {
    mu * (1.0 - mu) * schlick_weight(mu)
}

/// The amplitudes (r∥, r⊥) at an interface between dielectrics; `None` beyond the critical angle, where all is reflected.
///
/// `eta` is n_t/n_i, on either side of 1; at its limits, 0 and infinity, all is reflected too.
pub fn dielectric_amplitudes(mu: f64, eta: f64) -> Option<[f64; 2]> {
    if eta == f64::INFINITY {
        return None;
    }
    let step = (eta - 1.0) * (eta + 1.0);
    if step == 0.0 {
        return Some([0.0; 2]); // no interface, not even at grazing incidence, where the formula is 0/0
    }
    // Near the critical angle the digits that cancel here are the ones that matter.
    let g2 = difference_of_squares(&[eta, mu], &[1.0]);
    if g2 <= 0.0 {
        return None;
    }
    let (g, eta2) = (g2.sqrt(), eta * eta);
    let parallel = if step.abs() < CANCELS {
        step * brewster(mu, eta2) / (eta2 * mu + g).powi(2)
    } else {
        (eta2 * mu - g) / (eta2 * mu + g)
    };
    Some([parallel, -step / (mu + g).powi(2)])
}

/// Where |η² − 1| is below this, the cancelled form of r∥ has the smaller error; elsewhere it amplifies roundings as 1/η⁴.
const CANCELS: f64 = 0.5;

/// (η² + 1) μ² − 1: 0 at Brewster's angle.
fn brewster(mu: f64, eta2: f64) -> f64 {
    (eta2 + 1.0) * mu * mu - 1.0
}

/// The reflectances (r∥², r⊥²) of both polarisations at an interface between dielectrics; 1 beyond the critical angle.
pub fn dielectric_polarised(mu: f64, eta: f64) -> [f64; 2] {
    dielectric_amplitudes(mu, eta).map_or([1.0; 2], |r| r.map(|r| r * r))
}

/// The reflectance of unpolarised light at an interface between dielectrics of relative index `eta` = n_t/n_i.
pub fn dielectric(mu: f64, eta: f64) -> f64 {
    let [parallel, perpendicular] = dielectric_polarised(mu, eta);
    0.5 * (parallel + perpendicular)
}

/// The reflectance of unpolarised light at a conductor of complex index n + ik relative to the medium of incidence.
pub fn conductor(mu: f64, n: f64, k: f64) -> f64 {
    let interface = Conductor::new(n, k);
    let re = difference_of_squares(&[n, mu], &[1.0, k]);
    interface.with_root(mu, re, re.hypot(interface.im))
}

/// A conductor's interface, for many angles.
#[derive(Debug, Clone, Copy)]
pub struct Conductor {
    /// The real and imaginary part of m² − 1, with m = n + ik, and its absolute value.
    re: f64,
    im: f64,
    step: f64,
}

impl Conductor {
    /// Of complex index n + ik relative to the medium of incidence.
    pub fn new(n: f64, k: f64) -> Self {
        let (re, im) = (difference_of_squares(&[n], &[1.0, k]), 2.0 * n * k);
        Self { re, im, step: re.hypot(im) }
    }

    /// [`conductor`] to within a rounding of `mu`, which is what an integrand needs: it differs where k is 0, at the critical angle.
    #[inline]
    pub fn reflectance(&self, mu: f64) -> f64 {
        let re = self.re + mu * mu;
        self.with_root(mu, re, (re * re + self.im * self.im).sqrt())
    }

    /// With w² = m² − 1 + μ², of which the real part and the absolute value are given.
    #[inline]
    fn with_root(&self, mu: f64, re: f64, modulus: f64) -> f64 {
        let &Self { re: step_re, im, step } = self;
        if step == 0.0 {
            return 0.0;
        }
        // w, whose real part is positive: the transmitted wave fades into the conductor.
        let larger = (0.5 * (modulus + re.abs())).sqrt();
        let smaller = if larger > 0.0 { 0.5 * im / larger } else { 0.0 };
        let (a, b) = if re >= 0.0 { (larger, smaller) } else { (smaller, larger) };
        let norm2 = |re: f64, im: f64| re * re + im * im;
        let (m2_re, m2_im) = (step_re + 1.0, im);
        let perpendicular = (step / norm2(mu + a, b)).powi(2);
        let denominator = norm2(m2_re * mu + a, m2_im * mu + b);
        let parallel = if step < CANCELS {
            norm2(brewster(mu, m2_re), m2_im * mu * mu) * (step / denominator).powi(2)
        } else {
            norm2(m2_re * mu - a, m2_im * mu - b) / denominator
        };
        0.5 * (perpendicular + parallel)
    }
}

/// The reflectance at normal incidence of relative index `eta`: ((η − 1)/(η + 1))².
pub fn f0_of_eta(eta: f64) -> f64 {
    ((eta - 1.0) / (eta + 1.0)).powi(2)
}

/// The relative index above 1 whose reflectance at normal incidence is `f0`: (1 + √f0)/(1 − √f0); infinite for 1.
pub fn eta_of_f0(f0: f64) -> f64 {
    let root = f0.sqrt();
    (1.0 + root) / (1.0 - root)
}

/// Walsh's closed form of the average 2 ∫ F μ dμ of a dielectric, for `eta` > 1; it loses digits as (eta − 1)⁻².
///
/// **Source**: Walsh, as given by Prahl 1988, "Light Transport in Tissue", eq. B41 (m there is n_t/n_i).
pub fn dielectric_average_walsh(eta: f64) -> f64 {
    let m = eta;
    let (m2, m4) = (m * m, m.powi(4));
    let steps = (m - 1.0) * (3.0 * m + 1.0) / (6.0 * (m + 1.0).powi(2));
    let grazing = m2 * (m2 - 1.0).powi(2) / (m2 + 1.0).powi(3) * ((m - 1.0) / (m + 1.0)).ln();
    let rational = 2.0 * m * m2 * (m2 + 2.0 * m - 1.0) / ((m2 + 1.0) * (m4 - 1.0));
    let logarithm = 8.0 * m4 * (m4 + 1.0) / ((m2 + 1.0) * (m4 - 1.0).powi(2)) * m.ln();
    0.5 + steps + grazing - rational + logarithm
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schlick_is_f0_at_normal_incidence_and_one_at_grazing() {
        for f0 in [0.0, 0.02, 0.04, 0.5, 1.0] {
            assert_eq!(schlick(f0, 1.0), f0);
            assert_eq!(schlick(f0, 0.0), 1.0);
        }
    }
}
