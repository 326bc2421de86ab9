//! The truth: the integral over every texel of the panorama, in f64.
//!
//! Each texel's box is integrated by a product of Gauss–Legendre rules in φ and θ (θ rather than y = cos θ, because the
//! direction is a smooth function of θ at the poles). How many points: the kernel has its complex
//! singularities at an angular distance δ from a box (GGX: √(4α²/(1−α²) + distance²); its cosine, like
//! sin θ, varies over one radian, so that δ counts as 1 at most; other kernels have other δ), and n points on a box of extent h leave an
//! error of about (h/4δ)^2n; a box too close for the largest rule is cut in two or four, or integrated along its boundary (`ring`). Where the lobe's horizon crosses a box, each line of
//! constant θ is cut exactly where c = 0. What is far from all that is summed by cells of many texels (`cells`), to fewer than 1e-7.

mod ring;

use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use rayon::prelude::*;

use super::cells::{Cells, Left, Seen, Threads};
use super::cube::{Cube, texel_direction};
use super::kernel::{Kernel, Profile, with_profile};
use super::panorama::Panorama;
use super::zonal::InstructionSet;
use crate::math::quadrature::{Rule, gauss_legendre};

/// A rule of points per side may be used where extent/δ is at most this; then (h/4δ)^2n is below 1e-7.
const RULES: [(usize, f64); 4] = [(2, 0.06), (3, 0.25), (4, 0.5), (6, 1.0)];

/// How many of them may be taken for nearly all texels.
const BULK_RULES: usize = 3;

/// Points of the rule for slabs of large boxes, and of that for panels of their sides.
const BENT: usize = 10;
const OF_SIDES: usize = 10;

/// Extents below which a box is flat enough, in radians: the sphere bends by 2e-4 of it.
const FLAT: f64 = 0.02;

/// What a texel holds of all light for its part across the horizon to have to be exact.
const BRIGHT: f64 = 1e-4;

/// Rows next to a pole over which sin θ changes a lot.
const POLAR: usize = 3;

/// Largest panorama, in texels, whose channels are also kept apart, for speed.
const LARGEST_APART: usize = 1 << 21;

/// A panorama made ready for exact sums. Clones share what is prepared.
#[derive(Debug, Clone)]
pub struct FullSum<'a> {
    panorama: &'a Panorama,
    base: [f64; 3],
    rules: Vec<Rule>,
    /// For slabs of large boxes, as [`bent`] makes it.
    bent: Rule,
    /// For panels of the sides of boxes.
    sides: Rule,
    /// Whether far cells may be taken whole.
    by_cells: bool,
    whole: Arc<OnceLock<Whole>>,
    instructions: InstructionSet,
}

/// What sums over the whole panorama need, and single texels do not.
#[derive(Debug)]
struct Whole {
    /// Towards the middle of the brightest texel.
    sun: DVec3,
    /// cos φ and sin φ of the points of the three smallest rules, one of which nearly every texel takes: its first in every column, then
    /// its second, and so on.
    azimuths: [Vec<(f64, f64)>; BULK_RULES],
    rows: Vec<Parallel>,
    /// The channels one by one, of a panorama that is not too large.
    apart: Option<[Vec<f32>; 3]>,
    /// What is far from the lobe's axis and from its horizon is summed by these.
    cells: Option<Cells>,
}

/// A row of texels.
#[derive(Debug)]
struct Parallel {
    /// Whether it holds anything beyond the base.
    occupied: bool,
    theta: [f64; 2],
    /// sin θ and cos θ of the middle.
    middle: (f64, f64),
    /// The same of the points of the three smallest rules.
    points: [Vec<(f64, f64)>; BULK_RULES],
    /// sin θ of its widest parallel.
    widest: f64,
    /// Whether it is one of the few next to a pole.
    is_polar: bool,
    /// Of a texel.
    solid_angle: f64,
    /// The columns of texels whose part across the horizon must be exact: they hold [`BRIGHT`] of all that the panorama does beyond the base, or less near
    /// the poles.
    bright: Vec<u32>,
}

/// A box in φ and θ.
#[derive(Debug, Clone, Copy)]
struct Patch {
    phi: [f64; 2],
    theta: [f64; 2],
}

/// A lobe about an axis, the axis in spherical parts.
pub(super) struct Lobe<'a> {
    kernel: &'a Kernel,
    axis: DVec3,
    azimuth: f64,
    horizontal: f64,
}

impl<'a> FullSum<'a> {
    /// Prepares a panorama. The smallest radiance of each channel is taken off first and added to every result: a
    /// constant panorama is then exact, and no result is below the smallest radiance.
    pub fn new(panorama: &'a Panorama) -> Self {
        Self {
            panorama,
            base: panorama.min().map(f64::from),
            rules: RULES.iter().map(|&(n, _)| gauss_legendre(n)).collect(),
            bent: bent(BENT),
            sides: gauss_legendre(OF_SIDES),
            by_cells: true,
            whole: Arc::default(),
            instructions: InstructionSet::detect(),
        }
    }

    /// The same texel by texel, none of them taken for flat, with `extra` more points per side of each box: how a test or a cautious user sees the error.
    pub fn with_extra_points(panorama: &'a Panorama, extra: usize) -> Self {
        let rules = RULES.iter().map(|&(n, _)| gauss_legendre(n + extra)).collect();
        let sides = gauss_legendre(OF_SIDES + extra);
        Self { rules, bent: bent(BENT + extra), sides, by_cells: false, ..Self::new(panorama) }
    }

