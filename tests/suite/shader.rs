//! The shader code that Kiln emits: it compiles in every language, and computes what the library does.

#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

use crate::support::bilinear::sample;
use crate::support::f32_error::{ULP, evaluate};
use crate::support::samples::Random;
use crate::support::{browser, hlsl, tools};
use kiln::certificate::Certificate;
use kiln::environment::Orientation;
use kiln::environment::spherical_harmonics::SphericalHarmonics;
use kiln::format::{Decoded, decode};
use kiln::integrate::quadrature::ggx_reflection;
use kiln::integrate::{Integration, Settings};
use kiln::language::Language;
use kiln::math::expression::Expression;
use kiln::math::warp::Warp;
use kiln::model::fresnel::f82_tint;
use kiln::recipe::{EnvironmentRecipe, TableRecipe};
use kiln::shader::{Shader, level_of_roughness};
use kiln::table::named::TABLES;
use kiln::table::{Axis, Point, TableSpec, quantity};
use std::collections::HashMap;
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

/// The parts of axes that each warp can have: how it is written, in which range.
fn every_axis(parameter: &str, size: usize) -> Vec<String> {
    let mut axes = vec![];
    for warp in Warp::ALL.map(|w| if w == (Warp::Log { offset: 0.0 }) { Warp::Log { offset: 0.05 } } else { w }) {
        if warp == Warp::F0FourthRoot {
            continue; // of an index of refraction only
        }
        for sampling in ["centre", "edge"] {
            for flip in ["", ":flip"] {
                axes.push(format!("{parameter}:{size}:{warp}:{sampling}{flip}"));
            }
        }
    }
    axes
}

fn every_axis_of_an_index(size: usize) -> Vec<String> {
    let mut axes = vec![];
    for range in ["1.1..2.5:linear", "0.4..0.9:log", "1..3:f0-fourth-root", "0.3..1:f0-fourth-root", "f0-fourth-root"] {
        for sampling in ["centre", "edge"] {
            axes.extend(["", ":flip"].map(|flip| format!("eta:{size}:{range}:{sampling}{flip}")));
        }
    }
    axes
}

fn recipe(channels: &[&str], axes: &[String], format: &str, layout: Option<&str>) -> TableRecipe {
    let mut recipe = TableRecipe::named("dfg", format.parse().unwrap()).unwrap();
    recipe.channels = channels.iter().map(|&c| c.to_owned()).collect();
    recipe.axes = axes.iter().map(|a| a.parse().unwrap()).collect();
    recipe.layout = layout.map(|l| l.parse().unwrap());
    recipe
}

fn shader_of(name: &str, recipe: TableRecipe) -> Shader {
    Shader::of_table(name, &Certificate { table: Some(recipe), ..Certificate::new() }).unwrap()
}

/// Tables of one to three axes with every warp, sampling and flip, in every layout; every named table; chains.
fn every_shader() -> Vec<Shader> {
    let mut recipes = vec![];
    for axis in every_axis("f0", 16) {
        recipes.push(recipe(&["fresnel.schlick_avg"], &[axis], "ktx2:r16f", None));
    }
    for axis in every_axis_of_an_index(16) {
        recipes.push(recipe(&["fresnel.dielectric_avg"], &[axis], "exr:f32", None));
    }
    let axes = |p: &str| every_axis(p, 8).into_iter();
    for ((mu, roughness), rho) in axes("mu").zip(axes("roughness").rev()).zip(axes("rho").cycle().skip(9)) {
        let two = [mu, roughness];
        recipes.push(recipe(&["ggx.scale", "ggx.bias", "ggx.f82"], &two, "ktx2:rgba16f", None));
        let three = [two.as_slice(), &[rho]].concat();
        for (format, layout) in
            [("ktx2:r16f", None), ("ktx2:r32f", Some("atlas:3")), ("exr:f32", None), ("exr:f16", Some("atlas"))]
        {
            recipes.push(recipe(&["eon.albedo"], &three, format, layout));
        }
    }
    for format in ["png:rgbm", "png:rgbp", "png:rgbd"] {
        let axes = ["mu:8".to_owned(), "roughness:8".to_owned(), "rho:4".to_owned()];
        recipes.push(recipe(&["ggx.scale", "ggx.bias"], &axes[..2], format, None));
        recipes.push(recipe(&["eon.albedo"], &axes, format, Some("atlas")));
    }
    for table in TABLES {
        recipes.push(TableRecipe::named(table.name, "exr:f32".parse().unwrap()).unwrap());
    }
    let tables = recipes.into_iter().enumerate().map(|(i, r)| shader_of(&format!("table_{i}"), r));
    let chains = chains().into_iter().enumerate().map(|(i, roughness)| chain_shader(&format!("chain_{i}"), &roughness));
    let layer = Certificate {
        table: Some(recipe(
            &["ggx.scale", "ggx.bias"],
            &["mu:8".to_owned(), "roughness:8".to_owned()],
            "ktx2:rgbd",
            None,
        )),
        layer: Some(3),
        ..Certificate::new()
    };
    let layer = Shader::of_table("layer", &layer).unwrap();
    tables.chain(chains).chain(environments()).chain([layer]).collect()
}

/// A chain for each way in which engines have irradiance, packed and turned in several ways.
fn environments() -> Vec<Shader> {
    use kiln::environment::SphereLayout;
    use kiln::recipe::IrradianceKind::{Cube, LastLevel, None as Nothing, Sh};
    let kinds = [
        (Cube, "env", Some("ktx2:rgb9e5"), "-x,y,z"),
        (Cube, "ktx2:rgba16f", Some("dds:bc6h"), "x,y,-z"),
        (LastLevel, "env", None, "y,z,x"),
        (Sh, "dds:bc6h", None, "-z,x,-y"),
        (Nothing, "ktx2:rgba16f", None, "x,z,y"),
    ];
    let shader = |(i, (irradiance, format, own, orientation)): (usize, (_, &str, Option<&str>, &str))| {
        let recipe = EnvironmentRecipe {
            irradiance,
            format: format.parse().unwrap(),
            irradiance_format: own.map(|f| f.parse().unwrap()),
            orientation: orientation.parse().unwrap(),
            ..EnvironmentRecipe::new("builtin:sky")
        };
        environment_shader(&format!("environment_{i}"), recipe)
    };
    let flat = |(i, (layout, format, own)): (usize, (SphereLayout, &str, Option<&str>))| {
        let recipe = EnvironmentRecipe {
            layout,
            format: format.parse().unwrap(),
            irradiance: [Cube, LastLevel][i % 2],
            irradiance_format: own.map(|f| f.parse().unwrap()),
            orientation: "z,y,-x".parse().unwrap(),
            ..EnvironmentRecipe::new("builtin:sky")
        };
        environment_shader(&format!("flat_{i}"), recipe)
    };
    let flats = [
        (SphereLayout::Octahedral, "ktx2:rgbm", Some("ktx2:rgb9e5")),
        (SphereLayout::Octahedral, "ktx2:rgba16f", None),
        (SphereLayout::Equirect, "ktx2:rgbd", Some("exr:f16")),
        (SphereLayout::Equirect, "dds:bc6h", None),
    ];
    let atlas = environment_shader("atlas", atlas_recipe());
    kinds.into_iter().enumerate().map(shader).chain(flats.into_iter().enumerate().map(flat)).chain([atlas]).collect()
}

/// What PlayCanvas reads.
fn atlas_recipe() -> EnvironmentRecipe {
    kiln::engine::find("playcanvas").unwrap().environment_recipe("builtin:sky", false).unwrap().unwrap()
}

fn environment_shader(name: &str, recipe: EnvironmentRecipe) -> Shader {
    let certificate = Certificate { environment: Some(recipe), ..Certificate::new() };
    Shader::of_environment(name, &certificate, Some(&SH)).unwrap()
}

/// Even, as Filament has it, uneven, with two equal levels, of one level.
fn chains() -> Vec<Vec<f64>> {
    let quadratic = (0..5).map(|m| 1.0 - (1.0 - f64::from(m) / 4.0).sqrt()).collect();
    vec![vec![0.0, 0.25, 0.5, 0.75, 1.0], quadratic, vec![0.1, 0.2, 0.6, 0.9], vec![0.0, 0.5, 0.5, 1.0], vec![0.5]]
}

