//! Mathematics that knows nothing of light: point sets, quadrature rules, frames, warps of axes, statistics.

pub mod exact;
pub mod fit;
pub mod frame;
pub mod quadrature;
pub mod sobol;
pub mod statistics;
pub mod warp;
