//! Baking a table.

use super::{Baked, refuse_failures, texel_digest};
use crate::certificate::{self, Certificate, Channel, FileDigest};
use crate::check::{Precision, SIGMAS, TableValues};
use crate::error::{Error, Result};
use crate::format::{self, Container, Image, Texture, exr, source};
use crate::integrate::{Estimate, Integration, Integrator};
use crate::math::fit::Fit;
use crate::pack::{PackReport, TexelFormat};
use crate::recipe::TableRecipe;
use crate::table::fit::{TableFit, fit};
use crate::table::lookup::lookup_errors;
use crate::table::quantity::{Approximation, Handle};
use crate::table::rounding::{Rounding, decide};
use crate::table::{Arrangement, Progress, Table, TableSpec};
use rayon::prelude::*;
use std::path::Path;

/// Integrates, checks and packs one table.
///
/// **Errors**: a recipe that cannot be baked; a tolerance that is not reached; a failed check.
pub fn table(recipe: &TableRecipe, progress: Progress) -> Result<Baked> {
    let (table, file, certificate) = judged_table(recipe, true, progress)?;
    let path = recipe.file.clone().into();
    let certificate_path = certificate::beside(Path::new(&recipe.file));
    Ok(Baked { files: vec![(path, encode(&table, file, recipe, &certificate)?)], certificate_path, certificate })
}

/// The certificate of a table on which the other witness was not heard, and of which no file is made: what the first one takes, for
/// benchmarks and for a look at a table before it is baked.
///
/// **Errors**: those of [`table()`], but for what only the other witness finds.
pub fn table_by_one_witness(recipe: &TableRecipe, progress: Progress) -> Result<Certificate> {
    Ok(judged_table(recipe, false, progress)?.2)
}

/// The table, as it lies in its file, and what is known of it.
pub(super) fn judged_table(
    recipe: &TableRecipe,
    both: bool,
    progress: Progress,
) -> Result<(Table, Texture, Certificate)> {
    recipe.check_format()?;
    let spec = recipe.spec()?;
    let integration = Integration::new(recipe.integration)?;
    let (mut table, fit) = values(&spec, recipe, &integration, progress)?;
    let is_fitted = fit.iter().any(|channel| channel.kept);
    // A fitted texel is no value of the quantity: there is nothing that it could be the nearest number to.
    let rounding =
        if is_fitted { Rounding::default() } else { decide(&mut table, recipe.texel_format()?, &integration)? };
    let (file, packing) = pack(&table, recipe)?;
    let texels = unpack(&file, recipe)?;
    let errors = table.worst_errors();
    let values: Vec<f64> = texels.iter().map(|&v| f64::from(v)).collect();
    let judged = TableValues {
        spec: &spec,
        values: &values,
        errors: &errors,
        kinds: &table.kinds,
        precision: Precision::new(file.format, values.iter().copied(), packing.max_block_error),
    };
    let lookup = lookup_errors(&spec, &texels)?;
    let mut checks;
    if is_fitted {
        checks = judged.ranges();
    } else {
        checks = judged.facts();
        // Whichever witness did not compute a channel looks at it.
        let random = |h: &Handle| h.is_monte_carlo(&integration);
        if both {
            checks.extend(judged.every_texel(random)?);
            let looked_at = |h: &Handle| !random(h) || !h.family.has_quadrature();
            checks.extend(judged.random_witness(recipe.integration.seed, false, looked_at)?);
        }
    }
    let certificate = Certificate {
        files: vec![FileDigest { file: file_name(&recipe.file)?, digest: texel_digest([texels.as_slice()]) }],
        channels: channels(&table, &integration),
        lookup,
        approximation: approximation(&spec),
        fit,
        table: Some(recipe.clone()),
        checks,
        packing,
        rounding: Some(rounding).filter(|r| *r != Rounding::default()),
        ..Certificate::new()
    };
    refuse_failures(&certificate)?;
    Ok((table, file, certificate))
}

/// The texels before packing: the quantities at their centres, or chosen for the lookup, and what that came to.
pub(crate) fn values(
    spec: &TableSpec,
    recipe: &TableRecipe,
    integration: &Integration,
    progress: Progress,
) -> Result<(Table, Vec<TableFit>)> {
    let mut table = spec.bake(integration, progress)?;
    let fitted = if recipe.fit == Fit::Lookup { fit(&mut table)? } else { vec![] };
    Ok((table, fitted))
}

