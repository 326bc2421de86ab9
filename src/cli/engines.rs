//! `kiln list engines`: each engine as the flags that it stands for.

use super::console::Console;
use kiln::Result;
use kiln::engine::{ENGINES, Engine, EngineEnvironment, EngineTable, Levels};
use kiln::environment::{KernelKind, ShConvention};
use kiln::recipe::IrradianceKind;
use kiln::table::{Axis, Parameter, Sampling, TableSpec, named};
use serde::Serialize;

/// An engine, for a program.
#[derive(Serialize)]
struct EngineRow {
    name: &'static str,
    title: &'static str,
    experimental: bool,
    files: Vec<FileRow>,
    environment: Option<EnvironmentRow>,
    sources: &'static [&'static str],
    from_memory: &'static [&'static str],
    warnings: &'static [&'static str],
    missing: &'static [&'static str],
    usage: &'static str,
}

#[derive(Serialize)]
struct FileRow {
    /// What `kiln table NAME --engine` calls it.
    name: &'static str,
    file: &'static str,
    /// Which layer of the file it is, where that is an array texture.
    #[serde(skip_serializing_if = "Option::is_none")]
    layer: Option<usize>,
    format: &'static str,
    /// Texels along each axis.
    size: Vec<usize>,
    channels: &'static [&'static str],
    axes: Vec<AxisRow>,
    smith: &'static str,
    visibility: &'static str,
    /// The axes and the masking of the engine's own table, where they are others.
    as_shipped: Option<ShippedRow>,
}

#[derive(Serialize)]
struct ShippedRow {
    axes: Vec<AxisRow>,
    smith: &'static str,
}

#[derive(Serialize)]
struct AxisRow {
    parameter: Parameter,
    size: usize,
    range: Option<(f64, f64)>,
    warp: String,
    sampling: &'static str,
    flip: bool,
    shift: f64,
    /// The other parameter that it stands for, in channels of that one.
    #[serde(skip_serializing_if = "Option::is_none")]
    also: Option<Parameter>,
}

