//! Judging and recognising tables that Kiln did not make: made here by other code than Kiln's, as engines make them.

#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

use crate::recognised;
use crate::support::samples::Random;
use kiln::bake;
use kiln::format::grid::{Described, Grid};
use kiln::format::{Decoded, FormatSpec, decode, exr, ktx2};
use kiln::identify::{Confidence, Identification, Options, identify};
use kiln::integrate::{Integration, Settings};
use kiln::recipe::{Recipe, TableRecipe};
use kiln::table::named::TABLES;
use kiln::verify;
use std::path::Path;
use std::process::Command;

/// Which masking term an engine's baker has.
#[derive(Clone, Copy, PartialEq)]
enum Masking {
    Correlated,
    Separable,
    /// Karis 2013: k = alpha/2.
    SchlickK,
}

/// Hammersley's points, of which engines take the same for every texel.
fn hammersley(samples: u32) -> impl Iterator<Item = (f64, f64)> {
    (0..samples)
        .map(move |i| ((f64::from(i) + 0.5) / f64::from(samples), f64::from(i.reverse_bits()) / 4_294_967_296.0))
}

/// Scale and bias by points drawn from D, as engines' compute shaders do it: Karis' listing, in f64.
fn sampled(mu: f64, roughness: f64, masking: Masking, points: impl Iterator<Item = (f64, f64)>) -> [f64; 2] {
    let a = roughness * roughness;
    let v = [(1.0 - mu * mu).sqrt(), mu];
    let (mut scale, mut bias, mut samples) = (0.0, 0.0, 0.0);
    for (x, y) in points {
        samples += 1.0;
        let (sin_phi, cos_phi) = (std::f64::consts::TAU * x).sin_cos();
        let cos_h = ((1.0 - y) / (1.0 + (a * a - 1.0) * y)).sqrt();
        let sin_h = (1.0 - cos_h * cos_h).sqrt();
        let h = [sin_h * cos_phi, sin_h * sin_phi, cos_h];
        let v_h = v[0] * h[0] + v[1] * h[2];
        let n_l = 2.0 * v_h * h[2] - v[1];
        if n_l <= 0.0 || v_h <= 0.0 {
            continue;
        }
        let g1 = |c: f64| 2.0 * c / (c + (a * a + (1.0 - a * a) * c * c).sqrt());
        let k = a / 2.0;
        let schlick = |c: f64| c / (c * (1.0 - k) + k);
        let g2 = match masking {
            Masking::Separable => g1(mu) * g1(n_l),
            Masking::SchlickK => schlick(mu) * schlick(n_l),
            Masking::Correlated => {
                let l = |c: f64, d: f64| d * (a * a + (1.0 - a * a) * c * c).sqrt();
                2.0 * mu * n_l / (l(mu, n_l) + l(n_l, mu))
            }
        };
        let weight = g2 * v_h / (cos_h * mu);
        let fresnel = (1.0 - v_h).powi(5);
        scale += (1.0 - fresnel) * weight;
        bias += fresnel * weight;
    }
    [scale / samples, bias / samples]
}

/// Cosine and roughness of a column and a row, and what is stored of scale and bias.
struct Engine {
    size: [usize; 2],
    place: fn(f64, f64) -> [f64; 2],
    masking: Masking,
    samples: u32,
    store: fn(f64) -> f64,
    split: fn([f64; 2]) -> Vec<f64>,
}

const PLAIN: Engine = Engine {
    size: [32, 32],
    place: |x, y| [(x + 0.5) / 32.0, (y + 0.5) / 32.0],
    masking: Masking::Correlated,
    samples: 1024,
    store: |v| f64::from(half(v)),
    split: |v| v.to_vec(),
};

fn half(v: f64) -> f32 {
    kiln::pack::Number::F16.unpack(&kiln::pack::Number::F16.pack(&[v]).0)[0]
}

impl Engine {
    fn grid(&self) -> Grid {
        let [w, h] = self.size;
        let mut values = vec![];
        for y in 0..h {
            for x in 0..w {
                let [mu, roughness] = (self.place)(x as f64, y as f64);
                values.extend(
                    (self.split)(sampled(mu, roughness, self.masking, hammersley(self.samples)))
                        .into_iter()
                        .map(self.store),
                );
            }
        }
        let channels = values.len() / (w * h);
        bare(&values, &format!("{w}x{h}x{channels}"))
    }
}

