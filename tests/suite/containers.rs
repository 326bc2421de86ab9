//! Every container and every packing in it, through the one dispatch, read back by Kiln and by readers that other people wrote.

#![allow(clippy::unwrap_used)] // in helpers, which clippy does not count among the tests

use crate::support::kiln::succeed;
use crate::support::samples::Random;
use crate::support::tools;
use kiln::bake;
use kiln::certificate;
use kiln::compare::{Tolerance, compare, levels};
use kiln::convert::{Conversion, Shape, convert, usual_format};
use kiln::environment::{SphereLayout, SphereMap};
use kiln::format::grid::Described;
use kiln::format::{self, Container, Decoded, FormatSpec, Texture, Variant, dds, hdr, ktx2};
use kiln::pack::{Number, TexelFormat, bc6h};
use kiln::recipe::{EnvironmentRecipe, IrradianceKind, TableRecipe};
use kiln::verify::{self, Options};
use std::path::{Path, PathBuf};

fn file(folder: &tempfile::TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    format::atomic::write(&path, bytes).unwrap();
    path
}

/// Values within what the format holds, 0 and the largest of a few stops among them.
fn values(format: TexelFormat, n: usize) -> Vec<f64> {
    let mut random = Random(31);
    let most = format.largest(0).min(60.0);
    (0..n * format.channels()).map(|_| most * random.unit().powi(3)).collect()
}

/// A texture of the kind: flat, cube, volume, array.
fn texture(kind: &str, format: TexelFormat) -> Texture {
    let mut texture = match kind {
        "flat" => Texture::empty(format, 6, 5),
        "cube" => Texture::empty_cube(format, 8),
        "volume" => Texture { depth: 5, ..Texture::empty(format, 6, 4) },
        _ => Texture { array_layers: 3, ..Texture::empty(format, 6, 5) },
    };
    let n_levels = if kind == "flat" { 1 } else { 3 };
    for level in 0..n_levels {
        let [width, height] = texture.level_size(level);
        let level = values(format, width * height * texture.layers(level));
        texture.push_level(&level).unwrap();
    }
    texture
}

/// Texels only: containers differ in what else they carry.
fn assert_same_texels(what: &str, wanted: &Texture, got: &Texture) {
    let shape = |t: &Texture| (t.format, t.width, t.height, t.depth, t.array_layers, t.faces, t.levels.len());
    assert_eq!(shape(got), shape(wanted), "{what}");
    assert!(got.levels == wanted.levels, "{what}: other texels");
}

#[test]
fn every_format_is_read_again_as_it_was_packed() {
    for spec in FormatSpec::all() {
        let format = spec.texel(3).unwrap_or_else(|_| spec.texel(1).unwrap());
        let kinds: &[&str] = match spec.container() {
            Container::Ktx2 | Container::Ktx1 => &["flat", "cube", "volume", "array"],
            Container::Dds if spec.variant() == Variant::Legacy => &["flat", "cube", "volume"],
            Container::Dds => &["flat", "cube", "volume", "array"],
            Container::Env => &[],
            _ => &["flat"],
        };
        for kind in kinds {
            let what = format!("{spec} {kind}");
            let texture = texture(kind, format);
            let bytes = format::encode(spec, &texture).unwrap_or_else(|e| panic!("{what}: {e}"));
            if spec.container() == Container::Raw {
                assert_eq!(bytes, texture.levels[0], "{what}");
                continue;
            }
            let decoded = format::decode(&bytes).unwrap_or_else(|e| panic!("{what}: {e}"));
            let wide = |values: Vec<f32>| values.into_iter().map(f64::from).collect::<Vec<f64>>();
            match &decoded {
                Decoded::Texture(back) => assert_same_texels(&what, &texture, back),
                // An OpenEXR sorts its channels by name: B, G, R.
                Decoded::Picture(image, stored) if spec.container() == Container::Exr => {
                    let rgb: Vec<f32> = image.rgb().unwrap().into_iter().flatten().collect();
                    assert_eq!((rgb, *stored), (texture.values(0), format), "{what}");
                }
                _ => {
                    assert_eq!(decoded.values(), wide(texture.values(0)), "{what}");
                    let number = decoded.format().unwrap().number();
                    assert_eq!(number, format.number(), "{what}");
                }
            }
        }
    }
}

#[test]
fn what_a_container_has_no_place_for_is_refused_with_those_that_have() {
    for (name, kind) in [("hdr", "cube"), ("png:rgb8unorm", "array"), ("exr:f32", "volume")] {
        let spec: FormatSpec = name.parse().unwrap();
        let message = format::encode(spec, &texture(kind, spec.texel(3).unwrap())).unwrap_err().to_string();
        let why = if name == "exr:f32" { "which Kiln writes pictures and cubes to" } else { "which holds one picture" };
        assert!(message.contains(&format!("{why}; use ktx2, ktx1 or dds")), "{message}");
    }
    let cube = texture("cube", "rgb32f".parse().unwrap());
    let message = format::encode("npy:f32".parse().unwrap(), &cube).unwrap_err().to_string();
    assert!(message.contains("3 levels in an array, which has one"), "{message}");
    let message = format::encode("ktx2:rgba16f".parse().unwrap(), &cube).unwrap_err().to_string();
    assert!(message.contains("rgb32f for a file of ktx2:rgba16f; pack it as rgba16f"), "{message}");
}

#[test]
fn zstandard_gives_back_the_levels_and_ktx2_readers_find_it() {
    for name in ["rgba16f", "rgb9e5", "bc6h", "uastc-hdr"] {
        let texture = texture("cube", name.parse().unwrap());
        let bytes = ktx2::encode_zstd(&texture).unwrap();
        let reader = ::ktx2::Reader::new(&bytes).unwrap();
        assert_eq!(reader.header().supercompression_scheme, Some(::ktx2::SupercompressionScheme::Zstandard));
        for (level, wanted) in reader.levels().zip(&texture.levels) {
            assert_eq!(level.uncompressed_byte_length as usize, wanted.len());
            assert_eq!(&zstd::bulk::decompress(level.data, wanted.len()).unwrap(), wanted, "{name}");
        }
        let mut lies = bytes.clone();
        lies[80 + 16] ^= 1; // how long level 0 is when it is decompressed
        assert!(ktx2::decode(&lies).is_err());
    }
}

