//! `kiln eval`: exact values of a quantity.

use super::arguments::{IntegrationArgs, ModelArgs, ParameterArgs};
use super::console::{Console, columns};
use super::furnace;
use clap::Args;
use kiln::integrate::{Estimate, Integration, Integrator, Settings};
use kiln::material::{self, Part};
use kiln::table::quantity::{self, Handle};
use kiln::table::{Model, Parameter, Point};
use kiln::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Evaluate a quantity: at points of a CSV file, or at one point by both witnesses
#[derive(Debug, Args)]
#[command(
    after_help = "The CSV's header names parameters (see `kiln list quantities`; alpha = roughness²). Its columns come out \
                        again, followed by value, error and kind: `bound` (|value − truth| ≤ error) or `sigma` (one standard \
                        error)."
)]
pub struct Eval {
    /// Which quantity: see `kiln list quantities`; `compensation.*` and the like show all of a kind beside each other
    quantity: String,
    /// CSV file of points
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = Parameter::ALL.map(Parameter::name))]
    points: Option<PathBuf>,
    #[command(flatten)]
    parameters: ParameterArgs,
    /// Take f0, eta, n and k of a material: see `kiln list materials`
    #[arg(long, value_name = "NAME", conflicts_with_all = ["points", "f0", "eta", "n", "k"])]
    material: Option<String>,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    integration: IntegrationArgs,
}

/// One evaluated point, for `--json`.
#[derive(Serialize)]
struct Row {
    #[serde(skip_serializing_if = "Option::is_none")]
    quantity: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    part: Option<&'static str>,
    #[serde(flatten)]
    parameters: serde_json::Map<String, serde_json::Value>,
    integrator: &'static str,
    value: f64,
    error: f64,
    kind: &'static str,
}

/// A point with what it is called where there are several.
struct Place {
    part: Option<&'static str>,
    point: Point,
    parameters: serde_json::Map<String, serde_json::Value>,
}

impl Eval {
    pub fn run(&self, console: &Console) -> Result<()> {
        let model = self.model.model();
        let settings = self.integration.over(Settings::default());
        match &self.points {
            Some(path) => many(&self.quantity, &model, settings, path, console),
            None => self.one(&self.handles()?, &model, settings, console),
        }
    }

    /// The quantity that was named, or all that `prefix.*` stands for.
    fn handles(&self) -> Result<Vec<Handle>> {
        let handles: Vec<Handle> = match self.quantity.strip_suffix('*') {
            Some(prefix) => quantity::all().filter(|h| h.quantity.name.starts_with(prefix)).collect(),
            None => vec![],
        };
        let given = |p: Parameter| self.parameters.given.iter().any(|(q, _)| q.canonical() == p.canonical());
        if handles.is_empty() { Ok(vec![quantity::find_among(&self.quantity, given)?]) } else { Ok(handles) }
    }

    /// The point that the flags name, once per part of the material.
    fn places(&self, handles: &[Handle], console: &Console) -> Result<Vec<Place>> {
        let used = |p: Parameter| handles.iter().any(|h| h.quantity.depends_on(p));
        for (parameter, _) in self.parameters.given.iter().filter(|(p, _)| !used(*p)) {
            console.warn(&format!("{} does not depend on {parameter}", self.quantity));
        }
        let Some(name) = &self.material else { return Ok(vec![place(None, &self.parameters.given)?]) };
        let material = material::find(name)?;
        let takes = [Parameter::F0, Parameter::Eta, Parameter::N, Parameter::K];
        if !takes.into_iter().any(used) {
            return Err(Error::usage(
                format!("{} depends on none of f0, eta, n and k, which a material has", self.quantity),
                "leave --material out",
            ));
        }
        let with_part = |part: Part| {
            let has = [Some(part.f0), part.eta, part.index.map(|[n, _]| n), part.index.map(|[_, k]| k)];
            let mut values = self.parameters.given.clone();
            for (parameter, value) in takes.into_iter().zip(has).filter(|(p, _)| used(*p)) {
                let lacks = || {
                    let kind = if material.is_metal() { "metal" } else { "dielectric" };
                    Error::usage(format!("no {parameter} is known of the {kind} {name}"), "give it as a number instead")
                };
                values.push((parameter, value.ok_or_else(lacks)?));
            }
            place((!part.name.is_empty()).then_some(part.name), &values)
        };
        material.parts().into_iter().map(with_part).collect()
    }

