//! What values cost at the edges of the domain, in evaluations of the integrand: facts that do not depend on the machine.

use super::*;
use crate::math::quadrature::nodes_asked_for::during;
use crate::model::beckmann::Beckmann;
use crate::model::charlie::{Charlie, Visibility};
use crate::model::dielectric::Dielectric;
use crate::model::ggx::{Ggx, Smith};

const MUS: [f64; 7] = [0.0, 1e-4, 1e-3, 1e-2, 0.1, 0.5, 1.0];
const ALPHAS: [f64; 7] = [1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.5, 1.0];
/// On both sides of 1, near it and far from it.
const ETAS: [f64; 10] = [0.01, 0.4, 1.0 / 1.5, 0.9, 0.999, 1.0, 1.001, 1.1, 1.5, 2.5];
const TOLERANCE: f64 = 1e-7;

/// What the finest rules are graded to, in parts of their interval: alpha of 1e-5 at 1e-4.
const FINEST: f64 = 1e-9;

/// By how much a rule that is graded to `scale` of its interval is longer than one that is graded to a tenth of it: the counts of
/// `graded` are as the reciprocals of asinh(π/asinh(1/scale)). It is 6.3 for 1e-9, and grows with the logarithm of the scale only.
fn per_dimension(scale: f64) -> f64 {
    let rate = |scale: f64| (std::f64::consts::PI / (1.0 / scale).asinh()).asinh();
    rate(0.1) / rate(scale)
}

/// The most that any value of the scan takes, which must stay below what a value in the middle takes times what grading to `finest`
/// adds in that many dimensions.
fn bounded(name: &str, (dimensions, finest): (i32, f64), middle: u64, scanned: impl Iterator<Item = (String, u64)>) {
    let (place, most) = scanned.max_by_key(|(_, count)| *count).expect("something is scanned");
    let limit = middle as f64 * per_dimension(finest).powi(dimensions);
    assert!(middle > 0, "{name}: nothing was counted");
    assert!(most as f64 <= limit, "{name}: {most} evaluations at {place}, {middle} in the middle, at most {limit:.0}");
}

fn places() -> impl Iterator<Item = (f64, f64)> {
    MUS.into_iter().flat_map(|mu| ALPHAS.map(|alpha| (mu, alpha)))
}

#[test]
fn sheen_takes_boundedly_many_evaluations_at_grazing_angles_and_for_upright_fibres() {
    for visibility in Visibility::ALL {
        let count = |mu: f64, alpha: f64| {
            during(|| {
                charlie_split(mu, &Charlie { alpha, visibility }, TOLERANCE);
            })
        };
        let there = places().filter(|(mu, _)| *mu > 0.0 || visibility == Visibility::Neubelt);
        let scanned = there.map(|(mu, alpha)| (format!("mu {mu:e} alpha {alpha:e}"), count(mu, alpha)));
        bounded(visibility.name(), (2, FINEST), count(0.5, 0.3), scanned);
    }
}

/// A cosine below all that makes a difference to where the integrand misbehaves: the limit, nearly.
const GRAZING: f64 = 1e-16;

