//! Linearly transformed cosines: what shaders integrate GGX over area lights by.
//!
//! The entries of the inverse matrix N = M⁻¹ of [`crate::model::ltc`], in parts of one of them, since its scale means nothing. The other
//! two numbers of a lobe, its albedo and the part of it that Schlick's reflectance weighs, are `ggx.albedo` and `ggx.bias`:
//! with these, reflectance is F0·albedo + (F90 − F0)·bias, times the polygon seen through the lobe.
//!
//! A fit is no integral, but it has a value all the same: the matrix at which a distance is least, see [`quadrature::ltc_fit`]. Its
//! error is how well that place is known. How far the lobe is from the one that it stands for is another matter, which
//! [`Family::approximation`] states.
//!
//! No matrix turns the cosine into a mirror: below [`LEAST_ALPHA`] the lobe of that width is taken, because shaders divide by what would be 0.

use super::quantity::{Approximation, Family, Identity, Model, Parameter, Point, Quantity};
use crate::error::Result;
use crate::integrate::monte_carlo::Stop;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::{direction_with_cosine, sine_of_cosine};
use crate::model::Lobe;
use crate::model::clipped_sphere::{clipped_sphere, clipped_sphere_rounding};
use crate::model::ggx::{Ggx, Smith};
use crate::model::ltc::{Ltc, VARIATIONS};
use glam::DVec3;
use std::f64::consts::TAU;

const HEITZ: &str = "Heitz, Dupuy, Hill and Neubelt 2016, \"Real-Time Polygonal-Light Shading with Linearly Transformed Cosines\"; \
                     the fit is in least squares over the sphere, and free in all four entries";
const HILL: &str = "Hill and Heitz 2016, \"Real-Time Area Lighting: a Journey from Research to Production\"";

const FIT: &str = "of the matrix N that makes ∫ (g − f cosθ/E)² dω least, g = max(n_z, 0) |det N|/(π |n|⁴), n = N ω";

/// The narrowest lobe that is fitted; published tables begin there too.
pub const LEAST_ALPHA: f64 = 1e-5;
/// The same in parts of m22, in which entries grow as 1/alpha: Unity's tables, which are of halves, begin there.
pub const LEAST_ALPHA_BY_M22: f64 = 1e-3;

/// `ltc.m00`, `ltc.m02`, `ltc.m20`, `ltc.m22`: in parts of m11.
#[derive(Debug)]
pub struct ByM11;

/// An entry of the matrix: its name and summary, and the interval that it never leaves.
const fn entry(name: &'static str, summary: &'static str, bounds: (f64, f64)) -> Quantity {
    Quantity {
        name,
        summary,
        definition: FIT,
        source: HEITZ,
        parameters: &[Parameter::Mu, Parameter::Alpha],
        monotone: &[],
        bounds,
    }
}

static BY_M11: [Quantity; 4] = [
    entry("ltc.m00", "inverse matrix of the lobe for area lights: m00/m11, n_x of x", (0.0, 2.0)),
    entry("ltc.m02", "m02/m11 of the same: n_x of z", (-1.0, 1.0)),
    entry("ltc.m20", "m20/m11 of the same: n_z of x", (-1.0, 1.0)),
    entry("ltc.m22", "m22/m11 of the same: n_z of z", (0.0, 4.0)),
];

/// What the difference of two rules is multiplied with to be a bound: each is better than the one before by more than a half, and a test scans
/// the domain for values that break it.
const SAFETY: f64 = 2.0;
/// The least error that is claimed of an entry: the minimum of a rounded function is known to half its digits only, but for what the
/// gradient says, of which this is what rounding leaves.
const ROUNDING: f64 = 1e-13;
/// How well the fit is known where the random witness begins.
const START: f64 = 1e-6;
/// The standard error of a step at which the random witness stops, if it is not told a number of points.
const ENOUGH: f64 = 1e-3;
/// Points from which the random witness learns how far a gradient leads.
const CURVATURE_SAMPLES: u64 = 4096;

