//! Cells of a panorama, each as a few weighted points: what makes the full sum fast without making it less exact.
//!
//! Over a cell that is small beside its distance δ from a kernel's singularities, the kernel is a polynomial of low degree in θ and φ, to
//! a bound that is known beforehand. So ∫ K L over the cell is Σ K(node) W(node), with W(node) = ∫ L ℓ(θ) ℓ(φ) sin θ dθ dφ, where the ℓ
//! interpolate at [`NODES`] × [`NODES`] Chebyshev points. The W depend on the panorama alone. Cells of twice the size follow from
//! those they are made of with nothing lost: the polynomials of the large are polynomials of the small.
//!
//! **Error.** Interpolation at n Chebyshev points of a function that is analytic inside the Bernstein ellipse ρ is off by less than
//! 4 M ρ⁻ⁿ⁺¹/(ρ − 1), M its largest value there (Trefethen, "Approximation Theory and Approximation Practice", theorem 8.2). A singularity
//! at least δ from every point of a side of length h leaves ρ ≥ x + √(1 + x²), x = 2δ/h: [`RATIO`] makes that more than 16.
//! A cell that the horizon may cross is never taken whole.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::kernel::{Kernel, Profile, with_profile};
use super::panorama::Panorama;
use super::zonal::InstructionSet;
use crate::math::quadrature::{Rule, gauss_legendre};

/// Points along a side of a cell: as many as there are lanes.
const NODES: usize = 8;
/// Sides of a cell in parts of its distance from the kernel's singularities, at most: ρ ≥ 16. GGX's double
/// pole, (width² + θ²)⁻², is then off by 5e-8 of its value at most in each direction, wherever it stands.
const RATIO: f64 = 0.25;
/// Narrower panoramas are not worth it.
const LEAST_WIDTH: usize = 96;

/// A panorama in cells, the smallest first.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    levels: Vec<Level>,
}

/// Cells of one size.
#[derive(Debug, Clone)]
struct Level {
    /// Texels along a side; the last cells of a row or a column may have fewer.
    side: usize,
    bands: Vec<Band>,
    /// cos φ and sin φ of the middle of each column of cells.
    middles: Vec<(f64, f64)>,
    /// The same of all nodes along a row of cells.
    nodes: Vec<(f64, f64)>,
    /// The widest column of cells.
    dphi: f64,
    /// Azimuths of the sides of the columns.
    edges: Vec<f64>,
}

/// A row of cells.
#[derive(Debug, Clone)]
struct Band {
    /// Whether there is anything in it.
    occupied: bool,
    theta: [f64; 2],
    /// cos θ and sin θ of the middle.
    middle: (f64, f64),
    /// The same of the rows of nodes.
    rows: [(f64, f64); NODES],
    /// The largest sin θ.
    widest: f64,
    /// W of each cell.
    weights: Vec<Weights>,
}

/// For each row of nodes and each channel of a cell, W of the nodes: all of a cell in one place, because a sum takes few cells of a band.
type Weights = [[[f64; NODES]; 3]; NODES];

/// Columns of texels in a row of the smallest cells, that are too near or cross the horizon.
pub(super) struct Left {
    pub rows: Range<usize>,
    pub columns: Range<usize>,
}

/// A lobe, as far as cells see it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<'a> {
    pub kernel: &'a Kernel,
    pub axis: DVec3,
    /// sin θ of the axis.
    pub horizontal: f64,
}

/// Where cells are made; they are the same either way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Threads {
    One,
    All,
}

impl Threads {
    /// `f` of 0 … n − 1.
    pub(super) fn map<T: Send>(self, n: usize, f: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        match self {
            Self::One => (0..n).map(f).collect(),
            Self::All => (0..n).into_par_iter().map(f).collect(),
        }
    }
}

/// Places in [0, 1] of the Chebyshev points.
fn chebyshev() -> [f64; NODES] {
    std::array::from_fn(|i| 0.5 - 0.5 * libm::cos(PI * (i as f64 + 0.5) / NODES as f64))
}

/// The polynomials that interpolate at the Chebyshev points of [0, 1], at t.
fn lagrange(points: &[f64; NODES], t: f64) -> [f64; NODES] {
    std::array::from_fn(|i| {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        others.fold(1.0, |product, (_, p)| product * (t - p) / (points[i] - p))
    })
}

