//! Gauss–Legendre quadrature, plain and graded towards one end.
//!
//! An integrand with complex singularities at ±i·w beside the end x = 0 of its interval, or with a logarithm there, defeats a
//! plain rule when w is small. Substituting x = w·sinh(s) sends ±i·w to ±i·π/2: in s the integrand is analytic in a strip
//! of constant half-width, whatever w, and Gauss–Legendre converges geometrically with a count of nodes that grows as
//! ln(1/w) only.

use std::f64::consts::LN_2;
use std::sync::{LazyLock, OnceLock};

/// Nodes and weights on [0, 1].
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    /// Positions in (0, 1), ascending.
    pub nodes: Vec<f64>,
    /// Weights; they sum to the integral of 1.
    pub weights: Vec<f64>,
}

impl Rule {
    /// Σ w f(x).
    pub fn integrate(&self, mut f: impl FnMut(f64) -> f64) -> f64 {
        self.iter().map(|(x, w)| w * f(x)).sum()
    }

    /// Σ w p(x) and Σ w p(x) f(x) of a density p and `K` functions f: four sums side by side, which processors compute together
    /// where there are no branches.
    #[inline]
    pub fn moments<const K: usize>(&self, density_and_functions: impl Fn(f64) -> (f64, [f64; K])) -> (f64, [f64; K]) {
        let (mut whole, mut sums) = ([0.0; LANES], [[0.0; LANES]; K]);
        let ((nodes, last_nodes), (weights, last_weights)) =
            (self.nodes.as_chunks::<LANES>(), self.weights.as_chunks::<LANES>());
        // The rest is filled up with nodes of no weight, so that the functions are called, and compiled, in one place.
        let last = (!last_nodes.is_empty()).then(|| {
            let (mut nodes, mut weights) = ([last_nodes[0]; LANES], [0.0; LANES]);
            nodes[..last_nodes.len()].copy_from_slice(last_nodes);
            weights[..last_weights.len()].copy_from_slice(last_weights);
            (nodes, weights)
        });
        let full = nodes.iter().copied().zip(weights.iter().copied());
        for (nodes, weights) in full.chain(last) {
            let (mut densities, mut functions) = ([0.0; LANES], [[0.0; K]; LANES]);
            for lane in 0..LANES {
                (densities[lane], functions[lane]) = density_and_functions(nodes[lane]);
            }
            for lane in 0..LANES {
                let weight = weights[lane] * densities[lane];
                whole[lane] += weight;
                for (sum, value) in sums.iter_mut().zip(functions[lane]) {
                    sum[lane] += weight * value;
                }
            }
        }
        (whole.iter().sum(), sums.map(|lanes| lanes.iter().sum()))
    }

    /// The pairs (node, weight).
    pub fn iter(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.nodes.iter().copied().zip(self.weights.iter().copied())
    }
}

/// Sums side by side: enough for the widest registers that a stock build uses, and for its divisions to overlap.
const LANES: usize = 4;

/// The `n`-point Gauss–Legendre rule on [0, 1].
///
/// Source: Newton's iteration on P_n from the asymptotic guess cos(π (i + 3/4)/(n + 1/2)); DLMF 3.5(v) and 18.16.
pub fn gauss_legendre(n: usize) -> Rule {
    let (mut nodes, mut weights) = (vec![0.0; n], vec![0.0; n]);
    for i in 0..n.div_ceil(2) {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut derivative = 0.0;
        for _ in 0..100 {
            let (p, dp) = legendre(n, x);
            derivative = dp;
            let step = p / dp;
            x -= step;
            if step.abs() <= 1e-16 {
                break;
            }
        }
        if n % 2 == 1 && i == n / 2 {
            x = 0.0;
            derivative = legendre(n, x).1;
        }
        let weight = 1.0 / ((1.0 - x) * (1.0 + x) * derivative * derivative);
        (nodes[i], weights[i]) = (0.5 * (1.0 - x), weight);
        (nodes[n - 1 - i], weights[n - 1 - i]) = (0.5 * (1.0 + x), weight);
    }
    Rule { nodes, weights }
}

