//! What engines' own renderers make of the environments that Kiln writes: spheres, rendered in headless Chromium, read as floats before
//! tone mapping, against what the formulas say. A loader that shows black without an error fails here.

#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

use crate::support::directions::{directions, kept};
use crate::support::kiln::succeed;
use crate::support::samples::Random;
use crate::support::{browser, room, tools};
use kiln::format::{Decoded, Image, Texture, decode, exr, ktx2};
use kiln::integrate::{Integration, Settings};
use kiln::pack::{Number, TexelFormat, binary16, uastc_hdr};
use kiln::table::{Model, Parameter, Point, quantity};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Pixels along an edge of the pictures.
const SIZE: usize = 128;
/// Levels of the chains; the roughness of level m is 1 − √(1 − m/4), as three.js has it.
const LEVELS: usize = 5;
/// What the preset of three.js writes, in blocks that its own loader takes.
const OWN: [&str; 3] = ["own-white/white.ktx2", "own-directions/directions.ktx2", "own-room/orientation.ktx2"];

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

/// What a page rendered, by scene, and whatever else it posted.
struct Rendered(browser::Results);

impl Rendered {
    fn sphere(&self, name: &str) -> Sphere {
        Sphere { pixels: browser::floats(&self.0[name]) }
    }
}

fn render(script: &str, folder: &Path, scenes: &[Scene]) -> Option<Rendered> {
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
    browser::run(script, files).map(Rendered)
}

/// Texels of `builtin:orientation` around: as large as a sphere of so few pixels shows it.
const ROOM: usize = 256;

/// Writes it as `orientation.exr`.
fn write_room(folder: &Path) {
    let room = kiln::environment::builtin("orientation", ROOM).unwrap();
    let texels = room.texels().as_flattened().to_vec();
    let image = Image::new(room.width(), room.height(), &["R", "G", "B"], texels).unwrap();
    std::fs::write(folder.join("orientation.exr"), exr::encode(&image, Number::F32).unwrap().0).unwrap();
}

/// Whether the mirror sphere `room` shows it as its labels read: see [`room::assert_reads`].
fn assert_reads(rendered: &Rendered, mirrored: impl Fn([f64; 3]) -> [f64; 3]) {
    room::assert_reads(ROOM, &rendered.sphere("room").within(0.9).collect::<Vec<_>>(), mirrored);
}

/// Holds pixels of the sphere `name` against the colour that a normal should have; `limit` says by how much a channel of such a value may be off.
fn assert_shows(
    name: &str,
    pixels: impl Iterator<Item = ([f64; 3], [f64; 3])>,
    wanted: impl Fn([f64; 3]) -> [f64; 3],
    limit: impl Fn(usize, f64) -> f64,
) {
    for (normal, colour) in pixels {
        let wanted = wanted(normal);
        for c in 0..3 {
            let limit = limit(c, wanted[c]);
            assert!(
                (colour[c] - wanted[c]).abs() < limit,
                "{name} at {normal:?}, channel {c}: {colour:?}, wanted {wanted:?} within {limit}"
            );
        }
    }
}

