//! Rows gathered at fewer polar angles, and their columns at fewer azimuths: what makes panoramas cheap that are finer than any of their kernels.
//!
//! A row's integral ∫ P̄_l^m sin θ dθ is a sum over Gauss points, and P̄_l^m there is nearly what a polynomial through [`TAPS`] equally spaced
//! nodes around them says: so the row's texels go to the nodes, by the polynomial's weights, and the nodes are analysed instead of
//! rows. What a node takes of all rows is one function of φ, piecewise constant, whose columns go to fewer in the same way: e^(−imφ) is nearly a
//! polynomial too. Past a pole the nodes go on down the other side, half a turn away.
//!
//! **Error.** A kernel's double pole (width² + θ²)⁻² is off by 215 (Δ/width)⁸ of its peak halfway between nodes of spacing Δ at most; a degree
//! l by 1.1e-3 (lΔ)⁸, an order m by 1.1e-3 (mΔ)⁸.

use std::borrow::Cow;
use std::f64::consts::PI;

use super::analysis::Texels;
use super::fft::{Complex, Fft};
use super::lanes::{LANES, V, ZERO, scale_add};
use crate::math::quadrature::gauss_legendre;

/// Nodes that a Gauss point is shared among.
const TAPS: usize = 8;
/// Gauss points in a row or column; they are smaller than nodes are apart.
const POINTS: usize = 3;
/// Spacing in widths of the narrowest kernel: 2e-6 of its peak.
const PER_WIDTH: f64 = 0.1;
/// Degrees for a node, at most: of a kernel whose horizon shows, and of any (whose λ_l have fallen off at its last degrees).
const DEGREES: [f64; 2] = [0.45, 0.8];
/// Rows (or columns) for a node from which it is worth while.
const WORTH: f64 = 1.6;
/// Columns of all rows that are converted together, and of these the columns that are summed together: as many numbers as registers hold.
const TILE: usize = 64;
const STRIP: usize = 8;

/// Nodes θ = (k + 1/2) π/n, eight of the north with their mirror images at a time.
#[derive(Debug)]
pub(super) struct Nodes {
    n: usize,
    height: usize,
    blocks: Vec<Gathered>,
    columns: Option<Columns>,
}

/// What eight nodes gather.
#[derive(Debug, Clone, Default)]
struct Gathered {
    /// Rows, and whether they are meant beyond the pole.
    rows: Vec<(usize, bool)>,
    /// What each node takes of them.
    spans: [Vec<Span>; LANES],
}

/// Rows one after the other, from the `first` of those gathered on, and their weights.
#[derive(Debug, Clone)]
struct Span {
    first: usize,
    weights: Vec<f64>,
}

/// Nodes φ = 2π j/n from the left edge of the map.
#[derive(Debug)]
struct Columns {
    n: usize,
    /// Of each column of the map: the first node that takes of it, and what this one and those after it take.
    shares: Vec<(usize, [f64; TAPS])>,
}

impl Columns {
    fn new(n: usize, width: usize) -> Self {
        let rule = gauss_legendre(POINTS);
        let shares = (0..width)
            .map(|column| {
                // The nodes around its middle serve all of a column: where one begins within it, its polynomial is as good a little further.
                let place = |t: f64| (column as f64 + t) / width as f64 * n as f64;
                let first = place(0.5).floor() + 1.0 - (TAPS / 2) as f64;
                let mut shares = [0.0; TAPS];
                for (t, weight) in rule.iter() {
                    for (share, of) in shares.iter_mut().zip(lagrange(place(t) - first)) {
                        *share += weight * of;
                    }
                }
                ((first + n as f64) as usize % n, shares)
            })
            .collect();
        Self { n, shares }
    }
}

/// Texels of a tile, as numbers, and their sums, of the north and of the south.
pub(super) struct Scratch {
    texels: [Vec<f64>; 2],
    sums: [[[f64; 3 * TILE]; LANES]; 2],
}

impl Scratch {
    pub fn new() -> Self {
        Self { texels: [vec![], vec![]], sums: [[[0.0; 3 * TILE]; LANES]; 2] }
    }
}

impl Nodes {
    /// Nodes for a map of this shape and kernels of which the narrowest has a width, and whose horizons show up to a degree, others up to
    /// another; `None` if they would not be much fewer than rows.
    pub fn for_kernels(narrowest: f64, degrees: [usize; 2], [width, height]: [usize; 2]) -> Option<Self> {
        let by_degree = degrees.iter().zip(DEGREES).map(|(&degree, most)| degree as f64 / most).fold(0.0, f64::max);
        Self::at_least((PI / (PER_WIDTH * narrowest)).max(by_degree), [width, height])
    }

