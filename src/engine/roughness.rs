//! Which level of a prefiltered chain a shader reads at which roughness, and the inverse, by which the levels are filled.

use crate::model::alpha_of_roughness;

/// An engine's map between roughness and level.
///
/// L is the last level's number, one less than there are levels. [`RoughnessMap::level`] is the shader's formula as the engine's
/// source has it, clamped to the chain; [`RoughnessMap::roughness`] solves it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RoughnessMap {
    /// level = r L.
    Linear,
    /// level = L r (2 − r).
    Quadratic,
    /// level = r (L + 1): the number of levels where the last one's was meant, so that the last level serves from L/(L + 1) on.
    Count,
    /// level = n r, whatever the chain's length.
    Steps(f64),
    /// Tile i of PlayCanvas' baker: r = 2 i/11. No shader's formula; level = 11 r/2.
    Elevenths,
    /// level = 6 r (1.7 − 0.7 r).
    Unity,
    /// level = log2(width (r² + 0.0005)) · 0.8.
    Babylon,
    /// level = t L with t = √α below α = 1/4 and α/2 + 3/8 above.
    MaterialX,
    /// level = L − 1 + 1.2 log2 r.
    Unreal,
}

/// Babylon's addition to α, which keeps the logarithm finite.
const BABYLON_FLOOR: f64 = 0.0005;
/// Babylon's `lodGenerationScale`.
const BABYLON_SCALE: f64 = 0.8;
/// Unity's levels of a reflection probe, less one.
const UNITY_STEPS: f64 = 6.0;
/// Unreal's `REFLECTION_CAPTURE_ROUGHNESS_MIP_SCALE`.
const UNREAL_SCALE: f64 = 1.2;

impl RoughnessMap {
    /// The level, with its fraction, that the shader reads at `roughness`, of `levels` levels from `width` texels on.
    pub fn level(self, roughness: f64, levels: usize, width: usize) -> f64 {
        let (last, r) = (levels.saturating_sub(1) as f64, roughness);
        let alpha = alpha_of_roughness(r);
        let level = match self {
            Self::Linear => r * last,
            Self::Quadratic => last * r * (2.0 - r),
            Self::Count => r * levels as f64,
            Self::Steps(n) => r * n,
            Self::Elevenths => 5.5 * r,
            Self::Unity => UNITY_STEPS * r * (1.7 - 0.7 * r),
            Self::Babylon => (width as f64 * (alpha + BABYLON_FLOOR)).log2() * BABYLON_SCALE,
            Self::MaterialX => last * if alpha < 0.25 { alpha.sqrt() } else { 0.5 * alpha + 0.375 },
            Self::Unreal => last - 1.0 + UNREAL_SCALE * r.log2(),
        };
        level.clamp(0.0, last)
    }

    /// The roughness that reads level `level` and no other; where none does (a level beyond what the shader reaches), 1. Level 0 is
    /// always the mirror, also where the shader begins to leave it later.
    pub fn roughness(self, level: usize, levels: usize, width: usize) -> f64 {
        let (last, m) = (levels.saturating_sub(1).max(1) as f64, level as f64);
        if level == 0 {
            return 0.0;
        }
        let r = match self {
            Self::Linear => m / last,
            Self::Quadratic => 1.0 - (1.0 - m / last).max(0.0).sqrt(),
            Self::Count => m / levels as f64,
            Self::Steps(n) => m / n,
            Self::Elevenths => m / 5.5,
            // 0.7 r² − 1.7 r + m/6 = 0, the smaller root.
            Self::Unity => (1.7 - (1.7 * 1.7 - 2.8 * m / UNITY_STEPS).max(0.0).sqrt()) / 1.4,
            Self::Babylon => ((m / BABYLON_SCALE).exp2() / width as f64 - BABYLON_FLOOR).max(0.0).sqrt(),
            Self::MaterialX => {
                let t = m / last;
                let alpha = if t < 0.5 { t * t } else { 2.0 * (t - 0.375) };
                alpha.sqrt()
            }
            Self::Unreal => ((m - last + 1.0) / UNREAL_SCALE).exp2(),
        };
        // A root that rounds to just below 1 is 1: the level holds what Lambert's irradiance is.
        if r > 1.0 - 1e-12 { 1.0 } else { r.max(0.0) }
    }

    /// The shader's formula, in words.
    pub fn formula(self) -> String {
        match self {
            Self::Linear => "r L".to_owned(),
            Self::Quadratic => "L r (2 - r)".to_owned(),
            Self::Count => "r (L + 1)".to_owned(),
            Self::Steps(n) => format!("{n} r"),
            Self::Elevenths => "11 r/2".to_owned(),
            Self::Unity => "6 r (1.7 - 0.7 r)".to_owned(),
            Self::Babylon => "0.8 log2(width (r^2 + 0.0005))".to_owned(),
            Self::MaterialX => "L t, t = r below r = 1/2, r^2/2 + 3/8 above".to_owned(),
            Self::Unreal => "L - 1 + 1.2 log2 r".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shader_reads_each_level_at_the_roughness_that_it_was_filled_for() {
        use RoughnessMap::*;
        for map in [Linear, Quadratic, Count, Steps(5.0), Elevenths, Unity, Babylon, MaterialX, Unreal] {
            for (levels, width) in [(5, 256), (7, 128), (9, 256)] {
                let mut before = -1.0;
                for level in 0..levels {
                    let r = map.roughness(level, levels, width);
                    assert!((0.0..=1.0).contains(&r) && r >= before, "{map:?} level {level} of {levels}: {r}");
                    before = r;
                    let read = map.level(r, levels, width);
                    // At r = 1 the chain may go on, and at r = 0 a shader may still read level 0.
                    let beyond = r == 1.0 && read <= level as f64;
                    assert!(
                        (read - level as f64).abs() < 1e-9 || beyond,
                        "{map:?} level {level} of {levels}: reads {read}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_inverses_are_those_of_the_engines_own_bakers() {
        // cmgen, Unity and O3DE, as their sources have them.
        let cmgen = |t: f64| ((4.0 - 4.0 * t).sqrt() - 2.0) / -2.0;
        assert!((RoughnessMap::Quadratic.roughness(2, 5, 256) - cmgen(0.5)).abs() < 1e-15);
        let unity = |m: f64| 1.7 / 1.4 - (2.89 / 1.96 - (2.8 / 1.96) * m / 6.0).sqrt();
        assert!((RoughnessMap::Unity.roughness(4, 7, 128) - unity(4.0)).abs() < 1e-14);
        assert_eq!(RoughnessMap::Unity.roughness(6, 7, 128), 1.0);
        assert_eq!(RoughnessMap::Steps(5.0).roughness(3, 6, 256), 0.6);
    }
}
