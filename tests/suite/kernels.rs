//! Every kernel that environments are filtered with: three ways of filtering agree, at suns, beside them, across their horizons and in
//! the dark; kernels narrower than a texel; white stays white.

#![allow(clippy::unwrap_used)] // clippy knows test functions, not what they share

use crate::support::kiln::{fail, succeed};
use glam::DVec3;
use kiln::environment::{
    FullSum, InstructionSet, Kernel, KernelKind, MonteCarlo, Panorama, View, ViewLobe, ViewMonteCarlo, Zonal,
};
use kiln::math::sobol::PointSet;

/// Texels in [0, 1), times ten in every seventh, black in some, with a sun of 1e5 in one.
fn lit([width, height]: [usize; 2], seed: u64, sun: (usize, usize)) -> Panorama {
    let texel = |i: usize| {
        let p = PointSet::<3>::new(seed, i as u64, 1).points()[0];
        let factor = if i.is_multiple_of(7) { 10.0 } else { f64::from(u8::from(!i.is_multiple_of(5))) };
        p.map(|v| (v * factor) as f32)
    };
    let mut texels: Vec<[f32; 3]> = (0..width * height).map(texel).collect();
    texels[sun.1 * width + sun.0] = [1e5, 0.9e5, 0.5e5];
    Panorama::new(width, height, texels).unwrap()
}

/// A dark half and a sun in it: what is lit by a kernel's tail alone.
fn night([width, height]: [usize; 2], sun: (usize, usize)) -> Panorama {
    let texel = |i: usize| if i % width < width / 2 { [1e-4, 0.0, 1e-3] } else { [1.0, 0.5, 2.0] };
    let mut texels: Vec<[f32; 3]> = (0..width * height).map(texel).collect();
    texels[sun.1 * width + sun.0] = [1e5, 0.9e5, 0.5e5];
    Panorama::new(width, height, texels).unwrap()
}

/// Where errors hide: at the sun and at these angles from it, at poles, along axes, at an edge and a corner of its texel, spread out.
fn aims(panorama: &Panorama, angles: &[f64]) -> Vec<DVec3> {
    let (column, row, _) = panorama.peak();
    let texel = panorama.texel_box(column, row);
    let sun = texel.middle();
    let (side, up) = sun.any_orthonormal_pair();
    let mut aims = vec![sun, -sun, DVec3::Y, -DVec3::Y, DVec3::ONE.normalize(), DVec3::X, DVec3::Z];
    for &angle in angles {
        for away in [up, (side - up) * 0.5f64.sqrt()] {
            aims.push(sun * angle.cos() + away * angle.sin());
        }
    }
    let at = |phi: f64, y: f64| {
        let r = (1.0 - y * y).sqrt();
        DVec3::new(r * phi.cos(), y, r * phi.sin())
    };
    aims.extend([at(texel.phi[0], texel.y[0]), at(texel.phi[1], 0.5 * (texel.y[0] + texel.y[1]))]);
    aims.extend((0..6).map(|i| at(f64::from(i) * 2.4, 1.0 - (f64::from(i) + 0.5) / 3.0)));
    aims
}

const NEAR_AND_RING: [f64; 7] = [0.02, 0.07, 0.3, 1.0, 1.5657, 0.5 * std::f64::consts::PI, 1.6];

/// The goal: 1e-4 of the value, or of 1e-3 of the mean where that is more.
fn assert_goal(panorama: &Panorama, kernels: &[Kernel], aims: &[DVec3]) {
    let (mean, exact) = (panorama.mean(), FullSum::new(panorama));
    let zonal = Zonal::new(panorama, kernels, InstructionSet::detect());
    let mut failures = vec![];
    for kernel in kernels {
        let function = zonal.function(kernel);
        let mut worst = (0.0, String::new());
        for &direction in aims {
            let (got, wanted) = (function.at(direction), exact.evaluate(direction, kernel));
            for c in 0..3 {
                let off = (got[c] - wanted[c]).abs() / wanted[c].max(1e-3 * mean[c]);
                if off > worst.0 || off.is_nan() {
                    worst = (off, format!("{direction}, channel {c}: {} wanted {}", got[c], wanted[c]));
                }
            }
        }
        let shape =
            format!("{} × {}, {} {}", panorama.width(), panorama.height(), kernel.kind().name(), kernel.alpha());
        eprintln!("{shape}, degree {}: {:.1e} (bound {:.1e})", function.degree, worst.0, function.truncation);
        if worst.0 > 1e-4 || worst.0.is_nan() {
            failures.push(format!("{shape}, degree {}: {:.2e} at {}", function.degree, worst.0, worst.1));
        }
    }
    assert!(failures.is_empty(), "beyond 1e-4:\n{}", failures.join("\n"));
}

