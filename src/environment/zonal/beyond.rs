//! What the degrees that are left out change, as the last ones that were kept tell.
//!
//! No bound of that is near the truth: it depends on how the lights lie to each other, and how dark the map is where their horizons show.
//! Both are seen in the last degrees, which show the same horizons, only less sharply: they are summed on a grid, and what is largest in each bin
//! of directions is held against the darkest output there. Even degrees are a (c)₊'s, odd ones those of b (c)₊²: the same for all kernels
//! but for a factor each.
//!
//! How much more follows is told by how much the degrees before them had been: the sums over degrees from q² L, q L and L on to 1/q times as many are
//! a geometric series, of the ratio q along the horizon of a light that is small to the degrees (whose terms fall like l⁻²) and q² along that of a
//! light that is not.

use std::f64::consts::PI;

use glam::DVec3;

use super::analysis::Coefficients;
use super::dark::BINS;
use super::fft::Fft;
use super::lanes::InstructionSet;
use super::synthesis::{Peak, Rings};

/// The last degrees begin at this part of the last one, and those before them at this part of that.
const LAST: f64 = 0.7;

/// What follows is at most so many times the last degrees: terms do not fall more slowly than like l⁻². And it is counted as at least so much, as what was
/// large before may have been somewhere else.
const MOST_TO_COME: f64 = LAST / (1.0 - LAST);
const LEAST_TO_COME: f64 = 1.0;

/// Rings that they are looked at, at most.
const MOST_RINGS: usize = 640;

/// What is left out of a map.
#[derive(Debug)]
pub(super) struct Beyond {
    /// λ_l that the last degrees were summed with, nothing where they were not.
    eigenvalues: Vec<f64>,
    /// The largest values in each bin.
    peaks: Vec<Peak>,
}

impl Beyond {
    /// Beyond the last even degrees, or odd ones, up to the last that λ_l are given of; `mean` is the map's.
    pub fn new(
        coefficients: &Coefficients,
        (lambda, is_odd): (&[f64], bool),
        mean: [f64; 3],
        instructions: InstructionSet,
    ) -> Self {
        let weights = mean.map(|mean| if mean > 0.0 { 1.0 / mean } else { 0.0 });
        let degree = lambda.len() - 1;
        let from = |part: f64| (part * degree as f64) as usize;
        let window =
            |lambda: &[f64], behind| Window::new(coefficients, (lambda, is_odd, behind), weights, instructions);
        let last = window(lambda, from(LAST));
        let before = window(&lambda[..=from(LAST)], from(LAST * LAST));
        let mut peaks = last.peaks;
        for (peak, before) in peaks.iter_mut().zip(&before.peaks) {
            peak.rises_to(std::array::from_fn(|c| to_come(before.values[c], peak.values[c])), weights);
        }
        Self { eigenvalues: last.eigenvalues, peaks }
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

/// What follows two sums of a geometric series, largest values each.
fn to_come(before: f64, last: f64) -> f64 {
    let times = 1.0 / (before / last - 1.0);
    if times > 0.0 { last * times.clamp(LEAST_TO_COME, MOST_TO_COME) } else { last * MOST_TO_COME }
}

/// What some degrees of a map come to.
struct Window {
    /// λ_l that they were summed with, nothing where they were not.
    eigenvalues: Vec<f64>,
    /// The largest values in each bin.
    peaks: Vec<Peak>,
}

impl Window {
    /// Of the even degrees, or odd ones, behind one up to the last that λ_l are given of.
    fn new(
        coefficients: &Coefficients,
        (lambda, is_odd, behind): (&[f64], bool, usize),
        weights: [f64; 3],
        instructions: InstructionSet,
    ) -> Self {
        let is_meant = |l: usize| l > behind && (l % 2 == 1) == is_odd;
        let eigenvalues: Vec<f64> = (0..).zip(lambda).map(|(l, &v)| if is_meant(l) { v } else { 0.0 }).collect();
        // (Horizons are lines: even a grid that is too coarse for the degrees meets them.)
        let rings = (lambda.len() - 1).clamp(16, MOST_RINGS);
        let grid = [rings, Fft::fast_length(9 * rings / 5).max(32)];
        let rings = match is_odd {
            false => Rings::of_even(coefficients, (&eigenvalues, behind), grid, instructions),
            true => Rings::new(coefficients, &eigenvalues, [0.0; 3], grid, instructions),
        };
        let mut peaks = rings.peaks(weights);
        // (The poles themselves lie between rings.)
        for (bin, pole) in [(0, DVec3::Y), (BINS[0] * (BINS[1] - 1), DVec3::NEG_Y)] {
            let values = at_pole(coefficients, &eigenvalues, pole.y).map(f64::abs);
            if peaks[bin].rises_to(values, weights) {
                peaks[bin].direction = pole;
            }
        }
        Self { eigenvalues, peaks }
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
    fn a_series_is_continued() {
        let sum = |from: f64, power: i32| {
            (from as usize..(from / LAST) as usize).map(|l| (l as f64).powi(-power)).sum::<f64>()
        };
        for power in [2, 3] {
            let all: f64 = (10000..1_000_000).map(|l| f64::from(l).powi(-power)).sum();
            let told = to_come(sum(4900.0, power), sum(7000.0, power));
            assert!((0.97..1.15).contains(&(told / all)), "l^-{power}: {told} wanted {all}");
        }
        assert_eq!(to_come(0.0, 0.0), 0.0);
    }

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
