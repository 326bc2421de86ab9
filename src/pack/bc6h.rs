//! BC6H, unsigned: blocks of 4 × 4 texels in 16 bytes, of three half floats each.
//!
//! - **Rounding**: lossy. Intel's encoder chooses each block's end points and partition; what that cost is measured by decoding again with another
//!   author's decoder, and is the report's error. There is no step: what a texel can be depends on its fifteen neighbours.
//! - **Negatives**: stored as 0 and counted.
//! - **Overflow**: values beyond 65504 are stored as that and counted.
//! - **NaN, infinity**: counted; NaN and −∞ are stored as 0, +∞ as 65504.
//! - **Sizes** that are no multiple of 4, as those of small mips: the last row and column are repeated up to whole blocks, and what is read
//!   back is cut to the size.
//!
//! Known imperfection: the encoder picks its instructions at run time, and whether all of them make the same bytes is not known.
//!
//! **Source**: Khronos, *Data Format Specification* 1.4, BPTC compressed texture image formats.

use super::{PackReport, binary16, triple};
use ctt_intel_texture_compressor::{RgbaF16Surface, bc6h as encoder};
use rayon::prelude::*;

/// The largest value.
pub const MAX: f64 = binary16::MAX;
/// Texels along an edge of a block.
pub const BLOCK: usize = 4;
/// Bytes of a block.
pub const BLOCK_BYTES: usize = 16;

/// Blocks of a picture, or nothing where that overflows.
pub fn bytes(width: usize, height: usize) -> Option<usize> {
    width.div_ceil(BLOCK).checked_mul(height.div_ceil(BLOCK))?.checked_mul(BLOCK_BYTES)
}

/// The blocks of a picture of three values per texel, row by row, and what that changed; nothing from no texels.
pub fn pack<T: Copy + Into<f64>>(width: usize, height: usize, values: &[T]) -> (Vec<u8>, PackReport) {
    let mut report = PackReport::default();
    if width * height == 0 || values.len() < 3 * width * height {
        return (vec![], report);
    }
    let given: Vec<[f64; 3]> =
        values.chunks_exact(3).take(width * height).map(|t| [0, 1, 2].map(|c| t[c].into())).collect();
    let fitted: Vec<[f64; 3]> = given.iter().map(|&texel| triple::fit(texel, [MAX; 3], &mut report)).collect();
    let blocks = compress(width, height, &fitted);
    let decoded = unpack(width, height, &blocks);
    let brightest = brightest_of_blocks(width, height, &decoded);
    for (i, ((given, fitted), decoded)) in given.iter().zip(&fitted).zip(decoded.chunks_exact(3)).enumerate() {
        let brightest = brightest[block_of(width, i)];
        for c in 0..3 {
            // What was clamped is counted instead.
            if given[c] == fitted[c] {
                let off = (f64::from(decoded[c]) - given[c]).abs();
                report.max_abs_error = report.max_abs_error.max(off);
                if off > 0.0 {
                    report.max_block_error = report.max_block_error.max(off / brightest);
                }
            }
        }
    }
    (blocks, report)
}

/// The block of a texel.
pub fn block_of(width: usize, texel: usize) -> usize {
    texel / width / BLOCK * width.div_ceil(BLOCK) + texel % width / BLOCK
}

/// The largest value that each block of a picture holds, from what was read of it.
pub fn brightest_of_blocks(width: usize, height: usize, values: &[f32]) -> Vec<f64> {
    let mut brightest = vec![0.0_f64; width.div_ceil(BLOCK) * height.div_ceil(BLOCK)];
    for (i, texel) in values.chunks_exact(3).enumerate() {
        let block = &mut brightest[block_of(width, i)];
        *block = texel.iter().fold(*block, |most, &v| most.max(v.into()));
    }
    brightest
}

fn compress(width: usize, height: usize, texels: &[[f64; 3]]) -> Vec<u8> {
    let padded = width.next_multiple_of(BLOCK);
    let row_of_blocks = |row: usize| -> Vec<u8> {
        let mut halves = Vec::with_capacity(padded * BLOCK * 4);
        for y in row * BLOCK..(row + 1) * BLOCK {
            for x in 0..padded {
                let [r, g, b] = texels[y.min(height - 1) * width + x.min(width - 1)];
                halves.extend([r, g, b, 1.0]);
            }
        }
        let (halves, _) = binary16::pack(&halves);
        let surface = RgbaF16Surface::new(&halves, padded as u32, BLOCK as u32, 8 * padded as u32);
        encoder::compress_blocks(&encoder::slow_settings(), &surface)
    };
    (0..height.div_ceil(BLOCK)).into_par_iter().flat_map_iter(row_of_blocks).collect()
}

/// The values of a picture's blocks, three per texel, row by row; nothing where blocks are missing.
pub fn unpack(width: usize, height: usize, blocks: &[u8]) -> Vec<f32> {
    if bytes(width, height).is_none_or(|wanted| blocks.len() < wanted) {
        return vec![];
    }
    let mut values = vec![0.0; 3 * width * height];
    for (i, block) in blocks.chunks_exact(BLOCK_BYTES).take(width.div_ceil(BLOCK) * height.div_ceil(BLOCK)).enumerate()
    {
        let (left, top) = (i % width.div_ceil(BLOCK) * BLOCK, i / width.div_ceil(BLOCK) * BLOCK);
        let mut halves = [0_u16; 3 * BLOCK * BLOCK];
        bcdec_rs::bc6h_half(block, &mut halves, 3 * BLOCK, false);
        for (texel, rgb) in halves.chunks_exact(3).enumerate() {
            let (x, y) = (left + texel % BLOCK, top + texel / BLOCK);
            if x < width && y < height {
                for (c, &half) in rgb.iter().enumerate() {
                    values[3 * (y * width + x) + c] = half::f16::from_bits(half).to_f32();
                }
            }
        }
    }
    values
}
