//! Judging environment chains that anybody made, and saying what they hold.
//!
//! A chain is compared with its panorama filtered by kernels of many widths, each of which is known everywhere to 1e-5. First the
//! orientation (`orientation`): then, per level, the width whose values fit best, and with it the kind of the kernel, the scale, and
//! what the level is off by. What fits badly, or no better than something else, is called unknown.
//!
//! Fits are made robust: what is made small is the mean of |ln(file/truth)|, with the median ratio as scale, so that fireflies, one
//! wrong face or a constant factor do not decide the width.

mod orientation;

pub use orientation::{FaceFault, Orientation, Turn};

use crate::check::Check;
use crate::environment::kernel::KernelKind;
use crate::environment::seamless::across_edges;
use crate::environment::{
    Cube, DARK_FLOOR, InstructionSet, Kernel, Panorama, SphereLayout, SphereMap, Zonal, area_average, atlas,
};
use crate::error::{Error, Result};
use crate::format::{Decoded, Texture};
use crate::model::alpha_of_roughness;
use glam::DVec3;
use serde::Serialize;

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

/// A texel is a firefly when it is brighter than this many times what it should be.
const FIREFLY: f64 = 2.0;
/// Widths that are tried: this many times the next.
const STEP: f64 = 1.27;
/// The narrowest that is tried.
const NARROWEST: f64 = 0.012;
/// Sheens narrower than this take seconds each: they are tried where the narrowest of the wider ones fits better than any other kernel.
const SLOW_SHEEN: f64 = 0.1;
/// Texels of a level that its width is fitted to.
const SAMPLES: usize = 768;
/// A fit is believed if it leaves at most this part of the truth's own spread, and this much of it.
const BELIEVED: f64 = 0.5;
const MOST_RESIDUAL: f64 = 0.35;
/// The spread below which a truth has nothing to compare.
const FLAT: f64 = 1e-3;
/// Another kernel must leave this many times as much for the best one to be believed.
const MARGIN: f64 = 1.1;
/// Fits closer than this cannot be told apart, whatever their ratio: rounding to halves.
const ROUNDING: f64 = 2e-4;

/// The levels of a file: a cube's; else a square's, which is an octahedral map; a panorama's that is twice as wide as high; or the chain in an
/// atlas of PlayCanvas.
///
/// **Errors**: a file of anything else.
pub fn levels_of(content: &Decoded) -> Result<Vec<SphereMap>> {
    let refused = |what: String| {
        Err(Error::unsupported(
            format!("{what}, which is no cube map, square or panorama of 2:1"),
            "give a cube texture (.ktx2, .ktx, .dds, .env), or an octahedral map or a panorama with its mips",
        ))
    };
    let texture = match content {
        Decoded::Texture(texture) if is_cube(texture) => return maps(texture, SphereLayout::Cube),
        Decoded::Texture(texture) if texture.faces == 1 && texture.array_layers <= 1 && texture.depth == 0 => texture,
        Decoded::Texture(texture) => return refused(texture.text()),
        Decoded::Picture(image, _) => {
            let layout = match (image.width, image.height) {
                (width, height) if width == height => SphereLayout::Octahedral,
                (width, height) if width == 2 * height => SphereLayout::Equirect,
                (width, height) => return refused(format!("a picture of {width} × {height}")),
            };
            return Ok(vec![SphereMap { layout, size: image.height, texels: image.rgb()? }]);
        }
        Decoded::Array(_) => return refused("an array of numbers".to_owned()),
    };
    match (texture.width, texture.height) {
        _ if atlas::is(texture) => in_atlas(texture),
        (width, height) if width == height => maps(texture, SphereLayout::Octahedral),
        (width, height) if width == 2 * height => maps(texture, SphereLayout::Equirect),
        _ => refused(texture.text()),
    }
}

/// The specular chain in an atlas.
fn in_atlas(texture: &Texture) -> Result<Vec<SphereMap>> {
    let picture = atlas::colours(texture)?;
    let level = |tile: atlas::Tile| {
        Ok(SphereMap { layout: SphereLayout::Atlas, size: tile.size, texels: atlas::cut(&picture, &tile)? })
    };
    (0..atlas::LEVELS).map(atlas::specular).map(level).collect()
}

