//! three.js.

use super::*;

pub(super) static THREEJS: Engine = Engine {
    name: "threejs",
    title: "three.js with the cube PMREM",
    tables: &[EngineTable {
        file: "dfg.js",
        format: "js:f16",
        channels: &["ggx.scale", "ggx.bias"],
        axes: &["roughness:16", "mu:16"],
        ..PLAIN
    }],
    environment: Some(EngineEnvironment {
        layout: SphereLayout::Cube,
        size: 256,
        levels: Levels::DownTo(8),
        roughness: RoughnessMap::Quadratic,
        as_shipped: None,
        kernel: KernelKind::Nol,
        orientation: "-x,y,z",
        irradiance: IrradianceKind::LastLevel,
        irradiance_size: 32,
        format: "dds:bc6h",
        irradiance_format: "dds:bc6h",
        specular_file: "{name}.dds",
        irradiance_file: "{name}_irradiance.dds",
        sh: ShConvention::Threejs,
        sheen_file: "",
    }),
    sources: &[
        "mrdoob/three.js: src/nodes/functions/BSDF/DFGLUT.js, DFGLUTData.js; PMREMGenerator of pull request 34585",
        "measured in three.js 0.187.0: which files its loaders take, and which way they show them",
    ],
    from_memory: &[],
    warnings: &[
        "its own 16 x 16 table is 0.7 % low where it was checked: too few samples; the right one is baked",
        "KTX2Loader shows every KTX2 cube but UASTC HDR black and says nothing: load the DDS",
    ],
    missing: &["UASTC HDR 4x4 in KTX2", "ltc_1, ltc_2: linearly transformed cosines"],
    usage: "DDSLoader; then mapping = CubeReflectionMapping and isCubeTexture = isCompressedCubeTexture = isPMREMTexture = true; \
            scene.environment = it. LightProbe.sh.fromArray takes the coefficients of sh.json",
};
