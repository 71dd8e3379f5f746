//! Scenes in memory, and their output as binary glTF.

use std::collections::BTreeMap;

use glam::{Quat, Vec2, Vec3};
use serde_json::{Map, Value, json};

use crate::animation::{Interpolation, Keys, Property};
use crate::buffer::Writer;
use crate::mesh::Mesh;
use crate::texture::Texture;

/// Index of a material in a [`Scene`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MaterialId(usize);
/// Index of a texture in a [`Scene`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureId(usize);
/// Index of a mesh in a [`Scene`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshId(usize);
/// Index of a node in a [`Scene`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeId(usize);

/// A diffuse material, optionally emissive.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name of the material, displayed in viewers.
    pub name: &'static str,
    /// Reflectance, or the factor on the texture; linear RGB.
    pub color: Vec3,
    /// Texture of the reflectance.
    pub texture: Option<TextureId>,
    /// Size of one repetition of the textures \[m\].
    pub tile: Vec2,
    /// Emitted radiance, linear RGB \[W·m⁻²·sr⁻¹\].
    pub emission: Vec3,
    /// Texture that multiplies the emission.
    pub emission_texture: Option<TextureId>,
    /// Whether the surface is a thin layer that reflects on both sides, such as cloth. Other surfaces reflect only on
    /// the front.
    pub sheet: bool,
}

impl Material {
    /// Returns a material with a plain color.
    #[must_use]
    pub fn plain(name: &'static str, color: Vec3) -> Self {
        Self { name, color, texture: None, tile: Vec2::ONE, emission: Vec3::ZERO, emission_texture: None, sheet: false }
    }

    /// Returns a material with a texture that repeats every `tile` meters.
    #[must_use]
    pub fn textured(name: &'static str, texture: TextureId, tile: f32) -> Self {
        Self { texture: Some(texture), tile: Vec2::splat(tile), ..Self::plain(name, Vec3::ONE) }
    }

    /// Returns an emissive material with a reflectance of 0.2.
    #[must_use]
    pub fn glowing(name: &'static str, emission: Vec3) -> Self {
        Self { emission, ..Self::plain(name, Vec3::splat(0.2)) }
    }
}

/// Shape with one mesh per material.
#[derive(Clone, Debug, Default)]
pub struct Model(BTreeMap<MaterialId, Mesh>);

impl Model {
    /// Returns an empty model.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the mesh of one material. Creates an empty mesh if none exists.
    pub fn of(&mut self, material: MaterialId) -> &mut Mesh {
        self.0.entry(material).or_default()
    }

    /// Adds another model with a transform.
    pub fn append(&mut self, other: &Model, transform: glam::Mat4) {
        for (material, mesh) in &other.0 {
            self.of(*material).append(mesh, transform);
        }
    }
}

/// A punctual light.
#[derive(Clone, Debug)]
pub struct Light {
    /// Light type of `KHR_lights_punctual`: `directional` or `point`.
    pub kind: &'static str,
    /// Color of the light, linear RGB.
    pub color: Vec3,
    /// Irradiance at normal incidence \[W·m⁻²\] of a directional light, or intensity \[W·sr⁻¹\] of a point light.
    pub intensity: f32,
}

#[derive(Clone, Debug)]
struct GlbNode {
    name: String,
    mesh: Option<usize>,
    translation: Vec3,
    rotation: Quat,
    camera: bool,
    light: Option<usize>,
    children: Vec<usize>,
    is_child: bool,
}

/// A scene: materials, meshes, nodes, one camera and one animation.
#[derive(Clone, Debug)]
pub struct Scene {
    name: &'static str,
    textures: Vec<(String, Vec<u8>)>,
    materials: Vec<Material>,
    meshes: Vec<(String, Model)>,
    nodes: Vec<GlbNode>,
    lights: Vec<Light>,
    channels: Vec<(usize, Keys)>,
    yfov: f32,
}

impl Scene {
    /// Returns an empty scene.
    #[must_use]
    pub fn new(name: &'static str) -> Self {
        Self {
            name,
            textures: Vec::new(),
            materials: Vec::new(),
            meshes: Vec::new(),
            nodes: Vec::new(),
            lights: Vec::new(),
            channels: Vec::new(),
            yfov: 1.0,
        }
    }

    /// Adds a texture and returns its index.
    pub fn texture(&mut self, name: &str, texture: &Texture) -> TextureId {
        self.textures.push((name.to_owned(), texture.jpeg(88)));
        TextureId(self.textures.len() - 1)
    }

    /// Adds a material and returns its index.
    pub fn material(&mut self, material: Material) -> MaterialId {
        self.materials.push(material);
        MaterialId(self.materials.len() - 1)
    }

    /// Adds a texture, and a material that repeats it every `tile` meters. Returns the index of the material.
    pub fn textured(&mut self, name: &'static str, tile: f32, texture: &Texture) -> MaterialId {
        let texture = self.texture(name, texture);
        self.material(Material::textured(name, texture, tile))
    }

