//! The command: one file per verb, each parses, calls the library and prints.
//!
//! stdout carries results, stderr progress, warnings and errors. Exit 0 done, 1 failed, 2 usage, 3 verification failed.

mod adjustment;
mod arguments;
mod bake;
mod chain;
mod compare;
mod completions;
mod console;
mod convert;
mod engines;
mod env;
mod eval;
mod foreign;
mod furnace;
mod identify;
mod info;
mod list;
mod man;
mod packing;
mod shader;
mod show;
mod table;
mod verify;

use clap::{Parser, Subcommand};
use console::Console;
use kiln::{Error, Result};
use std::process::ExitCode;

/// Bakes the lookup tables of real-time rendering, prefilters environment maps, and proves both.
#[derive(Debug, Parser)]
#[command(name = "kiln", version, max_term_width = 120, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    global: Global,
}

#[derive(Debug, clap::Args)]
struct Global {
    /// Print results as JSON
    #[arg(long, global = true)]
    json: bool,
    /// No progress and no warnings
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Threads to compute with [default: one per core]; the bytes written do not depend on it
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Bake(bake::Bake),
    Table(table::Table),
    Env(env::Env),
    Eval(eval::Eval),
    Verify(verify::Verify),
    Identify(identify::Identify),
    Compare(compare::Compare),
    Info(info::Info),
    Show(show::Show),
    Shader(shader::Shader),
    Convert(convert::Convert),
    List(list::List),
    Completions(completions::Completions),
    Man(man::Man),
}

/// Parses the arguments, does what they say, and reports.
pub fn run() -> ExitCode {
    let cli = Cli::parse();
    let console = Console { json: cli.global.json, quiet: cli.global.quiet };
    match set_threads(cli.global.threads).and_then(|()| dispatch(&cli.verb, &console)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console.error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

fn dispatch(verb: &Verb, console: &Console) -> Result<()> {
    match verb {
        Verb::Bake(verb) => verb.run(console),
        Verb::Table(verb) => verb.run(console),
        Verb::Env(verb) => verb.run(console),
        Verb::Eval(verb) => verb.run(console),
        Verb::Verify(verb) => verb.run(console),
        Verb::Identify(verb) => verb.run(console),
        Verb::Compare(verb) => verb.run(console),
        Verb::Info(verb) => verb.run(console),
        Verb::Show(verb) => verb.run(console),
        Verb::Shader(verb) => verb.run(console),
        Verb::Convert(verb) => verb.run(console),
        Verb::List(verb) => verb.run(console),
        Verb::Completions(verb) => verb.run(console),
        Verb::Man(verb) => verb.run(console),
    }
}

/// More threads than this are a mistake.
const MOST_THREADS: usize = 1024;

fn set_threads(threads: Option<usize>) -> Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    if threads == 0 || threads > MOST_THREADS {
        return Err(Error::usage(format!("{threads} threads are not in 1..={MOST_THREADS}"), "leave --threads out"));
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .map_err(|e| Error::unsupported(format!("{threads} threads cannot be started: {e}"), "use fewer --threads"))
}
