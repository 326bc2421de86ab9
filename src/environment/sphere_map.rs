//! Maps of the sphere in any layout: which texel looks where, how large it is, and what a sampler blends.
//!
//! This is the one place that knows layouts ([`cube`](super::cube), [`octahedral`], [`equirect`], [`atlas`] each know their own formulas): chains,
//! checks, verification and conversion ask here.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::cube::{self, Cube, FACES};
use super::orientation::Orientation;
use super::panorama::Panorama;
use super::seamless::Taps;
use super::{area_average, atlas, equirect, octahedral};
use crate::error::{Error, Result};

/// How the sphere lies in a texture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SphereLayout {
    /// Six faces, N × N each.
    #[default]
    Cube,
    /// One square, N × N: see [`octahedral`].
    Octahedral,
    /// A panorama, 2 N × N: see [`equirect`].
    Equirect,
    /// Tiles of PlayCanvas' atlas, each a panorama within a border, 2 N × N together: see [`atlas`].
    Atlas,
}

impl SphereLayout {
    /// Every layout.
    pub const ALL: [Self; 4] = [Self::Cube, Self::Octahedral, Self::Equirect, Self::Atlas];

    /// The word that recipes use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cube => "cube",
            Self::Octahedral => "octahedral",
            Self::Equirect => "equirect",
            Self::Atlas => "atlas",
        }
    }

    /// What a map of this layout is called.
    pub fn noun(self) -> &'static str {
        match self {
            Self::Cube => "cube",
            Self::Octahedral => "octahedral map",
            Self::Equirect => "panorama",
            Self::Atlas => "atlas",
        }
    }

    /// The same with its article.
    pub fn article(self) -> &'static str {
        match self {
            Self::Cube => "a cube",
            Self::Octahedral => "an octahedral map",
            Self::Equirect => "a panorama",
            Self::Atlas => "an atlas",
        }
    }

    /// Whether it is the usual one.
    pub fn is_cube(&self) -> bool {
        *self == Self::Cube
    }

    /// The word for several.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Cube => "cubes",
            Self::Octahedral => "octahedral maps",
            Self::Equirect => "panoramas",
            Self::Atlas => "atlases",
        }
    }

    /// Texels around a map that only repeat others of it.
    fn border(self) -> usize {
        if self == Self::Atlas { atlas::BORDER } else { 0 }
    }

    /// Width and height of a picture, and how many there are.
    pub fn shape(self, size: usize) -> ([usize; 2], usize) {
        match self {
            Self::Cube => ([size, size], 6),
            Self::Octahedral => ([size, size], 1),
            Self::Equirect | Self::Atlas => ([2 * size, size], 1),
        }
    }

    /// Texels of a map.
    pub fn texels(self, size: usize) -> usize {
        let ([width, height], pictures) = self.shape(size);
        width * height * pictures
    }

    /// The size in words: `256²`, `512 × 256`.
    pub fn size_text(self, size: usize) -> String {
        match self {
            Self::Cube | Self::Octahedral => format!("{size}²"),
            Self::Equirect | Self::Atlas => format!("{} × {size}", 2 * size),
        }
    }

    /// Unit direction of the centre of a texel, counted picture by picture and row by row.
    pub fn direction(self, size: usize, index: usize) -> DVec3 {
        let centre = |i: usize| cube::centre(size, i);
        match self {
            Self::Cube => cube::texel_direction(size, index),
            Self::Octahedral => octahedral::point(centre(index % size), centre(index / size)).normalize(),
            Self::Equirect | Self::Atlas => {
                self.direction_at(size, [index % (2 * size), index / (2 * size)].map(|i| i as f64))
            }
        }
    }

    /// The texel that a direction of any length meets.
    pub fn nearest(self, size: usize, direction: DVec3) -> usize {
        if self == Self::Cube {
            return cube::nearest_texel(size, direction);
        }
        let [column, row] = self.locate(size, direction).map(|t| (t + 0.5).floor() as isize);
        // The far border of the last texel belongs to it.
        let ([width, height], _) = self.shape(size);
        row.clamp(0, height as isize - 1) as usize * width + column.clamp(0, width as isize - 1) as usize
    }

    /// Solid angles of the texels.
    pub fn solid_angles(self, size: usize) -> Vec<f64> {
        match self {
            Self::Cube => cube::solid_angles(size).repeat(6),
            Self::Octahedral => octahedral::solid_angles(size),
            Self::Equirect | Self::Atlas => equirect::solid_angles(size, self.border()),
        }
    }

    /// What a sampler blends in a direction: across the borders of a cube and of an octahedral map as if there were none; a panorama
    /// goes on around the world and ends at the poles.
    pub fn taps(self, size: usize, direction: DVec3) -> Taps {
        if self == Self::Cube {
            return Taps::towards(size, direction);
        }
        self.taps_at(size, self.locate(size, direction))
    }

    /// The same at a column and a row, counted from the centres of the first. Not of cubes.
    pub(super) fn taps_at(self, size: usize, [x, y]: [f64; 2]) -> Taps {
        let (column, row) = (x.floor(), y.floor());
        let (s, t) = (x - column, y - row);
        let texels =
            [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[i, j]| self.texel(size, column as isize + i, row as isize + j));
        Taps { texels, weights: [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t] }
    }

    /// The texel at a column and a row that may be one beyond the border. Not of cubes.
    pub(super) fn texel(self, size: usize, column: isize, row: isize) -> usize {
        match self {
            Self::Equirect | Self::Atlas => equirect::texel(size, column, row),
            _ => octahedral::texel(size, column, row),
        }
    }

    /// Column and row of a direction, counted from the centres of the first. Not of cubes.
    fn locate(self, size: usize, direction: DVec3) -> [f64; 2] {
        match self {
            Self::Equirect | Self::Atlas => equirect::locate(size, self.border(), direction),
            _ => octahedral::locate(direction).map(|t| (t + 1.0) / 2.0 * size as f64 - 0.5),
        }
    }

    /// The unit direction at a column and a row, counted from the centres of the first. Not of cubes.
    pub(super) fn direction_at(self, size: usize, at: [f64; 2]) -> DVec3 {
        match self {
            Self::Equirect | Self::Atlas => equirect::direction_at(size, self.border(), at),
            _ => {
                let [u, v] = at.map(|t| ((2.0 * t + 1.0 - size as f64) / size as f64).clamp(-1.0, 1.0));
                octahedral::point(u, v).normalize()
            }
        }
    }

    /// Solid angle per texel at such a place. Not of cubes.
    pub(super) fn density(self, size: usize, [x, y]: [f64; 2]) -> f64 {
        match self {
            Self::Equirect | Self::Atlas => equirect::density(size, self.border(), y),
            _ => {
                let [u, v] = [x, y].map(|t| (2.0 * t + 1.0 - size as f64) / size as f64);
                (2.0 / size as f64).powi(2) / octahedral::point(u, v).length().powi(3)
            }
        }
    }

    /// Where a texel is, for a report: `face +X, texel 3, 4`.
    pub fn place(self, size: usize, texel: usize) -> String {
        let ([width, height], pictures) = self.shape(size);
        let (picture, rest) = (texel / (width * height), texel % (width * height));
        let face = if pictures == 6 { format!("face {}, ", FACES[picture]) } else { String::new() };
        format!("{face}texel {}, {}", rest % width, rest / width)
    }

    /// Whether maps of this layout can be turned so.
    ///
    /// **Errors**: a panorama with its poles elsewhere.
    pub fn check_orientation(self, orientation: &Orientation) -> Result<()> {
        if matches!(self, Self::Equirect | Self::Atlas) { equirect::check_orientation(orientation) } else { Ok(()) }
    }
}

