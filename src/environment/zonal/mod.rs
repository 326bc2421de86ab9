//! The zonal filter: a panorama convolved with a kernel of R·l alone, by spherical harmonics, straight from its texels.
//!
//! By Funk and Hecke's theorem such a convolution multiplies the coefficients of degree l by one number λ_l. Texels become
//! coefficients (`analysis`, of fine panoramas by fewer `nodes`), once for all kernels; λ_l (`eigenvalues`) times coefficients become values on a grid of rings, and
//! interpolation between rings answers for any direction (`synthesis`), so no layout has seams. How many degrees a kernel
//! takes follows from the darkest output (`plan`). Wide kernels end at their horizon with a kink, which harmonics only follow slowly:
//! texels bright enough for that to show are peeled off first and summed exactly. The darkest value is taken off first, and degree 0 is the
//! exact mean: a constant stays what it is. Higher degrees that dark maps ask for, kernels share (`tail`). Of kernels too narrow for harmonics, the
//! part near the axis is summed over the texels there (`split`).

mod analysis;
mod beyond;
mod bright;
mod dark;
mod eigenvalues;
mod fft;
mod lanes;
mod legendre;
mod mend;
mod nodes;
mod plan;
mod sides;
mod split;
mod survey;
mod synthesis;
mod tail;

use std::borrow::Cow;
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
use analysis::{Coefficients, Rows, Texels, analyse};
use bright::Bright;
use dark::{Dark, cells};
use legendre::Degrees;
use mend::Weak;
use nodes::Nodes;
use plan::{MOST_DEGREE, Plan, is_wide, lambdas, row_rule, usual_degree};
use sides::{BAND, SIDES, fill_band};
use split::Places;
use survey::{Survey, moments};
use synthesis::{PoleAngles, Rings, angles};
use tail::Tail;

/// Texels that are peeled off at most, for wide kernels and for narrow ones.
const MOST_PEELED: [usize; 2] = [1024, 64];

/// Peeled texels that all kernels may as well share.
const FEW: usize = 16;

/// More peeled texels are parts of lamps: all that is brighter than the darkest texel is then taken off, if it is so many times what else shows.
const MANY: usize = 64;
const LAMPS: f64 = 4.0;

/// A bound of truncation above this, which is some hundred times what truncation does, asks for more degrees.
const HARD: f64 = 3e-3;
/// More degrees are to leave so many times less than such a bound means. What truncation does falls like degree⁻³ (its bound like degree⁻²): on four
/// real maps it was 0.005 to 0.016 of the bound at the usual degrees.
const LESS: f64 = 1.6;

/// The map is analysed again for so many times as many degrees as it was, if a tail needs them beside it.
const FARTHER: f64 = 1.2;

/// Rings that are kept.
const KEPT: usize = 4;

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
    /// Where functions may be off.
    weak: Vec<Weak>,
    /// The last rings that were made: levels ask for theirs more than once, and a chain that ends at alpha 1 and the irradiance share them.
    last: Mutex<Vec<(Kernel, Arc<Rings>)>>,
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
    /// Their Σ |f_lm|².
    powers: Vec<[f64; 3]>,
    /// Degrees beyond these, if a kernel asks for some.
    tail: Option<Tail>,
    /// What was not peeled off, if a kernel sums texels near its axis.
    near: Option<(Panorama, Places)>,
}

/// The panorama filtered by one kernel: a function of the direction.
#[derive(Debug)]
pub struct Function<'a> {
    zonal: &'a Zonal<'a>,
    kernel: Kernel,
    /// Nothing if texels are summed instead.
    rings: Option<(&'a Part, &'a Plan, Arc<Rings>)>,
    /// Of peeled texels, those that are integrated exactly across the horizon.
    exact_across: usize,
    /// Degrees of the harmonics; 0 if texels are summed instead.
    pub degree: usize,
    /// What truncation changes at most, in parts of the value or of [`super::DARK_FLOOR`] of the mean.
    pub truncation: f64,
    /// What truncation and interpolation change at most towards a lone sun, in parts of the value.
    pub at_a_sun: f64,
}

