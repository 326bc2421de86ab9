//! Cases that between them hold every pair of choices: what goes wrong mostly does for one choice, or for two that meet.

/// One choice of each factor, by number.
pub type Row = Vec<usize>;

/// Rows in which every two values of different factors meet that `admits` lets meet. `sizes`: how many values each factor has.
///
/// Greedy: a row begins with a pair that has not met yet, and takes of every other factor the value that meets most others for the first
/// time; which it is does not depend on anything but the arguments.
pub fn covering(sizes: &[usize], admits: &dyn Fn(usize, usize, usize, usize) -> bool) -> Vec<Row> {
    let may_meet = |f: usize, v: usize, g: usize, w: usize| if f < g { admits(f, v, g, w) } else { admits(g, w, f, v) };
    let offset: Vec<usize> = (0..sizes.len()).map(|f| sizes[..f].iter().sum()).collect();
    let n: usize = sizes.iter().sum();
    // Which pairs have met, or never may.
    let mut done = vec![false; n * n];
    let mut open: Vec<[usize; 4]> = vec![];
    for (f, g) in (0..sizes.len()).flat_map(|f| (f + 1..sizes.len()).map(move |g| (f, g))) {
        for (v, w) in (0..sizes[f]).flat_map(|v| (0..sizes[g]).map(move |w| (v, w))) {
            if admits(f, v, g, w) {
                open.push([f, v, g, w]);
            } else {
                done[(offset[f] + v) * n + offset[g] + w] = true;
            }
        }
    }
    let mut rows = vec![];
    for [f, v, g, w] in open {
        if done[(offset[f] + v) * n + offset[g] + w] {
            continue;
        }
        let mut row: Vec<Option<usize>> = vec![None; sizes.len()];
        (row[f], row[g]) = (Some(v), Some(w));
        for h in 0..sizes.len() {
            if row[h].is_some() {
                continue;
            }
            let chosen = |row: &[Option<usize>]| -> Vec<(usize, usize)> {
                row.iter().enumerate().filter_map(|(f, v)| Some((f, (*v)?))).collect()
            };
            let others = chosen(&row);
            let fits = |x: &usize| others.iter().all(|&(f, v)| may_meet(f, v, h, *x));
            let news = |x: usize| {
                let met = |&&(f, v): &&(usize, usize)| {
                    let (a, b) = (offset[f.min(h)] + if f < h { v } else { x }, offset[f.max(h)] + if f < h { x } else { v });
                    !done[a * n + b]
                };
                others.iter().filter(met).count()
            };
            // Of equals another one in every row, so that values which meet nothing new are varied, too.
            let turned = |x: usize| (x + rows.len()) % sizes[h];
            row[h] = (0..sizes[h]).map(turned).filter(fits).max_by_key(|&x| news(x));
        }
        let Some(row): Option<Row> = row.into_iter().collect() else { continue };
        for (f, g) in (0..sizes.len()).flat_map(|f| (f + 1..sizes.len()).map(move |g| (f, g))) {
            done[(offset[f] + row[f]) * n + offset[g] + row[g]] = true;
        }
        rows.push(row);
    }
    rows
}
