//! Loader of glTF 2.0 files into a [`Scene`]. Each error message is one clear line.
//!
//! `lenient` first fills in data that is optional in the specification but required by the `gltf` crate. The crate
//! checks most of a document; `validate.rs` checks the remaining causes of panics in the crate. The crate accepts
//! cyclic nodes, so the hierarchy is traversed with an explicit stack. If a library panics anyway, [`load`] returns an
//! error.

mod accessor;
mod animations;
mod copies;
mod document;
mod extensions;
mod glb;
mod image_decoder;
mod image_limits;
#[cfg(feature = "basis")]
mod ktx2;
mod lamps;
mod lenient;
mod lobes;
mod materials;
mod meshes;
mod nodes;
mod packed;
mod pointers;
mod skins;
mod slots;
mod source;
mod specular_glossiness;
mod stored;
mod strokes;
mod textures;
mod validate;
mod variants;

pub use extensions::{EXTENSIONS, Extension, Support, extension_table};
pub use source::GltfSource;

use accessor::Buffers;
use document::Parsed;
use lenient::PointerChannel;
use pointers::Target;

use super::files::{Reach, SceneFiles};
use super::light::STRONGEST;
use super::sky::SkySource;
use super::studio::PLAIN_SKY_NOTE;
use super::{Gradient, Material, Scene, SceneSettings, Setting};
use crate::environment::Environment;
use glam::{Affine3A, Vec3, Vec3A};
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Maximum distance from the origin along an axis \[m\]. Normals and areas depend on the square of a triangle's area,
/// at most ½ · (2√3 · 10⁹)², which is within the range of `f32`.
const FARTHEST: f32 = 1e9;

/// Maximum number of triangles of all instances. A small file may show one mesh many times, and anchors are distributed
/// by each instance's area.
const MOST_TRIANGLES: usize = 1 << 27;

/// Error while a scene is read. The message names the file, the location and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The scene file itself does not exist or cannot be read.
    #[error("{}: {error}; check the path and its permissions", path.display())]
    Open {
        /// Path of the scene file.
        path: PathBuf,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// A buffer or image next to the scene does not exist or cannot be read.
    #[error("{}: {what} \"{uri}\" cannot be read ({why}); put it next to the scene file", path.display())]
    Resource {
        /// Path of the scene file.
        path: PathBuf,
        /// Name of the resource, for instance "buffer 0".
        what: String,
        /// URI of the resource in the scene.
        uri: String,
        /// Reason for the failure.
        why: String,
    },
    /// The file requires an extension that is not supported.
    #[error("{}: needs the glTF extension {extension}, which is not supported; export the scene without it", path.display())]
    Unsupported {
        /// Path of the scene file.
        path: PathBuf,
        /// Name of the extension.
        extension: String,
    },
    /// The contents are invalid.
    #[error("{}: {what}", path.display())]
    Malformed {
        /// Path of the scene or settings file.
        path: PathBuf,
        /// Problem, location and remedy.
        what: String,
    },
}

/// Loads `path` (`.gltf` or `.glb`) and, if it exists, the TOML file of the same name next to it. Files
/// to which the scene or the TOML file refers must be in the scene's folder.
///
/// # Errors
/// The scene, its settings or a file to which they refer cannot be read; see [`LoadError`]. A damaged file never causes
/// a panic in the caller, and the process's panic hook stays unchanged.
pub fn load(path: &Path) -> Result<Scene, LoadError> {
    load_with(path, Reach::Folder, &[])
}

/// Loads a scene like [`load`], but accepts files from the folders that `reach` allows. The settings `set` override the
/// TOML file.
///
/// # Errors
/// The scene, its settings or a file to which they refer cannot be read; see [`LoadError`].
pub fn load_with(path: &Path, reach: Reach, set: &[Setting]) -> Result<Scene, LoadError> {
    // Read the scene in a guarded call, because libraries may panic on damaged data.
    let files = SceneFiles::of(path, reach);
    let bytes = files.read(path).map_err(|error| LoadError::Open { path: path.into(), error })?;
    let bytes = without_mark(&bytes);
    let settings = load_settings(path, &files, set)?;
    let mut scene = guarded(|| Loader { path, files: &files }.scene(bytes, &settings))
        .unwrap_or_else(|| Err(malformed(path, "damaged glTF: an index or offset points outside its data")))?;

    // Refuse scenes beyond the limits of memory and precision.
    let triangles = scene.triangle_count();
    if triangles > MOST_TRIANGLES {
        return Err(malformed(
            path,
            format!("{triangles} triangles in all instances; at most {MOST_TRIANGLES} are allowed"),
        ));
    }
    if !is_within_reach(&scene) {
        return Err(malformed(path, format!("an object is more than {FARTHEST:e} m from the origin; scale the scene")));
    }

    // Place the scene and apply its settings.
    scene.displacement = scene.move_to_origin();
    scene.sky = load_sky(path, &settings, &files, set)?;
    scene.origin = files.into_origin();
    scene.settings = settings;
    if let Some(target) = &mut scene.settings.camera.target {
        *target = (Vec3::from(*target) + scene.displacement).into();
    }
    check_camera(path, &scene)?;
    if scene.triangle_count() == 0 {
        scene.warnings.push("the scene has no surface: only the sky is visible".into());
    }

    // Add a default light if the scene has no light. A sky in the settings is the author's choice, even a black one.
    if scene.lacks_light() {
        scene.sky = Environment::gradient(Gradient::PLAIN);
        scene.warnings.push(PLAIN_SKY_NOTE.into());
    }
    // Check visibility last, because the notes depend on the complete scene.
    let notes = [scene.backdrop_note(), scene.clipped_note()];
    scene.warnings.extend(notes.into_iter().flatten());
    Ok(scene)
}

