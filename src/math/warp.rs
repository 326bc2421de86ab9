//! Warps of a table's axis: monotone functions of a parameter in which the texels are even, each with its inverse.

use super::expression::Expression;
use std::fmt;
use std::str::FromStr;

/// acos x = √(1 − x) P(x): the polynomial that is nearest over [0, 1], by Remez' exchange; within 2.2e-8, less than f32 rounds.
///
/// Shading languages have `acos`, but promise little: Vulkan allows errors of 4096 ulp.
const ACOS: [f64; 8] = [
    1.570_796_305,
    -0.214_598_803_8,
    0.088_979_049_88,
    -0.050_174_715_1,
    0.030_893_052_81,
    -0.017_089_810_19,
    0.006_671_292_784,
    -0.001_262_830_774,
];

/// The function of a parameter that is even in the texture coordinate, named as it is applied.
///
/// Those that fall (`acos`, `sqrt-one-minus`, `reciprocal`) put the largest parameter first, as the formula says.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Warp {
    /// x.
    #[default]
    Linear,
    /// √x: denser near 0; HDRP's axis for the cosine.
    Sqrt,
    /// ∛x: denser still near 0.
    Cbrt,
    /// x²: denser near 1; what a `roughness` axis is to alpha.
    Square,
    /// ln(x + offset): as dense everywhere as x is small.
    Log {
        /// What keeps the logarithm finite at 0.
        offset: f64,
    },
    /// acos x: even in the angle whose cosine the parameter is.
    Acos,
    /// √(1 − x): denser near 1; the axis for the cosine of linearly transformed cosines.
    SqrtOneMinus,
    /// √|(x − 1)/(x + 1)|, the fourth root of the reflectance F0 of an index of refraction x.
    F0FourthRoot,
    /// half/(x + half): from 1 at 0 over ½ at `half` to 0 at infinity; Cycles' axis for the exponent of a generalised Schlick reflectance.
    Reciprocal {
        /// Where it is ½.
        half: f64,
    },
}

impl Warp {
    /// One of every kind, in the order in which they are listed to a user.
    pub const ALL: [Self; 9] = [
        Self::Linear,
        Self::Sqrt,
        Self::Cbrt,
        Self::Square,
        Self::Log { offset: 0.0 },
        Self::Acos,
        Self::SqrtOneMinus,
        Self::F0FourthRoot,
        Self::Reciprocal { half: 1.0 },
    ];

    /// How a user writes them.
    pub const SYNTAX: &str =
        "linear|sqrt|cbrt|square|log|log+OFFSET|acos|sqrt-one-minus|f0-fourth-root|reciprocal+HALF";

    /// The function at `x`.
    pub fn forward(self, x: f64) -> f64 {
        match self {
            Self::Linear => x,
            Self::Sqrt => x.sqrt(),
            Self::Cbrt => x.cbrt(),
            Self::Square => x * x,
            Self::Log { offset } => libm::log(x + offset),
            Self::Acos => libm::acos(x),
            Self::SqrtOneMinus => (1.0 - x).sqrt(),
            Self::F0FourthRoot if x == f64::INFINITY => 1.0,
            Self::F0FourthRoot => ((x - 1.0) / (x + 1.0)).abs().sqrt(),
            Self::Reciprocal { half } => half / (x + half),
        }
    }

    /// The parameter where the function is `t`; `below_one` tells the two branches of [`Warp::F0FourthRoot`] apart.
    pub fn inverse(self, t: f64, below_one: bool) -> f64 {
        match self {
            Self::Linear => t,
            Self::Sqrt => t * t,
            Self::Cbrt => t * t * t,
            Self::Square => t.sqrt(),
            Self::Log { offset } => libm::exp(t) - offset,
            Self::Acos => libm::cos(t),
            Self::SqrtOneMinus => 1.0 - t * t,
            Self::F0FourthRoot if below_one => (1.0 - t * t) / (1.0 + t * t),
            Self::F0FourthRoot => (1.0 + t * t) / (1.0 - t * t),
            Self::Reciprocal { half } => half * (1.0 - t) / t,
        }
    }

    /// The function as shader code, of an `x` in its domain.
    pub fn expression(self, x: Expression) -> Expression {
        match self {
            Self::Linear => x,
            Self::Sqrt => x.sqrt(),
            Self::Cbrt => x.pow(1.0 / 3.0),
            Self::Square => x.clone() * x,
            Self::Log { offset } => (x + offset).log(),
            Self::Acos => {
                let (last, others) = (ACOS[ACOS.len() - 1], &ACOS[..ACOS.len() - 1]);
                let horner = |sum: Expression, &c: &f64| sum * x.clone() + c;
                let polynomial = others.iter().rev().fold(last.into(), horner);
                (Expression::from(1.0) - x.clone()).sqrt() * polynomial
            }
            Self::SqrtOneMinus => (Expression::from(1.0) - x).sqrt(),
            Self::F0FourthRoot => ((x.clone() - 1.0) / (x + 1.0)).abs().sqrt(),
            Self::Reciprocal { half } => Expression::from(half) / (x + half),
        }
    }

