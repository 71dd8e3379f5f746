//! `render2mpeg sweep` and `render --html`: figures compared with single commands, and pages in a real browser.

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use tests::{Moving, Shown, assert_fails, checkered_room, program, render, render2mpeg, show, sorted_names};

/// Writes a room with fixed exposure, so that all its films are comparable.
fn folder_with_room() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("room.glb"), checkered_room(Moving::Camera).to_bytes()).unwrap();
    std::fs::write(folder.path().join("room.toml"), "[tone_mapping]\nexposure = 0.5\n").unwrap();
    folder
}

const COMMON: &str = "--size 64x64 --frames 3 --vpls 60 --photons 3000";

#[test]
fn a_sweep_says_what_single_commands_say() {
    let folder = folder_with_room();
    let arguments = format!(
        "sweep room.glb -o swept --qscale 4,32 --methods perceptual,perceptual-cache,paths-4 --threads 2 --quiet {COMMON}"
    );
    let finished = render2mpeg(folder.path(), &arguments.split_whitespace().collect::<Vec<&str>>());
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""));
    let json = std::fs::read(folder.path().join("swept/sweep.json")).unwrap();
    let swept: Value = serde_json::from_slice(&json).unwrap();
    let runs = swept["runs"].as_array().unwrap();
    // Both baselines are included: five methods at two quantisers.
    assert_eq!(runs.len(), 10);
    let run = |method: &str, qscale: u64| {
        runs.iter().find(|run| run["method"] == method && run["qscale"] == qscale).expect("it was requested")
    };
    let number = |value: &Value| value.as_f64().expect("a number");

    // One run, repeated with `render`, `compare` and ffmpeg's decoder.
    let room = folder.path().join("room.glb");
    let film = render(folder.path(), "film", &room, &format!("{COMMON} --qscale 32 --thresholds perceptual"));
    render(folder.path(), "truth", &room, &format!("{COMMON} --lighting all-lights --cache off --y4m truth.y4m"));
    let compared = render2mpeg(folder.path(), &["compare", "film.m2v", "truth.y4m", "--json"]);
    let compared: Value = serde_json::from_str(&compared.stdout).unwrap();
    let later = |figures: &[f64]| figures[1..].iter().sum::<f64>() / 2.0;
    let steered = run("perceptual-cache", 32);
    assert_eq!(number(&steered["bits"]), later(&film.figures(&["bits"])));
    let frames = compared["frames"].as_array().unwrap();
    let psnr: Vec<f64> = frames.iter().map(|frame| number(&frame["psnr_y"])).collect();
    assert!((number(&steered["decoded"]["psnr_y"]) - later(&psnr)).abs() < 0.05, "{steered} {psnr:?}");
    // The JSON parser may be off by one bit.
    let (swept_size, size) = (number(&steered["cut_size_mean"]), later(&film.figures(&["cut_size_mean"])));
    assert!((swept_size / size - 1.0).abs() < 4.0 * f64::EPSILON, "{swept_size} and {size}");
    assert!(number(&swept["decoder_check"]["equal_share"]) > 0.98, "{}", swept["decoder_check"]);

    // The figures at equal quality are correct, and finer quantisers leave less error.
    for run in runs.iter().filter(|run| !run["against_baseline"].is_null()) {
        let beside = &run["against_baseline"];
        let [psnr, bits, flicker] =
            ["psnr_difference", "bits_ratio", "flicker_ratio"].map(|name| number(&beside[name]));
        assert_eq!(beside["equal_quality"], psnr >= -0.1 && bits <= 1.01 && flicker <= 1.1, "{beside}");
    }
    for method in ["lightcuts", "perceptual", "paths-4"] {
        let psnr = |qscale| number(&run(method, qscale)["decoded"]["psnr_y"]);
        assert!(psnr(4) > psnr(32), "{method}");
    }
    assert!(number(&run("perceptual", 32)["shadow_rays"]) < number(&run("lightcuts", 32)["shadow_rays"]));
    let histogram = &run("lightcuts", 4)["error_by_threshold"];
    assert!(number(&histogram["within"]) > 0.9, "cuts of 2 % are mostly within 2 %: {histogram}");

    let csv = std::fs::read_to_string(folder.path().join("swept/sweep.csv")).unwrap();
    assert_eq!(csv.lines().count(), 11);
    for name in ["plots/decoded_psnr.svg", "maps/threshold_perceptual_32.png"] {
        assert!(folder.path().join("swept").join(name).is_file(), "{name}");
    }
    let plot = std::fs::read_to_string(folder.path().join("swept/plots/decoded_psnr.svg")).unwrap();
    // The legend names each method.
    for method in ["lightcuts", "perceptual", "paths-4"] {
        let label = run(method, 4)["label"].as_str().unwrap_or(method).to_owned();
        assert!(plot.contains(&label), "{label} in the legend");
    }

    // The page starts with the last method, and its player has the reference and the films with cache.
    let html = std::fs::read_to_string(folder.path().join("swept/sweep.html")).unwrap();
    let label = run("perceptual-cache", 4)["label"].as_str().unwrap();
    assert!(html.contains(&format!("<h2>{label}</h2>")), "{label}");
    assert_eq!((html.matches("\"base64\":").count(), html.matches("<option").count()), (5, 10));
    // The page shows every plot that has a file.
    check_page(&folder.path().join("swept/sweep.html"), sorted_names(&folder.path().join("swept/plots")).len());
}

/// Adds the films that a sweep has started so far to `seen`.
fn note_films(folder: &Path, seen: &mut BTreeSet<PathBuf>) {
    let inside = |path: &Path| std::fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
    for working in inside(folder).filter(|path| path.is_dir()) {
        seen.extend(inside(&working));
    }
}

