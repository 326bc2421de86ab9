//! Formulas that are computed here and printed as shader code: one definition for both.
//!
//! Printed, an expression is plain infix text that GLSL, HLSL and WGSL read alike: every function used exists in all three under
//! the same name.

use std::fmt;
use std::ops::{Add, Div, Mul, Sub};

/// A formula of real numbers.
#[derive(Debug, Clone, PartialEq)]
pub enum Expression {
    /// A constant; printed as the nearest f32.
    Number(f64),
    /// The value of that name.
    Variable(String),
    /// An operator between two terms.
    Binary(Operator, Box<Self>, Box<Self>),
    /// A function of its arguments.
    Call(Function, Vec<Self>),
}

/// What stands between two terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operator {
    /// a + b.
    Add,
    /// a − b.
    Subtract,
    /// a b.
    Multiply,
    /// a/b.
    Divide,
}

/// Functions that all shading languages have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Function {
    /// √x.
    Sqrt,
    /// |x|.
    Abs,
    /// ln x.
    Log,
    /// The largest whole number that is not above x.
    Floor,
    /// x to the power of y.
    Pow,
    /// x, but not below the second and not above the third argument.
    Clamp,
    /// 0 where the second argument is below the first, else 1.
    Step,
}

impl Expression {
    /// The value of that name.
    pub fn variable(name: impl Into<String>) -> Self {
        Self::Variable(name.into())
    }

    /// √x.
    pub fn sqrt(self) -> Self {
        Self::Call(Function::Sqrt, vec![self])
    }

    /// |x|.
    pub fn abs(self) -> Self {
        Self::Call(Function::Abs, vec![self])
    }

    /// ln x.
    pub fn log(self) -> Self {
        Self::Call(Function::Log, vec![self])
    }

    /// The largest whole number that is not above it.
    pub fn floor(self) -> Self {
        Self::Call(Function::Floor, vec![self])
    }

    /// To the power of `exponent`.
    pub fn pow(self, exponent: f64) -> Self {
        Self::Call(Function::Pow, vec![self, exponent.into()])
    }

    /// Kept from `low` to `high`.
    pub fn clamp(self, low: f64, high: f64) -> Self {
        Self::Call(Function::Clamp, vec![self, low.into(), high.into()])
    }

    /// 1 from `edge` on, 0 below it.
    pub fn step(self, edge: f64) -> Self {
        Self::Call(Function::Step, vec![edge.into(), self])
    }

    /// The value, variables taken from `variables`.
    pub fn evaluate(&self, variables: &dyn Fn(&str) -> f64) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Variable(name) => variables(name),
            Self::Binary(operator, a, b) => operator.apply(a.evaluate(variables), b.evaluate(variables)),
            Self::Call(function, arguments) => {
                let values: Vec<f64> = arguments.iter().map(|a| a.evaluate(variables)).collect();
                function.apply(&values)
            }
        }
    }

    fn binary(self, operator: Operator, other: Self) -> Self {
        Self::Binary(operator, Box::new(self), Box::new(other))
    }

    /// How tightly its outermost operator binds.
    fn precedence(&self) -> u8 {
        match self {
            Self::Binary(operator, ..) => operator.precedence(),
            // A leading minus binds less tightly than a call, and must not follow an operator bare.
            Self::Number(value) if *value < 0.0 => 0,
            _ => 3,
        }
    }
}

impl Operator {
    /// The result.
    pub fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
        }
    }

    fn precedence(self) -> u8 {
        match self {
            Self::Add | Self::Subtract => 1,
            Self::Multiply | Self::Divide => 2,
        }
    }
}

impl Function {
    /// The result.
    pub fn apply(self, x: &[f64]) -> f64 {
        match self {
            Self::Sqrt => x[0].sqrt(),
            Self::Abs => x[0].abs(),
            Self::Log => libm::log(x[0]),
            Self::Floor => x[0].floor(),
            Self::Pow => libm::pow(x[0], x[1]),
            Self::Clamp => x[0].max(x[1]).min(x[2]),
            Self::Step => f64::from(u8::from(x[1] >= x[0])),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Sqrt => "sqrt",
            Self::Abs => "abs",
            Self::Log => "log",
            Self::Floor => "floor",
            Self::Pow => "pow",
            Self::Clamp => "clamp",
            Self::Step => "step",
        }
    }
}

