//! What a shader sees of a cube map: bilinear filtering that knows no face edges, and how far that is from the true function.
//!
//! This is the seamless filtering of Vulkan, Direct3D and OpenGL: the four texels around a point are blended; those beyond an edge of
//! the face come from the face next to it, where texels meet one to one; at a corner, where only three meet, the fourth is the mean
//! of the three. Perfect texels do not make a perfect lookup: between them the blend is off by about h² f″/8, h a texel.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::chain::{error_scale, relative_error};
use super::cube::{Cube, FACES, centre, face_point, locate, nearest_texel, texel_direction};
use super::orientation::Orientation;
use super::sphere_map::SphereMap;
use super::zonal::Function;

/// Texels and their weights, which sum to 1. At a corner the last has no weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taps {
    /// Counted as [`Cube::texels`] is.
    pub texels: [usize; 4],
    /// In the same order.
    pub weights: [f64; 4],
}

impl Taps {
    /// What a sampler blends in a direction, in a cube of that size.
    pub fn towards(size: usize, direction: DVec3) -> Self {
        let (face, u, v) = locate(direction);
        Self::on_face(size, face, u, v)
    }

    /// The same at a point of a face, u to the right and v down in [−1, 1].
    pub fn on_face(size: usize, face: usize, u: f64, v: f64) -> Self {
        let split = |t: f64| {
            let position = (t + 1.0) / 2.0 * size as f64 - 0.5;
            let low = position.floor();
            (low as isize, position - low)
        };
        let ((column, s), (row, t)) = (split(u), split(v));
        let found = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| texel(size, face, column + x, row + y));
        let mut weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
        let Some(missing) = found.iter().position(Option::is_none) else {
            return Self { texels: found.map(|texel| texel.unwrap_or(0)), weights };
        };
        let third = weights[missing] / 3.0;
        weights = weights.map(|weight| weight + third);
        weights[missing] = 0.0;
        let any = found.iter().flatten().next().copied().unwrap_or(0);
        let mut taps = Self { texels: found.map(|texel| texel.unwrap_or(any)), weights };
        taps.texels.swap(missing, 3);
        taps.weights.swap(missing, 3);
        taps
    }

    /// The blend of values, one for each texel of the cube. Equal values blend to themselves, to the last bit.
    #[inline]
    pub fn blend(&self, texels: &[[f32; 3]]) -> [f64; 3] {
        let values = self.texels.map(|texel| texels[texel].map(f64::from));
        std::array::from_fn(|c| {
            let first = values[0][c];
            first + (1..4).map(|k| self.weights[k] * (values[k][c] - first)).sum::<f64>()
        })
    }
}

/// The texel at a column and a row of a face, or of the face beside it; none beyond a corner.
fn texel(size: usize, face: usize, column: isize, row: isize) -> Option<usize> {
    let n = size as isize;
    let beyond = |i: isize| i < 0 || i >= n;
    match (beyond(column), beyond(row)) {
        (false, false) => Some((face * size + row as usize) * size + column as usize),
        (true, true) => None,
        _ => {
            // A quarter of a texel over the edge; projected onto the other face that stays beside the same texel.
            let over = 1.0 + 0.5 / size as f64;
            let place = |i: isize| match i {
                i if i < 0 => -over,
                i if i >= n => over,
                i => centre(size, i as usize),
            };
            Some(nearest_texel(size, face_point(face, place(column), place(row))))
        }
    }
}

impl Cube {
    /// What a shader sees in a direction: seamless bilinear filtering.
    pub fn filtered(&self, direction: DVec3) -> [f64; 3] {
        Taps::towards(self.size, direction).blend(&self.texels)
    }
}

/// Pairs of texels that touch across the edges between faces, each once, with the next texel inward on either side.
///
/// **Shape**: (inside, at the edge, at the edge of the other face, inside that).
pub(crate) fn across_edges(size: usize) -> Vec<[usize; 4]> {
    let mut pairs = vec![];
    let last = size as isize - 1;
    let inward = (last - 1).max(0);
    for face in 0..6 {
        for i in 0..size as isize {
            let sides = [[(inward, i), (last, i), (last + 1, i)], [(last - inward, i), (0, i), (-1, i)]];
            let flipped = sides.map(|side| side.map(|(column, row)| (row, column)));
            for [inside, edge, other] in sides.into_iter().chain(flipped) {
                let at = |(column, row): (isize, isize)| texel(size, face, column, row);
                let (Some(inside), Some(edge), Some(other)) = (at(inside), at(edge), at(other)) else { continue };
                if edge < other {
                    pairs.push([inside, edge, other, inward_of(size, other, edge)]);
                }
            }
        }
    }
    pairs
}

