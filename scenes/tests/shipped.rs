//! Tests of every shipped scene: the file is well-formed and has the described content.

use std::collections::HashSet;
use std::sync::LazyLock;

use glam::{Mat4, Quat, Vec3};
use scenes::{SCENES, Shipped};
use serde_json::Value;

/// A parsed binary glTF.
struct Glb {
    json: Value,
    data: Vec<u8>,
}

fn parse(bytes: &[u8]) -> Glb {
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(&bytes[..4], b"glTF");
    assert_eq!((word(4), word(8)), (2, bytes.len()));
    let text = word(12);
    assert_eq!(&bytes[16..20], b"JSON");
    assert_eq!(text % 4, 0);
    let binary = 20 + text;
    assert_eq!(&bytes[binary + 4..binary + 8], b"BIN\0");
    assert_eq!(binary + 8 + word(binary), bytes.len());
    Glb { json: serde_json::from_slice(&bytes[20..20 + text]).unwrap(), data: bytes[binary + 8..].to_vec() }
}

fn size(v: &Value) -> usize {
    v.as_u64().unwrap() as usize
}

impl Glb {
    fn array(&self, key: &str) -> &[Value] {
        self.json[key].as_array().map_or(&[], Vec::as_slice)
    }

    fn accessor(&self, index: &Value) -> &Value {
        &self.json["accessors"][size(index)]
    }

    /// Returns the bytes of an accessor. Checks that the accessor is inside its view, and the view inside the binary
    /// chunk.
    fn bytes(&self, accessor: &Value) -> &[u8] {
        let components = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            other => panic!("{other}"),
        };
        let width = match size(&accessor["componentType"]) {
            5123 => 2,
            5125 | 5126 => 4,
            other => panic!("{other}"),
        };
        let view = &self.json["bufferViews"][size(&accessor["bufferView"])];
        let (start, length) = (size(&view["byteOffset"]), size(&view["byteLength"]));
        assert_eq!(components * width * size(&accessor["count"]), length);
        assert_eq!(start % 4, 0);
        &self.data[start..start + length]
    }

    fn floats(&self, index: &Value) -> Vec<f32> {
        let accessor = self.accessor(index);
        assert_eq!(size(&accessor["componentType"]), 5126);
        self.bytes(accessor).chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect()
    }

    fn vectors(&self, index: &Value) -> Vec<Vec3> {
        self.floats(index).chunks_exact(3).map(Vec3::from_slice).collect()
    }

    fn indices(&self, index: &Value) -> Vec<usize> {
        let accessor = self.accessor(index);
        let bytes = self.bytes(accessor);
        if size(&accessor["componentType"]) == 5123 {
            bytes.chunks_exact(2).map(|c| u16::from_le_bytes(c.try_into().unwrap()) as usize).collect()
        } else {
            bytes.chunks_exact(4).map(|c| u32::from_le_bytes(c.try_into().unwrap()) as usize).collect()
        }
    }

    fn emission(&self, material: &Value) -> f32 {
        let material = &self.json["materials"][size(material)];
        let strength = &material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"];
        let factor = material["emissiveFactor"].as_array();
        let factor = factor.map_or(0.0, |f| f.iter().map(|x| x.as_f64().unwrap()).fold(0.0, f64::max));
        (factor * strength.as_f64().unwrap_or(1.0)) as f32
    }
}

/// Files of all scenes, built once for all tests.
static FILES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(build_all);

/// Builds the file of each scene in a separate thread.
fn build_all() -> Vec<Vec<u8>> {
    std::thread::scope(|scope| {
        let threads: Vec<_> = SCENES.iter().map(|shipped| scope.spawn(|| (shipped.build)().to_glb())).collect();
        threads.into_iter().map(|thread| thread.join().expect("a scene is built")).collect()
    })
}

fn each(mut f: impl FnMut(&Shipped, &Glb)) {
    for (shipped, bytes) in SCENES.iter().zip(&*FILES) {
        f(shipped, &parse(bytes));
    }
}

fn named(name: &str) -> Glb {
    parse(&FILES[SCENES.iter().position(|s| s.name == name).unwrap()])
}

