//! Rough dielectrics, integrated over the facets' normals h in cones around wo.
//!
//! With β the angle from wo to h and χ the azimuth around wo, the measure, the Fresnel factor and the angle by which light turns
//! depend on β alone, and everything else is linear in y = sin²(χ/2), with B = sinθ_o sinβ, d = β − θ_o and k = cosβ/η − cosβ_t:
//!
//! ```text
//! h_z = cos d − 2By,      μi = cos(2β − θ_o) − 4By cosβ,      μt = cos(β_t − d) + 2kBy.
//! ```
//!
//! So the horizons of wi, wt and h are ends of intervals in χ, and total internal reflection is an end of an interval in β. What
//! is left is graded for: D's pole at 2By = cos d − 1/√(1 − α²), G2's singularities a little beyond the horizon, and in β the
//! peak at θ_o; at the angles where a horizon enters or leaves the cone the integrals are analytic in the root of the distance.
//! What is reflected from the thinner side is integrated in the coordinates of GGX; from the denser side it is what GGX reflects
//! with F = 1 less what is not totally reflected. Derived here; checked against the reciprocity of the averages, against the BTDF
//! integrated over directions, and against Monte Carlo.

use super::ggx::{albedo_on, reflection_on};
use super::limit::Limit;
use super::{HalfAngle, Rung, Sum, Trust, climb_with, near_pole};
use crate::integrate::Estimate;
use crate::math::frame::{direction_with_cosine, elevation};
use crate::model::dielectric::{Dielectric, reflectance, reflectance_outside, refracted_cosine, transmittance};
use crate::model::ggx::Ggx;
use crate::model::smith::Smith;
use std::f64::consts::{FRAC_PI_2, PI};

/// [reflectance, transmittance, their sum] of the interface seen at cosine `mu`.
///
/// `mu` in [0, 1]; facets of equal width in all directions, in (0, 1], with a masking that light can go through.
pub fn dielectric_scattering(mu: f64, interface: &Dielectric, tolerance: f64) -> [Estimate; 3] {
    let smooth = |mu| {
        let up = reflectance(mu, interface.eta);
        [up, 1.0 - up, 1.0]
    };
    in_reach(mu, interface, smooth, |mu, interface| {
        climb_with(TRUST, tolerance, |rung| Sum { values: with_sum(scattering_on(mu, interface, rung)), defect: ANGLE })
    })
}

/// What `scattered` makes of the interface seen at cosine `mu`, or, where it cannot, of one next to that: see [`Limit`].
pub(super) fn in_reach<const K: usize>(
    mu: f64,
    interface: &Dielectric,
    smooth: impl Fn(f64) -> [f64; K],
    scattered: impl FnOnce(f64, &Dielectric) -> [Estimate; K],
) -> [Estimate; K] {
    let Ggx { alpha_x, smith, .. } = interface.facets;
    // The Beta function fades with a power of mu, and where nothing refracts only what is exactly 0 has a limit of its own.
    let is_flat = smith != Smith::Beta && interface.eta != 1.0;
    let limit = if is_flat { Limit::of(mu, alpha_x) } else { Limit::not_flat(mu, alpha_x) };
    limit.scattering(smooth, |mu, alpha| {
        scattered(mu, &Dielectric { facets: Ggx::isotropic(alpha, smith), eta: interface.eta })
    })
}

fn with_sum([up, down]: [f64; 2]) -> [f64; 3] {
    [up, down, up + down]
}

/// What the difference of two rungs is multiplied with to be a bound: more than elsewhere, since the singularities beyond the
/// horizons lie on the real axis, where a graded rule converges more slowly than its name says.
pub(super) const TRUST: Trust = Trust { safety: 20.0, lead: 4.0 };
/// Rounding of an angle near π/2, in parts of what the factor of safety makes of it.
pub(super) const ANGLE: f64 = 0.25 * f64::EPSILON;
/// How near its branch point, of second order or nearly, the Beta function must be resolved where it is at the horizon itself: in
/// cosines within a cone …
const BRANCH: f64 = 1e-5;
/// … and over the cones, in parts of a panel, where it is of higher order still.
const SEAM: f64 = 1e-6;

/// The part of alpha below which a cosine of wo makes no difference to where G2 misbehaves.
const FLATTEST: f64 = 1e-7;

/// A cosine that is as good as 0, but for the quotient of two that are.
const LOWEST: f64 = 1e-200;

/// Further than any y.
pub(super) const FAR: f64 = 10.0;

