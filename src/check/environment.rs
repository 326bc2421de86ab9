//! Facts about the values of an environment's cubes.

use super::{Check, Precision, SIGMAS, WITNESS_POINTS, weyl};
use crate::environment::cube::texel_direction;
use crate::environment::full_sum::FullSum;
use crate::environment::{Cube, CubeLookup, DARK_FLOOR, Kernel, Panorama, area_average};
use crate::model::alpha_of_roughness;
use crate::pack::{TexelFormat, bc6h};
use glam::DVec3;
use rayon::prelude::*;

/// One cube and what is claimed of it.
#[derive(Debug, Clone)]
pub struct CubeLevel {
    /// `specular 0`, `irradiance`.
    pub name: String,
    /// Texels along an edge.
    pub size: usize,
    /// The artist's roughness.
    pub roughness: f64,
    /// Six faces, rows, texels.
    pub texels: Vec<[f32; 3]>,
    /// The claimed lookup error of a level whose texels are chosen for the lookup: it is judged by that, not texel by texel.
    pub fitted: Option<CubeLookup>,
    /// Largest standard error (or bound, for a deterministic level) in parts of max(value, 1e-3 × the channel's mean).
    pub max_error: f64,
    /// Root mean square of the same.
    pub rms_error: f64,
}

/// The cubes of an environment.
#[derive(Debug, Clone, Copy)]
pub struct EnvironmentValues<'a> {
    /// All cubes.
    pub levels: &'a [CubeLevel],
    /// What packing may have changed. Values that the format has no room for are stored as the nearest that it has.
    pub precision: Precision,
}

/// A value that is wrong by how much, and by how much it may be.
struct Deviation {
    place: String,
    figure: f64,
    limit: f64,
}

impl Deviation {
    fn ratio(&self) -> f64 {
        if self.figure.is_nan() { f64::INFINITY } else { self.figure / self.limit.max(f64::MIN_POSITIVE) }
    }
}

fn worst(name: &str, subject: &str, deviations: Vec<Deviation>) -> Option<Check> {
    let count = deviations.len();
    let worst = deviations.into_iter().max_by(|a, b| a.ratio().total_cmp(&b.ratio()))?;
    let detail = format!("worst of {count} at {}", worst.place);
    Some(Check::at_most(name, subject, worst.figure, worst.limit, detail))
}

/// Where a texel is, for a report.
fn place(size: usize, texel: usize, channel: usize) -> String {
    let (face, rest) = (texel / (size * size), texel % (size * size));
    let (face, channel) = (["+X", "-X", "+Y", "-Y", "+Z", "-Z"][face], ["R", "G", "B"][channel]);
    format!("face {face}, texel {}, {}, {channel}", rest % size, rest / size)
}

