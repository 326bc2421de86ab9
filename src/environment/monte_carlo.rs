//! The Monte Carlo witness: ∫ K(R·l) L(l) dl by multiple importance sampling.
//!
//! Two strategies share each estimate, combined by the balance heuristic (Veach & Guibas 1995): directions from the lobe,
//! which see what is near its axis, and directions from the environment in proportion to its flux, which find every sun.
//! Neither alone is enough, and together no sample can outweigh the others: no fireflies, nothing clamped.
//!
//! Decisions:
//! - The smallest radiance of each channel is taken off first and added back. The rest is nowhere negative, so neither
//!   is any estimate, and the estimator stays unbiased; a constant panorama leaves nothing to sample and is exact. (Taking
//!   off the mean would do the same for white, but estimates beside a sun could go below zero, and where the map is much
//!   darker than its mean it adds noise rather than removing it.)
//! - The points are Owen-scrambled Sobol' points in [`REPLICATES`] independent replicates; the spread of the
//!   replicates' means is an honest standard error.
//! - The points are shared by all texels of a level: environment samples as they are, lobe samples turned about R. Errors
//!   of neighbouring texels are therefore alike: smooth, not grainy.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;

use super::cube::{Cube, texel_direction};
use super::kernel::Kernel;
use super::panorama::Panorama;
use super::sampler::EnvironmentSampler;
use crate::math::sobol::PointSet;

/// Independent scrambles behind each standard error. With eight, an honest test at 4.5 sigmas fails by chance.
pub const REPLICATES: usize = 32;

/// Fewest samples: one of each strategy in each replicate.
pub const MIN_SAMPLES: usize = 2 * REPLICATES;

/// A filtered level with its uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct Filtered {
    /// The estimates.
    pub cube: Cube,
    /// One standard error of each value of the cube, in the same order.
    pub standard_errors: Vec<[f32; 3]>,
    /// Samples that each texel took: as many as asked for, rounded up so that all replicates are equal.
    pub samples: usize,
}

/// A panorama made ready for sampling.
#[derive(Debug, Clone)]
pub struct MonteCarlo {
    base: [f64; 3],
    /// Nothing if the panorama is constant.
    environment: Option<EnvironmentSampler>,
    seed: u64,
}

/// One level's samples, shared by its texels.
struct SharedSamples<'a> {
    environment: &'a EnvironmentSampler,
    kernel: Kernel,
    /// Samples of each strategy in each replicate.
    n: usize,
    lobe: Vec<LobeSample>,
    lights: Vec<LightSample>,
}

/// A direction about +Z, with what the estimator needs of it.
struct LobeSample {
    local: DVec3,
    /// c and (1 − βc)².
    cos: f64,
    denominator: f64,
}

/// A direction drawn from the environment, its radiance beyond the base and its density.
struct LightSample {
    direction: DVec3,
    radiance: [f64; 3],
    pdf: f64,
}

impl MonteCarlo {
    /// Prepares a panorama; `seed` chooses the scrambles.
    pub fn new(panorama: &Panorama, seed: u64) -> Self {
        let base = panorama.min();
        Self { base: base.map(f64::from), environment: EnvironmentSampler::new(panorama, base), seed }
    }

    /// A cube level with `samples` samples for each texel. Same bytes for every number of threads.
    ///
    /// `finished` is told how many texels have been finished since its last call.
    pub fn filter(&self, size: usize, kernel: &Kernel, samples: usize, finished: &(dyn Fn(u64) + Sync)) -> Filtered {
        let directions: Vec<DVec3> = (0..6 * size * size).map(|index| texel_direction(size, index)).collect();
        let (estimates, samples) = self.estimate(&directions, kernel, samples, finished);
        let (texels, standard_errors) =
            estimates.iter().map(|(value, error)| (value.map(|v| v as f32), error.map(|e| e as f32))).unzip();
        Filtered { cube: Cube { size, texels }, standard_errors, samples }
    }

    /// Value and standard error for each of some unit directions, and the number of samples behind each.
    pub fn estimate(
        &self,
        directions: &[DVec3],
        kernel: &Kernel,
        samples: usize,
        finished: &(dyn Fn(u64) + Sync),
    ) -> (Vec<([f64; 3], [f64; 3])>, usize) {
        let n = samples.max(MIN_SAMPLES).div_ceil(2 * REPLICATES);
        let Some(environment) = &self.environment else {
            finished(directions.len() as u64);
            return (vec![(self.base, [0.0; 3]); directions.len()], 2 * n * REPLICATES);
        };
        let shared = SharedSamples::new(environment, *kernel, n, self.seed);
        let texel = |axis: &DVec3| {
            let (value, error) = shared.estimate(*axis);
            finished(1);
            (std::array::from_fn(|c| self.base[c] + value[c]), error)
        };
        (directions.par_iter().map(texel).collect(), 2 * n * REPLICATES)
    }
}