    /// Whether the function is finite and one-to-one from `low` to `high`; otherwise what it needs.
    pub fn domain_fault(self, low: f64, high: f64) -> Option<&'static str> {
        match self {
            Self::F0FourthRoot => (low < 1.0 && high > 1.0).then_some("a range on one side of 1"),
            Self::Reciprocal { half } => (low + half <= 0.0).then_some("a range from 0 on"),
            _ if !high.is_finite() => Some("a range that ends"),
            Self::Linear | Self::Cbrt => None,
            Self::Sqrt | Self::Square => (low < 0.0).then_some("a range from 0 on"),
            Self::Log { offset } => (low + offset <= 0.0).then_some("a range above 0, or an offset such as log+0.01"),
            Self::Acos | Self::SqrtOneMinus => (low < 0.0 || high > 1.0).then_some("a range within 0..1"),
        }
    }
}

impl fmt::Display for Warp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Linear => "linear",
            Self::Sqrt => "sqrt",
            Self::Cbrt => "cbrt",
            Self::Square => "square",
            Self::Log { offset: 0.0 } => "log",
            Self::Log { offset } => return write!(f, "log+{offset}"),
            Self::Acos => "acos",
            Self::SqrtOneMinus => "sqrt-one-minus",
            Self::F0FourthRoot => "f0-fourth-root",
            Self::Reciprocal { half } => return write!(f, "reciprocal+{half}"),
        })
    }
}

/// Not a warp: what [`Warp::SYNTAX`] does not list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnknownWarp;

impl FromStr for Warp {
    type Err = UnknownWarp;

    fn from_str(text: &str) -> Result<Self, UnknownWarp> {
        if let Some(offset) = text.strip_prefix("log+") {
            let offset = offset.parse().map_err(|_| UnknownWarp)?;
            return if (0.0..f64::INFINITY).contains(&offset) { Ok(Self::Log { offset }) } else { Err(UnknownWarp) };
        }
        if let Some(half) = text.strip_prefix("reciprocal+") {
            let half = half.parse().map_err(|_| UnknownWarp)?;
            return if half > 0.0 && half < f64::INFINITY { Ok(Self::Reciprocal { half }) } else { Err(UnknownWarp) };
        }
        Self::ALL.into_iter().find(|w| w.to_string() == text).ok_or(UnknownWarp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every_warp() -> impl Iterator<Item = Warp> {
        Warp::ALL.into_iter().chain([Warp::Log { offset: 0.01 }, Warp::Reciprocal { half: 5.0 }])
    }

    #[test]
    fn every_warp_is_undone_by_its_inverse() {
        for warp in every_warp() {
            for i in 1..=1000 {
                let x = f64::from(i) / 1000.0;
                let back = warp.inverse(warp.forward(x), true);
                // Rounding t by an ulp moves x by |t/t'(x)| ulp, which those that are level near an end make large against x.
                let conditioned = match warp {
                    Warp::Acos | Warp::SqrtOneMinus | Warp::F0FourthRoot => 1.0,
                    Warp::Log { offset } => x + offset,
                    Warp::Reciprocal { half } => (x + half) * (x + half) / half,
                    _ => x,
                };
                assert!((back - x).abs() <= 8.0 * f64::EPSILON * conditioned, "{warp:?} at {x}: got {back}");
            }
        }
    }

    #[test]
    fn the_code_of_every_warp_is_its_function() {
        for warp in every_warp() {
            let code = warp.expression(Expression::variable("x"));
            // The polynomial of acos is the only approximation.
            let bound = if warp == Warp::Acos { 2.3e-8 } else { 4.0 * f64::EPSILON };
            for i in 1..=1000 {
                let x = f64::from(i) / 1000.0;
                let (got, wanted) = (code.evaluate(&|_| x), warp.forward(x));
                assert!(
                    (got - wanted).abs() <= bound * wanted.abs().max(1.0),
                    "{warp} at {x}: got {got}, wanted {wanted}"
                );
            }
        }
    }

    #[test]
    fn the_fourth_root_of_f0_is_one_and_has_both_branches() {
        for eta in [1.0, 1.1, 1.5, 2.5, 9.0] {
            let z = Warp::F0FourthRoot.forward(eta);
            let f0 = ((eta - 1.0) / (eta + 1.0)).powi(2);
            assert!((z.powi(4) - f0).abs() <= 4.0 * f64::EPSILON, "{eta}");
            assert!((Warp::F0FourthRoot.inverse(z, false) / eta - 1.0).abs() < 1e-14, "{eta}");
            assert!((Warp::F0FourthRoot.inverse(z, true) * eta - 1.0).abs() < 1e-14, "{eta}");
        }
        assert_eq!(Warp::F0FourthRoot.forward(f64::INFINITY), 1.0);
        assert_eq!(Warp::F0FourthRoot.inverse(1.0, false), f64::INFINITY);
    }

    #[test]
    fn a_warp_prints_as_it_is_parsed() {
        for warp in every_warp() {
            assert_eq!(warp.to_string().parse::<Warp>(), Ok(warp));
        }
        for bad in ["", "log+", "log+-1", "log+inf", "log+NaN", "Sqrt", "reciprocal", "reciprocal+0", "reciprocal+inf"]
        {
            assert_eq!(bad.parse::<Warp>(), Err(UnknownWarp), "{bad}");
        }
    }
}
