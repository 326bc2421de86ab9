//! What becomes of a block where the machine has no ASTC: Basis Universal's transcoder makes BC6H of it, by a rule without any choice.
//!
//! Its end points have 16 bits where the block has little contrast, and 12, 11, 10 and down to 6 where it has more; its weights are those that are
//! nearest. So two blocks that are as good in ASTC may differ there.
//!
//! **Source**: Basis Universal, `basisu_transcoder.cpp`, `bc6h_enc_block_1subset_4bit_weights` and its neighbours, for the rule; Khronos, *Data
//! Format Specification* 1.4, BPTC compressed texture image formats, for what the result stands for.

use super::decode::half;
use super::layout::{MODES, Mixed, PATTERNS, TEXELS};
use crate::pack::bc6h::{self, between, stretched};
use std::sync::LazyLock;

/// Weights of four bits and of three.
const FINE: [i32; 16] = bc6h::WEIGHTS;
const COARSE: [i32; 8] = [0, 9, 18, 27, 37, 46, 55, 64];

/// Bits of the first end point, and of the difference of each other one in red, green and blue: in the order in which they are tried.
/// With weights of four bits…
const FINE_MODES: [(u32, [u32; 3]); 3] = [(16, [4, 4, 4]), (12, [8, 8, 8]), (11, [9, 9, 9])];
/// …and of three.
const COARSE_MODES: [(u32, [u32; 3]); 9] = [
    (11, [5, 4, 4]),
    (11, [4, 5, 4]),
    (11, [4, 4, 5]),
    (10, [5, 5, 5]),
    (9, [5, 5, 5]),
    (8, [6, 5, 5]),
    (8, [5, 6, 5]),
    (8, [5, 5, 6]),
    (7, [6, 6, 6]),
];

/// The texels of the BC6H block, as half floats.
pub(super) fn texels(mixed: &Mixed) -> [[u16; 3]; TEXELS] {
    let levels = mixed.mode.weights;
    let coarse = mixed.mode.subsets == 2 || levels.count() == 8;
    let table = &WEIGHTS[levels.count()][usize::from(coarse)];
    let weights = mixed.weights.map(|code| table[usize::from(code)]);
    let ends: [[[u32; 3]; 2]; 2] =
        [0, mixed.mode.subsets - 1].map(|subset| mixed.ends(subset).map(|end| end.map(|v| u32::from(half(v << 4)))));
    let (modes, last): (&[_], u32) = if coarse { (&COARSE_MODES, 6) } else { (&FINE_MODES, 10) };
    let order = first_end_points(mixed, &weights);
    let fits = |&(bits, differences): &(u32, [u32; 3])| {
        (0..3).all(|c| {
            let [first, others @ ..] = order.map(|(subset, end)| quantised(ends[subset][end][c], bits) as i32);
            let room = 1 << (differences[c] - 1);
            others.iter().all(|other| (-room..room).contains(&(other - first)))
        })
    };
    let bits = modes.iter().find(|mode| fits(mode)).map_or(last, |mode| mode.0);
    let ends = ends.map(|subset| subset.map(|end| end.map(|v| stretched(quantised(v, bits), bits))));
    std::array::from_fn(|texel| {
        let [low, high] = ends[mixed.subset(texel)];
        [0, 1, 2].map(|c| between(low[c], high[c], weights[texel]))
    })
}

/// The weights of BC6H that stand for the codes of so many levels, fine and coarse.
static WEIGHTS: LazyLock<[[[i32; 16]; 2]; 17]> = LazyLock::new(|| {
    let mut all = [[[0; 16]; 2]; 17];
    for levels in MODES.iter().map(|mode| mode.weights) {
        for (coarse, table) in all[levels.count()].iter_mut().enumerate() {
            for (code, weight) in table.iter_mut().enumerate().take(levels.count()) {
                *weight = nearest(levels.weight(code as u8).into(), levels.count(), coarse == 1);
            }
        }
    }
    all
});

/// The weight of BC6H that stands for one of ASTC.
fn nearest(weight: i32, levels: usize, coarse: bool) -> i32 {
    let all: &[i32] = if coarse { &COARSE } else { &FINE };
    // Of two that are as near, the one nearer to an end; of the middle, the upper one, but for five levels of four bits.
    let key = |of: &i32| {
        let middle = weight == 32 && (levels == 5 && !coarse) == (*of > 32);
        ((of - weight).abs(), if weight == 32 { i32::from(middle) } else { 32 - (of - 32).abs() })
    };
    all.iter().copied().min_by_key(key).unwrap_or(weight)
}

/// Subset and end of each end point, in BC6H's order: the first texel's subset is the first, and the ends are so that one texel of each
/// subset has a weight below the middle.
fn first_end_points(mixed: &Mixed, weights: &[i32; TEXELS]) -> [(usize, usize); 4] {
    let flipped = |texel: usize| usize::from(weights[texel] > 32);
    let first = mixed.subset(0);
    let (second, anchor) = match mixed.mode.subsets {
        1 => (0, TEXELS - 1),
        _ => (1 - first, ANCHORS[PATTERNS[mixed.pattern].1]),
    };
    let [f, s] = [flipped(0), flipped(anchor)];
    [(first, f), (first, 1 - f), (second, s), (second, 1 - s)]
}

/// Of each of BC6H's patterns, the texel of the second subset whose weight is below the middle.
const ANCHORS: [usize; 32] = [
    15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, //
    15, 2, 8, 2, 2, 8, 8, 15, 2, 8, 2, 2, 8, 8, 2, 2,
];

/// The bits of a half, stretched to 16 bits of which the highest are kept.
fn quantised(half: u32, bits: u32) -> u32 {
    (half * 64 + 30) / (31 << (16 - bits))
}