/// The coefficients of an environment, computed once.
static SH: LazyLock<SphericalHarmonics> = LazyLock::new(|| {
    let panorama = kiln::environment::builtin("gradient", 64).unwrap();
    kiln::environment::spherical_harmonics::project(&panorama)
});

fn chain_shader(name: &str, roughness: &[f64]) -> Shader {
    environment_shader(
        name,
        EnvironmentRecipe { roughness: Some(roughness.to_vec()), ..EnvironmentRecipe::new("builtin:sky") },
    )
}

fn all_code(language: Language) -> String {
    kiln::shader::combined(&every_shader(), language)
}

#[test]
fn every_piece_of_wgsl_is_valid_to_naga() {
    let code = all_code(Language::Wgsl);
    let module = naga::front::wgsl::parse_str(&code).unwrap_or_else(|e| panic!("{}", e.emit_to_string(&code)));
    assert!(module.functions.len() > 400, "only {} functions", module.functions.len());
    validate(&module);
}

/// The names that textures have in what is emitted, none after one that it begins with.
const TEXTURES: [&str; 6] = ["table0", "table1", "table", "specular", "irradiance", "map"];

#[test]
fn every_piece_of_glsl_is_valid_to_naga() {
    // naga knows textures apart from their samplers only, as Vulkan can have them.
    let mut code = all_code(Language::Glsl);
    for (kind, dimension) in ["2DArray", "2D", "3D", "Cube"].map(|kind| (kind, kind)) {
        for name in TEXTURES {
            let parameter = format!("texture{dimension} {name}, sampler {name}_sampler");
            code = code.replace(&format!("highp sampler{kind} {name}"), &parameter);
        }
    }
    let mut separate = String::new();
    let mut kind = "2D";
    for line in code.lines() {
        kind = ["2DArray", "2D", "3D", "Cube"]
            .into_iter()
            .find(|k| line.contains(&format!("texture{k} ")))
            .unwrap_or(kind);
        let mut line = line.to_owned();
        for name in TEXTURES {
            let sampler = format!("textureLod(sampler{kind}({name}, {name}_sampler),");
            line = line.replace(&format!("textureLod({name},"), &sampler);
            // Handed on, it goes with its sampler.
            line = line.replace(&format!("({name}, at,"), &format!("({name}, {name}_sampler, at,"));
        }
        separate += &(line + "\n");
    }
    let source = format!("#version 450 core\n{separate}\nvoid main() {{}}\n");
    let options = naga::front::glsl::Options::from(naga::ShaderStage::Fragment);
    let module = naga::front::glsl::Frontend::default()
        .parse(&options, &source)
        .unwrap_or_else(|e| panic!("{}", e.emit_to_string(&source)));
    validate(&module);
}

fn validate(module: &naga::Module) {
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    if let Err(e) = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(module) {
        panic!("{e:?}");
    }
}

#[test]
fn every_piece_of_glsl_and_hlsl_compiles_with_glslang() {
    let es = format!("#version 300 es\nprecision highp float;\n{}\nvoid main() {{}}\n", all_code(Language::Glsl));
    let desktop = format!("#version 330 core\n{}\nvoid main() {{}}\n", all_code(Language::Glsl));
    let hlsl = format!("{}\nfloat4 main() : SV_Target {{ return 0.0; }}\n", all_code(Language::Hlsl));
    for (name, code, flags) in
        [("es.frag", es, &[][..]), ("desktop.frag", desktop, &[]), ("hlsl.frag", hlsl, &["-D", "-V", "-e", "main"])]
    {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(name), &code).unwrap();
        if !glslang(folder.path(), flags, name) {
            return;
        }
    }
}

/// Whether the compiler is there; it must then take the file.
fn glslang(folder: &Path, flags: &[&str], file: &str) -> bool {
    let output = match Command::new("glslangValidator").args(flags).arg(file).current_dir(folder).output() {
        Ok(output) => output,
        Err(e) => {
            tools::skip(&format!("glslangValidator does not start: {e}"));
            return false;
        }
    };
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{file}: {said}");
    true
}

/// What a page computes, in GLSL, in WGSL, and in HLSL by way of SPIR-V: one shader, evaluated at points.
struct Case {
    name: String,
    /// Functions, in each language; none in one that is not to be run. (Small cubes are not looked up in WGSL: beside an edge, Chromium's
    /// software WebGPU samples a constant cube of floats as something else than that constant.)
    glsl: String,
    wgsl: String,
    hlsl: String,
    /// The value as a vec4 of the point `p`, four floats, as GLSL has it.
    value: String,
    points: Vec<[f32; 4]>,
    textures: Vec<Texture>,
}

struct Texture {
    name: String,
    kind: &'static str,
    format: String,
    levels: Vec<([usize; 3], Vec<u8>)>,
}

/// A page's code, by its language.
fn in_all(code: impl Fn(Language) -> String) -> [String; 3] {
    [Language::Glsl, Language::Wgsl, Language::Hlsl].map(code)
}

/// `vec4 find(vec4 p)` with that body of GLSL.
fn finder(language: Language, body: &str, textures: &[&str]) -> String {
    match language {
        Language::Wgsl => format!("fn find(p: vec4f) -> vec4f {{ {} }}\n", as_wgsl(body, textures)),
        Language::Hlsl => format!("float4 find(float4 p) {{ {} }}\n", hlsl::as_hlsl(body, textures)),
        _ => format!("vec4 find(vec4 p) {{ {body} }}\n"),
    }
}

/// A few expressions and declarations of GLSL in WGSL, whose textures go with their samplers.
fn as_wgsl(glsl: &str, textures: &[&str]) -> String {
    let code = hlsl::with_samplers(&glsl.replace("vec3[9](", "array<vec3f, 9>("), textures);
    let mut statements: Vec<String> = code.split("; ").map(str::to_owned).collect();
    for statement in &mut statements {
        if let Some((declared, value)) = statement.split_once(" = ")
            && let Some((_, name)) = declared.rsplit_once(' ')
        {
            *statement = format!("let {name} = {value}");
        }
    }
    statements.join("; ")
}

/// A compute shader that evaluates a case at its points.
fn compute(case: &Case) -> String {
    let mut code = "@group(0) @binding(0) var<storage, read> points: array<vec4f>;\n\
                    @group(0) @binding(1) var<storage, read_write> results: array<vec4f>;\n"
        .to_owned();
    for (i, Texture { name, kind, .. }) in case.textures.iter().enumerate() {
        let kind = match *kind {
            "2d" | "panorama" => "2d",
            "array" => "2d_array",
            other => other,
        };
        code += &format!("@group(0) @binding({}) var {name}: texture_{kind}<f32>;\n", 2 + 2 * i);
        code += &format!("@group(0) @binding({}) var {name}_sampler: sampler;\n", 3 + 2 * i);
    }
    let names: Vec<&str> = case.textures.iter().map(|texture| texture.name.as_str()).collect();
    format!(
        "{code}{}@compute @workgroup_size(1)\nfn main(@builtin(global_invocation_id) at: vec3u) {{\n    let p = points[at.x];\n    \
         results[at.x] = {};\n}}\n",
        case.wgsl,
        as_wgsl(&case.value, &names)
    )
}

/// What a language's code computes, by the name of the case.
type Found = HashMap<String, Vec<[f32; 4]>>;

