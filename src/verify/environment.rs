//! Verification of an environment's files.

use super::{Content, Options, Report, digest_check};
use crate::bake::{self, EngineSh, IRRADIANCE, SUN_SCHEMA, ShFile, Source, SunFile, precision, texel_digest};
use crate::certificate::{self, Certificate, Level};
use crate::check::{Check, CubeLevel, EnvironmentValues};
use crate::environment::{KernelKind, Panorama, SphereLayout, atlas, sh_bands, spherical_harmonics};
use crate::error::{Error, Result};
use crate::format::{Image, Texture};
use crate::pack::{Number, TexelFormat};
use crate::recipe::{EnvironmentRecipe, map_texel};
use glam::DVec3;
use std::path::Path;

pub(super) fn verify(
    path: &Path,
    content: &Content,
    certificate: &Certificate,
    recipe: &EnvironmentRecipe,
    options: Options,
) -> Result<Report> {
    recipe.check().map_err(|e| e.in_file(path))?;
    let (again, skipped) = source_again(certificate, recipe);
    let panorama = again.as_ref().map(|source| source.panorama.clone());
    let mut report =
        Report { file: path.to_owned(), claim: String::new(), checks: vec![], skipped, ..Report::default() };
    let picture = match content {
        Content::Picture(image) if !recipe.layout.is_cube() => Some(texture_of(image).map_err(|e| e.in_file(path))?),
        _ => None,
    };
    let texture = match content {
        Content::Texture(texture) => Some(texture),
        _ => picture.as_ref(),
    };
    match (content, texture) {
        (_, Some(texture)) => {
            let levels = levels(path, texture, certificate, recipe).map_err(|e| e.in_file(path))?;
            let digest = texel_digest(levels.iter().map(|l| l.texels.as_flattened()));
            report.checks.extend(digest_check(path, certificate, &digest));
            let is_irradiance = levels[0].name == IRRADIANCE;
            let own = if is_irradiance { recipe.format_of_irradiance() } else { recipe.format };
            let format = map_texel(own, recipe.layout)?;
            let precision = precision(format, &levels, certificate.packing.max_block_error);
            let (layout, orientation) = (recipe.layout, recipe.orientation);
            let judged = EnvironmentValues { levels: &levels, layout, precision, orientation };
            report
                .checks
                .extend(judged.facts(certificate.input.as_ref().is_none_or(|i| i.negative + i.out_of_gamut > 0)));
            if let Some(panorama) = &panorama {
                // Other texels than those that the bake looked at.
                let seed = recipe.integration.seed.wrapping_add(0x5EED);
                report.checks.extend(judged.against(panorama, seed, options.full));
            }
            let names: Vec<String> =
                levels.iter().map(|l| format!("{} at roughness {}", layout.size_text(l.size), l.roughness)).collect();
            let kind = match recipe.kernel {
                _ if is_irradiance => "irradiance E/π".to_owned(),
                KernelKind::Nol => "specular chain".to_owned(),
                other => match recipe.view {
                    Some(view) => {
                        format!("specular chain seen at {}°, anisotropy {},", view.angle, view.anisotropy)
                    }
                    None => format!("specular chain ({})", other.name()),
                },
            };
            let kind = if layout.is_cube() { kind } else { format!("{kind} as {}", layout.article()) };
            report.claim = format!("{kind} of {}: {}", recipe.input, names.join(", "));
        }
        (Content::Json(value), _) if value["schema"] == SUN_SCHEMA => {
            report.claim = format!("sun of {}", recipe.input);
            let file: SunFile = serde_json::from_value(value.clone())
                .map_err(|e| Error::invalid(format!("not a sun: {e}"), "bake it again").in_file(path))?;
            let claimed = certificate.input.as_ref().and_then(|input| input.adjusted.sun);
            let differs = f64::from(u8::from(claimed != Some(file.sun)));
            report.checks.push(Check::at_most(
                "a sun other than the certified one",
                "sun.json",
                differs,
                0.0,
                "all of it",
            ));
            if let Some(found) = again.and_then(|source| source.adjusted.sun) {
                let off = DVec3::from(found.direction).angle_between(DVec3::from(file.sun.direction));
                report.checks.push(Check::at_most(
                    "direction extracted again, radians",
                    "sun.json",
                    off,
                    1e-9,
                    "angle",
                ));
                let light = (0..3).map(|c| (found.irradiance[c] - file.sun.irradiance[c]).abs()).fold(0.0, f64::max);
                let limit = 1e-12 * found.irradiance.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                report.checks.push(Check::at_most(
                    "irradiance extracted again",
                    "sun.json",
                    light,
                    limit,
                    "worst of 3",
                ));
            }
        }
        (Content::Json(value), _) => {
            report.claim = format!("spherical harmonics of {}", recipe.input);
            let sh: ShFile = serde_json::from_value(value.clone())
                .map_err(|e| Error::invalid(format!("not spherical harmonics: {e}"), "bake it again").in_file(path))?;
            let bytes = std::fs::read(path).map_err(|e| Error::reading(path, e))?;
            report.checks.extend(digest_check(path, certificate, &certificate::digest([bytes.as_slice()])));
            report.checks.extend(panorama.as_ref().map(|p| harmonics(&sh, recipe, p)));
        }
        _ => {
            return Err(Error::invalid(
                "no texture, where the certificate says an environment",
                "give the environment's own file",
            )
            .in_file(path));
        }
    }
    Ok(report)
}

