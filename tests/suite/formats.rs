//! Every format that Kiln writes, read back by readers that other people wrote; every format that it reads, likewise.

#![allow(clippy::unwrap_used)] // in helpers, which clippy does not count among the tests

use crate::support::samples::{cube, hdr as hdr_sample, picture};
use crate::support::tools;
use image::ImageDecoder;
use kiln::format::{self, Image, Texture, exr, hdr, ktx2};
use kiln::pack::{Number, TexelFormat};
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

const CHANNELS: [&str; 3] = ["ggx.scale", "R", "ggx.bias"];

/// The values of a channel after packing and unpacking as `number`.
fn stored(image: &Image<f64>, channel: &str, number: Number) -> Vec<f32> {
    number.unpack(&number.pack(&image.channel(channel).unwrap()).0)
}

fn file(folder: &tempfile::TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    format::atomic::write(&path, bytes).unwrap();
    path
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn exr_is_read_again_as_it_was_packed() {
    for number in [Number::F16, Number::F32] {
        let image = picture(70, 37, &CHANNELS);
        let (bytes, report) = exr::encode(&image, number).unwrap();
        assert_eq!(report, number.pack(&image.texels).1);
        let back = exr::decode(&bytes).unwrap();
        assert_eq!((back.width, back.height), (70, 37));
        assert_eq!(back.channels, ["R", "ggx.bias", "ggx.scale"]);
        let mut sorted = image.metadata.clone();
        sorted.sort();
        assert_eq!(back.metadata, sorted);
        for channel in CHANNELS {
            assert_eq!(bits(&back.channel(channel).unwrap()), bits(&stored(&image, channel, number)), "{channel}");
        }
    }
}

#[test]
fn exr_bytes_do_not_depend_on_the_number_of_threads_or_the_run() {
    let mut image = picture(64, 200, &["R", "G", "B"]);
    image.metadata = (0..20).map(|i| (format!("key {i}"), i.to_string())).collect();
    let encode = || exr::encode(&image, Number::F16).unwrap().0;
    let with_threads = |n: usize| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(encode);
    let bytes = encode();
    assert!(bytes == with_threads(1) && bytes == with_threads(5), "the bytes differ between thread counts");
}

#[test]
fn exr_is_what_the_exr_crate_reads() {
    use ::exr::prelude::*;
    let image = picture(33, 21, &CHANNELS);
    for number in [Number::F16, Number::F32] {
        let (bytes, _) = exr::encode(&image, number).unwrap();
        let read = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
        let theirs = read.pedantic().from_buffered(Cursor::new(&bytes)).unwrap();
        let layer = &theirs.layer_data;
        assert_eq!((layer.size.x(), layer.size.y()), (33, 21));
        assert_eq!(layer.encoding.compression, Compression::ZIP16);
        for channel in &layer.channel_data.list {
            let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
            let name = channel.name.to_string();
            assert_eq!(bits(&values), bits(&stored(&image, &name, number)), "{name}");
        }
        assert_eq!(layer.attributes.comments.as_ref().unwrap().to_string(), "two\nlines");
        assert_eq!(layer.attributes.other.len(), 2);
    }
}

/// Prints the keys' texts, then each channel's name, type and values in hexadecimal.
const READ_EXR: &str = r#"
import OpenEXR, sys
part = OpenEXR.File(sys.argv[1], separate_channels=True).parts[0]
header = part.header
for key in sorted(header):
    if isinstance(header[key], str): print("text", key, repr(header[key]))
print("compression", header["compression"])
for name in sorted(part.channels):
    pixels = part.channels[name].pixels
    print("channel", name, pixels.dtype, *pixels.shape, *[v.hex() for v in pixels.astype("float64").ravel().tolist()])
"#;

#[test]
fn exr_is_what_openexr_reads() {
    let folder = tempfile::tempdir().unwrap();
    let image = picture(33, 21, &CHANNELS);
    for (number, dtype) in [(Number::F16, "float16"), (Number::F32, "float32")] {
        let path = file(&folder, "a.exr", &exr::encode(&image, number).unwrap().0);
        let Some(printed) = tools::python(READ_EXR, &path) else { return };
        for text in
            [r"text comments 'two\nlines'", r#"text kiln.recipe '{"name":"ggx","µ":"sqrt"}'"#, "ZIP_COMPRESSION"]
        {
            assert!(printed.contains(text), "no {text} in {printed:.600}");
        }
        for channel in CHANNELS {
            let start = format!("channel {channel} {dtype} 21 33 ");
            let line = printed.lines().find_map(|line| line.strip_prefix(&start));
            let values: Vec<f32> = line.expect(&start).split(' ').map(parse_hex).collect();
            assert_eq!(bits(&values), bits(&stored(&image, channel, number)), "{channel}");
        }
    }
}

/// A number as Python's `float.hex` prints it: `0x1.8000000000000p+3`.
fn parse_hex(text: &str) -> f32 {
    let (mantissa, exponent) = text.strip_prefix("0x").unwrap().split_once('p').unwrap();
    let (whole, fraction) = mantissa.split_once('.').unwrap();
    let digits = u64::from_str_radix(&format!("{whole}{fraction}"), 16).unwrap() as f64;
    (digits * 2_f64.powi(exponent.parse::<i32>().unwrap() - 4 * fraction.len() as i32)) as f32
}

#[test]
fn ktx2_is_what_the_ktx2_crate_reads() {
    use ::ktx2::dfd::ChannelTypeQualifiers;
    for format in in_ktx2() {
        let texture = cube(format, 8);
        let bytes = ktx2::encode(&texture).unwrap();
        let reader = ::ktx2::Reader::new(&bytes).unwrap();
        let header = reader.header();
        assert_eq!((header.pixel_width, header.pixel_height, header.pixel_depth), (8, 8, 0));
        assert_eq!((header.layer_count, header.face_count, header.level_count), (0, 6, 4));
        assert_eq!(header.type_size as usize, type_size(format), "{format}");
        let levels: Vec<Vec<u8>> = reader.levels().map(|level| level.data.to_vec()).collect();
        assert!(levels == texture.levels, "{format}: other levels");
        let pairs: Vec<(&str, &[u8])> = reader.key_value_data().collect();
        let writer = concat!("kiln ", env!("CARGO_PKG_VERSION"), "\0").as_bytes();
        let code = format!("{format}\0");
        let is_code = matches!(format, TexelFormat::Rgbm | TexelFormat::Rgbp | TexelFormat::Rgbd);
        let packing = is_code.then_some(("kiln.packing", code.as_bytes()));
        let mut wanted = vec![("KTXwriter", writer), ("author", "β\0".as_bytes())];
        wanted.extend(packing);
        wanted.push(("kiln.recipe", b"{}\0"));
        assert_eq!(pairs, wanted, "{format}");
        let dfd = reader.basic_dfd().unwrap();
        let model = match format {
            TexelFormat::Bc6h => ::ktx2::ColorModel::BC6H.value(),
            TexelFormat::UastcHdr => 167, // no name here yet
            _ => ::ktx2::ColorModel::RGBSDA.value(),
        };
        assert_eq!(dfd.color_model.map(|model| model.value()), Some(model));
        assert_eq!(dfd.transfer_function, Some(::ktx2::TransferFunction::Linear));
        assert_eq!(dfd.color_primaries, Some(::ktx2::ColorPrimaries::BT709));
        assert_eq!(dfd.bytes_planes[0] as usize, format.block_bytes(), "{format}");
        let Some(number) = format.number() else { continue };
        assert_eq!(dfd.sample_information.len(), format.channels());
        for (i, sample) in dfd.sample_information.iter().enumerate() {
            assert_eq!(sample.channel_type, [0, 1, 2, 15][i], "R, G, B, alpha");
            let float = ChannelTypeQualifiers::FLOAT | ChannelTypeQualifiers::SIGNED;
            let (qualifiers, range) = match number.is_signed() {
                true => (float, ((-1_f32).to_bits(), 1_f32.to_bits())),
                false => (ChannelTypeQualifiers::empty(), (0, (1_u64 << (8 * number.bytes())) as u32 - 1)),
            };
            assert_eq!(sample.channel_type_qualifiers, qualifiers);
            assert_eq!((sample.lower, sample.upper), range);
            assert_eq!(usize::from(sample.bit_offset), 8 * i * number.bytes());
        }
    }
}

/// The formats that KTX2 holds.
fn in_ktx2() -> impl Iterator<Item = TexelFormat> {
    TexelFormat::ALL.into_iter().filter(|&format| format != TexelFormat::Rgbe)
}

/// Bytes of what a machine of another byte order would have to swap.
fn type_size(format: TexelFormat) -> usize {
    match (format, format.number()) {
        (_, Some(number)) => number.bytes(),
        (TexelFormat::Rgb9e5 | TexelFormat::B10g11r11, _) => 4,
        _ => 1,
    }
}

/// Vulkan's numbers of the formats, in the order of the list.
const VK_FORMATS: [u32; 23] =
    [76, 83, 90, 97, 100, 103, 106, 109, 9, 16, 23, 37, 70, 77, 84, 91, 123, 122, 143, 1_000_066_000, 37, 37, 37];

/// Prints the header's fields, the keys, and every level in hexadecimal.
const READ_KTX2: &str = r#"
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
const { read } = await import(pathToFileURL(process.env.KILN_TEST_TOOLS + "/node_modules/ktx-parse/dist/index.mjs"));
const ktx = read(new Uint8Array(readFileSync(process.argv[1])));
console.log(ktx.vkFormat, ktx.typeSize, ktx.pixelWidth, ktx.pixelHeight, ktx.pixelDepth, ktx.layerCount, ktx.faceCount,
  ktx.levels.length, ktx.supercompressionScheme);
console.log(JSON.stringify(ktx.keyValue));
console.log(ktx.dataFormatDescriptor.length, ktx.dataFormatDescriptor[0].samples.length);
for (const level of ktx.levels) console.log(Buffer.from(level.levelData).toString("hex"));
"#;

#[test]
fn ktx2_is_what_ktx_parse_reads() {
    let folder = tempfile::tempdir().unwrap();
    for (format, vk_format) in in_ktx2().zip(VK_FORMATS) {
        let values: Vec<f64> = (0..15 * format.channels()).map(|i| i as f64 / 60.0).collect();
        let (flat, _) = Texture::flat(format, 5, 3, &values).unwrap();
        let (volume, _) = Texture::volume(format, [1, 3, 5], &values).unwrap();
        let (array, _) = Texture::array(format, [1, 3, 5], &values).unwrap();
        // One start of the program takes a tenth of a second: one texture of each kind in turn.
        let kinds = [cube(format, 4), flat, volume, array];
        for texture in kinds.into_iter().cycle().skip(vk_format as usize % 4).take(2) {
            let path = file(&folder, "a.ktx2", &ktx2::encode(&texture).unwrap());
            let Some(printed) = tools::node(READ_KTX2, &path) else { return };
            let mut lines = printed.lines();
            let head = format!(
                "{vk_format} {} {} {} {} {} {} {} 0",
                type_size(format),
                texture.width,
                texture.height,
                texture.depth,
                texture.array_layers,
                texture.faces,
                texture.levels.len()
            );
            assert_eq!(lines.next(), Some(&head[..]), "{format}");
            let keys = lines.next().unwrap();
            assert!(keys.contains(concat!("\"KTXwriter\":\"kiln ", env!("CARGO_PKG_VERSION"))), "{keys}");
            // Keys that KTX does not define it leaves as bytes.
            let beta = r#""author":{"0":206,"1":178,"2":0}"#;
            assert!(texture.faces == 1 || keys.contains(beta), "{keys}");
            let samples = match format {
                TexelFormat::Rgb9e5 => 6, // a mantissa and the exponent for each
                TexelFormat::Bc6h | TexelFormat::UastcHdr => 1,
                TexelFormat::Rgbm | TexelFormat::Rgbp | TexelFormat::Rgbd => 4,
                _ => format.channels(),
            };
            assert_eq!(lines.next(), Some(&format!("1 {samples}")[..]));
            let levels: Vec<&str> = lines.collect();
            let wanted: Vec<String> = texture.levels.iter().map(|level| hex(level)).collect();
            assert_eq!(levels, wanted, "{format}");
        }
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn ktx2_passes_the_khronos_validator() {
    let folder = tempfile::tempdir().unwrap();
    for format in in_ktx2() {
        let volume = Texture::volume(format, [4, 4, 4], &vec![0.5_f32; 64 * format.channels()]).unwrap().0;
        // (It wants what comes last in the file padded, which the specification has not.)
        let flat = Texture { levels: vec![vec![0; format.bytes(8, 3).unwrap()]], ..Texture::empty(format, 8, 3) };
        for texture in [cube(format, 8), volume, flat] {
            let plain = ktx2::encode(&texture).unwrap();
            for bytes in [ktx2::encode_zstd(&texture).unwrap(), plain] {
                let path = file(&folder, "a.ktx2", &bytes);
                let Some(faults) = tools::faults_of_ktx2(&path) else { return };
                assert!(faults.is_empty(), "{format}, {} × {}: {faults:?}", texture.width, texture.height);
            }
        }
    }
    // It does find faults.
    let bytes = ktx2::encode(&cube("rgba16f".parse().unwrap(), 8)).unwrap();
    let faults = |change: fn(&mut Vec<u8>)| {
        let mut bytes = bytes.clone();
        change(&mut bytes);
        tools::faults_of_ktx2(&file(&folder, "bad.ktx2", &bytes))
    };
    let Some(short) = faults(|bytes| bytes.truncate(400)) else { return };
    assert!(!short.is_empty());
    assert!(
        !faults(|bytes| bytes[12] = 98).expect("the tool is there").is_empty(),
        "a format that the descriptor is not"
    );
}

#[test]
fn hdr_is_what_the_image_crate_reads() {
    let bytes = hdr_sample();
    let ours = hdr::decode(&bytes).unwrap();
    let decoder = image::codecs::hdr::HdrDecoder::new(Cursor::new(&bytes)).unwrap();
    let mut theirs = vec![0; decoder.total_bytes() as usize];
    decoder.read_image(&mut theirs).unwrap();
    let theirs: Vec<u32> = theirs.chunks_exact(4).map(|b| u32::from_ne_bytes(b.try_into().unwrap())).collect();
    assert_eq!(bits(&ours.texels), theirs);
    assert_eq!((ours.width, ours.height, ours.channels.join("")), (16, 4, "RGB".to_owned()));
    assert_eq!(ours.metadata("SOFTWARE"), Some("kiln tests"));
}

fn flat_hdr(head: &str, resolution: &str, pixels: &[[u8; 4]]) -> Vec<u8> {
    [head.as_bytes(), b"\n", resolution.as_bytes(), b"\n", pixels.as_flattened()].concat()
}

#[test]
fn hdr_values_are_mantissa_times_two_to_the_exponent_less_136() {
    let pixels = [[128, 64, 1, 129], [255, 0, 7, 1], [9, 9, 9, 0], [255, 255, 255, 255]];
    let image = hdr::decode(&flat_hdr("#?RGBE\n", "-Y 1 +X 4", &pixels)).unwrap();
    let power = |e: i32| 2_f64.powi(e);
    let wanted =
        [[1.0, 0.5, 1.0 / 128.0], [255.0 * power(-135), 0.0, 7.0 * power(-135)], [0.0; 3], [255.0 * power(119); 3]];
    assert_eq!(image.texels, wanted.as_flattened().iter().map(|&v| v as f32).collect::<Vec<_>>());
}

#[test]
fn hdr_exposure_and_colour_correction_are_divided_out() {
    let head = "#?RADIANCE\nEXPOSURE=4\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 0.5\nCOLORCORR= 1 2 4\n";
    let image = hdr::decode(&flat_hdr(head, "-Y 1 +X 1", &[[128, 128, 128, 129]])).unwrap();
    assert_eq!(image.texels, [0.5, 0.25, 0.125]);
}

#[test]
fn hdr_runs_of_the_old_kind_repeat_the_pixel_before() {
    let mut pixels = vec![[128, 0, 0, 129], [1, 1, 1, 44], [1, 1, 1, 1], [0, 128, 0, 129]];
    let image = hdr::decode(&flat_hdr("#?RADIANCE\n", "-Y 1 +X 302", &pixels)).unwrap();
    let rgb = image.rgb().unwrap();
    assert!(rgb[..301].iter().all(|&texel| texel == [1.0, 0.0, 0.0]));
    assert_eq!(rgb[301], [0.0, 1.0, 0.0]);
    pixels[2] = [1, 1, 1, 2];
    assert!(hdr::decode(&flat_hdr("#?RADIANCE\n", "-Y 1 +X 302", &pixels)).is_err());
}

#[test]
fn hdr_of_any_orientation_comes_upright() {
    // The picture is 1 2 3 over 4 5 6; each line says in which order its pixels are stored.
    let orders = [
        ("-Y 2 +X 3", [1, 2, 3, 4, 5, 6]),
        ("-Y 2 -X 3", [3, 2, 1, 6, 5, 4]),
        ("+Y 2 +X 3", [4, 5, 6, 1, 2, 3]),
        ("+Y 2 -X 3", [6, 5, 4, 3, 2, 1]),
        ("+X 3 -Y 2", [1, 4, 2, 5, 3, 6]),
        ("-X 3 -Y 2", [3, 6, 2, 5, 1, 4]),
        ("+X 3 +Y 2", [4, 1, 5, 2, 6, 3]),
        ("-X 3 +Y 2", [6, 3, 5, 2, 4, 1]),
    ];
    for (resolution, stored) in orders {
        let pixels = stored.map(|value| [value, 0, 0, 136]);
        let image = hdr::decode(&flat_hdr("#?RADIANCE\n", resolution, &pixels)).unwrap();
        assert_eq!((image.width, image.height), (3, 2), "{resolution}");
        assert_eq!(image.channel("R").unwrap(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "{resolution}");
    }
}

#[test]
fn a_picture_is_known_by_its_bytes_not_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let (exr, _) = exr::encode(&picture(4, 2, &["R", "G", "B"]), Number::F32).unwrap();
    assert_eq!(format::read_image(&file(&folder, "exr.hdr", &exr)).unwrap().width, 4);
    assert_eq!(format::read_image(&file(&folder, "hdr.exr", &hdr_sample())).unwrap().width, 16);
}

#[test]
fn files_of_other_kinds_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let ktx2 = ktx2::encode(&cube(TexelFormat::ALL[0], 2)).unwrap();
    let kinds: [(&[u8], &str); 10] = [
        (b"", "empty"),
        (b"\x89PNG\r\n\x1a\n", "PNG"),
        (b"\xff\xd8\xff\xe0", "JPEG"),
        (b"DDS \x7c", "DDS"),
        (&ktx2, "KTX2"),
        (b"\xabKTX 11\xbb\r\n\x1a\n", "KTX texture of version 1"),
        (b"hello, world\n", "text file"),
        (b"version https://git-lfs.github.com/spec/v1\n", "Git LFS"),
        (b"RIFF\0\0\0\0WEBP", "WebP"),
        (b"\0\x01\x02", "unknown kind"),
    ];
    for (bytes, kind) in kinds {
        let path = file(&folder, "sky.hdr", bytes);
        let message = format::read_image(&path).unwrap_err().to_string();
        assert!(message.contains("sky.hdr: ") && message.contains(kind) && message.contains("; "), "{kind}: {message}");
    }
    for path in [folder.path(), &folder.path().join("missing.exr"), Path::new("")] {
        let message = format::read_image(path).unwrap_err().to_string();
        assert!(message.contains("reading failed") && message.contains("; "), "{message}");
    }
    fs::remove_file(folder.path().join("sky.hdr")).unwrap();
}

/// A picture by the `exr` crate: 4 × 2 texels counted from 1 on, the data window at (2, 1), the display window as given.
fn windowed(display: ((i32, i32), (usize, usize))) -> Vec<u8> {
    use ::exr::prelude::*;
    let samples = FlatSamples::F32((1..=8).map(|i| i as f32).collect());
    let channels = AnyChannels::sort([AnyChannel::new("Y", samples)].into_iter().collect());
    let attributes = LayerAttributes::default().with_position(Vec2(2, 1));
    let layer = Layer::new((4, 2), attributes, Encoding::SMALL_LOSSLESS, channels);
    let bounds = IntegerBounds::new(display.0, display.1);
    let image = Image::empty(ImageAttributes::new(bounds)).with_layer(layer);
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn exr_windows_crop_overscan_and_leave_the_rest_black() {
    let equal = exr::decode(&windowed(((2, 1), (4, 2)))).unwrap();
    assert_eq!((equal.width, &equal.texels[..]), (4, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0][..]));
    let larger = exr::decode(&windowed(((1, 1), (6, 3)))).unwrap();
    let rows = [[0.0, 1.0, 2.0, 3.0, 4.0, 0.0], [0.0, 5.0, 6.0, 7.0, 8.0, 0.0], [0.0; 6]];
    assert_eq!((larger.width, larger.texels), (6, rows.concat()));
    let overscan = exr::decode(&windowed(((3, 2), (2, 1)))).unwrap();
    assert_eq!((overscan.width, overscan.texels), (2, vec![6.0, 7.0]));
    for nothing in [((6, 1), (4, 2)), ((0, 3), (9, 9)), ((0, 0), (1000, 1000))] {
        let message = exr::decode(&windowed(nothing)).unwrap_err().to_string();
        assert!(message.contains("data window 4 × 2 at (2, 1)") && message.contains("; save"), "{message}");
    }
}

#[test]
fn exr_of_every_lossless_compression_and_of_tiles_is_read() {
    use ::exr::prelude::*;
    let values: Vec<f32> = picture(50, 40, &["R"]).texels.iter().map(|&v| v as f32).collect();
    let compressions =
        [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ];
    for compression in compressions {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 8))] {
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            let channels =
                AnyChannels::sort([AnyChannel::new("R", FlatSamples::F32(values.clone()))].into_iter().collect());
            let layer = Layer::new((50, 40), LayerAttributes::default(), encoding, channels);
            let mut bytes = Cursor::new(Vec::new());
            Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
            let image = exr::decode(bytes.get_ref()).unwrap();
            assert_eq!(bits(&image.texels), bits(&values), "{compression:?} {blocks:?}");
        }
    }
}

#[test]
fn exr_with_integers_is_refused() {
    use ::exr::prelude::*;
    let channels = AnyChannels::sort([AnyChannel::new("id", FlatSamples::U32(vec![1; 4]))].into_iter().collect());
    let layer = Layer::new((2, 2), LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    let message = exr::decode(bytes.get_ref()).unwrap_err().to_string();
    assert!(message.contains("channel `id` of the OpenEXR holds u32") && message.contains("; save"), "{message}");
}

#[test]
fn exr_names_that_openexr_cannot_carry_are_refused() {
    let cases: [(&str, &str); 5] = [
        ("compression", "means something else"),
        ("chunkCount", "means"),
        ("", "empty"),
        ("a\0b", "NUL"),
        ("comments", "twice"),
    ];
    for (key, fault) in cases {
        let mut image = picture(2, 2, &["Y"]);
        image.metadata.push((key.to_owned(), "x".to_owned()));
        let message = exr::encode(&image, Number::F32).unwrap_err().to_string();
        assert!(message.contains(fault) && message.contains("; use another name"), "{key}: {message}");
    }
    assert!(exr::encode(&picture(2, 2, &["R", "R"]), Number::F32).is_err());
}
