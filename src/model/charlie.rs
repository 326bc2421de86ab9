//! Sheen: a distribution of fibres that stand on the surface, whose normals are mostly near its horizon.
//!
//! D(m) = (2 + n) sinⁿθ/(2π) with n = 1/α. The visibility terms that go with it are fits, and the two without softening let the lobe reflect
//! more than comes in at grazing angles.
//!
//! **Source**: Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF" (D; Λ fitted as a/(1 + b x^c) + d x + e, its
//! coefficients interpolated by (1 − α)²; softening), with constants and formulas as KHR_materials_sheen gives them. The
//! softening, Λ^(1 + 2 (1 − μ)⁸) of both directions, is as two renderers' sources write it; Neubelt and Pettineo 2013, "Crafting
//! a Next-Gen Material Pipeline for The Order: 1886" is where real-time renderers take the simple visibility from.

use super::{Lobe, Sample, on_one_side};
use crate::math::frame::{reflect, turn};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_1_PI, TAU};

/// The visibility term V = G2/(4 μo μi) of the sheen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Visibility {
    /// 1/(4 (μo + μi − μo μi)).
    #[default]
    Neubelt,
    /// 1/((1 + Λo + Λi) 4 μo μi) with Estevez and Kulla's fitted Λ.
    Charlie,
    /// The same with Λ raised to 1 + 2 (1 − μ)⁸, which softens the terminator.
    CharlieSoftened,
}

impl Visibility {
    /// Every kind, in the order in which they are listed to a user.
    pub const ALL: [Self; 3] = [Self::Neubelt, Self::Charlie, Self::CharlieSoftened];

    /// The name that a user writes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Neubelt => "neubelt",
            Self::Charlie => "charlie",
            Self::CharlieSoftened => "charlie-softened",
        }
    }

    /// V μi, which is finite for every μi ≥ 0 as long as μo > 0.
    #[inline]
    pub fn times_cosine(self, alpha: f64, mu_o: f64, mu_i: f64) -> f64 {
        match self {
            Self::Neubelt if mu_o == 0.0 => 0.25,
            Self::Neubelt => 0.25 * mu_i / (mu_o + mu_i - mu_o * mu_i),
            _ => 0.25 / (mu_o * (1.0 + self.lambda(alpha, mu_o) + self.lambda(alpha, mu_i))),
        }
    }

    /// The fitted Λ; the fit is mirrored about μ = 1/2.
    fn lambda(self, alpha: f64, mu: f64) -> f64 {
        let l = |x| fitted(alpha, x);
        let exponent = if mu < 0.5 { l(mu) } else { 2.0 * l(0.5) - l(1.0 - mu) };
        match self {
            Self::CharlieSoftened => (exponent * (1.0 + 2.0 * (1.0 - mu).powi(8))).exp(),
            _ => exponent.exp(),
        }
    }
}

/// The coefficients a, b, c, d, e of the fit at α = 1 …
const AT_ONE: [f64; 5] = [21.5473, 3.82987, 0.19823, -1.97760, -4.32054];
/// … and at α = 0.
const AT_ZERO: [f64; 5] = [25.3245, 3.32435, 0.16801, -1.27393, -4.85967];

/// ln Λ at the cosine `x` ≤ 1/2.
fn fitted(alpha: f64, x: f64) -> f64 {
    let t = (1.0 - alpha) * (1.0 - alpha);
    let [a, b, c, d, e] = std::array::from_fn(|i| AT_ONE[i] + t * (AT_ZERO[i] - AT_ONE[i]));
    a / (1.0 + b * x.powf(c)) + d * x + e
}

/// The lobe D V, without Fresnel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Charlie {
    /// Width, in (0, 1].
    pub alpha: f64,
    /// Masking and shadowing.
    pub visibility: Visibility,
}

impl Charlie {
    /// Density of microfacet normals at the cosine `mu` to the surface's normal, in 1/sr.
    fn d(&self, mu: f64) -> f64 {
        let n = 1.0 / self.alpha;
        (2.0 + n) / TAU * ((1.0 - mu) * (1.0 + mu)).max(0.0).powf(0.5 * n) // at most one rounding below 0
    }

    /// Width of the distribution of normals about the horizon, in cosines: (1 − μ²)^(n/2) ≈ exp(−nμ²/2).
    fn sigma(&self) -> f64 {
        self.alpha.sqrt()
    }

    /// Density with which [`Lobe::sample`] draws normals of cosine `mu`: a Cauchy distribution, whose tail covers that of D.
    fn density(&self, mu: f64) -> f64 {
        let sigma = self.sigma();
        0.5 * FRAC_1_PI / (sigma * (1.0 / sigma).atan() * (1.0 + (mu / sigma).powi(2)))
    }
}

impl Lobe for Charlie {
    fn f(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !on_one_side(wo, wi) {
            return 0.0;
        }
        let (mu_o, mu_i) = (wo.z.max(wi.z), wo.z.min(wi.z)); // the same bits either way round
        self.d((wo + wi).normalize().z) * self.visibility.times_cosine(self.alpha, mu_o, mu_i) / mu_i
    }

    fn sample(&self, wo: DVec3, u: [f64; 2]) -> Option<Sample> {
        let sigma = self.sigma();
        let z = (sigma * (u[1] * (1.0 / sigma).atan()).tan()).min(1.0); // at most 1 but for rounding
        let r = ((1.0 - z) * (1.0 + z)).sqrt();
        let (sin_phi, cos_phi) = (TAU * u[0]).sin_cos();
        let m = DVec3::new(r * cos_phi, r * sin_phi, z);
        let wi = reflect(wo, m);
        let cosine = wo.dot(m);
        if cosine <= 0.0 || !on_one_side(wo, wi) {
            return None;
        }
        let pdf = self.density(z) / (4.0 * cosine);
        let weight = self.d(z) * self.visibility.times_cosine(self.alpha, wo.z, wi.z) / pdf;
        Some(Sample { wi, pdf, weight })
    }

    fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !on_one_side(wo, wi) {
            return 0.0;
        }
        let m = (wo + wi).normalize();
        self.density(m.z) / (4.0 * wo.dot(m))
    }

    fn invert(&self, wo: DVec3, wi: DVec3) -> [f64; 2] {
        let (m, sigma) = ((wo + wi).normalize(), self.sigma());
        [turn(m.x, m.y), (m.z / sigma).atan() / (1.0 / sigma).atan()]
    }
}
