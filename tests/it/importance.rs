//! Importance sets samples, thresholds and bits, and no other property of a film.

use render_core::image_file::read_layers;
use std::fs;
use std::path::Path;
use tests::{Moving, Rendered, assert_fails, checkered_room, render, render2mpeg};

const SMALL: &str = "--size 96x64 --vpls 60 --photons 2000 --frames 5";

/// Writes a room with a moving camera, and its settings file.
pub fn room(folder: &Path, settings: &str) {
    let mut room = checkered_room(Moving::Camera);
    room.json["nodes"][4]["name"] = "box".into();
    room.write(&folder.join("room.glb"));
    fs::write(folder.join("room.toml"), settings).unwrap();
}

/// Settings that name a watched node.
pub const WATCHED: &str = "[importance]\nnodes = [\"box\"]\nviewing_distance = 0.4\nscreen_width = 0.6\n";

/// Renders the room.
pub fn film(folder: &Path, name: &str, more: &str) -> Rendered {
    render(folder, name, &folder.join("room.glb"), &format!("{SMALL} {more}"))
}

#[test]
fn threads_do_not_matter_and_the_option_does() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    room(folder, WATCHED);
    // Threads do not change the film; gain and maps do.
    let maps = "--importance saliency:0.8,task:0.7";
    let alone = film(folder, "alone", &format!("{maps} --threads 1"));
    assert!(
        alone.stream == film(folder, "two", &format!("{maps} --threads 2")).stream,
        "two threads make another film"
    );
    assert!(
        alone.stream != film(folder, "gain", &format!("{maps} --importance-gain 1")).stream,
        "the gain changes nothing"
    );
    assert!(alone.stream != film(folder, "task", "--importance task:1").stream, "saliency changes nothing");
    let without = film(folder, "without", "--samples 1");
    assert!(alone.stream != without.stream, "importance changes nothing");

    // The report contains importance only if it is requested.
    for (of, name) in [(&alone, "samples_mean"), (&alone, "importance_mean")] {
        assert!(of.figures(&[name]).iter().all(|&figure| figure > 0.0 && figure < 5.0), "{name}");
    }
    let changes = alone.report["frames"].as_array().unwrap().iter().map(|frame| frame["samples_change"].as_f64());
    assert!(changes.skip(1).all(|change| change.is_some_and(|change| change < 1.0)));
    assert!(without.report["frames"][0]["samples_mean"].is_null());
    assert!(without.report["settings"].get("importance").is_none());
}

/// A static film keeps its map; frames queued in the encoder keep their weights.
#[test]
fn other_kinds_of_films_take_it_too() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    room(folder, WATCHED);
    checkered_room(Moving::Nothing).write(&folder.join("still.glb"));
    let still = render(folder, "still", &folder.join("still.glb"), &format!("{SMALL} --importance saliency:1"));
    let samples = still.figures(&["samples_mean"]);
    assert!(samples[0] > 1.0 && samples.iter().all(|&mean| mean == samples[0]), "{samples:?}");
    for more in [
        "--bframes 2 --bitrate 100k",
        "--cache off --thresholds fixed:0.02",
        "--samples 1",
        "--mpeg1 --size 50x38",
        "--lighting all-lights --frames 2",
        "--aq masking",
    ] {
        let found = film(folder, "film", &format!("{more} --importance saliency:1,task:1"));
        // Some pixels have one sample and some five, unless one is the maximum.
        let has_one = more == "--samples 1";
        let is_right = |&mean: &f64| if has_one { mean == 1.0 } else { mean > 1.0 && mean < 5.0 };
        assert!(found.figures(&["samples_mean"]).iter().all(is_right), "{more}");
    }
}

/// The layer contains the map, with the maximum at the watched object.
#[test]
fn the_map_is_a_layer_of_the_frames() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    room(folder, WATCHED);
    let made = film(folder, "film", "--importance task:1 --exr frames --aov importance --samples 3 --html page.html");
    let layers = read_layers(&folder.join("frames/frame_00004.exr")).unwrap();
    let channel = |name: &str| &layers.channels.iter().find(|(own, _)| own == name).expect(name).1;
    let (importance, samples) = (channel("importance.V"), channel("importance.N"));
    assert!(importance.iter().all(|value| (0.0..=1.0).contains(value)) && importance.contains(&1.0));
    for (importance, samples) in importance.iter().zip(samples) {
        assert_eq!(*samples, 1.0 + (2.0 * importance).round());
    }
    let mean = samples.iter().sum::<f32>() / samples.len() as f32;
    assert!((f64::from(mean) - made.figures(&["samples_mean"])[4]).abs() < 1e-5);
    assert!(fs::read_to_string(folder.join("page.html")).unwrap().contains("Mean importance"));
}

/// Adaptive quantisation by masking changes the film and not its pictures, and spends fewer bits.
#[test]
fn quantisers_follow_masking() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    room(folder, "");
    let same = "--thresholds fixed:0.02 --qscale 16";
    let films = ["off", "masking"].map(|by| film(folder, by, &format!("{same} --aq {by} --y4m {by}.y4m")));
    assert!(films[0].stream == film(folder, "default", same).stream, "off is not the default");
    assert!(films[0].stream != films[1].stream, "masking changes nothing");
    assert!(fs::read(folder.join("off.y4m")).unwrap() == fs::read(folder.join("masking.y4m")).unwrap());
    let bits = films.map(|film| film.figures(&["bits"]).iter().sum::<f64>());
    assert!(bits[1] < bits[0], "{bits:?}");
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (settings, option, words) in [
        ("", "--importance=task:1", &["room.toml", "[importance]", "nodes"][..]),
        ("[importance]\nnodes = [\"cat\"]", "--importance=task:1", &["room.toml", "cat"]),
        ("[importance]\nnodes = [\"box\"]\nscreen_width = -1", "--importance=task:1", &["room.toml", "screen_width"]),
        (WATCHED, "--importance=gaze:1", &["gaze:1", "saliency:1"]),
        (WATCHED, "--importance-gain=2", &["--importance saliency:1"]),
        (WATCHED, "--aov=importance", &["--aov"]),
    ] {
        room(folder, settings);
        assert_fails(folder, &["render", "room.glb", option], words);
    }
    let gain = ["render", "room.glb", "--importance=saliency:1", "--importance-gain=9"];
    assert_fails(folder, &gain, &["--importance-gain 9", "1..=8"]);
    assert_eq!(render2mpeg(folder, &["plan", "room.glb", "--importance=saliency:1"]).code, Some(0));
}
