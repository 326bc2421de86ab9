//! Quantities: functions of physical parameters, with what is known of each.

use super::transform::Transform;
use crate::error::{Error, Result};
use crate::integrate::{ErrorKind, Estimate, Integration, Integrator};
use crate::model::alpha_of_roughness;
use crate::model::charlie::Visibility;
use crate::model::ggx::Smith;
use crate::model::layered::Kd;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A physical parameter of a quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// Cosine of the outgoing direction to the normal.
    Mu,
    /// Width of the microfacet distribution.
    Alpha,
    /// The artist's value: alpha = roughness².
    Roughness,
    /// Reflectance at normal incidence.
    F0,
    /// What remains at 82° of Schlick's reflectance.
    F82,
    /// Relative index of refraction of a dielectric.
    Eta,
    /// Real part of a conductor's index of refraction.
    N,
    /// Imaginary part of a conductor's index of refraction.
    K,
    /// Standard deviation of the slope angle of a rough diffuse surface.
    Sigma,
    /// Albedo of a diffuse surface.
    Rho,
    /// Azimuth of the outgoing direction.
    Phi,
    /// Width of an anisotropic distribution along the tangent.
    AlphaX,
    /// Width of an anisotropic distribution along the bitangent.
    AlphaY,
    /// Cosine of a sphere's centre to the normal.
    CosCentre,
    /// Squared sine of the angular radius of a sphere.
    Sin2Radius,
}

/// What is known of a parameter: one row each.
struct Facts {
    parameter: Parameter,
    name: &'static str,
    summary: &'static str,
    /// Values that make sense, both ends included.
    domain: (f64, f64),
    /// Values outside the domain at which quantities have a limit.
    limits: &'static [f64],
    /// What an axis covers unless it says otherwise.
    range: Option<(f64, f64)>,
}

const UNIT: (f64, f64) = (0.0, 1.0);

