//! What Bevy's own renderer makes of what `kiln bake --engine bevy --env` writes: spheres, rendered without a window, read before tone mapping,
//! against what the formulas say. A map that shows black fails.
#![cfg(test)]

#[allow(dead_code)] // other engines take more of it
#[path = "../../suite/support/directions.rs"]
mod directions;
#[path = "../../suite/support/room.rs"]
mod room;

use bevy::asset::RenderAssetUsages;
use bevy::camera::{Exposure, Hdr, RenderTarget, ScalingMode};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::image::{CompressedImageFormats, ImageSampler, ImageType};
use bevy::light::{EnvironmentMapLight, GlobalAmbientLight};
use bevy::pbr::{DfgLut, PbrPlugin};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::TextureFormat;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use kiln::integrate::{Integration, Settings};
use kiln::pack::{Number, TexelFormat};
use kiln::table::{Model, Parameter, Point, quantity};
use std::collections::HashMap;
use std::path::Path;

/// Pixels across a sphere.
const SIZE: usize = 128;
/// Columns and rows of spheres in a picture.
const GRID: [usize; 2] = [3, 2];

/// A sphere: base colour, metallic, roughness.
const SPHERES: [(&str, f32, f32, f32); 6] = [
    ("metal", 1.0, 1.0, 0.6),
    ("grey", 0.5, 1.0, 0.6),
    ("plastic", 0.0, 0.0, 0.4),
    ("mirror", 1.0, 1.0, 0.0),
    ("rough", 1.0, 1.0, 0.5),
    ("matt", 1.0, 0.0, 1.0),
];

