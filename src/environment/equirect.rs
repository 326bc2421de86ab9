//! Lat-long maps as outputs: panoramas of N rows and 2 N columns, as [`super::panorama`] lays them out.
//!
//! u = ½ + atan2(d.z, d.x)/2π and v = acos(d.y)/π of the direction that is looked up. Turned about its axis or upside down, a texel of
//! one panorama is still a box of azimuth and height in another, so that averages are sums of overlaps, exact in closed form; turned
//! otherwise it is bounded by small circles, which Kiln does not do.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::orientation::Orientation;
use super::panorama::{Panorama, row_edges, row_solid_angle};
use super::sphere_map::{SphereLayout, SphereMap};
use crate::error::{Error, Result};

/// Unit direction at a column and a row, counted from the centres of the first.
pub(super) fn direction_at(size: usize, [column, row]: [f64; 2]) -> DVec3 {
    let phi = TAU * (column + 0.5) / (2 * size) as f64 - PI;
    let (sin, cos) = (PI * (row + 0.5) / size as f64).sin_cos();
    DVec3::new(sin * phi.cos(), cos, sin * phi.sin())
}

/// Where a direction of any length lies: column and row, counted from the centres of the first.
pub(super) fn locate(size: usize, direction: DVec3) -> [f64; 2] {
    let u = 0.5 + direction.z.atan2(direction.x) / TAU;
    let v = direction.x.hypot(direction.z).atan2(direction.y) / PI;
    [u * (2 * size) as f64 - 0.5, v * size as f64 - 0.5]
}

/// The texel at a column and a row that may be one beyond the border: around the world, and no farther than the poles.
pub(super) fn texel(size: usize, column: isize, row: isize) -> usize {
    let (n, width) = (size as isize, 2 * size as isize);
    (row.clamp(0, n - 1) * width + column.rem_euclid(width)) as usize
}

/// Solid angles of the texels, row by row.
pub fn solid_angles(size: usize) -> Vec<f64> {
    (0..size).flat_map(|row| std::iter::repeat_n(row_solid_angle(2 * size, size, row), 2 * size)).collect()
}

/// Whether texels of a panorama that is turned so are boxes of the world's azimuth and height.
///
/// **Errors**: they are not.
pub fn check_orientation(orientation: &Orientation) -> Result<()> {
    if orientation.world(DVec3::Y).y != 0.0 {
        return Ok(());
    }
    Err(Error::unsupported(
        format!("a panorama of orientation {orientation}, whose poles are not up and down"),
        "use an orientation with y in its place, such as z,y,-x, or --layout octahedral",
    ))
}

/// What of some intervals of equal width another interval overlaps: which, and how much of it in parts of the whole.
fn overlaps([low, high]: [f64; 2], edges: impl Fn(usize) -> f64, around: Range<usize>) -> Vec<(usize, f64)> {
    let part = |i: usize| ((edges(i + 1).min(high) - edges(i).max(low)) / (high - low)).max(0.0);
    around.map(|i| (i, part(i))).filter(|(_, part)| *part > 0.0).collect()
}

/// A panorama averaged over the exact solid angle of each texel of one of `size` rows, turned. A constant comes out as exactly its
/// constant, and the flux is conserved to rounding.
///
/// **Errors**: see [`check_orientation`].
pub fn area_average(panorama: &Panorama, size: usize, orientation: &Orientation) -> Result<SphereMap> {
    let texels = averages(panorama, [2 * size, size], orientation)?;
    Ok(SphereMap { layout: SphereLayout::Equirect, size, texels })
}