    /// Adds a material of one color and returns its index.
    pub fn plain(&mut self, name: &'static str, color: Vec3) -> MaterialId {
        self.material(Material::plain(name, color))
    }

    /// Makes a material a thin layer that reflects on both sides, see [`Material::sheet`].
    pub fn sheet(&mut self, material: MaterialId) -> MaterialId {
        self.materials[material.0].sheet = true;
        material
    }

    /// Adds a mesh and returns its index.
    pub fn mesh(&mut self, name: &str, model: Model) -> MeshId {
        self.meshes.push((name.to_owned(), model));
        MeshId(self.meshes.len() - 1)
    }

    /// Adds a node and returns its index. Without a mesh, the node serves as a parent of other nodes.
    pub fn node(&mut self, name: &str, mesh: Option<MeshId>, translation: Vec3, rotation: Quat) -> NodeId {
        self.nodes.push(GlbNode {
            name: name.to_owned(),
            mesh: mesh.map(|m| m.0),
            translation,
            rotation,
            camera: false,
            light: None,
            children: Vec::new(),
            is_child: false,
        });
        NodeId(self.nodes.len() - 1)
    }

    /// Adds a mesh and a node that shows it without a transform. Returns the index of the node.
    pub fn show(&mut self, name: &str, model: Model) -> NodeId {
        let mesh = self.mesh(name, model);
        self.node(name, Some(mesh), Vec3::ZERO, Quat::IDENTITY)
    }

    /// Makes one node the child of another.
    pub fn attach(&mut self, child: NodeId, parent: NodeId) {
        self.nodes[parent.0].children.push(child.0);
        self.nodes[child.0].is_child = true;
    }

    /// Adds a punctual light that shines along `direction`. Returns the index of its node.
    pub fn light(&mut self, name: &str, light: Light, position: Vec3, direction: Vec3) -> NodeId {
        let rotation = Quat::from_rotation_arc(Vec3::NEG_Z, direction.normalize());
        let node = self.node(name, None, position, rotation);
        self.nodes[node.0].light = Some(self.lights.len());
        self.lights.push(light);
        node
    }

    /// Adds the camera with the vertical field of view `yfov` \[rad\]. Returns the index of its node.
    pub fn camera(&mut self, yfov: f32, translation: Vec3, rotation: Quat) -> NodeId {
        let node = self.node("camera", None, translation, rotation);
        self.nodes[node.0].camera = true;
        self.yfov = yfov;
        node
    }

    /// Adds animation keys to a node.
    pub fn animate(&mut self, node: NodeId, keys: Keys) {
        self.channels.push((node.0, keys));
    }

    /// Number of visible triangles. A mesh counts once for each node that shows it.
    #[must_use]
    pub fn triangles(&self) -> usize {
        let of = |m: usize| self.meshes[m].1.0.values().map(Mesh::triangles).sum::<usize>();
        self.nodes.iter().filter_map(|n| n.mesh).map(of).sum()
    }

