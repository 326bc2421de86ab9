//! From hypotheses to words: what a person searches for, and the command that bakes the table as it should be.

use super::hypothesis::{Data, Hypothesis};
use super::judge::{Judge, Noise, Ranked};
use super::ramp::{Place, Ramp};
use super::{Confidence, Identification, claimed};
use crate::claim::{Claim, ClaimedChannel, Curve, Encoding, model_words};
use crate::error::Result;
use crate::format::Grid;
use crate::format::grid::Stored;
use crate::model::ggx::Smith;
use crate::table::named::TABLES;
use crate::table::{Axis, Model, Parameter, TableSpec};
use serde::Serialize;

/// What one channel is found to hold.
#[derive(Debug, Clone, Serialize)]
pub struct ChannelFinding {
    /// The channel's name in the file.
    pub channel: String,
    /// How it is stored.
    pub stored: Stored,
    /// How many of its values are NaN or infinite: of these nothing is said.
    pub not_finite: usize,
    /// How sure it is.
    pub confidence: Confidence,
    /// What it holds, in a few words: `scale`, `E`, `constant 0`, `unknown`.
    pub holds: String,
    /// The quantity, as `kiln list quantities` has it.
    pub quantity: Option<String>,
    /// Masking, visibility.
    pub model: Option<String>,
    /// How values are encoded, if they are.
    pub encoding: Option<String>,
    /// Root mean square of what the explanation leaves, by quadrature.
    pub residual: Option<f64>,
    /// The same in parts of the channel's standard deviation.
    pub relative: Option<f64>,
    /// The same in parts of what rounding to the file's format leaves.
    pub times_rounding: Option<f64>,
    /// What it leaves where that is more than rounding does.
    pub noise: Option<Noise>,
    /// The best of the other explanations.
    pub runner_up: Option<RunnerUp>,
    /// Explanations that come to the same numbers: nothing in the file tells them apart.
    pub same: Vec<String>,
    /// Explanations that come to other numbers, of which every texel is the correct rounding all the same, and that have no fitted number
    /// either: the file does not tell them apart.
    pub as_good: Vec<String>,
}

/// An explanation that is not the best.
#[derive(Debug, Clone, Serialize)]
pub struct RunnerUp {
    /// What it says.
    pub what: String,
    /// Root mean square of what it leaves.
    pub residual: f64,
    /// How many times what the best one leaves.
    pub times: f64,
    /// Where the best one leaves noise: how many standard deviations of that the table is from this one, over all texels.
    pub deviations: Option<f64>,
    /// Whether it is near, and yet no rival, as other channels of the table make it certain what the texels stand for.
    pub ruled_out: bool,
}

/// What the texels along one dimension stand for.
#[derive(Debug, Clone, Serialize)]
pub struct AxisFinding {
    /// `x`, `y` or `z`.
    pub dimension: String,
    /// The axis as it should be, as `kiln table --axes` has it.
    pub axis: String,
    /// What texel 0 and the last one stand for.
    pub ends: [f64; 2],
    /// Which of them is the smaller, and where in their texels values sit, in words.
    pub text: String,
    /// What is wrong with it, such as `shifted by 1 texel in roughness`.
    pub faults: Vec<String>,
}

/// Residuals in parts of rounding up to which nothing is left to explain.
const AS_ROUNDED: f64 = 2.0;
/// How many times the residual another explanation must leave for the best to be certain, and likely.
const FAR: f64 = 3.0;
const FARTHER: f64 = 1.5;
/// The part of the texels that an explanation must have rounded wrongly to be refuted by one that has none so.
const REFUTED: f64 = 0.05;
/// How many standard deviations of the noise another explanation must be away to be none, over all texels, and how near to it the table may
/// be: it must be three times as near to the best.
const DEVIATIONS: f64 = 5.0;
const NEARER: f64 = 0.25;
/// What two explanations may be apart, in parts of what the best one leaves, to be nothing that the table could tell apart.
const HARDLY_ANOTHER: f64 = 0.5;
/// Parts of a channel's variation that may be left for it to be likely, and possible.
const LITTLE: f64 = 1.0 / 30.0;
const MUCH: f64 = 0.1;
/// The same where a factor and an offset of no meaning had to be fitted, or two ranges, or a curve and a range: more numbers explain a lot.
const MUCH_OF_ANY: f64 = 0.01;
/// The same where both were: a smooth product of two functions is met as closely as that.
const MUCH_OF_ANYTHING: f64 = 0.001;

