//! Arrays of numbers in source text: C, C++, GLSL, HLSL, JavaScript, TypeScript, Rust and JSON, read without a parser of any of them.
//!
//! What counts is only where brackets stand and what is between them. A bracket that holds nothing but numbers, commas, calls such as
//! `vec2(…)` or `f16::from_bits(…)` and further such brackets is an array; its name is that of the assignment or key in front of it.
//! Comments and strings are skipped. Suffixes (`0.5f`, `1u16`, `0.5_f32`) and separators (`1_000`) are taken off.
//!
//! - **Integers in hexadecimal** of at most four digits are the bits of half floats, longer ones those of floats.
//! - **Integers in decimal** are unsigned bytes or words that stand for 0 to 1, or the bits of halves where the declaration says so.
//! - **Decimals** are themselves; how many places they have tells how finely they are rounded.

mod json;
mod lengths;

use super::grid::Stored;
use crate::error::{Error, Result};
use half::f16;

/// An array of a source text.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// What it is called; empty where nothing in front of it names it.
    pub name: String,
    /// The numbers, in the order of the text.
    pub values: Vec<f64>,
    /// Its dimensions, the outermost first: of the brackets, of the declaration, or of constants beside it. One number for a flat array of
    /// which nothing is said.
    pub shape: Vec<usize>,
    /// How finely the numbers are rounded.
    pub stored: Stored,
}

/// Numbers below which a bracket is an index or an argument list, not a table.
const FEWEST: usize = 4;
/// Brackets within brackets beyond which nothing is an array: a table has four at most.
const DEEPEST: usize = 32;

#[derive(Debug, Clone, PartialEq)]
enum Token<'a> {
    Word(&'a str),
    Number(Literal),
    Text(&'a str),
    Mark(char),
    /// `::`, which joins words.
    Path,
}

/// A number as it is written.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Literal {
    value: f64,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// With so many hexadecimal digits.
    Hex(usize),
    Integer,
    /// With so many places after the point, exponent taken into account.
    Decimal(i32),
}

/// Every array of at least four numbers in `text`, in the order of the text.
pub fn arrays(text: &str) -> Vec<Array> {
    let tokens = tokens(text);
    let mut found = vec![];
    let mut open: Vec<Frame> = vec![];
    for (at, token) in tokens.iter().enumerate() {
        match token {
            Token::Mark('[' | '{' | '(') => {
                let broken = open.len() >= DEEPEST;
                open.push(Frame { broken, ..Frame::new(at) });
            }
            Token::Mark(']' | '}' | ')') => {
                let Some(frame) = open.pop() else { continue };
                close(frame, open.last_mut(), &mut found);
            }
            Token::Number(literal) => {
                if let Some(frame) = open.last_mut() {
                    let negative = tokens[..at].last() == Some(&Token::Mark('-'));
                    let value = if negative { -literal.value } else { literal.value };
                    frame.numbers.push(Literal { value, ..*literal });
                    frame.children += 1;
                }
            }
            Token::Word(word) => {
                let called = matches!(tokens.get(at + 1), Some(Token::Mark('(') | Token::Path));
                let value = match *word {
                    "NaN" | "NAN" | "nan" => Some(f64::NAN),
                    "Infinity" | "INFINITY" | "inf" => Some(f64::INFINITY),
                    _ => None,
                };
                match (open.last_mut(), value) {
                    (Some(frame), Some(value)) => {
                        frame.numbers.push(Literal { value, kind: Kind::Decimal(0) });
                        frame.children += 1;
                    }
                    (Some(frame), None) if !called && *word != "new" => frame.broken = true,
                    _ => {}
                }
            }
            Token::Mark(',' | '-' | '+') | Token::Path => {}
            Token::Mark(_) | Token::Text(_) => {
                if let Some(frame) = open.last_mut() {
                    frame.broken = true;
                }
            }
        }
    }
    while let Some(frame) = open.pop() {
        // A bracket that is never closed: what is whole within it still counts.
        found.extend(frame.whole);
    }
    let shapes = lengths::take_shapes(&mut found, &tokens);
    found.retain(|frame: &Frame| frame.numbers.len() >= FEWEST);
    found.sort_by_key(|frame| frame.at);
    found.into_iter().map(|frame| array(frame, &tokens, &shapes)).collect()
}

