//! Whatever bytes come, every reader answers or refuses with a way out: no panic, no memory out of proportion.
//!
//! The generator is the one that the other tests use, and no crate: a failure prints its seed, which is all that it takes to see it again,
//! and the inputs are too small for shrinking to be of help.

#![allow(clippy::unwrap_used)] // in helpers, which clippy does not count among the tests

use crate::support::memory;
use crate::support::samples::{Random, cube, hdr as hdr_sample, picture};
use kiln::certificate::Certificate;
use kiln::environment::{InputLayout, Negatives, NonFinite, Reading, load};
use kiln::format::{
    self, Container, FormatSpec, Image, Texture, dds, decode_image, env, exr, hdr, ktx1, ktx2, npy, png, source,
};
use kiln::pack::{Number, TexelFormat};
use kiln::recipe::{EnvironmentRecipe, Recipe};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Numbers that headers break on.
const HOSTILE: [u32; 9] = [0, 1, 0x7f, 0xff, 0x7fff_ffff, 0x8000_0000, 0xffff_fff0, 0xffff_ffff, 0x0010_0000];

/// A valid file of the kind, of a random small size.
fn sample(kind: &str, random: &mut Random) -> Vec<u8> {
    let (width, height) = (1 + random.below(24), 1 + random.below(24));
    match kind {
        "exr" => {
            let names: [&[&str]; 4] = [&["R", "G", "B"], &["Y"], &["a.R", "a.G", "a.B"], &["A", "B", "G", "R", "Z"]];
            let mut image = picture(width, height, names[random.below(4)]);
            image.primaries = [None, Some(kiln::colour::Primaries::ACESCG)][random.below(2)];
            exr::encode(&image, [Number::F16, Number::F32][random.below(2)]).unwrap().0
        }
        "ktx1" | "dds" | "png" | "env" | "npy" | "source" | "zstd" => container_sample(kind, random),
        "ktx2" => ktx2::encode(&cube(TexelFormat::ALL[random.below(23)], 1 << random.below(4))).unwrap(),
        _ => match random.below(3) {
            0 => hdr_sample(),
            _ => {
                let primaries = "PRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329";
                let head = format!("#?RADIANCE\nEXPOSURE=2\n{primaries}\n\n-Y {height} +X {width}\n");
                [head.as_bytes(), &[99, 50, 25, 130].repeat(width * height)].concat()
            }
        },
    }
}

/// A small file of one of the other containers, in a random one of its formats.
fn container_sample(kind: &str, random: &mut Random) -> Vec<u8> {
    let containers: &[Container] = match kind {
        "ktx1" => &[Container::Ktx1],
        "dds" => &[Container::Dds],
        "png" => &[Container::Png],
        "env" => &[Container::Env],
        "npy" => &[Container::Npy],
        "zstd" => &[Container::Ktx2],
        _ => &[Container::C, Container::Rust, Container::Glsl, Container::Wgsl, Container::Js],
    };
    let container = containers[random.below(containers.len())];
    let specs: Vec<FormatSpec> = FormatSpec::all()
        .into_iter()
        .filter(|spec| spec.container() == container && (kind != "zstd" || spec.to_string().ends_with("+zstd")))
        .collect();
    let spec = specs[random.below(specs.len())];
    let format = spec.texel(3).unwrap_or_else(|_| spec.texel(1).unwrap());
    let mut texture = match container.has_cubes() && (kind == "env" || random.below(2) == 0) {
        true => Texture::empty_cube(format, 4),
        false => Texture::empty(format, 1 + random.below(9), 1 + random.below(9)),
    };
    for level in 0..if texture.faces == 6 { 3 } else { 1 } {
        let [width, height] = texture.level_size(level);
        let values = vec![0.5; width * height * texture.faces * format.channels()];
        texture.push_level(&values).unwrap();
    }
    if !matches!(kind, "dds" | "npy") {
        texture.metadata = vec![("kiln.recipe".into(), "{\"µ\":1}".into())];
    }
    format::encode(spec, &texture).unwrap()
}

/// Random bytes, or a valid file that was cut, flipped, spliced or lied in.
fn arbitrary(valid: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = valid.to_vec();
    let n = bytes.len();
    let noise = |random: &mut Random, n: usize| (0..n).map(|_| random.next() as u8).collect::<Vec<u8>>();
    match random.below(8) {
        0 => {
            let n = random.below(600);
            return noise(random, n);
        }
        1 => {
            // The magic number, and noise behind it.
            bytes.truncate(random.below(n.min(16) + 1));
            let n = random.below(600);
            bytes.extend(noise(random, n));
        }
        2 => bytes.truncate(random.below(n)),
        3 => {
            for _ in 0..=random.below(8) {
                let at = random.below(n);
                bytes[at] ^= 1 << random.below(8);
            }
        }
        4 => {
            // A hostile number in the head.
            let at = random.below(n.min(420).saturating_sub(4).max(1));
            let number = HOSTILE[random.below(HOSTILE.len())].to_le_bytes();
            let end = (at + 4).min(n);
            bytes[at..end].copy_from_slice(&number[..end - at]);
        }
        5 => {
            let (from, to) = (random.below(n), random.below(n));
            let length = random.below(64).min(n - from).min(n - to);
            bytes.copy_within(from..from + length, to);
        }
        6 => {
            let at = random.below(n);
            let length = random.below(40);
            let inserted = noise(random, length);
            bytes.splice(at..at, inserted);
        }
        _ => {
            let at = random.below(n);
            bytes.drain(at..(at + 1 + random.below(40)).min(n));
        }
    }
    bytes
}