    /// Serializes the scene as binary glTF.
    pub fn to_glb(&self) -> Vec<u8> {
        let mut w = Writer::default();
        let mut root = Map::new();
        root.insert("asset".into(), json!({"version": "2.0", "generator": "render2mpeg make-scenes"}));
        root.insert("scene".into(), json!(0));
        // List only nodes without a parent.
        let roots: Vec<usize> = (0..self.nodes.len()).filter(|&n| !self.nodes[n].is_child).collect();
        root.insert("scenes".into(), json!([{"name": self.name, "nodes": roots}]));
        root.insert(
            "cameras".into(),
            json!([{
                "name": "camera", "type": "perspective",
                "perspective": {"yfov": self.yfov, "aspectRatio": 1.0, "znear": 0.01, "zfar": 1000.0}
            }]),
        );
        // Meshes and animations append their data to the buffer.
        let meshes: Vec<Value> = self.meshes.iter().map(|(name, model)| self.mesh_json(name, model, &mut w)).collect();
        root.insert("meshes".into(), meshes.into());
        root.insert("nodes".into(), self.nodes.iter().map(node_json).collect());
        self.animation_json(&mut root, &mut w);
        // List an extension only if the scene uses it.
        let mut used: Vec<&str> = Vec::new();
        root.insert("materials".into(), self.materials.iter().map(material_json).collect());
        if self.materials.iter().any(|m| m.emission.max_element() > 1.0) {
            used.push("KHR_materials_emissive_strength");
        }
        if !self.textures.is_empty() {
            let images: Vec<Value> = self
                .textures
                .iter()
                .map(|(name, bytes)| json!({"name": name, "mimeType": "image/jpeg", "bufferView": w.view(bytes, None)}))
                .collect();
            root.insert("images".into(), images.into());
            // The sampler uses linear filtering with mipmaps, and repeats textures in both directions.
            root.insert(
                "samplers".into(),
                json!([
                    {"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497}
                ]),
            );
            let textures: Vec<Value> = (0..self.textures.len()).map(|i| json!({"source": i, "sampler": 0})).collect();
            root.insert("textures".into(), textures.into());
        }
        // Nodes refer to the lights of this extension by index.
        if !self.lights.is_empty() {
            used.push("KHR_lights_punctual");
            let lights: Vec<Value> = self
                .lights
                .iter()
                .map(|l| json!({"type": l.kind, "color": l.color.to_array(), "intensity": l.intensity}))
                .collect();
            root.insert("extensions".into(), json!({"KHR_lights_punctual": {"lights": lights}}));
        }
        if !used.is_empty() {
            root.insert("extensionsUsed".into(), json!(used));
        }
        w.finish(root)
    }

    fn mesh_json(&self, name: &str, model: &Model, w: &mut Writer) -> Value {
        let mut primitives: Vec<Value> = Vec::new();
        for (id, mesh) in &model.0 {
            // glTF does not allow an empty primitive.
            if mesh.indices.is_empty() {
                continue;
            }
            // Divide texture coordinates by the tile size, because textures repeat over the unit square.
            let tile = self.materials[id.0].tile;
            let positions: Vec<f32> = mesh.vertices.iter().flat_map(|v| v.position.to_array()).collect();
            let normals: Vec<f32> = mesh.vertices.iter().flat_map(|v| v.normal.to_array()).collect();
            let uvs: Vec<f32> = mesh.vertices.iter().flat_map(|v| (v.uv / tile).to_array()).collect();
            primitives.push(json!({
                "attributes": {
                    "POSITION": w.floats(&positions, "VEC3", Some(34962), true),
                    "NORMAL": w.floats(&normals, "VEC3", Some(34962), false),
                    "TEXCOORD_0": w.floats(&uvs, "VEC2", Some(34962), false),
                },
                "indices": w.indices(&mesh.indices),
                "material": id.0,
            }));
        }
        json!({"name": name, "primitives": primitives})
    }

    fn animation_json(&self, root: &mut Map<String, Value>, w: &mut Writer) {
        let mut samplers = Vec::new();
        let mut channels = Vec::new();
        for (node, keys) in &self.channels {
            // Translations have three components and rotations four.
            let (path, kind) = match keys.property {
                Property::Translation => ("translation", "VEC3"),
                Property::Rotation => ("rotation", "VEC4"),
            };
            let interpolation = match keys.interpolation {
                Interpolation::Linear => "LINEAR",
                Interpolation::CubicSpline => "CUBICSPLINE",
            };
            // Each channel has its own sampler.
            channels.push(json!({"sampler": samplers.len(), "target": {"node": node, "path": path}}));
            samplers.push(json!({
                "input": w.floats(&keys.times, "SCALAR", None, true),
                "output": w.floats(&keys.values, kind, None, false),
                "interpolation": interpolation,
            }));
        }
        // glTF does not allow an empty animation.
        if !channels.is_empty() {
            root.insert(
                "animations".into(),
                json!([
                    {"name": "walk", "samplers": samplers, "channels": channels}
                ]),
            );
        }
    }
}

fn node_json(node: &GlbNode) -> Value {
    let mut n = Map::new();
    n.insert("name".into(), json!(node.name));
    if let Some(mesh) = node.mesh {
        n.insert("mesh".into(), json!(mesh));
    }
    // Omit properties with default values.
    if node.translation != Vec3::ZERO {
        n.insert("translation".into(), json!(node.translation.to_array()));
    }
    if node.rotation != Quat::IDENTITY {
        n.insert("rotation".into(), json!(node.rotation.to_array()));
    }
    if node.camera {
        n.insert("camera".into(), json!(0));
    }
    if let Some(light) = node.light {
        n.insert("extensions".into(), json!({"KHR_lights_punctual": {"light": light}}));
    }
    if !node.children.is_empty() {
        n.insert("children".into(), json!(node.children));
    }
    n.into()
}

fn material_json(material: &Material) -> Value {
    let c = material.color;
    let mut pbr = json!({
        "baseColorFactor": [c.x, c.y, c.z, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0
    });
    if let Some(t) = material.texture {
        pbr["baseColorTexture"] = json!({"index": t.0});
    }
    let mut m = json!({"name": material.name, "pbrMetallicRoughness": pbr, "doubleSided": material.sheet});
    // Omit the emission of surfaces that emit no light.
    let e = material.emission;
    if e != Vec3::ZERO {
        // The emissive factor must not exceed 1, so the emissive strength contains the magnitude.
        let strength = e.max_element().max(1.0);
        m["emissiveFactor"] = json!((e / strength).to_array());
        if strength > 1.0 {
            m["extensions"] = json!({"KHR_materials_emissive_strength": {"emissiveStrength": strength}});
        }
        if let Some(t) = material.emission_texture {
            m["emissiveTexture"] = json!({"index": t.0});
        }
    }
    m
}
