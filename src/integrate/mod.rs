//! Integration: what an estimate is, how one is asked for, and the Monte Carlo road to it.
//!
//! Every number has two witnesses: [`monte_carlo`], random and general, and [`quadrature`], deterministic and written per kind of
//! integrand. They share neither samples nor changes of variables.

mod cosine;
pub mod fresnel;
pub mod monte_carlo;
pub mod quadrature;

pub(crate) use cosine::over_cosine;

use crate::error::{Error, Result};
use crate::math::frame::direction_with_cosine;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What an [`Estimate`]'s error means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ErrorKind {
    /// |value − truth| ≤ error.
    Bound,
    /// One standard error.
    Sigma,
    /// The largest difference from the full sum that was seen, over the places where it is likely to be largest.
    Measured,
}

impl ErrorKind {
    /// The word that files and reports use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bound => "bound",
            Self::Sigma => "sigma",
            Self::Measured => "measured",
        }
    }
}

/// A value and how wrong it may be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// A bound or a standard error, as `kind` says.
    pub error: f64,
    /// What `error` is.
    pub kind: ErrorKind,
}

impl Estimate {
    /// A value known to within `error`.
    pub fn bound(value: f64, error: f64) -> Self {
        Self { value, error, kind: ErrorKind::Bound }
    }

    /// A value with its standard error.
    pub fn sigma(value: f64, error: f64) -> Self {
        Self { value, error, kind: ErrorKind::Sigma }
    }

    /// The half-width of the interval that is claimed to hold the truth: the bound itself, or `sigmas` standard errors (or largest
    /// differences seen).
    pub fn half_width(&self, sigmas: f64) -> f64 {
        match self.kind {
            ErrorKind::Bound => self.error,
            ErrorKind::Sigma | ErrorKind::Measured => sigmas * self.error,
        }
    }
}

/// Which witness computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integrator {
    /// Quadrature where the quantity has it (it reaches any tolerance sooner), else Monte Carlo.
    #[default]
    Auto,
    /// The deterministic one.
    Quadrature,
    /// The random one.
    MonteCarlo,
    /// Spherical harmonics, for environments: their default.
    Zonal,
}

impl Integrator {
    /// The name that a user writes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Quadrature => "quadrature",
            Self::MonteCarlo => "monte-carlo",
            Self::Zonal => "zonal",
        }
    }
}

/// The tolerance of quadrature where none is asked for.
pub const QUADRATURE_TOLERANCE: f64 = 1e-7;
/// The tolerance (one standard error) of Monte Carlo where none is asked for.
pub const MONTE_CARLO_TOLERANCE: f64 = 1e-4;

/// How to integrate: part of every recipe.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Which witness.
    pub integrator: Integrator,
    /// Largest acceptable error, absolute; `None` is the witness's default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Points per value for Monte Carlo instead of a tolerance; rounded up to what the replicates divide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<u64>,
    /// Seed of the random points.
    pub seed: u64,
}

impl Settings {
    /// Settings that make sense, or why not.
    pub fn check(&self) -> Result<()> {
        if let Some(tolerance) = self.tolerance
            && !(tolerance.is_finite() && tolerance > 0.0)
        {
            return Err(Error::usage(
                format!("tolerance {tolerance} is not a positive number"),
                "use something like --tolerance 1e-6",
            ));
        }
        if let Some(samples) = self.samples {
            if samples == 0 || samples > monte_carlo::MOST_SAMPLES {
                return Err(Error::usage(
                    format!("samples {samples} is not in 1..={}", monte_carlo::MOST_SAMPLES),
                    "use something like --samples 4096",
                ));
            }
            if matches!(self.integrator, Integrator::Quadrature | Integrator::Zonal) {
                return Err(Error::usage(
                    format!("--samples has no meaning for {}, which takes no random samples", self.integrator.name()),
                    "use --tolerance, or --integrator monte-carlo",
                ));
            }
        }
        Ok(())
    }
}

/// Settings with the random points that they stand for: what one run of a bake shares.
#[derive(Debug)]
pub struct Integration {
    /// What was asked for.
    pub settings: Settings,
    /// Points for integrals over one direction.
    pub points2: Arc<monte_carlo::Points<2>>,
    /// Points for integrals over one direction and one cosine.
    pub points3: Arc<monte_carlo::Points<3>>,
}

impl Integration {
    /// Checks the settings; points are computed when first used.
    ///
    /// **Errors**: [`Settings::check`].
    pub fn new(settings: Settings) -> Result<Self> {
        settings.check()?;
        if settings.integrator == Integrator::Zonal {
            return Err(Error::usage(
                "zonal filters environments, and is no way to integrate a table",
                "use --integrator quadrature or monte-carlo",
            ));
        }
        let (points2, points3) =
            (monte_carlo::Points::new(settings.seed), monte_carlo::Points::new(settings.seed ^ 0x9e37_79b9_7f4a_7c15));
        Ok(Self { settings, points2: Arc::new(points2), points3: Arc::new(points3) })
    }

    /// The same with the tolerance of one witness divided by `times`, for values whose errors will grow so much.
    pub fn tightened(&self, monte_carlo: bool, times: f64) -> Self {
        let settings = Settings { tolerance: Some(self.tolerance_of(monte_carlo) / times), ..self.settings };
        Self { settings, points2: Arc::clone(&self.points2), points3: Arc::clone(&self.points3) }
    }

    /// Whether a quantity that has both witnesses is computed by the random one.
    ///
    /// `auto` means quadrature, which reaches 1e-7 sooner than Monte Carlo reaches 1e-4 (see `cargo bench`), unless samples are
    /// asked for.
    pub fn is_monte_carlo(&self) -> bool {
        match self.settings.integrator {
            Integrator::MonteCarlo => true,
            Integrator::Auto => self.settings.samples.is_some(),
            Integrator::Quadrature | Integrator::Zonal => false,
        }
    }

    /// The largest error that the chosen witness may leave.
    pub fn tolerance(&self) -> f64 {
        self.tolerance_of(self.is_monte_carlo())
    }

    /// The largest error that the random witness may leave, or the deterministic one.
    pub fn tolerance_of(&self, monte_carlo: bool) -> f64 {
        let default = if monte_carlo { MONTE_CARLO_TOLERANCE } else { QUADRATURE_TOLERANCE };
        self.settings.tolerance.unwrap_or(default)
    }

    /// 2 ∫ f mu dmu over the cosine of the outgoing direction, by the random witness: `f` takes that direction and a point of the
    /// unit square.
    pub fn average_over_cosine<const K: usize>(&self, f: impl Fn(DVec3, [f64; 2]) -> [f64; K]) -> [Estimate; K] {
        // The density 2 mu of the cosine is exactly the weight of the average.
        self.points3.integrate(self.stop(), |[u, v, w]| f(direction_with_cosine(u.sqrt()), [v, w])).0
    }

    /// When the random witness stops.
    pub fn stop(&self) -> monte_carlo::Stop {
        match self.settings.samples {
            Some(samples) => monte_carlo::Stop::Samples(samples),
            None => monte_carlo::Stop::Tolerance(self.settings.tolerance.unwrap_or(MONTE_CARLO_TOLERANCE)),
        }
    }
}