/// The unit vector a part of the way from the mirrored direction to the normal: where rough lobes are looked up.
fn towards(normal: [f64; 3], mirror: [f64; 3], part: f64) -> [f64; 3] {
    let mixed: [f64; 3] = std::array::from_fn(|c| mirror[c] + (normal[c] - mirror[c]) * part);
    let length = mixed.iter().map(|c| c * c).sum::<f64>().sqrt();
    mixed.map(|c| c / length)
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
    // And as the preset has them.
    for (input, file) in ["builtin:white", "directions.exr", "builtin:orientation"].into_iter().zip(OWN) {
        let out = file.split('/').next().unwrap();
        let chain = ["--engine", "threejs", "--size", "64", "--roughness", &roughness];
        succeed(folder.path(), &[&["-q", "env", input, "--out", out], &chain[..]].concat());
    }
    succeed(folder.path(), &["-q", "convert", OWN[2], "room.ktx2", "--format", "ktx2:rgba16f"]);
    std::fs::write(folder.path().join("any.ktx2"), any_blocks()).unwrap();
    let (white, directions) = ("white/specular.ktx2", "directions/specular.ktx2");
    let probe = "directions/sh.json";
    let [own_white, own_directions, own_room] = OWN;
    let scenes = [
        Scene { name: "metal", cube: white, table: None, color: 1.0, metalness: 1.0, roughness: 0.6 },
        Scene { name: "grey", cube: white, table: None, color: 0.5, metalness: 1.0, roughness: 0.6 },
        Scene { name: "plastic", cube: white, table: None, color: 0.0, metalness: 0.0, roughness: 0.4 },
        Scene { name: "mirror", cube: directions, table: None, color: 1.0, metalness: 1.0, roughness: 0.0 },
        Scene { name: "probe", cube: probe, table: None, color: 1.0, metalness: 0.0, roughness: 1.0 },
        Scene { name: "rough", cube: directions, table: None, color: 1.0, metalness: 1.0, roughness: 0.5 },
        Scene { name: "own-metal", cube: own_white, table: None, color: 1.0, metalness: 1.0, roughness: 0.6 },
        Scene { name: "own-mirror", cube: own_directions, table: None, color: 1.0, metalness: 1.0, roughness: 0.0 },
        Scene { name: "own-room", cube: own_room, table: None, color: 1.0, metalness: 1.0, roughness: 0.0 },
        Scene { name: "room", cube: "room.ktx2", table: None, color: 1.0, metalness: 1.0, roughness: 0.0 },
        Scene { name: "any-blocks", cube: "any.ktx2", table: None, color: 1.0, metalness: 1.0, roughness: 0.0 },
    ];
    let Some(rendered) = render(include_str!("support/threejs.js"), folder.path(), &scenes) else { return };
    for file in OWN.into_iter().chain(["any.ktx2"]) {
        transcoder_makes_what_kiln_says(&std::fs::read(folder.path().join(file)).unwrap(), file, &rendered.0);
    }

    // A white metal loses nothing, whatever table it uses; half floats and their sums.
    for name in ["metal", "own-metal"] {
        assert_shows(name, rendered.sphere(name).within(0.95), |_| [1.0; 3], |_, _| 2e-3);
    }
    // What judges the table: three.js has its own of 16², whose texels were found up to 0.7 % low; between them it is off by as much
    // again where the angle is not grazing.
    for (name, f0, roughness) in [("grey", 0.5, 0.6), ("plastic", 0.04, 0.4)] {
        let wanted = |normal: [f64; 3]| {
            [value("compensation.fdez-aguera", normal[2], roughness_in_threejs(roughness, normal), Some(f0)); 3]
        };
        let pixels = rendered.sphere(name);
        assert_shows(name, pixels.within(0.8).step_by(37), wanted, |_, wanted| 0.015 * wanted.max(0.2));
    }
    // A room of letters and arrows, as the loader shows it and as Kiln decodes it: lookups are means of texels, which transcoding changed by so much
    // at most; half floats.
    let changed = transcoding(&texture(&std::fs::read(folder.path().join(own_room)).unwrap()));
    let (room, own) = (rendered.sphere("room"), rendered.sphere("own-room"));
    for ((normal, wanted), (_, colour)) in room.within(0.9).zip(own.within(0.9)) {
        for c in 0..3 {
            let off = (colour[c] - wanted[c]).abs();
            assert!(off <= changed + 2e-3, "the room at {normal:?}, channel {c}: {colour:?}, wanted {wanted:?}");
        }
    }
    // A light probe takes the coefficients as they are, and lights the world the right way round; 1e-3 for the facets.
    let faded = kept(1.0);
    let wanted = |normal: [f64; 3]| normal.map(|n| 1.0 + faded * n / 2.0);
    assert_shows("probe", rendered.sphere("probe").within(0.9).step_by(37), wanted, |_, wanted| 1e-3 * wanted);
    // Direction, level and filter: E of the reflection, and the rest as irradiance.
    for (name, roughness) in [("mirror", 0.0), ("own-mirror", 0.0), ("rough", 0.5)] {
        // In parts of the darkest value.
        let packing = if name == "own-mirror" { packing_error(folder.path(), own_directions) / 0.5 } else { 0.0 };
        let matt = kept(1.0);
        let wanted = |normal: [f64; 3]| {
            let [x, y, z] = normal;
            let q = roughness_in_threejs(roughness, normal);
            let mixed = towards(normal, [2.0 * z * x, 2.0 * z * y, 2.0 * z * z - 1.0], q.powi(4));
            let level = q * (2.0 - q) * (LEVELS - 1) as f64;
            let (below, part) = (level.floor() as usize, level.fract());
            let above = (below + 1).min(LEVELS - 1);
            let fade = kept(roughness_of(below)) * (1.0 - part) + kept(roughness_of(above)) * part;
            let e = value("ggx.albedo", z, q, None);
            std::array::from_fn(|c| {
                let (specular, diffuse) = (1.0 + fade * mixed[c] / 2.0, 1.0 + matt * normal[c] / 2.0);
                e * specular + (1.0 - e) * diffuse
            })
        };
        // Pixels of a sphere of facets, q by its differences, E by three.js' own table: 1 % of what is there.
        let off = |_, wanted| (0.01 + packing) * wanted;
        assert_shows(name, rendered.sphere(name).within(0.8).step_by(37), wanted, off);
    }
}

