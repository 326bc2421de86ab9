//! The search for a block: a few modes and patterns are fitted, the best judged in both formats that a machine may see, and one polished.
//!
//! What is made small is the sum of squares of the differences of logarithms: 2048 to the doubling, so that an error is one of
//! proportion, in light as in shadow.

use super::super::binary16;
use super::decode::logarithm;
use super::endpoints::{Kind, MOST_BYTES};
use super::fit::{Colour, Fit, Subset, Texel, off_line};
use super::layout::{Block, MODES, Mixed, PATTERNS, SECOND, TEXELS};
use super::transcoded;
use half::f16;
use std::sync::LazyLock;

/// Levels of the weights that are tried for a single subset. With 12 and fewer the end points are as precise as they can be; 8 are kept as
/// they are in BC6H; others have nothing of their own.
const SINGLE_LEVELS: [usize; 3] = [16, 12, 8];
/// What a block of one subset is off by where two subsets gain nothing: 24 of the 2048 that are a doubling, root mean square, which is 0.8 %. Measured
/// on four panoramas: no level's error changed in its third digit, and a quarter of the time was saved.
const GOOD: f32 = (3 * TEXELS) as f32 * 24.0 * 24.0;
/// Patterns of two subsets that are tried with each kind of end points. Four instead of two bring 1 % in ASTC and in BC6H, for twice the time.
const BEST_PATTERNS: usize = 2;
/// A subset that is so many times as far off as the best block so far is no longer looked at.
const HOPELESS: f32 = 1.3;
/// Blocks that are judged in BC6H as well, which takes less time than a fit.
const JUDGED: usize = 8;
/// How often all codes of end points are tried one lower and one higher.
const POLISHES: usize = 3;

/// A block, and the sum of squares of what it is off by.
type Found = (Mixed, f32);

/// The block nearest to sixteen colours of values from 0 to 65504.
pub(super) fn encode(colours: &[[f64; 3]; TEXELS]) -> Block {
    let halves = colours.map(|colour| colour.map(|value| binary16::nearest(value).to_bits()));
    if halves.iter().all(|texel| texel == &halves[0]) {
        return Block::Solid(halves[0]);
    }
    let texels: [Texel; TEXELS] = std::array::from_fn(|i| (i, colours[i].map(|value| logarithm(value) as f32)));
    let mut found: Vec<Found> = vec![];
    for (i, mode) in MODES.iter().enumerate().filter(|(_, mode)| mode.subsets == 1) {
        if SINGLE_LEVELS.contains(&mode.weights.count()) {
            found.extend(fitted(i, 0, &texels, f32::INFINITY));
        }
    }
    let kinds = if least(&found) < GOOD { &[][..] } else { &Kind::ALL };
    for &kind in kinds {
        for pattern in patterns(&texels, kind, least(&found)) {
            for (i, _) in MODES.iter().enumerate().filter(|(_, mode)| mode.subsets == 2 && mode.kind == kind) {
                let hopeless = HOPELESS * least(&found);
                found.extend(fitted(i, pattern, &texels, hopeless));
            }
        }
    }
    let by_error = |a: &Found, b: &Found| a.1.total_cmp(&b.1);
    found.sort_by(by_error);
    found.truncate(JUDGED);
    for (mixed, error) in &mut found {
        *error += transcoding_error(mixed, &texels);
    }
    let best = found.into_iter().min_by(by_error);
    // (There always is one: plain end points hold any two colours.)
    best.map_or(Block::Solid(halves[0]), |found| Block::Mixed(polished(found, &texels)))
}

fn least(found: &[Found]) -> f32 {
    found.iter().map(|found| found.1).fold(f32::INFINITY, f32::min)
}

/// The patterns whose two lines come closest, if they come closer than what is known already.
fn patterns(texels: &[Texel; TEXELS], kind: Kind, known: f32) -> impl Iterator<Item = usize> {
    let mut all: Vec<(f32, usize)> = (0..PATTERNS.len())
        .map(|pattern| {
            let line = |subset: u16| {
                let own = texels.iter().filter(move |(i, _)| SECOND[pattern] >> i & 1 == subset);
                off_line(own.map(|(_, colour)| *colour), kind)
            };
            (line(0) + line(1), pattern)
        })
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().take(BEST_PATTERNS).filter(move |(off, _)| *off < known).map(|(_, pattern)| pattern)
}

