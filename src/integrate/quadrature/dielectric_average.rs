//! The averages of a rough dielectric, integrated over the facets and, around each, over the directions from which it is seen.
//!
//! Averaged over wo, the order of integration is free. With θ the angle of the facet's normal h to the surface's, β that of wo to h,
//! φ the azimuth of wo around h from the plane of both normals and β_t the angle of refraction,
//!
//! ```text
//! 2 ∫ R μo dμo = 2 ∫ D(θ) sinθ dθ ∫ F(β) cosβ sinβ dβ ∫ G2(μo, μi) dφ,      μo, μi = cosθ cosβ ± sinθ sinβ cosφ,
//! ```
//!
//! and the same for what goes through with 1 − F(β) and μt = cosθ cosβ_t + sinθ sinβ/η cosφ: D depends on θ alone and F on β alone,
//! so that nothing has a peak that moves. From β = π/2 − θ on a horizon cuts the circle of φ, where the integral over φ gets a term
//! of the power 3/2; beyond the critical angle F has a root of the distance. Both are ends of panels that the square of the variable
//! undoes, and where they meet is an end of the panels in θ. Everything else that is not smooth is G2 at cosines of ±iα/√(1 − α²), D at
//! θ = ±i atanh α, and Fresnel's root where η is nearly 1. What goes through is what comes back: T_avg(1/η) η² = T_avg(η), so that η is
//! above 1 there. Derived here; checked against the closed forms of η = 1 and of the mirrors, against the integral over wo of the
//! directional quantities, and against Monte Carlo.

use super::{Rung, Sum, Trust, climb_with};
use crate::integrate::Estimate;
use crate::model::dielectric::{Dielectric, reflectance, transmittance};
use crate::model::ggx::Ggx;
use crate::model::smith::Smith;
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

/// 2 ∫ … mu dmu of [reflectance, transmittance, their sum] of the interface.
///
/// Facets of equal width in all directions, in (0, 1], with a masking that light can go through; an index in (0, ∞).
pub fn dielectric_scattering_average(interface: &Dielectric, tolerance: f64) -> [Estimate; 3] {
    let Ggx { alpha_x, smith, .. } = interface.facets;
    let interface = Dielectric { facets: Ggx::isotropic(alpha_x.max(NARROWEST), smith), ..*interface };
    let average = Average::of(&interface);
    climb_with(TRUST, tolerance, |rung| {
        let [up, down] = average.scattered(rung);
        Sum { values: [up, down, up + down], defect: 0.0 }
    })
}

/// The width below which all lobes have the same average, which changes with the width itself: far below rounding.
const NARROWEST: f64 = 1e-20;
/// Rules of twice the digits on all floors leave more than one rung to spare.
const TRUST: Trust = Trust { safety: 4.0, lead: 8.0 };
/// Further than any angle or cosine.
const FAR: f64 = 10.0;
/// How near a facet that stands upright, where next to nothing is seen of it, the integral over θ must be resolved.
const UPRIGHT: f64 = 0.1;
/// How near its branch point, at the horizon itself, the Beta function must be resolved, in parts of the width.
const BRANCH: f64 = 1e-5;

/// An end of panels, and what is not smooth near it on either side.
#[derive(Clone, Copy)]
struct End {
    at: f64,
    above: Side,
    below: Side,
}

/// How near the next singularity is, and whether the end itself is one that a root undoes.
#[derive(Clone, Copy)]
struct Side {
    near: f64,
    root: bool,
}

fn plain(near: f64) -> Side {
    Side { near, root: false }
}

fn root(near: f64) -> Side {
    Side { near, root: true }
}

