//! PlayCanvas' atlas, read as its shader reads it: blended as a sampler blends codes, decoded and placed by the shader's own formulas.

use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Texels along an edge.
pub const EDGE: usize = 512;

/// Four bytes a texel.
pub struct Atlas(pub Vec<u8>);

impl Atlas {
    /// What a sampler that blends four texels gives at texture coordinates: r, g, b, a in [0, 1].
    pub fn sampled(&self, [u, v]: [f64; 2]) -> [f64; 4] {
        let (x, y) = (u * EDGE as f64 - 0.5, v * EDGE as f64 - 0.5);
        let mut sum = [0.0; 4];
        for (i, j) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let [column, row] = [x.floor() + i, y.floor() + j].map(|t| t.clamp(0.0, EDGE as f64 - 1.0));
            let weight = (1.0 - (x - x.floor() - i).abs()) * (1.0 - (y - y.floor() - j).abs());
            let start = 4 * (row as usize * EDGE + column as usize);
            (0..4).for_each(|c| sum[c] += weight * f64::from(self.0[start + c]) / 255.0);
        }
        sum
    }

    /// What the shader finds of a direction of the world in the tile that begins at `(x, y)` and is `(w, h)` large.
    pub fn seen(&self, world: DVec3, [x, y, w, h]: [f64; 4]) -> [f64; 3] {
        let direction = DVec3::new(-world.x, world.y, world.z);
        let at = [0.5 + direction.x.atan2(direction.z) / TAU, 1.0 - (0.5 + direction.y.asin() / PI)];
        let edge = EDGE as f64;
        // A seam of one texel on either side.
        let uv = [(x + 1.0 + at[0] * (w - 2.0)) / edge, (y + 1.0 + at[1] * (h - 2.0)) / edge];
        let [r, g, b, a] = self.sampled(uv);
        [r, g, b].map(|c| (c * (8.0 - 7.0 * a)).powi(2))
    }
}

/// The tile of irradiance: column, row, width and height.
pub const IRRADIANCE: [f64; 4] = [128.0, 384.0, 64.0, 32.0];

/// The tile of a rough level, and that of a mirror, as the shader places them.
pub fn rough(level: i32) -> [f64; 4] {
    let t = 512.0 * 0.5_f64.powi(level);
    [0.0, 512.0 - t, t, t / 2.0]
}

pub fn mirror(level: i32) -> [f64; 4] {
    let t = 512.0 * 0.5_f64.powi(level);
    [512.0 - t, 512.0 - t, t, t / 2.0]
}
