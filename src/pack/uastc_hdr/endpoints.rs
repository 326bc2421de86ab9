//! The two kinds of end points that UASTC HDR has: six bytes, or four, for two colours of twelve bits a channel.
//!
//! Bits of a field that the bytes' plain places have no room for lie wherever a mode has some left. Which, is written down here once and
//! serves both directions.
//!
//! **Source**: Khronos, *Data Format Specification* 1.4, ASTC: HDR endpoint modes 7 and 11.

/// The largest number of bytes.
pub(super) const MOST_BYTES: usize = 6;
/// The largest value of a channel whose texels stay finite.
pub(super) const LARGEST: i32 = 3967;
const ALL_ONES: i32 = 0xfff;

/// Two colours of twelve bits a channel: where the weight is 0, and where it is 64.
pub(super) type Ends = [[i32; 3]; 2];

/// What the bytes hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// ASTC's mode 7: one colour, and by how much the other is darker, the same for each channel.
    Scaled,
    /// ASTC's mode 11: two colours.
    Direct,
}

/// A bit of the bytes: which byte, and which of its bits.
type Place = (usize, usize);

/// Where a field lies: its low bits in the low bits of a byte, the others one by one.
struct Field {
    byte: usize,
    low: usize,
    high: &'static [Place],
}

impl Field {
    fn bits(&self) -> usize {
        self.low + self.high.len()
    }

    fn get(&self, bytes: &[u8]) -> i32 {
        let low = i32::from(bytes[self.byte]) & ((1 << self.low) - 1);
        let high = self.high.iter().enumerate();
        high.fold(low, |value, (i, &(byte, bit))| value | (i32::from(bytes[byte]) >> bit & 1) << (self.low + i))
    }

    fn get_signed(&self, bytes: &[u8]) -> i32 {
        let shift = 32 - self.bits() as u32;
        self.get(bytes) << shift >> shift
    }

    fn set(&self, bytes: &mut [u8], value: i32) {
        bytes[self.byte] |= (value & ((1 << self.low) - 1)) as u8;
        for (i, &(byte, bit)) in self.high.iter().enumerate() {
            bytes[byte] |= ((value >> (self.low + i) & 1) << bit) as u8;
        }
    }

    /// Sets the nearest value that an unsigned field can hold, of one in steps of 2^`shift`; what that is, and whether it is near.
    fn fit(&self, bytes: &mut [u8], value: i32, shift: u32) -> (i32, bool) {
        self.fit_in(bytes, value, shift, 0, (1 << self.bits()) - 1)
    }

    fn fit_signed(&self, bytes: &mut [u8], value: i32, shift: u32) -> (i32, bool) {
        let half = 1 << (self.bits() - 1);
        self.fit_in(bytes, value, shift, -half, half - 1)
    }

    fn fit_in(&self, bytes: &mut [u8], value: i32, shift: u32, least: i32, most: i32) -> (i32, bool) {
        let wanted = (value + (1 << shift >> 1)) >> shift;
        let held = wanted.clamp(least, most);
        self.set(bytes, held);
        (held << shift, held == wanted)
    }
}

// Places that more than one mode uses, as the specification numbers them.
mod direct {
    use super::{Field, Place};
    const A8: Place = (1, 6);
    const X0: Place = (2, 6);
    const X1: Place = (3, 6);
    const X2: Place = (4, 6);
    const X3: Place = (5, 6);
    const X4: Place = (4, 5);
    const X5: Place = (5, 5);

    /// The brightest channel `a`; by how much the others are darker, `b`; by how much the other end is darker, `c`; and what that is off by
    /// in the other channels, `d`.
    pub(super) struct Mode {
        pub(super) shift: u32,
        pub(super) a: Field,
        pub(super) b: [Field; 2],
        pub(super) c: Field,
        pub(super) d: [Field; 2],
    }

    const fn mode(shift: u32, a: &'static [Place], b: [&'static [Place]; 2], c: &'static [Place], d: usize) -> Mode {
        Mode {
            shift,
            a: Field { byte: 0, low: 8, high: a },
            b: [Field { byte: 2, low: 6, high: b[0] }, Field { byte: 3, low: 6, high: b[1] }],
            c: Field { byte: 1, low: 6, high: c },
            d: [Field { byte: 4, low: d, high: &[] }, Field { byte: 5, low: d, high: &[] }],
        }
    }

    pub(super) static MODES: [Mode; 8] = [
        mode(3, &[A8], [&[X0], &[X1]], &[], 7),
        mode(3, &[A8], [&[X0, X2], &[X1, X3]], &[], 6),
        mode(2, &[A8, X0], [&[], &[]], &[X1], 7),
        mode(2, &[A8, X2], [&[X0], &[X1]], &[X3], 6),
        mode(1, &[A8, X4, X5], [&[X0, X2], &[X1, X3]], &[], 5),
        mode(1, &[A8, X0, X1], [&[], &[]], &[X3, X2], 6),
        mode(0, &[A8, X4, X5, X2], [&[X0], &[X1]], &[X3], 5),
        mode(0, &[A8, X0, X1, X2], [&[], &[]], &[X3], 6),
    ];
    /// Where the number of the mode lies, its lowest bit first.
    pub(super) const NUMBER: Field = Field { byte: 0, low: 0, high: &[(1, 7), (2, 7), (3, 7)] };
    /// Where the brightest channel is named; 3 is for colours as they are.
    pub(super) const BRIGHTEST: Field = Field { byte: 0, low: 0, high: &[(4, 7), (5, 7)] };
}

