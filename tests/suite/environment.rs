//! Facts about environment maps, each number reached in two independent ways.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use kiln::environment::chain::DARK_FLOOR;
use kiln::environment::cube::texel_direction;
use kiln::environment::spherical_harmonics::{judge, project};
use kiln::environment::{
    BUILTINS, ChainSpec, FullSum, Kernel, MonteCarlo, Panorama, builtin, irradiance_cube, specular_chain,
};
use kiln::integrate::Integrator;
use kiln::math::sobol::PointSet;

/// Texels in [0, 1) with a few lamps, an exact black and one sun of 1e5.
fn random_map(width: usize, seed: u64, sun: (usize, usize)) -> Panorama {
    let height = width / 2;
    let texel = |i: usize| {
        let scale = [1.0, 1.0, 0.0, 10.0, 1.0][i % 5];
        PointSet::<3>::new(seed, i as u64, 1).points()[0].map(|v| (v * scale) as f32)
    };
    let mut texels: Vec<[f32; 3]> = (0..width * height).map(texel).collect();
    texels[sun.1 * width + sun.0] = [1e5, 0.8e5, 0.4e5];
    Panorama::new(width, height, texels).expect("a 2:1 panorama")
}

fn uniform_directions(seed: u64, n: usize) -> Vec<DVec3> {
    let direction = |&[s, t]: &[f64; 2]| {
        let (y, phi) = (2.0 * s - 1.0, TAU * t);
        let horizontal = (1.0 - y * y).sqrt();
        DVec3::new(horizontal * phi.cos(), y, horizontal * phi.sin())
    };
    PointSet::<2>::new(seed, 0, n).points().iter().map(direction).collect()
}

fn silent(_: u64) {}

fn spec(size: usize, min_size: usize, samples: usize, integrator: Integrator) -> ChainSpec {
    ChainSpec { samples, integrator, ..ChainSpec::new(size, min_size) }
}

#[test]
fn a_white_furnace_is_exactly_one_everywhere() {
    let white = builtin("white", 64).unwrap();
    for integrator in [Integrator::MonteCarlo, Integrator::Quadrature, Integrator::Zonal] {
        let spec = spec(16, 1, 256, integrator);
        let mut cubes = specular_chain(&white, &spec, &silent).unwrap().levels;
        cubes.push(irradiance_cube(&white, &spec, &silent).unwrap().0);
        assert!(cubes.iter().flat_map(|cube| &cube.texels).flatten().all(|&v| v == 1.0), "{integrator:?}");
    }
}

/// 600 values against the full sum. The mean of 32 replicates is nearly t-distributed with 31 degrees of freedom: beyond
/// 6.5 standard errors with probability 3e-7, so 2e-4 for all of them together.
#[test]
fn monte_carlo_agrees_with_the_full_sum() {
    let panorama = random_map(96, 1, (30, 11));
    let (witness, truth) = (MonteCarlo::new(&panorama, 7), FullSum::new(&panorama));
    let b = panorama.texel_box(30, 11);
    let (y, phi) = ((b.y[0] + b.y[1]) / 2.0, (b.phi[0] + b.phi[1]) / 2.0);
    let sun = DVec3::new((1.0 - y * y).sqrt() * phi.cos(), y, (1.0 - y * y).sqrt() * phi.sin());
    // At the sun, beside it, and on the ring at 90° where errors like to hide.
    let mut directions = uniform_directions(3, 32);
    directions.extend([
        sun,
        (sun + DVec3::new(0.02, 0.0, 0.01)).normalize(),
        (sun.any_orthonormal_vector() + 0.05 * sun).normalize(),
    ]);
    directions.extend([DVec3::X, DVec3::Y, DVec3::NEG_Y, DVec3::ONE.normalize(), DVec3::NEG_ONE.normalize()]);
    for alpha in [1.0, 0.5, 0.1, 0.02, 0.004] {
        let kernel = Kernel::new(alpha);
        let (estimates, _) = witness.estimate(&directions, &kernel, 4096, &silent);
        for (direction, estimate) in directions.iter().zip(estimates) {
            let (value, error) = (estimate.value, estimate.standard_error);
            let wanted = truth.evaluate(*direction, &kernel);
            for c in 0..3 {
                // Below 1e-5 of the value or of the mean, a part of the sun may hide from all replicates at once.
                let tolerance = 6.5 * error[c] + 1e-5 * wanted[c].max(panorama.mean()[c]);
                assert!(
                    (value[c] - wanted[c]).abs() < tolerance,
                    "alpha {alpha}, {direction}, channel {c}: {} wanted {} ± {tolerance}",
                    value[c],
                    wanted[c]
                );
            }
        }
    }
}