/// The values of all cases in GLSL, and of those that have it in WGSL and in HLSL; nothing where there is no browser.
fn run(cases: &[Case]) -> Vec<Found> {
    let mut files = HashMap::new();
    let mut list = vec![];
    let mut compiles_hlsl = true;
    for case in cases {
        let file = format!("{}.points", case.name);
        files.insert(file.clone(), le_bytes(case.points.as_flattened()));
        let mut samplers = String::new();
        let mut textures = vec![];
        for texture in &case.textures {
            let kind = match texture.kind {
                "2d" | "panorama" => "2D",
                "3d" => "3D",
                "array" => "2DArray",
                _ => "Cube",
            };
            samplers += &format!("uniform highp sampler{kind} {};\n", texture.name);
            let levels: Vec<_> = texture
                .levels
                .iter()
                .enumerate()
                .map(|(i, (size, bytes))| {
                    let file = format!("{}.{}.{i}", case.name, texture.name);
                    files.insert(file.clone(), bytes.clone());
                    serde_json::json!({ "size": size, "file": file })
                })
                .collect();
            let texture = serde_json::json!({ "name": texture.name, "kind": texture.kind, "format": texture.format, "levels": levels });
            textures.push(texture);
        }
        let fragment = format!(
            "#version 300 es\nprecision highp float;\nuniform highp sampler2D points;\n{samplers}out vec4 result;\n{}\nvoid main() \
             {{\n    vec4 p = texelFetch(points, ivec2(gl_FragCoord.x, 0), 0);\n    result = {};\n}}\n",
            case.glsl, case.value
        );
        if compiles_hlsl && !case.hlsl.is_empty() {
            let kinds: Vec<(&str, &str)> = case.textures.iter().map(|t| (t.name.as_str(), t.kind)).collect();
            match hlsl::as_glsl(&case.hlsl, &case.value, &kinds) {
                Some(fragment) => list.push(serde_json::json!({
                    "name": format!("{}.hlsl", case.name), "fragment": fragment, "points": file, "n": case.points.len(), "textures": textures
                })),
                // Without the compilers nothing of HLSL is run, which was said.
                None => compiles_hlsl = false,
            }
        }
        let compute = (!case.wgsl.is_empty()).then(|| compute(case));
        list.push(serde_json::json!({
            "name": case.name, "fragment": fragment, "compute": compute, "points": file, "n": case.points.len(), "textures": textures
        }));
    }
    files.insert("cases.json".to_owned(), serde_json::json!({ "cases": list }).to_string().into_bytes());
    let page = concat!(include_str!("support/webgl.js"), include_str!("support/webgpu.js"));
    let Some(results) = browser::run(page, files) else { return vec![] };
    let values = |bytes: &Vec<u8>| browser::floats(bytes).chunks_exact(4).map(|v| [v[0], v[1], v[2], v[3]]).collect();
    let glsl: Found = cases.iter().map(|case| (case.name.clone(), values(&results[&case.name]))).collect();
    let in_wgsl = |case: &Case| Some((case.name.clone(), values(results.get(&format!("{}.wgsl", case.name))?)));
    let wgsl: Found = cases.iter().filter_map(in_wgsl).collect();
    if wgsl.len() < cases.iter().filter(|case| !case.wgsl.is_empty()).count() {
        tools::skip("the browser has no WebGPU that filters floats");
    }
    let in_hlsl = |case: &Case| Some((case.name.clone(), values(results.get(&format!("{}.hlsl", case.name))?)));
    let hlsl: Found = cases.iter().filter_map(in_hlsl).collect();
    [glsl, wgsl, hlsl].into_iter().filter(|found| !found.is_empty()).collect()
}

fn le_bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Values of a parameter: the ends of its axis, and random ones.
fn along(axis: &Axis, n: usize, random: &mut Random) -> Vec<f32> {
    let (low, high) = axis.ends();
    // Rounding to f32 must not leave the range, and an index of refraction that goes on forever is tried as far as 100.
    let high = high.min(100.0);
    let inside = |x: f64| (x as f32).clamp(low as f32, high as f32);
    (0..n)
        .map(|i| match i {
            0 => inside(low),
            1 => inside(high),
            // Half of them evenly over the texture, where warps are steep.
            _ if i % 2 == 0 => inside(axis.value_at_position(random.unit() * axis.size as f64 - 0.5).min(high)),
            _ => inside(low + random.unit() * (high - low)),
        })
        .collect()
}

const POINTS: usize = 64;

#[test]
fn texture_coordinates_are_those_of_the_axis_to_f32_rounding() {
    let mut random = Random(1);
    let axes: Vec<Axis> = every_axis("mu", 64)
        .into_iter()
        .chain(every_axis("sigma", 7).into_iter().filter(|a| !a.contains("acos") && !a.contains("one-minus")))
        .chain(every_axis_of_an_index(16))
        .flat_map(|a| {
            // Displaced content, as published tables have it, one way and the other.
            let shifted = ["centre", "edge:flip"]
                .iter()
                .position(|end| a.ends_with(end))
                .map(|i| format!("{a}:shift{}", ["+1", "-0.5"][i]));
            [Some(a), shifted]
        })
        .flatten()
        .map(|a| a.parse().unwrap())
        .collect();
    let [mut glsl, mut wgsl, mut hlsl] = [const { String::new() }; 3];
    let mut branches = String::new();
    let mut points = vec![];
    for (i, axis) in axes.iter().enumerate() {
        let parameter = axis.parameter.shader_name();
        let quantity = if parameter == "eta" { "fresnel.dielectric_avg" } else { "fresnel.schlick_avg" };
        let mut recipe = recipe(&[quantity], &[axis.to_string()], "ktx2:r32f", None);
        if parameter != "eta" {
            // A quantity of one parameter; the axis is that of the other one.
            recipe.channels = vec![if parameter == "NoV" { "lambert.albedo" } else { "oren-nayar.albedo" }.to_owned()];
            if parameter == "sigma" {
                recipe.at = Point::default().with(kiln::table::Parameter::Mu, 0.5).unwrap();
            }
        }
        let shader = shader_of(&format!("axis_{i}"), recipe);
        glsl += &shader.to_text(Language::Glsl);
        wgsl += &shader.to_text(Language::Wgsl);
        hlsl += &shader.to_text(Language::Hlsl);
        branches += &format!("if (p.y == {i}.0) {{ return axis_{i}_coordinate(p.x); }}\n");
        points.extend(along(axis, POINTS, &mut random).into_iter().map(|x| [x, i as f32, 0.0, 0.0]));
    }
    glsl += &format!("vec2 find(vec4 p) {{\n{branches}return vec2(-1.0);\n}}\n");
    wgsl += &format!("fn find(p: vec4f) -> vec2f {{\n{branches}return vec2(-1.0);\n}}\n");
    hlsl += &format!("float2 find(float4 p) {{\n{branches}return float2(-1.0, -1.0);\n}}\n");
    let value = "vec4(find(p), 0.0, 0.0)".to_owned();
    let case = Case { name: "axes".to_owned(), glsl, wgsl, hlsl, value, points, textures: vec![] };
    let found = run(std::slice::from_ref(&case));
    for (point, found) in found.iter().flat_map(|found| case.points.iter().zip(&found["axes"])) {
        let axis = &axes[point[1] as usize];
        let x = f64::from(point[0]);
        let formula = axis.coordinate(axis.kept_within(Expression::variable("x")));
        let mut bound = evaluate(&formula, &|_| x).error;
        if axis.warp == Warp::Acos {
            bound += 2.3e-8 / std::f64::consts::FRAC_PI_2; // of its polynomial
        }
        let wanted = (axis.position(x) + 0.5) / axis.size as f64;
        let got = f64::from(found[0]);
        assert!((got - wanted).abs() <= bound, "{axis} at {x}: got {got}, wanted {wanted} ± {bound:e}");
        // The bound says something: less than a hundredth of the precision of filtering.
        assert!(bound < 1e-4, "{axis} at {x}: bound {bound:e}");
        assert_eq!(found[1], 0.5);
    }
}

/// Steps into which hardware divides the way from one texel to the next: what Direct3D asks for, 8 bits, and all that most have. A
/// weight is then off by up to one step of 1/256 (half of it where it is rounded), and a value by that part of the difference between
/// the texels, once per axis.
const SUBTEXEL: f64 = 1.0 / 256.0;

/// A table in memory: what its file holds, and how a page gets it.
struct Baked {
    spec: TableSpec,
    certificate: Certificate,
    shader: Shader,
    /// Value of a channel at a texel.
    texels: Vec<f64>,
    textures: Vec<Texture>,
}

