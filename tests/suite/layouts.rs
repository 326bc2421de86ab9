//! Environments as octahedral maps and as panoramas: baked, read back, judged.

use crate::support::kiln::{fail, kiln, succeed};
use kiln::certificate::{Certificate, KEY};
use kiln::environment::{SphereLayout, SphereMap, builtin};
use kiln::format::{Decoded, Texture, ktx2};
use std::path::Path;

/// A small chain of `builtin:sun` in a folder of its layout's name, with more arguments.
fn bake(folder: &Path, layout: &str, arguments: &[&str]) -> Certificate {
    let usual = ["env", "builtin:sun", "--layout", layout, "--out", layout, "--json"];
    let sizes = ["--size", "32", "--min-size", "8", "--irradiance-size", "8"];
    let sizes = match (arguments.contains(&"--size"), arguments.contains(&"--irradiance-size")) {
        (false, _) => &sizes[..],
        (true, false) => &sizes[4..],
        (true, true) => &[],
    };
    let run = succeed(folder, &[&usual[..], sizes, arguments].concat());
    Certificate::from_json(&run.stdout).expect("a certificate")
}

#[test]
fn every_texel_of_every_layout_is_the_full_sum_in_its_direction() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (layout, format, turn) in [
        ("octahedral", "ktx2:rgba32f", "x,y,z"),
        ("octahedral", "dds:rgba16f", "-z,x,-y"),
        ("equirect", "ktx2:rgb9e5+zstd", "x,y,z"),
        ("equirect", "ktx1:rgba16f", "z,y,-x"),
        ("octahedral", "ktx2:bc6h", "x,z,y"),
    ] {
        let sizes: &[&str] = if format == "dds:rgba16f" { &["--size", "15", "--roughness", "0,0.4,1"] } else { &[] };
        let certificate = bake(folder, layout, &[&["--format", format, "--orientation", turn][..], sizes].concat());
        let own: SphereLayout = layout.parse().unwrap();
        assert_eq!(certificate.environment.as_ref().unwrap().layout, own);
        let extension = format.split_once(':').unwrap().0.replace("ktx1", "ktx");
        for name in ["specular", "irradiance"] {
            let file = format!("{layout}/{name}.{extension}");
            let run = succeed(folder, &["verify", "--full", &file]);
            assert!(run.stdout.contains(&format!("as {}", own.article())), "{}", run.stdout);
            assert!(run.stdout.contains("full sum at every texel"), "{}", run.stdout);
            let info = succeed(folder, &["info", &file]).stdout;
            let size = certificate.levels.iter().find(|level| level.name.starts_with(name)).unwrap().size;
            // What a file that says no more than its width and height tells.
            let ([width, height], _) = own.shape(size);
            assert!(info.contains(&own.size_text(size)) || info.contains(&format!("{width} × {height}")), "{info}");
        }
        // What harmonics leave. (What a shader sees between so few texels, at the rim of a lone sun's light, is of the size of the value itself.)
        for level in certificate.levels.iter().filter(|level| level.roughness > 0.0) {
            assert!(level.max_error <= 1e-4, "{layout}, {}: {}", level.name, level.max_error);
        }
        let last = certificate.levels.iter().rfind(|level| level.name.starts_with("specular")).unwrap();
        let lookup = last.lookup.as_ref().unwrap();
        assert!((1e-5..10.0).contains(&lookup.rms), "{layout} {turn}: {lookup:?}");
    }
}

#[test]
fn a_map_that_is_turned_otherwise_than_it_says_fails() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (layout, turn) in [("octahedral", "y,x,z"), ("equirect", "-z,y,x")] {
        bake(folder, layout, &["--format", "ktx2:rgba32f"]);
        let path = folder.join(layout).join("specular.ktx2");
        let texture = ktx2::decode(&std::fs::read(&path).unwrap()).unwrap();
        let mut certificate = Certificate::from_json(texture.metadata(KEY).unwrap()).unwrap();
        certificate.environment.as_mut().unwrap().orientation = turn.parse().unwrap();
        let mut metadata = texture.metadata.clone();
        metadata.iter_mut().find(|(key, _)| key == KEY).unwrap().1 = certificate.to_json().unwrap();
        std::fs::write(&path, ktx2::encode(&Texture { metadata, ..texture }).unwrap()).unwrap();
        let run = kiln(folder, &["verify", path.to_str().unwrap()]);
        assert_eq!(run.code, 3, "{layout}: {}", run.stdout);
        for name in ["exact area average at every texel", "full sum at"] {
            assert!(run.stdout.lines().any(|line| line.starts_with("FAIL") && line.contains(name)), "{}", run.stdout);
        }
    }
}

