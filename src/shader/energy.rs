//! What a shader does with a specular table: reflectance, and the energy that single scattering loses.
//!
//! The formulas are those of [`crate::table::compensation`], with the reflectance F0 of a coloured surface.

use super::code::{Function, Item, Statement, Type};
use crate::math::expression::literal;
use crate::model::fresnel::{MU_82, f82_dip, schlick_weight};

/// The lobes whose tables these formulas are for.
const LOBES: [&str; 2] = ["ggx", "beckmann"];

/// The average of Schlick's reflectance.
const F_AVG: &str = "(f0 * 20.0 + 1.0) * (1.0 / 21.0)";

/// The functions that the quantities of a table are enough for.
pub(super) fn items(name: &str, quantities: &[&str], fields: &[String]) -> Vec<Item> {
    let mut items = vec![];
    for lobe in LOBES {
        let field = |quantity: &str| {
            let at = quantities.iter().position(|q| *q == format!("{lobe}.{quantity}"))?;
            Some(format!("values.{}", fields[at]))
        };
        let split = field("scale").zip(field("bias"));
        let albedo = field("albedo").or_else(|| split.as_ref().map(|(scale, bias)| format!("({scale} + {bias})")));
        if let Some((scale, bias)) = &split {
            items.push(reflectance(name, scale, bias));
            if let Some(f82) = field("f82") {
                items.push(metal_reflectance(name, scale, bias, &f82));
            }
            if let Some(e) = &albedo {
                items.push(fdez_aguera(name, e));
            }
        }
        if let Some(e) = &albedo {
            items.extend([turquin(name, e), kulla_conty(name, e)]);
        }
        if !items.is_empty() {
            break; // a table of two lobes has the functions of the first: their names would be the same
        }
    }
    items
}

fn function(name: &str, end: &str, comment: &str, parameters: &[(&str, Type)], body: Vec<Statement>) -> Item {
    let values = ("values".to_owned(), Type::Struct(format!("{name}_values")));
    let others = parameters.iter().map(|(name, of)| ((*name).to_owned(), of.clone()));
    Item::Function(Function {
        comment: comment.to_owned(),
        name: format!("{name}_{end}"),
        parameters: [values].into_iter().chain(others).collect(),
        result: Type::Vec3,
        body,
    })
}

fn colour(name: &str, value: &str) -> Statement {
    Statement::Let(name.to_owned(), Type::Vec3, value.to_owned())
}

fn reflectance(name: &str, scale: &str, bias: &str) -> Item {
    let body = vec![Statement::Return(format!("f0 * {scale} + {bias}"))];
    let comment = "Reflectance under a uniform environment, by Schlick's approximation: F0 scale + bias.";
    function(name, "reflectance", comment, &[("f0", Type::Vec3)], body)
}

fn metal_reflectance(name: &str, scale: &str, bias: &str, f82: &str) -> Item {
    let fc = schlick_weight(MU_82);
    let body = vec![
        colour("at_82", &format!("f0 * {} + {}", literal(1.0 - fc), literal(fc))),
        Statement::Return(format!(
            "f0 * {scale} + {bias} - (1.0 - f82) * at_82 * ({f82} * {})",
            literal(1.0 / f82_dip(MU_82))
        )),
    ];
    let comment = "The same of a metal: f82 is what is left of Schlick's reflectance at 82 degrees, 1 for all of it.";
    function(name, "metal_reflectance", comment, &[("f0", Type::Vec3), ("f82", Type::Vec3)], body)
}

fn turquin(name: &str, e: &str) -> Item {
    let body = vec![Statement::Return(format!("1.0 + f0 * (1.0 / {e} - 1.0)"))];
    let comment = "What to multiply single scattering by so that no energy is lost (Turquin 2019): 1 + F0 (1/E - 1).\nFor lights and \
                   for the environment.";
    function(name, "turquin", comment, &[("f0", Type::Vec3)], body)
}

fn fdez_aguera(name: &str, e: &str) -> Item {
    let body = vec![
        Statement::Let("lost".to_owned(), Type::Float, format!("1.0 - {e}")),
        colour("f_avg", F_AVG),
        colour("single", &format!("{name}_reflectance(values, f0)")),
        Statement::Return("single + single * f_avg * lost / (1.0 - f_avg * lost)".to_owned()),
    ];
    let comment = "Reflectance with multiple scattering under a uniform environment (Fdez-Aguera 2019).";
    function(name, "fdez_aguera", comment, &[("f0", Type::Vec3)], body)
}

fn kulla_conty(name: &str, e: &str) -> Item {
    let body = vec![
        colour("f_avg", F_AVG),
        Statement::Return(format!("f_avg * f_avg * ((1.0 - {e}) * e_avg) / (1.0 - f_avg * (1.0 - e_avg))")),
    ];
    let comment = "What multiple scattering adds under a uniform environment (Kulla and Conty 2017, Hill's factor); e_avg is the\naverage \
                   albedo at this roughness. For a light: times (1 - E(NoL)) / (pi (1 - e_avg)) is the BRDF to add.";
    function(name, "kulla_conty", comment, &[("e_avg", Type::Float), ("f0", Type::Vec3)], body)
}
