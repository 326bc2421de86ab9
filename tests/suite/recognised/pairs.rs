//! Cases that between them hold every pair of choices: what goes wrong mostly does for one choice, or for two that meet.

/// One choice of each factor, by number.
pub type Row = Vec<usize>;

/// Whether value `v` of factor `f` may meet, or is wanted to meet, value `w` of factor `g`; `f` ≤ `g`, and where they are one, whether the
/// value is wanted at all.
pub type Pair<'a> = &'a dyn Fn(usize, usize, usize, usize) -> bool;

/// Which pairs of values are still to meet.
struct Open {
    offset: Vec<usize>,
    n: usize,
    open: Vec<bool>,
}

impl Open {
    fn at(&self, (f, v): (usize, usize), (g, w): (usize, usize)) -> usize {
        let (a, b) = (self.offset[f] + v, self.offset[g] + w);
        a.min(b) * self.n + a.max(b)
    }
}

/// Rows in which every value occurs, and every two values of different factors meet, that are `wanted` to, if `admits` lets them. `sizes`:
/// how many values each factor has.
///
/// Greedy: a row begins with a pair that has not met yet, and takes of every other factor the value that meets most others for the first
/// time; which it is does not depend on anything but the arguments.
pub fn covering(sizes: &[usize], admits: Pair, wanted: Pair) -> Vec<Row> {
    let offset: Vec<usize> = (0..sizes.len()).map(|f| sizes[..f].iter().sum()).collect();
    let n = sizes.iter().sum();
    let mut pairs = Open { offset, n, open: vec![false; n * n] };
    let may_meet = |f: usize, v: usize, g: usize, w: usize| if f < g { admits(f, v, g, w) } else { admits(g, w, f, v) };
    let mut all: Vec<[(usize, usize); 2]> = vec![];
    for (f, g) in (0..sizes.len()).flat_map(|f| (f..sizes.len()).map(move |g| (f, g))) {
        for (v, w) in (0..sizes[f]).flat_map(|v| (0..sizes[g]).map(move |w| (v, w))) {
            let is_pair = if f == g { v == w } else { admits(f, v, g, w) };
            if is_pair && wanted(f, v, g, w) {
                let at = pairs.at((f, v), (g, w));
                pairs.open[at] = true;
                all.push([(f, v), (g, w)]);
            }
        }
    }
    // Pairs before single values, which mostly come with them.
    all.sort_by_key(|[(f, _), (g, _)]| f == g);
    let mut rows: Vec<Row> = vec![];
    for [(f, v), (g, w)] in all {
        if !pairs.open[pairs.at((f, v), (g, w))] {
            continue;
        }
        let mut row: Vec<Option<usize>> = vec![None; sizes.len()];
        (row[f], row[g]) = (Some(v), Some(w));
        for h in 0..sizes.len() {
            if row[h].is_some() {
                continue;
            }
            let others: Vec<(usize, usize)> = row.iter().enumerate().filter_map(|(f, v)| Some((f, (*v)?))).collect();
            let fits = |x: &usize| others.iter().all(|&(f, v)| may_meet(f, v, h, *x));
            let news =
                |x: usize| others.iter().chain([&(h, x)]).filter(|&&other| pairs.open[pairs.at(other, (h, x))]).count();
            // Of equals another one in every row, so that values which meet nothing new are varied, too.
            let turned = |x: usize| (x + rows.len()) % sizes[h];
            row[h] = (0..sizes[h]).map(turned).filter(fits).max_by_key(|&x| news(x));
        }
        let Some(row): Option<Row> = row.into_iter().collect() else { continue };
        for (f, g) in (0..sizes.len()).flat_map(|f| (f..sizes.len()).map(move |g| (f, g))) {
            let at = pairs.at((f, row[f]), (g, row[g]));
            pairs.open[at] = false;
        }
        rows.push(row);
    }
    rows
}
