//! What a table's own noise tells: whether what an explanation leaves has a pattern, and how far a rival is from it in standard deviations.
//!
//! A table that was sampled is as far from the truth everywhere as its samples were few: by the size of what is left alone, explanations that
//! differ by less than that look alike. Over all texels they do not: along the line from one to the other the table is at one place, known the
//! better the more texels there are. With what is left r and the difference d, that is t = Σ r d/Σ d² of the way. Its standard deviation
//! makes no assumption of how large the noise is where, nor that neighbours are independent: texels are put together in blocks, which are
//! taken to be, and the squares of the blocks' own sums are what the whole sum varies by. Derived here.

/// Blocks along each dimension of a table of one, two and three.
const BLOCKS: [usize; 3] = [16, 8, 4];
/// The block of every texel of a product of indices along each dimension, the first fastest.
pub(super) fn blocks(counts: &[usize]) -> Vec<usize> {
    let mut all = vec![0];
    for &count in counts.iter().rev() {
        // Two texels long at least: a block of one tells nothing of its neighbours.
        let n = BLOCKS[counts.len() - 1].min(count / 2).max(1);
        all = all.iter().flat_map(|block| (0..count).map(move |i| block * n + i * n / count)).collect();
    }
    all
}

/// What the texels of each block sum up to; those that are no numbers count for nothing.
fn sums(blocks: &[usize], of: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = vec![0.0; blocks.iter().max().map_or(0, |last| last + 1)];
    for (i, &block) in blocks.iter().enumerate() {
        let v = of(i);
        sums[block] += if v.is_finite() { v } else { 0.0 };
    }
    sums
}

/// How much of what is left neighbours have in common: 1 of independent noise, the number of a block's texels of what is the same in all of
/// them.
pub(super) fn pattern(left: &[f64], blocks: &[usize]) -> f64 {
    let squares = sums(blocks, |i| left[i] * left[i]);
    // Each block by itself: where noise is strong, there is no more of a pattern.
    let parts = sums(blocks, |i| left[i]).into_iter().zip(squares).filter(|(_, square)| *square > 0.0);
    let parts: Vec<f64> = parts.map(|(sum, square)| sum * sum / square).collect();
    parts.iter().sum::<f64>() / parts.len().max(1) as f64
}

/// Where a table is on the line from one explanation to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Apart {
    /// 0 at the one, 1 at the other.
    pub towards: f64,
    /// How far from the other, in standard deviations.
    pub deviations: f64,
}

/// Where the table is of which one explanation leaves `left`, and another leaves `difference` less than that; nothing where they say the same.
pub(super) fn apart(left: &[f64], difference: &[f64], blocks: &[usize]) -> Option<Apart> {
    // A block counts by how little noise there is, by whichever explains more of it: neither is favoured.
    let own = sums(blocks, |i| left[i] * left[i]);
    let others = sums(blocks, |i| (left[i] - difference[i]).powi(2));
    let least: Vec<f64> = own.into_iter().zip(others).map(|(a, b)| a.min(b)).collect();
    let floor = LEAST_NOISE * least.iter().sum::<f64>() / least.len().max(1) as f64;
    let weight = |i: usize| 1.0 / (least[blocks[i]] + floor);
    let square: f64 = sums(blocks, |i| weight(i) * difference[i] * difference[i]).iter().sum();
    let towards = sums(blocks, |i| weight(i) * left[i] * difference[i]).iter().sum::<f64>() / square;
    let pulls = sums(blocks, |i| weight(i) * (left[i] - towards * difference[i]) * difference[i]);
    let n = pulls.len() as f64;
    let deviation = (pulls.iter().map(|pull| pull * pull).sum::<f64>() * n / (n - 1.0)).sqrt() / square;
    (square > 0.0 && square.is_finite() && n > 1.0)
        .then_some(Apart { towards, deviations: (1.0 - towards) / deviation })
}

/// Noise of a block, in parts of that of all, below which a block counts for no more: by chance there may be hardly any.
const LEAST_NOISE: f64 = 0.01;

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of mean 0 and variance 1, without a pattern.
    fn noise(seed: u64, n: usize) -> Vec<f64> {
        let mut state = seed;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        (0..n).map(|_| (0..12).map(|_| unit()).sum::<f64>() - 6.0).collect()
    }

    const COUNTS: [usize; 2] = [32, 24];

    #[test]
    fn blocks_are_neighbours() {
        let all = blocks(&COUNTS);
        assert_eq!((all.len(), all.iter().max()), (32 * 24, Some(&63)));
        assert_eq!((all[0], all[3], all[4], all[2 * 32], all[3 * 32]), (0, 0, 1, 0, 8));
        assert_eq!(blocks(&[8, 8]).iter().max(), Some(&15), "of two texels along each dimension");
    }

    #[test]
    fn noise_has_no_pattern_and_what_is_smooth_has() {
        let n = COUNTS.iter().product();
        let blocks = blocks(&COUNTS);
        for seed in 1..50 {
            // Stronger at one end, as sampled tables are. 64 blocks: four standard deviations of the mean of as many squares.
            let noise: Vec<f64> = noise(seed, n).iter().enumerate().map(|(i, v)| v * (1.0 + (i % 32) as f64)).collect();
            let pattern = pattern(&noise, &blocks);
            assert!((pattern - 1.0).abs() < 4.0 * (2.0_f64 / 64.0).sqrt(), "{seed}: {pattern}");
        }
        let smooth: Vec<f64> = (0..n).map(|i| ((i % 32) as f64 / 10.0).sin()).collect();
        assert!(pattern(&smooth, &blocks) > 8.0);
    }

    #[test]
    fn deviations_are_those_of_repeated_noise() {
        let n = COUNTS.iter().product();
        let blocks = blocks(&COUNTS);
        let difference: Vec<f64> = (0..n).map(|i| 0.2 * ((i / 32) as f64 / 8.0).cos()).collect();
        // A table that is a quarter of the way, again and again: where it is found to be, and by how much that varies.
        let found: Vec<Apart> = (1..=200)
            .map(|seed| {
                let left: Vec<f64> = noise(seed, n).iter().zip(&difference).map(|(v, d)| v + 0.25 * d).collect();
                apart(&left, &difference, &blocks).unwrap()
            })
            .collect();
        let mean = found.iter().map(|a| a.towards).sum::<f64>() / 200.0;
        let deviation = (found.iter().map(|a| (a.towards - mean).powi(2)).sum::<f64>() / 199.0).sqrt();
        let claimed = found.iter().map(|a| (1.0 - a.towards) / a.deviations).sum::<f64>() / 200.0;
        // Weights that the noise itself has made favour neither end, but draw to the middle by about one part in a block's texels.
        let drawn = 0.25 / 12.0;
        assert!((mean - 0.25).abs() < drawn + 4.0 * deviation / 200.0_f64.sqrt(), "{mean} ± {deviation}");
        // A standard deviation of 200 is known to a twentieth: four of that.
        assert!((claimed / deviation - 1.0).abs() < 0.2, "{claimed} where it is {deviation}");
        assert_eq!(apart(&noise(1, n), &vec![0.0; n], &blocks), None);
    }
}
