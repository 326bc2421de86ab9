//! Which texels of a panorama lie within a border, and how much of each: what exact averages are sums over.
//!
//! Green's theorem, column by column. A piece of border counts for what lies between itself and the pole: the rows above its own as
//! wide as it is, and a part of its own row. Pieces on the far side count positive, those on the near side negative.

use std::f64::consts::TAU;

use super::overlap::{Grid, Part};

/// The border of a region, piece by piece.
#[derive(Debug, Default)]
pub(super) struct Border {
    parts: Vec<Part>,
    /// Length and depth of the pieces in each texel of the smallest box of columns and rows that holds them all, row by row.
    cells: Vec<[f64; 2]>,
    /// The length of each column of the box that lies within the region, in the row above.
    within: Vec<f64>,
    /// Solid angles in a row of the box.
    areas: Vec<f64>,
}

/// Parts of a texel that are rounding; and parts of a column that are when a border closes (a border that ends at the pole leaves
/// quarters of a column at least).
const NOTHING: f64 = 1e-12;
const CLOSED: f64 = 1e-9;

impl Border {
    /// Adds a piece; `sign` is positive where the region lies between it and the pole.
    #[inline(always)]
    pub fn add(&mut self, part: Part, sign: f64) {
        self.parts.push(Part { length: sign * part.length, depth: sign * part.depth, ..part });
    }

    /// The texels within the border, which is empty after that: for each row, its number, the first column, and the solid angle of what
    /// is covered in this column and each after it. A region around the pole, or at it, reaches up to row 0.
    #[inline(always)]
    pub fn take(&mut self, grid: &Grid, mut visit: impl FnMut(usize, usize, &[f64])) {
        let Some(&Part { column: first, row, .. }) = self.parts.first() else { return };
        let width = grid.width();
        // Columns are counted from half a turn before the first piece: no region that ends at a column lies across.
        let relative = |column: usize| {
            let column = column + width / 2 + width - first;
            let column = if column >= width { column - width } else { column };
            if column >= width { column - width } else { column }
        };
        let (mut columns, mut rows) = ([relative(first); 2], [row; 2]);
        for part in &self.parts {
            let column = relative(part.column);
            columns = [columns[0].min(column), columns[1].max(column)];
            rows = [rows[0].min(part.row), rows[1].max(part.row)];
        }
        let n_columns = columns[1] - columns[0] + 1;
        self.cells.clear();
        self.cells.resize((rows[1] - rows[0] + 1) * n_columns, [0.0; 2]);
        for part in self.parts.drain(..) {
            let cell = &mut self.cells[(part.row - rows[0]) * n_columns + relative(part.column) - columns[0]];
            cell[0] += part.length;
            cell[1] += part.depth;
        }
        self.within.clear();
        self.within.resize(n_columns, 0.0);
        self.areas.clear();
        self.areas.resize(n_columns, 0.0);
        let start = columns[0] + first + width - width / 2;
        let mut emit = |row: usize, areas: &[f64]| {
            let nothing = NOTHING * TAU / width as f64 * grid.row_height(row);
            let is_covered = |area: &f64| area.abs() > nothing;
            let Some(from) = areas.iter().position(is_covered) else { return };
            let to = areas.iter().rposition(is_covered).map_or(from, |last| last + 1);
            let column = (start + from) % width;
            let (here, over) = areas[from..to].split_at((to - from).min(width - column));
            visit(row, column, here);
            if !over.is_empty() {
                visit(row, 0, over);
            }
        };
        for (row, cells) in self.cells.chunks_exact(n_columns).enumerate().rev() {
            let row = rows[0] + row;
            let height = grid.row_height(row);
            for ((area, within), [length, depth]) in self.areas.iter_mut().zip(&mut self.within).zip(cells) {
                *area = height * (*within + depth);
                *within += length;
            }
            emit(row, &self.areas);
        }
        // Where the border does not close, the pole is on it or within.
        let closed = CLOSED * TAU / width as f64;
        if self.within.iter().any(|within| within.abs() > closed) {
            for row in (0..rows[0]).rev() {
                let height = grid.row_height(row);
                self.areas.iter_mut().zip(&self.within).for_each(|(area, within)| *area = height * within);
                emit(row, &self.areas);
            }
        }
    }
}
