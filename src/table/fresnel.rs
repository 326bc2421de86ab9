//! Fresnel reflectances at a point, which are closed forms, and their averages over the hemisphere.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity, Trend};
use crate::error::Result;
use crate::integrate::fresnel::{conductor_average, dielectric_average};
use crate::integrate::monte_carlo::defensive_tail;
use crate::integrate::{Estimate, Integration};
use crate::model::fresnel;

const SCHLICK_1994: &str = "Schlick 1994, \"An Inexpensive BRDF Model for Physically-based Rendering\", eq. 15";
const LAGARDE: &str = "Lagarde 2013, \"Memo on Fresnel equations\"";
const WALSH: &str =
    "Walsh's closed form in Prahl 1988, \"Light Transport in Tissue\", eq. B41, is what tests compare it with";
const MATERIALX: &str = "MaterialX, generalized Schlick with F82; Portsmouth, Kutz and Hill 2024 (the GLSL beside EON)";

/// Quantities that are closed forms of a point: nothing to integrate, an error of a few ulp.
pub struct Pointwise {
    pub(super) quantities: &'static [Quantity],
    pub(super) values: fn(&Point) -> Result<Vec<f64>>,
    /// Bound on the error, absolute (all values are of order 1): counted roundings in units of f64's epsilon.
    pub(super) epsilons: f64,
    pub(super) known: fn(&Point) -> Vec<Identity>,
}

impl Family for Pointwise {
    fn quantities(&self) -> &'static [Quantity] {
        self.quantities
    }

    fn quadrature(&self, at: &Point, _model: &Model, _tolerance: f64) -> Result<Vec<Estimate>> {
        let exact = |v| Estimate::bound(v, self.epsilons * f64::EPSILON);
        Ok((self.values)(at)?.into_iter().map(exact).collect())
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        self.quadrature(at, model, integration.tolerance())
    }

    fn is_pointwise(&self) -> bool {
        true
    }

    fn identities(&self, at: &Point, _model: &Model) -> Vec<Identity> {
        (self.known)(at)
    }
}

/// `value` at the parameters that `get` finds, if they are all given.
fn known<const N: usize>(
    at: &Point,
    parameters: [Parameter; N],
    facts: impl Fn([f64; N]) -> Vec<Identity>,
) -> Vec<Identity> {
    let values: Result<Vec<f64>> = parameters.iter().map(|p| at.get(*p)).collect();
    values.ok().and_then(|v| v.try_into().ok()).map_or_else(Vec::new, facts)
}

fn fact(quantity: usize, value: f64, fact: &'static str) -> Identity {
    Identity { quantity, value, slack: 0.0, fact }
}

const AT_GRAZING: &str = "all is reflected at grazing incidence";

/// `fresnel.schlick`.
pub static SCHLICK: Pointwise = Pointwise {
    quantities: &[Quantity {
        name: "fresnel.schlick",
        summary: "Schlick's approximation of Fresnel reflectance",
        definition: "F0 + (1 − F0) (1 − μ)⁵",
        source: SCHLICK_1994,
        parameters: &[Parameter::Mu, Parameter::F0],
        monotone: &[(Parameter::Mu, Trend::Falls), (Parameter::F0, Trend::Rises)],
        bounds: (0.0, 1.0),
    }],
    values: |at| Ok(vec![fresnel::schlick(at.get(Parameter::F0)?, at.get(Parameter::Mu)?)]),
    epsilons: 8.0,
    known: |at| {
        known(at, [Parameter::Mu, Parameter::F0], |[mu, f0]| match mu {
            0.0 => vec![fact(0, 1.0, AT_GRAZING)],
            1.0 => vec![fact(0, f0, "F0 at normal incidence")],
            _ => vec![],
        })
    },
};

