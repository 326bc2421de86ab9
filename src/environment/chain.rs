//! A chain of prefiltered levels: mip 0 sharp, each further level half as large and rougher.

use std::cell::RefCell;

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::area_average::area_average;
use super::cube::Cube;
use super::fit::{CubeFit, fit, fit_map};
use super::full_sum::FullSum;
use super::kernel::{Kernel, KernelKind};
use super::monte_carlo::{Estimate, MIN_SAMPLES, MonteCarlo};
use super::orientation::Orientation;
use super::panorama::Panorama;
use super::seamless::Probe;
use super::sphere_map::{SphereLayout, SphereMap};
use super::view_lobe::{View, ViewLobe, ViewMonteCarlo};
use super::zonal::{Function, InstructionSet, Zonal};
use crate::error::{Error, Result};
use crate::integrate::Integrator;
use crate::math::fit::Fit;
use crate::model::alpha_of_roughness;

/// What a chain is to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChainSpec {
    /// Texels along an edge of level 0; each level has half as many as the one before it.
    pub size: usize,
    /// Perceptual roughness of each level, in [0, 1]; alpha is its square. Zero is the area average.
    pub roughness: Vec<f64>,
    /// Samples for each texel of the Monte Carlo witness.
    pub samples: usize,
    /// Chooses the sample points.
    pub seed: u64,
    /// What filters; `auto` is the zonal filter.
    pub integrator: Integrator,
    /// What directions are weighed by.
    pub kernel: KernelKind,
    /// How the surface is seen, if not as N = V = R: for [`KernelKind::G1`] and the Monte Carlo witness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<View>,
    /// What texels are chosen for; level 0 of a mirror is not fitted, nor is a level whose kernel is too narrow for harmonics.
    #[serde(default)]
    pub fit: Fit,
    /// Whether every level gets a probe of its lookup error.
    #[serde(default)]
    pub probe: bool,
    /// How the sphere lies in each level; functions that return cubes take no other.
    #[serde(default)]
    pub layout: SphereLayout,
    /// Which way those are turned.
    #[serde(default)]
    pub orientation: Orientation,
}

/// Levels from the sharpest to the roughest, and what is known about each.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// One cube for each roughness.
    pub levels: Vec<Cube>,
    /// One report for each level.
    pub reports: Vec<LevelReport>,
}

/// What is known about a level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LevelReport {
    /// Texels along an edge of a face or of the square, or rows of a panorama.
    pub size: usize,
    /// Perceptual roughness.
    pub roughness: f64,
    /// Microfacet width.
    pub alpha: f64,
    /// How the level was made: `area-average`, `zonal`, `monte-carlo`, `quadrature`.
    pub method: String,
    /// Samples for each texel; 0 for the deterministic methods.
    pub samples: usize,
    /// Root mean square over all values of the relative error: a standard error for Monte Carlo; for the zonal filter what was
    /// measured against the full sum, in directions aimed at where errors are largest; a bound otherwise.
    /// Relative to the value, or to [`DARK_FLOOR`] of the mean where the value is darker.
    pub rms_error: f64,
    /// The largest of the same.
    pub max_error: f64,
    /// Degrees of the spherical harmonics; 0 for the other methods.
    pub degree: usize,
    /// What leaving out higher degrees changes at most, on the same scale: a bound for every direction.
    pub truncation_bound: f64,
    /// Mean of each channel, weighted by solid angle.
    pub mean: [f64; 3],
    /// The largest |mean of the level / mean of the input − 1| over the channels. Texel centres do not sum to the flux
    /// exactly (up to a few 1e-3 beside a lone sun), even when every one of them is exact.
    pub mean_deviation: f64,
    /// What to judge the level by as a shader sees it, if that was asked for. There is none for a mirror, whose truth is a picture of
    /// boxes that no blend follows, and none where only a sum over all texels knows the truth.
    #[serde(skip)]
    pub probe: Option<Probe>,
    /// What fitting did, if that was asked for and could be done.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit: Option<CubeFit>,
}

