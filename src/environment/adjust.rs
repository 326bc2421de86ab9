//! What a lighting artist changes before filtering: turned, exposed, clamped, calibrated, its sun taken out.

use super::panorama::Panorama;
use super::photometry::{Unit, horizontal_irradiance};
use super::sun::{self, Sun};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Changes to a panorama, applied in the order of the fields.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Adjustment {
    /// Turn about +Y, in degrees, right-handed: 90 brings what was at +Z to +X.
    pub rotate: f64,
    /// Largest value of a channel, in the input's unit; a brighter texel is scaled down to it, and keeps its hue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clamp: Option<f64>,
    /// Stops brighter.
    pub exposure: f64,
    /// Factor.
    pub scale: f64,
    /// What one unit of the input stands for.
    pub unit: Unit,
    /// Lux that the map is scaled to: the unoccluded illuminance of the ground, after exposure and scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub illuminance: Option<f64>,
    /// Whether the sun is taken out, to be a directional light.
    pub extract_sun: bool,
}

impl Default for Adjustment {
    fn default() -> Self {
        Self {
            rotate: 0.0,
            clamp: None,
            exposure: 0.0,
            scale: 1.0,
            unit: Unit::default(),
            illuminance: None,
            extract_sun: false,
        }
    }
}

/// What an adjustment came to.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adjusted {
    /// What every value was multiplied with in all: exposure, scale and illuminance.
    pub factor: f64,
    /// Texels that were clamped.
    pub clamped: u64,
    /// The part of each channel's energy that clamping took.
    pub energy_clamped: [f64; 3],
    /// The sun that was taken out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sun: Option<Sun>,
}

impl Adjustment {
    /// Whether the numbers make sense.
    ///
    /// **Errors**: values that are not finite; a clamp, scale, unit or illuminance that is not positive.
    pub fn check(&self) -> Result<()> {
        for (name, value) in [("rotate", self.rotate), ("exposure", self.exposure)] {
            if !value.is_finite() {
                return Err(Error::usage(
                    format!("{name} {value} is not a number"),
                    format!("use something like --{name} 1"),
                ));
            }
        }
        let unit = match self.unit {
            Unit::NitsPerUnit(v) => ("nits-per-unit", Some(v)),
            Unit::Efficacy(v) => ("efficacy", Some(v)),
        };
        let positive = [("clamp", self.clamp), ("scale", Some(self.scale)), ("illuminance", self.illuminance), unit];
        for (name, value) in positive {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                return Err(Error::usage(
                    format!("{name} {value} is not a positive number"),
                    format!("use something like --{name} 100"),
                ));
            }
        }
        Ok(())
    }

    /// The panorama as adjusted.
    ///
    /// Where no sun stands out, none is taken out: [`Adjusted::sun`] says so.
    ///
    /// **Errors**: [`Adjustment::check`]; an illuminance where no light comes from above; values that leave what f32 holds.
    pub fn apply(&self, panorama: Panorama) -> Result<(Panorama, Adjusted)> {
        self.check()?;
        let mut panorama = if self.rotate == 0.0 { panorama } else { rotated(&panorama, self.rotate) };
        let mut adjusted = Adjusted { factor: self.exposure.exp2() * self.scale, ..Adjusted::default() };
        if let Some(most) = self.clamp {
            let before = panorama.mean();
            (panorama, adjusted.clamped) = clamped(&panorama, most);
            let after = panorama.mean();
            adjusted.energy_clamped =
                std::array::from_fn(|c| if before[c] == 0.0 { 0.0 } else { 1.0 - after[c] / before[c] });
        }
        if let Some(lux) = self.illuminance {
            let now = self.unit.nits() * adjusted.factor * panorama.luminance(horizontal_irradiance(&panorama));
            if now.is_nan() || now <= 0.0 {
                return Err(Error::invalid(
                    format!("a horizontal illuminance of {now} lux, which no factor turns into {lux}"),
                    "use --scale, or a panorama with light from above",
                ));
            }
            adjusted.factor *= lux / now;
        }
        panorama = scaled(panorama, adjusted.factor)?;
        if self.extract_sun
            && let Some((sun, rest)) = sun::extract(&panorama)
        {
            (panorama, adjusted.sun) = (rest, Some(sun));
        }
        Ok((panorama, adjusted))
    }
}

