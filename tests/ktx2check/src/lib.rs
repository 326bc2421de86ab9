//! Nothing: see `build.sh`.
