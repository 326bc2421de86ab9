//! Which way round a cube holds a panorama: which of the 48 signed permutations of the axes fits, and which faces do not follow it.

use glam::DVec3;
use serde::Serialize;

use super::{log_ratio_spread, median};
use crate::environment::cube::{FACES, nearest_texel, texel_direction};
use crate::environment::{Cube, DARK_FLOOR, Orientation as Turned};

/// A signed permutation of the axes: towards d the file shows what the panorama has towards (±d_i, ±d_j, ±d_k).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Turn {
    /// Which coordinate of d comes first, second and third.
    pub axes: [usize; 3],
    /// 1 or −1 times each.
    pub signs: [i8; 3],
}

impl Turn {
    /// As Kiln has it.
    pub const NONE: Self = Self { axes: [0, 1, 2], signs: [1; 3] };

    /// All 48, [`Turn::NONE`] first.
    pub fn all() -> impl Iterator<Item = Self> {
        const AXES: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        let signs = |bits: usize| [0, 1, 2].map(|i| if bits >> i & 1 == 1 { -1 } else { 1 });
        AXES.into_iter().flat_map(move |axes| (0..8).map(move |bits| Self { axes, signs: signs(bits) }))
    }

    /// Where the panorama has what the file shows towards `direction`.
    pub fn apply(&self, direction: DVec3) -> DVec3 {
        let d = direction.to_array();
        DVec3::from([0, 1, 2].map(|i| f64::from(self.signs[i]) * d[self.axes[i]]))
    }

    /// The same as a recipe has it.
    pub fn orientation(&self) -> Turned {
        Turned::new([0, 1, 2].map(|i| (self.axes[i], self.signs[i] < 0)))
    }

    /// Whether left and right are swapped.
    pub fn is_mirrored(&self) -> bool {
        let odd = matches!(self.axes, [0, 2, 1] | [2, 1, 0] | [1, 0, 2]);
        let negative = self.signs.iter().filter(|&&sign| sign < 0).count() % 2 == 1;
        odd != negative
    }

    /// `(−x, y, z)`: where the panorama has what the file shows towards (x, y, z).
    pub fn formula(&self) -> String {
        let part = |i: usize| format!("{}{}", if self.signs[i] < 0 { "−" } else { "" }, ["x", "y", "z"][self.axes[i]]);
        format!("({}, {}, {})", part(0), part(1), part(2))
    }

    /// In words.
    pub fn name(&self) -> String {
        let text = match (self.axes, self.signs) {
            ([0, 1, 2], [1, 1, 1]) => return "as Kiln has it".to_owned(),
            ([0, 1, 2], [-1, 1, 1]) => "mirrored in x",
            ([0, 1, 2], [1, -1, 1]) => "upside down and mirrored (y swapped)",
            ([0, 1, 2], [1, 1, -1]) => "mirrored in z",
            ([0, 1, 2], [-1, 1, -1]) => "turned by 180° about +Y",
            ([2, 1, 0], [_, 1, _]) if !self.is_mirrored() => "turned by 90° about +Y",
            ([0, 2, 1], _) if !self.is_mirrored() => "turned about X, as between Y up and Z up",
            _ if self.is_mirrored() => "mirrored and turned",
            _ => "turned",
        };
        format!("{text}, {}", self.formula())
    }
}

/// Which way round a cube is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Orientation {
    /// The turn that fits best; nothing where none fits well enough to be believed.
    pub turn: Option<Turn>,
    /// Its name.
    pub name: String,
    /// Whether left and right are swapped.
    pub mirrored: bool,
    /// Turns that fit as well: the picture looks the same either way.
    pub as_good: usize,
    /// Mean |ln(file/panorama)| with the best turn.
    pub residual: f64,
    /// The same with the next best that is not as good, if there is one.
    pub runner_up: Option<f64>,
    /// Faces that do not follow the turn, and what is with them.
    pub faces: Vec<FaceFault>,
}

/// A face that does not hold what it should.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FaceFault {
    /// Counted as faces are stored.
    pub face: usize,
    /// In words: `face +Y is rotated by 180°`.
    pub text: String,
}