    /// Prepares sums over the whole panorama on all threads. The first of them would do so on its own.
    pub fn prepare(&self) {
        if self.whole.get().is_none() {
            // Not inside the cell: its initialisation may not wait for other threads' work, which may be to wait for it.
            let _ = self.whole.set(self.make_whole(Threads::All));
        }
    }

    /// Towards the middle of the brightest texel.
    pub(crate) fn sun(&self) -> DVec3 {
        self.prepare();
        self.whole.get_or_init(|| self.make_whole(Threads::One)).sun
    }

    fn make_whole(&self, on: Threads) -> Whole {
        let panorama = self.panorama;
        let of_rule = |rule: &Rule| -> Vec<(f64, f64)> {
            let columns = |t: f64| (0..panorama.width()).map(move |column| column as f64 + t);
            let positions = rule.nodes.iter().flat_map(|&t| columns(t));
            positions.map(|at| TAU * at / panorama.width() as f64 - PI).map(|phi| (phi.cos(), phi.sin())).collect()
        };
        let azimuths = std::array::from_fn(|i| of_rule(&self.rules[i]));
        let (column, row, _) = panorama.peak();
        Whole {
            sun: panorama.texel_box(column, row).middle(),
            azimuths,
            rows: on.map(panorama.height(), |row| self.parallel(row)),
            apart: (panorama.texels().len() <= LARGEST_APART)
                .then(|| std::array::from_fn(|c| panorama.texels().iter().map(|t| t[c]).collect())),
            cells: self.by_cells.then(|| Cells::new(panorama, self.base, self.instructions, on)).flatten(),
        }
    }

    fn parallel(&self, row: usize) -> Parallel {
        let (panorama, height) = (self.panorama, self.panorama.height() as f64);
        let theta = [PI * row as f64 / height, PI * (row + 1) as f64 / height];
        let (dtheta, middle) = (theta[1] - theta[0], (theta[0] + theta[1]) / 2.0);
        let solid_angle = panorama.solid_angle(row);
        let (mean, all) = (panorama.mean(), 4.0 * PI / solid_angle);
        // (Towards the poles boxes are less and less like rectangles.)
        let share = BRIGHT / (1.0 + (middle.cos() / middle.sin()).abs());
        let most: [f64; 3] = std::array::from_fn(|c| (share * all * (mean[c] - self.base[c])).max(0.0));
        let is_bright = |texel: &[f32; 3]| (0..3).any(|c| f64::from(texel[c]) - self.base[c] > most[c]);
        let bright = (0..).zip(panorama.row(row)).filter(|(_, texel)| is_bright(texel)).map(|(column, _)| column);
        Parallel {
            occupied: panorama.row(row).iter().any(|t| t.map(f64::from) != self.base),
            theta,
            middle: middle.sin_cos(),
            points: std::array::from_fn(|rule| {
                self.rules[rule].nodes.iter().map(|t| (theta[0] + t * dtheta).sin_cos()).collect()
            }),
            is_polar: row.min(self.panorama.height() - 1 - row) < POLAR,
            widest: if (middle - PI / 2.0).abs() <= dtheta { 1.0 } else { theta[0].sin().max(theta[1].sin()) },
            solid_angle,
            bright: bright.collect(),
        }
    }

    /// ∫ K(axis·l) L(l) dl, to about 1e-6 relative.
    pub fn evaluate(&self, axis: DVec3, kernel: &Kernel) -> [f64; 3] {
        let axis = axis.normalize();
        let lobe = Lobe::new(axis, kernel);
        let (width, height) = (self.panorama.width(), self.panorama.height());
        let mut sum = [Compensated::default(); 3];
        let whole = self.whole.get_or_init(|| self.make_whole(Threads::One));
        let left = match &whole.cells {
            Some(cells) => {
                let seen = Seen { kernel, axis, horizontal: lobe.horizontal };
                let (far, left) = cells.evaluate(&seen, self.instructions);
                (0..3).for_each(|c| sum[c].add(far[c]));
                left
            }
            None => vec![Left { rows: 0..height, columns: 0..width }],
        };
        let bulk = self.bulk_rule(kernel);
        let along: Vec<f64> = whole.azimuths[bulk].iter().map(|(cos, sin)| axis.x * cos + axis.z * sin).collect();
        let mut weights = vec![0.0; width];
        for Left { rows, columns } in left {
            let columns = columns.start..columns.end.min(width);
            let weights = &mut weights[..columns.len()];
            for row in (rows.start..rows.end.min(height)).filter(|&row| whole.rows[row].occupied) {
                let place = (&whole.rows[row], columns.clone());
                if self.row_weights(place, &lobe, (bulk, &along), weights) {
                    let part = self.row_sum(whole, row, columns.clone(), weights);
                    (0..3).for_each(|c| sum[c].add(part[c]));
                }
            }
        }
        std::array::from_fn(|c| self.base[c] + sum[c].total())
    }

    /// A cube level, every texel a full sum. Slow: for small cubes and for checking others.
    ///
    /// `finished` is told how many texels have been finished since its last call.
    pub fn filter(&self, size: usize, kernel: &Kernel, finished: &(dyn Fn(u64) + Sync)) -> Cube {
        self.prepare();
        let texel = |index| {
            let value = self.evaluate(texel_direction(size, index), kernel).map(|v| v as f32);
            finished(1);
            value
        };
        Cube { size, texels: (0..6 * size * size).into_par_iter().map(texel).collect() }
    }

