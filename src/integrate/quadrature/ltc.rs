//! A reflection beside a linearly transformed cosine: integrals of both over the sphere.
//!
//! Both have kinks, and both along great circles through ±y: the surface's horizon, where the reflection ends, and the cosine's, where
//! that ends. So directions are written (cosβ sinτ, sinβ, cosβ cosτ), dω = cosβ dβ dτ: all kinks lie at fixed τ, where panels end. What is
//! left is analytic, of GGX with these singularities beside the real axes:
//!
//! - in τ, the ridge of D at the mirror direction, ± 2i atanh α from it; that of the cosine, where n_x = ± i n_z; at either horizon
//!   the branch points of G2, ± i atanh α, its pole as far below the horizon as the outgoing direction is above it, and that of an approximate G2;
//! - in β, the ridges again: with h = wo + wi, h² − (1 − α²) h_z² vanishes at about tan²β = −(h_x² + α² h_z²) of β = 0, and |n|² at
//!   tan²β = −(n_x² + n_z²)/m11²; and, at β = π/2, where wi meets the horizon at any τ, the singularities of G2 in sin(π/2 − β) cosτ.
//!
//! The last are left alone where a lobe is so narrow that nothing is left of it there. A diffuse reflection is a polynomial, of a high degree
//! in β. A sheen is a power of the half-vector's distance from the normal, whose tip at the mirror direction is the corner of four panels, and
//! towards the horizon it rises as fast as that power does. Derived here; checked against the closed form of the albedo and against Monte Carlo.

use super::{Rung, charlie_split, ggx_albedo};
use crate::math::frame::{direction_with_cosine, elevation, sine_of_cosine};
use crate::math::quadrature::GradedRules;
use crate::model::Lobe;
use crate::model::burley::Burley;
use crate::model::charlie::{Charlie, Visibility};
use crate::model::ggx::{Ggx, Smith};
use crate::model::ltc::{Ltc, VARIATIONS};
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI};

/// The surface whose reflection is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// GGX of a width in (0, 1], with that masking.
    Ggx(f64, Smith),
    /// Disney's diffuse lobe of a roughness in [0, 1].
    Burley(f64),
    /// The sheen of a width in (0, 1], with Neubelt's visibility.
    Charlie(f64),
}

fn burley(roughness: f64) -> Burley {
    Burley { roughness, renormalised: false }
}

fn charlie(alpha: f64) -> Charlie {
    Charlie { alpha, visibility: Visibility::Neubelt }
}

impl Surface {
    /// Its lobe.
    pub fn lobe(self) -> Box<dyn Lobe> {
        match self {
            Self::Ggx(alpha, smith) => Box::new(Ggx::isotropic(alpha, smith)),
            Self::Burley(roughness) => Box::new(burley(roughness)),
            Self::Charlie(alpha) => Box::new(charlie(alpha)),
        }
    }

    /// Its directional albedo, within the tolerance; of a sheen, which may be next to nothing, within that part of it.
    pub fn albedo(self, mu: f64, tolerance: f64) -> f64 {
        match self {
            Self::Ggx(alpha, smith) => ggx_albedo(mu, alpha, smith, tolerance).value,
            Self::Burley(roughness) => burley(roughness).albedo(mu),
            Self::Charlie(alpha) => {
                let of = |tolerance| charlie_split(mu, &charlie(alpha), tolerance)[0].value;
                of(tolerance * of(tolerance).min(1.0))
            }
        }
    }

    /// Whether its lobe is round about the normal: seen from straight above; where facets point everywhere alike and masking knows elevations
    /// only; and where the retroreflection of a rough surface is none.
    pub fn is_round(self, mu: f64) -> bool {
        mu == 1.0 || self == Self::Burley(0.0) || matches!(self, Self::Ggx(1.0, _))
    }
}

/// A direction as near to the horizon as numbers have it in place of one on it, where lobes end.
pub(crate) fn not_below(wo: DVec3) -> DVec3 {
    wo.max(DVec3::Z * f64::MIN_POSITIVE)
}

/// What a surface reflects, seen at the cosine `mu`, in parts of its albedo.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reflection {
    mu: f64,
    sine: f64,
    of: Shape,
    /// 1/E.
    scale: f64,
}

/// The lobe, and what of it does not change with the direction.
#[derive(Debug, Clone, Copy)]
enum Shape {
    Ggx { alpha: f64, l_o: f64, smith: Smith },
    Burley { lobe: Burley, wo: DVec3 },
    Charlie { lobe: Charlie, wo: DVec3 },
}

