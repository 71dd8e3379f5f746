//! glTF 2.0 files into a [`Scene`]: one clear line when that cannot be.
//!
//! The `gltf` crate checks most of a document, but panics on some damaged ones and lets nodes form
//! cycles; so it runs inside a guard, and the hierarchy is walked with an explicit stack.

use super::{
    Camera, Channel, Instance, Interpolation, Material, Mesh, Node, Projection, PunctualKind, PunctualLight, Scene,
    SceneSettings, Sky, Texture, TextureSlot, Track, Transform, Wrap,
};
use glam::{Quat, Vec2, Vec3};
use std::collections::{HashMap, hash_map::Entry};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Extensions that a file may require.
const SUPPORTED: [&str; 4] =
    ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_unlit", "KHR_texture_transform"];

/// Largest side of a texture, and the most memory that decoding one may take.
const TEXTURE_SIDE: u32 = 16384;
const TEXTURE_BYTES: u64 = 1 << 30;

/// Most elements of an accessor without a buffer view: zeros that no byte of the file stands for.
const ELEMENTS_WITHOUT_DATA: usize = 1 << 24;

/// Farthest from the origin that anything may be \[m\]: its square is far inside of the range of `f32`.
const FARTHEST: f32 = 1e15;

/// Why a scene could not be read; the message names the file, the place and the remedy.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The scene file itself is not there or cannot be read.
    #[error("{}: {error}; check the path and its permissions", path.display())]
    Open {
        /// The file asked for.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// A buffer or image beside the scene is not there or cannot be read.
    #[error("{}: {what} \"{uri}\" cannot be read ({why}); put it beside the scene file", path.display())]
    Resource {
        /// The scene file.
        path: PathBuf,
        /// Which resource, for instance "buffer 0".
        what: String,
        /// Its address as the scene gives it.
        uri: String,
        /// The reason.
        why: String,
    },
    /// The file requires an extension that is not supported.
    #[error("{}: needs the glTF extension {extension}, which is not supported; export the scene without it", path.display())]
    Unsupported {
        /// The scene file.
        path: PathBuf,
        /// Name of the extension.
        extension: String,
    },
    /// The contents make no sense.
    #[error("{}: {what}", path.display())]
    Malformed {
        /// The scene or settings file.
        path: PathBuf,
        /// What is wrong, where, and what would be right.
        what: String,
    },
}

/// Loads `path` (`.gltf` or `.glb`) and, if there is one, the TOML file of the same name beside it.
///
/// # Errors
/// See [`LoadError`]. No panic reaches the caller, whatever the file holds.
pub fn load(path: &Path) -> Result<Scene, LoadError> {
    let bytes = std::fs::read(path).map_err(|error| LoadError::Open { path: path.into(), error })?;
    let settings = load_settings(path)?;
    let mut scene = guarded(|| Loader { path, folder: path.parent().unwrap_or(Path::new("")) }.scene(&bytes))
        .unwrap_or_else(|| Err(malformed(path, "damaged glTF: an index or offset points outside of its data")))?;
    if !is_within_reach(&scene) {
        return Err(malformed(path, format!("something is more than {FARTHEST:e} m from the origin; scale the scene")));
    }
    scene.sky = settings.sky;
    scene.settings = settings;
    let lit = scene.sky.is_some()
        || !scene.punctual_lights.is_empty()
        || scene.instances.iter().any(|i| scene.materials[scene.meshes[i.mesh].material].emits());
    if !lit {
        scene.sky = Some(Sky::PLAIN);
        scene.warnings.push("the scene has no light: a plain white sky lights it".into());
    }
    Ok(scene)
}

/// Is every corner of every mesh, and every node, near enough to compute with, all through the animation?
fn is_within_reach(scene: &Scene) -> bool {
    let largest = |mesh: &Mesh| mesh.positions.iter().fold(0.0f32, |most, p| most.max(p.abs().max_element()));
    let sizes: Vec<f32> = scene.meshes.iter().map(largest).collect();
    let steps = if scene.channels.is_empty() { 1 } else { 33 };
    (0..steps).all(|step| {
        let pose = scene.pose(scene.duration() * step as f32 / 32.0);
        let reach = |node: usize, size: f32| {
            let (axes, translation) = (pose.world[node].matrix3, pose.world[node].translation);
            (axes.x_axis.abs() + axes.y_axis.abs() + axes.z_axis.abs()) * size + translation.abs()
        };
        let nodes = (0..scene.nodes.len()).map(|node| reach(node, 1.0));
        let meshes = scene.instances.iter().map(|instance| reach(instance.node, sizes[instance.mesh]));
        // Not a number is not below anything.
        nodes.chain(meshes).all(|reach| reach.cmple(glam::Vec3A::splat(FARTHEST)).all())
    })
}

