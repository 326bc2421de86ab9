//! `kiln verify`: whether files hold what they claim.

use super::chain::ChainArgs;
use super::console::{Console, columns, printable};
use clap::Args;
use kiln::check::Check;
use kiln::verify::{Options, Report, file, files_of};
use kiln::{Error, Result};
use std::path::PathBuf;

/// Check files against physics and against both witnesses; exit 3 if any value is wrong
#[derive(Debug, Args)]
pub struct Verify {
    /// Files that Kiln baked, or folders of them
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Ask the random witness at every texel, not only at 64 (slow)
    #[arg(long)]
    full: bool,
    /// Largest error of a foreign environment chain, in parts of the value or of 1e-3 of the mean; exit 3 above it
    #[arg(long, value_name = "ERROR", requires = "source")]
    max_error: Option<f64>,
    #[command(flatten)]
    chain: ChainArgs,
}

impl Verify {
    pub fn run(&self, console: &Console) -> Result<()> {
        if self.chain.source.is_some() {
            let [failed, total] = self.chain.run(&self.files, self.max_error, console)?;
            return if failed > 0 { Err(Error::Verification { failed, total }) } else { Ok(()) };
        }
        let mut paths = vec![];
        for path in &self.files {
            paths.extend(files_of(path)?);
        }
        let (mut reports, mut failed, mut first_error) = (vec![], 0, None);
        for path in &paths {
            // One file that cannot be judged does not keep the others from being judged.
            match file(path, Options { full: self.full }) {
                Ok(report) => {
                    failed += report.failures();
                    if !console.json {
                        console.print(&text(&report))?;
                    }
                    reports.push(report);
                }
                Err(error) => {
                    if first_error.is_some() || paths.len() > 1 {
                        console.error(&error);
                    }
                    first_error.get_or_insert(error);
                }
            }
        }
        if console.json {
            console.print_json(&reports)?;
        }
        let total = reports.iter().map(|r| r.checks.len()).sum();
        match first_error {
            _ if failed > 0 => Err(Error::Verification { failed, total }),
            Some(error) => Err(error),
            None => Ok(()),
        }
    }
}

fn text(report: &Report) -> String {
    let row = |c: &Check| {
        let verdict = if c.passed { "pass" } else { "FAIL" };
        let number = |v: f64| if v == 0.0 { "0".to_owned() } else { format!("{v:.2e}") };
        vec![verdict.to_owned(), c.name.clone(), c.subject.clone(), number(c.figure), number(c.limit), c.detail.clone()]
    };
    let rows: Vec<_> = report.checks.iter().map(row).collect();
    let mut text = format!("{}: {}\n", report.file.display(), report.claim);
    text += &columns(&["", "check", "of", "found", "at most", "where"], &rows);
    for skipped in &report.skipped {
        text += &format!("skipped: {skipped}\n");
    }
    let verdict = match report.failures() {
        0 => format!("{} checks passed", report.checks.len()),
        n => format!("{n} of {} checks FAILED", report.checks.len()),
    };
    printable(&format!("{text}{verdict}\n\n"))
}