#[test]
fn geometry_is_well_formed() {
    each(|shipped, glb| {
        for mesh in glb.array("meshes") {
            let name = format!("{}: {}", shipped.name, mesh["name"]);
            let primitives = mesh["primitives"].as_array().unwrap();
            assert!(!primitives.is_empty(), "{name}");
            for p in primitives {
                let positions = glb.vectors(&p["attributes"]["POSITION"]);
                let normals = glb.vectors(&p["attributes"]["NORMAL"]);
                let uvs = glb.floats(&p["attributes"]["TEXCOORD_0"]);
                assert_eq!((normals.len(), uvs.len()), (positions.len(), 2 * positions.len()), "{name}");
                assert!(positions.iter().all(|v| v.is_finite()), "{name}");
                assert!(uvs.iter().all(|x| x.is_finite()), "{name}");
                assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-3), "{name}");
                let indices = glb.indices(&p["indices"]);
                assert!(!indices.is_empty() && indices.len() % 3 == 0, "{name}");
                assert!(indices.iter().all(|&i| i < positions.len()), "{name}");
                assert!(size(&p["material"]) < glb.array("materials").len(), "{name}");
                for t in indices.chunks_exact(3) {
                    let [a, b, c] = [positions[t[0]], positions[t[1]], positions[t[2]]];
                    let flat = (b - a).cross(c - a);
                    let shaded = normals[t[0]] + normals[t[1]] + normals[t[2]];
                    assert!(flat.length() > 0.0 && flat.dot(shaded) >= 0.0, "{name}: {a} {b} {c}");
                }
            }
        }
    });
}

#[test]
fn bounds_of_positions_are_true() {
    each(|_, glb| {
        for mesh in glb.array("meshes") {
            for p in mesh["primitives"].as_array().unwrap() {
                let index = &p["attributes"]["POSITION"];
                let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
                for v in glb.vectors(index) {
                    (low, high) = (low.min(v), high.max(v));
                }
                for (key, want) in [("min", low), ("max", high)] {
                    let told: Vec<f32> = serde_json::from_value(glb.accessor(index)[key].clone()).unwrap();
                    assert_eq!(Vec3::from_slice(&told), want);
                }
            }
        }
    });
}

#[test]
fn one_camera_walks_for_the_length_of_the_video() {
    each(|shipped, glb| {
        let nodes = glb.array("nodes");
        let cameras: Vec<usize> = (0..nodes.len()).filter(|&i| nodes[i]["camera"].is_u64()).collect();
        assert_eq!(cameras.len(), 1);
        assert_eq!(nodes[cameras[0]]["name"], "camera");
        assert_eq!(glb.json["cameras"][0]["perspective"]["aspectRatio"], 1.0);
        let Some(walk) = glb.array("animations").first() else {
            assert_eq!((shipped.name, shipped.settings.frames), ("cornell-box", 1), "the one still");
            return;
        };
        assert_eq!(walk["name"], "walk");
        let seconds = shipped.settings.frames as f32 / 25.0;
        assert!(seconds >= 4.0);
        let mut moved = HashSet::new();
        for channel in walk["channels"].as_array().unwrap() {
            let node = size(&channel["target"]["node"]);
            assert!(moved.insert((node, channel["target"]["path"].as_str().unwrap().to_owned())));
            let sampler = &walk["samplers"][size(&channel["sampler"])];
            let times = glb.floats(&sampler["input"]);
            assert!(times.windows(2).all(|w| w[0] < w[1]));
            assert_eq!((times[0], times[times.len() - 1]), (0.0, seconds));
            let values = size(&glb.accessor(&sampler["output"])["count"]);
            let per_key = if sampler["interpolation"] == "CUBICSPLINE" { 3 } else { 1 };
            assert_eq!(values, per_key * times.len());
            if channel["target"]["path"] == "rotation" {
                let values = glb.floats(&sampler["output"]);
                assert!(values.chunks_exact(4).all(|q| (Quat::from_slice(q).length() - 1.0).abs() < 1e-3));
            }
        }
        assert!(moved.contains(&(cameras[0], "translation".into())));
        assert!(moved.contains(&(cameras[0], "rotation".into())));
        let others = moved.iter().filter(|(node, _)| *node != cameras[0]).count();
        // In the church only the camera is animated. All other animated scenes also have animated objects.
        assert_eq!(others == 0, shipped.name == "nave", "{}", shipped.name);
    });
}

#[test]
fn pictures_are_jpeg_and_files_stay_small() {
    for (shipped, bytes) in SCENES.iter().zip(&*FILES) {
        assert!(bytes.len() < 5 << 20, "{}: {}", shipped.name, bytes.len());
        let glb = parse(bytes);
        for image in glb.array("images") {
            let view = &glb.json["bufferViews"][size(&image["bufferView"])];
            let start = size(&view["byteOffset"]);
            let jpeg = &glb.data[start..start + size(&view["byteLength"])];
            let decoded = image::load_from_memory_with_format(jpeg, image::ImageFormat::Jpeg).unwrap();
            assert!((256..=1024).contains(&decoded.width()));
        }
    }
}