/// The pictures by the name of their environment.
#[derive(Resource, Default)]
struct Found(HashMap<&'static str, Vec<f32>>);

/// Bakes everything that Bevy reads.
fn bake(folder: &Path) {
    directions::directions(folder);
    let inputs = ["builtin:white", "builtin:orientation"].map(str::to_owned);
    let file = folder.join("directions.exr").to_string_lossy().into_owned();
    let engine = kiln::engine::find("bevy").expect("an engine");
    let mut recipe = kiln::engine::recipe(&[engine], &[&inputs[..], &[file]].concat(), false).expect("a recipe");
    for table in &recipe.tables {
        kiln::bake::table(table, &|_| {}).expect("a table").write(folder).expect("a folder");
    }
    for environment in &mut recipe.environments {
        environment.size = 128;
        environment.roughness = engine.environment.as_ref().map(|preset| preset.level_roughness(128, false));
        let source = kiln::bake::source(environment).expect("an input");
        kiln::bake::environment(environment, &source, &|_| {}).expect("a bake").write(folder).expect("a folder");
    }
}

/// The table, handed over before Bevy takes its own.
struct Table(Vec<u8>);

impl Plugin for Table {
    fn build(&self, app: &mut App) {
        let table = Image::from_buffer(
            &self.0,
            ImageType::Extension("ktx2"),
            CompressedImageFormats::NONE,
            false,
            ImageSampler::linear(),
            RenderAssetUsages::RENDER_WORLD,
        );
        let texture = app.world_mut().resource_mut::<Assets<Image>>().add(table.expect("a table that Bevy reads"));
        app.sub_app_mut(RenderApp).world_mut().insert_resource(DfgLut { texture });
    }
}

/// Renders every sphere in every environment: what is seen along −Z, row 0 at the top.
fn render(folder: &Path) -> HashMap<&'static str, Vec<f32>> {
    let table = Table(std::fs::read(folder.join("bevy/dfg.ktx2")).expect("a table"));
    let mut app = App::new();
    let files = AssetPlugin { file_path: folder.join("bevy").to_string_lossy().into_owned(), ..default() };
    app.add_plugins(DefaultPlugins.set(files).add_before::<PbrPlugin>(table));
    app.insert_resource(GlobalAmbientLight::NONE).insert_resource(ClearColor(Color::BLACK)).init_resource::<Found>();
    app.finish();
    app.cleanup();
    let world = app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Sphere::new(1.0).mesh().uv(192, 96));
    for (i, (_, color, metallic, perceptual_roughness)) in SPHERES.into_iter().enumerate() {
        let base_color = Color::linear_rgb(color, color, color);
        let material = StandardMaterial { base_color, metallic, perceptual_roughness, ..default() };
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        let at = Vec3::new((i % GRID[0]) as f32 * 2.0 - 2.0, 1.0 - (i / GRID[0]) as f32 * 2.0, 0.0);
        world.spawn((Mesh3d(mesh.clone()), MeshMaterial3d(material), Transform::from_translation(at)));
    }
    let [width, height] = GRID.map(|n| (n * SIZE) as u32);
    let mut targets = vec![];
    let mut maps = vec![];
    for name in ["white", "orientation", "directions"] {
        let load = |kind: &str| format!("{name}/{name}_{kind}_rgb9e5_zstd.ktx2");
        let server = world.resource::<AssetServer>();
        let [diffuse_map, specular_map] = ["diffuse", "specular"].map(|kind| server.load::<Image>(load(kind)));
        maps.extend([diffuse_map.clone(), specular_map.clone()]);
        let picture = Image::new_target_texture(width, height, TextureFormat::Rgba16Float, None);
        let target = world.resource_mut::<Assets<Image>>().add(picture);
        let light = EnvironmentMapLight { diffuse_map, specular_map, intensity: 1.0, ..default() };
        let projection = OrthographicProjection {
            scaling_mode: ScalingMode::Fixed { width: 2.0 * GRID[0] as f32, height: 2.0 * GRID[1] as f32 },
            ..OrthographicProjection::default_3d()
        };
        world.spawn((
            Camera3d::default(),
            RenderTarget::Image(target.clone().into()),
            Projection::Orthographic(projection),
            Transform::from_xyz(0.0, 0.0, 3.0),
            (Hdr, Msaa::Off, Tonemapping::None, light),
            // 2^-EV100 / 1.2 is one.
            Exposure { ev100: -1.2_f32.log2() },
        ));
        targets.push((name, target));
    }
    let loaded = |app: &App| maps.iter().all(|map| app.world().resource::<AssetServer>().is_loaded(map));
    for _ in 0..1000 {
        app.update();
        if loaded(&app) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    assert!(loaded(&app), "Bevy does not load what was baked for it");
    // What was loaded is sent to the device, and pipelines are made.
    (0..20).for_each(|_| app.update());
    for (name, target) in targets {
        app.world_mut().spawn(Screenshot::image(target)).observe(
            move |captured: On<ScreenshotCaptured>, mut found: ResMut<Found>| {
                let image = &captured.image;
                assert_eq!(image.texture_descriptor.format, TextureFormat::Rgba16Float);
                let halves = TexelFormat::Plain { channels: 4, number: Number::F16 };
                let data = image.data.as_ref().expect("pixels");
                found.0.insert(name, halves.unpack(image.width() as usize, image.height() as usize, data));
            },
        );
    }
    for _ in 0..1000 {
        app.update();
        if app.world().resource::<Found>().0.len() == 3 {
            break;
        }
    }
    std::mem::take(&mut app.world_mut().resource_mut::<Found>().0)
}

/// The normal and the colour at every pixel of a sphere within `radius` of its middle.
fn within(picture: &[f32], sphere: &str, radius: f64) -> Vec<([f64; 3], [f64; 3])> {
    let index = SPHERES.iter().position(|(name, ..)| *name == sphere).expect("a sphere");
    let [left, top] = [index % GRID[0], index / GRID[0]].map(|i| i * SIZE);
    let pixel = |i: usize| {
        let [column, row] = [i % SIZE, i / SIZE];
        let at = |p: usize| (p as f64 + 0.5) / SIZE as f64 * 2.0 - 1.0;
        let [x, y] = [at(column), -at(row)];
        let start = 4 * ((top + row) * GRID[0] * SIZE + left + column);
        let colour = [0, 1, 2].map(|c| f64::from(picture[start + c]));
        (x * x + y * y < radius * radius).then(|| ([x, y, (1.0 - x * x - y * y).sqrt()], colour))
    };
    (0..SIZE * SIZE).filter_map(pixel).collect()
}

fn value(name: &str, mu: f64, roughness: f64, f0: Option<f64>) -> f64 {
    let at = Point::default().with(Parameter::Mu, mu).expect("a point");
    let at = at.with(Parameter::Roughness, roughness).expect("a point");
    let at = f0.map_or(at, |f0| at.with(Parameter::F0, f0).expect("a point"));
    let integration = Integration::new(Settings { tolerance: Some(1e-5), ..Settings::default() }).expect("settings");
    quantity::find(name).expect("a quantity").evaluate(&at, &Model::default(), &integration).expect("a value").value
}

