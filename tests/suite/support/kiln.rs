//! Running the command itself.

use std::path::Path;
use std::process::{Command, Output};

/// What came of a run.
pub struct Run {
    /// Exit code.
    pub code: i32,
    /// Results.
    pub stdout: String,
    /// Everything else.
    pub stderr: String,
}

/// Runs `kiln` in `folder`.
pub fn kiln(folder: &Path, arguments: &[&str]) -> Run {
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_kiln"))
        .args(arguments)
        .current_dir(folder)
        .env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR")) // not the user's
        .output()
        .expect("kiln starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("kiln prints UTF-8");
    Run { code: status.code().expect("kiln exits"), stdout: text(stdout), stderr: text(stderr) }
}

/// Runs `kiln`, which must succeed; what it printed.
pub fn succeed(folder: &Path, arguments: &[&str]) -> Run {
    let run = kiln(folder, arguments);
    assert_eq!(run.code, 0, "kiln {arguments:?} failed: {}", run.stderr);
    run
}

/// Has a shell run a command line that begins with `kiln`, which must succeed.
#[cfg(unix)]
pub fn shell(folder: &Path, line: &str) {
    let program = Path::new(env!("CARGO_BIN_EXE_kiln"));
    let paths = [program.parent().expect("a folder").to_owned()];
    let path = std::env::join_paths(
        paths.into_iter().chain(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default())),
    );
    let run = Command::new("sh").arg("-c").arg(line).current_dir(folder).env("PATH", path.expect("paths")).output();
    let run = run.expect("a shell");
    assert!(run.status.success(), "{line}: {}", String::from_utf8_lossy(&run.stderr));
}

/// Runs `kiln`, which must fail with `code`, one error, a way out and without a panic; the error.
pub fn fail(folder: &Path, arguments: &[&str], code: i32) -> String {
    let run = kiln(folder, arguments);
    assert_eq!(run.code, code, "kiln {arguments:?}: {}{}", run.stdout, run.stderr);
    assert!(!run.stderr.contains("panicked"), "kiln {arguments:?}: {}", run.stderr);
    assert!(run.stderr.contains("error: "), "kiln {arguments:?} says no error: {}", run.stderr);
    // clap's own messages end with a hint instead of a second clause.
    let has_way_out = run.stderr.contains("; ") || run.stderr.contains("--help") || run.stderr.contains("tip:");
    assert!(has_way_out, "kiln {arguments:?} shows no way out: {}", run.stderr);
    run.stderr
}

/// Names of everything below `folder`, sorted.
pub fn listing(folder: &Path) -> Vec<String> {
    let mut names = vec![];
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path.clone());
            }
            names.push(path.strip_prefix(folder).expect("below").to_string_lossy().into_owned());
        }
    }
    names.sort();
    names
}
