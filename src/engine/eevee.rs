//! EEVEE.

use super::*;

pub(super) static EEVEE: Engine = Engine {
    name: "eevee",
    title: "Blender's EEVEE",
    tables: &[EngineTable {
        file: "bsdf_split_sum_ggx.h",
        format: "c:f32",
        channels: &["ggx.scale", "ggx.bias", "ggx.f82"],
        axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
        ..PLAIN
    }],
    environment: None,
    sources: &["blender/blender: eevee_lut_comp.glsl (2c3ccdf, 0882a98), eevee_lut.hh"],
    from_memory: &["that masking and shadowing are height-correlated"],
    warnings: &[],
    missing: &[
        "btdf_gt_one and the table for an index below 1: transmittance weighted by Schlick's 1 - (1 - VoH)^5",
        "ltc_mat_ggx, ltc_mag_ggx, ltc_disk_integral: linearly transformed cosines",
        "the subsurface profiles",
    ],
    usage: "replace the array of eevee_lut.cc, x fastest as here",
};
