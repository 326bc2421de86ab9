//! Numbers of few values, as ASTC packs and reads them: bounded integer sequences.
//!
//! A number of `levels` values is some plain bits and, where 3 or 5 divides the levels, a digit of base 3 (trit) or 5 (quint); five trits
//! share eight bits and three quints seven, so that 16 numbers of 12 values take 58 bits instead of 64.
//!
//! **Source**: Khronos, *Data Format Specification* 1.4, ASTC: integer sequence encoding, endpoint unquantization, weight unquantization.

/// How many values a number has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Levels {
    /// Plain bits of each number.
    bits: usize,
    digit: Digit,
}

/// What a number has above its plain bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Digit {
    None,
    Trit,
    Quint,
}

impl Digit {
    /// Numbers whose digits are packed together.
    fn group(self) -> usize {
        match self {
            Self::None => 1,
            Self::Trit => 5,
            Self::Quint => 3,
        }
    }

    /// Where the bits of a group's packed digits lie: this many follow the plain bits of each number.
    fn split(self) -> &'static [usize] {
        match self {
            Self::None => &[0],
            Self::Trit => &[2, 2, 1, 2, 1],
            Self::Quint => &[3, 2, 2],
        }
    }

    fn unpack(self, packed: usize) -> [usize; 5] {
        match self {
            Self::None => [0; 5],
            Self::Trit => trits(packed),
            Self::Quint => quints(packed),
        }
    }

    /// The smallest packed form of some digits, whose high bits are then 0 where the last digits are: an incomplete group has no room for
    /// them.
    fn pack(self, digits: [usize; 5]) -> usize {
        (0..256).find(|&packed| self.unpack(packed) == digits).unwrap_or(0)
    }
}

impl Levels {
    /// Of so many values, if there is such a number.
    pub(super) const fn of(levels: usize) -> Self {
        let (digit, powers) = match levels {
            n if n.is_multiple_of(3) => (Digit::Trit, n / 3),
            n if n.is_multiple_of(5) => (Digit::Quint, n / 5),
            n => (Digit::None, n),
        };
        assert!(powers.is_power_of_two());
        Self { bits: powers.trailing_zeros() as usize, digit }
    }

    pub(super) fn count(self) -> usize {
        let digits = match self.digit {
            Digit::None => 1,
            Digit::Trit => 3,
            Digit::Quint => 5,
        };
        digits << self.bits
    }

    /// Bits that so many numbers take.
    pub(super) const fn bits_of(self, n: usize) -> usize {
        n * self.bits
            + match self.digit {
                Digit::None => 0,
                Digit::Trit => (8 * n).div_ceil(5),
                Digit::Quint => (7 * n).div_ceil(3),
            }
    }

    /// The numbers, from the lowest bit on.
    pub(super) fn write(self, codes: &[u8]) -> u128 {
        let (mut out, mut at) = (0_u128, 0);
        for group in codes.chunks(self.digit.group()) {
            let mut digits = [0; 5];
            for (digit, &code) in digits.iter_mut().zip(group) {
                *digit = usize::from(code) >> self.bits;
            }
            let mut packed = self.digit.pack(digits);
            for (&code, &bits) in group.iter().zip(self.digit.split()) {
                let plain = usize::from(code) & ((1 << self.bits) - 1);
                out |= (plain as u128) << at;
                out |= ((packed & ((1 << bits) - 1)) as u128) << (at + self.bits);
                packed >>= bits;
                at += self.bits + bits;
            }
        }
        // Bits of an incomplete group that are beyond its room are 0.
        out
    }

    /// `codes.len()` numbers, from the lowest bit on.
    pub(super) fn read(self, bits: u128, codes: &mut [u8]) {
        let room = self.bits_of(codes.len());
        let mut rest = bits & ((1 << room) - 1);
        let mut take = |n: usize| {
            let taken = (rest & ((1 << n) - 1)) as usize;
            rest >>= n;
            taken
        };
        for group in codes.chunks_mut(self.digit.group()) {
            let (mut packed, mut at) = (0, 0);
            for (code, &bits) in group.iter_mut().zip(self.digit.split()) {
                *code = take(self.bits) as u8;
                packed |= take(bits) << at;
                at += bits;
            }
            for (code, digit) in group.iter_mut().zip(self.digit.unpack(packed)) {
                *code |= (digit << self.bits) as u8;
            }
        }
    }

