//! Rows gathered at fewer polar angles: what makes panoramas cheap that are finer than any of their kernels.
//!
//! A row's integral ∫ P̄_l^m sin θ dθ is a sum over Gauss points, and P̄_l^m there is nearly what a polynomial through [`TAPS`] equally spaced
//! nodes around them says: so the row's texels go to the nodes, by the polynomial's weights, and the nodes are analysed instead of
//! rows. What a node takes of all rows is one function of φ. Past a pole the nodes go on down the other side, half a turn away.
//!
//! **Error.** A kernel's double pole (width² + θ²)⁻² is off by 215 (Δ/width)⁸ of its peak halfway between nodes of spacing Δ at most; a degree
//! l by 1.1e-3 (lΔ)⁸.

use std::borrow::Cow;
use std::f64::consts::PI;

use super::analysis::Texels;
use super::fft::Complex;
use super::lanes::{LANES, V, ZERO, scale_add};
use crate::math::quadrature::gauss_legendre;

/// Nodes that a Gauss point is shared among.
const TAPS: usize = 8;
/// Gauss points in a row; rows are lower than nodes are apart.
const POINTS: usize = 3;
/// Spacing in widths of the narrowest kernel: 2e-6 of its peak.
const PER_WIDTH: f64 = 0.1;
/// Degrees for a node, at most: of a kernel whose horizon shows, and of any (whose λ_l have fallen off at its last degrees).
const DEGREES: [f64; 2] = [0.45, 0.8];
/// Rows for a node from which it is worth while.
const WORTH: f64 = 1.6;
/// Columns gathered together, so that they stay near.
const TILE: usize = 64;
/// Rows that a sum takes in one after the other before it is put back.
const TOGETHER: usize = 4;

/// Nodes θ = (k + 1/2) π/n, eight of the north with their mirror images at a time.
#[derive(Debug)]
pub(super) struct Nodes {
    n: usize,
    height: usize,
    blocks: Vec<Gathered>,
}

/// What eight nodes gather.
#[derive(Debug, Clone, Default)]
struct Gathered {
    /// Rows with their weights at each of the nodes; and rows beyond the pole.
    rows: [Vec<(usize, V)>; 2],
}

impl Nodes {
    /// Nodes for a map of this shape and kernels of which the narrowest has a width, and whose horizons show up to a degree, others up to
    /// another; `None` if they would not be much fewer than rows.
    pub fn for_kernels(narrowest: f64, degrees: [usize; 2], [width, height]: [usize; 2]) -> Option<Self> {
        let by_degree = degrees.iter().zip(DEGREES).map(|(&degree, most)| degree as f64 / most).fold(0.0, f64::max);
        let n = (PI / (PER_WIDTH * narrowest)).max(by_degree) as usize;
        let n = n.next_multiple_of(2 * LANES);
        (width.is_multiple_of(2) && n as f64 * WORTH <= height as f64).then(|| Self::new(n, height))
    }

    fn new(n: usize, height: usize) -> Self {
        let mut blocks = vec![Gathered::default(); n / (2 * LANES)];
        let rule = gauss_legendre(POINTS);
        for row in 0..height {
            let place = |t: f64| PI * (row as f64 + t) / height as f64;
            // Normalised to the row's exact solid angle.
            let extent = 2.0 * libm::sin(place(0.5)) * libm::sin(0.5 * PI / height as f64);
            let weights: Vec<f64> = rule.iter().map(|(t, weight)| weight * libm::sin(place(t))).collect();
            let sum: f64 = weights.iter().sum();
            for (t, weight) in rule.nodes.iter().zip(weights) {
                let position = (row as f64 + t) / height as f64 * n as f64 - 0.5;
                let first = position.floor() as isize + 1 - (TAPS / 2) as isize;
                for (tap, share) in lagrange(position - first as f64).into_iter().enumerate() {
                    let node = first + tap as isize;
                    // (Beyond the other pole are mirror images of these.)
                    let (node, beyond) = if node < 0 { (-1 - node, 1) } else { (node, 0) };
                    let Some(block) = blocks.get_mut(node as usize / LANES) else { continue };
                    let rows = &mut block.rows[beyond];
                    if rows.last().is_none_or(|(last, _)| *last != row) {
                        rows.push((row, ZERO));
                    }
                    if let Some((_, weights)) = rows.last_mut() {
                        weights[node as usize % LANES] += share * weight * extent / sum;
                    }
                }
            }
        }
        Self { n, height, blocks }
    }

    /// Blocks of eight nodes.
    pub fn n_blocks(&self) -> usize {
        self.blocks.len()
    }

    /// cos θ and sin θ of a block's nodes.
    pub fn angles(&self, block: usize) -> [V; 2] {
        let node = |lane: usize| (block * LANES + lane) as f64 + 0.5;
        // cos θ = sin(π/2 − θ): exact at the equator.
        let cos = |lane: usize| libm::sin(PI * (0.5 * self.n as f64 - node(lane)) / self.n as f64);
        [std::array::from_fn(cos), std::array::from_fn(|lane| libm::sin(PI * node(lane) / self.n as f64))]
    }

