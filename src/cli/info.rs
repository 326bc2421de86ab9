//! `kiln info`: what a file is.

use super::adjustment::UnitArgs;
use super::console::{Console, columns, printable};
use clap::Args;
use kiln::bake::SunFile;
use kiln::certificate::{self, Certificate, Level};
use kiln::environment::{Negatives, NonFinite, Panorama, Photometry, Unit, extract_sun};
use kiln::format::{Array, Decoded, FileKind, Image, Texture};
use kiln::pack::PackReport;
use kiln::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Say what a file is: size, format, values, and where it came from
#[derive(Debug, Args)]
pub struct Info {
    /// Any file that Kiln reads: .exr, .hdr, .ktx2, .ktx, .dds, .png, .env, .npy, source code that it wrote, or .raw beside its certificate
    #[arg(required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    unit: UnitArgs,
}

/// The primaries that go without saying.
const REC709: &str = "Rec. 709";

/// What is known of a file.
#[derive(Serialize)]
struct Facts {
    file: PathBuf,
    kind: String,
    width: usize,
    height: usize,
    depth: usize,
    layers: usize,
    faces: usize,
    levels: usize,
    channels: Vec<Range>,
    #[serde(skip_serializing_if = "Option::is_none")]
    primaries: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    panorama: Option<PanoramaFacts>,
    metadata: Vec<(String, String)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    certificate: Option<Certificate>,
    /// Of the layers of an array.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    layer_certificates: Vec<Certificate>,
}

/// Values of one channel of level 0.
#[derive(Serialize)]
struct Range {
    channel: String,
    min: f64,
    max: f64,
    mean: f64,
    nonfinite: u64,
    negative: u64,
}

/// What a lighting artist asks of a panorama.
#[derive(Serialize)]
struct PanoramaFacts {
    #[serde(flatten)]
    light: Photometry,
    #[serde(skip_serializing_if = "Option::is_none")]
    sun: Option<SunFile>,
}

impl Info {
    pub fn run(&self, console: &Console) -> Result<()> {
        let facts: Vec<Facts> =
            self.files.iter().map(|f| facts(f, self.unit.unit()).map_err(|e| e.in_file(f))).collect::<Result<_>>()?;
        if console.json {
            return console.print_json(&facts);
        }
        for facts in &facts {
            console.print(&text(facts))?;
        }
        Ok(())
    }
}

fn facts(path: &Path, unit: Unit) -> Result<Facts> {
    let bytes = std::fs::read(path).map_err(|e| Error::reading(path, e))?;
    let kind = match FileKind::of(&bytes) {
        FileKind::Other(_) => "bare texels of",
        known => known.name(),
    };
    let mut facts = match certificate::decode(path, &bytes)? {
        Decoded::Picture(image, _) => of_image(path, kind, image, unit),
        Decoded::Texture(texture) => of_texture(path, kind, texture),
        Decoded::Array(array) => of_array(path, kind, array),
    };
    let text = facts.metadata.iter().position(|(key, _)| key == certificate::KEY).map(|i| facts.metadata.remove(i).1);
    let layers = facts.metadata.iter().position(|(key, _)| key == certificate::LAYERS_KEY);
    if let Some(text) = layers.map(|i| facts.metadata.remove(i).1) {
        facts.layer_certificates = Certificate::list_from_json(&text)?;
    }
    facts.certificate = text.map(|t| Certificate::from_json(&t)).transpose()?;
    Ok(facts)
}

fn of_image(path: &Path, kind: &str, image: Image, unit: Unit) -> Facts {
    let n = image.channels.len();
    let channels = ranges(&image.channels, &image.texels, n);
    Facts {
        file: path.to_owned(),
        kind: kind.to_owned(),
        width: image.width,
        height: image.height,
        depth: 1,
        layers: 1,
        faces: 1,
        levels: 1,
        channels,
        primaries: image.primaries.map(|p| p.to_string()),
        // Only what looks like a panorama has these facts; a table has not.
        panorama: (image.width == 2 * image.height)
            .then(|| Panorama::from_image(&image, NonFinite::Zero, Negatives::Keep).ok())
            .flatten()
            .map(|(p, _)| of_panorama(&p, unit)),
        metadata: image.metadata,
        certificate: None,
        layer_certificates: vec![],
    }
}

