//! Mip 0 of a cube map: the exact average of the panorama over each texel's solid angle.
//!
//! In φ and y = d.y area is preserved, so the integral of radiance over a texel is, by Green's theorem, ∮ P(φ, y) dφ
//! around it, with P(φ, y) = ∫_y^1 L(φ, y′) dy′: each edge of the texel contributes the wedge between itself and the
//! pole. P is linear in y within a panorama texel, and a texel's edges are great circles, on which
//! y = a cos ψ / √(b² + a² cos² ψ), ψ = φ − φ₀: both P and where the edge crosses rows and columns are closed forms.
//! Meridians have dφ = 0 and contribute nothing. Each edge is integrated once for the two texels that share it, so no
//! flux is lost or counted twice. The −Y face is the +Y face of the panorama mirrored in y.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use rayon::prelude::*;

use super::cube::{Cube, edge, solid_angles};
use super::panorama::Panorama;

/// The panorama averaged over the exact solid angle of each texel of a cube of this size. A constant panorama comes out
/// as exactly its constant, and the flux is conserved to rounding.
pub fn area_average(panorama: &Panorama, size: usize) -> Cube {
    let mean = panorama.mean();
    let all_rows = Wedges::new(panorama, mean, panorama.height(), false);
    // The corners of the top face are 54.7° from the pole.
    let cap_rows = (panorama.height() as f64 * (1.0 / 3f64.sqrt()).acos() / PI) as usize + 2;
    let south = Wedges::new(panorama, mean, cap_rows.min(panorama.height()), true);

    let angles = solid_angles(size);
    let faces: Vec<Vec<[f64; 3]>> = (0..6)
        .map(|face| match face {
            2 => top_face(&all_rows, size),
            3 => flip_rows(top_face(&south, size), size),
            side => side_face(&all_rows, size, [0.0, PI, 0.0, 0.0, FRAC_PI_2, -FRAC_PI_2][side]),
        })
        .collect();
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
    // A line at distance t from the centre is the circle tan(elevation) = cos ψ / |t|; through the centre, a meridian.
    let line = |t: f64, centre: [f64; 2], turn: f64| match t {
        0.0 => vec![[0.0; 3]; size],
        _ if t > 0.0 => wedges.along_line(&Circle { a: 1.0, b: t, centre: centre[0] }, turn, size),
        _ => wedges.along_line(&Circle { a: 1.0, b: -t, centre: centre[1] }, -turn, size),
    };
    let (along_v, along_u): (Vec<_>, Vec<_>) = (0..=size)
        .into_par_iter()
        .map(|k| {
            let t = edge(size, k);
            (line(t, [0.0, PI], 1.0), line(t, [FRAC_PI_2, -FRAC_PI_2], -1.0))
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

/// A great circle that is no meridian: tan(elevation) = (a / b) cos(φ − centre), b > 0.
struct Circle {
    a: f64,
    b: f64,
    centre: f64,
}

impl Circle {
    /// ∫₀^s y dψ, and y at s.
    fn height_integral(&self, s: f64) -> (f64, f64) {
        let (sin, cos) = s.sin_cos();
        let norm = (self.b * self.b + self.a * self.a * cos * cos).sqrt();
        ((self.a * sin).atan2(norm), self.a * cos / norm)
    }
}

/// P at every edge between rows, counted from a pole, and where those edges lie.
struct Wedges {
    width: usize,
    rows: usize,
    /// `rows + 1` lines of `width` values of P.
    prefix: Vec<[f64; 3]>,
    /// y of the edges between rows, measured towards the pole.
    y: Vec<f64>,
    /// tan(elevation) of the same edges.
    slope: Vec<f64>,
    /// Rows of the panorama that `rows` counts a part of.
    height: usize,
}

impl Wedges {
    /// The prefix integrals of `panorama − mean` over the first `rows` rows from the north pole, or from the south pole of
    /// the panorama when `mirrored`. They take 24 bytes a texel.
    fn new(panorama: &Panorama, mean: [f64; 3], rows: usize, mirrored: bool) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        // The edges mirror each other exactly, so both hemispheres use the same ones.
        let y = panorama.row_edges()[..=rows].to_vec();
        let slope = y.iter().map(|y| y / (1.0 - y * y).sqrt()).collect();
        let mut prefix = vec![[0.0; 3]; (rows + 1) * width];
        for row in 0..rows {
            let texels = panorama.row(if mirrored { height - 1 - row } else { row });
            let (above, below) = prefix[row * width..(row + 2) * width].split_at_mut(width);
            for ((below, above), texel) in below.iter_mut().zip(above).zip(texels) {
                for c in 0..3 {
                    below[c] = above[c] + (f64::from(texel[c]) - mean[c]) * (y[row] - y[row + 1]);
                }
            }
        }
        Self { width, rows, prefix, y, slope, height }
    }

    /// ∫ P dφ along each of the `size` pieces of a grid line: ψ = turn · atan(t / b), t from −1 to 1.
    fn along_line(&self, circle: &Circle, turn: f64, size: usize) -> Vec<[f64; 3]> {
        let angle = |t: f64| (t.abs() / circle.b).atan();
        (0..size)
            .map(|i| {
                let (t0, t1) = (edge(size, i), edge(size, i + 1));
                let mut sum = [0.0; 3];
                // Split where the circle is highest; each part is walked away from there, and counted as t grows.
                if t0 < 0.0 {
                    self.add_arc(circle, -turn, angle(t1.min(0.0)), angle(t0), turn, &mut sum);
                }
                if t1 > 0.0 {
                    self.add_arc(circle, turn, angle(t0.max(0.0)), angle(t1), turn, &mut sum);
                }
                sum
            })
            .collect()
    }

    /// Adds `sign` ∫ P ds along the arc φ = centre + side · s, s from `from` to `to`, both ≥ 0.
    fn add_arc(&self, circle: &Circle, side: f64, from: f64, to: f64, sign: f64, sum: &mut [f64; 3]) {
        let column_position = (circle.centre + side * from + PI) / TAU * self.width as f64;
        let mut column = if side > 0.0 { column_position.floor() } else { column_position.ceil() - 1.0 };
        let (mut area, y) = circle.height_integral(from);
        let mut row = self.row_at(y);
        let mut s = from;
        let mut next_column = self.column_crossing(circle, side, column);
        let mut next_row = self.row_crossing(circle, row);
        while s < to {
            let end = next_column.min(next_row).min(to).max(s);
            let area_end = circle.height_integral(end).0;
            let index = row * self.width + (column as i64).rem_euclid(self.width as i64) as usize;
            let (above, below) = (self.prefix[index], self.prefix[index + self.width]);
            // ∫ P = P at the row's upper edge × length + L × ∫ (y_edge − y).
            let length = end - s;
            let depth = (self.y[row] * length - (area_end - area)) / (self.y[row] - self.y[row + 1]);
            for c in 0..3 {
                sum[c] += sign * (above[c] * length + (below[c] - above[c]) * depth);
            }
            (s, area) = (end, area_end);
            if end == to {
                break;
            }
            if next_column <= next_row {
                column += side;
                next_column = self.column_crossing(circle, side, column);
            } else {
                row = if circle.a > 0.0 { row + 1 } else { row - 1 };
                next_row = self.row_crossing(circle, row);
            }
        }
    }

    /// The row that holds a height, clamped to the rows there are (rounding may put an end point just outside).
    fn row_at(&self, y: f64) -> usize {
        let theta = (1.0 - y * y).max(0.0).sqrt().atan2(y);
        ((theta / PI * self.height as f64) as usize).min(self.rows - 1)
    }

    /// Where, going outwards, the arc leaves a column.
    fn column_crossing(&self, circle: &Circle, side: f64, column: f64) -> f64 {
        let edge = if side > 0.0 { column + 1.0 } else { column };
        side * (TAU * edge / self.width as f64 - PI - circle.centre)
    }

    /// Where, going outwards and so towards the equator, the arc leaves a row; infinity if it does not.
    fn row_crossing(&self, circle: &Circle, row: usize) -> f64 {
        let edge = if circle.a > 0.0 { row + 1 } else { row };
        if circle.a == 0.0 || edge == 0 || edge >= self.rows {
            return f64::INFINITY;
        }
        // Above one, rounding has put the arc's highest point in the row beyond: it leaves that at once.
        let cos = (circle.b * self.slope[edge] / circle.a).min(1.0);
        if cos > 0.0 { cos.acos() } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::super::cube::face_point;
    use super::super::test_maps::random;
    use super::*;
    use crate::math::sobol::PointSet;

    #[test]
    fn white_is_exactly_one() {
        for (width, size) in [(4, 1), (64, 7), (16, 64), (10, 3)] {
            let white = Panorama::new(width, width / 2, vec![[1.0; 3]; width * width / 2]).unwrap();
            assert!(area_average(&white, size).texels.iter().flatten().all(|&v| v == 1.0), "{width} → {size}");
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
        for width in [4, 6, 10, 34, 128] {
            let panorama = random(width, 3, Some((width / 3, width / 5)));
            for size in 1..=24 {
                let (got, wanted) = (area_average(&panorama, size).mean()[0], panorama.mean()[0]);
                assert!((got / wanted - 1.0).abs() < 6e-8, "{width} → {size}: {got}, wanted {wanted}");
            }
        }
    }

    /// Against n² stratified random points per texel: only the cells that a boundary cuts can be wrong, each at random.
    #[test]
    fn texels_agree_with_brute_force() {
        let n = 256;
        let points = PointSet::<2>::new(2, 0, n * n);
        for (width, size) in [(16, 3), (20, 5), (32, 4), (8, 1)] {
            let panorama = random(width, 8, Some((3, 1)));
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
                    "{width} → {size}, {index}: {got}, wanted {wanted} ± {tolerance}"
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
