//! Certificates: where a file came from, how wrong it may be, and what it was checked against.
//!
//! A certificate is JSON, embedded in the file under [`KEY`] and written beside it as `NAME.certificate.json`. Its schema is
//! versioned: a reader refuses a version that it does not know.
//!
//! | field | meaning |
//! | --- | --- |
//! | `schema` | [`SCHEMA`] |
//! | `kiln`, `algorithms` | the version of Kiln and the revision of its algorithms: equal revisions give equal bytes |
//! | `table` or `environment` | the complete recipe entry, from which the file can be baked again |
//! | `digest` | BLAKE3 of the packed texels |
//! | `channels` | per quantity: definition, source, integrator, largest error and what it means, range of the values |
//! | `levels` | of an environment: per level its size, roughness, samples, largest and RMS error, mean, error through bilinear filtering, what fitting did |
//! | `input` | of an environment: what was read and as what, its digest, its primaries, what was repaired and the flux before and after, its mean radiance |
//! | `checks` | what the file was checked against: the figure, the limit, whether it passed |
//! | `packing` | rounding error, overflowed, negative and non-finite values |
//! | `rounding` | of a table: how many values are certified to be the nearest half, or an f32 within an ulp, and how many are undecided |
//! | `lookup` | of a table: the error through bilinear filtering |
//! | `approximation` | of a table of fitted lobes: how far these are from what they stand for; no error of the table, but of the model |
//! | `fit` | of a table with `fit = "lookup"`: what choosing its texels for the lookup did |

use crate::check::Check;
use crate::colour::Primaries;
use crate::environment::Adjusted;
use crate::environment::Layout;
use crate::environment::spherical_harmonics::IrradianceFit;
use crate::environment::{CubeFit, CubeLookup};
use crate::error::{Error, Result};
use crate::format::{self, Container, Decoded, FileKind, Texture, raw};
use crate::integrate::ErrorKind;
use crate::pack::PackReport;
use crate::recipe::{EnvironmentRecipe, TableRecipe};
use crate::table::Point;
use crate::table::fit::TableFit;
use crate::table::lookup::LookupError;
use crate::table::rounding::Rounding;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The schema of the certificates that this Kiln reads and writes.
pub const SCHEMA: &str = "kiln-certificate/1";
/// The metadata key under which a certificate is embedded.
pub const KEY: &str = "kiln.certificate";
/// The metadata key under which a cube says which of an environment's it is.
pub const CONTENT_KEY: &str = "kiln.content";
/// The metadata key under which an array texture has the certificates of its layers.
pub const LAYERS_KEY: &str = "kiln.layers";
/// Counts the changes to the algorithms that change bytes.
pub const ALGORITHMS: u32 = 9;

/// All that is known of a baked file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// [`SCHEMA`].
    pub schema: String,
    /// Version of Kiln.
    pub kiln: String,
    /// [`ALGORITHMS`].
    pub algorithms: u32,
    /// The recipe of a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<TableRecipe>,
    /// Which layer of an array texture the table is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layer: Option<usize>,
    /// The recipe of an environment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<EnvironmentRecipe>,
    /// What was read for an environment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input: Option<Input>,
    /// The files that the certificate is for, with the digests of their texels.
    pub files: Vec<FileDigest>,
    /// A table's channels.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<Channel>,
    /// An environment's levels, the irradiance cube last.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<Level>,
    /// How well an environment's nine coefficients render its irradiance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sh: Option<ShFits>,
    /// What the bake was checked against.
    pub checks: Vec<Check>,
    /// What packing changed.
    pub packing: PackReport,
    /// How many of a table's values are known to be the right ones of their number format.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rounding: Option<Rounding>,
    /// What a shader sees of a table.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lookup: Vec<LookupError>,
    /// How far the fitted lobes of a table are from what they stand for, a property of the model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub approximation: Vec<Approximation>,
    /// What fitting a table to the lookup did, channel by channel, if it was asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fit: Vec<TableFit>,
}

/// A file and what it holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileDigest {
    /// Its name, without folders.
    pub file: String,
    /// BLAKE3 of the packed texels, level by level, in hexadecimal.
    pub digest: String,
}

