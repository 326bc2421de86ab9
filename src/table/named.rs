//! The tables that have a name: data only.

use super::axis::Axis;
use super::quantity::{Parameter, near_matches};
use crate::error::{Error, Result};

/// A table that a user can ask for by name.
#[derive(Debug)]
pub struct NamedTable {
    /// What a user writes.
    pub name: &'static str,
    /// What it is for, in one sentence.
    pub summary: &'static str,
    /// Quantities, one per channel.
    pub channels: &'static [&'static str],
    /// Parameters and sizes of the axes, the fastest first.
    pub axes: &'static [(Parameter, usize)],
}

/// Every named table.
pub static TABLES: &[NamedTable] = &[
    NamedTable {
        name: "dfg",
        summary: "split-sum environment BRDF: reflectance is F0·scale + bias",
        channels: &["ggx.scale", "ggx.bias"],
        axes: &[(Parameter::Mu, 128), (Parameter::Roughness, 128)],
    },
    NamedTable {
        name: "ggx-albedo",
        summary: "directional albedo E of GGX, for multiple-scattering compensation (Kulla–Conty, Turquin)",
        channels: &["ggx.albedo"],
        axes: &[(Parameter::Mu, 64), (Parameter::Roughness, 64)],
    },
    NamedTable {
        name: "ggx-albedo-avg",
        summary: "average albedo E_avg of GGX, the other table of Kulla–Conty compensation",
        channels: &["ggx.albedo_avg"],
        axes: &[(Parameter::Roughness, 64)],
    },
    NamedTable {
        name: "ggx-f82",
        summary: "scale, bias and the F82 tint's weight: everything that a coloured metal's reflectance needs",
        channels: &["ggx.scale", "ggx.bias", "ggx.f82"],
        axes: &[(Parameter::Mu, 64), (Parameter::Roughness, 64)],
    },
    NamedTable {
        name: "beckmann-dfg",
        summary: "split-sum environment BRDF of Beckmann's lobe",
        channels: &["beckmann.scale", "beckmann.bias"],
        axes: &[(Parameter::Mu, 64), (Parameter::Roughness, 64)],
    },
    NamedTable {
        name: "charlie-albedo",
        summary: "directional albedo of the sheen, by which the layer below it is dimmed",
        channels: &["charlie.albedo"],
        axes: &[(Parameter::Mu, 64), (Parameter::Roughness, 64)],
    },
    NamedTable {
        name: "fresnel-schlick",
        summary: "Schlick's reflectance over the angle and F0",
        channels: &["fresnel.schlick"],
        axes: &[(Parameter::Mu, 64), (Parameter::F0, 64)],
    },
    NamedTable {
        name: "burley-albedo",
        summary: "directional albedo of Disney's diffuse lobe, and of Frostbite's renormalised one",
        channels: &["burley.albedo", "burley-renormalized.albedo"],
        axes: &[(Parameter::Mu, 64), (Parameter::Roughness, 64)],
    },
    NamedTable {
        name: "fujii-albedo",
        summary: "directional albedo E of Fujii's lobe, from which EON's compensation follows for any colour",
        channels: &["fujii.albedo"],
        axes: &[(Parameter::Mu, 64), (Parameter::Roughness, 64)],
    },
];

impl NamedTable {
    /// The axes that the table has unless told otherwise: texel centres, even in the parameter.
    pub fn default_axes(&self) -> Vec<Axis> {
        self.axes.iter().map(|&(parameter, size)| Axis::new(parameter, size)).collect()
    }
}

/// The table of that name.
///
/// **Errors**: an unknown name; the message lists near matches.
pub fn find(name: &str) -> Result<&'static NamedTable> {
    TABLES.iter().find(|t| t.name == name).ok_or_else(|| {
        let names: Vec<_> = TABLES.iter().map(|t| t.name).collect();
        Error::usage(format!("no table is called {name:?}"), near_matches(name, &names, "kiln list tables"))
    })
}
