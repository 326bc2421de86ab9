//! Lat-long maps as outputs: panoramas of N rows and 2 N columns, as [`super::panorama`] lays them out, alone or within a border.
//!
//! u = ½ + atan2(d.z, d.x)/2π and v = acos(d.y)/π of the direction that is looked up. Turned about its axis or upside down, a texel of
//! one panorama is still a box of azimuth and height in another, so that averages are sums of overlaps, exact in closed form; turned
//! otherwise it is bounded by small circles, which Kiln does not do.
//!
//! A border of one texel repeats what lies beyond: the other end of the row, and beyond a pole the other side of it. A sampler that
//! blends four texels then never leaves the map. Of 2 N × N texels it leaves the panorama 2 N − 2 × N − 2.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::orientation::Orientation;
use super::panorama::{Panorama, row_edges, row_solid_angle};
use super::sphere_map::SphereMap;
use crate::error::{Error, Result};

/// Columns and rows of the panorama in a map of `size` rows.
pub(super) fn inner(size: usize, border: usize) -> [usize; 2] {
    [2 * size, size].map(|n| n.saturating_sub(2 * border))
}

/// Where the panorama's first column and row begin, counted from the centres of the map's first.
fn start(border: usize) -> f64 {
    border as f64 - 0.5
}

/// Unit direction at a column and a row, counted from the centres of the first; in the border it is that of what is repeated there.
pub(super) fn direction_at(size: usize, border: usize, at: [f64; 2]) -> DVec3 {
    let ([width, height], [column, row]) = (inner(size, border), at.map(|t| t - start(border)));
    let phi = TAU * column / width as f64 - PI;
    let (sin, cos) = (PI * row / height as f64).sin_cos();
    DVec3::new(sin * phi.cos(), cos, sin * phi.sin())
}

/// Where a direction of any length lies: column and row, counted from the centres of the first.
pub(super) fn locate(size: usize, border: usize, direction: DVec3) -> [f64; 2] {
    let [width, height] = inner(size, border);
    let u = 0.5 + direction.z.atan2(direction.x) / TAU;
    let v = direction.x.hypot(direction.z).atan2(direction.y) / PI;
    [u * width as f64 + start(border), v * height as f64 + start(border)]
}

/// The texel at a column and a row that may be one beyond the map: around the world, and no farther than the poles. (Of a map within a
/// border nothing is looked for beyond it.)
pub(super) fn texel(size: usize, column: isize, row: isize) -> usize {
    let (n, width) = (size as isize, 2 * size as isize);
    (row.clamp(0, n - 1) * width + column.rem_euclid(width)) as usize
}

/// Solid angle per texel at a row.
pub(super) fn density(size: usize, border: usize, row: f64) -> f64 {
    let [width, height] = inner(size, border).map(|n| n as f64);
    TAU / width * PI / height * (PI * (row - start(border)) / height).sin().max(0.0)
}

/// Whether a texel only repeats another.
pub(super) fn is_border(size: usize, border: usize, index: usize) -> bool {
    let (column, row) = (index % (2 * size), index / (2 * size));
    !(border..2 * size - border).contains(&column) || !(border..size - border).contains(&row)
}

/// Column and row of the panorama's texel that a texel of the map holds, or repeats.
fn source(size: usize, border: usize, index: usize) -> [usize; 2] {
    let [width, height] = inner(size, border).map(|n| n as isize);
    let [column, row] = [index % (2 * size), index / (2 * size)].map(|t| t as isize - border as isize);
    let beyond = if (0..height).contains(&row) { 0 } else { width / 2 };
    [(column + beyond).rem_euclid(width) as usize, row.clamp(0, height - 1) as usize]
}

