//! Linearly transformed cosines: the lobes by which renderers integrate a surface's reflection over area lights in closed form.
//!
//! The cosine lobe max(n_z, 0)/π of a direction n becomes another one of the directions ω when n is N ω, normalised: its density is
//!
//! ```text
//! g(ω) = max(n_z, 0)/π · |det N| / |n|⁴,     n = N ω,     ∫ g dω = 1 over the sphere.
//! ```
//!
//! A polygon seen through g is the polygon N P seen through the cosine. N = M⁻¹ is what shaders read; its scale does not matter. A
//! lobe that is symmetric about the plane of incidence has zeros where y meets x or z:
//!
//! ```text
//!     ⎡ m00  0  m02 ⎤
//! N = ⎢  0  m11  0  ⎥
//!     ⎣ m20  0  m22 ⎦
//! ```
//!
//! which leaves four numbers. The surface's normal is +z and the outgoing direction leans towards +x, so that the lobe leans towards −x.
//!
//! **Source**: Heitz, Dupuy, Hill and Neubelt 2016, "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines", eq. 1 to 6.
//! The derivatives, and the group by which a lobe is varied here, are our own.

use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI, TAU};

/// A linearly transformed cosine, symmetric about y = 0, by its inverse matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ltc {
    /// m00 and m02: what n_x is of x and z.
    pub x: [f64; 2],
    /// m11: what n_y is of y.
    pub y: f64,
    /// m20 and m22: what n_z is of x and z.
    pub z: [f64; 2],
}

/// The ways in which a lobe is varied: a small stretch of n along x, one along y, a shear of n_x by n_z and one of n_z by n_x.
///
/// They act on n, where every lobe is the same cosine: a step means the same for a lobe as narrow as a mirror's as for a wide one.
pub const VARIATIONS: usize = 4;

impl Ltc {
    /// The cosine itself.
    pub const COSINE: Self = Self { x: [1.0, 0.0], y: 1.0, z: [0.0, 1.0] };

    /// n of a direction in the plane of incidence, without its y, which is 0.
    #[inline]
    pub fn in_plane(&self, x: f64, z: f64) -> [f64; 2] {
        [self.x[0] * x + self.x[1] * z, self.z[0] * x + self.z[1] * z]
    }

    /// N ω.
    #[inline]
    pub fn transform(&self, w: DVec3) -> DVec3 {
        let [x, z] = self.in_plane(w.x, w.z);
        DVec3::new(x, self.y * w.y, z)
    }

    /// det N.
    #[inline]
    pub fn determinant(&self) -> f64 {
        (self.x[0] * self.z[1] - self.x[1] * self.z[0]) * self.y
    }

    /// g(ω), in 1/sr.
    #[inline]
    pub fn density(&self, w: DVec3) -> f64 {
        let n = self.transform(w);
        if n.z <= 0.0 { 0.0 } else { FRAC_1_PI * n.z * self.determinant().abs() / n.length_squared().powi(2) }
    }

    /// g(ω) and its derivatives along the [`VARIATIONS`].
    #[inline]
    pub fn derivatives(&self, w: DVec3) -> (f64, [f64; VARIATIONS]) {
        let n = self.transform(w);
        if n.z <= 0.0 {
            return (0.0, [0.0; VARIATIONS]);
        }
        let square = 1.0 / n.length_squared();
        let slope = FRAC_1_PI * self.determinant().abs() * square * square;
        let g = slope * n.z;
        let fall = -4.0 * g * square;
        (g, [g + fall * n.x * n.x, g + fall * n.y * n.y, fall * n.x * n.z, slope * n.x + fall * n.x * n.z])
    }

    /// The lobe varied by `step`; stretches by their exponentials, so that none turns it inside out.
    pub fn varied(&self, step: [f64; VARIATIONS]) -> Self {
        let [stretch_x, stretch_y, shear_x, shear_z] = step;
        let ([a, b], [c, d]) = (self.x, self.z);
        let s = stretch_x.exp();
        Self {
            x: [s * a + shear_x * c, s * b + shear_x * d],
            y: self.y * stretch_y.exp(),
            z: [c + shear_z * a, d + shear_z * b],
        }
    }

