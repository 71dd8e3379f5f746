//! Untrusted scenes, and the files that they refer to.

use glam::{Vec3, vec3};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use tests::{
    Finished, Glb, Moving, Quad, assert_fails, checkered_room, program, render2mpeg, sorted_names,
    start_until_checkpoint,
};

const SMALL: &str = "--size 32x32 --vpls 60 --photons 1000";

/// Encodes one texel as PNG. Its palette color distinguishes files of equal size.
fn png(gray: u8) -> Vec<u8> {
    laboratory::compare::png_file::encode(&plane::Plane::filled(2, 2, [gray; 3]))
}

/// Encodes a Radiance picture of one color.
fn hdr(value: u8) -> Vec<u8> {
    [&b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n"[..], &[value, value, value, 129].repeat(4)].concat()
}

/// Writes a room with a buffer, an image and a sky in separate files, with spaces in their names.
fn with_files(folder: &Path, name: &str) -> Glb {
    let mut room = checkered_room(Moving::Box);
    fs::write(folder.join("my data.bin"), &room.bin).unwrap();
    fs::write(folder.join("my tex.png"), png(200)).unwrap();
    fs::write(folder.join("sky.hdr"), hdr(100)).unwrap();
    room.json["buffers"] = json!([{ "uri": "my%20data.bin", "byteLength": room.bin.len() }]);
    room.json["images"] = json!([{ "uri": "my%20tex.png" }]);
    room.json["textures"] = json!([{ "source": 0 }]);
    room.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    fs::write(folder.join(name).with_extension("toml"), "[sky]\nimage = \"sky.hdr\"\n").unwrap();
    room
}

#[test]
fn a_film_is_continued_with_the_files_it_was_begun_with() {
    for scene in ["room.gltf", "room.glb"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let room = with_files(folder, scene);
        let bytes = if scene.ends_with("gltf") { room.json.to_string().into_bytes() } else { room.to_bytes() };
        fs::write(folder.join(scene), bytes).unwrap();
        // Kill the renderer after its first checkpoint.
        let words = format!("render {scene} -o film.m2v --checkpoint 0 -q --frames 5000 {SMALL}");
        let words: Vec<&str> = words.split_whitespace().collect();
        let mut child = start_until_checkpoint(folder, &words, "film.m2v");
        child.kill().unwrap();
        child.wait().unwrap();
        let resumed = [&words[..], &["--resume"]].concat();

        // Each file with different bytes of the same length.
        let mut data = room.bin.clone();
        *data.last_mut().unwrap() ^= 1;
        let toml = "[sky]\nimage = \"./sky.hdr\"\n".to_owned();
        for (name, other) in
            [("my data.bin", data), ("my tex.png", png(90)), ("sky.hdr", hdr(101)), ("room.toml", toml.into())]
        {
            let before = fs::read(folder.join(name)).unwrap();
            fs::write(folder.join(name), other).unwrap();
            assert_fails(folder, &resumed, &["film.m2v.checkpoint", "scene has changed"]);
            fs::write(folder.join(name), before).unwrap();
        }

        // With the original files, the film is continued, under any spelling of its path.
        let typed = format!("./{scene}");
        let short: Vec<&str> = resumed.iter().map(|&word| if word == scene { &typed[..] } else { word }).collect();
        let mut child = Command::new(program())
            .args(&short)
            .args(["--progress", "json"])
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("render2mpeg starts");
        let mut line = String::new();
        std::io::BufRead::read_line(&mut std::io::BufReader::new(child.stdout.take().unwrap()), &mut line).unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
        let begin: Value = serde_json::from_str(&line).expect("a line of progress");
        assert!(begin["first_frame"].as_u64().is_some_and(|first| first > 0), "{line}");
    }
}

#[test]
fn names_lead_to_regular_files_in_the_folder_of_the_scene() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("scene");
    fs::create_dir(&folder).unwrap();
    let room = with_files(&folder, "room.gltf");
    fs::copy(folder.join("my tex.png"), outer.path().join("secret.png")).unwrap();
    let words = ["plan", "room.gltf"];
    let written = |uri: &str| {
        let mut json = room.json.clone();
        json["images"][0]["uri"] = uri.into();
        fs::write(folder.join("room.gltf"), json.to_string()).unwrap();
    };
    // Links and pipes exist only on Unix.
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../secret.png", folder.join("link.png")).unwrap();
        rustix::fs::mknodat(rustix::fs::CWD, folder.join("fifo.png"), rustix::fs::FileType::Fifo, 0o600.into(), 0)
            .unwrap();
    }
    // Paths outside the folder, then files of other kinds and missing ones.
    for uri in ["../secret.png", "/etc/passwd", "/dev/zero", "%2e%2e/secret.png", "x/../../secret.png", "link.png"] {
        written(uri);
        assert_fails(&folder, &words, &["room.gltf", "image 0", uri, "outside", "--allow-outside"]);
    }
    for (uri, why) in [("fifo.png", "regular"), ("absent.png", "No such file"), (".", "regular")] {
        written(uri);
        assert_fails(&folder, &words, &["room.gltf", "image 0", uri, why]);
    }

    // `--allow-outside` permits other folders.
    written("../secret.png");
    let trusted = render2mpeg(&folder, &["plan", "room.gltf", "--allow-outside"]);
    assert_eq!(trusted.code, Some(0), "{}", trusted.stderr);

    // The sky follows the same rules. An image that no surface shows is never read, at the start or in a continued film.
    written("my%20tex.png");
    fs::write(folder.join("room.toml"), "[sky]\nimage = \"../secret.png\"\n").unwrap();
    assert_fails(&folder, &words, &["room.toml", "../secret.png", "outside"]);
    fs::remove_file(folder.join("room.toml")).unwrap();
    let mut json = room.json.clone();
    json["images"].as_array_mut().unwrap().push(json!({ "uri": "/dev/zero" }));
    fs::write(folder.join("room.gltf"), json.to_string()).unwrap();
    let words = format!("render room.gltf -o film.m2v -q --frames 1 --resume {SMALL}");
    let finished = render2mpeg(&folder, &words.split_whitespace().collect::<Vec<_>>());
    assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""));
}