/// An angle β at which panels end, by its distances from everything near which it matters: where wo grazes the surface, they are far
/// smaller than the rounding of β itself.
#[derive(Clone, Copy)]
struct End {
    beta: f64,
    /// β − θ_o.
    past: f64,
    /// π/2 − β.
    left: f64,
}

/// What a cone of facets needs to know of itself.
pub(super) struct Cone {
    pub(super) cos: f64,
    sin: f64,
    /// Of d = β − θ_o, exact near the peak.
    sin_d: f64,
    cos_d: f64,
    /// 1 − cos d.
    nearest: f64,
    /// B = sinθ_o sinβ.
    b: f64,
    /// The cosine of the angle of refraction.
    pub(super) cos_t: f64,
}

impl Cone {
    fn transmittance(&self, eta: f64) -> f64 {
        transmittance(self.cos, self.cos_t, eta)
    }

    /// 1 − cosβ.
    pub(super) fn below_one(&self) -> f64 {
        self.sin * self.sin / (1.0 + self.cos)
    }
}

fn scattering_on(mu: f64, interface: &Dielectric, rung: &Rung) -> [f64; 2] {
    let (eta, facets) = (interface.eta, &interface.facets);
    let (alpha, smith) = (facets.alpha_x, facets.smith);
    let view = View::new(mu, interface, rung);
    let up = if eta == 1.0 {
        0.0
    } else if eta > 1.0 {
        // Fresnel's root is at (wo·h)² = 1 − η², further from the circle than where wo·h has its own.
        reflection_on(mu, alpha, smith, rung, |cosine| [reflectance_outside(cosine, eta)]).values[0]
    } else {
        // What total reflection returns is all but what it does not.
        albedo_on(mu, alpha, smith, &rung.rules).values[0] - view.reflected(|cone| cone.transmittance(eta))
    };
    [up, view.transmitted(|cone| cone.transmittance(eta))]
}

/// The direction wo and what it looks at.
pub(super) struct View<'a> {
    mu: f64,
    l: f64,
    e_o: f64,
    theta_o: f64,
    interface: &'a Dielectric,
    rung: &'a Rung,
    /// How near β = 0 must be resolved, where what is integrated has a seam of its own.
    at_axis: f64,
    /// Below this β there is nothing to integrate, and at it what is integrated begins.
    start: f64,
}

impl<'a> View<'a> {
    pub(super) fn new(mu: f64, interface: &'a Dielectric, rung: &'a Rung) -> Self {
        let (l, e_o) = (interface.facets.l(direction_with_cosine(mu)), elevation(mu));
        Self { mu, l, e_o, theta_o: FRAC_PI_2 - e_o, interface, rung, at_axis: FAR, start: 0.0 }
    }

    /// The same for a weight that vanishes below the angle `start`, and at β = 0 must be resolved to `at_axis`.
    pub(super) fn with_seams(self, start: f64, at_axis: f64) -> Self {
        Self { start, at_axis, ..self }
    }

    /// ∫ weight D G2/(4 μo) dω_i of what is reflected, as far as light refracts.
    pub(super) fn reflected(&self, weight: impl Fn(&Cone) -> f64) -> f64 {
        let highest = self.past_peak(0.5 * self.e_o);
        let critical = self.critical();
        let end = if critical.past < highest.past { critical } else { highest };
        self.over_cones([self.at(0.5 * self.e_o), highest], end, |cone| weight(cone) * self.mirrored(cone))
    }

    /// ∫ weight f_t μt dω_t without Fresnel factor, of what goes through.
    pub(super) fn transmitted(&self, weight: impl Fn(&Cone) -> f64) -> f64 {
        let (e_o, eta) = (self.e_o, self.interface.eta);
        // What refracts from along the surface, on the denser side, is bent up from it; Beta lets nothing through where Λ is infinite.
        if self.mu == 0.0 && (eta < 1.0 || self.interface.facets.smith == Smith::Beta) {
            return 0.0;
        }
        // Where the refracted ray of the facets towards the surface grazes it from below: β_t − β = π/2 − θ_o.
        let grazes = if eta < 1.0 { e_o.sin().atan2(1.0 / eta - e_o.cos()) } else { e_o };
        let seams = [self.at(e_o), self.at(grazes)];
        self.over_cones(seams, self.critical(), |cone| weight(cone) * self.through(cone))
    }

    fn at(&self, beta: f64) -> End {
        End { beta, past: beta - self.theta_o, left: FRAC_PI_2 - beta }
    }

    fn past_peak(&self, past: f64) -> End {
        End { beta: self.theta_o + past, past, left: self.e_o - past }
    }

