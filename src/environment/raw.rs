//! What a file holds, before repairs: the texels of a panorama, of the six faces of a cube, of an octahedral map or of an atlas' mirror.

use std::path::PathBuf;

use super::cube::{Cube, FACES, solid_angles};
use super::from_cube::from_cube;
use super::layout::{InputLayout, Layout, layout_of, unfold};
use super::panorama::{Panorama, check_shape, row_solid_angle};
use super::repair::{InputReport, Negatives, NonFinite, Policy, repair};
use super::sphere_map::{SphereLayout, SphereMap};
use super::{atlas, octahedral};
use crate::colour::{Primaries, TargetColour};
use crate::error::{Error, Result};
use crate::format::{Image, Texture, memory};

/// Texels as they were read.
pub(super) struct Raw {
    layout: Layout,
    /// Width and height of the panorama, of the square, of the mirror with its border, or of a face.
    size: [usize; 2],
    texels: Vec<[f32; 3]>,
    /// Whether all three channels are one.
    grey: bool,
    stated: Option<Primaries>,
}

impl Raw {
    /// A built-in environment, which is Rec. 709.
    pub(super) fn of_panorama(panorama: &Panorama) -> Self {
        let size = [panorama.width(), panorama.height()];
        Self { layout: Layout::Panorama, size, texels: panorama.texels().to_vec(), grey: false, stated: None }
    }

    /// A picture: its colour, as [`Image::rgb`] finds it, or a single channel as grey; other channels are left out.
    pub(super) fn of_image(image: &Image, asked: InputLayout) -> Result<Self> {
        let Image { width, height, .. } = *image;
        let stride = image.channels.len();
        if width.checked_mul(height).and_then(|n| n.checked_mul(stride)) != Some(image.texels.len()) {
            return Err(Error::invalid(
                format!("picture of {width} × {height} × {stride} channels holds {} values", image.texels.len()),
                "decode the whole file",
            ));
        }
        let layout = layout_of(width, height, asked)?;
        if layout == Layout::Panorama {
            check_shape(width, height)?;
        }
        memory::check_room(12 * width as u128 * height as u128, &format!("a picture of {width} × {height} texels"))?;
        // One channel alone is grey, whatever its name.
        let channels = if stride == 1 { [0; 3] } else { image.colour_channels()? };
        let texels: Vec<[f32; 3]> =
            image.texels.chunks_exact(stride).map(|texel| channels.map(|channel| texel[channel])).collect();
        let (grey, stated) = (channels[0] == channels[2], image.primaries);
        if layout == Layout::Atlas {
            let mirror = atlas::specular(0);
            let texels = atlas::cut(&texels, &mirror)?;
            return Ok(Self { layout, size: SphereLayout::Atlas.shape(mirror.size).0, texels, grey, stated });
        }
        Ok(match unfold(&texels, width, layout) {
            Some(cube) => Self { layout, size: [cube.size; 2], texels: cube.texels, grey, stated },
            None => Self { layout, size: [width, height], texels, grey, stated },
        })
    }

    /// A texture: a cube, or a picture.
    pub(super) fn of_texture(texture: &Texture, asked: InputLayout) -> Result<Self> {
        let picture = |face: usize| {
            let channels = texture.channel_names();
            let texels = texture.face(0, face).unwrap_or_default();
            let primaries = Some(texture.primaries);
            Image { width: texture.width, height: texture.height, channels, texels, metadata: vec![], primaries }
        };
        if texture.depth > 0 {
            return Err(Error::unsupported(
                "a three-dimensional texture, where an environment is wanted",
                "give a cube texture or a picture",
            ));
        }
        if texture.faces != 6 {
            let asked = if asked == InputLayout::Auto && atlas::is(texture) { InputLayout::Atlas } else { asked };
            if asked != InputLayout::Atlas {
                return Self::of_image(&picture(0), asked);
            }
            let texels = atlas::colours(texture)?.into_flattened();
            let image = Image::new(texture.width, texture.height, &["R", "G", "B"], texels)?;
            return Self::of_image(&Image { primaries: Some(texture.primaries), ..image }, asked);
        }
        if !matches!(asked, InputLayout::Auto | InputLayout::Cube) {
            return Err(Error::usage(
                "a cube texture, where the layout says another",
                "use --input-layout auto or cube",
            ));
        }
        let mut faces = (0..6).map(|face| Self::of_face(&picture(face))).collect::<Result<Vec<_>>>()?;
        let texels = faces.iter_mut().flat_map(|face| std::mem::take(&mut face.texels)).collect();
        let size = [texture.width, texture.height];
        Ok(Self { layout: Layout::CubeTexture, size, texels, grey: faces[0].grey, stated: faces[0].stated })
    }

    /// Six pictures with the files that they are from, in the order of the faces.
    pub(super) fn of_faces(faces: &[(PathBuf, Image); 6]) -> Result<Self> {
        let (mut texels, mut grey) = (vec![], true);
        let (first_path, first) = &faces[0];
        for (path, image) in faces {
            let size = [image.width, image.height];
            if size[0] != size[1] {
                return Err(Error::invalid(
                    format!("a face of {} × {}, which is not square", size[0], size[1]),
                    "crop or resample it",
                )
                .in_file(path));
            }
            if size[0] != first.width {
                return Err(Error::invalid(
                    format!("a face of {}², where {} has {}²", size[0], first_path.display(), first.width),
                    "make all six faces of one size",
                )
                .in_file(path));
            }
            if image.primaries != first.primaries {
                return Err(Error::invalid(
                    format!("a face in other primaries than {}", first_path.display()),
                    "save all six faces with the same",
                )
                .in_file(path));
            }
            let face = Self::of_face(image).map_err(|e| e.in_file(path))?;
            grey &= face.grey;
            texels.extend(face.texels);
        }
        Ok(Self { layout: Layout::SixFiles, size: [first.width; 2], texels, grey, stated: first.primaries })
    }

