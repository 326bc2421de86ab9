//! A clear sky with its sun over a matte ground: `builtin:sky`.
//!
//! - **Sky**: Hosek & Wilkie (2012), "An Analytic Model for Full Spectral Sky-Dome Radiance", its RGB data, by the crate
//!   `hw-skymodel`. The model is made for the upper hemisphere; the crate mirrors it below the horizon, which is not used.
//! - **Sun**: a uniform disc of angular radius 0.2667°, of the flux that [`sun_flux`] states, which the sky lacks.
//! - **Ground**: below the horizon, a matte plane lit by that sky and that sun: radiance albedo · E / π.
//!
//! **Units**: linear RGB; one unit of luminance is 683 cd/m² (a photopic watt per m² and steradian). The crate names no
//! unit; this one follows from its values: at turbidity 3 and 40° the sky's illuminance comes out as 17 klx, as measured
//! skies of that kind have it. The sun below is in the same unit, so that sun and sky stand in a true proportion.

use std::f64::consts::PI;

use hw_skymodel::rgb::{Channel, SkyParams, SkyState};

use super::builtin::{direction, finish};
use super::panorama::{Panorama, texel_box};
use super::sun_disc::add_disc;
use crate::error::{Error, Result};

/// What the sky is to look like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sky {
    /// Elevation of the sun in degrees, from 0 to 90.
    pub elevation: f64,
    /// Azimuth of the sun in degrees, from +X towards +Z.
    pub azimuth: f64,
    /// Haze, from 1 (none) to 10.
    pub turbidity: f64,
    /// Reflectance of the ground in each channel, from 0 to 1.
    pub albedo: [f64; 3],
}

impl Default for Sky {
    /// A clear day: the sun 40° high between +X and +Z, turbidity 3, albedo 0.3.
    fn default() -> Self {
        Self { elevation: 40.0, azimuth: 50.0, turbidity: 3.0, albedo: [0.3; 3] }
    }
}

/// Solar illuminance outside the atmosphere: 128 klx, in units of 683 lm/W. Taken as white.
const EXTRATERRESTRIAL: f64 = 128_000.0 / 683.0;

/// Wavelengths in µm that stand for the channels: about the centres of the Rec. 709 primaries' bands.
const WAVELENGTHS: [f64; 3] = [0.615, 0.545, 0.465];

/// Points per side of a texel at which the sky is sampled: it is smooth there, but for the glow around the sun.
const POINTS: usize = 2;

/// ∫ L dω of the sun's disc in each channel: the irradiance of a surface that faces it.
///
/// 128 klx / 683 × exp(−m (τ_R + τ_A)), with the relative air mass m of Kasten & Young (1989), and the optical depths
/// that Preetham, Shirley & Smits (1999, appendix) give for the wavelength λ in µm and the turbidity T: air
/// τ_R = 0.008735 λ^−4.08, haze τ_A = β λ^−1.3 with β = 0.04608 T − 0.04586. Ozone and water vapour are left out.
pub fn sun_flux(elevation: f64, turbidity: f64) -> [f64; 3] {
    let air_mass = 1.0 / (elevation.to_radians().sin() + 0.50572 * (elevation + 6.07995).powf(-1.6364));
    let haze = (0.04608 * turbidity - 0.04586).max(0.0); // the fit goes 2e-4 above zero at T = 1, and below it under that
    WAVELENGTHS.map(|lambda| {
        let depth = 0.008735 * lambda.powf(-4.08) + haze * lambda.powf(-1.3);
        EXTRATERRESTRIAL * (-air_mass * depth).exp()
    })
}

/// The panorama of a sky, `width` × `width / 2` texels.
///
/// **Errors**: a sun below the horizon or parameters outside their ranges, named.
pub fn sky(width: usize, parameters: &Sky) -> Result<Panorama> {
    let Sky { elevation, azimuth, turbidity, albedo } = *parameters;
    let state = SkyState::new(&SkyParams {
        elevation: elevation.to_radians() as f32,
        turbidity: turbidity as f32,
        albedo: albedo.map(|a| a as f32),
    })
    .map_err(|e| Error::usage(format!("sky: {e}"), "choose parameters within these ranges"))?;
    let sun = direction(elevation, azimuth);

    // The sky, and for each texel the part of it that looks at the ground.
    let height = width / 2;
    let mut radiance = vec![[0.0; 3]; width * height];
    let mut ground = vec![0.0; height];
    let mut irradiance = [0.0; 3];
    for row in 0..height {
        let part = 1.0 / (POINTS * POINTS) as f64;
        for column in 0..width {
            let b = texel_box(width, column, row);
            let solid_angle = (b.phi[1] - b.phi[0]) * (b.y[1] - b.y[0]);
            for i in 0..POINTS {
                let y = b.y[0] + (b.y[1] - b.y[0]) * (i as f64 + 0.5) / POINTS as f64;
                if y <= 0.0 {
                    ground[row] += POINTS as f64 * part / width as f64;
                    continue;
                }
                for j in 0..POINTS {
                    let phi = b.phi[0] + (b.phi[1] - b.phi[0]) * (j as f64 + 0.5) / POINTS as f64;
                    let horizontal = (1.0 - y * y).sqrt();
                    let view = glam::DVec3::new(horizontal * phi.cos(), y, horizontal * phi.sin());
                    let gamma = view.cross(sun).length().atan2(view.dot(sun));
                    for (c, channel) in [Channel::R, Channel::G, Channel::B].into_iter().enumerate() {
                        let value = f64::from(state.radiance(y.acos() as f32, gamma as f32, channel));
                        radiance[row * width + column][c] += part * value;
                        irradiance[c] += part * value * y * solid_angle;
                    }
                }
            }
        }
    }

    let flux = sun_flux(elevation, turbidity);
    let bounced: [f64; 3] = std::array::from_fn(|c| albedo[c] / PI * (irradiance[c] + flux[c] * sun.y));
    for (row, part) in ground.iter().enumerate() {
        for texel in &mut radiance[row * width..(row + 1) * width] {
            (0..3).for_each(|c| texel[c] += part * bounced[c]);
        }
    }
    add_disc(&mut radiance, width, sun, flux);
    finish(width, &radiance)
}
