//! Recipes: everything that decides what a bake writes, complete and printable.
//!
//! A recipe is a TOML file of `[[table]]` and `[[environment]]` entries. What an entry leaves out takes a default, and
//! [`Recipe::to_toml`] prints the recipe with nothing left out: the same file again gives the same bytes again.

use crate::colour::TargetColour;
use crate::environment::atlas;
use crate::environment::chain::{LEAST_SHEEN, check_kernel, check_view};
use crate::environment::sh_bands::MOST_BANDS;
use crate::environment::{
    Adjustment, ChainSpec, InputLayout, KernelKind, Negatives, NonFinite, Orientation, Reading, ShConvention,
    SphereLayout, View,
};
use crate::error::{Error, Result};
use crate::format::{Container, FormatSpec, Packing, Texture, raw};
use crate::integrate::Settings;
use crate::language::Language;
use crate::math::fit::Fit;
use crate::pack::TexelFormat;
use crate::table::{Arrangement, Axis, Layout, Model, Parameter, Point, TableSpec, named, quantity};
use serde::{Deserialize, Serialize};
use std::path::{Component, Path};

/// The version of the recipe file that this Kiln reads and writes.
pub const RECIPE_VERSION: u32 = 1;

/// The recipe that `kiln bake` follows when it is given none.
pub const BUILT_IN: &str = include_str!("built_in_recipe.toml");

/// What to bake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// [`RECIPE_VERSION`].
    pub recipe: u32,
    /// Languages in which `lookup.glsl` and so on, the code that looks up all of it, is written.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shader: Vec<Language>,
    /// Tables, in the order in which they are baked.
    #[serde(default, rename = "table")]
    pub tables: Vec<TableRecipe>,
    /// Array textures of several tables, baked after the tables.
    #[serde(default, rename = "array", skip_serializing_if = "Vec::is_empty")]
    pub arrays: Vec<ArrayRecipe>,
    /// Environments, baked after the tables.
    #[serde(default, rename = "environment")]
    pub environments: Vec<EnvironmentRecipe>,
}

/// One table and its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableRecipe {
    /// Path of the file, within the output folder.
    pub file: String,
    /// Container and number format.
    pub format: FormatSpec,
    /// Names of the quantities, one per channel.
    pub channels: Vec<String>,
    /// The axes, one to three, the fastest (x) first.
    pub axes: Vec<Axis>,
    /// Values of the parameters that no axis varies, such as `eta=1.5`.
    #[serde(default, skip_serializing_if = "Point::is_empty")]
    pub at: Point,
    /// What texels are chosen for: their centres, or the lookup between them.
    #[serde(default, skip_serializing_if = "Fit::is_none")]
    pub fit: Fit,
    /// How slices are arranged, for three axes; `None` is the container's own way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<Layout>,
    /// The choices within the model.
    #[serde(default)]
    pub model: Model,
    /// How to integrate.
    #[serde(default)]
    pub integration: Settings,
}

/// Several tables in the layers of one array texture, because bindings are scarce.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArrayRecipe {
    /// Path of the file, within the output folder.
    pub file: String,
    /// Container and texel format of all layers.
    pub format: FormatSpec,
    /// The tables, the first layer first: all of one size.
    #[serde(rename = "layer")]
    pub layers: Vec<LayerRecipe>,
}

/// A table that is one layer of an array texture: see [`TableRecipe`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LayerRecipe {
    /// What the code that looks it up is called.
    pub name: String,
    /// Names of the quantities, one per channel.
    pub channels: Vec<String>,
    /// The axes, one or two.
    pub axes: Vec<Axis>,
    /// Values of the parameters that no axis varies.
    #[serde(default, skip_serializing_if = "Point::is_empty")]
    pub at: Point,
    /// What texels are chosen for.
    #[serde(default, skip_serializing_if = "Fit::is_none")]
    pub fit: Fit,
    /// The choices within the model.
    #[serde(default)]
    pub model: Model,
    /// How to integrate.
    #[serde(default)]
    pub integration: Settings,
}

impl ArrayRecipe {
    /// Each layer as a table of its own.
    pub fn tables(&self) -> Vec<TableRecipe> {
        let table = |layer: &LayerRecipe| TableRecipe {
            file: format!("{}.{}", layer.name, self.format.extension()),
            format: self.format,
            channels: layer.channels.clone(),
            axes: layer.axes.clone(),
            at: layer.at,
            fit: layer.fit,
            layout: None,
            model: layer.model,
            integration: layer.integration,
        };
        self.layers.iter().map(table).collect()
    }

