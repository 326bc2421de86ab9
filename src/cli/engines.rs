//! `kiln list engines`: each engine as the flags that it stands for.

use super::console::Console;
use kiln::Result;
use kiln::engine::{ENGINES, Engine, EngineEnvironment, EngineTable, Levels};
use kiln::environment::{KernelKind, ShConvention};
use kiln::format::FormatSpec;
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
    /// The world's direction that each face holds, of u to the right and v down: +X −X +Y −Y +Z −Z; null where the layout has no faces.
    faces: Option<[[&'static str; 3]; 6]>,
    orientation: String,
    mirror: bool,
    irradiance: &'static str,
    irradiance_size: usize,
    sh: ShRow,
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
        let sh = ShRow { convention: preset.sh.name(), order: preset.sh.order(), holds: preset.sh.holds() };
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
            irradiance_format: preset.format_of_irradiance(),
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
        lines.push(format!("  {}", table_flags(table)?));
        lines.extend(layer(engine, table).map(|layer| format!("    which is layer {layer} of {}", table.file)));
    }
    if let Some(preset) = &engine.environment {
        lines.push(format!("  {}", environment_flags(preset)?));
        let maps = [("specular", preset.specular_file, preset.format)];
        let irradiance = (preset.irradiance == IrradianceKind::Cube).then_some(preset.irradiance_file);
        let irradiance = irradiance.map(|file| ("irradiance", file, preset.format_of_irradiance()));
        lines.extend(names_of(&maps.into_iter().chain(irradiance).collect::<Vec<_>>())?);
        if preset.has_sheen() {
            lines.push(format!("  {}", sheen_flags(preset)?));
            lines.extend(names_of(&[("specular", preset.sheen_file, preset.format)])?);
        }
        let n = preset.n_levels(preset.size);
        let last = match preset.levels {
            Levels::DownTo(last) => format!(", down to {last} texels"),
            Levels::Count(_) => String::new(),
        };
        let formula = preset.roughness.formula();
        lines.push(format!("  {n} levels{last}; its shader reads level {formula}, L the last level, r roughness"));
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

/// What the engine calls the files of an environment, each of which has the name that Kiln gives it, the engine's and its format.
fn names_of(maps: &[(&str, &str, &str)]) -> Result<Option<String>> {
    let mut names = vec![];
    for (kiln, own, format) in maps.iter().filter(|(_, own, _)| !own.is_empty()) {
        let format: FormatSpec = format.parse()?;
        names.push(format!("{kiln}.{} is {}", format.extension(), own.replace("{name}", "NAME")));
    }
    Ok((!names.is_empty()).then(|| format!("  as the engine calls them: {}", names.join(", "))))
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
        quoted(&table.channels.join(",")),
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

/// The word as a shell takes it: brackets and stars mean something to it.
fn quoted(word: &str) -> String {
    let is_plain = word.chars().all(|c| c.is_ascii_alphanumeric() || ".,:/+-_=".contains(c));
    if is_plain { word.to_owned() } else { format!("'{word}'") }
}

/// The environment without its preset, and no more than both its chains have.
fn chain_flags(preset: &EngineEnvironment, roughness: &[f64], kernel: KernelKind) -> Result<String> {
    // All digits: a level of 0.134 is another file than one of 0.1339745962155614.
    let roughness: Vec<String> = roughness.iter().map(f64::to_string).collect();
    Ok(format!(
        "kiln env INPUT --out DIR{} --size {} --roughness {} --format {} --orientation {} --kernel {}",
        if preset.layout.is_cube() { String::new() } else { format!(" --layout {}", preset.layout) },
        preset.size,
        roughness.join(","),
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
    let mut flags = chain_flags(preset, &preset.level_roughness(preset.size, false), preset.kernel)?;
    flags += &format!(" --irradiance {}", preset.irradiance.name());
    if preset.irradiance == IrradianceKind::Cube {
        flags += &format!(" --irradiance-size {}", preset.irradiance_size);
        if let Some(own) = preset.irradiance_format {
            flags += &format!(" --irradiance-format {own}");
        }
    }
    if preset.sh != ShConvention::Kiln {
        flags += &format!(" --sh {}", preset.sh.name());
    }
    Ok(flags)
}

#[cfg(test)]
mod tests {
    use super::super::{Cli, Verb};
    use super::*;
    use clap::Parser;
    use kiln::recipe::{EnvironmentRecipe, TableRecipe};

    const QUIET: Console = Console { json: false, quiet: true };
    const INPUT: &str = "builtin:sky";

    /// A command's words as a shell parts them: blanks do, but not between quotes.
    fn words(command: &str) -> Vec<String> {
        let quoted = command.split('\'').enumerate();
        let marked: String =
            quoted.map(|(i, part)| if i % 2 == 1 { part.replace(' ', "\0") } else { part.to_owned() }).collect();
        marked.split(' ').map(|word| word.replace('\0', " ").replace("INPUT", INPUT)).collect()
    }

    fn verb(command: &str) -> Verb {
        Cli::try_parse_from(words(command)).unwrap_or_else(|e| panic!("{command}: {e}")).verb
    }

    /// What neither changes a map nor is in a preset's gift: where it lies, and the size of an irradiance that there is not.
    fn of_no_matter(recipe: EnvironmentRecipe) -> EnvironmentRecipe {
        let irradiance_size = if recipe.irradiance == IrradianceKind::Cube { recipe.irradiance_size } else { 0 };
        let irradiance_format = Some(recipe.format_of_irradiance());
        let (directory, specular_file, irradiance_file) = (String::new(), None, None);
        EnvironmentRecipe { directory, specular_file, irradiance_file, irradiance_size, irradiance_format, ..recipe }
    }

    #[test]
    fn the_flags_of_every_engine_are_its_preset() {
        for engine in ENGINES {
            let text = text(engine).unwrap();
            let commands = |start| text.lines().map(str::trim).filter(move |line| line.starts_with(start));
            let wanted: Vec<TableRecipe> = engine.tables.iter().map(|table| table.recipe(false).unwrap()).collect();
            let found = commands("kiln table ").map(|command| match verb(command) {
                Verb::Table(table) => table.recipe(&QUIET).unwrap().0,
                other => panic!("{other:?}"),
            });
            assert_eq!(found.collect::<Vec<_>>(), wanted, "{}", engine.name);
            let own = engine.environment_recipe(INPUT, false).unwrap();
            let wanted = own.into_iter().chain(engine.sheen_recipe(INPUT).unwrap()).map(of_no_matter);
            let found = commands("kiln env ").map(|command| match verb(command) {
                Verb::Env(env) => of_no_matter(env.recipe(INPUT, &QUIET).unwrap()),
                other => panic!("{other:?}"),
            });
            assert_eq!(found.collect::<Vec<_>>(), wanted.collect::<Vec<_>>(), "{}", engine.name);
        }
    }

    #[test]
    fn a_shell_takes_every_word_as_it_stands() {
        for command in ENGINES.iter().flat_map(|engine| engine.tables).map(|table| table_flags(table).unwrap()) {
            let bare: String = command.split('\'').step_by(2).collect();
            assert!(!bare.contains(|c| "()*?<>|&;$`\\\"#!{}[]~".contains(c)), "{command}");
        }
        assert_eq!((quoted("a:y/(1+y),b"), quoted("ggx.f82:*16")), ("'a:y/(1+y),b'".into(), "'ggx.f82:*16'".into()));
    }
}