/// ∫ of each polynomial times `weight` over each of the `n` equal parts of [0, 1].
fn moments(points: &[f64; NODES], n: usize, rule: &Rule, weight: impl Fn(f64) -> f64) -> Vec<[f64; NODES]> {
    let part = |k: usize| {
        let mut sums = [0.0; NODES];
        for (t, w) in rule.iter() {
            let t = (k as f64 + t) / n as f64;
            let values = lagrange(points, t);
            (0..NODES).for_each(|i| sums[i] += w / n as f64 * weight(t) * values[i]);
        }
        sums
    };
    (0..n).map(part).collect()
}

impl Cells {
    /// The cells of what a panorama holds beyond `base`; `None` if it is too small for any.
    pub fn new(panorama: &Panorama, base: [f64; 3], instructions: InstructionSet, on: Threads) -> Option<Self> {
        let (width, height) = (panorama.width(), panorama.height());
        // Weights are 192 bytes a texel over side²: never more than the panorama itself for large ones.
        let side = match width.max(2 * height) {
            ..=2048 => 8,
            2049..=8192 => 16,
            _ => 32,
        };
        if width < LEAST_WIDTH || height < 2 * side {
            return None;
        }
        let mut levels = vec![Level::of_texels(panorama, base, side, instructions, on)];
        while let Some(last) = levels.last()
            && 2.0 * last.dphi <= RATIO
            && last.bands.len() > 1
            && 2.0 * (last.bands[0].theta[1] - last.bands[0].theta[0]) <= RATIO
        {
            let next = last.doubled(instructions, on);
            levels.push(next);
        }
        Some(Self { levels })
    }

    /// Σ K W over all cells that are far enough and above the horizon, and the texels of those that are not.
    pub fn evaluate(&self, seen: &Seen, instructions: InstructionSet) -> ([f64; 3], Vec<Left>) {
        let top = self.levels.len() - 1;
        let along: Vec<[Vec<f64>; 2]> =
            self.levels.iter().map(|level| [&level.middles, &level.nodes].map(|t| seen.along(t))).collect();
        let mut walk = Walk { cells: self, seen: *seen, along, sums: [[0.0; NODES]; 3], left: vec![] };
        instructions.run(
            #[inline(always)]
            || {
                for band in 0..self.levels[top].bands.len() {
                    walk.run(top, band, 0..self.levels[top].middles.len());
                }
            },
        );
        (walk.sums.map(|lanes| lanes.iter().sum()), walk.left)
    }
}

impl Seen<'_> {
    /// axis · (cos φ, sin φ).
    fn along(&self, directions: &[(f64, f64)]) -> Vec<f64> {
        directions.iter().map(|(cos, sin)| self.axis.x * cos + self.axis.z * sin).collect()
    }
}

/// A sum under way.
struct Walk<'a> {
    cells: &'a Cells,
    seen: Seen<'a>,
    /// For each level, along the middles and along the nodes.
    along: Vec<[Vec<f64>; 2]>,
    sums: [[f64; NODES]; 3],
    left: Vec<Left>,
}

/// What becomes of a cell.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Below,
    Whole,
    Parts,
}

impl Walk<'_> {
    /// Some neighbouring cells of a band, and what they are made of.
    #[inline(always)]
    fn run(&mut self, top: usize, band: usize, columns: Range<usize>) {
        // No recursion, so that everything is inlined where instructions are chosen; order is by level, band, column.
        let mut pending = vec![(top, band, columns)];
        while let Some((at, band_index, columns)) = pending.pop() {
            let level = &self.cells.levels[at];
            let band = &level.bands[band_index];
            if !band.occupied {
                continue;
            }
            let judge = Judge::new(&self.seen, level, band);
            let mut start = columns.start;
            while start < columns.end {
                let fate = judge.fate(self.along[at][0][start]);
                let mut end = start + 1;
                while end < columns.end && judge.fate(self.along[at][0][end]) == fate {
                    end += 1;
                }
                match (fate, at) {
                    (Fate::Below, _) => {}
                    (Fate::Whole, _) => self.add(at, band, start..end),
                    (Fate::Parts, 0) => self.left.push(Left {
                        rows: band_index * level.side..(band_index + 1) * level.side,
                        columns: start * level.side..end * level.side,
                    }),
                    (Fate::Parts, _) => {
                        let below = &self.cells.levels[at - 1];
                        let columns = 2 * start..(2 * end).min(below.middles.len());
                        for part in 2 * band_index..(2 * band_index + 2).min(below.bands.len()) {
                            pending.push((at - 1, part, columns.clone()));
                        }
                    }
                }
                start = end;
            }
        }
    }

    /// Adds whole cells.
    #[inline(always)]
    fn add(&mut self, at: usize, band: &Band, columns: Range<usize>) {
        let along = &self.along[at][1].as_chunks::<NODES>().0[columns.clone()];
        let (seen, sums) = (&self.seen, &mut self.sums);
        with_profile!(seen.kernel, P => add_cells::<P>(seen, &band.rows, &band.weights[columns], along, sums));
    }
}

