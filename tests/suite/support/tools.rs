//! Finding and running the readers that other people wrote, in JavaScript and Python.
//!
//! They live in the folder that KILN_TEST_TOOLS names: `npm install --prefix DIR ktx-parse@2.0.0 three@0.187.0 @babylonjs/core@9.34.0 playcanvas@2.23.3 filament@1.53.4`
//! and `pip install --target DIR/python OpenEXR==3.5.3 OpenImageIO==3.2.2.0 numpy==2.4.6`; `tests/ktx2check/build.sh DIR` builds Khronos' validator there. Where one is missing its test says `skipped: …` and passes, unless
//! KILN_REQUIRE_TOOLS=1.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the tools; nothing there, and the skip is told.
pub fn folder_with(needed: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("KILN_TEST_TOOLS").map(PathBuf::from);
    let found = folder.filter(|folder| folder.join(needed).exists());
    if found.is_none() {
        skip(&format!("no {needed} in the folder that KILN_TEST_TOOLS names"));
    }
    found
}

/// Says that a test is skipped; fails it where skipping is forbidden.
pub fn skip(why: &str) {
    assert!(std::env::var_os("KILN_REQUIRE_TOOLS").is_none_or(|value| value != "1"), "KILN_REQUIRE_TOOLS=1, but {why}");
    eprintln!("skipped: {why}");
}

/// What `command` prints; nothing where it cannot be started, which is a skip.
pub fn output(mut command: Command) -> Option<String> {
    let output = match command.output() {
        Ok(output) => output,
        Err(error) => {
            skip(&format!("{:?} does not start: {error}", command.get_program()));
            return None;
        }
    };
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{:?} failed: {errors}", command.get_program());
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// What a script prints about `file`, run by Node with `ktx-parse`.
pub fn node(script: &str, file: &Path) -> Option<String> {
    let tools = folder_with("node_modules/ktx-parse")?;
    let mut command = Command::new("node");
    command.args(["--input-type=module", "--eval", script]).arg(file).env("KILN_TEST_TOOLS", tools);
    output(command)
}

/// What a script prints about `file`, run by Python with `OpenEXR`, `OpenImageIO` and `numpy`.
pub fn python(script: &str, file: &Path) -> Option<String> {
    let tools = folder_with("python")?;
    let mut command = Command::new("python3");
    command.arg("-c").arg(script).arg(file).env("PYTHONPATH", tools.join("python"));
    output(command)
}

/// What Khronos' validator has against a KTX2 file; nothing where it is missing, which is a skip.
///
/// It is of 2021, and two of its complaints are left out: that bytesPlane is not 0 of what Zstandard compresses, which Khronos took back
/// (KTX-Software, pull request 988: zero is what is warned of now), and what it says of UASTC HDR, which it does not know; and its warnings
/// that keys are not of the specification's, which have to be there.
pub fn faults_of_ktx2(file: &Path) -> Option<Vec<String>> {
    let program = folder_with("ktx2check")?.join("ktx2check");
    let output = Command::new(program).arg(file).output().expect("ktx2check runs");
    let text = String::from_utf8_lossy(&output.stdout).replace('\0', "");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let left_out = [
        "Custom metadata \"",
        "DFD bytes/plane must be 0 for a supercompressed texture",
        "DFD bytesPlane0 must be non-zero for non-supercompressed texture with VK_FORMAT_ASTC_4x4_SFLOAT_BLOCK",
    ];
    let faults = words.split("WARNING: ").flat_map(|text| text.split("ERROR: ")).flat_map(|text| text.split("FATAL: "));
    let faults = faults.map(str::trim).filter(|fault| !fault.is_empty() && !fault.starts_with("Issues in: "));
    Some(faults.filter(|fault| !left_out.iter().any(|known| fault.starts_with(known))).map(str::to_owned).collect())
}
