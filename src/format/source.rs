//! Source code: arrays of numbers for C and C++, Rust, GLSL, HLSL, WGSL and JavaScript.
//!
//! - **Written**: a first line of JSON that says what follows (so that Kiln reads it again), what it holds in words, then one array, flat where a
//!   language has no nested constants. f16 rounds the values to halves and writes them as numbers.
//! - **Axes**: array layers, faces, slices (where there are such), rows, columns, channels (where there are several), last fastest; in GLSL, HLSL and
//!   WGSL the array is flat, and constants give the lengths.
//! - **Numbers** are the shortest that read back as the same f32.
//! - **Read**: what Kiln wrote.

use super::{Array, Texture, ascii_json, npy, spec::Container};
use crate::error::{Error, Result};
use crate::pack::Number;
use serde::{Deserialize, Serialize};

/// What every such file begins with.
pub const MAGIC: &str = "// kiln.source/1 ";
/// The metadata key of the array's name.
pub const NAME_KEY: &str = "kiln.name";

const BEGIN: &str = "// values";
const DAMAGED: &str = "the file is damaged or was edited; write it again";
/// Numbers in a line.
const PER_LINE: usize = 8;

#[derive(Serialize, Deserialize)]
struct Head {
    kiln: String,
    name: String,
    number: Number,
    shape: Vec<usize>,
    channels: Vec<String>,
    /// The remaining metadata.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    metadata: Vec<(String, String)>,
}

/// The source code that holds `texture`, one level of f16 or f32.
///
/// **Errors**: another texel format; mips; values that are not finite.
pub fn encode(language: Container, texture: &Texture) -> Result<String> {
    texture.check()?;
    let number = texture.format.number().filter(|number| number.is_signed());
    let number =
        number.ok_or_else(|| Error::usage(format!("source code cannot hold {}", texture.format), "use f16 or f32"))?;
    let shape = npy::shape(texture)?;
    let values = texture.values(0);
    let bad = values.iter().filter(|v| !v.is_finite()).count();
    if bad > 0 {
        return Err(Error::unsupported(
            format!("{bad} values that are not finite, in source code"),
            "use another container",
        ));
    }
    let name = identifier(texture.metadata(NAME_KEY).unwrap_or("table"));
    let head = Head {
        kiln: env!("CARGO_PKG_VERSION").to_owned(),
        name: name.clone(),
        number,
        shape: shape.clone(),
        channels: texture.channel_names(),
        metadata: texture.metadata.iter().filter(|(key, _)| key != NAME_KEY).cloned().collect(),
    };
    let json = serde_json::to_string(&head)
        .map_err(|e| Error::unsupported(format!("metadata that JSON cannot hold: {e}"), "report this as a bug"))?;
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    let words = format!(
        "// {} of {}, {} numbers ({}), last axis fastest: {}. Written by Kiln {}.\n",
        name,
        lengths.join(" x "),
        values.len(),
        number,
        ascii_json(&texture.channel_names().join(", ")),
        env!("CARGO_PKG_VERSION")
    );
    Ok(format!("{MAGIC}{}\n{words}{}", ascii_json(&json), body(language, &name, &shape, &values)))
}

fn body(language: Container, name: &str, shape: &[usize], values: &[f32]) -> String {
    let n = values.len();
    let upper = name.to_uppercase();
    let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
    let constants = |declare: &dyn Fn(&str, usize) -> String| -> String {
        axis_names(shape)
            .into_iter()
            .zip(shape)
            .map(|(axis, &n)| declare(&format!("{upper}_{axis}"), n) + "\n")
            .collect()
    };
    match language {
        Container::C => {
            let dimensions: String = lengths.iter().map(|n| format!("[{n}]")).collect();
            let list = nested(shape, values, ["{", "}"], &|v| format!("{v:?}f"));
            format!(
                "#ifndef KILN_{upper}_H\n#define KILN_{upper}_H\n\nstatic const float {name}{dimensions} =\n{BEGIN}\n{list};\n\n#endif\n"
            )
        }
        Container::Rust => {
            let of = shape.iter().rev().fold("f32".to_owned(), |inner, n| format!("[{inner}; {n}]"));
            let list = nested(shape, values, ["[", "]"], &|v| format!("{v:?}"));
            // Digits are as many as an f32 needs; some lints count them.
            format!("#[rustfmt::skip]\n#[allow(clippy::all)]\npub static {upper}: {of} =\n{BEGIN}\n{list};\n")
        }
        Container::Glsl => {
            let constants = constants(&|name, n| format!("const int {name} = {n};"));
            format!(
                "{constants}const float {name}[{n}] = float[{n}](\n{BEGIN}\n{});\n",
                flat(values, &|v| format!("{v:?}"))
            )
        }
        Container::Hlsl => {
            let constants = constants(&|name, n| format!("static const int {name} = {n};"));
            format!(
                "{constants}static const float {name}[{n}] = {{\n{BEGIN}\n{}}};\n",
                flat(values, &|v| format!("{v:?}f"))
            )
        }
        Container::Wgsl => {
            let constants = constants(&|name, n| format!("const {name}: u32 = {n}u;"));
            format!("{constants}const {name} = array<f32, {n}>(\n{BEGIN}\n{});\n", flat(values, &|v| format!("{v:?}f")))
        }
        _ => format!(
            "export const {name} = {{\n  shape: [{}],\n  data: new Float32Array([\n{BEGIN}\n{}]),\n}};\n",
            lengths.join(", "),
            flat(values, &|v| format!("{v:?}"))
        ),
    }
}

