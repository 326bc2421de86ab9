//! three.js.

use super::*;

pub(super) static THREEJS: Engine = Engine {
    name: "threejs",
    title: "three.js with the cube PMREM",
    tables: &[
        EngineTable {
            file: "dfg.js",
            format: "js:f16",
            channels: &["ggx.scale", "ggx.bias"],
            axes: &["roughness:16", "mu:16"],
            ..PLAIN
        },
        EngineTable { file: "ltc_1.js", format: "js:f16", ..LTC_MATRIX },
        EngineTable { file: "ltc_2.js", format: "js:f16", ..LTC_AMPLITUDE },
    ],
    environment: Some(EngineEnvironment {
        size: 256,
        levels: Levels::DownTo(8),
        roughness: RoughnessMap::Quadratic,
        orientation: "-x,y,z",
        irradiance: IrradianceKind::LastLevel,
        format: "ktx2:uastc-hdr+zstd",
        specular_file: "{name}.ktx2",
        irradiance_file: "{name}_irradiance.ktx2",
        sh: ShConvention::Threejs,
        ..CHAIN
    }),
    sources: &[
        "mrdoob/three.js: src/nodes/functions/BSDF/DFGLUT.js, DFGLUTData.js; PMREMGenerator of pull request 34585",
        "three.js 0.187.0: RectAreaLightTexturesLib.js, RectAreaLightUniformsLib.js, lights_physical_pars_fragment.glsl.js",
        "measured in three.js 0.187.0: which files its loaders take, and which way they show them",
    ],
    from_memory: &[],
    warnings: &[
        "its own LTC tables are the published ones, twice as far from GGX as need be at middle roughness; nearer ones are baked",
        "its own 16 x 16 table is off by up to 0.014 at grazing angles, 0.0015 RMS: too few samples; the right one is baked",
        "KTX2Loader takes UASTC HDR alone, and shows every other KTX2 cube black without a word",
        "where the machine has no ASTC HDR, the loader makes BC6H of the cube, which is off by a fifth more than --format dds:bc6h is; DDSLoader \
         takes that, and machines without BC6H do not",
    ],
    missing: &[],
    usage: "KTX2Loader after detectSupport(renderer); then isPMREMTexture = true and scene.environment = it. With --format dds:bc6h \
            DDSLoader; then mapping = CubeReflectionMapping and isCubeTexture = isCompressedCubeTexture = isPMREMTexture = true. \
            LightProbe.sh.fromArray takes the coefficients of sh.json. UniformsLib.LTC_FLOAT_1 and LTC_HALF_1 (and _2) each take a DataTexture of 64 x 64 \
            RGBAFormat HalfFloatType texels, LinearFilter, clamped",
};
