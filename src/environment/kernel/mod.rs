//! The zonal kernels that environment maps are prefiltered with, under N = V = R.
//!
//! A filter that takes the view and the normal to be the direction R that it filters for sees a lobe of c = R·l alone, with the half-vector h
//! half-way between R and l: cos²h = (1 + c)/2, sin²h = (1 − c)/2. Whether it samples a distribution D of normals, or (at N = V the same)
//! its visible normals, light directions come with the density D(h) (N·h)/(4 R·h) = D(h)/4, and a weight on each sample decides which
//! kernel the average converges to:
//!
//! | kind | weight | kernel, for c > 0 | who |
//! | --- | --- | --- | --- |
//! | `nol` | N·L | N c/(1 − βc)² | most real-time engines, after Karis 2013 |
//! | `g1` | masking G1(l) | N G1(c)/(1 − βc)² | MaterialX's prefilter (`mx_generate_prefilter_env.glsl`) |
//! | `charlie` | N·L | N wᵖ c, w = 1 − c, p = 1/(2α) | glTF's sampler and its kin, for sheen |
//!
//! **GGX** (`nol`, `g1`): β = (1 − α²)/(1 + α²); cos²h turns the denominator (1 + (α² − 1) cos²h)² into ((1 + α²)/2)² (1 − βc)². At
//! N = V Smith's height-correlated G2 is G1(l) = 2c/(c + √(α² + (1 − α²) c²)), so that `g1` is the BRDF times the cosine there, D G2/(4 N·V),
//! over its albedo. (Other engines weigh by Schlick's fit to G1, c/(c (1 − α/2) + α/2), or a variant: near `g1`, and no lobe of a BRDF.) Near its
//! horizon it rises over a cosine of α, `nol` over a cosine of one. At α = 1 `nol` is max(c, 0)/π, Lambert's.
//!
//! **Charlie** (Estevez and Kulla 2017): D ∝ sin^(1/α) h, so that K is a power of w: a ring below the horizon, wider than the cap
//! that GGX is; its normalisation 1/N = 2π B(p + 1, 2) = 2π/((p + 1)(p + 2)).
//!
//! **Normalisation**: `nol` 1/N = 2π [1/(1−β) − 1 + ln(1−β)] / β²; `g1` by Gauss rules in two substitutions that leave nothing to resolve.
//! Everything is evaluated from 1 − c and 1 − β = 2α²/(1 + α²), because both are tiny where the lobe is narrow and high.

pub(super) mod power;

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::math::quadrature::gauss_legendre;
use power::power;

/// What a kernel weighs directions by.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum KernelKind {
    /// GGX's distribution of normals times N·L.
    #[default]
    Nol,
    /// GGX's distribution of normals times Smith's masking of the light: the BRDF at N = V.
    G1,
    /// The distribution of a sheen's fibres times N·L.
    Charlie,
}

impl KernelKind {
    /// Every kind, in the order in which they are listed to a user.
    pub const ALL: [Self; 3] = [Self::Nol, Self::G1, Self::Charlie];

    /// The name that a user writes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nol => "nol",
            Self::G1 => "g1",
            Self::Charlie => "charlie",
        }
    }
}

/// The zonal kernel of one roughness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kernel {
    kind: KernelKind,
    alpha: f64,
    beta: f64,
    one_minus_beta: f64,
    norm: f64,
    /// p, of a sheen.
    power: f64,
}

/// K and its derivative K″ by c, as a type to be inlined in loops: [`Kernel::eval`] without the question which kernel it is.
///
/// `c` > 0 and `w` = 1 − c.
pub(crate) trait Profile {
    /// K(c).
    fn value(kernel: &Kernel, c: f64, w: f64) -> f64;
    /// K″(c).
    fn curvature(kernel: &Kernel, c: f64, w: f64) -> f64;
    /// K(c) of any cosine, without a branch.
    #[inline(always)]
    fn at(kernel: &Kernel, c: f64) -> f64 {
        let lit = if c > 0.0 { c } else { 0.0 };
        Self::value(kernel, lit, 1.0 - lit)
    }
    /// K(c) and K″(c).
    #[inline(always)]
    fn both(kernel: &Kernel, c: f64, w: f64) -> (f64, f64) {
        (Self::value(kernel, c, w), Self::curvature(kernel, c, w))
    }
}

