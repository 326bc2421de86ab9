//! The Oren–Nayar family of rough diffuse lobes: the qualitative model, Fujii's, and the energy-preserving EON.
//!
//! With s = wo·wi − μo μi, the product of both sines and the cosine of the azimuth, all three are
//! f = 1/π (A + B s/t), where t tells them apart:
//!
//! | lobe | s > 0 | s ≤ 0 | A | B |
//! | --- | --- | --- | --- | --- |
//! | qualitative | t = max(μo, μi) | 0 instead of s/t | 1 − σ²/2/(σ² + 0.33) | 0.45 σ²/(σ² + 0.09) |
//! | Fujii | t = max(μo, μi) | t = 1 | 1/(1 + (1/2 − 2/3π) r) | r A |
//!
//! EON is Fujii's single scattering plus a Kulla–Conty lobe that returns what it loses.
//!
//! **Source**: Oren and Nayar 1994, "Generalization of Lambert's Reflectance Model" (the qualitative model, as Wikipedia and the GLSL
//! beside EON quote it: no interreflection, 0.33); Fujii, "A tiny improvement of Oren–Nayar reflectance model"
//! (mimosa-pudica.net); Portsmouth, Kutz and Hill 2024, "EON: A practical energy-preserving rough diffuse BRDF", listing 1
//! (without its clamps at 1e-7: here 1 − E is computed in a form that needs none).

use super::{Lobe, Sample, cosine};
use crate::math::frame::sine_of_cosine;
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, PI};

/// sinα tanβ max(0, cosφ), or s itself where s is negative and `signed` says so.
fn s_over_t(wo: DVec3, wi: DVec3, signed: bool) -> f64 {
    // wo·wi − μo μi without the cancellation.
    let s = wo.x * wi.x + wo.y * wi.y;
    if s > 0.0 {
        s / wo.z.max(wi.z)
    } else if signed {
        s
    } else {
        0.0
    }
}

/// 1/π ∫ s/t cosθ_i dω_i over s > 0, at cosine `mu`: (sinθ/π) (θ − sinθ cosθ + 2/3 (1 − sin³θ)/cosθ).
///
/// Derived here; 1 − sin³θ = cos²θ (1 + sinθ + sin²θ)/(1 + sinθ) keeps it finite and exact at the horizon.
fn positive_part(mu: f64) -> f64 {
    let sine = sine_of_cosine(mu);
    let theta = sine.atan2(mu);
    let near_horizon = 2.0 / 3.0 * mu * (1.0 + sine + sine * sine) / (1.0 + sine);
    FRAC_1_PI * sine * (theta - sine * mu + near_horizon)
}

/// The same over s ≤ 0 with t = 1: −2/(3π) sinθ.
fn negative_part(mu: f64) -> f64 {
    -2.0 / 3.0 * FRAC_1_PI * sine_of_cosine(mu)
}

/// The qualitative Oren–Nayar lobe of colour 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrenNayar {
    /// Standard deviation of the slope angle, in radians.
    pub sigma: f64,
}

impl OrenNayar {
    fn coefficients(&self) -> (f64, f64) {
        let sigma2 = self.sigma * self.sigma;
        (1.0 - 0.5 * sigma2 / (sigma2 + 0.33), 0.45 * sigma2 / (sigma2 + 0.09))
    }

    /// The directional albedo, in closed form.
    pub fn albedo(&self, mu: f64) -> f64 {
        let (a, b) = self.coefficients();
        a + b * positive_part(mu)
    }
}

/// Fujii's lobe of colour 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fujii {
    /// The mixing ratio σ' of the rough part, in [0, 1].
    pub roughness: f64,
}

/// 1/2 − 2/(3π): what s/t reflects at grazing incidence, where the model is normalised to 1.
const AT_GRAZING: f64 = 0.5 - 2.0 / (3.0 * PI);
/// 2/3 − 28/(15π): the average of what s/t reflects.
const ON_AVERAGE: f64 = 2.0 / 3.0 - 28.0 / (15.0 * PI);

impl Fujii {
    fn a(&self) -> f64 {
        1.0 / (1.0 + AT_GRAZING * self.roughness)
    }

    /// The directional albedo, in closed form.
    pub fn albedo(&self, mu: f64) -> f64 {
        self.a() * (1.0 + self.roughness * (positive_part(mu) + negative_part(mu)))
    }

    /// The average albedo, in closed form.
    pub fn albedo_average(&self) -> f64 {
        self.a() * (1.0 + self.roughness * ON_AVERAGE)
    }
}

/// The energy-preserving Oren–Nayar lobe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eon {
    /// Fujii's roughness, in [0, 1].
    pub roughness: f64,
    /// Albedo of single scattering, in [0, 1].
    pub rho: f64,
}

impl Eon {
    fn single(&self) -> Fujii {
        Fujii { roughness: self.roughness }
    }

    /// The albedo of multiple scattering: ρ² E_avg/(1 − ρ (1 − E_avg)).
    fn rho_multiple(&self) -> f64 {
        let average = self.single().albedo_average();
        self.rho * self.rho * average / (1.0 - self.rho * (1.0 - average))
    }

    /// The directional albedo, in closed form: ρ E + ρ_ms (1 − E).
    pub fn albedo(&self, mu: f64) -> f64 {
        let e = self.single().albedo(mu);
        self.rho * e + self.rho_multiple() * (1.0 - e)
    }
}

impl Lobe for OrenNayar {
    fn f(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !cosine::reaches(wo, wi) {
            return 0.0;
        }
        let (a, b) = self.coefficients();
        FRAC_1_PI * (a + b * s_over_t(wo, wi, false))
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

impl Lobe for Fujii {
    fn f(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !cosine::reaches(wo, wi) {
            return 0.0;
        }
        FRAC_1_PI * self.a() * (1.0 + self.roughness * s_over_t(wo, wi, true))
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

impl Lobe for Eon {
    fn f(&self, wo: DVec3, wi: DVec3) -> f64 {
        let single = self.single();
        if !cosine::reaches(wo, wi) {
            return 0.0;
        }
        // (1 − E(μo)) (1 − E(μi))/(1 − E_avg), where each factor is A r times what is missing from the grazing albedo.
        let missing = |mu: f64| AT_GRAZING - positive_part(mu) - negative_part(mu);
        let shape = single.a() * self.roughness * missing(wo.z) * missing(wi.z) / (AT_GRAZING - ON_AVERAGE);
        self.rho * single.f(wo, wi) + self.rho_multiple() * FRAC_1_PI * shape
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
