//! Open 3D Engine.

use super::*;

pub(super) static O3DE: Engine = Engine {
    name: "o3de",
    title: "Open 3D Engine's Atom",
    tables: &[EngineTable {
        file: "brdf.dds",
        format: "dds:rg16f",
        channels: &["ggx.scale", "ggx.bias"],
        axes: &["mu:256", "roughness:256:flip"],
        ..PLAIN
    }],
    environment: Some(EngineEnvironment {
        layout: SphereLayout::Cube,
        size: 256,
        levels: Levels::Count(6),
        roughness: RoughnessMap::Steps(5.0),
        as_shipped: None,
        kernel: KernelKind::Nol,
        // Its world is right-handed with Z up: (x, -z, y) of ours. The shader looks up (-x, z, -y) of that.
        orientation: "-x,y,z",
        irradiance: IrradianceKind::Cube,
        irradiance_size: 32,
        format: "dds:rgb9e5",
        irradiance_format: "dds:bc6h",
        specular_file: "{name}_iblspecularcm.dds",
        irradiance_file: "{name}_ibldiffusecm.dds",
        sh: ShConvention::Kiln,
        sheen_file: "",
    }),
    sources: &[
        "o3de/o3de: BRDFTextureCS.azsl, BRDFTexture.attimage, LightingUtils.azsli, Ibl.azsli, IBL*.preset, CCubeMapProcessor.cpp",
    ],
    from_memory: &["the size of the diffuse cube"],
    warnings: &["the asset processor filters what its presets name again: give these files a preset without filtering"],
    missing: &["the linearly transformed cosines of 32 x 32"],
    usage: "the suffixes _iblspecularcm and _ibldiffusecm choose the presets of the asset processor",
};
