//! Tables made for bilinear filtering: texels whose blend comes closest to the quantities, in least squares.
//!
//! Every part of the texture counts alike: what is made small is the square of the error over the texture coordinates, the halves
//! of the outermost texels, where samplers clamp, included. Values stay within the quantity's bounds.

use super::bake::{Table, TableSpec};
use super::lookup::{LookupError, Taps, Truth, lookup_errors, parameters};
use crate::error::Result;
use crate::math::fit::{Cell, LeastSquares};
use crate::math::quadrature::{Rule, gauss_legendre};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What a fit did to a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableFit {
    /// Whether the texels are the fitted ones; all channels keep exact ones unless each is better, and none worse.
    pub kept: bool,
    /// The lookup error of exact texels, before packing.
    pub exact: LookupError,
    /// The same of fitted ones.
    pub fitted: LookupError,
    /// Steps of the solver.
    pub steps: usize,
    /// Texels that stand at a bound of the quantity.
    pub bounded: usize,
}

/// Texels along an axis from which two Gauss points to a cell are enough; they integrate the curvature that the fit removes.
const FINE: usize = 96;

/// Puts fitted texels into a table, if they are better; what came of it, channel by channel.
///
/// **Errors**: those of the integrators.
pub fn fit(table: &mut Table) -> Result<Vec<TableFit>> {
    let fitted = match table.spec.axes.len() {
        1 => solve::<2>(table)?,
        2 => solve::<4>(table)?,
        _ => solve::<8>(table)?,
    };
    let n = table.spec.channels.len();
    let mut values = table.values.clone();
    for (c, fitted) in fitted.iter().enumerate() {
        values.iter_mut().skip(c).step_by(n).zip(&fitted.values).for_each(|(value, fitted)| *value = *fitted);
    }
    let seen = |values: &[f64]| lookup_errors(&table.spec, &values.iter().map(|&v| v as f32).collect::<Vec<f32>>());
    let (before, after) = (seen(&table.values)?, seen(&values)?);
    let pairs = || before.iter().zip(&after);
    let kept = pairs().all(|(b, a)| a.rms <= b.rms) && pairs().any(|(b, a)| a.rms < b.rms);
    if kept {
        table.values = values;
    }
    let report = |((exact, after), fitted): ((LookupError, LookupError), Solved)| TableFit {
        kept,
        exact,
        fitted: after,
        steps: fitted.steps,
        bounded: fitted.bounded,
    };
    Ok(before.into_iter().zip(after).zip(fitted).map(report).collect())
}

type Solved = crate::math::fit::Fitted;

fn solve<const N: usize>(table: &Table) -> Result<Vec<Solved>> {
    let spec = &table.spec;
    let (truth, n) = (Truth::new(spec)?, spec.channels.len());
    let intervals: Vec<Vec<[f64; 2]>> = (0..spec.axes.len()).map(|axis| intervals(spec, axis)).collect();
    let points = if spec.axes.iter().any(|axis| axis.size >= FINE) || N == 8 { 2 } else { 3 };
    let rule = gauss_legendre(points);
    let n_cells: usize = intervals.iter().map(Vec::len).product();
    let cells: Vec<(Cell<N>, Vec<[f64; N]>)> = (0..n_cells)
        .into_par_iter()
        .map(|index| {
            let mut rest = index;
            let bounds: Vec<[f64; 2]> = intervals
                .iter()
                .map(|along| {
                    let interval = along[rest % along.len()];
                    rest /= along.len();
                    interval
                })
                .collect();
            cell::<N>(table, &truth, &bounds, &rule)
        })
        .collect::<Result<_>>()?;
    let (cells, moments): (Vec<Cell<N>>, Vec<Vec<[f64; N]>>) = cells.into_iter().unzip();
    let problem = LeastSquares::new(spec.len(), cells);
    let channel = |c: usize| {
        let start: Vec<f64> = table.values.iter().copied().skip(c).step_by(n).collect();
        let moments: Vec<[f64; N]> = moments.iter().map(|cell| cell[c]).collect();
        let (low, high) = spec.channels[c].bounds();
        problem.solve(&start, &moments, [low, high])
    };
    Ok((0..n).map(channel).collect())
}

/// The stretches of an axis, in texels, over which the same two texels are blended.
fn intervals(spec: &TableSpec, axis: usize) -> Vec<[f64; 2]> {
    let axis = &spec.axes[axis];
    let (low, high) = axis.ends();
    let (p, q) = (axis.position(low), axis.position(high));
    let mut cuts: Vec<f64> = (0..axis.size).map(|i| i as f64).collect();
    cuts.extend([p.min(q), p.max(q)]);
    cuts.sort_by(f64::total_cmp);
    // Rounding must not leave slivers.
    cuts.windows(2).map(|pair| [pair[0], pair[1]]).filter(|[a, b]| b - a > 1e-6).collect()
}

/// A cell, and each channel's moments about the table.
fn cell<const N: usize>(
    table: &Table,
    truth: &Truth,
    bounds: &[[f64; 2]],
    rule: &Rule,
) -> Result<(Cell<N>, Vec<[f64; N]>)> {
    let (spec, n) = (&table.spec, table.spec.channels.len());
    let sizes: Vec<usize> = spec.axes.iter().map(|axis| axis.size).collect();
    let middle: Vec<f64> = bounds.iter().map(|[a, b]| 0.5 * (a + b)).collect();
    let nodes = Taps::<N>::at(&sizes, &middle).texels;
    let mut cell = Cell::new(nodes.map(|texel| texel as u32));
    let mut moments = vec![[0.0; N]; n];
    let k = rule.nodes.len();
    for index in 0..k.pow(bounds.len() as u32) {
        let (mut rest, mut area, mut position) = (index, 1.0, vec![]);
        for [a, b] in bounds {
            let (node, weight) = (rule.nodes[rest % k], rule.weights[rest % k]);
            position.push(a + node * (b - a));
            area *= weight * (b - a);
            rest /= k;
        }
        // A place where a quantity diverges asks for nothing.
        let Some(wanted) = truth.at(&parameters(spec, &position))? else { continue };
        let taps = Taps::<N>::at(&sizes, &position);
        cell.add(&taps.weights, area);
        for (c, moment) in moments.iter_mut().enumerate() {
            let value = |texel: usize| table.values[texel * n + c];
            let first = value(taps.texels[0]);
            let seen = first + (1..N).map(|j| taps.weights[j] * (value(taps.texels[j]) - first)).sum::<f64>();
            (0..N).for_each(|j| moment[j] += area * taps.weights[j] * (wanted[c] - seen));
        }
    }
    Ok((cell, moments))
}
