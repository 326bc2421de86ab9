//! The command: its contracts, and bad input of every kind.

use crate::support::kiln::{fail, kiln, listing, succeed};
use kiln::format::{Image, exr, ktx2};
use kiln::pack::Number;
use std::path::Path;

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder")
}

fn rows(csv: &str) -> Vec<Vec<String>> {
    csv.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn eval_at_points_repeats_the_columns_and_adds_value_error_kind() {
    let folder = folder();
    let points = "name,mu,roughness\na,0.5,0.5\nb,0.001,0.01\nc,1,1\n";
    std::fs::write(folder.path().join("p.csv"), points).expect("writes");
    let run = succeed(folder.path(), &["eval", "ggx.albedo", "--points", "p.csv"]);
    let got = rows(&run.stdout);
    assert_eq!(got[0], ["name", "mu", "roughness", "value", "error", "kind"]);
    assert_eq!(got.len(), 4);
    for row in &got[1..] {
        let (value, error): (f64, f64) = (row[3].parse().expect("a number"), row[4].parse().expect("a number"));
        assert!((0.0..=1.0).contains(&value) && error > 0.0 && error <= 1e-7 && row[5] == "bound", "{row:?}");
    }
    let last: f64 = got[3][3].parse().expect("a number");
    assert!((last - (1.0 - std::f64::consts::LN_2)).abs() <= 1e-7, "{last}");
}

#[test]
fn alpha_and_roughness_are_two_names_of_one_width() {
    let folder = folder();
    std::fs::write(folder.path().join("r.csv"), "mu,roughness\n0.3,0.4\n").expect("writes");
    std::fs::write(folder.path().join("a.csv"), "alpha,mu\n0.16,0.3\n").expect("writes");
    let value = |file: &str| -> f64 {
        let run = succeed(folder.path(), &["eval", "ggx.bias", "--points", file]);
        rows(&run.stdout)[1][2].parse().expect("a number")
    };
    assert!((value("r.csv") - value("a.csv")).abs() < 1e-14);
}

#[test]
fn eval_by_monte_carlo_says_sigma_and_depends_on_the_seed_alone() {
    let folder = folder();
    std::fs::write(folder.path().join("p.csv"), "mu,alpha\n0.3,0.4\n0.9,0.1\n").expect("writes");
    let with = |seed: &str, threads: &str| {
        let arguments = [
            "eval",
            "ggx.scale",
            "--points",
            "p.csv",
            "--integrator",
            "monte-carlo",
            "--seed",
            seed,
            "--threads",
            threads,
        ];
        succeed(folder.path(), &arguments).stdout
    };
    let first = with("1", "1");
    assert!(rows(&first)[1..].iter().all(|row| row[4] == "sigma"), "{first}");
    assert_eq!(first, with("1", "2"));
    assert_ne!(first, with("2", "2"));
}

#[test]
fn eval_at_one_point_shows_both_witnesses() {
    let folder = folder();
    let run =
        succeed(folder.path(), &["eval", "ggx.scale", "--mu", "0.5", "--roughness", "0.3", "--smith", "separable"]);
    assert!(run.stdout.contains("quadrature") && run.stdout.contains("monte-carlo"), "{}", run.stdout);
    let json = succeed(folder.path(), &["eval", "ggx.scale", "--mu", "0.5", "--alpha", "0.3", "--json"]);
    let rows: serde_json::Value = serde_json::from_str(&json.stdout).expect("JSON");
    assert_eq!((rows[0]["kind"].as_str(), rows[1]["kind"].as_str()), (Some("bound"), Some("sigma")));
}

#[test]
fn dfg_has_mu_along_x_roughness_along_y_smallest_first_at_texel_centres() {
    let folder = folder();
    succeed(folder.path(), &["table", "dfg", "--size", "8x4", "--format", "exr:f32", "-o", "dfg.exr"]);
    succeed(folder.path(), &["table", "dfg", "--size", "8x4", "--format", "ktx2:rg16f", "-o", "dfg.ktx2"]);
    let image = exr::decode(&std::fs::read(folder.path().join("dfg.exr")).expect("reads")).expect("an EXR");
    assert_eq!((image.width, image.height), (8, 4));
    let texture = ktx2::decode(&std::fs::read(folder.path().join("dfg.ktx2")).expect("reads")).expect("a KTX2");
    let (scale, bias) = (image.channel("ggx.scale").expect("scale"), image.channel("ggx.bias").expect("bias"));
    let halves = texture.face(0, 0).expect("a face");
    let mut points = "mu,roughness\n".to_owned();
    for y in 0..4 {
        for x in 0..8 {
            points += &format!("{},{}\n", (f64::from(x) + 0.5) / 8.0, (f64::from(y) + 0.5) / 4.0);
        }
    }
    std::fs::write(folder.path().join("p.csv"), points).expect("writes");
    for (quantity, values, offset) in [("ggx.scale", scale, 0), ("ggx.bias", bias, 1)] {
        let run = succeed(folder.path(), &["eval", quantity, "--points", "p.csv"]);
        for (i, row) in rows(&run.stdout)[1..].iter().enumerate() {
            let wanted: f64 = row[2].parse().expect("a number");
            assert!((f64::from(values[i]) - wanted).abs() < 2e-7, "{quantity} texel {i}: {} but {wanted}", values[i]);
            let half = f64::from(halves[2 * i + offset]);
            assert!((half - wanted).abs() <= wanted.max(1e-4) / 2048.0, "{quantity} half {i}: {half} but {wanted}");
        }
    }
}

#[test]
fn axes_can_be_warped_flipped_reordered_and_sampled_at_edges() {
    let folder = folder();
    let axes = "roughness:4:edge:flip,mu:8:sqrt:edge";
    succeed(folder.path(), &["table", "dfg", "--axes", axes, "--channels", "ggx.albedo,ggx.bias", "-o", "t.exr"]);
    let image = exr::decode(&std::fs::read(folder.path().join("t.exr")).expect("reads")).expect("an EXR");
    assert_eq!((image.width, image.height), (4, 8));
    let (albedo, bias) = (image.channel("ggx.albedo").expect("albedo"), image.channel("ggx.bias").expect("bias"));
    // x runs from roughness 1 to 0: the last column is the mirror. y runs from mu 0 to 1, even in its root.
    for y in 0..8 {
        let mu = (f64::from(y) / 7.0).powi(2);
        let at = y as usize * 4;
        assert_eq!(albedo[at + 3], 1.0, "mirror, row {y}");
        assert!((f64::from(bias[at + 3]) - (1.0 - mu).powi(5)).abs() < 1e-7, "mirror, row {y}: {}", bias[at + 3]);
        let rough = if mu == 0.0 { 1.0 } else { 1.0 - mu * (1.0 / mu).ln_1p() };
        assert!((f64::from(albedo[at]) - rough).abs() < 2e-7, "alpha 1, row {y}: {} but {rough}", albedo[at]);
    }
}

#[test]
fn three_axes_become_a_volume_layers_or_an_atlas_of_the_same_values() {
    let folder = folder();
    let bake = |more: &[&str]| {
        let axes = ["table", "dielectric", "--axes", "mu:3,alpha:4:edge,eta:5:f0-fourth-root:edge"];
        succeed(folder.path(), &[&axes[..], more].concat());
    };
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("reads");
    bake(&["--format", "ktx2:rg32f", "-o", "volume.ktx2"]);
    bake(&["-o", "layers.exr"]);
    bake(&["-o", "atlas.exr", "--layout", "atlas:2"]);
    let volume = ktx2::decode(&read("volume.ktx2")).expect("a KTX2");
    let (layers, atlas) =
        (exr::decode(&read("layers.exr")).expect("an EXR"), exr::decode(&read("atlas.exr")).expect("an EXR"));
    assert_eq!((volume.width, volume.height, volume.depth), (3, 4, 5));
    assert_eq!((layers.width, layers.height, layers.channels.len()), (3, 4, 10));
    assert_eq!((atlas.width, atlas.height), (6, 12));
    let whole = atlas.channel("dielectric.transmittance").expect("transmittance");
    for z in 0..5 {
        let slice = volume.face(0, z).expect("a slice");
        let layer = layers.channel(&format!("slice0{z}.dielectric.transmittance")).expect("a layer");
        for y in 0..4 {
            for x in 0..3 {
                let value = slice[2 * (3 * y + x) + 1];
                assert_eq!(value, layer[3 * y + x], "layer {z} at {x}, {y}");
                assert_eq!(value, whole[(z / 2 * 4 + y) * 6 + z % 2 * 3 + x], "atlas {z} at {x}, {y}");
            }
        }
        // alpha = 0 is Fresnel's, at the index that z stands for; an infinite one lets nothing through.
        let f0 = (z as f64 / 4.0).powi(4);
        let eta = (1.0 + f0.sqrt()) / (1.0 - f0.sqrt());
        for x in 0..3 {
            let mu: f64 = (x as f64 + 0.5) / 3.0;
            let g = (eta * eta - 1.0 + mu * mu).sqrt();
            let (s, p) = ((mu - g) / (mu + g), (eta * eta * mu - g) / (eta * eta * mu + g));
            let wanted = if z == 4 { 0.0 } else { 1.0 - 0.5 * (s * s + p * p) };
            assert!(
                (f64::from(slice[2 * x + 1]) - wanted).abs() < 1e-7,
                "z {z}, mu {mu}: {}, {wanted}",
                slice[2 * x + 1]
            );
        }
    }
    let verified = succeed(folder.path(), &["verify", "volume.ktx2", "layers.exr", "atlas.exr"]);
    assert!(!verified.stdout.contains("FAIL"), "{}", verified.stdout);
    assert!(succeed(folder.path(), &["info", "volume.ktx2"]).stdout.contains("3 × 4 × 5"));
    succeed(folder.path(), &["show", "volume.ktx2", "-o", "volume.png"]);
}

#[test]
fn parameters_without_an_axis_are_given_a_value_that_the_certificate_keeps() {
    let folder = folder();
    let glass = ["table", "dielectric", "--axes", "mu:4,alpha:4:0.2..1", "--eta", "1.5", "-o", "glass.exr"];
    succeed(folder.path(), &glass);
    let image = exr::decode(&std::fs::read(folder.path().join("glass.exr")).expect("reads")).expect("an EXR");
    let point = ["eval", "dielectric.reflectance", "--mu", "0.125", "--alpha", "0.3", "--eta", "1.5", "--json"];
    let run = succeed(folder.path(), &point);
    let rows: serde_json::Value = serde_json::from_str(&run.stdout).expect("JSON");
    let (got, wanted) = (image.channel("dielectric.reflectance").expect("a channel")[0], rows[0]["value"].as_f64());
    assert!((f64::from(got) - wanted.expect("a number")).abs() < 1e-6, "{got}, {wanted:?}");
    let verified = succeed(folder.path(), &["verify", "glass.exr"]).stdout;
    assert!(verified.contains("at eta 1.5"), "{verified}");
    // A named table's own value gives way to an axis and to a flag.
    let metal = ["table", "conductor-albedo", "--axes", "mu:4,alpha:4,n:2:0.2..3", "--k", "3", "-o", "metal.exr"];
    succeed(folder.path(), &metal);
    assert!(succeed(folder.path(), &["verify", "metal.exr"]).stdout.contains("at k 3 "));
}

#[test]
fn an_anisotropic_albedo_is_chosen_by_its_parameters() {
    let folder = folder();
    let eval = |more: &[&str]| {
        let run = succeed(folder.path(), &[&["eval", "ggx.albedo", "--json", "--mu", "0.4"][..], more].concat());
        serde_json::from_str::<serde_json::Value>(&run.stdout).expect("JSON")
    };
    let (wide, turned) = (
        eval(&["--phi", "0.3", "--alpha-x", "0.2", "--alpha-y", "0.7"]),
        eval(&["--phi", &(std::f64::consts::FRAC_PI_2 - 0.3).to_string(), "--alpha-x", "0.7", "--alpha-y", "0.2"]),
    );
    let (a, b) = (&wide[0], &turned[0]);
    assert_eq!((a["integrator"].as_str(), wide.as_array().map(Vec::len)), (Some("monte-carlo"), Some(1)));
    let number = |row: &serde_json::Value, key: &str| row[key].as_f64().expect("a number");
    let sigma = number(a, "error").hypot(number(b, "error"));
    assert!(
        (number(a, "value") - number(b, "value")).abs() < 5.0 * sigma,
        "a right angle exchanges the widths: {a} {b}"
    );
    assert_eq!(eval(&["--alpha", "0.4"])[0]["integrator"].as_str(), Some("quadrature"));
    let axes = ["table", "ggx-albedo", "--axes", "mu:3,alpha_x:3,alpha_y:3", "--phi", "0.5", "--samples", "4096"];
    succeed(folder.path(), &[&axes[..], &["-o", "a.ktx2"]].concat());
    assert!(succeed(folder.path(), &["verify", "a.ktx2"]).stdout.contains("isotropic where the widths agree"));
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let (one, two) = (folder(), folder());
    let recipe = r#"
        recipe = 1
        [[table]]
        file = "a.exr"
        format = "exr:f16"
        channels = ["ggx.scale", "ggx.albedo"]
        axes = ["mu:12", "roughness:12"]
        [[table]]
        file = "b.ktx2"
        format = "ktx2:r32f"
        channels = ["ggx.albedo_avg"]
        axes = ["roughness:7:edge"]
        integration = { integrator = "monte-carlo", samples = 4096 }
        [[environment]]
        input = "builtin:sun"
        directory = "sun"
        size = 16
        min_size = 4
        irradiance_size = 8
        integration = { samples = 512 }
    "#;
    for (folder, threads) in [(&one, "1"), (&two, "2")] {
        std::fs::write(folder.path().join("r.toml"), recipe).expect("writes");
        succeed(folder.path(), &["bake", "r.toml", "--out", ".", "--threads", threads]);
    }
    let names = listing(one.path());
    assert_eq!(names, listing(two.path()));
    assert!(names.len() >= 9, "{names:?}");
    for name in names.iter().filter(|n| one.path().join(n).is_file()) {
        let read = |f: &tempfile::TempDir| std::fs::read(f.path().join(name)).expect("reads");
        assert!(read(&one) == read(&two), "{name} differs");
    }
}

#[test]
fn the_printed_recipe_bakes_what_it_says() {
    let folder = folder();
    let printed = succeed(folder.path(), &["bake", "--print-recipe"]).stdout;
    assert!(printed.contains("[[table]]") && printed.contains("builtin:sky"), "{printed}");
    std::fs::write(folder.path().join("own.toml"), &printed).expect("writes");
    let again = succeed(folder.path(), &["bake", "own.toml", "--print-recipe"]).stdout;
    // Complete: nothing is left to a default that a later version could change.
    for key in ["integrator", "seed", "smith", "nonfinite", "negatives", "irradiance_size"] {
        assert!(again.contains(key), "{key} is missing in\n{again}");
    }
    std::fs::write(folder.path().join("complete.toml"), &again).expect("writes");
    assert_eq!(again, succeed(folder.path(), &["bake", "complete.toml", "--print-recipe"]).stdout);
}

#[test]
fn an_environment_has_the_asked_levels_files_and_orientation() {
    let folder = folder();
    let arguments =
        ["env", "builtin:sky", "--out", "sky", "--size", "32", "--roughness", "0,0.2,0.5,1", "--samples", "256"];
    succeed(folder.path(), &[&arguments[..], &["--format", "ktx2:rgba32f"]].concat());
    let names = listing(&folder.path().join("sky"));
    assert_eq!(names, ["certificate.json", "irradiance.ktx2", "sh.json", "specular.ktx2"]);
    let cube = ktx2::decode(&std::fs::read(folder.path().join("sky/specular.ktx2")).expect("reads")).expect("a KTX2");
    assert_eq!((cube.width, cube.faces, cube.levels.len()), (32, 6, 4));
    let mean = |face: usize| -> f32 {
        let values = cube.face(0, face).expect("a face");
        values.chunks_exact(4).map(|t| t[2]).sum::<f32>() / 1024.0
    };
    // Blue is above: +Y (face 2) is sky, −Y (face 3) is the ground; sides are half and half, sky in the upper rows.
    let side = cube.face(0, 1).expect("a face");
    let blueness = |row: usize| side[(row * 32 + 5) * 4 + 2] / side[(row * 32 + 5) * 4];
    assert!(mean(2) > mean(3) && blueness(2) > 1.2 * blueness(30), "{} {}", blueness(2), blueness(30));
    let sh: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("sky/sh.json")).expect("reads"))
            .expect("JSON");
    assert_eq!(sh["order"][1], "y");
    assert!(sh["radiance"][1][2].as_f64().expect("a number") > 0.0, "more light comes from above");
}

