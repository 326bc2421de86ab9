//! MaterialX.

use super::*;

pub(super) static MATERIALX: Engine = Engine {
    name: "materialx",
    title: "MaterialXView",
    tables: &[EngineTable {
        file: "albedo_table.exr",
        format: "exr:f32",
        channels: &["ggx.scale", "ggx.bias", "charlie.albedo"],
        // The sheen's roughness is what Kiln calls alpha, so that one axis serves both.
        axes: &["mu:128", "alpha:128"],
        ..PLAIN
    }],
    environment: Some(EngineEnvironment {
        size: 256,
        levels: Levels::DownTo(2),
        roughness: RoughnessMap::MaterialX,
        as_shipped: None,
        kernel: KernelKind::G1,
        orientation: "x,y,z",
        irradiance: IrradianceKind::Cube,
        irradiance_size: 32,
        format: "ktx2:rgba32f",
        irradiance_format: "ktx2:rgba32f",
        specular_file: "{name}_specular.ktx2",
        irradiance_file: "{name}_irradiance.ktx2",
        sh: ShConvention::Kiln,
    }),
    sources: &[
        "AcademySoftwareFoundation/MaterialX: mx_generate_albedo_table.glsl, mx_microfacet_sheen.glsl, mx_environment_prefilter.glsl, Viewer.cpp",
    ],
    from_memory: &[],
    warnings: &[
        "MaterialXView reads panoramas, not cubes: turn the levels into panoramas with `kiln convert`",
        "the last level stands for alpha 1.25, which it holds as 1; alpha 1 is read at seven eighths of the chain",
    ],
    missing: &["a chain of panoramas as one file"],
    usage: "the table replaces the one that the viewer renders when it starts",
};
