//! Facts about the values of an environment's cubes.

use super::{Check, Precision, SIGMAS, WITNESS_POINTS, weyl};
use crate::environment::full_sum::FullSum;
use crate::environment::seamless::means_to_judge_by;
use crate::environment::{
    CubeLookup, Kernel, KernelKind, Orientation, Panorama, SphereLayout, SphereMap, View, ViewLobe, error_scale,
    relative_error,
};
use crate::model::alpha_of_roughness;
use crate::pack::{TexelFormat, blocks};
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;

/// One cube and what is claimed of it.
#[derive(Debug, Clone)]
pub struct CubeLevel {
    /// `specular 0`, `irradiance`.
    pub name: String,
    /// Texels along an edge, or rows.
    pub size: usize,
    /// The artist's roughness.
    pub roughness: f64,
    /// What it weighs directions by.
    pub kernel: KernelKind,
    /// How the surface is seen, if not as N = V = R.
    pub view: Option<View>,
    /// Faces, rows, texels.
    pub texels: Vec<[f32; 3]>,
    /// The claimed lookup error of a level whose texels are chosen for the lookup: it is judged by that, not texel by texel.
    pub fitted: Option<CubeLookup>,
    /// Largest standard error (or bound, for a deterministic level) in parts of max(value, 1e-3 × the channel's mean).
    pub max_error: f64,
    /// Root mean square of the same.
    pub rms_error: f64,
}

/// At which texels the full sum is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Spread {
    /// At all of them.
    All,
    /// At so many all over the sphere and in the corners of faces, and where filters fail.
    Over(usize),
    /// The same, but where filters fail: of a bake, whose filter has just been measured there. What is left to find is values in wrong
    /// places.
    Measured(usize),
}

/// The cubes of an environment.
#[derive(Debug, Clone, Copy)]
pub struct EnvironmentValues<'a> {
    /// All cubes.
    pub levels: &'a [CubeLevel],
    /// How the sphere lies in each of them.
    pub layout: SphereLayout,
    /// Which way the cubes are turned.
    pub orientation: Orientation,
    /// What packing may have changed. Values that the format has no room for are stored as the nearest that it has.
    pub precision: Precision,
}

/// A value that is wrong by how much, and by how much it may be.
struct Deviation {
    /// The texel, and its channel.
    place: (usize, usize),
    figure: f64,
    limit: f64,
}

impl Deviation {
    fn ratio(&self) -> f64 {
        if self.figure.is_nan() { f64::INFINITY } else { self.figure / self.limit.max(f64::MIN_POSITIVE) }
    }

    /// The worse of two, the second of equals.
    fn or_worse(self, other: Self) -> Self {
        if self.ratio().total_cmp(&other.ratio()).is_gt() { self } else { other }
    }
}

