//! An axis of a table: which parameter a texel stands for.
//!
//! This is the only place that knows half-texels, warps and flips.

use super::quantity::{Parameter, Point, near_matches};
use crate::error::{Error, Result};
use crate::math::expression::Expression;
use crate::math::warp::Warp;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Where in [0, 1] the texels of an axis sit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Sampling {
    /// Texel i holds (i + ½)/n; the shader samples with the coordinate as it is.
    #[default]
    Centre,
    /// Texel i holds i/(n − 1); the shader rescales to x (n − 1)/n + ½/n.
    Edge,
}

/// Texels that an axis can have at most: what graphics hardware samples.
pub const LARGEST_SIZE: usize = 16384;

/// Texels along one direction of a table; a file or a user has it as a text, see [`Axis::from_str`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Axis {
    /// The parameter that varies.
    pub parameter: Parameter,
    /// Texels.
    pub size: usize,
    /// Smallest and largest value; `None` is [`Parameter::range`].
    pub range: Option<(f64, f64)>,
    /// The function of the parameter that is even in the texture coordinate.
    pub warp: Warp,
    /// Centres or edges.
    pub sampling: Sampling,
    /// Whether the texture coordinate runs backwards.
    pub flip: bool,
    /// Texels by which the content is displaced: texel i holds what belongs at i + shift, up to the end of the range. 0 in a right
    /// table; another value reproduces a published one that is not.
    pub shift: f64,
    /// Another parameter that the same texels stand for, in channels that do not depend on the first: even over its whole range in the same
    /// texture coordinate. Engines keep functions of different parameters in one texture.
    pub also: Option<Parameter>,
}

impl Axis {
    /// `size` texel centres, even in the parameter itself, smallest first.
    pub fn new(parameter: Parameter, size: usize) -> Self {
        let (warp, sampling) = (Warp::Linear, Sampling::Centre);
        Self { parameter, size, range: None, warp, sampling, flip: false, shift: 0.0, also: None }
    }

    /// Smallest and largest value of the parameter along the axis, if it is known where it ends.
    pub fn known_range(&self) -> Option<(f64, f64)> {
        let of_warp = match self.warp {
            Warp::F0FourthRoot => Some((1.0, f64::INFINITY)),
            Warp::Reciprocal { .. } if self.parameter == Parameter::Exponent => Some((0.0, f64::INFINITY)),
            _ => None,
        };
        self.range.or(of_warp).or(self.parameter.range())
    }

    /// The same for an axis that [`Axis::check`] has passed.
    pub fn ends(&self) -> (f64, f64) {
        self.known_range().unwrap_or(self.parameter.domain())
    }

    /// The value of the parameter at texel `i`.
    pub fn value(&self, i: usize) -> f64 {
        self.value_at_position(i as f64)
    }

    /// Where the parameter `x` lies, in texels: the inverse of [`Axis::value`], between and beyond texels too.
    pub fn position(&self, x: f64) -> f64 {
        let (first, last) = self.warped_ends();
        let t = (self.warp.forward(x) - first) / (last - first);
        let t = if self.flip { 1.0 - t } else { t };
        let n = self.size as f64;
        let aligned = match self.sampling {
            Sampling::Centre => t * n - 0.5,
            Sampling::Edge => t * (n - 1.0),
        };
        aligned - self.shift
    }

    /// The parameter `x` kept within the range, as shader code: a cosine that rounding has made larger than 1 must not become NaN.
    pub fn kept_within(&self, x: Expression) -> Expression {
        /// Stands for infinity, which a shader does not have: (x − 1)/(x + 1) is 1 there.
        const FAR: f64 = 1e30;
        let (low, high) = self.ends();
        x.clamp(low, high.min(FAR))
    }

    /// The texture coordinate of a parameter `x` that is within the range, as shader code: texel i is at (i + ½)/n.
    ///
    /// What [`Axis::position`] computes, in the order that loses nothing to f32: the beginning of the range is taken off first.
    pub fn coordinate(&self, x: Expression) -> Expression {
        let (first, last) = self.warped_ends();
        let n = self.size as f64;
        let (scale, offset) = match self.sampling {
            Sampling::Centre => (1.0, 0.0),
            Sampling::Edge => ((n - 1.0) / n, 0.5 / n),
        };
        let along = (self.warp.expression(x) - first) * (scale / (last - first));
        let shift = self.shift / n;
        if self.flip { Expression::from(1.0 - offset - shift) - along } else { along + (offset - shift) }
    }

    /// The axis of the other parameter, if there is one.
    pub fn other(&self) -> Option<Self> {
        self.also.map(|parameter| Self { parameter, range: None, warp: Warp::Linear, also: None, ..*self })
    }

