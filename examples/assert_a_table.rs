//! How an engine's own tests assert that the table it ships is right: in a sentence, without running Kiln's command.
//!
//! `cargo run --example assert_a_table` makes a table as an engine might have it, then judges it, then breaks it and shows the message.

use kiln::format::{Texture, ktx2};
use kiln::integrate::{Integration, Settings};
use kiln::pack::{Number, TexelFormat};
use kiln::table::{Axis, Model, Parameter, Point, TableSpec, quantity};
use kiln::verify;
use std::error::Error;
use std::path::Path;

/// Stands for the engine's asset: 32 × 32 half floats, the cosine along x, the roughness downwards.
fn write_asset(path: &Path, brighter: f64) -> Result<(), Box<dyn Error>> {
    let spec = TableSpec {
        channels: vec![quantity::find("ggx.scale")?, quantity::find("ggx.bias")?],
        axes: vec![Axis::new(Parameter::Mu, 32), Axis::new(Parameter::Roughness, 32)],
        at: Point::default(),
        model: Model::default(),
    };
    let mut values = spec.bake(&Integration::new(Settings::default())?, &|_| {})?.values;
    values[2 * (10 * 32 + 3)] += brighter;
    let (texture, _) = Texture::flat(TexelFormat::new(2, Number::F16)?, 32, 32, &values)?;
    std::fs::write(path, ktx2::encode(&texture)?)?;
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let asset = folder.path().join("dfg.ktx2");

    write_asset(&asset, 0.0)?;
    verify::that_file(&asset)?.holds("dfg")?.within(5e-4)?;

    // The same said in full; and what a shader sees between the texels, which is mostly the axes' fault.
    verify::that_file(&asset)?
        .over(&["mu", "roughness"])?
        .holds_quantities(&["ggx.scale", "ggx.bias"])?
        .within(5e-4)?
        .filtered_within(0.12)?;

    write_asset(&asset, 0.01)?;
    let judged = verify::that_file(&asset)?.holds("dfg")?;
    let Err(failure) = judged.within(5e-4) else { return Err("a broken table passed".into()) };
    eprintln!("{failure}");
    Ok(())
}
