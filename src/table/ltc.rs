//! Linearly transformed cosines: what shaders integrate GGX, Disney's diffuse lobe and sheens over area lights by.
//!
//! The entries of the inverse matrix N = M⁻¹ of [`crate::model::ltc`], in parts of one of them, since its scale means nothing. Of GGX the other
//! two numbers of a lobe, its albedo and the part of it that Schlick's reflectance weighs, are `ggx.albedo` and `ggx.bias`:
//! with these, reflectance is F0·albedo + (F90 − F0)·bias, times the polygon seen through the lobe. Of the others it is
//! `burley.albedo` and `charlie.albedo`.
//!
//! A fit is no integral, but it has a value all the same: the matrix at which a distance is least, see [`quadrature::ltc_fit`]. Its
//! error is how well that place is known. How far the lobe is from the one that it stands for is another matter, which
//! [`Family::approximation`] states.
//!
//! No matrix turns the cosine into a mirror: below [`LEAST_ALPHA`] the lobe of that width is taken, because shaders divide by what would be 0.

use super::quantity::{Approximation, Family, Identity, Model, Parameter, Point, Quantity};
use crate::error::Result;
use crate::integrate::monte_carlo::Stop;
use crate::integrate::quadrature::Surface;
use crate::integrate::{Estimate, Integration, quadrature};
use crate::math::frame::{direction_with_cosine, sine_of_cosine};
use crate::model::clipped_sphere::{clipped_sphere, clipped_sphere_rounding};
use crate::model::ggx::Smith;
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

/// The narrowest sheen: seen from above, there is next to nothing of it.
pub const LEAST_ALPHA_OF_SHEEN: f64 = 1e-2;

/// Entries of the matrix of a fit, all in parts of one.
#[derive(Debug)]
pub struct Entries<const N: usize> {
    quantities: &'static [Quantity],
    /// The surface at a point.
    surface: fn(&Point, &Model) -> Result<Surface>,
    of: fn(&Ltc) -> [f64; N],
    /// Those that are off the diagonal.
    off_diagonal: [usize; 2],
    /// Those that are 1 as well where the lobe is seen from straight above.
    ones: &'static [usize],
    /// What entries are known to, in parts of the largest, whatever larger error is acceptable: where they grow like 1/alpha. Infinity where
    /// nothing more is asked for than the tolerance.
    relative: f64,
    /// What is known of the narrowest lobes.
    narrow: Option<Limit<N>>,
}

/// What is known of each entry at a cosine and an alpha, if anything.
type Limit<const N: usize> = fn([f64; 2], &Model) -> Option<[Identity; N]>;

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

/// The same of the diffuse lobe, over the artist's roughness.
const fn diffuse(name: &'static str, summary: &'static str, bounds: (f64, f64)) -> Quantity {
    Quantity { parameters: &[Parameter::Mu, Parameter::Roughness], ..entry(name, summary, bounds) }
}

/// GGX, no narrower than that.
fn ggx(at: &Point, model: &Model, least: f64) -> Result<Surface> {
    Ok(Surface::Ggx(at.get(Parameter::Alpha)?.max(least), model.smith))
}

/// `ltc.m00`, `ltc.m02`, `ltc.m20`, `ltc.m22`: in parts of m11.
pub static BY_M11: Entries<4> = Entries {
    quantities: &[
        entry("ltc.m00", "inverse matrix of the lobe for area lights: m00/m11, n_x of x", (0.0, 2.0)),
        entry("ltc.m02", "m02/m11 of the same: n_x of z", (-1.0, 1.0)),
        entry("ltc.m20", "m20/m11 of the same: n_z of x", (-1.0, 1.0)),
        entry("ltc.m22", "m22/m11 of the same: n_z of z", (0.0, 4.0)),
    ],
    surface: |at, model| ggx(at, model, LEAST_ALPHA),
    of: Ltc::by_m11,
    off_diagonal: [1, 2],
    ones: &[0],
    relative: f64::INFINITY,
    narrow: Some(frame_of_the_mirror),
};