impl Reflection {
    /// `mu` in [0, 1]; `albedo` is E.
    pub(super) fn new(mu: f64, of: Surface, albedo: f64) -> Self {
        let sine = sine_of_cosine(mu);
        let wo = not_below(direction_with_cosine(mu));
        let of = match of {
            Surface::Ggx(alpha, smith) => Shape::Ggx { alpha, l_o: (alpha * sine).hypot(mu), smith },
            Surface::Burley(roughness) => Shape::Burley { lobe: burley(roughness), wo },
            Surface::Charlie(alpha) => Shape::Charlie { lobe: charlie(alpha), wo },
        };
        Self { mu, sine, of, scale: 1.0 / albedo }
    }

    /// f cosθ_i/E of a direction and of the half-vector's x, in 1/sr: 0 below the horizon.
    #[inline]
    fn density(&self, w: DVec3, h_x: f64) -> f64 {
        if w.z <= 0.0 {
            return 0.0;
        }
        let mu = self.mu;
        let (alpha, l_o, smith) = match self.of {
            Shape::Ggx { alpha, l_o, smith } => (alpha, l_o, smith),
            Shape::Burley { lobe, wo } => return lobe.f(wo, w) * w.z * self.scale,
            Shape::Charlie { lobe, wo } => return lobe.f(wo, w) * w.z * self.scale,
        };
        let (h, a2) = (DVec3::new(h_x, w.y, w.z + mu), alpha * alpha);
        let flat = h.x * h.x + h.y * h.y;
        let d = a2 * (flat + h.z * h.z).powi(2) / (flat + a2 * h.z * h.z).powi(2);
        let l_i = (a2 * (w.x * w.x + w.y * w.y) + w.z * w.z).sqrt();
        FRAC_1_PI * d * smith.visibility(alpha, (mu, l_o), (w.z, l_i)) * w.z * self.scale
    }

    /// How far its own singularities are from the real axis of τ: beside the mirror direction, and beside the horizons; and whether
    /// the latter matter where β ends, by a rule of that promise. Polynomials have none, and a tip is looked at down to what covers
    /// nothing.
    fn singularities(&self, promise: f64) -> (f64, f64, bool) {
        match self.of {
            Shape::Ggx { alpha, smith, .. } => {
                let width = alpha.atanh().min(PI); // no pole is left at α = 1
                let nearest = NEAREST * width.min(1.0);
                let below = width.min(elevation(self.mu)).min(smith.pole_below_horizon(alpha, self.mu)).max(nearest);
                (2.0 * width, below, alpha.powi(6) > TAIL * promise)
            }
            Shape::Burley { .. } => (PI, FRAC_PI_2, false),
            Shape::Charlie { lobe, .. } => (TIP, elevation(self.mu).min(lobe.alpha).max(NEAREST), true),
        }
    }

    /// The same of β, from its middle, on a meridian where the half-vector is (h_x, 0, h_z): the tangent.
    #[inline]
    fn singularity_beside(&self, h_x: f64, h_z: f64) -> f64 {
        match self.of {
            Shape::Ggx { alpha, .. } => h_x.hypot(alpha * h_z),
            Shape::Burley { .. } => f64::INFINITY,
            Shape::Charlie { .. } => h_x.abs().max(TIP),
        }
    }
}

/// The panels and rules for one pair of lobes.
struct Panels<'a> {
    reflection: &'a Reflection,
    ltc: &'a Ltc,
    rung: &'a Rung,
    /// Where singularities are, in τ, and how far from the real axis.
    features: [[f64; 2]; 6],
    /// The distance of G2's singularities below the horizon, in sines.
    below: f64,
    /// Whether they matter at β = π/2.
    at_the_end: bool,
}

/// The least distance of a pole that is resolved, in parts of alpha: what is nearer to the horizon covers less than its square of the lobe.
const NEAREST: f64 = 1e-7;
/// How near to its tip a sheen is resolved: what is left has the third power of this at least.
const TIP: f64 = 1e-3;
/// Panels shorter than this are left out.
const SLIVER: f64 = 1e-13;
/// A tail of D² beside its peak that is lost in this part of a rule's promise.
const TAIL: f64 = 0.01;

impl<'a> Panels<'a> {
    fn new(reflection: &'a Reflection, ltc: &'a Ltc, rung: &'a Rung) -> Self {
        let peak = -reflection.sine.atan2(reflection.mu);
        let (width, below, at_the_end) = reflection.singularities(rung.promise());
        let [ridge, ridge_width] = ltc.ridge();
        let features = [
            [peak, width],
            [ridge, ridge_width],
            [ridge - PI, ridge_width],
            [ridge + PI, ridge_width],
            [-FRAC_PI_2, below],
            [FRAC_PI_2, below],
        ];
        Self { reflection, ltc, rung, features, below: below.min(FRAC_PI_2).sin(), at_the_end }
    }

