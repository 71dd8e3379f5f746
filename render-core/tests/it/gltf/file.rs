//! Builds small .glb files step by step.

use glam::{Vec3, vec3};
use render_core::scene::{self, Reach, Scene, Setting};
use serde_json::{Value, json};

/// File with a square of side 1 m in the plane z = 0, to which tests add other objects.
pub struct File {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl File {
    /// Builds a file with one square.
    pub fn square() -> Self {
        let json = json!({
            "asset": { "version": "2.0" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0 }],
            "buffers": [{ "byteLength": 0 }],
            "bufferViews": [],
            "accessors": [],
            "meshes": [],
        });
        let mut file = Self { json, bin: Vec::new() };
        let corners = [Vec3::ZERO, Vec3::X, vec3(1.0, 1.0, 0.0), Vec3::ZERO, vec3(1.0, 1.0, 0.0), Vec3::Y];
        let positions = file.vectors(&corners);
        file.json["meshes"] = json!([{ "primitives": [{ "attributes": { "POSITION": positions } }] }]);
        file
    }

    /// Adds an accessor of vectors and returns its index.
    pub fn vectors(&mut self, list: &[Vec3]) -> usize {
        let numbers: Vec<f32> = list.iter().flat_map(Vec3::to_array).collect();
        self.accessor("VEC3", list.len(), &numbers)
    }

    /// Adds an accessor of numbers and returns its index.
    pub fn scalars(&mut self, list: &[f32]) -> usize {
        self.accessor("SCALAR", list.len(), list)
    }

    /// Adds an accessor and returns its index.
    pub fn accessor(&mut self, kind: &str, count: usize, numbers: &[f32]) -> usize {
        let view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": 4 * numbers.len() });
        self.bin.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        let view = self.push("bufferViews", view);
        let bounds = numbers.chunks(3).next().filter(|_| kind == "VEC3").map_or(json!([0]), |_| json!([0, 0, 0]));
        self.push(
            "accessors",
            json!({
                "bufferView": view, "componentType": 5126, "count": count, "type": kind, "min": bounds, "max": bounds
            }),
        )
    }

    /// Adds an item to a list of the document and returns its index.
    pub fn push(&mut self, list: &str, item: Value) -> usize {
        if self.json.get(list).is_none() {
            self.json[list] = json!([]);
        }
        let items = self.json[list].as_array_mut().unwrap();
        items.push(item);
        items.len() - 1
    }

    /// Adds a node to the scene and returns its index.
    pub fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    /// Adds a clip from 0 to 1 s. Each channel has a target and an output accessor.
    pub fn clip(&mut self, name: &str, channels: &[(Value, usize)]) {
        let input = self.scalars(&[0.0, 1.0]);
        let samplers: Vec<Value> =
            channels.iter().map(|(_, output)| json!({ "input": input, "output": output })).collect();
        let channels: Vec<Value> = channels
            .iter()
            .enumerate()
            .map(|(sampler, (target, _))| json!({ "sampler": sampler, "target": target }))
            .collect();
        self.push("animations", json!({ "name": name, "samplers": samplers, "channels": channels }));
    }

    /// Returns the bytes of the file.
    pub fn bytes(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"][0]["byteLength"] = json!(self.bin.len());
        let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
        let file = gltf::Glb { header, json: json.to_string().into_bytes().into(), bin: Some((&self.bin).into()) };
        file.to_vec().unwrap()
    }

    /// Loads the file with these settings.
    pub fn load_with(&self, settings: &[&str]) -> Result<Scene, String> {
        load_bytes(&self.bytes(), settings)
    }

    /// Loads the file, which must succeed.
    pub fn load(&self) -> Scene {
        self.load_with(&[]).unwrap_or_else(|error| panic!("{error}\n{}", self.json))
    }
}

/// Loads bytes as a file.
pub fn load_bytes(bytes: &[u8], settings: &[&str]) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, bytes).unwrap();
    let set: Vec<Setting> = settings.iter().map(|text| text.parse().unwrap()).collect();
    scene::load_with(&path, Reach::Folder, &set).map_err(|error| error.to_string())
}

/// Returns the number of the scene's notes that contain `word`.
pub fn notes(scene: &Scene, word: &str) -> usize {
    scene.warnings.iter().filter(|note| note.contains(word)).count()
}