pub(super) fn explain(
    grid: &Grid,
    varying: &[usize],
    data: &[Data],
    ranked: &[Vec<Ranked>],
    judge: &Judge,
) -> Result<Identification> {
    let mut channels = vec![];
    let (mut claim, mut as_it_is) = (Claim::default(), Claim::default());
    let mut surest: Option<(f64, Hypothesis)> = None;
    // The best explanation of a channel that is certain by itself, or else likely: the other channels are of the same table.
    let mut surest_alone: Option<(Confidence, f64, &Ranked)> = None;
    for (&c, (data, ranked)) in varying.iter().zip(data.iter().zip(ranked)) {
        let confidence = found(grid, c, data, ranked, None, judge)?.confidence;
        if confidence >= Confidence::Likely {
            let left = ranked[0].trimmed / data.spread;
            let is_surer = |&(sure, least, _): &(Confidence, f64, &Ranked)| (confidence, -left) > (sure, -least);
            if surest_alone.as_ref().is_none_or(is_surer) {
                surest_alone = Some((confidence, left, &ranked[0]));
            }
        }
    }
    let sure = surest_alone.map(|(confidence, _, best)| (confidence, best));
    for c in 0..grid.channels.len() {
        let Some(i) = varying.iter().position(|&v| v == c) else {
            channels.push(constant(grid, c));
            continue;
        };
        let finding = found(grid, c, &data[i], &ranked[i], sure, judge)?;
        if finding.confidence > Confidence::Unknown
            && let Some(best) = ranked[i].first()
        {
            let claimed = claimed(c, &best.hypothesis, grid);
            let mut found = claimed.clone();
            found.spec.axes = best.hypothesis.ramps.iter().map(Ramp::axis_as_it_is).collect();
            as_it_is.channels.push(found);
            claim.channels.push(claimed);
            let relative = best.trimmed / data[i].spread;
            if surest.as_ref().is_none_or(|(least, _)| relative < *least) {
                surest = Some((relative, best.hypothesis.clone()));
            }
        }
        channels.push(finding);
    }
    let confidence = channels
        .iter()
        .filter(|c| !c.holds.starts_with("constant"))
        .map(|c| c.confidence)
        .min()
        .unwrap_or(Confidence::Unknown);
    let axes = surest.as_ref().map_or(vec![], |(_, h)| axes(h));
    let words = words(&claim, &axes, surest.as_ref().map(|(_, h)| h));
    let displaced = as_it_is.channels.iter().any(|c| c.spec.axes.iter().any(|axis| axis.shift != 0.0));
    let commands_as_it_is = if displaced { commands(&as_it_is, grid, "-as-it-is") } else { vec![] };
    let commands = commands(&claim, grid, "");
    Ok(Identification {
        file: grid.summary(),
        packing: None,
        confidence,
        channels,
        axes,
        words,
        commands,
        commands_as_it_is,
        claim,
    })
}

fn constant(grid: &Grid, c: usize) -> ChannelFinding {
    let channel = &grid.channels[c];
    let value = grid.channel(c).into_iter().find(|v| v.is_finite()).unwrap_or(f64::NAN);
    let empty = if value == 0.0 { ", an empty channel" } else { "" };
    ChannelFinding {
        channel: channel.name.clone(),
        stored: channel.stored,
        not_finite: grid.not_finite(c),
        confidence: Confidence::Certain,
        holds: format!("constant {value:.6}{empty}"),
        quantity: None,
        model: None,
        encoding: None,
        residual: None,
        relative: None,
        times_rounding: None,
        noise: None,
        runner_up: None,
        same: vec![],
        as_good: vec![],
    }
}

