//! What quadrature says of hypotheses, texel by texel, and how far the table is from it.

use super::apart::{Apart, apart, blocks, pattern};
use super::hypothesis::{self, Choice, Data, Hypothesis};
use super::masters::Definition;
use super::residual::rms_without_worst;
use crate::claim::Curve;
use crate::error::{Error, Result};
use crate::integrate::{Estimate, Integration, Settings};
use crate::model::charlie::Visibility;
use crate::table::Point;
use crate::table::quantity::evaluate_family;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// Texels along each dimension at which a hypothesis is judged by quadrature at most, and one whose integrals are dear.
const JUDGED: [usize; 3] = [128, 48, 12];
const JUDGED_IF_DEAR: [usize; 3] = [64, 12, 6];
/// What values may be off by when hypotheses are judged by them.
pub const JUDGED_TO: f64 = 1e-6;
/// Whether values take longest, of the family of a master.
fn is_dear(definition: &Definition) -> bool {
    match definition.handle.quantity.name {
        "dielectric.albedo" | "dielectric.albedo_avg" | "compensation.none" | "layered.albedo" => true,
        fit if fit.starts_with("ltc") => true,
        "charlie.albedo_avg" => definition.model.visibility == Visibility::Charlie,
        _ => false,
    }
}

/// Texels that are looked at before all are, and where their values take longest: most explanations fail at one of the first.
const FIRST_LOOK: usize = 256;
const FIRST_LOOK_IF_DEAR: usize = 48;
/// What is left by the masters, in parts of a channel's variation, above which quadrature has nothing to add: it will not be believed.
const NOT_TO_BE_BELIEVED: f64 = 0.25;

/// A hypothesis, what it costs by the masters, and its residuals by quadrature.
#[derive(Debug, Clone)]
pub struct Ranked {
    pub hypothesis: Hypothesis,
    pub cost: f64,
    /// Root mean square of what is left, in stored units, by quadrature.
    pub rms: f64,
    /// The same without the worst tenth.
    pub trimmed: f64,
    /// The texels at which it was judged.
    pub choice: Choice,
    /// What it says of them, and what that may be off by; empty where it is not to be believed.
    pub says: Vec<(f64, f64)>,
    /// The part of them at which the file has another number than correct rounding would give.
    pub misrounded: f64,
    /// Whether it is as good as the best, but not over the axes that more of the table's channels are explained over.
    pub disagrees: bool,
}

impl Ranked {
    /// What it leaves by quadrature, with the price that the masters' residual had.
    pub fn exact_cost(&self, data: &Data) -> f64 {
        let price = self.cost / (self.hypothesis.residual + data.floor());
        (self.trimmed + data.rounding + JUDGED_TO) * price
    }

    /// Whether every texel is the correct rounding of what it says, as far as quadrature tells.
    pub fn is_exact(&self) -> bool {
        !self.says.is_empty() && self.misrounded == 0.0
    }

    /// Whether both say the same of every texel, as far as quadrature tells.
    pub fn same_numbers(&self, other: &Self) -> bool {
        let pairs = || self.says.iter().zip(&other.says);
        // Errors of Monte Carlo are standard errors: four of their sum, so that hardly one in ten thousand is farther off by chance.
        let near = |((a, a_error), (b, b_error)): (&(f64, f64), &(f64, f64))| {
            (a.is_nan() && b.is_nan()) || (a - b).abs() <= 2.0 * JUDGED_TO + 4.0 * (a_error + b_error)
        };
        !self.says.is_empty() && self.says.len() == other.says.len() && pairs().all(near)
    }

    /// Whether another channel of the same table, of which it is certain what it holds, leaves `other` as a rival: it does where this one
    /// stands for other places or another model than that channel, or where `other` stands for the same and is another quantity.
    pub fn is_rivalled_by(&self, other: &Self, certain: &Self) -> bool {
        let model = |r: &Self| r.hypothesis.master.definition.model;
        let is_known = |r: &Self| r.hypothesis.ramps == certain.hypothesis.ramps && model(r) == model(certain);
        !is_known(self) || is_known(other)
    }
}