#[test]
fn the_meeting_room_has_a_hundred_lamps_that_shine_down() {
    let glb = named("conference");
    let mut area = 0.0;
    let mut down = 0;
    for node in glb.array("nodes") {
        let Some(mesh) = node["mesh"].as_u64() else { continue };
        let still = node["translation"].is_null() && node["rotation"].is_null();
        for p in glb.json["meshes"][mesh as usize]["primitives"].as_array().unwrap() {
            if glb.emission(&p["material"]) == 0.0 {
                continue;
            }
            assert!(still);
            let positions = glb.vectors(&p["attributes"]["POSITION"]);
            for quad in glb.indices(&p["indices"]).chunks_exact(6) {
                let [a, b, c] = [positions[quad[0]], positions[quad[1]], positions[quad[2]]];
                let normal = (b - a).cross(c - a);
                if normal.normalize().y < -0.99 {
                    down += 1;
                    area += normal.length();
                }
            }
        }
    }
    assert!(down >= 100, "{down}");
    assert!(area > 10.0, "{area} m²");
}

#[test]
fn only_the_courtyard_has_a_sky() {
    for shipped in SCENES {
        let text = shipped.settings.to_toml();
        assert_eq!(text.contains("[sky]"), shipped.name == "atrium");
        for section in ["[tone_mapping]", "[camera]", "[video]"] {
            assert!(text.contains(section));
        }
    }
}

#[test]
fn the_blocks_of_the_cornell_box_never_meet() {
    let glb = named("cornell");
    let walk = &glb.array("animations")[0];
    let nodes = glb.array("nodes");
    let find = |name: &str| nodes.iter().position(|n| n["name"] == name).unwrap();
    let (short, tall) = (find("short block"), find("tall block"));
    let at = |node: usize| -> Vec3 {
        let t: Vec<f32> = serde_json::from_value(nodes[node]["translation"].clone()).unwrap();
        Vec3::from_slice(&t)
    };
    let channel = walk["channels"].as_array().unwrap().iter().find(|c| size(&c["target"]["node"]) == short).unwrap();
    let sampler = &walk["samplers"][size(&channel["sampler"])];
    let keys = glb.vectors(&sampler["output"]);
    let radius = |node: usize| {
        let mesh = &glb.json["meshes"][size(&nodes[node]["mesh"])]["primitives"][0];
        let far = |m: f32, v: &Vec3| m.max(v.x.hypot(v.z));
        glb.vectors(&mesh["attributes"]["POSITION"]).iter().fold(0.0, far)
    };
    let reach = radius(short) + radius(tall);
    for key in keys.chunks_exact(3) {
        let apart = key[1] - at(tall);
        assert!(apart.x.hypot(apart.z) > reach + 0.01, "{} {reach}", apart.length());
        assert!(key[1].x + radius(short) < 0.278, "through the wall");
    }
}

#[test]
fn everything_stands_in_its_room() {
    // Half size of each scene, as a limit for its meshes after the transforms of their nodes \[m\].
    let limits = [("cornell", 0.7), ("cornell-box", 0.85), ("atrium", 16.0), ("conference", 7.5), ("nave", 40.0)];
    for (name, limit) in limits {
        let glb = named(name);
        let nodes = glb.array("nodes");
        let own = |node: &Value| {
            let read = |key: &str, or: &[f32]| -> Vec<f32> {
                serde_json::from_value(node[key].clone()).unwrap_or_else(|_| or.to_vec())
            };
            let rotation = Quat::from_slice(&read("rotation", &[0.0, 0.0, 0.0, 1.0]));
            Mat4::from_rotation_translation(rotation, Vec3::from_slice(&read("translation", &[0.0; 3])))
        };
        for (index, node) in nodes.iter().enumerate() {
            let Some(mesh) = node["mesh"].as_u64() else { continue };
            let holds = |n: &&Value| n["children"].as_array().is_some_and(|c| c.iter().any(|c| size(c) == index));
            let place = nodes.iter().find(holds).map_or(Mat4::IDENTITY, own) * own(node);
            for p in glb.json["meshes"][mesh as usize]["primitives"].as_array().unwrap() {
                for v in glb.vectors(&p["attributes"]["POSITION"]) {
                    let v = place.transform_point3(v);
                    assert!(v.abs().max_element() < limit && v.y > -0.2, "{name} {}: {v}", node["name"]);
                }
            }
        }
    }
}

#[test]
fn the_same_bytes_every_time() {
    for ((shipped, again), bytes) in SCENES.iter().zip(build_all()).zip(&*FILES) {
        assert!(again == *bytes, "{}", shipped.name);
    }
}