    /// Where total reflection begins, or else the last of all angles.
    fn critical(&self) -> End {
        let eta = self.interface.eta;
        if eta < 1.0 { self.at(eta.asin()) } else { self.past_peak(self.e_o) }
    }

    fn alpha(&self) -> f64 {
        self.interface.facets.alpha_x
    }

    /// How far beyond the horizon G2 stays as it is, in cosines: up to its pole at the cosine −mu or, at mu = 0 where it has none,
    /// to its branch points.
    fn margin(&self) -> f64 {
        if self.mu == 0.0 { self.alpha() } else { self.alpha().min(self.mu.max(FLATTEST * self.alpha())) }
    }

    /// ∫ f dβ from 0 to `end`, where a horizon enters or leaves the cones at `seams`, and at `end` something else does.
    ///
    /// What enters is a part of the circle whose width grows as a root: f is analytic in the root of the distance, and
    /// β = seam ± length·t² undoes it. At θ_o the facets' peak is. Every rule is graded to what is nearest beyond its own end: the
    /// peak's poles, at θ_o ± i α or so, and other seams.
    fn over_cones(&self, seams: [End; 2], end: End, f: impl Fn(&Cone) -> f64) -> f64 {
        let mut ends = vec![(self.at(0.0), false), (self.past_peak(0.0), false), (end, true)];
        ends.extend(seams.map(|seam| (seam, true)));
        if self.start > 0.0 {
            ends.push((self.at(self.start), false));
        }
        ends.retain(|e| e.0.past <= end.past);
        ends.sort_by(|a, b| a.0.past.total_cmp(&b.0.past));
        ends.dedup_by(|b, a| {
            let same = a.0.past == b.0.past;
            a.1 |= same && b.1;
            same
        });
        // Beyond the critical angle, on the other sheet of its root, stands the pole of r∥: at cosβ_t = −η cosβ.
        let eta = self.interface.eta;
        let critical = self.critical();
        let pole = if eta < 1.0 && end.past == critical.past {
            eta.powi(3) / (2.0 * ((1.0 - eta) * (1.0 + eta)).sqrt() * (1.0 + eta * eta))
        } else {
            FAR
        };
        let width = 0.5 * self.alpha();
        let smallest = if self.interface.facets.smith == Smith::Beta { SEAM } else { 0.0 };
        let mut sum = 0.0;
        for (i, panel) in ends.windows(2).enumerate() {
            if panel[1].0.beta <= self.start {
                continue;
            }
            let half = 0.5 * (panel[1].0.past - panel[0].0.past);
            // Below β = 0 everything is mirrored.
            let before = if i > 0 { panel[0].0.past - ends[i - 1].0.past } else { panel[1].0.beta.min(self.at_axis) };
            let after = ends.get(i + 2).map_or(pole, |e| e.0.past - panel[1].0.past);
            for ((from, root), sign, beyond) in [(panel[0], 1.0, before), (panel[1], -1.0, after)] {
                let beyond = beyond.max(FLATTEST * self.alpha());
                let near = width.hypot(from.past).min(beyond).min(0.5 * self.margin()) / half;
                let scale = if root { near.sqrt().max(smallest) } else { near };
                for (x, w) in self.rung.doubled.at_scale(scale).iter() {
                    let (t, weight) = if root { (x * x, 2.0 * x * w) } else { (x, w) };
                    let t = sign * t * half;
                    let beta = from.beta + t;
                    let d = from.past + t;
                    let (sin, cos) = if beta < 1.0 {
                        beta.sin_cos()
                    } else {
                        let (cos, sin) = (from.left - t).sin_cos();
                        (sin, cos)
                    };
                    let (sin_d, cos_d, nearest) = if d < -1.0 {
                        // By its distance from −π/2, which is as exact as β where that is small.
                        let (sin, cos) = (beta + self.e_o).sin_cos();
                        (-cos, sin, 1.0 - sin)
                    } else {
                        let d = HalfAngle::of(d);
                        (d.sin(), d.cos(), 2.0 * d.sin_half * d.sin_half)
                    };
                    let b = (1.0 - self.mu * self.mu).max(0.0).sqrt() * sin;
                    let Some(cos_t) = self.refracted(cos, beta, (critical.beta - from.beta) - t) else { continue };
                    sum += half * weight * f(&Cone { cos, sin, sin_d, cos_d, nearest, b, cos_t });
                }
            }
        }
        sum
    }

