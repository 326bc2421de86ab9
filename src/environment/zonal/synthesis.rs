//! From coefficients to values: rings of constant θ, equally spaced in both angles, and the value in any direction between them.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

use super::analysis::{Coefficients, PARTS};
use super::dark::{BINS, bin_row};
use super::fft::{Complex, Fft};
use super::lanes::{InstructionSet, LANES, V, ZERO, add, scale, scale_add, sub};
use super::legendre::{CHUNK, Degrees, Order, Places, Walk, negligible, sectoral_norms};
use crate::environment::cube::centre;

/// Taps of the interpolation in each angle.
pub(super) const TAPS: usize = 6;
/// Columns that are taken out of a transform at a time.
const TILE: usize = 16;
/// Copies of what lies beyond a turn on each side, so that taps need no wrapping.
const MARGIN: usize = 3;

/// A function on a grid of rings θ = (k + 1/2) π/rings, φ = 2π j/columns.
#[derive(Debug, Clone)]
pub(super) struct Rings {
    rings: usize,
    columns: usize,
    /// What is added to the values that are kept, about their mean: where the sum is dark, its rounding is small too.
    base: [f32; 3],
    /// Eight rings of the north, then their mirror images, each with [`MARGIN`] columns more on both sides; and one texel that is none, so
    /// that four numbers can be read where three are meant. Of an even function, sixteen rings of the north: the south is the north from the
    /// other side.
    strips: Vec<Vec<[f32; 3]>>,
    is_even: bool,
}

/// Eight rings of the north and their mirror images.
struct Block {
    places: Places,
    largest_sin: f64,
}

impl Rings {
    /// Σ λ_l f_lm Y_lm on `rings` × `columns` points (`columns` even and more than twice the degree of λ), of a function that was
    /// made of one whose mean is `mean` by taking it off.
    pub fn new(
        coefficients: &Coefficients,
        eigenvalues: &[f64],
        mean: [f64; 3],
        [rings, columns]: [usize; 2],
        instructions: InstructionSet,
    ) -> Self {
        let base = mean.map(|m| (eigenvalues[0] * m) as f32);
        Self::make(coefficients, (eigenvalues, Degrees::All), base, [rings, columns], instructions)
    }

    /// Σ λ_l f_lm Y_lm of even l beyond `last`.
    pub fn of_even(
        coefficients: &Coefficients,
        (eigenvalues, last): (&[f64], usize),
        grid: [usize; 2],
        instructions: InstructionSet,
    ) -> Self {
        Self::make(coefficients, (eigenvalues, Degrees::EvenAbove(last)), [0.0; 3], grid, instructions)
    }

    fn make(
        coefficients: &Coefficients,
        (eigenvalues, degrees): (&[f64], Degrees),
        base: [f32; 3],
        [rings, columns]: [usize; 2],
        instructions: InstructionSet,
    ) -> Self {
        let degree = eigenvalues.len() - 1;
        debug_assert!(columns.is_multiple_of(2) && degree <= coefficients.degree);
        let is_even = degrees != Degrees::All;
        let n_blocks = rings.div_ceil(2).div_ceil(LANES);
        // (Two at a time become a strip of an even function.)
        let n_blocks = if is_even { n_blocks.next_multiple_of(2) } else { n_blocks };
        let blocks: Vec<Block> = (0..n_blocks).map(|b| block(b * LANES, rings, degree)).collect();
        let norms = sectoral_norms(degree);
        let spectra: Vec<Vec<[V; PARTS]>> = (0..degree + 1)
            .into_par_iter()
            .with_max_len(1)
            .map(|m| {
                let orders = &coefficients.orders[m];
                instructions.run(
                    #[inline(always)]
                    || synthesise_order(m, orders, (eigenvalues, degrees), norms[m], &blocks),
                )
            })
            .collect();
        let fft = Fft::new(columns);
        let strips = (0..if is_even { n_blocks / 2 } else { n_blocks })
            .into_par_iter()
            .map_init(
                || [(); 4].map(|()| vec![Complex::ZERO; columns]),
                |lines, b| {
                    instructions.run(
                        #[inline(always)]
                        || strip(b, is_even, &spectra, base, &fft, lines),
                    )
                },
            )
            .collect();
        Self { rings, columns, base, strips, is_even }
    }