    /// The angles in the plane of incidence, from +z towards +x, between which the lobe is above 0: half a circle.
    pub fn horizon(&self) -> [f64; 2] {
        let middle = self.z[0].atan2(self.z[1]);
        [middle - FRAC_PI_2, middle + FRAC_PI_2]
    }

    /// The angle in the plane of incidence at which |n| is least, the one where the lobe is above 0, and how far from the real axis it
    /// vanishes: where the lobe's ridge is, and how wide.
    pub fn ridge(&self) -> [f64; 2] {
        // n_x ± i n_z = 0 where the tangent of the angle is −(m02 ± i m22)/(m00 ± i m20).
        let ([a, b], [c, d]) = (self.x, self.z);
        let length = a * a + c * c;
        let (re, im) = (-(b * a + d * c) / length, (b * c - d * a) / length);
        // The arc tangent of re + i im.
        let angle = 0.5 * f64::atan2(2.0 * re, 1.0 - re * re - im * im);
        let width = 0.25 * ((re * re + (1.0 + im).powi(2)) / (re * re + (1.0 - im).powi(2))).ln();
        let [_, z] = self.in_plane(angle.sin(), angle.cos());
        let angle = if z >= 0.0 { angle } else { angle + if angle < 0.0 { PI } else { -PI } };
        [angle, width.abs()]
    }