#[test]
fn one_level_fits_a_picture_and_a_chain_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (layout, format) in [("octahedral", "hdr"), ("equirect", "exr:f16"), ("octahedral", "png:rgbm")] {
        let file = format!("{layout}/specular.{}", format.split(':').next().unwrap());
        bake(folder, layout, &["--size", "16", "--roughness", "0.5", "--format", format]);
        let run = succeed(folder, &["verify", "--full", &file]);
        assert!(run.stdout.contains("at roughness 0.5"), "{}", run.stdout);
    }
    let chain = |arguments: &[&str]| fail(folder, &[&["env", "builtin:sky", "--out", "x"], arguments].concat(), 2);
    assert!(chain(&["--layout", "equirect", "--format", "hdr"]).contains("which holds one picture; use ktx2"));
    assert!(
        chain(&["--layout", "octahedral", "--format", "env"]).contains("an octahedral map of colours does not fit env")
    );
    assert!(
        chain(&["--layout", "cube", "--roughness", "0", "--format", "hdr"])
            .contains("a cube of colours does not fit hdr")
    );
    let turned =
        fail(folder, &["env", "builtin:sky", "--out", "x", "--layout", "equirect", "--orientation", "x,z,y"], 1);
    assert!(turned.contains("whose poles are not up and down; use an orientation with y in its place"), "{turned}");
}

#[test]
fn every_integrator_and_the_fit_know_every_layout() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let of = |certificate: &Certificate| certificate.levels[1].lookup.as_ref().unwrap().rms;
    for layout in ["octahedral", "equirect"] {
        // A lone sun's light has a rim: coarser levels are off by more than verification believes of a fit.
        let small = ["--size", "64", "--irradiance-size", "32", "--roughness", "0,0.6", "--format", "ktx2:rgba32f"];
        let exact = bake(folder, layout, &small);
        let [specular, irradiance] = ["specular", "irradiance"].map(|name| format!("{layout}/{name}.ktx2"));
        for more in [&["--integrator", "quadrature"][..], &["--samples", "256", "--integrator", "monte-carlo"]] {
            let certificate = bake(folder, layout, &[&small, more].concat());
            assert_eq!(certificate.levels[1].integrator, more.last().unwrap().to_owned());
            succeed(folder, &["verify", &specular, &irradiance]);
        }
        let fitted = bake(folder, layout, &[&small[..], &["--fit", "lookup"]].concat());
        succeed(folder, &["verify", &specular, &irradiance]);
        let fit = fitted.levels[1].fit.as_ref().unwrap();
        assert!(fit.kept && fit.fitted.rms < 0.8 * fit.exact.rms, "{layout}: {fit:?}");
        assert!((fit.exact.rms / of(&exact) - 1.0).abs() < 1e-3, "{layout}: {fit:?} beside {}", of(&exact));
    }
}

#[test]
fn white_is_one_everywhere_and_the_mean_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (layout, size) in [("octahedral", "9"), ("equirect", "12")] {
        succeed(
            folder,
            &["env", "builtin:white", "--layout", layout, "--out", layout, "--size", size, "--roughness", "0,0.3,1"],
        );
        let bytes = std::fs::read(folder.join(layout).join("specular.ktx2")).unwrap();
        let texture = ktx2::decode(&bytes).unwrap();
        assert!((0..3).all(|level| texture.values(level).iter().all(|&v| v == 1.0)), "{layout}");
    }
    let sky = builtin("sun", 64).unwrap();
    for layout in SphereLayout::ALL {
        let map = SphereMap::area_average(&sky, layout, 24, &"z,y,-x".parse().unwrap()).unwrap();
        for c in 0..3 {
            assert!((map.mean()[c] / sky.mean()[c] - 1.0).abs() < 6e-8, "{layout}: {:?}", map.mean());
        }
    }
}

#[test]
fn convert_tells_an_octahedral_map_by_its_certificate_or_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    bake(folder, "octahedral", &["--format", "ktx2:rgba32f"]);
    let convert = |arguments: &[&str]| succeed(folder, &[&["convert"], arguments].concat()).stdout;
    let said = convert(&["octahedral/specular.ktx2", "pano.exr", "--level", "0", "--shape", "panorama"]);
    assert!(
        said.contains("the mean over the sphere changed by") && said.contains("a bilinear lookup is off"),
        "{said}"
    );
    let Decoded::Picture(image, _) = kiln::format::read(&folder.join("pano.exr")).unwrap() else { panic!("a picture") };
    assert_eq!([image.width, image.height], [128, 64]);
    convert(&["pano.exr", "square.exr", "--shape", "octahedral", "--size", "32"]);
    // A picture says nothing of what it is.
    convert(&["square.exr", "cube.ktx2", "--from", "octahedral", "--shape", "cube", "--format", "ktx2:rgba32f"]);
    let cube = ktx2::decode(&std::fs::read(folder.join("cube.ktx2")).unwrap()).unwrap();
    assert_eq!((cube.faces, cube.width), (6, 32));
    // Nor does a surface, which has no place for its certificate: that stands beside it.
    bake(folder, "octahedral", &["--format", "dds:rgb32f"]);
    assert!(succeed(folder, &["info", "octahedral/specular.dds"]).stdout.contains("certificate: Kiln"));
    convert(&["octahedral/specular.dds", "again.exr", "--level", "0", "--shape", "panorama"]);
    succeed(folder, &["compare", "again.exr", "pano.exr", "--tolerance", "0"]);
    let refused = |arguments: &[&str]| fail(folder, &[&["convert"], arguments].concat(), 2);
    assert!(refused(&["cube.ktx2", "x.hdr", "--size", "8"]).contains("--size without --shape"));
    assert!(refused(&["cube.ktx2", "x.ktx2", "--shape", "cube"]).contains("a cube that is to become a cube"));
}
