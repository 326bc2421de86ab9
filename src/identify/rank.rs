//! Which hypotheses explain a channel best: found and fitted by masters, judged by quadrature.

use super::fit;
use super::hypothesis::{self, Data, Hypothesis};
use super::search::{self, Arrangement};
use super::simple;
use super::{Options, masters};
use crate::claim::Curve;
use crate::error::{Error, Result};
use crate::integrate::{Integration, Settings};
use crate::table::quantity::evaluate_family;
use rayon::prelude::*;
use std::sync::Arc;

/// Hypotheses of a channel that are fitted.
const FITTED: usize = 14;
/// Texels along each dimension at which a hypothesis is judged by quadrature at most, and one whose integrals are dear.
const JUDGED: [usize; 3] = [128, 48, 12];
const JUDGED_IF_DEAR: [usize; 3] = [64, 12, 6];
/// What values may be off by when hypotheses are judged by them.
const JUDGED_TO: f64 = 1e-6;
/// Families whose values take longest, by their masters.
const DEAR: [&str; 4] = ["dielectric.albedo", "dielectric.albedo_avg", "compensation.none", "layered.albedo"];
/// What is left by the masters, in parts of a channel's variation, above which quadrature has nothing to add: it will not be believed.
const NOT_TO_BE_BELIEVED: f64 = 0.25;

/// Residuals, in parts of a channel's variation, below which no further masters are asked.
const GOOD: f64 = 0.01;
/// What rounding leaves, in parts of a channel's variation, above which it is coarse.
const COARSE: f64 = 1e-3;
/// Residuals by the masters up to which it is worth while to ask quadrature whether they are as good.
const NEARLY_GOOD: f64 = 0.1;
/// Residuals of the same, above which a channel is no table: any two smooth tables have more in common.
const HOPELESS: f64 = 0.5;

/// A hypothesis, what it costs by the masters, and its residuals by quadrature.
#[derive(Debug, Clone)]
pub struct Ranked {
    pub hypothesis: Hypothesis,
    pub cost: f64,
    /// Root mean square of what is left, in stored units, by quadrature.
    pub rms: f64,
    /// The same without the worst tenth.
    pub trimmed: f64,
    /// What it says of the texels at which it was judged, and what that may be off by; empty where it is not to be believed.
    pub says: Vec<(f64, f64)>,
    /// The part of them at which the file has another number than correct rounding would give.
    pub misrounded: f64,
    /// Whether it is as good as the best, but not over the axes that more of the table's channels are explained over.
    pub disagrees: bool,
}

impl Ranked {
    /// What it leaves by quadrature, with the price that the masters' residual had.
    fn exact_cost(&self, data: &Data) -> f64 {
        let price = self.cost / (self.hypothesis.residual + hypothesis::MASTER_ERROR + data.rounding);
        (self.trimmed + data.rounding + JUDGED_TO) * price
    }

    /// Whether every texel is the correct rounding of what it says, as far as quadrature tells.
    pub fn is_exact(&self) -> bool {
        !self.says.is_empty() && self.misrounded == 0.0
    }

    /// Whether both say the same of every texel, as far as quadrature tells.
    pub fn same_numbers(&self, other: &Self) -> bool {
        let pairs = || self.says.iter().zip(&other.says);
        // Errors of Monte Carlo are standard errors: four of their sum, so that hardly one in ten thousand is farther off by chance.
        let near = |((a, a_error), (b, b_error)): (&(f64, f64), &(f64, f64))| {
            (a.is_nan() && b.is_nan()) || (a - b).abs() <= 2.0 * JUDGED_TO + 4.0 * (a_error + b_error)
        };
        !self.says.is_empty() && self.says.len() == other.says.len() && pairs().all(near)
    }

    /// Whether another channel of the same table, of which it is certain what it holds, leaves `other` as a rival: it does where this one
    /// stands for other places or another model than that channel, or where `other` stands for the same and is another quantity.
    pub fn is_rivalled_by(&self, other: &Self, certain: &Self) -> bool {
        let model = |r: &Self| r.hypothesis.master.definition.model;
        let is_known = |r: &Self| r.hypothesis.ramps == certain.hypothesis.ramps && model(r) == model(certain);
        !is_known(self) || is_known(other)
    }
}