/// [`KernelKind::Nol`] at alpha 1.
pub(crate) struct Lambert;

/// [`KernelKind::Nol`].
pub(crate) struct Nol;
/// [`KernelKind::G1`].
pub(crate) struct G1;
/// [`KernelKind::Charlie`].
pub(crate) struct Charlie;

/// Runs an expression with `$profile` standing for the [`Profile`] of a kernel: a match outside of the loop.
macro_rules! with_profile {
    ($kernel:expr, $profile:ident => $body:expr) => {
        match $kernel.kind() {
            $crate::environment::kernel::KernelKind::Nol => {
                type $profile = $crate::environment::kernel::Nol;
                $body
            }
            $crate::environment::kernel::KernelKind::G1 => {
                type $profile = $crate::environment::kernel::G1;
                $body
            }
            $crate::environment::kernel::KernelKind::Charlie => {
                type $profile = $crate::environment::kernel::Charlie;
                $body
            }
        }
    };
}
pub(crate) use with_profile;

impl Profile for Nol {
    #[inline(always)]
    fn value(kernel: &Kernel, c: f64, w: f64) -> f64 {
        let d = kernel.one_minus_beta + kernel.beta * w;
        kernel.norm * c / (d * d)
    }

    #[inline(always)]
    fn curvature(kernel: &Kernel, c: f64, w: f64) -> f64 {
        let r = 1.0 / (kernel.one_minus_beta + kernel.beta * w);
        kernel.norm * r * r * r * (4.0 * kernel.beta + 6.0 * kernel.beta * kernel.beta * c * r)
    }

    #[inline(always)]
    fn both(kernel: &Kernel, c: f64, w: f64) -> (f64, f64) {
        let r = 1.0 / (kernel.one_minus_beta + kernel.beta * w);
        let scale = kernel.norm * r * r;
        (scale * c, scale * r * (4.0 * kernel.beta + 6.0 * kernel.beta * kernel.beta * c * r))
    }
}

impl Profile for Lambert {
    #[inline(always)]
    fn value(kernel: &Kernel, c: f64, _w: f64) -> f64 {
        kernel.norm * c
    }

    #[inline(always)]
    fn curvature(_kernel: &Kernel, _c: f64, _w: f64) -> f64 {
        0.0
    }
}

impl Profile for G1 {
    #[inline(always)]
    fn value(kernel: &Kernel, c: f64, w: f64) -> f64 {
        let d = kernel.one_minus_beta + kernel.beta * w;
        let s = kernel.squeezed(c);
        kernel.norm * 2.0 * c / ((c + s) * (d * d))
    }

    #[inline(always)]
    fn curvature(kernel: &Kernel, c: f64, w: f64) -> f64 {
        // g = 2c/(c + s) with s² = α² + (1 − α²) c²; g′ = 2α²/(s (c + s)²), as s − c s′ = α²/s.
        let (beta, r) = (kernel.beta, 1.0 / (kernel.one_minus_beta + kernel.beta * w));
        let a2 = kernel.alpha * kernel.alpha;
        let s = kernel.squeezed(c);
        let (slope, q) = ((1.0 - a2) * c / s, 1.0 / (c + s));
        let g = 2.0 * c * q;
        let g1 = 2.0 * a2 * q * q / s;
        let g2 = -g1 * (slope / s + 2.0 * (1.0 + slope) * q);
        kernel.norm * r * r * (g2 + 4.0 * beta * r * g1 + 6.0 * beta * beta * r * r * g)
    }
}

impl Profile for Charlie {
    #[inline(always)]
    fn value(kernel: &Kernel, c: f64, w: f64) -> f64 {
        kernel.norm * c * power(w, kernel.power)
    }

    #[inline(always)]
    fn curvature(kernel: &Kernel, c: f64, w: f64) -> f64 {
        let p = kernel.power;
        kernel.norm * p * ((p - 1.0) * c - 2.0 * w) * power(w, p) / (w * w + f64::MIN_POSITIVE)
    }
}

impl Kernel {
    /// The kernel of microfacet width `alpha`, in (0, 1], that weighs by N·L. (A mirror, alpha = 0, has no kernel.)
    pub fn new(alpha: f64) -> Self {
        Self::of(KernelKind::Nol, alpha)
    }

