//! Presets of engines: that each can be baked and verified, and that what it says agrees with the engine's own formulas.

#[cfg(unix)]
use crate::support::kiln::shell;
use crate::support::kiln::{fail, kiln, listing, succeed};
use glam::DVec3;
use kiln::bake::{self, Baked, ShFile};
use kiln::engine::{self, ENGINES, Engine, RoughnessMap};
use kiln::environment::chain::LEAST_SHEEN;
use kiln::environment::cube::{face_point, nearest_texel};
use kiln::environment::{Cube, KernelKind, Orientation, ShConvention, SphereLayout, spherical_harmonics};
use kiln::format::{Decoded, decode};
use kiln::recipe::{IrradianceKind, Recipe};
use kiln::table::{Axis, Sampling};
use kiln::verify::{self, Options};
use std::collections::HashSet;
use std::path::Path;

/// Small enough to be baked in a moment, large enough for every layout.
const AXIS: usize = 3;
const CUBE: usize = 16;

/// Whether each texel is a fit, which takes its time.
fn is_fit(channels: &[String]) -> bool {
    channels.iter().any(|channel| channel.starts_with("ltc"))
}

/// Whether each texel is an average over a glass, which takes its time as well.
fn is_average_of_glass(channels: &[String]) -> bool {
    channels.iter().any(|channel| channel.starts_with("dielectric.albedo_avg"))
}

/// The preset with small tables and cubes.
fn small(engine: &'static Engine, input: &str, as_shipped: bool) -> Recipe {
    let mut recipe = engine::recipe(&[engine], &[input.to_owned()], as_shipped).expect("a preset");
    for table in &mut recipe.tables {
        let is_slow = table.axes.len() == 3 || is_fit(&table.channels) || is_average_of_glass(&table.channels);
        let size = if is_slow { AXIS - 1 } else { AXIS };
        table.axes.iter_mut().for_each(|axis| axis.size = size);
    }
    for layer in recipe.arrays.iter_mut().flat_map(|array| &mut array.layers) {
        layer.axes.iter_mut().for_each(|axis| axis.size = AXIS - 1);
    }
    for environment in &mut recipe.environments {
        let preset = engine.environment.as_ref().expect("an environment");
        // An atlas has one size.
        if environment.layout == SphereLayout::Atlas {
            continue;
        }
        (environment.size, environment.irradiance_size) = (CUBE, CUBE / 2);
        // A sheen has no mirror.
        let least = if environment.kernel == KernelKind::Charlie { LEAST_SHEEN } else { 0.0 };
        let roughness = preset.level_roughness(CUBE, as_shipped);
        environment.roughness = Some(roughness.into_iter().map(|r| r.max(least)).collect());
    }
    recipe
}

fn bake_all(recipe: &Recipe, folder: &Path) -> Vec<Baked> {
    let mut baked = vec![];
    for table in &recipe.tables {
        baked.push(bake::table(table, &|_| {}).unwrap_or_else(|e| panic!("{}: {e}", table.file)));
    }
    for array in &recipe.arrays {
        let made = bake::array(array, &|_| {}).unwrap_or_else(|e| panic!("{}: {e}", array.file));
        made.write(folder).expect("a folder");
    }
    for environment in &recipe.environments {
        let source = bake::source(environment).expect("an input");
        let made = bake::environment(environment, &source, &|_| {});
        baked.push(made.unwrap_or_else(|e| panic!("{}: {e}", environment.directory)));
    }
    for b in &baked {
        b.write(folder).expect("a folder");
    }
    baked
}

/// The same with one texel of the fits that are already in `known`, whatever their order and file; others join these.
fn with_few_fits(mut recipe: Recipe, known: &mut HashSet<Vec<String>>) -> Recipe {
    let tables = recipe.tables.iter_mut().map(|table| (&table.channels, &mut table.axes));
    let layers = recipe.arrays.iter_mut().flat_map(|array| &mut array.layers);
    for (channels, axes) in tables.chain(layers.map(|layer| (&layer.channels, &mut layer.axes))) {
        let mut channels = channels.clone();
        channels.sort();
        if is_fit(&channels) && !known.insert(channels) {
            // (One texel sits at no edge.)
            axes.iter_mut().for_each(|axis| (axis.size, axis.sampling) = (1, Sampling::Centre));
        }
    }
    recipe
}

