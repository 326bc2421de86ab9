//! Beckmann microfacet reflection with the exact Smith masking and shadowing, isotropic.
//!
//! D(m) = exp(−tan²θ/α²)/(π α² cos⁴θ), and with a = 1/(α tanθ) the Smith Λ(w) = (erf(a) − 1)/2 + exp(−a²)/(2a√π). Written with
//! ℓ(w) = μ (1 + 2Λ(w)) = μ erf(a) + α sinθ exp(−a²)/√π, which divides by nothing, it shares [`Smith`] with GGX.
//!
//! **Source**: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", eq. 25–26 (D, G1) and 28–29
//! (sampling of D); Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs" (Λ, G2).

use super::smith::Smith;
use super::{Lobe, Sample, on_one_side};
use crate::math::frame::{reflect, sine_of_cosine, turn};
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, FRAC_2_SQRT_PI, TAU};

/// The lobe D G2/(4 cosθ_o cosθ_i), without Fresnel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beckmann {
    /// Width, > 0.
    pub alpha: f64,
    /// Masking and shadowing.
    pub smith: Smith,
}

impl Beckmann {
    /// Density of microfacet normals at the cosine `mu` > 0 to the surface's normal, in 1/sr.
    fn d(&self, mu: f64) -> f64 {
        let tan = sine_of_cosine(mu) / mu;
        let ratio = tan / self.alpha;
        (-ratio * ratio).exp() * FRAC_1_PI / (self.alpha * self.alpha * mu.powi(4))
    }

    /// ℓ = μ (1 + 2Λ) at the cosine `mu`.
    #[inline]
    pub fn l(&self, mu: f64) -> f64 {
        let width = self.alpha * sine_of_cosine(mu);
        let a = mu / width; // infinite at normal incidence, where ℓ is μ
        mu * libm::erf(a) + 0.5 * FRAC_2_SQRT_PI * width * (-a * a).exp()
    }

    /// G2/(4 mu_o mu_i).
    pub fn visibility(&self, mu_o: f64, mu_i: f64) -> f64 {
        self.smith.visibility(self.alpha, (mu_o, self.l(mu_o)), (mu_i, self.l(mu_i)))
    }
}

impl Lobe for Beckmann {
    fn f(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !on_one_side(wo, wi) {
            return 0.0;
        }
        self.d((wo + wi).normalize().z) * self.visibility(wo.z, wi.z)
    }

    /// Draws a normal from D(m) cosθ_m, seen or not: its Gaussian tail keeps the weights small, and it inverts in closed form.
    fn sample(&self, wo: DVec3, u: [f64; 2]) -> Option<Sample> {
        let tan = self.alpha * (-(-u[1]).ln_1p()).sqrt();
        let (sin_phi, cos_phi) = (TAU * u[0]).sin_cos();
        let m = DVec3::new(tan * cos_phi, tan * sin_phi, 1.0).normalize();
        let wi = reflect(wo, m);
        let cosine = wo.dot(m);
        if cosine <= 0.0 || !on_one_side(wo, wi) {
            return None;
        }
        let weight = 4.0 * self.visibility(wo.z, wi.z) * wi.z * cosine / m.z;
        Some(Sample { wi, pdf: self.d(m.z) * m.z / (4.0 * cosine), weight })
    }

    fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !on_one_side(wo, wi) {
            return 0.0;
        }
        let m = (wo + wi).normalize();
        self.d(m.z) * m.z / (4.0 * wo.dot(m))
    }

    fn invert(&self, wo: DVec3, wi: DVec3) -> [f64; 2] {
        let m = wo + wi;
        let squared = (m.x * m.x + m.y * m.y) / (m.z * self.alpha).powi(2);
        [turn(m.x, m.y), -(-squared).exp_m1()]
    }
}
