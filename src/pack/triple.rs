//! What the packings of three unsigned channels into one code have in common: the room that they have, and the counting.

use super::PackReport;

/// Packs texels of three values: each is first brought into what the format has room for (NaN and values below zero to 0, what is beyond
/// `largest` to that), then `nearest` gives the code and the values that it stands for.
pub(super) fn pack<T: Copy + Into<f64>>(
    values: &[T],
    largest: [f64; 3],
    nearest: impl Fn([f64; 3]) -> ([u8; 4], [f64; 3]),
) -> (Vec<u8>, PackReport) {
    let mut report = PackReport::default();
    let mut bytes = Vec::with_capacity(values.len() / 3 * 4);
    for texel in values.chunks_exact(3) {
        let given: [f64; 3] = [0, 1, 2].map(|c| texel[c].into());
        let room = fit(given, largest, &mut report);
        let (code, stands_for) = nearest(room);
        for c in 0..3 {
            // What was clamped is counted instead.
            if room[c] == given[c] {
                report.max_abs_error = report.max_abs_error.max((stands_for[c] - given[c]).abs());
            }
        }
        bytes.extend_from_slice(&code);
    }
    (bytes, report)
}

/// The values brought into 0..=largest, and the counts of those that were not.
pub(super) fn fit(given: [f64; 3], largest: [f64; 3], report: &mut PackReport) -> [f64; 3] {
    let mut fitted = [0.0; 3];
    for c in 0..3 {
        report.negative += u64::from(given[c] < 0.0);
        report.nonfinite += u64::from(!given[c].is_finite());
        report.overflowed += u64::from(given[c].is_finite() && given[c] > largest[c]);
        // NaN compares with nothing, and becomes 0.
        fitted[c] = if given[c] > 0.0 { given[c].min(largest[c]) } else { 0.0 };
    }
    fitted
}

/// The values of all codes, to the nearest f32; trailing bytes that are no whole code are ignored.
pub(super) fn unpack(bytes: &[u8], value: impl Fn([u8; 4]) -> [f64; 3]) -> Vec<f32> {
    bytes.chunks_exact(4).flat_map(|b| value([b[0], b[1], b[2], b[3]]).map(|v| v as f32)).collect()
}
