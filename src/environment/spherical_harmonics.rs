//! Radiance and irradiance as nine spherical-harmonic coefficients.
//!
//! Basis: real, orthonormal, without the Condon–Shortley sign, in the order 1, y, z, x, xy, yz, 3z² − 1, xz, x² − y² of
//! the world direction. The coefficients of the piecewise constant panorama are exact: every basis function times the
//! box of a texel integrates in closed form in φ and in θ.
//!
//! Irradiance: Ramamoorthi & Hanrahan (2001), "An efficient representation for irradiance environment maps": each band is
//! multiplied by A_l; divided by π that is 1, 2/3, 1/4. Nine coefficients are an approximation, worse the smaller the
//! lights are, and can go negative opposite a sun: [`IrradianceFit`] says how far, and [`nonnegative`] gives nine that do not.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::cube::Cube;
use super::nonnegative::nonnegative;
use super::orientation::Orientation;
use super::panorama::Panorama;
use super::sphere_map::SphereMap;

/// Nine RGB coefficients.
pub type Coefficients = [[f64; 3]; 9];

/// What a `sh.json` holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SphericalHarmonics {
    /// Which basis, in words.
    pub basis: String,
    /// The polynomial of each coefficient, in order.
    pub order: Vec<String>,
    /// The factor of each polynomial in the basis function.
    pub normalisation: Vec<f64>,
    /// Radiance: L(d) ≈ Σ coefficient × basis function.
    pub radiance: Coefficients,
    /// Irradiance divided by π: the same, band l multiplied by 1, 2/3, 1/4.
    pub irradiance_over_pi: Coefficients,
    /// The nearest to them that are negative in no direction.
    pub irradiance_over_pi_nonnegative: Coefficients,
}

/// How well nine coefficients render the exact irradiance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct IrradianceFit {
    /// Smallest value of the fit in any channel; below zero, something will be lit with negative light.
    pub min: f64,
    /// Root mean square of (fit − exact) over the sphere, divided by the root mean square of the exact values.
    pub rms_error: f64,
    /// Largest |fit − exact| divided by the exact value, or by 1e-3 of its largest where that is more.
    pub max_relative_error: f64,
}

/// The polynomials, as `sh.json` names them.
pub const ORDER: [&str; 9] = ["1", "y", "z", "x", "xy", "yz", "3z^2-1", "xz", "x^2-y^2"];

/// A_l/π of the clamped cosine for each coefficient.
pub const COSINE_LOBE: [f64; 9] = [1.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 0.25, 0.25, 0.25, 0.25, 0.25];

/// √(1/4π), √(3/4π), √(15/4π), √(5/16π), √(15/16π).
const FACTORS: [f64; 5] =
    [0.28209479177387814, 0.4886025119029199, 1.0925484305920792, 0.31539156525252005, 0.5462742152960396];

/// √(1/4π), √(3/4π), √(15/4π), √(5/16π), √(15/16π), one for each polynomial of [`ORDER`].
pub fn normalisation() -> [f64; 9] {
    let [band0, band1, mixed, zonal, squares] = FACTORS;
    [band0, band1, band1, band1, mixed, mixed, zonal, mixed, squares]
}

/// The nine basis functions in a unit direction.
pub fn basis(direction: DVec3) -> [f64; 9] {
    let DVec3 { x, y, z } = direction;
    let polynomials = [1.0, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y];
    let norm = normalisation();
    std::array::from_fn(|i| norm[i] * polynomials[i])
}

/// The value of an expansion in a unit direction.
pub fn evaluate(coefficients: &Coefficients, direction: DVec3) -> [f64; 3] {
    let basis = basis(direction);
    std::array::from_fn(|c| (0..9).map(|i| coefficients[i][c] * basis[i]).sum())
}

/// The factors of the polynomials of [`ORDER`]: each coefficient times its normalisation, so that a shader needs no constants.
pub fn polynomial(coefficients: &Coefficients) -> Coefficients {
    let norm = normalisation();
    std::array::from_fn(|i| coefficients[i].map(|v| norm[i] * v))
}