/// Whether a texture is a single cube map of colours.
pub fn is_cube(texture: &Texture) -> bool {
    texture.faces == 6 && texture.array_layers <= 1 && texture.width == texture.height
}

fn maps(texture: &Texture, layout: SphereLayout) -> Result<Vec<SphereMap>> {
    let n = texture.format.channels();
    let level = |m: usize| {
        let [_, size] = texture.level_size(m);
        let values = (0..texture.faces).flat_map(|face| texture.face(m, face).unwrap_or_default());
        // One channel is grey, two are grey and alpha.
        let colour = |t: &[f32]| if n < 3 { [t[0]; 3] } else { [t[0], t[1], t[2]] };
        let texels: Vec<[f32; 3]> = values.collect::<Vec<f32>>().chunks_exact(n).map(colour).collect();
        if texels.len() != layout.texels(size) {
            return Err(Error::invalid(
                format!("level {m} is not {} of {}", layout.article(), layout.size_text(size)),
                "write the file again",
            ));
        }
        Ok(SphereMap { layout, size, texels })
    };
    // Of a panorama the level of one row is not twice as wide as high, and says no more than a colour.
    let is_whole = |m: &usize| layout.shape(texture.level_size(*m)[1]).0 == texture.level_size(*m);
    (0..texture.levels.len()).take_while(is_whole).map(level).collect()
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
    let orientation = question.source.map(|_| orientation_of(&clean[0], source)).transpose()?;
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

/// The chain's orientation, from its level 0 and the panorama, sharp and blurred.
fn orientation_of(level: &SphereMap, source: &Panorama) -> Result<Orientation> {
    const COARSE: usize = 16;
    let (file, size) = match level.layout {
        SphereLayout::Cube => {
            let size = (1..=COARSE.min(level.size)).rev().find(|n| level.size.is_multiple_of(*n)).unwrap_or(1);
            (shrink(level, size), size)
        }
        // Another map has no faces of its own: it is judged by the cube that it would be, of texels large against its own, so that where
        // those lie counts for little.
        layout => {
            let size = ((layout.texels(level.size) / 12).isqrt()).clamp(1, COARSE);
            (area_average(&level.to_panorama()?, size), size)
        }
    };
    let mut truths = vec![area_average(source, size)];
    // A sheen's kernel is a ring: what it leaves of a picture looks like no cap's.
    let rings = [0.25, 0.6, 1.0].map(|alpha| Kernel::of(KernelKind::Charlie, alpha));
    let kernels: Vec<Kernel> = [0.15, 0.5, 1.0].map(Kernel::new).into_iter().chain(rings).collect();
    let zonal = Zonal::new(source, &kernels, InstructionSet::detect());
    truths.extend(kernels.iter().map(|kernel| zonal.function(kernel).cube(size, &|_| {})));
    let found = orientation::find(&file, &truths, &|turn| level.layout.check_orientation(&turn.orientation()).is_ok());
    Ok(if level.layout.is_cube() { found } else { Orientation { faces: vec![], ..found } })
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

/// A chain that is being fitted.
struct Fitting<'a> {
    levels: &'a [SphereMap],
    source: &'a Panorama,
    turn: Turn,
    /// Faces that say nothing.
    wrong: Vec<usize>,
}

/// Some values of a level, and what the candidates have there, all as logarithms.
struct Sample {
    seen: Vec<f64>,
    /// The source averaged over the texels.
    mirror: Vec<f64>,
    /// For each width.
    wide: Vec<Vec<f64>>,
}

/// The width that fits a level best.
#[derive(Debug, Clone, Copy)]
struct Best {
    /// 0 for the source itself.
    alpha: f64,
    range: [f64; 2],
    residual: f64,
    /// The spread of the truth itself.
    own: f64,
}

impl Best {
    fn is_believed(&self) -> bool {
        // What is the same everywhere tells nothing of widths.
        self.own > FLAT && self.residual <= BELIEVED * self.own && self.residual <= MOST_RESIDUAL
    }
}

impl Fitting<'_> {
    fn fit(&self, question: &Question, verdict: &mut Verdict) {
        // A kernel of alpha 1/size is as wide as a texel: what is narrower looks like the source itself.
        let narrowest = NARROWEST.max(1.0 / self.levels[0].size.max(2) as f64);
        let n = ((1.0 / narrowest).ln() / STEP.ln()).ceil() as usize;
        let alphas: Vec<f64> = (0..=n).map(|i| (narrowest.ln() * (1.0 - i as f64 / n as f64)).exp()).collect();
        let kinds: Vec<KernelKind> = question.kernel.map_or(KernelKind::ALL.to_vec(), |kind| vec![kind]);
        let first = usize::from(verdict.against_itself);
        // Fits of every level by every kind.
        let mut fits: Vec<Vec<Best>> = vec![];
        for &kind in &kinds {
            let quick = match kind {
                KernelKind::Charlie => alphas.partition_point(|&alpha| alpha < SLOW_SHEEN).min(n),
                KernelKind::Nol | KernelKind::G1 => 0,
            };
            let mut fit = self.best_widths(kind, &alphas[quick..]);
            let may_be_narrower = |(m, best): (usize, &Best)| {
                let narrowest = best.alpha > 0.0 && best.alpha < 1.001 * alphas[quick];
                narrowest && fits.iter().all(|others| best.residual <= others[m].residual)
            };
            if quick > 0 && fit.iter().enumerate().any(may_be_narrower) {
                fit = self.best_widths(kind, &alphas);
            }
            fits.push(fit);
        }
        let total = |fits: &[Best]| {
            let told = fits[first.min(fits.len())..].iter().filter(|best| best.alpha > 0.0);
            let (sum, n) = told.fold((0.0, 0), |(sum, n), best| (sum + best.residual, n + 1));
            (sum / f64::from(n.max(1)), n)
        };
        let mut order: Vec<usize> = (0..kinds.len()).collect();
        order.sort_by(|&a, &b| total(&fits[a]).0.total_cmp(&total(&fits[b]).0));
        let chosen = order[0];
        let (best, judged) = total(&fits[chosen]);
        if let Some(&second) = order.get(1) {
            let other = total(&fits[second]).0;
            verdict.kernel_margin = Some(other / best.max(f64::MIN_POSITIVE));
            if judged > 0 && other > MARGIN * best + ROUNDING {
                verdict.kernel = Some(kinds[chosen]);
            }
        } else if judged > 0 {
            verdict.kernel = Some(kinds[chosen]);
        }
        for (m, best) in fits[chosen].iter().enumerate() {
            let level = &mut verdict.levels[m];
            level.residual = best.residual;
            if best.is_believed() && !(m == 0 && verdict.against_itself) {
                level.roughness = Some(best.alpha.sqrt());
                level.roughness_range = Some(best.range.map(f64::sqrt));
            }
        }
        // A kernel that none of the levels was believed for is none.
        if verdict.levels.iter().all(|level| level.roughness.is_none_or(|r| r == 0.0)) {
            verdict.kernel = None;
        }
        self.errors(kinds[chosen], question, verdict);
        let scales: Vec<f64> = verdict.levels.iter().filter_map(|level| level.scale).collect();
        let middle = median(&scales);
        let alike = scales.iter().all(|s| (s / middle - 1.0).abs() < 0.05);
        verdict.scale = Some(middle).filter(|_| alike && !scales.is_empty());
    }

    /// The width that fits each level best.
    fn best_widths(&self, kind: KernelKind, alphas: &[f64]) -> Vec<Best> {
        let kernels: Vec<Kernel> = alphas.iter().map(|&alpha| Kernel::of(kind, alpha)).collect();
        let zonal = Zonal::new(self.source, &kernels, InstructionSet::detect());
        let texels: Vec<Vec<usize>> = self.levels.iter().map(|level| self.chosen(level)).collect();
        let directions: Vec<DVec3> = (self.levels.iter().zip(&texels))
            .flat_map(|(level, texels)| texels.iter().map(|&i| self.turn.apply(level.direction(i))))
            .collect();
        let mut values: Vec<Vec<[f64; 3]>> = vec![];
        for kernel in &kernels {
            values.push(zonal.function(kernel).values(&directions));
        }
        let mut begin = 0;
        let mean = self.source.mean();
        let log = |value: [f64; 3]| logs(value, mean);
        (self.levels.iter().zip(&texels))
            .map(|(level, texels)| {
                let range = begin..begin + texels.len();
                begin = range.end;
                let mirror = self.mirror(level);
                let wide = |values: &Vec<[f64; 3]>| values[range.clone()].iter().flat_map(|v| log(*v)).collect();
                // The file's own scale must not meet the floor: it is brought to the source's mean first.
                let factor = self.factor(level);
                let seen = |&i: &usize| log(std::array::from_fn(|c| f64::from(level.texels[i][c]) * factor));
                let sample = Sample {
                    seen: texels.iter().flat_map(seen).collect(),
                    mirror: texels.iter().flat_map(|&i| log(mirror[i].map(f64::from))).collect(),
                    wide: values.iter().map(wide).collect(),
                };
                sample.best(alphas)
            })
            .collect()
    }

    /// The source averaged over a level's texels, turned as the file is.
    fn mirror(&self, level: &SphereMap) -> Vec<[f32; 3]> {
        SphereMap::area_average(self.source, level.layout, level.size, &self.turn.orientation())
            .expect("turns are found among those that the layout has")
            .texels
    }

    /// What brings a level to the source's mean.
    fn factor(&self, level: &SphereMap) -> f64 {
        let (mean, wanted) = (level.mean().iter().sum::<f64>(), self.source.mean().iter().sum::<f64>());
        if mean > 0.0 && wanted > 0.0 { wanted / mean } else { 1.0 }
    }

    /// Texels spread over the faces that can be believed.
    fn chosen(&self, level: &SphereMap) -> Vec<usize> {
        let area = level.size * level.size;
        let all: Vec<usize> = (0..level.texels.len()).filter(|i| !self.wrong.contains(&(i / area))).collect();
        let step = (all.len() as f64 / SAMPLES as f64).max(1.0);
        // A step that is no whole number walks through all columns.
        (0..).map(|k| (f64::from(k) * step) as usize).take_while(|&i| i < all.len()).map(|i| all[i]).collect()
    }

    /// What every texel is off by, against the exact functions of the widths that were found, or that were claimed.
    fn errors(&self, kind: KernelKind, question: &Question, verdict: &mut Verdict) {
        let claimed = |m: usize| question.roughness.as_ref().map(|list| list[m]);
        let wanted: Vec<Option<f64>> =
            verdict.levels.iter().enumerate().map(|(m, level)| claimed(m).or(level.roughness)).collect();
        let alphas = wanted.iter().flatten().map(|&r| alpha_of_roughness(r)).filter(|&alpha| alpha > 0.0);
        let kernels: Vec<Kernel> = alphas.map(|alpha| Kernel::of(kind, alpha.min(1.0))).collect();
        let zonal = Zonal::new(self.source, &kernels, InstructionSet::detect());
        let skip = usize::from(verdict.against_itself);
        for (m, roughness) in wanted.into_iter().enumerate().skip(skip) {
            let (Some(roughness), map) = (roughness, &self.levels[m]) else { continue };
            let alpha = alpha_of_roughness(roughness).min(1.0);
            let truth: Vec<[f64; 3]> = if alpha > 0.0 {
                let directions = (0..map.texels.len()).map(|i| self.turn.apply(map.direction(i)));
                zonal.function(&Kernel::of(kind, alpha)).values(&directions.collect::<Vec<_>>())
            } else {
                self.mirror(map).into_iter().map(|texel| texel.map(f64::from)).collect()
            };
            let level = Compared { map, truth: &truth, mean: self.source.mean() };
            let scale = level.scale();
            verdict.levels[m].scale = Some(scale);
            verdict.levels[m].error = Some(level.error(roughness, scale));
        }
    }
}

