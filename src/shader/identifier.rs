//! Names that every shading language takes, from names of files.

use std::path::Path;

/// What the functions of a file's code begin with: the name of the file without folders and extension, in letters, digits and single
/// underscores. They end in words of their own, so that no reserved word is in the way.
pub fn identifier(file: &str) -> String {
    let stem = Path::new(file).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    clean(stem)
}

/// One name per file, all different: those that would be equal have their extension, or else a number.
pub fn identifiers(files: &[&str]) -> Vec<String> {
    let mut names: Vec<String> = vec![];
    for file in files {
        let whole = clean(Path::new(file).file_name().and_then(|name| name.to_str()).unwrap_or_default());
        let numbered = (2..).map(|n| format!("{whole}_{n}"));
        let name = [identifier(file), whole.clone()].into_iter().chain(numbered).find(|name| !names.contains(name));
        names.extend(name);
    }
    names
}

/// The name of a quantity as a field: its last part, or all of it where two would be equal; a quantity that is there more than once
/// (changed in different ways) is numbered.
pub(super) fn fields(quantities: &[&str]) -> Vec<String> {
    let short = |name: &str| clean(name.rsplit('.').next().unwrap_or(name));
    let all: Vec<String> = quantities.iter().map(|q| short(q)).collect();
    let is_unique = |name: &String| all.iter().filter(|other| *other == name).count() == 1;
    let mut fields: Vec<String> = vec![];
    for (quantity, name) in quantities.iter().zip(&all) {
        let name = if is_unique(name) { name.clone() } else { clean(quantity) };
        let numbered = (2..).map(|n| format!("{name}_{n}"));
        fields.extend([name.clone()].into_iter().chain(numbered).find(|name| !fields.contains(name)));
    }
    fields
}

fn clean(text: &str) -> String {
    let mut name = String::new();
    for c in text.chars() {
        if c.is_ascii_alphanumeric() {
            name.push(c);
        } else if !name.is_empty() && !name.ends_with('_') {
            name.push('_'); // GLSL reserves two in a row
        }
    }
    let name = name.trim_end_matches('_');
    // No language lets a name begin with a digit, and GLSL keeps `gl_` for itself.
    if name.is_empty() || name.starts_with(|c: char| c.is_ascii_digit()) || name.starts_with("gl_") || name == "gl" {
        return format!("baked_{name}").trim_end_matches('_').to_owned();
    }
    name.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_become_names_of_functions() {
        for (file, name) in [
            ("dfg.ktx2", "dfg"),
            ("out/ggx-albedo.ktx2", "ggx_albedo"),
            ("3d table (new).exr", "baked_3d_table_new"),
            ("__a__b__.exr", "a_b"),
            ("größe.exr", "gr_e"),
            ("λ.exr", "baked"),
            ("gl_x.exr", "baked_gl_x"),
            ("", "baked"),
        ] {
            assert_eq!(identifier(file), name, "{file:?}");
        }
    }

    #[test]
    fn no_two_files_have_the_same_name() {
        assert_eq!(
            identifiers(&["dfg.ktx2", "a/dfg.exr", "b/dfg.exr", "c/dfg.exr", "λ", "μ"]),
            ["dfg", "dfg_exr", "dfg_exr_2", "dfg_exr_3", "baked", "baked_2"]
        );
    }

    #[test]
    fn fields_are_short_where_that_is_clear() {
        assert_eq!(fields(&["ggx.scale", "ggx.bias"]), ["scale", "bias"]);
        assert_eq!(
            fields(&["burley.albedo", "burley-renormalized.albedo"]),
            ["burley_albedo", "burley_renormalized_albedo"]
        );
        assert_eq!(fields(&["compensation.kulla-conty"]), ["kulla_conty"]);
        assert_eq!(fields(&["ggx.albedo", "ggx.albedo"]), ["ggx_albedo", "ggx_albedo_2"]);
    }
}
