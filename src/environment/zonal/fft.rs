//! The discrete Fourier transform of eight sequences at a time, any length.
//!
//! Stockham's self-sorting transform with decimation in frequency: passes of radix 4, 2, 3, 5 and any other prime factor, which
//! costs its own size (so lengths with a large prime factor are slow, but right). Twiddle factors come from the `libm` crate and
//! every lane sees the same operations in the same order: the same bits on every machine. Source: Van Loan, "Computational
//! Frameworks for the Fast Fourier Transform", 1992, is where the name comes from; the pass below follows from writing an index as
//! q + s (p + k n/r) and sorting by the output digit.

use std::f64::consts::TAU;

use super::lanes::{V, ZERO, add, mul, scale, scale_add, sub};

/// Eight complex numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Complex {
    pub re: V,
    pub im: V,
}

impl Complex {
    pub const ZERO: Self = Self { re: ZERO, im: ZERO };

    #[inline(always)]
    pub fn add(self, other: Self) -> Self {
        Self { re: add(self.re, other.re), im: add(self.im, other.im) }
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { re: sub(self.re, other.re), im: sub(self.im, other.im) }
    }

    /// Times −i.
    #[inline(always)]
    fn turned(self) -> Self {
        Self { re: self.im, im: mul(self.re, [-1.0; 8]) }
    }

    #[inline(always)]
    pub fn times(self, (cos, sin): (f64, f64)) -> Self {
        let (re, im) = (scale(self.im, -sin), scale(self.im, cos));
        Self { re: scale_add(self.re, cos, re), im: scale_add(self.re, sin, im) }
    }

    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        Self { re: scale(self.re, factor), im: scale(self.im, factor) }
    }
}

/// Σ_k x_k e^(−2πi jk/n).
#[derive(Debug, Clone)]
pub(super) struct Fft {
    n: usize,
    factors: Vec<usize>,
    /// e^(−2πi k/n): cosine and sine.
    roots: Vec<(f64, f64)>,
}

impl Fft {
    pub fn new(n: usize) -> Self {
        let mut factors = vec![];
        let mut rest = n;
        let mut factor = 4;
        while rest > 1 {
            if rest.is_multiple_of(factor) {
                factors.push(factor);
                rest /= factor;
            } else {
                factor = match factor {
                    4 => 2,
                    2 => 3,
                    f => f + 2,
                };
            }
        }
        let root = |k: usize| {
            let (sin, cos) = libm::sincos(TAU * k as f64 / n as f64);
            (cos, -sin)
        };
        Self { n, factors, roots: (0..n).map(root).collect() }
    }

    /// The smallest length at or above `least` that is even and has only factors 2, 3 and 5.
    pub fn fast_length(least: usize) -> usize {
        let smooth = |n: &usize| {
            let divided = [2, 3, 5].iter().fold(*n, |mut n, f| {
                while n.is_multiple_of(*f) {
                    n /= f;
                }
                n
            });
            divided == 1
        };
        (least.max(2).next_multiple_of(2)..).step_by(2).find(smooth).expect("a power of two is ahead")
    }

    /// Transforms `x`; `spare` is as long and its content is lost.
    #[inline(always)]
    pub fn forward(&self, x: &mut Vec<Complex>, spare: &mut Vec<Complex>) {
        let (mut n, mut stride) = (self.n, 1);
        for &radix in &self.factors {
            match radix {
                2 => self.pass(n, stride, x, spare, two),
                3 => self.pass(n, stride, x, spare, three),
                4 => self.pass(n, stride, x, spare, four),
                5 => self.pass(n, stride, x, spare, five),
                _ => self.pass_of_any(radix, n, stride, x, spare),
            }
            std::mem::swap(x, spare);
            n /= radix;
            stride *= radix;
        }
    }

    /// One pass, `short` the transform of as many numbers as its radix.
    #[inline(always)]
    fn pass<const R: usize>(
        &self,
        n: usize,
        stride: usize,
        x: &[Complex],
        y: &mut [Complex],
        short: impl Fn([Complex; R]) -> [Complex; R],
    ) {
        let part = n / R * stride;
        let parts: [&[Complex]; R] = std::array::from_fn(|k| &x[k * part..(k + 1) * part]);
        for (p, out) in y[..self.n].chunks_exact_mut(R * stride).enumerate() {
            let twiddles: [(f64, f64); R] = std::array::from_fn(|j| self.roots[p * j * stride]);
            for q in 0..stride {
                let values = short(std::array::from_fn(|k| parts[k][q + stride * p]));
                out[q] = values[0];
                for j in 1..R {
                    out[j * stride + q] = values[j].times(twiddles[j]);
                }
            }
        }
    }