fn bake(name: &str, recipe: &TableRecipe) -> Baked {
    let baked = kiln::bake::table(recipe, &|_| ()).unwrap();
    let (spec, arrangement) = (recipe.spec().unwrap(), recipe.arrangement().unwrap());
    let bytes = &baked.files[0].1;
    let n = spec.channels.len();
    let flat = |format: &str, [w, h, d]: [usize; 3], bytes: Vec<u8>, name: &str, kind| Texture {
        name: name.to_owned(),
        kind,
        format: format.to_owned(),
        levels: vec![([w, h, d], bytes)],
    };
    let (texels, textures) = match decode(bytes).unwrap() {
        Decoded::Texture(texture) => {
            // The bytes of the file go to the page as they are.
            let format = texture.format;
            let values = texture.values(0);
            let values: Vec<f32> = values.chunks_exact(format.channels()).flat_map(|t| t[..n].to_vec()).collect();
            let kind = if arrangement.is_volume() { "3d" } else { "2d" };
            let level = texture.levels[0].clone();
            (arrangement.gather(&values), vec![flat(&format.to_string(), arrangement.size, level, "table", kind)])
        }
        Decoded::Picture(image, _) => {
            let names = arrangement.names(
                &spec
                    .channels
                    .iter()
                    .map(|c| c.label())
                    .collect::<Vec<_>>()
                    .iter()
                    .map(String::as_str)
                    .collect::<Vec<_>>(),
            );
            let order: Vec<usize> = names.iter().map(|name| image.channel_index(name).unwrap()).collect();
            let all = image.channels.len();
            let values: Vec<f32> =
                image.texels.chunks_exact(all).flat_map(|t| order.iter().map(|&i| t[i]).collect::<Vec<_>>()).collect();
            let table = arrangement.gather(&values);
            // Slices become a volume, what has more than four channels several textures, as the code's head says.
            let (size, kind, stored) = if arrangement.is_layered() {
                ([spec.width(), spec.height(), spec.depth()], "3d", &table)
            } else {
                (arrangement.size, "2d", &values)
            };
            let textures = (0..n.div_ceil(4))
                .map(|t| {
                    let rgba: Vec<f32> = stored
                        .chunks_exact(n)
                        .flat_map(|texel| (0..4).map(|c| *texel.get(4 * t + c).unwrap_or(&0.0)).collect::<Vec<_>>())
                        .collect();
                    let name = if n > 4 { format!("table{t}") } else { "table".to_owned() };
                    flat("rgba32f", size, le_bytes(&rgba), &name, kind)
                })
                .collect();
            (table, textures)
        }
        Decoded::Array(_) => panic!("{name} is a texture or a picture"),
    };
    let shader = Shader::of_table(name, &baked.certificate).unwrap();
    Baked {
        spec,
        certificate: baked.certificate,
        shader,
        texels: texels.into_iter().map(f64::from).collect(),
        textures,
    }
}

/// Quantities that are changed on their way into the table, every step among them that can be undone.
const UNDONE: [&str; 3] = ["burley.albedo:/1.03571:-0.5", "burley.albedo:y/(1+y)", "burley.albedo:*-0.3:+1"];

/// Every layout, one to three axes, half and full floats, more channels than a texture has, ranges, flips and edges.
fn tables() -> Vec<(&'static str, TableRecipe)> {
    let axes = |text: &str| text.split(',').map(str::to_owned).collect::<Vec<_>>();
    let steep = axes("mu:32:sqrt:edge,roughness:16:flip");
    let glass = axes("mu:6:cbrt,alpha:5:edge:flip,eta:7:f0-fourth-root");
    // (The random witness takes its time for averages.)
    let colour = axes("mu:4:log+0.05,roughness:3:square,f0:2:edge");
    let compensations = ["none", "kulla-conty", "kulla-conty-squared", "turquin", "fdez-aguera"];
    let compensations = compensations.map(|c| format!("compensation.{c}"));
    let compensations = compensations.each_ref().map(String::as_str);
    let both = ["dielectric.reflectance", "dielectric.transmittance"];
    vec![
        ("half", recipe(&["ggx.scale", "ggx.bias"], &steep, "ktx2:rg16f", None)),
        ("full", recipe(&["ggx.scale", "ggx.bias", "ggx.f82"], &steep, "exr:f32", None)),
        ("undone", recipe(&UNDONE, &axes("mu:32:edge,roughness:16"), "exr:f32", None)),
        ("row", recipe(&["ggx.albedo_avg"], &axes("roughness:24:edge"), "ktx2:r16f", None)),
        ("volume", recipe(&both, &glass, "ktx2:rg32f", None)),
        ("atlas", recipe(&both, &glass, "ktx2:rg16f", Some("atlas:3"))),
        ("tower", recipe(&both, &glass, "exr:f32", Some("atlas:1"))),
        ("slices", recipe(&both, &glass, "exr:f32", None)),
        ("wide", recipe(&compensations, &colour, "exr:f32", None)),
        (
            "range",
            recipe(
                &["eon.albedo"],
                &axes("mu:9:0.2..0.8:acos,rho:5:0.1..0.9:sqrt-one-minus:flip,roughness:3:edge"),
                "ktx2:r32f",
                None,
            ),
        ),
    ]
}

/// A table of two channels as the middle one of three layers, of which the others hold nothing.
fn as_a_layer(baked: &Baked, points: Vec<[f32; 4]>) -> Case {
    let certificate = Certificate { layer: Some(1), ..baked.certificate.clone() };
    let shader = Shader::of_table("layer", &certificate).unwrap();
    let ([width, height, _], bytes) = &baked.textures[0].levels[0];
    let nothing = vec![0; bytes.len()];
    let [x, y] = [0, 1].map(|i| fields_of(&shader)[i].clone());
    let body = format!("layer_values v = layer_lookup(table, p.x, p.y); return vec4(v.{x}, v.{y}, 0.0, 0.0);");
    let [glsl, wgsl, hlsl] = in_all(|language| shader.to_text(language) + &finder(language, &body, &["table"]));
    Case {
        name: "layer".to_owned(),
        glsl,
        wgsl,
        hlsl,
        value: "find(p)".to_owned(),
        points,
        textures: vec![Texture {
            name: "table".to_owned(),
            kind: "array",
            format: baked.textures[0].format.clone(),
            levels: vec![([*width, *height, 3], [&nothing, bytes, &nothing].map(Vec::as_slice).concat())],
        }],
    }
}

