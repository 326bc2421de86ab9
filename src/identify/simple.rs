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
/// The same of one quantity, before they are compared.
const MOST_OF_ONE: usize = 8192;

/// Where nearly every table's texels are, over more than one axis.
const USUAL: [Place; 2] = [Place::Centre(0.0), Place::Edge(0.0)];

/// How many of the texels of a choice may be predicted wrongly.
fn may_miss(choice: &Choice) -> usize {
    choice.iter().map(Vec::len).product::<usize>() / ONE_IN[choice.len() - 1]
}

/// Texels that are compared at a time.
const TOGETHER: usize = 16;

/// What every texel of a channel lies between before it is rounded, through a curve's inverse.
struct Bounds {
    channel: usize,
    curve: Curve,
    low: Vec<f64>,
    high: Vec<f64>,
    /// How many may not lie between them.
    may_miss: usize,
}

impl Bounds {
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

    /// Whether all but a few of the predictions lie between them.
    fn admit(&self, predicted: &[f64], scale: f64, offset: f64, slack: f64) -> bool {
        let slack = slack * (scale.abs() - 1.0).max(0.0);
        let mut missed = 0;
        // Some at a time, without a branch: most that is tried fails at the first of them.
        let bounds = self.low.chunks(TOGETHER).zip(self.high.chunks(TOGETHER));
        for (predicted, (low, high)) in predicted.chunks(TOGETHER).zip(bounds) {
            let mut outside = 0u64;
            for ((p, low), high) in predicted.iter().zip(low).zip(high) {
                let stored = scale * p + offset;
                let within = (low - slack <= stored) & (stored <= high + slack);
                outside = outside.wrapping_add(u64::from(!within));
            }
            missed += outside as usize;
            if missed > self.may_miss {
                return false;
            }
        }
        true
    }
}

/// The simple explanations of every channel that leave no texel rounded wrongly, as far as masters tell, with what they cost; the simplest
/// first. `curved`: those through a curve, or those without one. Of volumes, which have too many arrangements, none: see [`nearest`].
pub fn simple(channels: &[Data], masters: &[Arc<Master>], curved: bool) -> Vec<Vec<(Hypothesis, f64)>> {
    let curves = if curved { &Curve::ALL[1..] } else { &Curve::ALL[..1] };
    // One axis has so few arrangements that every place can be tried.
    let places: &[Place] = match channels.first().map_or(0, |data| data.sizes.len()) {
        1 => &Place::ALL,
        2 => &USUAL,
        _ => return vec![vec![]; channels.len()],
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
        .flat_map_iter(|(master, varies, quantity)| {
            try_all(master, varies, *quantity, channels, &coarse, places, curves)
        })
        .collect();
    let mut of_channel: Vec<Vec<(Hypothesis, f64)>> = vec![vec![]; channels.len()];
    let fine = fit::fine(sizes);
    let few = may_miss(&fine);
    let judged: Vec<Option<(usize, Hypothesis, f64)>> = found
        .into_par_iter()
        .map(|(c, hypothesis)| {
            let data = &channels[c];
            let (hypothesis, cost) = fit::as_it_is(hypothesis, data, &fine);
            (hypothesis.misrounded(data, &fine) <= few).then_some((c, hypothesis, cost))
        })
        .collect();
    for (c, hypothesis, cost) in judged.into_iter().flatten() {
        of_channel[c].push((hypothesis, cost));
    }
    for (found, data) in of_channel.iter_mut().zip(channels) {
        let least = found.iter().map(|(h, _)| h.residual).fold(f64::INFINITY, f64::min);
        found.retain(|(h, _)| h.residual <= NEARLY * (least + data.rounding));
        found.sort_by(|(a, a_cost), (b, b_cost)| a.complexity().cmp(&b.complexity()).then(a_cost.total_cmp(b_cost)));
        found.truncate(MOST);
    }
    of_channel
}

/// Every arrangement of one quantity's axes that a channel's texels admit.
fn try_all(
    master: &Arc<Master>,
    varies: &[usize],
    quantity: usize,
    channels: &[Data],
    chosen_texels: &Choice,
    places: &[Place],
    curves: &[Curve],
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
    let bounds: Vec<Bounds> = channels
        .iter()
        .enumerate()
        .flat_map(|(c, data)| {
            curves.iter().map(|&curve| Bounds::of(c, data, curve, &sorted, slack)).collect::<Vec<_>>()
        })
        .collect();
    let mut found = vec![];
    each_prediction(&lookups, &master.plane(quantity), &sizes, &mut |chosen, predicted| {
        for bounds in &bounds {
            for (scale, offset) in KNOWN {
                if found.len() < MOST_OF_ONE && bounds.admit(predicted, scale, offset, slack) {
                    let hypothesis = Hypothesis {
                        master: Arc::clone(master),
                        quantity,
                        ramps: varies.iter().map(|&p| ramps[p][chosen[p]]).collect(),
                        varies: varies.to_vec(),
                        free: None,
                        encoding: Encoding { scale, offset, curve: bounds.curve },
                        residual: 0.0,
                    };
                    found.push((bounds.channel, hypothesis));
                }
            }
        }
    });
    found
}

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
            let tried = fit::as_it_is(Hypothesis { ramps, ..found.clone() }, data, choice);
            if ramp != found.ramps[dimension] && tried.0.misrounded(data, choice) <= few {
                all.push(tried);
            }
        }
    }
    all
}