/// ∫ f over the panels between `ends`; `f` takes the position, and the end and the distance from it that it was computed from,
/// which are exact.
fn over_panels<const K: usize>(ends: &[End], rung: &Rung, f: impl Fn(f64, &End, f64) -> [f64; K]) -> [f64; K] {
    let mut sum = [0.0; K];
    for (i, panel) in ends.windows(2).enumerate() {
        let half = 0.5 * (panel[1].at - panel[0].at);
        if half <= 0.0 {
            continue;
        }
        let before = if i > 0 { panel[0].at - ends[i - 1].at } else { FAR };
        let after = ends.get(i + 2).map_or(FAR, |e| e.at - panel[1].at);
        for (end, side, sign, beyond) in
            [(&panel[0], panel[0].above, 1.0, before), (&panel[1], panel[1].below, -1.0, after)]
        {
            let near = side.near.min(beyond) / half;
            let scale = if side.root { near.sqrt() } else { near };
            for (x, w) in rung.doubled.at_scale(scale).iter() {
                let (t, weight) = if side.root { (x * x, 2.0 * x * w) } else { (x, w) };
                let t = sign * t * half;
                let values = f(end.at + t, end, t);
                for (sum, value) in sum.iter_mut().zip(values) {
                    *sum += half * weight * value;
                }
            }
        }
    }
    sum
}

/// The interface, and what of it is needed everywhere.
struct Average<'a> {
    interface: &'a Dielectric,
    alpha: f64,
    smith: Smith,
    /// The index from the thinner side.
    n: f64,
    /// α/√(1 − α²): the cosine, times i, at which G2 has its branch points.
    width: f64,
    /// The same as an angle, atanh α.
    angle: f64,
}

impl<'a> Average<'a> {
    fn of(interface: &'a Dielectric) -> Self {
        let (alpha, eta) = (interface.facets.alpha_x, interface.eta);
        let width = (alpha / ((1.0 - alpha) * (1.0 + alpha)).max(0.0).sqrt()).min(FAR);
        let n = if eta < 1.0 { 1.0 / eta } else { eta };
        Self { interface, alpha, smith: interface.facets.smith, n, width, angle: alpha.atanh().min(FAR) }
    }

    /// √(n² − 1), the cosine, times i, at which Fresnel's root vanishes; nothing vanishes where there is no interface.
    fn fresnel_root(&self) -> f64 {
        if self.n == 1.0 { FAR } else { ((self.n - 1.0) * (self.n + 1.0)).sqrt() }
    }

    /// The distance of F's first singularity beyond grazing incidence: its root, and the pole of r∥.
    fn beyond_grazing(&self) -> f64 {
        self.fresnel_root().min(1.0 / (self.n * self.n + 1.0).sqrt())
    }

    /// From the denser side, the critical angle and how near it F, as a function of the root of the distance, has its next
    /// singularities: Brewster's pole on the other sheet, and the cosine 0.
    fn critical(&self) -> Option<(f64, f64)> {
        let eta = self.interface.eta;
        (eta < 1.0).then(|| {
            let cos = ((1.0 - eta) * (1.0 + eta)).sqrt();
            let pole = eta.powi(3) / (2.0 * cos * (1.0 + eta * eta));
            (eta.asin(), pole.min(cos / (2.0 * eta)))
        })
    }

    /// The averages of what is reflected and of what goes through.
    fn scattered(&self, rung: &Rung) -> [f64; 2] {
        let eta = self.interface.eta;
        if eta < 1.0 {
            let [down] = self.over_outside(rung, |facet, circle| [self.through_circle(facet, circle, rung)]);
            return [self.reflected_inside(rung), eta * eta * down];
        }
        self.over_outside(rung, |facet, circle| {
            [self.reflected_by_circle(circle, rung), self.through_circle(facet, circle, rung)]
        })
    }

    /// 2 ∫ D sinθ ∫ f dβ dθ where F, as a function of β, is that of the thinner side.
    fn over_outside<const K: usize>(&self, rung: &Rung, f: impl Fn(&Facet, &Circle) -> [f64; K]) -> [f64; K] {
        let grazing = plain((0.5 * self.angle).min(self.beyond_grazing()));
        self.over_facets(None, rung, |facet| {
            // Of a circle wholly above the horizon, the lowest direction may come as near to the pole of G2 below it.
            let pole = self.pole(self.offset(facet, facet.sin));
            let horizon = End { below: plain(self.angle.min(pole)), ..facet.horizon(self.angle) };
            let ends = [facet.nearest_end(), horizon, End { at: FRAC_PI_2, above: plain(FAR), below: grazing }];
            over_panels(&ends, rung, |beta, end, t| f(facet, &Circle::new(facet, beta, end, t)))
        })
    }

