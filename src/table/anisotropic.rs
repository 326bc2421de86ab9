//! The albedo of GGX whose microfacets are wider along one tangent than along the other, by Monte Carlo.
//!
//! Its azimuth integral has no closed form; what stands beside the samples are its limits: with equal widths it is the isotropic
//! albedo, which quadrature knows, and a turn by a right angle exchanges the widths.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity};
use super::specular::TAIL;
use crate::error::{Error, Result};
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::model::ggx::{Ggx, Smith};
use glam::DVec3;

/// `ggx.albedo` of an anisotropic lobe.
#[derive(Debug)]
pub struct Directional;

static DIRECTIONAL: [Quantity; 1] = [Quantity {
    name: "ggx.albedo",
    summary: "the same of an anisotropic lobe, by Monte Carlo",
    definition: "∫ D G2 / (4 μo) dωi",
    source: "Heitz 2014, \"Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs\" (the lobe)",
    parameters: &[Parameter::Mu, Parameter::Phi, Parameter::AlphaX, Parameter::AlphaY],
    monotone: &[],
    bounds: (0.0, 1.0),
}];

/// The outgoing direction and the lobe.
fn configuration(at: &Point, model: &Model) -> Result<(DVec3, Ggx)> {
    let (mu, phi) = (at.get(Parameter::Mu)?, at.get(Parameter::Phi)?);
    let (alpha_x, alpha_y) = (at.get(Parameter::AlphaX)?, at.get(Parameter::AlphaY)?);
    if !matches!(model.smith, Smith::Correlated | Smith::Separable) {
        return Err(Error::usage(
            format!("{} Smith is made for one width; nothing defines it for two", model.smith.name()),
            "use --smith correlated or separable, or alpha instead of alpha_x and alpha_y",
        ));
    }
    let sin = ((1.0 - mu) * (1.0 + mu)).sqrt();
    let wo = DVec3::new(sin * libm::cos(phi), sin * libm::sin(phi), mu);
    Ok((wo, Ggx { alpha_x, alpha_y, smith: model.smith }))
}

impl Family for Directional {
    fn quantities(&self) -> &'static [Quantity] {
        &DIRECTIONAL
    }

    fn has_quadrature(&self) -> bool {
        false
    }

    fn quadrature(&self, at: &Point, model: &Model, _tolerance: f64) -> Result<Vec<Estimate>> {
        configuration(at, model)?;
        Err(Error::unsupported(
            "an anisotropic ggx.albedo by quadrature, which only Monte Carlo integrates",
            "use --integrator monte-carlo, or leave the integrator out",
        ))
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (wo, lobe) = configuration(at, model)?;
        let widest = lobe.alpha_x.max(lobe.alpha_y);
        if widest == 0.0 {
            return Ok(vec![Estimate::sigma(1.0, 0.0)]);
        }
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, t]| {
            let (v, stretch) = defensive_tail(t, TAIL * widest * widest);
            // The weight alone: a density has no value where one of the widths is 0.
            [lobe.sample_visible_normal(wo, [u, v]).map_or(0.0, |m| stretch * lobe.weight(wo, m))]
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let Ok((wo, lobe)) = configuration(at, model) else { return vec![] };
        if lobe.alpha_x != lobe.alpha_y {
            return vec![];
        }
        let isotropic = if lobe.alpha_x == 0.0 {
            Estimate::bound(1.0, 0.0)
        } else {
            quadrature::ggx_albedo(wo.z, lobe.alpha_x, model.smith, 1e-9)
        };
        vec![Identity {
            quantity: 0,
            value: isotropic.value,
            slack: isotropic.error,
            fact: "isotropic where the widths agree",
        }]
    }
}