/// Squared errors in units of the standard error, over 256 seeds: their mean is 31/29 with a standard deviation of
/// about √(2.5/256) = 0.1; five of those, false alarm 6e-7 for each of nine.
#[test]
fn standard_errors_are_honest() {
    let panorama = random_map(64, 2, (50, 20));
    let truth = FullSum::new(&panorama);
    for alpha in [0.05, 0.3, 1.0] {
        let kernel = Kernel::new(alpha);
        let direction = uniform_directions(9, 1)[0];
        let wanted = truth.evaluate(direction, &kernel);
        let mut squares = [0.0; 3];
        for seed in 0..256 {
            let (estimates, _) = MonteCarlo::new(&panorama, seed).estimate(&[direction], &kernel, 1024, &silent);
            let (value, error) = (estimates[0].value, estimates[0].standard_error);
            (0..3).for_each(|c| squares[c] += ((value[c] - wanted[c]) / error[c]).powi(2) / 256.0);
        }
        for (c, square) in squares.into_iter().enumerate() {
            assert!(
                (square - 31.0 / 29.0).abs() < 0.5,
                "alpha {alpha}, channel {c}: mean z² {square}, wanted 1.07 ± 0.5"
            );
        }
    }
}

#[test]
fn no_level_leaves_the_range_of_its_input() {
    let panorama = random_map(64, 4, (3, 0));
    let (low, high) = (panorama.min()[0], panorama.texels().iter().map(|t| t[0]).fold(0.0, f32::max));
    let chain = specular_chain(&panorama, &spec(32, 2, 128, Integrator::MonteCarlo), &silent).unwrap();
    for (level, cube) in chain.levels.iter().enumerate() {
        for value in cube.texels.iter().map(|t| t[0]) {
            assert!(value >= low && value <= high, "level {level}: {value} is outside {low} .. {high}");
        }
    }
}

/// A sampler that misses the sun, or meets it by chance, is off by far more than this everywhere around it.
#[test]
fn a_sun_makes_no_fireflies() {
    let sun = builtin("sun", 512).unwrap();
    let chain = specular_chain(&sun, &spec(32, 4, 1024, Integrator::MonteCarlo), &silent).unwrap();
    let truth = FullSum::new(&sun);
    for (cube, report) in chain.levels.iter().zip(&chain.reports).skip(1) {
        let kernel = Kernel::new(report.alpha);
        for (index, texel) in cube.texels.iter().enumerate() {
            let wanted = truth.evaluate(texel_direction(cube.size, index), &kernel)[0];
            let error = (f64::from(texel[0]) / wanted - 1.0).abs();
            assert!(error < 0.02, "alpha {}, texel {index}: {} wanted {wanted}", report.alpha, texel[0]);
        }
        assert!(report.rms_error < 2e-3, "alpha {}: standard errors of {}", report.alpha, report.rms_error);
    }
}