    /// The kernel of a kind and a microfacet width in (0, 1].
    pub fn of(kind: KernelKind, alpha: f64) -> Self {
        debug_assert!(alpha > 0.0 && alpha <= 1.0, "alpha {alpha} is outside (0, 1]");
        let a2 = alpha * alpha;
        let (beta, one_minus_beta) = ((1.0 - a2) / (1.0 + a2), 2.0 * a2 / (1.0 + a2));
        let power = 0.5 / alpha;
        let mut kernel = Self { kind, alpha, beta, one_minus_beta, norm: 1.0, power };
        kernel.norm = match kind {
            KernelKind::Nol => 1.0 / (TAU * cosine_integral(beta, one_minus_beta)),
            KernelKind::G1 => 1.0 / (TAU * masking_integral(&kernel)),
            KernelKind::Charlie => (power + 1.0) * (power + 2.0) / TAU,
        };
        kernel
    }

    /// What it weighs by.
    pub fn kind(&self) -> KernelKind {
        self.kind
    }

    /// Microfacet width.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// β, 1 − β and the normalisation N, for loops that evaluate [`KernelKind::Nol`] themselves.
    #[cfg(test)]
    pub(crate) fn coefficients(&self) -> (f64, f64, f64) {
        (self.beta, self.one_minus_beta, self.norm)
    }

    /// √(α² + (1 − α²) c²): the length of a direction of cosine c, squeezed by α across the surface.
    #[inline(always)]
    fn squeezed(&self, c: f64) -> f64 {
        let a2 = self.alpha * self.alpha;
        (a2 + (1.0 - a2) * c * c).sqrt()
    }

    /// Whether the kernel is a multiple of the cosine: [`Lambert`].
    pub(crate) fn is_lambert(&self) -> bool {
        self.kind == KernelKind::Nol && self.beta == 0.0
    }

    /// Whether the kernel is a ring below the horizon instead of a cap about its axis.
    pub(crate) fn is_ring(&self) -> bool {
        self.kind == KernelKind::Charlie
    }

    /// p, and the cosine above which there is nothing of a sheen.
    pub(crate) fn ring(&self) -> [f64; 2] {
        [self.power, -libm::expm1(NOTHING / self.power)]
    }

    /// ∫ K dw from the axis to w, of a sheen: w^(p + 1) (1 + (p + 1) c)/2π, per radian of azimuth.
    pub(crate) fn within(&self, w: f64) -> f64 {
        power(w, self.power + 1.0) * (1.0 + (self.power + 1.0) * (1.0 - w)) / TAU
    }

    /// How narrow its narrowest part is, in radians: for caps the distance of the singularities from the axis to first order.
    pub(crate) fn width(&self) -> f64 {
        if self.is_ring() { (2.0 / self.power).min(2.0) } else { 2.0 * self.alpha }
    }

    /// Distances, in radians, of the kernel's complex singularities from its axis and (on the side above) from its horizon, or lengths
    /// over which it varies as much as if there were some.
    pub(crate) fn singularities(&self) -> [f64; 2] {
        match self.kind {
            KernelKind::Nol => [2.0 * self.alpha, 2.0],
            KernelKind::G1 => [2.0 * self.alpha, self.alpha],
            // θ^(1/α) has no width.
            KernelKind::Charlie => [1e-6, (4.0 / self.power).min(2.0)],
        }
    }

    /// Squared distance of the kernel's singularities from its axis, in radians.
    fn width2(&self) -> f64 {
        4.0 * self.alpha.powi(2) / (1.0 - self.alpha.powi(2)).max(1e-300)
    }

    /// K ≈ a c + b c² + d c³ where c is small beside the fourth number.
    pub(crate) fn horizon(&self) -> [f64; 4] {
        let (n, beta, p) = (self.norm, self.beta, self.power);
        match self.kind {
            KernelKind::Nol => [n, 2.0 * beta * n, 3.0 * beta * beta * n, 1.0],
            KernelKind::G1 => {
                // 2c/(c + √(α² + (1 − α²) c²)) is 2/α (c − c²/α + (1 + α²) c³/2α² − …).
                let (a, steep) = (2.0 * n / self.alpha, 1.0 / self.alpha);
                let third = 3.0 * beta * beta - 2.0 * beta * steep + 0.5 * (1.0 + steep * steep);
                [a, a * (2.0 * beta - steep), a * third, self.alpha]
            }
            KernelKind::Charlie => [n, -p * n, 0.5 * p * (p - 1.0) * n, (1.0 / p).min(1.0)],
        }
    }

