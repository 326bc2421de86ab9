//! The whole matrix: every named table and model × size × warp × sampling × flip × order of the axes × kind of file, every pair of choices.
//!
//! `KILN_SWEEP=all cargo test --test suite recognised:: -- --nocapture` runs all of it, which takes the better part of an hour on two
//! cores; `KILN_SWEEP=choices` small tables in which every table and model, every size, warp and kind of file occurs, and every pair of
//! samplings, flips and orders; `KILN_SWEEP=1`, `2` or `3` all pairs of the tables over so many axes, `KILN_SWEEP=2:dfg` those of them whose
//! names begin so, `KILN_SWEEP=2:dfg:6..9` numbers 6 to 8 of these, `KILN_SWEEP=2:dfg:6..99/7` every seventh of 6 to 98, and
//! `KILN_SWEEP=2:dfg:6` number 6 alone, with all that is found out.

use super::pairs::{Row, covering};
use kiln::claim::{Claim, Encoding, Said};
use kiln::format::grid::{Described, Grid, RawNumber, Shape};
use kiln::format::{Container, FormatSpec, Packing, Texture, encode};
use kiln::identify::{ChannelFinding, Confidence, Identification, Options, identify};
use kiln::integrate::{Integration, QUADRATURE_TOLERANCE, Settings};
use kiln::model::charlie::Visibility;
use kiln::model::ggx::Smith;
use kiln::model::layered::Kd;
use kiln::pack::{Number, PackReport, TexelFormat};
use kiln::table::named::{NamedTable, TABLES};
use kiln::table::{Axis, Model, Parameter, Sampling, TableSpec, named, quantity};
use kiln::verify;
use std::path::Path;

/// A table and the choices of its model.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    pub table: &'static NamedTable,
    pub model: Model,
    /// Which choices turn out, where others come to the same numbers.
    pub found: Model,
}

impl Kind {
    fn of(table: &str, model: Model) -> Self {
        Self { table: named::find(table).unwrap(), model, found: model }
    }

    /// Every named table, and every model of those that have a choice.
    pub fn all() -> Vec<Self> {
        let smith = |smith| Model { smith, ..Model::default() };
        let charlie = Model { visibility: Visibility::Charlie, ..Model::default() };
        let kd = |kd| Model { kd, ..Model::default() };
        let others = [
            Self::of("dfg", smith(Smith::Separable)),
            Self::of("dfg", smith(Smith::ApproxCorrelated)),
            Self::of("dfg", smith(Smith::SchlickIbl)),
            Self::of("dfg", smith(Smith::SchlickDirect)),
            Self::of("beckmann-dfg", smith(Smith::Separable)),
            Self::of("ggx-albedo-avg", smith(Smith::Separable)),
            Self::of("charlie-albedo", charlie),
            Self::of("charlie-albedo-avg", charlie),
            Self::of("layered-albedo", kd(Kd::Fresnel)),
            // Another reflectance, the same albedo.
            Self { found: kd(Kd::Albedo), ..Self::of("layered-albedo", kd(Kd::Reciprocal)) },
        ];
        // One number everywhere is nothing to recognise; of channels over other axes than their neighbours, other tests tell.
        let left_out = ["lambert-albedo", "ltc-amplitude", "ltc-lobe-amplitude"];
        let named = TABLES.iter().filter(|table| !left_out.contains(&table.name));
        named.map(|table| Self::of(table.name, Model::default())).chain(others).collect()
    }

    /// Whether a value takes milliseconds: tables of many texels then take minutes.
    fn is_dear(&self) -> bool {
        let fits = self.table.name.starts_with("ltc");
        ["dielectric", "dielectric-inside", "dielectric-albedo", "dielectric-avg", "compensation", "layered-albedo"]
            .contains(&self.table.name)
            || fits
            || self.is_random()
    }

    /// Whether only Monte Carlo knows its values.
    fn is_random(&self) -> bool {
        self.table.name == "ggx-albedo-anisotropic"
    }

    /// Whether values exceed 1, or are below 0.
    fn is_bright(&self) -> bool {
        self.table.name.starts_with("charlie")
            || ["compensation", "cloth-split", "oren-nayar-albedo", "burley-albedo"].contains(&self.table.name)
            || (self.table.name == "layered-albedo" && self.model.kd == Kd::Fresnel)
            || self.is_signed()
    }