impl<'a> Zonal<'a> {
    /// Prepares a panorama for these kernels.
    pub fn new(panorama: &'a Panorama, kernels: &[Kernel], instructions: InstructionSet) -> Self {
        Self::beside(FullSum::new(panorama), panorama, kernels, instructions)
    }

    /// The same, with a full sum of the panorama that others use too.
    pub(super) fn beside(
        exact: FullSum<'a>,
        panorama: &'a Panorama,
        kernels: &[Kernel],
        instructions: InstructionSet,
    ) -> Self {
        let survey = Survey::new(panorama, instructions);
        let cells = cells(panorama, &survey);
        let mut plans: [Vec<Plan>; 2] = [vec![], vec![]];
        let of_kernel = |kernel: &Kernel| {
            let dark = Dark::new(panorama, &cells, kernel, instructions);
            Plan::new(*kernel, dark, usual_degree(kernel) / 2, panorama.height(), instructions)
        };
        let all: Vec<Option<Plan>> = kernels.par_iter().with_max_len(1).map(of_kernel).collect();
        for plan in all.into_iter().flatten() {
            plans[usize::from(!is_wide(&plan.kernel) || plan.split.is_some())].push(plan);
        }
        let parts = parts(panorama, &survey, plans, instructions);
        let range = [panorama.min(), panorama.max()].map(|texel| texel.map(f64::from));
        let mut zonal = Self { panorama, exact, instructions, parts, range, weak: vec![], last: Mutex::default() };
        zonal.mend(&survey);
        zonal
    }

    /// Prepares the full sum that functions are measured against.
    pub(super) fn prepare(&self) {
        self.exact.prepare();
    }

    /// The panorama filtered by a kernel; one that it was not prepared for is summed over the texels.
    pub fn function(&'a self, kernel: &Kernel) -> Function<'a> {
        let of = |part: &'a Part| part.plans.iter().find(|plan| plan.kernel == *kernel).map(|plan| (part, plan));
        let Some((part, plan)) = self.parts.iter().find_map(of) else {
            let (exact_across, degree, truncation, at_a_sun) = (0, 0, 0.0, 0.0);
            return Function { zonal: self, kernel: *kernel, rings: None, exact_across, degree, truncation, at_a_sun };
        };
        let mean = self.panorama.mean();
        let truncation = part.truncation(plan, mean);
        let exact_across = part.exact_across(plan, mean);
        let grid = plan.grid(truncation);
        let last = || self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let known = last().iter().find(|(of, _)| of == kernel).map(|(_, rings)| rings.clone());
        // (Not under the lock: a thread that waits for others here may take up another level.)
        let rings = known.unwrap_or_else(|| {
            let rings = Rings::new(&part.coefficients, &plan.eigenvalues, part.mean, grid, self.instructions);
            let (rings, mut last) = (Arc::new(rings), last());
            if last.len() == KEPT {
                last.remove(0);
            }
            last.push((*kernel, rings.clone()));
            rings
        });
        let (rings, at_a_sun) = (Some((part, plan, rings)), plan.at_a_sun(grid));
        let degree = plan.last_degree();
        Function { zonal: self, kernel: *kernel, rings, exact_across, degree, truncation, at_a_sun }
    }
}

impl Function<'_> {
    /// The value in a unit direction.
    pub fn at(&self, direction: DVec3) -> [f64; 3] {
        let mut value = [[0.0; 3]];
        self.fill(&[direction], |_| angles(direction), &mut value);
        value[0]
    }

    /// The values in unit directions, `angles` their angles.
    fn fill(&self, directions: &[DVec3], angles: impl Fn(usize) -> [f64; 2], values: &mut [[f64; 3]]) {
        self.zonal.instructions.run(
            #[inline(always)]
            || self.fill_by(directions, &angles, values),
        );
    }