/// Roughness of level 0 of a sheen, where other kernels have a mirror: the least that renderers evaluate.
pub const LEAST_SHEEN: f64 = 0.07;

/// Relative errors are taken relative to at least this part of the panorama's mean.
pub const DARK_FLOOR: f64 = 1e-3;

/// What an error of a value is relative to: the value, or [`DARK_FLOOR`] of the panorama's mean where that is darker.
pub fn error_scale(value: f64, mean: f64) -> f64 {
    value.abs().max(DARK_FLOOR * mean.abs())
}

/// How far a value is off relative to its [`error_scale`]; what is as it should be is not, black where all is black included.
pub fn relative_error(got: f64, wanted: f64, mean: f64) -> f64 {
    if got == wanted { 0.0 } else { (got - wanted).abs() / error_scale(wanted, mean) }
}

/// Relative error of the area average and of the full sum: a rounding to f32, and what their tests hold them to.
const AREA_AVERAGE_BOUND: f64 = 1e-7;
const QUADRATURE_BOUND: f64 = 1e-6;

/// The largest error of a zonal level is never said to be below this, nor below what is left at a lone sun, however little was seen.
const ZONAL_FLOOR: f64 = 1e-5;

/// The root mean square of what is seen of a function's errors, and the largest; `cube` holds the function.
fn errors_of(function: &Function, cube: &Cube) -> (f64, f64) {
    let (rms, largest) = function.measure(cube);
    (rms, largest.max(function.at_a_sun).max(ZONAL_FLOOR))
}

/// Texels along an edge of the cube in which the darkest directions of a map that is no cube are looked for.
const MEASURED: usize = 32;

impl ChainSpec {
    /// The usual chain: from `size` down to `min_size`, with roughness rising evenly from 0 to 1.
    ///
    /// A single level is a mirror.
    pub fn new(size: usize, min_size: usize) -> Self {
        let levels = 1 + std::iter::successors(Some(size), |s| Some(s / 2))
            .skip(1)
            .take_while(|&s| s >= min_size.max(1))
            .count();
        let last = (levels - 1).max(1) as f64;
        let roughness = (0..levels).map(|level| level as f64 / last).collect();
        Self {
            size,
            roughness,
            samples: 4096,
            seed: 0,
            integrator: Integrator::default(),
            kernel: KernelKind::default(),
            view: None,
            fit: Fit::None,
            probe: false,
            layout: SphereLayout::default(),
            orientation: Orientation::default(),
        }
    }

    /// Texels along an edge of a level, or rows.
    pub fn level_size(&self, level: usize) -> usize {
        self.size >> level
    }

    /// Texels of all levels together: what the progress callback adds up to.
    pub fn total_texels(&self) -> u64 {
        (0..self.roughness.len()).map(|level| self.layout.texels(self.level_size(level)) as u64).sum()
    }

    /// The kernel of a level of that roughness; none for a mirror.
    pub fn kernel_of(&self, roughness: f64) -> Option<Kernel> {
        let alpha = alpha_of_roughness(roughness);
        (alpha > 0.0).then(|| Kernel::of(self.kernel, alpha))
    }

    fn kernels(&self) -> Vec<Kernel> {
        self.roughness.iter().filter_map(|&r| self.kernel_of(r)).collect()
    }

