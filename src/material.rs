//! Materials that are common in rendering: reflectances at normal incidence, and complex indices where a source gives them.

use crate::error::{Error, Result};
use crate::model::fresnel::eta_of_f0;

/// A material by name.
#[derive(Debug)]
pub struct Material {
    /// What a user writes.
    pub name: &'static str,
    /// What it reflects.
    pub reflectance: Reflectance,
}

/// Reflectance at normal incidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reflectance {
    /// A dielectric: the range of F0 that its kind has; the same twice where one value is known.
    Dielectric {
        /// Smallest F0.
        low: f64,
        /// Largest F0.
        high: f64,
    },
    /// A metal.
    Metal {
        /// F0 of red, green and blue: linear, primaries of Rec. 709.
        f0: [f64; 3],
        /// Complex index n + ik of red, green and blue.
        index: Option<[[f64; 2]; 3]>,
    },
}

/// One value to compute with: a channel of a metal, or an end of a dielectric's range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// `red`, `green`, `blue`; `low`, `high`; or nothing.
    pub name: &'static str,
    /// Reflectance at normal incidence.
    pub f0: f64,
    /// Relative index of refraction of a dielectric.
    pub eta: Option<f64>,
    /// Complex index of a metal.
    pub index: Option<[f64; 2]>,
}

const fn dielectric(name: &'static str, low: f64, high: f64) -> Material {
    Material { name, reflectance: Reflectance::Dielectric { low, high } }
}

const fn metal(name: &'static str, f0: [f64; 3], index: Option<[[f64; 2]; 3]>) -> Material {
    Material { name, reflectance: Reflectance::Metal { f0, index } }
}

/// Every material: dielectrics by F0, then metals by luminance.
///
/// **Source**: F0 as tables of real-time rendering give them. Complex indices: the LabPBR material standard, as the shader packs
/// that implement it quote them; one wavelength per channel, so that F0 computed from them is a little off the F0 beside.
pub static MATERIALS: &[Material] = &[
    dielectric("default", 0.04, 0.04),
    dielectric("water", 0.02, 0.02),
    dielectric("eyes", 0.025, 0.025),
    dielectric("skin", 0.028, 0.028),
    dielectric("living-tissue", 0.02, 0.04),
    dielectric("stone", 0.035, 0.056),
    dielectric("hair", 0.046, 0.046),
    dielectric("plastic", 0.04, 0.05),
    dielectric("glass", 0.04, 0.05),
    dielectric("fabric", 0.04, 0.056),
    dielectric("teeth", 0.058, 0.058),
    dielectric("crystal-glass", 0.05, 0.07),
    dielectric("gems", 0.05, 0.08),
    dielectric("diamond-like", 0.13, 0.2),
    metal("titanium", [0.542, 0.497, 0.449], None),
    metal("chromium", [0.549, 0.556, 0.554], Some([[3.1071, 3.3314], [3.1812, 3.3291], [2.3230, 3.1350]])),
    metal("iron", [0.562, 0.565, 0.578], Some([[2.9114, 3.0893], [2.9497, 2.9318], [2.5845, 2.7670]])),
    metal("nickel", [0.660, 0.609, 0.526], None),
    metal("platinum", [0.673, 0.637, 0.585], Some([[2.3757, 4.2655], [2.0847, 3.7153], [1.8453, 3.1365]])),
    metal("copper", [0.955, 0.638, 0.538], Some([[0.27105, 3.6092], [0.67693, 2.6248], [1.3164, 2.2921]])),
    metal("palladium", [0.733, 0.697, 0.652], None),
    metal("mercury", [0.781, 0.780, 0.778], None),
    metal("brass", [0.910, 0.778, 0.423], None),
    metal("zinc", [0.664, 0.824, 0.850], None),
    metal("gold", [1.000, 0.782, 0.344], Some([[0.18299, 3.4242], [0.42108, 2.3459], [1.3734, 1.7704]])),
    metal("aluminium", [0.913, 0.922, 0.924], Some([[1.3456, 7.4746], [0.96521, 6.3995], [0.61722, 5.3031]])),
    metal("silver", [0.972, 0.960, 0.915], Some([[0.15943, 3.9291], [0.14512, 3.1900], [0.13547, 2.3808]])),
];

impl Material {
    /// What to compute with: three channels of a metal, one or both ends of a dielectric's range.
    pub fn parts(&self) -> Vec<Part> {
        let insulator = |name, f0| Part { name, f0, eta: Some(eta_of_f0(f0)), index: None };
        match self.reflectance {
            Reflectance::Dielectric { low, high } if low == high => vec![insulator("", low)],
            Reflectance::Dielectric { low, high } => vec![insulator("low", low), insulator("high", high)],
            Reflectance::Metal { f0, index } => ["red", "green", "blue"]
                .into_iter()
                .enumerate()
                .map(|(c, name)| Part { name, f0: f0[c], eta: None, index: index.map(|i| i[c]) })
                .collect(),
        }
    }

    /// Whether it is a metal.
    pub fn is_metal(&self) -> bool {
        matches!(self.reflectance, Reflectance::Metal { .. })
    }
}

/// The material of that name.
///
/// **Errors**: an unknown name.
pub fn find(name: &str) -> Result<&'static Material> {
    MATERIALS.iter().find(|m| m.name == name).ok_or_else(|| {
        let names: Vec<_> = MATERIALS.iter().map(|m| m.name).collect();
        Error::usage(format!("no material is called {name:?}"), format!("use one of {}", names.join(", ")))
    })
}

/// The sRGB byte of a linear value in [0, 1].
///
/// **Source**: IEC 61966-2-1.
pub fn srgb_byte(linear: f64) -> u8 {
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8 // saturates beyond [0, 1], which no reflectance is
}
