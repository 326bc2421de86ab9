//! `kiln completions`: what a shell needs to complete the command's arguments.

use super::console::Console;
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use kiln::Result;

/// Print completions for a shell
#[derive(Debug, Args)]
#[command(after_help = "For this session of bash: source <(kiln completions bash)\nFor good: kiln completions bash > \
                  ~/.local/share/bash-completion/completions/kiln\nzsh: into a file _kiln in a folder of $fpath; fish: \
                  into ~/.config/fish/completions/kiln.fish")]
pub struct Completions {
    /// Which shell
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    pub fn run(&self, console: &Console) -> Result<()> {
        let mut script = vec![];
        clap_complete::generate(self.shell, &mut super::Cli::command(), "kiln", &mut script);
        console.print(&String::from_utf8_lossy(&script))
    }
}