#[test]
fn tables_are_looked_up_within_the_error_that_their_certificates_state() {
    let mut cases = vec![];
    let mut all = vec![];
    for (name, recipe) in tables() {
        // Tables of the same axes are looked up at the same points.
        let mut random = Random(2);
        let mut baked = bake(name, &recipe);
        let n = baked.spec.axes.len();
        let columns: Vec<Vec<f32>> = baked.spec.axes.iter().map(|a| along(a, POINTS, &mut random)).collect();
        // Shuffled against each other, so that ends meet insides.
        let point =
            |i: usize| std::array::from_fn(|a| if a < n { columns[a][(i * (2 * a + 1)) % POINTS] } else { 0.0 });
        let points: Vec<[f32; 4]> = (0..POINTS).map(point).collect();
        let arguments = ["p.x", "p.y", "p.z"][..n].join(", ");
        let textures: Vec<String> = baked.textures.iter().map(|t| t.name.clone()).collect();
        let fields = fields_of(&baked.shader);
        for (half, fields) in fields.chunks(4).enumerate() {
            let mut values: Vec<String> = fields.iter().map(|f| format!("v.{f}")).collect();
            values.resize(4, "0.0".to_owned());
            let names: Vec<&str> = textures.iter().map(String::as_str).collect();
            let (given, values) = (names.join(", "), values.join(", "));
            let body = format!("{name}_values v = {name}_lookup({given}, {arguments}); return vec4({values});");
            let [glsl, wgsl, hlsl] =
                in_all(|language| baked.shader.to_text(language) + &finder(language, &body, &names));
            let textures = baked.textures.iter().map(|t| Texture {
                levels: t.levels.clone(),
                name: t.name.clone(),
                format: t.format.clone(),
                ..*t
            });
            cases.push(Case {
                name: format!("{name}{half}"),
                glsl,
                wgsl,
                hlsl,
                value: "find(p)".to_owned(),
                points: points.clone(),
                textures: textures.collect(),
            });
        }
        if name == "half" {
            cases.push(as_a_layer(&baked, points.clone()));
        }
        baked.textures.clear();
        all.push((name, baked, points));
    }
    let found = run(&cases);
    let by_tolerance = Integration::new(Settings { tolerance: Some(1e-6), ..Settings::default() }).unwrap();
    let mut known = HashMap::new();
    for found in &found {
        assert_eq!(found["layer"], found["half0"], "the same as a layer of an array");
    }
    for (found, (name, baked, points)) in found.iter().flat_map(|found| all.iter().map(move |one| (found, one))) {
        let (axes, n) = (&baked.spec.axes, baked.spec.channels.len());
        let sizes: Vec<usize> = axes.iter().map(|a| a.size).collect();
        let mut at_its_worst = vec![0.0_f64; n];
        for (i, point) in points.iter().enumerate() {
            let mut at = baked.spec.at;
            let mut position = vec![];
            let mut weight_errors = vec![];
            for (axis, x) in axes.iter().zip(point) {
                let (low, high) = axis.ends();
                let x = f64::from(*x).clamp(low, high);
                at = at.with(axis.parameter, x).unwrap();
                position.push(axis.position(x));
                let formula = axis.coordinate(axis.kept_within(Expression::variable("x")));
                let rounding = evaluate(&formula, &|_| f64::from(point[position.len() - 1])).error;
                // The product with the size, and the half that is taken off, round once more each.
                weight_errors.push(SUBTEXEL + axis.size as f64 * (rounding + 2.0 * ULP));
            }
            // What `kiln eval` says, to far better than the table can; all channels of a table here are of one family.
            let first = &baked.spec.channels[0];
            let evaluate_all =
                || quantity::evaluate_family(first.family, &at, &baked.spec.model, &by_tolerance).unwrap();
            let exact = known.entry((first.quantity.name, at.to_string())).or_insert_with(evaluate_all);
            for channel in 0..n {
                let texel = |t: &[usize]| {
                    let index = t.iter().zip(&sizes).rev().fold(0, |index, (i, size)| index * size + i);
                    baked.texels[index * n + channel]
                };
                let (ideal, slopes) = sample(&texel, &sizes, &position);
                let filtering: f64 =
                    slopes.iter().zip(&weight_errors).map(|(s, w)| s * w).sum::<f64>() + 8.0 * ULP * ideal.abs();
                let got = f64::from(found[&format!("{name}{}", channel / 4)][i][channel % 4]);
                let what = format!("{name}, {} at {at}: got {got}", baked.spec.channels[channel].quantity.name);
                let handle = &baked.spec.channels[channel];
                // Undone, what the texel is off by is as much larger as the undoing stretches it, and the undoing is rounded.
                let transform = &handle.transform;
                let undone = |held: f64, off: f64| {
                    let ends = [held - off, held + off].map(|y| (transform.undo(y) - transform.undo(held)).abs());
                    ends[0].max(ends[1])
                };
                let formula = transform.undone(Expression::variable("y"));
                let rounding = evaluate(&formula, &|_| ideal).error;
                let bound = undone(ideal, filtering) + rounding;
                let by_hand = transform.undo(ideal);
                assert!((got - by_hand).abs() <= bound, "{what}, by hand {by_hand} ± {bound:e}");
                assert!(handle.same_family(&baked.spec.channels[0]));
                let exact = exact[handle.index];
                let stated = &baked.certificate.lookup[channel];
                let error = (got - exact.value).abs();
                let allowed = undone(transform.apply(exact.value), stated.max + filtering) + rounding + exact.error;
                assert!(
                    error <= allowed,
                    "{what}, wanted {} ± {:e} as the certificate states, all in all ± {allowed:e}",
                    exact.value,
                    stated.max
                );
                at_its_worst[channel] = at_its_worst[channel].max(error);
            }
        }
        // The comparison bites: the largest error seen is not far below what is stated.
        for (seen, stated) in at_its_worst.iter().zip(&baked.certificate.lookup) {
            assert!(*seen > 0.02 * stated.max, "{name} {}: saw {seen:e} of {:e}", stated.channel, stated.max);
        }
    }
}

/// The fields of the structure that a lookup returns.
fn fields_of(shader: &Shader) -> Vec<String> {
    let text = shader.to_text(Language::Wgsl);
    let body = text.split_once("_values {\n").unwrap().1.split_once('}').unwrap().0;
    body.lines().filter_map(|line| line.trim().split_once(':')).map(|(name, _)| name.to_owned()).collect()
}

#[test]
fn compensation_in_the_shader_is_the_compensation_of_the_library() {
    // At texel centres nothing is interpolated, and f32 texels leave only rounding.
    let axes = ["mu:8".to_owned(), "roughness:8".to_owned()];
    let baked = bake("dfg", &recipe(&["ggx.scale", "ggx.bias"], &axes, "ktx2:rg32f", None));
    let mut random = Random(3);
    let points: Vec<[f32; 4]> = (0..POINTS)
        .map(|_| {
            let [mu, roughness] = [0, 1].map(|a| baked.spec.axes[a].value(random.below(8)) as f32);
            [mu, roughness, random.unit() as f32, 0.0]
        })
        .collect();
    let integration = Integration::new(Settings::default()).unwrap();
    let exact = |name: &str, p: &[f32; 4]| {
        use kiln::table::Parameter::{F0, Mu, Roughness};
        let at = Point::default().with(Mu, p[0].into()).unwrap().with(Roughness, p[1].into()).unwrap();
        let at = if name.starts_with("compensation") { at.with(F0, p[2].into()).unwrap() } else { at };
        quantity::find(name).unwrap().evaluate(&at, &baked.spec.model, &integration).unwrap().value
    };
    // E_avg comes from another table: here, exactly.
    let points: Vec<[f32; 4]> =
        points.into_iter().map(|p| [p[0], p[1], p[2], exact("ggx.albedo_avg", &p) as f32]).collect();
    let body = "dfg_values v = dfg_lookup(table, p.x, p.y); vec3 f0 = p.zzz; float r = dfg_reflectance(v, f0).x; return vec4(r, r + \
                dfg_kulla_conty(v, p.w, f0).x, r * dfg_turquin(v, f0).x, dfg_fdez_aguera(v, f0).x);";
    let case = |name: &str, shader: &Shader, body, points: &Vec<[f32; 4]>, textures| {
        let [glsl, wgsl, hlsl] = in_all(|language| shader.to_text(language) + &finder(language, body, &["table"]));
        let (name, value) = (name.to_owned(), "find(p)".to_owned());
        Case { name, glsl, wgsl, hlsl, value, points: points.clone(), textures }
    };
    // Of metals, with what the F82 tint takes.
    let metal = bake("metal", &recipe(&["ggx.scale", "ggx.bias", "ggx.f82"], &axes, "exr:f32", None));
    let of_metals: Vec<[f32; 4]> = points.iter().map(|p| [p[0], p[1], p[2], random.unit() as f32]).collect();
    let of_metal =
        "metal_values v = metal_lookup(table, p.x, p.y); return vec4(metal_metal_reflectance(v, p.zzz, p.www), 1.0);";
    let cases = [
        case("energy", &baked.shader, body, &points, baked.textures),
        case("metal", &metal.shader, of_metal, &of_metals, metal.textures),
    ];
    let found = run(&cases);
    for (point, found) in found.iter().flat_map(|found| of_metals.iter().zip(&found["metal"])) {
        let [mu, roughness, f0, f82] = point.map(f64::from);
        // The tinted reflectance itself, integrated.
        let smith = baked.spec.model.smith;
        let [wanted] = ggx_reflection(mu, roughness * roughness, smith, 1e-9, |cosine| [f82_tint(f0, f82, cosine)]);
        // As below; the tint's factor is at most 1/dip(1/7) < 18, of what is at most 1/18.
        let tolerance = 8.0 * 8.0 * ULP + 48.0 * ULP + 2e-7;
        for got in &found[..3] {
            assert!(
                (f64::from(*got) - wanted.value).abs() <= tolerance,
                "{point:?}: got {got}, wanted {}",
                wanted.value
            );
        }
    }
    for (point, found) in found.iter().flat_map(|found| points.iter().zip(&found["energy"])) {
        for (got, name) in found.iter().zip(["none", "kulla-conty-squared", "turquin", "fdez-aguera"]) {
            let wanted = exact(&format!("compensation.{name}"), point);
            // Neighbouring texels differ by less than 1, and a coordinate is off by a few ulp of 1, eight texels: 2⁻²⁰; hardware that
            // rounds weights to 1/256 rounds that away. Then a dozen operations on numbers up to 2.
            let tolerance = 8.0 * 8.0 * ULP + 24.0 * ULP + 2e-7;
            assert!((f64::from(*got) - wanted).abs() <= tolerance, "{name} at {point:?}: got {got}, wanted {wanted}");
        }
    }
}

