//! How much memory a test takes.

/// Whether this process runs nothing but the test of that path, such as `module::test`, so that its memory is the test's: if it does not,
/// another one that does has passed.
pub fn alone(test: &str) -> bool {
    const ALONE: &str = "KILN_TEST_ALONE";
    if std::env::var_os(ALONE).is_some() {
        return true;
    }
    let program = std::env::current_exe().expect("a program");
    let run = std::process::Command::new(program).args(["--exact", test, "--nocapture"]).env(ALONE, "1").output();
    let run = run.expect("the tests run");
    let text = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success() && text.contains("1 passed"), "{text}{}", String::from_utf8_lossy(&run.stderr));
    false
}

/// Inputs are smaller than 50 kB, and the most that a reader may allocate is a few thousand times as much.
pub fn assert_little() {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else {
        return eprintln!("skipped: no /proc/self/status to read the memory from");
    };
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
    let peak: u64 = peak.expect("VmHWM in kB");
    assert!(peak < 512 * 1024, "{peak} kB of memory were in use at once");
}
