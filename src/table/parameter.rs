//! The physical parameters that quantities depend on, and points of their space.

use crate::error::{Error, Result};
use crate::model::alpha_of_roughness;
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
    /// Power of 1 − cosine in a generalised Schlick reflectance.
    Exponent,
    /// Place of the outgoing direction about the critical angle, see [`cosine_about_critical`].
    Critical,
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
    Facts {
        parameter: Parameter::Exponent,
        name: "exponent",
        summary: "power of 1 − cosine in a generalised Schlick reflectance; Schlick's is 5",
        domain: (0.0, 1e6),
        limits: &[f64::INFINITY],
        range: None,
    },
    Facts {
        parameter: Parameter::Critical,
        name: "critical",
        summary: "place of the outgoing direction about the critical angle of eta: 0 along the surface, 1/2 at that angle, 1 straight above",
        domain: UNIT,
        limits: &[],
        range: Some(UNIT),
    },
];

/// The cosine of the outgoing direction that [`Parameter::Critical`] stands for: with c = √(1 − η²), the cosine of the critical angle,
/// 2ct from the surface up to it, and from there on to 1 as evenly.
pub fn cosine_about_critical(t: f64, eta: f64) -> f64 {
    let c = ((1.0 - eta) * (1.0 + eta)).max(0.0).sqrt();
    if t < 0.5 { 2.0 * t * c } else { c + (2.0 * t - 1.0) * (1.0 - c) }
}

impl Parameter {
    /// Every parameter.
    pub const ALL: [Self; 17] = [
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
        Self::Exponent,
        Self::Critical,
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
