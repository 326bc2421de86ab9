//! A cube map as a panorama: each panorama texel the exact average of the cube, constant over its texels.
//!
//! The transpose of [`mod@super::area_average`], along the same lines: the integral of the cube over a panorama texel is a sum over
//! the edges of the cube's texels, each times the step of radiance across it. An edge counts for the part of the texel
//! between itself and the pole: the whole height of the rows above it, and of its own row what lies above. So every
//! piece of edge adds to two rows of a table, and a sum from the equator's side to the pole gives the integrals.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::cube::{Cube, edge};
use super::overlap::{CENTRES, Circle, Grid, Part, cap_rows, top_circle};
use super::panorama::{MIN_HEIGHT, Panorama, row_edges};
use crate::error::{Error, Result};
use crate::format::memory;

/// Lines walked at once: their parts are kept, to be added in one order whatever the number of threads.
const LINES_AT_ONCE: usize = 64;

/// Columns of the panorama that a cube of this size becomes: its texels are then nowhere larger than the cube's.
pub fn panorama_width(size: usize) -> usize {
    4 * size
}

/// The cube averaged over the exact solid angle of each texel of a panorama of [`panorama_width`] columns, half as many rows.
/// A constant cube comes out as exactly its constant, and the flux is conserved to rounding.
///
/// **Errors**: a cube without texels, or with another number than six squares; values that are not finite; a panorama that the
/// memory does not hold.
pub fn from_cube(cube: &Cube) -> Result<Panorama> {
    let size = cube.size;
    if size == 0 || cube.texels.len() != 6 * size * size {
        return Err(Error::invalid(
            format!("a cube of size {size} with {} texels, where six squares are wanted", cube.texels.len()),
            "give six faces of at least one texel",
        ));
    }
    if cube.texels.iter().flatten().any(|v| !v.is_finite()) {
        return Err(Error::invalid("a cube with values that are NaN or infinite", "repair it first"));
    }
    let width = panorama_width(size);
    let height = (width / 2).max(MIN_HEIGHT);
    memory::check_room(
        width as u128 * height as u128 * 40,
        &format!("a cube of {size}² as a panorama {width} × {height}"),
    )?;

    let edges = row_edges(height);
    let mean = cube.mean();
    let north = Grid::new(width, &edges, height);
    let mut wedges = Steps::new(&north);
    for side in [0, 1, 4, 5] {
        let face = Face::new(cube, side, mean, false);
        wedges.add_lines(size, |k| {
            let circle = Circle::new(-edge(size, k), 1.0, CENTRES[side]);
            (Some((circle, -1.0)), face.step_down(k))
        });
    }
    add_top(&mut wedges, &Face::new(cube, 2, mean, false));
    let mut integrals = wedges.finish();
    let south = Grid::new(width, &edges, cap_rows(height));
    let mut wedges = Steps::new(&south);
    add_top(&mut wedges, &Face::new(cube, 3, mean, true));
    for (row, line) in wedges.finish().chunks_exact(width).enumerate() {
        let start = (height - 1 - row) * width;
        for (sum, value) in integrals[start..start + width].iter_mut().zip(line) {
            (0..3).for_each(|c| sum[c] += value[c]);
        }
    }

    // An average lies between the extremes. The clamp only keeps rounding (1e-16 of the flux in a column) from making
    // black negative beside a sun.
    let (low, high) = extremes(&cube.texels);
    let column = TAU / width as f64;
    let texel = |(i, integral): (usize, &[f64; 3])| {
        let solid_angle = column * north.row_height(i / width);
        std::array::from_fn(|c| ((mean[c] + integral[c] / solid_angle) as f32).clamp(low[c], high[c]))
    };
    Panorama::new(width, height, integrals.iter().enumerate().map(texel).collect())
}

/// The smallest and the largest value of each channel.
pub(super) fn extremes(texels: &[[f32; 3]]) -> ([f32; 3], [f32; 3]) {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for texel in texels {
        for c in 0..3 {
            (low[c], high[c]) = (low[c].min(texel[c]), high[c].max(texel[c]));
        }
    }
    (low, high)
}

fn add_top(wedges: &mut Steps, face: &Face) {
    let size = face.size;
    wedges.add_lines(size, |k| (top_circle(edge(size, k), true), face.step_left(k)));
    wedges.add_lines(size, |k| (top_circle(edge(size, k), false), face.step_down(k)));
}

/// One face less the mean, 0 outside; the −Y face upside down, as the +Y face of the mirrored world.
struct Face<'a> {
    size: usize,
    texels: &'a [[f32; 3]],
    mean: [f64; 3],
    upside_down: bool,
}

impl<'a> Face<'a> {
    fn new(cube: &'a Cube, face: usize, mean: [f64; 3], upside_down: bool) -> Self {
        Self { size: cube.size, texels: cube.face(face), mean, upside_down }
    }

    fn at(&self, row: usize, column: usize) -> [f64; 3] {
        if row >= self.size || column >= self.size {
            return [0.0; 3];
        }
        let row = if self.upside_down { self.size - 1 - row } else { row };
        let texel = self.texels[row * self.size + column];
        std::array::from_fn(|c| f64::from(texel[c]) - self.mean[c])
    }

    /// Across the line above row `k`, for every column: what is below it, less what is above.
    fn step_down(&self, k: usize) -> Vec<[f64; 3]> {
        (0..self.size).map(|i| difference(self.at(k, i), self.at(k.wrapping_sub(1), i))).collect()
    }

