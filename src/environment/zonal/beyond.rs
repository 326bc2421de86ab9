//! What the degrees that are left out change, as the last ones that were kept tell.
//!
//! No bound of that is near the truth: it depends on how the lights lie to each other, and how dark the map is where their horizons show.
//! Both are seen in the last degrees, which show the same horizons, only less sharply: they are summed on a grid, and what is largest in each bin
//! of directions is held against the darkest output there. Even degrees are a (c)₊'s, odd ones those of b (c)₊²: the same for all kernels
//! but for a factor each.

use std::f64::consts::PI;

use glam::DVec3;

use super::analysis::Coefficients;
use super::dark::BINS;
use super::fft::Fft;
use super::lanes::InstructionSet;
use super::synthesis::{Peak, Rings};

/// The last degrees begin at this part of the last one.
const LAST: f64 = 0.7;

/// Rings that they are looked at, at most.
const MOST_RINGS: usize = 640;

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
        // (Horizons are lines: even a grid that is too coarse for the degrees meets them.)
        let rings = degree.clamp(16, MOST_RINGS);
        let grid = [rings, Fft::fast_length(9 * rings / 5).max(32)];
        let rings = match is_odd {
            false => Rings::of_even(coefficients, (&eigenvalues, behind), grid, instructions),
            true => Rings::new(coefficients, &eigenvalues, [0.0; 3], grid, instructions),
        };
        let weights = mean.map(|mean| if mean > 0.0 { 1.0 / mean } else { 0.0 });
        let mut peaks = rings.peaks(weights);
        // The poles themselves lie between rings. What is alike all round adds up there: terms like l⁻² instead of l⁻³, of which twice as much is left
        // beyond the last ones.
        for (bin, pole) in [(0, DVec3::Y), (BINS[0] * (BINS[1] - 1), DVec3::NEG_Y)] {
            let values = at_pole(coefficients, &eigenvalues, pole.y).map(|v| 2.0 * v.abs());
            if peaks[bin].rises_to(values, weights) {
                peaks[bin].direction = pole;
            }
        }
        Self { eigenvalues, peaks }
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

/// Σ λ_l f_lm Y_lm at the pole of cosine `y`, ±1, where all orders but 0 are nothing and Y_l0 is √((2l + 1)/4π), (−1)ˡ times that below.
pub(super) fn at_pole(coefficients: &Coefficients, eigenvalues: &[f64], y: f64) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (l, (lambda, f)) in eigenvalues.iter().zip(&coefficients.orders[0]).enumerate().filter(|(_, (v, _))| **v != 0.0)
    {
        let sign = if l % 2 == 1 { y } else { 1.0 };
        let term = sign * lambda * ((2 * l + 1) as f64 / (4.0 * PI)).sqrt();
        (0..3).for_each(|c| sums[c] += term * f[c]);
    }
    sums
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

#[cfg(test)]
mod tests {
    use super::super::Rest;
    use super::super::analysis::{Rows, analyse};
    use super::super::legendre::Degrees;
    use super::super::plan::{lambdas, row_rule};
    use super::*;
    use crate::environment::kernel::Kernel;
    use crate::environment::test_maps::random;

    #[test]
    fn the_poles_have_the_values_that_rings_are_interpolated_to() {
        let (panorama, set) = (random(64, 5, Some((9, 3))), InstructionSet::detect());
        let map = Rest::whole(&panorama, [0.0; 3]);
        let rows = Rows::Points(row_rule(0.1, 40, 32));
        let coefficients = analyse(&map, 40, Degrees::All, &rows, set);
        let lambda = lambdas(&Kernel::new(1.0), 40, set);
        let rings = Rings::new(&coefficients, &lambda, [0.0; 3], [160, 320], set);
        for (theta, y) in [(0.0, 1.0), (1.0, -1.0)] {
            let (got, wanted) = (at_pole(&coefficients, &lambda, y), rings.at([theta, 0.0]));
            for c in 0..3 {
                assert!((got[c] - wanted[c]).abs() < 1e-5 * wanted[c].abs(), "{y}: {} wanted {}", got[c], wanted[c]);
            }
        }
    }
}
