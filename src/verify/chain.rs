//! Judging environment chains that anybody made, and saying what they hold.
//!
//! A chain is compared with its panorama filtered by kernels of many widths, each of which is known everywhere to 1e-5. First the
//! orientation (`orientation`): then, per level, the width whose values fit best, and with it the kind of the kernel, the scale, and
//! what the level is off by. What fits badly, or no better than something else, is called unknown.
//!
//! Fits (`fitting`) are robust: fireflies, one wrong face or a constant factor do not decide the width. What the texels are off by is
//! counted at the width that was found, or that was claimed (`compared`).

mod compared;
mod findings;
mod fitting;
mod orientation;
mod reading;
mod sheens;

use orientation::Picture;
pub use orientation::{FaceFault, Orientation, Turn};
pub use reading::{is_cube, levels_of};

use crate::check::Check;
use crate::environment::chain::LEAST_SHEEN;
use crate::environment::cube::texel_direction;
use crate::environment::kernel::KernelKind;
use crate::environment::{Cube, InstructionSet, Kernel, Panorama, SphereLayout, SphereMap, Zonal, area_average};
use crate::error::{Error, Result};
use findings::findings;
use fitting::Fitting;
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::FRAC_PI_2;

/// What is asked of a chain.
#[derive(Debug, Clone, Default)]
pub struct Question<'a> {
    /// What it was made from; nothing: its own level 0 has to do.
    pub source: Option<&'a Panorama>,
    /// The kernel that it is said to have; nothing: whichever fits.
    pub kernel: Option<KernelKind>,
    /// The roughness that its levels are said to have: errors are then counted against that, not against what fits best.
    pub roughness: Option<Vec<f64>>,
    /// What a texel may be off by, in parts of the value or of 1e-3 of the mean.
    pub max_error: Option<f64>,
}

/// What a chain is.
#[derive(Debug, Clone, Serialize)]
pub struct Verdict {
    /// How the sphere lies in it.
    pub layout: SphereLayout,
    /// Texels along an edge of level 0, or its rows.
    pub size: usize,
    /// Whether it was compared with its own level 0, for want of a source.
    pub against_itself: bool,
    /// Which way round; nothing without a source.
    pub orientation: Option<Orientation>,
    /// The kernel: `nol`, `g1`, `charlie`; nothing if it is unknown.
    pub kernel: Option<KernelKind>,
    /// The next best kernel's residual in parts of the best one's, if others were tried.
    pub kernel_margin: Option<f64>,
    /// Levels are this many times the source, if it is the same for all; 1 is normalised.
    pub scale: Option<f64>,
    /// The levels.
    pub levels: Vec<LevelVerdict>,
    /// In sentences, what a person should know.
    pub findings: Vec<String>,
    /// What fails or passes.
    pub checks: Vec<Check>,
}

/// What a level is.
#[derive(Debug, Clone, Serialize)]
pub struct LevelVerdict {
    /// Texels along an edge, or rows.
    pub size: usize,
    /// Values that are not finite.
    pub nonfinite: usize,
    /// Values below zero.
    pub negative: usize,
    /// The roughness that fits best: 0 is the source itself; nothing if none fits.
    pub roughness: Option<f64>,
    /// The range of roughness that fits as well, two standard errors either way.
    pub roughness_range: Option<[f64; 2]>,
    /// Mean |ln(file/truth)|, its median removed, at that roughness.
    pub residual: f64,
    /// Median of file/truth.
    pub scale: Option<f64>,
    /// The mean over the sphere in parts of the source's, minus 1: the largest of the channels.
    pub mean_drift: f64,
    /// What texels are off by; nothing where no truth is known.
    pub error: Option<LevelError>,
}

/// What texels of a level are off by, in parts of the value or of 1e-3 of the channel's mean.
#[derive(Debug, Clone, Serialize)]
pub struct LevelError {
    /// Roughness of the truth that it is compared with.
    pub against_roughness: f64,
    /// Root mean square, texels weighted by solid angle.
    pub rms: f64,
    /// The same once the level's scale is taken off.
    pub rms_unscaled: f64,
    /// The largest.
    pub max: f64,
    /// Where that is: `face +X, texel 3, 4, R`.
    pub worst_at: String,
    /// Texels brighter than twice the truth.
    pub fireflies: usize,
    /// How many times the truth the worst of them is, and where.
    pub worst_firefly: Option<(f64, String)>,
    /// RMS of the jump of the error at the edges of faces, and of such jumps within faces: alike if there are no seams. A jump is what
    /// two straight lines through two texels each leave where they meet. Zeros for what has no faces.
    pub seams: [f64; 2],
}

