//! The names of output formats: `exr:f32`, `ktx2:rgba16f+zstd`, `png:rgb8unorm`, `hdr`.

use crate::error::{Error, Result};
use crate::pack::{Number, TexelFormat};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A file format that Kiln writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Container {
    /// OpenEXR: any channels, by name.
    Exr,
    /// KTX, version 2: what a graphics interface takes as it is.
    Ktx2,
    /// KTX, version 1, as Filament's tools write it.
    Ktx1,
    /// DirectDraw surface.
    Dds,
    /// Radiance HDR.
    Hdr,
    /// PNG of 8 or 16 bits.
    Png,
    /// Babylon.js' environment: a cube with all its mips.
    Env,
    /// NumPy's array.
    Npy,
    /// Texels and nothing else.
    Raw,
    /// A C or C++ header.
    C,
    /// A Rust module.
    Rust,
    /// GLSL.
    Glsl,
    /// HLSL.
    Hlsl,
    /// WGSL.
    Wgsl,
    /// A JavaScript module.
    Js,
}

/// What a value becomes: a number per channel where the container has any number of channels, else a texel format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Packing {
    /// Any number of channels, each of them one number.
    Number(Number),
    /// A texel format.
    Texel(TexelFormat),
}

/// In which way a container is written where it has several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Variant {
    /// As it is usually.
    #[default]
    Plain,
    /// `+zstd`: a KTX2 whose levels are compressed.
    Zstd,
    /// `+legacy`: a DDS with the header of Direct3D 9.
    Legacy,
}

/// A container and what a value becomes in it.
///
/// `exr` alone is `exr:f32`; `hdr` and `env` have one packing each and are written without it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct FormatSpec {
    container: Container,
    packing: Packing,
    variant: Variant,
}

impl Container {
    /// Every container that there is.
    pub const ALL: [Self; 15] = [
        Self::Exr,
        Self::Ktx2,
        Self::Ktx1,
        Self::Dds,
        Self::Hdr,
        Self::Png,
        Self::Env,
        Self::Npy,
        Self::Raw,
        Self::C,
        Self::Rust,
        Self::Glsl,
        Self::Hlsl,
        Self::Wgsl,
        Self::Js,
    ];

