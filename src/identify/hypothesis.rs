//! What a channel may hold: a quantity of a master, over ramps along the table's dimensions, and what that says of its texels.

use super::masters::{Master, Taps};
use super::ramp::{Place, Ramp};
use super::residual::KNOWN;
use crate::claim::{Curve, Encoding};
use crate::table::{Axis, Model, Parameter};
use std::sync::Arc;

/// What interpolation between a master's nodes is off by: residuals below it decide nothing.
pub const MASTER_ERROR: f64 = 3e-5;

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
    /// Standard deviation, of the nine tenths nearest to the median where the rest varies far more.
    pub spread: f64,
    /// What it is of all values, in parts of that.
    pub peaks: f64,
    /// What correct rounding leaves, RMS, without the worst tenth: so residuals are counted.
    pub rounding: f64,
    /// The same with the worst tenth: where a few values are large, floating-point numbers leave nearly all of it there.
    pub rounding_of_all: f64,
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
    /// What no residual tells apart: what masters and rounding leave.
    pub fn floor(&self) -> f64 {
        MASTER_ERROR + self.rounding
    }

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

pub(super) fn taps(nodes: &Axis, ramp: &Ramp, chosen: &[usize]) -> Vec<Taps> {
    chosen.iter().map(|&i| Taps::new(nodes.position(node_value(nodes, ramp, i)), nodes.size)).collect()
}

impl Hypothesis {
    /// The quantity at a choice of texels, x fastest, as far as the master tells.
    pub fn predict(&self, choice: &Choice) -> Vec<f64> {
        self.look_up(self.master.plane(self.quantity), choice)
    }

    /// The same with NaN where the master is far off: beside places at which the quantity diverges.
    pub fn predict_known(&self, choice: &Choice) -> Vec<f64> {
        self.look_up(self.master.known(self.quantity), choice)
    }

    fn look_up(&self, plane: &[f64], choice: &Choice) -> Vec<f64> {
        let nodes = &self.master.definition.nodes;
        let mut per_parameter: Vec<Vec<Taps>> = vec![vec![]; nodes.len()];
        for (dimension, &p) in self.varies.iter().enumerate() {
            per_parameter[p] = taps(&nodes[p], &self.ramps[dimension], &choice[dimension]);
        }
        if let (Some(value), Some((last, taps))) = (self.free, nodes.last().zip(per_parameter.last_mut())) {
            *taps = vec![Taps::new(last.position(value), last.size)];
        }
        let values = self.master.grid(plane, &per_parameter);
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

    /// What the master says is off by at most, nearly everywhere.
    fn slack(&self) -> f64 {
        self.master.definition.is_within() * self.encoding.scale.abs().max(1.0)
    }

    /// Whether the master is better than rounding is coarse: only then it tells which texels are rounded wrongly.
    pub fn tells_rounding(&self, data: &Data) -> bool {
        data.rounding >= self.slack()
    }

    /// Texels of a choice that have another number than correct rounding of what is predicted of them, as far as the master tells.
    pub fn misrounded(&self, predicted: &[f64], data: &Data, choice: &Choice) -> usize {
        let slack = self.slack();
        // NaN counts for nothing.
        let is_wrong =
            |(i, p): &(usize, &f64)| (self.encoding.encode(**p) - data.values[*i]).abs() > 0.5 * data.steps[*i] + slack;
        indices(&data.sizes, choice).into_iter().zip(predicted).filter(is_wrong).count()
    }

    /// Whether it says all with words that people have for tables, and has no fitted number.
    pub fn is_simple(&self) -> bool {
        let is_placed = |ramp: &Ramp| ramp.place().is_some() && !ramp.is_odd();
        KNOWN.contains(&(self.encoding.scale, self.encoding.offset))
            && self.free.is_none()
            && self.ramps.iter().all(is_placed)
    }

    /// What had to be fitted or assumed for it to hold: numbers first, then places that are not the simplest, then another model than the
    /// usual one.
    pub fn complexity(&self) -> [usize; 3] {
        let encoding = match (self.encoding.scale, self.encoding.offset) {
            (1.0, 0.0) => 0,
            known if KNOWN.contains(&known) => 1,
            _ => 2,
        };
        let fitted: usize = self.ramps.iter().map(Ramp::n_numbers).sum();
        let numbers =
            encoding + fitted + usize::from(self.encoding.curve != Curve::Plain) + usize::from(self.free.is_some());
        let place =
            |ramp: &Ramp| ramp.place().and_then(|own| Place::ALL.iter().position(|place| *place == own)).unwrap_or(0);
        let is_usual = self.master.definition.model == Model::default();
        [numbers, self.ramps.iter().map(place).sum(), usize::from(!is_usual)]
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
pub(super) fn table_order(counts: &[usize], varies: &[usize]) -> Vec<usize> {
    let strides: Vec<usize> = (0..counts.len()).map(|p| counts[..p].iter().product()).collect();
    let mut order = vec![0];
    for &p in varies.iter().rev() {
        let stride = strides[p];
        order = order.iter().flat_map(|base| (0..counts[p]).map(move |i| base + i * stride)).collect();
    }
    order
}