/// What channel `c` holds, given an explanation of another that is certain or likely.
///
/// **Errors**: those of the integrator.
fn found(
    grid: &Grid,
    c: usize,
    data: &Data,
    ranked: &[Ranked],
    sure: Option<(Confidence, &Ranked)>,
    judge: &Judge,
) -> Result<ChannelFinding> {
    let unknown = ChannelFinding {
        channel: grid.channels[c].name.clone(),
        stored: grid.channels[c].stored,
        not_finite: grid.not_finite(c),
        confidence: Confidence::Unknown,
        holds: "unknown".to_owned(),
        quantity: None,
        model: None,
        encoding: None,
        residual: None,
        relative: None,
        times_rounding: None,
        noise: None,
        runner_up: None,
        same: vec![],
        as_good: vec![],
    };
    let Some(best) = ranked.first() else { return Ok(unknown) };
    let relative = best.trimmed / data.spread;
    let times_rounding = best.rms / data.rounding_of_all.max(1e-7);
    let times = |other: &Ranked| (other.trimmed + data.rounding) / (best.trimmed + data.rounding);
    let (same, others): (Vec<&Ranked>, Vec<&Ranked>) = ranked[1..].iter().partition(|r| r.same_numbers(best));
    // Where another channel makes it certain what the texels stand for, and over that nothing is left to explain, what explains this one
    // over other axes, cropped and stretched as they had to be, is no rival.
    let certain = sure.filter(|(confidence, _)| *confidence == Confidence::Certain).map(|(_, other)| other);
    let known = certain.filter(|&other| times_rounding <= AS_ROUNDED && !std::ptr::eq(other, best));
    let (rivals, ruled_out): (Vec<&Ranked>, Vec<&Ranked>) = others
        .into_iter()
        .partition(|other| !other.disagrees && known.is_none_or(|known| best.is_rivalled_by(other, known)));
    let as_good = rivals.iter().filter(|other| best.is_exact() && other.is_exact() && other.hypothesis.is_simple());
    let as_good: Vec<String> = as_good.map(|other| what(&other.hypothesis)).collect();
    // Where all of many texels are what rounding makes of the best explanation, what would have some of them rounded wrongly is refuted,
    // however little that is.
    let is_refuted = |other: &&Ranked| best.misrounded == 0.0 && other.misrounded >= REFUTED;
    let is_near = |other: &&Ranked| times(other) < FARTHER;
    // What is left without a pattern is noise: over many texels that averages out, and tells what is nearly as near from what is right.
    let noise = judge.noise(best, data)?.filter(|_| times_rounding > AS_ROUNDED);
    let is_noise = times_rounding <= AS_ROUNDED || noise.is_some_and(|noise| !noise.is_patterned());
    let mut rivalled = false;
    for other in rivals.iter().filter(|other| is_near(other) && !is_refuted(other)) {
        let Some((apart, difference)) = judge.apart(best, other, data)? else {
            rivalled = true;
            continue;
        };
        let is_far = is_noise && apart.deviations >= DEVIATIONS && apart.towards <= NEARER;
        // A parameter that was free to take whatever value comes to about the same numbers tells nothing new.
        let is_no_news = other.hypothesis.free.is_some()
            && best.hypothesis.free.is_none()
            && difference <= HARDLY_ANOTHER * (best.trimmed + data.rounding);
        rivalled |= !is_far && !is_no_news;
    }
    let nearest = |list: &[&Ranked]| list.iter().copied().min_by(|a, b| a.trimmed.total_cmp(&b.trimmed)).cloned();
    let away = nearest(&rivals).as_ref().map_or(f64::INFINITY, times);
    let mut runner_up = None;
    if let Some(second) = nearest(&rivals).or_else(|| nearest(&ruled_out)) {
        let apart = if is_noise && times(&second) < FAR { judge.apart(best, &second, data)? } else { None };
        runner_up = Some(RunnerUp {
            what: what(&second.hypothesis),
            residual: second.rms,
            times: times(&second),
            deviations: apart.map(|(apart, _)| apart.deviations).filter(|d| d.is_finite() && *d >= 1.0),
            ruled_out: rivals.is_empty() && times(&second) < FAR,
        });
    }
    let encoding = best.hypothesis.encoding;
    // What had to be fitted to another channel is none of this one's numbers.
    let is_shared =
        sure.is_some_and(|(_, other)| !std::ptr::eq(other, best) && other.hypothesis.ramps == best.hypothesis.ramps);
    let fitted = match is_shared {
        true => 0,
        false => best.hypothesis.ramps.iter().filter(|ramp| ramp.shift().is_none()).count(),
    };
    let curved = encoding.curve != Curve::Plain;
    // The more is free, the less a middling fit says.
    let most = match (is_named(&encoding), fitted) {
        (false, 1..) => MUCH_OF_ANYTHING,
        (false, 0) | (true, 2..) => MUCH_OF_ANY,
        (true, 1) if curved => MUCH_OF_ANY,
        (true, 1) => LITTLE,
        _ => MUCH,
    };
    let confidence = if relative > most {
        // Of few levels, rounding leaves a lot: over the axes of a known channel, what all of it is may be what it is.
        if is_shared && best.is_exact() { Confidence::Possible } else { Confidence::Unknown }
    } else if times_rounding <= AS_ROUNDED && away >= FAR {
        Confidence::Certain
    } else if (relative <= LITTLE || is_noise) && !rivalled {
        Confidence::Likely
    } else {
        Confidence::Possible
    };
    let figures = (Some(best.rms), Some(relative), Some(times_rounding));
    if confidence == Confidence::Unknown {
        // What comes nearest is told, but not as what it is.
        let nearest = RunnerUp {
            what: what(&best.hypothesis),
            residual: best.rms,
            times: 1.0,
            deviations: None,
            ruled_out: false,
        };
        return Ok(ChannelFinding { runner_up: Some(nearest), ..unknown });
    }
    let definition = &best.hypothesis.master.definition;
    let quantity = &definition.quantities()[best.hypothesis.quantity];
    let spec = claimed_model(&best.hypothesis);
    let model = model_words(&spec);
    Ok(ChannelFinding {
        confidence,
        holds: short(quantity.name).to_owned(),
        quantity: Some(quantity.name.to_owned()),
        model: Some(model.trim_matches([' ', '(', ')']).to_owned()).filter(|m| !m.is_empty()),
        encoding: Some(encoding.to_string()).filter(|text| !text.is_empty()),
        residual: figures.0,
        relative: figures.1,
        times_rounding: figures.2,
        noise,
        runner_up,
        // Not what turns the numbers round to come to the same.
        as_good,
        same: same.into_iter().filter(|r| r.hypothesis.encoding == encoding).map(|r| what(&r.hypothesis)).collect(),
        ..unknown
    })
}

