//! What a shader sees: the error of a table through bilinear filtering.

use super::bake::TableSpec;
use super::quantity::Point;
use crate::error::{Error, Result};
use crate::integrate::{Integration, Settings};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The error of one channel, looked up with bilinear filtering and clamped coordinates, over a dense grid of the whole domain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LookupError {
    /// The quantity.
    pub channel: String,
    /// Largest |lookup − truth|.
    pub max: f64,
    /// Root mean square over the grid.
    pub rms: f64,
    /// The parameters at the largest, axis by axis.
    pub worst_at: Vec<f64>,
}

/// Cells per axis that are looked into at most; larger tables are looked into at evenly spread cells.
const MOST_CELLS: usize = 64;
/// Positions in the outermost cells, in parts of a cell: that is where linear interpolation fails.
const OUTER: [f64; 5] = [0.08, 0.25, 0.5, 0.75, 0.92];

/// Positions along an axis of `size` texels: the middle of the cells, more in the outermost cells at both ends.
fn positions(size: usize, first: f64, last: f64) -> Vec<f64> {
    let mut positions = vec![first, last];
    let cells = size.saturating_sub(1);
    let step = cells.div_ceil(MOST_CELLS).max(1);
    for cell in 0..cells {
        let outer = cell < 2 || cell + 2 >= cells;
        if outer {
            positions.extend(OUTER.map(|f| cell as f64 + f));
        } else if cell % step == 0 {
            positions.push(cell as f64 + 0.5);
        }
    }
    positions.sort_by(f64::total_cmp);
    positions
}

/// `texels` is what the file holds (packed and unpacked again), channel fastest.
///
/// **Errors**: those of the deterministic integrator, which is the truth here.
pub fn lookup_errors(spec: &TableSpec, texels: &[f32]) -> Result<Vec<LookupError>> {
    let truth = Integration::new(Settings::default())?;
    let per_axis: Vec<Vec<f64>> = spec
        .axes
        .iter()
        .map(|a| {
            // The ends of the domain: half a texel outside the outermost centres, or the outermost texels themselves.
            let (low, high) = a.parameter.domain();
            let (p, q) = (a.position(low), a.position(high));
            positions(a.size, p.min(q), p.max(q))
        })
        .collect();
    let one = vec![0.0];
    let ys = per_axis.get(1).unwrap_or(&one);
    let (channels, evaluator) = (spec.channels.len(), spec.evaluator());
    let rows: Vec<Vec<(Vec<f64>, Vec<f64>)>> = ys
        .par_iter()
        .map(|&y| {
            per_axis[0]
                .iter()
                .map(|&x| {
                    let mut at = Point::default();
                    let place: Vec<f64> =
                        spec.axes.iter().zip([x, y]).map(|(axis, p)| axis.value_at_position(p)).collect();
                    for (axis, value) in spec.axes.iter().zip(&place) {
                        at.set(axis.parameter, *value);
                    }
                    let seen = bilinear(texels, spec.width(), spec.height(), channels, x, y);
                    match evaluator.at(&at, &truth) {
                        Ok(exact) => {
                            Ok(Some((exact.iter().zip(seen).map(|(e, seen)| seen - e.value).collect(), place)))
                        }
                        // A place where the quantity diverges has no error.
                        Err(Error::Unsupported(_)) => Ok(None),
                        Err(other) => Err(other),
                    }
                })
                .filter_map(Result::transpose)
                .collect::<Result<_>>()
        })
        .collect::<Result<_>>()?;
    Ok((0..channels)
        .map(|c| {
            let (mut max, mut squares, mut n, mut worst_at) = (0.0_f64, 0.0, 0.0, vec![]);
            for (errors, place) in rows.iter().flatten() {
                squares += errors[c] * errors[c];
                n += 1.0;
                if errors[c].abs() > max || worst_at.is_empty() {
                    (max, worst_at) = (errors[c].abs(), place.clone());
                }
            }
            let channel = spec.channels[c].quantity.name.to_owned();
            LookupError { channel, max, rms: (squares / f64::max(n, 1.0)).sqrt(), worst_at }
        })
        .collect())
}

/// Bilinear interpolation at a position in texels, coordinates clamped to the outermost texels as samplers do.
fn bilinear(texels: &[f32], width: usize, height: usize, channels: usize, x: f64, y: f64) -> Vec<f64> {
    let split = |p: f64, n: usize| {
        let p = p.clamp(0.0, (n - 1) as f64);
        let low = (p.floor() as usize).min(n.saturating_sub(2));
        (low, (low + 1).min(n - 1), p - low as f64)
    };
    let ((x0, x1, fx), (y0, y1, fy)) = (split(x, width), split(y, height));
    let at = |x: usize, y: usize, c: usize| f64::from(texels[(y * width + x) * channels + c]);
    (0..channels)
        .map(|c| {
            let low = at(x0, y0, c) * (1.0 - fx) + at(x1, y0, c) * fx;
            let high = at(x0, y1, c) * (1.0 - fx) + at(x1, y1, c) * fx;
            low * (1.0 - fy) + high * fy
        })
        .collect()
}
