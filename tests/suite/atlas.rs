//! PlayCanvas' atlas, read as its shader reads it, from the codes of the PNG as somebody else's reader has them; and as an input. (What
//! PlayCanvas itself shows of it, [`loaders`](super::loaders) tests.)

use crate::support::atlas::{Atlas, EDGE, IRRADIANCE, mirror, rough};
use crate::support::directions::{directions, kept};
use crate::support::kiln::{fail, kiln, succeed};
use crate::support::samples::Random;
use glam::DVec3;
use kiln::bake::ShFile;
use kiln::format::{Decoded, decode, png as kiln_png};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// The codes of an atlas.
fn read(path: &Path) -> Atlas {
    let file = std::io::BufReader::new(std::fs::File::open(path).expect("an atlas"));
    let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
    let mut codes = vec![0; reader.output_buffer_size().expect("a size")];
    let frame = reader.next_frame(&mut codes).expect("a picture");
    assert_eq!((frame.width, frame.height, frame.color_type), (512, 512, png::ColorType::Rgba));
    assert_eq!(frame.bit_depth, png::BitDepth::Eight);
    // A browser would convert what says that it is of another colour space.
    assert!(reader.info().srgb.is_none() && reader.info().gama_chunk.is_none());
    Atlas(codes)
}

#[test]
fn playcanvas_finds_every_direction_at_every_roughness_in_the_atlas_that_its_preset_bakes() {
    let folder = tempfile::tempdir().expect("a folder");
    directions(folder.path());
    succeed(folder.path(), &["-q", "env", "directions.exr", "--engine", "playcanvas", "--out", "o"]);
    let file = folder.path().join("o/directions_atlas.png");
    let atlas = read(&file);
    let tiles = (0..6)
        .map(|level| (rough(level), f64::from(level) / 5.0, format!("level {level}")))
        .chain((0..6).map(|level| (mirror(level), 0.0, format!("mirror {level}"))))
        .chain([(IRRADIANCE, 1.0, "irradiance".to_owned())]);
    let mut random = Random(3);
    for (tile, roughness, name) in tiles {
        let amplitude = 0.5 * kept(roughness);
        // A texel's width in azimuth and height: a blend of four is off from a wave by h²/8 of its amplitude along each, and a mirror's
        // texels, which are averages, by h²/24 more; blending roots instead of values by (difference)²/16 of values at least 1/2.
        let steps = [TAU / (tile[2] - 2.0), PI / (tile[3] - 2.0)];
        let bent: f64 = steps.iter().map(|h| amplitude * h * h * (1.0 / 8.0 + 1.0 / 24.0)).sum();
        // A mirror shows the panorama's own texels, each of one value: off by the way to its corner.
        let boxes = if roughness == 0.0 { amplitude * PI / 128.0 * std::f64::consts::FRAC_1_SQRT_2 } else { 0.0 };
        let roots: f64 = steps.iter().map(|h| (amplitude * h).powi(2) / 8.0).sum();
        for i in 0..300 {
            let y = 2.0 * random.unit() - 1.0;
            // The seam and the poles too.
            let phi = if i % 3 == 0 { -PI / 2.0 + 1e-4 * (random.unit() - 0.5) } else { TAU * random.unit() };
            let y = if i % 5 == 0 { (1.0 - 1e-3 * random.unit()).copysign(y) } else { y };
            let across = (1.0 - y * y).sqrt();
            let world = DVec3::new(across * phi.cos(), y, across * phi.sin());
            let found = atlas.seen(world, tile);
            for c in 0..3 {
                let wanted = 1.0 + amplitude * world[c];
                // Half a code of the root, under a factor of at most √1.5 and one step of p; a thousandth for the filter and the panorama.
                let code = 2.0 * (1.5_f64.sqrt() + 7.0 / 255.0) * wanted.sqrt() * 0.5 / 255.0;
                let limit = code + bent + roots + boxes + 1e-3;
                assert!(
                    (found[c] - wanted).abs() < limit,
                    "{name} towards {world}, channel {c}: {found:?}, wanted {wanted} ± {limit}"
                );
            }
        }
    }

    // It is read again: its certificate's twelve tiles, its mirror as a panorama.
    let verified = succeed(folder.path(), &["verify", "o"]).stdout;
    assert!(verified.contains("mirror 5") && verified.contains("as an atlas"), "{verified}");
    let info = succeed(folder.path(), &["info", "o/directions_atlas.png"]).stdout;
    assert!(info.contains("irradiance") && info.contains("rgbp"), "{info}");
    let converted = succeed(folder.path(), &["convert", "o/directions_atlas.png", "back.exr", "--shape", "panorama"]);
    let change =
        converted.stdout.split("changed by ").nth(1).and_then(|rest| rest.split(' ').next()).expect("a change");
    // Another order of summing.
    assert!(change.parse::<f64>().expect("a number") < 1e-10, "{}", converted.stdout);

    reads_its_world_again(folder.path(), &atlas);

    // Any texel of it is certified: here one of the irradiance.
    let Ok(Decoded::Texture(mut texture)) = decode(&std::fs::read(&file).expect("a file")) else {
        panic!("no texture")
    };
    texture.metadata.retain(|(key, _)| key != "Software");
    let texel = 4 * (400 * EDGE + 150);
    texture.levels[0][texel] ^= 0x40;
    std::fs::write(&file, kiln_png::encode(&texture).expect("a PNG")).expect("a file");
    let failed = fail(folder.path(), &["verify", "o/directions_atlas.png"], 3);
    assert!(failed.contains("FAILED") || failed.contains("verification"), "{failed}");
}

