//! Integrals over the cosine, for integrands whose singularities are known.

use super::Estimate;
use super::quadrature::climb_rules as climb;
use crate::math::quadrature::GradedRules;

/// ∫₀¹ f(x) dx where f is analytic but for branch points or poles at ± the given complex numbers (real part ≥ 0) and their
/// conjugates: panels end where a singularity is nearest, and are graded to it from both sides.
pub fn between_singularities(rules: &GradedRules, singularities: &[(f64, f64)], f: impl Fn(f64) -> f64) -> f64 {
    let mut ends = vec![0.0, 1.0];
    ends.extend(singularities.iter().map(|s| s.0).filter(|x| (0.0..1.0).contains(x)));
    ends.sort_by(f64::total_cmp);
    let nearest = |x: f64| {
        singularities.iter().map(|(re, im)| (x - re).hypot(*im).min((x + re).hypot(*im))).fold(f64::INFINITY, f64::min)
    };
    let mut sum = 0.0;
    for panel in ends.windows(2) {
        let half = 0.5 * (panel[1] - panel[0]);
        if half <= 0.0 {
            continue;
        }
        for (end, sign) in [(panel[0], 1.0), (panel[1], -1.0)] {
            let rule = rules.at_scale(nearest(end) / half);
            sum += half * rule.iter().map(|(x, w)| w * f(end + sign * half * x)).sum::<f64>();
        }
    }
    sum
}

/// ∫₀¹ f(mu, tolerance) dmu for an `f` that is itself integrated, and that varies at the horizon as a microfacet lobe of width
/// `alpha` does.
pub fn over_cosine(tolerance: f64, alpha: f64, f: impl Fn(f64, f64) -> f64) -> Estimate {
    climb(tolerance, |rules| {
        let inner = (-rules.digits()).exp().max(FINEST);
        [rules.at_scale(HORIZON * alpha).integrate(|mu| f(mu, inner))]
    })[0]
}

/// How far below alpha an average must resolve the horizon: the non-analytic part of mu·E at mu = 0 is of third order.
const HORIZON: f64 = 1e-4;

/// The finest tolerance that inner integrals are asked for.
const FINEST: f64 = 1e-12;
