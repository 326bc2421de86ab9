//! Randomised quasi-Monte Carlo integration over the unit cube.
//!
//! [`REPLICATES`] independently scrambled Sobol' sets are each averaged; the mean of the averages is the value and their spread
//! its standard error, which is honest because the scrambles are independent, though the points within one are not. The
//! points are computed once per seed and shared by every value that is integrated.

use super::Estimate;
use crate::math::sobol::PointSet;
use crate::math::statistics::mean_and_standard_error;
use std::sync::OnceLock;

/// Independent scrambles. With 8 the estimated standard error is itself so uncertain that a 4.5-sigma test fails by chance.
pub const REPLICATES: usize = 32;
/// Points that a value gets at least, over all replicates, unless `samples` asks for fewer.
pub const FEWEST_SAMPLES: u64 = 1 << 12;
/// Points that a value gets at most, over all replicates.
pub const MOST_SAMPLES: u64 = 1 << 24;

/// Smallest standard error that is told apart from rounding.
const ROUNDING: f64 = 1e-12;

/// When to stop drawing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// As soon as every standard error is at most this, and once more (doubling).
    Tolerance(f64),
    /// After this many points over all replicates, rounded up to a power of two per replicate.
    Samples(u64),
}

/// The shared points: per replicate and per doubling, the points that the doubling adds.
#[derive(Debug)]
pub struct Points<const D: usize> {
    seed: u64,
    /// `blocks[replicate][k]` holds the points that take a set from 2^(k−1) to 2^k points (block 0 the first one).
    blocks: Vec<Vec<OnceLock<Vec<[f64; D]>>>>,
}

/// Doublings that a replicate can go through.
const DOUBLINGS: usize = 20; // 2^19 points per replicate × 32 = MOST_SAMPLES

impl<const D: usize> Points<D> {
    /// The points that `seed` stands for; computed when first used.
    pub fn new(seed: u64) -> Self {
        let blocks = (0..REPLICATES).map(|_| (0..DOUBLINGS).map(|_| OnceLock::new()).collect()).collect();
        Self { seed, blocks }
    }

    fn block(&self, replicate: usize, doubling: usize) -> &[[f64; D]] {
        self.blocks[replicate][doubling].get_or_init(|| {
            let (start, end) = block_range(doubling);
            PointSet::<D>::new(self.seed, replicate as u64, 0).range(start..end)
        })
    }

    /// Integrates `f` over the unit cube: one [`Estimate`] of kind sigma per component, and the points used.
    ///
    /// Fixed order of summation: the same bits for any number of threads.
    pub fn integrate<const K: usize>(&self, stop: Stop, f: impl Fn([f64; D]) -> [f64; K]) -> ([Estimate; K], u64) {
        let per_replicate = |samples: u64| samples.div_ceil(REPLICATES as u64).next_power_of_two();
        let least = match stop {
            Stop::Tolerance(_) => per_replicate(FEWEST_SAMPLES),
            Stop::Samples(samples) => per_replicate(samples),
        };
        let first = least.trailing_zeros() as usize;
        let mut sums = [[0.0; K]; REPLICATES];
        let mut met_before = false;
        for doubling in 0..DOUBLINGS {
            for (replicate, sum) in sums.iter_mut().enumerate() {
                for &u in self.block(replicate, doubling) {
                    let value = f(u);
                    for k in 0..K {
                        sum[k] += value[k];
                    }
                }
            }
            if doubling < first {
                continue;
            }
            let n = 1_u64 << doubling;
            let estimates = std::array::from_fn(|k| {
                let averages: Vec<f64> = sums.iter().map(|sum| sum[k] / n as f64).collect();
                let (mean, error) = mean_and_standard_error(&averages);
                Estimate::sigma(mean, error + ROUNDING)
            });
            let met = match stop {
                Stop::Samples(_) => return (estimates, n * REPLICATES as u64),
                Stop::Tolerance(tolerance) => estimates.iter().all(|e| e.error <= tolerance),
            };
            // Once more after the tolerance first holds: stopping at the first lucky spread would understate the error.
            if (met && met_before) || doubling + 1 == DOUBLINGS {
                return (estimates, n * REPLICATES as u64);
            }
            met_before = met;
        }
        unreachable!("the last doubling returns")
    }
}

/// The indices of the points that a doubling adds.
fn block_range(doubling: usize) -> (u64, u64) {
    if doubling == 0 { (0, 1) } else { (1 << (doubling - 1), 1 << doubling) }
}

/// A point of [0, 1] and the reciprocal of its density, half of the points even, half of them even in the logarithm down to
/// about `smallest`.
///
/// A lobe of width alpha hides what it loses (its tail below the horizon, the shadowed part) in a region of its sampling square
/// of measure alpha² or so. Points that are even in that square never see it, and their standard error does not know. Half of
/// the points spent on the logarithm of the distance to the region's rim see it at any alpha; the weight stays below 2.
#[inline]
pub fn defensive_tail(t: f64, smallest: f64) -> (f64, f64) {
    let ratio = (1.0 / smallest).ln_1p(); // ln((1 + s)/s)
    let v = if t < 0.5 { 2.0 * t } else { smallest * ((2.0 * t - 1.0) * ratio).exp_m1() };
    let density = 0.5 + 0.5 / ((v + smallest) * ratio);
    (v, 1.0 / density)
}
