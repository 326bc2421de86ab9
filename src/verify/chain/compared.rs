//! What the texels of a level are off by once its truth is known: errors, fireflies, seams.

use super::{LevelError, median};
use crate::environment::seamless::across_edges;
use crate::environment::{DARK_FLOOR, SphereMap, error_scale};

/// A texel is a firefly when it is brighter than this many times what it should be.
const FIREFLY: f64 = 2.0;

/// A level beside its truth.
pub(super) struct Compared<'a> {
    pub(super) map: &'a SphereMap,
    pub(super) truth: &'a [[f64; 3]],
    pub(super) mean: [f64; 3],
}

impl Compared<'_> {
    fn floor(&self, texel: usize, c: usize) -> f64 {
        error_scale(self.truth[texel][c], self.mean[c])
    }

    /// The median of file/truth over texels and channels.
    pub(super) fn scale(&self) -> f64 {
        let lit = |i: usize| (0..3).filter(move |&c| self.truth[i][c] > DARK_FLOOR * self.mean[c]);
        let ratios = (0..self.truth.len())
            .flat_map(|i| lit(i).map(move |c| f64::from(self.map.texels[i][c]) / self.truth[i][c]));
        let middle = median(&ratios.collect::<Vec<_>>());
        if middle.is_finite() { middle } else { 1.0 }
    }

    /// Errors against the truth, and what of them is left once the scale is taken off.
    pub(super) fn error(&self, against_roughness: f64, scale: f64) -> LevelError {
        let (layout, size) = (self.map.layout, self.map.size);
        let solid_angles = layout.solid_angles(size);
        let relative = |i: usize, c: usize, scale: f64| {
            let (found, wanted) = (f64::from(self.map.texels[i][c]) / scale, self.truth[i][c]);
            if found == wanted { 0.0 } else { (found - wanted) / self.floor(i, c) }
        };
        let (mut max, mut worst) = (0.0_f64, (0, 0));
        let (mut squares, mut unscaled, mut weights) = (0.0, 0.0, 0.0);
        let (mut fireflies, mut brightest) = (0, (0.0_f64, 0));
        for (i, &weight) in solid_angles.iter().enumerate() {
            weights += 3.0 * weight;
            for c in 0..3 {
                let off = relative(i, c, 1.0);
                squares += weight * off * off;
                unscaled += weight * relative(i, c, scale).powi(2);
                if off.abs() > max {
                    (max, worst) = (off.abs(), (i, c));
                }
            }
            let (found, wanted): (f64, f64) =
                (self.map.texels[i].iter().map(|&v| f64::from(v)).sum(), (0..3).map(|c| self.floor(i, c)).sum());
            let times = found / (scale * wanted);
            if against_roughness > 0.0 && times > FIREFLY {
                fireflies += 1;
                if times > brightest.0 {
                    brightest = (times, i);
                }
            }
        }
        let seams = if layout.is_cube() { seams(size, |i, c| relative(i, c, scale)) } else { [0.0; 2] };
        LevelError {
            against_roughness,
            rms: (squares / weights).sqrt(),
            rms_unscaled: (unscaled / weights).sqrt(),
            max,
            worst_at: format!("{}, {}", layout.place(size, worst.0), ["R", "G", "B"][worst.1]),
            fireflies,
            worst_firefly: (fireflies > 0).then(|| (brightest.0, layout.place(size, brightest.1))),
            seams,
        }
    }
}

/// RMS of the jumps of an error at the edges between faces and within faces.
///
/// However steep an error is, if it is smooth its jumps are of third order in a texel, and of no less order within faces: texels lie
/// mirrored on either side of an edge. Noise jumps alike everywhere.
fn seams(size: usize, error: impl Fn(usize, usize) -> f64) -> [f64; 2] {
    let rms = |squares: &[f64]| (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
    let square = |f: &dyn Fn(usize) -> f64| (0..3).map(|c| f(c).powi(2)).sum::<f64>() / 3.0;
    let step = |a: usize, b: usize| square(&|c| error(a, c) - error(b, c));
    let jump = |[a, b, c, d]: [usize; 4]| {
        square(&|channel| {
            let at = |i| error(i, channel);
            1.5 * (at(b) - at(c)) - 0.5 * (at(a) - at(d))
        })
    };
    let pairs = across_edges(size);
    let steps: Vec<f64> = pairs.iter().map(|&[_, edge, other, _]| step(edge, other)).collect();
    if size < 4 {
        let within =
            pairs.iter().map(|&[inside, edge, other, beyond]| 0.5 * (step(inside, edge) + step(other, beyond)));
        return [rms(&steps), rms(&within.collect::<Vec<_>>())];
    }
    // The four texels inwards from an edge.
    let inwards = |[inside, edge, other, beyond]: [usize; 4]| {
        let line = |from: usize, to: usize| {
            [0_isize, 1, 2, 3].map(|k| (from as isize + k * (to as isize - from as isize)) as usize)
        };
        [line(edge, inside), line(other, beyond)]
    };
    let across: Vec<f64> = pairs.iter().map(|&pair| jump(pair)).collect();
    let within: Vec<f64> = pairs.iter().flat_map(|&pair| inwards(pair)).map(jump).collect();
    // Where a smooth error is steep, what is left of third order may differ: a seam's jump is at least half its step.
    [rms(&across), rms(&within).max(rms(&steps) / 3.0)]
}
