//! Octahedral maps: the sphere on one square.
//!
//! The direction d lies at p = (d.x, d.y)/(|d.x| + |d.y| + |d.z|) in [−1, 1]²; where d.z < 0, folded outwards to
//! ((1 − |p.y|) sign p.x, (1 − |p.x|) sign p.y). Texture coordinates are ½ + ½ p: u to the right, v from the first row on. So +Z is in the
//! middle, −Z in the four corners, and beyond a border the map goes on at the mirror image of the place on that same border.
//!
//! Each of the eight facets of the octahedron is a triangle of the square, and central projection takes straight lines of a facet to
//! great circles. A texel is therefore a polygon of great circles: its solid angle and the average of a panorama over it are closed
//! forms (`overlap`), whichever way the octahedron is turned, as long as its corners lie on the axes.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;

use super::coverage::Border;
use super::cube::edge;
use super::from_cube::{Steps, extremes};
use super::orientation::Orientation;
use super::overlap::{Grid, Part};
use super::panorama::{MIN_HEIGHT, Panorama, row_edges};
use super::sphere_map::{SphereLayout, SphereMap};
use crate::error::{Error, Result};
use crate::format::memory;

/// The point of the octahedron |x| + |y| + |z| = 1 at (u, v) in [−1, 1]².
pub fn point(u: f64, v: f64) -> DVec3 {
    let z = 1.0 - u.abs() - v.abs();
    if z >= 0.0 {
        return DVec3::new(u, v, z);
    }
    DVec3::new((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v), z)
}

/// Where in [−1, 1]² a direction of any length lies.
pub fn locate(direction: DVec3) -> [f64; 2] {
    let DVec3 { x, y, z } = direction;
    let sum = x.abs() + y.abs() + z.abs();
    let [u, v] = [x / sum, y / sum];
    if z >= 0.0 { [u, v] } else { [(1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)] }
}

/// The texel at a column and a row that may be one beyond the border.
pub(super) fn texel(size: usize, column: isize, row: isize) -> usize {
    let n = size as isize;
    let (mut column, mut row) = (column, row);
    if column < 0 || column >= n {
        (column, row) = (if column < 0 { -1 - column } else { 2 * n - 1 - column }, n - 1 - row);
    }
    if row < 0 || row >= n {
        (column, row) = (n - 1 - column, if row < 0 { -1 - row } else { 2 * n - 1 - row });
    }
    (row.clamp(0, n - 1) * n + column.clamp(0, n - 1)) as usize
}

/// One of the eight triangles: the signs of u and v, and whether it lies outside the diamond |u| + |v| = 1.
#[derive(Debug, Clone, Copy)]
struct Facet {
    signs: [f64; 2],
    outer: bool,
}

impl Facet {
    const ALL: [Self; 8] = {
        let mut all = [Self { signs: [1.0, 1.0], outer: false }; 8];
        let mut i = 0;
        while i < 8 {
            all[i].signs = [if i & 1 == 0 { 1.0 } else { -1.0 }, if i & 2 == 0 { 1.0 } else { -1.0 }];
            all[i].outer = i & 4 != 0;
            i += 1;
        }
        all
    };

    /// How far within the facet's three sides a point is; the last is z, or −z outside the diamond.
    fn inside(&self, [u, v]: [f64; 2]) -> [f64; 3] {
        let [a, b] = [self.signs[0] * u, self.signs[1] * v];
        let z = 1.0 - a - b;
        [a, b, if self.outer { -z } else { z }]
    }

    /// The point of the octahedron, linear over the facet.
    fn point(&self, [u, v]: [f64; 2]) -> DVec3 {
        let [s, t] = self.signs;
        let z = 1.0 - s * u - t * v;
        if self.outer { DVec3::new(s * (1.0 - t * v), t * (1.0 - s * u), z) } else { DVec3::new(u, v, z) }
    }

    /// A direction in the middle of it.
    fn middle(&self) -> DVec3 {
        DVec3::new(self.signs[0], self.signs[1], if self.outer { -1.0 } else { 1.0 })
    }
}