/// How far fitted lobes are from what they stand for, one entry per family that fits any.
fn approximation(spec: &TableSpec) -> Vec<certificate::Approximation> {
    let mut found = vec![];
    for (i, first) in spec.channels.iter().enumerate() {
        if spec.channels[..i].iter().any(|c| c.same_family(first)) {
            continue;
        }
        let at = |texel: usize| Some((texel, first.family.approximation(&spec.point(texel), &spec.model)?));
        let all: Vec<(usize, Approximation)> = (0..spec.len()).into_par_iter().filter_map(at).collect();
        let Some((worst, most)) = all.iter().max_by(|a, b| a.1.total_variation.total_cmp(&b.1.total_variation)) else {
            continue;
        };
        let mean = |of: &dyn Fn(&Approximation) -> f64| all.iter().map(|(_, a)| of(a)).sum::<f64>() / all.len() as f64;
        let labels: Vec<String> = spec.channels.iter().filter(|c| c.same_family(first)).map(Handle::label).collect();
        found.push(certificate::Approximation {
            channels: labels.join(", "),
            max_total_variation: most.total_variation,
            mean_total_variation: mean(&|a| a.total_variation),
            worst_at: spec.point(*worst),
            max_square: all.iter().map(|(_, a)| a.square).fold(0.0, f64::max),
            rms: mean(&|a| a.square * a.square).sqrt(),
        });
    }
    found
}

pub(super) fn file_name(path: &str) -> Result<String> {
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
        quantity: handle.label(),
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

/// The table as it lies in its file. Channels of a texel format that the table does not fill are 0.
fn pack(table: &Table, recipe: &TableRecipe) -> Result<(Texture, PackReport)> {
    let arrangement = recipe.arrangement()?;
    let ([width, height, depth], n) = (arrangement.size, arrangement.file_channels());
    let format = recipe.texel_format()?;
    let padding = vec![0.0; format.channels() - n];
    let values = within_errors(table, format);
    let values: Vec<f64> = arrangement.scatter(&values).chunks_exact(n).flat_map(|v| [v, &padding].concat()).collect();
    let (mut texture, report) = if arrangement.is_volume() {
        Texture::volume(format, [width, height, depth], &values)?
    } else {
        Texture::flat(format, width, height, &values)?
    };
    if padding.is_empty() {
        texture.channels = names(table, &arrangement);
    }
    refuse_clamped(recipe, format, &report)?;
    Ok((texture, report))
}

/// The values, but for what is beyond the range of a format without a sign by no more than its own error: the truth may be at the end, and an
/// albedo of 1, known to 1e-8, is.
fn within_errors(table: &Table, format: TexelFormat) -> Vec<f64> {
    if format.is_signed() {
        return table.values.clone();
    }
    let n = table.spec.channels.len();
    let values = table.values.iter().zip(&table.errors).enumerate();
    values
        .map(|(i, (&value, &error))| {
            let nearest = value.clamp(0.0, format.largest(i % n));
            let room = Estimate { value, error, kind: table.kinds[i % n] }.half_width(SIGMAS);
            if (value - nearest).abs() <= room { nearest } else { value }
        })
        .collect()
}

fn names(table: &Table, arrangement: &Arrangement) -> Vec<String> {
    let labels: Vec<String> = table.spec.channels.iter().map(Handle::label).collect();
    arrangement.names(&labels.iter().map(String::as_str).collect::<Vec<_>>())
}

/// A table whose values its format has no room for is no table of them.
fn refuse_clamped(recipe: &TableRecipe, format: TexelFormat, report: &PackReport) -> Result<()> {
    let refuse = |what: String, else_: &str| {
        Err(Error::usage(
            format!("{}: {what}, which {} has no room for", recipe.file, recipe.format),
            format!("use an f16 or f32 format, such as ktx2:rgba16f or exr:f32{else_}"),
        ))
    };
    if report.negative > 0 && !format.is_signed() {
        return refuse(format!("{} values below zero", report.negative), "");
    }
    // A half float that overflows is stored as the largest one, and said so.
    if report.overflowed > 0 && !format.is_signed() {
        let what = format!("{} values above {}", report.overflowed, format.largest(0));
        return refuse(what, ", or let the channel hold less, such as NAME:y/(1+y)");
    }
    Ok(())
}

/// What a reader will see of the table's values.
fn unpack(file: &Texture, recipe: &TableRecipe) -> Result<Vec<f32>> {
    let arrangement = recipe.arrangement()?;
    let n = arrangement.file_channels();
    let values: Vec<f32> =
        file.values(0).chunks_exact(file.format.channels()).flat_map(|t| t[..n].iter().copied()).collect();
    Ok(arrangement.gather(&values))
}

/// The bytes of the file.
fn encode(table: &Table, mut file: Texture, recipe: &TableRecipe, certificate: &Certificate) -> Result<Vec<u8>> {
    let metadata = vec![(certificate::KEY.to_owned(), certificate.to_json()?)];
    match (recipe.format.container(), file.format.number()) {
        (Container::Exr, Some(number)) => {
            // From the values themselves, so that they are rounded once.
            let arrangement = recipe.arrangement()?;
            let ([width, height, _], texels) = (arrangement.size, arrangement.scatter(&table.values));
            let channels = names(table, &arrangement);
            let image = Image { width, height, channels, texels, metadata, primaries: None };
            Ok(exr::encode(&image, number)?.0)
        }
        _ => {
            file.metadata = metadata;
            if recipe.format.container().is_source() {
                let name = Path::new(&recipe.file).file_stem().and_then(|n| n.to_str()).unwrap_or_default();
                file.metadata.push((source::NAME_KEY.to_owned(), name.to_owned()));
            }
            format::encode(recipe.format, &file)
        }
    }
}
