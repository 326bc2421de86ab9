//! Kiln bakes, prefilters and verifies the lookup tables of real-time rendering.
//!
//! A baked file is *quantities × axes × packing × container*. The modules, from the ground up (none imports one above it):
//!
//! | floor | modules |
//! | --- | --- |
//! | ground | [`math`] (points, rules, frames, warps), [`colour`] (primaries), [`pack`] (texel formats), [`language`] (of shaders), [`error`] |
//! | 1 | [`model`] (lobes and Fresnel), [`material`] (reflectances by name), [`mod@format`] (containers) |
//! | 2 | [`integrate`] (estimates, both witnesses), [`environment`] (panoramas, cubes, filters) |
//! | 3 | [`table`] (quantities, axes, tables) |
//! | 4 | [`recipe`] (what to bake) |
//! | 5 | [`engine`] (what each engine reads); [`check`], [`certificate`] (facts about a file), [`claim`] (what a file is said to hold) |
//! | 6 | [`shader`] (code that looks up what was baked) |
//! | 7 | [`bake`], [`identify`], [`compare`], [`verify`], [`convert`] |
//! | 8 | [`report`] (previews) |
//!
//! # Units
//!
//! Angles are radians, solid angles steradians, values linear. Quantities of radiometry, and their photometric twins, which weigh every
//! wavelength as the eye does:
//!
//! | | radiometric | | photometric | |
//! | --- | --- | --- | --- | --- |
//! | Q | energy | J | luminous energy | lm·s |
//! | Φ = dQ/dt | flux (power) | W | luminous flux | lm |
//! | I = dΦ/dω | intensity | W/sr | luminous intensity | cd = lm/sr |
//! | E = dΦ/dA | irradiance | W/m² | illuminance | lx = lm/m² |
//! | L = dΦ/(dω dA cosθ) | radiance | W/(sr·m²) | luminance | cd/m² |
//!
//! An environment map is L of a direction, E = ∫ L cosθ dω what a surface receives of it. A BRDF is dL_o/dE, in 1/sr; an albedo, the part of
//! the flux that comes back, has no unit. A watt is 683 lm at a
//! wavelength of 555 nm and less at every other.
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
pub mod claim;
pub mod colour;
pub mod compare;
pub mod convert;
pub mod engine;
pub mod environment;
pub mod error;
pub mod format;
pub mod identify;
pub mod integrate;
pub mod language;
pub mod material;
pub mod math;
pub mod model;
pub mod pack;
pub mod recipe;
pub mod report;
pub mod shader;
pub mod table;
pub mod verify;

pub use error::{Error, Result};
