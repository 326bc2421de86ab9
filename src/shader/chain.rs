//! Looking up an environment: which level, in which direction.

use super::code::{Function, Item, Statement, Type};
use super::flat::{Lookup, Map};
use super::{Shader, harmonics, packing};
use crate::certificate::Certificate;
use crate::environment::spherical_harmonics::SphericalHarmonics;
use crate::environment::{Orientation, SphereLayout};
use crate::error::{Error, Result};
use crate::math::expression::{Expression, literal};
use crate::recipe::{EnvironmentRecipe, IrradianceKind};

/// The level at which a chain has a roughness, as code of `roughness`: exact at every level, and linear in the roughness between two.
///
/// Roughness is the variable to be linear in: of r, r^1.5, r², r³, r⁴ and r (2 − r), the blend of two levels came nearest to the filter
/// between them with r or r (2 − r), within 1.6 times the error of the best blend for environments whose power falls with l² or l³.
/// The latter is what a chain of the roughnesses 1 − √(1 − m/L) asks for, and has.
///
/// **Errors**: roughness that falls somewhere, or no level.
pub fn level_of_roughness(levels: &[f64]) -> Result<Expression> {
    let roughness = Expression::variable("roughness");
    let (Some(&first), last) = (levels.first(), levels.len().saturating_sub(1)) else {
        return Err(Error::usage(
            "a chain without levels",
            "give one roughness per level, such as --roughness 0,0.5,1",
        ));
    };
    if let Some(pair) = levels.windows(2).find(|pair| pair[1] < pair[0]) {
        return Err(Error::usage(
            format!("roughness falls from {} to {} in the chain, so none has a level of its own", pair[0], pair[1]),
            "give levels whose roughness rises",
        ));
    }
    if last == 0 {
        return Ok(0.0.into());
    }
    let n = last as f64;
    /// Roughnesses closer than this are the same: written with a few digits, they mean the formula.
    const SAME: f64 = 1e-6;
    let all =
        |formula: &dyn Fn(f64) -> f64| levels.iter().enumerate().all(|(m, r)| (r - formula(m as f64 / n)).abs() < SAME);
    if all(&|t| first + t * (levels[last] - first)) && levels[last] > first {
        return Ok(((roughness - first) * (n / (levels[last] - first))).clamp(0.0, n));
    }
    if all(&|t| 1.0 - (1.0 - t).sqrt()) {
        let r = || roughness.clone().clamp(0.0, 1.0);
        return Ok(r() * (Expression::from(2.0) - r()) * n);
    }
    let steps = levels.windows(2).map(|pair| match pair[1] - pair[0] {
        // Two levels of one roughness: from there on, the smaller one.
        0.0 => roughness.clone().step(pair[0]),
        width => ((roughness.clone() - pair[0]) * (1.0 / width)).clamp(0.0, 1.0),
    });
    Ok(steps.fold(0.0.into(), |sum: Expression, step| sum + step))
}