/// What texels in blocks may be off by when they are shown: what the certificate says of ASTC, and what transcoding adds.
fn packing_error(folder: &Path, file: &str) -> f64 {
    let certificate = std::fs::read(folder.join(file).with_file_name("certificate.json")).unwrap();
    let certificate: serde_json::Value = serde_json::from_slice(&certificate).unwrap();
    let stated = certificate["packing"]["max_abs_error"].as_f64().unwrap();
    stated + transcoding(&texture(&std::fs::read(folder.join(file)).unwrap()))
}

/// The largest difference that transcoding makes to any texel.
fn transcoding(texture: &Texture) -> f64 {
    let differences = pictures(texture).map(|(width, blocks)| {
        let [astc, bc6h] = [uastc_hdr::unpack, uastc_hdr::unpack_transcoded].map(|unpack| unpack(width, width, blocks));
        astc.iter().zip(bc6h).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
    });
    differences.fold(0.0, f64::max)
}

fn texture(file: &[u8]) -> Texture {
    let Ok(Decoded::Texture(texture)) = decode(file) else { panic!("no texture") };
    assert_eq!((texture.format, texture.faces), (TexelFormat::UastcHdr, 6));
    texture
}

/// Size and blocks of each face of each level.
fn pictures(texture: &Texture) -> impl Iterator<Item = (usize, &[u8])> {
    texture.levels.iter().enumerate().flat_map(|(level, bytes)| {
        let width = texture.level_size(level)[0];
        bytes.chunks_exact(bytes.len() / 6).map(move |blocks| (width, blocks))
    })
}

/// Basis Universal's transcoder, as three.js has it, decodes a file to the very bits that Kiln does; and the BC6H that it makes of it decodes,
/// by another author's decoder, to the bits that our encoder foresaw.
fn transcoder_makes_what_kiln_says(file: &[u8], name: &str, posted: &browser::Results) {
    let posted = |kind: &str| &posted[&format!("{}-{kind}", name.replace('/', "-"))][..];
    let (mut halves, mut bc6h) = (posted("halves"), posted("bc6h"));
    for (i, (width, blocks)) in pictures(&texture(file)).enumerate() {
        let theirs = halves.split_off(..8 * width * width).unwrap();
        let theirs: Vec<f32> =
            binary16::unpack(theirs).chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
        assert!(
            theirs == uastc_hdr::unpack(width, width, blocks),
            "{name}, picture {i}: another decoder reads other halves"
        );
        let theirs = kiln::pack::bc6h::unpack(width, width, bc6h.split_off(..blocks.len()).unwrap());
        let ours = uastc_hdr::unpack_transcoded(width, width, blocks);
        assert!(theirs == ours, "{name}, picture {i}: transcoding makes something else of it");
    }
    assert!(halves.is_empty() && bc6h.is_empty(), "{name}: more than the file holds");
}

