//! From texels to coefficients: f_lm = ∫ f Y*_lm of a piecewise constant map.
//!
//! In φ each texel is integrated exactly: the row's Fourier sum (periodic in m, so m may go on past half the width) times
//! (2/m) sin(mΔ/2) e^(−imΔ/2). In θ each row is integrated by Gauss points in θ, their weights sin θ normalised to the row's exact
//! solid angle. Northern and southern rows share their P̄_l^m but for the sign (−1)^(l−m): one transform of
//! (north + south) + i (north − south) gives both.

use std::borrow::Cow;
use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use super::fft::{Complex, Fft, separate};
use super::lanes::{InstructionSet, LANES, V, ZERO, mul_add, total};
use super::legendre::{CHUNK, Degrees, Order, Places, Walk, add_chunk, negligible, sectoral_norms};
use super::nodes::{Nodes, Scratch};
use crate::math::quadrature::Rule;

/// Real and imaginary parts of three channels: re r, g, b, im r, g, b.
pub(super) const PARTS: usize = 6;

/// f_lm for 0 ≤ m ≤ l ≤ degree of a real map of three channels.
#[derive(Debug, Clone)]
pub(super) struct Coefficients {
    pub degree: usize,
    /// For each m, for l = m, m + 1, …: the real parts of the channels, then the imaginary ones.
    pub orders: Vec<Vec<[f64; PARTS]>>,
}

impl Coefficients {
    /// Σ |f_lm|² of each degree and channel.
    pub fn powers(&self) -> Vec<[f64; 3]> {
        let mut powers = vec![[0.0; 3]; self.degree + 1];
        for (m, order) in self.orders.iter().enumerate() {
            let both = if m == 0 { 1.0 } else { 2.0 };
            for (power, v) in powers[m..].iter_mut().zip(order) {
                (0..3).for_each(|c| power[c] += both * (v[c] * v[c] + v[c + 3] * v[c + 3]));
            }
        }
        powers
    }
}

/// A map to be analysed.
pub(super) trait Texels: Sync {
    /// Texels of a row, and rows.
    fn shape(&self) -> [usize; 2];
    /// Whether anything in a row is left when the base is taken off.
    fn occupied(&self, row: usize) -> bool;
    /// A row as it is, before the base is taken off.
    fn row(&self, row: usize) -> Cow<'_, [[f32; 3]]>;
    /// What is taken off every texel.
    fn base(&self) -> [f64; 3];
}

/// How rows are integrated over θ.
#[derive(Debug)]
pub(super) enum Rows {
    /// Each by itself.
    Points(Rule),
    /// Each by the middles of equal parts of it (a rule of equal weights). What the mean over a part's height h takes away from P̄_l^m is put back nearly: there it
    /// oscillates at k² = l(l + 1) − m²/sin²θ, and the mean is less by sinc(kh/2) ≈ e^(−h²k²/24), 4 % off at h = π/l.
    Middles(Rule),
    /// At fewer angles than there are rows.
    Nodes(Nodes),
}

/// Eight rows (or nodes) of the north with their mirror images.
struct Block {
    largest_sin: f64,
    /// Gauss points with their weights.
    points: Vec<Point>,
    /// For each m: north + south, then north − south, or of both what is meant.
    spectrum: Vec<[V; PARTS]>,
}

/// Eight places of rows, one of each.
struct Point {
    places: Places,
    weights: V,
    /// h²/24 sin²θ, where the mean over a height of h is still to be taken; else nothing.
    flattened: V,
}

impl Point {
    /// What the recurrence of order m starts with. No exponent counts beyond `most`: where m > l sin θ there is nothing to take.
    #[inline(always)]
    fn start(&self, m: usize, norm: f64, most: f64) -> Walk {
        let m2 = (m * m) as f64;
        let mut factor = self.weights;
        for (factor, flattened) in factor.iter_mut().zip(self.flattened) {
            let x = if flattened * m2 < most { flattened * m2 } else { most };
            // eˣ to 1e-3, as x < 0.42.
            *factor *= norm * (1.0 + x * (1.0 + x * (0.5 + x * (1.0 / 6.0))));
        }
        self.places.start(m, factor)
    }
}

