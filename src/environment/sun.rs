//! The sun of a panorama: found, measured and taken out.
//!
//! The sun is the connected region around the brightest texel that is brighter than the geometric mean of that texel and of the sky
//! around it (the median on a ring from 5° to 15°). What it holds above its surroundings is the light; the region is left with the
//! mean of the texels around it. Light that the lens or a resampling scattered further stays in the map.

use super::panorama::Panorama;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A directional light that stands for a sun.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sun {
    /// Unit direction towards it: the mean, weighted by flux.
    pub direction: [f64; 3],
    /// Irradiance of a surface that faces it, per channel, ∫ (L − surroundings) dω in the units of the map × sr.
    pub irradiance: [f64; 3],
    /// The same as the eye weighs it, in the map's units × sr: lux, where these are cd/m².
    pub luminance: f64,
    /// The irradiance as a colour: divided by its largest channel.
    pub colour: [f64; 3],
    /// Angular diameter of the uniform disc that has the same solid angle, in degrees.
    pub angular_diameter: f64,
    /// (∫ L dω)²/∫ L² dω: the solid angle of a uniform disc, in sr.
    pub solid_angle: f64,
    /// Its part of all the light of the map, by luminance.
    pub share: f64,
    /// Texels that it covers.
    pub texels: usize,
}

/// Angle from the brightest texel at which the sky around it begins and ends, in radians.
const RING: [f64; 2] = [5.0 * PI / 180.0, 15.0 * PI / 180.0];
/// A sun is this much brighter than the sky around it …
const CONTRAST: f64 = 16.0;
/// … and no larger than this, in sr: a disc of 5° radius.
const LARGEST: f64 = 0.024;
/// What a lamp must hold of the light to be one.
const SMALLEST_SHARE: f64 = 1e-3;

/// The sun and the map without it, if there is one.
///
/// What the map loses, channel by channel, is the light's irradiance: to rounding in f64, because it is computed from the f32 that
/// are written.
pub fn extract(panorama: &Panorama) -> Option<(Sun, Panorama)> {
    let region = Region::find(panorama)?;
    let around = region.surroundings(panorama);
    let mut texels = panorama.texels().to_vec();
    let (mut irradiance, mut squares, mut weight, mut towards) = ([0.0; 3], 0.0, 0.0, DVec3::ZERO);
    for &index in &region.texels {
        let (column, row) = (index % panorama.width(), index / panorama.width());
        let omega = panorama.solid_angle(row);
        let (old, new) = (texels[index], around.map(|v| v as f32));
        texels[index] = new;
        let lost: [f64; 3] = std::array::from_fn(|c| f64::from(old[c]) - f64::from(new[c]));
        for c in 0..3 {
            irradiance[c] += omega * lost[c];
        }
        let light = panorama.luminance(lost).max(0.0); // a dark texel inside the region must not pull the direction away
        squares += omega * light * light;
        weight += omega * light;
        towards += omega * light * panorama.texel_box(column, row).middle();
    }
    let solid_angle = weight * weight / squares;
    let largest = irradiance.iter().copied().fold(0.0, f64::max);
    let share = panorama.luminance(irradiance) / (4.0 * PI * panorama.luminance(panorama.mean()));
    if region.solid_angle > LARGEST || share < SMALLEST_SHARE || !share.is_finite() {
        return None;
    }
    let sun = Sun {
        direction: towards.normalize().to_array(),
        irradiance,
        luminance: panorama.luminance(irradiance),
        colour: irradiance.map(|v| v / largest),
        angular_diameter: 2.0 * (1.0 - solid_angle / (2.0 * PI)).acos().to_degrees(),
        solid_angle,
        share,
        texels: region.texels.len(),
    };
    Some((sun, panorama.with_texels(texels)))
}

/// The texels of the sun.
struct Region {
    texels: Vec<usize>,
    solid_angle: f64,
}

impl Region {
    fn find(panorama: &Panorama) -> Option<Self> {
        let (column, row, peak) = panorama.peak();
        let sky = sky_around(panorama, panorama.texel_box(column, row).middle())?;
        if peak <= CONTRAST * sky || peak <= 0.0 {
            return None;
        }
        // Black surroundings would let the threshold fall to nothing.
        let threshold = (peak * sky.max(peak * 1e-6)).sqrt();
        let bright = |index: usize| panorama.luminance(panorama.texels()[index].map(f64::from)) > threshold;
        let start = row * panorama.width() + column;
        let mut region = Self { texels: vec![start], solid_angle: 0.0 };
        let mut seen = vec![false; panorama.texels().len()];
        seen[start] = true;
        let mut next = 0;
        while next < region.texels.len() {
            let index = region.texels[next];
            next += 1;
            region.solid_angle += panorama.solid_angle(index / panorama.width());
            if region.solid_angle > LARGEST {
                return None;
            }
            for neighbour in neighbours(panorama, index) {
                if !std::mem::replace(&mut seen[neighbour], true) && bright(neighbour) {
                    region.texels.push(neighbour);
                }
            }
        }
        region.texels.sort_unstable();
        Some(region)
    }