    /// Whether the tables can be layers of one texture.
    ///
    /// **Errors**: a container without arrays; no layer, tables of three axes or of several sizes, equal names; what no table can be.
    pub fn check(&self) -> Result<()> {
        if !self.format.container().has_arrays() {
            return Err(Error::usage(
                format!("{}: {} has no array textures", self.file, self.format),
                "use ktx2, ktx1 or dds, such as ktx2:rgba16f",
            ));
        }
        if self.layers.is_empty() {
            return Err(Error::usage(format!("{}: an array without layers", self.file), "add a [[array.layer]]"));
        }
        let mut sizes = vec![];
        for (i, table) in self.tables().iter().enumerate() {
            let name = &self.layers[i].name;
            if name.is_empty() || name.contains(['/', '\\', '\0']) || self.layers[..i].iter().any(|l| l.name == *name) {
                return Err(Error::usage(
                    format!("{}: {name:?} is no name of its own for a layer", self.file),
                    "give each layer a name, such as dfg",
                ));
            }
            table.spec().and_then(|s| s.check()).map_err(|e| e.in_file(Path::new(&self.file)))?;
            table.integration.check()?;
            table.check_format()?;
            if table.axes.len() > 2 {
                return Err(Error::usage(
                    format!("{}: layer {name} has {} axes", self.file, table.axes.len()),
                    "bake it as a table of its own: a layer has two axes at most",
                ));
            }
            sizes.push(table.arrangement()?.size);
        }
        if let Some(other) = sizes.iter().position(|size| *size != sizes[0]) {
            let text = |i: usize| format!("{} is {} × {}", self.layers[i].name, sizes[i][0], sizes[i][1]);
            return Err(Error::usage(
                format!("{}: {}, and {}", self.file, text(0), text(other)),
                "give the axes of all layers the same sizes; one axis alone makes one row",
            ));
        }
        Ok(())
    }
}

/// One environment and the folder of its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentRecipe {
    /// A panorama's or a cube's file, six files as one of them, a pattern or a folder, or `builtin:NAME`.
    pub input: String,
    /// What the input is read as.
    #[serde(default)]
    pub input_layout: InputLayout,
    /// Which primaries the result has.
    #[serde(default)]
    pub to: TargetColour,
    /// Folder of the files, within the output folder; empty for that folder itself.
    #[serde(default)]
    pub directory: String,
    /// How the sphere lies in the specular and the irradiance file: `cube`, `octahedral` or `equirect`.
    #[serde(default, skip_serializing_if = "SphereLayout::is_cube")]
    pub layout: SphereLayout,
    /// Texels along an edge of the specular cube's level 0, of a face or of the octahedral square; rows of a panorama, which is twice as
    /// wide.
    #[serde(default = "default_size")]
    pub size: usize,
    /// The same of its last level, unless `roughness` says how many levels there are.
    #[serde(default = "default_min_size")]
    pub min_size: usize,
    /// Roughness of each level; each is half the size of the one before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness: Option<Vec<f64>>,
    /// What the specular levels weigh directions by.
    #[serde(default)]
    pub kernel: KernelKind,
    /// How the surface is seen, if not as N = V = R.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<View>,
    /// The same of the irradiance cube.
    #[serde(default = "default_irradiance_size")]
    pub irradiance_size: usize,
    /// Bands of spherical harmonics: 3 for nine coefficients, or up to [`MOST_BANDS`].
    #[serde(default = "default_sh_bands")]
    pub sh_bands: usize,
    /// Container and texel format of the cubes.
    #[serde(default = "default_cube_format")]
    pub format: FormatSpec,
    /// How diffuse light is written.
    #[serde(default)]
    pub irradiance: IrradianceKind,
    /// Container and texel format of the irradiance cube, where it is not that of the specular one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub irradiance_format: Option<FormatSpec>,
    /// Which way the cubes are turned: the world's direction in terms of the vector that the shader looks up.
    #[serde(default)]
    pub orientation: Orientation,
    /// Whose nine coefficients `sh.json` has beside Kiln's own.
    #[serde(default)]
    pub sh: ShConvention,
    /// File of the specular cube, within `directory`; `specular` and the format's extension unless told otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specular_file: Option<String>,
    /// File of the irradiance cube.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub irradiance_file: Option<String>,
    /// What becomes of NaN and infinities.
    #[serde(default)]
    pub nonfinite: NonFinite,
    /// What becomes of values below zero.
    #[serde(default)]
    pub negatives: Negatives,
    /// What texels are chosen for: their centres, or the lookup between them.
    #[serde(default, skip_serializing_if = "Fit::is_none")]
    pub fit: Fit,
    /// What is done to the panorama before it is filtered.
    #[serde(default)]
    pub adjust: Adjustment,
    /// How to integrate.
    #[serde(default)]
    pub integration: Settings,
}