/// The texel beside `texel`, away from `from` on the other face.
fn inward_of(size: usize, texel: usize, from: usize) -> usize {
    let area = size * size;
    let (face, u, v) = locate(texel_direction(size, texel));
    // The middle of the other face is the way to the edge between the two.
    let away = face_point(face, u, v) - 2.0 / size as f64 * face_point(from / area, 0.0, 0.0);
    let found = nearest_texel(size, away);
    if found / area == face { found } else { texel }
}

/// The error of a cube as a shader sees it, against the function that it holds; relative to its [`error_scale`],
/// which is by the brightest channel's mean where the channel is black everywhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CubeLookup {
    /// Root mean square over the sphere and the channels.
    pub rms: f64,
    /// The largest of all points that were looked at.
    pub max: f64,
    /// The direction of that.
    pub worst_towards: [f64; 3],
    /// The face of that.
    pub worst_face: String,
    /// How many points were looked at.
    pub points: usize,
}

/// Points of the sphere, and a function's values there.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Probe {
    directions: Vec<DVec3>,
    /// In parts of the sphere; 0 for points that are looked at for their own sake.
    weights: Vec<f64>,
    truth: Vec<[f64; 3]>,
    mean: [f64; 3],
}

/// Strata along an edge of a face: 3456 points, two for each cell of a level of 16²; a probe is to cost less than the filter.
const STRATA: usize = 24;

/// What errors are in parts of where it is dark: a channel's mean, or the brightest channel's where that is nothing. (What a block leaves of blue in a map
/// without any is no infinite error.)
pub(crate) fn means_to_judge_by(mean: [f64; 3]) -> [f64; 3] {
    let brightest = mean.iter().fold(0.0_f64, |most, mean| most.max(mean.abs()));
    mean.map(|mean| if mean == 0.0 { brightest } else { mean.abs() })
}

impl Probe {
    /// One point in each of 3456 parts of the sphere, and a close look where the cube bends most, which is where blending does worst.
    ///
    /// `mean` is the panorama's, `cube` a level that holds the function, `seed` moves the points within their parts.
    pub fn new(function: &Function, cube: &Cube, mean: [f64; 3], seed: u64) -> Self {
        let (mut directions, mut weights) = points(seed);
        let close = around_bends(cube, mean);
        weights.resize(weights.len() + close.len(), 0.0);
        directions.extend(close);
        let truth = function.values(&directions);
        Self { directions, weights, truth, mean }
    }

    /// The same for a map of any layout, which is turned.
    pub(super) fn of_map(
        function: &Function,
        map: &SphereMap,
        orientation: &Orientation,
        mean: [f64; 3],
        seed: u64,
    ) -> Self {
        let (mut directions, mut weights) = points(seed);
        let close = around_bends_of_map(map, mean);
        weights.resize(weights.len() + close.len(), 0.0);
        directions.extend(close.into_iter().map(|direction| orientation.world(direction)));
        let truth = function.values(&directions);
        Self { directions, weights, truth, mean }
    }

    /// How far a cube is from the function.
    pub fn judge(&self, cube: &Cube) -> CubeLookup {
        self.judge_by(|direction| cube.filtered(direction), Orientation::default())
    }

    /// The same of a map that is turned: places are the world's, the face is that of the vector that is looked up.
    pub fn judge_turned(&self, map: &SphereMap, orientation: Orientation) -> CubeLookup {
        self.judge_by(|direction| map.filtered(direction), orientation)
    }

