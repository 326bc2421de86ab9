//! What the degrees that are left out change, as the last ones that were kept tell.
//!
//! No bound of that is near the truth: it depends on how the lights lie to each other, and how dark the map is where their horizons show.
//! Both are seen in the last degrees, which show the same horizons, only less sharply: they are summed on a grid, and what is largest in each bin
//! of directions is held against the darkest output there. Even degrees are a (c)₊'s, odd ones those of b (c)₊²: the same for all kernels
//! but for a factor each.

use glam::DVec3;

use super::analysis::Coefficients;
use super::dark::BINS;
use super::fft::Fft;
use super::lanes::InstructionSet;
use super::synthesis::{Peak, Rings};

/// The last degrees begin at this part of the last one.
const LAST: f64 = 0.7;

/// The last degrees of a map.
#[derive(Debug)]
pub(super) struct Beyond {
    /// λ_l that they were summed with, nothing where they were not.
    eigenvalues: Vec<f64>,
    /// The largest values in each bin.
    peaks: Vec<Peak>,
}

impl Beyond {
    /// Of the last even degrees, or odd ones, up to the last that λ_l are given of; `mean` is the map's.
    pub fn new(
        coefficients: &Coefficients,
        (lambda, is_odd): (&[f64], bool),
        mean: [f64; 3],
        instructions: InstructionSet,
    ) -> Self {
        let degree = lambda.len() - 1;
        let behind = (LAST * degree as f64) as usize;
        let is_meant = |l: usize| l > behind && (l % 2 == 1) == is_odd;
        let eigenvalues: Vec<f64> = (0..).zip(lambda).map(|(l, &v)| if is_meant(l) { v } else { 0.0 }).collect();
        let grid = [degree.max(16), Fft::fast_length((1.8 * degree as f64) as usize).max(32)];
        let rings = match is_odd {
            false => Rings::of_even(coefficients, (&eigenvalues, behind), grid, instructions),
            true => Rings::new(coefficients, &eigenvalues, [0.0; 3], grid, instructions),
        };
        let weights = mean.map(|mean| if mean > 0.0 { 1.0 / mean } else { 0.0 });
        Self { eigenvalues, peaks: rings.peaks(BINS, weights) }
    }

    /// How many times these λ_l a kernel's are.
    pub fn factor(&self, lambda: &[f64]) -> f64 {
        let of_both = |(l, &v): (usize, &f64)| v * lambda.get(l).copied().unwrap_or(0.0);
        let products: f64 = self.eigenvalues.iter().enumerate().map(of_both).sum();
        products / self.eigenvalues.iter().map(|v| v * v).sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// Adds what is left out of a kernel whose λ_l are so many times these.
    pub fn add_to(&self, suspects: &mut [Suspect], factor: f64) {
        for (suspect, peak) in suspects.iter_mut().zip(&self.peaks) {
            if factor.abs() * peak.height > suspect.height {
                (suspect.height, suspect.direction) = (factor.abs() * peak.height, peak.direction);
            }
            (0..3).for_each(|c| suspect.left_out[c] += factor.abs() * peak.values[c]);
        }
    }
}

/// What is left out in a bin.
#[derive(Debug, Clone, Default)]
pub(super) struct Suspect {
    /// About so much at most, in each channel.
    pub left_out: [f64; 3],
    /// Where that is.
    pub direction: DVec3,
    /// How much the largest of its parts is, weighted as [`Peak`] is.
    height: f64,
}