/// The part of a texel that lies in one facet, counterclockwise in (u, v).
struct Polygon {
    facet: Facet,
    corners: Vec<[f64; 2]>,
}

/// The parts of a texel: one, but for those on the diamond and, of odd sizes, on its axes.
fn polygons(size: usize, index: usize) -> impl Iterator<Item = Polygon> {
    let [u, v] = [index % size, index / size].map(|i| [edge(size, i), edge(size, i + 1)]);
    let square = [[u[0], v[0]], [u[1], v[0]], [u[1], v[1]], [u[0], v[1]]];
    Facet::ALL.into_iter().filter_map(move |facet| {
        if (0..3).any(|side| square.iter().all(|&corner| facet.inside(corner)[side] <= 0.0)) {
            return None;
        }
        let mut corners = square.to_vec();
        for side in 0..3 {
            corners = clip(&corners, |corner| facet.inside(corner)[side]);
        }
        (corners.len() > 2).then_some(Polygon { facet, corners })
    })
}

/// What of a convex polygon lies where a linear function is not negative.
fn clip(corners: &[[f64; 2]], inside: impl Fn([f64; 2]) -> f64) -> Vec<[f64; 2]> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (i, &corner) in corners.iter().enumerate() {
        let next = corners[(i + 1) % corners.len()];
        let [here, there] = [corner, next].map(&inside);
        if here >= 0.0 {
            kept.push(corner);
        }
        if here * there < 0.0 {
            let t = here / (here - there);
            kept.push([0, 1].map(|k| corner[k] + t * (next[k] - corner[k])));
        }
    }
    kept
}

impl Polygon {
    /// By triangles from its first corner: tan(Ω/2) = a·(b×c)/(abc + a·b c + b·c a + c·a b) (Van Oosterom and Strackee). The triple
    /// product of three points of the plane x + y + z = 1 is twice the area in (u, v): nothing cancels, however small the texel.
    fn solid_angle(&self) -> f64 {
        let first = self.corners[0];
        let triangle = |pair: &[[f64; 2]]| {
            let [b, c] = [pair[0], pair[1]].map(|p| [p[0] - first[0], p[1] - first[1]]);
            let det = b[0] * c[1] - b[1] * c[0];
            let [a, b, c] = [first, pair[0], pair[1]].map(|p| self.facet.point(p));
            let [la, lb, lc] = [a, b, c].map(|p| p.length());
            2.0 * det.atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
        };
        self.corners[1..].windows(2).map(triangle).sum()
    }

    /// Whether it lies in the world's lower half, and the sign of its area in (φ, y) when its corners are taken in turn.
    fn side(&self, orientation: &Orientation) -> (bool, f64) {
        let below = orientation.world(self.facet.middle()).y < 0.0;
        // Seen from outside the sphere u, v turn like a right-handed system, φ, y the other way.
        (below, if orientation.is_mirror() == below { -1.0 } else { 1.0 })
    }

    /// What its border holds of a panorama's texels, those of its half counted from the pole there; positive where φ grows.
    fn along_border(&self, orientation: &Orientation, below: bool, grid: &Grid, mut visit: impl FnMut(Part)) {
        /// What a corner on the equator may be off by: rounding.
        const ZERO: f64 = 1e-14;
        let corner = |&p: &[f64; 2]| {
            let mut world = orientation.world(self.facet.point(p));
            world.y = if below { -world.y } else { world.y };
            if world.y < ZERO {
                world.y = 0.0;
            }
            world
        };
        let corners: Vec<DVec3> = self.corners.iter().map(corner).collect();
        for (i, &from) in corners.iter().enumerate() {
            grid.along_arc(from, corners[(i + 1) % corners.len()], &mut visit);
        }
    }
}

/// Solid angles of the texels, row by row.
pub fn solid_angles(size: usize) -> Vec<f64> {
    let of = |index: usize| polygons(size, index).map(|polygon| polygon.solid_angle()).sum();
    (0..size * size).into_par_iter().map(of).collect()
}

