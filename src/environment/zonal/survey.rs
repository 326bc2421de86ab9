//! What there is to know about a panorama before it is filtered, from one look at its texels: large ones take longer to read than to reckon with.

use std::ops::Range;

use rayon::prelude::*;

use super::lanes::InstructionSet;
use crate::environment::panorama::Panorama;
use crate::environment::peel::Brightest;

/// What one look finds.
#[derive(Debug)]
pub(super) struct Survey {
    /// Cells that a row is cut into.
    pub across: usize,
    pub rows: Vec<Row>,
    pub brightest: Brightest,
}

/// Sums over a row.
#[derive(Debug)]
pub(super) struct Row {
    /// About the darkest values of the panorama, as [`moments`] gives them.
    pub moments: [[f64; 3]; 2],
    /// Of the texels of each cell.
    pub cells: Vec<[f64; 3]>,
}

impl Survey {
    pub fn new(panorama: &Panorama, instructions: InstructionSet) -> Self {
        let across = panorama.width().min(32);
        let darkest = panorama.min().map(f64::from);
        let looks: Vec<(Vec<Row>, Vec<f64>)> = (0..Brightest::n_rows(panorama.height()))
            .into_par_iter()
            .map(|block| {
                instructions.run(
                    #[inline(always)]
                    || look(panorama, block, across, darkest),
                )
            })
            .collect();
        let (rows, brightest): (Vec<_>, Vec<_>) = looks.into_iter().unzip();
        Self { across, rows: rows.into_iter().flatten().collect(), brightest: Brightest::from_rows(brightest) }
    }

    /// The columns of a cell: those that `column * across / width` says are.
    pub fn columns(&self, cell: usize, width: usize) -> Range<usize> {
        columns(cell, self.across, width)
    }
}

/// A row of blocks. (Its texels are looked at twice, the second time in a cache.)
#[inline(always)]
fn look(panorama: &Panorama, block: usize, across: usize, darkest: [f64; 3]) -> (Vec<Row>, Vec<f64>) {
    let rows = Brightest::rows(block, panorama.height());
    let brightest = Brightest::in_rows(rows.clone().map(|row| panorama.row(row)));
    (rows.map(|row| Row::new(panorama.row(row), across, darkest)).collect(), brightest)
}

fn columns(cell: usize, across: usize, width: usize) -> Range<usize> {
    (cell * width).div_ceil(across)..((cell + 1) * width).div_ceil(across)
}

impl Row {
    #[inline(always)]
    fn new(texels: &[[f32; 3]], across: usize, darkest: [f64; 3]) -> Self {
        let mut row = Self { moments: [[0.0; 3]; 2], cells: Vec::with_capacity(across) };
        for cell in 0..across {
            let columns = columns(cell, across, texels.len());
            let n = columns.len() as f64;
            let sums = moments(&texels[columns], darkest);
            for (all, sums) in row.moments.iter_mut().zip(&sums) {
                (0..3).for_each(|c| all[c] += sums[c]);
            }
            row.cells.push(std::array::from_fn(|c| sums[0][c] + n * darkest[c]));
        }
        row
    }
}

/// Σ (v − base) and Σ (v − base)² of each channel.
#[inline(always)]
pub(super) fn moments(texels: &[[f32; 3]], base: [f64; 3]) -> [[f64; 3]; 2] {
    // (Four texels at a time are three vectors of four.)
    let mut sums = [[[0.0; 3]; 4]; 2];
    let mut add = |i: usize, texel: &[f32; 3]| {
        for c in 0..3 {
            let value = f64::from(texel[c]) - base[c];
            sums[0][i][c] += value;
            sums[1][i][c] += value * value;
        }
    };
    let (whole, rest) = texels.as_chunks::<4>();
    for four in whole {
        (0..4).for_each(|i| add(i, &four[i]));
    }
    rest.iter().for_each(|texel| add(0, texel));
    sums.map(|four| std::array::from_fn(|c| four.iter().map(|sums| sums[c]).sum()))
}
