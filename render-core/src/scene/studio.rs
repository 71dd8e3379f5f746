//! Studio for scenes without lamps: light from all sides, and a ground without a horizon.
//!
//! Light without position lights every point of an empty ground alike, so the ground has one radiance:
//!
//! ```text
//! L = ρ E / π          E  irradiance of the ground from the upper hemisphere          ρ  albedo of the ground
//! ```
//! Camera rays that hit nothing show the same radiance L. The ground therefore has no visible border; only shadows and
//! reflected light of the scene are visible on it. A gain on the light that cameras receive from the ground gives any
//! background color: the albedo ρ alone, at most 1, cannot make a white background.

use super::framing::SceneExtent;
use super::studio_settings::StudioKind;
use super::{Instance, Material, Mesh, Node, Scene, Transform};
use crate::environment::Environment;
use glam::{Vec3, Vec3A, vec3};
use plane::Plane;
use std::f32::consts::{PI, TAU};

/// Name of the node of the studio's ground.
pub const STUDIO_GROUND: &str = "studio ground";

/// Ground below a scene that receives shadows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Index of the ground's instance.
    pub instance: u32,
    /// Factor on the light that cameras receive from the ground. Other surfaces receive the light without the factor.
    pub gain: Vec3,
}

/// Lamp of a studio: radiance L exp(κ (cos θ − 1)) at an angle θ from its direction.
struct SoftLamp {
    /// Azimuth relative to the camera, towards the camera's right \[°\], and elevation \[°\].
    place: [f32; 2],
    /// Radiance L at the center, linear RGB.
    radiance: [f32; 3],
    /// Sharpness κ: half of the radiance is within √(2 ln 2 / κ).
    sharpness: f32,
}

/// Light of a studio.
struct StudioLight {
    zenith: [f32; 3],
    horizon: [f32; 3],
    lamps: &'static [SoftLamp],
    /// Default radiance of the background.
    background: [f32; 3],
}

/// Wide key lamp from the left, weak fill from the right, and a rim lamp behind the scene. Narrower lamps would make the
/// noise of rough coats visible.
const SOFT: StudioLight = StudioLight {
    zenith: [0.38, 0.39, 0.42],
    horizon: [0.24, 0.24, 0.25],
    lamps: &[
        SoftLamp { place: [-48.0, 46.0], radiance: [3.4, 3.3, 3.15], sharpness: 6.0 },
        SoftLamp { place: [70.0, 20.0], radiance: [0.55, 0.58, 0.64], sharpness: 6.0 },
        SoftLamp { place: [155.0, 38.0], radiance: [3.0, 3.0, 3.1], sharpness: 12.0 },
    ],
    background: [0.62, 0.63, 0.65],
};

/// Even light from above, in front of a white ground.
const PRODUCT: StudioLight = StudioLight {
    zenith: [1.05, 1.05, 1.05],
    horizon: [0.85, 0.85, 0.85],
    lamps: &[
        SoftLamp { place: [-40.0, 55.0], radiance: [1.8, 1.8, 1.8], sharpness: 6.0 },
        SoftLamp { place: [60.0, 35.0], radiance: [1.2, 1.2, 1.2], sharpness: 6.0 },
    ],
    background: [1.7, 1.7, 1.7],
};

/// Blue sky with a sun that is wide enough for soft shadow borders.
const OUTDOOR: StudioLight = StudioLight {
    zenith: [0.28, 0.42, 0.75],
    horizon: [0.62, 0.70, 0.80],
    lamps: &[SoftLamp { place: [-55.0, 48.0], radiance: [130.0, 118.0, 98.0], sharpness: 300.0 }],
    background: [0.42, 0.40, 0.36],
};

impl StudioKind {
    fn light(self) -> Option<&'static StudioLight> {
        match self {
            Self::Soft => Some(&SOFT),
            Self::Product => Some(&PRODUCT),
            Self::Outdoor => Some(&OUTDOOR),
            Self::Off => None,
        }
    }
}

impl StudioLight {
    /// Returns the radiance from a unit direction, for a camera at `azimuth` \[rad\].
    fn radiance(&self, direction: Vec3, azimuth: f32) -> Vec3 {
        let mut sum = Vec3::from(self.horizon).lerp(self.zenith.into(), direction.y.max(0.0));
        for lamp in self.lamps {
            let [around, elevation] = lamp.place.map(f32::to_radians);
            let (sine, cosine) = (azimuth + around).sin_cos();
            let towards = vec3(elevation.cos() * sine, elevation.sin(), elevation.cos() * cosine);
            sum += Vec3::from(lamp.radiance) * (lamp.sharpness * (direction.dot(towards) - 1.0)).exp();
        }
        sum
    }

    /// Returns the light as an environment, without light from below the horizon where the ground is.
    fn environment(&self, azimuth: f32, ground: Vec3) -> Option<Environment> {
        let texels = Plane::from_fn(COLUMNS, COLUMNS / 2, |x, y| {
            let direction = direction_of(x, y);
            if direction.y < 0.0 { ground } else { self.radiance(direction, azimuth) }
        });
        Environment::image(texels, 1.0, 0.0)
    }

    /// Returns the irradiance of the ground: E = ∫ L cos θ dω over the upper hemisphere.
    fn irradiance(&self, azimuth: f32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let step = PI / (COLUMNS / 2) as f32;
        for y in 0..COLUMNS / 4 {
            for x in 0..COLUMNS {
                let direction = direction_of(x, y);
                let solid_angle = step * step * (1.0 - direction.y * direction.y).sqrt();
                sum += self.radiance(direction, azimuth) * direction.y * solid_angle;
            }
        }
        sum
    }
}

