//! Malicious scene files: each breaks one rule of glTF, or claims more data than it has.

use crate::{Glb, Moving, checkered_room};
use serde_json::{Value, json};

/// Scene that the loader must refuse.
#[derive(Clone, Debug)]
pub struct Hostile {
    /// Name of the fault.
    pub name: &'static str,
    /// Content of the file.
    pub bytes: Vec<u8>,
}

/// Returns every hostile scene, each with one fault.
pub fn hostile_scenes() -> Vec<Hostile> {
    let scenes = [hierarchy(), indices(), accessors(), resources(), values()].concat();
    let scenes = scenes.into_iter().map(|(name, glb)| Hostile { name, bytes: glb.to_bytes() });
    let mut short = checkered_room(Moving::Camera).to_bytes();
    // The length in the header must include the header's own 12 bytes (glTF 2.0, 4.4.2).
    short[8..12].copy_from_slice(&5u32.to_le_bytes());
    scenes.chain([Hostile { name: "length-in-header", bytes: short }]).collect()
}

/// Builds a room with one replaced value in its document.
fn room_with(pointer: &str, value: Value) -> Glb {
    let mut glb = checkered_room(Moving::Camera);
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer has a slash");
    let parent = glb.json.pointer_mut(parent).unwrap_or_else(|| panic!("no {parent}"));
    match parent {
        Value::Array(list) => list[key.parse::<usize>().expect("an index")] = value,
        other => other[key] = value,
    }
    glb
}

/// Scenes with the names of their faults.
type Scenes = Vec<(&'static str, Glb)>;

/// Returns node hierarchies that are not trees, too deep, or in no scene.
fn hierarchy() -> Scenes {
    let mut longer_cycle = room_with("/nodes/0/children", json!([1]));
    longer_cycle.json["nodes"][1]["children"] = json!([0]);
    // A deep chain overflows the stack of a recursive loader.
    let mut deep = Glb::default();
    deep.json["nodes"] = json!((0..200_000).map(|node| json!({ "children": [node + 1] })).collect::<Vec<_>>());
    deep.json["scenes"][0]["nodes"] = json!([0]);
    vec![
        ("cycle", room_with("/nodes/0/children", json!([0]))),
        ("longer-cycle", longer_cycle),
        ("deep", deep),
        ("no-scenes", room_with("/scenes", json!([]))),
    ]
}

/// Returns scenes with indices out of range or missing objects.
fn indices() -> Scenes {
    let mut index = checkered_room(Moving::Camera);
    // The first mesh's indices follow its positions.
    let place = index.json["bufferViews"][1]["byteOffset"].as_u64().expect("an offset") as usize;
    index.bin[place..place + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    let orthographic = json!({ "xmag": 1.0, "ymag": 1.0, "zfar": 9.0, "znear": 0.1 });
    vec![
        ("index", index),
        ("node-out-of-range", room_with("/scenes/0/nodes", json!([99]))),
        ("mesh-out-of-range", room_with("/nodes/0/mesh", json!(99))),
        ("material-out-of-range", room_with("/meshes/0/primitives/0/material", json!(4_000_000_000u32))),
        ("accessor-out-of-range", room_with("/meshes/0/primitives/0/indices", json!(99))),
        ("positions-out-of-range", room_with("/meshes/0/primitives/0/attributes/POSITION", json!(99))),
        ("view-out-of-range", room_with("/accessors/0/bufferView", json!(99))),
        ("camera-out-of-range", room_with("/nodes/5/camera", json!(7))),
        (
            "camera-without-its-part",
            room_with("/cameras/0", json!({ "type": "perspective", "orthographic": orthographic })),
        ),
        ("channel-out-of-range", room_with("/animations/0/channels/0/target/node", json!(99))),
        ("sampler-out-of-range", room_with("/animations/0/channels/0/sampler", json!(99))),
    ]
}

/// Returns scenes with accessors and views that claim more data than exists.
fn accessors() -> Scenes {
    let part = |view: u32| json!({ "bufferView": view, "byteOffset": 0, "componentType": 5125 });
    let sparse = json!({ "count": 1u64 << 40, "indices": part(0), "values": { "bufferView": 0 } });
    // Sparse data without a view needs memory for every element.
    let mut alone =
        room_with("/accessors/0/sparse", json!({ "count": 1, "indices": part(1), "values": { "bufferView": 0 } }));
    alone.json["accessors"][0].as_object_mut().expect("an object").remove("bufferView");
    alone.json["accessors"][0]["count"] = json!(4_000_000_000u64);
    vec![
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
        ("sparse", room_with("/accessors/0/sparse", sparse)),
        ("sparse-alone", alone),
    ]
}

/// Returns scenes with buffers that are missing, truncated or outside the scene's folder.
fn resources() -> Scenes {
    let buffer = |uri: &str| room_with("/buffers", json!([{ "byteLength": 12, "uri": uri }]));
    vec![
        ("buffer-claims-more", room_with("/buffers", json!([{ "byteLength": 1u64 << 40 }]))),
        ("parent-folder", buffer("../../etc/passwd")),
        ("percent-parent-folder", buffer("%2e%2e/%2e%2e/etc/passwd")),
        ("absolute", buffer("/etc/passwd")),
        ("file-uri", buffer("file:///etc/passwd")),
        ("http-uri", buffer("http://127.0.0.1/a.bin")),
        ("data-garbage", buffer("data:application/octet-stream;base64,%%%%")),
        ("data-plain", buffer("data:,hello")),
        ("data-short", buffer("data:application/octet-stream;base64,AAAA")),
    ]
}

/// Returns scenes with values out of range.
fn values() -> Scenes {
    let mut nan = checkered_room(Moving::Camera);
    nan.bin[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    vec![
        ("nan", nan),
        ("field-of-view", room_with("/cameras/0/perspective/yfov", json!(0.0))),
        ("transform", room_with("/nodes/0/translation", json!([1e39, 0.0, 0.0]))),
        ("beyond-f32", room_with("/nodes/0/scale", json!([1e38, 1e38, 1e38]))),
        ("version", room_with("/asset", json!({}))),
    ]
}

/// Changes one to three bytes of a .glb file's document. Returns the file, and the position and new value of each changed
/// byte.
pub fn damaged(whole: &[u8], random: &mut Random) -> (Vec<u8>, Vec<(usize, u8)>) {
    let mut damaged = whole.to_vec();
    let json_length = u32::from_le_bytes([whole[12], whole[13], whole[14], whole[15]]) as usize;
    let mut places = Vec::new();
    for _ in 0..=random.below(3) {
        // Prefer to replace digits by digits or signs, so that the JSON stays valid and the change reaches deeper code.
        let place = 20 + random.below(json_length);
        let digit = (place..20 + json_length).find(|&place| damaged[place].is_ascii_digit());
        let (place, byte) = match (random.below(8), digit) {
            (1.., Some(digit)) => (digit, b"0123456789-e.,"[random.below(14)]),
            _ => (place, random.below(256) as u8),
        };
        damaged[place] = byte;
        places.push((place, byte));
    }
    (damaged, places)
}

/// Fast random generator with the same sequence on every platform (xorshift).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// Creates a generator from `seed`, which must not be 0.
    pub fn new(seed: u64) -> Self {
        assert_ne!(seed, 0, "a xorshift generator stays at 0");
        Self(seed)
    }

    /// Returns a number from 0 to `end` − 1.
    pub fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end as u64) as usize
    }

    /// Returns a random element of a list that is not empty.
    pub fn pick<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }

    /// Returns true with probability 1 / `count`.
    pub fn one_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }
}