/// `ltc-m22.m00`, `ltc-m22.m02`, `ltc-m22.m20`, `ltc-m22.m11`: in parts of m22.
pub static BY_M22: Entries<4> = Entries {
    quantities: &[
        entry(
            "ltc-m22.m00",
            "inverse matrix of the lobe for area lights in parts of m22: m00/m22, n_x of x",
            (0.0, 1e4),
        ),
        entry("ltc-m22.m02", "m02/m22 of the same: n_x of z", (-1e4, 1e4)),
        entry("ltc-m22.m20", "m20/m22 of the same: n_z of x", (-1e4, 1e4)),
        entry("ltc-m22.m11", "m11/m22 of the same: n_y of y", (0.0, 1e4)),
    ],
    surface: |at, model| ggx(at, model, LEAST_ALPHA_BY_M22),
    of: Ltc::by_m22,
    off_diagonal: [1, 2],
    ones: &[],
    relative: LARGE,
    narrow: None,
};

/// `ltc-m00.m02`, `ltc-m00.m20`, `ltc-m00.m11`, `ltc-m00.m22`: in parts of m00, as the first published tables were.
pub static BY_M00: Entries<4> = Entries {
    quantities: &[
        entry(
            "ltc-m00.m02",
            "inverse matrix of the lobe for area lights in parts of m00: m02/m00, n_x of z",
            (-1e7, 1e7),
        ),
        entry("ltc-m00.m20", "m20/m00 of the same: n_z of x", (-1e7, 1e7)),
        entry("ltc-m00.m11", "m11/m00 of the same: n_y of y", (0.0, 1e7)),
        entry("ltc-m00.m22", "m22/m00 of the same: n_z of z", (0.0, 1e7)),
    ],
    surface: |at, model| ggx(at, model, LEAST_ALPHA_BY_M22),
    of: Ltc::by_m00,
    off_diagonal: [0, 1],
    ones: &[2],
    relative: LARGE,
    narrow: None,
};

/// `ltc-lobe.m00`, `.m20`, `.m11`, `.m02` and `.m22`: the matrix that makes the lobe of the cosine, not its inverse.
pub static LOBE: Entries<5> = Entries {
    quantities: &[
        entry(
            "ltc-lobe.m00",
            "matrix M = N⁻¹ that makes the lobe for area lights of the cosine, M z of length 1: x of x",
            (0.0, 4.0),
        ),
        entry("ltc-lobe.m20", "m20 of the same: z of x", (-2.0, 2.0)),
        entry("ltc-lobe.m11", "m11 of the same: y of y", (0.0, 2.0)),
        entry("ltc-lobe.m02", "m02 of the same: x of z, towards the mirror direction", (-1.0, 0.0)),
        entry("ltc-lobe.m22", "m22 of the same: z of z", (0.0, 1.0)),
    ],
    surface: |at, model| ggx(at, model, LEAST_ALPHA),
    of: Ltc::lobe_matrix,
    off_diagonal: [1, 3],
    ones: &[4],
    relative: f64::INFINITY,
    narrow: None,
};

/// `ltc-burley.m00`, `ltc-burley.m02`, `ltc-burley.m20`, `ltc-burley.m11`: of Disney's diffuse lobe, in parts of m22.
pub static BURLEY: Entries<4> = Entries {
    quantities: &[
        diffuse(
            "ltc-burley.m00",
            "inverse matrix of Disney's diffuse lobe for area lights in parts of m22: m00/m22, n_x of x",
            (0.5, 1.5),
        ),
        diffuse("ltc-burley.m02", "m02/m22 of the same: n_x of z", (-0.5, 0.5)),
        diffuse("ltc-burley.m20", "m20/m22 of the same: n_z of x", (-0.5, 0.5)),
        diffuse("ltc-burley.m11", "m11/m22 of the same: n_y of y", (0.5, 1.5)),
    ],
    surface: |at, _| Ok(Surface::Burley(at.get(Parameter::Roughness)?)),
    of: Ltc::by_m22,
    off_diagonal: [1, 2],
    ones: &[],
    relative: f64::INFINITY,
    narrow: None,
};

