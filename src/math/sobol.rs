//! Randomised quasi-Monte Carlo points: Sobol' sequences under nested uniform scrambling.
//!
//! The points are computed once and shared by every integral of a bake: scrambling on the fly costs more than most
//! integrands. Replicates (the same sequence under independent scrambles) give an honest standard error.
//!
//! Sources: direction numbers of Joe & Kuo (2008), "Constructing Sobol sequences with better two-dimensional
//! projections" (the first ten rows of their table `new-joe-kuo-6`); scrambling of Owen (1995), "Randomly permuted
//! (t,m,s)-nets and (t,s)-sequences", done literally: one independent coin for every node of the binary tree of prefixes.

use std::ops::Range;

/// The largest number of dimensions that [`PointSet`] knows.
pub const MAX_DIMENSIONS: usize = 10;

/// Digits of a Sobol' coordinate, and so the logarithm of the longest sequence.
const DIGITS: u32 = 32;

/// One row of Joe & Kuo's table: the degree `s` of the primitive polynomial, its inner coefficients `a`, and the
/// initial direction numbers `m`.
struct Polynomial {
    degree: u32,
    coefficients: u32,
    initial: &'static [u32],
}

/// Dimensions 2 to 10 of the table; dimension 1 is the van der Corput sequence and has no row.
const POLYNOMIALS: [Polynomial; MAX_DIMENSIONS - 1] = [
    Polynomial { degree: 1, coefficients: 0, initial: &[1] },
    Polynomial { degree: 2, coefficients: 1, initial: &[1, 3] },
    Polynomial { degree: 3, coefficients: 1, initial: &[1, 3, 1] },
    Polynomial { degree: 3, coefficients: 2, initial: &[1, 1, 1] },
    Polynomial { degree: 4, coefficients: 1, initial: &[1, 1, 3, 3] },
    Polynomial { degree: 4, coefficients: 4, initial: &[1, 3, 5, 13] },
    Polynomial { degree: 5, coefficients: 2, initial: &[1, 1, 5, 5, 17] },
    Polynomial { degree: 5, coefficients: 4, initial: &[1, 1, 5, 5, 5] },
    Polynomial { degree: 5, coefficients: 7, initial: &[1, 1, 7, 11, 1] },
];

/// A scrambled Sobol' point set in `D` dimensions, coordinates in [0, 1).
///
/// Dimensions 0 and 1 form a (0, 2)-sequence: every block of 2^m points that starts at a multiple of 2^m has exactly one
/// point in each elementary interval of area 2^−m.
#[derive(Debug, Clone, PartialEq)]
pub struct PointSet<const D: usize> {
    keys: [u64; D],
    points: Vec<[f64; D]>,
}

impl<const D: usize> PointSet<D> {
    /// The first `n` points of the sequence under the scramble that `seed` and `replicate` name.
    pub fn new(seed: u64, replicate: u64, n: usize) -> Self {
        const { assert!(D >= 1 && D <= MAX_DIMENSIONS) };
        let stream = mix(mix(seed) ^ replicate);
        let keys = std::array::from_fn(|dimension| mix(stream ^ (dimension as u64 + 1)));
        let mut set = Self { keys, points: Vec::new() };
        set.extend_to(n);
        set
    }

    /// Lengthens the set to `n` points; those that it holds already stay as they are.
    ///
    /// A power of two keeps the set balanced. Beyond 2^32 points the sequence would repeat, so `n` stops there.
    pub fn extend_to(&mut self, n: usize) {
        let n = (n as u64).min(1 << DIGITS);
        let more = self.range(self.points.len() as u64..n);
        self.points.extend(more);
    }

    /// The points of the sequence with these indices, without keeping them.
    pub fn range(&self, indices: Range<u64>) -> Vec<[f64; D]> {
        let directions: [[u32; DIGITS as usize]; D] = std::array::from_fn(direction_numbers);
        let coordinate =
            |index: u64, dimension: usize| scramble(sobol(&directions[dimension], index as u32), self.keys[dimension]);
        indices.map(|index| std::array::from_fn(|dimension| coordinate(index, dimension))).collect()
    }

