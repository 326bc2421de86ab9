//! Broken files give an error that says what to do; never a panic, and never memory out of proportion to the file.

#![allow(clippy::unwrap_used)] // in helpers, which clippy does not count among the tests

use crate::support::memory;
use crate::support::samples::{Random, cube, hdr as hdr_sample, picture};
use kiln::format::{decode_image, exr, hdr, ktx2};
use kiln::pack::{Number, TexelFormat};
use std::panic::catch_unwind;

fn exr_sample() -> Vec<u8> {
    exr::encode(&picture(24, 20, &["R", "G", "B"]), Number::F16).unwrap().0
}

fn ktx2_sample() -> Vec<u8> {
    ktx2::encode(&cube(TexelFormat::ALL[1], 4)).unwrap()
}

/// Decodes by the reader that the beginning of the valid file asks for.
fn decode(bytes: &[u8], kind: &str) -> kiln::Result<usize> {
    match kind {
        "exr" => exr::decode(bytes).map(|image| image.texels.len()),
        "hdr" => hdr::decode(bytes).map(|image| image.texels.len()),
        "ktx2" => ktx2::decode(bytes).map(|texture| texture.levels.len()),
        _ => decode_image(bytes).map(|image| image.texels.len()),
    }
}

fn assert_refused(what: &str, bytes: &[u8], kind: &str) {
    let result = catch_unwind(|| decode(bytes, kind)).unwrap_or_else(|_| panic!("{kind}, {what}: panicked"));
    let message = result.expect_err(&format!("{kind}, {what}: accepted")).to_string();
    let (statement, way_out) =
        message.split_once("; ").unwrap_or_else(|| panic!("{kind}, {what}: no way out: {message}"));
    assert!(!statement.is_empty() && !way_out.is_empty(), "{kind}, {what}: {message}");
}