/// Numbers as floats without a header.
fn bare(values: &[f64], shape: &str) -> Grid {
    let bytes: Vec<u8> = values.iter().flat_map(|&v| (v as f32).to_le_bytes()).collect();
    let described = Described { shape: Some(shape.parse().unwrap()), ..Described::default() };
    Grid::decode(&bytes, &described).unwrap_or_else(|e| panic!("{e}"))
}

fn found(grid: &Grid) -> Identification {
    identify(grid, &Options { cache: false }).unwrap_or_else(|e| panic!("{e}"))
}

fn quantities(found: &Identification) -> Vec<&str> {
    found.channels.iter().map(|c| c.quantity.as_deref().unwrap_or(&c.holds)).collect()
}

fn axes(found: &Identification) -> Vec<&str> {
    found.axes.iter().map(|a| a.axis.as_str()).collect()
}

#[test]
fn tables_as_engines_make_them_are_recognised() {
    let byte = |v: f64| (v * 255.0).round() / 255.0;
    /// The table, quantities, axes, words, model of the first channel.
    type Case<'a> = (&'a str, Engine, &'a [&'a str], &'a [&'a str], &'a [&'a str], &'a str);
    let cases: [Case; 9] = [
        ("1024 samples", PLAIN, &["ggx.scale", "ggx.bias"], &["mu:32", "roughness:32"], &[], "correlated Smith"),
        (
            "Karis",
            Engine { masking: Masking::SchlickK, ..PLAIN },
            &["ggx.scale", "ggx.bias"],
            &["mu:32", "roughness:32"],
            &[],
            "schlick-ibl Smith",
        ),
        (
            "separable",
            Engine { masking: Masking::Separable, ..PLAIN },
            &["ggx.scale", "ggx.bias"],
            &["mu:32", "roughness:32"],
            &["separable"],
            "separable Smith",
        ),
        (
            "8 bits, bias and total",
            Engine { store: byte, split: |[s, b]| vec![b, s + b], ..PLAIN },
            &["ggx.bias", "ggx.albedo"],
            &["mu:32", "roughness:32"],
            &[],
            "correlated Smith",
        ),
        (
            "off by one row, the last clamped",
            Engine { place: |x, y| [(x + 0.5) / 32.0, ((y + 1.5) / 32.0).min(1.0)], ..PLAIN },
            &["ggx.scale", "ggx.bias"],
            &["mu:32", "roughness:32"],
            &["shifted by 1 texel in roughness"],
            "correlated Smith",
        ),
        (
            "transposed",
            Engine { size: [16, 16], place: |x, y| [(y + 0.5) / 16.0, (x + 0.5) / 16.0], ..PLAIN },
            &["ggx.scale", "ggx.bias"],
            &["roughness:16", "mu:16"],
            &["transposed"],
            "correlated Smith",
        ),
        (
            "flipped",
            Engine { place: |x, y| [(x + 0.5) / 32.0, 1.0 - (y + 0.5) / 32.0], ..PLAIN },
            &["ggx.scale", "ggx.bias"],
            &["mu:32", "roughness:32:flip"],
            &["flipped in roughness"],
            "correlated Smith",
        ),
        (
            "the square root of the cosine, edges",
            Engine { place: |x, y| [(x / 31.0).powi(2).max(1e-4), (y / 31.0).max(1e-3)], samples: 4096, ..PLAIN },
            &["ggx.scale", "ggx.bias"],
            &["mu:32:sqrt:edge", "roughness:32:edge"],
            &[],
            "correlated Smith",
        ),
        (
            "alpha instead of roughness",
            Engine { place: |x, y| [(x + 0.5) / 32.0, ((y + 0.5) / 32.0).sqrt()], ..PLAIN },
            &["ggx.scale", "ggx.bias"],
            &["mu:32", "alpha:32"],
            &[],
            "correlated Smith",
        ),
    ];
    for (name, engine, wanted, wanted_axes, words, model) in cases {
        let found = found(&engine.grid());
        assert_eq!(quantities(&found), wanted, "{name}: {found:#?}");
        assert_eq!(axes(&found), wanted_axes, "{name}: {found:#?}");
        assert_eq!(found.words, words, "{name}: {found:#?}");
        assert_eq!(found.channels[0].model.as_deref(), Some(model), "{name}");
        assert!(found.confidence >= Confidence::Possible, "{name}: {found:#?}");
    }
}

