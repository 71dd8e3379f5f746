//! Reference of all commands and options in Markdown, for the page `docs/reference/options.md`.

use crate::args::Arguments;
use crate::lines::Event;
use clap::builder::StyledStr;
use clap::{Arg, Command, CommandFactory};
use render2mpeg::report::Report;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use std::collections::BTreeSet;
use std::fmt::Write;

/// Beginning of the page, before the commands.
const HEAD: &str = "# Commands and options

`cargo run -p render2mpeg-cli --example reference` writes this page from the program's own help; a test compares it.
Options may also come from a TOML file, by `--config`: the key is the option's name.

| Exit code | Meaning | The same command again |
|---|---|---|
| 0 | success | |
| 1 | a file that cannot be read or written, bad input, or a fault of the program | may work after the cause is removed |
| 2 | wrong arguments | always fails |
| 130, 143, 129 | ended by Ctrl-C, SIGTERM or SIGHUP; the video plays | continues with `--resume` |
";

/// Returns the page of commands, arguments and options in Markdown. Hidden commands and options are omitted.
#[must_use]
pub fn options_page() -> String {
    let mut program = Arguments::command();
    program.build();
    let mut page = HEAD.to_owned();
    let mut listed = BTreeSet::new();
    for command in program.get_subcommands().filter(|command| !command.is_hide_set() && command.get_name() != "help") {
        add_command(&mut page, command, &mut listed);
    }
    page
}

/// Returns the JSON Schema (draft 2020-12) of `report.json`.
#[must_use]
pub fn report_schema() -> Schema {
    schema_of::<Report>()
}

/// Returns the JSON Schema (draft 2020-12) of a line of `--progress json`.
#[must_use]
pub fn progress_schema() -> Schema {
    schema_of::<Event>()
}

/// Returns the schema of serialized values of type `T`.
fn schema_of<T: JsonSchema>() -> Schema {
    SchemaSettings::draft2020_12().for_serialize().into_generator().into_root_schema_for::<T>()
}

/// Adds a section with a table for each group of options, in the order of the help. Options that an earlier command
/// `listed` with the same meaning appear by name only.
fn add_command(page: &mut String, command: &Command, listed: &mut BTreeSet<(String, String)>) {
    let about = command.get_about().map(text_of).unwrap_or_default();
    let _ = write!(page, "\n## `render2mpeg {}`\n\n{about}\n", command.get_name());
    let (mut heading, mut again) = (None, Vec::new());
    for argument in arguments_of(command) {
        let (name, meaning) = (name_of(argument), meaning_of(argument));
        // List arguments by name if an earlier command explains them.
        if !listed.insert((name.clone(), meaning.clone())) {
            again.push(argument.get_long().map_or(name, |long| format!("--{long}")));
            continue;
        }
        // Begin a table for each group of options.
        let group = argument.get_help_heading().unwrap_or("Argument");
        if heading != Some(group) {
            let _ = write!(page, "\n| {group} | Meaning |\n|---|---|\n");
            heading = Some(group);
        }
        let _ = writeln!(page, "| `{name}` | {meaning} |");
    }
    if !again.is_empty() {
        let _ = write!(page, "\nAs above:\n\n```text\n{}\n```\n", again.join(" "));
    }
}

/// Returns the arguments of a command that its help shows, except the help option.
fn arguments_of(command: &Command) -> impl Iterator<Item = &Arg> {
    command.get_arguments().filter(|argument| !argument.is_hide_set() && argument.get_id() != "help")
}

/// Returns the short and long name of an argument, with the names of its values as typed.
fn name_of(argument: &Arg) -> String {
    let mut names = Vec::new();
    names.extend(argument.get_short().map(|short| format!("-{short}")));
    names.extend(argument.get_long().map(|long| format!("--{long}")));
    let takes_value = argument.get_action().takes_values();
    let values = argument.get_value_names().filter(|_| takes_value).map(|names| names.join(" "));
    let value = values.map(|values| format!("<{values}>"));
    let words: Vec<String> = [names.join(", ")].into_iter().chain(value).filter(|text| !text.is_empty()).collect();
    // Escape vertical bars, which would end the table cell.
    words.join(" ").replace('|', "\\|")
}

/// Returns the help of an argument, and its possible values with help.
fn meaning_of(argument: &Arg) -> String {
    let help = argument.get_long_help().or(argument.get_help());
    let mut meaning = help.map(text_of).unwrap_or_default();
    // List the values to choose from.
    if argument.get_action().takes_values() && !argument.is_hide_possible_values_set() {
        for value in argument.get_possible_values().iter().filter(|value| !value.is_hide_set()) {
            let _ = write!(meaning, "<br>`{}`", value.get_name());
            if let Some(help) = value.get_help() {
                let _ = write!(meaning, ": {}", text_of(help));
            }
        }
    }
    meaning
}

/// Returns a help text as one line, with the special characters of tables escaped.
fn text_of(help: &StyledStr) -> String {
    let words = help.to_string();
    words.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}