/// How diffuse light is written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum IrradianceKind {
    /// As a cube of E/π.
    #[default]
    Cube,
    /// As nine coefficients: in `sh.json`, and where the container has a place for them.
    Sh,
    /// As the last specular level, whose roughness is 1: E/π itself.
    LastLevel,
    /// Not at all.
    None,
}

impl IrradianceKind {
    /// The word that recipes use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cube => "cube",
            Self::Sh => "sh",
            Self::LastLevel => "last-level",
            Self::None => "none",
        }
    }
}

fn default_size() -> usize {
    256
}

fn default_min_size() -> usize {
    16
}

fn default_irradiance_size() -> usize {
    32
}

fn default_sh_bands() -> usize {
    3
}

fn default_cube_format() -> FormatSpec {
    FormatSpec::ktx2(TexelFormat::Plain { channels: 4, number: crate::pack::Number::F16 })
}

impl Recipe {
    /// The recipe that `kiln bake` follows when it is given none.
    pub fn built_in() -> Result<Self> {
        Self::from_toml(BUILT_IN)
    }

    /// Reads a recipe.
    ///
    /// **Errors**: broken TOML, unknown keys, a version that this Kiln does not know, entries that cannot be baked, two
    /// entries that write the same file.
    pub fn from_toml(text: &str) -> Result<Self> {
        let recipe: Self = toml::from_str(text).map_err(|e| {
            Error::invalid(
                format!("not a recipe: {}", e.to_string().trim_end().replace('\n', "\n  ")),
                "compare it with `kiln bake --print-recipe`",
            )
        })?;
        if recipe.recipe != RECIPE_VERSION {
            return Err(Error::unsupported(
                format!("recipe version {} is not {RECIPE_VERSION}", recipe.recipe),
                format!("write `recipe = {RECIPE_VERSION}`, and compare it with `kiln bake --print-recipe`"),
            ));
        }
        recipe.check()?;
        Ok(recipe)
    }

    /// The recipe as a file to edit, nothing left out.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string_pretty(self)
            .map_err(|e| Error::unsupported(format!("a recipe that TOML cannot hold: {e}"), "report this as a bug"))
    }

    /// Whether everything in it can be baked.
    ///
    /// **Errors**: nothing to bake, entries that cannot be baked, two that write the same file.
    pub fn check(&self) -> Result<()> {
        if self.tables.is_empty() && self.arrays.is_empty() && self.environments.is_empty() {
            return Err(Error::usage(
                "a recipe that lists nothing to bake",
                "add a [[table]] or an [[environment]]; see `kiln bake --print-recipe`",
            ));
        }
        let mut targets = vec![];
        for table in &self.tables {
            check_inside(&table.file)?;
            table.spec().and_then(|s| s.check()).map_err(|e| e.in_file(Path::new(&table.file)))?;
            table.integration.check()?;
            table.check_format()?;
            targets.push(table.file.clone());
        }
        for array in &self.arrays {
            check_inside(&array.file)?;
            array.check()?;
            targets.push(array.file.clone());
        }
        for environment in &self.environments {
            check_inside(&environment.directory)?;
            environment.check()?;
            targets.push(environment.directory.clone());
        }
        for (i, target) in targets.iter().enumerate() {
            if targets[..i].contains(target) {
                return Err(Error::usage(
                    format!("two entries of the recipe write {target:?}"),
                    "give each its own `file` or `directory`",
                ));
            }
        }
        Ok(())
    }
}

/// A path of a recipe stays within the output folder: recipes come from other people.
fn check_inside(path: &str) -> Result<()> {
    let fine = Path::new(path).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if fine && !path.contains('\0') {
        return Ok(());
    }
    Err(Error::usage(
        format!("{path:?} leads out of the output folder"),
        "use a relative path without `..`, and choose the folder with --out",
    ))
}

