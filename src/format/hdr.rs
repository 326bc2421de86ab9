//! Radiance HDR (`.hdr`, `.pic`).
//!
//! - **Written**: RGBE as [`crate::pack::rgbe`] rounds it, `-Y +X`, run lengths of the new kind where the width allows them (8 to 32767), no
//!   exposure; metadata that fits a short line. A certificate does not.
//! - **Values read**: mantissa · 2^(e − 136), exactly; exponent 0 is black. Then divided by the header's EXPOSURE and COLORCORR
//!   (all of them multiplied together), by which the pixels had been multiplied, in f64, and rounded to f32.
//! - **Colour**: the line `PRIMARIES=` holds x and y of red, green, blue and white; without it, or with zeros, nothing is said.
//! - **Orientation**: all eight, brought to row 0 at the top and columns to the right.
//! - **Refused**: XYZE colour; sizes that the length of the file cannot hold, before anything is allocated for them.
//!
//! Not read through the `image` crate: that knows one orientation out of eight and drops what it cannot parse of EXPOSURE,
//! and its count of old-style run lengths overflows on a chain of empty runs (a panic where overflow is checked). What it
//! does read, the tests read with it as well.
//!
//! **Source**: Ward, "Real Pixels", Graphics Gems II (1991), for the pixel format; the keys and the order of the axes are
//! those of the Radiance file format.

mod write;

pub use write::encode;

use super::{Image, memory};
use crate::colour::Primaries;
use crate::error::{Error, Result};

/// What every Radiance picture begins with; `RADIANCE` follows, or `RGBE` in old ones.
pub const MAGIC: &[u8] = b"#?";

/// No honest file holds more pixels per byte: at best a row of 32767 pixels takes 4 + 4·2·259 bytes.
const MAX_PIXELS_PER_BYTE: u64 = 4096;

/// The rows of new-style run lengths: no shorter, and shorter than 2¹⁵.
const RUN_LENGTH_WIDTHS: std::ops::Range<usize> = 8..0x8000;

/// The picture in `bytes`, channels R, G and B; the header's `KEY=value` lines become its metadata.
///
/// **Errors**: see the head of this module; also truncated or contradictory data.
pub fn decode(bytes: &[u8]) -> Result<Image> {
    let (header, pixels) = Header::parse(bytes)?;
    header.check_size(pixels.len())?;
    let mut pixels = Bytes { rest: pixels };
    let (scanline, n_scanlines) = (header.size[1], header.size[0]);
    // Grown row by row: a header that promises too much fails at the end of the data, not in the allocator.
    // (What each byte of flat pixels would hold is reserved.)
    let mut rows: Vec<[f32; 3]> = Vec::with_capacity((scanline * n_scanlines).min(pixels.rest.len()));
    let mut row = vec![[0_u8; 4]; scanline];
    // 2^(e − 136) of every exponent; 0 is black. (All of them, and 255 times as much, are f32.)
    let units: [f32; 256] = std::array::from_fn(|e| if e == 0 { 0.0 } else { 2_f64.powi(e as i32 - 136) as f32 });
    for y in 0..n_scanlines {
        read_scanline(&mut pixels, &mut row).map_err(|problem| {
            Error::invalid(
                format!("scanline {y} of {n_scanlines} {problem}"),
                "the file is damaged; copy or download it again",
            )
        })?;
        match header.exposure {
            [1.0, 1.0, 1.0] => rows.extend(row.iter().map(|&rgbe| unexposed(rgbe, &units))),
            exposure => rows.extend(row.iter().map(|&rgbe| radiance(rgbe, &units, exposure))),
        }
    }
    Ok(header.upright(rows))
}

/// The radiance of a pixel of a picture that was never exposed: exact.
fn unexposed([r, g, b, e]: [u8; 4], units: &[f32; 256]) -> [f32; 3] {
    [r, g, b].map(|mantissa| f32::from(mantissa) * units[usize::from(e)])
}

/// The radiance of a pixel; beyond the range of f32 (only ever by a tiny exposure) it is infinite.
fn radiance([r, g, b, e]: [u8; 4], units: &[f32; 256], exposure: [f64; 3]) -> [f32; 3] {
    let unit = f64::from(units[usize::from(e)]);
    let channel = |mantissa: u8, exposure: f64| (f64::from(mantissa) * unit / exposure) as f32;
    [channel(r, exposure[0]), channel(g, exposure[1]), channel(b, exposure[2])]
}

struct Header {
    /// The product of all EXPOSURE and COLORCORR lines, per channel.
    exposure: [f64; 3],
    /// Number of scanlines, and of pixels in one.
    size: [usize; 2],
    /// Whether scanlines are columns.
    transposed: bool,
    /// Whether the scanlines, and the pixels in one, run against the image's rows and columns.
    reversed: [bool; 2],
    metadata: Vec<(String, String)>,
    primaries: Option<Primaries>,
}

