//! What a block's texels are: slow, obvious, and the oracle of the encoder.
//!
//! **Source**: Khronos, *Data Format Specification* 1.4, ASTC: weight application, HDR.

use super::layout::{Block, Mixed, TEXELS};

/// The texels as half floats.
pub(super) fn texels(block: &Block) -> [[u16; 3]; TEXELS] {
    match block {
        Block::Solid(colour) => [*colour; TEXELS],
        Block::Mixed(mixed) => logarithms(mixed).map(|texel| texel.map(half)),
    }
}

/// The texels of a block of more than one colour as ASTC interpolates them: five bits of exponent, eleven of a bent mantissa.
pub(super) fn logarithms(mixed: &Mixed) -> [[i32; 3]; TEXELS] {
    let ends = [0, mixed.mode.subsets - 1].map(|subset| mixed.ends(subset));
    std::array::from_fn(|texel| {
        let [low, high] = ends[mixed.subset(texel)];
        let weight = mixed.mode.weights.weight(mixed.weights[texel]).into();
        [0, 1, 2].map(|c| between(low[c] << 4, high[c] << 4, weight))
    })
}

/// A weight's share of one end and the rest of the other.
pub(super) fn between(low: i32, high: i32, weight: i32) -> i32 {
    (low * (64 - weight) + high * weight + 32) >> 6
}

/// The half float of such a logarithm: the mantissa follows 2^x by three straight lines.
pub(super) fn half(logarithm: i32) -> u16 {
    let (exponent, m) = (logarithm >> 11, logarithm & 0x7ff);
    let mantissa = match m {
        0..512 => 3 * m,
        512..1536 => 4 * m - 512,
        _ => 5 * m - 2048,
    };
    // The largest finite half, as the specification has it: rounding must not make infinity of a logarithm just below it.
    (exponent << 10 | mantissa >> 3).min(0x7bff) as u16
}

/// The logarithm, in those units and between them, whose half is nearest to a value of 0 to 65504.
pub(super) fn logarithm(value: f64) -> f64 {
    // Subnormals have the exponent 0, and no one before their mantissa.
    let exponent = if value < 2_f64.powi(-14) { 0 } else { ((value.to_bits() >> 52) as i32 - 1023) + 15 };
    let unit = 2_f64.powi(exponent.max(1) - 15);
    // The half drops three bits: its middle is 3.5 above.
    let mantissa = (value / unit - if exponent == 0 { 0.0 } else { 1.0 }) * 8192.0 + 3.5;
    let m = if mantissa < 1536.0 {
        mantissa / 3.0
    } else if mantissa < 5632.0 {
        (mantissa + 512.0) / 4.0
    } else {
        (mantissa + 2048.0) / 5.0
    };
    f64::from(exponent) * 2048.0 + m
}
