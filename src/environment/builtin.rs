//! Environments that need no file: `builtin:NAME`.
//!
//! Each is known analytically, so a test or a user can tell what a baked result ought to be.

use glam::DVec3;

use super::orientation_map::orientation;
use super::panorama::{Panorama, TexelBox};
use super::sky::{Sky, sky};
use super::sun_disc::add_disc;
use crate::error::{Error, Result};

/// Width of a built-in panorama unless another is asked for.
pub const DEFAULT_WIDTH: usize = 1024;

/// An environment that needs no file.
#[derive(Debug, Clone, Copy)]
pub struct Builtin {
    /// What `builtin:` is followed by.
    pub name: &'static str,
    /// One line about it.
    pub description: &'static str,
    make: fn(usize) -> Result<Panorama>,
}

/// All of them.
pub const BUILTINS: [Builtin; 5] = [
    Builtin {
        name: "white",
        description: "radiance 1 from everywhere: the white furnace, which every filter must leave at 1",
        make: white,
    },
    Builtin {
        name: "gradient",
        description: "a smooth vertical gradient, (3 + 2y, 3 + y, 3) / 3 of the height y: every filter is known in closed form",
        make: gradient,
    },
    Builtin {
        name: "sun",
        description: "a disc of the sun's size and irradiance 10 on a sky of radiance 0.1: the hardest case for a sampler",
        make: sun,
    },
    Builtin {
        name: "sky",
        description: "a clear sky (Hosek-Wilkie, turbidity 3) with its sun 40° high over a ground of albedo 0.3",
        make: |width| sky(width, &Sky::default()),
    },
    Builtin {
        name: "orientation",
        description: "a room whose walls bear the names of their axes, readable from inside: shows which way an engine turns a cube",
        make: orientation,
    },
];

/// The built-in environment of this name, `width` × `width / 2` texels.
///
/// **Errors**: no such name (the message lists them all), or a width that is odd or too small.
pub fn builtin(name: &str, width: usize) -> Result<Panorama> {
    let Some(builtin) = BUILTINS.iter().find(|builtin| builtin.name == name) else {
        let names: Vec<&str> = BUILTINS.iter().map(|builtin| builtin.name).collect();
        return Err(Error::usage(
            format!("there is no built-in environment {name}"),
            format!("use one of {}", names.join(", ")),
        ));
    };
    if width % 2 == 1 || width < 4 {
        return Err(Error::usage(
            format!("panorama of width {width}: an even width of at least 4 is wanted"),
            "use 1024",
        ));
    }
    (builtin.make)(width)
}

fn white(width: usize) -> Result<Panorama> {
    Panorama::from_fn(width, |_| [1.0; 3])
}

/// L = (1 + 2y/3, 1 + y/3, 1) with y = d.y, averaged over each texel. A zonal filter multiplies the part that is linear
/// in y by its first coefficient 2π ∫ K(c) c dc and leaves the constant alone.
fn gradient(width: usize) -> Result<Panorama> {
    Panorama::from_fn(width, |texel: TexelBox| {
        let y = (texel.y[0] + texel.y[1]) / 2.0;
        [1.0 + 2.0 / 3.0 * y, 1.0 + y / 3.0, 1.0]
    })
}

/// Radiance of `builtin:sun` away from the sun.
pub const SUN_BACKGROUND: f64 = 0.1;
/// Flux of the disc of `builtin:sun`, ∫ L dω in each channel, over and above its background.
pub const SUN_FLUX: f64 = 10.0;

/// Direction of the sun in `builtin:sun`: 30° up, between +X and +Z, on no axis and no edge of a cube.
pub fn sun_direction() -> DVec3 {
    direction(30.0, 50.0)
}

fn sun(width: usize) -> Result<Panorama> {
    let mut radiance = vec![[SUN_BACKGROUND; 3]; width * width / 2];
    add_disc(&mut radiance, width, sun_direction(), [SUN_FLUX; 3]);
    finish(width, &radiance)
}

/// The direction at an elevation and an azimuth (from +X towards +Z), both in degrees.
pub(super) fn direction(elevation: f64, azimuth: f64) -> DVec3 {
    let (sin, cos) = elevation.to_radians().sin_cos();
    let (sin_azimuth, cos_azimuth) = azimuth.to_radians().sin_cos();
    DVec3::new(cos * cos_azimuth, sin, cos * sin_azimuth)
}

/// The panorama with these texels, rounded to f32.
pub(super) fn finish(width: usize, radiance: &[[f64; 3]]) -> Result<Panorama> {
    Panorama::new(width, width / 2, radiance.iter().map(|texel| texel.map(|v| v as f32)).collect())
}
