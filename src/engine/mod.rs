//! Engines: what each one's shaders read, as data.
//!
//! One file per engine and one line in [`ENGINES`]. A preset is nothing but a list of tables and an environment in the words of a
//! recipe; [`recipe`] makes a [`Recipe`] of it, which `kiln bake --print-recipe` prints and which flags and files override.
//!
//! Each preset says where it was read, what in it is from memory, what the engine's own files have wrong (Kiln bakes the right
//! ones; `as_shipped` reproduces the engine's own numbers where they are known), and what the engine has that Kiln does not bake.

mod departure;
mod roughness;

mod babylon;
mod bevy;
mod cycles;
mod eevee;
mod filament;
mod gltf;
mod godot;
mod materialx;
mod o3de;
mod playcanvas;
mod threejs;
mod unity_hdrp;
mod unreal;
mod wicked;

pub use roughness::RoughnessMap;

use crate::environment::chain::LEAST_SHEEN;
use crate::environment::{BUILTIN_PREFIX, KernelKind, Orientation, ShConvention, SphereLayout};
use crate::error::{Error, Result};
use crate::integrate::Settings;
use crate::math::fit::Fit;
use crate::model::charlie::Visibility;
use crate::model::ggx::Smith;
use crate::recipe::{ArrayRecipe, EnvironmentRecipe, IrradianceKind, LayerRecipe, RECIPE_VERSION, Recipe, TableRecipe};
use crate::table::quantity::near_matches;
use crate::table::{Axis, Model, Point};
use std::path::Path;

/// Every engine.
pub static ENGINES: &[&Engine] = &[
    &filament::FILAMENT,
    &bevy::BEVY,
    &threejs::THREEJS,
    &babylon::BABYLON,
    &godot::GODOT,
    &o3de::O3DE,
    &unity_hdrp::UNITY_HDRP,
    &playcanvas::PLAYCANVAS,
    &gltf::GLTF,
    &materialx::MATERIALX,
    &cycles::CYCLES,
    &eevee::EEVEE,
    &wicked::WICKED,
    &unreal::UNREAL,
];

/// What an engine reads.
#[derive(Debug)]
pub struct Engine {
    /// What a user writes.
    pub name: &'static str,
    /// Which engine and renderer, in a few words.
    pub title: &'static str,
    /// Its tables.
    pub tables: &'static [EngineTable],
    /// Its environment; none for an engine that reads no filtered one.
    pub environment: Option<EngineEnvironment>,
    /// Where this was read.
    pub sources: &'static [&'static str],
    /// What is from memory and was not verified.
    pub from_memory: &'static [&'static str],
    /// What the engine's own files have wrong, and what a user should know of it.
    pub warnings: &'static [&'static str],
    /// What the engine has and Kiln does not bake.
    pub missing: &'static [&'static str],
    /// How the files are brought in.
    pub usage: &'static str,
}

/// One table of an engine.
#[derive(Debug)]
pub struct EngineTable {
    /// What `kiln table NAME --engine` calls it.
    pub name: &'static str,
    /// Its file.
    pub file: &'static str,
    /// Whether the file is an array texture, of which this is a layer: the first of them is layer 0.
    pub is_layer: bool,
    /// Container and texel format.
    pub format: &'static str,
    /// Quantities, one per channel, as a recipe has them.
    pub channels: &'static [&'static str],
    /// The axes, as a recipe has them.
    pub axes: &'static [&'static str],
    /// Masking and shadowing.
    pub smith: Smith,
    /// Visibility of the sheen.
    pub visibility: Visibility,
    /// Largest acceptable error, where the usual one is out of reach.
    pub tolerance: Option<f64>,
    /// What the engine's own table has instead, where that is known to be something else.
    pub as_shipped: Option<Shipped>,
}

/// What an engine's own table has instead of the right thing.
#[derive(Debug)]
pub struct Shipped {
    /// Its axes.
    pub axes: &'static [&'static str],
    /// Its masking and shadowing.
    pub smith: Smith,
}

/// What most tables are: correlated masking and shadowing, Neubelt's visibility, nothing wrong.
const PLAIN: EngineTable = EngineTable {
    name: "dfg",
    file: "",
    is_layer: false,
    format: "",
    channels: &[],
    axes: &[],
    smith: Smith::Correlated,
    visibility: Visibility::Neubelt,
    tolerance: None,
    as_shipped: None,
};

