//! Pictures for people: previews of tables, panoramas and cubes as 8-bit PNG.
//!
//! A preview is to look at, never to compute with: radiance is tone-mapped, and only a preview is.

use crate::error::{Error, Result};
use crate::format::{Image, Texture};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

/// An 8-bit RGB picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Preview {
    /// Texels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Rows of RGB.
    pub texels: Vec<[u8; 3]>,
}

/// The smallest side that a table is shown at; smaller ones are enlarged by whole factors, texels kept sharp.
const TABLE_SIDE: usize = 256;
/// Texels between the parts of a preview.
const GAP: usize = 4;
/// Parts that fit beside one another.
const FEW: usize = 4;
/// What lies between the parts.
const BACKGROUND: [u8; 3] = [40, 40, 40];

impl Preview {
    fn blank(width: usize, height: usize) -> Self {
        Self { width, height, texels: vec![BACKGROUND; width * height] }
    }

    fn put(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        self.texels[y * self.width + x] = colour;
    }

    /// The PNG file.
    ///
    /// **Errors**: a picture that PNG cannot hold.
    pub fn png(&self) -> Result<Vec<u8>> {
        let mut bytes = vec![];
        let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        PngEncoder::new(&mut bytes)
            .write_image(self.texels.as_flattened(), size(self.width), size(self.height), ExtendedColorType::Rgb8)
            .map_err(|e| Error::unsupported(format!("a preview that PNG cannot hold: {e}"), "show a smaller file"))?;
        Ok(bytes)
    }
}

/// A table: its channels side by side, its slices below one another, 0 black and 1 white without any curve, row 0 at the top.
///
/// Where that makes a tower, or a single row of many channels, several stand side by side.
pub fn table(width: usize, height: usize, channels: usize, slices: &[Vec<f32>]) -> Preview {
    let n = slices.len() * channels;
    let columns = if n <= FEW { n } else { ((n as f64).sqrt().ceil() as usize).next_multiple_of(channels.min(FEW)) };
    let rows = n.div_ceil(columns);
    let scale = ((if rows > 1 { TABLE_SIDE / 2 } else { TABLE_SIDE }) / width.max(height)).max(1);
    let strip = if height == 1 { 32 } else { height * scale }; // one row alone is too thin to see
    let mut preview = Preview::blank(columns * (width * scale + GAP) - GAP, rows * (strip + GAP) - GAP);
    for tile in 0..n {
        let (slice, channel) = (&slices[tile / channels], tile % channels);
        let (left, top) = (tile % columns * (width * scale + GAP), tile / columns * (strip + GAP));
        for y in 0..strip {
            for x in 0..width * scale {
                let row = if height == 1 { 0 } else { y / scale };
                let value = slice[(row * width + x / scale) * channels + channel];
                let grey = (255.0 * value.clamp(0.0, 1.0)).round() as u8; // NaN casts to 0
                preview.put(left + x, top + y, [grey; 3]);
            }
        }
    }
    preview
}

/// Radiance for the eye: exposed, compressed by x/(1 + x), and encoded as sRGB.
///
/// `exposure` multiplies; [`exposure_for`] finds one that shows a middle grey.
pub fn tone_map(radiance: [f32; 3], exposure: f32) -> [u8; 3] {
    radiance.map(|v| {
        let x = (v * exposure).max(0.0); // negative light is black
        let compressed = if x.is_infinite() { 1.0 } else { x / (1.0 + x) };
        let encoded =
            if compressed <= 0.003_130_8 { 12.92 * compressed } else { 1.055 * compressed.powf(1.0 / 2.4) - 0.055 };
        (255.0 * encoded).round() as u8
    })
}

/// The exposure that turns the geometric mean of the luminance into a middle grey, then `ev` stops more.
pub fn exposure_for<'a>(texels: impl Iterator<Item = &'a [f32; 3]>, ev: f32) -> f32 {
    const MIDDLE_GREY: f64 = 0.25; // 0.2 after x/(1 + x)
    let (mut sum, mut n) = (0.0, 0.0);
    for texel in texels {
        let luminance = crate::environment::luminance(texel.map(f64::from));
        if luminance > 0.0 && luminance.is_finite() {
            (sum, n) = (sum + luminance.ln(), n + 1.0);
        }
    }
    let key = if n > 0.0 { f64::exp(sum / n) } else { 1.0 };
    (MIDDLE_GREY / key) as f32 * ev.exp2()
}

