//! Judging a table that Kiln did not make, against what it is said or found to hold.
//!
//! **What is right**: by default a value may be off by one step of what the file stores (correct rounding needs half of it) or by
//! [`LEAST_LIMIT`], whichever is more. Errors are those of the decoded quantity: a table stored as y/(1 + y) is judged by y.

use super::{Options, Report};
use crate::check::{Check, Precision, TableValues};
use crate::claim::{Claim, ClaimedChannel};
use crate::error::{Error, Result};
use crate::format::Grid;
use crate::format::grid::{GridChannel, Stored};
use crate::identify;
use crate::integrate::{ErrorKind, Integration, QUADRATURE_TOLERANCE, Settings};
use crate::pack::{Number, TexelFormat};
use crate::table::lookup::{LookupError, lookup_errors};
use crate::table::named::{NamedTable, TABLES};
use crate::table::{Point, TableSpec};
use serde::Serialize;
use std::path::Path;

/// What a texel may be off by wherever the format is finer: a tenth of what bilinear filtering loses in tables of the usual sizes and
/// axes, however exact their texels are.
pub const LEAST_LIMIT: f64 = 1e-3;

/// Largest, mean and root mean square of errors.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Largest |found − wanted|; NaN where a value is not finite, which is within no limit.
    pub max: f64,
    /// Mean of found − wanted over the finite values: whether the table is too bright or too dark as a whole.
    pub mean: f64,
    /// Root mean square over the same.
    pub rms: f64,
}

impl Errors {
    fn of(errors: impl Iterator<Item = f64>) -> Self {
        let (mut max, mut sum, mut squares, mut n) = (0.0_f64, 0.0, 0.0, 0.0);
        let mut all_finite = true;
        for error in errors {
            if error.is_finite() {
                max = max.max(error.abs());
                (sum, squares, n) = (sum + error, squares + error * error, n + 1.0);
            } else {
                all_finite = false;
            }
        }
        Self { max: if all_finite { max } else { f64::NAN }, mean: sum / n, rms: (squares / n).sqrt() }
    }
}

/// The texel that is furthest off.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Worst {
    /// Column, row and slice, from 0.
    pub texel: [usize; 3],
    /// What the texel stands for.
    pub at: Point,
    /// The value in the file, decoded.
    pub found: f64,
    /// The value that belongs there.
    pub wanted: f64,
}

/// How far one channel is from what it is said to hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelErrors {
    /// The channel's name in the file.
    pub channel: String,
    /// The quantity.
    pub quantity: String,
    /// How it is stored.
    pub stored: Stored,
    /// Errors at the texels.
    pub texels: Errors,
    /// Errors that correct rounding to the same format would have left.
    pub rounding: Errors,
    /// By what factor the file's RMS error exceeds that of correct rounding.
    pub times_rounding: f64,
    /// Where the file is furthest off.
    pub worst: Worst,
    /// The error that a shader sees through linear filtering, over a dense grid.
    pub filtered: Option<LookupError>,
    /// The same with exact texels: what the axes cost, whoever fills them.
    pub filtered_exact: Option<LookupError>,
    /// What the largest error may be.
    pub limit: f64,
}

/// Judges `grid` by what is said of it; where nothing is said, by what it is found to hold.
///
/// **Errors**: a table that nobody can tell what it is; those of the integrator.
pub fn judge(path: &Path, grid: &Grid, claim: Option<Claim>, options: &Options) -> Result<Report> {
    let mut report = Report { file: path.to_owned(), ..Report::default() };
    let mut unpacked = None;
    let claim = match claim {
        Some(claim) => {
            report.claim = format!("judged as {claim}");
            claim
        }
        None => {
            let found = identify::identify(grid, &options.identify).map_err(|e| e.in_file(path))?;
            if found.claim.channels.is_empty() {
                return Err(Error::unsupported(
                    format!("{}, and what it holds is unknown", grid.summary()),
                    "say what it should be, such as --as dfg; `kiln identify` tells what comes nearest",
                )
                .in_file(path));
            }
            report.claim =
                format!("nothing was said of it; it is {}: judged as {}", found.confidence.words(), found.claim);
            report.notes.extend(found.faults());
            report.notes.extend(found.unexplained());
            if let Some(packing) = found.packing {
                report.notes.push(format!("its bytes make sense as codes of {packing} only; --packing says so"));
                unpacked = grid.unpacked(packing);
            }
            found.claim
        }
    };
    let grid = unpacked.as_ref().unwrap_or(grid);
    for (spec, channels) in claim.groups() {
        judge_group(grid, &spec, &channels, options, &mut report)?;
    }
    for (c, channel) in grid.channels.iter().enumerate() {
        if !claim.channels.iter().any(|claimed| claimed.index == c) {
            report.skipped.push(format!("channel {}, of which nothing is said", channel.name));
        }
    }
    Ok(report)
}

