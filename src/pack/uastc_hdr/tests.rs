//! What holds of every block, whatever is in it. (That others decode the same bits, the tests of three.js' loader show.)

use super::*;
use crate::pack::tests::Random;
use decode::{half, logarithm};
use endpoints::{Kind, LARGEST, MOST_BYTES};
use integers::Levels;
use layout::{MODES, Mixed, PATTERNS};

/// A block of a mode, with codes of any value.
fn any_block(random: &mut Random, mode: &'static layout::Mode) -> Block {
    let mut code = |levels: Levels| random.below(levels.count() as u64) as u8;
    let mut mixed = Mixed { mode, pattern: 0, endpoints: [0; 2 * MOST_BYTES], weights: [0; blocks::TEXELS] };
    mixed.endpoints[..mode.endpoint_bytes()].iter_mut().for_each(|byte| *byte = code(mode.endpoints));
    mixed.weights.iter_mut().for_each(|weight| *weight = code(mode.weights));
    if mode.subsets == 2 {
        mixed.pattern = random.below(PATTERNS.len() as u64) as usize;
    }
    Block::Mixed(mixed)
}

#[test]
fn a_block_is_read_as_it_was_written_unless_it_could_be_infinite() {
    let mut random = Random(1);
    for mode in &MODES {
        let (mut read, mut refused) = (0, 0);
        for _ in 0..200 {
            let block = any_block(&mut random, mode);
            let Block::Mixed(mixed) = &block else { continue };
            let finite = (0..mode.subsets).all(|s| mixed.ends(s).as_flattened().iter().all(|&v| v <= LARGEST));
            assert_eq!(Block::from_bytes(block.to_bytes()), finite.then_some(block), "{mode:?}");
            *(if finite { &mut read } else { &mut refused }) += 1;
        }
        assert!(read > 50, "{mode:?}: {read} read, {refused} refused");
    }
}

#[test]
fn any_bytes_are_a_block_of_finite_texels_or_none_and_nothing_panics() {
    let mut random = Random(2);
    let mut blocks = 0;
    for i in 0..20_000 {
        let mut bytes = (u128::from(random.next()) << 64 | u128::from(random.next())).to_le_bytes();
        if i % 2 == 0 {
            // A right block with a few bits turned.
            bytes = any_block(&mut random, &MODES[i / 2 % MODES.len()]).to_bytes();
            for _ in 0..random.below(3) {
                bytes[random.below(16) as usize] ^= 1 << random.below(8);
            }
        }
        let values = [unpack(4, 4, &bytes), unpack_transcoded(4, 4, &bytes)].concat();
        match Block::from_bytes(bytes) {
            Some(block) => {
                assert!(values.iter().all(|v| (0.0..=65504.0).contains(v)), "{block:?}: {values:?}");
                // Codes that more than one packing of digits stands for are written in the usual one.
                assert_eq!(Block::from_bytes(block.to_bytes()), Some(block));
                blocks += 1;
            }
            None => assert!(values.iter().all(|v| v.is_nan())),
        }
    }
    assert!(blocks > 4000, "{blocks} blocks");
}

/// Sixteen colours of a kind that bakes have: smooth, an edge, of one hue, noise, with a sun, with black.
fn colours(random: &mut Random, kind: usize) -> [[f64; 3]; blocks::TEXELS] {
    let base: [f64; 3] = std::array::from_fn(|_| 10_f64.powf(3.0 * random.unit() - 2.0));
    let slope: [f64; 3] = std::array::from_fn(|_| 0.1 * random.unit());
    let mut texels: [[f64; 3]; 16] = std::array::from_fn(|i| {
        let (x, y) = ((i % 4) as f64, (i / 4) as f64);
        let edge = if x + 0.3 * y > 2.0 { 5.0 } else { 1.0 };
        std::array::from_fn(|c| match kind {
            0 => base[c] * (1.0 + slope[c] * x + slope[(c + 1) % 3] * y),
            1 => base[c] * if c == 0 { edge } else { 1.0 / edge },
            2 => base[c] * 2_f64.powf(0.5 * x - 0.3 * y),
            _ => base[c] * (0.2 + random.unit()),
        })
    });
    match kind {
        4 => texels[random.below(16) as usize] = [60_000.0, 65_504.0, 40_000.0],
        5 => texels[random.below(16) as usize] = [0.0, 0.0, 1e-7],
        _ => {}
    }
    texels
}

#[test]
fn what_is_encoded_is_in_the_subset_and_off_by_what_the_report_says() {
    let mut random = Random(3);
    for i in 0..120 {
        let texels = colours(&mut random, i % 6);
        let (bytes, report) = pack(4, 4, texels.as_flattened());
        let block = Block::from_bytes(bytes[..].try_into().unwrap()).expect("a block of the subset");
        let back = values(decode::texels(&block));
        let mut worst = 0.0_f64;
        for (wanted, back) in texels.as_flattened().iter().zip(back.as_flattened()) {
            worst = worst.max((f64::from(*back) - wanted).abs());
        }
        assert_eq!(report.max_abs_error, worst, "{texels:?}");
        let transcoded = unpack_transcoded(4, 4, &bytes);
        let brightest = f64::from(transcoded.iter().copied().fold(0.0, f32::max));
        let part = |(wanted, back): (&f64, &f32)| (f64::from(*back) - wanted).abs() / brightest.max(*wanted);
        let parts = texels.as_flattened().iter().zip(&transcoded).map(part);
        assert_eq!(report.max_transcoded_error, parts.fold(0.0, f64::max), "{texels:?}");
        assert_eq!((report.overflowed, report.negative, report.nonfinite), (0, 0, 0));
    }
}