#[test]
fn a_cropped_table_says_what_it_covers() {
    // Rows 8 to 31 and columns 4 to 27 of 32.
    let engine = Engine { size: [24, 24], place: |x, y| [(x + 4.5) / 32.0, (y + 8.5) / 32.0], samples: 2048, ..PLAIN };
    let found = found(&engine.grid());
    assert_eq!(quantities(&found), ["ggx.scale", "ggx.bias"], "{found:#?}");
    assert!(found.words.contains(&"cropped in roughness".to_owned()), "{found:#?}");
    let spec = &found.claim.channels[0].spec;
    for (axis, (low, high)) in spec.axes.iter().zip([(4.0 / 32.0, 28.0 / 32.0), (8.0 / 32.0, 1.0)]) {
        let (a, b) = axis.ends();
        // A quarter of a texel: the samples' noise is what limits it.
        assert!((a - low).abs() < 0.25 / 32.0 && (b - high).abs() < 0.25 / 32.0, "{axis}: wanted {low}..{high}");
    }
}

#[test]
fn a_fraction_of_a_texel_is_measured() {
    let engine = Engine { place: |x, y| [(x + 0.5) / 32.0, (y + 0.8) / 32.0], samples: 2048, ..PLAIN };
    let found = found(&engine.grid());
    let shift = found.words.iter().find_map(|w| w.strip_prefix("shifted by ")?.strip_suffix(" texels in roughness"));
    let shift: f64 = shift.unwrap_or_else(|| panic!("{found:#?}")).parse().unwrap();
    assert!((shift - 0.3).abs() < 0.1, "{shift}");
}

#[test]
fn noise_is_told_from_a_pattern_and_many_texels_from_few() {
    const SAMPLES: usize = 640;
    let mut random = Random(11);
    let values: Vec<f64> = (0..24 * 24)
        .flat_map(|i| {
            let [mu, roughness] = [i % 24, i / 24].map(|i| (f64::from(i) + 0.5) / 24.0);
            let points: Vec<(f64, f64)> = (0..SAMPLES).map(|_| (random.unit(), random.unit())).collect();
            sampled(mu, roughness, Masking::Separable, points.into_iter())
        })
        .collect();
    let noisy = found(&bare(&values, "24x24x2"));
    assert_eq!(quantities(&noisy), ["ggx.scale", "ggx.bias"], "{noisy:#?}");
    assert_eq!(noisy.words, ["separable"], "{noisy:#?}");
    let [scale, bias] = &noisy.channels[..] else { panic!("two channels") };
    // Another axis leaves about as much; over all texels together it is far away.
    assert_eq!([scale.confidence, bias.confidence], [Confidence::Likely; 2], "{noisy:#?}");
    let second = scale.runner_up.as_ref().unwrap();
    assert!(second.times < 1.5 && second.deviations.unwrap() > 5.0, "{noisy:#?}");
    let noise = bias.noise.unwrap();
    // The sampler that counts draws better than an engine's: a factor of two.
    let samples = noise.samples.unwrap();
    assert!(!noise.is_patterned() && (0.5..2.0).contains(&(samples / SAMPLES as f64)), "{noise:?}");
    // What sums in single precision leave is noise too, but not of samples.
    let mut summed = integrated(&sized("dfg", FormatSpec::exr(kiln::pack::Number::F32), 24));
    summed.values.iter_mut().for_each(|v| *v += 1.2e-6 * (random.unit() - 0.5));
    let summed = found(&bare(&summed.values, "24x24x2"));
    assert_eq!(quantities(&summed), ["ggx.scale", "ggx.bias"], "{summed:#?}");
    for noise in summed.channels.iter().map(|c| c.noise.unwrap()) {
        assert!(!noise.is_patterned() && noise.samples.is_none(), "{noise:?}");
    }
    // The same points for every texel are wrong alike in all.
    let same = found(
        &Engine { size: [24, 24], place: |x, y| [(x + 0.5) / 24.0, (y + 0.5) / 24.0], samples: 256, ..PLAIN }.grid(),
    );
    assert_eq!(quantities(&same), ["ggx.scale", "ggx.bias"], "{same:#?}");
    assert!(same.channels.iter().all(|c| c.noise.unwrap().is_patterned()), "{same:#?}");
}

