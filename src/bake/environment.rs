//! Baking an environment: specular chain, irradiance, spherical harmonics.

use super::{Baked, refuse_failures, texel_digest};
use crate::certificate::{self, Certificate, FileDigest, Input, Level, ShFits};
use crate::check::{Check, CubeLevel, EnvironmentValues, Precision, Spread, WITNESS_POINTS};
use crate::environment::atlas;
use crate::environment::chain::{ChainSpec, LevelReport, MapLevel, maps_and_irradiance_beside, mirrors};
use crate::environment::sh_bands::Bands;
use crate::environment::spherical_harmonics::{self, Coefficients, IrradianceFit, SphericalHarmonics};
use crate::environment::{
    Adjusted, CubeLookup, FullSum, InputReport, KernelKind, Panorama, ShConvention, SphereLayout, SphereMap, Sun, Unit,
    load,
};
use crate::error::{Error, Result};
use crate::format::{self, Container, FormatSpec, Texture, env, ktx1};
use crate::integrate::{ErrorKind, Integrator};
use crate::pack::{PackReport, TexelFormat};
use crate::recipe::EnvironmentRecipe;
use crate::recipe::map_texel;
use crate::table::Progress;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Samples per texel where neither samples nor a tolerance are asked for.
pub const DEFAULT_SAMPLES: u64 = 4096;
/// Samples per texel beyond which a tolerance counts as out of reach.
const MOST_SAMPLES: u64 = 1 << 18;
/// Name of the file of coefficients.
pub(crate) const SH_FILE: &str = "sh.json";
/// What the irradiance cube is called in certificates and in its file.
pub(crate) const IRRADIANCE: &str = "irradiance";
/// What the specular chain is called in its file.
const SPECULAR: &str = "specular";
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
    /// Those that are negative nowhere, as an engine's shader reads them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub engine: Option<EngineSh>,
    /// More bands, where more than three were asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bands: Option<Bands>,
}

/// Nine coefficients in an engine's convention, for the vectors that its shader looks up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EngineSh {
    /// Whose.
    pub convention: ShConvention,
    /// What each is the factor of.
    pub order: Vec<String>,
    /// What they hold.
    pub holds: String,
    /// RGB each.
    pub coefficients: Coefficients,
}

impl EngineSh {
    /// What a recipe asks for; nothing where Kiln's own coefficients are all that is wanted.
    pub fn new(recipe: &EnvironmentRecipe, harmonics: &SphericalHarmonics) -> Option<Self> {
        let convention = recipe.sh;
        (convention != ShConvention::Kiln).then(|| Self {
            convention,
            order: convention.order().map(str::to_owned).to_vec(),
            holds: convention.holds().to_owned(),
            coefficients: convention.coefficients(&harmonics.irradiance_over_pi_nonnegative, &recipe.orientation),
        })
    }
}

/// The irradiance as a file's own metadata, of containers that have a place for it: Filament's nine lines, Babylon.js' polynomial.
fn irradiance_of(
    container: Container,
    recipe: &EnvironmentRecipe,
    of: &SphericalHarmonics,
) -> Option<(String, String)> {
    let coefficients =
        |convention: ShConvention| convention.coefficients(&of.irradiance_over_pi_nonnegative, &recipe.orientation);
    match container {
        Container::Ktx1 => {
            let line = |rgb: &[f64; 3]| format!("{} {} {}\n", rgb[0] as f32, rgb[1] as f32, rgb[2] as f32);
            Some((ktx1::SH_KEY.to_owned(), coefficients(ShConvention::Filament).iter().map(line).collect()))
        }
        Container::Env => {
            Some((env::POLYNOMIAL_KEY.to_owned(), env::polynomial_json(&coefficients(ShConvention::Babylon))))
        }
        _ => None,
    }
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
    let mirrors: u64 = smaller_mirrors(recipe).map(|tile| recipe.layout.texels(tile.size) as u64).sum();
    chain_spec(recipe, 0).total_texels() + recipe.layout.texels(recipe.irradiance_size) as u64 + mirrors
}

