//! Mip 0 of a cube map: the exact average of the panorama over each texel's solid angle.
//!
//! In φ and y = d.y area is preserved, so the integral of radiance over a texel is, by Green's theorem, ∮ P(φ, y) dφ
//! around it, with P(φ, y) = ∫_y^1 L(φ, y′) dy′: each edge of the texel contributes the wedge between itself and the
//! pole. P is linear in y within a panorama texel; where the edges cross those is known in `overlap.rs`.
//! Meridians have dφ = 0 and contribute nothing. Each edge is integrated once for the two texels that share it, so no
//! flux is lost or counted twice. The −Y face is the +Y face of the panorama mirrored in y.

use rayon::prelude::*;

use super::cube::{Cube, edge, solid_angles};
use super::overlap::{CENTRES, Circle, Grid, cap_rows, top_circle};
use super::panorama::Panorama;

/// The panorama averaged over the exact solid angle of each texel of a cube of this size. A constant panorama comes out
/// as exactly its constant, and the flux is conserved to rounding.
pub fn area_average(panorama: &Panorama, size: usize) -> Cube {
    let mean = panorama.mean();
    let angles = solid_angles(size);
    // The faces at the side reach 45° below the equator. One set of wedges at a time: they are larger than the panorama.
    let height = panorama.height();
    let north = Wedges::new(panorama, mean, (3 * height / 4 + 2).min(height), false);
    let [right, left, top, front, back] = [0, 1, 2, 4, 5].map(|face| match face {
        2 => top_face(&north, size),
        side => side_face(&north, size, CENTRES[side]),
    });
    drop(north);
    let south = Wedges::new(panorama, mean, cap_rows(height), true);
    let bottom = flip_rows(top_face(&south, size), size);
    let faces = [right, left, top, bottom, front, back];
    // An average lies between the extremes. The clamp only keeps rounding (1e-16 of the flux in a column) from making
    // black negative beside a sun.
    let (low, high) = (panorama.min(), panorama.max());
    let average = |(residual, angle): (&[f64; 3], &f64)| {
        std::array::from_fn(|c| ((mean[c] + residual[c] / angle) as f32).clamp(low[c], high[c]))
    };
    let texels = faces.iter().flat_map(|face| face.iter().zip(&angles).map(average)).collect();
    Cube { size, texels }
}

/// Integrals over the texels of a face beside the equator, seen from the azimuth `centre`.
fn side_face(wedges: &Wedges, size: usize, centre: f64) -> Vec<[f64; 3]> {
    // The rows of texels end at circles of constant v; the columns at meridians. φ falls as u grows.
    let lines: Vec<Vec<[f64; 3]>> = (0..=size)
        .into_par_iter()
        .map(|k| wedges.along_line(&Circle { a: -edge(size, k), b: 1.0, centre }, -1.0, size))
        .collect();
    let texel = |i: usize| (i / size, i % size);
    (0..size * size).map(texel).map(|(row, column)| subtract(lines[row][column], lines[row + 1][column])).collect()
}

/// Integrals over the texels of the face around the pole that the wedges start from.
fn top_face(wedges: &Wedges, size: usize) -> Vec<[f64; 3]> {
    let line = |t: f64, along_v: bool| match top_circle(t, along_v) {
        Some((circle, turn)) => wedges.along_line(&circle, turn, size),
        None => vec![[0.0; 3]; size],
    };
    let (along_v, along_u): (Vec<_>, Vec<_>) = (0..=size)
        .into_par_iter()
        .map(|k| {
            let t = edge(size, k);
            (line(t, true), line(t, false))
        })
        .unzip();
    (0..size * size)
        .map(|i| (i / size, i % size))
        .map(|(row, column)| {
            let across = subtract(along_v[column + 1][row], along_v[column][row]);
            let down = subtract(along_u[row][column], along_u[row + 1][column]);
            std::array::from_fn(|c| across[c] + down[c])
        })
        .collect()
}

fn flip_rows(face: Vec<[f64; 3]>, size: usize) -> Vec<[f64; 3]> {
    face.chunks_exact(size).rev().flatten().copied().collect()
}

fn subtract(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| a[c] - b[c])
}

/// P at every edge between rows, counted from a pole.
struct Wedges {
    grid: Grid,
    /// One line of `width` values of P for each edge of the grid's rows.
    prefix: Vec<[f64; 3]>,
}

