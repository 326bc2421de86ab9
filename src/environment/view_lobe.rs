//! The lobe of a rough mirror that is seen at an angle: what N = V = R throws away.
//!
//! A prefiltered map knows the reflected direction R and a roughness, and takes N = V = R: a lobe round about R. The lobe of a surface that
//! is seen at the angle θ to its normal is stretched (along the plane of incidence, and upwards), pulled towards the normal, cut off by the
//! surface's horizon at 90° − θ from R, and, where the surface is brushed, not round at all. Here is that lobe, for the same R:
//! GGX with Smith's height-correlated masking, f(V, l) (N·l) over its albedo at V, so that its mass is one, Fresnel's factor left out.
//!
//! R leaves one angle open, the turn of N about it: N lies between R and the sky (towards +Y; towards +X at the poles), as if
//! all surfaces were floors. The tangent lies in the plane of N and V. Anisotropy a in [0, 1] widens the lobe along the
//! tangent and narrows it across, by Burley's mapping (2012, "Physically Based Shading at Disney"): αx = α/√(1 − 0.9 a),
//! αy = α √(1 − 0.9 a). At θ = 0 and a = 0 this is the zonal kernel `g1`.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

use super::cube::{Cube, texel_direction};
use super::monte_carlo::{Estimate, Filtered, MIN_SAMPLES};
use super::panorama::Panorama;
use super::sampler::EnvironmentSampler;
use crate::error::{Error, Result};
use crate::integrate::monte_carlo::{Points, REPLICATES, Stop};
use crate::math::quadrature::gauss_legendre;
use crate::math::sobol::PointSet;
use crate::model::Lobe;
use crate::model::ggx::{Ggx, Smith};

/// How a surface is seen, and whether it is brushed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Angle between the view and the normal, in degrees, in [0, 90).
    #[serde(default)]
    pub angle: f64,
    /// Anisotropy, in [0, 1].
    #[serde(default)]
    pub anisotropy: f64,
}

/// The lobe of one roughness, of mass one.
#[derive(Debug, Clone, Copy)]
pub struct ViewLobe {
    lobe: Ggx,
    /// The view in the frame of the surface.
    wo: DVec3,
    albedo: f64,
    /// Relative standard error of the albedo.
    albedo_error: f64,
}

/// Points that the albedo is integrated with: off by some 1e-6.
const ALBEDO_SAMPLES: u64 = 1 << 17;

impl View {
    /// Whether there is such a view.
    ///
    /// **Errors**: an angle outside [0, 90), an anisotropy outside [0, 1].
    pub fn check(&self) -> Result<()> {
        if !(0.0..90.0).contains(&self.angle) {
            return Err(Error::usage(
                format!("view angle {} is not in 0..90 degrees", self.angle),
                "use the angle between view and normal, such as --view-angle 60",
            ));
        }
        if !(0.0..=1.0).contains(&self.anisotropy) {
            return Err(Error::usage(
                format!("anisotropy {} is outside its domain [0, 1]", self.anisotropy),
                "use something like --anisotropy 0.7",
            ));
        }
        Ok(())
    }

    /// αx and αy for a microfacet width.
    pub fn alphas(&self, alpha: f64) -> [f64; 2] {
        let aspect = (1.0 - 0.9 * self.anisotropy).sqrt();
        [alpha / aspect, alpha * aspect]
    }
}

impl ViewLobe {
    /// The lobe of a microfacet width in (0, 1], seen like that.
    pub fn new(alpha: f64, view: View) -> Self {
        let [alpha_x, alpha_y] = view.alphas(alpha);
        let lobe = Ggx { alpha_x, alpha_y, smith: Smith::Correlated };
        let (sin, cos) = libm::sincos(view.angle.to_radians());
        let wo = DVec3::new(sin, 0.0, cos);
        let weight = |u: [f64; 2]| [lobe.sample(wo, u).map_or(0.0, |sample| sample.weight)];
        let ([albedo], _) = Points::<2>::new(0xA1BED0).integrate(Stop::Samples(ALBEDO_SAMPLES), weight);
        Self { lobe, wo, albedo: albedo.value, albedo_error: albedo.error / albedo.value }
    }

    /// Tangent, bitangent and normal of the surface that reflects the view into the unit direction `r`.
    fn frame(&self, r: DVec3) -> [DVec3; 3] {
        let up = (DVec3::Y - r * r.y).try_normalize().unwrap_or(DVec3::X);
        let (sin, cos) = (self.wo.x, self.wo.z);
        let (normal, tangent) = (r * cos + up * sin, up * cos - r * sin);
        [tangent, normal.cross(tangent), normal]
    }

