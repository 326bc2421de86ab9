//! Panorama to cube map by exact overlap areas.
//!
//! What a cube texel holds of each panorama texel follows from its edges (`coverage`); they are great circles, on which all is
//! closed form (`overlap`). A quarter of one face beside the equator and a quarter of one at a pole are worked out; the others
//! are their mirror images, because faces begin at quarters of a turn and rows mirror each other. Sums and the
//! solid angles that they are divided by are off by some 1e-15: a constant panorama, rounded to f32, comes out as exactly that.

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
    let map = Map { panorama, size, range: [panorama.min(), panorama.max()], cuts };
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
    parts: Vec<Held>,
    /// Where each texel's parts end, and the sum of their areas.
    texels: Vec<(usize, f64)>,
}

/// A part of a texel that lies in one texel of the grid: its area there.
struct Held {
    area: f64,
    row: u32,
    column: u32,
}

impl List {
    fn clear(&mut self) {
        self.parts.clear();
        self.texels.clear();
    }

    /// Adds what a border holds.
    #[inline(always)]
    fn push(&mut self, grid: &Grid, border: &mut Border) {
        let first = self.parts.len();
        border.take(grid, |row, column, areas| {
            let held = |(i, &area): (usize, &f64)| Held { area, row: row as u32, column: (column + i) as u32 };
            self.parts.extend(areas.iter().enumerate().map(held));
        });
        let angle = self.parts[first..].iter().map(|part| part.area).sum();
        self.texels.push((self.parts.len(), angle));
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
    /// An average lies between the extremes. The clamp only keeps rounding from making black negative beside a sun.
    range: [[f32; 3]; 2],
    /// The grid has 2^cuts columns for one of the panorama.
    cuts: u32,
}

/// A mirror image of what a list holds: where its column 0 is, whether columns go down from there (to 0, or up to a turn), and whether
/// rows are counted from the south pole.
#[derive(Clone, Copy)]
struct Image {
    origin: usize,
    turned: bool,
    below: bool,
}

impl Image {
    /// An image whose column 0 begins at `first`, or ends there if it is turned, a turn being `width`.
    fn new(first: usize, turned: bool, below: bool, width: usize) -> Self {
        let first = first % width;
        let origin = match turned {
            true if first == 0 => width - 1,
            true => first - 1,
            false => first,
        };
        Self { origin, turned, below }
    }

    #[inline(always)]
    fn column(&self, column: usize) -> usize {
        // (A list of two instead of a choice: the processor does not foresee it.)
        self.origin.wrapping_add([column, column.wrapping_neg()][usize::from(self.turned)])
    }
}

impl Map<'_> {
    /// ∫ f over images of a texel; the fourth number means nothing. (All images at once: lists are short, and where each ends is not
    /// foreseen by the processor.)
    #[inline(always)]
    fn sums<const M: usize>(&self, parts: &[Held], images: &[Image; M]) -> [[f64; 4]; M] {
        let (width, height) = (self.panorama.width(), self.panorama.height());
        let flat = self.panorama.texels().as_flattened();
        let mut sums = [[0.0; 4]; M];
        for part in parts {
            let (row, column) = (part.row as usize, part.column as usize);
            let rows = [row * width, (height - 1 - row) * width];
            let texel_of = |image: &Image| 3 * (rows[usize::from(image.below)] + (image.column(column) >> self.cuts));
            // (The last texel of the last row has no number after it. To ask for it everywhere would take more time than all the rest.)
            if row > 0 {
                for (image, sum) in images.iter().zip(&mut sums) {
                    let at = texel_of(image);
                    let four: &[f32; 4] = flat[at..at + 4].first_chunk().unwrap_or(&[0.0; 4]);
                    (0..4).for_each(|c| sum[c] += part.area * f64::from(four[c]));
                }
            } else {
                for (image, sum) in images.iter().zip(&mut sums) {
                    let at = texel_of(image);
                    (0..3).for_each(|c| sum[c] += part.area * f64::from(flat[at + c]));
                }
            }
        }
        sums
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
            let side = |face: usize, left: bool, up: bool| Image::new(firsts[face], !left, !up, width);
            self.fill_faces::<4, 16>(rows, faces, tile.clone(), list, side);
            list.clear();
            rows.iter().for_each(|row| quarter.at_pole(row.line, tile.clone(), border, list));
            // φ grows from u to v; seen from below, v is turned round.
            let pole = |face: usize, left: bool, up: bool| {
                let below = face == 1;
                Image::new(if left { 0 } else { width / 2 }, left != (up != below), below, width)
            };
            self.fill_faces::<2, 8>(rows, [2, 3], tile, list, pole);
        }
    }

    /// Fills some columns of some rows of N faces that are alike, each of M/N quarters; `image_of` says where a quarter lies, by the
    /// number of the face among these and whether u and v are negative there.
    #[inline(always)]
    fn fill_faces<const N: usize, const M: usize>(
        &self,
        rows: &mut [Row],
        faces: [usize; N],
        pieces: Range<usize>,
        list: &List,
        image_of: impl Fn(usize, bool, bool) -> Image,
    ) {
        let quarter_of = |left: bool, up: bool| 2 * usize::from(left) + usize::from(up);
        let images: [Image; M] = std::array::from_fn(|i| image_of(i % N, i / N / 2 == 1, i / N % 2 == 1));
        let [low, high] = self.range;
        let mut start = 0;
        for (row, held) in rows.iter_mut().zip(list.texels.chunks_exact(pieces.len())) {
            for (piece, &(end, angle)) in pieces.clone().zip(held) {
                let sums = self.sums(&list.parts[start..end], &images);
                start = end;
                // (Known to be unused, the fourth number would be left out, and with it the use of vectors of four.)
                let sums = std::hint::black_box(sums);
                for (column, left) in self::images(self.size, piece) {
                    for (signs, out) in row.signs.iter().zip(&mut row.out) {
                        let angle = angle * (left.len() * signs.len()) as f64;
                        if left.is_empty() {
                            continue;
                        }
                        for (index, face) in faces.iter().enumerate() {
                            let mut sum = [0.0; 4];
                            for &left in left {
                                for &up in *signs {
                                    let quarter = sums[quarter_of(left, up) * N + index];
                                    (0..4).for_each(|c| sum[c] += quarter[c]);
                                }
                            }
                            if let Some(out) = &mut out[*face] {
                                out[column] = std::array::from_fn(|c| ((sum[c] / angle) as f32).clamp(low[c], high[c]));
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
