//! Verification catches spoiled files, by physics and by both witnesses, not only by the digest.

use crate::support::kiln::{fail, kiln, succeed};
use kiln::bake;
use kiln::certificate::{Certificate, KEY, digest};
use kiln::format::{FormatSpec, Image, exr, ktx2};
use kiln::math::fit::Fit;
use kiln::pack::Number;
use kiln::recipe::{EnvironmentRecipe, IrradianceKind, TableRecipe};
use kiln::table::{Axis, Parameter, Sampling};
use kiln::verify::{self, Options, Report};
use std::path::Path;

const SIZE: usize = 16;

fn recipe(channels: &[&str], sampling: Sampling) -> TableRecipe {
    let axis = |parameter| Axis { sampling, ..Axis::new(parameter, SIZE) };
    TableRecipe {
        file: "table.exr".to_owned(),
        format: FormatSpec::exr(Number::F32),
        channels: channels.iter().map(|&c| c.to_owned()).collect(),
        axes: vec![axis(Parameter::Mu), axis(Parameter::Roughness)],
        at: Default::default(),
        fit: Fit::None,
        layout: None,
        model: Default::default(),
        integration: Default::default(),
    }
}

/// Bakes a table, lets `spoil` change its values, seals it again with a certificate whose digest fits, and verifies.
fn verify_spoiled(recipe: &TableRecipe, spoil: impl Fn(&mut Image)) -> Report {
    let baked = bake::table(recipe, &|_| {}).expect("the table bakes");
    let mut image = exr::decode(&baked.files[0].1).expect("own file");
    // The reader sorts channels by name; the certificate's digest is over the recipe's order.
    spoil(&mut image);
    let mut certificate = baked.certificate.clone();
    let order: Vec<usize> = recipe.channels.iter().map(|c| image.channel_index(c).expect("a channel")).collect();
    let texels = image.texels.chunks_exact(order.len()).flat_map(|t| order.iter().map(|&c| t[c]));
    let bytes: Vec<u8> = texels.flat_map(f32::to_le_bytes).collect();
    certificate.files[0].digest = digest([bytes.as_slice()]);
    image.metadata = vec![(KEY.to_owned(), certificate.to_json().expect("printable"))];
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("table.exr");
    std::fs::write(&path, exr::encode(&image, Number::F32).expect("encodes").0).expect("writes");
    verify::file(&path, Options::default()).expect("the file can be judged")
}

/// The names of the checks that failed.
fn failed(report: &Report) -> Vec<&str> {
    report.checks.iter().filter(|c| !c.passed).map(|c| c.name.as_str()).collect()
}

fn dfg() -> TableRecipe {
    recipe(&["ggx.scale", "ggx.bias"], Sampling::Centre)
}

#[test]
fn an_untouched_table_passes_every_check() {
    let report = verify_spoiled(&dfg(), |_| {});
    assert_eq!(failed(&report), [""; 0], "{:?}", report.checks);
    assert!(report.checks.len() >= 10, "only {} checks", report.checks.len());
}

#[test]
fn one_texel_off_by_a_thousandth_is_caught_by_a_witness_and_by_the_sum() {
    let report = verify_spoiled(&dfg(), |image| image.texels[2 * (5 * SIZE + 7)] *= 1.001);
    let failed = failed(&report);
    assert!(failed.contains(&"quadrature at every texel") && failed.contains(&"scale + bias = E"), "{failed:?}");
}

#[test]
fn swapped_channels_are_caught() {
    let report = verify_spoiled(&dfg(), |image| image.texels.chunks_exact_mut(2).for_each(|t| t.swap(0, 1)));
    let failed = failed(&report);
    // Their sum is still E: only the witnesses and the mirror limit can tell.
    assert!(failed.contains(&"quadrature at every texel"), "{failed:?}");
    assert!(failed.contains(&"perfect mirror as alpha → 0"), "{failed:?}");
    assert!(failed.iter().any(|name| name.starts_with("Monte Carlo")), "{failed:?}");
    assert!(!failed.contains(&"scale + bias = E"), "{failed:?}");
}

#[test]
fn rows_in_reverse_are_caught() {
    let report = verify_spoiled(&dfg(), |image| {
        let rows: Vec<Vec<f32>> = image.texels.chunks_exact(2 * SIZE).rev().map(<[f32]>::to_vec).collect();
        image.texels = rows.concat();
    });
    assert!(failed(&report).contains(&"quadrature at every texel"), "{:?}", failed(&report));
}

#[test]
fn a_table_shifted_by_one_texel_in_roughness_is_caught() {
    let report = verify_spoiled(&dfg(), |image| image.texels.rotate_left(2 * SIZE));
    assert!(failed(&report).contains(&"quadrature at every texel"), "{:?}", failed(&report));
}

#[test]
fn nan_infinity_and_values_out_of_bounds_are_caught() {
    for (value, check) in [
        (f32::NAN, "values that are not finite"),
        (f32::INFINITY, "values that are not finite"),
        (1.01, "distance outside the quantity's bounds"),
        (-0.01, "distance outside the quantity's bounds"),
    ] {
        let report = verify_spoiled(&dfg(), |image| image.texels[9] = value);
        assert!(failed(&report).contains(&check), "{value}: {:?}", failed(&report));
    }
}

