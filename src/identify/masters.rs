//! Masters: every quantity on a dense grid of its parameters, to be looked up instead of integrated while hypotheses are tried by the
//! thousand.
//!
//! A master is one family of quantities for one model, sampled where it varies (most nodes at grazing angles and small roughness) and
//! interpolated by cubic polynomials. It is good for choosing between hypotheses, to about 1e-4; whatever is chosen is then judged by
//! quadrature.

use super::cache;
use crate::error::{Error, Result};
use crate::integrate::{Integration, Settings};
use crate::math::warp::Warp;
use crate::model::charlie::Visibility;
use crate::model::ggx::Smith;
use crate::model::layered::Kd;
use crate::table::quantity::{self, Handle, evaluate_family};
use crate::table::{Axis, Model, Parameter, Point, Quantity};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::{Arc, Mutex};

/// What one master holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Definition {
    /// A quantity of the family; the master holds all of them.
    pub handle: Handle,
    /// The nodes along each parameter.
    pub nodes: Vec<Axis>,
    /// Values of the parameters that no node varies.
    pub at: Point,
    /// The choices within the model.
    pub model: Model,
}

impl Definition {
    /// The quantities, in the order of the values.
    pub fn quantities(&self) -> &'static [Quantity] {
        self.handle.family.quantities()
    }

    /// What interpolation between the nodes is off by at most, nearly everywhere: in nine of ten places. Where rounding is coarser, a master
    /// tells which texels are rounded wrongly.
    pub fn is_within(&self) -> f64 {
        match (self.nodes.len(), self.handle.quantity.name) {
            (1, _) => 1e-5,
            (2, "dielectric.albedo_avg") | (3, "compensation.none") => 5e-3,
            (3, "dielectric.albedo") => 2e-2,
            (3, "layered.albedo") => 2e-3,
            (2, "ltc-lobe.m00" | "ltc-charlie.m00") => 1e-3,
            (3, "ggx.power_weight" | "ggx.dielectric_weight") => 1e-3,
            (3, "schlick-dielectric.scale") if self.nodes[0].parameter == Parameter::Critical => 5e-3,
            (3, "schlick-dielectric.scale") => 1e-3,
            // Entries grow as the lobe narrows.
            (2, "ltc-m22.m00" | "ltc-m00.m22") => 5e-2,
            // Total reflection begins with a kink.
            (2, "fresnel.dielectric") if self.nodes[1].ends().1 <= 1.0 => 1e-2,
            _ => 2e-4,
        }
    }

    /// Whether a quantity peaks between a node and the next, where interpolation does not see it: a sheen does at mu² ~ alpha, the higher the
    /// smaller both are.
    fn is_steep_at(&self, node: usize) -> bool {
        let n_angles = self.nodes[0].size;
        self.handle.quantity.name == "charlie.albedo"
            && self.model.visibility != Visibility::CharlieSoftened
            && (node.is_multiple_of(n_angles) || node < n_angles)
    }

    /// Everything that its values depend on, to name a file with.
    fn key(&self) -> String {
        let nodes: Vec<String> = self.nodes.iter().map(Axis::to_string).collect();
        let names: Vec<&str> = self.quantities().iter().map(|q| q.name).collect();
        format!("{names:?} {nodes:?} {:?} {:?}", self.at.to_string(), self.model)
    }
}

/// A master with its values.
#[derive(Debug)]
pub struct Master {
    /// What it holds.
    pub definition: Definition,
    /// Each quantity at every node, the first parameter fastest.
    planes: Vec<Vec<f64>>,
    /// The same with NaN where it diverges, or peaks; nothing where it does not.
    known: Option<Vec<Vec<f64>>>,
}

/// What values of a master may be off by.
const TOLERANCE: f64 = 1e-5;
/// The same over one axis, where few nodes are needed.
const TOLERANCE_OF_CURVES: f64 = 1e-7;
/// The same where every value is an integral of integrals.
const TOLERANCE_OF_AVERAGES: f64 = 1e-3;
/// The same of fits, which are far better than they promise, and of those whose entries go into the thousands.
const TOLERANCE_OF_FITS: f64 = 1e-3;
const TOLERANCE_OF_LARGE_FITS: f64 = 3e-2;
/// Points of a value that only Monte Carlo knows.
const SAMPLES: u64 = 4096;

fn axis(parameter: Parameter, size: usize, warp: Warp, range: Option<(f64, f64)>) -> Axis {
    Axis { size, warp, range, sampling: crate::table::Sampling::Edge, ..Axis::new(parameter, size) }
}