#[test]
fn what_is_no_table_is_unknown() {
    let mut random = Random(5);
    let noise: Vec<f64> = (0..32 * 32).map(|_| random.unit()).collect();
    // Like a photograph: waves of all lengths with random phases, the longer the stronger, and a hard edge.
    let waves: Vec<[f64; 4]> = (0..40)
        .map(|_| {
            let length = 1.0 + 15.0 * random.unit();
            let angle = std::f64::consts::TAU * random.unit();
            [length * angle.cos(), length * angle.sin(), std::f64::consts::TAU * random.unit(), 1.0 / length]
        })
        .collect();
    let photo: Vec<f64> = (0..48 * 48)
        .map(|i| {
            let (x, y) = (f64::from(i % 48) / 48.0, f64::from(i / 48) / 48.0);
            let waves: f64 = waves.iter().map(|[u, v, phase, size]| size * (u * x + v * y + phase).sin()).sum();
            0.5 + 0.1 * waves + if x + 0.3 * y > 0.8 { 0.2 } else { 0.0 }
        })
        .collect();
    // Something smooth that no lobe is: with a factor, an offset and two ranges to choose, many come near.
    let product = (0..24 * 24).map(|i| f64::from(i % 24) * (1.0 - f64::from(i / 24) / 80.0) / 24.0).collect();
    // A channel that varies in a corner only.
    let corner = (0..32 * 32).map(|i| if i % 32 < 6 && i / 32 < 6 { random.unit() } else { 1.0 }).collect();
    // Numbers of all magnitudes, in disorder and in order: next to the largest all others are as good as equal.
    let spread = (0..32 * 32).map(|_| (200.0 * random.unit() - 100.0).exp2()).collect();
    let steep = (0..32 * 32).map(|i| (200.0 * f64::from(i % 32 + i / 32) / 62.0 - 100.0).exp2()).collect();
    for (name, values, shape) in [
        ("noise", noise, "32x32"),
        ("photograph", photo, "48x48"),
        ("product", product, "24x24"),
        ("corner", corner, "32x32"),
        ("of all magnitudes", spread, "32x32"),
        ("an exponential", steep, "32x32"),
    ] {
        let found = found(&bare(&values, shape));
        assert_eq!(found.confidence, Confidence::Unknown, "{name}: {found:#?}");
        assert_eq!(found.channels[0].holds, "unknown", "{name}");
        assert!(found.commands.is_empty(), "{name}");
    }
}

/// Where a fit jumps from one texel to the next, dense tables do not say what is between: what the channels beside it are makes it known.
/// (Of 11 texels and fewer along each axis, they are known without.)
#[test]
fn a_channel_that_jumps_is_known_by_those_beside_it() {
    let mut recipe = TableRecipe::named("ltc-charlie", FormatSpec::exr(kiln::pack::Number::F32)).unwrap();
    let axes_of_it = ["mu:12:log+0.03:edge:flip", "roughness:12:log+0.2:edge:flip"];
    recipe.axes = axes_of_it.map(|axis| axis.parse().unwrap()).into();
    let grid = integrated(&recipe);
    let known = found(&grid);
    assert_eq!(quantities(&known), recipe.channels, "{known:#?}");
    assert_eq!(axes(&known), axes_of_it, "{known:#?}");
    assert_eq!(known.confidence, Confidence::Certain, "{known:#?}");
}

#[test]
fn what_is_no_table_is_unknown_beside_what_is_one() {
    let table = integrated(&sized("dfg", FormatSpec::exr(kiln::pack::Number::F32), 16));
    let texels: Vec<[f64; 4]> = (table.values.chunks_exact(2).enumerate())
        .map(|(i, own)| {
            let (x, y) = (i % 16, i / 16);
            // One that jumps from one channel to the other, and waves.
            let jumps = own[usize::from(x + 2 * y > 24)];
            let waves = 0.5 + 0.4 * (0.5 * x as f64).sin() * (0.3 * y as f64).cos();
            [own[0], own[1], jumps, waves]
        })
        .collect();
    let byte = |v: &f64| (v * 255.0).round() / 255.0;
    let whole = texels.concat();
    for (name, values) in [("floats", whole.clone()), ("bytes", whole.iter().map(byte).collect())] {
        let found = found(&bare(&values, "16x16x4"));
        assert_eq!(quantities(&found), ["ggx.scale", "ggx.bias", "unknown", "unknown"], "{name}: {found:#?}");
    }
}

