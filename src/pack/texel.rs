//! The names of texel formats and what each does.

use super::{Number, PackReport, b10g11r11, bc6h, blocks, rgb9e5, rgbd, rgbe, rgbm, rgbp, uastc_hdr};
use crate::error::{Error, Result};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// How a texel is stored: `r16f`, `rg8unorm`, `rgb9e5`, `bc6h`…
///
/// Values go in and come out as numbers per channel, whatever is stored: three for the formats of colour alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum TexelFormat {
    /// A number per channel.
    Plain {
        /// 1 to 4 in a texture; any in what is an array or has named channels.
        channels: usize,
        /// How each channel is stored.
        number: Number,
    },
    /// See [`rgb9e5`].
    Rgb9e5,
    /// See [`b10g11r11`].
    B10g11r11,
    /// See [`bc6h`].
    Bc6h,
    /// See [`uastc_hdr`].
    UastcHdr,
    /// See [`rgbm`].
    Rgbm,
    /// See [`rgbp`].
    Rgbp,
    /// See [`rgbd`].
    Rgbd,
    /// See [`rgbe`].
    Rgbe,
}

use TexelFormat::{B10g11r11, Bc6h, Plain, Rgb9e5, Rgbd, Rgbe, Rgbm, Rgbp, UastcHdr};

impl TexelFormat {
    /// Every texel format that has a name.
    pub const ALL: [Self; 24] = {
        use Number::{F16, F32, Unorm8, Unorm16};
        const fn of(channels: usize, number: Number) -> TexelFormat {
            Plain { channels, number }
        }
        [
            of(1, F16),
            of(2, F16),
            of(3, F16),
            of(4, F16),
            of(1, F32),
            of(2, F32),
            of(3, F32),
            of(4, F32),
            of(1, Unorm8),
            of(2, Unorm8),
            of(3, Unorm8),
            of(4, Unorm8),
            of(1, Unorm16),
            of(2, Unorm16),
            of(3, Unorm16),
            of(4, Unorm16),
            Rgb9e5,
            B10g11r11,
            Bc6h,
            UastcHdr,
            Rgbm,
            Rgbp,
            Rgbd,
            Rgbe,
        ]
    };

    /// The format of `channels` numbers each.
    ///
    /// **Errors**: any count but 1 to 4.
    pub fn new(channels: usize, number: Number) -> Result<Self> {
        match channels {
            1..=4 => Ok(Plain { channels, number }),
            _ => Err(Error::usage(
                format!("a texel of {channels} channels, where formats have 1 to 4"),
                "add channels, or split them over several files",
            )),
        }
    }

    /// Values per texel.
    pub fn channels(self) -> usize {
        match self {
            Plain { channels, .. } => channels,
            _ => 3,
        }
    }

    /// The number that each channel is, where every channel is one of the same kind.
    pub fn number(self) -> Option<Number> {
        match self {
            Plain { number, .. } => Some(number),
            _ => None,
        }
    }

    /// Whether each channel is rounded on its own: then [`TexelFormat::ulp`] and [`TexelFormat::rounds_alike`] say how.
    pub fn is_per_channel(self) -> bool {
        matches!(self, Plain { .. } | B10g11r11)
    }

    /// Whether values below zero keep their sign.
    pub fn is_signed(self) -> bool {
        self.number().is_some_and(Number::is_signed)
    }

    /// The largest finite value of a channel (0 red, 1 green…).
    pub fn largest(self, channel: usize) -> f64 {
        match self {
            Plain { number, .. } => number.largest(),
            Rgb9e5 => rgb9e5::MAX,
            B10g11r11 => b10g11r11::MAX[channel.min(2)],
            Bc6h => bc6h::MAX,
            UastcHdr => uastc_hdr::MAX,
            Rgbm => rgbm::MAX,
            Rgbp => rgbp::MAX,
            Rgbd => rgbd::MAX,
            Rgbe => rgbe::MAX,
        }
    }

    /// Spacing of a channel's numbers at `value`, where each channel is rounded on its own.
    pub fn ulp(self, channel: usize, value: f64) -> Option<f64> {
        match self {
            Plain { number, .. } => Some(number.ulp(value)),
            B10g11r11 => Some(b10g11r11::ulp(channel, value)),
            _ => None,
        }
    }

    /// The distance between the values that a channel can have at `value`, in a texel whose largest channel is `brightest`: rounding is off
    /// by at most half of it. Nothing where texels are packed in [`blocks`]: no such bound exists.
    pub fn step(self, channel: usize, value: f64, brightest: f64) -> Option<f64> {
        match self {
            Rgb9e5 => Some(rgb9e5::step(brightest)),
            Rgbe => Some(rgbe::step(brightest)),
            Rgbm => Some(rgbm::step(value, brightest)),
            Rgbp => Some(rgbp::step(value, brightest)),
            Rgbd => Some(rgbd::step(value, brightest)),
            Plain { .. } | B10g11r11 => self.ulp(channel, value),
            Bc6h | UastcHdr => None,
        }
    }