#[test]
fn every_preset_bakes_and_verifies() {
    let mut known = HashSet::new();
    for engine in ENGINES {
        let folder = tempfile::tempdir().expect("a folder");
        // A constant is filtered in a moment; what filters do to others is judged elsewhere.
        bake_all(&with_few_fits(small(engine, "builtin:white", false), &mut known), folder.path());
        let files = verify::files_of(folder.path()).expect("certificates");
        assert!(!files.is_empty(), "{}", engine.name);
        for file in files {
            let report = verify::file(&file, Options::default()).unwrap_or_else(|e| panic!("{}: {e}", engine.name));
            let failed: Vec<_> = report.checks.iter().filter(|c| !c.passed).collect();
            assert!(failed.is_empty() && !report.checks.is_empty(), "{}: {failed:?}", file.display());
        }
    }
}

/// The lookup vector of each engine's shader for a direction of its own world, and what that direction is in Kiln's world (right-handed,
/// +Y up), as the sources have it: handedness and the axis that is up.
fn shader(engine: &str, world: DVec3) -> Option<(DVec3, DVec3)> {
    let DVec3 { x, y, z } = world;
    Some(match engine {
        // Right-handed, +Y up, looked up as it is.
        "filament" | "gltf" | "godot" => (world, world),
        // u = 1/2 + atan2(x, -z)/2π, where a panorama of Kiln's has u = 1/2 + atan2(z, x)/2π.
        "materialx" => (DVec3::new(-z, y, x), world),
        // Right-handed, +Y up, X negated before the lookup.
        "threejs" => (DVec3::new(-x, y, z), world),
        // X negated, then u = 1/2 + atan2(x, z)/2π.
        "playcanvas" => (DVec3::new(z, y, -x), world),
        "bevy" => (DVec3::new(x, y, -z), world),
        // Right-handed, +Z up.
        "o3de" => (DVec3::new(-x, z, -y), DVec3::new(x, z, -y)),
        // Left-handed, +Y up: a right-handed scene is imported by negating X, or Z.
        "babylon" | "unity-hdrp" => (world, DVec3::new(-x, y, z)),
        "wicked" => (world, DVec3::new(x, y, -z)),
        // Left-handed, +Z up.
        "unreal" => (world, DVec3::new(x, z, y)),
        _ => return None,
    })
}

#[test]
fn every_engines_lookup_finds_the_world_the_right_way_round() {
    let mut seen = 0;
    for engine in ENGINES {
        let Some(preset) = &engine.environment else { continue };
        let orientation = preset.orientation().expect("an orientation");
        for world in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.3, -0.5, 0.8)] {
            let (lookup, wanted) =
                shader(engine.name, world).unwrap_or_else(|| panic!("{} has no shader", engine.name));
            assert_eq!(orientation.world(lookup), wanted, "{} looks up {lookup} for {world}", engine.name);
        }
        seen += 1;
    }
    assert_eq!(seen, 12);
}

