//! Stages that a scene does not need are skipped without a change of any bit.

use render_core::{image_file::read_exr, luminance};
use serde_json::Value;
use std::path::{Path, PathBuf};
use tests::{Moving, Rendered, checkered_room, render, render2mpeg};

const SMALL: &str = "--size 64x64 --frames 5 --vpls 200 --photons 20000";

fn scene(folder: &Path, moving: Moving) -> PathBuf {
    let path = folder.join("room.glb");
    checkered_room(moving).write(&path);
    path
}

/// Renders with and without skipped stages, and checks that the streams are equal.
fn both_ways(folder: &Path, moving: Moving) -> [Rendered; 2] {
    let scene = scene(folder, moving);
    let spared = render(folder, "spared", &scene, SMALL);
    let full = render(folder, "full", &scene, &format!("{SMALL} --run-everything"));
    assert!(spared.stream == full.stream, "{moving:?}: leaving out changes the film");
    [spared, full]
}

fn state<'a>(report: &'a Value, stage: &str) -> &'a str {
    let plan = report["plan"].as_array().expect("a plan");
    let step = plan.iter().find(|step| step["stage"] == stage).unwrap_or_else(|| panic!("no stage {stage}"));
    step["state"].as_str().expect("a state")
}

/// Light with one reflection needs no photons, no tree and no cache, and still lights the film.
#[test]
fn direct_light_alone_needs_no_photons() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), Moving::Camera);
    let film = render(folder.path(), "direct", &scene, &format!("{SMALL} --bounces 1 --exr direct"));
    assert_eq!(state(&film.report, "photons"), "off");
    for figure in ["photons_traced", "cache_records"] {
        assert!(film.figures(&[figure]).iter().all(|&count| count == 0.0), "{figure}");
    }
    let paths = ["reference", "room.glb", "--size", "64x64", "--bounces", "1", "--spp", "256", "-o", "paths.exr", "-q"];
    assert_eq!(render2mpeg(folder.path(), &paths).code, Some(0));
    let mean = |picture: &Path| {
        let picture = read_exr(picture).expect("a linear picture");
        picture.samples().iter().map(|&rgb| f64::from(luminance(rgb))).sum::<f64>() / picture.samples().len() as f64
    };
    let [film, paths] = ["direct/frame_00000.exr", "paths.exr"].map(|name| mean(&folder.path().join(name)));
    println!("{film} and by paths {paths}");
    assert!((film / paths - 1.0).abs() < 0.02, "{film} instead of {paths}");
}

#[test]
fn only_the_camera_moves() {
    let folder = tempfile::tempdir().unwrap();
    let [spared, full] = both_ways(folder.path(), Moving::Camera);
    // Stages that depend on the camera run for each frame, others once or never.
    for (stage, expected) in [
        ("photons", "once"),
        ("light tree update", "once"),
        ("object placement", "once"),
        ("primary rays and motion", "on"),
        ("anchor lights on moving objects", "off"),
    ] {
        assert_eq!(state(&spared.report, stage), expected, "{stage}");
    }
    assert_eq!(state(&full.report, "photons"), "on");
    let of_photons = |run: &Rendered| run.figures(&["seconds", "photons"]);
    let (few, all) = (of_photons(&spared), of_photons(&full));
    assert!(few[0] > 0.0 && few[1..].iter().all(|&seconds| seconds == 0.0), "{few:?}");
    assert!(all.iter().all(|&seconds| seconds > 0.0), "{all:?}");

    // Compare the estimated savings with the measured time of the run without skipped stages.
    let plan = spared.report["plan"].as_array().unwrap();
    let saves = |stage: &str| plan.iter().find(|step| step["stage"] == stage).unwrap()["saves"].as_f64();
    let whole = full.figures(&["seconds", "total"]);
    for (stage, seconds) in [("photons", "photons"), ("light tree update", "tree"), ("object placement", "update")] {
        let measured = full.figures(&["seconds", seconds])[1..].iter().sum::<f64>() / whole[1..].iter().sum::<f64>();
        println!("{stage}: {:.3} of a frame estimated, {measured:.3} measured", saves(stage).unwrap());
    }
    assert!(plan.iter().filter_map(|step| step["saves"].as_f64()).sum::<f64>() < 1.0);
    assert!(
        saves("photons") > saves("light tree update"),
        "a photon is followed through the scene, a light is a number"
    );
    assert_eq!(
        (saves("primary rays and motion"), saves("importance")),
        (None, None),
        "one runs, the other has nothing to do"
    );
    // Anchors keep their positions by definition, so they are placed once in any film.
    let may_be_once = |step: &Value| step["stage"] == "anchor lights";
    let steps = full.report["plan"].as_array().unwrap();
    assert!(steps.iter().all(|step| step["state"] != "once" || may_be_once(step)));

    // `plan` prints the stages in the report's words.
    let table = render2mpeg(folder.path(), &["plan", "room.glb"]).stdout;
    let row = table.lines().find(|line| line.starts_with("photons ")).expect("a row for photons");
    assert!(row.split_whitespace().nth(1) == Some("once") && row.contains(" %"), "{row}");
}

#[test]
fn nothing_moves() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), Moving::Nothing);
    let [spared, _] = both_ways(folder.path(), Moving::Nothing);
    assert_eq!(state(&spared.report, "primary rays and motion"), "once");
    // With fixed thresholds, a static picture is bit-identical in every frame. The first P picture may refine the I picture.
    // All later ones are skipped: a header, and for each of 4 rows a slice with its first and last macroblock.
    let still = render(folder.path(), "still", &scene, &format!("{SMALL} --thresholds fixed:0.02"));
    let bits = still.figures(&["bits"]);
    println!("bits of a still scene: {bits:?}; with perceptual thresholds {:?}", spared.figures(&["bits"]));
    assert!(bits[1] < bits[0] / 4.0, "{bits:?}");
    assert!(bits[2..].iter().all(|&skipped| skipped < 500.0), "{bits:?}");
}

#[test]
fn a_box_moves() {
    let folder = tempfile::tempdir().unwrap();
    let [spared, _] = both_ways(folder.path(), Moving::Box);
    for stage in ["photons", "light tree update", "object placement", "anchor lights on moving objects"] {
        assert_eq!(state(&spared.report, stage), "on", "{stage}");
    }
}