#[test]
fn environments_of_odd_and_tiny_sizes_bake_and_verify() {
    let folder = folder();
    for size in ["1", "2", "3", "5"] {
        let arguments =
            ["env", "builtin:sun", "--out", size, "--size", size, "--min-size", "1", "--irradiance-size", size];
        succeed(folder.path(), &[&arguments[..], &["--samples", "256"]].concat());
        succeed(folder.path(), &["verify", size]);
    }
}

#[test]
fn many_environments_are_baked_at_once_skipped_when_unchanged_and_fail_alone() {
    let folder = folder();
    panorama(folder.path(), "a.exr", 16, 8, 1.0);
    panorama(folder.path(), "b.exr", 16, 8, 2.0);
    std::fs::write(folder.path().join("broken.hdr"), "no picture").expect("writes");
    let some = ["a.exr", "broken.hdr", "b.exr", "builtin:white"];
    let all =
        [&["env"][..], &some, &["--out", "o", "--size", "8", "--min-size", "4", "--irradiance-size", "4"]].concat();
    let error = fail(folder.path(), &all, 1);
    assert!(error.contains("broken.hdr") && error.contains("1 of 4 environments failed"), "{error}");
    for name in ["a", "b", "white"] {
        assert!(folder.path().join("o").join(name).join("specular.ktx2").is_file(), "{name}");
    }
    let good: Vec<&str> = all.iter().copied().filter(|a| *a != "broken.hdr").collect();
    let again = succeed(folder.path(), &good).stderr;
    assert_eq!(again.matches("unchanged").count(), 3, "{again}");
    // Another input under the same name, another recipe, a lost file: each is baked again.
    panorama(folder.path(), "a.exr", 16, 8, 3.0);
    std::fs::remove_file(folder.path().join("o/b/sh.json")).expect("was there");
    assert_eq!(succeed(folder.path(), &good).stderr.matches("unchanged").count(), 1);
    let brighter = [&good[..], &["--exposure", "1"]].concat();
    assert!(!succeed(folder.path(), &brighter).stderr.contains("unchanged"));
    assert!(!succeed(folder.path(), &[&brighter[..], &["--force"]].concat()).stderr.contains("unchanged"));
    fail(folder.path(), &["env", "a.exr", "./a.exr", "--out", "o"], 2);
}

