//! Explanations without a fitted number, which nearly every table has: few enough to be tried all.
//!
//! What every texel is the correct rounding of needs no more looking for. Where few texels or coarse codes leave several such, all of them are
//! found, so that none is taken for the only one.

use super::fit;
use super::hypothesis::{Choice, Data, Hypothesis, choice, indices, table_order, taps};
use super::masters::{Master, Taps};
use super::ramp::{Place, Ramp, simple_ramps};
use super::residual::KNOWN;
use super::search::{assignments, each_prediction};
use super::span::{Bounds, Predictions, alike};
use crate::claim::{Curve, Encoding};
use rayon::prelude::*;
use std::sync::Arc;

/// Indices along each dimension while everything is tried.
const COARSE: [usize; 3] = [24, 9, 5];
/// Of so many texels one may be predicted wrongly, of tables over one axis and over several: masters are as good as they are nearly everywhere.
const ONE_IN: [usize; 3] = [16, 6, 6];
/// What an explanation may leave, in parts of what the best one does: masters are not better than that.
const NEARLY: f64 = 3.0;
/// Explanations of a channel that are kept: simplest first. What has more holds too few levels to be told by.
const MOST: usize = 512;
/// The same of one quantity, of values as they are and of values through a curve, before they are compared.
const MOST_OF_ONE: usize = 4096;

/// Where nearly every table's texels are, over more than one axis.
const USUAL: [Place; 2] = [Place::Centre(0.0), Place::Edge(0.0)];

/// How many of the texels of a choice may be predicted wrongly.
fn may_miss(choice: &Choice) -> usize {
    choice.iter().map(Vec::len).product::<usize>() / ONE_IN[choice.len() - 1]
}

/// Ramps along a table's last dimension of which the predictions are compared together: more take more memory, and less is common to them.
const TOGETHER: usize = 16;

/// What every texel of a channel lies between before it is rounded, through a curve's inverse.
struct Between {
    channel: usize,
    curve: Curve,
    low: Vec<f64>,
    high: Vec<f64>,
    /// How many may not lie between them.
    may_miss: usize,
}

impl Between {
    /// Of a channel's values at these texels; one that is no number is bound by nothing.
    fn of(channel: usize, data: &Data, curve: Curve, texels: &[usize], slack: f64) -> Self {
        let bound = |&i: &usize, side: f64| match data.values[i] + side * (0.5 * data.steps[i] + slack) {
            v if v.is_nan() => side * f64::INFINITY,
            v if curve == Curve::Ratio && v >= 1.0 => f64::INFINITY, // beyond all that it can be
            v => curve.undo(v),
        };
        let all = |side: f64| texels.iter().map(|i| bound(i, side)).collect();
        Self { channel, curve, low: all(-1.0), high: all(1.0), may_miss: texels.len() / ONE_IN[data.sizes.len() - 1] }
    }

    /// The same of numbers that are stored with a factor and an offset.
    fn with(&self, (scale, offset): (f64, f64), slack: f64) -> Bounds<'_> {
        let slack = slack * (scale.abs() - 1.0).max(0.0);
        Bounds { low: &self.low, high: &self.high, scale, offset, slack, may_miss: self.may_miss }
    }
}

/// What the texels of every channel admit without a fitted number, of values as they are and of values through a curve. Channels may be of
/// several readings of one file: what there is to compare them with is looked up once. Of volumes, which have too many arrangements, nothing:
/// see [`nearest`].
pub fn admitted(channels: &[Data], masters: &[Arc<Master>]) -> Vec<[Vec<Hypothesis>; 2]> {
    let mut of_channel = vec![[const { vec![] }; 2]; channels.len()];
    // One axis has so few arrangements that every place can be tried.
    let places: &[Place] = match channels.first().map_or(0, |data| data.sizes.len()) {
        1 => &Place::ALL,
        2 => &USUAL,
        _ => return of_channel,
    };
    let sizes = &channels[0].sizes;
    let coarse = choice(sizes, COARSE[sizes.len() - 1]);
    // Quantities that no dimension is left to vary are for those that fit numbers.
    let jobs: Vec<(&Arc<Master>, Vec<usize>, usize)> = masters
        .iter()
        .filter(|master| master.definition.nodes.len() == sizes.len())
        .flat_map(|master| {
            let quantities = 0..master.definition.quantities().len();
            let ways = assignments(sizes.len(), sizes.len());
            quantities.flat_map(move |q| ways.clone().into_iter().map(move |varies| (master, varies, q)))
        })
        .collect();
    let found: Vec<(usize, Hypothesis)> = jobs
        .par_iter()
        .flat_map_iter(|(master, varies, quantity)| try_all(master, varies, *quantity, channels, &coarse, places))
        .collect();
    for (c, hypothesis) in found {
        let is_curved = hypothesis.encoding.curve != Curve::Plain;
        of_channel[c][usize::from(is_curved)].push(hypothesis);
    }
    of_channel
}

