//! Baking an environment: specular chain, irradiance, spherical harmonics.

use super::{Baked, refuse_failures, texel_digest};
use crate::certificate::{self, Certificate, FileDigest, Input, Level, ShFits};
use crate::check::{Check, CubeLevel, EnvironmentValues, Precision};
use crate::environment::chain::{ChainSpec, LevelReport, chain_and_irradiance};
use crate::environment::spherical_harmonics::{self, IrradianceFit, SphericalHarmonics};
use crate::environment::{Adjusted, Cube, CubeLookup, InputReport, Panorama, Sun, Unit, load};
use crate::error::{Error, Result};
use crate::format::{self, Texture};
use crate::integrate::{ErrorKind, Integrator};
use crate::pack::{PackReport, TexelFormat};
use crate::recipe::EnvironmentRecipe;
use crate::table::Progress;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Samples per texel where neither samples nor a tolerance are asked for.
pub const DEFAULT_SAMPLES: u64 = 4096;
/// Samples per texel beyond which a tolerance counts as out of reach.
const MOST_SAMPLES: u64 = 1 << 18;
/// Names of the files, in the order of their digests.
pub(crate) const FILES: [&str; 3] = ["specular.ktx2", "irradiance.ktx2", "sh.json"];
/// What the irradiance cube is called in certificates and in its file.
pub(crate) const IRRADIANCE: &str = "irradiance";
/// The schema of `sh.json`.
pub const SH_SCHEMA: &str = "kiln-sh/1";

/// What `sh.json` holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShFile {
    /// [`SH_SCHEMA`].
    pub schema: String,
    /// Basis, order and coefficients.
    #[serde(flatten)]
    pub harmonics: SphericalHarmonics,
    /// How well nine coefficients render the irradiance cube.
    pub fit: IrradianceFit,
    /// The same of those that are negative nowhere.
    pub fit_nonnegative: IrradianceFit,
}

/// The file of a sun that was taken out.
pub(crate) const SUN_FILE: &str = "sun.json";
/// The schema of `sun.json`.
pub const SUN_SCHEMA: &str = "kiln-sun/1";

/// What `sun.json` holds: a directional light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SunFile {
    /// [`SUN_SCHEMA`].
    pub schema: String,
    /// The light.
    #[serde(flatten)]
    pub sun: Sun,
    /// Illuminance of a surface that faces it, in lux.
    pub illuminance: f64,
}

impl SunFile {
    /// The file for a sun of a map with that unit.
    pub fn new(sun: Sun, unit: Unit) -> Self {
        Self { schema: SUN_SCHEMA.to_owned(), sun, illuminance: unit.nits() * sun.luminance }
    }
}

/// Texels that [`environment`] reports to its progress callback, unless it must draw more samples for a tolerance.
pub fn environment_texels(recipe: &EnvironmentRecipe) -> u64 {
    chain_spec(recipe, 0).total_texels() + 6 * (recipe.irradiance_size as u64).pow(2)
}

fn chain_spec(recipe: &EnvironmentRecipe, samples: u64) -> ChainSpec {
    ChainSpec {
        size: recipe.size,
        roughness: recipe.level_roughness(),
        samples: samples as usize,
        seed: recipe.integration.seed,
        integrator: match recipe.integration.integrator {
            // Only the random witness takes samples.
            Integrator::Auto if recipe.integration.samples.is_some() => Integrator::MonteCarlo,
            Integrator::Auto => Integrator::Zonal,
            chosen => chosen,
        },
        fit: recipe.fit,
        probe: true,
    }
}

/// A panorama as a recipe wants it filtered.
#[derive(Debug, Clone)]
pub struct Source {
    /// Adjusted.
    pub panorama: Panorama,
    /// What was wrong with the values that were read.
    pub report: InputReport,
    /// What the adjustments came to.
    pub adjusted: Adjusted,
}

/// Reads and adjusts what a recipe filters.
///
/// **Errors**: those of [`environment::load`] and [`Adjustment::apply`].
///
/// [`environment::load`]: crate::environment::load
/// [`Adjustment::apply`]: crate::environment::Adjustment::apply
pub fn source(recipe: &EnvironmentRecipe) -> Result<Source> {
    let (panorama, report) = load(&recipe.input, &recipe.reading())?;
    let (panorama, adjusted) = recipe.adjust.apply(panorama).map_err(|e| e.in_file(Path::new(&recipe.input)))?;
    Ok(Source { panorama, report, adjusted })
}