#[test]
fn a_sweep_that_is_ended_early_keeps_what_is_measured() {
    let folder = folder_with_room();
    let words = "sweep room.glb -o swept --qscale 4,32 --methods perceptual-cache --threads 2 --quiet --size 96x96 \
        --frames 30 --vpls 60 --photons 3000";
    let mut child = Command::new(program())
        .args(words.split_whitespace())
        .current_dir(folder.path())
        .spawn()
        .expect("render2mpeg starts");

    // The reference, the baseline, which serves both quantisers, and the film that the signal interrupts.
    let (start, mut seen) = (Instant::now(), BTreeSet::new());
    while seen.len() < 3 {
        assert!(start.elapsed() < Duration::from_secs(480), "three films were not begun: {seen:?}");
        assert_eq!(child.try_wait().expect("a child"), None, "the run ended before the signal");
        std::thread::sleep(Duration::from_millis(2));
        note_films(&folder.path().join("swept"), &mut seen);
    }
    kill_process(Pid::from_raw(child.id() as i32).expect("a process"), Signal::INT).expect("it takes signals");
    assert_eq!(child.wait().expect("a child").code(), Some(130));

    // The results contain the finished runs only.
    let json = std::fs::read(folder.path().join("swept/sweep.json")).unwrap();
    let swept: Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(swept["interrupted"], true);
    let runs: Vec<(&str, u64)> = swept["runs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|run| (run["method"].as_str().unwrap(), run["qscale"].as_u64().unwrap()))
        .collect();
    assert_eq!(runs, [("lightcuts-cache", 4), ("lightcuts-cache", 32)]);
    let csv = std::fs::read_to_string(folder.path().join("swept/sweep.csv")).unwrap();
    assert_eq!(csv.lines().count(), 3);
    assert_eq!(sorted_names(&folder.path().join("swept")), ["maps", "plots", "sweep.csv", "sweep.html", "sweep.json"]);
    let html = std::fs::read_to_string(folder.path().join("swept/sweep.html")).unwrap();
    assert!(html.contains("ended early"));
    check_page(&folder.path().join("swept/sweep.html"), sorted_names(&folder.path().join("swept/plots")).len());
}

#[test]
fn a_run_has_a_page() {
    let folder = folder_with_room();
    render(folder.path(), "film", &folder.path().join("room.glb"), &format!("{COMMON} --html film.html"));
    // Stage times, bits, PSNR, cuts, thresholds, reprojected light and rays; κ and the quantiser are constant.
    check_page(&folder.path().join("film.html"), 8);
}

#[test]
fn what_cannot_be_swept_is_said() {
    let folder = folder_with_room();
    for (arguments, words) in [
        ("sweep room.glb --methods perceptual,photons", &["photons", "perceptual-cache"][..]),
        ("sweep room.glb --qscale 8,33", &["33", "32"]),
        ("sweep gone.glb", &["gone.glb"]),
        ("sweep room.glb -o room.glb/deeper", &["room.glb/deeper"]),
        ("render room.glb --html nowhere/film.html", &["nowhere/film.html"]),
    ] {
        assert_fails(folder.path(), &arguments.split_whitespace().collect::<Vec<&str>>(), words);
    }
}

/// Opens a page in Chromium, in a wide window and at phone width. All `plots` must be in the page, the player must be
/// ready, the console must be empty, and no element may be wider than the window.
fn check_page(page: &Path, plots: usize) {
    let html = std::fs::read_to_string(page).unwrap();
    assert!(!html.contains("http://") && !html.contains("https://"), "a page loads nothing from elsewhere");
    // When the player is ready, the page opens all details, measures itself and posts the result to its parent.
    let measured = page.with_extension("measured.html");
    let script = "<script>const wait = () => { const root = document.documentElement; \
        if (root.dataset.ready !== 'yes') return setTimeout(wait, 5); \
        player.play(false); document.querySelectorAll('details').forEach(one => one.open = true); \
        parent.postMessage({ width: innerWidth, overflow: root.scrollWidth - root.clientWidth, ready: 'yes', \
        broken: [...document.images].filter(image => !image.naturalWidth).length, \
        plots: document.querySelectorAll('svg.plot').length }, '*'); }; addEventListener('load', wait);</script></body>";
    std::fs::write(&measured, html.replace("</body>", script)).unwrap();
    for width in [1280, 390] {
        // Browser windows are at least 500 pixels wide. A frame inside a window may have any width, for layout and media
        // queries alike.
        let shown = page.with_extension("shown.html");
        let name = measured.file_name().unwrap().to_str().unwrap();
        let frame = format!(
            "<!DOCTYPE html><html><head><link rel=\"icon\" href=\"data:,\"></head><body style=\"margin:0\"><script>\
             addEventListener('message', told => Object.assign(document.documentElement.dataset, told.data));</script>\
             <iframe src=\"{name}\" style=\"border:0;width:{width}px;height:1200px\"></iframe></body></html>"
        );
        std::fs::write(&shown, frame).unwrap();
        let Some(Shown { dom, console }) = show(&shown, &["--disable-3d-apis"]) else { return };
        assert!(console.is_empty(), "{console:?}");
        let figures = [
            ("width", width.to_string()),
            ("overflow", "0".into()),
            ("broken", "0".into()),
            ("plots", plots.to_string()),
            ("ready", "yes".into()),
        ];
        for (name, expected) in figures {
            let told = format!("data-{name}=\"{expected}\"");
            assert!(dom.contains(&told), "at {width}, {told}: {}", &dom[..dom.len().min(300)]);
        }
    }
}
