//! The texels of one subset as a line of colours: which ends, and which weight for each.
//!
//! Colours are logarithms, as ASTC interpolates them; what a texel is off by is their difference.

use super::decode::between;
use super::endpoints::{Ends, Kind, LARGEST, MOST_BYTES};
use super::layout::{MODES, Mode, TEXELS};
use std::sync::LazyLock;

/// Three logarithms.
pub(super) type Colour = [f32; 3];

/// A texel's number, and its colour.
pub(super) type Texel = (usize, Colour);

/// What the search looks up for a mode.
pub(super) struct Tables {
    /// What codes of end points stand for.
    values: [u8; 256],
    /// The code nearest to a byte, of those that share its highest bits: none of them, one, two or three.
    nearest: [[u8; 256]; 4],
    /// The codes of the next lower and the next higher value; a code itself at the ends.
    beside: [[u8; 2]; 256],
    /// The weight nearest to a number of 256ths, and its code.
    weights: [(u8, u8); 257],
}

/// Those of each mode.
static TABLES: LazyLock<Vec<Tables>> = LazyLock::new(|| MODES.iter().map(Tables::new).collect());

impl Tables {
    fn new(mode: &Mode) -> Self {
        let codes = 0..mode.endpoints.count();
        let mut values = [0; 256];
        codes.clone().for_each(|code| values[code] = mode.endpoints.endpoint(code as u8));
        let mut in_order: Vec<u8> = codes.map(|code| code as u8).collect();
        in_order.sort_by_key(|&code| values[usize::from(code)]);
        let mut beside = [[0; 2]; 256];
        for (i, &code) in in_order.iter().enumerate() {
            beside[usize::from(code)] = [in_order[i.saturating_sub(1)], in_order[(i + 1).min(in_order.len() - 1)]];
        }
        let nearest = [0_u32, 1, 2, 3].map(|kept| {
            std::array::from_fn(|byte| {
                let top = |value: u8| u32::from(value) >> (8 - kept);
                let same = in_order.iter().filter(|&&code| top(values[usize::from(code)]) == top(byte as u8));
                *same.min_by_key(|&&code| values[usize::from(code)].abs_diff(byte as u8)).unwrap_or(&0)
            })
        });
        let weight = |code: u8| mode.weights.weight(code);
        let weights = std::array::from_fn(|at| {
            let codes = (0..mode.weights.count()).map(|code| code as u8);
            let code = codes.min_by_key(|&code| (4 * usize::from(weight(code))).abs_diff(at)).unwrap_or(0);
            (weight(code), code)
        });
        Self { values, nearest, beside, weights }
    }
}

/// The texels of one subset, and what a mode can make of them.
pub(super) struct Subset<'a> {
    pub(super) texels: &'a [Texel],
    kind: Kind,
    tables: &'a Tables,
}

/// End points and weights of a subset.
#[derive(Clone, Copy)]
pub(super) struct Fit {
    /// The codes of the end points.
    pub(super) codes: [u8; MOST_BYTES],
    /// What weights stand for and their codes, in the order of the subset's texels.
    pub(super) weights: [(u8, u8); TEXELS],
    /// The sum of squares of what texels are off by.
    pub(super) error: f32,
}

/// How often end points are fitted to weights, and weights to them.
const ROUNDS: usize = 2;
/// Of the ways to store two colours, those that are judged by the texels: the ones nearest to the colours.
const WAYS: usize = 2;

impl<'a> Subset<'a> {
    /// Texels as the mode of that number has them.
    pub(super) fn new(texels: &'a [Texel], mode: usize) -> Self {
        Self { texels, kind: MODES[mode].kind, tables: &TABLES[mode] }
    }

    /// The end points that codes stand for; nothing where a texel between them could be infinite.
    fn ends(&self, codes: &[u8; MOST_BYTES]) -> Option<Ends> {
        let mut bytes = [0; MOST_BYTES];
        for (byte, &code) in bytes.iter_mut().zip(codes) {
            *byte = self.tables.values[usize::from(code)];
        }
        let ends = self.kind.decode(&bytes);
        ends.as_flattened().iter().all(|&v| v <= LARGEST).then_some(ends)
    }

    /// The codes one lower and one higher.
    pub(super) fn beside(&self, code: u8) -> [u8; 2] {
        self.tables.beside[usize::from(code)]
    }

    /// The best weights for end points.
    pub(super) fn weigh(&self, codes: [u8; MOST_BYTES]) -> Option<Fit> {
        let [low, high] = self.ends(&codes)?.map(|end| end.map(|v| v << 4));
        let along = [0, 1, 2].map(|c| (high[c] - low[c]) as f32);
        let length = dot(along, along);
        let per_length = if length > 0.0 { 256.0 / length } else { 0.0 };
        let mut fit = Fit { codes, weights: [(0, 0); TEXELS], error: 0.0 };
        for ((_, texel), chosen) in self.texels.iter().zip(&mut fit.weights) {
            let from = [0, 1, 2].map(|c| texel[c] - low[c] as f32);
            // Beyond the ends there is no weight.
            let part = (dot(from, along) * per_length + 0.5).clamp(0.0, 256.0) as usize;
            *chosen = self.tables.weights[part];
            for c in 0..3 {
                let off = texel[c] - between(low[c], high[c], chosen.0.into()) as f32;
                fit.error += off * off;
            }
        }
        Some(fit)
    }

