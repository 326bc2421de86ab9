//! What engines leave empty: a channel of zeros between others.

use super::quantity::{Family, Identity, Model, Point, Quantity};
use crate::error::Result;
use crate::integrate::{Estimate, Integration};

/// `constant.zero`.
#[derive(Debug)]
pub struct Constant;

static CONSTANT: [Quantity; 1] = [Quantity {
    name: "constant.zero",
    summary: "0, for a channel that an engine leaves empty between others",
    definition: "0",
    source: "nobody's",
    parameters: &[],
    monotone: &[],
    bounds: (0.0, 0.0),
}];

impl Family for Constant {
    fn quantities(&self) -> &'static [Quantity] {
        &CONSTANT
    }

    fn quadrature(&self, _: &Point, _: &Model, _: f64) -> Result<Vec<Estimate>> {
        Ok(vec![Estimate::bound(0.0, 0.0)])
    }

    fn monte_carlo(&self, _: &Point, _: &Model, _: &Integration) -> Result<Vec<Estimate>> {
        Ok(vec![Estimate::bound(0.0, 0.0)])
    }

    fn is_pointwise(&self) -> bool {
        true
    }

    fn identities(&self, _: &Point, _: &Model) -> Vec<Identity> {
        vec![]
    }
}
