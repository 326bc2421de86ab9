//! Functions written once, and printed in each shading language.
//!
//! A body's formulas are text that the three languages share, but for the words that [`translate`] knows: `vec2`, `vec3`, `vec4`,
//! `mix`, `atan2`; `sample(texture, coordinates, level)`, which looks up a texture; `sample_layer(texture, coordinates,
//! layer)`; and `pass(texture)`, which hands one on.

use crate::language::Language;

/// What a parameter, a variable or a result is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Type {
    Float,
    Vec2,
    Vec3,
    Vec4,
    /// A structure of floats.
    Struct(String),
    /// A two-dimensional texture and its sampler.
    Texture2,
    /// The same with layers.
    Texture2Array,
    /// The same in three dimensions.
    Texture3,
    /// The same of six faces.
    Cube,
    /// Nine colours.
    NineColours,
}

/// One line of a body.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Statement {
    /// A variable that does not change.
    Let(String, Type, String),
    /// A structure to fill.
    Variable(String, Type),
    /// Filling: what, with what.
    Set(String, String),
    /// The result.
    Return(String),
}

/// A function.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Function {
    pub comment: String,
    pub name: String,
    pub parameters: Vec<(String, Type)>,
    pub result: Type,
    pub body: Vec<Statement>,
}

/// What a file of code consists of.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Item {
    Function(Function),
    /// A structure of floats: comment, name, fields.
    Struct(String, String, Vec<String>),
}

impl Item {
    pub fn print(&self, language: Language) -> String {
        match self {
            Self::Function(function) => function.print(language),
            Self::Struct(about, name, fields) => {
                let field = |f: &String| match language {
                    Language::Wgsl => format!("    {f}: f32,\n"),
                    _ => format!("    float {f};\n"),
                };
                let end = if language == Language::Wgsl { "}" } else { "};" };
                let fields: String = fields.iter().map(field).collect();
                format!("{}struct {name} {{\n{fields}{end}\n", comment(about))
            }
        }
    }
}

impl Function {
    fn print(&self, language: Language) -> String {
        let parameters: Vec<String> = self.parameters.iter().map(|(name, of)| of.parameter(name, language)).collect();
        let (name, result, list) = (&self.name, self.result.name(language), parameters.join(", "));
        let head = match language {
            Language::Wgsl => format!("fn {name}({list}) -> {result} {{\n"),
            _ => format!("{result} {name}({list}) {{\n"),
        };
        let body: String = self.body.iter().map(|s| format!("    {}\n", s.print(language))).collect();
        format!("{}{head}{body}}}\n", comment(&self.comment))
    }
}

impl Statement {
    fn print(&self, language: Language) -> String {
        match self {
            Self::Let(name, of, value) => {
                let (of, value) = (of.name(language), translate(value, language));
                match language {
                    Language::Wgsl => format!("let {name}: {of} = {value};"),
                    _ => format!("{of} {name} = {value};"),
                }
            }
            Self::Variable(name, of) => match language {
                Language::Wgsl => format!("var {name}: {};", of.name(language)),
                _ => format!("{} {name};", of.name(language)),
            },
            Self::Set(name, value) => format!("{name} = {};", translate(value, language)),
            Self::Return(value) => format!("return {};", translate(value, language)),
        }
    }
}

impl Type {
    fn name(&self, language: Language) -> String {
        let [glsl, hlsl, wgsl] = match self {
            Self::Float => ["float", "float", "f32"],
            Self::Vec2 => ["vec2", "float2", "vec2f"],
            Self::Vec3 => ["vec3", "float3", "vec3f"],
            Self::Vec4 => ["vec4", "float4", "vec4f"],
            Self::Struct(name) => [name.as_str(); 3],
            // Of samplers, GLSL ES keeps only eight bits of a value unless told otherwise.
            Self::Texture2 => ["highp sampler2D", "Texture2D<float4>", "texture_2d<f32>"],
            Self::Texture2Array => ["highp sampler2DArray", "Texture2DArray<float4>", "texture_2d_array<f32>"],
            Self::Texture3 => ["highp sampler3D", "Texture3D<float4>", "texture_3d<f32>"],
            Self::Cube => ["highp samplerCube", "TextureCube<float4>", "texture_cube<f32>"],
            Self::NineColours => ["vec3", "float3", "array<vec3f, 9>"],
        };
        match language {
            Language::Glsl => glsl.to_owned(),
            Language::Hlsl => hlsl.to_owned(),
            Language::Wgsl => wgsl.to_owned(),
        }
    }

    fn parameter(&self, name: &str, language: Language) -> String {
        let of = self.name(language);
        let is_texture = matches!(self, Self::Texture2 | Self::Texture2Array | Self::Texture3 | Self::Cube);
        match language {
            Language::Glsl | Language::Hlsl if *self == Self::NineColours => format!("{of} {name}[9]"),
            Language::Hlsl if is_texture => format!("{of} {name}, SamplerState {name}_sampler"),
            Language::Wgsl if is_texture => format!("{name}: {of}, {name}_sampler: sampler"),
            Language::Wgsl => format!("{name}: {of}"),
            _ => format!("{of} {name}"),
        }
    }
}

