//! UASTC HDR 4x4: blocks of 4 × 4 texels in 16 bytes, of three half floats each. They are blocks of ASTC's HDR profile, and of those the ones
//! that Basis Universal's transcoder turns into BC6H without looking at a texel.
//!
//! - **Rounding**: lossy. The encoder chooses each block's mode, end points and weights so that the squares of what its texels are off by, in the
//!   logarithms that ASTC interpolates, add up to little; half of the sum is what they are off by after transcoding. The report's errors are those
//!   of ASTC, by a decoder of our own, and, as `max_transcoded_error`, those of the BC6H that the transcoder makes, by a model of it. There is no
//!   step: what a texel can be depends on its fifteen neighbours.
//! - **A block of one colour** holds the nearest halves of it, in ASTC and in BC6H: white stays white.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond 65504 are stored as that and counted. Of several colours none is beyond 65216, which is 0.4 % less; and where one
//!   is thousands of times another, end points have eight bits, which end at 60416, or in blue seven, which end at 55296. That is error, not
//!   overflow.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as 65504.
//! - **Sizes** that are no multiple of 4: see [`blocks`].
//! - **Read**: the 24 modes that the subset has. Any other block is NaN, as ASTC has it of what is no block.
//! - **Bytes**: the same on every machine; no step of the search uses a function that machines round differently.
//!
//! Known imperfection: ten of its modes, those of one subset with 10 or with 3 to 6 levels of weights, are read but never written. Tried beside the
//! others on the chains of four panoramas, from 256² down to 8², they took 0.8 % off the error of a level at most, and of the largest levels nothing.

mod decode;
mod encode;
mod endpoints;
mod fit;
mod integers;
mod layout;
mod transcoded;

#[cfg(test)]
mod tests;

use super::{PackReport, binary16, blocks};
use half::f16;
use layout::Block;
use rayon::prelude::*;

/// The largest value.
pub const MAX: f64 = binary16::MAX;

/// The blocks of a picture of three values per texel, row by row, and what that changed; nothing from no texels.
pub fn pack<T: Copy + Into<f64>>(width: usize, height: usize, values: &[T]) -> (Vec<u8>, PackReport) {
    let size = [width, height];
    let compress = |texels: &[[f64; 3]]| {
        let block = |i: usize| encode::encode(&blocks::cut(texels, size, i)).to_bytes();
        (0..blocks::count(width, height).unwrap_or(0)).into_par_iter().flat_map_iter(block).collect()
    };
    let transcoded = |bytes: &[u8]| unpack_transcoded(width, height, bytes);
    blocks::pack(size, values, MAX, compress, |bytes| unpack(width, height, bytes), Some(&transcoded))
}

/// The values of a picture's blocks, three per texel, row by row; nothing where blocks are missing.
pub fn unpack(width: usize, height: usize, bytes: &[u8]) -> Vec<f32> {
    blocks::unpack([width, height], bytes, |block| match Block::from_bytes(*block) {
        Some(block) => values(decode::texels(&block)),
        None => [[f32::NAN; 3]; blocks::TEXELS],
    })
}

/// The same after Basis Universal's transcoder has made BC6H of it: what is seen where the machine has no ASTC.
pub fn unpack_transcoded(width: usize, height: usize, bytes: &[u8]) -> Vec<f32> {
    blocks::unpack([width, height], bytes, |block| match Block::from_bytes(*block) {
        Some(Block::Solid(colour)) => values([colour; blocks::TEXELS]),
        Some(Block::Mixed(mixed)) => values(transcoded::texels(&mixed)),
        None => [[f32::NAN; 3]; blocks::TEXELS],
    })
}

fn values(texels: [[u16; 3]; blocks::TEXELS]) -> [[f32; 3]; blocks::TEXELS] {
    texels.map(|texel| texel.map(|half| f16::from_bits(half).to_f32()))
}
