//! Directions in the local frame of a surface, whose normal is +z.

use glam::DVec3;
use std::f64::consts::{FRAC_PI_4, TAU};

/// The unit direction in the plane y = 0 whose cosine to +z is `mu` in [0, 1].
#[inline]
pub fn direction_with_cosine(mu: f64) -> DVec3 {
    DVec3::new(sine_of_cosine(mu), 0.0, mu)
}

/// sqrt(1 − mu²) without cancellation near mu = 1.
#[inline]
pub fn sine_of_cosine(mu: f64) -> f64 {
    // The product can leave [0, 1] by one rounding when |mu| exceeds 1 by one: that is a sine of 0, not NaN.
    ((1.0 - mu) * (1.0 + mu)).max(0.0).sqrt()
}

/// `w` mirrored about the unit direction `m`.
#[inline]
pub fn reflect(w: DVec3, m: DVec3) -> DVec3 {
    2.0 * w.dot(m) * m - w
}

/// A point of the unit disk, by area, from a point of the unit square (polar map).
#[inline]
pub fn square_to_disk(u: [f64; 2]) -> (f64, f64) {
    let (r, phi) = (u[0].sqrt(), TAU * u[1]);
    (r * phi.cos(), r * phi.sin())
}

/// The point of the unit square that [`square_to_disk`] takes to (x, y).
pub fn disk_to_square(x: f64, y: f64) -> [f64; 2] {
    [x * x + y * y, turn(x, y)]
}

/// The angle of (x, y) as a part of a full turn, in [0, 1).
pub fn turn(x: f64, y: f64) -> f64 {
    let t = y.atan2(x) / TAU;
    // A tiny negative angle plus one rounds to one, which is no part of the half-open interval.
    if t < 0.0 { (t + 1.0).min(1.0 - f64::EPSILON / 2.0) } else { t }
}

/// The elevation above the horizon, in radians, of a direction whose cosine to the normal is `mu`; accurate at both ends.
#[inline]
pub fn elevation(mu: f64) -> f64 {
    if mu < FRAC_PI_4 { mu.asin() } else { mu.atan2(sine_of_cosine(mu)) }
}