mod scaled {
    use super::{Field, Place};
    const X0: Place = (1, 6);
    const X1: Place = (1, 5);
    const X2: Place = (2, 6);
    const X3: Place = (2, 5);
    const X4: Place = (3, 7);
    const X5: Place = (3, 6);
    const X6: Place = (3, 5);

    /// The brightest channel; by how much the others are darker (in the last mode, what they are); by how much the other end is darker.
    pub(super) struct Mode {
        pub(super) shift: u32,
        pub(super) brightest: Field,
        pub(super) others: [Field; 2],
        pub(super) scale: Field,
    }

    const fn mode(
        shift: u32,
        brightest: &'static [Place],
        others: [&'static [Place]; 2],
        scale: &'static [Place],
    ) -> Mode {
        Mode {
            shift,
            brightest: Field { byte: 0, low: 6, high: brightest },
            others: [Field { byte: 1, low: 5, high: others[0] }, Field { byte: 2, low: 5, high: others[1] }],
            scale: Field { byte: 3, low: 5, high: scale },
        }
    }

    pub(super) static MODES: [Mode; 6] = [
        mode(1, &[X4, X2, X1, X0, X3], [&[], &[]], &[X6, X5]),
        mode(1, &[X4, X2, X0, X6, X5], [&[X1], &[X3]], &[]),
        mode(2, &[X3, X2, X1, X0], [&[], &[]], &[X6, X5, X4]),
        mode(3, &[X4, X2, X0], [&[X1], &[X3]], &[X6, X5]),
        mode(4, &[X4, X5], [&[X1, X0], &[X3, X2]], &[X6]),
        mode(5, &[X4], [&[X1, X0], &[X3, X2]], &[X6, X5]),
    ];
    /// Mode and brightest channel together, by [`number`](super::scaled_number).
    pub(super) const NUMBER: Field = Field { byte: 0, low: 0, high: &[(0, 6), (0, 7), (1, 7), (2, 7)] };
}

/// The four bits that stand for a mode and the brightest channel.
fn scaled_number(mode: usize, brightest: usize) -> i32 {
    (match mode {
        5 => 0b1111,
        4 => 0b1100 | brightest,
        mode => brightest << 2 | mode,
    }) as i32
}

fn scaled_mode(number: i32) -> (usize, usize) {
    let number = number as usize;
    match (number >> 2, number & 3) {
        (3, 3) => (5, 0),
        (3, brightest) => (4, brightest),
        (brightest, mode) => (mode, brightest),
    }
}

impl Kind {
    /// Both.
    pub(super) const ALL: [Self; 2] = [Self::Scaled, Self::Direct];

    /// Its number in ASTC.
    pub(super) fn number(self) -> usize {
        match self {
            Self::Scaled => 7,
            Self::Direct => 11,
        }
    }

    /// How many bytes it takes.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Scaled => 4,
            Self::Direct => 6,
        }
    }

    /// Bits at the top of each byte that choose modes or count for much: a coarser number of levels may change only those below.
    pub(super) fn kept_bits(self, byte: usize) -> usize {
        match (self, byte) {
            (Self::Scaled, 0) => 2,
            (Self::Scaled, _) => 3,
            (Self::Direct, 0) => 0,
            (Self::Direct, 1..=3) => 2,
            (Self::Direct, _) => 3,
        }
    }

    /// The colours that the bytes stand for.
    pub(super) fn decode(self, bytes: &[u8]) -> Ends {
        let ends = match self {
            Self::Scaled => decode_scaled(bytes),
            Self::Direct => decode_direct(bytes),
        };
        // As the specification has it: differences may lead out of the twelve bits.
        ends.map(|end| end.map(|v| v.clamp(0, ALL_ONES)))
    }

    /// Bytes for two colours, in the ways that there are, from the most precise on: the first two that hold them, and before those the ones
    /// that cannot and give what is nearest in their fields.
    pub(super) fn encode(self, ends: &Ends, mut take: impl FnMut([u8; MOST_BYTES])) {
        let mut holding = 0;
        let mut go_on = |(bytes, holds): ([u8; MOST_BYTES], bool)| {
            take(bytes);
            holding += usize::from(holds);
            holding < 2
        };
        match self {
            Self::Scaled => {
                let _ = (0..scaled::MODES.len()).all(|mode| go_on(encode_scaled(ends, mode)));
            }
            Self::Direct => {
                let _ = (0..direct::MODES.len()).rev().all(|mode| go_on(encode_direct(ends, mode)))
                    && go_on((encode_plain(ends), true));
            }
        }
    }
}