impl fmt::Display for SphereLayout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for SphereLayout {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL
            .into_iter()
            .find(|layout| layout.name() == name)
            .ok_or_else(|| Error::usage(format!("unknown layout `{name}`"), "use cube, octahedral, equirect or atlas"))
    }
}

/// A map of linear RGB radiance over the sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct SphereMap {
    /// How the sphere lies in it.
    pub layout: SphereLayout,
    /// Texels along an edge, or rows of a panorama.
    pub size: usize,
    /// Picture by picture, each row by row.
    pub texels: Vec<[f32; 3]>,
}

impl From<Cube> for SphereMap {
    fn from(Cube { size, texels }: Cube) -> Self {
        Self { layout: SphereLayout::Cube, size, texels }
    }
}

impl SphereMap {
    /// The panorama averaged over the exact solid angle of each texel, turned.
    ///
    /// **Errors**: see [`SphereLayout::check_orientation`].
    pub fn area_average(
        panorama: &Panorama,
        layout: SphereLayout,
        size: usize,
        orientation: &Orientation,
    ) -> Result<Self> {
        match layout {
            SphereLayout::Cube => Ok(orientation.apply(area_average(panorama, size)).into()),
            SphereLayout::Octahedral => Ok(octahedral::area_average(panorama, size, orientation)),
            SphereLayout::Equirect | SphereLayout::Atlas => {
                let texels = equirect::area_average(panorama, size, layout.border(), orientation)?;
                Ok(Self { layout, size, texels })
            }
        }
    }

    /// The panorama of which this is a picture: the texels of one as they are, others averaged over its texels.
    ///
    /// **Errors**: a map that is none; values that are not finite; a panorama that the memory does not hold.
    pub fn to_panorama(&self) -> Result<Panorama> {
        match self.layout {
            SphereLayout::Cube => super::from_cube(&Cube { size: self.size, texels: self.texels.clone() }),
            SphereLayout::Octahedral => octahedral::to_panorama(self),
            SphereLayout::Equirect | SphereLayout::Atlas => equirect::to_panorama(self, self.layout.border()),
        }
    }

