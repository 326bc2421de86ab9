//! A block of UASTC HDR 4x4: which blocks of ASTC those are, and where everything lies in the sixteen bytes.
//!
//! **Source**: Khronos, *Data Format Specification* 1.4, ASTC: block mode, partition patterns, colour end points, void extent; which modes and
//! patterns the subset has: Basis Universal's transcoder (`astc_hdr_transcode_to_bc6h` in `basisu_transcoder.cpp`), which refuses all others.

use super::endpoints::{Kind, LARGEST, MOST_BYTES};
use super::integers::Levels;
pub(super) use crate::pack::blocks::TEXELS;
use std::sync::LazyLock;

/// One way in which a block can hold texels of more than one colour.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Mode {
    pub(super) kind: Kind,
    /// 1, or 2: then a pattern says which texel belongs to which.
    pub(super) subsets: usize,
    pub(super) weights: Levels,
    /// Of each byte of the end points.
    pub(super) endpoints: Levels,
}

const fn mode(kind: Kind, subsets: usize, weights: usize, endpoints: usize) -> Mode {
    Mode { kind, subsets, weights: Levels::of(weights), endpoints: Levels::of(endpoints) }
}

/// All modes but that of a single colour.
pub(super) static MODES: [Mode; 23] = {
    use Kind::{Direct, Scaled};
    [
        mode(Direct, 1, 16, 192),
        mode(Direct, 1, 12, 256),
        mode(Direct, 1, 10, 256),
        mode(Direct, 1, 8, 256),
        mode(Direct, 1, 6, 256),
        mode(Direct, 1, 5, 256),
        mode(Direct, 1, 4, 256),
        mode(Direct, 1, 3, 256),
        mode(Scaled, 1, 16, 256),
        mode(Scaled, 1, 12, 256),
        mode(Scaled, 1, 10, 256),
        mode(Scaled, 1, 8, 256),
        mode(Scaled, 1, 6, 256),
        mode(Scaled, 1, 5, 256),
        mode(Scaled, 1, 4, 256),
        mode(Scaled, 1, 3, 256),
        mode(Direct, 2, 4, 40),
        mode(Direct, 2, 3, 64),
        mode(Scaled, 2, 8, 80),
        mode(Scaled, 2, 6, 128),
        mode(Scaled, 2, 5, 192),
        mode(Scaled, 2, 4, 256),
        mode(Scaled, 2, 3, 256),
    ]
};

impl Mode {
    /// Bytes of all end points.
    pub(super) fn endpoint_bytes(&self) -> usize {
        self.subsets * self.kind.bytes()
    }
}

/// The seeds of those patterns of two subsets that BC6H has too, and where BC6H has them.
pub(super) const PATTERNS: [(u128, usize); 27] = [
    (28, 0),
    (20, 1),
    (16, 2),
    (29, 3),
    (91, 4),
    (9, 5),
    (107, 6),
    (72, 7),
    (149, 8),
    (204, 9),
    (50, 10),
    (114, 11),
    (496, 12),
    (17, 13),
    (78, 14),
    (39, 15),
    (252, 17),
    (828, 18),
    (43, 19),
    (156, 20),
    (116, 21),
    (210, 22),
    (476, 23),
    (273, 24),
    (684, 25),
    (359, 26),
    (246, 29),
];

/// For each pattern, the texels of the second subset: a bit each, the lowest for the first texel.
pub(super) static SECOND: LazyLock<[u16; PATTERNS.len()]> = LazyLock::new(|| {
    PATTERNS.map(|(seed, _)| (0..TEXELS).fold(0, |mask, texel| mask | (subset(seed as u32, texel) as u16) << texel))
});

/// Which of two subsets a texel of a small block belongs to.
fn subset(seed: u32, texel: usize) -> usize {
    // Blocks of fewer than 31 texels are looked up as if they were twice as large.
    let (x, y) = (2 * (texel % 4) as u32, 2 * (texel / 4) as u32);
    let random = scrambled(seed + 1024);
    let nibble = |at: u32| {
        let n = random >> at & 15;
        n * n
    };
    let (first, second) =
        if seed & 1 == 1 { (if seed & 2 == 2 { 4 } else { 5 }, 5) } else { (5, if seed & 2 == 2 { 4 } else { 5 }) };
    let a = (nibble(0) >> first) * x + (nibble(4) >> second) * y + (random >> 14);
    let b = (nibble(8) >> first) * x + (nibble(12) >> second) * y + (random >> 10);
    usize::from(a & 63 < b & 63)
}

/// The specification's hash of 32 bits.
fn scrambled(mut p: u32) -> u32 {
    p ^= p >> 15;
    p = p.wrapping_sub(p << 17);
    p = p.wrapping_add(p << 7);
    p = p.wrapping_add(p << 4);
    p ^= p >> 5;
    p = p.wrapping_add(p << 16);
    p ^= p >> 7;
    p ^= p >> 3;
    p ^= p << 6;
    p ^ p >> 17
}