/// Runs a reader, which must not panic, and whose error has a statement and a way out.
fn answers<T>(what: &str, round: usize, read: impl FnOnce() -> kiln::Result<T>) -> bool {
    match catch_unwind(AssertUnwindSafe(read)) {
        Ok(Ok(_)) => true,
        Ok(Err(error)) => {
            assert!(error.to_string().contains("; "), "{what}, round {round}: no way out: {error}");
            false
        }
        Err(_) => panic!("{what}, round {round}: panicked"),
    }
}

#[test]
fn every_reader_answers_or_refuses_arbitrary_bytes() {
    if !memory::alone("arbitrary_bytes::every_reader_answers_or_refuses_arbitrary_bytes") {
        return;
    }
    let mut random = Random(21);
    for kind in ["exr", "hdr", "ktx2"] {
        for round in 0..2500 {
            let valid = sample(kind, &mut random);
            let bytes = arbitrary(&valid, &mut random);
            // Each reader, not only the one that the first bytes ask for.
            answers("exr", round, || exr::decode(&bytes));
            answers("hdr", round, || hdr::decode(&bytes));
            answers("ktx2", round, || ktx2::decode(&bytes));
            answers("any", round, || decode_image(&bytes));
        }
    }
    for kind in ["ktx1", "dds", "png", "env", "npy", "source", "zstd"] {
        let mut read = 0;
        for round in 0..1200 {
            let valid = container_sample(kind, &mut random);
            let bytes = if round % 20 == 0 { valid } else { arbitrary(&valid, &mut random) };
            read += usize::from(answers("any", round, || format::decode(&bytes)));
            answers("ktx1", round, || ktx1::decode(&bytes));
            answers("dds", round, || dds::decode(&bytes));
            answers("png", round, || png::decode(&bytes));
            answers("env", round, || env::decode(&bytes));
            answers("npy", round, || npy::decode(&bytes));
            answers("source", round, || source::decode(&bytes));
            answers("ktx2", round, || ktx2::decode(&bytes));
        }
        assert!(read >= 60, "{kind}: only {read} of 1200 files were read");
    }
    memory::assert_little();
}

#[test]
fn environments_from_arbitrary_files_are_read_or_refused() {
    if !memory::alone("arbitrary_bytes::environments_from_arbitrary_files_are_read_or_refused") {
        return;
    }
    let mut random = Random(22);
    let folder = tempfile::tempdir().unwrap();
    let layouts = [InputLayout::Auto, InputLayout::Panorama, InputLayout::Cross, InputLayout::Strip, InputLayout::Cube];
    let mut read = 0;
    for round in 0..600 {
        let kind = ["exr", "hdr", "ktx2"][random.below(3)];
        let valid = sample(kind, &mut random);
        let bytes = if round % 2 == 0 { valid } else { arbitrary(&valid, &mut random) };
        let name = ["map.bin", "sky_px.hdr", "left.exr"][random.below(3)];
        std::fs::write(folder.path().join(name), &bytes).unwrap();
        let (nonfinite, negatives) = (NonFinite::Zero, [Negatives::Keep, Negatives::Clamp][random.below(2)]);
        let reading = Reading { layout: layouts[random.below(5)], nonfinite, negatives, ..Reading::default() };
        let input = [name, "sky_%s.hdr", "."][[0, 0, 0, 0, 1, 2][random.below(6)]];
        let path = if input == "." { folder.path().to_owned() } else { folder.path().join(input) };
        read += usize::from(answers(kind, round, || load(path.to_str().unwrap(), &reading)));
    }
    assert!(read > 50, "only {read} of 600 inputs were read");
    memory::assert_little();
}

/// Every picture of up to 26 × 26 is a panorama, a cube, or refused, by any layout.
#[test]
fn pictures_of_every_small_size_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.exr");
    for (width, height) in (1..=26).flat_map(|w| (1..=26).map(move |h| (w, h))) {
        let image = Image::new(width, height, &["Y"], vec![1.0_f32; width * height]).unwrap();
        std::fs::write(&path, exr::encode(&image, Number::F16).unwrap().0).unwrap();
        let read = answers("size", 100 * width + height, || load(path.to_str().unwrap(), &Reading::default()));
        let is_cube = width * 3 == height * 4 || width * 4 == height * 3 || width == 6 * height || 6 * width == height;
        assert_eq!(read, width >= 4 && height >= 2 || is_cube, "{width} × {height}");
    }
}

#[test]
fn certificates_and_recipes_of_arbitrary_text_are_read_or_refused() {
    if !memory::alone("arbitrary_bytes::certificates_and_recipes_of_arbitrary_text_are_read_or_refused") {
        return;
    }
    let mut random = Random(23);
    let environment = EnvironmentRecipe::new("sky_%s.hdr");
    let certificate = Certificate { environment: Some(environment), ..Certificate::new() }.to_json().unwrap();
    let recipe = Recipe::built_in().unwrap().to_toml().unwrap();
    Certificate::from_json(&certificate).unwrap();
    Recipe::from_toml(&recipe).unwrap();
    for round in 0..4000 {
        let bytes = arbitrary(certificate.as_bytes(), &mut random);
        answers("certificate", round, || Certificate::from_json(&String::from_utf8_lossy(&bytes)));
        let bytes = arbitrary(recipe.as_bytes(), &mut random);
        answers("recipe", round, || Recipe::from_toml(&String::from_utf8_lossy(&bytes)));
    }
    for deep in ["[".repeat(100_000), "{\"a\":".repeat(50_000), format!("{{\"schema\":{}", "[".repeat(100_000))] {
        assert!(!answers("deep certificate", 0, || Certificate::from_json(&deep)));
    }
    for deep in [format!("a = {}", "[".repeat(5_000)), "[a.".repeat(5_000), "a.".repeat(5_000)] {
        assert!(!answers("deep recipe", 0, || Recipe::from_toml(&deep)));
    }
    memory::assert_little();
}
