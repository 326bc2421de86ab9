//! The maps in a file that may be a chain.

use crate::environment::{SphereLayout, SphereMap, atlas};
use crate::error::{Error, Result};
use crate::format::{Decoded, Texture};

/// The levels of a file: a cube's; else a square's, which is an octahedral map; a panorama's that is twice as wide as high; or the chain in an
/// atlas of PlayCanvas.
///
/// **Errors**: a file of anything else.
pub fn levels_of(content: &Decoded) -> Result<Vec<SphereMap>> {
    let refused = |what: String| {
        Err(Error::unsupported(
            format!("{what}, which is no cube map, square or panorama of 2:1"),
            "give a cube texture (.ktx2, .ktx, .dds, .env), or an octahedral map or a panorama with its mips",
        ))
    };
    let texture = match content {
        Decoded::Texture(texture) if is_cube(texture) => return maps(texture, SphereLayout::Cube),
        Decoded::Texture(texture) if texture.faces == 1 && texture.array_layers <= 1 && texture.depth == 0 => texture,
        Decoded::Texture(texture) => return refused(texture.text()),
        Decoded::Picture(image, _) => {
            let layout = match (image.width, image.height) {
                (width, height) if width == height => SphereLayout::Octahedral,
                (width, height) if width == 2 * height => SphereLayout::Equirect,
                (width, height) => return refused(format!("a picture of {width} × {height}")),
            };
            return Ok(vec![SphereMap { layout, size: image.height, texels: image.rgb()? }]);
        }
        Decoded::Array(_) => return refused("an array of numbers".to_owned()),
    };
    match (texture.width, texture.height) {
        _ if atlas::is(texture) => in_atlas(texture),
        (width, height) if width == height => maps(texture, SphereLayout::Octahedral),
        (width, height) if width == 2 * height => maps(texture, SphereLayout::Equirect),
        _ => refused(texture.text()),
    }
}

/// The specular chain in an atlas.
fn in_atlas(texture: &Texture) -> Result<Vec<SphereMap>> {
    let picture = atlas::colours(texture)?;
    let level = |tile: atlas::Tile| {
        Ok(SphereMap { layout: SphereLayout::Atlas, size: tile.size, texels: atlas::cut(&picture, &tile)? })
    };
    (0..atlas::LEVELS).map(atlas::specular).map(level).collect()
}

/// Whether a texture is a single cube map of colours.
pub fn is_cube(texture: &Texture) -> bool {
    texture.faces == 6 && texture.array_layers <= 1 && texture.width == texture.height
}

fn maps(texture: &Texture, layout: SphereLayout) -> Result<Vec<SphereMap>> {
    let n = texture.format.channels();
    let level = |m: usize| {
        let [_, size] = texture.level_size(m);
        let values = (0..texture.faces).flat_map(|face| texture.face(m, face).unwrap_or_default());
        // One channel is grey, two are grey and alpha.
        let colour = |t: &[f32]| if n < 3 { [t[0]; 3] } else { [t[0], t[1], t[2]] };
        let texels: Vec<[f32; 3]> = values.collect::<Vec<f32>>().chunks_exact(n).map(colour).collect();
        if texels.len() != layout.texels(size) {
            return Err(Error::invalid(
                format!("level {m} is not {} of {}", layout.article(), layout.size_text(size)),
                "write the file again",
            ));
        }
        Ok(SphereMap { layout, size, texels })
    };
    // Of a panorama the level of one row is not twice as wide as high, and says no more than a colour.
    let is_whole = |m: &usize| layout.shape(texture.level_size(*m)[1]).0 == texture.level_size(*m);
    (0..texture.levels.len()).take_while(is_whole).map(level).collect()
}
