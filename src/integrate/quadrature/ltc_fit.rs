//! The linearly transformed cosine that is nearest to what a surface reflects.
//!
//! Nearest is meant in least squares: the fit makes ∫ (g − f cosθ/E)² dω over the whole sphere least, over all matrices that are
//! symmetric about the plane of incidence. Of the powers that could be taken of the difference, the square alone leaves an integrand without new kinks,
//! so that the minimum is known to as many digits as one likes: the fit is a quantity like any other, with a bound for its
//! error. Against lobes that were fitted to the cube of the difference, with an axis fixed beforehand, it is nearer in the first, second
//! and third power alike (a test has the figures). What lies below the surface's horizon counts as all the rest does, since shaders do
//! not clip it.
//!
//! The minimum is found by Gauss–Newton steps along the variations of [`Ltc`], in which a mirror's lobe is as wide as any, with what
//! these leave out of the curvature learnt from step to step (the structured secant update of Dennis, Gay and Welsch 1981, of rank one).
//! Of a diffuse lobe and of a sheen they begin at the cosine itself, of GGX at the limit for narrow lobes, to second order, derived here:
//!
//! ```text
//! n_x = (along the plane)/2α,   n_y = y/(2α μ),   n_z = ((1 + μ⁴)/2μ) z − sinθ ((1 + μ²)/2) x.
//! ```

use super::ltc::{Misfit, Reflection, Surface, distances, misfit};
use super::{LADDER, Rung};
use crate::model::ltc::{Ltc, VARIATIONS};

/// A fit, by two rules.
#[derive(Debug, Clone, Copy)]
pub struct LtcFit {
    /// The lobe.
    pub ltc: Ltc,
    /// The same by the next coarser rule: how far it is from the finer one is how far that may be from the truth.
    pub coarser: Ltc,
    /// What the finer rule is made for, in parts of an entry: two rules may agree better by chance.
    pub promise: f64,
}

/// How far a fitted lobe is from the one that it stands for, both taken to integrate to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LtcDistance {
    /// ½ ∫ |g − f|: no area light of radiance 1, whatever its shape, is rendered off by more than this part of the albedo.
    pub total_variation: f64,
    /// (∫ |g − f|² / ∫ f²)^½, which the fit makes least.
    pub square: f64,
    /// (∫ |g − f|³ / ∫ f³)^⅓.
    pub cube: f64,
}

/// The tolerance of the albedo that the lobe is divided by.
const ALBEDO: f64 = 1e-13;
/// The step after which the first, coarse search is near enough for a finer rule to go on from.
const NEAR: f64 = 1e-4;
/// The step at which a search ends: the next one would be far shorter.
const ARRIVED: f64 = 1e-10;

/// The best lobe for the surface seen at cosine `mu`; `is_good` tells when the two rules agree well enough.
///
/// `mu` in [0, 1]; the alpha of GGX not below 1e-5, that of a sheen not below 0.01, which from above reflects 1e-17.
pub fn ltc_fit(mu: f64, of: Surface, is_good: impl Fn(&LtcFit) -> bool) -> LtcFit {
    let reflection = reflection(mu, of);
    let is_round = mu == 1.0;
    let mut coarser = search(&reflection, start(mu, of), &LADDER[0], NEAR, is_round);
    let mut best: Option<(f64, LtcFit)> = None;
    for rung in &LADDER[1..] {
        let ltc = search(&reflection, coarser, rung, ARRIVED, is_round);
        let fit = LtcFit { ltc, coarser, promise: rung.promise() };
        if is_good(&fit) {
            return fit;
        }
        let change = fit.change() + fit.promise;
        // Past the point where rounding rules, a finer rung may look worse: keep the better of the two.
        if best.as_ref().is_none_or(|(least, _)| change < *least) {
            best = Some((change, fit));
        }
        coarser = ltc;
    }
    best.map_or(LtcFit { ltc: coarser, coarser, promise: f64::INFINITY }, |(_, fit)| fit)
}

