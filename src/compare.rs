//! Two files of numbers against each other: statistics per level and channel, and a map of the differences.
//!
//! A tolerance is in units of the last place of what the files store (the coarser of the two counts), or relative to the larger of
//! the two values.

use crate::certificate;
use crate::error::{Error, Result};
use crate::format::grid::{self, Described, GridChannel, Stored};
use crate::format::{Grid, Image};
use serde::Serialize;
use std::borrow::Cow;
use std::path::Path;
use std::str::FromStr;

/// By how much two values may differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tolerance {
    /// So many units of the last place.
    Ulps(f64),
    /// This part of the larger value.
    Relative(f64),
    /// This much.
    Absolute(f64),
}

impl Tolerance {
    /// What the difference may be.
    fn allows(self, a: f64, b: f64, stored: [Stored; 2]) -> f64 {
        let larger = a.abs().max(b.abs());
        match self {
            Self::Ulps(n) => n * stored[0].step(larger).max(stored[1].step(larger)),
            Self::Relative(part) => part * larger,
            Self::Absolute(most) => most,
        }
    }
}

impl FromStr for Tolerance {
    type Err = Error;

    /// `2ulp`, `0.1%`, `1e-3rel` or `1e-3`.
    fn from_str(text: &str) -> Result<Self> {
        let wrong = || {
            Error::usage(
                format!("tolerance {text:?} is none"),
                "write 2ulp for units of the last place, 0.1% or 1e-3rel relative to the value, 1e-3 absolute",
            )
        };
        let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| *v >= 0.0).ok_or_else(wrong);
        if let Some(n) = text.strip_suffix("ulps").or_else(|| text.strip_suffix("ulp")) {
            number(n).map(Self::Ulps)
        } else if let Some(percent) = text.strip_suffix('%') {
            number(percent).map(|p| Self::Relative(p / 100.0))
        } else if let Some(part) = text.strip_suffix("rel") {
            number(part).map(Self::Relative)
        } else {
            number(text).map(Self::Absolute)
        }
    }
}

/// The levels of the file at `path`, to be compared: [`grid::levels`], and of bare texels that nothing is `described` of what the certificate
/// beside them says.
///
/// **Errors**: those of [`grid::levels`] and of [`certificate::bare_texture`].
pub fn levels(path: &Path, described: &Described) -> Result<Vec<Grid>> {
    if described.shape.is_none() && described.number.is_none() {
        let bytes = std::fs::read(path).map_err(|e| Error::reading(path, e))?;
        let bare = certificate::bare_texture(path, &bytes).map_err(|e| e.in_file(path))?;
        if let Some(texture) = bare {
            return grid::levels_of(&texture, "bare texels", described).map_err(|e| e.in_file(path));
        }
    }
    grid::levels(path, described)
}

/// How one channel of one level differs.
#[derive(Debug, Clone, Serialize)]
pub struct Difference {
    /// The level, from 0.
    pub level: usize,
    /// The channel's name in the first file.
    pub channel: String,
    /// Its name in the second.
    pub against: String,
    /// Largest |b − a|.
    pub max: f64,
    /// Mean of b − a.
    pub mean: f64,
    /// Root mean square of b − a.
    pub rms: f64,
    /// Largest |b − a| over the larger of the two.
    pub relative: f64,
    /// Largest |b − a| in units of the last place.
    pub ulps: f64,
    /// Column, row and slice (or face) of the largest.
    pub at: [usize; 3],
    /// Values that differ.
    pub different: usize,
    /// Values that differ by more than the tolerance, or that are a number in one file only.
    pub beyond: usize,
    /// Values.
    pub values: usize,
}

/// The levels of two files, each a grid, level 0 first; what only fills up a texel, an alpha of 1 or zeros, is not looked
/// at where the other file has none.
///
/// **Errors**: other sizes, numbers of levels or of channels.
pub fn compare(a: &[Grid], b: &[Grid], tolerance: Tolerance) -> Result<Vec<Difference>> {
    let shape =
        |g: &Grid| format!("{} texels of {} channels", g.size.map(|s| s.to_string()).join(" × "), g.channels.len());
    if a.len() != b.len() {
        return Err(Error::invalid(
            format!("{} levels against {}", a.len(), b.len()),
            "compare files with the same levels",
        ));
    }
    let (mut differences, mut paired) = (vec![], vec![]);
    for (level, (a, b)) in a.iter().zip(b).enumerate() {
        // Colour is stored with an alpha here and without one there.
        let (a, b) = (&beside(a, b), &beside(b, a));
        if (a.size, a.channels.len()) != (b.size, b.channels.len()) {
            return Err(Error::invalid(
                format!("{} against {} at level {level}", shape(a), shape(b)),
                "compare files of the same shape",
            ));
        }
        if level == 0 {
            paired = pairs(a, b);
        }
        differences
            .extend(paired.iter().enumerate().map(|(c, &other)| difference(level, [a, b], [c, other], tolerance)));
    }
    Ok(differences)
}

