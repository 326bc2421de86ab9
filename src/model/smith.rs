//! Masking and shadowing: how G1 of two directions combine into G2, and what engines use instead.
//!
//! Everything is written with ℓ(w) = μ (1 + 2Λ(w)), so that nothing divides by a cosine: G1 = 2μ/(μ + ℓ). For GGX
//! ℓ = √(α² sin²θ + cos²θ); any other Smith Λ gives its own ℓ and shares the rest.
//!
//! The three that engines use in place of the exact ones never exceed them: with s = 1/μ ≥ 1 and t = tanθ,
//! √(1 + α²t²) ≤ (1 − α) + αs (square both sides), hence Schlick's G1 with k = α/2 is at most GGX's own, with
//! k = (r + 1)²/8 ≥ r²/2 smaller still, and the approximate correlated G2 is at most the exact one. All five reflect at most
//! what comes in, and at α = 1 they fall together into the two exact ones.
//!
//! **Source**: Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", eq. 98–99 (separable and
//! height-correlated G2); Karis 2013, "Real Shading in Unreal Engine 4" (Schlick's G1 and both k).

use serde::{Deserialize, Serialize};

/// How masking and shadowing combine into G2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Smith {
    /// Height-correlated: G2 = 1/(1 + Λ(wo) + Λ(wi)).
    #[default]
    Correlated,
    /// Separable: G2 = G1(wo) G1(wi).
    Separable,
    /// Separable with Schlick's G1 = μ/(μ (1 − k) + k), k = α/2, which engines use under an environment.
    SchlickIbl,
    /// Separable with Schlick's G1, k = (roughness + 1)²/8, which engines use under lamps.
    SchlickDirect,
    /// Height-correlated; light that goes through takes B(1 + Λ(wo), 1 + Λ(wt)), since it leaves on the other side of the heights.
    Beta,
    /// The rational approximation G2 = 2 μo μi/((1 − α) 2 μo μi + α (μo + μi)) of the correlated one.
    ApproxCorrelated,
}

impl Smith {
    /// Every kind that differs for reflection: [`Self::Beta`] is then [`Self::Correlated`].
    pub const ALL: [Self; 5] =
        [Self::Correlated, Self::Separable, Self::SchlickIbl, Self::SchlickDirect, Self::ApproxCorrelated];

    /// The name that a user writes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Correlated => "correlated",
            Self::Separable => "separable",
            Self::SchlickIbl => "schlick-ibl",
            Self::SchlickDirect => "schlick-direct",
            Self::Beta => "beta",
            Self::ApproxCorrelated => "approx-correlated",
        }
    }

    /// V = G2/(4 μo μi) from the width and the cosines and ℓ of both directions, in cancelled form.
    #[inline]
    pub fn visibility(self, alpha: f64, (mu_o, l_o): (f64, f64), (mu_i, l_i): (f64, f64)) -> f64 {
        match self {
            Self::Correlated | Self::Beta => 0.5 / (mu_o * l_i + mu_i * l_o),
            Self::Separable => 1.0 / ((mu_o + l_o) * (mu_i + l_i)),
            Self::SchlickIbl | Self::SchlickDirect => {
                let k = self.schlick_k(alpha);
                0.25 / ((mu_o * (1.0 - k) + k) * (mu_i * (1.0 - k) + k))
            }
            Self::ApproxCorrelated => 0.5 / ((1.0 - alpha) * 2.0 * mu_o * mu_i + alpha * (mu_o + mu_i)),
        }
    }

    /// G2/μo of light that goes through to the cosine `mu_t` > 0 on the other side, from the cosines and ℓ, in cancelled form;
    /// `None` for the approximations, which are made for reflection.
    #[inline]
    pub fn through(self, (mu_o, l_o): (f64, f64), (mu_t, l_t): (f64, f64)) -> Option<f64> {
        match self {
            Self::SchlickIbl | Self::SchlickDirect | Self::ApproxCorrelated => None,
            _ if mu_t == 0.0 => Some(0.0), // the limit wherever mu_o > 0; where it is 0 as well, no facet refracts
            Self::Correlated => Some(2.0 * mu_t / (mu_t * l_o + mu_o * l_t)),
            Self::Separable => Some(4.0 * mu_t / ((mu_o + l_o) * (mu_t + l_t))),
            Self::Beta if mu_o == 0.0 => Some(0.0), // Λ is infinite
            Self::Beta => {
                // 1 + Λ = (μ + ℓ)/2μ
                let (a, b) = (0.5 * (mu_o + l_o) / mu_o, 0.5 * (mu_t + l_t) / mu_t);
                Some(ln_beta(a, b).exp() / mu_o)
            }
        }
    }

    /// G2 of the mirror direction of a perfectly smooth surface: 1, except where engines keep their surfaces rough.
    pub fn mirror(self, mu: f64) -> f64 {
        match self {
            Self::SchlickDirect => {
                let k = self.schlick_k(0.0);
                (mu / (mu * (1.0 - k) + k)).powi(2)
            }
            _ => 1.0,
        }
    }

    /// Schlick's k; the width of a GGX lobe stands for it where there is one.
    #[inline]
    fn schlick_k(self, alpha: f64) -> f64 {
        match self {
            Self::SchlickDirect => (alpha.sqrt() + 1.0).powi(2) / 8.0,
            _ => 0.5 * alpha,
        }
    }

    /// How far below the horizon, in radians of the incident direction's elevation, V first misbehaves as an analytic function
    /// (at most; infinite where it is as smooth as ℓ).
    pub fn pole_below_horizon(self, alpha: f64, mu_o: f64) -> f64 {
        let mu = match self {
            Self::Correlated | Self::Separable | Self::Beta => return f64::INFINITY,
            Self::SchlickIbl | Self::SchlickDirect => {
                let k = self.schlick_k(alpha);
                k / (1.0 - k)
            }
            Self::ApproxCorrelated => alpha * mu_o / (alpha + 2.0 * (1.0 - alpha) * mu_o),
        };
        mu.min(1.0).asin()
    }
}

