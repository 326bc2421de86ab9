//! Cubes made for bilinear filtering: texels whose blend comes closest to the filtered function, at no cost at run time.
//!
//! Least squares over the sphere ([`crate::math::fit`]), weighed by solid angle and by 1/s², s = the mean of the three channels in
//! parts of their means (or [`DARK_FLOOR`]): errors count in parts of the value, as they are reported and as an eye that adapts sees
//! them. One weight serves all channels, so that grey stays grey.

use serde::{Deserialize, Serialize};

use super::chain::DARK_FLOOR;
use super::cube::{Cube, face_point};
use super::panorama::Panorama;
use super::seamless::{CubeLookup, Probe, Taps};
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
    let Sampled { problem, moments } = sample(function, &exact, panorama);
    let (low, high) = (panorama.min(), panorama.max());
    let mut fitted = exact.clone();
    let (mut steps, mut bounded) = (0, 0);
    for c in 0..3 {
        let start: Vec<f64> = exact.texels.iter().map(|texel| f64::from(texel[c])).collect();
        let result = problem.solve(&start, &moments[c], [f64::from(low[c]), f64::from(high[c])]);
        (steps, bounded) = (steps + result.steps, bounded + result.bounded);
        for (texel, value) in fitted.texels.iter_mut().zip(result.values) {
            texel[c] = value as f32;
        }
    }
    let (before, after) = (probe.judge(&exact), probe.judge(&fitted));
    let kept = after.rms < before.rms;
    let report = CubeFit { kept, exact: before, fitted: after, steps, bounded };
    (if kept { fitted } else { exact }, report)
}

/// The least-squares problem of a cube, and the moments of each channel.
struct Sampled {
    problem: LeastSquares<4>,
    moments: [Vec<[f64; 4]>; 3],
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
    let means = panorama.mean();
    let mut cells = Vec::with_capacity(6 * n * n);
    let mut moments: [Vec<[f64; 4]>; 3] = std::array::from_fn(|_| Vec::with_capacity(6 * n * n));
    // A row of cells at a time, so that no list of all points is ever held.
    for (face, row) in (0..6).flat_map(|face| (0..n).map(move |row| (face, row))) {
        let mut places: Vec<(DVec3, Taps, f64)> = Vec::with_capacity(n * per_cell);
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
        let directions: Vec<DVec3> = places.iter().map(|place| place.0).collect();
        let values = function.values(&directions);
        for (places, values) in places.chunks_exact(per_cell).zip(values.chunks_exact(per_cell)) {
            let mut cell = Cell::new(places[0].1.texels.map(|texel| texel as u32));
            let mut moment = [[0.0; 4]; 3];
            for ((_, taps, area), value) in places.iter().zip(values) {
                let parts: Vec<f64> =
                    (0..3).filter(|&c| means[c] > 0.0).map(|c| value[c].max(0.0) / means[c]).collect();
                let bright = parts.iter().sum::<f64>() / parts.len().max(1) as f64;
                let area = area / bright.max(DARK_FLOOR).powi(2);
                cell.add(&taps.weights, area);
                let seen = taps.blend(&exact.texels);
                for c in 0..3 {
                    (0..4).for_each(|k| moment[c][k] += area * taps.weights[k] * (value[c] - seen[c]));
                }
            }
            cells.push(cell);
            (0..3).for_each(|c| moments[c].push(moment[c]));
        }
    }
    Sampled { problem: LeastSquares::new(exact.texels.len(), cells), moments }
}