/// Whether a certificate is for what the recipe would bake now: the same recipe, the same input, the same algorithms.
pub fn is_current(recipe: &EnvironmentRecipe, certificate: &Certificate) -> bool {
    let now = Certificate::new();
    let same_input = || {
        let Ok(source) = source(recipe) else { return false };
        let digest = texel_digest([source.panorama.texels().as_flattened()]);
        certificate.input.as_ref().is_some_and(|input| input.digest == digest)
    };
    (certificate.kiln == now.kiln && certificate.algorithms == now.algorithms)
        && certificate.environment.as_ref() == Some(recipe)
        && same_input()
}

/// Filters, checks and packs one environment.
///
/// **Errors**: a recipe that cannot be baked; a tolerance that is not reached; a failed check.
pub fn environment(recipe: &EnvironmentRecipe, source: &Source, progress: Progress) -> Result<Baked> {
    recipe.check()?;
    let Source { panorama, adjusted, .. } = source;
    let format = recipe.cube_format()?;
    let (specular, irradiance) = filter(recipe, panorama, progress)?;
    let (bytes_of_levels, packing, values, lookups) = pack(&specular, &irradiance, format);
    let judged = EnvironmentValues { levels: &values, precision: precision(format, &values, packing.max_block_error) };
    let harmonics = spherical_harmonics::project(panorama);
    let fit = spherical_harmonics::judge(&harmonics.irradiance_over_pi, &irradiance.0);
    let fit_nonnegative = spherical_harmonics::judge(&harmonics.irradiance_over_pi_nonnegative, &irradiance.0);
    let mut checks = judged.facts(panorama.min().into_iter().any(|v| v < 0.0));
    checks.extend(judged.against(panorama, recipe.integration.seed, false));
    checks.extend(level_zero_flux(&specular[0].1));
    let sh = ShFile { schema: SH_SCHEMA.to_owned(), harmonics, fit, fit_nonnegative };
    let sh_bytes = json(&sh)?;
    let sun = adjusted.sun.map(|sun| json(&SunFile::new(sun, recipe.adjust.unit))).transpose()?;
    let names = FILES.iter().copied().chain(sun.as_ref().map(|_| SUN_FILE));
    let digests = digests(&values, &sh_bytes).into_iter().chain(sun.as_ref().map(|s| certificate::digest([&s[..]])));
    let certificate = Certificate {
        environment: Some(recipe.clone()),
        input: Some(input(source)),
        files: names.clone().zip(digests).map(|(f, digest)| FileDigest { file: f.to_owned(), digest }).collect(),
        levels: (values.iter().zip(lookups).zip(specular.iter().chain([&irradiance])))
            .map(|((v, lookup), (_, r))| Level { lookup, ..level(&v.name, r) })
            .collect(),
        sh: Some(ShFits { projected: fit, nonnegative: fit_nonnegative }),
        checks,
        packing,
        ..Certificate::new()
    };
    refuse_failures(&certificate)?;
    let json = certificate.to_json()?;
    let cube = |content: &str, size, levels| {
        let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let metadata = vec![pair(certificate::KEY, &json), pair(certificate::CONTENT_KEY, content)];
        let primaries = panorama.primaries();
        let texture = Texture { levels, metadata, primaries, ..Texture::empty_cube(format, size) };
        format::encode(recipe.format, &texture)
    };
    let mut levels = bytes_of_levels;
    let last = levels.split_off(specular.len());
    let contents = [cube("specular", recipe.size, levels)?, cube(IRRADIANCE, recipe.irradiance_size, last)?, sh_bytes];
    let folder = Path::new(&recipe.directory);
    Ok(Baked {
        files: names.zip(contents.into_iter().chain(sun)).map(|(name, bytes)| (folder.join(name), bytes)).collect(),
        certificate_path: folder.join("certificate.json"),
        certificate,
    })
}

type Filtered = (Cube, LevelReport);

/// The specular chain and the irradiance cube, with as many samples as the settings ask for.
fn filter(recipe: &EnvironmentRecipe, panorama: &Panorama, progress: Progress) -> Result<(Vec<Filtered>, Filtered)> {
    let settings = recipe.integration;
    let mut samples = settings.samples.unwrap_or(DEFAULT_SAMPLES);
    loop {
        let spec = chain_spec(recipe, samples);
        let (chain, irradiance) = chain_and_irradiance(panorama, &spec, recipe.irradiance_size, progress)?;
        let specular: Vec<Filtered> = chain.levels.into_iter().zip(chain.reports).collect();
        let worst = specular.iter().chain([&irradiance]).map(|(_, r)| r.rms_error).fold(0.0, f64::max);
        match settings.tolerance {
            Some(tolerance) if worst > tolerance => {
                if samples >= MOST_SAMPLES || spec.integrator != Integrator::MonteCarlo {
                    return Err(Error::unsupported(
                        format!("tolerance {tolerance:e} is not reached: the worst level is off by {worst:.1e} RMS"),
                        format!("use --tolerance {:.0e}, or --integrator quadrature for a small cube", 2.0 * worst),
                    ));
                }
                samples *= 2;
            }
            _ => return Ok((specular, irradiance)),
        }
    }
}

