//! Times cases, on one thread unless a case makes more: there wall time is CPU time.

use std::time::{Duration, Instant};

/// A name and what to run.
pub type Case = (&'static str, Box<dyn Fn()>);

/// Runs of a case at most: the median is reported, and the fastest, which other programs disturb least.
const RUNS: usize = 7;
/// No run is begun after this.
const LONGEST: Duration = Duration::from_secs(10);

/// Runs and reports every case, or those whose name contains NAME with `--only NAME`; with `--once NAME` a single time and
/// without a report, for callgrind.
pub fn run(cases: &[Case]) {
    let arguments: Vec<String> = std::env::args().collect();
    let argument = |flag: &str| {
        let at = arguments.iter().position(|a| a == flag)?;
        Some(arguments.get(at + 1).map(String::as_str).unwrap_or_default())
    };
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the only global pool");
    if let Some(name) = argument("--once") {
        cases.iter().filter(|(n, _)| n.contains(name)).for_each(|(_, run)| run());
        return;
    }
    let only = argument("--only").unwrap_or_default();
    for (name, run) in cases.iter().filter(|(n, _)| n.contains(only)) {
        forget_peak();
        let (begun, mut seconds) = (Instant::now(), vec![]);
        while seconds.is_empty() || seconds.len() < RUNS && begun.elapsed() < LONGEST {
            let start = Instant::now();
            run();
            seconds.push(start.elapsed().as_secs_f64());
        }
        seconds.sort_by(f64::total_cmp);
        let (median, fastest) = (1e3 * seconds[seconds.len() / 2], 1e3 * seconds[0]);
        let peak = peak_mib().map_or(String::new(), |mib| format!(", peak {mib} MiB"));
        eprintln!("{name:56} median {median:9.1} ms, fastest {fastest:9.1} ms of {}{peak}", seconds.len());
    }
}

/// Starts the measurement of resident memory anew, where the system can (Linux).
fn forget_peak() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// The most memory that was resident, where the system says so.
fn peak_mib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kib| kib / 1024)
}
