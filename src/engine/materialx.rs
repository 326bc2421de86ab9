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
        layout: SphereLayout::Equirect,
        size: 256,
        levels: Levels::DownTo(2),
        roughness: RoughnessMap::MaterialX,
        kernel: KernelKind::G1,
        // u = 1/2 + atan2(x, -z)/2pi: -Z in the middle.
        orientation: "z,y,-x",
        irradiance: IrradianceKind::Cube,
        format: "exr:f32",
        specular_file: "{name}_specular.exr",
        irradiance_file: "{name}_irradiance.exr",
        ..CHAIN
    }),
    sources: &[
        "AcademySoftwareFoundation/MaterialX: mx_generate_albedo_table.glsl, mx_microfacet_sheen.glsl, mx_environment_prefilter.glsl, Viewer.cpp",
    ],
    from_memory: &[],
    warnings: &[
        "MaterialXView filters panoramas itself and reads no levels from files: the chain, mips of one OpenEXR, is for renderers of your own that call \
         its shader code",
        "the last level stands for alpha 1.25, which it holds as 1; alpha 1 is read at seven eighths of the chain",
    ],
    missing: &[],
    usage: "the table replaces the one that the viewer renders when it starts; the specular panorama is u_envRadiance, with u_envRadianceMips levels, the \
            irradiance one u_envIrradiance, which holds E/pi",
};
