//! Burley's diffuse lobe, as Disney defines it and as Frostbite renormalises it.
//!
//! f = s/π (1 + (F90 − 1)(1 − μo)⁵) (1 + (F90 − 1)(1 − μi)⁵), and since (wi·h)² = (1 + wo·wi)/2,
//! F90 = bias + 2 roughness (wi·h)² = bias + roughness (1 + wo·wi), with `roughness` the artist's value. Disney has bias = 1/2
//! and s = 1; Frostbite bias = roughness/2 and s falling linearly from 1 to 1/1.51.
//!
//! F90 is linear in the cosine of the azimuth, so its square averages in closed form, and what is left is a polynomial of the
//! incident cosine: Gauss–Legendre with eight nodes is exact.
//!
//! **Source**: Burley 2012, "Physically Based Shading at Disney", sec. 5.3; Lagarde and de Rousiers 2014, "Moving Frostbite to
//! Physically Based Rendering", sec. 3.1.3 (both as engines' shaders quote them).

use super::fresnel::schlick_weight;
use super::{Lobe, Sample, cosine};
use crate::math::quadrature::{Rule, gauss_legendre};
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;
use std::sync::LazyLock;

/// Burley's lobe of colour 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Burley {
    /// The artist's roughness, in [0, 1].
    pub roughness: f64,
    /// Whether Frostbite's energy renormalisation applies.
    pub renormalised: bool,
}

/// Degree 5 (weight) + 2 (F90²) + 1 (cosine) of the polynomial: 8, for which five nodes are enough.
static RULE: LazyLock<Rule> = LazyLock::new(|| gauss_legendre(8));

/// What Frostbite divides by at roughness 1.
const FROSTBITE_EXCESS: f64 = 1.51;

impl Burley {
    fn scale(&self) -> f64 {
        if self.renormalised { 1.0 + self.roughness * (1.0 / FROSTBITE_EXCESS - 1.0) } else { 1.0 }
    }

    fn bias(&self) -> f64 {
        if self.renormalised { 0.5 * self.roughness } else { 0.5 }
    }

    /// The directional albedo: exact but for rounding.
    pub fn albedo(&self, mu_o: f64) -> f64 {
        let weight_o = schlick_weight(mu_o);
        let flux = RULE.integrate(|mu_i| {
            let weight_i = schlick_weight(mu_i);
            // F90 − 1 = mean + swing cos φ; averages over φ of it and of its square.
            let mean = self.bias() + self.roughness * (1.0 + mu_o * mu_i) - 1.0;
            let swing2 = self.roughness.powi(2) * (1.0 - mu_o * mu_o) * (1.0 - mu_i * mu_i);
            2.0 * mu_i * (1.0 + mean * (weight_o + weight_i) + weight_o * weight_i * (mean * mean + 0.5 * swing2))
        });
        self.scale() * flux
    }
}

impl Lobe for Burley {
    fn f(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !cosine::reaches(wo, wi) {
            return 0.0;
        }
        let excess = self.bias() + self.roughness * (1.0 + wo.dot(wi)) - 1.0;
        let factor = |mu: f64| 1.0 + excess * schlick_weight(mu);
        self.scale() * FRAC_1_PI * factor(wo.z) * factor(wi.z)
    }

    fn sample(&self, wo: DVec3, u: [f64; 2]) -> Option<Sample> {
        cosine::sample(self, wo, u)
    }

    fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        cosine::pdf(wo, wi)
    }

    fn invert(&self, _wo: DVec3, wi: DVec3) -> [f64; 2] {
        cosine::invert(wi)
    }
}