/// Names for the lengths of the axes, last fastest.
fn axis_names(shape: &[usize]) -> Vec<String> {
    let usual: &[&str] = match shape.len() {
        1 => &["WIDTH"],
        2 => &["HEIGHT", "WIDTH"],
        3 => &["HEIGHT", "WIDTH", "CHANNELS"],
        4 => &["DEPTH", "HEIGHT", "WIDTH", "CHANNELS"],
        _ => &["LAYERS", "FACES", "HEIGHT", "WIDTH", "CHANNELS"],
    };
    usual.iter().map(|&s| s.to_owned()).collect()
}

fn flat(values: &[f32], number: &dyn Fn(f32) -> String) -> String {
    let lines: Vec<String> =
        values.chunks(PER_LINE).map(|line| line.iter().map(|&v| number(v)).collect::<Vec<_>>().join(", ")).collect();
    lines.join(",\n") + "\n"
}

fn nested(shape: &[usize], values: &[f32], [open, close]: [&str; 2], number: &dyn Fn(f32) -> String) -> String {
    match shape {
        [] => String::new(),
        [_] => format!("{open}{}{close}", values.iter().map(|&v| number(v)).collect::<Vec<_>>().join(", ")),
        [n, inner @ ..] => {
            let parts: Vec<String> =
                values.chunks(values.len() / n).map(|part| nested(inner, part, [open, close], number)).collect();
            format!("{open}\n{}\n{close}", parts.join(",\n"))
        }
    }
}

/// A name that all the languages take: letters, digits and single underscores, no keyword of any of them.
fn identifier(text: &str) -> String {
    let mut name = String::new();
    for c in text.chars() {
        let c = if c.is_ascii_alphanumeric() { c } else { '_' };
        // Two underscores in a row are reserved in GLSL and WGSL.
        if c != '_' || !name.ends_with('_') {
            name.push(c);
        }
    }
    let name = name.trim_matches('_');
    let is_reserved = name.is_empty()
        || name.starts_with(|c: char| c.is_ascii_digit())
        || name.starts_with("gl_")
        || RESERVED.contains(&name.to_ascii_lowercase().as_str());
    if is_reserved { format!("table_{name}").trim_end_matches('_').to_owned() } else { name.to_owned() }
}

/// Words that mean something in one of the languages and that somebody may call a table.
const RESERVED: [&str; 52] = [
    "array", "as", "async", "await", "break", "buffer", "case", "class", "const", "continue", "cube", "default",
    "delete", "do", "double", "dyn", "else", "enum", "export", "extern", "filter", "float", "fn", "for", "half", "if",
    "impl", "import", "in", "inline", "input", "int", "let", "loop", "match", "mod", "move", "new", "output", "pub",
    "register", "return", "sampler", "self", "static", "struct", "switch", "texture", "type", "use", "var", "while",
];

