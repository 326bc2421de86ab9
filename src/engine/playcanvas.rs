//! PlayCanvas.

use super::*;
use crate::environment::atlas;

pub(super) static PLAYCANVAS: Engine = Engine {
    name: "playcanvas",
    title: "PlayCanvas",
    tables: &[
        EngineTable { file: "ltc_1.js", format: "js:f32", tolerance: Some(1e-6), ..LTC_MATRIX },
        EngineTable { file: "ltc_2.js", format: "js:f32", ..LTC_AMPLITUDE },
    ],
    environment: Some(EngineEnvironment {
        layout: SphereLayout::Atlas,
        size: 256,
        levels: Levels::Count(6),
        roughness: RoughnessMap::Steps(5.0),
        as_shipped: Some(RoughnessMap::Elevenths),
        orientation: atlas::ORIENTATION,
        irradiance: IrradianceKind::Cube,
        format: "png:rgbp",
        specular_file: "{name}_atlas.png",
        irradiance_file: "",
        sh: ShConvention::Playcanvas,
        ..CHAIN
    }),
    sources: &[
        "playcanvas/engine: env-lighting.js, reproject-texture.js, the chunks envAtlas, reflectionEnv, ambient, spherical, decode",
        "PlayCanvas 2.23.3: area-light-luts.js, the chunk ltc",
        "measured in PlayCanvas 2.23.3: which files its loaders take, and what it renders of this one",
    ],
    from_memory: &[],
    warnings: &[
        "its own baker fills tile i for r = 2i/11 and its shader reads it at r = i/5: the latter is baked",
        "PlayCanvas puts the middle of a panorama at +Z, Kiln at +X",
        "samplers blend the codes of RGBP, not the values: between texels of different p its shader sees something else",
        "values beyond 64 do not fit in RGBP: lower --exposure, and raise scene.skyboxIntensity",
        "its shader lets reflectance rise to the largest of F0's three channels only: grey metals have no Fresnel",
    ],
    missing: &["an atlas larger than 512 x 512", "a DFG: none was seen in the shaders that were read"],
    usage: "load the PNG as a texture with { type: TEXTURETYPE_RGBP, projection: TEXTUREPROJECTION_EQUIRECT, mipmaps: false, addressU and addressV: \
            ADDRESS_CLAMP_TO_EDGE } and set scene.envAtlas; ambientSH of a material takes the coefficients of sh.json, as Float32Array. For a cube of half floats: \
            --layout cube --format dds:rgba16f+legacy --orientation -x,y,z, and EnvLighting.generatePrefilteredAtlas. app.setAreaLightLuts takes the numbers of ltc_1.js \
            and ltc_2.js",
};
