//! Mathematics that knows nothing of light: point sets, quadrature rules, frames, warps of axes, memos, statistics.

pub mod exact;
pub mod expression;
pub mod fit;
pub mod frame;
pub mod memo;
pub mod quadrature;
pub mod sobol;
pub mod statistics;
pub mod warp;
