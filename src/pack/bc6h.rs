//! BC6H, unsigned: blocks of 4 × 4 texels in 16 bytes, of three half floats each.
//!
//! - **Rounding**: lossy. Intel's encoder chooses each block's end points and partition; what that cost is measured by decoding again with another
//!   author's decoder, and is the report's error. There is no step: what a texel can be depends on its fifteen neighbours.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond 65504 are stored as that and counted.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as 65504.
//! - **Sizes** that are no multiple of 4: see [`blocks`].
//!
//! Known imperfection: the encoder picks its instructions at run time, and whether all of them make the same bytes is not known.
//!
//! **Source**: Khronos, *Data Format Specification* 1.4, BPTC compressed texture image formats.

use super::blocks::{self, SIDE, TEXELS};
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
        encoder::compress_blocks(&encoder::slow_settings(), &surface)
    };
    (0..height.div_ceil(SIDE)).into_par_iter().flat_map_iter(row_of_blocks).collect()
}

/// The values of a picture's blocks, three per texel, row by row; nothing where blocks are missing.
pub fn unpack(width: usize, height: usize, blocks: &[u8]) -> Vec<f32> {
    blocks::unpack([width, height], blocks, |block| {
        let mut halves = [0_u16; 3 * TEXELS];
        bcdec_rs::bc6h_half(block, &mut halves, 3 * SIDE, false);
        std::array::from_fn(|i| [0, 1, 2].map(|c| half::f16::from_bits(halves[3 * i + c]).to_f32()))
    })
}
