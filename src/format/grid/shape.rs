//! The shape of numbers that come without one: that in which they are smooth.

use super::Shape;
use crate::error::{Error, Result};

/// How much smoother the best shape must be than the next before it is taken for granted.
const CLEARLY_SMOOTHER: f64 = 1.3;

/// The shape in which flat numbers are smoothest: of one dimension, of a square or a cube, with one to four channels.
pub(super) fn guess(values: &[f64], n: usize, planar: bool) -> Result<Shape> {
    let mut shapes = vec![];
    for channels in 1..=4 {
        if !n.is_multiple_of(channels) {
            continue;
        }
        let texels = n / channels;
        let side = (texels as f64).sqrt().round() as usize;
        let edge = (texels as f64).cbrt().round() as usize;
        if side * side == texels && side > 1 {
            shapes.push(Shape { size: [side, side, 1], channels });
        }
        if edge * edge * edge == texels && edge > 1 {
            shapes.push(Shape { size: [edge; 3], channels });
        }
        if texels <= LONGEST_ROW && texels > 1 {
            shapes.push(Shape { size: [texels, 1, 1], channels });
        }
    }
    let mut rated: Vec<(f64, Shape)> = shapes.into_iter().map(|s| (roughness(values, s, planar), s)).collect();
    rated.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A smooth axis looks as smooth when it is cut into channels, or into shorter axes: take it whole.
    let best = rated.first().map_or(0.0, |r| r.0);
    let fewest = alike(&rated, best).map(|s| s.channels).min();
    let whole: Vec<Shape> = alike(&rated, best).filter(|s| Some(s.channels) == fewest).copied().collect();
    // What is cut wrongly into a long row jumps at every end of a short one.
    let longest = whole.into_iter().max_by_key(|s| s.size[0]);
    match (&rated[..], longest) {
        ([(_, only)], _) => Ok(*only),
        ([(best, shape), (next, _), ..], _) if *next > CLEARLY_SMOOTHER * best => Ok(*shape),
        (_, Some(longest)) => Ok(longest),
        (_, None) => Err(Error::usage(
            format!("{n} numbers without a shape"),
            format!(
                "give it as WIDTHxHEIGHTxCHANNELS, such as --shape {}",
                rated.first().map_or("64x64x2".to_owned(), |r| r.1.to_string())
            ),
        )),
    }
}

/// The shapes that are about as smooth as the best.
fn alike(rated: &[(f64, Shape)], best: f64) -> impl Iterator<Item = &Shape> {
    rated.iter().filter(move |(roughness, _)| *roughness <= CLEARLY_SMOOTHER * best).map(|(_, shape)| shape)
}

/// Texels of a table over one axis at most, where nothing says that it is one.
const LONGEST_ROW: usize = 1024;

/// The mean distance of neighbouring texels, along all dimensions and in parts of the mean distance of any two: small where the
/// shape is right.
pub(super) fn roughness(values: &[f64], shape: Shape, planar: bool) -> f64 {
    let interleaved;
    let values = if planar {
        interleaved = super::interleaved(values, shape.channels);
        &interleaved
    } else {
        values
    };
    let (n, [w, h, d]) = (shape.channels, shape.size);
    let mut total = 0.0;
    for c in 0..n {
        let channel: Vec<f64> = values.iter().copied().skip(c).step_by(n).collect();
        let mean = channel.iter().sum::<f64>() / channel.len() as f64;
        let spread = channel.iter().map(|v| (v - mean).abs()).sum::<f64>() / channel.len() as f64;
        let mut worst = 0.0_f64;
        for (stride, size) in [(1, w), (w, h), (w * h, d)] {
            if size < 2 {
                continue;
            }
            // Distances in texture coordinates, not in texels: or else finer shapes always look smoother.
            let (mut sum, mut pairs) = (0.0, 0.0);
            for i in (0..channel.len()).filter(|i| i / stride % size + 1 < size) {
                sum += (channel[i + stride] - channel[i]).abs();
                pairs += 1.0;
            }
            worst = worst.max(sum / pairs * size as f64);
        }
        total += worst / spread.max(1e-12);
    }
    total / n as f64
}
