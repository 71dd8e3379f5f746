//! Small scenes written as .glb files, so that tests read a few quads through the loader.

use glam::{Vec3, vec3};
use gltf::binary::Header;
use serde_json::{Value, json};
use std::path::Path;

/// Parallelogram with a corner and two edges a and b; its front faces a × b.
pub type Quad = [Vec3; 3];

/// glTF document with one buffer. Tests may damage `json`.
#[derive(Clone, Debug)]
pub struct Glb {
    /// JSON document.
    pub json: Value,
    /// Content of the buffer.
    pub bin: Vec<u8>,
}

/// Faceted ball.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Center \[m\].
    pub center: Vec3,
    /// Radius \[m\].
    pub radius: f32,
    /// Number of facets around +y.
    pub columns: u32,
    /// Number of rows of facets.
    pub rows: u32,
    /// Whether the ball is the upper half only, open at the equator.
    pub half: bool,
    /// Whether the facets face inward.
    pub inward: bool,
}

impl Ball {
    fn corners(&self) -> Vec<Vec3> {
        let most = std::f32::consts::PI * if self.half { 0.5 } else { 1.0 };
        let corner = |row: u32, column: u32| {
            let (sine, y) = (most * row as f32 / self.rows as f32).sin_cos();
            let (z, x) = (std::f32::consts::TAU * column as f32 / self.columns as f32).sin_cos();
            self.center + self.radius * vec3(sine * x, y, sine * z)
        };
        (0..=self.rows).flat_map(|row| (0..self.columns).map(move |column| corner(row, column))).collect()
    }

    fn indices(&self) -> Vec<u32> {
        let mut indices = Vec::new();
        for row in 0..self.rows {
            for column in 0..self.columns {
                let at = |row: u32, column: u32| row * self.columns + column % self.columns;
                let [a, b, c, d] = [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(r, k)| at(row + r, column + k));
                // One of the two triangles at a pole has no area.
                let upper = (row > 0).then_some([a, b, c]);
                let lower = (self.half || row + 1 < self.rows).then_some([a, c, d]);
                for [a, b, c] in upper.into_iter().chain(lower) {
                    indices.extend(if self.inward { [a, c, b] } else { [a, b, c] });
                }
            }
        }
        indices
    }
}

/// Data of an accessor.
struct Numbers {
    /// Encoded numbers.
    bytes: Vec<u8>,
    /// Number of elements.
    count: usize,
    /// Element type: SCALAR, VEC2 or VEC3.
    kind: &'static str,
    /// glTF's code of the component type.
    component: u32,
}

impl Numbers {
    const FLOAT: u32 = 5126;
    const UNSIGNED_INT: u32 = 5125;

    fn floats(list: &[f32]) -> Self {
        let bytes = list.iter().flat_map(|number| number.to_le_bytes()).collect();
        Self { bytes, count: list.len(), kind: "SCALAR", component: Self::FLOAT }
    }

    fn vectors(list: &[Vec3]) -> Self {
        let bytes = list.iter().flat_map(|vector| vector.to_array()).flat_map(f32::to_le_bytes).collect();
        Self { bytes, count: list.len(), kind: "VEC3", component: Self::FLOAT }
    }

    fn integers(list: &[u32]) -> Self {
        let bytes = list.iter().flat_map(|number| number.to_le_bytes()).collect();
        Self { bytes, count: list.len(), kind: "SCALAR", component: Self::UNSIGNED_INT }
    }
}

impl Default for Glb {
    fn default() -> Self {
        let json = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [] }],
            "nodes": [], "meshes": [], "materials": [], "accessors": [], "bufferViews": [], "cameras": []
        });
        Self { json, bin: Vec::new() }
    }
}

