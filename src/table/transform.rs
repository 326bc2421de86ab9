//! What becomes of a quantity before it is packed: the affine and other changes that an engine's shader undoes.
//!
//! A channel is written `QUANTITY[:STEP]…`, the steps from left to right:
//!
//! | step | makes of y |
//! | --- | --- |
//! | `+N`, `-N` | y + N, y − N |
//! | `*N`, `/N` | y N, y / N |
//! | `y/(1+y)` | y/(1 + y), which holds a quantity without upper bound in [0, 1) |
//! | `min(y,1)` | y, and 1 where y is larger: what a unorm texture makes of it, said rather than left to the packing |
//!
//! `burley.albedo:/1.03571:-0.5` is Unity's diffuse channel, `charlie.albedo:y/(1+y)` its cloth.

use crate::error::{Error, Result};
use crate::integrate::Estimate;
use crate::math::expression::Expression;
use std::fmt;
use std::str::FromStr;

/// Steps at most; enough for every engine that was read.
const MOST_STEPS: usize = 3;

/// A rising or falling function of one value; none at all unless told otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Transform {
    steps: [Option<Step>; MOST_STEPS],
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    Add(f64),
    Multiply(f64),
    Divide(f64),
    Squash,
    AtMostOne,
}

impl Step {
    fn apply(self, y: f64) -> f64 {
        match self {
            Self::Add(n) => y + n,
            Self::Multiply(n) => y * n,
            Self::Divide(n) => y / n,
            Self::Squash if y == f64::INFINITY => 1.0,
            Self::Squash => y / (1.0 + y),
            Self::AtMostOne if y > 1.0 => 1.0,
            Self::AtMostOne => y,
        }
    }

    /// The inverse; of [`Step::AtMostOne`], as far as there is one.
    fn undo(self, y: f64) -> f64 {
        match self {
            Self::Add(n) => y - n,
            Self::Multiply(n) => y / n,
            Self::Divide(n) => y * n,
            Self::Squash => y / (1.0 - y),
            Self::AtMostOne => y,
        }
    }

    /// The same in a shader, which has no infinity to divide by 0 for.
    fn undone(self, y: Expression) -> Expression {
        /// The least difference of 1 and an f32 below it.
        const LEAST: f64 = f32::EPSILON as f64 / 2.0;
        /// More than any difference.
        const FAR: f64 = 1e30;
        match self {
            Self::Add(n) => y - n,
            // By a factor, and not by a quotient, which shaders round more coarsely.
            Self::Multiply(n) => y * (1.0 / n),
            Self::Divide(n) => y * n,
            Self::Squash => y.clone() / (Expression::from(1.0) - y).clamp(LEAST, FAR),
            Self::AtMostOne => y,
        }
    }

    /// By how much the step stretches an interval at most that lies within `error` of `y`.
    fn slope(self, y: f64, error: f64) -> f64 {
        match self {
            Self::Add(_) | Self::AtMostOne => 1.0,
            Self::Multiply(n) => n.abs(),
            Self::Divide(n) => 1.0 / n.abs(),
            // 1/(1 + y)², largest where y is smallest; quantities are not below 0.
            Self::Squash => (1.0 + (y - error).max(0.0)).powi(-2),
        }
    }

    fn falls(self) -> bool {
        matches!(self, Self::Multiply(n) | Self::Divide(n) if n < 0.0)
    }
}

impl Transform {
    /// Whether it changes nothing.
    pub fn is_identity(&self) -> bool {
        self.steps().next().is_none()
    }

    fn steps(&self) -> impl DoubleEndedIterator<Item = Step> + '_ {
        self.steps.iter().copied().flatten()
    }

    /// Whether a larger value comes out smaller.
    pub fn falls(&self) -> bool {
        self.steps().filter(|step| step.falls()).count() % 2 == 1
    }

    /// What becomes of `y`.
    pub fn apply(&self, y: f64) -> f64 {
        self.steps().fold(y, |y, step| step.apply(y))
    }

    /// The value that became `y`: what a shader computes.
    pub fn undo(&self, y: f64) -> f64 {
        self.steps().rev().fold(y, |y, step| step.undo(y))
    }

    /// [`Transform::undo`] as shader code; a quantity without bound comes out as 2²⁴ where it was infinite.
    pub fn undone(&self, y: Expression) -> Expression {
        self.steps().rev().fold(y, |y, step| step.undone(y))
    }

    /// Whether a step loses what is beyond it, so that it cannot be undone there.
    pub fn limits(&self) -> bool {
        self.steps().any(|step| step == Step::AtMostOne)
    }

    /// By how many times an error may grow on the way: what makes a tolerance of the changed value one of the value.
    pub fn stretch(&self) -> f64 {
        // 0 is where the slope of y/(1 + y) is largest.
        self.steps().map(|step| step.slope(0.0, 0.0)).product::<f64>().max(1.0)
    }

    /// The estimate of the changed value, its error stretched as the value is, and widened by the rounding of each step.
    pub fn estimate(&self, mut estimate: Estimate) -> Estimate {
        for step in self.steps() {
            estimate.error *= step.slope(estimate.value, estimate.error);
            estimate.value = step.apply(estimate.value);
            if estimate.error > 0.0 {
                estimate.error += f64::EPSILON * estimate.value.abs();
            }
        }
        estimate
    }

    /// What becomes of an interval.
    pub fn interval(&self, (low, high): (f64, f64)) -> (f64, f64) {
        let (a, b) = (self.apply(low), self.apply(high));
        (a.min(b), a.max(b))
    }
}