/// When masters are asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shelf {
    /// Of every table.
    First,
    /// Of what those do not explain: families that few tables are of.
    Second,
    /// Of the same, but only over the axes of a channel that is known: they are so plain that any slope looks like one.
    Beside,
}

/// A quantity, its nodes, the values of parameters that no node varies, and the choices within the model.
type Row = (&'static str, Vec<Axis>, &'static [(Parameter, f64)], Model);

fn mu(n: usize) -> Axis {
    axis(Parameter::Mu, n, Warp::Log { offset: 0.004 }, None)
}

/// Where things are smooth in the angle; towards grazing they bend at the width of the lobe.
fn angle(n: usize) -> Axis {
    axis(Parameter::Mu, n, Warp::Acos, None)
}

fn roughness(n: usize) -> Axis {
    axis(Parameter::Roughness, n, Warp::Log { offset: 0.08 }, None)
}

fn linear(parameter: Parameter, n: usize) -> Axis {
    axis(parameter, n, Warp::Linear, None)
}

/// Indices of what is entered from outside, and from inside.
fn outside(n: usize) -> Axis {
    axis(Parameter::Eta, n, Warp::F0FourthRoot, None)
}

fn inside(n: usize) -> Axis {
    axis(Parameter::Eta, n, Warp::F0FourthRoot, Some((0.0, 1.0)))
}

/// Every master of a shelf for tables over `n_axes` axes.
pub fn definitions(n_axes: usize, shelf: Shelf) -> Result<Vec<Definition>> {
    let rows = match shelf {
        Shelf::First => first(n_axes),
        Shelf::Second => second(n_axes),
        Shelf::Beside => beside(n_axes),
    };
    rows.into_iter()
        .map(|(name, nodes, values, model)| {
            let given = |p: Parameter| {
                nodes.iter().any(|a| a.parameter.canonical() == p.canonical()) || values.iter().any(|(q, _)| *q == p)
            };
            let handle = quantity::find_among(name, given)?;
            let at = values.iter().try_fold(Point::default(), |at, &(p, v)| at.with(p, v))?;
            Ok(Definition { handle, nodes, at, model })
        })
        .collect()
}

