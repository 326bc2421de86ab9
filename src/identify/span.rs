//! What many predictions lie between, so that all of them are refuted at once by texels that none can meet.
//!
//! Ramps that are alike make predictions that are alike: sorted so, the predictions of every combination are halved again and again, and
//! each half knows the least and the most that any of its predictions says of every texel. Where that misses a table's texels, so does
//! every prediction within.

use super::masters::Taps;
use std::ops::Range;

/// What a channel's texels lie between before they are rounded, of numbers that are stored as `scale · y + offset`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds<'a> {
    pub low: &'a [f64],
    pub high: &'a [f64],
    pub scale: f64,
    pub offset: f64,
    /// How far beyond them a prediction may be.
    pub slack: f64,
    /// How many texels may not lie between them.
    pub may_miss: usize,
}

/// Texels that are compared at a time.
const TOGETHER: usize = 16;

impl Bounds<'_> {
    /// Whether predictions from `least` to `most` are refuted: of more texels than may be, none of them is between the bounds. NaN, which
    /// nothing is known of, may be between any.
    fn refute(&self, least: &[f64], most: &[f64]) -> bool {
        let (least, most) = if self.scale < 0.0 { (most, least) } else { (least, most) };
        let mut missed = 0;
        // Some at a time, without a branch: most that is tried fails at the first of them.
        let predicted = least.chunks(TOGETHER).zip(most.chunks(TOGETHER));
        let bounds = self.low.chunks(TOGETHER).zip(self.high.chunks(TOGETHER));
        for ((least, most), (low, high)) in predicted.zip(bounds) {
            let mut outside = 0u64;
            for ((least, most), (low, high)) in least.iter().zip(most).zip(low.iter().zip(high)) {
                let (least, most) = (self.scale * least + self.offset, self.scale * most + self.offset);
                let misses = (low - self.slack > most) | (least > high + self.slack);
                outside = outside.wrapping_add(u64::from(misses));
            }
            missed += outside as usize;
            if missed > self.may_miss {
                return true;
            }
        }
        false
    }
}

/// Predictions of every combination of ramps along two parameters, the first of which varies fastest.
pub(super) struct Predictions {
    counts: [usize; 2],
    n_texels: usize,
    values: Vec<f64>,
    halves: Vec<[Part; 2]>,
    /// The least of every texel that either half says, and then the most.
    spans: Vec<f64>,
    all: Part,
}

/// Some of the predictions, neighbours.
#[derive(Debug, Clone, Copy)]
enum Part {
    None,
    /// Which ramp along either parameter.
    One([usize; 2]),
    /// Which two halves.
    Halves(usize),
}

impl Predictions {
    /// Of so many ramps along two parameters, and what each predicts of all texels, one after the other.
    pub(super) fn new(counts: [usize; 2], values: Vec<f64>) -> Self {
        let n = counts.iter().product::<usize>();
        let n_texels = values.len() / n.max(1);
        let (halves, spans) = (Vec::with_capacity(n), Vec::with_capacity(2 * values.len()));
        let mut new = Self { counts, n_texels, values, halves, spans, all: Part::None };
        if n > 0 {
            new.all = new.halved(counts.map(|count| 0..count));
        }
        new
    }

    fn halved(&mut self, ranges: [Range<usize>; 2]) -> Part {
        let longer = usize::from(ranges[1].len() > ranges[0].len());
        let Range { start, end } = ranges[longer].clone();
        if end - start == 1 {
            return Part::One(ranges.map(|range| range.start));
        }
        let middle = start.midpoint(end);
        let halves = [start..middle, middle..end].map(|half| {
            let mut ranges = ranges.clone();
            ranges[longer] = half;
            self.halved(ranges)
        });
        let known = self.spans.len();
        self.spans.resize(known + 2 * self.n_texels, 0.0);
        let (before, new) = self.spans.split_at_mut(known);
        let (least, most) = new.split_at_mut(self.n_texels);
        let [x, y] = halves.map(|some| between(some, &self.values, before, self.counts, self.n_texels));
        for ((least, x), y) in least.iter_mut().zip(x.0).zip(y.0) {
            *least = if x < y || x.is_nan() { *x } else { *y };
        }
        for ((most, x), y) in most.iter_mut().zip(x.1).zip(y.1) {
            *most = if x > y || x.is_nan() { *x } else { *y };
        }
        self.halves.push(halves);
        Part::Halves(self.halves.len() - 1)
    }

    /// Visits every prediction that is not refuted, and of half the texels at least is none: the numbers of its ramps.
    pub(super) fn admitted(&self, bounds: &Bounds, visit: &mut impl FnMut([usize; 2])) {
        self.admitted_of(self.all, bounds, visit);
    }

    fn admitted_of(&self, some: Part, bounds: &Bounds, visit: &mut impl FnMut([usize; 2])) {
        let (least, most) = between(some, &self.values, &self.spans, self.counts, self.n_texels);
        if bounds.refute(least, most) {
            return;
        }
        match some {
            Part::None => {}
            Part::One(chosen) => {
                let unknown = least.iter().filter(|v| v.is_nan()).count();
                if 2 * unknown <= self.n_texels {
                    visit(chosen);
                }
            }
            Part::Halves(halves) => self.halves[halves].iter().for_each(|half| self.admitted_of(*half, bounds, visit)),
        }
    }
}

/// What some predictions lie between.
fn between<'a>(
    some: Part,
    values: &'a [f64],
    spans: &'a [f64],
    counts: [usize; 2],
    n_texels: usize,
) -> (&'a [f64], &'a [f64]) {
    match some {
        Part::None => (&[], &[]),
        Part::One([first, second]) => {
            let own = &values[(second * counts[0] + first) * n_texels..][..n_texels];
            (own, own)
        }
        Part::Halves(halves) => spans[2 * halves * n_texels..][..2 * n_texels].split_at(n_texels),
    }
}

/// The order in which ramps are alike that look up so: those that rise, then those that fall, each by where they are on the mean.
pub(super) fn alike(lookups: &[Vec<Taps>]) -> Vec<usize> {
    let place = |taps: &Taps| {
        let weighted = taps.weights.iter().enumerate().map(|(k, weight)| weight * (taps.first + k) as f64);
        weighted.sum::<f64>()
    };
    let mean = |lookup: &[Taps]| lookup.iter().map(place).sum::<f64>() / lookup.len() as f64;
    let falls = |lookup: &[Taps]| lookup.first().map(place) > lookup.last().map(place);
    let keys: Vec<(bool, f64)> = lookups.iter().map(|lookup| (falls(lookup), mean(lookup))).collect();
    let mut order: Vec<usize> = (0..lookups.len()).collect();
    order.sort_by(|&a, &b| keys[a].0.cmp(&keys[b].0).then(keys[a].1.total_cmp(&keys[b].1)));
    order
}
