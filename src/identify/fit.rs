//! Shifts, ranges and factors of a hypothesis, fitted to a channel; then the simplest places that fit as well.

use super::hypothesis::{Choice, Data, Hypothesis, MASTER_ERROR, choice};
use super::ramp::{Place, Ramp};
use super::residual::{KNOWN, Sums, Wanted, encoding, left, price};
use crate::math::warp::Warp;

/// Indices along each dimension while the best are fitted.
const FINE: [usize; 3] = [128, 24, 10];

/// The choice of texels with which hypotheses are fitted.
pub fn fine(sizes: &[usize]) -> Choice {
    choice(sizes, FINE[sizes.len() - 1])
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

/// Steps of the fit at most.
const STEPS: usize = 20;
/// A texel's shift by which derivatives are taken, and the part of a stretch.
const NUDGE: f64 = 0.02;

/// The hypothesis with shifts, ranges and the free parameter fitted to the channel, and its cost.
pub fn fit(start: &Hypothesis, data: &Data, choice: &Choice) -> (Hypothesis, f64) {
    let curve = start.encoding.curve;
    let values: Vec<f64> = data.at(choice).into_iter().map(|v| curve.undo(v)).collect();
    let floor = data.floor();
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
    let (encoding, residual, cost) = encoding(values, &predicted, curve, &sums, Wanted::any(floor), &mut vec![]);
    (Hypothesis { encoding, residual, ..hypothesis.clone() }, cost)
}

/// The same of a channel, and with the price of its ranges.
pub fn resettle(hypothesis: &Hypothesis, data: &Data, choice: &Choice) -> (Hypothesis, f64) {
    let curve = hypothesis.encoding.curve;
    let values: Vec<f64> = data.at(choice).into_iter().map(|v| curve.undo(v)).collect();
    let (settled, cost) = settle(hypothesis, &values, choice, data.floor());
    let price = price_of_ranges(&settled);
    (settled, cost * price)
}

/// The same with the encoding that it has; nothing where more than `few` texels are rounded wrongly, of those of which the master knows.
pub fn as_it_is(hypothesis: Hypothesis, few: usize, data: &Data, choice: &Choice) -> Option<(Hypothesis, f64)> {
    let predicted = hypothesis.predict_known(choice);
    if hypothesis.misrounded(&predicted, data, choice) > few {
        return None;
    }
    let curve = hypothesis.encoding.curve;
    let values: Vec<f64> = data.at(choice).into_iter().map(|v| curve.undo(v)).collect();
    let residual = left(&values, &predicted, hypothesis.encoding);
    let cost = (residual + data.floor()) * price(hypothesis.encoding) * price_of_ranges(&hypothesis);
    Some((Hypothesis { residual, ..hypothesis }, cost))
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
    let mut rest = by[2 * moved.ramps.len()..].iter();
    if let (Some(free), Some(by)) = (&mut moved.free, rest.clone().next()) {
        let last = moved.master.definition.nodes[moved.master.definition.nodes.len() - 1];
        let position = (last.position(*free) + by).clamp(0.0, (last.size - 1) as f64);
        *free = last.value_at_position(position);
        rest.next();
    }
    for (offset, by) in moved.ramps.iter_mut().filter_map(log_offset).zip(rest) {
        *offset = (*offset * by.exp()).clamp(LEAST_OFFSET, MOST_OFFSET);
    }
    moved
}

/// What is added before a logarithm is taken, within these.
const LEAST_OFFSET: f64 = 1e-4;
const MOST_OFFSET: f64 = 1.0;

/// The offset of a ramp that is even in a logarithm, unless that has none.
fn log_offset(ramp: &mut Ramp) -> Option<&mut f64> {
    match &mut ramp.warp {
        Warp::Log { offset } if *offset > 0.0 => Some(offset),
        _ => None,
    }
}

/// The ramp with the offset of its logarithm rounded to few digits, and how simple that is: 0 is simplest.
fn with_round_offset(ramp: Ramp) -> Vec<(usize, Ramp)> {
    let rounded = |digits: usize| {
        let mut ramp = ramp;
        let offset = log_offset(&mut ramp)?;
        *offset = format!("{:.*e}", digits - 1, *offset).parse().ok()?;
        Some(ramp)
    };
    let few = [1, 2].into_iter().enumerate().filter_map(|(rank, digits)| Some((rank, rounded(digits)?)));
    let mut all: Vec<(usize, Ramp)> = few.collect();
    // As it was fitted, to four digits: only if nothing simple will do.
    let rank = if all.is_empty() { 0 } else { NOT_SIMPLE };
    all.push((rank, rounded(4).unwrap_or(ramp)));
    all
}

/// The rank of what is as it was fitted, and of what is cut between texels.
const NOT_SIMPLE: usize = 100;
const CUT: usize = 50;

/// Levenberg and Marquardt's descent on the residuals with Huber's weights.
fn descend(start: &Hypothesis, values: &[f64], choice: &Choice, fixed: Option<(f64, f64)>) -> Hypothesis {
    let logs = start.ramps.iter().filter(|ramp| log_offset(&mut (**ramp).clone()).is_some()).count();
    let n = 2 * start.ramps.len() + usize::from(start.free.is_some()) + logs;
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
    let had_to_be = |ramp: &&Ramp| ramp.is_fitted() || ramp.is_oddly_shifted();
    hypothesis.ramps.iter().filter(had_to_be).map(|_| PRICE_OF_RANGE).product()
}

/// How much worse simple places of texels may fit than fitted ones, and still be what is meant.
pub const SIMPLE_IS_AS_GOOD: f64 = 1.15;

/// How much worse a place may fit along one dimension of a volume while the others are fitted, and how many such are tried.
const OTHERS_FITTED: f64 = 3.0;
const FEW_PLACES: usize = 4;

/// The hypothesis with its texels at the simplest places that fit about as well as the fitted ones.
pub fn snap(fitted: &Hypothesis, data: &Data, choice: &Choice) -> (Hypothesis, f64) {
    let values: Vec<f64> = data.at(choice).into_iter().map(|v| fitted.encoding.curve.undo(v)).collect();
    let floor = data.floor();
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
                places.iter().flat_map(move |&place| {
                    let placed = match place {
                        None => [ramp.cut_from_larger().map(|cut| (CUT, cut)), Some((NOT_SIMPLE, *ramp))],
                        Some(place) => {
                            let rank = Place::ALL.iter().position(|p| *p == place).unwrap_or(0);
                            [Some((rank, ramp.placed(place))), None]
                        }
                    };
                    placed.into_iter().flatten().flat_map(move |(own, placed)| {
                        let with = move |(round, ramp)| (rank + own + round, [so_far.as_slice(), &[ramp]].concat());
                        with_round_offset(placed).into_iter().map(with)
                    })
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
    let exact: Vec<bool> = tried
        .iter()
        .map(|t| t.1.tells_rounding(data) && t.1.misrounded(&t.1.predict(choice), data, choice) == 0)
        .collect();
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
