//! Quantities that single engines tabulate: against closed forms, limits, other quantities, and both witnesses against each other.

use kiln::integrate::{Estimate, Integration, Integrator, Settings, quadrature};
use kiln::math::quadrature::gauss_legendre;
use kiln::model::fresnel::{dielectric, f0_of_eta};
use kiln::model::ltc::Ltc;
use kiln::model::smith::Smith;
use kiln::table::parameter::cosine_about_critical;
use kiln::table::quantity::{self, evaluate_family};
use kiln::table::{Model, Parameter, Point};

/// 5 standard errors estimated from 32 replicates: one false alarm in 50,000 comparisons, of which fewer than 2000 are made.
const SIGMAS: f64 = 5.0;

fn at(values: &[(Parameter, f64)]) -> Point {
    values.iter().fold(Point::default(), |p, &(parameter, value)| p.with(parameter, value).expect("in the domain"))
}

fn by_quadrature(tolerance: f64) -> Integration {
    Integration::new(Settings { tolerance: Some(tolerance), ..Settings::default() }).expect("settings")
}

fn by_samples(samples: u64, seed: u64) -> Integration {
    let settings = Settings { integrator: Integrator::MonteCarlo, samples: Some(samples), seed, ..Settings::default() };
    Integration::new(settings).expect("settings")
}

fn values(name: &str, point: &Point, smith: Smith, integration: &Integration) -> Vec<Estimate> {
    let given = |p: Parameter| point.get(p).is_ok();
    let family = quantity::find_among(name, given).expect("a quantity").family;
    evaluate_family(family, point, &Model { smith, ..Model::default() }, integration).expect("in the domain")
}

/// Both witnesses, and the bounds of a coarse value, at every point.
fn agree(name: &str, smiths: &[Smith], points: &[Point]) {
    for (i, (point, &smith)) in points.iter().flat_map(|p| smiths.iter().map(move |s| (p, s))).enumerate() {
        let truth = values(name, point, smith, &by_quadrature(1e-9));
        let coarse = values(name, point, smith, &by_quadrature(1e-5));
        let drawn = values(name, point, smith, &by_samples(1 << 13, i as u64));
        for ((t, c), d) in truth.iter().zip(&coarse).zip(&drawn) {
            let place = format!("{name} at {point}, {smith:?}");
            assert!(t.error <= 1e-9, "{place}: {t:?}");
            assert!(c.error <= 1e-5 && (c.value - t.value).abs() <= c.error + t.error, "{place}: {c:?}, truth {t:?}");
            // What happens in fewer squares than there are points, none of them may see.
            let allowed = SIGMAS * d.error + t.error + 1.0 / 8192.0;
            assert!((d.value - t.value).abs() <= allowed, "{place}: drawn {d:?}, truth {t:?}");
        }
    }
}

fn grid(mus: &[f64], alphas: &[f64], rest: &[(Parameter, f64)]) -> Vec<Point> {
    let with = |mu, alpha, r: &(Parameter, f64)| at(&[(Parameter::Mu, mu), (Parameter::Alpha, alpha), *r]);
    let places = mus.iter().flat_map(|&mu| alphas.iter().map(move |&alpha| (mu, alpha)));
    places.flat_map(|(mu, alpha)| rest.iter().map(move |r| with(mu, alpha, r))).collect()
}

const MUS: [f64; 5] = [0.0, 0.01, 0.3, 0.8, 1.0];
const ALPHAS: [f64; 4] = [0.001, 0.1, 0.5, 1.0];

#[test]
fn powers_of_one_less_the_cosine_agree_and_five_is_the_split_sum() {
    let exponents = [0.357, 1.0, 2.5, 5.0, 70.0].map(|p| (Parameter::Exponent, p));
    agree("ggx.power_weight", &[Smith::Correlated, Smith::Separable], &grid(&MUS, &ALPHAS, &exponents));
    for point in grid(&MUS, &ALPHAS, &[(Parameter::Exponent, 5.0)]) {
        let five = values("ggx.power_weight", &point, Smith::Correlated, &by_quadrature(1e-9))[0];
        let split = values("ggx.scale", &point, Smith::Correlated, &by_quadrature(1e-10));
        let wanted = split[1].value / split[2].value;
        assert!((five.value - wanted).abs() <= five.error + 1e-9, "{point}: {five:?}, wanted {wanted}");
    }
}