impl LevelError {
    /// Whether the error jumps more at edges than within faces, and by more than rounding to halves does.
    pub fn has_seams(&self) -> bool {
        /// Eight times the rounding of a half.
        const ROUNDING: f64 = 2e-3;
        self.seams[0] > ROUNDING && self.seams[0] > 1.7 * self.seams[1]
    }
}

/// Judges a chain of cubes.
///
/// **Errors**: no levels; a list of roughness that is not one for each level.
pub fn judge(levels: &[Cube], question: &Question) -> Result<Verdict> {
    let maps: Vec<SphereMap> = levels.iter().cloned().map(SphereMap::from).collect();
    judge_maps(&maps, question)
}

/// Judges a chain of maps of one layout.
///
/// **Errors**: no levels; a list of roughness that is not one for each level.
pub fn judge_maps(levels: &[SphereMap], question: &Question) -> Result<Verdict> {
    let Some(first) = levels.first() else {
        return Err(Error::invalid("a chain without levels", "give a file that holds some"));
    };
    if let Some(claimed) = &question.roughness
        && claimed.len() != levels.len()
    {
        return Err(Error::usage(
            format!("{} values of roughness for {} levels", claimed.len(), levels.len()),
            "give one for each level",
        ));
    }
    let clean: Vec<SphereMap> = levels.iter().map(without_nonfinite).collect();
    let own = if question.source.is_none() { Some(clean[0].to_panorama()?) } else { None };
    let source = match (question.source, &own) {
        (Some(source), _) => source,
        (None, Some(own)) => own,
        (None, None) => return Err(Error::invalid("no source", "give one")),
    };
    let refined = refined(source);
    let source = refined.as_ref().unwrap_or(source);
    let orientation = question.source.map(|_| orientation_of(&clean, source)).transpose()?;
    let turn = orientation.as_ref().map_or(Some(Turn::NONE), |found| found.turn);
    let mut verdict = Verdict {
        layout: first.layout,
        size: first.size,
        against_itself: question.source.is_none(),
        orientation,
        kernel: None,
        kernel_margin: None,
        scale: None,
        levels: levels.iter().zip(&clean).map(|(level, clean)| facts(level, clean, source)).collect(),
        findings: vec![],
        checks: vec![],
    };
    if let Some(turn) = turn {
        let wrong: Vec<usize> =
            verdict.orientation.iter().flat_map(|found| found.faces.iter().map(|fault| fault.face)).collect();
        Fitting { levels: &clean, source, turn, wrong }.fit(question, &mut verdict);
    }
    verdict.findings = findings(&verdict);
    for (m, level) in verdict.levels.iter().enumerate() {
        let name = format!("level {m}");
        let count = |name: &str, of: &str, n: usize| Check::at_most(name, of, n as f64, 0.0, "counted over all texels");
        verdict.checks.push(count("values that are not finite", &name, level.nonfinite));
        if let Some(limit) = question.max_error
            && !(verdict.against_itself && m == 0)
        {
            let (figure, place) = match &level.error {
                Some(error) => (error.max, error.worst_at.clone()),
                None => (f64::NAN, "no truth fits, so that nothing is known".to_owned()),
            };
            verdict.checks.push(Check::at_most("error at the texels, relative", &name, figure, limit, place));
        }
    }
    Ok(verdict)
}

/// Rows below which a panorama's texels are so wide that kernels are not smooth within them, and each is integrated exactly.
const FEW_ROWS: usize = 192;

/// Texels beyond which a panorama is left as it is: one of strange proportions need not fill the memory.
const MOST_TEXELS: usize = 1 << 20;

/// A panorama of few texels with each cut into as many as it takes: the same function, filtered by any kernel several times as fast.
fn refined(source: &Panorama) -> Option<Panorama> {
    let (width, height) = (source.width(), source.height());
    let k = FEW_ROWS.div_ceil(height);
    if k * k * width * height > MOST_TEXELS {
        return None;
    }
    let texel = |i: usize| source.texels()[i / (k * width) / k * width + i % (k * width) / k];
    (k > 1).then(|| Panorama::new(k * width, k * height, (0..k * k * width * height).map(texel).collect()).ok())?
}