/// A zonal filter multiplies d.y by 2π ∫ K(c) c dc and leaves constants alone.
#[test]
fn the_gradient_is_filtered_as_its_closed_form_says() {
    let width = 256;
    let gradient = builtin("gradient", width).unwrap();
    let truth = FullSum::new(&gradient);
    for alpha in [0.1, 0.4, 1.0] {
        let kernel = Kernel::new(alpha);
        let n = 100_000;
        let factor: f64 = (0..n)
            .map(|i| (f64::from(i) + 0.5) / f64::from(n))
            .map(|t| (t * t, 2.0 * t / f64::from(n)))
            .map(|(w, dw)| TAU * kernel.eval(w) * (1.0 - w) * dw)
            .sum();
        for direction in uniform_directions(5, 32) {
            let got = truth.evaluate(direction, &kernel);
            for (c, slope) in [2.0 / 3.0, 1.0 / 3.0, 0.0].into_iter().enumerate() {
                let wanted = 1.0 + slope * factor * direction.y;
                // The steps of the piecewise constant map are off by at most half a row: second order after filtering
                // with a kernel several rows wide.
                let row = PI / (width / 2) as f64;
                let tolerance = slope * row * row + 1e-6;
                assert!((got[c] - wanted).abs() < tolerance, "alpha {alpha}, {direction}: {} wanted {wanted}", got[c]);
            }
        }
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let panorama = random_map(32, 6, (8, 3));
    for integrator in [Integrator::MonteCarlo, Integrator::Quadrature, Integrator::Zonal] {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| specular_chain(&panorama, &spec(16, 2, 256, integrator), &silent).unwrap())
        };
        assert!(with(1) == with(3), "{integrator:?}");
    }
}

#[test]
fn progress_counts_every_texel_once() {
    let sky = builtin("sky", 32).unwrap();
    for integrator in [Integrator::MonteCarlo, Integrator::Quadrature, Integrator::Zonal] {
        let (spec, count) = (spec(16, 2, 64, integrator), AtomicU64::new(0));
        specular_chain(&sky, &spec, &|n| _ = count.fetch_add(n, Ordering::Relaxed)).unwrap();
        assert_eq!(count.into_inner(), spec.total_texels());
    }
}

#[test]
fn both_integrators_report_their_errors_truthfully() {
    let sky = builtin("sky", 64).unwrap();
    let sampled = specular_chain(&sky, &spec(16, 4, 4096, Integrator::MonteCarlo), &silent).unwrap();
    let exact = specular_chain(&sky, &spec(16, 4, 0, Integrator::Quadrature), &silent).unwrap();
    for ((got, wanted), report) in sampled.levels.iter().zip(&exact.levels).zip(&sampled.reports).skip(1) {
        let relative = |g: f32, w: f32, c: usize| f64::from(g - w) / f64::from(w).max(DARK_FLOOR * sky.mean()[c]);
        let texels = got.texels.iter().zip(&wanted.texels);
        let squares: f64 = texels.flat_map(|(g, w)| (0..3).map(move |c| relative(g[c], w[c], c).powi(2))).sum();
        let rms = (squares / (3 * got.texels.len()) as f64).sqrt();
        // Shared points make neighbours err alike, so the ratio scatters like a handful of values would: a factor 2.
        assert!(rms < 2.0 * report.rms_error, "alpha {}: error {rms}, reported {}", report.alpha, report.rms_error);
        assert!(report.mean_deviation < 5.0 * report.rms_error, "{report:?}");
    }
    // Texel centres under-resolve the horizon and the sun's kink: see `LevelReport::mean_deviation`.
    assert!(exact.reports.iter().all(|report| report.mean_deviation < 5e-3), "{:?}", exact.reports);
}

#[test]
fn irradiance_facing_a_sun_is_its_flux() {
    let width = 1024;
    let sun = builtin("sun", width).unwrap();
    let direction = kiln::environment::builtin::sun_direction();
    let got = FullSum::new(&sun).evaluate(direction, &Kernel::new(1.0))[1];
    let wanted = 0.1 + 10.0 / PI;
    // The cosine over the disc and over the texels that hold it: at most two texels from the centre.
    let tolerance = wanted * 0.5 * (2.0 * TAU / width as f64 * 1.5f64).powi(2);
    assert!((got - wanted).abs() < tolerance, "{got}, wanted {wanted} ± {tolerance}");
}