    /// A length over which the kernel is smooth within a part of the sphere: as if its nearest complex singularity lay so far away, at
    /// most one radian. The part is `chord` away from the axis at its nearest point and within `reach` of a direction of cosine `c`.
    pub(crate) fn smoothness(&self, chord: f64, c: f64, reach: f64) -> f64 {
        match self.kind {
            KernelKind::Nol => (self.width2() + chord * chord).sqrt().min(1.0),
            KernelKind::G1 => {
                let near = (c.abs() - reach).max(0.0);
                let horizon = self.alpha * self.alpha + near * near;
                (self.width2() + chord * chord).sqrt().min(AT_HORIZON * horizon.sqrt()).min(1.0)
            }
            KernelKind::Charlie => {
                if self.power * (1.0 - c + reach).clamp(1e-300, 1.0).ln() < NOTHING {
                    return 1.0;
                }
                // d ln K/dθ = p/tan(θ/2): as much as a singularity four times its inverse away.
                let half = (0.5 * chord).min(1.0);
                let tangent = half / (1.0 - half * half).max(1e-9).sqrt();
                (4.0 * tangent / self.power.max(4.0)).clamp(1e-5, 1.0)
            }
        }
    }

    /// Where [`Kernel::smoothness`] of parts of that reach may be below `least`: at cosines above the first number, or below the second
    /// in size (not less than `reach`, where the horizon cuts).
    pub(crate) fn rough_parts(&self, least: f64, reach: f64) -> [f64; 2] {
        let beyond = (least + reach).powi(2) - self.width2();
        match self.kind {
            _ if least + reach > 1.0 => [f64::NEG_INFINITY, 1.0],
            KernelKind::Nol => [1.0 - beyond / 2.0, reach],
            KernelKind::G1 => {
                let belt = (least / AT_HORIZON).powi(2) - self.alpha * self.alpha;
                [1.0 - beyond / 2.0, if belt > 0.0 { belt.sqrt() + reach } else { reach }]
            }
            KernelKind::Charlie => {
                let angle = 2.0 * (0.25 * least * self.power.max(4.0)).atan() + 2.0 * reach;
                let cos = angle.min(PI).cos();
                let nothing = self.power * (1.0 - cos + reach).clamp(1e-300, 1.0).ln() < NOTHING;
                [if nothing { f64::INFINITY } else { cos }, reach]
            }
        }
    }

    /// K(c), per steradian, from 1 − c.
    #[inline]
    pub fn eval(&self, one_minus_cos: f64) -> f64 {
        let c = 1.0 - one_minus_cos;
        if c > 0.0 { with_profile!(self, P => P::value(self, c, one_minus_cos)) } else { 0.0 }
    }

    /// K between two unit directions.
    pub fn between(&self, a: DVec3, b: DVec3) -> f64 {
        self.eval(one_minus_cos(a, b))
    }

    /// Density, per steradian, of the directions that [`Kernel::sample`] makes.
    ///
    /// A distribution of normals gives directions the density D(h)/4 over the whole sphere. Those below the horizon count for nothing, so
    /// this is the same density cut off there and normalised again: (1 − β)/(2π (1 − βc)²) for GGX, (p + 1) wᵖ/2π for a sheen.
    #[inline]
    pub fn pdf(&self, one_minus_cos: f64) -> f64 {
        if one_minus_cos > 1.0 {
            return 0.0;
        }
        if self.is_ring() {
            return (self.power + 1.0) / TAU * power(one_minus_cos, self.power);
        }
        let d = self.one_minus_beta + self.beta * one_minus_cos;
        self.one_minus_beta / (TAU * d * d)
    }

    /// K/pdf, finite where both are tiny or huge.
    #[inline]
    pub fn weight(&self, one_minus_cos: f64) -> f64 {
        let c = (1.0 - one_minus_cos).max(0.0);
        match self.kind {
            KernelKind::Nol => self.norm * TAU / self.one_minus_beta * c,
            KernelKind::G1 => self.norm * TAU / self.one_minus_beta * 2.0 * c / (c + self.squeezed(c)),
            KernelKind::Charlie => (self.power + 2.0) * c,
        }
    }