fn without_nonfinite(map: &SphereMap) -> SphereMap {
    let finite = |texel: &[f32; 3]| texel.map(|v| if v.is_finite() { v } else { 0.0 });
    SphereMap { texels: map.texels.iter().map(finite).collect(), ..*map }
}

/// What can be said of a level without knowing what it should be.
fn facts(level: &SphereMap, clean: &SphereMap, source: &Panorama) -> LevelVerdict {
    let values = || level.texels.as_flattened().iter();
    let (mean, wanted) = (clean.mean(), source.mean());
    let drift = (0..3).filter(|&c| mean[c] != wanted[c]).map(|c| mean[c] / wanted[c] - 1.0);
    LevelVerdict {
        size: level.size,
        nonfinite: values().filter(|v| !v.is_finite()).count(),
        negative: values().filter(|v| **v < 0.0).count(),
        roughness: None,
        roughness_range: None,
        residual: f64::NAN,
        scale: None,
        mean_drift: drift.fold(0.0, |most: f64, d| if d.abs() > most.abs() { d } else { most }),
        error: None,
    }
}

/// Texels along an edge of the cubes that orientations are told by, at most, and at least beside the first level's.
const COARSE: usize = 16;
const LEAST_COARSE: usize = 8;

/// The chain's orientation, from its levels and the panorama, sharp and blurred.
fn orientation_of(levels: &[SphereMap], source: &Panorama) -> Result<Orientation> {
    let layout = levels[0].layout;
    let small = |level: &SphereMap| -> Result<Cube> {
        Ok(match layout {
            SphereLayout::Cube => {
                let size = (1..=COARSE.min(level.size)).rev().find(|n| level.size.is_multiple_of(*n)).unwrap_or(1);
                shrink(level, size)
            }
            // Another map has no faces of its own: it is judged by the cube that it would be, of texels large against its own, so that
            // where those lie counts for little.
            layout => {
                let size = ((layout.texels(level.size) / 12).isqrt()).clamp(1, COARSE);
                area_average(&level.to_panorama()?, size)
            }
        })
    };
    // A sheen's kernel is a ring: what it leaves of a picture looks like no cap's.
    let rings = [0.25, 0.6, 1.0].map(|alpha| Kernel::of(KernelKind::Charlie, alpha));
    let kernels: Vec<Kernel> = [0.15, 0.5, 1.0].map(Kernel::new).into_iter().chain(rings).collect();
    let zonal = Zonal::new(source, &kernels, InstructionSet::detect());
    let blurred = SphereMap::area_average(source, SphereLayout::Equirect, 8 * COARSE, &Turn::NONE.orientation())?;
    let picture = |file: Cube| {
        let mut truths = vec![area_average(source, file.size)];
        truths.extend(kernels.iter().map(|kernel| zonal.function(kernel).cube(file.size, &|_| {})));
        truths.extend(NARROW_RINGS.map(|alpha| narrow_ring(&blurred, alpha, file.size)));
        Picture { file, truths }
    };
    let others = levels[1..].iter().filter_map(|level| small(level).ok());
    let others = others.filter(|file| file.size >= LEAST_COARSE).map(picture);
    let may_be = |turn: &Turn| layout.check_orientation(&turn.orientation()).is_ok();
    let found = orientation::find(&picture(small(&levels[0])?), others, &may_be);
    Ok(if layout.is_cube() { found } else { Orientation { faces: vec![], ..found } })
}

/// Widths of narrow sheens that are looked at.
const NARROW_RINGS: [f64; 3] = [LEAST_SHEEN * LEAST_SHEEN, 0.025, 0.1];

/// What large texels show of a map filtered by a narrow sheen: a ring's cosines are spread as the kernel's (a beta distribution of 2 and
/// p + 1) and as those within a texel, here by a normal distribution, and the map's texels count as points.
fn narrow_ring(map: &SphereMap, alpha: f64, size: usize) -> Cube {
    let p = 0.5 / alpha;
    let (middle, variance) = (2.0 / (p + 3.0), 2.0 * (p + 1.0) / ((p + 3.0).powi(2) * (p + 4.0)));
    let of_texels = (FRAC_PI_2 / size as f64).powi(2) / 12.0;
    let rate = 0.5 / (variance + of_texels);
    let weights = map.layout.solid_angles(map.size);
    let points: Vec<(DVec3, [f64; 4])> = (map.texels.iter().zip(weights).enumerate())
        .map(|(i, (texel, weight))| {
            let [r, g, b] = texel.map(|v| f64::from(v) * weight);
            (map.direction(i), [r, g, b, weight])
        })
        .collect();
    let texel = |i: usize| {
        let axis = texel_direction(size, i);
        let mut sum = [0.0; 4];
        for (towards, light) in &points {
            let off = rate * (axis.dot(*towards) - middle).powi(2);
            // Beyond four standard deviations there is nothing to see.
            if off < 8.0 {
                let k = (-off).exp();
                sum.iter_mut().zip(light).for_each(|(sum, light)| *sum += k * light);
            }
        }
        [0, 1, 2].map(|c| (sum[c] / sum[3]) as f32)
    };
    Cube { size, texels: (0..6 * size * size).into_par_iter().map(texel).collect() }
}

