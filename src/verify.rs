//! Verification of files: read again, judged against physics and against both witnesses.
//!
//! What a file claims to be, its certificate says (embedded, or beside it); whether that is true, the checks say. A table without a
//! certificate is somebody else's: [`foreign`] judges it by what the user says it is, or else by what [`identify`](mod@crate::identify)
//! finds it to be.
//!
//! [`that_file`] is the way in for an engine's own tests; [`junit`] is for its continuous integration.

pub mod chain;
mod environment;
pub mod foreign;
pub mod junit;
mod sentence;
mod table;

pub use sentence::{Failure, Judged, That, that_file, that_grid};

use crate::certificate::{self, Certificate};
use crate::check::Check;
use crate::claim::{Claim, Said};
use crate::error::{Error, Result};
use crate::format::grid::Described;
use crate::format::{Array, Decoded, FileKind, Grid, Image, Texture};
use crate::identify;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// How thoroughly to look.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Options {
    /// Ask the random witness at every texel, not at a choice of them.
    pub full: bool,
    /// What a texel of somebody else's table may be off by; `None` is one step of what the file stores, or [`foreign::LEAST_LIMIT`].
    pub max_error: Option<f64>,
    /// How to find out what a table is of which nothing is said.
    pub identify: identify::Options,
}

/// What was found out about one file.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Report {
    /// The file.
    pub file: PathBuf,
    /// What it claims to be, in a few words.
    pub claim: String,
    /// What was checked.
    pub checks: Vec<Check>,
    /// What could not be checked, and why.
    pub skipped: Vec<String>,
    /// The errors of each channel of somebody else's table.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<foreign::ChannelErrors>,
    /// What else is worth knowing, such as which physical limits are broken: it decides nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

impl Report {
    /// How many checks failed.
    pub fn failures(&self) -> usize {
        self.checks.iter().filter(|c| !c.passed).count()
    }
}

/// What a file holds, as far as verification cares.
enum Content {
    Picture(Image),
    Texture(Texture),
    Array(Array),
    Json(serde_json::Value),
}

impl Content {
    fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::reading(path, e))?;
        let is_json = path.extension().is_some_and(|e| e == "json");
        let content = match FileKind::of(&bytes) {
            FileKind::Empty => Err(Error::invalid("an empty file", "bake it again")),
            FileKind::Other(_) if is_json => serde_json::from_slice(&bytes)
                .map(Self::Json)
                .map_err(|e| Error::invalid(format!("broken JSON: {e}"), "bake it again")),
            FileKind::Other(kind) => certificate::bare_texture(path, &bytes)?.map(Self::Texture).ok_or_else(|| {
                Error::unsupported(
                    format!("{kind}, which Kiln did not bake"),
                    "give a file that Kiln baked, with its certificate, or a table in a file that it reads",
                )
            }),
            _ => certificate::decode(path, &bytes).map(|decoded| match decoded {
                Decoded::Picture(image, _) => Self::Picture(image),
                Decoded::Texture(texture) => Self::Texture(texture),
                Decoded::Array(array) => Self::Array(array),
            }),
        };
        content.map_err(|e| e.in_file(path))
    }

    fn certificate(&self) -> Option<&str> {
        match self {
            Self::Picture(image) => image.metadata(certificate::KEY),
            Self::Texture(texture) => texture.metadata(certificate::KEY),
            Self::Array(array) => array.metadata(certificate::KEY),
            Self::Json(_) => None,
        }
    }

    /// Whether it has the shape of a table; cubes and coefficients have not.
    fn may_be_a_table(&self) -> bool {
        match self {
            Self::Picture(_) | Self::Array(_) => true,
            Self::Texture(texture) => texture.faces == 1,
            // Spherical harmonics and the like say what they are.
            Self::Json(value) => value.get("schema").is_none(),
        }
    }
}

/// Judges one file: by its certificate, or, failing that, as a table that is found out.
///
/// **Errors**: a file that cannot be read, or of which nobody can tell what it should hold.
pub fn file(path: &Path, options: Options) -> Result<Report> {
    file_as(path, &Described::default(), None, options)
}

