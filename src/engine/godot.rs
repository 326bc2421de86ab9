//! Godot 4.

use super::*;

pub(super) static GODOT: Engine = Engine {
    name: "godot",
    title: "Godot 4, Forward+",
    tables: &[
        EngineTable {
            file: "dfg_lut.dds",
            format: "dds:rgba16f",
            channels: &["ggx.bias", "ggx.albedo", "charlie.albedo"],
            axes: &["mu:128", "roughness:128:flip"],
            smith: Smith::ApproxCorrelated,
            as_shipped: Some(Shipped { axes: &["mu:128", "roughness:128:flip"], smith: Smith::SchlickIbl }),
            ..PLAIN
        },
        EngineTable {
            name: "ltc-lobe",
            file: "ltc_lut1.dds",
            format: "dds:rgba32f",
            channels: &["ltc-lobe.m00", "ltc-lobe.m20", "ltc-lobe.m11", "ltc-lobe.m02"],
            axes: &["roughness:64:edge", "mu:64:acos:edge"],
            smith: Smith::ApproxCorrelated,
            ..PLAIN
        },
        EngineTable {
            name: "ltc-lobe-amplitude",
            file: "ltc_lut2.dds",
            format: "dds:rgba32f",
            channels: &["ltc-lobe.m22", "ggx.albedo", "ggx.bias", "constant.zero"],
            axes: &["roughness:64:edge", "mu:64:acos:edge"],
            smith: Smith::ApproxCorrelated,
            ..PLAIN
        },
    ],
    environment: Some(EngineEnvironment {
        size: 256,
        levels: Levels::Count(8),
        roughness: RoughnessMap::Linear,
        orientation: "x,y,z",
        irradiance: IrradianceKind::LastLevel,
        format: "dds:rgba16f",
        specular_file: "{name}_radiance.dds",
        irradiance_file: "{name}_irradiance.dds",
        ..CHAIN
    }),
    sources: &[
        "godotengine/godot: integrate_dfg.glsl (e8387d6), octmap_roughness_raster.glsl, octmap_roughness_inc.glsl, the scene shader's V_GGX, \
         area_light_inc.glsl (ltc_evaluate_specular)",
    ],
    from_memory: &[
        "8 roughness layers of a radiance map of 256",
        "that ltc_lut2 holds Schlick's part in its third channel and reads no fourth",
    ],
    warnings: &[
        "its own table takes Schlick's separable masking (k = alpha/2), its lights Hammon's approximation of the correlated one; \
         the table of the latter is baked",
        "the scale of the matrix in ltc_lut1 and ltc_lut2 means nothing to its shader: here M z has length 1",
        "Godot filters skies itself, at run time, from a panorama: the radiance cube is for shaders of your own",
    ],
    missing: &[
        "octahedral radiance maps of newer versions, which the engine renders at run time and reads from no file",
    ],
    usage: "replace dfg_lut.dds in the renderer's sources, and ltc_lut1.dds and ltc_lut2.dds in servers/rendering/storage/ltc; load the cube with ResourceLoader as a Cubemap",
};
