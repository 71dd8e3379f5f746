//! `--config job.toml`: reads options from a file, under their command-line names. Options typed on the command line
//! win.

use super::args::Arguments;
use super::{features, foreign, guesses, ranks};
use anyhow::{Context, Result, anyhow, bail};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{ArgAction, ArgMatches, Command, CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Options that files may not contain, because they belong to a single invocation rather than to a film.
const NOT_IN_FILES: [&str; 12] = [
    "allow-outside",
    "config",
    "display-server",
    "print-config",
    "resume",
    "help",
    "verbose",
    "quiet",
    "progress",
    "overwrite",
    "watch",
    "keep-checkpoint",
];

/// Parses the arguments, with defaults from the `--config` file. If arguments are wrong, ends the program with a hint.
///
/// # Errors
/// If the file cannot be read, has an unknown option or value, or has an option of another program.
pub fn parse(typed: Vec<OsString>) -> Result<Arguments> {
    let typed = with_command(typed);
    // Report a missing feature first, because a build without it may not parse the command.
    if let Some(command) = typed.get(1).and_then(|word| word.to_str()) {
        features::need_for(command)?;
    }
    let command = Arguments::command().long_version(features::version());
    // Parse the typed words, with advice on options of other programs.
    let matches = match command.clone().try_get_matches_from(&typed) {
        Ok(matches) => matches,
        Err(error) => match guess(&error, &command, &typed) {
            Some(advice) => bail!(advice),
            None => end(&error),
        },
    };

    // Parse again with the options of the file, if one is named.
    let with_file = match matches.subcommand() {
        Some((name, options)) => match file_named_by(options) {
            Some(path) => Some(with_file(&command, name, options, &path, &typed)?),
            None => None,
        },
        None => None,
    };
    let matches = with_file.map_or(matches, |words| matches_of(command, &words));
    Ok(Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit()))
}

/// Parses `words`. If arguments are wrong, ends the program with a hint; if help is requested, ends it with the help.
fn matches_of(command: Command, words: &[OsString]) -> ArgMatches {
    command.try_get_matches_from(words).unwrap_or_else(|error| end(&error))
}

/// Ends the program with the error or the requested help. Only one of several ranks prints the text.
fn end(error: &clap::Error) -> ! {
    if ranks::is_silent() {
        std::process::exit(error.exit_code());
    }
    error.exit()
}

/// Inserts the default command, so that `render2mpeg scene.glb` means `render2mpeg render scene.glb`.
fn with_command(mut typed: Vec<OsString>) -> Vec<OsString> {
    if typed.get(1).and_then(|word| word.to_str()).is_some_and(foreign::is_scene) {
        typed.insert(1, "render".into());
    }
    typed
}

/// Returns advice if `error` reports an option known from another program.
fn guess(error: &clap::Error, command: &Command, typed: &[OsString]) -> Option<String> {
    if error.kind() != ErrorKind::UnknownArgument {
        return None;
    }
    let Some(ContextValue::String(option)) = error.get(ContextKind::InvalidArg) else { return None };
    let own = command.get_subcommands().find(|one| typed.get(1).is_some_and(|word| word == one.get_name()))?;
    let advice = guesses::advice(option.strip_prefix("--")?, own)?;
    Some(format!("there is no option {option}: {advice}"))
}

/// Returns the path of the `--config` file, if given.
fn file_named_by(options: &ArgMatches) -> Option<PathBuf> {
    options.try_get_one::<PathBuf>("config").ok().flatten().cloned()
}