/// A quick fit, good to a few digits: the least that the ladder gives.
pub fn ltc_fit_quickly(mu: f64, of: Surface) -> Ltc {
    search(&reflection(mu, of), start(mu, of), &LADDER[0], NEAR, mu == 1.0)
}

/// How far `ltc` is from the surface's reflection seen at cosine `mu`; good to about 1e-3 of itself.
pub fn ltc_distance(mu: f64, of: Surface, ltc: &Ltc) -> LtcDistance {
    let [first, second, third] = distances(&reflection(mu, of), ltc, &LADDER[1]);
    LtcDistance { total_variation: 0.5 * first, square: second.sqrt(), cube: third.cbrt() }
}

fn reflection(mu: f64, of: Surface) -> Reflection {
    Reflection::new(mu, of, of.albedo(mu, ALBEDO))
}

impl LtcFit {
    /// How far the entries of the two are apart at most, in parts of m11.
    pub fn change(&self) -> f64 {
        self.ltc.by_m11().iter().zip(self.coarser.by_m11()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// The variation that makes the one of the other, the longest of its parts: unlike entries in parts of m11, which nearly all the
    /// others vanish beside at grazing angles, it means the same of every lobe.
    pub fn step(&self) -> f64 {
        self.ltc.step_from(&self.coarser).iter().fold(0.0, |most: f64, step| most.max(step.abs()))
    }
}

/// Where the search begins.
fn start(mu: f64, of: Surface) -> Ltc {
    match of {
        Surface::Ggx(alpha, _) => narrow_limit(mu, alpha),
        Surface::Burley(_) | Surface::Charlie(_) => Ltc::COSINE,
    }
}

/// The limit of narrow lobes, kept away from the horizon that they would otherwise be squeezed into, by as much
/// as turns out to save steps.
fn narrow_limit(mu: f64, alpha: f64) -> Ltc {
    let grazing = 1.0 - mu;
    let cos = (mu + 2.5 * alpha * grazing).min(1.0);
    let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
    let along = 2.0 * alpha * (1.0 + 1.3 * grazing.powi(4)) / (1.0 + alpha);
    let across = 2.0 * alpha * (mu + 1.2 * alpha * grazing) / (1.0 + alpha);
    let tilt = -sin * 0.5 * (1.0 + cos * cos);
    Ltc { x: [cos / along, sin / along], y: 1.0 / across, z: [tilt, (1.0 + tilt * sin) / cos] }
}

/// Steps at most; twice what any place was seen to take.
const MOST_STEPS: usize = 160;
/// A step that is longer than this is damped: stretches and shears by as much change the lobe altogether.
const LONGEST: f64 = 0.7;

/// Steps from `start` to the best lobe by the rules of that rung, until one is shorter than `arrived`.
fn search(reflection: &Reflection, start: Ltc, rung: &Rung, arrived: f64, is_round: bool) -> Ltc {
    let at = |ltc: &Ltc| {
        let found = misfit(reflection, ltc, rung);
        if is_round { rounded(found) } else { found }
    };
    let (mut ltc, mut here) = (start, at(&start));
    let (mut missing, mut damping, mut last) = ([[0.0; VARIATIONS]; VARIATIONS], 0.0_f64, f64::INFINITY);
    for _ in 0..MOST_STEPS {
        let mut curvature = here.curvature;
        for i in 0..VARIATIONS {
            (0..VARIATIONS).for_each(|j| curvature[i][j] += missing[i][j]);
            curvature[i][i] += damping * here.curvature[i][i];
        }
        let step = solve(curvature, here.gradient.map(|g| -g));
        let length = step.iter().map(|s| s.abs()).fold(0.0, f64::max);
        let slope = dot(&step, &here.gradient);
        // Steps that no longer shrink are what rounding makes of a narrow lobe's gradient.
        if length < arrived || (length < STALLED && length > 0.5 * last) {
            return ltc.varied(step);
        }
        if length.is_nan() || length > LONGEST || slope > 0.0 {
            if slope > 0.0 {
                missing = [[0.0; VARIATIONS]; VARIATIONS]; // it leads uphill
            }
            damping = (4.0 * damping).max(1e-2);
            continue;
        }
        let next = ltc.varied(step);
        let there = at(&next);
        // A fall of a ten-thousandth of what the slope promises is enough; steps too short to be judged by rounded squares are trusted.
        if there.square > here.square + 1e-4 * slope && length > TRUSTED {
            damping = (4.0 * damping).max(1e-2);
            continue;
        }
        learn(&mut missing, &here, &there, &step);
        (ltc, here, last) = (next, there, length);
        damping = if damping < 1e-3 { 0.0 } else { 0.1 * damping };
    }
    ltc
}

/// A step that changes the square by less than what rounding does.
const TRUSTED: f64 = 1e-5;
/// A step from which on every one that is trusted should be shorter by far than the one before.
const STALLED: f64 = 1e-8;

/// What the gradient's change says of the curvature beyond `there.curvature`: the symmetric update of rank one.
fn learn(missing: &mut [[f64; VARIATIONS]; VARIATIONS], here: &Misfit, there: &Misfit, step: &[f64; VARIATIONS]) {
    let rest: [f64; VARIATIONS] = std::array::from_fn(|i| {
        let known: f64 = (0..VARIATIONS).map(|j| (there.curvature[i][j] + missing[i][j]) * step[j]).sum();
        there.gradient[i] - here.gradient[i] - known
    });
    let along = dot(&rest, step);
    let scale: f64 = (0..VARIATIONS).map(|i| step[i] * dot(&there.curvature[i], step)).sum();
    // The usual guard against a division by next to nothing.
    if along.abs() > 1e-6 * scale {
        for i in 0..VARIATIONS {
            (0..VARIATIONS).for_each(|j| missing[i][j] += rest[i] * rest[j] / along);
        }
    }
}

/// Seen from straight above, a lobe is round: what stretches it along x stretches it along y, and nothing shears it.
fn rounded(found: Misfit) -> Misfit {
    let [[a, b, ..], [_, c, ..], ..] = found.curvature;
    let (slope, bend) = (0.5 * (found.gradient[0] + found.gradient[1]), 0.5 * (a + 2.0 * b + c));
    let mut curvature = [[0.0; VARIATIONS]; VARIATIONS];
    (0..VARIATIONS).for_each(|i| curvature[i][i] = bend);
    Misfit { gradient: [slope, slope, 0.0, 0.0], curvature, ..found }
}

fn dot(a: &[f64; VARIATIONS], b: &[f64; VARIATIONS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The solution of four equations, by elimination with pivots; not finite where there is none.
pub(crate) fn solve(mut matrix: [[f64; VARIATIONS]; VARIATIONS], mut right: [f64; VARIATIONS]) -> [f64; VARIATIONS] {
    for i in 0..VARIATIONS {
        let pivot = (i..VARIATIONS).max_by(|&a, &b| matrix[a][i].abs().total_cmp(&matrix[b][i].abs())).unwrap_or(i);
        matrix.swap(i, pivot);
        right.swap(i, pivot);
        for row in i + 1..VARIATIONS {
            let factor = matrix[row][i] / matrix[i][i];
            let above = matrix[i];
            matrix[row].iter_mut().zip(above).for_each(|(entry, above)| *entry -= factor * above);
            right[row] -= factor * right[i];
        }
    }
    for i in (0..VARIATIONS).rev() {
        let known: f64 = (i + 1..VARIATIONS).map(|j| matrix[i][j] * right[j]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ggx::Smith;

    const MUS: [f64; 7] = [0.0, 1e-3, 0.05, 0.3, 0.7, 0.98, 1.0];
    const ALPHAS: [f64; 5] = [1e-5, 1e-3, 0.03, 0.3, 1.0];

    fn ggx(alpha: f64) -> Surface {
        Surface::Ggx(alpha, Smith::Correlated)
    }

    fn places() -> impl Iterator<Item = (f64, Surface)> {
        let others = [0.0, 1.0].map(Surface::Burley).into_iter().chain([0.01, 0.5].map(Surface::Charlie));
        MUS.into_iter().flat_map(move |mu| ALPHAS.map(ggx).into_iter().chain(others.clone()).map(move |of| (mu, of)))
    }

    fn apart(a: &Ltc, b: &Ltc) -> f64 {
        a.by_m11().iter().zip(b.by_m11()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn two_rules_tell_how_far_the_finer_one_is_from_the_finest() {
        let said = |fit: &LtcFit| 2.0 * (fit.change() + fit.promise) + 1e-13;
        for (mu, of) in places() {
            let finest = ltc_fit(mu, of, |fit| fit.change() < 1e-12);
            for tolerance in [1e-3, 1e-6, 1e-8] {
                let fit = ltc_fit(mu, of, |fit| said(fit) <= tolerance);
                let (off, said) = (apart(&fit.ltc, &finest.ltc), said(&fit));
                assert!(
                    off <= said && said <= tolerance,
                    "mu {mu} {of:?} {tolerance:e}: off by {off:e}, said {said:e}"
                );
            }
            let quick = apart(&ltc_fit_quickly(mu, of), &finest.ltc);
            let largest = finest.ltc.by_m11().iter().fold(1.0, |most: f64, entry| most.max(entry.abs()));
            assert!(quick < 2e-3 * largest, "mu {mu} {of:?}: {quick:e}");
        }
    }

    #[test]
    fn the_place_does_not_depend_on_where_the_search_begins() {
        for (mu, of) in places() {
            let reflection = reflection(mu, of);
            let best = search(&reflection, start(mu, of), &LADDER[2], ARRIVED, mu == 1.0);
            for step in [[0.3, 0.0, 0.0, 0.0], [-0.3, 0.3, 0.0, 0.0], [0.0, -0.3, 0.3, 0.0], [0.0, 0.0, -0.3, 0.2]] {
                let step = if mu == 1.0 { [step[0], step[0], 0.0, 0.0] } else { step };
                let again = search(&reflection, best.varied(step), &LADDER[2], ARRIVED, mu == 1.0);
                let off = apart(&again, &best);
                // Each search ends within a step of 1e-8 of the place, whatever rounding leaves of the last ones.
                assert!(off < 1e-7, "mu {mu} {of:?} from {step:?}: {off:e}");
            }
        }
    }

    #[test]
    fn lobes_change_smoothly_from_place_to_place() {
        // Along both axes of a usual table, no entry bends by more than a tenth between three texels.
        const N: usize = 24;
        let fits: Vec<Vec<[f64; 4]>> = (0..N)
            .map(|j| {
                let mu = 1.0 - (j as f64 / (N - 1) as f64).powi(2);
                let alpha = |i: usize| (i as f64 / (N - 1) as f64).powi(2).max(1e-5);
                (0..N).map(|i| ltc_fit_quickly(mu, ggx(alpha(i))).by_m11()).collect()
            })
            .collect();
        for j in 1..N - 1 {
            for i in 1..N - 1 {
                let at = |j: usize, i: usize| fits[j][i];
                for (before, after) in [(at(j, i - 1), at(j, i + 1)), (at(j - 1, i), at(j + 1, i))] {
                    for ((a, b), here) in before.iter().zip(after).zip(at(j, i)) {
                        let bend = (a + b - 2.0 * here).abs();
                        assert!(bend < 0.1, "at {i}, {j}: {a} {here} {b}");
                    }
                }
            }
        }
    }
}
