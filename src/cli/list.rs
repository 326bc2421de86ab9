//! `kiln list`: what there is.

use super::console::{Console, columns};
use clap::{Args, ValueEnum};
use kiln::Result;
use kiln::environment::{BUILTIN_PREFIX, BUILTINS};
use kiln::format::FormatSpec;
use kiln::table::{Axis, Parameter, named, quantity};
use serde::Serialize;

/// List tables, quantities, formats or environments
#[derive(Debug, Args)]
pub struct List {
    /// What to list
    #[arg(value_enum)]
    what: What,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum What {
    /// Tables that have a name
    Tables,
    /// Quantities that can be in a channel, and the parameters they depend on
    Quantities,
    /// Containers and number formats
    Formats,
    /// Built-in environments
    Environments,
}

#[derive(Serialize)]
struct TableRow {
    name: &'static str,
    summary: &'static str,
    channels: &'static [&'static str],
    axes: Vec<Axis>,
}

#[derive(Serialize)]
struct QuantityRow {
    name: &'static str,
    summary: &'static str,
    definition: &'static str,
    source: &'static str,
    parameters: &'static [Parameter],
    bounds: (f64, f64),
}

impl List {
    pub fn run(&self, console: &Console) -> Result<()> {
        match self.what {
            What::Tables => tables(console),
            What::Quantities => quantities(console),
            What::Formats => formats(console),
            What::Environments => environments(console),
        }
    }
}

fn names(parameters: &[Parameter]) -> String {
    parameters.iter().map(|p| p.name()).collect::<Vec<_>>().join(", ")
}

fn tables(console: &Console) -> Result<()> {
    let rows: Vec<TableRow> = named::TABLES
        .iter()
        .map(|t| TableRow { name: t.name, summary: t.summary, channels: t.channels, axes: t.default_axes() })
        .collect();
    if console.json {
        return console.print_json(&rows);
    }
    let axes = |axes: &[Axis]| axes.iter().map(ToString::to_string).collect::<Vec<_>>().join(" × ");
    let cells: Vec<Vec<String>> =
        rows.iter().map(|r| vec![r.name.into(), r.channels.join(", "), axes(&r.axes), r.summary.into()]).collect();
    console.print(&columns(&["table", "channels", "axes", "what it is for"], &cells))
}

fn quantities(console: &Console) -> Result<()> {
    let rows: Vec<QuantityRow> = quantity::all()
        .map(|h| h.quantity)
        .map(|q| QuantityRow {
            name: q.name,
            summary: q.summary,
            definition: q.definition,
            source: q.source,
            parameters: q.parameters,
            bounds: q.bounds,
        })
        .collect();
    if console.json {
        return console.print_json(&rows);
    }
    let cells: Vec<Vec<String>> =
        rows.iter().map(|r| vec![r.name.into(), names(r.parameters), r.definition.into(), r.summary.into()]).collect();
    let mut text = columns(&["quantity", "parameters", "definition", "what it is"], &cells);
    text += "\n";
    let cells: Vec<Vec<String>> =
        Parameter::ALL.iter().map(|p| vec![p.name().to_owned(), p.summary().to_owned()]).collect();
    text += &columns(&["parameter", "what it is"], &cells);
    console.print(&text)
}

fn formats(console: &Console) -> Result<()> {
    let names: Vec<String> = FormatSpec::all().iter().map(ToString::to_string).collect();
    if console.json {
        return console.print_json(&names);
    }
    console.print(&(names.join("\n") + "\n"))
}

fn environments(console: &Console) -> Result<()> {
    let rows: Vec<(String, &str)> =
        BUILTINS.iter().map(|b| (format!("{BUILTIN_PREFIX}{}", b.name), b.description)).collect();
    if console.json {
        return console.print_json(&rows);
    }
    let cells: Vec<Vec<String>> = rows.into_iter().map(|(name, summary)| vec![name, summary.to_owned()]).collect();
    console.print(&columns(&["environment", "what it is"], &cells))
}
