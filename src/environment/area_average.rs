//! Mip 0 of a cube map: the exact average of the panorama over each texel's solid angle.
//!
//! In φ and y = d.y area is preserved, so the integral of radiance over a texel is, by Green's theorem, ∮ P(φ, y) dφ
//! around it, with P(φ, y) = ∫_y^1 L(φ, y′) dy′: each edge of the texel contributes the wedge between itself and the
//! pole. P is linear in y within a panorama texel; where the edges cross those is known in `overlap.rs`.
//! Meridians have dφ = 0 and contribute nothing. Each edge is integrated once for the two texels that share it, so no
//! flux is lost or counted twice. The −Y face is the +Y face of the panorama mirrored in y.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use super::cube::{Cube, edge, solid_angles};
use super::overlap::{CENTRES, Circle, Grid, Part, cap_rows, top_circle};
use super::panorama::Panorama;

/// The panorama averaged over the exact solid angle of each texel of a cube of this size. A constant panorama comes out
/// as exactly its constant, and the flux is conserved to rounding.
pub fn area_average(panorama: &Panorama, size: usize) -> Cube {
    let mean = panorama.mean();
    let angles = solid_angles(size);
    // The faces at the side reach 45° below the equator. One set of wedges at a time: they are larger than the panorama.
    let height = panorama.height();
    let north = Wedges::new(panorama, mean, (3 * height / 4 + 2).min(height), false);
    let ([right, left, front, back], top) = (side_faces(&north, size), top_face(&north, size));
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

/// Integrals over the texels of the faces beside the equator: +X, −X, +Z, −Z.
fn side_faces(wedges: &Wedges, size: usize) -> [Vec<[f64; 3]>; 4] {
    // The rows of texels end at circles of constant v; the columns at meridians. φ falls as u grows.
    let lines = by_symmetry(
        wedges,
        size,
        |v| Some((v, 1.0)),
        |arc, v| [0, 1, 4, 5].map(|face| arc.line(wedges, CENTRES[face], -1.0, v > 0.0)),
    );
    let texel = |i: usize| (i / size, i % size);
    std::array::from_fn(|face| {
        let at = |(row, column): (usize, usize)| subtract(lines[row][face][column], lines[row + 1][face][column]);
        (0..size * size).map(texel).map(at).collect()
    })
}

/// Integrals over the texels of the face around the pole that the wedges start from.
fn top_face(wedges: &Wedges, size: usize) -> Vec<[f64; 3]> {
    let lines = by_symmetry(
        wedges,
        size,
        |t| (t > 0.0).then_some((1.0, t)),
        |arc, t| {
            [true, false].map(|along_v| match top_circle(t, along_v) {
                Some((circle, turn)) => arc.line(wedges, circle.centre, turn, false),
                None => vec![[0.0; 3]; size],
            })
        },
    );
    let texel = |i: usize| {
        let (row, column) = (i / size, i % size);
        let across = subtract(lines[column + 1][0][row], lines[column][0][row]);
        let down = subtract(lines[row][1][column], lines[row + 1][1][column]);
        std::array::from_fn(|c| across[c] + down[c])
    };
    (0..size * size).map(texel).collect()
}

/// What `lines` makes of every line between texels, in their order. Lines at ±t are halves of one circle, `circle` (its a and b) of t ≥ 0;
/// the arcs along it are walked once for both.
fn by_symmetry<T: Send>(
    wedges: &Wedges,
    size: usize,
    circle: impl Fn(f64) -> Option<(f64, f64)> + Sync,
    lines: impl Fn(&Arc, f64) -> T + Sync,
) -> Vec<T> {
    let pair = |k: usize| {
        let t = edge(size, k);
        let arc = Arc::new(&wedges.grid, circle(t), size);
        (lines(&arc, -t), (t > 0.0).then(|| lines(&arc, t)))
    };
    let pairs: Vec<(T, Option<T>)> = (size.div_ceil(2)..=size).into_par_iter().map(pair).collect();
    let (low, high): (Vec<T>, Vec<Option<T>>) = pairs.into_iter().unzip();
    low.into_iter().rev().chain(high.into_iter().flatten()).collect()
}

/// The texels that half of a grid line crosses, from its middle outwards; the other half is its mirror image, and so are those of the
/// other faces, as far as the panorama's columns are.
struct Arc {
    size: usize,
    /// a and b of its circle; none for a meridian.
    circle: Option<(f64, f64)>,
    /// The piece of the line, and what a texel holds of it, columns counted from the middle; nothing if columns have no such symmetry.
    parts: Option<Vec<(usize, Part)>>,
}

impl Arc {
    fn new(grid: &Grid, circle: Option<(f64, f64)>, size: usize) -> Self {
        let symmetric = grid.width().is_multiple_of(4);
        let parts = circle.filter(|_| symmetric).map(|(a, b)| {
            let mut parts = vec![];
            grid.along_half(&Circle { a, b, centre: -PI }, size, |piece, part| parts.push((piece, part)));
            parts
        });
        Self { size, circle, parts }
    }

    /// ∫ P dφ along each of the pieces of the line about the azimuth `centre`, or of its mirror image below the equator.
    fn line(&self, wedges: &Wedges, centre: f64, turn: f64, below: bool) -> Vec<[f64; 3]> {
        let mut sums = vec![[0.0; 3]; self.size];
        let Some((a, b)) = self.circle else { return sums };
        let width = wedges.grid.width();
        let Some(parts) = &self.parts else {
            let circle = Circle { a: if below { -a } else { a }, b, centre };
            wedges.grid.along_line(&circle, turn, self.size, |piece, part| wedges.add(part, &mut sums[piece]));
            return sums;
        };
        // Exact: azimuths of faces are quarters of a turn.
        let middle = ((centre + PI) / TAU * width as f64).round() as usize;
        for &(piece, part) in parts {
            let (row, depth) = match below {
                true => (wedges.grid.height() - 1 - part.row, part.length - part.depth),
                false => (part.row, part.depth),
            };
            let outwards = [(middle + part.column) % width, (middle + width - 1 - part.column) % width];
            let [right, left] = if turn > 0.0 { outwards } else { [outwards[1], outwards[0]] };
            let part = |column: usize| Part { column, row, length: turn * part.length, depth: turn * depth };
            wedges.add(part(right), &mut sums[piece]);
            wedges.add(part(left), &mut sums[self.size - 1 - piece]);
        }
        sums
    }
}

fn flip_rows(face: Vec<[f64; 3]>, size: usize) -> Vec<[f64; 3]> {
    face.chunks_exact(size).rev().flatten().copied().collect()
}

fn subtract(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| a[c] - b[c])
}