/// The panorama turned about +Y. A turn by whole texels moves them; any other spreads each over two, and keeps every row's flux.
fn rotated(panorama: &Panorama, degrees: f64) -> Panorama {
    let width = panorama.width();
    // Azimuth φ = atan2(z, x) falls under a right-handed turn about +Y, so columns move to the left.
    let columns = (degrees / 360.0).rem_euclid(1.0) * width as f64;
    let nearest = columns.round();
    let columns = if (columns - nearest).abs() < 1e-9 { nearest } else { columns };
    let (whole, part) = (columns.floor() as usize, columns.fract());
    let mut texels = Vec::with_capacity(panorama.texels().len());
    for row in 0..panorama.height() {
        let row = panorama.row(row);
        for column in 0..width {
            let (a, b) = (row[(column + whole) % width], row[(column + whole + 1) % width]);
            texels.push(if part == 0.0 {
                a
            } else {
                std::array::from_fn(|c| (f64::from(a[c]) * (1.0 - part) + f64::from(b[c]) * part) as f32)
            });
        }
    }
    panorama.with_texels(texels)
}

fn clamped(panorama: &Panorama, most: f64) -> (Panorama, u64) {
    let mut count = 0;
    let texels = panorama
        .texels()
        .iter()
        .map(|texel| {
            let largest = f64::from(texel[0].max(texel[1]).max(texel[2]));
            if largest <= most {
                return *texel;
            }
            count += 1;
            texel.map(|v| (f64::from(v) * (most / largest)) as f32)
        })
        .collect();
    (panorama.with_texels(texels), count)
}

fn scaled(panorama: Panorama, factor: f64) -> Result<Panorama> {
    if factor == 1.0 {
        return Ok(panorama);
    }
    let texels: Vec<[f32; 3]> =
        panorama.texels().iter().map(|texel| texel.map(|v| (f64::from(v) * factor) as f32)).collect();
    if texels.iter().flatten().any(|v| !v.is_finite()) {
        return Err(Error::invalid(
            format!("values that times {factor:e} are beyond what an f32 holds"),
            "use a smaller --exposure or --scale",
        ));
    }
    Ok(panorama.with_texels(texels))
}

#[cfg(test)]
mod tests {
    use super::super::builtin::{builtin, sun_direction};
    use super::super::photometry::Photometry;
    use super::super::test_maps::random;
    use super::*;
    use glam::DVec3;
    use std::f64::consts::TAU;

    /// The angle between two turns.
    fn turn_between(a: f64, b: f64) -> f64 {
        let difference = (a - b).rem_euclid(TAU);
        difference.min(TAU - difference)
    }

    fn apply(adjustment: Adjustment, panorama: &Panorama) -> (Panorama, Adjusted) {
        adjustment.apply(panorama.clone()).expect("adjusts")
    }

    #[test]
    fn a_quarter_turn_brings_plus_z_to_plus_x() {
        let panorama = random(64, 5, None);
        let (turned, _) = apply(Adjustment { rotate: 90.0, ..Default::default() }, &panorama);
        let nudge = DVec3::new(0.01, 0.02, 0.01);
        for (old, new) in [(DVec3::Z, DVec3::X), (DVec3::X, DVec3::NEG_Z), (DVec3::NEG_X, DVec3::Z)] {
            let turn = glam::DQuat::from_rotation_y(90f64.to_radians());
            assert!((turn * old - new).length() < 1e-15);
            assert_eq!(panorama.radiance(old + nudge), turned.radiance(turn * (old + nudge)));
        }
        let (back, _) = apply(Adjustment { rotate: -90.0, ..Default::default() }, &turned);
        assert_eq!(back, panorama);
    }