/// A cube of levels whose texels are functions of their direction and their level.
fn cube(sizes: &[usize], value: impl Fn(glam::DVec3, usize) -> [f32; 3]) -> Texture {
    let levels = sizes.iter().enumerate().map(|(level, &size)| {
        let texels = (0..6 * size * size).flat_map(|i| {
            let [r, g, b] = value(kiln::environment::cube::texel_direction(size, i), level);
            [r, g, b, 1.0]
        });
        ([size, size, 1], le_bytes(&texels.collect::<Vec<_>>()))
    });
    Texture { name: "specular".to_owned(), kind: "cube", format: "rgba32f".to_owned(), levels: levels.collect() }
}

/// Ways in which a cube can be turned.
const ORIENTATIONS: [&str; 4] = ["x,y,z", "-x,y,z", "y,z,x", "-z,x,-y"];

#[test]
fn directions_are_turned_as_the_cube_is() {
    let axis = |i: usize| ["x", "y", "z", "-x", "-y", "-z"][i];
    let triples = (0..216).map(|i| [i / 36, i / 6 % 6, i % 6].map(axis).join(","));
    let all: Vec<Orientation> = triples.filter_map(|text| text.parse().ok()).collect();
    let [glsl, hlsl] = [(Language::Glsl, "vec"), (Language::Hlsl, "float")].map(|(language, vector)| {
        let (mut code, mut branches) = (String::new(), String::new());
        for (i, &orientation) in all.iter().enumerate() {
            let recipe = EnvironmentRecipe { orientation, ..EnvironmentRecipe::new("builtin:sky") };
            let text = environment_shader(&format!("turned_{i}"), recipe).to_text(language);
            let (_, function) = text.split_once(&format!("{vector}3 turned_{i}_direction")).unwrap();
            let (function, _) = function.split_once("\n}\n").unwrap();
            code += &format!("{vector}3 turned_{i}_direction{function}\n}}\n");
            branches += &format!("if (p.w == {i}.0) return turned_{i}_direction(p.xyz);\n");
        }
        code + &format!("{vector}3 find({vector}4 p) {{\n{branches}return {vector}3(0.0, 0.0, 0.0);\n}}\n")
    });
    let points: Vec<[f32; 4]> = (0..all.len()).map(|i| [0.25, -0.5, 0.75, i as f32]).collect();
    let value = "vec4(find(p), 0.0)".to_owned();
    let (name, wgsl) = ("turned".to_owned(), String::new());
    let found = run(&[Case { name, glsl, wgsl, hlsl, value, points: points.clone(), textures: vec![] }]);
    assert_eq!(all.len(), 48);
    for found in found {
        for ((orientation, point), found) in all.iter().zip(&points).zip(found.get("turned").into_iter().flatten()) {
            let wanted = orientation.lookup(glam::Vec3::from_slice(point).as_dvec3()).as_vec3();
            assert_eq!(found[..3], wanted.to_array(), "{orientation}");
        }
    }
}

#[test]
fn irradiance_is_read_from_where_it_is_and_unpacked_as_it_is_packed() {
    use kiln::recipe::IrradianceKind;
    let base = || EnvironmentRecipe { roughness: Some(vec![0.0, 0.5, 1.0]), ..EnvironmentRecipe::new("builtin:sky") };
    let mut random = Random(5);
    let points: Vec<[f32; 4]> = (0..POINTS)
        .map(|_| {
            let [x, y, z] = direction(&mut random);
            [x, y, z, 0.0]
        })
        .collect();
    // Codes that RGBD would read as something else.
    let codes =
        |name: &str| Texture { name: name.to_owned(), ..cube(&[4, 2, 1], |_, level| [0.5, 0.25, level as f32]) };
    let case = |name: &str, recipe: EnvironmentRecipe, value: &str, textures: Vec<Texture>| {
        let [glsl, mut wgsl, hlsl] = in_all(|language| environment_shader("sky", recipe.clone()).to_text(language));
        if !textures.is_empty() {
            wgsl.clear();
        }
        Case { name: name.to_owned(), glsl, wgsl, hlsl, value: value.to_owned(), points: points.clone(), textures }
    };
    let env = || "env".parse().unwrap();
    let own = EnvironmentRecipe { format: env(), irradiance_format: "ktx2:rgba16f".parse().ok(), ..base() };
    let shared = EnvironmentRecipe { format: env(), irradiance_format: Some(env()), ..base() };
    let last = EnvironmentRecipe { irradiance: IrradianceKind::LastLevel, ..base() };
    let sh = EnvironmentRecipe { irradiance: IrradianceKind::Sh, ..base() };
    let packed = |format: &str| EnvironmentRecipe {
        format: format.parse().unwrap(),
        irradiance_format: format.parse().ok(),
        ..base()
    };
    let both = "vec4(sky_irradiance(irradiance, p.xyz).xy, sky_specular(specular, p.xyz, 0.0).xy)";
    let cases = [
        case("own", own, both, vec![codes("irradiance"), codes("specular")]),
        case("shared", shared, both, vec![codes("irradiance"), codes("specular")]),
        case("rgbm", packed("ktx2:rgbm"), both, vec![codes("irradiance"), codes("specular")]),
        case("rgbp", packed("ktx2:rgbp"), both, vec![codes("irradiance"), codes("specular")]),
        case("last", last, "vec4(sky_irradiance(specular, p.xyz), 1.0)", vec![codes("specular")]),
        case("sh", sh, "vec4(sky_irradiance(p.xyz) - sky_sh(p.xyz), 1.0)", vec![]),
    ];
    let none = EnvironmentRecipe { irradiance: IrradianceKind::None, ..base() };
    assert!(!environment_shader("sky", none).to_text(Language::Glsl).contains("sky_irradiance("));
    let found = run(&cases);
    let [half, quarter] = [0.5_f64, 0.25].map(|code| code.powf(2.2));
    for (name, wanted) in [
        ("own", [0.5, 0.25, half, quarter]),
        ("shared", [half, quarter, half, quarter]),
        // Of a factor of 1: the squares of 8 times the codes, and of the codes.
        ("rgbm", [16.0, 4.0, 16.0, 4.0]),
        ("rgbp", [0.25, 0.0625, 0.25, 0.0625]),
        ("last", [0.5, 0.25, 2.0, 1.0]),
        ("sh", [0.0, 0.0, 0.0, 1.0]),
    ] {
        for (point, found) in found.iter().flat_map(|found| points.iter().zip(found.get(name).into_iter().flatten())) {
            for c in 0..4 {
                // Powers of 2.2 of numbers from 1/4 on: 3 + 2 · 4.4 ulp and those of the logarithm.
                let error = (f64::from(found[c]) - wanted[c]).abs();
                assert!(
                    error <= 32.0 * ULP * wanted[c].max(1.0),
                    "{name} towards {point:?}: {found:?}, wanted {wanted:?}"
                );
            }
        }
    }
}

