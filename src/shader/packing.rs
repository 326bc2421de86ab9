//! Undoing a packing that no texture unit undoes.

use super::code::{Function, Item, Statement, Type};
use crate::pack::TexelFormat;

/// The function NAME_END from a texel's four codes to its three values, where texels are codes; hardware reads all other formats itself, and
/// who loads an RGBE picture unpacks it.
pub(super) fn decoder(name: &str, end: &str, format: TexelFormat) -> Option<Item> {
    let body = match format {
        TexelFormat::Rgbm => squared("texel.xyz * (texel.w * 8.0)"),
        TexelFormat::Rgbp => squared("texel.xyz * (8.0 - 7.0 * texel.w)"),
        TexelFormat::Rgbd => vec![Statement::Return("pow(texel.xyz, vec3(2.2, 2.2, 2.2)) / texel.w".to_owned())],
        _ => return None,
    };
    Some(Item::Function(Function {
        comment: format!(
            "What the codes of {format} stand for. They ought to be unpacked before they are filtered: where neighbours\nhave \
             different factors, linear filtering of codes is wrong."
        ),
        name: format!("{name}_{end}"),
        parameters: vec![("texel".to_owned(), Type::Vec4)],
        result: Type::Vec3,
        body,
    }))
}

fn squared(root: &str) -> Vec<Statement> {
    vec![Statement::Let("root".to_owned(), Type::Vec3, root.to_owned()), Statement::Return("root * root".to_owned())]
}