    fn judge_by(&self, filtered: impl Fn(DVec3) -> [f64; 3] + Sync, orientation: Orientation) -> CubeLookup {
        let mean = means_to_judge_by(self.mean);
        let errors: Vec<[f64; 3]> = (self.directions.par_iter().zip(&self.truth))
            .map(|(direction, truth)| {
                let seen = filtered(orientation.lookup(*direction));
                std::array::from_fn(|c| relative_error(seen[c], truth[c], mean[c]))
            })
            .collect();
        let (mut squares, mut max, mut worst) = (0.0, 0.0_f64, 0);
        for (i, (error, weight)) in errors.iter().zip(&self.weights).enumerate() {
            squares += weight * error.iter().map(|e| e * e).sum::<f64>() / 3.0;
            // NaN must not hide.
            let largest = error.iter().fold(0.0_f64, |m, e| if e.is_nan() { f64::INFINITY } else { m.max(*e) });
            if largest > max {
                (max, worst) = (largest, i);
            }
        }
        let direction = self.directions[worst];
        CubeLookup {
            rms: squares.sqrt(),
            max,
            worst_towards: direction.to_array(),
            worst_face: FACES[locate(orientation.lookup(direction)).0].to_owned(),
            points: self.directions.len(),
        }
    }
}

/// A point in each stratum, and the parts of the sphere that they stand for.
fn points(seed: u64) -> (Vec<DVec3>, Vec<f64>) {
    // Roberts's R2 sequence: the plastic number's powers, evenly spread in two dimensions.
    const R2: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];
    let start = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
    let (mut directions, mut weights) = (vec![], vec![]);
    for i in 0..6 * STRATA * STRATA {
        let (face, row, column) = (i / (STRATA * STRATA), i / STRATA % STRATA, i % STRATA);
        let place = |cell: usize, step: f64| {
            let within = (0.5 + step * (start + i as u64) as f64).fract();
            2.0 * (cell as f64 + within) / STRATA as f64 - 1.0
        };
        let point = face_point(face, place(column, R2[0]), place(row, R2[1]));
        weights.push(1.0 / (point.length_squared() * point.length()));
        directions.push(point.normalize());
    }
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|weight| *weight /= total);
    (directions, weights)
}

/// Texels that are looked at closely.
const CLOSE: usize = 48;

/// Of a map that is no cube, as the vectors that are looked up: see [`around_bends`].
fn around_bends_of_map(map: &SphereMap, mean: [f64; 3]) -> Vec<DVec3> {
    let (layout, size) = (map.layout, map.size);
    let ([width, _], _) = layout.shape(size);
    let bend = |i: usize| {
        let (column, row) = ((i % width) as isize, (i / width) as isize);
        let value = |x: isize, y: isize| map.texels[layout.texel(size, column + x, row + y)];
        largest_bend(map.texels[i], &[(value(-1, 0), value(1, 0)), (value(0, -1), value(0, 1))], mean)
    };
    let mut directions = vec![];
    for texel in most_bent(map.texels.len(), bend) {
        let [x, y] = [texel % width, texel / width].map(|i| i as f64);
        for (i, j) in [-0.5, 0.0, 0.5].into_iter().flat_map(|j| [-0.5, 0.0, 0.5].map(|i| (i, j))) {
            directions.push(layout.direction_at(size, [x + i, y + j]));
        }
    }
    directions
}

/// h² f″ along either axis, in parts of the value: of a texel between pairs of neighbours.
fn largest_bend(texel: [f32; 3], pairs: &[([f32; 3], [f32; 3]); 2], mean: [f64; 3]) -> f64 {
    let mut largest = 0.0_f64;
    for c in 0..3 {
        let middle = f64::from(texel[c]);
        let scale = error_scale(middle, mean[c]).max(f64::MIN_POSITIVE);
        for (a, b) in pairs {
            largest = largest.max((f64::from(a[c]) + f64::from(b[c]) - 2.0 * middle).abs() / scale);
        }
    }
    largest
}

