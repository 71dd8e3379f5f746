//! Files from elsewhere, and files made to harm.

use pipeline::{Plan, Settings, Wishes, output::Output};
use render_core::scene;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use tests::{Glb, Moving, checkered_room, cornell, program, shared_scenes};

fn scene_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            scene_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "glb" || extension == "gltf") {
            found.push(path);
        }
    }
}

/// Those that cannot be read, and what the message must say.
const REFUSED: [(&str, &str); 4] = [
    ("khronos-odd/BoxDraco/Box.gltf", "KHR_draco_mesh_compression"),
    ("khronos-odd/broken-MissingBin/BoxTextured.gltf", "BoxTextured0.bin"),
    ("khronos-odd/broken-NoScene/NoScene.gltf", "scene"),
    ("khronos-odd/broken-sceneWrongType/sceneWrongType.gltf", "scene"),
];

#[test]
fn scenes_from_elsewhere_load_or_are_refused_in_a_line() {
    let Some(folder) = shared_scenes() else { return };
    let mut files = Vec::new();
    scene_files(&folder, &mut files);
    files.sort();
    assert!(files.len() > 40, "{} files", files.len());
    let mut wrong = Vec::new();
    for path in files {
        let name = path.strip_prefix(&folder).unwrap().to_str().unwrap();
        let word = REFUSED.iter().find(|(refused, _)| *refused == name).map(|(_, word)| *word);
        match (scene::load(&path), word) {
            (Ok(scene), None) => println!("{name}: {} triangles, {:?}", scene.triangle_count(), scene.warnings),
            (Ok(_), Some(_)) => wrong.push(format!("{name} loads")),
            (Err(error), word) => {
                let message = error.to_string();
                println!("{message}");
                if message.lines().count() != 1 || !word.is_some_and(|word| message.contains(word)) {
                    wrong.push(message);
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A room with one value of its document replaced.
fn room_with(pointer: &str, value: Value) -> Glb {
    let mut glb = checkered_room(Moving::Camera);
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = glb.json.pointer_mut(parent).unwrap_or_else(|| panic!("no {parent}"));
    match parent {
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        other => other[key] = value,
    }
    glb
}

#[test]
fn hostile_files_get_an_error_and_little_memory() {
    let folder = tempfile::tempdir().unwrap();
    let mut nan = checkered_room(Moving::Camera);
    nan.bin[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let mut index = checkered_room(Moving::Camera);
    // The indices of the first mesh lie behind its positions.
    let place = index.json["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize;
    index.bin[place..place + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    let mut deep = Glb::default();
    deep.json["nodes"] = json!((0..200_000).map(|node| json!({ "children": [node + 1] })).collect::<Vec<_>>());
    deep.json["scenes"][0]["nodes"] = json!([0]);
    let buffer = |uri: &str| room_with("/buffers", json!([{ "byteLength": 12, "uri": uri }]));
    let cases = [
        ("cycle", room_with("/nodes/0/children", json!([0]))),
        ("longer-cycle", {
            let mut glb = room_with("/nodes/0/children", json!([1]));
            glb.json["nodes"][1]["children"] = json!([0]);
            glb
        }),
        ("nan", nan),
        ("index", index),
        ("deep", deep),
        ("node-out-of-range", room_with("/scenes/0/nodes", json!([99]))),
        ("mesh-out-of-range", room_with("/nodes/0/mesh", json!(99))),
        ("material-out-of-range", room_with("/meshes/0/primitives/0/material", json!(4_000_000_000u32))),
        ("accessor-out-of-range", room_with("/meshes/0/primitives/0/indices", json!(99))),
        ("view-out-of-range", room_with("/accessors/0/bufferView", json!(99))),
        ("camera-out-of-range", room_with("/nodes/5/camera", json!(7))),
        ("channel-out-of-range", room_with("/animations/0/channels/0/target/node", json!(99))),
        ("sampler-out-of-range", room_with("/animations/0/channels/0/sampler", json!(99))),
        ("negative-count", room_with("/accessors/0/count", json!(-1))),
        ("huge-count", room_with("/accessors/0/count", json!(4_000_000_000u64))),
        ("huger-count", room_with("/accessors/0/count", json!(u64::MAX))),
        ("huge-indices", room_with("/accessors/1/count", json!(1u64 << 62))),
        ("indices-beyond-view", room_with("/accessors/1/count", json!(1_000_000))),
        ("wrong-type", room_with("/accessors/0/type", json!("VEC2"))),
        ("wrong-component", room_with("/accessors/1/componentType", json!(5126))),
        ("view-beyond-buffer", room_with("/bufferViews/0/byteLength", json!(1u64 << 40))),
        ("offset-overflow", room_with("/bufferViews/0/byteOffset", json!(u64::MAX))),
        ("accessor-offset", room_with("/accessors/0/byteOffset", json!(u64::MAX - 3))),
        ("huge-stride", room_with("/bufferViews/0/byteStride", json!(u64::MAX))),
        ("sparse", {
            let part = json!({ "bufferView": 0, "byteOffset": 0, "componentType": 5125 });
            let sparse = json!({ "count": 1u64 << 40, "indices": part, "values": { "bufferView": 0 } });
            room_with("/accessors/0/sparse", sparse)
        }),
        ("sparse-alone", {
            let part = json!({ "bufferView": 1, "byteOffset": 0, "componentType": 5125 });
            let sparse = json!({ "count": 1, "indices": part, "values": { "bufferView": 0 } });
            let mut glb = room_with("/accessors/0/sparse", sparse);
            glb.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
            glb.json["accessors"][0]["count"] = json!(4_000_000_000u64);
            glb
        }),
        ("buffer-claims-more", room_with("/buffers", json!([{ "byteLength": 1u64 << 40 }]))),
        ("parent-folder", buffer("../../etc/passwd")),
        ("percent-parent-folder", buffer("%2e%2e/%2e%2e/etc/passwd")),
        ("absolute", buffer("/etc/passwd")),
        ("file-uri", buffer("file:///etc/passwd")),
        ("http-uri", buffer("http://127.0.0.1/a.bin")),
        ("data-garbage", buffer("data:application/octet-stream;base64,%%%%")),
        ("data-plain", buffer("data:,hello")),
        ("data-short", buffer("data:application/octet-stream;base64,AAAA")),
        ("field-of-view", room_with("/cameras/0/perspective/yfov", json!(0.0))),
        ("transform", room_with("/nodes/0/translation", json!([1e39, 0.0, 0.0]))),
        ("beyond-f32", room_with("/nodes/0/scale", json!([1e38, 1e38, 1e38]))),
        ("no-scenes", room_with("/scenes", json!([]))),
        ("version", room_with("/asset", json!({}))),
    ];
    let mut wrong = Vec::new();
    for (name, glb) in &cases {
        let file = format!("{name}.glb");
        glb.write(&folder.path().join(&file));
        // 4 GB of addresses: room for threads, none for an allocation that a file only claims to need.
        let script = "ulimit -v 4000000; exec \"$0\" plan \"$1\"";
        let mut shell = Command::new("sh");
        shell.args(["-c", script]).arg(program()).arg(&file).current_dir(folder.path()).stdin(Stdio::null());
        let output = shell.output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        println!("{} {message}", output.status);
        let one_line = message.lines().count() == 1 && message.starts_with("render2mpeg: ") && message.contains(&file);
        if output.status.code() != Some(1) || !one_line || message.contains("root:") {
            wrong.push(format!("{name}: {} {message}", output.status));
        }
    }
    assert!(wrong.is_empty(), "{} of {}: {wrong:#?}", wrong.len(), cases.len());
}

/// A cheap generator that is the same everywhere (xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end as u64) as usize
    }
}

/// Loads a damaged scene and renders a frame of it, if it can be loaded; true if so.
fn survives(path: &Path, video: &Path) -> bool {
    let Ok(scene) = scene::load(path) else { return false };
    let wishes =
        Wishes { frames: Some(1), size: "16x16".parse().ok(), vpls: Some(20), photons: Some(200), ..Wishes::default() };
    let Ok(settings) = Settings::new(path.into(), &scene, wishes) else { return false };
    let plan = Plan::new(&scene, &settings);
    let output = Output::create(video).expect("a temporary file");
    let report = pipeline::render(&scene, &settings, &plan, output, &AtomicBool::new(false), |_| ());
    report.unwrap_or_else(|error| panic!("{error:#}"));
    true
}

#[test]
fn flipped_bytes_never_panic() {
    let (done, progress) = std::sync::mpsc::channel();
    let worker = std::thread::spawn(move || {
        let folder = tempfile::tempdir().unwrap();
        let (path, video) = (folder.path().join("scene.glb"), folder.path().join("film.m2v"));
        let whole = std::fs::read(cornell()).unwrap();
        let json_length = u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
        let mut random = Random(0x2545_f491_4f6c_dd1d);
        let mut loaded = 0;
        for case in 0..300 {
            let mut damaged = whole.clone();
            let mut places = Vec::new();
            for _ in 0..=random.below(3) {
                // Mostly digits become other digits or signs: that keeps the JSON readable and leads further in.
                let place = 20 + random.below(json_length);
                let digit = (place..20 + json_length).find(|&place| damaged[place].is_ascii_digit());
                let (place, byte) = match (random.below(8), digit) {
                    (1.., Some(digit)) => (digit, b"0123456789-e.,"[random.below(14)]),
                    _ => (place, random.below(256) as u8),
                };
                damaged[place] = byte;
                places.push((place, byte));
            }
            std::fs::write(&path, &damaged).unwrap();
            // What leads to a panic, or to no end, is told last.
            println!("case {case}: {places:?}");
            loaded += usize::from(survives(&path, &video));
            done.send(loaded).unwrap();
        }
    });
    let mut loaded = 0;
    for case in 0..300 {
        match progress.recv_timeout(Duration::from_secs(60)) {
            Ok(count) => loaded = count,
            Err(std::sync::mpsc::RecvTimeoutError::Timeout) => panic!("case {case} does not end"),
            Err(_) => break,
        }
    }
    worker.join().expect("no panic");
    println!("{loaded} of 300 damaged scenes could be rendered");
    assert!((30..285).contains(&loaded), "{loaded} of 300 loaded: the damage is too large or too small to tell much");
}