impl Header {
    /// The header, and the bytes after it.
    fn parse(bytes: &[u8]) -> Result<(Self, &[u8])> {
        let mut rest = bytes;
        let mut next_line = || -> Result<String> {
            let end = rest.iter().position(|&byte| byte == b'\n').ok_or_else(|| {
                Error::invalid("a Radiance header that does not end", "the file is damaged; copy or download it again")
            })?;
            let (line, after) = rest.split_at(end);
            rest = &after[1..];
            Ok(String::from_utf8_lossy(line).trim_end_matches('\r').to_owned())
        };
        let signature = next_line()?;
        if !signature.as_bytes().starts_with(MAGIC) {
            return Err(Error::invalid("no `#?RADIANCE` at the beginning", "give a Radiance HDR file"));
        }
        let (mut exposure, mut metadata, mut primaries) = ([1.0; 3], Vec::new(), None);
        loop {
            let line = next_line()?;
            if line.is_empty() {
                break;
            }
            let Some((key, value)) = line.split_once('=').filter(|_| !line.starts_with('#')) else {
                continue; // a comment, or the command that made the picture
            };
            let (key, value) = (key.trim(), value.trim());
            match key {
                "FORMAT" => check_format(value)?,
                "PRIMARIES" => primaries = parse_primaries(value)?,
                "EXPOSURE" => multiply(&mut exposure, key, value, [value; 3])?,
                "COLORCORR" => {
                    let parts: Vec<&str> = value.split_whitespace().collect();
                    let &[r, g, b] = &parts[..] else {
                        return Err(bad_factor(key, value));
                    };
                    multiply(&mut exposure, key, value, [r, g, b])?;
                }
                _ => {}
            }
            metadata.push((key.to_owned(), value.to_owned()));
        }
        let (size, transposed, reversed) = parse_resolution(&next_line()?)?;
        Ok((Self { exposure, size, transposed, reversed, metadata, primaries }, rest))
    }

    fn check_size(&self, n_bytes: usize) -> Result<()> {
        let [scanlines, length] = self.size.map(|n| n as u64);
        let pixels = scanlines.checked_mul(length);
        if pixels.is_none_or(|pixels| pixels > (n_bytes as u64).saturating_mul(MAX_PIXELS_PER_BYTE)) {
            return Err(Error::invalid(
                format!("{scanlines} scanlines of {length} pixels in {n_bytes} bytes, which cannot hold them"),
                "the file is damaged; copy or download it again",
            ));
        }
        // As pixels, and once more turned upright.
        let room = u128::from(scanlines) * u128::from(length) * 24;
        memory::check_room(room, &format!("a Radiance HDR of {length} × {scanlines} pixels"))
    }

    /// The image whose scanlines are `rows`, row 0 at the top.
    fn upright(self, rows: Vec<[f32; 3]>) -> Image {
        let [n_scanlines, length] = self.size;
        let (width, height) = if self.transposed { (n_scanlines, length) } else { (length, n_scanlines) };
        let flip = |i: usize, n: usize, reversed: bool| if reversed { n - 1 - i } else { i };
        let texels = if !self.transposed && self.reversed == [false; 2] {
            rows.into_flattened()
        } else {
            let mut texels = Vec::with_capacity(3 * rows.len());
            for y in 0..height {
                for x in 0..width {
                    let (scanline, position) = if self.transposed { (x, y) } else { (y, x) };
                    let scanline = flip(scanline, n_scanlines, self.reversed[0]);
                    let position = flip(position, length, self.reversed[1]);
                    texels.extend(rows[scanline * length + position]);
                }
            }
            texels
        };
        let channels = ["R", "G", "B"].map(str::to_owned).to_vec();
        Image { width, height, channels, texels, metadata: self.metadata, primaries: self.primaries }
    }
}

/// The last of several lines counts: each program that converts colours adds its own.
fn parse_primaries(value: &str) -> Result<Option<Primaries>> {
    let numbers: Vec<f64> = value.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let &[rx, ry, gx, gy, bx, by, wx, wy] = &numbers[..] else {
        return Err(Error::invalid(
            format!("header line `PRIMARIES={}`, where eight numbers are wanted", value.escape_debug()),
            "correct the line or delete it, which means Rec. 709",
        ));
    };
    Primaries::stated([[rx, ry], [gx, gy], [bx, by], [wx, wy]])
}

fn check_format(value: &str) -> Result<()> {
    match value {
        "32-bit_rle_rgbe" => Ok(()),
        "32-bit_rle_xyze" => Err(Error::unsupported(
            "XYZE colour (FORMAT=32-bit_rle_xyze), where RGBE is wanted",
            "convert it with Radiance's `ra_xyze -r`",
        )),
        _ => Err(Error::unsupported(
            format!("Radiance pixel format `{value}`, where 32-bit_rle_rgbe is wanted"),
            "save the picture again as Radiance HDR, or as EXR",
        )),
    }
}

