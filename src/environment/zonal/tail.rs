//! High degrees of kernels whose horizon shows, for all of these kernels at once.
//!
//! Beyond the degrees of its cap, a kernel a (c)₊ + b (c)₊² + … is only its kink: 2 (c)₊ = c + |c|, so that λ_l of a (c)₊ are nothing for odd l > 1
//! and for even l the same for all kernels but for a; those of b (c)₊² are smaller by some 2b/(a l). What even degrees beyond some hundred add
//! to the filtered map is therefore nearly one function T times a number for each kernel, and T(−R) = T(R): half of the sums, a
//! quarter of the grid, and once for a whole chain.
//!
//! T is a small part of an output that is dark, and 1/100 of a bright one: some percent of it are enough. Rows are their middles, put right for
//! their heights. What is left out (odd degrees, and what λ_l differ from Lambert's) is part of the bound of truncation.

use super::InstructionSet;
use super::analysis::{Rows, Texels, analyse};
use super::beyond::{Beyond, at_pole};
use super::fft::Fft;
use super::legendre::Degrees;
use super::nodes::Nodes;
use super::synthesis::Rings;
use crate::math::quadrature::Rule;

/// Rings for a degree: those of the last degrees, which add least, are farther apart than would hold them.
const RINGS: f64 = 1.1;

/// Σ λ_l f_lm Y_lm over even degrees, λ_l Lambert's.
#[derive(Debug)]
pub(super) struct Tail {
    pub rings: Rings,
    /// λ_0 … λ_L.
    pub eigenvalues: Vec<f64>,
    /// The degree that it begins behind.
    pub behind: usize,
    /// What it leaves out.
    pub beyond: Beyond,
    /// Its values at the poles, above and below.
    pub poles: [[f64; 3]; 2],
    /// Σ |f_lm|² of each degree and channel.
    powers: Vec<[f64; 3]>,
}

impl Tail {
    /// From even degrees beyond one up to the last that Lambert's λ_l are given of; `mean` is the whole map's.
    pub fn new(
        map: &dyn Texels,
        behind: usize,
        eigenvalues: Vec<f64>,
        mean: [f64; 3],
        instructions: InstructionSet,
    ) -> Self {
        let degree = eigenvalues.len() - 1;
        let parts = degree.div_ceil(map.shape()[1]);
        let middles = || Rule {
            nodes: (0..parts).map(|i| (i as f64 + 0.5) / parts as f64).collect(),
            weights: vec![1.0 / parts as f64; parts],
        };
        let rows = Nodes::for_some_percent(degree, map.shape()).map_or_else(|| Rows::Middles(middles()), Rows::Nodes);
        let coefficients = analyse(map, degree, Degrees::EvenAbove(behind), &rows, instructions);
        let rings = RINGS * degree as f64;
        let grid = [rings as usize, Fft::fast_length((1.8 * rings) as usize)];
        let rings = Rings::of_even(&coefficients, (&eigenvalues, behind), grid, instructions);
        let beyond = Beyond::new(&coefficients, (&eigenvalues, false), mean, instructions);
        let poles = [1.0, -1.0].map(|y| at_pole(&coefficients, &eigenvalues, y));
        Self { rings, eigenvalues, behind, beyond, poles, powers: coefficients.powers() }
    }

    pub fn degree(&self) -> usize {
        self.eigenvalues.len() - 1
    }

    /// Σ |f_lm|² of a channel over its degrees beyond one.
    pub fn power_beyond(&self, degree: usize, channel: usize) -> f64 {
        self.powers.iter().skip(degree + 1).map(|power| power[channel]).sum()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::Rest;
    use super::super::plan::{lambdas, row_rule};
    use super::super::synthesis::angles;
    use super::*;
    use crate::environment::kernel::Kernel;
    use crate::environment::test_maps::random;

    /// By the middles of rows, of a map with as many rows as degrees and of one with half as many; by nodes, of one with four times as many.
    #[test]
    fn a_tail_is_nearly_what_all_of_its_degrees_make() {
        // Of a lone sun all degrees are as strong, but for λ_l: the last quarter of them, which interpolation hardly holds, is 8 % of the sum. Nodes
        // leave 4 % of the last ones along each angle.
        for (width, behind, degree, tolerance) in [(128, 16, 64, 0.08), (64, 16, 64, 0.08), (256, 10, 32, 0.16)] {
            let (panorama, set) = (random(width, 11, Some((width / 3, width / 7))), InstructionSet::detect());
            let map = Rest::whole(&panorama, [0.0; 3]);
            let tail = Tail::new(&map, behind, lambdas(&Kernel::new(1.0), degree, set), [1.0; 3], set);
            let rows = Rows::Points(row_rule(0.1, degree, width / 2));
            let exact = analyse(&map, degree, Degrees::All, &rows, set);
            let is_meant = |l: &usize| Degrees::EvenAbove(behind).contains(*l);
            let of = |l: usize| if is_meant(&l) { tail.eigenvalues[l] } else { 0.0 };
            let all: Vec<f64> = (0..=degree).map(of).collect();
            let exact = Rings::new(&exact, &all, [0.0; 3], [4 * degree, 8 * degree], set);
            let (mut most, mut off) = (0.0f64, 0.0f64);
            for i in 0..400 {
                let y = 1.0 - 2.0 * (f64::from(i) + 0.5) / 400.0;
                let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
                let direction = DVec3::new(cos, 0.0, sin) * (1.0 - y * y).sqrt() + DVec3::Y * y;
                let (got, wanted) = (tail.rings.at(angles(direction)), exact.at(angles(direction)));
                for c in 0..3 {
                    most = most.max(wanted[c].abs());
                    off = off.max((got[c] - wanted[c]).abs());
                }
            }
            assert!(off < tolerance * most, "{width} wide, {behind} to {degree}: off by {off:e} of {most:e}");
        }
    }
}
