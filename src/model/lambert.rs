//! The Lambertian: a diffuse surface that reflects c/π in every direction.

use super::{Lobe, Sample, cosine};
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;

/// A Lambertian of albedo `c`, sampled by the cosine (Malley's method: the unit disk, lifted to the hemisphere).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lambert {
    /// Albedo, in [0, 1].
    pub c: f64,
}

impl Lobe for Lambert {
    fn f(&self, wo: DVec3, wi: DVec3) -> f64 {
        if cosine::reaches(wo, wi) { self.c * FRAC_1_PI } else { 0.0 }
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
