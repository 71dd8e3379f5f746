//! The same input gives the same bits: in repeated runs, and with any number of threads.

use tests::{cornell, render};

#[test]
fn neither_threads_nor_chance_change_a_bit() {
    // All-lights and per-pixel lightcuts are slow and keep little state between frames: a few frames suffice.
    for kind in [
        "--frames 6",
        "--frames 6 --thresholds fixed:0.02",
        "--frames 2 --lighting all-lights",
        "--frames 3 --stopping calibrated --cache off",
        "--frames 6 --thresholds perceptual",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let film = |name: &str, more: &str| {
            let arguments = format!("--size 64x64 --vpls 200 --photons 20000 {kind} {more}");
            render(folder.path(), name, &cornell(), &arguments).stream
        };
        let alone = film("alone", "--threads 1");
        assert!(alone == film("two", "--threads 2"), "{kind}: two threads make another film");
        assert!(alone == film("again", "--threads 2"), "{kind}: the second run makes another film");
        assert!(alone == film("five", "--threads 5"), "{kind}: more threads than processors make another film");
        // A different seed must change the film, or equality would prove nothing.
        assert!(alone != film("seed", "--threads 2 --seed 2"), "{kind}: the seed changes nothing");
    }
}
