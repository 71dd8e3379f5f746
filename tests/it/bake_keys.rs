//! Baked light of moving and changing lamps: key times, interpolation, its error, and films.

use super::bake::{Film, bake_file, films};
use glam::{Vec3, vec3};
use perceptual::psnr;
use render_core::luminance;
use render2mpeg::Options;
use renderer::bake::{self, BakeRun, KeyedResolution};
use renderer::texels::BakedTexels;
use serde_json::json;
use std::path::Path;
use tests::{Glb, Moving, assert_fails, checkered_room, load, render2mpeg};

/// Path of the lamp in [`room`].
const WAY: [Vec3; 2] = [vec3(-0.6, 0.0, 0.0), vec3(0.6, 0.0, 0.0)];

/// Writes a room with a square lamp that moves along [`WAY`] within a second.
fn room(path: &Path) {
    let mut room = checkered_room(Moving::Nothing);
    let lamp = [vec3(0.0, 2.6, -1.0), Vec3::X * 0.5, Vec3::Z * 0.5];
    let lamp = room.add(&[lamp], Vec3::ZERO, Vec3::new(20.0, 14.0, 8.0));
    room.animate(lamp, WAY[0], WAY[1]);
    room.write(path);
}

/// Returns a room with a point light at `place` above the floor, and the node of the light. Such lamps have no texels.
fn room_with_point(place: Vec3) -> (Glb, usize) {
    let mut room = checkered_room(Moving::Nothing);
    let lights = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 12000 }] } });
    (room.json["extensions"], room.json["extensionsUsed"]) = (lights, json!(["KHR_lights_punctual"]));
    let nodes = room.json["nodes"].as_array_mut().expect("a list");
    let node = nodes.len();
    let [x, y, z] = (place + UP).to_array();
    nodes.push(json!({ "translation": [x, y, z], "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    room.json["scenes"][0]["nodes"].as_array_mut().expect("a list").push(json!(node));
    (room, node)
}

/// Height of the point light over the floor.
const UP: Vec3 = vec3(0.0, 2.0, 0.0);

/// Returns the mean difference of two lights' indirect irradiance, relative to the mean of the second.
fn difference(one: &BakedTexels, other: &BakedTexels) -> f32 {
    let (mut wrong, mut whole) = (0.0, 0.0);
    for (one, other) in one.indirect.iter().zip(&other.indirect) {
        let [a, b] = [one, other].map(|light| luminance(Vec3::from(*light)));
        (wrong, whole) = (wrong + (a - b).abs(), whole + b);
    }
    wrong / whole
}

const TEXELS: usize = 3000;

fn options() -> Options {
    Options { vpls: Some(600), photons: Some(40_000), qscale: Some(1), ..Options::default() }
}

/// At a key time, the light is that of a room with a static lamp at the same place. Between keys, it is close to that.
#[test]
fn keys_are_bakes_of_static_lamps() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.glb");
    let (mut moving, node) = room_with_point(WAY[0]);
    moving.animate(node, WAY[0] + UP, WAY[1] + UP);
    moving.write(&path);
    let (scene, settings) = load(&path, options());
    let resolution = KeyedResolution { texels: Some(TEXELS), keys: 5 };
    let baked = bake::bake_keys(&scene, &settings.render, resolution, &BakeRun::alone(), &|_, _| ());
    let baked = baked.expect("the scene can be baked").expect("it was not stopped");
    assert_eq!(baked.light.times(), [0.0, 0.25, 0.5, 0.75, 1.0]);
    assert!(baked.error < 0.02, "{}", baked.error);
    for (time, most) in [(0.0, 0.002), (0.75, 0.002), (0.6, 0.03)] {
        let still = folder.path().join("still.glb");
        room_with_point(WAY[0].lerp(WAY[1], time)).0.write(&still);
        let (scene, settings) = load(&still, options());
        let bake = bake::bake(&scene, &settings.render, TEXELS, &BakeRun::alone(), &|_, _| ());
        let still = bake.expect("the scene can be baked").expect("it was not stopped").texels;
        let (keyed, of_first) = (baked.light.at(time), difference(&baked.light.at(0.0), &still));
        assert_eq!(keyed.indirect.len(), still.indirect.len());
        let found = difference(&keyed, &still);
        println!("{time} s: {found}, the first key {of_first}");
        assert!(found < most, "{time} s: {found}");
        assert!(time == 0.0 || of_first > 3.0 * found, "{time} s: the lamp does not matter");
    }
    // A file has the same light.
    let file = folder.path().join("room.slf");
    baked.write(&scene, &file).unwrap();
    assert!(bake::read(&scene, &file).unwrap() == baked.light, "the file differs");
}

/// A film between key times nearly equals a film without baked light. Its last frame is at 0.72 s.
#[test]
fn films_interpolate_between_keys() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, path) = (folder.path(), folder.path().join("room.glb"));
    room(&path);
    let [two, one] = ["2", "1"].map(|threads| {
        bake_file(folder, &path, "room", &format!("--keys 5 --texels 20000 --vpls 1000 --threads {threads}"))
    });
    assert!(two == one, "the same bytes with any number of threads");
    let [cuts, baked] = films(folder, &path, "room.slf", "--vpls 1000 --every 9");
    assert_eq!(baked.rendered.figures(&["photons_traced"]), [0.0; 3]);
    let pictures = |film: &Film| film.frames.iter().map(|frame| frame.luma().clone()).collect::<Vec<_>>();
    for (index, (cuts, baked)) in pictures(&cuts).iter().zip(pictures(&baked)).enumerate() {
        let psnr = psnr(&baked, cuts);
        println!("frame {index}: {psnr} dB");
        assert!(psnr > 36.0, "frame {index}: {psnr} dB");
    }
}

#[test]
fn keys_that_are_too_far_apart_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, path) = (folder.path(), folder.path().join("room.glb"));
    room(&path);
    let bake = ["bake", "room.glb", "--texels=2000", "--vpls=300", "--photons=20000"];
    assert_fails(folder, &[&bake[..], &["--keys=2"]].concat(), &["--keys 2", "at 0.50 s", "use --keys"]);
    assert!(!folder.join("room.slf").exists(), "nothing is written");
    assert_fails(folder, &bake, &["lamp moves", "--keys"]);
    let plan = render2mpeg(folder, &["plan", "room.glb"]).stdout;
    assert!(plan.contains("a lamp moves, so the light can be baked at key times"), "{plan}");

    // A static scene has no use for keys.
    room_with_point(Vec3::ZERO).0.write(&folder.join("still.glb"));
    assert_fails(folder, &["bake", "still.glb", "--keys=5"], &["--keys", "no lamp", "moves"]);
}

/// A lamp is elsewhere for a moment between two key times, at which it is at equal places.
#[test]
fn flashes_between_keys_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (mut room, node) = room_with_point(WAY[0]);
    let [home, away] = WAY.map(|end| end + UP);
    room.animate_in_steps(node, &[(0.0, home), (0.56, away), (0.58, home), (1.0, home)]);
    room.write(&folder.join("room.glb"));
    let bake = ["bake", "room.glb", "--texels=2000", "--vpls=300", "--photons=20000", "--keys=5"];
    assert_fails(folder, &bake, &["--keys 5", "at 0.5", "flash"]);
    assert!(!folder.join("room.slf").exists(), "nothing is written");
}