    /// The rule that suffices away from a kernel's axis and its horizon.
    fn bulk_rule(&self, kernel: &Kernel) -> usize {
        let extent = (PI / self.panorama.height() as f64).max(TAU / self.panorama.width() as f64);
        // (A cap is smooth there over one radian.)
        let length = if kernel.is_ring() { kernel.smoothness(1.0, 0.5, 1.0) } else { 1.0 };
        (0..BULK_RULES - 1).find(|&rule| extent <= RULES[rule].1 * length).unwrap_or(if kernel.is_ring() {
            BULK_RULES - 1
        } else {
            0
        })
    }

    /// Σ weight × (radiance − base) over some columns of a row.
    fn row_sum(&self, whole: &Whole, row: usize, columns: Range<usize>, weights: &[f64]) -> [f64; 3] {
        if let Some(apart) = &whole.apart {
            let first = row * self.panorama.width() + columns.start;
            return self.instructions.run(
                #[inline(always)]
                || {
                    let channel = |c: usize| &apart[c][first..][..columns.len()];
                    [
                        dot(weights, channel(0), self.base[0]),
                        dot(weights, channel(1), self.base[1]),
                        dot(weights, channel(2), self.base[2]),
                    ]
                },
            );
        }
        let mut sum = [0.0; 3];
        for (weight, texel) in weights.iter().zip(&self.panorama.row(row)[columns]) {
            for c in 0..3 {
                sum[c] += weight * (f64::from(texel[c]) - self.base[c]);
            }
        }
        sum
    }

    /// Integrals of the kernel over some texels of a row; false if the whole row is below the horizon.
    fn row_weights(
        &self,
        (place, columns): (&Parallel, Range<usize>),
        lobe: &Lobe,
        (bulk, along): (usize, &[f64]),
        weights: &mut [f64],
    ) -> bool {
        let width = self.panorama.width();
        let &Parallel { theta, widest, middle: (sin, cos), .. } = place;
        let (dtheta, dphi) = (theta[1] - theta[0], TAU / width as f64);
        // The widest parallel of the row; the half-diagonal bounds the angle between a texel's centre and its points.
        let extent = dtheta.max(widest * dphi);
        let reach = 0.5 * dtheta.hypot(widest * dphi) * 1.01;
        if lobe.axis.y * cos + lobe.horizontal * sin < -reach {
            return false;
        }

        // One rule everywhere first: one tight loop.
        let rule = &self.rules[bulk];
        weights.fill(0.0);
        self.instructions.run(
            #[inline(always)]
            || {
                // (Towards a pole sin θ goes to 0, and takes a degree more.)
                let down = if place.is_polar { (bulk + 1).min(BULK_RULES - 1) } else { bulk };
                for (&(sin, cos), weight) in place.points[down].iter().zip(&self.rules[down].weights) {
                    let (up, scale) = (lobe.axis.y * cos, weight * sin * dtheta * dphi);
                    for (along, weight) in along.chunks_exact(width).zip(&rule.weights) {
                        let (at, along) = ([up, sin, scale * weight], &along[columns.clone()]);
                        with_profile!(lobe.kernel, P => add_line::<P>(weights, along, at, lobe.kernel));
                    }
                }
            },
        );

        // Then mend the texels for which that is not enough: near the axis, and across the horizon.
        let [near_from, belt] = lobe.kernel.rough_parts(extent / RULES[bulk].1, reach);
        let flat = self.by_cells && is_flat(extent, lobe.kernel);
        let bend = Bend::new([dtheta, dphi], (sin, cos));
        let up = lobe.axis.y * cos;
        let first = &along[columns.clone()];
        // (The middle of the column to half its width: the margins of both criteria are wider.)
        let slack = 0.5 * widest * dphi;
        let mut mend = |part: Range<usize>| {
            for (i, weight) in part.clone().zip(&mut weights[part]) {
                let column = columns.start + i;
                let c = up + sin * first[i];
                if c + slack <= near_from && c.abs() - slack >= belt {
                    continue;
                }
                let phi = TAU * column as f64 / width as f64 - PI;
                // (Between the points of the column: its centre, to a relative dφ²/8.)
                let a = along.iter().skip(column).step_by(width).sum::<f64>() / rule.nodes.len() as f64;
                let c = up + sin * a;
                let near = c > near_from;
                if !near && c.abs() < reach && flat && place.bright.binary_search(&(column as u32)).is_err() {
                    let down = 0.5 * dtheta * (cos * a - sin * lobe.axis.y);
                    let across = 0.5 * dphi * sin * lobe.horizontal * (lobe.azimuth - phi - 0.5 * dphi).sin();
                    *weight = place.solid_angle * across_horizon(c, [down, across], bend, lobe.kernel);
                } else if (near && c > -reach) || c.abs() < belt {
                    *weight = self.patch(Patch { phi: [phi, phi + dphi], theta }, lobe);
                }
            }
        };
        self.instructions.run(
            #[inline(always)]
            || {
                for start in (0..first.len()).step_by(STRETCH) {
                    let stretch = &first[start..(start + STRETCH).min(first.len())];
                    let (mut lowest, mut largest) = (f64::INFINITY, f64::NEG_INFINITY);
                    for a in stretch {
                        let c = up + sin * a;
                        lowest = if c.abs() < lowest { c.abs() } else { lowest };
                        largest = if c > largest { c } else { largest };
                    }
                    if largest + slack > near_from || lowest - slack < belt {
                        mend(start..start + stretch.len());
                    }
                }
            },
        );
        true
    }