#[test]
fn dds_is_what_ddsfile_reads() {
    use ddsfile::{D3DFormat, Dds, DxgiFormat};
    let formats = [
        ("rgba16f", DxgiFormat::R16G16B16A16_Float),
        ("rg16f", DxgiFormat::R16G16_Float),
        ("rgba32f", DxgiFormat::R32G32B32A32_Float),
        ("rgb32f", DxgiFormat::R32G32B32_Float),
        ("rgba8unorm", DxgiFormat::R8G8B8A8_UNorm),
        ("r16unorm", DxgiFormat::R16_UNorm),
        ("rgb9e5", DxgiFormat::R9G9B9E5_SharedExp),
        ("b10g11r11", DxgiFormat::R11G11B10_Float),
        ("bc6h", DxgiFormat::BC6H_UF16),
    ];
    for (name, dxgi) in formats {
        for kind in ["flat", "cube", "volume", "array"] {
            let texture = texture(kind, name.parse().unwrap());
            let theirs = Dds::read(&dds::encode(&texture).unwrap()[..]).unwrap();
            let what = format!("{name} {kind}");
            assert_eq!(theirs.get_dxgi_format(), Some(dxgi), "{what}");
            assert_eq!((theirs.get_width(), theirs.get_height()), (texture.width as u32, texture.height as u32));
            assert_eq!(theirs.get_num_mipmap_levels() as usize, texture.levels.len(), "{what}");
            if kind == "volume" {
                assert_eq!(theirs.get_depth(), 5);
                continue; // the crate cuts volumes only by layers
            }
            let elements = texture.layers(0);
            let cubes = theirs.header10.as_ref().unwrap().array_size;
            assert_eq!(cubes as usize * texture.faces, elements, "{what}");
            for element in 0..elements {
                // The crate takes faces for layers of their own.
                let stride = theirs.data.len() / elements;
                let mut rest = &theirs.data[element * stride..(element + 1) * stride];
                for level in 0..texture.levels.len() {
                    let wanted = texture.picture(level, element).unwrap();
                    let (got, after) = rest.split_at(wanted.len());
                    assert!(got == wanted, "{what}: level {level} of element {element}");
                    rest = after;
                }
            }
        }
    }
    let cube = texture("cube", "rgba16f".parse().unwrap());
    let theirs = Dds::read(&dds::encode_legacy(&cube).unwrap()[..]).unwrap();
    assert_eq!(theirs.get_d3d_format(), Some(D3DFormat::A16B16G16R16F));
    assert!(theirs.header10.is_none());
    assert_eq!(theirs.header.caps2.bits(), 0xfe00);
    assert_eq!(theirs.header.spf.fourcc.as_ref().unwrap().0, 113);
}

#[test]
fn dds_of_other_texels_is_refused_by_name() {
    let mut bytes = dds::encode(&texture("flat", "rgba16f".parse().unwrap())).unwrap();
    bytes[128] = 99; // BC7
    assert!(dds::decode(&bytes).unwrap_err().to_string().contains("DXGI's number 99; convert it"));
    bytes[84..88].copy_from_slice(b"DXT1");
    assert!(dds::decode(&bytes).unwrap_err().to_string().contains("texel format is DXT1"));
}

/// The writer is exact: every value comes back within half a step of the shared exponent, in all of f32's range, by other people's reader.
#[test]
fn hdr_is_exact_and_read_by_the_image_crate() {
    use image::ImageDecoder;
    let mut random = Random(32);
    for width in [5_usize, 8, 300] {
        let mut values: Vec<f64> =
            (0..width * 4 * 3).map(|_| random.unit() * 2_f64.powi(random.below(200) as i32 - 100)).collect();
        values[..6].copy_from_slice(&[1e-39, 0.0, 1e-42, 1.6e38, 1.0, 0.25]);
        values[30..42].fill(0.5); // a run
        let (texture, report) = Texture::flat(TexelFormat::Rgbe, width, 4, &values).unwrap();
        assert_eq!((report.overflowed, report.negative, report.nonfinite), (0, 0, 0));
        let bytes = hdr::encode(&texture).unwrap();
        let decoder = image::codecs::hdr::HdrDecoder::new(&bytes[..]).unwrap();
        let mut theirs = vec![0; decoder.total_bytes() as usize];
        decoder.read_image(&mut theirs).unwrap();
        let theirs: Vec<f32> = theirs.chunks_exact(4).map(|b| f32::from_ne_bytes(b.try_into().unwrap())).collect();
        assert_eq!(theirs, hdr::decode(&bytes).unwrap().texels);
        for (texel, got) in values.chunks_exact(3).zip(theirs.chunks_exact(3)) {
            let brightest = texel.iter().copied().fold(0.0, f64::max);
            let half = 0.5 * TexelFormat::Rgbe.step(0, brightest, brightest).unwrap();
            for c in 0..3 {
                assert!((f64::from(got[c]) - texel[c]).abs() <= half, "{texel:?} became {got:?}");
            }
        }
    }
}

#[test]
fn bc6h_errors_are_those_that_its_report_states() {
    let mut random = Random(33);
    for (width, height) in [(1, 1), (2, 2), (5, 3), (16, 12)] {
        // A sky that grows brighter upwards, a little noise, and a sun.
        let mut values: Vec<f64> =
            (0..width * height * 3).map(|i| 0.5 + 0.01 * (i / 3) as f64 + 0.02 * random.unit()).collect();
        values[0] = 3000.0;
        let (blocks, report) = bc6h::pack(width, height, &values);
        assert_eq!(blocks.len(), 16 * width.div_ceil(4) * height.div_ceil(4));
        let back = bc6h::unpack(width, height, &blocks);
        let worst = back.iter().zip(&values).map(|(&b, v)| (f64::from(b) - v).abs()).fold(0.0, f64::max);
        assert_eq!(report.max_abs_error, worst, "{width} × {height}");
        assert!(report.max_block_error <= 0.1, "{width} × {height}: {report:?}");
    }
    let flat = vec![0.75; 48];
    let (_, report) = bc6h::pack(4, 4, &flat);
    assert!(report.max_block_error < 1e-2, "one colour is off by {report:?}");
    let (blocks, report) = bc6h::pack(4, 4, &[[-1.0, 1e9, f64::NAN]; 16].concat());
    assert_eq!((report.negative, report.overflowed, report.nonfinite), (16, 16, 16));
    assert!(bc6h::unpack(4, 4, &blocks).chunks_exact(3).all(|t| t[0] < 1.0 && t[1] > 6e4 && t[2] < 1.0));
}

/// Prints shape, type and values in hexadecimal.
const READ_NPY: &str = r#"
import numpy, sys
a = numpy.load(sys.argv[1])
print(a.dtype.str, *a.shape)
print(*[float(v).hex() for v in a.astype("float64").ravel()])
"#;

#[test]
fn npy_is_what_numpy_reads() {
    let folder = tempfile::tempdir().unwrap();
    for (number, dtype) in [(Number::F16, "<f2"), (Number::F32, "<f4")] {
        let format = TexelFormat::Plain { channels: 2, number };
        let (texture, _) = Texture::volume(format, [3, 4, 5], &values(format, 60)).unwrap();
        let spec = FormatSpec::new(Container::Npy, format).unwrap();
        let path = file(&folder, "a.npy", &format::encode(spec, &texture).unwrap());
        let Some(printed) = tools::python(READ_NPY, &path) else { return };
        let (head, numbers) = printed.trim().split_once('\n').unwrap();
        assert_eq!(head, format!("{dtype} 5 4 3 2"));
        let wanted: Vec<f32> = texture.values(0);
        assert_eq!(numbers.split(' ').map(parse_hex).collect::<Vec<f32>>(), wanted);
    }
}

/// A number as Python's `float.hex` prints it: `0x1.8000000000000p+3`.
fn parse_hex(text: &str) -> f32 {
    let (mantissa, exponent) = text.strip_prefix("0x").unwrap().split_once('p').unwrap();
    let (whole, fraction) = mantissa.split_once('.').unwrap();
    let digits = u64::from_str_radix(&format!("{whole}{fraction}"), 16).unwrap() as f64;
    (digits * 2_f64.powi(exponent.parse::<i32>().unwrap() - 4 * fraction.len() as i32)) as f32
}

