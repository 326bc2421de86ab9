//! Trying every master over every simple arrangement of axes, on a choice of texels.

use super::hypothesis::{Choice, Data, Hypothesis, choice, table_order, taps};
use super::masters::{Master, Taps, along};
use super::ramp::{Place, Ramp, ramps};
use super::residual::{Sums, Wanted, encoding, sum};
use crate::claim::{Curve, Encoding};
use crate::math::warp::Warp;
use crate::table::Axis;
use rayon::prelude::*;
use std::sync::Arc;

/// Indices along each dimension while everything is tried.
const COARSE: [usize; 3] = [24, 9, 6];

/// Every way to let the dimensions vary parameters, each one of its own; `None` where the master has too few or too many.
pub(super) fn assignments(n_dimensions: usize, n_parameters: usize) -> Vec<Vec<usize>> {
    // With a parameter too many, its last is fixed: the index, the colour.
    if n_parameters < n_dimensions || n_parameters > n_dimensions + 1 || (n_dimensions == 1 && n_parameters == 2) {
        return vec![];
    }
    let mut all: Vec<Vec<usize>> = vec![vec![]];
    for _ in 0..n_dimensions {
        all = all
            .iter()
            .flat_map(|so_far| {
                (0..n_dimensions)
                    .filter(|p| !so_far.contains(p))
                    .map(|p| [so_far.as_slice(), &[p]].concat())
                    .collect::<Vec<_>>()
            })
            .collect();
    }
    all
}

/// Values that a parameter without a dimension is tried at, in parts of its nodes.
const FREE: [f64; 5] = [0.15, 0.35, 0.55, 0.75, 0.95];

/// What is tried of every dimension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrangement {
    /// The whole range, in every warp.
    Whole,
    /// The same, with the ends where nobody knows the range: what is beside them there is far from them.
    WholeWithEnds,
    /// Parts of the range without a warp: whoever cuts a table mostly cuts a plain one.
    Cropped,
}

/// What may be missing at either end of a cropped range, in parts of it: fitting finds what lies between.
const CUT: [f64; 3] = [0.0, 0.15, 0.3];

/// Every ramp of a dimension: flipped or not, and for tables of few texels at centres and at edges.
fn variants(nodes: &Axis, size: usize, both: bool, arrangement: Arrangement) -> Vec<Ramp> {
    if arrangement == Arrangement::Cropped {
        return ramps(nodes, size)
            .into_iter()
            .filter(|ramp| ramp.warp == Warp::Linear && ramp.parameter.range().is_some())
            .flat_map(|ramp| CUT.map(|low| CUT.map(|high| ramp.covering(low, 1.0 - high))).concat())
            .flat_map(|ramp| [false, true].map(|flip| Ramp { flip, ..ramp }))
            .collect();
    }
    let with_ends = both || (arrangement == Arrangement::WholeWithEnds && nodes.parameter.range().is_none());
    let places: &[Place] = if with_ends { &[Place::Centre(0.0), Place::Edge(0.0)] } else { &[Place::Centre(0.0)] };
    ramps(nodes, size)
        .into_iter()
        .flat_map(|ramp| [false, true].map(|flip| Ramp { flip, ..ramp }))
        .flat_map(|ramp| places.iter().map(move |&place| ramp.placed(place)))
        .collect()
}