    /// Whether some are below 0: where a metal is darkest, F82 has it darker than black beside that.
    fn is_signed(&self) -> bool {
        self.table.name.starts_with("ltc") || self.table.name == "fresnel-f82"
    }
}

/// Warps as a user writes them; logarithms from 0 have an offset.
const WARPS: [&str; 9] =
    ["linear", "sqrt", "cbrt", "square", "log", "acos", "sqrt-one-minus", "f0-fourth-root", "reciprocal+5"];

/// The axis of the table with another size and warp; nothing where it does not admit the warp.
fn axis(of: &str, size: usize, warp: usize, edge: bool, flip: bool) -> Option<Axis> {
    let mut axis: Axis = of.parse().unwrap();
    let near_zero = axis.parameter.range().is_some_and(|(low, _)| low == 0.0);
    let warp = match WARPS[warp] {
        "log" if near_zero && of.starts_with("mu") => {
            if edge {
                "log+0.03"
            } else {
                "log+0.01"
            }
        }
        "log" if near_zero => {
            if edge {
                "log+0.2"
            } else {
                "log+0.05"
            }
        }
        // Nobody has any other parameter so.
        "reciprocal+5" if axis.parameter != Parameter::Exponent => return None,
        warp => warp,
    };
    let infinite = !axis.ends().1.is_finite();
    (axis.size, axis.flip, axis.warp) = (size, flip, warp.parse().unwrap());
    axis.range = match axis.parameter {
        _ if !infinite => axis.range,
        Parameter::Exponent => Some((0.0, 10.0)).filter(|_| warp != "reciprocal+5"),
        _ => Some((1.0, 3.0)).filter(|_| warp != "f0-fourth-root"),
    };
    if edge {
        axis.sampling = Sampling::Edge;
    }
    axis.check().ok().map(|()| axis)
}

/// How a file is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Written {
    /// A container whose channels are numbers, as many as the table has or the next that it can hold.
    Numbers(Container, Number),
    /// Another format, by name.
    Coded(&'static str),
    /// Numbers without a header, of a shape that is told; in planes, one after the other, or texel by texel.
    Bare(RawNumber, bool),
    /// Arrays within arrays, so many places after the point.
    Json(usize),
    /// The same numbers in one list, of a shape that is told.
    FlatJson(usize),
}

/// Every way to write a file.
pub fn every_way() -> Vec<Written> {
    use Container::{C, Dds, Exr, Glsl, Hlsl, Js, Ktx1, Ktx2, Npy, Png, Rust, Wgsl};
    use Number::{F16, F32, Unorm8, Unorm16};
    use Written::{Bare, Coded, FlatJson, Json, Numbers};
    let numbers = [
        (Exr, F32),
        (Exr, F16),
        (Ktx2, F16),
        (Ktx2, F32),
        (Ktx2, Unorm8),
        (Ktx2, Unorm16),
        (Ktx1, F16),
        (Dds, F16),
        (Dds, Unorm8),
        (Png, Unorm8),
        (Png, Unorm16),
        (Npy, F32),
        (Npy, F16),
        (C, F32),
        (Rust, F32),
        (Glsl, F32),
        (Hlsl, F16),
        (Wgsl, F32),
        (Js, F32),
        (Js, F16),
    ];
    let coded = [
        "ktx2:rgb9e5",
        "dds:rgb9e5",
        "ktx2:b10g11r11",
        "ktx2:rgbm",
        "ktx2:rgbd",
        "ktx2:rgbp",
        "png:rgbd",
        "png:rgbm",
        "hdr",
    ];
    let bare = [
        Bare(RawNumber::F16, false),
        Bare(RawNumber::F32, false),
        Bare(RawNumber::F64, false),
        Bare(RawNumber::U8, false),
        Bare(RawNumber::U16, false),
        Bare(RawNumber::F32, true),
    ];
    let texts = [Json(9), Json(5), FlatJson(7)];
    numbers.map(|(c, n)| Numbers(c, n)).into_iter().chain(coded.map(Coded)).chain(bare).chain(texts).collect()
}