/// An atlas is an input, whether it says that it is one or not, and shows the world that was baked; a conversion stays turned as it is.
fn reads_its_world_again(folder: &Path, Atlas(codes): &Atlas) {
    let foreign = std::fs::File::create(folder.join("foreign.png")).expect("a file");
    let mut encoder = png::Encoder::new(foreign, EDGE as u32, EDGE as u32);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().expect("a PNG").write_image_data(codes).expect("a PNG");
    let bake = |input: &str, out: &str, more: &[&str]| {
        let chain = ["env", input, "--out", out, "--size", "8", "--min-size", "8", "--irradiance-size", "4"];
        let said = succeed(folder, &[&chain, more].concat()).stderr;
        assert!(said.contains("read as an atlas of PlayCanvas, its mirror of 510 × 254"), "{said}");
    };
    bake("o/directions_atlas.png", "again", &[]);
    bake("foreign.png", "foreign", &["--input-layout", "atlas"]);
    let radiance = |out: &str| {
        let file = std::fs::read_to_string(folder.join(out).join("sh.json")).expect("a file");
        serde_json::from_str::<ShFile>(&file).expect("an sh.json").harmonics.radiance
    };
    let (wanted, again, foreign) = (radiance("o"), radiance("again"), radiance("foreign"));
    assert_eq!(again, foreign);
    // Half a code at most everywhere (see above), times a function of norm 1: of a wrong turn, 0.5 · √(4π/3) is off by as much.
    let limit = 2.0 * (1.5_f64.sqrt() + 7.0 / 255.0) * 1.5_f64.sqrt() * 0.5 / 255.0 * (4.0 * PI).sqrt();
    for (i, (found, wanted)) in again.iter().zip(&wanted).enumerate() {
        for c in 0..3 {
            assert!((found[c] - wanted[c]).abs() < limit, "coefficient {i}: {found:?}, wanted {wanted:?} ± {limit}");
        }
    }
    assert!(fail(folder, &["env", "foreign.png", "--out", "no"], 1).contains("say --input-layout atlas"));

    let convert = ["convert", "foreign.png", "cube.ktx2", "--from", "atlas", "--shape", "cube", "--size", "16"];
    let said = succeed(folder, &[&convert[..], &["--format", "ktx2:rgba32f"]].concat());
    assert!(said.stdout.contains("changed by") && said.stdout.contains("% RMS"), "{}", said.stdout);
    let Ok(Decoded::Texture(cube)) = decode(&std::fs::read(folder.join("cube.ktx2")).expect("a file")) else {
        panic!("no texture")
    };
    for (i, texel) in cube.values(0).chunks_exact(4).enumerate() {
        let lookup = kiln::environment::cube::texel_direction(16, i);
        let world = DVec3::new(-lookup.z, lookup.y, lookup.x);
        for c in 0..3 {
            // An average over a texel as wide as 2/16 of a face bends by as much squared.
            let wanted = 1.0 + world[c] / 2.0;
            assert!((f64::from(texel[c]) - wanted).abs() < 0.01, "texel {i}, channel {c}: {texel:?}, wanted {wanted}");
        }
    }
    let square = ["convert", "o/directions_atlas.png", "square.exr", "--shape", "octahedral"];
    let said = succeed(folder, &square);
    assert!(said.stderr.contains("stays turned as it was: the world's x,y,z are -z,y,x of it"), "{}", said.stderr);
}