    /// The parameters that vary along it.
    pub fn parameters(&self) -> impl Iterator<Item = Parameter> {
        std::iter::once(self.parameter).chain(self.also)
    }

    /// Puts into `point` what a position in texels stands for.
    pub(super) fn place(&self, point: &mut Point, position: f64) {
        for axis in std::iter::once(*self).chain(self.other()) {
            point.set(axis.parameter, axis.value_at_position(position));
        }
    }

    /// The parameter at a position in texels; beyond the outermost texels as far as the range goes.
    pub fn value_at_position(&self, position: f64) -> f64 {
        let n = self.size as f64;
        let position = position + self.shift;
        let t = match self.sampling {
            Sampling::Centre => (position + 0.5) / n,
            Sampling::Edge => position / (n - 1.0),
        };
        let t = if self.flip { 1.0 - t } else { t };
        // A position half a texel outside, or shifted beyond the last texel, is the end of the range.
        self.parameter_at(t.clamp(0.0, 1.0))
    }

    /// The parameter at the texture coordinate `t`, both ends exactly.
    fn parameter_at(&self, t: f64) -> f64 {
        let (low, high) = self.ends();
        let (first, last) = self.warped_ends();
        let (start, end) = if self.falls() { (high, low) } else { (low, high) };
        if t == 0.0 {
            start
        } else if t == 1.0 {
            end
        } else {
            // Rounding beside an end must not leave the range.
            self.warp.inverse(first + t * (last - first), low < 1.0).clamp(low, high)
        }
    }

    /// The warp at the ends of the range, in the order of the texture coordinate: rising.
    fn warped_ends(&self) -> (f64, f64) {
        let (low, high) = self.ends();
        let (a, b) = (self.warp.forward(low), self.warp.forward(high));
        (a.min(b), a.max(b))
    }

    /// Whether the parameter falls as the warp rises.
    fn falls(&self) -> bool {
        let (low, high) = self.ends();
        self.warp.forward(low) > self.warp.forward(high)
    }

    /// The shortest text that stands for the axis.
    pub fn brief(&self) -> String {
        self.to_string().replace(":linear", "").replace(":centre", "")
    }

    /// Whether the axis can be baked.
    ///
    /// **Errors**: no texels, one texel at the edges, more than hardware samples, a range that is missing, empty, outside the
    /// parameter's domain or beyond what the warp can take.
    pub fn check(&self) -> Result<()> {
        let name = self.parameter.name();
        if self.size == 0 {
            return Err(Error::usage(format!("size 0 of axis {name} leaves no texels"), "use at least 1, such as 64"));
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
        if let Some(other) = self.also {
            if other.canonical() == self.parameter.canonical() {
                return Err(Error::usage(
                    format!("axis {name} is said to stand for {other} as well, which is the same"),
                    format!("leave out :+{other}"),
                ));
            }
            self.other().map_or(Ok(()), |axis| axis.check_range())?;
        }
        if !self.shift.is_finite() || self.shift.abs() >= self.size as f64 {
            return Err(Error::usage(
                format!("a shift of {} texels leaves nothing of the {} of axis {name}", self.shift, self.size),
                "leave it out, or use a small one such as shift+1",
            ));
        }
        self.check_range()
    }

    fn check_range(&self) -> Result<()> {
        let name = self.parameter.name();
        let Some((low, high)) = self.known_range() else {
            return Err(Error::usage(
                format!("axis {name} does not say where it begins and ends"),
                format!("give it a range, such as {name}:16:1..3"),
            ));
        };
        if !self.parameter.admits(low) || !self.parameter.admits(high) {
            return Err(Error::usage(
                format!("the range {low}..{high} of axis {name} leaves its domain {}", self.parameter.domain_text()),
                "choose a range within it",
            ));
        }
        if low >= high {
            return Err(Error::usage(
                format!("the range {low}..{high} of axis {name} is empty"),
                "write the smaller end first; `:flip` turns the axis round",
            ));
        }
        if let Some(needed) = self.warp.domain_fault(low, high) {
            return Err(Error::usage(
                format!("warp {} of axis {name} does not go from {low} to {high}", self.warp),
                format!("give the axis {needed}, or another warp"),
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
        write!(f, "{}:{}", self.parameter, self.size)?;
        if let Some((low, high)) = self.range {
            write!(f, ":{low}..{high}")?;
        }
        write!(f, ":{}:{sampling}", self.warp)?;
        if self.flip {
            f.write_str(":flip")?;
        }
        if self.shift != 0.0 {
            write!(f, ":shift{:+}", self.shift)?;
        }
        self.also.map_or(Ok(()), |other| write!(f, ":+{other}"))
    }
}

/// An axis as a user writes it: `PARAMETER[:SIZE][:LOW..HIGH][:WARP][:centre|edge][:flip][:shift±TEXELS][:+OTHER]`, the parts after the
/// first in any order. A size of 0 stands for one that was not given.
impl FromStr for Axis {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let mut parts = text.split(':').map(str::trim);
        let parameter = |name: &str| {
            Parameter::from_name(name).ok_or_else(|| {
                let known: Vec<_> = Parameter::ALL.iter().map(|p| p.name()).collect();
                Error::usage(
                    format!("no parameter is called {name:?}; known are {}", known.join(", ")),
                    near_matches(name, &known, "kiln list quantities"),
                )
            })
        };
        let mut axis = Self::new(parameter(parts.next().unwrap_or_default())?, 0);
        for part in parts {
            if let Ok(size) = part.parse() {
                axis.size = size;
            } else if let Ok(warp) = part.parse() {
                axis.warp = warp;
            } else if let Some(range) =
                part.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)))
            {
                axis.range = Some(range);
            } else if let Some(shift) = part.strip_prefix("shift").and_then(|texels| texels.parse().ok()) {
                axis.shift = shift;
            } else if let Some(other) = part.strip_prefix('+') {
                axis.also = Some(parameter(other)?);
            } else {
                match part {
                    "centre" | "center" => axis.sampling = Sampling::Centre,
                    "edge" => axis.sampling = Sampling::Edge,
                    "flip" => axis.flip = true,
                    _ => {
                        return Err(Error::usage(
                            format!("axis {text:?} has an unknown part {part:?}"),
                            format!(
                                "write PARAMETER[:SIZE][:LOW..HIGH][:{}][:centre|edge][:flip][:+OTHER], such as mu:64:sqrt:edge",
                                Warp::SYNTAX
                            ),
                        ));
                    }
                }
            }
        }
        Ok(axis)
    }
}