    /// ∫ K over one texel, counted row by row.
    pub(super) fn texel_weight(&self, index: usize, lobe: &Lobe) -> f64 {
        let (width, height) = (self.panorama.width(), self.panorama.height());
        let side = |i: usize, n: usize, whole: f64| [whole * i as f64 / n as f64, whole * (i + 1) as f64 / n as f64];
        let phi = side(index % width, width, TAU).map(|p| p - PI);
        self.patch(Patch { phi, theta: side(index / width, height, PI) }, lobe)
    }

    /// ∫ K over a box, with as many points as it takes.
    fn patch(&self, patch: Patch, lobe: &Lobe) -> f64 {
        let [phi, theta] = [patch.phi, patch.theta].map(|[low, high]| ((low + high) / 2.0, high - low));
        let (sin, cos) = theta.0.sin_cos();
        let centre = DVec3::new(sin * phi.0.cos(), cos, sin * phi.0.sin());
        let widest = (sin + theta.1 / 2.0).min(1.0);
        let extent = theta.1.max(widest * phi.1);
        let reach = 0.5 * theta.1.hypot(widest * phi.1);
        let distance = ((lobe.axis - centre).length() - reach).max(0.0);
        let c = lobe.axis.dot(centre);
        let delta = lobe.kernel.smoothness(distance, c, reach);
        if c < -1.01 * reach {
            return 0.0;
        }
        match RULES.iter().position(|(_, ratio)| extent <= ratio * delta) {
            // Cut at the horizon and at its crossings with the box's sides, a small box leaves polynomials of low degree, which
            // three points integrate exactly; a large one bends the horizon.
            Some(_) if c < 1.01 * reach => self.product(patch, lobe, is_flat(extent, lobe.kernel)),
            Some(rule) => {
                let is_polar = sin < theta.1 * POLAR as f64;
                product_above(patch, lobe, &self.rules[(rule + usize::from(is_polar)).min(RULES.len() - 1)])
            }
            None if lobe.kernel.is_ring() => ring::over_box(patch, lobe, &self.sides),
            None => {
                // The longer side, or both: at a pole, where boxes are slivers, halving azimuths would double their number for nothing.
                let halves = |[low, high]: [f64; 2], middle: f64| [[low, middle], [middle, high]];
                let (down, across) = (theta.1, widest * phi.1);
                let mut sum = 0.0;
                for theta in halves(patch.theta, theta.0).into_iter().take(if across > 2.0 * down { 1 } else { 2 }) {
                    let theta = if across > 2.0 * down { patch.theta } else { theta };
                    for phi in halves(patch.phi, phi.0).into_iter().take(if down > 2.0 * across { 1 } else { 2 }) {
                        let phi = if down > 2.0 * across { patch.phi } else { phi };
                        sum += self.patch(Patch { phi, theta }, lobe);
                    }
                }
                sum
            }
        }
    }

    /// The product rule, each line of constant θ cut at the horizon, and θ where the horizon meets a side of the box.
    fn product(&self, patch: Patch, lobe: &Lobe, is_flat: bool) -> f64 {
        let corners = [patch.phi[0], patch.phi[1], lobe.azimuth, lobe.azimuth + PI].map(|phi| lobe.horizon(phi));
        let mut cuts = [patch.theta[0], corners[0], corners[1], corners[2], corners[3], patch.theta[1]];
        cuts.iter_mut().for_each(|cut| *cut = cut.clamp(patch.theta[0], patch.theta[1]));
        cuts.sort_by(f64::total_cmp);
        let slabs = cuts.windows(2).filter(|slab| slab[1] > slab[0]);
        let lines = if is_flat { &self.rules[1] } else { &self.bent };
        let along = if is_flat { &self.rules[1] } else { &self.rules[RULES.len() - 1] };
        slabs.map(|slab| slab_sum(patch.phi, [slab[0], slab[1]], lobe, [lines, along])).sum()
    }
}

/// The lines of a slab at the nodes of the first rule, each cut at the horizon and summed by the second.
fn slab_sum(phi: [f64; 2], theta: [f64; 2], lobe: &Lobe, [lines, rule]: [&Rule; 2]) -> f64 {
    let dtheta = theta[1] - theta[0];
    let mut sum = 0.0;
    for (t, weight) in lines.nodes.iter().zip(&lines.weights) {
        let (sin, cos) = (theta[0] + t * dtheta).sin_cos();
        // c = up + across cos ψ, with ψ the azimuth from the axis: positive for |ψ| < half.
        let (up, across) = (lobe.axis.y * cos, lobe.horizontal * sin);
        let half = if up >= across { PI } else { (-up / across).clamp(-1.0, 1.0).acos() };
        let mut line = 0.0;
        // The box may meet the lit interval on either side of a turn.
        for turn in [-TAU, 0.0, TAU] {
            let low = (phi[0] - lobe.azimuth + turn).max(-half);
            let high = (phi[1] - lobe.azimuth + turn).min(half);
            if high > low {
                for (s, weight) in rule.nodes.iter().zip(&rule.weights) {
                    let psi = low + s * (high - low);
                    line += weight * (high - low) * lobe.kernel.eval(lobe.one_minus_cos(sin, cos, psi));
                }
            }
        }
        sum += weight * dtheta * sin * line;
    }
    sum
}

