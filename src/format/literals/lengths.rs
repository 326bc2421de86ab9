//! The lengths of a flat array where the text around it says them: `const int LUT_WIDTH = 64;`, `"width": 64`, `shape: [64, 64, 2]`.

use super::{Frame, Kind, Token};

/// What constants end in that are lengths, the slowest axis first.
const AXES: [&str; 4] = ["depth", "height", "width", "channels"];

/// The dimensions that the text says of an array of `n` numbers, the outermost first; nothing where it says none that fit, or
/// contradicts itself.
pub(super) fn said(tokens: &[Token], n: usize) -> Option<Vec<usize>> {
    let [depth, height, width, channels] = AXES.map(|axis| constant(tokens, axis));
    if [&depth, &height, &width, &channels].iter().any(|length| length.is_err()) {
        return None;
    }
    let (width, channels) = (width.ok()??, channels.ok()?);
    let mut shape: Vec<usize> = [depth.ok()?, height.ok()?].into_iter().flatten().chain([width]).collect();
    let texels = shape.iter().try_fold(1_usize, |n, &length| n.checked_mul(length)).filter(|&texels| texels > 0)?;
    // A texture's channels often go without saying.
    match channels.or(n.is_multiple_of(texels).then_some(n / texels))? {
        1 if texels == n => {}
        channels if (1..=4).contains(&channels) && texels.checked_mul(channels) == Some(n) => shape.push(channels),
        _ => return None,
    }
    Some(shape)
}

/// The whole number that constants are, whose names end in `axis`.
///
/// **Errors**: several of different values.
fn constant(tokens: &[Token], axis: &str) -> Result<Option<usize>, ()> {
    let mut found = None;
    for (at, token) in tokens.iter().enumerate() {
        let (Token::Word(name) | Token::Text(name)) = token else { continue };
        if !name.to_ascii_lowercase().ends_with(axis) {
            continue;
        }
        // `NAME = 64`, `NAME: u32 = 64`, `"name": 64`.
        let value = match &tokens[at + 1..] {
            [Token::Mark('='), Token::Number(n), ..] => n,
            [Token::Mark(':'), Token::Word(_), Token::Mark('='), Token::Number(n), ..] => n,
            [Token::Mark(':'), Token::Number(n), ..] => n,
            _ => continue,
        };
        if value.kind != Kind::Integer || found.is_some_and(|known| known != value.value as usize) {
            return Err(());
        }
        found = Some(value.value as usize);
    }
    Ok(found)
}

/// Takes brackets of whole numbers called `shape` whose product is how many numbers another bracket has out of `frames`: they say what that
/// one's shape is.
pub(super) fn take_shapes(frames: &mut Vec<Frame>, tokens: &[Token]) -> Vec<Vec<usize>> {
    let counts: Vec<usize> = frames.iter().map(|frame| frame.numbers.len()).collect();
    let mut shapes = vec![];
    frames.retain(|frame| {
        let lengths: Vec<usize> = frame.numbers.iter().map(|n| n.value as usize).collect();
        let whole = frame.numbers.iter().all(|n| n.kind == Kind::Integer && n.value >= 1.0);
        let product = lengths.iter().try_fold(1_usize, |n, &length| n.checked_mul(length));
        let is_shape = whole
            && is_called(&tokens[..frame.at], "shape")
            && product.is_some_and(|product| product > lengths.len() && counts.contains(&product));
        if is_shape {
            shapes.push(lengths);
        }
        !is_shape
    });
    shapes
}

/// Whether an assignment or a key of that name stands last.
fn is_called(before: &[Token], name: &str) -> bool {
    matches!(before, [.., Token::Word(word) | Token::Text(word), Token::Mark(':' | '=')] if word.eq_ignore_ascii_case(name))
}