/// Returns the environment of the `[sky]` table.
fn load_sky(
    scene: &Path,
    settings: &SceneSettings,
    files: &SceneFiles,
    set: &[Setting],
) -> Result<Option<Environment>, LoadError> {
    // Check the settings of the sky, and return gradients directly.
    let toml = SceneSettings::path_for(scene);
    let Some(sky) = &settings.sky else { return Ok(None) };
    let source = sky.source().map_err(|error| malformed(&toml, error.to_string()))?;
    let (file, intensity, rotation) = match source {
        SkySource::Gradient(gradient) => return Ok(Environment::gradient(gradient)),
        SkySource::Image { file, intensity, rotation } => (file, intensity, rotation),
    };
    let refused = |why: String| malformed(&toml, format!("[sky] image \"{file}\": {why}"));
    // Add the image to the checksum, then decode it. An absolute path in `set` is the user's own choice of a file.
    let is_chosen = Path::new(&file).is_absolute() && set.iter().any(|setting| setting.is_text("sky", "image", &file));
    let image = if is_chosen { PathBuf::from(&file) } else { files.resolved(Path::new(&file)).map_err(refused)? };
    let _ = files.read(&image).map_err(|error| refused(format!("{}: {error}", image.display())))?;
    let texels = guarded(|| crate::image_file::read_radiance(&image).map_err(|error| error.to_string()))
        .unwrap_or_else(|| Err(format!("{}: damaged image", image.display())))
        .map_err(refused)?;
    // Non-finite texels count as black.
    let brightest = texels.samples().iter().filter(|c| c.is_finite()).fold(0.0f32, |most, c| most.max(c.max_element()));
    if brightest * intensity > STRONGEST {
        let brightest = brightest * intensity;
        return Err(malformed(
            &toml,
            format!("[sky] image \"{file}\" shines with {brightest:e}; at most {STRONGEST:e} is allowed"),
        ));
    }
    Ok(Environment::image(texels, intensity, rotation))
}

/// Checks that a camera named in the settings exists.
fn check_camera(path: &Path, scene: &Scene) -> Result<(), LoadError> {
    let Some(name) = scene.settings.camera.name.as_deref().filter(|name| scene.camera(name).is_none()) else {
        return Ok(());
    };
    let known = scene.cameras.iter().enumerate().map(|(number, camera)| format!("{number} \"{}\"", camera.name));
    let known = known.collect::<Vec<_>>().join(", ");
    let known = if known.is_empty() { "it has none".into() } else { format!("it has {known}") };
    Err(malformed(path, format!("there is no camera \"{name}\"; {known}")))
}

/// Returns whether every vertex and every node stays within [`FARTHEST`] throughout the animation.
fn is_within_reach(scene: &Scene) -> bool {
    // Measure the rest shape of each mesh once.
    let largest = |positions: &[Vec3]| positions.iter().fold(0.0f32, |most, p| most.max(p.abs().max_element()));
    let sizes: Vec<f32> = scene.meshes.iter().map(|mesh| largest(&mesh.positions)).collect();
    let steps = if scene.channels.is_empty() { 1 } else { 33 };
    // Bound a cube of this half size after the transform. Comparisons with NaN are false.
    let is_near = |world: &Affine3A, size: f32| {
        let (axes, translation) = (world.matrix3, world.translation);
        let reach = (axes.x_axis.abs() + axes.y_axis.abs() + axes.z_axis.abs()) * size + translation.abs();
        reach.cmple(Vec3A::splat(FARTHEST)).all()
    };
    for step in 0..steps {
        let pose = scene.pose(scene.duration() * step as f32 / 32.0);
        if !pose.world.iter().all(|world| is_near(world, 1.0)) {
            return false;
        }
        for (index, instance) in scene.instances.iter().enumerate() {
            // The maximum may ignore a NaN, but the sum does not.
            let size = pose.deformed(index).map_or(sizes[instance.mesh], |shape| {
                let sum: Vec3 = shape.positions.iter().sum();
                if sum.is_finite() { largest(&shape.positions) } else { f32::NAN }
            });
            if !is_near(&scene.instance_world(&pose, index), size) {
                return false;
            }
        }
    }
    true
}

