//! The shader code that goes with what is baked, or was.

use super::{Baked, ShFile};
use crate::certificate::{self, Certificate};
use crate::environment::spherical_harmonics::SphericalHarmonics;
use crate::error::{Error, Result};
use crate::format::FileKind;
use crate::language::Language;
use crate::recipe::Recipe;
use crate::shader::{Shader, combined, identifier, identifiers};
use std::path::{Path, PathBuf};

/// The name of the code for an environment, and for all that a recipe bakes.
const LOOKUP: &str = "lookup";
/// What the code of an environment is called that has no folder of its own.
const ENVIRONMENT: &str = "environment";
const SH: &str = "sh.json";

impl Baked {
    /// Adds code in `languages`: `NAME.lookup.glsl` beside a table, `lookup.glsl` in an environment's folder.
    ///
    /// **Errors**: a chain whose roughness falls.
    pub fn add_shader(&mut self, languages: &[Language]) -> Result<()> {
        if languages.is_empty() {
            return Ok(());
        }
        let sh =
            self.files.iter().find(|(path, _)| path.ends_with(SH)).map(|(_, bytes)| harmonics(bytes)).transpose()?;
        let shader = shader(&name_of(&self.certificate), &self.certificate, sh.as_ref())?;
        for language in languages {
            let path = match (&self.certificate.table, &self.certificate.environment) {
                (Some(table), _) => PathBuf::from(&table.file).with_extension(format!("{LOOKUP}.{language}")),
                (_, recipe) => {
                    let folder = recipe.as_ref().map(|recipe| recipe.directory.as_str()).unwrap_or_default();
                    Path::new(folder).join(format!("{LOOKUP}.{language}"))
                }
            };
            self.files.push((path, shader.to_text(*language).into_bytes()));
        }
        Ok(())
    }
}

/// `lookup.glsl` and so on for everything that a recipe baked below `folder`, as it asks for: names and texts.
///
/// **Errors**: a chain whose roughness falls; an `sh.json` that cannot be read.
pub fn combined_shader(recipe: &Recipe, certificates: &[Certificate], folder: &Path) -> Result<Vec<(String, String)>> {
    if recipe.shader.is_empty() {
        return Ok(vec![]);
    }
    let files: Vec<String> = certificates.iter().map(file_of).collect();
    let names = identifiers(&files.iter().map(String::as_str).collect::<Vec<_>>());
    let one = |(name, certificate): (&String, &Certificate)| {
        let sh = certificate.environment.as_ref().map(|e| harmonics_in(&folder.join(&e.directory))).transpose()?;
        shader(name, certificate, sh.flatten().as_ref())
    };
    let shaders: Vec<Shader> = names.iter().zip(certificates).map(one).collect::<Result<_>>()?;
    let text = |language: &Language| (format!("{LOOKUP}.{language}"), combined(&shaders, *language));
    Ok(recipe.shader.iter().map(text).collect())
}

/// The code for a file that was baked, from its certificate, of an array from those of its layers; names begin with `name`, or else with
/// the file's.
///
/// **Errors**: a file that cannot be read or has no certificate.
pub fn shader_of(path: &Path, name: Option<&str>) -> Result<Vec<Shader>> {
    let file = if path.is_dir() { path.join("certificate.json") } else { path.to_owned() };
    let bytes = std::fs::read(&file).map_err(|e| Error::reading(&file, e))?;
    let decoded = match (certificate::decode(&file, &bytes), FileKind::of(&bytes)) {
        (Ok(decoded), _) => Some(decoded),
        (Err(_), FileKind::Other(_)) => None, // a certificate by itself is text
        (Err(error), _) => return Err(error),
    };
    if let Some(json) = decoded.as_ref().and_then(|decoded| decoded.metadata(certificate::LAYERS_KEY)) {
        let certificates = Certificate::list_from_json(json)?;
        let of = |certificate: &Certificate| {
            let own = name_of(certificate);
            Shader::of_table(&name.map_or(own.clone(), |name| format!("{}_{own}", identifier(name))), certificate)
        };
        return certificates.iter().map(of).collect();
    }
    let text = String::from_utf8_lossy(&bytes);
    let json = decoded.as_ref().map_or(Some(text.as_ref()), |d| d.metadata(certificate::KEY)).ok_or_else(|| {
        Error::invalid("no certificate in it", "name a file that Kiln baked, or its certificate.json")
    })?;
    let certificate = Certificate::from_json(json)?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let sh = certificate.environment.as_ref().map(|_| harmonics_in(folder)).transpose()?;
    let name = name.map_or_else(|| name_of(&certificate), identifier);
    Ok(vec![shader(&name, &certificate, sh.flatten().as_ref())?])
}

fn shader(name: &str, certificate: &Certificate, sh: Option<&SphericalHarmonics>) -> Result<Shader> {
    match certificate.table {
        Some(_) => Shader::of_table(name, certificate),
        None => Shader::of_environment(name, certificate, sh),
    }
}

/// The file of a table, the folder of an environment.
fn file_of(certificate: &Certificate) -> String {
    let environment = |e: &crate::recipe::EnvironmentRecipe| match e.directory.as_str() {
        "" => ENVIRONMENT.to_owned(),
        folder => folder.to_owned(),
    };
    let table = certificate.table.as_ref().map(|t| t.file.clone());
    table.or(certificate.environment.as_ref().map(environment)).unwrap_or_default()
}

fn name_of(certificate: &Certificate) -> String {
    identifier(&file_of(certificate))
}

/// The coefficients beside an environment's cubes, if they are there.
fn harmonics_in(folder: &Path) -> Result<Option<SphericalHarmonics>> {
    let path = folder.join(SH);
    match std::fs::read(&path) {
        Ok(bytes) => harmonics(&bytes).map(Some).map_err(|e| e.in_file(&path)),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::reading(&path, e)),
    }
}

fn harmonics(json: &[u8]) -> Result<SphericalHarmonics> {
    serde_json::from_slice(json)
        .map(|file: ShFile| file.harmonics)
        .map_err(|e| Error::invalid(format!("not an sh.json of Kiln's: {e}"), "bake the environment again"))
}