/// A cube of blocks of every mode of UASTC HDR, with whatever end points and weights.
fn any_blocks() -> Vec<u8> {
    // The block modes of ASTC for a grid of 4 × 4 weights of 3, 4, 5, 6, 8, 10, 12 and 16 levels.
    let grids = [0x51, 0x42, 0x52, 0x43, 0x53, 0x241, 0x251, 0x242_u128];
    let one = |grid: u128, kind: u128| grid | kind << 13;
    let mut heads: Vec<(u128, u32)> = grids.iter().flat_map(|&g| [7, 11].map(|kind| (one(g, kind), 17))).collect();
    for (i, seed) in [
        28, 20, 16, 29, 91, 9, 107, 72, 149, 204, 50, 114, 496, 17, 78, 39, 252, 828, 43, 156, 116, 210, 476, 273, 684,
        359, 246,
    ]
    .into_iter()
    .enumerate()
    {
        let two = |grid: u128, kind: u128| (grid | 1 << 11 | seed << 13 | kind << 25, 29);
        heads.extend([two(grids[i % 5], 7), two(grids[i % 2], 11)]);
    }
    let size = 40; // 600 blocks: each head a few times
    let mut random = Random(11);
    let mut bytes = vec![];
    while bytes.len() < 6 * size * size {
        for &(head, bits) in &heads {
            let rest = u128::from(random.next()) << 64 | u128::from(random.next());
            let block = (head | rest >> bits << bits).to_le_bytes();
            // Those whose end points are infinite are none of the subset's.
            if uastc_hdr::unpack(4, 4, &block).iter().all(|v| v.is_finite()) {
                bytes.extend(block);
            }
        }
    }
    bytes.truncate(6 * size * size);
    ktx2::encode(&Texture { levels: vec![bytes], ..Texture::empty_cube(TexelFormat::UastcHdr, size) }).unwrap()
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
    write_room(folder.path());
    for (input, size) in [("directions.exr", "32"), ("builtin:white", "8"), ("orientation.exr", "64")] {
        succeed(folder.path(), &["-q", "env", input, "--engine", "babylon", "--size", size, "--out", "baked"]);
    }
    let table = ["-q", "table", "dfg", "--engine", "babylon", "--size", "64", "-o", "environmentBRDF.png"];
    succeed(folder.path(), &table);
    let (white, directions, room) = ("baked/white.env", "baked/directions.env", "baked/orientation.env");
    let table = Some("environmentBRDF.png");
    let scenes = [
        Scene { name: "mirror", cube: directions, table: None, color: 1.0, metalness: 1.0, roughness: 0.0 },
        Scene { name: "room", cube: room, table: None, color: 1.0, metalness: 1.0, roughness: 0.0 },
        Scene { name: "metal", cube: white, table, color: 1.0, metalness: 1.0, roughness: 0.6 },
        Scene { name: "own", cube: white, table: None, color: 1.0, metalness: 1.0, roughness: 0.6 },
        Scene { name: "grey", cube: white, table, color: 0.5, metalness: 1.0, roughness: 0.6 },
        Scene { name: "plastic", cube: white, table, color: 0.0, metalness: 0.0, roughness: 0.4 },
    ];
    let Some(rendered) = render(include_str!("support/babylon.js"), folder.path(), &scenes) else { return };

    // The right way round. Babylon.js' world is left-handed: to the right is its +X, which is -X of the world that was baked; and away from
    // the viewer is +Z.
    let mirrored = |[x, y, z]: [f64; 3]| [-2.0 * z * x, 2.0 * z * y, 1.0 - 2.0 * z * z];
    assert_reads(&rendered, mirrored);
    let off = |_, wanted| (RGBD + FACETS) * wanted;
    let wanted = |normal| mirrored(normal).map(|m| 1.0 + m / 2.0);
    assert_shows("mirror", rendered.sphere("mirror").within(0.8).step_by(37), wanted, off);
    // A white metal loses nothing, whatever table it uses: E + (1 − E), and 1 is a code of RGBD. What shows black fails here.
    for name in ["metal", "own"] {
        assert_shows(name, rendered.sphere(name).within(0.95), |_| [1.0; 3], |_, _| 2e-3);
    }
    // What judges the table: x + F0 (y − x), with Turquin's compensation, by Kiln's own integrals.
    for (name, f0, roughness) in [("grey", 0.5, 0.6), ("plastic", 0.04, 0.4)] {
        let wanted = |normal: [f64; 3]| [value("compensation.turquin", normal[2], roughness, Some(f0)); 3];
        assert_shows(name, rendered.sphere(name).within(0.9).step_by(37), wanted, off);
    }
}

