//! The sum over peeled texels, fast: eight directions at a time, with the texel's extent to second order.
//!
//! A texel's mean of K(R·l) is K(c̄) + K″(c̄) (g₁² + g₂²)/6, c̄ = R·(mean of l), g₁ and g₂ half the change of c across its height and
//! its width; what is left out is of fourth order in extent/distance. Texels too close for that are integrated exactly; those that
//! the horizon crosses take the integral of the first two terms of K over a flat texel, or, where they are bright enough for a flat texel
//! not to be enough, the exact one.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::lanes::{LANES, V, ZERO, scale_add};
use crate::environment::full_sum::{FullSum, Lobe, flat_horizon, is_flat};
use crate::environment::kernel::{Kernel, Lambert, Profile, with_profile};
use crate::environment::panorama::Panorama;
use crate::environment::peel::Peel;
use crate::math::quadrature::gauss_legendre;

/// Nearer than this many extents to the kernel's singularities, a texel is integrated exactly: 16⁻⁴/16 is 1e-6.
const NEAR: f64 = 16.0;
/// Of the brightest, this many are integrated exactly across the horizon.
const BRIGHTEST: usize = 16;

/// Peeled texels, in the order of their flux.
#[derive(Debug)]
pub(super) struct Bright {
    peel: Peel,
    texels: Vec<Texel>,
    extent: f64,
    /// Half the diagonal of the largest.
    reach: f64,
}

/// Mean direction, half the change of direction across height and width, radiance × solid angle.
#[derive(Debug, Clone)]
struct Texel {
    middle: DVec3,
    down: DVec3,
    /// Along x and z.
    across: [f64; 2],
    flux: [f64; 3],
}

/// Eight directions.
struct Axes {
    x: V,
    y: V,
    z: V,
}

