//! Fresnel reflectances: angles and limits that are known exactly, averages against closed forms and Monte Carlo.

use kiln::integrate::fresnel::{conductor_average, dielectric_average, schlick_under_cosine};
use kiln::integrate::{Integration, Integrator, Settings};
use kiln::math::quadrature::gauss_legendre;
use kiln::model::fresnel::{
    MU_82, conductor, dielectric, dielectric_amplitudes, dielectric_average_walsh, dielectric_polarised, eta_of_f0,
    f0_of_eta, f82_tint, schlick,
};
use kiln::table::quantity::{self, evaluate_family};
use kiln::table::{Model, Parameter, Point};

/// Relative indices on both sides of 1.
const ETAS: [f64; 12] = [0.1, 0.3, 0.66, 0.75, 0.99, 1.0 + 1e-9, 1.001, 1.33, 1.5, 2.4, 5.0, 10.0];

fn random(seed: u64) -> Integration {
    let settings = Settings { integrator: Integrator::MonteCarlo, seed, ..Settings::default() };
    Integration::new(settings).expect("valid settings")
}

fn point<const N: usize>(values: [(Parameter, f64); N]) -> Point {
    values.into_iter().fold(Point::default(), |at, (p, v)| at.with(p, v).expect("in the domain"))
}

#[test]
fn parallel_reflectance_vanishes_at_brewsters_angle() {
    for eta in ETAS {
        let mu = 1.0 / (1.0 + eta * eta).sqrt();
        let [parallel, perpendicular] =
            dielectric_amplitudes(mu, eta).expect("Brewster's angle is never beyond the critical one");
        // mu itself is off by an ulp, and r∥ has the slope (η² − 1)(η² + 1)/(2η⁴μ) there.
        let slope = ((eta.powi(4) - 1.0) / (2.0 * eta.powi(4) * mu)).abs();
        assert!(parallel.abs() <= (8.0 + slope) * f64::EPSILON, "eta {eta}: r∥ = {parallel:e}");
        assert!(eta == 1.0 || perpendicular != 0.0, "eta {eta}: r⊥ = {perpendicular:e}");
    }
}

#[test]
fn all_is_reflected_beyond_the_critical_angle_and_less_before() {
    for eta in ETAS.into_iter().filter(|&eta| eta < 1.0) {
        let critical = ((1.0 - eta) * (1.0 + eta)).sqrt();
        assert_eq!(dielectric(critical * (1.0 - 1e-15), eta), 1.0, "eta {eta}");
        let just_before = dielectric(critical * (1.0 + 1e-12), eta);
        // 1 − F rises as the square root of the distance, with a factor that grows as 1/η².
        assert!(just_before < 1.0 && just_before > 1.0 - 1e-5 / (eta * eta), "eta {eta}: {just_before}");
    }
}

#[test]
fn reflectance_at_normal_incidence_is_f0() {
    for eta in ETAS {
        let wanted = ((eta - 1.0) / (eta + 1.0)).powi(2);
        for got in [dielectric(1.0, eta), f0_of_eta(eta), conductor(1.0, eta, 0.0)] {
            assert!((got - wanted).abs() <= 8.0 * f64::EPSILON * wanted, "eta {eta}: got {got:e}, wanted {wanted:e}");
        }
    }
    for (n, k) in [(0.2, 3.9), (1.0, 1.0), (2.9, 3.1)] {
        let wanted = ((n - 1.0_f64).powi(2) + k * k) / ((n + 1.0_f64).powi(2) + k * k);
        assert!((conductor(1.0, n, k) - wanted).abs() < 1e-15, "n {n}, k {k}");
    }
}

#[test]
fn index_and_f0_are_each_others_inverse() {
    for eta in ETAS.into_iter().filter(|&eta| eta > 1.0) {
        let back = eta_of_f0(f0_of_eta(eta));
        assert!((back - eta).abs() <= 16.0 * f64::EPSILON * eta * eta, "{eta} came back as {back}");
    }
    assert!((eta_of_f0(0.04) - 1.5).abs() < 1e-15);
}

#[test]
fn conductor_without_absorption_is_the_dielectric() {
    for eta in ETAS {
        for i in 0..=1000 {
            let mu = f64::from(i) / 1000.0;
            let (a, b) = (conductor(mu, eta, 0.0), dielectric(mu, eta));
            assert!((a - b).abs() <= 64.0 * f64::EPSILON, "eta {eta}, mu {mu}: conductor {a}, dielectric {b}");
        }
    }
}

