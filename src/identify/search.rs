//! Trying every master over every simple arrangement of axes, on a choice of texels; then fitting shifts, ranges and factors of those
//! that come nearest.

use super::masters::{Master, Taps, along};
use super::ramp::{Place, Ramp, ramps};
use super::residual::{KNOWN, Sums, encoding, sum};
use crate::claim::{Curve, Encoding};
use crate::math::warp::Warp;
use crate::table::{Axis, Model, Parameter};
use rayon::prelude::*;
use std::sync::Arc;

/// What a channel may hold.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// Whose quantity.
    pub master: Arc<Master>,
    /// Which of its quantities.
    pub quantity: usize,
    /// The ramp along each dimension of the table.
    pub ramps: Vec<Ramp>,
    /// Which of the master's parameters each dimension varies.
    pub varies: Vec<usize>,
    /// The value of the master's last parameter, where no dimension varies it.
    pub free: Option<f64>,
    /// How the values are encoded.
    pub encoding: Encoding,
    /// The residual: root mean square without the worst tenth, in the units of the curve's argument.
    pub residual: f64,
}

/// The numbers of one channel.
#[derive(Debug, Clone)]
pub struct Data {
    /// The values, x fastest.
    pub values: Vec<f64>,
    /// Texels along the dimensions that have more than one.
    pub sizes: Vec<usize>,
    /// Standard deviation.
    pub spread: f64,
    /// What correct rounding leaves, RMS.
    pub rounding: f64,
    /// The distance of neighbouring stored numbers at every value: correct rounding is off by half of it at most.
    pub steps: Vec<f64>,
}

/// A choice of texels: the product of some indices along each dimension.
pub type Choice = Vec<Vec<usize>>;

/// At most so many indices along each dimension, both ends among them.
pub fn choice(sizes: &[usize], most: usize) -> Choice {
    sizes
        .iter()
        .map(|&n| {
            let m = most.min(n);
            (0..m).map(|i| if m > 1 { (i * (n - 1) + (m - 1) / 2) / (m - 1) } else { 0 }).collect()
        })
        .collect()
}

impl Data {
    /// The values at a choice of texels.
    pub fn at(&self, choice: &Choice) -> Vec<f64> {
        indices(&self.sizes, choice).into_iter().map(|i| self.values[i]).collect()
    }
}

/// The texels of a choice, x fastest.
pub fn indices(sizes: &[usize], choice: &Choice) -> Vec<usize> {
    let mut all = vec![0];
    let mut stride: usize = sizes.iter().product();
    for (size, chosen) in sizes.iter().zip(choice).rev() {
        stride /= size;
        all = all.iter().flat_map(|base| chosen.iter().map(move |i| base + i * stride)).collect();
    }
    all
}

/// The parameter that a master's nodes have, from that of a ramp.
fn node_value(nodes: &Axis, ramp: &Ramp, i: usize) -> f64 {
    let value = ramp.value(i);
    match (nodes.parameter, ramp.parameter) {
        (Parameter::Roughness, Parameter::Alpha) => value.sqrt(),
        _ => value,
    }
}

fn taps(nodes: &Axis, ramp: &Ramp, chosen: &[usize]) -> Vec<Taps> {
    chosen.iter().map(|&i| Taps::new(nodes.position(node_value(nodes, ramp, i)), nodes.size)).collect()
}

impl Hypothesis {
    /// The quantity at a choice of texels, x fastest.
    pub fn predict(&self, choice: &Choice) -> Vec<f64> {
        let nodes = &self.master.definition.nodes;
        let mut per_parameter: Vec<Vec<Taps>> = vec![vec![]; nodes.len()];
        for (dimension, &p) in self.varies.iter().enumerate() {
            per_parameter[p] = taps(&nodes[p], &self.ramps[dimension], &choice[dimension]);
        }
        if let (Some(value), Some((last, taps))) = (self.free, nodes.last().zip(per_parameter.last_mut())) {
            *taps = vec![Taps::new(last.position(value), last.size)];
        }
        let values = self.master.grid(self.quantity, &per_parameter);
        in_table_order(&values, &per_parameter, &self.varies)
    }

