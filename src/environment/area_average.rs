//! Mip 0 of a cube map: the exact average of the panorama over each texel's solid angle.
//!
//! In φ and y = d.y area is preserved, so the integral of radiance over a texel is, by Green's theorem, ∮ P(φ, y) dφ
//! around it, with P(φ, y) = ∫_y^1 L(φ, y′) dy′: each edge of the texel contributes the wedge between itself and the
//! pole. P is linear in y within a panorama texel; where the edges cross those is known in `overlap.rs`.
//! Meridians have dφ = 0 and contribute nothing. Each edge is integrated once for the two texels that share it, so no
//! flux is lost or counted twice. The −Y face is the +Y face of the panorama mirrored in y.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use super::cube::{Cube, edge, solid_angles};
use super::overlap::{CENTRES, Circle, Grid, Part, cap_rows, top_circle};
use super::panorama::Panorama;
use super::zonal::InstructionSet;

/// The panorama averaged over the exact solid angle of each texel of a cube of this size. A constant panorama comes out
/// as exactly its constant, and the flux is conserved to rounding.
pub fn area_average(panorama: &Panorama, size: usize) -> Cube {
    average_by(panorama, size, InstructionSet::detect())
}

fn average_by(panorama: &Panorama, size: usize, instructions: InstructionSet) -> Cube {
    let (mean, height) = (panorama.mean(), panorama.height());
    let wedges = |rows: usize, mirrored: bool| Wedges::new(panorama, mean, rows, mirrored, instructions);
    let angles = solid_angles(size);
    // An average lies between the extremes. The clamp only keeps rounding (1e-16 of the flux in a column) from making
    // black negative beside a sun.
    let (low, high) = (panorama.min(), panorama.max());
    let average = |residual: [f64; 3], angle: f64| -> [f32; 3] {
        std::array::from_fn(|c| ((mean[c] + residual[c] / angle) as f32).clamp(low[c], high[c]))
    };
    let mut texels = vec![[0.0f32; 3]; 6 * size * size];
    let at_pole = |lines: &[PoleLine], face: usize, texels: &mut [[f32; 3]]| {
        let rows = texels[face * size * size..][..size * size].par_chunks_mut(size).enumerate();
        rows.for_each(|(row, out)| {
            let angles = &angles[row * size..][..size];
            // The face below is the one above of the panorama in the mirror.
            let row = if face == 3 { size - 1 - row } else { row };
            let (above, below) = (&lines[row][1], &lines[row + 1][1]);
            for (column, (out, angle)) in out.iter_mut().zip(angles).enumerate() {
                let across = subtract(lines[column + 1][0][row], lines[column][0][row]);
                let down = subtract(above[column], below[column]);
                *out = average(std::array::from_fn(|c| across[c] + down[c]), *angle);
            }
        });
    };
    // One set of wedges at a time, and one of lines: they are larger than the panorama. Rows mirror each other: so do the arcs around the
    // poles.
    let south = wedges(cap_rows(height), true);
    let arcs = pole_arcs(&south.grid, size);
    at_pole(&pole_lines(&south, size, &arcs), 3, &mut texels);
    drop(south);
    // The faces at the side reach 45° below the equator.
    let north = wedges((3 * height / 4 + 2).min(height), false);
    at_pole(&pole_lines(&north, size, &arcs), 2, &mut texels);
    drop(arcs);
    let sides = side_lines(&north, size);
    drop(north);
    texels.par_chunks_mut(size).enumerate().for_each(|(line, out)| {
        let (face, row) = (line / size, line % size);
        let side = match face {
            0 | 1 => face,
            4 | 5 => face - 2,
            _ => return,
        };
        let (above, below) = (&sides[row][side], &sides[row + 1][side]);
        for (((out, above), below), angle) in out.iter_mut().zip(above).zip(below).zip(&angles[row * size..]) {
            *out = average(subtract(*above, *below), *angle);
        }
    });
    Cube { size, texels }
}

/// Integrals along the pieces of one line between texels.
type Line = Vec<[f64; 3]>;
/// On a face at a pole: of the line at some u, which runs along v, and of the line at the same v.
type PoleLine = [Line; 2];

