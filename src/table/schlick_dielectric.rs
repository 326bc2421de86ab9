//! Glass with Schlick's reflectance: what real-time renderers split of a rough interface, so that F0 may be chosen afterwards.
//!
//! With F = F0 + (F90 − F0) s, s = (1 − cosine)⁵ of the angle on the thinner side and 1 where all is reflected, the interface reflects
//! F0·scale + F90·bias, and lets (1 − F0)·transmittance through where F90 is 1.

use super::dielectric::{grazing_through_nothing, interface};
use super::parameter::cosine_about_critical;
use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity};
use super::specular::TAIL;
use crate::error::Result;
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::direction_with_cosine;
use crate::model::dielectric::schlick_smooth;

const SOURCE: &str = "Walter et al. 2007 (BTDF, GGX); Schlick 1994, eq. 15; the split as EEVEE tabulates it";

const fn row(index: usize, of_mu: bool) -> Quantity {
    const NAMES: [&str; 3] =
        ["schlick-dielectric.scale", "schlick-dielectric.bias", "schlick-dielectric.transmittance"];
    const SUMMARIES: [&str; 3] = [
        "what F0 scales of a rough dielectric's reflectance by Schlick, from either side",
        "what F90 scales of it: all of what is totally reflected",
        "what 1 − F0 scales of the light that goes through a rough dielectric",
    ];
    const DEFINITIONS: [&str; 3] = [
        "∫ (1 − s) f μi dωi, s = (1 − cosine)⁵ on the thinner side, 1 beyond the critical angle",
        "∫ s f μi dωi",
        "∫ (1 − s) f_t μt dωt, Walter's BTDF without F and without (n_t/n_i)² of radiance",
    ];
    const OF_MU: [Parameter; 3] = [Parameter::Mu, Parameter::Alpha, Parameter::Eta];
    const OF_PLACE: [Parameter; 3] = [Parameter::Critical, Parameter::Alpha, Parameter::Eta];
    let parameters: &'static [Parameter] = if of_mu { &OF_MU } else { &OF_PLACE };
    Quantity {
        name: NAMES[index],
        summary: SUMMARIES[index],
        definition: DEFINITIONS[index],
        source: SOURCE,
        parameters,
        monotone: &[],
        bounds: (0.0, 1.0),
    }
}

static OF_MU: [Quantity; 3] = [row(0, true), row(1, true), row(2, true)];
static OF_PLACE: [Quantity; 3] = [row(0, false), row(1, false), row(2, false)];

/// `schlick-dielectric.scale`, `.bias` and `.transmittance`.
#[derive(Debug)]
pub struct Directional;

impl Family for Directional {
    fn quantities(&self) -> &'static [Quantity] {
        &OF_MU
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let (mu, alpha, eta) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?, at.get(Parameter::Eta)?);
        let interface = interface(alpha, eta, model)?;
        if alpha == 0.0 {
            return Ok(schlick_smooth(mu, eta).map(|v| Estimate::bound(v, 8.0 * f64::EPSILON)).into());
        }
        Ok(quadrature::schlick_scattering(mu, &interface, tolerance).into())
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, alpha, eta) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?, at.get(Parameter::Eta)?);
        let interface = interface(alpha, eta, model)?;
        if alpha == 0.0 {
            return Ok(schlick_smooth(mu, eta).map(|v| Estimate::sigma(v, 8.0 * f64::EPSILON)).into());
        }
        let wo = direction_with_cosine(mu);
        // Where wo grazes the surface and goes straight on, the masking has a limit that no sample shows.
        let limit = (mu == 0.0 && eta == 1.0).then(|| grazing_through_nothing(model.smith)[1]);
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, t]| {
            let (v, stretch) = defensive_tail(t, TAIL * alpha * alpha);
            let ways = interface.facets.sample_visible_normal(wo, [u, v]).and_then(|h| interface.ways_at(wo, h));
            ways.map_or([0.0; 3], |ways| {
                let s = ways.schlick_weight();
                let down = limit.unwrap_or(ways.down);
                [(1.0 - s) * ways.up, s * ways.up, (1.0 - s) * down].map(|x| x * stretch)
            })
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, _model: &Model) -> Vec<Identity> {
        let (Ok(mu), Ok(0.0), Ok(eta)) = (at.get(Parameter::Mu), at.get(Parameter::Alpha), at.get(Parameter::Eta))
        else {
            return vec![];
        };
        let known = |(quantity, value)| Identity { quantity, value, slack: 0.0, fact: "Schlick at alpha = 0" };
        schlick_smooth(mu, eta).into_iter().enumerate().map(known).collect()
    }
}

/// The same over the place about the critical angle.
#[derive(Debug)]
pub struct AboutCritical;

/// The cosine for the place.
fn with_cosine(at: &Point) -> Result<Point> {
    let mu = cosine_about_critical(at.get(Parameter::Critical)?, at.get(Parameter::Eta)?);
    let mut point = *at;
    point.set(Parameter::Mu, mu.clamp(0.0, 1.0)); // outside by rounding only
    Ok(point)
}

impl Family for AboutCritical {
    fn quantities(&self) -> &'static [Quantity] {
        &OF_PLACE
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        Directional.quadrature(&with_cosine(at)?, model, tolerance)
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        Directional.monte_carlo(&with_cosine(at)?, model, integration)
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        with_cosine(at).map_or_else(|_| vec![], |at| Directional.identities(&at, model))
    }
}
