//! Associated Legendre functions of one order at eight places at a time.
//!
//! P̄_l^m is normalised so that P̄_l^m(cos θ) e^(imφ) has norm one on the sphere, without the Condon–Shortley sign. With
//! ε_l = √((l² − m²)/(4l² − 1)) it satisfies x P̄_l = ε_(l+1) P̄_(l+1) + ε_l P̄_(l−1) (DLMF 14.10.3, normalised). Dividing by
//! s_l with s_(l+1) = s_(l−1) ε_l / ε_(l+1) leaves Q_(l+1) = a_l x Q_l − Q_(l−1): one multiplication less per step.
//!
//! Near the poles P̄_m^m ∝ sin^m θ falls below the smallest number that a computer holds, and still its P̄_l^m become
//! large where l sin θ > m. Each lane therefore starts as Q · 2^(200 e) with e ≤ 0, and counts as zero until e is 0: what is dropped is below
//! 2^−70.

use std::f64::consts::PI;

use super::lanes::{LANES, V, ZERO, add, mul, mul_add, scale};

/// Degrees in a chunk: what is computed between two looks at the scale. Even, so that parities stay in step.
pub(super) const CHUNK: usize = 16;
/// Degrees between two such looks within a chunk: Q grows at most by a_l < 2^8 at each.
const LOOK: usize = 4;
/// A lane is rescaled when it is above 2^100, by 2^−200.
const BITS: i32 = 200;
const LARGE: f64 = 1.267_650_600_228_229_4e30; // 2^100
const SHRINK: f64 = 1.0 / (LARGE * LARGE);

/// Which degrees are meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Degrees {
    All,
    /// Even ones above this one.
    EvenAbove(usize),
}

impl Degrees {
    /// Whether any of a chunk from degree `l` on is meant.
    #[inline(always)]
    pub fn any_from(self, l: usize) -> bool {
        match self {
            Self::All => true,
            Self::EvenAbove(last) => l + CHUNK > last + 1,
        }
    }

    /// The remainders of l − m divided by two that are meant.
    #[inline(always)]
    pub fn parities(self, m: usize) -> std::ops::Range<usize> {
        match self {
            Self::All => 0..2,
            Self::EvenAbove(_) => m % 2..m % 2 + 1,
        }
    }

    /// Whether a degree is meant.
    pub fn contains(self, l: usize) -> bool {
        match self {
            Self::All => true,
            Self::EvenAbove(last) => l > last && l.is_multiple_of(2),
        }
    }
}

/// The recurrence of one order.
#[derive(Debug, Clone, Default)]
pub(super) struct Order {
    /// a_l for l = m, m + 1, …, padded with zeros to whole chunks.
    pub a: Vec<f64>,
    /// s_l = P̄_l / Q_l, as long.
    pub s: Vec<f64>,
}

impl Order {
    /// The recurrence of order m up to the given degree.
    pub fn new(m: usize, degree: usize) -> Self {
        let n = degree + 1 - m;
        let padded = n.next_multiple_of(CHUNK);
        let (mut a, mut s) = (vec![0.0; padded], vec![0.0; padded]);
        let m2 = (m * m) as f64;
        let epsilon2 = |l: usize| {
            let l2 = (l * l) as f64;
            (l2 - m2) / (4.0 * l2 - 1.0)
        };
        let (mut before, mut current, mut here) = (1.0, 1.0, 0.0f64);
        for k in 0..n {
            let next = epsilon2(m + k + 1).sqrt();
            s[k] = current;
            // Q_(m−1) = 0 leaves s_(m+1) free: 1.
            let after = if k == 0 { 1.0 } else { before * here / next };
            a[k] = current / (next * after);
            (before, current, here) = (current, after, next);
        }
        Self { a, s }
    }
}

/// √((2m + 1)!! / (2m)!! / 4π) for m = 0 … degree: P̄_m^m / sin^m θ.
pub(super) fn sectoral_norms(degree: usize) -> Vec<f64> {
    let mut norm = 1.0 / (4.0 * PI).sqrt();
    let mut norms = vec![norm];
    for m in 1..=degree {
        norm *= (1.0 + 0.5 / m as f64).sqrt();
        norms.push(norm);
    }
    norms
}