    fn check(&self) -> Result<()> {
        check_kernel(self.kernel, &self.roughness)?;
        if let Some(view) = self.view {
            check_view(view, self.kernel, self.integrator)?;
        }
        let levels = self.roughness.len();
        if self.size == 0 || levels == 0 || levels > self.size.ilog2() as usize + 1 {
            let most = if self.size == 0 { 0 } else { self.size.ilog2() + 1 };
            return Err(Error::usage(
                format!("chain of size {} with {levels} levels: from 1 to {most} levels are wanted", self.size),
                "give a larger size or fewer roughness values",
            ));
        }
        if let Some(wrong) = self.roughness.iter().find(|r| !(0.0..=1.0).contains(*r)) {
            return Err(Error::usage(
                format!("roughness {wrong} is not in [0, 1]"),
                "correct the list of roughness values",
            ));
        }
        if self.integrator == Integrator::MonteCarlo && self.samples < MIN_SAMPLES {
            return Err(Error::usage(
                format!("{} samples are fewer than the {MIN_SAMPLES} that a standard error needs", self.samples),
                format!("use at least {MIN_SAMPLES} samples"),
            ));
        }
        Ok(())
    }
}

/// The prefiltered chain of a panorama, every level straight from the panorama.
///
/// `finished` is told, from any thread, how many texels have been finished since its last call; see
/// [`ChainSpec::total_texels`]. The result has the same bytes for every number of threads.
///
/// **Errors**: a specification that makes no sense.
pub fn specular_chain(panorama: &Panorama, spec: &ChainSpec, finished: &(dyn Fn(u64) + Sync)) -> Result<Chain> {
    spec.check()?;
    Ok(Filter::new(panorama, spec, &spec.kernels()).chain(spec, finished))
}

/// The chain and [`irradiance_cube`](super::irradiance_cube) of `irradiance_size`, which share what they can.
///
/// **Errors**: a specification that makes no sense.
pub fn chain_and_irradiance(
    panorama: &Panorama,
    spec: &ChainSpec,
    irradiance_size: usize,
    finished: &(dyn Fn(u64) + Sync),
) -> Result<(Chain, (Cube, LevelReport))> {
    let filter = Filter::for_both(FullSum::new(panorama), panorama, spec, irradiance_size)?;
    Ok((filter.chain(spec, finished), filter.level(irradiance_size, 1.0, Some(lambert()), finished)))
}

/// A level in its layout, turned, and what is known about it.
pub(crate) type MapLevel = (SphereMap, LevelReport);

/// The same in the layout that is asked for, turned, with a full sum of the panorama that others use too.
pub(crate) fn maps_and_irradiance_beside(
    truth: &FullSum,
    panorama: &Panorama,
    spec: &ChainSpec,
    irradiance_size: usize,
    finished: &(dyn Fn(u64) + Sync),
) -> Result<(Vec<MapLevel>, MapLevel)> {
    spec.layout.check_orientation(&spec.orientation)?;
    let filter = Filter::for_both(truth.clone(), panorama, spec, irradiance_size)?;
    let level = |size, roughness, kernel| filter.map_level(spec, size, roughness, kernel, finished);
    let levels = filter.levels(spec, level).into_iter().collect::<Result<Vec<_>>>()?;
    let irradiance = filter.map_level(spec, irradiance_size, 1.0, Some(lambert()), finished)?;
    Ok((levels, irradiance))
}

/// Mirrors of those sizes in the layout of `spec`, turned as it says.
///
/// **Errors**: see [`SphereLayout::check_orientation`].
pub(crate) fn mirrors(
    panorama: &Panorama,
    spec: &ChainSpec,
    sizes: impl Iterator<Item = usize>,
    finished: &(dyn Fn(u64) + Sync),
) -> Result<Vec<MapLevel>> {
    // Nothing is filtered: the witness that prepares nothing will do.
    let spec = ChainSpec { integrator: Integrator::Quadrature, fit: Fit::None, probe: false, ..spec.clone() };
    let filter = Filter::new(panorama, &spec, &[]);
    sizes.map(|size| filter.map_level(&spec, size, 0.0, None, finished)).collect()
}

/// Whether a kernel has all these roughnesses.
///
/// **Errors**: a sheen of roughness 0, which is no mirror.
pub fn check_kernel(kernel: KernelKind, roughness: &[f64]) -> Result<()> {
    if kernel == KernelKind::Charlie && roughness.contains(&0.0) {
        return Err(Error::usage(
            "roughness 0 of a sheen, whose lobe would be the horizon itself",
            format!("start at {LEAST_SHEEN}, such as --roughness {LEAST_SHEEN},0.5,1"),
        ));
    }
    Ok(())
}

