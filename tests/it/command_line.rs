//! Options from a file, and the program's output about itself and its work.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::{Finished, Moving, assert_fails, checkered_room, program, render2mpeg, sorted_names};

fn folder_with_room() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Camera).write(&folder.path().join("room.glb"));
    folder
}

const JOB: &str = r#"
scene = "room.glb"
output = "film.m2v"
size = "48x32"
frames = 4
vpls = 60
photons = 3000
qscale = 10
cache = false
bitrate = "1M"
run-everything = true
exr = "frames"
aov = ["depth", "albedo"]
"#;

/// Runs the program in `folder`, which must succeed.
fn run(folder: &Path, arguments: &[&str]) -> Finished {
    let finished = render2mpeg(folder, arguments);
    assert_eq!(finished.code, Some(0), "{arguments:?}: {}", finished.stderr);
    finished
}

fn report(folder: &Path, name: &str) -> Value {
    serde_json::from_slice(&fs::read(folder.join(name)).unwrap()).unwrap()
}

/// Options without a default value, which a printed file lacks.
const UNDEFINED: [&str; 33] = [
    "baked",
    "bounces",
    "checkpoint",
    "chunk",
    "chunk-index",
    "light",
    "range",
    "trace",
    "threads",
    "y4m",
    "html",
    "importance",
    "importance-gain",
    "tiles",
    "max-memory",
    "camera",
    "animation",
    "variant",
    "point-size",
    "studio",
    "background",
    "sky",
    "orbit",
    "target",
    "fov",
    "up",
    "turn",
    "set",
    "preset",
    "from",
    "to",
    "every",
    "png",
];

#[test]
fn a_file_has_every_option_and_the_command_line_overrides_it() {
    let folder = folder_with_room();
    let folder = folder.path();
    // The file sets options, and the command line overrides two.
    fs::write(folder.join("job.toml"), JOB).unwrap();
    run(folder, &["render", "--config", "job.toml", "--quiet", "--qscale", "12", "--frames", "3"]);
    let settings = &report(folder, "film.report.json")["settings"];
    assert_eq!((&settings["qscale"], &settings["frames"]), (&12.into(), &3.into()), "typed");
    assert_eq!((&settings["size"]["width"], &settings["cache"]), (&48.into(), &false.into()), "of the file");
    assert_eq!((&settings["bitrate"], &settings["leave_out"]), (&1_000_000.into(), &false.into()));
    assert_eq!(settings["aov"], serde_json::json!(["depth", "albedo"]));
    assert_eq!(sorted_names(&folder.join("frames")).len(), 3);
    // `plan` uses the options that concern it.
    assert!(run(folder, &["plan", "--config", "job.toml"]).stdout.contains("every photon is traced for every frame"));

    // The printed options give the same film, and the same output when printed again.
    let words = ["render", "--config", "job.toml", "--kappa", "0.3", "--within", "0.99", "--print-config"];
    let also = ["--also", "film.mp4", "--also", "film.webm"];
    let printed = run(folder, &[&words[..], &also].concat()).stdout;
    for line in [
        "also = [\"film.mp4\", \"film.webm\"]\n",
        "qscale = 10\n",
        "kappa = 0.3\n",
        "stopping = \"calibrated\"\n",
        "within = 0.99\n",
    ] {
        assert!(printed.contains(line), "{line}{printed}");
    }
    fs::write(folder.join("printed.toml"), &printed).unwrap();
    assert_eq!(run(folder, &["render", "--config", "printed.toml", "--print-config"]).stdout, printed);
    // The output contains every option that a file may set, except options without a default.
    let help = run(folder, &["render", "--help"]).stdout;
    let options = help.split_whitespace().filter_map(|word| word.strip_prefix("--"));
    for option in
        options.filter(|option| option.chars().all(|c| c.is_ascii_lowercase() || c == '-') && !option.is_empty())
    {
        let without = [
            "allow-outside",
            "config",
            "display-server",
            "print-config",
            "resume",
            "help",
            "verbose",
            "quiet",
            "progress",
            "overwrite",
            "keep-checkpoint",
            "watch",
        ];
        let named = printed.lines().any(|line| line.starts_with(&format!("{option} = ")));
        assert!(named || without.contains(&option) || UNDEFINED.contains(&option), "{option} is not printed");
    }
}