/// The best hypotheses of each channel, fitted and judged, the best first.
pub fn rank(channels: &[Data], n_axes: usize, options: &Options) -> Result<Vec<Vec<Ranked>>> {
    if n_axes == 0 || channels.is_empty() {
        return Ok(vec![vec![]; channels.len()]);
    }
    let mut fitted: Vec<Vec<(Hypothesis, f64)>> = vec![vec![]; channels.len()];
    let mut exact = exactly_and_simply(channels, masters::load(n_axes, options.cache)?)?;
    // Cropped tables, curves, and tables with a parameter fixed are looked into only where nothing simpler explains the channel.
    let rounds: [(usize, &[Curve], Arrangement); 4] = [
        (n_axes, &[Curve::Plain], Arrangement::Whole),
        (n_axes, &[Curve::Plain], Arrangement::Cropped),
        (n_axes, &[Curve::Ratio, Curve::Srgb, Curve::Gamma, Curve::Root], Arrangement::Whole),
        (n_axes + 1, &[Curve::Plain], Arrangement::Whole),
    ];
    for (master_axes, curves, arrangement) in rounds {
        // Of volumes, the ways to crop them are too many to be tried.
        let too_many = n_axes == 3 && arrangement == Arrangement::Cropped;
        if master_axes > 3 || (n_axes == 1 && master_axes == 2) || too_many {
            continue;
        }
        let mut open = vec![];
        for c in 0..channels.len() {
            let is_explained = !fitted[c].is_empty() && !exact[c].is_empty();
            if !is_explained && is_open(&fitted[c], &channels[c])? {
                open.push(c);
            }
        }
        if open.is_empty() {
            break;
        }
        let masters = masters::load(master_axes, options.cache)?;
        let data: Vec<Data> = open.iter().map(|&c| channels[c].clone()).collect();
        let found = search::search(&data, &masters, curves, arrangement, FITTED);
        for ((c, data), mut hypotheses) in open.into_iter().zip(&data).zip(found) {
            let choice = fit::fine(&data.sizes);
            if n_axes == 3 && exact[c].is_empty() {
                // Of volumes not all places and warps were tried.
                let near: Vec<(Hypothesis, f64)> =
                    hypotheses.par_iter().map(|h| simple::nearest(h, data, &choice)).collect();
                exact[c] = exact_among(near.clone(), data)?;
                let beside =
                    exact[c].iter().flat_map(|found| simple::beside(&found.hypothesis, data, &choice)).collect();
                exact[c].extend(exact_among(beside, data)?);
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
                    ranked.push(judged(hypothesis, cost, data)?);
                }
            }
            if let Some(simple) = ranked.first().and_then(|best| best.hypothesis.at_simple_places()) {
                let choice = fit::fine(&data.sizes);
                let (simple, cost) = fit::resettle(&simple, data, &choice);
                let simple = judged(simple, cost, data)?;
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
            // Of what comes to the same numbers, that whose axes are in the usual order.
            let same = |r: &Ranked| r.hypothesis.is_in_order() && r.same_numbers(&ranked[0]);
            if let Some(i) = ranked.iter().position(same) {
                ranked[..=i].rotate_right(1);
            }
            Ok(ranked)
        })
        .collect::<Result<_>>()?;
    agree(&mut ranked);
    Ok(ranked)
}

/// Explanations of which every texel is the correct rounding and that have no fitted number.
fn exactly_and_simply(channels: &[Data], masters: Vec<Arc<masters::Master>>) -> Result<Vec<Vec<Ranked>>> {
    let exact = |channels: &[Data], curved| -> Result<Vec<Vec<Ranked>>> {
        let found = simple::simple(channels, &masters, curved).into_iter().zip(channels);
        found.map(|(found, data)| exact_among(found, data)).collect()
    };
    let mut all = exact(channels, false)?;
    // Curves only where nothing plain is exact, or where there are so few texels that it may be so by chance.
    let is_open = |c: &usize| all[*c].is_empty() || channels[*c].sizes.len() == 1;
    let open: Vec<usize> = (0..channels.len()).filter(is_open).collect();
    let data: Vec<Data> = open.iter().map(|&c| channels[c].clone()).collect();
    for (c, mut curved) in open.into_iter().zip(exact(&data, true)?) {
        all[c].append(&mut curved);
    }
    Ok(all)
}

