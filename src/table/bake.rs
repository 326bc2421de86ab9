//! Integrating a table, texel by texel.

use super::axis::{Axis, LARGEST_SIZE};
use super::quantity::{Handle, Model, Parameter, Point, evaluate_family_for};
use super::transform::Transform;
use crate::error::{Error, Result};
use crate::integrate::{ErrorKind, Estimate, Integration};
use rayon::prelude::*;

/// Told how many texels have been finished since the last call, from any thread.
pub type Progress<'a> = &'a (dyn Fn(u64) + Sync);

/// What a table holds and over which axes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TableSpec {
    /// The quantities, one per channel.
    pub channels: Vec<Handle>,
    /// The axes, one to three, the fastest (x) first.
    pub axes: Vec<Axis>,
    /// The parameters that no axis varies.
    pub at: Point,
    /// The choices within the model.
    pub model: Model,
}

/// A baked table in full precision.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// What it holds.
    pub spec: TableSpec,
    /// The values, channel fastest, then the axes in order.
    pub values: Vec<f64>,
    /// Their errors, in the same order.
    pub errors: Vec<f64>,
    /// What the errors of each channel are.
    pub kinds: Vec<ErrorKind>,
}

/// Axes of a table at most: what a texture has.
const MOST_AXES: usize = 3;
/// Texels of a table at most: 1 GiB of values.
const MOST_TEXELS: usize = 1 << 26;

impl TableSpec {
    /// Number of texels.
    pub fn len(&self) -> usize {
        self.axes.iter().map(|a| a.size).product()
    }

    /// Whether there are no texels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Texels along x.
    pub fn width(&self) -> usize {
        self.axes.first().map_or(1, |a| a.size)
    }

    /// Texels along y; 1 for a table over one axis.
    pub fn height(&self) -> usize {
        self.axes.get(1).map_or(1, |a| a.size)
    }

    /// Texels along z; 1 for a table over fewer than three axes.
    pub fn depth(&self) -> usize {
        self.axes.get(2).map_or(1, |a| a.size)
    }

    /// The parameters that texel `index` (x fastest) stands for.
    pub fn point(&self, index: usize) -> Point {
        let (mut rest, mut point) = (index, self.at);
        for axis in &self.axes {
            axis.place(&mut point, (rest % axis.size) as f64);
            rest /= axis.size;
        }
        point
    }

    /// Whether the table can be baked.
    ///
    /// **Errors**: no channel, a parameter missing, superfluous or given twice, an impossible axis.
    pub fn check(&self) -> Result<()> {
        if self.channels.is_empty() {
            return Err(Error::usage("a table without channels holds nothing", "name at least one, such as ggx.scale"));
        }
        if self.axes.is_empty() || self.axes.len() > MOST_AXES {
            return Err(Error::usage(
                format!("{} axes are not 1 to {MOST_AXES}", self.axes.len()),
                "give an axis per parameter, such as mu:64,roughness:64, and the others a value, such as --eta 1.5",
            ));
        }
        for axis in &self.axes {
            axis.check()?;
        }
        let texels = self.axes.iter().try_fold(1_usize, |n, a| n.checked_mul(a.size)).unwrap_or(usize::MAX);
        if texels > MOST_TEXELS {
            return Err(Error::usage(
                format!("a table of {texels} texels is more than {MOST_TEXELS}"),
                format!(
                    "use smaller axes; {LARGEST_SIZE} is the most along one, 8192x8192 over two, 406x406x406 over three"
                ),
            ));
        }
        for (i, axis) in self.axes.iter().enumerate() {
            for parameter in axis.parameters() {
                let same = |other: &Parameter| other.canonical() == parameter.canonical();
                if let Some(other) = self.axes[..i].iter().flat_map(Axis::parameters).find(same) {
                    return Err(Error::usage(
                        format!("two axes, {other} and {parameter}, vary the same parameter"),
                        "let each axis vary one of its own, such as mu,roughness",
                    ));
                }
                if self.at.get(parameter).is_ok() {
                    return Err(Error::usage(
                        format!("{parameter} is given a value, and an axis varies it"),
                        "leave one of them out",
                    ));
                }
            }
        }
        for channel in &self.channels {
            for needed in channel.quantity.parameters {
                if !self.varies(*needed) && self.at.get(*needed).is_err() {
                    let axis =
                        if needed.range().is_some() { format!("{needed}:64") } else { format!("{needed}:16:1..3") };
                    return Err(Error::usage(
                        format!("{} depends on {needed}, which no axis varies", channel.label()),
                        format!("add an axis for it, such as {axis}, or give it a value"),
                    ));
                }
            }
        }
        let superfluous = |p: &Parameter| !self.channels.iter().any(|c| c.quantity.depends_on(*p));
        if let Some(parameter) = self.at.given().map(|(p, _)| p).find(superfluous) {
            return Err(Error::usage(
                format!("no channel depends on {parameter}, which is given a value"),
                format!("leave {parameter} out, or add a channel that depends on it"),
            ));
        }
        for (axis, parameter) in self.axes.iter().flat_map(|a| a.parameters().map(move |p| (a, p))) {
            if !self.channels.iter().any(|c| c.quantity.depends_on(parameter)) {
                return Err(Error::usage(
                    format!("no channel depends on the axis {parameter}"),
                    "remove that axis, or add a channel that varies along it",
                ));
            }
            // What is constant along one parameter of a texture's axis would not be along the other.
            let both = |c: &&Handle| axis.parameters().all(|p| c.quantity.depends_on(p));
            if let (Some(other), Some(channel)) = (axis.also, self.channels.iter().find(both)) {
                return Err(Error::usage(
                    format!("{} depends on {} and on {other}, which share an axis", channel.label(), axis.parameter),
                    "give each an axis of its own",
                ));
            }
        }
        Ok(())
    }