    /// The points, in the order of the sequence.
    pub fn points(&self) -> &[[f64; D]] {
        &self.points
    }
}

/// The direction numbers of a dimension, most significant digit first, as fixed-point fractions of 2^32.
fn direction_numbers(dimension: usize) -> [u32; DIGITS as usize] {
    let mut v = [0u32; DIGITS as usize];
    if dimension == 0 {
        for (digit, v) in v.iter_mut().enumerate() {
            *v = 1 << (DIGITS - 1 - digit as u32);
        }
        return v;
    }
    // Joe & Kuo (2008), equation 2, with m_k kept as v_k = m_k 2^(32−k).
    let Polynomial { degree, coefficients, initial } = POLYNOMIALS[dimension - 1];
    let s = degree as usize;
    for k in 0..DIGITS as usize {
        v[k] = if k < s {
            initial[k] << (DIGITS as usize - 1 - k)
        } else {
            let mut next = v[k - s] ^ (v[k - s] >> s);
            for j in 1..s {
                if coefficients >> (s - 1 - j) & 1 == 1 {
                    next ^= v[k - j];
                }
            }
            next
        };
    }
    v
}

fn sobol(directions: &[u32; DIGITS as usize], index: u32) -> u32 {
    directions.iter().enumerate().filter(|(bit, _)| index >> bit & 1 == 1).fold(0, |x, (_, v)| x ^ v)
}

