//! `builtin:orientation`: a room whose six walls say which way they lie.
//!
//! Seen from inside, as a camera at the origin of a right-handed world with +Y up sees it, every wall reads the right way round:
//! its name in large letters, an arrow to the right and an arrow upwards, each with the name of the axis that it points along. Red
//! is X, green Y, blue Z; a wall on the negative side is darker. A baked cube that shows the names mirrored, or a wall in the wrong
//! place, is turned wrongly.

use glam::DVec3;

use super::cube::FACES;
use super::panorama::{Panorama, TexelBox};
use crate::error::Result;

/// A wall as a viewer inside sees it.
struct Wall {
    right: DVec3,
    up: DVec3,
    towards: DVec3,
}

/// The axes in storage order.
const AXES: [DVec3; 6] = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];

impl Wall {
    /// The ceiling and the floor are seen by somebody who looks along −Z and then up or down.
    fn of(face: usize) -> Self {
        let towards = AXES[face];
        let up = match face {
            2 => DVec3::Z,
            3 => DVec3::NEG_Z,
            _ => DVec3::Y,
        };
        Self { right: towards.cross(up), up, towards }
    }
}

/// Name of an axis, such as `+X`, and its number.
fn axis(direction: DVec3) -> usize {
    AXES.iter().position(|axis| axis.dot(direction) > 0.5).unwrap_or_default()
}

/// Colour of an axis: red, green and blue for X, Y and Z; darker on the negative side.
fn colour(axis: usize) -> [f64; 3] {
    let strength = if axis.is_multiple_of(2) { 1.0 } else { 0.4 };
    let mut colour = [0.02; 3];
    colour[axis / 2] = strength;
    colour
}

/// Letters of 5 × 7 dots, a row a number, its highest bit of five to the left.
fn letter(name: u8) -> [u8; 7] {
    match name {
        b'+' => [0b00000, 0b00100, 0b00100, 0b11111, 0b00100, 0b00100, 0b00000],
        b'-' => [0b00000, 0b00000, 0b00000, 0b11111, 0b00000, 0b00000, 0b00000],
        b'X' => [0b10001, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001, 0b10001],
        b'Y' => [0b10001, 0b10001, 0b01010, 0b00100, 0b00100, 0b00100, 0b00100],
        _ => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b11111],
    }
}

/// Whether (a to the right, b up) is on a dot of a name of two letters around `centre`, its dots `dot` wide.
fn in_name(name: &str, centre: [f64; 2], dot: f64, [a, b]: [f64; 2]) -> bool {
    let (column, row) = (((a - centre[0]) / dot + 5.5).floor(), (3.5 - (b - centre[1]) / dot).floor());
    if !(0.0..11.0).contains(&column) || !(0.0..7.0).contains(&row) {
        return false;
    }
    let (column, row) = (column as usize, row as usize);
    let (place, column) = (column / 6, column % 6);
    column < 5 && letter(name.as_bytes()[place])[row] >> (4 - column) & 1 == 1
}

/// Whether (along the arrow, across it) is on an arrow from −0.5 to 0.5.
fn in_arrow(along: f64, across: f64) -> bool {
    let shaft = (-0.5..=0.38).contains(&along) && across.abs() < 0.025;
    let head = (0.38..=0.5).contains(&along) && across.abs() < 0.09 * (0.5 - along) / 0.12;
    shaft || head
}

/// Radiance in a direction.
fn radiance(direction: DVec3) -> [f64; 3] {
    const WHITE: [f64; 3] = [1.0; 3];
    const FRAME: [f64; 3] = [0.1; 3];
    let face = axis_of(direction);
    let wall = Wall::of(face);
    let depth = direction.dot(wall.towards);
    let at = [direction.dot(wall.right) / depth, direction.dot(wall.up) / depth];
    let [a, b] = at;
    let (right, up) = (axis(wall.right), axis(wall.up));
    if in_name(FACES[face], [0.0, 0.08], 0.085, at) {
        WHITE
    } else if in_arrow(a, b + 0.55) || in_name(FACES[right], [0.0, -0.72], 0.022, at) {
        colour(right)
    } else if in_arrow(b, a + 0.72) || in_name(FACES[up], [-0.86, 0.0], 0.022, at) {
        colour(up)
    } else if a.abs().max(b.abs()) > 0.97 {
        FRAME
    } else {
        // Halved so that letters and arrows of the wall's own colour stand out.
        colour(face).map(|v| 0.3 * v + 0.05)
    }
}

/// The wall that a direction meets.
fn axis_of(direction: DVec3) -> usize {
    (0..6).max_by(|&a, &b| direction.dot(AXES[a]).total_cmp(&direction.dot(AXES[b]))).unwrap_or_default()
}

/// Points along each edge of a texel that its radiance is averaged over.
const POINTS: usize = 4;

/// The room as a panorama.
pub(super) fn orientation(width: usize) -> Result<Panorama> {
    Panorama::from_fn(width, |texel: TexelBox| {
        let mut sum = [0.0; 3];
        for (i, j) in (0..POINTS).flat_map(|i| (0..POINTS).map(move |j| (i, j))) {
            let between = |[low, high]: [f64; 2], k: usize| low + (high - low) * (k as f64 + 0.5) / POINTS as f64;
            let (phi, y) = (between(texel.phi, i), between(texel.y, j));
            let r = crate::math::frame::sine_of_cosine(y);
            let seen = radiance(DVec3::new(r * phi.cos(), y, r * phi.sin()));
            (0..3).for_each(|c| sum[c] += seen[c]);
        }
        sum.map(|v| v / (POINTS * POINTS) as f64)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wall_reads_the_right_way_round_for_a_viewer_inside() {
        for (face, name) in FACES.into_iter().enumerate() {
            let wall = Wall::of(face);
            // A right-handed viewer: right × up points back at the eye.
            assert_eq!(wall.right.cross(wall.up), -wall.towards, "{name}");
            // The letter, read dot by dot from left to right and from top to bottom, is the font's.
            for (place, byte) in name.bytes().enumerate() {
                for (row, bits) in letter(byte).into_iter().enumerate() {
                    for column in 0..5 {
                        let a = 0.085 * (6.0 * place as f64 + f64::from(column) + 0.5 - 5.5);
                        let b = 0.08 + 0.085 * (3.0 - row as f64);
                        let direction = wall.towards + a * wall.right + b * wall.up;
                        let white = radiance(direction.normalize()) == [1.0; 3];
                        assert_eq!(white, bits >> (4 - column) & 1 == 1, "{name}: letter {place}, {column}, {row}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_arrows_point_along_the_axes_that_they_name() {
        for (face, name) in FACES.into_iter().enumerate() {
            let wall = Wall::of(face);
            let tip = wall.towards + 0.45 * wall.right - 0.55 * wall.up;
            assert_eq!(radiance(tip.normalize()), colour(axis(wall.right)), "{name}: to the right");
            let tip = wall.towards - 0.72 * wall.right + 0.45 * wall.up;
            assert_eq!(radiance(tip.normalize()), colour(axis(wall.up)), "{name}: upwards");
        }
        // What is to the right on one wall is the next wall.
        assert_eq!(FACES[axis(Wall::of(5).right)], "+X");
        assert_eq!(FACES[axis(Wall::of(0).right)], "+Z");
    }
}
