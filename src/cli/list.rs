//! `kiln list`: what there is.

use super::console::{Console, columns};
use clap::{Args, ValueEnum};
use kiln::Result;
use kiln::environment::{BUILTIN_PREFIX, BUILTINS};
use kiln::format::FormatSpec;
use kiln::material::{self, MATERIALS, Material, Part};
use kiln::table::{Axis, Parameter, Point, named, quantity};
use serde::Serialize;

/// List tables, quantities, materials, engines, formats or environments
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
    /// Reflectances at normal incidence, to be named by `kiln eval --material`
    Materials,
    /// Engines, and the flags that each of them stands for
    Engines,
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
    at: Point,
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
            What::Materials => materials(console),
            What::Engines => super::engines::list(console),
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
        .map(|t| {
            Ok(TableRow {
                name: t.name,
                summary: t.summary,
                channels: t.channels,
                axes: t.default_axes()?,
                at: t.default_point()?,
            })
        })
        .collect::<Result<_>>()?;
    if console.json {
        return console.print_json(&rows);
    }
    let axes = |axes: &[Axis], at: &Point| {
        let axes: Vec<String> = axes.iter().map(Axis::brief).collect();
        let fixed = if at.is_empty() { String::new() } else { format!(" at {at}") };
        axes.join(" × ") + &fixed
    };
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| vec![r.name.into(), r.channels.join(", "), axes(&r.axes, &r.at), r.summary.into()])
        .collect();
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

/// One channel of a metal, or one end of a dielectric's range.
#[derive(Serialize)]
struct MaterialRow {
    name: &'static str,
    part: &'static str,
    f0: f64,
    srgb: u8,
    #[serde(skip_serializing_if = "Option::is_none")]
    eta: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    n: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    k: Option<f64>,
}

fn materials(console: &Console) -> Result<()> {
    let row = |m: &'static Material, p: Part| MaterialRow {
        name: m.name,
        part: p.name,
        f0: p.f0,
        srgb: material::srgb_byte(p.f0),
        eta: p.eta,
        n: p.index.map(|[n, _]| n),
        k: p.index.map(|[_, k]| k),
    };
    let rows: Vec<MaterialRow> = MATERIALS.iter().flat_map(|m| m.parts().into_iter().map(move |p| row(m, p))).collect();
    if console.json {
        return console.print_json(&rows);
    }
    let number = |v: Option<f64>| v.map_or_else(String::new, |v| format!("{v:.4}"));
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            let (name, part) = (r.name.to_owned(), r.part.to_owned());
            vec![name, part, format!("{:.3}", r.f0), r.srgb.to_string(), number(r.eta), number(r.n), number(r.k)]
        })
        .collect();
    console.print(&columns(&["material", "part", "f0", "srgb", "eta", "n", "k"], &cells))
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