fn place(at: &Point, least: f64) -> Result<(f64, f64)> {
    Ok((at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?.max(least)))
}

/// The entries of a fit, and the bound that its two rules give them. The second and the third are off the diagonal, and nothing where the lobe is
/// round about the normal: seen from straight above, and at alpha 1, where facets point everywhere alike and masking knows elevations only.
fn entries(at: (f64, f64), smith: Smith, tolerance: f64, of: impl Fn(&Ltc) -> [f64; 4]) -> Vec<Estimate> {
    let error = |fit: &quadrature::LtcFit| {
        let (finer, coarser) = (of(&fit.ltc), of(&fit.coarser));
        let apart = finer.iter().zip(coarser).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let largest = finer.iter().fold(1.0, |most: f64, entry| most.max(entry.abs()));
        SAFETY * (apart + fit.promise * largest) + ROUNDING * largest
    };
    let fit = quadrature::ltc_fit(at.0, at.1, smith, |fit| error(fit) <= tolerance);
    let mut entries = of(&fit.ltc).map(|value| Estimate::bound(value, error(&fit)));
    if at.0 == 1.0 || at.1 == 1.0 {
        entries[1..3].fill(Estimate::bound(0.0, 0.0));
    }
    entries.into()
}

fn approximation((mu, alpha): (f64, f64), smith: Smith) -> Approximation {
    let ltc = quadrature::ltc_fit_quickly(mu, alpha, smith);
    let distance = quadrature::ltc_distance(mu, alpha, smith, &ltc);
    Approximation { total_variation: distance.total_variation, square: distance.square }
}

impl Family for ByM11 {
    fn quantities(&self) -> &'static [Quantity] {
        &BY_M11
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        Ok(entries(place(at, LEAST_ALPHA)?, model.smith, tolerance, Ltc::by_m11))
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, alpha) = place(at, LEAST_ALPHA)?;
        let (ltc, steps) = random_step(mu, alpha, model.smith, integration);
        let ([stretch_x, stretch_y, shear_x, shear_z], values) = (steps, ltc.by_m11());
        let [m00, m02, m20, m22] = values.map(f64::abs);
        let errors = [
            (stretch_x + stretch_y) * m00 + shear_x * m20,
            (stretch_x + stretch_y) * m02 + shear_x * m22,
            stretch_y * m20 + shear_z * m00,
            stretch_y * m22 + shear_z * m02,
        ];
        Ok(values.into_iter().zip(errors).map(|(value, error)| Estimate::sigma(value, error + START)).collect())
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let Ok((mu, alpha)) = place(at, LEAST_ALPHA) else { return vec![] };
        let mut known = vec![];
        if mu == 1.0 {
            for (quantity, value) in [(0, 1.0), (1, 0.0), (2, 0.0)] {
                known.push(Identity { quantity, value, slack: 0.0, fact: "a lobe seen from straight above is round" });
            }
        }
        // Schlick's k for lamps keeps a mirror's masking from being flat.
        if alpha <= mu * MIRROR_RATIO && model.smith != Smith::SchlickDirect {
            let sine = sine_of_cosine(mu);
            let limit = [mu * mu, mu * sine, -alpha * mu * sine * (1.0 + mu * mu), alpha * (1.0 + mu.powi(4))];
            for (quantity, value) in limit.into_iter().enumerate() {
                let slack = MIRROR_SLACK * (alpha / mu).powi(2);
                known.push(Identity { quantity, value, slack, fact: "frame of the mirror as alpha → 0" });
            }
        }
        known
    }

    fn approximation(&self, at: &Point, model: &Model) -> Option<Approximation> {
        Some(approximation(place(at, LEAST_ALPHA).ok()?, model.smith))
    }
}

/// The limit for narrow lobes is a fact where alpha is at most this part of mu …
const MIRROR_RATIO: f64 = 0.01;
/// … to within this multiple of the square of that part: measured over that whole region (a test scans it).
const MIRROR_SLACK: f64 = 1.0;