/// Whether a surface can be filtered as it is seen.
///
/// **Errors**: no such view; a kernel or an integrator that knows lobes about R only.
pub fn check_view(view: View, kernel: KernelKind, integrator: Integrator) -> Result<()> {
    view.check()?;
    if kernel != KernelKind::G1 {
        return Err(Error::usage(
            format!("a view angle or anisotropy with --kernel {}, which is no lobe of a surface", kernel.name()),
            "use --kernel g1, which is the lobe seen at 0°",
        ));
    }
    if !matches!(integrator, Integrator::MonteCarlo | Integrator::Auto) {
        return Err(Error::usage(
            "a view angle or anisotropy makes a lobe that is not round about R, which only monte-carlo integrates",
            "use --integrator monte-carlo",
        ));
    }
    Ok(())
}

/// The kernel of irradiance over π.
pub(super) fn lambert() -> Kernel {
    Kernel::new(1.0)
}

pub(super) fn check_irradiance(size: usize) -> Result<()> {
    if size == 0 {
        return Err(Error::usage("irradiance cube of size 0", "use a size of at least 1, such as 32"));
    }
    Ok(())
}

/// The witnesses of one chain, prepared once.
pub(super) struct Filter<'a> {
    panorama: &'a Panorama,
    samples: usize,
    seed: u64,
    witness: Witness<'a>,
    /// What knows the filtered function everywhere, for the lookup; the witness itself if that is the zonal filter.
    truth: Option<Zonal<'a>>,
    fit: Fit,
    probe: bool,
    /// For lobes of surfaces that are seen at an angle.
    view: Option<(View, ViewMonteCarlo)>,
}

/// Estimates in some directions, and the number of samples behind each.
type Sampler<'a> = dyn Fn(&[DVec3]) -> (Vec<Estimate>, usize) + 'a;