#[test]
fn a_baked_cube_holds_on_each_face_what_the_triples_say() {
    // Two turned cubes, one of them by exchanged axes; the turning itself has its own tests.
    for engine in ["bevy", "unreal"].map(|name| engine::find(name).expect("an engine")) {
        let mut recipe = small(engine, "builtin:orientation", false);
        recipe.tables.clear();
        let environment = &recipe.environments[0];
        let source = bake::source(environment).expect("an input");
        let baked = bake::environment(environment, &source, &|_| {}).expect("a bake");
        let Ok(Decoded::Texture(texture)) = decode(&baked.files[0].1) else { panic!("{}: no texture", engine.name) };
        let faces = environment.orientation.faces();
        // The same without turning, in floats: what the world looks like.
        let world = kiln::environment::area_average(&source.panorama, CUBE);
        for (face, triple) in faces.iter().enumerate() {
            let values = texture.face(0, face).expect("a face");
            let n = texture.format.channels();
            for (u, v) in [(0.5, -0.25), (-0.5, 0.75), (0.0, 0.0)] {
                let term = |text: &str| match text {
                    "1" => 1.0,
                    "-1" => -1.0,
                    "u" => u,
                    "-u" => -u,
                    "v" => v,
                    _ => -v,
                };
                let direction = DVec3::from(triple.map(term));
                // Not on an edge between texels.
                let (u, v) = (u + 0.01, v + 0.01);
                let direction = direction
                    + DVec3::from(triple.map(|text| match text {
                        "u" | "v" => 0.01,
                        "-u" | "-v" => -0.01,
                        _ => 0.0,
                    }));
                let texel = nearest_texel(CUBE, face_point(face, u, v)) % (CUBE * CUBE);
                let wanted = world.nearest(direction);
                for c in 0..3 {
                    let got = values[texel * n + c];
                    // BC6H is the coarsest: a part of the brightest of its block.
                    assert!(
                        (got - wanted[c]).abs() < 0.08,
                        "{} face {face} at {u}, {v}: {got} {}",
                        engine.name,
                        wanted[c]
                    );
                }
            }
        }
    }
}

/// The roughness to level formulas of conventions, written out again from the sources.
fn level_in_shader(engine: &str, r: f64, levels: usize, width: usize) -> f64 {
    let last = (levels - 1) as f64;
    let level = match engine {
        "filament" | "threejs" => last * r * (2.0 - r),
        "bevy" | "godot" | "gltf" => r * last,
        "babylon" => (width as f64 * (r * r + 0.0005)).log2() * 0.8,
        "o3de" | "playcanvas" => r * 5.0,
        "unity-hdrp" => 6.0 * r * (1.7 - 0.7 * r),
        "wicked" => r * levels as f64,
        "materialx" => {
            let alpha = r * r;
            last * if alpha < 0.25 { alpha.sqrt() } else { 0.5 * alpha + 0.375 }
        }
        "unreal" => last - (1.0 - 1.2 * r.log2()),
        other => panic!("{other}: no formula"),
    };
    level.clamp(0.0, last)
}

#[test]
fn every_level_is_filled_for_the_roughness_at_which_the_shader_reads_it() {
    for engine in ENGINES {
        let Some(preset) = &engine.environment else { continue };
        for size in [preset.size, 64] {
            let roughness = preset.level_roughness(size, false);
            assert_eq!(roughness[0], 0.0, "{}: level 0 is the mirror", engine.name);
            for (level, &r) in roughness.iter().enumerate() {
                let read = level_in_shader(engine.name, r, roughness.len(), size);
                let named = preset.roughness.level(r, roughness.len(), size);
                assert!((read - named).abs() < 1e-12, "{} at {r}: {read} {named}", engine.name);
                // At r = 1 the shader goes no further; and level 0 may be left late.
                let beyond = r == 1.0 && read <= level as f64 + 1e-9;
                assert!(
                    (read - level as f64).abs() < 1e-9 || beyond,
                    "{} level {level} of {size}: {read}",
                    engine.name
                );
            }
        }
    }
}

#[test]
fn as_shipped_is_the_right_table_shifted_by_one_texel() {
    let filament = engine::find("filament").expect("an engine");
    let bake = |as_shipped: bool| {
        let mut recipe = small(filament, "builtin:white", as_shipped);
        recipe.tables[0].format = "exr:f32".parse().expect("a format");
        recipe.tables[0].file = "dfg.exr".to_owned();
        let baked = bake::table(&recipe.tables[0], &|_| {}).expect("a bake");
        let Ok(Decoded::Picture(image, _)) = decode(&baked.files[0].1) else { panic!("no picture") };
        image
    };
    let (right, shipped) = (bake(false), bake(true));
    for name in ["ggx.bias", "ggx.albedo", "charlie.albedo"] {
        let [right, shipped] = [&right, &shipped].map(|image| image.channel(name).expect("a channel"));
        let rows = AXIS - 1;
        assert_eq!(shipped[..rows * AXIS], right[AXIS..], "{name}: one row further");
        assert_ne!(shipped[rows * AXIS..], right[rows * AXIS..], "{name}: the last row is at the end of the range");
    }
    let shipped = &small(filament, "builtin:white", true).tables[0];
    assert_eq!((shipped.axes[1].shift, shipped.axes[1].value(AXIS - 1)), (1.0, 1.0));
}