/// Along the lines between the rows of the faces beside the equator, +X, −X, +Z, −Z: circles of constant v. (Their columns end at
/// meridians. φ falls as u grows.)
fn side_lines(wedges: &Wedges, size: usize) -> Vec<[Line; 4]> {
    by_symmetry(size, |_, v| {
        let arc = Arc::new(&wedges.grid, Some((v, 1.0)), size);
        move |v| [0, 1, 4, 5].map(|face| arc.line(wedges, CENTRES[face], -1.0, v > 0.0))
    })
}

/// The arcs of a face around a pole, of lines from its middle on.
fn pole_arcs(grid: &Grid, size: usize) -> Vec<Arc> {
    let arc = |k: usize| {
        let t = edge(size, k);
        Arc::new(grid, (t > 0.0).then_some((1.0, t)), size)
    };
    (size.div_ceil(2)..=size).into_par_iter().map(arc).collect()
}

/// Along the lines of the face around the pole that the wedges start from.
fn pole_lines(wedges: &Wedges, size: usize, arcs: &[Arc]) -> Vec<PoleLine> {
    by_symmetry(size, |index, _| {
        let arc = &arcs[index];
        move |t| {
            [true, false].map(|along_v| match top_circle(t, along_v) {
                Some((circle, turn)) => arc.line(wedges, circle.centre, turn, false),
                None => vec![[0.0; 3]; size],
            })
        }
    })
}

/// What `lines` makes of every line between texels, in their order. Lines at ±t are halves of one circle: `lines` of t ≥ 0 (and
/// its number) is asked once for both.
fn by_symmetry<T: Send, L: Fn(f64) -> T>(size: usize, lines: impl Fn(usize, f64) -> L + Sync) -> Vec<T> {
    let pair = |k: usize| {
        let t = edge(size, k);
        let line = lines(k - size.div_ceil(2), t);
        (line(-t), (t > 0.0).then(|| line(t)))
    };
    let pairs: Vec<(T, Option<T>)> = (size.div_ceil(2)..=size).into_par_iter().map(pair).collect();
    let (low, high): (Vec<T>, Vec<Option<T>>) = pairs.into_iter().unzip();
    low.into_iter().rev().chain(high.into_iter().flatten()).collect()
}

/// The texels that half of a grid line crosses, from its middle outwards; the other half is its mirror image, and so are those of the
/// other faces, as far as the panorama's columns are.
struct Arc {
    size: usize,
    /// a and b of its circle; none for a meridian.
    circle: Option<(f64, f64)>,
    /// The piece of the line, and what a texel holds of it, columns counted from the middle; nothing if columns have no such symmetry.
    parts: Option<Vec<(usize, Part)>>,
}

impl Arc {
    fn new(grid: &Grid, circle: Option<(f64, f64)>, size: usize) -> Self {
        let symmetric = grid.width().is_multiple_of(4);
        let parts = circle.filter(|_| symmetric).map(|(a, b)| {
            let mut parts = vec![];
            grid.along_half(&Circle { a, b, centre: -PI }, size, |piece, part| parts.push((piece, part)));
            parts
        });
        Self { size, circle, parts }
    }

    /// ∫ P dφ along each of the pieces of the line about the azimuth `centre`, or of its mirror image below the equator.
    fn line(&self, wedges: &Wedges, centre: f64, turn: f64, below: bool) -> Line {
        let Some((a, b)) = self.circle else { return vec![[0.0; 3]; self.size] };
        let mut sums = vec![[0.0; 4]; self.size];
        match &self.parts {
            Some(parts) => wedges.instructions.run(
                #[inline(always)]
                || add_mirrored(parts, wedges, centre, turn, below, &mut sums),
            ),
            None => {
                let circle = Circle { a: if below { -a } else { a }, b, centre };
                let add = |piece: usize, part: Part| wedges.add(part, &mut sums[piece]);
                wedges.grid.along_line(&circle, turn, self.size, add);
            }
        }
        sums.into_iter().map(|[r, g, b, _]| [r, g, b]).collect()
    }
}