fn samples() -> [(&'static str, Vec<u8>); 3] {
    [("exr", exr_sample()), ("hdr", hdr_sample()), ("ktx2", ktx2_sample())]
}

#[test]
fn the_samples_themselves_are_sound() {
    for (kind, bytes) in samples() {
        decode(&bytes, kind).unwrap();
    }
}

#[test]
fn files_cut_off_anywhere_are_refused() {
    for (kind, bytes) in samples() {
        for length in 0..bytes.len() {
            assert_refused(&format!("cut off after {length} bytes"), &bytes[..length], kind);
        }
    }
}

#[test]
fn files_of_other_content_are_refused() {
    let mut random = Random(5);
    let noise: Vec<u8> = (0..4096).map(|_| random.next() as u8).collect();
    for kind in ["exr", "hdr", "ktx2", "any"] {
        assert_refused("empty", b"", kind);
        assert_refused("one byte", b"#", kind);
        assert_refused("text", b"once upon a time\n\nthere was a file\n", kind);
        assert_refused("noise", &noise, kind);
        assert_refused("zeros", &[0; 4096], kind);
    }
    for (kind, bytes) in samples() {
        let mut wrong = bytes.clone();
        wrong[0] ^= 1;
        assert_refused("a bit of the magic number flipped", &wrong, kind);
        let noisy = [&bytes[..16], &noise].concat();
        assert_refused("noise after the magic number", &noisy, kind);
    }
}

#[test]
fn radiance_headers_that_lie_are_refused() {
    let body = [7; 4000];
    let file = |head: &str| [head.as_bytes(), &body].concat();
    for resolution in [
        "-Y 100000 +X 100000",
        "-Y 4294967295 +X 4294967295",
        "-Y 18446744073709551616 +X 1",
        "-Y 0 +X 16",
        "-Y 16 +X 0",
        "-Y -4 +X 16",
        "-Y 4 +X 16 17",
        "-Y 4 +Y 16",
        "-Z 4 +X 16",
        "4 16",
        "-Y +X",
        "-Y 1.5 +X 4",
        "",
    ] {
        assert_refused(resolution, &file(&format!("#?RADIANCE\n\n{resolution}\n")), "hdr");
    }
    for line in [
        "FORMAT=32-bit_rle_xyze",
        "FORMAT=16-bit",
        "EXPOSURE=0",
        "EXPOSURE=-1",
        "EXPOSURE=nan",
        "EXPOSURE=inf",
        "EXPOSURE=two",
        "EXPOSURE=1e-29\nEXPOSURE=1e-29",
        "COLORCORR=1 1",
        "COLORCORR=1 0 1",
    ] {
        assert_refused(line, &file(&format!("#?RADIANCE\n{line}\n\n-Y 4 +X 4\n")), "hdr");
    }
}

#[test]
fn radiance_scanlines_that_lie_are_refused() {
    let file = |width: usize, body: &[u8]| [format!("#?RADIANCE\n\n-Y 1 +X {width}\n").as_bytes(), body].concat();
    assert_refused("another length", &file(16, &[2, 2, 0, 17, 144, 1, 144, 1, 144, 1, 144, 1]), "hdr");
    assert_refused("a run past the end", &file(16, &[2, 2, 0, 16, 145, 1, 144, 1, 144, 1, 144, 1]), "hdr");
    assert_refused("a literal past the end", &file(16, &[[2, 2, 0, 16, 17].as_slice(), &[1; 90]].concat()), "hdr");
    assert_refused("empty literals without end", &file(16, &[[2, 2, 0, 16].as_slice(), &[0; 90]].concat()), "hdr");
    assert_refused("a run of nothing", &file(16, &[1, 1, 1, 16]), "hdr");
    assert_refused("empty runs without end", &file(16, &[[9; 4].as_slice(), &[1, 1, 1, 0].repeat(40)].concat()), "hdr");
    assert_refused("an old run past the end", &file(16, &[9, 9, 9, 9, 1, 1, 1, 16]), "hdr");
}

/// Every 32-bit field of the header, set to what should not be there.
#[test]
fn ktx2_headers_that_lie_are_refused() {
    let sample = ktx2_sample();
    let fields = [
        ("vkFormat", 12, vec![0, 1, 37, 90, 144, u32::MAX]),
        ("pixelWidth", 20, vec![0, 3, 5, 1 << 30, u32::MAX]),
        ("pixelHeight", 24, vec![0, 5, u32::MAX]),
        ("pixelDepth", 28, vec![1, u32::MAX]),
        ("layerCount", 32, vec![6, u32::MAX]), // 1 is an array of one,
        ("faceCount", 36, vec![0, 1, 2, 5, 7, u32::MAX]),
        ("levelCount", 40, vec![4, 5, 1000, u32::MAX]),
        ("supercompressionScheme", 44, vec![1, 2, 3, 4, 0x10000, u32::MAX]),
        ("kvdByteOffset", 56, vec![0, u32::MAX]),
        ("kvdByteLength", 60, vec![3, u32::MAX]),
        ("first level's offset, low", 80, vec![u32::MAX]),
        ("first level's offset, high", 84, vec![1, u32::MAX]),
        ("first level's length, low", 88, vec![0, 1, u32::MAX]),
        ("first level's length, high", 92, vec![1, u32::MAX]),
    ];
    for (name, at, values) in fields {
        for value in values {
            let mut bytes = sample.clone();
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            assert_refused(&format!("{name} {value}"), &bytes, "ktx2");
        }
    }
}

/// The bytes of the attribute called `name`, of that type and size, replaced.
fn with_attribute(name: &str, kind: &str, value: &[u8]) -> Vec<u8> {
    let mut bytes = exr_sample();
    let head = [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &(value.len() as u32).to_le_bytes()].concat();
    let at = bytes.windows(head.len()).position(|window| window == head).unwrap() + head.len();
    bytes[at..at + value.len()].copy_from_slice(value);
    bytes
}

#[test]
fn openexr_headers_that_lie_are_refused() {
    let window = |bounds: [i32; 4]| bounds.map(i32::to_le_bytes).concat();
    for bounds in [
        [0, 0, 99_999, 99_999],
        [0, 0, 1_000_000_000, 1_000_000_000],
        [0, 0, -2, -2],
        [0, 0, -1, -1],
        [5, 5, 4, 4],
        [i32::MIN, i32::MIN, i32::MAX, i32::MAX],
        [0, 0, 23, 1_000_000],
        [100, 100, 123, 119],
    ] {
        let bytes = with_attribute("dataWindow", "box2i", &window(bounds));
        assert_refused(&format!("data window {bounds:?}"), &bytes, "exr");
    }
    for bounds in [[0, 0, 99_999, 99_999], [i32::MIN, 0, i32::MAX, 19], [0, 0, -5, -5], [1000, 1000, 1001, 1001]] {
        let bytes = with_attribute("displayWindow", "box2i", &window(bounds));
        assert_refused(&format!("display window {bounds:?}"), &bytes, "exr");
    }
    assert_refused("compression 77", &with_attribute("compression", "compression", &[77]), "exr");
    for flags in [0x0100_0002_u32, 0x802, 0x1002, 0x202, 3, 0] {
        let mut bytes = exr_sample();
        bytes[4..8].copy_from_slice(&flags.to_le_bytes());
        assert_refused(&format!("version field {flags:#x}"), &bytes, "exr");
    }
}

#[test]
fn openexr_tables_that_name_one_block_twice_are_refused() {
    let mut bytes = exr_sample();
    let end = bytes.windows(24).position(|w| w.starts_with(b"screenWindowWidth\0float\0")).unwrap() + 24 + 4 + 4;
    // After the last attributes comes "type"; the table starts behind the header's closing zero.
    let table = end + bytes[end..].windows(14).position(|w| w.starts_with(b"scanlineimage\0")).unwrap() + 14;
    let (first, second) = (bytes[table..table + 8].to_vec(), table + 8);
    bytes[second..second + 8].copy_from_slice(&first);
    assert_refused("one block twice", &bytes, "exr");
}

/// Pictures of every compression that the reader knows, by the writer of the `exr` crate.
fn exr_samples() -> Vec<(String, Vec<u8>)> {
    use ::exr::prelude::*;
    // Smooth, because blocks that do not shrink are stored as they are.
    let values: Vec<f16> = (0..40 * 36).map(|i| f16::from_f32((i % 40 + i / 40) as f32 / 8.0)).collect();
    let lossless = [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::PIZ];
    let lossy =
        [Compression::PXR24, Compression::B44, Compression::B44A, Compression::DWAA(None), Compression::DWAB(None)];
    let mut samples = Vec::new();
    for compression in lossless.into_iter().chain(lossy) {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 8))] {
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            let channel = |name: &str| AnyChannel::new(name, FlatSamples::F16(values.clone()));
            let channels = AnyChannels::sort(["R", "G", "B"].map(channel).into_iter().collect());
            let layer = Layer::new((40, 36), LayerAttributes::default(), encoding, channels);
            let mut bytes = std::io::Cursor::new(Vec::new());
            Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
            samples.push((format!("{compression:?} {blocks:?}"), bytes.into_inner()));
        }
    }
    samples
}