    /// The stored colours nearest to two wanted ones.
    fn ways(&self, [low, high]: [Colour; 2]) -> [Option<[u8; MOST_BYTES]>; WAYS] {
        let mut best = [(f32::INFINITY, None); WAYS];
        let mut store = |ends: [Colour; 2]| {
            // A line may be drawn beyond black and beyond what stays finite; end points may not.
            let wanted: Ends = ends.map(|end| end.map(|v| (v / 16.0 + 0.5).clamp(0.0, LARGEST as f32) as i32));
            self.kind.encode(&wanted, |bytes| {
                let mut codes = [0; MOST_BYTES];
                for (i, (code, &byte)) in codes.iter_mut().zip(&bytes[..self.kind.bytes()]).enumerate() {
                    *code = self.tables.nearest[self.kind.kept_bits(i)][usize::from(byte)];
                }
                let Some(stored) = self.ends(&codes) else { return };
                let mut off = 0.0;
                for (stored, wanted) in stored.as_flattened().iter().zip(ends.as_flattened()) {
                    let d = (16 * stored) as f32 - wanted;
                    off += d * d;
                }
                let mut entry = (off, Some(codes));
                for place in &mut best {
                    if place.1 == entry.1 {
                        break;
                    }
                    if entry.0 < place.0 {
                        std::mem::swap(place, &mut entry);
                    }
                }
            });
        };
        store([low, high]);
        if self.kind == Kind::Direct {
            store([high, low]);
        }
        best.map(|(_, codes)| codes)
    }

    /// The colours that suit weights best, in least squares; nothing where those are all the same.
    fn colours(&self, fit: &Fit) -> Option<[Colour; 2]> {
        let n = self.texels.len() as f32;
        let weights = || fit.weights.iter().map(|&(weight, _)| f32::from(weight) / 64.0);
        let mean = weights().take(self.texels.len()).sum::<f32>() / n;
        let (mut spread, mut middle, mut slope) = (0.0, [0.0; 3], [0.0; 3]);
        for ((_, texel), weight) in self.texels.iter().zip(weights()) {
            spread += (weight - mean) * (weight - mean);
            for c in 0..3 {
                middle[c] += texel[c] / n;
                slope[c] += (weight - mean) * texel[c];
            }
        }
        if spread == 0.0 {
            return None;
        }
        if self.kind == Kind::Scaled {
            slope = [slope.iter().sum::<f32>() / 3.0; 3];
        }
        let at = |weight: f32| [0, 1, 2].map(|c| middle[c] + slope[c] / spread * (weight - mean));
        Some([at(0.0), at(1.0)])
    }

    /// The best fit that a few rounds find.
    pub(super) fn fit(&self) -> Option<Fit> {
        let (middle, axis) = line(self.texels.iter().map(|(_, texel)| *texel), self.kind);
        let along = |texel: &Colour| dot([0, 1, 2].map(|c| texel[c] - middle[c]), axis);
        let (from, to) = self.texels.iter().fold((0.0_f32, 0.0_f32), |(from, to), (_, texel)| {
            let at = along(texel);
            (from.min(at), to.max(at))
        });
        let mut colours = [from, to].map(|at| [0, 1, 2].map(|c| middle[c] + axis[c] * at));
        let mut best: Option<Fit> = None;
        for _ in 0..ROUNDS {
            let ways = self.ways(colours).into_iter().flatten();
            let found = ways.filter_map(|codes| self.weigh(codes)).min_by(|a, b| a.error.total_cmp(&b.error));
            let Some(found) = found.filter(|found| best.is_none_or(|best| found.error < best.error)) else { break };
            best = Some(found);
            let Some(next) = self.colours(&found) else { break };
            colours = next;
        }
        best
    }
}

fn dot(a: Colour, b: Colour) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The mean and the direction of a line through colours: that of their largest spread; or of equal change in all channels.
fn line(colours: impl Iterator<Item = Colour> + Clone, kind: Kind) -> (Colour, Colour) {
    const GREY: Colour = [0.577_350_26; 3];
    /// Multiplications that turn a first guess into the direction.
    const TURNS: usize = 4;
    let n = colours.clone().count() as f32;
    let middle = colours.clone().fold([0.0; 3], |sum, colour| [0, 1, 2].map(|c| sum[c] + colour[c] / n));
    if kind == Kind::Scaled {
        return (middle, GREY);
    }
    let mut spread = [[0.0_f32; 3]; 3];
    for colour in colours {
        let off = [0, 1, 2].map(|c| colour[c] - middle[c]);
        for (row, &a) in spread.iter_mut().zip(&off) {
            for (cell, &b) in row.iter_mut().zip(&off) {
                *cell += a * b;
            }
        }
    }
    // The row of the channel that spreads most is never across the direction wanted.
    let widest = (1..3).fold(0, |best, c| if spread[c][c] > spread[best][best] { c } else { best });
    let mut axis = spread[widest];
    for _ in 0..TURNS {
        let length = dot(axis, axis).sqrt();
        if length == 0.0 {
            return (middle, GREY);
        }
        axis = axis.map(|v| v / length);
        axis = spread.map(|row| dot(row, axis));
    }
    let length = dot(axis, axis).sqrt();
    if length == 0.0 { (middle, GREY) } else { (middle, axis.map(|v| v / length)) }
}

/// The sum of squares of the distances to that line: no ends and no weights come closer.
pub(super) fn off_line(colours: impl Iterator<Item = Colour> + Clone, kind: Kind) -> f32 {
    let (middle, axis) = line(colours.clone(), kind);
    let squares = colours.map(|colour| {
        let off = [0, 1, 2].map(|c| colour[c] - middle[c]);
        let along = dot(off, axis);
        dot(off, off) - along * along
    });
    squares.sum()
}