    /// What is reflected where there is a critical angle.
    fn reflected_inside(&self, rung: &Rung) -> f64 {
        let Some((angle, near)) = self.critical() else { return 0.0 };
        // Where the horizon meets the critical angle.
        let side = plain(near.min(self.angle));
        let meeting = End { at: FRAC_PI_2 - angle, above: side, below: side };
        let [sum] = self.over_facets(Some(meeting), rung, |facet| {
            let above = plain(self.angle.hypot(angle - facet.horizon));
            let mut ends = [
                facet.nearest_end(),
                facet.horizon(self.angle),
                End { at: FRAC_PI_2, above: plain(FAR), below: plain(0.5 * self.angle) },
                End { at: angle, above, below: root(near) },
            ];
            ends.sort_by(|a, b| a.at.total_cmp(&b.at));
            over_panels(&ends, rung, |beta, end, t| [self.reflected_by_circle(&Circle::new(facet, beta, end, t), rung)])
        });
        sum
    }

    /// F cosβ sinβ ∫ G2 dφ, with wi and wo above the surface.
    fn reflected_by_circle(&self, circle: &Circle, rung: &Rung) -> f64 {
        // Of the circle, the quarter in which wi is the lower one of the two.
        let (end, near) = (circle.quarter(), if circle.is_cut { self.width } else { circle.lowest_and(self.width) });
        let both = 2.0 * circle.p;
        let g2 = match self.smith {
            Smith::Separable => circle.integrate(end, near, rung, |mu_i, one| {
                let mu_o = both * one - mu_i;
                (4.0 * mu_o * mu_i, (mu_o + self.l(mu_o, one)) * (mu_i + self.l(mu_i, one)))
            }),
            _ => circle.integrate(end, near, rung, |mu_i, one| {
                let mu_o = both * one - mu_i;
                (2.0 * mu_o * mu_i, mu_o * self.l(mu_i, one) + mu_i * self.l(mu_o, one))
            }),
        };
        4.0 * g2 * reflectance(circle.cos, self.interface.eta) * circle.cos * circle.sin
    }

    /// (1 − F) cosβ sinβ ∫ G2 dφ, with wo above the surface and wt below it, from the thinner side.
    fn through_circle(&self, facet: &Facet, circle: &Circle, rung: &Rung) -> f64 {
        let cos_t = self.refracted(circle.cos);
        let (offset, inverse) = (self.offset(facet, circle.cos), 1.0 / self.n);
        let (end, near) = (circle.end, self.beyond_horizon(circle, offset));
        let g2 = match self.smith {
            Smith::Correlated => circle.integrate(end, near, rung, |mu_o, one| {
                let mu_t = offset * one + mu_o * inverse;
                (2.0 * mu_o * mu_t, mu_t * self.l(mu_o, one) + mu_o * self.l(mu_t, one))
            }),
            Smith::Separable => circle.integrate(end, near, rung, |mu_o, one| {
                let mu_t = offset * one + mu_o * inverse;
                (4.0 * mu_o * mu_t, (mu_o + self.l(mu_o, one)) * (mu_t + self.l(mu_t, one)))
            }),
            other => circle.integrate(end, near, rung, |mu_o, one| {
                let mu_o = mu_o / one;
                let mu_t = offset + mu_o * inverse;
                (mu_o * other.through((mu_o, self.l(mu_o, 1.0)), (mu_t, self.l(mu_t, 1.0))).unwrap_or(0.0), 1.0)
            }),
        };
        2.0 * g2 * transmittance(circle.cos, cos_t, self.n) * circle.cos * circle.sin
    }

