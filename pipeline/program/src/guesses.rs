//! Options of other programs, and the corresponding options of this program.

use clap::{Arg, Command};

/// Options that users of other programs try, the option that a command must have for the advice to apply, and the
/// advice. With `None`, the advice applies to every command. The first row that applies is used.
const GUESSES: [(&[&str], Option<&str>, &str); 15] = [
    (&["width", "height", "resolution", "res"], Some("size"), "write --size WxH, such as --size 1280x720"),
    (&["quality", "crf", "quantizer"], Some("qscale"), "write --qscale Q, 1 (best) to 112 (smallest)"),
    (&["quality"], Some("preset"), "write --preset draft, good or final"),
    (&["audio", "sound", "music"], None, "films have no sound"),
    (&["spp", "rays"], Some("samples"), "write --samples N"),
    (&["samples"], Some("spp"), "write --spp N"),
    (&["start", "begin", "first"], Some("from"), "write --from K, a frame counted from 0"),
    (&["end", "last"], Some("to"), "write --to K, a frame counted from 0"),
    (&["duration", "seconds", "length"], Some("frames"), "write --frames N"),
    (&["exposure"], Some("set"), "write --set exposure=1.5"),
    (&["codec", "vcodec"], Some("also"), "films are MPEG-2; --also film.mp4 codes them as H.264 too"),
    (&["format", "container"], Some("output"), "the ending of -o FILE selects it, such as .mpg or .mp4"),
    (&["out", "outfile"], Some("output"), "write --output FILE"),
    (&["jobs", "cores"], Some("threads"), "write --threads N"),
    (&["force", "yes"], Some("overwrite"), "write --overwrite"),
];

/// Returns advice for a user who typed `--name`, which is not an option of `command`.
pub fn advice(name: &str, command: &Command) -> Option<&'static str> {
    let has = |name: &str| command.get_arguments().any(|option: &Arg| option.get_long() == Some(name));
    let holds = |needed: &Option<&str>| needed.is_none_or(has);
    let found = GUESSES.iter().find(|(names, needed, _)| names.contains(&name) && holds(needed));
    found.map(|(.., advice)| *advice)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Arguments;
    use clap::CommandFactory;

    #[test]
    fn advice_names_options_that_are_there_for_ones_that_are_not() {
        let program = Arguments::command();
        let command = |name: &str| program.get_subcommands().find(|one| one.get_name() == name).unwrap();
        assert_eq!(advice("width", command("render")), Some("write --size WxH, such as --size 1280x720"));
        assert_eq!(advice("width", command("join")), None);
        assert_eq!(advice("audio", command("join")), Some("films have no sound"));
        assert_eq!(advice("frobnicate", command("render")), None);
        for (names, needed, text) in GUESSES {
            let has = |command: &Command, name: &str| command.get_arguments().any(|one| one.get_long() == Some(name));
            let mut is_given = false;
            let mut is_built = false;
            for command in program.get_subcommands().filter(|one| needed.is_none_or(|needed| has(one, needed))) {
                is_built = true;
                is_given |= names.iter().any(|name| !has(command, name) && advice(name, command) == Some(text));
            }
            // Advice may be missing only if its option belongs to a feature that was not built.
            assert!(is_given || !is_built, "{text}");
        }
    }
}