/// Adds K W of some cells, given their rows of nodes.
#[inline(always)]
fn add_cells<P: Profile>(
    seen: &Seen,
    rows: &[(f64, f64); NODES],
    weights: &[Weights],
    along: &[[f64; NODES]],
    sums: &mut [[f64; NODES]; 3],
) {
    let kernel = *seen.kernel;
    for (weights, along) in weights.iter().zip(along) {
        for ((cos, sin), [red, green, blue]) in rows.iter().zip(weights) {
            let up = seen.axis.y * cos;
            let mut values = [0.0; NODES];
            for i in 0..NODES {
                values[i] = P::at(&kernel, up + sin * along[i]);
            }
            for (sums, weights) in sums.iter_mut().zip([red, green, blue]) {
                for i in 0..NODES {
                    sums[i] += values[i] * weights[i];
                }
            }
        }
    }
}

/// Judges the cells of a band by the cosine to their middles.
struct Judge {
    up: f64,
    sin: f64,
    /// No point of a cell is further from its middle.
    reach: f64,
    /// Cosines above this are too near to the axis.
    near: f64,
    /// And those below this to the horizon.
    belt: f64,
}

impl Judge {
    #[inline(always)]
    fn new(seen: &Seen, level: &Level, band: &Band) -> Self {
        let dtheta = band.theta[1] - band.theta[0];
        // |l − m|² = 4 sin²(Δθ/2) + 4 sin θ₁ sin θ₂ sin²(Δφ/2).
        let reach = 0.5 * dtheta.hypot(band.widest * level.dphi) * (1.0 + 1e-9);
        // In φ a singularity is away by τ with 4 sin θ sin θ_axis sinh²(τ/2) = δ².
        let breadth = level.dphi * (band.widest * band.widest.max(seen.horizontal)).sqrt();
        let [near, belt] = seen.kernel.rough_parts(dtheta.max(breadth) / RATIO, reach);
        Self { up: seen.axis.y * band.middle.0, sin: band.middle.1, reach, near, belt: belt.max(reach) }
    }

    #[inline(always)]
    fn fate(&self, along: f64) -> Fate {
        let c = self.up + self.sin * along;
        if c < -self.reach {
            Fate::Below
        } else if c > self.belt && c <= self.near {
            Fate::Whole
        } else {
            Fate::Parts
        }
    }
}