#[test]
fn chains_are_looked_up_at_the_level_and_in_the_direction_that_they_hold() {
    let mut random = Random(4);
    let mut cases = vec![];
    for (i, roughness) in chains().iter().enumerate() {
        let name = format!("chain{i}");
        let [glsl, wgsl, hlsl] = in_all(|language| chain_shader(&name, roughness).to_text(language));
        let knots = roughness.iter().map(|&r| r as f32);
        let chosen: Vec<f32> = knots.chain((0..POINTS).map(|_| random.unit() as f32)).collect();
        let points: Vec<[f32; 4]> = chosen
            .into_iter()
            .map(|r| {
                let [x, y, z] = direction(&mut random);
                [x, y, z, r]
            })
            .collect();
        // A level's texels hold its number: what comes back is the level that was sampled.
        let sizes: Vec<usize> = (0..roughness.len()).map(|m| 16 >> m).collect();
        cases.push(Case {
            name: format!("{name}_level"),
            glsl: glsl.clone(),
            wgsl: String::new(),
            hlsl: hlsl.clone(),
            value: format!("vec4({name}_level(p.w), {name}_specular(specular, p.xyz, p.w))"),
            points: points.clone(),
            textures: vec![cube(&sizes, |_, level| [level as f32; 3])],
        });
        // Written in, or handed over, of which the application chooses which.
        let value = if i == 0 {
            let given = SH.irradiance_over_pi.map(|[r, g, b]| format!("vec3({r:?}, {g:?}, {b:?})")).join(", ");
            format!("vec4({name}_sh_of(vec3[9]({given}), p.xyz), {name}_level(p.w))")
        } else {
            format!("vec4({name}_sh(p.xyz), {name}_level(p.w))")
        };
        cases.push(Case { name: format!("{name}_sh"), glsl, wgsl, hlsl, value, points, textures: vec![] });
    }
    let size = 64;
    let points: Vec<[f32; 4]> = (0..4 * POINTS)
        .map(|_| {
            let [x, y, z] = direction(&mut random);
            [x, y, z, 0.0]
        })
        .collect();
    // Of the turned ones only the first is its own inverse.
    for orientation in ORIENTATIONS {
        let orientation: Orientation = orientation.parse().unwrap();
        let sky =
            EnvironmentRecipe { roughness: Some(vec![0.0]), orientation, ..EnvironmentRecipe::new("builtin:sky") };
        let [glsl, wgsl, hlsl] = in_all(|language| environment_shader("sky", sky.clone()).to_text(language));
        cases.push(Case {
            name: orientation.to_string(),
            glsl,
            wgsl,
            hlsl,
            value: "vec4(sky_specular(specular, p.xyz, p.w), 1.0)".to_owned(),
            points: points.clone(),
            // What a cube that was turned holds: the world's direction.
            textures: vec![cube(&[size], |d, _| orientation.world(d.normalize()).as_vec3().to_array())],
        });
    }
    let found = run(&cases);
    for (found, (i, roughness)) in found.iter().flat_map(|f| chains().into_iter().enumerate().map(move |one| (f, one)))
    {
        let formula = level_of_roughness(&roughness).unwrap();
        let case = &cases[2 * i];
        for (point, found) in case.points.iter().zip(found.get(&case.name).into_iter().flatten()) {
            let wanted = formula.evaluate(&|_| point[3].into());
            let (level, seen) = (f64::from(found[0]), f64::from(found[1]));
            assert!(
                (level - wanted).abs() <= 16.0 * ULP * 4.0,
                "{roughness:?} at {}: level {level}, wanted {wanted}",
                point[3]
            );
            // Hardware blends levels in steps of 1/256, too.
            assert!(
                (seen - wanted).abs() <= SUBTEXEL,
                "{roughness:?} at {}: saw level {seen}, wanted {wanted}",
                point[3]
            );
        }
        let case = &cases[2 * i + 1];
        let sh = if i == 0 { SH.irradiance_over_pi } else { SH.irradiance_over_pi_nonnegative };
        let scale: f64 = sh.as_flattened().iter().map(|c| c.abs()).sum();
        for (point, found) in case.points.iter().zip(&found[&case.name]) {
            let [x, y, z, _] = point.map(f64::from);
            let wanted = kiln::environment::spherical_harmonics::evaluate(&sh, glam::DVec3::new(x, y, z));
            for c in 0..3 {
                let error = (f64::from(found[c]) - wanted[c]).abs();
                assert!(error <= 12.0 * ULP * scale, "SH towards {point:?}: got {found:?}, wanted {wanted:?}");
            }
            let level = formula.evaluate(&|_| point[3].into());
            assert!(
                (f64::from(found[3]) - level).abs() <= 16.0 * ULP * 4.0,
                "{roughness:?} at {}: {found:?}, {level}",
                point[3]
            );
        }
    }
    // Chromium's software WebGPU, which small cubes are kept from, is not looked at beside edges.
    let in_wgsl = |language: &Found| !language.contains_key(&cases[0].name);
    let languages = found.iter().flat_map(|language| ORIENTATIONS.map(|o| (in_wgsl(language), o, language.get(o))));
    let seen = languages.flat_map(|(is_wgsl, o, found)| {
        points.iter().zip(found.into_iter().flatten()).map(move |(point, found)| (is_wgsl, o, point, found))
    });
    let mut away_from_edges = 0;
    for (is_wgsl, orientation, point, found) in seen {
        // A texel is 2/64 wide, and a unit vector bends by at most 1 per unit of the face: linear interpolation is off by up to
        // (2/64)²/8 per axis; weights by 1/256 of a texel.
        let step = 2.0 / size as f64;
        let mut tolerance = 2.0 * step * step / 8.0 + 2.0 * SUBTEXEL * step + 1e-6;
        let [x, y, z, _] = point.map(f64::from);
        let (_, u, v) = kiln::environment::cube::locate(glam::DVec3::new(x, y, z));
        if is_wgsl && u.abs().max(v.abs()) > 1.0 - step {
            continue;
        }
        away_from_edges += usize::from(is_wgsl);
        if u.abs().max(v.abs()) > 1.0 - step / 2.0 {
            // The texel across an edge counts as if it lay in the plane of this face: half a texel off sideways in a corner, with a
            // weight of up to a half.
            tolerance += step / 4.0;
        }
        for c in 0..3 {
            let error = f64::from(found[c] - point[c]).abs();
            assert!(error <= tolerance, "towards {point:?} the cube {orientation} holds {found:?}");
        }
    }
    // Two texels of 64 lie beside edges: of a direction, one in 16 at most.
    let all = points.len() * ORIENTATIONS.len();
    assert!(away_from_edges > all * 3 / 4 || !found.iter().any(in_wgsl), "{away_from_edges} of {all} points in WGSL");
}

/// What is seen of octahedral maps and of panoramas is what the library blends, also beside borders and where no texel looks; between levels too.
#[test]
fn maps_in_one_picture_are_looked_up_as_the_library_blends_them() {
    use kiln::environment::{SphereLayout, SphereMap};
    let mut random = Random(9);
    let (sizes, roughness) = ([16, 8, 4], vec![0.0, 0.5, 1.0]);
    let axes = [glam::DVec3::X, glam::DVec3::Y, glam::DVec3::Z].into_iter().flat_map(|d| [d, -d]);
    // Along the fold of the octahedron, and around the poles.
    let borders = (0..POINTS).flat_map(|i| {
        let (sin, cos) = (0.1 + i as f64 / 41.0).sin_cos();
        let off = 1e-2 * (i % 5) as f64 - 2e-2;
        [glam::DVec3::new(off, sin, -cos.abs()), glam::DVec3::new(sin, off, -cos.abs())]
    });
    let any: Vec<glam::DVec3> = (0..2 * POINTS).map(|_| glam::Vec3::from(direction(&mut random)).as_dvec3()).collect();
    let points: Vec<[f32; 4]> = axes
        .chain(borders)
        .chain(any)
        .enumerate()
        .map(|(i, d)| {
            let [x, y, z] = d.normalize().as_vec3().to_array();
            [x, y, z, [0.0, 0.5, 1.0, 0.31, 0.77][i % 5]]
        })
        .collect();
    let (mut cases, mut wanted) = (vec![], vec![]);
    for (layout, turn) in [
        (SphereLayout::Octahedral, "x,y,z"),
        (SphereLayout::Octahedral, "-z,x,-y"),
        (SphereLayout::Equirect, "x,y,z"),
        (SphereLayout::Equirect, "z,y,-x"),
    ] {
        let orientation: Orientation = turn.parse().unwrap();
        let recipe = EnvironmentRecipe {
            layout,
            size: sizes[0],
            roughness: Some(roughness.clone()),
            orientation,
            ..EnvironmentRecipe::new("builtin:sky")
        };
        // Rough: neighbouring texels have nothing to do with each other.
        let maps: Vec<SphereMap> = sizes
            .iter()
            .map(|&size| {
                let texels = (0..layout.texels(size)).map(|_| [0; 3].map(|_| random.unit() as f32)).collect();
                SphereMap { layout, size, texels }
            })
            .collect();
        let levels = maps.iter().map(|map| {
            let ([width, height], _) = layout.shape(map.size);
            let texels: Vec<f32> = map.texels.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0]).collect();
            ([width, height, 1], le_bytes(&texels))
        });
        let kind = if layout == SphereLayout::Equirect { "panorama" } else { "2d" };
        let [glsl, wgsl, hlsl] = in_all(|language| environment_shader("sky", recipe.clone()).to_text(language));
        cases.push(Case {
            name: format!("{layout}_{turn}"),
            glsl,
            wgsl,
            hlsl,
            value: "vec4(sky_specular(specular, p.xyz, p.w), 1.0)".to_owned(),
            points: points.clone(),
            textures: vec![Texture {
                name: "specular".to_owned(),
                kind,
                format: "rgba32f".to_owned(),
                levels: levels.collect(),
            }],
        });
        let seen = |p: &[f32; 4]| {
            let towards = orientation.lookup(glam::DVec3::new(p[0].into(), p[1].into(), p[2].into()));
            let level = 2.0 * f64::from(p[3]);
            let below = level.floor().min(1.0) as usize;
            let [a, b] = [below, below + 1].map(|m| maps[m].filtered(towards));
            ([0, 1, 2].map(|c| a[c] + (level - below as f64) * (b[c] - a[c])), towards)
        };
        wanted.push(points.iter().map(seen).collect::<Vec<_>>());
    }
    let found = run(&cases);
    for (found, (case, wanted)) in found.iter().flat_map(|f| cases.iter().zip(&wanted).map(move |one| (f, one))) {
        for ((point, found), &(wanted, towards)) in points.iter().zip(&found[&case.name]).zip(wanted) {
            // Texels differ by up to 1, and weights come in steps of 1/256: of a column, of a row, of a level. At a pole of a panorama every
            // column is looked at, as the rounding of the vector has it.
            let pole = case.name.starts_with("equirect") && towards.x.hypot(towards.z) < 1e-3;
            let tolerance = if pole { 1.0 } else { 3.0 * SUBTEXEL + 64.0 * ULP };
            for c in 0..3 {
                let error = (f64::from(found[c]) - wanted[c]).abs();
                assert!(error <= tolerance, "{} at {point:?}: got {found:?}, wanted {wanted:?}", case.name);
            }
        }
    }
}

