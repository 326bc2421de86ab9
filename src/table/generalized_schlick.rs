//! How far a rough surface's reflectance is from F0 to F90, where the Fresnel factor is F0 + (F90 − F0) w(wo·h).
//!
//! The directional albedo of GGX with that factor is E (F0 + (F90 − F0) s), with s the average of w over what is reflected: the number that
//! renderers tabulate, of powers of 1 − cosine and of the exact reflectance of a dielectric, which rises from F0 to 1 in its own way.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity, Trend};
use super::specular::{TAIL, propagate};
use crate::error::Result;
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::direction_with_cosine;
use crate::model::Lobe;
use crate::model::dielectric::Dielectric;
use crate::model::ggx::Ggx;

const SOURCE: &str = "MaterialX, generalized Schlick; Cycles, which tabulates both; GGX as Heitz 2014 has it";

/// A weight between F0 and F90: its limits by name, and how it is integrated.
pub struct Weight {
    quantities: &'static [Quantity],
    parameter: Parameter,
    /// The weight at a cosine, for every value of the parameter that has one.
    at: fn(f64, f64) -> f64,
    /// The average at an alpha above 0 where the parameter has an end.
    limit: fn(f64) -> Option<f64>,
    quadrature: fn([f64; 3], &Model, f64) -> Estimate,
}

/// `ggx.power_weight`.
pub static POWER: Weight = Weight {
    quantities: &[Quantity {
        name: "ggx.power_weight",
        summary: "average of (1 − cosine)^exponent over what GGX reflects: the part of the way from F0 to F90 of a generalised Schlick reflectance",
        definition: "∫ (1 − wo·h)^p f μi dωi / ∫ f μi dωi",
        source: SOURCE,
        parameters: &[Parameter::Mu, Parameter::Alpha, Parameter::Exponent],
        monotone: &[(Parameter::Exponent, Trend::Falls)],
        bounds: (0.0, 1.0),
    }],
    parameter: Parameter::Exponent,
    at: |mu, exponent| (1.0 - mu).powf(exponent),
    limit: |exponent| match exponent {
        0.0 => Some(1.0),
        f64::INFINITY => Some(0.0),
        _ => None,
    },
    quadrature: |[mu, alpha, exponent], model, tolerance| {
        quadrature::ggx_power_weight(mu, alpha, model.smith, exponent, tolerance)
    },
};

/// `ggx.dielectric_weight`.
pub static DIELECTRIC: Weight = Weight {
    quantities: &[Quantity {
        name: "ggx.dielectric_weight",
        summary: "average of (F − F0)/(1 − F0), at least 0, of a dielectric's exact reflectance F over what GGX reflects, from outside",
        definition: "∫ max(F − F0, 0)/(1 − F0) f μi dωi / ∫ f μi dωi; 0 at eta = 1 and infinity",
        source: SOURCE,
        parameters: &[Parameter::Mu, Parameter::Alpha, Parameter::Eta],
        monotone: &[],
        bounds: (0.0, 1.0),
    }],
    parameter: Parameter::Eta,
    at: |mu, eta| {
        if mu == 0.0 {
            1.0
        } else if ends(eta) {
            0.0
        } else {
            Dielectric::rise_outside(mu, outside(eta)).max(0.0)
        }
    },
    // At eta = 1 all is let through, and towards infinity F is below F0, but along the surface itself.
    limit: |eta| ends(eta).then_some(0.0),
    quadrature: |[mu, alpha, eta], model, tolerance| {
        quadrature::ggx_dielectric_weight(mu, alpha, model.smith, outside(eta), tolerance)
    },
};

/// An index below 1 is the same interface from the other side, and is looked at from the thinner one.
fn outside(eta: f64) -> f64 {
    if eta < 1.0 { 1.0 / eta } else { eta }
}

fn ends(eta: f64) -> bool {
    [0.0, 1.0, f64::INFINITY].contains(&eta)
}

impl Weight {
    fn values(&self, at: &Point) -> Result<[f64; 3]> {
        Ok([at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?, at.get(self.parameter)?])
    }

    /// The value where nothing is to be integrated: of a mirror, and where the parameter ends.
    fn known(&self, [mu, alpha, parameter]: [f64; 3]) -> Option<f64> {
        if alpha == 0.0 { Some((self.at)(mu, parameter)) } else { (self.limit)(parameter) }
    }
}

impl Family for Weight {
    fn quantities(&self) -> &'static [Quantity] {
        self.quantities
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let values = self.values(at)?;
        Ok(vec![match self.known(values) {
            Some(value) => Estimate::bound(value, 16.0 * f64::EPSILON),
            None => (self.quadrature)(values, model, tolerance),
        }])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let values = self.values(at)?;
        if let Some(value) = self.known(values) {
            return Ok(vec![Estimate::sigma(value, 16.0 * f64::EPSILON)]);
        }
        let [mu, alpha, parameter] = values;
        let (lobe, wo) = (Ggx::isotropic(alpha, model.smith), direction_with_cosine(mu));
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, t]| {
            let (v, stretch) = defensive_tail(t, TAIL * alpha * alpha);
            lobe.sample(wo, [u, v]).map_or([0.0; 2], |s| {
                let cosine = (0.5 * (wo + s.wi).length()).min(1.0); // at most 1 but for rounding
                [(self.at)(cosine, parameter), 1.0].map(|weight| weight * s.weight * stretch)
            })
        });
        Ok(vec![propagate(estimates, |[weighted, albedo]| weighted / albedo)])
    }

    fn identities(&self, at: &Point, _model: &Model) -> Vec<Identity> {
        let known = self.values(at).ok().and_then(|values| self.known(values));
        let fact = "a mirror's own weight, or an end of the parameter";
        known.map(|value| Identity { quantity: 0, value, slack: 0.0, fact }).into_iter().collect()
    }
}