#[test]
fn a_wrong_file_is_explained() {
    let folder = folder_with_room();
    for (text, words) in [
        ("qscal = 8", &["job.toml", "qscal", "qscale"][..]),
        ("qscale = 8\n\n  x = [", &["job.toml", "line 3"]),
        ("size = \"big\"", &["job.toml", "big", "512x512"]),
        ("size = [1, 2]", &["job.toml", "1,2"]),
        ("cbr = 1", &["job.toml", "cbr", "true or false"]),
        ("config = \"other.toml\"", &["job.toml", "config"]),
        ("width = 640", &["job.toml", "there is no option width", "--size WxH"]),
        ("set = [\"exposure=0\"]", &["job.toml", "exposure is 0", "must be above 0"]),
        ("[video]\nframes = 3", &["job.toml", "video"]),
        ("scene = 3", &["job.toml", "scene"]),
    ] {
        fs::write(folder.path().join("job.toml"), text).unwrap();
        assert_fails(folder.path(), &["render", "room.glb", "--config", "job.toml"], words);
    }
    fs::write(folder.path().join("job.toml"), "qscale = 8").unwrap();
    assert_fails(folder.path(), &["render", "--config", "job.toml"], &["job.toml", "scene ="]);
    assert_fails(folder.path(), &["render", "--config", "no.toml"], &["no.toml"]);
    assert_fails(folder.path(), &["render"], &["SCENE"]);
}

#[test]
fn shells_and_manuals_know_the_options() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let text = run(folder.path(), &["completions", shell]).stdout;
        assert!(text.contains("render2mpeg") && text.contains("print-config"), "{shell}");
    }
    let page = run(folder.path(), &["man", "render"]).stdout;
    assert!(page.contains(".TH render2mpeg-render") && page.contains("qscale"), "{page}");
    assert!(run(folder.path(), &["man"]).stdout.contains(".TH render2mpeg "));
    assert_fails(folder.path(), &["man", "paint"], &["paint", "--help"]);
}

const SMALL: [&str; 12] =
    ["render", "room.glb", "-o", "film.m2v", "--size", "48x32", "--frames", "4", "--vpls", "60", "--photons", "3000"];

#[test]
fn other_programs_can_follow_and_so_can_people() {
    let folder = folder_with_room();
    let finished = run(folder.path(), &[&SMALL[..], &["--progress", "json", "--quiet"]].concat());
    assert_eq!(finished.stderr, "");
    let lines: Vec<Value> = finished.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let events: Vec<&str> = lines.iter().map(|line| line["event"].as_str().unwrap()).collect();
    assert_eq!(events, ["begin", "frame", "frame", "frame", "frame", "end"]);
    let report = report(folder.path(), "film.report.json");
    for (line, frame) in lines[1..5].iter().zip(report["frames"].as_array().unwrap()) {
        assert_eq!((&line["frame"]["index"], &line["frame"]["bits"]), (&frame["index"], &frame["bits"]));
    }
    assert_eq!(lines[5]["summary"]["bits_total"], report["summary"]["bits_total"]);

    let told = run(folder.path(), &[&SMALL[..], &["-v", "--checkpoint", "0", "--overwrite"]].concat()).stderr;
    assert!(told.contains("frame 3: P, ") && told.contains("checkpoint after frame 3"), "{told}");
    assert!(!told.contains('\x1b') && !told.contains("shade"), "{told}");
    let told = run(folder.path(), &[&SMALL[..], &["-vv", "--overwrite"]].concat()).stderr;
    assert!(told.contains("shade"), "{told}");
    assert_fails(folder.path(), &[&SMALL[..], &["-v", "--quiet"]].concat(), &["--quiet"]);
}

