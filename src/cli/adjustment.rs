//! Flags that change a panorama before it is filtered.

use clap::Args;
use kiln::environment::{Adjustment, Unit};

/// What a unit of the input's values stands for.
#[derive(Debug, Clone, Copy, Args)]
pub struct UnitArgs {
    /// cd/m² that one unit of the input stands for [default: 1]
    #[arg(long, value_name = "NITS", conflicts_with = "efficacy")]
    nits_per_unit: Option<f64>,
    /// The input is in W/(sr·m²), of so many lumens per watt (179 is usual for white light)
    #[arg(long, value_name = "LM/W")]
    efficacy: Option<f64>,
}

impl UnitArgs {
    /// The unit.
    pub fn unit(&self) -> Unit {
        match (self.efficacy, self.nits_per_unit) {
            (Some(efficacy), _) => Unit::Efficacy(efficacy),
            (None, Some(nits)) => Unit::NitsPerUnit(nits),
            (None, None) => Unit::default(),
        }
    }
}

/// What is done to the panorama, in this order.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Before filtering")]
pub struct AdjustArgs {
    /// Turn the environment about +Y, right-handed: 90 brings what was at +Z to +X
    #[arg(
        long,
        value_name = "DEGREES",
        allow_negative_numbers = true,
        default_value_t = 0.0,
        hide_default_value = true
    )]
    rotate: f64,
    /// Scale texels down to this largest channel, keeping their hue; what it takes is reported
    #[arg(long, value_name = "VALUE")]
    clamp: Option<f64>,
    /// Stops brighter
    #[arg(long, value_name = "EV", allow_negative_numbers = true, default_value_t = 0.0, hide_default_value = true)]
    exposure: f64,
    /// Factor
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, hide_default_value = true)]
    scale: f64,
    #[command(flatten)]
    unit: UnitArgs,
    /// Scale the map so that the ground, unoccluded, receives this illuminance
    #[arg(long, value_name = "LUX")]
    illuminance: Option<f64>,
    /// Take the sun out, into sun.json: direction, colour, illuminance and angular size of a directional light
    #[arg(long)]
    extract_sun: bool,
}

impl AdjustArgs {
    /// The adjustment.
    pub fn adjustment(&self) -> Adjustment {
        Adjustment {
            rotate: self.rotate,
            clamp: self.clamp,
            exposure: self.exposure,
            scale: self.scale,
            unit: self.unit.unit(),
            illuminance: self.illuminance,
            extract_sun: self.extract_sun,
        }
    }
}
