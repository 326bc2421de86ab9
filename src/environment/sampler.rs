//! Directions drawn from a panorama in proportion to its flux, and the reverse: the texel in a direction, fast.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::panorama::Panorama;

/// Draws directions with a density proportional to the residual radiance (the panorama beyond a base), averaged over the
/// channels. Each texel is uniform within its box, so the density is constant there.
#[derive(Debug, Clone)]
pub(super) struct EnvironmentSampler {
    width: usize,
    height: usize,
    rows_per_radian: f64,
    columns_per_radian: f64,
    row_edges: Vec<f64>,
    /// Residual radiance, and the density per steradian, of each texel.
    texels: Vec<[f32; 4]>,
    /// Cumulative probability of the rows: `height + 1` values from 0 to 1.
    rows: Vec<f64>,
    /// Cumulative probability within each row: `width + 1` values from 0 to 1 each.
    columns: Vec<f64>,
}

impl EnvironmentSampler {
    /// Nothing if no texel goes beyond the base.
    pub(super) fn new(panorama: &Panorama, base: [f32; 3]) -> Option<Self> {
        let (width, height) = (panorama.width(), panorama.height());
        let residual = |texel: &[f32; 3]| -> [f32; 3] { std::array::from_fn(|c| texel[c] - base[c]) };
        // A plain mean, not the luminance: a blue sun must be found as surely as a green one.
        let intensity = |texel: &[f32; 3]| residual(texel).map(f64::from).iter().sum::<f64>();
        let mut columns = Vec::with_capacity(height * (width + 1));
        let mut row_flux = Vec::with_capacity(height);
        for row in 0..height {
            let sum = push_cumulative(&mut columns, panorama.row(row).iter().map(intensity));
            row_flux.push(sum * panorama.solid_angle(row));
        }
        let mut rows = Vec::with_capacity(height + 1);
        let flux = push_cumulative(&mut rows, row_flux.into_iter());
        if flux <= 0.0 {
            return None;
        }
        let texel = |texel: &[f32; 3]| {
            let [r, g, b] = residual(texel);
            [r, g, b, (intensity(texel) / flux) as f32]
        };
        let texels = panorama.texels().iter().map(texel).collect();
        Some(Self {
            width,
            height,
            rows_per_radian: height as f64 / PI,
            columns_per_radian: width as f64 / TAU,
            row_edges: panorama.row_edges().to_vec(),
            texels,
            rows,
            columns,
        })
    }

    /// Maps the unit square to a direction and its texel: the row by the first coordinate, the column by the second; what
    /// is left of each places the direction within the texel, so strata of the square stay strata on the sphere.
    pub(super) fn sample(&self, xi: [f64; 2]) -> (DVec3, usize) {
        let (row, down) = pick(&self.rows, xi[0]);
        let start = row * (self.width + 1);
        let (column, across) = pick(&self.columns[start..start + self.width + 1], xi[1]);
        let y = self.row_edges[row] + (self.row_edges[row + 1] - self.row_edges[row]) * down;
        let (sin, cos) = (TAU * (column as f64 + across) / self.width as f64 - PI).sin_cos();
        let horizontal = ((1.0 - y) * (1.0 + y)).sqrt();
        (DVec3::new(horizontal * cos, y, horizontal * sin), row * self.width + column)
    }

    /// Residual radiance of a texel, and the density of its directions per steradian.
    pub(super) fn radiance_and_pdf(&self, texel: usize) -> ([f64; 3], f64) {
        let [r, g, b, pdf] = self.texels[texel].map(f64::from);
        ([r, g, b], pdf)
    }

    /// The texel in a unit direction.
    ///
    /// The angles are good to 2e-8 (see [`fast_atan2`]): at 1024 × 512, three directions in a million that fall within
    /// that of a texel's edge are given to its neighbour, far below any noise.
    pub(super) fn locate(&self, direction: DVec3) -> usize {
        let horizontal = (direction.x * direction.x + direction.z * direction.z).sqrt();
        let u = (fast_atan2(direction.z, direction.x) + PI) * self.columns_per_radian;
        let v = fast_atan2(horizontal, direction.y) * self.rows_per_radian;
        // Through i32: the processor has no instruction for larger integers.
        let row = (v as i32 as usize).min(self.height - 1);
        let column = (u as i32 as usize).min(self.width - 1);
        row * self.width + column
    }
}