/// The array called `name`, or the only one.
///
/// **Errors**: none, several of which none is chosen, or no such name; the message lists the names. JSON that is cut off, and rows of unlike
/// lengths in it; the message says where.
pub fn choose(text: &str, name: Option<&str>) -> Result<Array> {
    if let Some(error) = json::cut_off(text) {
        return Err(error);
    }
    let mut all = arrays(text);
    let names = || {
        let mut names: Vec<String> = all
            .iter()
            .enumerate()
            .map(|(i, a)| {
                let name = if a.name.is_empty() { format!("{}", i + 1) } else { a.name.clone() };
                format!("{name} ({} numbers)", a.values.len())
            })
            .collect();
        if names.len() > MOST_NAMES {
            let more = names.len() - MOST_NAMES;
            names.truncate(MOST_NAMES);
            names.push(format!("and {more} more"));
        }
        names.join(", ")
    };
    if let Some(name) = name {
        let index = all.iter().position(|a| a.name == name).or_else(|| {
            let i: usize = name.parse().ok()?;
            (1..=all.len()).contains(&i).then(|| i - 1)
        });
        return match index {
            Some(i) => Ok(all.swap_remove(i)),
            None => Err(Error::usage(
                format!("no array called {name:?} among {}", if all.is_empty() { "none".into() } else { names() }),
                "give one of these with --array",
            )),
        };
    }
    match all.len() {
        1 => match json::ragged(text) {
            Some(error) => Err(error),
            None => Ok(all.swap_remove(0)),
        },
        0 => Err(json::broken(text).unwrap_or_else(|| {
            Error::invalid(
                "a text without an array of numbers",
                "give the source or JSON file that holds the table, or decode it to one that does",
            )
        })),
        n => Err(Error::usage(
            format!("{n} arrays in one text: {}", names()),
            "choose one with --array, such as --array 1",
        )),
    }
}

/// The strings of `text` and what each is called; strings joined by `+`, or that follow each other, are one.
pub(super) fn strings(text: &str) -> Vec<(String, String)> {
    let tokens = tokens(text);
    let mut found: Vec<(usize, String)> = vec![];
    let mut joined = false;
    for (at, token) in tokens.iter().enumerate() {
        match (token, found.last_mut()) {
            (Token::Text(more), Some((_, text))) if joined => *text += more,
            (Token::Text(text), _) => found.push((at, (*text).to_owned())),
            _ => {}
        }
        joined = matches!(token, Token::Text(_)) || (joined && *token == Token::Mark('+'));
    }
    found.into_iter().map(|(at, text)| (declaration(&tokens[..at]).0, text)).collect()
}

/// Names that a message lists at most.
const MOST_NAMES: usize = 24;

/// A bracket and what was found in it.
#[derive(Debug)]
struct Frame {
    /// The token that opens it.
    at: usize,
    numbers: Vec<Literal>,
    /// Things directly in it, numbers and brackets.
    children: usize,
    /// The shape that all its brackets have, once there is one.
    inner: Option<Vec<usize>>,
    /// Whether brackets of different shapes, or numbers beside brackets, are in it.
    ragged: bool,
    /// Whether something else than numbers is in it.
    broken: bool,
    /// Arrays within, should this turn out to be none itself.
    whole: Vec<Frame>,
}

impl Frame {
    fn new(at: usize) -> Self {
        Self { at, numbers: vec![], children: 0, inner: None, ragged: false, broken: false, whole: vec![] }
    }

    fn shape(&self) -> Vec<usize> {
        match &self.inner {
            Some(inner) if !self.ragged => {
                let mut shape = if self.children == 1 { vec![] } else { vec![self.children] };
                shape.extend(inner);
                shape
            }
            _ => vec![self.numbers.len()],
        }
    }
}

