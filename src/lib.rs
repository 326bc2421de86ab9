//! Kiln bakes, prefilters and verifies the lookup tables of real-time rendering.

pub mod environment;
pub mod error;
pub mod format;
pub mod integrate;
pub mod math;
pub mod model;
pub mod pack;
pub mod table;

pub use error::{Error, Result};
