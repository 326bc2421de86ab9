//! Looking up a table.

use super::code::{Function, Item, Statement, Type};
use super::{Shader, energy, identifier, packing};
use crate::certificate::Certificate;
use crate::error::Result;
use crate::math::expression::Expression;
use crate::recipe::TableRecipe;
use crate::table::quantity::Handle;
use crate::table::{Arrangement, Axis, Sampling, Transform};

/// Channels of a texture: a table with more is looked up in several.
const CHANNELS: usize = 4;

/// What its functions are made of.
#[derive(Clone)]
struct Names {
    name: String,
    axes: Vec<Axis>,
    /// Which channels are looked up over these axes.
    channels: Vec<usize>,
    /// The name of every channel.
    fields: Vec<String>,
    /// What became of each channel before it was packed.
    transforms: Vec<Transform>,
    arrangement: Arrangement,
    /// The function that decodes texels, where they are codes.
    decoder: Option<String>,
    /// Which layer of an array texture it is.
    layer: Option<usize>,
}

pub(super) fn shader(name: &str, recipe: &TableRecipe, certificate: &Certificate) -> Result<Shader> {
    let spec = recipe.spec()?;
    spec.check()?;
    let quantities: Vec<&str> = spec.channels.iter().map(|c| c.quantity.name).collect();
    let decoder = packing::decoder(name, "decode", recipe.format.texel(quantities.len())?);
    // Where axes stand for two parameters each, the channels of either are looked up on their own.
    let of_other = |c: &Handle| spec.axes.iter().filter_map(|a| a.also).any(|other| c.quantity.depends_on(other));
    let (second, first): (Vec<usize>, Vec<usize>) =
        (0..spec.channels.len()).partition(|&c| of_other(&spec.channels[c]));
    let names = Names {
        name: name.to_owned(),
        axes: spec.axes.clone(),
        channels: first,
        fields: identifier::fields(&quantities),
        transforms: spec.channels.iter().map(|c| c.transform).collect(),
        arrangement: recipe.arrangement()?,
        decoder: decoder.as_ref().map(|_| format!("{name}_decode")),
        layer: certificate.layer,
    };
    let mut items: Vec<Item> = decoder.into_iter().collect();
    for view in [names.clone(), names.other(second)].iter().filter(|view| !view.channels.is_empty()) {
        items.extend([view.structure(), view.coordinate()]);
        if view.arrangement.is_atlas() {
            items.push(view.tile());
        }
        items.push(view.lookup());
    }
    items.extend(energy::items(name, &quantities, &names.fields));
    Ok(Shader { head: names.head(recipe, certificate), items })
}

impl Names {
    /// The same for the other parameters that the axes stand for, and the channels that depend on them.
    fn other(&self, channels: Vec<usize>) -> Self {
        let of = channels.first().map_or("", |&c| self.fields[c].as_str());
        let axes = self.axes.iter().map(|axis| axis.other().unwrap_or(*axis)).collect();
        Self { name: format!("{}_{of}", self.name), axes, channels, ..self.clone() }
    }