impl Bright {
    pub fn new(peel: Peel, panorama: &Panorama) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        let (dtheta, dphi) = (PI / height as f64, TAU / width as f64);
        let texel = |(index, radiance): (usize, [f64; 3])| {
            let row = index / width;
            let theta = dtheta * (row as f64 + 0.5);
            let (sin, cos) = libm::sincos(theta);
            let (sin_phi, cos_phi) = libm::sincos(dphi * ((index % width) as f64 + 0.5) - PI);
            // Means over θ (weighted by sin θ) and φ: ∫ sin²θ, ∫ sin θ cos θ and ∫ cos φ in closed form.
            let extent = 2.0 * sin * libm::sin(0.5 * dtheta);
            let shrink = libm::sin(0.5 * dphi) / (0.5 * dphi);
            let across = 0.5 * (dtheta - libm::cos(2.0 * theta) * libm::sin(dtheta)) / extent * shrink;
            let up = 0.5 * libm::sin(2.0 * theta) * libm::sin(dtheta) / extent;
            let [down, sin2] = second_moments(theta, dtheta);
            let (half_down, half_across) = ((3.0 * down).sqrt(), 0.5 * dphi * sin2.sqrt());
            Texel {
                middle: DVec3::new(across * cos_phi, up, across * sin_phi),
                down: half_down * DVec3::new(cos * cos_phi, -sin, cos * sin_phi),
                across: [-half_across * sin_phi, half_across * cos_phi],
                flux: radiance.map(|r| r * panorama.solid_angle(row)),
            }
        };
        let texels = peel.texels().map(texel).collect();
        let reach = 0.55 * dtheta.hypot(dphi);
        Self { peel, texels, extent: dtheta.max(dphi), reach }
    }

    /// Adds ∫ K(axis·l) over what was peeled off, for each of some directions.
    #[inline(always)]
    pub fn add(&self, axes: &[DVec3], kernel: &Kernel, exact: &FullSum, sums: &mut [[f64; 3]]) {
        if self.texels.is_empty() {
            return;
        }
        let near = kernel.rough_parts(NEAR * self.extent, self.reach);
        for (axes, sums) in axes.chunks(LANES).zip(sums.chunks_mut(LANES)) {
            let axis = |lane: usize| axes[lane.min(axes.len() - 1)];
            let eight = Axes {
                x: std::array::from_fn(|lane| axis(lane).x),
                y: std::array::from_fn(|lane| axis(lane).y),
                z: std::array::from_fn(|lane| axis(lane).z),
            };
            let mut special = vec![];
            let sum = match kernel.is_lambert() {
                true => self.sum::<Lambert>(&eight, kernel, near, &mut special),
                false => with_profile!(kernel, P => self.sum::<P>(&eight, kernel, near, &mut special)),
            };
            for (lane, to) in sums.iter_mut().enumerate() {
                (0..3).for_each(|c| to[c] += sum[c][lane]);
            }
            self.add_special(&special, axes, kernel, near[0], exact, sums);
        }
    }

    /// The sum over the texels that take the second order, and a list of those that do not: texels that some of the directions
    /// want exactly, with a mask.
    #[inline(always)]
    fn sum<P: Profile>(
        &self,
        axes: &Axes,
        kernel: &Kernel,
        [near_from, belt]: [f64; 2],
        special: &mut Vec<(usize, [bool; LANES])>,
    ) -> [V; 3] {
        let mut sums = [ZERO; 3];
        for (index, texel) in self.texels.iter().enumerate() {
            let (middle, down, across) = (texel.middle, texel.down, texel.across);
            let mut weights = ZERO;
            let mut odd = [false; LANES];
            for i in 0..LANES {
                let (x, y, z) = (axes.x[i], axes.y[i], axes.z[i]);
                let c = x * middle.x + (y * middle.y + z * middle.z);
                let g = x * down.x + (y * down.y + z * down.z);
                let h = x * across[0] + z * across[1];
                let lit = if c > 0.0 { c } else { 0.0 };
                let (value, curvature) = P::both(kernel, lit, 1.0 - lit);
                let value = value + curvature * (1.0 / 6.0) * (g * g + h * h);
                odd[i] = (c.abs() < belt) | ((c > near_from) & (c > 0.0));
                weights[i] = if (c > 0.0) & !odd[i] { value } else { 0.0 };
            }
            for (sum, flux) in sums.iter_mut().zip(texel.flux) {
                *sum = scale_add(weights, flux, *sum);
            }
            if odd != [false; LANES] {
                special.push((index, odd));
            }
        }
        sums
    }

    #[inline(never)]
    fn add_special(
        &self,
        special: &[(usize, [bool; LANES])],
        axes: &[DVec3],
        kernel: &Kernel,
        near_from: f64,
        exact: &FullSum,
        sums: &mut [[f64; 3]],
    ) {
        if special.is_empty() {
            return;
        }
        for (lane, (axis, sum)) in axes.iter().zip(sums).enumerate() {
            let lobe = Lobe::new(*axis, kernel);
            for &(index, _) in special.iter().filter(|(_, odd)| odd[lane]) {
                let weight = self.special(index, *axis, kernel, &lobe, near_from, exact);
                (0..3).for_each(|c| sum[c] += weight * self.texels[index].flux[c]);
            }
        }
    }

    /// The mean of K over one texel that the second order is not for.
    fn special(&self, index: usize, axis: DVec3, kernel: &Kernel, lobe: &Lobe, near_from: f64, exact: &FullSum) -> f64 {
        let texel = &self.texels[index];
        let c = axis.dot(texel.middle);
        let flat = c.abs() < self.reach && is_flat(self.extent, kernel);
        if c > near_from || index < BRIGHTEST || !flat {
            let (of_map, solid_angle) = self.peel.texel(index);
            return exact.texel_weight(of_map, lobe) / solid_angle;
        }
        let g = axis.dot(texel.down).abs();
        let h = (axis.x * texel.across[0] + axis.z * texel.across[1]).abs();
        flat_horizon(c, [g, h], kernel)
    }
}

/// Over a row, weighted by sin θ: the variance of θ, and the mean of sin²θ. (At the poles, where texels are triangles, they differ
/// from a rectangle's.)
fn second_moments(theta: f64, dtheta: f64) -> [f64; 2] {
    let (mut weights, mut first, mut second, mut sin2) = (0.0, 0.0, 0.0, 0.0);
    for (t, weight) in gauss_legendre(5).iter() {
        let away = dtheta * (t - 0.5);
        let sin = libm::sin(theta + away);
        let weight = weight * sin;
        weights += weight;
        first += weight * away;
        second += weight * away * away;
        sin2 += weight * sin * sin;
    }
    let mean = first / weights;
    [second / weights - mean * mean, sin2 / weights]
}