    /// Its name in a [`FormatSpec`].
    pub fn name(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Ktx2 => "ktx2",
            Self::Ktx1 => "ktx1",
            Self::Dds => "dds",
            Self::Hdr => "hdr",
            Self::Png => "png",
            Self::Env => "env",
            Self::Npy => "npy",
            Self::Raw => "raw",
            Self::C => "c",
            Self::Rust => "rust",
            Self::Glsl => "glsl",
            Self::Hlsl => "hlsl",
            Self::Wgsl => "wgsl",
            Self::Js => "js",
        }
    }

    /// The extension of its files, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Ktx1 => "ktx",
            Self::C => "h",
            Self::Rust => "rs",
            other => other.name(),
        }
    }

    /// The container whose files have that extension.
    pub fn of_extension(extension: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|container| container.extension() == extension)
    }

    /// Whether it is source code.
    pub fn is_source(self) -> bool {
        matches!(self, Self::C | Self::Rust | Self::Glsl | Self::Hlsl | Self::Wgsl | Self::Js)
    }

    /// Whether texels may have any number of channels.
    pub fn has_any_channels(self) -> bool {
        self.is_source() || matches!(self, Self::Exr | Self::Npy)
    }

    /// Whether it holds cubes and mips.
    pub fn has_cubes(self) -> bool {
        matches!(self, Self::Exr | Self::Ktx2 | Self::Ktx1 | Self::Dds | Self::Env)
    }

    /// Whether it holds pictures that others show as such.
    pub fn has_pictures(self) -> bool {
        matches!(self, Self::Exr | Self::Ktx2 | Self::Ktx1 | Self::Dds | Self::Hdr | Self::Png)
    }

    /// Whether it holds the layers of an array texture.
    pub fn has_arrays(self) -> bool {
        matches!(self, Self::Ktx2 | Self::Ktx1 | Self::Dds)
    }

    /// Whether it holds smaller levels of a picture beside it.
    pub fn has_mips(self) -> bool {
        matches!(self, Self::Exr | Self::Ktx2 | Self::Ktx1 | Self::Dds | Self::Env)
    }

    /// Whether it holds three axes as they are.
    pub fn has_volumes(self) -> bool {
        self.is_source() || matches!(self, Self::Ktx2 | Self::Ktx1 | Self::Dds | Self::Npy | Self::Raw)
    }

    /// What it can hold, the usual one first.
    pub fn packings(self) -> Vec<Packing> {
        use TexelFormat::{B10g11r11, Bc6h, Plain, Rgb9e5, Rgbd, Rgbe, Rgbm, Rgbp, UastcHdr};
        if self.has_any_channels() {
            return [Number::F32, Number::F16].map(Packing::Number).to_vec();
        }
        let holds = |format: &TexelFormat| match (self, *format) {
            (Self::Raw, _) | (Self::Hdr, Rgbe) | (Self::Env, Rgbd) => true,
            (Self::Hdr | Self::Env, _) | (_, Rgbe) => false,
            // OpenGL and DXGI have no name for it.
            (_, UastcHdr) => self == Self::Ktx2,
            // Grey and alpha are no two channels of a table: a shader would see (r, r, r, g).
            (Self::Png, Plain { channels, number }) => channels != 2 && !number.is_signed(),
            (Self::Png, other) => matches!(other, Rgbm | Rgbp | Rgbd),
            // DXGI has no three channels but of f32; and no key says what four bytes stand for.
            (Self::Dds, Plain { channels: 3, number }) => number == Number::F32,
            (Self::Dds, Rgbm | Rgbp | Rgbd) => false,
            (_, Plain { .. } | Rgb9e5 | B10g11r11 | Bc6h | Rgbm | Rgbp | Rgbd) => true,
        };
        TexelFormat::ALL.into_iter().filter(holds).map(Packing::Texel).collect()
    }

    fn variants(self) -> &'static [Variant] {
        match self {
            Self::Ktx2 => &[Variant::Plain, Variant::Zstd],
            Self::Dds => &[Variant::Plain, Variant::Legacy],
            _ => &[Variant::Plain],
        }
    }
}

impl Variant {
    fn suffix(self) -> &'static str {
        match self {
            Self::Plain => "",
            Self::Zstd => "+zstd",
            Self::Legacy => "+legacy",
        }
    }
}

impl FormatSpec {
    /// The format of a container and a texel format, or of the number that the latter is made of.
    ///
    /// **Errors**: a texel format that the container cannot hold.
    pub fn new(container: Container, format: TexelFormat) -> Result<Self> {
        let packing = match format.number() {
            Some(number) if container.has_any_channels() => Packing::Number(number),
            _ => Packing::Texel(format),
        };
        Self::checked(container, packing, Variant::Plain)
    }

    /// An OpenEXR.
    pub const fn exr(number: Number) -> Self {
        Self { container: Container::Exr, packing: Packing::Number(number), variant: Variant::Plain }
    }

    /// A KTX2.
    pub const fn ktx2(format: TexelFormat) -> Self {
        Self { container: Container::Ktx2, packing: Packing::Texel(format), variant: Variant::Plain }
    }

    fn checked(container: Container, packing: Packing, variant: Variant) -> Result<Self> {
        if !container.packings().contains(&packing) {
            return Err(cannot_hold(container, packing));
        }
        let spec = Self { container, packing, variant };
        let fits = match (variant, packing) {
            (Variant::Plain, _) => true,
            (Variant::Zstd, _) => container == Container::Ktx2,
            (Variant::Legacy, Packing::Texel(TexelFormat::Plain { channels, number })) => {
                container == Container::Dds && channels != 3 && number.is_signed()
            }
            (Variant::Legacy, _) => false,
        };
        if fits {
            return Ok(spec);
        }
        Err(match variant {
            Variant::Legacy => Error::usage(
                format!("format `{spec}`: the header of Direct3D 9 has no such texels"),
                "use dds with r16f, rg16f, rgba16f, r32f, rg32f or rgba32f and +legacy, or leave +legacy out",
            ),
            _ => Error::usage(
                format!("format `{spec}`, where only KTX2 has {}", variant.suffix()),
                "use ktx2, or leave it out",
            ),
        })
    }

    /// The container.
    pub fn container(self) -> Container {
        self.container
    }