/// Logarithms of the channels, in parts of their means, none darker than [`DARK_FLOOR`]; black channels are all alike.
fn logs(value: [f64; 3], mean: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| if mean[c] > 0.0 { (value[c].max(0.0) / mean[c] + DARK_FLOOR).ln() } else { 0.0 })
}

impl Sample {
    fn residual(&self, truth: &[f64]) -> f64 {
        log_ratio_spread(&self.seen, truth)
    }

    /// The candidate of any width, by Lagrange interpolation of degree three in ln α between those that were computed.
    fn at(&self, position: f64) -> Vec<f64> {
        let n = self.wide.len();
        if n < 4 {
            return self.wide[position.round().clamp(0.0, n as f64 - 1.0) as usize].clone();
        }
        let low = (position.floor() as isize - 1).clamp(0, n as isize - 4) as usize;
        let t = position - low as f64;
        let weight = |k: usize| {
            let others = (0..4).filter(|&j| j != k);
            others.map(|j| (t - j as f64) / (k as f64 - j as f64)).product::<f64>()
        };
        let weights = [weight(0), weight(1), weight(2), weight(3)];
        (0..self.seen.len()).map(|i| (0..4).map(|k| weights[k] * self.wide[low + k][i]).sum()).collect()
    }

    /// The best width, by golden section between the best of those that were computed and its neighbours.
    fn best(&self, alphas: &[f64]) -> Best {
        let last = alphas.len() - 1;
        let coarse: Vec<f64> = self.wide.iter().map(|truth| self.residual(truth)).collect();
        let start = (0..=last).min_by(|&a, &b| coarse[a].total_cmp(&coarse[b])).unwrap_or(0);
        let of = |position: f64| self.residual(&self.at(position));
        let (mut low, mut high) = (start.saturating_sub(1) as f64, (start + 1).min(last) as f64);
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let mut inner = [high - golden * (high - low), low + golden * (high - low)];
        let mut found = inner.map(of);
        for _ in 0..18 {
            if found[0] < found[1] {
                (high, inner[1], found[1]) = (inner[1], inner[0], found[0]);
                inner[0] = high - golden * (high - low);
                found[0] = of(inner[0]);
            } else {
                (low, inner[0], found[0]) = (inner[0], inner[1], found[1]);
                inner[1] = low + golden * (high - low);
                found[1] = of(inner[1]);
            }
        }
        let (mut position, mut residual) = (0.5 * (low + high), of(0.5 * (low + high)));
        // The ends of the range are no minimum of the section, but may well be the best.
        for end in [0, last] {
            if coarse[end] <= residual {
                (position, residual) = (end as f64, coarse[end]);
            }
        }
        let zeros = vec![0.0; self.seen.len()];
        let mirror = self.residual(&self.mirror);
        if mirror <= residual {
            return Best { alpha: 0.0, range: [0.0; 2], residual: mirror, own: log_ratio_spread(&self.mirror, &zeros) };
        }
        let truth = self.at(position);
        let alpha = |position: f64| {
            let (floor, rest) = (position.floor() as usize, position.fract());
            let next = alphas[(floor + 1).min(last)];
            (alphas[floor.min(last)].ln() * (1.0 - rest) + next.ln() * rest).exp()
        };
        Best {
            alpha: alpha(position),
            range: self.range(position, last as f64).map(alpha),
            residual,
            own: log_ratio_spread(&truth, &zeros),
        }
    }