fn judge_group(
    grid: &Grid,
    spec: &TableSpec,
    channels: &[&ClaimedChannel],
    options: &Options,
    report: &mut Report,
) -> Result<()> {
    // Some named tables have channels that do not reach the usual tolerance.
    let is_of = |table: &&NamedTable| spec.channels.iter().all(|c| table.channels.contains(&c.quantity.name));
    let tolerance = TABLES.iter().find(is_of).and_then(|table| table.tolerance);
    let integration = Integration::new(Settings { tolerance, ..Settings::default() })?;
    let truth = spec.bake(&integration, &|_| {})?;
    let n = channels.len();
    let mut decoded = vec![0.0; truth.values.len()];
    for (c, channel) in channels.iter().enumerate() {
        for (texel, v) in grid.channel(channel.index).into_iter().enumerate() {
            decoded[texel * n + c] = channel.encoding.decode(v);
        }
    }
    let brightest = grid.brightest();
    let blocks = of_blocks(grid, channels, &truth.values);
    let finite = decoded.iter().all(|v| v.is_finite());
    let lookups = |values: &[f64]| {
        let texels: Vec<f32> = values.iter().map(|&v| v as f32).collect();
        lookup_errors(spec, &texels)
    };
    let (filtered, filtered_exact) =
        if finite { (lookups(&decoded)?, lookups(&truth.values)?) } else { (vec![], vec![]) };
    for (c, channel) in channels.iter().enumerate() {
        let GridChannel { name, stored } = &grid.channels[channel.index];
        let wanted = || truth.values.iter().copied().skip(c).step_by(n);
        let found = || decoded.iter().copied().skip(c).step_by(n);
        let texels = Errors::of(found().zip(wanted()).map(|(a, b)| a - b));
        let ideal = |(w, most)| channel.encoding.decode(stored.round_beside(channel.encoding.encode(w), most)) - w;
        let rounding = match &blocks {
            Some(packed) => Errors::of(packed.iter().skip(c).step_by(n).zip(wanted()).map(|(a, b)| f64::from(*a) - b)),
            None => Errors::of(wanted().zip(brightest.iter().copied()).map(ideal)),
        };
        let rank = |(_, (a, b)): &(usize, (f64, f64))| if a.is_finite() { (a - b).abs() } else { f64::INFINITY };
        let (texel, (found_there, wanted_there)) = found()
            .zip(wanted())
            .enumerate()
            .max_by(|a, b| rank(a).total_cmp(&rank(b)))
            .unwrap_or((0, (f64::NAN, f64::NAN)));
        let [w, h, _] = grid.size;
        let worst = Worst {
            texel: [texel % w, texel / w % h, texel / (w * h)],
            at: spec.point(texel),
            found: found_there,
            wanted: wanted_there,
        };
        let step = match &blocks {
            Some(_) => 2.0 * rounding.max, // of a block there is no step: as much as two
            None => wanted().zip(&brightest).map(|(w, &most)| step_of(channel, *stored, w, most)).fold(0.0, f64::max),
        };
        let limit = options.max_error.unwrap_or(step.max(LEAST_LIMIT));
        let quantity = channel.spec.channels[0].quantity.name.to_owned();
        let bad = found().filter(|v| !v.is_finite()).count();
        let subject = format!("{name}: {quantity}");
        report.checks.push(Check::at_most(
            "values that are not finite",
            &subject,
            bad as f64,
            0.0,
            "counted over all texels",
        ));
        let detail = format!("{} ({})", place(&worst, spec), column_and_row(&worst, grid));
        report.checks.push(Check::at_most("largest error of a texel", &subject, texels.max, limit, detail));
        report.channels.push(ChannelErrors {
            channel: name.clone(),
            quantity,
            stored: *stored,
            texels,
            rounding,
            // A file that is exact where rounding would be too is as good as it gets.
            times_rounding: if texels.rms == 0.0 { 0.0 } else { texels.rms / rounding.rms.max(QUADRATURE_TOLERANCE) },
            worst,
            filtered: filtered.get(c).cloned(),
            filtered_exact: filtered_exact.get(c).cloned(),
            limit,
        });
    }
    if finite {
        report.notes.extend(broken_limits(grid, spec, channels, &decoded));
    }
    if options.full {
        let kinds = vec![ErrorKind::Bound; n];
        let judged = values(grid, spec, channels, &decoded, &kinds);
        report.checks.extend(judged.with(|v| v.random_witness(0, true, |_| true))?);
    }
    Ok(())
}

