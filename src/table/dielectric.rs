//! What a rough interface between two dielectrics reflects and lets through.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity};
use super::specular::TAIL;
use crate::error::{Error, Result};
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::direction_with_cosine;
use crate::math::quadrature::gauss_legendre;
use crate::model::dielectric::{Dielectric, reflectance};
use crate::model::ggx::Ggx;
use crate::model::smith::Smith;

const SOURCE: &str = "Walter et al. 2007 (BTDF, GGX); Heitz 2014 (G2); exact unpolarised Fresnel equations";

const NAMES: [[&str; 3]; 2] = [
    ["dielectric.reflectance", "dielectric.transmittance", "dielectric.albedo"],
    ["dielectric.reflectance_avg", "dielectric.transmittance_avg", "dielectric.albedo_avg"],
];

const fn row(average: usize, index: usize, summary: &'static str, definition: &'static str) -> Quantity {
    const PARAMETERS: [Parameter; 3] = [Parameter::Mu, Parameter::Alpha, Parameter::Eta];
    const WIDTH_AND_INDEX: [Parameter; 2] = [Parameter::Alpha, Parameter::Eta];
    let parameters: &'static [Parameter] = if average == 0 { &PARAMETERS } else { &WIDTH_AND_INDEX };
    Quantity {
        name: NAMES[average][index],
        summary,
        definition,
        source: SOURCE,
        parameters,
        monotone: &[],
        bounds: (0.0, 1.0),
    }
}

static DIRECTIONAL: [Quantity; 3] = [
    row(0, 0, "part of the light that a rough dielectric reflects", "∫ F D G2 / (4 μo) dωi"),
    row(
        0,
        1,
        "part of the light that a rough dielectric lets through",
        "∫ f_t μt dωt, Walter's BTDF without (n_t/n_i)² of radiance",
    ),
    row(0, 2, "reflectance plus transmittance of a rough dielectric; 1 − it is what single scattering loses", "R + T"),
];

static AVERAGE: [Quantity; 3] = [
    row(1, 0, "average reflectance of a rough dielectric, weighted by the cosine", "2 ∫ R(μ) μ dμ"),
    row(1, 1, "average transmittance of a rough dielectric, weighted by the cosine", "2 ∫ T(μ) μ dμ"),
    row(1, 2, "average albedo of a rough dielectric, weighted by the cosine", "R_avg + T_avg"),
];

/// The interface, if its masking is one that light can go through.
pub(super) fn interface(alpha: f64, eta: f64, model: &Model) -> Result<Dielectric> {
    match model.smith {
        Smith::Correlated | Smith::Separable | Smith::Beta => {
            Ok(Dielectric { facets: Ggx::isotropic(alpha, model.smith), eta })
        }
        other => Err(Error::usage(
            format!("{} Smith is made for reflection; nothing defines it for light that goes through", other.name()),
            "use --smith correlated, separable or beta",
        )),
    }
}

/// At these indices of refraction the interface is a mirror, and its facets reflect what GGX's do.
fn is_mirror(eta: f64) -> bool {
    eta == 0.0 || eta == f64::INFINITY
}

/// All is reflected.
fn mirror(albedo: Estimate) -> Vec<Estimate> {
    vec![albedo, Estimate::bound(0.0, 0.0), albedo]
}

/// Where nothing refracts but the grazing ray goes straight on, its masking has a limit: Λo = Λt grow without bound together,
/// and of G2/G1 = (1 + Λo)/(1 + Λo + Λt) there remains a half; of the other forms, nothing.
pub(super) fn grazing_through_nothing(smith: Smith) -> [f64; 3] {
    let through = if smith == Smith::Correlated { 0.5 } else { 0.0 };
    [0.0, through, through]
}

fn smooth(mu: f64, eta: f64) -> [f64; 3] {
    let f = reflectance(mu, eta);
    [f, 1.0 - f, 1.0]
}

/// `dielectric.reflectance`, `.transmittance` and `.albedo`.
#[derive(Debug)]
pub struct Directional;

