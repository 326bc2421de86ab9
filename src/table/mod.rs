//! Tables: quantities × axes, integrated texel by texel.
//!
//! [`quantity`] says what can be in a channel, [`axis`] which parameter a texel stands for, [`TableSpec::bake`] integrates, and [`named`] lists
//! the tables that have a name. One file per family of quantities computes: [`ggx`], [`beckmann`], [`charlie`], [`dielectric`],
//! [`lambert`].

pub mod axis;
mod bake;
pub mod beckmann;
pub mod charlie;
pub mod dielectric;
pub mod ggx;
pub mod lambert;
pub mod lookup;
pub mod named;
pub mod quantity;

pub use axis::{Axis, Sampling};
pub use bake::{Evaluator, Progress, Table, TableSpec};
pub use quantity::{Family, Model, Parameter, Point, Quantity};
