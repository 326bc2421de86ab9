//! How many degrees a level takes, and what leaving out the others can change.
//!
//! Without degrees above L, a kernel K becomes K − κ, and the filtered function F is off by E(R) = ∫ κ(R·l) f(l) dl. If
//! |κ| ≤ t (K + v/Φ) everywhere, Φ = ∫ |f|, then |E| ≤ t (F + v): relative to an output no darker than v, at most 2t. Where f ≥ 0 that
//! holds for every map of this flux, a lone sun included. A second bound knows the map: |E| ≤ ‖κ‖ ‖f_(>L)‖ (Cauchy and Schwarz),
//! both norms from Parseval. The smaller one is reported.

use std::f64::consts::{PI, TAU};

use super::dark::Dark;
use super::eigenvalues::{Remainder, eigenvalues};
use super::fft::Fft;
use super::lanes::InstructionSet;
use super::legendre::Degrees;
use super::split::Split;
use super::tail::Tail;
use crate::environment::kernel::Kernel;
use crate::math::quadrature::{Rule, gauss_legendre};

/// Kernels that rise from their horizon at more than this (per steradian and radian: `nol` at alpha 0.1) have a horizon that shows: their λ_l
/// fall off algebraically.
const STEEP: f64 = 3.1e-3;
/// Degrees of a ring of p = 1, times p: e^(−pc) is told from what harmonics make of it.
const RING: f64 = 8.0;
/// The degree of a kernel whose horizon shows as much as Lambert's; an easy map takes half of it, a hard one twice as much.
const WIDE_DEGREE: usize = 256;
/// A horizon is steeper than Lambert's by this at most; a sheen's of alpha 0.05 is.
const STEEPEST: f64 = 80.0;
/// Degrees beyond which texels are summed instead: 1e7 coefficients, and a kernel narrower than 2e-3.
pub(super) const MOST_DEGREE: usize = 3500;
/// What a kernel's degree and grid are chosen for: the relative error of truncation at the peak, and the spacing of the grid in widths of the
/// kernel. Interpolation of degree five on spacing Δ is off by [`PEAK`] (Δ/width)⁶ at the peak of 1/(width² + θ²)². Kernels narrower than
/// [`NARROW`], whose degrees and grids are what takes time, are given the larger part of the goal.
struct Aim {
    truncation: f64,
    per_width: f64,
}

/// 1e-5 and 1e-5.
const USUAL: Aim = Aim { truncation: 1e-5, per_width: 0.095 };
/// 3e-5 and 4e-5.
const OF_NARROW: Aim = Aim { truncation: 3e-5, per_width: 0.12 };
const NARROW: f64 = 0.08;
const PEAK: f64 = 14.0;
/// What interpolation of a function with a tail may leave, in parts of a dark output.
const LEFT_BETWEEN: f64 = 2e-5;
/// λ_l of narrow kernels are looked at up to this many times 1/α: e^(−2 · 16) is beyond every need.
const REACH: f64 = 16.0;

/// How one level is filtered.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub kernel: Kernel,
    /// What is summed near the axis, of a kernel too narrow for harmonics; they hold the rest.
    pub split: Option<Split>,
    /// λ_0 … λ_L, without what the tail has of them.
    pub eigenvalues: Vec<f64>,
    pub share: Option<Share>,
    /// How far apart points of the grid may lie, in radians, and what interpolation is off by at a sun if they do.
    spacing: f64,
    interpolation: f64,
    /// What truncation is off by at a sun.
    truncation_at_peak: f64,
    /// t of the bound for every map of the same flux.
    pub any_map: f64,
    /// ‖κ‖; with a tail, of degrees that it has nothing of.
    pub remainder_norm: f64,
    /// How dark outputs were reckoned with.
    pub dark: Dark,
}

/// What a kernel takes of the tail that kernels share.
#[derive(Debug, Clone)]
pub(super) struct Share {
    /// What the tail is multiplied by.
    pub factor: f64,
    /// The tail's last degree.
    degree: usize,
    /// What truncation would be without it, at most.
    without: f64,
    /// The norm of what even degrees are off by.
    off: f64,
    /// The part of the kernel's own last degrees, which the tail has too, that it does not have.
    own: f64,
    /// How many of the kernel's own degrees the tail does not have.
    behind: f64,
}