fn of_panorama(panorama: &Panorama, unit: Unit) -> PanoramaFacts {
    let sun = extract_sun(panorama).map(|(sun, _)| SunFile::new(sun, unit));
    PanoramaFacts { light: Photometry::of(panorama, unit), sun }
}

fn of_texture(path: &Path, kind: &str, texture: Texture) -> Facts {
    let n = texture.format.channels();
    let names = texture.channel_names();
    let values: Vec<f32> = (0..texture.layers(0)).filter_map(|face| texture.face(0, face)).flatten().collect();
    Facts {
        file: path.to_owned(),
        kind: format!("{kind} {}", texture.format),
        width: texture.width,
        height: texture.height,
        depth: texture.depth.max(1),
        layers: texture.array_layers.max(1),
        faces: texture.faces,
        levels: texture.levels.len(),
        channels: ranges(&names, &values, n),
        primaries: Some(texture.primaries.to_string()),
        panorama: None,
        metadata: texture.metadata,
        certificate: None,
        layer_certificates: vec![],
    }
}

fn of_array(path: &Path, kind: &str, array: Array) -> Facts {
    let [width, height, depth, n] = array.extent();
    let name = |c: usize| array.channels.get(c).cloned().unwrap_or_else(|| c.to_string());
    let names: Vec<String> = (0..n).map(name).collect();
    let values: Vec<f32> = array.values.iter().map(|&v| v as f32).collect();
    let number = array.number.map_or_else(String::new, |number| format!(" {number}"));
    Facts {
        file: path.to_owned(),
        kind: format!("{kind}{number}"),
        width,
        height,
        depth,
        layers: 1,
        faces: 1,
        levels: 1,
        channels: ranges(&names, &values, n.max(1)),
        primaries: None,
        panorama: None,
        metadata: array.metadata,
        certificate: None,
        layer_certificates: vec![],
    }
}

fn ranges(names: &[String], values: &[f32], n: usize) -> Vec<Range> {
    let row = |(c, name): (usize, &String)| {
        let all = || values.iter().skip(c).step_by(n).map(|&v| f64::from(v));
        let finite = || all().filter(|v| v.is_finite());
        Range {
            channel: name.clone(),
            min: finite().fold(f64::INFINITY, f64::min),
            max: finite().fold(f64::NEG_INFINITY, f64::max),
            mean: finite().sum::<f64>() / finite().count().max(1) as f64,
            nonfinite: all().filter(|v| !v.is_finite()).count() as u64,
            negative: finite().filter(|&v| v < 0.0).count() as u64,
        }
    };
    names.iter().enumerate().map(row).collect()
}