/// Those of what a channel's texels admit that leave no texel rounded wrongly, as far as masters tell, with what they cost; the simplest
/// first.
pub fn simple(admitted: Vec<Hypothesis>, data: &Data) -> Vec<(Hypothesis, f64)> {
    let fine = fit::fine(&data.sizes);
    let few = may_miss(&fine);
    let judged = admitted.into_par_iter().filter_map(|hypothesis| fit::as_it_is(hypothesis, few, data, &fine));
    let mut found: Vec<(Hypothesis, f64)> = judged.collect();
    let least = found.iter().map(|(h, _)| h.residual).fold(f64::INFINITY, f64::min);
    found.retain(|(h, _)| h.residual <= NEARLY * (least + data.rounding));
    found.sort_by(|(a, a_cost), (b, b_cost)| a.complexity().cmp(&b.complexity()).then(a_cost.total_cmp(b_cost)));
    found.truncate(MOST);
    found
}

/// Every arrangement of one quantity's axes that a channel's texels admit; the usual first.
fn try_all(
    master: &Arc<Master>,
    varies: &[usize],
    quantity: usize,
    channels: &[Data],
    chosen_texels: &Choice,
    places: &[Place],
) -> Vec<(usize, Hypothesis)> {
    let nodes = &master.definition.nodes;
    let sizes: Vec<usize> = nodes.iter().map(|axis| axis.size).collect();
    let mut ramps: Vec<Vec<Ramp>> = vec![vec![]; nodes.len()];
    let mut lookups: Vec<Vec<Vec<Taps>>> = vec![vec![]; nodes.len()];
    for (dimension, &p) in varies.iter().enumerate() {
        ramps[p] = simple_ramps(&nodes[p], channels[0].sizes[dimension], places);
        lookups[p] = ramps[p].iter().map(|ramp| taps(&nodes[p], ramp, &chosen_texels[dimension])).collect();
    }
    // Bounds in the order of the master's parameters: predictions then need not be brought into that of the table.
    let counts: Vec<usize> = lookups.iter().map(|lookup| lookup.first().map_or(0, Vec::len)).collect();
    let order = table_order(&counts, varies);
    let texels = indices(&channels[0].sizes, chosen_texels);
    let mut sorted = vec![0; texels.len()];
    order.iter().zip(&texels).for_each(|(&to, &texel)| sorted[to] = texel);
    let slack = master.definition.is_within();
    let between: Vec<Between> = channels
        .iter()
        .enumerate()
        .flat_map(|(c, data)| Curve::ALL.map(|curve| Between::of(c, data, curve, &sorted, slack)))
        .collect();
    let mut found = within_bounds(&lookups, master.known(quantity), &sizes, &between, slack);
    // The usual ramps and encodings come first in their lists.
    found.sort_unstable_by_key(|admitted| {
        let [first, second, third] = admitted.chosen;
        (third, second, first, admitted.between, admitted.known)
    });
    let mut kept = vec![[0; 2]; channels.len()];
    found.retain(|admitted| {
        let Between { channel, curve, .. } = between[admitted.between];
        let kept = &mut kept[channel][usize::from(curve != Curve::Plain)];
        *kept += 1;
        *kept <= MOST_OF_ONE
    });
    let hypothesis = |admitted: Admitted| {
        let (scale, offset) = KNOWN[admitted.known];
        let Between { channel, curve, .. } = between[admitted.between];
        let hypothesis = Hypothesis {
            master: Arc::clone(master),
            quantity,
            ramps: varies.iter().map(|&p| ramps[p][admitted.chosen[p]]).collect(),
            varies: varies.to_vec(),
            free: None,
            encoding: Encoding { scale, offset, curve },
            residual: 0.0,
        };
        (channel, hypothesis)
    };
    found.into_iter().map(hypothesis).collect()
}

/// What texels admit, by numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Admitted {
    /// The ramp of each parameter.
    chosen: [usize; 3],
    /// Which channel and curve.
    between: usize,
    /// Which factor and offset.
    known: usize,
}

