//! The zonal filter: a panorama convolved with a kernel of R·l alone, by spherical harmonics, straight from its texels.
//!
//! By Funk and Hecke's theorem such a convolution multiplies the coefficients of degree l by one number λ_l. Texels become
//! coefficients (`analysis`), once for all kernels; λ_l (`eigenvalues`) times coefficients become values on a grid of rings, and
//! interpolation between rings answers for any direction (`synthesis`), so no layout has seams. How many degrees a kernel
//! takes follows from the darkest output (`plan`). Wide kernels end at their horizon with a kink, which harmonics only follow slowly:
//! texels bright enough for that to show are peeled off first and summed exactly. The mean is taken off first and added back: a
//! constant stays what it is. Kernels too narrow for harmonics are summed over the texels ([`FullSum`]).

mod analysis;
mod bright;
mod eigenvalues;
mod fft;
mod lanes;
mod legendre;
mod plan;
mod synthesis;

use std::f64::consts::PI;
use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;
use rayon::prelude::*;

pub use lanes::InstructionSet;

use super::cube::{Cube, texel_direction};
use super::full_sum::FullSum;
use super::kernel::Kernel;
use super::panorama::Panorama;
use super::peel::Peel;
use analysis::{Coefficients, Texels, analyse};
use bright::Bright;
use lanes::V;
use plan::{Plan, WIDE_DEGREE, cells, darkest, is_wide, row_rule};
use synthesis::Rings;

/// Texels that are peeled off at most, for wide kernels and for narrow ones.
const MOST_PEELED: [usize; 2] = [1024, 64];

/// Peeled texels that all kernels may as well share.
const FEW: usize = 16;

/// A bound of truncation above this, which is some thousand times what truncation does, asks for more degrees.
const HARD: f64 = 1e-2;

/// Directions that a thread answers for at a time.
const LINE: usize = 64;

/// A panorama made ready to be filtered by some kernels.
#[derive(Debug)]
pub struct Zonal<'a> {
    panorama: &'a Panorama,
    exact: FullSum<'a>,
    instructions: InstructionSet,
    /// Wide kernels, then narrow ones.
    parts: Vec<Part>,
    /// The darkest and the brightest texel: no average lies beyond.
    range: [[f64; 3]; 2],
    /// The last rings that were asked for: a chain that ends at alpha 1 and the irradiance share theirs.
    last: Mutex<Option<(Kernel, Arc<Rings>)>>,
}

/// Some kernels, and the panorama as they see it: most of it as coefficients.
#[derive(Debug)]
struct Part {
    plans: Vec<Plan>,
    bright: Bright,
    /// Means of what was not peeled off.
    mean: [f64; 3],
    /// ∫ (f − mean)².
    norm2: [f64; 3],
    /// The largest part of a channel's light that was not peeled off.
    share: f64,
    coefficients: Coefficients,
}

/// The panorama filtered by one kernel: a function of the direction.
#[derive(Debug)]
pub struct Function<'a> {
    zonal: &'a Zonal<'a>,
    kernel: Kernel,
    /// Nothing if the kernel is too narrow for harmonics.
    rings: Option<(&'a Part, Arc<Rings>)>,
    /// Degrees of the harmonics; 0 if texels are summed instead.
    pub degree: usize,
    /// What truncation changes at most, in parts of the value or of [`super::DARK_FLOOR`] of the mean.
    pub truncation: f64,
}

impl<'a> Zonal<'a> {
    /// Prepares a panorama for these kernels.
    pub fn new(panorama: &'a Panorama, kernels: &[Kernel], instructions: InstructionSet) -> Self {
        let cells = cells(panorama);
        let mut plans: [Vec<Plan>; 2] = [vec![], vec![]];
        for kernel in kernels {
            let darkest = darkest(panorama, &cells, kernel);
            let side = usize::from(!is_wide(kernel));
            plans[side].extend(Plan::new(*kernel, darkest, WIDE_DEGREE, instructions));
        }
        let parts = parts(panorama, plans, instructions);
        let range = [panorama.min(), panorama.max()].map(|texel| texel.map(f64::from));
        Self { panorama, exact: FullSum::new(panorama), instructions, parts, range, last: Mutex::new(None) }
    }

