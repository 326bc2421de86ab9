//! Files within source text: strings of base64, as `data:` addresses or bare, as scripts carry their textures.

use super::FileKind;
use super::literals;
use crate::error::{Error, Result};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

/// A file that stands in a text.
#[derive(Debug, Clone, PartialEq)]
pub struct Embedded {
    /// What the string is called; empty where nothing in front of it names it.
    pub name: String,
    /// The file.
    pub bytes: Vec<u8>,
}

/// Characters below which a string is no file: no header is shorter.
const FEWEST: usize = 64;
/// Many writers leave the padding out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Every file of a kind that Kiln reads in `text`, in the order of the text.
pub fn files(text: &str) -> Vec<Embedded> {
    let file = |(name, string): (String, String)| {
        let code = match string.strip_prefix("data:") {
            Some(address) => address.split_once(";base64,")?.1,
            None => &string,
        };
        if code.len() < FEWEST {
            return None;
        }
        let bytes = BASE64.decode(code).ok()?;
        let known = !matches!(FileKind::of(&bytes), FileKind::Empty | FileKind::Other(_) | FileKind::Source);
        known.then_some(Embedded { name, bytes })
    };
    literals::strings(text).into_iter().filter_map(file).collect()
}

/// The file called `name`, or the only one of a text without arrays; nothing where an array is meant.
///
/// **Errors**: several of which none is chosen, files and arrays together; the message lists the names.
pub fn choose(text: &str, name: Option<&str>) -> Result<Option<Embedded>> {
    let mut found = files(text);
    let arrays = literals::arrays(text);
    if let Some(name) = name {
        let named = found.iter().position(|file| file.name == name).map(|i| found.swap_remove(i));
        if named.is_none() && arrays.is_empty() && !found.is_empty() {
            let names: Vec<String> = found.iter().map(|f| f.name.escape_debug().to_string()).collect();
            return Err(Error::usage(
                format!("no file called {name:?} among {}", names.join(", ")),
                "give one of these with --array",
            ));
        }
        return Ok(named);
    }
    match (found.len(), arrays.len()) {
        (0, _) => Ok(None),
        (1, 0) => Ok(found.pop()),
        (files, n) => {
            let names = found.iter().map(|f| &f.name).chain(arrays.iter().map(|a| &a.name));
            let names: Vec<String> = names.map(|name| name.escape_debug().to_string()).collect();
            Err(Error::usage(
                format!("{files} files in base64 and {n} arrays in one text: {}", names.join(", ")),
                "choose one with --array NAME",
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::{Texture, png};
    use crate::pack::{Number, TexelFormat};

    fn picture() -> Vec<u8> {
        let format = TexelFormat::Plain { channels: 1, number: Number::Unorm8 };
        png::encode(&Texture { levels: vec![vec![1, 2, 3, 4]], ..Texture::empty(format, 2, 2) }).unwrap()
    }

    #[test]
    fn a_file_in_base64_is_found_however_it_is_quoted() {
        let (bytes, code) = (picture(), BASE64.encode(picture()));
        let (head, tail) = code.split_at(40);
        let bare = code.trim_end_matches('=');
        for text in [
            format!("import {{ a }} from \"b\";\nconst _brdf = \"data:image/png;base64,{code}\";\nlet x = 1;"),
            format!("export const _brdf = 'data:image/png;base64,{code}';"),
            format!("var _brdf = \"{head}\" +\n  \"{tail}\";"),
            format!("static const char* _brdf =\n \"{head}\"\n \"{tail}\";"),
            format!("{{\"size\": 2, \"_brdf\": \"{bare}\"}}"),
        ] {
            let found = choose(&text, None).unwrap().unwrap_or_else(|| panic!("{text}"));
            assert_eq!((found.name.as_str(), &found.bytes), ("_brdf", &bytes), "{text}");
        }
    }

    #[test]
    fn what_is_no_file_is_left_alone_and_two_need_a_choice() {
        let code = BASE64.encode(picture());
        let noise = "QUJD".repeat(40);
        assert_eq!(choose(&format!("a = \"{noise}\"; b = [1, 2, 3, 4.5];"), None).unwrap(), None);
        let two = format!("a = \"{code}\"; b = \"{code}\"; c = [1, 2, 3, 4.5];");
        let message = choose(&two, None).unwrap_err().to_string();
        assert!(message.contains("2 files in base64 and 1 arrays in one text: a, b, c"), "{message}");
        assert_eq!(choose(&two, Some("b")).unwrap().unwrap().name, "b");
        assert_eq!(choose(&two, Some("c")).unwrap(), None, "an array");
        let message = choose(&format!("a = \"{code}\";"), Some("b")).unwrap_err().to_string();
        assert!(message.contains("no file called \"b\" among a;"), "{message}");
        // Lifetimes and characters are no strings.
        assert!(choose("fn f<'a>(x: &'a [f32]) -> char { 'x' }", None).unwrap().is_none());
    }
}