/// What our encoder makes of the right values where all channels are packed in blocks, of which no step tells what they may be off by.
fn of_blocks(grid: &Grid, channels: &[&ClaimedChannel], right: &[f64]) -> Option<Vec<f32>> {
    let format = match grid.channels.first()?.stored {
        Stored::Packed(format, _) if format.is_in_blocks() => format,
        _ => return None,
    };
    let is_compressed = |(c, channel): (usize, &&ClaimedChannel)| {
        let plain = channel.encoding == crate::claim::Encoding::PLAIN;
        plain && channel.index == c && grid.channels[c].stored == Stored::Packed(format, c)
    };
    let [width, height, depth] = grid.size;
    let all = channels.len() == format.channels() && channels.iter().enumerate().all(is_compressed);
    (all && depth == 1).then(|| format.unpack(width, height, &format.pack(width, height, right).0))
}

/// The distance of neighbouring values of the decoded quantity at `wanted`, in a texel whose largest channel is stored as `brightest`.
fn step_of(channel: &ClaimedChannel, stored: Stored, wanted: f64, brightest: f64) -> f64 {
    let v = channel.encoding.encode(wanted);
    let step = stored.step_beside(v, brightest);
    (channel.encoding.decode(v + step) - channel.encoding.decode(v)).abs()
}

/// `mu 0.0078, roughness 0.1094`.
fn place(worst: &Worst, spec: &TableSpec) -> String {
    let parameters: Vec<String> = spec
        .axes
        .iter()
        .map(|axis| format!("{} {:.4}", axis.parameter, worst.at.get(axis.parameter).unwrap_or(f64::NAN)))
        .collect();
    parameters.join(", ")
}

fn column_and_row(worst: &Worst, grid: &Grid) -> String {
    let names = ["column", "row", "slice"];
    let texts: Vec<String> =
        (0..3).filter(|&i| i == 0 || grid.size[i] > 1).map(|i| format!("{} {}", names[i], worst.texel[i])).collect();
    texts.join(", ")
}

/// A table's values with what rounding may have done to them.
struct Rounded<'a> {
    spec: &'a TableSpec,
    values: &'a [f64],
    errors: Vec<f64>,
    kinds: &'a [ErrorKind],
    number: Option<Number>,
}

impl Rounded<'_> {
    fn with<T>(&self, f: impl FnOnce(TableValues) -> T) -> T {
        f(TableValues {
            spec: self.spec,
            values: self.values,
            errors: &self.errors,
            kinds: self.kinds,
            precision: self.number.map_or(Precision::exact(), |number| {
                let format = TexelFormat::Plain { channels: self.errors.len(), number };
                Precision::new(format, self.values.iter().copied(), 0.0)
            }),
        })
    }
}

fn values<'a>(
    grid: &Grid,
    spec: &'a TableSpec,
    channels: &[&ClaimedChannel],
    decoded: &'a [f64],
    kinds: &'a [ErrorKind],
) -> Rounded<'a> {
    let stored = |channel: &ClaimedChannel| grid.channels[channel.index].stored;
    let plain = channels.iter().all(|c| c.encoding == crate::claim::Encoding::PLAIN);
    let number = match stored(channels[0]) {
        first if !plain || channels.iter().any(|c| stored(c) != first) => None,
        Stored::F16 => Some(Number::F16),
        Stored::F32 => Some(Number::F32),
        _ => None,
    };
    let n = channels.len();
    let brightest = grid.brightest();
    let errors = channels
        .iter()
        .enumerate()
        .map(|(c, channel)| {
            let of_channel = decoded.iter().skip(c).step_by(n).zip(&brightest);
            let half_step = of_channel.map(|(&v, &most)| 0.5 * step_of(channel, stored(channel), v, most));
            let rounding = if number.is_some() { 0.0 } else { half_step.fold(0.0, f64::max) };
            rounding + QUADRATURE_TOLERANCE
        })
        .collect();
    Rounded { spec, values: decoded, errors, kinds, number }
}

/// The physical limits, bounds and identities that the values break by more than rounding explains.
fn broken_limits(grid: &Grid, spec: &TableSpec, channels: &[&ClaimedChannel], decoded: &[f64]) -> Vec<String> {
    let kinds = vec![ErrorKind::Bound; channels.len()];
    let facts = values(grid, spec, channels, decoded, &kinds).with(|v| v.facts());
    let broken = facts.iter().filter(|c| !c.passed && c.name != "values that are not finite");
    broken
        .map(|c| {
            format!(
                "breaks \"{}\" on {}: {:.2e} where rounding explains {:.2e}, {}",
                c.name, c.subject, c.figure, c.limit, c.detail
            )
        })
        .collect()
}