/// Appends the running sums of some weights, from 0 and normalised to end at exactly 1; returns their sum. Weights that
/// are all zero leave zeros, which are never drawn from.
fn push_cumulative(cumulative: &mut Vec<f64>, weights: impl Iterator<Item = f64>) -> f64 {
    let start = cumulative.len();
    let mut sum = 0.0;
    cumulative.push(0.0);
    for weight in weights {
        sum += weight;
        cumulative.push(sum);
    }
    if sum > 0.0 {
        cumulative[start..].iter_mut().for_each(|value| *value /= sum);
    }
    sum
}

/// The interval of a cumulative distribution that holds `xi`, never an empty one, and the place within it.
fn pick(cumulative: &[f64], xi: f64) -> (usize, f64) {
    let index = cumulative.partition_point(|&value| value <= xi).clamp(1, cumulative.len() - 1) - 1;
    let (low, high) = (cumulative[index], cumulative[index + 1]);
    (index, (xi - low) / (high - low))
}

/// atan2 to 2e-8 radians, several times faster than the library's.
///
/// Source: Abramowitz & Stegun, 4.4.49, for |x| ≤ 1, after reduction to an octant.
fn fast_atan2(y: f64, x: f64) -> f64 {
    const COEFFICIENTS: [f64; 9] = [
        1.0,
        -0.3333314528,
        0.1999355085,
        -0.1420889944,
        0.1065626393,
        -0.0752896400,
        0.0429096138,
        -0.0161657367,
        0.0028662257,
    ];
    let (ax, ay) = (x.abs(), y.abs());
    // The tiny number keeps 0/0 at 0. (Comparisons rather than min and max, which mind NaN.)
    let (small, large) = if ax < ay { (ax, ay) } else { (ay, ax) };
    let t = small / (large + f64::MIN_POSITIVE);
    let t2 = t * t;
    let octant = t * COEFFICIENTS.iter().rev().fold(0.0, |sum, c| sum * t2 + c);
    let quadrant = if ay > ax { FRAC_PI_2 - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    half.copysign(y)
}

#[cfg(test)]
mod tests {
    use super::super::test_maps::random;
    use super::*;
    use crate::math::sobol::PointSet;

    #[test]
    fn fast_atan2_is_good_to_its_bound() {
        for i in 0..100_000 {
            let angle = TAU * (f64::from(i) / 100_000.0 - 0.5);
            let error = (fast_atan2(angle.sin(), angle.cos()) - angle.sin().atan2(angle.cos())).abs();
            assert!(error <= 2.1e-8, "angle {angle}: error {error}");
        }
        assert_eq!(fast_atan2(0.0, 0.0), 0.0);
    }

    #[test]
    fn samples_land_in_the_texel_that_they_name() {
        let panorama = random(64, 4, Some((10, 0)));
        let sampler = EnvironmentSampler::new(&panorama, panorama.min()).unwrap();
        let set = PointSet::<2>::new(1, 0, 1 << 14);
        let mut strays = 0;
        for &xi in set.points() {
            let (direction, texel) = sampler.sample(xi);
            assert!((direction.length() - 1.0).abs() < 1e-15);
            let (column, row) = panorama.locate(direction);
            strays += usize::from(row * 64 + column != texel) + usize::from(sampler.locate(direction) != texel);
        }
        // Of 16384 samples at most one is expected within 2e-8 of an edge (texels are 0.1 wide); three is unheard of.
        assert!(strays < 3, "{strays} samples lie in another texel");
    }

    #[test]
    fn texels_are_drawn_as_often_as_their_density_says() {
        let panorama = random(8, 5, Some((3, 1)));
        let sampler = EnvironmentSampler::new(&panorama, panorama.min()).unwrap();
        let n = 1 << 16;
        let mut seen = [0.0; 32];
        PointSet::<2>::new(2, 0, n).points().iter().for_each(|&xi| seen[sampler.sample(xi).1] += 1.0 / n as f64);
        let mut total = 0.0;
        for (texel, seen) in seen.into_iter().enumerate() {
            let wanted = sampler.radiance_and_pdf(texel).1 * panorama.solid_angle(texel / 8);
            total += wanted;
            // A (0, 2)-net of 2^16 points has at most 2 · 2^8 elementary squares on the border of a rectangle's image.
            assert!(
                (seen - wanted).abs() < 4.0 / 256.0 * wanted.sqrt().max(1.0 / 256.0),
                "{texel}: {seen}, wanted {wanted}"
            );
        }
        assert!((total - 1.0).abs() < 1e-6, "the density integrates to {total}"); // it is stored in f32
    }
}
