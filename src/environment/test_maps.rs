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
