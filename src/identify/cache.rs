//! Masters kept between runs: files under the user's cache folder, which may vanish at any time.
//!
//! The folder is `kiln` under `XDG_CACHE_HOME`, else `~/.cache` (`~/Library/Caches` on macOS, `%LOCALAPPDATA%` on Windows). A file's
//! name is a digest of what it holds and of Kiln's version and algorithm revision; at its end stands a digest of its content, so that
//! a torn or foreign file is integrated anew. Files appear whole or not at all.

use crate::certificate::ALGORITHMS;
use std::path::PathBuf;

/// What a file begins with; the number changes with the layout.
const MAGIC: &[u8; 8] = b"kilnmst2";
/// Bytes of a digest.
const DIGEST: usize = 32;

fn folder() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let base = variable("XDG_CACHE_HOME").or_else(|| {
        if cfg!(windows) {
            variable("LOCALAPPDATA")
        } else if cfg!(target_os = "macos") {
            variable("HOME").map(|home| home.join("Library/Caches"))
        } else {
            variable("HOME").map(|home| home.join(".cache"))
        }
    })?;
    // The specification has relative paths ignored.
    base.is_absolute().then(|| base.join("kiln"))
}

fn path(key: &str) -> Option<PathBuf> {
    let full = format!("{} {} {ALGORITHMS} {key}", env!("CARGO_PKG_VERSION"), String::from_utf8_lossy(MAGIC));
    Some(folder()?.join(format!("{}.master", &blake3::hash(full.as_bytes()).to_hex()[..32])))
}

/// The `n` values kept under `key`, if they are there and whole.
pub fn read(key: &str, n: usize) -> Option<Vec<f64>> {
    let bytes = std::fs::read(path(key)?).ok()?;
    let body = bytes.strip_prefix(MAGIC)?;
    if body.len() != n.checked_mul(8)?.checked_add(DIGEST)? {
        return None;
    }
    let (values, digest) = body.split_at(n * 8);
    if blake3::hash(values).as_bytes() != digest {
        return None;
    }
    let values: Vec<f64> = values.as_chunks::<8>().0.iter().map(|v| f64::from_le_bytes(*v)).collect();
    values.iter().all(|v| !v.is_infinite()).then_some(values)
}

/// Keeps `values` under `key`, if the system lets us.
pub fn write(key: &str, values: &[f64]) {
    let Some(path) = path(key) else { return };
    let Some(folder) = path.parent() else { return };
    let body: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let bytes = [MAGIC.as_slice(), &body, blake3::hash(&body).as_bytes()].concat();
    // A cache that cannot be written only costs time.
    let _ = std::fs::create_dir_all(folder).and_then(|()| {
        let file = tempfile::NamedTempFile::new_in(folder)?;
        std::fs::write(file.path(), &bytes)?;
        file.persist(&path).map_err(|e| e.error).map(|_| ())
    });
}
