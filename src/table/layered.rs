//! Diffuse under specular: the directional albedo of a Lambertian base below a GGX lobe with Schlick's reflectance.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity};
use super::specular::{Specular, finer, propagate};
use crate::error::Result;
use crate::integrate::fresnel::schlick_under_cosine;
use crate::integrate::{Estimate, Integration};
use crate::math::frame::{direction_with_cosine, square_to_disk};
use crate::model::fresnel::schlick;
use crate::model::layered::Kd;
use glam::DVec3;

/// `layered.albedo`.
#[derive(Debug)]
pub struct Layered;

static LAYERED: [Quantity; 1] = [Quantity {
    name: "layered.albedo",
    summary: "directional albedo of a Lambertian base under GGX with Schlick's reflectance; what is off 1 for rho 1 is lost or gained",
    definition: "R + ∫ kd ρ/π cosθi dωi, R = F0 scale + bias, kd = 1 − F(wo·h), 1 − R(μo) or (1 − R(μo))(1 − R(μi))/(1 − R_avg)",
    source: "Kelemen and Szirmay-Kalos 2001, as Kulla and Conty 2017 use it (the reciprocal kd)",
    parameters: &[Parameter::Mu, Parameter::Alpha, Parameter::F0, Parameter::Rho],
    // With kd = 1 − F the sum can exceed 1, each part of it cannot.
    monotone: &[],
    bounds: (0.0, 2.0),
}];

/// The tolerance of each part, in parts of that of the sum.
const SHARE: f64 = 4.0;

impl Family for Layered {
    fn quantities(&self) -> &'static [Quantity] {
        &LAYERED
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let (specular, rho) = (Specular::at(at, model)?, at.get(Parameter::Rho)?);
        let [bias, e] = specular.split(tolerance / SHARE);
        let reflectance = |bias, e| specular.reflectance(bias, e);
        Ok(vec![match model.kd {
            Kd::Fresnel => {
                let under = schlick_under_cosine(specular.mu, tolerance / SHARE);
                propagate([bias, e, under], |[bias, e, under]| {
                    reflectance(bias, e) + rho * (1.0 - specular.f0) * (1.0 - under)
                })
            }
            // ∫ (1 − R(μi)) cosθi/π dωi = 1 − R_avg: both have the same albedo, though not the same lobe.
            Kd::Albedo | Kd::Reciprocal => propagate([bias, e], |[bias, e]| {
                let r = reflectance(bias, e);
                r + rho * (1.0 - r)
            }),
        }])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (specular, rho) = (Specular::at(at, model)?, at.get(Parameter::Rho)?);
        let stop = finer(integration.stop(), SHARE);
        let split = specular.split_by_samples(integration, stop);
        let reflectance = |bias, e| specular.reflectance(bias, e);
        Ok(vec![match model.kd {
            Kd::Fresnel => {
                let wo = direction_with_cosine(specular.mu);
                let ([base], _) = integration.points2.integrate(stop, |u| {
                    let (x, y) = square_to_disk(u);
                    let wi = DVec3::new(x, y, (1.0 - u[0]).sqrt());
                    let cosine = (0.5 * (wo + wi).length()).min(1.0); // at most 1 but for rounding
                    [1.0 - schlick(specular.f0, cosine)]
                });
                propagate([split[0], split[1], base], |[bias, e, base]| reflectance(bias, e) + rho * base)
            }
            Kd::Albedo => propagate(split, |[bias, e]| {
                let r = reflectance(bias, e);
                r + rho * (1.0 - r)
            }),
            Kd::Reciprocal => {
                // What the lobe's integral makes of 1 − R(μi), sampled, over the 1 − R_avg that it is normalised with.
                let [_, average] = specular.averages_by_samples(integration, stop);
                let norm = 1.0 - specular.reflectance_average(integration.tolerance() / SHARE).value;
                // A perfect white mirror leaves nothing to the base.
                let share = |average: f64| if norm > 0.0 { (1.0 - average) / norm } else { 0.0 };
                propagate([split[0], split[1], average], |[bias, e, average]| {
                    let r = reflectance(bias, e);
                    r + rho * (1.0 - r) * share(average)
                })
            }
        }])
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let white = at.get(Parameter::Rho).is_ok_and(|rho| rho == 1.0);
        if white && model.kd != Kd::Fresnel {
            return vec![Identity {
                quantity: 0,
                value: 1.0,
                slack: 0.0,
                fact: "a white base returns what specular leaves",
            }];
        }
        vec![]
    }
}

/// kd between two directions, its albedos integrated to `tolerance`: for those who want the lobe itself.
pub fn k_d(kd: Kd, specular: &Specular, wo: DVec3, wi: DVec3, tolerance: f64) -> f64 {
    let left = |mu: f64| {
        let at = Specular { mu, ..*specular };
        let [bias, e] = at.split(tolerance);
        1.0 - at.reflectance(bias.value, e.value)
    };
    match kd {
        Kd::Fresnel => 1.0 - schlick(specular.f0, (0.5 * (wo + wi).length()).min(1.0)), // at most 1 but for rounding
        Kd::Albedo => left(wo.z),
        Kd::Reciprocal => left(wo.z) * left(wi.z) / (1.0 - specular.reflectance_average(tolerance).value),
    }
}