#[test]
fn reflectances_agree_with_the_textbook_formulas_and_stay_in_zero_to_one() {
    for i in 1..=200 {
        let mu = f64::from(i) / 200.0;
        for eta in [1.2_f64, 1.5, 3.0] {
            let g = (eta * eta - 1.0 + mu * mu).sqrt();
            let wanted = [((eta * eta * mu - g) / (eta * eta * mu + g)).powi(2), ((mu - g) / (mu + g)).powi(2)];
            for (got, wanted) in dielectric_polarised(mu, eta).into_iter().zip(wanted) {
                assert!((got - wanted).abs() < 1e-14, "eta {eta}, mu {mu}: got {got}, wanted {wanted}");
            }
        }
        for (n, k) in [(0.05, 0.5), (0.2, 3.9), (1.3, 7.4), (3.0, 0.1), (0.5, 1e-6), (20.0, 30.0)] {
            // a² and b² of w = a + ib, and both polarisations, as Lagarde writes them.
            let (s2, n2, k2) = (1.0 - mu * mu, n * n, k * k);
            let t0: f64 = n2 - k2 - s2;
            let a2b2 = (t0 * t0 + 4.0 * n2 * k2).sqrt();
            let a = (0.5 * (a2b2 + t0)).max(0.0).sqrt();
            let rs = (a2b2 + mu * mu - 2.0 * a * mu) / (a2b2 + mu * mu + 2.0 * a * mu);
            let t4 = s2 * s2 / (mu * mu);
            let t3 = 2.0 * a * s2 / mu;
            let rp = rs * (a2b2 - t3 + t4) / (a2b2 + t3 + t4);
            let (got, wanted) = (conductor(mu, n, k), 0.5 * (rs + rp));
            assert!((got - wanted).abs() < 1e-9, "n {n}, k {k}, mu {mu}: got {got}, wanted {wanted}");
            assert!((0.0..=1.0 + 1e-14).contains(&got), "n {n}, k {k}, mu {mu}: {got}");
        }
    }
}

#[test]
fn f82_is_the_stated_part_of_schlick_at_82_degrees_and_schlick_at_both_ends() {
    let mut lowest = f64::INFINITY;
    for f0 in [0.0, 0.04, 0.5, 1.0] {
        for f82 in [0.0, 0.3, 1.0] {
            let (got, wanted) = (f82_tint(f0, f82, MU_82), f82 * schlick(f0, MU_82));
            assert!((got - wanted).abs() < 4.0 * f64::EPSILON, "f0 {f0}, f82 {f82}: got {got}, wanted {wanted}");
            assert_eq!(f82_tint(f0, f82, 1.0), f0);
            assert_eq!(f82_tint(f0, f82, 0.0), 1.0);
            for i in 0..=1000 {
                lowest = lowest.min(f82_tint(f0, f82, f64::from(i) / 1000.0));
            }
        }
    }
    let (low, _) = quantity::find("fresnel.f82").expect("a quantity").quantity.bounds;
    assert!(lowest >= low && lowest < low + 1e-3, "lowest {lowest}, stated bound {low}");
}

#[test]
fn the_integrands_fast_fresnel_is_the_exact_one() {
    for eta in [0.3, 0.7, 1.0, 1.33, 1.5, 3.0] {
        for i in 0..=100 {
            let mu = f64::from(i) / 100.0;
            let (fast, exact) =
                (kiln::model::dielectric::reflectance(mu, eta), kiln::model::fresnel::dielectric(mu, eta));
            assert!((fast - exact).abs() < 1e-12, "eta {eta}, mu {mu}: {fast} and {exact}");
        }
    }
}

#[test]
fn dielectric_average_is_walshs_closed_form() {
    for eta in [1.05, 1.2, 1.33, 1.5, 2.0, 2.4, 4.0, 10.0] {
        let (got, wanted) = (dielectric_average(eta, 1e-15), dielectric_average_walsh(eta));
        let tolerance = got.error + 64.0 * f64::EPSILON * (1.0 + (eta - 1.0_f64).powi(-2));
        assert!((got.value - wanted).abs() < tolerance, "eta {eta}: got {got:?}, wanted {wanted}");
        // The ladder's floor for rounding, 2e-14 of the value.
        assert!(got.error <= 2e-14, "eta {eta}: {got:?}");
    }
}

#[test]
fn what_enters_on_average_leaves_times_the_square_of_the_index() {
    for eta in [1.0 + 1e-6, 1.1, 1.33, 1.5, 2.4, 8.0] {
        let (enters, leaves) =
            (1.0 - dielectric_average(eta, 1e-15).value, 1.0 - dielectric_average(1.0 / eta, 1e-15).value);
        let off = (leaves - enters / (eta * eta)).abs();
        assert!(off <= 4e-16, "eta {eta}: {leaves} and {enters}/η², off by {off:e}");
    }
}

#[test]
fn conductor_average_without_absorption_is_the_dielectric_average_on_both_sides_of_one() {
    // On the denser side this is a plain integral with its critical angle, on the other road a change of variables.
    for eta in ETAS {
        let (a, b) = (conductor_average(eta, 0.0, 1e-14), dielectric_average(eta, 1e-14));
        assert!((a.value - b.value).abs() <= a.error + b.error + 1e-14, "eta {eta}: {a:?} and {b:?}");
    }
}