/// What was filtered, if it can still be had; else what cannot be checked.
fn source_again(certificate: &Certificate, recipe: &EnvironmentRecipe) -> (Option<Source>, Vec<String>) {
    let skip = |why: String| (None, vec![format!("comparison with the input: {why}")]);
    match bake::source(recipe) {
        Err(error) => skip(error.to_string()),
        Ok(source) => {
            let digest = texel_digest([source.panorama.texels().as_flattened()]);
            match &certificate.input {
                Some(input) if input.digest == digest => (Some(source), vec![]),
                _ => skip(format!("{} is not what it was when the environment was baked", recipe.input)),
            }
        }
    }
}

/// A picture's colours as a texture of one level.
fn texture_of(image: &Image) -> Result<Texture> {
    let rgb = image.rgb()?;
    let format = TexelFormat::Plain { channels: 3, number: Number::F32 };
    let (texture, _) = Texture::flat(format, image.width, image.height, rgb.as_flattened())?;
    Ok(Texture { metadata: image.metadata.clone(), ..texture })
}

/// The cubes of a texture, with what the certificate claims of each.
fn levels(
    path: &Path,
    texture: &Texture,
    certificate: &Certificate,
    recipe: &EnvironmentRecipe,
) -> Result<Vec<CubeLevel>> {
    if recipe.layout == SphereLayout::Atlas {
        return tiles(texture, certificate, recipe);
    }
    let (irradiance, specular): (Vec<_>, Vec<_>) = certificate.levels.iter().partition(|l| l.name == IRRADIANCE);
    let roughness = recipe.level_roughness();
    // Which of the two cubes this is, the file says, or its name where it has no place to say it.
    let by_name = || path.file_name().and_then(|n| n.to_str()) == recipe.irradiance_name().as_deref();
    let is_irradiance =
        texture.metadata(certificate::CONTENT_KEY).map_or_else(by_name, |content| content == IRRADIANCE);
    let claimed = if is_irradiance { irradiance } else { specular };
    let shape = |n: usize| format!("{n} levels of {} faces from {} × {}", texture.faces, texture.width, texture.height);
    let layout = recipe.layout;
    let found = ([texture.width, texture.height], texture.faces);
    if texture.levels.len() != claimed.len() || claimed.first().is_none_or(|l| found != layout.shape(l.size)) {
        return Err(Error::invalid(
            format!(
                "{}, where the certificate says a {} chain from {} or {}",
                shape(texture.levels.len()),
                layout.noun(),
                recipe.size,
                recipe.irradiance_size
            ),
            "bake the environment again",
        ));
    }
    claimed
        .iter()
        .enumerate()
        .map(|(m, level)| {
            let [_, size] = texture.level_size(m);
            let mut texels = vec![];
            for face in 0..texture.faces {
                let values = texture.face(m, face).unwrap_or_default();
                texels.extend(values.chunks_exact(texture.format.channels()).map(|t| [t[0], t[1], t[2]]));
            }
            let wanted = if level.name == IRRADIANCE { 1.0 } else { roughness.get(m).copied().unwrap_or(f64::NAN) };
            if texels.len() != layout.texels(size) || level.roughness != wanted {
                return Err(Error::invalid(format!("level {m} is not what the certificate says"), "bake it again"));
            }
            Ok(claimed_level(level, texels, size, recipe))
        })
        .collect()
}

