//! `kiln show`: a picture of a file.

use super::console::Console;
use clap::Args;
use kiln::certificate;
use kiln::format::{Decoded, atomic};
use kiln::report::{self, Preview};
use kiln::{Error, Result};
use std::path::PathBuf;

/// Draw a preview of a table, panorama or cube as PNG, to look at
#[derive(Debug, Args)]
pub struct Show {
    /// Any file that Kiln reads: .exr, .hdr, .ktx2, .ktx, .dds, .png, .env, .npy, source code that it wrote, or .raw beside its certificate
    file: PathBuf,
    /// PNG file to write
    #[arg(long, short, value_name = "FILE.png")]
    output: PathBuf,
    /// Stops brighter (or darker, below zero) than automatic
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_negative_numbers = true)]
    exposure: f32,
}

impl Show {
    pub fn run(&self, console: &Console) -> Result<()> {
        let decoded = certificate::read(&self.file)?;
        let preview = self.preview(decoded).map_err(|e| e.in_file(&self.file))?;
        atomic::write(&self.output, &preview.png()?)?;
        console.note(&format!("{}: {} × {}", self.output.display(), preview.width, preview.height));
        Ok(())
    }

    fn preview(&self, decoded: Decoded) -> Result<Preview> {
        match decoded {
            Decoded::Texture(texture) if texture.faces == 6 => report::cube(&texture, self.exposure),
            Decoded::Texture(texture) => {
                let slices: Vec<Vec<f32>> = (0..texture.layers(0)).filter_map(|z| texture.face(0, z)).collect();
                Ok(report::table(texture.width, texture.height, texture.format.channels(), &slices))
            }
            // What has colour is radiance; what has not is a table.
            Decoded::Picture(image, _) => match report::panorama(&image, self.exposure) {
                Ok(preview) => Ok(preview),
                Err(_) => Ok(report::table(image.width, image.height, image.channels.len(), &[image.texels])),
            },
            Decoded::Array(array) => {
                let [width, height, _, channels] = array.extent();
                if array.values.is_empty() {
                    return Err(Error::unsupported("an array of nothing", "show another"));
                }
                let values: Vec<f32> = array.values.iter().map(|&v| v as f32).collect();
                let slices: Vec<Vec<f32>> =
                    values.chunks_exact(width * height * channels).map(<[f32]>::to_vec).collect();
                Ok(report::table(width, height, channels, &slices))
            }
        }
    }
}