#[test]
fn an_environment_is_turned_calibrated_and_relieved_of_its_sun() {
    let folder = folder();
    let bake = |out: &str, more: &[&str]| {
        let small = [
            "env",
            "builtin:sun",
            "--size",
            "32",
            "--min-size",
            "8",
            "--irradiance-size",
            "8",
            "--format",
            "ktx2:rgba32f",
        ];
        succeed(folder.path(), &[&small[..], &["--out", out], more].concat())
    };
    let json = |path: &str| -> serde_json::Value {
        let text = std::fs::read_to_string(folder.path().join(path)).expect("reads");
        serde_json::from_str(&text).expect("JSON")
    };
    bake("plain", &[]);
    bake("lit", &["--illuminance", "50000", "--nits-per-unit", "100", "--rotate", "90", "--extract-sun"]);
    let sun = json("lit/sun.json");
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    // Sun and rest together light the ground with what was asked for.
    let certificate = json("lit/certificate.json");
    let up = number(&sun["direction"][1]);
    assert!(up > 0.1 && number(&sun["illuminance"]) * up < 50000.0, "{sun}");
    assert!(number(&sun["angular_diameter"]) < 1.5 && number(&sun["share"]) > 0.1, "{sun}");
    let factor = number(&certificate["input"]["adjusted"]["factor"]);
    let (with, without) = (json("plain/certificate.json"), &certificate);
    for c in 0..3 {
        let mean = |v: &serde_json::Value| number(&v["input"]["mean"][c]) * 4.0 * std::f64::consts::PI;
        let missing = (mean(without) + number(&sun["irradiance"][c])) / (mean(&with) * factor) - 1.0;
        assert!(missing.abs() < 1e-6, "channel {c}: {missing:e} of the energy");
    }
    assert!(succeed(folder.path(), &["verify", "lit"]).stdout.contains("direction extracted again"));
    let text = std::fs::read_to_string(folder.path().join("lit/sun.json")).expect("reads");
    std::fs::write(folder.path().join("lit/sun.json"), text.replacen("\"share\": 0", "\"share\": 1", 1))
        .expect("writes");
    fail_verification(folder.path(), "lit/sun.json");
    let info = succeed(folder.path(), &["info", "plain/specular.ktx2"]);
    assert!(info.stdout.contains("KTX2"), "{}", info.stdout);
    for bad in
        [["--scale", "0"], ["--illuminance", "-5"], ["--exposure", "nan"], ["--clamp", "inf"], ["--efficacy", "0"]]
    {
        fail(folder.path(), &[&["env", "builtin:sun", "--out", "bad"][..], &bad].concat(), 2);
    }
}

