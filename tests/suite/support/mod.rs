//! What several integration tests share.
#![allow(dead_code)] // every test file uses its part
#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

pub mod atlas;
pub mod bilinear;
pub mod browser;
pub mod directions;
pub mod f32_error;
pub mod hlsl;
pub mod kiln;
pub mod memory;
pub mod room;
pub mod samples;
pub mod tools;
