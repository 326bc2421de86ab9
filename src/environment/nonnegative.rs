//! The nearest irradiance in nine coefficients that is negative nowhere.
//!
//! Nine coefficients of a small sun ring: opposite to it they go below zero, and engines that clamp there change colours. Here the
//! projection c₀ is moved as little as possible, in the root mean square over the sphere (the basis is orthonormal), until
//! Y(d)·c ≥ 0 for every direction d: a convex problem with a constraint per direction, of which few matter. They are found one
//! after the other, at the lowest point so far (an exchange method), and held exactly by their multipliers,
//! c = c₀ + Σ λ_k Y(d_k), λ > 0 and Y(d_k)·c = 0 for at most nine: a dual active-set method, whose steps go towards the new constraint
//! along what the others leave free, and let go of those that begin to pull.

use super::spherical_harmonics::{Coefficients, basis, normalisation};
use glam::DVec3;

/// Lowest points looked for at most; a few tens are usual.
const MOST_CONSTRAINTS: usize = 200;
/// Below this part of the mean a dip is lifted out with the constant instead.
const LOWEST: f64 = 1e-9;
/// A constraint of which the others leave less than this part free is a sum of them.
const DEPENDENT: f64 = 1e-7;

/// Nine coefficients per channel that give no negative value in any direction, nearest to the given ones.
///
/// A channel whose mean is not positive becomes black: nothing else is near a negative constant and nowhere negative.
pub fn nonnegative(coefficients: &Coefficients) -> Coefficients {
    let mut fitted = [[0.0; 3]; 9];
    for channel in 0..3 {
        let fit = nonnegative_channel(std::array::from_fn(|i| coefficients[i][channel]));
        for (all, one) in fitted.iter_mut().zip(fit) {
            all[channel] = one;
        }
    }
    fitted
}

fn dot(a: &[f64; 9], b: &[f64; 9]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn nonnegative_channel(start: [f64; 9]) -> [f64; 9] {
    if start[0] <= 0.0 {
        return [0.0; 9];
    }
    let mut active = vec![];
    let mut c = start;
    // The constant's basis function times its coefficient: the mean.
    let mean = start[0] * basis(DVec3::Y)[0];
    for _ in 0..MOST_CONSTRAINTS {
        let (direction, value) = lowest(&c);
        if value >= -LOWEST * mean {
            break;
        }
        hold(basis(direction), &mut active, &mut c);
    }
    // What is left of a dip is rounding, or at most the last constraint's.
    let (_, value) = lowest(&c);
    c[0] += (-value).max(0.0) / basis(DVec3::Y)[0] * (1.0 + 1e-12);
    c
}

/// A constraint that holds with equality, and its multiplier.
struct Active {
    y: [f64; 9],
    lambda: f64,
}

/// Moves `c` to where y·c = 0 and the active constraints still hold, as little as that takes (Goldfarb and Idnani's step).
fn hold(y: [f64; 9], active: &mut Vec<Active>, c: &mut [f64; 9]) {
    let mut lambda = 0.0;
    loop {
        let (free, shares) = split(&y, active);
        let length2 = dot(&free, &free);
        let whole = match length2 > DEPENDENT * DEPENDENT * dot(&y, &y) {
            true => -dot(&y, c) / length2,
            false => f64::INFINITY,
        };
        let limits =
            active.iter().zip(&shares).map(|(a, share)| if *share > 0.0 { a.lambda / share } else { f64::INFINITY });
        let (first, partly) = limits.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::INFINITY));
        let step = whole.min(partly);
        if step == f64::INFINITY {
            return; // rounding: the constant function is never a sum of others
        }
        if whole < f64::INFINITY {
            (0..9).for_each(|i| c[i] += step * free[i]);
        }
        active.iter_mut().zip(&shares).for_each(|(a, share)| a.lambda -= step * share);
        lambda += step;
        if whole <= partly {
            active.push(Active { y, lambda });
            return;
        }
        active.remove(first);
    }
}

/// What of y is orthogonal to all active constraints, and what each of them has of the rest: y = free + Σ shares y_k.
fn split(y: &[f64; 9], active: &[Active]) -> ([f64; 9], Vec<f64>) {
    // Gram and Schmidt, twice over for rounding: y_k = Σ_(j≤k) r_jk q_j.
    let (mut axes, mut triangle): (Vec<[f64; 9]>, Vec<Vec<f64>>) = (vec![], vec![]);
    let against = |axes: &[[f64; 9]], v: &[f64; 9]| {
        let (mut rest, mut parts) = (*v, vec![0.0; axes.len()]);
        for _ in 0..2 {
            for (q, part) in axes.iter().zip(&mut parts) {
                let along = dot(q, &rest);
                *part += along;
                (0..9).for_each(|i| rest[i] -= along * q[i]);
            }
        }
        (rest, parts)
    };
    for a in active {
        let (rest, mut parts) = against(&axes, &a.y);
        let length = dot(&rest, &rest).sqrt();
        parts.push(length);
        triangle.push(parts);
        axes.push(rest.map(|v| v / length));
    }
    let (free, mut shares) = against(&axes, y);
    for k in (0..shares.len()).rev() {
        shares[k] /= triangle[k][k];
        for j in 0..k {
            shares[j] -= shares[k] * triangle[k][j];
        }
    }
    (free, shares)
}