impl From<f64> for Expression {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

// What changes nothing is left out, so that a plain axis prints as the bare parameter.

impl<T: Into<Self>> Add<T> for Expression {
    type Output = Self;

    fn add(self, other: T) -> Self {
        match (self, other.into()) {
            (a, Self::Number(0.0)) | (Self::Number(0.0), a) => a,
            (a, Self::Number(b)) if b < 0.0 => a.binary(Operator::Subtract, Self::Number(-b)),
            (a, b) => a.binary(Operator::Add, b),
        }
    }
}

impl<T: Into<Self>> Sub<T> for Expression {
    type Output = Self;

    fn sub(self, other: T) -> Self {
        match (self, other.into()) {
            (a, Self::Number(0.0)) => a,
            (a, Self::Number(b)) if b < 0.0 => a.binary(Operator::Add, Self::Number(-b)),
            (a, b) => a.binary(Operator::Subtract, b),
        }
    }
}

impl<T: Into<Self>> Mul<T> for Expression {
    type Output = Self;

    fn mul(self, other: T) -> Self {
        match (self, other.into()) {
            (a, Self::Number(1.0)) | (Self::Number(1.0), a) => a,
            (a, b) => a.binary(Operator::Multiply, b),
        }
    }
}

impl<T: Into<Self>> Div<T> for Expression {
    type Output = Self;

    fn div(self, other: T) -> Self {
        match (self, other.into()) {
            (a, Self::Number(1.0)) => a,
            (a, b) => a.binary(Operator::Divide, b),
        }
    }
}

/// A number as every shading language reads it: the shortest text that is the nearest f32, always with a point or an exponent.
pub fn literal(value: f64) -> String {
    format!("{:?}", value as f32)
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) => f.write_str(&literal(*value)),
            Self::Variable(name) => f.write_str(name),
            Self::Binary(operator, a, b) => {
                let sign = match operator {
                    Operator::Add => "+",
                    Operator::Subtract => "-",
                    Operator::Multiply => "*",
                    Operator::Divide => "/",
                };
                // To the right, an operator of the same rank needs brackets too: a − (b − c); it keeps f32 sums in our order as well.
                let bracket =
                    |e: &Self, least: u8| if e.precedence() < least { format!("({e})") } else { e.to_string() };
                let rank = operator.precedence();
                write!(f, "{} {sign} {}", bracket(a, rank), bracket(b, rank + 1))
            }
            Self::Call(function, arguments) => {
                let texts: Vec<String> = arguments.iter().map(Self::to_string).collect();
                write!(f, "{}({})", function.name(), texts.join(", "))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn x() -> Expression {
        Expression::variable("x")
    }

    #[test]
    fn brackets_stand_where_they_matter_and_nowhere_else() {
        for (expression, text) in [
            ((x() - 0.25) * 2.0 + 0.5, "(x - 0.25) * 2.0 + 0.5"),
            (Expression::from(1.0) - (x() - 0.5), "1.0 - (x - 0.5)"),
            (x() * 1.0 + 0.0, "x"),
            (x() + -0.5, "x - 0.5"),
            (x() * -2.0, "x * (-2.0)"),
            (x() / (x() + 1.0), "x / (x + 1.0)"),
            ((x().sqrt() * x()).clamp(0.0, 1e30), "clamp(sqrt(x) * x, 0.0, 1e30)"),
            (x().step(0.5) + x().pow(1.0 / 3.0).floor(), "step(0.5, x) + floor(pow(x, 0.33333334))"),
        ] {
            assert_eq!(expression.to_string(), text);
        }
    }

    #[test]
    fn a_formula_is_evaluated_as_it_is_written() {
        let formula = ((x() - 0.25) / 2.0).abs().log() * x().step(0.1) + (x() * 3.5).floor();
        for at in [0.1, 0.7, 4.0_f64] {
            assert_eq!(formula.evaluate(&|_| at), libm::log(((at - 0.25) / 2.0).abs()) + (at * 3.5).floor(), "{at}");
        }
        assert_eq!(formula.evaluate(&|_| 0.05), 0.0);
    }
}