#[test]
fn the_trace_shows_every_stage_of_every_frame() {
    let folder = folder_with_room();
    run(folder.path(), &[&SMALL[..], &["--trace", "trace.json", "--quiet"]].concat());
    let trace = report(folder.path(), "trace.json");
    let events = trace["traceEvents"].as_array().unwrap();
    let bar = |stage: &str, frame: u64| {
        let found: Vec<&Value> =
            events.iter().filter(|bar| bar["name"] == stage && bar["args"]["frame"] == frame).collect();
        assert_eq!(found.len(), 1, "{stage} of frame {frame}");
        let begin = found[0]["ts"].as_f64().unwrap();
        (begin, begin + found[0]["dur"].as_f64().unwrap(), found[0]["tid"].as_u64().unwrap())
    };
    let mut sum = 0.0;
    for frame in 0..4 {
        let stages = ["prepare", "shade", "display", "mask"].map(|stage| bar(stage, frame));
        // The stages process a frame one after the other, each on its own thread.
        assert!(stages.windows(2).all(|two| two[0].1 <= two[1].0 && two[0].2 != two[1].2), "{stages:?}");
        let encode = bar("encode", frame);
        assert!(stages[2].1 <= encode.0);
        sum += stages.iter().chain([&encode]).map(|(begin, end, _)| end - begin).sum::<f64>();
        if frame > 0 {
            // The feedback: shading waits for the previous frame's thresholds.
            assert!(bar("mask", frame - 1).0 <= stages[1].0);
        }
    }
    assert!((trace["otherData"]["stage_seconds"].as_f64().unwrap() - sum / 1e6).abs() < 1e-3);
    let names: Vec<&str> = events.iter().filter_map(|event| event["args"]["name"].as_str()).collect();
    assert!(["prepare", "shade", "display", "encode", "mask"].iter().all(|stage| names.contains(stage)), "{names:?}");
}

