//! Facts about what an environment can be read from: panoramas of any proportions, cubes in every layout, stated colours.

#![allow(clippy::unwrap_used)] // in helpers, which clippy does not count among the tests

use crate::support::kiln::{fail, listing, succeed};
use crate::support::samples::Random;
use kiln::colour::{Primaries, TargetColour};
use kiln::environment::cube::{face_point, texel_direction};
use kiln::environment::spherical_harmonics::{basis, project};
use kiln::environment::{
    Cube, FullSum, InputLayout, Kernel, Layout, MonteCarlo, Negatives, NonFinite, Panorama, Reading, area_average,
    builtin, load,
};
use kiln::format::{Image, exr, ktx2};
use kiln::math::quadrature::gauss_legendre;
use kiln::pack::Number;
use std::f64::consts::PI;
use std::path::Path;

/// Colours of +X −X +Y −Y +Z −Z, no two alike in any channel.
const COLOURS: [[f32; 3]; 6] =
    [[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 4.0], [8.0, 7.0, 0.4], [0.4, 9.0, 6.0], [5.0, 0.5, 11.0]];

fn random_panorama([width, height]: [usize; 2], seed: u64) -> Panorama {
    let mut random = Random(seed);
    let mut texels: Vec<[f32; 3]> = (0..width * height).map(|_| [0; 3].map(|_| random.unit() as f32)).collect();
    texels[width * (height / 3) + width / 2] = [3e3, 2e3, 1e3];
    Panorama::new(width, height, texels).unwrap()
}

fn write_exr(
    folder: &Path,
    name: &str,
    [width, height]: [usize; 2],
    texels: &[[f32; 3]],
    primaries: Option<Primaries>,
) {
    let mut image = Image::new(width, height, &["R", "G", "B"], texels.as_flattened().to_vec()).unwrap();
    image.primaries = primaries;
    std::fs::write(folder.join(name), exr::encode(&image, Number::F32).unwrap().0).unwrap();
}

fn read(folder: &Path, name: &str, layout: InputLayout) -> kiln::Result<(Panorama, Layout)> {
    let reading = Reading { layout, ..Reading::default() };
    load(folder.join(name).to_str().unwrap(), &reading).map(|(panorama, report)| (panorama, report.layout))
}

/// A cube whose face `f` has colour `f`, but for one marked texel near a corner of each: what shows turns and flips.
fn marked_cube(size: usize) -> Cube {
    let mut texels: Vec<[f32; 3]> = COLOURS.iter().flat_map(|&colour| vec![colour; size * size]).collect();
    for face in 0..6 {
        texels[face * size * size + size + 2] = [100.0 + face as f32; 3];
    }
    Cube { size, texels }
}

/// What the panorama shows of [`marked_cube`] in directions that are known by heart, not by the code under test.
fn assert_shows_marked_cube(what: &str, panorama: &Panorama, size: usize) {
    for (face, colour) in COLOURS.into_iter().enumerate() {
        for (u, v) in [(0.0, 0.0), (0.6, 0.6), (-0.6, 0.6), (0.6, -0.6)] {
            let got = panorama.radiance(face_point(face, u, v));
            assert_eq!(got, colour, "{what}: face {face} at ({u}, {v})");
        }
        // Texel (2, 1): its centre.
        let centre = |i: f64| (2.0 * i + 1.0) / size as f64 - 1.0;
        let got = panorama.radiance(face_point(face, centre(2.0), centre(1.0)));
        // The panorama's texel holds some of the neighbours too; no colour is beyond 11.
        assert!(got.iter().all(|&v| v > 20.0), "{what}: the mark of face {face} is {got:?}");
    }
}

/// The pictures of each layout, put together texel by texel from a table of cells.
fn picture(cube: &Cube, columns: usize, rows: usize, cells: [(usize, usize); 6], turn_last: bool) -> Vec<[f32; 3]> {
    let n = cube.size;
    let mut texels = vec![[0.0; 3]; columns * rows * n * n];
    for (face, (column, row)) in cells.into_iter().enumerate() {
        for (i, texel) in cube.face(face).iter().enumerate() {
            let (mut x, mut y) = (i % n, i / n);
            if turn_last && face == 5 {
                (x, y) = (n - 1 - x, n - 1 - y);
            }
            texels[(row * n + y) * columns * n + column * n + x] = *texel;
        }
    }
    texels
}