impl Written {
    /// Whether it holds tables of so many channels that may exceed 1.
    fn admits(self, kind: &Kind) -> bool {
        let n = kind.table.channels.len();
        let within_one = match self {
            Self::Numbers(_, number) => !number.is_signed(),
            Self::Bare(number, _) => matches!(number, RawNumber::U8 | RawNumber::U16),
            _ => false,
        };
        let fits = match self {
            // Channels without names are letters, which OpenEXR sorts: beyond four nobody knows which is which.
            Self::Numbers(container, _) => (container.has_any_channels() && container != Container::Exr) || n <= 4,
            Self::Coded(_) => n <= 3,
            _ => true,
        };
        // What is compensated exceeds what these have, and they have no minus.
        let beyond = (kind.table.name == "compensation" || kind.is_signed()) && matches!(self, Self::Coded(_));
        fits && !beyond && !(within_one && kind.is_bright())
    }

    /// The container's format for `n` channels.
    fn format(self, n: usize) -> Option<(FormatSpec, TexelFormat)> {
        match self {
            Self::Numbers(container, number) => (n..=4.max(n)).find_map(|channels| {
                let format = TexelFormat::Plain { channels, number };
                Some((FormatSpec::new(container, format).ok()?, format))
            }),
            Self::Coded(name) => {
                let spec: FormatSpec = name.parse().unwrap();
                let Packing::Texel(format) = spec.packing() else { return None };
                Some((spec, format))
            }
            _ => None,
        }
    }

    /// What four bytes a texel are codes of.
    fn code(self) -> Option<TexelFormat> {
        let format = self.format(1)?.1;
        matches!(format, TexelFormat::Rgbd | TexelFormat::Rgbm | TexelFormat::Rgbp).then_some(format)
    }

    /// The file as somebody else writes it, and what he has to say of it.
    pub fn file(self, size: [usize; 3], n: usize, values: &[f64]) -> (Vec<u8>, Described, PackReport) {
        let shape = Some(Shape { size, channels: n });
        let [w, h, d] = size;
        let Some((spec, format)) = self.format(n) else {
            let (bytes, described) = self.bare(size, n, values);
            let is_half = matches!(self, Self::Bare(RawNumber::F16, _));
            let overflowed = values.iter().filter(|v| is_half && v.abs() > f64::from(half::f16::MAX)).count() as u64;
            return (bytes, described, PackReport { overflowed, ..PackReport::default() });
        };
        // Channels that the format has beyond the table's are empty.
        let wide: Vec<f64> = values
            .chunks_exact(n)
            .flat_map(|texel| (0..format.channels()).map(|c| texel.get(c).copied().unwrap_or(0.0)))
            .collect();
        let container = spec.container();
        let (texture, report, described) = if d == 1 {
            let (texture, report) = Texture::flat(format, w, h, &wide).unwrap();
            (texture, report, Described::default())
        } else if container.has_volumes() {
            let (texture, report) = Texture::volume(format, size, &wide).unwrap();
            // Shaders have no arrays of arrays.
            let told = shape.filter(|_| matches!(container, Container::Glsl | Container::Hlsl | Container::Wgsl));
            (texture, report, Described { shape: told, ..Described::default() })
        } else {
            // Slices below each other.
            let (texture, report) = Texture::flat(format, w, h * d, &wide).unwrap();
            (texture, report, Described { shape, ..Described::default() })
        };
        // Codes of four bytes say in the metadata what they are: somebody else's do not.
        let (texture, spec) = match self.code() {
            Some(_) => {
                let plain = TexelFormat::Plain { channels: 4, number: Number::Unorm8 };
                (Texture { format: plain, ..texture }, FormatSpec::new(container, plain).unwrap())
            }
            None => (texture, spec),
        };
        let bytes = encode(spec, &texture).unwrap();
        if !container.is_source() {
            return (bytes, described, report);
        }
        let text = String::from_utf8(bytes).unwrap();
        let lines: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        (lines.join("\n").into_bytes(), described, report)
    }

