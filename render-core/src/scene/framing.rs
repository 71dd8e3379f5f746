//! Cameras that show a whole scene: distances from which all vertices fit into the picture.
//!
//! A camera at c with the orthonormal axes x, y, z looks along −z. A vertex p is inside the picture, with a margin, if
//!
//! ```text
//! ±x·(p − c) ≤ k (z·c − z·p)         ±y·(p − c) ≤ k (z·c − z·p)         k = share · tan(yfov / 2)
//! ```
//!
//! Each inequality bounds c by one support value of the vertices, such as S = max(x·p + k z·p). The nearest camera
//! follows in closed form:
//!
//! ```text
//! z·c = max((S₊ₓ + S₋ₓ) / 2k, (S₊ᵧ + S₋ᵧ) / 2k)         x·c = (S₊ₓ − S₋ₓ) / 2         y·c = (S₊ᵧ − S₋ᵧ) / 2
//! ```

use super::viewpoint::{CameraChoice, Orbit};
use super::{Camera, Channel, Interpolation, Node, Projection, Scene, Track, Transform};
use glam::{Affine3A, Mat3A, Quat, Vec3, Vec3A};
use std::f32::consts::FRAC_PI_2;

/// Fraction of the picture's height or width that the scene fills.
const SHARE: f32 = 0.78;
/// Maximum number of times at which an animation is measured.
const MOMENTS: usize = 17;
/// Number of directions from which a turning camera's distance is measured.
const TURNS: usize = 24;

/// Vertices of a scene over its whole animation, in world space.
pub(super) struct SceneExtent {
    points: Vec<Vec3A>,
}

impl SceneExtent {
    /// Collects the vertices of `scene` in all its poses, without the ground of a studio.
    pub fn of(scene: &Scene) -> Self {
        let mut points = Vec::new();
        // Reduce each mesh once; only deformed meshes differ between poses.
        let hulls: Vec<Vec<Vec3A>> = scene.meshes.iter().map(|mesh| hull_of(&mesh.positions)).collect();
        let moments = if scene.duration() > 0.0 { MOMENTS } else { 1 };
        for moment in 0..moments {
            let pose = scene.pose(scene.duration() * moment as f32 / (MOMENTS - 1) as f32);
            for (index, instance) in scene.instances.iter().enumerate() {
                if scene.ground.is_some_and(|ground| ground.instance as usize == index) {
                    continue;
                }
                let world = scene.instance_world(&pose, index);
                let deformed = pose.deformed(index).map(|shape| hull_of(&shape.positions));
                let hull = deformed.as_ref().unwrap_or(&hulls[instance.mesh]);
                points.extend(hull.iter().map(|&point| world.transform_point3a(point)));
            }
        }
        points.retain(|point| point.is_finite());
        if points.is_empty() {
            points = vec![Vec3A::splat(-1.0), Vec3A::ONE];
        }
        Self { points }
    }

    /// Returns the corners of the box around all vertices.
    pub fn bounds(&self) -> (Vec3A, Vec3A) {
        let none = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        self.points.iter().fold(none, |(low, high), &point| (low.min(point), high.max(point)))
    }

    /// Returns the maximum of `weights · p` over all vertices p.
    fn support(&self, weights: Vec3A) -> f32 {
        self.points.iter().fold(f32::NEG_INFINITY, |most, point| most.max(weights.dot(*point)))
    }

    /// Returns the nearest position from which a camera with these axes shows all vertices.
    fn position(&self, axes: &Mat3A, k: f32) -> Vec3A {
        let Mat3A { x_axis, y_axis, z_axis } = *axes;
        let [right, left] = [1.0, -1.0].map(|sign| self.support(x_axis * sign + z_axis * k));
        let [above, below] = [1.0, -1.0].map(|sign| self.support(y_axis * sign + z_axis * k));
        let away = (right + left).max(above + below) / (2.0 * k);
        let (mut x, mut y) = ((right - left) / 2.0, (above - below) / 2.0);

        // Center the shorter side, whose extremes may be at different depths.
        for _ in 0..CENTERINGS {
            x += self.offset(x_axis, z_axis, x, away);
            y += self.offset(y_axis, z_axis, y, away);
        }
        x_axis * x + y_axis * y + z_axis * away
    }

    /// Returns the shift along a side that approximately centers the picture of all vertices, for a camera at `at`
    /// along the side and at `away` along z.
    fn offset(&self, side: Vec3A, z_axis: Vec3A, at: f32, away: f32) -> f32 {
        let (mut low, mut high) = ((f32::INFINITY, 1.0), (f32::NEG_INFINITY, 1.0));
        for point in &self.points {
            let depth = (away - z_axis.dot(*point)).max(f32::MIN_POSITIVE);
            let place = (side.dot(*point) - at) / depth;
            if place < low.0 {
                low = (place, depth);
            }
            if place > high.0 {
                high = (place, depth);
            }
        }
        // A shift s changes the places by −s / depth each: the sum of both places becomes zero.
        (low.0 + high.0) / (low.1.recip() + high.1.recip())
    }

