//! The sum over peeled texels, fast: eight directions at a time, with the texel's extent to second order.
//!
//! A texel's mean of K(R·l) is K(c̄) + K″(c̄) (g₁² + g₂²)/6, c̄ = R·(mean of l), g₁ and g₂ half the change of c across its height and
//! its width; what is left out is of fourth order in extent/distance. Texels too close for that are integrated exactly; those that
//! the horizon crosses take the integral of the first three terms of K over a texel that is bent to first order, or, where they are
//! bright enough for that not to be enough, the exact one.
//!
//! Of fine panoramas a sun is many texels. Seen from far enough they are one light, with a mean direction and second moments of its own in
//! each channel: what is left out is of third order, 20 (extent/distance)³ of a GGX tail's value times the light's skewness, and 4.4
//! (extent/distance)⁴ of an even disc.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::lanes::{LANES, V, ZERO, add, scale_add, total};
use crate::environment::full_sum::{Bend, FullSum, Lobe, across_horizon, is_flat, off_across};
use crate::environment::kernel::{Kernel, Lambert, Profile, with_profile};
use crate::environment::panorama::Panorama;
use crate::environment::peel::Peel;
use crate::math::quadrature::gauss_legendre;

/// Nearer than this many extents to the kernel's singularities, a texel is integrated exactly: 16⁻⁴/16 is 1e-6.
const NEAR: f64 = 16.0;
/// Farther than so many times the extent of some neighbours, they are one light: what the third order leaves is [`SKEWED`] at most, what the
/// fourth leaves 4e-6.
const FAR: f64 = 32.0;
const SKEWED: f64 = 5e-6;
/// Texels no farther from their middle than this, in radians, may be one light, if they are at least so many.
const NEIGHBOURS: f64 = 0.0125;
const LEAST_NEIGHBOURS: usize = 5;
/// Texels whose weights are known before they are summed.
const TOGETHER: usize = 16;
/// Of the first row from a pole, twice the extents to the horizon within which a texel is integrated exactly; of the others less and less.
const BELT: f64 = 4.0;
/// What all texels across the horizon that are not integrated exactly may leave, in parts of a dark output.
const LEFT_ACROSS: f64 = 2e-5;

/// Peeled texels, in the order of their flux.
#[derive(Debug)]
pub(super) struct Bright {
    peel: Peel,
    texels: Vec<Texel>,
    /// Those that are one light where they are far; and the others.
    lights: Vec<Light>,
    alone: Vec<usize>,
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
    bend: Bend,
    /// sin θ and cos θ of the middle.
    parallel: (f64, f64),
    /// How many times farther than others it must be from the horizon: near a pole a texel is a triangle, whose third moments count.
    belt: f64,
}

/// Texels beside each other, as one light.
#[derive(Debug, Clone)]
struct Light {
    members: Vec<usize>,
    /// Towards the brightest of them.
    middle: DVec3,
    /// No point of a texel is farther from a channel's mean direction, or from `middle`.
    extent: f64,
    /// From how many extents away they are one.
    far: f64,
    channels: [Moments; 3],
}

/// Of a channel: the flux, the mean direction, and half of the second moments about it: xx, yy, zz, xy, xz, yz, the last three counted twice.
#[derive(Debug, Clone, Default)]
struct Moments {
    flux: f64,
    mean: DVec3,
    second: [f64; 6],
}

impl Moments {
    fn new(texels: &[&Texel], channel: usize) -> Self {
        let flux: f64 = texels.iter().map(|texel| texel.flux[channel]).sum();
        if flux <= 0.0 {
            return Self::default();
        }
        let mean = texels.iter().map(|texel| texel.flux[channel] * texel.middle).sum::<DVec3>() / flux;
        let mut second = [0.0; 6];
        for texel in texels {
            let part = texel.flux[channel] / flux;
            let across = DVec3::new(texel.across[0], 0.0, texel.across[1]);
            for (v, weight) in [(texel.middle - mean, 0.5), (texel.down, 1.0 / 6.0), (across, 1.0 / 6.0)] {
                let products = [v.x * v.x, v.y * v.y, v.z * v.z, 2.0 * v.x * v.y, 2.0 * v.x * v.z, 2.0 * v.y * v.z];
                (0..6).for_each(|i| second[i] += part * weight * products[i]);
            }
        }
        Self { flux, mean, second }
    }

