//! What a table holds that somebody else made: which quantities, over which axes, and what went wrong with it.
//!
//! Every quantity is tried over every simple arrangement of axes against [`masters`](masters::Master), which are dense tables of
//! everything that Kiln knows; the best are then fitted: shifts and ranges of axes, factors and offsets of values. What fits best is judged by
//! quadrature, texel by texel, and so is what fits second best. An explanation without a fitted number, of which every texel is the correct
//! rounding, comes before all others; where there are several, as of eight bytes along a smooth curve, each is named and none is more than
//! possible.
//!
//! **Confidence** rests on two ratios. A table is *certain* to be what it is taken for when what is left is what rounding to the file's
//! format leaves (at most twice that) and anything else would leave at least three times as much; *likely* when a thirtieth of its
//! variation is left at most, and anything else leaves half as much again, or has texels rounded wrongly where the best has none; *possible*
//! when a tenth is left, whatever else may be, or more than that where a channel of few levels is, over the axes of a channel that is known, the
//! correct rounding in every texel. Otherwise it is unknown.
//!
//! Families that few tables are of are asked only of what the others do not explain, and named only where they come as near as rounding, or
//! are likely: so they neither cost nor confuse where they are not met.
//!
//! Tables that were sampled are noisy: where what is left has no pattern, all texels together tell explanations apart that leave about as
//! much ([`Noise`]). One is *likely*, too, when any other is five standard deviations away, and the table three times as near to the best.

mod apart;
mod cache;
mod explain;
mod fit;
mod hypothesis;
mod judge;
pub mod masters;
mod ramp;
mod rank;
mod residual;
mod search;
mod simple;
mod span;

pub use explain::{AxisFinding, ChannelFinding, RunnerUp};
pub use judge::Noise;

use crate::claim::{Claim, ClaimedChannel};
use crate::error::{Error, Result};
use crate::format::Grid;
use crate::format::grid::PACKINGS;
use crate::pack::TexelFormat;
use crate::table::TableSpec;
use hypothesis::{Data, Hypothesis};
use judge::{Judge, Ranked};
use masters::Shelf;
use rank::{agree, put_best_first, rank, share_axes};
use residual::rms_without_worst;
use serde::Serialize;
use std::sync::Arc;

/// How to find out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Whether masters are kept in the user's cache folder and read from it.
    pub cache: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { cache: true }
    }
}

/// How sure it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Confidence {
    /// Nothing explains the values.
    Unknown,
    /// The best explanation, but a poor one, or one among several.
    Possible,
    /// A good explanation, better than any other.
    Likely,
    /// As good as rounding allows, and nothing else comes near.
    Certain,
}

impl Confidence {
    /// The word that reports use.
    pub fn words(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Possible => "possibly",
            Self::Likely => "likely",
            Self::Certain => "certainly",
        }
    }
}

/// What a table is found to hold.
#[derive(Debug, Clone, Serialize)]
pub struct Identification {
    /// Size, channels, precision and container.
    pub file: String,
    /// What the file's bytes are codes of, where it does not say so and they make no sense otherwise.
    pub packing: Option<TexelFormat>,
    /// The least sure of the channels.
    pub confidence: Confidence,
    /// What each channel holds.
    pub channels: Vec<ChannelFinding>,
    /// What the texels stand for, of the channel that is surest.
    pub axes: Vec<AxisFinding>,
    /// `transposed`, `flipped`, `shifted by 1 texel in roughness`, `cropped`, `separable` …: what to know before using it.
    pub words: Vec<String>,
    /// The commands that bake the table as it should be.
    pub commands: Vec<String>,
    /// The commands that bake it as it is, where that is not as it should be and a displaced axis says all that is wrong.
    pub commands_as_it_is: Vec<String>,
    /// The same, to be judged by.
    #[serde(skip)]
    pub claim: Claim,
}

impl Identification {
    /// What went wrong with the table, in sentences.
    pub fn faults(&self) -> Vec<String> {
        let faults: Vec<&str> = self.axes.iter().flat_map(|a| &a.faults).map(String::as_str).collect();
        faults.iter().map(|fault| format!("the table is {fault}; it is judged as it should be")).collect()
    }