/// P_n(x) and its derivative, by the three-term recurrence.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut current) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        (previous, current) = (current, ((2.0 * k - 1.0) * x * current - (k - 1.0) * previous) / k);
    }
    if n == 0 {
        return (1.0, 0.0);
    }
    (current, n as f64 * (x * current - previous) / (x * x - 1.0))
}

/// A family of rules on [0, 1] graded towards 0, for one accuracy and any scale.
///
/// The scale is rounded down to one of a fixed ladder, so that every rule is computed once and shared: the singularities
/// then sit at ±i·π/2 + a shift along the strip, which costs nothing.
#[derive(Debug)]
pub struct GradedRules {
    digits: f64,
    map: fn(f64) -> (f64, f64),
    rules: Vec<OnceLock<Rule>>,
}

/// Step of the ladder of lengths s = asinh(1/w).
const LENGTH_STEP: f64 = 0.25;
/// The longest: scales down to 1e-69, which lobes as narrow as 1e-24 at grazing angles ask for.
const LONGEST: f64 = 160.0;
/// The one for a singularity at the end itself: scales down to 1e-16.
const AT_END: f64 = 38.0;

impl GradedRules {
    /// Rules whose error is about e^(−digits) for an integrand that is analytic in the strip of half-width π/2.
    pub fn new(digits: f64) -> Self {
        Self::mapped(digits, |x| (x, 1.0))
    }

    /// The same in another variable: `map` gives its value at x, and its derivative or whatever else the weights take.
    pub fn mapped(digits: f64, map: fn(f64) -> (f64, f64)) -> Self {
        Self { digits, map, rules: (0..=STEPS).map(|_| OnceLock::new()).collect() }
    }

    /// The accuracy that the rules are made for: errors of about e^(−digits).
    #[inline]
    pub fn digits(&self) -> f64 {
        self.digits
    }

    /// The rule for singularities at distance `scale` (in parts of the interval) from the end 0; at 0 itself, 1e-16 of the interval is
    /// resolved.
    #[inline]
    pub fn at_scale(&self, scale: f64) -> &Rule {
        let step = step_of_scale(scale);
        let rule = self.rules[step].get_or_init(|| {
            let mut rule = graded(step as f64 * LENGTH_STEP, self.digits);
            for (x, w) in rule.nodes.iter_mut().zip(&mut rule.weights) {
                let (value, factor) = (self.map)(*x);
                (*x, *w) = (value, *w * factor);
            }
            rule
        });
        #[cfg(test)]
        nodes_asked_for::add(rule.nodes.len());
        rule
    }
}

/// A count for tests of what an integral costs: every rule that is asked for is summed once, so that the nodes of all are the
/// evaluations of the integrand, and of what surrounds it. Nothing of it is left in a build that is no test.
#[cfg(test)]
pub(crate) mod nodes_asked_for {
    use std::cell::Cell;

    thread_local! {
        static COUNT: Cell<u64> = const { Cell::new(0) };
    }

    pub(super) fn add(nodes: usize) {
        COUNT.set(COUNT.get() + nodes as u64);
    }

    /// The nodes that `run` asks for on this thread.
    pub(crate) fn during(run: impl FnOnce()) -> u64 {
        let before = COUNT.get();
        run();
        COUNT.get() - before
    }
}

/// Steps of the ladder.
const STEPS: usize = (LONGEST / LENGTH_STEP) as usize;
/// The step of [`AT_END`].
const STEP_AT_END: usize = (AT_END / LENGTH_STEP) as usize;