/// A panorama.
///
/// **Errors**: a picture without colour.
pub fn panorama(image: &Image, ev: f32) -> Result<Preview> {
    let texels = image.rgb()?;
    let exposure = exposure_for(texels.iter(), ev);
    let texels = texels.into_iter().map(|t| tone_map(t, exposure)).collect();
    Ok(Preview { width: image.width, height: image.height, texels })
}

/// A cube and its mips: a row of faces +X −X +Y −Y +Z −Z for each level, all at one exposure.
///
/// **Errors**: a texture that is not a cube of colours.
pub fn cube(texture: &Texture, ev: f32) -> Result<Preview> {
    if texture.faces != 6 || texture.format.channels() < 3 {
        return Err(Error::unsupported(
            format!(
                "a texture of {} faces and {} channels is no cube of colours",
                texture.faces,
                texture.format.channels()
            ),
            "show a cube map in rgba16f or rgba32f",
        ));
    }
    let face = |level: usize, face: usize| -> Vec<[f32; 3]> {
        let values = texture.face(level, face).unwrap_or_default();
        values.chunks_exact(texture.format.channels()).map(|t| [t[0], t[1], t[2]]).collect()
    };
    let first: Vec<[f32; 3]> = (0..6).flat_map(|f| face(0, f)).collect();
    let exposure = exposure_for(first.iter(), ev);
    // Small levels are enlarged, so that a mip of 16² is more than a stamp.
    let shown = |level: usize| {
        let size = texture.level_size(level)[0];
        (size, (texture.width.min(128) / size).max(1))
    };
    let rows: Vec<(usize, usize)> = (0..texture.levels.len()).map(shown).collect();
    let height = rows.iter().map(|(size, scale)| size * scale + GAP).sum::<usize>() - GAP;
    let mut preview = Preview::blank(6 * (texture.width + GAP) - GAP, height);
    let mut top = 0;
    for (level, &(size, scale)) in rows.iter().enumerate() {
        let side = size * scale;
        for f in 0..6 {
            let texels = face(level, f);
            for y in 0..side {
                for x in 0..side {
                    let colour = tone_map(texels[y / scale * size + x / scale], exposure);
                    preview.put(f * (side + GAP) + x, top + y, colour);
                }
            }
        }
        top += side + GAP;
    }
    Ok(preview)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tone_mapping_keeps_order_and_ends() {
        assert_eq!(tone_map([0.0, -1.0, f32::INFINITY], 1.0), [0, 0, 255]);
        let greys: Vec<u8> = (0..100).map(|i| tone_map([i as f32 * 0.1; 3], 1.0)[0]).collect();
        assert!(greys.is_sorted());
    }

    #[test]
    fn a_table_is_shown_with_its_values_as_greys() {
        let preview = table(2, 2, 1, &[vec![0.0, 1.0, 0.5, f32::NAN]]);
        assert_eq!((preview.width, preview.height), (256, 256));
        let at = |x: usize, y: usize| preview.texels[y * 256 + x][0];
        assert_eq!([at(0, 0), at(255, 0), at(0, 255), at(255, 255)], [0, 255, 128, 0]);
    }

    #[test]
    fn slices_of_a_volume_are_tiles() {
        let slices: Vec<Vec<f32>> = (0..16).map(|z| vec![z as f32 / 15.0, 1.0]).collect();
        let preview = table(1, 1, 2, &slices);
        let side = preview.width.div_ceil(6);
        let at = |column: usize, row: usize| preview.texels[(row * (32 + GAP)) * preview.width + column * side][0];
        assert_eq!([at(0, 0), at(1, 0), at(2, 0), at(0, 1)], [0, 255, 17, 51]);
    }
}
