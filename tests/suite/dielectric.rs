//! Rough dielectrics: analytic limits, reciprocity, bounds that hold, and every witness against the others.

use glam::DVec3;
use kiln::integrate::{Estimate, Integration, Integrator, Settings};
use kiln::math::frame::direction_with_cosine;
use kiln::math::quadrature::GradedRules;
use kiln::math::sobol::PointSet;
use kiln::model::dielectric::{Dielectric, reflectance, refracted_cosine};
use kiln::model::ggx::Ggx;
use kiln::model::smith::Smith;
use kiln::table::quantity::{self, evaluate_family};
use kiln::table::{Model, Parameter, Point};
use std::f64::consts::TAU;

const SMITH: [Smith; 3] = [Smith::Correlated, Smith::Separable, Smith::Beta];
const ETAS: [f64; 7] = [0.25, 1.0 / 1.5, 0.95, 1.0, 1.05, 1.5, 4.0];
/// 5 standard errors estimated from 32 replicates: one false alarm in 50,000 comparisons, of which 1100 are made.
const SIGMAS: f64 = 5.0;

fn exact(tolerance: f64) -> Integration {
    Integration::new(Settings { tolerance: Some(tolerance), ..Settings::default() }).expect("valid settings")
}

fn random(seed: u64) -> Integration {
    let settings = Settings { integrator: Integrator::MonteCarlo, seed, ..Settings::default() };
    Integration::new(settings).expect("valid settings")
}

/// [reflectance, transmittance, albedo], averages without `mu`.
fn scattering(mu: Option<f64>, alpha: f64, eta: f64, smith: Smith, integration: &Integration) -> Vec<Estimate> {
    let mut point = Point::default()
        .with(Parameter::Alpha, alpha)
        .and_then(|p| p.with(Parameter::Eta, eta))
        .expect("in the domain");
    let name = if mu.is_some() { "dielectric.albedo" } else { "dielectric.albedo_avg" };
    if let Some(mu) = mu {
        point = point.with(Parameter::Mu, mu).expect("in the domain");
    }
    let family = quantity::find(name).expect("a quantity").family;
    evaluate_family(family, &point, &Model { smith, ..Model::default() }, integration).expect("in the domain")
}

fn decades(low: f64, n: usize) -> Vec<f64> {
    (0..n).map(|i| 10.0_f64.powf(low * (1.0 - i as f64 / (n - 1) as f64))).collect()
}

#[test]
fn reflectance_of_smooth_glass_is_fresnel() {
    for eta in [1.5_f64, 1.0 / 1.5, 4.0, 0.25] {
        let f0 = ((eta - 1.0_f64) / (eta + 1.0)).powi(2);
        assert!((reflectance(1.0, eta) - f0).abs() < 1e-15, "eta {eta}");
        assert_eq!(reflectance(0.0, eta), 1.0, "eta {eta}");
        // From the other side of the same ray as much is reflected.
        for mu in [0.9, 0.99, 1.0] {
            if let Some(mu_t) = refracted_cosine(mu, eta) {
                let back = reflectance(mu_t, 1.0 / eta);
                assert!((back - reflectance(mu, eta)).abs() < 1e-13, "eta {eta}, mu {mu}: {back}");
            }
        }
    }
}

#[test]
fn narrow_facets_are_a_smooth_interface() {
    for smith in SMITH {
        for eta in [0.5, 1.0 / 1.5, 1.5, 3.0] {
            for mu in [1.0, 0.95, 0.6, 0.3] {
                let f = reflectance(mu, eta);
                let got = scattering(Some(mu), 1e-5, eta, smith, &exact(1e-10));
                for (e, wanted) in got.iter().zip([f, 1.0 - f, 1.0]) {
                    assert!((e.value - wanted).abs() < 1e-6, "{smith:?} eta {eta} mu {mu}: {e:?}, wanted {wanted}");
                }
            }
        }
    }
}

#[test]
fn facets_that_refract_nothing_only_mask() {
    let family = quantity::find("dielectric.albedo").expect("a quantity").family;
    for smith in SMITH {
        for mu in decades(-3.0, 9) {
            for alpha in decades(-3.0, 9) {
                let point = [(Parameter::Mu, mu), (Parameter::Alpha, alpha), (Parameter::Eta, 1.0)]
                    .into_iter()
                    .fold(Point::default(), |p, (parameter, value)| p.with(parameter, value).expect("in the domain"));
                let known = family.identities(&point, &Model { smith, ..Model::default() });
                assert_eq!(known.len(), 2, "{point:?}");
                let got = scattering(Some(mu), alpha, 1.0, smith, &exact(1e-10));
                for identity in known {
                    let (e, off) = (got[identity.quantity], (got[identity.quantity].value - identity.value).abs());
                    assert!(
                        off <= identity.slack + e.error,
                        "{smith:?} {point:?} {}: off by {off:e}, {e:?}",
                        identity.fact
                    );
                }
            }
        }
    }
}