    /// A direction of density g, from a point of the unit square.
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        let ((sin, cos), r) = ((TAU * u[0]).sin_cos(), u[1].sqrt());
        let n = DVec3::new(r * cos, r * sin, (1.0 - u[1]).max(0.0).sqrt());
        // M n, of the inverse of the block of x and z.
        let block = self.determinant() / self.y;
        let x = (self.z[1] * n.x - self.x[1] * n.z) / block;
        let z = (self.x[0] * n.z - self.z[0] * n.x) / block;
        DVec3::new(x, n.y / self.y, z).normalize()
    }

    /// m00, m02, m20 and m22, in parts of m11.
    pub fn by_m11(&self) -> [f64; 4] {
        [self.x[0], self.x[1], self.z[0], self.z[1]].map(|entry| entry / self.y)
    }

    /// m02, m20, m11 and m22, in parts of m00.
    pub fn by_m00(&self) -> [f64; 4] {
        [self.x[1], self.z[0], self.y, self.z[1]].map(|entry| entry / self.x[0])
    }

    /// M itself, which makes the lobe of the cosine, with what it makes of +z of length 1: m00, m20, m11, m02 and m22.
    pub fn lobe_matrix(&self) -> [f64; 5] {
        let ([a, b], [c, d]) = (self.x, self.z);
        // The inverse of the block is [d, −b; −c, a] over its determinant, and its second column so long.
        let length = a.hypot(b);
        [d / length, -c / length, (a * d - b * c) / (length * self.y), -b / length, a / length]
    }

    /// The variation that makes this lobe of `other`, to first order: scale apart, N N'⁻¹ less the identity.
    pub fn step_from(&self, other: &Self) -> [f64; VARIATIONS] {
        let ([a, b], [c, d]) = (other.x, other.z);
        let block = a * d - b * c;
        // A row of the block times the inverse of the other's.
        let over = |[p, q]: [f64; 2]| [(p * d - q * c) / block, (q * a - p * b) / block];
        let ([xx, xz], [zx, zz]) = (over(self.x), over(self.z));
        [xx / zz - 1.0, self.y / (other.y * zz) - 1.0, xz / zz, zx / zz]
    }

    /// m00, m02, m20 and m11, in parts of m22.
    pub fn by_m22(&self) -> [f64; 4] {
        [self.x[0], self.x[1], self.z[0], self.y].map(|entry| entry / self.z[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::quadrature::gauss_legendre;

    /// A lobe as a fit makes them, and one of none.
    const LOBES: [Ltc; 3] = [
        Ltc::COSINE,
        Ltc { x: [2.08, 2.88], y: 6.57, z: [-0.459, 1.758] },
        Ltc { x: [0.9, 0.3], y: 0.7, z: [0.4, 1.1] },
    ];

    fn over_sphere(f: impl Fn(DVec3) -> f64) -> f64 {
        let rule = gauss_legendre(160);
        let mut sum = 0.0;
        for (u, wu) in rule.iter() {
            for (v, wv) in rule.iter() {
                let (z, phi) = (2.0 * u - 1.0, TAU * v);
                let r = ((1.0 - z) * (1.0 + z)).sqrt();
                sum += 4.0 * PI * wu * wv * f(DVec3::new(r * phi.cos(), r * phi.sin(), z));
            }
        }
        sum
    }

    #[test]
    fn a_lobe_integrates_to_1_over_the_sphere() {
        for ltc in LOBES {
            let whole = over_sphere(|w| ltc.density(w));
            // The kink at the lobe's horizon costs a rule of n nodes about 1/n².
            assert!((whole - 1.0).abs() < 4.0 / 160.0_f64.powi(2), "{ltc:?}: {whole}");
        }
    }

    #[test]
    fn derivatives_are_the_differences_of_varied_lobes() {
        const H: f64 = 1e-5;
        for ltc in LOBES {
            for w in [DVec3::new(-0.6, 0.1, 0.8), DVec3::new(0.3, -0.4, 0.7), DVec3::new(-0.9, 0.0, 0.2)] {
                let w = w.normalize();
                let (value, derivatives) = ltc.derivatives(w);
                assert!((value - ltc.density(w)).abs() <= 1e-14 * value);
                for (k, derivative) in derivatives.into_iter().enumerate() {
                    let at = |h: f64| ltc.varied(std::array::from_fn(|i| if i == k { h } else { 0.0 })).density(w);
                    let difference = (at(H) - at(-H)) / (2.0 * H);
                    let tolerance = 1e-4 * H + 1e-10; // third derivatives times H², and what rounding makes of it
                    assert!((derivative - difference).abs() < tolerance, "{k}: {derivative} {difference}");
                }
            }
        }
    }

    #[test]
    fn a_step_is_found_from_what_it_made() {
        let step = [1e-4, -2e-4, 3e-4, 5e-5];
        for ltc in LOBES {
            let mut varied = ltc.varied(step);
            [varied.x, varied.z] = [varied.x, varied.z].map(|row| row.map(|entry| 3.0 * entry));
            varied.y *= 3.0;
            for (found, wanted) in varied.step_from(&ltc).into_iter().zip(step) {
                assert!((found - wanted).abs() < 4e-7, "{ltc:?}: {found}, wanted {wanted}"); // squares of steps
            }
        }
    }

    #[test]
    fn the_matrix_of_the_lobe_undoes_the_inverse_one() {
        for ltc in LOBES {
            let [m00, m20, m11, m02, m22] = ltc.lobe_matrix();
            assert!((m02.hypot(m22) - 1.0).abs() < 1e-15);
            let w = DVec3::new(0.3, -0.5, 0.7);
            let back = ltc.transform(DVec3::new(m00 * w.x + m02 * w.z, m11 * w.y, m20 * w.x + m22 * w.z));
            let scale = back.z / w.z;
            assert!((back - scale * w).length() < 1e-14 * scale.abs(), "{ltc:?}: {back}");
        }
    }

    #[test]
    fn samples_come_back_as_points_of_the_cosine_lobe() {
        for ltc in LOBES {
            for u in [[0.1, 0.2], [0.7, 0.9], [0.4, 0.5]] {
                let n = ltc.transform(ltc.sample(u)).normalize();
                assert!((n.x * n.x + n.y * n.y - u[1]).abs() < 1e-14 && n.z > 0.0, "{ltc:?} {u:?}: {n}");
            }
        }
    }

    #[test]
    fn the_ridge_is_where_n_vanishes() {
        for ltc in LOBES {
            let [angle, width] = ltc.ridge();
            // |n|² of the angle a + iw: its real part at w is least, and 0.
            let square = |a: f64| {
                let [x, z] = ltc.in_plane(a.sin(), a.cos());
                x * x + z * z
            };
            let (mean, swing) =
                (0.5 * (square(angle) + square(angle + FRAC_PI_2)), 0.5 * (square(angle + FRAC_PI_2) - square(angle)));
            assert!(swing >= 0.0, "{ltc:?}: the ridge is where |n| is least");
            if swing > 0.0 {
                assert!((mean - swing * (2.0 * width).cosh()).abs() < 1e-12 * mean, "{ltc:?}: {angle} {width}");
            }
        }
    }
}