impl EnvironmentValues<'_> {
    fn worst(&self, name: &str, level: &CubeLevel, (worst, count): (Option<Deviation>, usize)) -> Option<Check> {
        let worst = worst?;
        let (texel, channel) = worst.place;
        let place = self.layout.place(level.size, texel);
        let detail = format!("worst of {count} at {place}, {}", ["R", "G", "B"][channel]);
        Some(Check::at_most(name, &level.name, worst.figure, worst.limit, detail))
    }

    /// The world's direction of a texel's centre.
    fn world(&self, level: &CubeLevel, texel: usize) -> DVec3 {
        self.orientation.world(self.layout.direction(level.size, texel))
    }

    fn map(&self, level: &CubeLevel) -> SphereMap {
        SphereMap { layout: self.layout, size: level.size, texels: level.texels.clone() }
    }

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
        let spread = if full { Spread::All } else { Spread::Over(WITNESS_POINTS) };
        self.against_truth(&FullSum::new(panorama), None, panorama, seed, spread)
    }

    /// The same, with a full sum and an area average of the panorama that others use too.
    pub(crate) fn against_truth(
        &self,
        sum: &FullSum,
        average: Option<&SphereMap>,
        panorama: &Panorama,
        seed: u64,
        spread: Spread,
    ) -> Vec<Check> {
        let constant = panorama.min().map(f64::from);
        let is_constant = panorama.texels().iter().all(|t| t.map(f64::from) == constant);
        // All levels at once: some are many cheap texels, others a few dear ones.
        let of_level = |(index, level): (usize, &CubeLevel)| -> Vec<Check> {
            if is_constant {
                let deviations = self.compare(level, panorama, all(level), |_| constant, true);
                return self.worst("distance from the constant input", level, deviations).into_iter().collect();
            }
            let alpha = alpha_of_roughness(level.roughness);
            if alpha == 0.0 {
                let known = average.filter(|average| average.size == level.size);
                let average = known.map_or_else(
                    || SphereMap::area_average(panorama, self.layout, level.size, &self.orientation).map(Cow::Owned),
                    |average| Ok(Cow::Borrowed(average)),
                );
                let Ok(average) = average else { return vec![] }; // recipes are checked: no panorama is turned so
                let truth = |texel: usize| average.texels[texel].map(f64::from);
                let deviations = self.compare(level, panorama, all(level), truth, false);
                return self.worst("exact area average at every texel", level, deviations).into_iter().collect();
            }
            let seed = seed.wrapping_add(index as u64);
            if let Some(view) = level.view {
                return self.against_view(level, view, panorama, sum, seed).into_iter().collect();
            }
            let mut checks = vec![];
            if alpha * level.size as f64 >= resolved(self.layout) && !self.is_clamped(level) {
                checks.push(mean_check(&self.map(level), level, panorama, self.mean_packing(level)));
            }
            let kernel = Kernel::of(level.kernel, alpha);
            if let Some(claimed) = &level.fitted {
                let is_measured = matches!(spread, Spread::Measured(_));
                checks.push(self.lookup_check(level, panorama, sum, &kernel, (claimed, is_measured), seed));
                return checks;
            }
            let (texels, name) = match spread {
                Spread::All => (all(level), "full sum at every texel".to_owned()),
                Spread::Over(n) | Spread::Measured(n) => {
                    let sun = (spread == Spread::Over(n)).then(|| sum.sun());
                    let texels = self.chosen(level, sun, n, seed);
                    let name = format!("full sum at {} texels", texels.len());
                    (texels, name)
                }
            };
            let truth = |texel: usize| sum.evaluate(self.world(level, texel), &kernel);
            checks.extend(self.worst(&name, level, self.compare(level, panorama, texels, truth, false)));
            checks
        };
        let is_summed = |level: &CubeLevel| !is_constant && alpha_of_roughness(level.roughness) > 0.0;
        if self.levels.iter().any(is_summed) {
            sum.prepare();
        }
        self.levels.par_iter().enumerate().with_max_len(1).flat_map_iter(of_level).collect()
    }

    /// Texels spread over the sphere and in the corners of the faces, and those where filters fail: towards the brightest texel, beside it, on
    /// the ring at 90° from it, opposite to it.
    fn chosen(&self, level: &CubeLevel, sun: Option<DVec3>, spread: usize, seed: u64) -> Vec<usize> {
        let n = level.texels.len();
        let mut texels: Vec<usize> = weyl(seed, spread).map(|t| (t * n as f64) as usize).collect();
        let aims = |sun: DVec3| {
            let (side, up) = sun.any_orthonormal_pair();
            let ring = (0..8).map(move |i| {
                let (sin, cos) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
                side * cos + up * sin
            });
            let beside = [0.03, 0.1, 0.3]
                .into_iter()
                .flat_map(move |angle: f64| [side, up, -side, -up].map(|away| sun * angle.cos() + away * angle.sin()));
            [sun, -sun].into_iter().chain(ring).chain(beside)
        };
        let nearest = |direction: DVec3| self.layout.nearest(level.size, self.orientation.lookup(direction));
        texels.extend(sun.into_iter().flat_map(aims).map(nearest));
        let ([width, height], pictures) = self.layout.shape(level.size);
        let last = width * height - 1;
        texels.extend((0..pictures).flat_map(|face| [face * (last + 1), face * (last + 1) + last]));
        texels.sort_unstable();
        texels.dedup();
        texels
    }

    /// The block of a texel, face after face.
    fn block(&self, level: &CubeLevel, texel: usize) -> usize {
        let ([width, height], _) = self.layout.shape(level.size);
        let per_face = width.div_ceil(blocks::SIDE) * height.div_ceil(blocks::SIDE);
        texel / (width * height) * per_face + blocks::block_of(width, texel % (width * height))
    }

    /// What packing may change the mean over the sphere by, of each channel: nothing to speak of where values keep ten bits of their own.
    fn mean_packing(&self, level: &CubeLevel) -> [f64; 3] {
        const TEN_BITS: f64 = 1.0 / 1024.0;
        let Some(format) = self.precision.format() else { return [0.0; 3] };
        let blocks = self.brightest_of_blocks(level);
        let room = |(i, texel): (usize, &[f32; 3])| {
            let of_texel = texel.iter().fold(0.0, |most: f64, &v| most.max(v.into()));
            let brightest = blocks.as_ref().map_or(of_texel, |blocks| blocks[self.block(level, i)]);
            [0, 1, 2].map(|c| {
                let value = f64::from(texel[c]).min(format.largest(c));
                let room = self.precision.tolerance_in(c, value, brightest);
                let kept = if format.is_signed() { TEN_BITS * value.abs() } else { 0.0 };
                (room - kept).max(0.0) as f32
            })
        };
        let texels = level.texels.iter().enumerate().map(room).collect();
        SphereMap { layout: self.layout, size: level.size, texels }.mean()
    }

    /// Whether packing brought values of the level to the largest that there is: then their light is gone, which is counted and warned of, and
    /// the level's mean is not the input's. (Each texel is still judged, by what it can hold.)
    fn is_clamped(&self, level: &CubeLevel) -> bool {
        let Some(format) = self.precision.format() else { return false };
        let reaches = |c: usize, value: f64| value + self.precision.tolerance(c, value) >= format.largest(c);
        level.texels.iter().any(|texel| (0..3).any(|c| reaches(c, texel[c].into())))
    }

    /// The brightest value of each block, where texels are stored in such.
    fn brightest_of_blocks(&self, level: &CubeLevel) -> Option<Vec<f64>> {
        let ([width, height], _) = self.layout.shape(level.size);
        let faces = level.texels.chunks_exact(width * height);
        let of_face = |face: &[[f32; 3]]| blocks::brightest(width, height, face.as_flattened());
        self.precision.format().is_some_and(TexelFormat::is_in_blocks).then(|| faces.flat_map(of_face).collect())
    }

    /// A level seen at an angle, against the sum over the panorama's texels at some of its own: a sum that takes long and knows the
    /// lobe to [`VIEW_SUM`].
    fn against_view(
        &self,
        level: &CubeLevel,
        view: View,
        panorama: &Panorama,
        sum: &FullSum,
        seed: u64,
    ) -> Option<Check> {
        let lobe = ViewLobe::new(alpha_of_roughness(level.roughness), view);
        let all = self.chosen(level, Some(sum.sun()), WITNESS_POINTS, seed);
        let texels: Vec<usize> = all.iter().copied().step_by(all.len().div_ceil(VIEW_POINTS)).collect();
        let name = format!("sum over the panorama at {} texels", texels.len());
        let sums: Vec<[f64; 3]> = texels.iter().map(|&texel| lobe.sum(panorama, self.world(level, texel))).collect();
        let known = CubeLevel { max_error: level.max_error + VIEW_SUM / SIGMAS, ..level.clone() };
        let truth = |texel: usize| sums[texels.iter().position(|&t| t == texel).unwrap_or(0)];
        self.worst(&name, level, self.compare(&known, panorama, texels.clone(), truth, false))
    }

    /// The value that is off most, in parts of what it may be off by, and how many were looked at.
    fn compare(
        &self,
        level: &CubeLevel,
        panorama: &Panorama,
        texels: Vec<usize>,
        truth: impl Fn(usize) -> [f64; 3] + Sync,
        exactly: bool,
    ) -> (Option<Deviation>, usize) {
        let mean = panorama.mean();
        let blocks = self.brightest_of_blocks(level);
        let count = 3 * texels.len();
        let worst = texels
            .into_par_iter()
            .map(|texel| {
                let wanted = truth(texel);
                let wanted = [0, 1, 2].map(|c| self.precision.fit(c, wanted[c]));
                let of_texel = wanted.into_iter().fold(0.0, f64::max);
                let brightest = blocks.as_ref().map_or(of_texel, |blocks| blocks[self.block(level, texel)]);
                let of_channel = |c: usize| {
                    let wanted = wanted[c];
                    let scale = error_scale(wanted, mean[c]);
                    let rounding = self.precision.tolerance_in(c, wanted, brightest);
                    let limit = if exactly { rounding } else { SIGMAS * level.max_error * scale + rounding };
                    let figure = (f64::from(level.texels[texel][c]) - wanted).abs();
                    Deviation { place: (texel, c), figure, limit }
                };
                of_channel(0).or_worse(of_channel(1)).or_worse(of_channel(2))
            })
            .reduce_with(Deviation::or_worse);
        (worst, count)
    }

    /// A fitted level against the full sum, through the filtering that it is made for: towards texels' centres, where fitted texels
    /// are off most, and anywhere between. What is claimed, a bake has just measured, or somebody says.
    fn lookup_check(
        &self,
        level: &CubeLevel,
        panorama: &Panorama,
        sum: &FullSum,
        kernel: &Kernel,
        (claimed, is_measured): (&CubeLookup, bool),
        seed: u64,
    ) -> Check {
        let map = self.map(level);
        let mean = means_to_judge_by(panorama.mean());
        let n = level.texels.len() as f64;
        let centres = self.chosen(level, Some(sum.sun()), WITNESS_POINTS, seed);
        let anywhere = weyl(seed, LOOKUPS).map(|a| {
            // A spiral of even density over the sphere, from a start that the seed names.
            let (y, turn) = (1.0 - 2.0 * a, a * n * 0.618_033_988_749_894_9);
            let (sin, cos) = (turn.fract() * std::f64::consts::TAU).sin_cos();
            let across = (1.0 - y * y).max(0.0).sqrt();
            DVec3::new(across * cos, y, across * sin)
        });
        // As the shader looks up.
        let directions: Vec<DVec3> = anywhere.chain(centres.iter().map(|&t| map.direction(t))).collect();
        let errors_of = |map: &SphereMap| -> Vec<f64> {
            let error = |&direction: &DVec3| {
                let wanted = sum.evaluate(self.orientation.world(direction), kernel);
                let seen = map.filtered(direction);
                (0..3)
                    .map(|c| {
                        let off = relative_error(seen[c], wanted[c], mean[c]);
                        if off.is_nan() { f64::INFINITY } else { off }
                    })
                    .fold(0.0, f64::max)
            };
            directions.par_iter().map(error).collect()
        };
        let errors = errors_of(&map);
        // A claim of huge errors would excuse anything: it is believed as far as exact texels are off, which fitted ones are there to better.
        let believed = if is_measured || claimed.max <= MOST_LOOKUP_ERROR {
            claimed.max
        } else {
            let exact = |texel| sum.evaluate(self.world(level, texel), kernel).map(|v| v as f32);
            let texels = all(level).into_par_iter().map(exact).collect();
            let exact = errors_of(&SphereMap { layout: self.layout, size: level.size, texels });
            claimed.max.min(exact.into_iter().fold(MOST_LOOKUP_ERROR, f64::max))
        };
        let worst = (0..errors.len()).max_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
        let [x, y, z] = directions[worst].to_array();
        let detail = format!("worst of {} towards ({x:.3}, {y:.3}, {z:.3})", errors.len());
        let name = "full sum through bilinear filtering, relative";
        Check::at_most(name, &level.name, errors[worst], BETWEEN * believed, detail)
    }
}

