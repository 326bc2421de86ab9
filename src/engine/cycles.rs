//! Cycles.

use super::*;

pub(super) static CYCLES: Engine = Engine {
    name: "cycles",
    title: "Blender's Cycles",
    tables: &[
        EngineTable {
            name: "ggx-albedo",
            file: "ggx_E.h",
            format: "c:f32",
            channels: &["ggx.albedo"],
            axes: &["roughness:32:edge", "mu:32:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "ggx-albedo-avg",
            file: "ggx_Eavg.h",
            format: "c:f32",
            channels: &["ggx.albedo_avg"],
            axes: &["roughness:32:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "dielectric-albedo",
            file: "ggx_glass_E.h",
            format: "c:f32",
            channels: &["dielectric.albedo"],
            axes: &["roughness:16:edge", "mu:16:edge", "eta:16:f0-fourth-root:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "dielectric-albedo-inverse",
            file: "ggx_glass_inv_E.h",
            format: "c:f32",
            channels: &["dielectric.albedo"],
            axes: &["roughness:16:edge", "mu:16:edge", "eta:16:0..1:f0-fourth-root:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "dielectric-albedo-avg",
            file: "ggx_glass_Eavg.h",
            format: "c:f32",
            channels: &["dielectric.albedo_avg"],
            axes: &["roughness:16:edge", "eta:16:f0-fourth-root:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "dielectric-albedo-avg-inverse",
            file: "ggx_glass_inv_Eavg.h",
            format: "c:f32",
            channels: &["dielectric.albedo_avg"],
            axes: &["roughness:16:edge", "eta:16:0..1:f0-fourth-root:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "generalized-schlick",
            file: "ggx_gen_schlick_s.h",
            format: "c:f32",
            channels: &["ggx.power_weight"],
            axes: &["roughness:16:edge", "mu:16:edge", "exponent:16:reciprocal+5:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "generalized-schlick-dielectric",
            file: "ggx_gen_schlick_ior_s.h",
            format: "c:f32",
            channels: &["ggx.dielectric_weight"],
            axes: &["roughness:16:edge", "mu:16:edge", "eta:16:f0-fourth-root:edge"],
            ..PLAIN
        },
    ],
    environment: None,
    sources: &[
        "blender/cycles: app/cycles_precompute.cpp, kernel/closure/bsdf_microfacet.h, bsdf_sheen.h, scene/shader.tables, scene/shader.cpp",
    ],
    from_memory: &[],
    warnings: &[
        "its own glass tables are of an older sampler, off by up to 0.93; the right ones are baked",
        "its own ggx_E is not monotone at the horizon (0.98 at r = 1/31); at the horizon the limit 1 is baked",
        "Cycles clamps to 1e-4..1 and the index' axis to 0.99: the limits themselves are baked",
        "its own ggx_gen_schlick tables average over the normals that were drawn, those that reflect below the horizon as nothing, whatever is \
         shadowed: too low by their share, a third at r = 1; the average over what is reflected is baked, which times E is the albedo",
    ],
    missing: &[
        "sheen_ltc: a fit to simulated fibres (Zeltner, Burley and Chiang 2022), which no formula of a lobe gives",
        "thin_film_cmf: the Fourier transform of measured colour matching functions, no function of a material",
    ],
    usage: "replace the arrays of scene/shader.tables, x fastest as here",
};