    /// Maps the unit square to a direction about +Z with density [`Kernel::pdf`]: 1 − c and the azimuth.
    pub fn sample(&self, xi: [f64; 2]) -> (f64, f64) {
        let w = if self.is_ring() {
            power(xi[0], 1.0 / (self.power + 1.0))
        } else {
            xi[0] * self.one_minus_beta / (1.0 - self.beta * xi[0])
        };
        (w, TAU * xi[1])
    }

    /// The point of the unit square that [`Kernel::sample`] maps to this.
    pub fn invert(&self, one_minus_cos: f64, azimuth: f64) -> [f64; 2] {
        let xi = if self.is_ring() {
            power(one_minus_cos, self.power + 1.0)
        } else {
            one_minus_cos / (self.one_minus_beta + self.beta * one_minus_cos)
        };
        [xi, azimuth / TAU]
    }
}

/// Singularities beside the horizon count as that many times farther away: K is small there beside what it is at the axis.
const AT_HORIZON: f64 = 4.0;
/// ln of a sheen's wᵖ below which its kernel is nothing beside its ring.
const NOTHING: f64 = -32.0;

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

/// ∫₀¹ G1(c) / (1 − βc)² dc.
///
/// G1 has branch points at c = ±iα/√(1 − α²): below c = 1/2, c = a sinh s removes them. Above, 1/(1 − βc)² has its pole at w = −ε, ε = (1 − β)/β: there
/// w = ε (eᵗ − 1), in panels short enough for the exponential.
fn masking_integral(kernel: &Kernel) -> f64 {
    const PANEL: f64 = 1.5;
    let rule = gauss_legendre(20);
    let panels = |end: f64, f: &dyn Fn(f64) -> f64| {
        let n = (end / PANEL).ceil().max(1.0);
        let length = end / n;
        (0..n as usize).map(|i| length * rule.integrate(|x| f(length * (i as f64 + x)))).sum::<f64>()
    };
    let value = |c: f64, w: f64| {
        let d = kernel.one_minus_beta + kernel.beta * w;
        2.0 * c / ((c + kernel.squeezed(c)) * d * d)
    };
    let a = kernel.alpha;
    let below = panels((0.5 / a).asinh(), &|s| {
        let c = a * s.sinh();
        value(c, 1.0 - c) * a * s.cosh()
    });
    // ε → ∞ at α = 1; one radian is as far away as it takes.
    let epsilon = if kernel.beta > 0.0 { (kernel.one_minus_beta / kernel.beta).min(1.0) } else { 1.0 };
    let above = panels((0.5 / epsilon).ln_1p(), &|t| {
        let w = epsilon * t.exp_m1();
        value(1.0 - w, w) * epsilon * t.exp()
    });
    below + above
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

    fn all_kinds() -> impl Iterator<Item = Kernel> {
        KernelKind::ALL.into_iter().flat_map(|kind| ALPHAS.map(|alpha| Kernel::of(kind, alpha)))
    }

    #[test]
    fn kernel_and_density_integrate_to_one() {
        for kernel in all_kinds() {
            for (name, integral) in [
                ("kernel", integrate_over_hemisphere(|w| kernel.eval(w))),
                ("density", integrate_over_hemisphere(|w| kernel.pdf(w))),
                ("weight × density", integrate_over_hemisphere(|w| kernel.pdf(w) * kernel.weight(w))),
            ] {
                // Simpson's error is below n⁻⁴ × the fourth derivative, a ring's (4p)⁴ by its exponential; what is left is rounding of 2e5 terms.
                let ring = if kernel.is_ring() { (4.0 * kernel.power / 2e5).powi(4) } else { 0.0 };
                assert!((integral - 1.0).abs() < 1e-10 + ring, "{name}, {kernel:?}: {integral}");
            }
        }
    }

    /// ∫ D G1/4 is the albedo at normal incidence, which the tables integrate in another way.
    #[test]
    fn the_masked_kernel_is_the_lobe_over_its_albedo() {
        use crate::model::Lobe;
        use crate::model::ggx::{Ggx, Smith};
        for alpha in [0.01, 0.1, 0.5, 1.0] {
            let kernel = Kernel::of(KernelKind::G1, alpha);
            let lobe = Ggx::isotropic(alpha, Smith::Correlated);
            let ratio = |c: f64| {
                let wi = DVec3::new((1.0 - c * c).sqrt(), 0.0, c);
                lobe.f(DVec3::Z, wi) * c / kernel.eval(1.0 - c)
            };
            let albedo = ratio(0.9);
            for c in [1.0, 0.999, 0.5, 0.1, 1e-3] {
                // D of the lobe is computed from a normalised half-vector: its sine is good to ε/α.
                let tolerance = 1e-14 / alpha;
                assert!((ratio(c) / albedo - 1.0).abs() < tolerance, "alpha {alpha}, c = {c}: {}, {albedo}", ratio(c));
            }
            if alpha == 1.0 {
                // E(1, 1) = 1 − ln 2.
                assert!((albedo - (1.0 - 2f64.ln())).abs() < 1e-14, "{albedo}");
            }
        }
    }

    #[test]
    fn a_sheen_at_alpha_one_is_the_half_angle_times_the_cosine() {
        let kernel = Kernel::of(KernelKind::Charlie, 1.0);
        for w in [0.0, 1e-6, 0.3, 0.99, 1.0, 1.5] {
            let wanted = 15.0 / 8.0 / PI * f64::sqrt(w) * f64::max(1.0 - w, 0.0);
            // A power of 0 is 1e-304.
            assert!((kernel.eval(w) - wanted).abs() <= 8.0 * f64::EPSILON * wanted + 1e-303, "{w}: {}", kernel.eval(w));
        }
    }

    /// Against differences of K: of second order in the step, and rounding over the step squared.
    #[test]
    fn curvatures_and_horizons_are_derivatives_of_the_kernel() {
        for kernel in all_kinds().filter(|k| k.alpha() >= 0.03) {
            let step = 1e-3 * kernel.alpha();
            for c in [0.02, 0.1, 0.5, 0.9] {
                let k = |c: f64| kernel.eval(1.0 - c);
                let wanted = (k(c + step) - 2.0 * k(c) + k(c - step)) / (step * step);
                let got = with_profile!(kernel, P => P::curvature(&kernel, c, 1.0 - c));
                let scale = (k(c) / (kernel.alpha() * kernel.alpha())).max(got.abs());
                assert!((got - wanted).abs() < 1e-4 * scale, "{kernel:?}, c = {c}: {got}, {wanted}");
            }
            let [a, b, d, length] = kernel.horizon();
            for part in [0.01, 0.03] {
                let c = part * length;
                let (got, wanted) = (c * (a + c * (b + c * d)), kernel.eval(1.0 - c));
                // The fourth term, of which no kernel has more than four times its own scale.
                assert!((got / wanted - 1.0).abs() < 4.5 * part.powi(3) + 1e-9, "{kernel:?}, c = {c}: {got}, {wanted}");
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
        for kernel in all_kinds() {
            for xi in [[0.0, 0.0], [1e-9, 0.25], [0.3, 0.9], [0.999, 0.5]] {
                let (w, azimuth) = kernel.sample(xi);
                let back = kernel.invert(w, azimuth);
                // Rounding grows by the slope of the warp near its end, (1 − β)/(1 − βξ)² / (w/ξ) <= 1/(1 − ξ); a power's by the exponent.
                let growth = if kernel.is_ring() { 4.0 * (kernel.power + 1.0) } else { 1.0 / (1.0 - xi[0]) };
                let tolerance = 4.0 * f64::EPSILON * growth;
                assert!(
                    (back[0] - xi[0]).abs() < tolerance && (back[1] - xi[1]).abs() < 1e-15,
                    "{kernel:?} {xi:?}: {back:?}"
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
        for kernel in [0.05, 0.3, 1.0].into_iter().flat_map(|a| KernelKind::ALL.map(|kind| Kernel::of(kind, a))) {
            let alpha = kernel.alpha();
            let reach = if kernel.is_ring() { PI / 2.0 } else { (6.0 * alpha).min(PI / 2.0) };
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
            assert!(chi2 < limit, "{kernel:?}: chi-square {chi2} over {freedom}, limit {limit}");
        }
    }
}