    /// What of a value no encoding explains is relative to how much the channel varies.
    pub fn relative(&self, data: &Data) -> f64 {
        if data.spread > 0.0 { self.residual / data.spread } else { f64::INFINITY }
    }

    /// The same with every dimension at the simple place that is nearest to where it was fitted; nothing where all are at one, or too far.
    pub fn at_simple_places(&self) -> Option<Self> {
        let off = |ramp: &Ramp, place: &Place| {
            let (first, step) = place.of(ramp.size);
            let last = (ramp.size - 1) as f64;
            (first - ramp.first).abs().max((first + step * last - ramp.first - ramp.step * last).abs())
        };
        let mut ramps = self.ramps.clone();
        for ramp in ramps.iter_mut().filter(|ramp| ramp.place().is_none()) {
            let nearest = Place::ALL.into_iter().min_by(|a, b| off(ramp, a).total_cmp(&off(ramp, b)))?;
            // Half of what two of them differ by at least.
            if off(ramp, &nearest) > 0.25 / ramp.size as f64 {
                return None;
            }
            *ramp = ramp.placed(nearest);
        }
        (ramps != self.ramps).then(|| Self { ramps, ..self.clone() })
    }

    /// Whether the table's dimensions are the master's parameters in their own order.
    pub fn is_in_order(&self) -> bool {
        self.varies.is_sorted()
    }

    /// Whether both say the same of a table, whatever the fitted numbers are.
    pub fn same_kind(&self, other: &Self) -> bool {
        let ramp = |r: &Ramp| (r.parameter, r.flip, format!("{}", r.warp));
        Arc::ptr_eq(&self.master, &other.master)
            && self.quantity == other.quantity
            && self.varies == other.varies
            && self.ramps.iter().map(ramp).eq(other.ramps.iter().map(ramp))
    }
}

/// Values over a master's parameters, the first fastest, in the order of the table's dimensions.
fn in_table_order(values: &[f64], taps: &[Vec<Taps>], varies: &[usize]) -> Vec<f64> {
    if varies.is_sorted() {
        return values.to_vec();
    }
    let counts: Vec<usize> = taps.iter().map(Vec::len).collect();
    table_order(&counts, varies).into_iter().map(|i| values[i]).collect()
}

/// Where, among values over parameters of so many each, the first fastest, those stand that a table has one after the other.
fn table_order(counts: &[usize], varies: &[usize]) -> Vec<usize> {
    let strides: Vec<usize> = (0..counts.len()).map(|p| counts[..p].iter().product()).collect();
    let mut order = vec![0];
    for &p in varies.iter().rev() {
        let stride = strides[p];
        order = order.iter().flat_map(|base| (0..counts[p]).map(move |i| base + i * stride)).collect();
    }
    order
}

