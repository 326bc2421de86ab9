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

/// Rings along a column, and its texels' places among them.
#[derive(Default)]
struct Meridian {
    /// The first ring.
    low: isize,
    places: [Place; BAND],
    values: Vec<[f64; 4]>,
}

impl Meridian {
    /// For texels at θ/π, which grow from one to the next.
    #[inline(always)]
    fn place(&mut self, rings: &Rings, factor: f64, thetas: &[f64]) {
        self.low = rings.rings_at(thetas[0]).0;
        let mut high = self.low;
        for (theta, place) in thetas.iter().zip(&mut self.places) {
            let (ring, weights) = rings.rings_at(*theta);
            *place = Place { first: (ring - self.low) as usize, weights: weights.map(|weight| factor * weight) };
            high = ring;
        }
        self.values.resize((high - self.low) as usize + TAPS, [0.0; 4]);
    }

    /// Adds the values at a turn.
    #[inline(always)]
    fn add(&mut self, rings: &Rings, turn: f64, values: &mut [[f64; 3]]) {
        rings.along_meridian(turn, self.low, &mut self.values);
        for (place, value) in self.places.iter().zip(values) {
            let mut sum = [0.0; 4];
            let taps = &self.values[place.first..place.first + TAPS];
            for (weight, tap) in place.weights.iter().zip(taps) {
                (0..4).for_each(|c| sum[c] += weight * tap[c]);
            }
            (0..3).for_each(|c| value[c] += sum[c]);
        }
    }
}

/// Fills rows from `first` on of the four faces of a cube with a sum of rings, each times a factor; `finish` adds to a column what rings do not hold.
#[inline(always)]
pub(super) fn fill_band(
    rings: &[(&Rings, f64)],
    size: usize,
    first: usize,
    faces: &mut [Rows; 4],
    mut finish: impl FnMut(Column),
) {
    let n = faces[0].len() / size;
    let mut meridians: Vec<Meridian> = rings.iter().map(|_| Meridian::default()).collect();
    let mut lengths = [0.0; BAND];
    let (mut directions, mut values) = ([DVec3::ZERO; BAND], [[0.0; 3]; BAND]);
    for column in 0..size.div_ceil(2) {
        let u = centre(size, column);
        let rows = first..first + n;
        let mut thetas = [0.0; BAND];
        for ((row, theta), length) in rows.clone().zip(&mut thetas).zip(&mut lengths) {
            let v = centre(size, row);
            *theta = libm::atan2((1.0 + u * u).sqrt(), -v) / PI;
            *length = 1.0 / (1.0 + u * u + v * v).sqrt();
        }
        for (meridian, (rings, factor)) in meridians.iter_mut().zip(rings) {
            meridian.place(rings, *factor, &thetas[..n]);
        }
        let mirrored = size - 1 - column;
        for column in [column, mirrored].into_iter().take(if mirrored == column { 1 } else { 2 }) {
            let u = centre(size, column);
            // On each face the azimuth falls as u grows.
            let turn = -libm::atan2(u, 1.0) / TAU;
            for ((face, middle), out) in SIDES.into_iter().zip(faces.iter_mut()) {
                values[..n].fill([0.0; 3]);
                for (meridian, (rings, _)) in meridians.iter_mut().zip(rings) {
                    meridian.add(rings, middle + turn, &mut values[..n]);
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