/// P at every edge between rows, counted from a pole.
pub(super) struct Wedges {
    pub(super) grid: Grid,
    /// One line of `width` values of P for each edge of the grid's rows.
    prefix: Vec<[f64; 3]>,
}

impl Wedges {
    /// The prefix integrals of `panorama − mean` over the first `rows` rows from the north pole, or from the south pole of
    /// the panorama when `mirrored`. They take 24 bytes a texel.
    pub(super) fn new(panorama: &Panorama, mean: [f64; 3], rows: usize, mirrored: bool) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        let grid = Grid::new(width, panorama.row_edges(), rows);
        // Each band of rows from zero, on any thread; then what all bands above come to is added.
        const BAND: usize = 64;
        let mut prefix = vec![[0.0; 3]; (rows + 1) * width];
        prefix[width..].par_chunks_mut(BAND * width).enumerate().for_each(|(band, lines)| {
            let mut above = vec![[0.0; 3]; width];
            for (row, line) in (band * BAND..).zip(lines.chunks_exact_mut(width)) {
                let texels = panorama.row(if mirrored { height - 1 - row } else { row });
                for ((below, above), texel) in line.iter_mut().zip(&mut above).zip(texels) {
                    for c in 0..3 {
                        above[c] += (f64::from(texel[c]) - mean[c]) * grid.row_height(row);
                    }
                    *below = *above;
                }
            }
        });
        let mut above = vec![[0.0; 3]; width];
        let bases: Vec<Vec<[f64; 3]>> = prefix[width..]
            .chunks(BAND * width)
            .map(|lines| {
                let base = above.clone();
                let last = &lines[lines.len() - width..];
                above.iter_mut().zip(last).for_each(|(a, l)| (0..3).for_each(|c| a[c] += l[c]));
                base
            })
            .collect();
        prefix[width..].par_chunks_mut(BAND * width).zip(bases).skip(1).for_each(|(lines, base)| {
            for line in lines.chunks_exact_mut(width) {
                line.iter_mut().zip(&base).for_each(|(l, b)| (0..3).for_each(|c| l[c] += b[c]));
            }
        });
        Self { grid, prefix }
    }

    /// Adds ∫ P dφ over what a texel holds of an arc.
    #[inline]
    pub(super) fn add(&self, part: Part, sum: &mut [f64; 3]) {
        let index = part.row * self.grid.width() + part.column;
        let (above, below) = (self.prefix[index], self.prefix[index + self.grid.width()]);
        for c in 0..3 {
            sum[c] += above[c] * part.length + (below[c] - above[c]) * part.depth;
        }
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
