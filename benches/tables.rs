//! How long tables take, in CPU seconds: everything runs on one thread, so that wall time is CPU time.
//!
//! `cargo bench --bench tables` prints the median and the fastest of some runs. The machine may be busy: compare rows of one run,
//! and decide between versions by instruction counts: `valgrind --tool=callgrind` on the benchmark's executable (cargo prints its
//! path) with `--once NAME`, which runs the cases whose name contains NAME a single time.

mod harness;

use harness::Case;
use kiln::integrate::{Integration, Integrator, Settings};
use kiln::math::frame::direction_with_cosine;
use kiln::math::sobol::PointSet;
use kiln::model::Lobe;
use kiln::model::ggx::{Ggx, Smith};
use kiln::table::{Axis, Parameter, TableSpec, quantity};
use std::hint::black_box;

fn dfg(size: usize, settings: Settings) {
    let channels = ["ggx.scale", "ggx.bias"].map(|name| quantity::find(name).expect("a quantity")).to_vec();
    let axes = vec![Axis::new(Parameter::Mu, size), Axis::new(Parameter::Roughness, size)];
    let spec = TableSpec { channels, axes, ..TableSpec::default() };
    let integration = Integration::new(settings).expect("valid settings");
    black_box(spec.bake(&integration, &|_| {}).expect("the tolerance is reached"));
}

fn quadrature(tolerance: f64) -> Settings {
    Settings { integrator: Integrator::Quadrature, tolerance: Some(tolerance), ..Settings::default() }
}

fn monte_carlo(samples: u64) -> Settings {
    Settings { integrator: Integrator::MonteCarlo, samples: Some(samples), ..Settings::default() }
}

/// What the Monte Carlo witness computes per point, without its bookkeeping: the floor of its cost.
fn integrand_alone(size: usize, samples: usize) {
    let points = PointSet::<2>::new(0, 0, samples);
    for y in 0..size {
        for x in 0..size {
            let (mu, roughness) = ((x as f64 + 0.5) / size as f64, (y as f64 + 0.5) / size as f64);
            let lobe = Ggx::isotropic(roughness * roughness, Smith::Correlated);
            let wo = direction_with_cosine(mu);
            let sum: f64 = points.points().iter().filter_map(|&u| lobe.sample(wo, u)).map(|s| s.weight).sum();
            black_box(sum);
        }
    }
}

fn main() {
    let cases: [Case; 5] = [
        ("dfg 128², quadrature, 1e-6", Box::new(|| dfg(128, quadrature(1e-6)))),
        ("dfg 128², quadrature, 1e-7", Box::new(|| dfg(128, quadrature(1e-7)))),
        ("dfg 128², quadrature, 1e-9", Box::new(|| dfg(128, quadrature(1e-9)))),
        ("dfg 32², Monte Carlo, 4096 points", Box::new(|| dfg(32, monte_carlo(4096)))),
        ("dfg 32², its integrand alone", Box::new(|| integrand_alone(32, 4096))),
    ];
    harness::run(&cases);
}
