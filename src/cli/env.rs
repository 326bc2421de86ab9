//! `kiln env`: one environment.

use super::adjustment::AdjustArgs;
use super::arguments::IntegrationArgs;
use super::console::Console;
use super::table::warn_of_packing;
use clap::{Args, ValueEnum};
use kiln::bake::Source;
use kiln::certificate::Certificate;
use kiln::environment::{InstructionSet, Negatives, NonFinite};
use kiln::format::FormatSpec;
use kiln::recipe::EnvironmentRecipe;
use kiln::{Error, Result};
use std::path::{Path, PathBuf};

/// Prefilter one environment: specular chain, irradiance and spherical harmonics
#[derive(Debug, Args)]
#[command(
    after_help = "Writes specular.ktx2, irradiance.ktx2 (E/π), sh.json and certificate.json. Orientation: +Y up; a direction d \
                        samples the panorama at u = 1/2 + atan2(d.z, d.x)/2π, v = acos(d.y)/π; faces +X −X +Y −Y +Z −Z."
)]
pub struct Env {
    /// Equirectangular panorama (.hdr or .exr, 2:1), or builtin:NAME: see `kiln list environments`
    input: String,
    /// Folder to write to; created if it is missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Texels along an edge of the specular cube's level 0
    #[arg(long, value_name = "N", default_value_t = 256)]
    size: usize,
    /// Texels along an edge of its last level
    #[arg(long, value_name = "N", default_value_t = 16)]
    min_size: usize,
    /// Roughness of each level, each half the size of the one before [default: m/(levels − 1), down to --min-size]
    #[arg(long, value_name = "R", value_delimiter = ',', conflicts_with = "min_size")]
    roughness: Vec<f64>,
    /// Texels along an edge of the irradiance cube
    #[arg(long, value_name = "N", default_value_t = 32)]
    irradiance_size: usize,
    /// Container and texel format of the cubes
    #[arg(long, default_value = "ktx2:rgba16f")]
    format: FormatSpec,
    /// What becomes of NaN and infinities
    #[arg(long, value_enum, default_value = "error")]
    nonfinite: NonFiniteName,
    /// What becomes of values below zero
    #[arg(long, value_enum, default_value = "keep")]
    negatives: NegativesName,
    #[command(flatten)]
    integration: IntegrationArgs,
    #[command(flatten)]
    adjust: AdjustArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum NonFiniteName {
    /// Refuse the input
    Error,
    /// Turn them to zero and count them
    Zero,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum NegativesName {
    /// Keep them and count them
    Keep,
    /// Turn them to zero and count them
    Clamp,
}

impl Env {
    pub fn run(&self, console: &Console) -> Result<()> {
        let mut recipe = EnvironmentRecipe::new(&self.input);
        recipe.size = self.size;
        recipe.min_size = self.min_size;
        recipe.roughness = (!self.roughness.is_empty()).then(|| self.roughness.clone());
        recipe.irradiance_size = self.irradiance_size;
        recipe.format = self.format;
        recipe.nonfinite = match self.nonfinite {
            NonFiniteName::Error => NonFinite::Error,
            NonFiniteName::Zero => NonFinite::Zero,
        };
        recipe.negatives = match self.negatives {
            NegativesName::Keep => Negatives::Keep,
            NegativesName::Clamp => Negatives::Clamp,
        };
        recipe.integration = self.integration.over(recipe.integration);
        recipe.adjust = self.adjust.adjustment();
        let certificate = bake_environment(&recipe, &self.out, console)?;
        if console.json { console.print_json(&certificate) } else { Ok(()) }
    }
}

/// Bakes an environment below `folder`, and says what became of it.
pub fn bake_environment(recipe: &EnvironmentRecipe, folder: &Path, console: &Console) -> Result<Certificate> {
    recipe.check()?;
    // Before minutes of work, not after: whether the folder can be written to.
    let target = folder.join(&recipe.directory);
    std::fs::create_dir_all(&target).map_err(|e| Error::writing(&target, e))?;
    let source = kiln::bake::source(recipe)?;
    let Source { report, adjusted, .. } = &source;
    if report.nonfinite > 0 {
        console.warn(&format!("{}: {} values were not finite and are zero now", recipe.input, report.nonfinite));
    }
    if report.negative > 0 {
        let fate =
            if recipe.negatives == Negatives::Keep { "kept; --negatives clamp removes them" } else { "zero now" };
        console.warn(&format!(
            "{}: {} values were below zero (down to {}) and are {fate}",
            recipe.input, report.negative, report.min
        ));
    }
    if adjusted.clamped > 0 {
        let taken = adjusted.energy_clamped.map(|part| format!("{:.2} %", 100.0 * part)).join(", ");
        console.warn(&format!(
            "{}: {} texels were clamped, and {taken} of R, G, B with them",
            recipe.input, adjusted.clamped
        ));
    }
    let bar = console.progress(kiln::bake::environment_texels(recipe), &recipe.input);
    let baked = kiln::bake::environment(recipe, &source, &|n| bar.inc(n));
    bar.finish_and_clear();
    let baked = baked?;
    baked.write(folder)?;
    let levels: Vec<String> = baked
        .certificate
        .levels
        .iter()
        .map(|l| match l.integrator.as_str() {
            "area-average" => format!("{} {}² exact", l.name, l.size),
            "monte-carlo" => format!("{} {}² ±{:.1} %", l.name, l.size, 100.0 * l.rms_error),
            _ => format!("{} {}² within {:.0e}", l.name, l.size, l.max_error),
        })
        .collect();
    let is_zonal = baked.certificate.levels.iter().any(|l| l.integrator == "zonal");
    let with = if is_zonal { format!(" with {}", InstructionSet::detect().name()) } else { String::new() };
    console.note(&format!(
        "{}{with}: {}; {} checks passed",
        target.display(),
        levels.join(", "),
        baked.certificate.checks.len()
    ));
    warn_of_packing(console, &target.display().to_string(), &baked.certificate.packing);
    Ok(baked.certificate)
}
