//! The Lambertian: a diffuse surface that reflects c/π in every direction.

use super::{Lobe, Sample};
use crate::math::frame::{disk_to_square, square_to_disk};
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
        if wo.z <= 0.0 || wi.z <= 0.0 { 0.0 } else { self.c * FRAC_1_PI }
    }

    fn sample(&self, wo: DVec3, u: [f64; 2]) -> Option<Sample> {
        let (x, y) = square_to_disk(u);
        let wi = DVec3::new(x, y, (1.0 - u[0]).sqrt());
        (wo.z > 0.0 && wi.z > 0.0).then_some(Sample { wi, pdf: wi.z * FRAC_1_PI, weight: self.c })
    }

    fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if wo.z <= 0.0 || wi.z <= 0.0 { 0.0 } else { wi.z * FRAC_1_PI }
    }

    fn invert(&self, _wo: DVec3, wi: DVec3) -> [f64; 2] {
        disk_to_square(wi.x, wi.y)
    }
}