/// A bracket closes: it becomes part of the one around it, or whatever is whole in it is found.
fn close(mut frame: Frame, parent: Option<&mut Frame>, found: &mut Vec<Frame>) {
    if frame.broken {
        if let Some(parent) = parent {
            // `(float)` in front of a number says nothing; a bracket with numbers and other things says that this is code.
            parent.broken |= !(frame.numbers.is_empty() && frame.whole.is_empty());
            parent.whole.append(&mut frame.whole);
        } else {
            found.append(&mut frame.whole);
        }
        return;
    }
    frame.whole.clear(); // they are part of it
    match parent {
        None => found.push(frame),
        Some(parent) => {
            let shape = frame.shape();
            // f(0.5) is a number as much as 0.5 is.
            let scalar = frame.numbers.len() == 1;
            if !scalar && !frame.numbers.is_empty() {
                parent.ragged |= parent.inner.as_ref().is_some_and(|inner| *inner != shape)
                    || (parent.inner.is_none() && parent.children > 0);
                parent.inner = Some(shape);
            } else if scalar {
                parent.ragged |= parent.inner.is_some();
            }
            parent.children += usize::from(!frame.numbers.is_empty());
            parent.numbers.extend(&frame.numbers);
            parent.whole.push(frame);
        }
    }
}

fn array(frame: Frame, tokens: &[Token], shapes: &[Vec<usize>]) -> Array {
    let (name, declared, words) = declaration(&tokens[..frame.at]);
    let n = frame.numbers.len();
    let mut shape = frame.shape();
    if shape.len() == 1 && declared.iter().product::<usize>() == n {
        shape = declared;
    }
    if shape.len() == 1 {
        let named = shapes.iter().find(|shape| shape.iter().product::<usize>() == n).cloned();
        shape = named.or_else(|| lengths::said(tokens, n)).unwrap_or(shape);
    }
    let (values, stored) = interpret(&frame.numbers, &words);
    Array { name, values, shape, stored }
}

/// The name that stands before the opening bracket, the dimensions after it, and the words of the declaration.
fn declaration(before: &[Token]) -> (String, Vec<usize>, Vec<String>) {
    // The statement that the bracket ends: back to what separates statements, but for the semicolons of `[[f32; 2]; 2]`.
    let mut closed = 0_usize;
    let start = before
        .iter()
        .rposition(|t| {
            match t {
                Token::Mark(']') => closed += 1,
                Token::Mark('[') => closed = closed.saturating_sub(1),
                _ => {}
            }
            closed == 0 && matches!(t, Token::Mark(';' | '}'))
        })
        .map_or(0, |i| i + 1)
        .max(before.len().saturating_sub(64));
    let statement = &before[start..];
    let words: Vec<String> =
        statement.iter().filter_map(|t| if let Token::Word(w) = t { Some((*w).to_owned()) } else { None }).collect();
    // JSON and object literals: "name": [
    let colon = statement.iter().rposition(|t| !matches!(t, Token::Mark('(' | '[' | '{') | Token::Word(_)));
    if let Some(i) = colon
        && statement[i] == Token::Mark(':')
        && i > 0
        && let Token::Text(name) | Token::Word(name) = statement[i - 1]
    {
        return (name.to_owned(), vec![], words);
    }
    // C++ may initialise without `=`.
    let equals = statement.iter().rposition(|t| *t == Token::Mark('=')).unwrap_or(statement.len());
    let left = &statement[..equals];
    // `const NAME: TYPE =` names before the colon, `TYPE NAME[64][2] =` last before its dimensions.
    let typed = left.iter().position(|t| *t == Token::Mark(':'));
    let name_end = typed.unwrap_or(left.len());
    // Words within the dimensions are their constants.
    let mut depth = 0;
    let name_at = (0..name_end).rev().find(|&i| {
        match left[i] {
            Token::Mark(']') => depth += 1,
            Token::Mark('[') => depth -= 1,
            _ => {}
        }
        depth <= 0 && matches!(left[i], Token::Word(_))
    });
    let name =
        name_at.map_or(String::new(), |i| if let Token::Word(w) = left[i] { w.to_owned() } else { String::new() });
    let dimensions = match (typed, name_at) {
        (None, Some(i)) => left[i..]
            .iter()
            .filter_map(|t| match t {
                Token::Number(n) if n.value >= 1.0 && n.value.fract() == 0.0 => Some(n.value as usize),
                _ => None,
            })
            .collect(),
        _ => vec![],
    };
    (name, dimensions, words)
}