    /// The lobe's value, per steradian, for the reflected direction `r` and the light's `l`, both unit.
    pub fn eval(&self, r: DVec3, l: DVec3) -> f64 {
        self.local(self.frame(r).map(|axis| axis.dot(l)).into())
    }

    fn local(&self, wi: DVec3) -> f64 {
        if wi.z > 0.0 { self.lobe.f(self.wo, wi) * wi.z / self.albedo } else { 0.0 }
    }

    /// The panorama under the lobe, summed over all texels: what the estimates are checked against.
    ///
    /// Texels within eight widths of R are integrated with as many points as it takes, the others with two by two; the surface's horizon
    /// cuts through texels unseen: good to 1e-4 or so.
    pub fn sum(&self, panorama: &Panorama, r: DVec3) -> [f64; 3] {
        const MOST_POINTS: usize = 24;
        let (width, height) = (panorama.width(), panorama.height());
        let (dtheta, dphi) = (PI / height as f64, TAU / width as f64);
        let frame = self.frame(r);
        // The half-vector turns half as fast as the light, and slower still across the view.
        let narrowest = 2.0 * self.lobe.alpha_x.min(self.lobe.alpha_y) * self.wo.z;
        let ratio = dtheta.max(dphi) / (4.0 * narrowest);
        let fine = if ratio < 0.5 {
            (2..MOST_POINTS).find(|&n| ratio.powi(2 * n as i32) < 1e-6).unwrap_or(MOST_POINTS)
        } else {
            ((8.0 * ratio) as usize).clamp(8, MOST_POINTS)
        };
        let rules = [gauss_legendre(2), gauss_legendre(fine)];
        let near = 8.0 * self.lobe.alpha_x.max(self.lobe.alpha_y) + 2.0 * dtheta.max(dphi);
        let base = panorama.min();
        let row = |row: usize| {
            let (mut sum, mut weights) = ([0.0; 3], 0.0);
            for (column, texel) in panorama.row(row).iter().enumerate() {
                let middle = panorama.texel_box(column, row).middle();
                let rule = &rules[usize::from((middle - r).length() < near)];
                let mut weight = 0.0;
                for (t, row_weight) in rule.iter() {
                    let (sin, cos) = libm::sincos(dtheta * (row as f64 + t));
                    for (s, column_weight) in rule.iter() {
                        let (sin_phi, cos_phi) = libm::sincos(dphi * (column as f64 + s) - PI);
                        let l = DVec3::new(sin * cos_phi, cos, sin * sin_phi);
                        weight += row_weight * column_weight * sin * self.local(frame.map(|axis| axis.dot(l)).into());
                    }
                }
                weight *= dtheta * dphi;
                weights += weight;
                (0..3).for_each(|c| sum[c] += weight * f64::from(texel[c] - base[c]));
            }
            (sum, weights)
        };
        let rows: Vec<([f64; 3], f64)> = (0..height).into_par_iter().map(row).collect();
        // What quadrature makes of the lobe's mass is divided out.
        let mass: f64 = rows.iter().map(|(_, weights)| weights).sum();
        std::array::from_fn(|c| f64::from(base[c]) + rows.iter().map(|(sum, _)| sum[c]).sum::<f64>() / mass)
    }
}

/// A panorama made ready for such lobes, by multiple importance sampling as the zonal witness does, but without texels summed
/// apart.
#[derive(Debug, Clone)]
pub struct ViewMonteCarlo {
    base: [f64; 3],
    /// Nothing if the panorama is constant.
    environment: Option<EnvironmentSampler>,
    seed: u64,
}

/// A direction in the frame of the surface, K over its density, and the density.
struct LobeSample {
    local: DVec3,
    weight: f64,
    pdf: f64,
}

/// A direction drawn from the environment, its radiance beyond the base and its density.
struct LightSample {
    direction: DVec3,
    radiance: [f64; 3],
    pdf: f64,
}

/// One level's samples, shared by its texels.
struct Shared<'a> {
    environment: &'a EnvironmentSampler,
    lobe: &'a ViewLobe,
    /// Samples of each strategy in each replicate.
    n: usize,
    lobes: Vec<LobeSample>,
    lights: Vec<LightSample>,
}

impl ViewMonteCarlo {
    /// Prepares a panorama; `seed` chooses the scrambles.
    pub fn new(panorama: &Panorama, seed: u64) -> Self {
        let base = panorama.min();
        Self { base: base.map(f64::from), environment: EnvironmentSampler::new(panorama, base), seed }
    }