const FACTS: [Facts; Parameter::ALL.len()] = [
    Facts {
        parameter: Parameter::Mu,
        name: "mu",
        summary: "cosine of the outgoing direction to the normal",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
    Facts {
        parameter: Parameter::Alpha,
        name: "alpha",
        summary: "width of the microfacet distribution",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
    Facts {
        parameter: Parameter::Roughness,
        name: "roughness",
        summary: "the artist's value; alpha = roughness²",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
    Facts {
        parameter: Parameter::F0,
        name: "f0",
        summary: "reflectance at normal incidence",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
    Facts {
        parameter: Parameter::F82,
        name: "f82",
        summary: "what remains of Schlick's reflectance at 82°; 1 is no tint",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
    Facts {
        parameter: Parameter::Eta,
        name: "eta",
        summary: "relative index of refraction n_t/n_i: below 1 from the denser side",
        domain: (1e-5, 1e5),
        limits: &[0.0, f64::INFINITY],
        range: None,
    },
    Facts {
        parameter: Parameter::N,
        name: "n",
        summary: "real part of a conductor's relative index of refraction",
        domain: (0.01, 20.0),
        limits: &[],
        range: None,
    },
    Facts {
        parameter: Parameter::K,
        name: "k",
        summary: "imaginary part of a conductor's relative index of refraction",
        domain: (0.0, 30.0),
        limits: &[],
        range: None,
    },
    Facts {
        parameter: Parameter::Sigma,
        name: "sigma",
        summary: "standard deviation of the slope angle of a rough diffuse surface, in radians",
        domain: (0.0, std::f64::consts::FRAC_PI_2),
        limits: &[],
        range: Some((0.0, std::f64::consts::FRAC_PI_2)),
    },
    Facts {
        parameter: Parameter::Rho,
        name: "rho",
        summary: "albedo of a diffuse surface",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
    Facts {
        parameter: Parameter::Phi,
        name: "phi",
        summary: "azimuth of the outgoing direction from the tangent, in radians; beyond π/2 a lobe repeats itself",
        domain: (0.0, std::f64::consts::TAU),
        limits: &[],
        range: Some((0.0, std::f64::consts::FRAC_PI_2)),
    },
    Facts {
        parameter: Parameter::AlphaX,
        name: "alpha_x",
        summary: "width of an anisotropic microfacet distribution along the tangent",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
    Facts {
        parameter: Parameter::AlphaY,
        name: "alpha_y",
        summary: "width of an anisotropic microfacet distribution along the bitangent",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
    Facts {
        parameter: Parameter::CosCentre,
        name: "cos_centre",
        summary: "cosine of a sphere's centre to the normal: below 0 where it is under the horizon",
        domain: (-1.0, 1.0),
        limits: &[],
        range: Some((-1.0, 1.0)),
    },
    Facts {
        parameter: Parameter::Sin2Radius,
        name: "sin2_radius",
        summary: "squared sine of the angular radius of a sphere: the length of its vector form factor",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
];

impl Parameter {
    /// Every parameter.
    pub const ALL: [Self; 15] = [
        Self::Mu,
        Self::Alpha,
        Self::Roughness,
        Self::F0,
        Self::F82,
        Self::Eta,
        Self::N,
        Self::K,
        Self::Sigma,
        Self::Rho,
        Self::Phi,
        Self::AlphaX,
        Self::AlphaY,
        Self::CosCentre,
        Self::Sin2Radius,
    ];

    fn facts(self) -> &'static Facts {
        let facts = &FACTS[self as usize];
        debug_assert_eq!(facts.parameter, self, "FACTS is in the order of ALL");
        facts
    }

    /// The name that a user writes.
    pub fn name(self) -> &'static str {
        self.facts().name
    }

    /// Its name in shader code.
    pub fn shader_name(self) -> &'static str {
        if self == Self::Mu { "NoV" } else { self.name() }
    }

    /// The parameter of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.name() == name)
    }

    /// One sentence for `kiln list`.
    pub fn summary(self) -> &'static str {
        self.facts().summary
    }

    /// Values that make sense, both ends included.
    pub fn domain(self) -> (f64, f64) {
        self.facts().domain
    }

    /// Whether quantities have a value, or a limit, there.
    pub fn admits(self, value: f64) -> bool {
        let Facts { domain: (low, high), limits, .. } = self.facts();
        (*low..=*high).contains(&value) || limits.contains(&value)
    }

    /// The domain in words: `[0, 1]`, and the limits outside it.
    pub fn domain_text(self) -> String {
        let Facts { domain: (low, high), limits, .. } = self.facts();
        let limits: Vec<String> = limits.iter().map(f64::to_string).collect();
        if limits.is_empty() {
            format!("[{low}, {high}]")
        } else {
            format!("[{low}, {high}] or {}", limits.join(" or "))
        }
    }

    /// What an axis covers unless it says otherwise; of an index of refraction, nobody knows.
    pub fn range(self) -> Option<(f64, f64)> {
        self.facts().range
    }

    /// The parameter that stands for both where two are names of one: `roughness` and `alpha` determine each other.
    pub fn canonical(self) -> Self {
        if self == Self::Roughness { Self::Alpha } else { self }
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Values of the parameters at which a quantity is wanted; in a file, texts such as `eta=1.5`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct Point {
    values: [Option<f64>; Parameter::ALL.len()],
}

impl Point {
    /// The same point with `parameter` set.
    ///
    /// **Errors**: a value outside the parameter's domain, or a second value for the same parameter.
    pub fn with(mut self, parameter: Parameter, value: f64) -> Result<Self> {
        if !parameter.admits(value) {
            let (low, high) = parameter.domain();
            return Err(Error::usage(
                format!("{parameter} {value} is outside its domain {}", parameter.domain_text()),
                format!("give {parameter} from {low} to {high}"),
            ));
        }
        if Parameter::ALL
            .into_iter()
            .any(|p| p.canonical() == parameter.canonical() && self.values[p as usize].is_some())
        {
            return Err(if parameter == parameter.canonical() && parameter != Parameter::Alpha {
                Error::usage(format!("{parameter} is given twice"), "give it once")
            } else {
                Error::usage("the width is given twice", "give either alpha or roughness, once")
            });
        }
        self.set(parameter, value);
        Ok(self)
    }

    /// Like [`Point::with`], for a value that an axis has already kept in the domain.
    pub(crate) fn set(&mut self, parameter: Parameter, value: f64) {
        self.values[parameter as usize] = Some(value);
    }

    /// Whether no parameter was given.
    pub fn is_empty(&self) -> bool {
        self.given().next().is_none()
    }

    /// The parameters that were given, in the order of [`Parameter::ALL`].
    pub fn given(&self) -> impl Iterator<Item = (Parameter, f64)> + '_ {
        Parameter::ALL.into_iter().filter_map(|p| self.values[p as usize].map(|value| (p, value)))
    }

    /// The value of `parameter`; alpha follows from roughness and roughness from alpha.
    ///
    /// **Errors**: it was not given.
    pub fn get(&self, parameter: Parameter) -> Result<f64> {
        let given = |p: Parameter| self.values[p as usize];
        let derived = match parameter {
            Parameter::Alpha => given(Parameter::Roughness).map(alpha_of_roughness),
            Parameter::Roughness => given(Parameter::Alpha).map(f64::sqrt),
            _ => None,
        };
        given(parameter).or(derived).ok_or_else(|| {
            let hint = match parameter.canonical() {
                Parameter::Alpha => "give alpha or roughness".to_owned(),
                p => format!("give {p}"),
            };
            Error::usage(format!("no value for {parameter}"), hint)
        })
    }
}

/// `eta 1.5, rho 0.8`.
impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let texts: Vec<String> = self.given().map(|(parameter, value)| format!("{parameter} {value}")).collect();
        f.write_str(&texts.join(", "))
    }
}

impl TryFrom<Vec<String>> for Point {
    type Error = Error;

    fn try_from(texts: Vec<String>) -> Result<Self> {
        texts.iter().try_fold(Self::default(), |point, text| {
            let known =
                |(name, value): (&str, &str)| Some((Parameter::from_name(name.trim())?, value.trim().parse().ok()?));
            let (parameter, value) = text.split_once('=').and_then(known).ok_or_else(|| {
                Error::usage(format!("{text:?} gives no parameter a value"), "write PARAMETER=NUMBER, such as eta=1.5")
            })?;
            point.with(parameter, value)
        })
    }
}

impl From<Point> for Vec<String> {
    fn from(point: Point) -> Self {
        point.given().map(|(parameter, value)| format!("{parameter}={value}")).collect()
    }
}

/// The choices within a model that a quantity is computed for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Model {
    /// Masking and shadowing.
    pub smith: Smith,
    /// The visibility term of the sheen.
    pub visibility: Visibility,
    /// What a specular layer leaves to the diffuse base.
    pub kd: Kd,
}

impl Model {
    /// The choices that matter for a quantity, in words: `correlated Smith`, `neubelt visibility`, `albedo kd`.
    pub fn choices_of(&self, quantity: &Quantity) -> Vec<String> {
        let mut words = vec![];
        if quantity.depends_on_smith() {
            words.push(format!("{} Smith", self.smith.name()));
        }
        if quantity.depends_on_visibility() {
            words.push(format!("{} visibility", self.visibility.name()));
        }
        if quantity.depends_on_kd() {
            words.push(format!("{} kd", self.kd.name()));
        }
        words
    }
}

/// A function of physical parameters.
#[derive(Debug)]
pub struct Quantity {
    /// `family.name`, as written by a user.
    pub name: &'static str,
    /// What it is, in one sentence.
    pub summary: &'static str,
    /// The formula, in words that a shader author knows.
    pub definition: &'static str,
    /// Where the definition comes from.
    pub source: &'static str,
    /// The parameters that it depends on.
    pub parameters: &'static [Parameter],
    /// The parameters along which it only rises or only falls, wherever the others are and whichever model is chosen: by its formula,
    /// or scanned over its domain. (GGX's E, for one, is monotone in neither parameter.)
    pub monotone: &'static [(Parameter, Trend)],
    /// Values never leave this interval.
    pub bounds: (f64, f64),
}

/// How a monotone quantity changes as a parameter grows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trend {
    /// It never falls.
    Rises,
    /// It never rises.
    Falls,
}

impl Quantity {
    /// The part of the name after the dot.
    pub fn short_name(&self) -> &'static str {
        self.name.rsplit('.').next().unwrap_or(self.name)
    }

    /// The part of the name before the dot.
    fn family_name(&self) -> &'static str {
        self.name.split('.').next().unwrap_or(self.name)
    }

    /// Whether masking and shadowing are by Smith: of the microfacet lobes of surfaces, and what is made of them.
    pub fn depends_on_smith(&self) -> bool {
        let families = ["ggx", "beckmann", "dielectric", "conductor", "layered", "compensation", "ltc", "ltc-m22"];
        families.contains(&self.family_name())
    }

    /// Whether it has the visibility term of the sheen.
    pub fn depends_on_visibility(&self) -> bool {
        self.family_name() == "charlie"
    }

    /// Whether a diffuse base is below a specular layer.
    pub fn depends_on_kd(&self) -> bool {
        self.family_name() == "layered"
    }

    /// How it changes along `parameter`, or the one that it stands for, where it is monotone.
    pub fn trend(&self, parameter: Parameter) -> Option<Trend> {
        self.monotone.iter().find(|(p, _)| p.canonical() == parameter.canonical()).map(|(_, trend)| *trend)
    }

    /// Whether `parameter`, or the one that it stands for, matters.
    pub fn depends_on(&self, parameter: Parameter) -> bool {
        self.parameters.iter().any(|p| p.canonical() == parameter.canonical())
    }
}