/// The direction of the smallest value, and that value.
///
/// Nine coefficients are k + b·d + d·A d: a quadratic form on the unit sphere. Where it is smallest, (2A + μ) d = −b with 2A + μ
/// positive semidefinite (the trust-region problem: Moré and Sorensen 1983), μ being where Σ (b_i/(λ_i + μ))² = 1 in the frame of A's axes.
fn lowest(c: &[f64; 9]) -> (DVec3, f64) {
    let norm = normalisation();
    let v: [f64; 9] = std::array::from_fn(|i| c[i] * norm[i]);
    let linear = [v[3], v[1], v[2]];
    // Twice A.
    let form = [[2.0 * v[8], v[4], v[7]], [v[4], -2.0 * v[8], v[5]], [v[7], v[5], 6.0 * v[6]]];
    let (lambda, axes) = eigen(form);
    let b: [f64; 3] = std::array::from_fn(|i| (0..3).map(|k| axes[i][k] * linear[k]).sum());
    // s = μ + λ_0 lies between |b_0| and |b|; the sum falls as s grows.
    let at = |s: f64, i: usize| if b[i] == 0.0 { 0.0 } else { -b[i] / (lambda[i] - lambda[0] + s) };
    let (mut low, mut high) = (b[0].abs(), b.iter().map(|b| b * b).sum::<f64>().sqrt());
    for _ in 0..100 {
        let s = 0.5 * (low + high);
        if (0..3).map(|i| at(s, i).powi(2)).sum::<f64>() > 1.0 { low = s } else { high = s }
    }
    let (y, z) = (at(high, 1), at(high, 2));
    // Along the lowest axis goes what is left: all of it where b has no part in that direction.
    let x = (1.0 - y * y - z * z).max(0.0).sqrt().copysign(-b[0]);
    let place = [x, y, z];
    let world = |k: usize| (0..3).map(|i| axes[i][k] * place[i]).sum::<f64>();
    let direction = DVec3::new(world(0), world(1), world(2)).normalize();
    (direction, dot(&basis(direction), c))
}

