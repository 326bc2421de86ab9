//! Cubes made for bilinear filtering: texels whose blend comes closest to the filtered function, at no cost at run time.
//!
//! Least squares over the sphere ([`crate::math::fit`]), weighed by solid angle and by 1/s², s = the mean of the three channels in
//! parts of their means (or [`DARK_FLOOR`]): errors count in parts of the value, as they are reported and as an eye that adapts sees
//! them. One weight serves all channels, so that grey stays grey.

use serde::{Deserialize, Serialize};

use super::chain::DARK_FLOOR;
use super::cube::{Cube, face_point};
use super::orientation::Orientation;
use super::panorama::Panorama;
use super::seamless::{CubeLookup, Probe, Taps};
use super::sphere_map::SphereMap;
use super::zonal::Function;
use crate::math::fit::{Cell, LeastSquares};
use crate::math::quadrature::gauss_legendre;
use glam::DVec3;

/// What a fit did to a level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CubeFit {
    /// Whether the texels are the fitted ones; exact ones are kept if they do no worse.
    pub kept: bool,
    /// The lookup error of exact texels, before packing.
    pub exact: CubeLookup,
    /// The same of fitted ones.
    pub fitted: CubeLookup,
    /// Steps of the solver.
    pub steps: usize,
    /// Texels that stand at the darkest or the brightest value of the input, in all channels.
    pub bounded: usize,
}

/// Gauss points along each side of a cell. Two integrate cubics, and so the curvature that the fit removes; where cells are large
/// against what they hold, more see more.
fn points_per_cell(size: usize) -> usize {
    match size {
        64.. => 2,
        32.. => 3,
        _ => 4,
    }
}

/// The cube whose lookup is closest to a function, and how much closer it is than `exact`, which holds the function at its texel
/// centres; `exact` itself if that is no worse.
pub(super) fn fit(function: &Function, exact: Cube, panorama: &Panorama, probe: &Probe) -> (Cube, CubeFit) {
    let (texels, steps, bounded) = sample(function, &exact, panorama).solve(&exact.texels, panorama);
    let fitted = Cube { size: exact.size, texels };
    let (before, after) = (probe.judge(&exact), probe.judge(&fitted));
    let kept = after.rms < before.rms;
    let report = CubeFit { kept, exact: before, fitted: after, steps, bounded };
    (if kept { fitted } else { exact }, report)
}

/// The same of a map of another layout, turned.
pub(super) fn fit_map(
    function: &Function,
    exact: SphereMap,
    orientation: &Orientation,
    panorama: &Panorama,
    probe: &Probe,
) -> (SphereMap, CubeFit) {
    let (texels, steps, bounded) = sample_map(function, &exact, orientation, panorama).solve(&exact.texels, panorama);
    let fitted = SphereMap { texels, ..exact };
    let (before, after) = (probe.judge_turned(&exact, *orientation), probe.judge_turned(&fitted, *orientation));
    let kept = after.rms < before.rms;
    let report = CubeFit { kept, exact: before, fitted: after, steps, bounded };
    (if kept { fitted } else { exact }, report)
}

/// The least-squares problem of a cube, and the moments of each channel.
struct Sampled {
    problem: LeastSquares<4>,
    moments: [Vec<[f64; 4]>; 3],
}

/// A point of a cell: the world's direction, what a sampler blends there, and its part of the sphere.
type Place = (DVec3, Taps, f64);

impl Sampled {
    /// The best texels, from exact ones on; the solver's steps, and texels at the panorama's extremes.
    fn solve(&self, exact: &[[f32; 3]], panorama: &Panorama) -> (Vec<[f32; 3]>, usize, usize) {
        let (low, high) = (panorama.min(), panorama.max());
        let mut fitted = exact.to_vec();
        let (mut steps, mut bounded) = (0, 0);
        for c in 0..3 {
            let start: Vec<f64> = exact.iter().map(|texel| f64::from(texel[c])).collect();
            let result = self.problem.solve(&start, &self.moments[c], [f64::from(low[c]), f64::from(high[c])]);
            (steps, bounded) = (steps + result.steps, bounded + result.bounded);
            for (texel, value) in fitted.iter_mut().zip(result.values) {
                texel[c] = value as f32;
            }
        }
        (fitted, steps, bounded)
    }
}

/// Cells and their moments on the way into a [`Sampled`].
struct Sampling<'a> {
    function: &'a Function<'a>,
    exact: &'a [[f32; 3]],
    means: [f64; 3],
    cells: Vec<Cell<4>>,
    moments: [Vec<[f64; 4]>; 3],
}

