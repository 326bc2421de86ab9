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

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity, Trend};
use super::specular::TAIL;
use crate::error::Result;
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::direction_with_cosine;
use crate::model::Lobe;
use crate::model::fresnel::{f82_dip, schlick_weight};
use crate::model::ggx::{Ggx, Smith};
use std::f64::consts::LN_2;

const KARIS: &str =
    "Karis 2013, \"Real Shading in Unreal Engine 4\" (the split); Walter et al. 2007 and Heitz 2014 (the lobe)";
const KULLA_CONTY: &str = "Kulla and Conty 2017, \"Revisiting Physically Based Shading at Imageworks\"";

const F82: &str =
    "the F82 tint takes a multiple of x (1 − x)⁶ from Schlick's reflectance; integrated like this by Blender's EEVEE";

/// `ggx.scale`, `ggx.bias`, `ggx.albedo` and `ggx.f82`.
#[derive(Debug)]
pub struct Split;

static SPLIT: [Quantity; 4] = [
    Quantity {
        name: "ggx.scale",
        summary: "split-sum scale: what multiplies F0 in the reflectance of GGX under a uniform environment",
        definition: "∫ (1 − (1 − wo·h)⁵) D G2 / (4 μo) dωi",
        source: KARIS,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        monotone: &[],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "ggx.bias",
        summary: "split-sum bias: what is added to F0·scale",
        definition: "∫ (1 − wo·h)⁵ D G2 / (4 μo) dωi",
        source: KARIS,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        monotone: &[],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "ggx.albedo",
        summary: "directional albedo E of GGX with F = 1; 1 − E is what single scattering loses",
        definition: "∫ D G2 / (4 μo) dωi = scale + bias",
        source: KULLA_CONTY,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        monotone: &[],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "ggx.f82",
        summary: "what the tint at 82° takes from the reflectance, per unit of its coefficient",
        definition: "∫ (wo·h) (1 − wo·h)⁶ D G2 / (4 μo) dωi",
        source: F82,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        monotone: &[],
        bounds: (0.0, MOST_F82),
    },
];

/// The largest value of x (1 − x)⁶, at x = 1/7: 6⁶/7⁷.
const MOST_F82: f64 = 46656.0 / 823_543.0;

/// The Fresnel factors of the four quantities.
fn factors(mu: f64) -> [f64; 4] {
    let fc = schlick_weight(mu);
    [1.0 - fc, fc, 1.0, f82_dip(mu)]
}

/// The tolerance of E and bias, in parts of that of their difference.
const SHARE: f64 = 2.0;

/// What a perfectly smooth surface reflects.
fn mirror(mu: f64, smith: Smith) -> [f64; 4] {
    factors(mu).map(|factor| factor * smith.mirror(mu))
}

impl Family for Split {
    fn quantities(&self) -> &'static [Quantity] {
        &SPLIT
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let (mu, alpha) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?);
        if alpha == 0.0 {
            return Ok(mirror(mu, model.smith).map(|v| Estimate::bound(v, f64::EPSILON)).into());
        }
        let [e, bias, f82] = quadrature::ggx_split(mu, alpha, model.smith, tolerance / SHARE);
        let scale = Estimate::bound(e.value - bias.value, e.error + bias.error);
        Ok(vec![scale, bias, e, f82])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, alpha) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?);
        if alpha == 0.0 {
            return Ok(mirror(mu, model.smith).map(|v| Estimate::sigma(v, 0.0)).into());
        }
        let (lobe, wo) = (Ggx::isotropic(alpha, model.smith), direction_with_cosine(mu));
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, t]| {
            let (v, stretch) = defensive_tail(t, TAIL * alpha * alpha);
            lobe.sample(wo, [u, v]).map_or([0.0; 4], |s| {
                let cosine = (0.5 * (wo + s.wi).length()).min(1.0); // at most 1 but for rounding
                factors(cosine).map(|factor| factor * s.weight * stretch)
            })
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let (Ok(mu), Ok(alpha)) = (at.get(Parameter::Mu), at.get(Parameter::Alpha)) else { return vec![] };
        let mut known = vec![];
        if alpha == 1.0 {
            let value = match model.smith {
                Smith::Correlated | Smith::Beta | Smith::ApproxCorrelated if mu == 0.0 => 1.0,
                Smith::Correlated | Smith::Beta | Smith::ApproxCorrelated => 1.0 - mu * (1.0 / mu).ln_1p(),
                Smith::Separable | Smith::SchlickIbl | Smith::SchlickDirect => 2.0 * (1.0 - LN_2) / (1.0 + mu),
            };
            known.push(Identity { quantity: 2, value, slack: 0.0, fact: "closed form of E at alpha = 1" });
        }
        if alpha <= mu * MIRROR_RATIO {
            for (quantity, value) in mirror(mu, model.smith).into_iter().enumerate() {
                let slack = mirror_slack(alpha, mu, model.smith);
                known.push(Identity { quantity, value, slack, fact: "perfect mirror as alpha → 0" });
            }
        }
        if mu == 0.0 && alpha > 0.0 && matches!(model.smith, Smith::Correlated | Smith::Beta | Smith::ApproxCorrelated)
        {
            known.push(Identity {
                quantity: 2, value: 1.0, slack: 0.0, fact: "E → 1 as mu → 0 with correlated Smith"
            });
        }
        known
    }
}

