//! What RGBM, RGBP and RGBD have in common: three bytes through a curve, times a factor that the fourth byte gives.

/// A packing of that kind.
pub(super) struct Curve {
    /// What a byte stands for before the factor: rises from 0 to 1.
    pub curve: [f64; 256],
}

impl Curve {
    /// The byte whose value times `factor` is nearest to `value`; the smaller of two that are equally near.
    pub(super) fn nearest(&self, value: f64, factor: f64) -> u8 {
        let above = self.curve.partition_point(|&x| x * factor < value).min(255);
        let below = above.saturating_sub(1);
        let distance = |byte: usize| (self.curve[byte] * factor - value).abs();
        (if distance(below) <= distance(above) { below } else { above }) as u8
    }

    /// The wider of the two gaps beside the byte nearest to `value`.
    pub(super) fn step(&self, value: f64, factor: f64) -> f64 {
        let byte = usize::from(self.nearest(value, factor));
        let gap = |low: usize| factor * (self.curve[low + 1] - self.curve[low]);
        let [below, above] = [byte.saturating_sub(1), byte.min(254)].map(gap);
        below.max(above)
    }

    /// The factor of a texel whose largest channel is stored as `brightest`, of three that rise from the least that reaches that: what was
    /// rounded down may be below where the factor that it was given begins, and even the one before.
    pub(super) fn factor_of(&self, brightest: f64, rising: [f64; 3]) -> f64 {
        /// What is read is rounded to a float.
        const SAME: f64 = 1e-6;
        let was_rounded_down = |pair: &&[f64]| {
            let stored = self.curve[usize::from(self.nearest(brightest, pair[1]))] * pair[1];
            (stored - brightest).abs() <= SAME * brightest && stored + 0.5 * self.step(brightest, pair[1]) > pair[0]
        };
        rising.windows(2).rfind(was_rounded_down).map_or(rising[0], |pair| pair[1])
    }

    /// The code of a texel with that fourth byte, and what it stands for.
    pub(super) fn texel(&self, values: [f64; 3], fourth: u8, factor: f64) -> ([u8; 4], [f64; 3]) {
        let [r, g, b] = values.map(|value| self.nearest(value, factor));
        ([r, g, b, fourth], [r, g, b].map(|byte| self.curve[usize::from(byte)] * factor))
    }

    /// What a code stands for, given the factor of its fourth byte.
    pub(super) fn value(&self, [r, g, b, _]: [u8; 4], factor: f64) -> [f64; 3] {
        [r, g, b].map(|byte| self.curve[usize::from(byte)] * factor)
    }
}

/// The largest of three values that are not negative.
pub(super) fn largest(values: [f64; 3]) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}

/// The curve whose bytes stand for `value(byte/255)`.
pub(super) fn curve(value: impl Fn(f64) -> f64) -> Curve {
    Curve { curve: std::array::from_fn(|byte| value(byte as f64 / 255.0)) }
}

#[cfg(test)]
pub(super) mod tests {
    use crate::pack::tests::Random;
    use crate::pack::{PackReport, factor::largest};

    /// Against the slow way: of all fourth bytes the one with the least factor that holds the texel, of all bytes the nearest.
    pub(in crate::pack) fn check(
        pack: impl Fn(&[f64]) -> (Vec<u8>, PackReport),
        unpack: impl Fn(&[u8]) -> Vec<f32>,
        step: impl Fn(f64, f64) -> f64,
        max: f64,
        factor: impl Fn(u8) -> f64,
        curve: impl Fn(f64) -> f64,
        least: impl Fn(&dyn Fn(u8) -> f64) -> Option<u8>,
    ) {
        let mut random = Random(19);
        for i in 0..4000 {
            let scale = max * random.unit().powi(4);
            let mut texel = [0; 3].map(|_| random.unit() * scale);
            if i % 2 == 1 {
                // A little beyond a factor, which the brightest may be rounded below.
                let beyond = (factor(random.below(256) as u8) * (1.0 + 1e-9)).min(max);
                texel = [beyond, random.unit() * beyond, random.unit() * beyond];
            }
            let brightest = largest(texel);
            let fitting = |byte: u8| if factor(byte) >= brightest { factor(byte) } else { f64::INFINITY };
            let fourth = least(&fitting).unwrap();
            let (code, report) = pack(&texel);
            assert_eq!(code[3], fourth, "{texel:?}: {code:?}");
            let values = unpack(&code);
            for c in 0..3 {
                let distance = |byte: u8| (curve(f64::from(byte) / 255.0) * factor(fourth) - texel[c]).abs();
                let nearest = (0..=255).map(distance).fold(f64::INFINITY, f64::min);
                assert_eq!(distance(code[c]), nearest, "channel {c} of {texel:?}: {code:?}");
                let off = (f64::from(values[c]) - texel[c]).abs();
                assert!((off - nearest).abs() <= 1e-7 * max, "{off} and {nearest}");
                assert!(nearest <= 0.5 * step(texel[c], brightest), "{nearest} is more than half a step");
                let stored = values.iter().fold(0.0, |most, &v| f64::max(most, f64::from(v)));
                let as_read = 0.5 * step(f64::from(values[c]), stored);
                assert!(nearest <= as_read + 1e-7 * brightest, "{nearest} is more than half a step of what is read");
                assert!(report.max_abs_error >= nearest);
            }
        }
        let (_, report) = pack(&[max * 1.01, -1.0, f64::NAN, f64::INFINITY, 0.0, max]);
        assert_eq!(report, PackReport { overflowed: 1, negative: 1, nonfinite: 2, ..PackReport::default() });
    }
}