/// Number of columns of the environment's image.
const COLUMNS: usize = 256;

/// Returns the direction of a texel's center in an equirectangular image.
fn direction_of(x: usize, y: usize) -> Vec3 {
    let polar = PI * (y as f32 + 0.5) / (COLUMNS / 2) as f32;
    // The middle of the image is in direction −z, its right half towards +x.
    let azimuth = TAU * ((x as f32 + 0.5) / COLUMNS as f32 - 0.5);
    vec3(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos())
}

/// Radius of the ground, in radii of the scene's bounding sphere.
const GROUND_RADII: f32 = 8.0;
/// Distance of the ground below the scene, in radii of the scene's bounding sphere. Coplanar surfaces would flicker.
const GAP: f32 = 3e-5;
/// Minimum and maximum albedo of the ground. Its light on the scene therefore hardly depends on the background's color.
const ALBEDOS: [f32; 2] = [0.3, 0.7];

/// Warning about a scene without light.
pub(super) const PLAIN_SKY_NOTE: &str = "the scene has no lamp: a plain white sky lights it";
/// Warning about a scene in a studio because it lacks light.
const STUDIO_NOTE: &str = "the scene has no lamp: a studio lights it (--studio)";

impl Scene {
    /// Completes a scene for pictures, as its settings choose: adds a studio if the scene has no light, a camera if it
    /// has none, and a background. Programs call this method once, after loading. The studio's ground and the camera
    /// are additional nodes, after all others.
    pub fn furnish(&mut self) {
        // A turning camera shows the pose at time 0 from all sides.
        if self.settings.camera.turn.is_some() {
            self.stop();
        }
        let kind = self.studio_kind();

        // Measure the scene only for a camera or a studio.
        if kind.is_some() || self.needs_camera() {
            let extent = SceneExtent::of(self);
            if self.needs_camera() {
                self.add_camera(&extent);
            }
            if let Some(kind) = kind {
                self.note_studio();
                self.add_studio(kind, &extent);
            }
        } else if self.settings.camera.fov.is_some() {
            self.set_lens(self.settings.camera.yfov());
        }
        self.background = self.background.or(self.settings.studio.background.map(Vec3::from));
    }

    /// Returns the kind of the studio that [`furnish`](Self::furnish) adds, or `None` for no studio.
    #[must_use]
    pub fn studio_kind(&self) -> Option<StudioKind> {
        let default = self.lacks_light().then_some(StudioKind::Soft);
        self.settings.studio.kind.or(default).filter(|kind| *kind != StudioKind::Off)
    }

    /// Returns whether neither the file nor the settings have any light.
    pub(super) fn lacks_light(&self) -> bool {
        let materials = self.extreme_materials();
        let has_lamp = self.instances.iter().any(|i| materials[self.meshes[i.mesh].material].is_lamp());
        self.settings.sky.is_none() && self.punctual_lights.is_empty() && !has_lamp
    }

    /// Replaces the warning about the plain sky, in whose place a studio lights the scene.
    fn note_studio(&mut self) {
        for warning in self.warnings.iter_mut().filter(|warning| *warning == PLAIN_SKY_NOTE) {
            *warning = STUDIO_NOTE.into();
        }
    }

    /// Adds the studio that the settings choose. Sets exposure 1, for which the studio's lamps are made.
    fn add_studio(&mut self, kind: StudioKind, extent: &SceneExtent) {
        let Some(light) = kind.light() else { return };
        let azimuth = self.settings.camera.angles().0.to_radians();
        let irradiance = light.irradiance(azimuth);
        let wanted = Vec3::from(self.settings.studio.background.unwrap_or(light.background));
        let albedo = (wanted * PI / irradiance).clamp(Vec3::splat(ALBEDOS[0]), Vec3::splat(ALBEDOS[1]));
        let radiance = albedo * irradiance / PI;
        self.sky = light.environment(azimuth, radiance);
        self.background = Some(wanted);
        let instance = self.add_ground(extent, albedo);
        self.ground = Some(Ground { instance, gain: wanted / radiance });
        let table = self.settings.tone_mapping.get_or_insert_default();
        if !table.contains_key("exposure") {
            table.insert("exposure".into(), toml::Value::Float(1.0));
        }
    }

    /// Adds a square below the scene, on which it stands. Returns the index of its instance.
    fn add_ground(&mut self, extent: &SceneExtent, albedo: Vec3) -> u32 {
        let (low, high) = extent.bounds();
        let radius = ((high - low).length() / 2.0).max(1e-6);
        let center = (low + high) / 2.0;
        let (x, z) = (Vec3::X * radius * GROUND_RADII, Vec3::Z * radius * GROUND_RADII);
        let middle = Vec3::from(Vec3A::new(center.x, low.y - GAP * radius, center.z));
        let material = self.materials.len();
        self.materials.push(Material { name: STUDIO_GROUND.into(), base_color: albedo, ..Material::default() });
        self.meshes.push(Mesh {
            name: STUDIO_GROUND.into(),
            positions: vec![middle - x + z, middle + x + z, middle + x - z, middle - x - z],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material,
            ..Mesh::default()
        });
        self.nodes.push(Node { name: STUDIO_GROUND.into(), parent: None, rest: Transform::IDENTITY });
        self.instances.push(Instance { node: self.nodes.len() - 1, mesh: self.meshes.len() - 1 });
        self.instances.len() as u32 - 1
    }
}