    /// The size of the third moments about the mean, in parts of extent³: no direction has a larger one.
    fn skewness(&self, texels: &[&Texel], channel: usize, extent: f64) -> f64 {
        let mut third = [0.0; 27];
        for texel in texels {
            let away = ((texel.middle - self.mean) / extent).to_array();
            for (i, sum) in third.iter_mut().enumerate() {
                *sum += texel.flux[channel] / self.flux * away[i / 9] * away[i / 3 % 3] * away[i % 3];
            }
        }
        third.iter().map(|v| v * v).sum::<f64>().sqrt()
    }
}

/// The lights that some texels, the brightest first, make up, and the texels that are on their own. No point of a texel is farther from
/// its middle than `reach`.
fn lights(texels: &[Texel], reach: f64) -> (Vec<Light>, Vec<usize>) {
    let (mut lights, mut alone) = (vec![], vec![]);
    let mut taken = vec![false; texels.len()];
    for (brightest, texel) in texels.iter().enumerate() {
        if taken[brightest] {
            continue;
        }
        let around = |centre: DVec3| -> Vec<usize> {
            let is_near = |i: &usize| !taken[*i] && texels[*i].middle.distance(centre) <= NEIGHBOURS;
            (brightest..texels.len()).filter(is_near).collect()
        };
        // The brightest may lie at the rim of what belongs together: the centre moves towards the middle.
        let mut members = around(texel.middle);
        for _ in 0..3 {
            let centre = members.iter().map(|&i| texels[i].middle).sum::<DVec3>() / members.len() as f64;
            let moved = around(centre);
            if moved.len() > members.len() && moved.contains(&brightest) {
                members = moved;
            }
        }
        if members.len() < LEAST_NEIGHBOURS {
            alone.push(brightest);
            continue;
        }
        members.iter().for_each(|&i| taken[i] = true);
        let of: Vec<&Texel> = members.iter().map(|&i| &texels[i]).collect();
        let channels: [Moments; 3] = std::array::from_fn(|c| Moments::new(&of, c));
        let centres = channels.iter().filter(|moments| moments.flux > 0.0).map(|moments| moments.mean);
        let centres: Vec<DVec3> = centres.chain([texel.middle]).collect();
        let away = of.iter().flat_map(|texel| centres.iter().map(|centre| centre.distance(texel.middle)));
        let extent = away.fold(0.0, f64::max) + reach;
        let is_lit = |c: &usize| channels[*c].flux > 0.0;
        let skewness = (0..3).filter(is_lit).map(|c| channels[c].skewness(&of, c, extent)).fold(0.0, f64::max);
        let far = libm::cbrt(20.0 * skewness / SKEWED).max(FAR);
        lights.push(Light { members, middle: texel.middle, extent, far, channels });
    }
    (lights, alone)
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
                bend: Bend::new([dtheta, dphi], (sin, cos)),
                parallel: (sin, cos),
                belt: (BELT / (row.min(height - 1 - row) as f64 + 0.5)).max(1.0),
            }
        };
        let texels: Vec<Texel> = peel.texels().map(texel).collect();
        let reach = 0.55 * dtheta.hypot(dphi);
        let (lights, alone) = lights(&texels, reach);
        Self { peel, texels, lights, alone, extent: dtheta.max(dphi), reach }
    }

    /// How many texels, of the brightest, are to be integrated exactly where the horizon crosses them, given the darkest outputs.
    pub fn exact_across(&self, kernel: &Kernel, darkest: [f64; 3]) -> usize {
        // All of the others may lie across it at once.
        let mut left = [0.0; 3];
        let shows = |texel: &Texel| {
            let off = off_across(self.extent, texel.parallel, kernel);
            (0..3).for_each(|c| left[c] += off * texel.flux[c]);
            (0..3).any(|c| left[c] > LEFT_ACROSS * darkest[c])
        };
        self.texels.iter().rposition(shows).map_or(0, |last| last + 1)
    }

    /// Adds ∫ K(axis·l) over what was peeled off, for each of some directions; of the first `exact_across` exactly across the horizon.
    #[inline(always)]
    pub fn add(
        &self,
        axes: &[DVec3],
        (kernel, exact_across): (&Kernel, usize),
        exact: &FullSum,
        sums: &mut [[f64; 3]],
    ) {
        if self.texels.is_empty() {
            return;
        }
        let near = kernel.rough_parts(NEAR * self.extent, self.reach);
        let of_light = |light: &Light| kernel.rough_parts(light.far * light.extent, light.extent);
        let near_lights: Vec<[f64; 2]> = self.lights.iter().map(of_light).collect();
        let mut listed = Vec::with_capacity(self.texels.len());
        for (axes, sums) in axes.chunks(LANES).zip(sums.chunks_mut(LANES)) {
            let axis = |lane: usize| axes[lane.min(axes.len() - 1)];
            let eight = Axes {
                x: std::array::from_fn(|lane| axis(lane).x),
                y: std::array::from_fn(|lane| axis(lane).y),
                z: std::array::from_fn(|lane| axis(lane).z),
            };
            let mut special = vec![];
            listed.clear();
            listed.extend_from_slice(&self.alone);
            let (far, sum) = match kernel.is_lambert() {
                true => (
                    self.sum_of_lights::<Lambert>(&eight, kernel, &near_lights, &mut listed),
                    self.sum::<Lambert>(&listed, &eight, kernel, near, &mut special),
                ),
                false => with_profile!(kernel, P => (
                    self.sum_of_lights::<P>(&eight, kernel, &near_lights, &mut listed),
                    self.sum::<P>(&listed, &eight, kernel, near, &mut special),
                )),
            };
            for (lane, to) in sums.iter_mut().enumerate() {
                (0..3).for_each(|c| to[c] += far[c][lane] + sum[c][lane]);
            }
            self.add_special(&special, axes, (kernel, exact_across, near[0]), exact, sums);
        }
    }

    /// The sum over the lights that are far from all of the directions; the texels of the others are listed.
    #[inline(always)]
    fn sum_of_lights<P: Profile>(
        &self,
        axes: &Axes,
        kernel: &Kernel,
        near: &[[f64; 2]],
        listed: &mut Vec<usize>,
    ) -> [V; 3] {
        let mut sums = [ZERO; 3];
        for (light, [near_from, belt]) in self.lights.iter().zip(near) {
            let mut near = ZERO;
            for (i, near) in near.iter_mut().enumerate() {
                let c = axes.x[i] * light.middle.x + (axes.y[i] * light.middle.y + axes.z[i] * light.middle.z);
                *near = if c > *near_from { 1.0 } else { 0.0 };
                *near = if c.abs() < *belt { 1.0 } else { *near };
            }
            if total(near) > 0.0 {
                listed.extend_from_slice(&light.members);
                continue;
            }
            for (sum, Moments { flux, mean, second }) in sums.iter_mut().zip(&light.channels) {
                let mut weights = ZERO;
                for (i, weight) in weights.iter_mut().enumerate() {
                    let (x, y, z) = (axes.x[i], axes.y[i], axes.z[i]);
                    let c = x * mean.x + (y * mean.y + z * mean.z);
                    let squares = x * x * second[0] + (y * y * second[1] + z * z * second[2]);
                    let spread = squares + (x * y * second[3] + (x * z * second[4] + y * z * second[5]));
                    let lit = if c > 0.0 { c } else { 0.0 };
                    let (value, curvature) = P::both(kernel, lit, 1.0 - lit);
                    let value = value + curvature * spread;
                    *weight = if c > 0.0 { value } else { 0.0 };
                }
                *sum = scale_add(weights, *flux, *sum);
            }
        }
        sums
    }

    /// The sum over those of the listed texels that take the second order, and a list of those that do not: texels that some of the
    /// directions want exactly, with a mask.
    #[inline(always)]
    fn sum<P: Profile>(
        &self,
        listed: &[usize],
        axes: &Axes,
        kernel: &Kernel,
        [near_from, belt]: [f64; 2],
        special: &mut Vec<(usize, [bool; LANES])>,
    ) -> [V; 3] {
        let mut sums = [ZERO; 3];
        let near_from = near_from.max(0.0);
        // Weights of some texels first, then their sums, a channel at a time: so the compiler keeps vectors of eight directions.
        let mut weights = [ZERO; TOGETHER];
        for listed in listed.chunks(TOGETHER) {
            for (&index, weights) in listed.iter().zip(&mut weights) {
                let texel = &self.texels[index];
                let (middle, down, across) = (texel.middle, texel.down, texel.across);
                // (Flags are numbers, which are vectors as the rest is.)
                let mut odd = ZERO;
                for i in 0..LANES {
                    let (x, y, z) = (axes.x[i], axes.y[i], axes.z[i]);
                    let c = x * middle.x + (y * middle.y + z * middle.z);
                    let g = x * down.x + (y * down.y + z * down.z);
                    let h = x * across[0] + z * across[1];
                    let lit = if c > 0.0 { c } else { 0.0 };
                    let (value, curvature) = P::both(kernel, lit, 1.0 - lit);
                    let value = value + curvature * (1.0 / 6.0) * (g * g + h * h);
                    let is_near = if c > near_from { 1.0 } else { 0.0 };
                    odd[i] = if c.abs() < belt * texel.belt { 1.0 } else { is_near };
                    let value = if odd[i] == 0.0 { value } else { 0.0 };
                    weights[i] = if c > 0.0 { value } else { 0.0 };
                }
                if total(odd) > 0.0 {
                    special.push((index, odd.map(|odd| odd > 0.0)));
                }
            }
            for (c, sum) in sums.iter_mut().enumerate() {
                // (Two sums, which need not wait for each other.)
                let (mut even, mut odd) = (*sum, ZERO);
                for (pair, weights) in listed.chunks(2).zip(weights.as_chunks::<2>().0) {
                    even = scale_add(weights[0], self.texels[pair[0]].flux[c], even);
                    if let Some(&second) = pair.get(1) {
                        odd = scale_add(weights[1], self.texels[second].flux[c], odd);
                    }
                }
                *sum = add(even, odd);
            }
        }
        sums
    }

    #[inline(never)]
    fn add_special(
        &self,
        special: &[(usize, [bool; LANES])],
        axes: &[DVec3],
        of_kernel: (&Kernel, usize, f64),
        exact: &FullSum,
        sums: &mut [[f64; 3]],
    ) {
        if special.is_empty() {
            return;
        }
        for (lane, (axis, sum)) in axes.iter().zip(sums).enumerate() {
            if !special.iter().any(|(_, odd)| odd[lane]) {
                continue;
            }
            let lobe = Lobe::new(*axis, of_kernel.0);
            for &(index, _) in special.iter().filter(|(_, odd)| odd[lane]) {
                let weight = self.special(index, *axis, of_kernel, &lobe, exact);
                (0..3).for_each(|c| sum[c] += weight * self.texels[index].flux[c]);
            }
        }
    }

    /// The mean of K over one texel that the second order is not for.
    fn special(
        &self,
        index: usize,
        axis: DVec3,
        (kernel, exact_across, near_from): (&Kernel, usize, f64),
        lobe: &Lobe,
        exact: &FullSum,
    ) -> f64 {
        let texel = &self.texels[index];
        let c = axis.dot(texel.middle);
        let flat = c.abs() < self.reach && texel.belt == 1.0 && is_flat(self.extent, kernel);
        if c > near_from || index < exact_across || !flat {
            let (of_map, solid_angle) = self.peel.texel(index);
            return exact.texel_weight(of_map, lobe) / solid_angle;
        }
        let g = axis.dot(texel.down);
        let h = axis.x * texel.across[0] + axis.z * texel.across[1];
        across_horizon(c - texel.bend.rise() * g, [g, h], texel.bend, kernel)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::KernelKind;
    use crate::environment::peel::Brightest;

    /// A lopsided sun of 20 texels, whose channels are not alike, against the exact integral over each of its texels: near, far and across
    /// horizons.
    #[test]
    fn a_sun_of_many_texels_is_one_light_from_afar() {
        let (width, height) = (2400, 1200);
        let mut texels = vec![[0.0; 3]; width * height];
        for (i, (row, column)) in (0..4).flat_map(|row| (0..5).map(move |column| (row, column))).enumerate() {
            let (row, column) = (300 + row, 700 + column);
            let i = i as f32;
            texels[row * width + column] = [1e4 + 500.0 * i, if i < 12.0 { 1e5 } else { 2e4 }, 1e3 * (1.0 + i * i)];
        }
        let panorama = Panorama::new(width, height, texels).unwrap();
        let bright = Bright::new(Peel::strongest(&panorama, &Brightest::new(&panorama), 1e-5, 64), &panorama);
        assert!(bright.lights.len() == 1 && bright.alone.is_empty(), "{} lights", bright.lights.len());
        let exact = FullSum::new(&panorama);
        let sun = panorama.texel_box(702, 302).middle();
        let (side, up) = sun.any_orthonormal_pair();
        let kernels = [
            Kernel::new(0.0625),
            Kernel::new(0.3),
            Kernel::new(1.0),
            Kernel::of(KernelKind::G1, 0.1),
            Kernel::of(KernelKind::Charlie, 0.3),
        ];
        for kernel in &kernels {
            let mut n_far = 0;
            for angle in [0.0, 0.01, 0.1, 0.3, 0.4, 0.6, 0.9, 1.2, 1.45, 1.5, 1.53, 1.565, 1.568, 1.571, 1.574, 1.7] {
                for away in [side, up, (side - up) * 0.5f64.sqrt()] {
                    let axis = (sun * f64::cos(angle) + away * f64::sin(angle)).normalize();
                    let mut got = [[0.0; 3]];
                    bright.add(&[axis], (kernel, bright.texels.len()), &exact, &mut got);
                    let lobe = Lobe::new(axis, kernel);
                    let mut wanted = [0.0; 3];
                    for (i, radiance) in bright.peel.texels() {
                        let weight = exact.texel_weight(i, &lobe);
                        (0..3).for_each(|c| wanted[c] += weight * radiance[c]);
                    }
                    let light = &bright.lights[0];
                    let [near, belt] = kernel.rough_parts(light.far * light.extent, light.extent);
                    let c = axis.dot(light.middle);
                    n_far += usize::from(c <= near && c.abs() >= belt);
                    for c in 0..3 {
                        let off = (got[0][c] - wanted[c]).abs();
                        // (Where a texel crosses the horizon, some 1e-6 of the kernel's norm is left out.)
                        let tolerance =
                            (SKEWED + 4e-6) * wanted[c] + 1e-6 * kernel.horizon()[0] * light.channels[c].flux;
                        assert!(
                            off <= tolerance,
                            "{:?} {}, {angle} away, channel {c}: {off:e} > {tolerance:e} of {}",
                            kernel.kind(),
                            kernel.alpha(),
                            wanted[c]
                        );
                    }
                }
            }
            assert!(n_far > 5, "{:?} {}: {n_far} are far", kernel.kind(), kernel.alpha());
        }
    }
}
