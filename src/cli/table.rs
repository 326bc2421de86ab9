//! `kiln table`: one table.

use super::arguments::{
    Channels, EngineArgs, FitName, IntegrationArgs, ModelArgs, ParameterArgs, ShaderArgs, no_own_numbers,
};
use super::console::Console;
use super::packing::{Packed, warn_of_packing};
use clap::Args;
use kiln::certificate::Certificate;
use kiln::format::{Container, FormatSpec};
use kiln::language::Language;
use kiln::math::warp::Warp;
use kiln::recipe::{ArrayRecipe, TableRecipe};
use kiln::table::{Axis, Layout, Point, named};
use kiln::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

static AFTER_HELP: LazyLock<String> = LazyLock::new(|| {
    format!(
        "Axes: PARAMETER[:SIZE][:LOW..HIGH][:WARP][:centre|edge][:flip], x first, then y, then z, such as\n  \
         --axes mu:64:sqrt:edge,roughness:32:flip\n  \
         --axes mu:16,alpha:16,eta:16:1..2.5\n\
         The smallest value comes first, texels are centres, unless axes say otherwise.\n\
         Warps, the function of the parameter in which texels are even:\n  {}",
        Warp::SYNTAX
    )
});

/// Bake one table
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP.as_str())]
pub struct Table {
    /// Which table: see `kiln list tables`
    name: String,
    #[command(flatten)]
    engine: EngineArgs,
    /// File to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Texels along the axes, such as 64x64 or 16x16x16
    #[arg(long, value_name = "WxHxD")]
    size: Option<String>,
    /// Container and number format, such as exr:f32, ktx2:rg16f: see `kiln list formats` [default: by the file's extension]
    #[arg(long)]
    format: Option<FormatSpec>,
    /// Axes, one to three, x first
    #[arg(long, value_name = "AXIS", value_delimiter = ',')]
    axes: Vec<Axis>,
    /// What texels are chosen for
    #[arg(long, value_enum, default_value = "none")]
    fit: FitName,
    /// How the slices of three axes are arranged: volume, slices, atlas or atlas:COLUMNS [default: volume where the format has it, slices in an EXR, else atlas]
    #[arg(long)]
    layout: Option<Layout>,
    /// Quantities, one per channel, instead of the table's own: see `kiln list quantities`
    #[arg(long, value_name = "QUANTITY,…")]
    channels: Option<Channels>,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten, next_help_heading = "Parameters that no axis varies")]
    parameters: ParameterArgs,
    #[command(flatten)]
    integration: IntegrationArgs,
    #[command(flatten)]
    shader: ShaderArgs,
}

impl Table {
    pub fn run(&self, console: &Console) -> Result<()> {
        let (recipe, folder) = self.recipe(console)?;
        let certificate = bake_table(&recipe, &folder, &self.shader.languages(), console)?;
        if console.json { console.print_json(&certificate) } else { Ok(()) }
    }

    pub(super) fn recipe(&self, console: &Console) -> Result<(TableRecipe, PathBuf)> {
        let preset = match self.engine.engine(console)? {
            Some(engine) => Some((engine, engine.table(&self.name)?)),
            None => None,
        };
        let mut recipe = match preset {
            Some((_, table)) => {
                let recipe = table.recipe(self.engine.as_shipped)?;
                let own =
                    self.format.is_none() && self.output.extension().is_some_and(|e| e == recipe.format.extension());
                let format = if own { recipe.format } else { self.format(recipe.channels.len())? };
                TableRecipe { format, ..recipe }
            }
            None => {
                let n_channels = match self.channels.as_ref().map_or(0, |channels| channels.0.len()) {
                    0 => named::find(&self.name)?.channels.len(),
                    n => n,
                };
                TableRecipe::named(&self.name, self.format(n_channels)?)?
            }
        };
        if let Some(Channels(channels)) = &self.channels {
            recipe.channels.clone_from(channels);
        }
        recipe.axes = self.axes(&recipe.axes)?;
        recipe.model = self.model.over(recipe.model);
        recipe.at = self.point(&recipe)?;
        recipe.layout = self.layout.or(recipe.layout);
        recipe.fit = self.fit.into();
        recipe.integration = self.integration.over(recipe.integration);
        if let Some((engine, table)) = preset {
            if self.engine.as_shipped && table.as_shipped.is_none() {
                console.warn(&no_own_numbers(&format!("{}'s {}", engine.name, table.name)));
            }
            for departure in engine.table_departures(table, &recipe, self.engine.as_shipped)? {
                console.warn(&departure);
            }
        }
        let name = self.output.file_name().and_then(|n| n.to_str()).ok_or_else(|| {
            Error::usage(format!("{} names no file", self.output.display()), "give a file name such as -o dfg.ktx2")
        })?;
        name.clone_into(&mut recipe.file);
        let folder = self.output.parent().map(Path::to_owned).unwrap_or_default();
        Ok((recipe, folder))
    }

    /// The given values, and the table's own where they still mean something.
    fn point(&self, recipe: &TableRecipe) -> Result<Point> {
        let spec = recipe.spec()?;
        let own = recipe
            .at
            .given()
            .filter(|(p, _)| !spec.varies(*p) && spec.channels.iter().any(|channel| channel.quantity.depends_on(*p)));
        self.parameters.over(own)
    }