/// What the literals stand for.
fn interpret(literals: &[Literal], words: &[String]) -> (Vec<f64>, Stored) {
    let all = |test: fn(Kind) -> bool| literals.iter().all(|l| test(l.kind));
    let says = |word: &str| words.iter().any(|w| w.to_lowercase().contains(word));
    let numbers = || literals.iter().map(|l| l.value);
    let largest = numbers().fold(0.0, f64::max);
    let halves = || (numbers().map(|v| f64::from(f16::from_bits(v as u16))).collect(), Stored::F16);
    if all(|k| matches!(k, Kind::Hex(_))) {
        let digits = literals.iter().map(|l| if let Kind::Hex(n) = l.kind { n } else { 0 }).max().unwrap_or(0);
        if digits > 4 && largest <= f64::from(u32::MAX) {
            return (numbers().map(|v| f64::from(f32::from_bits(v as u32))).collect(), Stored::F32);
        }
        if digits > 2 || says("half") || says("16") {
            return halves();
        }
    }
    let whole = all(|k| matches!(k, Kind::Hex(_) | Kind::Integer)) && numbers().all(|v| v >= 0.0);
    let is_bit = largest <= 1.0; // an array of zeros and ones is just that
    if whole && !is_bit && largest <= 65535.0 {
        // Halves up to 2: nothing that stands for 0 to 1 in words reaches only a quarter of them by chance and says half.
        if largest > 255.0 && (says("half") || says("f16") || largest <= f64::from(f16::from_f32(2.0).to_bits())) {
            return halves();
        }
        let (scale, bits) = if largest > 255.0 { (65535.0, 16) } else { (255.0, 8) };
        return (numbers().map(|v| v / scale).collect(), Stored::Unorm(bits));
    }
    let places = literals.iter().map(|l| if let Kind::Decimal(n) = l.kind { n } else { 0 }).max().unwrap_or(0);
    let values: Vec<f64> = numbers().collect();
    let stored = Stored::of_decimals(&values, places);
    (values, stored)
}

fn tokens(text: &str) -> Vec<Token<'_>> {
    let bytes = text.as_bytes();
    let mut tokens = vec![];
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let rest = &text[at..];
        if byte.is_ascii_whitespace() {
            at += 1;
        } else if rest.starts_with("//") || (byte == b'#' && !rest.starts_with("#[")) {
            at += rest.find('\n').unwrap_or(rest.len());
        } else if let Some(comment) = rest.strip_prefix("/*") {
            at += comment.find("*/").map_or(rest.len(), |end| end + 4);
        } else if matches!(byte, b'"' | b'`') || (byte == b'\'' && is_quoted_data(rest)) {
            let end = string_end(&bytes[at..]);
            tokens.push(Token::Text(text.get(at + 1..at + end - 1).unwrap_or_default()));
            at += end;
        } else if byte.is_ascii_digit() || (byte == b'.' && bytes.get(at + 1).is_some_and(u8::is_ascii_digit)) {
            let (literal, length) = number(rest);
            tokens.extend(literal.map(Token::Number));
            at += length;
        } else if byte.is_ascii_alphabetic() || byte == b'_' || byte == b'$' {
            let length = rest.bytes().take_while(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'$')).count();
            tokens.push(Token::Word(&rest[..length]));
            at += length;
        } else if rest.starts_with("::") {
            tokens.push(Token::Path);
            at += 2;
        } else {
            let mark = rest.chars().next().unwrap_or(' ');
            tokens.push(Token::Mark(mark));
            at += mark.len_utf8();
        }
    }
    tokens
}

/// Characters of a string in single quotes from which it is data: characters and lifetimes are shorter.
const LONG_STRING: usize = 64;

