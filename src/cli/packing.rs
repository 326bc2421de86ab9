//! What packing had to change, and the way out.

use super::console::Console;
use kiln::Result;
use kiln::environment::{Adjustment, SphereLayout};
use kiln::format::FormatSpec;
use kiln::pack::{Number, PackReport, TexelFormat};

/// What was packed: that decides what else can be done.
#[derive(Debug, Clone, Copy)]
pub enum Packed<'a> {
    /// A table of so many channels.
    Table(usize),
    /// Maps of an environment, after these adjustments at most so bright.
    Maps { layout: SphereLayout, adjust: &'a Adjustment, brightest: f64 },
}

/// Says what packing had to change.
///
/// **Errors**: a format that does not hold such texels, which nothing can have been packed in.
pub fn warn_of_packing(
    console: &Console,
    what: &str,
    spec: FormatSpec,
    packed: Packed,
    packing: &PackReport,
) -> Result<()> {
    let format = spec.texel(packed.channels())?;
    if packing.overflowed > 0 {
        let largest = format.largest(0);
        console.warn(&format!(
            "{what}: {} values beyond the largest that {format} holds, {largest}, were clamped to it; {}",
            packing.overflowed,
            packed.to_hold_large(spec, largest)
        ));
    }
    if packing.negative > 0 && !format.is_signed() {
        console.warn(&format!(
            "{what}: {} values below zero are 0 in {format}, which has no sign; {}",
            packing.negative,
            packed.to_hold_negative(spec)
        ));
    }
    Ok(())
}

impl Packed<'_> {
    fn channels(self) -> usize {
        match self {
            Self::Table(channels) => channels,
            Self::Maps { .. } => 3,
        }
    }

    /// The container's own format of such numbers; nothing where it has none.
    fn own(self, spec: FormatSpec, number: Number) -> Option<FormatSpec> {
        let (channels, container) = (self.channels(), spec.container());
        let fits = |channels| FormatSpec::new(container, TexelFormat::new(channels, number).ok()?).ok();
        match self {
            // No graphics interface filters three channels of floats.
            Self::Maps { .. } => fits(4),
            Self::Table(_) => fits(channels).or_else(|| fits(4)),
        }
    }

    fn to_hold_large(self, spec: FormatSpec, largest: f64) -> String {
        let wider = self.own(spec, Number::F32).map(|wider| format!("--format {wider} to keep them"));
        match (self, wider) {
            (Self::Table(_), wider) => {
                format!("use {}", wider.unwrap_or_else(|| "--format ktx2:rgba32f to keep them".to_owned()))
            }
            (Self::Maps { layout: SphereLayout::Atlas, adjust, brightest }, _) => {
                format!("use {}, by scene.skyboxIntensity", darker(adjust, brightest / largest))
            }
            (Self::Maps { adjust, brightest, .. }, wider) => {
                let darker = darker(adjust, brightest / largest);
                wider.map_or_else(|| format!("use {darker}"), |wider| format!("use {wider}, or {darker}"))
            }
        }
    }

    fn to_hold_negative(self, spec: FormatSpec) -> String {
        let kept = self.own(spec, Number::F16).map(|own| format!("use --format {own} to keep them, or "));
        match self {
            Self::Maps { layout: SphereLayout::Atlas, .. } => "use --negatives clamp to filter without them".to_owned(),
            _ => format!("{}--negatives clamp to filter without them", kept.unwrap_or_else(|| "use ".to_owned())),
        }
    }
}

/// The flag that makes an environment so many times darker, and what undoes it.
fn darker(adjust: &Adjustment, times: f64) -> String {
    // To a tenth of a stop, and dark enough.
    let stops = (10.0 * times.log2()).ceil().max(0.0) / 10.0;
    match adjust.illuminance {
        Some(lux) => {
            format!("--illuminance {:.3e} and a light so many times brighter in the engine", lux / stops.exp2())
        }
        None => format!("--exposure {:.1} and {stops:.1} stops more in the engine", adjust.exposure - stops),
    }
}
