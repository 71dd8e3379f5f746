//! A checkpoint: one of another film is refused, and a damaged one ends the film with a message.
//!
//! The first byte selects the input: the whole file, its body with a valid checksum, the state of one stage, or changes of
//! that state. Each change is two bytes of position and one of value. All checksums are valid, including the light tree's, so
//! that the code behind them runs. Most inputs are only read, as that is fast; from 14 on the film is continued as well.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pipeline::Run;
use render2mpeg::settings::Switch;
use render2mpeg::{Options, Render};
use std::sync::OnceLock;
use tests::killed::{KilledFilm, TREE, seal_tree};

/// Renders the film in a folder that is not removed.
fn killed() -> KilledFilm {
    // A panic of a stage ends the film with a message, which is no finding. A panic of the caller is one.
    std::panic::set_hook(Box::new(|_| ()));
    let folder = tempfile::tempdir().expect("a folder").keep();
    let path = folder.join("scene.glb");
    tests::checkered_room(tests::Moving::Box).write(&path);
    let options = Options {
        output: Some(folder.join("film.m2v")),
        size: "8x8".parse().ok(),
        vpls: Some(5),
        photons: Some(50),
        bframes: Some(1),
        cache: Some(Switch::On),
        ..Options::default()
    };
    KilledFilm::new(&path, &options)
}

/// Changes bytes of a stage's state.
fn change(part: &mut [u8], changes: &[u8]) {
    if part.is_empty() {
        return;
    }
    for change in changes.chunks_exact(3) {
        let place = usize::from(u16::from_le_bytes([change[0], change[1]])) % part.len();
        part[place] = change[2];
    }
}

fn changed(film: &KilledFilm, kind: u8, rest: &[u8]) -> Vec<u8> {
    let mut stored = film.stored.clone();
    let place = usize::from(kind - 2) % stored.2.len();
    let part = &mut stored.2[place];
    let edit = |bytes: &mut Vec<u8>| if kind < 8 { *bytes = rest.to_vec() } else { change(bytes, rest) };
    edit(part);
    if place == TREE {
        seal_tree(part);
    }
    film.file(&stored)
}

fuzz_target!(|data: &[u8]| {
    static FILM: OnceLock<KilledFilm> = OnceLock::new();
    let film = FILM.get_or_init(killed);
    let Some((&kind, rest)) = data.split_first() else { return };
    let file = match kind % 14 {
        0 => rest.to_vec(),
        1 => film.sealed(rest),
        kind => changed(film, kind, rest),
    };
    let Ok(checkpoints) = film.checkpoints(&file) else { return };
    let KilledFilm { scene, settings, plan, part, .. } = film;
    let Ok(mut continued) = Render::new(scene, settings, plan, &checkpoints) else { return };
    if kind % 28 < 14 {
        return;
    }
    std::fs::write(&settings.output, part).expect("a file");
    let _ = continued.write_to(&settings.output).and_then(|()| continued.finish(Run::default()));
});
