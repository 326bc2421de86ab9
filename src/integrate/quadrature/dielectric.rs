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
//! peak at θ_o and the angles where a horizon enters or leaves the cone. Derived here; checked against GGX's own coordinates, against
//! the BTDF integrated over directions, and against Monte Carlo.

use super::{Rung, Sum, climb_carefully};
use crate::integrate::Estimate;
use crate::math::frame::elevation;
use crate::model::dielectric::{Dielectric, reflectance, refracted_cosine, transmittance};
use crate::model::smith::Smith;
use std::f64::consts::{FRAC_PI_2, PI};

/// [reflectance, transmittance, their sum] of the interface seen at cosine `mu`.
///
/// `mu` in [0, 1]; facets of equal width in all directions, in (0, 1], with a masking that light can go through.
pub fn dielectric_scattering(mu: f64, interface: &Dielectric, tolerance: f64) -> [Estimate; 3] {
    climb_carefully(SAFETY, tolerance, |rung| Sum { values: with_sum(scattering_on(mu, interface, rung)), defect: 0.0 })
}

/// The same averaged over the hemisphere: 2 ∫ … mu dmu.
pub fn dielectric_scattering_average(interface: &Dielectric, tolerance: f64) -> [Estimate; 3] {
    let critical = (1.0 - interface.eta * interface.eta).max(0.0).sqrt();
    climb_carefully(SAFETY, tolerance, |rung| {
        let mut sum = [0.0; 2];
        for (low, high) in [(0.0, critical), (critical, 1.0)] {
            let half = 0.5 * (high - low);
            let scale = AVERAGE_SCALE * interface.facets.alpha_x / half;
            for (x, w) in rung.doubled.at_scale(scale).iter().filter(|_| half > 0.0) {
                for mu in [low + x * half, high - x * half] {
                    let values = scattering_on(mu, interface, rung);
                    sum = [0, 1].map(|k| sum[k] + 2.0 * half * w * mu * values[k]);
                }
            }
        }
        Sum { values: with_sum(sum), defect: 0.0 }
    })
}

fn with_sum([up, down]: [f64; 2]) -> [f64; 3] {
    [up, down, up + down]
}

/// What the difference of two rungs is multiplied with to be a bound: more than elsewhere, since the singularities beyond the
/// horizons lie on the real axis, where a graded rule converges more slowly than its name says.
const SAFETY: f64 = 20.0;
/// How far below alpha the average must resolve the horizon and the critical angle.
const AVERAGE_SCALE: f64 = 1e-4;
/// How near the angles where a horizon enters a cone, or total reflection sets in, the integrand must be resolved: what is left
/// there is of order 3/2.
const SEAM: f64 = 1e-8;

/// How near a branch point of second order must be resolved, in cosines.
const BRANCH: f64 = 1e-5;

/// Further than any y.
const FAR: f64 = 10.0;

/// What a cone of facets needs to know of itself.
struct Cone {
    cos: f64,
    sin: f64,
    /// β − θ_o, exact near the peak.
    d: f64,
}

fn scattering_on(mu: f64, interface: &Dielectric, rung: &Rung) -> [f64; 2] {
    let (e_o, eta) = (elevation(mu), interface.eta);
    let theta_o = FRAC_PI_2 - e_o;
    let view = View { mu, sin: e_o.cos(), interface, rung };
    let critical = if eta < 1.0 { eta.asin() } else { FRAC_PI_2 };
    let enters = 0.5 * e_o;
    let up = over_cones(
        &[0.0, enters, theta_o, critical.min(enters + theta_o), enters + theta_o],
        &view,
        |cone, rule_weight| view.reflected(cone, theta_o) * rule_weight,
    );
    // Where the refracted ray of the facets towards the surface grazes it from below: β_t − β = π/2 − θ_o.
    let grazes = if eta < 1.0 { (e_o.sin()).atan2(1.0 / eta - e_o.cos()) } else { e_o };
    let down = over_cones(&[0.0, e_o, theta_o, grazes, critical], &view, |cone, rule_weight| {
        if cone.sin >= eta { 0.0 } else { view.transmitted(cone) * rule_weight }
    });
    [up, down]
}

/// ∫ dβ over intervals between `seams`, each graded towards both ends.
fn over_cones(seams: &[f64], view: &View, f: impl Fn(&Cone, f64) -> f64) -> f64 {
    let mut seams = seams.to_vec();
    let end = seams[seams.len() - 1];
    seams.retain(|s| *s <= end);
    seams.sort_by(f64::total_cmp);
    let theta_o = FRAC_PI_2 - elevation(view.mu);
    let width = 0.5 * view.interface.facets.alpha_x;
    let mut sum = 0.0;
    for pair in seams.windows(2) {
        let half = 0.5 * (pair[1] - pair[0]);
        if half <= 0.0 {
            continue;
        }
        for (from, sign) in [(pair[0], 1.0), (pair[1], -1.0)] {
            let scale = if from == 0.0 { width } else { SEAM.min(width) };
            for (x, w) in view.rung.doubled.at_scale(scale / half).iter() {
                let t = sign * x * half;
                let beta = from + t;
                let d = if from == theta_o { t } else { beta - theta_o };
                sum += f(&Cone { cos: beta.cos(), sin: beta.sin(), d }, w * half);
            }
        }
    }
    sum
}

