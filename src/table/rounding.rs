//! Certified rounding: integrating again, more finely, the texels whose packed value is not decided.

use super::bake::{Evaluator, Table};
use crate::error::Result;
use crate::integrate::{ErrorKind, Estimate, Integration, Settings};
use crate::pack::{Number, TexelFormat};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How many values of a table are known to be the right ones of their number format.
///
/// For an f32 that is one within an ulp, or within 1e-8 where that is more; for every other number (halves, unorm, the floats of 11 and 10
/// bits) it is the nearest one: all of [value − error, value + error] rounds to it. Values by Monte Carlo are not counted: nothing bounds their errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rounding {
    /// Values that are right.
    pub certified: u64,
    /// Values that the finest rule does not decide.
    pub undecided: u64,
    /// Values that were integrated again to be decided.
    pub refined: u64,
}

impl Rounding {
    fn merge(self, other: Self) -> Self {
        Self {
            certified: self.certified + other.certified,
            undecided: self.undecided + other.undecided,
            refined: self.refined + other.refined,
        }
    }
}

/// What an f32 may be off by where its ulp is smaller.
const F32_ERROR: f64 = 1e-8;
/// By how much the tolerance shrinks from one attempt to the next: what asks for one rule more, since every rule is better by far
/// than the one before.
const STEP: f64 = 1.0 / 8.0;
/// Attempts at most: from 1e-7 they lead beyond what f64 holds.
const ATTEMPTS: usize = 10;

/// Whether it is decided what `value` becomes.
fn is_decided(format: TexelFormat, channel: usize, value: f64, error: f64) -> bool {
    match format.number() {
        Some(Number::F32) => {
            let ulp = Number::F32.ulp(value);
            error + 0.5 * ulp <= ulp.max(F32_ERROR)
        }
        _ => format.rounds_alike(channel, value - error, value + error),
    }
}

/// Integrates until every value's rounding is decided, or a finer rule no longer makes it surer.
///
/// Where channels are not rounded on their own, nothing is done.
///
/// **Errors**: those of the integrator.
pub fn decide(table: &mut Table, format: TexelFormat, integration: &Integration) -> Result<Rounding> {
    if !format.is_per_channel() {
        return Ok(Rounding::default());
    }
    let spec = table.spec.clone();
    let kinds = table.kinds.clone();
    let bounded: Vec<bool> = kinds.iter().map(|&kind| kind == ErrorKind::Bound).collect();
    let evaluator = spec.evaluator_of(|handle| handle.error_kind(integration) == ErrorKind::Bound);
    let n = spec.channels.len();
    table
        .values
        .par_chunks_mut(n)
        .zip(table.errors.par_chunks_mut(n))
        .enumerate()
        .map(|(texel, (values, errors))| {
            let at = spec.point(texel);
            let finer = |tolerance| evaluate(&evaluator, &at, integration, tolerance);
            decide_texel(format, &bounded, values, errors, finer)
        })
        .try_reduce(Rounding::default, |a, b| Ok(a.merge(b)))
}

fn evaluate(
    evaluator: &Evaluator,
    at: &super::Point,
    integration: &Integration,
    tolerance: f64,
) -> Result<Vec<Estimate>> {
    let settings = Settings { tolerance: Some(tolerance), ..integration.settings };
    evaluator.at(at, &Integration::new(settings)?)
}

fn decide_texel(
    format: TexelFormat,
    bounded: &[bool],
    values: &mut [f64],
    errors: &mut [f64],
    finer: impl Fn(f64) -> Result<Vec<Estimate>>,
) -> Result<Rounding> {
    let open = |values: &[f64], errors: &[f64]| -> Vec<usize> {
        (0..values.len()).filter(|&c| bounded[c] && !is_decided(format, c, values[c], errors[c])).collect()
    };
    let first = open(values, errors);
    let mut left = first.clone();
    let mut tolerance = left.iter().map(|&c| errors[c]).fold(f64::INFINITY, f64::min);
    for _ in 0..ATTEMPTS {
        if left.is_empty() {
            break;
        }
        tolerance = left.iter().map(|&c| errors[c]).fold(tolerance, f64::min) * STEP;
        for (c, estimate) in finer(tolerance)?.into_iter().enumerate() {
            if bounded[c] && estimate.error < errors[c] {
                (values[c], errors[c]) = (estimate.value, estimate.error);
            }
        }
        left = open(values, errors);
    }
    let n_bounded = bounded.iter().filter(|b| **b).count() as u64;
    Ok(Rounding { certified: n_bounded - left.len() as u64, undecided: left.len() as u64, refined: first.len() as u64 })
}

#[cfg(test)]
mod tests {
    use super::*;

    const F16: TexelFormat = TexelFormat::Plain { channels: 2, number: Number::F16 };
    const F32: TexelFormat = TexelFormat::Plain { channels: 2, number: Number::F32 };

    #[test]
    fn a_half_is_decided_where_no_tie_lies_within_the_error() {
        let tie = 0.5 + 0.5 * 2.0_f64.powi(-11); // between 0.5 and the next half
        assert!(!is_decided(F16, 0, tie + 1e-9, 2e-9));
        assert!(is_decided(F16, 0, tie + 1e-9, 0.5e-9));
        assert!(is_decided(F16, 0, 0.5, 1e-5) && is_decided(F16, 0, 0.3, 0.0));
        assert!(is_decided(F16, 0, 1e-30, 1e-20), "next to nothing is 0, on whichever side the error reaches to");
    }

    #[test]
    fn an_f32_is_decided_within_an_ulp_or_1e_8() {
        let ulp = Number::F32.ulp(0.7);
        assert!(is_decided(F32, 0, 0.7, 0.5 * ulp) && !is_decided(F32, 0, 0.7, 0.51 * ulp));
        assert!(is_decided(F32, 0, 1e-4, 0.9e-8) && !is_decided(F32, 0, 1e-4, 1.1e-8));
    }

    #[test]
    fn a_texel_beside_a_tie_is_integrated_until_it_is_decided() {
        let truth = 0.5 + 0.5 * 2.0_f64.powi(-11) - 1e-12;
        let (mut values, mut errors) = ([truth + 0.7e-7, 0.25], [1e-7, 1e-7]);
        let finer = |tolerance: f64| Ok(vec![Estimate::bound(truth + 0.7 * tolerance, tolerance); 2]);
        let found = decide_texel(F16, &[true, false], &mut values, &mut errors, finer).unwrap();
        assert_eq!(found, Rounding { certified: 1, undecided: 0, refined: 1 });
        assert!((values[0] - truth).abs() <= errors[0] && errors[0] < 1e-12, "{}", errors[0]);
        assert_eq!(values[1], 0.25, "a value by Monte Carlo stays");
    }

    #[test]
    fn what_no_rule_decides_is_counted() {
        let tie = 0.5 + 0.5 * 2.0_f64.powi(-11);
        let (mut values, mut errors) = ([tie], [1e-7]);
        let finer = |_| Ok(vec![Estimate::bound(tie, 1e-10)]);
        let found = decide_texel(F16, &[true], &mut values, &mut errors, finer).unwrap();
        assert_eq!((found.undecided, found.certified), (1, 0));
    }
}