/// The best hypotheses of each channel: at most `most`, of different kinds, cheapest first.
pub fn search(
    channels: &[Data],
    masters: &[Arc<Master>],
    curves: &[Curve],
    arrangement: Arrangement,
    most: usize,
) -> Vec<Vec<Hypothesis>> {
    let Some(sizes) = channels.first().map(|c| &c.sizes) else { return vec![] };
    let choice = choice(sizes, COARSE[sizes.len() - 1]);
    // (channel, curve, its values through the curve's inverse)
    let values: Vec<(usize, Curve, Vec<f64>)> = channels
        .iter()
        .enumerate()
        .flat_map(|(c, data)| {
            let at = data.at(&choice);
            let curves = curves.iter().filter(|curve| curve.admits(&data.values));
            curves.map(move |&curve| (c, curve, at.iter().map(|&v| curve.undo(v)).collect()))
        })
        .collect();
    let jobs: Vec<Job> = masters
        .iter()
        .flat_map(|master| {
            let nodes = &master.definition.nodes;
            let frees: Vec<Option<f64>> = if nodes.len() > sizes.len() {
                let last = nodes[nodes.len() - 1];
                FREE.map(|f| Some(last.value_at_position(f * (last.size - 1) as f64))).into()
            } else {
                vec![None]
            };
            assignments(sizes.len(), nodes.len())
                .into_iter()
                .flat_map(move |varies| frees.clone().into_iter().map(move |free| (master, varies.clone(), free)))
        })
        .collect();
    // Half a texel is found by fitting, unless texels are few.
    let both = |size: usize| sizes.len() < 3 && size < 16;
    // `some`: of each dimension only so many ramps.
    let try_jobs = |some: usize, limits: &[f64]| -> Vec<(usize, f64, Hypothesis)> {
        jobs.par_iter()
            .flat_map_iter(|job @ (master, varies, _)| {
                let nodes = &master.definition.nodes;
                let mut ramps: Vec<Vec<Ramp>> = varies
                    .iter()
                    .zip(sizes)
                    .map(|(&p, &size)| variants(&nodes[p], size, both(size), arrangement))
                    .collect();
                ramps.iter_mut().for_each(|ramps| ramps.truncate(some));
                try_all(job, &ramps, &choice, &values, channels, limits)
            })
            .collect()
    };
    // A little of everything first: what is dearer than so many that will be kept is not looked at twice.
    let limits = dearest(try_jobs(A_LITTLE, &vec![f64::INFINITY; channels.len()]), channels.len(), most);
    let found = try_jobs(usize::MAX, &limits);
    let mut best: Vec<Vec<(f64, Hypothesis)>> = vec![vec![]; channels.len()];
    for (c, cost, hypothesis) in found {
        best[c].push((cost, hypothesis));
    }
    best.into_iter()
        .map(|mut all| {
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut kept: Vec<Hypothesis> = vec![];
            for (_, hypothesis) in all {
                // Of one quantity over axes in one order, a few warps are enough: shifts and ranges are fitted.
                let alike = |k: &&Hypothesis| {
                    Arc::ptr_eq(&k.master, &hypothesis.master)
                        && (k.quantity, &k.varies) == (hypothesis.quantity, &hypothesis.varies)
                };
                if kept.len() < most
                    && kept.iter().filter(alike).count() < 3
                    && !kept.iter().any(|k| k.same_kind(&hypothesis))
                {
                    kept.push(hypothesis);
                }
            }
            kept
        })
        .collect()
}

/// A master, which of its parameters each dimension varies, and the value of its last where none does.
type Job<'a> = (&'a Arc<Master>, Vec<usize>, Option<f64>);

/// Ramps of each dimension in a first, quick look.
const A_LITTLE: usize = 2;

/// What hypotheses of each channel cost at most that are among the best `most`: there are so many of different kinds below it.
fn dearest(found: Vec<(usize, f64, Hypothesis)>, n_channels: usize, most: usize) -> Vec<f64> {
    let mut cheapest: Vec<Vec<(f64, Hypothesis)>> = vec![vec![]; n_channels];
    for (c, cost, hypothesis) in found {
        let alike = |(_, k): &&mut (f64, Hypothesis)| {
            Arc::ptr_eq(&k.master, &hypothesis.master) && k.varies == hypothesis.varies
        };
        match cheapest[c].iter_mut().find(alike) {
            Some(known) => known.0 = known.0.min(cost),
            None => cheapest[c].push((cost, hypothesis)),
        }
    }
    cheapest
        .into_iter()
        .map(|kinds| {
            let mut costs: Vec<f64> = kinds.into_iter().map(|(cost, _)| cost).collect();
            costs.sort_by(f64::total_cmp);
            costs.get(most - 1).copied().unwrap_or(f64::INFINITY)
        })
        .collect()
}

/// Hypotheses that one job keeps of a channel.
const KEPT: usize = 6;

