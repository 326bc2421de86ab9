//! GGX microfacet reflection with Smith masking and shadowing, isotropic or not.
//!
//! D(m) = 1 / (π αx αy (m_x²/αx² + m_y²/αy² + m_z²)²), and with ℓ(w) = sqrt(αx² w_x² + αy² w_y² + w_z²):
//! Λ(w) = (ℓ(w)/w_z − 1)/2 and G1(w) = 1/(1 + Λ) = 2 w_z/(w_z + ℓ(w)). Everything here is written with ℓ instead of Λ, so
//! that nothing divides by a cosine: all formulas hold down to the horizon.
//!
//! **Source**: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", eq. 33–34 (D, G1);
//! Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", eq. 98–99 (separable and
//! height-correlated G2); Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps" (sampling).

pub use super::smith::Smith;
use super::{Lobe, Sample, on_one_side};
use crate::math::frame::{reflect, turn};
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, TAU};

/// The lobe D G2/(4 cosθ_o cosθ_i), without Fresnel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ggx {
    /// Width along x, > 0.
    pub alpha_x: f64,
    /// Width along y, > 0.
    pub alpha_y: f64,
    /// Masking and shadowing.
    pub smith: Smith,
}

impl Ggx {
    /// A lobe of equal width in all directions.
    pub fn isotropic(alpha: f64, smith: Smith) -> Self {
        Self { alpha_x: alpha, alpha_y: alpha, smith }
    }

    /// Density of microfacet normals about the unit normal `m`, in 1/sr.
    #[inline]
    pub fn d(&self, m: DVec3) -> f64 {
        let stretched = DVec3::new(m.x / self.alpha_x, m.y / self.alpha_y, m.z);
        FRAC_1_PI / (self.alpha_x * self.alpha_y * stretched.length_squared().powi(2))
    }

    /// Draws a visible microfacet normal, of density G1(wo) D(m) (wo·m)/cosθ_o: the sum of the squeezed `wo` and a point of the
    /// spherical cap that it can see. `None` below the horizon, or where rounding leaves no direction.
    #[inline]
    pub fn sample_visible_normal(&self, wo: DVec3, u: [f64; 2]) -> Option<DVec3> {
        if wo.z < 0.0 {
            return None;
        }
        // Squeeze the configuration until the surface is the unit hemisphere.
        let o = self.squeeze(wo).normalize();
        // Draw a point of the cap z > −o.z, which the hemisphere's reflections of o fill evenly; u[1] = 0 is its rim.
        let height = u[1] * (1.0 + o.z);
        let z = height - o.z;
        let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt(); // z ≥ −1 up to one rounding
        let (sin_phi, cos_phi) = (TAU * u[0]).sin_cos();
        // Their half-vector is the normal of the hemisphere; stretch it back.
        self.squeeze(DVec3::new(r * cos_phi + o.x, r * sin_phi + o.y, height)).try_normalize()
    }

    /// f cosθ_i over the density of reflecting at a visible normal `m`, in cancelled form: G2/G1; 0 below the horizon.
    #[inline]
    pub fn weight(&self, wo: DVec3, m: DVec3) -> f64 {
        let wi = reflect(wo, m);
        if wi.z <= 0.0 {
            return 0.0;
        }
        let (l_o, l_i) = (self.l(wo), self.l(wi));
        2.0 * (wo.z + l_o) * wi.z * self.visibility((wo.z, l_o), (wi.z, l_i))
    }

    /// ℓ(w): the length of `w` squeezed by the widths.
    #[inline]
    pub fn l(&self, w: DVec3) -> f64 {
        self.squeeze(w).length()
    }

    /// V from the cosine and ℓ of both directions; approximations that know one width only take the geometric mean.
    #[inline]
    fn visibility(&self, o: (f64, f64), i: (f64, f64)) -> f64 {
        self.smith.visibility((self.alpha_x * self.alpha_y).sqrt(), o, i)
    }

    #[inline]
    fn squeeze(&self, w: DVec3) -> DVec3 {
        DVec3::new(self.alpha_x * w.x, self.alpha_y * w.y, w.z)
    }
}

impl Lobe for Ggx {
    fn f(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !on_one_side(wo, wi) {
            return 0.0;
        }
        let m = (wo + wi).normalize();
        self.d(m) * self.visibility((wo.z, self.l(wo)), (wi.z, self.l(wi)))
    }

    #[inline]
    fn sample(&self, wo: DVec3, u: [f64; 2]) -> Option<Sample> {
        let m = self.sample_visible_normal(wo, u)?;
        let wi = reflect(wo, m);
        if wi.z <= 0.0 {
            return None;
        }
        Some(Sample { wi, pdf: self.d(m) / (2.0 * (wo.z + self.l(wo))), weight: self.weight(wo, m) })
    }

    fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !on_one_side(wo, wi) {
            return 0.0;
        }
        // G1(wo) D(m) (wo·m)/cosθ_o, times the Jacobian 1/(4 wo·m).
        self.d((wo + wi).normalize()) / (2.0 * (wo.z + self.l(wo)))
    }

    fn invert(&self, wo: DVec3, wi: DVec3) -> [f64; 2] {
        let o = self.squeeze(wo).normalize();
        let m = wo + wi;
        let m = DVec3::new(m.x / self.alpha_x, m.y / self.alpha_y, m.z).normalize();
        let cap = reflect(o, m);
        [turn(cap.x, cap.y), (cap.z + o.z) / (1.0 + o.z)]
    }
}
