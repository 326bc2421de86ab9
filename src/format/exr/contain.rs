//! Turning panics of the `exr` crate into errors.
//!
//! On malformed files that crate (1.74) mostly returns errors, but in places it overflows or indexes out of bounds: some
//! of the mutated files in `tests/suite/malformed_files.rs` made it panic, and no check beforehand can know them all. It has no unsafe code and all that it owns is dropped, so that nothing is left in a bad state. (A build with
//! `panic = "abort"` loses this.)

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether this thread runs something whose panic is an answer.
    static CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// What `run` returns, or nothing if it panicked, of which no message is printed then.
pub(super) fn contained<T>(run: impl FnOnce() -> T) -> Option<T> {
    static QUIET: Once = Once::new();
    QUIET.call_once(|| {
        // The hook belongs to the whole process: everybody else's panics go on to the one that was there.
        let previous = take_hook();
        set_hook(Box::new(move |panic| {
            if !CONTAINED.get() {
                previous(panic);
            }
        }));
    });
    let outer = CONTAINED.replace(true);
    let result = catch_unwind(AssertUnwindSafe(run)).ok();
    CONTAINED.set(outer);
    result
}