fn try_all(
    (master, varies, free): &Job,
    per_dimension: &[Vec<Ramp>],
    choice: &Choice,
    values: &[(usize, Curve, Vec<f64>)],
    channels: &[Data],
    limits: &[f64],
) -> Vec<(usize, f64, Hypothesis)> {
    let nodes = &master.definition.nodes;
    // What may be looked up along each parameter: an entry per ramp of the dimension that varies it, or the free value alone.
    let mut lookups: Vec<Vec<Vec<Taps>>> = vec![vec![]; nodes.len()];
    for (dimension, &p) in varies.iter().enumerate() {
        lookups[p] = per_dimension[dimension].iter().map(|ramp| taps(&nodes[p], ramp, &choice[dimension])).collect();
    }
    if let (Some(value), Some((last, lookup))) = (*free, nodes.last().zip(lookups.last_mut())) {
        *lookup = vec![vec![Taps::new(last.position(value), last.size)]];
    }
    // Values in the order of the master's parameters: predictions then need not be brought into that of the table.
    let counts: Vec<usize> = lookups.iter().map(|lookup| lookup.first().map_or(0, Vec::len)).collect();
    let order = table_order(&counts, varies);
    let values = values.iter().map(|(c, curve, values)| {
        let mut sorted = vec![0.0; values.len()];
        order.iter().zip(values).for_each(|(&to, &v)| sorted[to] = v);
        let sums = sorted.iter().all(|v| v.is_finite()).then(|| Sums::of(&sorted, &sorted));
        TrialValues { channel: *c, curve: *curve, values: sorted, sums }
    });
    let mut trial = Trial {
        values: values.collect(),
        wanted: channels
            .iter()
            .zip(limits)
            .map(|(data, &limit)| Wanted { floor: data.floor(), limit, peaks: data.peaks })
            .collect(),
        best: vec![vec![]; channels.len()],
        squares: vec![],
    };
    let sizes: Vec<usize> = nodes.iter().map(|a| a.size).collect();
    for quantity in 0..master.definition.quantities().len() {
        each_prediction(&lookups, master.plane(quantity), &sizes, &mut |chosen, predicted| {
            trial.judge(quantity, chosen, predicted);
        });
    }
    let hypothesis = |found: &Found| Hypothesis {
        master: Arc::clone(master),
        quantity: found.quantity,
        ramps: varies.iter().zip(per_dimension).map(|(&p, ramps)| ramps[found.chosen[p]]).collect(),
        varies: varies.clone(),
        free: *free,
        encoding: found.encoding,
        residual: found.residual,
    };
    let best = trial.best.iter().enumerate();
    best.flat_map(|(c, list)| list.iter().map(move |found| (c, found.cost, hypothesis(found)))).collect()
}

/// What is said of the numbers that a combination of ramps predicts: which of each parameter, and the predictions.
pub(super) type Visit<'a> = dyn FnMut(&[usize], &[f64]) + 'a;

/// Looks up a plane of so many nodes along each parameter by every combination of what may be looked up along each: what combinations have
/// in common is looked up once.
pub(super) fn each_prediction(lookups: &[Vec<Vec<Taps>>], plane: &[f64], sizes: &[usize], visit: &mut Visit) {
    fn descend(
        lookups: &[Vec<Vec<Taps>>],
        left: usize,
        plane: &[f64],
        sizes: &[usize],
        chosen: &mut [usize],
        visit: &mut Visit,
    ) {
        let Some(p) = left.checked_sub(1) else { return visit(chosen, plane) };
        let mut shrunk = sizes.to_vec();
        for (ramp, taps) in lookups[p].iter().enumerate() {
            chosen[p] = ramp;
            shrunk[p] = taps.len();
            descend(lookups, p, &along(plane, sizes, p, taps), &shrunk, chosen, visit);
        }
    }
    descend(lookups, lookups.len(), plane, sizes, &mut vec![0; lookups.len()], visit);
}

/// What fits a channel well, by numbers.
#[derive(Debug, Clone)]
struct Found {
    cost: f64,
    quantity: usize,
    /// The ramp of each parameter.
    chosen: Vec<usize>,
    encoding: Encoding,
    residual: f64,
}

/// What predictions are compared with: a channel's values through a curve's inverse.
struct TrialValues {
    channel: usize,
    curve: Curve,
    values: Vec<f64>,
    /// Of the values alone; nothing where some are none.
    sums: Option<Sums>,
}

/// One master, of which every combination of ramps is tried.
struct Trial {
    values: Vec<TrialValues>,
    /// Of each channel.
    wanted: Vec<Wanted>,
    best: Vec<Vec<Found>>,
    squares: Vec<f64>,
}

impl Trial {
    fn judge(&mut self, quantity: usize, chosen: &[usize], predicted: &[f64]) {
        let own = (sum(predicted, predicted, |p, _| p), sum(predicted, predicted, |p, _| p * p));
        for TrialValues { channel: c, curve, values, sums } in &self.values {
            let list = &mut self.best[*c];
            let wanted = self.wanted[*c];
            let limit = list.get(KEPT - 1).map_or(wanted.limit, |last| last.cost.min(wanted.limit));
            let sums = sums.map_or_else(|| Sums::of(values, predicted), |sums| sums.with(values, predicted, own));
            let (encoding, residual, cost) =
                encoding(values, predicted, *curve, &sums, Wanted { limit, ..wanted }, &mut self.squares);
            if cost <= limit {
                let at = list.partition_point(|known| known.cost < cost);
                list.insert(at, Found { cost, quantity, chosen: chosen.to_vec(), encoding, residual });
                list.truncate(KEPT);
            }
        }
    }
}