/// The same of any number of columns and rows.
pub(super) fn averages(
    panorama: &Panorama,
    [n_columns, n_rows]: [usize; 2],
    orientation: &Orientation,
) -> Result<Vec<[f32; 3]>> {
    check_orientation(orientation)?;
    let (width, height, mean) = (panorama.width(), panorama.height(), panorama.mean());
    // The azimuth that is looked up, φ, is the world's start + sign φ; columns are counted over two turns, so that none wraps.
    let start = orientation.world(DVec3::X);
    let start = start.z.atan2(start.x);
    let quarter = orientation.world(DVec3::Z);
    let sign = if (quarter.z.atan2(quarter.x) - start).sin() > 0.0 { 1.0 } else { -1.0 };
    let column = |i: usize| {
        let phi = |i: usize| TAU * i as f64 / n_columns as f64 - PI;
        let mut at = [phi(i), phi(i + 1)].map(|phi| (start + sign * phi + PI) / TAU);
        at.sort_by(f64::total_cmp);
        let turns = at[0].floor();
        let at = at.map(|t| (t - turns) * width as f64);
        // One more on either side, against rounding; what does not overlap counts for nothing.
        let around = (at[0] as usize).saturating_sub(1)..at[1] as usize + 2;
        let found = overlaps(at, |i| i as f64, around);
        found.into_iter().map(|(i, part)| (i % width, part)).collect::<Vec<_>>()
    };
    let columns: Vec<Vec<(usize, f64)>> = (0..n_columns).map(column).collect();
    let below = orientation.world(DVec3::Y).y < 0.0;
    let (ours, theirs) = (row_edges(n_rows), panorama.row_edges());
    let row = |i: usize| {
        // Downwards, as rows are counted; edges mirror each other.
        let [top, bottom] = if below { [-ours[i + 1], -ours[i]] } else { [ours[i], ours[i + 1]] };
        let guess = |y: f64| ((1.0 - y * y).max(0.0).sqrt().atan2(y) / PI * height as f64) as usize;
        let around = guess(top).saturating_sub(1)..(guess(bottom) + 2).min(height);
        overlaps([-top, -bottom], |i| -theirs[i], around)
    };
    let (low, high) = (panorama.min(), panorama.max());
    let line = |i: usize| {
        let mut sums = vec![[0.0; 3]; n_columns];
        for (row, part) in row(i) {
            let texels = panorama.row(row);
            for (sum, column) in sums.iter_mut().zip(&columns) {
                for &(at, share) in column {
                    (0..3).for_each(|c| sum[c] += part * share * (f64::from(texels[at][c]) - mean[c]));
                }
            }
        }
        // An average lies between the extremes; the clamp only keeps rounding from leaving them.
        let value = |sum: [f64; 3]| std::array::from_fn(|c| ((mean[c] + sum[c]) as f32).clamp(low[c], high[c]));
        sums.into_iter().map(value).collect::<Vec<[f32; 3]>>()
    };
    Ok((0..n_rows).into_par_iter().flat_map_iter(line).collect())
}

#[cfg(test)]
mod tests {
    use super::super::test_maps::{random, random_sized};
    use super::*;

    #[test]
    fn the_same_size_is_the_same_panorama() {
        let panorama = random(32, 3, Some((5, 4)));
        let map = area_average(&panorama, 16, &Orientation::default()).unwrap();
        // Weights of overlaps add up to one but for rounding, of f64 values up to a sun's.
        for (a, b) in map.texels.as_flattened().iter().zip(panorama.texels().as_flattened()) {
            assert!((a - b).abs() <= 1e-6 * b.abs().max(1e-3), "{a}, wanted {b}");
        }
    }

    #[test]
    fn flux_is_conserved_however_it_is_turned() {
        let turns = ["x,y,z", "z,y,-x", "-x,y,z", "x,-y,z", "-z,-y,x", "x,y,-z"];
        for ([width, height], size) in [([16, 8], 5), ([33, 20], 8), ([5, 3], 16), ([4, 2], 1), ([100, 60], 7)] {
            let panorama = random_sized([width, height], 3, Some((width / 3, 2 * height / 5)));
            for turn in turns {
                let map = area_average(&panorama, size, &turn.parse().unwrap()).unwrap();
                let (got, wanted) = (map.mean()[0], panorama.mean()[0]);
                assert!((got / wanted - 1.0).abs() < 6e-8, "{width} × {height} → {size}, {turn}: {got}, {wanted}");
            }
        }
    }

    #[test]
    fn texels_hold_what_is_in_the_direction_that_is_looked_up() {
        // Finer than the panorama: each texel lies within one of its texels, or across an edge.
        let panorama = random(16, 9, None);
        for turn in ["x,y,z", "z,y,-x", "-x,y,z", "x,-y,z", "-z,-y,-x"] {
            let orientation: Orientation = turn.parse().unwrap();
            let map = area_average(&panorama, 24, &orientation).unwrap();
            for (i, texel) in map.texels.iter().enumerate() {
                let wanted = panorama.radiance(orientation.world(map.layout.direction(24, i)));
                assert!((texel[0] - wanted[0]).abs() < 1e-6, "{turn}, {i}: {texel:?}, wanted {wanted:?}");
            }
        }
        let white = Panorama::new(5, 3, vec![[1.0; 3]; 15]).unwrap();
        let map = area_average(&white, 7, &Orientation::default()).unwrap();
        assert!(map.texels.iter().flatten().all(|&v| v == 1.0));
        assert!(area_average(&white, 7, &"x,z,y".parse().unwrap()).is_err());
    }
}