/// The channels in the order of the fields: the brightest first, in whose place the first is.
fn order(brightest: usize) -> [usize; 3] {
    [[0, 1, 2], [1, 0, 2], [2, 1, 0]][brightest]
}

/// The channel of the largest value; the first of equal ones.
fn brightest(colour: &[i32; 3]) -> usize {
    (1..3).fold(0, |best, c| if colour[c] > colour[best] { c } else { best })
}

fn decode_direct(bytes: &[u8]) -> Ends {
    let brightest = direct::BRIGHTEST.get(bytes) as usize;
    if brightest == 3 {
        let value = |i: usize| if i < 4 { i32::from(bytes[i]) << 4 } else { (i32::from(bytes[i]) & 0x7f) << 5 };
        return [0, 1].map(|end| [0, 2, 4].map(|first| value(first + end)));
    }
    let mode = &direct::MODES[direct::NUMBER.get(bytes) as usize];
    let a = mode.a.get(bytes) << mode.shift;
    let c = mode.c.get(bytes) << mode.shift;
    let mut ends = [[0; 3]; 2];
    for (field, channel) in order(brightest).into_iter().enumerate() {
        let (b, d) = match field {
            0 => (0, 0),
            i => (mode.b[i - 1].get(bytes) << mode.shift, mode.d[i - 1].get_signed(bytes) << mode.shift),
        };
        ends[1][channel] = a - b;
        ends[0][channel] = a - b - c - d;
    }
    ends
}

/// Eight bits of red and green and seven of blue, as they are.
fn encode_plain(ends: &Ends) -> [u8; MOST_BYTES] {
    std::array::from_fn(|i| {
        let value = ends[i % 2][i / 2];
        // What is beyond 247 stands for infinity.
        if i < 4 { ((value + 8) >> 4).clamp(0, 247) as u8 } else { ((value + 16) >> 5).clamp(0, 123) as u8 | 0x80 }
    })
}

fn encode_direct(ends: &Ends, number: usize) -> ([u8; MOST_BYTES], bool) {
    let mode = &direct::MODES[number];
    let brightest = brightest(&ends[1]);
    let order = order(brightest);
    let mut bytes = [0; MOST_BYTES];
    direct::BRIGHTEST.set(&mut bytes, brightest as i32);
    direct::NUMBER.set(&mut bytes, number as i32);
    let (a, mut holds) = mode.a.fit(&mut bytes, ends[1][brightest], mode.shift);
    let (c, near) = mode.c.fit(&mut bytes, a - ends[0][brightest], mode.shift);
    holds &= near;
    for i in 0..2 {
        let channel = order[i + 1];
        let (b, near) = mode.b[i].fit(&mut bytes, a - ends[1][channel], mode.shift);
        holds &= near;
        let (_, near) = mode.d[i].fit_signed(&mut bytes, a - b - c - ends[0][channel], mode.shift);
        holds &= near;
    }
    (bytes, holds)
}

fn decode_scaled(bytes: &[u8]) -> Ends {
    let (number, brightest) = scaled_mode(scaled::NUMBER.get(bytes));
    let mode = &scaled::MODES[number];
    let largest = mode.brightest.get(bytes) << mode.shift;
    let scale = mode.scale.get(bytes) << mode.shift;
    let mut ends = [[0; 3]; 2];
    for (field, channel) in order(brightest).into_iter().enumerate() {
        let value = match field {
            0 => largest,
            i if number == 5 => mode.others[i - 1].get(bytes) << mode.shift,
            i => largest - (mode.others[i - 1].get(bytes) << mode.shift),
        };
        ends[1][channel] = value;
        ends[0][channel] = value - scale;
    }
    ends
}

fn encode_scaled(ends: &Ends, number: usize) -> ([u8; MOST_BYTES], bool) {
    let mode = &scaled::MODES[number];
    let brightest = if number == 5 { 0 } else { brightest(&ends[1]) };
    let order = order(brightest);
    let mut bytes = [0; MOST_BYTES];
    scaled::NUMBER.set(&mut bytes, scaled_number(number, brightest));
    let (largest, mut holds) = mode.brightest.fit(&mut bytes, ends[1][brightest], mode.shift);
    for i in 0..2 {
        let value = ends[1][order[i + 1]];
        let (_, near) = mode.others[i].fit(&mut bytes, if number == 5 { value } else { largest - value }, mode.shift);
        holds &= near;
    }
    let scale: i32 = (0..3).map(|c| ends[1][c] - ends[0][c]).sum::<i32>() / 3;
    let (_, near) = mode.scale.fit(&mut bytes, scale, mode.shift);
    (bytes, holds && near)
}
