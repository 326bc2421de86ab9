//! A rough interface between two dielectrics: GGX microfacets, each of which reflects and refracts.
//!
//! `eta` = n_t/n_i, the index on the far side over that on the side of `wo`. Light that refracts at a facet with normal h goes to
//! wt = −wo/η + (cosβ/η − cosβ_t) h; where that is above the surface again, it carries nothing.
//!
//! **Source**: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", eq. 16, 17, 21 (half-vector, Jacobian,
//! BTDF) and 40 (refracted direction); exact unpolarised Fresnel equations (Born and Wolf, as every optics text gives them).

use super::Lobe;
use super::fresnel::{f0_of_eta, schlick_weight};
use super::ggx::Ggx;
use crate::math::frame::reflect;
use glam::DVec3;

/// The reflectance of a smooth interface for unpolarised light at the cosine `mu` ≥ 0; 1 beyond the critical angle.
#[inline]
pub fn reflectance(mu: f64, eta: f64) -> f64 {
    match refracted_cosine(mu, eta) {
        None => 1.0,
        // Both cosines are 0 only where eta is 1 and nothing is there to reflect.
        Some(_) if eta == 1.0 => 0.0,
        Some(mu_t) => {
            let perpendicular = (mu - eta * mu_t) / (mu + eta * mu_t);
            let parallel = (eta * mu - mu_t) / (eta * mu + mu_t);
            0.5 * (perpendicular * perpendicular + parallel * parallel)
        }
    }
}

/// [`reflectance`] from the thinner side, for many angles: `eta` above 1 and finite, and no branch.
#[inline]
pub fn reflectance_outside(mu: f64, eta: f64) -> f64 {
    let step = (eta - 1.0) * (eta + 1.0);
    let refracted = (step + mu * mu).sqrt(); // eta times the cosine
    let (perpendicular, facing) = (step / ((mu + refracted) * (mu + refracted)), eta * eta * mu);
    let parallel = (facing - refracted) / (facing + refracted);
    0.5 * (perpendicular * perpendicular + parallel * parallel)
}

/// One minus the reflectance, from the cosines on both sides, without cancellation at grazing angles.
#[inline]
pub fn transmittance(mu: f64, mu_t: f64, eta: f64) -> f64 {
    let product = 2.0 * mu * eta * mu_t;
    product / (mu + eta * mu_t).powi(2) + product / (eta * mu + mu_t).powi(2)
}

/// The cosine of the refracted direction by Snell's law; `None` where all is reflected: beyond the critical angle, and at the
/// limits of the index, 0 and infinity.
#[inline]
pub fn refracted_cosine(mu: f64, eta: f64) -> Option<f64> {
    if eta == 0.0 || eta == f64::INFINITY {
        return None;
    }
    // η² − sin² without cancellation near grazing incidence and η = 1
    let squared = (eta - 1.0) * (eta + 1.0) + mu * mu;
    (squared >= 0.0).then(|| squared.sqrt() / eta)
}

/// What Schlick's F0 scales, what F90 does, and what 1 − F0 scales of the light that goes through, of a smooth interface.
pub fn schlick_smooth(mu: f64, eta: f64) -> [f64; 3] {
    let refracted = if eta == f64::INFINITY { Some(1.0) } else { refracted_cosine(mu, eta) };
    match refracted {
        None => [0.0, 1.0, 0.0],
        Some(mu_t) => {
            let s = schlick_weight(mu.min(mu_t));
            [1.0 - s, s, 1.0 - s]
        }
    }
}

/// The interface, seen from the side of `wo`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dielectric {
    /// Its microfacets.
    pub facets: Ggx,
    /// Relative index of refraction n_t/n_i.
    pub eta: f64,
}