/// What an explanation leaves of a table that is no rounding.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Noise {
    /// What neighbouring texels have in common of it: about 1 of independent noise, many times as much of what has a pattern.
    pub pattern: f64,
    /// Where it has none: how many random samples a texel, of the quantity's own sampler, leave as much; nothing where nobody draws so few or
    /// so many.
    pub samples: Option<f64>,
}

impl Noise {
    /// Whether neighbours have more in common than noise has.
    pub fn is_patterned(&self) -> bool {
        self.pattern > NO_PATTERN
    }
}

/// What neighbours may have in common of noise that has no pattern: 64 blocks leave a standard deviation of 0.18.
const NO_PATTERN: f64 = 2.0;

/// Asks quadrature, each thing once: channels of one table, encodings and readings of one file are judged at the same places.
pub struct Judge {
    quadrature: Integration,
    /// Of quantities that only chance knows.
    monte_carlo: Integration,
    known: Mutex<HashMap<Place, Option<Vec<Estimate>>>>,
}

/// Whose quantities, and where: parameters by number, and the bits of their values.
type Place = (usize, Vec<(usize, u64)>);

/// Places that are remembered at most: some tens of megabytes.
const REMEMBERED: usize = 200_000;

impl Judge {
    /// One that knows nothing yet.
    ///
    /// **Errors**: those of [`Integration::new`].
    pub fn new() -> Result<Self> {
        let settings = Settings::default();
        Ok(Self {
            quadrature: Integration::new(Settings { tolerance: Some(JUDGED_TO), ..settings })?,
            monte_carlo: Integration::new(Settings { samples: Some(4096), ..settings })?,
            known: Mutex::default(),
        })
    }

    /// What a texel stands for.
    fn place(&self, hypothesis: &Hypothesis, data: &Data, texel: usize) -> Point {
        let definition = &hypothesis.master.definition;
        let (mut rest, mut at) = (texel, definition.at);
        for (ramp, &size) in hypothesis.ramps.iter().zip(&data.sizes) {
            at.set(ramp.parameter, ramp.value(rest % size));
            rest /= size;
        }
        if let (Some(free), Some(last)) = (hypothesis.free, definition.nodes.last()) {
            at.set(last.parameter, free);
        }
        at
    }

    /// The quantities of the hypothesis' family at a texel; nothing where they diverge.
    fn values(&self, hypothesis: &Hypothesis, data: &Data, texel: usize) -> Result<Option<Vec<Estimate>>> {
        let definition = &hypothesis.master.definition;
        let at = self.place(hypothesis, data, texel);
        let place: Place = (
            Arc::as_ptr(&hypothesis.master).addr(),
            at.given().map(|(parameter, value)| (parameter as usize, value.to_bits())).collect(),
        );
        if let Some(known) = self.known.lock().ok().and_then(|known| known.get(&place).cloned()) {
            return Ok(known);
        }
        let family = definition.handle.family;
        let integration = if family.has_quadrature() { &self.quadrature } else { &self.monte_carlo };
        let values = match evaluate_family(family, &at, &definition.model, integration) {
            Ok(estimates) => Some(estimates),
            Err(Error::Unsupported(_)) => None,
            Err(other) => return Err(other),
        };
        if let Ok(mut known) = self.known.lock()
            && known.len() < REMEMBERED
        {
            known.insert(place, values.clone());
        }
        Ok(values)
    }

    /// What a hypothesis says of a texel as it is stored, before it is rounded, and what that may be off by.
    fn at_texel(&self, hypothesis: &Hypothesis, data: &Data, texel: usize) -> Result<(f64, f64)> {
        let (exact, error) = match self.values(hypothesis, data, texel)? {
            Some(estimates) => (estimates[hypothesis.quantity].value, estimates[hypothesis.quantity].error),
            None => (f64::NAN, 0.0),
        };
        let stored = hypothesis.encoding.encode(exact);
        Ok((stored, (hypothesis.encoding.encode(exact + error) - stored).abs()))
    }

