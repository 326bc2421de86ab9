//! Reflection and transmission of GGX facets weighted by functions of the angle between light and facet, which have seams there.
//!
//! In the cones around wo of `dielectric.rs` such a weight depends on β alone, so that its seams are ends of panels: at β = 0, where
//! a power of 1 − cosβ that is no integer begins, and where a weight that is cut off at 0 does.

use super::dielectric::{ANGLE, FAR, TRUST, View, in_reach};
use super::ggx::{albedo_on, reflection_on};
use super::limit::Limit;
use super::{Rung, Sum, climb_with};
use crate::integrate::Estimate;
use crate::model::dielectric::{Dielectric, schlick_smooth};
use crate::model::fresnel::schlick_weight;
use crate::model::ggx::{Ggx, Smith};

/// How near β = 0 a power must be resolved that begins there: what is nearer is of second order at least.
const POWER: f64 = 1e-4;

/// The index above which a dielectric's reflectance dips below that at normal incidence: 2 + √3.
const DIPS: f64 = 3.732_050_807_568_877;

/// ∫ (1 − wo·h)^p f cosθ_i dω_i over E, of GGX seen at cosine `mu`.
///
/// `mu` in [0, 1], `alpha` in (0, 1], the exponent finite.
pub fn ggx_power_weight(mu: f64, alpha: f64, smith: Smith, exponent: f64, tolerance: f64) -> Estimate {
    let at_axis = if exponent.fract() == 0.0 { FAR } else { POWER };
    part_of_albedo(mu, alpha, smith, tolerance, (0.0, at_axis), |_, below_one| below_one.powf(exponent))
}

/// ∫ max((F − F0)/(1 − F0), 0) f cosθ_i dω_i over E, with the reflectance F(wo·h) of a dielectric of index `eta`.
///
/// `mu` in [0, 1], `alpha` in (0, 1], `eta` above 1 and finite.
pub fn ggx_dielectric_weight(mu: f64, alpha: f64, smith: Smith, eta: f64, tolerance: f64) -> Estimate {
    let start = if eta > DIPS { dip_ends(eta).acos() } else { 0.0 };
    let weight = |cosine: f64, _: f64| Dielectric::rise_outside(cosine, eta).max(0.0);
    part_of_albedo(mu, alpha, smith, tolerance, (start, FAR), weight)
}

/// The cosine below which F is above F0 again: with x = cosβ and g = √(η² − 1 + x²), F is a rational function of both, and its
/// difference from F0 changes sign once between 0 and 1 where it dips. By bisection, to the last bit but a few.
fn dip_ends(eta: f64) -> f64 {
    let (mut above, mut below) = (0.0, brewster(eta));
    while below - above > 4.0 * f64::EPSILON * below {
        let middle = 0.5 * (above + below);
        if Dielectric::rise_outside(middle, eta) > 0.0 { above = middle } else { below = middle }
    }
    0.5 * (above + below)
}

/// The cosine of Brewster's angle, or 1 where F is above F0 there still and the dip lies beyond it.
fn brewster(eta: f64) -> f64 {
    let cosine = 1.0 / eta.hypot(1.0);
    if Dielectric::rise_outside(cosine, eta) < 0.0 {
        return cosine;
    }
    // The deepest place is between Brewster's angle and normal incidence: the first of even steps that is below 0.
    const STEPS: u32 = 4096;
    let step = (1.0 - cosine) / f64::from(STEPS);
    (1..STEPS).map(|i| cosine + step * f64::from(i)).find(|&c| Dielectric::rise_outside(c, eta) < 0.0).unwrap_or(1.0)
}

fn part_of_albedo(
    mu: f64,
    alpha: f64,
    smith: Smith,
    tolerance: f64,
    (start, at_axis): (f64, f64),
    weight: impl Fn(f64, f64) -> f64,
) -> Estimate {
    let smooth = |cosine| [weight(cosine, 1.0 - cosine)];
    let [part] = Limit::of(mu, alpha).scattering(smooth, |mu, alpha| {
        let interface = Dielectric { facets: Ggx::isotropic(alpha, smith), eta: 1.0 };
        climb_with(TRUST, tolerance, |rung| {
            let view = View::new(mu, &interface, rung).with_seams(start, at_axis);
            let weighted = view.reflected(|cone| weight(cone.cos, cone.below_one()));
            Sum { values: [weighted / albedo_on(mu, alpha, smith, &rung.rules).values[0]], defect: ANGLE }
        })
    });
    part
}

/// [∫ (1 − s) f, ∫ s f, ∫ (1 − s) f_t] of the interface seen at cosine `mu`, with Schlick's weight s of the angle on the thinner side, 1
/// where all is reflected.
///
/// `mu` in [0, 1]; facets of equal width in all directions, in (0, 1], with a masking that light can go through; any index, 0 and
/// infinity included.
pub fn schlick_scattering(mu: f64, interface: &Dielectric, tolerance: f64) -> [Estimate; 3] {
    in_reach(
        mu,
        interface,
        |mu| schlick_smooth(mu, interface.eta),
        |mu, interface| {
            climb_with(TRUST, tolerance, |rung| Sum { values: schlick_on(mu, interface, rung), defect: ANGLE })
        },
    )
}

fn schlick_on(mu: f64, interface: &Dielectric, rung: &Rung) -> [f64; 3] {
    let (eta, alpha, smith) = (interface.eta, interface.facets.alpha_x, interface.facets.smith);
    let view = View::new(mu, interface, rung);
    let passes = |cos: f64, cos_t: f64| 1.0 - schlick_weight(cos.min(cos_t));
    let albedo = albedo_on(mu, alpha, smith, &rung.rules).values[0];
    let (scale, bias) = if eta < 1.0 {
        let scale = view.reflected(|cone| passes(cone.cos, cone.cos_t));
        (scale, albedo - scale)
    } else {
        let bias = reflection_on(mu, alpha, smith, rung, |cosine| [schlick_weight(cosine)]).values[0];
        (albedo - bias, bias)
    };
    // At eta = 1 wo and wt graze the surface together: the limit of the masking is half of what it is where wt does not.
    let grazing = if mu == 0.0 && eta == 1.0 { 0.5 } else { 1.0 };
    [scale, bias, grazing * view.transmitted(|cone| passes(cone.cos, cone.cos_t))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::fresnel::f0_of_eta;

    #[test]
    fn a_reflectance_dips_below_normal_incidence_from_2_plus_root_3_on() {
        for eta in [DIPS * 1.001, 3.8, 4.5, 7.0, 14.5, 100.0] {
            let end = dip_ends(eta);
            assert!(0.0 < end && end < 1.0, "{eta}: {end}");
            for i in 1..1000 {
                let cosine = f64::from(i) / 1000.0;
                let rise = Dielectric::rise_outside(cosine, eta);
                // One rounding of F in parts of 1 − F0.
                let rounding = 8.0 * f64::EPSILON / (1.0 - f0_of_eta(eta));
                assert!(if cosine < end { rise > -rounding } else { rise < rounding }, "{eta} at {cosine}: {rise}");
            }
        }
        for eta in [1.001, 1.5, 3.0, DIPS * 0.999] {
            assert!((0..=1000).all(|i| Dielectric::rise_outside(f64::from(i) / 1000.0, eta) >= -1e-14), "{eta}");
        }
    }
}
