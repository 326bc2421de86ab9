//! Analytic limits and identities of the quantities, by both witnesses.

use kiln::integrate::{Estimate, Integration, Integrator, Settings, quadrature};
use kiln::model::ggx::Smith;
use kiln::table::quantity::{self, evaluate_family};
use kiln::table::{Model, Parameter, Point};
use std::f64::consts::LN_2;

fn at(mu: f64, alpha: f64) -> Point {
    Point::default().with(Parameter::Mu, mu).and_then(|p| p.with(Parameter::Alpha, alpha)).expect("in the domain")
}

fn exact() -> Integration {
    Integration::new(Settings { tolerance: Some(1e-12), ..Settings::default() }).expect("valid settings")
}

fn random(seed: u64) -> Integration {
    let settings = Settings { integrator: Integrator::MonteCarlo, seed, ..Settings::default() };
    Integration::new(settings).expect("valid settings")
}

/// [scale, bias, albedo, f82].
fn split(mu: f64, alpha: f64, smith: Smith, integration: &Integration) -> Vec<Estimate> {
    let family = quantity::find("ggx.scale").expect("a quantity").family;
    evaluate_family(family, &at(mu, alpha), &Model { smith, ..Model::default() }, integration).expect("in the domain")
}

fn average(alpha: f64, smith: Smith, integration: &Integration) -> Estimate {
    let point = Point::default().with(Parameter::Alpha, alpha).expect("in the domain");
    quantity::find("ggx.albedo_avg")
        .expect("a quantity")
        .evaluate(&point, &Model { smith, ..Model::default() }, integration)
        .expect("reached")
}

/// `n` values from 10^low to 1, even in the logarithm.
fn decades(low: f64, n: usize) -> impl Iterator<Item = f64> {
    (0..n).map(move |i| 10.0_f64.powf(low * (1.0 - i as f64 / (n - 1) as f64)))
}

#[test]
fn albedo_at_alpha_one_is_its_closed_form() {
    for mu in decades(-6.0, 40) {
        for smith in Smith::ALL {
            let wanted = match smith {
                Smith::Correlated | Smith::Beta | Smith::ApproxCorrelated => 1.0 - mu * (1.0 / mu).ln_1p(),
                Smith::Separable | Smith::SchlickIbl | Smith::SchlickDirect => 2.0 * (1.0 - LN_2) / (1.0 + mu),
            };
            let got = split(mu, 1.0, smith, &exact())[2];
            assert!((got.value - wanted).abs() <= got.error, "{smith:?} at mu {mu}: got {got:?}, wanted {wanted}");
            assert!(got.error <= 1e-12, "{smith:?} at mu {mu}: {got:?}");
        }
    }
}

#[test]
fn average_albedo_at_alpha_one_is_its_closed_form() {
    for smith in Smith::ALL {
        let wanted = match smith {
            Smith::Correlated | Smith::Beta | Smith::ApproxCorrelated => 4.0 / 3.0 * (1.0 - LN_2),
            Smith::Separable | Smith::SchlickIbl | Smith::SchlickDirect => 4.0 * (1.0 - LN_2).powi(2),
        };
        let got = average(1.0, smith, &exact()).value;
        assert!((got - wanted).abs() < 5e-15, "{smith:?}: got {got}, wanted {wanted}");
    }
}

#[test]
fn scale_plus_bias_is_albedo_everywhere() {
    for smith in Smith::ALL {
        for mu in decades(-5.0, 25).chain([0.0]) {
            for alpha in decades(-5.0, 25) {
                let [scale, bias, albedo, _] = split(mu, alpha, smith, &exact())[..] else { panic!("four quantities") };
                let off = (scale.value + bias.value - albedo.value).abs();
                assert!(off < 1e-11, "{smith:?} at mu {mu}, alpha {alpha}: off by {off:e}");
            }
        }
    }
}

/// [scale, bias, albedo, f82] of a perfectly smooth surface.
fn mirror(mu: f64, smith: Smith) -> [f64; 4] {
    let fc = (1.0 - mu).powi(5);
    let g = if smith == Smith::SchlickDirect { (mu / (0.875 * mu + 0.125)).powi(2) } else { 1.0 };
    [1.0 - fc, fc, 1.0, mu * (1.0 - mu).powi(6)].map(|factor| factor * g)
}

#[test]
fn narrow_lobe_is_a_perfect_mirror() {
    for smith in Smith::ALL {
        // The exact ones are off by the second order of alpha, the engines' approximations by the first or by its root.
        let (alpha, tolerance) = match smith {
            Smith::Correlated | Smith::Beta | Smith::Separable => (1e-5, 3e-8),
            Smith::SchlickIbl | Smith::ApproxCorrelated => (1e-8, 3e-7),
            Smith::SchlickDirect => (1e-8, 1e-4),
        };
        for mu in [1.0, 0.7, 0.3, 0.1] {
            for (e, wanted) in split(mu, alpha, smith, &exact()).iter().zip(mirror(mu, smith)) {
                assert!((e.value - wanted).abs() < tolerance, "{smith:?} at mu {mu}: got {}, wanted {wanted}", e.value);
            }
            for (e, wanted) in split(mu, 0.0, smith, &exact()).iter().zip(mirror(mu, smith)) {
                assert!(
                    (e.value - wanted).abs() < 1e-15,
                    "{smith:?} alpha 0, mu {mu}: got {}, wanted {wanted}",
                    e.value
                );
            }
        }
    }
}