    /// Whether one of some texels is not the correct rounding of what is said of it.
    pub fn is_refuted(&self, hypothesis: &Hypothesis, data: &Data) -> Result<bool> {
        let definition = &hypothesis.master.definition;
        if !definition.handle.family.has_quadrature() {
            return Ok(true); // as far as chance tells, nothing is exact
        }
        let n = data.values.len();
        let look = if is_dear(definition) { FIRST_LOOK_IF_DEAR } else { FIRST_LOOK };
        // Far apart from each other, and in all rows and columns.
        let share_none = |step: &usize| (2..=*step).all(|d| !step.is_multiple_of(d) || !n.is_multiple_of(d));
        let step = (n * 5 / 8..n).find(share_none).unwrap_or(1);
        for k in 0..n.min(look) {
            let texel = k * step % n;
            if is_off(self.at_texel(hypothesis, data, texel)?, hypothesis.encoding.curve, data, texel) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The hypothesis with its residuals by quadrature.
    pub fn judged(&self, hypothesis: Hypothesis, cost: f64, data: &Data) -> Result<Ranked> {
        if hypothesis.relative(data) > NOT_TO_BE_BELIEVED {
            let left = hypothesis.residual;
            return Ok(Ranked {
                hypothesis,
                cost,
                rms: left,
                trimmed: left,
                choice: vec![],
                says: vec![],
                misrounded: 1.0,
                disagrees: false,
            });
        }
        self.judged_by_quadrature(hypothesis, cost, data)
    }

    /// The same, however far the master is off.
    pub fn judged_by_quadrature(&self, hypothesis: Hypothesis, cost: f64, data: &Data) -> Result<Ranked> {
        let definition = &hypothesis.master.definition;
        let family = definition.handle.family;
        let dear = is_dear(definition) || !family.has_quadrature();
        let most = if dear { JUDGED_IF_DEAR } else { JUDGED };
        let choice = hypothesis::choice(&data.sizes, most[data.sizes.len() - 1]);
        let texels = hypothesis::indices(&data.sizes, &choice);
        let says: Vec<(f64, f64)> =
            texels.par_iter().map(|&texel| self.at_texel(&hypothesis, data, texel)).collect::<Result<_>>()?;
        let curve = hypothesis.encoding.curve;
        let off = |(says, &texel): (&(f64, f64), &usize)| {
            ((says.0 - data.values[texel]).abs(), is_off(*says, curve, data, texel))
        };
        let offs: Vec<(f64, bool)> = says.iter().zip(&texels).map(off).filter(|(off, _)| off.is_finite()).collect();
        let misrounded = offs.iter().filter(|(_, far)| *far).count() as f64 / offs.len().max(1) as f64;
        let mut squares: Vec<f64> = offs.iter().map(|(off, _)| off * off).collect();
        if 2 * squares.len() < texels.len() {
            squares = vec![f64::INFINITY]; // where it has no value it explains nothing
        }
        let rms = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        let trimmed = rms_without_worst(&mut squares);
        Ok(Ranked { hypothesis, cost, rms, trimmed, choice, says, misrounded, disagrees: false })
    }

    /// Where the table is on the line from one explanation to another, and what they are apart there, RMS; nothing where that cannot be told.
    ///
    /// **Errors**: those of the integrator.
    pub fn apart(&self, best: &Ranked, other: &Ranked, data: &Data) -> Result<Option<(Apart, f64)>> {
        let texels = hypothesis::indices(&data.sizes, &other.choice);
        if best.says.is_empty() || other.says.is_empty() {
            return Ok(None);
        }
        let says: Vec<(f64, f64)> = if best.choice == other.choice {
            best.says.clone()
        } else {
            texels.par_iter().map(|&texel| self.at_texel(&best.hypothesis, data, texel)).collect::<Result<_>>()?
        };
        let left: Vec<f64> = texels.iter().zip(&says).map(|(&texel, says)| data.values[texel] - says.0).collect();
        let difference: Vec<f64> = other.says.iter().zip(&says).map(|(other, own)| other.0 - own.0).collect();
        let finite: Vec<f64> = difference.iter().copied().filter(|d| d.is_finite()).collect();
        let rms = (finite.iter().map(|d| d * d).sum::<f64>() / finite.len().max(1) as f64).sqrt();
        let counts: Vec<usize> = other.choice.iter().map(Vec::len).collect();
        Ok(apart(&left, &difference, &blocks(&counts)).map(|apart| (apart, rms)))
    }

    /// What an explanation leaves, looked at as noise; nothing where it is not to be believed.
    ///
    /// **Errors**: those of the integrator.
    pub fn noise(&self, best: &Ranked, data: &Data) -> Result<Option<Noise>> {
        if best.says.is_empty() {
            return Ok(None);
        }
        let texels = hypothesis::indices(&data.sizes, &best.choice);
        let left: Vec<f64> = texels.iter().zip(&best.says).map(|(&texel, says)| data.values[texel] - says.0).collect();
        let counts: Vec<usize> = best.choice.iter().map(Vec::len).collect();
        let pattern = pattern(&left, &blocks(&counts));
        let samples = if pattern <= NO_PATTERN { self.samples(best, data, &texels, &left)? } else { None };
        Ok(Some(Noise { pattern, samples }))
    }

    /// How many random samples a texel leave as much, in the middle of some texels.
    fn samples(&self, best: &Ranked, data: &Data, texels: &[usize], left: &[f64]) -> Result<Option<f64>> {
        /// Texels that are looked at, and samples that their variance is learnt from.
        const LOOKED_AT: usize = 96;
        const LEARNT_FROM: u64 = 256;
        /// Nobody draws more for a texel: what is as little as they would leave, arithmetic left.
        const MOST: f64 = 1e9;
        /// The middle of the squares of numbers of variance 1 that are spread as errors are.
        const MEDIAN: f64 = 0.4549;
        let definition = &best.hypothesis.master.definition;
        let integration = Integration::new(Settings { samples: Some(LEARNT_FROM), ..Settings::default() })?;
        let some = (0..texels.len()).step_by((texels.len() / LOOKED_AT).max(1)).map(|i| {
            let at = self.place(&best.hypothesis, data, texels[i]);
            let Ok(sampled) = definition.handle.family.monte_carlo(&at, &definition.model, &integration) else {
                return f64::NAN;
            };
            let error = sampled[best.hypothesis.quantity].error * (LEARNT_FROM as f64).sqrt();
            let encoding = best.hypothesis.encoding;
            let (says, _) = best.says[i];
            let stored = (encoding.encode(encoding.decode(says) + error) - says).abs();
            (left[i] / stored).powi(2)
        });
        let mut squares: Vec<f64> = some.filter(|square| square.is_finite()).collect();
        squares.sort_by(f64::total_cmp);
        Ok(squares.get(squares.len() / 2).map(|middle| MEDIAN / middle).filter(|n| (1.0..=MOST).contains(n)))
    }
}

/// Whether a texel is not the correct rounding of what is said of it: neither the nearest code, nor that of which the value is nearest, which
/// packers take.
fn is_off((says, error): (f64, f64), curve: Curve, data: &Data, texel: usize) -> bool {
    let (code, step) = (data.values[texel], data.steps[texel]);
    let neighbour = code + step.copysign(says - code);
    let half_way = curve.apply(0.5 * (curve.undo(code) + curve.undo(neighbour)));
    (says - code).abs() > f64::max(0.5 * step, (half_way - code).abs()) + 2.0 * JUDGED_TO + error
}
