//! The Monte Carlo witness: ∫ K(R·l) L(l) dl by multiple importance sampling.
//!
//! Two strategies share each estimate, combined by the power heuristic with exponent 2 (Veach & Guibas 1995): directions
//! from the lobe, which see what is near its axis, and directions from the environment in proportion to its flux, which
//! find every sun. Neither alone is enough, and together no sample can outweigh the others: no fireflies, nothing clamped.
//! (The balance heuristic has the same spread on real maps, but leaves a lone sun's last 3e-5 to lobe samples that
//! hardly ever hit it: few see it, and the standard error of the others is then too small by a factor of twenty.)
//!
//! Decisions:
//! - The smallest radiance of each channel is taken off first and added back. The rest is nowhere negative, so neither
//!   is any estimate, and the estimator stays unbiased; a constant panorama leaves nothing to sample and is exact. (Taking
//!   off the mean would do the same for white, but estimates beside a sun could go below zero, and where the map is much
//!   darker than its mean it adds noise rather than removing it.)
//! - Texels that stand out from their surroundings (suns, lamps, stars) are peeled off first and summed exactly: they are what
//!   makes estimates sparkle.
//! - The points are Owen-scrambled Sobol' points in [`REPLICATES`] independent replicates; the spread of the
//!   replicates' means is an honest standard error.
//! - The points are shared by all texels of a level: environment samples as they are, lobe samples turned towards R.
//!   Errors of neighbouring texels are therefore alike: smooth, not grainy.

use glam::DVec3;
use rayon::prelude::*;

use super::cube::{Cube, texel_direction};
use super::full_sum::FullSum;
use super::kernel::Kernel;
use super::panorama::Panorama;
use super::peel::{PEEL_ERROR, Peel};
use super::sampler::EnvironmentSampler;
use crate::integrate::monte_carlo::REPLICATES;
use crate::math::sobol::PointSet;

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

/// A value and its uncertainty.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Estimate {
    /// The estimate of each channel.
    pub value: [f64; 3],
    /// One standard error of each channel.
    pub standard_error: [f64; 3],
}

/// A panorama made ready for sampling.
#[derive(Debug, Clone)]
pub struct MonteCarlo<'a> {
    base: [f64; 3],
    peel: Peel,
    exact: FullSum<'a>,
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
    /// K/p and p, the density of the lobe's samples.
    weight: f64,
    pdf: f64,
}

/// A direction drawn from the environment, its radiance beyond the base and its density.
struct LightSample {
    direction: DVec3,
    radiance: [f64; 3],
    pdf: f64,
}

impl<'a> MonteCarlo<'a> {
    /// Prepares a panorama; `seed` chooses the scrambles.
    pub fn new(panorama: &'a Panorama, seed: u64) -> Self {
        let (peel, rest) = Peel::new(panorama);
        let base = rest.min();
        let environment = EnvironmentSampler::new(&rest, base);
        Self { base: base.map(f64::from), peel, exact: FullSum::new(panorama), environment, seed }
    }

    /// A cube level with `samples` samples for each texel. Same bytes for every number of threads.
    ///
    /// `finished` is told how many texels have been finished since its last call.
    pub fn filter(&self, size: usize, kernel: &Kernel, samples: usize, finished: &(dyn Fn(u64) + Sync)) -> Filtered {
        let directions: Vec<DVec3> = (0..6 * size * size).map(|index| texel_direction(size, index)).collect();
        let (estimates, samples) = self.estimate(&directions, kernel, samples, finished);
        let (texels, standard_errors) =
            estimates.iter().map(|e| (e.value.map(|v| v as f32), e.standard_error.map(|v| v as f32))).unzip();
        Filtered { cube: Cube { size, texels }, standard_errors, samples }
    }

    /// Value and standard error for each of some unit directions, and the number of samples behind each.
    pub fn estimate(
        &self,
        directions: &[DVec3],
        kernel: &Kernel,
        samples: usize,
        finished: &(dyn Fn(u64) + Sync),
    ) -> (Vec<Estimate>, usize) {
        let n = samples.max(MIN_SAMPLES).div_ceil(2 * REPLICATES);
        let shared = self.environment.as_ref().map(|e| SharedSamples::new(e, *kernel, n, self.seed));
        let texel = |axis: &DVec3| {
            let rest = shared.as_ref().map_or(Estimate::default(), |s| s.estimate(*axis));
            let peeled = self.peel.evaluate(*axis, kernel, &self.exact);
            finished(1);
            Estimate {
                value: std::array::from_fn(|c| self.base[c] + peeled[c] + rest.value[c]),
                // A bound, not a standard error: added, so that the sum is never too small a claim.
                standard_error: std::array::from_fn(|c| rest.standard_error[c] + PEEL_ERROR * peeled[c]),
            }
        };
        (directions.par_iter().map(texel).collect(), 2 * n * REPLICATES)
    }
}