    fn bare(self, size: [usize; 3], n: usize, values: &[f64]) -> (Vec<u8>, Described) {
        let shape = Some(Shape { size, channels: n });
        match self {
            Self::Bare(number, planar) => {
                let texels = values.len() / n;
                let order: Vec<usize> = if planar {
                    (0..n).flat_map(|c| (0..texels).map(move |t| t * n + c)).collect()
                } else {
                    (0..values.len()).collect()
                };
                let bytes = |i: usize| -> Vec<u8> {
                    let v = values[i];
                    match number {
                        RawNumber::U8 => vec![(v * 255.0).round() as u8],
                        RawNumber::U16 => ((v * 65535.0).round() as u16).to_le_bytes().into(),
                        RawNumber::F16 => half::f16::from_f64(v).to_le_bytes().into(),
                        RawNumber::F32 => (v as f32).to_le_bytes().into(),
                        RawNumber::F64 => v.to_le_bytes().into(),
                    }
                };
                // Half floats, floats and doubles the length of the file tells apart.
                let said = matches!(number, RawNumber::U8 | RawNumber::U16).then_some(number);
                (
                    order.into_iter().flat_map(bytes).collect(),
                    Described { shape, planar, number: said, ..Described::default() },
                )
            }
            Self::Json(places) => {
                let mut parts: Vec<String> = values.iter().map(|v| format!("{v:.places$}")).collect();
                for length in [n, size[0], size[1], size[2]] {
                    if length > 1 {
                        parts = parts.chunks(length).map(|row| format!("[{}]", row.join(", "))).collect();
                    }
                }
                // Of one channel, slices and rows of a volume look like rows and channels where they are few.
                let described =
                    Described { shape: shape.filter(|_| size[2] > 1 || size[1] == 1), ..Described::default() };
                (parts.concat().into_bytes(), described)
            }
            Self::FlatJson(places) => {
                let parts: Vec<String> = values.iter().map(|v| format!("{v:.places$}")).collect();
                let text = format!("{{\"lut\": [{}]}}", parts.join(","));
                (text.into_bytes(), Described { shape, ..Described::default() })
            }
            _ => unreachable!("has a format"),
        }
    }
}

/// How right an answer is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// The table cannot be baked.
    NoTable,
    /// It is named, and so sure it was.
    Named(Confidence),
    /// Something else is named that comes to the same file, byte by byte; what it is is said to be as good an explanation.
    NotToldApart,
}

/// A table in a file.
#[derive(Debug, Clone)]
pub struct Case {
    pub kind: Kind,
    pub axes: Vec<Axis>,
    pub written: Written,
}

impl Case {
    pub fn of(table: &str, model: Model, axes: &str, written: Written) -> Self {
        let axes = axes.split(',').map(|axis| axis.parse().unwrap()).collect();
        Self { kind: Kind::of(table, model), axes, written }
    }

    fn spec(&self, channels: &[&str], axes: &[Axis], model: Model) -> TableSpec {
        let at = self.kind.table.default_point().unwrap();
        let given = |p: Parameter| axes.iter().any(|a| a.parameter.canonical() == p.canonical()) || at.get(p).is_ok();
        let channels = channels.iter().map(|name| quantity::find_among(name, given).unwrap()).collect();
        TableSpec { channels, axes: axes.to_vec(), at, model }
    }

    pub fn name(&self) -> String {
        let axes: Vec<String> = self.axes.iter().map(Axis::brief).collect();
        format!(
            "{}{} over {} as {:?}",
            self.kind.table.name,
            kiln::claim::model_words(&self.wanted()),
            axes.join(","),
            self.written
        )
    }

    /// The table's own integrator.
    fn integration(&self) -> Integration {
        let settings = Settings { tolerance: self.kind.table.tolerance, ..Settings::default() };
        Integration::new(settings).unwrap()
    }

    fn wanted(&self) -> TableSpec {
        self.spec(self.kind.table.channels, &self.axes, self.kind.model)
    }

    /// Everything that is found out of it.
    fn found(&self) -> Identification {
        let spec = self.wanted();
        let values = spec.bake(&self.integration(), &|_| {}).unwrap().values;
        let size = [spec.width(), spec.height(), spec.depth()];
        let (bytes, described, _) = self.written.file(size, spec.channels.len(), &values);
        identify(&Grid::decode(&bytes, &described).unwrap(), &Options { cache: false }).unwrap()
    }

