//! Panoramas that the tests of this folder share.

use super::panorama::Panorama;
use crate::math::sobol::PointSet;

/// Independent uniform texels in [0, 1), times 10 in every seventh, with a sun of 1e5 in one texel if wanted.
pub(crate) fn random(width: usize, seed: u64, sun: Option<(usize, usize)>) -> Panorama {
    random_sized([width, width / 2], seed, sun)
}

/// The same of any proportions.
pub(crate) fn random_sized([width, height]: [usize; 2], seed: u64, sun: Option<(usize, usize)>) -> Panorama {
    let texel = |i: usize| {
        let p = PointSet::<3>::new(seed, i as u64, 1).points()[0];
        p.map(|v| (v * if i.is_multiple_of(7) { 10.0 } else { 1.0 }) as f32)
    };
    let mut texels: Vec<[f32; 3]> = (0..width * height).map(texel).collect();
    if let Some((column, row)) = sun {
        texels[row * width + column] = [1e5, 0.9e5, 0.5e5];
    }
    Panorama::new(width, height, texels).unwrap()
}

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// Maps of all sizes, proportions and kinds, by number: with noise or without, with lamps of all sizes, some at the poles, dark halves, black
/// channels, up to 1e5 bright.
pub(crate) fn any(number: u64) -> Panorama {
    let mut random = Random(number.wrapping_mul(0x0123_4567));
    let width = [4, 5, 7, 8, 13, 16, 31, 64, 100, 128, 200, 256, 333, 512, 1024][random.below(15)];
    let height = match random.below(4) {
        0 => width / 2 + random.below(width),
        1 => (width / 3).max(2),
        _ => width / 2,
    };
    let kind = random.below(7);
    let is_graded = random.uniform() < 0.5;
    let noise = [0.0, 0.1, 1.0, 3.0][random.below(4)];
    let floor = [0.0, 1e-4, 1e-2, 1.0][random.below(4)];
    let mut texels = vec![[0.0f32; 3]; width * height];
    for (i, texel) in texels.iter_mut().enumerate() {
        let y = (i / width) as f64 / height as f64;
        let base = if is_graded { floor * (1.2 - y) } else { floor };
        for (value, colour) in texel.iter_mut().zip([0.6, 0.8, 1.0]) {
            *value = (base * (2.0 * noise * (random.uniform() - 0.5)).exp() * colour) as f32;
        }
    }
    let n_lamps = if kind == 6 { 1 + random.below(20) } else { [0, 1, 2, 5, 60, 400][kind] };
    let strength = [1.0, 30.0, 1e3, 1e5, 1e5][random.below(5)];
    for _ in 0..n_lamps {
        let column = random.below(width);
        let row = match random.below(6) {
            0 => 0,
            1 => height - 1,
            2 => height / 2,
            _ => random.below(height),
        };
        let [across, down] = match random.below(3) {
            0 => [1, 1],
            1 => [2, 2],
            _ => [1 + random.below(1 + width / 10), 1 + random.below(1 + height / 10)],
        };
        let light = strength * (0.2 + random.uniform());
        let colour = [(); 3].map(|()| 0.1 + random.uniform());
        for (y, x) in (0..down).flat_map(|y| (0..across).map(move |x| (y, x))) {
            let texel = &mut texels[(row + y).min(height - 1) * width + (column + x) % width];
            (0..3).for_each(|c| texel[c] += (light * colour[c]) as f32);
        }
    }
    if kind == 6 && random.uniform() < 0.5 {
        texels[..width * (height / 2)].fill([0.0; 3]);
    }
    if random.uniform() < 0.1 {
        texels.iter_mut().for_each(|texel| texel[1] = 0.0);
    }
    Panorama::new(width, height, texels).unwrap()
}