pub(super) fn shader(
    name: &str,
    recipe: &EnvironmentRecipe,
    certificate: &Certificate,
    sh: Option<&SphericalHarmonics>,
) -> Result<Shader> {
    let function = |end: &str, comment: &str, parameters: &[(&str, Type)], result: Type, body: Vec<Statement>| {
        Item::Function(Function {
            comment: comment.to_owned(),
            name: format!("{name}_{end}"),
            parameters: parameters.iter().map(|(name, of)| ((*name).to_owned(), of.clone())).collect(),
            result,
            body,
        })
    };
    let value = |value: String| vec![Statement::Return(value)];
    let roughness = recipe.level_roughness();
    let level = level_of_roughness(&roughness)?;
    let [specular_texel, irradiance_texel] = [recipe.format, recipe.format_of_irradiance()].map(|f| f.texel(3));
    let (specular_texel, irradiance_texel) = (specular_texel?, irradiance_texel?);
    let specular_decoder = packing::decoder(name, "decode", specular_texel);
    // A cube of irradiance may be packed in its own way.
    let (irradiance_decode, irradiance_decoder) = match recipe.irradiance {
        IrradianceKind::Cube if irradiance_texel != specular_texel => {
            let decoder = packing::decoder(name, "decode_irradiance", irradiance_texel);
            (decoder.is_some().then_some("decode_irradiance"), decoder)
        }
        _ => (specular_decoder.is_some().then_some("decode"), None),
    };
    let lookup = Lookup { name, layout: recipe.layout };
    let sizes = (0..roughness.len()).map(|level| recipe.size >> level).collect();
    let specular = Map { texture: "specular", decode: specular_decoder.is_some().then_some("decode"), sizes };
    let own = Map { texture: "irradiance", decode: irradiance_decode, sizes: vec![recipe.irradiance_size] };
    let mut items: Vec<Item> = [specular_decoder, irradiance_decoder].into_iter().flatten().collect();
    let (noun, is_atlas) = (recipe.layout.noun(), recipe.layout == SphereLayout::Atlas);
    items.extend([
        function(
            "direction",
            &format!(
                "The vector to look up in the {} for a direction of the world, which is right-handed, +Y up.",
                recipe.layout.plural()
            ),
            &[("direction", Type::Vec3)],
            Type::Vec3,
            value(lookup_vector(&recipe.orientation)),
        ),
        function(
            "level",
            &format!(
                "The level of the specular {noun} that is filtered for a roughness (of the artist's kind: alpha = roughness^2)."
            ),
            &[("roughness", Type::Float)],
            Type::Float,
            value(level.to_string()),
        ),
    ]);
    let with_own = recipe.irradiance == IrradianceKind::Cube;
    items.extend(lookup.items(&[&specular, if with_own { &own } else { &specular }]));
    items.push(function(
        "specular",
        "The environment in a mirror direction as a surface of that roughness reflects it.",
        &[("specular", lookup.texture()), ("mirror", Type::Vec3), ("roughness", Type::Float)],
        Type::Vec3,
        lookup.body(&specular, "mirror", &format!("{name}_level(roughness)")),
    ));
    if is_atlas {
        items.push(function(
            "mirror",
            "The environment in a direction, level `mip` of the mirror's sizes: where pixels look p texels of the largest apart, log2(p).",
            &[("specular", lookup.texture()), ("direction", Type::Vec3), ("mip", Type::Float)],
            Type::Vec3,
            lookup.mirror_tiles(&specular),
        ));
    }
    items.extend(harmonics::items(name, sh.map(|sh| (sh, certificate.sh))));
    let last = roughness.len().saturating_sub(1);
    items.extend(match recipe.irradiance {
        IrradianceKind::Cube if is_atlas => Some(function(
            "irradiance",
            "Irradiance over pi, of the atlas' tile of it: times the albedo it is what a diffuse surface reflects.",
            &[("specular", lookup.texture()), ("normal", Type::Vec3)],
            Type::Vec3,
            lookup.irradiance_tile("specular"),
        )),
        IrradianceKind::Cube => Some(function(
            "irradiance",
            &format!("Irradiance over pi, of the irradiance {noun}: times the albedo it is what a diffuse surface reflects."),
            &[("irradiance", lookup.texture()), ("normal", Type::Vec3)],
            Type::Vec3,
            lookup.body(&own, "normal", "0.0"),
        )),
        IrradianceKind::LastLevel => Some(function(
            "irradiance",
            &format!(
                "What stands for irradiance over pi: the last level of the specular {noun}, of roughness {}. Irradiance itself is of\n\
                 roughness 1.",
                literal(roughness[last])
            ),
            &[("specular", lookup.texture()), ("normal", Type::Vec3)],
            Type::Vec3,
            lookup.body(&specular, "normal", &literal(last as f64)),
        )),
        // Nothing is known of coefficients that the application hands over: they have their own function.
        IrradianceKind::Sh => sh.map(|_| {
            function(
                "irradiance",
                "Irradiance over pi: times the albedo it is what a diffuse surface reflects.",
                &[("normal", Type::Vec3)],
                Type::Vec3,
                value(format!("{name}_sh(normal)")),
            )
        }),
        IrradianceKind::None => None,
    });
    Ok(Shader { head: head(recipe, certificate, &lookup), items })
}