#[test]
fn masked_and_sheen_kernels_are_within_1e_4_of_the_full_sum_wherever_errors_hide() {
    let kernels = |least: f64| -> Vec<Kernel> {
        let of = |kind| [least, 0.25, 1.0].map(|alpha| Kernel::of(kind, alpha));
        [KernelKind::G1, KernelKind::Charlie].into_iter().flat_map(of).collect()
    };
    for (panorama, least) in [
        // More texels than are peeled off: twice the degrees of the steepest kernel for all of them, 2734 of a sheen of 0.05.
        (lit([48, 24], 3, (27, 8)), 0.1),
        (lit([10, 5], 3, (0, 0)), 0.05),
        (night([48, 24], (11, 15)), 0.05),
    ] {
        assert_goal(&panorama, &kernels(least), &aims(&panorama, &NEAR_AND_RING));
    }
}

#[test]
fn kernels_narrower_than_a_texel_are_within_1e_4_of_the_full_sum() {
    let kernels: Vec<Kernel> = [KernelKind::Nol, KernelKind::G1]
        .into_iter()
        .flat_map(|kind| [1e-4, 3.9e-3, 0.012].map(|alpha| Kernel::of(kind, alpha)))
        .collect();
    let beside = [1e-3, 0.024, 0.049, 0.15, 0.6, std::f64::consts::FRAC_PI_2];
    for panorama in [lit([48, 24], 5, (0, 23)), night([48, 24], (11, 15)), lit([10, 5], 6, (8, 2))] {
        assert_goal(&panorama, &kernels, &aims(&panorama, &beside));
    }
}

#[test]
fn monte_carlo_agrees_with_the_full_sum_for_every_kernel() {
    for panorama in [lit([48, 24], 7, (20, 9)), night([32, 16], (5, 10))] {
        let (mean, exact) = (panorama.mean(), FullSum::new(&panorama));
        let monte_carlo = MonteCarlo::new(&panorama, 5);
        let aims = aims(&panorama, &[0.1, 1.0, 1.57]);
        for kernel in KernelKind::ALL.into_iter().flat_map(|kind| [0.05, 1.0].map(|a| Kernel::of(kind, a))) {
            let (estimates, _) = monte_carlo.estimate(&aims, &kernel, 1 << 13, &|_| {});
            for (estimate, &direction) in estimates.iter().zip(&aims) {
                let wanted = exact.evaluate(direction, &kernel);
                for c in 0..3 {
                    // Six sigma of a Student distribution of 31 degrees: false alarm 1e-6 for each of 2e3 values.
                    let tolerance = 6.0 * estimate.standard_error[c] + 1e-6 * wanted[c].max(1e-3 * mean[c]);
                    assert!(
                        (estimate.value[c] - wanted[c]).abs() <= tolerance,
                        "{kernel:?}, {direction}, channel {c}: {} wanted {} ± {tolerance}",
                        estimate.value[c],
                        wanted[c]
                    );
                }
            }
        }
    }
}

/// Kernels have mass one over the texels: a map that is 1 but for one texel, and that texel.
#[test]
fn full_sums_keep_the_mass_of_every_kernel_and_agree_with_more_points() {
    let panorama = lit([48, 24], 9, (20, 9));
    let (width, dark) = (48, 48 * 11 + 30);
    let parts: Vec<[f32; 3]> =
        (0..48 * 24).map(|i| if i == dark { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] }).collect();
    let parts = Panorama::new(width, 24, parts).unwrap();
    let (mass, coarse, fine) =
        (FullSum::new(&parts), FullSum::new(&panorama), FullSum::with_extra_points(&panorama, 3));
    for kernel in KernelKind::ALL.into_iter().flat_map(|kind| [0.01, 0.05, 1.0].map(|a| Kernel::of(kind, a))) {
        for direction in aims(&panorama, &[0.3, std::f64::consts::FRAC_PI_2]) {
            let [rest, one, _] = mass.evaluate(direction, &kernel);
            assert!((rest + one - 1.0).abs() < 2e-6, "{kernel:?}, {direction}: mass {}", rest + one);
            let (got, wanted) = (coarse.evaluate(direction, &kernel), fine.evaluate(direction, &kernel));
            for c in 0..3 {
                assert!(
                    (got[c] / wanted[c] - 1.0).abs() < 2e-6,
                    "{kernel:?}, {direction}: {} wanted {}",
                    got[c],
                    wanted[c]
                );
            }
        }
    }
}

