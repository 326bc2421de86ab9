//! What a prediction leaves of a channel's values, under the encoding that explains most for its simplicity.
//!
//! Nearly every prediction that is tried is wrong: whatever can be known of that without sorting is known first.

use crate::claim::{Curve, Encoding};

/// Squares so much larger than the mean that is still of interest are cut off to bound what the smaller ones come to, the lower first.
const CUTS: [f64; 2] = [4.0, 16.0];

/// Root mean square of what is left, without the worst tenth: that is where under-sampled tables are noisy. Infinite where it is certain
/// that it exceeds `most`. `squares` is overwritten.
fn trimmed(values: &[f64], predicted: &[f64], scale: f64, offset: f64, most: f64, squares: &mut Vec<f64>) -> f64 {
    squares.clear();
    squares.extend(values.iter().zip(predicted).map(|(v, p)| (v - scale * p - offset).powi(2)));
    if squares.iter().any(|s| s.is_nan()) {
        squares.retain(|s| !s.is_nan());
    }
    if squares.is_empty() {
        return f64::INFINITY;
    }
    let kept = without_worst(squares.len());
    let dropped = (squares.len() - kept) as f64;
    if most < f64::INFINITY {
        // Cut off at any height, the squares' sum is at most that of those kept and so much for each that is dropped. It takes no sorting,
        // and tells of nearly every wrong explanation that it is one.
        for cut in CUTS.map(|cut| cut * most * most) {
            if sum_cut_off(squares, cut) > kept as f64 * most * most + dropped * cut {
                return f64::INFINITY;
            }
        }
    }
    rms_without_worst(squares)
}

/// How many of so many are left without the worst tenth.
fn without_worst(n: usize) -> usize {
    (n * 9).div_ceil(10)
}

/// Root mean square of what these are the squares of, without the worst tenth, and 0 of none; they are put in another order.
pub(super) fn rms_without_worst(squares: &mut [f64]) -> f64 {
    let kept = without_worst(squares.len());
    if kept < squares.len() {
        squares.select_nth_unstable_by(kept, f64::total_cmp);
    }
    (squares[..kept].iter().sum::<f64>() / kept.max(1) as f64).sqrt()
}

/// The sum of numbers of which none counts for more than `most`.
fn sum_cut_off(numbers: &[f64], most: f64) -> f64 {
    let (chunks, rest) = numbers.as_chunks::<4>();
    let mut lanes = [0.0; 4];
    for chunk in chunks {
        lanes.iter_mut().zip(chunk).for_each(|(sum, v)| *sum += if *v < most { *v } else { most });
    }
    lanes.iter().sum::<f64>() + rest.iter().map(|v| v.min(most)).sum::<f64>()
}

/// What a factor and an offset of no known meaning must gain, in parts of the residual.
const PRICE_OF_ANY: f64 = 4.0;
/// The same for the known ones.
const PRICE_OF_KNOWN: f64 = 1.5;
/// The same for a curve.
const PRICE_OF_CURVE: f64 = 2.0;
/// Factors and offsets that tables are stored with.
pub(super) const KNOWN: [(f64, f64); 12] = [
    (1.0, 0.0),
    (std::f64::consts::FRAC_1_PI, 0.0),
    (-1.0, 1.0),
    (1.0, -0.5),
    (0.5, 0.5),
    (std::f64::consts::PI, 0.0),
    (0.5, 0.0),
    (2.0, 0.0),
    (0.25, 0.0),
    (4.0, 0.0),
    (2.0, -1.0),
    (1.0 / 255.0, 0.0),
];

/// What an encoding must gain, in parts of the residual.
pub(super) fn price(encoding: Encoding) -> f64 {
    let of_curve = if encoding.curve == Curve::Plain { 1.0 } else { PRICE_OF_CURVE };
    let of_numbers = match (encoding.scale, encoding.offset) {
        (1.0, 0.0) => 1.0,
        known if KNOWN.contains(&known) => PRICE_OF_KNOWN,
        _ => PRICE_OF_ANY,
    };
    of_curve * of_numbers
}

/// What a prediction leaves of values under an encoding without its curve: root mean square without the worst tenth.
pub(super) fn left(values: &[f64], predicted: &[f64], encoding: Encoding) -> f64 {
    trimmed(values, predicted, encoding.scale, encoding.offset, f64::INFINITY, &mut vec![])
}