/// What a point between those that were looked at may be off by, in parts of the largest that was seen.
const BETWEEN: f64 = 2.0;
/// The largest error of a lookup, relative, that a certificate is believed at once.
const MOST_LOOKUP_ERROR: f64 = 0.5;
/// Directions that the full sum is asked for of a fitted level.
const LOOKUPS: usize = 192;

/// Texels of a level seen at an angle that are summed over the panorama, and the error of that sum.
const VIEW_POINTS: usize = 24;
const VIEW_SUM: f64 = 1e-3;

/// A level resolves its kernel when alpha is at least this many parts of its size: then texel centres sum to the mean of the
/// filtered function but for [`TEXEL_SUM`]. Measured with a lone sun, turned, and alpha 1/4 and 1: just above, 2e-3 of an octahedral map, whose
/// texels differ most, 7e-4 of a panorama; a quarter of it, 5e-2 and 4e-3.
fn resolved(layout: SphereLayout) -> f64 {
    match layout {
        SphereLayout::Cube => 4.0,
        SphereLayout::Octahedral => 16.0,
        SphereLayout::Equirect => 10.0,
        // The same, of the N − 2 rows within the border.
        SphereLayout::Atlas => 12.0,
    }
}

/// Centres of texels that resolve the kernel sum to the flux of a lone sun within 2e-3; this leaves room for packing.
const TEXEL_SUM: f64 = 4e-3;

/// Filtering keeps the mean over the sphere; errors are alike in all texels, so that they do not average out. Of a channel that is black
/// everywhere the mean is compared as it is.
fn mean_check(map: &SphereMap, level: &CubeLevel, panorama: &Panorama, packing: [f64; 3]) -> Check {
    let (found, wanted) = (map.mean(), panorama.mean());
    let of_channel = |c: usize| {
        let is_black = wanted[c] == 0.0;
        let (scale, relative) =
            if is_black { (1.0, 0.0) } else { (wanted[c].abs(), TEXEL_SUM + SIGMAS * level.rms_error) };
        let off = (found[c] - wanted[c]).abs() / scale;
        let figure = if off.is_nan() { f64::INFINITY } else { off };
        Deviation { place: (0, c), figure, limit: relative + packing[c] / scale }
    };
    let worst = of_channel(0).or_worse(of_channel(1)).or_worse(of_channel(2));
    let detail = "largest of the channels, texels weighted by solid angle";
    let name = "mean over the sphere against the input's, relative";
    Check::at_most(name, &level.name, worst.figure, worst.limit, detail)
}

fn all(level: &CubeLevel) -> Vec<usize> {
    (0..level.texels.len()).collect()
}
