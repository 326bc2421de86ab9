//! Khronos' glTF sample viewer and IBL sampler.

use super::*;

pub(super) static GLTF: Engine = Engine {
    name: "gltf",
    title: "Khronos' glTF Sample Viewer, as its IBL Sampler bakes for it",
    tables: &[
        EngineTable {
            file: "lut_ggx.png",
            format: "png:rgb8unorm",
            channels: &["ggx.scale", "ggx.bias"],
            axes: &["mu:256", "roughness:256"],
            ..PLAIN
        },
        EngineTable {
            name: "charlie-albedo",
            file: "lut_charlie.png",
            format: "png:rgb8unorm",
            // The shader reads b alone; r and g are those of the other file.
            channels: &["ggx.scale", "ggx.bias", "charlie.albedo:min(y,1)"],
            axes: &["mu:256", "roughness:256"],
            ..PLAIN
        },
    ],
    environment: Some(EngineEnvironment {
        layout: SphereLayout::Cube,
        size: 256,
        levels: Levels::DownTo(2),
        roughness: RoughnessMap::Linear,
        as_shipped: None,
        kernel: KernelKind::Nol,
        orientation: "x,y,z",
        irradiance: IrradianceKind::Cube,
        irradiance_size: 256,
        format: "ktx2:rgba16f",
        irradiance_format: "ktx2:rgba16f",
        specular_file: "specular.ktx2",
        irradiance_file: "diffuse.ktx2",
        sh: ShConvention::Kiln,
    }),
    sources: &[
        "KhronosGroup/glTF-IBL-Sampler: filter.frag, lib.cpp; KhronosGroup/glTF-Sample-Viewer: ibl.glsl (0120a8e)",
    ],
    from_memory: &[
        "that the sheen's visibility is Neubelt's, in the sampler",
        "the size of 256 for the tables: the sampler makes them as large as the cube",
    ],
    warnings: &[
        "the viewer's level is r times the number that it is told: tell it one less than there are levels",
        "the sampler's Charlie table weights samples of the lobe as if they were uniform; the right one is baked",
        "the sampler blurs by 1.8 levels too much, its solid angle lacking 4 pi; the right chain is baked",
    ],
    missing: &["the Charlie chain beside the GGX one: bake it with --kernel charlie"],
    usage: "replace the viewer's lut_ggx.png, lut_charlie.png, ggx/specular.ktx2 and lambertian/diffuse.ktx2",
};
