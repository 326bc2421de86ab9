//! Fresnel reflectance.

/// Schlick's weight (1 − mu)⁵: the reflectance is f0 + (f90 − f0)·weight.
///
/// **Source**: Schlick 1994, "An Inexpensive BRDF Model for Physically-based Rendering", eq. 15 (as quoted by every
/// engine that uses the split sum; `mu` is the cosine to the microfacet normal).
pub fn schlick_weight(mu: f64) -> f64 {
    let x = 1.0 - mu;
    let x2 = x * x;
    x2 * x2 * x
}

/// Schlick's reflectance f0 + (1 − f0)(1 − mu)⁵.
pub fn schlick(f0: f64, mu: f64) -> f64 {
    f0 + (1.0 - f0) * schlick_weight(mu)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schlick_is_f0_at_normal_incidence_and_one_at_grazing() {
        for f0 in [0.0, 0.02, 0.04, 0.5, 1.0] {
            assert_eq!(schlick(f0, 1.0), f0);
            assert_eq!(schlick(f0, 0.0), 1.0);
        }
    }
}