/// Quantities that one integration computes together.
pub trait Family: Sync {
    /// The quantities, in the order in which the witnesses return them.
    fn quantities(&self) -> &'static [Quantity];

    /// The deterministic witness: a bound per quantity, at most `tolerance` where it can be reached.
    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>>;

    /// The random witness: a standard error per quantity, when `integration.stop()` says enough.
    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>>;

    /// Whether there is a deterministic witness; without one, the random one alone computes.
    fn has_quadrature(&self) -> bool {
        true
    }

    /// Whether the quantities are closed forms of their parameters, with nothing to integrate: both witnesses are then the same
    /// value, a bound, and neither proves anything of the other.
    fn is_pointwise(&self) -> bool {
        false
    }

    /// Known exact values at `at`, as (quantity, value, what it is called), for tests and `verify`.
    fn identities(&self, at: &Point, model: &Model) -> Vec<Identity>;

    /// How far the quantities are from what they stand for, where they are a fit to something else: no error of theirs, but a
    /// property of the model.
    fn approximation(&self, _at: &Point, _model: &Model) -> Option<Approximation> {
        None
    }
}

/// How far a fitted lobe is from the one that it stands for, both taken to integrate to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Approximation {
    /// ½ ∫ |g − f|: what any light, whatever its shape, may be rendered off by, in parts of the albedo.
    pub total_variation: f64,
    /// (∫ (g − f)² / ∫ f²)^½.
    pub square: f64,
}

