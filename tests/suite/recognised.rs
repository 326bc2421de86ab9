//! Kiln judged by itself: tables of every quantity, warp, flip, sampling, size and packing, without a word of what they are, pass as
//! somebody else's and are named.

#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

mod chains;
mod pairs;
mod sweep;

use crate::support::tools;
use kiln::format::encode;
use kiln::format::grid::{Described, Grid};
use kiln::format::{FormatSpec, Packing, Texture};
use kiln::identify::{Confidence, Identification, Options, identify, masters};
use kiln::integrate::{Integration, Settings};
use kiln::pack::{Number, TexelFormat};
use kiln::recipe::TableRecipe;
use kiln::verify;
use std::sync::OnceLock;

/// The masters of all tests, integrated once: tests that run side by side would each begin to.
fn masters() {
    static READY: OnceLock<()> = OnceLock::new();
    READY.get_or_init(|| {
        for n_axes in 1..=3 {
            masters::load(n_axes, false).unwrap();
        }
    });
}

/// Everything, if it is asked for; else a part of it: see `sweep`.
#[test]
fn tables_over_one_axis_pass_as_somebody_elses_and_are_named() {
    masters();
    match std::env::var("KILN_SWEEP") {
        Ok(asked) if asked == "chains" => chains::run(),
        Ok(asked) => sweep::run(&asked),
        Err(_) => sweep::check(&sweep::choices(1)),
    }
}

#[test]
fn tables_over_two_axes_pass_as_somebody_elses_and_are_named() {
    if std::env::var("KILN_SWEEP").is_err() {
        masters();
        sweep::check(&sweep::choices(2));
    }
}

#[test]
fn tables_over_three_axes_pass_as_somebody_elses_and_are_named() {
    if std::env::var("KILN_SWEEP").is_err() {
        masters();
        sweep::check(&sweep::choices(3));
    }
}

/// Channels of which one exceeds 1: the divisor of an RGBD and the factor of an RGBM then vary, and so does whose exponent is the common one.
const BRIGHT: [&str; 3] = ["charlie.albedo", "ggx.scale", "ggx.bias"];

/// A table baked in `format`; four bytes a texel do not say what they are the codes of.
fn baked(table: &str, axes: &str, channels: &[&str], format: &str) -> Vec<u8> {
    let mut recipe = TableRecipe::named(table, format.parse().unwrap()).unwrap();
    recipe.axes = axes.split(',').map(|axis| axis.parse().unwrap()).collect();
    if !channels.is_empty() {
        recipe.channels = channels.iter().map(|&c| c.to_owned()).collect();
    }
    let spec = recipe.spec().unwrap();
    let values = spec.bake(&Integration::new(Settings::default()).unwrap(), &|_| {}).unwrap().values;
    let Packing::Texel(own) = recipe.format.packing() else { panic!("a texel format") };
    let size = [spec.width(), spec.height(), spec.depth()];
    let texture = match size[2] {
        1 => Texture::flat(own, size[0], size[1], &values).unwrap().0,
        _ => Texture::volume(own, size, &values).unwrap().0,
    };
    if !matches!(own, TexelFormat::Rgbd | TexelFormat::Rgbm | TexelFormat::Rgbp) {
        return encode(recipe.format, &texture).unwrap();
    }
    let plain = TexelFormat::Plain { channels: 4, number: Number::Unorm8 };
    let format = FormatSpec::new(recipe.format.container(), plain).unwrap();
    encode(format, &Texture { format: plain, ..texture }).unwrap()
}

/// What is found out of a file.
fn found(bytes: &[u8]) -> Identification {
    masters();
    identify(&Grid::decode(bytes, &Described::default()).unwrap(), &Options { cache: false }).unwrap()
}