impl Family for Directional {
    fn quantities(&self) -> &'static [Quantity] {
        &DIRECTIONAL
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let (mu, alpha, eta) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?, at.get(Parameter::Eta)?);
        let interface = interface(alpha, eta, model)?;
        if alpha == 0.0 {
            return Ok(smooth(mu, eta).map(|v| Estimate::bound(v, 4.0 * f64::EPSILON)).into());
        }
        if is_mirror(eta) {
            return Ok(mirror(quadrature::ggx_albedo(mu, alpha, interface.facets.smith, tolerance)));
        }
        if mu == 0.0 && eta == 1.0 {
            return Ok(grazing_through_nothing(model.smith).map(|v| Estimate::bound(v, 0.0)).into());
        }
        Ok(quadrature::dielectric_scattering(mu, &interface, tolerance).into())
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, alpha, eta) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?, at.get(Parameter::Eta)?);
        let interface = interface(alpha, eta, model)?;
        if alpha == 0.0 {
            return Ok(smooth(mu, eta).map(|v| Estimate::sigma(v, 4.0 * f64::EPSILON)).into());
        }
        if mu == 0.0 && eta == 1.0 {
            return Ok(grazing_through_nothing(model.smith).map(|v| Estimate::sigma(v, 0.0)).into());
        }
        let wo = direction_with_cosine(mu);
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, t]| {
            let (v, stretch) = defensive_tail(t, TAIL * alpha * alpha);
            let scattered =
                interface.facets.sample_visible_normal(wo, [u, v]).and_then(|h| interface.scattered_by(wo, h));
            scattered.map_or([0.0; 3], |[up, down]| [up, down, up + down].map(|x| x * stretch))
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let (Ok(mu), Ok(alpha), Ok(eta)) = (at.get(Parameter::Mu), at.get(Parameter::Alpha), at.get(Parameter::Eta))
        else {
            return vec![];
        };
        let mut known = vec![];
        if alpha == 0.0 {
            for (quantity, value) in smooth(mu, eta).into_iter().enumerate() {
                known.push(Identity { quantity, value, slack: 0.0, fact: "Fresnel at alpha = 0" });
            }
        } else if eta == 1.0 {
            known.push(Identity { quantity: 0, value: 0.0, slack: 0.0, fact: "nothing is reflected at eta = 1" });
            // wt = −wo at every visible facet: T is G2 of the two over G1.
            let l = (alpha * alpha * (1.0 - mu) * (1.0 + mu) + mu * mu).sqrt();
            if let Some(masking) = model.smith.through((mu, l), (mu, l)).filter(|_| mu > 0.0) {
                let value = masking * 0.5 * (mu + l);
                // The logarithms of gamma that make up Beta lose digits where Λ is large.
                let slack = 64.0 * f64::EPSILON * (1.0 + (l / mu) * (1.0 + l / mu).ln());
                known.push(Identity { quantity: 1, value, slack, fact: "only masking at eta = 1" });
            }
        }
        known
    }
}

/// `dielectric.reflectance_avg`, `.transmittance_avg` and `.albedo_avg`.
#[derive(Debug)]
pub struct Average;

/// 2 ∫ F μ dμ of a smooth interface, split at the critical angle, where F has a root.
fn smooth_average(eta: f64) -> [f64; 3] {
    let critical = (1.0 - eta * eta).max(0.0).sqrt();
    // mu² = critical² + x² takes the root out: mu dmu = x dx.
    let end = ((1.0 - critical) * (1.0 + critical)).sqrt();
    let rule = gauss_legendre(200);
    let f = critical * critical
        + 2.0
            * rule.integrate(|t| {
                // Denser near 0, where the cosines of a small |η − 1| meet.
                let x = end * t * t;
                2.0 * end * t * x * reflectance((critical * critical + x * x).sqrt(), eta)
            });
    [f, 1.0 - f, 1.0]
}

/// Rounding and truncation of the 200-point rule above: a test compares it with the reciprocity of the average.
const SMOOTH_ERROR: f64 = 1e-11;

impl Family for Average {
    fn quantities(&self) -> &'static [Quantity] {
        &AVERAGE
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let (alpha, eta) = (at.get(Parameter::Alpha)?, at.get(Parameter::Eta)?);
        let interface = interface(alpha, eta, model)?;
        if alpha == 0.0 {
            return Ok(smooth_average(eta).map(|v| Estimate::bound(v, SMOOTH_ERROR)).into());
        }
        if is_mirror(eta) {
            return Ok(mirror(quadrature::ggx_albedo_average(alpha, interface.facets.smith, tolerance)));
        }
        Ok(quadrature::dielectric_scattering_average(&interface, tolerance).into())
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (alpha, eta) = (at.get(Parameter::Alpha)?, at.get(Parameter::Eta)?);
        let interface = interface(alpha, eta, model)?;
        let estimates = integration.average_over_cosine(|wo, [v, w]| {
            if alpha == 0.0 {
                return smooth(wo.z, eta);
            }
            let (w, stretch) = defensive_tail(w, TAIL * alpha * alpha);
            let scattered =
                interface.facets.sample_visible_normal(wo, [v, w]).and_then(|h| interface.scattered_by(wo, h));
            scattered.map_or([0.0; 3], |[up, down]| [up, down, up + down].map(|x| x * stretch))
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, _model: &Model) -> Vec<Identity> {
        match (at.get(Parameter::Alpha), at.get(Parameter::Eta)) {
            (Ok(0.0), Ok(_)) => {
                vec![Identity { quantity: 2, value: 1.0, slack: 0.0, fact: "a smooth interface loses nothing" }]
            }
            (Ok(_), Ok(1.0)) => {
                vec![Identity { quantity: 0, value: 0.0, slack: 0.0, fact: "nothing is reflected at eta = 1" }]
            }
            _ => vec![],
        }
    }
}