/// `fresnel.dielectric` and its two polarisations.
pub static DIELECTRIC: Pointwise = Pointwise {
    quantities: &[
        Quantity {
            name: "fresnel.dielectric",
            summary: "reflectance of an interface between dielectrics, unpolarised; eta = n_t/n_i on either side of 1",
            definition: "(r∥² + r⊥²)/2; 1 beyond the critical angle",
            source: LAGARDE,
            parameters: &[Parameter::Mu, Parameter::Eta],
            monotone: &[],
            bounds: (0.0, 1.0),
        },
        Quantity {
            name: "fresnel.dielectric_parallel",
            summary: "the same for light polarised in the plane of incidence (power, not amplitude); 0 at Brewster's angle",
            definition: "r∥², r∥ = (η²μ − g)/(η²μ + g), g = √(η² − 1 + μ²)",
            source: LAGARDE,
            parameters: &[Parameter::Mu, Parameter::Eta],
            monotone: &[],
            bounds: (0.0, 1.0),
        },
        Quantity {
            name: "fresnel.dielectric_perpendicular",
            summary: "the same for light polarised across the plane of incidence (power, not amplitude)",
            definition: "r⊥², r⊥ = (μ − g)/(μ + g), g = √(η² − 1 + μ²)",
            source: LAGARDE,
            parameters: &[Parameter::Mu, Parameter::Eta],
            monotone: &[],
            bounds: (0.0, 1.0),
        },
    ],
    values: |at| {
        let (mu, eta) = (at.get(Parameter::Mu)?, at.get(Parameter::Eta)?);
        let [parallel, perpendicular] = fresnel::dielectric_polarised(mu, eta);
        Ok(vec![fresnel::dielectric(mu, eta), parallel, perpendicular])
    },
    epsilons: 32.0,
    known: |at| {
        known(at, [Parameter::Mu, Parameter::Eta], |[mu, eta]| match mu {
            0.0 if eta != 1.0 => (0..3).map(|q| fact(q, 1.0, AT_GRAZING)).collect(),
            1.0 => (0..3).map(|q| fact(q, fresnel::f0_of_eta(eta), "F0 = ((η − 1)/(η + 1))²")).collect(),
            _ => vec![],
        })
    },
};

/// `fresnel.conductor`.
pub static CONDUCTOR: Pointwise = Pointwise {
    quantities: &[Quantity {
        name: "fresnel.conductor",
        summary: "reflectance of a conductor of index n + ik relative to the medium of incidence, unpolarised",
        definition: "(|r∥|² + |r⊥|²)/2 of the complex index",
        source: LAGARDE,
        parameters: &[Parameter::Mu, Parameter::N, Parameter::K],
        monotone: &[],
        bounds: (0.0, 1.0),
    }],
    values: |at| Ok(vec![fresnel::conductor(at.get(Parameter::Mu)?, at.get(Parameter::N)?, at.get(Parameter::K)?)]),
    epsilons: 64.0,
    known: |at| {
        known(at, [Parameter::Mu, Parameter::N, Parameter::K], |[mu, n, k]| {
            let f0 = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
            let mut facts = vec![];
            if mu == 1.0 {
                facts.push(fact(0, f0, "F0 = ((n − 1)² + k²)/((n + 1)² + k²)"));
            }
            if k == 0.0 {
                facts.push(fact(0, fresnel::dielectric(mu, n), "a conductor with k = 0 is the dielectric"));
            }
            facts
        })
    },
};

/// `fresnel.f82`.
pub static F82: Pointwise = Pointwise {
    quantities: &[Quantity {
        name: "fresnel.f82",
        summary: "Schlick's approximation with a metal's dip at 82°; not clamped, so below 0 where f0 and f82 both are small",
        definition: "schlick(μ) − a μ (1 − μ)⁶, a such that F(1/7) = f82 schlick(1/7)",
        source: MATERIALX,
        parameters: &[Parameter::Mu, Parameter::F0, Parameter::F82],
        monotone: &[],
        bounds: (-0.127, 1.0),
    }],
    values: |at| Ok(vec![fresnel::f82_tint(at.get(Parameter::F0)?, at.get(Parameter::F82)?, at.get(Parameter::Mu)?)]),
    epsilons: 16.0,
    known: |at| {
        known(at, [Parameter::Mu, Parameter::F0, Parameter::F82], |[mu, f0, f82]| {
            if f82 == 1.0 { vec![fact(0, fresnel::schlick(f0, mu), "f82 = 1 is no tint")] } else { vec![] }
        })
    },
};

/// An average 2 ∫ F μ dμ of a reflectance.
pub struct Average {
    quantities: &'static [Quantity],
    quadrature: fn(&Point, f64) -> Result<Estimate>,
    /// The reflectance at a cosine, for the random witness.
    reflectance: fn(&Point, f64) -> Result<f64>,
    known: fn(&Point) -> Vec<Identity>,
}

