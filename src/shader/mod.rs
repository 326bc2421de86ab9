//! Code that looks up what was baked: this table, this chain, in GLSL, HLSL and WGSL.
//!
//! Where a texel lies is not known here: the axis writes the formula from a parameter to a texture coordinate
//! ([`Axis::coordinate`]), the arrangement that of an atlas ([`Arrangement::atlas_coordinate`]). What is known here is how functions
//! are called and put together: `table` for a table, `energy` for what is done with its values, `packing` for texels that are codes, `chain`, `flat` (no cubes) and `harmonics`
//! for an environment; `code` prints them in each language.
//!
//! Every name begins with that of the file, so that the code of several files can stand in one shader.
//!
//! [`Axis::coordinate`]: crate::table::Axis::coordinate
//! [`Arrangement::atlas_coordinate`]: crate::table::Arrangement::atlas_coordinate

mod chain;
mod code;
mod energy;
mod flat;
mod harmonics;
mod identifier;
mod packing;
mod table;

pub use chain::level_of_roughness;
pub use identifier::{identifier, identifiers};

use crate::certificate::Certificate;
use crate::environment::spherical_harmonics::SphericalHarmonics;
use crate::error::{Error, Result};
use crate::language::Language;
use code::Item;

/// The code for one table or environment, in no language yet.
#[derive(Debug, Clone, PartialEq)]
pub struct Shader {
    /// What it is for, as comment.
    head: String,
    /// Structures and functions, each after those that it calls.
    items: Vec<Item>,
}

impl Shader {
    /// The code for the table that a certificate is for, names beginning with `name`.
    ///
    /// **Errors**: a certificate of something else; a recipe that makes no sense.
    pub fn of_table(name: &str, certificate: &Certificate) -> Result<Self> {
        let recipe = certificate.table.as_ref().ok_or_else(|| {
            Error::invalid("a certificate without the recipe of a table", "name a table that Kiln baked")
        })?;
        table::shader(name, recipe, certificate)
    }

    /// The code for the environment that a certificate is for, names beginning with `name`; with the coefficients of its `sh.json`, if
    /// they are known.
    ///
    /// **Errors**: a certificate of something else; roughness that does not rise from level to level.
    pub fn of_environment(name: &str, certificate: &Certificate, sh: Option<&SphericalHarmonics>) -> Result<Self> {
        let recipe = certificate.environment.as_ref().ok_or_else(|| {
            Error::invalid(
                "a certificate without the recipe of an environment",
                "name a file of an environment that Kiln baked",
            )
        })?;
        chain::shader(name, recipe, certificate, sh)
    }

    /// The code in a language.
    pub fn to_text(&self, language: Language) -> String {
        let items: Vec<String> = self.items.iter().map(|item| item.print(language)).collect();
        format!("{}\n{}", code::comment(&self.head), items.join("\n"))
    }
}

/// The code of several in one file.
pub fn combined(shaders: &[Shader], language: Language) -> String {
    let texts: Vec<String> = shaders.iter().map(|shader| shader.to_text(language)).collect();
    texts.join("\n\n")
}