/// Judges one file by what is `said` of it; where nothing is, as [`file()`] does. `described` says what the file does not say itself.
///
/// **Errors**: as [`file()`]; what is said does not fit the file.
pub fn file_as(path: &Path, described: &Described, said: Option<&Said>, options: Options) -> Result<Report> {
    if let Some(said) = said {
        let grid = Grid::read(path, described)?;
        let claim = Claim::new(&grid, said).map_err(|e| e.in_file(path))?;
        return foreign::judge(path, &grid, Some(claim), &options);
    }
    let content = match Content::read(path) {
        // What Kiln does not bake may still be a table that it reads.
        Err(refused @ (Error::Unsupported(_) | Error::Invalid(_))) => {
            return match Grid::read(path, described) {
                Ok(grid) => foreign::judge(path, &grid, None, &options),
                // Of broken JSON it is more to the point what is broken than that it holds no numbers.
                Err(Error::Unsupported(_)) if matches!(refused, Error::Invalid(_)) => Err(refused),
                Err(told) => Err(told),
            };
        }
        content => content?,
    };
    if let Content::Texture(texture) = &content
        && let Some(text) = texture.metadata(certificate::LAYERS_KEY)
    {
        return layers(path, texture, text, options);
    }
    let Some(certificate) = find_certificate(path, &content)? else {
        if content.may_be_a_table() {
            return foreign::judge(path, &Grid::read(path, described)?, None, &options);
        }
        return Err(Error::unsupported(
            "no certificate in the file or beside it, so nothing says what it should hold",
            match &content {
                Content::Texture(texture) if chain::is_cube(texture) => {
                    "give what it was made from, such as --source sky.hdr"
                }
                _ => "verify files that Kiln baked, with their certificate",
            },
        )
        .in_file(path));
    };
    if let Some(recipe) = certificate.table.clone() {
        table::verify(path, &content, &certificate, &recipe, options)
    } else if let Some(recipe) = certificate.environment.clone() {
        environment::verify(path, &content, &certificate, &recipe, options)
    } else {
        Err(Error::invalid("a certificate without a recipe", "bake the file again").in_file(path))
    }
}

/// Judges the layers of an array texture, each as the table that it is.
fn layers(path: &Path, texture: &Texture, certificates: &str, options: Options) -> Result<Report> {
    let certificates = Certificate::list_from_json(certificates).map_err(|e| e.in_file(path))?;
    let broken = |what: String| Error::invalid(what, "bake the file again").in_file(path);
    if certificates.is_empty() || certificates.len() != texture.layers(0) || texture.levels.len() != 1 {
        return Err(broken(format!("{}, and {} certificates", texture.text(), certificates.len())));
    }
    let mut report = Report { file: path.to_owned(), claim: "array".to_owned(), ..Report::default() };
    for (i, certificate) in certificates.iter().enumerate() {
        let (Some(recipe), Some(layer)) = (&certificate.table, texture.layer(i)) else {
            return Err(broken(format!("layer {i} is said to be no table")));
        };
        let found = table::verify(path, &Content::Texture(layer), certificate, recipe, options)?;
        report.claim += &format!("{} layer {i}: {}", if i > 0 { ";" } else { " of" }, found.claim);
        let subject = |check: Check| Check { subject: format!("layer {i}: {}", check.subject), ..check };
        report.checks.extend(found.checks.into_iter().map(subject));
        report.skipped.extend(found.skipped);
    }
    Ok(report)
}

/// The certificate in the file, or beside it.
fn find_certificate(path: &Path, content: &Content) -> Result<Option<Certificate>> {
    match content.certificate() {
        Some(text) => Certificate::from_json(text).map(Some).map_err(|e| e.in_file(path)),
        None => certificate::find_beside(path),
    }
}

/// The files that a path stands for: itself, or, for a folder, everything in it that Kiln wrote with a certificate.
///
/// **Errors**: a folder that cannot be read or that holds no certificate.
pub fn files_of(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut found = vec![];
    collect(path, &mut found)?;
    if found.is_empty() {
        return Err(
            Error::invalid("no certificate in the folder", "give a folder that `kiln bake` wrote").in_file(path)
        );
    }
    Ok(found)
}

fn collect(folder: &Path, found: &mut Vec<PathBuf>) -> Result<()> {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|e| e.map(|e| e.path())).collect())
        .map_err(|e| Error::reading(folder, e))?;
    entries.sort();
    for entry in entries {
        let name = entry.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        if entry.is_dir() {
            collect(&entry, found)?;
        } else if name.ends_with("certificate.json") {
            let text = std::fs::read_to_string(&entry).map_err(|e| Error::reading(&entry, e))?;
            let certificate = Certificate::from_json(&text).map_err(|e| e.in_file(&entry))?;
            // (Layers of an array have a certificate each.)
            let files = certificate.files.iter().map(|f| entry.with_file_name(&f.file));
            let new: Vec<PathBuf> = files.filter(|file| !found.contains(file)).collect();
            found.extend(new);
        }
    }
    Ok(())
}

/// The check that the texels are those that were certified.
fn digest_check(path: &Path, certificate: &Certificate, found: &str) -> Option<Check> {
    let name = path.file_name()?.to_str()?;
    // A renamed file is still the same file when the certificate is for one only.
    let certified = match &certificate.files[..] {
        [only] => only,
        files => files.iter().find(|f| f.file == name)?,
    };
    let differs = f64::from(u8::from(certified.digest != found));
    Some(Check::at_most("texels other than the certified ones", name, differs, 0.0, format!("BLAKE3 {}", &found[..16])))
}