/// The panorama averaged over the exact solid angle of each texel of a map of this size, turned. A constant panorama comes out as
/// exactly its constant, and the flux is conserved to rounding.
pub fn area_average(panorama: &Panorama, size: usize, orientation: &Orientation) -> SphereMap {
    let (mean, height) = (panorama.mean(), panorama.height());
    let grid = Grid::new(panorama.width(), panorama.row_edges(), height);
    // An average lies between the extremes. The clamp only keeps rounding from making black negative beside a sun.
    let (low, high) = (panorama.min(), panorama.max());
    let average = |border: &mut Border, index: usize| {
        let (mut sum, mut angle) = ([0.0; 3], 0.0);
        for polygon in polygons(size, index) {
            angle += polygon.solid_angle();
            let (below, sign) = polygon.side(orientation);
            polygon.along_border(orientation, below, &grid, |part| border.add(part, sign));
            border.take(&grid, |row, column, areas| {
                let row = if below { height - 1 - row } else { row };
                for (area, texel) in areas.iter().zip(&panorama.row(row)[column..]) {
                    (0..3).for_each(|c| sum[c] += area * (f64::from(texel[c]) - mean[c]));
                }
            });
        }
        std::array::from_fn(|c| ((mean[c] + sum[c] / angle) as f32).clamp(low[c], high[c]))
    };
    let texels = (0..size * size).into_par_iter().map_init(Border::default, average).collect();
    SphereMap { layout: SphereLayout::Octahedral, size, texels }
}

/// Texel rows walked at once: their parts are kept, to be added in one order whatever the number of threads.
const ROWS_AT_ONCE: usize = 32;

/// The map as a panorama four times as wide as its edge, whose texels are nowhere larger: each the exact average of the map, constant over
/// its texels. The transpose of [`area_average`].
///
/// **Errors**: a map without texels; values that are not finite; a panorama that the memory does not hold.
pub fn to_panorama(map: &SphereMap) -> Result<Panorama> {
    let (size, layout) = (map.size, map.layout);
    if layout != SphereLayout::Octahedral || size == 0 || map.texels.len() != size * size {
        return Err(Error::invalid(
            format!("an octahedral map of {size}² with {} texels", map.texels.len()),
            "give a square",
        ));
    }
    if map.texels.iter().flatten().any(|v| !v.is_finite()) {
        return Err(Error::invalid("an octahedral map with values that are NaN or infinite", "repair it first"));
    }
    let width = 4 * size;
    let height = (width / 2).max(MIN_HEIGHT);
    memory::check_room(
        width as u128 * height as u128 * 64,
        &format!("an octahedral map of {size}² as a panorama {width} × {height}"),
    )?;
    let (edges, mean, orientation) = (row_edges(height), map.mean(), Orientation::default());
    let grid = Grid::new(width, &edges, height / 2 + 1);
    let mut halves = [Steps::new(&grid), Steps::new(&grid)];
    let rows: Vec<usize> = (0..size).collect();
    for batch in rows.chunks(ROWS_AT_ONCE) {
        type Found = (bool, Part, [f64; 3]);
        let of_row = |&row: &usize| {
            let mut found: Vec<Found> = vec![];
            for index in row * size..(row + 1) * size {
                let value: [f64; 3] = std::array::from_fn(|c| f64::from(map.texels[index][c]) - mean[c]);
                for polygon in polygons(size, index) {
                    let (below, sign) = polygon.side(&orientation);
                    let step = value.map(|v| sign * v);
                    polygon.along_border(&orientation, below, &grid, |part| found.push((below, part, step)));
                }
            }
            found
        };
        let walked: Vec<Vec<Found>> = batch.par_iter().map(of_row).collect();
        walked.into_iter().flatten().for_each(|(below, part, step)| halves[usize::from(below)].add(part, step));
    }
    let [north, south] = halves.map(Steps::finish);
    // The first half plus one row of each: they share the middle, where there is one, and what lies beyond it is empty.
    let of = |half: &[[f64; 3]], row: usize, column: usize| half.get(row * width + column).copied().unwrap_or([0.0; 3]);
    let (low, high) = extremes(&map.texels);
    let texel = |i: usize| {
        let (row, column) = (i / width, i % width);
        let angle = TAU / width as f64 * (edges[row] - edges[row + 1]);
        let (up, down) = (of(&north, row, column), of(&south, height - 1 - row, column));
        std::array::from_fn(|c| ((mean[c] + (up[c] + down[c]) / angle) as f32).clamp(low[c], high[c]))
    };
    Panorama::new(width, height, (0..width * height).map(texel).collect())
}

