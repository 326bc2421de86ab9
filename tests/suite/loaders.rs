//! What engines' own renderers make of the environments that Kiln writes: spheres, rendered in headless Chromium, read as floats before
//! tone mapping, against what the formulas say. A loader that shows black without an error fails here.

#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

use crate::support::directions::{directions, kept};
use crate::support::kiln::succeed;
use crate::support::{browser, tools};
use kiln::integrate::{Integration, Settings};
use kiln::table::{Model, Parameter, Point, quantity};
use std::collections::HashMap;
use std::path::Path;

/// Pixels along an edge of the pictures.
const SIZE: usize = 128;
/// Levels of the chains; the roughness of level m is 1 − √(1 − m/4), as three.js has it.
const LEVELS: usize = 5;

fn roughness_of(level: usize) -> f64 {
    1.0 - (1.0 - level as f64 / (LEVELS - 1) as f64).sqrt()
}

/// A picture of a sphere seen along −Z: colour by pixel, row 0 at the bottom.
struct Sphere {
    pixels: Vec<f32>,
}

impl Sphere {
    /// The normal and the colour at every pixel within `radius` of the middle.
    fn within(&self, radius: f64) -> impl Iterator<Item = ([f64; 3], [f64; 3])> {
        (0..SIZE * SIZE).filter_map(move |i| {
            let at = |p: usize| (p as f64 + 0.5) / SIZE as f64 * 2.0 - 1.0;
            let (x, y) = (at(i % SIZE), at(i / SIZE));
            let rest = 1.0 - x * x - y * y;
            let colour = [0, 1, 2].map(|c| f64::from(self.pixels[4 * i + c]));
            (x * x + y * y < radius * radius).then(|| ([x, y, rest.sqrt()], colour))
        })
    }
}

struct Scene {
    name: &'static str,
    cube: &'static str,
    /// The file of the BRDF's table; nothing for the engine's own.
    table: Option<&'static str>,
    color: f64,
    metalness: f64,
    roughness: f64,
}

fn render(script: &str, folder: &Path, scenes: &[Scene]) -> Option<HashMap<String, Sphere>> {
    let list: Vec<_> = scenes
        .iter()
        .map(|s| {
            serde_json::json!({
                "name": s.name, "cube": s.cube, "table": s.table, "size": SIZE,
                "color": s.color, "metalness": s.metalness, "roughness": s.roughness
            })
        })
        .collect();
    let mut files = HashMap::from([("scenes.json".to_owned(), serde_json::Value::from(list).to_string().into_bytes())]);
    for scene in scenes {
        for file in [Some(scene.cube), scene.table].into_iter().flatten() {
            files.insert(file.to_owned(), std::fs::read(folder.join(file)).unwrap());
        }
    }
    let results = browser::run(script, files)?;
    Some(results.iter().map(|(name, bytes)| (name.clone(), Sphere { pixels: browser::floats(bytes) })).collect())
}

fn value(name: &str, mu: f64, roughness: f64, f0: Option<f64>) -> f64 {
    let at = Point::default().with(Parameter::Mu, mu).unwrap().with(Parameter::Roughness, roughness).unwrap();
    let at = f0.map_or(at, |f0| at.with(Parameter::F0, f0).unwrap());
    let integration = Integration::new(Settings { tolerance: Some(1e-5), ..Settings::default() }).unwrap();
    quantity::find(name).unwrap().evaluate(&at, &Model::default(), &integration).unwrap().value
}

/// What three.js makes of a roughness: at least 0.045, and rougher by how fast the normal turns from pixel to pixel.
fn roughness_in_threejs(roughness: f64, [x, y, z]: [f64; 3]) -> f64 {
    let step = 2.0 / SIZE as f64;
    (roughness.max(0.045) + step * (x.abs() / z).max(y.abs() / z).max(1.0)).min(1.0)
}

