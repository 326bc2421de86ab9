//! Kernels that a map is too hard for, found and done again.
//!
//! How many texels are peeled off and how many degrees are taken follows from what most maps ask for. Lamps that fill blocks of texels, that lie
//! at a pole, or in a row along somebody's horizon ask for more, and no bound tells which maps these are. So the last degrees are looked at
//! (`beyond`): they tell how much is left out, and where. Where that is too much, it is measured against the full sum as well, in those very directions; and
//! what is off is done again with more peeled texels and more degrees, and in the end by the full sum itself.
//!
//! What is told and what is measured err to opposite sides: what many small lights leave out is told to be twice as much as it is, and a few directions
//! miss as much of the ripples that a single one leaves. The truth was mostly between them on random maps of all kinds; so the mean is taken, of their
//! logarithms, or what was measured where that is more.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::PoisonError;

use glam::DVec3;
use rayon::prelude::*;

use super::beyond::{Beyond, Suspect, at_pole};
use super::dark::BINS;
use super::lanes::InstructionSet;
use super::plan::{Plan, is_wide, lambdas, usual_degree};
use super::survey::Survey;
use super::{Function, Part, Zonal, least_of};
use crate::environment::kernel::Kernel;
use crate::environment::peel::Peel;
use crate::environment::{error_scale, relative_error};
use crate::math::quadrature::gauss_legendre;

/// Nothing is looked for where the bound of truncation is below this: what truncation did was at most 0.45 of the bound on some thousands of random maps.
const LOOK: f64 = 2e-4;
/// What the last degrees may tell for what is left out to be little.
const GOOD: f64 = 8e-5;
/// The part of it from which on directions are among those that a certificate looks at; how many these are at most, and those that are measured beside.
const SEEN: f64 = 0.25;
const SUSPECTS: usize = 8;
const MEASURED: usize = 4;
/// So many times the usual degrees of a kernel are looked at first, where it has more.
const FEW: usize = 2;

/// What is done about kernels that too much is left out of.
struct Effort {
    /// Degrees, in times the usual ones.
    times: usize,
    /// How much less than what is usual, and than what the error asks for, makes a texel be peeled off.
    share: f64,
    /// Texels that are peeled off at most.
    most: usize,
}

const EFFORTS: [Effort; 3] = [
    Effort { times: 2, share: 0.5, most: 2048 },
    Effort { times: 4, share: 0.1, most: 4096 },
    Effort { times: 8, share: 0.02, most: 16384 },
];

/// Where a kernel's function may be off.
#[derive(Debug)]
pub(super) struct Weak {
    pub kernel: Kernel,
    pub directions: Vec<DVec3>,
    /// By how much, as the last degrees tell, or these and a measurement.
    off: f64,
}