#[cfg(test)]
mod tests {
    use super::super::test_maps::{random, random_sized};
    use super::*;
    use crate::math::sobol::PointSet;
    use std::f64::consts::PI;

    #[test]
    fn locating_a_point_gives_it_back() {
        for (u, v) in [(0.0, 0.0), (0.3, -0.2), (-0.9, 0.4), (0.7, 0.7), (-0.99, -0.98), (1.0, 0.25)] {
            let [a, b] = locate(3.0 * point(u, v));
            assert!((a - u).abs() < 1e-15 && (b - v).abs() < 1e-15, "({u}, {v}): ({a}, {b})");
        }
        assert_eq!(locate(DVec3::X), [1.0, 0.0]);
        assert_eq!(locate(DVec3::Y), [0.0, 1.0]);
        assert_eq!(locate(DVec3::Z), [0.0, 0.0]);
        assert_eq!(point(1.0, 1.0), DVec3::NEG_Z);
    }

    /// What is one texel beyond the border is where the map goes on: its centre is the reflected one's neighbour on the sphere.
    #[test]
    fn beyond_a_border_comes_what_touches_it() {
        for size in [1, 2, 3, 8, 33] {
            let n = size as isize;
            let centre = |i: usize| SphereLayout::Octahedral.direction(size, i);
            for i in 0..n {
                for (inside, beyond) in
                    [([i, 0], [i, -1]), ([i, n - 1], [i, n]), ([0, i], [-1, i]), ([n - 1, i], [n, i])]
                {
                    let [a, b] = [inside, beyond].map(|[column, row]| centre(texel(size, column, row)));
                    assert!(a.angle_between(b) < 4.6 / size as f64, "size {size}: {inside:?} and {beyond:?}");
                }
            }
            assert_eq!(texel(size, -1, -1), texel(size, n - 1, n - 1));
        }
    }

    #[test]
    fn solid_angles_sum_to_the_sphere_and_agree_with_the_density() {
        for size in [1, 2, 3, 5, 64, 129] {
            let total: f64 = solid_angles(size).iter().sum();
            assert!((total - 4.0 * PI).abs() < 1e-13 * size as f64, "size {size}: {total}");
        }
        // A small texel is its area over the cube of its distance, up to the square of its size.
        let size = 512;
        let angles = solid_angles(size);
        for index in [0, 40_000, 100_000, 200_100] {
            let [u, v] = [index % size, index / size].map(|i| (2.0 * i as f64 + 1.0 - size as f64) / size as f64);
            let wanted = (2.0 / size as f64).powi(2) / point(u, v).length().powi(3);
            let off = (angles[index] / wanted - 1.0).abs();
            assert!(off < 4.0 * (2.0 / size as f64).powi(2) || (u.abs() + v.abs() - 1.0).abs() < 2.0 / size as f64);
        }
    }

    #[test]
    fn flux_is_conserved_wherever_the_sun_stands_and_however_it_is_turned() {
        let turns = ["x,y,z", "x,z,y", "-y,x,z", "z,-x,-y", "-z,-y,x"];
        for (i, sun) in [(0, 0), (47, 23), (13, 12), (24, 11), (6, 6), (35, 17)].into_iter().enumerate() {
            let panorama = random(48, i as u64, Some(sun));
            for (size, turn) in [1, 2, 3, 5, 16, 33, 100].into_iter().zip(turns.into_iter().cycle()) {
                let (got, wanted) = (area_average(&panorama, size, &turn.parse().unwrap()).mean(), panorama.mean());
                for c in 0..3 {
                    // Each texel is rounded to f32 once: relative 6e-8 of a sum of non-negative values.
                    let error = (got[c] / wanted[c] - 1.0).abs();
                    assert!(error < 6e-8, "sun {sun:?}, size {size}, {turn}: {} wanted {}", got[c], wanted[c]);
                }
            }
        }
    }

