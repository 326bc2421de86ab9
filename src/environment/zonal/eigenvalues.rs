//! What a zonal kernel multiplies each degree by (Funk and Hecke): λ_l = 2π ∫ K(c) P_l(c) dc.
//!
//! Gauss–Legendre panels in θ, short where the kernel is sharp and everywhere short enough for P_l; P_l by its three-term
//! recurrence, which is stable on [−1, 1].

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::lanes::{InstructionSet, LANES, V, ZERO, add, mul, scale, scale_add, sub, total};
use crate::math::quadrature::gauss_legendre;

/// Points of a panel.
const POINTS: usize = 24;

/// λ_0 … λ_degree of a kernel that is zero below the horizon, given as a function of 1 − c. Its complex singularities lie `widths`
/// radians from θ = 0 and, on the side above, from the horizon.
pub(super) fn eigenvalues(
    kernel: &dyn Fn(f64) -> f64,
    [width, at_horizon]: [f64; 2],
    degree: usize,
    instructions: InstructionSet,
) -> Vec<f64> {
    let rule = gauss_legendre(POINTS);
    // P_l turns l · panel radians in a panel: 24 points hold 20 of them to 1e-16.
    let longest = (20.0 / (degree + 1) as f64).min(0.2);
    let (mut theta, mut places) = (0.0, vec![]);
    while theta < FRAC_PI_2 {
        let length = longest.min(1.5 * (theta * theta + width * width).sqrt());
        let length = length.min(0.6 * (FRAC_PI_2 - theta + at_horizon));
        // No sliver is left over.
        let end = if theta + 1.5 * length > FRAC_PI_2 { FRAC_PI_2 } else { theta + length };
        for (t, weight) in rule.iter() {
            let at = theta + t * (end - theta);
            let half = libm::sin(0.5 * at);
            let sin = libm::sin(at);
            places.push((libm::cos(at), TAU * weight * (end - theta) * sin * kernel(2.0 * half * half)));
        }
        theta = end;
    }
    let mut blocks: Vec<(V, V)> = vec![];
    for chunk in places.chunks(LANES) {
        let (mut x, mut weight) = (ZERO, ZERO);
        for (lane, &(c, w)) in chunk.iter().enumerate() {
            (x[lane], weight[lane]) = (c, w);
        }
        blocks.push((x, weight));
    }
    instructions.run(
        #[inline(always)]
        || sums(&blocks, degree),
    )
}

/// Σ w P_l(x) for l = 0 … degree.
#[inline(always)]
fn sums(blocks: &[(V, V)], degree: usize) -> Vec<f64> {
    let mut sums = vec![ZERO; degree + 1];
    let steps: Vec<(f64, f64)> = (0..=degree)
        .map(|l| {
            let l = l as f64;
            ((2.0 * l + 1.0) / (l + 1.0), l / (l + 1.0))
        })
        .collect();
    for &(x, weight) in blocks {
        let (mut before, mut current) = (ZERO, weight);
        for (sum, &(a, b)) in sums.iter_mut().zip(&steps) {
            *sum = add(*sum, current);
            let next = sub(mul(scale(x, a), current), scale(before, b));
            (before, current) = (current, next);
        }
    }
    sums.into_iter().map(total).collect()
}

/// Places where the remainder of a function's series is looked at, eight at a time: cos θ, the function there, and 1/(the kernel that it
/// is a part of, and a floor).
pub(super) struct Remainder {
    places: Vec<[V; 3]>,
}

impl Remainder {
    /// Places up to `reach` radians from the peak, of a function and of the kernel that errors are relative to.
    pub fn new([function, kernel]: [&dyn Fn(f64) -> f64; 2], width: f64, reach: f64, floor: f64) -> Self {
        let spread = |i: u32| width * libm::expm1(f64::from(i) / 47.0 * libm::log1p(PI / width));
        let even = (1..=64).map(|i| PI * f64::from(i) / 64.0);
        let horizon = (-24..=24).map(|i| FRAC_PI_2 + f64::from(i) * 2e-3);
        let theta: Vec<f64> = (0..48).map(spread).chain(even).chain(horizon).filter(|theta| *theta <= reach).collect();
        let eight = |theta: &[f64]| {
            let mut eight = [ZERO; 3];
            for (lane, theta) in theta.iter().enumerate() {
                let half = libm::sin(0.5 * theta);
                let w = 2.0 * half * half;
                [eight[0][lane], eight[1][lane]] = [libm::cos(*theta), function(w)];
                eight[2][lane] = 1.0 / (kernel(w) + floor);
            }
            eight
        };
        Self { places: theta.chunks(LANES).map(eight).collect() }
    }

    /// For degrees L = step, 2 step, … : the largest |function(c) − Σ_(l≤L) (2l+1)/4π λ_l P_l(c)| / (K(c) + floor).
    pub fn relative(&self, eigenvalues: &[f64], step: usize, instructions: InstructionSet) -> Vec<f64> {
        // (2l + 1)/4π λ_l, and what the recurrence of P_l multiplies by.
        let terms: Vec<[f64; 3]> = (0..)
            .zip(eigenvalues)
            .map(|(l, lambda)| {
                let l = f64::from(l);
                [(2.0 * l + 1.0) / (4.0 * PI) * lambda, (2.0 * l + 1.0) / (l + 1.0), l / (l + 1.0)]
            })
            .collect();
        let largest = instructions.run(
            #[inline(always)]
            || remainders(&self.places, &terms, step),
        );
        largest.into_iter().map(|of| of.into_iter().fold(0.0, f64::max)).collect()
    }
}

/// Of each lane, the largest relative remainder after every `step` terms.
#[inline(always)]
fn remainders(places: &[[V; 3]], terms: &[[f64; 3]], step: usize) -> Vec<V> {
    let mut largest = vec![ZERO; (terms.len() - 1) / step];
    for &[x, function, scales] in places {
        let (mut before, mut current, mut sum) = (ZERO, [1.0; LANES], ZERO);
        for (l, &[term, a, b]) in terms.iter().enumerate() {
            sum = scale_add(current, term, sum);
            let next = sub(mul(scale(x, a), current), scale(before, b));
            (before, current) = (current, next);
            if l > 0
                && l.is_multiple_of(step)
                && let Some(largest) = largest.get_mut(l / step - 1)
            {
                let off = mul(sub(function, sum), scales);
                (0..LANES).for_each(|i| largest[i] = largest[i].max(off[i].abs()));
            }
        }
    }
    largest
}
