//! `kiln eval`: exact values of a quantity.

use super::arguments::{IntegrationArgs, SmithName, VisibilityName};
use super::console::{Console, columns};
use clap::Args;
use kiln::integrate::{Estimate, Integration, Integrator, Settings};
use kiln::table::quantity::{self, Handle};
use kiln::table::{Model, Parameter, Point};
use kiln::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Evaluate a quantity: at points of a CSV file, or at one point by both witnesses
#[derive(Debug, Args)]
#[command(
    after_help = "The CSV's header names parameters (mu, alpha or roughness; alpha = roughness²). Its columns come out \
                        again, followed by value, error and kind: `bound` (|value − truth| ≤ error) or `sigma` (one standard \
                        error)."
)]
pub struct Eval {
    /// Which quantity: see `kiln list quantities`
    quantity: String,
    /// CSV file of points
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["mu", "alpha", "roughness", "eta"])]
    points: Option<PathBuf>,
    /// Cosine of the outgoing direction to the normal, in [0, 1]
    #[arg(long)]
    mu: Option<f64>,
    /// Width of the microfacet distribution, in [0, 1]
    #[arg(long, conflicts_with = "roughness")]
    alpha: Option<f64>,
    /// The artist's value, in [0, 1]; alpha = roughness²
    #[arg(long)]
    roughness: Option<f64>,
    /// Relative index of refraction n_t/n_i, in [0.25, 4]
    #[arg(long)]
    eta: Option<f64>,
    /// Masking and shadowing
    #[arg(long, value_enum, default_value = "correlated")]
    smith: SmithName,
    /// Visibility term of the sheen
    #[arg(long, value_enum, default_value = "neubelt")]
    visibility: VisibilityName,
    #[command(flatten)]
    integration: IntegrationArgs,
}

/// One evaluated point, for `--json`.
#[derive(Serialize)]
struct Row {
    #[serde(flatten)]
    parameters: serde_json::Map<String, serde_json::Value>,
    integrator: &'static str,
    value: f64,
    error: f64,
    kind: &'static str,
}

impl Eval {
    pub fn run(&self, console: &Console) -> Result<()> {
        let handle = quantity::find(&self.quantity)?;
        let model = Model { smith: self.smith.into(), visibility: self.visibility.into() };
        let settings = self.integration.over(Settings::default());
        match &self.points {
            Some(path) => many(handle, &model, settings, path, console),
            None => self.one(handle, &model, settings, console),
        }
    }

    fn one(&self, handle: Handle, model: &Model, settings: Settings, console: &Console) -> Result<()> {
        let mut point = Point::default();
        let mut given = serde_json::Map::new();
        let flags = [
            (Parameter::Mu, self.mu),
            (Parameter::Alpha, self.alpha),
            (Parameter::Roughness, self.roughness),
            (Parameter::Eta, self.eta),
        ];
        for (parameter, value) in flags {
            let Some(value) = value else { continue };
            point = point.with(parameter, value)?;
            given.insert(parameter.name().to_owned(), value.into());
            if !handle.quantity.depends_on(parameter) {
                console.warn(&format!("{} does not depend on {parameter}", handle.quantity.name));
            }
        }
        // A person reads both answers, unless one was asked for.
        let witnesses = match settings.integrator {
            Integrator::Auto => vec![Integrator::Quadrature, Integrator::MonteCarlo],
            one => vec![one],
        };
        let mut rows = vec![];
        for integrator in witnesses {
            let own = match integrator {
                // A tolerance that only quadrature can hope for, or samples, which it does not take, are the other's business.
                Integrator::Quadrature => Settings { integrator, samples: None, ..settings },
                _ if self.integration.integrator.is_none() => Settings {
                    integrator,
                    tolerance: settings.tolerance.map(|t| t.max(kiln::integrate::MONTE_CARLO_TOLERANCE / 10.0)),
                    ..settings
                },
                _ => Settings { integrator, ..settings },
            };
            let Estimate { value, error, kind } = handle.evaluate(&point, model, &Integration::new(own)?)?;
            rows.push(Row {
                parameters: given.clone(),
                integrator: integrator.name(),
                value,
                error,
                kind: kind.name(),
            });
        }
        if console.json {
            return console.print_json(&rows);
        }
        let parameters: Vec<String> = given.iter().map(|(name, value)| format!("{name} {value}")).collect();
        let mut text =
            format!("{} at {} ({} Smith)\n", handle.quantity.name, parameters.join(", "), model.smith.name());
        text += &format!("{}\n\n", handle.quantity.definition);
        let cells: Vec<Vec<String>> = rows
            .iter()
            .map(|r| {
                vec![r.integrator.to_owned(), format!("{:.12}", r.value), format!("{:.1e}", r.error), r.kind.to_owned()]
            })
            .collect();
        text += &columns(&["witness", "value", "error", "kind"], &cells);
        if let [a, b] = &rows[..] {
            text += &format!("\nthey differ by {:.1e}\n", (a.value - b.value).abs());
        }
        console.print(&text)
    }
}

