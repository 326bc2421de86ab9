//! The environment itself: piecewise constant over the texels of an equirectangular panorama.
//!
//! A direction d samples the panorama at u = 1/2 + atan2(d.z, d.x)/2π, v = acos(d.y)/π (+Y up, right-handed). A texel is
//! a box in (φ, d.y), where φ = atan2(d.z, d.x): those two coordinates preserve area on the sphere (Archimedes), so a
//! texel's solid angle is the box's area, and a sun of two texels has a flux that is known exactly.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::colour::Primaries;
use crate::error::{Error, Result};

/// Fewest columns of a panorama.
pub const MIN_WIDTH: usize = 4;
/// Fewest rows of a panorama.
pub const MIN_HEIGHT: usize = 2;

/// The box that a texel is on the sphere: dω = dφ d(d.y).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelBox {
    /// Lower and upper azimuth atan2(d.z, d.x), in [−π, π].
    pub phi: [f64; 2],
    /// Lower and upper height d.y, in [−1, 1].
    pub y: [f64; 2],
}

impl TexelBox {
    /// The unit direction of the middle of the box.
    pub fn middle(&self) -> DVec3 {
        let (phi, y) = (0.5 * (self.phi[0] + self.phi[1]), 0.5 * (self.y[0] + self.y[1]));
        let r = crate::math::frame::sine_of_cosine(y);
        DVec3::new(r * phi.cos(), y, r * phi.sin())
    }
}

/// A radiance map over the sphere, piecewise constant over `width × height` texels, linear RGB, all finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Panorama {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
    /// d.y at the `height + 1` edges of the rows, from 1 down to −1.
    row_edges: Vec<f64>,
    mean: [f64; 3],
    /// The smallest and the largest radiance of each channel.
    range: [[f32; 3]; 2],
    primaries: Primaries,
    luminance_weights: [f64; 3],
}