    /// Whether every value from `low` to `high` packs to the same number of that channel; never, where channels are not rounded on their
    /// own.
    pub fn rounds_alike(self, channel: usize, low: f64, high: f64) -> bool {
        match self {
            Plain { number, .. } => number.rounds_alike(low, high),
            B10g11r11 => {
                let alone = |value: f64| {
                    let mut texel = [0.0; 3];
                    texel[channel.min(2)] = value;
                    b10g11r11::pack(&texel).0
                };
                alone(low) == alone(high)
            }
            _ => false,
        }
    }

    /// Width and height of a block; 1 unless the format compresses.
    pub fn block(self) -> usize {
        match self {
            Bc6h | UastcHdr => blocks::SIDE,
            _ => 1,
        }
    }

    /// Whether every value that a texel can have is an f32: k/255 is none, and is read as the nearest.
    pub fn is_read_exactly(self) -> bool {
        !matches!(self, Plain { number: Number::Unorm8 | Number::Unorm16, .. } | Rgbm | Rgbd | Rgbp)
    }

    /// Whether texels are packed in [`blocks`], where each is off by more or less as its neighbours want it.
    pub fn is_in_blocks(self) -> bool {
        self.block() > 1
    }

    /// Bytes that one block takes: of a format that does not compress, one texel.
    pub fn block_bytes(self) -> usize {
        match self {
            Plain { channels, number } => channels * number.bytes(),
            Bc6h | UastcHdr => blocks::BYTES,
            _ => 4,
        }
    }

    /// Bytes that one picture takes; nothing where that overflows.
    pub fn bytes(self, width: usize, height: usize) -> Option<usize> {
        let blocks = width.div_ceil(self.block()).checked_mul(height.div_ceil(self.block()))?;
        blocks.checked_mul(self.block_bytes())
    }

    /// Packs pictures of that size, one after the other.
    ///
    /// **Shape**: `values` is pictures × height × width × [`TexelFormat::channels`], channel fastest; what is no whole picture is left out.
    pub fn pack<T: Copy + Into<f64> + Sync>(self, width: usize, height: usize, values: &[T]) -> (Vec<u8>, PackReport) {
        let whole = width.saturating_mul(height).saturating_mul(self.channels()).max(1);
        let values = &values[..values.len() / whole * whole];
        let size = if self.is_in_blocks() { whole } else { PART * self.channels() };
        let part = |values: &[T]| match self {
            Plain { number, .. } => number.pack(values),
            Rgb9e5 => rgb9e5::pack(values),
            B10g11r11 => b10g11r11::pack(values),
            Rgbm => rgbm::pack(values),
            Rgbp => rgbp::pack(values),
            Rgbd => rgbd::pack(values),
            Rgbe => rgbe::pack(values),
            Bc6h => bc6h::pack(width, height, values),
            UastcHdr => uastc_hdr::pack(width, height, values),
        };
        let (parts, reports): (Vec<Vec<u8>>, Vec<PackReport>) = values.par_chunks(size).map(part).unzip();
        (joined(parts), reports.into_iter().fold(PackReport::default(), PackReport::merge))
    }

    /// Unpacks pictures of that size; what is no whole picture is left out.
    pub fn unpack(self, width: usize, height: usize, bytes: &[u8]) -> Vec<f32> {
        let Some(picture) = self.bytes(width, height).filter(|&n| n > 0) else { return vec![] };
        let bytes = &bytes[..bytes.len() / picture * picture];
        let texel = self.bytes(1, 1).unwrap_or(picture);
        let size = if self.is_in_blocks() { picture } else { PART * texel };
        let part = |bytes: &[u8]| match self {
            Plain { number, .. } => number.unpack(bytes),
            Rgb9e5 => rgb9e5::unpack(bytes),
            B10g11r11 => b10g11r11::unpack(bytes),
            Rgbm => rgbm::unpack(bytes),
            Rgbp => rgbp::unpack(bytes),
            Rgbd => rgbd::unpack(bytes),
            Rgbe => rgbe::unpack(bytes),
            Bc6h => bc6h::unpack(width, height, bytes),
            UastcHdr => uastc_hdr::unpack(width, height, bytes),
        };
        joined(bytes.par_chunks(size).map(part).collect())
    }

    /// The names of all texel formats, separated by commas.
    pub fn names() -> String {
        Self::ALL.map(|format| format.to_string()).join(", ")
    }
}

/// Texels that a thread packs at a time.
const PART: usize = 1 << 14;

/// One list after the other; a lone one as it is.
fn joined<T: Copy>(mut lists: Vec<Vec<T>>) -> Vec<T> {
    if lists.len() == 1 { lists.remove(0) } else { lists.concat() }
}