    /// The panorama filtered by a kernel; one that it was not prepared for is summed over the texels.
    pub fn function(&'a self, kernel: &Kernel) -> Function<'a> {
        let of = |part: &'a Part| part.plans.iter().find(|plan| plan.kernel == *kernel).map(|plan| (part, plan));
        let Some((part, plan)) = self.parts.iter().find_map(of) else {
            return Function { zonal: self, kernel: *kernel, rings: None, degree: 0, truncation: 0.0 };
        };
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let rings = match &*last {
            Some((of, rings)) if of == kernel => rings.clone(),
            _ => Arc::new(Rings::new(&part.coefficients, &plan.eigenvalues, plan.grid, self.instructions)),
        };
        *last = Some((*kernel, rings.clone()));
        drop(last);
        let truncation = plan.truncation(part.share, self.panorama.mean(), part.norm2, &part.coefficients);
        Function { zonal: self, kernel: *kernel, rings: Some((part, rings)), degree: plan.degree(), truncation }
    }
}

impl Function<'_> {
    /// The value in a unit direction.
    #[inline(always)]
    pub fn at(&self, direction: DVec3) -> [f64; 3] {
        let Some((part, rings)) = &self.rings else { return self.zonal.exact.evaluate(direction, &self.kernel) };
        let smooth = rings.at(direction);
        let peeled = part.bright.evaluate(direction, &self.kernel, &self.zonal.exact, self.zonal.instructions);
        // An average lies between the extremes. The clamp only keeps errors of truncation (1e-7 of the mean) from making black
        // negative beside a sun.
        let [low, high] = self.zonal.range;
        std::array::from_fn(|c| (part.mean[c] + smooth[c] + peeled[c]).clamp(low[c], high[c]))
    }

    /// The values in many unit directions.
    pub fn values(&self, directions: &[DVec3]) -> Vec<[f64; 3]> {
        let mut values = vec![[0.0; 3]; directions.len()];
        values.par_chunks_mut(LINE).zip(directions.par_chunks(LINE)).for_each(|(out, directions)| {
            self.zonal.instructions.run(
                #[inline(always)]
                || out.iter_mut().zip(directions).for_each(|(value, direction)| *value = self.at(*direction)),
            );
        });
        values
    }

    /// The value at every texel of a cube. `finished` is told how many texels have been finished since its last call.
    pub fn cube(&self, size: usize, finished: &(dyn Fn(u64) + Sync)) -> Cube {
        let mut texels = vec![[0.0; 3]; 6 * size * size];
        texels.par_chunks_mut(size).enumerate().for_each(|(line, out)| {
            self.zonal.instructions.run(
                #[inline(always)]
                || {
                    for (i, texel) in out.iter_mut().enumerate() {
                        let value = self.at(texel_direction(size, line * size + i));
                        *texel = [value[0] as f32, value[1] as f32, value[2] as f32];
                    }
                },
            );
            finished(size as u64);
        });
        Cube { size, texels }
    }

    /// The difference from the full sum where it is likely to be largest: root mean square and maximum, relative to the value
    /// or to [`super::DARK_FLOOR`] of the mean. `cube` holds this function.
    pub fn measure(&self, cube: &Cube) -> (f64, f64) {
        let mean = self.zonal.panorama.mean();
        let errors: Vec<f64> = aims(self.zonal.panorama, &self.kernel, cube)
            .par_iter()
            .flat_map_iter(|&direction| {
                let wanted = self.zonal.exact.evaluate(direction, &self.kernel);
                let got = self.at(direction);
                (0..3).map(move |c| {
                    let scale = wanted[c].abs().max(super::DARK_FLOOR * mean[c].abs());
                    if got[c] == wanted[c] { 0.0 } else { (got[c] - wanted[c]).abs() / scale }
                })
            })
            .collect();
        let squares: f64 = errors.iter().map(|e| e * e).sum();
        ((squares / errors.len() as f64).sqrt(), errors.into_iter().fold(0.0, f64::max))
    }
}

