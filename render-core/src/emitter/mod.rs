//! Emitters of light: surfaces, points, directions, the sky; as power, as photons, and as points to shade with.

mod area;
mod cell;
mod order;
mod patch;
mod photons;

pub(crate) use area::LightPoint;
pub use area::{AreaLight, AreaSample};
pub(crate) use photons::Start;
use photons::cone_solid_angle;
pub use photons::{EMISSION_DIMENSIONS, EmittedPhoton, PhotonSource};

use crate::environment::{Environment, SkySample};
use crate::sampling::{Distribution, concentric_disc, frame};
use crate::scene::{PunctualKind, Scene};
use crate::surface::Surfaces;
use crate::{Units, luminance};
use glam::{Vec2, Vec3, Vec3A};

/// A directional light at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunLight {
    /// Unit vector towards the light.
    pub towards: Vec3A,
    /// Irradiance of a surface that faces it \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Half the angle that its disc spans, radians.
    pub angular_radius: f32,
    /// Whether it moves at any time.
    pub moves: bool,
}

/// A point or spot light at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Meters.
    pub position: Vec3A,
    /// Unit vector along the axis of a spot.
    pub axis: Vec3A,
    /// On the axis \[W·sr⁻¹\].
    pub intensity: Vec3,
    /// Shape of the cone.
    pub kind: PunctualKind,
    /// Whether it moves at any time.
    pub moves: bool,
}

impl PointLight {
    /// Intensity towards `point`.
    #[must_use]
    pub fn intensity_towards(&self, point: Vec3A) -> Vec3 {
        let direction = (point - self.position).normalize_or_zero();
        self.intensity * self.kind.falloff(direction.dot(self.axis))
    }
}

/// A light among the [`Emitters`] and the sky, by its kind and its place among these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LightId {
    /// Index into [`Emitters::areas`].
    Area(usize),
    /// Index into [`Emitters::points`].
    Point(usize),
    /// Index into [`Emitters::suns`].
    Sun(usize),
    /// The scene's sky.
    Sky,
}

impl LightId {
    /// Whether the light is infinitely far away.
    pub(crate) fn is_distant(self) -> bool {
        matches!(self, Self::Sun(_) | Self::Sky)
    }
}

/// All lights of the scene at one time.
#[derive(Clone, Debug)]
pub struct Emitters {
    /// Glowing surfaces.
    pub areas: Vec<AreaLight>,
    /// Point and spot lights.
    pub points: Vec<PointLight>,
    /// Directional lights.
    pub suns: Vec<SunLight>,
    /// Center and radius of a ball around the scene, for light from far away.
    ball: (Vec3A, f32),
}

/// Radius of the dome of far lights in radii of the scene: far enough that its parallax is below a pixel's width, and near
/// enough that a shadow ray cast from there ends as exactly as one that begins at the surface.
const DOME_RADII: f32 = 100.0;

impl Emitters {
    /// Gathers the lights. `units` gives the ball around the scene.
    #[must_use]
    pub fn new(surfaces: &Surfaces, pose: &crate::scene::Pose, units: &Units) -> Self {
        let scene = surfaces.scene();
        let areas: Vec<AreaLight> =
            (0..scene.instances.len()).filter_map(|instance| AreaLight::new(surfaces, instance)).collect();
        let (mut points, mut suns) = (Vec::new(), Vec::new());
        let moving = scene.moving_nodes();
        for light in pose.punctual_lights(scene) {
            let (world, moves) = (&pose.world[light.node], moving[light.node]);
            let axis = world.transform_vector3a(-Vec3A::Z).try_normalize().unwrap_or(-Vec3A::Y);
            match light.kind {
                PunctualKind::Directional => suns.push(SunLight {
                    towards: -axis,
                    irradiance: light.color,
                    angular_radius: scene.settings.sun.angular_diameter.to_radians() / 2.0,
                    moves,
                }),
                kind => {
                    points.push(PointLight { position: world.translation, axis, intensity: light.color, kind, moves });
                }
            }
        }
        Self { areas, points, suns, ball: (units.center, units.radius) }
    }

    /// A source of photons, the same for the same lights; `None` when nothing shines.
    pub fn photons<'a>(&'a self, scene: &'a Scene) -> Option<PhotonSource<'a>> {
        let (center, radius) = self.ball;
        let disc = std::f32::consts::PI * radius * radius;
        let (mut lights, mut powers) = (Vec::new(), Vec::new());
        for (light, power) in self.powers(scene, disc) {
            lights.push(light);
            powers.push(power);
        }
        let choice = Distribution::new(powers.iter().map(|&power| f64::from(luminance(power))))?;
        Some(PhotonSource { emitters: self, scene, lights, powers, choice, center, radius })
    }

    /// All lights, each with its radiant flux through a scene of the cross-section `disc` \[m²\].
    fn powers(&self, scene: &Scene, disc: f32) -> impl Iterator<Item = (LightId, Vec3)> {
        let areas = self.areas.iter().map(AreaLight::power);
        let points = self.points.iter().map(|light| light.intensity * cone_solid_angle(light.kind));
        let suns = self.suns.iter().map(move |sun| sun.irradiance * disc);
        let sky = scene.sky.iter().map(move |sky| (LightId::Sky, sky.fluence() * disc));
        let areas = areas.enumerate().map(|(index, power)| (LightId::Area(index), power));
        let points = points.enumerate().map(|(index, power)| (LightId::Point(index), power));
        let suns = suns.enumerate().map(|(index, power)| (LightId::Sun(index), power));
        areas.chain(points).chain(suns).chain(sky)
    }
}

impl SunLight {
    /// A unit vector towards a point of the disc, for `u` in the unit square.
    #[must_use]
    pub fn direction(&self, u: Vec2) -> Vec3A {
        let (x, y) = frame(self.towards.into());
        let p = concentric_disc(u) * self.angular_radius.sin();
        (self.towards + Vec3A::from(x * p.x + y * p.y)).normalize()
    }
}

/// A light of the sky's dome: a point so far away that it lights the whole scene from one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DomeLight {
    /// On the dome, meters.
    pub position: Vec3A,
    /// Intensity \[W·sr⁻¹\] such that its irradiance at the scene's center is that of its share of the sky.
    pub intensity: Vec3,
}

/// The sky beside its lamps as `count` points of a dome far outside of the scene; none without a sky.
///
/// Each stands for about the same luminance: where the sky is bright they are dense, so that a sun in an image becomes
/// many lights and not the luck of one.
#[must_use]
pub fn dome_lights(scene: &Scene, units: &Units, count: usize) -> Vec<DomeLight> {
    let Some(sky) = scene.sky.as_ref().and_then(Environment::beside_lamps) else { return Vec::new() };
    let distance = units.radius * DOME_RADII;
    (0..count)
        .map(|i| {
            // Steps of the golden ratio: under an even sky this is the golden spiral, the most even spread of directions.
            let across = (i as f64 * 0.618_033_988_749_894_9).fract() as f32;
            let SkySample { direction, pdf } = sky.sample(Vec2::new(across, (i as f32 + 0.5) / count as f32));
            let intensity = sky.radiance(direction) * (distance * distance / (pdf * count as f32));
            DomeLight { position: units.center + Vec3A::from(direction) * distance, intensity }
        })
        .filter(|light| luminance(light.intensity) > 0.0)
        .collect()
}