impl TableRecipe {
    /// What to integrate.
    ///
    /// **Errors**: a quantity that does not exist.
    pub fn spec(&self) -> Result<TableSpec> {
        let varied = |p: Parameter| self.axes.iter().flat_map(Axis::parameters).any(|a| a.canonical() == p.canonical());
        let given = |p: Parameter| varied(p) || self.at.get(p).is_ok();
        let channels = self.channels.iter().map(|name| quantity::find_among(name, given)).collect::<Result<_>>()?;
        Ok(TableSpec { channels, axes: self.axes.clone(), at: self.at, model: self.model })
    }

    /// How the table lies in its file.
    ///
    /// **Errors**: as [`TableRecipe::spec`]; a layout that the container does not have.
    pub fn arrangement(&self) -> Result<Arrangement> {
        Arrangement::new(&self.spec()?, self.format, self.layout)
    }

    /// Whether the format can hold the channels.
    ///
    /// **Errors**: more channels than the texel format has; a channel twice; a layout that the container does not have.
    pub fn check_format(&self) -> Result<()> {
        for (i, name) in self.channels.iter().enumerate() {
            if self.channels[..i].contains(name) {
                return Err(Error::usage(format!("channel {name} is named twice"), "name each quantity once"));
            }
        }
        if self.format.container() == Container::Env {
            return Err(Error::usage(
                "env holds the cubes of an environment, and no table",
                "use png:rgbd, ktx2:rgbd or another of `kiln list formats`",
            ));
        }
        self.texel_format()?;
        Ok(())
    }

    /// How the texels of the file are stored.
    ///
    /// **Errors**: more channels than the texel format has; a layout that the container does not have.
    pub fn texel_format(&self) -> Result<TexelFormat> {
        self.format.texel(self.arrangement()?.file_channels())
    }

    /// The texture that bare texels are: those of a `.raw` file, which says nothing of itself.
    ///
    /// **Errors**: another number of bytes than the recipe's table takes.
    pub fn bare_texture(&self, bytes: &[u8]) -> Result<Texture> {
        let arrangement = self.arrangement()?;
        let [width, height, depth] = arrangement.size;
        let depth = if arrangement.is_volume() { depth } else { 0 };
        raw::decode(bytes, &Texture { depth, ..Texture::empty(self.texel_format()?, width, height) }, 1)
    }

    /// The named table `name` as it is unless told otherwise, for a file of that format.
    ///
    /// **Errors**: an unknown name.
    pub fn named(name: &str, format: FormatSpec) -> Result<Self> {
        let table = named::find(name)?;
        Ok(Self {
            file: format!("{name}.{}", format.extension()),
            format,
            channels: table.channels.iter().map(|&c| c.to_owned()).collect(),
            axes: table.default_axes()?,
            at: table.default_point()?,
            fit: Fit::None,
            layout: None,
            model: Model::default(),
            integration: Settings { tolerance: table.tolerance, ..Settings::default() },
        })
    }
}

/// Texels along a cube's edge at most: what graphics hardware samples.
pub const LARGEST_CUBE: usize = 16384;

impl EnvironmentRecipe {
    /// The environment at the default sizes.
    pub fn new(input: &str) -> Self {
        Self {
            input: input.to_owned(),
            input_layout: InputLayout::default(),
            to: TargetColour::default(),
            directory: String::new(),
            layout: SphereLayout::default(),
            size: default_size(),
            min_size: default_min_size(),
            roughness: None,
            kernel: KernelKind::default(),
            view: None,
            irradiance_size: default_irradiance_size(),
            sh_bands: default_sh_bands(),
            format: default_cube_format(),
            irradiance: IrradianceKind::default(),
            irradiance_format: None,
            orientation: Orientation::default(),
            sh: ShConvention::default(),
            specular_file: None,
            irradiance_file: None,
            nonfinite: NonFinite::default(),
            negatives: Negatives::default(),
            fit: Fit::default(),
            adjust: Adjustment::default(),
            integration: Settings::default(),
        }
    }