/// Values below this part of the mean tell little about orientation.
const FLOOR: f64 = 30.0 * DARK_FLOOR;
/// Of the picture's own spread, what the best turn may leave.
const BELIEVED: f64 = 0.5;

/// One level of a chain, small enough to be turned 48 times, and what it may show: the panorama, sharp and blurred. Cubes of one size.
pub struct Picture {
    /// The level.
    pub file: Cube,
    /// The panorama.
    pub truths: Vec<Cube>,
}

/// Finds the turn among those that `may_be`, by a chain's first picture; where several look the same in that, by the next ones.
///
/// What a narrow ring leaves of a picture looks the same from opposite sides, and so does many a symmetric room, until it is blurred
/// otherwise.
pub fn find(first: &Picture, mut others: impl Iterator<Item = Picture>, may_be: &dyn Fn(&Turn) -> bool) -> Orientation {
    let turns: Vec<Turn> = Turn::all().filter(may_be).collect();
    let seen = first.look(&turns);
    let Look { residual, runner_up, .. } = seen;
    if !seen.is_believed {
        let name = "unknown: no turn of the source looks like it".to_owned();
        return Orientation { turn: None, name, mirrored: false, as_good: 0, residual, runner_up, faces: vec![] };
    }
    let any = seen.ties.len() == turns.len();
    let mut ties = seen.ties;
    while !any && ties.len() > 1 {
        let Some(other) = others.next() else { break };
        let seen = other.look(&ties);
        if seen.is_believed {
            ties = seen.ties;
        }
    }
    let turn = if ties.contains(&Turn::NONE) { Turn::NONE } else { ties[0] };
    let mut name = turn.name();
    if any {
        name = "any: the picture looks the same from everywhere".to_owned();
    } else if ties.len() > 1 {
        name += &format!(", or one of {} that look the same", ties.len() - 1);
    }
    let faces = if any { vec![] } else { faults(&first.file, &first.truths[seen.blur], turn) };
    let (mirrored, as_good) = (turn.is_mirrored(), ties.len() - 1);
    Orientation { turn: Some(turn), name, mirrored, as_good, residual, runner_up, faces }
}

/// What a picture says of some turns.
struct Look {
    /// Those that fit best, in the order in which they were given.
    ties: Vec<Turn>,
    residual: f64,
    runner_up: Option<f64>,
    /// Which of the truths fits the best of them.
    blur: usize,
    /// Whether it looks like that at all.
    is_believed: bool,
}

impl Picture {
    fn look(&self, turns: &[Turn]) -> Look {
        let Self { file, truths } = self;
        let seen = logs(file);
        let wanted: Vec<Vec<f64>> = truths.iter().map(logs).collect();
        let mut best: Vec<(f64, Turn, usize)> = vec![];
        for &turn in turns {
            let maps: Vec<usize> = (0..file.texels.len())
                .map(|i| nearest_texel(file.size, turn.apply(texel_direction(file.size, i))))
                .collect();
            let of = |wanted: &Vec<f64>| {
                let turned: Vec<f64> = maps.iter().map(|&i| wanted[i]).collect();
                log_ratio_spread(&seen, &turned)
            };
            let least = wanted.iter().enumerate().map(|(k, wanted)| (of(wanted), turn, k));
            best.extend(least.min_by(|a, b| a.0.total_cmp(&b.0)));
        }
        best.sort_by(|a, b| a.0.total_cmp(&b.0)); // stable: of equals the first of the list, which is no turn at all
        let (residual, turn, blur) = best[0];
        let as_good = |other: f64| other <= 1.05 * residual + 2e-3;
        let ties: Vec<Turn> = best.iter().filter(|entry| as_good(entry.0)).map(|entry| entry.1).collect();
        let runner_up = best.iter().map(|entry| entry.0).find(|&other| !as_good(other));
        let wanted = &wanted[blur];
        let own = log_ratio_spread(wanted, &vec![0.0; wanted.len()]);
        // Of the faces the middle one counts: one or two that are wrong do not hide which way round the others are.
        let turned = |i: usize| wanted[nearest_texel(file.size, turn.apply(texel_direction(file.size, i)))];
        let off: Vec<f64> = (0..seen.len()).map(|i| seen[i] - turned(i)).collect();
        let (middle, area) = (median(&off), file.size * file.size);
        let faces: Vec<f64> =
            off.chunks(area).map(|face| face.iter().map(|d| (d - middle).abs()).sum::<f64>() / area as f64).collect();
        Look { ties, residual, runner_up, blur, is_believed: median(&faces) <= BELIEVED * own || own <= 1e-3 }
    }
}