impl Wedges {
    /// The prefix integrals of `panorama − mean` over the first `rows` rows from the north pole, or from the south pole of
    /// the panorama when `mirrored`. They take 24 bytes a texel.
    fn new(panorama: &Panorama, mean: [f64; 3], rows: usize, mirrored: bool) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        let grid = Grid::new(width, panorama.row_edges(), rows);
        let mut prefix = vec![[0.0; 3]; (rows + 1) * width];
        for row in 0..rows {
            let texels = panorama.row(if mirrored { height - 1 - row } else { row });
            let (above, below) = prefix[row * width..(row + 2) * width].split_at_mut(width);
            for ((below, above), texel) in below.iter_mut().zip(above).zip(texels) {
                for c in 0..3 {
                    below[c] = above[c] + (f64::from(texel[c]) - mean[c]) * grid.row_height(row);
                }
            }
        }
        Self { grid, prefix }
    }

    /// ∫ P dφ along each of the `size` pieces of a grid line.
    fn along_line(&self, circle: &Circle, turn: f64, size: usize) -> Vec<[f64; 3]> {
        let mut sums = vec![[0.0; 3]; size];
        self.grid.along_line(circle, turn, size, |piece, part| {
            let index = part.row * self.grid.width() + part.column;
            let (above, below) = (self.prefix[index], self.prefix[index + self.grid.width()]);
            for c in 0..3 {
                sums[piece][c] += above[c] * part.length + (below[c] - above[c]) * part.depth;
            }
        });
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::super::cube::face_point;
    use super::super::test_maps::{random, random_sized};
    use super::*;
    use crate::math::sobol::PointSet;

    #[test]
    fn white_is_exactly_one() {
        for ([width, height], size) in
            [([4, 2], 1), ([64, 32], 7), ([16, 8], 64), ([10, 5], 3), ([5, 3], 4), ([33, 20], 9)]
        {
            let white = Panorama::new(width, height, vec![[1.0; 3]; width * height]).unwrap();
            assert!(
                area_average(&white, size).texels.iter().flatten().all(|&v| v == 1.0),
                "{width} × {height} → {size}"
            );
        }
    }

    /// Suns at the poles, at face centres, edges and corners, and beside the seam at φ = ±π.
    #[test]
    fn flux_is_conserved_wherever_the_sun_stands() {
        let width = 48;
        let suns = [(0, 0), (47, 0), (13, 23), (0, 12), (47, 11), (24, 12), (6, 6), (30, 7), (18, 17), (42, 12)];
        for (i, sun) in suns.into_iter().enumerate() {
            let panorama = random(width, i as u64, Some(sun));
            for size in [1, 2, 3, 5, 16, 33, 100] {
                let (got, wanted) = (area_average(&panorama, size).mean(), panorama.mean());
                for c in 0..3 {
                    // Each texel is rounded to f32 once: relative 6e-8 of a sum of non-negative values.
                    let error = (got[c] / wanted[c] - 1.0).abs();
                    assert!(error < 6e-8, "sun {sun:?}, size {size}, channel {c}: {} wanted {}", got[c], wanted[c]);
                }
            }
        }
    }

    #[test]
    fn every_pair_of_sizes_keeps_the_flux() {
        let usual = [4, 6, 10, 34, 128].map(|width| [width, width / 2]);
        // Not 2:1, odd, one row at the equator, far wider or higher than usual.
        let others = [[5, 3], [7, 2], [4, 3], [4, 31], [100, 60], [333, 200], [51, 5]];
        for [width, height] in usual.into_iter().chain(others) {
            let panorama = random_sized([width, height], 3, Some((width / 3, 2 * height / 5)));
            for size in 1..=24 {
                let (got, wanted) = (area_average(&panorama, size).mean()[0], panorama.mean()[0]);
                assert!((got / wanted - 1.0).abs() < 6e-8, "{width} × {height} → {size}: {got}, wanted {wanted}");
            }
        }
    }

    /// Against n² stratified random points per texel: only the cells that a boundary cuts can be wrong, each at random.
    #[test]
    fn texels_agree_with_brute_force() {
        let n = 256;
        let points = PointSet::<2>::new(2, 0, n * n);
        let cases = [([16, 8], 3), ([20, 10], 5), ([32, 16], 4), ([8, 4], 1), ([5, 3], 2), ([9, 14], 3), ([33, 20], 2)];
        for ([width, height], size) in cases {
            let panorama = random_sized([width, height], 8, Some((3, 1)));
            let cube = area_average(&panorama, size);
            for index in 0..6 * size * size {
                let (face, row, column) = (index / (size * size), index / size % size, index % size);
                let (mut sum, mut weights, mut largest) = (0.0, 0.0, 0.0f64);
                for xi in points.points() {
                    let at = |k: usize, xi: f64| 2.0 * (k as f64 + xi) / size as f64 - 1.0;
                    let point = face_point(face, at(column, xi[0]), at(row, xi[1]));
                    let weight = point.length().powi(-3);
                    let value = f64::from(panorama.radiance(point)[1]);
                    sum += weight * value;
                    weights += weight;
                    largest = largest.max(value);
                }
                let (got, wanted) = (f64::from(cube.texels[index][1]), sum / weights);
                // Boundaries cut at most about 4n of the n² cells per bright panorama texel, of which no more than 4
                // matter; each is off by at most half the contrast at one sigma. Five sigmas.
                let tolerance = 5.0 * largest / 2.0 * (16.0 * n as f64).sqrt() / (n * n) as f64;
                assert!(
                    (got - wanted).abs() < tolerance,
                    "{width} × {height} → {size}, {index}: {got}, wanted {wanted} ± {tolerance}"
                );
            }
        }
    }

    #[test]
    fn the_number_of_threads_does_not_change_a_bit() {
        let panorama = random(64, 5, Some((40, 9)));
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| area_average(&panorama, 21))
        };
        assert_eq!(with(1), with(3));
    }
}