    fn head(&self, recipe: &TableRecipe, certificate: &Certificate) -> String {
        let size: Vec<String> = self.axes.iter().map(|a| a.size.to_string()).collect();
        let mut head = format!(
            "{}: {} texels, {}; code by Kiln {}, from the file's certificate.\n\n",
            recipe.file,
            size.join(" × "),
            recipe.format,
            env!("CARGO_PKG_VERSION")
        );
        for (channel, quantity) in recipe.channels.iter().enumerate() {
            let definition = certificate.channels.iter().find(|c| c.quantity == *quantity);
            head += &format!(
                "{}: {quantity}{}",
                self.swizzle(channel),
                definition.map_or_else(String::new, |c| format!(" = {}", c.definition))
            );
            if let Some(error) = certificate.lookup.iter().find(|l| l.channel == *quantity) {
                head += &format!(
                    "\n    through bilinear filtering within {:.1e} (RMS {:.1e}), worst at {}",
                    error.max, error.rms, error.worst_at
                );
            }
            head += "\n";
        }
        head += "\n";
        for (axis, letter) in self.axes.iter().zip("uvw".chars()) {
            let (low, high) = axis.ends();
            let texels = match axis.sampling {
                Sampling::Centre => "the range ends half a texel outside the outermost centres",
                Sampling::Edge => "the outermost texels hold the ends",
            };
            head += &format!(
                "{letter}: {}, {}; {low} to {high}, warp {}{}, {texels}\n",
                axis.parameter.shader_name(),
                axis.parameter.summary(),
                axis.warp,
                if axis.flip { ", flipped" } else { "" }
            );
            if let Some(other) = axis.other() {
                let (low, high) = other.ends();
                let of = other.parameter;
                head += &format!(
                    "    and {}, {}, {low} to {high}, for the channels of it\n",
                    of.shader_name(),
                    of.summary()
                );
            }
            if axis.shift != 0.0 {
                head += &format!("    displaced by {:+} texels, which the code makes up for\n", axis.shift);
            }
        }
        for (parameter, value) in recipe.at.given() {
            head += &format!("{} is {value}\n", parameter.shader_name());
        }
        head += "\nSampler: linear filter, clamped to the edge, no mips.";
        if let Some(layer) = self.layer {
            head += &format!(" The table is layer {layer} of an array texture.");
        }
        if self.arrangement.is_layered() {
            head += " The slices of the file go into a 3D texture, the first one first.";
        }
        if self.n_textures() > 1 {
            head += &format!(" The channels go into {} textures, {CHANNELS} in each.", self.n_textures());
        }
        head + "\n"
    }

    fn n_textures(&self) -> usize {
        self.fields.len().div_ceil(CHANNELS)
    }

    fn texture(&self, i: usize) -> String {
        if self.n_textures() == 1 { "table".to_owned() } else { format!("table{i}") }
    }

    /// Where a channel is: `table.x`.
    fn swizzle(&self, channel: usize) -> String {
        format!("{}.{}", self.texture(channel / CHANNELS), &"xyzw"[channel % CHANNELS..=channel % CHANNELS])
    }

    fn values(&self) -> Type {
        Type::Struct(format!("{}_values", self.name))
    }

    fn parameters(&self) -> Vec<(String, Type)> {
        self.axes.iter().map(|a| (a.parameter.shader_name().to_owned(), Type::Float)).collect()
    }

    fn arguments(&self) -> String {
        self.axes.iter().map(|a| a.parameter.shader_name()).collect::<Vec<_>>().join(", ")
    }

    fn is_volume(&self) -> bool {
        self.arrangement.is_volume() || self.arrangement.is_layered()
    }

    fn structure(&self) -> Item {
        let fields = self.channels.iter().map(|&c| self.fields[c].clone()).collect();
        Item::Struct("What the table holds.".to_owned(), format!("{}_values", self.name), fields)
    }

    /// The texture coordinates of the parameters: two, or three for a table over three axes.
    fn coordinate(&self) -> Item {
        let letters = ["x", "y", "z"];
        let mut body: Vec<Statement> = self
            .axes
            .iter()
            .zip(letters)
            .map(|(axis, letter)| {
                let within = axis.kept_within(Expression::variable(axis.parameter.shader_name()));
                Statement::Let(letter.to_owned(), Type::Float, within.to_string())
            })
            .collect();
        let mut coordinates: Vec<String> = self
            .axes
            .iter()
            .zip(letters)
            .map(|(axis, letter)| axis.coordinate(Expression::variable(letter)).to_string())
            .collect();
        if coordinates.len() == 1 {
            coordinates.push("0.5".to_owned()); // the middle of the only row
        }
        let (word, result) = if coordinates.len() == 3 { ("vec3", Type::Vec3) } else { ("vec2", Type::Vec2) };
        body.push(Statement::Return(format!("{word}({})", coordinates.join(", "))));
        Item::Function(Function {
            comment: "Where in the table the parameters are, from 0 to 1.".to_owned(),
            name: format!("{}_coordinate", self.name),
            parameters: self.parameters(),
            result,
            body,
        })
    }