/// The grid to be set beside another of fewer channels: without those at the end that only fill up a texel, an alpha of 1 or zeros.
fn beside<'a>(grid: &'a Grid, other: &Grid) -> Cow<'a, Grid> {
    let (n, kept) = (grid.channels.len(), other.channels.len());
    let is_all = |c: usize, filling: f64| grid.values.iter().skip(c).step_by(n).all(|&value| value == filling);
    let fills = |c: usize| is_all(c, 0.0) || (n == 4 && c == 3 && is_all(c, 1.0));
    if n <= kept || !(kept..n).all(fills) {
        return Cow::Borrowed(grid);
    }
    let values = grid.values.chunks_exact(n).flat_map(|texel| texel[..kept].iter().copied()).collect();
    Cow::Owned(Grid { channels: grid.channels[..kept].to_vec(), values, ..grid.clone() })
}

/// Channels up to which every order is tried.
const FEW_CHANNELS: usize = 4;

/// Which channel of `b` each of `a` is compared with: that of its name, if they have the same names; else the order in which the files are
/// nearest to each other, since containers sort channels or do not name them. Of equals the files' own.
fn pairs(a: &Grid, b: &Grid) -> Vec<usize> {
    let n = a.channels.len();
    let named = |channel: &GridChannel| b.channels.iter().position(|o| o.name == channel.name);
    if let Some(pairs) = a.channels.iter().map(named).collect::<Option<Vec<usize>>>() {
        return pairs;
    }
    if n > FEW_CHANNELS {
        return (0..n).collect();
    }
    let distance = |c: usize, other: usize| {
        let both = a.values.iter().skip(c).step_by(n).zip(b.values.iter().skip(other).step_by(n));
        both.map(|(x, y)| (x - y).abs()).filter(|d| d.is_finite()).sum::<f64>()
    };
    let distances: Vec<Vec<f64>> = (0..n).map(|c| (0..n).map(|other| distance(c, other)).collect()).collect();
    let total = |order: &Vec<usize>| order.iter().enumerate().map(|(c, &other)| distances[c][other]).sum::<f64>();
    let nearest = orders(n).into_iter().min_by(|x, y| total(x).total_cmp(&total(y)));
    nearest.unwrap_or_else(|| (0..n).collect())
}

/// Every order of 0 to n − 1, that as it is first.
fn orders(n: usize) -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = vec![vec![]];
    for _ in 0..n {
        let longer = |order: Vec<usize>| {
            let next: Vec<Vec<usize>> =
                (0..n).filter(|i| !order.contains(i)).map(|i| [order.as_slice(), &[i]].concat()).collect();
            next
        };
        all = all.into_iter().flat_map(longer).collect();
    }
    all
}

fn difference(level: usize, [a, b]: [&Grid; 2], [ca, cb]: [usize; 2], tolerance: Tolerance) -> Difference {
    let stored = [a.channels[ca].stored, b.channels[cb].stored];
    let (first, second) = (a.channel(ca), b.channel(cb));
    let mut found = Difference {
        level,
        channel: a.channels[ca].name.clone(),
        against: b.channels[cb].name.clone(),
        max: 0.0,
        mean: 0.0,
        rms: 0.0,
        relative: 0.0,
        ulps: 0.0,
        at: [0; 3],
        different: 0,
        beyond: 0,
        values: first.len(),
    };
    let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
    for (texel, (&x, &y)) in first.iter().zip(&second).enumerate() {
        if x == y || (x.is_nan() && y.is_nan()) {
            n += 1.0;
            continue;
        }
        found.different += 1;
        let off = y - x;
        if !off.is_finite() {
            // A number in one file, and none in the other: no tolerance allows that.
            found.beyond += 1;
            if found.max.is_finite() {
                (found.max, found.at) = (f64::INFINITY, place(a, texel));
            }
            continue;
        }
        found.beyond += usize::from(off.abs() > tolerance.allows(x, y, stored));
        if off.abs() > found.max {
            (found.max, found.at) = (off.abs(), place(a, texel));
        }
        let larger = x.abs().max(y.abs());
        found.relative = found.relative.max(off.abs() / larger);
        found.ulps = found.ulps.max(off.abs() / stored[0].step(larger).max(stored[1].step(larger)));
        (sum, squares, n) = (sum + off, squares + off * off, n + 1.0);
    }
    let n = f64::max(n, 1.0);
    (found.mean, found.rms) = (sum / n, (squares / n).sqrt());
    found
}

fn place(grid: &Grid, texel: usize) -> [usize; 3] {
    let [w, h, _] = grid.size;
    [texel % w, texel / w % h, texel / (w * h)]
}

