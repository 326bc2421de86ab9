//! Environment chains: those that others made are judged and named, and Kiln's own are made for the shader that reads them.

#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

use std::f64::consts::{PI, TAU};

use crate::support::kiln::{fail, succeed};
use glam::DVec3;
use kiln::environment::zonal::{InstructionSet, Zonal};
use kiln::environment::{
    ChainSpec, Cube, Fit, FullSum, Kernel, KernelKind, Panorama, SphereLayout, SphereMap, builtin, specular_chain,
};
use kiln::format::{Decoded, ktx2, read};
use kiln::verify::chain::{Question, Verdict, judge, judge_maps};

/// A map that looks like itself from one side only: lamps of three colours, none where another one is.
fn panorama() -> Panorama {
    let lamps = [
        (DVec3::new(1.0, 0.3, 0.2), 60.0, [9.0, 7.0, 3.0]),
        (DVec3::new(-0.4, 0.9, 0.5), 12.0, [1.0, 2.0, 4.0]),
        (DVec3::new(-0.3, -0.5, 0.8), 6.0, [1.5, 0.4, 0.3]),
        (DVec3::new(0.2, 0.1, -1.0), 25.0, [0.5, 3.0, 1.0]),
    ];
    let texel = |i: usize| {
        let (theta, phi) = (PI * ((i / 96) as f64 + 0.5) / 48.0, TAU * ((i % 96) as f64 + 0.5) / 96.0 - PI);
        let d = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        let mut sum = [0.2, 0.15 + 0.1 * d.y, 0.2];
        for (towards, sharpness, colour) in lamps {
            let bright = (sharpness * (d.dot(towards.normalize()) - 1.0)).exp();
            (0..3).for_each(|c| sum[c] += colour[c] * bright);
        }
        sum.map(|v| v as f32)
    };
    Panorama::new(96, 48, (0..96 * 48).map(texel).collect()).unwrap()
}

/// What another baker would do, written without Kiln's: nearest lookups, GGX's normals sampled by the Hammersley set, weights N·L.
mod foreign {
    use super::*;

    fn lookup(panorama: &Panorama, d: DVec3) -> [f64; 3] {
        let (width, height) = (panorama.width(), panorama.height());
        let (u, v) = (0.5 + d.z.atan2(d.x) / TAU, d.y.clamp(-1.0, 1.0).acos() / PI);
        let column = ((u * width as f64) as usize).min(width - 1);
        let row = ((v * height as f64) as usize).min(height - 1);
        panorama.texels()[row * width + column].map(f64::from)
    }

    pub fn direction(size: usize, face: usize, x: f64, y: f64) -> DVec3 {
        let (s, t) = (2.0 * x / size as f64 - 1.0, 2.0 * y / size as f64 - 1.0);
        match face {
            0 => DVec3::new(1.0, -t, -s),
            1 => DVec3::new(-1.0, -t, s),
            2 => DVec3::new(s, 1.0, t),
            3 => DVec3::new(s, -1.0, -t),
            4 => DVec3::new(s, -t, 1.0),
            _ => DVec3::new(-s, -t, -1.0),
        }
        .normalize()
    }

    fn filtered(panorama: &Panorama, n: DVec3, alpha: f64, samples: u32) -> [f64; 3] {
        let (side, up) = n.any_orthonormal_pair();
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for i in 0..samples {
            let (a, b) = ((f64::from(i) + 0.5) / f64::from(samples), f64::from(i.reverse_bits()) / 2_f64.powi(32));
            let cos2 = (1.0 - a) / (1.0 + (alpha * alpha - 1.0) * a);
            let (cos, sin) = (cos2.sqrt(), (1.0 - cos2).max(0.0).sqrt());
            let h = side * (sin * (TAU * b).cos()) + up * (sin * (TAU * b).sin()) + n * cos;
            let l = 2.0 * n.dot(h) * h - n;
            let weight = n.dot(l);
            if weight > 0.0 {
                let value = lookup(panorama, l);
                (0..3).for_each(|c| sum[c] += weight * value[c]);
                weights += weight;
            }
        }
        sum.map(|s| s / weights)
    }