    #[inline(always)]
    fn fill_by(&self, directions: &[DVec3], angles: &impl Fn(usize) -> [f64; 2], values: &mut [[f64; 3]]) {
        let Some((_, _, rings)) = &self.rings else {
            for (value, &direction) in values.iter_mut().zip(directions) {
                *value = self.zonal.exact.evaluate(direction, &self.kernel);
            }
            return;
        };
        for (i, value) in values.iter_mut().enumerate() {
            *value = rings.at(angles(i));
        }
        if let Some((tail, factor)) = self.tail() {
            for (i, value) in values.iter_mut().enumerate() {
                let of_tail = tail.at(angles(i));
                (0..3).for_each(|c| value[c] += factor * of_tail[c]);
            }
        }
        self.finish(directions, values);
    }

    /// Degrees that are summed for other kernels too, and what they are multiplied by.
    fn tail(&self) -> Option<(&Rings, f64)> {
        let (part, plan, _) = self.rings.as_ref()?;
        Some((&part.tail.as_ref()?.rings, plan.share.as_ref()?.factor))
    }

    /// Adds what rings do not hold.
    #[inline(always)]
    fn finish(&self, directions: &[DVec3], values: &mut [[f64; 3]]) {
        let Some((part, plan, _)) = &self.rings else { return };
        part.bright.add(directions, (&self.kernel, self.exact_across), &self.zonal.exact, values);
        // An average lies between the extremes. The clamp only keeps errors of truncation (1e-7 of the mean) from making black
        // negative beside a sun.
        let [low, high] = self.zonal.range;
        for (value, &direction) in values.iter_mut().zip(directions) {
            let mut mean = part.mean;
            if let (Some(split), Some((rest, places))) = (&plan.split, &part.near)
                && let Some(near) = split.mean(direction, rest, places)
            {
                let far = plan.eigenvalues[0];
                mean = std::array::from_fn(|c| far * mean[c] + (1.0 - far) * near[c]);
            }
            *value = std::array::from_fn(|c| (mean[c] + value[c]).clamp(low[c], high[c]));
        }
    }

    /// The values in many unit directions.
    pub fn values(&self, directions: &[DVec3]) -> Vec<[f64; 3]> {
        let mut values = vec![[0.0; 3]; directions.len()];
        values.par_chunks_mut(LINE).zip(directions.par_chunks(LINE)).for_each(|(out, directions)| {
            self.fill(directions, |i| angles(directions[i]), out);
        });
        values
    }

    /// The value at every texel of a cube. `finished` is told how many texels have been finished since its last call.
    pub fn cube(&self, size: usize, finished: &(dyn Fn(u64) + Sync)) -> Cube {
        let Some((_, _, rings)) = &self.rings else { return self.zonal.exact.filter(size, &self.kernel, finished) };
        let mut texels = vec![[0.0; 3]; 6 * size * size];
        self.fill_faces(rings, size, &mut texels, finished);
        Cube { size, texels }
    }