/// One channel of a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// The quantity.
    pub quantity: String,
    /// Its formula.
    pub definition: String,
    /// Where the formula comes from.
    pub source: String,
    /// The witness that computed it.
    pub integrator: String,
    /// The largest error over the texels, before packing.
    pub max_error: f64,
    /// What that error is.
    pub error_kind: ErrorKind,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Mean over the texels.
    pub mean: f64,
}

/// How far the lobes of a table are from what they stand for, over its texels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Approximation {
    /// Of which channels, separated by commas.
    pub channels: String,
    /// The largest total variation: no light, whatever its shape, is rendered off by more than this part of the albedo.
    pub max_total_variation: f64,
    /// Its mean.
    pub mean_total_variation: f64,
    /// The parameters at the largest.
    pub worst_at: Point,
    /// The largest square distance, in parts of the lobe's own norm.
    pub max_square: f64,
    /// The root of the mean of its square.
    pub rms: f64,
}

/// One level of an environment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Level {
    /// `specular 0`, `irradiance`.
    pub name: String,
    /// Texels along an edge.
    pub size: usize,
    /// The artist's roughness; irradiance is the filter at 1.
    pub roughness: f64,
    /// What computed it: `area-average`, `zonal`, `monte-carlo` or `quadrature`.
    pub integrator: String,
    /// Points per texel; 0 for a deterministic level.
    pub samples: u64,
    /// Largest error (of the kind below) over texels and channels, in parts of max(value, 1e-3 × the channel's mean).
    pub max_error: f64,
    /// Root mean square of the same.
    pub rms_error: f64,
    /// What these errors are.
    pub error_kind: ErrorKind,
    /// Degrees of spherical harmonics, of a zonal level.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub degree: usize,
    /// What leaving out higher degrees changes at most, on the scale of `max_error`; a bound, known before anything is measured.
    #[serde(default, skip_serializing_if = "is_nothing")]
    pub truncation_bound: f64,
    /// Mean over the sphere, texels weighted by their solid angles.
    pub mean: [f64; 3],
    /// The same, in parts of the input's mean, minus 1: the largest of the channels.
    pub mean_drift: f64,
    /// The error that a shader sees through seamless bilinear filtering, of the packed texels. There is none for a mirror, whose truth
    /// is a picture of boxes that no blend follows, nor for a kernel so narrow that only a sum over all texels knows the truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lookup: Option<CubeLookup>,
    /// What fitting to that filtering did, if it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit: Option<CubeFit>,
}

impl Level {
    /// Whether the texels are chosen for the lookup instead of being values at their centres.
    pub fn is_fitted(&self) -> bool {
        self.fit.as_ref().is_some_and(|fit| fit.kept)
    }
}

fn is_zero(value: &usize) -> bool {
    *value == 0
}

fn is_nothing(value: &f64) -> bool {
    *value == 0.0
}

/// How well the two sets of nine coefficients in `sh.json` render the exact irradiance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShFits {
    /// The projection.
    pub projected: IrradianceFit,
    /// What is negative nowhere.
    pub nonnegative: IrradianceFit,
    /// The projection of all bands, where more than three were asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bands: Option<IrradianceFit>,
}

/// The panorama behind an environment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Texels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// BLAKE3 of the radiance that was filtered (f32 RGB, after repairs), in hexadecimal.
    pub digest: String,
    /// Mean radiance over the sphere.
    pub mean: [f64; 3],
    /// Largest luminance.
    pub peak: f64,
    /// NaN and infinities that were turned to zero.
    pub nonfinite: u64,
    /// Values below zero that were found.
    pub negative: u64,
    /// What the input was read as.
    pub layout: Layout,
    /// Width and height of the panorama that was read, or of a face of the cube.
    pub size: [usize; 2],
    /// The primaries that the input states, if it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stated_primaries: Option<Primaries>,
    /// The primaries of what was filtered, and so of the files: x and y of red, green, blue and white.
    pub primaries: Primaries,
    /// The name of these, or the numbers again.
    pub primaries_name: String,
    /// Values below zero that the conversion to these primaries made.
    pub out_of_gamut: u64,
    /// ∫ L dω of each channel as found, in these primaries; NaN and infinities count as zero.
    pub flux_found: [f64; 3],
    /// The same of what was filtered: the difference is what `nonfinite` and `negatives` changed.
    pub flux: [f64; 3],
    /// What the adjustments came to.
    pub adjusted: Adjusted,
}

