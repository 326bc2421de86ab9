//! The one error type of the crate.
//!
//! Four kinds, because four different people act on them: something Kiln cannot do (ask us), something wrong with the
//! input (mend the file or the request), the system refusing (mend the disk), a file whose values are wrong (bake it anew).
//! Every message says what was found and what the way out is.

use std::fmt;
use std::path::{Path, PathBuf};

/// What every fallible function of the crate returns.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why Kiln could not do what it was asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The request itself makes no sense: contradictory or out-of-domain parameters.
    #[error("{0}")]
    Usage(Problem),
    /// The input is well formed but needs something that Kiln does not have.
    #[error("{0}")]
    Unsupported(Problem),
    /// The input is not what it claims to be.
    #[error("{0}")]
    Invalid(Problem),
    /// The system refused to read or write.
    #[error("{}: {action} failed: {source}; {way_out}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was being done: `reading`, `writing`.
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
        /// What the user can do about it.
        way_out: &'static str,
    },
    /// A file was read, judged, and found wrong.
    #[error(
        "verification failed: {failed} of {total} checks; bake the file again, or see which value differs in the report"
    )]
    Verification {
        /// How many checks failed.
        failed: usize,
        /// How many were made.
        total: usize,
    },
}

/// What is wrong, and the way out: printed as `statement; way out`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// The thing, what was found and what was wanted, in lower case and without a full stop.
    pub statement: String,
    /// What to do about it, as an imperative.
    pub way_out: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.statement, self.way_out)
    }
}

impl Problem {
    fn new(statement: impl Into<String>, way_out: impl Into<String>) -> Self {
        Self { statement: statement.into(), way_out: way_out.into() }
    }
}

impl Error {
    /// A request that makes no sense.
    pub fn usage(statement: impl Into<String>, way_out: impl Into<String>) -> Self {
        Self::Usage(Problem::new(statement, way_out))
    }

    /// A well-formed input that needs something Kiln does not have.
    pub fn unsupported(statement: impl Into<String>, way_out: impl Into<String>) -> Self {
        Self::Unsupported(Problem::new(statement, way_out))
    }

    /// An input that is not what it claims to be.
    pub fn invalid(statement: impl Into<String>, way_out: impl Into<String>) -> Self {
        Self::Invalid(Problem::new(statement, way_out))
    }

    /// The system refused to read `path`.
    pub fn reading(path: &Path, source: std::io::Error) -> Self {
        let way_out = match source.kind() {
            std::io::ErrorKind::NotFound => "check the path",
            std::io::ErrorKind::PermissionDenied => "check that you may read it",
            std::io::ErrorKind::IsADirectory => "name a file in it",
            _ => "check that it is a readable file",
        };
        Self::Io { path: path.to_owned(), action: "reading", source, way_out }
    }

    /// The system refused to write `path`.
    pub fn writing(path: &Path, source: std::io::Error) -> Self {
        let way_out = match source.kind() {
            std::io::ErrorKind::StorageFull => "free some space; nothing was left under the final name",
            std::io::ErrorKind::PermissionDenied | std::io::ErrorKind::ReadOnlyFilesystem => {
                "choose a folder that you may write to"
            }
            _ => "check that the folder exists, is a folder and can be written to",
        };
        Self::Io { path: path.to_owned(), action: "writing", source, way_out }
    }

    /// The same error, its statement beginning with the file that it is about.
    pub fn in_file(self, path: &Path) -> Self {
        let named = |p: Problem| Problem { statement: format!("{}: {}", path.display(), p.statement), ..p };
        match self {
            Self::Usage(p) => Self::Usage(named(p)),
            Self::Unsupported(p) => Self::Unsupported(named(p)),
            Self::Invalid(p) => Self::Invalid(named(p)),
            other => other,
        }
    }

    /// The exit code of the command: 1 failed, 2 usage, 3 verification failed.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Verification { .. } => 3,
            _ => 1,
        }
    }
}