fn text(facts: &Facts) -> String {
    let mut text = format!("{}: {}, {} × {}", facts.file.display(), facts.kind, facts.width, facts.height);
    if facts.depth > 1 {
        text += &format!(" × {}", facts.depth);
    }
    if facts.layers > 1 {
        text += &format!(", {} layers", facts.layers);
    }
    if facts.faces > 1 {
        text += &format!(", {} faces", facts.faces);
    }
    if facts.levels > 1 {
        text += &format!(", {} levels", facts.levels);
    }
    text += "\n";
    let cells: Vec<Vec<String>> = facts
        .channels
        .iter()
        .map(|r| {
            let number = |v: f64| format!("{v:.6}");
            let counts = [r.nonfinite, r.negative].map(|n| n.to_string());
            [vec![r.channel.clone()], [r.min, r.max, r.mean].map(number).to_vec(), counts.to_vec()].concat()
        })
        .collect();
    text += &columns(&["channel", "min", "max", "mean", "not finite", "negative"], &cells);
    if let Some(primaries) = facts.primaries.as_deref().filter(|&name| name != REC709) {
        text += &format!("primaries: {primaries}\n");
    }
    if let Some(p) = &facts.panorama {
        let light = &p.light;
        let [x, y, z] = light.peak_direction;
        text += &format!(
            "luminance: mean {:.4} cd/m², peak {:.4} towards ({x:.3}, {y:.3}, {z:.3}), range {:.1} EV\n",
            light.mean_luminance, light.peak_luminance, light.dynamic_range_ev
        );
        text += &format!("horizontal illuminance: {:.4} lux\n", light.horizontal_illuminance);
        text += &match &p.sun {
            Some(SunFile { sun, illuminance, .. }) => {
                let [x, y, z] = sun.direction;
                format!(
                    "sun: towards ({x:.4}, {y:.4}, {z:.4}), {:.2}° across ({:.2e} sr), {illuminance:.4} lux facing it, {:.1} % of the \
                     light\n",
                    sun.angular_diameter,
                    sun.solid_angle,
                    100.0 * sun.share
                )
            }
            None => "sun: none stands out\n".to_owned(),
        };
    }
    for (key, value) in &facts.metadata {
        text += &format!("{key}: {value}\n");
    }
    match &facts.certificate {
        Some(c) => {
            text += &format!("certificate: Kiln {}, {} checks, {} failed\n", c.kiln, c.checks.len(), c.failures());
            for channel in &c.channels {
                text += &format!(
                    "  {} = {}, ±{:.1e} ({}, {})\n",
                    channel.quantity,
                    channel.definition,
                    channel.max_error,
                    channel.integrator,
                    channel.error_kind.name()
                );
            }
            for lookup in &c.lookup {
                text += &format!(
                    "  {} through bilinear filtering: ±{:.1e}, RMS {:.1e}\n",
                    lookup.channel, lookup.max, lookup.rms
                );
            }
            for fit in c.fit.iter().filter(|fit| fit.kept) {
                text += &format!(
                    "  {} is fitted to the lookup; exact texels: ±{:.1e}, RMS {:.1e}\n",
                    fit.exact.channel, fit.exact.max, fit.exact.rms
                );
            }
            text += &packed(&c.packing);
            let layout = c.environment.as_ref().map(|recipe| recipe.layout).unwrap_or_default();
            for level in &c.levels {
                text += &format!(
                    "  {} {}, roughness {}: RMS error {:.1e} ({})\n",
                    level.name,
                    layout.size_text(level.size),
                    level.roughness,
                    level.rms_error,
                    level.integrator
                );
                text += &seen(level);
            }
        }
        None if facts.layer_certificates.is_empty() => text += "no certificate\n",
        None => {}
    }
    for (i, c) in facts.layer_certificates.iter().enumerate() {
        let name = c.table.as_ref().map(|table| table.file.as_str()).unwrap_or_default();
        text += &format!("layer {i}, {name}: Kiln {}, {} checks, {} failed\n", c.kiln, c.checks.len(), c.failures());
        for channel in &c.channels {
            text += &format!("  {} = {}, ±{:.1e}\n", channel.quantity, channel.definition, channel.max_error);
        }
    }
    printable(&(text + "\n"))
}

/// What packing changed, if it changed anything.
fn packed(packing: &PackReport) -> String {
    if *packing == PackReport::default() {
        return String::new();
    }
    let PackReport { max_abs_error, overflowed, negative, nonfinite, max_block_error, max_transcoded_error } = packing;
    let mut text = format!(
        "  packing: off by at most {max_abs_error:.1e}; {overflowed} overflowed, {negative} below zero, {nonfinite} not finite"
    );
    if *max_block_error > 0.0 {
        text += &format!("; of a block's brightest value at most {:.2} %", 100.0 * max_block_error);
    }
    if *max_transcoded_error > 0.0 {
        text += &format!(", and {:.2} % where it is transcoded to bc6h", 100.0 * max_transcoded_error);
    }
    text + "\n"
}

/// What a shader sees of a level.
fn seen(level: &Level) -> String {
    let Some(lookup) = &level.lookup else {
        let why =
            if level.roughness == 0.0 { "a picture of boxes" } else { "seen at an angle, or too narrow a kernel" };
        return format!("    through bilinear filtering: not measured ({why})\n");
    };
    let [x, y, z] = lookup.worst_towards;
    let mut text = format!(
        "    through bilinear filtering: RMS {:.1e}, at most {:.1e} towards ({x:.3}, {y:.3}, {z:.3})",
        lookup.rms, lookup.max
    );
    match &level.fit {
        Some(fit) if fit.kept => text += &format!(", fitted; exact texels: RMS {:.1e}", fit.exact.rms),
        Some(_) => text += ", exact texels: fitted ones are no better",
        None => {}
    }
    text + "\n"
}
