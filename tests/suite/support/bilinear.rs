//! What a sampler makes of texels, and how far hardware may be from it.

/// Linear interpolation along every axis at positions in texels, clamped to the outermost texels; and the largest difference between
/// neighbours along each axis, within the cell and the two beside it.
pub fn sample(texel: &dyn Fn(&[usize]) -> f64, sizes: &[usize], position: &[f64]) -> (f64, Vec<f64>) {
    let cell: Vec<(usize, f64)> = sizes
        .iter()
        .zip(position)
        .map(|(&n, &p)| {
            let p = p.clamp(0.0, (n - 1) as f64);
            let low = (p.floor() as usize).min(n.saturating_sub(2));
            (low, p - low as f64)
        })
        .collect();
    let mut value = 0.0;
    for corner in 0..1_usize << sizes.len() {
        let (mut weight, mut at) = (1.0, vec![]);
        for (axis, &(low, fraction)) in cell.iter().enumerate() {
            let far = corner >> axis & 1;
            weight *= if far == 1 { fraction } else { 1.0 - fraction };
            at.push((low + far).min(sizes[axis] - 1));
        }
        value += weight * texel(&at);
    }
    let slopes = (0..sizes.len())
        .map(|axis| {
            let around = |a: usize| {
                let (low, n) = (cell[a].0, sizes[a]);
                low.saturating_sub(1)..=(low + 2).min(n - 1)
            };
            let mut steepest = 0.0_f64;
            let mut visit = |at: &[usize]| {
                let mut next = at.to_vec();
                next[axis] += 1;
                if next[axis] < sizes[axis] && around(axis).contains(&next[axis]) {
                    steepest = steepest.max((texel(&next) - texel(at)).abs());
                }
            };
            every(&(0..sizes.len()).map(around).collect::<Vec<_>>(), &mut vec![], &mut visit);
            steepest
        })
        .collect();
    (value, slopes)
}

fn every(ranges: &[std::ops::RangeInclusive<usize>], at: &mut Vec<usize>, visit: &mut dyn FnMut(&[usize])) {
    match ranges.get(at.len()) {
        None => visit(at),
        Some(range) => {
            for i in range.clone() {
                at.push(i);
                every(ranges, at, visit);
                at.pop();
            }
        }
    }
}