/// How much of what is linear in the direction the kernel G1(c)/(1 − βc)² keeps.
fn kept(roughness: f64) -> f64 {
    let alpha = roughness * roughness;
    if alpha < 1e-3 {
        return 1.0;
    }
    let (a2, n) = (alpha * alpha, 20_000);
    let beta = (1.0 - a2) / (1.0 + a2);
    let (mut weighted, mut total) = (0.0, 0.0);
    for i in 0..n {
        let t = (f64::from(i) + 0.5) / f64::from(n);
        let c = 1.0 - t.powi(3);
        let g1 = 2.0 * c / (c + (a2 + (1.0 - a2) * c * c).sqrt());
        let k = g1 / (1.0 - beta * c).powi(2) * t * t;
        weighted += k * c;
        total += k;
    }
    weighted / total
}

/// Half a step of RGB9E5 of a value whose brightest channel may be three times as bright, and what a sphere of facets and halves are off by.
const LIMIT: f64 = 3.0 * 0.5 / 256.0 + 0.005;

#[test]
fn bevy_renders_what_kiln_bakes_for_it() {
    let folder = tempfile::tempdir().expect("a folder");
    bake(folder.path());
    let found = render(folder.path());
    assert_eq!(found.len(), 3, "pictures of {:?}", found.keys());

    // A white metal loses nothing, whatever the table; what judges it: grey, and a black dielectric.
    for (normal, colour) in within(&found["white"], "metal", 0.95) {
        assert!(colour.iter().all(|c| (c - 1.0).abs() < 2e-3), "a white metal at {normal:?}: {colour:?}");
    }
    for (sphere, f0, roughness) in [("grey", 0.5, 0.6), ("plastic", 0.04, 0.4)] {
        for (normal, colour) in within(&found["white"], sphere, 0.95).into_iter().step_by(37) {
            let wanted = value("compensation.fdez-aguera", normal[2], roughness, Some(f0));
            for c in colour {
                assert!((c - wanted).abs() < 0.005 * wanted, "{sphere} at {normal:?}: {colour:?}, wanted {wanted}");
            }
        }
    }
    let mirrored = |[x, y, z]: [f64; 3]| [2.0 * z * x, 2.0 * z * y, 2.0 * z * z - 1.0];
    room::assert_reads(512, &within(&found["orientation"], "mirror", 0.9), mirrored);
    // Direction, level and filter: E of the reflection, the rest as irradiance.
    let levels = 8;
    for (sphere, roughness) in [("mirror", 0.0), ("rough", 0.5), ("matt", 1.0)] {
        // Its direction leaves the mirror's by a smoothness of at least 0.089².
        let smoothness = 1.0 - f64::from(roughness).max(0.089_f64).powi(2);
        let share = smoothness * (smoothness.sqrt() + 1.0 - smoothness);
        let level = roughness * f64::from(levels - 1);
        let filled = |level: f64| kept((level / f64::from(levels - 1)).min(1.0));
        let fade = filled(level.floor()) * (1.0 - level.fract()) + filled(level.floor() + 1.0) * level.fract();
        for (normal, colour) in within(&found["directions"], sphere, 0.8).into_iter().step_by(37) {
            let mirror = mirrored(normal);
            let mixed: [f64; 3] = std::array::from_fn(|c| normal[c] + (mirror[c] - normal[c]) * share);
            let length = mixed.iter().map(|c| c * c).sum::<f64>().sqrt();
            let f0 = if sphere == "matt" { 0.04 } else { 1.0 };
            let single = value("compensation.none", normal[2], roughness, Some(f0));
            for c in 0..3 {
                let (specular, diffuse) = (1.0 + fade * mixed[c] / length / 2.0, 1.0 + normal[c] / 3.0);
                let wanted = single * specular + (1.0 - single) * diffuse;
                assert!(
                    (colour[c] - wanted).abs() < LIMIT * wanted,
                    "{sphere} at {normal:?}, channel {c}: {colour:?}, wanted {wanted}"
                );
            }
        }
    }
}
