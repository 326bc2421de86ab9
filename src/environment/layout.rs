//! How a picture holds an environment: as a panorama, as the six faces of a cube beside each other, as an octahedral map, or in the tiles
//! of an atlas.
//!
//! A cross unfolds the cube around +Z; all faces stand as they are, only the −Z at the foot of a vertical one is turned
//! by 180°, so that it goes on where −Y ends. A strip is the six faces in their order.
//!
//! ```text
//! horizontal cross, 4:3     vertical cross, 3:4     strip, 6:1 (or 1:6, downwards)
//!       +Y                        +Y                +X −X +Y −Y +Z −Z
//!    −X +Z +X −Z               −X +Z +X
//!       −Y                        −Y
//!                                 −Z turned by 180°
//! ```

use std::fmt;

use serde::{Deserialize, Serialize};

use super::atlas;
use super::cube::Cube;
use crate::error::{Error, Result};

/// What an input is to be read as.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum InputLayout {
    /// What it looks like: a cube texture, six files that are named as faces, a cross or a strip by its proportions, an atlas by its
    /// packing, else a panorama.
    #[default]
    Auto,
    /// A panorama, whatever its proportions.
    Panorama,
    /// A horizontal (4:3) or vertical (3:4) cross.
    Cross,
    /// A horizontal (6:1) or vertical (1:6) strip.
    Strip,
    /// A cube texture, or six files.
    Cube,
    /// One square, as [`octahedral`](super::octahedral) lays it out. A square picture does not say that it is one, so this must.
    Octahedral,
    /// PlayCanvas' [`atlas`], of which the largest mirror is read. Codes that do not say what they are, are RGBP.
    Atlas,
}

/// What an input was read as.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// An equirectangular panorama, or a built-in environment.
    #[default]
    Panorama,
    /// Six faces in a KTX2.
    CubeTexture,
    /// Six files.
    SixFiles,
    /// A picture of 4:3.
    HorizontalCross,
    /// A picture of 3:4.
    VerticalCross,
    /// A picture of 6:1.
    HorizontalStrip,
    /// A picture of 1:6.
    VerticalStrip,
    /// An octahedral map.
    Octahedral,
    /// The mirror in PlayCanvas' atlas.
    Atlas,
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Panorama => "panorama",
            Self::CubeTexture => "cube texture",
            Self::SixFiles => "cube of six files",
            Self::HorizontalCross => "horizontal cross",
            Self::VerticalCross => "vertical cross",
            Self::HorizontalStrip => "horizontal strip",
            Self::VerticalStrip => "vertical strip",
            Self::Octahedral => "octahedral map",
            Self::Atlas => "atlas",
        })
    }
}

/// What a picture of this size is. [`Layout::Panorama`] includes what is nothing in particular.
///
/// **Errors**: a cross, a strip, an octahedral map or an atlas that is asked for and cannot be one.
pub fn layout_of(width: usize, height: usize, asked: InputLayout) -> Result<Layout> {
    let is = |layout: Layout| {
        cells(layout).is_some_and(|(columns, rows, _)| face_size(width, height, columns, rows).is_some())
    };
    let crosses = [Layout::HorizontalCross, Layout::VerticalCross];
    let strips = [Layout::HorizontalStrip, Layout::VerticalStrip];
    let among = |layouts: &[Layout]| layouts.iter().copied().find(|&layout| is(layout));
    let wrong = |wanted: &str| {
        Err(Error::invalid(
            format!("a picture of {width} × {height} is no {wanted} of square faces"),
            "crop it, or use --input-layout panorama",
        ))
    };
    match asked {
        InputLayout::Panorama => Ok(Layout::Panorama),
        InputLayout::Auto => Ok(among(&crosses).or(among(&strips)).unwrap_or_default()),
        InputLayout::Cross => among(&crosses).map_or_else(|| wrong("cross (4:3 or 3:4)"), Ok),
        InputLayout::Strip => among(&strips).map_or_else(|| wrong("strip (6:1 or 1:6)"), Ok),
        InputLayout::Octahedral if width == height => Ok(Layout::Octahedral),
        InputLayout::Octahedral => Err(Error::invalid(
            format!("a picture of {width} × {height}, where an octahedral map is square"),
            "crop it, or use --input-layout panorama",
        )),
        InputLayout::Atlas if [width, height] == [atlas::EDGE; 2] => Ok(Layout::Atlas),
        InputLayout::Atlas => Err(Error::invalid(
            format!("a picture of {width} × {height}, where PlayCanvas' atlas is {0} × {0}", atlas::EDGE),
            "give the whole atlas, or use --input-layout panorama",
        )),
        InputLayout::Cube => Err(Error::usage(
            format!("one picture of {width} × {height}, where a cube texture or six files are wanted"),
            "name one of six files (sky_px.hdr), use a pattern (sky_%s.hdr), or --input-layout cross or strip",
        )),
    }
}