/// Half a code of RGBP's root, whose factor is exact, doubled by the square; at most √1.5 of a root whose largest is a code.
const RGBP: f64 = 2.0 * 1.5 * 0.5 / 255.0;

#[test]
fn playcanvas_renders_what_kiln_bakes_for_it() {
    if tools::folder_with("node_modules/playcanvas").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    directions(folder.path());
    write_room(folder.path());
    for (input, out) in [("directions.exr", "directions"), ("builtin:white", "white"), ("orientation.exr", "room")] {
        succeed(folder.path(), &["-q", "env", input, "--engine", "playcanvas", "--out", out]);
    }
    let (white, directions, room) =
        ("white/white_atlas.png", "directions/directions_atlas.png", "room/orientation_atlas.png");
    let sh = Some("directions/sh.json");
    let scene =
        |name, cube, table, color, metalness, roughness| Scene { name, cube, table, color, metalness, roughness };
    let scenes = [
        scene("metal", white, None, 1.0, 1.0, 0.3),
        scene("rough-metal", white, None, 1.0, 1.0, 0.95),
        scene("grey", white, None, 0.5, 1.0, 0.6),
        scene("plastic", white, None, 0.0, 0.0, 0.4),
        scene("room", room, None, 1.0, 1.0, 0.0),
        scene("0", directions, None, 1.0, 1.0, 0.0),
        scene("0.3", directions, None, 1.0, 1.0, 0.3),
        scene("0.6", directions, None, 1.0, 1.0, 0.6),
        scene("1", directions, None, 1.0, 1.0, 1.0),
        scene("matt", directions, None, 1.0, 0.0, 0.6),
        scene("probe", directions, sh, 1.0, 0.0, 0.6),
    ];
    let Some(found) = render(include_str!("support/playcanvas.js"), folder.path(), &scenes) else { return };

    // It has no table: a reflection is the environment times F0, in a white furnace F0 alone (grey has no Fresnel of its own: its shader
    // lets F rise to the largest of F0's channels). What shows black fails here.
    for (name, f0) in [("metal", 1.0), ("rough-metal", 1.0), ("grey", 0.5), ("plastic", 0.04)] {
        assert_shows(name, found.sphere(name).within(0.95), |_| [f0; 3], |_, _| 1e-6);
    }
    let mirrored = |[x, y, z]: [f64; 3]| [2.0 * z * x, 2.0 * z * y, 2.0 * z * z - 1.0];
    assert_reads(&found, mirrored);
    // Level 5 r, blended; of a matt sphere the rest of F0 = 0.04 is irradiance.
    let faded = |roughness: f64| {
        let (below, part) = ((5.0 * roughness).floor(), (5.0 * roughness).fract());
        kept(below / 5.0) * (1.0 - part) + kept((below / 5.0 + 0.2).min(1.0)) * part
    };
    for (name, f0, roughness) in [
        ("0", 1.0, 0.0),
        ("0.3", 1.0, 0.3),
        ("0.6", 1.0, 0.6),
        ("1", 1.0, 1.0),
        ("matt", 0.04, 0.6),
        ("probe", 0.04, 0.6),
    ] {
        let fade = faded(roughness);
        // A blend of four texels is off from a wave by h²/8 of its amplitude along each axis: of the roughest tile's, 14 × 6 texels.
        let rows = f64::from(256 >> (5.0 * roughness).ceil() as i32);
        let steps = [TAU / (2.0 * rows - 2.0), PI / (rows - 2.0)];
        let bent: f64 = steps.iter().map(|h| f0 * fade / 2.0 * h * h / 8.0).sum();
        let matt = kept(1.0);
        let wanted = |normal| {
            let mirror = mirrored(normal);
            std::array::from_fn(|c| {
                let (specular, diffuse) = (1.0 + fade * mirror[c] / 2.0, 1.0 + matt * normal[c] / 2.0);
                f0 * specular + (1.0 - f0) * diffuse
            })
        };
        // Facets of a sphere, and texels of one value each in the mirror of a panorama of 128 rows.
        let off = |_, wanted| (RGBP + FACETS) * wanted + bent;
        assert_shows(name, found.sphere(name).within(0.8).step_by(37), wanted, off);
    }
}