    /// What the worst channel leaves, in parts of what rounding does.
    fn times_rounding(&self) -> f64 {
        self.channels.iter().filter_map(|c| c.times_rounding).fold(0.0, f64::max)
    }

    /// The channels that nothing explains, in sentences.
    pub fn unexplained(&self) -> Vec<String> {
        let unknown = self.channels.iter().filter(|c| c.confidence == Confidence::Unknown);
        unknown.map(|c| format!("what channel {} holds is unknown", c.channel)).collect()
    }
}

/// Texels below which there is nothing to go by.
const FEWEST_TEXELS: usize = 8;
/// Texels along a dimension below which a warp cannot be told.
const FEWEST_ALONG: usize = 4;
/// How much rougher a file must be, read in one way, than in another that explains it, not to be looked at.
const CLEARLY_ROUGHER: f64 = 1.3;

/// Finds out what `grid` holds; where its bytes make no sense as they are, what they hold as codes of a packing.
///
/// **Errors**: too few texels, values that are mostly no numbers; those of the integrator.
pub fn identify(grid: &Grid, options: &Options) -> Result<Identification> {
    check(grid)?;
    // Codes that all have the same fourth byte are as good as a curve.
    let codes = grid.channels.len() == 4 && grid.channel(3).windows(2).any(|w| w[0] != w[1]);
    let unpacked: Vec<(TexelFormat, Grid)> = if codes {
        PACKINGS.into_iter().filter_map(|packing| Some((packing, grid.unpacked(packing)?))).collect()
    } else {
        vec![]
    };
    let mut readings = vec![Reading::new(None, grid)];
    readings.extend(unpacked.iter().map(|(packing, grid)| Reading::new(Some(*packing), grid)));
    readings.sort_by(|a, b| a.roughness.total_cmp(&b.roughness)); // stable: of equals, the file as it is
    let smooth = CLEARLY_ROUGHER * readings[0].roughness;
    let rough = readings.split_off(readings.partition_point(|reading| reading.roughness <= smooth));
    let judge = Judge::new()?;
    let mut looked: Vec<Looked> = vec![];
    for readings in [readings, rough] {
        // Where the factor of four bytes steps, so do the bytes: read as what they are, tables are smooth. A few texels with a peak are not: then
        // what another reading comes near to is not taken before this one was looked at.
        let is_settled = |found: &Identification| match found.packing {
            None => found.confidence >= Confidence::Likely,
            Some(_) => found.confidence == Confidence::Certain,
        };
        if !looked.iter().any(|looked| is_settled(&looked.found)) {
            looked.extend(first_look(readings, options, &judge)?);
        }
    }
    let surest = looked.iter().map(|looked| looked.found.confidence).max();
    for looked in looked.iter_mut().filter(|looked| Some(looked.found.confidence) == surest) {
        looked.look_again(options, &judge)?;
    }
    let mut best: Option<Identification> = None;
    for Looked { found, .. } in looked {
        // Of readings that explain nothing, the file as it is.
        let rank = |i: &Identification| match i.confidence {
            Confidence::Unknown => (i.confidence, if i.packing.is_none() { 1.0 } else { 0.0 }),
            sure => (sure, -i.times_rounding()),
        };
        if best.as_ref().is_none_or(|best| rank(&found) > rank(best)) {
            best = Some(found);
        }
    }
    best.ok_or_else(|| Error::invalid("a table of nothing", "give one with texels"))
}

/// A file's numbers, read in one of the ways that its bytes allow.
struct Reading<'a> {
    packing: Option<TexelFormat>,
    grid: &'a Grid,
    roughness: f64,
    /// Which channels vary.
    varying: Vec<usize>,
    channels: Vec<Data>,
}

impl<'a> Reading<'a> {
    fn new(packing: Option<TexelFormat>, grid: &'a Grid) -> Self {
        let sizes: Vec<usize> = grid.size.into_iter().filter(|&s| s > 1).collect();
        let data = (0..grid.channels.len()).filter_map(|c| Some((c, channel_data(grid, c, &sizes)?)));
        let (varying, channels) = data.unzip();
        Self { packing, grid, roughness: grid.roughness(), varying, channels }
    }