/// Eigenvalues of a symmetric matrix, the smallest first, and its axes, by Jacobi's rotations.
fn eigen(mut a: [[f64; 3]; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // Convergence is quadratic: five sweeps reach rounding.
    for (p, q) in [(0, 1), (0, 2), (1, 2)].into_iter().cycle().take(3 * 12) {
        if a[p][q] == 0.0 {
            continue;
        }
        let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
        let t = 1.0_f64.copysign(theta) / (theta.abs() + theta.hypot(1.0));
        let cos = 1.0 / t.hypot(1.0);
        let sin = t * cos;
        let turn = |x: f64, y: f64| (cos * x - sin * y, sin * x + cos * y);
        for row in &mut a {
            (row[p], row[q]) = turn(row[p], row[q]);
        }
        for k in 0..3 {
            (a[p][k], a[q][k]) = turn(a[p][k], a[q][k]);
            (axes[p][k], axes[q][k]) = turn(axes[p][k], axes[q][k]);
        }
        (a[p][q], a[q][p]) = (0.0, 0.0);
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| a[i][i].total_cmp(&a[j][j]));
    (order.map(|i| a[i][i]), order.map(|i| axes[i]))
}

#[cfg(test)]
mod tests {
    use super::super::builtin::builtin;
    use super::super::spherical_harmonics::{evaluate, project};
    use super::super::test_maps::random;
    use super::*;
    use crate::math::sobol::PointSet;
    use std::sync::LazyLock;

    /// Directions on a spiral, 3° apart.
    static STARTS: LazyLock<Vec<(DVec3, [f64; 9])>> = LazyLock::new(|| {
        const N: usize = 4096;
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        (0..N)
            .map(|i| {
                let y = 1.0 - (2.0 * i as f64 + 1.0) / N as f64;
                let r = ((1.0 - y) * (1.0 + y)).sqrt();
                let (sin, cos) = (golden * i as f64).sin_cos();
                let d = DVec3::new(r * cos, y, r * sin);
                (d, basis(d))
            })
            .collect()
    });

    #[test]
    fn the_lowest_direction_is_lower_than_all_others() {
        let mut cases: Vec<[f64; 9]> = (0..200)
            .map(|i| {
                let points = PointSet::<9>::new(5, i, 1);
                points.points()[0].map(|v| 2.0 * v - 1.0)
            })
            .collect();
        // Without a linear part, with one across the lowest axis only, axes of equal length, nothing but the constant.
        cases.push([1.0, 0.0, 0.0, 0.0, 0.3, -0.2, 0.5, 0.7, -0.1]);
        cases.push([1.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
        cases.push([1.0, 0.2, 0.1, -0.3, 0.0, 0.0, 0.0, 0.0, 0.0]);
        cases.push([1.0, 0.0, 0.3, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0]);
        cases.push([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        for c in cases {
            let (direction, value) = lowest(&c);
            assert!((direction.length() - 1.0).abs() < 1e-14);
            let on_spiral = STARTS.iter().map(|(_, y)| dot(y, &c)).fold(f64::INFINITY, f64::min);
            // The spiral misses the minimum by at most 3°, and there the value by half the largest curvature, 12 |c|, times 0.05².
            let size = dot(&c, &c).sqrt();
            assert!(value <= on_spiral + 1e-12 * size, "{c:?}: {value} at {direction}, {on_spiral} on the spiral");
            assert!(value >= on_spiral - 6.0 * size * 0.0025, "{c:?}: {value}, {on_spiral} on the spiral");
        }
    }

    fn smallest(c: &Coefficients) -> f64 {
        STARTS.iter().flat_map(|(d, _)| evaluate(c, *d)).fold(f64::INFINITY, f64::min)
    }

    fn distance(a: &Coefficients, b: &Coefficients) -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    }

    #[test]
    fn a_sun_is_negative_nowhere_after_the_fit() {
        let exact = project(&builtin("sun", 256).unwrap()).irradiance_over_pi;
        assert!(smallest(&exact) < 0.0, "a sun rings");
        let fit = nonnegative(&exact);
        assert!(smallest(&fit) >= 0.0, "{}", smallest(&fit));
    }

    #[test]
    fn what_is_negative_nowhere_stays_as_it_is() {
        for name in ["white", "gradient"] {
            let exact = project(&builtin(name, 64).unwrap()).irradiance_over_pi;
            assert_eq!(nonnegative(&exact), exact, "{name}");
        }
    }

    #[test]
    fn no_mixture_with_something_bright_is_nearer() {
        // Along the way from the projection to any function that is negative nowhere, the first that is so cannot be nearer.
        let exact = project(&random(32, 3, Some((9, 4)))).irradiance_over_pi;
        let fit = nonnegative(&exact);
        let bright = project(&builtin("white", 32).unwrap()).irradiance_over_pi;
        for scale in [0.1, 1.0, 10.0, 1e3, 1e5] {
            for t in (1..100).map(|i| f64::from(i) / 100.0) {
                let mixed: Coefficients = std::array::from_fn(|i| {
                    std::array::from_fn(|c| (1.0 - t) * exact[i][c] + t * scale * bright[i][c])
                });
                if smallest(&mixed) >= 0.0 {
                    assert!(distance(&mixed, &exact) >= distance(&fit, &exact) * (1.0 - 1e-6), "scale {scale}, {t}");
                }
            }
        }
    }

    #[test]
    fn the_fit_meets_the_optimality_conditions_of_a_point_light() {
        // By symmetry about the light the problem is one of three zonal coefficients and a known closed form is not at hand: what
        // must hold is that the correction is a sum of basis functions, with positive weights, at places where the fit is 0.
        let d = DVec3::new(0.3, 0.8, -0.5).normalize();
        let y = basis(d);
        let band = [0, 1, 1, 1, 2, 2, 2, 2, 2].map(|l: usize| [1.0, 2.0 / 3.0, 0.25][l]);
        let exact: Coefficients = std::array::from_fn(|i| [band[i] * y[i]; 3]);
        let fit = nonnegative(&exact);
        let correction: [f64; 9] = std::array::from_fn(|i| fit[i][0] - exact[i][0]);
        let c: [f64; 9] = std::array::from_fn(|i| fit[i][0]);
        // ⟨correction, c⟩ = Σ λ_k Y(d_k)·c = 0, and ⟨correction, g⟩ ≥ 0 for any g that is negative nowhere.
        assert!(dot(&correction, &c).abs() < 1e-7 * dot(&c, &c), "{}", dot(&correction, &c));
        for (probe, _) in STARTS.iter().step_by(17) {
            // (1 + Y-lobe) squared of order 1 is non-negative and of order 2: take (1 + p·d)² through its values.
            let g = |at: DVec3| (1.0 + probe.dot(at)).powi(2);
            let weights: f64 =
                STARTS.iter().map(|(at, y)| g(*at) * dot(y, &correction)).sum::<f64>() / STARTS.len() as f64;
            assert!(weights > -1e-3 * dot(&correction, &correction).sqrt(), "{weights}");
        }
    }

    #[test]
    fn a_channel_without_light_is_black() {
        let mut exact = project(&builtin("sun", 64).unwrap()).irradiance_over_pi;
        exact.iter_mut().for_each(|c| c[1] = 0.0);
        let fit = nonnegative(&exact);
        assert!(fit.iter().all(|c| c[1] == 0.0) && fit[0][0] > 0.0);
    }
}