/// Prints size, channels and values in hexadecimal, as floats: integers divided by their largest.
const READ_OIIO: &str = r#"
import OpenImageIO as oiio, sys
inp = oiio.ImageInput.open(sys.argv[1])
assert inp, oiio.geterror()
spec = inp.spec()
print(spec.format, spec.width, spec.height, *spec.channelnames)
print(*[float(v).hex() for v in inp.read_image("float").ravel()])
"#;

/// OpenImageIO as a second reader of pictures.
#[test]
fn pictures_are_what_openimageio_reads() {
    let folder = tempfile::tempdir().unwrap();
    if tools::folder_with("python/OpenImageIO").is_none() {
        return;
    }
    for (name, stored) in [
        ("exr:f16", "half 6 5 R G B"),
        ("exr:f32", "float 6 5 R G B"),
        ("hdr", "float 6 5 R G B"),
        ("png:rgb8unorm", "uint8 6 5 R G B"),
        ("png:rgb16unorm", "uint16 6 5 R G B"),
    ] {
        let spec: FormatSpec = name.parse().unwrap();
        let texture = texture("flat", spec.texel(3).unwrap());
        let bytes = format::encode(spec, &texture).unwrap();
        let path = file(&folder, &format!("a.{}", spec.extension()), &bytes);
        let Some(printed) = tools::python(READ_OIIO, &path) else { return };
        let (head, numbers) = printed.trim().split_once('\n').unwrap();
        assert_eq!(head, stored, "{name}");
        for (got, wanted) in numbers.split(' ').map(parse_hex).zip(texture.values(0)) {
            // It divides integers in f32: one rounding more.
            let slack = if texture.format.is_signed() || name == "hdr" { 0.0 } else { f32::EPSILON * wanted };
            assert!((got - wanted).abs() <= slack, "{name}: {got} and {wanted}");
        }
    }
}

/// A table of closed forms, which takes no time, with as many channels as its format holds, 3 at most.
fn table(format: &str) -> TableRecipe {
    let format: FormatSpec = format.parse().unwrap();
    let mut recipe = TableRecipe::named("fresnel-dielectric", format).unwrap();
    recipe.axes.iter_mut().for_each(|axis| axis.size = 8);
    let n = (1..=3).rev().find(|&n| format.texel(n).is_ok()).unwrap();
    recipe.channels.truncate(n);
    recipe
}

/// Whatever format a table is baked in, its file is verified from its bytes and its certificate alone, converted and compared without loss, and a
/// changed texel is found.
#[test]
fn tables_of_every_container_are_verified_and_converted_and_a_changed_texel_is_found() {
    let folder = tempfile::tempdir().unwrap();
    for format in [
        "exr:f16",
        "ktx2:rg16unorm",
        "ktx2:rgb9e5",
        "ktx2:b10g11r11",
        "ktx2:bc6h",
        "ktx2:uastc-hdr",
        "ktx2:rgbd",
        "ktx2:rg16f+zstd",
        "ktx1:rg8unorm",
        "dds:rg16f",
        "dds:rg32f+legacy",
        "hdr",
        "png:rgb16unorm",
        "png:rgbm",
        "png:rgbp",
        "npy:f32",
        "raw:rg16f",
        "c:f32",
        "rust:f16",
        "glsl:f32",
        "hlsl:f32",
        "wgsl:f32",
        "js:f32",
    ] {
        let recipe = table(format);
        let baked = bake::table(&recipe, &|_| {}).unwrap_or_else(|e| panic!("{format}: {e}"));
        let certificate = &baked.certificate;
        assert!(certificate.packing.max_abs_error > 0.0, "{format}");
        let per_channel = recipe.texel_format().unwrap().is_per_channel();
        let total = 64 * recipe.channels.len() as u64;
        assert_eq!(certificate.rounding.map(|r| r.certified + r.undecided), per_channel.then_some(total), "{format}");
        baked.write(folder.path()).unwrap();
        let path = folder.path().join(&recipe.file);
        let report = verify::file(&path, Options::default()).unwrap_or_else(|e| panic!("{format}: {e}"));
        assert_eq!(report.failures(), 0, "{format}: {:?}", report.checks);
        assert!(report.checks.len() > 3 && report.skipped.is_empty(), "{format}");
        let decoded = certificate::read(&path).unwrap_or_else(|e| panic!("{format}: {e}"));
        let (bytes, report) = convert(decoded, &conversion("exr:f32")).unwrap_or_else(|e| panic!("{format}: {e}"));
        assert_eq!(report.max_error, 0.0, "{format}");
        let [a, b] = [path.clone(), file(&folder, "converted.exr", &bytes)]
            .map(|path| levels(&path, &Described::default()).unwrap_or_else(|e| panic!("{format}: {e}")));
        let differences = compare(&a, &b, Tolerance::Absolute(0.0)).unwrap_or_else(|e| panic!("{format}: {e}"));
        assert!(differences.iter().all(|d| d.different == 0 && d.values == 64), "{format}: {differences:?}");
        spoil(&path, format);
        let found = verify::file(&path, Options::default()).map(|report| report.failures());
        assert!(!matches!(found, Ok(0)), "{format}: a changed texel is not found");
    }
}

/// Changes something in the texels: the last byte of a container that ends with them, a digit of source code.
fn spoil(path: &Path, format: &str) {
    let mut bytes = std::fs::read(path).unwrap();
    let is_text = ["c:", "rust:", "glsl:", "hlsl:", "wgsl:", "js:"].iter().any(|name| format.starts_with(name));
    let at = if is_text {
        let values = String::from_utf8(bytes.clone()).unwrap().find("// values").unwrap();
        values + bytes[values..].iter().position(u8::is_ascii_digit).unwrap() + 2
    } else {
        // The most significant byte of the last texel's last used channel is somewhere in the last few.
        bytes.len() - if format.starts_with("png") { 30 } else { 3 }
    };
    bytes[at] = if is_text { b'0' + (bytes[at] - b'0' + 3) % 10 } else { bytes[at] ^ 0x15 };
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn bare_texels_are_what_the_certificate_beside_them_says_and_else_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = table("raw:rgb9e5");
    let baked = bake::table(&recipe, &|_| {}).unwrap();
    baked.write(folder.path()).unwrap();
    let path = folder.path().join(&recipe.file);
    let Decoded::Texture(texture) = certificate::read(&path).unwrap() else { panic!("no texture") };
    assert_eq!((texture.format.to_string().as_str(), texture.width, texture.height), ("rgb9e5", 8, 8));
    assert!(format::read(&path).is_err(), "they say nothing of themselves");
    let bytes = std::fs::read(&path).unwrap();
    let cut = file(&folder, "cut.raw", &bytes[..bytes.len() - 1]);
    assert!(certificate::read(&cut).unwrap_err().to_string().contains("cut.raw: a file of an unknown kind"));
    std::fs::copy(certificate::beside(&path), certificate::beside(&cut)).unwrap();
    let message = certificate::read(&cut).unwrap_err().to_string();
    assert!(message.contains("cut.raw: 255 bytes, which a texture of 8 × 8 texels of rgb9e5"), "{message}");
}