#[test]
fn every_layout_shows_each_face_where_it_belongs() {
    let folder = tempfile::tempdir().unwrap();
    let (cube, n) = (marked_cube(12), 12);
    let cross = [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1)];
    let with = |last| [cross[0], cross[1], cross[2], cross[3], cross[4], last];
    let strip = [0, 1, 2, 3, 4, 5];
    let cases = [
        ("h-cross.exr", Layout::HorizontalCross, 4, 3, with((3, 1)), InputLayout::Cross),
        ("v-cross.exr", Layout::VerticalCross, 3, 4, with((1, 3)), InputLayout::Cross),
        ("h-strip.exr", Layout::HorizontalStrip, 6, 1, strip.map(|i| (i, 0)), InputLayout::Strip),
        ("v-strip.exr", Layout::VerticalStrip, 1, 6, strip.map(|i| (0, i)), InputLayout::Strip),
    ];
    for (name, layout, columns, rows, cells, asked) in cases {
        let texels = picture(&cube, columns, rows, cells, layout == Layout::VerticalCross);
        write_exr(folder.path(), name, [columns * n, rows * n], &texels, None);
        for asked in [InputLayout::Auto, asked] {
            let (panorama, found) = read(folder.path(), name, asked).unwrap();
            assert_eq!(found, layout, "{name}");
            assert_eq!((panorama.width(), panorama.height()), (4 * n, 2 * n));
            assert_shows_marked_cube(name, &panorama, n);
        }
        let (panorama, found) = read(folder.path(), name, InputLayout::Panorama).unwrap();
        assert_eq!((found, panorama.width()), (Layout::Panorama, columns * n));
    }
    let rgba: Vec<f32> = cube.texels.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0]).collect();
    for format in ["rgba16f", "rgba32f"] {
        let format: kiln::pack::TexelFormat = format.parse().unwrap();
        let mut texture = kiln::format::Texture::empty_cube(format, n);
        texture.push_level(&rgba).unwrap();
        std::fs::write(folder.path().join("cube.ktx2"), ktx2::encode(&texture).unwrap()).unwrap();
        let (panorama, found) = read(folder.path(), "cube.ktx2", InputLayout::Auto).unwrap();
        assert_eq!(found, Layout::CubeTexture);
        let half = panorama.radiance(face_point(0, 0.0, 0.0));
        assert!((half[1] - 0.1).abs() < 1e-4 && half[0] == 1.0, "{half:?}");
    }
}

/// The colour of the axis that a direction is nearest to.
fn axis_colour(d: [f64; 3]) -> [f32; 3] {
    let axis = (0..3).max_by(|&a, &b| d[a].abs().total_cmp(&d[b].abs())).unwrap();
    COLOURS[2 * axis + usize::from(d[axis] < 0.0)]
}

#[test]
fn an_octahedral_map_shows_each_axis_where_it_belongs_and_keeps_its_flux() {
    let folder = tempfile::tempdir().unwrap();
    let n = 30;
    // The octahedron unfolded, by hand: upper half inside the diamond, the lower one folded out over its sides.
    let texels: Vec<[f32; 3]> = (0..n * n)
        .map(|i| {
            let [u, v] = [i % n, i / n].map(|k| (2.0 * k as f64 + 1.0) / n as f64 - 1.0);
            let inside = u.abs() + v.abs() <= 1.0;
            let (x, y) = if inside { (u, v) } else { (u.signum() * (1.0 - v.abs()), v.signum() * (1.0 - u.abs())) };
            axis_colour([x, y, 1.0 - u.abs() - v.abs()])
        })
        .collect();
    write_exr(folder.path(), "sky.exr", [n, n], &texels, None);
    let (panorama, found) = read(folder.path(), "sky.exr", InputLayout::Octahedral).unwrap();
    assert_eq!((found, panorama.width(), panorama.height()), (Layout::Octahedral, 4 * n, 2 * n));
    for d in
        [[1.0, 0.2, 0.3], [-1.0, 0.3, -0.1], [0.2, 1.0, -0.3], [-0.3, -1.0, 0.1], [0.1, 0.2, 1.0], [0.3, -0.1, -1.0]]
    {
        let got = panorama.radiance(d.into());
        assert_eq!(got, axis_colour(d), "towards {d:?}");
    }
    // A square says of itself nothing; what is no square is no octahedral map.
    assert_eq!(read(folder.path(), "sky.exr", InputLayout::Auto).unwrap().1, Layout::Panorama);
    write_exr(folder.path(), "wide.exr", [2 * n, n], &[[1.0; 3]].repeat(2 * n * n), None);
    let message = read(folder.path(), "wide.exr", InputLayout::Octahedral).unwrap_err().to_string();
    assert!(message.contains("60 × 30, where an octahedral map is square; "), "{message}");
}