impl Panorama {
    /// The panorama with these texels, row 0 at the top (+Y).
    ///
    /// The texels cover the sphere whatever their number: where it is not 2:1 they are not square at the horizon.
    ///
    /// **Errors**: fewer than [`MIN_WIDTH`] columns or [`MIN_HEIGHT`] rows, a number of texels that does not fit, values not finite.
    pub fn new(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Result<Self> {
        check_shape(width, height)?;
        if texels.len() != width * height {
            return Err(Error::invalid(
                format!("panorama of {width} × {height} holds {} texels, {} were wanted", texels.len(), width * height),
                "give one texel per pixel",
            ));
        }
        let values = texels.iter().flatten().copied();
        refuse_nonfinite(values.clone().filter(|v| !v.is_finite()).count(), values, width)?;
        let mut panorama = Self {
            width,
            height,
            texels,
            row_edges: row_edges(height),
            mean: [0.0; 3],
            range: [[0.0; 3]; 2],
            primaries: Primaries::REC709,
            luminance_weights: REC709_LUMINANCE,
        };
        panorama.range = panorama.compute_range();
        panorama.mean = panorama.compute_mean();
        Ok(panorama)
    }

    /// The same panorama with other texels, as many and all finite.
    pub(super) fn with_texels(&self, texels: Vec<[f32; 3]>) -> Self {
        debug_assert_eq!(texels.len(), self.texels.len());
        let row_edges = self.row_edges.clone();
        let mut panorama = Self { texels, row_edges, mean: [0.0; 3], ..*self };
        panorama.range = panorama.compute_range();
        panorama.mean = panorama.compute_mean();
        panorama
    }

    /// The panorama `width` × `width / 2` whose texels are a function of their boxes.
    pub(super) fn from_fn(width: usize, radiance: impl Fn(TexelBox) -> [f64; 3]) -> Result<Self> {
        let height = width / 2;
        let texel = |index: usize| radiance(texel_box(width, index % width, index / width)).map(|v| v as f32);
        Self::new(width, height, (0..width * height).map(texel).collect())
    }

    /// Texels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All texels, row by row from the top (+Y), each row from φ = −π to π.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// One row of texels.
    pub fn row(&self, row: usize) -> &[[f32; 3]] {
        &self.texels[row * self.width..(row + 1) * self.width]
    }

    /// The heights d.y of the `height + 1` edges between rows, from 1 down to −1.
    pub fn row_edges(&self) -> &[f64] {
        &self.row_edges
    }

    /// Azimuth of the left edge of a column (`width` gives π).
    pub fn column_edge(&self, column: usize) -> f64 {
        column_edge(column, self.width)
    }

    /// The box of a texel.
    pub fn texel_box(&self, column: usize, row: usize) -> TexelBox {
        TexelBox {
            phi: [self.column_edge(column), self.column_edge(column + 1)],
            y: [self.row_edges[row + 1], self.row_edges[row]],
        }
    }

    /// Solid angle of each texel of a row, in steradians.
    pub fn solid_angle(&self, row: usize) -> f64 {
        row_solid_angle(self.width, self.height, row)
    }

    /// Column and row of the texel in a direction (which need not be of unit length).
    pub fn locate(&self, direction: DVec3) -> (usize, usize) {
        let horizontal = direction.x.hypot(direction.z);
        let u = 0.5 + direction.z.atan2(direction.x) / TAU;
        let v = horizontal.atan2(direction.y) / PI;
        let index = |t: f64, n: usize| ((t * n as f64) as usize).min(n - 1);
        (index(u, self.width), index(v, self.height))
    }

    /// Radiance from a direction.
    pub fn radiance(&self, direction: DVec3) -> [f32; 3] {
        let (column, row) = self.locate(direction);
        self.texels[row * self.width + column]
    }

    /// What a sampler shows from a direction: bilinear filtering around the world, ending at the poles.
    pub fn filtered(&self, direction: DVec3) -> [f64; 3] {
        let u = 0.5 + direction.z.atan2(direction.x) / TAU;
        let v = direction.x.hypot(direction.z).atan2(direction.y) / PI;
        let [x, y] = [u * self.width as f64 - 0.5, v * self.height as f64 - 0.5];
        let (s, t) = (x - x.floor(), y - y.floor());
        let at = |i: isize, j: isize| {
            let column = (x.floor() as isize + i).rem_euclid(self.width as isize) as usize;
            let row = (y.floor() as isize + j).clamp(0, self.height as isize - 1) as usize;
            self.texels[row * self.width + column].map(f64::from)
        };
        let taps = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
        std::array::from_fn(|c| {
            let line = |i: usize| taps[i][c] + s * (taps[i + 1][c] - taps[i][c]);
            line(0) + t * (line(2) - line(0))
        })
    }

    /// Mean radiance over the sphere, weighted by solid angle. A constant panorama has exactly its constant.
    pub fn mean(&self) -> [f64; 3] {
        self.mean
    }

    /// What red, green and blue are: Rec. 709 unless [`Panorama::with_primaries`] said otherwise.
    pub fn primaries(&self) -> Primaries {
        self.primaries
    }

    /// The same values, said to be in these primaries.
    pub fn with_primaries(self, primaries: Primaries) -> Self {
        Self { primaries, luminance_weights: primaries.luminance_weights(), ..self }
    }

    /// Luminance of a colour in the panorama's primaries.
    pub fn luminance(&self, rgb: [f64; 3]) -> f64 {
        dot(self.luminance_weights, rgb)
    }

    /// Smallest radiance in each channel.
    pub fn min(&self) -> [f32; 3] {
        self.range[0]
    }

    /// Largest radiance in each channel.
    pub fn max(&self) -> [f32; 3] {
        self.range[1]
    }

    fn compute_range(&self) -> [[f32; 3]; 2] {
        // Four texels at a time, twelve numbers in a row: one vector comparison each.
        const TOGETHER: usize = 4;
        let (whole, rest) = self.texels.as_chunks::<TOGETHER>();
        let (mut low, mut high) = ([[f32::INFINITY; 3]; TOGETHER], [[f32::NEG_INFINITY; 3]; TOGETHER]);
        for texels in whole.iter() {
            for (i, texel) in texels.iter().enumerate() {
                for c in 0..3 {
                    low[i][c] = if texel[c] < low[i][c] { texel[c] } else { low[i][c] };
                    high[i][c] = if texel[c] > high[i][c] { texel[c] } else { high[i][c] };
                }
            }
        }
        let lower = |m: [f32; 3], t: &[f32; 3]| std::array::from_fn(|c| m[c].min(t[c]));
        let upper = |m: [f32; 3], t: &[f32; 3]| std::array::from_fn(|c| m[c].max(t[c]));
        [
            low.iter().chain(rest).fold([f32::INFINITY; 3], lower),
            high.iter().chain(rest).fold([f32::NEG_INFINITY; 3], upper),
        ]
    }

    /// Position of the texel with the largest luminance, and its luminance.
    pub fn peak(&self) -> (usize, usize, f64) {
        let brighter = |best: (usize, f64), (index, texel): (usize, &[f32; 3])| {
            let y = self.luminance(texel.map(f64::from));
            if y > best.1 { (index, y) } else { best }
        };
        let (index, y) = self.texels.iter().enumerate().fold((0, f64::NEG_INFINITY), brighter);
        (index % self.width, index / self.width, y)
    }

    fn compute_mean(&self) -> [f64; 3] {
        // Relative to the darkest texel, so that a constant comes out as itself and no sun cancels.
        let origin = self.min().map(f64::from);
        let mut sum = [0.0; 3];
        for row in 0..self.height {
            let mut row_sum = [0.0; 3];
            for texel in self.row(row) {
                for c in 0..3 {
                    row_sum[c] += f64::from(texel[c]) - origin[c];
                }
            }
            for c in 0..3 {
                sum[c] += row_sum[c] * self.solid_angle(row);
            }
        }
        std::array::from_fn(|c| origin[c] + sum[c] / (4.0 * PI))
    }
}

/// [`Primaries::luminance_weights`] of Rec. 709, computed beforehand.
const REC709_LUMINANCE: [f64; 3] = [0.21263900587151033, 0.7151686787677562, 0.0721923153607338];

/// Luminance of linear Rec. 709 RGB.
pub fn luminance(rgb: [f64; 3]) -> f64 {
    dot(REC709_LUMINANCE, rgb)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Solid angle of each texel of a row, in steradians.
pub(super) fn row_solid_angle(width: usize, height: usize, row: usize) -> f64 {
    // cos a − cos b = 2 sin((a+b)/2) sin((b−a)/2): no cancellation at the poles.
    let n = height as f64;
    TAU / width as f64 * 2.0 * (PI * (row as f64 + 0.5) / n).sin() * (PI / (2.0 * n)).sin()
}

/// The heights d.y of the edges between that many rows, from 1 down to −1.
pub(super) fn row_edges(height: usize) -> Vec<f64> {
    (0..=height).map(|row| row_edge(row, height)).collect()
}

/// The box of a texel of a built-in panorama of this width, which is half as high.
pub(super) fn texel_box(width: usize, column: usize, row: usize) -> TexelBox {
    let y = |row: usize| row_edge(row, width / 2);
    TexelBox { phi: [column_edge(column, width), column_edge(column + 1, width)], y: [y(row + 1), y(row)] }
}

fn column_edge(column: usize, width: usize) -> f64 {
    TAU * column as f64 / width as f64 - PI
}

/// d.y at an edge between rows; the two hemispheres mirror each other to the last bit.
fn row_edge(row: usize, height: usize) -> f64 {
    // cos θ = sin(π/2 − θ), exact at the poles and at the equator.
    (PI / 2.0 * (height as f64 - 2.0 * row as f64) / height as f64).sin()
}

/// Refuses what is too small to be a map of the sphere.
pub(super) fn check_shape(width: usize, height: usize) -> Result<()> {
    if width < MIN_WIDTH || height < MIN_HEIGHT {
        return Err(Error::invalid(
            format!("panorama of {width} × {height}, where at least {MIN_WIDTH} × {MIN_HEIGHT} texels are wanted"),
            "give a larger picture; an environment of one colour is a panorama of that colour",
        ));
    }
    Ok(())
}

fn refuse_nonfinite(count: usize, mut values: impl Iterator<Item = f32>, width: usize) -> Result<()> {
    let Some(first) = values.position(|v| !v.is_finite()) else { return Ok(()) };
    let (x, y, channel) = (first / 3 % width, first / 3 / width, ["red", "green", "blue"][first % 3]);
    Err(Error::invalid(
        format!(
            "panorama holds {count} values that are NaN or infinite, the first in the {channel} of texel ({x}, {y})"
        ),
        "repair the file, or use --nonfinite zero",
    ))
}

#[cfg(test)]
mod tests {
    use super::super::test_maps::random;
    use super::*;

    #[test]
    fn pictures_too_small_for_a_sphere_are_refused() {
        for (width, height) in [(0, 0), (1, 1), (2, 1), (3, 2), (100, 1), (4, 1)] {
            let error = Panorama::new(width, height, vec![[0.0; 3]; width * height]).unwrap_err().to_string();
            assert!(error.contains(&format!("{width} × {height}, where at least 4 × 2")), "{error}");
        }
        for (width, height) in [(4, 2), (5, 3), (100, 60), (4, 9)] {
            Panorama::new(width, height, vec![[0.0; 3]; width * height]).unwrap();
        }
    }

    #[test]
    fn boxes_cover_the_sphere_and_hold_their_directions() {
        let panorama = random(20, 1, None);
        let mut total = 0.0;
        for (column, row) in (0..10).flat_map(|row| (0..20).map(move |column| (column, row))) {
            let b = panorama.texel_box(column, row);
            let area = (b.phi[1] - b.phi[0]) * (b.y[1] - b.y[0]);
            assert!((area / panorama.solid_angle(row) - 1.0).abs() < 1e-13, "row {row}");
            total += area;
            let (phi, y) = ((b.phi[0] + b.phi[1]) / 2.0, (b.y[0] + b.y[1]) / 2.0);
            let horizontal = (1.0 - y * y).sqrt();
            assert_eq!(panorama.locate(DVec3::new(horizontal * phi.cos(), y, horizontal * phi.sin())), (column, row));
        }
        assert!((total / (4.0 * PI) - 1.0).abs() < 1e-14, "{total}");
    }

    #[test]
    fn directions_follow_the_documented_convention() {
        let panorama = random(16, 2, None);
        // u = 1/2 + atan2(z, x)/2π, v = acos(y)/π, a little inside the texel that begins there.
        let nudge = DVec3::new(1e-3, -1e-3, 1e-3);
        assert_eq!(panorama.locate(DVec3::X + nudge), (8, 4));
        assert_eq!(panorama.locate(DVec3::Z + DVec3::new(-1e-3, -1e-3, 0.0)), (12, 4));
        assert_eq!(panorama.locate(DVec3::NEG_X + DVec3::new(0.0, 1e-3, -1e-3)), (0, 3));
        assert_eq!(panorama.locate(DVec3::Y).1, 0);
        assert_eq!(panorama.locate(DVec3::NEG_Y).1, 7);
    }

    #[test]
    fn a_constant_has_exactly_itself_as_mean() {
        for value in [1.0, 0.1, 123.456] {
            let panorama = Panorama::new(34, 17, vec![[value; 3]; 34 * 17]).unwrap();
            assert_eq!(panorama.mean(), [f64::from(value); 3]);
        }
    }

    #[test]
    fn luminance_follows_the_primaries() {
        for (got, wanted) in REC709_LUMINANCE.into_iter().zip(Primaries::REC709.luminance_weights()) {
            assert!((got - wanted).abs() < 1e-15, "{got}, wanted {wanted}");
        }
        let panorama = random(16, 3, None).with_primaries(Primaries::ACESCG);
        assert!((panorama.luminance([0.0, 1.0, 0.0]) - 0.6740817658).abs() < 1e-10);
        assert_eq!(panorama.with_texels(vec![[1.0; 3]; 128]).primaries(), Primaries::ACESCG);
    }

    #[test]
    fn the_peak_is_found() {
        let (column, row, y) = random(16, 3, Some((5, 6))).peak();
        assert_eq!((column, row), (5, 6));
        assert!((y - luminance([1e5, 0.9e5, 0.5e5])).abs() < 1e-2, "{y}");
    }
}