    fn format(&self, n_channels: usize) -> Result<FormatSpec> {
        let extension = self.output.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        let container = Container::of_extension(&extension);
        if let Some(format) = self.format {
            if container.is_some() && extension != format.extension() {
                return Err(Error::usage(
                    format!("{} is not a file of format {format}", self.output.display()),
                    format!("call it something.{}, or leave --format out", format.extension()),
                ));
            }
            return Ok(format);
        }
        let container = container.ok_or_else(|| {
            Error::usage(
                format!("{} does not say which format it is to have", self.output.display()),
                "give --format, such as exr:f32 or ktx2:rg16f",
            )
        })?;
        FormatSpec::usual(container, n_channels)
    }

    /// The table's own axes, or the given ones; sizes by `--size`, else by the axis, else the table's own.
    fn axes(&self, own: &[Axis]) -> Result<Vec<Axis>> {
        let mut axes = if self.axes.is_empty() { own.to_vec() } else { self.axes.clone() };
        if let Some(text) = &self.size {
            if self.axes.iter().any(|a| a.size != 0) {
                return Err(Error::usage("sizes are given both by --size and by --axes", "give them once"));
            }
            let sizes = parse_size(text)?;
            let sizes = if sizes.len() == 1 { vec![sizes[0]; axes.len()] } else { sizes };
            if sizes.len() != axes.len() {
                return Err(Error::usage(
                    format!("size {text} is for {} axes, and the table has {}", sizes.len(), axes.len()),
                    format!("use --size {}", vec!["64"; axes.len()].join("x")),
                ));
            }
            for (axis, size) in axes.iter_mut().zip(sizes) {
                axis.size = size;
            }
        } else if !self.axes.is_empty() {
            for axis in &mut axes {
                if axis.size == 0 {
                    let same = own.iter().find(|a| a.parameter.canonical() == axis.parameter.canonical());
                    axis.size = same.map_or(64, |a| a.size);
                }
            }
        }
        Ok(axes)
    }
}

/// `64x32` → 64, 32.
fn parse_size(text: &str) -> Result<Vec<usize>> {
    text.split(['x', 'X', '×'])
        .map(|part| {
            part.trim().parse().map_err(|_| {
                Error::usage(format!("size {text:?} is not of whole numbers"), "write it like --size 64x64")
            })
        })
        .collect()
}

/// Bakes a table below `folder`, with code in `languages`, and says what became of it.
pub fn bake_table(
    recipe: &TableRecipe,
    folder: &Path,
    languages: &[Language],
    console: &Console,
) -> Result<Certificate> {
    let spec = recipe.spec()?;
    spec.check()?;
    let bar = console.progress(spec.len() as u64, &recipe.file);
    let baked = kiln::bake::table(recipe, &|n| bar.inc(n));
    bar.finish_and_clear();
    let mut baked = baked?;
    baked.add_shader(languages)?;
    let paths = baked.write(folder)?;
    report(console, &baked.certificate, recipe, &paths)?;
    Ok(baked.certificate)
}

/// Bakes an array texture below `folder`, and says what became of each layer.
pub fn bake_array(recipe: &ArrayRecipe, folder: &Path, console: &Console) -> Result<Vec<Certificate>> {
    recipe.check()?;
    let tables = recipe.tables();
    let specs = tables.iter().map(TableRecipe::spec).collect::<Result<Vec<_>>>()?;
    let bar = console.progress(specs.iter().map(|spec| spec.len() as u64).sum(), &recipe.file);
    let baked = kiln::bake::array(recipe, &|n| bar.inc(n));
    bar.finish_and_clear();
    let baked = baked?;
    let paths = baked.write(folder)?;
    for (i, (table, certificate)) in tables.iter().zip(&baked.certificates).enumerate() {
        let layer = format!("{}, layer {i}", paths.first().map_or(folder, PathBuf::as_path).display());
        report(console, certificate, table, &[layer.into()])?;
    }
    Ok(baked.certificates)
}

/// Says what was written and how wrong it may be.
fn report(console: &Console, certificate: &Certificate, recipe: &TableRecipe, paths: &[PathBuf]) -> Result<()> {
    let Some(path) = paths.first() else { return Ok(()) };
    let errors: Vec<String> = certificate
        .channels
        .iter()
        .map(|c| format!("{} ±{:.0e} ({}, {})", c.quantity, c.max_error, c.integrator, c.error_kind.name()))
        .collect();
    console.note(&format!("{}: {}; {} checks passed", path.display(), errors.join(", "), certificate.checks.len()));
    for found in &certificate.approximation {
        console.note(&format!(
            "{}: of the light, at most {:.3} goes elsewhere than it should (at {}), {:.3} on the mean: what the model leaves",
            found.channels, found.max_total_variation, found.worst_at, found.mean_total_variation
        ));
    }
    for fit in &certificate.fit {
        let ([before, after], channel) = ([&fit.exact, &fit.fitted].map(|e| [e.rms, e.max]), &fit.exact.channel);
        let [rms, max] = [0, 1].map(|i| format!("{:.1e} instead of {:.1e}", after[i], before[i]));
        let fate = if fit.kept { "" } else { "; exact texels are kept" };
        console.note(&format!("{channel} through bilinear filtering: RMS {rms}, at most {max}{fate}"));
    }
    let [width, height, _] = recipe.arrangement()?.size;
    if let Some(warning) = recipe.format.size_warning([width, height]) {
        console.warn(&format!("{}: {warning}", path.display()));
    }
    let packed = Packed::Table(recipe.channels.len());
    warn_of_packing(console, &path.display().to_string(), recipe.format, packed, &certificate.packing)
}