#[test]
fn outputs_take_the_place_of_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let room = with_files(folder, "room.gltf");
    fs::write(folder.join("room.gltf"), room.json.to_string()).unwrap();
    fs::write(folder.join("job.toml"), "frames = 1\n").unwrap();
    fs::create_dir(folder.join("sub")).unwrap();
    let before = sorted_names(folder);
    let contents = |name: &str| fs::read(folder.join(name)).unwrap();
    // Each option and the words of its error; no file changes.
    for (options, words) in [
        ("--report film.m2v", ["--report", "-o"]),
        ("--report ./film.m2v", ["--report", "-o"]),
        ("--report sub/../film.m2v", ["--report", "-o"]),
        ("--html film.m2v", ["--html", "-o"]),
        ("--trace film.m2v", ["--trace", "-o"]),
        ("--y4m film.m2v", ["--y4m", "-o"]),
        ("--report film.m2v.checkpoint", ["--report", "checkpoint"]),
        ("--y4m a --html a", ["--html", "--y4m"]),
        ("--report room.gltf", ["--report", "scene"]),
        ("--html room.toml", ["--html", "scene"]),
        ("--y4m sky.hdr", ["--y4m", "scene"]),
        ("--report", ["--report", "scene"]),
        ("--config job.toml --report job.toml", ["--report", "--config"]),
    ] {
        let mut arguments = vec!["render", "room.gltf", "-o", "film.m2v", "-q"];
        arguments.extend(options.split_whitespace());
        if options == "--report" {
            arguments.push("my data.bin");
        }
        let Finished { code, stderr, .. } = render2mpeg(folder, &arguments);
        assert_eq!(code, Some(2), "{options}: {stderr}");
        assert!(words.iter().all(|word| stderr.contains(word)), "{options}: {stderr}");
        assert_eq!((stderr.lines().count(), sorted_names(folder)), (1, before.clone()), "{options}");
        assert_eq!(contents("my data.bin"), room.bin, "{options}");
    }

    // Other commands follow the same rule.
    assert_fails(folder, &["bake", "room.gltf", "-o", "room.gltf"], &["-o", "scene"]);
    assert_fails(folder, &["reference", "room.gltf", "-o", "my tex.png"], &["-o", "scene"]);
    assert_eq!(sorted_names(folder), before);
}

#[test]
fn names_forge_nothing_on_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut room = with_files(folder, "room.gltf");
    let evil = "\u{1b}[2J\nrender2mpeg: all is well\r\u{202e}";
    room.json["images"][0]["uri"] = evil.into();
    fs::write(folder.join("room.gltf"), room.json.to_string()).unwrap();
    let is_plain = |text: &str| !text.chars().any(|c| (c.is_control() && c != '\n') || c == '\u{202e}');
    let Finished { code, stderr, .. } = render2mpeg(folder, &["plan", "room.gltf"]);
    assert_eq!((code, stderr.lines().count()), (Some(1), 1), "{stderr:?}");
    assert!(is_plain(&stderr) && stderr.contains("\\u{1b}"), "{stderr:?}");

    // Notes about unsupported features contain names too.
    room.json["images"][0]["uri"] = "my%20tex.png".into();
    room.json["animations"][0]["name"] = evil.into();
    let animation = room.json["animations"][0].clone();
    room.json["animations"].as_array_mut().unwrap().push(animation);
    room.json["extensionsUsed"] = json!([evil]);
    fs::write(folder.join("room.gltf"), room.json.to_string()).unwrap();
    let Finished { code, stdout, stderr } = render2mpeg(folder, &["plan", "room.gltf"]);
    assert_eq!(code, Some(0), "{stderr:?}");
    assert!(is_plain(&stdout) && is_plain(&stderr), "{stdout:?} {stderr:?}");
    assert!(!stdout.lines().any(|line| line.starts_with("render2mpeg: ")), "{stdout}");
}