/// The mirrors that an atlas has beside its chain.
fn smaller_mirrors(recipe: &EnvironmentRecipe) -> impl Iterator<Item = atlas::Tile> {
    let tiles = if recipe.layout == SphereLayout::Atlas { atlas::tiles() } else { vec![] };
    tiles.into_iter().filter(|tile| matches!(tile.content, atlas::Content::Mirror(_)))
}

fn chain_spec(recipe: &EnvironmentRecipe, samples: u64) -> ChainSpec {
    ChainSpec {
        size: recipe.size,
        roughness: recipe.level_roughness(),
        kernel: recipe.kernel,
        view: recipe.view,
        samples: samples as usize,
        seed: recipe.integration.seed,
        integrator: match recipe.integration.integrator {
            // Only the random witness takes samples, and views at an angle.
            Integrator::Auto if recipe.integration.samples.is_some() || recipe.view.is_some() => Integrator::MonteCarlo,
            Integrator::Auto => Integrator::Zonal,
            chosen => chosen,
        },
        fit: recipe.fit,
        probe: true,
        layout: recipe.layout,
        orientation: recipe.orientation,
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
    let truth = FullSum::new(panorama);
    let (filtered, (harmonics, input)) = rayon::join(
        || filter(recipe, panorama, &truth, progress),
        || (spherical_harmonics::project(panorama), input(source)),
    );
    let (specular, irradiance) = filtered?;
    let judge = |function: &dyn Fn(DVec3) -> [f64; 3]| {
        spherical_harmonics::judge_map(function, &irradiance.0, &recipe.orientation)
    };
    let judge_nine = |nine: &Coefficients| judge(&|direction| spherical_harmonics::evaluate(nine, direction));
    let fit = judge_nine(&harmonics.irradiance_over_pi);
    let fit_nonnegative = judge_nine(&harmonics.irradiance_over_pi_nonnegative);
    let engine = EngineSh::new(recipe, &harmonics);
    let mut cubes = vec![Packed::new(SPECULAR, recipe.specular_name(), recipe.format, recipe.size)];
    let of_level = |(m, level)| Piece::new(recipe.format, format!("specular {m}"), level, recipe);
    let pieces = specular.par_iter().enumerate().map(of_level).collect::<Result<Vec<_>>>()?;
    pieces.into_iter().for_each(|piece| cubes[0].push(piece));
    if recipe.layout == SphereLayout::Atlas {
        let sizes = smaller_mirrors(recipe).map(|tile| tile.size);
        let smaller = mirrors(panorama, &chain_spec(recipe, 0), sizes, progress)?;
        for (tile, mirror) in smaller_mirrors(recipe).zip(&smaller) {
            cubes[0].push(Piece::new(recipe.format, tile.name(), mirror, recipe)?);
        }
        cubes[0].push(Piece::new(recipe.format, IRRADIANCE.to_owned(), &irradiance, recipe)?);
    }
    if let Some(name) = recipe.irradiance_name() {
        let format = recipe.format_of_irradiance();
        let mut cube = Packed::new(IRRADIANCE, name, format, recipe.irradiance_size);
        cube.push(Piece::new(format, IRRADIANCE.to_owned(), &irradiance, recipe)?);
        cubes.push(cube);
    }
    let mut checks = vec![];
    // The same function would make the same average again.
    let average = specular.first().filter(|(_, report)| report.roughness == 0.0).map(|(map, _)| map);
    let sampled = specular.iter().chain([&irradiance]).any(|(_, report)| report.samples > 0);
    let spread = if sampled { Spread::Over(WITNESS_POINTS) } else { Spread::Measured(WITNESS_POINTS / 8) };
    for cube in &cubes {
        let judged = cube.values(recipe)?;
        checks.extend(judged.facts(panorama.min().into_iter().any(|v| v < 0.0)));
        checks.extend(judged.against_truth(&truth, average, panorama, recipe.integration.seed, spread));
    }
    checks.extend(level_zero_flux(&specular[0].1));
    let bands = (recipe.sh_bands > 3).then(|| Bands::new(panorama, recipe.sh_bands, judge));
    let fit_of_bands = bands.as_ref().map(|bands| bands.fit);
    let sh = ShFile { schema: SH_SCHEMA.to_owned(), harmonics, fit, fit_nonnegative, engine, bands };
    let sh_bytes = json(&sh)?;
    let sun = adjusted.sun.map(|sun| json(&SunFile::new(sun, recipe.adjust.unit))).transpose()?;
    let json_files = [(SH_FILE, sh_bytes)].into_iter().chain(sun.map(|bytes| (SUN_FILE, bytes)));
    let json_files: Vec<(String, Vec<u8>)> = json_files.map(|(name, bytes)| (name.to_owned(), bytes)).collect();
    let digests = (cubes.iter().map(|cube| (&cube.name, cube.digest())))
        .chain(json_files.iter().map(|(name, bytes)| (name, certificate::digest([bytes.as_slice()]))));
    let certificate = Certificate {
        environment: Some(recipe.clone()),
        input: Some(input),
        files: digests.map(|(file, digest)| FileDigest { file: file.clone(), digest }).collect(),
        levels: cubes.iter().flat_map(Packed::certified).collect(),
        sh: Some(ShFits { projected: fit, nonnegative: fit_nonnegative, bands: fit_of_bands }),
        checks,
        packing: cubes.iter().fold(PackReport::default(), |report, cube| report.merge(cube.packing)),
        ..Certificate::new()
    };
    refuse_failures(&certificate)?;
    let json = certificate.to_json()?;
    let mut files = vec![];
    for cube in cubes {
        let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let mut metadata = vec![pair(certificate::KEY, &json), pair(certificate::CONTENT_KEY, cube.content)];
        if cube.content == SPECULAR {
            metadata.extend(irradiance_of(cube.format.container(), recipe, &sh.harmonics));
        }
        files.push((cube.name.clone(), cube.encode(metadata, recipe.layout, panorama)?));
    }
    let folder = Path::new(&recipe.directory);
    Ok(Baked {
        files: files.into_iter().chain(json_files).map(|(name, bytes)| (folder.join(name), bytes)).collect(),
        certificate_path: folder.join("certificate.json"),
        certificate,
    })
}

/// A cube, or a map of another layout, on its way into its file.
struct Packed {
    /// What it is called in certificates and in its file.
    content: &'static str,
    name: String,
    format: FormatSpec,
    size: usize,
    /// What a reader will see, turned as the file is.
    levels: Vec<CubeLevel>,
    reports: Vec<LevelReport>,
    /// What a shader will see between texels.
    lookups: Vec<Option<CubeLookup>>,
    bytes: Vec<Vec<u8>>,
    packing: PackReport,
}

impl Packed {
    fn new(content: &'static str, name: String, format: FormatSpec, size: usize) -> Self {
        let packing = PackReport::default();
        let (levels, reports, lookups, bytes) = (vec![], vec![], vec![], vec![]);
        Self { content, name, format, size, levels, reports, lookups, bytes, packing }
    }

    /// Takes the next level.
    fn push(&mut self, piece: Piece) {
        let Piece { level, report, lookup, bytes, packing } = piece;
        self.packing = self.packing.merge(packing);
        self.levels.push(level);
        self.reports.push(report);
        self.lookups.push(lookup);
        self.bytes.push(bytes);
    }

    /// What the certificate says of the levels.
    fn certified(&self) -> impl Iterator<Item = Level> {
        let each = self.levels.iter().zip(&self.reports).zip(&self.lookups);
        each.map(|((values, report), lookup)| Level { lookup: lookup.clone(), ..level(&values.name, report) })
    }

    fn values(&self, recipe: &EnvironmentRecipe) -> Result<EnvironmentValues<'_>> {
        let format = map_texel(self.format, recipe.layout)?;
        let precision = precision(format, &self.levels, self.packing.max_block_error);
        let (layout, orientation) = (recipe.layout, recipe.orientation);
        Ok(EnvironmentValues { levels: &self.levels, layout, precision, orientation })
    }

    fn digest(&self) -> String {
        texel_digest(self.levels.iter().map(|level| level.texels.as_flattened()))
    }

    fn encode(self, metadata: Vec<(String, String)>, layout: SphereLayout, panorama: &Panorama) -> Result<Vec<u8>> {
        let primaries = panorama.primaries();
        let format = map_texel(self.format, layout)?;
        if layout == SphereLayout::Atlas {
            let empty = Texture::empty(format, atlas::EDGE, atlas::EDGE);
            let picture = atlas::assemble(&self.bytes, format.block_bytes());
            return format::encode(self.format, &Texture { levels: vec![picture], metadata, primaries, ..empty });
        }
        let ([width, height], faces) = layout.shape(self.size);
        let empty = Texture { faces, ..Texture::empty(format, width, height) };
        format::encode(self.format, &Texture { levels: self.bytes, metadata, primaries, ..empty })
    }
}