fn load_settings(scene: &Path, files: &SceneFiles, set: &[Setting]) -> Result<SceneSettings, LoadError> {
    // A missing settings file is equivalent to an empty one.
    let path = SceneSettings::path_for(scene);
    let bytes = match files.read(&path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(LoadError::Open { path, error }),
    };
    let text = str::from_utf8(without_mark(&bytes)).map_err(|_| malformed(&path, "not text in UTF-8"))?;
    let settings = SceneSettings::parse(text).map_err(|error| malformed(&path, error.to_string()))?;
    if set.is_empty() {
        return Ok(settings);
    }
    // The file is valid, so any further errors are caused by `set`.
    set.iter().for_each(|setting| files.note(&setting.to_string()));
    let names = || set.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    SceneSettings::parse_with(text, set).map_err(|error| malformed(scene, format!("with {}: {error}", names())))
}

/// Returns the text without the byte order mark that some editors write before UTF-8.
fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

fn malformed(path: &Path, what: impl Into<String>) -> LoadError {
    LoadError::Malformed { path: path.into(), what: what.into() }
}

/// Runs `f`. Returns `None` if `f` panicked. This is the last resort for damage that no check covers.
fn guarded<T>(f: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(f)).ok()
}

/// Document while it is read.
#[derive(Clone, Copy)]
struct DocumentSource<'d> {
    document: &'d gltf::Document,
    buffers: &'d Buffers,
    /// Index of the selected material variant.
    variant: Option<u64>,
    /// Animation channels of `KHR_animation_pointer`.
    pointers: &'d [PointerChannel],
    /// Width of points and lines \[m\] if set, otherwise the default width.
    point_size: Option<f32>,
    /// Factor on candela and lux.
    lamps: f32,
}

/// Reader of one file. The other modules of this folder implement the steps.
struct Loader<'a> {
    path: &'a Path,
    files: &'a SceneFiles,
}

impl Loader<'_> {
    fn bad<T>(&self, what: impl Into<String>) -> Result<T, LoadError> {
        Err(malformed(self.path, what))
    }

    fn scene(&self, bytes: &[u8], settings: &SceneSettings) -> Result<Scene, LoadError> {
        let Parsed { document, buffers, found } = self.document(bytes)?;
        let mut scene = Scene { warnings: found.notes.clone(), ..Scene::default() };

        // Read lights and the animations to play. The animations determine the nodes with animated visibility.
        let has_lamps = document.lights().is_some_and(|mut lights| lights.next().is_some());
        let (lamps, note) = lamps::scale(found.generator.as_deref(), settings.light, has_lamps);
        scene.warnings.extend(note);
        let clips = self.clips(&document, &found.pointers, settings.animation.name.as_deref(), &mut scene.warnings)?;
        let mut blinking = BTreeSet::new();
        for pointer in &found.pointers {
            let plays = clips.iter().any(|clip| clip.index() == pointer.animation);
            if let Some(Target::Visible(node)) = pointers::target(&pointer.pointer).filter(|_| plays) {
                blinking.insert(node);
            }
        }

        // Read the hierarchy and the materials.
        let mut node_of = self.nodes(&document, lamps, &blinking, &mut scene)?;
        let (materials, older, notes) = materials::materials(&document);
        scene.materials = materials;
        scene.warnings.extend(notes);
        // Refuse materials that exceed the range of radiance.
        let glow = |material: &Material| material.emission.max_element();
        if let Some(index) = scene.materials.iter().position(|material| glow(material) > STRONGEST) {
            let glow = glow(&scene.materials[index]);
            return self.bad(format!("material {index} emits {glow:e}; at most {STRONGEST:e} is allowed"));
        }

        // Read meshes and tracks. Report exhausted memory first: it explains a failure better than the error that
        // follows from it.
        let variant = self.variant(&document, settings.variant.name.as_deref(), &mut scene.warnings)?;
        let source = DocumentSource {
            document: &document,
            buffers: &buffers,
            variant,
            pointers: &found.pointers,
            point_size: settings.strokes.point_size,
            lamps,
        };
        let read = self
            .meshes(source, &mut node_of, &mut scene)
            .and_then(|()| clips.iter().try_for_each(|clip| self.channels(clip, source, &node_of, &mut scene)));
        if buffers.is_exhausted() {
            return self.bad("its accessors contain far more numbers than the file has bytes for; export it again");
        }
        read?;
        self.textures(source, &found.plain_images, &older, &mut scene)?;
        lamps::give_radius(&mut scene, settings.light.lamp_radius);
        Ok(scene)
    }
}