    /// What the varying channels hold, of which these are the best explanations.
    fn explained(&self, ranked: &[Vec<Ranked>], judge: &Judge) -> Result<Identification> {
        let found = explain::explain(self.grid, &self.varying, &self.channels, ranked, judge)?;
        Ok(Identification { packing: self.packing, ..found })
    }
}

/// Whether there is enough to go by.
fn check(grid: &Grid) -> Result<()> {
    let [width, height, layers] = grid.size;
    if (2..FEWEST_ALONG).contains(&layers) && width.min(height) >= FEWEST_ALONG {
        return Err(Error::unsupported(
            format!("{}, which are too few layers for a volume", grid.summary()),
            format!("look at each by itself, --layer 0 to --layer {}", layers - 1),
        ));
    }
    if grid.texels() < FEWEST_TEXELS || grid.size.iter().any(|s| (2..FEWEST_ALONG).contains(s)) {
        return Err(Error::unsupported(
            format!("{}, too few to tell a table by", grid.summary()),
            format!(
                "give {FEWEST_ALONG} along each dimension at least and {FEWEST_TEXELS} in all, or say what it is with `kiln verify --as`"
            ),
        ));
    }
    for (c, channel) in grid.channels.iter().enumerate() {
        let bad = grid.not_finite(c);
        if 2 * bad > grid.texels() {
            return Err(Error::invalid(
                format!("{bad} of {} values of channel {} are NaN or infinite", grid.texels(), channel.name),
                "export the table again",
            ));
        }
    }
    Ok(())
}

/// What a reading is found to hold, and what else its varying channels may.
struct Looked<'a> {
    reading: Reading<'a>,
    ranked: Vec<Vec<Ranked>>,
    found: Identification,
}

/// What each of some readings of one file is found to hold, by the masters that every table is compared with.
fn first_look<'a>(readings: Vec<Reading<'a>>, options: &Options, judge: &Judge) -> Result<Vec<Looked<'a>>> {
    let all: Vec<Data> = readings.iter().flat_map(|reading| reading.channels.clone()).collect();
    let n_axes = all.first().map_or(0, |data| data.sizes.len());
    let mut admitted = match n_axes {
        0 => vec![],
        n => simple::admitted(&all, &masters::load(n, Shelf::First, options.cache)?),
    };
    let looked = |reading: Reading<'a>| {
        let rest = admitted.split_off(reading.channels.len().min(admitted.len()));
        let own = std::mem::replace(&mut admitted, rest);
        let mut ranked = rank(&reading.channels, own, (n_axes, Shelf::First), options, judge)?;
        share_axes(&mut ranked, &reading.channels, &[Shelf::First], options, judge);
        let found = reading.explained(&ranked, judge)?;
        Ok(Looked { reading, ranked, found })
    };
    readings.into_iter().map(looked).collect()
}

impl Looked<'_> {
    /// Asks the other masters, too, of channels that are not explained.
    fn look_again(&mut self, options: &Options, judge: &Judge) -> Result<()> {
        let Self { reading, ranked, found } = self;
        let open: Vec<usize> = (0..ranked.len()).filter(|&i| is_open(i, reading, ranked, found)).collect();
        let data: Vec<Data> = open.iter().map(|&i| reading.channels[i].clone()).collect();
        let Some(n_axes) = data.first().map(|data| data.sizes.len()) else { return Ok(()) };
        let load = |shelf| masters::load(n_axes, shelf, options.cache);
        let (second, beside) = (load(Shelf::Second)?, load(Shelf::Beside)?);
        let admitted = simple::admitted(&data, &second);
        let mut more = ranked.clone();
        for (&i, new) in open.iter().zip(rank(&data, admitted, (n_axes, Shelf::Second), options, judge)?) {
            more[i].splice(0..0, new);
            put_best_first(&mut more[i], &reading.channels[i]);
        }
        agree(&mut more);
        share_axes(&mut more, &reading.channels, &[Shelf::First, Shelf::Second, Shelf::Beside], options, judge);
        let again = reading.explained(&more, judge)?;
        // That a rare family comes nearer than any other is not enough: it has to be near.
        let is_named = |i: usize| {
            let is_near = again.channels[reading.varying[i]].confidence >= Confidence::Likely;
            more[i].first().is_some_and(|best| {
                let is_rare = second.iter().chain(&beside).any(|rare| Arc::ptr_eq(rare, &best.hypothesis.master));
                is_rare && (is_near || best.is_exact())
            })
        };
        let named: Vec<usize> = open.into_iter().filter(|&i| is_named(i)).collect();
        if named.is_empty() {
            return Ok(());
        }
        for i in named {
            ranked[i] = std::mem::take(&mut more[i]);
        }
        *found = reading.explained(ranked, judge)?;
        Ok(())
    }
}

