//! Narrow sheens for a few directions: rings so thin that they take thousands of harmonics, and exact sums seconds.
//!
//! A width is found by what texels differ in, for which a sum over points is enough: each texel of the panorama counts as one, or as four or
//! nine where the ring is thin, and the sum is divided by the points' own weights. What that leaves of a baked chain at its own width, on a map of small
//! lamps of 512 rows, is 2e-4 in the mean at the narrowest that Kiln bakes.

use crate::environment::{Kernel, Panorama};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Points along a texel's sides: so many make a ring at least so many points wide.
const ACROSS: f64 = 3.0;
/// But no more than that along them, or where texels are so large that a ring lies between their points, as many as make so many rows.
const MOST_ALONG: usize = 3;
const LEAST_ROWS: usize = 192;
/// Times the width of a ring, 1/p, beyond which there is nothing of it.
const REACH: f64 = 14.0;

/// The panorama filtered by sheens in some directions, kernel by kernel.
pub(super) fn sheens(source: &Panorama, kernels: &[Kernel], directions: &[DVec3]) -> Vec<Vec<[f64; 3]>> {
    let mut values = vec![vec![]; kernels.len()];
    let most = MOST_ALONG.max(LEAST_ROWS / source.height());
    let along = |kernel: &Kernel| {
        let ring = kernel.alpha() * 2.0; // 1/p: where it is brightest
        ((ACROSS * PI / source.height() as f64 / ring).ceil() as usize).clamp(1, most)
    };
    for k in 1..=most {
        let some: Vec<usize> = (0..kernels.len()).filter(|&i| along(&kernels[i]) == k).collect();
        if some.is_empty() {
            continue;
        }
        let own: Vec<Kernel> = some.iter().map(|&i| kernels[i]).collect();
        let points = Points::new(source, k);
        let sums: Vec<Vec<[f64; 3]>> = directions.par_iter().map(|&towards| points.sums(&own, towards)).collect();
        for (place, &i) in some.iter().enumerate() {
            values[i] = sums.iter().map(|of_direction| of_direction[place]).collect();
        }
    }
    values
}

/// A panorama whose texels are so many points along either side.
struct Points<'a> {
    source: &'a Panorama,
    along: usize,
    /// Sine and cosine of the polar angle of every row of points.
    rows: Vec<(f64, f64)>,
    /// Cosine and sine of the azimuth of every column.
    columns: Vec<(f64, f64)>,
}

impl<'a> Points<'a> {
    fn new(source: &'a Panorama, along: usize) -> Self {
        let (n_rows, n_columns) = (along * source.height(), along * source.width());
        let rows = (0..n_rows).map(|i| (PI * (i as f64 + 0.5) / n_rows as f64).sin_cos());
        let columns = (0..n_columns).map(|i| {
            let (sin, cos) = (TAU * (i as f64 + 0.5) / n_columns as f64 - PI).sin_cos();
            (cos, sin)
        });
        Self { source, along, rows: rows.collect(), columns: columns.collect() }
    }

    fn sums(&self, kernels: &[Kernel], towards: DVec3) -> Vec<[f64; 3]> {
        let reaches: Vec<f64> = kernels.iter().map(|kernel| (REACH * 2.0 * kernel.alpha()).min(1.0)).collect();
        let farthest = reaches.iter().copied().fold(0.0, f64::max);
        let across: Vec<f64> = self.columns.iter().map(|(cos, sin)| towards.x * cos + towards.z * sin).collect();
        let mut sums = vec![[0.0; 4]; kernels.len()];
        for (row, &(sine, cosine)) in self.rows.iter().enumerate() {
            let (up, radius) = (towards.y * cosine, sine);
            let texels = &self.source.texels()[row / self.along * self.source.width()..][..self.source.width()];
            for (column, across) in across.iter().enumerate() {
                let c = up + radius * across;
                if c <= 0.0 || c >= farthest {
                    continue;
                }
                let texel = texels[column / self.along].map(f64::from);
                for ((kernel, reach), sum) in kernels.iter().zip(&reaches).zip(&mut sums) {
                    if c < *reach {
                        let k = kernel.eval(1.0 - c) * radius;
                        (0..3).for_each(|channel| sum[channel] += k * texel[channel]);
                        sum[3] += k;
                    }
                }
            }
        }
        sums.into_iter().map(|[r, g, b, whole]| [r, g, b].map(|v| v / whole)).collect()
    }
}