/// `:/1.03571:-0.5`; nothing for the identity.
impl fmt::Display for Transform {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.steps().try_for_each(|step| match step {
            Step::Add(n) => write!(f, ":{n:+}"),
            Step::Multiply(n) => write!(f, ":*{n}"),
            Step::Divide(n) => write!(f, ":/{n}"),
            Step::Squash => f.write_str(":y/(1+y)"),
            Step::AtMostOne => f.write_str(":min(y,1)"),
        })
    }
}

/// The steps, without a colon before the first.
impl FromStr for Transform {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let mut transform = Self::default();
        for (place, part) in text.split(':').map(str::trim).enumerate() {
            let number = |rest: &str| rest.trim().parse::<f64>().ok().filter(|n| n.is_finite());
            let factor = |rest: &str| number(rest).filter(|n| *n != 0.0);
            let step = match part.split_at_checked(1) {
                _ if part == "y/(1+y)" => Some(Step::Squash),
                _ if part == "min(y,1)" => Some(Step::AtMostOne),
                Some(("+", rest)) => number(rest).map(Step::Add),
                Some(("-", rest)) => number(rest).map(|n| Step::Add(-n)),
                Some(("*", rest)) => factor(rest).map(Step::Multiply),
                Some(("/", rest)) => factor(rest).map(Step::Divide),
                _ => None,
            };
            let unknown = || {
                Error::usage(
                    format!("{part:?} is nothing that a channel's value can become"),
                    "write +N, -N, *N, /N, y/(1+y) or min(y,1) after a colon, such as burley.albedo:-0.5",
                )
            };
            let step = step.ok_or_else(unknown)?;
            *transform.steps.get_mut(place).ok_or_else(|| {
                Error::usage(format!("more than {MOST_STEPS} steps in {text:?}"), "put several into one, such as *2.5")
            })? = Some(step);
        }
        Ok(transform)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every() -> Vec<Transform> {
        ["+0.5", "-0.5", "*2", "/1.03571:-0.5", "y/(1+y)", "*-0.3:+1:y/(1+y)", "min(y,1)"]
            .map(|text| text.parse().unwrap())
            .to_vec()
    }

    #[test]
    fn a_transform_prints_as_it_is_parsed_and_is_undone() {
        for transform in every() {
            let text = transform.to_string();
            assert_eq!(text[1..].parse::<Transform>().unwrap(), transform, "{text}");
            for y in [0.0, 0.1, 0.3] {
                let back = transform.undo(transform.apply(y));
                assert!((back - y).abs() < 1e-14, "{text} at {y}: {back}");
            }
        }
        assert_eq!(Transform::default().to_string(), "");
        for bad in ["", "0.5", "*0", "/0", "+inf", "+x", "+1:+1:+1:+1"] {
            assert!(bad.parse::<Transform>().is_err(), "{bad}");
        }
    }

    #[test]
    fn shader_code_undoes_what_the_bake_did() {
        for transform in every() {
            let code = transform.undone(Expression::variable("y"));
            for y in [0.0, 0.1, 0.3, 1.0] {
                let held = transform.apply(y);
                let (found, wanted) = (code.evaluate(&|_| held), transform.undo(held));
                assert!((found - wanted).abs() < 1e-14, "{code} of {held}: {found}, {wanted}");
            }
            assert_eq!(transform.limits(), transform.to_string() == ":min(y,1)", "{transform}");
        }
        let [squash, unity] = ["y/(1+y)", "/1.03571:-0.5"].map(|text| text.parse::<Transform>().unwrap());
        let code = |t: Transform| t.undone(Expression::variable("y"));
        assert_eq!(code(squash).evaluate(&|_| squash.apply(f64::INFINITY)), 2.0_f64.powi(24));
        assert_eq!(code(unity).to_string(), "(y + 0.5) * 1.03571");
    }

    #[test]
    fn an_interval_of_error_becomes_one_that_holds_what_its_ends_become() {
        for transform in every() {
            for (value, error) in [(0.2, 0.05), (0.9, 1e-9), (0.0, 0.0)] {
                let got = transform.estimate(Estimate::bound(value, error));
                for end in [value - error, value + error].map(|y| y.max(0.0)) {
                    let off = (transform.apply(end) - got.value).abs();
                    assert!(off <= got.error * (1.0 + 1e-12), "{transform} of {value} ± {error}: {off}, {}", got.error);
                }
            }
        }
    }

    #[test]
    fn only_a_negative_factor_turns_a_trend_round() {
        assert_eq!(
            every().iter().map(Transform::falls).collect::<Vec<_>>(),
            [false, false, false, false, false, true, false]
        );
        let squash: Transform = "y/(1+y)".parse().unwrap();
        assert_eq!(squash.interval((0.0, f64::INFINITY)), (0.0, 1.0));
    }
}
