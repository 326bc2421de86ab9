//! The form factor of a sphere that the horizon cuts off: by how much a polygon's vector form factor is scaled in its place.
//!
//! A sphere seen under the angular radius σ, its centre at the angle ω from the normal, sends a surface ∫ cosθ dω over what of it is
//! above the horizon: the area of that part's projection onto the plane. By Green's theorem this area is ½ ∮ (x dy − y dx) along the
//! sphere's outline, and along the horizon where that cuts it:
//!
//! ```text
//! π sin²σ cosω                                                             where all of it is above,
//! φ + sin²σ cosω (π − t) − sinσ cosσ sinω sin t                             where the horizon cuts it,
//!     cos φ = cosσ / sinω,     cos t = cotσ cotω,
//! 0                                                                        where nothing is.
//! ```
//!
//! In parts of π sin²σ, the length of the unclipped vector form factor, that is what shaders look up. It is cosω, clamped, for a point.
//!
//! **Source**: the use of it, Hill and Heitz 2016, "Real-Time Area Lighting: a Journey from Research to Production". The formula is derived
//! here.

use std::f64::consts::PI;

/// The form factor of a clipped sphere, in parts of that of the same sphere overhead: `cos_centre` is cosω, `sin2_radius` is sin²σ.
pub fn clipped_sphere(cos_centre: f64, sin2_radius: f64) -> f64 {
    let (sin2, sin_centre) = (sin2_radius, ((1.0 - cos_centre) * (1.0 + cos_centre)).max(0.0).sqrt());
    // |cosω| ≥ sinσ: the outline does not meet the horizon.
    if cos_centre * cos_centre >= sin2 {
        return cos_centre.max(0.0);
    }
    let (sin, cos) = (sin2.sqrt(), (1.0 - sin2).max(0.0).sqrt());
    let cos_t = (cos * cos_centre / (sin * sin_centre)).clamp(-1.0, 1.0); // beyond 1 by rounding only
    let sin_t = ((1.0 - cos_t) * (1.0 + cos_t)).sqrt();
    // φ from its sine, which has no cancellation: sin²ω − cos²σ = sin²σ − cos²ω.
    let phi = f64::atan2((sin2 - cos_centre * cos_centre).max(0.0).sqrt(), cos);
    ((phi + sin2 * cos_centre * (PI - cos_t.acos()) - sin * cos * sin_centre * sin_t) / (PI * sin2)).max(0.0)
}

/// What rounding makes of [`clipped_sphere`]: terms of the order of sinσ, divided by π sin²σ.
pub fn clipped_sphere_rounding(sin2_radius: f64) -> f64 {
    if sin2_radius == 0.0 { 0.0 } else { 4.0 * f64::EPSILON / sin2_radius.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::quadrature::gauss_legendre;
    use std::f64::consts::TAU;

    #[test]
    fn a_clipped_sphere_is_what_its_directions_above_the_horizon_add_up_to() {
        let (rule, n_phi) = (gauss_legendre(64), 2048);
        for i in 0..=8 {
            for j in 1..=8 {
                let (cos_centre, sin2) = (-1.0 + 0.25 * f64::from(i), 0.125 * f64::from(j));
                let sin_centre = (1.0 - cos_centre * cos_centre).max(0.0).sqrt();
                // Rings about the centre: s = sin² of the angle from it, of which dω is ds dφ/(2 cos).
                let mut sum = 0.0;
                for (u, w) in rule.iter() {
                    // 1 − (1 − u)² crowds the nodes where the cosine vanishes.
                    let s = sin2 * u * (2.0 - u);
                    let (sin, cos) = (s.sqrt(), (1.0 - s).sqrt());
                    let ring: f64 = (0..n_phi)
                        .map(|k| {
                            let phi = TAU * (f64::from(k) + 0.5) / f64::from(n_phi);
                            (cos_centre * cos + sin_centre * sin * phi.cos()).max(0.0)
                        })
                        .sum();
                    sum += w * sin2 * 2.0 * (1.0 - u) / (2.0 * cos) * ring * TAU / f64::from(n_phi);
                }
                let (got, wanted) = (clipped_sphere(cos_centre, sin2), sum / (PI * sin2));
                // The kink at the horizon costs 64 nodes 1/64², and half a ring's step its square.
                assert!((got - wanted).abs() < 2.5e-4, "cos {cos_centre} sin² {sin2}: {got}, wanted {wanted}");
            }
        }
    }

    #[test]
    fn half_a_sky_is_half_of_one_plus_the_cosine_and_a_point_is_a_cosine() {
        for i in 0..=20 {
            let z = -1.0 + 0.1 * f64::from(i);
            assert!((clipped_sphere(z, 1.0) - 0.5 * (1.0 + z)).abs() < 1e-15, "{z}");
            assert_eq!(clipped_sphere(z, 0.0), z.max(0.0));
        }
        // Half of a sphere on the horizon: φ = σ, t = π/2.
        for sin2 in [1e-6_f64, 0.01, 0.3, 0.9] {
            let sigma = sin2.sqrt().asin();
            let wanted = (sigma - sigma.sin() * sigma.cos()) / (PI * sin2);
            assert!((clipped_sphere(0.0, sin2) - wanted).abs() < 2.0 * clipped_sphere_rounding(sin2), "{sin2}");
        }
    }
}
