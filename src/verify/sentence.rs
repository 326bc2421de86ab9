//! Assertions about tables that read like a sentence, for the tests of whoever ships them.
//!
//! ```no_run
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! kiln::verify::that_file("assets/dfg.ktx2")?.holds("dfg")?.within(2e-3)?;
//! # Ok(())
//! # }
//! ```

use super::foreign::{self, ChannelErrors};
use super::{Options, Report};
use crate::claim::{Claim, Said};
use crate::error::Result;
use crate::format::Grid;
use crate::format::grid::Described;
use crate::table::{Axis, Model, Parameter, Point};
use std::fmt;
use std::path::{Path, PathBuf};

/// A file of which something is about to be said.
#[derive(Debug, Clone)]
pub struct That {
    path: PathBuf,
    grid: Grid,
    said: Said,
}

/// A file that was judged by what was said of it.
#[derive(Debug, Clone)]
pub struct Judged {
    report: Report,
}

/// Why a table is not what it was said to be: which channel is off, where, and by how much.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure {
    text: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl std::error::Error for Failure {}

/// The table in a file that Kiln reads: KTX2, EXR, HDR, PNG, or an array in source text.
///
/// **Errors**: a file that cannot be read, or that does not say which shape its numbers have: [`that_grid`] takes any.
pub fn that_file(path: impl AsRef<Path>) -> Result<That> {
    let path = path.as_ref();
    Ok(That { path: path.to_owned(), grid: Grid::read(path, &Described::default())?, said: Said::default() })
}

/// The same of numbers that are there already; `name` is what messages call them.
pub fn that_grid(name: &str, grid: Grid) -> That {
    That { path: name.into(), grid, said: Said::default() }
}

impl That {
    /// Axes other than the table's own, x first, as `kiln table --axes` has them; their sizes are the file's.
    ///
    /// **Errors**: an axis that cannot be read.
    pub fn over(mut self, axes: &[&str]) -> Result<Self> {
        self.said.axes = axes.iter().map(|axis| axis.parse()).collect::<Result<Vec<Axis>>>()?;
        Ok(self)
    }

    /// A value of a parameter that no axis varies.
    ///
    /// **Errors**: a value outside the parameter's domain, or a second one.
    pub fn at(mut self, parameter: Parameter, value: f64) -> Result<Self> {
        self.said.at = std::mem::take(&mut self.said.at).with(parameter, value)?;
        Ok(self)
    }

    /// A model other than the usual one.
    pub fn with(mut self, model: Model) -> Self {
        self.said.model = model;
        self
    }

    /// Says that the file holds the table of that name (`kiln list tables`), and judges it.
    ///
    /// **Errors**: an unknown name, or a file of another shape.
    pub fn holds(mut self, table: &str) -> Result<Judged> {
        self.said.table = Some(table.to_owned());
        self.judge()
    }

    /// Says which quantities the channels hold (`kiln list quantities`), `-` for whatever, and judges them.
    ///
    /// **Errors**: as [`That::holds`]; [`That::over`] was left out.
    pub fn holds_quantities(mut self, quantities: &[&str]) -> Result<Judged> {
        self.said.channels = quantities.iter().map(|&name| name.to_owned()).collect();
        self.judge()
    }

    fn judge(self) -> Result<Judged> {
        let claim = Claim::new(&self.grid, &self.said).map_err(|e| e.in_file(&self.path))?;
        let options = Options { max_error: Some(f64::INFINITY), ..Options::default() };
        Ok(Judged { report: foreign::judge(&self.path, &self.grid, Some(claim), &options)? })
    }
}

impl Judged {
    /// Every texel of every channel is within `limit` of the truth.
    ///
    /// **Errors**: one is not, or is no number; the message says which is furthest off, where and by how much.
    pub fn within(&self, limit: f64) -> std::result::Result<&Self, Failure> {
        self.at_most("", limit, |c| (c.texels.max, c))
    }

    /// What a shader sees through linear filtering is within `limit` of the truth, everywhere between the texels.
    ///
    /// **Errors**: as [`Judged::within`].
    pub fn filtered_within(&self, limit: f64) -> std::result::Result<&Self, Failure> {
        self.at_most(" through linear filtering", limit, |c| (c.filtered.as_ref().map_or(f64::NAN, |f| f.max), c))
    }

    /// The errors of each channel.
    pub fn channels(&self) -> &[ChannelErrors] {
        &self.report.channels
    }

    /// Everything that was found out.
    pub fn report(&self) -> &Report {
        &self.report
    }

    fn at_most(
        &self,
        how: &str,
        limit: f64,
        figure: impl Fn(&ChannelErrors) -> (f64, &ChannelErrors),
    ) -> std::result::Result<&Self, Failure> {
        let mut wrong: Vec<(f64, &ChannelErrors)> = self
            .report
            .channels
            .iter()
            .map(figure)
            .filter(|(error, _)| error.is_nan() || limit.is_nan() || *error > limit)
            .collect();
        let rank = |error: f64| if error.is_nan() { f64::INFINITY } else { error };
        wrong.sort_by(|a, b| rank(b.0).total_cmp(&rank(a.0)));
        let Some((error, c)) = wrong.first() else { return Ok(self) };
        let at: Point =
            if how.is_empty() { c.worst.at } else { c.filtered.as_ref().map_or(c.worst.at, |f| f.worst_at) };
        let [column, row, slice] = c.worst.texel;
        let texel = if how.is_empty() {
            format!(
                " (column {column}, row {row}, slice {slice}), where it has {:.6} and {:.6} is right",
                c.worst.found, c.worst.wanted
            )
        } else {
            String::new()
        };
        let others = match wrong.len() - 1 {
            0 => String::new(),
            n => format!("; {n} more of its channels are further off than that too"),
        };
        Err(Failure {
            text: format!(
                "{}: channel {} is not {} within {limit:e}{how}: it is off by {error:.3e} at {at}{texel}{others}",
                self.report.file.display(),
                c.channel,
                c.quantity
            ),
        })
    }
}
