//! `kiln convert`: a file in another container, another packing, another shape.

use super::console::Console;
use clap::{Args, ValueEnum};
use kiln::certificate;
use kiln::convert::{Conversion, Report, Shape, convert, usual_format};
use kiln::environment::SphereLayout;
use kiln::format::{Container, FormatSpec, atomic, raw};
use kiln::{Error, Result};
use std::path::PathBuf;

/// Convert a file between containers, packings, and pictures of the sphere, and say what that cost
#[derive(Debug, Args)]
#[command(
    after_help = "Values that the new format has no room for, and mips, faces and channels that it has no place for, are an error unless a \
                  flag says what becomes of them."
)]
pub struct Convert {
    /// Any file that Kiln reads: .exr, .hdr, .ktx2, .ktx, .dds, .png, .env, .npy, source code that it wrote, or .raw beside its certificate
    input: PathBuf,
    /// File to write
    output: PathBuf,
    /// Container and texel format, such as ktx2:rgba16f+zstd, dds:bc6h, hdr: see `kiln list formats` [default: by the extension, with
    /// the packing that the file has where there is that]
    #[arg(long)]
    format: Option<FormatSpec>,
    /// What a picture of the sphere becomes
    #[arg(long, value_enum, value_name = "SHAPE")]
    shape: Option<ShapeName>,
    /// What picture of the sphere the input is [default: what its certificate says; else a cube for six faces, a panorama for one]
    #[arg(long, value_enum, value_name = "SHAPE", requires = "shape")]
    from: Option<FromName>,
    /// Texels along an edge of the cube or of the octahedral square, or rows of the panorama [default: of a panorama W wide W/4, W/2;
    /// a panorama is four edges wide]
    #[arg(long, value_name = "N")]
    size: Option<usize>,
    /// Only that layer of an array texture, from 0
    #[arg(long, value_name = "N")]
    layer: Option<usize>,
    /// Only that level of the mips, 0 the largest
    #[arg(long, value_name = "N")]
    level: Option<usize>,
    /// Only the first N channels
    #[arg(long, value_name = "N")]
    channels: Option<usize>,
    /// Bring values that the new format has no room for to the nearest that it has
    #[arg(long)]
    clamp: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ShapeName {
    /// A cube map: the exact average over each texel
    Cube,
    /// One square: p = (d.x, d.y)/(|d.x| + |d.y| + |d.z|), folded outwards where d.z < 0; likewise
    Octahedral,
    /// A panorama: likewise
    Panorama,
}

impl From<ShapeName> for SphereLayout {
    fn from(name: ShapeName) -> Self {
        match name {
            ShapeName::Cube => Self::Cube,
            ShapeName::Octahedral => Self::Octahedral,
            ShapeName::Panorama => Self::Equirect,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum FromName {
    /// A cube map
    Cube,
    /// One square
    Octahedral,
    /// A panorama
    Panorama,
    /// PlayCanvas' atlas, of which the largest mirror is taken; codes that do not say what they are, are RGBP
    Atlas,
}

impl From<FromName> for SphereLayout {
    fn from(name: FromName) -> Self {
        match name {
            FromName::Cube => Self::Cube,
            FromName::Octahedral => Self::Octahedral,
            FromName::Panorama => Self::Equirect,
            FromName::Atlas => Self::Atlas,
        }
    }
}

impl Convert {
    pub fn run(&self, console: &Console) -> Result<()> {
        let decoded = certificate::read(&self.input)?;
        let format = match self.format {
            Some(format) => format,
            None => usual_format(self.container()?, &decoded)?,
        };
        let shape = match (self.shape, self.size) {
            (Some(shape), size) => Shape::Map(shape.into(), self.checked_size(size)?),
            (None, Some(_)) => {
                return Err(Error::usage("--size without --shape", "say with --shape what is to have that size"));
            }
            (None, None) => Shape::Keep,
        };
        let from = self.from.map(SphereLayout::from);
        let name = self.output.file_stem().and_then(|name| name.to_str()).map(str::to_owned);
        let (layer, level, channels, clamp) = (self.layer, self.level, self.channels, self.clamp);
        let conversion = Conversion { format, shape, from, layer, level, channels, clamp, name };
        let (bytes, report) = convert(decoded, &conversion).map_err(|e| e.in_file(&self.input))?;
        atomic::write(&self.output, &bytes)?;
        if let Some(layout) = &report.layout {
            atomic::write(&raw::layout_beside(&self.output), layout.as_bytes())?;
        }
        for note in &report.notes {
            console.note(&format!("{}: {note}", self.output.display()));
        }
        if console.json { console.print_json(&report) } else { console.print(&text(self, format, &report)) }
    }

    fn checked_size(&self, size: Option<usize>) -> Result<usize> {
        match size {
            None => Ok(0),
            Some(n) if (1..=kiln::recipe::LARGEST_CUBE).contains(&n) => Ok(n),
            Some(n) => Err(Error::usage(
                format!("size {n} is not in 1..={}", kiln::recipe::LARGEST_CUBE),
                "use something like --size 256",
            )),
        }
    }

    fn container(&self) -> Result<Container> {
        let extension = self.output.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        Container::of_extension(&extension).ok_or_else(|| {
            Error::usage(
                format!("{} does not say which format it is to have", self.output.display()),
                "give --format, such as ktx2:rgba16f; see `kiln list formats`",
            )
        })
    }
}

fn text(convert: &Convert, format: FormatSpec, report: &Report) -> String {
    let number = |v: f64| if v == 0.0 { "0".to_owned() } else { format!("{v:.3e}") };
    let Report { packing, rms_error, max_error, count, .. } = report;
    let mut text = format!(
        "{}: {format}, off by at most {}, {} RMS over {count} values; {} overflowed, {} below zero, {} not finite\n",
        convert.output.display(),
        number(*max_error),
        number(*rms_error),
        packing.overflowed,
        packing.negative,
        packing.nonfinite
    );
    if let Some(change) = report.flux_change {
        text += &format!("the mean over the sphere changed by {change:.1e} of it\n");
    }
    if let Some(rms) = report.resampling_rms {
        text += &format!("a bilinear lookup is off from the texels that were there by {:.2} % RMS\n", 100.0 * rms);
    }
    text
}
