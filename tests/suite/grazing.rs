//! Directions that graze the surface and lobes that are nearly mirrors: values stay right, and what they cost stays bounded.

use kiln::integrate::{Integration, Integrator, Settings, quadrature};
use kiln::model::beckmann::Beckmann;
use kiln::model::charlie::Visibility;
use kiln::model::smith::Smith;
use kiln::table::quantity::{self, evaluate_family};
use kiln::table::{Model, Parameter, Point};
use std::cell::Cell;

const MUS: [f64; 6] = [1e-6, 1e-5, 1e-4, 1e-2, 0.5, 1.0];
const ALPHAS: [f64; 6] = [1e-6, 1e-5, 1e-4, 1e-2, 0.3, 1.0];
/// 5 standard errors estimated from 32 replicates: one false alarm in 50,000 comparisons, of which some 2000 are made.
const SIGMAS: f64 = 5.0;
/// Points per value: what happens in a smaller part of the sampling square than the share of one may be missed altogether, and no
/// spread tells of it.
const SAMPLES: u64 = 1 << 16;
const SHARE: f64 = 1.0 / SAMPLES as f64;

/// A family by one of its quantities, and what else it depends on.
type Case = (&'static str, Vec<(Parameter, f64)>, Vec<Model>);

fn cases() -> Vec<Case> {
    let smith =
        |choices: &[Smith]| choices.iter().map(|&smith| Model { smith, ..Model::default() }).collect::<Vec<_>>();
    let exact = [Smith::Correlated, Smith::Separable];
    let through = [Smith::Correlated, Smith::Separable, Smith::Beta];
    let sheen = Visibility::ALL.map(|visibility| Model { visibility, ..Model::default() }).to_vec();
    vec![
        ("ggx.scale", vec![], smith(&exact)),
        ("beckmann.scale", vec![], smith(&exact)),
        ("charlie.albedo", vec![], sheen),
        ("dielectric.albedo", vec![(Parameter::Eta, 1.5)], smith(&through)),
        ("dielectric.albedo", vec![(Parameter::Eta, 0.7)], smith(&through)),
        ("conductor.albedo", vec![(Parameter::N, 0.2), (Parameter::K, 3.9)], smith(&exact)),
    ]
}

#[test]
fn both_witnesses_agree_within_bounds_down_to_mu_and_alpha_of_1e_6() {
    let exact = Integration::new(Settings { tolerance: Some(1e-7), ..Settings::default() }).expect("valid settings");
    let random = Integration::new(Settings {
        integrator: Integrator::MonteCarlo,
        samples: Some(SAMPLES),
        ..Settings::default()
    })
    .expect("valid settings");
    for (name, rest, models) in cases() {
        let family = quantity::find(name).expect("a quantity").family;
        for model in &models {
            for (mu, alpha) in MUS.into_iter().flat_map(|mu| ALPHAS.map(|alpha| (mu, alpha))) {
                let values = [(Parameter::Mu, mu), (Parameter::Alpha, alpha)].into_iter().chain(rest.iter().copied());
                let at = values.fold(Point::default(), |p, (q, v)| p.with(q, v).expect("in the domain"));
                let place = format!("{name} {rest:?} {model:?} mu {mu:e} alpha {alpha:e}");
                let truth = evaluate_family(family, &at, model, &exact).expect("in the domain");
                let drawn = evaluate_family(family, &at, model, &random).expect("in the domain");
                for ((quantity, t), e) in family.quantities().iter().zip(&truth).zip(&drawn) {
                    let (low, high) = quantity.bounds;
                    assert!(t.error <= 1e-7, "{place} {}: {t:?}", quantity.name);
                    let inside = t.value >= low - t.error && t.value <= high + t.error;
                    assert!(inside, "{place} {}: {t:?} is outside {low}..{high}", quantity.name);
                    let off = (t.value - e.value).abs();
                    assert!(off <= SIGMAS * e.error + t.error + SHARE, "{place} {}: {t:?}, drawn {e:?}", quantity.name);
                }
                for known in family.identities(&at, model) {
                    let t = truth[known.quantity];
                    let off = (t.value - known.value).abs();
                    assert!(off <= t.error + known.slack, "{place}, {}: off by {off:e}", known.fact);
                }
            }
        }
    }
}

/// Evaluations of the integrand that any value may take at 1e-7; in the middle of the domain it is a few thousand.
const MOST_EVALUATIONS: u64 = 40_000;

#[test]
fn evaluations_of_the_integrand_stay_bounded_at_the_edges_of_the_domain() {
    for (mu, alpha) in MUS.into_iter().chain([0.0]).flat_map(|mu| ALPHAS.map(|alpha| (mu, alpha))) {
        for smith in [Smith::Correlated, Smith::Separable] {
            let count = Cell::new(0_u64);
            let counted = |_: f64| {
                count.set(count.get() + 1);
                [1.0]
            };
            quadrature::ggx_reflection(mu, alpha, smith, 1e-7, counted);
            let ggx = count.replace(0);
            quadrature::beckmann_reflection(mu, &Beckmann { alpha, smith }, 1e-7, counted);
            let beckmann = count.get();
            assert!(
                ggx.max(beckmann) <= MOST_EVALUATIONS,
                "{smith:?} mu {mu:e} alpha {alpha:e}: {ggx} evaluations of GGX, {beckmann} of Beckmann"
            );
        }
    }
}