    /// How far in μo beyond the end of the circle G2 of light that goes through misbehaves: at its branch points; where the cosines
    /// are opposite, at μo = −offset/(1 + 1/n); the Beta function at the horizon.
    fn beyond_horizon(&self, circle: &Circle, offset: f64) -> f64 {
        if self.smith == Smith::Beta {
            return circle.lowest.max(BRANCH * self.width.min(1.0));
        }
        circle.lowest_and(self.width).min(circle.lowest + self.pole(offset))
    }

    /// How far below the horizon, in μo, the cosines are opposite: there G2 of light that goes through has its pole.
    fn pole(&self, offset: f64) -> f64 {
        // At n = 1 both cosines vanish together, and the pole with them.
        if self.n == 1.0 { FAR } else { offset / (1.0 + 1.0 / self.n) }
    }

    /// cosβ_t, from the thinner side.
    fn refracted(&self, cos: f64) -> f64 {
        ((self.n - 1.0) * (self.n + 1.0) + cos * cos).sqrt() / self.n
    }

    /// μt − μo/n, the same all around the facet.
    fn offset(&self, facet: &Facet, cos: f64) -> f64 {
        facet.cos * (self.refracted(cos) - cos / self.n).max(0.0) // below 0 by rounding only
    }

    /// 2 ∫ D sinθ f dθ over the facets.
    fn over_facets<const K: usize>(
        &self,
        meeting: Option<End>,
        rung: &Rung,
        f: impl Fn(&Facet) -> [f64; K],
    ) -> [f64; K] {
        let flat = plain(0.5 * self.angle.min(self.fresnel_root()));
        let mut ends = vec![
            End { at: 0.0, above: flat, below: plain(FAR) },
            End { at: FRAC_PI_2, above: plain(FAR), below: plain(UPRIGHT) },
        ];
        if let Some(end) = meeting {
            ends.insert(1, end);
        }
        let alpha2 = self.alpha * self.alpha;
        over_panels(&ends, rung, |theta, end, t| {
            let (sin, cos) = theta.sin_cos();
            let horizon = if end.at == FRAC_PI_2 { -t } else { FRAC_PI_2 - theta };
            let d = alpha2 / (PI * (alpha2 * cos * cos + sin * sin).powi(2));
            f(&Facet { sin, cos, horizon }).map(|value| 2.0 * d * sin * value)
        })
    }

    /// ℓ, of a cosine in parts of `one` and in the same parts.
    #[inline]
    fn l(&self, mu: f64, one: f64) -> f64 {
        (self.alpha * self.alpha * (one - mu) * (one + mu) + mu * mu).sqrt()
    }
}

/// A facet: the sine and cosine of θ, and π/2 − θ, the β from which on the horizon cuts the circle.
struct Facet {
    sin: f64,
    cos: f64,
    horizon: f64,
}

impl Facet {
    /// β = 0: everything is smooth there up to where the horizon is, mirrored.
    fn nearest_end(&self) -> End {
        End { at: 0.0, above: plain(self.horizon), below: plain(FAR) }
    }

    fn horizon(&self, angle: f64) -> End {
        End { at: self.horizon, above: root(angle.min(self.horizon)), below: plain(angle) }
    }
}

/// The directions at one β around a facet, from where they are lowest; t is the azimuth from there.
struct Circle {
    sin: f64,
    cos: f64,
    /// cosθ cosβ and sinθ sinβ.
    p: f64,
    q: f64,
    /// The sine and cosine of φ at the lowest direction above the surface, and the cosine to the surface's normal there.
    sin_end: f64,
    cos_end: f64,
    lowest: f64,
    /// tan(t/4) at the highest direction.
    end: f64,
    is_cut: bool,
}

