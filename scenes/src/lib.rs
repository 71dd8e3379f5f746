#![doc = include_str!("../README.md")]

pub mod animation;
pub mod arches;
pub mod atrium;
mod buffer;
pub mod cloth;
pub mod columns;
pub mod conference;
pub mod cornell;
pub mod glass;
pub mod glb;
pub mod mesh;
pub mod nave;
pub mod noise;
pub mod patterns;
pub mod pictures;
pub mod shapes;
pub mod stone;
pub mod texture;
pub mod toml;
pub mod wood;

use glb::Scene;
use toml::Settings;

/// A scene that ships with the project.
#[derive(Clone, Copy, Debug)]
pub struct Shipped {
    /// Name of the scene, its folder and its files.
    pub name: &'static str,
    /// Function that builds the scene.
    pub build: fn() -> Scene,
    /// Content of the scene's settings file.
    pub settings: Settings,
}

/// Returns the number of frames of an animation at 25 frames per second. `duration` is in seconds.
const fn frames(duration: f32) -> u32 {
    (duration * 25.0) as u32
}

/// All shipped scenes.
pub const SCENES: &[Shipped] = &[
    Shipped {
        name: "cornell",
        build: cornell::build,
        settings: Settings { exposure: 1.0, sky: None, watched: &[], frames: frames(cornell::DURATION) },
    },
    Shipped {
        name: "cornell-box",
        build: cornell::published,
        settings: Settings { exposure: 3.0, sky: None, watched: &[], frames: 1 },
    },
    Shipped {
        name: "atrium",
        build: atrium::build,
        settings: Settings { exposure: 1.25, sky: Some(atrium::SKY), watched: &[], frames: frames(atrium::DURATION) },
    },
    Shipped {
        name: "conference",
        build: conference::build,
        settings: Settings {
            exposure: 1.0,
            sky: None,
            watched: &["plant", "table"],
            frames: frames(conference::DURATION),
        },
    },
    Shipped {
        name: "nave",
        build: nave::build,
        settings: Settings {
            exposure: 0.8,
            sky: None,
            watched: &["altar", "chandelier"],
            frames: frames(nave::DURATION),
        },
    },
];