    /// Where panels end, ascending: both horizons, and both ridges where they can be told apart.
    fn cuts(&self) -> Vec<f64> {
        let [[peak, width], [ridge, ridge_width], ..] = self.features;
        let [low, high] = self.ltc.horizon();
        let mut cuts = vec![-FRAC_PI_2, FRAC_PI_2, low, high, peak];
        if (ridge - peak).abs() > 0.5 * width.min(ridge_width) {
            cuts.push(ridge);
        }
        cuts.sort_by(f64::total_cmp);
        cuts
    }

    /// The rules over a quarter of a circle.
    fn quarter(&self) -> &'a GradedRules {
        match self.reflection.of {
            Shape::Burley { .. } => &self.rung.doubled_quarter,
            Shape::Ggx { .. } | Shape::Charlie { .. } => &self.rung.quarter,
        }
    }

    fn distance(&self, tau: f64) -> f64 {
        self.features.iter().map(|[at, beside]| (tau - at).hypot(*beside)).fold(f64::INFINITY, f64::min)
    }

    /// Every node: its weight, its direction, and the reflection's density there. What is symmetric counts twice.
    #[inline]
    fn each(&self, mut visit: impl FnMut(f64, DVec3, f64)) {
        for ends in self.cuts().windows(2) {
            let (a, b) = (ends[0], ends[1]);
            if b - a < SLIVER {
                continue;
            }
            // From both ends to the middle.
            let half = 0.5 * (b - a);
            for (end, length) in [(a, half), (b, -half)] {
                // Angles are counted from the mirror direction, where what is small would otherwise be a difference of what is not.
                let from_peak = end - self.features[0][0];
                for (x, w) in self.rung.rules.at_scale(self.distance(end) / half).iter() {
                    self.meridian(from_peak + x * length, w * half, &mut visit);
                }
            }
        }
    }

    #[inline]
    fn meridian(&self, from_peak: f64, weight: f64, visit: &mut impl FnMut(f64, DVec3, f64)) {
        let Reflection { mu, sine, .. } = *self.reflection;
        let (sin_half, cos_half) = (0.5 * from_peak).sin_cos();
        let (sin_d, cos_d) = (2.0 * sin_half * cos_half, (cos_half - sin_half) * (cos_half + sin_half));
        let (sin, cos) = (mu * sin_d - sine * cos_d, mu * cos_d + sine * sin_d);
        // sinτ + sinθ_o and cosτ + cosθ_o.
        let (h_x, h_z) = (2.0 * sin_half * (sine * sin_half + mu * cos_half), cos + mu);
        let mut visit = |weight: f64, sin_beta: f64, cos_beta: f64| {
            let direction = DVec3::new(cos_beta * sin, sin_beta, cos_beta * cos);
            let less = sin_beta * sin_beta / (1.0 + cos_beta); // 1 − cosβ
            visit(2.0 * weight * cos_beta, direction, self.reflection.density(direction, h_x - less * sin));
        };
        let other = |s: f64| ((1.0 - s) * (1.0 + s)).sqrt();
        let [n_x, n_z] = self.ltc.in_plane(sin, cos);
        let ridge = (n_x.hypot(n_z) / self.ltc.y).min(self.reflection.singularity_beside(h_x, h_z)).atan();
        let end = if cos > 0.0 && self.at_the_end { (self.below / cos).min(1.0).asin() } else { FRAC_PI_2 };
        if end < FRAC_PI_2 {
            let weight = weight * FRAC_PI_4;
            self.rung.eighth.at_scale(ridge / FRAC_PI_4).iter().for_each(|(s, w)| visit(weight * w, s, other(s)));
            self.rung.eighth.at_scale(end / FRAC_PI_4).iter().for_each(|(s, w)| visit(weight * w, other(s), s));
        } else {
            let weight = weight * FRAC_PI_2;
            self.quarter().at_scale(ridge / FRAC_PI_2).iter().for_each(|(s, w)| visit(weight * w, s, other(s)));
        }
    }
}

/// What a step towards the best lobe is computed from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Misfit {
    /// ∫ (g − f)² dω.
    pub square: f64,
    /// ∫ f² dω.
    pub whole: f64,
    /// Half the derivatives of `square` along the variations.
    pub gradient: [f64; VARIATIONS],
    /// ∫ ∂g ∂g dω: half the second derivatives, but for what is of the order of g − f.
    pub curvature: [[f64; VARIATIONS]; VARIATIONS],
}

