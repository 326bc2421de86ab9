//! EEVEE.

use super::*;

pub(super) static EEVEE: Engine = Engine {
    name: "eevee",
    title: "Blender's EEVEE",
    tables: &[
        EngineTable {
            file: "bsdf_split_sum_ggx.h",
            format: "c:f32",
            channels: &["ggx.scale", "ggx.bias", "ggx.f82"],
            axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
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
    sources: &["blender/blender: eevee_lut_comp.glsl (2c3ccdf, 0882a98), eevee_lut.hh, eevee_ltc_lib.glsl"],
    from_memory: &[
        "that masking and shadowing are height-correlated",
        "that ltc_mag_ggx is read by the sum of its channels alone, which has to be the albedo, and ltc_disk_integral over the centre's cosine and the form factor",
    ],
    warnings: &[],
    missing: &[
        "btdf_gt_one and the table for an index below 1: transmittance weighted by Schlick's 1 - (1 - VoH)^5",
        "the subsurface profiles",
    ],
    usage: "replace the arrays of eevee_lut.cc, x fastest as here",
};
