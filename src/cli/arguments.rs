//! Arguments that several verbs share.

use super::console::Console;
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches, ValueEnum};
use kiln::Result;
use kiln::engine::{self, Engine};
use kiln::environment::Fit;
use kiln::integrate::{Integrator, Settings};
use kiln::language::Language;
use kiln::model::charlie::Visibility;
use kiln::model::ggx::Smith;
use kiln::model::layered::Kd;
use kiln::table::{Model, Parameter, Point};

/// `--integrator`, in words.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum IntegratorName {
    /// Whichever reaches the tolerance sooner
    Auto,
    /// Deterministic; errors are bounds
    Quadrature,
    /// Random; errors are standard errors
    MonteCarlo,
    /// Spherical harmonics, for environments: their default; errors are measured against the full sum
    Zonal,
}

/// `--smith`, in words.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum SmithName {
    /// Height-correlated masking and shadowing
    Correlated,
    /// Masking times shadowing
    Separable,
    /// Schlick's masking times shadowing, k = alpha/2
    SchlickIbl,
    /// Schlick's masking times shadowing, k = (roughness + 1)²/8
    SchlickDirect,
    /// Height-correlated; light that goes through takes B(1 + Λo, 1 + Λt)
    Beta,
    /// The rational approximation of the correlated one
    ApproxCorrelated,
}

impl From<SmithName> for Smith {
    fn from(name: SmithName) -> Self {
        match name {
            SmithName::Correlated => Self::Correlated,
            SmithName::Separable => Self::Separable,
            SmithName::SchlickIbl => Self::SchlickIbl,
            SmithName::SchlickDirect => Self::SchlickDirect,
            SmithName::Beta => Self::Beta,
            SmithName::ApproxCorrelated => Self::ApproxCorrelated,
        }
    }
}

/// `--visibility`, in words.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum VisibilityName {
    /// 1/(4 (μo + μi − μo μi))
    Neubelt,
    /// Smith with Estevez and Kulla's fitted Λ
    Charlie,
    /// The same with a softer terminator
    CharlieSoftened,
}

impl From<VisibilityName> for Visibility {
    fn from(name: VisibilityName) -> Self {
        match name {
            VisibilityName::Neubelt => Self::Neubelt,
            VisibilityName::Charlie => Self::Charlie,
            VisibilityName::CharlieSoftened => Self::CharlieSoftened,
        }
    }
}

/// `--kd`, in words.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum KdName {
    /// 1 − F(wo·h)
    Fresnel,
    /// 1 − R(μo), R the specular albedo
    Albedo,
    /// (1 − R(μo))(1 − R(μi))/(1 − R_avg)
    Reciprocal,
}

impl From<KdName> for Kd {
    fn from(name: KdName) -> Self {
        match name {
            KdName::Fresnel => Self::Fresnel,
            KdName::Albedo => Self::Albedo,
            KdName::Reciprocal => Self::Reciprocal,
        }
    }
}

/// The choices within a model.
#[derive(Debug, Clone, Args)]
pub struct ModelArgs {
    /// Masking and shadowing [default: correlated]
    #[arg(long, value_enum)]
    pub smith: Option<SmithName>,
    /// Visibility term of the sheen [default: neubelt]
    #[arg(long, value_enum)]
    pub visibility: Option<VisibilityName>,
    /// What a specular layer leaves to the diffuse base (layered.albedo) [default: albedo]
    #[arg(long, value_enum)]
    pub kd: Option<KdName>,
}

impl ModelArgs {
    /// The model, where flags beat what was there.
    pub fn over(&self, model: Model) -> Model {
        Model {
            smith: self.smith.map_or(model.smith, Into::into),
            visibility: self.visibility.map_or(model.visibility, Into::into),
            kd: self.kd.map_or(model.kd, Into::into),
        }
    }

    /// The model.
    pub fn model(&self) -> Model {
        self.over(Model::default())
    }
}

/// Whose shader is to read what is baked.
#[derive(Debug, Clone, Default, Args)]
pub struct EngineArgs {
    /// Bake what this engine reads, see `kiln list engines`; other flags win over it
    #[arg(long, value_name = "NAME")]
    engine: Option<String>,
    /// The engine's own numbers, where they are known to be wrong
    #[arg(long, requires = "engine")]
    pub as_shipped: bool,
}

impl EngineArgs {
    /// The engine; one of which nothing could be read is warned of.
    ///
    /// **Errors**: an unknown one.
    pub fn engine(&self, console: &Console) -> Result<Option<&'static Engine>> {
        let engine = self.engine.as_deref().map(engine::find).transpose()?;
        engine.into_iter().for_each(|engine| warn_if_experimental(engine, console));
        Ok(engine)
    }
}

/// Says of an engine of which nothing could be read that it is so.
pub fn warn_if_experimental(engine: &Engine, console: &Console) {
    if engine.is_experimental() {
        console.warn(&format!("{} is experimental: {}", engine.name, engine.from_memory.join("; ")));
    }
}

/// What `--as-shipped` comes to where it changes nothing.
pub fn no_own_numbers(whose: &str) -> String {
    format!(
        "--as-shipped: no numbers of its own are known of {whose} but those that it is meant to hold, which are baked"
    )
}

