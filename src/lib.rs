//! Kiln bakes, prefilters and verifies the lookup tables of real-time rendering.
//!
//! A baked file is *quantities × axes × packing × container*. The modules, from the ground up (none imports one above it):
//!
//! | floor | modules |
//! | --- | --- |
//! | ground | [`math`] (points, rules, frames, warps), [`pack`] (texel formats), [`error`] |
//! | 1 | [`model`] (lobes and Fresnel), [`material`] (reflectances by name), [`mod@format`] (containers) |
//! | 2 | [`integrate`] (estimates, both witnesses), [`environment`] (panoramas, cubes, filters) |
//! | 3 | [`table`] (quantities, axes, tables) |
//! | 4 | [`recipe`] (what to bake) |
//! | 5 | [`check`], [`certificate`] (facts about a file) |
//! | 6 | [`bake`], [`verify`] |
//! | 7 | [`report`] (previews) |
//!
//! # Example
//!
//! ```
//! use kiln::integrate::{Integration, Settings};
//! use kiln::table::{Model, Parameter, Point, quantity};
//!
//! let at = Point::default().with(Parameter::Mu, 0.5)?.with(Parameter::Roughness, 1.0)?;
//! let albedo = quantity::find("ggx.albedo")?;
//! let e = albedo.evaluate(&at, &Model::default(), &Integration::new(Settings::default())?)?;
//! let closed_form = 1.0 - 0.5 * 3.0_f64.ln();
//! assert!((e.value - closed_form).abs() <= e.error);
//! # Ok::<(), kiln::Error>(())
//! ```

pub mod bake;
pub mod certificate;
pub mod check;
pub mod environment;
pub mod error;
pub mod format;
pub mod integrate;
pub mod material;
pub mod math;
pub mod model;
pub mod pack;
pub mod recipe;
pub mod report;
pub mod table;
pub mod verify;

pub use error::{Error, Result};