/// The vector to look up for the world's `direction`: the inverse of what the cube was turned by.
fn lookup_vector(orientation: &Orientation) -> String {
    if orientation.is_identity() {
        return "direction".to_owned();
    }
    let mut lookup = [const { String::new() }; 3];
    for (component, (axis, sign)) in ["x", "y", "z"].into_iter().zip(orientation.components()) {
        lookup[axis] = format!("{}direction.{component}", if sign < 0.0 { "-" } else { "" });
    }
    format!("vec3({})", lookup.join(", "))
}

fn head(recipe: &EnvironmentRecipe, certificate: &Certificate, lookup: &Lookup) -> String {
    let noun = recipe.layout.noun();
    let mut head = format!(
        "The environment {}, {}; code by Kiln {}, from their certificate.\n\n",
        recipe.input,
        match (recipe.format, recipe.format_of_irradiance()) {
            (own, other) if recipe.irradiance == IrradianceKind::Cube && own != other =>
                format!("specular {noun} of {own}, irradiance {noun} of {other}"),
            (own, _) if recipe.layout == SphereLayout::Atlas => format!("{noun} of {own}"),
            (own, _) if recipe.irradiance == IrradianceKind::Cube => format!("{} of {own}", recipe.layout.plural()),
            (own, _) => format!("specular {noun} of {own}"),
        },
        env!("CARGO_PKG_VERSION")
    );
    for level in &certificate.levels {
        let ([width, height], _) = recipe.layout.shape(level.size);
        head += &format!(
            "{}: {width} x {height}, roughness {}, texels within {:.1e} of max(value, 1e-3 of the mean)\n",
            level.name, level.roughness, level.max_error
        );
    }
    head + &format!("\nSampler: {}\n", lookup.sampler())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(levels: &[f64], roughness: f64) -> f64 {
        level_of_roughness(levels).expect("a chain").evaluate(&|_| roughness)
    }

    #[test]
    fn every_level_is_found_at_its_own_roughness() {
        let quadratic: Vec<f64> = (0..5).map(|m| 1.0 - (1.0 - f64::from(m) / 4.0).sqrt()).collect();
        for levels in [
            vec![0.0, 0.25, 0.5, 0.75, 1.0],
            quadratic,
            vec![0.1, 0.2, 0.6, 0.9],
            vec![0.0, 0.125, 1.0],
            vec![0.3, 0.8],
        ] {
            for (m, &roughness) in levels.iter().enumerate() {
                let found = level(&levels, roughness);
                assert!((found - m as f64).abs() < 1e-12, "{levels:?} at {roughness}: level {found}");
            }
            assert_eq!(level(&levels, -0.5), 0.0);
            let last = (levels.len() - 1) as f64;
            assert!((level(&levels, 1.5) - last).abs() < 1e-12);
            let mut before = 0.0;
            for i in 0..=1000 {
                let now = level(&levels, f64::from(i) / 1000.0);
                assert!(now >= before && now <= last + 1e-12, "{levels:?} at {i}/1000: {now} after {before}");
                before = now;
            }
        }
    }

    #[test]
    fn between_levels_the_roughness_is_linear() {
        assert_eq!(level(&[0.0, 0.2, 1.0], 0.1), 0.5);
        assert!((level(&[0.0, 0.2, 1.0], 0.4) - 1.25).abs() < 1e-12);
        assert_eq!(
            level_of_roughness(&[0.0, 0.5, 1.0]).expect("a chain").to_string(),
            "clamp(roughness * 2.0, 0.0, 2.0)"
        );
        assert_eq!(level(&[0.5], 0.9), 0.0);
        assert_eq!((level(&[0.0, 0.5, 0.5, 1.0], 0.499) < 1.0, level(&[0.0, 0.5, 0.5, 1.0], 0.5)), (true, 2.0));
    }

    #[test]
    fn a_chain_that_turns_back_is_refused() {
        let message = level_of_roughness(&[0.0, 0.8, 0.5]).expect_err("no function").to_string();
        assert!(message.contains("falls from 0.8 to 0.5"), "{message}");
        assert!(level_of_roughness(&[]).is_err());
    }
}