    /// The value at θ/π in [0, 1] and the turn (φ + π)/2π in [0, 2), by Lagrange interpolation of degree five in both.
    #[inline(always)]
    pub fn at(&self, [theta, turn]: [f64; 2]) -> [f64; 3] {
        let (ring, down) = self.rings_at(theta);
        let (column, across) = self.columns_at(turn);
        let mut sums = [0.0; 3 * TAPS];
        for (i, weight) in down.into_iter().enumerate() {
            let taps = self.taps(ring + i as isize, column).as_flattened();
            for (sum, tap) in sums.iter_mut().zip(taps) {
                *sum += f64::from(*tap) * weight;
            }
        }
        let [mut r, mut g, mut b] = self.base.map(|base| -f64::from(base));
        for (sums, weight) in sums.as_chunks::<3>().0.iter().zip(across) {
            r += sums[0] * weight;
            g += sums[1] * weight;
            b += sums[2] * weight;
        }
        [r, g, b]
    }

    /// The first of the rings around θ/π in [0, 1], which may lie beyond a pole, and the weights of the rings from there on.
    #[inline(always)]
    pub fn rings_at(&self, theta: f64) -> (isize, [f64; TAPS]) {
        let (ring, t) = split(theta * self.rings as f64 - 0.5);
        (ring + 1 - (TAPS / 2) as isize, lagrange(t))
    }

    /// The column before a turn in [0, 2), and the weights of those around it.
    #[inline(always)]
    fn columns_at(&self, turn: f64) -> (usize, [f64; TAPS]) {
        let (column, u) = split(turn * self.columns as f64);
        (self.within(column as usize), lagrange(u))
    }

    /// The values along a meridian, at rings from `first` on, as they are before interpolation between rings. (Of four numbers the last
    /// means nothing: vectors hold four.)
    #[inline(always)]
    pub fn along_meridian(&self, turn: f64, first: isize, values: &mut [[f64; 4]]) {
        let (column, across) = self.columns_at(turn);
        let [r, g, b] = self.base.map(f64::from);
        for (i, value) in values.iter_mut().enumerate() {
            let start = self.start(first + i as isize, column);
            let taps = &self.strips[start.0].as_flattened()[3 * start.1..][..3 * TAPS + 1];
            let mut sum = [0.0; 4];
            for (tap, weight) in across.into_iter().enumerate() {
                (0..4).for_each(|c| sum[c] += weight * f64::from(taps[3 * tap + c]));
            }
            *value = [sum[0] - r, sum[1] - g, sum[2] - b, sum[3]];
        }
    }

    /// A column of less than two turns.
    #[inline(always)]
    fn within(&self, column: usize) -> usize {
        if column >= self.columns { column - self.columns } else { column }
    }

    /// The values around a column of a ring.
    #[inline(always)]
    fn taps(&self, ring: isize, column: usize) -> &[[f32; 3]; TAPS] {
        let (strip, start) = self.start(ring, column);
        let taps = self.strips[strip][start..].first_chunk();
        taps.expect("a column lies within its ring, which has margins on both sides")
    }

    /// The strip, and the texel in it, from which on lies what is around a column of a ring. Over a pole, the ring on its other side comes
    /// half a turn away.
    #[inline(always)]
    fn start(&self, ring: isize, column: usize) -> (usize, usize) {
        let last = self.rings as isize - 1;
        let opposite = || self.within(column + self.columns / 2);
        let (ring, column) = match ring {
            r if r < 0 => (-1 - r, opposite()),
            r if r > last => (2 * last + 1 - r, opposite()),
            r => (r, column),
        };
        let (strip, first, is_turned) = self.ring(ring as usize);
        let column = if is_turned { self.within(column + self.columns / 2) } else { column };
        (strip, first + column + 1 - TAPS / 2)
    }

