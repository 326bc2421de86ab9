//! The albedo of sheen, which real-time renderers scale the layer below it by.
//!
//! The limits are values where they exist: as alpha → 0 the fibres stand upright and reflect nothing from any direction above
//! the horizon. At the horizon itself the albedo grows without bound as alpha → 0; where both are 0 the upright fibres are taken.
//! The fitted Λ, being finite at the horizon, lets the albedo diverge there at every alpha: those points are errors.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity, Trend};
use crate::error::{Error, Result};
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::direction_with_cosine;
use crate::model::Lobe;
use crate::model::charlie::{Charlie, Visibility};
use std::f64::consts::PI;

const SOURCE: &str =
    "Estevez and Kulla 2017, \"Production Friendly Microfacet Sheen BRDF\", as KHR_materials_sheen gives it";

/// `charlie.albedo`.
#[derive(Debug)]
pub struct Directional;

static DIRECTIONAL: [Quantity; 1] = [Quantity {
    name: "charlie.albedo",
    summary: "directional albedo of the sheen with F = 1; above 1 at grazing angles, where the model gains energy",
    definition: "∫ D V μi dωi with D = (2 + 1/α) sin^(1/α)θ / 2π",
    source: SOURCE,
    parameters: &[Parameter::Mu, Parameter::Alpha],
    monotone: &[],
    bounds: (0.0, f64::INFINITY),
}];

/// The albedo where the width is 0 or the direction grazes, if it has one there.
fn limit(mu: f64, alpha: f64, visibility: Visibility) -> Result<Option<f64>> {
    if mu == 0.0 && visibility != Visibility::Neubelt {
        return Err(Error::unsupported(
            format!("charlie.albedo diverges at mu 0, alpha {alpha} with {} visibility", visibility.name()),
            "use a mu above 0, such as texel centres, or --visibility neubelt",
        ));
    }
    Ok((alpha == 0.0).then_some(0.0))
}

impl Family for Directional {
    fn quantities(&self) -> &'static [Quantity] {
        &DIRECTIONAL
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let (mu, alpha) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?);
        if let Some(value) = limit(mu, alpha, model.visibility)? {
            return Ok(vec![Estimate::bound(value, 0.0)]);
        }
        Ok(vec![quadrature::charlie_albedo(mu, &Charlie { alpha, visibility: model.visibility }, tolerance)])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, alpha) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?);
        if let Some(value) = limit(mu, alpha, model.visibility)? {
            return Ok(vec![Estimate::sigma(value, 0.0)]);
        }
        let (lobe, wo) = (Charlie { alpha, visibility: model.visibility }, direction_with_cosine(mu));
        let (estimates, _) =
            integration.points2.integrate(integration.stop(), |u| [lobe.sample(wo, u).map_or(0.0, |s| s.weight)]);
        Ok(estimates.into())
    }

    /// With Neubelt's visibility: at normal incidence θ_h = θ_i/2 and V = 1/4; at the horizon V μi = 1/4 and dω_i = 4 (wo·h) dω_h.
    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let (Ok(mu), Ok(alpha)) = (at.get(Parameter::Mu), at.get(Parameter::Alpha)) else { return vec![] };
        if model.visibility != Visibility::Neubelt || alpha == 0.0 {
            return vec![];
        }
        let n = 1.0 / alpha;
        if mu == 1.0 {
            let value = 2.0 / (n + 4.0) * (-0.5 * (n + 2.0)).exp2();
            return vec![Identity { quantity: 0, value, slack: 0.0, fact: "closed form of E at mu = 1" }];
        }
        if mu == 0.0 {
            let (above, below) = (libm::lgamma(0.5 * (n + 3.0)), libm::lgamma(0.5 * (n + 4.0)));
            let value = (n + 2.0) / (2.0 * PI.sqrt()) * (above - below).exp();
            let slack = value * 4.0 * f64::EPSILON * (1.0 + below.abs());
            return vec![Identity { quantity: 0, value, slack, fact: "closed form of E at mu = 0" }];
        }
        vec![]
    }
}

/// `charlie.albedo_avg`.
#[derive(Debug)]
pub struct Average;

static AVERAGE: [Quantity; 1] = [Quantity {
    name: "charlie.albedo_avg",
    summary: "average albedo of the sheen with F = 1, weighted by the cosine",
    definition: "2 ∫ E(μ) μ dμ",
    source: SOURCE,
    parameters: &[Parameter::Alpha],
    monotone: &[(Parameter::Alpha, Trend::Rises)],
    bounds: (0.0, 1.0),
}];

impl Family for Average {
    fn quantities(&self) -> &'static [Quantity] {
        &AVERAGE
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let alpha = at.get(Parameter::Alpha)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::bound(0.0, 0.0)]);
        }
        Ok(vec![quadrature::charlie_albedo_average(&Charlie { alpha, visibility: model.visibility }, tolerance)])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let alpha = at.get(Parameter::Alpha)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::sigma(0.0, 0.0)]);
        }
        let lobe = Charlie { alpha, visibility: model.visibility };
        // Upright fibres show at grazing angles alone, mu² ~ alpha: the square, in which the average is even, is drawn there as well.
        let (estimates, _) = integration.points3.integrate(integration.stop(), |[t, u, v]| {
            let (mu2, stretch) = defensive_tail(t, alpha);
            [lobe.sample(direction_with_cosine(mu2.sqrt()), [u, v]).map_or(0.0, |s| stretch * s.weight)]
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, _model: &Model) -> Vec<Identity> {
        match at.get(Parameter::Alpha) {
            Ok(0.0) => vec![Identity { quantity: 0, value: 0.0, slack: 0.0, fact: "upright fibres reflect nothing" }],
            _ => vec![],
        }
    }
}