    pub fn chain(panorama: &Panorama, size: usize, roughness: &[f64]) -> Vec<Cube> {
        let level = |(m, &r): (usize, &f64)| {
            let size = size >> m;
            let texel = |i: usize| {
                let (face, row, column) = (i / (size * size), i / size % size, i % size);
                let (x, y) = (column as f64, row as f64);
                if r > 0.0 {
                    let d = direction(size, face, x + 0.5, y + 0.5);
                    return filtered(panorama, d, r * r, 256).map(|v| v as f32);
                }
                let mut sum = [0.0; 3];
                for k in 0..16 {
                    let d =
                        direction(size, face, x + (f64::from(k % 4) + 0.5) / 4.0, y + (f64::from(k / 4) + 0.5) / 4.0);
                    let value = lookup(panorama, d);
                    (0..3).for_each(|c| sum[c] += value[c] / 16.0);
                }
                sum.map(|v| v as f32)
            };
            Cube { size, texels: (0..6 * size * size).map(texel).collect() }
        };
        roughness.iter().enumerate().map(level).collect()
    }
}

const ROUGHNESS: [f64; 3] = [0.0, 0.5, 1.0];

fn own_chain(panorama: &Panorama, size: usize) -> Vec<Cube> {
    let spec = ChainSpec { roughness: ROUGHNESS.to_vec(), ..ChainSpec::new(size, size >> 2) };
    specular_chain(panorama, &spec, &|_| {}).unwrap().levels
}

fn asked<'a>(source: &'a Panorama, kernel: Option<KernelKind>) -> Question<'a> {
    Question { source: Some(source), kernel, ..Question::default() }
}

fn says(verdict: &Verdict, words: &str) -> bool {
    verdict.findings.iter().any(|finding| finding.contains(words))
}

/// Each face of each level changed.
fn changed(chain: &[Cube], change: impl Fn(usize, usize, &[[f32; 3]]) -> Vec<[f32; 3]>) -> Vec<Cube> {
    let level = |cube: &Cube| {
        let texels = (0..6).flat_map(|face| change(cube.size, face, cube.face(face))).collect();
        Cube { size: cube.size, texels }
    };
    chain.iter().map(level).collect()
}

/// 256 samples leave a few per cent of noise, which the width averages over all texels.
#[test]
fn a_chain_of_256_samples_is_named() {
    let source = panorama();
    let chain = foreign::chain(&source, 16, &ROUGHNESS);
    let verdict = judge(&chain, &asked(&source, None)).unwrap();
    let orientation = verdict.orientation.as_ref().unwrap();
    assert!(!orientation.mirrored && orientation.as_good == 0 && orientation.faces.is_empty(), "{orientation:?}");
    assert_eq!(orientation.turn.unwrap().formula(), "(x, y, z)");
    for (level, wanted) in verdict.levels.iter().zip(ROUGHNESS) {
        let found = level.roughness.expect("a known roughness");
        assert!((found - wanted).abs() < 0.04, "wanted {wanted}: {level:?}");
        assert!(level.mean_drift.abs() < 0.03, "{level:?}");
    }
    assert!(verdict.kernel.is_none_or(|kind| kind == KernelKind::Nol), "{verdict:?}");
    assert!(says(&verdict, "scale: normalised"), "{:?}", verdict.findings);
    assert!(!says(&verdict, "seams") && !says(&verdict, "fireflies"), "{:?}", verdict.findings);
}

#[test]
fn a_mirrored_chain_and_one_that_is_turned_are_told() {
    let source = panorama();
    let chain = foreign::chain(&source, 16, &ROUGHNESS[..2]);
    let nearest = |turn: fn(DVec3) -> DVec3| {
        let level = |cube: &Cube| {
            let n = cube.size;
            let texel = |i: usize| {
                let (x, y) = ((i % n) as f64 + 0.5, (i / n % n) as f64 + 0.5);
                cube.nearest(turn(foreign::direction(n, i / (n * n), x, y)))
            };
            Cube { size: n, texels: (0..6 * n * n).map(texel).collect() }
        };
        chain.iter().map(level).collect::<Vec<_>>()
    };
    for (turn, formula, mirrored) in [
        ((|d| DVec3::new(-d.x, d.y, d.z)) as fn(DVec3) -> DVec3, "(−x, y, z)", true),
        (|d| DVec3::new(d.x, d.y, -d.z), "(x, y, −z)", true),
        (|d| DVec3::new(d.z, d.y, -d.x), "(z, y, −x)", false),
        (|d| DVec3::new(-d.x, d.z, d.y), "(−x, z, y)", false),
    ] {
        let verdict = judge(&nearest(turn), &asked(&source, Some(KernelKind::Nol))).unwrap();
        let orientation = verdict.orientation.as_ref().unwrap();
        assert_eq!(orientation.turn.unwrap().formula(), formula, "{orientation:?}");
        assert_eq!(orientation.mirrored, mirrored, "{orientation:?}");
        let found = verdict.levels[1].roughness.expect("a known roughness");
        assert!((found - 0.5).abs() < 0.05, "{formula}: {found}");
    }
}