/// Some editors put a byte order mark in front of UTF-8.
#[test]
fn a_byte_order_mark_is_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let room = with_files(folder, "room.gltf");
    for (name, text) in [("room.gltf", room.json.to_string()), ("room.toml", "[video]\nframes = 7\n".into())] {
        fs::write(folder.join(name), [b"\xef\xbb\xbf", text.as_bytes()].concat()).unwrap();
    }
    let printed = render2mpeg(folder, &["render", "room.gltf", "--print-config"]);
    assert_eq!(printed.code, Some(0), "{}", printed.stderr);
    assert!(printed.stdout.contains("frames = 7"), "{}", printed.stdout);
}

#[test]
#[cfg(unix)]
fn a_folder_that_may_not_be_written_to_is_one_line() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    checkered_room(Moving::Box).write(&folder.join("room.glb"));
    let closed = folder.join("closed");
    fs::create_dir(&closed).unwrap();
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o500)).unwrap();
    if fs::write(closed.join("probe"), b"").is_ok() {
        println!("left out: whoever runs this may write anywhere");
        return;
    }
    assert_fails(folder, &["render", "room.glb", "-o", "closed/film.m2v"], &["closed/film.m2v", "-o"]);
}

/// Builds `instances` copies, side by side, of one mesh of `triangles` triangles, and a camera.
fn sheets(triangles: usize, instances: usize) -> Glb {
    let mut scene = checkered_room(Moving::Nothing);
    let side = |k: usize| k as f32 * 0.01;
    let quads: Vec<Quad> =
        (0..triangles / 2).map(|k| [vec3(side(k % 70), side(k / 70), 0.0), Vec3::X * 0.01, Vec3::Y * 0.01]).collect();
    let first = scene.add(&quads, Vec3::splat(0.5), Vec3::ZERO);
    let mesh = scene.json["nodes"][first]["mesh"].clone();
    for k in 1..instances {
        let place = [side(k % 40) - 0.2, side(k / 40) - 0.2, -0.5 - side(k)];
        scene.json["nodes"].as_array_mut().unwrap().push(json!({ "mesh": mesh, "translation": place }));
        scene.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(first + k));
    }
    scene
}

#[test]
fn ten_million_triangles_of_one_mesh_take_little_memory() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = sheets(10_000, 1000);
    assert!(scene.to_bytes().len() < 1_000_000);
    scene.write(&folder.join("sheets.glb"));
    let words = format!("render sheets.glb -o film.m2v --frames 1 {SMALL}");
    let finished = render2mpeg(folder, &words.split_whitespace().collect::<Vec<_>>());
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    let report: Value = serde_json::from_slice(&fs::read(folder.join("film.report.json")).unwrap()).unwrap();
    // If the system reports it.
    if let Some(bytes) = report["summary"]["peak_memory_bytes"].as_u64() {
        assert!(bytes < 300_000_000, "{bytes}");
    }
}

#[test]
fn what_takes_too_much_memory_is_refused_before_work_begins() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    sheets(10_000, 2).write(&folder.join("sheets.glb"));
    for (limit, size) in [("200M", "1024x1024"), ("1G", "2048x2048")] {
        let words = ["render", "sheets.glb", "-o", "film.m2v", "--size", size, "--max-memory", limit];
        assert_fails(folder, &words, &["sheets.glb", "--max-memory", "--size"]);
        assert_eq!(sorted_names(folder), ["sheets.glb"]);
    }
    for limit in ["8", "0G", "lots", "-1G", "1e30G", "NaNM"] {
        let words = ["render", "sheets.glb", "--max-memory", limit];
        assert_eq!(render2mpeg(folder, &words).code, Some(2), "{limit}");
    }
    let plan = render2mpeg(folder, &["plan", "sheets.glb", "--size", "1024x1024"]);
    assert!(plan.stdout.contains("memory: about ") && plan.stdout.contains("1024x1024"), "{}", plan.stdout);
}