impl Zonal<'_> {
    /// Takes more trouble with kernels that too much is left out of; those that nothing helps are to be summed over the texels.
    pub(super) fn mend(&mut self, survey: &Survey) {
        for effort in EFFORTS.iter().map(Some).chain([None]) {
            self.weak = self.weakest(survey);
            let bad: Vec<&Weak> = self.weak.iter().filter(|weak| weak.off > GOOD).collect();
            let Some(worst) = bad.iter().map(|weak| weak.off).reduce(f64::max) else { return };
            let bad: Vec<Kernel> = bad.iter().map(|weak| weak.kernel).collect();
            let is_bad = |kernel: &Kernel| bad.contains(kernel);
            self.last.get_mut().unwrap_or_else(PoisonError::into_inner).retain(|(kernel, _)| !is_bad(kernel));
            let mut again = vec![];
            for part in &mut self.parts {
                again.extend(part.plans.extract_if(.., |plan| is_bad(&plan.kernel)));
            }
            self.parts.retain(|part| !part.plans.is_empty());
            let Some(effort) = effort else { return };
            let height = self.panorama.height();
            let fresh = |plan: Plan| {
                let least = usual_degree(&plan.kernel) / 2;
                Plan::new(plan.kernel, plan.dark, least, height, self.instructions)
            };
            let plans: Vec<Plan> = again.into_iter().filter_map(fresh).collect();
            let least = effort.share * GOOD / worst * least_of(&plans, effort.times, height);
            let peel = Peel::thoroughly(self.panorama, &survey.brightest, least, effort.most);
            self.parts.push(Part::patient(self.panorama, survey, plans, (peel, effort.times), self.instructions));
        }
    }

    /// Where what is left out of each kernel may show, and how much it does.
    fn weakest(&self, survey: &Survey) -> Vec<Weak> {
        let mean = self.panorama.mean();
        let of_part = |part: &Part| {
            let suspects = part.suspects(mean, self.instructions);
            let kernels = part.plans.iter().map(|plan| plan.kernel);
            kernels.zip(suspects).filter(|(_, suspects)| !suspects.is_empty()).collect::<Vec<_>>()
        };
        let suspects: Vec<(Kernel, Vec<Suspect>)> = self.parts.iter().flat_map(of_part).collect();
        let mut weak: Vec<Weak> = suspects.into_iter().map(|(kernel, suspects)| self.weak(kernel, &suspects)).collect();
        let plans = self.parts.iter().flat_map(|part| part.plans.iter().map(move |plan| (part, plan)));
        let whole: Vec<(&Part, &Plan)> = plans.filter(|(_, plan)| plan.split.is_none()).collect();
        let at_poles = |&(part, plan): &(&Part, &Plan)| (plan.kernel, self.off_at_poles(part, plan, survey));
        let at_poles: Vec<(Kernel, f64)> = whole.par_iter().with_max_len(1).map(at_poles).collect();
        for (kernel, off) in at_poles {
            match weak.iter_mut().find(|weak| weak.kernel == kernel) {
                Some(weak) => weak.off = weak.off.max(off),
                None if off > GOOD => weak.push(Weak { kernel, directions: vec![], off }),
                None => {}
            }
        }
        weak
    }

    /// The error at the poles, relative to its [`error_scale`]. It is known without rings and without a full sum: the filter has only
    /// order 0 there, and the truth is a sum over rows. A map whose upper half is dark is off most just there.
    fn off_at_poles(&self, part: &Part, plan: &Plan, survey: &Survey) -> f64 {
        let (mean, [low, high]) = (self.panorama.mean(), self.range);
        let weights = row_weights(&plan.kernel, self.panorama.height());
        let exact_across = part.exact_across(plan, mean);
        let width = self.panorama.width() as f64;
        let mut off = 0.0f64;
        for (pole, y) in [1.0, -1.0].into_iter().enumerate() {
            let mut wanted = [0.0; 3];
            for (i, weight) in weights.iter().enumerate() {
                let row = &survey.rows[if y > 0.0 { i } else { weights.len() - 1 - i }];
                (0..3).for_each(|c| wanted[c] += weight * (row.moments[0][c] / width + low[c]));
            }
            let own = at_pole(&part.coefficients, &plan.eigenvalues, y);
            let tail =
                part.tail.as_ref().zip(plan.share.as_ref()).map(|(tail, share)| (tail.poles[pole], share.factor));
            let (tail, factor) = tail.unwrap_or_default();
            let mut got = [std::array::from_fn(|c| own[c] + factor * tail[c])];
            part.bright.add(&[DVec3::Y * y], (&plan.kernel, exact_across), &self.exact, &mut got);
            let got = std::array::from_fn(|c| (part.mean[c] + got[0][c]).clamp(low[c], high[c]));
            off = self.relative(got, wanted).into_iter().fold(off, f64::max);
        }
        off
    }

    fn weak(&self, kernel: Kernel, suspects: &[Suspect]) -> Weak {
        let (mean, function) = (self.panorama.mean(), self.function(&kernel));
        // How dark it is there is known better now: there, or, under a kernel that sees less than a bin, anywhere beside.
        let part = |suspect: &Suspect| {
            let beside = is_sharp(&kernel).then(|| beside(suspect.direction, kernel.width()));
            let values = beside
                .into_iter()
                .flatten()
                .map(|direction| function.at(direction))
                .chain([function.at(suspect.direction)]);
            let value = values.reduce(|a, b| std::array::from_fn(|c| a[c].min(b[c]))).unwrap_or_default();
            let lit = (0..3).filter(|&c| mean[c] > 0.0);
            lit.map(|c| suspect.left_out[c] / error_scale(value[c].max(0.0), mean[c])).fold(0.0, f64::max)
        };
        let mut suspects: Vec<(f64, DVec3)> = suspects.par_iter().map(|s| (part(s), s.direction)).collect();
        suspects.sort_by(|a, b| b.0.total_cmp(&a.0));
        suspects.truncate(SUSPECTS);
        let directions = suspects.iter().map(|(_, direction)| *direction).collect();
        let told = suspects.first().map_or(0.0, |(part, _)| *part);
        suspects.truncate(MEASURED);
        suspects.retain(|(part, _)| *part > GOOD);
        if suspects.is_empty() {
            return Weak { kernel, directions, off: told };
        }
        self.exact.prepare();
        let measured = suspects.into_iter().flat_map(|(_, direction)| around(direction, 1.0 / function.degree as f64));
        let measured: Vec<DVec3> = measured.collect();
        let measured = measured.par_iter().flat_map_iter(|&direction| self.errors(&function, direction));
        let measured = measured.reduce(|| 0.0, f64::max);
        Weak { kernel, directions, off: measured.max((told * measured).sqrt()) }
    }

    /// The error of each channel of a function in a direction, relative to its [`error_scale`].
    pub(super) fn errors(&self, function: &Function, direction: DVec3) -> [f64; 3] {
        self.relative(function.at(direction), self.exact.evaluate(direction, &function.kernel))
    }

    fn relative(&self, got: [f64; 3], wanted: [f64; 3]) -> [f64; 3] {
        let mean = self.panorama.mean();
        std::array::from_fn(|c| relative_error(got[c], wanted[c], mean[c]))
    }
}

