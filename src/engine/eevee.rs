//! EEVEE.

use super::*;

pub(super) static EEVEE: Engine = Engine {
    name: "eevee",
    title: "Blender's EEVEE",
    tables: &[
        EngineTable {
            name: "ggx-f82",
            file: "brdf_ggx.h",
            format: "c:f32",
            channels: &["ggx.scale", "ggx.bias", "ggx.f82"],
            axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
            smith: Smith::Separable,
            ..PLAIN
        },
        EngineTable {
            name: "schlick-transmittance",
            file: "btdf_ggx.h",
            format: "c:f32",
            channels: &["schlick-dielectric.transmittance"],
            axes: &["eta:64:f0-fourth-root:edge", "mu:64:sqrt-one-minus:edge", "roughness:16:edge"],
            smith: Smith::Separable,
            ..PLAIN
        },
        EngineTable {
            name: "schlick-dielectric-inside",
            file: "bsdf_ggx.h",
            format: "c:f32",
            channels: &["schlick-dielectric.scale", "schlick-dielectric.bias", "schlick-dielectric.transmittance"],
            axes: &["eta:64:0..1:square:edge", "critical:64:edge", "roughness:16:edge"],
            smith: Smith::Separable,
            ..PLAIN
        },
        EngineTable { file: "ltc_mat_ggx.h", format: "c:f32", tolerance: Some(1e-6), ..LTC_MATRIX },
        EngineTable {
            name: "ltc-magnitude",
            file: "ltc_mag_ggx.h",
            format: "c:f32",
            channels: &["ggx.scale", "ggx.bias"],
            axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "clipped-sphere",
            file: "ltc_disk_integral.h",
            format: "c:f32",
            channels: &["sphere.clipped"],
            axes: &["cos_centre:64:edge", "sin2_radius:64:edge"],
            ..PLAIN
        },
    ],
    environment: None,
    sources: &[
        "blender/blender: eevee_lut_comp.glsl (2c3ccdf, 0882a98), eevee_lut.hh, eevee_ltc_lib.glsl, eevee_bxdf_microfacet_lib.glsl",
    ],
    from_memory: &[
        "that ltc_mag_ggx is read by the sum of its channels alone, which has to be the albedo, and ltc_disk_integral over the centre's cosine and the form factor",
    ],
    warnings: &[
        "its surfaces mask and shadow separately, and so do the tables of what they reflect and let through; those of area lights are of the \
         correlated lobe, as its own are",
        "its own tables keep 1e-4 away from the ends of their axes: the limits themselves are baked",
    ],
    missing: &["the subsurface profiles: curves that its authors fitted by hand to slabs rendered in Cycles"],
    usage: "replace the arrays of eevee_lut.cc, x fastest as here",
};
