//! Facts about the values of a table.

use super::{Check, Precision, SIGMAS, WITNESS_POINTS, weyl};
use crate::error::Result;
use crate::integrate::{ErrorKind, Estimate, Integration, Integrator, QUADRATURE_TOLERANCE, Settings, quadrature};
use crate::model::smith::Smith;
use crate::table::quantity::Handle;
use crate::table::{Parameter, TableSpec, Trend};
use rayon::prelude::*;

/// Which of a table's values are looked at, and what they may be off by.
#[derive(Debug, Clone, Copy)]
pub struct TableValues<'a> {
    /// What the table claims to hold.
    pub spec: &'a TableSpec,
    /// The values, channel fastest.
    pub values: &'a [f64],
    /// The largest error of each channel as claimed, before packing: a bound, or a standard error.
    pub errors: &'a [f64],
    /// What the errors of each channel are.
    pub kinds: &'a [ErrorKind],
    /// What packing may have changed.
    pub precision: Precision,
}

/// What is compared with is integrated to this part of what a texel may be off by, but to no less than …
const PART: f64 = 0.01;
/// … this.
const FINEST: f64 = 0.1 * QUADRATURE_TOLERANCE;

/// E of GGX, seen at `mu`, to be compared with what may be off by `allowed`.
fn albedo(mu: f64, alpha: f64, smith: Smith, allowed: f64) -> Estimate {
    if alpha == 0.0 {
        return Estimate::bound(1.0, 0.0);
    }
    quadrature::ggx_albedo(mu, alpha, smith, (PART * allowed).max(FINEST))
}

/// By how much a texel is off, and by how much it may be.
struct Deviation {
    texel: usize,
    off: f64,
    tolerance: f64,
}

impl Deviation {
    fn ratio(&self) -> f64 {
        if self.off.is_nan() { f64::INFINITY } else { self.off.abs() / self.tolerance }
    }
}

