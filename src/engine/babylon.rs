//! Babylon.js.

use super::*;

pub(super) static BABYLON: Engine = Engine {
    name: "babylon",
    title: "Babylon.js' PBRMaterial",
    tables: &[
        EngineTable {
            file: "environmentBRDF.png",
            format: "png:rgbd",
            channels: &["ggx.bias", "ggx.albedo", "charlie.albedo"],
            axes: &["mu:256", "roughness:256"],
            ..PLAIN
        },
        EngineTable {
            name: "ggx-f82",
            file: "openPBREnvironmentBRDF.png",
            format: "png:rgbd",
            // The shader divides the third by its BRDF_Z_SCALE.
            channels: &["ggx.bias", "ggx.albedo", "ggx.f82:*16"],
            axes: &["mu:128", "roughness:128"],
            // Sixteen times the usual one.
            tolerance: Some(2e-6),
            ..PLAIN
        },
        EngineTable { file: "ltc_1.raw", format: "raw:rgba16f", ..LTC_MATRIX },
        EngineTable { file: "ltc_2.raw", format: "raw:rgba16f", ..LTC_AMPLITUDE },
    ],
    environment: Some(EngineEnvironment {
        size: 256,
        levels: Levels::DownTo(1),
        roughness: RoughnessMap::Babylon,
        orientation: "-x,y,z",
        irradiance: IrradianceKind::Sh,
        format: "env",
        specular_file: "{name}.env",
        irradiance_file: "{name}_irradiance.env",
        sh: ShConvention::Babylon,
        ..CHAIN
    }),
    sources: &[
        "BabylonJS/Babylon.js: hdrFiltering.ts, hdrFilteringFunctions.fx, environmentTextureTools.pure.ts, cubemapToSphericalPolynomial.ts, getBRDFLookup",
        "BabylonJS/Babylon.js 9.34.0: brdfTextureTools.js, pbrBRDFFunctions.js, openpbrEnvironmentLighting.js; the table in it agrees with this one to its codes",
        "BabylonJS/Babylon.js 9.34.0: ltcHelperFunctions.js, ltcTextureTool.js, areaLight.pure.js",
        "measured in Babylon.js 9.34.0: which files its loaders take, and which way they show them",
    ],
    from_memory: &["that the table's third channel is Charlie's with Neubelt's visibility"],
    warnings: &[
        "the world is left-handed: glTF's +X, as Babylon.js imports it, is -X, and the cube is mirrored to match",
        "at r = 1 the irradiance is read, not a specular level; levels beyond alpha 1 hold alpha 1",
    ],
    missing: &[
        "the fuzz of OpenPBR, 32 x 32 codes of A, B and the albedo over sqrt(roughness) and mu: a fit to simulated fibres that scatter more than once \
         (Zeltner, Burley and Chiang 2022), which no formula of a lobe gives",
    ],
    usage: "CubeTexture.CreateFromPrefilteredData; scene.environmentBRDFTexture takes the table, isRGBD set, and scene.openPBREnvironmentBRDFTexture that of \
            OpenPBR materials, before the first of them is made. After the first area light is made, scene._ltcTextures.LTC1 and LTC2 take new \
            Uint16Array(buffer) of the two raw files by update()",
};