    fn fill_faces(&self, rings: &Rings, size: usize, texels: &mut [[f32; 3]], finished: &(dyn Fn(u64) + Sync)) {
        let instructions = self.zonal.instructions;
        let rings: Vec<(&Rings, f64)> = [(rings, 1.0)].into_iter().chain(self.tail()).collect();
        let mut faces: Vec<&mut [[f32; 3]]> = texels.chunks_exact_mut(size * size).collect();
        let poles = faces.drain(2..4).collect::<Vec<_>>();
        let mut bands: Vec<Vec<&mut [[f32; 3]]>> =
            (0..size.div_ceil(BAND)).map(|_| Vec::with_capacity(SIDES.len())).collect();
        for face in faces {
            face.chunks_mut(BAND * size).zip(&mut bands).for_each(|(rows, band)| band.push(rows));
        }
        bands.into_par_iter().enumerate().for_each(|(band, mut faces)| {
            if let [a, b, c, d] = &mut faces[..] {
                instructions.run(
                    #[inline(always)]
                    || {
                        fill_band(
                            &rings,
                            size,
                            band * BAND,
                            &mut [a, b, c, d],
                            #[inline(always)]
                            |column| self.finish(column.directions, column.values),
                        )
                    },
                );
                finished(faces.iter().map(|rows| rows.len() as u64).sum());
            }
        });
        let angles = PoleAngles::new(size);
        let lines: Vec<(usize, usize, &mut [[f32; 3]])> = poles
            .into_iter()
            .zip([2, 3])
            .flat_map(|(face, index)| {
                face.chunks_exact_mut(size).enumerate().map(move |(row, line)| (index, row, line))
            })
            .collect();
        lines.into_par_iter().for_each(|(face, row, out)| {
            let (mut directions, mut values) = ([DVec3::ZERO; LINE], [[0.0; 3]; LINE]);
            for (chunk, out) in out.chunks_mut(LINE).enumerate() {
                let (first, n) = (chunk * LINE, out.len());
                for (i, direction) in directions[..n].iter_mut().enumerate() {
                    *direction = texel_direction(size, (face * size + row) * size + first + i);
                }
                self.fill(&directions[..n], |i| angles.of(face, row, first + i), &mut values[..n]);
                for (texel, value) in out.iter_mut().zip(&values) {
                    *texel = value.map(|v| v as f32);
                }
            }
            finished(size as u64);
        });
    }

    /// The difference from the full sum where it is likely to be largest (in directions that the last degrees point at, too): root mean square and maximum, relative to the value
    /// or to [`super::DARK_FLOOR`] of the mean. `cube` holds this function.
    pub fn measure(&self, cube: &Cube) -> (f64, f64) {
        self.zonal.exact.prepare();
        let weak = self.zonal.weak.iter().filter(|weak| weak.kernel == self.kernel);
        let mut aims = aims(self.zonal.exact.sun(), &self.kernel, cube);
        aims.extend(weak.flat_map(|weak| &weak.directions));
        let errors: Vec<f64> = aims.par_iter().flat_map_iter(|&direction| self.zonal.errors(self, direction)).collect();
        let squares: f64 = errors.iter().map(|e| e * e).sum();
        ((squares / errors.len() as f64).sqrt(), errors.into_iter().fold(0.0, f64::max))
    }
}