/// Adds up ∫ P dφ over the parts of half a line and of its mirror image.
#[inline(always)]
fn add_mirrored(parts: &[(usize, Part)], wedges: &Wedges, centre: f64, turn: f64, below: bool, sums: &mut [[f64; 4]]) {
    let (width, height, last) = (wedges.grid.width(), wedges.grid.height(), sums.len() - 1);
    // Exact: azimuths of faces are quarters of a turn.
    let middle = ((centre + PI) / TAU * width as f64).round() as usize % width;
    for &(piece, part) in parts {
        let (row, depth) = match below {
            true => (height - 1 - part.row, part.length - part.depth),
            false => (part.row, part.depth),
        };
        let within = |column: usize| if column >= width { column - width } else { column };
        let outwards = [within(middle + part.column), within(middle + width - 1 - part.column)];
        let [right, left] = if turn > 0.0 { outwards } else { [outwards[1], outwards[0]] };
        let (length, depth) = (turn * part.length, turn * depth);
        wedges.add(Part { column: right, row, length, depth }, &mut sums[piece]);
        wedges.add(Part { column: left, row, length, depth }, &mut sums[last - piece]);
    }
}

fn subtract(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| a[c] - b[c])
}

/// P at every edge between rows, counted from a pole.
pub(super) struct Wedges {
    pub(super) grid: Grid,
    /// One line of `width` values of P for each edge of the grid's rows, three channels each, and one number more. (One list: large ones
    /// are given back as soon as they are dropped.)
    prefix: Vec<f64>,
    instructions: InstructionSet,
}

/// Rows that are added up by one thread.
const BAND: usize = 64;

