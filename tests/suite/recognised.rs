//! Kiln judged by itself: tables of every quantity, warp, flip, sampling, size and packing, without a word of what they are, pass as
//! somebody else's and are named.

#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

mod chains;
mod pairs;
mod sweep;

use crate::support::tools;
use kiln::claim::{Claim, Said};
use kiln::format::grid::{Described, Grid, RawNumber};
use kiln::format::{Container, FormatSpec, Packing, Texture, encode};
use kiln::identify::{Confidence, Identification, Options, identify, masters};
use kiln::integrate::{Integration, Settings};
use kiln::model::charlie::Visibility;
use kiln::model::ggx::Smith;
use kiln::model::layered::Kd;
use kiln::pack::{Number, TexelFormat};
use kiln::recipe::TableRecipe;
use kiln::table::Model;
use kiln::verify;
use std::sync::OnceLock;

/// A table, its axes, the format of its file; its channels where they are others than the usual, the choices of its model; how its values turn
/// out to be encoded, which choices of the model turn out, and how sure that is at least.
struct Case {
    table: &'static str,
    axes: &'static str,
    format: &'static str,
    channels: &'static [&'static str],
    model: Model,
    encoding: &'static str,
    found: Option<Model>,
    sure: Confidence,
}

fn case(table: &'static str, axes: &'static str, format: &'static str) -> Case {
    Case {
        table,
        axes,
        format,
        channels: &[],
        model: Model::default(),
        encoding: "",
        found: None,
        sure: Confidence::Likely,
    }
}

/// The masters of all tests, integrated once: tests that run side by side would each begin to.
fn masters() {
    static READY: OnceLock<()> = OnceLock::new();
    READY.get_or_init(|| {
        for n_axes in 1..=3 {
            masters::load(n_axes, masters::Shelf::First, false).unwrap();
        }
    });
}

impl Case {
    fn recipe(&self) -> TableRecipe {
        let mut recipe = TableRecipe::named(self.table, self.format.parse().unwrap()).unwrap();
        recipe.axes = self.axes.split(',').map(|axis| axis.parse().unwrap()).collect();
        recipe.model = self.model;
        if !self.channels.is_empty() {
            recipe.channels = self.channels.iter().map(|&c| c.to_owned()).collect();
        }
        recipe
    }

    /// The file as somebody else would write it, and its name: numbers and nothing else.
    fn file(&self) -> (String, Vec<u8>) {
        let recipe = self.recipe();
        let spec = recipe.spec().unwrap();
        let values = spec.bake(&Integration::new(Settings::default()).unwrap(), &|_| {}).unwrap().values;
        let size = [spec.width(), spec.height(), spec.depth()];
        let own = recipe.texel_format().unwrap();
        // Channels that the format has beyond the table's are empty.
        let n = spec.channels.len();
        let wide: Vec<f64> = values
            .chunks_exact(n)
            .flat_map(|t| (0..own.channels()).map(|c| t.get(c).copied().unwrap_or(0.0)))
            .collect();
        let texture = match size[2] {
            1 => Texture::flat(own, size[0], size[1], &wide).unwrap().0,
            _ => Texture::volume(own, size, &wide).unwrap().0,
        };
        // Codes of four bytes say in the metadata what they are: somebody else's do not.
        let (texture, format) = match own {
            TexelFormat::Rgbd | TexelFormat::Rgbm | TexelFormat::Rgbp => {
                let plain = TexelFormat::Plain { channels: 4, number: Number::Unorm8 };
                let container = recipe.format.container();
                (Texture { format: plain, ..texture }, FormatSpec::new(container, plain).unwrap())
            }
            _ => (texture, recipe.format),
        };
        let mut bytes = encode(format, &texture).unwrap();
        if format.container().is_source() {
            let text = String::from_utf8(bytes).unwrap();
            let lines: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
            bytes = lines.join("\n").into_bytes();
        }
        (format!("{}.{}", self.table, format.extension()), bytes)
    }

