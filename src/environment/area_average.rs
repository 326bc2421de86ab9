//! Panorama to cube map by exact overlap areas.
//!
//! What a cube texel holds of each panorama texel follows from its edges (`coverage`); they are great circles, on which all is
//! closed form (`overlap`). A quarter of one face beside the equator and a quarter of one at a pole are worked out; the others
//! are their mirror images, because faces begin at quarters of a turn and rows mirror each other. All values are reduced by their mean
//! first, so that a constant panorama comes out as exactly that.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use rayon::prelude::*;

use super::coverage::Border;
use super::cube::{Cube, edge};
use super::overlap::{CENTRES, Circle, Grid, Part};
use super::panorama::Panorama;
use super::zonal::InstructionSet;

/// The panorama averaged over the exact solid angle of each texel of a cube of this size. A constant panorama comes out
/// as exactly its constant, and the flux is conserved to rounding.
pub fn area_average(panorama: &Panorama, size: usize) -> Cube {
    average_by(panorama, size, InstructionSet::detect())
}

fn average_by(panorama: &Panorama, size: usize, instructions: InstructionSet) -> Cube {
    let (width, height) = (panorama.width(), panorama.height());
    // Columns are cut so that a quarter of a turn is a whole number of them.
    let cuts = [0, 2, 1, 2][width % 4];
    let grid = Grid::new(width << cuts, panorama.row_edges(), height);
    let [r, g, b] = panorama.mean();
    let map = Map { panorama, size, mean: [r, g, b, 0.0], range: [panorama.min(), panorama.max()], cuts };
    let quarter = Quarter::new(&grid, size);
    let mut texels = vec![[0.0f32; 3]; 6 * size * size];
    let mut rows: Vec<Option<&mut [[f32; 3]]>> = texels.chunks_exact_mut(size).map(Some).collect();
    let mut all: Vec<Row> = (0..size.div_ceil(2))
        .map(|line| {
            let images = images(size, line);
            let out = images.map(|(row, _)| std::array::from_fn(|face| rows[face * size + row].take()));
            Row { line, signs: images.map(|(_, signs)| signs), out }
        })
        .collect();
    all.par_chunks_mut(TILE[0]).for_each_init(Scratch::default, |scratch, rows| {
        instructions.run(
            #[inline(always)]
            || map.fill(&quarter, rows, scratch),
        );
    });
    Cube { size, texels }
}

/// Rows and columns of a quarter that are averaged together: what they hold of the panorama then stays near.
const TILE: [usize; 2] = [8, 32];

