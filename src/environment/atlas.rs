//! PlayCanvas' environment atlas: panoramas of several sizes and widths of kernel in one picture of 512².
//!
//! A tile of N rows is a panorama of 2 N − 2 × N − 2 texels within a border of one texel, which repeats what lies beyond: the other end
//! of the row, and beyond a pole the other side of it. A sampler that blends four texels therefore never leaves its tile.
//!
//! ```text
//!   0         256        512    0   mirror, 512 × 256
//! 0 ┌────────────────────┐      1   roughness level 1, 256 × 128; below it levels 2 to 5, each half the size
//!   │          0         │      M   the mirror again at half the size; below and right of it again, down to 16 × 8
//! 256─────────┬──────────┤      E   irradiance over π, 64 × 32, at (128, 384)
//!   │    1    │    M     │
//! 384────┬─┬──┼────┬─────┤
//!   │ 2  │E│  │    │ M   │
//! 448──┬─┴─┘  │    ├──┬──┤
//!   │ 3│      │    │  │ M│
//!   └──┴──────┴────┴──┴──┘
//! ```
//!
//! **Source**: PlayCanvas, `env-lighting` (which tiles there are) and the shader chunks `envAtlas`, `reflectionEnv` and `ambient` (where they
//! are read). The engine's baker fills a sixth rough tile, which its shader gives no weight; here it stays empty, as does all the rest.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::equirect;
use super::orientation::Orientation;
use super::panorama::{Panorama, row_solid_angle};
use super::sphere_map::{SphereLayout, SphereMap};
use crate::error::{Error, Result};

/// Texels along an edge of the picture: the shader's seams are of this size alone.
pub const EDGE: usize = 512;
/// Rows of the largest tile.
pub const SIZE: usize = EDGE / 2;
/// Levels of the specular chain, the mirror included; the mirror has as many sizes.
pub const LEVELS: usize = 6;
/// Rows of the tile of irradiance.
pub const IRRADIANCE_SIZE: usize = 32;

/// What a tile holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// A level of the specular chain, 0 the mirror.
    Specular(usize),
    /// The mirror at 2⁻ⁿ of its size.
    Mirror(usize),
    /// Irradiance over π.
    Irradiance,
}

/// A tile of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tile {
    /// What it holds.
    pub content: Content,
    /// Its first column.
    pub column: usize,
    /// Its first row.
    pub row: usize,
    /// Its rows, border included; it has twice as many columns.
    pub size: usize,
}

impl Tile {
    /// What it is called in certificates.
    pub fn name(&self) -> String {
        match self.content {
            Content::Specular(level) => format!("specular {level}"),
            Content::Mirror(level) => format!("mirror {level}"),
            Content::Irradiance => "irradiance".to_owned(),
        }
    }
}

/// Every tile: the specular chain, the smaller mirrors, the irradiance.
pub fn tiles() -> Vec<Tile> {
    // Where a square of 2⁻ᵐ of the picture begins that ends where the picture ends.
    let start = |m: usize| EDGE - (EDGE >> m);
    let specular = |m: usize| Tile { content: Content::Specular(m), column: 0, row: start(m), size: SIZE >> m };
    let mirror = |m: usize| Tile { content: Content::Mirror(m), column: start(m), row: start(m), size: SIZE >> m };
    let irradiance = Tile { content: Content::Irradiance, column: 128, row: 384, size: IRRADIANCE_SIZE };
    (0..LEVELS).map(specular).chain((1..LEVELS).map(mirror)).chain([irradiance]).collect()
}

/// The picture of tiles in the order of [`tiles`], their texels as packed; what no tile covers is 0.
pub fn assemble(packed: &[Vec<u8>], texel_bytes: usize) -> Vec<u8> {
    let mut picture = vec![0; EDGE * EDGE * texel_bytes];
    for (tile, bytes) in tiles().iter().zip(packed) {
        for (line, row) in bytes.chunks_exact(2 * tile.size * texel_bytes).zip(tile.row..) {
            let start = (row * EDGE + tile.column) * texel_bytes;
            picture[start..start + line.len()].copy_from_slice(line);
        }
    }
    picture
}