#[test]
fn what_kiln_wrote_as_squares_and_as_panoramas_is_an_input_again() {
    let folder = tempfile::tempdir().unwrap();
    let panorama = random_panorama([64, 32], 4);
    write_exr(folder.path(), "sky.exr", [64, 32], panorama.texels(), None);
    for layout in ["octahedral", "equirect"] {
        for format in ["exr:f32", "ktx2:rgba32f"] {
            let out = format!("{layout}-{}", &format[..3]);
            let chain = ["--layout", layout, "--size", "16", "--min-size", "4", "--irradiance-size", "4"];
            let bake = ["-q", "env", "sky.exr", "--out", &out, "--format", format];
            succeed(folder.path(), &[&bake[..], &chain[..]].concat());
            let input = format!("{out}/specular.{}", format.split(':').next().unwrap());
            let asked = if layout == "octahedral" { InputLayout::Octahedral } else { InputLayout::Auto };
            let (back, _) = read(folder.path(), &input, asked).unwrap();
            let wide = if layout == "octahedral" { 64 } else { 32 };
            assert_eq!((back.width(), back.height()), (wide, wide / 2), "{input}: level 0");
            for c in 0..3 {
                // Every texel is rounded to f32 three times: in the bake's average, in its file, as the panorama.
                let (got, wanted) = (back.mean()[c], panorama.mean()[c]);
                assert!((got / wanted - 1.0).abs() < 3.0 * 6e-8, "{input}, channel {c}: {got}, wanted {wanted}");
            }
            // The sun is where it was: of the vector of light, averages over texels of 1/16 π lose little.
            let light = |p: &Panorama| kiln::environment::spherical_harmonics::project(p).radiance[1..4].to_vec();
            let (got, wanted) = (light(&back), light(&panorama));
            let length = wanted.iter().map(|v| v[0] * v[0]).sum::<f64>().sqrt();
            let off = got.iter().zip(&wanted).map(|(a, b)| (a[0] - b[0]).powi(2)).sum::<f64>().sqrt();
            // A texel's light moves by at most its radius, here half the diagonal of 2π/16, twice: there and back.
            assert!(
                off < 2.0 * 0.5 * std::f64::consts::SQRT_2 * PI / 8.0 * length,
                "{input}: {got:?}, wanted {wanted:?}"
            );
        }
    }
    let again = ["-q", "env", "octahedral-exr/specular.exr", "--input-layout", "octahedral", "--out", "again"];
    succeed(folder.path(), &[&again[..], &["--size", "8", "--min-size", "4", "--irradiance-size", "4"]].concat());
    let certificate = std::fs::read_to_string(folder.path().join("again/certificate.json")).unwrap();
    assert!(certificate.contains("\"octahedral\""), "{certificate}");
    succeed(folder.path(), &["verify", "again"]);
}