/// The differences b − a of one level as a picture, slices (or faces) below each other.
///
/// **Errors**: grids of different shapes.
pub fn map(a: &Grid, b: &Grid) -> Result<Image<f64>> {
    let (a, b) = (&beside(a, b), &beside(b, a));
    if (a.size, a.channels.len()) != (b.size, b.channels.len()) {
        return Err(Error::invalid("two shapes", "compare files of the same shape"));
    }
    let [width, height, depth] = a.size;
    let names: Vec<&str> = a.channels.iter().map(|c| c.name.as_str()).collect();
    let order = pairs(a, b);
    let n = names.len();
    let texels = a
        .values
        .chunks_exact(n)
        .zip(b.values.chunks_exact(n))
        .flat_map(|(x, y)| (0..n).map(|c| y[order[c]] - x[c]).collect::<Vec<_>>())
        .collect();
    Image::new(width, height * depth, &names, texels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::grid::Described;

    fn grid(numbers: &str) -> Grid {
        let described = Described { shape: Some("2x2".parse().unwrap()), ..Described::default() };
        Grid::decode(numbers.as_bytes(), &described).unwrap()
    }

    #[test]
    fn differences_are_counted_and_placed() {
        let (a, b) = (grid("[0x3800, 0x3400, 0x3c00, 0x3000]"), grid("[0x3800, 0x3402, 0x3c00, 0x3001]"));
        let found = &compare(std::slice::from_ref(&a), std::slice::from_ref(&b), Tolerance::Ulps(1.0)).unwrap()[0];
        assert_eq!((found.different, found.beyond, found.at, found.ulps), (2, 1, [1, 0, 0], 2.0));
        assert_eq!(map(&a, &b).unwrap().texels[1], found.max);
        let same = &compare(std::slice::from_ref(&a), std::slice::from_ref(&a), Tolerance::Ulps(0.0)).unwrap()[0];
        assert_eq!((same.different, same.max), (0, 0.0));
    }

    #[test]
    fn an_alpha_of_ones_is_left_out_against_a_file_of_three_channels() {
        let named = |numbers: &str, names: &[&str]| {
            let channel = |name: &&str| GridChannel { name: (*name).to_owned(), stored: Stored::F32 };
            let values = numbers.split(' ').map(|v| v.parse().unwrap()).collect();
            Grid { size: [2, 1, 1], channels: names.iter().map(channel).collect(), values, source: String::new() }
        };
        let rgb = named("1 2 3 4 5 6", &["R", "G", "B"]);
        let [opaque, not] =
            ["1 2 3 1 4 5 6.5 1", "1 2 3 1 4 5 6 0.5"].map(|values| named(values, &["R", "G", "B", "A"]));
        for [a, b] in [[&rgb, &opaque], [&opaque, &rgb]] {
            let found = compare(std::slice::from_ref(a), std::slice::from_ref(b), Tolerance::Absolute(0.0)).unwrap();
            assert_eq!(found.iter().map(|d| d.max).collect::<Vec<_>>(), [0.0, 0.0, 0.5]);
        }
        assert!(compare(std::slice::from_ref(&rgb), std::slice::from_ref(&not), Tolerance::Absolute(0.0)).is_err());
    }

    #[test]
    fn channels_of_other_names_are_paired_with_what_they_are_nearest_to() {
        let mut pair = [grid("[0.5, 0.25, 1.0, 0.125]"), grid("[0.25, 0.5, 0.125, 1.0]")];
        for (grid, names) in pair.iter_mut().zip([["R", "G"], ["bias", "scale"]]) {
            let channel = |name: &str| GridChannel { name: name.to_owned(), stored: Stored::F32 };
            (grid.size, grid.channels) = ([2, 1, 1], names.map(channel).into());
        }
        let [a, b] = pair;
        let found = compare(std::slice::from_ref(&a), std::slice::from_ref(&b), Tolerance::Absolute(0.0)).unwrap();
        assert!(found.iter().all(|d| d.different == 0), "{found:?}");
        assert_eq!(found.iter().map(|d| d.against.as_str()).collect::<Vec<_>>(), ["scale", "bias"]);
        assert!(map(&a, &b).unwrap().texels.iter().all(|&v| v == 0.0));
        assert_eq!(orders(3)[..2], [[0, 1, 2], [0, 2, 1]]);
    }

    #[test]
    fn no_number_equals_a_number() {
        let (a, b) = (grid("[0.5, 0.25, 1.0, NaN]"), grid("[0.5, 0.25, NaN, NaN]"));
        let found = &compare(&[a], &[b], Tolerance::Relative(1.0)).unwrap()[0];
        assert_eq!((found.beyond, found.at), (1, [0, 1, 0]));
    }

    #[test]
    fn tolerances_say_what_they_are_in() {
        assert_eq!("2ulp".parse::<Tolerance>().unwrap(), Tolerance::Ulps(2.0));
        assert_eq!("0.5%".parse::<Tolerance>().unwrap(), Tolerance::Relative(0.005));
        assert_eq!("1e-3rel".parse::<Tolerance>().unwrap(), Tolerance::Relative(1e-3));
        assert_eq!("1e-3".parse::<Tolerance>().unwrap(), Tolerance::Absolute(1e-3));
        assert!("-1".parse::<Tolerance>().is_err() && "ulp".parse::<Tolerance>().is_err());
    }
}
