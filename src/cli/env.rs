//! `kiln env`: one environment.

use super::adjustment::AdjustArgs;
use super::arguments::{EngineArgs, FitName, IntegrationArgs, ShaderArgs, no_own_numbers};
use super::console::Console;
use super::packing::{Packed, warn_of_packing};
use clap::{Args, ValueEnum};
use kiln::bake::Source;
use kiln::certificate::{Certificate, Level};
use kiln::colour::TargetColour;
use kiln::engine;
use kiln::environment::spherical_harmonics::IrradianceFit;
use kiln::environment::{
    Fit, InputLayout, InputReport, InstructionSet, KernelKind, Layout, Negatives, NonFinite, Orientation, ShConvention,
    SphereLayout, View, atlas,
};
use kiln::format::FormatSpec;
use kiln::language::Language;
use kiln::recipe::{EnvironmentRecipe, IrradianceKind};
use kiln::{Error, Result};
use std::path::{Path, PathBuf};

/// Prefilter one environment: specular chain, irradiance and spherical harmonics
#[derive(Debug, Args)]
#[command(
    after_help = "Writes specular.ktx2, irradiance.ktx2 (E/π), sh.json and certificate.json; the extension is that of --format. Orientation: +Y up; a direction d \
                        samples the panorama at u = 1/2 + atan2(d.z, d.x)/2π, v = acos(d.y)/π; faces +X −X +Y −Y +Z −Z."
)]
pub struct Env {
    /// Panorama (.hdr, .exr), cube (.ktx2, .ktx, .dds, .env; a cross or a strip; sky_px.hdr, sky_%s.hdr or a folder for six files), or
    /// builtin:NAME, see `kiln list environments`. Of several, each gets a folder of its name, those that are baked already are
    /// skipped, and one that fails does not stop the others
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<String>,
    /// Folder to write to; created if it is missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Bake also what has not changed since it was baked
    #[arg(long)]
    force: bool,
    /// A quick look: stands for --size 64 --irradiance-size 16
    #[arg(long, conflicts_with_all = ["size", "irradiance_size"])]
    draft: bool,
    #[command(flatten)]
    engine: EngineArgs,
    /// How the sphere lies in the specular and the irradiance file [default: cube]
    #[arg(long, value_enum)]
    layout: Option<LayoutName>,
    /// Texels along an edge of the specular cube's level 0, or of the octahedral square; rows of a panorama, which is twice as wide
    /// [default: 256]
    #[arg(long, value_name = "N")]
    size: Option<usize>,
    /// The same of its last level [default: 16]
    #[arg(long, value_name = "N")]
    min_size: Option<usize>,
    /// Roughness of each level, each half the size of the one before [default: m/(levels − 1), down to --min-size]
    #[arg(long, value_name = "R", value_delimiter = ',', conflicts_with = "min_size")]
    roughness: Vec<f64>,
    /// What the specular levels weigh directions by [default: nol]
    #[arg(long, value_enum)]
    kernel: Option<KernelName>,
    /// Filter for a surface seen at this angle to its normal instead of N = V = R, by Monte Carlo [with --kernel g1]
    #[arg(long, value_name = "DEGREES")]
    view_angle: Option<f64>,
    /// Filter for a surface brushed along the plane of view, by Monte Carlo: αx = α/√(1 − 0.9 a), αy = α √(1 − 0.9 a) [with --kernel g1]
    #[arg(long, value_name = "A")]
    anisotropy: Option<f64>,
    /// Bands of spherical harmonics in sh.json, up to 10: more than 3 stand beside the nine coefficients
    #[arg(long, value_name = "N", default_value_t = 3)]
    sh_bands: usize,
    /// How diffuse light is written [default: cube]
    #[arg(long, value_enum)]
    irradiance: Option<IrradianceName>,
    /// The same of the irradiance cube [default: 32]
    #[arg(long, value_name = "N")]
    irradiance_size: Option<usize>,
    /// Container and texel format of the cubes, such as ktx2:rgb9e5+zstd, dds:bc6h, ktx1:b10g11r11, env: see `kiln list formats`
    /// [default: ktx2:rgba16f]
    #[arg(long)]
    format: Option<FormatSpec>,
    /// The same of the irradiance cube [default: that of --format]
    #[arg(long, value_name = "FORMAT")]
    irradiance_format: Option<FormatSpec>,
    /// Which way the cubes are turned: the world's x, y, z in terms of the vector that the shader looks up, such as x,y,-z where it
    /// negates Z [default: x,y,z]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    orientation: Option<Orientation>,
    /// Whose nine coefficients sh.json has beside Kiln's own [default: kiln]
    #[arg(long, value_enum)]
    sh: Option<ShName>,
    /// What the input is read as
    #[arg(long, value_enum, default_value = "auto", value_name = "LAYOUT")]
    input_layout: InputLayoutName,
    /// Primaries to convert to, from those that the input states (else Rec. 709)
    #[arg(long, value_enum, default_value = "rec709", value_name = "PRIMARIES")]
    to: TargetName,
    /// What becomes of NaN and infinities
    #[arg(long, value_enum, default_value = "error")]
    nonfinite: NonFiniteName,
    /// What becomes of values below zero
    #[arg(long, value_enum, default_value = "keep")]
    negatives: NegativesName,
    /// What texels are chosen for
    #[arg(long, value_enum, default_value = "none")]
    fit: FitName,
    #[command(flatten)]
    integration: IntegrationArgs,
    #[command(flatten)]
    adjust: AdjustArgs,
    #[command(flatten)]
    shader: ShaderArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum InputLayoutName {
    /// A cube if it is a cube texture, six files named as faces, 4:3, 3:4, 6:1 or 1:6; an atlas if it says that it is packed as one; else a
    /// panorama
    Auto,
    /// A panorama, whatever its proportions
    Panorama,
    /// A horizontal (4:3) or vertical (3:4) cross
    Cross,
    /// A horizontal (6:1) or vertical (1:6) strip of +X −X +Y −Y +Z −Z
    Strip,
    /// A cube texture or six files
    Cube,
    /// One square, as --layout octahedral writes it; of mips the largest, as of a panorama's
    Octahedral,
    /// PlayCanvas' atlas, as --layout atlas writes it, of which the largest mirror is read: the world as that engine shows it. Codes that do
    /// not say what they are, are RGBP
    Atlas,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum LayoutName {
    /// Six faces
    Cube,
    /// One square: p = (d.x, d.y)/(|d.x| + |d.y| + |d.z|), folded outwards where d.z < 0; texture coordinates ½ + ½ p
    Octahedral,
    /// A panorama: u = ½ + atan2(d.z, d.x)/2π, v = acos(d.y)/π
    Equirect,
    /// PlayCanvas' atlas: such panoramas of all levels and of irradiance in one picture of 512²
    Atlas,
}

impl From<LayoutName> for SphereLayout {
    fn from(name: LayoutName) -> Self {
        match name {
            LayoutName::Cube => Self::Cube,
            LayoutName::Octahedral => Self::Octahedral,
            LayoutName::Equirect => Self::Equirect,
            LayoutName::Atlas => Self::Atlas,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum IrradianceName {
    /// A cube of E/π
    Cube,
    /// Nine coefficients alone
    Sh,
    /// The last specular level, of roughness 1, serves for it
    LastLevel,
    /// Not at all
    None,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ShName {
    /// None but Kiln's
    Kiln,
    /// Filament's, all factors multiplied in
    Filament,
    /// Babylon.js' spherical polynomial
    Babylon,
    /// three.js' SphericalHarmonics3
    Threejs,
    /// PlayCanvas' ambientSH
    Playcanvas,
    /// Unity's SphericalHarmonicsL2
    Unity,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum KernelName {
    /// GGX times N·L: what most real-time engines' filters converge to
    Nol,
    /// GGX times Smith's masking: the BRDF at N = V, as MaterialX filters
    G1,
    /// Charlie times N·L: sheen
    Charlie,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum TargetName {
    /// Rec. 709 (sRGB)
    Rec709,
    /// ACEScg
    Acescg,
    /// Those of the input
    Keep,
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
        if let [input] = &self.inputs[..] {
            let recipe = self.recipe(input, console)?;
            let certificate = bake_environment(&recipe, &self.out, &self.shader.languages(), console)?;
            return if console.json { console.print_json(&certificate) } else { Ok(()) };
        }
        let names = names(&self.inputs)?;
        let (mut certificates, mut failed) = (vec![], 0_usize);
        for (input, name) in self.inputs.iter().zip(names) {
            let mut recipe = self.recipe(input, console)?;
            recipe.directory = name;
            recipe.check()?;
            let target = self.out.join(&recipe.directory);
            match self.baked_before(&recipe, &target) {
                Some(certificate) => {
                    console.note(&format!("{}: unchanged", target.display()));
                    certificates.push(certificate);
                }
                None => match bake_environment(&recipe, &self.out, &self.shader.languages(), console) {
                    Ok(certificate) => certificates.push(certificate),
                    Err(error) => {
                        console.error(&error);
                        failed += 1;
                    }
                },
            }
        }
        if console.json {
            console.print_json(&certificates)?;
        }
        if failed > 0 {
            return Err(Error::unsupported(
                format!("{failed} of {} environments failed", self.inputs.len()),
                "see above; the others are baked",
            ));
        }
        Ok(())
    }

    /// The preset's recipe or the usual one, where flags beat what was there.
    pub(super) fn recipe(&self, input: &str, console: &Console) -> Result<EnvironmentRecipe> {
        let (engine, as_shipped) = (self.engine.engine(console)?, self.engine.as_shipped);
        let mut recipe = match engine {
            None => EnvironmentRecipe::new(input),
            Some(engine) => engine.environment_recipe(input, as_shipped)?.ok_or_else(|| {
                Error::usage(
                    format!("{} reads no filtered environment", engine.name),
                    "leave --engine out, or see `kiln list engines`",
                )
            })?,
        };
        recipe.layout = self.layout.map_or(recipe.layout, SphereLayout::from);
        let draft = |size: usize| self.draft.then_some(size);
        if let Some(size) = draft(DRAFT_SIZE).or(self.size) {
            recipe.size = size;
            let preset = engine.and_then(|engine| engine.environment.as_ref());
            recipe.roughness = preset.map(|preset| preset.level_roughness(size, as_shipped));
        }
        if let Some(size) = draft(DRAFT_SIZE / 4).or(self.irradiance_size) {
            recipe.irradiance_size = size;
        }
        if let Some(size) = self.min_size {
            (recipe.min_size, recipe.roughness) = (size, None);
        }
        if !self.roughness.is_empty() {
            recipe.roughness = Some(self.roughness.clone());
        }
        if let Some(format) = self.format {
            (recipe.format, recipe.irradiance_format) = (format, None);
            (recipe.specular_file, recipe.irradiance_file) = (None, None);
        }
        recipe.irradiance_format = self.irradiance_format.or(recipe.irradiance_format);
        recipe.orientation = self.orientation.unwrap_or(recipe.orientation);
        recipe.irradiance = match self.irradiance {
            None => recipe.irradiance,
            Some(IrradianceName::Cube) => IrradianceKind::Cube,
            Some(IrradianceName::Sh) => IrradianceKind::Sh,
            Some(IrradianceName::LastLevel) => IrradianceKind::LastLevel,
            Some(IrradianceName::None) => IrradianceKind::None,
        };
        recipe.sh = match self.sh {
            None => recipe.sh,
            Some(ShName::Kiln) => ShConvention::Kiln,
            Some(ShName::Filament) => ShConvention::Filament,
            Some(ShName::Babylon) => ShConvention::Babylon,
            Some(ShName::Threejs) => ShConvention::Threejs,
            Some(ShName::Playcanvas) => ShConvention::Playcanvas,
            Some(ShName::Unity) => ShConvention::Unity,
        };
        recipe.kernel = match self.kernel {
            None => recipe.kernel,
            Some(KernelName::Nol) => KernelKind::Nol,
            Some(KernelName::G1) => KernelKind::G1,
            Some(KernelName::Charlie) => KernelKind::Charlie,
        };
        if self.view_angle.is_some() || self.anisotropy.is_some() {
            let [angle, anisotropy] = [self.view_angle, self.anisotropy].map(|v| v.unwrap_or(0.0));
            recipe.view = Some(View { angle, anisotropy });
        }
        recipe.sh_bands = self.sh_bands;
        recipe.input_layout = match self.input_layout {
            InputLayoutName::Auto => InputLayout::Auto,
            InputLayoutName::Panorama => InputLayout::Panorama,
            InputLayoutName::Cross => InputLayout::Cross,
            InputLayoutName::Strip => InputLayout::Strip,
            InputLayoutName::Cube => InputLayout::Cube,
            InputLayoutName::Octahedral => InputLayout::Octahedral,
            InputLayoutName::Atlas => InputLayout::Atlas,
        };
        recipe.to = match self.to {
            TargetName::Rec709 => TargetColour::Rec709,
            TargetName::Acescg => TargetColour::AcesCg,
            TargetName::Keep => TargetColour::Keep,
        };
        recipe.nonfinite = match self.nonfinite {
            NonFiniteName::Error => NonFinite::Error,
            NonFiniteName::Zero => NonFinite::Zero,
        };
        recipe.negatives = match self.negatives {
            NegativesName::Keep => Negatives::Keep,
            NegativesName::Clamp => Negatives::Clamp,
        };
        recipe.fit = self.fit.into();
        recipe.integration = self.integration.over(recipe.integration);
        recipe.adjust = self.adjust.adjustment();
        if let Some(engine) = engine {
            if as_shipped && engine.environment.as_ref().is_some_and(|preset| preset.as_shipped.is_none()) {
                console.warn(&no_own_numbers(&format!("{}'s environment", engine.name)));
            }
            for departure in engine.environment_departures(&recipe, as_shipped)? {
                console.warn(&departure);
            }
        }
        Ok(recipe)
    }

    /// The certificate of what is in `target`, if it is what the recipe would write there again.
    fn baked_before(&self, recipe: &EnvironmentRecipe, target: &Path) -> Option<Certificate> {
        if self.force {
            return None;
        }
        let text = std::fs::read_to_string(target.join("certificate.json")).ok()?;
        let certificate = Certificate::from_json(&text).ok()?;
        let whole = certificate.files.iter().all(|file| target.join(&file.file).is_file());
        (whole && kiln::bake::is_current(recipe, &certificate)).then_some(certificate)
    }
}

/// Texels along an edge of level 0 in a draft.
const DRAFT_SIZE: usize = 64;

/// The folder of each of several inputs: its name without extension.
///
/// **Errors**: two that would share one.
fn names(inputs: &[String]) -> Result<Vec<String>> {
    let mut names: Vec<String> = vec![];
    for input in inputs {
        let name = engine::name_of(input)?;
        if let Some(other) = names.iter().position(|n| *n == name) {
            return Err(Error::usage(
                format!("{} and {input} would both be written to {name}/", inputs[other]),
                "bake one of them alone, with an --out of its own",
            ));
        }
        names.push(name);
    }
    Ok(names)
}

/// Bakes an environment below `folder`, with code in `languages`, and says what became of it.
pub fn bake_environment(
    recipe: &EnvironmentRecipe,
    folder: &Path,
    languages: &[Language],
    console: &Console,
) -> Result<Certificate> {
    recipe.check()?;
    // Before minutes of work, not after: whether the folder can be written to.
    let target = folder.join(&recipe.directory);
    std::fs::create_dir_all(&target).map_err(|e| Error::writing(&target, e))?;
    let source = kiln::bake::source(recipe)?;
    let Source { report, adjusted, .. } = &source;
    warn_of_input(recipe, report, console);
    if recipe.adjust.extract_sun && adjusted.sun.is_none() {
        console.warn(&format!("{}: no sun stands out, and none was taken out", recipe.input));
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
    let mut baked = baked?;
    baked.add_shader(languages)?;
    baked.write(folder)?;
    let levels: Vec<String> = baked
        .certificate
        .levels
        .iter()
        .map(|l| match l.integrator.as_str() {
            "area-average" => format!("{} {} exact", l.name, recipe.layout.size_text(l.size)),
            "monte-carlo" => format!("{} {} ±{:.1} %", l.name, recipe.layout.size_text(l.size), 100.0 * l.rms_error),
            _ => format!("{} {} within {:.0e}", l.name, recipe.layout.size_text(l.size), l.max_error),
        })
        .collect();
    if recipe.fit == Fit::Lookup {
        console.note(&fit_note(&baked.certificate.levels));
    }
    let is_zonal = baked.certificate.levels.iter().any(|l| l.integrator == "zonal");
    let with = if is_zonal { format!(" with {}", InstructionSet::detect().name()) } else { String::new() };
    if let Some(fits) = &baked.certificate.sh {
        let percent = |fit: &IrradianceFit| format!("{:.1} %", 100.0 * fit.rms_error);
        let lowest = if fits.projected.min < 0.0 { ", below zero somewhere" } else { "" };
        console.note(&format!(
            "irradiance in nine coefficients: off by {} RMS{lowest}; {} by those that are negative nowhere",
            percent(&fits.projected),
            percent(&fits.nonnegative)
        ));
        if let Some(fit) = &fits.bands {
            let lowest = if fit.min < 0.0 { ", below zero somewhere" } else { "" };
            let count = recipe.sh_bands * recipe.sh_bands;
            console.note(&format!("in {count} coefficients: off by {} RMS{lowest}", percent(fit)));
        }
    }
    console.note(&format!(
        "{}{with}: {}; {} checks passed",
        target.display(),
        levels.join(", "),
        baked.certificate.checks.len()
    ));
    let maps = [Some((recipe.format, recipe.size)), irradiance_of(recipe)];
    for (format, size) in maps.into_iter().flatten() {
        if let Some(warning) = format.size_warning(recipe.layout.shape(size).0) {
            console.warn(&format!("{}: {warning}", target.display()));
        }
    }
    let brightest = source.panorama.max().into_iter().fold(0.0, |most: f32, v| most.max(v)).into();
    let packed = Packed::Maps { layout: recipe.layout, adjust: &recipe.adjust, brightest };
    warn_of_packing(console, &target.display().to_string(), recipe.format, packed, &baked.certificate.packing)?;
    Ok(baked.certificate)
}

/// The format and size of the irradiance map, where there is one.
fn irradiance_of(recipe: &EnvironmentRecipe) -> Option<(FormatSpec, usize)> {
    (recipe.irradiance == IrradianceKind::Cube).then(|| (recipe.format_of_irradiance(), recipe.irradiance_size))
}

/// What fitting did to the levels.
fn fit_note(levels: &[Level]) -> String {
    let each = levels.iter().map(|level| match &level.fit {
        Some(fit) if fit.kept => {
            format!("{} {:.2} % RMS instead of {:.2} %", level.name, 100.0 * fit.fitted.rms, 100.0 * fit.exact.rms)
        }
        Some(fit) => {
            format!("{} exact, which is no worse than fitted ({:.2} % RMS)", level.name, 100.0 * fit.exact.rms)
        }
        None => format!("{} not fitted", level.name),
    });
    format!("through bilinear filtering: {}", each.collect::<Vec<_>>().join(", "))
}

/// Says what in an input is not as one would think, and what was changed.
fn warn_of_input(recipe: &EnvironmentRecipe, report: &InputReport, console: &Console) {
    let warn = |text: String| console.warn(&format!("{}: {text}", recipe.input));
    let [width, height] = report.size;
    if report.layout == Layout::Octahedral {
        console.note(&format!("{}: read as an octahedral map of {width}²", recipe.input));
    } else if report.layout == Layout::Atlas {
        let inside = [width, height].map(|n| n - 2 * atlas::BORDER);
        console.note(&format!(
            "{}: read as an atlas of PlayCanvas, its mirror of {} × {}",
            recipe.input, inside[0], inside[1]
        ));
    } else if report.layout != Layout::Panorama {
        console.note(&format!("{}: read as a {}, faces of {width}²", recipe.input, report.layout));
    } else if width != 2 * height {
        warn(format!("{width} × {height} is not 2:1; its texels are spread over the whole sphere all the same"));
    }
    if let Some(stated) = report.stated.filter(|stated| *stated != report.primaries) {
        console.note(&format!("{}: converted from {stated} to {}", recipe.input, report.primaries));
    }
    if report.nonfinite > 0 {
        warn(format!("{} values were not finite and are zero now", report.nonfinite));
    }
    let fate = if recipe.negatives == Negatives::Keep { "kept; --negatives clamp removes them" } else { "zero now" };
    if report.negative > 0 {
        warn(format!("{} values were below zero (down to {}) and are {fate}", report.negative, report.min));
    }
    if report.out_of_gamut > 0 {
        warn(format!("{} values are below zero in {}, and {fate}", report.out_of_gamut, report.primaries));
    }
    let (change, channel) = report.worst_flux_change();
    // Below this it is the rounding of values to f32 in a conversion.
    if change.abs() > 1e-7 {
        let [before, after] = [report.flux_found[channel], report.flux[channel]];
        let name = ["red", "green", "blue"][channel];
        warn(format!(
            "that changed the flux by up to {:+.2e} of it ({name}: {before:.6} before, {after:.6} after)",
            change
        ));
    }
}
