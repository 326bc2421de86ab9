//! An axis of a table: which parameter a texel stands for.
//!
//! This is the only place that knows half-texels, warps and flips.

use super::quantity::{Parameter, near_matches};
use crate::error::{Error, Result};
use crate::math::warp::Warp;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Where in [0, 1] the texels of an axis sit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampling {
    /// Texel i holds (i + ½)/n; the shader samples with the coordinate as it is.
    #[default]
    Centre,
    /// Texel i holds i/(n − 1); the shader rescales to x (n − 1)/n + ½/n.
    Edge,
}

/// Texels that an axis can have at most: what graphics hardware samples.
pub const LARGEST_SIZE: usize = 16384;

/// Texels along one direction of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// The parameter that varies.
    pub parameter: Parameter,
    /// Texels.
    pub size: usize,
    /// The function of the parameter that is even in the texture coordinate.
    #[serde(default)]
    pub warp: Warp,
    /// Centres or edges.
    #[serde(default)]
    pub sampling: Sampling,
    /// Whether texel 0 holds the largest value instead of the smallest.
    #[serde(default)]
    pub flip: bool,
}

impl Axis {
    /// `size` texel centres, even in the parameter itself, smallest first.
    pub fn new(parameter: Parameter, size: usize) -> Self {
        Self { parameter, size, warp: Warp::Linear, sampling: Sampling::Centre, flip: false }
    }

    /// The value of the parameter at texel `i`.
    pub fn value(&self, i: usize) -> f64 {
        let n = self.size as f64;
        let t = match self.sampling {
            Sampling::Centre => (i as f64 + 0.5) / n,
            Sampling::Edge => i as f64 / (n - 1.0),
        };
        self.parameter_at(if self.flip { 1.0 - t } else { t })
    }

    /// Where the parameter `x` lies, in texels: the inverse of [`Axis::value`], between and beyond texels too.
    pub fn position(&self, x: f64) -> f64 {
        let (low, high) = self.parameter.domain();
        let t = self.warp.forward((x - low) / (high - low));
        let t = if self.flip { 1.0 - t } else { t };
        let n = self.size as f64;
        match self.sampling {
            Sampling::Centre => t * n - 0.5,
            Sampling::Edge => t * (n - 1.0),
        }
    }

    /// The parameter at a position in texels; beyond the outermost texels as far as the domain goes.
    pub fn value_at_position(&self, position: f64) -> f64 {
        let n = self.size as f64;
        let t = match self.sampling {
            Sampling::Centre => (position + 0.5) / n,
            Sampling::Edge => position / (n - 1.0),
        };
        let t = if self.flip { 1.0 - t } else { t };
        self.parameter_at(t.clamp(0.0, 1.0)) // a position half a texel outside is the end of the domain
    }

    /// The parameter at the warped coordinate `t`: the warp acts on the part of the parameter's domain.
    fn parameter_at(&self, t: f64) -> f64 {
        let (low, high) = self.parameter.domain();
        low + (high - low) * self.warp.inverse(t)
    }

    /// Whether the axis can be baked.
    ///
    /// **Errors**: a parameter whose domain is not all of [0, 1] and more, no texels, one texel at the edges, more than hardware samples.
    pub fn check(&self) -> Result<()> {
        let name = self.parameter.name();
        if self.size == 0 {
            return Err(Error::usage(format!("size 0 of axis {name} leaves no texels"), "use at least 1, such as 64"));
        }
        let (low, high) = self.parameter.domain();
        if low > 0.0 || high < 1.0 {
            return Err(Error::usage(
                format!("an axis runs from 0 to 1, and {name} from {low} to {high}"),
                "use `kiln eval --points` for such a parameter",
            ));
        }
        if self.size > LARGEST_SIZE {
            return Err(Error::usage(
                format!(
                    "size {} of axis {name} is more than the {LARGEST_SIZE} that graphics hardware samples",
                    self.size
                ),
                "use a smaller one, such as 128",
            ));
        }
        if self.size == 1 && self.sampling == Sampling::Edge {
            return Err(Error::usage(
                format!("axis {name} has one texel, which cannot sit at both edges"),
                "use at least 2 texels, or sampling `centre`",
            ));
        }
        Ok(())
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sampling = match self.sampling {
            Sampling::Centre => "centre",
            Sampling::Edge => "edge",
        };
        write!(f, "{}:{}:{}:{sampling}", self.parameter, self.size, self.warp.name())?;
        if self.flip { f.write_str(":flip") } else { Ok(()) }
    }
}

/// An axis as a user writes it: `PARAMETER[:SIZE][:WARP][:centre|edge][:flip]`, the parts after the first in any order.
/// A size of 0 stands for one that was not given.
impl FromStr for Axis {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let way_out = "write PARAMETER[:SIZE][:linear|sqrt|cbrt|square][:centre|edge][:flip], such as mu:64:sqrt:edge";
        let mut parts = text.split(':').map(str::trim);
        let name = parts.next().unwrap_or_default();
        let parameter = Parameter::from_name(name).ok_or_else(|| {
            let known: Vec<_> = Parameter::ALL.iter().map(|p| p.name()).collect();
            Error::usage(
                format!("no parameter is called {name:?}; known are {}", known.join(", ")),
                near_matches(name, &known, "kiln list quantities"),
            )
        })?;
        let mut axis = Self::new(parameter, 0);
        for part in parts {
            if let Ok(size) = part.parse() {
                axis.size = size;
            } else if let Some(warp) = Warp::ALL.into_iter().find(|w| w.name() == part) {
                axis.warp = warp;
            } else {
                match part {
                    "centre" | "center" => axis.sampling = Sampling::Centre,
                    "edge" => axis.sampling = Sampling::Edge,
                    "flip" => axis.flip = true,
                    _ => return Err(Error::usage(format!("axis {text:?} has an unknown part {part:?}"), way_out)),
                }
            }
        }
        Ok(axis)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every_axis() -> impl Iterator<Item = Axis> {
        Warp::ALL.into_iter().flat_map(|warp| {
            [Sampling::Centre, Sampling::Edge].into_iter().flat_map(move |sampling| {
                [false, true].map(|flip| Axis { parameter: Parameter::Mu, size: 16, warp, sampling, flip })
            })
        })
    }

    #[test]
    fn position_undoes_value_for_every_warp_sampling_and_flip() {
        for axis in every_axis() {
            for i in 0..axis.size {
                let got = axis.position(axis.value(i));
                assert!((got - i as f64).abs() < 1e-13, "{axis} texel {i}: got {got}");
                assert_eq!(axis.value_at_position(i as f64), axis.value(i), "{axis} texel {i}");
            }
        }
    }

    #[test]
    fn edges_hold_the_ends_of_the_domain_and_centres_do_not() {
        for axis in every_axis() {
            let ends = (axis.value(0), axis.value(axis.size - 1));
            let wanted = if axis.flip { (1.0, 0.0) } else { (0.0, 1.0) };
            assert_eq!(ends == wanted, axis.sampling == Sampling::Edge, "{axis}: ends {ends:?}");
        }
    }

    #[test]
    fn an_axis_prints_as_it_is_parsed() {
        for axis in every_axis() {
            assert_eq!(axis.to_string().parse::<Axis>().expect("own output"), axis);
        }
        assert!("mu:64:sqr".parse::<Axis>().is_err());
        assert!("nu:64".parse::<Axis>().is_err());
    }
}