/// Returns the command line with the file's options before the typed ones, because later options win.
fn with_file(
    command: &Command,
    name: &str,
    options: &ArgMatches,
    path: &Path,
    typed: &[OsString],
) -> Result<Vec<OsString>> {
    // Read the file, and report the line of a syntax error.
    let place = path.display();
    let text = std::fs::read_to_string(path).with_context(|| format!("{place} cannot be read"))?;
    let table: Table = text.parse().map_err(|error: toml::de::Error| {
        let line = error.span().map_or(1, |span| text[..span.start].lines().count().max(1));
        anyhow!("{place}: line {line}: {}", error.message())
    })?;

    // Accept the options of `render` in every file, so that commands can share a file.
    let has_scene = options.contains_id("scene");
    let named = |name: &str| command.get_subcommands().find(|one| one.get_name() == name).expect("a known command");
    let (own, all) = (named(name), named("render"));
    let mut words: Vec<String> = Vec::new();
    let mut scene = None;
    for (key, value) in &table {
        if key == "scene" {
            let path = value.as_str().with_context(|| format!("{place}: scene = {value}: expected a path"))?;
            scene = Some(path.to_owned());
            continue;
        }
        if option(all, key).is_none() && option(own, key).is_none() {
            let advice =
                guesses::advice(key, own).map_or_else(|| format!("did you mean {}?", nearest(key, all)), str::to_owned);
            bail!("{place}: there is no option {key}: {advice}");
        }
        if let Some(option) = option(own, key) {
            words.extend(words_of(option, key, value).with_context(|| format!("{place}: {key} = {value}"))?);
        }
    }
    // Require a scene from either source.
    if !has_scene && scene.is_none() {
        bail!("{place}: no scene; add scene = \"FILE.glb\", or name one on the command line");
    }
    // Parse the file's options separately first, to attribute errors to the file.
    let head = [typed[0].clone(), name.into()];
    let alone = words.iter().cloned().chain(scene.clone().or_else(|| Some("scene".into())));
    if let Err(error) = command.clone().try_get_matches_from(head.iter().cloned().chain(alone.map(OsString::from))) {
        let text = error.to_string();
        let first = text.lines().next().unwrap_or_default();
        bail!("{place}: {}", first.strip_prefix("error: ").unwrap_or(first));
    }

    // Append the typed words last, so that they win.
    words.extend(scene.filter(|_| !has_scene));
    let mut whole = Vec::from(head);
    whole.extend(words.into_iter().map(OsString::from));
    whole.extend(typed.iter().skip(2).cloned());
    Ok(whole)
}

/// Returns the option named `key`, if files may contain it.
fn option<'a>(command: &'a Command, key: &str) -> Option<&'a clap::Arg> {
    command.get_arguments().find(|option| option.get_long() == Some(key) && !NOT_IN_FILES.contains(&key))
}

/// Returns an option's value as command-line words; no words for a flag that is off.
fn words_of(option: &clap::Arg, key: &str, value: &Value) -> Result<Vec<String>> {
    let is_flag = matches!(option.get_action(), ArgAction::SetTrue);
    let plain = |value: &Value| match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(_) | Value::Float(_) => Ok(value.to_string()),
        Value::Boolean(on) => Ok(if *on { "on" } else { "off" }.into()),
        _ => bail!("expected a string, a number, true or false"),
    };
    // Flags have no value. Lists are joined by commas, or repeat the option.
    match (value, is_flag) {
        (Value::Boolean(on), true) => Ok(on.then(|| format!("--{key}")).into_iter().collect()),
        (_, true) => bail!("expected true or false"),
        (Value::Array(list), false) => {
            let list: Vec<String> = list.iter().map(plain).collect::<Result<_>>()?;
            let is_repeated =
                matches!(option.get_action(), ArgAction::Append) && option.get_value_delimiter().is_none();
            let words = if is_repeated || list.is_empty() { list } else { vec![list.join(",")] };
            Ok(words.into_iter().map(|word| format!("--{key}={word}")).collect())
        }
        (_, false) => Ok(vec![format!("--{key}={}", plain(value)?)]),
    }
}

/// Returns the name of the option with the smallest edit distance to `key`.
fn nearest(key: &str, command: &Command) -> String {
    let names = command.get_arguments().filter_map(|option| option.get_long());
    let known = names.filter(|name| !NOT_IN_FILES.contains(name)).chain(["scene"]);
    known.min_by_key(|name| strsim::levenshtein(key, name)).unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_lead_to_the_nearest_name() {
        let command = Arguments::command();
        let render = command.get_subcommands().find(|one| one.get_name() == "render").unwrap();
        assert_eq!(nearest("q_scale", render), "qscale");
        assert_eq!(nearest("frame", render), "frames");
        assert_eq!(nearest("bit-rate", render), "bitrate");
    }

    #[test]
    fn values_become_what_is_typed() {
        let command = Arguments::command();
        let render = command.get_subcommands().find(|one| one.get_name() == "render").unwrap();
        let typed = |key: &str, value: Value| words_of(option(render, key).unwrap(), key, &value);
        assert_eq!(typed("qscale", Value::Integer(4)).unwrap(), ["--qscale=4"]);
        assert_eq!(typed("cache", Value::Boolean(false)).unwrap(), ["--cache=off"]);
        assert_eq!(typed("cbr", Value::Boolean(true)).unwrap(), ["--cbr"]);
        assert!(typed("cbr", Value::Boolean(false)).unwrap().is_empty());
        assert_eq!(typed("aov", vec!["albedo", "depth"].into()).unwrap(), ["--aov=albedo,depth"]);
        assert_eq!(
            typed("set", vec!["fps=5", "zenith=[1,2,3]"].into()).unwrap(),
            ["--set=fps=5", "--set=zenith=[1,2,3]"]
        );
        assert!(typed("cbr", Value::Integer(1)).is_err() && typed("size", Value::Table(Table::new())).is_err());
        assert!(option(render, "config").is_none() && option(render, "resume").is_none());
    }
}
