//! What was typed.

use render2mpeg::Options;
use std::path::PathBuf;

/// The film, and whether a log of it is kept.
pub struct Arguments {
    pub scene: PathBuf,
    /// The film's options without its file.
    pub options: Options,
    pub is_logged: bool,
    /// What is to be shown.
    pub figure: Figure,
    /// The cost that tiles have equal shares of: rays or time.
    pub cost: String,
    /// The way of records in the walk.
    pub records: String,
    /// Ranks of the walk beside one.
    pub ranks: usize,
}

/// What is to be shown.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// Ranks that share all work in turns.
    Replicated,
    /// Tiles on demand: the first frame.
    FirstFrame,
    /// Tiles on demand: a walk.
    Walk,
}

impl Arguments {
    /// Reads the scene and pairs of a name and a value.
    pub fn parse(mut words: impl Iterator<Item = String>) -> Result<Self, String> {
        let scene = words.next().ok_or("which scene?")?.into();
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
                "--samples" => options.samples = Some(number()?),
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
