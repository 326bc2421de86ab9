//! Which kernel and which widths fit the levels of a chain: a file beside the panorama filtered by many widths.
//!
//! What is made small is the mean of |ln(file/truth)|, with the median ratio as scale; between the widths that were filtered, candidates are
//! interpolated.

use super::compared::Compared;
use super::sheens::sheens;
use super::{Question, Turn, Verdict, log_ratio_spread, median};
use crate::environment::chain::LEAST_SHEEN;
use crate::environment::kernel::KernelKind;
use crate::environment::{DARK_FLOOR, InstructionSet, Kernel, Panorama, SphereMap, Zonal};
use crate::model::alpha_of_roughness;
use glam::DVec3;

/// Widths that are tried: this many times the next.
const STEP: f64 = 1.27;
/// The narrowest that is tried, of a cap and of a sheen, which is wider by far at the same alpha.
const NARROWEST: f64 = 0.012;
const NARROWEST_SHEEN: f64 = LEAST_SHEEN * LEAST_SHEEN;
/// Sheens narrower than this take thousands of harmonics, so that texels are summed for few directions. They are tried where the narrowest of
/// the wider ones fits better than any other kernel.
const SLOW_SHEEN: f64 = 0.1;
/// Texels of a level that its width is fitted to, and of such a sheen.
const SAMPLES: usize = 768;
const SAMPLES_OF_SLOW: usize = 192;
/// A fit is believed if it leaves at most this part of the truth's own spread, and this much of it.
const BELIEVED: f64 = 0.5;
const MOST_RESIDUAL: f64 = 0.35;
/// The spread below which a truth has nothing to compare.
const FLAT: f64 = 1e-3;
/// What the source leaves of a level that is the source, in parts of what a kernel as wide as a texel does: less than this.
const OF_THE_SOURCE: f64 = 0.2;
/// Another kernel must leave this many times as much for the best one to be believed.
const MARGIN: f64 = 1.1;
/// Fits closer than this cannot be told apart, whatever their ratio: rounding to halves.
const ROUNDING: f64 = 2e-4;

fn is_slow(kernel: &Kernel) -> bool {
    kernel.kind() == KernelKind::Charlie && kernel.alpha() < SLOW_SHEEN
}

/// A chain that is being fitted.
pub(super) struct Fitting<'a> {
    pub(super) levels: &'a [SphereMap],
    pub(super) source: &'a Panorama,
    pub(super) turn: Turn,
    /// Faces that say nothing.
    pub(super) wrong: Vec<usize>,
}

/// Some values of a level, and what the candidates have there, all as logarithms.
struct Sample {
    seen: Vec<f64>,
    /// The source averaged over the texels.
    mirror: Vec<f64>,
    /// For each width.
    wide: Vec<Vec<f64>>,
}

/// The width that fits a level best.
#[derive(Debug, Clone, Copy)]
struct Best {
    /// 0 for the source itself.
    alpha: f64,
    range: [f64; 2],
    residual: f64,
    /// The spread of the truth itself.
    own: f64,
    /// What the narrowest width that was tried leaves.
    of_narrowest: f64,
}

impl Best {
    /// Whether the source fits best, but not as if it were what the level holds: something narrower than the narrowest width may be.
    fn is_nearly_source(&self) -> bool {
        self.alpha == 0.0 && self.residual > ROUNDING && self.residual > OF_THE_SOURCE * self.of_narrowest
    }

    fn is_believed(&self) -> bool {
        // What is the same everywhere tells nothing of widths.
        self.own > FLAT && self.residual <= BELIEVED * self.own && self.residual <= MOST_RESIDUAL
    }
}

