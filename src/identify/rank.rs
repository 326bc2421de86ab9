//! Which hypotheses explain a channel best: found and fitted by masters, judged by quadrature.

use super::fit;
use super::hypothesis::{Data, Hypothesis};
use super::judge::{JUDGED_TO, Judge, Ranked};
use super::masters::{self, Shelf};
use super::search::{self, Arrangement};
use super::{Options, simple};
use crate::claim::{Curve, Encoding};
use crate::error::Result;
use rayon::prelude::*;
use std::sync::Arc;

/// Hypotheses of a channel that are fitted.
const FITTED: usize = 14;
/// Residuals, in parts of a channel's variation, below which no further masters are asked.
const GOOD: f64 = 0.01;
/// What rounding leaves, in parts of a channel's variation, above which it is coarse.
const COARSE: f64 = 1e-3;
/// Residuals by the masters up to which it is worth while to ask quadrature whether they are as good.
const NEARLY_GOOD: f64 = 0.1;
/// Residuals of the same, above which a channel is no table: any two smooth tables have more in common.
const HOPELESS: f64 = 0.5;

/// A part of the search: axes of the masters that are asked, curves that values may be stored through, and how much of an axis is covered.
type Round = (usize, &'static [Curve], Arrangement);

/// What is tried, one after the other. Cropped tables, curves, and tables with a parameter fixed are looked into only where nothing simpler
/// explains the channel.
fn rounds(n_axes: usize, shelf: Shelf) -> Vec<Round> {
    const PLAIN: &[Curve] = &[Curve::Plain];
    const CURVED: &[Curve] = &[Curve::Ratio, Curve::Srgb, Curve::Gamma, Curve::Root];
    let whole = (n_axes, PLAIN, Arrangement::Whole);
    let curved = (n_axes, CURVED, Arrangement::Whole);
    match shelf {
        Shelf::First => {
            vec![whole, (n_axes, PLAIN, Arrangement::Cropped), curved, (n_axes + 1, PLAIN, Arrangement::Whole)]
        }
        // Whatever else could be made of families that few tables are of would explain tables that are none of them.
        Shelf::Second if n_axes == 3 => vec![(n_axes, PLAIN, Arrangement::WholeWithEnds), curved],
        Shelf::Second => vec![whole, curved],
        Shelf::Beside => vec![],
    }
}

/// The best hypotheses of each channel, by the masters of one shelf, fitted and judged, the best first; `admitted` is what
/// [`simple::admitted`] finds of them.
pub fn rank(
    channels: &[Data],
    admitted: Vec<[Vec<Hypothesis>; 2]>,
    (n_axes, shelf): (usize, Shelf),
    options: &Options,
    judge: &Judge,
) -> Result<Vec<Vec<Ranked>>> {
    if n_axes == 0 || channels.is_empty() {
        return Ok(vec![vec![]; channels.len()]);
    }
    let mut fitted: Vec<Vec<(Hypothesis, f64)>> = vec![vec![]; channels.len()];
    let mut exact: Vec<Vec<Ranked>> = admitted
        .into_iter()
        .zip(channels)
        .map(|(admitted, data)| exactly_and_simply(admitted, data, judge))
        .collect::<Result<_>>()?;
    for (master_axes, curves, arrangement) in rounds(n_axes, shelf) {
        // Of volumes, the ways to crop them are too many to be tried.
        let too_many = n_axes == 3 && arrangement == Arrangement::Cropped;
        if master_axes > 3 || (n_axes == 1 && master_axes == 2) || too_many {
            continue;
        }
        let mut open = vec![];
        for c in 0..channels.len() {
            let is_explained = !fitted[c].is_empty() && !exact[c].is_empty();
            if !is_explained && is_open(&fitted[c], &channels[c], judge)? {
                open.push(c);
            }
        }
        if open.is_empty() {
            break;
        }
        let masters = masters::load(master_axes, shelf, options.cache)?;
        let data: Vec<Data> = open.iter().map(|&c| channels[c].clone()).collect();
        let found = search::search(&data, &masters, curves, arrangement, FITTED);
        for ((c, data), mut hypotheses) in open.into_iter().zip(&data).zip(found) {
            let choice = fit::fine(&data.sizes);
            if n_axes == 3 && exact[c].is_empty() {
                // Of volumes not all places and warps were tried.
                let mut near: Vec<(Hypothesis, f64)> =
                    hypotheses.par_iter().map(|h| simple::nearest(h, data, &choice)).collect();
                exact[c] = exact_among(near.clone(), data, judge)?;
                // One dimension after the other may lead astray: of the nearest all are tried together.
                near.sort_by(|a, b| a.1.total_cmp(&b.1));
                near.dedup_by(|a, b| says(&a.0) == says(&b.0)); // several lead to the same
                for i in 0..TRIED_EVERYWHERE.min(near.len()) {
                    if exact[c].is_empty() && near[i].0.relative(data) <= NEARLY_GOOD {
                        let tried = simple::everywhere(&near[i].0, data);
                        exact[c] = exact_among(tried.clone(), data, judge)?;
                        near.extend(tried.into_iter().take(SECOND));
                    }
                }
                let beside =
                    exact[c].iter().flat_map(|found| simple::beside(&found.hypothesis, data, &choice)).collect();
                exact[c].extend(exact_among(beside, data, judge)?);
                if !exact[c].is_empty() {
                    fitted[c].extend(near);
                    fitted[c].sort_by(|a, b| a.1.total_cmp(&b.1));
                    continue;
                }
                hypotheses = near.into_iter().map(|(h, _)| h).collect();
            }
            let new: Vec<(Hypothesis, f64)> = hypotheses
                .par_iter()
                .map(|h| {
                    let (h, cost) = fit::fit(h, data, &choice);
                    if h.relative(data) < 0.3 { fit::snap(&h, data, &choice) } else { (h, cost) }
                })
                .collect();
            fitted[c].extend(new);
            fitted[c].sort_by(|a, b| a.1.total_cmp(&b.1));
        }
    }
    let mut ranked: Vec<Vec<Ranked>> = fitted
        .into_iter()
        .zip(channels.iter().zip(&mut exact))
        .map(|(list, (data, exact))| {
            let mut ranked: Vec<Ranked> = vec![];
            for (hypothesis, cost) in list {
                // Two that came to the same are one.
                let same = |r: &Ranked| says(&r.hypothesis) == says(&hypothesis);
                let first = ranked.first().map_or(cost, |r| r.cost);
                let many = exact.is_empty() && cost <= NEARLY_AS_CHEAP * first;
                let most = if many { MOST } else { SECOND };
                if ranked.len() < most && !ranked.iter().any(same) {
                    ranked.push(judge.judged(hypothesis, cost, data)?);
                }
            }
            if let Some(simple) = ranked.first().and_then(|best| best.hypothesis.at_simple_places()) {
                let choice = fit::fine(&data.sizes);
                let (simple, cost) = fit::resettle(&simple, data, &choice);
                let simple = judge.judged(simple, cost, data)?;
                if simple.exact_cost(data) <= ranked[0].exact_cost(data) {
                    ranked[0] = simple;
                }
            }
            let same =
                |a: &Hypothesis, b: &Hypothesis| a.ramps == b.ramps && says(a) == says(b) && a.encoding == b.encoding;
            for new in exact.drain(..) {
                if !ranked.iter().any(|known| same(&new.hypothesis, &known.hypothesis)) {
                    ranked.push(new);
                }
            }
            put_best_first(&mut ranked, data);
            Ok(ranked)
        })
        .collect::<Result<_>>()?;
    agree(&mut ranked);
    Ok(ranked)
}

/// Of what a channel's texels admit, explanations of which every texel is the correct rounding and that have no fitted number.
fn exactly_and_simply([plain, curved]: [Vec<Hypothesis>; 2], data: &Data, judge: &Judge) -> Result<Vec<Ranked>> {
    let mut exact = exact_among(simple::simple(plain, data), data, judge)?;
    // Curves only where nothing plain is exact, or where there are so few texels that it may be so by chance.
    if exact.is_empty() || data.sizes.len() == 1 {
        exact.append(&mut exact_among(simple::simple(curved, data), data, judge)?);
    }
    Ok(exact)
}

/// Those of which every texel is the correct rounding.
fn exact_among(found: Vec<(Hypothesis, f64)>, data: &Data, judge: &Judge) -> Result<Vec<Ranked>> {
    let exact = |(hypothesis, cost): (Hypothesis, f64)| {
        if judge.is_refuted(&hypothesis, data)? {
            return Ok(None);
        }
        Ok(Some(judge.judged(hypothesis, cost, data)?).filter(Ranked::is_exact))
    };
    Ok(found.into_par_iter().map(exact).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}

/// Channels of one table mostly share their axes and their model: of what is exact, that comes first which is over the axes that most
/// channels are explained over exactly, and with the model of most of these.
pub fn agree(ranked: &mut [Vec<Ranked>]) {
    if ranked.len() < 2 {
        return;
    }
    let exact = |list: &'_ [Ranked]| -> Vec<Ranked> { list.iter().filter(|r| r.is_exact()).cloned().collect() };
    let model = |r: &Ranked| r.hypothesis.master.definition.model;
    let lists: Vec<Vec<Ranked>> = ranked.iter().map(|list| exact(list)).collect();
    // How many channels are explained so, by the ramps and then by the model; what it takes to say it.
    let votes = |r: &Ranked| {
        let over = |l: &&Vec<Ranked>| l.iter().any(|o| o.hypothesis.ramps == r.hypothesis.ramps);
        let with =
            |l: &&Vec<Ranked>| l.iter().any(|o| o.hypothesis.ramps == r.hypothesis.ramps && model(o) == model(r));
        (lists.iter().filter(over).count(), lists.iter().filter(with).count())
    };
    let rated: Vec<Vec<(usize, usize)>> = ranked.iter().map(|list| list.iter().map(votes).collect()).collect();
    let most = rated.iter().flatten().max().copied().unwrap_or((0, 0));
    if most.0 < 2 {
        return;
    }
    for (list, votes) in ranked.iter_mut().zip(rated) {
        let own = list.iter().zip(&votes).filter(|(r, _)| r.is_exact()).map(|(_, v)| *v).max().unwrap_or((0, 0));
        list.iter_mut().zip(&votes).for_each(|(r, votes)| r.disagrees = r.is_exact() && votes.0 < own.0);
        if let Some(i) = list.iter().zip(&votes).position(|(r, v)| r.is_exact() && *v == own) {
            list[..=i].rotate_right(1);
        }
    }
}

/// Whether it is worth while to look further for what explains a channel, of which `fitted` are the best explanations so far.
fn is_open(fitted: &[(Hypothesis, f64)], data: &Data, judge: &Judge) -> Result<bool> {
    let Some((best, cost)) = fitted.first() else { return Ok(true) };
    let left = best.relative(data);
    if left <= GOOD {
        // Where rounding is coarse, much comes as near as that: what every texel is the correct rounding of may be found yet.
        let is_coarse = data.rounding > COARSE * data.spread;
        return Ok(is_coarse && !judge.judged(best.clone(), *cost, data)?.is_exact());
    }
    if left.is_nan() || left >= HOPELESS {
        return Ok(false);
    }
    if left > NEARLY_GOOD {
        return Ok(true);
    }
    // It may be the master, of few nodes where the quantity bends, that is off: quadrature is cheaper than a search.
    let choice = fit::fine(&data.sizes);
    let at_simple_places = best.at_simple_places().map(|simple| fit::resettle(&simple, data, &choice));
    let (hypothesis, cost) = at_simple_places.unwrap_or_else(|| (best.clone(), *cost));
    Ok(judge.judged(hypothesis, cost, data)?.trimmed > GOOD * data.spread)
}

/// Brings to the front what quadrature says is best; of what comes to the same numbers, that whose axes are in the usual order.
pub fn put_best_first(ranked: &mut [Ranked], data: &Data) {
    // What every texel is the correct rounding of is right if anything is: of several such, what took the least to say it.
    let simplest = |a: &&usize, b: &&usize| {
        let key = |i: usize| (ranked[i].hypothesis.complexity(), ranked[i].exact_cost(data));
        let ((a, a_cost), (b, b_cost)) = (key(**a), key(**b));
        a.cmp(&b).then(a_cost.total_cmp(&b_cost))
    };
    let exact: Vec<usize> = (0..ranked.len()).filter(|&i| ranked[i].is_exact()).collect();
    // Masters are as good as they are: where quadrature clearly knows better, it decides.
    let least = ranked.iter().map(|r| r.exact_cost(data)).fold(f64::INFINITY, f64::min);
    let cheap = ranked.iter().position(|r| r.exact_cost(data) <= fit::SIMPLE_IS_AS_GOOD * least);
    if let Some(i) = exact.iter().min_by(simplest).copied().or(cheap) {
        ranked[..=i].rotate_right(1);
    }
    let same = |r: &Ranked| r.hypothesis.is_in_order() && r.same_numbers(&ranked[0]);
    if let Some(i) = ranked.iter().position(same) {
        ranked[..=i].rotate_right(1);
    }
}

/// Hypotheses of a volume's channel of which all ramps are tried, if none is exact.
const TRIED_EVERYWHERE: usize = 2;
/// Hypotheses of a channel that are judged by quadrature, and how many where they cost about the same.
const SECOND: usize = 3;
const MOST: usize = 10;
/// What the latter may cost in parts of the first: rounding is coarse, and masters do not tell them apart.
const NEARLY_AS_CHEAP: f64 = 1.3;

/// What a hypothesis says, whatever numbers were fitted.
fn says(h: &Hypothesis) -> String {
    let ramps: Vec<String> =
        h.ramps.iter().map(|r| format!("{:?} {} {}", r.parameter.canonical(), r.flip, r.warp)).collect();
    let model = h.master.definition.model;
    format!("{} {model:?} {ramps:?} {:?}", h.master.definition.quantities()[h.quantity].name, h.encoding.curve)
}

/// How much worse a channel may be explained over the axes of the surest one, and still be taken to have them.
const SHARED_IS_AS_GOOD: f64 = 1.5;

/// What a channel is exactly over the places of another, of which `anchor` is exact: quantities of its family, as they are or encoded as it
/// is. Quadrature alone is asked, which knows all quantities of these places already: where a fit has jumps, masters lie far beside it.
fn exact_beside(anchor: &Hypothesis, data: &Data, judge: &Judge) -> Result<Vec<Ranked>> {
    // What hardly varies by more than quadrature may be off by would be anything.
    if 2.0 * JUDGED_TO > GOOD * data.spread {
        return Ok(vec![]);
    }
    let choice = fit::fine(&data.sizes);
    let mut encodings = vec![Encoding::PLAIN];
    encodings.extend(Some(anchor.encoding).filter(|encoding| *encoding != Encoding::PLAIN));
    let mut exact = vec![];
    for quantity in 0..anchor.master.definition.quantities().len() {
        for &encoding in &encodings {
            let hypothesis = Hypothesis { quantity, encoding, ..anchor.clone() };
            if judge.is_refuted(&hypothesis, data)? {
                continue;
            }
            if let Some((hypothesis, cost)) = fit::as_it_is(hypothesis, data.values.len(), data, &choice) {
                exact.push(judge.judged_by_quadrature(hypothesis, cost, data)?);
            }
        }
    }
    exact.retain(Ranked::is_exact);
    Ok(exact)
}

/// Channels of one table mostly share their axes and their model: whichever the surest has, the others are given too, if they fit
/// about as well. `shelves`: whose quantities they may be.
pub fn share_axes(ranked: &mut [Vec<Ranked>], channels: &[Data], shelves: &[Shelf], options: &Options, judge: &Judge) {
    // What has no fitted number and is exact anyway is surer than what leaves less, unless there are so few levels that it may be by chance.
    let doubts = |c: usize| {
        let (best, data) = (ranked[c].first()?, &channels[c]);
        let is_plain = best.is_exact() && best.hypothesis.is_simple() && data.rounding <= GOOD * data.spread;
        Some((c, !is_plain, (best.trimmed + data.rounding) / data.spread))
    };
    let surest =
        (0..ranked.len()).filter_map(doubts).min_by(|a, b| a.1.cmp(&b.1).then(a.2.total_cmp(&b.2))).map(|(c, ..)| c);
    let Some(best) = surest.and_then(|c| ranked[c].first()) else { return };
    let (anchor, is_exact) = (best.hypothesis.clone(), best.is_exact());
    let n_axes = anchor.ramps.len();
    for (c, list) in ranked.iter_mut().enumerate() {
        if Some(c) == surest {
            continue;
        }
        let data = &channels[c];
        if is_exact
            && !list.iter().any(Ranked::is_exact)
            && let Ok(exact) = exact_beside(&anchor, data, judge)
            && !exact.is_empty()
        {
            list.splice(0..0, exact);
            put_best_first(list, data);
            continue;
        }
        let choice = fit::fine(&data.sizes);
        let of_shelf = |&shelf: &Shelf| masters::load(anchor.master.definition.nodes.len(), shelf, options.cache);
        let Ok(masters) = shelves.iter().map(of_shelf).collect::<Result<Vec<_>>>() else { continue };
        let mut shared: Vec<(Hypothesis, f64)> = vec![];
        for master in masters.concat() {
            // Only masters over the same parameters can share axes.
            let parameters = |m: &masters::Master| m.definition.nodes.iter().map(|a| a.parameter).collect::<Vec<_>>();
            if parameters(&master) != parameters(&anchor.master) || n_axes != anchor.varies.len() {
                continue;
            }
            for quantity in 0..master.definition.quantities().len() {
                for curve in Curve::ALL.into_iter().filter(|curve| curve.admits(&data.values)) {
                    let mut h = Hypothesis { master: Arc::clone(&master), quantity, ..anchor.clone() };
                    h.encoding.curve = curve;
                    shared.push(fit::resettle(&h, data, &choice));
                }
            }
        }
        shared.sort_by(|a, b| a.1.total_cmp(&b.1));
        // Of models that fit alike, the surest channel's.
        let model = |h: &Hypothesis| h.master.definition.model;
        let best = shared.first().map_or(f64::INFINITY, |s| s.1);
        let own_model = shared
            .iter()
            .position(|(h, cost)| Arc::ptr_eq(&h.master, &anchor.master) && *cost <= SHARED_IS_AS_GOOD * best)
            .or_else(|| shared.iter().position(|(h, cost)| *cost == best && model(h) == model(&anchor)))
            .unwrap_or(0);
        if shared.is_empty() {
            continue;
        }
        // What is exact over the same axes already has been compared with the other channels.
        if list.first().is_some_and(|own| {
            own.is_exact()
                && own.hypothesis.ramps == anchor.ramps
                && says(&own.hypothesis) != says(&shared[own_model].0)
        }) {
            continue;
        }
        let (hypothesis, cost) = shared.swap_remove(own_model);
        // By masters alone it may look far worse: they bend where a quantity has a kink, to which another explanation was fitted.
        let as_good = |new: &Ranked| {
            list.first().is_none_or(|own| {
                let as_cheap = new.exact_cost(data) <= SHARED_IS_AS_GOOD * own.exact_cost(data);
                new.is_exact() || (as_cheap && !own.is_exact())
            })
        };
        if let Some(new) = judge.judged(hypothesis, cost, data).ok().filter(as_good) {
            let is_other = |r: &Ranked| r.is_exact() && r.hypothesis.ramps != new.hypothesis.ramps;
            list.retain(|r| says(&r.hypothesis) != says(&new.hypothesis) || is_other(r));
            // What comes second over the same axes is a rival, too.
            shared.sort_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((second, cost)) = shared.into_iter().next()
                && !list.iter().any(|r| r.hypothesis.ramps == second.ramps && says(&r.hypothesis) == says(&second))
                && let Ok(second) = judge.judged(second, cost, data)
            {
                list.push(second);
            }
            list.insert(0, new);
        }
    }
}