/// The light of texels beyond the largest is gone, of levels too, and is counted; that is no fault of the bake.
#[test]
fn maps_too_bright_for_their_format_are_baked_and_verified() {
    let folder = tempfile::tempdir().unwrap();
    // Grey, and a texel so bright that no level holds it.
    let mut values = vec![0.5; 3 * 32 * 16];
    values[3 * (32 * 5 + 9)..][..3].fill(1e9);
    let (panorama, _) = Texture::flat(TexelFormat::Rgbe, 32, 16, &values).unwrap();
    let input = file(&folder, "bright.hdr", &hdr::encode(&panorama).unwrap());
    for format in ["ktx2:rgba16f", "ktx2:rgb8unorm", "ktx2:uastc-hdr"] {
        let (baked, texture) = baked_and_verified(&folder, &input, format);
        for level in [0, 1] {
            // (Seven bits of a logarithm, in uastc-hdr, end at 55296.)
            let ends =
                texture.values(level).iter().filter(|&&v| f64::from(v) > 0.8 * texture.format.largest(0)).count();
            assert!(ends > 0, "{format}: level {level} is not clamped");
        }
        assert!(baked.certificate.packing.overflowed > 1, "{format}");
    }
}

/// Levels of 32² and 16² of a panorama, without irradiance, none of whose checks fails.
fn baked_and_verified(folder: &tempfile::TempDir, input: &Path, format: &str) -> (bake::Baked, Texture) {
    let mut recipe = EnvironmentRecipe::new(input.to_str().unwrap());
    (recipe.size, recipe.min_size, recipe.irradiance) = (32, 16, IrradianceKind::None);
    recipe.format = format.parse().unwrap();
    let source = bake::source(&recipe).unwrap();
    let baked = bake::environment(&recipe, &source, &|_| {}).unwrap_or_else(|e| panic!("{format}: {e}"));
    let Ok(Decoded::Texture(texture)) = format::decode(&baked.files[0].1) else { panic!("{format}: no texture") };
    baked.write(folder.path()).unwrap();
    let report = verify::file(&folder.path().join(recipe.specular_name()), Options::default()).unwrap();
    assert_eq!(report.failures(), 0, "{format}: {:?}", report.checks);
    (baked, texture)
}

/// What packing loses of a map that it does not suit is no fault of the bake either.
#[test]
fn maps_that_hardly_fit_their_format_are_baked_and_verified() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(4);
    let mut four_lamps = vec![0.0; 3 * 8 * 4];
    [0, 10, 49, 67].into_iter().for_each(|i| four_lamps[i] = 6e4);
    let mut map = |texel: fn(&mut Random) -> [f64; 3]| (0..8 * 4).flat_map(|_| texel(&mut random)).collect::<Vec<_>>();
    let maps = [
        // Darker than half a step of what is stored, and some steps that are no whole part of the value.
        ("ktx2:rgb8unorm", map(|random| [1e-6 * random.unit(); 3])),
        ("ktx2:rgba16f", map(|random| [1e-7 * (1.0 + 0.01 * random.unit()); 3])),
        // Lights beside black in blocks, and of a colour that the map has nowhere.
        ("ktx2:bc6h", map(|random| if random.below(8) == 0 { [6e4, 5e4, 4e4] } else { [0.0; 3] })),
        // Some beyond the largest, some not.
        ("ktx2:bc6h", map(|random| std::array::from_fn(|_| 1e5 * random.unit()))),
        ("ktx2:uastc-hdr", map(|random| [[6e4, 0.0, 0.0], [0.0, 6e4, 0.0], [0.0; 3]][random.below(3)])),
        ("ktx2:uastc-hdr", four_lamps),
    ];
    for (format, values) in maps {
        let (panorama, _) = Texture::flat("rgb32f".parse().unwrap(), 8, 4, &values).unwrap();
        let input = file(&folder, "map.exr", &format::encode("exr:f32".parse().unwrap(), &panorama).unwrap());
        baked_and_verified(&folder, &input, format);
    }
}

#[test]
fn a_table_of_more_channels_than_its_format_has_is_refused() {
    let recipe = TableRecipe { format: "ktx2:r16f".parse().unwrap(), ..table("ktx2:rg16f") };
    assert!(bake::table(&recipe, &|_| {}).unwrap_err().to_string().contains("holds 1 channels, and 2 were asked for"));
}

#[test]
fn environments_of_every_container_are_verified() {
    let folder = tempfile::tempdir().unwrap();
    for (format, min_size) in [
        ("ktx2:rgb9e5+zstd", 4),
        ("ktx2:bc6h", 4),
        ("ktx2:uastc-hdr", 4),
        ("ktx1:b10g11r11", 4),
        ("dds:bc6h", 4),
        ("dds:rgba16f+legacy", 4),
        ("env", 1),
    ] {
        let mut recipe = EnvironmentRecipe::new("builtin:sky");
        (recipe.size, recipe.min_size, recipe.irradiance_size) = (8, min_size, 4);
        recipe.format = format.parse().unwrap();
        recipe.directory = format.replace([':', '+'], "-");
        let source = bake::source(&recipe).unwrap();
        let baked = bake::environment(&recipe, &source, &|_| {}).unwrap_or_else(|e| panic!("{format}: {e}"));
        for path in baked.write(folder.path()).unwrap() {
            if path.ends_with("certificate.json") {
                continue;
            }
            let report = verify::file(&path, Options::default()).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            assert_eq!(report.failures(), 0, "{}: {:?}", path.display(), report.checks);
        }
    }
    let read = |name: &str| match format::read(&folder.path().join(name)).unwrap() {
        Decoded::Texture(texture) => texture,
        other => panic!("{name}: {other:?}"),
    };
    assert_eq!(read("ktx1-b10g11r11/specular.ktx").metadata("sh").unwrap().lines().count(), 9);
    assert_eq!(read("env/specular.env").levels.len(), 4);
}

/// The white furnace of a `.env` is xx = yy = zz = 1 and nothing else; that of Filament's nine lines 1 and nothing else.
#[test]
fn the_irradiance_of_a_white_furnace_is_one_in_every_convention() {
    let baked = |format: &str, min_size: usize| {
        let mut recipe = EnvironmentRecipe::new("builtin:white");
        (recipe.size, recipe.min_size, recipe.irradiance_size) = (4, min_size, 4);
        recipe.format = format.parse().unwrap();
        let source = bake::source(&recipe).unwrap();
        let (_, bytes) = bake::environment(&recipe, &source, &|_| {}).unwrap().files.remove(0);
        match format::decode(&bytes).unwrap() {
            Decoded::Texture(texture) => texture,
            other => panic!("{format}: {other:?}"),
        }
    };
    let env = baked("env", 1);
    let terms: serde_json::Value = serde_json::from_str(env.metadata("sphericalPolynomial").unwrap()).unwrap();
    for (name, wanted) in [
        ("x", 0.0),
        ("y", 0.0),
        ("z", 0.0),
        ("xx", 1.0),
        ("yy", 1.0),
        ("zz", 1.0),
        ("yz", 0.0),
        ("zx", 0.0),
        ("xy", 0.0),
    ] {
        let got = terms[name][1].as_f64().unwrap();
        assert!((got - wanted).abs() < 1e-12, "{name}: {got}");
    }
    assert!(env.values(0).iter().all(|&v| v == 1.0), "white is white in RGBD");
    let ktx1 = baked("ktx1:b10g11r11", 4);
    let numbers: Vec<f64> = ktx1.metadata("sh").unwrap().split_whitespace().map(|n| n.parse().unwrap()).collect();
    assert_eq!(numbers.len(), 27);
    assert!(numbers[..3].iter().all(|v| (v - 1.0).abs() < 1e-7) && numbers[3..].iter().all(|v| v.abs() < 1e-7));
}