impl Plan {
    /// The plan of a kernel on a map whose filtered values are no darker than that; `None` if it takes more than [`MOST_DEGREE`] degrees. A wide kernel takes at least `least_wide`. A cap narrower than what so many degrees resolve as
    /// a map of `height` rows is worth is split.
    pub fn new(
        kernel: Kernel,
        dark: Dark,
        least_wide: usize,
        height: usize,
        instructions: InstructionSet,
    ) -> Option<Self> {
        let worth = (3 * height / 2).clamp(256, 1024);
        if !kernel.is_ring() && kernel.alpha() < 4.0 / worth as f64 {
            return Some(Self::split(kernel, dark, worth, instructions));
        }
        let (width, wide) = (kernel.width(), is_wide(&kernel));
        let ring = kernel.is_ring();
        let most = if ring { RING * 2.0 / width } else { REACH * 2.0 / width };
        let most = (most.ceil() as usize).max(least_wide);
        if most > MOST_DEGREE * 4 / 3 {
            return None;
        }
        let value = |w: f64| kernel.eval(w);
        let mut lambda = lambdas(&kernel, most, instructions);
        let darkest = dark.darkest();
        let floor = darkest / (4.0 * PI);
        let step = (most / 64).max(1);
        let peak = Remainder::new([&value; 2], width, 1.2, floor).relative(&lambda, step, instructions);
        let aim = if width < NARROW { OF_NARROW } else { USUAL };
        let enough = peak.iter().position(|&off| off <= aim.truncation && !ring).map_or(most, |i| (i + 1) * step);
        let degree = if wide { enough.max(least_wide) } else { enough }.min(most);
        if degree > MOST_DEGREE {
            return None;
        }
        lambda.truncate(degree + 1);
        let whole = Remainder::new([&value; 2], width, PI, floor).relative(&lambda, degree, instructions);
        // ∫ K² = Σ (2l+1)/4π λ_l².
        let square = |w: f64| kernel.eval(w) * kernel.eval(w);
        let norm2 = eigenvalues(&square, kernel.singularities(), 0, instructions)[0];
        let held: f64 = lambda.iter().enumerate().map(|(l, v)| (2.0 * l as f64 + 1.0) / (4.0 * PI) * v * v).sum();
        // Rounding leaves 1e-16 of ‖K‖², above or below zero.
        let remainder_norm = (norm2 - held).abs().max(1e-15 * norm2).sqrt();
        Some(Self {
            kernel,
            split: None,
            spacing: aim.per_width * width,
            interpolation: PEAK * aim.per_width.powi(6),
            truncation_at_peak: peak.get((degree / step).max(1) - 1).copied().unwrap_or(0.0),
            any_map: whole[0],
            eigenvalues: lambda,
            share: None,
            remainder_norm,
            dark,
        })
    }

    /// The plan of a kernel whose part near the axis is summed, so that the rest takes about `degree` degrees.
    fn split(kernel: Kernel, dark: Dark, degree: usize, instructions: InstructionSet) -> Self {
        let darkest = dark.darkest();
        let split = Split::new(kernel, degree);
        let (rest, whole) = (|w: f64| split.rest(w), |w: f64| kernel.eval(w));
        let most = 3 * degree / 2;
        let mut lambda = eigenvalues(&rest, kernel.singularities(), most, instructions);
        let floor = darkest / (4.0 * PI);
        let step = (most / 64).max(1);
        let width = 1.0 / degree as f64;
        let peak = Remainder::new([&rest, &whole], width, 1.2, floor).relative(&lambda, step, instructions);
        let aim = USUAL.truncation;
        let degree = peak.iter().position(|&off| off <= aim).map_or(most, |i| (i + 1) * step).min(most);
        lambda.truncate(degree + 1);
        let everywhere = Remainder::new([&rest, &whole], width, PI, floor).relative(&lambda, degree, instructions);
        let square = |w: f64| rest(w) * rest(w);
        let norm2 = eigenvalues(&square, kernel.singularities(), 0, instructions)[0];
        let terms = lambda.iter().enumerate().map(|(l, v)| (l as f64, (2.0 * l as f64 + 1.0) / (4.0 * PI) * v));
        let held: f64 = terms.clone().zip(&lambda).map(|((_, term), v)| term * v).sum();
        let remainder_norm = (norm2 - held).abs().max(1e-15 * norm2).sqrt();
        // Interpolation of degree five on spacing Δ in two directions is off by 0.003 Δ⁶ Σ |term| l⁶ at the peak at most.
        let (peak, sixth) =
            terms.fold((0.0, 0.0), |(peak, sixth), (l, term)| (peak + term.abs(), sixth + term.abs() * l.powi(6)));
        let spacing = (aim * peak / (0.003 * sixth)).powf(1.0 / 6.0);
        Self {
            kernel,
            split: Some(split),
            spacing,
            interpolation: aim,
            truncation_at_peak: aim,
            any_map: everywhere[0],
            eigenvalues: lambda,
            share: None,
            remainder_norm,
            dark,
        }
    }

