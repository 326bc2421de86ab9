//! Several tables in the layers of one array texture.

use crate::support::kiln::{fail, kiln, listing, succeed};
use kiln::certificate::{Certificate, LAYERS_KEY};
use kiln::format::{Texture, ktx2};
use std::path::Path;

/// A DFG, and a table of one quantity, over other axes of the same sizes.
const RECIPE: &str = r#"
recipe = 1
shader = ["glsl", "wgsl"]

[[array]]
file = "tables.ktx2"
format = "ktx2:rgba16f+zstd"

[[array.layer]]
name = "dfg"
channels = ["ggx.scale", "ggx.bias"]
axes = ["mu:16", "roughness:8"]

[[array.layer]]
name = "glass"
channels = ["fresnel.dielectric"]
axes = ["mu:16:sqrt", "eta:8:1..2"]
"#;

fn bake(folder: &Path, recipe: &str) {
    std::fs::write(folder.join("recipe.toml"), recipe).expect("a folder to write to");
    succeed(folder, &["bake", "recipe.toml", "--out", "."]);
}

#[test]
fn each_layer_is_the_table_that_it_would_be_alone() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    bake(folder, RECIPE);
    let texture = ktx2::decode(&std::fs::read(folder.join("tables.ktx2")).unwrap()).unwrap();
    assert_eq!([texture.width, texture.height, texture.array_layers], [16, 8, 2]);
    for (i, table) in [
        ["dfg", "mu:16,roughness:8", "ggx.scale,ggx.bias"],
        ["fresnel-dielectric", "mu:16:sqrt,eta:8:1..2", "fresnel.dielectric"],
    ]
    .into_iter()
    .enumerate()
    {
        let [name, axes, channels] = table;
        let arguments = ["--axes", axes, "--channels", channels, "--format", "ktx2:rgba16f", "-o", "alone.ktx2"];
        succeed(folder, &[&["table", name][..], &arguments].concat());
        let alone = ktx2::decode(&std::fs::read(folder.join("alone.ktx2")).unwrap()).unwrap();
        assert_eq!(texture.picture(0, i), alone.picture(0, 0), "layer {i}");
    }
    let verified = succeed(folder, &["verify", "tables.ktx2"]).stdout;
    for text in
        ["layer 0: table of ggx.scale, ggx.bias", "layer 1: table of fresnel.dielectric", "layer 1: fresnel.dielectric"]
    {
        assert!(verified.contains(text), "{verified}");
    }
    let info = succeed(folder, &["info", "tables.ktx2"]).stdout;
    assert!(
        info.contains("2 layers") && info.contains("layer 1, glass.ktx2") && !info.contains("no certificate"),
        "{info}"
    );
    // The certificates stand beside it, too, and the folder is verified once.
    let names = listing(folder);
    for name in ["tables.dfg.certificate.json", "tables.glass.certificate.json", "lookup.glsl", "lookup.wgsl"] {
        assert!(names.iter().any(|n| n == name), "{names:?}");
    }
    std::fs::remove_file(folder.join("alone.ktx2")).unwrap();
    std::fs::remove_file(folder.join("alone.ktx2.certificate.json")).unwrap();
    assert_eq!(succeed(folder, &["verify", "."]).stdout.matches("array of layer 0").count(), 1);

    let code = std::fs::read_to_string(folder.join("lookup.glsl")).unwrap();
    assert!(code.contains("textureLod(table, vec3(at, 1.0), 0.0)") && code.contains("glass_lookup"), "{code}");
    let printed = succeed(folder, &["shader", "tables.ktx2", "--language", "wgsl"]).stdout;
    assert!(printed.contains("textureSampleLevel(table, table_sampler, at, 0, 0.0)"), "{printed}");
    naga::front::wgsl::parse_str(&printed).unwrap();
}

#[test]
fn a_layer_that_is_not_what_it_says_fails_and_what_cannot_be_an_array_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    bake(folder, RECIPE);
    let path = folder.join("tables.ktx2");
    let texture = ktx2::decode(&std::fs::read(&path).unwrap()).unwrap();
    // The layers exchanged: each is then judged as the other.
    let mut levels = texture.levels.clone();
    let half = levels[0].len() / 2;
    levels[0].rotate_left(half);
    std::fs::write(&path, ktx2::encode(&Texture { levels, ..texture.clone() }).unwrap()).unwrap();
    let run = kiln(folder, &["verify", "tables.ktx2"]);
    assert_eq!(run.code, 3);
    assert!(run.stdout.contains("FAIL") && run.stdout.contains("layer 1"), "{}", run.stdout);
    // One certificate for two layers.
    let one = Certificate::list_from_json(texture.metadata(LAYERS_KEY).unwrap()).unwrap().swap_remove(0);
    let metadata = vec![(LAYERS_KEY.to_owned(), Certificate::list_to_json(&[one]).unwrap())];
    std::fs::write(&path, ktx2::encode(&Texture { metadata, ..texture }).unwrap()).unwrap();
    assert!(fail(folder, &["verify", "tables.ktx2"], 1).contains("and 1 certificates; bake the file again"));

    let refused = |from: &str, to: &str| {
        assert!(RECIPE.contains(from));
        std::fs::write(folder.join("bad.toml"), RECIPE.replace(from, to)).unwrap();
        kiln(folder, &["bake", "bad.toml", "--out", "bad"]).stderr
    };
    assert!(refused("eta:8", "eta:4").contains("dfg is 16 × 8, and glass is 16 × 4; give the axes of all layers"));
    assert!(refused("ktx2:rgba16f+zstd", "exr:f16").contains("exr:f16 has no array textures; use ktx2"));
    assert!(refused("\"glass\"", "\"dfg\"").contains("is no name of its own for a layer"));
    assert!(refused("tables.ktx2", "../tables.ktx2").contains("leads out of the output folder"));
}

/// A DirectDraw surface has no place for certificates: those beside it count.
#[test]
fn an_array_is_known_by_the_certificates_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    bake(folder, &RECIPE.replace("tables.ktx2", "tables.dds").replace("ktx2:rgba16f+zstd", "dds:rgba16f"));
    let verified = succeed(folder, &["verify", "tables.dds"]).stdout;
    assert!(verified.contains("layer 1: table of fresnel.dielectric"), "{verified}");
    assert_eq!(succeed(folder, &["verify", "."]).stdout.matches("array of layer 0").count(), 1);
    let info = succeed(folder, &["info", "tables.dds"]).stdout;
    assert!(info.contains("layer 1, glass.dds") && !info.contains("no certificate"), "{info}");
    assert!(succeed(folder, &["shader", "tables.dds"]).stdout.contains("glass_lookup"));
    // One texel of the second layer is another.
    let path = folder.join("tables.dds");
    let mut bytes = std::fs::read(&path).unwrap();
    let n = bytes.len();
    bytes[n - 8] ^= 0x40;
    std::fs::write(&path, bytes).unwrap();
    let run = kiln(folder, &["verify", "tables.dds"]);
    assert_eq!(run.code, 3, "{}", run.stdout);
    // One layer's certificate alone says nothing of two.
    std::fs::remove_file(folder.join("tables.dfg.certificate.json")).unwrap();
    assert!(succeed(folder, &["info", "tables.dds"]).stdout.contains("no certificate"));
}