#[test]
fn a_level_of_the_wrong_roughness_is_told() {
    let source = panorama();
    let verdict =
        judge(&foreign::chain(&source, 16, &[0.0, 0.36, 1.0]), &asked(&source, Some(KernelKind::Nol))).unwrap();
    let found = verdict.levels[1].roughness.unwrap();
    assert!((found - 0.36).abs() < 0.04, "{:?}", verdict.levels[1]);
    // Counted against what it is said to have, it is far off: by more than the noise that it has against what it is.
    let claim = Question { roughness: Some(ROUGHNESS.to_vec()), ..asked(&source, Some(KernelKind::Nol)) };
    let claimed = judge(&foreign::chain(&source, 16, &[0.0, 0.36, 1.0]), &claim).unwrap();
    let [against, with] = [&claimed, &verdict].map(|v| v.levels[1].error.as_ref().unwrap().rms);
    assert!(against > 2.0 * with, "{against} against the claim, {with} against what it is");
}

#[test]
fn a_factor_of_pi_and_any_other_are_told() {
    let source = panorama();
    let chain = own_chain(&source, 16);
    for (factor, words) in
        [(PI, "multiplied by π"), (1.0 / PI, "divided by π"), (0.5, "-1.00 EV"), (1.0, "scale: normalised")]
    {
        let scaled =
            changed(&chain, |_, _, face| face.iter().map(|t| t.map(|v| (f64::from(v) * factor) as f32)).collect());
        let verdict = judge(&scaled, &asked(&source, Some(KernelKind::Nol))).unwrap();
        assert!(says(&verdict, words), "{factor}: {:?}", verdict.findings);
        assert!((verdict.scale.unwrap() / factor - 1.0).abs() < 1e-3, "{factor}: {:?}", verdict.scale);
        let error = verdict.levels[2].error.as_ref().unwrap();
        assert!(error.rms_unscaled < 1e-3 && (error.rms - (factor - 1.0).abs()).abs() < 2e-2, "{factor}: {error:?}");
    }
}

#[test]
fn one_face_that_is_rotated_is_told() {
    let source = panorama();
    let rotated = changed(&own_chain(&source, 16), |size, face, texels| match face {
        2 => texels.iter().rev().copied().collect(),
        4 => (0..size * size).map(|i| texels[(i % size) * size + size - 1 - i / size]).collect(),
        _ => texels.to_vec(),
    });
    let verdict = judge(&rotated, &asked(&source, Some(KernelKind::Nol))).unwrap();
    assert!(says(&verdict, "face +Y is rotated by 180°"), "{:?}", verdict.findings);
    assert!(says(&verdict, "face +Z is rotated by 90°") || says(&verdict, "face +Z is rotated by 270°"));
    assert!(says(&verdict, "seams"), "{:?}", verdict.findings);
    // The faces that are right still tell the roughness.
    let found = verdict.levels[1].roughness.unwrap();
    assert!((found - 0.5).abs() < 0.01, "{found}");
}

#[test]
fn a_firefly_is_counted_and_found() {
    let source = panorama();
    let mut chain = own_chain(&source, 16);
    let texel = 3 * 64 + 5 * 8 + 7;
    chain[1].texels[texel] = chain[1].texels[texel].map(|v| 20.0 * v);
    let verdict = judge(&chain, &asked(&source, Some(KernelKind::Nol))).unwrap();
    let error = verdict.levels[1].error.as_ref().unwrap();
    let (times, place) = error.worst_firefly.clone().unwrap();
    assert_eq!((error.fireflies, place.as_str()), (1, "face -Y, texel 7, 5"));
    assert!((times - 20.0).abs() < 0.1 && (error.max - 19.0).abs() < 0.1, "{error:?}");
    assert!((verdict.levels[1].roughness.unwrap() - 0.5).abs() < 0.01);
}