fn conversion(format: &str) -> Conversion {
    let format = format.parse().unwrap();
    let (layer, level, channels, name) = (None, None, None, None);
    Conversion { format, from: None, shape: Shape::Keep, layer, level, channels, clamp: false, name }
}

fn converted(bytes: &[u8], conversion: &Conversion) -> kiln::Result<(Vec<u8>, kiln::convert::Report)> {
    convert(format::decode(bytes)?, conversion)
}

#[test]
fn conversions_that_need_no_rounding_change_nothing() {
    let cube = texture("cube", "rgba16f".parse().unwrap());
    let mut bytes = ktx2::encode(&cube).unwrap();
    for name in ["dds:rgba16f", "ktx1:rgba16f", "ktx2:rgba32f+zstd", "dds:rgba32f+legacy", "ktx2:rgba16f"] {
        let (next, report) = converted(&bytes, &conversion(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((report.max_error, report.rms_error), (0.0, 0.0), "{name}");
        bytes = next;
    }
    let Decoded::Texture(back) = format::decode(&bytes).unwrap() else { panic!("a texture") };
    assert_same_texels("round trip", &cube, &back);
    let flat = texture("flat", "rgb32f".parse().unwrap());
    let mut bytes = format::encode("npy:f32".parse().unwrap(), &flat).unwrap();
    for name in ["c:f32", "wgsl:f32", "exr:f32", "rust:f32", "js:f32", "glsl:f32", "hlsl:f32", "ktx2:rgb32f", "npy:f32"]
    {
        let (next, report) = converted(&bytes, &conversion(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(report.max_error, 0.0, "{name}");
        bytes = next;
    }
    assert_eq!(bytes, format::encode("npy:f32".parse().unwrap(), &flat).unwrap());
}

/// Slices of a volume are layers of channels in an OpenEXR and an axis of an array, and come back from either; a row of several channels is
/// no other than a picture.
#[test]
fn volumes_and_rows_go_through_every_container_that_has_a_form_for_them() {
    let values: Vec<f32> = (0..3 * 2 * 12 * 2).map(|i| i as f32).collect();
    let volume = Texture::volume("rg32f".parse().unwrap(), [3, 2, 12], &values).unwrap().0;
    let alone = Texture::volume("r32f".parse().unwrap(), [3, 2, 12], &values[..72]).unwrap().0;
    let row = Texture::flat("rgb32f".parse().unwrap(), 8, 1, &values[..24]).unwrap().0;
    let all =
        ["npy:f32", "exr:f32", "c:f32", "exr:f32", "rust:f32", "glsl:f32", "hlsl:f32", "wgsl:f32", "js:f32", "exr:f32"];
    let of_volumes = ["dds:rg32f", "exr:f32", "ktx1:rg32f", "exr:f32", "ktx2:rg32f+zstd"];
    let of_one_channel = ["dds:r32f", "exr:f32", "ktx1:r32f", "exr:f32", "ktx2:r32f+zstd"];
    let of_rows = ["dds:rgb32f", "exr:f32", "ktx1:rgb32f", "ktx2:rgb32f"];
    for (start, ends) in [(&volume, &of_volumes[..]), (&alone, &of_one_channel[..]), (&row, &of_rows[..])] {
        let mut bytes = ktx2::encode(start).unwrap();
        for name in all.iter().chain(ends) {
            let (next, report) = converted(&bytes, &conversion(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(report.max_error, 0.0, "{name}");
            bytes = next;
        }
        let Decoded::Texture(back) = format::decode(&bytes).unwrap() else { panic!("a texture") };
        assert_same_texels("round trip", start, &back);
    }
}

/// At the horizon and of a mirror albedos are 1, and known to be a little more or less.
#[test]
fn what_is_beyond_a_format_by_its_own_error_only_is_at_its_end() {
    let mut recipe = TableRecipe::named("ggx-albedo", "png:r8unorm".parse().unwrap()).unwrap();
    recipe.axes = ["mu:6:sqrt:edge", "roughness:5:flip"].map(|axis| axis.parse().unwrap()).into();
    let baked = bake::table(&recipe, &|_| ()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(baked.certificate.packing.overflowed, 0);
    // More than that is still refused.
    recipe.channels = vec!["ggx.albedo:*1.00001".to_owned()];
    assert!(bake::table(&recipe, &|_| ()).unwrap_err().to_string().contains("values above 1"));
}

/// A table in source code or NumPy's array of two channels was taken for one of one.
#[test]
fn an_array_becomes_a_texture_of_as_many_channels() {
    for (shape, wanted) in [(vec![3, 4], "ktx2:r16f"), (vec![3, 4, 2], "ktx2:rg16f"), (vec![2, 3, 4, 3], "ktx2:rgb16f")]
    {
        let values = vec![0.5; shape.iter().product()];
        let array = format::Array { shape, values, number: Some(Number::F16), channels: vec![], metadata: vec![] };
        assert_eq!(usual_format(Container::Ktx2, &Decoded::Array(array)).unwrap().to_string(), wanted);
    }
}

/// Packed again, blocks and codes of a factor come out otherwise.
#[test]
fn what_stays_packed_as_it_is_is_copied_from_container_to_container() {
    use TexelFormat::{Bc6h, Rgbd, Rgbm, UastcHdr};
    for (format, ways) in [
        (Bc6h, &["dds:bc6h", "ktx1:bc6h", "ktx2:bc6h+zstd"][..]),
        (UastcHdr, &["ktx2:uastc-hdr+zstd"]),
        (Rgbd, &["ktx1:rgbd", "ktx2:rgbd"]),
        (Rgbm, &["ktx1:rgbm", "ktx2:rgbm"]),
    ] {
        let start = texture("cube", format);
        let mut bytes = ktx2::encode(&start).unwrap();
        for name in ways {
            let (next, report) = converted(&bytes, &conversion(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(report.max_error, 0.0, "{name}");
            bytes = next;
        }
        let Decoded::Texture(back) = format::decode(&bytes).unwrap() else { panic!("a texture") };
        assert_eq!(back.levels, start.levels, "{format}");
        // So is a level by itself; another packing is none.
        let second = |format: &str| Conversion { level: Some(1), ..conversion(format) };
        let decoded = |bytes: (Vec<u8>, _)| match format::decode(&bytes.0).unwrap() {
            Decoded::Texture(texture) => texture.levels,
            _ => panic!("a texture"),
        };
        let alone = decoded(converted(&bytes, &second(ways[0])).unwrap());
        assert_eq!(alone, start.levels[1..2], "{format}");
        let (_, floats) = converted(&bytes, &second("ktx2:rgb32f")).unwrap();
        assert_eq!((floats.max_error, floats.format.as_str()), (0.0, "rgb32f"));
    }
}

/// Several cubes in one texture go round by all containers that have such, and each comes out of it alone.
#[test]
fn arrays_of_cubes_go_round_and_a_layer_comes_out_alone() {
    let cubes = [1.0, 2.0].map(|factor: f32| {
        let one = texture("cube", "rgba16f".parse().unwrap());
        let mut cube = Texture { levels: vec![], ..one.clone() };
        for level in 0..one.levels.len() {
            let values: Vec<f32> = one.values(level).iter().map(|v| v * factor).collect();
            cube.push_level(&values).unwrap();
        }
        cube
    });
    let levels = cubes[0].levels.iter().zip(&cubes[1].levels).map(|(a, b)| [&a[..], b].concat()).collect();
    let array = Texture { array_layers: 2, levels, ..cubes[0].clone() };
    let mut bytes = ktx2::encode(&array).unwrap();
    for name in ["dds:rgba16f", "ktx1:rgba16f", "ktx2:rgba16f+zstd", "ktx2:rgba16f"] {
        let (next, report) = converted(&bytes, &conversion(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(report.max_error, 0.0, "{name}");
        bytes = next;
    }
    let Decoded::Texture(back) = format::decode(&bytes).unwrap() else { panic!("a texture") };
    assert_eq!((back.array_layers, &back.levels), (2, &array.levels));
    let alone = |layer| converted(&bytes, &Conversion { layer: Some(layer), ..conversion("dds:rgba16f") });
    for (layer, cube) in cubes.iter().enumerate() {
        let Decoded::Texture(one) = format::decode(&alone(layer).unwrap().0).unwrap() else { panic!("a texture") };
        assert_eq!((one.array_layers, one.faces, &one.levels), (0, 6, &cube.levels), "layer {layer}");
    }
    let beyond = alone(2).unwrap_err().to_string();
    assert!(beyond.contains("layer 2 of a cube of") && beyond.contains("--layer 0 to 1"), "{beyond}");
}

/// A container without three channels of those numbers has four of them: nothing is rounded.
#[test]
fn the_usual_format_has_the_same_numbers_where_the_container_has_them() {
    for (from, to, wanted) in [
        ("rgb16unorm", Container::Dds, "dds:rgba16unorm"),
        ("rgb8unorm", Container::Dds, "dds:rgba8unorm"),
        ("rgb16f", Container::Dds, "dds:rgba16f"),
        ("rg16unorm", Container::Png, "png:rgb16unorm"),
        ("rgb16unorm", Container::Ktx1, "ktx1:rgb16unorm"),
    ] {
        let decoded = Decoded::Texture(texture("flat", from.parse().unwrap()));
        assert_eq!(usual_format(to, &decoded).unwrap().to_string(), wanted, "{from}");
    }
}

/// Bare texels are read again by the layout beside them, of whichever packing.
#[test]
fn converted_bare_texels_are_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let flat = texture("flat", "rgb32f".parse().unwrap());
    file(&folder, "flat.ktx2", &ktx2::encode(&flat).unwrap());
    for format in ["rgba16f", "rgb9e5", "bc6h", "rgbm"] {
        let (name, format) = (format!("{format}.raw"), format!("raw:{format}"));
        succeed(folder.path(), &["convert", "flat.ktx2", &name, "--format", &format, "--clamp"]);
        let said = succeed(folder.path(), &["info", &name]).stdout;
        assert!(said.contains(&format!("{} × {}", flat.width, flat.height)), "{said}");
        succeed(folder.path(), &["convert", &name, "back.exr"]);
        succeed(folder.path(), &["compare", &name, "back.exr", "--tolerance", "0"]);
    }
}

/// A texel that is filled up compares as what it was filled up from.
#[test]
fn channels_that_only_fill_up_a_texel_are_not_compared() {
    let grids = |format: &str, values: &[f32]| {
        let texture = Texture::flat(format.parse().unwrap(), 2, 1, values).unwrap().0;
        kiln::format::grid::levels_of(&texture, "KTX2", &Described::default()).unwrap()
    };
    let two = grids("rg32f", &[1.0, 2.0, 3.0, 4.0]);
    let same = |other: &[kiln::format::Grid]| {
        compare(&two, other, Tolerance::Absolute(0.0)).map(|d| d.iter().all(|d| d.beyond == 0))
    };
    assert!(same(&grids("rgb32f", &[1.0, 2.0, 0.0, 3.0, 4.0, 0.0])).unwrap());
    assert!(same(&grids("rgba32f", &[1.0, 2.0, 0.0, 1.0, 3.0, 4.0, 0.0, 1.0])).unwrap());
    assert!(same(&grids("rgb32f", &[1.0, 2.0, 0.5, 3.0, 4.0, 0.0])).is_err());
}

#[test]
fn conversions_report_what_they_cost() {
    let values = [0.1, 0.2, 70_000.0, -1.0, 0.5, 0.25];
    let (flat, _) = Texture::flat("rgb32f".parse().unwrap(), 2, 1, &values).unwrap();
    let bytes = ktx2::encode(&flat).unwrap();
    let message = converted(&bytes, &conversion("ktx2:rgb9e5")).unwrap_err().to_string();
    assert!(message.contains("no room for 1 values beyond 65408, 1 below zero and 0"), "{message}");
    assert!(message.contains("with --clamp"), "{message}");
    let (_, report) = converted(&bytes, &Conversion { clamp: true, ..conversion("ktx2:rgb9e5") }).unwrap();
    assert_eq!((report.packing.overflowed, report.packing.negative, report.max_error), (1, 1, 4592.0));
    let (_, report) = converted(&bytes, &Conversion { clamp: true, ..conversion("ktx2:rgb16f") }).unwrap();
    let halves = [0.1_f32, 0.2].map(|v| (half::f16::from_f32(v).to_f64() - f64::from(v)).abs());
    assert_eq!(report.packing.max_abs_error, halves[0].max(halves[1]));
}

#[test]
fn conversions_refuse_what_would_be_lost_in_silence() {
    let cube = ktx2::encode(&texture("cube", "rgba16f".parse().unwrap())).unwrap();
    let message = converted(&cube, &conversion("hdr")).unwrap_err().to_string();
    assert!(
        message.contains("hdr holds 3 channels, and there are 4: R, G, B, A; choose another format, or drop"),
        "{message}"
    );
    let rgb = Conversion { channels: Some(3), ..conversion("hdr") };
    assert!(converted(&cube, &rgb).unwrap_err().to_string().contains("which holds one picture"));
    let (flat, _) =
        Texture::flat("rgba32f".parse().unwrap(), 2, 1, &[0.5, 0.5, 0.5, 1.0, 0.25, 1.0, 2.0, 1.0]).unwrap();
    let (file, report) = converted(&ktx2::encode(&flat).unwrap(), &conversion("hdr")).unwrap();
    assert!(report.notes.iter().any(|note| note.contains("alpha, which is 1 everywhere")));
    assert_eq!(hdr::decode(&file).unwrap().texels, [0.5, 0.5, 0.5, 0.25, 1.0, 2.0]);
}

/// Channels of an OpenEXR are sorted by name; in a texture they are red, green, blue, or those of the table in its order.
#[test]
fn channels_of_an_openexr_come_in_the_order_that_was_meant() {
    let image = kiln::format::Image::new(1, 1, &["B", "A", "G", "R"], vec![3.0_f64, 1.0, 2.0, 1.5]).unwrap();
    let (exr, _) = format::exr::encode(&image, Number::F32).unwrap();
    let (ktx2, _) = converted(&exr, &conversion("ktx2:rgba32f")).unwrap();
    assert_eq!(ktx2::decode(&ktx2).unwrap().values(0), [1.5, 2.0, 3.0, 1.0]);
    // Of two as well, which is what a texture of one quantity and a channel to spare becomes.
    let image = kiln::format::Image::new(1, 1, &["G", "R"], vec![2.0_f64, 1.5]).unwrap();
    let (exr, _) = format::exr::encode(&image, Number::F32).unwrap();
    let (ktx2, _) = converted(&exr, &conversion("ktx2:rg32f")).unwrap();
    assert_eq!(ktx2::decode(&ktx2).unwrap().values(0), [1.5, 2.0]);
    // Names that a certificate brought there stand in their order when it is gone: of three layers of slices, too.
    for (name, size) in [("dfg", "4x4"), ("dielectric", "4x4x4")] {
        let mut recipe = TableRecipe::named(name, "ktx2:rg32f".parse().unwrap()).unwrap();
        recipe.axes.iter_mut().for_each(|axis| axis.size = 4);
        let table = bake::table(&recipe, &|_| {}).unwrap().files.remove(0).1;
        let (exr, _) = converted(&table, &conversion("exr:f32")).unwrap();
        let (back, _) = converted(&exr, &conversion("ktx2:rg32f")).unwrap();
        assert_eq!(ktx2::decode(&back).unwrap().levels, ktx2::decode(&table).unwrap().levels, "{name} {size}");
    }
    // The scale comes first in the table, the bias in the OpenEXR.
    let dfg = |format: &str| {
        let mut recipe = TableRecipe::named("dfg", format.parse().unwrap()).unwrap();
        recipe.axes.iter_mut().for_each(|axis| axis.size = 4);
        bake::table(&recipe, &|_| {}).unwrap().files.remove(0).1
    };
    let (ktx2, _) = converted(&dfg("exr:f32"), &conversion("ktx2:rg32f")).unwrap();
    let direct = dfg("ktx2:rg32f");
    assert_eq!(ktx2::decode(&ktx2).unwrap().levels, ktx2::decode(&direct).unwrap().levels);
}

#[test]
fn a_panorama_becomes_a_cube_and_a_panorama_of_the_same_flux() {
    let mut random = Random(34);
    let values: Vec<f64> = (0..32 * 16 * 3).map(|_| random.unit().powi(4) * 50.0).collect();
    let (panorama, _) = Texture::flat("rgb32f".parse().unwrap(), 32, 16, &values).unwrap();
    let bytes = ktx2::encode(&panorama).unwrap();
    let (cube, report) =
        converted(&bytes, &Conversion { shape: Shape::Map(SphereLayout::Cube, 0), ..conversion("dds:rgb32f") })
            .unwrap();
    let Decoded::Texture(texture) = format::decode(&cube).unwrap() else { panic!("a texture") };
    assert_eq!((texture.faces, texture.width), (6, 8));
    // Sums of f32 texels: exact to a few of their roundings.
    assert!(report.flux_change.unwrap() < 1e-6, "{report:?}");
    let (back, report) =
        converted(&cube, &Conversion { shape: Shape::Map(SphereLayout::Equirect, 0), ..conversion("hdr") }).unwrap();
    assert!(report.flux_change.unwrap() < 1e-6, "{report:?}");
    assert_eq!(hdr::decode(&back).unwrap().width, 32);
    let message = converted(&bytes, &Conversion { shape: Shape::Map(SphereLayout::Equirect, 0), ..conversion("hdr") })
        .unwrap_err()
        .to_string();
    assert!(message.contains("a panorama that is to become a panorama; leave --shape out"), "{message}");
}

#[test]
fn panoramas_cubes_and_octahedral_maps_become_each_other_with_their_flux() {
    let mut random = Random(35);
    // Smooth against the texels, but for a sun: what resampling blurs is then known to be little.
    let values: Vec<f64> = (0..64 * 32)
        .flat_map(|i| {
            let d = SphereLayout::Equirect.direction(32, i);
            let sky = 2.0 + d.y + 0.5 * d.x * d.z + 1e-3 * random.unit();
            [sky, 0.5 * sky, if i == 700 { 2.0 * sky } else { sky }]
        })
        .collect();
    let (panorama, _) = Texture::flat("rgb32f".parse().unwrap(), 64, 32, &values).unwrap();
    let mut bytes = ktx2::encode(&panorama).unwrap();
    let (mut from, mut before) = (SphereLayout::Equirect, [0.0; 3]);
    let shapes = [
        (SphereLayout::Octahedral, [32, 32], 1),
        (SphereLayout::Cube, [32, 32], 6),
        (SphereLayout::Octahedral, [64, 64], 1),
        (SphereLayout::Equirect, [256, 128], 1),
    ];
    for (i, (to, size, faces)) in shapes.into_iter().enumerate() {
        let step = Conversion { from: Some(from), shape: Shape::Map(to, 0), ..conversion("ktx2:rgb32f") };
        let (next, report) = converted(&bytes, &step).unwrap();
        let texture = ktx2::decode(&next).unwrap();
        assert_eq!(([texture.width, texture.height], texture.faces), (size, faces), "{from} → {to}");
        let map = SphereMap {
            layout: to,
            size: size[1],
            texels: texture.values(0).chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        };
        let mean = map.mean();
        for c in 0..3 {
            // Every step rounds each texel to f32 once, or twice through a panorama.
            assert!(i == 0 || (mean[c] / before[c] - 1.0).abs() < 2e-7, "{from} → {to}: {mean:?}, {before:?}");
        }
        assert!(report.flux_change.unwrap() < 2e-7, "{report:?}");
        // Twice as bright in one texel of 2048, averaged with its neighbours, is most of what changes.
        let rms = report.resampling_rms.unwrap();
        assert!((1e-4..0.03).contains(&rms), "{from} → {to}: {rms}");
        (bytes, from, before) = (next, to, mean);
    }
    let wrong = Conversion {
        from: Some(SphereLayout::Cube),
        shape: Shape::Map(SphereLayout::Octahedral, 8),
        ..conversion("hdr")
    };
    let message = converted(&bytes, &wrong).unwrap_err().to_string();
    assert!(message.contains("256 × 128 texels, which is not a cube; correct --from"), "{message}");
    let wrong = Conversion {
        from: Some(SphereLayout::Octahedral),
        shape: Shape::Map(SphereLayout::Cube, 8),
        ..conversion("ktx2:rgb32f")
    };
    let message = converted(&bytes, &wrong).unwrap_err().to_string();
    assert!(message.contains("an octahedral map of 256 × 128, which is no square"), "{message}");
}

/// Parts, levels and values as OpenEXR's own reader and OpenImageIO see them.
const READ_PARTS: &str = r#"
import OpenImageIO as oiio, OpenEXR, sys
with OpenEXR.File(sys.argv[1]) as f:
    print("parts", *[(p.header.get("name") or "-") for p in f.parts])
    for p in f.parts:
        print("part", *[float(v).hex() for v in p.channels["R"].pixels.ravel()] if "R" in p.channels else
              [float(v).hex() for v in list(p.channels.values())[0].pixels[..., 0].ravel()])
inp = oiio.ImageInput.open(sys.argv[1])
assert inp, oiio.geterror()
part = 0
while inp.seek_subimage(part, 0):
    level = 0
    while inp.seek_subimage(part, level):
        spec = inp.spec()
        names = list(spec.channelnames)
        pixels = inp.read_image(part, level, 0, spec.nchannels, "float")
        print("level", part, level, spec.width, spec.height, *[float(v).hex() for v in pixels[..., names.index("R")].ravel()])
        level += 1
    part += 1
"#;

/// Mips and cubes in OpenEXR: other people's readers find every part and every level, and Kiln reads back what it wrote, bit for bit.
#[test]
fn mips_and_cubes_are_what_openexr_and_openimageio_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(36);
    for (format, size, faces, n_levels) in [
        ("rgb16f", [200, 100], 1, 4),
        ("rgba32f", [64, 64], 6, 7),
        ("rgb16f", [96, 96], 6, 2),
        ("rgb32f", [70, 70], 6, 1),
        ("rgb32f", [130, 3], 1, 2),
    ] {
        let format: TexelFormat = format.parse().unwrap();
        let mut texture = Texture { faces, ..Texture::empty(format, size[0], size[1]) };
        for level in 0..n_levels {
            let [w, h] = texture.level_size(level);
            let values: Vec<f64> = (0..faces * w * h * format.channels()).map(|_| random.unit() * 1e3).collect();
            texture.push_level(&values).unwrap();
        }
        texture.metadata = vec![("Kiln.note".to_owned(), "of the first part".to_owned())];
        let spec = FormatSpec::new(Container::Exr, format).unwrap();
        let bytes = format::encode(spec, &texture).unwrap();
        let Decoded::Texture(back) = format::decode(&bytes).unwrap() else { panic!("a texture") };
        assert_eq!((back.levels, back.faces, back.format), (texture.levels.clone(), faces, format));
        assert!(back.metadata.contains(&texture.metadata[0]));

        let path = file(&folder, "a.exr", &bytes);
        let Some(printed) = tools::python(READ_PARTS, &path) else { return };
        let names = if faces == 6 { "+X -X +Y -Y +Z -Z" } else { "-" };
        assert!(printed.starts_with(&format!("parts {names}\n")), "{printed:.200}");
        let reds = |level: usize, face: usize| -> Vec<f32> {
            texture.face(level, face).unwrap().into_iter().step_by(format.channels()).collect()
        };
        let numbers = |text: &str| text.split(' ').map(parse_hex).collect::<Vec<f32>>();
        let parts: Vec<&str> = printed.lines().filter_map(|line| line.strip_prefix("part ")).collect();
        assert_eq!(parts.len(), faces);
        for (face, part) in parts.into_iter().enumerate() {
            assert_eq!(numbers(part), reds(0, face), "part {face}");
        }
        let found: Vec<&str> = printed.lines().filter_map(|line| line.strip_prefix("level ")).collect();
        // Complete chains, whose last levels are ours only if the texture had them.
        let complete = if n_levels == 1 { 1 } else { size[0].max(size[1]).ilog2() as usize + 1 };
        assert_eq!(found.len(), faces * complete);
        for (i, line) in found.into_iter().enumerate() {
            let (face, level) = (i / complete, i % complete);
            let [w, h] = texture.level_size(level);
            let values = line.strip_prefix(&format!("{face} {level} {w} {h} ")).unwrap_or_else(|| panic!("{line:.60}"));
            if level < n_levels {
                assert_eq!(numbers(values), reds(level, face), "face {face}, level {level}");
            } else {
                // Averages lie between the extremes of what there was.
                let (low, high) = (reds(n_levels - 1, face), 1e3);
                let least = low.into_iter().fold(f32::INFINITY, f32::min);
                assert!(numbers(values).iter().all(|v| (least..=high).contains(v)), "face {face}, level {level}");
            }
        }
    }
    let (volume, _) = Texture::volume("r32f".parse().unwrap(), [2, 2, 2], &[0.0; 8]).unwrap();
    let message = kiln::format::exr::encode_texture(&volume).unwrap_err().to_string();
    assert!(message.contains("which Kiln writes pictures and cubes to; use ktx2, ktx1 or dds"), "{message}");
}

/// Negative values, overflow, NaN and infinity in every packing without a sign: refused unless that is allowed, and then counted and stored
/// as each packing's head says.
#[test]
fn what_an_unsigned_packing_has_no_room_for_is_refused_or_counted() {
    for (name, largest) in [
        ("ktx2:b10g11r11", 64512.0),
        ("ktx2:rgb9e5", 65408.0),
        ("ktx2:bc6h", 65504.0),
        ("ktx2:uastc-hdr", 65504.0),
        ("ktx2:rgbm", 64.0),
        ("ktx2:rgbp", 64.0),
        ("ktx2:rgbd", 255.0),
        ("hdr", 1.0e38),
        ("png:rgb8unorm", 1.0),
        ("png:rgb16unorm", 1.0),
    ] {
        let one = |value: f64, channel: usize| {
            let mut values = [0.5; 3 * 16];
            values[3 * 5 + channel] = value;
            let (texture, _) = Texture::flat("rgb32f".parse().unwrap(), 4, 4, &values).unwrap();
            ktx2::encode(&texture).unwrap()
        };
        let allowed = Conversion { clamp: true, ..conversion(name) };
        for channel in 0..3 {
            for (value, stored) in [
                (-1.0, Some(0.0)),
                (1e38, None),
                (f64::NAN, Some(0.0)),
                (f64::INFINITY, None),
                (f64::NEG_INFINITY, Some(0.0)),
            ] {
                if name == "hdr" && value == 1e38 {
                    continue; // it has room for that
                }
                let bytes = one(value, channel);
                let message = converted(&bytes, &conversion(name)).unwrap_err().to_string();
                assert!(
                    message.contains("has no room for 1 values")
                        || message.contains(" 1 below zero")
                        || message.contains(" 1 that are not finite"),
                    "{name} {value}: {message}"
                );
                assert!(message.contains("; choose an f32 format, or"), "{name}: {message}");
                let (file, report) = converted(&bytes, &allowed).unwrap();
                let counted = [report.packing.overflowed, report.packing.negative, report.packing.nonfinite];
                let wanted = [u64::from(value == 1e38), u64::from(value < 0.0), u64::from(!value.is_finite())];
                assert_eq!(counted, wanted, "{name} {value}");
                let decoded = format::decode(&file).unwrap();
                let found = decoded.values()[3 * 5 + channel];
                // Blocks and shared factors spread what is beside; a clamped value itself is the end of the range.
                let slack: f64 = if ["ktx2:bc6h", "ktx2:uastc-hdr"].contains(&name) { 0.02 } else { 0.0 };
                // Beside a value of 0.5 the largest that seven bits of a logarithm hold.
                let largest = if name == "ktx2:uastc-hdr" { 55296.0 } else { largest };
                match stored {
                    Some(wanted) => assert!((found - wanted).abs() <= slack.max(1e-12), "{name} {value}: {found}"),
                    None => {
                        assert!(found >= largest * (1.0 - 0.02 - slack), "{name} {value}: {found}, largest {largest}")
                    }
                }
            }
        }
    }
}