#[test]
fn a_table_one_percent_low_at_grazing_angles_breaks_the_closure() {
    let albedo = recipe(&["ggx.albedo"], Sampling::Edge);
    assert_eq!(failed(&verify_spoiled(&albedo, |_| {})), [""; 0]);
    let report = verify_spoiled(&albedo, |image| {
        image.texels.iter_mut().enumerate().filter(|(i, _)| i % SIZE < 6).for_each(|(_, v)| *v *= 0.99);
    });
    let failed = failed(&report);
    assert!(failed.contains(&"Kulla–Conty closure E + ∫ f_ms cos = 1"), "{failed:?}");
    assert!(failed.contains(&"closed form of E at alpha = 1"), "{failed:?}");
    assert!(failed.contains(&"E → 1 as mu → 0 with correlated Smith"), "{failed:?}");
}

#[test]
fn a_certificate_that_claims_huge_errors_excuses_nothing() {
    let baked = bake::table(&dfg(), &|_| {}).expect("the table bakes");
    let mut image = exr::decode(&baked.files[0].1).expect("own file");
    image.texels[0] += 0.01;
    let mut certificate = baked.certificate;
    certificate.channels.iter_mut().for_each(|c| c.max_error = 1.0);
    image.metadata = vec![(KEY.to_owned(), certificate.to_json().expect("printable"))];
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("table.exr");
    std::fs::write(&path, exr::encode(&image, Number::F32).expect("encodes").0).expect("writes");
    let report = verify::file(&path, Options::default()).expect("the file can be judged");
    assert!(failed(&report).contains(&"quadrature at every texel"), "{:?}", failed(&report));
    assert!(failed(&report).contains(&"texels other than the certified ones"), "{:?}", failed(&report));
}

/// Bakes a small environment into `folder`.
fn bake_environment(folder: &Path, input: &str) -> Certificate {
    let mut recipe = EnvironmentRecipe::new(input);
    (recipe.size, recipe.min_size, recipe.irradiance_size) = (32, 8, 8);
    recipe.format = "ktx2:rgba32f".parse().expect("a format");
    recipe.integration.samples = Some(1024);
    let source = bake::source(&recipe).expect("built in");
    let baked = bake::environment(&recipe, &source, &|_| {}).expect("bakes");
    baked.write(folder).expect("writes");
    baked.certificate
}

/// Changes one cube of an environment in place, with a digest that fits, and verifies it.
fn verify_spoiled_cube(folder: &Path, spoil: impl Fn(&mut Vec<Vec<f32>>)) -> Report {
    let path = folder.join("specular.ktx2");
    let original = std::fs::read(&path).expect("reads");
    let mut texture = ktx2::decode(&original).expect("own file");
    let mut levels: Vec<Vec<f32>> = (0..texture.levels.len()).map(|level| texture.values(level)).collect();
    spoil(&mut levels);
    texture.levels = levels.iter().map(|l| texture.format.pack(1, 1, l).0).collect();
    let mut certificate =
        Certificate::from_json(texture.metadata(KEY).expect("a certificate")).expect("own certificate");
    let rgb = levels.iter().flat_map(|l| l.chunks_exact(4).flat_map(|t| t[..3].to_vec()));
    let bytes: Vec<u8> = rgb.flat_map(f32::to_le_bytes).collect();
    certificate.files[0].digest = digest([bytes.as_slice()]);
    texture.metadata.retain(|(key, _)| key != KEY);
    texture.metadata.push((KEY.to_owned(), certificate.to_json().expect("printable")));
    std::fs::write(&path, ktx2::encode(&texture).expect("encodes")).expect("writes");
    let report = verify::file(&path, Options::default()).expect("the file can be judged");
    std::fs::write(&path, original).expect("writes");
    report
}

#[test]
fn a_claim_of_huge_lookup_errors_excuses_little_more_than_exact_texels_are_off() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut recipe = EnvironmentRecipe::new("builtin:sun");
    (recipe.size, recipe.min_size, recipe.irradiance, recipe.fit) = (8, 2, IrradianceKind::None, Fit::Lookup);
    recipe.format = "ktx2:rgba32f".parse().expect("a format");
    let source = bake::source(&recipe).expect("built in");
    let baked = bake::environment(&recipe, &source, &|_| {}).expect("bakes");
    baked.write(folder.path()).expect("writes");
    let path = folder.path().join("specular.ktx2");
    let mut texture = ktx2::decode(&std::fs::read(&path).expect("reads")).expect("own file");
    let mut certificate = baked.certificate;
    certificate.levels.iter_mut().filter_map(|level| level.lookup.as_mut()).for_each(|lookup| lookup.max = 1e9);
    texture.metadata = vec![(KEY.to_owned(), certificate.to_json().expect("printable"))];
    std::fs::write(&path, ktx2::encode(&texture).expect("encodes")).expect("writes");
    let whole = verify_spoiled_cube(folder.path(), |_| {});
    assert_eq!(failed(&whole), [""; 0], "{:?}", whole.checks);
    let spoiled = verify_spoiled_cube(folder.path(), |levels| levels[2].iter_mut().for_each(|value| *value *= 1e3));
    let name = "full sum through bilinear filtering, relative";
    assert_eq!(failed(&spoiled), [name], "{:?}", spoiled.checks);
}