/// The inverse matrix of linearly transformed cosines in the layout of its authors, which most engines keep: in parts of m11, column after
/// column, over roughness and √(1 − cosθ).
const LTC_MATRIX: EngineTable = EngineTable {
    name: "ltc-matrix",
    channels: &["ltc.m00", "ltc.m20", "ltc.m02", "ltc.m22"],
    axes: &["roughness:64:edge", "mu:64:sqrt-one-minus:edge"],
    // A fiftieth of a half's ulp below 1; more is computed where rounding asks for it.
    tolerance: Some(1e-5),
    ..PLAIN
};

/// The texture beside it: what a lobe is scaled by, and the form factor of a clipped sphere over axes of its own.
const LTC_AMPLITUDE: EngineTable = EngineTable {
    name: "ltc-amplitude",
    channels: &["ggx.albedo", "ggx.bias", "constant.zero", "sphere.clipped"],
    axes: &["roughness:64:edge:+cos_centre", "mu:64:sqrt-one-minus:edge:+sin2_radius"],
    ..PLAIN
};

/// The environment of an engine.
#[derive(Debug)]
pub struct EngineEnvironment {
    /// How the sphere lies in its textures.
    pub layout: SphereLayout,
    /// Texels along an edge of level 0, or rows of a panorama.
    pub size: usize,
    /// Where the chain ends.
    pub levels: Levels,
    /// Which level the shader reads at which roughness.
    pub roughness: RoughnessMap,
    /// What the engine's own baker fills the levels by, where that is something else than its shader reads.
    pub as_shipped: Option<RoughnessMap>,
    /// The lobe that the engine's own filter converges to.
    pub kernel: KernelKind,
    /// Which way the cube is turned.
    pub orientation: &'static str,
    /// How diffuse light is read.
    pub irradiance: IrradianceKind,
    /// Texels along an edge of the irradiance cube.
    pub irradiance_size: usize,
    /// Container and texel format of the specular cube.
    pub format: &'static str,
    /// The same of the irradiance cube, if that has another.
    pub irradiance_format: Option<&'static str>,
    /// File of the specular cube; `{name}` is the input's.
    pub specular_file: &'static str,
    /// File of the irradiance cube.
    pub irradiance_file: &'static str,
    /// Whose nine coefficients are written beside Kiln's.
    pub sh: ShConvention,
    /// File of a chain for sheens, below the folder of the environment; empty where the engine has none.
    pub sheen_file: &'static str,
}

/// What most environments are: a cube of N = V = R, filled as the shader reads it, no chain for sheens.
const CHAIN: EngineEnvironment = EngineEnvironment {
    layout: SphereLayout::Cube,
    size: 256,
    levels: Levels::DownTo(1),
    roughness: RoughnessMap::Linear,
    as_shipped: None,
    kernel: KernelKind::Nol,
    orientation: "x,y,z",
    irradiance: IrradianceKind::None,
    irradiance_size: 32,
    format: "",
    irradiance_format: None,
    specular_file: "",
    irradiance_file: "",
    sh: ShConvention::Kiln,
    sheen_file: "",
};

/// Where a chain ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Levels {
    /// At this many texels along an edge.
    DownTo(usize),
    /// After this many.
    Count(usize),
}

impl EngineEnvironment {
    /// Number of levels of a chain from `size` on.
    pub fn n_levels(&self, size: usize) -> usize {
        let most = size.max(1).ilog2() as usize + 1;
        match self.levels {
            Levels::DownTo(last) => (0..most).take_while(|level| size >> level >= last).count().max(1),
            Levels::Count(count) => count.min(most),
        }
    }

    /// Roughness of each level of a chain from `size` on.
    pub fn level_roughness(&self, size: usize, as_shipped: bool) -> Vec<f64> {
        let map = self.as_shipped.filter(|_| as_shipped).unwrap_or(self.roughness);
        let n = self.n_levels(size);
        (0..n).map(|level| map.roughness(level, n, size)).collect()
    }

    /// Container and texel format of the irradiance cube.
    pub fn format_of_irradiance(&self) -> &'static str {
        self.irradiance_format.unwrap_or(self.format)
    }

    /// Whether there is another chain for sheens.
    pub fn has_sheen(&self) -> bool {
        !self.sheen_file.is_empty()
    }

    /// Roughness of each level of the chain for sheens: the lobe of roughness 0 would be the horizon itself.
    pub fn sheen_roughness(&self) -> Vec<f64> {
        self.level_roughness(self.size, false).into_iter().map(|r| r.max(LEAST_SHEEN)).collect()
    }

    /// Which way the cube is turned.
    ///
    /// **Errors**: none, as a test parses every one.
    pub fn orientation(&self) -> Result<Orientation> {
        self.orientation.parse()
    }
}