    /// Returns the minimum distance from `target` at which a camera with these axes shows all vertices, if it looks at
    /// the target.
    fn distance(&self, target: Vec3A, axes: &Mat3A, k: f32) -> f32 {
        let sides = [axes.x_axis, -axes.x_axis, axes.y_axis, -axes.y_axis];
        let needed = sides.map(|side| {
            let weights = side / k + axes.z_axis;
            self.support(weights) - weights.dot(target)
        });
        needed.into_iter().fold(1e-6, f32::max)
    }
}

/// Number of steps that center the picture.
const CENTERINGS: usize = 4;
/// Number of vertices above which only the extreme ones are kept.
const FEW: usize = 4096;
/// Number of directions in which vertices of large meshes are extreme. On a sphere, the hull of these vertices is at most
/// 1 % smaller.
const DIRECTIONS: usize = 400;

/// Returns all of a few points, or the extreme points in many directions.
fn hull_of(points: &[Vec3]) -> Vec<Vec3A> {
    let points = points.iter().map(|&point| Vec3A::from(point));
    if points.len() <= FEW {
        return points.collect();
    }
    // Find extreme points by a golden spiral of directions.
    let directions: [Vec3A; DIRECTIONS] = std::array::from_fn(|i| {
        let y = 1.0 - 2.0 * (i as f32 + 0.5) / DIRECTIONS as f32;
        let (sine, cosine) = (i as f32 * 2.399_963).sin_cos();
        let radius = (1.0 - y * y).sqrt();
        Vec3A::new(radius * cosine, y, radius * sine)
    });
    let mut extremes = vec![(f32::NEG_INFINITY, Vec3A::ZERO); DIRECTIONS + 6];
    let axes = [Vec3A::X, Vec3A::Y, Vec3A::Z, Vec3A::NEG_X, Vec3A::NEG_Y, Vec3A::NEG_Z];
    for point in points {
        for (direction, most) in directions.iter().chain(&axes).zip(&mut extremes) {
            let along = direction.dot(point);
            if along > most.0 {
                *most = (along, point);
            }
        }
    }
    extremes.into_iter().map(|(_, point)| point).collect()
}

/// Returns the axes of a camera in the direction `towards` from its target, a unit vector.
fn axes_from(towards: Vec3A, up: Vec3A) -> Mat3A {
    let x = up.cross(towards).try_normalize().unwrap_or_else(|| towards.any_orthonormal_vector());
    Mat3A::from_cols(x, towards.cross(x), towards)
}

/// Returns the direction to the camera for an azimuth from +z towards +x and an angle from +y \[°\].
fn direction(azimuth: f32, polar: f32, up: Vec3A) -> Vec3A {
    let (sine, cosine) = polar.to_radians().sin_cos();
    let (across, along) = azimuth.to_radians().sin_cos();
    let local = Vec3::new(sine * across, cosine, sine * along);
    Quat::from_rotation_arc(Vec3::Y, up.into()).mul_vec3(local).into()
}

impl Scene {
    /// Adds a camera with the position that the settings give, or a camera that shows the whole scene if the file has
    /// none.
    pub(super) fn add_camera(&mut self, extent: &SceneExtent) {
        let choice = self.settings.camera.clone();
        let node = if let Some(seconds) = choice.turn {
            self.add_turn(extent, &choice, seconds)
        } else {
            self.nodes.push(node(None, place(extent, &choice)));
            self.nodes.len() - 1
        };
        self.film_from(node, &choice);
    }

    /// Returns whether a camera is to be added: the settings place one, or the file has none.
    pub(super) fn needs_camera(&self) -> bool {
        self.settings.camera.has_position() || self.cameras.is_empty()
    }

    /// Adds a camera on a node, and selects it.
    fn film_from(&mut self, node: usize, choice: &CameraChoice) {
        self.cameras.push(camera_on(node, choice));
        self.settings.camera.name = Some((self.cameras.len() - 1).to_string());
    }

    /// Sets the vertical field of view \[rad\] of the filming camera, unless its projection is orthographic.
    pub(super) fn set_lens(&mut self, yfov: f32) {
        let number = self.filming_camera_number();
        if let Some(Projection::Perspective { yfov: lens }) = number.map(|number| &mut self.cameras[number].projection)
        {
            *lens = yfov;
        }
    }