/// What a block says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Block {
    /// One colour, of half floats.
    Solid([u16; 3]),
    /// Texels between the end points of their subset.
    Mixed(Mixed),
}

/// What a block of more than one colour says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mixed {
    pub(super) mode: &'static Mode,
    /// Of two subsets, which of [`PATTERNS`].
    pub(super) pattern: usize,
    /// The codes of the end points, subset after subset.
    pub(super) endpoints: [u8; 2 * MOST_BYTES],
    /// The codes of the weights.
    pub(super) weights: [u8; TEXELS],
}

/// A void extent without an extent, of half floats: what the low eight bytes are.
const SOLID: u128 = 0xffff_ffff_ffff_fffc;
const ALPHA_ONE: u128 = 0x3c00;
/// The levels of weights, and the bits of the block mode that say so in a grid of 4 × 4.
const GRIDS: [(Levels, u128); 8] = [
    (Levels::of(3), grid(3, false)),
    (Levels::of(4), grid(4, false)),
    (Levels::of(5), grid(5, false)),
    (Levels::of(6), grid(6, false)),
    (Levels::of(8), grid(7, false)),
    (Levels::of(10), grid(2, true)),
    (Levels::of(12), grid(3, true)),
    (Levels::of(16), grid(4, true)),
];

/// The block mode of a grid of 4 × 4: its range has three bits, in places 4, 0 and 1, and a fourth in 9.
const fn grid(range: u128, precise: bool) -> u128 {
    (2 << 5) | (range & 1) << 4 | range >> 1 | (precise as u128) << 9
}

impl Block {
    pub(super) fn to_bytes(self) -> [u8; 16] {
        let bits = match self {
            Self::Solid([r, g, b]) => {
                SOLID | u128::from(r) << 64 | u128::from(g) << 80 | u128::from(b) << 96 | ALPHA_ONE << 112
            }
            Self::Mixed(mixed) => mixed.to_bits(),
        };
        bits.to_le_bytes()
    }

    /// The block that the bytes hold; nothing if that is outside the subset.
    pub(super) fn from_bytes(bytes: [u8; 16]) -> Option<Self> {
        let bits = u128::from_le_bytes(bytes);
        if bits & u128::from(u64::MAX) == SOLID {
            let channels = [64, 80, 96, 112].map(|at| (bits >> at) as u16);
            // Neither infinite, nor NaN, nor below zero.
            let fits = channels.iter().all(|&half| half < 0x7c00);
            return fits.then_some(Self::Solid([channels[0], channels[1], channels[2]]));
        }
        let (weight_levels, _) = *GRIDS.iter().find(|(_, mode)| *mode == bits & 0x7ff)?;
        let subsets = (bits >> 11 & 3) as usize + 1;
        let (number, start) = match subsets {
            1 => (bits >> 13 & 15, 17),
            2 if bits >> 23 & 3 == 0 => (bits >> 25 & 15, 29),
            _ => return None,
        };
        let mode = MODES.iter().find(|mode| {
            mode.subsets == subsets && mode.kind.number() as u128 == number && mode.weights == weight_levels
        })?;
        let pattern = match subsets {
            1 => 0,
            _ => PATTERNS.iter().position(|&(seed, _)| seed == bits >> 13 & 0x3ff)?,
        };
        let mut mixed = Mixed { mode, pattern, endpoints: [0; 2 * MOST_BYTES], weights: [0; TEXELS] };
        mode.endpoints.read(bits >> start, &mut mixed.endpoints[..mode.endpoint_bytes()]);
        mode.weights.read(bits.reverse_bits(), &mut mixed.weights);
        let finite = |subset| mixed.ends(subset).as_flattened().iter().all(|&v| v <= LARGEST);
        (0..subsets).all(finite).then_some(Self::Mixed(mixed))
    }
}

impl Mixed {
    fn to_bits(self) -> u128 {
        let Mode { kind, subsets, weights, endpoints } = self.mode;
        let grid = GRIDS.iter().find(|(levels, _)| levels == weights).map_or(0, |(_, mode)| *mode);
        let number = kind.number() as u128;
        let (head, start) = match subsets {
            1 => (number << 13, 17),
            _ => (1 << 11 | PATTERNS[self.pattern].0 << 13 | number << 25, 29),
        };
        let endpoints = endpoints.write(&self.endpoints[..self.mode.endpoint_bytes()]);
        grid | head | endpoints << start | weights.write(&self.weights).reverse_bits()
    }

    /// The end points of a subset.
    pub(super) fn ends(&self, subset: usize) -> [[i32; 3]; 2] {
        let n = self.mode.kind.bytes();
        let mut bytes = [0; MOST_BYTES];
        for (byte, &code) in bytes.iter_mut().zip(&self.endpoints[subset * n..(subset + 1) * n]) {
            *byte = self.mode.endpoints.endpoint(code);
        }
        self.mode.kind.decode(&bytes)
    }

    /// The subset of a texel.
    pub(super) fn subset(&self, texel: usize) -> usize {
        if self.mode.subsets == 1 { 0 } else { usize::from(SECOND[self.pattern] >> texel & 1) }
    }
}