/// The texels of a tile.
///
/// **Errors**: another number of texels than the picture has.
pub fn cut<T: Copy>(picture: &[T], tile: &Tile) -> Result<Vec<T>> {
    if picture.len() != EDGE * EDGE {
        return Err(Error::invalid(
            format!("an atlas of {} texels, where {EDGE} × {EDGE} are wanted", picture.len()),
            "give the whole picture, as it was baked",
        ));
    }
    let line = |row: usize| &picture[row * EDGE + tile.column..][..2 * tile.size];
    Ok((tile.row..tile.row + tile.size).flat_map(line).copied().collect())
}

/// Columns and rows of the panorama in a tile.
pub fn inner(size: usize) -> [usize; 2] {
    [(2 * size).saturating_sub(2), size.saturating_sub(2)]
}

/// Unit direction at a column and a row of a tile, counted from the centres of the first: the border's is that of what it repeats.
pub(super) fn direction_at(size: usize, [column, row]: [f64; 2]) -> DVec3 {
    let [width, height] = inner(size).map(|n| n as f64);
    let phi = TAU * (column - 0.5) / width - PI;
    let (sin, cos) = (PI * (row - 0.5) / height).sin_cos();
    DVec3::new(sin * phi.cos(), cos, sin * phi.sin())
}

/// Where a direction of any length lies: column and row, counted from the centres of the first.
pub(super) fn locate(size: usize, direction: DVec3) -> [f64; 2] {
    let [width, height] = inner(size).map(|n| n as f64);
    let u = 0.5 + direction.z.atan2(direction.x) / TAU;
    let v = direction.x.hypot(direction.z).atan2(direction.y) / PI;
    [u * width + 0.5, v * height + 0.5]
}

/// The texel at a column and a row; nothing is looked for beyond the border.
pub(super) fn texel(size: usize, column: isize, row: isize) -> usize {
    let n = size as isize;
    (row.clamp(0, n - 1) * 2 * n + column.clamp(0, 2 * n - 1)) as usize
}

/// Solid angle per texel at a row.
pub(super) fn density(size: usize, row: f64) -> f64 {
    let [width, height] = inner(size).map(|n| n as f64);
    TAU / width * PI / height * (PI * (row - 0.5) / height).sin().max(0.0)
}

/// The texel of the panorama that a texel of the tile holds, or repeats.
fn source(size: usize, index: usize) -> [usize; 2] {
    let [width, height] = inner(size).map(|n| n as isize);
    let (column, row) = ((index % (2 * size)) as isize - 1, (index / (2 * size)) as isize - 1);
    let beyond = if (0..height).contains(&row) { 0 } else { width / 2 };
    [(column + beyond).rem_euclid(width) as usize, row.clamp(0, height - 1) as usize]
}

/// Whether a texel of a tile only repeats another.
pub(super) fn is_border(size: usize, index: usize) -> bool {
    let (column, row) = (index % (2 * size), index / (2 * size));
    column == 0 || row == 0 || column == 2 * size - 1 || row == size - 1
}

/// Solid angles of the texels, row by row: those of the border count for nothing.
pub fn solid_angles(size: usize) -> Vec<f64> {
    let [width, height] = inner(size);
    let texels = 0..2 * size * size;
    texels.map(|i| if is_border(size, i) { 0.0 } else { row_solid_angle(width, height, i / (2 * size) - 1) }).collect()
}

/// A panorama averaged over the exact solid angle of each texel, turned; the border repeats.
///
/// **Errors**: see [`equirect::check_orientation`].
pub fn area_average(panorama: &Panorama, size: usize, orientation: &Orientation) -> Result<SphereMap> {
    let [width, height] = inner(size);
    let texels = equirect::averages(panorama, [width, height], orientation)?;
    let texel = |i: usize| {
        let [column, row] = source(size, i);
        texels[row * width + column]
    };
    Ok(SphereMap { layout: SphereLayout::Atlas, size, texels: (0..2 * size * size).map(texel).collect() })
}

