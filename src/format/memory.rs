//! Whether what a file asks for fits into memory: asked before it is allocated, because failing at that ends the process.

use crate::error::{Error, Result};

/// Refuses what the memory that is free does not hold. Where the system does not say how much that is, everything is allowed
/// that a number can count.
///
/// **Errors**: more bytes than there are; `what` begins the message.
pub(crate) fn check_room(n_bytes: u128, what: &str) -> Result<()> {
    match available() {
        Some(available) if n_bytes > u128::from(available) => Err(Error::unsupported(
            format!("{what} takes {}, and {} of memory are free", gib(n_bytes), gib(available.into())),
            "use a smaller picture, or a machine with more memory",
        )),
        _ if n_bytes > isize::MAX as u128 => {
            Err(Error::unsupported(format!("{what} takes {}", gib(n_bytes)), "use a smaller picture"))
        }
        _ => Ok(()),
    }
}

fn gib(n_bytes: u128) -> String {
    format!("{:.1} GiB", n_bytes as f64 / (1_u64 << 30) as f64)
}

/// Bytes that a process can still allocate, as Linux estimates it; nothing on other systems.
fn available() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix(" kB")?.parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_fit_is_refused_with_its_size() {
        check_room(1 << 20, "a small picture").unwrap();
        let message = check_room(1 << 62, "a picture of 8 × 8").unwrap_err().to_string();
        assert!(message.starts_with("a picture of 8 × 8 takes 4294967296.0 GiB"), "{message}");
        assert!(message.contains("; use a smaller picture"), "{message}");
        assert!(check_room(u128::MAX, "x").is_err());
    }
}