fn load_settings(scene: &Path) -> Result<SceneSettings, LoadError> {
    let path = SceneSettings::path_for(scene);
    match std::fs::read_to_string(&path) {
        Ok(text) => SceneSettings::parse(&text).map_err(|what| malformed(&path, what)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(SceneSettings::default()),
        Err(error) => Err(LoadError::Open { path, error }),
    }
}

fn malformed(path: &Path, what: impl Into<String>) -> LoadError {
    LoadError::Malformed { path: path.into(), what: what.into() }
}

/// Runs `f`; `None` if it panicked. The panic's own message is kept from the user's terminal.
fn guarded<T>(f: impl FnOnce() -> T) -> Option<T> {
    thread_local!(static QUIET: std::cell::Cell<bool> = const { std::cell::Cell::new(false) });
    static HOOK: std::sync::Once = std::sync::Once::new();
    HOOK.call_once(|| {
        let previous = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !QUIET.with(std::cell::Cell::get) {
                previous(info);
            }
        }));
    });
    QUIET.with(|quiet| quiet.set(true));
    let result = catch_unwind(AssertUnwindSafe(f)).ok();
    QUIET.with(|quiet| quiet.set(false));
    result
}

struct Loader<'a> {
    path: &'a Path,
    folder: &'a Path,
}