/// How much of what is left may be in the worst tenth of the texels, more where the values have peaks: more is not looked for while everything
/// is tried.
const WORST_TENTH: f64 = 4.0;

/// What a residual must be to be of interest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    /// What is added to every residual: what masters and rounding leave.
    pub floor: f64,
    /// What it may be with that and its price.
    pub limit: f64,
    /// How much more than the rest the values' own peaks vary.
    pub peaks: f64,
}

impl Wanted {
    /// Any.
    pub(super) fn any(floor: f64) -> Self {
        Self { floor, limit: f64::INFINITY, peaks: 1.0 }
    }
}

/// The encoding that explains `values` best for its simplicity, the residual, and that residual with its price, which is infinite
/// where it is clear that it exceeds what is wanted. `squares` is overwritten.
pub(super) fn encoding(
    values: &[f64],
    predicted: &[f64],
    curve: Curve,
    sums: &Sums,
    Wanted { floor, limit, peaks }: Wanted,
    squares: &mut Vec<f64>,
) -> (Encoding, f64, f64) {
    let (a, b) = sums.nearest();
    // What is left with its worst tenth is known without sorting; while everything is tried, the rest is taken to be no less than a
    // part of it.
    let least =
        |scale, offset| if limit < f64::INFINITY { sums.left(scale, offset) / (WORST_TENTH * peaks) } else { 0.0 };
    let mut best = (Encoding { scale: a, offset: b, curve }, f64::INFINITY, f64::INFINITY);
    // The price of no meaning is the highest: last.
    for (scale, offset) in KNOWN.into_iter().chain([(a, b)]) {
        let price = price(Encoding { scale, offset, curve });
        let most = best.2.min(limit) / price - floor;
        if least(scale, offset) > most {
            continue;
        }
        let residual = trimmed(values, predicted, scale, offset, most, squares);
        let cost = (residual + floor) * price;
        if cost < best.2 {
            best = (Encoding { scale, offset, curve }, residual, cost);
        }
    }
    best
}

/// What a factor and an offset of a prediction leave of values, by sums. A value that is none counts for nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

/// The sum of a function of two numbers each: four sums, which no addition waits for.
pub(super) fn sum(a: &[f64], b: &[f64], f: impl Fn(f64, f64) -> f64) -> f64 {
    let ((a4, a_rest), (b4, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut lanes = [0.0; 4];
    for (a, b) in a4.iter().zip(b4) {
        for lane in 0..4 {
            lanes[lane] += f(a[lane], b[lane]);
        }
    }
    lanes.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| f(*a, *b)).sum::<f64>()
}

impl Sums {
    /// Of these values and their prediction.
    pub(super) fn of(values: &[f64], predicted: &[f64]) -> Self {
        let sum = |f: fn(f64, f64) -> f64| sum(values, predicted, |v, p| if v.is_finite() { f(v, p) } else { 0.0 });
        let n = sum(|_, _| 1.0).max(1.0);
        let (x, y) = (sum(|_, p| p), sum(|v, _| v));
        Self { n, x, y, xx: sum(|_, p| p * p), xy: sum(|v, p| v * p), yy: sum(|v, _| v * v) }
    }

    /// The same where every value is one, from what is known of values and prediction by themselves.
    pub(super) fn with(self, values: &[f64], predicted: &[f64], (x, xx): (f64, f64)) -> Self {
        Self { x, xx, xy: sum(values, predicted, |v, p| v * p), ..self }
    }

    /// Factor and offset that bring the prediction nearest to the values.
    fn nearest(&self) -> (f64, f64) {
        let Self { n, x, y, xx, xy, .. } = *self;
        let across = n * xx - x * x;
        if across <= 1e-12 * n * xx {
            return (1.0, 0.0); // a constant explains nothing
        }
        let scale = (n * xy - x * y) / across;
        (scale, (y - scale * x) / n)
    }

    /// The root mean square of what these leave.
    fn left(&self, scale: f64, offset: f64) -> f64 {
        let Self { n, x, y, xx, xy, yy } = *self;
        let squares =
            yy - 2.0 * (scale * xy + offset * y) + scale * (scale * xx + 2.0 * offset * x) + n * offset * offset;
        (squares / n).max(0.0).sqrt()
    }
}
