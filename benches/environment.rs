//! How long the environment filters take on one thread, on the built-in sky of 1024 × 512 texels unless a case says otherwise (the
//! first run of a case on a larger sky also makes it: the median and the fastest do not see that).
//!
//! `cargo bench --bench environment`; see the other benchmark for how to read and to count instructions.

mod harness;

use harness::Case;
use kiln::environment::{FullSum, InstructionSet, Kernel, MonteCarlo, Panorama, Zonal, area_average, builtin};
use std::hint::black_box;
use std::sync::LazyLock;

static SKY: LazyLock<Panorama> = LazyLock::new(|| builtin("sky", 1024).expect("built in"));

static LARGE_SKY: LazyLock<Panorama> = LazyLock::new(|| builtin("sky", 4096).expect("built in"));

fn monte_carlo(size: usize, alpha: f64, samples: usize) {
    black_box(MonteCarlo::new(&SKY, 0).filter(size, &Kernel::new(alpha), samples, &|_| {}));
}

fn full_sum(size: usize, alpha: f64) {
    black_box(FullSum::new(&SKY).filter(size, &Kernel::new(alpha), &|_| {}));
}

/// The levels after the first of a chain from `size`, and irradiance at 32² if wanted: the filter alone, nothing measured.
fn zonal(panorama: &Panorama, size: usize, alphas: &[f64], irradiance: bool, instructions: InstructionSet) {
    let kernels: Vec<Kernel> = alphas.iter().map(|&alpha| Kernel::new(alpha)).collect();
    let zonal = Zonal::new(panorama, &kernels, instructions);
    for (level, kernel) in kernels.iter().enumerate() {
        black_box(zonal.function(kernel).cube(size >> (level + 1), &|_| {}));
    }
    if irradiance {
        black_box(zonal.function(&Kernel::new(1.0)).cube(32, &|_| {}));
    }
}

/// The default chain from 256², and one that begins at alpha 0.018.
const DEFAULT: [f64; 4] = [0.0625, 0.25, 0.5625, 1.0];
const SHARP: [f64; 4] = [0.018, 0.25, 0.5625, 1.0];
/// The default chain from 1024².
const LARGE: [f64; 6] = [1.0 / 36.0, 1.0 / 9.0, 0.25, 4.0 / 9.0, 25.0 / 36.0, 1.0];

fn main() {
    LazyLock::force(&SKY);
    let (plain, best) = (InstructionSet::Baseline, InstructionSet::detect());
    let cases: [Case; 11] = [
        ("area average, 256²", Box::new(|| drop(black_box(area_average(&SKY, 256))))),
        ("Monte Carlo, 32², alpha 1/16, 1024 samples", Box::new(|| monte_carlo(32, 0.0625, 1024))),
        ("Monte Carlo, 32², alpha 1/4, 1024 samples", Box::new(|| monte_carlo(32, 0.25, 1024))),
        ("Monte Carlo, 32², alpha 1, 1024 samples", Box::new(|| monte_carlo(32, 1.0, 1024))),
        ("zonal, 256² chain and irradiance", Box::new(move || zonal(&SKY, 256, &DEFAULT, true, best))),
        ("zonal, 256² chain and irradiance, baseline", Box::new(move || zonal(&SKY, 256, &DEFAULT, true, plain))),
        ("zonal, 256² chain from alpha 0.018", Box::new(move || zonal(&SKY, 256, &SHARP, true, best))),
        ("zonal, 256² chain from alpha 0.018, baseline", Box::new(move || zonal(&SKY, 256, &SHARP, true, plain))),
        ("zonal, 4096 × 2048 to a 1024² chain", Box::new(move || zonal(&LARGE_SKY, 1024, &LARGE, true, best))),
        (
            "zonal, 4096 × 2048 to a 1024² chain, baseline",
            Box::new(move || zonal(&LARGE_SKY, 1024, &LARGE, true, plain)),
        ),
        ("full sum, 4², alpha 1/4", Box::new(|| full_sum(4, 0.25))),
    ];
    harness::run(&cases);
}