fn first(n_axes: usize) -> Vec<Row> {
    use Parameter as P;
    let plain = Model::default();
    let smith = |smith| Model { smith, ..plain };
    let visibility = |visibility| Model { visibility, ..plain };
    let mut list: Vec<Row> = vec![];
    match n_axes {
        1 => {
            for s in Smith::ALL {
                list.push(("ggx.albedo_avg", vec![roughness(97)], &[], smith(s)));
            }
            for s in [Smith::Correlated, Smith::Separable] {
                list.push(("beckmann.albedo_avg", vec![roughness(97)], &[], smith(s)));
            }
            for v in Visibility::ALL {
                list.push(("charlie.albedo_avg", vec![roughness(97)], &[], visibility(v)));
            }
            list.push(("fresnel.schlick_avg", vec![linear(P::F0, 9)], &[], plain));
            list.push(("fresnel.dielectric_avg", vec![outside(193)], &[], plain));
            list.push(("fresnel.dielectric_avg", vec![inside(193)], &[], plain));
        }
        2 => {
            for s in Smith::ALL {
                list.push(("ggx.scale", vec![mu(65), roughness(49)], &[], smith(s)));
            }
            for s in [Smith::Correlated, Smith::Separable] {
                list.push(("beckmann.scale", vec![mu(57), roughness(41)], &[], smith(s)));
            }
            for v in Visibility::ALL {
                list.push(("charlie.albedo", vec![mu(57), roughness(33)], &[], visibility(v)));
            }
            for name in ["burley.albedo", "burley-renormalized.albedo"] {
                list.push((name, vec![mu(49), linear(P::Roughness, 17)], &[], plain));
            }
            // These have the sine in them: where it is 0, smooth in the angle only.
            list.push(("fujii.albedo", vec![angle(49), linear(P::Roughness, 17)], &[], plain));
            list.push(("oren-nayar.albedo", vec![angle(49), linear(P::Sigma, 33)], &[], plain));
            list.push(("conductor.albedo", vec![mu(41), roughness(25)], &[(P::N, 0.42), (P::K, 2.35)], plain));
            list.push(("fresnel.schlick", vec![mu(65), linear(P::F0, 5)], &[], plain));
            list.push(("fresnel.dielectric", vec![mu(97), outside(65)], &[], plain));
            list.push(("fresnel.dielectric", vec![mu(97), inside(65)], &[], plain));
            let (n, k) = (axis(P::N, 49, Warp::Sqrt, Some((0.01, 8.0))), axis(P::K, 49, Warp::Sqrt, Some((0.0, 16.0))));
            list.push(("fresnel.conductor_avg", vec![n, k], &[], plain));
            list.push(("ltc.m00", vec![angle(37), roughness(27)], &[], plain));
            list.push(("ltc-m22.m00", vec![angle(37), roughness(27)], &[], plain));
            let spheres = [(P::CosCentre, 129), (P::Sin2Radius, 65)].map(|(p, n)| linear(p, n));
            list.push(("sphere.clipped", spheres.to_vec(), &[], plain));
            list.push(("dielectric.albedo_avg", vec![roughness(7), outside(9)], &[], plain));
            list.push(("dielectric.albedo_avg", vec![roughness(7), inside(9)], &[], plain));
        }
        _ => {
            list.push(("dielectric.albedo", vec![mu(21), roughness(13), outside(13)], &[], plain));
            // From inside, total reflection begins at a step wherever the index puts it, steep where facets are smooth.
            let steep = axis(P::Mu, 33, Warp::Sqrt, None);
            list.push(("dielectric.albedo", vec![steep, roughness(13), inside(33)], &[], plain));
            list.push(("eon.albedo", vec![mu(25), linear(P::Roughness, 9), linear(P::Rho, 9)], &[], plain));
            list.push(("compensation.none", vec![mu(17), roughness(9), linear(P::F0, 3)], &[], plain));
            for kd in [Kd::Fresnel, Kd::Albedo, Kd::Reciprocal] {
                let model = Model { kd, ..plain };
                list.push(("layered.albedo", vec![mu(21), roughness(13), linear(P::F0, 5)], &[(P::Rho, 0.8)], model));
            }
            let (n, k) = (axis(P::N, 21, Warp::Sqrt, Some((0.01, 8.0))), axis(P::K, 21, Warp::Sqrt, Some((0.0, 16.0))));
            list.push(("fresnel.conductor", vec![mu(33), n, k], &[], plain));
            list.push(("fresnel.f82", vec![mu(65), linear(P::F0, 5), linear(P::F82, 5)], &[], plain));
            let wide = |p| axis(p, 9, Warp::Sqrt, None);
            let between = &[(P::Phi, std::f64::consts::FRAC_PI_4)];
            list.push(("ggx.albedo", vec![mu(17), wide(P::AlphaX), wide(P::AlphaY)], between, plain));
        }
    }
    list
}

fn second(n_axes: usize) -> Vec<Row> {
    use Parameter as P;
    let plain = Model::default();
    match n_axes {
        2 => vec![
            ("ltc-lobe.m00", vec![angle(37), roughness(27)], &[], plain),
            ("ltc-m00.m22", vec![angle(37), roughness(27)], &[], plain),
            ("ltc-burley.m00", vec![angle(25), linear(P::Roughness, 13)], &[], plain),
            ("ltc-charlie.m00", vec![angle(33), roughness(21)], &[], plain),
        ],
        3 => vec![
            ("ggx.power_weight", vec![mu(33), roughness(17), exponent(17)], &[], plain),
            ("ggx.dielectric_weight", vec![mu(33), roughness(17), outside(17)], &[], plain),
            ("schlick-dielectric.scale", vec![mu(33), roughness(17), outside(17)], &[], plain),
            // A node in the middle, where total reflection begins.
            ("schlick-dielectric.scale", vec![linear(P::Critical, 33), roughness(17), inside(13)], &[], plain),
        ],
        _ => vec![],
    }
}

/// Powers from 0 to infinity: as many below 5 as above.
fn exponent(n: usize) -> Axis {
    axis(Parameter::Exponent, n, Warp::Reciprocal { half: 5.0 }, None)
}

fn beside(n_axes: usize) -> Vec<Row> {
    const NOTHING: &[(Parameter, f64)] = &[];
    match n_axes {
        // Its numbers are the same beside any sheen, of which a table has one.
        2 => Visibility::ALL
            .map(|visibility| {
                let model = Model { visibility, ..Model::default() };
                ("fabric-lambert.albedo", vec![mu(4), linear(Parameter::Roughness, 4)], NOTHING, model)
            })
            .into(),
        _ => vec![],
    }
}

