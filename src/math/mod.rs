//! Mathematics that knows nothing of light: point sets, quadrature rules, warps, frames, sums.

pub mod sobol;
