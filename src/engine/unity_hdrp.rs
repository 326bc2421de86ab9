//! Unity's High Definition Render Pipeline.

use super::*;

pub(super) static UNITY_HDRP: Engine = Engine {
    name: "unity-hdrp",
    title: "Unity's High Definition Render Pipeline",
    tables: &[
        EngineTable {
            file: "PreIntegratedFGD_GGXDisneyDiffuse.exr",
            format: "exr:f16",
            channels: &["ggx.bias", "ggx.albedo", "burley.albedo:/1.03571:-0.5"],
            axes: &["mu:64:sqrt:edge", "roughness:64:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "cloth-split",
            file: "PreIntegratedFGD_CharlieFabricLambert.exr",
            format: "exr:f16",
            channels: &[
                "charlie.bias:/6.283185307179586",
                "charlie.albedo:/6.283185307179586",
                "fabric-lambert.albedo",
            ],
            axes: &["mu:64", "roughness:64"],
            visibility: Visibility::Charlie,
            ..PLAIN
        },
        EngineTable {
            name: "ltc-matrix-m22",
            file: "LtcData.BRDF_GGX.raw",
            format: "raw:rgba16f",
            channels: &["ltc-m22.m00", "ltc-m22.m20", "ltc-m22.m11", "ltc-m22.m02"],
            axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
            tolerance: Some(1e-4),
            ..PLAIN
        },
        EngineTable {
            name: "ltc-burley",
            file: "LtcData.BRDF_Disney.raw",
            format: "raw:rgba16f",
            channels: &["ltc-burley.m00", "ltc-burley.m20", "ltc-burley.m11", "ltc-burley.m02"],
            axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
            ..PLAIN
        },
        EngineTable {
            name: "ltc-charlie",
            file: "LtcData.BRDF_Charlie.raw",
            format: "raw:rgba16f",
            channels: &["ltc-charlie.m00", "ltc-charlie.m20", "ltc-charlie.m11", "ltc-charlie.m02"],
            axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
            tolerance: Some(1e-5),
            ..PLAIN
        },
    ],
    environment: Some(EngineEnvironment {
        size: 128,
        levels: Levels::Count(7),
        roughness: RoughnessMap::Unity,
        orientation: "-x,y,z",
        irradiance: IrradianceKind::None,
        format: "dds:bc6h",
        specular_file: "{name}.dds",
        irradiance_file: "{name}_irradiance.dds",
        sh: ShConvention::Unity,
        ..CHAIN
    }),
    sources: &[
        "Unity-Technologies/Graphics: PreIntegratedFGD.hlsl (0bb2787), PreIntegratedFGD.cs, GGXDisneyDiffuse.shader, CharlieFabricLambert.shader (8bdf507), BSDF.hlsl, ImageBasedLighting.hlsl, \
         SphericalHarmonics.cs, LTCAreaLight.cs, LTCAreaLight.hlsl, LtcData.BRDF_GGX.cs, LtcData.BRDF_Disney.cs, BRDF_Disney.cs, \
         BRDF_Charlie.cs, Fabric.hlsl (2a67652), Hair.hlsl",
    ],
    from_memory: &["that an importer turns a right-handed world by negating X, which the cube follows"],
    warnings: &[
        "its own slice 2 of _LtcData is fitted to a sheen of Estevez' visibility, which its punctual lamps have not: the table is of theirs, Neubelt's",
        "its shader reads the GGX and Lambert table with mu as it is in one place, though the table is over sqrt(mu)",
        "HDRP makes its tables and probes itself, at run time, the tables as A2B10G10R10; these files, of halves, are for replacing them",
        "of the cloth table newer versions read 2 pi times x and y, as here; older ones y/(1 - y), of --channels 'charlie.albedo:y/(1+y)'",
        "what its cloth reads in x and y beyond 1/(2 pi) of a grazing sheen does not fit its own texture, and is stored as it is here",
    ],
    missing: &[
        "slices 3 to 7 of _LtcData: Kajiya and Kay's hair, for which its shader takes the first slice; Marschner's, which is empty; and the lobes of AxF car \
         paints, Cook and Torrance's V-shaped grooves, Ward's and Oren and Nayar's, which Kiln has not",
    ],
    usage: "import with sRGB off, no compression, clamped; set as _PreIntegratedFGD_GGXDisneyDiffuse and _PreIntegratedFGD_CharlieAndFabric; the halves of LtcData.BRDF_GGX.raw, \
            LtcData.BRDF_Disney.raw and LtcData.BRDF_Charlie.raw go into slices 0, 1 and 2 of _LtcData by SetPixelData; SphericalHarmonicsL2[channel, i] is \
            coefficients[i][channel] of sh.json",
};