impl TryFrom<String> for Axis {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl From<Axis> for String {
    fn from(axis: Axis) -> Self {
        axis.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every_axis() -> impl Iterator<Item = Axis> {
        let warps =
            Warp::ALL.into_iter().filter(|w| *w != Warp::Log { offset: 0.0 }).chain([Warp::Log { offset: 0.01 }]);
        warps.flat_map(|warp| {
            [Sampling::Centre, Sampling::Edge].into_iter().flat_map(move |sampling| {
                [false, true].map(|flip| {
                    let axis = Axis { sampling, warp, flip, ..Axis::new(Parameter::Mu, 16) };
                    if warp == Warp::F0FourthRoot {
                        Axis { parameter: Parameter::Eta, range: Some((1.0, 4.0)), ..axis }
                    } else {
                        axis
                    }
                })
            })
        })
    }

    #[test]
    fn position_undoes_value_for_every_warp_sampling_and_flip() {
        for axis in every_axis() {
            axis.check().expect("an axis");
            for i in 0..axis.size {
                let got = axis.position(axis.value(i));
                assert!((got - i as f64).abs() < 1e-12, "{axis} texel {i}: got {got}");
            }
        }
    }

    #[test]
    fn the_shader_code_finds_the_position_that_the_axis_has() {
        for axis in every_axis() {
            let code = axis.coordinate(axis.kept_within(Expression::variable("x")));
            for i in 0..=100 {
                let x = axis.value_at_position(f64::from(i) / 100.0 * axis.size as f64 - 0.5);
                let got = code.evaluate(&|_| x) * axis.size as f64 - 0.5;
                let wanted = axis.position(x);
                // 2.2e-8 of the polynomial of acos over π/2, times 16 texels.
                assert!((got - wanted).abs() < 3e-7, "{axis} at {x}: {got} texels, wanted {wanted}; {code}");
            }
        }
        let eta: Axis = "eta:16:f0-fourth-root".parse().expect("an axis");
        let code = eta.coordinate(eta.kept_within(Expression::variable("eta")));
        assert_eq!(code.evaluate(&|_| f64::INFINITY), 1.0);
    }

    #[test]
    fn edges_hold_the_ends_of_the_range_and_centres_do_not() {
        for axis in every_axis() {
            let ends = (axis.value(0), axis.value(axis.size - 1));
            let (low, high) = axis.ends();
            let falls = matches!(axis.warp, Warp::Acos | Warp::SqrtOneMinus | Warp::Reciprocal { .. });
            let wanted = if axis.flip != falls { (high, low) } else { (low, high) };
            assert_eq!(ends == wanted, axis.sampling == Sampling::Edge, "{axis}: ends {ends:?}");
        }
    }

    #[test]
    fn an_axis_prints_as_it_is_parsed() {
        for axis in every_axis() {
            assert_eq!(axis.to_string().parse::<Axis>().expect("own output"), axis);
            assert_eq!(axis.brief().parse::<Axis>().expect("own output"), axis);
        }
        let ranged = "eta:16:1.1..2.5:log:edge".parse::<Axis>().expect("a range");
        assert_eq!((ranged.range, ranged.to_string()), (Some((1.1, 2.5)), "eta:16:1.1..2.5:log:edge".to_owned()));
        for bad in ["mu:64:sqr", "nu:64", "mu:1..", "mu:64:a..b"] {
            assert!(bad.parse::<Axis>().is_err(), "{bad}");
        }
    }

    #[test]
    fn an_axis_stands_for_another_parameter_in_the_same_texture_coordinate() {
        let axis: Axis = "mu:64:sqrt-one-minus:edge:+sin2_radius".parse().expect("an axis");
        axis.check().expect("an axis");
        assert_eq!(axis.to_string(), "mu:64:sqrt-one-minus:edge:+sin2_radius");
        let other = axis.other().expect("another");
        for i in 0..64 {
            let t = i as f64 / 63.0;
            assert!((other.value(i) - t).abs() < 1e-15 && (axis.value(i) - (1.0 - t * t)).abs() < 1e-15, "{i}");
        }
        let centre: Axis = "roughness:8:+cos_centre".parse().expect("an axis");
        assert_eq!(centre.other().expect("another").value(0), -1.0 + 2.0 / 16.0);
        for (bad, says) in
            [("mu:8:+mu", "the same"), ("roughness:8:+alpha", "the same"), ("mu:8:+eta", "begins and ends")]
        {
            let message = bad.parse::<Axis>().expect(bad).check().expect_err(bad).to_string();
            assert!(message.contains(says), "{bad}: {message}");
        }
        assert!("mu:8:+nu".parse::<Axis>().is_err());
    }

    #[test]
    fn an_index_of_refraction_runs_to_infinity_by_the_fourth_root_of_f0() {
        let outside: Axis = "eta:16:f0-fourth-root:edge".parse().expect("an axis");
        outside.check().expect("a range of its own");
        assert_eq!((outside.value(0), outside.value(15)), (1.0, f64::INFINITY));
        let eta = outside.value(8);
        let f0 = ((eta - 1.0) / (eta + 1.0)).powi(2);
        assert!((f0 - (8.0_f64 / 15.0).powi(4)).abs() < 1e-15, "F0 {f0}");
        let inside: Axis = "eta:16:0..1:f0-fourth-root:edge".parse().expect("an axis");
        assert_eq!((inside.value(0), inside.value(15)), (1.0, 0.0), "Cycles' table of the inverse index");
        assert!((inside.value(8) * eta - 1.0).abs() < 1e-14);
    }

    #[test]
    fn a_shift_moves_the_content_and_clamps_it_at_the_end() {
        for axis in every_axis() {
            let shifted = Axis { shift: 1.0, ..axis };
            shifted.check().expect("an axis");
            for i in 0..axis.size - 1 {
                assert_eq!(shifted.value(i), axis.value(i + 1), "{shifted} texel {i}");
                // The inverse finds the texel again, wherever the range has not been left.
                assert!((shifted.position(shifted.value(i)) - i as f64).abs() < 1e-12, "{shifted} texel {i}");
            }
            let last = shifted.value(axis.size - 1);
            assert_eq!(last, axis.value_at_position(axis.size as f64), "{shifted}: the end of the range");
            assert_eq!(shifted.to_string().parse::<Axis>().expect("own output"), shifted);
        }
        let filament: Axis = "roughness:128:shift+1".parse().expect("an axis");
        assert_eq!((filament.value(0), filament.value(126), filament.value(127)), (1.5 / 128.0, 127.5 / 128.0, 1.0));
        assert!("mu:4:shift+4".parse::<Axis>().expect("an axis").check().is_err());
    }

    #[test]
    fn ranges_that_make_no_sense_are_refused_with_the_way_out() {
        for (text, says) in [
            ("eta:16", "give it a range"),
            ("mu:16:0..2", "leaves its domain [0, 1]"),
            ("mu:16:0.5..0.5", "is empty"),
            ("mu:16:1..0", "`:flip`"),
            ("mu:16:log", "log+0.01"),
            ("eta:16:0.5..2:f0-fourth-root", "one side of 1"),
            ("eta:16:1..inf", "a range that ends"),
            ("eta:16:1..2:acos", "within 0..1"),
        ] {
            let message = text.parse::<Axis>().expect(text).check().expect_err(text).to_string();
            assert!(message.contains(says), "{text}: {message}");
        }
    }
}
