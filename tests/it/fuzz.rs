//! A few cases of the fuzzer, and a check of its verdicts.

use std::fs;
use tests::fuzz::{Case, Film, Fuzzer, Outcome, Verdict, own_seeds, seeds_below};
use tests::sorted_names;

/// Creates a fuzzer with the tests' own scenes.
fn fuzzer() -> Fuzzer {
    let mut seeds = own_seeds();
    seeds.extend(seeds_below(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes").as_ref()));
    assert!(seeds.len() > 3, "small scenes come with the project");
    Fuzzer::new(seeds, 1).unwrap()
}

/// `cargo run -p tests --example fuzz_scenes` starts longer runs.
#[test]
fn a_few_changed_scenes_keep_every_promise() {
    let mut fuzzer = fuzzer();
    let cases: Vec<Case> = (0..48).map(|number| fuzzer.run(number).unwrap()).collect();
    let faults: Vec<&Case> = cases.iter().filter(|case| matches!(case.verdict, Verdict::Fault(_))).collect();
    assert!(faults.is_empty(), "{faults:#?}");

    // If all changed scenes were refused or unaffected, the test would prove little.
    let rendered = cases.iter().filter(|case| case.verdict == Verdict::Rendered).count();
    println!("{rendered} of {} rendered", cases.len());
    assert!((5..=40).contains(&rendered), "{rendered} of {}", cases.len());
    assert!(cases.iter().filter(|case| case.subject == "checkpoint").count() > 2);
}

#[test]
fn cases_can_be_repeated() {
    let [first, second] = [3, 7].map(|before| {
        let mut fuzzer = fuzzer();
        fuzzer.run(before).unwrap();
        fuzzer.run(5).unwrap()
    });
    let parts = |case: Case| (case.subject, case.changes, case.command, case.verdict);
    assert_eq!(parts(first), parts(second));
}

/// Verdicts detect faults in the messages and files of a run.
#[test]
fn verdicts_notice_faults() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = Film::new(&folder.path().join("case")).unwrap();
    film.arguments = vec!["--quiet".into()];
    let scene = sorted_names(&film.scene());
    let judge = |code: Option<i32>, signal: Option<i32>, text: &str| {
        let outcome = Outcome { code, signal, endless: false, stderr: text.into() };
        Verdict::of(&film, &outcome, &scene, &["film.m2v", "film.report.json"])
    };
    let refusal = "render2mpeg: scene.glb: damaged\n";
    assert_eq!(judge(Some(1), None, refusal), Verdict::Refused);

    // Codes, signals and messages.
    for (code, signal, text, word) in [
        (Some(0), None, "", "film"),
        (Some(0), None, "note\n", "words"),
        (Some(101), None, "thread 'main' panicked at x\n", "panic"),
        (Some(1), None, "thread 'main' panicked at x\nrender2mpeg: scene.glb\n", "panic"),
        (Some(3), None, refusal, "exit code"),
        (Some(1), None, "", "one line"),
        (Some(1), None, "render2mpeg: scene.glb\nmore\n", "one line"),
        (Some(1), None, "render2mpeg: something\n", "no file"),
        (Some(1), None, "render2mpeg: scene.glb \u{1b}[2J\n", "control"),
        (None, Some(9), "", "signal 9"),
    ] {
        let Verdict::Fault(fault) = judge(code, signal, text) else { panic!("{text}: no fault") };
        assert!(fault.contains(word), "{text}: {fault}");
    }
    let endless = Outcome { code: None, signal: Some(9), endless: true, stderr: Vec::new() };
    assert!(matches!(Verdict::of(&film, &endless, &scene, &[]), Verdict::Fault(_)));

    // Remaining files, and files outside the output folder.
    for place in ["out/film.m2v.part", "scene/new", "tmp/new", "new"] {
        fs::write(film.folder.join(place), "").unwrap();
        assert!(matches!(judge(Some(1), None, refusal), Verdict::Fault(_)), "{place}");
        fs::remove_file(film.folder.join(place)).unwrap();
    }

    // Invalid films.
    for (bytes, report, is_film) in [
        (&b"\0\0\x01\xb3"[..], r#"{"frames":[{"non_finite_pixels":0}]}"#, true),
        (b"\0\0\x01\xb3", r#"{"frames":[{"non_finite_pixels":3}]}"#, false),
        (b"\0\0\x01\xb3", r#"{"frames":[]}"#, false),
        (b"", r#"{"frames":[{"non_finite_pixels":0}]}"#, false),
    ] {
        fs::write(film.out().join("film.m2v"), bytes).unwrap();
        fs::write(film.out().join("film.report.json"), report).unwrap();
        assert_eq!(judge(Some(0), None, "") == Verdict::Rendered, is_film, "{report}");
    }
}
