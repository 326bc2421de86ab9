//! The Lambertian: the simplest lobe, whose albedo is its colour from everywhere; and the cloth that Unity makes of it.

use super::fresnel::Pointwise;
use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity, Trend};
use crate::error::Result;
use crate::integrate::{Estimate, Integration};
use crate::math::frame::direction_with_cosine;
use crate::math::quadrature::gauss_legendre;
use crate::model::Lobe;
use crate::model::lambert::Lambert;
use glam::DVec3;

/// `lambert.albedo`.
#[derive(Debug)]
pub struct Lambertian;

static LAMBERT: [Quantity; 1] = [Quantity {
    name: "lambert.albedo",
    summary: "directional albedo of a Lambertian of colour 1: a furnace for the integrators",
    definition: "∫ 1/π cosθi dωi = 1",
    source: "Lambert 1760, Photometria (as every radiometry textbook gives it)",
    parameters: &[Parameter::Mu],
    monotone: &[],
    bounds: (1.0, 1.0),
}];

const WHITE: Lambert = Lambert { c: 1.0 };

impl Family for Lambertian {
    fn quantities(&self) -> &'static [Quantity] {
        &LAMBERT
    }

    fn quadrature(&self, at: &Point, _model: &Model, _tolerance: f64) -> Result<Vec<Estimate>> {
        let wo = direction_with_cosine(at.get(Parameter::Mu)?);
        let flux = |n| {
            gauss_legendre(n).integrate(|mu| {
                let wi = direction_with_cosine(mu);
                std::f64::consts::TAU * WHITE.f(wo.max(DVec3::Z * f64::MIN_POSITIVE), wi) * mu
            })
        };
        let (coarse, fine) = (flux(4), flux(8));
        Ok(vec![Estimate::bound(fine, (fine - coarse).abs() + 4.0 * f64::EPSILON)])
    }

    fn monte_carlo(&self, at: &Point, _model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let wo = direction_with_cosine(at.get(Parameter::Mu)?).max(DVec3::Z * f64::MIN_POSITIVE);
        let (estimates, _) =
            integration.points2.integrate(integration.stop(), |u| [WHITE.sample(wo, u).map_or(0.0, |s| s.weight)]);
        Ok(estimates.into())
    }

    fn identities(&self, _at: &Point, _model: &Model) -> Vec<Identity> {
        vec![Identity { quantity: 0, value: 1.0, slack: 0.0, fact: "a Lambertian of colour 1 reflects all" }]
    }
}

/// `fabric-lambert.albedo`.
pub static FABRIC: Pointwise = Pointwise {
    quantities: &[Quantity {
        name: "fabric-lambert.albedo",
        summary: "albedo of Unity's Lambertian for cloth, which darkens with the width; from everywhere the same",
        definition: "1 − α/2",
        source: "Unity's render pipelines, FabricLambert of BSDF.hlsl",
        parameters: &[Parameter::Alpha],
        monotone: &[(Parameter::Alpha, Trend::Falls)],
        bounds: (0.5, 1.0),
    }],
    values: |at| Ok(vec![1.0 - 0.5 * at.get(Parameter::Alpha)?]),
    epsilons: 1.0,
    known: |at| match at.get(Parameter::Alpha) {
        Ok(0.0) => vec![Identity { quantity: 0, value: 1.0, slack: 0.0, fact: "at alpha = 0 it is Lambert's" }],
        _ => vec![],
    },
};