    /// cosβ_t, so far `before` the critical angle; nothing beyond it.
    fn refracted(&self, cos: f64, beta: f64, before: f64) -> Option<f64> {
        let eta = self.interface.eta;
        if eta == f64::INFINITY {
            return Some(1.0); // the limit: along the facet's normal
        }
        if eta >= 1.0 {
            return refracted_cosine(cos, eta);
        }
        // η² − sin²β, of which the factor η − sinβ cancels in the cosines where the critical angle is small.
        let half = 0.5 * before;
        let less = 2.0 * (beta + half).cos() * half.sin();
        (less >= 0.0).then(|| (less * (2.0 * eta - less)).sqrt() / eta)
    }

    /// ∫ D (wo·h) G2/μo dχ sinβ over the cone, of light that is reflected.
    fn mirrored(&self, cone: &Cone) -> f64 {
        // cos(β + d)
        let highest = cone.cos * cone.cos_d - cone.sin * cone.sin_d;
        let slope = 4.0 * cone.b * cone.cos;
        let facets = &self.interface.facets;
        self.over_azimuth(cone, (0.0, FAR), (highest / slope, self.margin() / slope), |y| {
            let mu_i = (highest - slope * y).max(LOWEST); // below it by rounding only
            (4.0 * mu_i * facets.smith.visibility(self.alpha(), (self.mu, self.l), (mu_i, self.l_of(mu_i))), 1.0)
        })
    }

    /// ∫ D (wo·h) G2/μo dχ sinβ over the cone, of light that goes through.
    fn through(&self, cone: &Cone) -> f64 {
        let eta = self.interface.eta;
        let cos_t = cone.cos_t;
        let k = cone.cos / eta - cos_t;
        // cos(β_t − d)
        let first = if eta == 1.0 { self.mu } else { cos_t * cone.cos_d + cone.sin / eta * cone.sin_d };
        let slope = 2.0 * k * cone.b;
        let facing = cone.cos_d / (2.0 * cone.b);
        let smith = self.interface.facets.smith;
        // The Beta function has a branch point at the horizon itself, of second order or nearly.
        let margin = if smith == Smith::Beta { BRANCH } else { self.margin() };
        // From the denser side the horizon of wt cuts off the facets near the surface's normal, else those far from it.
        let (start, end) = if k > 0.0 {
            ((-first / slope, margin / slope), (facing, facing + 1.0))
        } else {
            ((0.0, FAR), (facing, (first + margin) / slope.abs() - facing))
        };
        let cosine = |y: f64| (first + slope * y).clamp(0.0, 1.0); // outside by rounding only
        let (mu, l) = (self.mu, self.l);
        match smith {
            // The limit, up to the horizon: there both cosines are 0.
            Smith::Correlated if mu == 0.0 => self.over_azimuth(cone, start, end, |_| (2.0, l)),
            Smith::Correlated => self.over_azimuth(cone, start, end, |y| {
                let mu_t = cosine(y);
                (2.0 * mu_t, mu_t * l + mu * self.l_of(mu_t))
            }),
            Smith::Separable => self.over_azimuth(cone, start, end, |y| {
                let mu_t = cosine(y);
                (4.0 * mu_t, (mu + l) * (mu_t + self.l_of(mu_t)))
            }),
            other => self.over_azimuth(cone, start, end, |y| {
                let mu_t = cosine(y);
                (other.through((mu, l), (mu_t, self.l_of(mu_t))).unwrap_or(0.0), 1.0)
            }),
        }
    }

    fn l_of(&self, mu: f64) -> f64 {
        (self.alpha() * self.alpha() * (1.0 - mu) * (1.0 + mu) + mu * mu).sqrt()
    }