/// A value that a quantity is known to have by a closed form or a limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Identity {
    /// Position in [`Family::quantities`].
    pub quantity: usize,
    /// The exact value.
    pub value: f64,
    /// How far the quantity may be from it by definition (0 for a closed form).
    pub slack: f64,
    /// The name of the fact.
    pub fact: &'static str,
}

/// Every family.
pub static FAMILIES: &[&dyn Family] = &[
    &super::ggx::Split,
    &super::ggx::Average,
    &super::anisotropic::Directional,
    &super::beckmann::Split,
    &super::beckmann::Average,
    &super::charlie::Directional,
    &super::charlie::Average,
    &super::dielectric::Directional,
    &super::dielectric::Average,
    &super::lambert::Lambertian,
    &super::fresnel::SCHLICK,
    &super::fresnel::DIELECTRIC,
    &super::fresnel::CONDUCTOR,
    &super::fresnel::F82,
    &super::fresnel::SCHLICK_AVERAGE,
    &super::fresnel::DIELECTRIC_AVERAGE,
    &super::fresnel::CONDUCTOR_AVERAGE,
    &super::diffuse::BURLEY,
    &super::diffuse::BURLEY_RENORMALIZED,
    &super::diffuse::OREN_NAYAR,
    &super::diffuse::FUJII,
    &super::diffuse::EON,
    &super::conductor::Conductor,
    &super::layered::Layered,
    &super::compensation::Compensation,
    &super::ltc::ByM11,
    &super::ltc::ByM22,
    &super::ltc::ClippedSphere,
    &super::constant::Constant,
];

/// Every quantity with its family and its place in it.
pub fn all() -> impl Iterator<Item = Handle> {
    FAMILIES.iter().flat_map(|family| {
        family.quantities().iter().enumerate().map(|(index, quantity)| Handle {
            family: *family,
            index,
            quantity,
            transform: Transform::default(),
        })
    })
}

/// A quantity and how to compute it.
#[derive(Clone, Copy)]
pub struct Handle {
    /// Whose integration yields it.
    pub family: &'static dyn Family,
    /// Its place in that family.
    pub index: usize,
    /// What is known of it, untransformed.
    pub quantity: &'static Quantity,
    /// What becomes of its value.
    pub transform: Transform,
}

impl fmt::Debug for Handle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Handle({})", self.label())
    }
}

impl PartialEq for Handle {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.quantity, other.quantity) && self.transform == other.transform
    }
}