/// Masters that this process has already, by their keys.
static LOADED: Mutex<Vec<(String, Arc<Master>)>> = Mutex::new(vec![]);

/// The masters of a shelf for tables over `n_axes` axes: from memory, from the cache, or integrated now and kept.
///
/// **Errors**: those of the integrator. A cache that cannot be read or written is no error: it only saves time.
pub fn load(n_axes: usize, shelf: Shelf, use_cache: bool) -> Result<Vec<Arc<Master>>> {
    definitions(n_axes, shelf)?
        .into_iter()
        .map(|definition| {
            let key = definition.key();
            let known = |loaded: &Vec<(String, Arc<Master>)>| {
                loaded.iter().find(|(k, _)| *k == key).map(|(_, master)| Arc::clone(master))
            };
            if let Some(master) = LOADED.lock().ok().and_then(|loaded| known(&loaded)) {
                return Ok(master);
            }
            let n = definition.nodes.iter().map(|a| a.size).product::<usize>() * definition.quantities().len();
            let values = match cache::read(&key, n).filter(|_| use_cache) {
                Some(values) => values,
                None => {
                    let values = integrate(&definition)?;
                    if use_cache {
                        cache::write(&key, &values);
                    }
                    values
                }
            };
            let master = Arc::new(Master::new(definition, &values));
            if let Ok(mut loaded) = LOADED.lock() {
                loaded.push((key, Arc::clone(&master)));
            }
            Ok(master)
        })
        .collect()
}

/// The values at every node, the first parameter fastest, all quantities of a node together; NaN where they diverge.
pub(super) fn integrate(definition: &Definition) -> Result<Vec<f64>> {
    let family = definition.handle.family;
    let settings = if family.has_quadrature() {
        let tolerance = match (definition.nodes.len(), definition.handle.quantity.name) {
            (_, "dielectric.albedo_avg" | "compensation.none") => TOLERANCE_OF_AVERAGES,
            (_, "ltc.m00" | "ltc-lobe.m00" | "ltc-burley.m00") => TOLERANCE_OF_FITS,
            (_, "ltc-m22.m00" | "ltc-m00.m22" | "ltc-charlie.m00") => TOLERANCE_OF_LARGE_FITS,
            (1, _) => TOLERANCE_OF_CURVES,
            _ => TOLERANCE,
        };
        Settings { tolerance: Some(tolerance), ..Settings::default() }
    } else {
        Settings { samples: Some(SAMPLES), ..Settings::default() }
    };
    let integration = Integration::new(settings)?;
    let n = definition.nodes.iter().map(|a| a.size).product::<usize>();
    let rows: Vec<Vec<f64>> = (0..n)
        .into_par_iter()
        .map(|node| {
            let (mut rest, mut at) = (node, definition.at);
            for axis in &definition.nodes {
                at.set(axis.parameter, axis.value(rest % axis.size));
                rest /= axis.size;
            }
            match evaluate_family(family, &at, &definition.model, &integration) {
                Ok(estimates) => Ok(estimates.into_iter().map(|e| e.value).collect()),
                Err(Error::Unsupported(_)) => Ok(vec![f64::NAN; definition.quantities().len()]), // it diverges there
                Err(other) => Err(other),
            }
        })
        .collect::<Result<_>>()?;
    Ok(rows.concat())
}

/// Four neighbouring nodes and their weights: a cubic polynomial through them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taps {
    /// The first node.
    pub first: usize,
    /// The weights; of axes of fewer nodes, the last are 0.
    pub weights: [f64; 4],
}

impl Taps {
    /// At a position in nodes.
    pub fn new(position: f64, n: usize) -> Self {
        let points = n.min(4);
        let position = if position.is_nan() { 0.0 } else { position.clamp(0.0, (n - 1) as f64) };
        let first = (position.floor() as usize).saturating_sub(1).min(n - points);
        let x = position - first as f64;
        let mut weights = [0.0; 4];
        for (i, weight) in weights.iter_mut().enumerate().take(points) {
            *weight = (0..points).filter(|&j| j != i).map(|j| (x - j as f64) / (i as f64 - j as f64)).product();
        }
        Self { first, weights }
    }
}