    /// Where a ring lies: the strip, its first column there, and whether it is half a turn from where it should be.
    #[inline(always)]
    fn ring(&self, ring: usize) -> (usize, usize, bool) {
        let (north, south) = (ring, self.rings - 1 - ring);
        let (strip, row, is_turned) = match (self.is_even, north <= south) {
            (false, true) => (north / LANES, north % LANES, false),
            (false, false) => (south / LANES, south % LANES + LANES, false),
            (true, true) => (north / (2 * LANES), north % (2 * LANES), false),
            (true, false) => (south / (2 * LANES), south % (2 * LANES), true),
        };
        (strip, row * (self.columns + 2 * MARGIN) + MARGIN, is_turned)
    }

    /// The largest values in each of [`BINS`]; the channels are compared by their products with `weights`.
    pub fn peaks(&self, weights: [f64; 3]) -> Vec<Peak> {
        let across = BINS[0];
        let mut peaks = vec![Peak::default(); across * BINS[1]];
        for ring in 0..self.rings {
            let (sin, y) = libm::sincos(PI * (ring as f64 + 0.5) / self.rings as f64);
            let (strip, first, is_turned) = self.ring(ring);
            let line = &self.strips[strip][first..first + self.columns];
            for (bin, peak) in peaks[bin_row(y) * across..][..across].iter_mut().enumerate() {
                let mut at = None;
                for column in bin * self.columns / across..(bin + 1) * self.columns / across {
                    let texel = line[if is_turned { self.within(column + self.columns / 2) } else { column }];
                    let values: [f64; 3] = std::array::from_fn(|c| f64::from((texel[c] - self.base[c]).abs()));
                    if peak.rises_to(values, weights) {
                        at = Some(column);
                    }
                }
                if let Some(column) = at {
                    let (up, along) = libm::sincos(TAU * column as f64 / self.columns as f64 - PI);
                    peak.direction = DVec3::new(sin * along, y, sin * up);
                }
            }
        }
        peaks
    }
}

/// What is largest in a bin of directions.
#[derive(Debug, Clone, Default)]
pub(super) struct Peak {
    /// The largest absolute value of each channel.
    pub values: [f64; 3],
    /// The largest of all, weighted, and where it is.
    pub height: f64,
    pub direction: DVec3,
}

impl Peak {
    /// Takes what is larger of some values; whether they are higher than all before.
    pub fn rises_to(&mut self, values: [f64; 3], weights: [f64; 3]) -> bool {
        (0..3).for_each(|c| self.values[c] = self.values[c].max(values[c]));
        let height = (0..3).map(|c| values[c] * weights[c]).fold(0.0, f64::max);
        let is_higher = height > self.height;
        self.height = self.height.max(height);
        is_higher
    }
}

/// The whole part of a position, and the rest.
#[inline(always)]
fn split(position: f64) -> (isize, f64) {
    let floor = position.floor();
    (floor as isize, position - floor)
}

/// θ/π and (φ + π)/2π of a direction of any length.
#[inline(always)]
pub(super) fn angles(direction: DVec3) -> [f64; 2] {
    let DVec3 { x, y, z } = direction;
    [libm::atan2((x * x + z * z).sqrt(), y) / PI, (libm::atan2(z, x) + PI) / TAU]
}

/// The angles of the texels of a cube's faces at the poles, as [`angles`] gives them: of a quarter of one, whose mirror images are the rest.
pub(super) struct PoleAngles {
    size: usize,
    /// θ/π and the turn from azimuth 0, row by row from the middle on.
    quarter: Vec<[f64; 2]>,
}

impl PoleAngles {
    pub fn new(size: usize) -> Self {
        let half = size.div_ceil(2);
        let mut quarter = vec![[0.0; 2]; half * half];
        quarter.par_chunks_mut(half).enumerate().for_each(|(row, texels)| {
            let v = centre(size, size / 2 + row);
            for (column, texel) in texels.iter_mut().enumerate() {
                let u = centre(size, size / 2 + column);
                *texel = [libm::atan2((u * u + v * v).sqrt(), 1.0) / PI, libm::atan2(v, u) / TAU];
            }
        });
        Self { size, quarter }
    }

