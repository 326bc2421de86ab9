//! How long the environment filters take on one thread, on the built-in sky of 1024 × 512 texels.
//!
//! `cargo bench --bench environment`; see the other benchmark for how to read and to count instructions.

mod harness;

use harness::Case;
use kiln::environment::{FullSum, Kernel, MonteCarlo, Panorama, area_average, builtin};
use std::hint::black_box;
use std::sync::LazyLock;

static SKY: LazyLock<Panorama> = LazyLock::new(|| builtin("sky", 1024).expect("built in"));

fn monte_carlo(size: usize, alpha: f64, samples: usize) {
    black_box(MonteCarlo::new(&SKY, 0).filter(size, &Kernel::new(alpha), samples, &|_| {}));
}

fn full_sum(size: usize, alpha: f64) {
    black_box(FullSum::new(&SKY).filter(size, &Kernel::new(alpha), &|_| {}));
}

fn main() {
    LazyLock::force(&SKY);
    let cases: [Case; 5] = [
        ("area average, 256²", Box::new(|| drop(black_box(area_average(&SKY, 256))))),
        ("Monte Carlo, 32², alpha 1/16, 1024 samples", Box::new(|| monte_carlo(32, 0.0625, 1024))),
        ("Monte Carlo, 32², alpha 1/4, 1024 samples", Box::new(|| monte_carlo(32, 0.25, 1024))),
        ("Monte Carlo, 32², alpha 1, 1024 samples", Box::new(|| monte_carlo(32, 1.0, 1024))),
        ("full sum, 4², alpha 1/4", Box::new(|| full_sum(4, 0.25))),
    ];
    harness::run(&cases);
}
