//! The texels that stand out from their surroundings, taken off a panorama and convolved exactly.
//!
//! A star of one texel under a narrow lobe is what makes Monte Carlo sparkle: too faint to be drawn often from the
//! environment, too small to be hit often by the lobe. What such texels have beyond their surroundings is a short list, and a short
//! list can be summed exactly for every direction; the rest has no outliers left.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

use super::full_sum::{FullSum, Lobe};
use super::kernel::Kernel;
use super::panorama::Panorama;

/// Texels that are peeled off at most.
const MOST: usize = 2048;
/// Side of the blocks, in texels, whose medians are the surroundings.
const BLOCK: usize = 16;
/// Outliers whose flux, in parts of their block's, is below this make no visible noise and are left where they are.
const LEAST: f64 = 0.02;
/// Nearer than this many extents to the lobe's peak, a texel is integrated with as many points as it takes; up to [`FAR`] with
/// two by two Gauss points (off by some (1/NEAR)⁴/4); beyond, with one (off by some (1/FAR)²/4).
const NEAR: f64 = 24.0;
const FAR: f64 = 160.0;
/// Largest relative error of [`Peel::evaluate`].
pub(super) const PEEL_ERROR: f64 = 1e-5;
/// Places of the two Gauss points in an interval [0, 1].
const GAUSS: [f64; 2] = [0.211_324_865_405_187_12, 0.788_675_134_594_812_9];

/// What stands out from a panorama.
#[derive(Debug, Clone)]
pub(super) struct Peel {
    texels: Vec<Peeled>,
    /// The largest extent of a texel, in radians.
    extent: f64,
}

#[derive(Debug, Clone)]
struct Peeled {
    index: usize,
    /// What is left in its place: what is around it.
    remainder: [f32; 3],
    /// The middle, and the solid angle.
    middle: (DVec3, f64),
    /// Two by two Gauss points with their parts of the solid angle.
    gauss: [(DVec3, f64); 4],
    /// Radiance beyond the surroundings.
    radiance: [f64; 3],
}

/// Which texels are outliers.
struct Wanted {
    /// They hold more than this part of their block's light beyond what surrounds them.
    of_block: f64,
    /// And at least this part of the panorama's.
    of_all: f64,
    /// In any channel, and beyond the darkest texel of all instead of the block's median.
    is_thorough: bool,
}

impl Peel {
    /// The outliers of a panorama, and the panorama without them: never darker than the block around it.
    pub(super) fn new(panorama: &Panorama) -> (Self, Panorama) {
        let brightest = Brightest::new(panorama);
        let peel = Self::take(panorama, &brightest, Wanted { of_block: LEAST, of_all: 0.0, is_thorough: false }, MOST);
        let mut rest = panorama.texels().to_vec();
        peel.remainders().for_each(|(index, texel)| rest[index] = texel);
        let rest = panorama.with_texels(rest);
        (peel, rest)
    }

    /// At most `most` outliers that each hold at least this part of the panorama's light (all channels together).
    pub(super) fn strongest(panorama: &Panorama, brightest: &Brightest, least_share: f64, most: usize) -> Self {
        Self::take(panorama, brightest, Wanted { of_block: 0.0, of_all: least_share, is_thorough: false }, most)
    }

    /// At most `most` texels that each hold at least this part of the panorama's light in some channel, beyond its darkest texel: lamps
    /// that fill a block are taken off too.
    pub(super) fn thoroughly(panorama: &Panorama, brightest: &Brightest, least_share: f64, most: usize) -> Self {
        Self::take(panorama, brightest, Wanted { of_block: 0.0, of_all: least_share, is_thorough: true }, most)
    }