/// The product rule over a box that is wholly above the horizon.
fn product_above(Patch { phi, theta }: Patch, lobe: &Lobe, rule: &Rule) -> f64 {
    let (dphi, dtheta) = (phi[1] - phi[0], theta[1] - theta[0]);
    let mut halves = [0.0; 16];
    for (half, t) in halves.iter_mut().zip(&rule.nodes) {
        *half = (0.5 * (phi[0] + t * dphi - lobe.azimuth)).sin().powi(2);
    }
    let mut sum = 0.0;
    for (t, weight) in rule.iter() {
        let (sin, cos) = (theta[0] + t * dtheta).sin_cos();
        let (apart, across) = (lobe.apart(sin, cos), 2.0 * lobe.horizontal * sin);
        let line: f64 =
            rule.weights.iter().zip(&halves).map(|(w, half)| w * lobe.kernel.eval(apart + across * half)).sum();
        sum += weight * sin * line;
    }
    sum * dphi * dtheta
}

/// How a texel is unlike a rectangle: what its height changes of its width, and what its width bends of its sides, in parts of its height.
///
/// In the middle's tangent plane a texel is a piece of a ring. To first order, s and t going from −1 to 1 across height and width, c is
/// c₀ + g s + h t + `taper` h s t − `bow` g t², and the measure 1 + `taper` s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bend {
    taper: f64,
    bow: f64,
}

impl Bend {
    /// Of a texel so high and so wide, in radians of θ and φ, about a parallel.
    pub fn new([dtheta, dphi]: [f64; 2], (sin, cos): (f64, f64)) -> Self {
        Self { taper: 0.5 * dtheta * cos / sin, bow: 0.25 * dphi * dphi * sin * cos / dtheta }
    }

    /// What the mean of c over the texel is above c in the middle, in parts of g.
    pub fn rise(self) -> f64 {
        (self.taper - self.bow) / 3.0
    }
}

/// The mean of a kernel over a small texel that its horizon crosses: c in the middle, and half its change across height and width.
///
/// K ≈ a (c)₊ + b (c)₊² + d (c)₊³. Over a rectangle, where c changes linearly, its mean is Σ ± A₃(c ± g ± h)/4gh, A_k being the k-th
/// integral of K′ with regard to c. What [`Bend`] adds to first order takes A₂ and A₄ of the same corners.
pub(super) fn across_horizon(c: f64, halves: [f64; 2], bend: Bend, kernel: &Kernel) -> f64 {
    /// A shorter side hardly matters.
    const SHORTEST: f64 = 1e-3;
    let [a, b, d, _] = kernel.horizon();
    let longest = halves[0].abs().max(halves[1].abs());
    let [g, h] = halves.map(|half| half.abs().max(SHORTEST * longest).copysign(half));
    let (narrows, bows) = (bend.taper * h / g, 2.0 * bend.bow * g / h);
    let mut sum = 0.0;
    for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        let x = c + s * g + t * h;
        if x > 0.0 {
            let [b, d] = [b * x, d * x * x];
            let second = a / 2.0 + b / 3.0 + d / 4.0;
            let third = a / 6.0 + b / 12.0 + d / 20.0;
            let fourth = a / 24.0 + b / 60.0 + d / 120.0;
            let straight = s * t * (1.0 + t * (bows - narrows)) * third * x;
            sum += x
                * x
                * (straight + (bend.taper * h - s * t * bend.bow * g) * second - s * t * bows / h * fourth * x * x);
        }
    }
    sum / (4.0 * g * h)
}

/// What [`across_horizon`] is off by at most for a texel of this extent about a parallel: what is left out of its shape, of second order, and of the
/// kernel.
pub(super) fn off_across(extent: f64, (sin, cos): (f64, f64), kernel: &Kernel) -> f64 {
    /// 0.066 was the largest of many texels and kernels.
    const SHAPE: f64 = 0.07;
    /// No kernel's fourth term is more than four times its own scale, and a quarter is what its mean is of that at a corner.
    const FOURTH: f64 = 1.0;
    let [slope, .., length] = kernel.horizon();
    let taper = 1.0 + (cos / sin).abs();
    slope.abs() * extent.powi(3) * (SHAPE * taper * taper + FOURTH * extent / length.powi(3))
}

/// A rule for functions that begin and end like roots, x^(n + 1/2), as lines do whose ends lie on a horizon: x = 3s² − 2s³ makes them smooth.
fn bent(points: usize) -> Rule {
    let rule = gauss_legendre(points);
    let nodes = rule.nodes.iter().map(|s| s * s * (3.0 - 2.0 * s)).collect();
    let weights = rule.iter().map(|(s, weight)| weight * 6.0 * s * (1.0 - s)).collect();
    Rule { nodes, weights }
}

/// Whether a box is small enough for [`across_horizon`]: as flat as [`FLAT`], and within what the kernel's first three terms hold for.
pub(super) fn is_flat(extent: f64, kernel: &Kernel) -> bool {
    let [.., length] = kernel.horizon();
    extent < FLAT * (4.0 * length).min(1.0)
}

