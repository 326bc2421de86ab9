//! Colour primaries in KTX2: a number in the data format descriptor, and eight numbers under a key for those without one.

use super::read::{DAMAGED, section};
use crate::colour::Primaries;
use crate::error::{Error, Result};
use ::ktx2::{ColorPrimaries, Header};

/// The key of primaries that the descriptor has no name for.
pub(super) const KEY: &str = "kiln.primaries";

/// Where the primaries stand in the descriptor: behind its length, the block's head and the colour model.
const AT: usize = 13;

/// Those that have a name here and in the descriptor. (ACEScc has the primaries of ACEScg; they differ in the curve, which has
/// a field of its own.)
const NAMES: [(Primaries, ColorPrimaries); 5] = [
    (Primaries::REC709, ColorPrimaries::BT709),
    (Primaries::ACESCG, ColorPrimaries::ACESCC),
    (Primaries::ACES2065, ColorPrimaries::ACES),
    (Primaries::REC2020, ColorPrimaries::BT2020),
    (Primaries::DISPLAY_P3, ColorPrimaries::DISPLAYP3),
];

/// What the descriptor calls them; nothing is "unspecified".
pub(super) fn name(primaries: Primaries) -> Option<ColorPrimaries> {
    NAMES.iter().find(|(known, _)| *known == primaries).map(|(_, name)| *name)
}

/// The metadata of those without a name.
pub(super) fn pair(primaries: Primaries) -> Option<(String, String)> {
    let text = || primaries.chromaticities().as_flattened().iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    name(primaries).is_none().then(|| (KEY.to_owned(), text()))
}

/// The primaries of a file; their pair is taken out of its metadata.
pub(super) fn primaries(header: &Header, bytes: &[u8], metadata: &mut Vec<(String, String)>) -> Result<Primaries> {
    let own = metadata.iter().position(|(key, _)| key == KEY).map(|at| metadata.remove(at).1);
    let index = &header.index;
    let descriptor = section(bytes, index.dfd_byte_offset.into(), index.dfd_byte_length.into()).unwrap_or_default();
    let number = descriptor.get(AT).copied().unwrap_or(0);
    if let Some((primaries, _)) = NAMES.iter().find(|(_, name)| name.value() == number) {
        return Ok(*primaries);
    }
    if number != 0 {
        return Err(Error::unsupported(
            format!("the KTX2's colour primaries have the number {number}, which Kiln does not know"),
            "export it again with primaries BT.709",
        ));
    }
    let Some(text) = own else { return Ok(Primaries::REC709) };
    let numbers: Vec<f64> = text.split(' ').map_while(|word| word.parse().ok()).collect();
    let &[rx, ry, gx, gy, bx, by, wx, wy] = &numbers[..] else {
        return Err(Error::invalid(format!("the KTX2's `{KEY}` holds no eight numbers"), DAMAGED));
    };
    Primaries::new([[rx, ry], [gx, gy], [bx, by], [wx, wy]])
}
