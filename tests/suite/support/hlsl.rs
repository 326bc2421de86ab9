//! HLSL that is run: compiled to SPIR-V by glslang, turned into GLSL by SPIRV-Cross, for the page that runs GLSL.

use super::tools;
use std::path::Path;
use std::process::Command;

/// An expression of GLSL whose textures go with their samplers, as in WGSL and HLSL.
pub fn with_samplers(glsl: &str, textures: &[&str]) -> String {
    let mut code = glsl.to_owned();
    for name in textures {
        code = code.replace(&format!("({name},"), &format!("({name}, {name}_sampler,"));
        code = code.replace(&format!(" {name},"), &format!(" {name}, {name}_sampler,"));
    }
    code
}

/// A few expressions and declarations of GLSL in HLSL.
pub fn as_hlsl(glsl: &str, textures: &[&str]) -> String {
    with_samplers(glsl, textures).replace("vec", "float")
}

/// The fragment shader of GLSL ES that HLSL becomes, its textures by their names; nothing where a compiler is missing, which is said.
pub fn as_glsl(code: &str, value: &str, textures: &[(&str, &str)]) -> Option<String> {
    let mut declared = "Texture2D<float4> points;\n".to_owned();
    for (name, kind) in textures {
        let kind = match *kind {
            "2d" | "panorama" => "Texture2D",
            "3d" => "Texture3D",
            "array" => "Texture2DArray",
            _ => "TextureCube",
        };
        declared += &format!("{kind}<float4> {name};\nSamplerState {name}_sampler;\n");
    }
    let names: Vec<&str> = textures.iter().map(|(name, _)| *name).collect();
    // HLSL has no array in an expression.
    let (mut value, mut hoisted) = (value.to_owned(), String::new());
    if let Some((before, after)) = value.clone().split_once("vec3[9](") {
        let end = closing(after);
        hoisted = format!("static const float3 given[9] = {{ {} }};\n", as_hlsl(&after[..end], &[]));
        value = format!("{before}given{}", &after[end + 1..]);
    }
    let source = format!(
        "{declared}{hoisted}{code}\nfloat4 main(float4 at : SV_Position) : SV_Target {{\n    float4 p = points.Load(int3(int(at.x), 0, 0));\n    \
         return {};\n}}\n",
        as_hlsl(&value, &names)
    );
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("main.hlsl"), &source).expect("a file");
    let flags = ["-D", "-V", "-S", "frag", "-e", "main", "--amb", "-o", "main.spv", "main.hlsl"];
    ran("glslangValidator", &flags, folder.path(), &source)?;
    let mut glsl = ran("spirv-cross", &["--es", "--version", "300", "main.spv"], folder.path(), &source)?;
    for name in &names {
        glsl = glsl.replace(&format!("SPIRV_Cross_Combined{name}{name}_sampler"), name);
    }
    glsl = glsl.replace("SPIRV_Cross_CombinedpointsSPIRV_Cross_DummySampler", "points");
    Some(glsl.replace("precision mediump float;", "precision highp float;"))
}

/// Where the bracket closes that was opened before `text`.
fn closing(text: &str) -> usize {
    let mut depth = 1;
    for (i, letter) in text.char_indices() {
        depth += i32::from(letter == '(') - i32::from(letter == ')');
        if depth == 0 {
            return i;
        }
    }
    text.len()
}

/// What a program prints, which must take its input; nothing where it does not start.
fn ran(program: &str, flags: &[&str], folder: &Path, source: &str) -> Option<String> {
    let output = match Command::new(program).args(flags).current_dir(folder).output() {
        Ok(output) => output,
        Err(e) => {
            tools::skip(&format!("{program} does not start: {e}"));
            return None;
        }
    };
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{program}: {said}\n{source}");
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}
