//! Where a panorama comes from: a file, six files, or a built-in environment.

use std::path::{Path, PathBuf};

use super::atlas;
use super::builtin::{DEFAULT_WIDTH, builtin};
use super::face_files::{self, PLACEHOLDER};
use super::layout::InputLayout;
use super::panorama::Panorama;
use super::raw::Raw;
use super::repair::{InputReport, Negatives, NonFinite, Policy};
use crate::colour::TargetColour;
use crate::error::{Error, Result};
use crate::format::{Decoded, FileKind, Image, Texture, decode, read_image};

/// What a built-in environment's name begins with.
pub const BUILTIN_PREFIX: &str = "builtin:";

/// How an input is read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Reading {
    /// What it is read as.
    pub layout: InputLayout,
    /// What becomes of NaN and infinities.
    pub nonfinite: NonFinite,
    /// What becomes of values below zero.
    pub negatives: Negatives,
    /// Which primaries it is brought to.
    pub to: TargetColour,
}

/// The panorama that `input` names: `builtin:NAME`; the path of an `.hdr`, an `.exr`, or of a texture (`.ktx2`, `.ktx`, `.dds`, `.env`); six files as one of them
/// (`sky_px.hdr`), as a pattern (`sky_%s.hdr`) or as their folder. A cube becomes a panorama as [`mod@super::from_cube`] says. Of an [`atlas`] of PlayCanvas it
/// is the world that the engine shows.
///
/// **Errors**: a file that cannot be read, is no environment, is not of the layout asked for, or holds values that the policies
/// refuse; a cube with faces missing or unequal.
pub fn load(input: &str, reading: &Reading) -> Result<(Panorama, InputReport)> {
    let policy = Policy { nonfinite: reading.nonfinite, negatives: reading.negatives, to: reading.to };
    if let Some(name) = input.strip_prefix(BUILTIN_PREFIX) {
        return Raw::of_panorama(&builtin(name, DEFAULT_WIDTH)?).finish(policy);
    }
    let path = Path::new(input);
    let raw = if path.is_dir() {
        read_faces(face_files::in_folder(path)?, reading.layout)
    } else if input.contains(PLACEHOLDER) && !path.exists() {
        read_faces(face_files::of_pattern(input)?, reading.layout)
    } else {
        read_one(path, reading.layout)
    };
    raw?.finish(policy).map_err(|e| e.in_file(path))
}

fn read_one(path: &Path, asked: InputLayout) -> Result<Raw> {
    let bytes = std::fs::read(path).map_err(|e| Error::reading(path, e))?;
    let in_file = |e: Error| e.in_file(path);
    let kind = FileKind::of(&bytes);
    let decoded = decode(&bytes).map_err(in_file)?;
    drop(bytes);
    let image = match decoded {
        Decoded::Picture(image, _) => image,
        Decoded::Texture(texture) => {
            check_is_light(kind, &texture, asked).map_err(in_file)?;
            return Raw::of_texture(&texture, asked).map_err(in_file);
        }
        Decoded::Array(_) => {
            let problem = format!("{}, where an environment is wanted", kind.text());
            return Err(in_file(Error::unsupported(problem, "give a picture or a cube, such as .exr, .hdr or .ktx2")));
        }
    };
    let is_face = image.width == image.height && face_files::is_face(path);
    if asked == InputLayout::Cube && face_files::is_face(path) || asked == InputLayout::Auto && is_face {
        return read_faces(face_files::beside(path)?, asked);
    }
    Raw::of_image(&image, asked).map_err(in_file)
}

/// Numbers of 8 or 16 bits are light only where it is said that their curve is none; a PNG's is anything, unless they are the codes of an
/// atlas.
fn check_is_light(kind: FileKind, texture: &Texture, asked: InputLayout) -> Result<()> {
    let format = if asked == InputLayout::Atlas { atlas::format_of(texture) } else { texture.format };
    if kind == FileKind::Png && format.number().is_some() {
        return Err(Error::unsupported(
            format!("a PNG picture of {}, whose values are of an unknown curve and end at 1", texture.format),
            "give an OpenEXR (.exr) or Radiance HDR (.hdr) file; of an atlas of PlayCanvas say --input-layout atlas",
        ));
    }
    if texture.array_layers > 1 {
        return Err(Error::unsupported(
            format!("an array of {} layers, where an environment is wanted", texture.array_layers),
            "extract one with `kiln convert --layer 0`",
        ));
    }
    Ok(())
}

fn read_faces(paths: [PathBuf; 6], asked: InputLayout) -> Result<Raw> {
    if !matches!(asked, InputLayout::Auto | InputLayout::Cube) {
        let problem = Error::usage("six files, where the layout says one picture", "use --input-layout auto or cube");
        return Err(problem.in_file(&paths[0]));
    }
    let read = |path: PathBuf| read_image(&path).map(|image| (path, image));
    let faces = paths.into_iter().map(read).collect::<Result<Vec<(PathBuf, Image)>>>()?;
    let faces = <[_; 6]>::try_from(faces).map_err(|_| Error::invalid("not six faces", "give six files"))?;
    Raw::of_faces(&faces)
}