impl Loader<'_> {
    fn bad<T>(&self, what: impl Into<String>) -> Result<T, LoadError> {
        Err(malformed(self.path, what))
    }

    fn scene(&self, bytes: &[u8]) -> Result<Scene, LoadError> {
        let (document, blob) = self.document(bytes)?;
        let buffers = self.buffers(&document, blob)?;
        let mut scene = Scene::default();
        let node_of = self.nodes(&document, &mut scene)?;
        self.meshes(&document, &buffers, &node_of, &mut scene)?;
        self.textures(&document, &buffers, &mut scene)?;
        self.channels(&document, &buffers, &node_of, &mut scene)?;
        Ok(scene)
    }

    /// Parses and validates, after looking at the required extensions ourselves: the crate refuses
    /// some that it can read, and does not name the one it minds.
    fn document(&self, bytes: &[u8]) -> Result<(gltf::Document, Option<Vec<u8>>), LoadError> {
        let gltf::Gltf { document, blob } = gltf::Gltf::from_slice_without_validation(bytes).or_else(|error| {
            self.bad(format!("not a whole glTF file ({}); export or copy it again", one_line(&error.to_string())))
        })?;
        let mut root = document.into_json();
        if let Some(extension) = root.extensions_required.iter().find(|name| !SUPPORTED.contains(&name.as_str())) {
            return Err(LoadError::Unsupported { path: self.path.into(), extension: extension.clone() });
        }
        root.extensions_required.clear();
        let document = gltf::Document::from_json(root)
            .or_else(|error| self.bad(one_line(&error.to_string()).trim_end_matches(';')))?;
        let empty = |accessor: &gltf::Accessor| accessor.view().is_none() && accessor.count() > ELEMENTS_WITHOUT_DATA;
        if let Some(accessor) = document.accessors().find(empty) {
            return self.bad(format!("accessor {} has {} elements without data", accessor.index(), accessor.count()));
        }
        Ok((document, blob))
    }

    fn buffers(&self, document: &gltf::Document, mut blob: Option<Vec<u8>>) -> Result<Vec<Vec<u8>>, LoadError> {
        let mut buffers = Vec::new();
        for buffer in document.buffers() {
            let what = format!("buffer {}", buffer.index());
            let data = match buffer.source() {
                gltf::buffer::Source::Bin => match blob.take() {
                    Some(data) => data,
                    None => return self.bad(format!("{what}: the file has no binary part; export it again")),
                },
                gltf::buffer::Source::Uri(uri) => self.resource(&what, uri)?,
            };
            if data.len() < buffer.length() {
                return self.bad(format!(
                    "{what} has {} of {} bytes: the file was cut short; copy it again",
                    data.len(),
                    buffer.length()
                ));
            }
            buffers.push(data);
        }
        Ok(buffers)
    }

    /// Reads a `data:` URI or a file inside of the scene's folder.
    fn resource(&self, what: &str, uri: &str) -> Result<Vec<u8>, LoadError> {
        let shown =
            if uri.len() > 80 { format!("{}…", uri.chars().take(40).collect::<String>()) } else { uri.into() };
        let fail = |why: &str| LoadError::Resource {
            path: self.path.into(),
            what: what.into(),
            uri: shown.clone(),
            why: why.into(),
        };
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(";base64,").ok_or_else(|| fail("only base64 data is read"))?.1;
            return decode_base64(encoded).ok_or_else(|| fail("broken base64 data"));
        }
        let relative = PathBuf::from(decode_percent(uri));
        let inside = relative.components().all(|part| matches!(part, std::path::Component::Normal(_)));
        if !inside || uri.contains("://") {
            return Err(fail("it lies outside of the scene's folder"));
        }
        std::fs::read(self.folder.join(relative)).map_err(|error| fail(&error.to_string()))
    }

    /// Fills in the hierarchy, parents first; returns our index of each glTF node in the scene.
    fn nodes(&self, document: &gltf::Document, scene: &mut Scene) -> Result<HashMap<usize, usize>, LoadError> {
        let Some(root) = document.default_scene().or_else(|| document.scenes().next()) else {
            return self.bad("the file has no scene; export one");
        };
        let mut node_of = HashMap::new();
        let mut stack: Vec<(gltf::Node, Option<usize>)> = root.nodes().map(|node| (node, None)).collect();
        stack.reverse();
        while let Some((node, parent)) = stack.pop() {
            let index = scene.nodes.len();
            if node_of.insert(node.index(), index).is_some() {
                return self.bad(format!("node {} has two parents or is its own ancestor", node.index()));
            }
            let (translation, rotation, scale) = node.transform().decomposed();
            let rest = Transform {
                translation: translation.into(),
                rotation: Quat::from_array(rotation).normalize(),
                scale: scale.into(),
            };
            if !rest.matrix().is_finite() {
                return self.bad(format!("node {} has a transform that is not finite", node.index()));
            }
            let name = node.name().unwrap_or_default().to_owned();
            if let Some(camera) = node.camera() {
                let projection = match camera.projection() {
                    gltf::camera::Projection::Perspective(p) => Projection::Perspective { yfov: p.yfov() },
                    gltf::camera::Projection::Orthographic(o) => Projection::Orthographic { ymag: o.ymag() },
                };
                let size = match projection {
                    Projection::Perspective { yfov } if yfov < std::f32::consts::PI => yfov,
                    Projection::Perspective { .. } => f32::NAN,
                    Projection::Orthographic { ymag } => ymag,
                };
                if !(size > 0.0 && size.is_finite()) {
                    return self.bad(format!("camera {} has an impossible field of view", camera.index()));
                }
                let name = if name.is_empty() { camera.name().unwrap_or_default().to_owned() } else { name.clone() };
                scene.cameras.push(Camera { name, node: index, projection });
            }
            if let Some(light) = node.light() {
                let kind = match light.kind() {
                    gltf::khr_lights_punctual::Kind::Directional => PunctualKind::Directional,
                    gltf::khr_lights_punctual::Kind::Point => PunctualKind::Point,
                    gltf::khr_lights_punctual::Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                        PunctualKind::Spot { inner: inner_cone_angle, outer: outer_cone_angle }
                    }
                };
                let color = Vec3::from(light.color()) * light.intensity();
                if !color.is_finite() || color.min_element() < 0.0 {
                    return self.bad(format!("light {} has an impossible colour or intensity", light.index()));
                }
                scene.punctual_lights.push(PunctualLight { node: index, color, kind });
            }
            let children = stack.len();
            stack.extend(node.children().map(|child| (child, Some(index))));
            stack[children..].reverse();
            scene.nodes.push(Node { name, parent, rest });
        }
        Ok(node_of)
    }

    fn meshes(
        &self,
        document: &gltf::Document,
        buffers: &[Vec<u8>],
        node_of: &HashMap<usize, usize>,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        // Materials in the file's order, and the default one behind them for primitives without.
        scene.materials = document.materials().map(|material| read_material(&material)).collect();
        scene.materials.push(Material::default());
        // A mesh that several nodes show is read once.
        let mut read: HashMap<usize, std::ops::Range<usize>> = HashMap::new();
        let mut skipped = [false; 3];
        for node in document.nodes() {
            let (Some(&index), Some(mesh)) = (node_of.get(&node.index()), node.mesh()) else { continue };
            skipped[0] |= node.skin().is_some();
            if let Entry::Vacant(entry) = read.entry(mesh.index()) {
                let first = scene.meshes.len();
                for primitive in mesh.primitives() {
                    skipped[1] |= primitive.morph_targets().len() > 0;
                    match self.primitive(&mesh, &primitive, buffers, scene.materials.len() - 1)? {
                        Some(primitive) => scene.meshes.push(primitive),
                        None => skipped[2] = true,
                    }
                }
                entry.insert(first..scene.meshes.len());
            }
            scene.instances.extend(read[&mesh.index()].clone().map(|mesh| Instance { node: index, mesh }));
        }
        let notes =
            ["skins are shown in their rest pose", "morph targets are not applied", "points and lines are left out"];
        scene.warnings.extend(notes.iter().zip(skipped).filter(|(_, met)| *met).map(|(note, _)| note.to_string()));
        Ok(())
    }

    fn primitive(
        &self,
        mesh: &gltf::Mesh,
        primitive: &gltf::Primitive,
        buffers: &[Vec<u8>],
        default_material: usize,
    ) -> Result<Option<Mesh>, LoadError> {
        use gltf::mesh::Mode;
        let place = format!("mesh {} primitive {}", mesh.index(), primitive.index());
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
        // The crate reads three floats for each position, whatever the file holds.
        let as_stated = primitive.get(&gltf::Semantic::Positions).is_some_and(|accessor| {
            (accessor.data_type(), accessor.dimensions())
                == (gltf::accessor::DataType::F32, gltf::accessor::Dimensions::Vec3)
        });
        let Some(positions) = reader.read_positions().filter(|_| as_stated) else {
            return self.bad(format!("{place} has no positions that can be read"));
        };
        let positions: Vec<Vec3> = positions.map(Vec3::from).collect();
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return self.bad(format!("{place}: the position of vertex {vertex} is not finite"));
        }
        let indices: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None if primitive.indices().is_some() => {
                return self.bad(format!("{place}: its indices lie outside of their buffer"));
            }
            None => (0..positions.len() as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|&&index| index as usize >= positions.len()) {
            return self.bad(format!("{place}: index {index}, but there are {} vertices", positions.len()));
        }
        let triangles: Vec<[u32; 3]> = match primitive.mode() {
            Mode::Triangles => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
            // Every other triangle of a strip is turned round, or it would face backwards.
            Mode::TriangleStrip => indices
                .windows(3)
                .enumerate()
                .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
                .collect(),
            Mode::TriangleFan => indices.windows(2).skip(1).map(|t| [indices[0], t[0], t[1]]).collect(),
            _ => return Ok(None),
        };
        let fits = |n: usize| n == positions.len();
        let normals: Vec<Vec3> = reader
            .read_normals()
            .map(|list| list.map(|n| Vec3::from(n).try_normalize().unwrap_or(Vec3::Y)).collect())
            .filter(|list: &Vec<Vec3>| fits(list.len()))
            .unwrap_or_default();
        let uv_set = |set: u32| -> Vec<Vec2> {
            reader
                .read_tex_coords(set)
                .map(|list| list.into_f32().map(Vec2::from).collect())
                .filter(|list: &Vec<Vec2>| fits(list.len()))
                .unwrap_or_default()
        };
        let colors: Vec<Vec3> = reader
            .read_colors(0)
            .map(|list| list.into_rgb_f32().map(Vec3::from).collect())
            .filter(|list: &Vec<Vec3>| fits(list.len()) && list.iter().all(|c| c.is_finite()))
            .unwrap_or_default();
        Ok(Some(Mesh {
            name: mesh.name().unwrap_or_default().to_owned(),
            uvs: [uv_set(0), uv_set(1)],
            normals,
            colors,
            positions,
            triangles,
            material: primitive.material().index().unwrap_or(default_material),
        }))
    }

    /// Decodes the images that a material of a shown mesh uses, and renumbers the slots to match.
    fn textures(&self, document: &gltf::Document, buffers: &[Vec<u8>], scene: &mut Scene) -> Result<(), LoadError> {
        let mut shown = vec![false; scene.materials.len()];
        for instance in &scene.instances {
            shown[scene.meshes[instance.mesh].material] = true;
        }
        if scene.materials.iter().zip(&shown).any(|(material, shown)| *shown && material.alpha_cutoff.is_some()) {
            scene.warnings.push("alpha cut-outs are shown whole".into());
        }
        let files: Vec<gltf::Texture> = document.textures().collect();
        let mut place_of: HashMap<usize, usize> = HashMap::new();
        let Scene { materials, textures, .. } = scene;
        for (material, _) in materials.iter_mut().zip(shown).filter(|(_, shown)| *shown) {
            for slot in [&mut material.base_color_texture, &mut material.emission_texture].into_iter().flatten() {
                let Some(texture) = files.get(slot.texture) else { return self.bad("a texture index is out of range") };
                slot.texture = match place_of.get(&texture.index()) {
                    Some(&place) => place,
                    None => {
                        textures.push(self.texture(texture, buffers)?);
                        place_of.insert(texture.index(), textures.len() - 1);
                        textures.len() - 1
                    }
                };
            }
        }
        Ok(())
    }

    fn texture(&self, texture: &gltf::Texture, buffers: &[Vec<u8>]) -> Result<Texture, LoadError> {
        let image = texture.source();
        let what = format!("image {}", image.index());
        let bytes = match image.source() {
            gltf::image::Source::View { view, .. } => {
                let end = view.offset().checked_add(view.length());
                match end.and_then(|end| buffers.get(view.buffer().index())?.get(view.offset()..end)) {
                    Some(bytes) => bytes.to_vec(),
                    None => return self.bad(format!("{what} lies outside of its buffer")),
                }
            }
            gltf::image::Source::Uri { uri, .. } => self.resource(&what, uri)?,
        };
        let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
            .with_guessed_format()
            .or_else(|error| self.bad(format!("{what}: {error}")))?;
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(TEXTURE_SIDE);
        limits.max_image_height = Some(TEXTURE_SIDE);
        limits.max_alloc = Some(TEXTURE_BYTES);
        reader.limits(limits);
        let pixels = reader
            .decode()
            .or_else(|error| self.bad(format!("{what}: {}; PNG and JPEG are read", one_line(&error.to_string()))))?
            .into_rgba8();
        let (width, height) = (pixels.width() as usize, pixels.height() as usize);
        if width == 0 || height == 0 {
            return self.bad(format!("{what} is empty"));
        }
        let wrap = |mode| match mode {
            gltf::texture::WrappingMode::Repeat => Wrap::Repeat,
            gltf::texture::WrappingMode::MirroredRepeat => Wrap::Mirror,
            gltf::texture::WrappingMode::ClampToEdge => Wrap::Clamp,
        };
        let sampler = texture.sampler();
        let texels = pixels.pixels().map(|pixel| pixel.0).collect();
        Ok(Texture::new(width, height, texels, [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())]))
    }

    /// Reads the first animation: a file's others are alternatives, not parts.
    fn channels(
        &self,
        document: &gltf::Document,
        buffers: &[Vec<u8>],
        node_of: &HashMap<usize, usize>,
        scene: &mut Scene,
    ) -> Result<(), LoadError> {
        use gltf::animation::util::ReadOutputs;
        if document.animations().len() > 1 {
            scene.warnings.push(format!("of {} animations the first plays", document.animations().len()));
        }
        for channel in document.animations().take(1).flat_map(|animation| animation.channels().collect::<Vec<_>>()) {
            let Some(&node) = node_of.get(&channel.target().node().index()) else { continue };
            let place = format!("animation of node {}", channel.target().node().index());
            let reader = channel.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
            let (Some(inputs), Some(outputs)) = (reader.read_inputs(), reader.read_outputs()) else {
                return self.bad(format!("{place} has no keys"));
            };
            let times: Vec<f32> = inputs.collect();
            let track = match outputs {
                ReadOutputs::Translations(keys) => Track::Translation(keys.map(Vec3::from).collect()),
                ReadOutputs::Scales(keys) => Track::Scale(keys.map(Vec3::from).collect()),
                ReadOutputs::Rotations(keys) => Track::Rotation(keys.into_f32().map(Quat::from_array).collect()),
                ReadOutputs::MorphTargetWeights(_) => continue,
            };
            let interpolation = match channel.sampler().interpolation() {
                gltf::animation::Interpolation::Step => Interpolation::Step,
                gltf::animation::Interpolation::Linear => Interpolation::Linear,
                gltf::animation::Interpolation::CubicSpline => Interpolation::CubicSpline,
            };
            let (keys, finite) = match &track {
                Track::Translation(keys) | Track::Scale(keys) => (keys.len(), keys.iter().all(|k| k.is_finite())),
                Track::Rotation(keys) => (keys.len(), keys.iter().all(|k| k.is_finite())),
            };
            let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
            let ascending = times.windows(2).all(|pair| pair[0] <= pair[1]) && times.iter().all(|t| t.is_finite());
            if times.is_empty() || keys < times.len() * per_key || !finite || !ascending {
                return self.bad(format!("{place}: keys must be finite, ascending in time, and one value each"));
            }
            scene.channels.push(Channel { node, times, track, interpolation });
        }
        Ok(())
    }
}