#[test]
fn spoiled_environments_are_caught() {
    let folder = tempfile::tempdir().expect("a folder");
    let certificate = bake_environment(folder.path(), "builtin:sun");
    assert_eq!(certificate.failures(), 0);
    let whole = verify_spoiled_cube(folder.path(), |_| {});
    assert_eq!(failed(&whole), [""; 0], "{:?}", whole.checks);

    let firefly = verify_spoiled_cube(folder.path(), |levels| levels[0][4 * 100] *= 1.01);
    assert!(failed(&firefly).contains(&"exact area average at every texel"), "{:?}", failed(&firefly));

    // Faces +X and −X exchanged in the rougher levels: a mirrored environment.
    let mirrored = verify_spoiled_cube(folder.path(), |levels| {
        for level in &mut levels[1..] {
            let face = level.len() / 6;
            let (a, b) = level.split_at_mut(face);
            a.swap_with_slice(&mut b[..face]);
        }
    });
    assert!(failed(&mirrored).iter().any(|name| name.starts_with("full sum")), "{:?}", failed(&mirrored));

    let dim = verify_spoiled_cube(folder.path(), |levels| levels[1].iter_mut().for_each(|v| *v *= 0.7));
    assert!(failed(&dim).iter().any(|name| name.starts_with("full sum")), "{:?}", failed(&dim));

    let negative = verify_spoiled_cube(folder.path(), |levels| levels[2][0] = -1.0);
    assert!(failed(&negative).contains(&"values below zero"), "{:?}", failed(&negative));
}

#[test]
fn a_white_environment_is_exactly_one_in_every_texel() {
    let folder = tempfile::tempdir().expect("a folder");
    bake_environment(folder.path(), "builtin:white");
    for name in ["specular.ktx2", "irradiance.ktx2"] {
        let texture = ktx2::decode(&std::fs::read(folder.path().join(name)).expect("reads")).expect("own file");
        for level in 0..texture.levels.len() {
            assert!(texture.values(level).iter().all(|&v| v == 1.0), "{name} is not white");
        }
    }
    let almost = verify_spoiled_cube(folder.path(), |levels| levels[1][8] = 1.0 + f32::EPSILON);
    assert!(failed(&almost).contains(&"distance from the constant input"), "{:?}", failed(&almost));
}

#[test]
fn a_changed_coefficient_of_sh_json_is_caught() {
    let folder = tempfile::tempdir().expect("a folder");
    bake_environment(folder.path(), "builtin:gradient");
    let path = folder.path().join("sh.json");
    let report = verify::file(&path, Options::default()).expect("the file can be judged");
    assert_eq!(failed(&report), [""; 0], "{:?}", report.checks);
    let mut json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&path).expect("reads")).expect("JSON");
    let coefficient = &mut json["radiance"][1][0];
    *coefficient = (coefficient.as_f64().expect("a number") * 1.001).into();
    std::fs::write(&path, json.to_string()).expect("writes");
    let report = verify::file(&path, Options::default()).expect("the file can be judged");
    assert!(failed(&report).iter().any(|name| name.starts_with("coefficients")), "{:?}", failed(&report));
}

#[test]
fn the_command_exits_3_on_a_wrong_value_and_0_on_a_right_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    succeed(folder, &["table", "dfg", "--size", "8", "-o", "a.ktx2"]);
    let run = succeed(folder, &["verify", "a.ktx2"]);
    assert!(run.stdout.contains("checks passed"), "{}", run.stdout);
    let mut bytes = std::fs::read(folder.join("a.ktx2")).expect("reads");
    let at = bytes.len() - 6;
    bytes[at] ^= 0x20;
    std::fs::write(folder.join("a.ktx2"), &bytes).expect("writes");
    let error = fail(folder, &["verify", "a.ktx2"], 3);
    assert!(error.contains("verification failed"), "{error}");
    // A file that cannot be read does not hide one that is wrong.
    assert_eq!(kiln(folder, &["verify", "missing.ktx2", "a.ktx2"]).code, 3);
    let json = kiln(folder, &["verify", "--json", "a.ktx2"]);
    let reports: serde_json::Value = serde_json::from_str(&json.stdout).expect("JSON");
    assert!(reports[0]["checks"].as_array().expect("checks").iter().any(|c| c["passed"] == false));
    // Truncated, and without any certificate.
    std::fs::write(folder.join("cut.ktx2"), &bytes[..bytes.len() / 2]).expect("writes");
    fail(folder, &["verify", "cut.ktx2"], 1);
    fail(folder, &["verify", "missing.ktx2"], 1);
}