impl<'a> SharedSamples<'a> {
    fn new(environment: &'a EnvironmentSampler, kernel: Kernel, n: usize, seed: u64) -> Self {
        let (beta, one_minus_beta, _) = kernel.coefficients();
        // Dimensions 0 and 1 for the lobe, and a scramble of its own for the environment: both get the best projection.
        let sets = |strategy: u64| {
            let replicate = move |r: usize| PointSet::<2>::new(seed, (2 * r) as u64 + strategy, n).points().to_vec();
            (0..REPLICATES).into_par_iter().flat_map_iter(replicate).collect::<Vec<[f64; 2]>>()
        };
        let lobe = |xi: [f64; 2]| {
            let (w, azimuth) = kernel.sample(xi);
            let sin = (w * (2.0 - w)).sqrt();
            let d = one_minus_beta + beta * w;
            LobeSample {
                local: DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), 1.0 - w),
                cos: 1.0 - w,
                denominator: d * d,
            }
        };
        let light = |xi: [f64; 2]| {
            let (direction, texel) = environment.sample(xi);
            let (radiance, pdf) = environment.radiance_and_pdf(texel);
            LightSample { direction, radiance, pdf }
        };
        Self {
            environment,
            kernel,
            n,
            lobe: sets(0).into_iter().map(lobe).collect(),
            lights: sets(1).into_iter().map(light).collect(),
        }
    }

    /// Mean and standard error over the replicates.
    fn estimate(&self, axis: DVec3) -> ([f64; 3], [f64; 3]) {
        let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
        let (x, y) = frame(axis);
        let mut texels = Vec::with_capacity(self.n);
        for (lobe, lights) in self.lobe.chunks_exact(self.n).zip(self.lights.chunks_exact(self.n)) {
            let mut replicate = [0.0; 3];
            self.add_lobe_samples(lobe, [x, y, axis], &mut texels, &mut replicate);
            self.add_light_samples(lights, axis, &mut replicate);
            for c in 0..3 {
                let value = replicate[c] / self.n as f64;
                sum[c] += value;
                squares[c] += value * value;
            }
        }
        let r = REPLICATES as f64;
        let mean = sum.map(|s| s / r);
        // The replicates of a small relative spread cancel at most half the digits of f64: enough for an error.
        let error = std::array::from_fn(|c| ((squares[c] / r - mean[c] * mean[c]).max(0.0) / (r - 1.0)).sqrt());
        (mean, error)
    }

    // Both strategies have n samples, so by the balance heuristic each contributes K L / (pdf_lobe + pdf_light). With
    // K = N c / d², pdf_lobe = A / d² and d = 1 − βc that is N c L / (A + pdf_light d²): bounded, however narrow the lobe.

    fn add_lobe_samples(&self, samples: &[LobeSample], frame: [DVec3; 3], texels: &mut Vec<usize>, sum: &mut [f64; 3]) {
        let (_, one_minus_beta, norm) = self.kernel.coefficients();
        // All places first, then all texels: the processor can then wait for several of the latter at once.
        let [x, y, z] = frame;
        let direction = |s: &LobeSample| x * s.local.x + y * s.local.y + z * s.local.z;
        texels.clear();
        texels.extend(samples.iter().map(|sample| self.environment.locate(direction(sample))));
        for (sample, &texel) in samples.iter().zip(texels.iter()) {
            let (radiance, pdf) = self.environment.radiance_and_pdf(texel);
            let weight = norm * sample.cos / (one_minus_beta / TAU + pdf * sample.denominator);
            for c in 0..3 {
                sum[c] += weight * radiance[c];
            }
        }
    }

    fn add_light_samples(&self, samples: &[LightSample], axis: DVec3, sum: &mut [f64; 3]) {
        let (beta, one_minus_beta, norm) = self.kernel.coefficients();
        for sample in samples {
            let cos = axis.dot(sample.direction);
            let d = one_minus_beta + beta * (1.0 - cos);
            let weight = norm * cos.max(0.0) / (one_minus_beta / TAU + sample.pdf * d * d);
            for c in 0..3 {
                sum[c] += weight * sample.radiance[c];
            }
        }
    }
}

/// Two unit vectors that complete a unit `z` to a right-handed frame, without a singularity at any pole.
fn frame(z: DVec3) -> (DVec3, DVec3) {
    let x = z.any_orthonormal_vector();
    (x, z.cross(x))
}