#[test]
fn white_stays_one_under_every_kernel() {
    let white = Panorama::new(32, 16, vec![[1.0, 1.0, 0.0]; 512]).unwrap();
    let kernels: Vec<Kernel> =
        KernelKind::ALL.into_iter().flat_map(|kind| [1e-4, 0.003, 0.1, 1.0].map(|a| Kernel::of(kind, a))).collect();
    let kernels: Vec<Kernel> =
        kernels.into_iter().filter(|k| k.kind() != KernelKind::Charlie || k.alpha() > 0.01).collect();
    let zonal = Zonal::new(&white, &kernels, InstructionSet::detect());
    for kernel in &kernels {
        let cube = zonal.function(kernel).cube(4, &|_| {});
        assert!(cube.texels.iter().all(|t| *t == [1.0, 1.0, 0.0]), "{kernel:?}: {:?}", cube.texels[0]);
        let (estimates, _) = MonteCarlo::new(&white, 1).estimate(&[DVec3::X], kernel, 64, &|_| {});
        assert_eq!(estimates[0].value, [1.0, 1.0, 0.0]);
    }
}

/// Seen along the normal and not brushed, the true lobe is `g1`; at an angle and brushed, two ways of integrating it agree.
#[test]
fn lobes_seen_at_an_angle_agree_with_sums_and_with_the_masked_kernel_at_none() {
    let panorama = lit([64, 32], 11, (20, 9));
    let mean = panorama.mean();
    let (exact, monte_carlo) = (FullSum::new(&panorama), ViewMonteCarlo::new(&panorama, 3));
    let aims = aims(&panorama, &[0.05, 0.3, 1.0, 1.5]);
    for alpha in [0.1, 0.4, 1.0] {
        for view in
            [(0.0, 0.0), (0.0, 0.8), (35.0, 0.0), (70.0, 0.5)].map(|(angle, anisotropy)| View { angle, anisotropy })
        {
            let lobe = ViewLobe::new(alpha, view);
            let is_kernel = view == View::default();
            let some: Vec<DVec3> = if is_kernel { aims.clone() } else { aims.iter().copied().step_by(6).collect() };
            let (estimates, _) = monte_carlo.estimate(&some, &lobe, 1 << 13, &|_| {});
            for (estimate, &r) in estimates.iter().zip(&some) {
                // What the sum over texels of 0.1 radians makes of the surface's horizon that cuts through the sun's: its own stated error.
                let (wanted, known) = if is_kernel {
                    (exact.evaluate(r, &Kernel::of(KernelKind::G1, alpha)), 2e-6)
                } else {
                    (lobe.sum(&panorama, r), 1e-3)
                };
                for c in 0..3 {
                    let tolerance = 6.0 * estimate.standard_error[c] + known * wanted[c].max(1e-3 * mean[c]);
                    assert!(
                        (estimate.value[c] - wanted[c]).abs() <= tolerance,
                        "alpha {alpha}, {view:?}, {r}, channel {c}: {} wanted {} ± {tolerance}",
                        estimate.value[c],
                        wanted[c]
                    );
                }
            }
        }
    }
}

/// The lobe of a tilted surface is pulled towards its normal, upwards, and ends at its horizon.
#[test]
fn a_lobe_seen_at_an_angle_ends_at_the_horizon_of_its_surface() {
    let lobe = ViewLobe::new(0.5, View { angle: 60.0, anisotropy: 0.0 });
    let at = |elevation: f64| DVec3::new(elevation.to_radians().cos(), elevation.to_radians().sin(), 0.0);
    // R on the horizon of the world; the normal 60° above, the surface 30° below.
    assert_eq!(lobe.eval(DVec3::X, at(-30.1)), 0.0);
    assert!(lobe.eval(DVec3::X, at(-29.0)) > 0.0);
    assert!(lobe.eval(DVec3::X, at(10.0)) != lobe.eval(DVec3::X, at(-10.0)), "not round about R");
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder")
}