/// Solid angles of the texels, row by row: those of a border count for nothing.
pub(super) fn solid_angles(size: usize, border: usize) -> Vec<f64> {
    let [width, height] = inner(size, border);
    let of_row = |row: usize| row_solid_angle(width, height, row - border);
    (0..2 * size * size).map(|i| if is_border(size, border, i) { 0.0 } else { of_row(i / (2 * size)) }).collect()
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

/// A panorama averaged over the exact solid angle of each texel of a map of `size` rows, turned. A constant comes out as exactly its
/// constant, and the flux is conserved to rounding.
///
/// **Errors**: see [`check_orientation`].
pub(super) fn area_average(
    panorama: &Panorama,
    size: usize,
    border: usize,
    orientation: &Orientation,
) -> Result<Vec<[f32; 3]>> {
    let [width, height] = inner(size, border);
    let texels = averages(panorama, [width, height], orientation)?;
    if border == 0 {
        return Ok(texels);
    }
    let texel = |i: usize| {
        let [column, row] = source(size, border, i);
        texels[row * width + column]
    };
    Ok((0..2 * size * size).map(texel).collect())
}

/// The panorama in a map.
///
/// **Errors**: see [`Panorama::new`].
pub(super) fn to_panorama(map: &SphereMap, border: usize) -> Result<Panorama> {
    let [width, height] = inner(map.size, border);
    let inside = map.texels.iter().enumerate().filter(|(i, _)| !is_border(map.size, border, *i));
    Panorama::new(width, height, inside.map(|(_, texel)| *texel).collect())
}

/// Such averages over the texels of a panorama of any number of columns and rows.
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
    use super::super::sphere_map::SphereLayout;
    use super::super::test_maps::{random, random_sized};
    use super::*;

    fn map(panorama: &Panorama, layout: SphereLayout, size: usize, turn: &str) -> Result<SphereMap> {
        SphereMap::area_average(panorama, layout, size, &turn.parse().unwrap())
    }

    #[test]
    fn the_same_size_is_the_same_panorama() {
        let panorama = random(32, 3, Some((5, 4)));
        let map = map(&panorama, SphereLayout::Equirect, 16, "x,y,z").unwrap();
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
                let map = map(&panorama, SphereLayout::Equirect, size, turn).unwrap();
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
            let map = map(&panorama, SphereLayout::Equirect, 24, turn).unwrap();
            for (i, texel) in map.texels.iter().enumerate() {
                let wanted = panorama.radiance(orientation.world(map.layout.direction(24, i)));
                assert!((texel[0] - wanted[0]).abs() < 1e-6, "{turn}, {i}: {texel:?}, wanted {wanted:?}");
            }
        }
        let white = Panorama::new(5, 3, vec![[1.0; 3]; 15]).unwrap();
        let seven = map(&white, SphereLayout::Equirect, 7, "x,y,z").unwrap();
        assert!(seven.texels.iter().flatten().all(|&v| v == 1.0));
        assert!(map(&white, SphereLayout::Equirect, 7, "x,z,y").is_err());
    }

    /// The border is what the panorama has there, so that a blend of four texels is that of a panorama without end.
    #[test]
    fn a_border_repeats_what_lies_in_its_directions() {
        for size in [4, 8, 33] {
            for i in 0..2 * size * size {
                let at = [i % (2 * size), i / (2 * size)].map(|k| k as f64);
                let inside = source(size, 1, i).map(|k| k as f64 + 1.0);
                let (here, there) = (direction_at(size, 1, at), direction_at(size, 1, inside));
                assert!((here - there).length() < 1e-14, "{size}: {at:?} repeats {inside:?}");
            }
        }
        let map = map(&random(64, 3, Some((20, 9))), SphereLayout::Atlas, 16, "-z,y,x").unwrap();
        for i in 0..60 {
            let y = 0.97 * (2.0 * f64::from(i) / 59.0 - 1.0);
            let across = (1.0 - y * y).sqrt();
            let [a, b] = [1e-9, -1e-9].map(|z| map.filtered(DVec3::new(-across, y, z))[0]);
            assert!((a / b - 1.0).abs() < 1e-5, "height {y}: {a}, {b} on the other side of the seam");
            let (sin, cos) = (f64::from(i) * 0.1).sin_cos();
            let [a, b] = [1e-9, -1e-9].map(|s| map.filtered(DVec3::new(s * cos, 1.0, s * sin))[0]);
            assert!((a / b - 1.0).abs() < 1e-5, "azimuth {i}: {a}, {b} on the other side of the pole");
        }
    }

    #[test]
    fn flux_within_a_border_is_conserved_and_comes_back() {
        let panorama = random(64, 5, Some((40, 12)));
        for size in [8, 32] {
            let map = map(&panorama, SphereLayout::Atlas, size, "-z,y,x").unwrap();
            let back = map.to_panorama().unwrap();
            for c in 0..3 {
                let wanted = panorama.mean()[c];
                assert!((map.mean()[c] / wanted - 1.0).abs() < 6e-8 && (back.mean()[c] / wanted - 1.0).abs() < 6e-8);
            }
        }
        for border in [0, 1] {
            let total: f64 = solid_angles(8, border).iter().sum();
            assert!((total / (4.0 * PI) - 1.0).abs() < 1e-14, "border {border}: {total}");
        }
    }
}
