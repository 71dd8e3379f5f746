//! The loader neither replaces the process's panic hook nor panics on known damage.

use render_core::scene;
use std::sync::atomic::{AtomicUsize, Ordering};
use tests::{Random, cornell, damaged, hostile_scenes};

static SEEN: AtomicUsize = AtomicUsize::new(0);

/// Scenes on which the `gltf` crate would panic, and the required text of the message.
const FORESEEN: [(&str, &str); 4] = [
    ("positions-out-of-range", "mesh 0 primitive 0: its positions are accessor 99"),
    ("camera-without-its-part", "camera 0 has type perspective"),
    ("channel-out-of-range", "animation 0 channel 0 moves node 99"),
    ("length-in-header", "its header claims 5 bytes"),
];

/// The only test of this program, as the hook belongs to the process.
#[test]
fn loading_runs_no_panic_hook_and_replaces_none() {
    std::panic::set_hook(Box::new(|_| _ = SEEN.fetch_add(1, Ordering::Relaxed)));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    let mut foreseen = Vec::new();
    let mut wrong = Vec::new();
    // Hostile scenes give errors, some with a known message.
    for hostile in hostile_scenes() {
        std::fs::write(&path, &hostile.bytes).unwrap();
        let before = SEEN.load(Ordering::Relaxed);
        let message = scene::load(&path).map_or_else(|error| error.to_string(), |_| "it loads".into());
        if SEEN.load(Ordering::Relaxed) != before {
            wrong.push(format!("{} panics", hostile.name));
        }
        if let Some((name, words)) = FORESEEN.iter().find(|(name, _)| *name == hostile.name) {
            foreseen.push(*name);
            if !message.contains(words) || !message.contains("export") || message.contains('\n') {
                wrong.push(message);
            }
        }
    }

    // Random damage must not panic either.
    let whole = std::fs::read(cornell()).unwrap();
    let mut random = Random::new(0x9e37_79b9_7f4a_7c15);
    for case in 0..500 {
        let (bytes, places) = damaged(&whole, &mut random);
        std::fs::write(&path, &bytes).unwrap();
        let before = SEEN.load(Ordering::Relaxed);
        let _ = scene::load(&path);
        if SEEN.load(Ordering::Relaxed) != before {
            wrong.push(format!("case {case} panics: {places:?}"));
        }
    }

    // The hook is still in place if it receives this panic.
    let _ = std::panic::catch_unwind(|| panic!("on purpose"));
    let seen = SEEN.load(Ordering::Relaxed);
    drop(std::panic::take_hook());
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(seen, 1, "the hook stands and has seen the one panic on purpose");
    assert_eq!(foreseen.len(), FORESEEN.len(), "of the scenes foreseen there are {foreseen:?}");
}
