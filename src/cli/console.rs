//! What a person or a program sees: results on stdout, everything else on stderr.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kiln::{Error, Result};
use serde::Serialize;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;

/// How to speak.
pub struct Console {
    /// Results as JSON.
    pub json: bool,
    /// Only results and errors.
    pub quiet: bool,
}

impl Console {
    /// Prints a result.
    pub fn print(&self, text: &str) -> Result<()> {
        match std::io::stdout().lock().write_all(text.as_bytes()) {
            // Whoever reads stdout has seen enough: `kiln … | head` is no failure.
            Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
            other => other.map_err(|e| Error::writing(Path::new("standard output"), e)),
        }
    }

    /// Prints a result as JSON.
    pub fn print_json(&self, value: &impl Serialize) -> Result<()> {
        let text = serde_json::to_string_pretty(value)
            .map_err(|e| Error::unsupported(format!("a result that JSON cannot hold: {e}"), "leave --json out"))?;
        self.print(&(text + "\n"))
    }

    /// Says what happened, to a person.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            let _ = writeln!(std::io::stderr(), "{text}"); // nobody is left to tell
        }
    }

    /// Says what a person should know before using the result.
    pub fn warn(&self, text: &str) {
        self.note(&format!("warning: {text}"));
    }

    /// Says why nothing came of it.
    pub fn error(&self, error: &Error) {
        let _ = writeln!(std::io::stderr(), "error: {}", printable(&error.to_string())); // nobody is left to tell
    }

    /// A bar on a terminal, nothing elsewhere.
    pub fn progress(&self, total: u64, what: &str) -> ProgressBar {
        if self.quiet || !std::io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{msg:24} {bar:40} {percent:>3} %  {eta} left") {
            bar.set_style(style);
        }
        bar.set_message(what.to_owned());
        bar
    }
}

/// The text without control characters, which a file name or a broken file may hold.
pub fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() && c != '\n' { '\u{fffd}' } else { c }).collect()
}

/// A file's name on one line: the next would look like Kiln's own.
pub fn name_of(path: &Path) -> String {
    printable(&path.display().to_string().replace('\n', "\u{fffd}"))
}

/// Rows under headings, columns aligned; numbers to the right.
pub fn columns(headings: &[&str], rows: &[Vec<String>]) -> String {
    let width = |c: usize| {
        rows.iter().filter_map(|r| r.get(c)).map(|cell| cell.chars().count()).chain([headings[c].chars().count()]).max()
    };
    let widths: Vec<usize> = (0..headings.len()).map(|c| width(c).unwrap_or(0)).collect();
    let line = |cells: &[String]| {
        let padded: Vec<String> = cells
            .iter()
            .zip(&widths)
            .map(|(cell, &w)| {
                let gap = " ".repeat(w.saturating_sub(cell.chars().count()));
                if cell.parse::<f64>().is_ok() { gap + cell } else { cell.clone() + &gap }
            })
            .collect();
        padded.join("  ").trim_end().to_owned() + "\n"
    };
    let headings: Vec<String> = headings.iter().map(|&h| h.to_owned()).collect();
    let mut text = line(&headings);
    for row in rows {
        text += &line(row);
    }
    text
}