#[test]
fn as_shipped_environments_are_filled_as_the_engines_bakers_fill_them() {
    let levels = |name: &str| {
        let preset = engine::find(name).expect("an engine").environment.as_ref().expect("an environment");
        [false, true].map(|as_shipped| preset.level_roughness(preset.size, as_shipped))
    };
    let [right, shipped] = levels("playcanvas");
    assert_eq!((right[5], (shipped[5] * 11.0).round()), (1.0, 10.0));
    let [right, shipped] = levels("wicked");
    assert_eq!((right[8], shipped[8]), (8.0 / 9.0, 1.0));
    let [right, shipped] = levels("bevy");
    assert_eq!(right, shipped, "nothing is known to be wrong");
}

#[test]
fn unitys_diffuse_channel_is_disneys_by_its_factor_less_a_half() {
    let unity = engine::find("unity-hdrp").expect("an engine");
    let recipe = &small(unity, "builtin:white", false).tables[0];
    let baked = bake::table(recipe, &|_| {}).expect("a bake");
    let Ok(Decoded::Picture(image, _)) = decode(&baked.files[0].1) else { panic!("no picture") };
    let z = image.channel("burley.albedo:/1.03571:-0.5").expect("the third channel");
    // At roughness 0, F90 = 1/2 + 0: (1 − s/2 (1 − μ)⁵) with the average of the other side, 1 − 1/42.
    let (mu, axis) = (recipe.axes[0].value(AXIS - 1), &recipe.axes[0]);
    assert_eq!((axis.sampling, axis.value(0)), (Sampling::Edge, 0.0));
    let wanted = (1.0 - 0.5 * (1.0 - mu).powi(5)) * (1.0 - 1.0 / 42.0) / 1.03571 - 0.5;
    // A half near 1/2 is exact to 2⁻¹².
    assert!((f64::from(z[AXIS - 1]) - wanted).abs() < 2.5e-4, "{} {wanted}", z[AXIS - 1]);
}

#[test]
fn filaments_file_carries_its_coefficients_and_they_render_kilns_irradiance() {
    let recipe = small(engine::find("filament").expect("an engine"), "builtin:sky", false);
    let environment = &recipe.environments[0];
    let source = bake::source(environment).expect("an input");
    let baked = bake::environment(environment, &source, &|_| {}).expect("a bake");
    let Ok(Decoded::Texture(texture)) = decode(&baked.files[0].1) else { panic!("no texture") };
    let text = texture.metadata("sh").expect("sh metadata");
    let numbers: Vec<f64> = text.split_whitespace().map(|n| n.parse().expect("a number")).collect();
    assert_eq!((numbers.len(), text.lines().count()), (27, 9));
    let harmonics = spherical_harmonics::project(&source.panorama);
    for d in [DVec3::X, DVec3::NEG_Y, DVec3::new(0.6, 0.0, -0.8), DVec3::new(0.48, -0.6, 0.64)] {
        let DVec3 { x, y, z } = d;
        let factors = [1.0, y, z, x, y * x, y * z, 3.0 * z * z - 1.0, z * x, x * x - y * y];
        let wanted = spherical_harmonics::evaluate(&harmonics.irradiance_over_pi_nonnegative, d);
        for c in 0..3 {
            let got: f64 = (0..9).map(|i| numbers[3 * i + c] * factors[i]).sum();
            // Nine numbers of single precision, of the size of the largest.
            let largest = numbers.iter().fold(0.0_f64, |m, n| m.max(n.abs()));
            assert!((got - wanted[c]).abs() < 9.0 * 6e-8 * largest * 3.0, "{d} {c}: {got} {}", wanted[c]);
        }
    }
    let sh: ShFile = serde_json::from_slice(&baked.files[1].1).expect("sh.json");
    let own = sh.engine.expect("an engine's coefficients");
    assert_eq!(own.convention, ShConvention::Filament);
    assert_eq!(own.coefficients[0][0] as f32, numbers[0] as f32);
}