    /// Judges the file, of which nothing is said.
    fn judged(&self) {
        masters();
        let folder = tempfile::tempdir().unwrap();
        let (name, bytes) = self.file();
        let path = folder.path().join(name);
        std::fs::write(&path, &bytes).unwrap();
        let what = format!("{} over {} as {}", self.table, self.axes, self.format);
        let options = verify::Options { identify: Options { cache: false }, ..verify::Options::default() };
        let report = verify::file(&path, options).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!(report.failures(), 0, "{what}: {report:#?}");
        let recipe = self.recipe();
        let said = Said {
            channels: recipe.channels.clone(),
            axes: recipe.axes.clone(),
            at: recipe.at,
            model: self.found.unwrap_or(recipe.model),
            table: None,
        };
        let read_as_it_is =
            Grid::decode(&bytes, &Described { packing: self.packing(), ..Described::default() }).unwrap();
        let wanted = Claim::new(&read_as_it_is, &said).unwrap();
        let names: Vec<String> = recipe.channels.iter().map(|c| format!("{c}{}", self.encoding)).collect();
        let wanted = wanted.to_string().replace(&recipe.channels.join(", "), &names.join(", "));
        assert!(report.claim.ends_with(&format!("judged as {wanted}")), "{what}: wanted {wanted}: {report:#?}");
        let words = [Confidence::Possible, Confidence::Likely, Confidence::Certain].map(|sure| (sure, sure.words()));
        let sure =
            words.iter().any(|(sure, word)| *sure >= self.sure && report.claim.contains(&format!("it is {word}: ")));
        assert!(sure, "{what}: {report:#?}");
    }

    /// What four bytes a texel are the codes of, where their divisor or multiplier varies; where it does not, they are just a curve.
    fn packing(&self) -> Option<TexelFormat> {
        let own = self.recipe().texel_format().unwrap();
        let is_coded = matches!(own, TexelFormat::Rgbd | TexelFormat::Rgbm | TexelFormat::Rgbp);
        Some(own).filter(|_| is_coded && self.encoding.is_empty())
    }
}

/// Cases over one and two axes.
fn cases() -> Vec<Case> {
    let smith = |smith| Model { smith, ..Model::default() };
    let fitted = Model { visibility: Visibility::Charlie, ..Model::default() };
    vec![
        // Sizes from 8 to 256, warps, flips, edges; every table, model, packing and kind of file once.
        case("dfg", "mu:256,roughness:8:flip", "ktx2:rg16unorm"),
        Case { model: smith(Smith::ApproxCorrelated), ..case("dfg", "mu:8,roughness:8", "ktx2:rg16f") },
        Case { model: smith(Smith::SchlickIbl), ..case("dfg", "mu:16:sqrt:edge,roughness:12:edge:flip", "exr:f32") },
        Case { model: smith(Smith::SchlickDirect), ..case("dfg", "mu:20,roughness:9", "js:f32") },
        Case { model: smith(Smith::Separable), ..case("dfg", "roughness:24:flip,mu:24:flip", "dds:rg16f") },
        case("ggx-albedo", "mu:64:cbrt,roughness:9:sqrt", "hlsl:f16"),
        case("ggx-f82", "mu:16:acos,roughness:16:log+0.05:flip", "exr:f16"),
        case("beckmann-dfg", "mu:16:log+0.01:edge,alpha:16", "ktx2:rgba16f"),
        case("beckmann-albedo", "mu:20,roughness:16:sqrt", "ktx2:r8unorm"),
        Case { model: fitted, ..case("charlie-albedo", "mu:16:square:flip,roughness:16:edge", "png:r16unorm") },
        case("burley-albedo", "mu:16:sqrt-one-minus,roughness:16", "ktx1:rg16f"),
        case("oren-nayar-albedo", "mu:16:sqrt,sigma:16", "c:f32"),
        case("fujii-albedo", "roughness:12:flip,mu:12", "rust:f32"),
        case("conductor-albedo", "mu:16,roughness:16", "hdr"),
        case("fresnel-schlick", "mu:32:acos:flip,f0:9:edge", "dds:b10g11r11"),
        case("fresnel-dielectric", "mu:16:acos:flip,eta:16:1..3:edge", "ktx2:rgb9e5"),
        case("fresnel-conductor-avg", "n:16:0.1..4,k:16:0..8", "glsl:f32"),
        case("dielectric-avg", "roughness:6,eta:5:f0-fourth-root", "wgsl:f32"),
        // A common exponent that another channel sets.
        Case { channels: &BRIGHT, ..case("charlie-albedo", "mu:16,roughness:24", "dds:rgb9e5") },
        // Blocks that a table's channels do not fit: which masking it is, they do not keep.
        Case { sure: Confidence::Possible, ..case("ggx-f82", "mu:32,roughness:24", "ktx2:bc6h") },
        // Four bytes, whose fourth does not vary; where it does, see below.
        Case { encoding: " (stored as its square root)", ..case("ggx-albedo-avg", "roughness:8:sqrt", "ktx2:rgbp") },
        Case {
            model: smith(Smith::Separable),
            encoding: " (stored to the power 1/2.2)",
            ..case("ggx-albedo-avg", "roughness:64:log+0.05", "ktx2:rgbd")
        },
        // One axis.
        case("ggx-albedo-avg", "roughness:12:edge:flip", "ktx2:r16f"),
        case("charlie-albedo-avg", "roughness:16", "ktx2:r32f"),
        case("beckmann-albedo-avg", "alpha:32", "ktx2:r16unorm"),
        case("fresnel-schlick-avg", "f0:256", "npy:f32"),
        case("fresnel-dielectric-avg", "eta:64:1..3", "ktx2:r16f"),
    ]
}