    /// Whether anything is not zero in what a block gathers.
    pub fn occupied(&self, map: &dyn Texels, block: usize) -> bool {
        let mut rows = self.blocks[block].rows.iter().flatten();
        rows.any(|&(row, _)| map.occupied(row) || map.occupied(self.height - 1 - row))
    }

    /// Writes what eight nodes gather, channel by channel: north + south, and north − south.
    #[inline(always)]
    pub fn gather(&self, map: &dyn Texels, block: usize, to: &mut [Vec<Complex>; 3]) {
        let [width, height] = map.shape();
        let base = map.base();
        to.iter_mut().for_each(|channel| channel.fill(Complex::ZERO));
        for (beyond, rows) in self.blocks[block].rows.iter().enumerate() {
            let read: Vec<[Cow<[[f32; 3]]>; 2]> =
                rows.iter().map(|&(row, _)| [map.row(row), map.row(height - 1 - row)]).collect();
            for half in [0, width / 2] {
                for start in (0..width / 2).step_by(TILE) {
                    let columns = start..(start + TILE).min(width / 2);
                    let from = if beyond == 1 { width / 2 - half } else { half };
                    for (rows, read) in rows.chunks(TOGETHER).zip(read.chunks(TOGETHER)) {
                        let weights: [V; TOGETHER] = std::array::from_fn(|i| rows.get(i).map_or(ZERO, |row| row.1));
                        let texels: [[&[[f32; 3]]; 2]; TOGETHER] = std::array::from_fn(|i| {
                            let rows = &read[if i < read.len() { i } else { 0 }];
                            [0, 1].map(|k| &rows[k][from + columns.start..from + columns.end])
                        });
                        for (c, sums) in to.iter_mut().enumerate() {
                            let sums = &mut sums[half + columns.start..half + columns.end];
                            for (i, sum) in sums.iter_mut().enumerate() {
                                let (mut re, mut im) = (sum.re, sum.im);
                                for (weights, [north, south]) in weights.iter().zip(texels) {
                                    let [north, south] = [north, south].map(|row| f64::from(row[i][c]) - base[c]);
                                    re = scale_add(*weights, north + south, re);
                                    im = scale_add(*weights, north - south, im);
                                }
                                (sum.re, sum.im) = (re, im);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The weights of the points 0, 1, … at `t`.
fn lagrange(t: f64) -> [f64; TAPS] {
    std::array::from_fn(|i| {
        let others = (0..TAPS).filter(|j| *j != i);
        others.fold(1.0, |product, j| product * (t - j as f64) / (i as f64 - j as f64))
    })
}

#[cfg(test)]
mod tests {
    use super::super::analysis::{Rows, analyse};
    use super::super::plan::row_rule;
    use super::super::{InstructionSet, Rest};
    use crate::environment::test_maps::random;

    use super::*;

    /// Coefficients by nodes and by rows, of a map twice and of one four times as high as the nodes; a sun at a pole, one beside it, one at the equator.
    /// What a degree l is off by is what was proved, times the largest coefficient there can be.
    #[test]
    fn nodes_hold_what_rows_hold() {
        for (width, n, sun) in [(128, 32, (9, 0)), (256, 32, (255, 1)), (256, 64, (3, 63)), (250, 32, (100, 124))] {
            let panorama = random(width, 5, Some(sun));
            let map = Rest {
                panorama: &panorama,
                changed: vec![],
                darkest: [0.0; 3],
                mean: panorama.mean(),
                norm2: [0.0; 3],
            };
            let (degree, set) = (n / 3, InstructionSet::detect());
            let wanted = analyse(&map, degree, &Rows::Points(row_rule(0.1, degree, width / 2)), set);
            let got = analyse(&map, degree, &Rows::Nodes(Nodes::new(n, width / 2)), set);
            let flux: f64 = (0..3).map(|c| panorama.mean()[c]).fold(0.0, f64::max) * 4.0 * PI;
            for (m, (got, wanted)) in got.orders.iter().zip(&wanted.orders).enumerate() {
                for (k, (got, wanted)) in got.iter().zip(wanted).enumerate() {
                    let l = (m + k) as f64;
                    // |Y_lm| ≤ √((2l + 1)/4π); the rows' own points leave 1e-7.
                    // (The mean is no polynomial's to miss.)
                    let bound = if l == 0.0 { 1e-14 } else { 1.1e-3 * (l * PI / n as f64).powi(8) + 1e-7 };
                    let tolerance = bound * flux * ((2.0 * l + 1.0) / (4.0 * PI)).sqrt();
                    for (got, wanted) in got.iter().zip(wanted) {
                        let off = (got - wanted).abs();
                        assert!(off <= tolerance, "{width} wide, {n} nodes, l {l}, m {m}: {off:e} > {tolerance:e}");
                    }
                }
            }
        }
    }
}
