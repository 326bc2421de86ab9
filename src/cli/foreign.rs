//! What a user says of a file that Kiln did not make.

use super::arguments::{Channels, ModelArgs};
use clap::Args;
use kiln::Result;
use kiln::claim::Said;
use kiln::format::grid::{Described, RawNumber, Shape};
use kiln::pack::TexelFormat;
use kiln::table::{Axis, Point};

/// What a file does not say of itself.
#[derive(Debug, Args)]
#[command(next_help_heading = "Files that do not say what they are")]
pub struct DescribedArgs {
    /// Shape of bare numbers, of a flat array or of an atlas's slices; of three or four sizes the last is that of a texel
    #[arg(long, value_name = "WxHxC")]
    shape: Option<Shape>,
    /// Which array of a source text, by name or by number, or which file in base64 within it, by name
    #[arg(long, value_name = "NAME")]
    array: Option<String>,
    /// Whether a texel's channels stand together, or each channel is a plane of its own
    #[arg(long, value_name = "ORDER", default_value = "interleaved", value_parser = ["interleaved", "planar"])]
    channel_order: String,
    /// What four bytes a texel are the codes of, where the file does not say it: rgbd, rgbm or rgbp
    #[arg(long, value_name = "PACKING")]
    packing: Option<TexelFormat>,
    /// How bare numbers are stored: f16, f32, f64, u8, u16 [default: by the length of the file]
    #[arg(long)]
    number: Option<RawNumber>,
    /// Which layer of an array of textures, or slice of a volume, from 0 [default: all, as a volume]
    #[arg(long, value_name = "N")]
    layer: Option<usize>,
}

impl DescribedArgs {
    /// The description.
    pub fn described(&self) -> Described {
        Described {
            shape: self.shape,
            array: self.array.clone(),
            packing: self.packing,
            planar: self.channel_order == "planar",
            number: self.number,
            layer: self.layer,
        }
    }
}

/// What a table is said to hold.
#[derive(Debug, Args)]
#[command(
    next_help_heading = "What a table without a certificate is said to hold [default: what `kiln identify` finds]"
)]
pub struct SaidArgs {
    /// The table that it should be: see `kiln list tables`
    #[arg(long = "as", value_name = "TABLE")]
    table: Option<String>,
    /// Its axes, x first, as `kiln table` takes them; sizes are the file's
    #[arg(long, value_name = "AXIS", value_delimiter = ',')]
    axes: Vec<Axis>,
    /// Its quantities, one per channel; `-` for a channel of which nothing is said
    #[arg(long, value_name = "QUANTITY,…", allow_hyphen_values = true)]
    channels: Option<Channels>,
    /// Values of the parameters that no axis varies, such as eta=1.5
    #[arg(long, value_name = "PARAMETER=NUMBER", value_delimiter = ',')]
    at: Vec<String>,
    #[command(flatten)]
    model: ModelArgs,
}

impl SaidArgs {
    /// What is said, if anything is.
    ///
    /// **Errors**: a value that is none.
    pub fn said(&self) -> Result<Option<Said>> {
        if self.table.is_none() && self.channels.is_none() {
            if !self.axes.is_empty() || !self.at.is_empty() {
                return Err(kiln::Error::usage(
                    "axes or values without anything that they are of",
                    "give --as TABLE or --channels QUANTITY,… too",
                ));
            }
            return Ok(None);
        }
        Ok(Some(Said {
            table: self.table.clone(),
            channels: self.channels.clone().unwrap_or_default().0,
            axes: self.axes.clone(),
            at: Point::try_from(self.at.clone())?,
            model: self.model.model(),
        }))
    }
}