/// Powers in steps of this are kept.
const STRIDE: usize = 32;

/// Eight places cos θ with what their recurrences start from.
#[derive(Debug, Clone)]
pub(super) struct Places {
    pub cos: V,
    /// sin^j θ for j < [`STRIDE`].
    small: Vec<V>,
    /// sin^(STRIDE k) θ as value · 2^(BITS e).
    large: Vec<(V, [i32; LANES])>,
}

impl Places {
    /// Places for orders up to `orders`.
    pub fn new(cos: V, sin: V, orders: usize) -> Self {
        let mut small = vec![[1.0; LANES]];
        for j in 1..=STRIDE {
            small.push(mul(small[j - 1], sin));
        }
        let step = small[STRIDE];
        let mut large = vec![([1.0; LANES], [0; LANES])];
        for k in 1..=orders / STRIDE {
            let (value, mut exponent) = large[k - 1];
            // Step by step, because sin^32 θ alone may be below 2^−200; it is above 2^−1000 for every panorama's rows.
            let mut value = mul(value, step);
            for lane in 0..LANES {
                while value[lane] < 1.0 / LARGE && value[lane] > 0.0 {
                    value[lane] *= LARGE * LARGE;
                    exponent[lane] -= 1;
                }
            }
            large.push((value, exponent));
        }
        Self { cos, small, large }
    }

    /// Where the recurrence of order m starts; `factor` multiplies everything.
    #[inline(always)]
    pub fn start(&self, m: usize, factor: V) -> Walk {
        let (large, mut exponent) = self.large[m / STRIDE];
        // The product of both tables may be down to 2^−100 sin^31: one more step of the scale where it is needed.
        let mut q = mul(mul(large, self.small[m % STRIDE]), factor);
        for lane in 0..LANES {
            while q[lane] != 0.0 && q[lane].abs() < 1.0 / LARGE {
                q[lane] *= LARGE * LARGE;
                exponent[lane] -= 1;
            }
        }
        Walk { current: q, before: ZERO, exponent, ready: exponent == [0; LANES] }
    }
}

/// A recurrence under way at eight places.
#[derive(Debug, Clone, Copy)]
pub(super) struct Walk {
    current: V,
    before: V,
    exponent: [i32; LANES],
    ready: bool,
}

impl Walk {
    /// The next [`CHUNK`] values of Q; false if all are negligible (then nothing is written).
    #[inline(always)]
    pub fn advance(&mut self, cos: V, a: &[f64; CHUNK], out: &mut [V; CHUNK]) -> bool {
        if self.ready {
            // In registers, two steps at a time: through memory each step would wait for the one before to be stored.
            let (mut current, mut before) = (self.current, self.before);
            for k in (0..CHUNK).step_by(2) {
                (out[k], before) = (current, next(cos, a[k], current, before));
                (out[k + 1], current) = (before, next(cos, a[k + 1], before, current));
            }
            (self.current, self.before) = (current, before);
            return true;
        }
        self.advance_scaled(cos, a, out)
    }

    /// The same of two at once, whose operations do not wait for each other; false for each where all are negligible.
    #[inline(always)]
    pub fn advance_two(
        [first, second]: [&mut Self; 2],
        cos: [&V; 2],
        a: &[f64; CHUNK],
        [to_first, to_second]: &mut [[V; CHUNK]; 2],
    ) -> [bool; 2] {
        if !(first.ready && second.ready) {
            return [first.advance(*cos[0], a, to_first), second.advance(*cos[1], a, to_second)];
        }
        let mut pair = Pair::of([first, second], cos);
        for k in (0..CHUNK).step_by(2) {
            [to_first[k], to_second[k]] = pair.current;
            let between = pair.step(a[k], a[k + 1]);
            [to_first[k + 1], to_second[k + 1]] = between;
        }
        pair.back_to([first, second]);
        [true; 2]
    }

