//! Babylon.js' environments (`.env`), version 2: a cube with all its mips down to 1², the irradiance as a polynomial, and PNG pictures in RGBD.
//!
//! - **Written**: JSON, a NUL, then the faces of each level as PNG, bottom row first, as the engine uploads them. The metadata
//!   [`POLYNOMIAL_KEY`] and [`LOD_SCALE_KEY`] become the fields that the engine reads; other pairs stand under `kiln`, which it does not.
//! - **Polynomial**: E/π = x·X + y·Y + z·Z + xx·X² + … + xy·X·Y, three numbers each: a white furnace is xx = yy = zz = 1.
//! - **Read**: versions 1 and 2 with PNG pictures; those of WebP are refused.
//!
//! **Source**: Babylon.js, `environmentTextureTools`, of which the two versions of the JSON; the row order and what the polynomial holds were found
//! by loading files in the engine.

use super::{Texture, ascii_json, png};
use crate::error::{Error, Result};
use crate::pack::TexelFormat;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// What every file begins with.
pub const MAGIC: [u8; 8] = [0x86, 0x16, 0x87, 0x96, 0xf6, 0xd6, 0x96, 0x36];

/// The metadata key of the polynomial: JSON of `x`, `y`, `z`, `xx`, `yy`, `zz`, `yz`, `zx` and `xy`, three numbers each.
pub const POLYNOMIAL_KEY: &str = "sphericalPolynomial";
/// The metadata key of the factor between log2(width · alpha) and the level.
pub const LOD_SCALE_KEY: &str = "lodGenerationScale";
/// That factor where nothing says otherwise, as in the engine.
pub const LOD_SCALE: f64 = 0.8;

const DAMAGED: &str = "the file is damaged; copy or download it again";
const PNG: &str = "image/png";
/// The names of the polynomial's terms.
const TERMS: [&str; 9] = ["x", "y", "z", "xx", "yy", "zz", "yz", "zx", "xy"];

#[derive(Serialize, Deserialize)]
struct Info {
    version: u32,
    width: usize,
    #[serde(rename = "imageType", default)]
    image_type: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    irradiance: Option<Map<String, Value>>,
    specular: Specular,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    kiln: BTreeMap<String, String>,
}

#[derive(Serialize, Deserialize)]
struct Specular {
    mipmaps: Vec<Place>,
    #[serde(rename = "lodGenerationScale", default = "lod_scale")]
    lod_scale: f64,
}

#[derive(Serialize, Deserialize)]
struct Place {
    length: usize,
    position: usize,
}

fn lod_scale() -> f64 {
    LOD_SCALE
}

/// A polynomial as the text of [`POLYNOMIAL_KEY`]: coefficients of x, y, z, xx, yy, zz, yz, zx and xy.
pub fn polynomial_json(coefficients: &[[f64; 3]; 9]) -> String {
    let terms: Map<String, Value> =
        TERMS.iter().zip(coefficients).map(|(&name, rgb)| (name.to_owned(), rgb.to_vec().into())).collect();
    Value::Object(terms).to_string()
}

/// The file that holds `texture`, a cube in RGBD with all its levels.
///
/// **Errors**: another texel format; no cube; levels that do not go down to 1²; a polynomial that is none.
pub fn encode(texture: &Texture) -> Result<Vec<u8>> {
    texture.check()?;
    if texture.format != TexelFormat::Rgbd || texture.faces != 6 || texture.array_layers > 0 {
        return Err(Error::usage(
            format!("{} of {} in a Babylon.js environment", texture.text(), texture.format),
            "give a cube packed as rgbd",
        ));
    }
    let wanted = texture.width.ilog2() as usize + 1;
    if texture.levels.len() != wanted || !texture.width.is_power_of_two() {
        return Err(Error::usage(
            format!("a cube of {}² with {} levels, which Babylon.js refuses", texture.width, texture.levels.len()),
            format!("bake a power of two with {wanted} levels, down to 1²: --min-size 1"),
        ));
    }
    let pictures = (0..texture.levels.len())
        .flat_map(|level| (0..6).map(move |face| (level, face)))
        .map(|(level, face)| picture(texture, level, face))
        .collect::<Result<Vec<_>>>()?;
    let mut mipmaps = vec![];
    for picture in &pictures {
        let position = mipmaps.last().map_or(0, |p: &Place| p.position + p.length);
        mipmaps.push(Place { length: picture.len(), position });
    }
    let lod_scale = texture.metadata(LOD_SCALE_KEY).map_or(Ok(LOD_SCALE), |text| {
        text.parse().map_err(|_| Error::usage(format!("`{LOD_SCALE_KEY}` of {text:?}"), "give a number such as 0.8"))
    })?;
    let own = [POLYNOMIAL_KEY, LOD_SCALE_KEY];
    let info = Info {
        version: 2,
        width: texture.width,
        image_type: Some(PNG.to_owned()),
        irradiance: texture.metadata(POLYNOMIAL_KEY).map(polynomial).transpose()?,
        specular: Specular { mipmaps, lod_scale },
        kiln: texture.metadata.iter().filter(|(key, _)| !own.contains(&key.as_str())).cloned().collect(),
    };
    let json = serde_json::to_string(&info).map_err(|e| {
        Error::unsupported(format!("an environment that JSON cannot hold: {e}"), "report this as a bug")
    })?;
    Ok([&MAGIC[..], ascii_json(&json).as_bytes(), &[0], &pictures.concat()].concat())
}

