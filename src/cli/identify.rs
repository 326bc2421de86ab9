//! `kiln identify`: what a file holds that says nothing of itself.

use super::chain::ChainArgs;
use super::console::Console;
use clap::Args;
use kiln::Result;
use std::path::PathBuf;

/// Say what a cube chain holds: roughness per level, kernel, orientation, scale
#[derive(Debug, Args)]
#[command(
    after_help = "Without --source a chain is compared with its own level 0, which says nothing of its orientation. What does not fit \
                  well, or no better than something else, is unknown."
)]
pub struct Identify {
    /// Files that anybody made: .ktx2, .ktx, .dds, .env
    #[arg(required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    chain: ChainArgs,
}

impl Identify {
    pub fn run(&self, console: &Console) -> Result<()> {
        self.chain.run(&self.files, None, console).map(|_| ())
    }
}
