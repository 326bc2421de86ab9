//! Unreal Engine: experimental, as nothing of it could be read.

use super::*;

pub(super) static UNREAL: Engine = Engine {
    name: "unreal",
    title: "Unreal Engine (experimental)",
    tables: &[EngineTable {
        file: "PreIntegratedGF.dds",
        format: "dds:rg16unorm",
        channels: &["ggx.scale", "ggx.bias"],
        axes: &["mu:128", "roughness:32"],
        as_shipped: Some(Shipped { axes: &["mu:128", "roughness:32"], smith: Smith::SchlickIbl }),
        ..PLAIN
    }],
    environment: Some(EngineEnvironment {
        size: 128,
        levels: Levels::DownTo(1),
        roughness: RoughnessMap::Unreal,
        // Its world is left-handed with Z up: (x, z, y) of ours.
        orientation: "x,z,y",
        irradiance: IrradianceKind::None,
        format: "dds:bc6h",
        specular_file: "{name}.dds",
        irradiance_file: "{name}_irradiance.dds",
        ..CHAIN
    }),
    sources: &[],
    from_memory: &["all of it: check each value against your version before you rely on it"],
    warnings: &[
        "the table of 2013 takes Schlick's masking (k = alpha/2); later lights the correlated one, which is baked",
    ],
    missing: &["the energy tables of Substrate", "skylight coefficients: take sh.json"],
    usage: "PreIntegratedGF is built into the renderer; the cube is a reflection capture's",
};
