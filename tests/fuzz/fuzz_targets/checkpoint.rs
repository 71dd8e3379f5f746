//! A checkpoint: what is not of this film is refused, and what is of it but damaged ends the film with a message.
//!
//! The first byte says what the rest is: the whole file, its body under a right checksum, all that one stage left, or changes
//! to what it left: two bytes of place, one of value each. Checksums are made right, that of the light tree too, so that what
//! comes after them is met. Most inputs are only read, for that is quick; from 14 on the film is continued as well.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pipeline::Run;
use render2mpeg::settings::Switch;
use render2mpeg::{Options, Render};
use std::sync::OnceLock;
use tests::killed::{KilledFilm, TREE, seal_tree};

/// The film, in a folder that stays.
fn killed() -> KilledFilm {
    // A stage that panics ends the film with a message: that is no finding. A panic in who called it is.
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

/// Changes bytes of what a stage left.
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
