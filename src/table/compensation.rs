//! Energy compensation as engines use it: what each makes of GGX with Schlick's reflectance under a uniform environment.
//!
//! With R = F0 scale + bias (single scattering), E = scale + bias, F_avg = (20 F0 + 1)/21 of Schlick:
//!
//! | quantity | value |
//! | --- | --- |
//! | `none` | R |
//! | `kulla-conty` | R + (1 − E) F_avg E_avg/(1 − F_avg (1 − E_avg)) |
//! | `kulla-conty-squared` | R + (1 − E) F_avg² E_avg/(1 − F_avg (1 − E_avg)) |
//! | `turquin` | R (1 + F0 (1/E − 1)) |
//! | `fdez-aguera` | R + R F_avg (1 − E)/(1 − F_avg (1 − E)) |
//!
//! All four return everything for F0 = 1. The second Kulla–Conty factor counts the first bounce's reflectance as well: it is what
//! Hill 2018 corrects theirs to.

use super::quantity::{Family, Identity, Model, Parameter, Point, Quantity};
use super::specular::{Specular, finer, propagate};
use crate::error::Result;
use crate::integrate::{Estimate, Integration};
use crate::model::fresnel::{schlick, schlick_average};

/// `compensation.*`.
#[derive(Debug)]
pub struct Compensation;

const PARAMETERS: &[Parameter] = &[Parameter::Mu, Parameter::Alpha, Parameter::F0];

static COMPENSATION: [Quantity; 5] = [
    Quantity {
        name: "compensation.none",
        summary: "directional albedo of GGX with Schlick's reflectance, single scattering: what the others compensate",
        definition: "R = F0 scale + bias",
        source: "Karis 2013, \"Real Shading in Unreal Engine 4\"",
        parameters: PARAMETERS,
        monotone: &[],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "compensation.kulla-conty",
        summary: "the same with Kulla and Conty's lobe, Fresnel factor as first published",
        definition: "R + (1 − E) F_avg E_avg/(1 − F_avg (1 − E_avg))",
        source: "Kulla and Conty 2017, \"Revisiting Physically Based Shading at Imageworks\"",
        parameters: PARAMETERS,
        monotone: &[],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "compensation.kulla-conty-squared",
        summary: "the same with Kulla and Conty's lobe, Fresnel factor times F_avg, as it is mostly implemented",
        definition: "R + (1 − E) F_avg² E_avg/(1 − F_avg (1 − E_avg))",
        source: "Hill 2018, \"A Multi-Faceted Exploration\" (a tweak of Kulla and Conty's factor), as shaders write it",
        parameters: PARAMETERS,
        monotone: &[],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "compensation.turquin",
        summary: "the same scaled as Turquin does, from F0 and E alone; not reciprocal",
        definition: "R (1 + F0 (1/E − 1))",
        source: "Turquin 2019, \"Practical multiple scattering compensation for microfacet models\" (as MaterialX quotes it)",
        parameters: PARAMETERS,
        monotone: &[],
        bounds: (0.0, 1.0),
    },
    Quantity {
        name: "compensation.fdez-aguera",
        summary: "the same with Fdez-Agüera's multiple scattering for image-based lighting, without its roughness-dependent F0",
        definition: "R + R F_avg (1 − E)/(1 − F_avg (1 − E))",
        source: "Fdez-Agüera 2019, \"A Multiple-Scattering Microfacet Model for Real-Time Image-based Lighting\" (as shaders quote it)",
        parameters: PARAMETERS,
        monotone: &[],
        bounds: (0.0, 1.0),
    },
];

/// The five values of bias, E and E_avg.
fn compensated(specular: &Specular, [bias, e, e_avg]: [f64; 3]) -> [f64; 5] {
    let (r, f_avg, lost) = (specular.reflectance(bias, e), schlick_average(specular.f0), 1.0 - e);
    let series = f_avg * e_avg / (1.0 - f_avg * (1.0 - e_avg));
    [
        r,
        r + lost * series,
        r + lost * series * f_avg,
        r * (1.0 + specular.f0 * lost / e),
        r + r * f_avg * lost / (1.0 - f_avg * lost),
    ]
}

fn estimates(specular: &Specular, inputs: [Estimate; 3]) -> Vec<Estimate> {
    (0..COMPENSATION.len()).map(|i| propagate(inputs, |values| compensated(specular, values)[i])).collect()
}

/// The tolerance of each input, in parts of that of the results: the derivatives by E and bias are below 4.
const SHARE: f64 = 8.0;

impl Family for Compensation {
    fn quantities(&self) -> &'static [Quantity] {
        &COMPENSATION
    }

    fn quadrature(&self, at: &Point, model: &Model, tolerance: f64) -> Result<Vec<Estimate>> {
        let specular = Specular::at(at, model)?;
        let [bias, e] = specular.split(tolerance / SHARE);
        Ok(estimates(&specular, [bias, e, specular.albedo_average(tolerance / SHARE)]))
    }

    fn monte_carlo(&self, at: &Point, model: &Model, integration: &Integration) -> Result<Vec<Estimate>> {
        let (specular, stop) = (Specular::at(at, model)?, finer(integration.stop(), SHARE));
        let [bias, e] = specular.split_by_samples(integration, stop);
        let [e_avg, _] = specular.averages_by_samples(integration, stop);
        Ok(estimates(&specular, [bias, e, e_avg]))
    }

    fn identities(&self, at: &Point, _model: &Model) -> Vec<Identity> {
        let mut known = vec![];
        if at.get(Parameter::F0).is_ok_and(|f0| f0 == 1.0) {
            let fact = "white furnace: F0 = 1 reflects all";
            known.extend((1..5).map(|quantity| Identity { quantity, value: 1.0, slack: 0.0, fact }));
        }
        if let (Ok(0.0), Ok(mu), Ok(f0)) = (at.get(Parameter::Alpha), at.get(Parameter::Mu), at.get(Parameter::F0)) {
            let (value, fact) = (schlick(f0, mu), "a mirror loses nothing to compensate");
            known.extend((0..5).map(|quantity| Identity { quantity, value, slack: 0.0, fact }));
        }
        known
    }
}
