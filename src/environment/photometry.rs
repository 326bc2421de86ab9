//! What a panorama's light amounts to: luminance, illuminance, dynamic range.

use super::panorama::Panorama;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What one unit of an input's values stands for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Unit {
    /// So many cd/m².
    NitsPerUnit(f64),
    /// A W/(sr·m²), of so many lumens per watt.
    Efficacy(f64),
}

impl Default for Unit {
    fn default() -> Self {
        Self::NitsPerUnit(1.0)
    }
}

impl Unit {
    /// cd/m² per unit.
    pub fn nits(self) -> f64 {
        match self {
            Self::NitsPerUnit(nits) => nits,
            Self::Efficacy(lumens_per_watt) => lumens_per_watt,
        }
    }
}

/// The light of a panorama as a lighting artist asks for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Photometry {
    /// Mean luminance over the sphere, in cd/m².
    pub mean_luminance: f64,
    /// Unoccluded illuminance of a horizontal surface that faces up (+Y), ∫ L cosθ dω, in lux.
    pub horizontal_illuminance: f64,
    /// Largest luminance of a texel, in cd/m².
    pub peak_luminance: f64,
    /// Where that texel is.
    pub peak_direction: [f64; 3],
    /// log₂ of the largest luminance over the smallest above 0, in stops.
    pub dynamic_range_ev: f64,
}

/// ∫ L max(d.y, 0) dω of each channel: the irradiance of a horizontal surface that faces up. Exact.
pub fn horizontal_irradiance(panorama: &Panorama) -> [f64; 3] {
    let width = panorama.column_edge(1) - panorama.column_edge(0);
    let mut sum = [0.0; 3];
    for row in 0..panorama.height() {
        let [high, low] = [panorama.row_edges()[row], panorama.row_edges()[row + 1]].map(|y| y.max(0.0)); // below is behind
        let weight = 0.5 * (high - low) * (high + low) * width;
        if weight > 0.0 {
            for texel in panorama.row(row) {
                for c in 0..3 {
                    sum[c] += weight * f64::from(texel[c]);
                }
            }
        }
    }
    sum
}

impl Photometry {
    /// The light of a panorama whose values have that unit.
    pub fn of(panorama: &Panorama, unit: Unit) -> Self {
        let (column, row, peak) = panorama.peak();
        let darkest = panorama
            .texels()
            .iter()
            .map(|t| panorama.luminance(t.map(f64::from)))
            .filter(|&l| l > 0.0)
            .fold(f64::INFINITY, f64::min);
        let nits = unit.nits();
        let direction: DVec3 = panorama.texel_box(column, row).middle();
        Self {
            mean_luminance: nits * panorama.luminance(panorama.mean()),
            horizontal_illuminance: nits * panorama.luminance(horizontal_irradiance(panorama)),
            peak_luminance: nits * peak,
            peak_direction: direction.to_array(),
            dynamic_range_ev: if darkest <= peak { (peak / darkest).log2() } else { 0.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_uniform_sky_of_luminance_one_lights_the_ground_with_pi_lux() {
        for (width, height) in [(8, 4), (64, 32), (34, 17)] {
            let panorama = Panorama::new(width, height, vec![[1.0; 3]; width * height]).unwrap();
            let light = Photometry::of(&panorama, Unit::NitsPerUnit(100.0));
            assert!((light.horizontal_illuminance / (100.0 * PI) - 1.0).abs() < 1e-13, "{light:?}");
            assert!((light.mean_luminance - 100.0).abs() < 1e-12 && light.dynamic_range_ev == 0.0, "{light:?}");
        }
    }

    #[test]
    fn light_from_below_does_not_reach_the_ground() {
        let texels = (0..128).map(|i| if i < 64 { [0.0; 3] } else { [1.0; 3] }).collect();
        let panorama = Panorama::new(16, 8, texels).unwrap();
        assert_eq!(horizontal_irradiance(&panorama), [0.0; 3]);
        let light = Photometry::of(&panorama, Unit::default());
        assert!((light.mean_luminance - 0.5).abs() < 1e-14 && light.peak_direction[1] < 0.0, "{light:?}");
    }

    #[test]
    fn black_has_no_dynamic_range() {
        let panorama = Panorama::new(4, 2, vec![[0.0; 3]; 8]).unwrap();
        assert_eq!(Photometry::of(&panorama, Unit::default()).dynamic_range_ev, 0.0);
    }
}
