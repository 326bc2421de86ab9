//! What a shader sees: the error of a table through bilinear filtering.

use super::axis::Axis;
use super::bake::{Evaluator, TableSpec};
use super::quantity::Point;
use crate::error::{Error, Result};
use crate::integrate::{Integration, Settings};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The error of one channel, looked up with bilinear filtering and clamped coordinates, over a dense grid of the whole domain.
///
/// The figures are right to within 1e-5, or a thousandth of the largest error where that is more; where only Monte Carlo knows the truth,
/// to within its error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LookupError {
    /// The quantity.
    pub channel: String,
    /// Largest |lookup − truth|.
    pub max: f64,
    /// Root mean square over the grid.
    pub rms: f64,
    /// The parameters at the largest.
    pub worst_at: Point,
}

/// Cells per axis that are looked into at most; larger tables are looked into at evenly spread cells. A volume gets fewer, so
/// that looking takes no longer than baking.
const MOST_CELLS: [usize; 3] = [64, 64, 16];
/// Positions in the outermost cells, in parts of a cell: that is where linear interpolation fails.
const OUTER: [f64; 5] = [0.08, 0.25, 0.5, 0.75, 0.92];
/// What the truth is integrated to at first: to what the coarsest rules promise, which are far better than that.
const COARSE: f64 = 1e-2;
/// What it is integrated to where a channel is off by most, and at one place of so many, which is no multiple of a row's usual length.
const TRUTH: f64 = 1e-5;
const CONFIRMED: usize = 19;
/// By how much the two may differ, in parts of the largest error, where that is more than [`TRUTH`].
const DIGITS: f64 = 1e-3;
/// Samples of the truth where only Monte Carlo knows it: enough for 1e-3 or better.
const TRUTH_SAMPLES: u64 = 4096;

