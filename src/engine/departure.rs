//! What of a recipe an engine no longer reads right: flags win over a preset, but not in silence.

use super::{Engine, EngineTable};
use crate::error::Result;
use crate::recipe::{EnvironmentRecipe, TableRecipe};
use crate::table::Axis;

impl Engine {
    /// What the engine's shader reads otherwise than the table has it, a sentence each. Sizes are nobody's business: shaders ask for them.
    ///
    /// **Errors**: none, as a test makes every preset.
    pub fn table_departures(&self, table: &EngineTable, recipe: &TableRecipe, as_shipped: bool) -> Result<Vec<String>> {
        let preset = table.recipe(as_shipped)?;
        let mut found = vec![];
        let mut differs = |what: &str, theirs: String, ours: String| {
            if theirs != ours {
                found.push(format!("{} reads {what} {theirs}, and {what} {ours} was asked for", self.name));
            }
        };
        let axes = |recipe: &TableRecipe| {
            let without_size = |axis: &Axis| Axis { size: 0, ..*axis }.brief().replace(":0", "");
            recipe.axes.iter().map(without_size).collect::<Vec<_>>().join(",")
        };
        differs("channels", preset.channels.join(","), recipe.channels.join(","));
        differs("axes", axes(&preset), axes(recipe));
        differs("format", preset.format.to_string(), recipe.format.to_string());
        differs("masking", preset.model.smith.name().to_owned(), recipe.model.smith.name().to_owned());
        differs("visibility", preset.model.visibility.name().to_owned(), recipe.model.visibility.name().to_owned());
        Ok(found)
    }

    /// What the engine's shader reads otherwise than the environment has it, a sentence each.
    ///
    /// **Errors**: none, as a test makes every preset.
    pub fn environment_departures(&self, recipe: &EnvironmentRecipe, as_shipped: bool) -> Result<Vec<String>> {
        let mut found = vec![];
        let Some(preset) = self.environment_recipe(&recipe.input, as_shipped)? else { return Ok(found) };
        let Some(own) = &self.environment else { return Ok(found) };
        let mut differs = |what: &str, theirs: String, ours: String| {
            if theirs != ours {
                found.push(format!("{} reads {what} {theirs}, and {what} {ours} was asked for", self.name));
            }
        };
        differs("layout", preset.layout.name().to_owned(), recipe.layout.name().to_owned());
        let list = |values: &[f64]| values.iter().map(|r| format!("{r:.3}")).collect::<Vec<_>>().join(",");
        differs("roughness", list(&own.level_roughness(recipe.size, as_shipped)), list(&recipe.level_roughness()));
        differs("kernel", preset.kernel.name().to_owned(), recipe.kernel.name().to_owned());
        differs("orientation", preset.orientation.to_string(), recipe.orientation.to_string());
        differs("format", preset.format.to_string(), recipe.format.to_string());
        differs("irradiance", preset.irradiance.name().to_owned(), recipe.irradiance.name().to_owned());
        if recipe.irradiance == crate::recipe::IrradianceKind::Cube {
            let formats = [&preset, recipe].map(|r| r.format_of_irradiance().to_string());
            let [theirs, ours] = formats;
            differs("irradiance format", theirs, ours);
        }
        differs("sh", preset.sh.name().to_owned(), recipe.sh.name().to_owned());
        Ok(found)
    }
}
