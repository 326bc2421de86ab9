//! Wicked Engine.

use super::*;

pub(super) static WICKED: Engine = Engine {
    name: "wicked",
    title: "Wicked Engine",
    tables: &[EngineTable {
        name: "charlie-albedo",
        file: "sheen_lut.png",
        format: "png:r8unorm",
        channels: &["charlie.albedo:min(y,1)"],
        axes: &["mu:16", "roughness:16"],
        ..PLAIN
    }],
    environment: Some(EngineEnvironment {
        size: 256,
        levels: Levels::DownTo(1),
        roughness: RoughnessMap::Count,
        as_shipped: Some(RoughnessMap::Linear),
        orientation: "x,y,-z",
        irradiance: IrradianceKind::LastLevel,
        format: "dds:bc6h",
        specular_file: "{name}.dds",
        irradiance_file: "{name}_irradiance.dds",
        ..CHAIN
    }),
    sources: &["turanszkij/WickedEngine: filterEnvMapCS.hlsl, lightingHF.hlsli, wiSheenLUT.h"],
    from_memory: &[
        "that importing a scene negates Z, which the cube follows",
        "the size of 256, and that the chain ends at 1 texel",
        "that the sheen's visibility is Neubelt's",
        "that the last level stands for irradiance",
    ],
    warnings: &[
        "its own baker fills level m for r = m/L, its shader reads it at r = m/(L + 1): the latter is baked; r = 1 is read from the last \
         level, which is filled for L/(L + 1)",
        "sheen above 1 does not fit the unorm table and is stored as 1",
    ],
    missing: &["a DFG: the environment's reflectance is an analytic fit"],
    usage: "replace the array of wiSheenLUT.h; load the cube as a probe's texture",
};
