//! Linearly transformed cosines: that fits are nearer to GGX than those that are in use, and that a renderer lights with them.

#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

use crate::support::kiln::succeed;
use crate::support::{browser, tools};
use glam::DVec3;
use kiln::certificate::Certificate;
use kiln::engine;
use kiln::format::{Texture, encode};
use kiln::integrate::quadrature::{Surface, ggx_albedo, ltc_distance, ltc_fit_quickly};
use kiln::integrate::{Integration, Settings};
use kiln::math::frame::direction_with_cosine;
use kiln::model::Lobe;
use kiln::model::clipped_sphere::clipped_sphere;
use kiln::model::ggx::{Ggx, Smith};
use kiln::model::ltc::Ltc;
use kiln::table::{Axis, Parameter, ltc};
use std::collections::HashMap;
use std::process::Command;

/// Texels along an edge of the published tables.
const N: usize = 64;

/// The tables of `three`, which are those that the method's authors published: four numbers a texel, roughness fastest.
fn published() -> Option<[Vec<f64>; 2]> {
    let tools = tools::folder_with("node_modules/three")?;
    const SCRIPT: &str = r#"
const { RectAreaLightTexturesLib: lib } = await import('three/addons/lights/RectAreaLightTexturesLib.js');
lib.init();
console.log(JSON.stringify([lib.LTC_FLOAT_1, lib.LTC_FLOAT_2].map((texture) => Array.from(texture.image.data))));"#;
    let mut command = Command::new("node");
    command.args(["--input-type=module", "--eval", SCRIPT]).current_dir(tools);
    Some(serde_json::from_str(&tools::output(command)?).unwrap())
}

/// The cosine and the roughness of a texel of them.
fn place(x: usize, y: usize) -> (f64, f64) {
    let [x, y] = [x, y].map(|i| i as f64 / (N - 1) as f64);
    (1.0 - y * y, x)
}

/// The entries as the published texture has them: column after column.
fn from_columns(texel: &[f64]) -> Ltc {
    ltc::lobe([texel[0], texel[2], texel[1], texel[3]])
}

/// Points along an edge of the square from which directions are drawn.
const POINTS: usize = 160;

/// ½ ∫ |g − f|, and the second and third powers in parts of f's own: by directions drawn from both lobes, evenly, each weighed by the
/// sum of their densities. No change of variables of this is one of the fit's.
fn distances(mu: f64, alpha: f64, ltc: &Ltc) -> [f64; 3] {
    let albedo = ggx_albedo(mu, alpha, Smith::Correlated, 1e-9).value;
    let (lobe, wo) = (Ggx::isotropic(alpha, Smith::Correlated), direction_with_cosine(mu));
    let (mut sums, mut whole) = ([0.0; 3], [0.0; 3]);
    for i in 0..POINTS * POINTS {
        let [phi, t] = [i % POINTS, i / POINTS].map(|k| (k as f64 + 0.5) / POINTS as f64);
        // Crowded towards the rims of both squares, where the tails are.
        let stretch = 2.0 * t;
        let drawn = [lobe.sample(wo, [phi, t * t]).map(|s| s.wi), Some(ltc.sample([phi, 1.0 - t * t]))];
        for w in drawn.into_iter().flatten() {
            let (f, pdf) = if w.z > 0.0 { (lobe.f(wo, w) * w.z / albedo, lobe.pdf(wo, w)) } else { (0.0, 0.0) };
            let g = ltc.density(w);
            for (power, (sum, whole)) in sums.iter_mut().zip(&mut whole).enumerate() {
                *sum += stretch * (g - f).abs().powi(power as i32 + 1) / (g + pdf);
                *whole += stretch * f.powi(power as i32 + 1) / (g + pdf);
            }
        }
    }
    [0.5 * sums[0] / whole[0], (sums[1] / whole[1]).sqrt(), (sums[2] / whole[2]).cbrt()]
}