#[test]
fn six_files_are_found_by_one_of_them_by_a_pattern_and_by_their_folder() {
    let (cube, n) = (marked_cube(12), 12);
    let schemes = [
        ["px", "nx", "py", "ny", "pz", "nz"],
        ["posx", "negx", "posy", "negy", "posz", "negz"],
        ["Right", "Left", "Top", "Bottom", "Front", "Back"],
    ];
    for scheme in schemes {
        let folder = tempfile::tempdir().unwrap();
        for (face, name) in scheme.into_iter().enumerate() {
            write_exr(folder.path(), &format!("sky_{name}.exr"), [n, n], cube.face(face), None);
        }
        let mut ways = vec![format!("sky_{}.exr", scheme[3]), ".".to_owned()];
        if scheme[0] != "Right" {
            ways.push("sky_%s.exr".to_owned()); // a pattern is taken letter by letter
        }
        for way in ways {
            let (panorama, found) = read(folder.path(), &way, InputLayout::Auto).unwrap();
            assert_eq!(found, Layout::SixFiles, "{way}");
            assert_shows_marked_cube(&way, &panorama, n);
        }
        let one = read(folder.path(), &format!("sky_{}.exr", scheme[0]), InputLayout::Panorama).unwrap();
        assert_eq!(one.1, Layout::Panorama);
    }
}

#[test]
fn cubes_that_are_none_are_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let write =
        |name: &str, size: [usize; 2]| write_exr(folder.path(), name, size, &vec![[1.0; 3]; size[0] * size[1]], None);
    for face in ["px", "nx", "py", "ny", "pz"] {
        write(&format!("lack_{face}.exr"), [4, 4]);
        write(&format!("odd_{face}.exr"), [4, 4]);
        write(&format!("flat_{face}.exr"), [4, 4]);
    }
    write("odd_nz.exr", [8, 8]);
    write("flat_nz.exr", [8, 4]);
    write("wide.exr", [16, 8]);
    write("one.exr", [1, 1]);
    write("row.exr", [64, 1]);
    let refusals = [
        ("lack_px.exr", "auto", "a cube of six files without nz"),
        ("lack_%s.exr", "auto", "no lack_nz.exr"),
        ("none_%s.exr", "auto", "none of the six faces is there"),
        ("odd_px.exr", "auto", "a face of 8², where odd_px.exr has 4²"),
        ("flat_px.exr", "auto", "a face of 8 × 4, which is not square"),
        (".", "auto", "several cubes"),
        ("wide.exr", "cross", "no cross (4:3 or 3:4)"),
        ("wide.exr", "strip", "no strip (6:1 or 1:6)"),
        ("one.exr", "auto", "at least 4 × 2"),
        ("row.exr", "auto", "at least 4 × 2"),
    ];
    for (input, layout, part) in refusals {
        let error = fail(folder.path(), &["env", input, "--out", "o", "--input-layout", layout], 1);
        assert!(error.contains(part), "{input}: {error}");
        assert_eq!(error.trim_end().lines().count(), 1, "{input}: {error}");
    }
    fail(folder.path(), &["env", "wide.exr", "--out", "o", "--input-layout", "cube"], 2);
    let left: Vec<String> = listing(folder.path()).into_iter().filter(|name| name.starts_with("o/")).collect();
    assert_eq!(left, [""; 0]);
}

/// A panorama's own cube at 256², read again: texels of the cube that lie across an edge of the panorama's mix two of them, so that light
/// moves by at most a cube's texel, d = 2/256, and a lobe of width alpha changes by no more than d/alpha of itself.
#[test]
fn a_panoramas_own_cube_filters_to_nearly_the_same_levels() {
    let panorama = builtin("sky", 256).unwrap();
    let cube = area_average(&panorama, 256);
    let back = kiln::environment::from_cube(&cube).unwrap();
    for c in 0..3 {
        let error = (back.mean()[c] / panorama.mean()[c] - 1.0).abs();
        assert!(error < 2e-7, "mean of channel {c}: off by {error}");
    }
    let (ours, theirs) = (FullSum::new(&panorama), FullSum::new(&back));
    for alpha in [1.0, 0.25] {
        let kernel = Kernel::new(alpha);
        let mut worst = 0.0_f64;
        for axis in (0..6 * 3 * 3).map(|texel| texel_direction(3, texel)) {
            let (a, b) = (ours.evaluate(axis, &kernel), theirs.evaluate(axis, &kernel));
            (0..3).for_each(|c| worst = worst.max((b[c] - a[c]).abs() / a[c].max(panorama.mean()[c])));
        }
        eprintln!("alpha {alpha}: largest difference {worst:.1e} of the value or the mean");
        assert!(worst < 2.0 / 256.0 / alpha, "alpha {alpha}: {worst}");
    }
}

