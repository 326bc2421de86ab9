//! What several integration tests share.
#![allow(dead_code)] // every test file uses its part

pub mod kiln;
pub mod samples;
pub mod tools;
