//! PlayCanvas' environment atlas: panoramas of several sizes and widths of kernel in one picture of 512².
//!
//! A tile of N rows is a panorama of 2 N − 2 × N − 2 texels within a [`BORDER`], as [`equirect`] has it.
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

use std::str::FromStr;

use super::equirect;
use super::orientation::Orientation;
use super::panorama::Panorama;
use super::sphere_map::SphereMap;
use crate::error::{Error, Result};
use crate::format::Texture;
use crate::pack::{Number, TexelFormat};

/// Texels along an edge of the picture: the shader's seams are of this size alone.
pub const EDGE: usize = 512;
/// Rows of the largest tile.
pub const SIZE: usize = EDGE / 2;
/// Levels of the specular chain, the mirror included; the mirror has as many sizes.
pub const LEVELS: usize = 6;
/// Rows of the tile of irradiance.
pub const IRRADIANCE_SIZE: usize = 32;

/// Texels around the panorama of a tile.
pub const BORDER: usize = 1;
/// The world's direction in terms of the vector that finds a texel: PlayCanvas looks up (−x, y, z), in panoramas with +Z in the middle.
pub const ORIENTATION: &str = "-z,y,x";

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

/// Where a square of 2⁻ᵐ of the picture begins that ends where the picture ends.
fn start(m: usize) -> usize {
    EDGE - (EDGE >> m)
}

/// The tile of a level of the specular chain.
pub fn specular(level: usize) -> Tile {
    Tile { content: Content::Specular(level), column: 0, row: start(level), size: SIZE >> level }
}

/// The tile of a smaller mirror.
pub fn mirror(level: usize) -> Tile {
    Tile { content: Content::Mirror(level), column: start(level), row: start(level), size: SIZE >> level }
}

/// The tile of irradiance.
pub fn irradiance() -> Tile {
    Tile { content: Content::Irradiance, column: 128, row: 384, size: IRRADIANCE_SIZE }
}

/// Every tile: the specular chain, the smaller mirrors, the irradiance.
pub fn tiles() -> Vec<Tile> {
    (0..LEVELS).map(specular).chain((1..LEVELS).map(mirror)).chain([irradiance()]).collect()
}

/// Whether a texture is an atlas beyond doubt: of its size and its packing.
pub fn is(texture: &Texture) -> bool {
    is_picture(texture) && texture.format == TexelFormat::Rgbp
}

fn is_picture(texture: &Texture) -> bool {
    [texture.width, texture.height, texture.faces] == [EDGE, EDGE, 1] && texture.depth == 0
}

/// What the texels are of a texture that is said to be an atlas. PlayCanvas writes its codes without a word about them: four numbers of 8 bits
/// are RGBP.
pub fn format_of(texture: &Texture) -> TexelFormat {
    let codes = TexelFormat::Plain { channels: 4, number: Number::Unorm8 };
    if texture.format == codes { TexelFormat::Rgbp } else { texture.format }
}

/// The colours of a texture that is said to be an atlas.
///
/// **Errors**: a texture of another size, or of less than three channels.
pub fn colours(texture: &Texture) -> Result<Vec<[f32; 3]>> {
    let format = format_of(texture);
    let n = format.channels();
    let level = texture.levels.first().filter(|_| is_picture(texture) && n >= 3).ok_or_else(|| {
        Error::invalid(
            format!("{}, where PlayCanvas' atlas is one picture of {EDGE} × {EDGE} in colour", texture.text()),
            "give the whole atlas, or use another layout",
        )
    })?;
    Ok(format.unpack(EDGE, EDGE, level).chunks_exact(n).map(|t| [t[0], t[1], t[2]]).collect())
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

/// The panorama of the world that PlayCanvas shows of a mirror tile of that many rows, whoever baked it: [`ORIENTATION`] undone. A quarter turn
/// is half a column more than a number of columns, so that the panorama has two for each: nothing is blended.
///
/// **Errors**: see [`Panorama::new`].
pub(super) fn to_world(tile: &SphereMap) -> Result<Panorama> {
    let panorama = tile.to_panorama()?;
    let shape = [2 * panorama.width(), panorama.height()];
    let texels = equirect::averages(&panorama, shape, &Orientation::from_str(ORIENTATION)?.inverse())?;
    Panorama::new(shape[0], shape[1], texels)
}

#[cfg(test)]
mod tests {
    use super::super::sphere_map::SphereLayout;
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

    /// What a bake for PlayCanvas turned comes back as it was, and of no other colours.
    #[test]
    fn a_mirror_is_the_world_again() {
        let panorama = random(64, 3, Some((20, 9)));
        let tile = SphereMap::area_average(&panorama, SphereLayout::Atlas, 16, &ORIENTATION.parse().unwrap()).unwrap();
        let world = to_world(&tile).unwrap();
        assert_eq!([world.width(), world.height()], [60, 14]);
        for i in 0..60 * 14 {
            let direction = world.texel_box(i % 60, i / 60).middle();
            let lookup = ORIENTATION.parse::<Orientation>().unwrap().lookup(direction);
            let held = tile.texels[SphereLayout::Atlas.nearest(16, lookup)];
            for (found, wanted) in world.texels()[i].into_iter().zip(held) {
                // A sum of differences from the mean, in f64.
                assert!((found - wanted).abs() <= 1e-6 * wanted.abs().max(1e-3), "{direction}: {found}, {wanted}");
            }
        }
        for c in 0..3 {
            assert!((world.mean()[c] / panorama.mean()[c] - 1.0).abs() < 6e-8);
        }
    }
}