/// The direction wo and what it looks at.
struct View<'a> {
    mu: f64,
    sin: f64,
    interface: &'a Dielectric,
    rung: &'a Rung,
}

impl View<'_> {
    fn alpha(&self) -> f64 {
        self.interface.facets.alpha_x
    }

    fn l(&self, mu: f64) -> f64 {
        (self.alpha().powi(2) * (1.0 - mu) * (1.0 + mu) + mu * mu).sqrt()
    }

    /// How far beyond the horizon G2 stays as it is, in cosines.
    fn margin(&self) -> f64 {
        self.alpha().min(self.mu.max(1e-3 * self.alpha()))
    }

    /// ∫ F D (wo·h) G2/μo dχ sinβ over the cone.
    fn reflected(&self, cone: &Cone, theta_o: f64) -> f64 {
        let facets = &self.interface.facets;
        let (b, highest, o) = (self.sin * cone.sin, (2.0 * cone.d + theta_o).cos(), (self.mu, self.l(self.mu)));
        let slope = 4.0 * b * cone.cos;
        let (last, beyond) = (highest / slope, (highest + self.margin()) / slope);
        let f = reflectance(cone.cos, self.interface.eta);
        f * self.over_azimuth(cone, b, (0.0, 0.0), (last, beyond), |y| {
            let mu_i = (highest - slope * y).max(0.0); // below 0 by rounding only
            4.0 * mu_i * facets.smith.visibility(self.alpha(), o, (mu_i, self.l(mu_i)))
        })
    }

    /// ∫ (1 − F) D (wo·h) G2/μo dχ sinβ over the cone, which must not reflect all.
    fn transmitted(&self, cone: &Cone) -> f64 {
        let eta = self.interface.eta;
        let Some(cos_t) = refracted_cosine(cone.cos, eta) else { return 0.0 };
        let (b, o) = (self.sin * cone.sin, (self.mu, self.l(self.mu)));
        let k = cone.cos / eta - cos_t;
        // cos(β_t − d)
        let first = cos_t * cone.d.cos() + cone.sin / eta * cone.d.sin();
        let slope = 2.0 * k * b;
        let facing = cone.d.cos() / (2.0 * b);
        // The Beta function has a branch point at the horizon itself, of second order or nearly.
        let margin = if self.interface.facets.smith == Smith::Beta { BRANCH } else { self.margin() };
        // From the denser side the horizon of wt cuts off the facets near the surface's normal, else those far from it.
        let (start, end) = if k > 0.0 {
            ((-first / slope, -(first + margin) / slope), (facing, 2.0 * facing + 1.0))
        } else {
            ((0.0, 0.0), (facing, (first + margin) / slope.abs()))
        };
        let smith = self.interface.facets.smith;
        transmittance(cone.cos, cos_t, eta)
            * self.over_azimuth(cone, b, start, end, |y| {
                let mu_t = (first + slope * y).clamp(0.0, 1.0); // outside by rounding only
                smith.through(o, (mu_t, self.l(mu_t))).unwrap_or(0.0)
            })
    }

    /// 2 sinβ cosβ ∫ D g(y) dχ over the part of the half circle where y is between the first of `start` and the first of `end`; the
    /// second of each is where g would misbehave.
    fn over_azimuth(&self, cone: &Cone, b: f64, start: (f64, f64), end: (f64, f64), g: impl Fn(f64) -> f64) -> f64 {
        let (low, high) = (start.0.clamp(0.0, 1.0), end.0.min(1.0));
        // A NaN here is 0/0: a cone without extent.
        if low.is_nan() || high.is_nan() || high <= low {
            return 0.0;
        }
        let alpha2 = self.alpha().powi(2);
        let root = (1.0 - alpha2).max(0.0).sqrt();
        let sin_half = (0.5 * cone.d).sin();
        let nearest = 2.0 * sin_half * sin_half; // 1 − cos d
        let pole = (alpha2 / (root * (1.0 + root)) + nearest) / (2.0 * b);
        let angle = |y: f64| 2.0 * y.sqrt().min(1.0).asin();
        let (from, to) = (angle(low), angle(high));
        let half = 0.5 * (to - from);
        let peak = (2.0 * pole.sqrt().asinh()).max(from);
        let at_start = if low > 0.0 { peak.min(distance(low, low - start.1)) } else { peak };
        let at_end = distance(high, end.1 - high);
        let mut sum = 0.0;
        for (origin, sign, scale) in [(from, 1.0, at_start), (to, -1.0, at_end)] {
            for (x, w) in self.rung.rules.at_scale(scale / half).iter() {
                let y = (0.5 * (origin + sign * x * half)).sin().powi(2);
                let s = nearest + 2.0 * b * y; // 1 − h_z
                let r = alpha2 + (1.0 - alpha2) * s * (2.0 - s);
                sum += w * g(y) / (r * r);
            }
        }
        2.0 * cone.sin * cone.cos * half * alpha2 / PI * sum
    }
}

/// The distance in χ that `beyond` in y is from y = sin²(χ/2): dχ = dy/√(y (1 − y)) where that is not too far.
fn distance(y: f64, beyond: f64) -> f64 {
    let beyond = beyond.clamp(0.0, FAR);
    beyond / (y * (1.0 - y) + beyond).sqrt().max(f64::MIN_POSITIVE)
}