/// Whether nothing explains a varying channel well: nothing at all, or only what leaves texels that are no rounding of it, or is over other
/// axes than those of its neighbours that are known.
fn is_open(i: usize, reading: &Reading, ranked: &[Vec<Ranked>], found: &Identification) -> bool {
    let confidence = |i: usize| found.channels[reading.varying[i]].confidence;
    let ramps = |i: usize| ranked[i].first().map(|best| &best.hypothesis.ramps);
    let is_exact = ranked[i].first().is_some_and(Ranked::is_exact);
    let mut known = (0..ranked.len()).filter(|&k| k != i && confidence(k) >= Confidence::Likely).peekable();
    let is_odd_one = known.peek().is_some() && known.all(|k| ramps(k) != ramps(i));
    match confidence(i) {
        Confidence::Unknown => true,
        Confidence::Possible => !is_exact || is_odd_one,
        _ => is_odd_one,
    }
}

/// The channel's numbers; `None` for a constant.
fn channel_data(grid: &Grid, c: usize, sizes: &[usize]) -> Option<Data> {
    let values = grid.channel(c);
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let n = finite.len() as f64;
    let mean = finite.iter().sum::<f64>() / n;
    let whole = (finite.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    // Residuals are counted without the worst tenth: so must the spread be, about the median, and what rounding leaves. Nothing explains a
    // channel that varies in that tenth only.
    let mut sorted = finite.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(mean);
    let mut squares: Vec<f64> = finite.iter().map(|v| (v - median).powi(2)).collect();
    let spread = whole.min(2.0 * rms_without_worst(&mut squares));
    let stored = grid.channels[c].stored;
    // The error of rounding is spread evenly over a step.
    let brightest = grid.brightest();
    let steps: Vec<f64> = values.iter().zip(brightest).map(|(&v, most)| stored.step_beside(v, most)).collect();
    let mut squares: Vec<f64> =
        (steps.iter().zip(&values).filter(|(_, v)| v.is_finite())).map(|(s, _)| s * s / 12.0).collect();
    let rounding_of_all = (squares.iter().sum::<f64>() / n).sqrt();
    let rounding = rms_without_worst(&mut squares);
    let (low, high) = finite.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    let sizes = sizes.to_vec();
    let data = || Data { values, sizes, spread, peaks: whole / spread, rounding, rounding_of_all, steps };
    (high - low > 2.0 * stored.step(high)).then(data)
}

/// What a hypothesis claims of channel `index` of the file, as it should be: without shifts.
fn claimed(index: usize, hypothesis: &Hypothesis, grid: &Grid) -> ClaimedChannel {
    let definition = &hypothesis.master.definition;
    let handle = crate::table::quantity::Handle {
        quantity: &definition.quantities()[hypothesis.quantity],
        index: hypothesis.quantity,
        ..definition.handle
    };
    let mut at = definition.at;
    if let (Some(free), Some(last)) = (hypothesis.free, definition.nodes.last()) {
        at.set(last.parameter, (free * 1e4).round() / 1e4);
    }
    let mut ramps = hypothesis.ramps.iter();
    // Dimensions of one texel between others have no axis; a claim over fewer axes needs the others first.
    let axes = grid.size.iter().filter(|&&s| s > 1).filter_map(|_| ramps.next()).map(ramp::Ramp::axis).collect();
    let spec = TableSpec { channels: vec![handle], axes, at, model: definition.model };
    ClaimedChannel { index, spec, encoding: hypothesis.encoding }
}
