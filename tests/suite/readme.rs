//! The README shows real output of real commands: this runs every one of them.

use crate::support::kiln::kiln;

/// The console blocks: commands with what they print.
fn commands(readme: &str) -> Vec<(String, String)> {
    let mut commands: Vec<(String, String)> = vec![];
    let mut inside = false;
    for line in readme.lines() {
        match line {
            "```console" => inside = true,
            "```" => inside = false,
            _ if !inside => {}
            _ => match line.strip_prefix("$ ") {
                Some(command) => commands.push((command.to_owned(), String::new())),
                None => {
                    let (_, output) = commands.last_mut().expect("a block begins with a command");
                    *output += line;
                    *output += "\n";
                }
            },
        }
    }
    commands
}

#[test]
fn every_command_of_the_readme_prints_what_it_shows() {
    let readme = include_str!("../../README.md");
    let commands = commands(readme);
    assert!(commands.len() >= 5, "only {} commands", commands.len());
    let folder = tempfile::tempdir().expect("a folder");
    for (command, shown) in commands {
        let mut words = command.split_whitespace().map(|word| word.trim_matches('"'));
        assert_eq!(words.next(), Some("kiln"), "{command}");
        let run = kiln(folder.path(), &words.collect::<Vec<_>>());
        assert_eq!(run.code, 0, "$ {command}\n{}", run.stderr);
        let printed = run.stdout + &run.stderr;
        // The README was written where there is AVX2; the name of the instructions is all that differs elsewhere.
        let shown = shown.replace("AVX2", kiln::environment::InstructionSet::detect().name());
        assert_eq!(printed.trim_end(), shown.trim_end(), "$ {command}");
    }
}
