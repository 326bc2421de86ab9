//! Materials: their data, and the command that uses them.

use crate::support::kiln::{fail, succeed};
use kiln::material::{MATERIALS, Reflectance, find, srgb_byte};
use kiln::model::fresnel::{conductor, f0_of_eta};

/// The bytes that go with the linear values, written down from memory of the tables that game engines circulate: not read here.
const SRGB: [(&str, [u8; 3]); 13] = [
    ("titanium", [194, 187, 179]),
    ("chromium", [196, 197, 196]),
    ("iron", [198, 198, 200]),
    ("nickel", [212, 205, 192]),
    ("platinum", [214, 209, 201]),
    ("copper", [250, 209, 194]),
    ("palladium", [222, 217, 211]),
    ("mercury", [229, 228, 228]),
    ("brass", [245, 228, 174]),
    ("zinc", [213, 234, 237]),
    ("gold", [255, 229, 158]),
    ("aluminium", [245, 246, 246]),
    ("silver", [252, 250, 245]),
];

#[test]
fn srgb_values_of_metals_are_the_circulated_ones_within_one() {
    for (name, wanted) in SRGB {
        for (part, wanted) in find(name).expect("a material").parts().iter().zip(wanted) {
            let got = srgb_byte(part.f0);
            assert!(got.abs_diff(wanted) <= 1, "{name} {}: got {got}, wanted {wanted}", part.name);
        }
    }
    assert_eq!(MATERIALS.iter().filter(|m| m.is_metal()).count(), SRGB.len());
}

#[test]
fn reflectances_are_in_zero_to_one_and_belong_to_their_indices() {
    for material in MATERIALS {
        for part in material.parts() {
            assert!(part.f0 > 0.0 && part.f0 <= 1.0, "{} {part:?}", material.name);
            if let Some(eta) = part.eta {
                assert!((f0_of_eta(eta) - part.f0).abs() < 1e-15, "{} {part:?}", material.name);
            }
            if let Some([n, k]) = part.index {
                // One wavelength against a band of the eye, and other samples of the metal: iron's blue is the furthest off, 0.082.
                let off = (conductor(1.0, n, k) - part.f0).abs();
                assert!(off < 0.09, "{} {part:?}: F0 of the index is off by {off}", material.name);
            }
        }
        if let Reflectance::Dielectric { low, high } = material.reflectance {
            assert!(low <= high, "{material:?}");
        }
    }
}

#[test]
fn eval_takes_a_material_for_its_numbers() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |arguments: &[&str]| {
        let json = succeed(folder.path(), &[arguments, &["--json"]].concat()).stdout;
        serde_json::from_str::<Vec<serde_json::Value>>(&json).expect("JSON")
    };
    let water = run(&["eval", "fresnel.dielectric", "--mu", "1", "--material", "water"]);
    assert_eq!(water.len(), 1);
    assert!((water[0]["value"].as_f64().expect("a number") - 0.02).abs() < 1e-15, "{water:?}");
    let gold = run(&["eval", "fresnel.schlick", "--mu", "1", "--material", "gold"]);
    let parts: Vec<_> = gold.iter().map(|r| (r["part"].as_str(), r["value"].as_f64())).collect();
    assert_eq!(parts, [(Some("red"), Some(1.0)), (Some("green"), Some(0.782)), (Some("blue"), Some(0.344))]);
    let rough = run(&["eval", "conductor.albedo", "--mu", "0.5", "--roughness", "0.4", "--material", "copper"]);
    assert_eq!(rough.len(), 6, "three channels by two witnesses: {rough:?}");
    let listed = run(&["list", "materials"]);
    assert_eq!(listed.len(), MATERIALS.iter().map(|m| m.parts().len()).sum::<usize>());
    let metals_lack = ["eval", "conductor.albedo", "--mu", "0.5", "--alpha", "0.4", "--material", "brass"];
    assert!(fail(folder.path(), &metals_lack, 2).contains("no n is known of the metal brass"));
    fail(folder.path(), &["eval", "fresnel.schlick", "--mu", "1", "--material", "unobtainium"], 2);
    fail(folder.path(), &["eval", "ggx.albedo", "--mu", "1", "--alpha", "1", "--material", "gold"], 2);
}

#[test]
fn eval_of_a_kind_shows_how_compensations_differ() {
    let folder = tempfile::tempdir().expect("a folder");
    let point = ["--mu", "0.5", "--alpha", "0.5", "--f0", "0.9"];
    let run = succeed(folder.path(), &[&["eval", "compensation.*"], &point[..]].concat()).stdout;
    for name in ["none", "kulla-conty", "kulla-conty-squared", "turquin", "fdez-aguera"] {
        assert!(run.contains(&format!("compensation.{name} ")), "{run}");
    }
    assert!(run.contains("against the first") && run.contains("+0."), "{run}");
    fail(folder.path(), &["eval", "compensation.nonsense", "--mu", "1"], 2);
    fail(folder.path(), &["eval", "nonsense.*", "--mu", "1"], 2);
}

#[test]
fn eval_of_a_layer_shows_what_each_kd_gains_or_loses_in_a_white_furnace() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |mu: &str, roughness: &str| {
        let point = ["eval", "layered.albedo", "--mu", mu, "--roughness", roughness, "--f0", "0.04", "--rho", "0.5"];
        succeed(folder.path(), &[&point[..], &["--samples", "1024"]].concat()).stdout
    };
    let verdict = |text: &str, kd: &str| {
        let furnace = text.split("in a white furnace").nth(1).unwrap_or_else(|| panic!("{text}"));
        let row = furnace.lines().find(|line| line.starts_with(kd)).unwrap_or_else(|| panic!("{kd}: {text}"));
        row.split_whitespace().last().map(str::to_owned).expect("a verdict")
    };
    let (grazing, rough) = (at("0.05", "0.3"), at("1", "1"));
    assert!(
        grazing.starts_with("layered.albedo at mu 0.05, roughness 0.3, f0 0.04, rho 0.5 (correlated Smith, albedo kd)")
    );
    assert_eq!((verdict(&grazing, "fresnel"), verdict(&rough, "fresnel")), ("gains".to_owned(), "loses".to_owned()));
    for kd in ["albedo", "reciprocal"] {
        assert_eq!(verdict(&grazing, kd), "all", "{grazing}");
    }
}

#[test]
fn parameters_outside_their_domain_name_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let error = fail(folder.path(), &["eval", "fresnel.dielectric", "--mu", "0.5", "--eta", "-3"], 2);
    assert!(error.contains("eta -3 is outside its domain [0.00001, 100000] or 0 or inf"), "{error}");
}