/// A block of that mode and pattern; nothing where it is off by `hopeless` and more.
fn fitted(mode: usize, pattern: usize, texels: &[Texel; TEXELS], hopeless: f32) -> Option<Found> {
    let mut mixed = Mixed { mode: &MODES[mode], pattern, endpoints: [0; 2 * MOST_BYTES], weights: [0; TEXELS] };
    let mut error = 0.0;
    for s in 0..MODES[mode].subsets {
        let own = of_subset(&mixed, s, texels);
        let fit = Subset::new(&own, mode).fit()?;
        put(&mut mixed, s, &own, &fit);
        error += fit.error;
        if error >= hopeless {
            return None;
        }
    }
    Some((mixed, error))
}

/// The texels of a subset.
fn of_subset(mixed: &Mixed, s: usize, texels: &[Texel; TEXELS]) -> Vec<Texel> {
    texels.iter().filter(|(i, _)| mixed.subset(*i) == s).copied().collect()
}

fn put(mixed: &mut Mixed, s: usize, texels: &[Texel], fit: &Fit) {
    let n = mixed.mode.kind.bytes();
    mixed.endpoints[s * n..(s + 1) * n].copy_from_slice(&fit.codes[..n]);
    for ((i, _), (_, code)) in texels.iter().zip(&fit.weights) {
        mixed.weights[*i] = *code;
    }
}

/// The logarithm of every half.
static LOGARITHMS: LazyLock<Vec<f32>> =
    LazyLock::new(|| (0..0x7c00).map(|half| logarithm(f16::from_bits(half).into()) as f32).collect());

/// The sum of squares of what a block is off by after transcoding.
fn transcoding_error(mixed: &Mixed, texels: &[Texel; TEXELS]) -> f32 {
    let mut sum = 0.0;
    for ((_, wanted), made) in texels.iter().zip(&transcoded::texels(mixed)) {
        let made: Colour = made.map(|half| LOGARITHMS[usize::from(half)]);
        for c in 0..3 {
            sum += (wanted[c] - made[c]) * (wanted[c] - made[c]);
        }
    }
    sum
}

/// The block with codes of its end points moved, as long as that brings it closer in both formats together.
fn polished((mut best, mut score): Found, texels: &[Texel; TEXELS]) -> Mixed {
    let number = MODES.iter().position(|mode| mode == best.mode).unwrap_or(0);
    let (subsets, n) = (best.mode.subsets, best.mode.kind.bytes());
    let owns = [0, subsets - 1].map(|s| of_subset(&best, s, texels));
    let codes_of = |mixed: &Mixed, s: usize| {
        let mut codes = [0; MOST_BYTES];
        codes[..n].copy_from_slice(&mixed.endpoints[s * n..(s + 1) * n]);
        codes
    };
    let mut errors = [0.0; 2];
    for (s, error) in errors.iter_mut().enumerate().take(subsets) {
        *error = Subset::new(&owns[s], number).weigh(codes_of(&best, s)).map_or(0.0, |fit| fit.error);
    }
    for _ in 0..POLISHES {
        let before = score;
        for (s, byte) in (0..subsets).flat_map(|s| (0..n).map(move |byte| (s, byte))) {
            let subset = Subset::new(&owns[s], number);
            for code in subset.beside(codes_of(&best, s)[byte]) {
                let mut codes = codes_of(&best, s);
                codes[byte] = code;
                let Some(fit) = subset.weigh(codes) else { continue };
                let in_astc = fit.error + errors[1 - s];
                if in_astc >= score {
                    continue;
                }
                let mut tried = best;
                put(&mut tried, s, subset.texels, &fit);
                let total = in_astc + transcoding_error(&tried, texels);
                if total < score {
                    (best, score, errors[s]) = (tried, total, fit.error);
                }
            }
        }
        if score == before {
            break;
        }
    }
    best
}
