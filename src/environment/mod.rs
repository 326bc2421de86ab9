//! Environment maps.