    /// Replaces the camera by one that shows one of several views per frame, at `fps` frames per second. Call
    /// [`stop`](Self::stop) first for an animated scene.
    pub fn set_views(&mut self, orbits: &[Orbit], fps: f64) {
        let extent = SceneExtent::of(self);
        let choice = self.settings.camera.clone();
        let places: Vec<(Vec3, Quat, Vec3)> = orbits
            .iter()
            .map(|&orbit| place(&extent, &CameraChoice { orbit: Some(orbit), ..choice.clone() }))
            .map(|world| world.to_scale_rotation_translation())
            .collect();
        let times: Vec<f32> = (0..orbits.len()).map(|k| (k as f64 / fps) as f32).collect();
        let translations = places.iter().map(|place| place.2).collect();
        let rotations = places.iter().map(|place| place.1).collect();

        // Change the camera's transform in steps.
        self.nodes.push(node(None, Affine3A::IDENTITY));
        let node = self.nodes.len() - 1;
        for track in [Track::Translation(translations), Track::Rotation(rotations)] {
            self.channels.push(Channel { node, times: times.clone(), track, interpolation: Interpolation::Step });
        }
        self.film_from(node, &choice);
    }

    /// Removes all animations. The scene keeps its pose at time 0.
    pub fn stop(&mut self) {
        for channel in &self.channels {
            channel.apply(0.0, &mut self.nodes[channel.node].rest);
        }
        // Keep only the first key of morph weights.
        self.channels.retain(|channel| matches!(channel.track, Track::Weights(_)));
        self.channels.iter_mut().for_each(Channel::keep_first);
        self.camera_channels.clear();
        self.light_channels.clear();
        self.material_channels.clear();
    }

    /// Adds a node that turns about the scene's vertical axis once, and a node for a camera on it.
    fn add_turn(&mut self, extent: &SceneExtent, choice: &CameraChoice, seconds: f32) -> usize {
        // Use the largest distance of all directions, and look at the middle of the bounding box.
        let (low, high) = extent.bounds();
        let target = choice.target.map_or((low + high) / 2.0, Vec3A::from_array);
        let (azimuth, polar) = choice.angles();
        let mut distance: f32 = 0.0;
        for turn in 0..TURNS {
            let towards = direction(azimuth + 360.0 * turn as f32 / TURNS as f32, polar, choice.up());
            distance = distance.max(extent.distance(target, &axes_from(towards, choice.up()), limit(choice)));
        }
        let distance = choice.distance(distance);
        let towards = direction(azimuth, polar, choice.up());
        let mut local = Affine3A::IDENTITY;
        local.matrix3 = axes_from(towards, choice.up());
        local.translation = towards * distance;

        // Turn in quarters, since a rotation follows the shorter arc.
        self.nodes.push(node(None, Affine3A::from_translation(target.into())));
        let pivot = self.nodes.len() - 1;
        let keys = (0..=4).map(|k| Quat::from_axis_angle(choice.up().into(), FRAC_PI_2 * k as f32)).collect();
        let times = (0..=4).map(|k| seconds * k as f32 / 4.0).collect();
        let interpolation = Interpolation::Linear;
        self.channels.push(Channel { node: pivot, times, track: Track::Rotation(keys), interpolation });
        self.nodes.push(node(Some(pivot), local));
        self.nodes.len() - 1
    }
}

/// Returns the transform of a camera at the settings' position. Missing settings are chosen so that the picture shows
/// the whole scene.
fn place(extent: &SceneExtent, choice: &CameraChoice) -> Affine3A {
    let (azimuth, polar) = choice.angles();
    let towards = direction(azimuth, polar, choice.up());
    let axes = axes_from(towards, choice.up());
    let mut world = Affine3A::IDENTITY;
    world.matrix3 = axes;
    // Center the scene in the picture if neither target nor distance is set.
    let (low, high) = extent.bounds();
    world.translation = match (choice.target, choice.orbit.and_then(|orbit| orbit.distance)) {
        (None, None) => extent.position(&axes, limit(choice)),
        (target, _) => {
            let target = target.map_or((low + high) / 2.0, Vec3A::from_array);
            target + towards * choice.distance(extent.distance(target, &axes, limit(choice)))
        }
    };
    world
}

/// Returns k, the tangent of half the angle that the scene fills.
fn limit(choice: &CameraChoice) -> f32 {
    SHARE * (choice.yfov() / 2.0).tan()
}

fn node(parent: Option<usize>, world: Affine3A) -> Node {
    let (scale, rotation, translation) = world.to_scale_rotation_translation();
    Node { name: String::new(), parent, rest: Transform { translation, rotation, scale } }
}

/// Returns a camera on a node. Its picture is a square, which wider and higher pictures contain.
fn camera_on(node: usize, choice: &CameraChoice) -> Camera {
    let projection = Projection::Perspective { yfov: choice.yfov() };
    Camera { name: "around the scene".into(), node, projection, aspect: Some(1.0), ..Camera::default() }
}
