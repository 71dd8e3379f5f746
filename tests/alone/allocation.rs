//! Stages skipped by the plan allocate no memory: the test counts requested bytes.
//!
//! The memory of a running stage grows with its work. If the number of bytes is the same for any number of pixels, photons
//! and lights, the stage did not run.

use pipeline::Run;
use pipeline::stage::Prepare;
use render_core::scene::Scene;
use render2mpeg::{Options, Settings};
use renderer::Preparation;
use renderer::plan::Plan;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use std::alloc::System;
use tempfile::TempDir;
use tests::{Glb, Moving, checkered_room, load};

#[global_allocator]
static COUNTED: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Amount of work.
#[derive(Clone, Copy)]
struct Work {
    side: usize,
    photons: u64,
    lights: usize,
}

const LITTLE: Work = Work { side: 48, photons: 3000, lights: 60 };
const MORE_PIXELS: Work = Work { side: 96, ..LITTLE };
const MORE_LIGHT: Work = Work { photons: 12_000, lights: 240, ..LITTLE };

/// A film, and its folder.
struct Job {
    scene: Scene,
    settings: Settings,
    plan: Plan,
    _folder: TempDir,
}

impl Job {
    fn new(room: &Glb, Work { side, photons, lights }: Work, frames: u32) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.glb");
        room.write(&path);
        let options = Options {
            output: Some(folder.path().join("film.m2v")),
            size: Some(format!("{side}x{side}").parse().unwrap()),
            frames: Some(frames),
            photons: Some(photons),
            vpls: Some(lights),
            ..Options::default()
        };
        let (scene, settings) = load(&path, options);
        let plan = Plan::new(&scene, &settings.render);
        Self { scene, settings, plan, _folder: folder }
    }
}

/// Mean number of bytes that preparing a frame allocates, without the first frames: the excess of a longer film.
fn of_a_later_frame(room: &Glb, work: Work) -> usize {
    let of_film = |count: u32| {
        let Job { scene, settings, plan, _folder } = &Job::new(room, work, count);
        let region = Region::new(COUNTED);
        let mut preparation = Preparation::new(scene, &settings.render, plan);
        assert_eq!((0..).map_while(|index| preparation.step(index)).count(), count as usize);
        region.change().bytes_allocated
    };
    of_film(9).saturating_sub(of_film(3)) / 6
}

/// Number of bytes that a whole run allocates.
fn of_a_run(room: &Glb, work: Work) -> usize {
    let Job { scene, settings, plan, _folder } = &Job::new(room, work, 4);
    let region = Region::new(COUNTED);
    render2mpeg::render(scene, settings, plan, Run::default()).unwrap();
    region.change().bytes_allocated
}

/// Size of one plane of floats of a small picture \[bytes\]; less means no work on pixels.
const A_PLANE: usize = 4 * LITTLE.side * LITTLE.side;

/// The only test of this program, so that no other test allocates memory meanwhile.
#[test]
fn what_is_left_out_takes_no_memory() {
    // In a static scene, a later frame allocates no memory in proportion to pixels, photons or lights.
    let still = checkered_room(Moving::Nothing);
    // Start the threads of the common pool before the count.
    of_a_run(&still, LITTLE);
    let [little, pixels, light] = [LITTLE, MORE_PIXELS, MORE_LIGHT].map(|work| of_a_later_frame(&still, work));
    println!("nothing moves: {little}, with more pixels {pixels}, with more light {light} bytes");
    assert!(little < A_PLANE && pixels < A_PLANE && light < A_PLANE);

    // With a moving camera, visibility is recomputed and light is not.
    let passing = checkered_room(Moving::Camera);
    let [little, pixels, light] = [LITTLE, MORE_PIXELS, MORE_LIGHT].map(|work| of_a_later_frame(&passing, work));
    println!("the camera moves: {little}, with more pixels {pixels}, with more light {light} bytes");
    assert!(pixels > little + 3 * A_PLANE && light < little + A_PLANE);

    // With a moving box, everything is recomputed.
    let moving = checkered_room(Moving::Box);
    let [little, pixels, light] = [LITTLE, MORE_PIXELS, MORE_LIGHT].map(|work| of_a_later_frame(&moving, work));
    println!("a box moves: {little}, with more pixels {pixels}, with more light {light} bytes");
    assert!(pixels > little + 3 * A_PLANE && light > little + A_PLANE);

    // Without reflection, photons and virtual lights allocate no memory in a whole run.
    let mut black = checkered_room(Moving::Nothing);
    for material in black.json["materials"].as_array_mut().unwrap() {
        material["pbrMetallicRoughness"]["baseColorFactor"] = serde_json::json!([0.0, 0.0, 0.0, 1.0]);
    }
    let [little, light, lit] = [of_a_run(&black, LITTLE), of_a_run(&black, MORE_LIGHT), of_a_run(&still, MORE_LIGHT)];
    println!("nothing reflects: {little}, with more light {light} bytes; where something reflects {lit}");
    assert!(little.abs_diff(light) < A_PLANE && lit > light + 10 * A_PLANE);
}