impl EngineTable {
    /// The table's recipe, its file in the output folder itself.
    ///
    /// **Errors**: none, as a test makes every one.
    pub fn recipe(&self, as_shipped: bool) -> Result<TableRecipe> {
        let shipped = self.as_shipped.as_ref().filter(|_| as_shipped);
        let axes = shipped.map_or(self.axes, |shipped| shipped.axes);
        let smith = shipped.map_or(self.smith, |shipped| shipped.smith);
        Ok(TableRecipe {
            file: self.file.to_owned(),
            format: self.format.parse()?,
            channels: self.channels.iter().map(|&name| name.to_owned()).collect(),
            axes: axes.iter().map(|axis| axis.parse()).collect::<Result<Vec<Axis>>>()?,
            at: Point::default(),
            layout: None,
            fit: Fit::None,
            model: Model { smith, visibility: self.visibility, ..Model::default() },
            integration: Settings { tolerance: self.tolerance, ..Settings::default() },
        })
    }
}

impl Engine {
    /// Whether nothing of it could be read.
    pub fn is_experimental(&self) -> bool {
        self.sources.is_empty()
    }

    /// Whether numbers of its own are known that differ from the right ones.
    pub fn has_own_numbers(&self) -> bool {
        let of_environment = self.environment.as_ref().is_some_and(|preset| preset.as_shipped.is_some());
        of_environment || self.tables.iter().any(|table| table.as_shipped.is_some())
    }

    /// The engine's table that `kiln table NAME` means.
    ///
    /// **Errors**: the engine has none of that name; the message lists what it has.
    pub fn table(&self, name: &str) -> Result<&'static EngineTable> {
        self.tables.iter().find(|table| table.name == name).ok_or_else(|| {
            let names: Vec<&str> = self.tables.iter().map(|table| table.name).collect();
            let way_out = match names[..] {
                [] => "see `kiln list engines`; it reads no table that Kiln bakes".to_owned(),
                _ => format!("use one of {}", names.join(", ")),
            };
            Error::usage(format!("{} has no table {name:?}", self.name), way_out)
        })
    }

    /// The recipe of an environment for this engine, in the output folder itself; none if it reads no filtered one.
    ///
    /// **Errors**: an input without a name.
    pub fn environment_recipe(&self, input: &str, as_shipped: bool) -> Result<Option<EnvironmentRecipe>> {
        let Some(preset) = &self.environment else { return Ok(None) };
        let name = name_of(input)?;
        let file = |template: &str| Some(template.replace("{name}", &name)).filter(|file| !file.is_empty());
        Ok(Some(EnvironmentRecipe {
            layout: preset.layout,
            size: preset.size,
            roughness: Some(preset.level_roughness(preset.size, as_shipped)),
            irradiance_size: preset.irradiance_size,
            kernel: preset.kernel,
            format: preset.format.parse()?,
            irradiance: preset.irradiance,
            irradiance_format: preset.irradiance_format.map(str::parse).transpose()?,
            orientation: preset.orientation()?,
            sh: preset.sh,
            specular_file: file(preset.specular_file),
            irradiance_file: file(preset.irradiance_file),
            ..EnvironmentRecipe::new(input)
        }))
    }

    /// The recipe of an environment for this engine's sheens, in the folder that it has there; none if it has no other chain for them.
    ///
    /// **Errors**: an input without a name.
    pub fn sheen_recipe(&self, input: &str) -> Result<Option<EnvironmentRecipe>> {
        let preset = self.environment.as_ref().filter(|preset| preset.has_sheen());
        let (Some(preset), Some(own)) = (preset, self.environment_recipe(input, false)?) else { return Ok(None) };
        let (directory, file) = preset.sheen_file.rsplit_once('/').unwrap_or(("", preset.sheen_file));
        Ok(Some(EnvironmentRecipe {
            directory: directory.to_owned(),
            kernel: KernelKind::Charlie,
            roughness: Some(preset.sheen_roughness()),
            irradiance: IrradianceKind::None,
            irradiance_format: None,
            specular_file: Some(file.to_owned()),
            irradiance_file: None,
            ..own
        }))
    }
}

/// The name of an input: its file's without extension, or the built-in's.
///
/// **Errors**: a path that names no file.
pub fn name_of(input: &str) -> Result<String> {
    let name = match input.strip_prefix(BUILTIN_PREFIX) {
        Some(name) => Some(name.to_owned()),
        None => Path::new(input).file_stem().and_then(|n| n.to_str()).map(str::to_owned),
    };
    name.filter(|name| !name.is_empty()).ok_or_else(|| {
        Error::usage(format!("{input:?} has no name for its files"), "rename the file, or bake it without --engine")
    })
}

