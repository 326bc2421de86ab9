//! Looking up an environment that lies in a two-dimensional texture: an octahedral map, a panorama or the tiles of an atlas.
//!
//! A panorama is filtered by the sampler alone, which repeats around the world. No sampler knows where an octahedral map goes on beyond
//! its border, which is at the mirror image of the place on that same border: within half a texel of it, what the sampler finds here is
//! blended with what it finds there. The width of that half texel differs from level to level, so the two levels are looked up one
//! after the other. So they are in an atlas, where each has a tile with a border of its own, which no sampler's blend of four texels leaves.

use super::code::{Function, Item, Statement, Type};
use crate::environment::{SphereLayout, atlas};
use crate::math::expression::literal;

/// How a kind of map is looked up.
pub(super) struct Lookup<'a> {
    /// What all names begin with.
    pub name: &'a str,
    pub layout: SphereLayout,
}

/// A map that is looked up: its texture's name, what decodes its texels if anything does, and its sizes, level by level.
pub(super) struct Map<'a> {
    pub texture: &'a str,
    pub decode: Option<&'a str>,
    pub sizes: Vec<usize>,
}

impl Lookup<'_> {
    /// The type of a map's texture.
    pub fn texture(&self) -> Type {
        if self.layout.is_cube() { Type::Cube } else { Type::Texture2 }
    }

    /// What is called by the lookup of these maps.
    pub fn items(&self, maps: &[&Map]) -> Vec<Item> {
        let mut items = vec![];
        match self.layout {
            SphereLayout::Cube => return items,
            SphereLayout::Octahedral => items.push(self.octahedral_coordinate()),
            SphereLayout::Equirect | SphereLayout::Atlas => items.push(self.panorama_coordinate()),
        }
        if self.layout == SphereLayout::Atlas {
            items.extend(maps.first().map(|map| self.tile(map.decode)));
        }
        if self.layout == SphereLayout::Octahedral {
            let mut made: Vec<Option<&str>> = vec![];
            for map in maps {
                if !made.contains(&map.decode) {
                    made.push(map.decode);
                    items.push(self.seamless(map.decode));
                }
            }
        }
        items
    }

    /// The statements that end in the colour of a map in a direction, at a level; both are names or literals.
    pub fn body(&self, map: &Map, direction: &str, level: &str) -> Vec<Statement> {
        let name = self.name;
        match self.layout {
            SphereLayout::Cube => {
                vec![Statement::Return(self.decoded(
                    map.decode,
                    map.texture,
                    &format!("{name}_direction({direction})"),
                    level,
                ))]
            }
            SphereLayout::Equirect => {
                let at = format!("{name}_coordinate({direction})");
                vec![Statement::Return(self.decoded(map.decode, map.texture, &at, level))]
            }
            SphereLayout::Atlas => {
                let find = |level: &str| {
                    let (size, edge) = (size_of(&map.sizes, level), edge());
                    format!("{name}_tile(pass({}), at, vec2(0.0, {edge} - 2.0 * ({size})), {size})", map.texture)
                };
                self.between_levels(map, direction, level, find)
            }
            SphereLayout::Octahedral => {
                let find = |level: &str| {
                    let (function, size) = (self.seamless_name(map.decode), size_of(&map.sizes, level));
                    format!("{function}(pass({}), at, {size}, {level})", map.texture)
                };
                self.between_levels(map, direction, level, find)
            }
        }
    }

    /// The statements that look up two levels one after the other, as `find` does it at the place `at`, and blend them.
    fn between_levels(&self, map: &Map, direction: &str, level: &str, find: impl Fn(&str) -> String) -> Vec<Statement> {
        let let_ = |name: &str, of: Type, value: String| Statement::Let(name.to_owned(), of, value);
        let last = literal(map.sizes.len().saturating_sub(1) as f64);
        vec![
            let_("at", Type::Vec2, format!("{}_coordinate({direction})", self.name)),
            let_("level", Type::Float, level.to_owned()),
            let_("below", Type::Float, "floor(level)".to_owned()),
            let_("above", Type::Float, format!("clamp(below + 1.0, 0.0, {last})")),
            let_("low", Type::Vec3, find("below")),
            let_("high", Type::Vec3, find("above")),
            Statement::Return("mix(low, high, level - below)".to_owned()),
        ]
    }

    /// Of an atlas: what its irradiance is in the direction `normal`.
    pub fn irradiance_tile(&self, texture: &str) -> Vec<Statement> {
        let tile = atlas::irradiance();
        let [column, row, size] = [tile.column, tile.row, tile.size].map(|n| literal(n as f64));
        let find = format!("{}_tile(pass({texture}), at, vec2({column}, {row}), {size})", self.name);
        let at = format!("{}_coordinate(normal)", self.name);
        vec![Statement::Let("at".to_owned(), Type::Vec2, at), Statement::Return(find)]
    }

    /// Of an atlas: the mirror at a level of its sizes, for who knows how far apart pixels look.
    pub fn mirror_tiles(&self, map: &Map) -> Vec<Statement> {
        let find = |level: &str| {
            let size = size_of(&map.sizes, level);
            let place = format!("{} - 2.0 * ({size})", edge());
            format!("{}_tile(pass({}), at, vec2({place}, {place}), {size})", self.name, map.texture)
        };
        let last = literal(map.sizes.len().saturating_sub(1) as f64);
        self.between_levels(map, "direction", &format!("clamp(mip, 0.0, {last})"), find)
    }

    /// What the sampler has to do, for the head of the file.
    pub fn sampler(&self) -> &'static str {
        match self.layout {
            SphereLayout::Cube => "linear filter, also between levels; seamless across faces.",
            SphereLayout::Octahedral => {
                "linear filter, clamped to the edge; levels are blended here, and what lies beyond a border is found here."
            }
            SphereLayout::Equirect => "linear filter, also between levels; repeated in u, clamped to the edge in v.",
            SphereLayout::Atlas => {
                "linear filter, without mips; levels are blended here, and each tile has a border of its own."
            }
        }
    }

    fn decoded(&self, decode: Option<&str>, texture: &str, at: &str, level: &str) -> String {
        let texel = format!("sample({texture}, {at}, {level})");
        decode.map_or_else(|| format!("{texel}.xyz"), |decode| format!("{}_{decode}({texel})", self.name))
    }

    fn function(
        &self,
        end: &str,
        comment: &str,
        parameters: &[(&str, Type)],
        result: Type,
        body: Vec<Statement>,
    ) -> Item {
        Item::Function(Function {
            comment: comment.to_owned(),
            name: format!("{}_{end}", self.name),
            parameters: parameters.iter().map(|(name, of)| ((*name).to_owned(), of.clone())).collect(),
            result,
            body,
        })
    }

    fn octahedral_coordinate(&self) -> Item {
        let let_ = |name: &str, of: Type, value: &str| Statement::Let(name.to_owned(), of, value.to_owned());
        let side = "vec2(2.0 * step(0.0, p.x) - 1.0, 2.0 * step(0.0, p.y) - 1.0)";
        let body = vec![
            let_("d", Type::Vec3, &format!("{}_direction(direction)", self.name)),
            let_("p", Type::Vec2, "d.xy / (abs(d.x) + abs(d.y) + abs(d.z))"),
            let_("side", Type::Vec2, side),
            let_("folded", Type::Vec2, "(vec2(1.0, 1.0) - abs(p.yx)) * side"),
            let_("outside", Type::Float, "1.0 - step(0.0, d.z)"),
            Statement::Return("mix(p, folded, vec2(outside, outside)) * 0.5 + vec2(0.5, 0.5)".to_owned()),
        ];
        let comment = "Where in the octahedral map a direction of the world is, from 0 to 1: p = d.xy / (|d.x| + |d.y| + |d.z|), folded\n\
                       outwards where d.z < 0.";
        self.function("coordinate", comment, &[("direction", Type::Vec3)], Type::Vec2, body)
    }

    fn panorama_coordinate(&self) -> Item {
        let let_ = |name: &str, of: Type, value: String| Statement::Let(name.to_owned(), of, value);
        let [turn, half] = [std::f64::consts::TAU, std::f64::consts::PI].map(|angle| literal(1.0 / angle));
        let body = vec![
            let_("d", Type::Vec3, format!("{}_direction(direction)", self.name)),
            // An arctangent of two zeros is undefined.
            let_("x", Type::Float, "d.x + (1.0 - step(1.0e-30, abs(d.x) + abs(d.z)))".to_owned()),
            let_("across", Type::Float, "sqrt(d.x * d.x + d.z * d.z)".to_owned()),
            // Some arctangents go astray at a zero with a sign.
            let_("side", Type::Float, "2.0 * step(0.0, d.z) - 1.0".to_owned()),
            let_("u", Type::Float, format!("0.5 + side * atan2(abs(d.z), x) * {turn}")),
            let_("v", Type::Float, format!("atan2(across, d.y) * {half}")),
            Statement::Return("vec2(u, v)".to_owned()),
        ];
        let comment = "Where in the panorama a direction of the world is, from 0 to 1: u = 1/2 + atan2(d.z, d.x)/2π, v = acos(d.y)/π.";
        self.function("coordinate", comment, &[("direction", Type::Vec3)], Type::Vec2, body)
    }

    fn tile(&self, decode: Option<&str>) -> Item {
        let let_ = |name: &str, of: Type, value: String| Statement::Let(name.to_owned(), of, value);
        let [border, both] = [1, 2].map(|n| literal((n * atlas::BORDER) as f64));
        let texel = literal(1.0 / atlas::EDGE as f64);
        let body = vec![
            let_("inside", Type::Vec2, format!("vec2(2.0 * size - {both}, size - {both})")),
            let_("place", Type::Vec2, format!("corner + vec2({border}, {border}) + at * inside")),
            Statement::Return(self.decoded(decode, "map", &format!("place * {texel}"), "0.0")),
        ];
        let comment = "What a tile of the atlas shows at a place of its panorama, from 0 to 1: the tile begins at the texel `corner` and has\n\
                       2 size x size texels, of which the outermost repeat others.";
        let parameters = [("map", Type::Texture2), ("at", Type::Vec2), ("corner", Type::Vec2), ("size", Type::Float)];
        self.function("tile", comment, &parameters, Type::Vec3, body)
    }

    fn seamless_name(&self, decode: Option<&str>) -> String {
        format!("{}_seamless{}", self.name, decode.map_or_else(String::new, |decode| format!("_{decode}")))
    }

    fn seamless(&self, decode: Option<&str>) -> Item {
        let let_ = |name: &str, of: Type, value: String| Statement::Let(name.to_owned(), of, value);
        let over = |axis: &str| format!("clamp(0.5 + size * (abs(at.{axis} - 0.5) - 0.5), 0.0, 0.5)");
        let find = |u: &str, v: &str| self.decoded(decode, "map", &format!("vec2({u}, {v})"), "level");
        let body = vec![
            let_("over_u", Type::Float, over("x")),
            let_("over_v", Type::Float, over("y")),
            let_("here", Type::Vec3, find("at.x", "at.y")),
            let_("beyond_u", Type::Vec3, find("at.x", "1.0 - at.y")),
            let_("beyond_v", Type::Vec3, find("1.0 - at.x", "at.y")),
            let_("beyond_both", Type::Vec3, find("1.0 - at.x", "1.0 - at.y")),
            let_("inside", Type::Vec3, "mix(here, beyond_u, vec3(over_u, over_u, over_u))".to_owned()),
            let_("outside", Type::Vec3, "mix(beyond_v, beyond_both, vec3(over_u, over_u, over_u))".to_owned()),
            Statement::Return("mix(inside, outside, vec3(over_v, over_v, over_v))".to_owned()),
        ];
        let end = self.seamless_name(decode);
        let end = end.strip_prefix(&format!("{}_", self.name)).unwrap_or(&end);
        let comment = "One level of so many texels along an edge, bilinear, also across the border: beyond it the map goes on at the mirror\n\
                       image of the place on that border. Where `over` is 0, away from borders, `here` is all that counts.";
        let parameters = [("map", Type::Texture2), ("at", Type::Vec2), ("size", Type::Float), ("level", Type::Float)];
        self.function(end, comment, &parameters, Type::Vec3, body)
    }
}

/// Texels along an edge of an atlas. A tile that ends where the picture does begins twice its rows before.
fn edge() -> String {
    literal(atlas::EDGE as f64)
}

/// The number of texels along the edge of a level that is a whole number.
fn size_of(sizes: &[usize], level: &str) -> String {
    let first = literal(sizes.first().copied().unwrap_or(1) as f64);
    let steps = sizes.windows(2).enumerate().map(|(m, pair)| {
        format!(" - {} * step({}, {level})", literal((pair[0] - pair[1]) as f64), literal(m as f64 + 0.5))
    });
    format!("{first}{}", steps.collect::<String>())
}
