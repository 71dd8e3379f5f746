//! What was typed.

use pipeline::Options;
use std::path::PathBuf;

/// The film, and whether a log of it is kept.
pub struct Arguments {
    pub scene: PathBuf,
    /// The film's options without its file.
    pub options: Options,
    pub is_logged: bool,
}

impl Arguments {
    /// Reads the scene and pairs of a name and a value.
    pub fn parse(mut words: impl Iterator<Item = String>) -> Result<Self, String> {
        let scene = words.next().ok_or("which scene?")?.into();
        let mut arguments = Self { scene, options: Options::default(), is_logged: true };
        let options = &mut arguments.options;
        while let Some(name) = words.next() {
            let value = words.next().ok_or_else(|| format!("{name} needs a value"))?;
            let number = || value.parse::<u32>().map_err(|_| format!("{name} {value} is no whole number"));
            match name.as_str() {
                "--size" => options.size = Some(value.parse().map_err(|error| format!("--size {value}: {error}"))?),
                "--frames" => options.frames = Some(number()?),
                "--samples" => options.samples = Some(number()?),
                "--log" if value == "off" => arguments.is_logged = false,
                "--log" => return Err(format!("--log {value} is not off")),
                _ => return Err(format!("there is no {name}")),
            }
        }
        Ok(arguments)
    }
}