/// `ltc-m22.m00`, `ltc-m22.m02`, `ltc-m22.m20`, `ltc-m22.m11`: in parts of m22.
#[derive(Debug)]
pub struct ByM22;

static BY_M22: [Quantity; 4] = [
    entry("ltc-m22.m00", "inverse matrix of the lobe for area lights in parts of m22: m00/m22, n_x of x", (0.0, 1e4)),
    entry("ltc-m22.m02", "m02/m22 of the same: n_x of z", (-1e4, 1e4)),
    entry("ltc-m22.m20", "m20/m22 of the same: n_z of x", (-1e4, 1e4)),
    entry("ltc-m22.m11", "m11/m22 of the same: n_y of y", (0.0, 1e4)),
];

impl Family for ByM22 {
    fn quantities(&self) -> &'static [Quantity] {
        &BY_M22
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        Ok(entries(place(at, LEAST_ALPHA_BY_M22)?, model.smith, tolerance, Ltc::by_m22))
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, alpha) = place(at, LEAST_ALPHA_BY_M22)?;
        let (ltc, [stretch_x, stretch_y, shear_x, shear_z]) = random_step(mu, alpha, model.smith, integration);
        let values = ltc.by_m22();
        let [m00, m02, m20, m11] = values.map(f64::abs);
        // m22 itself changes by this part of itself.
        let whole = shear_z * m02;
        let errors = [
            (stretch_x + whole) * m00 + shear_x * m20,
            (stretch_x + whole) * m02 + shear_x,
            whole * m20 + shear_z * m00,
            (stretch_y + whole) * m11,
        ];
        let scale = values.iter().fold(1.0, |most: f64, entry| most.max(entry.abs()));
        Ok(values.into_iter().zip(errors).map(|(v, error)| Estimate::sigma(v, error + START * scale)).collect())
    }

    fn identities(&self, at: &Point, _: &Model) -> Vec<Identity> {
        let known = |quantity, value| Identity {
            quantity,
            value,
            slack: 0.0,
            fact: "a lobe seen from straight above is round",
        };
        if at.get(Parameter::Mu).is_ok_and(|mu| mu == 1.0) { vec![known(1, 0.0), known(2, 0.0)] } else { vec![] }
    }

    fn approximation(&self, at: &Point, model: &Model) -> Option<Approximation> {
        Some(approximation(place(at, LEAST_ALPHA_BY_M22).ok()?, model.smith))
    }
}

/// The lobe to which a step from the deterministic fit leads that random points ask for, and the standard error of each of its
/// variations: nothing but the gradient being 0 makes the step 0, whatever the other witness has found.
///
/// Each point is used twice, as a direction drawn from GGX itself and as one drawn from the fitted lobe, with the balance heuristic between the two:
/// no weight exceeds 2.
fn random_step(mu: f64, alpha: f64, smith: Smith, integration: &Integration) -> (Ltc, [f64; VARIATIONS]) {
    let albedo = quadrature::ggx_albedo(mu, alpha, smith, START).value;
    let ltc = quadrature::ltc_fit(mu, alpha, smith, |fit| fit.change() <= START).ltc;
    let (lobe, wo) = (Ggx::isotropic(alpha, smith), direction_with_cosine(mu));
    let directions = |u: [f64; 2]| [lobe.sample(wo, u).map(|sample| sample.wi), Some(ltc.sample(u))];
    // The difference of the lobes, the slopes, and 1 over the density of a direction.
    let seen = |w: DVec3| {
        let (g, slopes) = ltc.derivatives(w);
        let f = if w.z > 0.0 { lobe.f(wo, w) * w.z / albedo } else { 0.0 };
        let density = g + if w.z > 0.0 { lobe.pdf(wo, w) } else { 0.0 };
        (g - f, slopes, if density > 0.0 { 1.0 / density } else { 0.0 })
    };
    let (curvature, _) = integration.points2.integrate(Stop::Samples(CURVATURE_SAMPLES), |u| {
        let mut sums = [0.0; VARIATIONS * VARIATIONS];
        for w in directions(u).into_iter().flatten() {
            let (_, slopes, weight) = seen(w);
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum += weight * slopes[k / VARIATIONS] * slopes[k % VARIATIONS];
            }
        }
        sums
    });
    let curvature = std::array::from_fn(|i| std::array::from_fn(|j| curvature[i * VARIATIONS + j].value));
    let inverse: [[f64; VARIATIONS]; VARIATIONS] =
        std::array::from_fn(|k| quadrature::solve(curvature, std::array::from_fn(|i| if i == k { -1.0 } else { 0.0 })));
    // A lobe that is far from what it stands for, at grazing angles, would take points by the million for more digits.
    let stop = match integration.stop() {
        Stop::Tolerance(tolerance) => Stop::Tolerance(tolerance.max(ENOUGH)),
        samples => samples,
    };
    let (steps, _) = integration.points2.integrate(stop, |u| {
        let mut step = [0.0; VARIATIONS];
        for w in directions(u).into_iter().flatten() {
            let (off, slopes, weight) = seen(w);
            for (column, slope) in inverse.iter().zip(slopes) {
                step.iter_mut().zip(column).for_each(|(step, entry)| *step += weight * off * slope * entry);
            }
        }
        step
    });
    (ltc.varied(steps.map(|step| step.value)), steps.map(|step| step.error))
}