impl Glb {
    fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().expect("one of the lists");
        list.push(value);
        list.len() - 1
    }

    /// Adds numbers to the buffer; `bounds` is an object with the accessor's min and max, or empty.
    fn accessor(&mut self, numbers: Numbers, bounds: Value) -> usize {
        let Numbers { bytes, count, kind, component } = numbers;
        let view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        let view = self.push("bufferViews", view);
        self.bin.extend(bytes);
        let mut accessor = json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
        if let (Some(accessor), Value::Object(bounds)) = (accessor.as_object_mut(), bounds) {
            accessor.extend(bounds);
        }
        self.push("accessors", accessor)
    }

    /// Adds a root node with `quads`, all of one reflectance and emission, and returns its index.
    pub fn add(&mut self, quads: &[Quad], base_color: Vec3, emission: Vec3) -> usize {
        // Bound the corners, as glTF requires for positions.
        let corners: Vec<Vec3> = quads.iter().flat_map(|[c, a, b]| [*c, *c + *a, *c + *a + *b, *c + *b]).collect();
        let low = corners.iter().fold(Vec3::INFINITY, |low, &corner| low.min(corner));
        let high = corners.iter().fold(Vec3::NEG_INFINITY, |high, &corner| high.max(corner));
        let bounds = json!({ "min": low.to_array(), "max": high.to_array() });
        let positions = self.accessor(Numbers::vectors(&corners), bounds);
        // Split each quad into two triangles.
        let indices: Vec<u32> = (0..quads.len() as u32).flat_map(|q| [0, 1, 2, 0, 2, 3].map(|i| 4 * q + i)).collect();
        let indices = self.accessor(Numbers::integers(&indices), json!({}));
        self.add_primitive(json!({ "POSITION": positions }), indices, base_color, emission)
    }

    /// Adds a root node with a faceted ball of one reflectance and emission, and returns its index.
    pub fn add_ball(&mut self, ball: Ball, base_color: Vec3, emission: Vec3) -> usize {
        let (corners, indices) = (ball.corners(), ball.indices());
        let reach = Vec3::splat(ball.radius);
        let bounds = json!({ "min": (ball.center - reach).to_array(), "max": (ball.center + reach).to_array() });
        let positions = self.accessor(Numbers::vectors(&corners), bounds);
        let indices = self.accessor(Numbers::integers(&indices), json!({}));
        self.add_primitive(json!({ "POSITION": positions }), indices, base_color, emission)
    }

    /// Adds a quad with an emissive texture of `side` × `side` gray `codes`, scaled by `emission`, and returns its node's
    /// index. The image's first row is opposite the corner. With `double_sided`, the back emits too.
    pub fn add_screen(
        &mut self,
        [corner, x, y]: Quad,
        emission: f32,
        (side, codes): (usize, &[u8]),
        double_sided: bool,
    ) -> usize {
        let node = self.add(&[[corner, x, y]], Vec3::ZERO, Vec3::splat(emission));
        // Add the quad's texture coordinates.
        let uvs: Vec<f32> = vec![0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
        let uvs = Numbers { kind: "VEC2", count: 4, ..Numbers::floats(&uvs) };
        let uvs = self.accessor(uvs, json!({}));
        // Add the image in its own view.
        let image = gray_png(side, codes);
        let view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": image.len() });
        let view = self.push("bufferViews", view);
        self.bin.extend(image);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.json["images"] = json!([{ "bufferView": view, "mimeType": "image/png" }]);
        self.json["textures"] = json!([{ "source": 0 }]);
        // Scale the material's emission by the texture.
        let mesh = self.json["nodes"][node]["mesh"].as_u64().expect("a mesh") as usize;
        let primitive = &mut self.json["meshes"][mesh]["primitives"][0];
        primitive["attributes"]["TEXCOORD_0"] = json!(uvs);
        let material = primitive["material"].as_u64().expect("a material") as usize;
        self.json["materials"][material]["emissiveTexture"] = json!({ "index": 0 });
        self.json["materials"][material]["doubleSided"] = json!(double_sided);
        node
    }

    fn add_primitive(&mut self, attributes: Value, indices: usize, base_color: Vec3, emission: Vec3) -> usize {
        // Scale emission above 1 by the extension, because emissiveFactor is at most 1.
        let strength = emission.max_element().max(1.0);
        let material = json!({
            "pbrMetallicRoughness": { "baseColorFactor": [base_color.x, base_color.y, base_color.z, 1.0], "metallicFactor": 0.0 },
            "emissiveFactor": (emission / strength).to_array(),
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": strength } }
        });
        self.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength"]);
        let material = self.push("materials", material);
        let primitive = json!({ "attributes": attributes, "indices": indices, "material": material });
        let mesh = self.push("meshes", json!({ "primitives": [primitive] }));
        self.add_node(json!({ "mesh": mesh }))
    }

    /// Adds a camera that looks along −z, and returns its node's index.
    pub fn add_camera(&mut self, position: Vec3) -> usize {
        // Use a near plane that also suits scenes of a millimeter.
        let perspective = json!({ "yfov": 0.9, "znear": 1e-6 });
        let camera = self.push("cameras", json!({ "type": "perspective", "perspective": perspective }));
        self.add_node(json!({ "camera": camera, "translation": position.to_array() }))
    }

    fn add_node(&mut self, node: Value) -> usize {
        let node = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().expect("a list").push(json!(node));
        node
    }

    /// Animates a node along a straight line for one second.
    pub fn animate(&mut self, node: usize, from: Vec3, to: Vec3) {
        let input = self.accessor(Numbers::floats(&[0.0, 1.0]), json!({ "min": [0.0], "max": [1.0] }));
        let output = self.accessor(Numbers::vectors(&[from, to]), json!({}));
        self.json["animations"] = json!([{
            "channels": [{ "sampler": 0, "target": { "node": node, "path": "translation" } }],
            "samplers": [{ "input": input, "output": output, "interpolation": "LINEAR" }]
        }]);
    }

    /// Moves a node to positions at times \[s\]; it stays at each position until the next time.
    pub fn animate_in_steps(&mut self, node: usize, places: &[(f32, Vec3)]) {
        let (times, places): (Vec<f32>, Vec<Vec3>) = places.iter().copied().unzip();
        let bounds = json!({ "min": [times[0]], "max": [times[times.len() - 1]] });
        let input = self.accessor(Numbers::floats(&times), bounds);
        let output = self.accessor(Numbers::vectors(&places), json!({}));
        self.json["animations"] = json!([{
            "channels": [{ "sampler": 0, "target": { "node": node, "path": "translation" } }],
            "samplers": [{ "input": input, "output": output, "interpolation": "STEP" }]
        }]);
    }

    /// Returns the bytes of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut document = self.json.clone();
        // A test may have set a buffer of its own.
        if document.get("buffers").is_none() && !self.bin.is_empty() {
            document["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        }
        glb_file(&document.to_string(), &self.bin)
    }

    /// Writes the file.
    pub fn write(&self, path: &Path) {
        std::fs::write(path, self.to_bytes()).expect("a scene can be written");
    }
}

/// Encodes a square image of `side` × `side` gray codes as PNG.
fn gray_png(side: usize, codes: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    // The encoder's default is 8-bit gray.
    let encoder = png::Encoder::new(&mut file, side as u32, side as u32);
    let mut writer = encoder.write_header().expect("memory to write to");
    writer.write_image_data(codes).expect("memory to write to");
    writer.finish().expect("memory to write to");
    file
}

/// Assembles a .glb file from a document and a binary chunk: header, JSON chunk, binary chunk (glTF 2.0, 4.4).
pub(crate) fn glb_file(document: &str, bin: &[u8]) -> Vec<u8> {
    let header = Header { magic: *b"glTF", version: 2, length: 0 };
    let file = gltf::Glb { header, json: document.as_bytes().into(), bin: Some(bin.into()) };
    file.to_vec().expect("memory to write to")
}

/// Dynamic object of [`checkered_room`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moving {
    /// Everything is static.
    Nothing,
    /// The camera moves right at two meters per second.
    Camera,
    /// The box moves right at two meters per second.
    Box,
}