    fn one(&self, handles: &[Handle], model: &Model, settings: Settings, console: &Console) -> Result<()> {
        let places = self.places(handles, console)?;
        let mut rows = vec![];
        for (handle, place) in handles.iter().flat_map(|h| places.iter().map(move |p| (*h, p))) {
            for (integrator, own) in self.witnesses(handle, settings) {
                let Estimate { value, error, kind } = handle.evaluate(&place.point, model, &Integration::new(own)?)?;
                rows.push(Row {
                    quantity: (handles.len() > 1).then_some(handle.quantity.name),
                    part: place.part,
                    parameters: place.parameters.clone(),
                    integrator: witness_name(handle, integrator),
                    value,
                    error,
                    kind: kind.name(),
                });
            }
        }
        if console.json {
            return console.print_json(&rows);
        }
        let given = self.parameters.given.iter().map(|(parameter, value)| format!("{parameter} {value}"));
        let parameters: Vec<String> = self.material.clone().into_iter().chain(given).collect();
        let choices: Vec<String> = handles.first().map_or_else(Vec::new, |h| model.choices_of(h.quantity));
        let choices = if choices.is_empty() { String::new() } else { format!(" ({})", choices.join(", ")) };
        let mut text = format!("{} at {}{choices}\n", self.quantity, parameters.join(", "));
        if let [handle] = handles {
            text += &format!("{}\n", handle.quantity.definition);
        }
        text = text + "\n" + &table(&rows);
        if let ([handle], [place]) = (handles, &places[..])
            && handle.quantity.depends_on_kd()
        {
            text += &furnace::table(*handle, &place.point, model, settings)?;
        }
        console.print(&text)
    }

    /// Who computes, and how: a person reads both answers, unless one was asked for or there is nothing to integrate.
    fn witnesses(&self, handle: Handle, settings: Settings) -> Vec<(Integrator, Settings)> {
        let witnesses = match settings.integrator {
            _ if handle.family.is_pointwise() => vec![Integrator::Quadrature],
            Integrator::Auto if !handle.family.has_quadrature() => vec![Integrator::MonteCarlo],
            Integrator::Auto => vec![Integrator::Quadrature, Integrator::MonteCarlo],
            one => vec![one],
        };
        let own = |integrator| match integrator {
            // A tolerance that only quadrature can hope for, or samples, which it does not take, are the other's business.
            Integrator::Quadrature => Settings { integrator, samples: None, ..settings },
            _ if self.integration.integrator.is_none() => Settings {
                integrator,
                tolerance: settings.tolerance.map(|t| t.max(kiln::integrate::MONTE_CARLO_TOLERANCE / 10.0)),
                ..settings
            },
            _ => Settings { integrator, ..settings },
        };
        witnesses.into_iter().map(|integrator| (integrator, own(integrator))).collect()
    }
}

fn place(part: Option<&'static str>, values: &[(Parameter, f64)]) -> Result<Place> {
    let point = values.iter().try_fold(Point::default(), |point, &(p, v)| point.with(p, v))?;
    let parameters = values.iter().map(|(p, v)| (p.name().to_owned(), (*v).into())).collect();
    Ok(Place { part, point, parameters })
}

/// The rows in columns, and how far two witnesses of one value are apart; of several quantities, how far each is from the first.
fn table(rows: &[Row]) -> String {
    let (several, parts) = (rows.iter().any(|r| r.quantity.is_some()), rows.iter().any(|r| r.part.is_some()));
    let mut headings = vec!["witness", "value", "error", "kind"];
    if parts {
        headings.insert(0, "part");
    }
    if several {
        headings.insert(0, "quantity");
        headings.push("against the first");
    }
    let first = |row: &Row| rows.iter().find(|r| r.part == row.part && r.integrator == row.integrator);
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            let mut cells: Vec<String> = r.quantity.into_iter().chain(r.part).map(str::to_owned).collect();
            cells.push(r.integrator.to_owned());
            cells.extend([format!("{:.12}", r.value), format!("{:.1e}", r.error), r.kind.to_owned()]);
            if several {
                cells.push(first(r).map_or_else(String::new, |f| format!("{:+.6}", r.value - f.value)));
            }
            cells
        })
        .collect();
    let mut text = columns(&headings, &cells);
    if let [a, b] = rows
        && !several
        && !parts
    {
        text += &format!("\nthey differ by {:.1e}\n", (a.value - b.value).abs());
    }
    text
}

/// The values that a parameter may have, as advice.
fn domain_hint(parameter: Parameter) -> String {
    let (low, high) = parameter.domain();
    format!("give a number from {low} to {high}")
}

/// Who computed a value.
fn witness_name(handle: Handle, integrator: Integrator) -> &'static str {
    if handle.family.is_pointwise() { "closed-form" } else { integrator.name() }
}

fn many(name: &str, model: &Model, settings: Settings, path: &Path, console: &Console) -> Result<()> {
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
    let handle = quantity::find_among(name, |p| columns.iter().any(|(_, q)| q.canonical() == p.canonical()))?;
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
                    Error::invalid(format!("line {line}: {parameter} {text:?} is not a number"), domain_hint(parameter))
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
        let random = handle.is_monte_carlo(integration);
        let integrator = if random { Integrator::MonteCarlo } else { Integrator::Quadrature };
        let row = |(record, e): (&csv::StringRecord, &Estimate)| {
            let value = |text: &str| text.parse::<f64>().map_or_else(|_| text.into(), serde_json::Value::from);
            let parameters = header.iter().zip(record).map(|(name, text)| (name.to_owned(), value(text))).collect();
            Row {
                quantity: None,
                part: None,
                parameters,
                integrator: witness_name(handle, integrator),
                value: e.value,
                error: e.error,
                kind: e.kind.name(),
            }
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