/// The mirror limit is a fact where alpha is at most this part of mu …
const MIRROR_RATIO: f64 = 0.01;
/// … and there each quantity is within this of the mirror's: measured for the exact G2 over that whole region (a test scans it),
/// to which the approximate ones add the slope of their k.
fn mirror_slack(alpha: f64, mu: f64, smith: Smith) -> f64 {
    let ratio = alpha / mu.max(f64::MIN_POSITIVE);
    match smith {
        Smith::Correlated | Smith::Beta | Smith::Separable => 0.5 * ratio,
        Smith::SchlickIbl | Smith::ApproxCorrelated => 1.5 * ratio,
        Smith::SchlickDirect => 0.5 * ratio + alpha.sqrt(),
    }
}

/// `ggx.albedo_avg`.
#[derive(Debug)]
pub struct Average;

static AVERAGE: [Quantity; 1] = [Quantity {
    name: "ggx.albedo_avg",
    summary: "average albedo E_avg of GGX with F = 1, weighted by the cosine",
    definition: "2 ∫ E(μ) μ dμ",
    source: KULLA_CONTY,
    parameters: &[Parameter::Alpha],
    monotone: &[(Parameter::Alpha, Trend::Falls)],
    bounds: (0.0, 1.0),
}];

/// The average of what a perfectly smooth surface reflects.
///
/// For Schlick's G1² = μ²/(7μ/8 + 1/8)² that is 128 ∫ μ³/(7μ + 1)² dμ, which x = 7μ + 1 turns into powers of x.
fn mirror_average(smith: Smith) -> f64 {
    match smith {
        Smith::SchlickDirect => 128.0 / 2401.0 * (63.0 / 2.0 - 21.0 + 3.0 * 8.0_f64.ln() - 7.0 / 8.0),
        _ => 1.0,
    }
}

/// Rounding error of the closed form above, whose terms are below 2.
const MIRROR_ROUNDING: f64 = 4.0 * f64::EPSILON;

impl Family for Average {
    fn quantities(&self) -> &'static [Quantity] {
        &AVERAGE
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let alpha = at.get(Parameter::Alpha)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::bound(mirror_average(model.smith), MIRROR_ROUNDING)]);
        }
        Ok(vec![quadrature::ggx_albedo_average(alpha, model.smith, tolerance)])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let alpha = at.get(Parameter::Alpha)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::sigma(mirror_average(model.smith), MIRROR_ROUNDING)]);
        }
        let lobe = Ggx::isotropic(alpha, model.smith);
        let estimates = integration.average_over_cosine(|wo, [v, w]| {
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
                Smith::Correlated | Smith::Beta | Smith::ApproxCorrelated => 4.0 / 3.0 * (1.0 - LN_2),
                Smith::Separable | Smith::SchlickIbl | Smith::SchlickDirect => 4.0 * (1.0 - LN_2).powi(2),
            };
            return known(value, "closed form of E_avg at alpha = 1");
        }
        if alpha == 0.0 {
            return known(mirror_average(model.smith), "perfect mirror at alpha = 0");
        }
        vec![]
    }
}