    /// What a value becomes.
    pub fn packing(self) -> Packing {
        self.packing
    }

    /// In which way the container is written.
    pub fn variant(self) -> Variant {
        self.variant
    }

    /// The extension of its files, without the dot.
    pub fn extension(self) -> &'static str {
        self.container.extension()
    }

    /// The number that each channel is, where every channel is one.
    pub fn number(self) -> Option<Number> {
        match self.packing {
            Packing::Number(number) => Some(number),
            Packing::Texel(format) => format.number(),
        }
    }

    /// The texel format for that many channels: those of the table where the container has any number, else its own, which may have more.
    ///
    /// **Errors**: more channels than the texel format has.
    pub fn texel(self, channels: usize) -> Result<TexelFormat> {
        match self.packing {
            Packing::Number(number) => Ok(TexelFormat::Plain { channels, number }),
            Packing::Texel(format) if format.channels() >= channels => Ok(format),
            Packing::Texel(format) => Err(Error::usage(
                format!("{self} holds {} channels, and {channels} were asked for", format.channels()),
                format!("use {}", self.wider(format, channels)),
            )),
        }
    }

    /// The formats for more channels than the texel format has: the container's own, of the same numbers where it has those, else others.
    fn wider(self, format: TexelFormat, channels: usize) -> String {
        let has_room = |packing: &Packing| match packing {
            Packing::Texel(other) => other.channels() >= channels && other.number().is_some(),
            Packing::Number(_) => false,
        };
        let own: Vec<Packing> = self.container.packings().into_iter().filter(has_room).collect();
        let alike = |packing: &&Packing| matches!(packing, Packing::Texel(other) if other.number() == format.number());
        let same: Vec<Packing> = own.iter().filter(alike).copied().collect();
        let spec = |packing: &Packing| Self { packing: *packing, variant: Variant::Plain, ..self }.to_string();
        let found: Vec<String> = if same.is_empty() { &own } else { &same }.iter().map(spec).collect();
        match (found.is_empty(), channels) {
            (false, _) => format!("{}, or exr:f32 for any number", found.join(", ")),
            (true, ..=4) => "ktx2:rgba16f or ktx2:rgba32f for up to four, or exr:f32 for any number".to_owned(),
            (true, _) => "exr:f32 or npy:f32, which hold any number, or split them over several files".to_owned(),
        }
    }

    /// What is wrong with a largest level of that size in the format: Direct3D takes textures in blocks only in whole ones (its
    /// documentation, *Block Compression*). Nothing where all is well; smaller levels may be of any size.
    pub fn size_warning(self, [width, height]: [usize; 2]) -> Option<String> {
        let side = crate::pack::blocks::SIDE;
        let whole = [width, height].map(|n| n.next_multiple_of(side));
        (self.packing == Packing::Texel(TexelFormat::Bc6h) && whole != [width, height]).then(|| {
            format!(
                "{width} × {height} texels, which are no whole blocks of {side} × {side}, and which Direct3D refuses in bc6h; use multiples of \
                 {side}, such as {} × {}",
                whole[0], whole[1]
            )
        })
    }

    /// The usual format of a container for that many channels: halves where it holds them, else what comes closest to them.
    ///
    /// **Errors**: more channels than a texel has, where the container has no other; `raw`, which has no usual one.
    pub fn usual(container: Container, channels: usize) -> Result<Self> {
        let plain =
            |channels, number| TexelFormat::new(channels, number).and_then(|format| Self::new(container, format));
        match container {
            Container::Hdr => Self::new(container, TexelFormat::Rgbe),
            Container::Env => Self::new(container, TexelFormat::Rgbd),
            Container::Png => plain(if channels == 2 { 3 } else { channels }, Number::Unorm16),
            Container::Raw => Err(needs_packing(container)),
            _ if container.has_any_channels() => Self::checked(container, Packing::Number(Number::F32), Variant::Plain),
            _ => plain(if channels == 3 { 4 } else { channels }, Number::F16),
        }
    }

    /// Every format that there is.
    pub fn all() -> Vec<Self> {
        let of = |container: Container| {
            let packings = container.packings();
            let pairs =
                packings.into_iter().flat_map(|packing| container.variants().iter().map(move |&v| (packing, v)));
            pairs
                .filter_map(move |(packing, variant)| Self::checked(container, packing, variant).ok())
                .collect::<Vec<_>>()
        };
        Container::ALL.into_iter().flat_map(of).collect()
    }
}