#[test]
fn channels_that_are_stored_together_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    for (table, axes, channels, format, sure) in [
        ("charlie-albedo", "mu:32,roughness:32", &BRIGHT[..], "dds:rgb9e5", Confidence::Likely),
        ("charlie-albedo", "mu:16,roughness:16", &BRIGHT, "ktx2:rgbp", Confidence::Likely),
        ("charlie-albedo", "mu:24,roughness:16", &BRIGHT, "png:rgbd", Confidence::Likely),
        ("charlie-albedo", "mu:16,roughness:24", &BRIGHT, "ktx2:rgbm", Confidence::Likely),
        // Blocks that a table's channels do not fit: which masking it is, they do not keep.
        ("ggx-f82", "mu:32,roughness:32", &["ggx.scale", "ggx.bias", "ggx.f82"], "ktx2:bc6h", Confidence::Possible),
    ] {
        let bytes = baked(table, axes, channels, format);
        let path = folder.path().join("table");
        std::fs::write(&path, &bytes).unwrap();
        let options = verify::Options { identify: Options { cache: false }, ..verify::Options::default() };
        masters();
        let report = verify::file(&path, options).unwrap_or_else(|e| panic!("{format}: {e}"));
        assert_eq!(report.failures(), 0, "{format}: {report:#?}");
        let found = found(&bytes);
        let quantities: Vec<&str> = found.channels.iter().filter_map(|c| c.quantity.as_deref()).collect();
        assert_eq!(quantities, channels, "{format}: {found:#?}");
        let code = format.split(':').next_back().unwrap().parse().unwrap();
        let is_code = matches!(code, TexelFormat::Rgbd | TexelFormat::Rgbm | TexelFormat::Rgbp);
        assert_eq!(found.packing, Some(code).filter(|_| is_code), "{format}: {found:#?}");
        assert!(found.channels.iter().all(|c| c.encoding.is_none()), "{format}: {found:#?}");
        let found_axes: Vec<&str> = found.axes.iter().map(|a| a.axis.as_str()).collect();
        assert_eq!(found_axes.join(","), axes, "{format}: {found:#?}");
        assert!(found.confidence >= sure, "{format}: {found:#?}");
    }
}

/// What a table does not tell is said not to be told.
#[test]
fn explanations_that_come_to_the_same_numbers_are_all_named() {
    let found = |table: &str, axes: &str| found(&baked(table, axes, &[], "ktx2:r16f"));
    // The reciprocal kd spreads what is left of the base over other directions, and the albedo is what it is.
    let layered = found("layered-albedo", "mu:8,roughness:8,f0:8");
    assert_eq!(layered.channels[0].model.as_deref(), Some("correlated Smith, albedo kd"), "{layered:#?}");
    assert_eq!(
        layered.channels[0].same,
        ["layered.albedo (correlated Smith, reciprocal kd) over mu:8 × roughness:8 × f0:8"],
        "{layered:#?}"
    );
    // Seen from between its axes, a lobe does not know which is which.
    let anisotropic = found("ggx-albedo-anisotropic", "mu:4,alpha_x:4,alpha_y:4");
    let swapped = "ggx.albedo (correlated Smith) over mu:4 × alpha_y:4 × alpha_x:4".to_owned();
    assert!(anisotropic.channels[0].same.contains(&swapped), "{anisotropic:#?}");
    // One number everywhere may be Lambert's albedo or anything.
    let constant = found("lambert-albedo", "mu:64");
    let holds: Vec<&str> = constant.channels.iter().map(|c| c.holds.as_str()).collect();
    assert_eq!((holds, constant.confidence), (vec!["constant 1.000000"], Confidence::Unknown), "{constant:#?}");
}

/// What two engines ship, in the packages that they publish.
#[test]
fn tables_in_engines_packages_are_recognised() {
    let read = |file: &str, array: Option<&str>| {
        let path = tools::folder_with(file)?.join(file);
        let described = Described { array: array.map(str::to_owned), ..Described::default() };
        masters();
        Some(identify(&Grid::read(&path, &described).unwrap(), &Options { cache: false }).unwrap())
    };
    let quantities = |found: &Identification| -> Vec<String> {
        found.channels.iter().map(|c| c.quantity.clone().unwrap_or_else(|| c.holds.clone())).collect()
    };
    if let Some(found) = read("node_modules/three/src/renderers/shaders/DFGLUTData.js", None) {
        assert_eq!(quantities(&found), ["ggx.scale", "ggx.bias"], "{found:#?}");
        assert_eq!(found.words, ["transposed"], "{found:#?}");
        assert!(found.confidence >= Confidence::Likely, "{found:#?}");
    }
    // A PNG of RGBD in base64, which says neither.
    let script = "node_modules/@babylonjs/core/Misc/brdfTextureTools.js";
    if let Some(found) = read(script, Some("_environmentBRDFBase64Texture")) {
        assert_eq!(quantities(&found), ["ggx.bias", "ggx.albedo", "charlie.albedo"], "{found:#?}");
        assert_eq!(found.packing, Some(TexelFormat::Rgbd), "{found:#?}");
    }
}