    /// Of a texel of the face above (2) or below (3).
    #[inline(always)]
    pub fn of(&self, face: usize, row: usize, column: usize) -> [f64; 2] {
        let half = self.size.div_ceil(2);
        let from_middle = |i: usize| (if 2 * i < self.size { self.size - 1 - i } else { i }) - self.size / 2;
        let [theta, mut turn] = self.quarter[from_middle(row) * half + from_middle(column)];
        if 2 * column + 1 < self.size {
            turn = 0.5 - turn;
        }
        if 2 * row + 1 < self.size {
            turn = -turn;
        }
        // Below they are (u, −1, −v).
        if face == 2 { [theta, 0.5 + turn] } else { [1.0 - theta, 0.5 - turn] }
    }
}

/// The weights of the points −2, −1, 0, 1, 2, 3 at t in [0, 1].
#[inline(always)]
fn lagrange(t: f64) -> [f64; TAPS] {
    let d = [t + 2.0, t + 1.0, t, t - 1.0, t - 2.0, t - 3.0];
    let (low, middle, high) = (d[0] * d[1], d[2] * d[3], d[4] * d[5]);
    [
        d[1] * middle * high / -120.0,
        d[0] * middle * high / 24.0,
        low * d[3] * high / -12.0,
        low * d[2] * high / 12.0,
        low * middle * d[5] / -24.0,
        low * middle * d[4] / 120.0,
    ]
}

fn block(first: usize, rings: usize, degree: usize) -> Block {
    let (mut cos, mut sin) = (ZERO, [1.0; LANES]);
    let mut largest_sin = 0.0f64;
    for lane in 0..LANES {
        let ring = (first + lane) as f64;
        if first + lane < rings.div_ceil(2) {
            sin[lane] = libm::sin(PI * (ring + 0.5) / rings as f64);
            cos[lane] = libm::sin(PI * (0.5 * rings as f64 - ring - 0.5) / rings as f64);
            largest_sin = largest_sin.max(sin[lane]);
        }
    }
    Block { places: Places::new(cos, sin, degree), largest_sin }
}

/// Sums over l of even and of odd l − m, at every block; or of those of both that are meant.
#[inline(always)]
fn synthesise_order(
    m: usize,
    coefficients: &[[f64; PARTS]],
    (eigenvalues, degrees): (&[f64], Degrees),
    norm: f64,
    blocks: &[Block],
) -> Vec<[V; PARTS]> {
    let degree = eigenvalues.len() - 1;
    let order = Order::new(m, degree);
    let mut terms = vec![[0.0; PARTS]; order.a.len()];
    for (k, term) in terms.iter_mut().enumerate().take(degree + 1 - m) {
        let factor = eigenvalues[m + k] * order.s[k];
        *term = coefficients[k].map(|v| v * factor);
    }
    // (Rings go from the pole to the equator, and the farther, the less is negligible.)
    let first = blocks.iter().position(|block| !negligible(degree, m, block.largest_sin)).unwrap_or(blocks.len());
    let parities = degrees.parities(m);
    let mut result = Vec::with_capacity(blocks.len() * parities.len());
    result.resize(first * parities.len(), [ZERO; PARTS]);
    let mut q = [[ZERO; CHUNK]; 2];
    for pair in blocks[first..].chunks(2) {
        let cos = [&pair[0].places.cos, &pair[pair.len() - 1].places.cos];
        let [mut one, mut other] = [0, pair.len() - 1].map(|i| pair[i].places.start(m, [norm; LANES]));
        let mut all = [[[ZERO; PARTS]; 2]; 2];
        let chunks = order.a.as_chunks::<CHUNK>().0.iter().zip(terms.as_chunks::<CHUNK>().0);
        for ((a, terms), l) in chunks.zip((m..).step_by(CHUNK)) {
            let any = match pair.len() {
                1 => [one.advance(*cos[0], a, &mut q[0]), false],
                _ => Walk::advance_two([&mut one, &mut other], cos, a, &mut q),
            };
            if !degrees.any_from(l) {
                continue;
            }
            for ((all, q), _) in all.iter_mut().zip(&q).zip(any).filter(|(_, any)| *any) {
                for parity in parities.clone() {
                    let mut sums = [ZERO; PARTS];
                    for half in 0..CHUNK / 2 {
                        let k = 2 * half + parity;
                        for c in 0..PARTS {
                            sums[c] = scale_add(q[k], terms[k][c], sums[c]);
                        }
                    }
                    for c in 0..PARTS {
                        all[parity][c] = add(all[parity][c], sums[c]);
                    }
                }
            }
        }
        for all in &all[..pair.len()] {
            result.extend_from_slice(&all[parities.clone()]);
        }
    }
    result
}