    /// Mean radiance of the texels that touch the region.
    fn surroundings(&self, panorama: &Panorama) -> [f64; 3] {
        let mut around: Vec<usize> = self.texels.iter().flat_map(|&index| neighbours(panorama, index)).collect();
        around.sort_unstable();
        around.dedup();
        around.retain(|index| self.texels.binary_search(index).is_err());
        let (mut sum, mut total) = ([0.0_f64; 3], 0.0);
        for index in around {
            let omega = panorama.solid_angle(index / panorama.width());
            total += omega;
            let texel = panorama.texels()[index];
            sum = std::array::from_fn(|c| sum[c] + omega * f64::from(texel[c]));
        }
        // A region that fills its whole neighbourhood, which a panorama of a few texels can have, is surrounded by nothing.
        sum.map(|s| if total > 0.0 { s / total } else { 0.0 })
    }
}

/// The eight texels around one, across the seam; over a pole, the row's own.
fn neighbours(panorama: &Panorama, index: usize) -> impl Iterator<Item = usize> + use<> {
    let (width, height) = (panorama.width(), panorama.height());
    let (column, row) = (index % width, index / width);
    let rows = row.saturating_sub(1)..=(row + 1).min(height - 1);
    rows.flat_map(move |r| [width - 1, 0, 1].map(|step| r * width + (column + step) % width))
        .filter(move |&neighbour| neighbour != index)
}

/// Median luminance on the ring around a direction.
fn sky_around(panorama: &Panorama, centre: DVec3) -> Option<f64> {
    let [near, far] = RING.map(f64::cos);
    let mut found: Vec<f64> = vec![];
    for row in 0..panorama.height() {
        // A row that is further away than the ring's outer edge.
        let [high, low] = [panorama.row_edges()[row], panorama.row_edges()[row + 1]];
        let gap = (low.acos() - centre.y.acos()).abs().min((high.acos() - centre.y.acos()).abs());
        if gap > RING[1] + PI / panorama.height() as f64 {
            continue;
        }
        for column in 0..panorama.width() {
            let cosine = panorama.texel_box(column, row).middle().dot(centre);
            if (far..=near).contains(&cosine) {
                found.push(panorama.luminance(panorama.row(row)[column].map(f64::from)));
            }
        }
    }
    let middle = found.len() / 2;
    (!found.is_empty()).then(|| *found.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::super::builtin::{builtin, sun_direction};
    use super::super::sun_disc::ANGULAR_RADIUS;
    use super::*;

    fn flux(panorama: &Panorama) -> [f64; 3] {
        panorama.mean().map(|m| 4.0 * PI * m)
    }

    #[test]
    fn the_built_in_sun_is_found_where_it_stands_and_leaves_its_energy_behind() {
        for (name, width) in [("sun", 1024), ("sun", 256), ("sky", 1024)] {
            let panorama = builtin(name, width).unwrap();
            let (sun, rest) = extract(&panorama).expect("a sun");
            // The middles of texels stand for what they hold: half a texel of error at most.
            let off = DVec3::from(sun.direction).angle_between(sun_direction());
            assert!(name == "sky" || off < PI / width as f64, "{name} {width}: {off} off");
            let (whole, left) = (flux(&panorama), flux(&rest));
            for c in 0..3 {
                let missing = (left[c] + sun.irradiance[c]) / whole[c] - 1.0;
                assert!(missing.abs() < 1e-12, "{name} {width} channel {c}: {missing:e} of the energy");
            }
            assert!(extract(&rest).is_none_or(|(again, _)| again.share < 0.1 * sun.share), "{name} {width}");
        }
    }

    #[test]
    fn a_resolved_sun_has_its_size() {
        let (sun, _) = extract(&builtin("sun", 4096).unwrap()).expect("a sun");
        let wanted = 2.0 * ANGULAR_RADIUS.to_degrees();
        // Texels that the disc covers in part widen it: by less than one of them.
        assert!((sun.angular_diameter - wanted).abs() < 360.0 / 4096.0, "{} for {wanted}", sun.angular_diameter);
    }

    #[test]
    fn soft_light_has_no_sun() {
        for name in ["white", "gradient"] {
            assert!(extract(&builtin(name, 128).unwrap()).is_none(), "{name}");
        }
        // A bright half is no sun either.
        let texels = (0..512).map(|i| if i % 32 < 16 { [1000.0; 3] } else { [1.0; 3] }).collect();
        assert!(extract(&Panorama::new(32, 16, texels).unwrap()).is_none());
    }

    #[test]
    fn a_sun_across_the_seam_is_one_sun() {
        let mut texels = vec![[1.0; 3]; 256 * 128];
        for index in [40 * 256, 40 * 256 + 255] {
            texels[index] = [1e5, 8e4, 6e4];
        }
        let (sun, rest) = extract(&Panorama::new(256, 128, texels).unwrap()).expect("a sun");
        assert_eq!(sun.texels, 2);
        assert!(DVec3::from(sun.direction).z.abs() < 1e-12 && sun.direction[0] < 0.0, "{sun:?}");
        assert_eq!(rest.max(), [1.0; 3]);
        assert!((sun.colour[1] - 0.8).abs() < 1e-4, "{sun:?}");
    }
}
