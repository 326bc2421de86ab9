//! The tables that have a name: data only.

use super::axis::Axis;
use super::quantity::{Point, near_matches};
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
    /// The axes as a user writes them, the fastest first.
    pub axes: &'static [&'static str],
    /// Values of the other parameters, as a user writes them.
    pub at: &'static [&'static str],
    /// What its values are integrated to, where the usual tolerance is beyond what they reach.
    pub tolerance: Option<f64>,
}

/// Every named table.
pub static TABLES: &[NamedTable] = &[
    NamedTable {
        name: "dfg",
        summary: "split-sum environment BRDF: reflectance is F0·scale + bias",
        channels: &["ggx.scale", "ggx.bias"],
        axes: &["mu:128", "roughness:128"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "ggx-albedo",
        summary: "directional albedo E of GGX, for multiple-scattering compensation (Kulla–Conty, Turquin)",
        channels: &["ggx.albedo"],
        axes: &["mu:64", "roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "ggx-albedo-avg",
        summary: "average albedo E_avg of GGX, the other table of Kulla–Conty compensation",
        channels: &["ggx.albedo_avg"],
        axes: &["roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "ggx-f82",
        summary: "scale, bias and the F82 tint's weight: everything that a coloured metal's reflectance needs",
        channels: &["ggx.scale", "ggx.bias", "ggx.f82"],
        axes: &["mu:64", "roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "beckmann-dfg",
        summary: "split-sum environment BRDF of Beckmann's lobe",
        channels: &["beckmann.scale", "beckmann.bias"],
        axes: &["mu:64", "roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "charlie-albedo",
        summary: "directional albedo of the sheen, by which the layer below it is dimmed",
        channels: &["charlie.albedo"],
        axes: &["mu:64", "roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "cloth-split",
        summary: "split-sum albedo of the sheen, and Unity's diffuse albedo beside it: reflectance is F0·albedo + (F90 − F0)·bias",
        channels: &["charlie.bias", "charlie.albedo", "fabric-lambert.albedo"],
        axes: &["mu:64", "roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "generalized-schlick",
        summary: "how far GGX with a generalised Schlick reflectance is from F0 to F90, over the exponent; Cycles' axes",
        channels: &["ggx.power_weight"],
        axes: &["roughness:16:edge", "mu:16:edge", "exponent:16:reciprocal+5:edge"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "generalized-schlick-dielectric",
        summary: "the same where the way from F0 to F90 is a dielectric's own reflectance, over its index",
        channels: &["ggx.dielectric_weight"],
        axes: &["roughness:16:edge", "mu:16:edge", "eta:16:f0-fourth-root:edge"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "schlick-dielectric",
        summary: "what F0, F90 and 1 − F0 scale of glass with Schlick's reflectance, entered from outside",
        channels: &["schlick-dielectric.scale", "schlick-dielectric.bias", "schlick-dielectric.transmittance"],
        axes: &["mu:16", "roughness:16", "eta:16:f0-fourth-root"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "schlick-transmittance",
        summary: "what glass with Schlick's reflectance lets through, in parts of 1 − F0, entered from outside",
        channels: &["schlick-dielectric.transmittance"],
        axes: &["eta:16:f0-fourth-root", "mu:16:sqrt-one-minus", "roughness:16"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "schlick-dielectric-inside",
        summary: "scale, bias and transmittance of the same from inside, about the critical angle",
        channels: &["schlick-dielectric.scale", "schlick-dielectric.bias", "schlick-dielectric.transmittance"],
        axes: &["eta:16:0..1:square", "critical:16", "roughness:16"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "dielectric",
        summary: "what glass reflects and lets through, entered from outside; Cycles' axis for the index, F0 = z⁴",
        channels: &["dielectric.reflectance", "dielectric.transmittance"],
        axes: &["mu:16", "roughness:16", "eta:16:f0-fourth-root"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "dielectric-inside",
        summary: "the same from inside: eta is 1 over the index",
        channels: &["dielectric.reflectance", "dielectric.transmittance"],
        axes: &["mu:16", "roughness:16", "eta:16:0..1:f0-fourth-root"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "dielectric-avg",
        summary: "average albedo of glass over alpha and its index, for the compensation of a rough interface",
        channels: &["dielectric.reflectance_avg", "dielectric.transmittance_avg", "dielectric.albedo_avg"],
        axes: &["roughness:16", "eta:16:f0-fourth-root"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "fresnel-dielectric",
        summary: "exact reflectance of a smooth interface between dielectrics over the angle and the index: unpolarised, r∥², r⊥²",
        channels: &["fresnel.dielectric", "fresnel.dielectric_parallel", "fresnel.dielectric_perpendicular"],
        axes: &["mu:64", "eta:64:1..3"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "beckmann-albedo-avg",
        summary: "average albedo of Beckmann's lobe",
        channels: &["beckmann.albedo_avg"],
        axes: &["roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "charlie-albedo-avg",
        summary: "average albedo of the sheen",
        channels: &["charlie.albedo_avg"],
        axes: &["roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "oren-nayar-albedo",
        summary: "directional albedo of Oren and Nayar's qualitative diffuse lobe",
        channels: &["oren-nayar.albedo"],
        axes: &["mu:64", "sigma:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "eon-albedo",
        summary: "directional albedo of EON over the angle, the roughness and the colour",
        channels: &["eon.albedo"],
        axes: &["mu:16", "roughness:16", "rho:16"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "conductor-albedo",
        summary: "directional albedo of gold in green light (n 0.42, k 2.35) by the exact Fresnel equations; --n and --k for others",
        channels: &["conductor.albedo"],
        axes: &["mu:64", "roughness:64"],
        at: &["n=0.42", "k=2.35"],
        tolerance: None,
    },
    NamedTable {
        name: "ggx-albedo-anisotropic",
        summary: "directional albedo of an anisotropic GGX seen from between its axes, by Monte Carlo; --phi for others",
        channels: &["ggx.albedo"],
        axes: &["mu:8", "alpha_x:8", "alpha_y:8"],
        at: &["phi=0.7853981633974483"],
        tolerance: None,
    },
    NamedTable {
        name: "beckmann-albedo",
        summary: "directional albedo E of Beckmann's lobe",
        channels: &["beckmann.albedo"],
        axes: &["mu:64", "roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "dielectric-albedo",
        summary: "what single scattering keeps of the light on glass, reflected or let through",
        channels: &["dielectric.albedo"],
        axes: &["mu:16", "roughness:16", "eta:16:f0-fourth-root"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "fresnel-conductor",
        summary: "exact reflectance of a metal over the angle and its complex index",
        channels: &["fresnel.conductor"],
        axes: &["mu:32", "n:32:0.1..4", "k:32:0..8"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "fresnel-f82",
        summary: "Schlick's reflectance with a metal's dip at 82°",
        channels: &["fresnel.f82"],
        axes: &["mu:32", "f0:32", "f82:16"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "fresnel-schlick-avg",
        summary: "average of Schlick's reflectance",
        channels: &["fresnel.schlick_avg"],
        axes: &["f0:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "fresnel-dielectric-avg",
        summary: "average reflectance of a smooth dielectric",
        channels: &["fresnel.dielectric_avg"],
        axes: &["eta:64:1..3"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "fresnel-conductor-avg",
        summary: "average reflectance of a smooth metal over its complex index",
        channels: &["fresnel.conductor_avg"],
        axes: &["n:64:0.1..4", "k:64:0..8"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "layered-albedo",
        summary: "directional albedo of a diffuse base of albedo 0.8 under GGX: 1 − it is what the chosen --kd loses",
        channels: &["layered.albedo"],
        axes: &["mu:32", "roughness:32", "f0:8"],
        at: &["rho=0.8"],
        tolerance: None,
    },
    NamedTable {
        name: "compensation",
        summary: "albedo of GGX with Schlick's reflectance, bare and by four compensations of the scattering that it loses",
        channels: &[
            "compensation.none",
            "compensation.kulla-conty",
            "compensation.kulla-conty-squared",
            "compensation.turquin",
            "compensation.fdez-aguera",
        ],
        axes: &["mu:32", "roughness:32", "f0:8"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "lambert-albedo",
        summary: "directional albedo of Lambert's lobe: 1 in every texel, to try a reader with",
        channels: &["lambert.albedo"],
        axes: &["mu:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "fresnel-schlick",
        summary: "Schlick's reflectance over the angle and F0",
        channels: &["fresnel.schlick"],
        axes: &["mu:64", "f0:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "burley-albedo",
        summary: "directional albedo of Disney's diffuse lobe, and of Frostbite's renormalised one",
        channels: &["burley.albedo", "burley-renormalized.albedo"],
        axes: &["mu:64", "roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "fujii-albedo",
        summary: "directional albedo E of Fujii's lobe, from which EON's compensation follows for any colour",
        channels: &["fujii.albedo"],
        axes: &["mu:64", "roughness:64"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "ltc-matrix",
        summary: "linearly transformed cosines for area lights: the inverse matrix' entries in parts of m11, in the usual order of columns",
        channels: &["ltc.m00", "ltc.m20", "ltc.m02", "ltc.m22"],
        axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "ltc-amplitude",
        summary: "the texture beside it: albedo, Schlick's part of it, nothing, and the form factor of a sphere cut off by the horizon",
        channels: &["ggx.albedo", "ggx.bias", "constant.zero", "sphere.clipped"],
        axes: &["roughness:64:edge:+cos_centre", "mu:64:sqrt-one-minus:edge:+sin2_radius"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "ltc-matrix-m22",
        summary: "the inverse matrix in parts of m22, as Unity has it: m00, m20, m11, m02",
        channels: &["ltc-m22.m00", "ltc-m22.m20", "ltc-m22.m11", "ltc-m22.m02"],
        axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
        at: &[],
        tolerance: Some(2e-5),
    },
    NamedTable {
        name: "ltc-matrix-m00",
        summary: "the inverse matrix in parts of m00, as it was first published: m22, m20, m11, m02",
        channels: &["ltc-m00.m22", "ltc-m00.m20", "ltc-m00.m11", "ltc-m00.m02"],
        axes: &["roughness:32:edge", "mu:32:acos:edge"],
        at: &[],
        tolerance: Some(1e-3),
    },
    NamedTable {
        name: "ltc-lobe",
        summary: "the matrix of linearly transformed cosines itself, not its inverse, but for m22, which the next table has",
        channels: &["ltc-lobe.m00", "ltc-lobe.m20", "ltc-lobe.m11", "ltc-lobe.m02"],
        axes: &["roughness:64:edge", "mu:64:acos:edge"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "ltc-lobe-amplitude",
        summary: "the texture beside it: the matrix' m22, albedo, Schlick's part of it, nothing",
        channels: &["ltc-lobe.m22", "ggx.albedo", "ggx.bias", "constant.zero"],
        axes: &["roughness:64:edge", "mu:64:acos:edge"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "ltc-burley",
        summary: "the inverse matrix of Disney's diffuse lobe in parts of m22, as Unity has it: m00, m20, m11, m02",
        channels: &["ltc-burley.m00", "ltc-burley.m20", "ltc-burley.m11", "ltc-burley.m02"],
        axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
        at: &[],
        tolerance: None,
    },
    NamedTable {
        name: "ltc-charlie",
        summary: "the inverse matrix of Charlie's sheen, with Neubelt's visibility, in parts of m22: m00, m20, m11, m02",
        channels: &["ltc-charlie.m00", "ltc-charlie.m20", "ltc-charlie.m11", "ltc-charlie.m02"],
        axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
        at: &[],
        tolerance: Some(1e-5),
    },
    NamedTable {
        name: "clipped-sphere",
        summary: "the form factor of a sphere cut off by the horizon, on its own",
        channels: &["sphere.clipped"],
        axes: &["cos_centre:64:edge", "sin2_radius:64:edge"],
        at: &[],
        tolerance: None,
    },
];

impl NamedTable {
    /// The axes that the table has unless told otherwise.
    ///
    /// **Errors**: none, as a test parses every one.
    pub fn default_axes(&self) -> Result<Vec<Axis>> {
        self.axes.iter().map(|axis| axis.parse()).collect()
    }

    /// The values that the other parameters have unless told otherwise.
    ///
    /// **Errors**: none, as a test parses every one.
    pub fn default_point(&self) -> Result<Point> {
        self.at.iter().map(|&text| text.to_owned()).collect::<Vec<String>>().try_into()
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