/// Real and imaginary part of an order at the eight rings of a block, and at their mirror images, from its sums over even and over odd l − m; of an
/// even function, at the rings of two blocks, from one sum of each.
#[inline(always)]
fn halves(spectrum: &[[V; PARTS]], strip: usize, is_even: bool, channel: usize) -> [[V; 2]; 2] {
    let [even, odd] = [2 * strip, 2 * strip + 1].map(|i| [spectrum[i][channel], spectrum[i][channel + 3]]);
    if is_even {
        return [even, odd];
    }
    [[add(even[0], odd[0]), add(even[1], odd[1])], [sub(even[0], odd[0]), sub(even[1], odd[1])]]
}

/// Eight rings and eight more. What `lines` hold, a channel each and one to spare, is lost.
#[inline(always)]
fn strip(
    strip: usize,
    is_even: bool,
    spectra: &[Vec<[V; PARTS]>],
    base: [f32; 3],
    fft: &Fft,
    lines: &mut [Vec<Complex>; 4],
) -> Vec<[f32; 3]> {
    let [red, green, blue, spare] = lines;
    let columns = spare.len();
    for (channel, x) in [&mut *red, &mut *green, &mut *blue].into_iter().enumerate() {
        // (Orders beyond half of the columns come down on lower ones: values at the columns are the same.)
        let orders = spectra.len();
        let folds = 2 * orders > columns;
        if folds {
            x.fill(Complex::ZERO);
        } else {
            x[orders..=columns - orders].fill(Complex::ZERO);
        }
        for (m, spectrum) in spectra.iter().enumerate() {
            let [first, second] = halves(spectrum, strip, is_even, channel);
            // The conjugate of first + i second at m and at −m: the transform's conjugate is then the sum with e^(+imφ).
            if m == 0 {
                x[0] = Complex { re: first[0], im: scale(second[0], -1.0) };
                continue;
            }
            let plus = Complex { re: sub(first[0], second[1]), im: scale(add(first[1], second[0]), -1.0) };
            let minus = Complex { re: add(first[0], second[1]), im: sub(first[1], second[0]) };
            if folds {
                for (m, value) in [(m % columns, plus), ((columns - m % columns) % columns, minus)] {
                    x[m] = x[m].add(value);
                }
            } else {
                (x[m], x[columns - m]) = (plus, minus);
            }
        }
        fft.forward(x, spare);
    }
    let base = base.map(f64::from);
    let length = columns + 2 * MARGIN;
    let mut strip = vec![[0.0; 3]; 2 * LANES * length + 1];
    // (Some columns of all rows before the next: what a transform leaves is interleaved.)
    let mut tile = [[[0.0f32; 2 * LANES]; 3]; TILE];
    for first in (0..columns).step_by(TILE) {
        let n = TILE.min(columns - first);
        for (i, tile) in tile[..n].iter_mut().enumerate() {
            for (c, (to, from)) in tile.iter_mut().zip([&*red, green, blue]).enumerate() {
                let x = from[first + i];
                for lane in 0..LANES {
                    to[lane] = (base[c] + x.re[lane]) as f32;
                    to[LANES + lane] = (base[c] - x.im[lane]) as f32;
                }
            }
        }
        for (row, to) in strip.chunks_exact_mut(length).enumerate() {
            for (to, from) in to[MARGIN + first..].iter_mut().zip(&tile[..n]) {
                *to = [from[0][row], from[1][row], from[2][row]];
            }
        }
    }
    for row in strip.chunks_exact_mut(length) {
        row.copy_within(columns..columns + MARGIN, 0);
        row.copy_within(MARGIN..2 * MARGIN, columns + MARGIN);
    }
    strip
}
