//! Spherical harmonics of as many bands as one asks for.
//!
//! Basis: real, orthonormal, without the Condon–Shortley sign, z the pole: Y_lm = √2 P̄_l^m(z) cos mφ for m > 0, P̄_l^0(z) for m = 0,
//! √2 P̄_l^|m|(z) sin |m|φ for m < 0, φ = atan2(y, x); coefficient l² + l + m. The first nine are those of
//! [`spherical_harmonics`](super::spherical_harmonics). The panorama's pole is y: its coefficients about y are integrated texel by texel (in
//! closed form in φ, by Gauss points in θ), and the polynomial of that degree that they are is then projected onto the basis about z by a rule
//! that is exact for it.
//!
//! Irradiance: A_l/π = 1, 2/3, 1/4, 0, −1/24 … (Ramamoorthi and Hanrahan 2001, eq. 19, over π). More than three bands follow small lights better
//! and still ring: odd bands above the first add nothing, the fourth 1/24.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::panorama::Panorama;
use super::spherical_harmonics::IrradianceFit;
use crate::math::quadrature::gauss_legendre;

/// Most bands: degree 9, 100 coefficients.
pub const MOST_BANDS: usize = 10;

/// Coefficients of more than three bands, as `sh.json` holds them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bands {
    /// How many: degrees 0 to one less.
    pub bands: usize,
    /// Which basis, in words.
    pub basis: String,
    /// Degree l and order m of each coefficient.
    pub order: Vec<[i32; 2]>,
    /// Radiance: L(d) ≈ Σ coefficient × Y_lm(d).
    pub radiance: Vec<[f64; 3]>,
    /// Irradiance divided by π: the same times A_l/π.
    pub irradiance_over_pi: Vec<[f64; 3]>,
    /// How well the latter render the irradiance cube.
    pub fit: IrradianceFit,
}

impl Bands {
    /// The coefficients of a panorama; `judge` compares a function with its irradiance.
    pub fn new(panorama: &Panorama, bands: usize, judge: impl Fn(&dyn Fn(DVec3) -> [f64; 3]) -> IrradianceFit) -> Self {
        let radiance = project(panorama, bands);
        let order: Vec<[i32; 2]> = (0..bands as i32).flat_map(|l| (-l..=l).map(move |m| [l, m])).collect();
        let irradiance_over_pi: Vec<[f64; 3]> =
            radiance.iter().zip(&order).map(|(value, [l, _])| value.map(|v| v * cosine_lobe(*l as usize))).collect();
        let fit = judge(&|direction| evaluate(&irradiance_over_pi, bands, direction));
        let basis = "real, orthonormal, no Condon-Shortley sign, pole +Z, m > 0 cos, m < 0 sin, +Y up".to_owned();
        Self { bands, basis, order, radiance, irradiance_over_pi, fit }
    }
}

/// A_l/π: what the clamped cosine multiplies degree l by.
pub fn cosine_lobe(l: usize) -> f64 {
    match l {
        0 => 1.0,
        1 => 2.0 / 3.0,
        l if l % 2 == 1 => 0.0,
        l => {
            // l!/(2^l (l/2)!²), factor by factor.
            let central = (1..=l / 2).fold(1.0, |product, k| product * (2 * k - 1) as f64 / (2 * k) as f64);
            let sign = if l % 4 == 2 { 1.0 } else { -1.0 };
            sign * 2.0 * central / ((l + 2) * (l - 1)) as f64
        }
    }
}

/// The basis functions of so many bands in a unit direction.
pub fn basis(bands: usize, direction: DVec3) -> Vec<f64> {
    let DVec3 { x, y, z } = direction;
    harmonics(bands, z, x.hypot(y), y.atan2(x))
}

/// The value of an expansion in a unit direction.
pub fn evaluate(coefficients: &[[f64; 3]], bands: usize, direction: DVec3) -> [f64; 3] {
    let basis = basis(bands, direction);
    std::array::from_fn(|c| coefficients.iter().zip(&basis).map(|(value, basis)| value[c] * basis).sum())
}

/// All Y_lm at a height along the pole, its sine and an azimuth.
fn harmonics(bands: usize, x: f64, sin: f64, phi: f64) -> Vec<f64> {
    let mut values = vec![0.0; bands * bands];
    for (l, m, p) in legendre(bands, x, sin) {
        let (sin_m, cos_m) = (m as f64 * phi).sin_cos();
        if m == 0 {
            values[l * l + l] = p;
        } else {
            values[l * l + l + m] = 2f64.sqrt() * p * cos_m;
            values[l * l + l - m] = 2f64.sqrt() * p * sin_m;
        }
    }
    values
}

/// P̄_l^m(x), normalised to ∫ P̄² dω = 1 with its own e^(imφ), for every l below `bands` and 0 ≤ m ≤ l.
fn legendre(bands: usize, x: f64, sin: f64) -> Vec<(usize, usize, f64)> {
    let mut values = vec![];
    let mut sectoral = (1.0 / (4.0 * PI)).sqrt();
    for m in 0..bands {
        if m > 0 {
            sectoral *= sin * ((2 * m + 1) as f64 / (2 * m) as f64).sqrt();
        }
        let (mut before, mut current) = (0.0, sectoral);
        for l in m..bands {
            values.push((l, m, current));
            // P̄_(l+1) = a (x P̄_l − P̄_(l−1)/a_before), a_l = √((4l² − 1)/(l² − m²)).
            let a = |l: usize| (((4 * l * l - 1) as f64) / ((l * l - m * m) as f64)).sqrt();
            let next = a(l + 1) * (x * current - if l > m { before / a(l) } else { 0.0 });
            (before, current) = (current, next);
        }
    }
    values
}

