//! What somebody else's file is said to hold: quantities, axes and how the values are encoded, for every channel.

use crate::error::{Error, Result};
use crate::format::Grid;
use crate::table::{Axis, Model, Point, TableSpec, named, quantity};
use serde::Serialize;
use std::fmt;

/// What a stored value is of the quantity: `curve(scale · y + offset)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Encoding {
    /// Factor.
    pub scale: f64,
    /// Added after the factor.
    pub offset: f64,
    /// Applied last.
    pub curve: Curve,
}

/// A curve that values are stored through.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Curve {
    /// None.
    Plain,
    /// y/(1 + y), which keeps what has no upper bound below 1.
    Ratio,
    /// The sRGB curve: usually a mistake of whoever saved the picture.
    Srgb,
    /// The power 1/2.2: likewise, or an RGBD whose divisor is 1 everywhere.
    Gamma,
    /// The square root: an RGBP of nothing above 1, or a table that was to be precise where it is dark.
    Root,
}

impl Curve {
    /// Every curve.
    pub const ALL: [Self; 5] = [Self::Plain, Self::Ratio, Self::Srgb, Self::Gamma, Self::Root];

    /// The stored value of `y`.
    pub fn apply(self, y: f64) -> f64 {
        match self {
            Self::Plain => y,
            Self::Ratio => y / (1.0 + y),
            Self::Srgb if y <= 0.003_130_8 => 12.92 * y,
            Self::Srgb => 1.055 * y.powf(1.0 / 2.4) - 0.055,
            Self::Gamma => y.abs().powf(1.0 / 2.2).copysign(y),
            Self::Root => y.abs().sqrt().copysign(y),
        }
    }

    /// The inverse of [`Curve::apply`].
    pub fn undo(self, v: f64) -> f64 {
        match self {
            Self::Plain => v,
            Self::Ratio => v / (1.0 - v),
            Self::Srgb if v <= 0.040_45 => v / 12.92,
            Self::Srgb => ((v + 0.055) / 1.055).powf(2.4),
            Self::Gamma => v.abs().powf(2.2).copysign(v),
            Self::Root => (v * v).copysign(v),
        }
    }

    /// Whether all of these may be stored through it: a ratio does not exceed 1.
    pub fn admits(self, values: &[f64]) -> bool {
        self != Self::Ratio || !values.iter().any(|&v| v > 1.0)
    }
}

impl Encoding {
    /// The value itself.
    pub const PLAIN: Self = Self { scale: 1.0, offset: 0.0, curve: Curve::Plain };

    /// What is stored of `y`.
    pub fn encode(&self, y: f64) -> f64 {
        self.curve.apply(self.scale * y + self.offset)
    }

    /// The value that `v` stands for.
    pub fn decode(&self, v: f64) -> f64 {
        (self.curve.undo(v) - self.offset) / self.scale
    }
}

impl fmt::Display for Encoding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = vec![];
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
        if near(self.scale, -1.0) && near(self.offset, 1.0) {
            parts.push("1 minus it".to_owned());
        } else {
            if near(self.scale, std::f64::consts::FRAC_1_PI) {
                parts.push("scaled by 1/π".to_owned());
            } else if near(self.scale, std::f64::consts::PI) {
                parts.push("scaled by π".to_owned());
            } else if self.scale != 1.0 {
                parts.push(format!("scaled by {:.6}", self.scale));
            }
            if self.offset != 0.0 {
                parts.push(format!("offset by {:+.6}", self.offset).trim_end_matches('0').to_owned());
            }
        }
        match self.curve {
            Curve::Plain => {}
            Curve::Ratio => parts.push("stored as y/(1 + y)".to_owned()),
            Curve::Srgb => parts.push("stored through the sRGB curve".to_owned()),
            Curve::Gamma => parts.push("stored to the power 1/2.2".to_owned()),
            Curve::Root => parts.push("stored as its square root".to_owned()),
        }
        f.write_str(&parts.join(", "))
    }
}

/// What one channel is said to hold.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimedChannel {
    /// Which channel of the file.
    pub index: usize,
    /// The quantity, its axes and its model: a table of one channel.
    pub spec: TableSpec,
    /// How its values are encoded.
    pub encoding: Encoding,
}

/// What the channels of a file are said to hold.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Claim {
    /// The channels of which something is said.
    pub channels: Vec<ClaimedChannel>,
}

/// A claim in a user's words, to be completed from the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Said {
    /// A table's name, whose channels and axes hold where nothing else is said.
    pub table: Option<String>,
    /// Quantities in the order of the file's channels; `-` for a channel of which nothing is said.
    pub channels: Vec<String>,
    /// Axes, x first; sizes are the file's.
    pub axes: Vec<Axis>,
    /// Values of the parameters that no axis varies.
    pub at: Point,
    /// The choices within the model.
    pub model: Model,
}