impl Dielectric {
    /// The BRDF, in 1/sr, for `wo` and `wi` above the surface.
    pub fn brdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        let cosine = (0.5 * (wo + wi).length()).min(1.0); // at most 1 but for rounding
        self.facets.f(wo, wi) * reflectance(cosine, self.eta)
    }

    /// The BTDF, in 1/sr, for `wo` above the surface and `wt` below it; `None` where the masking is one that is made for
    /// reflection, or η is 1 and nothing is refracted.
    pub fn btdf(&self, wo: DVec3, wt: DVec3) -> Option<f64> {
        if self.eta < 1.0 {
            // The way back, seen from the thinner side: the same roundings for both make it reciprocal to the last digits.
            let back = Self { eta: 1.0 / self.eta, ..*self };
            return Some(back.btdf(-wt, -wo)? * self.eta * self.eta);
        }
        let h = -(wo + self.eta * wt).try_normalize()?;
        let h = if h.z < 0.0 { -h } else { h };
        let (cosine, cosine_t, mu_t) = (wo.dot(h), -wt.dot(h), -wt.z);
        let masking = self.facets.smith.through((wo.z, self.facets.l(wo)), (mu_t, self.facets.l(wt)))?;
        if cosine <= 0.0 || cosine_t <= 0.0 || mu_t <= 0.0 {
            return Some(0.0);
        }
        let transmitted = transmittance(cosine, cosine_t, self.eta);
        let jacobian = self.eta * self.eta * cosine_t / (cosine - self.eta * cosine_t).powi(2);
        Some(cosine * jacobian * transmitted * masking * self.facets.d(h) / mu_t)
    }

    /// A direction in which light from `wo` goes on, up or down: `u[0]` and `u[1]` draw a visible facet, which reflects where
    /// `u[2]` is below its reflectance and else refracts. `None` where that ends on the wrong side.
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<DVec3> {
        let h = self.facets.sample_visible_normal(wo, [u[0], u[1]])?;
        let cosine = wo.dot(h).clamp(0.0, 1.0); // outside by rounding only: the normal is visible
        if u[2] < reflectance(cosine, self.eta) {
            let wi = reflect(wo, h);
            return (wi.z > 0.0).then_some(wi);
        }
        let wt = -wo / self.eta + (cosine / self.eta - refracted_cosine(cosine, self.eta)?) * h;
        (wt.z < 0.0).then_some(wt)
    }

    /// The density with which [`Dielectric::sample`] draws `w`, in 1/sr: for light that goes through Walter's eq. 17 turns the density of
    /// visible normals into one of directions.
    pub fn pdf(&self, wo: DVec3, w: DVec3) -> f64 {
        if w.z > 0.0 {
            let cosine = (0.5 * (wo + w).length()).min(1.0); // at most 1 but for rounding
            return self.facets.pdf(wo, w) * reflectance(cosine, self.eta);
        }
        let Some(h) = (-(wo + self.eta * w)).try_normalize() else { return 0.0 };
        let h = if h.z < 0.0 { -h } else { h };
        let (cosine, cosine_t) = (wo.dot(h), -w.dot(h));
        if cosine <= 0.0 || cosine_t <= 0.0 {
            return 0.0;
        }
        let visible = 2.0 * cosine * self.facets.d(h) / (wo.z + self.facets.l(wo));
        let jacobian = self.eta * self.eta * cosine_t / (cosine - self.eta * cosine_t).powi(2);
        visible * jacobian * transmittance(cosine, cosine_t, self.eta)
    }

    /// (F − F0)/(1 − F0) from the thinner side, `eta` above 1 and finite: what a generalised Schlick reflectance has for (1 − mu)⁵.
    #[inline]
    pub fn rise_outside(mu: f64, eta: f64) -> f64 {
        let f0 = f0_of_eta(eta);
        (reflectance_outside(mu, eta) - f0) / (1.0 - f0)
    }

    /// What one visible normal sends up and down, as parts of what comes in: the integrands of reflectance and transmittance
    /// over their density.
    #[inline]
    pub fn scattered_by(&self, wo: DVec3, h: DVec3) -> Option<[f64; 2]> {
        let ways = self.ways_at(wo, h)?;
        let f = reflectance(ways.cosine, self.eta);
        Some([f * ways.up, (1.0 - f) * ways.down])
    }

    /// What one visible normal sends up and down before reflectance divides it.
    #[inline]
    pub fn ways_at(&self, wo: DVec3, h: DVec3) -> Option<Ways> {
        let (smith, l_o) = (self.facets.smith, self.facets.l(wo));
        let cosine = wo.dot(h).clamp(0.0, 1.0); // outside by rounding only: the normal is visible
        let seen = 0.5 * (wo.z + l_o); // μo/G1
        let wi = reflect(wo, h);
        let up = if wi.z > 0.0 {
            let v = smith.visibility(self.facets.alpha_x, (wo.z, l_o), (wi.z, self.facets.l(wi)));
            4.0 * wi.z * v * seen
        } else {
            0.0
        };
        // Into an infinite index light goes along the facet's normal.
        let cosine_t = if self.eta == f64::INFINITY { Some(1.0) } else { refracted_cosine(cosine, self.eta) };
        let down = match cosine_t {
            None => 0.0,
            Some(cosine_t) => {
                let wt = -wo / self.eta + (cosine / self.eta - cosine_t) * h;
                if wt.z < 0.0 { smith.through((wo.z, l_o), (-wt.z, self.facets.l(wt)))? * seen } else { 0.0 }
            }
        };
        Some(Ways { cosine, cosine_t, up, down })
    }
}

/// Both ways on from a facet.
#[derive(Debug, Clone, Copy)]
pub struct Ways {
    /// The cosine of wo to the facet's normal.
    pub cosine: f64,
    /// That of the refracted direction on the other side; none where all is reflected.
    pub cosine_t: Option<f64>,
    /// What goes up, as a part of what comes in, if all is reflected.
    pub up: f64,
    /// What goes down if all is let through.
    pub down: f64,
}

impl Ways {
    /// Schlick's weight of the angle on the thinner side; 1 where all is reflected.
    #[inline]
    pub fn schlick_weight(&self) -> f64 {
        self.cosine_t.map_or(1.0, |cosine_t| schlick_weight(self.cosine.min(cosine_t)))
    }
}