/// The exact coefficients of a panorama.
pub fn project(panorama: &Panorama) -> SphericalHarmonics {
    let radiance = project_radiance(panorama);
    let irradiance_over_pi = std::array::from_fn(|i| radiance[i].map(|v| v * COSINE_LOBE[i]));
    SphericalHarmonics {
        basis: "real, orthonormal, no Condon-Shortley sign, +Y up".to_owned(),
        order: ORDER.map(str::to_owned).to_vec(),
        normalisation: normalisation().to_vec(),
        radiance,
        irradiance_over_pi,
        irradiance_over_pi_nonnegative: nonnegative(&irradiance_over_pi),
    }
}

fn project_radiance(panorama: &Panorama) -> Coefficients {
    let (width, height) = (panorama.width(), panorama.height());
    // ∫ over a column of 1, sin φ, cos φ, sin 2φ, cos 2φ: all that the basis asks of the azimuth.
    let azimuth: Vec<[f64; 5]> = (0..width)
        .map(|column| {
            let (a, b) = (panorama.column_edge(column), panorama.column_edge(column + 1));
            let half = (b - a) / 2.0;
            let (middle, double) = ((a + b) / 2.0, a + b);
            let (first, second) = (2.0 * half.sin(), (2.0 * half).sin());
            [
                TAU / width as f64,
                middle.sin() * first,
                middle.cos() * first,
                double.sin() * second,
                double.cos() * second,
            ]
        })
        .collect();
    let mean = panorama.mean();
    let mut sums = [[0.0; 3]; 9];
    for row in 0..height {
        let mut moments = [[0.0; 3]; 5];
        for (texel, azimuth) in panorama.row(row).iter().zip(&azimuth) {
            for (moment, weight) in moments.iter_mut().zip(azimuth) {
                for c in 0..3 {
                    moment[c] += weight * (f64::from(texel[c]) - mean[c]);
                }
            }
        }
        let [one, sin, cos, sin2, cos2] = moments;
        let edges = [PI * row as f64 / height as f64, PI * (row + 1) as f64 / height as f64];
        let y = [panorama.row_edges()[row + 1], panorama.row_edges()[row]];
        // ∫ over the row of y^i ρ^j dy, with ρ = √(1 − y²) = sin θ.
        let dy = y[1] - y[0];
        let (y1, y2) = ((y[1] * y[1] - y[0] * y[0]) / 2.0, (y[1].powi(3) - y[0].powi(3)) / 3.0);
        let rho = (edges[1] - edges[0]) / 2.0 - ((2.0 * edges[1]).sin() - (2.0 * edges[0]).sin()) / 4.0;
        let rho_y = (edges[1].sin().powi(3) - edges[0].sin().powi(3)) / 3.0;
        let rho2 = dy - y2;
        for c in 0..3 {
            // x = ρ cos φ, z = ρ sin φ; cos² φ = (1 + cos 2φ)/2.
            let (xx, zz) = (rho2 * (one[c] + cos2[c]) / 2.0, rho2 * (one[c] - cos2[c]) / 2.0);
            let polynomials = [
                one[c] * dy,
                one[c] * y1,
                sin[c] * rho,
                cos[c] * rho,
                cos[c] * rho_y,
                sin[c] * rho_y,
                3.0 * zz - one[c] * dy,
                sin2[c] * rho2 / 2.0,
                xx - one[c] * y2,
            ];
            for (sum, value) in sums.iter_mut().zip(polynomials) {
                sum[c] += value;
            }
        }
    }
    let norm = normalisation();
    std::array::from_fn(|i| {
        // The mean that was taken off is the whole of the first coefficient.
        let constant = if i == 0 { 4.0 * PI } else { 0.0 };
        std::array::from_fn(|c| norm[i] * (sums[i][c] + constant * mean[c]))
    })
}

/// Compares coefficients of E/π with an exact irradiance cube, at its texel centres.
pub fn judge(coefficients: &Coefficients, exact: &Cube) -> IrradianceFit {
    judge_map(&|direction| evaluate(coefficients, direction), &exact.clone().into(), &Orientation::default())
}