/// Rows at the same distance from the middles of all faces, to be filled.
struct Row<'a> {
    /// The number of the row from the middle.
    line: usize,
    /// As [`images`] says.
    signs: [&'static [bool]; 2],
    out: [[Option<&'a mut [[f32; 3]]>; 6]; 2],
}

/// Where the mirror images of a row or column (counted from the middle) lie, and which of the two they are: both make up one that lies
/// across the middle.
fn images(size: usize, from_middle: usize) -> [(usize, &'static [bool]); 2] {
    let [up, down] = [size / 2 + from_middle, (size - 1) / 2 - from_middle];
    if up == down { [(up, &[false, true]), (up, &[])] } else { [(up, &[false]), (down, &[true])] }
}

/// The lines of the quarter faces, from the middle on: beside the equator those between rows, columns counted from the middle of the
/// face; at the pole those between columns, columns counted from the azimuth of u.
struct Quarter<'a> {
    grid: &'a Grid,
    side: Vec<Line>,
    pole: Vec<Line>,
}

/// The texels along half a line, piece by piece.
struct Line {
    parts: Vec<Part>,
    ends: Vec<usize>,
}

impl Line {
    /// Half of a circle's line from its middle, at azimuth −π.
    fn new(grid: &Grid, [a, b]: [f64; 2], size: usize) -> Self {
        let mut line = Self { parts: vec![], ends: vec![0; size.div_ceil(2)] };
        let Self { parts, ends } = &mut line;
        if b > 0.0 {
            grid.along_half(&Circle::new(a, b, -PI), size, |piece, part| {
                parts.push(part);
                ends[piece - size / 2] = parts.len();
            });
        }
        line
    }

    fn piece(&self, index: usize) -> &[Part] {
        let start = if index == 0 { 0 } else { self.ends[index - 1] };
        &self.parts[start..self.ends[index]]
    }
}

impl<'a> Quarter<'a> {
    fn new(grid: &'a Grid, size: usize) -> Self {
        let lines = |circle: fn(f64) -> [f64; 2]| -> Vec<Line> {
            // (Of odd sizes the first line is the middle of a texel.)
            let line = |k: usize| Line::new(grid, circle(edge(size, k).max(0.0)), size);
            (size / 2..size + 1).into_par_iter().map(line).collect()
        };
        // Through the pole itself lines are meridians, b = 0.
        Self { grid, side: lines(|t| [t, 1.0]), pole: lines(|t| [1.0, t]) }
    }

    /// What some texels of a row hold, of a face beside the equator, northwards and one side only.
    #[inline(always)]
    fn at_side(&self, row: usize, pieces: Range<usize>, border: &mut Border, list: &mut List) {
        for piece in pieces {
            self.side[row].piece(piece).iter().for_each(|&part| border.add(part, 1.0));
            self.side[row + 1].piece(piece).iter().for_each(|&part| border.add(part, -1.0));
            list.push(self.grid, border);
        }
    }

    /// The same of the face at the pole, u and v positive.
    #[inline(always)]
    fn at_pole(&self, row: usize, pieces: Range<usize>, border: &mut Border, list: &mut List) {
        let quarter = self.grid.width() / 4;
        for column in pieces {
            // Lines of constant u begin at its azimuth, those of constant v a quarter of a turn further, and go the other way.
            for (line, sign) in [(column, -1.0), (column + 1, 1.0)] {
                self.pole[line].piece(row).iter().for_each(|&part| border.add(part, sign));
            }
            for (line, sign) in [(row, -1.0), (row + 1, 1.0)] {
                for &part in self.pole[line].piece(column) {
                    border.add(Part { column: quarter - 1 - part.column, ..part }, sign);
                }
            }
            list.push(self.grid, border);
        }
    }
}

/// What some texels hold of the panorama, one after the other.
#[derive(Default)]
struct List {
    areas: Vec<f64>,
    /// Areas that follow each other in a row: the row, the first column, and their number.
    runs: Vec<[u32; 3]>,
    texels: Vec<Held>,
}

/// What one texel holds: its runs, its areas, and their sum.
struct Held {
    runs: Range<usize>,
    areas: Range<usize>,
    angle: f64,
}

impl List {
    fn clear(&mut self) {
        self.areas.clear();
        self.runs.clear();
        self.texels.clear();
    }

    /// Adds what a border holds.
    #[inline(always)]
    fn push(&mut self, grid: &Grid, border: &mut Border) {
        let (runs, areas) = (self.runs.len(), self.areas.len());
        border.take(grid, |row, column, areas| {
            self.areas.extend_from_slice(areas);
            self.runs.push([row as u32, column as u32, areas.len() as u32]);
        });
        let angle = self.areas[areas..].iter().sum();
        self.texels.push(Held { runs: runs..self.runs.len(), areas: areas..self.areas.len(), angle });
    }
}

#[derive(Default)]
struct Scratch {
    border: Border,
    list: List,
}

/// What is averaged.
struct Map<'a> {
    panorama: &'a Panorama,
    /// Texels along an edge of a face.
    size: usize,
    /// Three channels, and a fourth number.
    mean: [f64; 4],
    /// An average lies between the extremes. The clamp only keeps rounding from making black negative beside a sun.
    range: [[f32; 3]; 2],
    /// The grid has 2^cuts columns for one of the panorama.
    cuts: u32,
}

/// A mirror image of what a list holds: where its column 0 begins, whether columns go down from there, and whether rows are counted from
/// the south pole.
#[derive(Clone, Copy)]
struct Image {
    first: usize,
    turned: bool,
    below: bool,
}

impl Map<'_> {
    /// Adds ∫ (f − mean) over images of some texels, of each its own sum; the fourth number means nothing. (All images at once: lists
    /// are short, and where each ends is not foreseen by the processor.)
    #[inline(always)]
    fn add<const N: usize>(&self, runs: &[[u32; 3]], mut areas: &[f64], images: [Image; N], sums: &mut [[f64; 4]; N]) {
        let (width, height) = (self.panorama.width(), self.panorama.height());
        let columns = width << self.cuts;
        for &[row, column, n] in runs {
            let (row, column) = (row as usize, column as usize);
            let mut starts = images.map(|image| {
                let row = if image.below { height - 1 - row } else { row };
                let column = if image.turned { image.first + columns - 1 - column } else { image.first + column };
                (row * width, if column >= columns { column - columns } else { column })
            });
            let (here, rest) = areas.split_at(n as usize);
            areas = rest;
            for area in here {
                for ((start, image), sum) in starts.iter_mut().zip(&images).zip(&mut *sums) {
                    let texel = self.four(start.0 + (start.1 >> self.cuts));
                    for c in 0..4 {
                        sum[c] += area * (f64::from(texel[c]) - self.mean[c]);
                    }
                    // (The image of a quarter ends where a turn does.)
                    start.1 = if image.turned { start.1.wrapping_sub(1) } else { start.1 + 1 };
                }
            }
        }
    }

    /// A texel and a number more.
    #[inline(always)]
    fn four(&self, index: usize) -> [f32; 4] {
        let flat = self.panorama.texels().as_flattened();
        match flat[3 * index..].first_chunk() {
            Some(four) => *four,
            None => [flat[3 * index], flat[3 * index + 1], flat[3 * index + 2], 0.0],
        }
    }

    /// Fills some rows of all faces.
    #[inline(always)]
    fn fill(&self, quarter: &Quarter, rows: &mut [Row], Scratch { border, list }: &mut Scratch) {
        let (width, pieces) = (quarter.grid.width(), self.size.div_ceil(2));
        for start in (0..pieces).step_by(TILE[1]) {
            let tile = start..(start + TILE[1]).min(pieces);
            list.clear();
            rows.iter().for_each(|row| quarter.at_side(row.line, tile.clone(), border, list));
            // φ falls as u grows, y as v does.
            let faces = [0, 1, 4, 5];
            let firsts = faces.map(|face| ((CENTRES[face] + PI) / TAU * width as f64).round() as usize);
            self.fill_faces(rows, faces, tile.clone(), list, |left, up| {
                firsts.map(|first| Image { first, turned: !left, below: !up })
            });
            list.clear();
            rows.iter().for_each(|row| quarter.at_pole(row.line, tile.clone(), border, list));
            // φ grows from u to v; seen from below, v is turned round.
            self.fill_faces(rows, [2, 3], tile, list, |left, up| {
                [false, true].map(|below| Image {
                    first: if left { 0 } else { width / 2 },
                    turned: left != (up != below),
                    below,
                })
            });
        }
    }

    /// Fills some columns of some rows of faces that are alike; `images_of` says where each quarter of them lies, by whether u and v are
    /// negative there.
    #[inline(always)]
    fn fill_faces<const N: usize>(
        &self,
        rows: &mut [Row],
        faces: [usize; N],
        pieces: Range<usize>,
        list: &List,
        images_of: impl Fn(bool, bool) -> [Image; N],
    ) {
        let [low, high] = self.range;
        for (row, held) in rows.iter_mut().zip(list.texels.chunks_exact(pieces.len())) {
            for (piece, held) in pieces.clone().zip(held) {
                let (runs, areas) = (&list.runs[held.runs.clone()], &list.areas[held.areas.clone()]);
                for (column, left) in images(self.size, piece) {
                    for (signs, out) in row.signs.iter().zip(&mut row.out) {
                        let mut sums = [[0.0; 4]; N];
                        for (&left, &up) in left.iter().flat_map(|left| signs.iter().map(move |up| (left, up))) {
                            self.add(runs, areas, images_of(left, up), &mut sums);
                        }
                        // (Known to be unused, the fourth number would be left out, and with it the use of vectors of four.)
                        let sums = std::hint::black_box(sums);
                        let angle = held.angle * (left.len() * signs.len()) as f64;
                        for (face, sum) in faces.iter().zip(sums) {
                            let average = |c: usize| ((self.mean[c] + sum[c] / angle) as f32).clamp(low[c], high[c]);
                            if let (Some(out), false) = (&mut out[*face], left.is_empty()) {
                                out[column] = std::array::from_fn(average);
                            }
                        }
                    }
                }
            }
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