#[test]
fn spherical_harmonics_hold_a_gradient_and_fail_on_a_sun() {
    let exact = |map: &Panorama| irradiance_cube(map, &spec(8, 8, 0, Integrator::Quadrature), &silent).unwrap().0;
    let gradient = builtin("gradient", 128).unwrap();
    let fit = judge(&project(&gradient).irradiance_over_pi, &exact(&gradient));
    // Half a row, squared: what the steps of the map have beyond order two.
    assert!(fit.max_relative_error < (PI / 64.0).powi(2), "{fit:?}");
    assert!(fit.min > 0.5, "{fit:?}");
    // For a lone light the fit to max(c, 0) is 1/4 + c/2 + 5/32 (3c² − 1), which is −0.04 at c = −8/15.
    let sun = builtin("sun", 128).unwrap();
    let fit = judge(&project(&sun).irradiance_over_pi, &exact(&sun));
    assert!(fit.min < 0.0 && fit.rms_error > 0.05, "{fit:?}");
}

#[test]
fn every_builtin_has_its_stated_flux() {
    for builtin_map in BUILTINS {
        let map = builtin(builtin_map.name, 256).unwrap();
        assert!(map.texels().iter().flatten().all(|v| v.is_finite() && *v > 0.0), "{}", builtin_map.name);
    }
    for width in [16, 256, 1024] {
        let mean = builtin("sun", width).unwrap().mean()[0];
        assert!((mean / (0.1 + 10.0 / (4.0 * PI)) - 1.0).abs() < 1e-6, "sun at {width}: mean {mean}");
        assert!((builtin("gradient", width).unwrap().mean()[0] - 1.0).abs() < 1e-7, "gradient at {width}");
    }
}

#[test]
fn the_ground_of_the_sky_reflects_what_falls_on_it() {
    let sky = builtin("sky", 1024).unwrap();
    let mut irradiance = 0.0;
    for row in 0..256 {
        let y = (sky.row_edges()[row] + sky.row_edges()[row + 1]) / 2.0;
        irradiance += sky.row(row).iter().map(|t| f64::from(t[1])).sum::<f64>() * y * sky.solid_angle(row);
    }
    let got = f64::from(sky.texels()[1024 * 500][1]);
    // The sun's texels are up to one row (6e-3) away from its centre, 40° high: cot 40° = 1.2 of that in the cosine.
    assert!((got / (0.3 / PI * irradiance) - 1.0).abs() < 6.2e-3 * 1.2, "{got}, wanted {}", 0.3 / PI * irradiance);
    assert!(sky.row(256).iter().all(|texel| *texel == sky.texels()[1024 * 500]), "the ground begins at the horizon");
}

#[test]
fn requests_that_make_no_sense_say_so() {
    let message = |error: kiln::Error| error.to_string();
    let unknown = message(builtin("moon", 64).unwrap_err());
    assert!(BUILTINS.iter().all(|b| unknown.contains(b.name)) && unknown.contains("moon"), "{unknown}");
    assert!(message(builtin("sky", 7).unwrap_err()).contains("width 7"));
    let white = builtin("white", 8).unwrap();
    let base = ChainSpec::new(8, 2);
    for (spec, part) in [
        (ChainSpec { size: 0, ..base.clone() }, "size 0"),
        (ChainSpec { roughness: vec![0.0; 5], ..base.clone() }, "5 levels"),
        (ChainSpec { roughness: vec![0.0, 1.5], ..base.clone() }, "roughness 1.5"),
        (ChainSpec { samples: 10, integrator: Integrator::MonteCarlo, ..base.clone() }, "10 samples"),
    ] {
        let got = message(specular_chain(&white, &spec, &silent).unwrap_err());
        assert!(got.contains(part) && got.contains(';'), "{got}");
    }
    assert_eq!(base.roughness, [0.0, 0.5, 1.0]);
    assert_eq!(ChainSpec::new(4, 4).roughness, [0.0]);
}
