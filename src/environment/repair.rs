//! What is wrong with the values of an input, what becomes of it, and the light that it costs or adds.

use serde::{Deserialize, Serialize};

use glam::DVec3;

use super::layout::Layout;
use crate::colour::{Primaries, TargetColour};
use crate::error::{Error, Result};

/// What becomes of NaN and infinities in an input.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NonFinite {
    /// Refuse the input and say where the first one is.
    #[default]
    Error,
    /// Replace each by zero, and count them.
    Zero,
}

/// What becomes of negative radiance in an input (lossy compression makes it, beside suns).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Negatives {
    /// Keep it, and count it.
    #[default]
    Keep,
    /// Replace each value by zero, and count them.
    Clamp,
}

/// What was read, what was wrong with its values, and what was changed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct InputReport {
    /// What it was read as.
    pub layout: Layout,
    /// Width and height of the panorama, or of a face.
    pub size: [usize; 2],
    /// Values that were NaN or infinite, and are zero now.
    pub nonfinite: u64,
    /// Values below zero, kept or set to zero as the policy says.
    pub negative: u64,
    /// The smallest finite value of the input.
    pub min: f32,
    /// Values below zero that the conversion to other primaries made, kept or set to zero alike.
    pub out_of_gamut: u64,
    /// ∫ L dω of each channel as found (NaN and infinities count as zero), in the primaries of the result.
    pub flux_found: [f64; 3],
    /// The same of the result: what differs is the policies' doing.
    pub flux: [f64; 3],
    /// The primaries that the input states; none where it does not, which means Rec. 709.
    pub stated: Option<Primaries>,
    /// The primaries of the result.
    pub primaries: Primaries,
}

impl InputReport {
    /// The largest change of a channel's flux, in parts of the flux as found, and the channel.
    pub fn worst_flux_change(&self) -> (f64, usize) {
        let change = |c: usize| {
            let [before, after] = [self.flux_found[c], self.flux[c]];
            if before == after { 0.0 } else { (after - before) / before.abs() }
        };
        (0..3)
            .map(|c| (change(c), c))
            .fold((0.0, 0), |most, next| if next.0.abs() > most.0.abs() { next } else { most })
    }
}

/// What is done with values that are wrong, and with their colour.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Policy {
    pub nonfinite: NonFinite,
    pub negatives: Negatives,
    pub to: TargetColour,
}

/// Repairs the texels and converts their colour. `angles` are the solid angles of as many runs of `run` texels, and then again; `grey` tells that all three channels
/// are one, which is then counted once; `place` is where an index is, in words.
pub(super) fn repair(
    texels: &mut [[f32; 3]],
    policy: Policy,
    stated: Option<Primaries>,
    grey: bool,
    (angles, run): (&[f64], usize),
    place: impl Fn(usize) -> String,
) -> Result<InputReport> {
    // (All three channels of grey are alike.)
    let once = |count: usize| (if grey { count / 3 } else { count }) as u64;
    let nonfinite = once(texels.as_flattened().iter().filter(|v| !v.is_finite()).count());
    if nonfinite > 0 && policy.nonfinite == NonFinite::Error {
        return Err(refusal(nonfinite, texels, place));
    }
    if nonfinite > 0 {
        texels.iter_mut().flatten().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
    }
    let found = flux(texels, angles, run);
    let min = texels.as_flattened().iter().fold(f32::INFINITY, |least, &v| if v < least { v } else { least });
    let negative = if min < 0.0 { once(texels.as_flattened().iter().filter(|v| **v < 0.0).count()) } else { 0 };
    // Before the conversion, which would spread a false -3894 of one channel over all three.
    clamp(texels, policy.negatives);

    let from = stated.unwrap_or_default();
    let primaries = policy.to.primaries(from);
    let matrix = from.conversion_to(&primaries);
    let (mut out_of_gamut, mut flux_found) = (0, found);
    // White is white in all primaries: grey needs no conversion, and keeps its bits.
    if from != primaries && !grey {
        flux_found = (matrix * DVec3::from_array(found)).to_array();
        for texel in texels.iter_mut() {
            let was_negative = texel.iter().any(|&v| v < 0.0);
            let converted = matrix * DVec3::from_array(texel.map(f64::from));
            *texel = converted.to_array().map(|v| v as f32);
            out_of_gamut += if was_negative { 0 } else { texel.iter().filter(|&&v| v < 0.0).count() as u64 };
        }
        clamp(texels, policy.negatives);
        if let Some(lost) = texels.iter().flatten().position(|v| !v.is_finite()) {
            return Err(Error::unsupported(
                format!("the value of {} is beyond the range of f32 in {primaries}", place(lost / 3)),
                "use --to keep",
            ));
        }
    }
    let kept = negative == 0 || policy.negatives == Negatives::Keep;
    let flux = if kept && (from == primaries || grey) { found } else { flux(texels, angles, run) };
    let min = if min.is_finite() { min } else { 0.0 };
    Ok(InputReport {
        nonfinite,
        negative,
        min,
        out_of_gamut,
        flux_found,
        flux,
        stated,
        primaries,
        ..InputReport::default()
    })
}

fn clamp(texels: &mut [[f32; 3]], negatives: Negatives) {
    if negatives == Negatives::Clamp {
        texels.iter_mut().flatten().filter(|v| **v < 0.0).for_each(|v| *v = 0.0);
    }
}

fn flux(texels: &[[f32; 3]], angles: &[f64], run: usize) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (texels, weight) in texels.chunks(run).zip(angles.iter().cycle()) {
        for texel in texels {
            (0..3).for_each(|c| sum[c] += f64::from(texel[c]) * weight);
        }
    }
    sum
}

fn refusal(count: u64, texels: &[[f32; 3]], place: impl Fn(usize) -> String) -> Error {
    let first = texels.iter().flatten().position(|v| !v.is_finite()).unwrap_or(0);
    let channel = ["red", "green", "blue"][first % 3];
    Error::invalid(
        format!(
            "input holds {count} values that are NaN or infinite, the first in the {channel} of {}",
            place(first / 3)
        ),
        "repair the file, or use --nonfinite zero",
    )
}
