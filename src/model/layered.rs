//! A diffuse base under a specular interface: what the interface leaves to the base, k_d.

use serde::{Deserialize, Serialize};

/// The factor of a diffuse base under a specular lobe. F is Schlick's reflectance, R(μ) the directional albedo of the specular
/// lobe with F, R_avg its average.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kd {
    /// 1 − F(wo·h): the habit of real-time shaders. Reciprocal, but it does not conserve energy: more than all is reflected at
    /// grazing angles, where the half-vectors of a diffuse lobe face the light.
    Fresnel,
    /// 1 − R(μo): conserves energy, not reciprocal.
    #[default]
    Albedo,
    /// (1 − R(μo))(1 − R(μi))/(1 − R_avg): conserves energy and is reciprocal.
    Reciprocal,
}

impl Kd {
    /// Every choice.
    pub const ALL: [Self; 3] = [Self::Fresnel, Self::Albedo, Self::Reciprocal];

    /// The name that a user writes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fresnel => "fresnel",
            Self::Albedo => "albedo",
            Self::Reciprocal => "reciprocal",
        }
    }
}