impl Wedges {
    /// The prefix integrals of `panorama − mean` over the first `rows` rows from the north pole, or from the south pole of
    /// the panorama when `mirrored`. They take 24 bytes a texel.
    pub(super) fn new(
        panorama: &Panorama,
        mean: [f64; 3],
        rows: usize,
        mirrored: bool,
        instructions: InstructionSet,
    ) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        let grid = Grid::new(width, panorama.row_edges(), rows);
        let add_row = |row: usize, sums: &mut [f64]| {
            let texels = panorama.row(if mirrored { height - 1 - row } else { row });
            let row_height = grid.row_height(row);
            for (sum, texel) in sums.as_chunks_mut::<3>().0.iter_mut().zip(texels) {
                for c in 0..3 {
                    sum[c] += (f64::from(texel[c]) - mean[c]) * row_height;
                }
            }
        };
        // What each band comes to, then each from what all bands above it come to: the same sums on any number of threads.
        let rows_of = |band: usize| BAND * band..(BAND * (band + 1)).min(rows);
        let alone = |band: usize| {
            let mut sums = vec![0.0; 3 * width];
            rows_of(band).for_each(|row| add_row(row, &mut sums));
            sums
        };
        let alone: Vec<Vec<f64>> = (0..rows.div_ceil(BAND)).into_par_iter().map(alone).collect();
        let line = 3 * width;
        let mut above = vec![0.0; line];
        let starts: Vec<Vec<f64>> = alone
            .into_iter()
            .map(|mut band| {
                // What is above it takes the place of what it comes to.
                for (band, above) in band.iter_mut().zip(&mut above) {
                    (*band, *above) = (*above, *above + *band);
                }
                band
            })
            .collect();
        let mut prefix = vec![0.0; (rows + 1) * line + 1];
        let end = prefix.len() - 1;
        let bands = prefix[line..end].par_chunks_mut(BAND * line).zip(starts).enumerate();
        bands.for_each(|(band, (lines, mut sums))| {
            for (row, line) in rows_of(band).zip(lines.chunks_exact_mut(line)) {
                add_row(row, &mut sums);
                line.copy_from_slice(&sums);
            }
        });
        Self { grid, prefix, instructions }
    }

    /// Adds ∫ P dφ over what a texel holds of an arc; the fourth number means nothing.
    #[inline(always)]
    pub(super) fn add(&self, part: Part, sum: &mut [f64; 4]) {
        let index = 3 * (part.row * self.grid.width() + part.column);
        let four = |at: usize| -> &[f64; 4] {
            self.prefix[at..].first_chunk().expect("a number more than there are channels follows the last texel")
        };
        let (above, below) = (four(index), four(index + 3 * self.grid.width()));
        for c in 0..4 {
            sum[c] = below[c] * part.depth + (above[c] * (part.length - part.depth) + sum[c]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::cube::face_point;
    use super::super::test_maps::{random, random_sized};
    use super::*;
    use crate::math::sobol::PointSet;

    #[test]
    fn white_is_exactly_one() {
        for ([width, height], size) in
            [([4, 2], 1), ([64, 32], 7), ([16, 8], 64), ([10, 5], 3), ([5, 3], 4), ([33, 20], 9)]
        {
            let white = Panorama::new(width, height, vec![[1.0; 3]; width * height]).unwrap();
            assert!(
                area_average(&white, size).texels.iter().flatten().all(|&v| v == 1.0),
                "{width} × {height} → {size}"
            );
        }
    }

    /// Suns at the poles, at face centres, edges and corners, and beside the seam at φ = ±π.
    #[test]
    fn flux_is_conserved_wherever_the_sun_stands() {
        let width = 48;
        let suns = [(0, 0), (47, 0), (13, 23), (0, 12), (47, 11), (24, 12), (6, 6), (30, 7), (18, 17), (42, 12)];
        for (i, sun) in suns.into_iter().enumerate() {
            let panorama = random(width, i as u64, Some(sun));
            for size in [1, 2, 3, 5, 16, 33, 100] {
                let (got, wanted) = (area_average(&panorama, size).mean(), panorama.mean());
                for c in 0..3 {
                    // Each texel is rounded to f32 once: relative 6e-8 of a sum of non-negative values.
                    let error = (got[c] / wanted[c] - 1.0).abs();
                    assert!(error < 6e-8, "sun {sun:?}, size {size}, channel {c}: {} wanted {}", got[c], wanted[c]);
                }
            }
        }
    }

    #[test]
    fn every_pair_of_sizes_keeps_the_flux() {
        let usual = [4, 6, 10, 34, 128].map(|width| [width, width / 2]);
        // Not 2:1, odd, one row at the equator, far wider or higher than usual.
        let others = [[5, 3], [7, 2], [4, 3], [4, 31], [100, 60], [333, 200], [51, 5]];
        for [width, height] in usual.into_iter().chain(others) {
            let panorama = random_sized([width, height], 3, Some((width / 3, 2 * height / 5)));
            for size in 1..=24 {
                let (got, wanted) = (area_average(&panorama, size).mean()[0], panorama.mean()[0]);
                assert!((got / wanted - 1.0).abs() < 6e-8, "{width} × {height} → {size}: {got}, wanted {wanted}");
            }
        }
    }

    /// Against n² stratified random points per texel: only the cells that a boundary cuts can be wrong, each at random.
    #[test]
    fn texels_agree_with_brute_force() {
        let n = 256;
        let points = PointSet::<2>::new(2, 0, n * n);
        let cases = [([16, 8], 3), ([20, 10], 5), ([32, 16], 4), ([8, 4], 1), ([5, 3], 2), ([9, 14], 3), ([33, 20], 2)];
        for ([width, height], size) in cases {
            let panorama = random_sized([width, height], 8, Some((3, 1)));
            let cube = area_average(&panorama, size);
            for index in 0..6 * size * size {
                let (face, row, column) = (index / (size * size), index / size % size, index % size);
                let (mut sum, mut weights, mut largest) = (0.0, 0.0, 0.0f64);
                for xi in points.points() {
                    let at = |k: usize, xi: f64| 2.0 * (k as f64 + xi) / size as f64 - 1.0;
                    let point = face_point(face, at(column, xi[0]), at(row, xi[1]));
                    let weight = point.length().powi(-3);
                    let value = f64::from(panorama.radiance(point)[1]);
                    sum += weight * value;
                    weights += weight;
                    largest = largest.max(value);
                }
                let (got, wanted) = (f64::from(cube.texels[index][1]), sum / weights);
                // Boundaries cut at most about 4n of the n² cells per bright panorama texel, of which no more than 4
                // matter; each is off by at most half the contrast at one sigma. Five sigmas.
                let tolerance = 5.0 * largest / 2.0 * (16.0 * n as f64).sqrt() / (n * n) as f64;
                assert!(
                    (got - wanted).abs() < tolerance,
                    "{width} × {height} → {size}, {index}: {got}, wanted {wanted} ± {tolerance}"
                );
            }
        }
    }

    #[test]
    fn neither_threads_nor_instructions_change_a_bit() {
        let panorama = random(64, 5, Some((40, 9)));
        let with = |instructions, threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| average_by(&panorama, 21, instructions))
        };
        let wanted = with(InstructionSet::Baseline, 1);
        for instructions in InstructionSet::available() {
            assert_eq!(with(instructions, 3), wanted, "{}", instructions.name());
        }
    }
}