/// Builds a room with checkered walls, open towards the camera, with a box and an emissive panel on the ceiling.
pub fn checkered_room(moving: Moving) -> Glb {
    let mut glb = Glb::default();
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    // Add walls and a lamp.
    let walls = [
        [vec3(-2.0, 0.0, -2.0), 4.0 * x, 3.0 * y],
        [vec3(-2.0, 0.0, -2.0), 4.0 * z, 4.0 * x],
        [vec3(-2.0, 0.0, -2.0), 3.0 * y, 4.0 * z],
        [vec3(2.0, 0.0, -2.0), 4.0 * z, 3.0 * y],
        [vec3(-2.0, 3.0, -2.0), 4.0 * x, 4.0 * z],
    ];
    let [dark, light] = checks(&walls, 10);
    glb.add(&dark, vec3(0.1, 0.15, 0.3), Vec3::ZERO);
    glb.add(&light, vec3(0.8, 0.75, 0.6), Vec3::ZERO);
    glb.add(&[[vec3(-0.5, 2.99, -0.5), x, z]], Vec3::ZERO, Vec3::splat(12.0));

    // Add the box.
    let (a, b, c) = (0.6 * x, 0.6 * y, 0.6 * z);
    let (near, far) = (vec3(-0.3, 0.5, -0.3), vec3(0.3, 1.1, 0.3));
    let sides = [[near, b, a], [near, a, c], [near, c, b], [far, -a, -b], [far, -c, -a], [far, -b, -c]];
    let [dark, light] = checks(&sides, 4);
    glb.add(&dark, vec3(0.6, 0.1, 0.1), Vec3::ZERO);
    let thing = glb.add(&light, vec3(0.9, 0.6, 0.2), Vec3::ZERO);
    // The red half is a child of the yellow half, so both move.
    let red = thing - 1;
    glb.json["nodes"][thing]["children"] = json!([red]);
    glb.json["scenes"][0]["nodes"].as_array_mut().expect("a list").retain(|node| node != red);

    // Add the camera and the motion.
    let camera = glb.add_camera(vec3(0.0, 1.5, 4.5));
    let way = x;
    match moving {
        Moving::Nothing => {}
        Moving::Camera => glb.animate(camera, vec3(0.0, 1.5, 4.5) - way, vec3(0.0, 1.5, 4.5) + way),
        Moving::Box => glb.animate(thing, -way, way),
    }
    glb
}