/// Factor and offset that bring `predicted` nearest to `values`, with weights.
fn affine(values: &[f64], predicted: &[f64], weights: &[f64]) -> (f64, f64) {
    let (mut w, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ((v, p), k) in values.iter().zip(predicted).zip(weights) {
        if v.is_finite() {
            w += k;
            x += k * p;
            y += k * v;
            xx += k * p * p;
            xy += k * p * v;
        }
    }
    let determinant = w * xx - x * x;
    if determinant <= 1e-12 * w * xx {
        return (1.0, 0.0); // a constant explains nothing
    }
    let scale = (w * xy - x * y) / determinant;
    (scale, (y - scale * x) / w)
}

/// Indices along each dimension while everything is tried.
const COARSE: [usize; 3] = [24, 9, 6];
/// Indices along each dimension while the best are fitted.
const FINE: [usize; 3] = [128, 24, 10];
/// What interpolation between a master's nodes is off by: residuals below it decide nothing.
pub const MASTER_ERROR: f64 = 3e-5;

/// The choice of texels with which hypotheses are fitted.
pub fn fine(sizes: &[usize]) -> Choice {
    choice(sizes, FINE[sizes.len() - 1])
}

/// Every way to let the dimensions vary parameters, each one of its own; `None` where the master has too few or too many.
fn assignments(n_dimensions: usize, n_parameters: usize) -> Vec<Vec<usize>> {
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
    let places: &[Place] = if both { &[Place::Centre(0.0), Place::Edge(0.0)] } else { &[Place::Centre(0.0)] };
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
            curves.iter().map(move |&curve| (c, curve, at.iter().map(|&v| curve.undo(v)).collect()))
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
    let both = sizes.len() < 3 && sizes.iter().all(|&size| size < 16);
    // `some`: of each dimension only so many ramps.
    let try_jobs = |some: usize, limits: &[f64]| -> Vec<(usize, f64, Hypothesis)> {
        jobs.par_iter()
            .flat_map_iter(|job @ (master, varies, _)| {
                let nodes = &master.definition.nodes;
                let mut ramps: Vec<Vec<Ramp>> =
                    varies.iter().zip(sizes).map(|(&p, &size)| variants(&nodes[p], size, both, arrangement)).collect();
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
        lookups: &lookups,
        values: values.collect(),
        floors: channels.iter().map(|data| MASTER_ERROR + data.rounding).collect(),
        chosen: vec![0; nodes.len()],
        limits,
        best: vec![vec![]; channels.len()],
        squares: vec![],
    };
    let sizes: Vec<usize> = nodes.iter().map(|a| a.size).collect();
    for quantity in 0..master.definition.quantities().len() {
        trial.look_up(quantity, nodes.len(), &master.plane(quantity), &sizes);
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
struct Trial<'a> {
    lookups: &'a [Vec<Vec<Taps>>],
    values: Vec<TrialValues>,
    floors: Vec<f64>,
    /// What a hypothesis of each channel may cost.
    limits: &'a [f64],
    chosen: Vec<usize>,
    best: Vec<Vec<Found>>,
    squares: Vec<f64>,
}

impl Trial<'_> {
    /// Looks up the last of the first `left` parameters in every way, and then those before it: what combinations have in common is
    /// looked up once.
    fn look_up(&mut self, quantity: usize, left: usize, plane: &[f64], sizes: &[usize]) {
        let Some(p) = left.checked_sub(1) else { return self.judge(quantity, plane) };
        let lookups = self.lookups;
        for (ramp, taps) in lookups[p].iter().enumerate() {
            self.chosen[p] = ramp;
            let mut shrunk = sizes.to_vec();
            shrunk[p] = taps.len();
            self.look_up(quantity, p, &along(plane, sizes, p, taps), &shrunk);
        }
    }

    fn judge(&mut self, quantity: usize, predicted: &[f64]) {
        let own = (sum(predicted, predicted, |p, _| p), sum(predicted, predicted, |p, _| p * p));
        for TrialValues { channel: c, curve, values, sums } in &self.values {
            let list = &mut self.best[*c];
            let limit = list.get(KEPT - 1).map_or(self.limits[*c], |last| last.cost.min(self.limits[*c]));
            let sums = sums.map_or_else(|| Sums::of(values, predicted), |sums| sums.with(values, predicted, own));
            let (encoding, residual, cost) =
                encoding(values, predicted, *curve, &sums, self.floors[*c], limit, &mut self.squares);
            if cost <= limit {
                let at = list.partition_point(|known| known.cost < cost);
                list.insert(at, Found { cost, quantity, chosen: self.chosen.clone(), encoding, residual });
                list.truncate(KEPT);
            }
        }
    }
}

/// Steps of the fit at most.
const STEPS: usize = 20;
/// A texel's shift by which derivatives are taken, and the part of a stretch.
const NUDGE: f64 = 0.02;

/// The hypothesis with shifts, ranges and the free parameter fitted to the channel, and its cost.
pub fn fit(start: &Hypothesis, data: &Data, choice: &Choice) -> (Hypothesis, f64) {
    let curve = start.encoding.curve;
    let values: Vec<f64> = data.at(choice).into_iter().map(|v| curve.undo(v)).collect();
    let floor = MASTER_ERROR + data.rounding;
    // Any factor first, then a known one: either may be what leads to the right shift.
    let known = KNOWN.contains(&(start.encoding.scale, start.encoding.offset));
    let mut best = settle(start, &values, choice, floor);
    for fixed in [Some((start.encoding.scale, start.encoding.offset)).filter(|_| known), None] {
        let moved = descend(start, &values, choice, fixed);
        let settled = settle(&moved, &values, choice, floor);
        if settled.1 < best.1 {
            best = settled;
        }
    }
    best
}

/// The same hypothesis with the best encoding.
pub fn settle(hypothesis: &Hypothesis, values: &[f64], choice: &Choice, floor: f64) -> (Hypothesis, f64) {
    let predicted = hypothesis.predict(choice);
    let curve = hypothesis.encoding.curve;
    let sums = Sums::of(values, &predicted);
    let (encoding, residual, cost) = encoding(values, &predicted, curve, &sums, floor, f64::INFINITY, &mut vec![]);
    (Hypothesis { encoding, residual, ..hypothesis.clone() }, cost)
}

/// The same of a channel, and with the price of its ranges.
pub fn resettle(hypothesis: &Hypothesis, data: &Data, choice: &Choice) -> (Hypothesis, f64) {
    let curve = hypothesis.encoding.curve;
    let values: Vec<f64> = data.at(choice).into_iter().map(|v| curve.undo(v)).collect();
    let (settled, cost) = settle(hypothesis, &values, choice, MASTER_ERROR + data.rounding);
    let price = price_of_ranges(&settled);
    (settled, cost * price)
}

fn moved(hypothesis: &Hypothesis, by: &[f64]) -> Hypothesis {
    let mut moved = hypothesis.clone();
    for (dimension, ramp) in moved.ramps.iter_mut().enumerate() {
        let n = ramp.size as f64;
        // The middle and the length: nearly independent of each other.
        let middle = ramp.first + ramp.step * 0.5 * (n - 1.0) + by[2 * dimension] / n;
        ramp.step = (ramp.step + by[2 * dimension + 1] / (n * n)).clamp(0.1 / n, 4.0 / n);
        ramp.first = middle - ramp.step * 0.5 * (n - 1.0);
    }
    if let Some(free) = &mut moved.free {
        let last = moved.master.definition.nodes[moved.master.definition.nodes.len() - 1];
        let position = (last.position(*free) + by[by.len() - 1]).clamp(0.0, (last.size - 1) as f64);
        *free = last.value_at_position(position);
    }
    moved
}

/// Levenberg and Marquardt's descent on the residuals with Huber's weights.
fn descend(start: &Hypothesis, values: &[f64], choice: &Choice, fixed: Option<(f64, f64)>) -> Hypothesis {
    let n = 2 * start.ramps.len() + usize::from(start.free.is_some());
    let mut weights: Vec<f64> = values.iter().map(|v| f64::from(u8::from(v.is_finite()))).collect();
    let residuals = |h: &Hypothesis, weights: &[f64]| -> Vec<f64> {
        let predicted = h.predict(choice);
        let (a, b) = fixed.unwrap_or_else(|| affine(values, &predicted, weights));
        values.iter().zip(&predicted).map(|(v, p)| if v.is_finite() { v - a * p - b } else { 0.0 }).collect()
    };
    let cost = |r: &[f64], w: &[f64]| r.iter().zip(w).map(|(r, w)| w * r * r).sum::<f64>();
    let (mut here, mut damping) = (start.clone(), 1e-2);
    for _ in 0..STEPS {
        let r = residuals(&here, &weights);
        let mut sizes: Vec<f64> = r.iter().map(|r| r.abs()).collect();
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        let knee = (2.0 * median).max(MASTER_ERROR);
        for ((w, r), v) in weights.iter_mut().zip(&r).zip(values) {
            *w = if !v.is_finite() { 0.0 } else { (knee / r.abs()).min(1.0) };
        }
        let now = cost(&r, &weights);
        let columns: Vec<Vec<f64>> = (0..n)
            .map(|k| {
                let mut by = vec![0.0; n];
                by[k] = NUDGE;
                let up = residuals(&moved(&here, &by), &weights);
                by[k] = -NUDGE;
                let down = residuals(&moved(&here, &by), &weights);
                up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * NUDGE)).collect()
            })
            .collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).zip(&weights).map(|((a, b), w)| a * b * w).sum::<f64>();
        let gradient: Vec<f64> = columns.iter().map(|column| dot(column, &r)).collect();
        let hessian: Vec<Vec<f64>> = columns.iter().map(|a| columns.iter().map(|b| dot(a, b)).collect()).collect();
        let mut better = false;
        for _ in 0..6 {
            let mut system = hessian.clone();
            for (k, row) in system.iter_mut().enumerate() {
                row[k] += damping * row[k].max(1e-12);
            }
            let step: Vec<f64> = solve(system, &gradient)
                .into_iter()
                .map(|s| if s.is_finite() { (-s).clamp(-2.0, 2.0) } else { 0.0 })
                .collect();
            let next = moved(&here, &step);
            let then = cost(&residuals(&next, &weights), &weights);
            if then < now {
                better = step.iter().any(|s| s.abs() > 1e-4);
                (here, damping) = (next, damping * 0.2);
                break;
            }
            damping *= 8.0;
        }
        if !better {
            break;
        }
    }
    here
}