#[test]
fn glass_takes_boundedly_many_evaluations_at_grazing_angles_and_where_it_is_polished() {
    for smith in [Smith::Correlated, Smith::Separable, Smith::Beta] {
        let at = |mu: f64, alpha: f64, eta: f64| {
            let interface = Dielectric { facets: Ggx::isotropic(alpha, smith), eta };
            let mut found = [Estimate::bound(f64::NAN, f64::NAN); 3];
            let count = during(|| found = dielectric_scattering(mu, &interface, TOLERANCE));
            let place = format!("{smith:?} mu {mu:e} alpha {alpha:e} eta {eta}");
            assert!(found.iter().all(|e| e.error <= TOLERANCE), "{place}: {found:?}");
            assert!(found.iter().all(|e| e.value >= -e.error && e.value <= 1.0 + e.error), "{place}: {found:?}");
            (place, count, found)
        };
        let scan = |mus: &[f64], finest: f64| {
            // At mu 0 and eta 1 the quantity is a limit, which is not integrated.
            let places = mus.iter().flat_map(|mu| ALPHAS.map(|alpha| (*mu, alpha)));
            let there =
                places.flat_map(|at| ETAS.map(|eta| (at, eta))).filter(|((mu, _), eta)| *mu > 0.0 || *eta != 1.0);
            let (_, middle, _) = at(0.5, 0.3, 1.5);
            let counts = there.map(|((mu, alpha), eta)| at(mu, alpha, eta)).map(|(place, count, _)| (place, count));
            bounded(smith.name(), (2, finest), middle, counts);
        };
        scan(&MUS, FINEST);
        // Cosines far below alpha take as long as those of its 1e-7th part, however small they are.
        scan(&[GRAZING, 1e-8], 1e-7 * ALPHAS[0]);
        if smith == Smith::Beta {
            continue; // tends to its limit more slowly than any power
        }
        for (alpha, eta) in
            ALPHAS.into_iter().flat_map(|alpha| ETAS.map(|eta| (alpha, eta))).filter(|(_, eta)| *eta != 1.0)
        {
            let ((place, _, limit), (_, _, near)) = (at(0.0, alpha, eta), at(GRAZING, alpha, eta));
            for (a, b) in limit.iter().zip(near) {
                // G2 is another in a layer of the width of mu, in parts of alpha, and falls off as its inverse.
                let layer = GRAZING / alpha * (alpha / GRAZING).ln();
                let allowed = a.error + b.error + layer;
                assert!((a.value - b.value).abs() <= allowed, "{place}: {a:?} at 0, {b:?} at {GRAZING:e}, {allowed:e}");
            }
        }
    }
}

#[test]
fn averages_take_boundedly_many_evaluations_where_the_surface_is_polished() {
    for smith in [Smith::Correlated, Smith::Beta] {
        let glass = |alpha: f64, eta: f64| {
            let interface = Dielectric { facets: Ggx::isotropic(alpha, smith), eta };
            during(|| {
                dielectric_scattering_average(&interface, TOLERANCE);
            })
        };
        let scanned = ALPHAS
            .into_iter()
            .flat_map(|alpha| ETAS.map(|eta| (format!("alpha {alpha:e} eta {eta}"), glass(alpha, eta))));
        bounded(&format!("average of glass, {}", smith.name()), (3, FINEST), glass(0.3, 1.5), scanned);
    }
    /// Name, dimensions, what computes it at an alpha.
    type Average<'a> = (&'a str, i32, &'a dyn Fn(f64));
    let families: [Average; 3] = [
        ("GGX", 2, &|alpha| {
            ggx_albedo_average(alpha, Smith::Correlated, TOLERANCE);
        }),
        ("Beckmann", 3, &|alpha| {
            beckmann_albedo_average(&Beckmann { alpha, smith: Smith::Correlated }, TOLERANCE);
        }),
        ("sheen", 3, &|alpha| {
            charlie_albedo_average(&Charlie { alpha, visibility: Visibility::Neubelt }, TOLERANCE);
        }),
    ];
    for (name, dimensions, average) in families {
        let count = |alpha: f64| during(|| average(alpha));
        let scanned = ALPHAS.into_iter().map(|alpha| (format!("alpha {alpha:e}"), count(alpha)));
        bounded(&format!("average of {name}"), (dimensions, FINEST), count(0.3), scanned);
    }
}

#[test]
fn counting_counts() {
    let rules = GradedRules::new(14.0);
    let nodes = rules.at_scale(0.01).nodes.len() as u64;
    assert_eq!(during(|| (0..3).for_each(|_| assert!(rules.at_scale(0.01).integrate(|x| x) > 0.0))), 3 * nodes);
}
