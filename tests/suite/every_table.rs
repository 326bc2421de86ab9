//! Every table that has a name, baked small by both integrators; the rounding of what is baked.

use kiln::bake::{self, Baked};
use kiln::format::{Container, FormatSpec, exr, ktx2};
use kiln::integrate::{Integration, Integrator, Settings};
use kiln::pack::{Number, TexelFormat};
use kiln::recipe::TableRecipe;
use kiln::table::named::TABLES;
use kiln::table::quantity;
use kiln::table::rounding;
use kiln::table::{Parameter, TableSpec};

/// 5 standard errors estimated from 32 replicates: one false alarm in 50,000 comparisons, of which there are below 10,000; the
/// seeds are fixed.
const SIGMAS: f64 = 5.0;

/// The named table with that many texels along each axis, in full floats.
fn small(name: &str, size: usize, integration: Settings) -> TableRecipe {
    let mut recipe = TableRecipe::named(name, FormatSpec::exr(Number::F32)).expect("a name");
    recipe.axes.iter_mut().for_each(|axis| axis.size = size);
    let tolerance = integration.tolerance.or(recipe.integration.tolerance);
    recipe.integration = Settings { tolerance, ..integration };
    recipe
}

fn bake(recipe: &TableRecipe) -> Baked {
    bake::table(recipe, &|_| {}).unwrap_or_else(|e| panic!("{}: {e}", recipe.file))
}

/// The values of the file, texel by texel, channels in the recipe's order.
fn values(recipe: &TableRecipe, baked: &Baked) -> Vec<f32> {
    let arrangement = recipe.arrangement().expect("an arrangement");
    let (_, bytes) = &baked.files[0];
    let file: Vec<f32> = match recipe.format.container() {
        Container::Exr => {
            let image = exr::decode(bytes).expect("an EXR");
            let names: Vec<&str> = recipe.channels.iter().map(String::as_str).collect();
            let channels: Vec<Vec<f32>> =
                arrangement.names(&names).iter().map(|name| image.channel(name).expect("a channel")).collect();
            (0..channels[0].len()).flat_map(|i| channels.iter().map(move |c| c[i])).collect()
        }
        _ => {
            let texture = ktx2::decode(bytes).expect("a KTX2");
            let (stored, n) = (texture.format.channels(), recipe.channels.len());
            let all: Vec<f32> = (0..texture.layers(0)).filter_map(|slice| texture.face(0, slice)).flatten().collect();
            all.chunks_exact(stored).flat_map(|texel| texel[..n].to_vec()).collect()
        }
    };
    arrangement.gather(&file)
}

#[test]
fn every_named_table_is_the_same_by_both_integrators() {
    for table in TABLES {
        // (A fit takes its time.)
        let size = if table.axes.len() == 3 || table.name.starts_with("ltc") { 3 } else { 5 };
        let deterministic = small(table.name, size, Settings::default());
        let settings = Settings { integrator: Integrator::MonteCarlo, samples: Some(1 << 13), ..Settings::default() };
        let random = small(table.name, size, settings);
        // (A bake would ask the random witness again.)
        let integration = Integration::new(deterministic.integration).expect("settings");
        let a = deterministic.spec().expect("a table").bake(&integration, &|_| {}).expect("in the domain");
        let b = bake(&random);
        let n = table.channels.len();
        for (i, ((x, error), y)) in a.values.iter().zip(&a.errors).zip(values(&random, &b)).enumerate() {
            let drawn = &b.certificate.channels[i % n];
            let tolerance = error + SIGMAS * drawn.max_error + f64::from(f32::EPSILON) * x.abs();
            let off = (x - f64::from(y)).abs();
            assert!(
                off <= tolerance,
                "{} texel {}: {x} by quadrature, {y} by samples, {tolerance:e}",
                drawn.quantity,
                i / n
            );
        }
    }
}

/// The same texels, integrated again as finely as can be.
fn finest(spec: &TableSpec) -> Vec<(f64, f64)> {
    let finest = Integration::new(Settings { tolerance: Some(1e-13), ..Settings::default() }).expect("settings");
    let evaluator = spec.evaluator();
    (0..spec.len())
        .flat_map(|texel| evaluator.at(&spec.point(texel), &finest).expect("in the domain"))
        .map(|e| (e.value, e.error))
        .collect()
}

/// The same by the other witness: values and their standard errors.
fn by_samples(spec: &TableSpec) -> Vec<(f64, f64)> {
    let settings =
        Settings { integrator: Integrator::MonteCarlo, samples: Some(1 << 13), seed: 7, ..Settings::default() };
    let (random, evaluator) = (Integration::new(settings).expect("settings"), spec.evaluator());
    (0..spec.len())
        .flat_map(|texel| evaluator.at(&spec.point(texel), &random).expect("in the domain"))
        .map(|e| (e.value, e.error))
        .collect()
}

