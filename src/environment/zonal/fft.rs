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
    fn add(self, other: Self) -> Self {
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
                4 => self.pass4(n, stride, x, spare),
                2 => self.pass2(n, stride, x, spare),
                _ => self.pass(radix, n, stride, x, spare),
            }
            std::mem::swap(x, spare);
            n /= radix;
            stride *= radix;
        }
    }

    #[inline(always)]
    fn pass4(&self, n: usize, stride: usize, x: &[Complex], y: &mut [Complex]) {
        let m = n / 4;
        let (x0, rest) = x[..self.n].split_at(m * stride);
        let (x1, rest) = rest.split_at(m * stride);
        let (x2, x3) = rest.split_at(m * stride);
        for (p, out) in y.chunks_exact_mut(4 * stride).enumerate() {
            let [w1, w2, w3] = [1, 2, 3].map(|j| self.roots[p * j * stride]);
            let (y0, rest) = out.split_at_mut(stride);
            let (y1, rest) = rest.split_at_mut(stride);
            let (y2, y3) = rest.split_at_mut(stride);
            for q in 0..stride {
                let at = q + stride * p;
                let (a, b, c, d) = (x0[at], x1[at], x2[at], x3[at]);
                let (sum, difference) = (a.add(c), a.sub(c));
                let (other, turned) = (b.add(d), b.sub(d).turned());
                y0[q] = sum.add(other);
                y1[q] = difference.add(turned).times(w1);
                y2[q] = sum.sub(other).times(w2);
                y3[q] = difference.sub(turned).times(w3);
            }
        }
    }

    #[inline(always)]
    fn pass2(&self, n: usize, stride: usize, x: &[Complex], y: &mut [Complex]) {
        let (x0, x1) = x[..self.n].split_at(n / 2 * stride);
        for (p, out) in y.chunks_exact_mut(2 * stride).enumerate() {
            let w = self.roots[p * stride];
            let (y0, y1) = out.split_at_mut(stride);
            for q in 0..stride {
                let (a, b) = (x0[q + stride * p], x1[q + stride * p]);
                y0[q] = a.add(b);
                y1[q] = a.sub(b).times(w);
            }
        }
    }

    #[inline(always)]
    fn pass(&self, radix: usize, n: usize, stride: usize, x: &[Complex], y: &mut [Complex]) {
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

/// The transforms of two real sequences from the one of their first + i second, at frequency m: that needs its values at m and
/// at −m.
#[inline(always)]
pub(super) fn separate(at: Complex, opposite: Complex) -> (Complex, Complex) {
    let first = Complex { re: add(at.re, opposite.re), im: sub(at.im, opposite.im) };
    let second = Complex { re: add(at.im, opposite.im), im: sub(opposite.re, at.re) };
    (first.scaled(0.5), second.scaled(0.5))
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