impl fmt::Display for TexelFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Plain { channels: 5.., number } => write!(f, "{}×{number}", self.channels()),
            Plain { channels, number } => {
                let letters = &"rgba"[..channels];
                let suffix = if number.is_signed() { "f" } else { "unorm" };
                write!(f, "{letters}{}{suffix}", 8 * number.bytes())
            }
            Rgb9e5 => f.write_str("rgb9e5"),
            B10g11r11 => f.write_str("b10g11r11"),
            Bc6h => f.write_str("bc6h"),
            UastcHdr => f.write_str("uastc-hdr"),
            Rgbm => f.write_str("rgbm"),
            Rgbp => f.write_str("rgbp"),
            Rgbd => f.write_str("rgbd"),
            Rgbe => f.write_str("rgbe"),
        }
    }
}

impl FromStr for TexelFormat {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|format| format.to_string() == name).ok_or_else(|| {
            Error::usage(format!("unknown texel format `{name}`"), format!("use one of {}", Self::names()))
        })
    }
}

impl TryFrom<String> for TexelFormat {
    type Error = Error;

    fn try_from(name: String) -> Result<Self> {
        name.parse()
    }
}

impl From<TexelFormat> for String {
    fn from(format: TexelFormat) -> Self {
        format.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::tests::Random;

    #[test]
    fn texel_formats_are_what_their_names_say() {
        for format in TexelFormat::ALL {
            assert_eq!(format.to_string().parse::<TexelFormat>().unwrap(), format);
            let json = serde_json::to_string(&format).unwrap();
            assert_eq!(json, format!("\"{format}\""));
            assert_eq!(serde_json::from_str::<TexelFormat>(&json).unwrap(), format);
        }
        assert_eq!(
            TexelFormat::names(),
            "r16f, rg16f, rgb16f, rgba16f, r32f, rg32f, rgb32f, rgba32f, r8unorm, rg8unorm, rgb8unorm, rgba8unorm, \
             r16unorm, rg16unorm, rgb16unorm, rgba16unorm, rgb9e5, b10g11r11, bc6h, uastc-hdr, rgbm, rgbp, rgbd, rgbe"
        );
        let bytes = |name: &str| name.parse::<TexelFormat>().unwrap().bytes(5, 3);
        assert_eq!(["rg16f", "rgba32f", "rgb8unorm", "rgb9e5", "bc6h"].map(bytes), [60, 240, 45, 60, 32].map(Some));
    }

    #[test]
    fn unknown_formats_are_refused_with_the_list_of_known_ones() {
        for name in ["rgba64f", "", "RG16F", "rg16", "rg8", "bc7"] {
            let message = name.parse::<TexelFormat>().unwrap_err().to_string();
            assert!(message.contains("; use one of r16f, rg16f"), "{message}");
        }
        assert!(TexelFormat::new(5, Number::F16).is_err() && TexelFormat::new(0, Number::F16).is_err());
    }

    /// The error of every packing is within half of the step that it states, and the report has the largest.
    #[test]
    fn steps_bound_the_errors_of_every_format_that_has_them() {
        let mut random = Random(20);
        for format in TexelFormat::ALL {
            let n = format.channels();
            let values: Vec<f64> =
                (0..60 * n).map(|_| random.unit() * random.unit() * format.largest(0).min(60.0)).collect();
            let (bytes, report) = format.pack(12, 5, &values);
            assert_eq!(Some(bytes.len()), format.bytes(12, 5), "{format}");
            let unpacked = format.unpack(12, 5, &bytes);
            assert_eq!(unpacked.len(), values.len(), "{format}");
            let mut worst = 0.0_f64;
            for (texel, back) in values.chunks_exact(n).zip(unpacked.chunks_exact(n)) {
                let brightest = texel.iter().copied().fold(0.0, f64::max);
                for c in 0..n {
                    let off = (f64::from(back[c]) - texel[c]).abs();
                    worst = worst.max(off);
                    if let Some(step) = format.step(c, texel[c], brightest) {
                        // Values that are no f32 are rounded once more when they are unpacked.
                        let unpacking = 6e-8 * texel[c];
                        assert!(off <= 0.5 * step + unpacking, "{format}: {off} at {}, step {step}", texel[c]);
                    }
                }
            }
            assert!((worst - report.max_abs_error).abs() <= 6e-8 * 60.0, "{format}: {worst} and {report:?}");
        }
    }

    #[test]
    fn only_formats_of_single_channels_round_alike() {
        let b10 = B10g11r11;
        let tie = 1.0 + 2_f64.powi(-7); // of red; blue has its own
        assert!(b10.rounds_alike(0, tie + 1e-9, tie + 2e-9) && !b10.rounds_alike(0, tie - 1e-9, tie + 1e-9));
        assert!(b10.rounds_alike(2, tie - 1e-9, tie + 1e-9));
        assert!(!Rgb9e5.rounds_alike(0, 0.5, 0.5));
    }
}
