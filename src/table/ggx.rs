//! GGX reflection: the split sum and the albedos.
//!
//! With f the GGX lobe without Fresnel and Fc = (1 − wo·h)⁵, Schlick's reflectance F0 + (1 − F0) Fc splits the reflected
//! part of a uniform environment into F0·scale + bias:
//!
//! ```text
//! scale = ∫ (1 − Fc) f cosθ_i dω_i,     bias = ∫ Fc f cosθ_i dω_i,     E = scale + bias.
//! ```
//!
//! The limits are values, not clamps: alpha = 0 is the mirror, and at mu = 0 the integrals exist for every alpha > 0.
//! Where both are 0 the two limits differ for separable Smith; the mirror is taken.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity};
use crate::error::Result;
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::direction_with_cosine;
use crate::model::Lobe;
use crate::model::fresnel::schlick_weight;
use crate::model::ggx::{Ggx, Smith};
use std::f64::consts::LN_2;

const KARIS: &str =
    "Karis 2013, \"Real Shading in Unreal Engine 4\" (the split); Walter et al. 2007 and Heitz 2014 (the lobe)";
const KULLA_CONTY: &str = "Kulla and Conty 2017, \"Revisiting Physically Based Shading at Imageworks\"";

/// `ggx.scale`, `ggx.bias` and `ggx.albedo`.
#[derive(Debug)]
pub struct Split;

static SPLIT: [Quantity; 3] = [
    Quantity {
        name: "ggx.scale",
        summary: "split-sum scale: what multiplies F0 in the reflectance of GGX under a uniform environment",
        definition: "∫ (1 − (1 − wo·h)⁵) D G2 / (4 μo) dωi",
        source: KARIS,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "ggx.bias",
        summary: "split-sum bias: what is added to F0·scale",
        definition: "∫ (1 − wo·h)⁵ D G2 / (4 μo) dωi",
        source: KARIS,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "ggx.albedo",
        summary: "directional albedo E of GGX with F = 1; 1 − E is what single scattering loses",
        definition: "∫ D G2 / (4 μo) dωi = scale + bias",
        source: KULLA_CONTY,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        bounds: (0.0, 1.0),
    },
];

/// The part that Fc takes of what the perfect mirror reflects: scale 1 − Fc, bias Fc, albedo 1.
fn mirror(mu: f64) -> [f64; 3] {
    let fc = schlick_weight(mu);
    [1.0 - fc, fc, 1.0]
}

impl Family for Split {
    fn quantities(&self) -> &'static [Quantity] {
        &SPLIT
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let (mu, alpha) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?);
        if alpha == 0.0 {
            return Ok(mirror(mu).map(|v| Estimate::bound(v, f64::EPSILON)).into());
        }
        let [scale, bias] = quadrature::ggx_reflection(mu, alpha, model.smith, tolerance, |cosine| {
            let fc = schlick_weight(cosine);
            [1.0 - fc, fc]
        });
        Ok(vec![scale, bias, quadrature::ggx_albedo(mu, alpha, model.smith, tolerance)])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, alpha) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?);
        if alpha == 0.0 {
            return Ok(mirror(mu).map(|v| Estimate::sigma(v, 0.0)).into());
        }
        let (lobe, wo) = (Ggx::isotropic(alpha, model.smith), direction_with_cosine(mu));
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, t]| {
            let (v, stretch) = defensive_tail(t, TAIL * alpha * alpha);
            lobe.sample(wo, [u, v]).map_or([0.0; 3], |s| {
                let fc = schlick_weight((0.5 * (wo + s.wi).length()).min(1.0)); // at most 1 but for rounding
                [1.0 - fc, fc, 1.0].map(|fresnel| fresnel * s.weight * stretch)
            })
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let (Ok(mu), Ok(alpha)) = (at.get(Parameter::Mu), at.get(Parameter::Alpha)) else { return vec![] };
        let mut known = vec![];
        if alpha == 1.0 {
            let value = match model.smith {
                Smith::Correlated if mu == 0.0 => 1.0,
                Smith::Correlated => 1.0 - mu * (1.0 / mu).ln_1p(),
                Smith::Separable => 2.0 * (1.0 - LN_2) / (1.0 + mu),
            };
            known.push(Identity { quantity: 2, value, slack: 0.0, fact: "closed form of E at alpha = 1" });
        }
        if alpha <= mu * MIRROR_RATIO {
            for (quantity, value) in mirror(mu).into_iter().enumerate() {
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

/// How far inside the region of measure alpha² that a lobe loses its rim is resolved by Monte Carlo.
const TAIL: f64 = 0.01;

/// The mirror limit is a fact where alpha is at most this part of mu …
const MIRROR_RATIO: f64 = 0.01;
/// … and there each quantity is within this multiple of alpha/mu of the mirror's.
/// Measured over that whole region; a test scans it.
const MIRROR_SLACK: f64 = 0.5;

/// `ggx.albedo_avg`.
#[derive(Debug)]
pub struct Average;

static AVERAGE: [Quantity; 1] = [Quantity {
    name: "ggx.albedo_avg",
    summary: "average albedo E_avg of GGX with F = 1, weighted by the cosine",
    definition: "2 ∫ E(μ) μ dμ",
    source: KULLA_CONTY,
    parameters: &[Parameter::Alpha],
    bounds: (0.0, 1.0),
}];

impl Family for Average {
    fn quantities(&self) -> &'static [Quantity] {
        &AVERAGE
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let alpha = at.get(Parameter::Alpha)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::bound(1.0, f64::EPSILON)]);
        }
        Ok(vec![quadrature::ggx_albedo_average(alpha, model.smith, tolerance)])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let alpha = at.get(Parameter::Alpha)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::sigma(1.0, 0.0)]);
        }
        let lobe = Ggx::isotropic(alpha, model.smith);
        let (estimates, _) = integration.points3.integrate(integration.stop(), |[u, v, w]| {
            // The density 2 mu of the cosine is exactly the weight of the average.
            let wo = direction_with_cosine(u.sqrt());
            let (w, stretch) = defensive_tail(w, TAIL * alpha * alpha);
            [lobe.sample(wo, [v, w]).map_or(0.0, |s| s.weight * stretch)]
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let Ok(alpha) = at.get(Parameter::Alpha) else { return vec![] };
        let known = |value, fact| vec![Identity { quantity: 0, value, slack: 0.0, fact }];
        if alpha == 1.0 {
            let value = match model.smith {
                Smith::Correlated => 4.0 / 3.0 * (1.0 - LN_2),
                Smith::Separable => 4.0 * (1.0 - LN_2).powi(2),
            };
            return known(value, "closed form of E_avg at alpha = 1");
        }
        if alpha == 0.0 {
            return known(1.0, "perfect mirror at alpha = 0");
        }
        vec![]
    }
}