/// Verification finds a fault.
fn fail_verification(folder: &Path, file: &str) {
    let run = kiln(folder, &["verify", file]);
    assert_eq!(run.code, 3, "{}{}", run.stdout, run.stderr);
}

#[test]
fn values_beyond_a_half_float_are_clamped_counted_and_warned_of() {
    let folder = folder();
    let arguments = ["env", "builtin:sky", "--out", "o", "--size", "64", "--roughness", "0", "--irradiance-size", "4"];
    let run = succeed(folder.path(), &[&arguments[..], &["--samples", "64"]].concat());
    assert!(run.stderr.contains("warning") && run.stderr.contains("65504"), "{}", run.stderr);
    let text = std::fs::read_to_string(folder.path().join("o/certificate.json")).expect("reads");
    let certificate: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert!(certificate["packing"]["overflowed"].as_u64().expect("a number") > 0);
    succeed(folder.path(), &["verify", "o"]);
    let quiet = succeed(folder.path(), &[&arguments[..], &["--samples", "64", "--quiet"]].concat());
    assert_eq!(quiet.stderr, "");
}

/// Writes an EXR panorama whose texel 3 holds `value`.
fn panorama(folder: &Path, name: &str, width: usize, height: usize, value: f32) {
    let mut texels = vec![0.5_f32; width * height * 3];
    if let Some(texel) = texels.get_mut(9) {
        *texel = value;
    }
    let image = Image::new(width, height, &["B", "G", "R"], texels).expect("a shape");
    std::fs::write(folder.join(name), exr::encode(&image, Number::F32).expect("encodes").0).expect("writes");
}

