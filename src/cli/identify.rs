//! `kiln identify`: what a table or an environment chain holds.

use super::chain::{ChainArgs, is_cube_file};
use super::console::{Console, columns, name_of, printable};
use super::foreign::DescribedArgs;
use clap::Args;
use kiln::format::Grid;
use kiln::identify::{self, Identification, Noise};
use kiln::{Error, Result};
use std::path::PathBuf;

/// Find out what tables hold: which quantities over which axes, and what is wrong with them; of environment chains the roughness per
/// level, kernel, orientation and scale
#[derive(Debug, Args)]
pub struct Identify {
    /// Files of any kind that Kiln reads, or source text with an array
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Neither read nor write the tables that are kept in the user's cache folder
    #[arg(long)]
    no_cache: bool,
    #[command(flatten)]
    chain: ChainArgs,
    #[command(flatten)]
    described: DescribedArgs,
}

impl Identify {
    pub fn run(&self, console: &Console) -> Result<()> {
        if self.chain.source.is_some() || self.files.iter().all(|file| is_cube_file(file)) {
            return self.chain.run(&self.files, None, console).map(|_| ());
        }
        let options = identify::Options { cache: !self.no_cache };
        let (mut found, mut first_error) = (vec![], None);
        for path in &self.files {
            let one = Grid::read(path, &self.described.described())
                .and_then(|grid| identify::identify(&grid, &options).map_err(|e| e.in_file(path)));
            match one {
                Ok(one) => {
                    let name = path.display().to_string();
                    if console.json {
                        let mut value = serde_json::to_value(&one)
                            .map_err(|e| Error::unsupported(format!("no JSON: {e}"), "leave --json out"))?;
                        value["path"] = name.into();
                        found.push(value);
                    } else {
                        console.print(&printable(&text(&name_of(path), &one)))?;
                    }
                }
                Err(error) => {
                    // The first is the command's own; it is printed last.
                    match &first_error {
                        Some(_) => console.error(&error),
                        None => first_error = Some(error),
                    }
                }
            }
        }
        if console.json {
            console.print_json(&found)?;
        }
        first_error.map_or(Ok(()), Err)
    }
}

/// Explanations as good as the best that are listed to a person.
const A_FEW: usize = 4;

fn text(name: &str, found: &Identification) -> String {
    let mut text = format!("{name}: {}\n", found.file);
    if let Some(packing) = found.packing {
        text += &format!("its bytes make sense as codes of {packing} only; --packing {packing} says so\n");
    }
    let number = |v: Option<f64>, digits: usize| v.map_or(String::new(), |v| format!("{v:.digits$e}"));
    let rows: Vec<Vec<String>> = found
        .channels
        .iter()
        .map(|c| {
            let model = c.model.as_ref().map_or(String::new(), |m| format!(" ({m})"));
            let encoding = c.encoding.as_ref().map_or(String::new(), |e| format!(", {e}"));
            let times = c.times_rounding.map_or(String::new(), |t| format!("{t:.1} × rounding"));
            vec![
                c.channel.clone(),
                format!("{}{model}{encoding}", c.holds),
                c.quantity.clone().unwrap_or_default(),
                if c.holds.starts_with("constant") { String::new() } else { c.confidence.words().to_owned() },
                number(c.residual, 1),
                times,
            ]
        })
        .collect();
    text += &columns(&["", "holds", "quantity", "how sure", "RMS left", ""], &rows);
    for axis in &found.axes {
        let faults = if axis.faults.is_empty() { String::new() } else { format!("; {}", axis.faults.join(", ")) };
        let [first, last] = axis.ends;
        text += &format!("{}: {} from {first:.4} to {last:.4}: {}{faults}\n", axis.dimension, axis.axis, axis.text);
    }
    if !found.words.is_empty() {
        text += &format!("in short: {}\n", found.words.join(", "));
    }
    for c in &found.channels {
        match c.not_finite {
            0 => {}
            1 => text += &format!("{}: 1 value is NaN or infinite, and counts for nothing\n", c.channel),
            n => text += &format!("{}: {n} values are NaN or infinite, and count for nothing\n", c.channel),
        }
        for same in &c.same {
            text += &format!("{}: {same} comes to the same numbers, nothing tells them apart\n", c.channel);
        }
        for as_good in c.as_good.iter().take(A_FEW) {
            text += &format!("{}: {as_good} rounds to the same, the file does not tell them apart\n", c.channel);
        }
        if c.as_good.len() > A_FEW {
            text += &format!("{}: and {} more do; --json lists them\n", c.channel, c.as_good.len() - A_FEW);
        }
        if let Some(noise) = &c.noise {
            text += &left(&c.channel, noise);
        }
        if let Some(runner_up) = &c.runner_up {
            text += &if c.quantity.is_some() {
                let ruled_out = if runner_up.ruled_out { "; the other channels rule it out" } else { "" };
                let far = runner_up.deviations.map_or(String::new(), |deviations| {
                    format!(", {deviations:.0} standard deviations away by all texels together")
                });
                format!(
                    "{}: the next best, {}, leaves {:.1} times as much{far}{ruled_out}\n",
                    c.channel, runner_up.what, runner_up.times
                )
            } else {
                format!(
                    "{}: what comes nearest is {}, which leaves {:.1e}\n",
                    c.channel, runner_up.what, runner_up.residual
                )
            };
        }
    }
    for command in &found.commands {
        text += &format!("as it should be: {command}\n");
    }
    for command in &found.commands_as_it_is {
        text += &format!("as it is: {command}\n");
    }
    text + "\n"
}

/// What is left that is no rounding, in a line.
fn left(channel: &str, noise: &Noise) -> String {
    match noise.samples {
        Some(samples) => {
            // Noise knows itself to a tenth or so: one digit.
            let digit = 10.0_f64.powf(samples.log10().floor());
            let samples = (samples / digit).round() * digit;
            format!(
                "{channel}: what is left is noise, as much as about {samples} well-drawn random samples a texel leave\n"
            )
        }
        None if noise.is_patterned() => {
            format!(
                "{channel}: what is left has a pattern: too few samples, always the same ones, or a detail that is not known here\n"
            )
        }
        None => format!("{channel}: what is left is noise\n"),
    }
}