    /// Whether an axis varies `parameter`, or the parameter that it stands for.
    pub fn varies(&self, parameter: Parameter) -> bool {
        self.axes.iter().flat_map(Axis::parameters).any(|p| p.canonical() == parameter.canonical())
    }

    /// What computes all channels at a point, each family of quantities once.
    pub fn evaluator(&self) -> Evaluator {
        self.evaluator_of(|_| true)
    }

    /// The same for the channels that are `wanted`; the others stay NaN.
    pub fn evaluator_of(&self, wanted: impl Fn(&Handle) -> bool) -> Evaluator {
        let mut parts: Vec<Part> = vec![];
        for (channel, handle) in self.channels.iter().enumerate().filter(|(_, h)| wanted(h)) {
            let fill = Fill { index: handle.index, channel, transform: handle.transform };
            match parts.iter_mut().find(|part| part.handle.same_family(handle)) {
                Some(part) => part.fills.push(fill),
                None => parts.push(Part { handle: *handle, fills: vec![fill] }),
            }
        }
        Evaluator { parts, n_channels: self.channels.len(), model: self.model }
    }

    /// Integrates every texel; the same bits for any number of threads.
    ///
    /// **Errors**: [`TableSpec::check`]; a tolerance that some texel does not reach.
    pub fn bake(&self, integration: &Integration, progress: Progress) -> Result<Table> {
        self.check()?;
        let evaluator = self.evaluator();
        let (width, channels) = (self.width(), self.channels.len());
        let row_length = width * channels;
        let mut values = vec![0.0; self.len() * channels];
        let mut errors = vec![0.0; self.len() * channels];
        values.par_chunks_mut(row_length).zip(errors.par_chunks_mut(row_length)).enumerate().try_for_each(
            |(row, (values, errors))| {
                for x in 0..width {
                    let at = self.point(row * width + x);
                    for (c, estimate) in evaluator.at(&at, integration)?.into_iter().enumerate() {
                        let estimate = self.channels[c].reached_at(&at, estimate, integration)?;
                        values[x * channels + c] = estimate.value;
                        errors[x * channels + c] = estimate.error;
                    }
                }
                progress(width as u64);
                Ok::<(), Error>(())
            },
        )?;
        Ok(Table { spec: self.clone(), values, errors, kinds: self.error_kinds(integration) })
    }

    /// What the errors of each channel are.
    pub fn error_kinds(&self, integration: &Integration) -> Vec<ErrorKind> {
        self.channels.iter().map(|c| c.error_kind(integration)).collect()
    }

    /// The axis that varies `parameter`, or the parameter that it stands for.
    pub fn axis(&self, parameter: Parameter) -> Option<&Axis> {
        self.axes.iter().find(|a| a.parameter.canonical() == parameter.canonical())
    }
}

/// Computes the channels of a [`TableSpec`] at any point.
#[derive(Debug)]
pub struct Evaluator {
    parts: Vec<Part>,
    n_channels: usize,
    model: Model,
}

/// One family, by any of its quantities, and the channels that it fills.
#[derive(Debug)]
struct Part {
    handle: Handle,
    fills: Vec<Fill>,
}

/// Which of a family's quantities goes into which channel.
#[derive(Debug)]
struct Fill {
    index: usize,
    channel: usize,
    transform: Transform,
}

impl Evaluator {
    /// One estimate per channel.
    ///
    /// **Errors**: a missing parameter.
    pub fn at(&self, at: &Point, integration: &Integration) -> Result<Vec<Estimate>> {
        let mut estimates = vec![Estimate::bound(f64::NAN, f64::NAN); self.n_channels];
        for part in &self.parts {
            let stretch = part.fills.iter().map(|fill| fill.transform.stretch()).fold(1.0, f64::max);
            let values = evaluate_family_for(part.handle.family, stretch, at, &self.model, integration)?;
            for fill in &part.fills {
                estimates[fill.channel] = fill.transform.estimate(values[fill.index]);
            }
        }
        Ok(estimates)
    }
}

impl Table {
    /// The largest error of each channel.
    pub fn worst_errors(&self) -> Vec<f64> {
        let channels = self.spec.channels.len();
        (0..channels).map(|c| self.errors.iter().skip(c).step_by(channels).copied().fold(0.0, f64::max)).collect()
    }
}