impl Certificate {
    /// A certificate with nothing in it yet.
    pub fn new() -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            kiln: env!("CARGO_PKG_VERSION").to_owned(),
            algorithms: ALGORITHMS,
            table: None,
            layer: None,
            environment: None,
            input: None,
            files: vec![],
            channels: vec![],
            levels: vec![],
            sh: None,
            checks: vec![],
            packing: PackReport::default(),
            rounding: None,
            lookup: vec![],
            approximation: vec![],
            fit: vec![],
        }
    }

    /// Reads a certificate.
    ///
    /// **Errors**: not a certificate, or of a schema that this Kiln does not know.
    pub fn from_json(text: &str) -> Result<Self> {
        #[derive(Deserialize)]
        struct Versioned {
            schema: String,
        }
        let broken = |e: serde_json::Error| {
            Error::invalid(
                format!("a broken certificate: {e}"),
                "bake the file again; certificates are not edited by hand",
            )
        };
        let Versioned { schema } = serde_json::from_str(text).map_err(broken)?;
        if schema != SCHEMA {
            return Err(Error::unsupported(
                format!("a certificate of schema {schema:?}, where {SCHEMA:?} is known"),
                "use the Kiln that wrote it, or bake the file again",
            ));
        }
        serde_json::from_str(text).map_err(broken)
    }

    /// The certificates of the layers of an array texture.
    ///
    /// **Errors**: as [`Certificate::from_json`]; no list.
    pub fn list_from_json(text: &str) -> Result<Vec<Self>> {
        let list: Vec<serde_json::Value> = serde_json::from_str(text)
            .map_err(|e| Error::invalid(format!("a broken list of certificates: {e}"), "bake the file again"))?;
        list.iter().map(|one| Self::from_json(&one.to_string())).collect()
    }

    /// The same as one line, to embed.
    pub fn list_to_json(list: &[Self]) -> Result<String> {
        serde_json::to_string(list).map_err(unprintable)
    }

    /// As one line, to embed.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string(self).map_err(unprintable)
    }

    /// As lines, to read.
    pub fn to_pretty_json(&self) -> Result<String> {
        Ok(serde_json::to_string_pretty(self).map_err(unprintable)? + "\n")
    }

    /// How many checks failed.
    pub fn failures(&self) -> usize {
        self.checks.iter().filter(|c| !c.passed).count()
    }
}

impl Default for Certificate {
    fn default() -> Self {
        Self::new()
    }
}

fn unprintable(e: serde_json::Error) -> Error {
    Error::unsupported(format!("a certificate that JSON cannot hold: {e}"), "report this as a bug")
}

/// What the file at `path` holds: see [`decode`].
///
/// **Errors**: a file that cannot be read, that Kiln does not read, or that is not what its certificate says.
pub fn read(path: &Path) -> Result<Decoded> {
    let bytes = std::fs::read(path).map_err(|e| Error::reading(path, e))?;
    decode(path, &bytes).map_err(|e| e.in_file(path))
}

/// What `bytes`, the file at `path`, hold: [`crate::format::decode`], and of bare texels what the certificate beside them says that they
/// are. A certificate that stands beside the file is among the metadata, as if it were in it: some containers have no place for one.
///
/// **Errors**: bytes that Kiln does not read, or that are not what their certificate says, without their path.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Decoded> {
    if let Some(texture) = bare_texture(path, bytes)? {
        return Ok(Decoded::Texture(texture));
    }
    let mut decoded = format::decode(bytes)?;
    let is_certified = [KEY, LAYERS_KEY].iter().any(|key| decoded.metadata(key).is_some());
    // What is broken beside a file does not keep anybody from reading the file.
    if !is_certified && let Ok(Some(certificate)) = find_beside(path) {
        decoded.metadata_mut().push((KEY.to_owned(), certificate.to_json()?));
    } else if !is_certified
        && let Decoded::Texture(texture) = &mut decoded
        && let Some(layers) = layers_beside(path, texture.array_layers)
    {
        texture.metadata.push((LAYERS_KEY.to_owned(), Certificate::list_to_json(&layers)?));
    }
    Ok(decoded)
}

