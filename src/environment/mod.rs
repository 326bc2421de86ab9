//! Environment maps: what a baker turns a panorama into.
//!
//! An input ([`load`]: a file, six files, a built-in environment) is read as a panorama or as a cube ([`layout`]), repaired and brought to
//! one set of primaries ([`repair`]), a cube turned into a panorama ([`mod@from_cube`]).
//!
//! The panorama is piecewise constant over its texels, with exact solid angles ([`panorama`]); [`Adjustment`] turns, exposes and
//! calibrates it ([`photometry`]). From it come the area average of mip 0 ([`mod@area_average`]), the GGX-prefiltered levels
//! ([`chain`], with one of several kernels: [`kernel`]) by spherical harmonics ([`zonal`]) or by one of two witnesses ([`monte_carlo`], which also sees lobes that are no kernels ([`view_lobe`]), and [`full_sum`]), the Lambert
//! irradiance ([`irradiance`]) and nine spherical-harmonic coefficients
//! ([`spherical_harmonics`]), or those of more bands ([`sh_bands`]); [`sh_convention`] and [`orientation`] bring them to the form that an
//! engine reads. Chains and irradiance are cubes, or lie on a square ([`octahedral`]), in a panorama ([`equirect`]) or in the tiles of an [`atlas`]: [`SphereLayout`].

mod adjust;
pub mod area_average;
pub mod atlas;
pub mod builtin;
mod cells;
pub mod chain;
mod coverage;
pub mod cube;
pub mod equirect;
mod face_files;
mod fit;
pub mod from_cube;
pub mod full_sum;
pub mod irradiance;
pub mod kernel;
pub mod layout;
pub mod monte_carlo;
pub mod nonnegative;
pub mod octahedral;
pub mod orientation;
mod orientation_map;
mod overlap;
pub mod panorama;
mod peel;
pub mod photometry;
mod raw;
pub mod repair;
mod sampler;
pub mod seamless;
pub mod sh_bands;
pub mod sh_convention;
pub mod sky;
mod source;
mod sphere_map;
pub mod spherical_harmonics;
mod sun;
mod sun_disc;
#[cfg(test)]
mod test_maps;
pub mod view_lobe;
pub mod zonal;

pub use crate::math::fit::Fit;
pub use adjust::{Adjusted, Adjustment};
pub use area_average::area_average;
pub use builtin::{BUILTINS, Builtin, builtin};
pub use chain::{
    Chain, ChainSpec, DARK_FLOOR, LevelReport, chain_and_irradiance, error_scale, relative_error, specular_chain,
};
pub use cube::Cube;
pub use fit::CubeFit;
pub use from_cube::from_cube;
pub use full_sum::FullSum;
pub use irradiance::irradiance_cube;
pub use kernel::{Kernel, KernelKind};
pub use layout::{InputLayout, Layout};
pub use monte_carlo::{Estimate, Filtered, MonteCarlo};
pub use orientation::Orientation;
pub use panorama::{Panorama, luminance};
pub use photometry::{Photometry, Unit};
pub use repair::{InputReport, Negatives, NonFinite};
pub use seamless::CubeLookup;
pub use sh_convention::ShConvention;
pub use source::{BUILTIN_PREFIX, Reading, load};
pub use sphere_map::{SphereLayout, SphereMap};
pub use spherical_harmonics::SphericalHarmonics;
pub use sun::{Sun, extract as extract_sun};
pub use view_lobe::{View, ViewLobe, ViewMonteCarlo};
pub use zonal::{InstructionSet, Zonal};
