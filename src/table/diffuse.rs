//! Directional albedos of rough diffuse lobes: closed forms beside cosine-sampled Monte Carlo.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity, Trend};
use crate::error::Result;
use crate::integrate::{Estimate, Integration};
use crate::math::frame::direction_with_cosine;
use crate::model::Lobe;
use crate::model::burley::Burley;
use crate::model::oren_nayar::{Eon, Fujii, OrenNayar};
use glam::DVec3;

/// A diffuse lobe and its albedo in closed form.
pub struct Diffuse {
    quantities: &'static [Quantity],
    lobe: fn(&Point) -> Result<Box<dyn Lobe>>,
    albedo: fn(&Point, f64) -> Result<f64>,
    known: fn(&Point) -> Option<(f64, &'static str)>,
}

/// Roundings of the closed forms, in units of f64's epsilon: some twenty operations on numbers of order 1.
const EPSILONS: f64 = 16.0;

impl Family for Diffuse {
    fn quantities(&self) -> &'static [Quantity] {
        self.quantities
    }

    fn quadrature(&self, at: &Point, _model: &Model, _tolerance: f64) -> Result<Vec<Estimate>> {
        let albedo = (self.albedo)(at, at.get(Parameter::Mu)?)?;
        Ok(vec![Estimate::bound(albedo, EPSILONS * f64::EPSILON)])
    }