/// `ltc-charlie.m00`, `ltc-charlie.m02`, `ltc-charlie.m20`, `ltc-charlie.m11`: of the sheen with Neubelt's visibility, in parts of m22.
pub static CHARLIE: Entries<4> = Entries {
    quantities: &[
        entry(
            "ltc-charlie.m00",
            "inverse matrix of Charlie's sheen (Neubelt's visibility) for area lights in parts of m22: m00/m22, n_x of x",
            (0.0, 1.1),
        ),
        entry("ltc-charlie.m02", "m02/m22 of the same: n_x of z", (-3.0, 0.1)),
        entry("ltc-charlie.m20", "m20/m22 of the same: n_z of x", (-0.1, 0.3)),
        entry("ltc-charlie.m11", "m11/m22 of the same: n_y of y", (0.0, 1.1)),
    ],
    surface: |at, _| Ok(Surface::Charlie(at.get(Parameter::Alpha)?.max(LEAST_ALPHA_OF_SHEEN))),
    of: Ltc::by_m22,
    off_diagonal: [1, 2],
    ones: &[],
    relative: f64::INFINITY,
    narrow: None,
};

/// What the difference of two rules is multiplied with to be a bound: each is better than the one before by more than a half, and a test scans
/// the domain for values that break it.
const SAFETY: f64 = 2.0;
/// The least error that is claimed of an entry: the minimum of a rounded function is known to half its digits only, but for what the
/// gradient says, of which this is what rounding leaves.
const ROUNDING: f64 = 1e-13;
/// How well the fit is known where the random witness begins.
const START: f64 = 1e-6;
/// The standard error of a step at which the random witness stops at the latest, if it is not told a number of points: a lobe that is far from
/// what it stands for, at grazing angles, would take points by the million for more digits.
const ENOUGH: f64 = 2e-4;
/// Points from which the random witness learns how far a gradient leads.
const CURVATURE_SAMPLES: u64 = 4096;

/// The variation by which the sensitivity of an entry is found: small enough for its square not to matter.
const VARIATION: f64 = 1e-5;

/// By how much each entry changes with the variations of the lobe at most, all taken together.
fn sensitivities<const N: usize>(ltc: &Ltc, of: &impl Fn(&Ltc) -> [f64; N]) -> [f64; N] {
    let here = of(ltc);
    let mut sums = [0.0; N];
    for k in 0..VARIATIONS {
        let there = of(&ltc.varied(std::array::from_fn(|i| if i == k { VARIATION } else { 0.0 })));
        sums.iter_mut().zip(here.iter().zip(there)).for_each(|(sum, (a, b))| *sum += (a - b).abs() / VARIATION);
    }
    sums
}

/// What entries that grow like 1/alpha are known to.
const LARGE: f64 = 1e-8;

impl<const N: usize> Entries<N> {
    fn place(&self, at: &Point, model: &Model) -> Result<(f64, Surface)> {
        Ok((at.get(Parameter::Mu)?, (self.surface)(at, model)?))
    }

    /// The bounds that the two rules of a fit give its entries: how far apart these are, or their lobes as a variation, in which a narrow lobe
    /// is like any, times what the entry makes of one, whichever is less.
    fn errors(&self, fit: &quadrature::LtcFit) -> [f64; N] {
        // The largest difference speaks for all, of entries and of variations: either bounds every entry.
        let (values, coarser, slopes) =
            ((self.of)(&fit.ltc), (self.of)(&fit.coarser), sensitivities(&fit.ltc, &self.of));
        let apart = values.iter().zip(coarser).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let largest = largest(&values);
        slopes.map(|slope| {
            let slope = slope.max(f64::EPSILON * largest);
            let of_entries = SAFETY * (apart + fit.promise * largest) + ROUNDING * largest;
            of_entries.min((SAFETY * (fit.step() + fit.promise) + ROUNDING) * slope)
        })
    }
}

fn largest(entries: &[f64]) -> f64 {
    entries.iter().fold(1.0, |most: f64, value| most.max(value.abs()))
}