impl EnvironmentValues<'_> {
    /// What can be said without the panorama: every value finite, and not negative unless the input was.
    pub fn facts(&self, may_be_negative: bool) -> Vec<Check> {
        let mut checks = vec![];
        for level in self.levels {
            let values = || level.texels.iter().flatten();
            let bad = values().filter(|v| !v.is_finite()).count();
            checks.push(Check::at_most(
                "values that are not finite",
                &level.name,
                bad as f64,
                0.0,
                "counted over all texels",
            ));
            if !may_be_negative {
                let negative = values().filter(|&&v| v < 0.0).count();
                let detail = "counted over all texels";
                checks.push(Check::at_most("values below zero", &level.name, negative as f64, 0.0, detail));
            }
        }
        checks
    }

    /// The cubes against the panorama: level 0 against the exact area average at every texel, the others against the full
    /// sum at texels of the check's own choosing (at all of them if `full`), and a constant panorama against itself.
    pub fn against(&self, panorama: &Panorama, seed: u64, full: bool) -> Vec<Check> {
        let sum = FullSum::new(panorama);
        let constant = panorama.min().map(f64::from);
        let is_constant = panorama.texels().iter().all(|t| t.map(f64::from) == constant);
        let mut checks = vec![];
        for (index, level) in self.levels.iter().enumerate() {
            if is_constant {
                let deviations = self.compare(level, panorama, all(level), |_| constant, true);
                checks.extend(worst("distance from the constant input", &level.name, deviations));
                continue;
            }
            let alpha = alpha_of_roughness(level.roughness);
            if alpha == 0.0 {
                let average = area_average(panorama, level.size);
                let truth = |texel: usize| average.texels[texel].map(f64::from);
                let deviations = self.compare(level, panorama, all(level), truth, false);
                checks.extend(worst("exact area average at every texel", &level.name, deviations));
                continue;
            }
            if alpha * level.size as f64 >= RESOLVED {
                checks.push(mean_check(level, panorama));
            }
            let kernel = Kernel::new(alpha);
            if let Some(claimed) = &level.fitted {
                checks.extend(lookup_checks(level, panorama, &sum, &kernel, claimed, seed.wrapping_add(index as u64)));
                continue;
            }
            let texels = if full { all(level) } else { chosen(level, panorama, seed.wrapping_add(index as u64)) };
            let name = if full {
                "full sum at every texel".to_owned()
            } else {
                format!("full sum at {} texels", texels.len())
            };
            let truth = |texel: usize| sum.evaluate(texel_direction(level.size, texel), &kernel);
            checks.extend(worst(&name, &level.name, self.compare(level, panorama, texels, truth, false)));
        }
        checks
    }

    /// The brightest value of each block, where texels are stored in such.
    fn brightest_of_blocks(&self, level: &CubeLevel) -> Option<Vec<f64>> {
        let faces = level.texels.chunks_exact(level.size * level.size);
        let of_face = |face: &[[f32; 3]]| bc6h::brightest_of_blocks(level.size, level.size, face.as_flattened());
        (self.precision.format() == Some(TexelFormat::Bc6h)).then(|| faces.flat_map(of_face).collect())
    }

    fn compare(
        &self,
        level: &CubeLevel,
        panorama: &Panorama,
        texels: Vec<usize>,
        truth: impl Fn(usize) -> [f64; 3] + Sync,
        exactly: bool,
    ) -> Vec<Deviation> {
        let mean = panorama.mean();
        let blocks = self.brightest_of_blocks(level);
        texels
            .into_par_iter()
            .flat_map_iter(|texel| {
                let wanted = truth(texel);
                let wanted = [0, 1, 2].map(|c| self.precision.fit(c, wanted[c]));
                let of_texel = wanted.into_iter().fold(0.0, f64::max);
                let brightest = blocks.as_ref().map_or(of_texel, |blocks| blocks[block(level, texel)]);
                (0..3).map(move |c| {
                    let wanted = wanted[c];
                    let scale = wanted.abs().max(DARK_FLOOR * mean[c].abs());
                    let rounding = self.precision.tolerance_in(c, wanted, brightest);
                    let limit = if exactly { rounding } else { SIGMAS * level.max_error * scale + rounding };
                    let figure = (f64::from(level.texels[texel][c]) - wanted).abs();
                    Deviation { place: place(level.size, texel, c), figure, limit }
                })
            })
            .collect()
    }
}

/// What a point between those that were looked at may be off by, in parts of the largest that was seen.
const BETWEEN: f64 = 2.0;
/// Directions that the full sum is asked for of a fitted level.
const LOOKUPS: usize = 192;