/// Each texel by a product of Gauss rules in φ and θ, against the closed form.
#[test]
fn spherical_harmonics_are_exact_for_any_proportions() {
    let rule = gauss_legendre(12);
    for size @ [width, height] in [[5, 3], [33, 20], [4, 31], [64, 32]] {
        let panorama = random_panorama(size, 8);
        let mut wanted = [[0.0; 3]; 9];
        for (i, texel) in panorama.texels().iter().enumerate() {
            let (dtheta, dphi) = (PI / height as f64, 2.0 * PI / width as f64);
            for (s, ws) in rule.nodes.iter().zip(&rule.weights) {
                for (t, wt) in rule.nodes.iter().zip(&rule.weights) {
                    let theta = ((i / width) as f64 + s) * dtheta;
                    let phi = ((i % width) as f64 + t) * dphi - PI;
                    let d = glam::DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                    let weight = ws * wt * dtheta * dphi * theta.sin();
                    for (sum, b) in wanted.iter_mut().zip(basis(d)) {
                        (0..3).for_each(|c| sum[c] += weight * b * f64::from(texel[c]));
                    }
                }
            }
        }
        let got = project(&panorama).radiance;
        for (i, c) in (0..27).map(|k| (k / 3, k % 3)) {
            let off = (got[i][c] - wanted[i][c]).abs() / wanted[0][c];
            assert!(off < 1e-12, "{width} × {height}, coefficient {i}, channel {c}: off by {off}");
        }
    }
}

/// 3 sizes, 3 widths, 24 directions, 3 channels: beyond 6.5 standard errors of 32 replicates with probability 2e-4 in all.
#[test]
fn monte_carlo_agrees_with_the_full_sum_for_any_proportions() {
    for size in [[5, 3], [33, 20], [21, 64]] {
        let panorama = random_panorama(size, 4);
        let (witness, truth) = (MonteCarlo::new(&panorama, 7), FullSum::new(&panorama));
        let directions: Vec<_> = (0..24).map(|i| texel_direction(2, i)).collect();
        for alpha in [1.0, 0.25, 0.06] {
            let kernel = Kernel::new(alpha);
            let (estimates, _) = witness.estimate(&directions, &kernel, 4096, &|_| {});
            for (axis, estimate) in directions.iter().zip(estimates) {
                let wanted = truth.evaluate(*axis, &kernel);
                for (c, wanted) in wanted.into_iter().enumerate() {
                    let tolerance = 6.5 * estimate.standard_error[c] + 1e-6 * wanted;
                    let off = (estimate.value[c] - wanted).abs();
                    assert!(off <= tolerance, "{size:?}, alpha {alpha}, {axis}: off by {off}, allowed {tolerance}");
                }
            }
        }
    }
}

#[test]
fn panoramas_of_any_size_bake_and_verify() {
    let folder = tempfile::tempdir().unwrap();
    for size in [[4, 2], [5, 3], [100, 60], [33, 20]] {
        let name = format!("{}x{}.exr", size[0], size[1]);
        write_exr(folder.path(), &name, size, random_panorama(size, 2).texels(), None);
        let small = ["--size", "16", "--min-size", "4", "--irradiance-size", "4", "--samples", "1024"];
        let run = succeed(folder.path(), &[&["env", &name, "--out", "o"][..], &small].concat());
        assert_eq!(run.stderr.contains("is not 2:1"), size[0] != 2 * size[1], "{}", run.stderr);
        succeed(folder.path(), &["verify", "o"]);
    }
}

