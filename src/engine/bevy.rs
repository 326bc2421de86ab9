//! Bevy.

use super::*;

pub(super) static BEVY: Engine = Engine {
    name: "bevy",
    title: "Bevy's bevy_pbr",
    tables: &[
        EngineTable {
            file: "dfg.ktx2",
            format: "ktx2:rg16f+zstd",
            channels: &["ggx.scale", "ggx.bias"],
            axes: &["mu:64", "roughness:64"],
            ..PLAIN
        },
        EngineTable { file: "ltc.ktx2", is_layer: true, format: "ktx2:rgba16f+zstd", ..LTC_MATRIX },
        EngineTable { file: "ltc.ktx2", is_layer: true, format: "ktx2:rgba16f+zstd", ..LTC_AMPLITUDE },
    ],
    environment: Some(EngineEnvironment {
        size: 256,
        levels: Levels::DownTo(1),
        roughness: RoughnessMap::Linear,
        kernel: KernelKind::G1,
        orientation: "x,y,-z",
        irradiance: IrradianceKind::Cube,
        format: "ktx2:rgb9e5+zstd",
        specular_file: "{name}_specular_rgb9e5_zstd.ktx2",
        irradiance_file: "{name}_diffuse_rgb9e5_zstd.ktx2",
        ..CHAIN
    }),
    sources: &[
        "bevyengine/bevy: crates/bevy_pbr/src/lib.rs, render/pbr_lighting.wesl, light_probe/, environment_map/dfg.ktx2, ltc/ltc.ktx2",
    ],
    from_memory: &[
        "that entries of the LTC matrix stand in the order of the published table, which its file was made from",
    ],
    warnings: &[
        "its own dfg.ktx2 is 0.5 % low at grazing angles: too few samples; the right one is baked",
        "bevy negates Z before it samples: a file of the glTF IBL sampler shows mirrored, this one does not",
    ],
    missing: &[],
    usage: "EnvironmentMapLight { specular_map, diffuse_map }; insert the DFG as DfgLut before PbrPlugin does; ltc.ktx2 replaces the file of that \
            name, which the feature area_light_luts embeds",
};