    /// A cube level with `samples` samples for each texel. Same bytes for every number of threads.
    ///
    /// `finished` is told how many texels have been finished since its last call.
    pub fn filter(&self, size: usize, lobe: &ViewLobe, samples: usize, finished: &(dyn Fn(u64) + Sync)) -> Filtered {
        let directions: Vec<DVec3> = (0..6 * size * size).map(|index| texel_direction(size, index)).collect();
        let (estimates, samples) = self.estimate(&directions, lobe, samples, finished);
        let (texels, standard_errors) =
            estimates.iter().map(|e| (e.value.map(|v| v as f32), e.standard_error.map(|v| v as f32))).unzip();
        Filtered { cube: Cube { size, texels }, standard_errors, samples }
    }

    /// Value and standard error for each of some unit directions, and the number of samples behind each.
    pub fn estimate(
        &self,
        directions: &[DVec3],
        lobe: &ViewLobe,
        samples: usize,
        finished: &(dyn Fn(u64) + Sync),
    ) -> (Vec<Estimate>, usize) {
        let n = samples.max(MIN_SAMPLES).div_ceil(2 * REPLICATES);
        let shared = self.environment.as_ref().map(|environment| Shared::new(environment, lobe, n, self.seed));
        let texel = |r: &DVec3| {
            let beyond = shared.as_ref().map_or(Estimate::default(), |shared| shared.estimate(*r));
            finished(1);
            Estimate {
                value: std::array::from_fn(|c| self.base[c] + beyond.value[c]),
                standard_error: std::array::from_fn(|c| {
                    beyond.standard_error[c].hypot(lobe.albedo_error * beyond.value[c])
                }),
            }
        };
        (directions.par_iter().map(texel).collect(), 2 * n * REPLICATES)
    }
}

impl<'a> Shared<'a> {
    fn new(environment: &'a EnvironmentSampler, lobe: &'a ViewLobe, n: usize, seed: u64) -> Self {
        let sets = |strategy: u64| {
            let replicate = move |r: usize| PointSet::<2>::new(seed, (2 * r) as u64 + strategy, n).points().to_vec();
            (0..REPLICATES).into_par_iter().flat_map_iter(replicate).collect::<Vec<[f64; 2]>>()
        };
        let sample = |xi: [f64; 2]| match lobe.lobe.sample(lobe.wo, xi) {
            Some(s) => LobeSample { local: s.wi, weight: s.weight / lobe.albedo, pdf: s.pdf },
            // Below the horizon: counts, and counts for nothing.
            None => LobeSample { local: DVec3::Z, weight: 0.0, pdf: 1.0 },
        };
        let light = |xi: [f64; 2]| {
            let (direction, texel) = environment.sample(xi);
            let (radiance, pdf) = environment.radiance_and_pdf(texel);
            LightSample { direction, radiance, pdf }
        };
        let (lobes, lights) = (sets(0).into_iter().map(sample).collect(), sets(1).into_iter().map(light).collect());
        Self { environment, lobe, n, lobes, lights }
    }

    /// Mean and standard error over the replicates, of the radiance beyond the base. Power heuristic with exponent 2.
    fn estimate(&self, r: DVec3) -> Estimate {
        let frame = self.lobe.frame(r);
        let [x, y, z] = frame;
        let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
        for (lobes, lights) in self.lobes.chunks_exact(self.n).zip(self.lights.chunks_exact(self.n)) {
            let mut replicate = [0.0; 3];
            for sample in lobes {
                let direction = x * sample.local.x + y * sample.local.y + z * sample.local.z;
                let (radiance, pdf) = self.environment.radiance_and_pdf(self.environment.locate(direction));
                let own = sample.pdf * sample.pdf;
                let weight = sample.weight * own / (own + pdf * pdf);
                (0..3).for_each(|c| replicate[c] += weight * radiance[c]);
            }
            for sample in lights {
                let wi = DVec3::from(frame.map(|axis| axis.dot(sample.direction)));
                if wi.z <= 0.0 {
                    continue;
                }
                let (lobe, own) = (self.lobe.lobe.pdf(self.lobe.wo, wi), sample.pdf);
                let weight = self.lobe.local(wi) * own / (own * own + lobe * lobe);
                (0..3).for_each(|c| replicate[c] += weight * sample.radiance[c]);
            }
            for c in 0..3 {
                let value = replicate[c] / self.n as f64;
                sum[c] += value;
                squares[c] += value * value;
            }
        }
        let replicates = REPLICATES as f64;
        let value = sum.map(|s| s / replicates);
        let variance = |c: usize| (squares[c] / replicates - value[c] * value[c]).max(0.0);
        Estimate { value, standard_error: std::array::from_fn(|c| (variance(c) / (replicates - 1.0)).sqrt()) }
    }
}