/// From where on Stirling's series below is exact to the last digits: its next term is 1/(1188 x⁹).
const STIRLING: f64 = 20.0;

/// ln B(a, b) = ln Γ(a) + ln Γ(b) − ln Γ(a + b), without the cancellation that a large argument brings: of the difference of its two
/// logarithms by Stirling's series, only what is left is computed.
fn ln_beta(a: f64, b: f64) -> f64 {
    let (a, b) = (a.max(b), a.min(b));
    if a < STIRLING {
        return libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    }
    // ln Γ(x) = (x − 1/2) ln x − x + ln √2π + series(x)
    let series = |x: f64| {
        let x2 = 1.0 / (x * x);
        (1.0 / 12.0 - x2 * (1.0 / 360.0 - x2 * (1.0 / 1260.0 - x2 / 1680.0))) / x
    };
    let rise = (a - 0.5) * (b / a).ln_1p() + b * ((a + b).ln() - 1.0) + series(a + b) - series(a);
    libm::lgamma(b) - rise
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_of_beta_keeps_its_digits_for_any_arguments() {
        // B(a, 1) = 1/a, B(a, 2) = 1/(a (a + 1)) and B(a + 1, b) = B(a, b) a/(a + b).
        for exponent in -8..=64 {
            let a = 10.0_f64.powf(0.25 * f64::from(exponent));
            for (b, wanted) in [(1.0, -a.ln()), (2.0, -a.ln() - a.ln_1p())] {
                for got in [ln_beta(a, b), ln_beta(b, a)] {
                    let off = (got - wanted).abs();
                    assert!(off <= 16.0 * f64::EPSILON * (1.0 + wanted.abs()), "B({a:e}, {b}): off by {off:e}");
                }
            }
            for b in [0.5, 1.37, 12.0, STIRLING - 0.5] {
                let (step, wanted) = (ln_beta(a + 1.0, b) - ln_beta(a, b), -(b / a).ln_1p());
                // Each of the two is as good as its largest term.
                let terms = ln_beta(a, b).abs() + libm::lgamma(b).abs() + b * (a + b).ln().abs() + 40.0;
                let off = (step - wanted).abs();
                assert!(off <= 16.0 * f64::EPSILON * terms, "B({a:e} + 1, {b}): off by {off:e}, {terms}");
            }
        }
    }
}