/// Packed levels, what packing changed, what a reader will see of texels, and what a shader will see between them.
type Packed = (Vec<Vec<u8>>, PackReport, Vec<CubeLevel>, Vec<Option<CubeLookup>>);

/// Packs the levels, the irradiance cube last.
fn pack(specular: &[Filtered], irradiance: &Filtered, format: TexelFormat) -> Packed {
    let (mut all, mut report, mut values, mut lookups) = (vec![], PackReport::default(), vec![], vec![]);
    let named = specular.iter().enumerate().map(|(m, level)| (format!("specular {m}"), level));
    for (name, (cube, found)) in named.chain([(IRRADIANCE.to_owned(), irradiance)]) {
        let n = format.channels();
        let rgba: Vec<f32> = cube.texels.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0].into_iter().take(n)).collect();
        let (bytes, packed) = format.pack(cube.size, cube.size, &rgba);
        let texels = format.unpack(cube.size, cube.size, &bytes).chunks_exact(n).map(|t| [t[0], t[1], t[2]]).collect();
        let stored = Cube { size: cube.size, texels };
        let lookup = found.probe.as_ref().map(|probe| probe.judge(&stored));
        report = report.merge(packed);
        values.push(CubeLevel {
            name,
            size: cube.size,
            roughness: found.roughness,
            texels: stored.texels,
            fitted: lookup.clone().filter(|_| is_fitted(found)),
            max_error: found.max_error,
            rms_error: found.rms_error,
        });
        lookups.push(lookup);
        all.push(bytes);
    }
    (all, report, values, lookups)
}

fn is_fitted(level: &LevelReport) -> bool {
    level.fit.as_ref().is_some_and(|fit| fit.kept)
}

/// What packing may have changed of the levels.
pub(crate) fn precision(format: TexelFormat, levels: &[CubeLevel], block_error: f64) -> Precision {
    let values = levels.iter().flat_map(|level| level.texels.as_flattened()).map(|&v| f64::from(v));
    Precision::new(format, values, block_error)
}

/// Digests of the files, in the order of [`FILES`].
pub(crate) fn digests(values: &[CubeLevel], sh: &[u8]) -> [String; 3] {
    let of = |levels: &[CubeLevel]| texel_digest(levels.iter().map(|l| l.texels.as_flattened()));
    let (irradiance, specular) = values.split_last().map_or((&values[..0], values), |(_, s)| (&values[s.len()..], s));
    [of(specular), of(irradiance), certificate::digest([sh])]
}

/// A file of JSON, as written.
fn json(content: &impl Serialize) -> Result<Vec<u8>> {
    serde_json::to_string_pretty(content)
        .map(|text| (text + "\n").into_bytes())
        .map_err(|e| Error::unsupported(format!("numbers that JSON cannot hold: {e}"), "report this as a bug"))
}

/// A mirror level's texels, weighted by their exact solid angles, sum to the input's flux.
fn level_zero_flux(first: &LevelReport) -> Option<Check> {
    if first.roughness != 0.0 {
        return None;
    }
    let name = "flux of level 0 against the input's, relative";
    Some(Check::at_most(name, "specular 0", first.mean_deviation, 1e-6, "before packing"))
}

fn level(name: &str, report: &LevelReport) -> Level {
    Level {
        name: name.to_owned(),
        size: report.size,
        roughness: report.roughness,
        integrator: report.method.clone(),
        samples: report.samples as u64,
        max_error: report.max_error,
        rms_error: report.rms_error,
        error_kind: match report.method.as_str() {
            "zonal" => ErrorKind::Measured,
            "monte-carlo" => ErrorKind::Sigma,
            _ => ErrorKind::Bound,
        },
        degree: report.degree,
        truncation_bound: report.truncation_bound,
        mean: report.mean,
        mean_drift: report.mean_deviation,
        lookup: None,
        fit: report.fit.clone(),
    }
}

fn input(Source { panorama, report, adjusted }: &Source) -> Input {
    Input {
        width: panorama.width(),
        height: panorama.height(),
        digest: texel_digest([panorama.texels().as_flattened()]),
        mean: panorama.mean(),
        peak: panorama.peak().2,
        nonfinite: report.nonfinite,
        negative: report.negative,
        layout: report.layout,
        size: report.size,
        stated_primaries: report.stated,
        primaries: report.primaries,
        primaries_name: report.primaries.to_string(),
        out_of_gamut: report.out_of_gamut,
        flux_found: report.flux_found,
        flux: report.flux,
        adjusted: *adjusted,
    }
}
