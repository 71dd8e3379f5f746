//! Checkpoints with valid checksums and the state sections of another film: one line of error and no panic.

use pipeline::figures::FrameFigures;
use render2mpeg::Options;
use std::collections::BTreeMap;
use tempfile::TempDir;
use tests::killed::{CONFIG, KilledFilm, Stored};
use tests::{Moving, checkered_room};

/// Indices of the state sections `Part::Shade` and `Part::Encode`.
const SHADE: usize = 1;
const ENCODE: usize = 3;

/// The state that `pipeline/loop/src/log.rs` stores: length and checksum of the film, the report, figures of queued frames
/// (none if each frame is coded at once), the encoder.
type Encoding = ((u64, u32), Vec<Line>, BTreeMap<u32, ()>, Vec<u8>);

/// A frame of the report: index, picture type, bits, quantiser_scale, PSNR, and figures of the stages.
type Line = (u32, String, u64, u32, Option<f64>, FrameFigures);

/// Renders three frames lit by `vpls` anchor lights.
fn film(vpls: usize) -> (TempDir, KilledFilm) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    checkered_room(Moving::Box).write(&path);
    let options = Options {
        output: Some(folder.path().join("film.m2v")),
        size: "16x16".parse().ok(),
        vpls: Some(vpls),
        photons: Some(1000),
        ..Options::default()
    };
    let film = KilledFilm::new(&path, &options);
    (folder, film)
}

/// Continues the film from the forged checkpoint.
fn go_on(film: &KilledFilm, stored: &Stored) -> Result<(), String> {
    film.go_on(&film.file(stored)).map_err(|error| error.chain())
}

/// Records of a film with more lights are refused: their cuts refer to missing lights.
#[test]
fn records_of_lights_that_are_not_there_are_refused() {
    let [(_folder, few), (_other, many)] = [10, 300].map(film);
    let mut stored = few.stored.clone();
    go_on(&few, &stored).expect("the original state is continued");
    stored.2[SHADE] = many.stored.2[SHADE].clone();
    let error = go_on(&few, &stored).unwrap_err();
    assert!(error.contains("is invalid") && error.lines().count() == 1, "{error}");
}

/// Unreadable states are refused before the film is truncated to its recorded length.
#[test]
fn a_part_that_cannot_be_read_leaves_the_film_as_it_is() {
    let (_folder, film) = film(10);
    let before = std::fs::read(&film.settings.output).unwrap();
    let whole = film.stored.clone();
    for part in 0..whole.2.len() {
        // An empty state once made the other stages wait forever.
        for forged in [vec![255; 40], Vec::new()] {
            let mut stored = whole.clone();
            stored.2[part] = forged;
            let error = go_on(&film, &stored).unwrap_err();
            assert!(error.lines().count() == 1, "{error}");
            assert!(error.contains("film.m2v.checkpoint") && error.contains("restart"), "{error}");
            assert!(std::fs::read(&film.settings.output).unwrap() == before, "part {part}");
        }
    }
}

/// A report without one frame's line is refused; its masking time once went into a missing line.
#[test]
fn a_report_that_leaves_a_frame_out_is_refused() {
    let (_folder, film) = film(10);
    let mut stored = film.stored.clone();
    let (mut encoding, _): (Encoding, _) = bincode::serde::decode_from_slice(&stored.2[ENCODE], CONFIG).unwrap();
    let film_line = encoding.1[0].clone();
    let line = |index| {
        let (_, name, bits, qscale, psnr_y, figures) = film_line.clone();
        (index, name, bits, qscale, psnr_y, figures)
    };
    for lines in [&[0][..], &[0, 2], &[1, 1], &[0, 1, 2]] {
        encoding.1 = lines.iter().map(|&index| line(index)).collect();
        stored.2[ENCODE] = bincode::serde::encode_to_vec(&encoding, CONFIG).unwrap();
        let error = go_on(&film, &stored).unwrap_err();
        assert!(error.contains("is invalid") && error.lines().count() == 1, "{error}");
    }
    encoding.1 = [1, 0].map(line).into();
    stored.2[ENCODE] = bincode::serde::encode_to_vec(&encoding, CONFIG).unwrap();
    go_on(&film, &stored).expect("the lines are in coding order");
}

/// Frame indices beyond the film are refused, up to the largest integer, to which the program once added one.
#[test]
fn a_last_frame_beyond_the_film_is_refused() {
    let (_folder, film) = film(10);
    for last in [2, 1000, u32::MAX] {
        let mut stored = film.stored.clone();
        stored.1 = Some(last);
        let error = go_on(&film, &stored).unwrap_err();
        let word = if last == 2 { "is invalid" } else { "increase --frames" };
        assert!(error.contains("film.m2v.checkpoint") && error.contains(word), "{last}: {error}");
    }
}