#[test]
fn fits_are_nearer_to_ggx_than_the_published_ones_by_every_power() {
    let Some([matrices, _]) = published() else { return };
    let (mut ours, mut theirs, mut n) = ([0.0; 3], [0.0; 3], 0.0);
    for y in (0..N).step_by(9) {
        // From alpha = 0.02 to 1.
        for x in (9..N).step_by(9) {
            let ((mu, roughness), at) = (place(x, y), 4 * (y * N + x));
            let alpha = roughness * roughness;
            let fit = ltc_fit_quickly(mu, Surface::Ggx(alpha, Smith::Correlated));
            let (own, published) =
                (distances(mu, alpha, &fit), distances(mu, alpha, &from_columns(&matrices[at..at + 4])));
            for (k, (&a, &b)) in own.iter().zip(&published).enumerate() {
                // Where both are the best there is, at normal incidence, six digits of theirs and the points tell them apart.
                assert!(a <= 1.005 * b + 1e-5, "mu {mu} roughness {roughness}: {own:?}, published {published:?}");
                ours[k] += a;
                theirs[k] += b;
            }
            n += 1.0;
            // The certificate's figures are these, but for what so few points make of kinks.
            let said = ltc_distance(mu, Surface::Ggx(alpha, Smith::Correlated), &fit);
            for (said, found) in [said.total_variation, said.square, said.cube].into_iter().zip(own) {
                assert!(
                    (said - found).abs() < 0.02 * found + 1e-4,
                    "mu {mu} roughness {roughness}: {said:?}, found {own:?}"
                );
            }
        }
    }
    eprintln!("mean distances: {:?}, published {:?}", ours.map(|s| s / n), theirs.map(|s| s / n));
    assert!(ours.iter().zip(&theirs).all(|(a, b)| *a < 0.8 * b), "on the whole {ours:?}, published {theirs:?}");
}

#[test]
fn the_amplitude_is_over_the_axes_of_the_published_one() {
    let Some([_, amplitudes]) = published() else { return };
    let axis = |text: &str| text.parse::<Axis>().unwrap();
    let (cos_centre, sin2) = (
        axis("roughness:64:edge:+cos_centre").other().unwrap(),
        axis("mu:64:sqrt-one-minus:edge:+sin2_radius").other().unwrap(),
    );
    assert_eq!((cos_centre.parameter, sin2.parameter), (Parameter::CosCentre, Parameter::Sin2Radius));
    for y in 0..N {
        for x in 0..N {
            let texel = &amplitudes[4 * (y * N + x)..][..4];
            let wanted = clipped_sphere(cos_centre.value(x), sin2.value(y));
            // Six digits, of formulas in single precision.
            assert!((texel[3] - wanted).abs() < 1e-5, "sphere at {x}, {y}: published {}, {wanted}", texel[3]);
            assert_eq!(texel[2], 0.0);
            // Theirs was drawn from few samples, and is wrong at grazing angles.
            let (mu, roughness) = place(x, y);
            if mu > 0.5 && x % 7 == 0 && x > 0 && y % 7 == 0 {
                let e = ggx_albedo(mu, roughness * roughness, Smith::Correlated, 1e-6).value;
                assert!((texel[0] - e).abs() < 0.01, "albedo at {x}, {y}: published {}, {e}", texel[0]);
            }
        }
    }
}

#[test]
fn a_table_of_lobes_says_how_far_they_are_from_what_they_stand_for() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["-q", "table", "ltc-matrix", "--size", "5", "-o", "ltc.exr"]);
    let text = std::fs::read_to_string(folder.path().join("ltc.exr.certificate.json")).unwrap();
    let found = Certificate::from_json(&text).unwrap().approximation;
    let [only] = &found[..] else { panic!("{found:?}") };
    assert_eq!(only.channels, "ltc.m00, ltc.m20, ltc.m02, ltc.m22");
    // Worst at the horizon, where no cosine has the shape of the lobe; a tenth on the whole.
    assert_eq!(only.worst_at.get(Parameter::Mu).unwrap(), 0.0);
    assert!(only.max_total_variation > only.mean_total_variation && only.max_total_variation < 0.7, "{only:?}");
    assert!(only.mean_total_variation < 0.2 && only.rms < only.max_square, "{only:?}");
    succeed(folder.path(), &["-q", "verify", "ltc.exr"]);
    // Its bytes are what anybody else bakes.
    succeed(folder.path(), &["-q", "--threads", "1", "table", "ltc-matrix", "--size", "5", "-o", "again.exr"]);
    let texels = |file: &str| {
        Certificate::from_json(&std::fs::read_to_string(folder.path().join(file)).unwrap()).unwrap().files[0]
            .digest
            .clone()
    };
    assert_eq!(texels("ltc.exr.certificate.json"), texels("again.exr.certificate.json"));
}

#[test]
fn code_looks_up_both_parameters_of_an_axis_that_stands_for_two() {
    let folder = tempfile::tempdir().unwrap();
    succeed(folder.path(), &["-q", "table", "ltc-amplitude", "--size", "4", "-o", "ltc_2.exr", "--shader", "glsl"]);
    let code = std::fs::read_to_string(folder.path().join("ltc_2.lookup.glsl")).unwrap();
    for wanted in [
        "ltc_2_values ltc_2_lookup(highp sampler2D table, float roughness, float NoV)",
        "ltc_2_clipped_values ltc_2_clipped_lookup(highp sampler2D table, float cos_centre, float sin2_radius)",
        "values.clipped = texel.w",
    ] {
        assert!(code.contains(wanted), "{wanted} in {code}");
    }
}