impl TableValues<'_> {
    /// How far `value` of `channel` may be from the truth: its integration error and half a unit of the last place.
    fn tolerance(&self, channel: usize, value: f64) -> f64 {
        let integration = match self.kinds[channel] {
            ErrorKind::Bound => self.errors[channel],
            ErrorKind::Sigma | ErrorKind::Measured => SIGMAS * self.errors[channel],
        };
        integration + self.precision.tolerance(channel, value)
    }

    fn channel(&self, channel: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.values.iter().copied().skip(channel).step_by(self.spec.channels.len()).enumerate()
    }

    /// The parameters of a texel, for a report: `mu 0.12, roughness 0.5 (texel 7, 32)`.
    fn place(&self, texel: usize) -> String {
        let mut rest = texel;
        let (mut parameters, mut indices) = (vec![], vec![]);
        for axis in &self.spec.axes {
            parameters.push(format!("{} {:.4}", axis.parameter, axis.value(rest % axis.size)));
            indices.push((rest % axis.size).to_string());
            rest /= axis.size;
        }
        format!("{} (texel {})", parameters.join(", "), indices.join(", "))
    }

    /// The check of one kind of deviation over many texels: figure and limit are those of the worst, in parts of its tolerance.
    fn worst(&self, name: &str, channel: usize, deviations: impl Iterator<Item = Deviation>) -> Option<Check> {
        let (mut worst, mut count) = (None, 0);
        for deviation in deviations {
            count += 1;
            if worst.as_ref().is_none_or(|w: &Deviation| deviation.ratio() > w.ratio()) {
                worst = Some(deviation);
            }
        }
        let Deviation { texel, off, tolerance } = worst?;
        let detail = format!("worst of {count} at {}", self.place(texel));
        Some(Check::at_most(name, &self.spec.channels[channel].label(), off.abs(), tolerance, detail))
    }

    /// What holds of texels that are chosen for the lookup too: they are finite and within the quantities' bounds.
    pub fn ranges(&self) -> Vec<Check> {
        (0..self.spec.channels.len()).flat_map(|c| self.range(c)).collect()
    }

    /// Every fact that is known of the quantities: bounds, closed forms, limits, sums.
    pub fn facts(&self) -> Vec<Check> {
        let mut checks = vec![];
        for c in 0..self.spec.channels.len() {
            checks.extend(self.range(c));
            checks.extend(self.identities(c));
            checks.extend((0..self.spec.axes.len()).filter_map(|axis| self.monotony(c, axis)));
        }
        checks.extend(self.scale_plus_bias());
        checks.extend(self.closure());
        checks
    }

    fn range(&self, c: usize) -> Vec<Check> {
        let handle = &self.spec.channels[c];
        let mut checks = vec![];
        let bad = self.channel(c).filter(|(_, v)| !v.is_finite()).count();
        let name = &handle.label();
        checks.push(Check::at_most("values that are not finite", name, bad as f64, 0.0, "counted over all texels"));
        let (low, high) = handle.bounds();
        let outside = self.channel(c).map(|(texel, v)| {
            let excess = if v.is_nan() { v } else { (low - v).max(v - high).max(0.0) };
            Deviation { texel, off: excess, tolerance: self.tolerance(c, v) }
        });
        checks.extend(self.worst("distance outside the quantity's bounds", c, outside));
        checks
    }

    /// The texels against those of another table of the same kind.
    pub fn against(&self, name: &str, wanted: &[f64]) -> Vec<Check> {
        let n = self.spec.channels.len();
        let deviations = |c: usize| {
            self.channel(c).map(move |(texel, value)| {
                let wanted = wanted[texel * n + c];
                Deviation { texel, off: value - wanted, tolerance: self.tolerance(c, wanted) }
            })
        };
        (0..n).filter_map(|c| self.worst(name, c, deviations(c))).collect()
    }

    /// Steps the wrong way, along an axis on which the quantity is monotone.
    fn monotony(&self, channel: usize, axis: usize) -> Option<Check> {
        let varied = &self.spec.axes[axis];
        let trend = self.spec.channels[channel].trend(varied.parameter)?;
        let n = self.spec.channels.len();
        let stride: usize = self.spec.axes[..axis].iter().map(|a| a.size).product();
        let mut order: Vec<(f64, usize)> = (0..varied.size).map(|i| (varied.value(i), i)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Axes that run to infinity may come to the same value twice.
        order.dedup_by(|b, a| a.0 == b.0);
        let steps =
            (0..self.spec.len()).filter(|texel| (texel / stride).is_multiple_of(varied.size)).flat_map(|first| {
                order.windows(2).map(move |pair| [pair[0].1, pair[1].1].map(|i| first + i * stride)).collect::<Vec<_>>()
            });
        let deviations = steps.map(|[before, after]| {
            let (a, b) = (self.values[before * n + channel], self.values[after * n + channel]);
            let wrong = if trend == Trend::Rises { a - b } else { b - a };
            let tolerance = self.tolerance(channel, a) + self.tolerance(channel, b);
            Deviation { texel: after, off: if wrong.is_nan() { wrong } else { wrong.max(0.0) }, tolerance }
        });
        let name = format!("steps against its trend along {}", varied.parameter);
        self.worst(&name, channel, deviations)
    }

    /// Closed forms and limits, at the texels where the quantity has them.
    fn identities(&self, channel: usize) -> Vec<Check> {
        let handle = self.spec.channels[channel];
        let mut known: Vec<(&'static str, Vec<Deviation>)> = vec![];
        for (texel, value) in self.channel(channel) {
            for identity in handle.family.identities(&self.spec.point(texel), &self.spec.model) {
                if identity.quantity != handle.index {
                    continue;
                }
                let exact = handle.transform.estimate(Estimate::bound(identity.value, identity.slack));
                let tolerance = exact.error + self.tolerance(channel, exact.value);
                let row = Deviation { texel, off: value - exact.value, tolerance };
                match known.iter_mut().find(|(fact, _)| *fact == identity.fact) {
                    Some((_, rows)) => rows.push(row),
                    None => known.push((identity.fact, vec![row])),
                }
            }
        }
        known.into_iter().filter_map(|(fact, rows)| self.worst(fact, channel, rows.into_iter())).collect()
    }

    fn find(&self, name: &str) -> Option<usize> {
        self.spec.channels.iter().position(|c| c.quantity.name == name && c.transform.is_identity())
    }

    /// scale + bias = E, whose azimuth integral is closed form: another road to the same number.
    fn scale_plus_bias(&self) -> Option<Check> {
        let (scale, bias) = (self.find("ggx.scale")?, self.find("ggx.bias")?);
        let n = self.spec.channels.len();
        let deviations: Vec<_> = self
            .values
            .par_chunks(n)
            .enumerate()
            .map(|(texel, values)| {
                let at = self.spec.point(texel);
                let (mu, alpha) = (at.get(Parameter::Mu).unwrap_or(1.0), at.get(Parameter::Alpha).unwrap_or(0.0));
                let tolerance = self.tolerance(scale, values[scale]) + self.tolerance(bias, values[bias]);
                let e = albedo(mu, alpha, self.spec.model.smith, tolerance);
                Deviation { texel, off: values[scale] + values[bias] - e.value, tolerance: tolerance + e.error }
            })
            .collect();
        self.worst("scale + bias = E", scale, deviations.into_iter())
    }

    /// Kulla and Conty's closure: E(μ) + ∫ f_ms cosθ_i dω_i = 1 exactly when 2 ∫ E(μ) μ dμ over the row is the E_avg that
    /// the lobe is built with. The row is integrated by the trapezoidal rule over its texels; what that rule makes of the exact
    /// E is taken off, so that what is left is the texels' fault.
    fn closure(&self) -> Option<Check> {
        let channel =
            self.find("ggx.albedo").filter(|c| self.spec.channels[*c].quantity.depends_on(Parameter::Alpha))?;
        let [first, second] = self.spec.axes[..] else { return None }; // a row per alpha
        let (mu_axis, mu_first) = if first.parameter == Parameter::Mu { (first, true) } else { (second, false) };
        let other = if mu_first { second } else { first };
        let mut order: Vec<(f64, usize)> = (0..mu_axis.size).map(|i| (mu_axis.value(i), i)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let n = self.spec.channels.len();
        let rows: Vec<_> = (0..other.size)
            .into_par_iter()
            .map(|j| {
                let texel = |i: usize| if mu_first { j * mu_axis.size + i } else { i * other.size + j };
                let (mut sum, mut tolerance) = (0.0, 0.0);
                for (place, (mu, i)) in order.iter().enumerate() {
                    let alpha = self.spec.point(texel(*i)).get(Parameter::Alpha).unwrap_or(0.0);
                    let value = self.values[texel(*i) * n + channel];
                    let exact = albedo(*mu, alpha, self.spec.model.smith, self.tolerance(channel, value));
                    // Of the trapezoids on either side.
                    let (before, after) = (order[place.saturating_sub(1)].0, order[(place + 1).min(order.len() - 1)].0);
                    let weight = mu * (after - before);
                    sum += weight * (value - exact.value);
                    tolerance += weight * (self.tolerance(channel, exact.value) + exact.error);
                }
                Deviation { texel: texel(0), off: sum, tolerance }
            })
            .collect();
        self.worst("Kulla–Conty closure E + ∫ f_ms cos = 1", channel, rows.into_iter())
    }

    /// The deterministic witness at every texel of the channels that are `wanted` and have one.
    ///
    /// **Errors**: those of the integrator.
    pub fn every_texel(&self, wanted: impl Fn(&Handle) -> bool) -> Result<Vec<Check>> {
        let truth = Integration::new(Settings { integrator: Integrator::Quadrature, ..Settings::default() })?;
        let texels: Vec<usize> = (0..self.spec.len()).collect();
        self.compare("quadrature at every texel", &truth, &texels, |h| h.family.has_quadrature() && wanted(h))
    }

    /// The random witness, at texels of its own choosing or at all, of the channels that are `wanted`.
    ///
    /// **Errors**: those of the integrator.
    pub fn random_witness(&self, seed: u64, full: bool, wanted: impl Fn(&Handle) -> bool) -> Result<Vec<Check>> {
        // Another seed than the bake's: points that were used once prove nothing.
        let seed = seed ^ 0xA5A5_5A5A_C3C3_3C3C;
        let settings = Settings { integrator: Integrator::MonteCarlo, seed, ..Settings::default() };
        let n = self.spec.len();
        let mut texels: Vec<usize> =
            if full { (0..n).collect() } else { weyl(seed, WITNESS_POINTS).map(|t| (t * n as f64) as usize).collect() };
        // A small table has fewer.
        texels.sort_unstable();
        texels.dedup();
        let name = if full {
            "Monte Carlo at every texel".to_owned()
        } else {
            format!("Monte Carlo at {} texels", texels.len())
        };
        // A closed form cannot bear witness to itself.
        self.compare(&name, &Integration::new(settings)?, &texels, |h| !h.family.is_pointwise() && wanted(h))
    }

    fn compare(
        &self,
        name: &str,
        witness: &Integration,
        texels: &[usize],
        wanted: impl Fn(&Handle) -> bool,
    ) -> Result<Vec<Check>> {
        let channels: Vec<usize> =
            self.spec.channels.iter().enumerate().filter(|(_, h)| wanted(h)).map(|(c, _)| c).collect();
        if channels.is_empty() {
            return Ok(vec![]);
        }
        let (n, evaluator) = (self.spec.channels.len(), self.spec.evaluator_of(wanted));
        let rows: Vec<Vec<Estimate>> =
            texels.par_iter().map(|&texel| evaluator.at(&self.spec.point(texel), witness)).collect::<Result<_>>()?;
        let deviations = |c: usize| {
            texels.iter().zip(&rows).map(move |(&texel, row)| Deviation {
                texel,
                off: self.values[texel * n + c] - row[c].value,
                tolerance: self.tolerance(c, row[c].value) + row[c].half_width(SIGMAS),
            })
        };
        Ok(channels.into_iter().filter_map(|c| self.worst(name, c, deviations(c))).collect())
    }
}
