//! NumPy arrays (`.npy`) of format 1.0.
//!
//! - **Written**: little-endian `<f4` or `<f2`, C order; axes array layers, faces, slices (where there are such), rows, columns, channels (where there
//!   is more than one). The format has no place for metadata.
//! - **Read**: numbers of every kind but complex ones, of both byte orders, in C or Fortran order, format 1 to 3.
//!
//! **Source**: NumPy, *NEP 1: A Simple File Format for NumPy Arrays*.

use super::{Array, Texture};
use crate::error::{Error, Result};
use crate::pack::Number;

/// What every file begins with.
pub const MAGIC: &[u8; 6] = b"\x93NUMPY";

const DAMAGED: &str = "the file is damaged; copy or download it again";
/// The header is padded to a multiple of this.
const ALIGNMENT: usize = 64;

/// The file that holds `texture`, one level of f16 or f32.
///
/// **Errors**: another texel format; mips.
pub fn encode(texture: &Texture) -> Result<Vec<u8>> {
    texture.check()?;
    let descr = match texture.format.number() {
        Some(Number::F16) => "<f2",
        Some(Number::F32) => "<f4",
        _ => return Err(Error::usage(format!("a NumPy array cannot hold {}", texture.format), "use f16 or f32")),
    };
    let mut shape = shape(texture)?;
    // Columns of a volume, which nobody can tell from channels, are followed by them even where there is one.
    if shape.len() == 3 && texture.format.channels() == 1 {
        shape.push(1);
    }
    let lengths: Vec<String> = shape.iter().map(|n| format!("{n},")).collect();
    let dictionary = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}), }}", lengths.join(" "));
    // Magic, version and length take ten bytes, the line feed one.
    let length = (10 + dictionary.len() + 1).next_multiple_of(ALIGNMENT) - 10;
    let mut file = [&MAGIC[..], &[1, 0], &(length as u16).to_le_bytes(), dictionary.as_bytes()].concat();
    file.resize(10 + length - 1, b' ');
    file.push(b'\n');
    file.extend_from_slice(&texture.levels[0]);
    Ok(file)
}

/// The lengths of the axes, last fastest: array layers, faces and slices where there are such, rows, columns, channels if there are several.
///
/// **Errors**: mips.
pub(super) fn shape(texture: &Texture) -> Result<Vec<usize>> {
    if texture.levels.len() > 1 {
        return Err(Error::unsupported(
            format!("{} and {} levels in an array, which has one", texture.text(), texture.levels.len()),
            "use ktx2, ktx1 or dds",
        ));
    }
    let Texture { array_layers, faces, depth, height, width, .. } = *texture;
    let channels = texture.format.channels();
    let outer = [(array_layers > 0, array_layers), (faces > 1, faces), (depth > 0, depth)];
    let all = outer.into_iter().chain([(true, height), (true, width), (channels > 1, channels)]);
    Ok(all.filter(|(there, _)| *there).map(|(_, n)| n).collect())
}

/// The array in `bytes`.
///
/// **Errors**: a header that is not NumPy's; complex numbers, text and objects; truncated data.
pub fn decode(bytes: &[u8]) -> Result<Array> {
    let broken = |what: &str| Error::invalid(format!("the NumPy array {what}"), DAMAGED);
    let version = *bytes.get(6).filter(|_| bytes.starts_with(MAGIC)).ok_or_else(|| broken("has no beginning"))?;
    let (at, length): (usize, Option<usize>) = match version {
        1 => (10, bytes.get(8..10).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]])))),
        2 | 3 => (12, bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize)),
        _ => return Err(Error::unsupported(format!("NumPy's format {version}"), "save it again with numpy.save")),
    };
    let length = length.ok_or_else(|| broken("ends within its header"))?;
    let header = at.checked_add(length).and_then(|end| bytes.get(at..end));
    let header = header.ok_or_else(|| broken("ends within its header"))?;
    let header = std::str::from_utf8(header).map_err(|_| broken("has a header that is no text"))?;
    let kind = Kind::of(&quoted(header, "descr").ok_or_else(|| broken("does not say what its numbers are"))?)?;
    let is_fortran = value(header, "fortran_order").is_some_and(|v| v.starts_with("True"));
    let shape = lengths(header).ok_or_else(|| broken("does not say its shape"))?;
    let count = shape.iter().try_fold(1_usize, |n, &length| n.checked_mul(length));
    let data = &bytes[at + length..];
    if count.and_then(|n| n.checked_mul(kind.size)) != Some(data.len()) {
        return Err(broken(&format!("of shape {shape:?} has {} bytes of numbers", data.len())));
    }
    let values: Vec<f64> = data.chunks_exact(kind.size).map(|number| kind.value(number)).collect();
    let values = if is_fortran { transposed(&values, &shape) } else { values };
    Ok(Array { shape, values, number: kind.number(), channels: vec![], metadata: vec![] })
}

/// What stands behind `'key':` in the header.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let quotes = [format!("'{key}'"), format!("\"{key}\"")];
    let rest = quotes.iter().find_map(|quoted| header.split_once(quoted.as_str()))?.1;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