/// Every combination of what may be looked up along one to three parameters that is within bounds.
fn within_bounds(
    lookups: &[Vec<Vec<Taps>>],
    plane: &[f64],
    sizes: &[usize],
    between: &[Between],
    slack: f64,
) -> Vec<Admitted> {
    let orders: Vec<Vec<usize>> = lookups.iter().map(|lookups| alike(lookups)).collect();
    let sorted =
        |p: usize, order: &[usize]| -> Vec<Vec<Taps>> { order.iter().map(|&i| lookups[p][i].clone()).collect() };
    let all_or_one = |p: usize| orders.get(p).map_or(&[0][..], |order| order);
    let of_third = |&third: &usize| -> Vec<Admitted> {
        let mut some = vec![sorted(0, &orders[0])];
        let mut found = vec![];
        for second in all_or_one(1).chunks(TOGETHER) {
            some.truncate(1);
            some.extend((lookups.len() > 1).then(|| sorted(1, second)));
            some.extend((lookups.len() > 2).then(|| sorted(2, &[third])));
            let mut values = vec![];
            each_prediction(&some, plane, sizes, &mut |_, predicted| values.extend_from_slice(predicted));
            let predictions = Predictions::new([orders[0].len(), second.len()], values);
            for (i, between) in between.iter().enumerate() {
                for (known, &encoding) in KNOWN.iter().enumerate() {
                    predictions.admitted(&between.with(encoding, slack), &mut |[a, b]| {
                        found.push(Admitted { chosen: [orders[0][a], second[b], third], between: i, known });
                    });
                }
            }
        }
        found
    };
    all_or_one(2).par_iter().flat_map_iter(of_third).collect()
}

/// Explanations of a volume that are the same as `start` but for its ramps, of which all are tried, and its encoding; the nearest first.
pub fn everywhere(start: &Hypothesis, data: &Data) -> Vec<(Hypothesis, f64)> {
    let coarse = choice(&data.sizes, COARSE[data.sizes.len() - 1]);
    let found = try_all(&start.master, &start.varies, start.quantity, std::slice::from_ref(data), &coarse, &USUAL);
    let mut nearest = simple(found.into_iter().map(|(_, hypothesis)| hypothesis).collect(), data);
    nearest.sort_by(|a, b| a.1.total_cmp(&b.1));
    nearest.truncate(NEAREST);
    nearest
}

/// Explanations of a volume that are judged of all that were tried.
const NEAREST: usize = 48;

/// The simple explanation that is nearest to one of a volume: along one dimension after the other the ramp that fits best, until none fits
/// better.
pub fn nearest(start: &Hypothesis, data: &Data, choice: &Choice) -> (Hypothesis, f64) {
    /// Times that every dimension is looked at, at most.
    const ROUNDS: usize = 4;
    let nodes = &start.master.definition.nodes;
    let mut best = fit::resettle(start, data, choice);
    for _ in 0..ROUNDS {
        let before = best.1;
        for (dimension, &p) in start.varies.iter().enumerate() {
            for ramp in simple_ramps(&nodes[p], data.sizes[dimension], &USUAL) {
                let mut ramps = best.0.ramps.clone();
                ramps[dimension] = ramp;
                let tried = fit::resettle(&Hypothesis { ramps, ..best.0.clone() }, data, choice);
                if tried.1 < best.1 {
                    best = tried;
                }
            }
        }
        if best.1 >= before {
            break;
        }
    }
    best
}