/// Positions along an axis of `size` texels: the middle of the cells, more in the outermost cells at both ends.
fn positions(size: usize, first: f64, last: f64, n_axes: usize) -> Vec<f64> {
    let mut positions = vec![first, last];
    let cells = size.saturating_sub(1);
    let step = cells.div_ceil(MOST_CELLS[n_axes - 1]).max(1);
    for cell in 0..cells {
        let outer = cell < 2 || cell + 2 >= cells;
        if outer && n_axes < 3 {
            positions.extend(OUTER.map(|f| cell as f64 + f));
        } else if outer || cell % step == 0 {
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
    let mut places = look(spec, texels, grid(spec), &Truth::within(spec, COARSE)?)?;
    let n = spec.channels.len();
    // The coarse truth is believed where a fine one agrees with it, and that is looked at where it matters most, too.
    let worst: Vec<usize> = (0..n).map(|c| worst(&places, c)).collect();
    let limits: Vec<f64> = worst
        .iter()
        .enumerate()
        .map(|(c, &i)| places.get(i).map_or(0.0, |p| DIGITS * p.errors[c].abs()).max(TRUTH))
        .collect();
    let fine = Truth::new(spec)?;
    let look_again = |places: &mut [Place], again: &[usize]| -> Result<Vec<Vec<f64>>> {
        let positions = again.iter().map(|&i| places[i].position.clone()).collect();
        // Where a quantity diverges was left out before, so that each place is found again.
        let found = look(spec, texels, positions, &fine)?;
        Ok(again.iter().zip(found).map(|(&i, fine)| std::mem::replace(&mut places[i], fine).errors).collect())
    };
    let again: Vec<usize> = (0..places.len()).filter(|i| i % CONFIRMED == 0 || worst.contains(i)).collect();
    let coarse = look_again(&mut places, &again)?;
    // Where it does not, it is believed nowhere along the axes through that place.
    let agree = |a: &[f64], b: &[f64]| (0..n).all(|c| (a[c] - b[c]).abs() <= limits[c]);
    let doubted: Vec<Vec<f64>> = again
        .iter()
        .zip(&coarse)
        .filter(|(i, coarse)| !agree(&places[**i].errors, coarse))
        .map(|(&i, _)| places[i].position.clone())
        .collect();
    let doubtful = |place: &Place| {
        doubted.iter().any(|doubted| doubted.iter().zip(&place.position).any(|(doubted, p)| doubted == p))
    };
    let again: Vec<usize> = (0..places.len()).filter(|&i| doubtful(&places[i])).collect();
    look_again(&mut places, &again)?;
    Ok((0..n).map(|c| summary(spec, &places, c)).collect())
}

/// A place between the texels, in texels along each axis, and the lookup of every channel less its truth.
struct Place {
    position: Vec<f64>,
    errors: Vec<f64>,
}

/// The positions of the dense grid, the first axis fastest.
fn grid(spec: &TableSpec) -> Vec<Vec<f64>> {
    let along = |axis: &Axis| {
        // The ends of the range: half a texel outside the outermost centres, or the outermost texels themselves.
        let (low, high) = axis.ends();
        let (p, q) = (axis.position(low), axis.position(high));
        positions(axis.size, p.min(q), p.max(q), spec.axes.len())
    };
    spec.axes.iter().rev().map(along).fold(vec![vec![]], |slower, along| {
        let with = |rest: &Vec<f64>| along.iter().map(|&p| [&[p], rest.as_slice()].concat()).collect::<Vec<_>>();
        slower.iter().flat_map(with).collect()
    })
}

/// The places at those positions, but for those where a quantity diverges.
fn look(spec: &TableSpec, texels: &[f32], positions: Vec<Vec<f64>>, truth: &Truth) -> Result<Vec<Place>> {
    let sizes: Vec<usize> = spec.axes.iter().map(|axis| axis.size).collect();
    let place = |position: Vec<f64>| {
        let Some(exact) = truth.at(&parameters(spec, &position))? else { return Ok(None) };
        let seen = linear(texels, &sizes, spec.channels.len(), &position);
        Ok(Some(Place { errors: seen.into_iter().zip(exact).map(|(seen, exact)| seen - exact).collect(), position }))
    };
    positions.into_par_iter().map(place).filter_map(Result::transpose).collect()
}

/// Where a channel is off by most.
fn worst(places: &[Place], channel: usize) -> usize {
    let off = |i: usize| places[i].errors[channel].abs();
    (1..places.len()).fold(0, |worst, i| if off(i) > off(worst) { i } else { worst })
}

fn summary(spec: &TableSpec, places: &[Place], channel: usize) -> LookupError {
    let squares: f64 = places.iter().map(|place| place.errors[channel] * place.errors[channel]).sum();
    let worst = places.get(worst(places, channel));
    LookupError {
        channel: spec.channels[channel].label(),
        max: worst.map_or(0.0, |place| place.errors[channel].abs()),
        rms: (squares / f64::max(places.len() as f64, 1.0)).sqrt(),
        worst_at: worst.map_or(Point::default(), |place| parameters(spec, &place.position)),
    }
}

/// What the quantities of a table are, anywhere.
pub(super) struct Truth {
    smooth: (Evaluator, Integration),
    rough: (Evaluator, Integration),
    /// Of each channel, whether quadrature knows it.
    is_smooth: Vec<bool>,
}

impl Truth {
    pub(super) fn new(spec: &TableSpec) -> Result<Self> {
        Self::within(spec, TRUTH)
    }

    fn within(spec: &TableSpec, tolerance: f64) -> Result<Self> {
        let by_tolerance = Integration::new(Settings { tolerance: Some(tolerance), ..Settings::default() })?;
        let by_samples = Integration::new(Settings { samples: Some(TRUTH_SAMPLES), ..Settings::default() })?;
        Ok(Self {
            smooth: (spec.evaluator_of(|h| h.family.has_quadrature()), by_tolerance),
            rough: (spec.evaluator_of(|h| !h.family.has_quadrature()), by_samples),
            is_smooth: spec.channels.iter().map(|h| h.family.has_quadrature()).collect(),
        })
    }

    /// One value per channel; nothing where a quantity diverges, which has no error there.
    pub(super) fn at(&self, at: &Point) -> Result<Option<Vec<f64>>> {
        let both = self.smooth.0.at(at, &self.smooth.1).and_then(|s| Ok((s, self.rough.0.at(at, &self.rough.1)?)));
        let (smooth, rough) = match both {
            Ok(both) => both,
            Err(Error::Unsupported(_)) => return Ok(None),
            Err(other) => return Err(other),
        };
        let chosen = |(c, &is_smooth): (usize, &bool)| if is_smooth { smooth[c].value } else { rough[c].value };
        let exact: Vec<f64> = self.is_smooth.iter().enumerate().map(chosen).collect();
        if exact.iter().any(|e| !e.is_finite()) {
            return Err(Error::unsupported(
                format!("the truth at {at} is not a finite number"),
                "report this as a bug, with the recipe",
            ));
        }
        Ok(Some(exact))
    }
}

/// The parameters at a position in texels.
pub(super) fn parameters(spec: &TableSpec, position: &[f64]) -> Point {
    let mut at = spec.at;
    for (axis, &p) in spec.axes.iter().zip(position) {
        axis.place(&mut at, p);
    }
    at
}

/// The texels that a sampler blends at a position, and their weights, which sum to 1: N is two to the number of axes.
pub(super) struct Taps<const N: usize> {
    pub texels: [usize; N],
    pub weights: [f64; N],
}

impl<const N: usize> Taps<N> {
    /// At a position in texels, coordinates clamped to the outermost texels as samplers do.
    pub(super) fn at(sizes: &[usize], position: &[f64]) -> Self {
        let mut taps = Self { texels: [0; N], weights: [1.0; N] };
        // Every corner of the cell: bit a of `corner` chooses the nearer or the farther texel along axis a.
        for corner in 0..N {
            let mut stride = 1;
            for (axis, (&size, &p)) in sizes.iter().zip(position).enumerate() {
                let p = p.clamp(0.0, (size - 1) as f64);
                let low = (p.floor() as usize).min(size.saturating_sub(2));
                let (fraction, far) = (p - low as f64, corner >> axis & 1);
                taps.weights[corner] *= if far == 1 { fraction } else { 1.0 - fraction };
                taps.texels[corner] += (low + far).min(size - 1) * stride;
                stride *= size;
            }
        }
        taps
    }
}

/// Linear interpolation along every axis at a position in texels, coordinates clamped to the outermost texels as samplers do.
fn linear(texels: &[f32], sizes: &[usize], channels: usize, position: &[f64]) -> Vec<f64> {
    match sizes.len() {
        1 => blend(texels, channels, &Taps::<2>::at(sizes, position)),
        2 => blend(texels, channels, &Taps::<4>::at(sizes, position)),
        _ => blend(texels, channels, &Taps::<8>::at(sizes, position)),
    }
}

fn blend<const N: usize>(texels: &[f32], channels: usize, taps: &Taps<N>) -> Vec<f64> {
    let mut seen = vec![0.0; channels];
    for (&index, &weight) in taps.texels.iter().zip(&taps.weights) {
        // A texel without weight must not turn an infinite or missing neighbour into NaN.
        if weight > 0.0 {
            for (c, seen) in seen.iter_mut().enumerate() {
                *seen += weight * f64::from(texels[index * channels + c]);
            }
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::quantity::find;

    #[test]
    fn interpolation_is_exact_for_what_is_linear_in_every_axis() {
        let sizes = [3, 4, 5];
        let f = |x: f64, y: f64, z: f64| 1.0 + 2.0 * x - 3.0 * y + 0.5 * z + x * y * z;
        let texels: Vec<f32> = (0..60).map(|i| f((i % 3) as f64, (i / 3 % 4) as f64, (i / 12) as f64) as f32).collect();
        for [x, y, z] in [[0.0, 0.0, 0.0], [0.5, 1.25, 3.75], [1.9, 2.1, 0.3], [2.0, 3.0, 4.0]] {
            let got = linear(&texels, &sizes, 1, &[x, y, z])[0];
            assert!((got - f(x, y, z)).abs() < 1e-12, "({x}, {y}, {z}): {got}");
        }
        assert_eq!(linear(&texels, &sizes, 1, &[-1.0, 5.0, 9.0])[0], f(0.0, 3.0, 4.0), "clamped");
    }

    #[test]
    fn figures_are_those_of_a_fine_truth_everywhere() {
        for (channels, axes) in [
            (&["ggx.scale", "ggx.bias"][..], &["mu:12", "roughness:12"][..]),
            (&["charlie.albedo"], &["mu:6", "roughness:6"]),
            (&["beckmann.albedo"], &["mu:5:edge", "alpha:5:edge"]),
            (&["dielectric.reflectance", "dielectric.transmittance"], &["mu:3", "roughness:3", "eta:3:0.5..2"]),
            (&["dielectric.reflectance_avg", "dielectric.transmittance_avg"], &["roughness:2", "eta:2:f0-fourth-root"]),
        ] {
            let spec = TableSpec {
                channels: channels.iter().map(|name| find(name).expect("a quantity")).collect(),
                axes: axes.iter().map(|axis| axis.parse().expect("an axis")).collect(),
                ..TableSpec::default()
            };
            let integration = Integration::new(Settings::default()).expect("settings");
            let table = spec.bake(&integration, &|_| {}).expect("a table");
            let texels: Vec<f32> = table.values.iter().map(|&v| v as f32).collect();
            let fine = look(&spec, &texels, grid(&spec), &Truth::new(&spec).expect("a truth")).expect("places");
            for (c, got) in lookup_errors(&spec, &texels).expect("figures").iter().enumerate() {
                let wanted = summary(&spec, &fine, c);
                let allowed = TRUTH.max(DIGITS * wanted.max);
                for (got, wanted) in [(got.max, wanted.max), (got.rms, wanted.rms)] {
                    assert!((got - wanted).abs() <= allowed, "{}: {got}, wanted {wanted}, {allowed:e}", channels[c]);
                }
            }
        }
    }
}