/// Where errors hide: at the brightest texel and opposite to it, beside it (interpolation), at its horizon (the kink), at
/// the poles, at a corner and an edge of a cube, and in its darkest texels.
fn aims(sun: DVec3, kernel: &Kernel, cube: &Cube) -> Vec<DVec3> {
    /// Beside the sun, in widths of the kernel; and on either side of its horizon, in radians.
    const BESIDE: [f64; 3] = [0.5, 1.0, 3.0];
    const ACROSS: [f64; 3] = [0.0, 0.004, -0.01];
    const DARKEST: usize = 4;
    let (side, up) = sun.any_orthonormal_pair();
    let towards = |away: DVec3, angle: f64| sun * angle.cos() + away * angle.sin();
    let mut aims =
        vec![sun, -sun, DVec3::Y, DVec3::NEG_Y, DVec3::ONE.normalize(), DVec3::new(1.0, 0.0, 1.0).normalize()];
    aims.extend(
        [side, -up]
            .into_iter()
            .flat_map(|away| BESIDE.map(|widths| towards(away, (2.0 * kernel.alpha() * widths).min(1.4)))),
    );
    aims.extend([up, -side].into_iter().flat_map(|away| ACROSS.map(|angle| towards(away, 0.5 * PI - angle))));
    let mut darkest: Vec<(f32, usize)> =
        cube.texels.iter().enumerate().map(|(i, t)| (t[0].min(t[1]).min(t[2]), i)).collect();
    let n = DARKEST.min(darkest.len());
    darkest.select_nth_unstable_by(n - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    aims.extend(darkest[..n].iter().map(|&(_, index)| texel_direction(cube.size, index)));
    aims
}

impl Part {
    /// With more degrees where those that an easy map takes leave too much out; so many times the usual ones where texels are left because of that.
    fn patient(
        panorama: &Panorama,
        survey: &Survey,
        plans: Vec<Plan>,
        (peel, times): (Peel, usize),
        instructions: InstructionSet,
    ) -> Self {
        let rest = Rest::new(panorama, survey, &peel);
        let mut part = Self::new(panorama, &rest, plans, Bright::new(peel, panorama), instructions);
        let mean = panorama.mean();
        let wanted = |plan: &Plan| {
            let left = part.truncation(plan, mean);
            let most = (times.max(2) * usual_degree(&plan.kernel)).min(MOST_DEGREE);
            let enough = (libm::cbrt(LESS * left / HARD) * plan.degree() as f64) as usize;
            // (What a slight kink leaves out is too much only where all else has been tried.)
            let is_kinked = is_wide(&plan.kernel) || times > 2;
            let is_short = (times > 1 || left > HARD) && plan.split.is_none() && is_kinked;
            is_short.then_some((left, if times > 1 { most.max(plan.degree()) } else { enough.min(most) }))
        };
        let wanted: Vec<Option<(f64, usize)>> = part.plans.iter().map(wanted).collect();
        let takers = || part.plans.iter().zip(&wanted).filter_map(|(plan, wanted)| Some((plan.degree(), (*wanted)?)));
        let Some(least) = takers().map(|(own, _)| own).min() else { return part };
        let degree = takers().map(|(_, (_, degree))| degree).max().unwrap_or(least);
        let lambert = lambdas(&Kernel::new(1.0), degree, instructions);
        let own_of = |(plan, wanted): (&Plan, &Option<(f64, usize)>)| {
            wanted.map_or(0, |(_, degree)| plan.own_beside_tail(degree, &lambert, instructions))
        };
        let own: Vec<usize> = part.plans.par_iter().zip(&wanted).map(own_of).collect();
        if part.plans.iter().zip(&own).any(|(plan, &own)| own as f64 > FARTHER * plan.degree() as f64) {
            let more = |(plan, own): (Plan, usize)| {
                let again = || Plan::new(plan.kernel, plan.dark.clone(), own, panorama.height(), instructions);
                (own > plan.degree()).then(again).flatten().unwrap_or(plan)
            };
            let plans = part.plans.into_iter().zip(own).map(more).collect();
            part = Self::new(panorama, &rest, plans, part.bright, instructions);
        }
        // From half of the kernels' own degrees on: what these then hold of the upper half is less, and needs fewer rings.
        let tail = Tail::new(&rest, least / 2, lambert, mean, instructions);
        part.plans.par_iter_mut().zip(wanted).with_max_len(1).for_each(|(plan, wanted)| {
            if let Some((left, _)) = wanted {
                plan.take(&tail, left, instructions);
            }
        });
        part.tail = Some(tail);
        part
    }

    fn new(panorama: &Panorama, rest: &Rest, plans: Vec<Plan>, bright: Bright, instructions: InstructionSet) -> Self {
        let degree = plans.iter().map(Plan::degree).max().unwrap_or(0);
        // (The rest of a split kernel is as smooth as its degree says.)
        let width = |plan: &Plan| if plan.split.is_some() { 4.0 / plan.degree() as f64 } else { plan.kernel.width() };
        let narrowest = plans.iter().map(width).fold(2.0, f64::min);
        let (mean, norm2, whole) = (rest.mean, rest.norm2, panorama.mean());
        let share = (0..3).filter(|&c| whole[c] > 0.0).map(|c| mean[c] / whole[c]).fold(0.0, f64::max);
        // (A narrow kernel's kink is slight, but where a map is coarse and dark it shows.)
        let kinked = |plan: &Plan| match is_wide(&plan.kernel) {
            true => plan.degree(),
            false => plan.degree().min(usual_degree(&plan.kernel)),
        };
        let kinked = plans.iter().filter(|plan| plan.split.is_none()).map(kinked).max().unwrap_or(0);
        let rows = match Nodes::for_kernels(narrowest, [kinked, degree], rest.shape()) {
            Some(nodes) => Rows::Nodes(nodes),
            None => Rows::Points(row_rule(narrowest, kinked, panorama.height())),
        };
        let mut coefficients = analyse(rest, degree, Degrees::All, &rows, instructions);
        // The mean is known already.
        coefficients.orders[0][0] = [0.0; 6];
        let places = plans.iter().any(|plan| plan.split.is_some()).then(|| Places::new(panorama));
        let near = places.map(|places| (rest.to_panorama(), places));
        let powers = coefficients.powers();
        Self { plans, bright, mean, norm2, share, coefficients, powers, tail: None, near }
    }

    /// How many of the brightest texels a plan wants exact across its horizon, given the map's mean.
    fn exact_across(&self, plan: &Plan, mean: [f64; 3]) -> usize {
        let darkest = plan.dark.darkest();
        self.bright.exact_across(&plan.kernel, mean.map(|mean| darkest * mean))
    }

    /// What truncation changes of a plan's function at most, relative to the darkest output, given the map's mean.
    fn truncation(&self, plan: &Plan, mean: [f64; 3]) -> f64 {
        plan.truncation(self.share, mean, self.norm2, &self.powers, self.tail.as_ref())
    }
}

/// The texels that show across the horizon of one of these kernels.
fn peel_for(panorama: &Panorama, survey: &Survey, plans: &[Plan]) -> Peel {
    let is_wide = plans.iter().any(|plan| is_wide(&plan.kernel) && plan.split.is_none());
    let least = least_of(plans, 1, panorama.height());
    Peel::strongest(panorama, &survey.brightest, least, MOST_PEELED[usize::from(!is_wide)])
}

/// The least that one of these kernels, given so many times its usual degrees, asks of a texel to be peeled off.
fn least_of(plans: &[Plan], times: usize, height: usize) -> f64 {
    plans.iter().map(|plan| least_share(plan, times, height)).fold(1.0, f64::min)
}

/// Kernels that see the same panorama: all of them, if wide ones ask for few texels to be peeled off; else wide ones, and narrow
/// ones, which are asked at more directions.
fn parts(
    panorama: &Panorama,
    survey: &Survey,
    [wide, narrow]: [Vec<Plan>; 2],
    instructions: InstructionSet,
) -> Vec<Part> {
    let mut parts = vec![];
    let mut rest = narrow;
    if !wide.is_empty() {
        let mut peel = peel_for(panorama, survey, &wide);
        if peel.len() > MANY {
            let least = LAMPS * least_of(&wide, 1, panorama.height());
            let lamps = Peel::thoroughly(panorama, &survey.brightest, least, MOST_PEELED[0]);
            // (A part of a lamp is no smoother than all of it.)
            peel = if lamps.len() < MOST_PEELED[0] { lamps } else { peel };
        }
        let mut plans = wide;
        if peel.len() <= FEW {
            plans.append(&mut rest);
        }
        parts.push(Part::patient(panorama, survey, plans, (peel, 1), instructions));
    }
    if !rest.is_empty() {
        let peel = peel_for(panorama, survey, &rest);
        parts.push(Part::patient(panorama, survey, rest, (peel, 1), instructions));
    }
    parts
}

/// The part of the light that a texel must hold for the kernel's horizon to show, and to be peeled off.
///
/// The kink a max(c, 0), a = K′(0), is off by some a/(5L) when cut off at degree L; 1e-4 of the darkest output (which is reckoned
/// three times too dark) is left to the texels of a cell that L does not resolve. Where L resolves texels, what is beyond is less than that of points, as
/// the sinc of a texel's height is.
fn least_share(plan: &Plan, times: usize, height: usize) -> f64 {
    let [slope, ..] = plan.kernel.horizon();
    let degree = plan.degree().max(times * usual_degree(&plan.kernel)) as f64;
    let cell = 1.0 + (height as f64 / degree).powi(2);
    let resolved = (0.5 * PI * degree / height as f64).max(1.0);
    1e-4 * plan.dark.darkest() * 5.0 * degree * resolved / (slope * 4.0 * PI * cell)
}

/// A panorama without what was peeled off, and without its mean.
struct Rest<'a> {
    panorama: &'a Panorama,
    /// Texels that differ, in the order of the panorama.
    changed: Vec<(usize, [f32; 3])>,
    /// The darkest values of the panorama, which are taken off all texels: where it is dark, what integration misses is small too.
    darkest: [f64; 3],
    mean: [f64; 3],
    /// ∫ (f − mean)².
    norm2: [f64; 3],
}