/// The solution of a small symmetric system, by elimination.
fn solve(mut a: Vec<Vec<f64>>, b: &[f64]) -> Vec<f64> {
    let n = b.len();
    let mut x = b.to_vec();
    for i in 0..n {
        let pivot = a[i][i];
        for j in i + 1..n {
            let factor = a[j][i] / pivot;
            let (above, below) = a.split_at_mut(j);
            below[0][i..].iter_mut().zip(&above[i][i..]).for_each(|(b, a)| *b -= factor * a);
            x[j] -= factor * x[i];
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| a[i][k] * x[k]).sum();
        x[i] = (x[i] - known) / a[i][i];
    }
    x
}

/// What every dimension whose ends had to be fitted must gain, in parts of the residual.
const PRICE_OF_RANGE: f64 = 1.25;

/// What the ranges cost that had to be fitted although the whole is known, and shifts by parts of a texel.
pub fn price_of_ranges(hypothesis: &Hypothesis) -> f64 {
    let had_to_be = |ramp: &&Ramp| ramp.is_fitted() || ramp.n_fitted() == 1;
    hypothesis.ramps.iter().filter(had_to_be).map(|_| PRICE_OF_RANGE).product()
}

/// What a master is off by at most, nearly everywhere: where rounding is coarser than that, it tells which texels are rounded wrongly.
const MASTER_IS_WITHIN: f64 = 1e-4;

