//! Tables: quantities × axes, integrated texel by texel.
//!
//! [`quantity`] says what can be in a channel, [`parameter`] what it depends on, [`transform`] what becomes of it there, [`axis`] which parameter a texel stands for, [`layout`] where it lies in a file, [`TableSpec::bake`] integrates, [`rounding`]
//! makes sure of the packed value, and [`named`]
//! lists the tables that have a name. One file per family of quantities computes: [`ggx`], [`anisotropic`], [`beckmann`], [`charlie`], [`dielectric`], [`schlick_dielectric`], [`generalized_schlick`],
//! [`conductor`], [`diffuse`], [`fresnel`], [`lambert`], [`layered`], [`compensation`], [`ltc`], [`constant`]; [`specular`] holds what two of them share.

pub mod anisotropic;
pub mod axis;
mod bake;
pub mod beckmann;
pub mod charlie;
pub mod compensation;
pub mod conductor;
pub mod constant;
pub mod dielectric;
pub mod diffuse;
pub mod fit;
pub mod fresnel;
pub mod generalized_schlick;
pub mod ggx;
pub mod lambert;
pub mod layered;
pub mod layout;
pub mod lookup;
pub mod ltc;
pub mod named;
mod near;
pub mod parameter;
pub mod quantity;
pub mod rounding;
pub mod schlick_dielectric;
pub mod specular;
pub mod transform;

pub use axis::{Axis, Sampling};
pub use bake::{Evaluator, Progress, Table, TableSpec};
pub use layout::{Arrangement, Layout};
pub use quantity::{Family, Model, Parameter, Point, Quantity, Trend};
pub use transform::Transform;