/// Whether factor and offset mean something.
fn is_named(encoding: &Encoding) -> bool {
    let simple = |v: f64| [0.0, 1.0, -1.0, 0.5, -0.5, 2.0, 0.25, 4.0].contains(&v);
    let pi = [std::f64::consts::PI, std::f64::consts::FRAC_1_PI, 1.0 / 255.0];
    (simple(encoding.scale) || pi.contains(&encoding.scale)) && simple(encoding.offset)
}

/// What people call a quantity.
fn short(name: &'static str) -> &'static str {
    match name {
        "ggx.scale" | "beckmann.scale" => "scale",
        "ggx.bias" | "beckmann.bias" => "bias",
        "ggx.albedo" | "beckmann.albedo" => "albedo E",
        "charlie.albedo" => "cloth (sheen) albedo",
        "ggx.f82" => "F82 tint",
        "burley.albedo" | "burley-renormalized.albedo" => "diffuse albedo",
        other => other,
    }
}

fn claimed_model(hypothesis: &Hypothesis) -> TableSpec {
    let definition = &hypothesis.master.definition;
    TableSpec { channels: vec![definition.handle], model: definition.model, ..TableSpec::default() }
}

/// A hypothesis in one line: `ggx.bias (separable Smith) over mu:64 × roughness:64`.
fn what(hypothesis: &Hypothesis) -> String {
    let definition = &hypothesis.master.definition;
    let axes: Vec<String> = hypothesis.ramps.iter().map(|r| r.axis().brief()).collect();
    let encoding = match hypothesis.encoding.to_string() {
        text if text.is_empty() => text,
        text => format!(", {text}"),
    };
    let shifts: Vec<String> = hypothesis.ramps.iter().flat_map(faults).collect();
    let shifts = if shifts.is_empty() { String::new() } else { format!(", {}", shifts.join(", ")) };
    format!(
        "{}{} over {}{encoding}{shifts}",
        definition.quantities()[hypothesis.quantity].name,
        model_words(&claimed_model(hypothesis)),
        axes.join(" × ")
    )
}

/// What is wrong with the places of texels.
fn faults(ramp: &Ramp) -> Vec<String> {
    let name = ramp.parameter;
    match ramp.shift() {
        Some(0.0) => vec![],
        Some(shift) => {
            let n = shift.abs();
            let texels = if n == 1.0 { "1 texel".to_owned() } else { format!("{n} texels") };
            vec![format!("shifted by {texels} in {name}")]
        }
        None if name.range().is_some() && ramp.step * (ramp.size as f64) < 1.0 => vec![format!("cropped in {name}")],
        None => vec![],
    }
}

fn axes(hypothesis: &Hypothesis) -> Vec<AxisFinding> {
    let names = ["x", "y", "z"];
    hypothesis
        .ramps
        .iter()
        .zip(names)
        .map(|(ramp, dimension)| {
            let axis = ramp.axis();
            let ends = [ramp.value(0), ramp.value(ramp.size - 1)];
            let place = match ramp.place() {
                Some(Place::Centre(_)) => "texels hold their centres",
                Some(Place::Edge(_)) => "the outermost texels hold the ends",
                None if ramp.shift().is_some() => "texels hold about their centres",
                None => "neither centres nor edges of the whole range",
            };
            let place = match ramp.shift() {
                Some(shift) if shift != 0.0 => {
                    format!("{place}, but each has the value that belongs {shift:+} texels further up the axis")
                }
                _ => place.to_owned(),
            };
            let order = if ramp.flip { "flipped, " } else { "" };
            let text = format!("{}, {order}{place}", axis.warp);
            AxisFinding { dimension: dimension.to_owned(), axis: axis.brief(), ends, text, faults: faults(ramp) }
        })
        .collect()
}

/// The words that a person searches for.
fn words(claim: &Claim, axes: &[AxisFinding], surest: Option<&Hypothesis>) -> Vec<String> {
    let mut words = vec![];
    let Some(surest) = surest else { return vec!["unknown".to_owned()] };
    if surest.varies.windows(2).any(|w| w[0] > w[1]) {
        words.push("transposed".to_owned());
    }
    for ramp in surest.ramps.iter().filter(|r| r.flip) {
        words.push(format!("flipped in {}", ramp.parameter));
    }
    words.extend(axes.iter().flat_map(|a| a.faults.clone()));
    let separable =
        claim.channels.iter().any(|c| c.spec.model.smith == Smith::Separable && model_words(&c.spec).contains("Smith"));
    if separable {
        words.push("separable".to_owned());
    }
    words
}

/// The named table whose axes stand for two parameters each, if that is what two groups of channels are.
fn of_two_parameters(claim: &Claim, grid: &Grid) -> Option<(&'static str, Vec<Axis>)> {
    let groups = claim.groups();
    let [(first, _), (second, _)] = groups.as_slice() else { return None };
    let table = TABLES.iter().find(|table| {
        let is_there = |c: &ClaimedChannel| table.channels.get(c.index) == Some(&c.spec.channels[0].quantity.name);
        table.channels.len() == grid.channels.len() && claim.channels.iter().all(is_there)
    })?;
    let both = |a: &[Axis], b: &[Axis]| -> Option<Vec<Axis>> {
        let merged = a.iter().zip(b).map(|(a, b)| Axis { also: Some(b.parameter), ..*a });
        let merged: Vec<Axis> = merged.collect();
        let is_same = merged.iter().map(Axis::other).eq(b.iter().map(|b| Some(*b)));
        let own = table.default_axes().ok()?;
        let is_tables = merged.iter().zip(&own).all(|(a, b)| (a.parameter, a.also) == (b.parameter, b.also));
        (is_same && is_tables).then_some(merged)
    };
    let axes = both(&first.axes, &second.axes).or_else(|| both(&second.axes, &first.axes))?;
    (first.model == second.model).then_some((table.name, axes))
}

/// The commands that bake what the claim says: one per group of channels with the same axes and model.
fn commands(claim: &Claim, grid: &Grid, suffix: &str) -> Vec<String> {
    let groups = claim.groups();
    if let Some((name, axes)) = of_two_parameters(claim, grid) {
        let axes: Vec<String> = axes.iter().map(Axis::brief).collect();
        let flags = model_flags(&groups[0].0);
        let half = grid.channels.iter().all(|c| c.stored == Stored::F16);
        let extension = if half { "ktx2" } else { "exr" };
        return vec![format!("kiln table {name} --axes {}{flags} -o {name}{suffix}.{extension}", axes.join(","))];
    }
    let several = groups.len() > 1;
    groups
        .iter()
        .enumerate()
        .map(|(i, (spec, channels))| {
            let names: Vec<&str> = spec.channels.iter().map(|c| c.quantity.name).collect();
            // Tables whose axes stand for one parameter each.
            let of_one = || TABLES.iter().filter(|t| !t.axes.iter().any(|axis| axis.contains(":+")));
            let named = TABLES
                .iter()
                .find(|t| t.channels == names)
                .or_else(|| of_one().find(|t| names.iter().all(|n| t.channels.contains(n))))
                .or_else(|| of_one().find(|t| t.channels.contains(&names[0])));
            let name = named.map_or("dfg", |t| t.name);
            let mut command = format!("kiln table {name}");
            if named.is_none_or(|t| t.channels != names) {
                command += &format!(" --channels {}", names.join(","));
            }
            let axes: Vec<String> = spec.axes.iter().map(Axis::brief).collect();
            command += &format!(" --axes {}", axes.join(","));
            let own: Vec<(Parameter, f64)> =
                named.and_then(|t| t.default_point().ok()).map_or(vec![], |p| p.given().collect());
            for (parameter, value) in spec.at.given().filter(|given| !own.contains(given)) {
                command += &format!(" --{} {value}", parameter.name().replace('_', "-"));
            }
            command += &model_flags(spec);
            let half = channels.iter().all(|c| grid.channels[c.index].stored == Stored::F16);
            let stem = if several { format!("{name}{suffix}-{}", i + 1) } else { format!("{name}{suffix}") };
            command + &format!(" -o {stem}.{}", if half && names.len() <= 4 { "ktx2" } else { "exr" })
        })
        .collect()
}

fn model_flags(spec: &TableSpec) -> String {
    let (model, usual) = (spec.model, Model::default());
    let mut flags = String::new();
    if model.smith != usual.smith {
        flags += &format!(" --smith {}", model.smith.name());
    }
    if model.visibility != usual.visibility {
        flags += &format!(" --visibility {}", model.visibility.name());
    }
    if model.kd != usual.kd {
        flags += &format!(" --kd {}", model.kd.name());
    }
    flags
}