fn read_material(material: &gltf::Material) -> Material {
    let slot = |info: gltf::texture::Info| {
        let transform = info.texture_transform();
        let own_set = transform.as_ref().and_then(|t| t.tex_coord());
        TextureSlot {
            texture: info.texture().index(),
            uv_set: own_set.unwrap_or(info.tex_coord()).min(1) as usize,
            transform: transform.map(|t| (Vec2::from(t.offset()), t.rotation(), Vec2::from(t.scale()))),
        }
    };
    let pbr = material.pbr_metallic_roughness();
    let [r, g, b, _] = pbr.base_color_factor();
    let emission = Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0);
    let unit = |factor: f32| if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 1.0 };
    let sane = |color: Vec3| if color.is_finite() { color.max(Vec3::ZERO) } else { Vec3::ZERO };
    Material {
        name: material.name().unwrap_or_default().to_owned(),
        // A surface reflects no more than what arrives.
        base_color: sane(Vec3::new(r, g, b)).min(Vec3::ONE),
        base_color_texture: pbr.base_color_texture().map(slot),
        metallic: unit(pbr.metallic_factor()),
        roughness: unit(pbr.roughness_factor()),
        metallic_roughness_texture: None,
        normal_texture: None,
        alpha_cutoff: (material.alpha_mode() == gltf::material::AlphaMode::Mask)
            .then(|| material.alpha_cutoff().unwrap_or(0.5)),
        emission: sane(emission),
        emission_texture: material.emissive_texture().map(slot),
        double_sided: material.double_sided(),
        unlit: material.unlit(),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// `%20` and its kin in relative URIs (RFC 3986, 2.1).
fn decode_percent(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let digits = (bytes[i] == b'%').then(|| uri.get(i + 1..i + 3)).flatten();
        match digits.and_then(|d| u8::from_str_radix(d, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                i += 3;
            }
            None => {
                out.push(bytes[i]);
                i += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

/// RFC 4648, 4; `None` for a character outside of the alphabet.
fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0u32, 0u32);
    for c in text.bytes().filter(|c| *c != b'=') {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = (bits << 6) | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_decoded() {
        assert_eq!(decode_percent("Box%20With%20Spaces.bin"), "Box With Spaces.bin");
        assert_eq!(decode_percent("100%.png"), "100%.png");
        assert_eq!(decode_base64("aGVsbG8=").unwrap(), b"hello");
        assert!(decode_base64("a*b").is_none());
    }
}