#[test]
fn smooth_conductor_is_the_limit_of_narrow_ones() {
    let quantity = quantity::find("conductor.albedo").expect("a quantity");
    for smith in Smith::ALL {
        let value = |mu: f64, alpha: f64| {
            let at =
                at(mu, alpha).with(Parameter::N, 0.2).and_then(|p| p.with(Parameter::K, 3.9)).expect("in the domain");
            quantity.evaluate(&at, &Model { smith, ..Model::default() }, &exact()).expect("reached").value
        };
        for mu in [0.1, 0.7, 1.0] {
            let (smooth, narrow) = (value(mu, 0.0), value(mu, 1e-30));
            assert!((smooth - narrow).abs() < 1e-12, "{smith:?} at mu {mu}: {smooth} smooth, {narrow} narrow");
        }
    }
}

#[test]
fn average_of_a_perfect_mirror_is_the_average_of_the_mirror() {
    let rule = kiln::math::quadrature::gauss_legendre(64);
    for smith in Smith::ALL {
        let wanted = 2.0 * rule.integrate(|mu| mu * mirror(mu, smith)[2]);
        for integration in [exact(), random(0)] {
            let got = average(0.0, smith, &integration).value;
            assert!((got - wanted).abs() < 1e-14, "{smith:?}: got {got}, wanted {wanted}");
        }
    }
}

#[test]
fn albedo_of_the_approximations_never_exceeds_the_exact_one() {
    let pairs = [
        (Smith::SchlickIbl, Smith::Separable),
        (Smith::SchlickDirect, Smith::SchlickIbl),
        (Smith::ApproxCorrelated, Smith::Correlated),
    ];
    for (low, high) in pairs {
        for mu in decades(-4.0, 17).chain([0.0]) {
            for alpha in decades(-4.0, 17) {
                let [low, high] = [low, high].map(|smith| split(mu, alpha, smith, &exact())[2].value);
                assert!(low <= high + 1e-12, "mu {mu}, alpha {alpha}: {low} above {high}");
            }
        }
    }
}

#[test]
fn mirror_limit_holds_within_its_stated_slack() {
    for smith in Smith::ALL {
        for mu in decades(-4.0, 20) {
            for ratio in decades(-4.0, 20) {
                let point = at(mu, 0.01 * mu * ratio);
                let family = quantity::find("ggx.scale").expect("a quantity").family;
                let model = Model { smith, ..Model::default() };
                let values = evaluate_family(family, &point, &model, &exact()).expect("in the domain");
                let known = family.identities(&point, &model);
                assert!(known.len() >= 4, "{point:?} has no mirror limit");
                for identity in known {
                    let off = (values[identity.quantity].value - identity.value).abs();
                    assert!(off <= identity.slack, "{smith:?} {point:?}, {}: off by {off:e}", identity.fact);
                }
            }
        }
    }
}

#[test]
fn correlated_albedo_tends_to_one_at_grazing_for_every_alpha() {
    for smith in [Smith::Correlated, Smith::ApproxCorrelated] {
        for alpha in decades(-4.0, 13) {
            let grazing = split(0.0, alpha, smith, &exact())[2].value;
            assert!((grazing - 1.0).abs() < 1e-13, "{smith:?} alpha {alpha}: E(0) = {grazing}");
            let near = split(1e-6 * alpha, alpha, smith, &exact())[2].value;
            assert!((near - 1.0).abs() < 1.5e-5, "{smith:?} alpha {alpha}: E(1e-6 alpha) = {near}");
        }
    }
}

#[test]
fn albedo_dips_to_nearly_0_89_where_mu_is_near_alpha() {
    let lowest = decades(-3.0, 400).map(|mu| split(mu, 1e-3, Smith::Correlated, &exact())[2].value).fold(1.0, f64::min);
    assert!((0.88..0.90).contains(&lowest), "lowest E at alpha 1e-3 is {lowest}");
}

#[test]
fn furnace_ggx_never_exceeds_one_and_never_falls_below_zero() {
    for smith in Smith::ALL {
        for mu in decades(-4.0, 20) {
            for alpha in decades(-4.0, 20) {
                for e in split(mu, alpha, smith, &exact()) {
                    assert!(e.value >= -1e-13 && e.value <= 1.0 + 1e-13, "{smith:?} mu {mu}, alpha {alpha}: {e:?}");
                }
            }
        }
    }
}