    /// The roughness of every level: the given ones, or m/(levels − 1) for the levels from `size` down to `min_size`; a sheen, which is no
    /// mirror at 0, starts at [`LEAST_SHEEN`].
    pub fn level_roughness(&self) -> Vec<f64> {
        if let Some(roughness) = &self.roughness {
            return roughness.clone();
        }
        let mut roughness = ChainSpec::new(self.size, self.min_size).roughness;
        if self.kernel == KernelKind::Charlie {
            roughness[0] = LEAST_SHEEN;
        }
        roughness
    }

    /// Container and texel format of the irradiance cube. Babylon.js' environments are whole chains: irradiance, which is one level, is the
    /// same texels in a KTX2.
    pub fn format_of_irradiance(&self) -> FormatSpec {
        match (self.irradiance_format, self.format.packing()) {
            (Some(own), _) => own,
            (None, Packing::Texel(texel)) if self.format.container() == Container::Env => FormatSpec::ktx2(texel),
            (None, _) => self.format,
        }
    }

    /// How the texels of the specular cube are stored.
    ///
    /// **Errors**: those of [`map_texel`].
    pub fn cube_format(&self) -> Result<TexelFormat> {
        map_texel(self.format, self.layout)
    }

    /// Name of the specular cube's file.
    pub fn specular_name(&self) -> String {
        self.specular_file.clone().unwrap_or_else(|| format!("specular.{}", self.format.extension()))
    }

    /// Name of the irradiance cube's file, if there is one.
    pub fn irradiance_name(&self) -> Option<String> {
        let name = || format!("irradiance.{}", self.format_of_irradiance().extension());
        // An atlas has a tile for it.
        let own = self.irradiance == IrradianceKind::Cube && self.layout != SphereLayout::Atlas;
        own.then(|| self.irradiance_file.clone().unwrap_or_else(name))
    }

    /// How the input is read.
    pub fn reading(&self) -> Reading {
        Reading { layout: self.input_layout, nonfinite: self.nonfinite, negatives: self.negatives, to: self.to }
    }

    /// Files of an environment lie beside its certificate, each under its own name.
    fn check_names(&self) -> Result<()> {
        let mut names = vec![self.specular_name()];
        names.extend(self.irradiance_name());
        for (i, name) in names.iter().enumerate() {
            check_inside(name)?;
            let taken =
                ["sh.json", "sun.json", "certificate.json"].contains(&name.as_str()) || names[..i].contains(name);
            if taken || name.is_empty() || name.contains(['/', '\\']) {
                return Err(Error::usage(
                    format!("{name:?} is no name for a cube's file"),
                    "give each cube a name of its own, such as specular.ktx2, and folders by `directory`",
                ));
            }
        }
        Ok(())
    }

    /// Whether the environment can be baked.
    ///
    /// **Errors**: impossible sizes, more levels than halvings, roughness outside [0, 1], a format without three channels.
    pub fn check(&self) -> Result<()> {
        self.integration.check()?;
        self.adjust.check()?;
        if !(3..=MOST_BANDS).contains(&self.sh_bands) {
            return Err(Error::usage(
                format!("{} bands of spherical harmonics are not in 3..={MOST_BANDS}", self.sh_bands),
                "use something like --sh-bands 5, or leave it out for three",
            ));
        }
        if let Some(view) = self.view {
            check_view(view, self.kernel, self.integration.integrator)?;
            if self.fit == Fit::Lookup {
                return Err(Error::usage(
                    "fit \"lookup\" of a surface seen at an angle, whose lobe is known by samples only",
                    "use --fit none, or leave out the view angle and the anisotropy",
                ));
            }
        }
        self.check_names()?;
        for (name, size) in
            [("size", self.size), ("min-size", self.min_size), ("irradiance-size", self.irradiance_size)]
        {
            if size == 0 || size > LARGEST_CUBE {
                return Err(Error::usage(
                    format!("{name} {size} is not in 1..={LARGEST_CUBE}"),
                    format!("use something like --{name} {}", if name == "size" { 256 } else { 16 }),
                ));
            }
        }
        if self.roughness.is_none() && self.min_size > self.size {
            return Err(Error::usage(
                format!("min-size {} is larger than size {}", self.min_size, self.size),
                format!("use --min-size {} or smaller", self.size),
            ));
        }
        if let Some(roughness) = &self.roughness {
            if roughness.is_empty() {
                return Err(Error::usage("no roughness is given", "give one per level, such as --roughness 0,0.5,1"));
            }
            if let Some(bad) = roughness.iter().find(|r| !(0.0..=1.0).contains(*r)) {
                return Err(Error::usage(
                    format!("roughness {bad} is outside its domain [0, 1]"),
                    "give one per level, such as --roughness 0,0.5,1",
                ));
            }
            check_kernel(self.kernel, roughness)?;
            let most = self.size.ilog2() as usize + 1;
            if roughness.len() > most {
                return Err(Error::usage(
                    format!(
                        "{} levels are more than the {most} that a cube of size {} halves into",
                        roughness.len(),
                        self.size
                    ),
                    format!("use at most {most} values of roughness, or a larger --size"),
                ));
            }
        }
        self.layout.check_orientation(&self.orientation)?;
        self.check_atlas()?;
        self.check_levels()?;
        let halvings = self.level_roughness().len() - 1;
        if self.layout == SphereLayout::Equirect && !self.size.is_multiple_of(1 << halvings) {
            return Err(Error::usage(
                format!(
                    "size {} does not halve {halvings} times, so that panoramas would not stay twice as wide as high",
                    self.size
                ),
                format!("use a multiple of {}, or fewer levels", 1_usize << halvings),
            ));
        }
        map_texel(self.format, self.layout)?;
        map_texel(self.format_of_irradiance(), self.layout).map(|_| ())
    }