#[test]
fn at_most_one_half_float_in_ten_thousand_of_the_named_tables_stays_undecided() {
    let (mut undecided, mut total, mut found) = (0, 0, vec![]);
    for table in TABLES.iter().filter(|table| table.name != "ggx-albedo-anisotropic") {
        let mut recipe = small(table.name, if table.axes.len() == 3 { 7 } else { 16 }, Settings::default());
        recipe.format = FormatSpec::exr(Number::F16);
        // What is looked up between the texels is another matter, and takes longer.
        let (spec, integration) =
            (recipe.spec().expect("a table"), Integration::new(recipe.integration).expect("settings"));
        let mut baked = spec.bake(&integration, &|_| {}).unwrap_or_else(|e| panic!("{}: {e}", table.name));
        let format = recipe.texel_format().expect("a format");
        let rounding = rounding::decide(&mut baked, format, &integration).expect("it was baked before");
        assert_eq!(rounding.certified + rounding.undecided, baked.values.len() as u64, "{}", table.name);
        if rounding.undecided > 0 {
            found.push(format!("{} of {}", rounding.undecided, table.name));
        }
        undecided += rounding.undecided;
        total += rounding.certified + rounding.undecided;
    }
    assert!(total > 10_000 && undecided * 10_000 <= total, "{undecided} of {total}: {}", found.join(", "));
}

#[test]
fn certified_halves_are_the_nearest_and_floats_are_within_an_ulp_or_1e_8() {
    for (name, size, texel) in [
        ("dfg", 16, "rg"),
        ("ggx-f82", 8, "rgba"),
        ("beckmann-dfg", 6, "rg"),
        ("charlie-albedo", 5, "r"),
        ("dielectric", 3, "rg"),
        ("dielectric-inside", 3, "rg"),
        ("dielectric-avg", 2, "rg"),
        ("conductor-albedo", 5, "r"),
    ] {
        let mut recipe = small(name, size, Settings::default());
        recipe.channels.truncate(texel.len());
        let spec = recipe.spec().expect("a table");
        let (drawn, exact) = (by_samples(&spec), finest(&spec));
        for number in [Number::F16, Number::F32] {
            recipe.format = match number {
                Number::F16 => FormatSpec::ktx2(TexelFormat::new(texel.len(), number).expect("a format")),
                _ => FormatSpec::exr(number),
            };
            let baked = bake(&recipe);
            let rounding = baked.certificate.rounding.expect("a table by quadrature has it");
            let total = (spec.len() * spec.channels.len()) as u64;
            assert_eq!(rounding.certified + rounding.undecided, total, "{name}");
            assert!(rounding.undecided * 10_000 <= total, "{name} {number}: {rounding:?}");
            let stored = values(&recipe, &baked);
            for (i, &(value, error)) in drawn.iter().enumerate() {
                let (got, half_an_ulp) = (f64::from(stored[i]), 0.5 * number.ulp(value.abs() * (1.0 + 1e-3)));
                let allowed = SIGMAS * error + half_an_ulp + 1e-8;
                assert!((got - value).abs() <= allowed, "{name} {number} value {i}: {got}, drawn {value}, {allowed:e}");
            }
            let mut outside = 0;
            for (i, &(truth, error)) in exact.iter().enumerate() {
                let got = f64::from(stored[i]);
                let right = match number {
                    Number::F16 => [truth - error, truth + error]
                        .iter()
                        .any(|v| f64::from(number.unpack(&number.pack(&[*v]).0)[0]) == got),
                    _ => (got - truth).abs() <= number.ulp(truth).max(1e-8) + error,
                };
                outside += u64::from(!right);
            }
            assert!(outside <= rounding.undecided, "{name} {number}: {outside} of {total} are not right");
        }
    }
}

#[test]
fn a_coarse_tolerance_still_rounds_right() {
    let coarse = Settings { tolerance: Some(1e-3), ..Settings::default() };
    let mut recipe = small("dfg", 16, coarse);
    recipe.format = FormatSpec::ktx2(TexelFormat::new(2, Number::F16).expect("a format"));
    let fine = TableRecipe { integration: Settings::default(), ..recipe.clone() };
    assert_eq!(values(&recipe, &bake(&recipe)), values(&fine, &bake(&fine)));
}

#[test]
fn every_quantity_has_a_named_table() {
    let tables: Vec<TableSpec> =
        TABLES.iter().map(|t| small(t.name, 4, Settings::default()).spec().expect("a table")).collect();
    for handle in quantity::all() {
        let there = tables.iter().any(|table| table.channels.contains(&handle));
        assert!(there || handle.quantity.parameters.is_empty(), "{} is in no table", handle.quantity.name);
    }
}

#[test]
fn every_named_table_can_be_read_and_says_what_its_axes_cover() {
    for table in TABLES {
        let recipe = small(table.name, 8, Settings::default());
        recipe.spec().and_then(|s| s.check()).unwrap_or_else(|e| panic!("{}: {e}", table.name));
        for axis in table.default_axes().expect("axes") {
            axis.check().unwrap_or_else(|e| panic!("{}: {e}", table.name));
        }
        table.default_point().unwrap_or_else(|e| panic!("{}: {e}", table.name));
    }
    let inside = TABLES.iter().find(|t| t.name == "dielectric-inside").expect("there");
    let eta = inside.default_axes().expect("axes")[2];
    assert_eq!((eta.parameter, eta.ends()), (Parameter::Eta, (0.0, 1.0)));
}