    /// Nodes for a map of this shape and degrees up to one: to 4 % at the last, to 2e-4 at half of them.
    pub fn for_some_percent(degree: usize, shape: [usize; 2]) -> Option<Self> {
        Self::at_least(degree as f64 / 0.5, shape)
    }

    fn at_least(n: f64, [width, height]: [usize; 2]) -> Option<Self> {
        let n = (n as usize).next_multiple_of(2 * LANES);
        (width.is_multiple_of(2) && n as f64 * WORTH <= height as f64).then(|| Self::new(n, [width, height]))
    }

    fn new(n: usize, [width, height]: [usize; 2]) -> Self {
        let mut blocks: Vec<[Vec<(usize, V)>; 2]> = vec![Default::default(); n / (2 * LANES)];
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
                    let rows = &mut block[beyond];
                    if rows.last().is_none_or(|(last, _)| *last != row) {
                        rows.push((row, ZERO));
                    }
                    if let Some((_, weights)) = rows.last_mut() {
                        weights[node as usize % LANES] += share * weight * extent / sum;
                    }
                }
            }
        }
        // The same spacing at the equator.
        let n_columns = Fft::fast_length(2 * n);
        let columns = (n_columns as f64 * WORTH <= width as f64).then(|| Columns::new(n_columns, width));
        Self { n, height, blocks: blocks.iter().map(Gathered::new).collect(), columns }
    }

    /// Blocks of eight nodes.
    pub fn n_blocks(&self) -> usize {
        self.blocks.len()
    }

    /// How many nodes columns were gathered at, if they were.
    pub fn n_columns(&self) -> Option<usize> {
        self.columns.as_ref().map(|columns| columns.n)
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
        let mut rows = self.blocks[block].rows.iter();
        rows.any(|&(row, _)| map.occupied(row) || map.occupied(self.height - 1 - row))
    }

    /// Writes what eight nodes gather, channel by channel: north + south, and north − south.
    #[inline(always)]
    pub fn gather(&self, map: &dyn Texels, block: usize, scratch: &mut Scratch, to: &mut [Vec<Complex>; 3]) {
        let [width, height] = map.shape();
        let base: [f64; 3 * TILE] = std::array::from_fn(|i| map.base()[i % 3]);
        let block = &self.blocks[block];
        let read: Vec<[Cow<[[f32; 3]]>; 2]> =
            block.rows.iter().map(|&(row, _)| [map.row(row), map.row(height - 1 - row)]).collect();
        scratch.texels.iter_mut().for_each(|texels| texels.resize(3 * TILE * read.len(), 0.0));
        to.iter_mut().for_each(|channel| channel.fill(Complex::ZERO));
        for half in [0, width / 2] {
            for start in (half..half + width / 2).step_by(TILE) {
                let n = TILE.min(half + width / 2 - start);
                for (hemisphere, (texels, sums)) in scratch.texels.iter_mut().zip(&mut scratch.sums).enumerate() {
                    for ((read, (_, beyond)), texels) in
                        read.iter().zip(&block.rows).zip(texels.chunks_exact_mut(3 * TILE))
                    {
                        let from = if *beyond { start + width / 2 - 2 * half } else { start };
                        let row = read[hemisphere][from..from + n].as_flattened();
                        for ((texel, value), base) in texels.iter_mut().zip(row).zip(&base) {
                            *texel = f64::from(*value) - base;
                        }
                    }
                    for (spans, sums) in block.spans.iter().zip(sums) {
                        for (strip, sums) in
                            sums.as_chunks_mut::<{ 3 * STRIP }>().0.iter_mut().enumerate().take(n.div_ceil(STRIP))
                        {
                            *sums = sum_of(spans, texels, strip * 3 * STRIP);
                        }
                    }
                }
                self.put(start, n, &scratch.sums, to);
            }
        }
    }

    /// Adds the sums of some columns to what becomes of them.
    #[inline(always)]
    fn put(&self, start: usize, n: usize, [north, south]: &[[[f64; 3 * TILE]; LANES]; 2], to: &mut [Vec<Complex>; 3]) {
        for i in 0..n {
            for (c, to) in to.iter_mut().enumerate() {
                let at = 3 * i + c;
                let re: V = std::array::from_fn(|lane| north[lane][at] + south[lane][at]);
                let im: V = std::array::from_fn(|lane| north[lane][at] - south[lane][at]);
                let Some(columns) = &self.columns else {
                    to[start + i] = Complex { re, im };
                    continue;
                };
                let (first, shares) = &columns.shares[start + i];
                for (tap, &share) in shares.iter().enumerate() {
                    let node = first + tap;
                    let sum = &mut to[if node < columns.n { node } else { node - columns.n }];
                    *sum = Complex { re: scale_add(re, share, sum.re), im: scale_add(im, share, sum.im) };
                }
            }
        }
    }
}