/// A formula in the words of a language.
fn translate(formula: &str, language: Language) -> String {
    let (mut text, mut rest) = (String::new(), formula);
    while !rest.is_empty() {
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let end = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
        if end == 0 {
            let step = rest.chars().next().map_or(1, char::len_utf8);
            text += &rest[..step];
            rest = &rest[step..];
            continue;
        }
        let word = &rest[..end];
        rest = &rest[end..];
        match (word, language) {
            ("vec2" | "vec3" | "vec4", Language::Hlsl) => text += &word.replace("vec", "float"),
            ("vec2" | "vec3" | "vec4", Language::Wgsl) => text += &format!("{word}f"),
            ("mix", Language::Hlsl) => text += "lerp",
            ("atan2", Language::Glsl) => text += "atan",
            // Its arguments are three names or literals.
            ("sample_layer", _) => {
                let end = rest.find(')').map_or(rest.len(), |i| i + 1);
                let arguments: Vec<&str> = rest[1..end - 1].split(',').map(str::trim).collect();
                if let [name, at, layer] = arguments[..] {
                    text += &match language {
                        Language::Glsl => format!("textureLod({name}, vec3({at}, {layer}.0), 0.0)"),
                        Language::Hlsl => format!("{name}.SampleLevel({name}_sampler, float3({at}, {layer}.0), 0.0)"),
                        Language::Wgsl => format!("textureSampleLevel({name}, {name}_sampler, {at}, {layer}, 0.0)"),
                    };
                }
                rest = &rest[end..];
            }
            ("sample" | "pass", _) => {
                // Both are followed by a bracket and the name of a texture.
                let name_end = rest[1..].find(|c| !is_word(c)).map_or(rest.len(), |i| i + 1);
                let name = &rest[1..name_end];
                rest = &rest[name_end..];
                match (word, language) {
                    ("sample", Language::Glsl) => text += &format!("textureLod({name}"),
                    ("sample", Language::Hlsl) => text += &format!("{name}.SampleLevel({name}_sampler"),
                    ("sample", Language::Wgsl) => text += &format!("textureSampleLevel({name}, {name}_sampler"),
                    (_, Language::Glsl) => text += name,
                    _ => text += &format!("{name}, {name}_sampler"),
                }
                if word == "pass" {
                    rest = &rest[1..]; // its closing bracket
                }
            }
            _ => text += word,
        }
    }
    text
}

/// Lines of comment.
pub(super) fn comment(text: &str) -> String {
    text.lines().map(|line| format!("// {}", ascii(line)).trim_end().to_owned() + "\n").collect()
}

/// The text in ASCII, as old compilers want even their comments, and unable to end a comment or to go on after it.
fn ascii(text: &str) -> String {
    let mut plain = String::new();
    for c in text.chars() {
        if matches!(c, ' '..='~') && c != '\\' {
            plain.push(c);
            continue;
        }
        plain += match c {
            '\\' => "/", // at the end of a line it would make the next one comment too
            '−' | '–' | '—' => "-",
            '∫' => "integral of",
            'π' => "pi",
            'μ' => "mu",
            'ω' => "omega",
            'θ' => "theta",
            'φ' => "phi",
            'α' => "alpha",
            'η' => "eta",
            'ρ' => "rho",
            'σ' => "sigma",
            'Λ' => "Lambda",
            'Σ' => "sum of ",
            'τ' => "tau",
            'β' => "beta",
            'γ' => "gamma",
            'χ' => "chi",
            '·' => ".",
            '×' => "x",
            '±' => "+-",
            '√' => "sqrt",
            '²' => "^2",
            '³' => "^3",
            '⁴' => "^4",
            '⁵' => "^5",
            '⁶' => "^6",
            '½' => "1/2",
            '∥' => "parallel",
            '⊥' => "perpendicular",
            '≤' => "<=",
            '≥' => ">=",
            '∞' => "infinity",
            '“' | '”' => "\"",
            '’' => "'",
            'ü' => "ue",
            _ => "?",
        };
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::quantity;

    #[test]
    fn words_are_translated_and_nothing_else() {
        let formula = "mix(vec3(vec2_of_mine), sample(table, vec2(x, 0.5), 0.0).xyz, f(pass(table), mixed))";
        assert_eq!(
            translate(formula, Language::Glsl),
            "mix(vec3(vec2_of_mine), textureLod(table, vec2(x, 0.5), 0.0).xyz, f(table, mixed))"
        );
        assert_eq!(
            translate(formula, Language::Hlsl),
            "lerp(float3(vec2_of_mine), table.SampleLevel(table_sampler, float2(x, 0.5), 0.0).xyz, f(table, table_sampler, mixed))"
        );
        assert_eq!(
            translate(formula, Language::Wgsl),
            "mix(vec3f(vec2_of_mine), textureSampleLevel(table, table_sampler, vec2f(x, 0.5), 0.0).xyz, f(table, table_sampler, \
             mixed))"
        );
    }

    #[test]
    fn every_definition_can_be_written_in_ascii() {
        for handle in quantity::all() {
            let text = ascii(handle.quantity.definition);
            assert!(!text.contains('?'), "{}: {text}", handle.quantity.name);
        }
    }

    #[test]
    fn no_name_of_a_file_leaves_its_comment() {
        assert_eq!(comment("a\nb\\"), "// a\n// b/\n");
        assert_eq!(comment("a\rb\u{2028}c\0"), "// a?b?c?\n");
    }
}