/// Values of a grid of these sizes, the first fastest, looked up along dimension `d`.
pub fn along(values: &[f64], sizes: &[usize], d: usize, taps: &[Taps]) -> Vec<f64> {
    let stride: usize = sizes[..d].iter().product();
    let outer: usize = sizes[d + 1..].iter().product();
    let (from, to) = (sizes[d], taps.len());
    if d == 0 && from >= 4 {
        // Lines of one number each: four at a time instead.
        let mut shrunk = vec![0.0; to * outer];
        for (line, out) in values.chunks_exact(from).zip(shrunk.chunks_exact_mut(to)) {
            for (out, Taps { first, weights: w }) in out.iter_mut().zip(taps) {
                if let Some([a, b, c, d]) = line.get(*first..).and_then(|rest| rest.first_chunk()) {
                    *out = a * w[0] + b * w[1] + c * w[2] + d * w[3];
                }
            }
        }
        return shrunk;
    }
    let mut shrunk = vec![0.0; stride * to * outer];
    for o in 0..outer {
        for (t, tap) in taps.iter().enumerate() {
            let out = &mut shrunk[(o * to + t) * stride..][..stride];
            let lines = [0, 1, 2, 3].map(|k| values.get((o * from + tap.first + k) * stride..));
            if from >= 4
                && let [Some(a), Some(b), Some(c), Some(d)] = lines
            {
                let w = &tap.weights;
                for ((((out, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                    *out = a * w[0] + b * w[1] + c * w[2] + d * w[3];
                }
                continue;
            }
            for (k, &weight) in tap.weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                let line = &values[(o * from + tap.first + k) * stride..][..stride];
                out.iter_mut().zip(line).for_each(|(out, v)| *out += weight * v);
            }
        }
    }
    shrunk
}

impl Master {
    /// Of values at every node, the first parameter fastest, all quantities of a node together.
    pub(super) fn new(definition: Definition, values: &[f64]) -> Self {
        let n_quantities = definition.quantities().len();
        let plane = |q| values.chunks_exact(n_quantities).map(|node| node[q]).collect();
        let mut planes: Vec<Vec<f64>> = (0..n_quantities).map(plane).collect();
        let steep: Vec<usize> = (0..planes[0].len()).filter(|&node| definition.is_steep_at(node)).collect();
        if steep.is_empty() && !values.iter().any(|v| v.is_nan()) {
            return Self { planes, known: None, definition };
        }
        let mut known = planes.clone();
        for (plane, known) in planes.iter_mut().zip(&mut known) {
            steep.iter().for_each(|&node| known[node] = f64::NAN);
            // Where a quantity diverges, no table holds its value either: the next node's does for interpolation beside it.
            let mut next = 0.0;
            for value in plane.iter_mut().rev() {
                if value.is_nan() {
                    *value = next;
                }
                next = *value;
            }
        }
        Self { planes, known: Some(known), definition }
    }

    /// Quantity `q` at every node, the first parameter fastest; where it diverges, what it is at the next.
    pub fn plane(&self, q: usize) -> &[f64] {
        &self.planes[q]
    }

    /// The same with NaN where it diverges or peaks: what is interpolated beside such a node is NaN then, for it is far off there.
    pub fn known(&self, q: usize) -> &[f64] {
        &self.known.as_ref().unwrap_or(&self.planes)[q]
    }

    /// What this plane of the master says at every texel of a grid that is the product of the taps along each parameter, the first
    /// fastest.
    pub fn grid(&self, plane: &[f64], taps: &[Vec<Taps>]) -> Vec<f64> {
        // One parameter after the other, from the last: each shrinks the grid to what is asked for.
        let mut values = Cow::Borrowed(plane);
        let mut sizes: Vec<usize> = self.definition.nodes.iter().map(|a| a.size).collect();
        for dimension in (0..sizes.len()).rev() {
            values = along(&values, &sizes, dimension, &taps[dimension]).into();
            sizes[dimension] = taps[dimension].len();
        }
        values.into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_taps_are_exact_for_cubics() {
        let f = |x: f64| 1.0 - x + 0.5 * x * x - 0.1 * x * x * x;
        for position in [0.0, 0.3, 1.0, 2.5, 6.9, 7.0] {
            let taps = Taps::new(position, 8);
            let got: f64 = taps.weights.iter().enumerate().map(|(i, w)| w * f((taps.first + i) as f64)).sum();
            assert!((got - f(position)).abs() < 1e-12, "{position}: {got}");
        }
        assert_eq!(Taps::new(0.5, 2).weights, [0.5, 0.5, 0.0, 0.0]);
    }
}