impl Fitting<'_> {
    /// Says of every level what fits it, and of the chain whose kernel that is.
    pub(super) fn fit(&self, question: &Question, verdict: &mut Verdict) {
        // A kernel of alpha 1/size is as wide as a texel: what is narrower, and takes longer, is mostly the source itself.
        let of_texels = 1.0 / self.levels[0].size.max(2) as f64;
        let kinds: Vec<KernelKind> = question.kernel.map_or(KernelKind::ALL.to_vec(), |kind| vec![kind]);
        let first = usize::from(verdict.against_itself);
        // Fits of every level by every kind.
        let mut fits: Vec<Vec<Best>> = vec![];
        for &kind in &kinds {
            let (quick, narrowest, samples) = match kind {
                KernelKind::Charlie => (of_texels.max(SLOW_SHEEN), NARROWEST_SHEEN, SAMPLES_OF_SLOW),
                KernelKind::Nol | KernelKind::G1 => (of_texels, NARROWEST, SAMPLES),
            };
            let n = ((1.0 / narrowest).ln() / STEP.ln()).ceil() as usize;
            let alphas: Vec<f64> = (0..=n).map(|i| (narrowest.ln() * (1.0 - i as f64 / n as f64)).exp()).collect();
            let quick = alphas.partition_point(|&alpha| alpha < quick).min(n);
            let all: Vec<usize> = (0..self.levels.len()).collect();
            let mut fit = self.best_widths(kind, &alphas[quick..], &all, SAMPLES);
            let may_be_narrower = |&m: &usize| {
                let is_narrowest = fit[m].alpha > 0.0 && fit[m].alpha < 1.001 * alphas[quick];
                match kind {
                    KernelKind::Charlie => is_narrowest && fits.iter().all(|o| fit[m].residual <= o[m].residual),
                    KernelKind::Nol | KernelKind::G1 => is_narrowest || fit[m].is_nearly_source(),
                }
            };
            let narrower: Vec<usize> = all.into_iter().filter(may_be_narrower).collect();
            if quick > 0 && !narrower.is_empty() {
                let again = self.best_widths(kind, &alphas[..(quick + 3).min(n + 1)], &narrower, samples);
                narrower.into_iter().zip(again).for_each(|(m, best)| fit[m] = best);
            }
            fits.push(fit);
        }
        let total = |fits: &[Best]| {
            let told = fits[first.min(fits.len())..].iter().filter(|best| best.alpha > 0.0);
            let (sum, n) = told.fold((0.0, 0), |(sum, n), best| (sum + best.residual, n + 1));
            (sum / f64::from(n.max(1)), n)
        };
        let mut order: Vec<usize> = (0..kinds.len()).collect();
        order.sort_by(|&a, &b| total(&fits[a]).0.total_cmp(&total(&fits[b]).0));
        let chosen = order[0];
        let (best, judged) = total(&fits[chosen]);
        if let Some(&second) = order.get(1) {
            let other = total(&fits[second]).0;
            verdict.kernel_margin = Some(other / best.max(f64::MIN_POSITIVE));
            if judged > 0 && other > MARGIN * best + ROUNDING {
                verdict.kernel = Some(kinds[chosen]);
            }
        } else if judged > 0 {
            verdict.kernel = Some(kinds[chosen]);
        }
        for (m, best) in fits[chosen].iter().enumerate() {
            let level = &mut verdict.levels[m];
            level.residual = best.residual;
            if best.is_believed() && !(m == 0 && verdict.against_itself) {
                level.roughness = Some(best.alpha.sqrt());
                level.roughness_range = Some(best.range.map(f64::sqrt));
            }
        }
        // A kernel that none of the levels was believed for is none.
        if verdict.levels.iter().all(|level| level.roughness.is_none_or(|r| r == 0.0)) {
            verdict.kernel = None;
        }
        self.errors(kinds[chosen], question, verdict);
        let scales: Vec<f64> = verdict.levels.iter().filter_map(|level| level.scale).collect();
        let middle = median(&scales);
        let alike = scales.iter().all(|s| (s / middle - 1.0).abs() < 0.05);
        verdict.scale = Some(middle).filter(|_| alike && !scales.is_empty());
    }

    /// The width that fits each of some levels best.
    fn best_widths(&self, kind: KernelKind, alphas: &[f64], levels: &[usize], samples: usize) -> Vec<Best> {
        let kernels: Vec<Kernel> = alphas.iter().map(|&alpha| Kernel::of(kind, alpha)).collect();
        let levels: Vec<&SphereMap> = levels.iter().map(|&m| &self.levels[m]).collect();
        let texels: Vec<Vec<usize>> = levels.iter().map(|level| self.chosen(level, samples)).collect();
        let directions: Vec<DVec3> = (levels.iter().zip(&texels))
            .flat_map(|(level, texels)| texels.iter().map(|&i| self.turn.apply(level.direction(i))))
            .collect();
        let (slow, quick): (Vec<Kernel>, Vec<Kernel>) = kernels.iter().partition(|kernel| is_slow(kernel));
        let mut values = sheens(self.source, &slow, &directions);
        let zonal = Zonal::new(self.source, &quick, InstructionSet::detect());
        values.extend(quick.iter().map(|kernel| zonal.function(kernel).values(&directions)));
        let mut begin = 0;
        let mean = self.source.mean();
        let log = |value: [f64; 3]| logs(value, mean);
        (levels.iter().zip(&texels))
            .map(|(level, texels)| {
                let range = begin..begin + texels.len();
                begin = range.end;
                let mirror = self.mirror(level);
                let wide = |values: &Vec<[f64; 3]>| values[range.clone()].iter().flat_map(|v| log(*v)).collect();
                // The file's own scale must not meet the floor: it is brought to the source's mean first.
                let factor = self.factor(level);
                let seen = |&i: &usize| log(std::array::from_fn(|c| f64::from(level.texels[i][c]) * factor));
                let sample = Sample {
                    seen: texels.iter().flat_map(seen).collect(),
                    mirror: texels.iter().flat_map(|&i| log(mirror[i].map(f64::from))).collect(),
                    wide: values.iter().map(wide).collect(),
                };
                sample.best(alphas)
            })
            .collect()
    }

    /// The source averaged over a level's texels, turned as the file is.
    fn mirror(&self, level: &SphereMap) -> Vec<[f32; 3]> {
        SphereMap::area_average(self.source, level.layout, level.size, &self.turn.orientation())
            .expect("turns are found among those that the layout has")
            .texels
    }

    /// What brings a level to the source's mean.
    fn factor(&self, level: &SphereMap) -> f64 {
        let (mean, wanted) = (level.mean().iter().sum::<f64>(), self.source.mean().iter().sum::<f64>());
        if mean > 0.0 && wanted > 0.0 { wanted / mean } else { 1.0 }
    }

    /// Texels spread over the faces that can be believed.
    fn chosen(&self, level: &SphereMap, most: usize) -> Vec<usize> {
        let area = level.size * level.size;
        let all: Vec<usize> = (0..level.texels.len()).filter(|i| !self.wrong.contains(&(i / area))).collect();
        let step = (all.len() as f64 / most as f64).max(1.0);
        // A step that is no whole number walks through all columns.
        (0..).map(|k| (f64::from(k) * step) as usize).take_while(|&i| i < all.len()).map(|i| all[i]).collect()
    }

    /// What every texel is off by, against the exact functions of the widths that were found, or that were claimed.
    fn errors(&self, kind: KernelKind, question: &Question, verdict: &mut Verdict) {
        let claimed = |m: usize| question.roughness.as_ref().map(|list| list[m]);
        let wanted: Vec<Option<f64>> =
            verdict.levels.iter().enumerate().map(|(m, level)| claimed(m).or(level.roughness)).collect();
        let alphas = wanted.iter().flatten().map(|&r| alpha_of_roughness(r)).filter(|&alpha| alpha > 0.0);
        let kernels: Vec<Kernel> = alphas.map(|alpha| Kernel::of(kind, alpha.min(1.0))).collect();
        let zonal = Zonal::new(self.source, &kernels, InstructionSet::detect());
        let skip = usize::from(verdict.against_itself);
        for (m, roughness) in wanted.into_iter().enumerate().skip(skip) {
            let (Some(roughness), map) = (roughness, &self.levels[m]) else { continue };
            let alpha = alpha_of_roughness(roughness).min(1.0);
            let truth: Vec<[f64; 3]> = if alpha > 0.0 {
                let directions = (0..map.texels.len()).map(|i| self.turn.apply(map.direction(i)));
                zonal.function(&Kernel::of(kind, alpha)).values(&directions.collect::<Vec<_>>())
            } else {
                self.mirror(map).into_iter().map(|texel| texel.map(f64::from)).collect()
            };
            let level = Compared { map, truth: &truth, mean: self.source.mean() };
            let scale = level.scale();
            verdict.levels[m].scale = Some(scale);
            verdict.levels[m].error = Some(level.error(roughness, scale));
        }
    }
}