    /// Across the line left of column `k`, for every row: what is left of it, less what is right.
    fn step_left(&self, k: usize) -> Vec<[f64; 3]> {
        (0..self.size).map(|i| difference(self.at(i, k.wrapping_sub(1)), self.at(i, k))).collect()
    }
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| a[c] - b[c])
}

/// For each texel of a grid, what the texels above it in its column have more of than those below: 24 bytes a texel.
pub(super) struct Steps<'a> {
    grid: &'a Grid,
    steps: Vec<[f64; 3]>,
}

impl<'a> Steps<'a> {
    pub(super) fn new(grid: &'a Grid) -> Self {
        Self { grid, steps: vec![[0.0; 3]; grid.rows() * grid.width()] }
    }

    /// Adds the `size + 1` lines of a face: of each the circle and the sign of its direction, and the step of radiance across
    /// each of its `size` pieces.
    fn add_lines(&mut self, size: usize, line: impl Fn(usize) -> (Option<(Circle, f64)>, Vec<[f64; 3]>) + Sync) {
        let lines: Vec<usize> = (0..=size).collect();
        for batch in lines.chunks(LINES_AT_ONCE) {
            let walked: Vec<Vec<(Part, [f64; 3])>> = batch
                .par_iter()
                .map(|&k| {
                    let mut parts = Vec::new();
                    if let (Some((circle, turn)), steps) = line(k) {
                        self.grid.along_line(&circle, turn, size, |piece, part| parts.push((part, steps[piece])));
                    }
                    parts
                })
                .collect();
            walked.into_iter().flatten().for_each(|(part, step)| self.add(part, step));
        }
    }

    /// Adds what lies between an arc and the pole, times a step of radiance.
    pub(super) fn add(&mut self, part: Part, step: [f64; 3]) {
        let width = self.grid.width();
        let index = part.row * width + part.column;
        for (c, step) in step.into_iter().enumerate() {
            let own = step * part.depth;
            self.steps[index][c] += own;
            if part.row > 0 {
                self.steps[index - width][c] += step * part.length - own;
            }
        }
    }

    /// The integrals over the texels.
    pub(super) fn finish(self) -> Vec<[f64; 3]> {
        let (width, rows) = (self.grid.width(), self.grid.rows());
        let mut sums = self.steps;
        for row in (0..rows.saturating_sub(1)).rev() {
            let (upper, lower) = sums[row * width..(row + 2) * width].split_at_mut(width);
            for (upper, lower) in upper.iter_mut().zip(lower) {
                (0..3).for_each(|c| upper[c] += lower[c]);
            }
        }
        for (row, line) in sums.chunks_exact_mut(width).enumerate() {
            let height = self.grid.row_height(row);
            line.iter_mut().flatten().for_each(|value| *value *= height);
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::super::area_average::area_average;
    use super::super::test_maps::random;
    use super::*;

    fn random_cube(size: usize, sun: usize) -> Cube {
        let map = random(8 * size.max(1), 5, None);
        let mut texels = map.texels()[..6 * size * size].to_vec();
        texels[sun % (6 * size * size)] = [1e5, 0.8e5, 0.3e5];
        Cube { size, texels }
    }

    #[test]
    fn a_white_cube_is_exactly_one() {
        for size in [1, 2, 3, 16] {
            let cube = Cube { size, texels: vec![[1.0; 3]; 6 * size * size] };
            assert!(from_cube(&cube).unwrap().texels().iter().flatten().all(|&v| v == 1.0), "{size}");
        }
    }

    #[test]
    fn flux_is_conserved_wherever_the_sun_stands() {
        for size in [1, 2, 3, 4, 5, 8, 13] {
            for sun in (0..6 * size * size).step_by((size * size / 7).max(1)) {
                let cube = random_cube(size, sun);
                let (got, wanted) = (from_cube(&cube).unwrap().mean(), cube.mean());
                for c in 0..3 {
                    // Each texel is rounded to f32 once: relative 6e-8 of a sum of non-negative values.
                    let error = (got[c] / wanted[c] - 1.0).abs();
                    assert!(error < 6e-8, "size {size}, sun {sun}, channel {c}: {} wanted {}", got[c], wanted[c]);
                }
            }
        }
    }

    /// ⟨cube, average of the panorama⟩ = ⟨average of the cube, panorama⟩, both weighted by solid angle: one is the other's transpose.
    #[test]
    fn it_is_the_transpose_of_the_area_average() {
        for size in [1, 2, 3, 6, 9] {
            let panorama = random(panorama_width(size), 11, Some((1, 0)));
            let cube = random_cube(size, 4);
            let (there, back) = (area_average(&panorama, size), from_cube(&cube).unwrap());
            let angles = super::super::cube::solid_angles(size);
            let on_cube: f64 = (0..cube.texels.len())
                .map(|i| f64::from(cube.texels[i][0]) * f64::from(there.texels[i][0]) * angles[i % (size * size)])
                .sum();
            let width = panorama.width();
            let on_panorama: f64 = (0..panorama.texels().len())
                .map(|i| {
                    let product = f64::from(panorama.texels()[i][0]) * f64::from(back.texels()[i][0]);
                    product * panorama.solid_angle(i / width)
                })
                .sum();
            assert!((on_cube / on_panorama - 1.0).abs() < 2e-7, "size {size}: {on_cube}, {on_panorama}");
        }
    }

    #[test]
    fn the_number_of_threads_does_not_change_a_bit() {
        let cube = random_cube(21, 700);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| from_cube(&cube).unwrap())
        };
        assert_eq!(with(1), with(3));
    }
}