#[test]
fn threejs_renders_what_kiln_bakes_for_it() {
    if tools::folder_with("node_modules/three").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    directions(folder.path());
    let roughness: Vec<String> = (0..LEVELS).map(|m| roughness_of(m).to_string()).collect();
    let roughness = roughness.join(",");
    for (input, out) in [("builtin:white", "white"), ("directions.exr", "directions")] {
        // Turned as the preset has it, in texels that a page can hand over as they are.
        let chain = ["--engine", "threejs", "--format", "ktx2:rgba16f", "--size", "128", "--roughness", &roughness];
        succeed(folder.path(), &[&["-q", "env", input, "--out", out], &chain[..]].concat());
    }
    let (white, directions) = ("white/specular.ktx2", "directions/specular.ktx2");
    let probe = "directions/sh.json";
    let scenes = [
        Scene { name: "metal", cube: white, table: None, color: 1.0, metalness: 1.0, roughness: 0.6 },
        Scene { name: "grey", cube: white, table: None, color: 0.5, metalness: 1.0, roughness: 0.6 },
        Scene { name: "plastic", cube: white, table: None, color: 0.0, metalness: 0.0, roughness: 0.4 },
        Scene { name: "mirror", cube: directions, table: None, color: 1.0, metalness: 1.0, roughness: 0.0 },
        Scene { name: "probe", cube: probe, table: None, color: 1.0, metalness: 0.0, roughness: 1.0 },
        Scene { name: "rough", cube: directions, table: None, color: 1.0, metalness: 1.0, roughness: 0.5 },
    ];
    let Some(found) = render(include_str!("support/threejs.js"), folder.path(), &scenes) else { return };

    // A white metal loses nothing, whatever table it uses; half floats and their sums.
    for (normal, colour) in found["metal"].within(0.95) {
        for c in colour {
            assert!((c - 1.0).abs() < 2e-3, "a white metal in a white furnace at {normal:?}: {colour:?}");
        }
    }
    // What judges the table: three.js has its own of 16², whose texels were found up to 0.7 % low; between them it is off by as much
    // again where the angle is not grazing.
    for (name, f0, roughness) in [("grey", 0.5, 0.6), ("plastic", 0.04, 0.4)] {
        for (normal, colour) in found[name].within(0.8).step_by(37) {
            let wanted =
                value("compensation.fdez-aguera", normal[2], roughness_in_threejs(roughness, normal), Some(f0));
            for c in colour {
                assert!(
                    (c - wanted).abs() < 0.015 * wanted.max(0.2),
                    "{name} at {normal:?}: {colour:?}, wanted {wanted}"
                );
            }
        }
    }
    // A light probe takes the coefficients as they are, and lights the world the right way round; 1e-3 for the facets.
    for (normal, colour) in found["probe"].within(0.9).step_by(37) {
        for c in 0..3 {
            let wanted = 1.0 + kept(1.0) * normal[c] / 2.0;
            assert!(
                (colour[c] - wanted).abs() < 1e-3 * wanted,
                "the light probe at {normal:?}, channel {c}: {colour:?}, wanted {wanted}"
            );
        }
    }
    // Direction, level and filter: E of the reflection, and the rest as irradiance.
    for (name, roughness) in [("mirror", 0.0), ("rough", 0.5)] {
        for (normal, colour) in found[name].within(0.8).step_by(37) {
            let [x, y, z] = normal;
            let q = roughness_in_threejs(roughness, normal);
            let mirror = [2.0 * z * x, 2.0 * z * y, 2.0 * z * z - 1.0];
            let mixed: [f64; 3] = std::array::from_fn(|c| mirror[c] + (normal[c] - mirror[c]) * q.powi(4));
            let length = mixed.iter().map(|c| c * c).sum::<f64>().sqrt();
            let level = q * (2.0 - q) * (LEVELS - 1) as f64;
            let (below, part) = (level.floor() as usize, level.fract());
            let above = (below + 1).min(LEVELS - 1);
            let fade = kept(roughness_of(below)) * (1.0 - part) + kept(roughness_of(above)) * part;
            let e = value("ggx.albedo", z, q, None);
            for c in 0..3 {
                let (specular, diffuse) = (1.0 + fade * mixed[c] / length / 2.0, 1.0 + kept(1.0) * normal[c] / 2.0);
                let wanted = e * specular + (1.0 - e) * diffuse;
                // Pixels of a sphere of facets, q by its differences, E by three.js' own table: 1 % of what is there.
                assert!(
                    (colour[c] - wanted).abs() < 0.01 * wanted,
                    "{name} at {normal:?}, channel {c}: {colour:?}, wanted {wanted}"
                );
            }
        }
    }
}