    /// Writes the file, asks what it is and judges it as that; what is wrong with the answer, or how right it is.
    pub fn judged(&self) -> Result<Verdict, String> {
        let spec = self.wanted();
        let values = match spec.bake(&self.integration(), &|_| {}) {
            Ok(table) => table.values,
            Err(kiln::Error::Unsupported(_)) => return Ok(Verdict::NoTable),
            Err(error) => panic!("{}: {error}", self.name()),
        };
        let size = [spec.width(), spec.height(), spec.depth()];
        let n = spec.channels.len();
        let (bytes, described, report) = self.written.file(size, n, &values);
        // A furnace's albedo is 1 to the accuracy of the bake only: what exceeds 1 by less is stored as 1.
        let accuracy = if self.kind.is_random() { 0.01 } else { QUADRATURE_TOLERANCE };
        let exceeds = values.iter().filter(|v| **v > 1.0 && **v <= 1.0 + accuracy).count() as u64;
        // At grazing angles sheen exceeds what half floats hold.
        if self.kind.is_bright() && report.overflowed > 0 {
            return Ok(Verdict::NoTable);
        }
        let negative = if self.kind.is_bright() { 0 } else { report.negative }; // what holds those is signed
        assert!(report.overflowed <= exceeds && negative == 0, "{}: it cannot be written so", self.name());
        let read = |bytes: &[u8]| Grid::decode(bytes, &described).map_err(|e| format!("not read: {e}"));
        let grid = read(&bytes)?;
        let found = identify(&grid, &Options { cache: false }).map_err(|e| format!("not identified: {e}"))?;
        let grid = found.packing.and_then(|packing| grid.unpacked(packing)).unwrap_or(grid);
        let judged =
            verify::foreign::judge(Path::new("table"), &grid, Some(found.claim.clone()), &verify::Options::default())
                .map_err(|e| format!("not judged: {e}"))?;
        if judged.failures() > 0 {
            let failed: Vec<String> = (judged.checks.iter().filter(|c| !c.passed))
                .map(|c| format!("{} of {}: {:.2e}, at most {:.2e}", c.name, c.subject, c.figure, c.limit))
                .collect();
            return Err(format!("{} ({:?}): fails: {}", judged.claim, found.confidence, failed.join("; ")));
        }
        self.is_named(&grid, &found, &values)
    }

    /// Whether it is named as what it is, or as what comes to the same numbers; or as what comes to the same file, and what it is is said to
    /// be as good an explanation.
    fn is_named(&self, grid: &Grid, found: &Identification, values: &[f64]) -> Result<Verdict, String> {
        let table = self.kind.table;
        let said = Said {
            channels: table.channels.iter().map(|&c| c.to_owned()).collect(),
            axes: self.axes.clone(),
            at: table.default_point().unwrap(),
            model: self.kind.found,
            table: None,
        };
        let wanted = Claim::new(grid, &said).unwrap().to_string();
        // Where the factor of four bytes does not vary, they are just a curve.
        let mut claim = found.claim.clone();
        if self.written.code().is_some() {
            claim.channels.iter_mut().for_each(|channel| channel.encoding = Encoding::PLAIN);
        }
        if claim.to_string() == wanted {
            return Ok(Verdict::Named(found.confidence));
        }
        // Values of Monte Carlo are the same within their errors only: what the answer itself calls the same.
        let is_called_the_same = found.channels.iter().all(|c| c.quantity.is_none() || !c.same.is_empty());
        if self.kind.is_random() && is_called_the_same {
            return Ok(Verdict::Named(found.confidence));
        }
        let wrong = || format!("{:?}: taken for {}, where it is {wanted}", found.confidence, found.claim);
        // What is claimed instead, written as the file was: nobody can tell it from the file if it is the same.
        let mut again = values.to_vec();
        let n = table.channels.len();
        let mut same = true;
        let mut is_listed = true;
        if (0..n).any(|c| claim.channels.iter().all(|channel| channel.index != c)) {
            return Err(wrong());
        }
        for (spec, channels) in claim.groups() {
            let baked = spec.bake(&self.integration(), &|_| {}).map_err(|e| format!("{}: {e}", wrong()))?.values;
            for (k, channel) in channels.iter().enumerate() {
                let c = channel.index;
                let mut same_channel = true;
                for (texel, v) in baked.iter().skip(k).step_by(channels.len()).enumerate() {
                    let v = channel.encoding.encode(*v);
                    same_channel &= (v - values[texel * n + c]).abs() <= 1e-9;
                    again[texel * n + c] = v;
                }
                same &= same_channel;
                is_listed &= same_channel || self.is_listed(&found.channels[c], table.channels[c]);
            }
        }
        if same {
            return Ok(Verdict::Named(found.confidence));
        }
        let [w, h, d] = grid.size;
        let bytes = |values: &[f64]| self.written.file([w, h, d], n, values).0;
        let (again, own) = (bytes(&again), bytes(values));
        if found.confidence <= Confidence::Possible && again == own && is_listed {
            return Ok(Verdict::NotToldApart);
        }
        let alike = again.iter().zip(&own).filter(|(a, b)| a == b).count();
        let listed = if is_listed { "said to be as good" } else { "and not said to be as good" };
        Err(format!("{}, {listed} ({alike} of {} bytes alike)", wrong(), own.len()))
    }

