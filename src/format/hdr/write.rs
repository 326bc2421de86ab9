//! Writing Radiance HDR; what is written stands at the head of the parent module.

use super::{Error, RUN_LENGTH_WIDTHS, Result};
use crate::colour::Primaries;
use crate::format::Texture;
use crate::pack::TexelFormat;
use std::fmt::Write;

/// Header lines longer than this are left out: readers have buffers of 128 bytes and more.
const LONGEST_LINE: usize = 100;
/// Shorter repetitions take no less room as a run.
const SHORTEST_RUN: usize = 4;

/// The file that holds `texture`, a picture in RGBE.
///
/// **Errors**: another texel format, mips, faces or slices.
pub fn encode(texture: &Texture) -> Result<Vec<u8>> {
    texture.check_is_picture("hdr")?;
    if texture.format != TexelFormat::Rgbe {
        return Err(Error::usage(format!("Radiance HDR cannot hold {}", texture.format), "pack it as rgbe"));
    }
    let mut file = header(texture).into_bytes();
    for row in texture.levels[0].chunks_exact(4 * texture.width) {
        if RUN_LENGTH_WIDTHS.contains(&texture.width) {
            let width = texture.width as u16; // below 2¹⁵
            file.extend([2, 2, (width >> 8) as u8, width as u8]);
            for channel in 0..4 {
                let values: Vec<u8> = row.iter().copied().skip(channel).step_by(4).collect();
                run_lengths(&values, &mut file);
            }
        } else {
            file.extend_from_slice(row);
        }
    }
    Ok(file)
}

fn header(texture: &Texture) -> String {
    let mut head = format!("#?RADIANCE\n# kiln {}\nFORMAT=32-bit_rle_rgbe\n", env!("CARGO_PKG_VERSION"));
    if texture.primaries != Primaries::REC709 {
        let numbers: Vec<String> =
            texture.primaries.chromaticities().as_flattened().iter().map(f64::to_string).collect();
        let _ = writeln!(head, "PRIMARIES={}", numbers.join(" ")); // a String takes everything
    }
    for (key, value) in &texture.metadata {
        let line = format!("{key}={value}");
        // These change what the pixels mean.
        let is_ours = ["FORMAT", "PRIMARIES", "EXPOSURE", "COLORCORR"].contains(&key.as_str());
        if !is_ours && line.len() <= LONGEST_LINE && !line.contains(['\n', '\r', '\0']) && !line.starts_with('#') {
            head += &line;
            head.push('\n');
        }
    }
    let _ = write!(head, "\n-Y {} +X {}\n", texture.height, texture.width);
    head
}

/// One component of a row: counts above 128 repeat the next byte, others copy so many bytes.
fn run_lengths(values: &[u8], file: &mut Vec<u8>) {
    let run_at = |at: usize| values[at..].iter().take(127).take_while(|&&v| v == values[at]).count();
    let mut at = 0;
    while at < values.len() {
        let run = run_at(at);
        if run >= SHORTEST_RUN {
            file.extend([128 + run as u8, values[at]]);
            at += run;
            continue;
        }
        let start = at;
        while at < values.len() && at - start < 128 && run_at(at) < SHORTEST_RUN {
            at += 1;
        }
        file.push((at - start) as u8);
        file.extend_from_slice(&values[start..at]);
    }
}
