//! Baking a table.

use super::{Baked, refuse_failures, texel_digest};
use crate::certificate::{self, Certificate, Channel, FileDigest};
use crate::check::TableValues;
use crate::error::{Error, Result};
use crate::format::{FormatSpec, Image, exr, ktx2};
use crate::integrate::{Integration, Integrator};
use crate::recipe::TableRecipe;
use crate::table::lookup::lookup_errors;
use crate::table::quantity::Handle;
use crate::table::rounding::{Rounding, decide};
use crate::table::{Progress, Table};
use std::path::Path;

/// Integrates, checks and packs one table.
///
/// **Errors**: a recipe that cannot be baked; a tolerance that is not reached; a failed check.
pub fn table(recipe: &TableRecipe, progress: Progress) -> Result<Baked> {
    recipe.check_format()?;
    let spec = recipe.spec()?;
    let integration = Integration::new(recipe.integration)?;
    let mut table = spec.bake(&integration, progress)?;
    let number = recipe.format.number();
    let rounding = decide(&mut table, number, &integration)?;
    let (bytes, packing) = number.pack(&table.values);
    let texels = number.unpack(&bytes);
    let errors = table.worst_errors();
    let values: Vec<f64> = texels.iter().map(|&v| f64::from(v)).collect();
    let judged =
        TableValues { spec: &spec, values: &values, errors: &errors, kinds: &table.kinds, number: Some(number) };
    let mut checks = judged.facts();
    // Whichever witness did not compute a channel looks at it.
    let random = |h: &Handle| h.is_monte_carlo(&integration);
    checks.extend(judged.every_texel(random)?);
    checks.extend(judged.random_witness(recipe.integration.seed, false, |h| !random(h) || !h.family.has_quadrature())?);
    let certificate = Certificate {
        files: vec![FileDigest { file: file_name(&recipe.file)?, digest: texel_digest([texels.as_slice()]) }],
        channels: channels(&table, &integration),
        lookup: lookup_errors(&spec, &texels)?,
        table: Some(recipe.clone()),
        checks,
        packing,
        rounding: Some(rounding).filter(|r| *r != Rounding::default()),
        ..Certificate::new()
    };
    refuse_failures(&certificate)?;
    let file = recipe.file.clone().into();
    let certificate_path = certificate::beside(Path::new(&recipe.file));
    Ok(Baked { files: vec![(file, encode(&table, recipe, &certificate)?)], certificate_path, certificate })
}

fn file_name(path: &str) -> Result<String> {
    let name = Path::new(path).file_name().and_then(|n| n.to_str());
    name.map(str::to_owned)
        .ok_or_else(|| Error::usage(format!("{path:?} names no file"), "give a file name such as dfg.ktx2"))
}

fn channels(table: &Table, integration: &Integration) -> Vec<Channel> {
    let n = table.spec.channels.len();
    let integrator = |h: &Handle| {
        if h.is_monte_carlo(integration) { Integrator::MonteCarlo } else { Integrator::Quadrature }
    };
    let errors = table.worst_errors();
    let of = |c: usize| table.values.iter().copied().skip(c).step_by(n);
    let row = |(c, handle): (usize, &Handle)| Channel {
        quantity: handle.quantity.name.to_owned(),
        definition: handle.quantity.definition.to_owned(),
        source: handle.quantity.source.to_owned(),
        integrator: integrator(handle).name().to_owned(),
        max_error: errors[c],
        error_kind: table.kinds[c],
        min: of(c).fold(f64::INFINITY, f64::min),
        max: of(c).fold(f64::NEG_INFINITY, f64::max),
        mean: of(c).sum::<f64>() / table.spec.len() as f64,
    };
    table.spec.channels.iter().enumerate().map(row).collect()
}

/// The bytes of the file. Channels of a texel format that the table does not fill are 0.
fn encode(table: &Table, recipe: &TableRecipe, certificate: &Certificate) -> Result<Vec<u8>> {
    let arrangement = recipe.arrangement()?;
    let ([width, height, depth], n) = (arrangement.size, arrangement.file_channels());
    let values = arrangement.scatter(&table.values);
    let metadata = vec![(certificate::KEY.to_owned(), certificate.to_json()?)];
    match recipe.format {
        FormatSpec::Exr(number) => {
            let names: Vec<&str> = table.spec.channels.iter().map(|c| c.quantity.name).collect();
            let image =
                Image { width, height, channels: arrangement.names(&names), texels: values, metadata, primaries: None };
            Ok(exr::encode(&image, number)?.0)
        }
        FormatSpec::Ktx2(texel) => {
            let padding = vec![0.0; texel.channels - n];
            let values: Vec<f64> = values.chunks_exact(n).flat_map(|v| [v, &padding].concat()).collect();
            let (mut texture, _) = if arrangement.is_volume() {
                ktx2::Texture::volume(texel, [width, height, depth], &values)?
            } else {
                ktx2::Texture::flat(texel, width, height, &values)?
            };
            texture.metadata = metadata;
            ktx2::encode(&texture)
        }
    }
}