impl<const N: usize> Family for Entries<N> {
    fn quantities(&self) -> &'static [Quantity] {
        self.quantities
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let (mu, surface) = self.place(at, model)?;
        let fit = quadrature::ltc_fit(mu, surface, |fit| {
            // A tolerance that the largest of large entries asks for is not one for the small ones beside it.
            let enough = tolerance.min(self.relative * largest(&(self.of)(&fit.ltc)));
            self.errors(fit).iter().all(|error| *error <= enough)
        });
        let (values, errors) = ((self.of)(&fit.ltc), self.errors(&fit));
        let is_nothing = |i| surface.is_round(mu) && self.off_diagonal.contains(&i);
        let entry = |i| if is_nothing(i) { Estimate::bound(0.0, 0.0) } else { Estimate::bound(values[i], errors[i]) };
        Ok((0..N).map(entry).collect())
    }

    /// The standard errors of a step, each times what the entry makes of it.
    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (mu, surface) = self.place(at, model)?;
        let whole = |ltc: &Ltc| sensitivities(ltc, &self.of).into_iter().fold(1.0, f64::max);
        let (ltc, steps) = random_step(mu, surface, integration, whole);
        let values = (self.of)(&ltc);
        let mut errors = sensitivities(&ltc, &self.of).map(|slope| START * slope.max(1.0));
        for (k, step) in steps.into_iter().enumerate() {
            let there = (self.of)(&ltc.varied(std::array::from_fn(|i| if i == k { VARIATION } else { 0.0 })));
            for i in 0..N {
                errors[i] += step * (there[i] - values[i]).abs() / VARIATION;
            }
        }
        Ok(values.into_iter().zip(errors).map(|(value, error)| Estimate::sigma(value, error)).collect())
    }

    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity> {
        let Ok((mu, surface)) = self.place(at, model) else { return vec![] };
        let mut known = vec![];
        if mu == 1.0 {
            let fact = "a lobe seen from straight above is round";
            let zeros = self.off_diagonal.iter().map(|&quantity| (quantity, 0.0));
            let all = self.ones.iter().map(|&quantity| (quantity, 1.0)).chain(zeros);
            known.extend(all.map(|(quantity, value)| Identity { quantity, value, slack: 0.0, fact }));
        }
        if let (Some(narrow), Surface::Ggx(alpha, _)) = (self.narrow, surface) {
            known.extend(narrow([mu, alpha], model).into_iter().flatten());
        }
        known
    }

    fn approximation(&self, at: &Point, model: &Model) -> Option<Approximation> {
        let (mu, surface) = self.place(at, model).ok()?;
        let ltc = quadrature::ltc_fit_quickly(mu, surface);
        let distance = quadrature::ltc_distance(mu, surface, &ltc);
        Some(Approximation { total_variation: distance.total_variation, square: distance.square })
    }
}

/// The limit of [`BY_M11`] for narrow lobes, where it is known.
fn frame_of_the_mirror([mu, alpha]: [f64; 2], model: &Model) -> Option<[Identity; 4]> {
    // Schlick's k for lamps keeps a mirror's masking from being flat.
    if alpha > mu * MIRROR_RATIO || model.smith == Smith::SchlickDirect {
        return None;
    }
    let sine = sine_of_cosine(mu);
    let limit = [mu * mu, mu * sine, -alpha * mu * sine * (1.0 + mu * mu), alpha * (1.0 + mu.powi(4))];
    let (slack, fact) = (MIRROR_SLACK * (alpha / mu).powi(2), "frame of the mirror as alpha → 0");
    Some(std::array::from_fn(|quantity| Identity { quantity, value: limit[quantity], slack, fact }))
}

/// The limit for narrow lobes is a fact where alpha is at most this part of mu …
const MIRROR_RATIO: f64 = 0.01;
/// … to within this multiple of the square of that part: measured over that whole region (a test scans it).
const MIRROR_SLACK: f64 = 1.0;

/// The lobe to which a step from the deterministic fit leads that random points ask for, and the standard error of each of its
/// variations: nothing but the gradient being 0 makes the step 0, whatever the other witness has found.
///
/// Each point is used twice, as a direction drawn from the surface's own lobe and as one drawn from the fitted lobe, with the balance heuristic between the two:
/// no weight exceeds 2.
///
/// `sensitivity` is what an error of a step is multiplied with before it is held against the tolerance.
fn random_step(
    mu: f64,
    surface: Surface,
    integration: &Integration,
    sensitivity: impl Fn(&Ltc) -> f64,
) -> (Ltc, [f64; VARIATIONS]) {
    let albedo = surface.albedo(mu, START);
    let ltc = quadrature::ltc_fit(mu, surface, |fit| fit.step() <= START).ltc;
    let (lobe, wo) = (surface.lobe(), quadrature::not_below(direction_with_cosine(mu)));
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
    let stop = match integration.stop() {
        Stop::Tolerance(tolerance) => Stop::Tolerance((tolerance / sensitivity(&ltc)).max(ENOUGH)),
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