impl Circle {
    #[inline]
    fn new(facet: &Facet, beta: f64, end: &End, t: f64) -> Self {
        let (sin, cos) = beta.sin_cos();
        let cos = if end.at == FRAC_PI_2 { (-t).sin() } else { cos };
        let beyond = if end.at == facet.horizon { t } else { beta - facet.horizon };
        let (p, q) = (facet.cos * cos, facet.sin * sin);
        if beyond <= 0.0 {
            let lowest = (-beyond).sin();
            return Self { sin, cos, p, q, sin_end: 0.0, cos_end: -1.0, lowest, end: 1.0, is_cut: false };
        }
        // cosφ = −p/q there, and q − p = sin(β + θ − π/2).
        let less = beyond.sin();
        let sin_end = (less * (q + p)).max(0.0).sqrt() / q;
        let cos_end = -p / q;
        let (sin_half, cos_half) = ((0.5 * (1.0 - cos_end)).sqrt(), (0.5 * less / q).max(0.0).sqrt());
        let end = sin_half / (1.0 + cos_half);
        Self { sin, cos, p, q, sin_end, cos_end, lowest: 0.0, end, is_cut: true }
    }

    /// tan(t/4) where the directions on both sides of h are equally high.
    #[inline]
    fn quarter(&self) -> f64 {
        if !self.is_cut {
            return SQRT_2 - 1.0;
        }
        let cos_half = (0.5 * (1.0 + self.sin_end)).sqrt();
        -0.5 * self.cos_end / (cos_half * (1.0 + cos_half))
    }

    /// ∫ f(μ) dt over the azimuths from the lowest direction to tan(t/4) = `end`, where f misbehaves at cosines so far `beyond`.
    ///
    /// In τ = tan(t/4), which makes sines and cosines rational: f takes μ (1 + τ²)², without cancellation, and (1 + τ²)², and returns a
    /// numerator and a denominator, so that there is one division.
    #[inline]
    fn integrate(&self, end: f64, beyond: f64, rung: &Rung, f: impl Fn(f64, f64) -> (f64, f64)) -> f64 {
        let near = 0.25 * self.in_azimuth(beyond);
        // tanh x is x/(1 + x) at least.
        let rule = rung.doubled.at_scale(near / ((1.0 + near) * end));
        let (sum, []) = rule.moments(|x| {
            let tau = end * x;
            let root = 1.0 + tau * tau;
            let one = root * root;
            // Of t/2, 2τ and (1 − τ)(1 + τ) are the sine and the cosine in parts of the root.
            let rise = 4.0 * self.q * tau * (self.sin_end * (1.0 - tau) * (1.0 + tau) - 2.0 * self.cos_end * tau);
            let (above, below) = f(self.lowest * one + rise, one);
            (above / (below * root), [])
        });
        4.0 * end * sum
    }

    /// The distance in azimuth of what is `beyond` the lowest cosine.
    #[inline]
    fn in_azimuth(&self, beyond: f64) -> f64 {
        let beyond = beyond / self.q;
        beyond / (self.sin_end * self.sin_end + 2.0 * beyond).sqrt().max(f64::MIN_POSITIVE)
    }

    /// The distance in the complex plane of the cosine i·`width` from the lowest one.
    #[inline]
    fn lowest_and(&self, width: f64) -> f64 {
        (self.lowest * self.lowest + width * width).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::fresnel::dielectric_average;

    #[test]
    fn polished_glass_has_the_average_of_smooth_glass() {
        for smith in [Smith::Correlated, Smith::Beta] {
            for eta in [1.0 / 1.5, 1.001] {
                let smooth = dielectric_average(eta, 1e-9);
                for alpha in [5e-324, 5.55e-17] {
                    let interface = Dielectric { facets: Ggx::isotropic(alpha, smith), eta };
                    let [up, _, both] = dielectric_scattering_average(&interface, 1e-7);
                    let place = format!("{smith:?} of index {eta} at alpha {alpha:e}: {up:?}, {both:?}");
                    assert!(up.error <= 1e-7 && both.error <= 1e-7, "{place}");
                    assert!((up.value - smooth.value).abs() <= up.error + smooth.error, "{place}: {smooth:?}");
                    assert!((both.value - 1.0).abs() <= both.error, "{place}");
                }
            }
        }
    }
}
