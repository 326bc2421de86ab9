//! `kiln man`: the manual, of the same definitions as the help.

use super::console::Console;
use clap::{Args, Command, CommandFactory};
use clap_mangen::Man as Page;
use kiln::format::atomic::Staged;
use kiln::{Error, Result};
use std::path::{Path, PathBuf};

/// Print the manual page of the command, or write one page per verb into a folder
#[derive(Debug, Args)]
pub struct Man {
    /// Folder for kiln.1 and a page per verb, such as ~/.local/share/man/man1
    folder: Option<PathBuf>,
}

impl Man {
    pub fn run(&self, console: &Console) -> Result<()> {
        // `help` has no page of its own to refer to.
        let mut command = super::Cli::command().disable_help_subcommand(true);
        command.build();
        let Some(folder) = &self.folder else {
            let (_, page) = page(&command)?;
            return console.print(&String::from_utf8_lossy(&page));
        };
        std::fs::create_dir_all(folder).map_err(|e| Error::writing(folder, e))?;
        let mut staged = Staged::default();
        for described in std::iter::once(&command).chain(command.get_subcommands()) {
            let (name, page) = page(described)?;
            staged.add(&folder.join(&name), &page)?;
        }
        staged.commit()
    }
}

/// The file name and the text of a page: `kiln.1`, `kiln-table.1`.
fn page(command: &Command) -> Result<(String, Vec<u8>)> {
    let name = command.get_display_name().unwrap_or(command.get_name()).to_owned();
    let mut roff = vec![];
    Page::new(command.clone())
        .title(name.to_uppercase())
        .section("1")
        .source(concat!("kiln ", env!("CARGO_PKG_VERSION")))
        .render(&mut roff)
        .map_err(|e| Error::writing(Path::new("the manual"), e))?;
    Ok((format!("{name}.1"), roff))
}