/// Σ weight × (value − base), in one order on every processor.
#[inline(always)]
fn dot(weights: &[f64], values: &[f32], base: f64) -> f64 {
    let mut sums = [0.0; 8];
    let (weights, rest_weights) = weights.as_chunks::<8>();
    let (values, rest_values) = values.as_chunks::<8>();
    for (weights, values) in weights.iter().zip(values) {
        for i in 0..8 {
            sums[i] += weights[i] * (f64::from(values[i]) - base);
        }
    }
    let rest = rest_weights.iter().zip(rest_values).map(|(w, v)| w * (f64::from(*v) - base)).sum::<f64>();
    sums.iter().sum::<f64>() + rest
}

/// Columns that are looked at together for texels to mend.
const STRETCH: usize = 8;

/// Adds scale × K(up + sin × along) to the weights.
#[inline(always)]
fn add_line<P: Profile>(weights: &mut [f64], along: &[f64], [up, sin, scale]: [f64; 3], kernel: &Kernel) {
    for (out, along) in weights.iter_mut().zip(along) {
        let c = up + sin * along;
        let lit = if c > 0.0 { c } else { 0.0 };
        *out += scale * P::value(kernel, lit, 1.0 - lit);
    }
}

impl<'a> Lobe<'a> {
    /// The lobe about a unit axis.
    pub(super) fn new(axis: DVec3, kernel: &'a Kernel) -> Self {
        Self { kernel, axis, azimuth: axis.z.atan2(axis.x), horizontal: axis.x.hypot(axis.z) }
    }

    /// |axis − l|²/2 for l at (θ, azimuth + ψ): 1 − c without cancellation.
    fn one_minus_cos(&self, sin: f64, cos: f64, psi: f64) -> f64 {
        let half = (psi / 2.0).sin();
        self.apart(sin, cos) + 2.0 * self.horizontal * sin * half * half
    }

    /// The same on the axis's own meridian.
    fn apart(&self, sin: f64, cos: f64) -> f64 {
        ((self.horizontal - sin).powi(2) + (self.axis.y - cos).powi(2)) / 2.0
    }

    /// θ at which the lobe's horizon crosses the meridian φ: cos θ y + sin θ h cos ψ = 0.
    fn horizon(&self, phi: f64) -> f64 {
        let across = self.horizontal * (phi - self.azimuth).cos();
        if self.axis.y >= 0.0 { self.axis.y.atan2(-across) } else { (-self.axis.y).atan2(across) }
    }
}

/// Neumaier's compensated sum.
#[derive(Clone, Copy, Default)]
struct Compensated {
    sum: f64,
    lost: f64,
}

impl Compensated {
    fn add(&mut self, value: f64) {
        let sum = self.sum + value;
        self.lost += if self.sum.abs() >= value.abs() { (self.sum - sum) + value } else { (value - sum) + self.sum };
        self.sum = sum;
    }