#[test]
fn nonfinite_and_negative_inputs_are_counted_and_follow_the_policy() {
    let folder = folder();
    panorama(folder.path(), "nan.exr", 16, 8, f32::NAN);
    panorama(folder.path(), "inf.exr", 16, 8, f32::INFINITY);
    panorama(folder.path(), "negative.exr", 16, 8, -2.0);
    let small = ["--out", "o", "--size", "8", "--min-size", "4", "--irradiance-size", "4", "--samples", "256"];
    let with = |input: &'static str, more: &[&'static str]| [&["env", input][..], &small, more].concat();
    for input in ["nan.exr", "inf.exr"] {
        let error = fail(folder.path(), &with(input, &[]), 1);
        assert!(error.contains(input) && error.contains("--nonfinite zero"), "{error}");
        let run = succeed(folder.path(), &with(input, &["--nonfinite", "zero"]));
        assert!(run.stderr.contains("1 values were not finite"), "{}", run.stderr);
    }
    let kept = succeed(folder.path(), &with("negative.exr", &[]));
    assert!(kept.stderr.contains("1 values were below zero (down to -2)"), "{}", kept.stderr);
    succeed(folder.path(), &["verify", "o"]);
    succeed(folder.path(), &with("negative.exr", &["--negatives", "clamp"]));
    succeed(folder.path(), &["verify", "o"]);
}