impl<'a> SharedSamples<'a> {
    fn new(environment: &'a EnvironmentSampler, kernel: Kernel, n: usize, seed: u64) -> Self {
        // Dimensions 0 and 1 for the lobe, and a scramble of its own for the environment: both get the best projection.
        let sets = |strategy: u64| {
            let replicate = move |r: usize| PointSet::<2>::new(seed, (2 * r) as u64 + strategy, n).points().to_vec();
            (0..REPLICATES).into_par_iter().flat_map_iter(replicate).collect::<Vec<[f64; 2]>>()
        };
        let lobe = |xi: [f64; 2]| {
            let (w, azimuth) = kernel.sample(xi);
            let sin = (w * (2.0 - w)).sqrt();
            LobeSample {
                local: DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), 1.0 - w),
                weight: kernel.weight(w),
                pdf: kernel.pdf(w),
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

    /// Mean and standard error over the replicates, of the radiance beyond the base.
    fn estimate(&self, axis: DVec3) -> Estimate {
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
        let value = sum.map(|s| s / r);
        // Replicates that nearly agree cancel at most half the digits of f64: enough for an error.
        let variance = |c: usize| (squares[c] / r - value[c] * value[c]).max(0.0);
        Estimate { value, standard_error: std::array::from_fn(|c| (variance(c) / (r - 1.0)).sqrt()) }
    }

    // Both strategies have n samples, so by the power heuristic each contributes K L p / (p_lobe² + p_light²), with the p of its own
    // strategy. K/p_lobe is bounded however narrow the lobe is: that times L p_lobe p / (p_lobe² + p_light²). (The smallest number keeps
    // 0/0 at 0, where neither strategy goes.)

    fn add_lobe_samples(&self, samples: &[LobeSample], frame: [DVec3; 3], texels: &mut Vec<usize>, sum: &mut [f64; 3]) {
        // All places first, then all texels: the processor can then wait for several of the latter at once.
        let [x, y, z] = frame;
        let direction = |s: &LobeSample| x * s.local.x + y * s.local.y + z * s.local.z;
        texels.clear();
        texels.extend(samples.iter().map(|sample| self.environment.locate(direction(sample))));
        for (sample, &texel) in samples.iter().zip(texels.iter()) {
            let (radiance, pdf) = self.environment.radiance_and_pdf(texel);
            let lobe = sample.pdf * sample.pdf;
            let weight = sample.weight * lobe / (lobe + pdf * pdf + f64::MIN_POSITIVE);
            add_scaled(sum, weight, radiance);
        }
    }

    fn add_light_samples(&self, samples: &[LightSample], axis: DVec3, sum: &mut [f64; 3]) {
        for sample in samples {
            let w = 1.0 - axis.dot(sample.direction);
            let lobe = self.kernel.pdf(w);
            let both = lobe * lobe + sample.pdf * sample.pdf;
            let weight = self.kernel.weight(w) * lobe * sample.pdf / (both + f64::MIN_POSITIVE);
            add_scaled(sum, weight, sample.radiance);
        }
    }
}

fn add_scaled(sum: &mut [f64; 3], weight: f64, radiance: [f64; 3]) {
    sum.iter_mut().zip(radiance).for_each(|(sum, radiance)| *sum += weight * radiance);
}

/// Two unit vectors that complete a unit direction to a frame: X and Z, turned by the smallest rotation that takes +Y
/// there. It is continuous everywhere but at −Y, so the shared samples leave no seam across a face.
fn frame(direction: DVec3) -> (DVec3, DVec3) {
    let DVec3 { x, y, z } = direction;
    // 1 + y, without cancellation near −Y.
    let h = if y < 0.0 { (x * x + z * z) / (1.0 - y) } else { 1.0 + y };
    // So close to −Y (1e-146) the squares lose their digits, and any frame will do.
    if h < f64::MIN_POSITIVE / f64::EPSILON {
        return (DVec3::X, DVec3::Z);
    }
    (DVec3::new(1.0 - x * x / h, -x, -x * z / h), DVec3::new(-x * z / h, -z, 1.0 - z * z / h))
}

#[cfg(test)]
mod tests {
    use super::super::cube::texel_direction;
    use super::*;

    #[test]
    fn the_frame_is_orthonormal_at_every_texel_and_at_the_poles() {
        let texels = (0..6 * 33 * 33).map(|i| texel_direction(33, i));
        let near_pole = (1..300).map(|k| DVec3::new(10f64.powi(-k), -1.0, 3.0 * 10f64.powi(-k)).normalize());
        for d in texels.chain(near_pole).chain([DVec3::Y, DVec3::NEG_Y]) {
            let (x, z) = frame(d);
            let error = [x.dot(d), z.dot(d), x.dot(z), x.length() - 1.0, z.length() - 1.0].map(f64::abs);
            // A few roundings of numbers up to 2.
            assert!(error.iter().all(|e| *e < 8.0 * f64::EPSILON), "{d}: {error:?}");
        }
    }
}