/// The smallest step, from 1 on, whose length is asinh(1/scale) at least; the last one for all that is smaller, and that of
/// [`AT_END`] for 0 and NaN.
#[inline]
fn step_of_scale(scale: f64) -> usize {
    // sinh of each step's length, ascending: looking it up is cheaper than asinh.
    static REACH: LazyLock<[f64; STEPS + 1]> =
        LazyLock::new(|| std::array::from_fn(|step| (step as f64 * LENGTH_STEP).sinh()));
    let reach = &*REACH;
    let inverse = (1.0 / scale).max(0.0); // 0 for NaN, too
    if scale.is_nan() || scale == 0.0 {
        return STEP_AT_END;
    }
    if inverse > reach[STEPS - 1] {
        return STEPS;
    }
    // 1/scale is at least 2^exponent, so that its asinh is at least (exponent + 1) ln 2 above 1, and two doublings from it at most.
    let exponent = (inverse.to_bits() >> 52) as i64 - 1023;
    let mut step = if exponent > 0 { ((exponent + 1) as f64 * (LN_2 / LENGTH_STEP)) as usize } else { 1 };
    while reach[step] < inverse {
        step += 1;
    }
    step
}

/// x = sinh(length·t)/sinh(length), t by Gauss–Legendre.
///
/// The count of nodes follows from the Bernstein ellipse through the nearest singularity at height π/2 over the interval:
/// its parameter is ρ with ln ρ = asinh(π/length), and the error of n nodes is about ρ^(−2n).
fn graded(length: f64, digits: f64) -> Rule {
    let ln_rho = (std::f64::consts::PI / length).asinh();
    let n = (digits / (2.0 * ln_rho)).ceil() as usize + 3;
    let plain = gauss_legendre(n);
    let whole = length.sinh();
    Rule {
        nodes: plain.nodes.iter().map(|t| (length * t).sinh() / whole).collect(),
        weights: plain.iter().map(|(t, w)| w * length * (length * t).cosh() / whole).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_legendre_is_exact_for_polynomials_of_degree_2n_minus_1() {
        for n in [1, 2, 3, 5, 16, 31, 64] {
            let rule = gauss_legendre(n);
            for degree in [0, 1, n, 2 * n - 1] {
                let got = rule.integrate(|x| x.powi(degree as i32));
                let wanted = 1.0 / (degree as f64 + 1.0);
                assert!((got - wanted).abs() < 2e-15, "n = {n}, degree {degree}: got {got}, wanted {wanted}");
            }
        }
    }

    #[test]
    fn step_of_a_scale_is_the_first_that_is_long_enough() {
        for i in 0..16000 {
            let scale = 10.0_f64.powf(2.0 - 0.005 * f64::from(i));
            let length = (1.0 / scale).asinh();
            let (got, wanted) = (step_of_scale(scale), ((length / LENGTH_STEP).ceil() as usize).clamp(1, STEPS));
            assert_eq!(got, wanted, "scale {scale:e}");
        }
        let ends = [(0.0, STEP_AT_END), (f64::NAN, STEP_AT_END), (f64::MIN_POSITIVE, STEPS), (f64::INFINITY, 1)];
        for (scale, wanted) in ends {
            assert_eq!(step_of_scale(scale), wanted, "scale {scale:e}");
        }
    }

    #[test]
    fn moments_are_the_sums_one_by_one() {
        for n in 1..14 {
            let rule = gauss_legendre(n);
            let (whole, [mean]) = rule.moments(|x| (x.exp(), [1.0 / (1.0 + x)]));
            let (p, f) = (rule.integrate(f64::exp), rule.integrate(|x| x.exp() / (1.0 + x)));
            assert!((whole - p).abs() < 1e-15 && (mean - f).abs() < 1e-15, "n = {n}: {whole} and {p}, {mean} and {f}");
        }
    }

    #[test]
    fn graded_rules_reach_their_digits_on_a_peak_of_any_width() {
        for digits in [10.0, 18.0, 26.0_f64] {
            let rules = GradedRules::new(digits);
            for exponent in 0..=12 {
                let w = 10.0_f64.powi(-exponent);
                let got = rules.at_scale(w).integrate(|x| w / (w * w + x * x));
                let wanted = (1.0 / w).atan();
                let tolerance = (-digits).exp() + 1e-14;
                assert!((got - wanted).abs() < tolerance, "w = {w}, digits {digits}: off by {:e}", got - wanted);
            }
        }
    }
}