/// A box blur that stops at the edges of its face.
#[test]
fn seams_of_a_blur_per_face_are_found_and_none_where_there_are_none() {
    let source = panorama();
    let chain = own_chain(&source, 16);
    let blurred = changed(&chain, |size, _, texels| {
        let at = |row: isize, column: isize| {
            let last = size as isize - 1;
            texels[(row.clamp(0, last) * size as isize + column.clamp(0, last)) as usize]
        };
        let mean = |i: usize| {
            let (row, column) = ((i / size) as isize, (i % size) as isize);
            let mut sum = [0.0_f32; 3];
            for (r, c) in (-1..=1).flat_map(|r| (-1..=1).map(move |c| (row + r, column + c))) {
                (0..3).for_each(|k| sum[k] += at(r, c)[k] / 9.0);
            }
            sum
        };
        (0..size * size).map(mean).collect()
    });
    let [good, bad] = [&chain, &blurred].map(|chain| judge(chain, &asked(&source, Some(KernelKind::Nol))).unwrap());
    assert!(!says(&good, "seams"), "{:?}", good.findings);
    assert!(says(&bad, "level 1: seams") && says(&bad, "level 2: seams"), "{:?}", bad.findings);
}

#[test]
fn kilns_own_chains_are_named_by_kernel_and_roughness() {
    let source = panorama();
    for kind in KernelKind::ALL {
        let roughness = [0.5, 0.8, 1.0];
        let kernels = roughness.map(|r| Kernel::of(kind, r * r));
        let zonal = Zonal::new(&source, &kernels, InstructionSet::detect());
        let cube = |(m, kernel): (usize, &Kernel)| zonal.function(kernel).cube(16_usize >> m, &|_| {});
        let chain: Vec<Cube> = kernels.iter().enumerate().map(cube).collect();
        let verdict = judge(&chain, &asked(&source, None)).unwrap();
        assert_eq!(verdict.kernel, Some(kind), "{verdict:?}");
        assert!(verdict.kernel_margin.unwrap() > 2.0, "{verdict:?}");
        for (level, wanted) in verdict.levels.iter().zip(roughness) {
            assert!((level.roughness.unwrap() - wanted).abs() < 5e-3, "{kind:?} {wanted}: {level:?}");
            assert!(level.error.as_ref().unwrap().rms < 5e-3, "{kind:?} {wanted}: {level:?}");
        }
    }
}

#[test]
fn what_fits_nothing_is_unknown() {
    let source = panorama();
    let noise = |i: usize, c: usize| ((i * 3 + c) as f32 * 12.9898).sin().mul_add(43.758, 500.0).fract().powi(6);
    let random: Vec<Cube> = [16, 8]
        .map(|size| Cube {
            size,
            texels: (0..6 * size * size).map(|i| [noise(i, 0), noise(i, 1), noise(i, 2)]).collect(),
        })
        .into();
    let verdict = judge(&random, &asked(&source, None)).unwrap();
    assert!(says(&verdict, "orientation: unknown") && says(&verdict, "kernel: unknown"), "{:?}", verdict.findings);
    assert!(verdict.levels.iter().all(|level| level.roughness.is_none() && level.error.is_none()));
    let white = builtin("white", 16).unwrap();
    let verdict = judge(&own_chain(&white, 8), &asked(&white, None)).unwrap();
    assert!(says(&verdict, "orientation: any") && says(&verdict, "kernel: unknown"), "{:?}", verdict.findings);
}

#[test]
fn without_a_source_a_chain_is_compared_with_its_own_level_0() {
    let mut chain = own_chain(&panorama(), 32);
    chain[2].texels[5][1] = f32::NAN;
    let verdict = judge(&chain, &Question { kernel: Some(KernelKind::Nol), ..Question::default() }).unwrap();
    assert!(verdict.against_itself && verdict.orientation.is_none());
    assert!((verdict.levels[1].roughness.unwrap() - 0.5).abs() < 0.02, "{:?}", verdict.levels[1]);
    assert!((verdict.levels[2].roughness.unwrap() - 1.0).abs() < 0.02, "{:?}", verdict.levels[2]);
    assert_eq!(verdict.levels[2].nonfinite, 1);
    assert_eq!(verdict.checks.iter().filter(|check| !check.passed).count(), 1);
    let alone = judge(&chain[..1], &Question::default()).unwrap();
    assert!(says(&alone, "kernel: unknown; give what it was made from with --source"), "{:?}", alone.findings);
}