    fn monte_carlo(&self, at: &Point, _model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        // At mu = 0 the limit from above: the lobes themselves end at the horizon.
        let wo = direction_with_cosine(at.get(Parameter::Mu)?).max(DVec3::Z * f64::MIN_POSITIVE);
        let lobe = (self.lobe)(at)?;
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[t, u]| {
            let (mu2, stretch) = defend_horizon(t);
            [lobe.sample(wo, [1.0 - mu2, u]).map_or(0.0, |s| s.weight * stretch)]
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, _model: &Model) -> Vec<Identity> {
        let known = (self.known)(at).map(|(value, fact)| Identity { quantity: 0, value, slack: 0.0, fact });
        known.into_iter().collect()
    }
}

/// The square of an incident cosine and the reciprocal of its density: half of the points even in it (the cosine's own density),
/// half even in the cosine.
///
/// Seen from the horizon, Oren–Nayar lobes grow as the reciprocal of the incident cosine: by the cosine alone their variance would
/// be infinite.
fn defend_horizon(t: f64) -> (f64, f64) {
    let mu2 = if t < 0.5 { 2.0 * t } else { (2.0 * t - 1.0).powi(2) };
    (mu2, 1.0 / (0.5 + 0.25 / mu2.sqrt()))
}

/// Whether `parameter` is given and has that value.
fn is(at: &Point, parameter: Parameter, value: f64) -> bool {
    at.get(parameter).is_ok_and(|v| v == value)
}

fn burley(at: &Point, renormalised: bool) -> Result<Burley> {
    Ok(Burley { roughness: at.get(Parameter::Roughness)?, renormalised })
}

const PORTSMOUTH: &str = "Portsmouth, Kutz and Hill 2024, \"EON: A practical energy-preserving rough diffuse BRDF\"";

/// `burley.albedo`.
pub static BURLEY: Diffuse = Diffuse {
    quantities: &[Quantity {
        name: "burley.albedo",
        summary: "directional albedo of Disney's diffuse lobe of colour 1; above 1 at grazing angles when rough",
        definition: "∫ (1 + (F90 − 1)(1 − μo)⁵)(1 + (F90 − 1)(1 − μi)⁵)/π cosθi dωi, F90 = 1/2 + 2 roughness (wi·h)²",
        source: "Burley 2012, \"Physically Based Shading at Disney\"",
        parameters: &[Parameter::Mu, Parameter::Roughness],
        monotone: &[(Parameter::Roughness, Trend::Rises)],
        bounds: (0.488, 1.5576),
    }],
    lobe: |at| Ok(Box::new(burley(at, false)?)),
    albedo: |at, mu| Ok(burley(at, false)?.albedo(mu)),
    known: |_| None,
};

/// `burley-renormalized.albedo`.
pub static BURLEY_RENORMALIZED: Diffuse = Diffuse {
    quantities: &[Quantity {
        name: "burley-renormalized.albedo",
        summary: "directional albedo of Disney's diffuse lobe as Frostbite renormalises it",
        definition: "(1 − roughness (1 − 1/1.51)) times Burley's with F90 = roughness/2 + 2 roughness (wi·h)²",
        source: "Lagarde and de Rousiers 2014, \"Moving Frostbite to Physically Based Rendering\", sec. 3.1.3",
        parameters: &[Parameter::Mu, Parameter::Roughness],
        monotone: &[],
        bounds: (0.0, 1.0315),
    }],
    lobe: |at| Ok(Box::new(burley(at, true)?)),
    albedo: |at, mu| Ok(burley(at, true)?.albedo(mu)),
    known: |at| {
        // F90 = 0: both factors are 1 − (1 − μ)⁵, and 2 ∫ (1 − (1 − μ)⁵) μ dμ = 20/21.
        let mu = at.get(Parameter::Mu).ok()?;
        let value = 20.0 / 21.0 * (1.0 - (1.0 - mu).powi(5));
        is(at, Parameter::Roughness, 0.0).then_some((value, "20/21 (1 − (1 − μ)⁵) at roughness 0"))
    },
};

/// `oren-nayar.albedo`.
pub static OREN_NAYAR: Diffuse = Diffuse {
    quantities: &[Quantity {
        name: "oren-nayar.albedo",
        summary: "directional albedo of the qualitative Oren–Nayar lobe of colour 1; up to 1.015 at grazing angles",
        definition: "∫ (A + B sinα tanβ max(0, cosφ))/π cosθi dωi, A = 1 − σ²/2/(σ² + 0.33), B = 0.45 σ²/(σ² + 0.09)",
        source: "Oren and Nayar 1994, \"Generalization of Lambert's Reflectance Model\"",
        parameters: &[Parameter::Mu, Parameter::Sigma],
        // Above 1 at grazing incidence for small sigma: at most A + B/2 at sigma² = 0.04.
        monotone: &[(Parameter::Mu, Trend::Falls)],
        bounds: (0.5, 1.0153),
    }],
    lobe: |at| Ok(Box::new(OrenNayar { sigma: at.get(Parameter::Sigma)? })),
    albedo: |at, mu| Ok(OrenNayar { sigma: at.get(Parameter::Sigma)? }.albedo(mu)),
    known: |at| is(at, Parameter::Sigma, 0.0).then_some((1.0, "a Lambertian at sigma 0")),
};

/// `fujii.albedo`.
pub static FUJII: Diffuse = Diffuse {
    quantities: &[Quantity {
        name: "fujii.albedo",
        summary: "directional albedo of Fujii's improved Oren–Nayar lobe of colour 1",
        definition: "∫ A (1 + roughness s/t)/π cosθi dωi, A = 1/(1 + (1/2 − 2/(3π)) roughness)",
        source: "Fujii, \"A tiny improvement of Oren-Nayar reflectance model\"",
        parameters: &[Parameter::Mu, Parameter::Roughness],
        monotone: &[(Parameter::Mu, Trend::Falls), (Parameter::Roughness, Trend::Falls)],
        bounds: (0.75, 1.0),
    }],
    lobe: |at| Ok(Box::new(Fujii { roughness: at.get(Parameter::Roughness)? })),
    albedo: |at, mu| Ok(Fujii { roughness: at.get(Parameter::Roughness)? }.albedo(mu)),
    known: |at| {
        if is(at, Parameter::Roughness, 0.0) {
            return Some((1.0, "a Lambertian at roughness 0"));
        }
        is(at, Parameter::Mu, 0.0).then_some((1.0, "normalised to 1 at grazing incidence"))
    },
};

/// `eon.albedo`.
pub static EON: Diffuse = Diffuse {
    quantities: &[Quantity {
        name: "eon.albedo",
        summary: "directional albedo of the energy-preserving Oren–Nayar lobe; exactly 1 for rho 1",
        definition: "ρ E + ρ² E_avg/(1 − ρ (1 − E_avg)) (1 − E), E that of Fujii's lobe",
        source: PORTSMOUTH,
        parameters: &[Parameter::Mu, Parameter::Roughness, Parameter::Rho],
        monotone: &[
            (Parameter::Mu, Trend::Falls),
            (Parameter::Roughness, Trend::Falls),
            (Parameter::Rho, Trend::Rises),
        ],
        bounds: (0.0, 1.0),
    }],
    lobe: |at| Ok(Box::new(Eon { roughness: at.get(Parameter::Roughness)?, rho: at.get(Parameter::Rho)? })),
    albedo: |at, mu| Ok(Eon { roughness: at.get(Parameter::Roughness)?, rho: at.get(Parameter::Rho)? }.albedo(mu)),
    known: |at| {
        if is(at, Parameter::Rho, 1.0) {
            return Some((1.0, "white furnace: rho 1 reflects all"));
        }
        let rho = at.get(Parameter::Rho).ok()?;
        is(at, Parameter::Roughness, 0.0).then_some((rho, "a Lambertian at roughness 0"))
    },
};
