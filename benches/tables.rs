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
use kiln::model::charlie::Visibility;
use kiln::model::ggx::{Ggx, Smith};
use kiln::table::named::{NamedTable, TABLES};
use kiln::table::quantity::evaluate_family;
use kiln::table::{Axis, Model, Parameter, Point, TableSpec, quantity};
use std::hint::black_box;

fn bake(channels: &[&str], axes: Vec<Axis>, model: Model, settings: Settings) {
    let channels = channels.iter().map(|name| quantity::find(name).expect("a quantity")).collect();
    let spec = TableSpec { channels, axes, model };
    let integration = Integration::new(settings).expect("valid settings");
    black_box(spec.bake(&integration, &|_| {}).expect("the tolerance is reached"));
}

fn dfg(size: usize, settings: Settings) {
    let axes = vec![Axis::new(Parameter::Mu, size), Axis::new(Parameter::Roughness, size)];
    bake(&["ggx.scale", "ggx.bias"], axes, Model::default(), settings);
}

/// A named table as `kiln table NAME` bakes it.
fn named(table: &NamedTable, model: Model) {
    bake(table.channels, table.default_axes(), model, Settings::default());
}

/// Reflectance and transmittance of a rough dielectric at the centres of 16³ texels: mu, alpha, and eta over an interval.
fn dielectric_pair(smith: Smith, (low, high): (f64, f64)) {
    let family = quantity::find("dielectric.reflectance").expect("a quantity").family;
    let (model, integration) =
        (Model { smith, ..Model::default() }, Integration::new(Settings::default()).expect("valid settings"));
    let centre = |i: usize| (i as f64 + 0.5) / 16.0;
    for texel in 0..16 * 16 * 16 {
        let [mu, alpha, eta] = [texel % 16, texel / 16 % 16, texel / 256].map(centre);
        let values = [(Parameter::Mu, mu), (Parameter::Alpha, alpha), (Parameter::Eta, low + eta * (high - low))];
        let at = values.into_iter().fold(Point::default(), |p, (q, v)| p.with(q, v).expect("in the domain"));
        black_box(evaluate_family(family, &at, &model, &integration).expect("in the domain"));
    }
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

fn case(name: impl Into<String>, run: impl Fn() + 'static) -> Case {
    // A name is wanted for as long as the process lives.
    (name.into().leak(), Box::new(run))
}

fn main() {
    let mut cases = vec![
        case("dfg 128², quadrature, 1e-6", || dfg(128, quadrature(1e-6))),
        case("dfg 128², quadrature, 1e-7", || dfg(128, quadrature(1e-7))),
        case("dfg 128², quadrature, 1e-9", || dfg(128, quadrature(1e-9))),
        case("dfg 32², Monte Carlo, 4096 points", || dfg(32, monte_carlo(4096))),
        case("dfg 32², its integrand alone", || integrand_alone(32, 4096)),
    ];
    for table in TABLES {
        cases.push(case(format!("table {}", table.name), || named(table, Model::default())));
    }
    cases.push(case("every named table", || TABLES.iter().for_each(|table| named(table, Model::default()))));
    let sheen = TABLES.iter().find(|table| table.name == "charlie-albedo").expect("a table");
    for visibility in Visibility::ALL {
        let model = Model { visibility, ..Model::default() };
        cases.push(case(format!("sheen 64², {}", visibility.name()), move || named(sheen, model)));
    }
    for smith in [Smith::Correlated, Smith::Separable, Smith::Beta] {
        for (low, high) in [(1.0, 2.0), (0.5, 1.0)] {
            let name = format!("dielectric 16³, eta {low}..{high}, {}", smith.name());
            cases.push(case(name, move || dielectric_pair(smith, (low, high))));
        }
    }
    harness::run(&cases);
}