    /// An atlas is what PlayCanvas' shader expects, and nothing else.
    fn check_atlas(&self) -> Result<()> {
        if self.layout != SphereLayout::Atlas {
            return Ok(());
        }
        let levels = self.level_roughness().len();
        let texel = self.format.texel(3)?;
        let wrong = |problem: String, way_out: &str| Err(Error::usage(problem, way_out));
        if self.size != atlas::SIZE || self.irradiance_size != atlas::IRRADIANCE_SIZE {
            return wrong(
                format!("an atlas of size {} and irradiance size {}", self.size, self.irradiance_size),
                "leave --size, --irradiance-size and --draft out: PlayCanvas' shader knows tiles of 256 and 32 rows only",
            );
        }
        if levels != atlas::LEVELS {
            return wrong(format!("an atlas of {levels} levels"), "use --roughness 0,0.2,0.4,0.6,0.8,1");
        }
        if self.format.container() != Container::Png || texel != TexelFormat::Rgbp {
            return wrong(format!("an atlas in {}", self.format), "use --format png:rgbp, which PlayCanvas reads");
        }
        if self.irradiance != IrradianceKind::Cube || self.irradiance_format.is_some_and(|own| own != self.format) {
            return wrong(
                format!("an atlas with irradiance of its own kind ({})", self.irradiance.name()),
                "use --irradiance cube without --irradiance-format: the atlas has a tile for it",
            );
        }
        if self.fit != Fit::None {
            return wrong(
                "a fitted atlas, whose border would no longer be what it repeats".to_owned(),
                "use --fit none",
            );
        }
        Ok(())
    }

    /// A picture without mips holds one level, and no more.
    fn check_levels(&self) -> Result<()> {
        let levels = self.level_roughness().len();
        if levels == 1 || self.layout == SphereLayout::Atlas || self.format.container().has_mips() {
            return Ok(());
        }
        Err(Error::usage(
            format!("a chain of {levels} levels in {}, which holds one picture", self.format),
            "use ktx2, dds or exr, or a single level, such as --roughness 0",
        ))
    }
}

/// How the texels of a map of that format and layout are stored.
///
/// **Errors**: a container without cubes, a texel without three channels.
pub fn map_texel(format: FormatSpec, layout: SphereLayout) -> Result<TexelFormat> {
    let container = format.container();
    let fits = match layout {
        SphereLayout::Cube => container.has_cubes(),
        _ => container.has_pictures(),
    };
    match format.texel(3) {
        Ok(texel) if fits && texel.channels() >= 3 => Ok(texel),
        _ => Err(Error::usage(
            format!("{} of colours does not fit {format}", layout.article()),
            match layout {
                SphereLayout::Cube => {
                    "use --format ktx2:rgba16f, ktx2:rgba32f, or another of ktx2, ktx1, dds with three channels or more"
                }
                _ => {
                    "use --format ktx2:rgba16f, exr:f16, hdr, or another of ktx2, ktx1, dds, exr, hdr, png with three channels or more"
                }
            },
        )),
    }
}