    /// Whether what the channel holds is among what is said to be no worse than what it is taken for.
    fn is_listed(&self, finding: &ChannelFinding, channel: &str) -> bool {
        let spec = self.spec(&[channel], &self.axes, self.kind.found);
        let axes: Vec<String> = self.axes.iter().map(Axis::brief).collect();
        let own = format!("{channel}{} over {}", kiln::claim::model_words(&spec), axes.join(" × "));
        // Where the factor of four bytes does not vary, they are just a curve.
        let is_own = |text: &String| {
            text.strip_prefix(&own)
                .is_some_and(|rest| rest.is_empty() || (self.written.code().is_some() && rest.starts_with(", stored")))
        };
        finding.as_good.iter().chain(&finding.same).any(is_own)
    }
}

/// Sizes along an axis.
fn sizes(n_axes: usize) -> &'static [usize] {
    if n_axes == 3 { &[8, 9, 13, 33] } else { &[8, 13, 64, 256] }
}

/// How much of the matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Extent {
    /// Every pair of choices.
    Pairs,
    /// Every choice, in small tables, and every pair of orders, samplings and flips.
    Choices,
}

/// Cases of tables over so many axes.
fn matrix(n_axes: usize, only: &str, extent: Extent) -> Vec<Case> {
    let kinds: Vec<Kind> =
        Kind::all().into_iter().filter(|k| k.table.axes.len() == n_axes && k.table.name.starts_with(only)).collect();
    let ways = every_way();
    let sizes = sizes(n_axes);
    let orders: &[&[usize]] = match n_axes {
        1 => &[&[0]],
        2 => &[&[0, 1], &[1, 0]],
        _ => &[&[0, 1, 2], &[1, 0, 2], &[2, 1, 0], &[0, 2, 1], &[1, 2, 0], &[2, 0, 1]],
    };
    // The table, the kind of file, the order, and of each axis its size, warp, sampling and flip.
    let mut factors = vec![kinds.len(), ways.len(), orders.len()];
    (0..n_axes).for_each(|_| factors.extend([sizes.len(), WARPS.len(), 2, 2]));
    let admits = |f: usize, v: usize, g: usize, w: usize| match (f, g) {
        (0, 1) => ways[w].admits(&kinds[v]),
        (0, g) if g >= 3 => match (g - 3) % 4 {
            0 => !(kinds[v].is_dear() && sizes[w] > if n_axes == 3 { 9 } else { 13 }),
            1 => axis(kinds[v].table.axes[(g - 3) / 4], 8, w, false, false).is_some(),
            _ => true,
        },
        // Large along two axes takes too long.
        (f, g) if f >= 3 && (f - 3) % 4 == 0 && (g - 3) % 4 == 0 => match (n_axes, extent) {
            (3, Extent::Pairs) => sizes[v] + sizes[w] <= 42,
            (3, Extent::Choices) => sizes[v] + sizes[w] <= 18,
            (_, Extent::Pairs) => true,
            (_, Extent::Choices) => sizes[v].min(sizes[w]) == 8,
        },
        _ => true,
    };
    let case = |row: &Row| {
        let kind = kinds[row[0]];
        let axes: Option<Vec<Axis>> = (0..n_axes)
            .map(|i| {
                let [size, warp, edge, flip] = [0, 1, 2, 3].map(|k| row[3 + 4 * i + k]);
                axis(kind.table.axes[i], sizes[size], warp, edge == 1, flip == 1)
            })
            .collect();
        let axes = axes?;
        Some(Case { kind, axes: orders[row[2]].iter().map(|&i| axes[i]).collect(), written: ways[row[1]] })
    };
    let is_wanted = |f: usize, _: usize, g: usize, _: usize| match extent {
        Extent::Pairs => true,
        // Of the ways to write a file, those over fewer axes show it.
        Extent::Choices if f == g => !(n_axes == 3 && f == 1),
        Extent::Choices => [f, g].iter().all(|&f| f == 2 || (f >= 3 && (f - 3) % 4 >= 2)),
    };
    covering(&factors, &admits, &is_wanted).iter().filter_map(case).collect()
}