impl<'a> Rest<'a> {
    fn new(panorama: &'a Panorama, survey: &Survey, peel: &Peel) -> Self {
        let mut changed: Vec<(usize, [f32; 3])> = peel.remainders().collect();
        changed.sort_unstable_by_key(|(index, _)| *index);
        let darkest = panorama.min().map(f64::from);
        let mut rest = Self { panorama, changed, darkest, mean: panorama.mean(), norm2: [0.0; 3] };
        let [first, second] = rest.moments(survey);
        if !rest.changed.is_empty() {
            rest.mean = std::array::from_fn(|c| darkest[c] + first[c] / (4.0 * PI));
        }
        rest.norm2 = std::array::from_fn(|c| (second[c] - (rest.mean[c] - darkest[c]).powi(2) * 4.0 * PI).max(0.0));
        rest
    }

    /// All of a panorama but what is taken off every texel; its norm is not known.
    #[cfg(test)]
    fn whole(panorama: &'a Panorama, darkest: [f64; 3]) -> Self {
        Self { panorama, changed: vec![], darkest, mean: panorama.mean(), norm2: [0.0; 3] }
    }

    /// The same as a panorama of its own.
    fn to_panorama(&self) -> Panorama {
        let mut texels = self.panorama.texels().to_vec();
        self.changed.iter().for_each(|&(index, texel)| texels[index] = texel);
        self.panorama.with_texels(texels)
    }

