//! What the layered and compensated quantities are made of: the albedos of GGX with F = 1 and with Schlick's weight, by both
//! witnesses, and how their errors carry over.

use super::quantity::{Model, Parameter, Point};
use crate::error::Result;
use crate::integrate::monte_carlo::{Stop, defensive_tail};
use crate::integrate::{Estimate, Integration, over_cosine, quadrature};
use crate::math::frame::direction_with_cosine;
use crate::math::memo::Memo;
use crate::model::Lobe;
use crate::model::fresnel::{schlick_average, schlick_weight};
use crate::model::ggx::{Ggx, Smith};
use std::cell::RefCell;

/// How far inside the region of measure alpha² that a lobe loses its rim is resolved by Monte Carlo.
pub const TAIL: f64 = 0.01;

/// A GGX lobe with Schlick's reflectance, at a point of its domain.
#[derive(Debug, Clone, Copy)]
pub struct Specular {
    /// Cosine of the outgoing direction.
    pub mu: f64,
    /// Width.
    pub alpha: f64,
    /// Reflectance at normal incidence.
    pub f0: f64,
    /// Masking and shadowing.
    pub smith: Smith,
}

/// ∫ Fc f cosθ_i dω_i with Fc = (1 − wo·h)⁵, and the same with 1 for Fc: bias and E of the split sum.
pub type Split = [Estimate; 2];

thread_local! {
    /// Bias and E of mu, alpha, tolerance and masking.
    static SPLITS: RefCell<Memo<4, Split>> = const { RefCell::new(Memo::new()) };
    /// E_avg of alpha, tolerance and masking.
    static AVERAGES: RefCell<Memo<3, Estimate>> = const { RefCell::new(Memo::new()) };
}

impl Specular {
    /// The lobe that a point and a model stand for.
    pub fn at(at: &Point, model: &Model) -> Result<Self> {
        let (mu, alpha, f0) = (at.get(Parameter::Mu)?, at.get(Parameter::Alpha)?, at.get(Parameter::F0)?);
        Ok(Self { mu, alpha, f0, smith: model.smith })
    }

    /// R, the albedo with Schlick's reflectance, of bias and E: F0 (E − bias) + bias.
    pub fn reflectance(&self, bias: f64, e: f64) -> f64 {
        self.f0 * e + (1.0 - self.f0) * bias
    }

    /// Bias and E by quadrature.
    pub fn split(&self, tolerance: f64) -> Split {
        if self.alpha == 0.0 {
            return self.mirror(Estimate::bound);
        }
        // The same for every F0.
        let key = [self.mu, self.alpha, tolerance].map(f64::to_bits);
        SPLITS.with_borrow_mut(|splits| {
            splits.get_or_insert_with([key[0], key[1], key[2], self.smith as u64], || {
                let [e, bias, _] = quadrature::ggx_split(self.mu, self.alpha, self.smith, tolerance);
                [bias, e]
            })
        })
    }

    /// Bias and E by Monte Carlo.
    pub fn split_by_samples(&self, integration: &Integration, stop: Stop) -> Split {
        if self.alpha == 0.0 {
            return self.mirror(|v, _| Estimate::sigma(v, 0.0));
        }
        integration.points2.integrate(stop, |u| self.draw(self.mu, u)).0
    }

    fn mirror(&self, exactly: impl Fn(f64, f64) -> Estimate) -> Split {
        [exactly(schlick_weight(self.mu), 2.0 * f64::EPSILON), exactly(1.0, 0.0)]
    }

    /// One sample of bias and E seen at cosine `mu`; alpha is not 0.
    pub fn draw(&self, mu: f64, [u, t]: [f64; 2]) -> [f64; 2] {
        let (lobe, wo) = (Ggx::isotropic(self.alpha, self.smith), direction_with_cosine(mu));
        let (v, stretch) = defensive_tail(t, TAIL * self.alpha * self.alpha);
        lobe.sample(wo, [u, v]).map_or([0.0; 2], |s| {
            let cosine = (0.5 * (wo + s.wi).length()).min(1.0); // at most 1 but for rounding
            [schlick_weight(cosine), 1.0].map(|fresnel| fresnel * s.weight * stretch)
        })
    }

    /// E_avg by quadrature.
    pub fn albedo_average(&self, tolerance: f64) -> Estimate {
        if self.alpha == 0.0 {
            return Estimate::bound(1.0, f64::EPSILON);
        }
        // The same for every mu and F0.
        let key = [self.alpha.to_bits(), tolerance.to_bits(), self.smith as u64];
        AVERAGES.with_borrow_mut(|averages| {
            averages.get_or_insert_with(key, || quadrature::ggx_albedo_average(self.alpha, self.smith, tolerance))
        })
    }

    /// R_avg, the average of [`Specular::reflectance`], by quadrature.
    pub fn reflectance_average(&self, tolerance: f64) -> Estimate {
        if self.alpha == 0.0 {
            return Estimate::bound(schlick_average(self.f0), f64::EPSILON);
        }
        // R varies near the horizon and near mu = alpha as E does.
        over_cosine(tolerance, self.alpha, |mu, tolerance| {
            let [bias, e] = Self { mu, ..*self }.split(tolerance);
            2.0 * mu * self.reflectance(bias.value, e.value)
        })
    }

    /// E_avg and R_avg by Monte Carlo.
    pub fn averages_by_samples(&self, integration: &Integration, stop: Stop) -> [Estimate; 2] {
        if self.alpha == 0.0 {
            return [1.0, schlick_average(self.f0)].map(|v| Estimate::sigma(v, 0.0));
        }
        // The density 2 mu of the cosine is exactly the weight of the average.
        let draw = |[m, u, t]: [f64; 3]| {
            let [bias, e] = self.draw(m.sqrt(), [u, t]);
            [e, self.reflectance(bias, e)]
        };
        integration.points3.integrate(stop, draw).0
    }
}

/// `f` of estimates: its error is the sum of what each one's error makes of it, which is a bound of bounds (errors are small,
/// `f` smooth), and at least the standard error of standard errors, correlated or not.
pub fn propagate<const N: usize>(inputs: [Estimate; N], f: impl Fn([f64; N]) -> f64) -> Estimate {
    let values = inputs.map(|e| e.value);
    let value = f(values);
    let mut error = 4.0 * f64::EPSILON * value.abs();
    for (i, input) in inputs.iter().enumerate() {
        let moved = |by: f64| {
            let mut values = values;
            values[i] += by;
            (f(values) - value).abs()
        };
        error += moved(input.error).max(moved(-input.error));
    }
    Estimate { value, error, kind: inputs[0].kind }
}

/// The same stop with a tolerance so much smaller, for estimates that are put together.
pub fn finer(stop: Stop, factor: f64) -> Stop {
    match stop {
        Stop::Tolerance(tolerance) => Stop::Tolerance(tolerance / factor),
        samples => samples,
    }
}