/// The tiles of an atlas, likewise.
fn tiles(texture: &Texture, certificate: &Certificate, recipe: &EnvironmentRecipe) -> Result<Vec<CubeLevel>> {
    let tiles = atlas::tiles();
    if certificate.levels.len() != tiles.len() {
        return Err(Error::invalid(
            format!("{} levels in the certificate, where an atlas has {}", certificate.levels.len(), tiles.len()),
            "bake the environment again",
        ));
    }
    let picture = atlas::colours(texture)?;
    let roughness = recipe.level_roughness();
    let level = |(tile, level): (&atlas::Tile, &Level)| {
        let wanted = match tile.content {
            atlas::Content::Specular(m) => roughness.get(m).copied().unwrap_or(f64::NAN),
            atlas::Content::Mirror(_) => 0.0,
            atlas::Content::Irradiance => 1.0,
        };
        if level.name != tile.name() || level.size != tile.size || level.roughness != wanted {
            return Err(Error::invalid(format!("{} is not what the certificate says", tile.name()), "bake it again"));
        }
        Ok(claimed_level(level, atlas::cut(&picture, tile)?, tile.size, recipe))
    };
    tiles.iter().zip(&certificate.levels).map(level).collect()
}

fn claimed_level(level: &Level, texels: Vec<[f32; 3]>, size: usize, recipe: &EnvironmentRecipe) -> CubeLevel {
    // A claim of huge errors would excuse anything: what a standard error may be is bounded by usefulness.
    let max_error = level.max_error.min(MOST_ERROR);
    let rms_error = level.rms_error.min(max_error);
    let fitted = level.lookup.clone().filter(|_| level.is_fitted());
    let kernel = if level.name == IRRADIANCE { KernelKind::Nol } else { recipe.kernel };
    let view = recipe.view.filter(|_| level.name != IRRADIANCE);
    let (name, roughness) = (level.name.clone(), level.roughness);
    CubeLevel { name, size, roughness, kernel, view, texels, fitted, max_error, rms_error }
}

/// The largest relative standard error of a texel that verification believes.
const MOST_ERROR: f64 = 0.5;

/// The coefficients, integrated again.
fn harmonics(sh: &ShFile, recipe: &EnvironmentRecipe, panorama: &Panorama) -> Check {
    let wanted = spherical_harmonics::project(panorama);
    let figure = off(&sh.harmonics.radiance, &wanted.radiance)
        .max(off(&sh.harmonics.irradiance_over_pi, &wanted.irradiance_over_pi))
        .max(off(&sh.harmonics.irradiance_over_pi_nonnegative, &wanted.irradiance_over_pi_nonnegative));
    let (mut figure, mut count) = (figure, 81);
    if let Some(found) = &sh.bands {
        let again = sh_bands::Bands::new(panorama, found.bands.clamp(1, sh_bands::MOST_BANDS), |_| found.fit);
        let same = again.order == found.order && found.radiance.len() == again.radiance.len();
        for (a, b) in [(&found.radiance, &again.radiance), (&found.irradiance_over_pi, &again.irradiance_over_pi)] {
            let off = if same && a.len() == b.len() { off(a, b) } else { f64::INFINITY };
            figure = figure.max(off);
        }
        count += 6 * again.radiance.len();
    }
    figure = match (&sh.engine, EngineSh::new(recipe, &wanted)) {
        (Some(found), Some(again)) if found.convention == again.convention => {
            count += 27;
            figure.max(off(&found.coefficients, &again.coefficients))
        }
        (None, None) => figure,
        _ => f64::INFINITY,
    };
    let detail = format!("worst of {count}");
    Check::at_most("coefficients integrated again, relative to the largest", "sh.json", figure, 1e-12, detail)
}

/// The largest difference between coefficients, in parts of the largest of the second.
fn off(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let largest = b.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
    let off = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs());
    // NaN must not hide behind max.
    off.map(|d| if d.is_nan() { f64::INFINITY } else { d }).fold(0.0, f64::max) / largest.max(f64::MIN_POSITIVE)
}