#[test]
fn files_are_replaced_only_where_the_user_says_so() {
    let folder = folder_with_room();
    let folder = folder.path();
    let render =
        |words: &[&str]| render2mpeg(folder, &[&SMALL[..], &["-o", "film.m2v", "--frames", "2"], words].concat());
    assert_eq!(render(&[]).code, Some(0));
    let first = fs::read(folder.join("film.m2v")).unwrap();

    // Only `--overwrite` replaces a film and its report.
    let refused = render(&["--qscale", "40"]);
    assert_eq!(refused.code, Some(1), "{}", refused.stderr);
    assert!(refused.stderr.contains("film.m2v already exists") && refused.stderr.contains("--overwrite"));
    assert_eq!(fs::read(folder.join("film.m2v")).unwrap(), first);
    assert_eq!(render(&["--qscale", "40", "--overwrite"]).code, Some(0));
    let second = fs::read(folder.join("film.m2v")).unwrap();
    assert_ne!(second, first);

    // A finished film needs no work; one with other settings or length is not replaced.
    let finished = render(&["--qscale", "40", "--resume"]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    for words in [&["--qscale", "30", "--resume"][..], &["--qscale", "40", "--resume", "--frames", "3"]] {
        let refused = render(words);
        assert_eq!(refused.code, Some(1), "{}", refused.stderr);
        assert!(refused.stderr.contains("--keep-checkpoint"), "{}", refused.stderr);
    }
    assert_eq!(fs::read(folder.join("film.m2v")).unwrap(), second);
}

#[test]
fn a_finished_film_is_lengthened() {
    let folder = folder_with_room();
    let folder = folder.path();
    for more in [&["-o", "film.m2v"][..], &["-o", "film.m2v", "--bframes", "2"], &["-o", "film.mpg"]] {
        let render = |words: &[&str]| render2mpeg(folder, &[&SMALL[..], more, &["--overwrite"], words].concat());
        assert_eq!(render(&["--frames", "7"]).code, Some(0));
        let whole = fs::read(folder.join(more[1])).unwrap();
        assert_eq!(render(&["--frames", "4", "--keep-checkpoint"]).code, Some(0));
        assert_ne!(fs::read(folder.join(more[1])).unwrap(), whole);
        let fewer = render(&["--frames", "3", "--resume"]);
        assert_eq!(fewer.code, Some(1), "{}", fewer.stderr);
        assert!(fewer.stderr.contains("--frames"), "{}", fewer.stderr);
        let longer = render(&["--frames", "7", "--resume"]);
        assert_eq!(longer.code, Some(0), "{}", longer.stderr);
        assert_eq!(fs::read(folder.join(more[1])).unwrap(), whole, "{more:?}");
    }

    // A file that starts with its length cannot be extended.
    let render = |words: &[&str]| render2mpeg(folder, &[&SMALL[..], &["-o", "film.mkv"], words].concat());
    assert_eq!(render(&["--frames", "4", "--keep-checkpoint"]).code, Some(0));
    let longer = render(&["--frames", "7", "--resume"]);
    assert_eq!(longer.code, Some(1), "{}", longer.stderr);
    assert!(longer.stderr.contains("frames was 4 and is now 7"), "{}", longer.stderr);
}

#[test]
fn a_watched_scene_is_rendered_again_when_it_changes() {
    let folder = folder_with_room();
    let folder = folder.path();
    let words = [&SMALL[..], &["-o", "film.m2v", "--frames", "1", "--watch"]].concat();
    let mut watching = Command::new(program())
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("render2mpeg starts");
    // Limits a run that would otherwise not end.
    let deadline = Instant::now() + Duration::from_secs(120);
    let film = |other_than: &[u8]| loop {
        match fs::read(folder.join("film.m2v")) {
            Ok(film) if film != other_than => break film,
            _ => assert!(Instant::now() < deadline, "no other film"),
        }
        std::thread::sleep(Duration::from_millis(50));
    };

    // The film changes with the settings file.
    let first = film(b"");
    fs::write(folder.join("room.toml"), "[tone_mapping]\nexposure = 0.01\n").unwrap();
    let second = film(&first);
    assert_ne!(first, second);
    watching.kill().unwrap();
    watching.wait().unwrap();
}

#[test]
fn a_scene_alone_is_rendered_and_scenes_of_other_programs_are_named() {
    let folder = folder_with_room();
    let folder = folder.path();
    let words = [&SMALL[1..], &["--frames", "1", "-o", "film.m2v"]].concat();
    assert_eq!(run(folder, &words).code, Some(0));
    for (name, word) in [("a.blend", "Blender"), ("a.obj", "Blender"), ("a.FBX", "FBX"), ("a.usdz", "USD")] {
        fs::write(folder.join(name), b"x").unwrap();
        for words in [&["render", name][..], &[name], &["plan", name]] {
            let refused = render2mpeg(folder, words);
            assert_eq!(refused.code, Some(1), "{words:?} {}", refused.stderr);
            assert!(refused.stderr.contains(word) && refused.stderr.contains("glTF"), "{}", refused.stderr);
        }
    }
}

#[test]
fn cameras_animations_and_settings_are_chosen_on_the_command_line() {
    let folder = folder_with_room();
    let folder = folder.path();
    let film = |name: &str, words: &[&str]| {
        let done = run(folder, &[&SMALL[..], &["--frames", "1", "-o", name], words].concat());
        assert_eq!(done.code, Some(0), "{}", done.stderr);
        fs::read(folder.join(name)).unwrap()
    };
    // Settings and the default camera.
    let plain = film("a.m2v", &[]);
    assert_ne!(film("b.m2v", &["--set", "exposure=0.1"]), plain);
    assert_ne!(film("c.m2v", &["--set", "sky.zenith=[0,0,9]", "--set", "horizon=[9,0,0]"]), plain);
    assert_eq!(film("d.m2v", &["--camera", "0"]), plain);

    // Unknown cameras and animations.
    for (words, word) in
        [(&["--camera", "nobody"][..], "nobody"), (&["--camera", "7"], "7"), (&["--animation", "none"], "none")]
    {
        let refused = render2mpeg(folder, &[&SMALL[..], words].concat());
        assert_eq!(refused.code, Some(1), "{}", refused.stderr);
        assert!(refused.stderr.contains(word), "{}", refused.stderr);
    }
    assert_eq!(render2mpeg(folder, &[&SMALL[..], &["--set", "exposure"]].concat()).code, Some(2));

    // Printed and read again, the options give the same film.
    let printed = run(folder, &[&SMALL[..], &["--set", "exposure=0.1", "--camera", "0", "--print-config"]].concat());
    fs::write(folder.join("job.toml"), &printed.stdout).unwrap();
    let again = run(folder, &["render", "--config", "job.toml", "--frames", "1", "-o", "e.m2v", "-q"]);
    assert_eq!(again.code, Some(0), "{}", again.stderr);
    assert_eq!(fs::read(folder.join("e.m2v")).unwrap(), fs::read(folder.join("b.m2v")).unwrap());
}

/// Every invalid argument ends with exit code 2, for any scene. Errors that another machine or file could avoid end with 1.
/// 1.
#[test]
fn wrong_arguments_end_with_two_and_a_line() {
    let folder = folder_with_room();
    let folder = folder.path();
    fs::write(folder.join("there.mpg"), b"a film").unwrap();
    fs::write(folder.join("there.png"), b"a picture").unwrap();
    fs::write(folder.join("broken.glb"), b"glTF").unwrap();
    fs::write(folder.join("README.md"), b"# A scene").unwrap();
    // Command line, exit code, and words of the message.
    for (words, code, said) in [
        ("render room.glb --frames 0", 2, "--frames"),
        ("render room.glb --fps 23", 2, "23.976"),
        ("render room.glb --qscale 0", 2, "quantiser"),
        ("render room.glb --qscale many", 2, "qscale"),
        ("render room.glb --size big", 2, "512x512"),
        ("render room.glb --size 0x5", 2, "512x512"),
        ("render room.glb --samples 0", 2, "--samples"),
        ("render room.glb --aov depth", 2, "--exr"),
        ("render room.glb --exr-depth half", 2, "--exr DIR"),
        ("render room.glb --exr frames --exr-depth 16", 2, "half, float"),
        ("render room.glb --cbr", 2, "--bitrate"),
        ("render room.glb --config missing.toml", 2, "missing.toml"),
        ("render room.glb -o film.xyz", 2, ".mpg"),
        ("render room.glb -o film", 2, ".mpg"),
        ("render room.glb --preset best", 2, "preset"),
        ("render room.glb --range 5 -o film.mpg", 2, ".m2v"),
        ("render room.glb --max-memory lots", 2, "8G"),
        ("render room.glb --set exposure", 2, "exposure=1.5"),
        (
            "render room.glb --set exposre=1",
            2,
            "\"exposre=1\" names an unknown setting; settings are operator, exposure, gamma",
        ),
        ("render room.glb --set sky.zenit=1", 2, "zenith, horizon, ground, image, intensity, rotation"),
        (
            "render room.glb --set exposure=0",
            2,
            "for '--set <KEY=VALUE>': exposure is 0; it must be above 0 (1e-20 to 1e20)",
        ),
        ("render room.glb --set gamma=9", 2, "gamma is 9; it must lie in 1 to 4"),
        ("render room.glb --set exposure=bright", 2, "invalid type: string \"bright\", expected a number"),
        ("render room.glb --set tone_mapping.operator=sepia", 2, "for '--set <KEY=VALUE>': unknown variant `sepia`"),
        ("render room.glb --set video.fps=foo", 2, "invalid type: string \"foo\", expected a number"),
        ("render room.glb --set fps=23", 2, "23.976"),
        ("render room.glb --set sky.intensity=2", 1, "with sky.intensity = 2: [sky] needs zenith and horizon"),
        ("render room.glb --unheard-of", 2, "unheard-of"),
        ("render room.glb --width 640", 2, "there is no option --width: write --size WxH, such as --size 1280x720"),
        ("render room.glb --height=480", 2, "there is no option --height: write --size WxH"),
        ("render room.glb --resolution 640x480", 2, "--size WxH"),
        ("render room.glb --quality 5", 2, "write --qscale Q, 1 (best) to 112 (smallest)"),
        ("render room.glb --crf 20", 2, "--qscale Q"),
        ("render room.glb --audio a.wav", 2, "there is no option --audio: films have no sound"),
        ("render room.glb --spp 16", 2, "write --samples N"),
        ("render room.glb --start 5", 2, "write --from K"),
        ("render room.glb --end 9", 2, "write --to K"),
        ("render room.glb --exposure 2", 2, "write --set exposure=1.5"),
        ("still room.glb --quality 5", 2, "write --preset draft, good or final"),
        ("reference room.glb --samples 16", 2, "write --spp N"),
        ("room.glb --width 640", 2, "--size WxH"),
        ("render", 2, "SCENE"),
        ("paint room.glb", 2, "paint"),
        ("still room.glb -o film.mpg", 2, ".png"),
        ("reference room.glb -o truth.tif", 2, ".exr"),
        ("join -o film.mpg", 2, "PART"),
        ("join part.m2v -o there.png", 2, "there.png: unknown film format; name the output .mpg"),
        ("render missing.glb", 1, "missing.glb"),
        ("render broken.glb", 1, "broken.glb"),
        ("render README.md", 1, "README.md: this is not a glTF file; scenes are .glb or .gltf files"),
        ("render room.glb -o film.m2v --exr there.png", 1, "there.png is a file, not a folder; choose another name"),
        ("sweep room.glb -o there.png", 1, "there.png is a file, not a folder; choose another name"),
        ("render room.glb --camera nobody", 1, "nobody"),
        ("render room.glb -o nowhere/film.mpg", 1, "nowhere/film.mpg"),
        ("render room.glb -o there.mpg", 1, "--overwrite"),
        ("render scene.blend", 1, "Blender"),
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let refused = render2mpeg(folder, &words);
        assert_eq!(refused.code, Some(code), "{words:?}: {}", refused.stderr);
        assert_fails(folder, &words, &[said]);
    }
    let before = ["README.md", "broken.glb", "room.glb", "there.mpg", "there.png"];
    assert_eq!(sorted_names(folder), before, "nothing is left behind");
}

#[test]
fn help_answers_what_users_ask() {
    let folder = folder_with_room();
    for (words, said) in [
        ("-h", "A scene without a command is rendered: render2mpeg scene.glb is"),
        ("-h", "render2mpeg <SCENE>"),
        ("render -h", "--help lists all options: --from, --to, --camera"),
        ("render -h", "Films are MPEG-2, also in .mp4 and .mkv."),
        ("render --help", "sky.intensity=2 needs a [sky] in that file"),
        ("compare -h", "render -o film.mpg --y4m film.y4m writes"),
        ("compare -h", "render --antialiasing off --exr frames,\nand reference"),
        ("reference -h", "--frame 10 --center -o truth.exr"),
        ("plan room.glb --frames 1", "; 1 frame in about"),
        ("plan room.glb --frames 2", "; 2 frames in about"),
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let shown = run(folder.path(), &words).stdout;
        assert!(shown.contains(said), "{words:?}: {shown}");
    }
    let plan = run(folder.path(), &["plan", "-h"]).stdout;
    assert!(plan.contains("--qscale") && !plan.contains("--output"), "{plan}");
}

#[test]
fn the_page_of_options_is_that_of_the_program() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference/options.md"));
    assert!(page.unwrap() == ::program::options_page(), "write docs/reference/options.md again by its command");
}