/// Faces that fit much worse than the others, and what explains them, if anything does.
fn faults(file: &Cube, truth: &Cube, turn: Turn) -> Vec<FaceFault> {
    /// Much worse: five times the median face, and 0.1, which is noise of 256 samples.
    const WORSE: f64 = 5.0;
    const NOISE: f64 = 0.1;
    let (seen, wanted, size) = (logs(file), logs(truth), file.size);
    let area = size * size;
    let offset = median(
        &(0..seen.len())
            .map(|i| seen[i] - wanted[nearest_texel(size, turn.apply(texel_direction(size, i)))])
            .collect::<Vec<_>>(),
    );
    // How far a face is from a face of the turned truth that is itself turned or mirrored in place.
    let off = |face: usize, from: usize, way: usize| {
        let each = (0..area).map(|i| {
            let (mut row, mut column) = (i / size, i % size);
            for _ in 0..way % 4 {
                (row, column) = (size - 1 - column, row);
            }
            if way >= 4 {
                column = size - 1 - column;
            }
            let direction = texel_direction(size, from * area + row * size + column);
            (seen[face * area + i] - offset - wanted[nearest_texel(size, turn.apply(direction))]).abs()
        });
        each.sum::<f64>() / area as f64
    };
    let plain: Vec<f64> = (0..6).map(|face| off(face, face, 0)).collect();
    let usual = median(&plain);
    let mut faults = vec![];
    for face in (0..6).filter(|&face| plain[face] > WORSE * usual + NOISE) {
        let ways = (0..6).flat_map(|from| (0..8).map(move |way| (from, way)));
        let found = ways.map(|(from, way)| (off(face, from, way), from, way)).min_by(|a, b| a.0.total_cmp(&b.0));
        let name = FACES[face];
        let text = match found {
            Some((least, from, way)) if least < 0.5 * plain[face] => {
                let place = ["", "rotated by 90°", "rotated by 180°", "rotated by 270°"][way % 4];
                let mirror = if way >= 4 { "mirrored" } else { "" };
                let how = [mirror, place].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" and ");
                match (from == face, how.is_empty()) {
                    (true, _) => format!("face {name} is {how}"),
                    (false, true) => format!("face {name} holds what belongs on {}", FACES[from]),
                    (false, false) => format!("face {name} holds what belongs on {}, {how}", FACES[from]),
                }
            }
            _ => format!("face {name} does not look like the source"),
        };
        faults.push(FaceFault { face, text });
    }
    faults
}

/// Logarithms of the channels' mean, in parts of the whole mean.
fn logs(cube: &Cube) -> Vec<f64> {
    let grey = |texel: &[f32; 3]| {
        let sum: f64 = texel.iter().map(|&v| f64::from(v)).filter(|v| v.is_finite()).map(|v| v.max(0.0)).sum();
        sum / 3.0
    };
    let values: Vec<f64> = cube.texels.iter().map(grey).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|v| (v / mean.max(f64::MIN_POSITIVE) + FLOOR).ln()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_48_turns_half_of_them_mirrored() {
        let all: Vec<Turn> = Turn::all().collect();
        assert_eq!((all.len(), all[0]), (48, Turn::NONE));
        assert_eq!(all.iter().filter(|turn| turn.is_mirrored()).count(), 24);
        for turn in &all {
            let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn.apply(axis));
            assert_eq!(x.cross(y).dot(z) < 0.0, turn.is_mirrored(), "{turn:?}");
        }
        assert_eq!(all.iter().filter(|turn| all.iter().filter(|other| other == turn).count() == 1).count(), 48);
    }
}