/// Where errors hide: at the brightest texel and opposite to it, beside it (interpolation), at its horizon (the kink), at
/// the poles, at a corner and an edge of a cube, and in its darkest texels.
fn aims(panorama: &Panorama, kernel: &Kernel, cube: &Cube) -> Vec<DVec3> {
    /// Beside the sun, in widths of the kernel; and on either side of its horizon, in radians.
    const BESIDE: [f64; 3] = [0.5, 1.0, 3.0];
    const ACROSS: [f64; 3] = [0.0, 0.004, -0.01];
    const DARKEST: usize = 4;
    let (column, row, _) = panorama.peak();
    let sun = panorama.texel_box(column, row).middle();
    let (side, up) = sun.any_orthonormal_pair();
    let towards = |away: DVec3, angle: f64| sun * angle.cos() + away * angle.sin();
    let mut aims =
        vec![sun, -sun, DVec3::Y, DVec3::NEG_Y, DVec3::ONE.normalize(), DVec3::new(1.0, 0.0, 1.0).normalize()];
    for away in [side, up, -side, -up] {
        aims.extend(BESIDE.map(|widths| towards(away, (2.0 * kernel.alpha() * widths).min(1.4))));
        aims.extend(ACROSS.map(|angle| towards(away, 0.5 * PI - angle)));
    }
    let mut darkest: Vec<(f32, usize)> =
        cube.texels.iter().enumerate().map(|(i, t)| (t[0].min(t[1]).min(t[2]), i)).collect();
    let n = DARKEST.min(darkest.len());
    darkest.select_nth_unstable_by(n - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    aims.extend(darkest[..n].iter().map(|&(_, index)| texel_direction(cube.size, index)));
    aims
}

impl Part {
    /// With more degrees where those that usually do leave too much out.
    fn patient(panorama: &Panorama, plans: Vec<Plan>, peeled: Peeled, instructions: InstructionSet) -> Self {
        let part = Self::new(panorama, plans, peeled, instructions);
        let mean = panorama.mean();
        let left = |plan: &Plan| plan.truncation(part.share, mean, part.norm2, &part.coefficients);
        if part.plans.iter().all(|plan| !is_wide(&plan.kernel) || left(plan) <= HARD) {
            return part;
        }
        let more = |plan: Plan| match is_wide(&plan.kernel) {
            true => Plan::new(plan.kernel, plan.darkest, 2 * WIDE_DEGREE, instructions),
            false => Some(plan),
        };
        let plans: Vec<Plan> = part.plans.into_iter().filter_map(more).collect();
        let peeled = peel(panorama, &plans);
        Self::new(panorama, plans, peeled, instructions)
    }

    fn new(panorama: &Panorama, plans: Vec<Plan>, (peel, rest): Peeled, instructions: InstructionSet) -> Self {
        let degree = plans.iter().map(Plan::degree).max().unwrap_or(0);
        let narrowest = plans.iter().map(|plan| plan.kernel.width()).fold(2.0, f64::min);
        let (mean, whole) = (rest.mean(), panorama.mean());
        let share = (0..3).filter(|&c| whole[c] > 0.0).map(|c| mean[c] / whole[c]).fold(0.0, f64::max);
        let square = |row: usize| {
            let mut sum = [0.0; 3];
            for texel in rest.row(row) {
                (0..3).for_each(|c| sum[c] += (f64::from(texel[c]) - mean[c]).powi(2));
            }
            sum.map(|s| s * rest.solid_angle(row))
        };
        // Rows on any thread, their sum in one order.
        let rows: Vec<[f64; 3]> = (0..rest.height()).into_par_iter().map(square).collect();
        let norm2 = std::array::from_fn(|c| rows.iter().map(|row| row[c]).sum());
        let rule = row_rule(narrowest, degree, panorama.height());
        let mut coefficients = analyse(&BeyondMean { panorama: &rest, mean }, degree, &rule, instructions);
        // What is left of the mean is rounding.
        coefficients.orders[0][0] = [0.0; 6];
        Self { plans, bright: Bright::new(peel, panorama), mean, norm2, share, coefficients }
    }
}

/// What is peeled off, and the panorama without it.
type Peeled = (Peel, Panorama);

/// The texels that show across the horizon of one of these kernels, and the panorama without them.
fn peel(panorama: &Panorama, plans: &[Plan]) -> Peeled {
    let least = plans.iter().map(|plan| least_share(plan, panorama.height())).fold(1.0, f64::min);
    let is_wide = plans.iter().any(|plan| is_wide(&plan.kernel));
    Peel::strongest(panorama, least, MOST_PEELED[usize::from(!is_wide)])
}

/// Kernels that see the same panorama: all of them, if wide ones ask for few texels to be peeled off; else wide ones, and narrow
/// ones, which are asked at more directions.
fn parts(panorama: &Panorama, [wide, narrow]: [Vec<Plan>; 2], instructions: InstructionSet) -> Vec<Part> {
    let mut parts = vec![];
    let mut rest = narrow;
    if !wide.is_empty() {
        let peeled = peel(panorama, &wide);
        let mut plans = wide;
        if peeled.0.len() <= FEW {
            plans.append(&mut rest);
        }
        parts.push(Part::patient(panorama, plans, peeled, instructions));
    }
    if !rest.is_empty() {
        let peeled = peel(panorama, &rest);
        parts.push(Part::patient(panorama, rest, peeled, instructions));
    }
    parts
}

/// The part of the light that a texel must hold for the kernel's horizon to show, and to be peeled off.
///
/// The kink a max(c, 0), a = K′(0), is off by some a/(5L) when cut off at degree L; 1e-4 of the darkest output (which is reckoned
/// three times too dark) is left to the texels of a cell that L does not resolve.
fn least_share(plan: &Plan, height: usize) -> f64 {
    let [slope, ..] = plan.kernel.horizon();
    let degree = plan.degree() as f64;
    let cell = 1.0 + (height as f64 / degree).powi(2);
    1e-4 * plan.darkest * 5.0 * degree / (slope * 4.0 * PI * cell)
}

/// A panorama without its mean.
struct BeyondMean<'a> {
    panorama: &'a Panorama,
    mean: [f64; 3],
}

impl Texels for BeyondMean<'_> {
    fn shape(&self) -> [usize; 2] {
        [self.panorama.width(), self.panorama.height()]
    }

    fn occupied(&self, row: usize) -> bool {
        let mean = self.mean;
        self.panorama.row(row).iter().any(|texel| texel.map(f64::from) != mean)
    }

    fn add_row(&self, row: usize, channel: usize, factor: f64, lane: usize, to: &mut [V]) {
        for (out, texel) in to.iter_mut().zip(self.panorama.row(row)) {
            out[lane] += factor * (f64::from(texel[channel]) - self.mean[channel]);
        }
    }
}
#[cfg(test)]
mod tests;