const SMALL: [&str; 6] = ["--size", "16", "--min-size", "4", "--irradiance-size", "8"];

fn env<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    ["env", "builtin:sun", "--out", out].into_iter().chain(SMALL).chain(more.iter().copied()).collect()
}

#[test]
fn kernels_views_and_bands_stand_in_the_certificate_and_are_verified() {
    let folder = folder();
    let path = folder.path();
    let certificate = |out: &str| {
        let text = std::fs::read_to_string(path.join(out).join("certificate.json")).expect("a certificate");
        kiln::certificate::Certificate::from_json(&text).expect("a certificate")
    };
    for kind in ["nol", "g1", "charlie"] {
        succeed(path, &env(kind, &["--kernel", kind, "--format", "ktx2:rgba32f"]));
        let recipe = certificate(kind).environment.expect("an environment");
        assert_eq!(recipe.kernel.name(), kind);
        let first = recipe.level_roughness()[0];
        assert_eq!(first, if kind == "charlie" { 0.07 } else { 0.0 }, "a sheen is no mirror");
        let claim = succeed(path, &["verify", &format!("{kind}/specular.ktx2")]).stdout;
        assert!(kind == "nol" || claim.contains(&format!("specular chain ({kind})")), "{claim}");
    }
    succeed(path, &env("view", &["--kernel", "g1", "--view-angle", "60", "--anisotropy", "0.5", "--samples", "2048"]));
    let view = certificate("view").environment.expect("an environment").view.expect("a view");
    assert_eq!((view.angle, view.anisotropy), (60.0, 0.5));
    let claim = succeed(path, &["verify", "view/specular.ktx2"]).stdout;
    assert!(claim.contains("seen at 60°, anisotropy 0.5") && claim.contains("sum over the panorama"), "{claim}");

    let run = succeed(path, &env("bands", &["--sh-bands", "6"]));
    assert!(run.stderr.contains("in 36 coefficients: off by"), "{}", run.stderr);
    let fits = certificate("bands").sh.expect("harmonics");
    let bands = fits.bands.expect("more bands");
    assert!(bands.rms_error < fits.projected.rms_error, "{bands:?} is no better than {:?}", fits.projected);
    let sh = std::fs::read_to_string(path.join("bands/sh.json")).expect("coefficients");
    let sh: serde_json::Value = serde_json::from_str(&sh).expect("JSON");
    assert_eq!(sh["bands"]["radiance"].as_array().map(Vec::len), Some(36));
    assert_eq!(sh["bands"]["order"][35], serde_json::json!([5, 5]));
    succeed(path, &["verify", "bands/sh.json"]);
}

#[test]
fn what_no_kernel_can_do_is_refused_with_a_way_out() {
    let folder = folder();
    for (arguments, wanted) in [
        (&["--view-angle", "60"][..], "--kernel g1"),
        (&["--kernel", "charlie", "--anisotropy", "0.5"], "--kernel g1"),
        (&["--kernel", "g1", "--view-angle", "60", "--integrator", "zonal"], "--integrator monte-carlo"),
        (&["--kernel", "g1", "--anisotropy", "0.2", "--integrator", "quadrature"], "--integrator monte-carlo"),
        (&["--kernel", "g1", "--view-angle", "90"], "--view-angle 60"),
        (&["--kernel", "g1", "--anisotropy", "1.5"], "--anisotropy 0.7"),
        (&["--sh-bands", "2"], "--sh-bands 5"),
        (&["--sh-bands", "11"], "--sh-bands 5"),
    ] {
        let error = fail(folder.path(), &env("out", arguments), 2);
        assert!(error.contains(wanted), "{arguments:?}: {error}");
    }
    let sheen = ["env", "builtin:sun", "--out", "out", "--kernel", "charlie", "--roughness", "0,1"];
    assert!(fail(folder.path(), &sheen, 2).contains("--roughness 0.07"));
    assert!(!folder.path().join("out/specular.ktx2").exists());
}
