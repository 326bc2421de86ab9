//! Beckmann and sheen: analytic limits, bounds that hold, and both witnesses against each other.

use kiln::integrate::{Estimate, Integration, Integrator, Settings};
use kiln::model::charlie::Visibility;
use kiln::model::smith::Smith;
use kiln::table::quantity::{self, evaluate_family};
use kiln::table::{Model, Parameter, Point};

const EXACT_SMITH: [Smith; 2] = [Smith::Correlated, Smith::Separable];
/// 5 standard errors estimated from 32 replicates: one false alarm in 50,000 comparisons, of which each test makes below 2000.
const SIGMAS: f64 = 5.0;

fn at(values: &[(Parameter, f64)]) -> Point {
    values.iter().fold(Point::default(), |p, &(parameter, value)| p.with(parameter, value).expect("in the domain"))
}

fn direction(mu: f64, alpha: f64) -> Point {
    at(&[(Parameter::Mu, mu), (Parameter::Alpha, alpha)])
}

fn quadrature(tolerance: f64) -> Integration {
    Integration::new(Settings { tolerance: Some(tolerance), ..Settings::default() }).expect("valid settings")
}

fn random(seed: u64) -> Integration {
    let settings = Settings { integrator: Integrator::MonteCarlo, seed, ..Settings::default() };
    Integration::new(settings).expect("valid settings")
}

fn values(name: &str, point: &Point, model: &Model, integration: &Integration) -> Vec<Estimate> {
    evaluate_family(quantity::find(name).expect("a quantity").family, point, model, integration).expect("in the domain")
}

/// `n` values from 10^low to 1, even in the logarithm.
fn decades(low: f64, n: usize) -> Vec<f64> {
    (0..n).map(|i| 10.0_f64.powf(low * (1.0 - i as f64 / (n - 1) as f64))).collect()
}

fn smiths() -> Vec<Model> {
    EXACT_SMITH.into_iter().map(|smith| Model { smith, ..Model::default() }).collect()
}

fn visibilities() -> Vec<Model> {
    Visibility::ALL.into_iter().map(|visibility| Model { visibility, ..Model::default() }).collect()
}

/// The reported errors at coarse tolerances, and 1e-8 where it is asked for, against the finest rung.
fn bounds_hold(name: &str, models: &[Model], points: &[Point]) {
    for model in models {
        for point in points {
            let truth = values(name, point, model, &quadrature(1e-12));
            for tolerance in [1e-2, 1e-4, 1e-7, 1e-8] {
                for (e, t) in values(name, point, model, &quadrature(tolerance)).iter().zip(&truth) {
                    let off = (e.value - t.value).abs();
                    assert!(e.error <= tolerance, "{name} {model:?} {point:?}: {tolerance:e} not reached: {e:?}");
                    assert!(off <= e.error + t.error, "{name} {model:?} {point:?}: off by {off:e}, {e:?}, truth {t:?}");
                }
            }
        }
    }
}

fn witnesses_agree(name: &str, models: &[Model], points: &[Point]) {
    let (mut squares, mut n) = (0.0_f64, 0.0);
    for model in models {
        for point in points {
            let truth = values(name, point, model, &quadrature(1e-9));
            // Each with a seed of its own: values from the same points deviate alike, and their mean square says nothing.
            for (e, t) in values(name, point, model, &random(1 + n as u64)).iter().zip(truth) {
                let z = (e.value - t.value) / e.error;
                assert!(z.abs() < SIGMAS, "{name} {model:?} {point:?}: {e:?}, truth {}, {z:.1} sigma", t.value);
                (squares, n) = (squares + z * z, n + 1.0);
            }
        }
    }
    let rms = (squares / n).sqrt();
    assert!((0.6..1.4).contains(&rms), "{name}: deviations are {rms} standard errors in the root mean square of {n}");
}

fn identities_hold(name: &str, models: &[Model], points: &[Point]) -> usize {
    let family = quantity::find(name).expect("a quantity").family;
    let mut n = 0;
    for model in models {
        for point in points {
            let known = family.identities(point, model);
            if known.is_empty() {
                continue;
            }
            let estimates = values(name, point, model, &quadrature(1e-12));
            for identity in known {
                let e = estimates[identity.quantity];
                let off = (e.value - identity.value).abs();
                assert!(
                    off <= e.error + identity.slack,
                    "{model:?} {point:?}, {}: off by {off:e}, {e:?}",
                    identity.fact
                );
                n += 1;
            }
        }
    }
    n
}