/// Compares any function of the world's direction with exact irradiance, at the texel centres of a map of any layout, turned.
pub fn judge_map(function: &dyn Fn(DVec3) -> [f64; 3], exact: &SphereMap, orientation: &Orientation) -> IrradianceFit {
    let weights = exact.layout.solid_angles(exact.size);
    let (mut min, mut max) = (f64::INFINITY, 0.0f64);
    let (mut errors, mut squares) = (0.0, 0.0);
    let floor = 1e-3 * exact.texels.iter().flatten().fold(0.0, |m, v| f64::max(m, f64::from(v.abs())));
    for (index, texel) in exact.texels.iter().enumerate() {
        let fit = function(orientation.world(exact.direction(index)));
        let weight = weights[index];
        for c in 0..3 {
            let wanted = f64::from(texel[c]);
            let error = fit[c] - wanted;
            min = min.min(fit[c]);
            errors += weight * error * error;
            squares += weight * wanted * wanted;
            if error != 0.0 {
                max = max.max(error.abs() / wanted.abs().max(floor));
            }
        }
    }
    let rms_error = if errors == 0.0 { 0.0 } else { (errors / squares).sqrt() };
    IrradianceFit { min, rms_error, max_relative_error: max }
}

#[cfg(test)]
mod tests {
    use super::super::cube::texel_direction;
    use super::super::test_maps::random;
    use super::*;

    #[test]
    fn coefficients_agree_with_a_sum_over_small_pieces() {
        let panorama = random(16, 1, Some((5, 0)));
        let got = project(&panorama).radiance;
        let n = 64;
        let mut wanted = [[0.0; 3]; 9];
        let mut scale = [0.0; 3];
        for index in 0..16 * 8 {
            let (texel, b) = (panorama.texels()[index], panorama.texel_box(index % 16, index / 16));
            let area = (b.phi[1] - b.phi[0]) * (b.y[1] - b.y[0]) / f64::from(n * n);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let at = |[low, high]: [f64; 2], k: i32| low + (high - low) * (f64::from(k) + 0.5) / f64::from(n);
                let (phi, y) = (at(b.phi, i), at(b.y, j));
                let rho = (1.0 - y * y).sqrt();
                let basis = basis(DVec3::new(rho * phi.cos(), y, rho * phi.sin()));
                for c in 0..3 {
                    scale[c] += f64::from(texel[c]) * area;
                    (0..9).for_each(|k| wanted[k][c] += f64::from(texel[c]) * area * basis[k]);
                }
            }
        }
        for (k, c) in (0..9).flat_map(|k| (0..3).map(move |c| (k, c))) {
            // The midpoint rule in y meets √(1 − y) at the poles: its error is below (Δy)^1.5, Δy = 0.076/64.
            let tolerance = (0.0762f64 / f64::from(n)).powf(1.5) * scale[c];
            let error = (got[k][c] - wanted[k][c]).abs();
            assert!(error < tolerance, "{}: {} wanted {} ± {tolerance}", ORDER[k], got[k][c], wanted[k][c]);
        }
    }

    #[test]
    fn factors_are_square_roots() {
        let [band0, band1] = [1.0, 3.0].map(|n: f64| (n / (4.0 * PI)).sqrt());
        let [mixed, zonal, squares] = [15.0 / 4.0, 5.0 / 16.0, 15.0 / 16.0].map(|n: f64| (n / PI).sqrt());
        assert_eq!(FACTORS, [band0, band1, mixed, zonal, squares]);
    }

    #[test]
    fn white_has_one_coefficient() {
        let white = Panorama::new(32, 16, vec![[1.0; 3]; 512]).unwrap();
        let sh = project(&white);
        assert!((sh.radiance[0][0] - (4.0 * PI).sqrt()).abs() < 1e-15);
        assert!(sh.radiance[1..].iter().flatten().all(|&v| v == 0.0));
        assert!((evaluate(&sh.irradiance_over_pi, DVec3::X)[2] - 1.0).abs() < 1e-15);
    }

    #[test]
    fn the_basis_is_orthonormal() {
        // Products of two basis functions have degree four: exact under the octahedral-symmetric cube rule of 512² up to
        // its midpoint error, (2/512)².
        let size = 512;
        let weights = super::super::cube::solid_angles(size);
        let mut gram = [[0.0; 9]; 9];
        for index in 0..6 * size * size {
            let b = basis(texel_direction(size, index));
            for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
                gram[i][j] += weights[index % weights.len()] * b[i] * b[j];
            }
        }
        for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
            let wanted = f64::from(u8::from(i == j));
            assert!((gram[i][j] - wanted).abs() < (2.0 / size as f64).powi(2), "{i} {j}: {}", gram[i][j]);
        }
    }
}
