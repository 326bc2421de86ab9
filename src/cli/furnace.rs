//! What a layered surface gains or loses in a white furnace, by each of the ways to dim its base.

use super::console::columns;
use kiln::Result;
use kiln::integrate::{Integration, Integrator, Settings};
use kiln::model::layered::Kd;
use kiln::table::quantity::Handle;
use kiln::table::{Model, Parameter, Point};

/// The albedo over a white base by every k_d, as a table for a person: what is off 1 is gained, or lost.
///
/// **Errors**: a missing parameter; a tolerance that is not reached.
pub fn table(layered: Handle, at: &Point, model: &Model, settings: Settings) -> Result<String> {
    let others = at.given().filter(|(parameter, _)| *parameter != Parameter::Rho);
    let white = others.chain([(Parameter::Rho, 1.0)]).try_fold(Point::default(), |p, (q, v)| p.with(q, v))?;
    let integration = Integration::new(Settings { integrator: Integrator::Quadrature, samples: None, ..settings })?;
    let cells: Vec<Vec<String>> = Kd::ALL
        .into_iter()
        .map(|kd| {
            let albedo = layered.evaluate(&white, &Model { kd, ..*model }, &integration)?;
            let off = albedo.value - 1.0;
            let verdict = match off {
                _ if off.abs() <= albedo.error => "keeps all",
                _ if off > 0.0 => "gains",
                _ => "loses",
            };
            Ok(vec![kd.name().to_owned(), format!("{:.12}", albedo.value), format!("{off:+.6}"), verdict.to_owned()])
        })
        .collect::<Result<_>>()?;
    Ok("\nin a white furnace, over a base of albedo 1:\n".to_owned() + &columns(&["kd", "albedo", "off 1", ""], &cells))
}