#[test]
fn values_that_are_no_numbers_are_counted_and_the_others_are_named() {
    let mut grid = integrated(&sized("dfg", FormatSpec::exr(kiln::pack::Number::F32), 16));
    (grid.values[40], grid.values[90]) = (f64::NAN, f64::INFINITY);
    let found = found(&grid);
    assert_eq!(quantities(&found), ["ggx.scale", "ggx.bias"], "{found:#?}");
    assert_eq!(found.channels.iter().map(|c| c.not_finite).collect::<Vec<_>>(), [2, 0], "{found:#?}");
}

#[test]
fn layers_of_an_array_are_looked_at_one_by_one() {
    let recipe = sized("dfg", FormatSpec::exr(kiln::pack::Number::F32), 16);
    let spec = recipe.spec().unwrap();
    let table = spec.bake(&Integration::new(Settings::default()).unwrap(), &|_| {}).unwrap().values;
    let other: Vec<f64> = table.iter().map(|v| 1.0 - v).collect();
    let format = "rg32f".parse().unwrap();
    let texture = kiln::format::Texture::array(format, [16, 16, 2], &[table, other].concat()).unwrap().0;
    let bytes = ktx2::encode(&texture).unwrap();
    let whole = Grid::decode(&bytes, &Described::default()).unwrap();
    let refused = identify(&whole, &Options { cache: false }).unwrap_err().to_string();
    assert!(refused.contains("look at each by itself, --layer 0 to --layer 1"), "{refused}");
    for (layer, encoding) in [(0, None), (1, Some("1 minus it"))] {
        let described = Described { layer: Some(layer), ..Described::default() };
        let found = found(&Grid::decode(&bytes, &described).unwrap());
        assert_eq!(quantities(&found), ["ggx.scale", "ggx.bias"], "{found:#?}");
        assert_eq!(found.channels[0].encoding.as_deref(), encoding, "{found:#?}");
    }
}

/// The recipe with so many texels along each axis.
fn sized(name: &str, format: FormatSpec, size: usize) -> TableRecipe {
    let mut recipe = TableRecipe::named(name, format).unwrap();
    recipe.axes.iter_mut().for_each(|axis| axis.size = size);
    recipe
}

