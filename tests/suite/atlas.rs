//! PlayCanvas' atlas, read as its shader reads it: the codes of the PNG as somebody else's reader has them, blended as a sampler blends them,
//! decoded and placed by the shader's own formulas.

use crate::support::directions::{directions, kept};
use crate::support::kiln::{fail, succeed};
use crate::support::samples::Random;
use glam::DVec3;
use kiln::format::{Decoded, decode, png as kiln_png};
use std::f64::consts::{PI, TAU};
use std::path::Path;

const EDGE: usize = 512;

/// Four bytes a texel.
struct Atlas(Vec<u8>);

impl Atlas {
    fn read(path: &Path) -> Self {
        let file = std::io::BufReader::new(std::fs::File::open(path).expect("an atlas"));
        let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
        let mut codes = vec![0; reader.output_buffer_size().expect("a size")];
        let frame = reader.next_frame(&mut codes).expect("a picture");
        assert_eq!((frame.width, frame.height, frame.color_type), (512, 512, png::ColorType::Rgba));
        assert_eq!(frame.bit_depth, png::BitDepth::Eight);
        // A browser would convert what says that it is of another colour space.
        assert!(reader.info().srgb.is_none() && reader.info().gama_chunk.is_none());
        Self(codes)
    }

    /// What a sampler that blends four texels gives at texture coordinates: r, g, b, a in [0, 1].
    fn sampled(&self, [u, v]: [f64; 2]) -> [f64; 4] {
        let (x, y) = (u * EDGE as f64 - 0.5, v * EDGE as f64 - 0.5);
        let mut sum = [0.0; 4];
        for (i, j) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let [column, row] = [x.floor() + i, y.floor() + j].map(|t| t.clamp(0.0, EDGE as f64 - 1.0));
            let weight = (1.0 - (x - x.floor() - i).abs()) * (1.0 - (y - y.floor() - j).abs());
            let start = 4 * (row as usize * EDGE + column as usize);
            (0..4).for_each(|c| sum[c] += weight * f64::from(self.0[start + c]) / 255.0);
        }
        sum
    }

    /// What the shader finds of a direction of the world in the tile that begins at `(x, y)` and is `(w, h)` large.
    fn seen(&self, world: DVec3, [x, y, w, h]: [f64; 4]) -> [f64; 3] {
        let direction = DVec3::new(-world.x, world.y, world.z);
        let at = [0.5 + direction.x.atan2(direction.z) / TAU, 1.0 - (0.5 + direction.y.asin() / PI)];
        let edge = EDGE as f64;
        // A seam of one texel on either side.
        let uv = [(x + 1.0 + at[0] * (w - 2.0)) / edge, (y + 1.0 + at[1] * (h - 2.0)) / edge];
        let [r, g, b, a] = self.sampled(uv);
        [r, g, b].map(|c| (c * (8.0 - 7.0 * a)).powi(2))
    }
}

/// The tile of a rough level, and that of a mirror, as the shader places them.
fn rough(level: i32) -> [f64; 4] {
    let t = 512.0 * 0.5_f64.powi(level);
    [0.0, 512.0 - t, t, t / 2.0]
}

fn mirror(level: i32) -> [f64; 4] {
    let t = 512.0 * 0.5_f64.powi(level);
    [512.0 - t, 512.0 - t, t, t / 2.0]
}

#[test]
fn playcanvas_finds_every_direction_at_every_roughness_in_the_atlas_that_its_preset_bakes() {
    let folder = tempfile::tempdir().expect("a folder");
    directions(folder.path());
    succeed(folder.path(), &["-q", "env", "directions.exr", "--engine", "playcanvas", "--out", "o"]);
    let file = folder.path().join("o/directions_atlas.png");
    let atlas = Atlas::read(&file);
    let tiles = (0..6)
        .map(|level| (rough(level), f64::from(level) / 5.0, format!("level {level}")))
        .chain((0..6).map(|level| (mirror(level), 0.0, format!("mirror {level}"))))
        .chain([([128.0, 384.0, 64.0, 32.0], 1.0, "irradiance".to_owned())]);
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