/// The coefficients up to a degree; of those that are not meant, zeros.
pub(super) fn analyse(
    map: &dyn Texels,
    degree: usize,
    degrees: Degrees,
    rows: &Rows,
    instructions: InstructionSet,
) -> Coefficients {
    let [width, height] = map.shape();
    // What nodes gathered, they have integrated over φ too.
    let gathered = match rows {
        Rows::Nodes(nodes) => nodes.n_columns(),
        Rows::Points(_) | Rows::Middles(_) => None,
    };
    let columns = gathered.unwrap_or(width);
    let fft = Fft::new(columns);
    let factors = match gathered {
        Some(_) => vec![(TAU / width as f64, 0.0); degree + 1],
        None => column_factors(width, degree),
    };
    let pairs = height.div_ceil(2);
    // h²/24 of the parts whose middles stand for them.
    let middles = match rows {
        Rows::Middles(rule) => (PI / (height * rule.nodes.len()) as f64).powi(2) / 24.0,
        _ => 0.0,
    };
    let block = |lines: &mut Lines, index: usize| -> Option<Block> {
        let (points, largest_sin) = match rows {
            Rows::Points(rule) | Rows::Middles(rule) => {
                let of_block = index * LANES..((index + 1) * LANES).min(pairs);
                if !of_block.clone().any(|row| map.occupied(row) || map.occupied(height - 1 - row)) {
                    return None;
                }
                lines.read(map, of_block.clone());
                points(of_block.start, height, rule, degree, middles)
            }
            Rows::Nodes(nodes) => {
                if !nodes.occupied(map, index) {
                    return None;
                }
                instructions.run(
                    #[inline(always)]
                    || nodes.gather(map, index, &mut lines.scratch, &mut lines.channels),
                );
                let [cos, sin] = nodes.angles(index);
                let point = Point { places: Places::new(cos, sin, degree), weights: [1.0; LANES], flattened: ZERO };
                (vec![point], sin.into_iter().fold(0.0, f64::max))
            }
        };
        let spectrum = instructions.run(
            #[inline(always)]
            || spectrum(&fft, &factors, degrees, lines),
        );
        Some(Block { largest_sin, points, spectrum })
    };
    let n_blocks = match rows {
        Rows::Points(_) | Rows::Middles(_) => pairs.div_ceil(LANES),
        Rows::Nodes(nodes) => nodes.n_blocks(),
    };
    let blocks: Vec<Block> = (0..n_blocks).into_par_iter().map_init(|| Lines::new(columns), block).flatten().collect();
    let norms = sectoral_norms(degree);
    let orders = (0..degree + 1)
        .into_par_iter()
        .with_max_len(1)
        .map(|m| {
            let blocks: Vec<&Block> = blocks.iter().filter(|b| !negligible(degree, m, b.largest_sin)).collect();
            instructions.run(
                #[inline(always)]
                || match degrees {
                    Degrees::All => analyse_order::<1, 2>(m, (degree, degrees), [norms[m], middles], &blocks),
                    Degrees::EvenAbove(_) => analyse_order::<2, 1>(m, (degree, degrees), [norms[m], middles], &blocks),
                },
            )
        })
        .collect();
    Coefficients { degree, orders }
}

/// ∫ e^(−imφ) over the first column: what turns a Fourier sum over texels into an integral. φ counts from the map's left edge.
fn column_factors(width: usize, degree: usize) -> Vec<(f64, f64)> {
    let step = TAU / width as f64;
    (0..=degree)
        .map(|m| {
            // The angle mΔ/2 = π m/width, reduced exactly.
            let (sin, cos) = libm::sincos(PI * (m % (2 * width)) as f64 / width as f64);
            let length = if m == 0 { step } else { 2.0 * sin / m as f64 };
            (length * cos, -length * sin)
        })
        .collect()
}

/// Points of eight rows from `first` on; rows past the equator have weight zero, the equator's own row half its weight
/// (it is its own mirror image).
fn points(first: usize, height: usize, rule: &Rule, orders: usize, middles: f64) -> (Vec<Point>, f64) {
    let points = rule.nodes.len();
    let n = height as f64;
    let (mut cos, mut sin, mut weights) = (vec![ZERO; points], vec![[1.0; LANES]; points], vec![ZERO; points]);
    let mut largest_sin = 0.0f64;
    for lane in 0..LANES {
        let row = first + lane;
        if row >= height.div_ceil(2) {
            continue;
        }
        let extent = 2.0 * libm::sin(PI * (row as f64 + 0.5) / n) * libm::sin(PI / (2.0 * n));
        let share = if 2 * row + 1 == height { 0.5 * extent } else { extent };
        let mut sum = 0.0;
        for (k, (t, weight)) in rule.iter().enumerate() {
            // cos θ = sin(π/2 − θ): exact at the equator.
            let theta = PI * (row as f64 + t) / n;
            sin[k][lane] = libm::sin(theta);
            cos[k][lane] = libm::sin(PI * (0.5 * n - row as f64 - t) / n);
            weights[k][lane] = weight * sin[k][lane];
            sum += weights[k][lane];
            largest_sin = largest_sin.max(sin[k][lane]);
        }
        weights.iter_mut().for_each(|w| w[lane] *= share / sum);
    }
    let point = |k: usize| Point {
        places: Places::new(cos[k], sin[k], orders),
        weights: weights[k],
        flattened: sin[k].map(|sin| middles / (sin * sin)),
    };
    ((0..points).map(point).collect(), largest_sin)
}

/// Sums and differences of eight rows and their mirror images, in three channels, and room for a transform and for gathering.
struct Lines {
    channels: [Vec<Complex>; 3],
    spare: Vec<Complex>,
    scratch: Scratch,
}

impl Lines {
    fn new(width: usize) -> Self {
        Self {
            channels: [(); 3].map(|()| vec![Complex::ZERO; width]),
            spare: vec![Complex::ZERO; width],
            scratch: Scratch::new(),
        }
    }

