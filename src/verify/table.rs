//! Verification of a table.

use super::{Content, Options, Report, digest_check};
use crate::bake::{self, texel_digest};
use crate::certificate::Certificate;
use crate::check::{Check, Precision, TableValues};
use crate::claim::model_words;
use crate::error::{Error, Result};
use crate::format::Container;
use crate::integrate::Integration;
use crate::recipe::TableRecipe;
use crate::table::TableSpec;
use crate::table::lookup::lookup_errors;
use crate::table::quantity::Handle;
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
    let texels = texels(content, &spec, recipe).map_err(|e| e.in_file(path))?;
    let integration = Integration::new(recipe.integration)?;
    let errors = claimed_errors(certificate, &spec, &integration);
    let kinds = spec.error_kinds(&integration);
    let values: Vec<f64> = texels.iter().map(|&v| f64::from(v)).collect();
    let precision = Precision::new(recipe.texel_format()?, values.iter().copied(), certificate.packing.max_block_error);
    let judged = TableValues { spec: &spec, values: &values, errors: &errors, kinds: &kinds, precision };
    let mut checks: Vec<Check> =
        digest_check(path, certificate, &texel_digest([texels.as_slice()])).into_iter().collect();
    if certificate.fit.iter().any(|channel| channel.kept) {
        // Chosen for the lookup: texels are no values of the quantities, so that they are chosen again, and looked up.
        let (again, _) = bake::table_values(&spec, recipe, &integration, &|_| {})?;
        checks.extend(judged.ranges());
        checks.extend(judged.against("fitted again, every texel", &again.values));
        for (found, claimed) in lookup_errors(&spec, &texels)?.iter().zip(&certificate.lookup) {
            let detail = format!("worst at {}", found.worst_at);
            let name = "error through bilinear filtering, as certified";
            // The same points of the same texels: the same number, but for the last digits of the certificate.
            checks.push(Check::at_most(name, &found.channel, found.max, claimed.max * (1.0 + 1e-9), detail));
        }
    } else {
        checks.extend(judged.facts());
        checks.extend(judged.every_texel(|_| true)?);
        checks.extend(judged.random_witness(recipe.integration.seed, options.full, |_| true)?);
    }
    let axes: Vec<String> = recipe.axes.iter().map(ToString::to_string).collect();
    let fixed = if recipe.at.is_empty() { String::new() } else { format!(" at {}", recipe.at) };
    let choices = model_words(&spec);
    let claim = format!("table of {} over {}{fixed}{choices}", recipe.channels.join(", "), axes.join(" × "));
    Ok(Report { file: path.to_owned(), claim, checks, skipped: vec![], ..Report::default() })
}

/// The errors that the certificate claims; never more than the recipe's tolerance allows, whatever the certificate says.
fn claimed_errors(certificate: &Certificate, spec: &TableSpec, integration: &Integration) -> Vec<f64> {
    let most = |c: &Handle| match integration.settings.samples {
        Some(_) => f64::INFINITY,
        None => integration.tolerance_of(c.is_monte_carlo(integration)),
    };
    let claim = |name: &str| certificate.channels.iter().find(|c| c.quantity == name).map_or(0.0, |c| c.max_error);
    spec.channels.iter().map(|c| claim(&c.label()).min(most(c))).collect()
}

/// The values of the claimed channels, channel fastest.
fn texels(content: &Content, spec: &TableSpec, recipe: &TableRecipe) -> Result<Vec<f32>> {
    let arrangement = recipe.arrangement()?;
    let wanted = arrangement.size;
    let same_size = |size: [usize; 3]| {
        if size == wanted {
            return Ok(());
        }
        let text = |size: [usize; 3]| size.map(|n| n.to_string()).join(" × ");
        Err(Error::invalid(
            format!("{} texels, where the certificate says {}", text(size), text(wanted)),
            "bake the file again",
        ))
    };
    let n = arrangement.file_channels();
    let values: Vec<f32> = match content {
        Content::Picture(image) => {
            same_size([image.width, image.height, 1])?;
            let index = |name: &String| {
                image.channel_index(name).ok_or_else(|| {
                    Error::invalid(
                        format!("no channel {name} among {}", image.channels.join(", ")),
                        "bake the file again",
                    )
                })
            };
            let labels: Vec<String> = spec.channels.iter().map(Handle::label).collect();
            let names: Vec<&str> = labels.iter().map(String::as_str).collect();
            // Only an OpenEXR has the names; elsewhere channels stand in their order.
            let order: Vec<usize> = if recipe.format.container() == Container::Exr {
                arrangement.names(&names).iter().map(index).collect::<Result<_>>()?
            } else {
                (0..n.min(image.channels.len())).collect()
            };
            image.texels.chunks_exact(image.channels.len()).flat_map(|t| order.iter().map(|&i| t[i])).collect()
        }
        Content::Array(array) => {
            let stored = recipe.texel_format()?.channels();
            if array.values.len() != wanted.iter().product::<usize>() * stored {
                return Err(Error::invalid(
                    format!("an array of {:?}, where the certificate says {wanted:?}", array.shape),
                    "bake the file again",
                ));
            }
            array.values.chunks_exact(stored).flat_map(|t| t[..n].iter().map(|&v| v as f32)).collect()
        }
        Content::Texture(texture) => {
            same_size([texture.width, texture.height, texture.depth.max(1)])?;
            let stored = texture.format.channels();
            if texture.faces != 1 || stored < n {
                return Err(Error::invalid(
                    format!("{} faces of {stored} channels, where the certificate says a table of {n}", texture.faces),
                    "bake the file again",
                ));
            }
            let slices = (0..texture.layers(0)).filter_map(|slice| texture.face(0, slice));
            slices
                .flat_map(|values| values.chunks_exact(stored).flat_map(|t| t[..n].to_vec()).collect::<Vec<_>>())
                .collect()
        }
        Content::Json(_) => {
            return Err(Error::invalid("JSON, where the certificate says a table", "give the table's own file"));
        }
    };
    Ok(arrangement.gather(&values))
}