/// Values as a table's own integrator gives them, as a grid of floats.
fn integrated(recipe: &TableRecipe) -> Grid {
    let spec = recipe.spec().unwrap();
    let settings = Settings { tolerance: recipe.integration.tolerance.or(Some(1e-6)), ..recipe.integration };
    let table = spec.bake(&Integration::new(settings).unwrap(), &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let [w, h, d] = [spec.width(), spec.height(), spec.depth()];
    bare(&table.values, &format!("{w}x{h}x{d}x{}", spec.channels.len()))
}

#[test]
fn every_other_two_dimensional_named_table_is_recognised_by_its_numbers() {
    let is_left_out = |name: &str| LEFT_OUT.contains(&name) || recognised::is_covered(name);
    for table in TABLES.iter().filter(|t| t.axes.len() == 2 && !is_left_out(t.name)) {
        let size = if table.name.starts_with("ltc") { 5 } else { 16 }; // a fit takes milliseconds
        let recipe = sized(table.name, FormatSpec::exr(kiln::pack::Number::F32), size);
        let found = found(&integrated(&recipe));
        assert_eq!(quantities(&found), table.channels, "{}: {found:#?}", table.name);
        let wanted: Vec<String> = recipe.axes.iter().map(kiln::table::Axis::brief).collect();
        assert_eq!(axes(&found), wanted, "{}: {found:#?}", table.name);
        assert!(found.confidence >= Confidence::Likely, "{}: {found:#?}", table.name);
    }
}

/// Two tables whose channels are over different axes (see `recognised`).
const LEFT_OUT: [&str; 2] = ["ltc-amplitude", "ltc-lobe-amplitude"];

#[test]
fn averages_over_one_axis_are_recognised() {
    for name in ["ggx-albedo-avg", "beckmann-albedo-avg", "fresnel-schlick-avg"] {
        let recipe = sized(name, FormatSpec::exr(kiln::pack::Number::F32), 32);
        let found = found(&integrated(&recipe));
        assert_eq!(quantities(&found), recipe.channels, "{found:#?}");
    }
}

/// The file of a bake without its certificate.
fn stripped(bytes: &[u8]) -> Vec<u8> {
    match decode(bytes).unwrap() {
        Decoded::Picture(mut image, format) => {
            image.metadata.clear();
            exr::encode(&image, format.number().unwrap()).unwrap().0
        }
        Decoded::Texture(mut texture) => {
            texture.metadata.clear();
            ktx2::encode(&texture).unwrap()
        }
        Decoded::Array(_) => unreachable!("the recipe bakes none"),
    }
}

#[test]
fn what_the_built_in_recipe_bakes_passes_as_somebody_elses() {
    let folder = tempfile::tempdir().unwrap();
    for mut recipe in Recipe::built_in().unwrap().tables {
        // The sizes are the recipe's own but for the largest, whose integrals other tests make.
        recipe.axes.iter_mut().for_each(|axis| axis.size = axis.size.min(48));
        let baked = bake::table(&recipe, &|_| {}).unwrap();
        let path = folder.path().join(&recipe.file);
        std::fs::write(&path, stripped(&baked.files[0].1)).unwrap();
        let options = verify::Options { identify: Options { cache: false }, ..verify::Options::default() };
        let report = verify::file(&path, options).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(report.failures(), 0, "{report:#?}");
        let mut judged: Vec<&str> = report.channels.iter().map(|c| c.quantity.as_str()).collect();
        let mut wanted: Vec<&str> = recipe.channels.iter().map(String::as_str).collect();
        judged.sort_unstable();
        wanted.sort_unstable();
        assert_eq!(judged, wanted, "{report:#?}");
        for channel in &report.channels {
            // Rounded to the nearest: as good as correct rounding, but for what the integrals are off by.
            assert!(channel.times_rounding <= 1.2, "{channel:#?}");
        }
        let found = found(&Grid::read(&path, &Described::default()).unwrap());
        let mut axes = axes(&found);
        let mut wanted: Vec<String> = recipe.axes.iter().map(kiln::table::Axis::brief).collect();
        axes.sort_unstable();
        wanted.sort_unstable();
        assert_eq!(axes, wanted, "{found:#?}");
    }
}

#[test]
fn a_channel_may_be_the_same_along_an_axis_of_its_table() {
    let grid = integrated(&sized("cloth-split", FormatSpec::exr(kiln::pack::Number::F32), 8));
    verify::that_grid("cloth", grid).holds("cloth-split").unwrap().within(1e-6).unwrap();
}

#[test]
fn a_sentence_says_where_a_table_is_wrong() {
    let mut grid = integrated(&sized("dfg", FormatSpec::exr(kiln::pack::Number::F32), 16));
    verify::that_grid("dfg", grid.clone()).holds("dfg").unwrap().within(1e-6).unwrap();
    grid.values[2 * (5 * 16 + 3) + 1] += 0.01;
    let judged = verify::that_grid("dfg.ktx2", grid).holds("dfg").unwrap();
    let message = judged.within(2e-3).unwrap_err().to_string();
    assert!(message.contains("dfg.ktx2: channel G is not ggx.bias within 2e-3"), "{message}");
    assert!(message.contains("off by 1.000e-2") && message.contains("column 3, row 5"), "{message}");
    assert!(judged.filtered_within(f64::NAN).is_err(), "nothing is within NaN");
}

/// Runs the command with a cache of its own.
fn run(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_kiln"))
        .args(arguments)
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .output()
        .unwrap();
    let text = |b: Vec<u8>| String::from_utf8(b).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn the_command_judges_by_exit_code_and_junit() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let numbers = |masking| {
        let grid =
            Engine { masking, size: [16, 16], place: |x, y| [(x + 0.5) / 16.0, (y + 0.5) / 16.0], ..PLAIN }.grid();
        let texts: Vec<String> = grid.values.iter().map(|v| format!("{v:.9}")).collect();
        format!("const float dfg[16][16][2] = {{ {} }};\n", texts.join(", "))
    };
    std::fs::write(folder.join("a<b>\u{1}.h"), numbers(Masking::Correlated)).unwrap();
    std::fs::write(folder.join("karis.h"), numbers(Masking::SchlickK)).unwrap();
    let (code, out, _) =
        run(folder, &["verify", "a<b>\u{1}.h", "--as", "dfg", "--max-error", "0.03", "--junit", "a.xml"]);
    assert_eq!(code, 0, "{out}");
    assert!(!out.contains('\u{1}'));
    let xml = std::fs::read_to_string(folder.join("a.xml")).unwrap();
    assert!(xml.contains("a&lt;b&gt;\u{fffd}.h") && xml.contains("failures=\"0\""), "{xml}");
    let (code, out, error) =
        run(folder, &["verify", "karis.h", "--as", "dfg", "--max-error", "0.03", "--junit", "b.xml", "--json"]);
    assert_eq!(code, 3, "{out}{error}");
    assert!(std::fs::read_to_string(folder.join("b.xml")).unwrap().contains("<failure"));
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert!(json[0]["channels"][0]["texels"]["max"].as_f64().unwrap() > 0.03, "{out}");
    // The right masking term makes it right.
    let (code, out, _) =
        run(folder, &["verify", "karis.h", "--as", "dfg", "--smith", "schlick-ibl", "--max-error", "0.03"]);
    assert_eq!(code, 0, "{out}");
    let (code, out, error) =
        run(folder, &["compare", "a<b>\u{1}.h", "karis.h", "--tolerance", "1e-3", "--map", "map.exr"]);
    assert_eq!(code, 3, "{out}{error}");
    assert_eq!(exr::decode(&std::fs::read(folder.join("map.exr")).unwrap()).unwrap().width, 16);
    let (code, _, _) = run(folder, &["compare", "karis.h", "karis.h"]);
    assert_eq!(code, 0);
}

#[test]
fn bad_input_is_refused_with_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("two.js", "const a = [0.1,0.2,0.3,0.4]; const b = [0.1,0.2,0.3,0.4];");
    write("few.json", "[[0.1,0.2],[0.3,0.4]]");
    let rows = |bad: &str| {
        let row = |y: usize| {
            (0..8).map(|x| if x == y { bad.to_owned() } else { format!("0.{x}{y}") }).collect::<Vec<_>>().join(",")
        };
        format!("[{}]", (0..8).map(|y| format!("[{}]", row(y))).collect::<Vec<_>>().join(","))
    };
    write("nan.js", &format!("x = {}", rows("NaN")));
    write("archive.gz", "\u{1f}");
    std::fs::write(folder.join("jpeg.jpg"), [0xff, 0xd8, 0xff, 0xe0, 0, 0]).unwrap();
    let whole =
        ktx2::encode(&kiln::format::Texture::flat(kiln::pack::TexelFormat::Rgb9e5, 4, 4, &[0.5; 48]).unwrap().0);
    std::fs::write(folder.join("short.ktx2"), &whole.unwrap()[..120]).unwrap();
    std::fs::write(folder.join("archive.gz"), [0x1f, 0x8b, 0, 0, 1, 2, 3, 0]).unwrap();
    for (arguments, code, says) in [
        (vec!["identify", "two.js"], 2, "choose one with --array"),
        (vec!["identify", "two.js", "--array", "c"], 2, "a (4 numbers)"),
        (vec!["identify", "few.json"], 1, "too few"),
        (vec!["verify", "few.json", "--as", "dfg"], 1, "1 of the 2 channels that were said to be; name"),
        (vec!["verify", "few.json", "--as", "dielectric-albedo"], 1, "2 × 2 × 1 texels, where 3 axes were"),
        (vec!["verify", "few.json", "--as", "ggx-albedo-avg"], 1, "2 × 2 × 1 texels, where one axis was"),
        (vec!["verify", "few.json", "--as", "ggx-albedo", "--axes", "mu:3,roughness"], 1, "2 texels along mu, where 3"),
        (vec!["identify", "few.json", "--packing", "rgbd"], 2, "four channels of 8 bits"),
        (vec!["identify", "short.ktx2"], 1, "damaged"),
        (vec!["identify", "jpeg.jpg"], 1, "a JPEG picture"),
        (vec!["verify", "few.json", "--as", "dgf"], 2, "did you mean"),
        (vec!["verify", "few.json", "--axes", "mu"], 2, "--as TABLE"),
        (vec!["identify", "archive.gz"], 1, "a gzip archive"),
        (vec!["identify", "nothing.ktx2"], 1, "check the path"),
        (vec!["compare", "few.json", "nan.js"], 1, "the same shape"),
    ] {
        let (got, out, error) = run(folder, &arguments);
        assert_eq!(got, code, "{arguments:?}: {out}{error}");
        assert!(error.contains(says), "{arguments:?}: {error}");
    }
    // A table with NaN is judged, and fails.
    let (code, out, error) = run(folder, &["verify", "nan.js", "--as", "ggx-albedo"]);
    assert_eq!(code, 3, "{out}{error}");
    assert!(out.contains("values that are not finite") && out.contains("FAIL"), "{out}");
}
