//! Refining a rule until two neighbours agree, for integrands whose singularities are known.

use super::Estimate;
use crate::math::quadrature::GradedRules;
use std::sync::LazyLock;

/// Accuracies e^(−digits), coarse to fine; the rules are computed when first used.
static RULES: LazyLock<Vec<GradedRules>> =
    LazyLock::new(|| [12.0, 18.0, 25.0, 32.0, 40.0, 50.0].map(GradedRules::new).into());

/// What the difference of two rungs is multiplied with to be a bound. Convergence is geometric, so the finer value is far better
/// than the difference; only where both agree by chance is it not, and tests scan for that.
const SAFETY: f64 = 4.0;

/// Relative rounding error of a sum of a few hundred terms, each good to a few ulp.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Climbs until two neighbouring rungs agree to `tolerance`: the finer values with their bounds.
pub fn climb<const K: usize>(tolerance: f64, integral: impl Fn(&GradedRules) -> [f64; K]) -> [Estimate; K] {
    let start = RULES.iter().position(|r| (-r.digits()).exp() <= tolerance).unwrap_or(RULES.len()).min(RULES.len() - 2);
    let mut coarse = integral(&RULES[start]);
    let mut best = coarse.map(|v| Estimate::bound(v, f64::INFINITY));
    for rules in &RULES[start + 1..] {
        let fine = integral(rules);
        // One component may agree by chance: the largest difference speaks for all.
        let difference = fine.iter().zip(coarse).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        for (b, v) in best.iter_mut().zip(fine) {
            let error = SAFETY * difference + ROUNDING * v.abs();
            if error < b.error {
                *b = Estimate::bound(v, error);
            }
        }
        if best.iter().all(|e| e.error <= tolerance) {
            break;
        }
        coarse = fine;
    }
    best
}

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
            // A singularity at the end itself is resolved down to the smallest scale that a rule has.
            let rule = rules.at_scale((nearest(end) / half).max(f64::MIN_POSITIVE));
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