/// Columns and rows of cells, and the cell (column, row) of each face in storage order.
type Cells = (usize, usize, [(usize, usize); 6]);

/// Where the faces are in a picture; nothing for what is no picture of six faces.
fn cells(layout: Layout) -> Option<Cells> {
    match layout {
        Layout::HorizontalCross => Some((4, 3, [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (3, 1)])),
        Layout::VerticalCross => Some((3, 4, [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (1, 3)])),
        Layout::HorizontalStrip => Some((6, 1, [0, 1, 2, 3, 4, 5].map(|i| (i, 0)))),
        Layout::VerticalStrip => Some((1, 6, [0, 1, 2, 3, 4, 5].map(|i| (0, i)))),
        Layout::Panorama | Layout::CubeTexture | Layout::SixFiles | Layout::Octahedral | Layout::Atlas => None,
    }
}

/// Texels along an edge of a cell, if the cells are square and fill the picture.
fn face_size(width: usize, height: usize, columns: usize, rows: usize) -> Option<usize> {
    let size = width / columns;
    (size > 0 && size.checked_mul(columns) == Some(width) && size.checked_mul(rows) == Some(height)).then_some(size)
}

/// The cube in a cross or a strip, whose rows `texels` are; nothing for other layouts.
pub(super) fn unfold(texels: &[[f32; 3]], width: usize, layout: Layout) -> Option<Cube> {
    let (columns, rows, cells) = cells(layout)?;
    let size = face_size(width, texels.len() / width, columns, rows)?;
    let mut faces = Vec::with_capacity(6 * size * size);
    for (face, (column, row)) in cells.into_iter().enumerate() {
        let line = |y: usize| &texels[(row * size + y) * width + column * size..][..size];
        if layout == Layout::VerticalCross && face == 5 {
            faces.extend((0..size).rev().flat_map(|y| line(y).iter().rev()));
        } else {
            faces.extend((0..size).flat_map(line));
        }
    }
    Some(Cube { size, texels: faces })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_are_known_by_their_proportions() {
        let layout = |w, h| layout_of(w, h, InputLayout::Auto).unwrap();
        assert_eq!(layout(16, 12), Layout::HorizontalCross);
        assert_eq!(layout(12, 16), Layout::VerticalCross);
        assert_eq!(layout(24, 4), Layout::HorizontalStrip);
        assert_eq!(layout(1, 6), Layout::VerticalStrip);
        for (w, h) in [(16, 8), (5, 3), (100, 60), (333, 200), (16, 16), (0, 0), (1, 1)] {
            assert_eq!(layout(w, h), Layout::Panorama);
        }
        assert_eq!(layout_of(16, 12, InputLayout::Panorama).unwrap(), Layout::Panorama);
    }

    #[test]
    fn layouts_that_cannot_be_say_what_they_should_be() {
        for (asked, wanted) in
            [(InputLayout::Cross, "4:3 or 3:4"), (InputLayout::Strip, "6:1 or 1:6"), (InputLayout::Cube, "six files")]
        {
            let message = layout_of(16, 8, asked).unwrap_err().to_string();
            assert!(message.contains("16 × 8") && message.contains(wanted) && message.contains("; "), "{message}");
        }
    }

    /// Crosses go on from face to face: where two cells touch, the directions of their edges are the same.
    #[test]
    fn neighbouring_cells_of_a_cross_meet_in_the_same_directions() {
        use super::super::cube::face_point;
        let point = |layout: Layout, face: usize, u: f64, v: f64| {
            let turned = layout == Layout::VerticalCross && face == 5;
            if turned { face_point(face, -u, -v) } else { face_point(face, u, v) }
        };
        for layout in [Layout::HorizontalCross, Layout::VerticalCross] {
            let (_, _, cells) = cells(layout).unwrap();
            let mut seams = 0;
            for (a, (x, y)) in cells.into_iter().enumerate() {
                for (b, other) in cells.into_iter().enumerate() {
                    for t in [-0.7, 0.2, 0.9] {
                        let pair = if other == (x + 1, y) {
                            (point(layout, a, 1.0, t), point(layout, b, -1.0, t))
                        } else if other == (x, y + 1) {
                            (point(layout, a, t, 1.0), point(layout, b, t, -1.0))
                        } else {
                            continue;
                        };
                        assert_eq!(pair.0, pair.1, "{layout}: faces {a} and {b}");
                        seams += 1;
                    }
                }
            }
            assert_eq!(seams, 15, "{layout}: five seams, three points each");
        }
    }
}