/// The containers' names, separated by commas.
fn container_names() -> String {
    Container::ALL.map(Container::name).join(", ")
}

fn needs_packing(container: Container) -> Error {
    let choices: Vec<String> = container
        .packings()
        .into_iter()
        .map(|packing| FormatSpec { container, packing, variant: Variant::Plain }.to_string())
        .collect();
    Error::usage(
        format!("format `{container}` without a texel format"),
        format!("choose one of {}", choices.join(", ")),
    )
}

fn cannot_hold(container: Container, packing: Packing) -> Error {
    let able: Vec<String> = Container::ALL
        .into_iter()
        .filter_map(|container| FormatSpec::checked_alike(container, packing))
        .map(|spec| spec.to_string())
        .collect();
    Error::usage(format!("{container} cannot hold {packing}"), format!("use {}", able.join(", ")))
}

impl FormatSpec {
    /// The container with that packing, or with its number, if it can hold either.
    fn checked_alike(container: Container, packing: Packing) -> Option<Self> {
        let packing = match packing {
            Packing::Texel(format) if container.has_any_channels() => Packing::Number(format.number()?),
            other => other,
        };
        container.packings().contains(&packing).then_some(Self { container, packing, variant: Variant::Plain })
    }
}

impl fmt::Display for Container {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for Packing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Texel(format) => format.fmt(f),
        }
    }
}

impl fmt::Display for FormatSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.container {
            Container::Hdr | Container::Env => self.container.fmt(f),
            container => write!(f, "{container}:{}{}", self.packing, self.variant.suffix()),
        }
    }
}

impl FromStr for FormatSpec {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let (head, tail) = name.split_once(':').map_or((name, None), |(head, tail)| (head, Some(tail)));
        let container = Container::ALL.into_iter().find(|container| container.name() == head).ok_or_else(|| {
            Error::usage(
                format!("unknown format `{name}`"),
                format!(
                    "use one of {}, with a texel format, such as ktx2:rg16f or exr:f32; `kiln list formats` has them all",
                    container_names()
                ),
            )
        })?;
        let Some(tail) = tail else {
            return match container {
                Container::Exr | Container::Hdr | Container::Env => Self::usual(container, 1),
                _ => Err(needs_packing(container)),
            };
        };
        let (packing, suffix) = tail.split_once('+').map_or((tail, None), |(packing, suffix)| (packing, Some(suffix)));
        let variant = match suffix {
            None => Variant::Plain,
            Some("zstd") => Variant::Zstd,
            Some("legacy") => Variant::Legacy,
            Some(other) => {
                return Err(Error::usage(
                    format!("format `{name}` with an unknown `+{other}`"),
                    "use +zstd or +legacy, or leave it out",
                ));
            }
        };
        let packing = match packing.parse().map(Packing::Number) {
            Ok(number) => number,
            Err(_) => Packing::Texel(packing.parse().map_err(|_| {
                let known: Vec<String> = container.packings().iter().map(Packing::to_string).collect();
                Error::usage(
                    format!("unknown texel format `{packing}` in format `{name}`"),
                    format!("use one of those of {container}: {}", known.join(", ")),
                )
            })?),
        };
        Self::checked(container, packing, variant)
    }
}

impl TryFrom<String> for FormatSpec {
    type Error = Error;

    fn try_from(name: String) -> Result<Self> {
        name.parse()
    }
}

