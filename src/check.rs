//! Checks: facts that a baked file must satisfy, with the figure found and the limit.
//!
//! The same checks run when a file is baked (on what will be written) and when it is verified (on what was read).

mod environment;
mod precision;
mod table;

pub(crate) use environment::Spread;
pub use environment::{CubeLevel, EnvironmentValues};
pub use precision::Precision;
pub use table::TableValues;

use serde::{Deserialize, Serialize};

/// One fact, checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// The fact.
    pub name: String,
    /// What it was checked on: a channel, a level.
    pub subject: String,
    /// What was found; the sentence of `name` says in which unit. NaN where nothing finite was found.
    #[serde(deserialize_with = "null_is_nan")]
    pub figure: f64,
    /// What the figure may be at most.
    pub limit: f64,
    /// Whether it is.
    pub passed: bool,
    /// Where the largest figure is, and over how many values it was looked for.
    pub detail: String,
}

/// JSON has no NaN: serde_json writes null for it.
fn null_is_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

impl Check {
    /// A fact that holds when `figure` is at most `limit`; a figure that is NaN fails.
    pub fn at_most(name: &str, subject: &str, figure: f64, limit: f64, detail: impl Into<String>) -> Self {
        let passed = figure <= limit;
        Self { name: name.to_owned(), subject: subject.to_owned(), figure, limit, passed, detail: detail.into() }
    }
}

/// Texels at which the other witness is asked.
pub const WITNESS_POINTS: usize = 64;
/// Standard errors that a random value may be off by. For 32 replicates the estimated standard error follows Student's t of 31 degrees: one value
/// in 70,000 is further off than 5; 64 points of a few channels give one false alarm in some hundred bakes, so 6 (one in 10⁶).
pub const SIGMAS: f64 = 6.0;

/// `n` numbers in [0, 1) that reach every part of it, whatever `n`: a Weyl sequence from a start that the seed names.
fn weyl(seed: u64, n: usize) -> impl Iterator<Item = f64> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let start = (seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 11) as f64 / (1_u64 << 53) as f64;
    (0..n).map(move |i| (start + i as f64 * GOLDEN).fract())
}