    /// One square face: the colour of a picture whose shape is nothing to ask about.
    fn of_face(image: &Image) -> Result<Self> {
        let stride = image.channels.len();
        let channels = if stride == 1 { [0; 3] } else { image.colour_channels()? };
        let texels = image.texels.chunks_exact(stride).map(|texel| channels.map(|channel| texel[channel])).collect();
        let grey = channels[0] == channels[2];
        Ok(Self { layout: Layout::SixFiles, size: [image.width; 2], texels, grey, stated: image.primaries })
    }

    /// The panorama that is filtered: repaired, converted, anything else resampled by the exact overlaps of texels.
    pub(super) fn finish(mut self, policy: Policy) -> Result<(Panorama, InputReport)> {
        let [width, height] = self.size;
        let is_cube = !matches!(self.layout, Layout::Panorama | Layout::Octahedral | Layout::Atlas);
        // One solid angle for each texel of a face or of the square, or for each row of a panorama.
        let (angles, run): (Vec<f64>, usize) = match self.layout {
            Layout::Panorama => ((0..height).map(|row| row_solid_angle(width, height, row)).collect(), width),
            Layout::Octahedral => (octahedral::solid_angles(width), 1),
            Layout::Atlas => (SphereLayout::Atlas.solid_angles(height), 1),
            _ => (solid_angles(width), 1),
        };
        let place = |i: usize| {
            let (face, row) = if is_cube { (i / (width * width), i / width % width) } else { (0, i / width) };
            let of_face = if is_cube { format!(" of face {}", FACES[face]) } else { String::new() };
            format!("texel ({}, {row}){of_face}", i % width)
        };
        let report = repair(&mut self.texels, policy, self.stated, self.grey, (&angles, run), place)?;
        let report = InputReport { layout: self.layout, size: self.size, ..report };
        let panorama = match self.layout {
            Layout::Panorama => Panorama::new(width, height, self.texels)?,
            Layout::Octahedral => octahedral::to_panorama(&SphereMap {
                layout: SphereLayout::Octahedral,
                size: width,
                texels: self.texels,
            })?,
            Layout::Atlas => {
                atlas::to_world(&SphereMap { layout: SphereLayout::Atlas, size: height, texels: self.texels })?
            }
            _ => from_cube(&Cube { size: width, texels: self.texels })?,
        };
        Ok((panorama.with_primaries(report.primaries), report))
    }
}

impl Panorama {
    /// The panorama that a picture holds: its colour, as [`Image::rgb`] finds it, or a single channel as grey; other channels are
    /// left out. The primaries stay those of the picture.
    ///
    /// **Errors**: see [`Panorama::new`]; also when the channels are not there, or when a value is not finite and the
    /// policy is [`NonFinite::Error`].
    pub fn from_image(image: &Image, nonfinite: NonFinite, negatives: Negatives) -> Result<(Self, InputReport)> {
        let policy = Policy { nonfinite, negatives, to: TargetColour::Keep };
        Raw::of_image(image, InputLayout::Panorama)?.finish(policy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: usize, height: usize, channels: &[&str], texels: Vec<f32>) -> Image {
        let channels = channels.iter().map(|c| (*c).to_owned()).collect();
        Image { width, height, channels, texels, metadata: Vec::new(), primaries: None }
    }

    #[test]
    fn channels_are_found_by_name() {
        let texels = (0..32).map(|i| i as f32).collect::<Vec<_>>();
        let (panorama, _) = Panorama::from_image(
            &image(4, 2, &["A", "b", "G", "R"], texels.clone()),
            NonFinite::Error,
            Negatives::Keep,
        )
        .unwrap();
        assert_eq!(panorama.texels()[1], [7.0, 6.0, 5.0]);
        let (grey, _) =
            Panorama::from_image(&image(4, 2, &["Y"], texels[..8].to_vec()), NonFinite::Error, Negatives::Keep)
                .unwrap();
        assert_eq!(grey.texels()[3], [3.0; 3]);
        let error =
            Panorama::from_image(&image(4, 2, &["X", "Z"], texels[..16].to_vec()), NonFinite::Error, Negatives::Keep);
        assert!(error.unwrap_err().to_string().contains("channels X, Z"));
    }

    #[test]
    fn wrong_values_are_refused_or_counted() {
        let mut texels = vec![1.0; 24];
        texels[4] = f32::NAN;
        texels[9] = f32::NEG_INFINITY;
        texels[20] = -3.0;
        let image = image(4, 2, &["R", "G", "B"], texels);
        let error = Panorama::from_image(&image, NonFinite::Error, Negatives::Keep).unwrap_err().to_string();
        assert!(error.contains("2 values") && error.contains("green of texel (1, 0)"), "{error}");
        let (kept, report) = Panorama::from_image(&image, NonFinite::Zero, Negatives::Keep).unwrap();
        assert_eq!((report.nonfinite, report.negative, report.min), (2, 1, -3.0));
        assert_eq!((kept.texels()[1][1], kept.texels()[6][2]), (0.0, -3.0));
        let (clamped, _) = Panorama::from_image(&image, NonFinite::Zero, Negatives::Clamp).unwrap();
        assert_eq!(clamped.texels()[6][2], 0.0);
    }
}