impl From<FormatSpec> for String {
    fn from(spec: FormatSpec) -> Self {
        spec.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_what_their_names_say() {
        let all = FormatSpec::all();
        for spec in &all {
            assert_eq!(spec.to_string().parse::<FormatSpec>().unwrap(), *spec);
            let json = serde_json::to_string(spec).unwrap();
            assert_eq!(serde_json::from_str::<FormatSpec>(&json).unwrap(), *spec);
        }
        let names: Vec<String> = all.iter().map(ToString::to_string).collect();
        for name in [
            "exr:f32",
            "exr:f16",
            "ktx2:rg16f",
            "ktx2:rgba16f+zstd",
            "ktx2:bc6h",
            "ktx2:uastc-hdr+zstd",
            "ktx1:b10g11r11",
            "dds:bc6h",
            "dds:rgba16f+legacy",
            "hdr",
            "env",
            "png:rgb8unorm",
            "png:rgba16unorm",
            "png:rgbm",
            "npy:f32",
            "raw:rgb9e5",
            "c:f32",
            "rust:f16",
            "glsl:f32",
            "hlsl:f32",
            "wgsl:f32",
            "js:f32",
        ] {
            assert!(names.iter().any(|known| known == name), "{name} is not listed");
        }
        assert_eq!("exr".parse::<FormatSpec>().unwrap(), FormatSpec::exr(Number::F32));
        let spec: FormatSpec = "ktx2:rg16f".parse().unwrap();
        assert_eq!((spec.extension(), spec.container(), spec.number()), ("ktx2", Container::Ktx2, Some(Number::F16)));
        assert_eq!("c:f32".parse::<FormatSpec>().unwrap().extension(), "h");
    }

    #[test]
    fn unknown_formats_are_refused_with_the_list_of_known_ones() {
        let refuse = |name: &str| name.parse::<FormatSpec>().unwrap_err().to_string();
        for name in ["", "tiff", "EXR", "tga:rg16f"] {
            assert!(refuse(name).contains("; use one of exr, ktx2, ktx1, dds, hdr, png"), "{}", refuse(name));
        }
        assert!(refuse("exr:f64").contains("use one of those of exr: f32, f16"));
        assert!(refuse("ktx2").contains("; choose one of ktx2:r16f, ktx2:rg16f"), "{}", refuse("ktx2"));
        assert!(refuse("ktx2:rg16f+lzma").contains("use +zstd"));
        assert!(serde_json::from_str::<FormatSpec>("\"png\"").is_err());
    }

    #[test]
    fn a_packing_that_a_container_cannot_hold_is_refused_with_those_that_can() {
        let refuse = |name: &str| name.parse::<FormatSpec>().unwrap_err().to_string();
        assert!(
            refuse("png:rgba16f")
                .contains("png cannot hold rgba16f; use exr:f16, ktx2:rgba16f, ktx1:rgba16f, dds:rgba16f")
        );
        assert!(refuse("exr:bc6h").contains("exr cannot hold bc6h; use ktx2:bc6h, ktx1:bc6h, dds:bc6h, raw:bc6h"));
        assert!(refuse("dds:rgb16f").contains("use exr:f16, ktx2:rgb16f"));
        assert!(refuse("hdr:rgba16f").contains("hdr cannot hold"));
        assert!(refuse("dds:bc6h+legacy").contains("leave +legacy out"));
        assert!(refuse("png:rgb8unorm+zstd").contains("only KTX2"));
    }

    #[test]
    fn a_format_of_too_few_channels_is_refused_with_those_of_the_container_that_have_enough() {
        let refuse = |name: &str, n| name.parse::<FormatSpec>().unwrap().texel(n).unwrap_err().to_string();
        for (name, n, way_out) in [
            ("ktx1:rg16f", 3, "; use ktx1:rgb16f, ktx1:rgba16f, or exr:f32"),
            ("dds:rg16f", 3, "; use dds:rgba16f, or exr:f32"),
            ("ktx2:bc6h", 4, "; use ktx2:rgba16f, ktx2:rgba32f, ktx2:rgba8unorm, ktx2:rgba16unorm, or exr:f32"),
            ("png:rgb8unorm", 4, "; use png:rgba8unorm, or exr:f32"),
            ("hdr", 4, "; use ktx2:rgba16f or ktx2:rgba32f for up to four"),
            ("ktx2:rgba16f", 5, "; use exr:f32 or npy:f32"),
        ] {
            assert!(refuse(name, n).contains(way_out), "{}", refuse(name, n));
        }
    }

    #[test]
    fn blocks_that_are_not_whole_are_warned_of_where_they_matter() {
        let warning = |name: &str, size| name.parse::<FormatSpec>().unwrap().size_warning(size);
        assert!(warning("dds:bc6h", [33, 30]).unwrap().contains("such as 36 × 32"));
        assert_eq!((warning("dds:bc6h", [32, 4]), warning("ktx2:rgb9e5", [33, 33])), (None, None));
    }
}