/// The panorama in a tile.
///
/// **Errors**: see [`Panorama::new`].
pub fn to_panorama(map: &SphereMap) -> Result<Panorama> {
    let [width, height] = inner(map.size);
    let inside = map.texels.iter().enumerate().filter(|(i, _)| !is_border(map.size, *i));
    Panorama::new(width, height, inside.map(|(_, texel)| *texel).collect())
}

#[cfg(test)]
mod tests {
    use super::super::test_maps::random;
    use super::*;

    #[test]
    fn tiles_lie_within_the_picture_and_apart() {
        let mut taken = vec![false; EDGE * EDGE];
        for tile in tiles() {
            for (x, y) in (0..tile.size).flat_map(|y| (0..2 * tile.size).map(move |x| (x, y))) {
                let at = (tile.row + y) * EDGE + tile.column + x;
                assert!(tile.column + x < EDGE && !std::mem::replace(&mut taken[at], true), "{tile:?} at {x}, {y}");
            }
        }
        assert_eq!(tiles().len(), 12);
    }

    #[test]
    fn what_is_assembled_is_cut_again() {
        let packed: Vec<Vec<u8>> = (tiles().iter().enumerate())
            .map(|(t, tile)| (0..2 * tile.size * tile.size).map(|i| (i * 7 + t) as u8).collect())
            .collect();
        let picture = assemble(&packed, 1);
        for (tile, bytes) in tiles().iter().zip(&packed) {
            assert_eq!(cut(&picture, tile).unwrap(), *bytes, "{tile:?}");
        }
        assert!(cut(&picture[1..], &tiles()[0]).is_err());
    }

    /// The border is what the panorama has there, so that a blend of four texels is that of a panorama without end.
    #[test]
    fn the_border_repeats_what_lies_in_its_directions() {
        for size in [4, 8, 33] {
            let [width, height] = inner(size);
            for i in 0..2 * size * size {
                let at = [i % (2 * size), i / (2 * size)].map(|k| k as f64);
                let [column, row] = source(size, i).map(|k| k as f64 + 1.0);
                let (here, there) = (direction_at(size, at), direction_at(size, [column, row]));
                assert!(
                    (here - there).length() < 1e-14,
                    "{size}: {at:?} repeats {column}, {row} of {width} × {height}"
                );
            }
        }
        let map = area_average(&random(64, 3, Some((20, 9))), 16, &"-z,y,x".parse().unwrap()).unwrap();
        for i in 0..60 {
            let y = 0.97 * (2.0 * f64::from(i) / 59.0 - 1.0);
            let across = (1.0 - y * y).sqrt();
            let [a, b] = [1e-9, -1e-9].map(|z| map.filtered(DVec3::new(-across, y, z))[0]);
            assert!((a / b - 1.0).abs() < 1e-5, "height {y}: {a}, {b} on the other side of the seam");
            let (sin, cos) = (f64::from(i) * 0.1).sin_cos();
            let [a, b] = [1e-9, -1e-9].map(|s| map.filtered(DVec3::new(s * cos, 1.0, s * sin))[0]);
            assert!((a / b - 1.0).abs() < 1e-5, "azimuth {i}: {a}, {b} on the other side of the pole");
        }
    }

    #[test]
    fn flux_is_conserved_and_comes_back() {
        let panorama = random(64, 5, Some((40, 12)));
        for size in [8, 32] {
            let map = area_average(&panorama, size, &"-z,y,x".parse().unwrap()).unwrap();
            let back = to_panorama(&map).unwrap();
            for c in 0..3 {
                let wanted = panorama.mean()[c];
                assert!((map.mean()[c] / wanted - 1.0).abs() < 6e-8 && (back.mean()[c] / wanted - 1.0).abs() < 6e-8);
            }
        }
        let total: f64 = solid_angles(8).iter().sum();
        assert!((total / (4.0 * PI) - 1.0).abs() < 1e-14, "{total}");
    }
}