impl<'a> Sampling<'a> {
    fn new(function: &'a Function<'a>, exact: &'a [[f32; 3]], panorama: &Panorama) -> Self {
        Self { function, exact, means: panorama.mean(), cells: vec![], moments: [vec![], vec![], vec![]] }
    }

    /// Adds cells of `per_cell` points each.
    fn add(&mut self, places: &[Place], per_cell: usize) {
        let directions: Vec<DVec3> = places.iter().map(|place| place.0).collect();
        let values = self.function.values(&directions);
        for (places, values) in places.chunks_exact(per_cell).zip(values.chunks_exact(per_cell)) {
            let mut cell = Cell::new(places[0].1.texels.map(|texel| texel as u32));
            let mut moment = [[0.0; 4]; 3];
            for ((_, taps, area), value) in places.iter().zip(values) {
                let lit = (0..3).filter(|&c| self.means[c] > 0.0);
                let parts: Vec<f64> = lit.map(|c| value[c].max(0.0) / self.means[c]).collect();
                let bright = parts.iter().sum::<f64>() / parts.len().max(1) as f64;
                let area = area / bright.max(DARK_FLOOR).powi(2);
                cell.add(&taps.weights, area);
                let seen = taps.blend(self.exact);
                for c in 0..3 {
                    (0..4).for_each(|k| moment[c][k] += area * taps.weights[k] * (value[c] - seen[c]));
                }
            }
            self.cells.push(cell);
            (0..3).for_each(|c| self.moments[c].push(moment[c]));
        }
    }

    fn finish(self) -> Sampled {
        Sampled { problem: LeastSquares::new(self.exact.len(), self.cells), moments: self.moments }
    }
}

/// Of a map that is no cube: cells end at texel centres and at the border, and have their own four texels each.
fn sample_map(function: &Function, exact: &SphereMap, orientation: &Orientation, panorama: &Panorama) -> Sampled {
    let (layout, size) = (exact.layout, exact.size);
    let ([width, height], _) = layout.shape(size);
    let rule = gauss_legendre(points_per_cell(size));
    let cut = |i: usize, n: usize| match i {
        0 => -0.5,
        i if i == n + 1 => n as f64 - 0.5,
        i => i as f64 - 1.0,
    };
    let per_cell = rule.nodes.len().pow(2);
    let mut sampling = Sampling::new(function, &exact.texels, panorama);
    for row in 0..=height {
        let mut places: Vec<Place> = Vec::with_capacity((width + 1) * per_cell);
        let (y0, y1) = (cut(row, height), cut(row + 1, height));
        for column in 0..=width {
            let (x0, x1) = (cut(column, width), cut(column + 1, width));
            for (t, dy) in rule.iter() {
                for (s, dx) in rule.iter() {
                    let at = [x0 + s * (x1 - x0), y0 + t * (y1 - y0)];
                    let area = dx * (x1 - x0) * dy * (y1 - y0) * layout.density(size, at);
                    let direction = layout.direction_at(size, at);
                    places.push((orientation.world(direction), layout.taps_at(size, at), area));
                }
            }
        }
        sampling.add(&places, per_cell);
    }
    sampling.finish()
}

fn sample(function: &Function, exact: &Cube, panorama: &Panorama) -> Sampled {
    let size = exact.size;
    let rule = gauss_legendre(points_per_cell(size));
    // A face is cut at texel centres and ends at its edges: (size + 1)² parts that have their own four texels each.
    let cut = |i: usize| match i {
        0 => -1.0,
        i if i == size + 1 => 1.0,
        i => (2.0 * i as f64 - 1.0 - size as f64) / size as f64,
    };
    let n = size + 1;
    let per_cell = rule.nodes.len().pow(2);
    let mut sampling = Sampling::new(function, &exact.texels, panorama);
    // A row of cells at a time, so that no list of all points is ever held.
    for (face, row) in (0..6).flat_map(|face| (0..n).map(move |row| (face, row))) {
        let mut places: Vec<Place> = Vec::with_capacity(n * per_cell);
        let (v0, v1) = (cut(row), cut(row + 1));
        for column in 0..n {
            let (u0, u1) = (cut(column), cut(column + 1));
            for (t, dv) in rule.iter() {
                for (s, du) in rule.iter() {
                    let (u, v) = (u0 + s * (u1 - u0), v0 + t * (v1 - v0));
                    let point = face_point(face, u, v);
                    let area = du * (u1 - u0) * dv * (v1 - v0) / (point.length_squared() * point.length());
                    places.push((point.normalize(), Taps::on_face(size, face, u, v), area));
                }
            }
        }
        sampling.add(&places, per_cell);
    }
    sampling.finish()
}