    /// Degrees that are this kernel's own.
    pub fn degree(&self) -> usize {
        self.eigenvalues.len() - 1
    }

    /// The last degree of all.
    pub fn last_degree(&self) -> usize {
        self.share.as_ref().map_or(self.degree(), |share| share.degree)
    }

    /// Degrees that should be the kernel's own if a tail goes on to another one: so many that what the tail does not have of those between (mostly odd
    /// ones) has a quarter of the power that is left out beyond, both of a map whose power falls like degree⁻². `lambert` are its λ_l.
    pub fn own_beside_tail(&self, last: usize, lambert: &[f64], instructions: InstructionSet) -> usize {
        let lambda = lambdas(&self.kernel, last, instructions);
        let last_even = last / 2 * 2;
        let power = |l: usize, of: f64| (2 * l + 1) as f64 * of * of / (l * l) as f64;
        let factor = lambda[last_even] / lambert[last_even];
        // Σ l⁻⁶ over even l beyond.
        let most = 0.25 * power(last_even, lambda[last_even]) * last as f64 / 10.0;
        let mut left = 0.0;
        for l in (self.degree() + 1..=last).rev() {
            let of_tail = if l.is_multiple_of(2) { factor * lambert[l] } else { 0.0 };
            left += power(l, lambda[l] - of_tail);
            if left > most {
                return l;
            }
        }
        self.degree()
    }

    /// Takes beyond its own degrees what the tail has, given the bound of truncation without it.
    pub fn take(&mut self, tail: &Tail, without: f64, instructions: InstructionSet) {
        let (kernel, own, last) = (self.kernel, self.degree(), tail.degree());
        // (Without an even degree between, it has nothing.)
        if last / 2 * 2 <= own {
            return;
        }
        let value = |w: f64| kernel.eval(w);
        let lambda = lambdas(&kernel, last, instructions);
        let evens = || (own + 1..=last).filter(|l| l.is_multiple_of(2)).map(|l| (l, (2 * l + 1) as f64 / (4.0 * PI)));
        let sum = |of: &dyn Fn(usize) -> f64| evens().map(|(l, weight)| weight * of(l)).sum::<f64>();
        let factor = sum(&|l| lambda[l] * tail.eigenvalues[l]) / sum(&|l| tail.eigenvalues[l].powi(2));
        let of_tail =
            |l: usize| if Degrees::EvenAbove(tail.behind).contains(l) { factor * tail.eigenvalues[l] } else { 0.0 };
        let all: Vec<f64> = (0..=last).map(|l| if l <= own { self.eigenvalues[l] } else { of_tail(l) }).collect();
        let floor = self.dark.darkest() / (4.0 * PI);
        self.any_map = Remainder::new([&value; 2], kernel.width(), PI, floor).relative(&all, last, instructions)[0];
        let off = sum(&|l| (lambda[l] - of_tail(l)).powi(2)).sqrt();
        self.remainder_norm = (self.remainder_norm.powi(2) - sum(&|l| lambda[l].powi(2))).max(0.0).sqrt();
        let norm = |of: &[f64]| (tail.behind + 1..=own).map(|l| (2 * l + 1) as f64 * of[l] * of[l]).sum::<f64>().sqrt();
        let all = norm(&self.eigenvalues);
        self.eigenvalues.iter_mut().enumerate().for_each(|(l, v)| *v -= of_tail(l));
        let own = if all > 0.0 { norm(&self.eigenvalues) / all } else { 1.0 };
        self.share =
            Some(Share { factor, degree: last, without, off, own, behind: tail.behind as f64 / self.degree() as f64 });
    }