/// The texels with the largest bends, in their order.
fn most_bent(n_texels: usize, bend: impl Fn(usize) -> f64 + Sync) -> Vec<usize> {
    let mut bends: Vec<(f64, usize)> = (0..n_texels).into_par_iter().map(|i| (bend(i), i)).collect();
    let n = CLOSE.min(bends.len());
    bends.select_nth_unstable_by(n - 1, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut chosen: Vec<usize> = bends[..n].iter().map(|bend| bend.1).collect();
    chosen.sort_unstable();
    chosen
}

/// Points around the texels where the cube bends most, and blending does worst: at the centre, which fitting moves, and half a texel
/// away in either direction, where exact texels are furthest off.
fn around_bends(cube: &Cube, mean: [f64; 3]) -> Vec<DVec3> {
    let (size, area) = (cube.size, cube.size * cube.size);
    let bend = |i: usize| {
        let (face, row, column) = (i / area, (i / size % size) as isize, (i % size) as isize);
        let value = |column: isize, row: isize| cube.texels[texel(size, face, column, row).unwrap_or(i)];
        let pairs =
            [(value(column - 1, row), value(column + 1, row)), (value(column, row - 1), value(column, row + 1))];
        largest_bend(cube.texels[i], &pairs, mean)
    };
    let half = 1.0 / size as f64;
    let mut directions = vec![];
    for texel in most_bent(cube.texels.len(), bend) {
        let (face, u, v) = locate(texel_direction(size, texel));
        for (i, j) in [-1.0, 0.0, 1.0].into_iter().flat_map(|j| [-1.0, 0.0, 1.0].map(|i| (i, j))) {
            directions.push(face_point(face, u + half * i, v + half * j).normalize());
        }
    }
    directions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sobol::PointSet;

    fn random_cube(size: usize) -> Cube {
        let points = PointSet::<3>::new(5, 0, 6 * size * size);
        Cube { size, texels: points.points().iter().map(|p| p.map(|v| v as f32)).collect() }
    }

    #[test]
    fn a_constant_stays_what_it_is_to_the_last_bit() {
        for size in [1, 2, 3, 16] {
            let cube = Cube { size, texels: vec![[0.1, 1.0, 3e4]; 6 * size * size] };
            for direction in points(1).0 {
                assert_eq!(cube.filtered(direction), cube.texels[0].map(f64::from), "size {size}, {direction}");
                let weights = Taps::towards(size, direction).weights;
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-15 && weights.iter().all(|w| *w >= 0.0));
            }
        }
    }

    #[test]
    fn texel_centres_show_their_texel() {
        for size in [1, 2, 7, 16] {
            let cube = random_cube(size);
            for i in 0..cube.texels.len() {
                let seen = cube.filtered(texel_direction(size, i));
                for c in 0..3 {
                    // The position is off by some ulp of the size, times the difference to the neighbours, at most 1.
                    let off = (seen[c] - f64::from(cube.texels[i][c])).abs();
                    assert!(off < 8.0 * f64::EPSILON * size as f64, "size {size}, texel {i}: {seen:?}");
                }
            }
        }
    }

    /// From either side of an edge, and of a corner, the same colour: steps of 1e-9 may change it by a slope of size/2 in each of two
    /// directions times that.
    #[test]
    fn edges_and_corners_are_continuous() {
        for size in [1, 2, 5, 16] {
            let cube = random_cube(size);
            let along = (0..=200).map(|i| -1.0 + f64::from(i) / 100.0);
            for (t, axes) in along.flat_map(|t| [(t, 0), (t, 1), (t, 2)]) {
                for signs in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
                    let mut edge = [t; 3];
                    (edge[(axes + 1) % 3], edge[(axes + 2) % 3]) = (signs[0], signs[1]);
                    let seen = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z]
                        .map(|away| cube.filtered(DVec3::from(edge) + 1e-9 * away));
                    for other in &seen[1..] {
                        for c in 0..3 {
                            let step = (other[c] - seen[0][c]).abs();
                            assert!(step < 4e-9 * size as f64, "size {size}, {edge:?}: a step of {step}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_corner_is_the_mean_of_three() {
        let cube = random_cube(4);
        let towards = |x: f64, y: f64, z: f64| cube.nearest(DVec3::new(x, y, z))[0];
        let wanted = (towards(1.0, 0.9, 0.9) + towards(0.9, 1.0, 0.9) + towards(0.9, 0.9, 1.0)) / 3.0;
        assert!((cube.filtered(DVec3::ONE)[0] - f64::from(wanted)).abs() < 1e-7);
    }

    #[test]
    fn every_edge_has_its_pairs_once_and_they_touch() {
        for size in [2, 5, 16] {
            let pairs = across_edges(size);
            assert_eq!(pairs.len(), 12 * size);
            for [inside, edge, other, beyond] in pairs {
                let [a, b, c, d] = [inside, edge, other, beyond].map(|i| texel_direction(size, i));
                assert_ne!(edge / (size * size), other / (size * size));
                assert_eq!([inside / (size * size), beyond / (size * size)], [edge, other].map(|i| i / (size * size)));
                let texel = 2.2 / size as f64;
                assert!(b.distance(c) < texel && a.distance(b) < texel && c.distance(d) < texel, "size {size}");
                assert!(a.distance(c) > b.distance(c) && b.distance(d) > b.distance(c), "size {size}");
            }
        }
    }
}
