//! Command-line arguments.

use render2mpeg::Options;
use renderer::settings::SampleCount;
use std::path::PathBuf;

/// The scene and options of the film, and the requested figure.
pub struct Arguments {
    pub scene: PathBuf,
    /// Options of the film, without its file.
    pub options: Options,
    pub is_logged: bool,
    /// The requested figure.
    pub figure: Figure,
    /// The cost that is equal in all tiles: rays or time.
    pub cost: String,
    /// Exchange of records in the walk: none, central or each.
    pub records: String,
    /// Number of ranks of the walk, in addition to one rank.
    pub ranks: usize,
}

/// A figure to print.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// Ranks that share all work in rounds.
    Replicated,
    /// Tiles on demand, in the first frame.
    FirstFrame,
    /// Tiles on demand, in a walk.
    Walk,
}

impl Arguments {
    /// Parses the scene, then pairs of a name and a value.
    pub fn parse(mut words: impl Iterator<Item = String>) -> Result<Self, String> {
        let scene = words.next().ok_or("which scene?")?.into();
        // The defaults.
        let mut arguments = Self {
            scene,
            options: Options::default(),
            is_logged: true,
            figure: Figure::Replicated,
            cost: "rays".into(),
            records: "each:16".into(),
            ranks: 16,
        };
        let options = &mut arguments.options;
        while let Some(name) = words.next() {
            let value = words.next().ok_or_else(|| format!("{name} needs a value"))?;
            let number = || value.parse::<u32>().map_err(|_| format!("{name} {value} is no whole number"));
            match name.as_str() {
                "--size" => options.size = Some(value.parse().map_err(|error| format!("--size {value}: {error}"))?),
                "--frames" => options.frames = Some(number()?),
                "--samples" => options.samples = Some(SampleCount::Each(number()?)),
                "--importance" => options.importance = Some(value.parse().map_err(|error| format!("{error}"))?),
                "--tiles" if value == "first-frame" => arguments.figure = Figure::FirstFrame,
                "--tiles" if value == "walk" => arguments.figure = Figure::Walk,
                "--tiles" => return Err(format!("--tiles {value} is neither first-frame nor walk")),
                "--cost" if ["rays", "time"].contains(&&*value) => arguments.cost = value,
                "--cost" => return Err(format!("--cost {value} is neither rays nor time")),
                "--records" => arguments.records = value,
                "--ranks" => arguments.ranks = number()?.max(1) as usize,
                "--log" if value == "off" => arguments.is_logged = false,
                "--log" => return Err(format!("--log {value} is not off")),
                _ => return Err(format!("there is no {name}")),
            }
        }
        Ok(arguments)
    }
}