/// The certificates of an array's layers that stand beside the file at `path`, as `STEM.LAYER.certificate.json`; nothing where not every layer
/// has one of its own.
fn layers_beside(path: &Path, layers: usize) -> Option<Vec<Certificate>> {
    let stem = path.file_stem()?.to_str()?;
    let name_of = |file: &Path| Some(file.file_name()?.to_str()?.to_owned());
    let of_layer = |entry: std::io::Result<std::fs::DirEntry>| {
        let file = entry.ok()?.path();
        let name = name_of(&file)?;
        if !name.strip_prefix(stem)?.starts_with('.') || !name.ends_with(".certificate.json") {
            return None;
        }
        let certificate = Certificate::from_json(&std::fs::read_to_string(file).ok()?).ok()?;
        let names_it = certificate.files.iter().any(|file| Some(&file.file) == name_of(path).as_ref());
        (names_it && certificate.layer.is_some()).then_some(certificate)
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut found: Vec<Certificate> = std::fs::read_dir(folder).ok()?.filter_map(of_layer).collect();
    found.sort_by_key(|certificate| certificate.layer);
    let is_each_there = found.iter().map(|certificate| certificate.layer).eq((0..layers).map(Some));
    (layers > 0 && is_each_there).then_some(found)
}

/// The certificate beside the file at `path`: `NAME.certificate.json`, or the folder's `certificate.json` if it names the file.
///
/// **Errors**: a broken certificate.
pub fn find_beside(path: &Path) -> Result<Option<Certificate>> {
    let own = beside(path);
    for candidate in [&own, &path.with_file_name("certificate.json")] {
        if let Ok(text) = std::fs::read_to_string(candidate) {
            let certificate = Certificate::from_json(&text).map_err(|e| e.in_file(candidate))?;
            let names_it = || certificate.files.iter().any(|f| path.file_name().is_some_and(|n| n == f.file.as_str()));
            if *candidate == own || names_it() {
                return Ok(Some(certificate));
            }
        }
    }
    Ok(None)
}

/// The texture in `bytes`, the file at `path`, if they say nothing of themselves and a layout stands beside them, or a certificate of a
/// table of bare texels; the latter is among the texture's metadata.
///
/// **Errors**: a broken layout or certificate; bytes that are not what it says, without their path.
pub fn bare_texture(path: &Path, bytes: &[u8]) -> Result<Option<Texture>> {
    if !matches!(FileKind::of(bytes), FileKind::Other(_)) {
        return Ok(None);
    }
    let certified = certified_texture(path, bytes);
    let layout = raw::layout_beside(path);
    // A certificate of another file that was here before says nothing of this one.
    if matches!(certified, Ok(Some(_))) || !layout.is_file() {
        return certified;
    }
    let text = std::fs::read_to_string(&layout).map_err(|e| Error::reading(&layout, e))?;
    let said: raw::Layout = serde_json::from_str(&text).map_err(|e| {
        Error::invalid(format!("no layout of bare texels: {e}"), "convert the file again").in_file(&layout)
    })?;
    said.decode(bytes).map(Some)
}

fn certified_texture(path: &Path, bytes: &[u8]) -> Result<Option<Texture>> {
    let beside = beside(path);
    if !beside.is_file() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(&beside).map_err(|e| Error::reading(&beside, e))?;
    let certificate = Certificate::from_json(&text).map_err(|e| e.in_file(&beside))?;
    let Some(table) = certificate.table.filter(|table| table.format.container() == Container::Raw) else {
        return Ok(None);
    };
    let mut texture = table.bare_texture(bytes)?;
    texture.metadata.push((KEY.to_owned(), text));
    Ok(Some(texture))
}

/// Where the certificate of a file stands: `dfg.ktx2` → `dfg.ktx2.certificate.json`.
pub fn beside(file: &Path) -> PathBuf {
    let mut name = file.file_name().unwrap_or_default().to_owned();
    name.push(".certificate.json");
    file.with_file_name(name)
}

/// BLAKE3 of `bytes`, in hexadecimal.
pub fn digest<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> String {
    let mut digest = Digest::default();
    parts.into_iter().for_each(|part| digest.add(part));
    digest.finish()
}

/// A [`digest`] under way.
#[derive(Default)]
pub(crate) struct Digest(blake3::Hasher);

impl Digest {
    pub(crate) fn add(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    pub(crate) fn finish(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}