/// Whether a table is among those that are recognised here.
pub fn is_covered(table: &str) -> bool {
    cases().iter().any(|case| case.table == table)
}

#[test]
fn tables_over_one_and_two_axes_pass_as_somebody_elses_and_are_named() {
    cases().iter().for_each(Case::judged);
}

/// Channels of which one exceeds 1.
const BRIGHT: [&str; 3] = ["charlie.albedo", "ggx.scale", "ggx.bias"];

#[test]
fn volumes_pass_as_somebody_elses_and_are_named() {
    let layered = || case("layered-albedo", "mu:8,roughness:8,f0:8", "ktx2:r16f");
    let kd = |kd| Model { kd, ..Model::default() };
    for case in [
        case("dielectric", "mu:6,roughness:5,eta:7:f0-fourth-root", "ktx2:rg16f"),
        case("dielectric-inside", "mu:6,roughness:5:edge,eta:7:0..1:f0-fourth-root", "ktx2:rg32f"),
        case("dielectric-albedo", "mu:6:flip,roughness:5,eta:7:f0-fourth-root", "npy:f32"),
        case("eon-albedo", "mu:8,roughness:8:flip,rho:8", "ktx2:r16f"),
        case("fresnel-f82", "mu:12:sqrt,f0:6:edge,f82:6", "ktx2:r16f"),
        case("fresnel-conductor", "mu:12,n:8:0.1..4,k:8:0..8", "ktx2:r32f"),
        case("compensation", "mu:5,roughness:4,f0:6", "npy:f32"),
        layered(),
        Case { model: kd(Kd::Fresnel), ..layered() },
        // Another reflectance, the same albedo.
        Case { model: kd(Kd::Reciprocal), found: Some(kd(Kd::Albedo)), ..layered() },
        case("ggx-albedo-anisotropic", "mu:4,alpha_x:4,alpha_y:4", "ktx2:r16f"),
    ] {
        case.judged();
    }
}

/// Tables that the matrix of every pair of choices once found not to be named: few texels, and peaks in a corner.
#[test]
fn tables_with_peaks_are_named() {
    use sweep::Written::{Bare, Coded, FlatJson, Numbers};
    masters();
    let plain = Model::default();
    let charlie = Model { visibility: Visibility::Charlie, ..plain };
    let weight = "generalized-schlick-dielectric";
    for case in [
        // Masters are far off where the sheen peaks, in more texels than may be missed.
        sweep::Case::of("charlie-albedo", plain, "mu:8:cbrt,roughness:8:cbrt", Numbers(Container::Js, Number::F32)),
        // Another packing is smoother, and a sheen comes near to what that reads.
        sweep::Case::of("charlie-albedo", charlie, "mu:8:cbrt,roughness:8:cbrt", Coded("ktx2:rgbd")),
        // A plain third channel, to which much else can be fitted exactly.
        sweep::Case::of("cloth-split", plain, "mu:8:acos,roughness:8:square", FlatJson(7)),
        // The large values of the second channel leave nearly all of what rounding does.
        sweep::Case::of("cloth-split", plain, "mu:32:cbrt,roughness:32:cbrt", Bare(RawNumber::F16, false)),
        // Nothing is left of the search where whatever is tried is off by most in a few texels.
        sweep::Case::of(
            weight,
            plain,
            "eta:33:f0-fourth-root:edge,mu:8:square:edge:flip,roughness:8:edge:flip",
            Numbers(Container::Dds, Number::F16),
        ),
    ] {
        match case.judged() {
            Ok(sweep::Verdict::Named(sure)) => assert!(sure >= Confidence::Likely, "{}: {sure:?}", case.name()),
            other => panic!("{}: {other:?}", case.name()),
        }
    }
}