/// A level, packed.
struct Piece {
    level: CubeLevel,
    report: LevelReport,
    lookup: Option<CubeLookup>,
    bytes: Vec<u8>,
    packing: PackReport,
}

impl Piece {
    fn new(format: FormatSpec, name: String, (map, found): &MapLevel, recipe: &EnvironmentRecipe) -> Result<Self> {
        let format = map_texel(format, map.layout)?;
        let n = format.channels();
        let ([width, height], _) = map.layout.shape(map.size);
        // Picture by picture, on all threads.
        let mut texels = vec![[0.0; 3]; map.texels.len()];
        let (pictures, packed): (Vec<Vec<u8>>, Vec<PackReport>) = map
            .texels
            .par_chunks(width * height)
            .zip(texels.par_chunks_mut(width * height))
            .map(|(picture, texels)| {
                let (bytes, packed) = match n {
                    3 => format.pack(width, height, picture.as_flattened()),
                    _ => {
                        let opaque: Vec<[f32; 4]> = picture.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
                        format.pack(width, height, opaque.as_flattened())
                    }
                };
                let seen = format.unpack(width, height, &bytes);
                texels.iter_mut().zip(seen.chunks_exact(n)).for_each(|(texel, t)| *texel = [t[0], t[1], t[2]]);
                (bytes, packed)
            })
            .unzip();
        let bytes = pictures.concat();
        let packing = packed.into_iter().fold(PackReport::default(), PackReport::merge);
        let stored = SphereMap { texels, ..*map };
        let lookup = found.probe.as_ref().map(|probe| probe.judge_turned(&stored, recipe.orientation));
        let level = CubeLevel {
            kernel: if name == IRRADIANCE { KernelKind::Nol } else { recipe.kernel },
            view: recipe.view.filter(|_| name != IRRADIANCE),
            name,
            size: map.size,
            roughness: found.roughness,
            texels: stored.texels,
            fitted: lookup.clone().filter(|_| is_fitted(found)),
            max_error: found.max_error,
            rms_error: found.rms_error,
        };
        Ok(Self { level, report: found.clone(), lookup, bytes, packing })
    }
}

/// The specular chain and the irradiance cube, with as many samples as the settings ask for.
fn filter(
    recipe: &EnvironmentRecipe,
    panorama: &Panorama,
    truth: &FullSum,
    progress: Progress,
) -> Result<(Vec<MapLevel>, MapLevel)> {
    let settings = recipe.integration;
    let mut samples = settings.samples.unwrap_or(DEFAULT_SAMPLES);
    loop {
        let spec = chain_spec(recipe, samples);
        let (specular, irradiance) =
            maps_and_irradiance_beside(truth, panorama, &spec, recipe.irradiance_size, progress)?;
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

fn is_fitted(level: &LevelReport) -> bool {
    level.fit.as_ref().is_some_and(|fit| fit.kept)
}

/// What packing may have changed of the levels.
pub(crate) fn precision(format: TexelFormat, levels: &[CubeLevel], block_error: f64) -> Precision {
    let values = levels.iter().flat_map(|level| level.texels.as_flattened()).map(|&v| f64::from(v));
    Precision::new(format, values, block_error)
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