/// The engine of that name.
///
/// **Errors**: an unknown name; the message lists near matches, or the engines that have it in their title.
pub fn find(name: &str) -> Result<&'static Engine> {
    ENGINES.iter().copied().find(|engine| engine.name == name).ok_or_else(|| {
        let word = name.to_lowercase();
        let titled = |engine: &&&Engine| word.len() > 2 && engine.title.to_lowercase().contains(&word);
        let by_title: Vec<_> = ENGINES.iter().filter(titled).map(|engine| engine.name).collect();
        let names: Vec<_> = ENGINES.iter().map(|engine| engine.name).collect();
        let way_out = match &by_title[..] {
            [] => near_matches(name, &names, "kiln list engines"),
            titled => format!("did you mean {}? see `kiln list engines`", titled.join(" or ")),
        };
        Error::usage(format!("no engine is called {name:?}"), way_out)
    })
}

/// Everything that the engines need: their tables in `ENGINE/`, each environment in `ENGINE/NAME/`, its chain for sheens below that.
///
/// **Errors**: two environments of the same name; engines that need nothing that could be baked.
pub fn recipe(engines: &[&Engine], environments: &[String], as_shipped: bool) -> Result<Recipe> {
    let mut recipe =
        Recipe { recipe: RECIPE_VERSION, tables: vec![], arrays: vec![], environments: vec![], shader: vec![] };
    for engine in engines {
        for table in engine.tables {
            let own = table.recipe(as_shipped)?;
            let file = format!("{}/{}", engine.name, own.file);
            if !table.is_layer {
                recipe.tables.push(TableRecipe { file, ..own });
                continue;
            }
            let layer = LayerRecipe {
                name: table.name.to_owned(),
                channels: own.channels,
                axes: own.axes,
                at: own.at,
                fit: own.fit,
                model: own.model,
                integration: own.integration,
            };
            match recipe.arrays.iter_mut().find(|array| array.file == file) {
                Some(array) => array.layers.push(layer),
                None => recipe.arrays.push(ArrayRecipe { file, format: own.format, layers: vec![layer] }),
            }
        }
        for input in environments {
            if let Some(own) = engine.environment_recipe(input, as_shipped)? {
                let directory = format!("{}/{}", engine.name, name_of(input)?);
                let sheen = engine
                    .sheen_recipe(input)?
                    .map(|sheen| EnvironmentRecipe { directory: format!("{directory}/{}", sheen.directory), ..sheen });
                recipe.environments.push(EnvironmentRecipe { directory, ..own });
                recipe.environments.extend(sheen);
            }
        }
    }
    if recipe.tables.is_empty() && recipe.arrays.is_empty() && recipe.environments.is_empty() {
        let names: Vec<&str> = engines.iter().map(|engine| engine.name).collect();
        return Err(Error::usage(
            format!("{} reads no table that Kiln bakes, and no environment is given", names.join(", ")),
            "add --env FILE",
        ));
    }
    recipe.check()?;
    Ok(recipe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_a_recipe_that_can_be_baked() {
        for engine in ENGINES {
            for as_shipped in [false, true] {
                let recipe = recipe(&[engine], &["builtin:white".to_owned()], as_shipped);
                let recipe = recipe.unwrap_or_else(|error| panic!("{}: {error}", engine.name));
                // What is printed is what is read.
                let text = recipe.to_toml().unwrap();
                assert_eq!(Recipe::from_toml(&text).unwrap(), recipe, "{}: {text}", engine.name);
            }
        }
    }

    #[test]
    fn an_unknown_engine_lists_near_matches() {
        let message = find("filamnet").unwrap_err().to_string();
        assert!(message.contains("did you mean filament?") && message.contains("kiln list engines"), "{message}");
        let refuse = |name: &str| find(name).unwrap_err().to_string();
        for (name, meant) in [
            ("Unity", "unity-hdrp"),
            ("unty", "unity-hdrp"),
            ("bevi", "bevy"),
            ("BEVY", "bevy"),
            ("three.js", "threejs"),
            ("Blender", "cycles or eevee"),
            ("Unreal Engine", "unreal"),
        ] {
            assert!(refuse(name).contains(&format!("did you mean {meant}?")), "{}", refuse(name));
        }
        for nothing in ["ue5", "q", ""] {
            assert!(refuse(nothing).ends_with("; see `kiln list engines`"), "{}", refuse(nothing));
        }
    }

    #[test]
    fn nothing_is_stated_without_where_it_was_read() {
        for engine in ENGINES {
            assert_eq!(engine.is_experimental(), engine.name == "unreal", "{}", engine.name);
            assert!(!engine.sources.is_empty() || !engine.from_memory.is_empty(), "{}", engine.name);
        }
    }
}