#[test]
fn the_certificate_says_what_was_read_and_what_became_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut texels = vec![[0.5_f32; 3]; 48 * 36];
    // In +Z: one texel of a sun with a hole beside it, as lossy compression leaves them.
    (texels[18 * 48 + 18], texels[18 * 48 + 19]) = ([2000.0; 3], [-3894.0, -1.0, 0.5]);
    write_exr(folder.path(), "cross.exr", [48, 36], &texels, Some(Primaries::ACESCG));
    let small = ["--out", "o", "--size", "16", "--min-size", "8", "--irradiance-size", "4", "--samples", "512"];
    let run =
        succeed(folder.path(), &[&["env", "cross.exr", "--negatives", "clamp", "--to", "acescg"][..], &small].concat());
    assert!(run.stderr.contains("read as a horizontal cross, faces of 12²"), "{}", run.stderr);
    assert!(run.stderr.contains("2 values were below zero (down to -3894) and are zero now"), "{}", run.stderr);
    assert!(run.stderr.contains("changed the flux by up to"), "{}", run.stderr);
    let text = std::fs::read_to_string(folder.path().join("o/certificate.json")).unwrap();
    let certificate: serde_json::Value = serde_json::from_str(&text).unwrap();
    let input = &certificate["input"];
    assert_eq!(
        (input["layout"].as_str(), input["primaries_name"].as_str()),
        (Some("horizontal-cross"), Some("ACEScg"))
    );
    assert_eq!((&input["size"], input["width"].as_u64()), (&serde_json::json!([12, 12]), Some(48)));
    let flux = |key: &str, c: usize| input[key][c].as_f64().unwrap();
    // What the clamp added is the value times its texel's solid angle: (2/12)² / (1 + u² + v²)^(3/2), but for 1 % of the texel's size.
    let added = flux("flux", 0) - flux("flux_found", 0);
    let wanted = 3894.0 / 36.0 / (1.0_f64 + 0.25 * 0.25 + 1.0 / 144.0).powf(1.5);
    assert!((added / wanted - 1.0).abs() < 0.01, "{added}, wanted about {wanted}");
    assert_eq!(flux("flux", 2), flux("flux_found", 2));
    succeed(folder.path(), &["verify", "o"]);
    let bytes = std::fs::read(folder.path().join("o/specular.ktx2")).unwrap();
    assert_eq!(ktx2::decode(&bytes).unwrap().primaries, Primaries::ACESCG);
    assert_eq!(::ktx2::Reader::new(&bytes).unwrap().color_primaries(), Some(::ktx2::ColorPrimaries::ACESCC));
}

#[test]
fn stated_primaries_are_converted_kept_and_written_as_asked() {
    let folder = tempfile::tempdir().unwrap();
    let mut own = Primaries::REC709.chromaticities();
    own[1] = [0.29, 0.6];
    let own = Primaries::new(own).unwrap();
    let texel = [0.25_f32, 0.5, 1.0];
    for stated in [None, Some(Primaries::REC709), Some(Primaries::ACESCG), Some(own)] {
        write_exr(folder.path(), "in.exr", [8, 4], &[texel; 32], stated);
        let from = stated.unwrap_or_default();
        for to in [TargetColour::Rec709, TargetColour::AcesCg, TargetColour::Keep] {
            let reading = Reading { to, ..Reading::default() };
            let (panorama, report) = load(folder.path().join("in.exr").to_str().unwrap(), &reading).unwrap();
            let primaries = to.primaries(from);
            // EXR holds chromaticities as f32.
            let near = |a: Primaries, b: Primaries| {
                let pairs = a.chromaticities().concat().into_iter().zip(b.chromaticities().concat());
                pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-7)
            };
            assert!(near(panorama.primaries(), primaries) && report.primaries == panorama.primaries());
            let wanted = from.conversion_to(&primaries) * glam::DVec3::from_array(texel.map(f64::from));
            for (got, wanted) in panorama.texels()[5].into_iter().zip(wanted.to_array()) {
                assert!((f64::from(got) - wanted).abs() < 1e-6, "{from} to {primaries}: {got}, wanted {wanted}");
            }
            let luminance = panorama.luminance(panorama.mean());
            let found = from.luminance_weights().into_iter().zip(texel).map(|(w, v)| w * f64::from(v)).sum::<f64>();
            let change = (luminance / found - 1.0).abs();
            assert!(change < 0.05, "adaptation moves the luminance of a blue a little, not by {change}");
        }
    }
    let zeros = "#?RADIANCE\nPRIMARIES=0 0 0 0 0 0 0 0\n\n-Y 4 +X 8\n";
    let bytes = [zeros.as_bytes(), &[128, 64, 32, 129].repeat(32)].concat();
    assert_eq!(kiln::format::hdr::decode(&bytes).unwrap().primaries, None);
    // A Radiance header says the same; primaries without a name stand in a cube's metadata.
    let header =
        "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nPRIMARIES= 0.64 0.33 0.29 0.60 0.15 0.06 0.3127 0.329\n\n-Y 4 +X 8\n";
    std::fs::write(folder.path().join("in.hdr"), [header.as_bytes(), &[128, 64, 32, 129].repeat(32)].concat()).unwrap();
    let small = ["--out", "o", "--size", "8", "--min-size", "4", "--irradiance-size", "4", "--samples", "256"];
    succeed(folder.path(), &[&["env", "in.hdr", "--to", "keep"][..], &small].concat());
    let bytes = std::fs::read(folder.path().join("o/irradiance.ktx2")).unwrap();
    assert_eq!(::ktx2::Reader::new(&bytes).unwrap().color_primaries(), None);
    assert_eq!(ktx2::decode(&bytes).unwrap().primaries, own);
    let run = succeed(folder.path(), &[&["env", "in.hdr"][..], &small].concat());
    assert!(run.stderr.contains("converted from red (0.6400, 0.3300), green (0.2900"), "{}", run.stderr);
}

