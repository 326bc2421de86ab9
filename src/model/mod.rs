//! Light scattering models, one file per lobe and one for Fresnel.
//!
//! Every lobe keeps the protocol of three: [`Lobe::f`], [`Lobe::sample`], [`Lobe::pdf`], and [`Lobe::invert`] undoes the
//! sampling. Directions are unit, point away from the surface, and live in the local frame whose normal is +z.

pub mod beckmann;
pub mod burley;
pub mod charlie;
pub mod clipped_sphere;
pub mod cosine;
pub mod dielectric;
pub mod fresnel;
pub mod ggx;
pub mod lambert;
pub mod layered;
pub mod ltc;
pub mod oren_nayar;
pub mod smith;

use glam::DVec3;

/// alpha of an artist's roughness: the one place that knows.
pub fn alpha_of_roughness(roughness: f64) -> f64 {
    roughness * roughness
}

/// A direction drawn from a lobe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The incident direction.
    pub wi: DVec3,
    /// Density of `wi` per solid angle, in 1/sr.
    pub pdf: f64,
    /// f(wo, wi) cosθ_i / pdf, computed in cancelled form.
    pub weight: f64,
}

/// A reflection lobe: a BRDF with a way to draw from it.
pub trait Lobe: Sync {
    /// The BRDF, without a Fresnel factor, in 1/sr; 0 unless both directions are above the surface.
    fn f(&self, wo: DVec3, wi: DVec3) -> f64;

    /// A direction from a point of the unit square; `None` where the lobe reaches below the horizon.
    fn sample(&self, wo: DVec3, u: [f64; 2]) -> Option<Sample>;

    /// The density with which [`Lobe::sample`] draws `wi`, in 1/sr.
    fn pdf(&self, wo: DVec3, wi: DVec3) -> f64;

    /// The point of the unit square that [`Lobe::sample`] takes to `wi`.
    fn invert(&self, wo: DVec3, wi: DVec3) -> [f64; 2];
}

/// Both directions above the surface; one of them may graze it, which is a limit that the model has.
fn on_one_side(wo: DVec3, wi: DVec3) -> bool {
    wo.z >= 0.0 && wi.z >= 0.0 && wo.z + wi.z > 0.0
}
