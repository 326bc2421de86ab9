//! The four faces of a cube beside the equator. Each of their columns looks along one meridian, and texels of the same row and column, or of its mirror
//! image, have the same θ in all of them: interpolation is across first, for all rows of a band, and then between rings, with weights
//! worked out once for eight texels.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::synthesis::{Rings, TAPS};
use crate::environment::cube::{centre, face_point};

/// Faces beside the equator, and (azimuth of their middle + π)/2π.
pub(super) const SIDES: [(usize, f64); 4] = [(0, 0.5), (1, 1.0), (4, 0.75), (5, 0.25)];

/// Rows of a band.
pub(super) const BAND: usize = 16;

/// Some rows of a face, one after the other.
pub(super) type Rows<'a> = &'a mut [[f32; 3]];

/// One column of a band.
pub(super) struct Column<'a> {
    pub directions: &'a [DVec3],
    /// What the rings say there.
    pub values: &'a mut [[f64; 3]],
}

/// A texel's rings, counted from the first that its column knows, and their weights.
#[derive(Clone, Copy, Default)]
struct Place {
    first: usize,
    weights: [f64; TAPS],
}

/// Fills rows from `first` on of the four faces of a cube; `finish` adds to a column what rings do not hold.
#[inline(always)]
pub(super) fn fill_band(
    rings: &Rings,
    size: usize,
    first: usize,
    faces: &mut [Rows; 4],
    mut finish: impl FnMut(Column),
) {
    let n = faces[0].len() / size;
    let mut meridian = vec![];
    let (mut places, mut lengths) = ([Place::default(); BAND], [0.0; BAND]);
    let (mut directions, mut values) = ([DVec3::ZERO; BAND], [[0.0; 3]; BAND]);
    for column in 0..size.div_ceil(2) {
        let u = centre(size, column);
        let rows = first..first + n;
        let theta = |row: usize| libm::atan2((1.0 + u * u).sqrt(), -centre(size, row)) / PI;
        // (θ grows from row to row.)
        let (low, _) = rings.rings_at(theta(first));
        let mut high = low;
        for ((row, place), length) in rows.clone().zip(&mut places).zip(&mut lengths) {
            let v = centre(size, row);
            let (ring, weights) = rings.rings_at(theta(row));
            *place = Place { first: (ring - low) as usize, weights };
            *length = 1.0 / (1.0 + u * u + v * v).sqrt();
            high = ring;
        }
        meridian.resize((high - low) as usize + TAPS, [0.0; 4]);
        let mirrored = size - 1 - column;
        for column in [column, mirrored].into_iter().take(if mirrored == column { 1 } else { 2 }) {
            let u = centre(size, column);
            // On each face the azimuth falls as u grows.
            let turn = -libm::atan2(u, 1.0) / TAU;
            for ((face, middle), out) in SIDES.into_iter().zip(faces.iter_mut()) {
                rings.along_meridian(middle + turn, low, &mut meridian);
                for (place, value) in places[..n].iter().zip(&mut values) {
                    let mut sum = [0.0; 4];
                    let taps = &meridian[place.first..place.first + TAPS];
                    for (weight, tap) in place.weights.iter().zip(taps) {
                        (0..4).for_each(|c| sum[c] += weight * tap[c]);
                    }
                    *value = [sum[0], sum[1], sum[2]];
                }
                for ((row, direction), length) in rows.clone().zip(&mut directions).zip(lengths) {
                    *direction = face_point(face, u, centre(size, row)) * length;
                }
                finish(Column { directions: &directions[..n], values: &mut values[..n] });
                for (value, row) in values[..n].iter().zip(out.chunks_exact_mut(size)) {
                    row[column] = value.map(|v| v as f32);
                }
            }
        }
    }
}