impl Family for Average {
    fn quantities(&self) -> &'static [Quantity] {
        self.quantities
    }

    fn quadrature(&self, at: &Point, _model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        Ok(vec![(self.quadrature)(at, tolerance)?])
    }

    fn monte_carlo(&self, at: &Point, _model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        (self.reflectance)(at, 1.0)?; // every parameter is there
        // The density 2 mu of the cosine is the weight of the average; half of the points look at grazing incidence, where an index
        // of nearly 1 has all of its reflectance.
        let (estimates, _) = integration.points2.integrate(integration.stop(), |[u, _]| {
            let (mu2, stretch) = defensive_tail(u, SMALLEST);
            [(self.reflectance)(at, mu2.sqrt().min(1.0)).unwrap_or(f64::NAN) * stretch] // at most 1 but for rounding
        });
        Ok(estimates.into())
    }

    fn identities(&self, at: &Point, _model: &Model) -> Vec<Identity> {
        (self.known)(at)
    }
}

/// The square of the cosine down to which the random witness looks.
const SMALLEST: f64 = 1e-12;

/// `fresnel.schlick_avg`.
pub static SCHLICK_AVERAGE: Average = Average {
    quantities: &[Quantity {
        name: "fresnel.schlick_avg",
        summary: "average of Schlick's reflectance, weighted by the cosine",
        definition: "2 ∫ F μ dμ = (20 F0 + 1)/21",
        source: SCHLICK_1994,
        parameters: &[Parameter::F0],
        monotone: &[(Parameter::F0, Trend::Rises)],
        bounds: (1.0 / 21.0, 1.0),
    }],
    quadrature: |at, _| Ok(Estimate::bound(fresnel::schlick_average(at.get(Parameter::F0)?), 2.0 * f64::EPSILON)),
    reflectance: |at, mu| Ok(fresnel::schlick(at.get(Parameter::F0)?, mu)),
    known: |at| {
        known(at, [Parameter::F0], |[f0]| vec![fact(0, (20.0 * f0 + 1.0) / 21.0, "closed form (20 F0 + 1)/21")])
    },
};

/// `fresnel.dielectric_avg`.
pub static DIELECTRIC_AVERAGE: Average = Average {
    quantities: &[Quantity {
        name: "fresnel.dielectric_avg",
        summary: "average reflectance of an interface between dielectrics, weighted by the cosine",
        definition: "2 ∫ F μ dμ",
        source: WALSH,
        parameters: &[Parameter::Eta],
        monotone: &[],
        bounds: (0.0, 1.0),
    }],
    quadrature: |at, tolerance| Ok(dielectric_average(at.get(Parameter::Eta)?, tolerance)),
    reflectance: |at, mu| Ok(fresnel::dielectric(mu, at.get(Parameter::Eta)?)),
    known: |at| {
        known(at, [Parameter::Eta], |[eta]| {
            if eta <= 1.0 {
                return vec![];
            }
            // The closed form divides rounding errors by (η⁴ − 1)².
            let slack = 64.0 * f64::EPSILON * (1.0 + (eta - 1.0).powi(-2));
            let value = fresnel::dielectric_average_walsh(eta);
            vec![Identity { quantity: 0, value, slack, fact: "Walsh's closed form" }]
        })
    },
};

/// `fresnel.conductor_avg`.
pub static CONDUCTOR_AVERAGE: Average = Average {
    quantities: &[Quantity {
        name: "fresnel.conductor_avg",
        summary: "average reflectance of a conductor, weighted by the cosine",
        definition: "2 ∫ F μ dμ",
        source: LAGARDE,
        parameters: &[Parameter::N, Parameter::K],
        monotone: &[],
        bounds: (0.0, 1.0),
    }],
    quadrature: |at, tolerance| Ok(conductor_average(at.get(Parameter::N)?, at.get(Parameter::K)?, tolerance)),
    reflectance: |at, mu| Ok(fresnel::conductor(mu, at.get(Parameter::N)?, at.get(Parameter::K)?)),
    known: |at| {
        known(at, [Parameter::N, Parameter::K], |[n, k]| {
            // At n = 1 there is no interface.
            if n == 1.0 && k == 0.0 { vec![fact(0, 0.0, "no interface")] } else { vec![] }
        })
    },
};