    /// Rings and columns of the grid, given the bound of what truncation changes on this map.
    ///
    /// Points are never farther apart than what holds the degrees; but those of a horizon that shows are few and small where the bound is, and what
    /// interpolation makes of them was at most 0.04 of the bound at as many rings as degrees, and as much more for fewer as their number's fourth power is
    /// less (on a lone lamp of straight sides, the worst of some thousand random maps).
    pub fn grid(&self, truncation: f64) -> [usize; 2] {
        let dense = match (&self.share, truncation) {
            // What is truncated, 0.01 of the bound, is what the last degrees add too; degree l is off by 0.005 (lΔ)⁶ of it.
            (Some(share), _) => {
                // Of those that the tail has too only a part is left; below them, l⁻³ as much is added at larger Δ⁻¹.
                let sixth_root = |x: f64| libm::cbrt(x.sqrt());
                let all = PI * sixth_root(0.005 * 0.01 * share.without / LEFT_BETWEEN);
                all * sixth_root(share.own).max(share.behind.sqrt())
            }
            _ if !is_wide(&self.kernel) || self.split.is_some() => 1.2,
            (None, bound) => (0.04 * bound / LEFT_BETWEEN).sqrt().sqrt().clamp(0.5, 1.6),
        };
        let degree = self.degree() as f64;
        let rings = (PI / self.spacing).max(dense * degree).max(16.0);
        let columns = (TAU / self.spacing).max(1.8 * dense * degree).max(32.0);
        [rings as usize, Fft::fast_length(columns as usize)]
    }

    /// The relative error that a grid and truncation leave at a lone sun, at most: nothing where suns are peeled off first.
    pub fn at_a_sun(&self, [rings, _]: [usize; 2]) -> f64 {
        if is_wide(&self.kernel) && self.split.is_none() {
            return 0.0;
        }
        let spacing = PI / rings as f64;
        self.truncation_at_peak + self.interpolation * (spacing / self.spacing).powi(6)
    }

    /// The largest relative error that truncation can cause, given the part `share` of the light that was not peeled off, and
    /// the map beyond its mean: its squared norm (of each channel) and Σ |f_lm|² of each degree; and the tail.
    pub fn truncation(
        &self,
        share: f64,
        mean: [f64; 3],
        norm2: [f64; 3],
        powers: &[[f64; 3]],
        tail: Option<&Tail>,
    ) -> f64 {
        let mut this_map = 0.0f64;
        for c in (0..3).filter(|&c| mean[c] > 0.0) {
            let (of_tail, off) = match (&self.share, tail) {
                (Some(share), Some(tail)) => (tail.power_beyond(self.degree(), c), share.off),
                _ => (0.0, 0.0),
            };
            let held: f64 = powers.iter().take(self.degree() + 1).map(|power| power[c]).sum();
            let rest = (norm2[c] - held - of_tail).max(1e-14 * norm2[c]);
            let most = self.remainder_norm * rest.sqrt() + off * of_tail.sqrt();
            this_map = this_map.max(most / (self.dark.darkest() * mean[c]));
        }
        this_map.min(2.0 * self.any_map * share.max(1e-3))
    }
}

/// λ_0 … λ_degree of a whole kernel.
pub(super) fn lambdas(kernel: &Kernel, degree: usize, instructions: InstructionSet) -> Vec<f64> {
    eigenvalues(&|w| kernel.eval(w), kernel.singularities(), degree, instructions)
}

/// The degree of a wide kernel; an easy map takes half of it, a hard one twice as much. A kink of slope a leaves a L^(−5/2) behind, the same for all.
pub(super) fn usual_degree(kernel: &Kernel) -> usize {
    let steeper = (kernel.horizon()[0] * PI).clamp(1.0, STEEPEST);
    (WIDE_DEGREE as f64 * steeper.powf(0.4)) as usize
}

/// Whether a kernel's horizon shows.
pub(super) fn is_wide(kernel: &Kernel) -> bool {
    kernel.horizon()[0] > STEEP
}

/// Gauss points for a row, on [0, 1].
///
/// The kernels' singularities lie `narrowest` away, so n points on a part of height h leave (h/4 narrowest)^2n. A row higher than the
/// kernel is wide is cut into parts. A kink has no width: points enough for the `degree` of the kernels that have one are taken too.
pub(super) fn row_rule(narrowest: f64, degree: usize, height: usize) -> Rule {
    /// Of a part: 0.3^12 is 5e-7.
    const LARGEST: f64 = 0.3;
    /// What two points or more may leave.
    const LEFT: f64 = 5e-6;
    let row = PI / height as f64;
    let ratio = row / (4.0 * narrowest);
    let turn = 0.5 * row * degree as f64;
    let parts = (ratio / LARGEST).max(turn / 5.0).ceil().max(1.0);
    let n =
        (2..6).find(|&n| (ratio / parts).powi(2 * n) < LEFT && turn / parts <= f64::from(n - 1)).unwrap_or(6) as usize;
    let part = gauss_legendre(n);
    let nodes = (0..parts as usize).flat_map(|i| part.nodes.iter().map(move |t| (i as f64 + t) / parts)).collect();
    let weights = part.weights.iter().map(|w| w / parts).cycle().take(n * parts as usize).collect();
    Rule { nodes, weights }
}