/// Runs as much of the matrix as is asked for: see the module.
pub fn run(asked: &str) {
    let mut parts = asked.split(':');
    let (axes, only) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    let number = |text: &str| -> usize { text.parse().expect("the number of a case") };
    let (numbers, every) = parts.next().map_or((None, 1), |some| match some.split_once('/') {
        Some((numbers, every)) => (Some(numbers), number(every)),
        None => (Some(some), 1),
    });
    let some = numbers.map(|numbers| match numbers.split_once("..") {
        Some((first, end)) => number(first)..number(end),
        None => number(numbers)..number(numbers) + 1,
    });
    let all: Vec<Case> = match axes {
        "all" => (1..=3).flat_map(|n| matrix(n, only, Extent::Pairs)).collect(),
        "choices" => (1..=3).flat_map(|n| matrix(n, only, Extent::Choices)).collect(),
        n => matrix(n.parse().expect("KILN_SWEEP is all, choices, 1, 2 or 3"), only, Extent::Pairs),
    };
    let some = some.unwrap_or(0..all.len());
    if some.len() == 1 {
        eprintln!("{:#?}", all[some.start].found());
    }
    eprintln!("{asked}: of {} tables", all.len());
    check(some.step_by(every).filter_map(|i| Some((i, all.get(i)?))));
}

/// Judges numbered cases, and says of all that are wrong what is.
fn check<'a>(cases: impl Iterator<Item = (usize, &'a Case)>) {
    let begin = std::time::Instant::now();
    let (mut count, mut failed, mut no_table, mut not_told_apart, mut sure) = (0, 0, 0, 0, [0; 4]);
    for (i, case) in cases {
        count += 1;
        let own = std::time::Instant::now();
        let name = case.name();
        match case.judged() {
            Ok(Verdict::NoTable) => {
                no_table += 1;
                eprintln!("{i}: cannot be baked: {name}");
            }
            Ok(Verdict::NotToldApart) => {
                not_told_apart += 1;
                eprintln!("{i}: not told apart: {name}");
            }
            Ok(Verdict::Named(confidence)) => {
                sure[confidence as usize] += 1;
                if confidence < Confidence::Likely {
                    eprintln!("{i}: possibly: {name}");
                }
            }
            Err(error) => {
                eprintln!("{i}: WRONG: {name}: {error}");
                failed += 1;
            }
        }
        if own.elapsed().as_secs_f64() > 10.0 {
            eprintln!("{i}: {:.0} s: {name}", own.elapsed().as_secs_f64());
        }
    }
    let [_, possible, likely, certain] = sure;
    eprintln!(
        "{count} tables in {:.0} s: named certainly {certain}, likely {likely}, possibly {possible}; {not_told_apart} of several that come to the \
         same file; {no_table} that cannot be baked; {failed} wrong",
        begin.elapsed().as_secs_f64(),
    );
    assert_eq!(failed, 0, "so many of {count} tables are not recognised");
}