    fn changed_in(&self, row: usize) -> &[(usize, [f32; 3])] {
        let width = self.panorama.width();
        let start = self.changed.partition_point(|(index, _)| *index < row * width);
        let end = self.changed.partition_point(|(index, _)| *index < (row + 1) * width);
        &self.changed[start..end]
    }

    /// ∫ (f − darkest) and ∫ (f − darkest)²: a constant comes out as itself, and no sun cancels.
    fn moments(&self, survey: &Survey) -> [[f64; 3]; 2] {
        let mut sums = [[0.0; 3]; 2];
        for (row, known) in survey.rows.iter().enumerate() {
            let changed = !self.changed_in(row).is_empty();
            let of_row = if changed { moments(&self.row(row), self.darkest) } else { known.moments };
            let solid_angle = self.panorama.solid_angle(row);
            (0..2).for_each(|k| (0..3).for_each(|c| sums[k][c] += of_row[k][c] * solid_angle));
        }
        sums
    }
}

impl Texels for Rest<'_> {
    fn shape(&self) -> [usize; 2] {
        [self.panorama.width(), self.panorama.height()]
    }

    fn occupied(&self, row: usize) -> bool {
        self.panorama.row(row).iter().any(|texel| texel.map(f64::from) != self.darkest)
            || !self.changed_in(row).is_empty()
    }

    fn row(&self, row: usize) -> Cow<'_, [[f32; 3]]> {
        let (changed, mut texels) = (self.changed_in(row), Cow::from(self.panorama.row(row)));
        for &(index, texel) in changed {
            texels.to_mut()[index % self.panorama.width()] = texel;
        }
        texels
    }

    fn base(&self) -> [f64; 3] {
        self.darkest
    }
}

#[cfg(test)]
mod tests;
