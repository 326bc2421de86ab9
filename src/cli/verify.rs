//! `kiln verify`: whether files hold what they claim, or what they are said to.

use super::chain::ChainArgs;
use super::console::{Console, columns, name_of, printable};
use super::foreign::{DescribedArgs, SaidArgs};
use clap::Args;
use kiln::check::Check;
use kiln::format::atomic;
use kiln::verify::foreign::ChannelErrors;
use kiln::verify::{Options, Report, file_as, files_of, junit};
use kiln::{Error, Result, identify};
use std::path::PathBuf;

/// Check files against physics and against both witnesses; exit 3 if any value is wrong
#[derive(Debug, Args)]
pub struct Verify {
    /// Files that Kiln baked, folders of them, or anybody's tables
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Ask the random witness at every texel, not only at 64 (slow)
    #[arg(long)]
    full: bool,
    /// Largest error that is right in a table without a certificate [default: one step of what it stores, at least 0.001], or, relative
    /// to the value, in a chain with --source [default: any]
    #[arg(long, value_name = "ERROR")]
    max_error: Option<f64>,
    /// Write a JUnit report too
    #[arg(long, value_name = "FILE.xml")]
    junit: Option<PathBuf>,
    /// Neither read nor write the tables that are kept in the user's cache folder
    #[arg(long)]
    no_cache: bool,
    #[command(flatten)]
    chain: ChainArgs,
    #[command(flatten)]
    said: SaidArgs,
    #[command(flatten)]
    described: DescribedArgs,
}

impl Verify {
    pub fn run(&self, console: &Console) -> Result<()> {
        if let Some(bad) = self.max_error.filter(|e| e.is_nan() || *e < 0.0) {
            return Err(Error::usage(format!("--max-error {bad} is no error"), "give a number such as 1e-3"));
        }
        if self.chain.source.is_some() {
            let reports = self.chain.run(&self.files, self.max_error, console)?;
            return self.conclude(&reports, vec![], console);
        }
        let options = Options {
            full: self.full,
            max_error: self.max_error,
            identify: identify::Options { cache: !self.no_cache },
        };
        let (said, described) = (self.said.said()?, self.described.described());
        let mut paths = vec![];
        for path in &self.files {
            paths.extend(files_of(path)?);
        }
        let (mut reports, mut errors) = (vec![], vec![]);
        for path in &paths {
            // One file that cannot be judged does not keep the others from being judged.
            match file_as(path, &described, said.as_ref(), options) {
                Ok(report) => {
                    if !console.json {
                        console.print(&text(&report))?;
                    }
                    reports.push(report);
                }
                Err(error) => errors.push((path.clone(), error)),
            }
        }
        if console.json {
            console.print_json(&reports)?;
        }
        self.conclude(&reports, errors, console)
    }

    /// Writes the JUnit report; what failed, or could not be judged, is the error.
    fn conclude(&self, reports: &[Report], errors: Vec<(PathBuf, Error)>, console: &Console) -> Result<()> {
        if let Some(path) = &self.junit {
            atomic::write(path, junit::xml(reports, &errors).as_bytes())?;
        }
        let failed = reports.iter().map(Report::failures).sum();
        let total = reports.iter().map(|r| r.checks.len()).sum();
        // The command's own error is printed last, and once.
        let mut errors: Vec<Error> = errors.into_iter().map(|(_, error)| error).collect();
        if failed > 0 {
            errors.insert(0, Error::Verification { failed, total });
        }
        errors.iter().skip(1).for_each(|error| console.error(error));
        errors.into_iter().next().map_or(Ok(()), Err)
    }
}

fn number(v: f64) -> String {
    if v == 0.0 { "0".to_owned() } else { format!("{v:.2e}") }
}

fn text(report: &Report) -> String {
    let row = |c: &Check| {
        let verdict = if c.passed { "pass" } else { "FAIL" };
        vec![verdict.to_owned(), c.name.clone(), c.subject.clone(), number(c.figure), number(c.limit), c.detail.clone()]
    };
    let rows: Vec<_> = report.checks.iter().map(row).collect();
    let mut text = format!("{}: {}\n", name_of(&report.file), report.claim);
    if !report.channels.is_empty() {
        text += &errors(&report.channels);
    }
    text += &columns(&["", "check", "of", "found", "at most", "where"], &rows);
    for note in &report.notes {
        text += &format!("note: {note}\n");
    }
    for skipped in &report.skipped {
        text += &format!("skipped: {skipped}\n");
    }
    let verdict = match (report.failures(), report.checks.len()) {
        (0, 1) => "1 check passed".to_owned(),
        (0, all) => format!("{all} checks passed"),
        (failed, all) => format!("{failed} of {all} checks FAILED"),
    };
    printable(&format!("{text}{verdict}\n\n"))
}

/// The errors of somebody else's table: at the texels, what rounding would have left, and through linear filtering.
fn errors(channels: &[ChannelErrors]) -> String {
    let row = |c: &ChannelErrors, what: &str, [max, mean, rms]: [Option<f64>; 3], comment: String| {
        let cell = |v: Option<f64>| v.map_or(String::new(), number);
        vec![c.channel.clone(), what.to_owned(), cell(max), cell(mean), cell(rms), comment]
    };
    let all = |e: &kiln::verify::foreign::Errors| [Some(e.max), Some(e.mean), Some(e.rms)];
    let mut rows = vec![];
    for c in channels {
        rows.push(row(
            c,
            "texels",
            all(&c.texels),
            format!("{:.1} times the RMS of correct rounding", c.times_rounding),
        ));
        rows.push(row(c, "correct rounding", all(&c.rounding), format!("to {}", c.stored)));
        if let Some(f) = &c.filtered {
            rows.push(row(c, "through the filter", [Some(f.max), None, Some(f.rms)], format!("at {}", f.worst_at)));
        }
        if let Some(f) = &c.filtered_exact {
            let comment = format!("at {}", f.worst_at);
            rows.push(row(c, "the same, exact texels", [Some(f.max), None, Some(f.rms)], comment));
        }
    }
    columns(&["", "errors", "max", "mean", "RMS", ""], &rows)
}