/// A code of RGBD is off by half of 1/255, 2.2 times that of a value at least 0.7 of the largest code, and the divisor as much.
const RGBD: f64 = 2.0 * 2.2 * 0.5 / 255.0 / 0.7;
/// What the facets of Babylon.js' sphere, and blends of codes instead of values, are off by.
const FACETS: f64 = 0.005;

#[test]
fn babylonjs_renders_what_kiln_bakes_for_it() {
    if tools::folder_with("node_modules/@babylonjs/core").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    directions(folder.path());
    for (input, size) in [("directions.exr", "32"), ("builtin:white", "8")] {
        succeed(folder.path(), &["-q", "env", input, "--engine", "babylon", "--size", size, "--out", "baked"]);
    }
    let table = ["-q", "table", "dfg", "--engine", "babylon", "--size", "64", "-o", "environmentBRDF.png"];
    succeed(folder.path(), &table);
    let (white, directions) = ("baked/white.env", "baked/directions.env");
    let table = Some("environmentBRDF.png");
    let scenes = [
        Scene { name: "mirror", cube: directions, table: None, color: 1.0, metalness: 1.0, roughness: 0.0 },
        Scene { name: "metal", cube: white, table, color: 1.0, metalness: 1.0, roughness: 0.6 },
        Scene { name: "own", cube: white, table: None, color: 1.0, metalness: 1.0, roughness: 0.6 },
        Scene { name: "grey", cube: white, table, color: 0.5, metalness: 1.0, roughness: 0.6 },
        Scene { name: "plastic", cube: white, table, color: 0.0, metalness: 0.0, roughness: 0.4 },
    ];
    let Some(found) = render(include_str!("support/babylon.js"), folder.path(), &scenes) else { return };

    // The right way round.
    for (normal, colour) in found["mirror"].within(0.8).step_by(37) {
        let [x, y, z] = normal;
        // Babylon.js' world is left-handed: to the right is its +X, which is -X of the world that was baked; and away from the viewer is +Z.
        let mirror = [-2.0 * z * x, 2.0 * z * y, 1.0 - 2.0 * z * z];
        for c in 0..3 {
            let wanted = 1.0 + mirror[c] / 2.0;
            assert!(
                (colour[c] - wanted).abs() < (RGBD + FACETS) * wanted,
                "the mirror at {normal:?}, channel {c}: {colour:?}, wanted {wanted}"
            );
        }
    }
    // A white metal loses nothing, whatever table it uses: E + (1 − E), and 1 is a code of RGBD. What shows black fails here.
    for name in ["metal", "own"] {
        for (normal, colour) in found[name].within(0.95) {
            for c in colour {
                assert!((c - 1.0).abs() < 2e-3, "a white metal ({name}) in a white furnace at {normal:?}: {colour:?}");
            }
        }
    }
    // What judges the table: x + F0 (y − x), with Turquin's compensation, by Kiln's own integrals.
    for (name, f0, roughness) in [("grey", 0.5, 0.6), ("plastic", 0.04, 0.4)] {
        for (normal, colour) in found[name].within(0.9).step_by(37) {
            let wanted = value("compensation.turquin", normal[2], roughness, Some(f0));
            for c in colour {
                assert!(
                    (c - wanted).abs() < (RGBD + FACETS) * wanted,
                    "{name} at {normal:?}: {colour:?}, wanted {wanted}"
                );
            }
        }
    }
}