    /// What a code of an end point stands for, of 0..=255: replicated bits, or a digit's share with the plain bits spread below it.
    pub(super) fn endpoint(self, code: u8) -> u8 {
        let (pattern, share) = match (self.digit, self.bits) {
            (Digit::Trit, 6) => ("fedcb000f", 5),
            (Digit::Quint, 4) => ("dcb0000dc", 13),
            (Digit::Quint, 3) => ("cb0000cbc", 26),
            // Plain bits; no mode has digits above another number of them.
            _ => return replicated(code.into(), self.bits, 8) as u8,
        };
        let inverted = if code & 1 == 1 { 0x1ff } else { 0 };
        let value = ((usize::from(code) >> self.bits) * share + spread(pattern, code)) ^ inverted;
        ((inverted & 0x80) | (value >> 2)) as u8
    }

    /// What a code of a weight stands for, of 0..=64.
    pub(super) fn weight(self, code: u8) -> u8 {
        let digit = usize::from(code) >> self.bits;
        let value = match (self.digit, self.bits) {
            (Digit::Trit, 0) => [0, 32, 63][digit.min(2)],
            (Digit::Quint, 0) => [0, 16, 32, 47, 63][digit.min(4)],
            (Digit::None, bits) => replicated(code.into(), bits, 6),
            (Digit::Trit | Digit::Quint, bits) => {
                let (pattern, share) = match (self.digit, bits) {
                    (Digit::Trit, 1) => ("0000000", 50),
                    (Digit::Trit, _) => ("b000b0b", 23),
                    _ => ("0000000", 28),
                };
                let inverted = if code & 1 == 1 { 0x7f } else { 0 };
                let value = (digit * share + spread(pattern, code)) ^ inverted;
                (inverted & 0x20) | (value >> 2)
            }
        };
        // 33 steps below the middle and 32 above, so that 64 is reached.
        (value + usize::from(value > 32)) as u8
    }
}

/// `bits` bits, repeated from the top until `wanted` are filled.
fn replicated(value: usize, bits: usize, wanted: usize) -> usize {
    let twice = value << bits | value;
    let fourfold = twice << (2 * bits) | twice;
    if 4 * bits >= wanted { fourfold >> (4 * bits - wanted) } else { value }
}

/// The bits that a pattern names, the highest first: `a` is the code's lowest, `0` is none.
fn spread(pattern: &str, code: u8) -> usize {
    pattern.bytes().fold(0, |value, letter| {
        let bit = if letter == b'0' { 0 } else { usize::from(code) >> (letter - b'a') & 1 };
        value << 1 | bit
    })
}

/// Five trits of eight bits.
fn trits(packed: usize) -> [usize; 5] {
    let bit = |at: usize| packed >> at & 1;
    let bits = |low: usize, n: usize| packed >> low & ((1 << n) - 1);
    // `c` are the five bits that hold the first three.
    let (c, t3, t4) = if bits(2, 3) == 7 {
        (bits(5, 3) << 2 | bits(0, 2), 2, 2)
    } else if bits(5, 2) == 3 {
        (bits(0, 5), bit(7), 2)
    } else {
        (bits(0, 5), bits(5, 2), bit(7))
    };
    let c_bit = |at: usize| c >> at & 1;
    if c & 3 == 3 {
        [c_bit(3) << 1 | (c_bit(2) & !c_bit(3) & 1), c_bit(4), 2, t3, t4]
    } else if c >> 2 & 3 == 3 {
        [c & 3, 2, 2, t3, t4]
    } else {
        [c_bit(1) << 1 | (c_bit(0) & !c_bit(1) & 1), c >> 2 & 3, c_bit(4), t3, t4]
    }
}

/// Three quints of seven bits.
fn quints(packed: usize) -> [usize; 5] {
    let bit = |at: usize| packed >> at & 1;
    let bits = |low: usize, n: usize| packed >> low & ((1 << n) - 1);
    if bits(1, 2) == 3 && bits(5, 2) == 0 {
        let low = bit(0);
        return [4, 4, low << 2 | (bit(4) & !low & 1) << 1 | (bit(3) & !low & 1), 0, 0];
    }
    let (c, q2) =
        if bits(1, 2) == 3 { (bits(3, 2) << 3 | (!bits(5, 2) & 3) << 1 | bit(0), 4) } else { (bits(0, 5), bits(5, 2)) };
    if c & 7 == 5 { [c >> 3 & 3, 4, q2, 0, 0] } else { [c & 7, c >> 3 & 3, q2, 0, 0] }
}