/// `--fit`, in words.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum FitName {
    /// Each texel is the value at its centre
    None,
    /// Texels whose bilinear lookup is closest to the truth, in least squares: about half the error, at no cost at run time
    Lookup,
}

impl From<FitName> for Fit {
    fn from(name: FitName) -> Self {
        match name {
            FitName::None => Self::None,
            FitName::Lookup => Self::Lookup,
        }
    }
}

/// How to integrate.
#[derive(Debug, Clone, Default, Args)]
pub struct IntegrationArgs {
    /// Which witness computes [default: auto]
    #[arg(long, value_enum)]
    pub integrator: Option<IntegratorName>,
    /// Largest acceptable error [default: 1e-7 by quadrature; one standard error of 1e-4 by Monte Carlo]
    #[arg(long, value_name = "ERROR")]
    pub tolerance: Option<f64>,
    /// Points per value, by Monte Carlo, instead of a tolerance
    #[arg(long, value_name = "N", conflicts_with = "tolerance")]
    pub samples: Option<u64>,
    /// Seed of the random points [default: 0]
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
}

impl IntegrationArgs {
    /// The settings, where flags beat what was there.
    pub fn over(&self, settings: Settings) -> Settings {
        let integrator = match self.integrator {
            None => settings.integrator,
            Some(IntegratorName::Auto) => Integrator::Auto,
            Some(IntegratorName::Quadrature) => Integrator::Quadrature,
            Some(IntegratorName::MonteCarlo) => Integrator::MonteCarlo,
            Some(IntegratorName::Zonal) => Integrator::Zonal,
        };
        // Samples and a tolerance exclude each other: the flag that is given drops the other one of the recipe.
        let (tolerance, samples) = match (self.tolerance, self.samples) {
            (None, None) => (settings.tolerance, settings.samples),
            flags => flags,
        };
        Settings { integrator, tolerance, samples, seed: self.seed.unwrap_or(settings.seed) }
    }
}

/// Which code to write beside what is baked.
#[derive(Debug, Clone, Default, Args)]
pub struct ShaderArgs {
    /// Write shader code that looks up what is baked, too: glsl, hlsl, wgsl or several
    #[arg(long = "shader", value_name = "LANGUAGE", value_delimiter = ',')]
    languages: Vec<Language>,
}

impl ShaderArgs {
    /// The languages, each once.
    pub fn languages(&self) -> Vec<Language> {
        Language::ALL.into_iter().filter(|language| self.languages.contains(language)).collect()
    }
}

/// One flag per physical parameter, made from the list of parameters.
#[derive(Debug, Clone, Default)]
pub struct ParameterArgs {
    /// The parameters that were given, in the order of the list.
    pub given: Vec<(Parameter, f64)>,
}

impl ParameterArgs {
    /// The point, where flags beat what was there.
    ///
    /// **Errors**: a value outside its parameter's domain.
    pub fn over(&self, own: impl Iterator<Item = (Parameter, f64)>) -> Result<Point> {
        let own = own.filter(|(p, _)| !self.given.iter().any(|(q, _)| q.canonical() == p.canonical()));
        let all: Vec<(Parameter, f64)> = own.chain(self.given.iter().copied()).collect();
        all.into_iter().try_fold(Point::default(), |point, (parameter, value)| point.with(parameter, value))
    }
}

impl Args for ParameterArgs {
    fn augment_args(command: Command) -> Command {
        command.args(Parameter::ALL.map(|parameter| {
            let name = parameter.name();
            let flag = match parameter {
                Parameter::AlphaX => "alpha-x",
                Parameter::AlphaY => "alpha-y",
                Parameter::CosCentre => "cos-centre",
                Parameter::Sin2Radius => "sin2-radius",
                _ => name,
            };
            let twins =
                Parameter::ALL.into_iter().filter(|p| *p != parameter && p.canonical() == parameter.canonical());
            Arg::new(name)
                .long(flag)
                .alias(name)
                .value_name("NUMBER")
                .value_parser(clap::value_parser!(f64))
                .allow_negative_numbers(true)
                .conflicts_with_all(twins.map(Parameter::name).collect::<Vec<_>>())
                .help(format!("{}, in {}", capitalised(parameter.summary()), parameter.domain_text()))
        }))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for ParameterArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let value = |p: Parameter| matches.get_one::<f64>(p.name()).map(|&value| (p, value));
        Ok(Self { given: Parameter::ALL.into_iter().filter_map(value).collect() })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The text with its first letter in upper case.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Quantities with commas between them; the comma of `min(y,1)` is within brackets and parts nothing.
#[derive(Debug, Clone, Default)]
pub struct Channels(pub Vec<String>);

impl std::str::FromStr for Channels {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        let mut open = 0_usize;
        let parts = text.split(|letter| {
            match letter {
                '(' => open += 1,
                ')' => open = open.saturating_sub(1),
                _ => {}
            }
            letter == ',' && open == 0
        });
        Ok(Self(parts.map(str::to_owned).collect()))
    }
}