#[test]
fn the_list_for_programs_has_the_shape_that_was_agreed() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = succeed(folder.path(), &["list", "engines", "--json"]);
    let engines: serde_json::Value = serde_json::from_str(&run.stdout).expect("JSON");
    let engines = engines.as_array().expect("a list");
    assert_eq!(engines.len(), ENGINES.len());
    for engine in engines {
        let name = engine["name"].as_str().expect("a name");
        for file in engine["files"].as_array().expect("files") {
            assert!(file["file"].is_string() && file["format"].is_string(), "{name}: {file}");
            let axes = file["axes"].as_array().expect("axes");
            assert_eq!(file["size"].as_array().expect("a size").len(), axes.len(), "{name}");
            for channel in file["channels"].as_array().expect("channels") {
                kiln::table::quantity::find(channel.as_str().expect("a channel")).expect("a quantity");
            }
            for axis in axes {
                assert!(
                    axis["parameter"].is_string() && axis["warp"].is_string() && axis["flip"].is_boolean(),
                    "{axis}"
                );
                assert!(["centre", "edge"].contains(&axis["sampling"].as_str().expect("a sampling")), "{axis}");
            }
        }
        let environment = &engine["environment"];
        if environment.is_null() {
            assert!(["cycles", "eevee"].contains(&name), "{name}");
            continue;
        }
        assert!(environment["kernel"].is_string(), "{name}");
        let sh = &environment["sh"];
        assert!(sh["convention"].is_string() && sh["holds"].is_string(), "{name}: {sh}");
        assert_eq!(sh["order"].as_array().expect("an order").len(), 9, "{name}");
        assert_eq!(environment["roughness"].as_array().expect("roughness").len() as u64, environment["levels"]);
        if environment["layout"] != "cube" {
            assert!(environment["faces"].is_null() && ["materialx", "playcanvas"].contains(&name), "{name}");
            continue;
        }
        let faces = environment["faces"].as_array().expect("faces");
        assert!(faces.len() == 6 && faces.iter().all(|f| f.as_array().is_some_and(|f| f.len() == 3)), "{name}");
    }
    let bevy = engines.iter().find(|e| e["name"] == "bevy").expect("bevy");
    assert_eq!(bevy["environment"]["faces"][0], serde_json::json!(["1", "-v", "u"]));
    assert_eq!(bevy["environment"]["faces"][4], serde_json::json!(["u", "-v", "-1"]));
    let text = succeed(folder.path(), &["list", "engines"]).stdout;
    assert!(
        text.contains("kiln table dfg -o dfg.ktx2 --format ktx2:rg16f+zstd") && text.contains("from memory"),
        "{text}"
    );
}

/// That the flags are the presets, down to the last digit, a test beside the list says; this one, that a shell takes them as they are printed.
#[cfg(unix)]
#[test]
fn the_flags_that_an_engine_stands_for_make_the_same_table() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = succeed(folder.path(), &["list", "engines"]).stdout;
    let mut engine = "";
    let (mut ran, mut with_brackets) = (0, 0);
    for line in text.lines() {
        if !line.starts_with(' ') {
            engine = line.split(':').next().expect("a name");
        }
        let Some(flags) = line.strip_prefix("  kiln table ") else { continue };
        let file = flags.split(' ').nth(2).expect("a file");
        let preset = engine::find(engine).expect("an engine").tables;
        let Some(table) = preset.iter().find(|t| t.file == file) else { panic!("{line}") };
        let recipe = table.recipe(false).expect("a recipe");
        // (Averages over a glass take seconds a column.)
        let slow = flags.contains("dielectric.albedo_avg");
        if slow || recipe.axes.iter().map(|a| a.size).product::<usize>() > 256 {
            continue;
        }
        shell(folder.path(), &format!("kiln table {flags}"));
        let by_flags = std::fs::read(folder.path().join(table.file)).expect("a file");
        let by_preset = bake::table(&recipe, &|_| {}).expect("a bake");
        assert!(by_flags == by_preset.files[0].1, "{line}: other bytes");
        ran += 1;
        with_brackets += usize::from(flags.contains('('));
    }
    assert!(ran >= 3 && with_brackets >= 1, "{ran} tables, {with_brackets} with a function");
}

