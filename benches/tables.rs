//! How long tables take, in CPU seconds: everything runs on one thread, so that wall time is CPU time.
//!
//! `cargo bench --bench tables` prints the median and the fastest of some runs. The machine may be busy: compare rows of one run,
//! and decide between versions by instruction counts: `valgrind --tool=callgrind` on the benchmark's executable (cargo prints its
//! path) with `--once NAME`, which runs the cases whose name contains NAME a single time.

mod harness;

use glam::DVec3;
use harness::Case;
use kiln::bake;
use kiln::integrate::monte_carlo::{Points, Stop};
use kiln::integrate::{Integration, Integrator, Settings};
use kiln::math::frame::direction_with_cosine;
use kiln::math::sobol::PointSet;
use kiln::model::Lobe;
use kiln::model::charlie::Visibility;
use kiln::model::fresnel::schlick_weight;
use kiln::model::ggx::{Ggx, Smith};
use kiln::recipe::TableRecipe;
use kiln::table::named::{NamedTable, TABLES};
use kiln::table::{Axis, Model, Parameter, Point, TableSpec, quantity};
use std::hint::black_box;

fn integrate(channels: &[&str], axes: Vec<Axis>, at: Point, model: Model, settings: Settings) {
    let channels = channels.iter().map(|name| quantity::find(name).expect("a quantity")).collect();
    let spec = TableSpec { channels, axes, at, model };
    let integration = Integration::new(settings).expect("valid settings");
    black_box(spec.bake(&integration, &|_| {}).expect("the tolerance is reached"));
}

fn dfg(size: usize, settings: Settings) {
    let axes = vec![Axis::new(Parameter::Mu, size), Axis::new(Parameter::Roughness, size)];
    integrate(&["ggx.scale", "ggx.bias"], axes, Point::default(), Model::default(), settings);
}

/// The recipe of a named table, for a file of half floats.
fn recipe(table: &NamedTable) -> TableRecipe {
    let format = match table.channels.len() {
        1 => "ktx2:r16f",
        2 => "ktx2:rg16f",
        3 | 4 => "ktx2:rgba16f",
        _ => "exr:f16", // more channels than a texture has
    };
    TableRecipe::named(table.name, format.parse().expect("a format")).expect("a name")
}

/// A named table as `kiln table NAME` bakes it: which of the lobes of one name is meant, the axes and the values say.
fn named(table: &NamedTable, model: Model) {
    let spec = TableSpec { model, ..recipe(table).spec().expect("quantities") };
    let settings = Settings { tolerance: table.tolerance, ..Settings::default() };
    let integration = Integration::new(settings).expect("valid settings");
    black_box(spec.bake(&integration, &|_| {}).unwrap_or_else(|e| panic!("{}: {e}", table.name)));
}

/// The same with its rounding, its checks and its lookup error, in half floats: all of a bake but the second witness and the file.
fn checked(table: &NamedTable) {
    black_box(bake::table_by_one_witness(&recipe(table), &|_| {}).unwrap_or_else(|e| panic!("{}: {e}", table.name)));
}

/// Reflectance and transmittance of a rough dielectric at the centres of 16³ texels: mu, alpha, and eta over an interval.
fn dielectric_pair(smith: Smith, range: (f64, f64)) {
    let eta = Axis { range: Some(range), ..Axis::new(Parameter::Eta, 16) };
    let axes = vec![Axis::new(Parameter::Mu, 16), Axis::new(Parameter::Alpha, 16), eta];
    let channels = ["dielectric.reflectance", "dielectric.transmittance"];
    integrate(&channels, axes, Point::default(), Model { smith, ..Model::default() }, Settings::default());
}

fn quadrature(tolerance: f64) -> Settings {
    Settings { integrator: Integrator::Quadrature, tolerance: Some(tolerance), ..Settings::default() }
}

fn monte_carlo(samples: u64) -> Settings {
    Settings { integrator: Integrator::MonteCarlo, samples: Some(samples), ..Settings::default() }
}

/// Texels of a side, and points per value, of the comparison below.
const SIDE: usize = 32;
const SAMPLES: u64 = 4096;

/// The integrand of the split sum, which both of the next compute: GGX sampled, weighted by Schlick's factor and its rest.
fn split_sum(lobe: &Ggx, wo: DVec3, u: [f64; 2]) -> [f64; 2] {
    lobe.sample(wo, u).map_or([0.0; 2], |s| {
        let fc = schlick_weight((0.5 * (wo + s.wi).length()).min(1.0));
        [(1.0 - fc) * s.weight, fc * s.weight]
    })
}

fn for_each_texel(run: impl Fn(&Ggx, DVec3)) {
    for texel in 0..SIDE * SIDE {
        let [mu, roughness] = [texel % SIDE, texel / SIDE].map(|i| (i as f64 + 0.5) / SIDE as f64);
        run(&Ggx::isotropic(roughness * roughness, Smith::Correlated), direction_with_cosine(mu));
    }
}

/// The Monte Carlo witness, its points computed before.
fn by_witness(points: &Points<2>) {
    for_each_texel(|lobe, wo| {
        black_box(points.integrate(Stop::Samples(SAMPLES), |u| split_sum(lobe, wo, u)));
    });
}

/// The same integrand summed over as many points by a bare loop: the floor of the witness's cost, which may be twice this.
fn by_bare_loop(points: &PointSet<2>) {
    for_each_texel(|lobe, wo| {
        let mut sum = [0.0; 2];
        for &u in points.points() {
            let value = split_sum(lobe, wo, u);
            sum = [sum[0] + value[0], sum[1] + value[1]];
        }
        black_box(sum);
    });
}

fn case(name: impl Into<String>, run: impl Fn() + 'static) -> Case {
    // A name is wanted for as long as the process lives.
    (name.into().leak(), Box::new(run))
}

fn main() {
    let (shared, bare) = (Points::<2>::new(0), PointSet::<2>::new(0, 0, SAMPLES as usize));
    shared.integrate(Stop::Samples(SAMPLES), |u| u); // computes them
    let mut cases = vec![
        case("dfg 128², quadrature, 1e-6", || dfg(128, quadrature(1e-6))),
        case("dfg 128², quadrature, 1e-7", || dfg(128, quadrature(1e-7))),
        case("dfg 128², quadrature, 1e-9", || dfg(128, quadrature(1e-9))),
        case("dfg 32², Monte Carlo, 4096 points", || dfg(32, monte_carlo(4096))),
        case("split sum, 4096 points, by the witness", move || by_witness(&shared)),
        case("split sum, 4096 points, by a bare loop", move || by_bare_loop(&bare)),
    ];
    for table in TABLES {
        cases.push(case(format!("table {}", table.name), || named(table, Model::default())));
    }
    for table in TABLES {
        cases.push(case(format!("checked table {}", table.name), || checked(table)));
    }
    // All but the table that only Monte Carlo integrates.
    let deterministic = || {
        let quadrature = |table: &&NamedTable| {
            recipe(table).spec().expect("quantities").channels.iter().all(|channel| channel.family.has_quadrature())
        };
        TABLES.iter().filter(quadrature)
    };
    cases.push(case("the full default set with its checks, without the second witness", move || {
        deterministic().for_each(checked);
    }));
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