/// Directions beside one that a grid found: the crest of a ripple that runs along rings may lie between these, and they meet those beside it.
fn around(direction: DVec3, step: f64) -> impl Iterator<Item = DVec3> {
    /// Steps along the meridian, to both sides.
    const ALONG: i32 = 5;
    let across = DVec3::Y.cross(direction).try_normalize().unwrap_or(DVec3::X);
    let along = direction.cross(across);
    let offsets = (-ALONG..=ALONG).map(move |i| f64::from(i) * along).chain([across, -across]);
    offsets.map(move |offset| (direction + step * offset).normalize())
}

/// Directions that are no farther from one than a bin reaches, about a kernel's width apart.
fn beside(direction: DVec3, width: f64) -> impl Iterator<Item = DVec3> {
    const BIN: f64 = 0.16;
    let apart = width.max(BIN / 4.0);
    let steps = (BIN / apart).ceil() as i32;
    let (side, up) = direction.any_orthonormal_pair();
    let steps = move || (-steps..=steps).map(move |i| apart * f64::from(i));
    steps().flat_map(move |s| steps().map(move |t| (direction + s * side + t * up).normalize()))
}

/// Whether a kernel is narrower than the bins that suspects are sought in, and its last degrees show: what is left out is then largest at a bright
/// place of a bin, but in parts of the value at a dark one.
fn is_sharp(kernel: &Kernel) -> bool {
    kernel.is_ring() && kernel.width() < 0.2
}

/// ∫ K over each row of a map, R being the pole above.
fn row_weights(kernel: &Kernel, height: usize) -> Vec<f64> {
    /// Radians that the rule holds any kernel over that harmonics do.
    const PANEL: f64 = 0.01;
    let rule = gauss_legendre(8);
    let of_row = |row: usize| {
        let [top, bottom] = [row, row + 1].map(|r| (PI * r as f64 / height as f64).min(FRAC_PI_2));
        let n = ((bottom - top) / PANEL).ceil();
        let length = (bottom - top) / n;
        let panel = |i: usize| {
            length
                * rule.integrate(|t| {
                    let theta = top + (i as f64 + t) * length;
                    2.0 * PI * theta.sin() * kernel.eval(2.0 * (0.5 * theta).sin().powi(2))
                })
        };
        (0..n as usize).map(panel).sum()
    };
    (0..height).map(|row| if 2 * row < height { of_row(row) } else { 0.0 }).collect()
}

impl Part {
    /// For each plan where what is left out may show; nothing where it does not.
    fn suspects(&self, mean: [f64; 3], instructions: InstructionSet) -> Vec<Vec<Suspect>> {
        // What is known of the last degrees, even or odd, up to some one.
        let mut known: Vec<(usize, bool, Beyond)> = vec![];
        let mut lambert = vec![];
        let mut beyond = |plan: &Plan, degree: usize| -> Vec<Suspect> {
            let mut suspects = vec![Suspect::default(); BINS[0] * BINS[1]];
            if let (Some(tail), Some(share)) = (&self.tail, &plan.share) {
                tail.beyond.add_to(&mut suspects, share.factor);
            }
            for is_odd in [false, true].into_iter().skip(usize::from(plan.share.is_some())) {
                let is_same = |(of, odd, _): &(usize, bool, Beyond)| (*of, *odd) == (degree, is_odd);
                if is_odd && !has_wide_end(plan) {
                    continue;
                }
                if !known.iter().any(is_same) {
                    if lambert.len() <= degree {
                        lambert = lambdas(&Kernel::new(1.0), self.coefficients.degree, instructions);
                    }
                    let lambda = if is_odd { &plan.eigenvalues } else { &lambert[..=degree] };
                    known.push((degree, is_odd, Beyond::new(&self.coefficients, (lambda, is_odd), mean, instructions)));
                }
                if let Some((.., beyond)) = known.iter().find(|of| is_same(of)) {
                    let [slope, ..] = plan.kernel.horizon();
                    let factor = if has_wide_end(plan) { beyond.factor(&plan.eigenvalues) } else { PI * slope };
                    beyond.add_to(&mut suspects, factor);
                }
            }
            let shows = |(bin, suspect): (usize, &Suspect)| {
                let dark = plan.dark.in_bin(bin);
                (0..3).any(|c| mean[c] > 0.0 && suspect.left_out[c] > SEEN * GOOD * dark[c] * mean[c])
            };
            let shows: Vec<bool> = suspects.iter().enumerate().map(shows).collect();
            suspects.into_iter().zip(shows).filter_map(|(suspect, shows)| shows.then_some(suspect)).collect()
        };
        let of_plan = |plan: &Plan| {
            if self.truncation(plan, mean) < LOOK {
                return vec![];
            }
            // Fewer degrees leave out more: where that does not show, nor does the rest.
            let few = FEW * usual_degree(&plan.kernel);
            let is_little = !has_wide_end(plan) && few < plan.degree() && beyond(plan, few).is_empty();
            if is_little { vec![] } else { beyond(plan, plan.degree()) }
        };
        self.plans.iter().map(of_plan).collect()
    }
}

/// Whether the last degrees of a plan are those of its kernel's horizon. (Those of a narrow kernel are its peak's, of which nothing is left; its kink is
/// slight.)
fn has_wide_end(plan: &Plan) -> bool {
    is_wide(&plan.kernel) && plan.split.is_none()
}
