//! Times cases on one thread, where wall time is CPU time.

use std::time::Instant;

/// A name and what to run.
pub type Case = (&'static str, Box<dyn Fn()>);

/// Runs of a case: the median is reported, and the fastest, which other programs disturb least.
const RUNS: usize = 7;

/// Runs and reports every case; with `--once NAME`, runs those whose name contains NAME a single time, for callgrind.
pub fn run(cases: &[Case]) {
    let arguments: Vec<String> = std::env::args().collect();
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the only pool");
    if let Some(at) = arguments.iter().position(|a| a == "--once") {
        let name = arguments.get(at + 1).map(String::as_str).unwrap_or_default();
        cases.iter().filter(|(n, _)| n.contains(name)).for_each(|(_, run)| run());
        return;
    }
    for (name, run) in cases {
        let mut seconds: Vec<f64> = (0..RUNS)
            .map(|_| {
                let start = Instant::now();
                run();
                start.elapsed().as_secs_f64()
            })
            .collect();
        seconds.sort_by(f64::total_cmp);
        eprintln!("{name:48} median {:9.1} ms, fastest {:9.1} ms", 1e3 * seconds[RUNS / 2], 1e3 * seconds[0]);
    }
}