/// Splits each quad into `count` × `count` quads, alternately in the first and the second list.
fn checks(quads: &[Quad], count: usize) -> [Vec<Quad>; 2] {
    let mut colors = [Vec::new(), Vec::new()];
    // Alternate the lists like the squares of a chess board.
    for &[corner, a, b] in quads {
        let (a, b) = (a / count as f32, b / count as f32);
        for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
            colors[(i + j) % 2].push([corner + i as f32 * a + j as f32 * b, a, b]);
        }
    }
    colors
}

/// Builds a cube of side 2 around the camera; every wall emits.
pub fn furnace(albedo: Vec3, emission: Vec3) -> Glb {
    let mut glb = Glb::default();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let n = Vec3::AXES[axis] * sign;
            let [a, b] = [Vec3::AXES[(axis + 1) % 3] * 2.0, Vec3::AXES[(axis + 2) % 3] * 2.0];
            let corner = n - (a + b) / 2.0;
            // Make the wall face the center: a × b = −n.
            let wall: Quad = if sign < 0.0 { [corner, a, b] } else { [corner, b, a] };
            glb.add(&[wall], albedo, emission);
        }
    }
    glb.add_camera(Vec3::ZERO);
    // Show most of the front wall.
    glb.json["cameras"][0]["perspective"]["yfov"] = json!(1.5);
    glb
}

/// PNG file with one texel, in base64.
const PNG: &str = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";

/// Builds a lit textured square, a spot light and a moving camera: a document so small that most changes affect the picture.
pub fn textured_square() -> Glb {
    let mut glb = Glb::default();
    // Add a textured square, and a lamp above it.
    glb.add(&[[Vec3::ZERO, Vec3::X, Vec3::Y]], Vec3::splat(0.5), Vec3::ZERO);
    glb.add(&[[vec3(0.0, 2.0, 1.0), Vec3::X, Vec3::Z]], Vec3::ONE, Vec3::splat(5.0));
    let camera = glb.add_camera(vec3(0.5, 0.5, 2.0));
    glb.animate(camera, Vec3::ZERO, Vec3::Z);
    glb.json["images"] = json!([{ "uri": format!("data:image/png;base64,{PNG}") }]);
    glb.json["textures"] = json!([{ "source": 0 }]);
    glb.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    glb.json["materials"][0]["alphaMode"] = json!("MASK");
    glb.json["extensions"] =
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "spot": {}, "intensity": 9 }] } });
    glb.json["nodes"][camera]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
    glb.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength", "KHR_lights_punctual"]);
    glb
}