impl Hypothesis {
    /// Texels of a choice that have another number than correct rounding would give; nothing where masters are too coarse to tell.
    fn misrounded(&self, data: &Data, choice: &Choice) -> Option<usize> {
        let slack = MASTER_IS_WITHIN * self.encoding.scale.abs().max(1.0);
        let pairs = || indices(&data.sizes, choice).into_iter().zip(self.predict(choice));
        // NaN counts for nothing.
        let is_wrong =
            |(i, p): &(usize, f64)| (self.encoding.encode(*p) - data.values[*i]).abs() > 0.5 * data.steps[*i] + slack;
        (data.rounding >= slack).then(|| pairs().filter(is_wrong).count())
    }

    /// What had to be fitted or assumed for it to hold: numbers first, then places that are not the simplest, then another model than the
    /// usual one.
    pub fn complexity(&self) -> [usize; 3] {
        let encoding = match (self.encoding.scale, self.encoding.offset) {
            (1.0, 0.0) => 0,
            known if KNOWN.contains(&known) => 1,
            _ => 2,
        };
        let fitted: usize = self.ramps.iter().map(Ramp::n_fitted).sum();
        let numbers =
            encoding + fitted + usize::from(self.encoding.curve != Curve::Plain) + usize::from(self.free.is_some());
        let place =
            |ramp: &Ramp| ramp.place().and_then(|own| Place::ALL.iter().position(|place| *place == own)).unwrap_or(0);
        let is_usual = self.master.definition.model == Model::default();
        [numbers, self.ramps.iter().map(place).sum(), usize::from(!is_usual)]
    }
}

/// How much worse simple places of texels may fit than fitted ones, and still be what is meant.
pub const SIMPLE_IS_AS_GOOD: f64 = 1.15;

/// How much worse a place may fit along one dimension of a volume while the others are fitted, and how many such are tried.
const OTHERS_FITTED: f64 = 3.0;
const FEW_PLACES: usize = 4;