#[test]
fn a_dielectric_s_own_weight_is_what_its_reflectance_is_made_of() {
    // On both sides of where F dips below F0, 2 + √3.
    let indices = [1.009, 1.5, 3.0, 4.5, 14.5].map(|eta| (Parameter::Eta, eta));
    agree("ggx.dielectric_weight", &[Smith::Correlated], &grid(&MUS, &ALPHAS, &indices));
    // Without a dip nothing is cut off, and R = E (F0 + (1 − F0) w).
    for point in grid(&MUS, &ALPHAS, &indices[..3]) {
        let integration = by_quadrature(1e-10);
        let weight = values("ggx.dielectric_weight", &point, Smith::Correlated, &integration)[0];
        let e = values("ggx.scale", &point, Smith::Correlated, &integration)[2].value;
        let reflected = values("dielectric.albedo", &point, Smith::Correlated, &integration)[0].value;
        let f0 = f0_of_eta(point.get(Parameter::Eta).expect("given"));
        let off = (e * (f0 + (1.0 - f0) * weight.value) - reflected).abs();
        assert!(off <= 4e-10, "{point}: off by {off:e}");
    }
}

#[test]
fn schlick_s_glass_agrees_on_both_sides_and_from_outside_reflects_as_the_split_sum_does() {
    let indices = [0.0, 0.4, 0.9, 1.0, 1.01, 1.5, 4.0, f64::INFINITY].map(|eta| (Parameter::Eta, eta));
    let smiths = [Smith::Correlated, Smith::Separable];
    agree("schlick-dielectric.scale", &smiths, &grid(&MUS, &ALPHAS, &indices));
    for point in grid(&MUS, &ALPHAS, &indices[3..]) {
        let glass = values("schlick-dielectric.scale", &point, Smith::Separable, &by_quadrature(1e-9));
        let split = values("ggx.scale", &point, Smith::Separable, &by_quadrature(1e-9));
        for (g, s) in glass.iter().zip(&split[..2]) {
            assert!((g.value - s.value).abs() <= g.error + s.error, "{point}: {g:?}, wanted {s:?}");
        }
    }
}

#[test]
fn schlick_s_narrow_facets_are_a_smooth_interface_and_from_inside_nothing_is_lost_at_total_reflection() {
    for (mu, eta) in [(0.9, 1.5), (0.4, 1.5), (0.95, 0.7), (0.3, 0.7)] {
        let point = |alpha| at(&[(Parameter::Mu, mu), (Parameter::Alpha, alpha), (Parameter::Eta, eta)]);
        let narrow = values("schlick-dielectric.scale", &point(1e-4), Smith::Correlated, &by_quadrature(1e-9));
        let smooth = values("schlick-dielectric.scale", &point(0.0), Smith::Correlated, &by_quadrature(1e-9));
        for (n, s) in narrow.iter().zip(&smooth) {
            // Of second order in alpha, and near grazing angles in alpha/mu.
            assert!((n.value - s.value).abs() < 200.0 * (1e-4_f64 / mu).powi(2), "mu {mu} eta {eta}: {n:?}, {s:?}");
        }
        let exact = dielectric(mu, eta);
        assert!((exact == 1.0) == (smooth[1].value == 1.0), "mu {mu} eta {eta}: {exact} and {smooth:?}");
    }
}