/// The means of square blocks of texels.
fn shrink(cube: &SphereMap, size: usize) -> Cube {
    let k = cube.size / size;
    let texel = |i: usize| {
        let (face, row, column) = (i / (size * size), i / size % size, i % size);
        let mut sum = [0.0; 3];
        for (r, c) in (0..k).flat_map(|r| (0..k).map(move |c| (r, c))) {
            let at = cube.texels[(face * cube.size + row * k + r) * cube.size + column * k + c];
            (0..3).for_each(|c| sum[c] += f64::from(at[c]));
        }
        sum.map(|s| (s / (k * k) as f64) as f32)
    };
    Cube { size, texels: (0..6 * size * size).map(texel).collect() }
}

/// The middle one of some values.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    let middle = sorted.len() / 2;
    if sorted.is_empty() { f64::NAN } else { *sorted.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// Mean |a − b − median(a − b)|.
fn log_ratio_spread(a: &[f64], b: &[f64]) -> f64 {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let middle = median(&differences);
    differences.iter().map(|d| (d - middle).abs()).sum::<f64>() / differences.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lamps on a dark ground, such that nothing turned or mirrored looks the same.
    fn lamps() -> Panorama {
        let lamps =
            [([1.0, 0.3, 0.2], 9.0), ([-0.4, 0.9, 0.5], 4.0), ([-0.3, -0.5, 0.8], 2.0), ([0.2, 0.1, -1.0], 3.0)];
        let (width, height) = (96, 48);
        let texel = |i: usize| {
            let d = SphereLayout::Equirect.direction(height, i);
            let lit =
                lamps.map(|(towards, bright)| bright * (40.0 * (d.dot(DVec3::from(towards).normalize()) - 1.0)).exp());
            [(0.2 + lit.iter().sum::<f64>()) as f32; 3]
        };
        Panorama::new(width, height, (0..width * height).map(texel).collect()).unwrap()
    }

    /// A level of a sheen by a sum over points of a map, turned.
    fn level(source: &Panorama, turn: Turn, size: usize, p: f64) -> SphereMap {
        let fine = SphereMap::area_average(source, SphereLayout::Equirect, 144, &Turn::NONE.orientation()).unwrap();
        let weights = fine.layout.solid_angles(fine.size);
        let points: Vec<DVec3> = (0..fine.texels.len()).map(|i| fine.direction(i)).collect();
        let texel = |i: usize| {
            let axis = turn.apply(texel_direction(size, i));
            let mut sum = [0.0; 4];
            for ((point, texel), weight) in points.iter().zip(&fine.texels).zip(&weights) {
                let c = axis.dot(*point);
                if c > 0.0 && c < 20.0 / p {
                    let k = c * (p * (-c).ln_1p()).exp() * weight;
                    (0..3).for_each(|channel| sum[channel] += k * f64::from(texel[channel]));
                    sum[3] += k;
                }
            }
            [0, 1, 2].map(|c| (sum[c] / sum[3]) as f32)
        };
        let texels = (0..6 * size * size).into_par_iter().map(texel).collect();
        SphereMap { layout: SphereLayout::Cube, size, texels }
    }

    /// A ring along the horizon looks the same from opposite sides: a wider one tells them apart.
    #[test]
    fn the_orientation_of_a_narrow_sheen_is_told() {
        let source = lamps();
        for (axes, signs) in [([0, 1, 2], [1; 3]), ([2, 1, 0], [1, 1, -1]), ([0, 1, 2], [-1, 1, 1])] {
            let turn = Turn { axes, signs };
            let chain = [level(&source, turn, 32, 102.0), level(&source, turn, 16, 8.0)];
            let found = orientation_of(&chain, &source).unwrap();
            assert_eq!((found.turn, found.as_good), (Some(turn), 0), "{found:?}");
        }
    }
}