    #[test]
    fn white_is_exactly_one() {
        for ([width, height], size) in [([4, 2], 1), ([64, 32], 7), ([10, 5], 8), ([5, 3], 4), ([33, 20], 9)] {
            let white = Panorama::new(width, height, vec![[1.0; 3]; width * height]).unwrap();
            let map = area_average(&white, size, &Orientation::default());
            assert!(map.texels.iter().flatten().all(|&v| v == 1.0), "{width} × {height} → {size}");
            let again = to_panorama(&map).unwrap();
            assert!(again.texels().iter().flatten().all(|&v| v == 1.0), "{size}");
        }
    }

    /// Against stratified points of each texel: see the same test of `area_average`.
    #[test]
    fn texels_agree_with_brute_force() {
        let n = 128;
        let points = PointSet::<2>::new(2, 0, n * n);
        let cases = [([16, 8], 3, "x,y,z"), ([20, 10], 6, "x,-z,y"), ([9, 14], 4, "-z,y,x"), ([33, 20], 5, "y,x,z")];
        for ([width, height], size, turn) in cases {
            let panorama = random_sized([width, height], 8, Some((3, 1)));
            let orientation: Orientation = turn.parse().unwrap();
            let map = area_average(&panorama, size, &orientation);
            for index in 0..size * size {
                let (mut sum, mut weights, mut largest) = (0.0, 0.0, 0.0f64);
                for xi in points.points() {
                    let at = |k: usize, xi: f64| 2.0 * (k as f64 + xi) / size as f64 - 1.0;
                    let seen = point(at(index % size, xi[0]), at(index / size, xi[1]));
                    let weight = seen.length().powi(-3);
                    let value = f64::from(panorama.radiance(orientation.world(seen))[1]);
                    (sum, weights, largest) = (sum + weight * value, weights + weight, largest.max(value));
                }
                let (got, wanted) = (f64::from(map.texels[index][1]), sum / weights);
                let tolerance = 5.0 * largest / 2.0 * (16.0 * n as f64).sqrt() / (n * n) as f64;
                assert!(
                    (got - wanted).abs() < tolerance,
                    "{width} × {height} → {size}, {turn}, {index}: {got}, wanted {wanted} ± {tolerance}"
                );
            }
        }
    }

    /// ⟨map, average of the panorama⟩ = ⟨panorama of the map, panorama⟩: one is the other's transpose.
    #[test]
    fn back_to_a_panorama_is_the_transpose() {
        for size in [1, 2, 3, 6, 9] {
            let panorama = random(4 * size, 11, Some((1, 0)));
            let texels = random(8 * size, 5, None).texels()[..size * size].to_vec();
            let map = SphereMap { layout: SphereLayout::Octahedral, size, texels };
            let (there, back) = (area_average(&panorama, size, &Orientation::default()), to_panorama(&map).unwrap());
            let angles = solid_angles(size);
            let product = |a: &[f32; 3], b: &[f32; 3]| f64::from(a[0]) * f64::from(b[0]);
            let on_map: f64 = (0..size * size).map(|i| product(&map.texels[i], &there.texels[i]) * angles[i]).sum();
            let on_panorama: f64 = (0..panorama.texels().len())
                .map(|i| product(&panorama.texels()[i], &back.texels()[i]) * panorama.solid_angle(i / (4 * size)))
                .sum();
            assert!((on_map / on_panorama - 1.0).abs() < 2e-7, "size {size}: {on_map}, {on_panorama}");
        }
    }

    #[test]
    fn the_number_of_threads_does_not_change_a_bit() {
        let map = area_average(&random(64, 5, Some((40, 9))), 21, &Orientation::default());
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| to_panorama(&map).unwrap())
        };
        assert_eq!(with(1), with(3));
    }
}
