//! What packings in blocks of 4 × 4 texels have in common: three values a texel, sixteen bytes a block.
//!
//! Sizes that are no multiple of 4, as those of small mips: the last row and column are repeated up to whole blocks, and what is read back is
//! cut to the size.

use super::{PackReport, triple};

/// Texels along an edge of a block.
pub const SIDE: usize = 4;
/// Texels of a block.
pub const TEXELS: usize = SIDE * SIDE;
/// Bytes of a block.
pub const BYTES: usize = 16;

/// How many blocks a picture has.
pub fn count(width: usize, height: usize) -> Option<usize> {
    width.div_ceil(SIDE).checked_mul(height.div_ceil(SIDE))
}

/// The block of a texel.
pub fn block_of(width: usize, texel: usize) -> usize {
    texel / width / SIDE * width.div_ceil(SIDE) + texel % width / SIDE
}

/// The largest value that each block of a picture holds, from what was read of it.
pub fn brightest(width: usize, height: usize, values: &[f32]) -> Vec<f64> {
    let mut brightest = vec![0.0_f64; width.div_ceil(SIDE) * height.div_ceil(SIDE)];
    for (i, texel) in values.chunks_exact(3).enumerate() {
        let block = &mut brightest[block_of(width, i)];
        *block = texel.iter().fold(*block, |most, &v| most.max(v.into()));
    }
    brightest
}

/// What gives the values that a picture's blocks hold.
type Unpack<'a> = &'a dyn Fn(&[u8]) -> Vec<f32>;

/// The blocks of a picture of three values per texel, row by row, and what that changed; nothing from no texels.
///
/// Values are brought into 0..=`largest` first and counted; `compress` makes the blocks of a picture's texels, `unpack` its values again, and
/// `transcoded` those of what others make of the blocks, where they do.
pub(super) fn pack<T: Copy + Into<f64>>(
    [width, height]: [usize; 2],
    values: &[T],
    largest: f64,
    compress: impl Fn(&[[f64; 3]]) -> Vec<u8>,
    unpack: impl Fn(&[u8]) -> Vec<f32>,
    transcoded: Option<Unpack>,
) -> (Vec<u8>, PackReport) {
    let mut report = PackReport::default();
    if width * height == 0 || values.len() < 3 * width * height {
        return (vec![], report);
    }
    let given: Vec<[f64; 3]> =
        values.chunks_exact(3).take(width * height).map(|t| [0, 1, 2].map(|c| t[c].into())).collect();
    let fitted: Vec<[f64; 3]> = given.iter().map(|&texel| triple::fit(texel, [largest; 3], &mut report)).collect();
    let blocks = compress(&fitted);
    let errors = |decoded: &[f32]| errors([width, height], &given, &fitted, decoded);
    (report.max_abs_error, report.max_block_error) = errors(&unpack(&blocks));
    if let Some(unpack) = transcoded {
        (_, report.max_transcoded_error) = errors(&unpack(&blocks));
    }
    (blocks, report)
}

/// The largest error of decoded texels, and the largest in parts of the brightest value of its block or of the value itself, whichever is larger:
/// that is 1 at most, for neither is below zero.
fn errors([width, height]: [usize; 2], given: &[[f64; 3]], fitted: &[[f64; 3]], decoded: &[f32]) -> (f64, f64) {
    let brightest = brightest(width, height, decoded);
    let (mut most, mut most_in_block) = (0.0_f64, 0.0_f64);
    for (i, ((given, fitted), decoded)) in given.iter().zip(fitted).zip(decoded.chunks_exact(3)).enumerate() {
        let brightest = brightest[block_of(width, i)];
        for c in 0..3 {
            // What was clamped is counted instead, and of a block there is left what it may be off by from the largest or from 0.
            let off = (f64::from(decoded[c]) - fitted[c]).abs();
            if given[c] == fitted[c] {
                most = most.max(off);
            }
            if off > 0.0 {
                most_in_block = most_in_block.max(off / brightest.max(fitted[c]));
            }
        }
    }
    (most, most_in_block)
}

/// The texels of a block, of a picture of that size.
pub(super) fn cut(texels: &[[f64; 3]], [width, height]: [usize; 2], block: usize) -> [[f64; 3]; TEXELS] {
    let [left, top] = corner(width, block);
    std::array::from_fn(|i| {
        let (x, y) = ((left + i % SIDE).min(width - 1), (top + i / SIDE).min(height - 1));
        texels[y * width + x]
    })
}

/// The values of a picture's blocks, three per texel, row by row, as `decode` reads a block; nothing where blocks are missing.
pub(super) fn unpack(
    [width, height]: [usize; 2],
    blocks: &[u8],
    decode: impl Fn(&[u8; BYTES]) -> [[f32; 3]; TEXELS],
) -> Vec<f32> {
    let (blocks, _) = blocks.as_chunks::<BYTES>();
    let Some(blocks) = count(width, height).and_then(|n| blocks.get(..n)) else { return vec![] };
    let mut values = vec![0.0; 3 * width * height];
    for (block, bytes) in blocks.iter().enumerate() {
        let [left, top] = corner(width, block);
        for (i, texel) in decode(bytes).iter().enumerate() {
            let (x, y) = (left + i % SIDE, top + i / SIDE);
            if x < width && y < height {
                let at = 3 * (y * width + x);
                values[at..at + 3].copy_from_slice(texel);
            }
        }
    }
    values
}

/// Where a block begins.
fn corner(width: usize, block: usize) -> [usize; 2] {
    let per_row = width.div_ceil(SIDE);
    [block % per_row * SIDE, block / per_row * SIDE]
}
