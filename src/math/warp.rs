//! Warps of a table's axis: monotone maps of [0, 1] onto itself, each with its inverse.

use serde::{Deserialize, Serialize};

/// How a parameter in [0, 1] becomes a texture coordinate in [0, 1]; named by the function applied to the parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Warp {
    /// t = x.
    #[default]
    Linear,
    /// t = √x: denser near 0; HDRP's axis for the cosine.
    Sqrt,
    /// t = ∛x: denser still near 0.
    Cbrt,
    /// t = x²: denser near 1; what a `roughness` axis is to alpha.
    Square,
}

impl Warp {
    /// Every warp, in the order in which they are listed to a user.
    pub const ALL: [Self; 4] = [Self::Linear, Self::Sqrt, Self::Cbrt, Self::Square];

    /// The name that a user writes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Sqrt => "sqrt",
            Self::Cbrt => "cbrt",
            Self::Square => "square",
        }
    }

    /// The texture coordinate of the parameter `x`.
    pub fn forward(self, x: f64) -> f64 {
        match self {
            Self::Linear => x,
            Self::Sqrt => x.sqrt(),
            Self::Cbrt => x.cbrt(),
            Self::Square => x * x,
        }
    }

    /// The parameter at the texture coordinate `t`.
    pub fn inverse(self, t: f64) -> f64 {
        match self {
            Self::Linear => t,
            Self::Sqrt => t * t,
            Self::Cbrt => t * t * t,
            Self::Square => t.sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_warp_is_undone_by_its_inverse_and_keeps_the_ends() {
        for warp in Warp::ALL {
            assert_eq!((warp.forward(0.0), warp.forward(1.0)), (0.0, 1.0), "{warp:?}");
            for i in 0..=1000 {
                let x = f64::from(i) / 1000.0;
                let back = warp.inverse(warp.forward(x));
                assert!((back - x).abs() <= 4.0 * f64::EPSILON * x, "{warp:?} at {x}: got {back}");
            }
        }
    }
}
