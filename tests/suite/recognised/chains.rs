//! The same of environment chains: kernel × list of roughness × layout × orientation × kind of file, every pair of choices.
//!
//! `KILN_SWEEP=chains cargo test --test suite recognised:: -- --nocapture` runs it, which takes minutes; the suite has chains of its own.

use super::pairs::covering;
use kiln::bake;
use kiln::environment::{KernelKind, Panorama, SphereLayout, SphereMap};
use kiln::format::{Decoded, decode, encode};
use kiln::recipe::{EnvironmentRecipe, Recipe};
use kiln::verify::chain::{Question, judge_maps, levels_of};

const KERNELS: [KernelKind; 3] = [KernelKind::Nol, KernelKind::G1, KernelKind::Charlie];
const ROUGHNESS: [&[f64]; 3] = [&[0.0, 0.5, 1.0], &[0.0, 0.25, 0.7], &[0.0, 0.15, 0.35, 0.6]];
const LAYOUTS: [SphereLayout; 4] =
    [SphereLayout::Cube, SphereLayout::Octahedral, SphereLayout::Equirect, SphereLayout::Atlas];
const ORIENTATIONS: [&str; 6] = ["x,y,z", "-x,y,z", "z,y,-x", "-z,y,-x", "x,z,-y", "y,z,x"];
const FORMATS: [&str; 12] = [
    "ktx2:rgba32f",
    "ktx2:rgba16f",
    "ktx2:rgba16f+zstd",
    "ktx1:rgba16f",
    "dds:rgba16f",
    "exr:f16",
    "exr:f32",
    "ktx2:rgb9e5",
    "ktx2:b10g11r11",
    "ktx2:rgbm",
    "ktx2:rgbp",
    "ktx2:bc6h",
];

/// What an atlas is written as.
const ATLAS: &str = "ktx2:rgbp";

fn recipe(row: &[usize]) -> Option<EnvironmentRecipe> {
    let built_in = Recipe::built_in().unwrap().environments.swap_remove(0);
    let layout = LAYOUTS[row[2]];
    let is_atlas = layout == SphereLayout::Atlas;
    let recipe = EnvironmentRecipe {
        layout,
        size: if is_atlas { 128 } else { 32 },
        min_size: 8,
        irradiance_size: if is_atlas { 32 } else { 8 },
        roughness: (!is_atlas).then(|| ROUGHNESS[row[1]].to_vec()),
        kernel: KERNELS[row[0]],
        orientation: ORIENTATIONS[row[3]].parse().unwrap(),
        format: FORMATS[row[4]].parse().unwrap(),
        ..built_in
    };
    recipe.check().ok().map(|()| recipe)
}

/// The levels of what the recipe bakes, without its certificate; nothing where its format has no room for the light.
fn levels(recipe: &EnvironmentRecipe, source: &bake::Source) -> Option<Vec<SphereMap>> {
    let baked = bake::environment(recipe, source, &|_| {}).unwrap_or_else(|e| panic!("{}: {e}", name(recipe)));
    if baked.certificate.packing.overflowed > 0 {
        return None;
    }
    let wanted = recipe.specular_name();
    let (_, bytes) = baked.files.iter().find(|(path, _)| path.ends_with(&wanted)).unwrap();
    let content = match decode(bytes).unwrap() {
        Decoded::Texture(mut texture) => {
            texture.metadata.retain(|(key, _)| !key.starts_with("kiln."));
            decode(&encode(recipe.format, &texture).unwrap()).unwrap()
        }
        other => other,
    };
    Some(levels_of(&content).unwrap_or_else(|e| panic!("{}: {e}", name(recipe))))
}

fn name(recipe: &EnvironmentRecipe) -> String {
    let EnvironmentRecipe { layout, kernel, orientation, format, .. } = recipe;
    format!("{layout}, {}, roughness {:?}, {orientation}, {format}", kernel.name(), recipe.level_roughness())
}

/// What packing made of the largest relative difference, counted as the judge counts it.
fn rounding(packed: &[SphereMap], exact: &[SphereMap], source: &Panorama) -> f64 {
    let mean = source.mean();
    let off = |(p, e): (&[f32; 3], &[f32; 3])| {
        let of = |c: usize| {
            let (p, e) = (f64::from(p[c]), f64::from(e[c]));
            (p - e).abs() / e.abs().max(1e-3 * mean[c].abs())
        };
        (0..3).map(of).fold(0.0, f64::max)
    };
    let of_level = |(p, e): (&SphereMap, &SphereMap)| p.texels.iter().zip(&e.texels).map(off).fold(0.0, f64::max);
    packed.iter().zip(exact).map(of_level).fold(0.0, f64::max)
}

