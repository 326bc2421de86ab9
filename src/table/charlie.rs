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
use crate::model::fresnel::schlick_weight;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

const SOURCE: &str =
    "Estevez and Kulla 2017, \"Production Friendly Microfacet Sheen BRDF\", as KHR_materials_sheen gives it";

/// `charlie.albedo` and `charlie.bias`.
#[derive(Debug)]
pub struct Directional;

const fn directional(name: &'static str, summary: &'static str, definition: &'static str) -> Quantity {
    Quantity {
        name,
        summary,
        definition,
        source: SOURCE,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        monotone: &[],
        bounds: (0.0, f64::INFINITY),
    }
}

static DIRECTIONAL: [Quantity; 2] = [
    directional(
        "charlie.albedo",
        "directional albedo of the sheen with F = 1; above 1 at grazing angles, where the model gains energy",
        "∫ D V μi dωi with D = (2 + 1/α) sin^(1/α)θ / 2π",
    ),
    directional(
        "charlie.bias",
        "what Schlick's F90 scales of the sheen: reflectance is F0·albedo + (F90 − F0)·bias",
        "∫ Fc D V μi dωi with Fc = (1 − wo·h)⁵",
    ),
];

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
            return Ok(vec![Estimate::bound(value, 0.0); 2]);
        }
        Ok(quadrature::charlie_split(mu, &Charlie { alpha, visibility: model.visibility }, tolerance).into())
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, alpha) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?);
        if let Some(value) = limit(mu, alpha, model.visibility)? {
            return Ok(vec![Estimate::sigma(value, 0.0); 2]);
        }
        let (lobe, wo) = (Charlie { alpha, visibility: model.visibility }, direction_with_cosine(mu));
        let (estimates, _) = integration.points2.integrate(integration.stop(), |u| {
            lobe.sample(wo, u).map_or([0.0; 2], |s| {
                let cosine = (0.5 * (wo + s.wi).length()).min(1.0); // at most 1 but for rounding
                [1.0, schlick_weight(cosine)].map(|fresnel| fresnel * s.weight)
            })
        });
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
            let mut known = vec![Identity { quantity: 0, value, slack: 0.0, fact: "closed form of E at mu = 1" }];
            if n == 2.0 {
                let fact = "closed form of the bias at mu = 1, alpha = 1/2";
                known.push(Identity { quantity: 1, value: bias_from_above(), slack: 8.0 * f64::EPSILON, fact });
            }
            return known;
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

/// The bias seen from above at n = 2, where it is 4 ∫ (1 − c²)(2c² − 1)(1 − c)⁵ c dc from 1/√2 to 1, of the cosine c = wo·h = h_z: with
/// x = 1 − c a polynomial of degree 10.
fn bias_from_above() -> f64 {
    let end = 1.0 - FRAC_1_SQRT_2;
    // (2x − x²)(1 − 4x + 2x²)(1 − x) = 2x − 11x² + 17x³ − 10x⁴ + 2x⁵
    let terms = [2.0, -11.0, 17.0, -10.0, 2.0];
    4.0 * terms.iter().zip(7..).map(|(term, power)| term * end.powi(power) / f64::from(power)).sum::<f64>()
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
