//! The lobe of a GGX-prefiltered environment map under N = V = R, weighted by N·L.
//!
//! With c = R·l and β = (1 − α²)/(1 + α²):
//!
//! K(c) = N max(c, 0) / (1 − βc)²,  1/N = 2π [1/(1−β) − 1 + ln(1−β)] / β².
//!
//! This is D(h) (R·l), normalised, with h half-way between R and l: cos²h = (1 + c)/2 turns GGX's denominator
//! (1 + (α² − 1) cos²h)² into ((1 + α²)/2)² (1 − βc)². It is what importance-sampling filters that weight by N·L converge
//! to. At α = 1 it is max(c, 0)/π: Lambert's. Everything is evaluated from 1 − c and 1 − β = 2α²/(1 + α²), because both
//! are tiny where the lobe is narrow and high.

use std::f64::consts::TAU;

use glam::DVec3;

/// The zonal kernel of one roughness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kernel {
    alpha: f64,
    beta: f64,
    one_minus_beta: f64,
    norm: f64,
}

impl Kernel {
    /// The kernel of microfacet width `alpha`, in (0, 1]. (A mirror, alpha = 0, has no kernel.)
    pub fn new(alpha: f64) -> Self {
        debug_assert!(alpha > 0.0 && alpha <= 1.0, "alpha {alpha} is outside (0, 1]");
        let a2 = alpha * alpha;
        let beta = (1.0 - a2) / (1.0 + a2);
        let one_minus_beta = 2.0 * a2 / (1.0 + a2);
        Self { alpha, beta, one_minus_beta, norm: 1.0 / (TAU * cosine_integral(beta, one_minus_beta)) }
    }

    /// Microfacet width.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// β, 1 − β and the normalisation N, for loops that evaluate K themselves.
    pub(crate) fn coefficients(&self) -> (f64, f64, f64) {
        (self.beta, self.one_minus_beta, self.norm)
    }

    /// Squared distance of the kernel's singularities from its axis, in radians.
    pub(crate) fn width2(&self) -> f64 {
        4.0 * self.alpha.powi(2) / (1.0 - self.alpha.powi(2)).max(1e-300)
    }

    /// K(c), per steradian, from 1 − c.
    pub fn eval(&self, one_minus_cos: f64) -> f64 {
        let d = self.one_minus_beta + self.beta * one_minus_cos;
        self.norm * (1.0 - one_minus_cos).max(0.0) / (d * d)
    }

    /// K(c) from c, for loops over many directions: without a branch, and off by rounding of c, 1e-16/(1 − β), where the lobe is high.
    #[inline(always)]
    pub(crate) fn at_cosine(&self, cos: f64) -> f64 {
        let d = self.one_minus_beta + self.beta * (1.0 - cos);
        let lit = if cos > 0.0 { cos } else { 0.0 };
        self.norm * lit / (d * d)
    }

    /// K between two unit directions.
    pub fn between(&self, a: DVec3, b: DVec3) -> f64 {
        self.eval(one_minus_cos(a, b))
    }

    /// Density, per steradian, of the directions that [`Kernel::sample`] makes.
    ///
    /// GGX's distribution of normals gives directions the density D(h)/4 = α² / (π (1 + α²)² (1 − βc)²) over the whole
    /// sphere. Those below the horizon count for nothing, so this is the same density cut off there and normalised again:
    /// (1 − β) / (2π (1 − βc)²). K differs from it by a factor proportional to c.
    pub fn pdf(&self, one_minus_cos: f64) -> f64 {
        if one_minus_cos > 1.0 {
            return 0.0;
        }
        let d = self.one_minus_beta + self.beta * one_minus_cos;
        self.one_minus_beta / (TAU * d * d)
    }

    /// Maps the unit square to a direction about +Z with density [`Kernel::pdf`]: 1 − c and the azimuth.
    pub fn sample(&self, xi: [f64; 2]) -> (f64, f64) {
        (xi[0] * self.one_minus_beta / (1.0 - self.beta * xi[0]), TAU * xi[1])
    }

    /// The point of the unit square that [`Kernel::sample`] maps to this.
    pub fn invert(&self, one_minus_cos: f64, azimuth: f64) -> [f64; 2] {
        [one_minus_cos / (self.one_minus_beta + self.beta * one_minus_cos), azimuth / TAU]
    }
}

/// 1 − a·b of unit vectors, without cancellation where they are close.
pub fn one_minus_cos(a: DVec3, b: DVec3) -> f64 {
    (a - b).length_squared() / 2.0
}