    #[inline(always)]
    fn pass_of_any(&self, radix: usize, n: usize, stride: usize, x: &[Complex], y: &mut [Complex]) {
        let m = n / radix;
        for (p, out) in y.chunks_exact_mut(radix * stride).enumerate() {
            for j in 0..radix {
                let twiddle = self.roots[p * j * stride];
                for q in 0..stride {
                    let mut sum = x[q + stride * p];
                    for k in 1..radix {
                        let (cos, sin) = self.roots[j * k % radix * (self.n / radix)];
                        let term = x[q + stride * (p + k * m)];
                        sum = sum.add(term.times((cos, sin)));
                    }
                    out[j * stride + q] = sum.times(twiddle);
                }
            }
        }
    }
}

#[inline(always)]
fn two([a, b]: [Complex; 2]) -> [Complex; 2] {
    [a.add(b), a.sub(b)]
}

#[inline(always)]
fn three([a, b, c]: [Complex; 3]) -> [Complex; 3] {
    const SIN: f64 = 0.866_025_403_784_438_6; // sin 2π/3
    let sum = b.add(c);
    let middle = a.add(sum.scaled(-0.5));
    let turned = b.sub(c).scaled(SIN).turned();
    [a.add(sum), middle.add(turned), middle.sub(turned)]
}

#[inline(always)]
fn four([a, b, c, d]: [Complex; 4]) -> [Complex; 4] {
    let [even, odd] = [two([a, c]), two([b, d])];
    let turned = odd[1].turned();
    [even[0].add(odd[0]), even[1].add(turned), even[0].sub(odd[0]), even[1].sub(turned)]
}

#[inline(always)]
fn five([a, b, c, d, e]: [Complex; 5]) -> [Complex; 5] {
    // cos and sin of 2π/5 and of 4π/5.
    const COS: [f64; 2] = [0.309_016_994_374_947_45, -0.809_016_994_374_947_5];
    const SIN: [f64; 2] = [0.951_056_516_295_153_5, 0.587_785_252_292_473_1];
    let [outer, inner] = [two([b, e]), two([c, d])];
    let near = a.add(outer[0].scaled(COS[0])).add(inner[0].scaled(COS[1]));
    let far = a.add(outer[0].scaled(COS[1])).add(inner[0].scaled(COS[0]));
    let near_turned = outer[1].scaled(SIN[0]).add(inner[1].scaled(SIN[1])).turned();
    let far_turned = outer[1].scaled(SIN[1]).sub(inner[1].scaled(SIN[0])).turned();
    [
        a.add(outer[0]).add(inner[0]),
        near.add(near_turned),
        far.add(far_turned),
        far.sub(far_turned),
        near.sub(near_turned),
    ]
}

/// The transforms of two real sequences from the one of their first + i second, at frequency m: that needs its values at m and
/// at −m.
#[inline(always)]
pub(super) fn separate(at: Complex, opposite: Complex) -> [Complex; 2] {
    let first = Complex { re: add(at.re, opposite.re), im: sub(at.im, opposite.im) };
    let second = Complex { re: add(at.im, opposite.im), im: sub(opposite.re, at.re) };
    [first.scaled(0.5), second.scaled(0.5)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_agrees_with_the_sum_that_defines_it() {
        for n in [2, 4, 5, 6, 7, 8, 9, 10, 12, 16, 30, 34, 48, 64, 66, 120, 256, 333] {
            let value = |k: usize, lane: usize| ((k * 37 + lane * 11) % 101) as f64 / 50.0 - 1.0;
            let input = |k: usize| Complex {
                re: std::array::from_fn(|lane| value(k, lane)),
                im: std::array::from_fn(|lane| value(k * k + 3, lane)),
            };
            let mut x: Vec<Complex> = (0..n).map(input).collect();
            let mut spare = x.clone();
            Fft::new(n).forward(&mut x, &mut spare);
            for (j, got) in x.iter().enumerate() {
                for lane in 0..8 {
                    let (mut re, mut im) = (0.0, 0.0);
                    for k in 0..n {
                        let (sin, cos) = (-TAU * ((j * k) % n) as f64 / n as f64).sin_cos();
                        let (a, b) = (value(k, lane), value(k * k + 3, lane));
                        re += a * cos - b * sin;
                        im += a * sin + b * cos;
                    }
                    // Rounding of n terms of size one.
                    let off = (got.re[lane] - re).abs().max((got.im[lane] - im).abs());
                    assert!(off < 1e-15 * n as f64 * 2.0, "n {n}, j {j}, lane {lane}: off by {off:e}");
                }
            }
        }
    }

    #[test]
    fn fast_lengths_are_even_smooth_and_no_shorter() {
        assert_eq!([1, 2, 7, 11, 13, 121, 257, 1921].map(Fft::fast_length), [2, 2, 8, 12, 16, 128, 270, 1944]);
    }
}