/// The terms of a polynomial.
fn polynomial(text: &str) -> Result<Map<String, Value>> {
    let terms: Option<Map<String, Value>> = serde_json::from_str(text).ok();
    let is_term =
        |value: &Value| value.as_array().is_some_and(|rgb| rgb.len() == 3 && rgb.iter().all(Value::is_number));
    let whole = terms.filter(|terms| TERMS.iter().all(|&name| terms.get(name).is_some_and(is_term)));
    whole.ok_or_else(|| {
        Error::usage(
            format!("`{POLYNOMIAL_KEY}` that is no polynomial"),
            format!("give JSON with three numbers for each of {}", TERMS.join(", ")),
        )
    })
}

fn picture(texture: &Texture, level: usize, face: usize) -> Result<Vec<u8>> {
    let [size, _] = texture.level_size(level);
    let bytes = texture.picture(level, face).unwrap_or_default();
    let flipped: Vec<u8> = bytes.chunks_exact(4 * size).rev().flatten().copied().collect();
    png::encode_codes(size, &flipped)
}

/// The cube in `bytes`.
///
/// **Errors**: another version, WebP pictures; truncated or contradictory data.
pub fn decode(bytes: &[u8]) -> Result<Texture> {
    let broken = |what: String| Error::invalid(format!("the Babylon.js environment {what}"), DAMAGED);
    let rest = bytes.strip_prefix(&MAGIC).ok_or_else(|| broken("has no beginning".to_owned()))?;
    let end = rest.iter().position(|&b| b == 0).ok_or_else(|| broken("ends within its JSON".to_owned()))?;
    let info: Info = serde_json::from_slice(&rest[..end]).map_err(|e| broken(format!("has broken JSON: {e}")))?;
    if !(1..=2).contains(&info.version) {
        return Err(Error::unsupported(
            format!("version {} of Babylon.js' environment", info.version),
            "save it as version 2",
        ));
    }
    if info.image_type.as_deref().is_some_and(|kind| kind != PNG) {
        let kind = info.image_type.unwrap_or_default();
        return Err(Error::unsupported(
            format!("an environment with pictures of {}", kind.escape_debug()),
            "save it with image/png",
        ));
    }
    let n_levels = info.specular.mipmaps.len() / 6;
    let is_size = info.width.is_power_of_two() && info.width <= 1 << 16;
    if !is_size
        || n_levels == 0
        || n_levels > info.width.ilog2() as usize + 1
        || !info.specular.mipmaps.len().is_multiple_of(6)
    {
        return Err(broken(format!("has {} pictures for a cube of {}²", info.specular.mipmaps.len(), info.width)));
    }
    let mut texture = Texture::empty_cube(TexelFormat::Rgbd, info.width);
    for (level, places) in info.specular.mipmaps.chunks_exact(6).enumerate() {
        let [size, _] = texture.level_size(level);
        let mut faces = vec![];
        for place in places {
            let start = end.checked_add(1).and_then(|at| at.checked_add(place.position));
            let picture = start.and_then(|start| rest.get(start..start.checked_add(place.length)?));
            let picture = picture.ok_or_else(|| broken(format!("ends within level {level}")))?;
            let codes = png::decode_codes(size, picture)?;
            faces.extend(codes.chunks_exact(4 * size).rev().flatten());
        }
        texture.levels.push(faces);
    }
    texture.metadata = info.kiln.into_iter().collect();
    if let Some(terms) = info.irradiance {
        texture.metadata.push((POLYNOMIAL_KEY.to_owned(), Value::Object(terms).to_string()));
    }
    texture.metadata.push((LOD_SCALE_KEY.to_owned(), info.specular.lod_scale.to_string()));
    Ok(texture)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white() -> Texture {
        let mut texture = Texture::empty_cube(TexelFormat::Rgbd, 4);
        for size in [4_usize, 2, 1] {
            let values: Vec<f64> = (0..6 * size * size * 3).map(|i| (i % 11) as f64).collect();
            texture.push_level(&values).unwrap();
        }
        let mut furnace = [[0.0; 3]; 9];
        furnace[3..6].fill([1.0; 3]);
        texture.metadata = vec![
            ("kiln.certificate".into(), "{\"µ\":1}".into()),
            (POLYNOMIAL_KEY.into(), polynomial_json(&furnace)),
            (LOD_SCALE_KEY.into(), "0.8".into()),
        ];
        texture
    }

    #[test]
    fn what_is_written_is_read_again() {
        let texture = white();
        let file = encode(&texture).unwrap();
        assert!(file[..file.iter().position(|&b| b == 0).unwrap()][8..].is_ascii());
        assert_eq!(decode(&file).unwrap(), texture);
    }

    #[test]
    fn faces_stand_on_their_heads() {
        let mut texture = white();
        texture.levels[0][..16].fill(7); // the top row of +X
        let file = encode(&texture).unwrap();
        let start = file.iter().position(|&b| b == 0).unwrap() + 1;
        let first = png::decode_codes(4, &file[start..]).unwrap();
        assert_eq!(first[3 * 16..], [7; 16]);
    }

    #[test]
    fn what_the_engine_refuses_is_refused() {
        let mut short = white();
        short.levels.pop();
        assert!(encode(&short).unwrap_err().to_string().contains("which Babylon.js refuses; bake"));
        let mut other = white();
        other.metadata[1].1 = "{\"x\":[1]}".into();
        assert!(encode(&other).unwrap_err().to_string().contains("three numbers for each of x, y"));
    }
}
