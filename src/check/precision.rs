//! What packing may have changed.

use crate::pack::{Number, TexelFormat};

/// By how much packing may have changed a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Precision {
    /// How texels are stored; nothing for what is as precise as it was computed.
    format: Option<TexelFormat>,
    /// The largest value of any texel.
    brightest: f64,
    /// Of texels in blocks, what a value may be off by, in parts of the brightest of its block, or of its own where that is more.
    block_error: f64,
}

impl Precision {
    /// Of values that were not packed.
    pub fn exact() -> Self {
        Self { format: None, brightest: 0.0, block_error: 0.0 }
    }

    /// Of values that were packed; `block_error` is [`PackReport::max_block_error`], of a file what its certificate claims of it: 1 at most, which
    /// is all that values of no sign can be off by.
    ///
    /// [`PackReport::max_block_error`]: crate::pack::PackReport::max_block_error
    pub fn new(format: TexelFormat, values: impl IntoIterator<Item = f64>, block_error: f64) -> Self {
        // NaN is no brightness; it is found elsewhere.
        let brightest = values.into_iter().filter(|v| v.is_finite()).fold(0.0, f64::max);
        Self { format: Some(format), brightest, block_error: block_error.min(1.0) }
    }

    /// How texels are stored.
    pub fn format(&self) -> Option<TexelFormat> {
        self.format
    }

    /// What a value of a channel may be off by, wherever it is.
    pub fn tolerance(&self, channel: usize, value: f64) -> f64 {
        self.tolerance_in(channel, value, self.brightest)
    }

    /// The same where the largest channel of its texel, or of its block, is known.
    pub fn tolerance_in(&self, channel: usize, value: f64, brightest: f64) -> f64 {
        let Some(format) = self.format else { return 0.0 };
        // A step at the true value may be that of the next binade below: take the larger neighbour.
        let wider = |value: f64| value.abs() * (1.0 + 1e-3);
        // The brightest was rounded too, perhaps below where the factor that it was given begins: by half a code of three, and a square.
        let unrounded = (brightest.abs() * (1.0 + 1e-2)).min(format.largest(channel));
        match format.step(channel, wider(value), unrounded) {
            Some(step) if format.is_read_exactly() => 0.5 * step,
            // What is read is half a step beyond the value at most, and rounded.
            Some(step) => 0.5 * step + 0.5 * f64::from(f32::EPSILON) * (wider(value) + step),
            None => self.block_error * wider(brightest.max(value)),
        }
    }

    /// The value as the format can hold it: brought to its range.
    pub fn fit(&self, channel: usize, value: f64) -> f64 {
        let Some(format) = self.format else { return value };
        let largest = format.largest(channel);
        value.clamp(if format.is_signed() { -largest } else { 0.0 }, largest)
    }
}

impl From<Number> for Precision {
    fn from(number: Number) -> Self {
        Self::new(TexelFormat::Plain { channels: 1, number }, [], 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::{rgbp, uastc_hdr};

    /// One and a little more takes a factor of 1.056, and is stored as 0.998.
    #[test]
    fn a_brightest_that_was_rounded_down_keeps_its_factor() {
        for value in (1..100).map(|i| f64::from(i) / 100.0) {
            let stored = rgbp::unpack(&rgbp::pack(&[1.0 + 1e-15, value, 0.0]).0);
            let precision = Precision::new(TexelFormat::Rgbp, stored.iter().map(|&v| f64::from(v)), 0.0);
            let off = (f64::from(stored[1]) - value).abs();
            assert!(off <= precision.tolerance(1, value), "{value}: off by {off}");
        }
    }

    /// Half a step from its code, a value is as far from what is read as that is rounded to.
    #[test]
    fn a_value_between_two_codes_may_be_either_as_it_is_read() {
        for number in [Number::Unorm8, Number::Unorm16] {
            let (precision, most) = (Precision::from(number), if number == Number::Unorm8 { 255 } else { 65535 });
            for code in 1..=most {
                let value = (f64::from(code) - 0.5) / f64::from(most);
                for code in [code - 1, code] {
                    let off = (f64::from((f64::from(code) / f64::from(most)) as f32) - value).abs();
                    assert!(off <= precision.tolerance(0, value), "{number} {code}: {value} is off by {off}");
                }
            }
        }
    }

    /// A block of a real panorama, whose brightest texel is 1.8 times as bright as it is stored.
    #[test]
    fn a_block_that_its_brightest_texel_outshines_is_within_what_is_claimed_of_it() {
        #[rustfmt::skip]
        let block = [
            0.0534, 0.1657, 0.3660, 0.0440, 0.0593, 0.1064, 0.0254, 0.0607, 0.0915, 0.0894, 0.1351, 0.1995,
            0.0617, 0.1257, 0.2390, 0.0684, 0.1016, 0.1585, 0.0092, 0.0475, 0.0687, 0.0509, 0.0853, 0.1236,
            0.0561, 0.0834, 0.1472, 0.0496, 0.0900, 0.1504, 0.0051, 0.0470, 0.0658, 0.0415, 0.0788, 0.1222,
            0.0746, 0.1192, 0.2125, 0.0109, 0.0516, 0.0808, 0.0023, 0.0428, 0.0596, 0.0225, 0.0662, 0.0998,
        ];
        let (bytes, report) = uastc_hdr::pack(4, 4, &block);
        assert!(0.4 < report.max_block_error && report.max_block_error < 0.5, "{report:?}");
        let stored = uastc_hdr::unpack(4, 4, &bytes).into_iter().map(f64::from);
        let precision = Precision::new(TexelFormat::UastcHdr, stored.clone(), report.max_block_error);
        for (value, stored) in block.into_iter().zip(stored) {
            let off = (stored - value).abs();
            assert!(off <= precision.tolerance(0, value), "{value}: off by {off}");
        }
    }

    /// No claim excuses a block that lost its light.
    #[test]
    fn black_in_place_of_a_light_is_beyond_any_claim_of_a_block() {
        let light = 7.0;
        for claimed in [0.5, 0.9, 0.99] {
            let precision = Precision::new(TexelFormat::Bc6h, [light], claimed);
            assert!(precision.tolerance_in(0, light, 0.0) < light, "{claimed}");
        }
        let precision = Precision::new(TexelFormat::Bc6h, [light], 1e9);
        assert!(precision.tolerance_in(0, light, light) <= 1.002 * light);
    }
}