impl Level {
    fn of_texels(panorama: &Panorama, base: [f64; 3], side: usize, instructions: InstructionSet, on: Threads) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        let points = chebyshev();
        let (few, many) = (gauss_legendre(NODES / 2), gauss_legendre(NODES));
        let (whole, last) = (width / side, width % side);
        let dphi = TAU / width as f64;
        let azimuth = |texels: usize| {
            let mut moments = moments(&points, texels, &few, |_| 1.0);
            moments.iter_mut().flatten().for_each(|m| *m *= dphi * texels as f64);
            moments
        };
        let (across, across_last) = (azimuth(side), azimuth(last));
        let band = |first: usize| {
            let rows = first..(first + side).min(height);
            let theta = [rows.start, rows.end].map(|row| PI * row as f64 / height as f64);
            let dtheta = theta[1] - theta[0];
            let down = moments(&points, rows.len(), &many, |t| dtheta * libm::sin(theta[0] + t * dtheta));
            let n = whole + usize::from(last > 0);
            let mut band = Band::new(theta, &points);
            band.occupied = rows.clone().any(|row| panorama.row(row).iter().any(|t| t.map(f64::from) != base));
            if !band.occupied {
                return band;
            }
            band.weights = vec![Weights::default(); n];
            instructions.run(
                #[inline(always)]
                || {
                    for (row, down) in rows.clone().zip(&down) {
                        let cells = panorama.row(row).chunks(side).zip(&mut band.weights);
                        for (k, (texels, weights)) in cells.enumerate() {
                            let across = if k < whole { &across } else { &across_last };
                            let mut sums = [[0.0; NODES]; 3];
                            for (texel, across) in texels.iter().zip(across) {
                                for c in 0..3 {
                                    let value = f64::from(texel[c]) - base[c];
                                    for j in 0..NODES {
                                        sums[c][j] += across[j] * value;
                                    }
                                }
                            }
                            for (weights, down) in weights.iter_mut().zip(down) {
                                for (weight, sum) in weights.as_flattened_mut().iter_mut().zip(sums.as_flattened()) {
                                    *weight += down * sum;
                                }
                            }
                        }
                    }
                },
            );
            band
        };
        let bands = on.map(height.div_ceil(side), |b| band(b * side));
        let edges = (0..=width.div_ceil(side)).map(|k| (k * side).min(width) as f64 * dphi - PI).collect();
        Self::new(side, bands, edges)
    }

    fn new(side: usize, bands: Vec<Band>, edges: Vec<f64>) -> Self {
        let points = chebyshev();
        let direction = |phi: f64| (libm::cos(phi), libm::sin(phi));
        let middles = edges.windows(2).map(|e| direction(0.5 * (e[0] + e[1]))).collect();
        let nodes = edges.windows(2).flat_map(|e| points.map(|t| direction(e[0] + t * (e[1] - e[0])))).collect();
        let dphi = edges.windows(2).map(|e| e[1] - e[0]).fold(0.0, f64::max);
        Self { side, bands, middles, nodes, dphi, edges }
    }

    /// Cells of twice the size.
    fn doubled(&self, instructions: InstructionSet, on: Threads) -> Self {
        let points = chebyshev();
        let n = self.middles.len();
        let edges: Vec<f64> =
            self.edges.iter().copied().step_by(2).chain((n % 2 == 1).then(|| self.edges[n])).collect();
        // ℓ of a large cell at the nodes of the small ones in it.
        let values = |whole: [f64; 2], part: [f64; 2]| {
            points.map(|t| lagrange(&points, (part[0] + t * (part[1] - part[0]) - whole[0]) / (whole[1] - whole[0])))
        };
        let across: Vec<[[f64; NODES]; NODES]> =
            (0..n).map(|k| values([edges[k / 2], edges[k / 2 + 1]], [self.edges[k], self.edges[k + 1]])).collect();
        let join_bands = |parts: &[Band]| {
            let theta = [parts[0].theta[0], parts[parts.len() - 1].theta[1]];
            let mut band = Band::new(theta, &points);
            band.occupied = parts.iter().any(|part| part.occupied);
            if !band.occupied {
                return band;
            }
            band.weights = vec![Weights::default(); edges.len() - 1];
            let downs: Vec<_> = parts.iter().map(|part| values(theta, part.theta)).collect();
            instructions.run(
                #[inline(always)]
                || {
                    for (part, down) in parts.iter().zip(&downs).filter(|(part, _)| part.occupied) {
                        let pairs = part.weights.chunks(2).zip(across.chunks(2));
                        for ((cells, across), to) in pairs.zip(&mut band.weights) {
                            join(cells, across, down, to);
                        }
                    }
                },
            );
            band
        };
        let bands =
            on.map(self.bands.len().div_ceil(2), |b| join_bands(&self.bands[2 * b..(2 * b + 2).min(self.bands.len())]));
        Self::new(2 * self.side, bands, edges)
    }
}

/// Adds to a large cell what it has of a pair beside each other, given its polynomials at their nodes, across and down.
#[inline(always)]
fn join(pair: &[Weights], across: &[[[f64; NODES]; NODES]], down: &[[f64; NODES]; NODES], to: &mut Weights) {
    for (row, down) in down.iter().enumerate() {
        let mut sums = [[0.0; NODES]; 3];
        for (weights, across) in pair.iter().zip(across) {
            for (sums, weights) in sums.iter_mut().zip(&weights[row]) {
                for (weight, across) in weights.iter().zip(across) {
                    for j in 0..NODES {
                        sums[j] += weight * across[j];
                    }
                }
            }
        }
        for (to, down) in to.iter_mut().zip(down) {
            for (to, sum) in to.as_flattened_mut().iter_mut().zip(sums.as_flattened()) {
                *to += down * sum;
            }
        }
    }
}

impl Band {
    fn new(theta: [f64; 2], points: &[f64; NODES]) -> Self {
        let direction = |theta: f64| (libm::cos(theta), libm::sin(theta));
        let widest =
            if theta[0] <= PI / 2.0 && theta[1] >= PI / 2.0 { 1.0 } else { theta[0].sin().max(theta[1].sin()) };
        Self {
            occupied: true,
            theta,
            middle: direction(0.5 * (theta[0] + theta[1])),
            rows: points.map(|t| direction(theta[0] + t * (theta[1] - theta[0]))),
            widest,
            weights: Default::default(),
        }
    }
}