/// What else than `found` a volume's texels admit, as far as the master tells, with the ramp of one dimension changed.
pub fn beside(found: &Hypothesis, data: &Data, choice: &Choice) -> Vec<(Hypothesis, f64)> {
    let nodes = &found.master.definition.nodes;
    let few = may_miss(choice);
    let mut all = vec![];
    for (dimension, &p) in found.varies.iter().enumerate() {
        for ramp in simple_ramps(&nodes[p], data.sizes[dimension], &USUAL) {
            let mut ramps = found.ramps.clone();
            ramps[dimension] = ramp;
            if ramp != found.ramps[dimension] {
                all.extend(fit::as_it_is(Hypothesis { ramps, ..found.clone() }, few, data, choice));
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::masters::{Definition, integrate};
    use super::*;
    use crate::table::{Model, Point, quantity};

    fn master(quantity: &str, nodes: &[&str]) -> Arc<Master> {
        let nodes: Vec<crate::table::Axis> = nodes.iter().map(|axis| axis.parse().unwrap()).collect();
        let given = |p| nodes.iter().any(|axis| axis.parameter == p);
        let handle = quantity::find_among(quantity, given).unwrap();
        let definition = Definition { handle, nodes, at: Point::default(), model: Model::default() };
        let values = integrate(&definition).unwrap();
        Arc::new(Master::new(definition, &values))
    }

    /// What is within bounds, by looking at every prediction.
    fn one_by_one(
        lookups: &[Vec<Vec<Taps>>],
        plane: &[f64],
        sizes: &[usize],
        between: &[Between],
        slack: f64,
    ) -> Vec<Admitted> {
        let mut found = vec![];
        each_prediction(lookups, plane, sizes, &mut |chosen, predicted| {
            for (i, between) in between.iter().enumerate() {
                for (known, &(scale, offset)) in KNOWN.iter().enumerate() {
                    let slack = slack * (scale.abs() - 1.0).max(0.0);
                    let outside =
                        predicted.iter().zip(between.low.iter().zip(&between.high)).filter(|(p, (low, high))| {
                            let stored = scale * **p + offset;
                            stored < **low - slack || stored > **high + slack
                        });
                    let unknown = predicted.iter().filter(|p| p.is_nan()).count();
                    if outside.count() <= between.may_miss && 2 * unknown <= predicted.len() {
                        let chosen = [0, 1, 2].map(|p| chosen.get(p).copied().unwrap_or(0));
                        found.push(Admitted { chosen, between: i, known });
                    }
                }
            }
        });
        found
    }

    #[test]
    fn refuting_many_at_once_admits_what_a_look_at_each_does() {
        let one = master("ggx.albedo_avg", &["roughness:33:log+0.08:edge"]);
        let two = master("ggx.scale", &["mu:17:log+0.01:edge", "roughness:13:log+0.08:edge"]);
        let three = master("fresnel.f82", &["mu:9:edge", "f0:4:edge", "f82:4:edge"]);
        for (master, sizes, every) in [(one, vec![16], 1), (two, vec![12, 9], 5), (three, vec![6, 5, 4], 17)] {
            let nodes = &master.definition.nodes;
            let n_nodes: Vec<usize> = nodes.iter().map(|axis| axis.size).collect();
            let texels = choice(&sizes, COARSE[sizes.len() - 1]);
            let places = if sizes.len() == 1 { &Place::ALL[..] } else { &USUAL };
            let lookups: Vec<Vec<Vec<Taps>>> = nodes
                .iter()
                .zip(sizes.iter().zip(&texels))
                .map(|(nodes, (&size, chosen))| {
                    let ramps = simple_ramps(nodes, size, places).into_iter().step_by(every);
                    ramps.map(|ramp| taps(nodes, &ramp, chosen)).collect()
                })
                .collect();
            // Tables as the first ramps and the last ones have them, encoded, rounded, noisy; and something else.
            let mut tables = vec![];
            each_prediction(&lookups, master.plane(0), &n_nodes, &mut |chosen, predicted| {
                let last = lookups.iter().zip(chosen).all(|(all, one)| one + 1 == all.len());
                if last || chosen.iter().all(|&one| one == 0) {
                    tables.push(predicted.to_vec());
                }
            });
            let step = 1.0 / 255.0;
            let noise = |i: usize| ((i * 7919) % 101) as f64 / 100.0 - 0.5;
            let made: Vec<Box<dyn Fn(usize, f64) -> f64>> = vec![
                Box::new(|_, v| v),
                Box::new(move |_, v| (v / step).round() * step),
                Box::new(move |_, v| (Curve::Srgb.apply(1.0 - v) / step).round() * step),
                Box::new(move |i, v| v * std::f64::consts::PI + step * noise(i)),
                Box::new(move |i, v| if i == 3 { f64::NAN } else { 0.5 * v + 0.5 + step * noise(i) }),
                Box::new(|i, _| 0.5 + 0.1 * (i as f64).sin()),
            ];
            let between: Vec<Between> = tables
                .iter()
                .flat_map(|table| {
                    made.iter().map(move |make| (0..).zip(table).map(|(i, &v)| make(i, v)).collect::<Vec<f64>>())
                })
                .enumerate()
                .flat_map(|(c, values)| {
                    let (n, sizes) = (values.len(), vec![values.len(); sizes.len()]);
                    let steps = vec![step; n];
                    let data =
                        Data { values, sizes, spread: 1.0, peaks: 1.0, rounding: step, rounding_of_all: step, steps };
                    let all: Vec<usize> = (0..n).collect();
                    Curve::ALL.map(|curve| Between::of(c, &data, curve, &all, 2e-4))
                })
                .collect();
            let found = |mut all: Vec<Admitted>| {
                all.sort_unstable_by_key(|a| (a.chosen[2], a.chosen[1], a.chosen[0], a.between, a.known));
                all
            };
            // As if it diverged at the first node, and as it is.
            let mut wanted = vec![];
            for first in [f64::NAN, master.plane(0)[0]] {
                let plane = [&[first], &master.plane(0)[1..]].concat();
                let pruned = found(within_bounds(&lookups, &plane, &n_nodes, &between, 2e-4));
                wanted = found(one_by_one(&lookups, &plane, &n_nodes, &between, 2e-4));
                assert_eq!(pruned, wanted);
            }
            // Each of the first five is found, at least as what it was made of; the sixth is not.
            for (i, all) in between.chunks(Curve::ALL.len()).enumerate() {
                let is_admitted = wanted.iter().any(|a| a.between / all.len() == i);
                assert_eq!(is_admitted, i % made.len() < 5, "table {i} of {} nodes", n_nodes.len());
            }
        }
    }
}
