//! BC6H, unsigned: blocks of 4 × 4 texels in 16 bytes, of three half floats each.
//!
//! - **Rounding**: lossy. Intel's encoder chooses each block's end points and partition; what that cost is measured by decoding again with another
//!   author's decoder, and is the report's error. There is no step: what a texel can be depends on its fifteen neighbours. Where that encoder loses
//!   a light (see `LOST`), the block is a line of colours between two of its texels.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond 65504 are stored as that and counted.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as 65504.
//! - **Sizes** that are no multiple of 4: see [`blocks`].
//!
//! Known imperfection: the encoder picks its instructions at run time, and whether all of them make the same bytes is not known.
//!
//! **Source**: Khronos, *Data Format Specification* 1.4, BPTC compressed texture image formats.

use super::blocks::{self, BYTES, SIDE, TEXELS};
use super::{PackReport, binary16};
use ctt_intel_texture_compressor::{RgbaF16Surface, bc6h as encoder};
use rayon::prelude::*;

/// The largest value.
pub const MAX: f64 = binary16::MAX;

/// The blocks of a picture of three values per texel, row by row, and what that changed; nothing from no texels.
pub fn pack<T: Copy + Into<f64>>(width: usize, height: usize, values: &[T]) -> (Vec<u8>, PackReport) {
    let size = [width, height];
    blocks::pack(size, values, MAX, |texels| compress(size, texels), |bytes| unpack(width, height, bytes), None)
}

fn compress([width, height]: [usize; 2], texels: &[[f64; 3]]) -> Vec<u8> {
    let padded = width.next_multiple_of(SIDE);
    let row_of_blocks = |row: usize| -> Vec<u8> {
        let mut halves = Vec::with_capacity(padded * SIDE * 4);
        for y in row * SIDE..(row + 1) * SIDE {
            for x in 0..padded {
                let [r, g, b] = texels[y.min(height - 1) * width + x.min(width - 1)];
                halves.extend([r, g, b, 1.0]);
            }
        }
        let (halves, _) = binary16::pack(&halves);
        let surface = RgbaF16Surface::new(&halves, padded as u32, SIDE as u32, 8 * padded as u32);
        let mut bytes = encoder::compress_blocks(&encoder::slow_settings(), &surface);
        let first = row * padded / SIDE;
        for (i, block) in bytes.as_chunks_mut::<BYTES>().0.iter_mut().enumerate() {
            let texels = blocks::cut(texels, [width, height], first + i);
            let halves = texels.map(|texel| texel.map(|value| half::f16::from_f64(value).to_bits()));
            if off(&decode(block), &halves).into_iter().any(|off| off > LOST) {
                *block = line(&halves);
            }
        }
        bytes
    };
    (0..height.div_ceil(SIDE)).into_par_iter().flat_map_iter(row_of_blocks).collect()
}

/// The square of what a texel is off by, in codes of halves, that no choice of Intel's encoder leaves but by mistake: sixteen powers of two. It
/// counts squares in 32 bits; of a light of thousands beside black they overflow where a way to store the block leaves the light out, which
/// is then the best of all.
const LOST: i64 = 1 << 28;

/// The square of what each texel is off by, in codes of halves.
fn off(texels: &[[u16; 3]; TEXELS], wanted: &[[u16; 3]; TEXELS]) -> [i64; TEXELS] {
    let square = |a: u16, b: u16| (i64::from(a) - i64::from(b)).pow(2);
    std::array::from_fn(|i| (0..3).map(|c| square(texels[i][c], wanted[i][c])).sum())
}

/// Weights of one subset, of the second end in 64ths.
pub(super) const WEIGHTS: [i32; 16] = [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64];

/// The bits of an end point of the mode of [`line`], and the first five bits of its blocks.
const END_BITS: usize = 10;
const LINE_MODE: u128 = 0b00011;

