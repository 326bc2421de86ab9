//! Containers: one file per file format, pure translation between bytes and [`Image`] or [`ktx2::Texture`].

pub mod atomic;
pub mod exr;
pub mod hdr;
pub mod ktx2;

/// A two-dimensional picture of named channels, linear, row 0 at the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Texels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Names of the channels, in the order in which they are interleaved.
    pub channels: Vec<String>,
    /// `height × width × channels` values, channel fastest.
    pub texels: Vec<f32>,
    /// Key/value pairs that the container carries (text attributes), in file order.
    pub metadata: Vec<(String, String)>,
}