#[test]
fn saturated_colours_leave_the_gamut_and_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    write_exr(folder.path(), "green.exr", [8, 4], &[[0.0, 1.0, 0.0]; 32], Some(Primaries::ACESCG));
    let path = folder.path().join("green.exr");
    let with = |negatives| load(path.to_str().unwrap(), &Reading { negatives, ..Reading::default() }).unwrap();
    let (kept, report) = with(Negatives::Keep);
    assert_eq!((report.negative, report.out_of_gamut), (0, 64));
    assert!(kept.min()[0] < -0.5 && report.flux_found[0] < -6.0);
    let (clamped, report) = with(Negatives::Clamp);
    assert_eq!((clamped.min()[0], report.out_of_gamut, report.flux[0]), (0.0, 64, 0.0));
}

/// What an EXR may hold: RGB by name among others, in one layer, luminance alone; the rest is refused in one line.
#[test]
fn openexr_channels_are_found_by_name_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.exr");
    let read = |channels: &[&str]| {
        let texels = (0..32).flat_map(|_| (0..channels.len()).map(|c| c as f32)).collect();
        let image: Image = Image::new(8, 4, channels, texels).unwrap();
        std::fs::write(&path, exr::encode(&image, Number::F16).unwrap().0).unwrap();
        load(path.to_str().unwrap(), &Reading::default()).map(|(panorama, _)| panorama.texels()[9])
    };
    // Channels are numbered as given.
    assert_eq!(read(&["A", "B", "G", "R", "Z", "albedo.R"]).unwrap(), [3.0, 2.0, 1.0]);
    assert_eq!(read(&["sky.A", "sky.B", "sky.G", "sky.R"]).unwrap(), [3.0, 2.0, 1.0]);
    assert_eq!(read(&["A", "Y"]).unwrap(), [1.0; 3]);
    assert_eq!(read(&["depth"]).unwrap(), [0.0; 3]);
    for (channels, part) in [
        (&["R", "G"][..], "no colour among the channels"),
        (&["R", "G", "alpha"], "no colour among the channels"),
        (&["a.R", "a.G", "a.B", "b.R", "b.G", "b.B"], "colour in 2 layers (a, b)"),
    ] {
        let error = read(channels).unwrap_err().to_string();
        assert!(error.contains("map.exr") && error.contains(part) && error.contains("; save"), "{error}");
    }
}

#[test]
fn values_that_are_not_finite_are_told_with_their_face() {
    let folder = tempfile::tempdir().unwrap();
    let mut texels = vec![[1.0_f32; 3]; 24 * 4];
    texels[24 + 9][1] = f32::NAN;
    write_exr(folder.path(), "strip.exr", [24, 4], &texels, None);
    let error = read(folder.path(), "strip.exr", InputLayout::Auto).unwrap_err().to_string();
    assert!(error.contains("green of texel (1, 1) of face +Y; repair"), "{error}");
    let reading = Reading { nonfinite: NonFinite::Zero, ..Reading::default() };
    let (_, report) = load(folder.path().join("strip.exr").to_str().unwrap(), &reading).unwrap();
    assert_eq!(report.nonfinite, 1);
}