    fn total(self) -> f64 {
        self.sum + self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::super::kernel::KernelKind;
    use super::super::relative_error;
    use super::super::test_maps::{random, random_sized};
    use super::*;
    use crate::math::sobol::PointSet;

    /// The largest [`relative_error`] of cells against texels over `axes`; and of how many axes the sun's cell was taken whole.
    fn cells_against_texels(panorama: &Panorama, sun: (usize, usize), kernel: &Kernel, axes: &[DVec3]) -> (f64, usize) {
        // More points on both sides: what is seen is the cells alone.
        let slow = FullSum::with_extra_points(panorama, 2);
        let fast = FullSum { by_cells: true, whole: Arc::default(), ..slow.clone() };
        fast.prepare();
        let cells = fast.whole.get().and_then(|whole| whole.cells.as_ref()).expect("large enough for cells");
        let (mean, mut worst, mut whole) = (panorama.mean(), 0.0f64, 0);
        for &axis in axes {
            let (got, wanted) = (fast.evaluate(axis, kernel), slow.evaluate(axis, kernel));
            for c in 0..3 {
                worst = worst.max(relative_error(got[c], wanted[c], mean[c]));
            }
            let seen = Seen { kernel, axis, horizontal: Lobe::new(axis, kernel).horizontal };
            let (_, left) = cells.evaluate(&seen, fast.instructions);
            whole += usize::from(!left.iter().any(|l| l.columns.contains(&sun.0) && l.rows.contains(&sun.1)));
        }
        (worst, whole)
    }

    fn around(sun: DVec3, angles: &[f64]) -> Vec<DVec3> {
        let (side, up) = sun.any_orthonormal_pair();
        let at = |away: DVec3| angles.iter().map(move |a| sun * a.cos() + away * a.sin());
        [side, -up, (up - side) * 0.5f64.sqrt()].into_iter().flat_map(at).collect()
    }

    fn some_kernels() -> Vec<Kernel> {
        let nol = [1.0, 0.5, 0.2, 0.05, 0.01].map(Kernel::new);
        let others = [KernelKind::G1, KernelKind::Charlie].map(|kind| [1.0, 0.3, 0.05].map(|a| Kernel::of(kind, a)));
        nol.into_iter().chain(others.into_iter().flatten()).collect()
    }

    /// A sun wherever it may stand beside an axis, on maps that cells do not divide evenly.
    #[test]
    fn cells_change_nothing() {
        for ([width, height], sun) in [([250, 131], (249, 0)), ([128, 64], (3, 40))] {
            let panorama = random_sized([width, height], 4, Some(sun));
            let middle = centre(&panorama, sun.0, sun.1);
            let mut axes = directions(middle);
            axes.extend(around(middle, &[0.05, 0.7, 1.5]));
            for kernel in some_kernels() {
                let (worst, _) = cells_against_texels(&panorama, sun, &kernel, &axes);
                let (kind, alpha) = (kernel.kind().name(), kernel.alpha());
                assert!(worst < 1e-7, "{width} × {height}, {kind} {alpha}: off by {worst:e}");
            }
        }
    }

    /// Black but for a sun, so that nothing hides what its cell makes of it: near the axis, far out in the tail, and just above the
    /// horizon, where the kernel is smallest. A map large enough for its cell to be taken whole in most of these places, by all kernels but
    /// a narrow sheen, whose power of the angle no polynomial follows.
    #[test]
    fn cells_change_nothing_of_a_lone_sun() {
        for ([width, height], sun) in [([512, 256], (200, 60)), ([384, 190], (383, 120))] {
            let mut texels = vec![[0.0; 3]; width * height];
            texels[sun.1 * width + sun.0] = [1.0, 0.5, 3.0];
            let panorama = Panorama::new(width, height, texels).unwrap();
            let angles = [0.4, 0.8, 1.2, 1.4, 1.45, 1.5, 1.55, 1.565, 1.6];
            let axes = around(centre(&panorama, sun.0, sun.1), &angles);
            for kernel in some_kernels() {
                let (worst, whole) = cells_against_texels(&panorama, sun, &kernel, &axes);
                let (kind, alpha) = (kernel.kind().name(), kernel.alpha());
                let sharp = kernel.is_ring() && alpha < 0.1;
                assert!(
                    whole >= 6 || sharp,
                    "{width} × {height}, {kind} {alpha}: the sun's cell was whole {whole} times"
                );
                assert!(worst < 1e-7, "{width} × {height}, {kind} {alpha}: off by {worst:e}");
            }
        }
    }

    /// Texels of all latitudes and proportions, whose horizons cross them anyhow.
    #[test]
    fn a_texel_across_the_horizon_is_bent_to_first_order() {
        let panorama = Panorama::new(4, 2, vec![[1.0; 3]; 8]).unwrap();
        let exact = FullSum::with_extra_points(&panorama, 10);
        let sizes = [0.015, 0.006, 0.0015]
            .into_iter()
            .flat_map(|height| [0.3, 1.0, 3.0].map(|across| [height, height * across]));
        let rows = [0.1f64, 0.8, 1.4, 0.5 * PI, 2.6, 3.0];
        for ([dtheta, dphi], row) in sizes.flat_map(|size| rows.map(|row| (size, row))) {
            let (sin, cos) = row.sin_cos();
            let (middle, down) = (DVec3::new(sin, cos, 0.0), DVec3::new(cos, -sin, 0.0));
            let patch = Patch { phi: [-0.5 * dphi, 0.5 * dphi], theta: [row - 0.5 * dtheta, row + 0.5 * dtheta] };
            let solid_angle = dphi * 2.0 * sin * (0.5 * dtheta).sin();
            let extent = dtheta.max(dphi * sin);
            let reach = 0.5 * dtheta.hypot(dphi * sin);
            for kernel in some_kernels().into_iter().filter(|kernel| is_flat(extent, kernel)) {
                for (turn, away) in (0..16).flat_map(|turn| (-5..=5).map(move |away| (turn, away))) {
                    let turn = TAU * f64::from(turn) / 16.0 + 0.01;
                    let c = f64::from(away) / 5.0 * reach;
                    let axis = middle * c + (1.0 - c * c).sqrt() * (down * turn.cos() + DVec3::Z * turn.sin());
                    let wanted = exact.product(patch, &Lobe::new(axis, &kernel), false) / solid_angle;
                    let halves = [0.5 * dtheta * axis.dot(down), 0.5 * dphi * sin * axis.z];
                    let got = across_horizon(c, halves, Bend::new([dtheta, dphi], (sin, cos)), &kernel);
                    let most = off_across(extent, (sin, cos), &kernel);
                    let (kind, alpha) = (kernel.kind().name(), kernel.alpha());
                    assert!(
                        (got - wanted).abs() < most,
                        "{dtheta} × {dphi} at {row}, {kind} {alpha}, turned {turn}: {got} wanted {wanted} ± {most}"
                    );
                }
            }
        }
    }

    /// Directions everywhere, at the poles, along the axes and at the sun.
    fn directions(sun: DVec3) -> Vec<DVec3> {
        let random = PointSet::<2>::new(6, 0, 16);
        let uniform = random.points().iter().map(|&[s, t]| {
            let (y, phi) = (2.0 * s - 1.0, TAU * t);
            DVec3::new((1.0 - y * y).sqrt() * phi.cos(), y, (1.0 - y * y).sqrt() * phi.sin())
        });
        uniform
            .chain([DVec3::Y, DVec3::NEG_Y, DVec3::X, DVec3::NEG_X, DVec3::Z, sun, sun.any_orthogonal_vector()])
            .collect()
    }

    fn centre(panorama: &Panorama, column: usize, row: usize) -> DVec3 {
        let b = panorama.texel_box(column, row);
        let (phi, y) = ((b.phi[0] + b.phi[1]) / 2.0, (b.y[0] + b.y[1]) / 2.0);
        DVec3::new((1.0 - y * y).sqrt() * phi.cos(), y, (1.0 - y * y).sqrt() * phi.sin())
    }

    /// The weights of all texels sum to ∫ K = 1: a panorama that is 1 but for one texel 0 (so that the base is 0).
    #[test]
    fn the_kernel_keeps_its_mass_over_all_texels() {
        for (width, alphas) in [(64, &[1.0, 0.5, 0.1, 0.01, 1e-3][..]), (512, &[1.0, 0.3, 0.02])] {
            let mut texels = vec![[1.0; 3]; width * width / 2];
            texels[width * width / 4 + width / 3][0] = 0.0;
            texels[width][1] = 0.0;
            let panorama = Panorama::new(width, width / 2, texels).unwrap();
            let sum = FullSum::new(&panorama);
            for &alpha in alphas {
                for axis in directions(DVec3::new(0.5, 0.2, 0.3).normalize()) {
                    // Red lacks one texel and green another, each put back by a panorama of that texel alone. Blue is base.
                    let [red, green, blue] = sum.evaluate(axis, &Kernel::new(alpha));
                    assert_eq!(blue, 1.0);
                    let missing = |column: usize, row: usize| {
                        let mut one = vec![[0.0f32; 3]; width * width / 2];
                        one[row * width + column] = [1.0; 3];
                        let one = Panorama::new(width, width / 2, one).unwrap();
                        FullSum::new(&one).evaluate(axis, &Kernel::new(alpha))[0]
                    };
                    let index = width * width / 4 + width / 3;
                    let whole = [red + missing(index % width, index / width), green + missing(0, 1)];
                    for (channel, whole) in whole.into_iter().enumerate() {
                        assert!((whole - 1.0).abs() < 1e-6, "{width}, alpha {alpha}, axis {axis}, {channel}: {whole}");
                    }
                }
            }
        }
    }

    /// The same for panoramas that are not 2:1: red is 1 but for one texel, green is that texel alone, blue a random map.
    #[test]
    fn panoramas_of_any_proportions_keep_the_mass_and_agree_with_more_points() {
        for [width, height] in [[5, 3], [7, 2], [4, 31], [100, 60], [33, 20]] {
            let mut texels = random_sized([width, height], 3, None).texels().to_vec();
            let dark = (height / 2) * width + width / 3;
            for (i, texel) in texels.iter_mut().enumerate() {
                (texel[0], texel[1]) = if i == dark { (0.0, 1.0) } else { (1.0, 0.0) };
            }
            let panorama = Panorama::new(width, height, texels).unwrap();
            let (coarse, fine) = (FullSum::new(&panorama), FullSum::with_extra_points(&panorama, 3));
            for alpha in [1.0, 0.3, 0.05] {
                let kernel = Kernel::new(alpha);
                for axis in directions(centre(&panorama, dark % width, dark / width)) {
                    let (got, wanted) = (coarse.evaluate(axis, &kernel), fine.evaluate(axis, &kernel));
                    let mass = got[0] + got[1];
                    assert!((mass - 1.0).abs() < 1e-6, "{width} × {height}, alpha {alpha}, axis {axis}: {mass}");
                    let error = (got[2] / wanted[2] - 1.0).abs();
                    assert!(error < 1e-6, "{width} × {height}, alpha {alpha}, axis {axis}: {got:?} wanted {wanted:?}");
                }
            }
        }
    }

    #[test]
    fn more_points_change_nothing() {
        let panorama = random(128, 2, Some((77, 20)));
        let (coarse, fine) = (FullSum::new(&panorama), FullSum::with_extra_points(&panorama, 3));
        for alpha in [1.0, 0.6, 0.25, 0.06, 0.01] {
            let kernel = Kernel::new(alpha);
            for axis in directions(centre(&panorama, 77, 20)) {
                let (got, wanted) = (coarse.evaluate(axis, &kernel), fine.evaluate(axis, &kernel));
                for c in 0..3 {
                    let error = (got[c] / wanted[c] - 1.0).abs();
                    assert!(error < 1e-6, "alpha {alpha}, axis {axis}: {} wanted {}", got[c], wanted[c]);
                }
            }
        }
    }

    /// Next to the poles texels are triangles, over which sin θ goes to 0: neither flat nor as smooth as others. Large ones end at a horizon that bends.
    #[test]
    fn what_lies_at_a_pole_and_what_is_large_is_summed_as_exactly_as_the_rest() {
        use super::super::test_maps::any;
        let lamp = |i: usize| if i / 400 < 5 && i % 400 < 40 { [1.0f32; 3] } else { [1e-6; 3] };
        let at_a_pole = Panorama::new(400, 200, (0..400 * 200).map(lamp).collect()).unwrap();
        for (map, alpha) in [(at_a_pole, 0.4), (any(259), 0.2352), (any(364), 0.8089)] {
            let kernel = Kernel::of(KernelKind::G1, alpha);
            let (sum, wanted) = (FullSum::new(&map), FullSum::with_extra_points(&map, 4));
            for i in 0..40 {
                let (sin, cos) = (f64::from(i) * 0.7).sin_cos();
                let axis = DVec3::new(cos, 0.002 * f64::from(i - 20), sin).normalize();
                let (got, wanted) = (sum.evaluate(axis, &kernel), wanted.evaluate(axis, &kernel));
                for c in 0..3 {
                    let off = relative_error(got[c], wanted[c], map.mean()[c]);
                    assert!(off < 5e-6, "{} × {}, {axis}: {} is off by {off:e}", map.width(), map.height(), got[c]);
                }
            }
        }
    }
}