impl Gathered {
    /// From the weights of rows on this side of the pole, and beyond it.
    fn new([here, beyond]: &[Vec<(usize, V)>; 2]) -> Self {
        let mut rows = vec![];
        let mut spans: [Vec<Span>; LANES] = Default::default();
        for (of, is_beyond) in [(beyond, true), (here, false)] {
            for (lane, spans) in spans.iter_mut().enumerate() {
                let is_taken = |(_, weights): &(usize, V)| weights[lane] != 0.0;
                if let (Some(first), Some(last)) = (of.iter().position(is_taken), of.iter().rposition(is_taken)) {
                    let weights = of[first..=last].iter().map(|(_, weights)| weights[lane]).collect();
                    spans.push(Span { first: rows.len() + first, weights });
                }
            }
            rows.extend(of.iter().map(|&(row, _)| (row, is_beyond)));
        }
        Self { rows, spans }
    }
}

/// The weighted sum of the rows of a tile, from a number of theirs on.
#[inline(always)]
fn sum_of(spans: &[Span], texels: &[f64], from: usize) -> [f64; 3 * STRIP] {
    let mut sums = [0.0; 3 * STRIP];
    for Span { first, weights } in spans {
        let rows = texels[first * 3 * TILE..].chunks_exact(3 * TILE);
        for (weight, row) in weights.iter().zip(rows) {
            let row = &row[from..from + 3 * STRIP];
            for (sum, texel) in sums.iter_mut().zip(row) {
                *sum += weight * texel;
            }
        }
    }
    sums
}

/// The weights of the points 0, 1, … at `t`.
fn lagrange(t: f64) -> [f64; TAPS] {
    /// ∏ (i − j) over the others.
    const APART: [f64; TAPS] = [-5040.0, 720.0, -240.0, 144.0, -144.0, 240.0, -720.0, 5040.0];
    let mut weights = APART.map(|apart| 1.0 / apart);
    let (mut below, mut above) = (1.0, 1.0);
    for i in 0..TAPS {
        let from_end = TAPS - 1 - i;
        weights[i] *= below;
        weights[from_end] *= above;
        below *= t - i as f64;
        above *= t - from_end as f64;
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::super::analysis::{Rows, analyse};
    use super::super::legendre::Degrees;
    use super::super::plan::row_rule;
    use super::super::{InstructionSet, Rest};
    use crate::environment::test_maps::random;

    use super::*;

    #[test]
    fn weights_are_one_at_their_own_point_and_interpolate_polynomials_of_degree_seven() {
        for i in 0..TAPS {
            let wanted: [f64; TAPS] = std::array::from_fn(|j| f64::from(u8::from(i == j)));
            assert_eq!(lagrange(i as f64), wanted);
        }
        for t in [0.3, 3.5, 3.9, 6.99] {
            for power in 0..TAPS as i32 {
                let got: f64 = lagrange(t).iter().zip(0..).map(|(weight, i)| weight * f64::from(i).powi(power)).sum();
                let wanted = t.powi(power);
                assert!((got - wanted).abs() < 1e-12 * 7f64.powi(power), "{t} to the {power}: {got}");
            }
        }
    }

    /// Coefficients by nodes and by rows, of a map twice and of one four times as high as the nodes; a sun at a pole, one beside it, one at the equator.
    /// What a degree l is off by is what was proved, times the largest coefficient there can be.
    #[test]
    fn nodes_hold_what_rows_hold() {
        for (width, n, sun) in [(128, 32, (9, 0)), (256, 32, (255, 1)), (256, 64, (3, 63)), (250, 32, (100, 124))] {
            let panorama = random(width, 5, Some(sun));
            let map = Rest::whole(&panorama, [0.0; 3]);
            let (degree, set) = (n / 3, InstructionSet::detect());
            let wanted = analyse(&map, degree, Degrees::All, &Rows::Points(row_rule(0.1, degree, width / 2)), set);
            let got = analyse(&map, degree, Degrees::All, &Rows::Nodes(Nodes::new(n, [width, width / 2])), set);
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