    fn take(panorama: &Panorama, brightest: &Brightest, wanted: Wanted, most: usize) -> Self {
        let Wanted { of_block: least, of_all: least_share, is_thorough } = wanted;
        let (width, height) = (panorama.width(), panorama.height());
        let means = panorama.mean();
        let mean = means.iter().sum::<f64>();
        let lit: Vec<usize> = (0..3).filter(|&c| means[c] > 0.0).collect();
        let least_mean = lit.iter().map(|&c| means[c]).fold(f64::INFINITY, f64::min);
        let darkest: f64 = panorama.min().iter().map(|&v| f64::from(v)).sum();
        let of_blocks = |block: usize| {
            let top = block * BLOCK;
            let rows = top..(top + BLOCK).min(height);
            let solid_angles: Vec<f64> = rows.clone().map(|row| panorama.solid_angle(row)).collect();
            let widest = solid_angles.iter().copied().fold(0.0, f64::max);
            let mut candidates: Vec<(f64, usize, [f32; 3])> = vec![];
            for (left, brightest) in (0..width).step_by(BLOCK).zip(brightest.of_rows(block)) {
                let columns = left..(left + BLOCK).min(width);
                let places = || rows.clone().flat_map(|r| columns.clone().map(move |c| r * width + c));
                // Nothing here may be an outlier even against the darkest texel.
                let most_excess = brightest - darkest;
                if most_excess * widest < least_share * 4.0 * PI * if is_thorough { least_mean } else { mean.abs() } {
                    continue;
                }
                let median = match is_thorough {
                    true => panorama.min(),
                    false => median(places().map(|i| panorama.texels()[i]).collect()),
                };
                let surroundings = median.iter().map(|&v| f64::from(v)).sum::<f64>().max(1e-3 * mean);
                let block_angle: f64 = solid_angles.iter().sum::<f64>() * columns.len() as f64;
                for index in places() {
                    let texel = panorama.texels()[index];
                    let excess: f64 = (0..3).map(|c| f64::from((texel[c] - median[c]).max(0.0))).sum();
                    let flux = excess * solid_angles[index / width - top];
                    let mut share = flux / (4.0 * PI * mean.abs());
                    if is_thorough {
                        let of = |c: usize| f64::from((texel[c] - median[c]).max(0.0)) / means[c];
                        let most = lit.iter().map(|&c| of(c)).fold(0.0, f64::max);
                        share = most * solid_angles[index / width - top] / (4.0 * PI);
                    }
                    let flux = flux / (surroundings * block_angle);
                    if flux > least && share >= least_share {
                        // Noise asks for the largest beside their surroundings, a kernel's horizon for the largest of all.
                        candidates.push((if least_share > 0.0 { share } else { flux }, index, median));
                    }
                }
            }
            candidates
        };
        let mut candidates: Vec<_> = (0..height.div_ceil(BLOCK)).into_par_iter().flat_map_iter(of_blocks).collect();
        // The largest first; equal ones in the order of the panorama, so that the choice is the same on every run.
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        candidates.truncate(most);
        let texels = candidates
            .into_iter()
            .map(|(_, index, median)| {
                let texel = panorama.texels()[index];
                let remainder: [f32; 3] = std::array::from_fn(|c| texel[c].min(median[c]));
                let radiance = std::array::from_fn(|c| f64::from(texel[c]) - f64::from(remainder[c]));
                let (row, column) = (index / width, index % width);
                let place = |x: f64, y: f64| {
                    let (sin, cos) = (PI * (row as f64 + y) / height as f64).sin_cos();
                    let phi = TAU * (column as f64 + x) / width as f64 - PI;
                    (DVec3::new(sin * phi.cos(), cos, sin * phi.sin()), sin)
                };
                let solid_angle = panorama.solid_angle(row);
                let points = [0, 1, 2, 3].map(|i| place(GAUSS[i % 2], GAUSS[i / 2]));
                let total: f64 = points.iter().map(|(_, sin)| sin).sum();
                Peeled {
                    index,
                    remainder,
                    middle: (place(0.5, 0.5).0, solid_angle),
                    gauss: points.map(|(direction, sin)| (direction, solid_angle * sin / total)),
                    radiance,
                }
            })
            .collect();
        let extent = (PI / height as f64).max(TAU / width as f64);
        Self { texels, extent }
    }

    /// Where in the panorama each is, and what is left there.
    pub(super) fn remainders(&self) -> impl Iterator<Item = (usize, [f32; 3])> + '_ {
        self.texels.iter().map(|texel| (texel.index, texel.remainder))
    }

    /// How many texels were peeled off.
    pub(super) fn len(&self) -> usize {
        self.texels.len()
    }

    /// Where in the panorama each is, and its radiance beyond the surroundings; the largest flux first.
    pub(super) fn texels(&self) -> impl Iterator<Item = (usize, [f64; 3])> + '_ {
        self.texels.iter().map(|texel| (texel.index, texel.radiance))
    }

    /// Where in the panorama one is, and its solid angle.
    pub(super) fn texel(&self, i: usize) -> (usize, f64) {
        (self.texels[i].index, self.texels[i].middle.1)
    }

    /// ∫ K(axis·l) over what was peeled off; `exact` integrates the texels near the lobe's peak and across its horizon.
    pub(super) fn evaluate(&self, axis: DVec3, kernel: &Kernel, exact: &FullSum) -> [f64; 3] {
        let lobe = Lobe::new(axis, kernel);
        let at = |(direction, solid_angle): (DVec3, f64)| kernel.eval(1.0 - axis.dot(direction)) * solid_angle;
        let [near, far] = [NEAR, FAR].map(|extents| kernel.rough_parts(extents * self.extent, self.extent));
        let mut sum = [0.0; 3];
        for texel in &self.texels {
            let cos = axis.dot(texel.middle.0);
            let within = |[near_from, belt]: [f64; 2]| cos > near_from || cos.abs() < belt;
            let weight = if within(near) {
                exact.texel_weight(texel.index, &lobe)
            } else if within(far) {
                texel.gauss.into_iter().map(at).sum()
            } else {
                at(texel.middle)
            };
            for (sum, radiance) in sum.iter_mut().zip(texel.radiance) {
                *sum += weight * radiance;
            }
        }
        sum
    }
}