/// Owen's nested uniform scramble of the digits of `x`, then uniform digits up to the 53 that an f64 in [0, 1) holds.
fn scramble(x: u32, key: u64) -> f64 {
    let mut scrambled = 0u64;
    for digit in 0..DIGITS {
        // A one before the digits that precede this one names the node of the tree.
        let node = (1u64 << digit) | (u64::from(x) >> (DIGITS - digit));
        let coin = coin_word(key, node) >> 63;
        let bit = u64::from(x >> (DIGITS - 1 - digit) & 1);
        scrambled = scrambled << 1 | (bit ^ coin);
    }
    let tail = coin_word(key, 1 << DIGITS | u64::from(x)) >> (64 - (53 - DIGITS));
    (scrambled << (53 - DIGITS) | tail) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// 64 random bits for a node of the tree.
fn coin_word(key: u64, node: u64) -> u64 {
    mix(key.wrapping_add(node.wrapping_mul(GOLDEN)))
}

/// 2^64 divided by the golden ratio, made odd: the increment of SplitMix64.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// The output function of SplitMix64 (Steele, Lea & Flood 2014, with Stafford's constants): a bijection whose every
/// output bit depends on every input bit.
fn mix(x: u64) -> u64 {
    let mut z = x.wrapping_add(GOLDEN);
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ z >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_dimension_has_one_point_in_each_stratum() {
        for (seed, replicate) in [(0, 0), (7, 31)] {
            let set = PointSet::<10>::new(seed, replicate, 1 << 10);
            for (m, dimension) in (0..=10).flat_map(|m| (0..10).map(move |d| (m, d))) {
                for block in set.points().chunks_exact(1 << m) {
                    let mut seen = vec![0; 1 << m];
                    block.iter().for_each(|p| seen[(p[dimension] * f64::from(1 << m)) as usize] += 1);
                    assert!(seen.iter().all(|&n| n == 1), "m {m}, dimension {dimension}: {seen:?}");
                }
            }
        }
    }

    #[test]
    fn dimensions_zero_and_one_are_a_zero_two_sequence() {
        let set = PointSet::<2>::new(3, 5, 1 << 11);
        for m in 0..=8u32 {
            for (block, split) in set.points().chunks_exact(1 << m).flat_map(|b| (0..=m).map(move |s| (b, s))) {
                let (columns, rows) = (1usize << split, 1usize << (m - split));
                let mut seen = vec![0; 1 << m];
                for p in block {
                    seen[(p[1] * rows as f64) as usize * columns + (p[0] * columns as f64) as usize] += 1;
                }
                assert!(seen.iter().all(|&n| n == 1), "m {m}, {columns} x {rows} intervals: {seen:?}");
            }
        }
    }

    #[test]
    fn a_longer_set_begins_with_the_shorter_one() {
        let mut set = PointSet::<5>::new(11, 2, 64);
        let first = set.points().to_vec();
        set.extend_to(256);
        assert_eq!(&set.points()[..64], &first[..]);
        assert_eq!(set, PointSet::new(11, 2, 256));
    }

    /// Means over replicates of a five-dimensional product whose integral is 1: unbiased, and far below the variance of
    /// independent points.
    #[test]
    fn the_mean_over_replicates_is_unbiased_and_beats_independent_points() {
        let replicates = 512;
        let n = 256;
        let means: Vec<f64> = (0..replicates)
            .map(|r| {
                let set = PointSet::<5>::new(1, r, n);
                let f = |p: &[f64; 5]| p.iter().map(|x| 1.5 * x.sqrt()).product::<f64>();
                set.points().iter().map(f).sum::<f64>() / n as f64
            })
            .collect();
        let mean = means.iter().sum::<f64>() / replicates as f64;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (replicates - 1) as f64;
        let standard_error = (variance / replicates as f64).sqrt();
        // False alarm: 6e-7 (five standard errors).
        assert!((mean - 1.0).abs() < 5.0 * standard_error, "mean {mean} ± {standard_error}, wanted 1");
        // ∫ Π (9/4) x = (9/8)^5, so independent points have this variance.
        let independent = (1.125f64.powi(5) - 1.0) / n as f64;
        assert!(variance < 0.1 * independent, "variance {variance}, independent points {independent}");
    }

    /// If replicates were correlated, averages over groups of four would not have a quarter of the variance.
    #[test]
    fn replicates_are_independent() {
        let n = 4096;
        let first: Vec<f64> = (0..n).map(|r| PointSet::<3>::new(9, r, 1).points()[0][2]).collect();
        let variance = |v: &[f64]| v.iter().map(|x| (x - 0.5).powi(2)).sum::<f64>() / v.len() as f64;
        let grouped: Vec<f64> = first.chunks_exact(4).map(|c| c.iter().sum::<f64>() / 4.0).collect();
        let (single, group) = (variance(&first), variance(&grouped));
        // The variance of a uniform is 1/12; a sample variance over k values is off by sqrt(0.8/k) at one sigma
        // (uniform) or sqrt(2/k) (near-normal): five sigmas, false alarm 6e-7 each.
        assert!((single * 12.0 - 1.0).abs() < 5.0 * (0.8 / n as f64).sqrt(), "variance {single}, wanted 1/12");
        let k = grouped.len() as f64;
        assert!((group * 48.0 - 1.0).abs() < 5.0 * (2.0 / k).sqrt(), "variance {group}, wanted 1/48");
        // Neighbouring replicates, neighbouring dimensions and neighbouring seeds do not correlate.
        let centred = |seed, r, d: usize| PointSet::<3>::new(seed, r, 1).points()[0][d] - 0.5;
        for (name, shift) in [("replicate", (0, 1, 0)), ("dimension", (0, 0, 1)), ("seed", (1, 0, 0))] {
            let product = |r: u64| centred(9, r, 0) * centred(9 + shift.0, r + shift.1, shift.2);
            let correlation = 12.0 * (0..n).map(product).sum::<f64>() / n as f64;
            assert!(correlation.abs() < 5.0 / (n as f64).sqrt(), "{name}: correlation {correlation}");
        }
    }
}