/// The hypothesis with its texels at the simplest places that fit about as well as the fitted ones.
pub fn snap(fitted: &Hypothesis, data: &Data, choice: &Choice) -> (Hypothesis, f64) {
    let values: Vec<f64> = data.at(choice).into_iter().map(|v| fitted.encoding.curve.undo(v)).collect();
    let floor = MASTER_ERROR + data.rounding;
    let near = |ramp: &Ramp| -> Vec<Option<Place>> {
        let close = |place: &Place| {
            let (first, step) = place.of(ramp.size);
            let n = ramp.size as f64;
            let last = |f: f64, s: f64| f + s * (n - 1.0);
            // Farther than two texels from what was fitted at either end is not what was fitted.
            (first - ramp.first).abs() < 2.0 / n && (last(first, step) - last(ramp.first, ramp.step)).abs() < 2.0 / n
        };
        let range_is_free = ramp.parameter.range().is_none() && ramp.warp != Warp::F0FourthRoot;
        let places = Place::ALL.into_iter().filter(close).map(Some);
        if range_is_free { places.take(2).chain([None]).collect() } else { places.chain([None]).collect() }
    };
    // Of each dimension only the places that fit while the others are where they were fitted: all combinations are too many.
    let likely = |dimension: usize| -> Vec<Option<Place>> {
        let placed = |place: Option<Place>| {
            let mut ramps = fitted.ramps.clone();
            ramps[dimension] = place.map_or(ramps[dimension], |place| ramps[dimension].placed(place));
            settle(&Hypothesis { ramps, ..fitted.clone() }, &values, choice, floor).1
        };
        let all = near(&fitted.ramps[dimension]);
        if fitted.ramps.len() < 3 {
            return all;
        }
        let mut rated: Vec<(f64, Option<Place>)> = all.into_iter().map(|place| (placed(place), place)).collect();
        rated.sort_by(|a, b| a.0.total_cmp(&b.0)); // stable: of equals the simplest first
        let best = rated[0].0;
        rated.into_iter().filter(|r| r.0 <= OTHERS_FITTED * best).take(FEW_PLACES).map(|r| r.1).collect()
    };
    let mut combinations: Vec<(usize, Vec<Ramp>)> = vec![(0, vec![])];
    for (dimension, ramp) in fitted.ramps.iter().enumerate() {
        let places = likely(dimension);
        combinations = combinations
            .iter()
            .flat_map(|(rank, so_far)| {
                places.iter().map(move |&place| {
                    let placed = place.map_or(*ramp, |place| ramp.placed(place));
                    let own = match place {
                        None => 100, // only if nothing simple will do
                        Some(place) => Place::ALL.iter().position(|p| *p == place).unwrap_or(0),
                    };
                    (rank + own, [so_far.as_slice(), &[placed]].concat())
                })
            })
            .collect();
    }
    let mut tried: Vec<(usize, Hypothesis, f64)> = combinations
        .into_iter()
        .map(|(rank, ramps)| {
            let (settled, cost) = settle(&Hypothesis { ramps, ..fitted.clone() }, &values, choice, floor);
            (rank, settled, cost)
        })
        .collect();
    // Where rounding is coarse, the middle of what it leaves hardly tells places apart; texels that it cannot have left do.
    let exact: Vec<bool> = tried.iter().map(|t| t.1.misrounded(data, choice) == Some(0)).collect();
    if exact.contains(&true) {
        let mut exact = exact.into_iter();
        tried.retain(|_| exact.next() == Some(true));
    }
    let best = tried.iter().map(|t| t.2).fold(f64::INFINITY, f64::min);
    tried.sort_by(|a, b| a.0.cmp(&b.0).then(a.2.total_cmp(&b.2)));
    let simplest = tried.into_iter().find(|(_, _, cost)| *cost <= SIMPLE_IS_AS_GOOD * best);
    let (hypothesis, cost) = simplest.map_or_else(|| (fitted.clone(), best), |(_, h, cost)| (h, cost));
    let price = price_of_ranges(&hypothesis);
    (hypothesis, cost * price)
}