/// The block whose texels are the nearest on a line between two of them, of the line that leaves least: the mode of one subset whose ends have ten
/// bits, whatever lies between them.
fn line(texels: &[[u16; 3]; TEXELS]) -> [u8; BYTES] {
    let coded = |half: u16| (u128::from(half) / 31).min((1 << END_BITS) - 1);
    let colours = |ends: [usize; 2]| {
        let [first, second] = ends.map(|end| texels[end].map(|half| stretched(coded(half) as u32, END_BITS as u32)));
        WEIGHTS.map(|weight| [0, 1, 2].map(|c| between(first[c], second[c], weight)))
    };
    let nearest = |colours: &[[u16; 3]; TEXELS]| {
        texels.map(|texel| {
            let all = off(colours, &[texel; TEXELS]);
            (0..TEXELS).map(|code| (all[code], code)).min().unwrap_or_default()
        })
    };
    let left = |ends: [usize; 2]| nearest(&colours(ends)).iter().map(|(off, _)| off).sum::<i64>();
    let pairs = (0..TEXELS).flat_map(|second| (0..second).map(move |first| [first, second]));
    let [mut first, mut second] = pairs.min_by_key(|&ends| left(ends)).unwrap_or_default();
    // The highest bit of the first texel's code is not stored: it is 0.
    if nearest(&colours([first, second]))[0].1 >= TEXELS / 2 {
        (first, second) = (second, first);
    }
    let (mut bits, mut at) = (0, 0);
    let mut put = |value: u128, n: usize| (bits, at) = (bits | value << at, at + n);
    put(LINE_MODE, 5);
    [first, second].iter().flat_map(|&end| texels[end]).for_each(|half| put(coded(half), END_BITS));
    for (i, (_, code)) in nearest(&colours([first, second])).into_iter().enumerate() {
        put(code as u128, if i == 0 { 3 } else { 4 });
    }
    bits.to_le_bytes()
}

/// An end point of so many bits as it is interpolated, in 64 parts of 31 of a half's code.
pub(super) fn stretched(value: u32, bits: u32) -> i32 {
    (if bits >= 15 || value == 0 {
        value
    } else if value == (1 << bits) - 1 {
        0xffff
    } else {
        ((value << 16) + 0x8000) >> bits
    }) as i32
}

/// The half between two ends.
pub(super) fn between(first: i32, second: i32, weight: i32) -> u16 {
    let stretched = ((64 - weight) * first + weight * second + 32) >> 6;
    ((stretched * 31) >> 6) as u16
}

/// A block's texels, as halves.
fn decode(block: &[u8; BYTES]) -> [[u16; 3]; TEXELS] {
    let mut halves = [0_u16; 3 * TEXELS];
    bcdec_rs::bc6h_half(block, &mut halves, 3 * SIDE, false);
    std::array::from_fn(|i| [0, 1, 2].map(|c| halves[3 * i + c]))
}

/// The values of a picture's blocks, three per texel, row by row; nothing where blocks are missing.
pub fn unpack(width: usize, height: usize, blocks: &[u8]) -> Vec<f32> {
    let value = |half| half::f16::from_bits(half).to_f32();
    blocks::unpack([width, height], blocks, |block| decode(block).map(|texel| texel.map(value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_beside_black_is_not_lost() {
        for dark in [0.0, 1e-6, 1e-4, 1e-3, 0.1] {
            for light in [1.0, 1e3, 5e3, 2e4, 6e4] {
                for at in [0, 5, 15] {
                    let values: Vec<f64> = (0..TEXELS).flat_map(|i| [if i == at { light } else { dark }; 3]).collect();
                    let (_, report) = pack(4, 4, &values);
                    assert!(report.max_block_error < 0.03, "{light} at {at} in {dark}: {report:?}");
                }
            }
        }
    }

    /// Every texel is on the line, as far as ends of ten bits say it, wherever the ends are.
    #[test]
    fn a_line_holds_its_texels_within_half_a_step() {
        let one_of_ten_bits = 32;
        for [low, high] in [[0, 31743], [31743, 0], [20000, 20001], [100, 100], [12000, 25000]] {
            let texels: [[u16; 3]; TEXELS] = std::array::from_fn(|i| {
                let weight = WEIGHTS[(7 * i + 3) % TEXELS];
                [(low * (64 - weight) + high * weight) / 64, low, high].map(|half| half as u16)
            });
            for (i, (texel, wanted)) in decode(&line(&texels)).into_iter().zip(texels).enumerate() {
                let off = [0, 1, 2].map(|c| texel[c].abs_diff(wanted[c]));
                assert!(off[0] <= one_of_ten_bits, "{low} to {high}, texel {i}: {texel:?}, wanted {wanted:?}");
            }
        }
    }
}