    /// The sum of two; false if all are negligible. `spare` is lost.
    #[inline(always)]
    pub fn advance_sum(
        [first, second]: [&mut Self; 2],
        cos: [&V; 2],
        a: &[f64; CHUNK],
        out: &mut [V; CHUNK],
        spare: &mut [V; CHUNK],
    ) -> bool {
        if !(first.ready && second.ready) {
            let any = first.advance(*cos[0], a, out);
            return match (any, second.advance(*cos[1], a, spare)) {
                (true, true) => {
                    add_chunk(out, spare);
                    true
                }
                (false, true) => {
                    *out = *spare;
                    true
                }
                (any, false) => any,
            };
        }
        let mut pair = Pair::of([first, second], cos);
        for k in (0..CHUNK).step_by(2) {
            out[k] = add(pair.current[0], pair.current[1]);
            let between = pair.step(a[k], a[k + 1]);
            out[k + 1] = add(between[0], between[1]);
        }
        pair.back_to([first, second]);
        true
    }

    #[inline(always)]
    fn advance_scaled(&mut self, cos: V, a: &[f64; CHUNK], out: &mut [V; CHUNK]) -> bool {
        let mut active = false;
        for first in (0..CHUNK).step_by(LOOK) {
            let mut mask = ZERO;
            for (lane, mask) in mask.iter_mut().enumerate() {
                if self.exponent[lane] < 0 && self.current[lane].abs() > LARGE {
                    self.current[lane] *= SHRINK;
                    self.before[lane] *= SHRINK;
                    self.exponent[lane] += 1;
                }
                *mask = f64::from(u8::from(self.exponent[lane] == 0));
            }
            active |= mask != ZERO;
            for k in first..first + LOOK {
                out[k] = mul(self.current, mask);
                (self.before, self.current) = (self.current, next(cos, a[k], self.current, self.before));
            }
        }
        self.ready = self.exponent == [0; LANES];
        active
    }
}

/// Two recurrences, in registers.
struct Pair {
    current: [V; 2],
    before: [V; 2],
    cos: [V; 2],
}

impl Pair {
    #[inline(always)]
    fn of(walks: [&Walk; 2], cos: [&V; 2]) -> Self {
        Self { current: walks.map(|w| w.current), before: walks.map(|w| w.before), cos: cos.map(|cos| *cos) }
    }

    /// Two steps on, with what lies between.
    #[inline(always)]
    fn step(&mut self, first: f64, second: f64) -> [V; 2] {
        let Self { current, before, cos } = self;
        *before = [next(cos[0], first, current[0], before[0]), next(cos[1], first, current[1], before[1])];
        *current = [next(cos[0], second, before[0], current[0]), next(cos[1], second, before[1], current[1])];
        *before
    }

    #[inline(always)]
    fn back_to(self, walks: [&mut Walk; 2]) {
        for ((walk, current), before) in walks.into_iter().zip(self.current).zip(self.before) {
            (walk.current, walk.before) = (current, before);
        }
    }
}

/// Q_(l+1).
#[inline(always)]
fn next(cos: V, a: f64, current: V, before: V) -> V {
    mul_add(scale(cos, a), current, scale(before, -1.0))
}

/// Adds up two chunks.
#[inline(always)]
pub(super) fn add_chunk(to: &mut [V; CHUNK], from: &[V; CHUNK]) {
    for k in 0..CHUNK {
        to[k] = add(to[k], from[k]);
    }
}

/// Whether all P̄_l^m with l ≤ degree are below some 1e-13 wherever sin θ is at most this.
///
/// For m > l sin θ, P̄ falls off like e^−S with S = ∫ √(m²/sin²t − l²) dt from θ to the turning point (Liouville and Green), which is
/// l [μ artanh(u/(μ cos θ)) − artanh(u/cos θ)] with μ = m/l, u = √(μ² − sin²θ) for μ < 1.
pub(super) fn negligible(degree: usize, m: usize, sin: f64) -> bool {
    let l = degree as f64 + 0.5;
    let mu = (m as f64 / l).min(1.0 - 1e-12);
    if mu <= sin {
        return false;
    }
    let cos = (1.0 - sin * sin).sqrt();
    let u = (mu * mu - sin * sin).sqrt();
    let s = l * (mu * libm::atanh((u / (mu * cos)).min(1.0 - 1e-16)) - libm::atanh((u / cos).min(1.0 - 1e-16)));
    s > 32.0
}

const _: () = assert!(CHUNK.is_multiple_of(LOOK) && LOOK.is_multiple_of(2) && BITS == 200);
