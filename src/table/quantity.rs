//! Quantities: functions of physical parameters, with what is known of each.

pub use super::near::near_matches;
pub use super::parameter::{Parameter, Point};
use super::transform::Transform;
use crate::error::{Error, Result};
use crate::integrate::{ErrorKind, Estimate, Integration, Integrator};
use crate::model::charlie::Visibility;
use crate::model::ggx::Smith;
use crate::model::layered::Kd;
use serde::{Deserialize, Serialize};
use std::fmt;

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
        const FAMILIES: [&str; 11] = [
            "ggx",
            "beckmann",
            "dielectric",
            "schlick-dielectric",
            "conductor",
            "layered",
            "compensation",
            "ltc",
            "ltc-m00",
            "ltc-m22",
            "ltc-lobe",
        ];
        FAMILIES.contains(&self.family_name())
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
    &super::schlick_dielectric::Directional,
    &super::schlick_dielectric::AboutCritical,
    &super::generalized_schlick::POWER,
    &super::generalized_schlick::DIELECTRIC,
    &super::lambert::Lambertian,
    &super::lambert::FABRIC,
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
    &super::ltc::BY_M11,
    &super::ltc::BY_M22,
    &super::ltc::BY_M00,
    &super::ltc::LOBE,
    &super::ltc::BURLEY,
    &super::ltc::CHARLIE,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_matters_where_it_changes_a_value() {
        use crate::integrate::{Integration, Settings};
        let integration =
            Integration::new(Settings { tolerance: Some(1e-6), ..Settings::default() }).expect("settings");
        let values = [0.3, 0.4, 0.25, 0.04, 0.5, 1.5, 0.4, 2.0, 0.3, 0.5, 0.2, 0.2, 0.6, 0.1, 0.3, 2.5, 0.7];
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