/// A file with one to three bytes changed, mostly in the first 400, where the structure is.
fn mutated(sample: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = sample.to_vec();
    for _ in 0..=random.below(3) {
        let end = if random.below(4) > 0 { bytes.len().min(400) } else { bytes.len() };
        let at = random.below(end);
        bytes[at] = match random.below(4) {
            0 => bytes[at] ^ (1 << random.below(8)),
            1 => 0,
            2 => 255,
            _ => random.next() as u8,
        };
    }
    bytes
}

/// Some mutations leave a sound file, the others are refused; no one panics.
#[test]
fn mutated_files_never_panic() {
    let mut random = Random(11);
    for (kind, sample) in samples() {
        let mut refused = 0;
        for round in 0..3000 {
            let bytes = mutated(&sample, &mut random);
            match catch_unwind(|| decode(&bytes, kind)) {
                Ok(Ok(_)) => {}
                Ok(Err(error)) => {
                    refused += 1;
                    assert!(error.to_string().contains("; "), "{kind} {round}: {error}");
                }
                Err(_) => panic!("{kind}, mutation {round}: panicked"),
            }
        }
        assert!(refused > 500, "{kind}: only {refused} of 3000 mutations were noticed");
    }
}

#[test]
fn mutated_openexr_files_of_every_compression_never_panic() {
    if !memory::alone("malformed_files::mutated_openexr_files_of_every_compression_never_panic") {
        return;
    }
    let mut random = Random(12);
    for (what, sample) in exr_samples() {
        exr::decode(&sample).unwrap_or_else(|error| panic!("{what}: {error}"));
        for round in 0..300 {
            let bytes = if round % 2 == 0 {
                mutated(&sample, &mut random)
            } else {
                // One bit of the compressed blocks.
                let mut bytes = sample.clone();
                let at = 400 + random.below(bytes.len() - 400);
                bytes[at] = random.next() as u8;
                bytes
            };
            let outcome = catch_unwind(|| exr::decode(&bytes));
            let result = outcome.unwrap_or_else(|_| panic!("{what}, mutation {round}: panicked"));
            if let Err(error) = result {
                assert!(error.to_string().contains("; "), "{what} {round}: {error}");
            }
        }
    }
    memory::assert_little();
}