#[test]
fn the_place_about_the_critical_angle_is_a_cosine() {
    for eta in [0.0, 0.3, 0.7, 0.99, 1.0] {
        let critical = f64::sqrt(1.0 - eta * eta);
        for (t, wanted) in [(0.0, 0.0), (0.5, critical), (1.0, 1.0), (0.25, 0.5 * critical)] {
            assert!((cosine_about_critical(t, eta) - wanted).abs() < 1e-15, "{t} of {eta}");
        }
    }
    let (t, eta) = (0.65, 0.7);
    let mu = cosine_about_critical(t, eta);
    let rest = [(Parameter::Alpha, 0.3), (Parameter::Eta, eta)];
    let [place, cosine] = [(Parameter::Critical, t), (Parameter::Mu, mu)].map(|first| {
        let point = at(&[first, rest[0], rest[1]]);
        values("schlick-dielectric.transmittance", &point, Smith::Separable, &by_quadrature(1e-9))
    });
    assert_eq!(place, cosine);
}

#[test]
fn the_bias_of_the_sheen_seen_from_above_is_a_sum_in_one_variable() {
    // At mu = 1 the half-vector's cosine c is wo·h, V is 1/4, and dω_i = 4 c dω_h.
    for alpha in [0.05, 0.2, 0.5, 0.8, 1.0_f64] {
        let n = 1.0 / alpha;
        let least = std::f64::consts::FRAC_1_SQRT_2;
        let integrand = |x: f64| {
            // Denser towards c = 1, where (1 − c²)^(n/2) begins: 1 − c = (1 − 1/√2) x⁴.
            let below = (1.0 - least) * x.powi(4);
            let c = 1.0 - below;
            let slope = 4.0 * (1.0 - least) * x.powi(3);
            (below * (2.0 - below)).powf(0.5 * n) * (2.0 * c * c - 1.0) * below.powi(5) * c * slope
        };
        let wanted = (2.0 + n) * gauss_legendre(120).integrate(integrand);
        let point = at(&[(Parameter::Mu, 1.0), (Parameter::Alpha, alpha)]);
        let got = values("charlie.bias", &point, Smith::Correlated, &by_quadrature(1e-11))[1];
        assert!((got.value - wanted).abs() <= got.error + 1e-13, "alpha {alpha}: {got:?}, wanted {wanted}");
    }
}

#[test]
fn the_random_witness_finds_the_narrowest_lobe_on_the_horizon() {
    // There all entries in parts of m11 vanish, but none of the lobe's own: how near a fit is has to be said of the lobe.
    for (i, (mu, alpha)) in [(0.0, 1e-5), (0.0, 1e-3), (1e-4, 1e-5), (0.02, 1e-4)].into_iter().enumerate() {
        let point = at(&[(Parameter::Mu, mu), (Parameter::Alpha, alpha)]);
        let of = |integration: &Integration| values("ltc-lobe.m00", &point, Smith::Correlated, integration);
        for (t, d) in of(&by_quadrature(1e-7)).iter().zip(&of(&by_samples(1 << 13, i as u64))) {
            let allowed = SIGMAS * d.error + t.error;
            assert!(
                t.error <= 1e-7 && (d.value - t.value).abs() <= allowed,
                "mu {mu} alpha {alpha}: drawn {d:?}, truth {t:?}"
            );
        }
    }
    // So near to the horizon only the ratio of mu to alpha counts.
    let of = |mu: f64, alpha: f64| {
        values(
            "ltc-lobe.m00",
            &at(&[(Parameter::Mu, mu), (Parameter::Alpha, alpha)]),
            Smith::Correlated,
            &by_quadrature(1e-8),
        )[0]
        .value
    };
    let (narrow, narrower) = (of(1e-5, 1e-4), of(1e-6, 1e-5));
    assert!((narrow - narrower).abs() < 1e-3 * narrow, "{narrow}, {narrower}"); // to the order of alpha
}

