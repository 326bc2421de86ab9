//! Filament.

use super::*;

pub(super) static FILAMENT: Engine = Engine {
    name: "filament",
    title: "Filament, as cmgen bakes for it",
    tables: &[EngineTable {
        file: "dfg.ktx",
        format: "ktx1:rgb16f",
        channels: &["ggx.bias", "ggx.albedo", "charlie.albedo"],
        axes: &["mu:128", "roughness:128"],
        as_shipped: Some(Shipped { axes: &["mu:128", "roughness:128:shift+1"], smith: Smith::Correlated }),
        ..PLAIN
    }],
    environment: Some(EngineEnvironment {
        size: 256,
        levels: Levels::DownTo(16),
        roughness: RoughnessMap::Quadratic,
        orientation: "x,y,z",
        irradiance: IrradianceKind::Sh,
        format: "ktx1:b10g11r11",
        specular_file: "{name}_ibl.ktx",
        irradiance_file: "{name}_irradiance.ktx",
        sh: ShConvention::Filament,
        ..CHAIN
    }),
    sources: &[
        "google/filament: libs/ibl/src/CubemapIBL.cpp, CubemapSH.cpp, DFG.cpp; tools/cmgen; shaders/src/surface_light_indirect.fs; \
         libs/image/src/Ktx1Bundle.cpp (2cb0559), libs/ktxreader/src/Ktx1Reader.cpp (2fa5331): the sh metadata is 27 numbers between spaces",
        "measured in Filament 1.53.4, its web build: what it renders of this file",
    ],
    from_memory: &["the smallest level of 16 texels"],
    warnings: &[
        "its own DFG is one texel off in roughness: texel j holds (j + 1.5)/128 where the shader reads (j + 0.5)/128; the right one is baked",
        "cmgen puts the middle of a panorama at +Z, Kiln at +X: add --rotate -90 to a file's bake to match it",
        "the web build parses the sh metadata and does not light with it unless the application passes it on",
    ],
    missing: &["a skybox of its own: level 0 of the chain is one"],
    usage: "KTX1Loader::createTexture or Ktx1Bundle; the nine coefficients are in the file's metadata and in sh.json",
};
