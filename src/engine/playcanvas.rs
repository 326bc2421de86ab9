//! PlayCanvas.

use super::*;

pub(super) static PLAYCANVAS: Engine = Engine {
    name: "playcanvas",
    title: "PlayCanvas",
    tables: &[],
    environment: Some(EngineEnvironment {
        layout: SphereLayout::Cube,
        size: 256,
        levels: Levels::Count(6),
        roughness: RoughnessMap::Steps(5.0),
        as_shipped: Some(RoughnessMap::Elevenths),
        kernel: KernelKind::Nol,
        orientation: "-x,y,z",
        irradiance: IrradianceKind::Sh,
        irradiance_size: 32,
        format: "dds:rgba16f+legacy",
        irradiance_format: "dds:rgba16f+legacy",
        specular_file: "{name}.dds",
        irradiance_file: "{name}_irradiance.dds",
        sh: ShConvention::Playcanvas,
    }),
    sources: &[
        "playcanvas/engine: env-lighting.js, reproject-texture.js, the lit chunks, ambientSH",
        "measured in PlayCanvas 2.23.3: which files its loaders take, and which way they show them",
    ],
    from_memory: &[],
    warnings: &[
        "its own baker fills tile i for r = 2i/11 and its shader reads it at r = i/5: the latter is baked",
        "PlayCanvas puts the middle of a panorama at +Z, Kiln at +X",
    ],
    missing: &["the environment atlas (RGBP, 512 x 512)", "a DFG: none was seen in the shaders that were read"],
    usage: "EnvLighting.generatePrefilteredAtlas makes the atlas of the cube's levels; ambientSH takes the coefficients of sh.json",
};