    /// Unit direction of the centre of a texel.
    pub fn direction(&self, texel: usize) -> DVec3 {
        self.layout.direction(self.size, texel)
    }

    /// What a shader sees in a direction: bilinear filtering.
    pub fn filtered(&self, direction: DVec3) -> [f64; 3] {
        self.layout.taps(self.size, direction).blend(&self.texels)
    }

    /// Mean over the sphere of the texels as they are, weighted by their exact solid angles.
    pub fn mean(&self) -> [f64; 3] {
        let weights = self.layout.solid_angles(self.size);
        let mut sum = [0.0; 3];
        for (texel, weight) in self.texels.iter().zip(&weights) {
            (0..3).for_each(|c| sum[c] += f64::from(texel[c]) * weight);
        }
        let total = weights.iter().sum::<f64>();
        sum.map(|s| s / total)
    }

    /// The map of which every texel is a function of the world's unit direction at its centre, turned; `finished` is told how many texels
    /// have been finished since its last call.
    pub(super) fn gather(
        layout: SphereLayout,
        size: usize,
        orientation: &Orientation,
        values: impl Fn(&[DVec3]) -> Vec<[f64; 3]>,
        finished: &(dyn Fn(u64) + Sync),
    ) -> Self {
        /// Directions at a time: enough for every thread, few against the texels of a large map.
        const TOGETHER: usize = 1 << 16;
        let n = layout.texels(size);
        let mut texels = Vec::with_capacity(n);
        for start in (0..n).step_by(TOGETHER) {
            let directions: Vec<DVec3> = (start..(start + TOGETHER).min(n))
                .into_par_iter()
                .map(|i| orientation.world(layout.direction(size, i)))
                .collect();
            texels.extend(values(&directions).into_iter().map(|value| value.map(|v| v as f32)));
            finished(directions.len() as u64);
        }
        Self { layout, size, texels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_texel_is_nearest_in_its_own_direction_and_seen_there() {
        for layout in SphereLayout::ALL {
            // A tile of an atlas has a border of one texel.
            let border = layout.border();
            for size in if border > 0 { [3, 4, 5, 16] } else { [1, 2, 5, 16] } {
                for i in 0..layout.texels(size) {
                    let direction = layout.direction(size, i);
                    if border > 0 && equirect::is_border(size, border, i) {
                        // It repeats another, which is found instead.
                        let own = layout.direction(size, layout.nearest(size, direction));
                        assert!((own - direction).length() < 1e-14, "{size}, {i}");
                        continue;
                    }
                    assert_eq!(layout.nearest(size, 2.5 * direction), i, "{layout} {size}");
                    let taps = layout.taps(size, direction);
                    let own: f64 =
                        taps.texels.iter().zip(taps.weights).filter(|(texel, _)| **texel == i).map(|(_, w)| w).sum();
                    assert!((own - 1.0).abs() < 1e-12 * size as f64, "{layout} {size}, {i}: {taps:?}");
                }
            }
        }
    }

    #[test]
    fn weights_are_none_below_zero_and_sum_to_one_everywhere() {
        for layout in SphereLayout::ALL {
            let mut state = 1_u32;
            for _ in 0..2000 {
                let mut next = || {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    f64::from(state >> 8) / f64::from(1 << 23) - 1.0
                };
                let direction = DVec3::new(next(), next(), next());
                let Taps { texels, weights } = layout.taps(8, direction);
                assert!(texels.iter().all(|&t| t < layout.texels(8)));
                assert!(weights.iter().all(|&w| w >= -1e-12) && (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    /// What is seen on either side of the fold is the same: the octahedral map has no seam.
    #[test]
    fn an_octahedral_map_is_continuous_across_its_border() {
        let size = 6;
        let texels = (0..size * size).map(|i| [(i * 37 % 11) as f32, 0.0, 0.0]).collect();
        let map = SphereMap { layout: SphereLayout::Octahedral, size, texels };
        for i in 0..200 {
            // The border is the four half planes where x or y is 0 and z < 0.
            let (sin, cos) = (std::f64::consts::FRAC_PI_2 * (f64::from(i) + 0.5) / 200.0).sin_cos();
            for across in [DVec3::new(1e-9, sin, -cos), DVec3::new(sin, 1e-9, -cos)] {
                let other = DVec3::new(
                    if across.x == 1e-9 { -1e-9 } else { across.x },
                    if across.y == 1e-9 { -1e-9 } else { across.y },
                    across.z,
                );
                let [a, b] = [across, other].map(|d| map.filtered(d)[0]);
                assert!((a - b).abs() < 1e-6, "{across}: {a}, {b}");
            }
        }
    }
}