#[test]
fn bounds_of_the_conductor_average_hold_over_the_whole_domain() {
    for n in [0.01, 0.05, 0.2, 0.5, 0.9, 0.999, 1.0, 1.5, 4.0, 20.0] {
        for k in [0.0, 1e-12, 1e-6, 1e-3, 0.03, 0.2, 0.999, 1.0, 1.7, 4.0, 30.0] {
            let truth = conductor_average(n, k, 1e-15);
            assert!(truth.error < 1e-12, "n {n}, k {k}: {truth:?}");
            for tolerance in [1e-4, 1e-7, 1e-10] {
                let e = conductor_average(n, k, tolerance);
                let off = (e.value - truth.value).abs();
                assert!(e.error <= tolerance && off <= e.error + truth.error, "n {n}, k {k}: {e:?}, truth {truth:?}");
            }
        }
    }
}

#[test]
fn schlick_under_a_cosine_is_a_plain_double_integral() {
    // Both directions graze the surface on opposite sides nowhere near mu = 1, where the weight is smooth: a tensor rule does.
    let rule = gauss_legendre(40);
    let mu = 1.0;
    let plain = rule.integrate(|mu_i| 2.0 * mu_i * (1.0 - (0.5 * (1.0 + mu * mu_i)).sqrt()).powi(5));
    let got = schlick_under_cosine(mu, 1e-14);
    assert!((got.value - plain).abs() < 1e-15 + got.error, "got {got:?}, wanted {plain}");
    for mu in [0.0, 1e-6, 1e-3, 0.1, 0.5, 0.9] {
        let truth = schlick_under_cosine(mu, 1e-15);
        for tolerance in [1e-4, 1e-7, 1e-10] {
            let e = schlick_under_cosine(mu, tolerance);
            assert!((e.value - truth.value).abs() <= e.error + truth.error, "mu {mu}: {e:?}, truth {truth:?}");
            assert!(e.error <= tolerance, "mu {mu}: {e:?}");
        }
    }
}

/// 5 standard errors estimated from 32 replicates: one false alarm in 50,000 comparisons, of which some 70 are made.
const SIGMAS: f64 = 5.0;

#[test]
fn averages_by_monte_carlo_agree_with_quadrature() {
    let mut points = vec![];
    for eta in ETAS {
        points.push(("fresnel.dielectric_avg", point([(Parameter::Eta, eta)])));
    }
    for f0 in [0.0, 0.04, 0.5, 1.0] {
        points.push(("fresnel.schlick_avg", point([(Parameter::F0, f0)])));
    }
    for n in [0.01, 0.2, 1.0, 2.5, 20.0] {
        for k in [0.0, 0.5, 3.0, 30.0] {
            points.push(("fresnel.conductor_avg", point([(Parameter::N, n), (Parameter::K, k)])));
        }
    }
    for (name, at) in points {
        let handle = quantity::find(name).expect("a quantity");
        let settings = Settings { tolerance: Some(1e-12), ..Settings::default() };
        let exact = Integration::new(settings).expect("valid settings");
        let truth = handle.evaluate(&at, &Model::default(), &exact).expect("reached");
        for seed in 0..2 {
            let e = handle.evaluate(&at, &Model::default(), &random(seed)).expect("reached");
            let off = (e.value - truth.value).abs();
            assert!(off <= SIGMAS * e.error + truth.error, "{name} {at:?}: {e:?}, truth {truth:?}");
        }
    }
}

#[test]
fn closed_forms_say_that_they_are_and_agree_with_what_is_known_of_them() {
    for mu in [0.0, 0.3, 1.0] {
        for (f0, eta, k) in [(0.0, 1.0, 0.0), (0.04, 1.5, 3.0), (1.0, 0.5, 0.0)] {
            let at = point([
                (Parameter::Mu, mu),
                (Parameter::F0, f0),
                (Parameter::F82, 1.0),
                (Parameter::Eta, eta),
                (Parameter::N, eta),
                (Parameter::K, k),
            ]);
            for handle in quantity::all().filter(|h| h.index == 0 && h.quantity.name.starts_with("fresnel.")) {
                let pointwise = !handle.quantity.name.ends_with("_avg");
                assert_eq!(handle.family.is_pointwise(), pointwise, "{handle:?}");
                let exact =
                    Integration::new(Settings { tolerance: Some(1e-12), ..Settings::default() }).expect("valid");
                let values = evaluate_family(handle.family, &at, &Model::default(), &exact).expect("in the domain");
                for known in handle.family.identities(&at, &Model::default()) {
                    let e = values[known.quantity];
                    let off = (e.value - known.value).abs();
                    assert!(
                        off <= known.slack + e.error + 1e-15,
                        "{handle:?} {at:?}, {}: {e:?}, off {off:e}",
                        known.fact
                    );
                }
            }
        }
    }
}

#[test]
fn an_axis_never_leaves_the_domain_of_its_parameter() {
    let axis = |p| kiln::table::Axis::new(p, 8).check();
    assert!(axis(Parameter::F0).is_ok());
    let error = axis(Parameter::Eta).expect_err("nobody knows where it ends").to_string();
    assert!(error.contains("give it a range, such as eta:16:1..3"), "{error}");
    let wide: kiln::table::Axis = "n:8:0.5..25".parse().expect("an axis");
    let error = wide.check().expect_err("n ends at 20").to_string();
    assert!(error.contains("leaves its domain [0.01, 20]"), "{error}");
}