/// A fitted level against the full sum, through the filtering that it is made for: towards texels' centres, where fitted texels are off
/// most, and anywhere between.
fn lookup_checks(
    level: &CubeLevel,
    panorama: &Panorama,
    sum: &FullSum,
    kernel: &Kernel,
    claimed: &CubeLookup,
    seed: u64,
) -> Vec<Check> {
    let cube = Cube { size: level.size, texels: level.texels.clone() };
    let mean = panorama.mean();
    let n = level.texels.len() as f64;
    let centres = chosen(level, panorama, seed);
    let anywhere = weyl(seed, LOOKUPS).map(|a| {
        // A spiral of even density over the sphere, from a start that the seed names.
        let (y, turn) = (1.0 - 2.0 * a, a * n * 0.618_033_988_749_894_9);
        let (sin, cos) = (turn.fract() * std::f64::consts::TAU).sin_cos();
        let across = (1.0 - y * y).max(0.0).sqrt();
        DVec3::new(across * cos, y, across * sin)
    });
    let directions: Vec<DVec3> = anywhere.chain(centres.iter().map(|&t| texel_direction(level.size, t))).collect();
    let errors: Vec<f64> = directions
        .par_iter()
        .map(|&direction| {
            let (wanted, seen) = (sum.evaluate(direction, kernel), cube.filtered(direction));
            (0..3)
                .map(|c| {
                    let scale = wanted[c].abs().max(DARK_FLOOR * mean[c].abs());
                    let off = if seen[c] == wanted[c] { 0.0 } else { (seen[c] - wanted[c]).abs() / scale };
                    if off.is_nan() { f64::INFINITY } else { off }
                })
                .fold(0.0, f64::max)
        })
        .collect();
    let worst = (0..errors.len()).max_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
    let [x, y, z] = directions[worst].to_array();
    let detail = format!("worst of {} towards ({x:.3}, {y:.3}, {z:.3})", errors.len());
    let name = "full sum through bilinear filtering, relative";
    vec![Check::at_most(name, &level.name, errors[worst], BETWEEN * claimed.max, detail)]
}

/// The block of a texel of a cube, face after face.
fn block(level: &CubeLevel, texel: usize) -> usize {
    let area = level.size * level.size;
    let per_face = level.size.div_ceil(bc6h::BLOCK).pow(2);
    texel / area * per_face + bc6h::block_of(level.size, texel % area)
}

/// A level resolves its kernel when alpha is at least this many texels' widths in parts of the face: then texel centres sum to
/// the mean of the filtered function but for [`TEXEL_SUM`].
const RESOLVED: f64 = 4.0;
/// Centres of texels that resolve the kernel sum to the flux of a lone sun within 2e-3; this leaves room for packing.
const TEXEL_SUM: f64 = 4e-3;

/// Filtering keeps the mean over the sphere; errors are alike in all texels, so that they do not average out.
fn mean_check(level: &CubeLevel, panorama: &Panorama) -> Check {
    let cube = Cube { size: level.size, texels: level.texels.clone() };
    let (found, wanted) = (cube.mean(), panorama.mean());
    let off = |c: usize| if found[c] == wanted[c] { 0.0 } else { (found[c] / wanted[c] - 1.0).abs() };
    let figure = (0..3).map(off).map(|d| if d.is_nan() { f64::INFINITY } else { d }).fold(0.0, f64::max);
    let detail = "largest of the channels, texels weighted by solid angle";
    Check::at_most(
        "mean over the sphere against the input's, relative",
        &level.name,
        figure,
        TEXEL_SUM + SIGMAS * level.rms_error,
        detail,
    )
}

fn all(level: &CubeLevel) -> Vec<usize> {
    (0..level.texels.len()).collect()
}

/// Texels spread over the sphere, and those where filters fail: towards the brightest texel, beside it, on the ring at 90° from
/// it, opposite to it, and in the corners of the faces.
fn chosen(level: &CubeLevel, panorama: &Panorama, seed: u64) -> Vec<usize> {
    let n = level.texels.len();
    let mut texels: Vec<usize> = weyl(seed, WITNESS_POINTS).map(|t| (t * n as f64) as usize).collect();
    let (column, row, _) = panorama.peak();
    let sun = panorama.texel_box(column, row).middle();
    let (side, up) = sun.any_orthonormal_pair();
    let ring = (0..8).map(|i| {
        let (sin, cos) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
        side * cos + up * sin
    });
    let beside = [0.03, 0.1, 0.3]
        .into_iter()
        .flat_map(|angle: f64| [side, up, -side, -up].map(|away| sun * angle.cos() + away * angle.sin()));
    let aims: Vec<DVec3> = [sun, -sun].into_iter().chain(ring).chain(beside).collect();
    texels.extend(aims.into_iter().map(|d| crate::environment::cube::nearest_texel(level.size, d)));
    let last = level.size * level.size - 1;
    texels.extend((0..6).flat_map(|face| [face * (last + 1), face * (last + 1) + last]));
    texels.sort_unstable();
    texels.dedup();
    texels
}