    /// Positions on either side at which the fit is worse by two standard errors of the difference.
    fn range(&self, position: f64, last: f64) -> [f64; 2] {
        const STEP: f64 = 0.02;
        let off = |truth: &[f64]| {
            let differences: Vec<f64> = self.seen.iter().zip(truth).map(|(a, b)| a - b).collect();
            let middle = median(&differences);
            differences.into_iter().map(|d| (d - middle).abs()).collect::<Vec<f64>>()
        };
        let best = off(&self.at(position));
        let worse = |at: f64| {
            let there = off(&self.at(at));
            let n = best.len() as f64;
            let each = || there.iter().zip(&best).map(|(a, b)| a - b);
            let mean = each().sum::<f64>() / n;
            let variance = each().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
            mean > 2.0 * (variance / n).sqrt()
        };
        let walk = |sign: f64| {
            let mut at = position;
            while (0.0..=last).contains(&(at + sign * STEP)) {
                at += sign * STEP;
                if worse(at) {
                    break;
                }
            }
            at
        };
        [walk(-1.0), walk(1.0)]
    }
}

/// A level beside its truth.
struct Compared<'a> {
    map: &'a SphereMap,
    truth: &'a [[f64; 3]],
    mean: [f64; 3],
}

impl Compared<'_> {
    fn floor(&self, texel: usize, c: usize) -> f64 {
        self.truth[texel][c].abs().max(DARK_FLOOR * self.mean[c].abs())
    }

    /// The median of file/truth over texels and channels.
    fn scale(&self) -> f64 {
        let lit = |i: usize| (0..3).filter(move |&c| self.truth[i][c] > DARK_FLOOR * self.mean[c]);
        let ratios = (0..self.truth.len())
            .flat_map(|i| lit(i).map(move |c| f64::from(self.map.texels[i][c]) / self.truth[i][c]));
        let middle = median(&ratios.collect::<Vec<_>>());
        if middle.is_finite() { middle } else { 1.0 }
    }

    fn error(&self, against_roughness: f64, scale: f64) -> LevelError {
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

/// What a person should know, in sentences.
fn findings(verdict: &Verdict) -> Vec<String> {
    let mut found = vec![];
    if let Some(orientation) = &verdict.orientation {
        found.push(format!("orientation: {}", orientation.name));
        found.extend(orientation.faces.iter().map(|fault| fault.text.clone()));
    }
    let first = usize::from(verdict.against_itself);
    let judged = &verdict.levels[first..];
    match verdict.kernel {
        Some(kind) => found.push(format!("kernel: {}", kind.name())),
        None if judged.is_empty() => found.push("kernel: unknown; give what it was made from with --source".to_owned()),
        None if judged.iter().all(|level| level.roughness == Some(0.0)) => {
            found.push("kernel: none, mirrors only".to_owned())
        }
        None => found.push("kernel: unknown".to_owned()),
    }
    match verdict.scale {
        Some(scale) => found.push(format!("scale: {}", scale_name(scale))),
        None if judged.iter().any(|level| level.scale.is_some()) => {
            found.push("scale: not normalised, levels differ".to_owned());
        }
        None => found.push("scale: unknown".to_owned()),
    }
    for (m, level) in verdict.levels.iter().enumerate() {
        if level.nonfinite > 0 {
            found.push(format!("level {m}: {} values are not finite", level.nonfinite));
        }
        if level.negative > 0 {
            found.push(format!("level {m}: {} values are negative", level.negative));
        }
        let Some(error) = &level.error else { continue };
        if let Some((times, place)) = &error.worst_firefly {
            found.push(format!(
                "level {m}: {} fireflies, the worst {times:.3} times the truth at {place}",
                error.fireflies
            ));
        }
        if error.has_seams() {
            let [across, beside] = error.seams.map(|step| 100.0 * step);
            found.push(format!("level {m}: seams, jumps of {across:.2} % at edges, {beside:.2} % within faces"));
        }
    }
    found
}

/// What a factor is called.
fn scale_name(scale: f64) -> String {
    use std::f64::consts::PI;
    let near = |wanted: f64| (scale / wanted - 1.0).abs() < 0.03;
    match scale {
        _ if near(1.0) => "normalised".to_owned(),
        _ if near(PI) => format!("not normalised: multiplied by π ({scale:.4}), as irradiance E instead of E/π"),
        _ if near(1.0 / PI) => format!("not normalised: divided by π ({scale:.4})"),
        _ => format!("not normalised: {scale:.4} times the source ({:+.2} EV)", scale.log2()),
    }
}