fn quoted(header: &str, key: &str) -> Option<String> {
    let rest = value(header, key)?;
    let quote = rest.chars().next().filter(|c| ['\'', '"'].contains(c))?;
    Some(rest[1..].split_once(quote)?.0.to_owned())
}

fn lengths(header: &str) -> Option<Vec<usize>> {
    let (inside, _) = value(header, "shape")?.strip_prefix('(')?.split_once(')')?;
    inside.split(',').map(str::trim).filter(|part| !part.is_empty()).map(|part| part.parse().ok()).collect()
}

/// How a number is stored.
struct Kind {
    letter: char,
    size: usize,
    big_endian: bool,
}

impl Kind {
    fn of(descr: &str) -> Result<Self> {
        let unsupported = || {
            Error::unsupported(
                format!("a NumPy array of `{}`, where numbers are wanted", descr.escape_debug()),
                "save it again as float32: numpy.save(path, array.astype('<f4'))",
            )
        };
        let mut letters = descr.chars();
        let order = letters.next().filter(|c| ['<', '>', '|', '='].contains(c)).ok_or_else(unsupported)?;
        let letter = letters.next().ok_or_else(unsupported)?;
        let size = letters.as_str().parse().map_err(|_| unsupported())?;
        match (letter, size) {
            ('f', 2 | 4 | 8) | ('u' | 'i', 1 | 2 | 4 | 8) => Ok(Self { letter, size, big_endian: order == '>' }),
            _ => Err(unsupported()),
        }
    }

    fn value(&self, number: &[u8]) -> f64 {
        let mut bytes = [0_u8; 8];
        bytes[..self.size].copy_from_slice(number);
        if self.big_endian {
            bytes[..self.size].reverse();
        }
        let whole = u64::from_le_bytes(bytes);
        match (self.letter, self.size) {
            ('f', 2) => half::f16::from_bits(whole as u16).to_f64(),
            ('f', 4) => f64::from(f32::from_bits(whole as u32)),
            ('f', _) => f64::from_bits(whole),
            ('i', size) => {
                let shift = 64 - 8 * size as u32;
                (((whole << shift) as i64) >> shift) as f64
            }
            _ => whole as f64,
        }
    }

    fn number(&self) -> Option<Number> {
        match (self.letter, self.size) {
            ('f', 2) => Some(Number::F16),
            ('f', 4) => Some(Number::F32),
            _ => None,
        }
    }
}

/// Values with the first axis fastest, brought into the order with the last axis fastest.
fn transposed(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut strides = vec![1; shape.len()];
    for axis in 1..shape.len() {
        strides[axis] = strides[axis - 1] * shape[axis - 1];
    }
    let source = |mut index: usize| {
        let mut at = 0;
        for axis in (0..shape.len()).rev() {
            at += index % shape[axis] * strides[axis];
            index /= shape[axis];
        }
        at
    };
    (0..values.len()).map(|index| values[source(index)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        for (name, number) in [("rg16f", Number::F16), ("rg32f", Number::F32)] {
            let values: Vec<f64> = (0..24).map(|i| f64::from(i) / 8.0).collect();
            let (texture, _) = Texture::volume(name.parse().unwrap(), [3, 2, 2], &values).unwrap();
            let file = encode(&texture).unwrap();
            assert_eq!((file.len() - 24 * number.bytes()) % 64, 0);
            let back = decode(&file).unwrap();
            assert_eq!((back.shape, back.values, back.number), (vec![2, 2, 3, 2], values, Some(number)));
        }
    }

    fn array(dictionary: &str, data: &[u8]) -> Vec<u8> {
        [&MAGIC[..], &[1, 0], &(dictionary.len() as u16).to_le_bytes(), dictionary.as_bytes(), data].concat()
    }

    #[test]
    fn other_numbers_and_orders_are_read() {
        let fortran = array(
            "{'descr': '>i2', 'fortran_order': True, 'shape': (2, 3), }\n",
            &[0, 1, 0, 2, 0, 3, 0, 4, 0, 5, 255, 250],
        );
        assert_eq!(decode(&fortran).unwrap().values, [1.0, 3.0, 5.0, 2.0, 4.0, -6.0]);
        let bytes = array("{'descr': '|u1', 'fortran_order': False, 'shape': (3,), }", &[0, 128, 255]);
        assert_eq!(decode(&bytes).unwrap().values, [0.0, 128.0, 255.0]);
        let double = array("{'descr': '<f8', 'fortran_order': False, 'shape': (), }", &1.5_f64.to_le_bytes());
        assert_eq!(decode(&double).unwrap().values, [1.5]);
    }

    #[test]
    fn broken_arrays_are_refused() {
        for (dictionary, fault) in [
            ("{'descr': '<c8', 'fortran_order': False, 'shape': (1,), }", "`<c8`"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (2,), }", "[2] has 4 bytes"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (18446744073709551615, 2), }", "has 4 bytes"),
            ("{'descr': '<f4'}", "shape"),
            ("{}", "what its numbers are"),
        ] {
            let message = decode(&array(dictionary, &[0; 4])).unwrap_err().to_string();
            assert!(message.contains(fault) && message.contains("; "), "{dictionary}: {message}");
        }
    }
}