/// Those of which every texel is the correct rounding.
fn exact_among(found: Vec<(Hypothesis, f64)>, data: &Data) -> Result<Vec<Ranked>> {
    let exact = |(hypothesis, cost): (Hypothesis, f64)| {
        if is_refuted(&hypothesis, data)? {
            return Ok(None);
        }
        Ok(Some(judged(hypothesis, cost, data)?).filter(Ranked::is_exact))
    };
    Ok(found.into_par_iter().map(exact).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}

/// Channels of one table mostly share their axes and their model: of what is exact, that comes first which is over the axes that most
/// channels are explained over exactly, and with the model of most of these.
fn agree(ranked: &mut [Vec<Ranked>]) {
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
fn is_open(fitted: &[(Hypothesis, f64)], data: &Data) -> Result<bool> {
    let Some((best, cost)) = fitted.first() else { return Ok(true) };
    let left = best.relative(data);
    if left <= GOOD {
        // Where rounding is coarse, much comes as near as that: what every texel is the correct rounding of may be found yet.
        let is_coarse = data.rounding > COARSE * data.spread;
        return Ok(is_coarse && !judged(best.clone(), *cost, data)?.is_exact());
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
    Ok(judged(hypothesis, cost, data)?.trimmed > GOOD * data.spread)
}

/// Brings to the front what quadrature says is best.
fn put_best_first(ranked: &mut [Ranked], data: &Data) {
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
}

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

/// What a hypothesis says of a texel as it is stored, before it is rounded, and what that may be off by.
fn at_texel(hypothesis: &Hypothesis, data: &Data, texel: usize, integration: &Integration) -> Result<(f64, f64)> {
    let definition = &hypothesis.master.definition;
    let (mut rest, mut at) = (texel, definition.at);
    for (ramp, &size) in hypothesis.ramps.iter().zip(&data.sizes) {
        at.set(ramp.parameter, ramp.value(rest % size));
        rest /= size;
    }
    if let (Some(free), Some(last)) = (hypothesis.free, definition.nodes.last()) {
        at.set(last.parameter, free);
    }
    let (exact, error) = match evaluate_family(definition.handle.family, &at, &definition.model, integration) {
        Ok(estimates) => (estimates[hypothesis.quantity].value, estimates[hypothesis.quantity].error),
        Err(Error::Unsupported(_)) => (f64::NAN, 0.0), // it diverges there
        Err(other) => return Err(other),
    };
    let stored = hypothesis.encoding.encode(exact);
    Ok((stored, (hypothesis.encoding.encode(exact + error) - stored).abs()))
}

/// Whether a texel is not the correct rounding of what is said of it.
fn is_off((says, error): (f64, f64), data: &Data, texel: usize) -> bool {
    (says - data.values[texel]).abs() > 0.5 * data.steps[texel] + 2.0 * JUDGED_TO + error
}

/// Texels that are looked at before all are, and where their values take longest: most explanations fail at one of the first.
const FIRST_LOOK: usize = 256;
const FIRST_LOOK_IF_DEAR: usize = 48;

/// Whether one of some texels is not the correct rounding of what is said of it.
fn is_refuted(hypothesis: &Hypothesis, data: &Data) -> Result<bool> {
    let definition = &hypothesis.master.definition;
    if !definition.handle.family.has_quadrature() {
        return Ok(true); // as far as chance tells, nothing is exact
    }
    let integration = Integration::new(Settings { tolerance: Some(JUDGED_TO), ..Settings::default() })?;
    let n = data.values.len();
    let look = if DEAR.contains(&definition.handle.quantity.name) { FIRST_LOOK_IF_DEAR } else { FIRST_LOOK };
    // Far apart from each other, and in all rows and columns.
    let share_none = |step: &usize| (2..=*step).all(|d| !step.is_multiple_of(d) || !n.is_multiple_of(d));
    let step = (n * 5 / 8..n).find(share_none).unwrap_or(1);
    for k in 0..n.min(look) {
        let texel = k * step % n;
        if is_off(at_texel(hypothesis, data, texel, &integration)?, data, texel) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The hypothesis with its residuals by quadrature.
fn judged(hypothesis: Hypothesis, cost: f64, data: &Data) -> Result<Ranked> {
    if hypothesis.relative(data) > NOT_TO_BE_BELIEVED {
        let left = hypothesis.residual;
        return Ok(Ranked {
            hypothesis,
            cost,
            rms: left,
            trimmed: left,
            says: vec![],
            misrounded: 1.0,
            disagrees: false,
        });
    }
    let definition = &hypothesis.master.definition;
    let family = definition.handle.family;
    let dear = DEAR.contains(&definition.handle.quantity.name) || !family.has_quadrature();
    let most = if dear { JUDGED_IF_DEAR } else { JUDGED };
    let choice = hypothesis::choice(&data.sizes, most[data.sizes.len() - 1]);
    let settings = Settings {
        tolerance: Some(JUDGED_TO),
        samples: (!family.has_quadrature()).then_some(4096),
        ..Settings::default()
    };
    let settings = if settings.samples.is_some() { Settings { tolerance: None, ..settings } } else { settings };
    let integration = Integration::new(settings)?;
    let texels = hypothesis::indices(&data.sizes, &choice);
    let says: Vec<(f64, f64)> =
        texels.par_iter().map(|&texel| at_texel(&hypothesis, data, texel, &integration)).collect::<Result<_>>()?;
    let off = |(says, &texel): (&(f64, f64), &usize)| ((says.0 - data.values[texel]).abs(), is_off(*says, data, texel));
    let offs: Vec<(f64, bool)> = says.iter().zip(&texels).map(off).filter(|(off, _)| off.is_finite()).collect();
    let misrounded = offs.iter().filter(|(_, far)| *far).count() as f64 / offs.len().max(1) as f64;
    let mut squares: Vec<f64> = offs.iter().map(|(off, _)| off * off).collect();
    if 2 * squares.len() < texels.len() {
        squares = vec![f64::INFINITY]; // where it has no value it explains nothing
    }
    squares.sort_by(f64::total_cmp);
    let rms = |s: &[f64]| (s.iter().sum::<f64>() / s.len().max(1) as f64).sqrt();
    let (all, best) = (rms(&squares), rms(&squares[..(squares.len() * 9).div_ceil(10)]));
    Ok(Ranked { hypothesis, cost, rms: all, trimmed: best, says, misrounded, disagrees: false })
}

/// How much worse a channel may be explained over the axes of the surest one, and still be taken to have them.
const SHARED_IS_AS_GOOD: f64 = 1.5;

/// The same by the masters alone, beyond which quadrature is not asked.
const NOT_WORTH_A_LOOK: f64 = 10.0;

/// Channels of one table mostly share their axes and their model: whichever the surest has, the others are given too, if they fit
/// about as well.
pub fn share_axes(ranked: &mut [Vec<Ranked>], channels: &[Data], options: &Options) {
    let relative = |c: usize, r: &Ranked| (r.trimmed + channels[c].rounding) / channels[c].spread;
    let surest = (0..ranked.len())
        .filter_map(|c| Some((c, relative(c, ranked[c].first()?))))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(c, _)| c);
    let Some(anchor) = surest.and_then(|c| ranked[c].first().map(|r| r.hypothesis.clone())) else { return };
    let n_axes = anchor.ramps.len();
    for (c, list) in ranked.iter_mut().enumerate() {
        if Some(c) == surest {
            continue;
        }
        let data = &channels[c];
        let choice = fit::fine(&data.sizes);
        let Ok(masters) = masters::load(anchor.master.definition.nodes.len(), options.cache) else { continue };
        let mut shared: Vec<(Hypothesis, f64)> = vec![];
        for master in masters {
            // Only masters over the same parameters can share axes.
            let parameters = |m: &masters::Master| m.definition.nodes.iter().map(|a| a.parameter).collect::<Vec<_>>();
            if parameters(&master) != parameters(&anchor.master) || n_axes != anchor.varies.len() {
                continue;
            }
            for quantity in 0..master.definition.quantities().len() {
                for curve in Curve::ALL {
                    let mut h = Hypothesis { master: Arc::clone(&master), quantity, ..anchor.clone() };
                    h.encoding.curve = curve;
                    shared.push(fit::resettle(&h, data, &choice));
                }
            }
        }
        shared.sort_by(|a, b| a.1.total_cmp(&b.1));
        // Of models that fit alike, the surest channel's.
        let best = shared.first().map_or(f64::INFINITY, |s| s.1);
        let own_model = shared
            .iter()
            .position(|(h, cost)| Arc::ptr_eq(&h.master, &anchor.master) && *cost <= SHARED_IS_AS_GOOD * best)
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
        let hopeless = list.first().is_some_and(|own| cost > NOT_WORTH_A_LOOK * own.cost);
        let as_good = |new: &Ranked| {
            list.first().is_none_or(|own| {
                let as_cheap = new.exact_cost(data) <= SHARED_IS_AS_GOOD * own.exact_cost(data);
                new.is_exact() || (as_cheap && !own.is_exact())
            })
        };
        if !hopeless && let Some(new) = judged(hypothesis, cost, data).ok().filter(as_good) {
            let is_other = |r: &Ranked| r.is_exact() && r.hypothesis.ramps != new.hypothesis.ramps;
            list.retain(|r| says(&r.hypothesis) != says(&new.hypothesis) || is_other(r));
            // What comes second over the same axes is a rival, too.
            shared.sort_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((second, cost)) = shared.into_iter().next()
                && !list.iter().any(|r| r.hypothesis.ramps == second.ramps && says(&r.hypothesis) == says(&second))
                && let Ok(second) = judged(second, cost, data)
            {
                list.push(second);
            }
            list.insert(0, new);
        }
    }
}