#[test]
fn the_diffuse_lobe_for_area_lights_is_the_cosine_times_what_disney_makes_of_it() {
    let of = |mu: f64, roughness: f64| {
        let point = at(&[(Parameter::Mu, mu), (Parameter::Roughness, roughness)]);
        values("ltc-burley.m00", &point, Smith::Correlated, &by_quadrature(1e-9))
            .iter()
            .map(|e| e.value)
            .collect::<Vec<_>>()
    };
    let points: Vec<Point> = [(0.0, 1.0), (0.3, 0.5), (0.7, 0.0), (1.0, 0.8)]
        .iter()
        .map(|&(mu, roughness)| at(&[(Parameter::Mu, mu), (Parameter::Roughness, roughness)]))
        .collect();
    agree("ltc-burley.m00", &[Smith::Correlated], &points);
    // Without roughness the lobe does not know where it is seen from; with it, it leans back towards the eye.
    let [round, leaning] = [of(0.3, 0.0), of(0.3, 0.8)];
    assert!(round.iter().zip(of(1.0, 0.0)).all(|(a, b)| (a - b).abs() < 2e-9), "{round:?}");
    assert!((round[0] - round[3]).abs() < 2e-9 && round[1] == 0.0 && round[2] == 0.0, "{round:?}");
    assert!(leaning[1] < 0.0 && leaning[2] > 0.0, "{leaning:?}");
    // Unity's own table, of halves, and of a fit by another measure: at mu 1 it holds 1.0176 and 0.9712 at the ends of roughness.
    for (roughness, theirs) in [(0.0, 1.0176), (1.0, 0.9712)] {
        let ours = of(1.0, roughness)[0];
        assert!((ours - theirs).abs() < 0.002, "roughness {roughness}: {ours}, theirs {theirs}");
    }
}

#[test]
fn the_sheen_for_area_lights_is_one_lobe_by_both_witnesses() {
    let points: Vec<Point> = [(0.0, 0.5), (0.3, 0.01), (0.7, 0.3), (1.0, 0.05)]
        .iter()
        .map(|&(mu, alpha)| at(&[(Parameter::Mu, mu), (Parameter::Alpha, alpha)]))
        .collect();
    agree("ltc-charlie.m00", &[Smith::Correlated], &points);
}

#[test]
fn matrices_of_area_lights_in_every_scale_are_the_same_lobe() {
    for (mu, alpha) in [(0.0, 0.3), (0.05, 0.01), (0.4, 0.2), (0.9, 0.8), (1.0, 0.5)] {
        let point = at(&[(Parameter::Mu, mu), (Parameter::Alpha, alpha)]);
        let integration = by_quadrature(1e-7);
        let of = |name: &str| values(name, &point, Smith::Correlated, &integration);
        let [m11, m22, m00, lobe] = [of("ltc.m00"), of("ltc-m22.m00"), of("ltc-m00.m11"), of("ltc-lobe.m00")];
        // N of each, in parts of m11.
        let by = |[a, b, c, d, y]: [f64; 5]| [a, b, c, d].map(|entry| entry / y);
        let v = |e: &[Estimate], i: usize| e[i].value;
        let (a, b) = (v(&m22, 0), v(&m22, 1));
        let from_m22 = by([a, b, v(&m22, 2), 1.0, v(&m22, 3)]);
        let from_m00 = by([1.0, v(&m00, 0), v(&m00, 1), v(&m00, 3), v(&m00, 2)]);
        // The inverse of M: what the engine's shader computes of it.
        let [p, q, y, r, s] = std::array::from_fn(|i| v(&lobe, i));
        let scale = 1.0 / (p * s - q * r);
        let from_lobe = by([s * scale, -r * scale, -q * scale, p * scale, 1.0 / y]);
        for (entry, (one, other)) in [from_m22, from_m00, from_lobe]
            .iter()
            .flat_map(|m| m.iter().enumerate().map(|(i, x)| (i, (*x, v(&m11, i)))))
        {
            // Quotients and products of a few entries, the smallest of which is about alpha.
            let tolerance = 1e-6 * other.abs().max(1.0) / alpha;
            assert!((one - other).abs() <= tolerance, "mu {mu} alpha {alpha}, entry {entry}: {one} and {other}");
        }
        let ltc = Ltc { x: [v(&m11, 0), v(&m11, 1)], y: 1.0, z: [v(&m11, 2), v(&m11, 3)] };
        let distance = quadrature::ltc_distance(mu, quadrature::Surface::Ggx(alpha, Smith::Correlated), &ltc);
        assert!(distance.square < 0.5, "{distance:?}");
    }
}