/// `kiln bake --engine babylon` failed at one texel of thousands: what is multiplied by 16 must be 16 times closer before.
#[test]
fn a_scaled_channel_is_integrated_as_closely_as_its_scaled_error_must_be() {
    let babylon = engine::find("babylon").expect("an engine");
    let mut table = babylon.table("ggx-f82").expect("a table").recipe(false).expect("a recipe");
    // The texel that did not reach it, of the first column of 128 and the thirteenth row.
    table.axes =
        ["mu:1:0..0.0078125", "roughness:1:0.09375..0.1015625"].map(|axis| axis.parse().expect("an axis")).into();
    let baked = bake::table(&table, &|_| {}).expect("a bake");
    let error = baked.certificate.channels[2].max_error;
    assert!(error <= 2e-6, "{error}");
    // By chance as well.
    table.axes = ["mu:1", "roughness:1"].map(|axis| axis.parse().expect("an axis")).into();
    table.integration.integrator = kiln::integrate::Integrator::MonteCarlo;
    table.integration.tolerance = Some(1e-2);
    let baked = bake::table(&table, &|_| {}).expect("a bake");
    let error = baked.certificate.channels[2].max_error;
    assert!(error > 0.0 && error <= 1e-2, "{error}");
}

#[test]
fn a_bake_for_engines_writes_everything_that_they_need() {
    let folder = tempfile::tempdir().expect("a folder");
    let recipe = folder.path().join("small.toml");
    // The file's entries win over the presets': a smaller table and a smaller chain.
    std::fs::write(
        &recipe,
        "recipe = 1\n[[table]]\nfile = \"bevy/dfg.ktx2\"\nformat = \"ktx2:rg16f+zstd\"\nchannels = [\"ggx.scale\", \"ggx.bias\"]\n\
         axes = [\"mu:8\", \"roughness:8\"]\n[[array]]\nfile = \"bevy/ltc.ktx2\"\nformat = \"ktx2:rgba16f+zstd\"\n\
         [[array.layer]]\nname = \"ltc-matrix\"\nchannels = [\"ltc.m00\", \"ltc.m20\", \"ltc.m02\", \"ltc.m22\"]\n\
         axes = [\"roughness:8:edge\", \"mu:8:sqrt-one-minus:edge\"]\n[[environment]]\ninput = \"builtin:white\"\ndirectory = \"bevy/white\"\nsize = 8\n\
         min_size = 1\nirradiance_size = 4\norientation = \"x,y,-z\"\n",
    )
    .expect("a file");
    let arguments = ["bake", "small.toml", "--engine", "bevy", "--env", "builtin:white", "--out", "o"];
    succeed(folder.path(), &arguments);
    let files = listing(&folder.path().join("o"));
    for wanted in ["bevy/dfg.ktx2", "bevy/white/specular.ktx2", "bevy/white/irradiance.ktx2", "bevy/white/sh.json"] {
        assert!(files.iter().any(|f| f == wanted), "{wanted} among {files:?}");
    }
    succeed(folder.path(), &["verify", "o"]);
    let printed =
        succeed(folder.path(), &["bake", "--engine", "bevy,threejs", "--env", "builtin:white", "--print-recipe"]);
    let recipe = Recipe::from_toml(&printed.stdout).expect("a recipe");
    let tables =
        |name: &str| engine::find(name).expect("an engine").tables.iter().filter(|table| !table.is_layer).count();
    assert_eq!((recipe.tables.len(), recipe.environments.len()), (tables("bevy") + tables("threejs"), 2));
    assert_eq!(recipe.environments[0].orientation.to_string(), "x,y,-z");
    assert_eq!(recipe.environments[1].irradiance, IrradianceKind::LastLevel);
    let printed = succeed(folder.path(), &["bake", "--engine", "gltf", "--env", "builtin:white", "--print-recipe"]);
    let sheen = &Recipe::from_toml(&printed.stdout).expect("a recipe").environments[1];
    assert_eq!((sheen.directory.as_str(), sheen.specular_name().as_str()), ("gltf/white/charlie", "sheen.ktx2"));
    assert_eq!((sheen.kernel, sheen.level_roughness()[0]), (KernelKind::Charlie, LEAST_SHEEN));
}