/// For each block the sum of its channels' maxima: none of its texels has more in its three channels together.
#[derive(Debug)]
pub(super) struct Brightest {
    across: usize,
    blocks: Vec<f64>,
}

impl Brightest {
    pub fn new(panorama: &Panorama) -> Self {
        let n = Self::n_rows(panorama.height());
        let of_rows = |i: usize| Self::in_rows(Self::rows(i, panorama.height()).map(|row| panorama.row(row)));
        Self::from_rows((0..n).into_par_iter().map(of_rows).collect())
    }

    /// From those of each row of blocks, one after the other.
    pub fn from_rows(rows: Vec<Vec<f64>>) -> Self {
        Self { across: rows.first().map_or(0, Vec::len), blocks: rows.concat() }
    }

    /// How many rows of blocks there are.
    pub fn n_rows(height: usize) -> usize {
        height.div_ceil(BLOCK)
    }

    /// The rows of the panorama that a row of blocks holds.
    pub fn rows(block: usize, height: usize) -> std::ops::Range<usize> {
        block * BLOCK..((block + 1) * BLOCK).min(height)
    }

    /// Those of one row of blocks.
    #[inline(always)]
    pub fn in_rows<'a>(rows: impl Iterator<Item = &'a [[f32; 3]]>) -> Vec<f64> {
        /// Texels at a time, so that maxima are vectors.
        const TOGETHER: usize = 8;
        let mut most: Vec<[[f32; 3]; TOGETHER]> = vec![];
        let compare = |most: &mut [f32; 3], texel: &[f32; 3]| {
            for (most, &value) in most.iter_mut().zip(texel) {
                *most = if value > *most { value } else { *most };
            }
        };
        for row in rows {
            most.resize(row.len().div_ceil(BLOCK), [[f32::NEG_INFINITY; 3]; TOGETHER]);
            for (texels, most) in row.chunks(BLOCK).zip(&mut most) {
                let (whole, rest) = texels.as_chunks::<TOGETHER>();
                for texels in whole {
                    (0..TOGETHER).for_each(|i| compare(&mut most[i], &texels[i]));
                }
                rest.iter().for_each(|texel| compare(&mut most[0], texel));
            }
        }
        let of_channel =
            |most: &[[f32; 3]; TOGETHER], c: usize| most.iter().fold(f32::NEG_INFINITY, |a, t| a.max(t[c]));
        most.iter().map(|most| (0..3).map(|c| f64::from(of_channel(most, c))).sum()).collect()
    }

    fn of_rows(&self, block: usize) -> impl Iterator<Item = f64> + '_ {
        self.blocks[block * self.across..(block + 1) * self.across].iter().copied()
    }
}

/// The median of each channel on its own.
fn median(texels: Vec<[f32; 3]>) -> [f32; 3] {
    std::array::from_fn(|c| {
        let mut values: Vec<f32> = texels.iter().map(|t| t[c]).collect();
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f32::total_cmp).1
    })
}

#[cfg(test)]
mod tests {
    use super::super::builtin::builtin;
    use super::*;

    #[test]
    fn peeled_and_rest_convolve_to_the_whole() {
        let whole = builtin("sun", 128).unwrap();
        let (peel, rest) = Peel::new(&whole);
        assert!(!peel.texels.is_empty(), "a sun stands out");
        let (truth, remaining) = (FullSum::new(&whole), FullSum::new(&rest));
        let sun = super::super::builtin::sun_direction();
        let (side, up) = sun.any_orthonormal_pair();
        for alpha in [0.03, 0.25, 1.0] {
            let kernel = Kernel::new(alpha);
            for axis in [sun, -sun, side, up, (sun + 0.05 * side).normalize(), (sun + 0.4 * up).normalize()] {
                let (a, b) = (peel.evaluate(axis, &kernel, &truth), remaining.evaluate(axis, &kernel));
                let wanted = truth.evaluate(axis, &kernel);
                for c in 0..3 {
                    let off = (a[c] + b[c] - wanted[c]).abs();
                    assert!(
                        off <= PEEL_ERROR * wanted[c],
                        "alpha {alpha}, {axis}: {} and {}, {}",
                        a[c],
                        b[c],
                        wanted[c]
                    );
                }
            }
        }
    }

    #[test]
    fn nothing_is_peeled_off_a_smooth_panorama() {
        let (peel, rest) = Peel::new(&builtin("gradient", 128).unwrap());
        assert!(peel.texels.is_empty());
        assert_eq!(rest, builtin("gradient", 128).unwrap());
    }
}