/// The square distance of two lobes, and how it changes with the transformed cosine.
pub(super) fn misfit(reflection: &Reflection, ltc: &Ltc, rung: &Rung) -> Misfit {
    let mut sum =
        Misfit { square: 0.0, whole: 0.0, gradient: [0.0; VARIATIONS], curvature: [[0.0; VARIATIONS]; VARIATIONS] };
    Panels::new(reflection, ltc, rung).each(|weight, w, f| {
        let (g, slopes) = ltc.derivatives(w);
        let off = g - f;
        sum.square += weight * off * off;
        sum.whole += weight * f * f;
        for i in 0..VARIATIONS {
            let slope = weight * slopes[i];
            sum.gradient[i] += off * slope;
            for (curvature, other) in sum.curvature[i].iter_mut().zip(slopes).take(i + 1) {
                *curvature += slope * other;
            }
        }
    });
    for i in 0..VARIATIONS {
        for j in i + 1..VARIATIONS {
            sum.curvature[i][j] = sum.curvature[j][i];
        }
    }
    sum
}

/// ∫ |g − f|ⁿ dω over ∫ fⁿ dω for n of 1, 2 and 3: the odd ones by a rule that their kinks make no more than good.
pub(super) fn distances(reflection: &Reflection, ltc: &Ltc, rung: &Rung) -> [f64; 3] {
    let (mut sums, mut whole) = ([0.0; 3], [0.0; 3]);
    Panels::new(reflection, ltc, rung).each(|weight, w, f| {
        let off = (ltc.density(w) - f).abs();
        let (mut of_difference, mut of_whole) = (weight, weight);
        for n in 0..3 {
            of_difference *= off;
            of_whole *= f;
            sums[n] += of_difference;
            whole[n] += of_whole;
        }
    });
    std::array::from_fn(|n| sums[n] / whole[n])
}

#[cfg(test)]
mod tests {
    use super::super::LADDER;
    use super::*;

    #[test]
    fn both_lobes_integrate_to_1() {
        let ltcs = [
            Ltc::COSINE,
            Ltc { x: [2.08, 2.88], y: 6.57, z: [-0.459, 1.758] },
            Ltc { x: [0.653, 21.2], y: 4036.0, z: [-0.12, 34.9] },
        ];
        for (mu, alpha) in [(0.0, 1.0), (0.0, 0.01), (0.02, 0.1), (0.2, 0.9), (0.5, 0.2), (1.0, 0.03), (0.001, 0.001)] {
            for of in Smith::ALL
                .map(|smith| Surface::Ggx(alpha, smith))
                .into_iter()
                .chain([Surface::Burley(alpha), Surface::Charlie(alpha.max(0.02))])
            {
                let reflection = Reflection::new(mu, of, of.albedo(mu, 1e-13));
                for ltc in ltcs {
                    let (mut f, mut g) = (0.0, 0.0);
                    Panels::new(&reflection, &ltc, &LADDER[3]).each(|weight, w, density| {
                        f += weight * density;
                        g += weight * ltc.density(w);
                    });
                    let place = format!("mu {mu} {of:?} {ltc:?}");
                    // The rule's promise; the reflection alone is not made for where α⁶ is below it: there D² is small, not D.
                    let tolerance = 100.0 * LADDER[3].promise();
                    assert!((g - 1.0).abs() < tolerance, "{place}: {g}");
                    let is_narrow =
                        matches!(of, Surface::Ggx(..)) && !Panels::new(&reflection, &ltc, &LADDER[3]).at_the_end;
                    let tail = if is_narrow { alpha * alpha } else { 0.0 };
                    assert!((f - 1.0).abs() < tolerance + tail + 1e-13 * reflection.scale, "{place}: {f}");
                }
            }
        }
    }

    #[test]
    fn the_gradient_is_what_the_square_changes_by() {
        const H: f64 = 1e-4;
        let of = Surface::Ggx(0.3, Smith::Correlated);
        let reflection = Reflection::new(0.4, of, of.albedo(0.4, 1e-12));
        let ltc = Ltc { x: [1.5, 1.9], y: 4.0, z: [-0.3, 1.5] };
        let rung = &LADDER[5];
        let found = misfit(&reflection, &ltc, rung);
        for k in 0..VARIATIONS {
            let at =
                |h: f64| misfit(&reflection, &ltc.varied(std::array::from_fn(|i| if i == k { h } else { 0.0 })), rung);
            let (up, down) = (at(H), at(-H));
            let difference = (up.square - down.square) / (4.0 * H);
            // The third derivative times H²/6, and rounding over H.
            assert!((difference - found.gradient[k]).abs() < 20.0 * H * H * found.whole, "{k}: {difference} {found:?}");
        }
    }
}
