//! Godot 4.

use super::*;

pub(super) static GODOT: Engine = Engine {
    name: "godot",
    title: "Godot 4, Forward+",
    tables: &[EngineTable {
        file: "dfg_lut.dds",
        format: "dds:rgba16f",
        channels: &["ggx.bias", "ggx.albedo", "charlie.albedo"],
        axes: &["mu:128", "roughness:128:flip"],
        smith: Smith::ApproxCorrelated,
        as_shipped: Some(Shipped { axes: &["mu:128", "roughness:128:flip"], smith: Smith::SchlickIbl }),
        ..PLAIN
    }],
    environment: Some(EngineEnvironment {
        layout: SphereLayout::Cube,
        size: 256,
        levels: Levels::Count(8),
        roughness: RoughnessMap::Linear,
        as_shipped: None,
        kernel: KernelKind::Nol,
        orientation: "x,y,z",
        irradiance: IrradianceKind::LastLevel,
        irradiance_size: 32,
        format: "dds:rgba16f",
        irradiance_format: "dds:rgba16f",
        specular_file: "{name}_radiance.dds",
        irradiance_file: "{name}_irradiance.dds",
        sh: ShConvention::Kiln,
        sheen_file: "",
    }),
    sources: &[
        "godotengine/godot: integrate_dfg.glsl (e8387d6), octmap_roughness_raster.glsl, octmap_roughness_inc.glsl, the scene shader's V_GGX",
    ],
    from_memory: &["8 roughness layers of a radiance map of 256"],
    warnings: &[
        "its own table takes Schlick's separable masking (k = alpha/2), its lights Hammon's approximation of the correlated one; \
         the table of the latter is baked",
        "Godot filters skies itself, at run time, from a panorama: the radiance cube is for shaders of your own",
    ],
    missing: &[
        "octahedral radiance maps of newer versions",
        "ltc_lut1.dds, ltc_lut2.dds of area lights: the matrix itself, not its inverse, over roughness and the angle",
    ],
    usage: "replace dfg_lut.dds in the renderer's sources; load the cube with ResourceLoader as a Cubemap",
};