/// `sphere.clipped`.
#[derive(Debug)]
pub struct ClippedSphere;

static CLIPPED_SPHERE: [Quantity; 1] = [Quantity {
    name: "sphere.clipped",
    summary: "form factor of a sphere that the horizon cuts off, in parts of the same sphere's overhead; the fourth channel beside LTC",
    definition: "∫ max(cosθ, 0) dω/(π sin²σ) over the directions within σ of the centre",
    source: HILL,
    parameters: &[Parameter::CosCentre, Parameter::Sin2Radius],
    monotone: &[(Parameter::CosCentre, super::quantity::Trend::Rises)],
    bounds: (0.0, 1.0),
}];

impl Family for ClippedSphere {
    fn quantities(&self) -> &'static [Quantity] {
        &CLIPPED_SPHERE
    }

    fn quadrature(&self, at: &Point, _: &Model, _: f64) -> Result<Vec<Estimate>> {
        let (cos_centre, sin2) = (at.get(Parameter::CosCentre)?, at.get(Parameter::Sin2Radius)?);
        Ok(vec![Estimate::bound(clipped_sphere(cos_centre, sin2), clipped_sphere_rounding(sin2))])
    }

    fn monte_carlo(&self, at: &Point, _: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (cos_centre, sin2) = (at.get(Parameter::CosCentre)?, at.get(Parameter::Sin2Radius)?);
        let sin_centre = sine_of_cosine(cos_centre.abs());
        // Even over the solid angle 2π (1 − cosσ), of which π sin²σ is the part (1 + cosσ)/2.
        let rim = (1.0 - sin2).sqrt();
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, v]| {
            let cos = 1.0 - u * sin2 / (1.0 + rim);
            let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
            [2.0 * (cos_centre * cos + sin_centre * sin * (TAU * v).cos()).max(0.0) / (1.0 + rim)]
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, _: &Model) -> Vec<Identity> {
        let (Ok(z), Ok(sin2)) = (at.get(Parameter::CosCentre), at.get(Parameter::Sin2Radius)) else { return vec![] };
        let known = |value, fact| vec![Identity { quantity: 0, value, slack: 0.0, fact }];
        if sin2 == 1.0 {
            return known(0.5 * (1.0 + z), "half a sky is (1 + cos)/2");
        }
        if z * z >= sin2 {
            return known(z.max(0.0), "a sphere that the horizon does not cut is a cosine");
        }
        vec![]
    }
}

/// The lobe that the entries of a table stand for, in the order of the quantities.
pub fn lobe(entries: [f64; 4]) -> Ltc {
    let [m00, m02, m20, m22] = entries;
    Ltc { x: [m00, m02], y: 1.0, z: [m20, m22] }
}