#[test]
fn quadrature_bounds_hold() {
    for smith in SMITH {
        for eta in ETAS {
            for mu in decades(-3.0, 6) {
                for alpha in decades(-3.0, 6) {
                    let truth = scattering(Some(mu), alpha, eta, smith, &exact(1e-10));
                    for tolerance in [1e-4, 1e-7, 1e-8] {
                        for (e, t) in scattering(Some(mu), alpha, eta, smith, &exact(tolerance)).iter().zip(&truth) {
                            let (off, place) =
                                ((e.value - t.value).abs(), format!("{smith:?} eta {eta} mu {mu} alpha {alpha}"));
                            assert!(e.error <= tolerance, "{place}: {tolerance:e} not reached: {e:?}");
                            assert!(off <= e.error + t.error, "{place}: off by {off:e}, {e:?}, truth {t:?}");
                            assert!(t.value >= -1e-10 && t.value <= 1.0 + 1e-10, "{place}: {t:?}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn witnesses_agree() {
    let (mut squares, mut n) = (0.0_f64, 0.0);
    for smith in SMITH {
        for eta in ETAS {
            for mu in decades(-3.0, 4) {
                for alpha in decades(-3.0, 4) {
                    let truth = scattering(Some(mu), alpha, eta, smith, &exact(1e-9));
                    for (e, t) in scattering(Some(mu), alpha, eta, smith, &random(2)).iter().zip(&truth) {
                        let z = (e.value - t.value) / e.error;
                        let place = format!("{smith:?} eta {eta} mu {mu} alpha {alpha}");
                        assert!(z.abs() < SIGMAS, "{place}: {e:?}, truth {}, {z:.1} sigma", t.value);
                        (squares, n) = (squares + z * z, n + 1.0);
                    }
                }
            }
        }
    }
    let rms = (squares / n).sqrt();
    assert!((0.6..1.4).contains(&rms), "deviations are {rms} standard errors in the root mean square");
}

#[test]
fn averages_reach_their_tolerance_and_their_bounds_hold() {
    let etas = [0.01, 0.4, 1.0 / 1.5, 0.9, 0.999, 1.0, 1.001, 1.1, 1.5, 2.5, 100.0];
    for smith in [Smith::Correlated, Smith::Beta] {
        for alpha in [1e-4, 0.1, 0.6, 1.0] {
            for eta in etas {
                let truth = scattering(None, alpha, eta, smith, &exact(1e-8));
                for tolerance in [1e-4, 1e-7] {
                    for (e, t) in scattering(None, alpha, eta, smith, &exact(tolerance)).iter().zip(&truth) {
                        let (off, place) = ((e.value - t.value).abs(), format!("{smith:?} alpha {alpha} eta {eta}"));
                        assert!(e.error <= tolerance, "{place}: {tolerance:e} not reached: {e:?}");
                        assert!(off <= e.error + t.error, "{place}: off by {off:e}, {e:?}, truth {t:?}");
                    }
                }
            }
        }
    }
}

/// 2 ∫ … mu dmu of the directional quantities, which are integrated along another road, and how far two gradings of it are apart.
fn average_of_directional(alpha: f64, eta: f64, smith: Smith) -> [(f64, f64); 2] {
    let rules = GradedRules::new(32.0);
    // From the denser side two things end within the interval: at the critical angle what refracts at a level facet, and at its
    // complement, whose cosine is eta, what the critical cone has of facets that stand upright.
    let mut ends = vec![0.0, 1.0];
    if eta < 1.0 {
        ends.extend([(1.0 - eta * eta).sqrt(), eta]);
        ends.sort_by(f64::total_cmp);
    }
    let by = |scale: f64| {
        let mut sum = [0.0; 2];
        for (low, high) in ends.windows(2).map(|pair| (pair[0], pair[1])) {
            let half = 0.5 * (high - low);
            for (x, w) in rules.at_scale(scale).iter() {
                for mu in [low + x * half, high - x * half] {
                    let e = scattering(Some(mu), alpha, eta, smith, &exact(INNER));
                    sum = [0, 1].map(|k| sum[k] + 2.0 * half * w * mu * e[k].value);
                }
            }
        }
        sum
    };
    let (coarse, fine) = (by(1e-3), by(1e-5));
    [0, 1].map(|k| (fine[k], (fine[k] - coarse[k]).abs()))
}

/// What the directional quantities are integrated to.
const INNER: f64 = 1e-8;

#[test]
fn averages_are_those_of_the_directional_quantities_on_both_sides_of_the_interface() {
    let cases = [
        (Smith::Correlated, 0.2, 1.5),
        (Smith::Correlated, 0.2, 1.0 / 1.5),
        (Smith::Beta, 1.0, 1.3),
        (Smith::Beta, 1.0, 1.0 / 1.3),
    ];
    for (smith, alpha, eta) in cases {
        let own = scattering(None, alpha, eta, smith, &exact(INNER));
        for (e, (wanted, unsure)) in own.iter().zip(average_of_directional(alpha, eta, smith)) {
            let (off, allowed) = ((e.value - wanted).abs(), e.error + INNER + unsure);
            assert!(off <= allowed, "{smith:?} alpha {alpha} eta {eta}: {e:?}, {wanted}: {off:e}, {allowed:e}");
            assert!(allowed < 2e-7, "{smith:?} alpha {alpha} eta {eta}: {allowed:e} says nothing");
        }
    }
}

#[test]
fn averages_of_no_interface_are_masking_alone() {
    for alpha in [0.01, 0.3, 1.0] {
        let [r, t, _] = scattering(None, alpha, 1.0, Smith::Correlated, &exact(1e-10))[..] else { panic!("three") };
        let rule = GradedRules::new(60.0);
        // T(mu) = (mu + l)/2l where wt = −wo.
        let wanted = rule.at_scale(1e-3 * alpha).integrate(|mu| {
            let l = (alpha * alpha * (1.0 - mu * mu) + mu * mu).sqrt();
            mu * (mu + l) / l
        });
        assert!(r.value == 0.0 && (t.value - wanted).abs() <= t.error, "alpha {alpha}: {t:?}, wanted {wanted}");
    }
}

#[test]
fn average_of_a_smooth_interface_is_reciprocal() {
    let n = 1.5;
    let [into, out] = [n, 1.0 / n].map(|eta| scattering(None, 0.0, eta, Smith::Correlated, &exact(1e-10))[1]);
    let off = (out.value * n * n - into.value).abs();
    assert!(off <= into.error + n * n * out.error, "off by {off:e}");
}

#[test]
fn averages_of_both_witnesses_agree() {
    for smith in SMITH {
        for (alpha, eta) in [(0.01, 1.5), (0.3, 0.5), (1.0, 1.5), (1.0, 0.9), (0.0, 0.7)] {
            let truth = scattering(None, alpha, eta, smith, &exact(1e-7));
            for (e, t) in scattering(None, alpha, eta, smith, &random(4)).iter().zip(&truth) {
                assert!(
                    (e.value - t.value).abs() < SIGMAS * e.error + t.error,
                    "{smith:?} {alpha} {eta}: {e:?}, {t:?}"
                );
            }
        }
    }
}

#[test]
fn btdf_is_reciprocal_over_eta_squared() {
    let points = PointSet::<4>::new(3, 0, 10_000);
    for smith in SMITH {
        for (alpha, eta) in [(0.1, 1.5), (0.5, 0.7), (1.0, 2.0)] {
            let interface = |eta| Dielectric { facets: Ggx::isotropic(alpha, smith), eta };
            for &[a, b, c, d] in points.points() {
                let (wo, wt) = (above(a, b), -above(c, d));
                let there = interface(eta).btdf(wo, wt).expect("a masking for both") / (eta * eta);
                let back = interface(1.0 / eta).btdf(-wt, -wo).expect("a masking for both");
                let off = (there - back).abs();
                assert!(off <= 1e-12 * there, "{smith:?} {alpha} {eta} {wo} {wt}: {there} and {back}");
            }
        }
    }
}

/// Even over the upper hemisphere.
fn above(z: f64, turn: f64) -> DVec3 {
    let (r, phi) = (((1.0 - z) * (1.0 + z)).sqrt(), TAU * turn);
    DVec3::new(r * phi.cos(), r * phi.sin(), z)
}

#[test]
fn bsdf_over_all_directions_is_reflectance_and_transmittance() {
    let integration =
        Integration::new(Settings { samples: Some(1 << 19), seed: 5, ..Settings::default() }).expect("valid");
    for smith in SMITH {
        for (mu, alpha, eta) in [(0.8, 0.5, 1.5), (0.3, 1.0, 0.7), (0.6, 0.6, 0.6), (0.1, 0.8, 2.5)] {
            let (interface, wo) = (Dielectric { facets: Ggx::isotropic(alpha, smith), eta }, direction_with_cosine(mu));
            let (got, _) = integration.points2.integrate(integration.stop(), |[z, turn]| {
                let w = above(z, turn);
                [interface.brdf(wo, w), interface.btdf(wo, -w).expect("a masking for both")].map(|f| TAU * f * z)
            });
            let truth = scattering(Some(mu), alpha, eta, smith, &exact(1e-8));
            for (e, t) in got.iter().zip(&truth) {
                let off = (e.value - t.value).abs();
                assert!(off < SIGMAS * e.error, "{smith:?} mu {mu} alpha {alpha} eta {eta}: {e:?}, truth {t:?}");
                assert!(e.error < 2e-3, "{smith:?} mu {mu} alpha {alpha} eta {eta}: {e:?} says nothing");
            }
        }
    }
}