    /// The place of a slice in an atlas.
    fn tile(&self) -> Item {
        let [u, v] = self.arrangement.atlas_coordinate(["at.x", "at.y", "slice"].map(Expression::variable));
        Item::Function(Function {
            comment:
                "Where in the picture a place of a slice is; half a texel within it, so that filtering stays inside."
                    .to_owned(),
            name: format!("{}_tile", self.name),
            parameters: vec![("at".to_owned(), Type::Vec2), ("slice".to_owned(), Type::Float)],
            result: Type::Vec2,
            body: vec![Statement::Return(format!("vec2({u}, {v})"))],
        })
    }

    fn lookup(&self) -> Item {
        let texture = match self.layer {
            Some(_) => Type::Texture2Array,
            None if self.is_volume() => Type::Texture3,
            None => Type::Texture2,
        };
        let textures = (0..self.n_textures()).map(|i| (self.texture(i), texture.clone()));
        let at = if self.axes.len() == 3 { Type::Vec3 } else { Type::Vec2 };
        let let_ = |name: &str, of: Type, value: String| Statement::Let(name.to_owned(), of, value);
        let mut body = vec![let_("at", at, format!("{}_coordinate({})", self.name, self.arguments()))];
        if self.arrangement.is_atlas() {
            let last = (self.axes[2].size - 1) as f64;
            let slice = (Expression::variable("at.z") * self.axes[2].size as f64 - 0.5).clamp(0.0, last);
            body.push(let_("slice", Type::Float, slice.to_string()));
            body.push(let_("below", Type::Float, "floor(slice)".to_owned()));
            let above = Expression::variable("below") + 1.0;
            body.push(let_("above", Type::Float, above.clamp(0.0, last).to_string()));
        }
        for i in 0..self.n_textures() {
            let (texture, texel) = (self.texture(i), self.texel(i));
            let value = if self.arrangement.is_atlas() {
                let slice = |s: &str| self.sample(&texture, &format!("{}_tile(at.xy, {s})", self.name));
                format!("mix({}, {}, slice - below)", slice("below"), slice("above"))
            } else if self.is_volume() || self.axes.len() < 3 {
                self.sample(&texture, "at")
            } else {
                self.sample(&texture, "at.xy") // one slice, in a picture
            };
            body.push(let_(&texel, Type::Vec4, value));
        }
        body.push(Statement::Variable("values".to_owned(), self.values()));
        for &channel in &self.channels {
            let field = &self.fields[channel];
            let component = &"xyzw"[channel % CHANNELS..=channel % CHANNELS];
            let texel = Expression::variable(format!("{}.{component}", self.texel(channel / CHANNELS)));
            body.push(Statement::Set(format!("values.{field}"), self.transforms[channel].undone(texel).to_string()));
        }
        body.push(Statement::Return("values".to_owned()));
        Item::Function(Function {
            comment: self.about_lookup(),
            name: format!("{}_lookup", self.name),
            parameters: textures.chain(self.parameters()).collect(),
            result: self.values(),
            body,
        })
    }

    fn about_lookup(&self) -> String {
        let mut about = "The table at the parameters.".to_owned();
        if self.channels.iter().any(|&c| !self.transforms[c].is_identity()) {
            about += " What became of a quantity before it was stored is undone.";
        }
        let limited = self.channels.iter().map(|&c| (&self.fields[c], &self.transforms[c]));
        for (field, transform) in limited.filter(|(_, t)| t.limits()) {
            about += &format!(
                "\nOf {field}{transform}, nothing undoes min(y,1): where that was at work, the limit remains."
            );
        }
        about
    }

    /// The values at a place.
    fn sample(&self, texture: &str, at: &str) -> String {
        let texel = match self.layer {
            Some(layer) => format!("sample_layer({texture}, {at}, {layer})"),
            None => format!("sample({texture}, {at}, 0.0)"),
        };
        match &self.decoder {
            Some(decode) => format!("vec4({decode}({texel}), 1.0)"),
            None => texel,
        }
    }

    fn texel(&self, i: usize) -> String {
        if self.n_textures() == 1 { "texel".to_owned() } else { format!("texel{i}") }
    }
}
