//! What `kiln verify` and `kiln identify` say of environment chains that Kiln did not make.

use super::console::{Console, columns, name_of, printable};
use clap::{Args, ValueEnum};
use kiln::environment::kernel::KernelKind;
use kiln::environment::{Panorama, Reading, load};
use kiln::format::Decoded;
use kiln::verify::Report;
use kiln::verify::chain::{LevelVerdict, Question, Verdict, is_cube, judge_maps, levels_of};
use kiln::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What a chain is compared with.
#[derive(Debug, Clone, Default, Args)]
pub struct ChainArgs {
    /// What an environment chain was made from: a panorama, a cube or builtin:NAME. The chain may be of cubes, of squares (octahedral maps)
    /// or of panoramas
    #[arg(long, value_name = "INPUT")]
    pub source: Option<String>,
    /// The kernel that it is said to have [default: whichever fits]
    #[arg(long, value_enum)]
    pub kernel: Option<KernelName>,
    /// The roughness that its levels are said to have; errors are counted against that [default: what fits]
    #[arg(long, value_name = "R", value_delimiter = ',', requires = "source")]
    pub roughness: Vec<f64>,
}

/// Whether a file is a cube map.
pub fn is_cube_file(path: &Path) -> bool {
    matches!(kiln::format::read(path), Ok(Decoded::Texture(texture)) if is_cube(&texture))
}

/// `--kernel`, in words.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum KernelName {
    /// GGX weighted by N·L
    Nol,
    /// GGX weighted by masking
    G1,
    /// Sheen, weighted by N·L
    Charlie,
}

impl From<KernelName> for KernelKind {
    fn from(name: KernelName) -> Self {
        match name {
            KernelName::Nol => Self::Nol,
            KernelName::G1 => Self::G1,
            KernelName::Charlie => Self::Charlie,
        }
    }
}

/// A verdict and whose it is.
#[derive(Debug, Serialize)]
pub struct Judged {
    file: PathBuf,
    source: Option<String>,
    #[serde(flatten)]
    verdict: Verdict,
}

impl ChainArgs {
    /// The panorama, if one was given.
    pub fn panorama(&self) -> Result<Option<Panorama>> {
        let read = |input: &String| load(input, &Reading::default()).map(|(panorama, _)| panorama);
        self.source.as_ref().map(read).transpose()
    }

    /// Judges a file that holds a cube, or a chain of squares or panoramas.
    pub fn judge(&self, path: &Path, source: Option<&Panorama>, max_error: Option<f64>) -> Result<Judged> {
        let levels = kiln::format::read(path).and_then(|content| levels_of(&content)).map_err(|e| e.in_file(path))?;
        if let Some(bad) = self.roughness.iter().find(|r| !(0.0..=1.0).contains(*r)) {
            return Err(Error::usage(
                format!("roughness {bad} is outside its domain [0, 1]"),
                "give one per level, such as --roughness 0,0.5,1",
            ));
        }
        let question = Question {
            source,
            kernel: self.kernel.map(KernelKind::from),
            roughness: (!self.roughness.is_empty()).then(|| self.roughness.clone()),
            max_error,
        };
        let verdict = judge_maps(&levels, &question).map_err(|e| e.in_file(path))?;
        Ok(Judged { file: path.to_owned(), source: self.source.clone(), verdict })
    }

    /// Judges files, prints what came of it, and returns it as reports.
    pub fn run(&self, files: &[PathBuf], max_error: Option<f64>, console: &Console) -> Result<Vec<Report>> {
        let source = self.panorama()?;
        let judged: Vec<Judged> =
            files.iter().map(|file| self.judge(file, source.as_ref(), max_error)).collect::<Result<_>>()?;
        if console.json {
            console.print_json(&judged)?;
        } else {
            judged.iter().try_for_each(|judged| console.print(&judged.text()))?;
        }
        Ok(judged.into_iter().map(Judged::report).collect())
    }
}

impl Judged {
    /// What it is compared with, in a few words.
    fn claim(&self) -> String {
        let against = match &self.source {
            Some(source) => format!("against {source}"),
            None => "against its own level 0".to_owned(),
        };
        let Verdict { layout, size, levels, .. } = &self.verdict;
        format!("{} of {}, {} levels, {against}", layout.noun(), layout.size_text(*size), levels.len())
    }

    fn report(self) -> Report {
        let claim = self.claim();
        Report {
            file: self.file,
            claim,
            checks: self.verdict.checks,
            notes: self.verdict.findings,
            ..Report::default()
        }
    }

    fn text(&self) -> String {
        let verdict = &self.verdict;
        let mut text = format!("{}: {}\n", name_of(&self.file), self.claim());
        let rows: Vec<Vec<String>> = verdict.levels.iter().enumerate().map(|(m, level)| row(m, level)).collect();
        text += &columns(&["level", "size", "roughness", "range", "rms", "max", "drift", "where"], &rows);
        for finding in &verdict.findings {
            text += &format!("{finding}\n");
        }
        for check in verdict.checks.iter().filter(|check| !check.passed) {
            text +=
                &format!("FAIL {}: {}: {:.2e}, at most {:.2e}\n", check.subject, check.name, check.figure, check.limit);
        }
        printable(&(text + "\n"))
    }
}

fn row(m: usize, level: &LevelVerdict) -> Vec<String> {
    let roughness = match level.roughness {
        Some(0.0) => "mirror".to_owned(),
        Some(roughness) => format!("{roughness:.3}"),
        None => "unknown".to_owned(),
    };
    let range = match (level.roughness, level.roughness_range) {
        (Some(0.0), _) | (_, None) => String::new(),
        (_, Some([low, high])) => format!("{low:.3}–{high:.3}"),
    };
    let number = |value: f64| format!("{value:.2e}");
    let (rms, max, place) = match &level.error {
        Some(error) => (number(error.rms), number(error.max), error.worst_at.clone()),
        None => (String::new(), String::new(), String::new()),
    };
    let drift = format!("{:+.2e}", level.mean_drift);
    vec![m.to_string(), level.size.to_string(), roughness, range, rms, max, drift, place]
}