#[test]
fn the_command_judges_foreign_files_and_exits_with_3() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeed(
        folder,
        &["env", "builtin:sky", "--size", "16", "--min-size", "4", "--irradiance-size", "8", "--out", "own"],
    );
    let Decoded::Texture(mut texture) = read(&folder.join("own/specular.ktx2")).unwrap() else { panic!("a texture") };
    texture.metadata.clear();
    std::fs::write(folder.join("foreign.ktx2"), ktx2::encode(&texture).unwrap()).unwrap();
    let good = ["verify", "foreign.ktx2", "--source", "builtin:sky", "--kernel", "nol", "--max-error"];
    let run = succeed(folder, &[&good[..], &["0.02"]].concat());
    assert!(run.stdout.contains("kernel: nol") && run.stdout.contains("scale: normalised"), "{}", run.stdout);
    let error = fail(folder, &[&good[..], &["1e-6", "--junit", "chain.xml"]].concat(), 3);
    assert!(error.contains("checks failed") || error.contains("failed"), "{error}");
    let xml = std::fs::read_to_string(folder.join("chain.xml")).unwrap();
    assert!(xml.contains("<failure message") && xml.contains("kernel: nol"), "{xml}");
    assert!(fail(folder, &["verify", "foreign.ktx2"], 1).contains("--source"));
    let json =
        succeed(folder, &["identify", "foreign.ktx2", "--source", "builtin:sky", "--kernel", "nol", "--json"]).stdout;
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    let found = value[0]["levels"][1]["roughness"].as_f64().unwrap();
    assert!((found - 0.5).abs() < 0.02, "{json}");
    let error = fail(folder, &["identify", "own/certificate.json"], 1);
    assert!(error.contains("certificate.json"), "{error}");
}

/// Squares and panoramas filled by the full sum in directions that are written out by hand, mirrored in x.
fn flat_chain(source: &Panorama, layout: SphereLayout, size: usize) -> Vec<SphereMap> {
    let sum = FullSum::new(source);
    let direction = |n: usize, i: usize| match layout {
        SphereLayout::Equirect => {
            let (phi, theta) =
                (PI * ((i % (2 * n)) as f64 + 0.5) / n as f64 - PI, PI * ((i / (2 * n)) as f64 + 0.5) / n as f64);
            DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
        }
        _ => {
            let [u, v] = [i % n, i / n].map(|k| (2.0 * k as f64 + 1.0) / n as f64 - 1.0);
            let z = 1.0 - u.abs() - v.abs();
            let out = (-z).max(0.0);
            DVec3::new(u - out * u.signum(), v - out * v.signum(), z).normalize()
        }
    };
    let level = |(m, r): (usize, f64)| {
        let size = size >> m;
        if r == 0.0 {
            return SphereMap::area_average(source, layout, size, &"-x,y,z".parse().unwrap()).unwrap();
        }
        let n = size * size * if layout == SphereLayout::Equirect { 2 } else { 1 };
        let mirrored = |d: DVec3| DVec3::new(-d.x, d.y, d.z);
        let value = |i: usize| sum.evaluate(mirrored(direction(size, i)), &Kernel::new(r * r)).map(|v| v as f32);
        SphereMap { layout, size, texels: (0..n).map(value).collect() }
    };
    ROUGHNESS.into_iter().enumerate().map(level).collect()
}

