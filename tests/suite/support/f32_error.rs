//! How far a formula can be off in a shader: a running error analysis in f32.
//!
//! What an operation may be off by is what the GLSL and WGSL specifications promise (their tables agree): sums and products are correctly
//! rounded, divisions within 2.5 ulp, logarithms within 3 ulp, or 2⁻²¹ between ½ and 2, 2ˣ within 3 + 2|x| ulp, inverse square roots
//! within 2 ulp; √x is inherited from 1/(1/√x), xʸ from 2^(y log2 x).

use kiln::math::expression::{Expression, Function, Operator};

/// Half an ulp, relative: what rounding to nearest does.
pub const ROUNDING: f64 = 1.0 / (1 << 24) as f64;
/// An ulp, relative.
pub const ULP: f64 = 2.0 * ROUNDING;
/// Numbers below it may become 0.
const TINY: f64 = f32::MIN_POSITIVE as f64;

/// A value, and how far a shader's may be from it.
#[derive(Clone, Copy, Debug)]
pub struct Approximate {
    pub value: f64,
    pub error: f64,
}

impl Approximate {
    fn rounded(value: f64, error: f64, ulps: f64) -> Self {
        Self { value, error: error + ulps * ULP * (value.abs() + error) + TINY }
    }
}

/// The value of a formula of variables that are exact, and the bound of its error.
pub fn evaluate(formula: &Expression, variables: &dyn Fn(&str) -> f64) -> Approximate {
    let of = |e: &Expression| evaluate(e, variables);
    match formula {
        Expression::Number(value) => Approximate { value: *value, error: (*value - f64::from(*value as f32)).abs() },
        Expression::Variable(name) => Approximate { value: variables(name), error: 0.0 },
        Expression::Binary(operator, a, b) => {
            let (a, b) = (of(a), of(b));
            let value = operator.apply(a.value, b.value);
            match operator {
                Operator::Add | Operator::Subtract => Approximate::rounded(value, a.error + b.error, 0.5),
                Operator::Multiply => {
                    let error = a.value.abs() * b.error + b.value.abs() * a.error + a.error * b.error;
                    Approximate::rounded(value, error, 0.5)
                }
                Operator::Divide => {
                    Approximate::rounded(value, (a.error + value.abs() * b.error) / (b.value.abs() - b.error), 2.5)
                }
            }
        }
        Expression::Call(function, arguments) => {
            let arguments: Vec<Approximate> = arguments.iter().map(of).collect();
            let value = function.apply(&arguments.iter().map(|a| a.value).collect::<Vec<_>>());
            let Approximate { value: x, error } = arguments[0];
            // A monotone function of an argument that is off is off by no more than at the farther end.
            let spread =
                |f: &dyn Fn(f64) -> f64| (f(x + error) - value).abs().max((value - f((x - error).max(0.0))).abs());
            match function {
                Function::Abs => Approximate { value, error },
                Function::Clamp => {
                    // An end of the range counts where it may be the result.
                    let near = |end: &&Approximate| (x - end.value).abs() <= error + end.error;
                    let ends = arguments[1..].iter().filter(near).map(|end| end.error);
                    let own = if value == x { error } else { 0.0 };
                    let chosen = arguments[1..].iter().filter(|end| end.value == value).map(|end| end.error);
                    Approximate { value, error: ends.chain(chosen).fold(own, f64::max) }
                }
                Function::Sqrt => Approximate::rounded(value, spread(&f64::sqrt), 4.5),
                Function::Log => {
                    let own = if (0.5..=2.0).contains(&x) { 2_f64.powi(-21) } else { 3.0 * ULP * value.abs() };
                    Approximate { value, error: spread(&|x| x.max(TINY).ln()) + own + TINY }
                }
                Function::Pow => {
                    let y = arguments[1].value;
                    let exponent = y * x.max(TINY).log2();
                    let log = if (0.5..=2.0).contains(&x) { 2_f64.powi(-21) } else { 3.0 * ULP * (exponent / y).abs() };
                    let off = y * log + arguments[1].error * (exponent / y).abs() + ULP * exponent.abs();
                    let relative = (off * 2_f64.ln()).exp_m1() + (3.0 + 2.0 * exponent.abs()) * ULP;
                    Approximate { value, error: spread(&|x| x.powf(y)) + relative * value + TINY.powf(y) }
                }
                Function::Floor | Function::Step => panic!("{formula} jumps: it has no bound"),
            }
        }
    }
}