#[derive(Serialize)]
struct EnvironmentRow {
    layout: &'static str,
    size: usize,
    levels: usize,
    roughness: Vec<f64>,
    /// The level that the shader reads, L being the last one's number.
    level: String,
    /// What the engine's own baker fills the levels for, where that is something else.
    roughness_as_shipped: Option<Vec<f64>>,
    kernel: &'static str,
    /// The world's direction that each face holds, of u to the right and v down: +X −X +Y −Y +Z −Z.
    #[serde(skip_serializing_if = "Option::is_none")]
    faces: Option<[[&'static str; 3]; 6]>,
    orientation: String,
    mirror: bool,
    irradiance: &'static str,
    irradiance_size: usize,
    sh: Option<ShRow>,
    format: &'static str,
    irradiance_format: &'static str,
    specular_file: &'static str,
    irradiance_file: Option<&'static str>,
    /// The chain for sheens, where the engine has another.
    sheen: Option<SheenRow>,
}

#[derive(Serialize)]
struct SheenRow {
    file: &'static str,
    kernel: &'static str,
    roughness: Vec<f64>,
}

#[derive(Serialize)]
struct ShRow {
    convention: &'static str,
    order: [&'static str; 9],
    holds: &'static str,
}

impl AxisRow {
    fn new(axis: &Axis) -> Self {
        Self {
            parameter: axis.parameter,
            size: axis.size,
            range: axis.known_range().filter(|(_, high)| high.is_finite()),
            warp: axis.warp.to_string(),
            sampling: match axis.sampling {
                Sampling::Centre => "centre",
                Sampling::Edge => "edge",
            },
            flip: axis.flip,
            shift: axis.shift,
            also: axis.also,
        }
    }
}

/// Which layer of its file a table is, where that is an array texture.
fn layer(engine: &Engine, table: &EngineTable) -> Option<usize> {
    let mut layers = engine.tables.iter().filter(|other| other.is_layer && other.file == table.file);
    layers.position(|other| other.name == table.name)
}

impl FileRow {
    fn new(engine: &Engine, table: &EngineTable) -> Result<Self> {
        let recipe = table.recipe(false)?;
        let spec: TableSpec = recipe.spec()?;
        let as_shipped = match &table.as_shipped {
            None => None,
            Some(shipped) => {
                let axes = table.recipe(true)?.axes.iter().map(AxisRow::new).collect();
                Some(ShippedRow { axes, smith: shipped.smith.name() })
            }
        };
        Ok(Self {
            name: table.name,
            file: table.file,
            layer: layer(engine, table),
            format: table.format,
            size: spec.axes.iter().map(|axis| axis.size).collect(),
            channels: table.channels,
            axes: spec.axes.iter().map(AxisRow::new).collect(),
            smith: table.smith.name(),
            visibility: table.visibility.name(),
            as_shipped,
        })
    }
}

impl EnvironmentRow {
    fn new(preset: &EngineEnvironment) -> Result<Self> {
        let orientation = preset.orientation()?;
        let sh = (preset.sh != ShConvention::Kiln).then(|| ShRow {
            convention: preset.sh.name(),
            order: preset.sh.order(),
            holds: preset.sh.holds(),
        });
        Ok(Self {
            layout: preset.layout.name(),
            size: preset.size,
            levels: preset.n_levels(preset.size),
            roughness: preset.level_roughness(preset.size, false),
            level: preset.roughness.formula(),
            roughness_as_shipped: preset.as_shipped.map(|_| preset.level_roughness(preset.size, true)),
            kernel: preset.kernel.name(),
            faces: preset.layout.is_cube().then(|| orientation.faces()),
            orientation: orientation.to_string(),
            mirror: orientation.is_mirror(),
            irradiance: preset.irradiance.name(),
            irradiance_size: preset.irradiance_size,
            sh,
            format: preset.format,
            irradiance_format: preset.irradiance_format,
            specular_file: preset.specular_file,
            irradiance_file: (preset.irradiance == IrradianceKind::Cube)
                .then_some(preset.irradiance_file)
                .filter(|file| !file.is_empty()),
            sheen: preset.has_sheen().then(|| SheenRow {
                file: preset.sheen_file,
                kernel: KernelKind::Charlie.name(),
                roughness: preset.sheen_roughness(),
            }),
        })
    }
}

/// Prints all of them.
pub fn list(console: &Console) -> Result<()> {
    if console.json {
        let row = |engine: &&Engine| {
            Ok(EngineRow {
                name: engine.name,
                title: engine.title,
                experimental: engine.is_experimental(),
                files: engine.tables.iter().map(|table| FileRow::new(engine, table)).collect::<Result<_>>()?,
                environment: engine.environment.as_ref().map(EnvironmentRow::new).transpose()?,
                sources: engine.sources,
                from_memory: engine.from_memory,
                warnings: engine.warnings,
                missing: engine.missing,
                usage: engine.usage,
            })
        };
        return console.print_json(&ENGINES.iter().map(row).collect::<Result<Vec<_>>>()?);
    }
    let texts = ENGINES.iter().map(|engine| text(engine)).collect::<Result<Vec<_>>>()?;
    console.print(&texts.join("\n"))
}

fn text(engine: &Engine) -> Result<String> {
    let mut lines = vec![format!("{}: {}", engine.name, engine.title)];
    for table in engine.tables {
        let layer = layer(engine, table).map(|layer| format!(" (layer {layer} of the file)"));
        lines.push(format!("  {}{}", table_flags(table)?, layer.unwrap_or_default()));
    }
    if let Some(preset) = &engine.environment {
        lines.push(format!("  {}", environment_flags(preset)?));
        if preset.has_sheen() {
            lines.push(format!("  {}, of which {} is the file", sheen_flags(preset)?, preset.sheen_file));
        }
        lines.push(format!("  its shader reads level {}, L the last level, r roughness", preset.roughness.formula()));
    }
    let notes = [
        ("read in", engine.sources),
        ("from memory", engine.from_memory),
        ("note", engine.warnings),
        ("not baked", engine.missing),
        ("in use", &[engine.usage]),
    ];
    for (what, texts) in notes {
        lines.extend(texts.iter().map(|text| format!("  {what}: {text}")));
    }
    Ok(lines.join("\n") + "\n")
}

/// The table without its preset.
fn table_flags(table: &EngineTable) -> Result<String> {
    // Channels and axes are given: any table's name will do where none is this one's.
    let name = named::find(table.name).map_or("dfg", |named| named.name);
    let recipe = table.recipe(false)?;
    let axes: Vec<String> = recipe.axes.iter().map(Axis::brief).collect();
    let mut flags = format!(
        "kiln table {name} -o {} --format {} --channels {} --axes {}",
        table.file,
        recipe.format,
        table.channels.join(","),
        axes.join(",")
    );
    if recipe.model.smith != Default::default() {
        flags += &format!(" --smith {}", recipe.model.smith.name());
    }
    if recipe.model.visibility != Default::default() {
        flags += &format!(" --visibility {}", recipe.model.visibility.name());
    }
    if let Some(tolerance) = table.tolerance {
        flags += &format!(" --tolerance {tolerance:e}");
    }
    Ok(flags)
}

/// The environment without its preset, and no more than both its chains have.
fn chain_flags(preset: &EngineEnvironment, roughness: &[f64], kernel: KernelKind) -> Result<String> {
    // Four digits are what a person reads; --json has them all.
    let rounded: Vec<String> =
        (roughness.iter()).map(|r| format!("{r:.4}").trim_end_matches('0').trim_end_matches('.').to_owned()).collect();
    Ok(format!(
        "kiln env INPUT --out DIR{} --size {} --roughness {} --format {} --orientation {} --kernel {}",
        if preset.layout.is_cube() { String::new() } else { format!(" --layout {}", preset.layout) },
        preset.size,
        rounded.join(","),
        preset.format,
        preset.orientation()?,
        kernel.name()
    ))
}

fn sheen_flags(preset: &EngineEnvironment) -> Result<String> {
    let flags = chain_flags(preset, &preset.sheen_roughness(), KernelKind::Charlie)?;
    Ok(format!("{flags} --irradiance {}", IrradianceKind::None.name()))
}

fn environment_flags(preset: &EngineEnvironment) -> Result<String> {
    let n = preset.n_levels(preset.size);
    let mut flags = chain_flags(preset, &preset.level_roughness(preset.size, false), preset.kernel)?;
    flags += &format!(" --irradiance {}", preset.irradiance.name());
    if preset.irradiance == IrradianceKind::Cube {
        flags += &format!(" --irradiance-size {}", preset.irradiance_size);
        if preset.irradiance_format != preset.format {
            flags += &format!(" --irradiance-format {}", preset.irradiance_format);
        }
    }
    if preset.sh != ShConvention::Kiln {
        flags += &format!(" --sh {}", preset.sh.name());
    }
    if let Levels::DownTo(last) = preset.levels {
        flags += &format!(" ({n} levels, down to {last} texels)");
    }
    Ok(flags)
}