    /// 2 sinβ cosβ ∫ D g(y) dχ over the part of the half circle where y is between the first of `start` and the first of `end`; the
    /// second of each is how far beyond g would misbehave.
    ///
    /// In τ = tan(χ/4), which makes y = (2τ/(1 + τ²))² rational and keeps D's pole on the imaginary axis. `g` is a numerator and a
    /// denominator, of one division with D.
    fn over_azimuth(&self, cone: &Cone, start: (f64, f64), end: (f64, f64), g: impl Fn(f64) -> (f64, f64)) -> f64 {
        let (low, high) = (start.0.clamp(0.0, 1.0), end.0.min(1.0));
        // A NaN here is 0/0: a cone without extent.
        if low.is_nan() || high.is_nan() || high <= low {
            return 0.0;
        }
        let alpha2 = self.alpha() * self.alpha();
        let (rest, nearest, rise) = (1.0 - alpha2, cone.nearest, 2.0 * cone.b);
        let integrand = |y: f64| {
            let s = nearest + rise * y; // 1 − h_z
            let r = alpha2 + rest * s * (2.0 - s);
            let (above, below) = g(y);
            above / (below * (r * r))
        };
        let root = rest.max(0.0).sqrt();
        let pole = near_pole(rise / (alpha2 / (root * (1.0 + root)) + nearest));
        let beyond_end = distance(high, end.1 + (end.0 - high));
        let sum = if low == 0.0 && high == 1.0 && beyond_end > CLEAR {
            self.rung.circle.at_scale(pole).moments::<0>(|y| (integrand(y), [])).0
        } else {
            let (from, to) = (quarter_tangent_of(low), quarter_tangent_of(high));
            let half = 0.5 * (to - from);
            let peak = pole.max(from);
            let at_start = if low > 0.0 { peak.min(distance(low, start.1)) } else { peak };
            let mut sum = 0.0;
            for (origin, step, scale) in [(from, half, at_start), (to, -half, beyond_end)] {
                let (part, []) = self.rung.rules.at_scale(scale / half).moments(|x| {
                    let tau = origin + step * x;
                    let q = 1.0 / (1.0 + tau * tau);
                    let y = 4.0 * tau * tau * q * q;
                    (4.0 * q * integrand(y), [])
                });
                sum += half * part;
            }
            sum
        };
        2.0 * cone.sin * cone.cos * alpha2 / PI * sum
    }
}

/// tan(χ/4) where y = sin²(χ/2).
fn quarter_tangent_of(y: f64) -> f64 {
    y.sqrt() / (1.0 + (1.0 - y).max(0.0).sqrt())
}

/// How far beyond the end of a whole circle, in τ, a singularity needs no rule of its own.
const CLEAR: f64 = 0.5;

/// The distance in τ = tan(χ/4) that `beyond` in y is from y = sin²(χ/2): dχ = dy/√(y (1 − y)) where that is not too far, and
/// dτ = (1 + τ²)/4 dχ.
fn distance(y: f64, beyond: f64) -> f64 {
    let beyond = beyond.clamp(0.0, FAR);
    let tau = quarter_tangent_of(y);
    0.25 * (1.0 + tau * tau) * beyond / (y * (1.0 - y) + beyond).sqrt().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polished_glass_has_its_values_down_to_the_horizon() {
        for smith in [Smith::Correlated, Smith::Separable, Smith::Beta] {
            for eta in [1.0 / 1.5, 1.001, 2.5] {
                for mu in [0.0, 1e-12, 0.0039, 1.0] {
                    for alpha in [1e-100, 5.55e-17, 3.6e-15, 1e-11] {
                        let interface = Dielectric { facets: Ggx::isotropic(alpha, smith), eta };
                        let found = dielectric_scattering(mu, &interface, 1e-7);
                        let place = format!("{smith:?} of index {eta} at mu {mu:e}, alpha {alpha:e}: {found:?}");
                        assert!(found.iter().all(|e| e.error <= 1e-7), "{place}");
                        let [up, down, both] = found.map(|e| e.value);
                        assert!((up + down - both).abs() <= 1e-12 && down >= -1e-7 && up >= -1e-7, "{place}");
                        // Far above the width all is as smooth glass has it; at the horizon, all that is not lost is reflected.
                        if mu > 1e9 * alpha {
                            let wanted = reflectance(mu, eta);
                            assert!((up - wanted).abs() < 1e-7 && (both - 1.0).abs() < 1e-7, "{place}: {wanted}");
                        }
                        if mu <= 1e-12 {
                            assert!(down < 1e-7, "{place}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn what_grazes_polished_glass_goes_through_in_proportion_to_the_cosine() {
        // 1 − F is linear in the cosine, to its square: 4η/√(η² − 1) wo·h, of whose lobe the heavy tail adds a logarithm.
        let through = |size: f64, eta: f64| {
            let interface = Dielectric { facets: Ggx::isotropic(1e-3 * size, Smith::Correlated), eta };
            dielectric_scattering(size, &interface, 1e-13)[1].value / size
        };
        for eta in [1.3_f64, 2.5] {
            let step = (eta * eta - 1.0).sqrt();
            let slope = 2.0 * (1.0 / step + eta * eta / step);
            for size in [1e-5, 1e-7, 1e-9] {
                let got = through(size, eta);
                // Of relative order (alpha/mu)² and mu.
                assert!((got - slope).abs() <= slope * (1e-4 + 10.0 * size), "{eta} at {size:e}: {got}, {slope}");
            }
        }
    }
}