/// The matrix of every pair of choices, if it is asked for: see `sweep` and `chains`. The tests beside it take each choice once.
#[test]
fn every_pair_of_choices_is_recognised_where_that_is_asked_for() {
    match std::env::var("KILN_SWEEP") {
        Ok(asked) if asked == "chains" => chains::run(),
        Ok(asked) => {
            masters();
            sweep::run(&asked);
        }
        Err(_) => eprintln!("skipped: KILN_SWEEP does not say which part of the matrix"),
    }
}

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
    let (table, channels) = ("charlie-albedo", &BRIGHT);
    // (A table of RGBD is among those of engines.)
    let (axes, format) = ("mu:16,roughness:24", "ktx2:rgbm");
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
    assert_eq!(found.packing, Some(TexelFormat::Rgbm), "{format}: {found:#?}");
    assert!(found.channels.iter().all(|c| c.encoding.is_none()), "{format}: {found:#?}");
    let found_axes: Vec<&str> = found.axes.iter().map(|a| a.axis.as_str()).collect();
    assert_eq!(found_axes.join(","), axes, "{format}: {found:#?}");
    assert!(found.confidence >= Confidence::Likely, "{format}: {found:#?}");
}

#[test]
fn channels_over_other_axes_than_their_neighbours_are_baked_by_one_command() {
    let (axes, format) = ("roughness:12:edge:+cos_centre,mu:10:sqrt-one-minus:edge:+sin2_radius", "ktx2:rgba32f");
    let found = found(&baked("ltc-amplitude", axes, &[], format));
    let quantities: Vec<&str> = found.channels.iter().filter_map(|c| c.quantity.as_deref()).collect();
    assert_eq!(quantities, ["ggx.albedo", "ggx.bias", "sphere.clipped"], "{found:#?}");
    assert_eq!(found.commands, [format!("kiln table ltc-amplitude --axes {axes} -o ltc-amplitude.exr")]);
    assert!(found.confidence >= Confidence::Likely, "{found:#?}");
}

/// What a table does not tell is said not to be told.
#[test]
fn explanations_that_come_to_the_same_numbers_are_all_named() {
    masters();
    let found = |case: Case| {
        let grid = Grid::decode(&case.file().1, &Described::default()).unwrap();
        identify(&grid, &Options { cache: false }).unwrap()
    };
    // The reciprocal kd spreads what is left of the base over other directions, and the albedo is what it is.
    let layered = found(case("layered-albedo", "mu:8,roughness:8,f0:8", "ktx2:r16f"));
    assert_eq!(layered.channels[0].model.as_deref(), Some("correlated Smith, albedo kd"), "{layered:#?}");
    assert_eq!(
        layered.channels[0].same,
        ["layered.albedo (correlated Smith, reciprocal kd) over mu:8 × roughness:8 × f0:8"],
        "{layered:#?}"
    );
    // Seen from between its axes, a lobe does not know which is which.
    let anisotropic = found(case("ggx-albedo-anisotropic", "mu:4,alpha_x:4,alpha_y:4", "ktx2:r16f"));
    let swapped = "ggx.albedo (correlated Smith) over mu:4 × alpha_y:4 × alpha_x:4".to_owned();
    assert!(anisotropic.channels[0].same.contains(&swapped), "{anisotropic:#?}");
    // One number everywhere may be Lambert's albedo or anything.
    let constant = found(case("lambert-albedo", "mu:64", "ktx2:r16f"));
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