/// Whether a long string without blanks stands in single quotes, as JavaScript has it and no other language.
fn is_quoted_data(rest: &str) -> bool {
    let length = rest.bytes().skip(1).take_while(|b| b.is_ascii_graphic() && !matches!(b, b'\'' | b'\\')).count();
    length >= LONG_STRING && rest.as_bytes().get(length + 1) == Some(&b'\'')
}

/// Bytes of the string that begins here, its quotes included.
fn string_end(bytes: &[u8]) -> usize {
    let mut at = 1;
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'\\' => at += 2,
            _ if byte == bytes[0] => return at + 1,
            _ => at += 1,
        }
    }
    bytes.len()
}

/// The number at the beginning of `text`, if it is one, and its length with its suffix.
fn number(text: &str) -> (Option<Literal>, usize) {
    let bytes = text.as_bytes();
    let word = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_alphanumeric() || **b == b'_').count();
    if bytes.len() > 2 && bytes[0] == b'0' && matches!(bytes[1], b'x' | b'X') {
        let length = 2 + word(2);
        let body: String = text[2..length].replace('_', "");
        let body = body.trim_end_matches(['u', 'U', 'l', 'L']);
        let body = ["u16", "u32", "i32", "n"].iter().find_map(|s| body.strip_suffix(s)).unwrap_or(body);
        let value = u64::from_str_radix(body, 16).ok().map(|v| v as f64);
        return (value.map(|value| Literal { value, kind: Kind::Hex(body.len()) }), length);
    }
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit() || **b == b'_').count();
    let mut end = digits(0);
    let mut decimal = false;
    let mut places = 0;
    // `0..1` is a range, not a number and a half.
    if bytes.get(end) == Some(&b'.') && bytes.get(end + 1) != Some(&b'.') {
        decimal = true;
        places = digits(end + 1);
        end += 1 + places;
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let n = digits(end + 1 + sign);
        if n > 0 {
            decimal = true;
            end += 1 + sign + n;
        }
    }
    let body = text[..end].replace('_', "");
    let length = end + word(end); // the suffix
    let Ok(value) = body.parse::<f64>() else { return (None, length.max(1)) };
    let exponent: i32 = body.split(['e', 'E']).nth(1).and_then(|e| e.parse().ok()).unwrap_or(0);
    let kind = if decimal { Kind::Decimal(places as i32 - exponent) } else { Kind::Integer };
    (Some(Literal { value, kind }), length.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn only(text: &str) -> Array {
        choose(text, None).unwrap_or_else(|e| panic!("{text}: {e}"))
    }

    #[test]
    fn arrays_of_many_languages_are_read() {
        let wanted = vec![0.5, 0.25, 1.0, 0.125];
        for text in [
            "static const float dfg[2][2] = { { 0.5f, 0.25f }, { 1.0f, .125f } }; // 7, 8, 9, 10",
            "const dfg = [[0.5, 0.25], [1., 1.25e-1]];",
            "export const dfg = new Float32Array( [ 0.5, 0.25, 1, 0.125 ] );",
            "pub const dfg: [[f32; 2]; 2] = [[0.5, 0.25], [1.0_f32, 0.125]];",
            "{\"size\": 2, \"dfg\": [0.5, 0.25, 1.0, 0.125]}",
            "const vec2 dfg[2] = vec2[](vec2(0.5, 0.25), vec2(1.0, 0.125));",
            "pub static dfg: [Vec2; 2] = [Vec2::new(0.5, 0.25), Vec2::new(1.0, 0.125)];",
            "/* float other[4] = {1,2,3,4}; */ float dfg[] = { (float)0.5, 0.25, 1.0, 0.125, };",
            "const dfg = new Uint16Array([0x3800, 0x3400, 0x3c00, 0x3000]);",
            "static const uint16_t dfg[4] = {14336, 13312, 15360, 12288};",
            "uint32_t dfg[] = {0x3f000000u, 0x3e800000u, 0x3f800000u, 0x3e000000u};",
            "constexpr float dfg[ROWS * COLUMNS]{0.5f, 0.25f, 1.0f, 0.125f};",
            "let dfg = [f16::from_bits(0x3800), f16::from_bits(0x3400), f16::from_bits(0x3c00), f16::from_bits(0x3000)];",
        ] {
            let found = only(text);
            assert_eq!(found.values, wanted, "{text}");
            assert_eq!(found.name, "dfg", "{text}");
        }
    }

    #[test]
    fn dimensions_come_from_brackets_or_from_the_declaration() {
        assert_eq!(only("float a[2][3] = {1.5,2,3,4,5,6};").shape, [2, 3]);
        assert_eq!(only("[[[1.5,2],[3,4],[5,6]]]").shape, [3, 2]);
        assert_eq!(only("{{1.5,2,3},{3,4}}").shape, [5], "ragged");
        assert_eq!(only("[1.5,2,3,4]").shape, [4]);
    }

    #[test]
    fn a_flat_array_has_the_lengths_that_the_text_says() {
        let numbers = "0.5, 0.25, 0.125, 1.0, 0.75, 0.5, 0.25, 0.125, 1.0, 0.75, 0.5, 0.25";
        for (text, shape) in [
            ("static const int LUT_WIDTH = 3; static const int LUT_HEIGHT = 4; float lut[12] = {VALUES};", vec![4, 3]),
            ("const A_HEIGHT: u32 = 2u; const A_WIDTH: u32 = 3u; const A = array<f32, 12>(VALUES);", vec![2, 3, 2]),
            ("{\"width\": 2, \"height\": 2, \"channels\": 3, \"data\": [VALUES]}", vec![2, 2, 3]),
            ("export const t = { shape: [2, 2, 1, 3], data: new Float32Array([VALUES]) };", vec![2, 2, 1, 3]),
            ("export const t = { shape: [6, 2], data: new Float32Array([VALUES]) };", vec![6, 2]),
            // What does not fit, or contradicts itself, says nothing.
            ("const int WIDTH = 5; float lut[12] = {VALUES};", vec![12]),
            ("const int A_WIDTH = 3; const int B_WIDTH = 4; const int HEIGHT = 4; float lut[12] = {VALUES};", vec![12]),
            ("int width = 0; float lut[] = {VALUES};", vec![12]),
        ] {
            let found = only(&text.replace("VALUES", numbers));
            assert_eq!(found.shape, shape, "{text}");
            assert_eq!(found.values.len(), 12, "{text}");
        }
    }

    #[test]
    fn how_finely_numbers_are_rounded_is_read_off_them() {
        assert_eq!(only("[0.123, 0.456, 0.7, 0.111]").stored, Stored::Decimal(3));
        assert_eq!(only("[0x3c00, 0x3800, 0, 0x1]").stored, Stored::F16, "zero may be short");
        assert_eq!(only("[0, 128, 255, 3]").stored, Stored::Unorm(8));
        assert_eq!(only("[1, 65535, 300, 40000]").stored, Stored::Unorm(16));
        // 0.333251953125 is a half that was printed with nine places.
        assert_eq!(only("[0.333251953, 0.5, 0.099975586, 0.899902344]").stored, Stored::F16);
    }

    #[test]
    fn two_arrays_need_a_choice() {
        let text = "float a[4] = {1.,2.,3.,4.}; float b[4] = {5.,6.,7.,8.};";
        let message = choose(text, None).unwrap_err().to_string();
        assert!(message.contains("a (4 numbers), b (4 numbers); choose one with --array"), "{message}");
        assert_eq!(choose(text, Some("b")).unwrap().values[0], 5.0);
        assert_eq!(choose(text, Some("1")).unwrap().name, "a");
        assert!(choose(text, Some("c")).unwrap_err().to_string().contains("no array called \"c\" among a"));
        assert!(choose("int main() { return f(1, 2); }", None).is_err());
    }

    #[test]
    fn code_around_an_array_does_not_hide_it() {
        let text = "void f() { g(1, 2, 3, 4, x); float t[4] = {0.5, -0.25, 1.5e+0, NaN}; if (a < 3) { b[2] = 1; } }";
        let found = only(text);
        assert_eq!(found.name, "t");
        assert_eq!(found.values[..3], [0.5, -0.25, 1.5]);
        assert!(found.values[3].is_nan());
    }
}
