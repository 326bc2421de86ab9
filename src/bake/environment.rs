//! Baking an environment: specular chain, irradiance, spherical harmonics.

use super::{Baked, refuse_failures, texel_digest};
use crate::certificate::{self, Certificate, FileDigest, Input, Level};
use crate::check::{Check, CubeLevel, EnvironmentValues};
use crate::environment::chain::{ChainSpec, LevelReport, specular_chain};
use crate::environment::irradiance::irradiance_cube;
use crate::environment::spherical_harmonics::{self, IrradianceFit, SphericalHarmonics};
use crate::environment::{Cube, InputReport, Panorama};
use crate::error::{Error, Result};
use crate::format::{FormatSpec, ktx2};
use crate::integrate::{ErrorKind, Integrator};
use crate::pack::{Number, PackReport, binary16, binary32};
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
            Integrator::Quadrature => Integrator::Quadrature,
            Integrator::Auto | Integrator::MonteCarlo => Integrator::MonteCarlo,
        },
    }
}

/// Filters, checks and packs one environment.
///
/// **Errors**: a recipe that cannot be baked; a tolerance that is not reached; a failed check.
pub fn environment(
    recipe: &EnvironmentRecipe,
    panorama: &Panorama,
    report: InputReport,
    progress: Progress,
) -> Result<Baked> {
    recipe.check()?;
    let FormatSpec::Ktx2(format) = recipe.format else { unreachable!("EnvironmentRecipe::check allows KTX2 only") };
    let (specular, irradiance) = filter(recipe, panorama, progress)?;
    let (bytes_of_levels, packing, values) = pack(&specular, &irradiance, format.number);
    let judged = EnvironmentValues { levels: &values, ulp: ulp(format.number), largest: largest(format.number) };
    let harmonics = spherical_harmonics::project(panorama);
    let fit = spherical_harmonics::judge(&harmonics, &irradiance.0);
    let mut checks = judged.facts(panorama.min().into_iter().any(|v| v < 0.0));
    checks.extend(judged.against(panorama, recipe.integration.seed, false));
    checks.extend(level_zero_flux(&specular[0].1));
    let sh = ShFile { schema: SH_SCHEMA.to_owned(), harmonics, fit };
    let sh_bytes = sh_json(&sh)?;
    let digests = digests(&values, &sh_bytes);
    let certificate = Certificate {
        environment: Some(recipe.clone()),
        input: Some(input(panorama, report)),
        files: FILES.iter().zip(digests).map(|(f, digest)| FileDigest { file: (*f).to_owned(), digest }).collect(),
        levels: values.iter().zip(specular.iter().chain([&irradiance])).map(|(v, (_, r))| level(&v.name, r)).collect(),
        checks,
        packing,
        ..Certificate::new()
    };
    refuse_failures(&certificate)?;
    let json = certificate.to_json()?;
    let cube = |content: &str, size, levels| {
        let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let metadata = vec![pair(certificate::KEY, &json), pair(certificate::CONTENT_KEY, content)];
        let texture = ktx2::Texture {
            format,
            width: size,
            height: size,
            depth: 0,
            faces: 6,
            levels,
            metadata,
            primaries: panorama.primaries(),
        };
        ktx2::encode(&texture)
    };
    let mut levels = bytes_of_levels;
    let last = levels.split_off(specular.len());
    let contents = [cube("specular", recipe.size, levels)?, cube(IRRADIANCE, recipe.irradiance_size, last)?, sh_bytes];
    let folder = Path::new(&recipe.directory);
    Ok(Baked {
        files: FILES.iter().zip(contents).map(|(name, bytes)| (folder.join(name), bytes)).collect(),
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
        let chain = specular_chain(panorama, &spec, progress)?;
        let irradiance = irradiance_cube(panorama, &ChainSpec { size: recipe.irradiance_size, ..spec }, progress)?;
        let specular: Vec<Filtered> = chain.levels.into_iter().zip(chain.reports).collect();
        let worst = specular.iter().chain([&irradiance]).map(|(_, r)| r.rms_error).fold(0.0, f64::max);
        match settings.tolerance {
            Some(tolerance) if worst > tolerance => {
                if samples >= MOST_SAMPLES || settings.integrator == Integrator::Quadrature {
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

/// The packed levels, the irradiance cube last; what packing changed; what a reader will see.
fn pack(specular: &[Filtered], irradiance: &Filtered, number: Number) -> (Vec<Vec<u8>>, PackReport, Vec<CubeLevel>) {
    let (mut all, mut report, mut values) = (vec![], PackReport::default(), vec![]);
    let named = specular.iter().enumerate().map(|(m, level)| (format!("specular {m}"), level));
    for (name, (cube, found)) in named.chain([(IRRADIANCE.to_owned(), irradiance)]) {
        let rgba: Vec<f32> = cube.texels.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0]).collect();
        let (bytes, packed) = number.pack(&rgba);
        let texels = number.unpack(&bytes).chunks_exact(4).map(|t| [t[0], t[1], t[2]]).collect();
        report = report.merge(packed);
        values.push(CubeLevel {
            name,
            size: cube.size,
            roughness: found.roughness,
            texels,
            max_error: found.max_error,
            rms_error: found.rms_error,
        });
        all.push(bytes);
    }
    (all, report, values)
}

pub(crate) fn ulp(number: Number) -> fn(f64) -> f64 {
    match number {
        Number::F16 => binary16::ulp,
        Number::F32 => binary32::ulp,
    }
}

/// The largest number that a format holds.
pub(crate) fn largest(number: Number) -> f64 {
    match number {
        Number::F16 => binary16::MAX,
        Number::F32 => f64::from(f32::MAX),
    }
}

/// Digests of the files, in the order of [`FILES`].
pub(crate) fn digests(values: &[CubeLevel], sh: &[u8]) -> [String; 3] {
    let of = |levels: &[CubeLevel]| texel_digest(levels.iter().map(|l| l.texels.as_flattened()));
    let (irradiance, specular) = values.split_last().map_or((&values[..0], values), |(_, s)| (&values[s.len()..], s));
    [of(specular), of(irradiance), certificate::digest([sh])]
}

/// `sh.json`, as written.
pub(crate) fn sh_json(sh: &ShFile) -> Result<Vec<u8>> {
    serde_json::to_string_pretty(sh)
        .map(|text| (text + "\n").into_bytes())
        .map_err(|e| Error::unsupported(format!("coefficients that JSON cannot hold: {e}"), "report this as a bug"))
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
        error_kind: if report.samples == 0 { ErrorKind::Bound } else { ErrorKind::Sigma },
        mean: report.mean,
        mean_drift: report.mean_deviation,
    }
}

fn input(panorama: &Panorama, report: InputReport) -> Input {
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
    }
}