#[test]
fn chains_of_squares_and_of_panoramas_are_judged_as_cubes_are() {
    let source = panorama();
    for (layout, size) in [(SphereLayout::Octahedral, 24), (SphereLayout::Equirect, 16)] {
        let mut chain = flat_chain(&source, layout, size);
        let verdict = judge_maps(&chain, &asked(&source, Some(KernelKind::Nol))).unwrap();
        let orientation = verdict.orientation.as_ref().unwrap();
        assert_eq!(orientation.turn.unwrap().formula(), "(−x, y, z)", "{layout}: {orientation:?}");
        assert!(orientation.mirrored && orientation.as_good == 0, "{layout}: {orientation:?}");
        assert_eq!(verdict.kernel, Some(KernelKind::Nol), "{layout}: {:?}", verdict.findings);
        for (level, wanted) in verdict.levels.iter().zip(ROUGHNESS) {
            let found = level.roughness.expect("a known roughness");
            assert!((found - wanted).abs() < 5e-3, "{layout}, wanted {wanted}: {level:?}");
        }
        // Against what it is, but for the last: the judge's filter and the sum are each known to 1e-5, texels are rounded to f32.
        let claim = Question {
            roughness: Some(vec![0.0, 0.5, 0.9]),
            max_error: Some(3e-5),
            ..asked(&source, Some(KernelKind::Nol))
        };
        let checks = judge_maps(&chain, &claim).unwrap().checks;
        let failed: Vec<&str> =
            checks.iter().filter(|check| !check.passed).map(|check| check.subject.as_str()).collect();
        assert_eq!(failed, ["level 2"], "{layout}: {checks:?}");
        // A texel that is three times too bright, and all of a level by π.
        chain[1].texels[37] = chain[1].texels[37].map(|v| 3.0 * v);
        chain[2].texels.iter_mut().flatten().for_each(|v| *v *= std::f32::consts::PI);
        let told = judge_maps(&chain, &asked(&source, Some(KernelKind::Nol))).unwrap();
        let [width, _] = layout.shape(size / 2).0;
        let place = format!("texel {}, {}", 37 % width, 37 / width);
        let fireflies = format!("level 1: 1 fireflies, the worst 3.000 times the truth at {place}");
        assert!(says(&told, &fireflies), "{layout}: {:?}", told.findings);
        assert!((told.levels[2].scale.unwrap() / PI - 1.0).abs() < 1e-3, "{layout}: {:?}", told.levels[2]);
        assert!(!says(&told, "seams"), "{layout}: {:?}", told.findings);
    }
}

#[test]
fn files_of_squares_and_panoramas_are_compared_with_their_source() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let bake = |out: &str, flags: &[&str]| {
        succeed(folder, &[&["-q", "env", "builtin:sky", "--out", out], flags].concat());
    };
    let small = ["--min-size", "4", "--irradiance-size", "4", "--size", "16"];
    bake("square", &[&["--layout", "octahedral", "--orientation", "x,z,y"], &small[..]].concat());
    bake("wide", &[&["--layout", "equirect", "--format", "exr:f16"], &small[..]].concat());
    for (file, claim, turn) in [
        ("square/specular.ktx2", "octahedral map of 16², 3 levels, against builtin:sky", "(x, z, y)"),
        ("wide/specular.exr", "panorama of 32 × 16, 3 levels, against builtin:sky", "as Kiln has it"),
    ] {
        // Halves are off by 2⁻¹¹ of the value, less where it is small.
        let judge =
            ["verify", file, "--source", "builtin:sky", "--kernel", "nol", "--roughness", "0,0.5,1", "--max-error"];
        let good = succeed(folder, &[&judge[..], &["1e-3"]].concat()).stdout;
        assert!(good.contains(claim) && good.contains(turn), "{good}");
        fail(folder, &[&judge[..], &["1e-6"]].concat(), 3);
    }
    std::fs::write(folder.join("grey.hdr"), b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 3\n").unwrap();
    assert!(fail(folder, &["verify", "grey.hdr", "--source", "builtin:sky"], 1).contains("; "));
}

/// Exact texels through bilinear filtering and fitted ones: the fit may not be worse, and for a map with curvature it is better.
#[test]
fn fitted_texels_bring_the_lookup_closer() {
    let source = panorama();
    let spec = ChainSpec { fit: Fit::Lookup, ..ChainSpec::new(16, 4) };
    let chain = specular_chain(&source, &spec, &|_| {}).unwrap();
    assert!(chain.reports[0].fit.is_none() && chain.reports[0].probe.is_none(), "a mirror is not fitted");
    for report in &chain.reports[1..] {
        let fit = report.fit.as_ref().unwrap();
        // Far from kinks the RMS goes from h² f″/√120 to h² f″/√720 in one dimension: to 0.41 of it.
        assert!(fit.kept && fit.fitted.rms < 0.7 * fit.exact.rms, "{fit:?}");
    }
    let white = builtin("white", 32).unwrap();
    let chain = specular_chain(&white, &spec, &|_| {}).unwrap();
    assert!(chain.levels.iter().flat_map(|cube| &cube.texels).flatten().all(|&v| v == 1.0), "white stays white");
    // A lamp of one texel in black: nowhere negative.
    let mut texels = vec![[0.0; 3]; 64 * 32];
    texels[10 * 64 + 20] = [1e4, 1e3, 0.0];
    let lamp = Panorama::new(64, 32, texels).unwrap();
    let chain = specular_chain(&lamp, &spec, &|_| {}).unwrap();
    assert!(chain.levels.iter().flat_map(|cube| &cube.texels).flatten().all(|&v| v >= 0.0));
    for report in &chain.reports[1..] {
        let fit = report.fit.as_ref().unwrap();
        assert!(!fit.kept || fit.fitted.rms < fit.exact.rms, "{fit:?}");
    }
}