#[test]
fn values_beyond_the_packing_are_told_with_a_way_out_that_works() {
    let folder = tempfile::tempdir().expect("a folder");
    let env = |more: &[&str]| {
        let arguments = ["env", "builtin:white", "--scale", "1e5", "--out", "o"];
        succeed(folder.path(), &[&arguments, more].concat()).stderr
    };
    let small = ["--size", "8", "--min-size", "8", "--irradiance-size", "4"];
    // What each suggests is done, and is enough.
    let atlas = env(&["--engine", "playcanvas"]);
    assert!(
        atlas.contains("use --exposure -10.7 and 10.7 stops more in the engine, by scene.skyboxIntensity"),
        "{atlas}"
    );
    assert!(!env(&["--engine", "playcanvas", "--exposure", "-10.7"]).contains("clamped to it"));
    let halves = env(&small);
    assert!(halves.contains("use --format ktx2:rgba32f to keep them, or --exposure -0.7"), "{halves}");
    assert!(!env(&[&small[..], &["--format", "ktx2:rgba32f"]].concat()).contains("clamped to it"));
    assert!(!env(&[&small[..], &["--exposure", "-0.7"]].concat()).contains("clamped to it"));
    let table = |channel: &str, format: &str| {
        let arguments = ["table", "charlie-albedo", "--size", "8x8", "-o", "table", "--channels"];
        kiln(folder.path(), &[&arguments[..], &[channel, "--format", format]].concat()).stderr
    };
    let bytes = table("charlie.albedo", "png:r8unorm");
    assert!(bytes.contains("or let the channel hold less, such as NAME:y/(1+y)"), "{bytes}");
    assert!(!table("charlie.albedo:y/(1+y)", "png:r8unorm").contains("error"));
}

#[test]
fn an_atlas_that_playcanvas_would_not_read_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let refused = |more: &[&str]| {
        let arguments = ["env", "builtin:white", "--engine", "playcanvas", "--out", "o"];
        fail(folder.path(), &[&arguments, more].concat(), 2)
    };
    assert!(refused(&["--size", "128"]).contains("leave --size"));
    assert!(refused(&["--draft"]).contains("--draft out"));
    assert!(refused(&["--roughness", "0,0.5,1"]).contains("use --roughness 0,0.2,0.4"));
    assert!(refused(&["--format", "exr:f16"]).contains("use --format png:rgbp"));
    assert!(refused(&["--irradiance", "sh"]).contains("use --irradiance cube"));
    assert!(refused(&["--fit", "lookup"]).contains("use --fit none"));
    let turned = ["env", "builtin:white", "--engine", "playcanvas", "--out", "o", "--orientation", "x,z,y"];
    assert!(fail(folder.path(), &turned, 1).contains("poles"));
}
