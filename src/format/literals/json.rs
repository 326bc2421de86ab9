//! Where JSON breaks off, breaks, or has rows of unlike lengths: a person looks for that with line and column.

use crate::error::Error;
use serde::de::IgnoredAny;

/// Whether `text` may be meant as JSON.
fn is_meant(text: &str) -> bool {
    text.trim_start().starts_with(['[', '{'])
}

/// What is wrong with a JSON text that ends too early.
pub(super) fn cut_off(text: &str) -> Option<Error> {
    let error = is_meant(text).then(|| serde_json::from_str::<IgnoredAny>(text).err()).flatten()?;
    let what = || format!("a JSON text that is cut off: {error}");
    error.is_eof().then(|| Error::invalid(what(), "save or download the whole of it again"))
}

/// What is wrong with a JSON text in which no array was found, if it is none that can be read.
pub(super) fn broken(text: &str) -> Option<Error> {
    let error = is_meant(text).then(|| serde_json::from_str::<IgnoredAny>(text).err()).flatten()?;
    Some(Error::invalid(
        format!("a text without an array of numbers, which breaks as JSON: {error}"),
        "correct it there",
    ))
}

/// A bracket that is open.
struct Open {
    is_array: bool,
    /// Where it stands.
    line: usize,
    column: usize,
    /// Commas directly in it, and whether anything else is.
    commas: usize,
    is_filled: bool,
    /// How many entries its rows have.
    of_rows: Option<usize>,
}

/// The first row of a JSON text that is shorter or longer than those before it; nothing in what is no JSON.
pub(super) fn ragged(text: &str) -> Option<Error> {
    if !is_meant(text) || serde_json::from_str::<IgnoredAny>(text).is_err() {
        return None;
    }
    let (mut line, mut column, mut open) = (1, 0, Vec::<Open>::new());
    let (mut in_text, mut escaped) = (false, false);
    for c in text.chars() {
        column += 1;
        match c {
            '\n' => (line, column) = (line + 1, 0),
            _ if escaped => escaped = false,
            '\\' if in_text => escaped = true,
            '"' => {
                in_text = !in_text;
                open.last_mut().into_iter().for_each(|own| own.is_filled = true);
            }
            _ if in_text => {}
            '[' | '{' => {
                open.last_mut().into_iter().for_each(|own| own.is_filled = true);
                open.push(Open { is_array: c == '[', line, column, commas: 0, is_filled: false, of_rows: None });
            }
            ']' | '}' => {
                let row = open.pop()?;
                let n = row.commas + usize::from(row.is_filled);
                if let Some(around) = open.last_mut().filter(|around| around.is_array && row.is_array) {
                    match around.of_rows {
                        Some(others) if others != n => {
                            return Some(Error::invalid(
                                format!(
                                    "the row that begins at line {}, column {}, has {n} entries, where those before it have {others}",
                                    row.line, row.column
                                ),
                                "give every row as many",
                            ));
                        }
                        _ => around.of_rows = Some(n),
                    }
                }
            }
            ',' => open.last_mut().into_iter().for_each(|own| own.commas += 1),
            c if !c.is_whitespace() => open.last_mut().into_iter().for_each(|own| own.is_filled = true),
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::super::choose;

    #[test]
    fn json_that_is_cut_off_broken_or_ragged_is_refused_with_the_place() {
        for (text, wanted) in [
            (
                "[[0.5, 0.25],\n [0.125, 1.0",
                "a JSON text that is cut off: EOF while parsing a list at line 2 column 12",
            ),
            ("{\"lut\": [0.5, 0.25, 0.125, 1.0]", "EOF while parsing an object at line 1 column 31"),
            ("[\"a\", 0.5 0.25]", "breaks as JSON: expected `,` or `]` at line 1 column 11"),
            (
                "[[0.5, 0.25, 0.1],\n [0.125, 1.0]]",
                "the row that begins at line 2, column 2, has 2 entries, where those before it have 3",
            ),
            ("{\"a, [\": [[1.5, 2], [3, 4], [5]]}", "line 1, column 29, has 1 entries, where those before it have 2"),
        ] {
            let message = choose(text, None).unwrap_err().to_string();
            assert!(message.contains(wanted), "{text}: {message}");
        }
        assert_eq!(choose("{0.5f, 0.25f, 0.125f, 1.0f}", None).unwrap().values.len(), 4, "an initialiser is no JSON");
    }
}
