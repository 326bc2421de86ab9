//! How dark the filtered map about is, bin by bin of directions: what errors are measured by.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::lanes::{InstructionSet, LANES, V, ZERO, add, scale};
use super::survey::Survey;
use crate::environment::DARK_FLOOR;
use crate::environment::kernel::{Kernel, Profile, with_profile};
use crate::environment::panorama::Panorama;

/// Bins of equal solid angle: across, by the azimuth, and down, by y.
pub(super) const BINS: [usize; 2] = [16, 8];

/// The row of bins at a cosine of θ.
pub(super) fn bin_row(y: f64) -> usize {
    ((0.5 * (1.0 - y) * BINS[1] as f64) as usize).min(BINS[1] - 1)
}

/// Of what the coarse map says, the darkest output is reckoned to be this part anywhere, and this part in a bin.
const ANYWHERE: f64 = 0.3;
const IN_A_BIN: f64 = 0.75;
/// Cells do not resolve narrower kernels.
const NARROWEST: f64 = 0.1;

/// What a kernel about makes of the map; from a coarse map of cells, rather too dark than too bright.
#[derive(Debug, Clone)]
pub(super) struct Dark {
    /// The darkest value in each bin, row by row, in parts of its channel's mean.
    bins: Vec<[f64; 3]>,
    /// Whether the kernel shows details that bins do not.
    is_narrow: bool,
}

impl Dark {
    pub fn new(panorama: &Panorama, cells: &[Cell], kernel: &Kernel, instructions: InstructionSet) -> Self {
        let (mean, wide) = (panorama.mean(), Kernel::of(kernel.kind(), kernel.alpha().max(NARROWEST)));
        let bins = instructions.run(
            #[inline(always)]
            || with_profile!(wide, P => darkest_of::<P>(&wide, cells, mean)),
        );
        Self { bins, is_narrow: !kernel.is_ring() && kernel.alpha() < NARROWEST }
    }

    /// The darkest output of all, in parts of its channel's mean: never below [`DARK_FLOOR`].
    pub fn darkest(&self) -> f64 {
        (ANYWHERE * self.bins.iter().flatten().fold(1.0f64, |darkest, v| darkest.min(*v))).max(DARK_FLOOR)
    }

    /// The darkest outputs of a bin, in parts of their channels' means.
    pub fn in_bin(&self, bin: usize) -> [f64; 3] {
        if self.is_narrow { [DARK_FLOOR; 3] } else { self.bins[bin].map(|v| (IN_A_BIN * v).max(DARK_FLOOR)) }
    }
}

/// The smallest averages of the cells over directions of a spiral in each bin, in parts of the mean; 1 if none is below it.
#[inline(always)]
fn darkest_of<P: Profile>(kernel: &Kernel, cells: &[Cell], mean: [f64; 3]) -> Vec<[f64; 3]> {
    const DIRECTIONS: usize = 256;
    let place = |i: usize| (1.0 - 2.0 * (i as f64 + 0.5) / DIRECTIONS as f64, i as f64 * 2.399_963_229_728_653);
    let axis = |i: usize| {
        let (y, azimuth) = place(i);
        let (sin, cos) = libm::sincos(azimuth);
        DVec3::new(cos, 0.0, sin) * (1.0 - y * y).sqrt() + DVec3::Y * y
    };
    // (Each row of bins has the directions of some turns of the spiral, each bin one of them at least.)
    let bin = |i: usize| {
        let (y, azimuth) = place(i);
        let turn = (azimuth / TAU + 0.5).fract();
        bin_row(y) * BINS[0] + ((turn * BINS[0] as f64) as usize).min(BINS[0] - 1)
    };
    let mut darkest = vec![[1.0f64; 3]; BINS[0] * BINS[1]];
    for first in (0..DIRECTIONS).step_by(LANES) {
        let axes: [DVec3; LANES] = std::array::from_fn(|i| axis(first + i));
        let [x, y, z] = [axes.map(|a| a.x), axes.map(|a| a.y), axes.map(|a| a.z)];
        let (mut sums, mut weights) = ([ZERO; 3], ZERO);
        for cell in cells {
            let d = cell.direction;
            let weight: V = std::array::from_fn(|i| P::at(kernel, x[i] * d.x + y[i] * d.y + z[i] * d.z));
            weights = add(weights, scale(weight, cell.solid_angle));
            (0..3).for_each(|c| sums[c] = add(sums[c], scale(weight, cell.flux[c])));
        }
        for i in 0..LANES {
            let bin = &mut darkest[bin(first + i)];
            for c in (0..3).filter(|&c| mean[c] > 0.0) {
                bin[c] = bin[c].min(sums[c][i] / (weights[i] * mean[c]));
            }
        }
    }
    darkest
}

/// A part of the map, as one light.
pub(super) struct Cell {
    direction: DVec3,
    flux: [f64; 3],
    solid_angle: f64,
}

/// The map in some 32 × 16 cells.
pub(super) fn cells(panorama: &Panorama, survey: &Survey) -> Vec<Cell> {
    let (width, height) = (panorama.width(), panorama.height());
    let (across, down) = (survey.across, height.min(16));
    let mut cells: Vec<Cell> =
        (0..across * down).map(|_| Cell { direction: DVec3::ZERO, flux: [0.0; 3], solid_angle: 0.0 }).collect();
    for (row, sums) in survey.rows.iter().enumerate() {
        let solid_angle = panorama.solid_angle(row);
        let band = row * down / height;
        for (i, (cell, sums)) in cells[band * across..][..across].iter_mut().zip(&sums.cells).enumerate() {
            cell.solid_angle += solid_angle * survey.columns(i, width).len() as f64;
            (0..3).for_each(|c| cell.flux[c] += sums[c] * solid_angle);
        }
    }
    for (i, cell) in cells.iter_mut().enumerate() {
        let theta = PI * ((i / across) as f64 + 0.5) / down as f64;
        let (sin, cos) = libm::sincos(TAU * ((i % across) as f64 + 0.5) / across as f64 - PI);
        cell.direction = DVec3::new(libm::sin(theta) * cos, libm::cos(theta), libm::sin(theta) * sin);
    }
    cells
}