/// The exact coefficients of a panorama.
pub fn project(panorama: &Panorama, bands: usize) -> Vec<[f64; 3]> {
    let (mean, about_y) = (panorama.mean(), about_y(panorama, bands));
    // Products of two functions of degree below `bands`: Gauss in the height, and equally spaced azimuths.
    let rule = gauss_legendre(bands);
    let columns = 2 * bands;
    let mut sums = vec![[0.0; 3]; bands * bands];
    for (t, weight) in rule.iter() {
        let z = 2.0 * t - 1.0;
        let sin = ((1.0 - z) * (1.0 + z)).sqrt();
        for column in 0..columns {
            let phi = TAU * column as f64 / columns as f64;
            let (sin_phi, cos_phi) = phi.sin_cos();
            let (x, y) = (sin * cos_phi, sin * sin_phi);
            let there = harmonics(bands, y, z.hypot(x), z.atan2(x));
            let value: [f64; 3] =
                std::array::from_fn(|c| about_y.iter().zip(&there).map(|(value, basis)| value[c] * basis).sum());
            let weight = 2.0 * weight * TAU / columns as f64;
            for (sum, basis) in sums.iter_mut().zip(harmonics(bands, z, sin, phi)) {
                (0..3).for_each(|c| sum[c] += weight * basis * value[c]);
            }
        }
    }
    // Beyond the mean, which was taken off and is the whole of the first coefficient.
    sums[0] = mean.map(|mean| mean * (4.0 * PI).sqrt());
    sums
}

/// Coefficients of the panorama beyond its mean about the pole y, azimuth atan2(z, x).
fn about_y(panorama: &Panorama, bands: usize) -> Vec<[f64; 3]> {
    /// Of a row at most a quarter turn high: harmonics of degree 10 are held to 1e-16.
    const POINTS: usize = 24;
    let (width, height) = (panorama.width(), panorama.height());
    let edge = |m: usize, column: usize| (m as f64 * panorama.column_edge(column)).sin_cos();
    // ∫ over each column of cos mφ and sin mφ.
    let azimuth: Vec<Vec<[f64; 2]>> = (0..bands)
        .map(|m| {
            let of = |column: usize| {
                if m == 0 {
                    return [TAU / width as f64, 0.0];
                }
                let ((sin_a, cos_a), (sin_b, cos_b)) = (edge(m, column), edge(m, column + 1));
                [(sin_b - sin_a) / m as f64, (cos_a - cos_b) / m as f64]
            };
            (0..width).map(of).collect()
        })
        .collect();
    let (mean, rule) = (panorama.mean(), gauss_legendre(POINTS));
    let mut sums = vec![[0.0; 3]; bands * bands];
    for row in 0..height {
        let mut moments = vec![[[0.0; 3]; 2]; bands];
        for (moments, azimuth) in moments.iter_mut().zip(&azimuth) {
            for (texel, [cos, sin]) in panorama.row(row).iter().zip(azimuth) {
                for c in 0..3 {
                    let value = f64::from(texel[c]) - mean[c];
                    moments[0][c] += cos * value;
                    moments[1][c] += sin * value;
                }
            }
        }
        let step = PI / height as f64;
        for (t, weight) in rule.iter() {
            let (sin, cos) = (step * (row as f64 + t)).sin_cos();
            for (l, m, p) in legendre(bands, cos, sin) {
                let weight = weight * step * sin * p * if m == 0 { 1.0 } else { 2f64.sqrt() };
                for c in 0..3 {
                    sums[l * l + l + m][c] += weight * moments[m][0][c];
                    if m > 0 {
                        sums[l * l + l - m][c] += weight * moments[m][1][c];
                    }
                }
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::super::spherical_harmonics;
    use super::super::test_maps::random;
    use super::*;

    #[test]
    fn the_first_nine_are_the_nine_and_more_bands_change_none_of_fewer() {
        for panorama in [random(32, 3, Some((5, 2))), random(4, 4, None)] {
            let nine = spherical_harmonics::project(&panorama).radiance;
            let (few, many) = (project(&panorama, 3), project(&panorama, MOST_BANDS));
            for i in 0..9 {
                for c in 0..3 {
                    // Roundings of some hundred terms of the size of the first.
                    let tolerance = 1e-13 * nine[0][c].abs();
                    for got in [few[i][c], many[i][c]] {
                        assert!((got - nine[i][c]).abs() < tolerance, "{i}: {got} wanted {}", nine[i][c]);
                    }
                }
            }
        }
    }

    #[test]
    fn the_basis_is_orthonormal_and_the_cosine_lobe_known() {
        let bands = MOST_BANDS;
        let (rule, columns) = (gauss_legendre(bands + 2), 2 * bands + 3);
        let mut gram = vec![vec![0.0; bands * bands]; bands * bands];
        for (t, weight) in rule.iter() {
            let z = 2.0 * t - 1.0;
            for column in 0..columns {
                let phi = TAU * f64::from(column as u32) / columns as f64;
                let r = (1.0 - z * z).sqrt();
                let b = basis(bands, DVec3::new(r * phi.cos(), r * phi.sin(), z));
                for (row, x) in gram.iter_mut().zip(&b) {
                    row.iter_mut().zip(&b).for_each(|(sum, y)| *sum += 2.0 * weight * TAU / columns as f64 * x * y);
                }
            }
        }
        for (i, row) in gram.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                assert!((value - f64::from(u8::from(i == j))).abs() < 1e-13, "{i} {j}: {value}");
            }
        }
        for (l, wanted) in [1.0, 2.0 / 3.0, 0.25, 0.0, -1.0 / 24.0, 0.0, 1.0 / 64.0].into_iter().enumerate() {
            assert!((cosine_lobe(l) - wanted).abs() < 1e-16);
        }
    }
}
