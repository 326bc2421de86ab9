//! Verification of a table.

use super::{Content, Options, Report, digest_check};
use crate::bake::{texel_digest, ulp};
use crate::certificate::Certificate;
use crate::check::{Check, TableValues};
use crate::error::{Error, Result};
use crate::integrate::{ErrorKind, Integration};
use crate::recipe::TableRecipe;
use crate::table::TableSpec;
use std::path::Path;

pub(super) fn verify(
    path: &Path,
    content: &Content,
    certificate: &Certificate,
    recipe: &TableRecipe,
    options: Options,
) -> Result<Report> {
    let spec = recipe.spec()?;
    spec.check().map_err(|e| e.in_file(path))?;
    let texels = texels(content, &spec).map_err(|e| e.in_file(path))?;
    let integration = Integration::new(recipe.integration)?;
    let errors = claimed_errors(certificate, &spec, &integration);
    let kind = if integration.is_monte_carlo() { ErrorKind::Sigma } else { ErrorKind::Bound };
    let values: Vec<f64> = texels.iter().map(|&v| f64::from(v)).collect();
    let ulp = ulp(recipe.format.number());
    let judged = TableValues { spec: &spec, values: &values, errors: &errors, kind, ulp };
    let mut checks: Vec<Check> =
        digest_check(path, certificate, &texel_digest([texels.as_slice()])).into_iter().collect();
    checks.extend(judged.facts());
    checks.extend(judged.every_texel()?);
    checks.extend(judged.random_witness(recipe.integration.seed, options.full)?);
    let axes: Vec<String> = recipe.axes.iter().map(ToString::to_string).collect();
    let claim = format!(
        "table of {} over {} ({} Smith)",
        recipe.channels.join(", "),
        axes.join(" × "),
        recipe.model.smith.name()
    );
    Ok(Report { file: path.to_owned(), claim, checks, skipped: vec![] })
}

/// The errors that the certificate claims; never more than the recipe's tolerance allows, whatever the certificate says.
fn claimed_errors(certificate: &Certificate, spec: &TableSpec, integration: &Integration) -> Vec<f64> {
    let most = if integration.settings.samples.is_some() { f64::INFINITY } else { integration.tolerance() };
    let claim = |name: &str| certificate.channels.iter().find(|c| c.quantity == name).map_or(0.0, |c| c.max_error);
    spec.channels.iter().map(|c| claim(c.quantity.name).min(most)).collect()
}

/// The values of the claimed channels, channel fastest.
fn texels(content: &Content, spec: &TableSpec) -> Result<Vec<f32>> {
    let wanted = (spec.width(), spec.height());
    let same_size = |width, height| {
        if (width, height) == wanted {
            return Ok(());
        }
        Err(Error::invalid(
            format!("{width} × {height} texels, where the certificate says {} × {}", wanted.0, wanted.1),
            "bake the file again",
        ))
    };
    let n = spec.channels.len();
    match content {
        Content::Picture(image) => {
            same_size(image.width, image.height)?;
            let index = |name: &str| {
                image.channel_index(name).ok_or_else(|| {
                    Error::invalid(
                        format!("no channel {name} among {}", image.channels.join(", ")),
                        "bake the file again",
                    )
                })
            };
            let order: Vec<usize> = spec.channels.iter().map(|c| index(c.quantity.name)).collect::<Result<_>>()?;
            Ok(image.texels.chunks_exact(image.channels.len()).flat_map(|t| order.iter().map(|&i| t[i])).collect())
        }
        Content::Texture(texture) => {
            same_size(texture.width, texture.height)?;
            let stored = texture.format.channels;
            let values = texture.face(0, 0).unwrap_or_default();
            if texture.faces != 1 || stored < n {
                return Err(Error::invalid(
                    format!("{} faces of {stored} channels, where the certificate says a table of {n}", texture.faces),
                    "bake the file again",
                ));
            }
            Ok(values.chunks_exact(stored).flat_map(|t| t[..n].iter().copied()).collect())
        }
        Content::Json(_) => {
            Err(Error::invalid("JSON, where the certificate says a table", "give the table's own file"))
        }
    }
}
