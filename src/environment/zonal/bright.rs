//! The sum over peeled texels, fast: eight at a time, with the texel's extent to second order.
//!
//! A texel's mean of K(R·l) is K(c̄) + K″(c̄) (g₁² + g₂²)/6, c̄ = R·(mean of l), g₁ and g₂ half the change of c across its height and
//! its width; what is left out is of fourth order in extent/distance. Texels too close for that are integrated exactly; those that
//! the horizon crosses take the integral of the first two terms of K over a flat texel, or, where they are bright enough for a flat texel
//! not to be enough, the exact one.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::lanes::{InstructionSet, LANES, V, ZERO, total};
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
    blocks: Vec<Block>,
    extent: f64,
    /// Half the diagonal of the largest.
    reach: f64,
}

/// Eight texels: mean direction, half the change of direction across height and width, radiance × solid angle.
#[derive(Debug, Clone)]
struct Block {
    middle: [V; 3],
    down: [V; 3],
    across: [V; 2],
    flux: [V; 3],
}

impl Bright {
    pub fn new(peel: Peel, panorama: &Panorama) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        let (dtheta, dphi) = (PI / height as f64, TAU / width as f64);
        let mut blocks = vec![];
        let texels: Vec<(usize, [f64; 3])> = peel.texels().collect();
        for chunk in texels.chunks(LANES) {
            let mut block = Block { middle: [ZERO; 3], down: [ZERO; 3], across: [ZERO; 2], flux: [ZERO; 3] };
            for (lane, &(index, radiance)) in chunk.iter().enumerate() {
                let row = index / width;
                let theta = dtheta * (row as f64 + 0.5);
                let (sin, cos) = libm::sincos(theta);
                let (sin_phi, cos_phi) = libm::sincos(dphi * ((index % width) as f64 + 0.5) - PI);
                // Means over θ (weighted by sin θ) and φ: ∫ sin²θ, ∫ sin θ cos θ and ∫ cos φ in closed form.
                let extent = 2.0 * sin * libm::sin(0.5 * dtheta);
                let shrink = libm::sin(0.5 * dphi) / (0.5 * dphi);
                let across = 0.5 * (dtheta - libm::cos(2.0 * theta) * libm::sin(dtheta)) / extent * shrink;
                let up = 0.5 * libm::sin(2.0 * theta) * libm::sin(dtheta) / extent;
                let set = |to: &mut [V], from: &[f64]| to.iter_mut().zip(from).for_each(|(v, x)| v[lane] = *x);
                set(&mut block.middle, &[across * cos_phi, up, across * sin_phi]);
                let [down, sin2] = second_moments(theta, dtheta);
                let half = (3.0 * down).sqrt();
                set(&mut block.down, &[half * cos * cos_phi, -half * sin, half * cos * sin_phi]);
                let half = 0.5 * dphi * sin2.sqrt();
                set(&mut block.across, &[-half * sin_phi, half * cos_phi]);
                set(&mut block.flux, &radiance.map(|r| r * panorama.solid_angle(row)));
            }
            blocks.push(block);
        }
        let reach = 0.55 * dtheta.hypot(dphi);
        Self { peel, blocks, extent: dtheta.max(dphi), reach }
    }

    /// ∫ K(axis·l) over what was peeled off.
    pub fn evaluate(&self, axis: DVec3, kernel: &Kernel, exact: &FullSum, instructions: InstructionSet) -> [f64; 3] {
        if self.blocks.is_empty() {
            return [0.0; 3];
        }
        let near = kernel.rough_parts(NEAR * self.extent, self.reach);
        let mut special = vec![];
        let sum = instructions.run(
            #[inline(always)]
            || match kernel.is_lambert() {
                true => self.sum::<Lambert>(axis, kernel, near, &mut special),
                false => with_profile!(kernel, P => self.sum::<P>(axis, kernel, near, &mut special)),
            },
        );
        let mut sum = [total(sum[0]), total(sum[1]), total(sum[2])];
        if special.is_empty() {
            return sum;
        }
        let lobe = Lobe::new(axis, kernel);
        for i in special {
            let (block, lane) = (&self.blocks[i / LANES], i % LANES);
            let weight = self.special(i, axis, kernel, &lobe, near[0], exact);
            (0..3).for_each(|c| sum[c] += weight * block.flux[c][lane]);
        }
        sum
    }

    /// The sum over the texels that take the second order, and a list of those that do not.
    #[inline(always)]
    fn sum<P: Profile>(
        &self,
        axis: DVec3,
        kernel: &Kernel,
        [near_from, belt]: [f64; 2],
        special: &mut Vec<usize>,
    ) -> [V; 3] {
        let mut sums = [ZERO; 3];
        for (b, block) in self.blocks.iter().enumerate() {
            let mut weights = ZERO;
            let mut any = false;
            for (i, weight) in weights.iter_mut().enumerate() {
                let c = axis.x * block.middle[0][i] + axis.y * block.middle[1][i] + axis.z * block.middle[2][i];
                let g = axis.x * block.down[0][i] + axis.y * block.down[1][i] + axis.z * block.down[2][i];
                let h = axis.x * block.across[0][i] + axis.z * block.across[1][i];
                let lit = if c > 0.0 { c } else { 0.0 };
                let (value, curvature) = P::both(kernel, lit, 1.0 - lit);
                let value = value + curvature * (g * g + h * h) / 6.0;
                let odd = c.abs() < belt || (c > near_from && c > 0.0);
                any |= odd;
                *weight = if c > 0.0 && !odd { value } else { 0.0 };
            }
            for (sum, flux) in sums.iter_mut().zip(&block.flux) {
                *sum = std::array::from_fn(|i| sum[i] + weights[i] * flux[i]);
            }
            if any {
                for i in 0..LANES {
                    let c = axis.x * block.middle[0][i] + axis.y * block.middle[1][i] + axis.z * block.middle[2][i];
                    if (c.abs() < belt || (c > near_from && c > 0.0)) && b * LANES + i < self.peel.len() {
                        special.push(b * LANES + i);
                    }
                }
            }
        }
        sums
    }

    /// The mean of K over one texel that the second order is not for.
    fn special(&self, i: usize, axis: DVec3, kernel: &Kernel, lobe: &Lobe, near_from: f64, exact: &FullSum) -> f64 {
        let (block, lane) = (&self.blocks[i / LANES], i % LANES);
        let [x, y, z] = block.middle.map(|v| v[lane]);
        let c = axis.dot(DVec3::new(x, y, z));
        let flat = c.abs() < self.reach && is_flat(self.extent, kernel);
        if c > near_from || i < BRIGHTEST || !flat {
            let (index, solid_angle) = self.peel.texel(i);
            return exact.texel_weight(index, lobe) / solid_angle;
        }
        let g = axis.dot(DVec3::from(block.down.map(|v| v[lane]))).abs();
        let h = (axis.x * block.across[0][lane] + axis.z * block.across[1][lane]).abs();
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