fn grid(mus: &[f64], alphas: &[f64]) -> Vec<Point> {
    mus.iter().flat_map(|&mu| alphas.iter().map(move |&alpha| direction(mu, alpha))).collect()
}

fn widths(alphas: &[f64]) -> Vec<Point> {
    alphas.iter().map(|&alpha| at(&[(Parameter::Alpha, alpha)])).collect()
}

#[test]
fn beckmann_quadrature_bounds_hold() {
    let mus: Vec<f64> = decades(-3.0, 13).into_iter().chain([0.0]).collect();
    bounds_hold("beckmann.scale", &smiths(), &grid(&mus, &decades(-3.0, 13)));
}

#[test]
fn beckmann_witnesses_agree() {
    witnesses_agree("beckmann.scale", &smiths(), &grid(&decades(-3.0, 7), &decades(-3.0, 7)));
}

#[test]
fn beckmann_averages_of_both_witnesses_agree() {
    witnesses_agree("beckmann.albedo_avg", &smiths(), &widths(&[1e-3, 0.03, 0.1, 0.2, 0.5, 0.7, 1.0]));
    bounds_hold("beckmann.albedo_avg", &smiths(), &widths(&[1e-3, 0.2, 1.0]));
}

#[test]
fn beckmann_identities_hold() {
    let mut points = grid(&[0.0], &decades(-3.0, 7));
    for mu in decades(-3.0, 10) {
        points.extend(decades(-3.0, 10).into_iter().map(|ratio| direction(mu, 0.01 * mu * ratio)));
    }
    let n = identities_hold("beckmann.scale", &smiths(), &points);
    assert!(n > 600, "{n} identities");
}

#[test]
fn beckmann_reflects_at_most_what_comes_in() {
    for model in smiths() {
        for point in grid(&decades(-3.0, 12), &decades(-3.0, 12)) {
            let got = values("beckmann.scale", &point, &model, &quadrature(1e-9));
            for e in &got {
                assert!(e.value >= -e.error && e.value <= 1.0 + e.error, "{model:?} {point:?}: {e:?}");
            }
            let sum = got[0].value + got[1].value;
            assert!((sum - got[2].value).abs() < 1e-12, "{model:?} {point:?}: scale + bias = {sum}, E = {:?}", got[2]);
        }
    }
}

#[test]
fn charlie_quadrature_bounds_hold() {
    bounds_hold("charlie.albedo", &visibilities(), &grid(&decades(-3.0, 7), &decades(-3.0, 7)));
}

#[test]
fn charlie_witnesses_agree() {
    witnesses_agree("charlie.albedo", &visibilities(), &grid(&decades(-2.0, 7), &decades(-2.0, 7)));
}

#[test]
fn charlie_averages_of_both_witnesses_agree() {
    witnesses_agree("charlie.albedo_avg", &visibilities(), &widths(&[0.03, 0.1, 0.2, 0.5, 1.0]));
}

#[test]
fn charlie_identities_hold() {
    let n = identities_hold("charlie.albedo", &visibilities(), &grid(&[0.0, 1.0], &decades(-3.0, 12))[..12]);
    let m = identities_hold("charlie.albedo", &visibilities(), &grid(&[1.0], &decades(-3.0, 12)));
    assert_eq!((n, m), (12, 12));
}

#[test]
fn charlie_exceeds_one_at_grazing_and_tends_to_nothing_elsewhere() {
    for model in visibilities() {
        let e = |mu, alpha| values("charlie.albedo", &direction(mu, alpha), &model, &quadrature(1e-7))[0].value;
        let highest = grid(&decades(-3.0, 13), &decades(-2.0, 9))
            .iter()
            .map(|p| values("charlie.albedo", p, &model, &quadrature(1e-4))[0].value)
            .fold(0.0, f64::max);
        if model.visibility == Visibility::Neubelt {
            assert!(highest > 1.0, "{model:?}: highest albedo {highest}");
        }
        assert!(e(0.5, 1e-3) < 1e-9, "{model:?}");
    }
}
