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
        EngineTable {
            name: "sheen-albedo",
            file: "lut_sheen_E.png",
            format: "png:r8unorm",
            channels: &["charlie.albedo:min(y,1)"],
            axes: &["mu:256", "roughness:256"],
            visibility: Visibility::Charlie,
            ..PLAIN
        },
    ],
    environment: Some(EngineEnvironment {
        size: 256,
        levels: Levels::DownTo(2),
        roughness: RoughnessMap::Linear,
        orientation: "x,y,z",
        irradiance: IrradianceKind::Cube,
        irradiance_size: 256,
        format: "ktx2:rgba16f",
        specular_file: "specular.ktx2",
        irradiance_file: "diffuse.ktx2",
        sheen_file: "charlie/sheen.ktx2",
        ..CHAIN
    }),
    sources: &[
        "KhronosGroup/glTF-IBL-Sampler: filter.frag (6c818da), lib.cpp; KhronosGroup/glTF-Sample-Viewer: ibl.glsl (0120a8e), brdf.glsl, \
         resource_loader.js",
    ],
    from_memory: &[
        "that lut_sheen_E.png is the albedo of the viewer's own sheen, of Estevez' visibility",
        "the size of 256 for the tables: the sampler makes them as large as the cube",
    ],
    warnings: &[
        "the viewer's level is r times the number that it is told: tell it one less than there are levels",
        "the sampler's Charlie table weights samples of the lobe as if they were uniform; the right one is baked",
        "the sheen's chain, which kiln bake adds to the other, begins at roughness 0.07 instead of 0",
        "the sampler blurs by 1.8 levels too much, its solid angle lacking 4 pi; the right chain is baked",
    ],
    missing: &[],
    usage: "replace the viewer's lut_ggx.png, lut_charlie.png, lut_sheen_E.png, ggx/specular.ktx2, lambertian/diffuse.ktx2 and charlie/sheen.ktx2",
};
