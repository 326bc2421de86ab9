//! The sun as a disc: its flux, spread over the texels by the part of the disc that each covers.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::panorama::texel_box;

/// Angular radius of the sun seen from the earth, in radians: 0.2667°.
pub(super) const ANGULAR_RADIUS: f64 = 0.2667 * PI / 180.0;

/// Lines of constant y that a texel is cut into. On each the disc's part is exact; the lines converge like 1/n².
const LINES: usize = 512;

/// Adds a uniform disc about a direction to the texels of a panorama `width` × `width / 2`.
///
/// `flux` is ∫ L dω. The overlaps are normalised to their sum, so the texels hold this flux to rounding, however coarse the
/// panorama is.
pub(super) fn add_disc(radiance: &mut [[f64; 3]], width: usize, centre: DVec3, flux: [f64; 3]) {
    let overlaps: Vec<(usize, f64)> = overlaps(width, centre);
    let total: f64 = overlaps.iter().map(|(_, overlap)| overlap).sum();
    for (index, overlap) in overlaps {
        let b = texel_box(width, index % width, index / width);
        let solid_angle = (b.phi[1] - b.phi[0]) * (b.y[1] - b.y[0]);
        for c in 0..3 {
            radiance[index][c] += flux[c] * overlap / total / solid_angle;
        }
    }
}

/// The texels that the disc touches, and the solid angle of each overlap.
fn overlaps(width: usize, centre: DVec3) -> Vec<(usize, f64)> {
    let height = width / 2;
    let theta = centre.x.hypot(centre.z).atan2(centre.y);
    let azimuth = centre.z.atan2(centre.x);
    let row_of = |theta: f64| ((theta / PI * height as f64).max(0.0) as usize).min(height - 1);
    let mut overlaps = Vec::new();
    for row in row_of(theta - ANGULAR_RADIUS)..=row_of(theta + ANGULAR_RADIUS) {
        let [low, high] = texel_box(width, 0, row).y;
        // Only the part of the row that the disc can reach is cut into lines.
        let low = low.max((theta + ANGULAR_RADIUS).min(PI).cos());
        let high = high.min((theta - ANGULAR_RADIUS).max(0.0).cos());
        let step = (high - low) / LINES as f64;
        if step <= 0.0 {
            continue;
        }
        let halves: Vec<f64> = (0..LINES).map(|line| half_width(low + (line as f64 + 0.5) * step, centre)).collect();
        for column in 0..width {
            let b = texel_box(width, column, row);
            let overlap: f64 = halves.iter().map(|half| common(b.phi, azimuth, *half) * step).sum();
            if overlap > 0.0 {
                overlaps.push((row * width + column, overlap));
            }
        }
    }
    overlaps
}

/// Half the azimuth that the disc covers at height y: π if the whole parallel lies in it.
fn half_width(y: f64, centre: DVec3) -> f64 {
    let across = centre.x.hypot(centre.z) * (1.0 - y * y).max(0.0).sqrt();
    let needed = ANGULAR_RADIUS.cos() - y * centre.y;
    if needed <= -across {
        PI
    } else if needed >= across {
        0.0
    } else {
        (needed / across).acos()
    }
}

/// Length that [low, high] and centre ± half have in common, round the circle.
fn common([low, high]: [f64; 2], centre: f64, half: f64) -> f64 {
    let overlap = |turn: f64| (high.min(centre + half + turn) - low.max(centre - half + turn)).max(0.0);
    overlap(-TAU) + overlap(0.0) + overlap(TAU)
}

#[cfg(test)]
mod tests {
    use super::super::builtin::direction;
    use super::*;

    #[test]
    fn overlaps_sum_to_the_disc() {
        let disc = TAU * 2.0 * (ANGULAR_RADIUS / 2.0).sin().powi(2);
        for (elevation, azimuth) in
            [(30.0, 50.0), (89.9, 10.0), (90.0, 0.0), (-90.0, 0.0), (0.1, 179.95), (45.0, -180.0)]
        {
            for width in [16, 256, 1024, 4096] {
                let total: f64 =
                    overlaps(width, direction(elevation, azimuth)).iter().map(|(_, overlap)| overlap).sum();
                // The lines' error: the disc's edge is a square root at both ends, 1/n^1.5 each.
                let tolerance = 2.0 * (LINES as f64).powf(-1.5);
                assert!(
                    (total / disc - 1.0).abs() < tolerance,
                    "{elevation}° {azimuth}° in {width}: {total}, wanted {disc}"
                );
            }
        }
    }
}