/// Every tile of an atlas is found where PlayCanvas' own shader finds it, between levels and sizes too.
#[test]
fn an_atlas_is_looked_up_as_playcanvas_looks_it_up() {
    use crate::support::atlas::{Atlas, EDGE, IRRADIANCE, mirror, rough};
    let mut random = Random(11);
    // Neighbours have nothing to do with each other but the factor: blends of codes of several factors are worth nothing.
    const P: u8 = 100;
    let codes = (0..EDGE * EDGE).flat_map(|_| [0, 1, 2, 3].map(|c| if c == 3 { P } else { random.below(256) as u8 }));
    let atlas = Atlas(codes.collect());
    let factor = (8.0 - 7.0 * f64::from(P) / 255.0_f64).powi(2);
    let texels: Vec<f32> = atlas.0.iter().map(|&code| f32::from(code) / 255.0).collect();
    let axes = [glam::DVec3::X, glam::DVec3::Z].into_iter().flat_map(|d| [d, -d]).map(|d| d.as_vec3().to_array());
    let any: Vec<[f32; 3]> = (0..4 * POINTS).map(|_| direction(&mut random)).collect();
    let points: Vec<[f32; 4]> = axes
        .chain(any)
        .enumerate()
        .map(|(i, [x, y, z])| [x, y, z, [0.0, 0.2, 1.0, random.unit() as f32][i % 4]])
        .collect();
    let [glsl, wgsl, hlsl] = in_all(|language| environment_shader("sky", atlas_recipe()).to_text(language));
    let case = |name: &str, value: &str| Case {
        name: name.to_owned(),
        glsl: glsl.clone(),
        wgsl: wgsl.clone(),
        hlsl: hlsl.clone(),
        value: format!("vec4({value}, 1.0)"),
        points: points.clone(),
        textures: vec![Texture {
            name: "specular".to_owned(),
            kind: "2d",
            format: "rgba32f".to_owned(),
            levels: vec![([EDGE, EDGE, 1], le_bytes(&texels))],
        }],
    };
    let cases = [
        case("specular", "sky_specular(specular, p.xyz, p.w)"),
        case("mirror", "sky_mirror(specular, p.xyz, 5.0 * p.w)"),
        case("irradiance", "sky_irradiance(specular, p.xyz)"),
    ];
    let found = run(&cases);
    for (found, case) in found.iter().flat_map(|found| cases.iter().map(move |case| (found, case))) {
        for (point, found) in points.iter().zip(&found[&case.name]) {
            let [x, y, z, w] = point.map(f64::from);
            let seen = |tile: [f64; 4]| atlas.seen(glam::DVec3::new(x, y, z), tile);
            let below = (5.0 * w).floor().min(4.0);
            let (tiles, part) = match case.name.as_str() {
                "specular" => ([0, 1].map(|i| rough(below as i32 + i)), 5.0 * w - below),
                "mirror" => ([0, 1].map(|i| mirror(below as i32 + i)), 5.0 * w - below),
                _ => ([IRRADIANCE; 2], 0.0),
            };
            let [low, high] = tiles.map(seen);
            for c in 0..3 {
                let wanted = low[c] + part * (high[c] - low[c]);
                // A root is off by 1/256 of a texel along each axis, of roots that differ by up to 1, under a square; then levels, whose weight
                // is exact. Coordinates of 512 texels are off by a few ulp of 1.
                let tolerance = factor * (2.0 * 2.0 * SUBTEXEL + 2.0 * 2.0 * 512.0 * 8.0 * ULP);
                let error = (f64::from(found[c]) - wanted).abs();
                assert!(error <= tolerance, "{} at {point:?}: got {found:?}, wanted {wanted} ± {tolerance}", case.name);
            }
        }
    }
}

/// A random unit vector.
fn direction(random: &mut Random) -> [f32; 3] {
    loop {
        let [x, y, z] = [0; 3].map(|_| 2.0 * random.unit() - 1.0);
        let d = glam::DVec3::new(x, y, z);
        if (0.01..=1.0).contains(&d.length_squared()) {
            return d.normalize().as_vec3().to_array();
        }
    }
}

#[test]
fn the_command_writes_code_beside_what_it_bakes() {
    use crate::support::kiln::{fail, listing, succeed};
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let table =
        ["-q", "table", "ggx-albedo-avg", "--size", "4", "-o", "avg.ktx2", "--shader", "wgsl,glsl", "--shader", "glsl"];
    succeed(folder.path(), &table);
    assert_eq!(listing(folder.path()), ["avg.ktx2", "avg.ktx2.certificate.json", "avg.lookup.glsl", "avg.lookup.wgsl"]);
    for language in ["glsl", "wgsl"] {
        let printed = succeed(folder.path(), &["shader", "avg.ktx2", "--language", language]).stdout;
        assert_eq!(printed, read(&format!("avg.lookup.{language}")));
    }
    // The certificate alone is enough.
    let printed = succeed(folder.path(), &["shader", "avg.ktx2.certificate.json", "--name", "my table"]).stdout;
    assert!(printed.contains("my_table_values my_table_lookup(highp sampler2D table, float roughness)"), "{printed}");

    let sky =
        ["-q", "env", "builtin:gradient", "--size", "8", "--min-size", "4", "--irradiance-size", "4", "--out", "sky"];
    succeed(folder.path(), &[&sky[..], &["--shader", "glsl"]].concat());
    for place in ["sky", "sky/specular.ktx2", "sky/certificate.json"] {
        assert_eq!(succeed(folder.path(), &["shader", place]).stdout, read("sky/lookup.glsl"), "{place}");
    }
    assert!(read("sky/lookup.glsl").contains("vec3 environment_sh(vec3 normal)"));

    // One file for a whole bake, names made different.
    let entry = |file: &str| {
        format!(
            "[[table]]\nfile = \"{file}\"\nformat = \"exr:f32\"\nchannels = [\"ggx.albedo_avg\"]\naxes = [\"roughness:4\"]\n"
        )
    };
    let recipe = format!("recipe = 1\nshader = [\"hlsl\"]\n{}{}", entry("a.exr"), entry("b/a.exr"));
    std::fs::write(folder.path().join("mine.toml"), recipe).unwrap();
    succeed(folder.path(), &["-q", "bake", "mine.toml", "--out", "all"]);
    let code = read("all/lookup.hlsl");
    assert!(code.contains("a_values a_lookup(") && code.contains("a_exr_values a_exr_lookup("), "{code}");
    let printed = succeed(folder.path(), &["bake", "mine.toml", "--print-recipe", "--shader", "wgsl"]).stdout;
    assert!(printed.contains("shader = [\"wgsl\"]"), "{printed}");

    let error = fail(folder.path(), &["table", "dfg", "-o", "dfg.ktx2", "--shader", "metal"], 2);
    assert!(error.contains("glsl, hlsl or wgsl"), "{error}");
    std::fs::write(folder.path().join("none.txt"), "hello").unwrap();
    fail(folder.path(), &["shader", "none.txt"], 1);
    fail(folder.path(), &["shader", "missing.ktx2"], 1);
}