/// A rectangle that faces the origin.
struct Light {
    centre: DVec3,
    size: [f64; 2],
}

impl Light {
    /// Its corners, as three.js turns a light that looks at the origin: +y is up.
    fn point(&self, u: f64, v: f64) -> DVec3 {
        let forward = self.centre.normalize();
        let right = DVec3::Y.cross(forward).normalize();
        let up = forward.cross(right);
        self.centre + right * (u - 0.5) * self.size[0] + up * (v - 0.5) * self.size[1]
    }

    /// ∫ f cosθ dω over it.
    fn reflected(&self, mu: f64, roughness: f64) -> f64 {
        let (lobe, wo) = (Ggx::isotropic(roughness * roughness, Smith::Correlated), direction_with_cosine(mu));
        let (n, forward) = (400, self.centre.normalize());
        let mut sum = 0.0;
        for i in 0..n * n {
            let at = self.point((f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n));
            let (square, w) = (at.length_squared(), at.normalize());
            if w.z > 0.0 {
                sum += lobe.f(wo, w) * w.z * w.dot(forward) / square;
            }
        }
        sum * self.size[0] * self.size[1] / f64::from(n * n)
    }
}

/// The file of a preset, in halves, without what a bake proves of it, which takes four times as long as its numbers.
fn babylons(table: &str) -> Vec<u8> {
    let recipe = engine::find("babylon").unwrap().table(table).unwrap().recipe(false).unwrap();
    let spec = recipe.spec().unwrap();
    let settings = Settings { tolerance: Some(1e-5), ..recipe.integration };
    let values = spec.bake(&Integration::new(settings).unwrap(), &|_| {}).unwrap().values;
    let format = recipe.texel_format().unwrap();
    encode(recipe.format, &Texture::flat(format, spec.width(), spec.height(), &values).unwrap().0).unwrap()
}

#[test]
fn threejs_lights_a_metal_with_kilns_table_as_ggx_does_and_better_than_with_its_own() {
    if tools::folder_with("node_modules/three").is_none() {
        return;
    }
    // Around the mirror direction and beside it, near and far, all above the horizon.
    let mut cases = vec![];
    for mu in [0.95, 0.8, 0.6, 0.4] {
        let sine = f64::sqrt(1.0 - mu * mu);
        for roughness in [0.3, 0.5, 0.7, 0.9] {
            for (centre, size) in [
                (DVec3::new(-sine, 0.0, mu) * 2.0, [0.6, 0.4]),
                (DVec3::new(-0.4, 0.7, 1.0), [0.5, 0.5]),
                (DVec3::new(-0.8, -0.3, 0.9), [0.3, 0.9]),
            ] {
                cases.push((mu, roughness, Light { centre, size }));
            }
        }
    }
    let scenes: Vec<_> = cases
        .iter()
        .map(|(mu, roughness, light)| {
            serde_json::json!({
                "mu": mu, "roughness": roughness, "light": light.centre.to_array(), "width": light.size[0], "height": light.size[1]
            })
        })
        .collect();
    let mut files =
        HashMap::from([("scenes.json".to_owned(), serde_json::Value::from(scenes).to_string().into_bytes())]);
    files.extend(["ltc-matrix", "ltc-amplitude"].map(|table| (table.to_owned(), babylons(table))));
    let Some(rendered) = browser::run(include_str!("support/rect_light.js"), files) else { return };
    let [own, theirs] = ["own", "theirs"].map(|name| browser::floats(&rendered[name]));
    let (mut off_own, mut off_theirs) = (0.0, 0.0);
    for (i, (mu, roughness, light)) in cases.iter().enumerate() {
        let truth = light.reflected(*mu, *roughness);
        let (a, b) = (f64::from(own[i]), f64::from(theirs[i]));
        let text = format!("mu {mu} roughness {roughness} light {}: {a}, with its own {b}, GGX {truth}", light.centre);
        eprintln!("{text}");
        assert!(a > 0.0 && b > 0.0, "{text}");
        off_own += (a - truth).abs();
        off_theirs += (b - truth).abs();
    }
    eprintln!("off by {off_own} altogether, with its own table by {off_theirs}");
    assert!(off_own < off_theirs, "{off_own} {off_theirs}");
}