#[test]
fn bad_requests_fail_with_usage_and_leave_nothing() {
    let folder = folder();
    let env = |more: &[&'static str]| [&["env", "builtin:white", "--out", "o"][..], more].concat();
    let table = |more: &[&'static str]| [&["table", "dfg"][..], more].concat();
    let requests: Vec<Vec<&str>> = vec![
        table(&["--size", "0", "-o", "x.exr"]),
        table(&["--size", "64x0", "-o", "x.exr"]),
        table(&["--size", "1000000", "-o", "x.exr"]),
        table(&["--size", "16384x16384", "-o", "x.exr"]),
        table(&["--size", "64x64x64", "-o", "x.exr"]),
        table(&["--size", "8", "--layout", "atlas", "-o", "x.exr"]),
        table(&["--size", "8", "--eta", "1.5", "-o", "x.exr"]),
        table(&["--size", "8", "--mu", "0.5", "-o", "x.exr"]),
        table(&["--axes", "mu:4:0.5..0.2,roughness:4", "-o", "x.exr"]),
        table(&["--axes", "mu:4:log,roughness:4", "-o", "x.exr"]),
        vec!["table", "dielectric", "--size", "4", "--layout", "volume", "-o", "x.exr"],
        vec!["table", "dielectric", "--size", "4", "--layout", "pile", "-o", "x.exr"],
        vec!["table", "dielectric", "--axes", "mu:4,alpha:4,eta:4", "-o", "x.exr"],
        vec!["table", "dielectric", "--axes", "mu:4,alpha:4", "-o", "x.exr"],
        vec!["table", "dielectric", "--axes", "mu:4,alpha:4,eta:4:1..2,f0:4", "-o", "x.exr"],
        table(&["--size", "many", "-o", "x.exr"]),
        table(&["--size", "8", "-o", "x.bin"]),
        table(&["--size", "8", "-o", "x.exr", "--format", "ktx2:rg16f"]),
        table(&["--size", "8", "-o", "x.ktx2", "--format", "ktx2:rg8"]),
        table(&["--size", "8", "-o", "x.ktx2", "--format", "ktx2:r16f"]),
        table(&["--size", "8", "--axes", "mu:4,roughness:4", "-o", "x.exr"]),
        table(&["--axes", "mu:4", "-o", "x.exr"]),
        table(&["--axes", "mu:4,mu:4", "-o", "x.exr"]),
        table(&["--axes", "alpha:4,roughness:4", "-o", "x.exr"]),
        table(&["--axes", "mu:1:edge,roughness:4", "-o", "x.exr"]),
        table(&["--axes", "mu:4:cubic,roughness:4", "-o", "x.exr"]),
        table(&["--channels", "ggx.scale,ggx.scale", "-o", "x.exr"]),
        table(&["--channels", "ggx.scales", "-o", "x.exr"]),
        table(&["--size", "8", "-o", "x.exr", "--tolerance", "-1"]),
        table(&["--size", "8", "-o", "x.exr", "--tolerance", "nan"]),
        table(&["--size", "8", "-o", "x.exr", "--samples", "0", "--integrator", "monte-carlo"]),
        table(&["--size", "8", "-o", "x.exr", "--samples", "64", "--integrator", "quadrature"]),
        table(&["--size", "8", "-o", "x.exr", "--samples", "64", "--tolerance", "1e-3"]),
        table(&["--size", "8", "-o", "x.exr", "--smith", "height"]),
        table(&["--size", "8", "-o", "x.exr", "--threads", "0"]),
        vec!["table", "dgf", "-o", "x.exr"],
        vec!["eval", "ggx.scale", "--mu", "1.5", "--alpha", "0.1"],
        vec!["eval", "ggx.scale", "--mu", "0.5", "--alpha", "nan"],
        vec!["eval", "ggx.scale", "--mu", "0.5"],
        vec!["eval", "ggx.scale", "--mu", "0.5", "--alpha", "0.1", "--roughness", "0.1"],
        env(&["--size", "0"]),
        env(&["--size", "100000"]),
        env(&["--size", "8", "--min-size", "16"]),
        env(&["--size", "8", "--roughness", "0,0.5,1,1,1,1"]),
        env(&["--size", "8", "--roughness", "0,2"]),
        env(&["--size", "8", "--roughness", "0,1", "--min-size", "4"]),
        env(&["--size", "8", "--format", "exr:f32"]),
        env(&["--size", "8", "--format", "ktx2:rg16f"]),
        vec!["env", "builtin:snow", "--out", "o"],
        vec!["nonsense"],
        vec!["verify"],
    ];
    for request in requests {
        fail(folder.path(), &request, 2);
        let left: Vec<String> = listing(folder.path()).into_iter().filter(|n| n != "o").collect();
        assert_eq!(left, [""; 0], "{request:?} left something");
    }
}

#[test]
fn a_tolerance_out_of_reach_stops_with_the_place_the_best_value_and_its_error() {
    let folder = folder();
    for arguments in [
        &["eval", "ggx.scale", "--mu", "0.5", "--alpha", "0.25", "--tolerance", "1e-20"][..],
        &["table", "dfg", "--size", "4", "-o", "x.exr", "--tolerance", "1e-20"],
        &["table", "charlie-albedo", "--size", "4", "-o", "x.ktx2", "--tolerance", "1e-20"],
        &["table", "dielectric-avg", "--size", "2", "-o", "x.ktx2", "--tolerance", "1e-20"],
    ] {
        let text = fail(folder.path(), arguments, 1);
        assert!(text.contains("did not reach tolerance 1e-20: the best value is "), "{arguments:?}: {text}");
        assert!(text.contains("with an error of ") && text.contains("use --tolerance "), "{arguments:?}: {text}");
        assert!(text.contains(" at mu ") || text.contains(" at roughness "), "{arguments:?}: {text}");
    }
    assert!(listing(folder.path()).is_empty());
}

#[test]
fn mistyped_names_are_told_what_is_near_and_values_out_of_a_domain_what_it_is() {
    let folder = folder();
    let at = ["--mu", "0.5", "--alpha", "0.5"];
    for (arguments, said) in [
        (&["eval", "ggx.albdo"][..], "did you mean ggx.albedo? see `kiln list quantities`"),
        (&["eval", "compensations.*"], "did you mean compensation."),
        (&["table", "dgf", "-o", "x.exr"], "did you mean dfg? see `kiln list tables`"),
        (&["table", "dfg", "-o", "x.exr", "--channels", "ggx.skale"], "did you mean ggx.scale?"),
        (&["eval", "ggx.scale", "--mu", "1.5", "--alpha", "0.5"], "mu 1.5 is outside its domain [0, 1]"),
        (&["eval", "ggx.scale", "--mu", "nan", "--alpha", "0.5"], "mu NaN is outside its domain [0, 1]"),
        (&["eval", "dielectric.albedo", "--eta", "-1"], "eta -1 is outside its domain"),
        (&["table", "dfg", "-o", "x.exr", "--axes", "mu:8:0..2,alpha:8"], "leaves its domain [0, 1]"),
        (&["table", "conductor-albedo", "-o", "x.exr", "--n", "100"], "n 100 is outside its domain [0.01, 20]"),
        (&["eval", "dielectric.albedo", "--eta", "1.5", "--smith", "schlick-ibl"], "is made for reflection"),
    ] {
        let missing = arguments[0] == "eval" && !arguments.contains(&"--mu");
        let arguments: Vec<&str> = arguments.iter().copied().chain(at.into_iter().filter(|_| missing)).collect();
        let text = fail(folder.path(), &arguments, 2);
        assert!(text.contains(said), "{arguments:?}: {text}");
    }
}

#[test]
fn bad_files_fail_with_one_and_leave_nothing() {
    let folder = folder();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).expect("writes");
    panorama(folder.path(), "small.exr", 2, 1, 0.5);
    panorama(folder.path(), "whole.exr", 16, 8, 0.5);
    let whole = std::fs::read(folder.path().join("whole.exr")).expect("reads");
    write("cut.exr", &whole[..whole.len() / 2]);
    write("empty.hdr", b"");
    write("text.hdr", b"this is not a panorama\n");
    write("picture.hdr", b"\x89PNG\r\n\x1a\n0000IHDR");
    write("lying.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 200000\n\x02\x02");
    write("points.csv", b"mu,roughness\n0.5,much\n");
    write("outside.csv", b"mu,roughness\n0.5,1.5\n");
    write("headless.csv", b"0.5,0.5\n");
    write("both.csv", b"mu,alpha,roughness\n0.5,0.5,0.5\n");
    write("broken.toml", b"recipe = 1\n[[table]\n");
    write("unknown.toml", b"recipe = 1\ncolour = 3\n");
    write("future.toml", b"recipe = 99\n[[environment]]\ninput = \"builtin:white\"\n");
    let before = listing(folder.path());
    let mut requests: Vec<Vec<&str>> = vec![];
    for input in ["small.exr", "cut.exr", "empty.hdr", "text.hdr", "picture.hdr", "lying.hdr", "missing.hdr", "."] {
        requests.push(vec!["env", input, "--out", "o", "--size", "8", "--min-size", "4"]);
        requests.push(vec!["info", input]);
    }
    requests.retain(|r| !(r[0] == "info" && r[1] == "small.exr")); // two texels are no panorama, but a picture
    for points in ["points.csv", "outside.csv", "headless.csv", "both.csv", "missing.csv"] {
        requests.push(vec!["eval", "ggx.scale", "--points", points]);
    }
    for recipe in ["broken.toml", "unknown.toml", "future.toml", "missing.toml"] {
        requests.push(vec!["bake", recipe, "--out", "o"]);
    }
    requests.push(vec!["verify", "whole.exr"]);
    for request in requests {
        fail(folder.path(), &request, 1);
        let left: Vec<String> = listing(folder.path()).into_iter().filter(|n| n != "o").collect();
        assert_eq!(left, before, "{request:?} left something");
    }
}

#[test]
fn recipes_cannot_write_outside_the_output_folder_or_twice_to_one_file() {
    let folder = folder();
    let table = |file: &str| {
        format!(
            "[[table]]\nfile = \"{file}\"\nformat = \"exr:f32\"\nchannels = [\"ggx.albedo_avg\"]\naxes = [\"roughness:4\"]\n"
        )
    };
    for (text, part) in [
        (table("../escape.exr"), "leads out"),
        (table("/tmp/escape.exr"), "leads out"),
        (table("a.exr") + &table("a.exr"), "two entries"),
    ] {
        std::fs::write(folder.path().join("r.toml"), format!("recipe = 1\n{text}")).expect("writes");
        let error = fail(folder.path(), &["bake", "r.toml", "--out", "o"], 2);
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn an_output_that_cannot_be_written_leaves_nothing_half_written() {
    let folder = folder();
    std::fs::write(folder.path().join("file"), "in the way").expect("writes");
    fail(folder.path(), &["table", "dfg", "--size", "4", "-o", "file/dfg.exr"], 1);
    fail(folder.path(), &["env", "builtin:white", "--out", "file", "--size", "4", "--min-size", "4"], 1);
    fail(folder.path(), &["bake", "--out", "file"], 1);
    std::fs::create_dir(folder.path().join("dfg.exr")).expect("a folder");
    fail(folder.path(), &["table", "dfg", "--size", "4", "-o", "dfg.exr"], 1);
    assert_eq!(listing(folder.path()), ["dfg.exr", "file"]);
}

#[test]
fn an_interrupted_run_leaves_nothing_under_a_final_name() {
    let folder = folder();
    for milliseconds in [0, 100, 300] {
        let mut run = std::process::Command::new(env!("CARGO_BIN_EXE_kiln"))
            .args(["env", "builtin:sky", "--out", "o", "--size", "128", "--samples", "16384"])
            .current_dir(folder.path())
            .stderr(std::process::Stdio::null())
            .spawn()
            .expect("kiln starts");
        std::thread::sleep(std::time::Duration::from_millis(milliseconds));
        run.kill().expect("still running");
        run.wait().expect("ends");
        let finals: Vec<String> =
            listing(folder.path()).into_iter().filter(|n| n.ends_with(".ktx2") || n.ends_with(".json")).collect();
        assert_eq!(finals, [""; 0]);
    }
}

#[test]
fn listings_name_what_can_be_asked_for() {
    let folder = folder();
    for (what, part) in [
        ("tables", "dfg"),
        ("quantities", "ggx.albedo_avg"),
        ("formats", "ktx2:rgba16f"),
        ("environments", "builtin:sky"),
    ] {
        assert!(succeed(folder.path(), &["list", what]).stdout.contains(part), "{what}");
        let json = succeed(folder.path(), &["list", what, "--json"]).stdout;
        let rows: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        assert!(rows.as_array().is_some_and(|rows| !rows.is_empty()), "{json}");
    }
}

#[test]
fn info_and_show_read_what_kiln_writes() {
    let folder = folder();
    succeed(folder.path(), &["table", "dfg", "--size", "8", "-o", "dfg.exr"]);
    succeed(folder.path(), &["table", "ggx-albedo-avg", "-o", "avg.ktx2"]);
    succeed(
        folder.path(),
        &["env", "builtin:gradient", "--out", ".", "--size", "16", "--min-size", "8", "--samples", "64"],
    );
    let info = succeed(folder.path(), &["info", "dfg.exr", "avg.ktx2", "specular.ktx2"]).stdout;
    for part in ["8 × 8", "ggx.scale", "KTX2 r16f", "6 faces", "2 levels", "0 failed"] {
        assert!(info.contains(part), "{part} is missing in\n{info}");
    }
    for file in ["dfg.exr", "avg.ktx2", "specular.ktx2"] {
        succeed(folder.path(), &["show", file, "-o", "preview.png"]);
        let preview = std::fs::read(folder.path().join("preview.png")).expect("reads");
        assert!(preview.starts_with(b"\x89PNG"), "{file}");
    }
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let folder = folder();
    let quiet = kiln(folder.path(), &["list", "quantities"]);
    assert_eq!((quiet.code, quiet.stderr.as_str()), (0, ""));
}

/// The verbs that `kiln --help` lists.
fn verbs(folder: &Path) -> Vec<String> {
    let help = succeed(folder, &["--help"]).stdout;
    let listed =
        help.lines().skip_while(|line| !line.starts_with("Commands:")).skip(1).take_while(|line| !line.is_empty());
    // A summary that is too long goes on below itself.
    listed
        .filter_map(|line| {
            line.strip_prefix("  ").filter(|l| !l.starts_with(' '))?.split(' ').next().map(str::to_owned)
        })
        .collect()
}

#[test]
fn every_verb_is_in_the_completions_of_every_shell_and_in_the_manual() {
    let folder = folder();
    let verbs = verbs(folder.path());
    assert!(verbs.len() >= 10 && verbs.iter().any(|verb| verb == "table"), "{verbs:?}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = succeed(folder.path(), &["completions", shell]).stdout;
        for word in verbs.iter().map(String::as_str).chain(["roughness", "smith"]) {
            assert!(script.contains(word), "{shell} does not complete {word}");
        }
        // The generators for the other shells do not complete values.
        let completes_values = ["bash", "zsh", "fish"].contains(&shell);
        assert!(script.contains("correlated") || !completes_values, "{shell} does not complete the values of --smith");
    }
    succeed(folder.path(), &["man", "pages/man1"]);
    let mut pages = listing(&folder.path().join("pages/man1"));
    let mut wanted: Vec<String> = verbs.iter().filter(|verb| *verb != "help").map(|v| format!("kiln-{v}.1")).collect();
    wanted.push("kiln.1".to_owned());
    wanted.sort();
    pages.sort();
    assert_eq!(pages, wanted);
    let page = |name: &str| std::fs::read_to_string(folder.path().join("pages/man1").join(name)).expect("a page");
    assert_eq!(page("kiln.1"), succeed(folder.path(), &["man"]).stdout);
    for name in &wanted {
        assert!(page(name).contains("\n.TH "), "{name} is no roff");
    }
    assert!(page("kiln-table.1").contains("\\-\\-axes"), "{}", page("kiln-table.1"));
}

#[test]
fn completions_that_bash_would_read_are_a_script_that_bash_accepts() {
    let folder = folder();
    let script = succeed(folder.path(), &["completions", "bash"]).stdout;
    std::fs::write(folder.path().join("kiln.bash"), script).expect("a script");
    let mut bash = std::process::Command::new("bash");
    match bash.args(["-c", "source ./kiln.bash && complete -p kiln"]).current_dir(folder.path()).output() {
        Ok(output) => {
            let said = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success() && said.contains("-F _kiln kiln"), "bash does not accept it: {said}");
        }
        Err(e) => assert!(std::env::var_os("KILN_REQUIRE_TOOLS").is_none(), "no bash: {e}"),
    }
}