impl Claim {
    /// What is said of `grid`.
    ///
    /// **Errors**: an unknown name; other axes or more channels than the grid has; whatever [`TableSpec::check`] refuses.
    pub fn new(grid: &Grid, said: &Said) -> Result<Self> {
        let table = said.table.as_deref().map(named::find).transpose()?;
        let names: Vec<String> = match (table, said.channels.is_empty()) {
            (_, false) => said.channels.clone(),
            (Some(table), true) => table.channels.iter().map(|&c| c.to_owned()).collect(),
            (None, true) => {
                return Err(Error::usage(
                    "nothing says what the file holds",
                    "give --as TABLE or --channels QUANTITY,…; `kiln identify` finds out",
                ));
            }
        };
        let mut axes = match (table, said.axes.is_empty()) {
            (_, false) => said.axes.clone(),
            (Some(table), true) => table.default_axes()?,
            (None, true) => return Err(Error::usage("quantities without axes", "give --axes, such as mu,roughness")),
        };
        let sizes: Vec<usize> = grid.size.into_iter().take(axes.len()).collect();
        // An axis of one texel says nothing of its parameter: a picture is no volume of one slice.
        let flat = sizes.contains(&1);
        let beyond = grid.size.iter().skip(axes.len()).any(|&s| s != 1);
        if beyond || flat || sizes.len() < axes.len() {
            return Err(Error::invalid(
                format!(
                    "{} texels, where {} said to be",
                    grid.size.map(|s| s.to_string()).join(" × "),
                    if axes.len() == 1 { "one axis was".to_owned() } else { format!("{} axes were", axes.len()) }
                ),
                "give an axis per dimension with --axes, or the shape with --shape",
            ));
        }
        for (axis, size) in axes.iter_mut().zip(sizes) {
            if axis.size != 0 && axis.size != size && !said.axes.is_empty() {
                return Err(Error::invalid(
                    format!("{size} texels along {}, where {} were said to be", axis.parameter, axis.size),
                    "correct the size in --axes, or leave it out",
                ));
            }
            axis.size = size;
        }
        let at = if said.at.is_empty() && said.axes.is_empty() {
            table.map_or(Ok(said.at), named::NamedTable::default_point)?
        } else {
            said.at
        };
        let by_name = names.iter().all(|name| grid.channels.iter().any(|c| c.name == *name));
        if names.len() > grid.channels.len() {
            return Err(Error::invalid(
                format!("{} of the {} channels that were said to be", grid.channels.len(), names.len()),
                "name the quantities that are there with --channels",
            ));
        }
        let mut channels = vec![];
        for (i, name) in names.iter().enumerate().filter(|(_, name)| *name != "-") {
            let given = |p: crate::table::Parameter| {
                axes.iter().flat_map(Axis::parameters).any(|a| a.canonical() == p.canonical()) || at.get(p).is_ok()
            };
            let handle = quantity::find_among(name, given)?;
            let spec = TableSpec { channels: vec![handle], axes: axes.clone(), at, model: said.model };
            let index = if by_name { grid.channels.iter().position(|c| c.name == *name).unwrap_or(i) } else { i };
            channels.push(ClaimedChannel { index, spec, encoding: Encoding::PLAIN });
        }
        // All together: each axis is for one of them at least.
        let handles = channels.iter().map(|channel| channel.spec.channels[0]).collect();
        TableSpec { channels: handles, axes, at, model: said.model }.check()?;
        Ok(Self { channels })
    }

    /// The channels in groups that one integration computes: equal axes, values and model.
    pub fn groups(&self) -> Vec<(TableSpec, Vec<&ClaimedChannel>)> {
        let mut groups: Vec<(TableSpec, Vec<&ClaimedChannel>)> = vec![];
        for channel in &self.channels {
            let same = |g: &&mut (TableSpec, Vec<&ClaimedChannel>)| {
                (&g.0.axes, g.0.at, g.0.model) == (&channel.spec.axes, channel.spec.at, channel.spec.model)
            };
            match groups.iter_mut().find(same) {
                Some((spec, channels)) => {
                    spec.channels.extend(&channel.spec.channels);
                    channels.push(channel);
                }
                None => groups.push((channel.spec.clone(), vec![channel])),
            }
        }
        groups
    }
}

/// `ggx.scale, ggx.bias over mu:64 × roughness:64 (correlated Smith)`, each group in turn.
impl fmt::Display for Claim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let groups: Vec<String> = self
            .groups()
            .iter()
            .map(|(spec, channels)| {
                let names: Vec<String> = channels
                    .iter()
                    .map(|c| {
                        let name = c.spec.channels[0].quantity.name;
                        match c.encoding.to_string() {
                            text if text.is_empty() => name.to_owned(),
                            text => format!("{name} ({text})"),
                        }
                    })
                    .collect();
                let axes: Vec<String> = spec.axes.iter().map(Axis::brief).collect();
                let at = if spec.at.is_empty() { String::new() } else { format!(" at {}", spec.at) };
                format!("{} over {}{at}{}", names.join(", "), axes.join(" × "), model_words(spec))
            })
            .collect();
        f.write_str(&groups.join("; "))
    }
}

/// The choices of the model that matter for a table, in brackets: ` (correlated Smith)`.
pub fn model_words(spec: &TableSpec) -> String {
    let mut words: Vec<String> = vec![];
    for word in spec.channels.iter().flat_map(|channel| spec.model.choices_of(channel.quantity)) {
        if !words.contains(&word) {
            words.push(word);
        }
    }
    if words.is_empty() { String::new() } else { format!(" ({})", words.join(", ")) }
}