/// A ramp along which every channel grows by the same factor lies on a line of logarithms, but for their bends: the nearest of 16 weights is
/// off by a thirtieth of its length, the ends by half of their steps; and BC6H, which bends otherwise, by the bends' 0.09 of a doubling more.
#[test]
fn a_ramp_is_held_as_closely_as_sixteen_weights_allow() {
    let mut random = Random(4);
    for _ in 0..40 {
        let base: [f64; 3] = std::array::from_fn(|_| 0.1 + random.unit());
        let doublings = 4.0 * random.unit();
        let texels: [[f64; 3]; 16] = std::array::from_fn(|i| base.map(|v| v * 2_f64.powf(doublings * i as f64 / 15.0)));
        let (bytes, _) = pack(4, 4, texels.as_flattened());
        let room = doublings / 30.0 + 0.5 / 16.0 + 0.09;
        for back in [unpack(4, 4, &bytes), unpack_transcoded(4, 4, &bytes)] {
            for (wanted, back) in texels.as_flattened().iter().zip(back) {
                let off = (f64::from(back) / wanted).log2().abs();
                assert!(off < room, "{doublings} doublings: {back} for {wanted}, {off} off");
            }
        }
    }
}

#[test]
fn one_colour_keeps_its_halves_in_astc_and_in_bc6h() {
    let mut random = Random(5);
    let mut colours: Vec<[u16; 3]> = vec![[0x3c00; 3], [0; 3], [0x7bff; 3], [1, 0x3ff, 0x400]];
    colours.extend((0..50).map(|_| [0; 3].map(|_: u16| random.below(0x7c00) as u16)));
    for halves in colours {
        let colour = halves.map(|half| f16::from_bits(half).to_f32());
        let (bytes, report) = pack(4, 4, [colour; 16].as_flattened());
        assert_eq!(
            (report.max_abs_error, report.max_block_error, report.max_transcoded_error),
            (0.0, 0.0, 0.0),
            "{colour:?}"
        );
        assert_eq!(unpack(4, 4, &bytes), [colour; 16].concat());
        assert_eq!(unpack_transcoded(4, 4, &bytes), [colour; 16].concat());
    }
}

#[test]
fn every_half_comes_back_from_its_logarithm() {
    for bits in 0..0x7c00_u16 {
        let value: f64 = f16::from_bits(bits).into();
        assert_eq!(half((logarithm(value) + 0.5) as i32), bits, "{value}");
    }
}

#[test]
fn numbers_of_every_number_of_levels_are_read_as_they_were_written() {
    let mut random = Random(6);
    for levels in MODES.iter().flat_map(|mode| [mode.weights, mode.endpoints]) {
        for n in 1..=12 {
            let codes: Vec<u8> = (0..n).map(|_| random.below(levels.count() as u64) as u8).collect();
            let bits = levels.write(&codes);
            assert!(bits >> levels.bits_of(n) == 0, "{codes:?} of {levels:?} take more room than they have");
            let mut back = vec![0; n];
            levels.read(bits | u128::MAX << levels.bits_of(n), &mut back);
            assert_eq!(back, codes, "{levels:?}");
        }
    }
}

/// Of the ways to store two colours the precise ones come first, and one of those tried is within 16 of 4096 of any whose channels are alike,
/// and within 32 of any at all.
#[test]
fn two_colours_are_stored_within_the_steps_of_some_mode() {
    let mut random = Random(7);
    for kind in Kind::ALL {
        for i in 0..500 {
            let room = if i % 2 == 0 { 40 } else { LARGEST as u64 };
            let base = random.below((LARGEST as u64 - room).max(1) + 1);
            let mut value = || (base + random.below(room)) as i32;
            let mut ends: endpoints::Ends = [[value(), value(), value()], [value(), value(), value()]];
            if kind == Kind::Scaled {
                let darker = (value() - base as i32).min(*ends[1].iter().min().unwrap());
                ends[0] = ends[1].map(|v| v - darker);
            }
            let mut best = i32::MAX;
            kind.encode(&ends, |bytes| {
                let stored = kind.decode(&bytes);
                let off = stored.as_flattened().iter().zip(ends.as_flattened()).map(|(a, b)| (a - b).abs()).max();
                best = best.min(off.unwrap());
            });
            let step = if room == 40 { 16 } else { 32 };
            assert!(best <= step, "{kind:?} {ends:?}: {best} off");
        }
    }
}
