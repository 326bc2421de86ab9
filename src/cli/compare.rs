//! `kiln compare`: two files against each other.

use super::console::{Console, columns, printable};
use super::foreign::DescribedArgs;
use clap::Args;
use kiln::compare::{Difference, Tolerance, compare, levels, map};
use kiln::format::{atomic, exr};
use kiln::pack::Number;
use kiln::{Error, Result};
use std::path::PathBuf;

/// Compare two files value by value; exit 3 if any differs by more than the tolerance
#[derive(Debug, Args)]
pub struct Compare {
    /// A table, picture or cube
    a: PathBuf,
    /// Another one of the same shape
    b: PathBuf,
    /// What values may differ by: 2ulp, 0.1% or 1e-3rel of the larger one, or 1e-3
    #[arg(long, default_value = "0")]
    tolerance: Tolerance,
    /// Write b − a of level 0 as an EXR
    #[arg(long, value_name = "FILE.exr")]
    map: Option<PathBuf>,
    #[command(flatten)]
    described: DescribedArgs,
}

impl Compare {
    pub fn run(&self, console: &Console) -> Result<()> {
        let described = self.described.described();
        let (a, b) = (levels(&self.a, &described)?, levels(&self.b, &described)?);
        let found = compare(&a, &b, self.tolerance)?;
        if let (Some(path), [a, ..], [b, ..]) = (&self.map, &a[..], &b[..]) {
            atomic::write(path, &exr::encode(&map(a, b)?, Number::F32)?.0)?;
        }
        if console.json {
            console.print_json(&found)?;
        } else {
            console.print(&printable(&text(&found)))?;
        }
        let failed = found.iter().filter(|d| d.beyond > 0).count();
        if failed > 0 { Err(Error::Verification { failed, total: found.len() }) } else { Ok(()) }
    }
}

fn text(found: &[Difference]) -> String {
    let number = |v: f64| if v == 0.0 { "0".to_owned() } else { format!("{v:.2e}") };
    let rows: Vec<Vec<String>> = found
        .iter()
        .map(|d| {
            let [x, y, z] = d.at;
            vec![
                if d.beyond == 0 { "same".to_owned() } else { "DIFFERS".to_owned() },
                d.level.to_string(),
                if d.channel == d.against { d.channel.clone() } else { format!("{} = {}", d.channel, d.against) },
                number(d.max),
                number(d.mean),
                number(d.rms),
                number(d.relative),
                number(d.ulps),
                format!("{} of {}", d.beyond, d.values),
                if d.different == 0 { String::new() } else { format!("column {x}, row {y}, slice {z}") },
            ]
        })
        .collect();
    columns(
        &["", "level", "channel", "max", "mean", "RMS", "relative", "ulps", "beyond tolerance", "largest at"],
        &rows,
    )
}