#[test]
fn fitted_chains_verify_and_do_not_depend_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let arguments =
        ["env", "builtin:sky", "--size", "16", "--min-size", "4", "--irradiance-size", "8", "--fit", "lookup"];
    for threads in ["1", "2"] {
        succeed(folder, &[&arguments[..], &["--threads", threads, "--out", threads]].concat());
    }
    for file in ["specular.ktx2", "irradiance.ktx2", "certificate.json"] {
        let [one, two] = ["1", "2"].map(|threads| std::fs::read(folder.join(threads).join(file)).unwrap());
        assert!(one == two, "{file} depends on the number of threads");
    }
    let run = succeed(folder, &["verify", "1"]);
    assert!(run.stdout.contains("full sum through bilinear filtering"), "{}", run.stdout);
    let info = succeed(folder, &["info", "1/specular.ktx2"]).stdout;
    assert!(info.contains("not measured (a picture of boxes)") && info.contains("fitted; exact texels"), "{info}");
}

/// Levels of a few texels are off by more than their value in the dark, and exact texels by more than that.
#[test]
fn fitted_levels_of_a_few_texels_verify() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let arguments = ["--size", "8", "--min-size", "2", "--irradiance", "none", "--fit", "lookup", "--out", "sun"];
    succeed(folder, &[&["env", "builtin:sun"][..], &arguments].concat());
    let certificate = std::fs::read_to_string(folder.join("sun/certificate.json")).unwrap();
    let certificate = kiln::certificate::Certificate::from_json(&certificate).unwrap();
    let largest = certificate.levels.iter().filter_map(|level| Some(level.lookup.as_ref()?.max)).fold(0.0, f64::max);
    assert!(largest > 1.0, "{largest}");
    succeed(folder, &["verify", "sun"]);
}

/// Tables take the same fit: better through the filter, by its own certificate, and told from a table that is not what it says.
#[test]
fn a_fitted_table_is_closer_through_the_filter_and_verifies() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let axes = "mu:16:log+0.01:edge,roughness:12:log+0.05";
    let run = succeed(
        folder,
        &["table", "dfg", "--axes", axes, "--fit", "lookup", "--format", "exr:f32", "-o", "dfg.exr", "--json"],
    );
    let certificate: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    for fit in certificate["fit"].as_array().unwrap() {
        assert_eq!(fit["kept"], true, "{fit}");
        let [exact, fitted] = ["exact", "fitted"].map(|kind| fit[kind]["rms"].as_f64().unwrap());
        assert!(fitted < exact, "{fit}");
    }
    let verified = succeed(folder, &["verify", "dfg.exr"]).stdout;
    assert!(verified.contains("fitted again, every texel"), "{verified}");
    // The exact table under the fitted one's certificate.
    succeed(folder, &["table", "dfg", "--axes", axes, "--format", "exr:f32", "-o", "exact.exr"]);
    let Decoded::Picture(mut image, _) = read(&folder.join("exact.exr")).unwrap() else { panic!("a picture") };
    image.metadata = vec![("kiln.certificate".to_owned(), certificate.to_string())];
    let wide = kiln::format::Image {
        texels: image.texels.iter().map(|&v| f64::from(v)).collect(),
        width: image.width,
        height: image.height,
        channels: image.channels.clone(),
        metadata: image.metadata.clone(),
        primaries: None,
    };
    std::fs::write(folder.join("dfg.exr"), kiln::format::exr::encode(&wide, kiln::pack::Number::F32).unwrap().0)
        .unwrap();
    let told = fail(folder, &["verify", "dfg.exr"], 3);
    assert!(told.contains("error: "), "{told}");
}
