//! Integrating a table, texel by texel.

use super::axis::{Axis, LARGEST_SIZE};
use super::quantity::{Handle, Model, Parameter, Point, evaluate_family};
use crate::error::{Error, Result};
use crate::integrate::{ErrorKind, Estimate, Integration};
use rayon::prelude::*;

/// Told how many texels have been finished since the last call, from any thread.
pub type Progress<'a> = &'a (dyn Fn(u64) + Sync);

/// What a table holds and over which axes.
#[derive(Debug, Clone, PartialEq)]
pub struct TableSpec {
    /// The quantities, one per channel.
    pub channels: Vec<Handle>,
    /// The axes, the fastest (x) first.
    pub axes: Vec<Axis>,
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
    /// What the errors are.
    pub kind: ErrorKind,
}

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

    /// The parameters that texel `index` (x fastest) stands for.
    pub fn point(&self, index: usize) -> Point {
        let (mut rest, mut point) = (index, Point::default());
        for axis in &self.axes {
            point.set(axis.parameter, axis.value(rest % axis.size));
            rest /= axis.size;
        }
        point
    }

    /// Whether the table can be baked.
    ///
    /// **Errors**: no channel, an axis missing, superfluous or repeated, an impossible size.
    pub fn check(&self) -> Result<()> {
        if self.channels.is_empty() {
            return Err(Error::usage("a table without channels holds nothing", "name at least one, such as ggx.scale"));
        }
        if self.axes.is_empty() || self.axes.len() > 2 {
            return Err(Error::usage(
                format!("{} axes are not 1 or 2", self.axes.len()),
                "give one axis per parameter, such as mu:64,roughness:64",
            ));
        }
        for axis in &self.axes {
            axis.check()?;
        }
        let texels = self.axes.iter().try_fold(1_usize, |n, a| n.checked_mul(a.size)).unwrap_or(usize::MAX);
        if texels > MOST_TEXELS {
            return Err(Error::usage(
                format!("a table of {texels} texels is more than {MOST_TEXELS}"),
                format!("use smaller axes; {LARGEST_SIZE} is the most along one, 8192x8192 over two"),
            ));
        }
        if let [a, b] = self.axes[..]
            && a.parameter.canonical() == b.parameter.canonical()
        {
            return Err(Error::usage(
                format!("both axes, {} and {}, vary the same parameter", a.parameter, b.parameter),
                "let each axis vary one of its own, such as mu,roughness",
            ));
        }
        for channel in &self.channels {
            for needed in channel.quantity.parameters {
                if self.axis(*needed).is_none() {
                    return Err(Error::usage(
                        format!("{} depends on {needed}, which no axis varies", channel.quantity.name),
                        format!("add an axis for it, such as {needed}:64"),
                    ));
                }
            }
        }
        for axis in &self.axes {
            if !self.channels.iter().any(|c| c.quantity.depends_on(axis.parameter)) {
                return Err(Error::usage(
                    format!("no channel depends on the axis {}", axis.parameter),
                    "remove that axis, or add a channel that varies along it",
                ));
            }
        }
        Ok(())
    }

    /// What computes all channels at a point, each family of quantities once.
    pub fn evaluator(&self) -> Evaluator {
        let mut parts: Vec<Part> = vec![];
        for (channel, handle) in self.channels.iter().enumerate() {
            let fill = Fill { index: handle.index, channel };
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
                        let estimate = self.channels[c].reached(estimate, integration)?;
                        values[x * channels + c] = estimate.value;
                        errors[x * channels + c] = estimate.error;
                    }
                }
                progress(width as u64);
                Ok::<(), Error>(())
            },
        )?;
        let kind = if integration.is_monte_carlo() { ErrorKind::Sigma } else { ErrorKind::Bound };
        Ok(Table { spec: self.clone(), values, errors, kind })
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
}

impl Evaluator {
    /// One estimate per channel.
    ///
    /// **Errors**: a missing parameter.
    pub fn at(&self, at: &Point, integration: &Integration) -> Result<Vec<Estimate>> {
        let mut estimates = vec![Estimate::bound(f64::NAN, f64::NAN); self.n_channels];
        for part in &self.parts {
            let values = evaluate_family(part.handle.family, at, &self.model, integration)?;
            for fill in &part.fills {
                estimates[fill.channel] = values[fill.index];
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
