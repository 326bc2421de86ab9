//! Lambert's irradiance as a cube: E(n)/π, what a white matte surface facing n shows.

use super::chain::{ChainSpec, Filter, LevelReport, check_irradiance, lambert};
use super::cube::Cube;
use super::panorama::Panorama;
use crate::error::Result;

/// Irradiance divided by π for every direction of a cube: the filter at alpha = 1, where its kernel is max(c, 0)/π.
///
/// `spec` gives size, samples, seed and integrator; its roughness list is not read.
///
/// **Errors**: a size of zero.
pub fn irradiance_cube(
    panorama: &Panorama,
    spec: &ChainSpec,
    finished: &(dyn Fn(u64) + Sync),
) -> Result<(Cube, LevelReport)> {
    check_irradiance(spec.size)?;
    Ok(Filter::new(panorama, spec, &[lambert()]).level(spec.size, 1.0, Some(lambert()), finished))
}
