//! GGX with the exact Fresnel reflectance of a conductor.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity};
use super::specular::TAIL;
use crate::error::Result;
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::direction_with_cosine;
use crate::model::Lobe;
use crate::model::fresnel::{self, conductor};
use crate::model::ggx::{Ggx, Smith};

/// Whether F is smooth on [0, 1]: its branch point, μ² = 1 − (n + ik)², is not near. Metals are; what comes near is an index below 1
/// with little absorption, which has a critical angle, or nearly so.
fn is_smooth(n: f64, k: f64) -> bool {
    let (re, im) = (1.0 - n * n + k * k, 2.0 * n * k);
    // The real part of the root is at most √(|μ²|), so |μ²| > 2 keeps it off [0, 1] unless it is nearly imaginary.
    re < 0.0 || (re.hypot(im) > 2.0 && re > 0.0)
}

/// Tolerances of the two opinions where F is not smooth …
const COARSE: f64 = 1e-9;
const FINE: f64 = 1e-13;
/// … and what their difference is multiplied with.
const DISTRUST: f64 = 4.0;

/// `conductor.albedo`.
#[derive(Debug)]
pub struct Conductor;

static CONDUCTOR: [Quantity; 1] = [Quantity {
    name: "conductor.albedo",
    summary: "directional albedo of a rough conductor: GGX with exact Fresnel reflectance of index n + ik, single scattering",
    definition: "∫ F(wo·h; n, k) D G2 / (4 μo) dωi",
    source: "Walter et al. 2007 and Heitz 2014 (the lobe); Lagarde 2013, \"Memo on Fresnel equations\" (F)",
    parameters: &[Parameter::Mu, Parameter::Alpha, Parameter::N, Parameter::K],
    monotone: &[],
    bounds: (0.0, 1.0),
}];

/// mu, alpha, n, k.
fn values(at: &Point) -> Result<[f64; 4]> {
    Ok([at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?, at.get(Parameter::N)?, at.get(Parameter::K)?])
}

/// What a perfectly smooth surface reflects.
fn mirror(mu: f64, n: f64, k: f64, smith: Smith) -> f64 {
    conductor(mu, n, k) * smith.mirror(mu)
}

impl Family for Conductor {
    fn quantities(&self) -> &'static [Quantity] {
        &CONDUCTOR
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let [mu, alpha, n, k] = values(at)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::bound(mirror(mu, n, k, model.smith), 64.0 * f64::EPSILON)]);
        }
        let interface = fresnel::Conductor::new(n, k);
        let reflected = |tolerance| {
            let fresnel = |cosine| [interface.reflectance(cosine)];
            let [estimate] = quadrature::ggx_reflection(mu, alpha, model.smith, tolerance, fresnel);
            estimate
        };
        if is_smooth(n, k) {
            return Ok(vec![reflected(tolerance)]);
        }
        // The rules know the singularities of the lobe, not this one of F: that two of them agree proves less. The finest one is
        // taken, and held against one that is far coarser.
        let (coarse, fine) = (reflected(COARSE.min(tolerance)), reflected(FINE));
        let error = DISTRUST * (fine.value - coarse.value).abs() + fine.error;
        Ok(vec![Estimate::bound(fine.value, error)])
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let [mu, alpha, n, k] = values(at)?;
        if alpha == 0.0 {
            return Ok(vec![Estimate::sigma(mirror(mu, n, k, model.smith), 0.0)]);
        }
        let (lobe, wo) = (Ggx::isotropic(alpha, model.smith), direction_with_cosine(mu));
        let interface = fresnel::Conductor::new(n, k);
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, t]| {
            let (v, stretch) = defensive_tail(t, TAIL * alpha * alpha);
            let reflected = lobe.sample(wo, [u, v]).map_or(0.0, |s| {
                let cosine = (0.5 * (wo + s.wi).length()).min(1.0); // at most 1 but for rounding
                interface.reflectance(cosine) * s.weight
            });
            [reflected * stretch]
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let Ok([mu, alpha, n, k]) = values(at) else { return vec![] };
        let mut known = vec![];
        if alpha == 0.0 {
            let value = mirror(mu, n, k, model.smith);
            known.push(Identity { quantity: 0, value, slack: 0.0, fact: "F at alpha = 0" });
        }
        if n == 1.0 && k == 0.0 {
            known.push(Identity { quantity: 0, value: 0.0, slack: 0.0, fact: "no interface, no reflection" });
        }
        known
    }
}