    #[test]
    fn any_turn_keeps_every_rows_flux_and_moves_the_sun() {
        let panorama = builtin("sun", 256).unwrap();
        for degrees in [0.3, 17.77, 181.1, -45.03] {
            let (turned, _) = apply(Adjustment { rotate: degrees, ..Default::default() }, &panorama);
            for (a, b) in panorama.mean().into_iter().zip(turned.mean()) {
                assert!((a / b - 1.0).abs() < 1e-6, "{degrees}°: {a}, {b}"); // f32 of each texel
            }
            let (sun, _) = sun::extract(&turned).expect("a sun");
            let azimuth = |d: DVec3| d.z.atan2(d.x);
            let moved = azimuth(sun_direction()) - azimuth(DVec3::from(sun.direction));
            assert!(turn_between(moved, degrees.to_radians()) < 0.1 * TAU / 256.0, "{degrees}°: moved {moved}");
        }
    }

    #[test]
    fn illuminance_is_what_was_asked_for_whatever_the_unit() {
        let panorama = builtin("sky", 128).unwrap();
        for unit in [Unit::NitsPerUnit(1.0), Unit::NitsPerUnit(80.0), Unit::Efficacy(179.0)] {
            let asked = Adjustment { unit, illuminance: Some(1e5), exposure: 3.0, ..Default::default() };
            let (lit, adjusted) = apply(asked, &panorama);
            let got = Photometry::of(&lit, unit).horizontal_illuminance;
            assert!((got / 1e5 - 1.0).abs() < 1e-6, "{unit:?}: {got}");
            assert!(
                (f64::from(lit.texels()[0][0]) / f64::from(panorama.texels()[0][0]) / adjusted.factor - 1.0).abs()
                    < 1e-6
            );
        }
    }

    #[test]
    fn exposure_doubles_and_scale_multiplies() {
        let panorama = random(16, 3, None);
        let (brighter, adjusted) = apply(Adjustment { exposure: 2.0, scale: 0.5, ..Default::default() }, &panorama);
        assert_eq!(adjusted.factor, 2.0);
        assert!(brighter.texels().iter().flatten().zip(panorama.texels().iter().flatten()).all(|(a, b)| *a == 2.0 * b));
    }

    #[test]
    fn clamping_keeps_the_hue_and_reports_the_energy() {
        let mut texels = vec![[1.0_f32; 3]; 128];
        texels[40] = [200.0, 100.0, 50.0];
        let panorama = Panorama::new(16, 8, texels).unwrap();
        let (dimmed, adjusted) = apply(Adjustment { clamp: Some(20.0), ..Default::default() }, &panorama);
        assert_eq!((dimmed.texels()[40], adjusted.clamped), ([20.0, 10.0, 5.0], 1));
        for c in 0..3 {
            let lost = 1.0 - dimmed.mean()[c] / panorama.mean()[c];
            assert!(lost > 0.0 && (adjusted.energy_clamped[c] - lost).abs() < 1e-15);
        }
    }

    #[test]
    fn where_no_sun_stands_out_none_is_taken() {
        let white = builtin("white", 16).unwrap();
        let (left, adjusted) = apply(Adjustment { extract_sun: true, ..Default::default() }, &white);
        assert_eq!((left, adjusted.sun), (white, None));
    }

    #[test]
    fn nonsense_is_refused_with_a_way_out() {
        let white = builtin("white", 16).unwrap();
        let black = Panorama::new(16, 8, vec![[0.0; 3]; 128]).unwrap();
        let d = Adjustment::default();
        for (adjustment, panorama, says) in [
            (Adjustment { exposure: f64::NAN, ..d }, &white, "exposure NaN"),
            (Adjustment { scale: 0.0, ..d }, &white, "scale 0"),
            (Adjustment { scale: 1e39, ..d }, &white, "beyond what an f32 holds"),
            (Adjustment { clamp: Some(-1.0), ..d }, &white, "clamp -1"),
            (Adjustment { unit: Unit::Efficacy(0.0), ..d }, &white, "efficacy 0"),
            (Adjustment { illuminance: Some(100.0), ..d }, &black, "no factor"),
        ] {
            let error = adjustment.apply(panorama.clone()).expect_err(says).to_string();
            assert!(error.contains(says) && error.contains("; "), "{error}");
        }
    }
}