#[test]
fn kulla_conty_lobe_closes_the_furnace() {
    // E(μo) + ∫ f_ms cos = 1 with f_ms = (1 − E(μo)) (1 − E(μi)) / (π (1 − E_avg)).
    let rule = kiln::math::quadrature::GradedRules::new(40.0);
    for alpha in [0.05, 0.3, 1.0] {
        let e = |mu: f64| quadrature::ggx_albedo(mu, alpha, Smith::Correlated, 1e-15).value;
        let lost = 2.0 * rule.at_scale(1e-4 * alpha).integrate(|mu| (1.0 - e(mu)) * mu);
        let e_avg = average(alpha, Smith::Correlated, &exact()).value;
        for mu in [0.05, 0.5, 1.0] {
            let total = e(mu) + (1.0 - e(mu)) * lost / (1.0 - e_avg);
            assert!((total - 1.0).abs() < 1e-12, "alpha {alpha}, mu {mu}: {total}");
        }
    }
}

#[test]
fn quadrature_bounds_hold_over_the_whole_domain() {
    // Against the finest rungs of the ladder, whose own bound is 1e-11 at worst.
    let integrations = [1e-2, 1e-4, 1e-7, 1e-8, 1e-10].map(|tolerance| {
        Integration::new(Settings { tolerance: Some(tolerance), ..Settings::default() }).expect("valid settings")
    });
    for smith in Smith::ALL {
        for mu in decades(-3.0, 33).chain([0.0, 1e-5]) {
            for alpha in decades(-4.0, 33) {
                let truth = split(mu, alpha, smith, &exact());
                for integration in &integrations {
                    for (e, t) in split(mu, alpha, smith, integration).iter().zip(&truth) {
                        let off = (e.value - t.value).abs();
                        let tolerance = integration.tolerance();
                        assert!(
                            e.error <= tolerance,
                            "{smith:?} mu {mu} alpha {alpha}: {tolerance:e} not reached: {e:?}"
                        );
                        assert!(off <= e.error + t.error, "{smith:?} mu {mu} alpha {alpha}: off by {off:e}, {e:?}");
                    }
                }
            }
        }
    }
}

/// 5 standard errors estimated from 32 replicates: one false alarm in 50,000 comparisons, of which 7840 are made.
const SIGMAS: f64 = 5.0;

#[test]
fn monte_carlo_agrees_with_quadrature_within_its_standard_error() {
    let (mut squares, mut n) = (0.0_f64, 0.0);
    for seed in 0..2 {
        let integration = random(seed);
        for smith in Smith::ALL {
            for mu in decades(-3.0, 9) {
                for alpha in decades(-4.0, 9) {
                    let truth = split(mu, alpha, smith, &exact());
                    for (e, t) in split(mu, alpha, smith, &integration).iter().zip(truth) {
                        let z = (e.value - t.value) / e.error;
                        assert!(
                            z.abs() < SIGMAS,
                            "{smith:?} mu {mu} alpha {alpha}: {e:?}, truth {}, {z:.1} sigma",
                            t.value
                        );
                        assert!(e.error <= 1e-4, "{smith:?} mu {mu} alpha {alpha}: tolerance not reached: {e:?}");
                        (squares, n) = (squares + z * z, n + 1.0);
                    }
                }
            }
        }
    }
    // Honest means neither too small nor too large: the deviations have the size that the standard errors say.
    let rms = (squares / n).sqrt();
    assert!((0.7..1.3).contains(&rms), "deviations are {rms} standard errors in the root mean square");
}

#[test]
fn average_albedo_by_monte_carlo_agrees_with_quadrature() {
    for smith in Smith::ALL {
        for alpha in [1e-3, 0.03, 0.2, 0.5, 1.0] {
            let (e, t) = (average(alpha, smith, &random(3)), average(alpha, smith, &exact()));
            assert!((e.value - t.value).abs() < SIGMAS * e.error, "{smith:?} alpha {alpha}: {e:?}, truth {}", t.value);
        }
    }
}

#[test]
fn lambertian_reflects_all_by_both_witnesses() {
    let handle = quantity::find("lambert.albedo").expect("a quantity");
    for mu in [0.0, 0.3, 1.0] {
        let point = Point::default().with(Parameter::Mu, mu).expect("in the domain");
        for integration in [exact(), random(0)] {
            let e = handle.evaluate(&point, &Model::default(), &integration).expect("reached");
            assert!((e.value - 1.0).abs() <= e.error.max(1e-12), "mu {mu}: {e:?}");
        }
    }
}

#[test]
fn a_tolerance_out_of_reach_stops_with_the_best_value_and_its_error() {
    let impossible =
        Integration::new(Settings { tolerance: Some(1e-20), ..Settings::default() }).expect("valid settings");
    let handle = quantity::find("ggx.bias").expect("a quantity");
    let error = handle.evaluate(&at(0.5, 0.25), &Model::default(), &impossible).expect_err("1e-20 is out of reach");
    let text = error.to_string();
    assert!(text.contains("best value is 0.02") || text.contains("best value is 0.0"), "{text}");
    assert_eq!(error.exit_code(), 1);
}
