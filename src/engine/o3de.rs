//! Open 3D Engine.

use super::*;

pub(super) static O3DE: Engine = Engine {
    name: "o3de",
    title: "Open 3D Engine's Atom",
    tables: &[
        EngineTable {
            file: "brdf.dds",
            format: "dds:rg16f",
            channels: &["ggx.scale", "ggx.bias"],
            axes: &["mu:256", "roughness:256:flip"],
            ..PLAIN
        },
        EngineTable {
            name: "ltc-matrix-m00",
            file: "ltc_mat_lutrgba32f.dds",
            format: "dds:rgba32f",
            channels: &["ltc-m00.m22", "ltc-m00.m20", "ltc-m00.m11", "ltc-m00.m02"],
            axes: &["roughness:32:edge", "mu:32:acos:edge"],
            // A half of the ulp of its largest entry; the others are known far better.
            tolerance: Some(1e-3),
            ..PLAIN
        },
        EngineTable {
            name: "ltc-magnitude",
            file: "ltc_amp_lutrg32f.dds",
            format: "dds:rg32f",
            channels: &["ggx.albedo", "ggx.bias"],
            axes: &["roughness:32:edge", "mu:32:acos:edge"],
            ..PLAIN
        },
    ],
    environment: Some(EngineEnvironment {
        size: 256,
        levels: Levels::Count(6),
        roughness: RoughnessMap::Steps(5.0),
        // Its world is right-handed with Z up: (x, -z, y) of ours. The shader looks up (-x, z, -y) of that.
        orientation: "-x,y,z",
        irradiance: IrradianceKind::Cube,
        format: "dds:rgb9e5",
        irradiance_format: Some("dds:bc6h"),
        specular_file: "{name}_iblspecularcm.dds",
        irradiance_file: "{name}_ibldiffusecm.dds",
        ..CHAIN
    }),
    sources: &[
        "o3de/o3de: BRDFTextureCS.azsl, BRDFTexture.attimage, LightingUtils.azsli, Ibl.azsli, Ltc.azsli, LtcCommon.cpp, IBL*.preset, CCubeMapProcessor.cpp",
    ],
    from_memory: &["the size of the diffuse cube"],
    warnings: &["the asset processor filters what its presets name again: give these files a preset without filtering"],
    missing: &[],
    usage: "brdf.dds is what BRDFTextureCS.azsl renders; the two LTC files replace those in Assets/Textures/LTC; the suffixes _iblspecularcm and _ibldiffusecm choose the presets of the asset processor",
};