    /// Up to eight rows with their mirror images: north + south, and north − south.
    fn read(&mut self, map: &dyn Texels, rows: std::ops::Range<usize>) {
        let (height, base) = (map.shape()[1], map.base());
        for lane in 0..LANES {
            let row = rows.start + lane;
            if row >= rows.end {
                self.channels.iter_mut().flatten().for_each(|x| (x.re[lane], x.im[lane]) = (0.0, 0.0));
                continue;
            }
            let [red, green, blue] = &mut self.channels;
            let (north, south) = (map.row(row), map.row(height - 1 - row));
            for (((r, g), b), (north, south)) in red.iter_mut().zip(green).zip(blue).zip(north.iter().zip(&*south)) {
                for (c, to) in [r, g, b].into_iter().enumerate() {
                    let (north, south) = (f64::from(north[c]) - base[c], f64::from(south[c]) - base[c]);
                    (to.re[lane], to.im[lane]) = (north + south, north - south);
                }
            }
        }
    }
}

#[inline(always)]
fn spectrum(
    fft: &Fft,
    factors: &[(f64, f64)],
    degrees: Degrees,
    Lines { channels, spare, .. }: &mut Lines,
) -> Vec<[V; PARTS]> {
    let width = spare.len();
    let parities = degrees.parities(0).len();
    let mut spectrum = vec![[ZERO; PARTS]; parities * factors.len()];
    for (channel, x) in channels.iter_mut().enumerate() {
        fft.forward(x, spare);
        for ((m, out), &factor) in spectrum.chunks_exact_mut(parities).enumerate().zip(factors) {
            let both = separate(x[m % width], x[(width - m % width) % width]);
            for (out, parity) in out.iter_mut().zip(degrees.parities(m)) {
                let value = both[parity].times(factor);
                (out[channel], out[channel + 3]) = (value.re, value.im);
            }
        }
    }
    spectrum
}

/// Blocks that are accumulated together.
const GROUP: usize = 4;

/// The coefficients of one order, of every `STEP`th degree, whose l − m have so many parities.
#[inline(always)]
fn analyse_order<const STEP: usize, const PARITIES: usize>(
    m: usize,
    (degree, degrees): (usize, Degrees),
    [norm, middles]: [f64; 2],
    blocks: &[&Block],
) -> Vec<[f64; PARTS]> {
    let order = Order::new(m, degree);
    let most = middles * squared(degree);
    let mut walks: Vec<Vec<Walk>> =
        blocks.iter().map(|b| b.points.iter().map(|point| point.start(m, norm, most)).collect()).collect();
    let mut result = Vec::with_capacity(order.a.len());
    let (mut q, mut chunk, mut spare) = ([[ZERO; CHUNK]; GROUP], [ZERO; CHUNK], [ZERO; CHUNK]);
    let first = degrees.parities(m).start;
    for (a, s) in order.a.as_chunks::<CHUNK>().0.iter().zip(order.s.as_chunks::<CHUNK>().0) {
        let mut sums = [[ZERO; PARTS]; CHUNK];
        let is_meant = degrees.any_from(m + result.len());
        for (blocks, walks) in blocks.chunks(GROUP).zip(walks.chunks_mut(GROUP)) {
            let mut spectra: [&[[V; PARTS]; PARITIES]; GROUP] = [&[[ZERO; PARTS]; PARITIES]; GROUP];
            let mut n = 0;
            for (block, walks) in blocks.iter().zip(walks) {
                let mut any = false;
                for (points, walks) in block.points.chunks(2).zip(walks.chunks_mut(2)) {
                    let to = if any { &mut chunk } else { &mut q[n] };
                    let got = match walks {
                        [one, other] => {
                            let cos = [&points[0].places.cos, &points[1].places.cos];
                            Walk::advance_sum([one, other], cos, a, to, &mut spare)
                        }
                        walks => walks[0].advance(points[0].places.cos, a, to),
                    };
                    if any && got {
                        add_chunk(&mut q[n], &chunk);
                    }
                    any |= got;
                }
                if any {
                    spectra[n] = &block.spectrum.as_chunks().0[m];
                    n += 1;
                }
            }
            if !is_meant {
                continue;
            }
            for k in 0..CHUNK / STEP {
                let k = STEP * k + first;
                let mut sum = sums[k];
                for (q, spectrum) in q[..n].iter().zip(&spectra[..n]) {
                    let spectrum = &spectrum[k % PARITIES];
                    for c in 0..PARTS {
                        sum[c] = mul_add(q[k], spectrum[c], sum[c]);
                    }
                }
                sums[k] = sum;
            }
        }
        result.extend(sums.iter().zip(s).map(|(sum, s)| sum.map(|v| total(v) * s)));
    }
    result.truncate(degree + 1 - m);
    for (value, l) in result.iter_mut().zip(m..) {
        if !degrees.contains(l) {
            *value = [0.0; PARTS];
        } else if middles > 0.0 {
            *value = value.map(|v| v * libm::exp(-middles * squared(l)));
        }
    }
    result
}

/// l(l + 1).
fn squared(l: usize) -> f64 {
    (l * (l + 1)) as f64
}
