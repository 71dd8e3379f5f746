//! Bakes by several ranks, and bakes that are interrupted and resumed.

use crate::bake::{add, gray, outside, within};
use glam::vec3;
use pipeline::checkpoint::{FilmJob, path_for};
use render_core::Environment;
use render_core::ranks::{Alone, Ranks, ThreadRanks};
use render_core::scene::{Gradient, Material, Node, Scene, Transform};
use render2mpeg::{Options, Settings};
use renderer::bake::{BakeCheckpoint, BakeRun, bake};
use rustix::process::{Pid, Signal, kill_process};
use std::cell::Cell;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tests::{Moving, assert_fails, checkered_room, program, render2mpeg};

const TEXELS: usize = 3000;

/// Returns a room with a coated box, under a bright sky that enters through an open side.
fn coated_room() -> Scene {
    let mut scene = Scene::default();
    scene.nodes.push(Node { name: String::new(), parent: None, rest: Transform::IDENTITY });
    add(&mut scene, gray(0.6), &within(vec3(-2.0, 0.0, -2.0), vec3(2.0, 3.0, 2.0))[..5]);
    let coat = Material { roughness: 0.5, ..gray(0.4) };
    add(&mut scene, coat, &outside(vec3(-0.5, 0.0, -0.5), vec3(0.5, 1.0, 0.5)));
    scene.sky = Environment::gradient(Gradient::constant([2.0; 3]));
    scene
}

fn settings(scene: &Scene) -> Settings {
    let options = Options { vpls: Some(300), photons: Some(20_000), ..Options::default() };
    Settings::new("room.glb".into(), scene, &options).expect("right settings")
}

fn job(output: &Path) -> FilmJob {
    FilmJob::new(output, "test 1", "{}", 7)
}

/// Bakes on this rank until `stop` is set after `calls` calls of progress. Returns the bytes of the light, or `None` if
/// the bake was stopped.
fn baked(scene: &Scene, ranks: Arc<dyn Ranks>, output: Option<&Path>, calls: usize) -> Option<Vec<u8>> {
    let (stop, called) = (AtomicBool::new(false), Cell::new(0));
    let is_first = ranks.rank() == 0;
    let checkpoint = output.filter(|_| is_first);
    let checkpoint = checkpoint.map(|output| BakeCheckpoint::new(&job(output), Duration::ZERO, true).unwrap());
    let run = BakeRun { ranks, checkpoint, stop: &stop };
    let count = |_: usize, _: usize| {
        called.set(called.get() + 1);
        stop.store(called.get() >= calls, Ordering::Relaxed);
    };
    let bake = bake(scene, &settings(scene).render, TEXELS, &run, &count).expect("the room can be baked")?;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.slf");
    bake.write(scene, &path).unwrap();
    Some(fs::read(path).unwrap())
}

/// Bakes on `count` ranks and returns the light of each.
fn baked_among(scene: &Scene, count: usize, output: Option<&Path>, calls: usize) -> Vec<Option<Vec<u8>>> {
    std::thread::scope(|scope| {
        let ranks = ThreadRanks::new(count).into_iter();
        let bake = |ranks| scope.spawn(move || baked(scene, Arc::new(ranks), output, calls));
        let started: Vec<_> = ranks.map(bake).collect();
        started.into_iter().map(|rank| rank.join().unwrap()).collect()
    })
}

#[test]
fn ranks_bake_the_light_of_one_process() {
    let scene = coated_room();
    let alone = baked(&scene, Arc::new(Alone), None, usize::MAX).unwrap();
    for count in [2, 3] {
        let of_ranks = baked_among(&scene, count, None, usize::MAX);
        assert!(of_ranks.iter().all(|light| light.as_ref() == Some(&alone)), "{count} ranks");
    }
}

/// A bake is stopped in each of its loops, and continued by another number of ranks, to the same bits.
#[test]
fn a_stopped_bake_continues_to_the_same_light() {
    let scene = coated_room();
    let alone = baked(&scene, Arc::new(Alone), None, usize::MAX).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("room.slf");
    let (mut stops, mut calls) = (0, 1);
    loop {
        let count = 1 + stops % 3;
        let lights = baked_among(&scene, count, Some(&output), calls);
        assert!(path_for(&output).exists());
        if let Some(light) = &lights[0] {
            assert!(lights.iter().all(|light| light.as_ref() == Some(&alone)));
            assert!(light == &alone && stops >= 4, "{stops} interruptions");
            break;
        }
        assert!(lights.iter().all(Option::is_none), "all ranks stop together");
        // The next run repeats the progress so far, and then does some more work.
        (stops, calls) = (stops + 1, calls + 40);
    }
}

#[test]
fn checkpoints_of_other_bakes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("room.slf");
    let scene = coated_room();
    assert!(baked(&scene, Arc::new(Alone), Some(&output), 1).is_none());
    let whole = fs::read(path_for(&output)).unwrap();
    let resume = |job: &FilmJob| BakeCheckpoint::new(job, Duration::ZERO, true).map(|found| found.is_resumed());
    assert!(resume(&job(&output)).unwrap());
    let other = FilmJob::new(&output, "test 1", r#"{"texels":5}"#, 7);
    let text = resume(&other).unwrap_err().to_string();
    assert!(text.contains("room.slf.checkpoint") && text.contains("texels"), "{text}");
    fs::write(path_for(&output), &whole[..whole.len() - 3]).unwrap();
    assert!(resume(&job(&output)).is_err());
    fs::remove_file(path_for(&output)).unwrap();
    assert!(!resume(&job(&output)).unwrap());
}

/// A process that ends after SIGTERM leaves a checkpoint, from which the same command continues.
#[test]
fn a_terminated_bake_is_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    checkered_room(Moving::Nothing).write(&folder.join("room.glb"));
    let words = ["bake", "room.glb", "--texels", "60000", "--vpls", "300", "--photons", "20000", "--threads", "1"];
    let whole = render2mpeg(folder, &[&words[..], &["-o", "whole.slf", "-q"]].concat());
    assert_eq!(whole.code, Some(0), "{}", whole.stderr);
    // Send the signal later and later, until it arrives after the start of the bake.
    let terminated_after = |delay: Duration| {
        let mut command = Command::new(program());
        command.args(words).current_dir(folder).stdin(Stdio::null()).stderr(Stdio::null());
        let mut child = command.spawn().expect("render2mpeg starts");
        std::thread::sleep(delay);
        kill_process(Pid::from_raw(child.id() as i32).unwrap(), Signal::TERM).unwrap();
        child.wait().unwrap().code()
    };
    let mut delays = [50, 100, 200, 400, 800, 1600].map(Duration::from_millis).into_iter();
    assert!(delays.any(|delay| terminated_after(delay) == Some(143)), "the bake ends in order");
    assert!(folder.join("room.slf.checkpoint").exists() && !folder.join("room.slf").exists());

    // Another resolution is another bake.
    assert_fails(
        folder,
        &["bake", "room.glb", "--texels", "500", "--vpls", "300", "--photons", "20000", "--resume"],
        &["room.slf.checkpoint", "texels"],
    );
    let resumed = render2mpeg(folder, &[&words[..], &["--resume", "-q"]].concat());
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    assert!(fs::read(folder.join("room.slf")).unwrap() == fs::read(folder.join("whole.slf")).unwrap());
    assert!(!folder.join("room.slf.checkpoint").exists());
}
