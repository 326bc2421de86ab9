//! `kiln shader`: code for a file that is baked already.

use super::console::Console;
use clap::Args;
use kiln::Result;
use kiln::language::Language;
use std::path::PathBuf;

/// Print shader code that looks up a file that Kiln baked, from the certificate in it
#[derive(Debug, Args)]
pub struct Shader {
    /// A table, a cube of an environment, or a folder of one
    file: PathBuf,
    /// glsl, hlsl or wgsl
    #[arg(long, default_value = "glsl")]
    language: Language,
    /// What the names of functions begin with [default: the name of the file, or of an environment's folder]
    #[arg(long)]
    name: Option<String>,
}

impl Shader {
    pub fn run(&self, console: &Console) -> Result<()> {
        let shader = kiln::bake::shader_of(&self.file, self.name.as_deref()).map_err(|e| e.in_file(&self.file))?;
        let text = kiln::shader::combined(&shader, self.language);
        if console.json { console.print_json(&text) } else { console.print(&text) }
    }
}