/// Logarithms of the channels, in parts of their means, none darker than [`DARK_FLOOR`]; black channels are all alike.
fn logs(value: [f64; 3], mean: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| if mean[c] > 0.0 { (value[c].max(0.0) / mean[c] + DARK_FLOOR).ln() } else { 0.0 })
}

impl Sample {
    fn residual(&self, truth: &[f64]) -> f64 {
        log_ratio_spread(&self.seen, truth)
    }

    /// The candidate of any width, by Lagrange interpolation of degree three in ln α between those that were computed.
    fn at(&self, position: f64) -> Vec<f64> {
        let n = self.wide.len();
        if n < 4 {
            return self.wide[position.round().clamp(0.0, n as f64 - 1.0) as usize].clone();
        }
        let low = (position.floor() as isize - 1).clamp(0, n as isize - 4) as usize;
        let t = position - low as f64;
        let weight = |k: usize| {
            let others = (0..4).filter(|&j| j != k);
            others.map(|j| (t - j as f64) / (k as f64 - j as f64)).product::<f64>()
        };
        let weights = [weight(0), weight(1), weight(2), weight(3)];
        (0..self.seen.len()).map(|i| (0..4).map(|k| weights[k] * self.wide[low + k][i]).sum()).collect()
    }

    /// The best width, by golden section between the best of those that were computed and its neighbours.
    fn best(&self, alphas: &[f64]) -> Best {
        let last = alphas.len() - 1;
        let coarse: Vec<f64> = self.wide.iter().map(|truth| self.residual(truth)).collect();
        let start = (0..=last).min_by(|&a, &b| coarse[a].total_cmp(&coarse[b])).unwrap_or(0);
        let of = |position: f64| self.residual(&self.at(position));
        let (mut low, mut high) = (start.saturating_sub(1) as f64, (start + 1).min(last) as f64);
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let mut inner = [high - golden * (high - low), low + golden * (high - low)];
        let mut found = inner.map(of);
        for _ in 0..18 {
            if found[0] < found[1] {
                (high, inner[1], found[1]) = (inner[1], inner[0], found[0]);
                inner[0] = high - golden * (high - low);
                found[0] = of(inner[0]);
            } else {
                (low, inner[0], found[0]) = (inner[0], inner[1], found[1]);
                inner[1] = low + golden * (high - low);
                found[1] = of(inner[1]);
            }
        }
        let (mut position, mut residual) = (0.5 * (low + high), of(0.5 * (low + high)));
        // The ends of the range are no minimum of the section, but may well be the best.
        for end in [0, last] {
            if coarse[end] <= residual {
                (position, residual) = (end as f64, coarse[end]);
            }
        }
        let zeros = vec![0.0; self.seen.len()];
        let mirror = self.residual(&self.mirror);
        let of_narrowest = coarse[0];
        if mirror <= residual {
            let own = log_ratio_spread(&self.mirror, &zeros);
            return Best { alpha: 0.0, range: [0.0; 2], residual: mirror, own, of_narrowest };
        }
        let truth = self.at(position);
        let alpha = |position: f64| {
            let (floor, rest) = (position.floor() as usize, position.fract());
            let next = alphas[(floor + 1).min(last)];
            (alphas[floor.min(last)].ln() * (1.0 - rest) + next.ln() * rest).exp()
        };
        Best {
            alpha: alpha(position),
            range: self.range(position, last as f64).map(alpha),
            residual,
            own: log_ratio_spread(&truth, &zeros),
            of_narrowest,
        }
    }

    /// Positions on either side at which the fit is worse by two standard errors of the difference.
    fn range(&self, position: f64, last: f64) -> [f64; 2] {
        const STEP: f64 = 0.02;
        let off = |truth: &[f64]| {
            let differences: Vec<f64> = self.seen.iter().zip(truth).map(|(a, b)| a - b).collect();
            let middle = median(&differences);
            differences.into_iter().map(|d| (d - middle).abs()).collect::<Vec<f64>>()
        };
        let best = off(&self.at(position));
        let worse = |at: f64| {
            let there = off(&self.at(at));
            let n = best.len() as f64;
            let each = || there.iter().zip(&best).map(|(a, b)| a - b);
            let mean = each().sum::<f64>() / n;
            let variance = each().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
            mean > 2.0 * (variance / n).sqrt()
        };
        let walk = |sign: f64| {
            let mut at = position;
            while (0.0..=last).contains(&(at + sign * STEP)) {
                at += sign * STEP;
                if worse(at) {
                    break;
                }
            }
            at
        };
        [walk(-1.0), walk(1.0)]
    }
}