#[test]
fn a_preset_combined_with_flags_that_break_it_warns() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = |more: &[&str]| {
        let arguments = [&["table", "dfg", "--engine", "bevy", "-o", "dfg.ktx2", "--size", "8"], more].concat();
        succeed(folder.path(), &arguments).stderr
    };
    assert!(!table(&[]).contains("warning"));
    assert!(table(&["--smith", "separable"]).contains("warning: bevy reads masking correlated"));
    assert!(table(&["--axes", "mu,roughness:flip", "--size", "8"][..2]).contains("warning: bevy reads axes"));
    assert!(table(&["--as-shipped"]).contains("warning: --as-shipped: no numbers of its own are known of bevy's dfg"));
    assert!(table(&["--format", "ktx2:rgba16f"]).contains("warning: bevy reads format ktx2:rg16f+zstd"));
    let env = |more: &[&str]| {
        let arguments =
            ["env", "builtin:white", "--engine", "o3de", "--out", "o", "--size", "32", "--irradiance-size", "4"];
        kiln(folder.path(), &[&arguments, more].concat()).stderr
    };
    assert!(!env(&[]).contains("warning"), "{}", env(&[]));
    assert!(env(&["--roughness", "0,0.5,1"]).contains("warning: o3de reads roughness"));
    assert!(env(&["--orientation", "x,y,z"]).contains("warning: o3de reads orientation -x,y,z"));
}

#[test]
fn unknown_engines_and_impossible_wishes_are_refused_with_the_way_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let unknown = fail(folder.path(), &["bake", "--engine", "three.js"], 2);
    assert!(unknown.contains("threejs"), "{unknown}");
    let none = fail(folder.path(), &["env", "builtin:white", "--engine", "cycles", "--out", "o"], 2);
    assert!(none.contains("reads no filtered environment"), "{none}");
    let table = fail(folder.path(), &["table", "charlie-albedo", "--engine", "bevy", "-o", "a.ktx2"], 2);
    assert!(table.contains("use one of dfg"), "{table}");
    let turned = fail(folder.path(), &["env", "builtin:white", "--orientation", "x,x,z", "--out", "o"], 2);
    assert!(turned.contains("such as x,y,-z"), "{turned}");
}

#[test]
fn the_levels_of_a_chain_follow_the_size() {
    let bevy = engine::find("bevy").expect("an engine").environment.as_ref().expect("an environment");
    assert_eq!((bevy.n_levels(256), bevy.n_levels(64), bevy.n_levels(1)), (9, 7, 1));
    assert_eq!(bevy.roughness, RoughnessMap::Linear);
    let filament = engine::find("filament").expect("an engine").environment.as_ref().expect("an environment");
    assert_eq!((filament.n_levels(256), filament.n_levels(8)), (5, 1));
    // A shift is nothing that a right table has.
    for engine in ENGINES {
        for table in engine.tables {
            let axes = table.recipe(false).expect("a recipe").axes;
            assert!(axes.iter().all(|axis: &Axis| axis.shift == 0.0), "{}", engine.name);
        }
    }
    let cube = Cube { size: 2, texels: vec![[0.0; 3]; 24] };
    assert_eq!(Orientation::default().apply(cube.clone()), cube);
}
