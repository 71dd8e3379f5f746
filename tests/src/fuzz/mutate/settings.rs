//! Changes of a scene's settings file.

use super::{Draft, Mutation};
use crate::Random;

/// Changes of this module.
pub(super) const MUTATIONS: [Mutation; 3] = [("settings", settings), ("settings", settings), ("settings text", text)];

/// Tables with one key each; `#` represents a number, `@` a text.
const LINES: [&str; 24] = [
    "[sky]\nzenith = [#, 1, 1]\nhorizon = [1, #, 1]",
    "[sky]\nzenith = [1, 1, 1]\nhorizon = [1, 1, 1]\nintensity = #",
    "[sky]\nzenith = [0, 0, 0]\nhorizon = [0, 0, 0]\nground = [#, #, #]",
    "[sky]\nimage = @",
    "[sky]\nimage = @\nrotation = #",
    "[sun]\nangular_diameter = #",
    "[camera]\nname = @",
    "[animation]\nname = @",
    "[video]\nframes = #",
    "[video]\nfps = #",
    "[importance]\nnodes = [@, @]",
    "[importance]\nviewing_distance = #",
    "[importance]\nscreen_width = #",
    "[tone_mapping]\noperator = \"filmic\"\nexposure = #",
    "[tone_mapping]\noperator = \"gamma\"\ngamma = #",
    "[tone_mapping]\noperator = \"extended_reinhard\"\nwhite = #",
    "[tone_mapping]\noperator = \"clamp\"\nexposure = #",
    "[tone_mapping]\noperator = @",
    "[tone_mapping]\nexposure = @",
    "[tone_mapping]\ndisplay = @",
    "[@]\na = #",
    "@ = #",
    "sky = #",
    "[video",
];

/// Numbers in TOML syntax.
const NUMBERS: [&str; 20] = [
    "0",
    "1",
    "-1",
    "0.5",
    "2.0",
    "24",
    "25",
    "29.97",
    "90",
    "91",
    "1e-45",
    "1e-20",
    "1e10",
    "1e15",
    "1e20",
    "1e38",
    "nan",
    "inf",
    "-0.0",
    "9223372036854775807",
];

/// Texts in TOML syntax.
const TEXTS: [&str; 11] = [
    "\"\"",
    "\"camera\"",
    "\"first\"",
    "\"gamma\"",
    "\"two\\nlines \\u001B[31m\"",
    "\"../scene/scene.glb\"",
    "\"scene.glb\"",
    "\"/dev/zero\"",
    "\"%2e%2e/x.hdr\"",
    "'\\'",
    "\"\\u202E\"",
];

/// Adds a table with values at the limits of the allowed range, or replaces the settings by it.
fn settings(draft: &mut Draft, random: &mut Random) -> Option<()> {
    // Fill a random line with random numbers and texts.
    let mut line = String::new();
    for c in random.pick(&LINES).chars() {
        match c {
            '#' => line += *random.pick(&NUMBERS),
            '@' => line += *random.pick(&TEXTS),
            c => line.push(c),
        }
    }
    draft.toml = if random.one_in(2) { format!("{line}\n") } else { format!("{}\n{line}\n", draft.toml) };
    Some(())
}

/// Replaces a character of the settings.
fn text(draft: &mut Draft, random: &mut Random) -> Option<()> {
    let mut letters: Vec<char> = draft.toml.chars().collect();
    if letters.is_empty() {
        return None;
    }
    let place = random.below(letters.len());
    letters[place] = *random.pick(&['"', '[', ']', '=', '\n', '#', '9', '-', '\u{1b}', '\0', 'ü', '\'']);
    draft.toml = letters.into_iter().collect();
    Some(())
}
