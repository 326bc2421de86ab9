//! Sampling a diffuse lobe by the cosine (Malley's method: the unit disk, lifted to the hemisphere).

use super::{Lobe, Sample};
use crate::math::frame::{disk_to_square, square_to_disk};
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, PI};

/// Both directions are above the surface.
pub fn reaches(wo: DVec3, wi: DVec3) -> bool {
    wo.z > 0.0 && wi.z > 0.0
}

/// A direction drawn by the cosine, with the weight π f of `lobe`.
pub fn sample(lobe: &impl Lobe, wo: DVec3, u: [f64; 2]) -> Option<Sample> {
    let (x, y) = square_to_disk(u);
    let wi = DVec3::new(x, y, (1.0 - u[0]).sqrt());
    reaches(wo, wi).then(|| Sample { wi, pdf: wi.z * FRAC_1_PI, weight: PI * lobe.f(wo, wi) })
}

/// The density of [`sample`].
pub fn pdf(wo: DVec3, wi: DVec3) -> f64 {
    if reaches(wo, wi) { wi.z * FRAC_1_PI } else { 0.0 }
}

/// The point of the unit square that [`sample`] takes to `wi`.
pub fn invert(wi: DVec3) -> [f64; 2] {
    disk_to_square(wi.x, wi.y)
}