/// The array that Kiln wrote, its name and metadata.
///
/// **Errors**: source code that is not Kiln's, or that was edited.
pub fn decode(bytes: &[u8]) -> Result<Array> {
    let broken = |what: &str| Error::invalid(format!("the source code {what}"), DAMAGED);
    let text = std::str::from_utf8(bytes).map_err(|_| broken("is no text"))?;
    let (head, rest) =
        text.strip_prefix(MAGIC).and_then(|t| t.split_once('\n')).ok_or_else(|| broken("is not Kiln's"))?;
    let mut head: Head = serde_json::from_str(head).map_err(|e| broken(&format!("has a broken first line: {e}")))?;
    let (_, values) = rest.split_once(BEGIN).ok_or_else(|| broken("has no values"))?;
    let wanted = head.shape.iter().try_fold(1_usize, |n, &length| n.checked_mul(length));
    let mut found = vec![];
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e');
    for word in
        values.split(|c: char| !is_part(c)).filter(|word| word.starts_with(|c: char| c.is_ascii_digit() || c == '-'))
    {
        let value: f32 = word.parse().map_err(|_| broken(&format!("has {word:?} among its values")))?;
        found.push(f64::from(value));
    }
    if wanted != Some(found.len()) {
        return Err(broken(&format!("has {} values for the shape {:?}", found.len(), head.shape)));
    }
    // One channel has no axis in the code; with one, columns of a volume are not taken for its channels.
    if head.channels.len() == 1 && head.shape.len() <= 3 {
        head.shape.push(1);
    }
    Ok(Array {
        shape: head.shape,
        values: found,
        number: Some(head.number),
        channels: head.channels,
        metadata: head.metadata,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LANGUAGES: [Container; 6] =
        [Container::C, Container::Rust, Container::Glsl, Container::Hlsl, Container::Wgsl, Container::Js];

    fn table() -> Texture {
        let values: Vec<f64> = (0..24).map(|i| (f64::from(i) - 3.0).powi(5) / 7.0 * 1e-9).collect();
        let (mut texture, _) = Texture::volume("rg32f".parse().unwrap(), [3, 2, 2], &values).unwrap();
        texture.metadata =
            vec![(NAME_KEY.into(), "ggx dfg-2".into()), ("kiln.certificate".into(), "{\"µ\":\"*/\\n\"}".into())];
        texture
    }

    #[test]
    fn what_is_written_is_read_again_in_every_language() {
        let texture = table();
        for language in LANGUAGES {
            let text = encode(language, &texture).unwrap();
            assert!(text.is_ascii(), "{language}");
            let array = decode(text.as_bytes()).unwrap();
            let values: Vec<f32> = array.values.iter().map(|&v| v as f32).collect();
            assert_eq!((values, array.shape), (texture.values(0), vec![2, 2, 3, 2]), "{language}");
            assert_eq!(array.metadata, texture.metadata[1..], "{language}");
        }
    }

    #[test]
    fn columns_of_a_volume_of_one_channel_are_not_its_channels() {
        let values: Vec<f32> = (0..12).map(|i| i as f32).collect();
        let (texture, _) = Texture::volume("r32f".parse().unwrap(), [3, 2, 2], &values).unwrap();
        let text = encode(Container::C, &texture).unwrap();
        assert!(text.contains("[2][2][3] ="), "{text}");
        assert_eq!(decode(text.as_bytes()).unwrap().extent(), [3, 2, 2, 1]);
    }

    #[test]
    fn names_are_made_fit_for_every_language() {
        for (given, wanted) in [
            ("ggx dfg-2", "ggx_dfg_2"),
            ("2x", "table_2x"),
            ("gl_x", "table_gl_x"),
            ("float", "table_float"),
            ("a__b_", "a_b"),
            ("µ", "table"),
        ] {
            assert_eq!(identifier(given), wanted);
        }
    }

    #[test]
    fn shader_languages_are_what_naga_takes() {
        let texture = table();
        let wgsl = encode(Container::Wgsl, &texture).unwrap();
        naga::front::wgsl::parse_str(&wgsl).unwrap_or_else(|e| panic!("{}\n{wgsl}", e.emit_to_string(&wgsl)));
        let glsl = format!("#version 450\n{}void main() {{}}\n", encode(Container::Glsl, &texture).unwrap());
        let options = naga::front::glsl::Options::from(naga::ShaderStage::Fragment);
        naga::front::glsl::Frontend::default().parse(&options, &glsl).unwrap_or_else(|e| panic!("{e:?}\n{glsl}"));
    }

    #[test]
    fn edited_source_code_is_refused() {
        let text = encode(Container::C, &table()).unwrap();
        for edited in [
            text.replacen("// values", "// vals", 1),
            text.replacen("};", ", 1.0f};", 1),
            text.replacen("f, ", "f, 1.2.3f, ", 1),
        ] {
            let message = decode(edited.as_bytes()).unwrap_err().to_string();
            assert!(message.contains("; the file is damaged or was edited"), "{message}");
        }
    }
}