/// ∫₀¹ c / (1 − βc)² dc = [1/(1−β) − 1 + ln(1−β)] / β².
fn cosine_integral(beta: f64, one_minus_beta: f64) -> f64 {
    /// Below this the closed form loses digits to cancellation, and the series needs fewer than [`TERMS`] terms.
    const SERIES_BELOW: f64 = 0.25;
    const TERMS: u32 = 28;
    if beta < SERIES_BELOW {
        // Term by term: ∫ c (k + 1) (βc)^k dc.
        return (0..TERMS).rev().fold(0.0, |sum, k| sum * beta + f64::from(k + 1) / f64::from(k + 2));
    }
    (1.0 / one_minus_beta - 1.0 + one_minus_beta.ln()) / (beta * beta)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sobol::PointSet;
    use std::f64::consts::PI;

    const ALPHAS: [f64; 12] = [1e-3, 3e-3, 1e-2, 0.03, 0.1, 0.2, 0.35, 0.5, 0.7, 0.774, 0.9, 1.0];

    /// Composite Simpson in t with 1 − c = t⁴: an independent rule, fine enough at the lobe for every alpha above.
    fn integrate_over_hemisphere(f: impl Fn(f64) -> f64) -> f64 {
        let n = 200_000;
        let g = |i: u32| {
            let t = f64::from(i) / f64::from(n);
            f(t.powi(4)) * 4.0 * t.powi(3) * TAU
        };
        let weight = |i: u32| if i == 0 || i == n { 1.0 } else { [2.0, 4.0][i as usize % 2] };
        (0..=n).map(|i| weight(i) * g(i)).sum::<f64>() / (3.0 * f64::from(n))
    }

    #[test]
    fn kernel_and_density_integrate_to_one() {
        for alpha in ALPHAS {
            let kernel = Kernel::new(alpha);
            for (name, integral) in [
                ("kernel", integrate_over_hemisphere(|w| kernel.eval(w))),
                ("density", integrate_over_hemisphere(|w| kernel.pdf(w))),
            ] {
                // Simpson's error is below n⁻⁴ × the fourth derivative; what is left is rounding of 2e5 terms.
                assert!((integral - 1.0).abs() < 1e-10, "{name} at alpha {alpha}: {integral}");
            }
        }
    }

    #[test]
    fn the_series_meets_the_closed_form() {
        for beta in [0.2499, 0.25, 0.2501] {
            let closed = (1.0 / (1.0 - beta) - 1.0 + (1.0f64 - beta).ln()) / (beta * beta);
            let got = cosine_integral(beta, 1.0 - beta);
            // The closed form cancels about one digit.
            assert!((got / closed - 1.0).abs() < 1e-14, "beta {beta}: {got}, {closed}");
        }
    }

    #[test]
    fn at_alpha_one_the_kernel_is_lambert() {
        let kernel = Kernel::new(1.0);
        for w in [0.0, 0.1, 0.5, 0.9, 1.0, 1.5, 2.0] {
            let wanted = f64::max(1.0 - w, 0.0) / PI;
            assert!((kernel.eval(w) - wanted).abs() <= f64::EPSILON * wanted, "1 - c = {w}: {}", kernel.eval(w));
        }
    }

    #[test]
    fn the_kernel_is_the_ggx_distribution_times_the_cosine() {
        for alpha in ALPHAS {
            let kernel = Kernel::new(alpha);
            let ratio = |w: f64| {
                let cos2_h = 1.0 - w / 2.0;
                let ggx = alpha * alpha / (PI * (alpha * alpha * cos2_h + w / 2.0).powi(2));
                kernel.eval(w) / (ggx * (1.0 - w))
            };
            let first = ratio(0.0);
            for w in [1e-6, 1e-3, 0.1, 0.5, 0.99] {
                assert!((ratio(w) / first - 1.0).abs() < 1e-12, "alpha {alpha}, 1 - c = {w}: not proportional");
            }
        }
    }

    #[test]
    fn the_warp_has_its_inverse() {
        for alpha in ALPHAS {
            let kernel = Kernel::new(alpha);
            for xi in [[0.0, 0.0], [1e-9, 0.25], [0.3, 0.9], [0.999, 0.5]] {
                let (w, azimuth) = kernel.sample(xi);
                let back = kernel.invert(w, azimuth);
                // Rounding grows by the slope of the warp near its end, (1 − β)/(1 − βξ)² / (w/ξ) <= 1/(1 − ξ).
                let tolerance = 4.0 * f64::EPSILON / (1.0 - xi[0]);
                assert!(
                    (back[0] - xi[0]).abs() < tolerance && (back[1] - xi[1]).abs() < 1e-15,
                    "{alpha} {xi:?}: {back:?}"
                );
            }
        }
    }

    /// Chi-square of 2^16 independent points (one per replicate) in 32 bins of equal width in the *angle*, expected counts
    /// from quadrature of the density.
    #[test]
    fn samples_follow_their_density() {
        let n = 1 << 16;
        let bins = 32;
        for alpha in [0.05, 0.3, 1.0] {
            let kernel = Kernel::new(alpha);
            let reach = (6.0 * alpha).min(PI / 2.0);
            let bin = |w: f64| ((2.0 * (w / 2.0).sqrt().asin() / reach * f64::from(bins)) as usize).min(bins as usize);
            let mut seen = vec![0.0; bins as usize + 1];
            for r in 0..n {
                let xi = PointSet::<2>::new(4, r, 1).points()[0];
                seen[bin(kernel.sample(xi).0)] += 1.0;
            }
            let mut wanted = vec![0.0; bins as usize + 1];
            let steps = 64;
            let width = reach / f64::from(bins) / f64::from(steps);
            for i in 0..bins * steps {
                let theta = (f64::from(i) + 0.5) * width;
                wanted[(i / steps) as usize] +=
                    n as f64 * TAU * theta.sin() * width * kernel.pdf(2.0 * (theta / 2.0).sin().powi(2));
            }
            let rest = n as f64 - wanted.iter().sum::<f64>();
            wanted[bins as usize] = rest;
            let used = |w: f64| w >= 5.0;
            let chi2: f64 =
                seen.iter().zip(&wanted).filter(|(_, w)| used(**w)).map(|(s, w)| (s - w) * (s - w) / w).sum();
            let freedom = wanted.iter().filter(|w| used(**w)).count() as f64 - 1.0;
            // Wilson-Hilferty at 5 sigma: false alarm 3e-7.
            let k = 2.0 / (9.0 * freedom);
            let limit = freedom * (1.0 - k + 5.0 * k.sqrt()).powi(3);
            assert!(chi2 < limit, "alpha {alpha}: chi-square {chi2} over {freedom}, limit {limit}");
        }
    }
}
