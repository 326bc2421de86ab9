//! `kiln bake`: everything that a recipe lists.

use super::arguments::{IntegrationArgs, ShaderArgs, no_own_numbers, warn_if_experimental};
use super::console::Console;
use super::env::bake_environment;
use super::table::{bake_array, bake_table};
use clap::Args;
use kiln::engine;
use kiln::format::atomic;
use kiln::recipe::{BUILT_IN, Recipe};
use kiln::{Error, Result};
use std::path::PathBuf;

/// Bake all tables and environments of a recipe; without one, the built-in recipe
#[derive(Debug, Args)]
#[command(after_help = "Without a recipe: the DFG, the energy tables, and a sky's environment. \
                        `kiln bake --print-recipe > mine.toml` is where to start an own one.")]
pub struct Bake {
    /// What to bake [default: the built-in recipe]
    recipe: Option<PathBuf>,
    /// Bake what these engines read, each in a folder of its name, see `kiln list engines`; entries of a recipe win over theirs
    #[arg(long, value_name = "NAME", value_delimiter = ',', num_args = 1..)]
    engine: Vec<String>,
    /// Environments to filter for the engines: files, or builtin:NAME
    #[arg(long = "env", value_name = "INPUT", num_args = 1.., requires = "engine")]
    environments: Vec<String>,
    /// The engines' own numbers, where they are known to be wrong
    #[arg(long, requires = "engine")]
    as_shipped: bool,
    /// Folder to write to; created if it is missing
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Print the recipe, complete, instead of baking it
    #[arg(long)]
    print_recipe: bool,
    #[command(flatten)]
    integration: IntegrationArgs,
    #[command(flatten)]
    shader: ShaderArgs,
}

impl Bake {
    pub fn run(&self, console: &Console) -> Result<()> {
        let mut recipe = self.listed(console)?;
        for table in &mut recipe.tables {
            table.integration = self.integration.over(table.integration);
            table.integration.check()?;
        }
        for layer in recipe.arrays.iter_mut().flat_map(|array| &mut array.layers) {
            layer.integration = self.integration.over(layer.integration);
            layer.integration.check()?;
        }
        for environment in &mut recipe.environments {
            environment.integration = self.integration.over(environment.integration);
            environment.check()?;
        }
        let languages = self.shader.languages();
        if !languages.is_empty() {
            recipe.shader = languages;
        }
        if self.print_recipe {
            // The built-in one as it stands, with its comments, unless a flag changed it.
            let unchanged = self.recipe.is_none() && self.engine.is_empty() && recipe == Recipe::built_in()?;
            return console.print(&if unchanged { BUILT_IN.to_owned() } else { recipe.to_toml()? });
        }
        let mut certificates = vec![];
        for table in &recipe.tables {
            certificates.push(bake_table(table, &self.out, &[], console)?);
        }
        for array in &recipe.arrays {
            certificates.extend(bake_array(array, &self.out, console)?);
        }
        for environment in &recipe.environments {
            certificates.push(bake_environment(environment, &self.out, &[], console)?);
        }
        for (path, text) in kiln::bake::combined_shader(&recipe, &certificates, &self.out)? {
            atomic::write(&self.out.join(&path), text.as_bytes())?;
            console.note(&format!("{}: code for all of it", self.out.join(&path).display()));
        }
        if console.json { console.print_json(&certificates) } else { Ok(()) }
    }

    /// What the engines and the recipe list; the built-in recipe without either.
    fn listed(&self, console: &Console) -> Result<Recipe> {
        let file = match &self.recipe {
            Some(path) => {
                let text = std::fs::read_to_string(path).map_err(|e| Error::reading(path, e))?;
                Some(Recipe::from_toml(&text).map_err(|e| e.in_file(path))?)
            }
            None => None,
        };
        if self.engine.is_empty() {
            return file.map_or_else(Recipe::built_in, Ok);
        }
        let engines = self.engine.iter().map(|name| engine::find(name)).collect::<Result<Vec<_>>>()?;
        for engine in &engines {
            warn_if_experimental(engine, console);
            if self.as_shipped && !engine.has_own_numbers() {
                console.warn(&no_own_numbers(engine.name));
            }
            if !self.environments.is_empty() && engine.environment.is_none() {
                console.warn(&format!("{} reads no filtered environment; its tables alone are baked", engine.name));
            }
        }
        let mut recipe = engine::recipe(&engines, &self.environments, self.as_shipped)?;
        if let Some(file) = file {
            recipe.tables.retain(|own| !file.tables.iter().any(|table| table.file == own.file));
            recipe.tables.extend(file.tables);
            let replaced = |own: &str| file.environments.iter().any(|environment| environment.directory == own);
            recipe.environments.retain(|own| !replaced(&own.directory));
            recipe.environments.extend(file.environments);
            recipe.arrays.retain(|own| !file.arrays.iter().any(|array| array.file == own.file));
            recipe.arrays.extend(file.arrays);
            recipe.check()?;
        }
        Ok(recipe)
    }
}