/// What is wrong with what the judge says; nothing of what cannot be baked.
fn judged(recipe: &EnvironmentRecipe, source: &bake::Source) -> Option<Vec<String>> {
    let mut wrong = vec![];
    let packed = levels(recipe, source)?;
    let exact_format = if recipe.layout == SphereLayout::Atlas { ATLAS } else { "ktx2:rgba32f" };
    let exact = levels(&EnvironmentRecipe { format: exact_format.parse().unwrap(), ..recipe.clone() }, source)?;
    let rounding = rounding(&packed, &exact, &source.panorama);
    let verdict = judge_maps(&packed, &Question { source: Some(&source.panorama), ..Question::default() }).unwrap();
    let turn = verdict.orientation.as_ref().and_then(|found| found.turn).map(|turn| turn.orientation());
    if turn != Some(recipe.orientation) {
        wrong.push(format!("orientation {:?}", verdict.orientation));
    }
    if verdict.kernel != Some(recipe.kernel) {
        wrong.push(format!("kernel {:?}, margin {:?}", verdict.kernel, verdict.kernel_margin));
    }
    if verdict.scale.is_none_or(|scale| (scale - 1.0).abs() > 1e-3 + rounding) {
        wrong.push(format!("scale {:?}", verdict.scale));
    }
    for (m, (level, wanted)) in verdict.levels.iter().zip(recipe.level_roughness()).enumerate() {
        if level.roughness.is_none_or(|found| (found - wanted).abs() > 5e-3 + rounding) {
            wrong.push(format!(
                "level {m}: roughness {:?} in {:?}, not {wanted}",
                level.roughness, level.roughness_range
            ));
        }
        let seams = level.error.as_ref().is_some_and(|e| e.has_seams());
        if seams || level.error.as_ref().is_some_and(|e| e.fireflies > 0) {
            wrong.push(format!("level {m}: {:?}", level.error));
        }
    }
    // Against what it is: the judge's filter and the bake's are each known to 1e-5, and floats round.
    let limit = if recipe.layout == SphereLayout::Atlas { 0.1 } else { rounding * (1.0 + 3e-5) + 3e-5 };
    let claimed = Question {
        source: Some(&source.panorama),
        kernel: Some(recipe.kernel),
        roughness: Some(recipe.level_roughness()),
        max_error: Some(limit),
    };
    let failed = judge_maps(&packed, &claimed).unwrap().checks.into_iter().filter(|check| !check.passed);
    wrong.extend(failed.map(|c| format!("{} of {}: {:.2e}, at most {:.2e}", c.name, c.subject, c.figure, c.limit)));
    Some(wrong)
}

/// Judges every pair of choices.
pub fn run() {
    let begin = std::time::Instant::now();
    let admits = |f: usize, v: usize, g: usize, w: usize| {
        let mut row = [0; 5];
        (row[f], row[g]) = (v, w);
        // An atlas has one kernel, one list of roughness and one packing.
        if row[2] == 3 && (f, g) != (2, 4) {
            row[4] = FORMATS.iter().position(|format| *format == ATLAS).unwrap_or(0);
        }
        recipe(&row).is_some() && !(f == 1 && g == 2 && w == 3 && v > 0)
    };
    let sizes = [KERNELS.len(), ROUGHNESS.len(), LAYOUTS.len(), ORIENTATIONS.len(), FORMATS.len()];
    let rows = covering(&sizes, &admits, &|_, _, _, _| true);
    let recipes: Vec<EnvironmentRecipe> = rows.iter().filter_map(|row| recipe(row)).collect();
    let source = bake::source(&recipes[0]).unwrap();
    let (mut failed, mut no_room) = (0, 0);
    for (i, recipe) in recipes.iter().enumerate() {
        match judged(recipe, &source) {
            None => {
                no_room += 1;
                eprintln!("{i}: no room for its light: {}", name(recipe));
            }
            Some(wrong) if wrong.is_empty() => {}
            Some(wrong) => {
                failed += 1;
                eprintln!("{i}: WRONG: {}: {}", name(recipe), wrong.join("; "));
            }
        }
    }
    let seconds = begin.elapsed().as_secs_f64();
    eprintln!("{} chains in {seconds:.0} s; {no_room} without room for their light; {failed} wrong", recipes.len());
    assert_eq!(failed, 0, "so many of {} chains are not recognised", recipes.len());
}