/// Multiplies `exposure` by the numbers out of the line `key=value`.
fn multiply(exposure: &mut [f64; 3], key: &str, value: &str, factors: [&str; 3]) -> Result<()> {
    // Wide enough for any camera; keeps the quotient by it inside f64.
    const RANGE: std::ops::RangeInclusive<f64> = 1e-30..=1e30;
    for (total, text) in exposure.iter_mut().zip(factors) {
        let factor: f64 = text.parse().map_err(|_| bad_factor(key, value))?;
        *total *= factor;
        if !(factor > 0.0 && RANGE.contains(total)) {
            return Err(bad_factor(key, value));
        }
    }
    Ok(())
}

fn bad_factor(key: &str, value: &str) -> Error {
    Error::invalid(
        format!("header line `{key}={value}`, where {key} is one positive number, or three for COLORCORR"),
        "correct or delete the line; pixels are divided by it",
    )
}

/// Numbers of scanlines and of pixels in one, whether scanlines are columns, and which of the two run backwards.
fn parse_resolution(line: &str) -> Result<([usize; 2], bool, [bool; 2])> {
    let bad = || {
        Error::invalid(
            format!("resolution line `{}`, where `-Y height +X width` or alike is wanted", line.escape_debug()),
            "the file is damaged; copy or download it again",
        )
    };
    let words: Vec<&str> = line.split_whitespace().collect();
    let &[axis0, count0, axis1, count1] = &words[..] else {
        return Err(bad());
    };
    // -Y runs downwards and +X to the right, as the image does.
    let (transposed, reversed) = match (axis0, axis1) {
        ("-Y" | "+Y", "+X" | "-X") => (false, [axis0 == "+Y", axis1 == "-X"]),
        ("+X" | "-X", "-Y" | "+Y") => (true, [axis0 == "-X", axis1 == "+Y"]),
        _ => return Err(bad()),
    };
    let count = |text: &str| text.parse::<u32>().ok().filter(|&n| n > 0).map(|n| n as usize).ok_or_else(bad);
    Ok(([count(count0)?, count(count1)?], transposed, reversed))
}

/// The undecoded rest of the file.
struct Bytes<'a> {
    rest: &'a [u8],
}

impl<'a> Bytes<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], &'static str> {
        let (taken, rest) = self.rest.split_at_checked(n).ok_or("is cut off by the end of the file")?;
        self.rest = rest;
        Ok(taken)
    }

    fn pixel(&mut self) -> Result<[u8; 4], &'static str> {
        let bytes = self.take(4)?;
        Ok([bytes[0], bytes[1], bytes[2], bytes[3]])
    }
}

fn read_scanline(bytes: &mut Bytes<'_>, row: &mut [[u8; 4]]) -> Result<(), &'static str> {
    let first = bytes.pixel()?;
    let [a, b, high, low] = first;
    let run_lengths = a == 2 && b == 2 && high < 128 && RUN_LENGTH_WIDTHS.contains(&row.len());
    if !run_lengths {
        return read_flat(first, bytes, row);
    }
    if (usize::from(high) << 8 | usize::from(low)) != row.len() {
        return Err("states another length than the header");
    }
    for channel in 0..4 {
        read_run_lengths(bytes, row, channel)?;
    }
    Ok(())
}

/// One component of a row: counts above 128 repeat the next byte, others copy so many bytes.
fn read_run_lengths(bytes: &mut Bytes<'_>, row: &mut [[u8; 4]], channel: usize) -> Result<(), &'static str> {
    const TOO_LONG: &str = "runs past its end";
    let mut x = 0;
    while x < row.len() {
        let count = usize::from(bytes.take(1)?[0]);
        if count > 128 {
            let value = bytes.take(1)?[0];
            let run = row.get_mut(x..x + count - 128).ok_or(TOO_LONG)?;
            run.iter_mut().for_each(|pixel| pixel[channel] = value);
            x += count - 128;
        } else {
            let values = bytes.take(count)?;
            let literal = row.get_mut(x..x + count).ok_or(TOO_LONG)?;
            literal.iter_mut().zip(values).for_each(|(pixel, &value)| pixel[channel] = value);
            x += count;
        }
    }
    Ok(())
}

/// Whole pixels; (1, 1, 1, n) repeats the one before n times, and the next such at once 256 n times, and so on.
fn read_flat(first: [u8; 4], bytes: &mut Bytes<'_>, row: &mut [[u8; 4]]) -> Result<(), &'static str> {
    let (mut x, mut shift, mut pixel) = (0_usize, 0, first);
    let mut previous = None;
    loop {
        if pixel[..3] == [1, 1, 1] {
            let repeated = previous.ok_or("begins with a run of nothing")?;
            // At most three bytes of count are of use: a row has less than 2³² pixels, and runs must end inside it.
            let count = usize::from(pixel[3]).checked_shl(shift).filter(|_| shift <= 24);
            let run = count.and_then(|count| row.get_mut(x..x.checked_add(count)?)).ok_or("runs past its end")?;
            run.fill(repeated);
            x += run.len();
            shift += 8;
        } else {
            row[x] = pixel;
            (x, shift, previous) = (x + 1, 0, Some(pixel));
        }
        if x == row.len() {
            return Ok(());
        }
        pixel = bytes.pixel()?;
    }
}