enum Witness<'a> {
    MonteCarlo(Box<MonteCarlo<'a>>),
    Quadrature(FullSum<'a>),
    Zonal(Zonal<'a>),
}

impl<'a> Filter<'a> {
    /// A filter for these kernels.
    pub(super) fn new(panorama: &'a Panorama, spec: &ChainSpec, kernels: &[Kernel]) -> Self {
        Self::beside(FullSum::new(panorama), panorama, spec, kernels)
    }

    fn beside(truth: FullSum<'a>, panorama: &'a Panorama, spec: &ChainSpec, kernels: &[Kernel]) -> Self {
        let zonal = || {
            let mut kernels = kernels.to_vec();
            kernels.sort_by(|a, b| (a.kind() as u8).cmp(&(b.kind() as u8)).then(a.alpha().total_cmp(&b.alpha())));
            kernels.dedup();
            Zonal::beside(truth.clone(), panorama, &kernels, InstructionSet::detect())
        };
        let witness = match spec.integrator {
            Integrator::Quadrature => Witness::Quadrature(truth.clone()),
            Integrator::MonteCarlo => Witness::MonteCarlo(Box::new(MonteCarlo::new(panorama, spec.seed))),
            Integrator::Auto | Integrator::Zonal => Witness::Zonal(zonal()),
        };
        let seen = spec.probe || spec.fit == Fit::Lookup;
        let everywhere = (seen && !matches!(witness, Witness::Zonal(_))).then(zonal);
        let view = spec.view.map(|view| (view, ViewMonteCarlo::new(panorama, spec.seed)));
        let (samples, seed) = (spec.samples, spec.seed);
        Self { panorama, samples, seed, witness, truth: everywhere, fit: spec.fit, probe: spec.probe, view }
    }

    /// The filter of a chain and of irradiance.
    fn for_both(truth: FullSum<'a>, panorama: &'a Panorama, spec: &ChainSpec, irradiance_size: usize) -> Result<Self> {
        spec.check()?;
        check_irradiance(irradiance_size)?;
        let kernels: Vec<Kernel> = spec.kernels().into_iter().chain([lambert()]).collect();
        Ok(Self::beside(truth, panorama, spec, &kernels))
    }

    fn chain(&self, spec: &ChainSpec, finished: &(dyn Fn(u64) + Sync)) -> Chain {
        let level = |size, roughness, kernel| self.level(size, roughness, kernel, finished);
        let (levels, reports) = self.levels(spec, level).into_iter().unzip();
        Chain { levels, reports }
    }

    /// Something of every level, from its size, roughness and kernel: all at once, because each has parts that one thread does.
    fn levels<T: Send>(&self, spec: &ChainSpec, of: impl Fn(usize, f64, Option<Kernel>) -> T + Sync) -> Vec<T> {
        if spec.roughness.iter().any(|&r| r > 0.0) {
            match &self.witness {
                Witness::MonteCarlo(_) => {}
                Witness::Quadrature(full_sum) => full_sum.prepare(),
                Witness::Zonal(zonal) => zonal.prepare(),
            }
        }
        let level = |(level, &r): (usize, &f64)| of(spec.level_size(level), r, spec.kernel_of(r));
        spec.roughness.par_iter().enumerate().with_max_len(1).map(level).collect()
    }

    /// What a level is probed by, or fitted to, if it is to be and there is anything: a lobe that is seen at an angle is no zonal function.
    fn truth_of(&self, kernel: &Kernel) -> Option<Function<'_>> {
        let zonal = if let Witness::Zonal(zonal) = &self.witness { Some(zonal) } else { self.truth.as_ref() };
        let at_an_angle = self.view.is_some() && kernel.kind() == KernelKind::G1;
        let wanted = (self.probe || self.fit == Fit::Lookup) && !at_an_angle;
        zonal.filter(|_| wanted).map(|zonal| zonal.function(kernel)).filter(|function| function.degree > 0)
    }

    /// A level; without a kernel, of a mirror.
    pub(super) fn level(
        &self,
        size: usize,
        roughness: f64,
        kernel: Option<Kernel>,
        finished: &(dyn Fn(u64) + Sync),
    ) -> (Cube, LevelReport) {
        let (cube, report) = self.exact_level(size, roughness, kernel, finished);
        let Some(function) = kernel.and_then(|kernel| self.truth_of(&kernel)) else { return (cube, report) };
        let probe = Probe::new(&function, &cube, self.panorama.mean(), self.seed);
        if self.fit == Fit::None {
            return (cube, LevelReport { probe: Some(probe), ..report });
        }
        let (cube, fit) = fit(&function, cube, self.panorama, &probe);
        let (mean, mean_deviation) = self.mean(cube.mean());
        (cube, LevelReport { probe: Some(probe), fit: Some(fit), mean, mean_deviation, ..report })
    }

    /// A level in the layout of `spec`, turned as it says; without a kernel, of a mirror.
    fn map_level(
        &self,
        spec: &ChainSpec,
        size: usize,
        roughness: f64,
        kernel: Option<Kernel>,
        finished: &(dyn Fn(u64) + Sync),
    ) -> Result<MapLevel> {
        let (layout, orientation) = (spec.layout, &spec.orientation);
        if layout == SphereLayout::Cube {
            let (cube, report) = self.level(size, roughness, kernel, finished);
            return Ok((orientation.apply(cube).into(), report));
        }
        let Some(kernel) = kernel else {
            let map = SphereMap::area_average(self.panorama, layout, size, orientation)?;
            finished(map.texels.len() as u64);
            let errors = (AREA_AVERAGE_BOUND, AREA_AVERAGE_BOUND);
            let report = self.report(size, map.mean(), roughness, "area-average", 0, errors);
            return Ok((map, report));
        };
        let (map, report) = self.exact_map(spec, size, roughness, kernel, finished);
        let Some(function) = self.truth_of(&kernel) else { return Ok((map, report)) };
        let probe = Probe::of_map(&function, &map, orientation, self.panorama.mean(), self.seed);
        if self.fit == Fit::None {
            return Ok((map, LevelReport { probe: Some(probe), ..report }));
        }
        let (map, fit) = fit_map(&function, map, orientation, self.panorama, &probe);
        let (mean, mean_deviation) = self.mean(map.mean());
        Ok((map, LevelReport { probe: Some(probe), fit: Some(fit), mean, mean_deviation, ..report }))
    }

    /// A level of a map that is no cube, whose texels are the values at their centres.
    fn exact_map(
        &self,
        spec: &ChainSpec,
        size: usize,
        roughness: f64,
        kernel: Kernel,
        finished: &(dyn Fn(u64) + Sync),
    ) -> MapLevel {
        let (layout, orientation) = (spec.layout, &spec.orientation);
        let gather = |values: &dyn Fn(&[DVec3]) -> Vec<[f64; 3]>, finished: &(dyn Fn(u64) + Sync)| {
            SphereMap::gather(layout, size, orientation, values, finished)
        };
        // Samplers count for themselves, and their standard errors come beside their values.
        let sampled = |sample: &Sampler| {
            let found = RefCell::new((vec![], 0));
            let values = |directions: &[DVec3]| {
                let (estimates, samples) = sample(directions);
                let mut found = found.borrow_mut();
                found.1 = samples;
                found.0.extend(estimates.iter().map(|e| e.standard_error.map(|v| v as f32)));
                estimates.into_iter().map(|e| e.value).collect()
            };
            let map = gather(&values, &|_| {});
            let (errors, samples) = found.into_inner();
            let errors = self.relative_errors(&map.texels, &errors);
            let report = self.report(size, map.mean(), roughness, "monte-carlo", samples, errors);
            (map, report)
        };
        // (Irradiance is no reflection.)
        if let Some((view, monte_carlo)) = self.view.as_ref().filter(|_| kernel.kind() == KernelKind::G1) {
            let lobe = ViewLobe::new(kernel.alpha(), *view);
            return sampled(&|directions| monte_carlo.estimate(directions, &lobe, self.samples, finished));
        }
        let quadrature = (QUADRATURE_BOUND, QUADRATURE_BOUND);
        match &self.witness {
            Witness::MonteCarlo(monte_carlo) => {
                sampled(&|directions| monte_carlo.estimate(directions, &kernel, self.samples, finished))
            }
            Witness::Quadrature(full_sum) => {
                full_sum.prepare();
                let values =
                    |directions: &[DVec3]| directions.par_iter().map(|&d| full_sum.evaluate(d, &kernel)).collect();
                let map = gather(&values, finished);
                let report = self.report(size, map.mean(), roughness, "quadrature", 0, quadrature);
                (map, report)
            }
            Witness::Zonal(zonal) => {
                let function = zonal.function(&kernel);
                let map = gather(&|directions| function.values(directions), finished);
                if function.degree == 0 {
                    let report = self.report(size, map.mean(), roughness, "quadrature", 0, quadrature);
                    return (map, report);
                }
                // A small cube of the same function tells where it is darkest.
                let errors = errors_of(&function, &function.cube(MEASURED, &|_| {}));
                let report = self.report(size, map.mean(), roughness, "zonal", 0, errors);
                (map, LevelReport { degree: function.degree, truncation_bound: function.truncation, ..report })
            }
        }
    }

    /// A level whose texels are the values at their centres.
    fn exact_level(
        &self,
        size: usize,
        roughness: f64,
        kernel: Option<Kernel>,
        finished: &(dyn Fn(u64) + Sync),
    ) -> (Cube, LevelReport) {
        let Some(kernel) = kernel else {
            let cube = area_average(self.panorama, size);
            finished(cube.texels.len() as u64);
            let report =
                self.report(size, cube.mean(), roughness, "area-average", 0, (AREA_AVERAGE_BOUND, AREA_AVERAGE_BOUND));
            return (cube, report);
        };
        // (Irradiance is no reflection.)
        if let Some((view, monte_carlo)) = self.view.as_ref().filter(|_| kernel.kind() == KernelKind::G1) {
            let lobe = ViewLobe::new(kernel.alpha(), *view);
            let filtered = monte_carlo.filter(size, &lobe, self.samples, finished);
            let errors = self.relative_errors(&filtered.cube.texels, &filtered.standard_errors);
            let report = self.report(size, filtered.cube.mean(), roughness, "monte-carlo", filtered.samples, errors);
            return (filtered.cube, report);
        }
        match &self.witness {
            Witness::MonteCarlo(monte_carlo) => {
                let filtered = monte_carlo.filter(size, &kernel, self.samples, finished);
                let errors = self.relative_errors(&filtered.cube.texels, &filtered.standard_errors);
                let report =
                    self.report(size, filtered.cube.mean(), roughness, "monte-carlo", filtered.samples, errors);
                (filtered.cube, report)
            }
            Witness::Quadrature(full_sum) => {
                let cube = full_sum.filter(size, &kernel, finished);
                let report =
                    self.report(size, cube.mean(), roughness, "quadrature", 0, (QUADRATURE_BOUND, QUADRATURE_BOUND));
                (cube, report)
            }
            Witness::Zonal(zonal) => {
                let function = zonal.function(&kernel);
                let cube = function.cube(size, finished);
                if function.degree == 0 {
                    let errors = (QUADRATURE_BOUND, QUADRATURE_BOUND);
                    let report = self.report(size, cube.mean(), roughness, "quadrature", 0, errors);
                    return (cube, report);
                }
                let errors = errors_of(&function, &cube);
                let report = self.report(size, cube.mean(), roughness, "zonal", 0, errors);
                (cube, LevelReport { degree: function.degree, truncation_bound: function.truncation, ..report })
            }
        }
    }

    /// Root mean square and maximum of error / max(|value|, floor).
    fn relative_errors(&self, texels: &[[f32; 3]], errors: &[[f32; 3]]) -> (f64, f64) {
        let mean = self.panorama.mean();
        let (mut squares, mut largest) = (0.0, 0.0f64);
        for (value, error) in texels.iter().zip(errors) {
            for c in 0..3 {
                let scale = error_scale(f64::from(value[c]), mean[c]);
                // A channel that is black everywhere has no error and no scale.
                let relative = if error[c] == 0.0 { 0.0 } else { f64::from(error[c]) / scale };
                squares += relative * relative;
                largest = largest.max(relative);
            }
        }
        ((squares / (3 * errors.len()) as f64).sqrt(), largest)
    }

    fn report(
        &self,
        size: usize,
        mean: [f64; 3],
        roughness: f64,
        method: &str,
        samples: usize,
        errors: (f64, f64),
    ) -> LevelReport {
        let (mean, mean_deviation) = self.mean(mean);
        LevelReport {
            size,
            roughness,
            alpha: alpha_of_roughness(roughness),
            method: method.to_owned(),
            samples,
            rms_error: errors.0,
            max_error: errors.1,
            degree: 0,
            truncation_bound: 0.0,
            mean,
            mean_deviation,
            probe: None,
            fit: None,
        }
    }

    /// The mean over the sphere, and how far it is from the input's.
    fn mean(&self, mean: [f64; 3]) -> ([f64; 3], f64) {
        let wanted = self.panorama.mean();
        let deviation = |c: usize| if wanted[c] == mean[c] { 0.0 } else { (mean[c] / wanted[c] - 1.0).abs() };
        (mean, (0..3).map(deviation).fold(0.0, f64::max))
    }
}
