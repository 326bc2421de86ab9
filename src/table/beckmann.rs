//! Beckmann reflection: the split sum and the albedos, as for GGX (see [`super::ggx`]).

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity, Trend};
use crate::error::{Error, Result};
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::direction_with_cosine;
use crate::model::Lobe;
use crate::model::beckmann::Beckmann;
use crate::model::fresnel::schlick_weight;
use crate::model::smith::Smith;

const SOURCE: &str = "Walter et al. 2007 (the lobe, its exact masking); Heitz 2014 (G2); Karis 2013 (the split)";

/// `beckmann.scale`, `beckmann.bias` and `beckmann.albedo`.
#[derive(Debug)]
pub struct Split;

static SPLIT: [Quantity; 3] = [
    Quantity {
        name: "beckmann.scale",
        summary: "split-sum scale of Beckmann's lobe under a uniform environment",
        definition: "∫ (1 − (1 − wo·h)⁵) D G2 / (4 μo) dωi",
        source: SOURCE,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        monotone: &[],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "beckmann.bias",
        summary: "split-sum bias of Beckmann's lobe: what is added to F0·scale",
        definition: "∫ (1 − wo·h)⁵ D G2 / (4 μo) dωi",
        source: SOURCE,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        monotone: &[],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "beckmann.albedo",
        summary: "directional albedo E of Beckmann's lobe with F = 1",
        definition: "∫ D G2 / (4 μo) dωi = scale + bias",
        source: SOURCE,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        monotone: &[],
        bounds: (0.0, 1.0),
    },
];

/// The Fresnel factors of the three quantities, which are also what the perfect mirror reflects.
fn factors(mu: f64) -> [f64; 3] {
    let fc = schlick_weight(mu);
    [1.0 - fc, fc, 1.0]
}

/// The lobe, if its masking is one of the two that Beckmann's has.
fn lobe(alpha: f64, model: &Model) -> Result<Beckmann> {
    match model.smith {
        smith @ (Smith::Correlated | Smith::Separable) => Ok(Beckmann { alpha, smith }),
        other => Err(Error::usage(
            format!("{} Smith is an approximation for GGX, not for Beckmann", other.name()),
            "use --smith correlated or --smith separable",
        )),
    }
}

impl Family for Split {
    fn quantities(&self) -> &'static [Quantity] {
        &SPLIT
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let (mu, alpha) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?);
        let lobe = lobe(alpha, model)?;
        if alpha == 0.0 {
            return Ok(factors(mu).map(|v| Estimate::bound(v, f64::EPSILON)).into());
        }
        Ok(quadrature::beckmann_reflection(mu, &lobe, tolerance, factors).into())
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, alpha) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?);
        let lobe = lobe(alpha, model)?;
        if alpha == 0.0 {
            return Ok(factors(mu).map(|v| Estimate::sigma(v, 0.0)).into());
        }
        let wo = direction_with_cosine(mu);
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, t]| {
            let (v, stretch) = defensive_tail(t, TAIL);
            lobe.sample(wo, [u, 1.0 - v]).map_or([0.0; 3], |s| {
                let cosine = (0.5 * (wo + s.wi).length()).min(1.0); // at most 1 but for rounding
                factors(cosine).map(|factor| factor * s.weight * stretch)
            })
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let (Ok(mu), Ok(alpha)) = (at.get(Parameter::Mu), at.get(Parameter::Alpha)) else { return vec![] };
        let mut known = vec![];
        if alpha <= mu * MIRROR_RATIO {
            for (quantity, value) in factors(mu).into_iter().enumerate() {
                let slack = MIRROR_SLACK * alpha / mu.max(f64::MIN_POSITIVE);
                known.push(Identity { quantity, value, slack, fact: "perfect mirror as alpha → 0" });
            }
        }
        if mu == 0.0 && alpha > 0.0 && model.smith == Smith::Correlated {
            known.push(Identity {
                quantity: 2, value: 1.0, slack: 0.0, fact: "E → 1 as mu → 0 with correlated Smith"
            });
        }
        known
    }
}

/// The part of the Gaussian's tail that Monte Carlo resolves: normals further out, which send light below the horizon, are worth
/// less than its rounding.
const TAIL: f64 = 1e-12;

/// The mirror limit is a fact where alpha is at most this part of mu …
const MIRROR_RATIO: f64 = 0.01;
/// … and there each quantity is within this multiple of alpha/mu of the mirror's; a test scans that region.
const MIRROR_SLACK: f64 = 0.1;

/// `beckmann.albedo_avg`.
#[derive(Debug)]
pub struct Average;

static AVERAGE: [Quantity; 1] = [Quantity {
    name: "beckmann.albedo_avg",
    summary: "average albedo E_avg of Beckmann's lobe with F = 1, weighted by the cosine",
    definition: "2 ∫ E(μ) μ dμ",
    source: SOURCE,
    parameters: &[Parameter::Alpha],
    monotone: &[(Parameter::Alpha, Trend::Falls)],
    bounds: (0.0, 1.0),
}];

impl Family for Average {
    fn quantities(&self) -> &'static [Quantity] {
        &AVERAGE
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let alpha = at.get(Parameter::Alpha)?;
        let lobe = lobe(alpha, model)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::bound(1.0, f64::EPSILON)]);
        }
        Ok(vec![quadrature::beckmann_albedo_average(&lobe, tolerance)])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let alpha = at.get(Parameter::Alpha)?;
        let lobe = lobe(alpha, model)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::sigma(1.0, 0.0)]);
        }
        let estimates = integration.average_over_cosine(|wo, [v, w]| {
            let (w, stretch) = defensive_tail(w, TAIL);
            [lobe.sample(wo, [v, 1.0 - w]).map_or(0.0, |s| s.weight * stretch)]
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, _model: &Model) -> Vec<Identity> {
        match at.get(Parameter::Alpha) {
            Ok(0.0) => vec![Identity { quantity: 0, value: 1.0, slack: 0.0, fact: "perfect mirror at alpha = 0" }],
            _ => vec![],
        }
    }
}
