//! Irradiance from nine coefficients.

use super::code::{Function, Item, Statement, Type};
use crate::certificate::ShFits;
use crate::environment::spherical_harmonics::{SphericalHarmonics, normalisation};
use crate::math::expression::literal;

/// The polynomials in a unit direction `normal`, in the order of `sh.json`.
const POLYNOMIALS: [&str; 9] = [
    "",
    "normal.y",
    "normal.z",
    "normal.x",
    "(normal.x * normal.y)",
    "(normal.y * normal.z)",
    "(3.0 * normal.z * normal.z - 1.0)",
    "(normal.x * normal.z)",
    "(normal.x * normal.x - normal.y * normal.y)",
];

/// The function of coefficients that the application hands over, and, where they are known, the function with them written in.
pub(super) fn items(name: &str, known: Option<(&SphericalHarmonics, Option<ShFits>)>) -> Vec<Item> {
    let norm = normalisation();
    let given = std::array::from_fn(|i| format!("coefficients[{i}] * {}", literal(norm[i])));
    let mut items = vec![function(
        &format!("{name}_sh_of"),
        "Irradiance over pi in a unit direction, of coefficients as sh.json has them: irradiance_over_pi or\n\
         irradiance_over_pi_nonnegative.",
        &[("coefficients", Type::NineColours), ("normal", Type::Vec3)],
        &given,
    )];
    if let Some((sh, fits)) = known {
        let coefficients = &sh.irradiance_over_pi_nonnegative;
        let written = std::array::from_fn(|i| {
            let [r, g, b] = coefficients[i].map(|c| literal(c * norm[i]));
            format!("vec3({r}, {g}, {b})")
        });
        let fit = fits.map_or_else(String::new, |fits| {
            format!("\nOff by {:.1} % RMS from the exact irradiance.", 100.0 * fits.nonnegative.rms_error)
        });
        items.push(function(
            &format!("{name}_sh"),
            &format!(
                "Irradiance over pi in a unit direction, of the nine coefficients that are negative nowhere.{fit}"
            ),
            &[("normal", Type::Vec3)],
            &written,
        ));
    }
    items
}

fn function(name: &str, comment: &str, parameters: &[(&str, Type)], coefficients: &[String; 9]) -> Item {
    let terms: Vec<String> = coefficients
        .iter()
        .zip(POLYNOMIALS)
        .map(|(c, p)| if p.is_empty() { c.clone() } else { format!("{c} * {p}") })
        .collect();
    Item::Function(Function {
        comment: comment.to_owned(),
        name: name.to_owned(),
        parameters: parameters.iter().map(|(name, of)| ((*name).to_owned(), of.clone())).collect(),
        result: Type::Vec3,
        body: vec![Statement::Return(terms.join("\n        + "))],
    })
}