fn many(handle: Handle, model: &Model, settings: Settings, path: &Path, console: &Console) -> Result<()> {
    let file = std::fs::File::open(path).map_err(|e| Error::reading(path, e))?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file);
    let broken = |e: csv::Error| match e.kind() {
        csv::ErrorKind::Io(_) => Error::reading(path, std::io::Error::other(e)),
        _ => Error::invalid(format!("broken CSV: {e}"), "write a header and one point per line").in_file(path),
    };
    let header = reader.headers().map_err(broken)?.clone();
    let columns: Vec<(usize, Parameter)> = header
        .iter()
        .enumerate()
        .filter_map(|(i, name)| Parameter::from_name(name.trim_start_matches('\u{feff}')).map(|p| (i, p)))
        .collect();
    if columns.is_empty() {
        return Err(Error::invalid(
            format!("no column of the header {:?} names a parameter", header.iter().collect::<Vec<_>>().join(",")),
            "let the first line name columns, such as mu,roughness",
        )
        .in_file(path));
    }
    let records: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>().map_err(broken)?;
    let integration = Integration::new(settings)?;
    let estimates: Vec<Estimate> = records
        .par_iter()
        .map(|record| {
            let line = record.position().map_or(0, csv::Position::line);
            let at_line = |e: Error| match e {
                Error::Usage(p) => Error::invalid(format!("line {line}: {}", p.statement), p.way_out).in_file(path),
                other => other,
            };
            let mut point = Point::default();
            for &(column, parameter) in &columns {
                let text = record.get(column).unwrap_or_default();
                let value = text.parse().map_err(|_| {
                    Error::invalid(
                        format!("line {line}: {parameter} {text:?} is not a number"),
                        "give a number from 0 to 1",
                    )
                    .in_file(path)
                })?;
                point = point.with(parameter, value).map_err(at_line)?;
            }
            handle.evaluate(&point, model, &integration).map_err(at_line)
        })
        .collect::<Result<_>>()?;
    print_points(handle, &header, &records, &estimates, &integration, console)
}

fn print_points(
    handle: Handle,
    header: &csv::StringRecord,
    records: &[csv::StringRecord],
    estimates: &[Estimate],
    integration: &Integration,
    console: &Console,
) -> Result<()> {
    if console.json {
        let integrator = if integration.is_monte_carlo() { Integrator::MonteCarlo } else { Integrator::Quadrature };
        let row = |(record, e): (&csv::StringRecord, &Estimate)| {
            let value = |text: &str| text.parse::<f64>().map_or_else(|_| text.into(), serde_json::Value::from);
            let parameters = header.iter().zip(record).map(|(name, text)| (name.to_owned(), value(text))).collect();
            Row { parameters, integrator: integrator.name(), value: e.value, error: e.error, kind: e.kind.name() }
        };
        return console.print_json(&records.iter().zip(estimates).map(row).collect::<Vec<_>>());
    }
    let mut writer = csv::Writer::from_writer(vec![]);
    let failed =
        |e: csv::Error| Error::unsupported(format!("{} cannot be printed: {e}", handle.quantity.name), "use --json");
    let with = |record: &csv::StringRecord, more: [String; 3]| -> Vec<String> {
        record.iter().map(str::to_owned).chain(more).collect()
    };
    writer.write_record(with(header, ["value", "error", "kind"].map(str::to_owned))).map_err(failed)?;
    for (record, e) in records.iter().zip(estimates) {
        // The shortest decimal that reads back as the same number.
        let row = with(record, [format!("{:?}", e.value), format!("{:?}", e.error), e.kind.name().to_owned()]);
        writer.write_record(row).map_err(failed)?;
    }
    let bytes = writer.into_inner().map_err(|e| Error::writing(Path::new("standard output"), e.into_error()))?;
    console.print(&String::from_utf8_lossy(&bytes))
}