/// What Filament makes of a roughness: at least 0.089, its shader's floor.
fn roughness_in_filament(roughness: f64) -> f64 {
    roughness.max(0.089)
}

#[test]
fn filament_renders_what_kiln_bakes_for_it() {
    if tools::folder_with("node_modules/filament").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    directions(folder.path());
    // Its shader counts levels by what the file has: four from 128 to 16.
    write_room(folder.path());
    for input in ["directions.exr", "builtin:white", "orientation.exr"] {
        succeed(folder.path(), &["-q", "env", input, "--engine", "filament", "--size", "128", "--out", "baked"]);
    }
    let (white, directions, room) = ("baked/white_ibl.ktx", "baked/directions_ibl.ktx", "baked/orientation_ibl.ktx");
    let scene =
        |name, cube, color, metalness, roughness| Scene { name, cube, table: None, color, metalness, roughness };
    let scenes = [
        scene("metal", white, 1.0, 1.0, 0.6),
        scene("grey", white, 0.5, 1.0, 0.6),
        scene("plastic", white, 0.0, 0.0, 0.4),
        scene("room", room, 1.0, 1.0, 0.0),
        scene("mirror", directions, 1.0, 1.0, 0.0),
        scene("rough", directions, 1.0, 1.0, 0.5),
        scene("matt", directions, 1.0, 0.0, 1.0),
    ];
    let Some(found) = render(include_str!("support/filament.js"), folder.path(), &scenes) else { return };

    assert_shows("metal", found.sphere("metal").within(0.95), |_| [1.0; 3], |_, _| 1e-5);
    // Its own table, which cannot be replaced here, of 64 texels that hold what belongs one texel further, and of halves: rough where it is
    // steep.
    for (name, f0, roughness) in [("grey", 0.5, 0.6), ("plastic", 0.04, 0.4)] {
        let wanted = |normal: [f64; 3]| [value("compensation.turquin", normal[2], roughness + 1.0 / 64.0, Some(f0)); 3];
        assert_shows(name, found.sphere(name).within(0.8).step_by(37), wanted, |_, wanted| 0.005 * wanted);
    }
    let mirrored = |[x, y, z]: [f64; 3]| [2.0 * z * x, 2.0 * z * y, 2.0 * z * z - 1.0];
    assert_reads(&found, mirrored);
    // Direction, level, filter and coefficients. The matt sphere has the last level for its reflection, which is what irradiance is; its
    // coefficients come out of the file's metadata.
    let levels = 4;
    let filled = |level: usize| 1.0 - (1.0 - level as f64 / (levels - 1) as f64).sqrt();
    for (name, roughness) in [("mirror", 0.0), ("rough", 0.5), ("matt", 1.0)] {
        let r = roughness_in_filament(roughness);
        let level = (levels - 1) as f64 * r * (2.0 - r);
        let (below, part) = (level.floor() as usize, level.fract());
        let fade = kept(filled(below)) * (1.0 - part) + kept(filled((below + 1).min(levels - 1))) * part;
        let wanted = |normal| towards(normal, mirrored(normal), r.powi(4)).map(|c| 1.0 + fade * c / 2.0);
        // Half a step of B10G11R11 is 2⁻⁷ of the value in red and green, 2⁻⁶ in blue.
        let off = |c, wanted| (if c == 2 { 2_f64.powi(-6) } else { 2_f64.powi(-7) } + FACETS) * wanted;
        assert_shows(name, found.sphere(name).within(0.8).step_by(37), wanted, off);
    }
}
