//! Verification of files: read again, judged against physics and against both witnesses.
//!
//! What a file claims to be, its certificate says (embedded, or beside it); whether that is true, the checks say.

pub mod chain;
mod environment;
mod table;

use crate::certificate::{self, Certificate};
use crate::check::Check;
use crate::error::{Error, Result};
use crate::format::{FileKind, Image, Texture, exr, ktx2};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// How thoroughly to look.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Options {
    /// Ask the random witness at every texel, not at a choice of them.
    pub full: bool,
}

/// What was found out about one file.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The file.
    pub file: PathBuf,
    /// What it claims to be, in a few words.
    pub claim: String,
    /// What was checked.
    pub checks: Vec<Check>,
    /// What could not be checked, and why.
    pub skipped: Vec<String>,
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
    Json(serde_json::Value),
}

impl Content {
    fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::reading(path, e))?;
        let content = match FileKind::of(&bytes) {
            FileKind::Exr => exr::decode(&bytes).map(Self::Picture),
            FileKind::Ktx2 => ktx2::decode(&bytes).map(Self::Texture),
            FileKind::Empty => Err(Error::invalid("an empty file", "bake it again")),
            _ if path.extension().is_some_and(|e| e == "json") => serde_json::from_slice(&bytes)
                .map(Self::Json)
                .map_err(|e| Error::invalid(format!("broken JSON: {e}"), "bake it again")),
            FileKind::Hdr => {
                Err(Error::unsupported("a panorama, which claims nothing", "verify what was baked from it"))
            }
            kind => Err(Error::unsupported(
                format!("{}, which Kiln does not verify", kind.text()),
                "give an .exr, .ktx2 or sh.json",
            )),
        };
        content.map_err(|e| e.in_file(path))
    }

    fn certificate(&self) -> Option<&str> {
        match self {
            Self::Picture(image) => image.metadata(certificate::KEY),
            Self::Texture(texture) => texture.metadata(certificate::KEY),
            Self::Json(_) => None,
        }
    }
}

/// Judges one file.
///
/// **Errors**: a file that cannot be read, or that carries no certificate and has none beside it.
pub fn file(path: &Path, options: Options) -> Result<Report> {
    let content = Content::read(path)?;
    let certificate = find_certificate(path, &content)?;
    if let Some(recipe) = certificate.table.clone() {
        table::verify(path, &content, &certificate, &recipe, options)
    } else if let Some(recipe) = certificate.environment.clone() {
        environment::verify(path, &content, &certificate, &recipe, options)
    } else {
        Err(Error::invalid("a certificate without a recipe", "bake the file again").in_file(path))
    }
}

/// The certificate in the file, or beside it: `NAME.certificate.json`, or the folder's `certificate.json`.
fn find_certificate(path: &Path, content: &Content) -> Result<Certificate> {
    if let Some(text) = content.certificate() {
        return Certificate::from_json(text).map_err(|e| e.in_file(path));
    }
    for candidate in [certificate::beside(path), path.with_file_name("certificate.json")] {
        if let Ok(text) = std::fs::read_to_string(&candidate) {
            return Certificate::from_json(&text).map_err(|e| e.in_file(&candidate));
        }
    }
    Err(Error::unsupported(
        "no certificate in the file or beside it, so nothing says what it should hold",
        "verify files that Kiln baked, with their certificate",
    )
    .in_file(path))
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
            found.extend(certificate.files.iter().map(|f| entry.with_file_name(&f.file)));
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