impl Handle {
    /// The channel as a user writes it: the quantity's name, and what becomes of its value.
    pub fn label(&self) -> String {
        format!("{}{}", self.quantity.name, self.transform)
    }

    /// The interval that its values never leave.
    pub fn bounds(&self) -> (f64, f64) {
        self.transform.interval(self.quantity.bounds)
    }

    /// How its values change along `parameter`, or the one that it stands for, where they are monotone.
    pub fn trend(&self, parameter: Parameter) -> Option<Trend> {
        let trend = self.quantity.trend(parameter)?;
        Some(match (trend, self.transform.falls()) {
            (trend, false) => trend,
            (Trend::Rises, true) => Trend::Falls,
            (Trend::Falls, true) => Trend::Rises,
        })
    }

    /// The value at a point by the witness that `integration` chooses.
    ///
    /// **Errors**: a missing parameter; a tolerance that the witness does not reach.
    pub fn evaluate(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Estimate> {
        let values = evaluate_family_for(self.family, self.transform.stretch(), at, model, integration)?;
        let estimate = self.transform.estimate(values[self.index]);
        self.reached_at(at, estimate, integration)
    }

    /// The estimate, if it is as good as was asked for.
    pub(crate) fn reached_at(&self, at: &Point, estimate: Estimate, integration: &Integration) -> Result<Estimate> {
        let tolerance = integration.tolerance_of(self.is_monte_carlo(integration));
        // A count of samples is an order to stop there, however good the value is by then.
        if estimate.error <= tolerance || integration.settings.samples.is_some() {
            return Ok(estimate);
        }
        Err(Error::unsupported(
            format!(
                "{} at {at} did not reach tolerance {tolerance:e}: the best value is {} with an error of {:e} ({})",
                self.label(),
                estimate.value,
                estimate.error,
                estimate.kind.name()
            ),
            if estimate.error.is_finite() {
                format!("use --tolerance {:.0e}", 2.0 * estimate.error)
            } else {
                "ask the other witness with --integrator, and report this as a bug".to_owned()
            },
        ))
    }

    /// Whether both are computed by the same integration.
    pub fn same_family(&self, other: &Self) -> bool {
        std::ptr::eq(self.family.quantities(), other.family.quantities())
    }

    /// Whether the random witness computes it.
    pub fn is_monte_carlo(&self, integration: &Integration) -> bool {
        is_monte_carlo(self.family, integration)
    }

    /// What the error of an estimate of it is.
    pub fn error_kind(&self, integration: &Integration) -> ErrorKind {
        if self.is_monte_carlo(integration) { ErrorKind::Sigma } else { ErrorKind::Bound }
    }
}

fn is_monte_carlo(family: &dyn Family, integration: &Integration) -> bool {
    integration.is_monte_carlo() || (integration.settings.integrator == Integrator::Auto && !family.has_quadrature())
}

/// Every quantity of a family at a point, by the witness that `integration` chooses.
pub fn evaluate_family(
    family: &dyn Family,
    at: &Point,
    model: &Model,
    integration: &Integration,
) -> Result<Vec<Estimate>> {
    if is_monte_carlo(family, integration) {
        family.monte_carlo(at, model, integration)
    } else {
        family.quadrature(at, model, integration.tolerance_of(false))
    }
}

/// The same for values whose errors will grow `stretch` times before they are held against the tolerance.
pub(super) fn evaluate_family_for(
    family: &dyn Family,
    stretch: f64,
    at: &Point,
    model: &Model,
    integration: &Integration,
) -> Result<Vec<Estimate>> {
    if stretch == 1.0 {
        return evaluate_family(family, at, model, integration);
    }
    let tightened = integration.tightened(is_monte_carlo(family, integration), stretch);
    evaluate_family(family, at, model, &tightened)
}

/// The quantity of that name, of several the first.
///
/// **Errors**: an unknown name; the message lists near matches.
pub fn find(name: &str) -> Result<Handle> {
    find_among(name, |_| false)
}

/// The quantity of that name which depends on no more than the parameters that are `given`, or else the first: a lobe can be
/// isotropic or not, and which one is meant, the parameters say. Steps after the name, such as `burley.albedo:-0.5`, are what becomes
/// of its value: see [`super::transform`].
///
/// **Errors**: as [`find`].
pub fn find_among(text: &str, given: impl Fn(Parameter) -> bool) -> Result<Handle> {
    let (name, steps) = text.split_once(':').map_or((text, None), |(name, steps)| (name.trim(), Some(steps)));
    let transform = steps.map_or(Ok(Transform::default()), str::parse)?;
    let named = || all().filter(|h| h.quantity.name == name);
    let known = |h: &Handle| h.quantity.parameters.iter().all(|p| given(*p));
    let found = named().find(known).or_else(|| named().next());
    found.map(|handle| Handle { transform, ..handle }).ok_or_else(|| {
        let mut names: Vec<_> = all().map(|h| h.quantity.name).collect();
        names.dedup();
        Error::usage(format!("no quantity is called {name:?}"), near_matches(name, &names, "kiln list quantities"))
    })
}

/// Letters that a mistyped name is off by at most, and names that are offered instead.
const NEAR: usize = 3;
const MOST_MATCHES: usize = 5;

/// A way out for a mistyped name: the likeliest ones, and where the whole list is.
pub fn near_matches(name: &str, known: &[&str], list: &str) -> String {
    // `prefix.*` is mistyped where the prefix is.
    let wanted = name.trim_end_matches(['.', '*']);
    // No name has a capital.
    let wanted = &wanted.to_lowercase();
    let last = wanted.rsplit('.').next().unwrap_or(wanted);
    let family = |k: &str| k.split('.').next().map_or(usize::MAX, |family| distance(family, wanted));
    // A word of which every letter is another is not mistyped.
    let most = NEAR.min(wanted.chars().count().saturating_sub(1));
    let mut near: Vec<(usize, &str)> = known
        .iter()
        .map(|k| (distance(k, wanted).min(if name.ends_with('*') { family(k) } else { usize::MAX }), *k))
        .filter(|(off, k)| *off <= most || (!last.is_empty() && k.contains(last)))
        .collect();
    // Two lobes may have a quantity of the same name.
    near.sort_unstable();
    near.dedup();
    let near: Vec<&str> = near.into_iter().map(|(_, k)| k).take(MOST_MATCHES).collect();
    if near.is_empty() { format!("see `{list}`") } else { format!("did you mean {}? see `{list}`", near.join(", ")) }
}

/// The number of insertions, deletions and substitutions between two words (Levenshtein), row by row.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_matters_where_it_changes_a_value() {
        use crate::integrate::{Integration, Settings};
        let integration =
            Integration::new(Settings { tolerance: Some(1e-6), ..Settings::default() }).expect("settings");
        let values = [0.3, 0.4, 0.25, 0.04, 0.5, 1.5, 0.4, 2.0, 0.3, 0.5, 0.2, 0.2, 0.6, 0.1, 0.3];
        for handle in all().filter(|h| h.family.has_quadrature()) {
            let at = Parameter::ALL.into_iter().zip(values).filter(|(p, _)| handle.quantity.parameters.contains(p));
            let at = at.fold(Point::default(), |at, (p, v)| at.with(p, v).expect("in the domain"));
            let value = |model: &Model| handle.evaluate(&at, model, &integration).expect("reached").value;
            let usual = value(&Model::default());
            let changed = [
                value(&Model { smith: Smith::Separable, ..Model::default() }),
                value(&Model { visibility: Visibility::Charlie, ..Model::default() }),
                value(&Model { kd: Kd::Fresnel, ..Model::default() }),
            ]
            .map(|v| v != usual);
            let q = handle.quantity;
            let said = [q.depends_on_smith(), q.depends_on_visibility(), q.depends_on_kd()];
            assert_eq!(changed, said, "{}: Smith, visibility, kd", q.name);
        }
    }

    #[test]
    fn a_mistyped_quantity_is_told_the_nearest_ones_each_once() {
        for (wrong, offered) in [
            ("ggx.albdo", "did you mean ggx.albedo?"),
            ("ggx.skale", "did you mean ggx.scale?"),
            ("albedo_avg", "ggx.albedo_avg"),
            ("compensations.*", "compensation."),
        ] {
            let text = find(wrong).expect_err("no such quantity").to_string();
            assert!(text.contains(offered), "{wrong}: {text}");
            for handle in all() {
                let list = text.split("did you mean").nth(1).unwrap_or_default();
                let times = list.split([',', '?']).filter(|w| w.trim() == handle.quantity.name).count();
                assert!(times <= 1, "{wrong}: {text}");
            }
        }
        assert_eq!(find("zzz").expect_err("no such quantity").to_string().matches("did you mean").count(), 0);
    }
}
