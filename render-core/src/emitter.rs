//! Emitters of light: surfaces, points, directions, the sky; as power, as photons, and as points to shade with.

use crate::accel::Hit;
use crate::environment::SkySample;
use crate::photon::{SeenLight, Start};
use crate::polygon::Polygon;
use crate::sampling::{
    Distribution, Pick, centered_sobol, concentric_disc, cosine_hemisphere, disc_to_square, frame, hammersley,
    radical_inverse, triangle, uniform_sphere,
};
use crate::scene::{PunctualKind, PunctualLight, Scene, mesh_interpolate};
use crate::surface::Surfaces;
use crate::{Units, luminance};
use glam::{Vec2, Vec3, Vec3A, Vec4};

/// A glowing surface: all emissive triangles of one instance.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// Index into [`Scene::instances`].
    pub instance: usize,
    patches: Vec<Patch>,
    choice: Distribution,
    /// Square meters, one side.
    pub area: f32,
    double_sided: bool,
    /// Emitted radiance where no texture changes it \[W·m⁻²·sr⁻¹\].
    emission: Vec3,
    textured: bool,
}

/// A triangle that glows, or a parallelogram of two: those let points be spread over the whole of a panel.
#[derive(Clone, Copy, Debug)]
struct Patch {
    triangle: usize,
    parallelogram: bool,
    /// Square meters.
    area: f32,
    /// Mean over the patch \[W·m⁻²·sr⁻¹\].
    emission: Vec3,
}

/// A point of a glowing surface, drawn at random.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightPoint {
    /// Index into the mesh's triangles.
    pub triangle: usize,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
    /// Density over area with which it was drawn \[m⁻²\].
    pub density: f32,
}

/// A point of a glowing surface that stands for a share of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaSample {
    /// A little off the surface, meters.
    pub position: Vec3A,
    /// How far off it is \[m\].
    pub offset: f32,
    /// Unit normal of the glowing side.
    pub normal: Vec3A,
    /// Intensity along the normal \[W·sr⁻¹\]: radiance times the share of the area.
    pub intensity: Vec3,
    /// The share of the area \[m²\].
    pub area: f32,
}

/// A directional light at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunLight {
    /// Unit vector towards the light.
    pub towards: Vec3A,
    /// Irradiance of a surface that faces it \[W·m⁻²\].
    pub irradiance: Vec3,
    /// Half the angle that its disc spans, radians.
    pub angular_radius: f32,
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
}

impl PointLight {
    /// Intensity towards `point`.
    #[must_use]
    pub fn intensity_towards(&self, point: Vec3A) -> Vec3 {
        let direction = (point - self.position).normalize_or_zero();
        self.intensity * self.kind.falloff(direction.dot(self.axis))
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
    /// For each of these in turn, whether it moves; the sky after them does not.
    moving: Vec<bool>,
    /// Center and radius of a ball around the scene, for light from far away.
    ball: (Vec3A, f32),
}

/// A photon on its way out.
#[derive(Clone, Copy, Debug)]
pub struct EmittedPhoton {
    /// Where it starts, a little off the surface.
    pub origin: Vec3A,
    /// Unit vector.
    pub direction: Vec3A,
    /// Linear RGB flux \[W\].
    pub flux: Vec3,
    /// Whether its light moves through the scene.
    pub from_moving: bool,
    /// Whether its light is infinitely far away.
    pub distant: bool,
}

/// Dimensions of the Halton sequence that an emission uses.
pub const EMISSION_DIMENSIONS: usize = 5;

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
        let nodes = scene.moving_nodes();
        let punctual = |sun: bool| {
            let of_kind = move |light: &&PunctualLight| (light.kind == PunctualKind::Directional) == sun;
            scene.punctual_lights.iter().filter(of_kind).map(|light| nodes[light.node])
        };
        let moving = areas.iter().map(|area| surfaces.moving()[area.instance]);
        let moving = moving.chain(punctual(false)).chain(punctual(true)).collect();
        for light in &scene.punctual_lights {
            let world = &pose.world[light.node];
            let axis = world.transform_vector3a(-Vec3A::Z).try_normalize().unwrap_or(-Vec3A::Y);
            match light.kind {
                PunctualKind::Directional => suns.push(SunLight {
                    towards: -axis,
                    irradiance: light.color,
                    angular_radius: scene.settings.sun.angular_diameter.to_radians() / 2.0,
                }),
                kind => points.push(PointLight { position: world.translation, axis, intensity: light.color, kind }),
            }
        }
        Self { areas, points, suns, moving, ball: (units.center, units.radius) }
    }

    /// A source of photons, the same for the same lights; `None` when nothing shines.
    pub fn photons<'a>(&'a self, scene: &'a Scene) -> Option<PhotonSource<'a>> {
        let (center, radius) = self.ball;
        let disc = std::f32::consts::PI * radius * radius;
        let mut powers: Vec<Vec3> = self.areas.iter().map(AreaLight::power).collect();
        powers.extend(self.points.iter().map(|light| light.intensity * cone_solid_angle(light.kind)));
        powers.extend(self.suns.iter().map(|sun| sun.irradiance * disc));
        powers.extend(scene.sky.iter().map(|sky| sky.fluence() * disc));
        let choice = Distribution::new(powers.iter().map(|&power| f64::from(luminance(power))))?;
        Some(PhotonSource { emitters: self, scene, powers, choice, center, radius })
    }
}

/// Solid angle that the light of a cone would fill at full intensity.
fn cone_solid_angle(kind: PunctualKind) -> f32 {
    match kind {
        PunctualKind::Spot { outer, .. } => {
            let steps = 256;
            let outer_cos = outer.cos();
            let step = (1.0 - outer_cos) / steps as f32;
            let sum: f32 = (0..steps).map(|i| kind.falloff(outer_cos + (i as f32 + 0.5) * step)).sum();
            std::f32::consts::TAU * sum * step
        }
        _ => 4.0 * std::f32::consts::PI,
    }
}

/// Emits photons with probability in proportion to power.
pub struct PhotonSource<'a> {
    emitters: &'a Emitters,
    scene: &'a Scene,
    powers: Vec<Vec3>,
    choice: Distribution,
    center: Vec3A,
    radius: f32,
}

impl std::fmt::Debug for PhotonSource<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("PhotonSource").field("powers", &self.powers).finish_non_exhaustive()
    }
}

impl PhotonSource<'_> {
    /// Radiant flux of each light \[W\].
    #[must_use]
    pub fn powers(&self) -> &[Vec3] {
        &self.powers
    }

    /// Lights by power.
    pub(crate) fn choice(&self) -> &Distribution {
        &self.choice
    }

    /// How many lights are not infinitely far away; these come first.
    pub(crate) fn near_lights(&self) -> usize {
        self.emitters.areas.len() + self.emitters.points.len()
    }

    /// The photon with this start, of `count`.
    pub(crate) fn emit(&self, surfaces: &Surfaces, start: Start, count: u64) -> EmittedPhoton {
        let Start { light, rest, place, way, density } = start;
        let from_moving = self.emitters.moving.get(light).copied().unwrap_or(false);
        let share = 1.0 / (density * count as f32);
        let e = self.emitters;
        if let Some(area) = e.areas.get(light) {
            let sample = area.sample(surfaces, area.point(rest, place), way.x, 0.0);
            // The same number chose the side; what it has left over is as good as new.
            let way = if area.double_sided { Vec2::new((way.x * 2.0).fract(), way.y) } else { way };
            let direction = cosine_hemisphere(sample.normal.into(), way);
            // Radiance · area · π is the flux; the point was chosen with density radiance/area-weighted.
            let flux = sample.intensity * std::f32::consts::PI * share;
            return EmittedPhoton {
                origin: sample.position,
                direction: direction.into(),
                flux,
                from_moving,
                distant: false,
            };
        }
        let light = light - e.areas.len();
        if let Some(point) = e.points.get(light) {
            let solid_angle = cone_solid_angle(point.kind);
            let (direction, weight) = match point.kind {
                PunctualKind::Spot { outer, .. } => {
                    let cos = 1.0 - way.x * (1.0 - outer.cos());
                    let (x, y) = frame(point.axis.into());
                    let (sin, angle) = ((1.0 - cos * cos).max(0.0).sqrt(), std::f32::consts::TAU * way.y);
                    let direction = x * (sin * angle.cos()) + y * (sin * angle.sin()) + Vec3::from(point.axis) * cos;
                    let cap = std::f32::consts::TAU * (1.0 - outer.cos());
                    (direction, point.kind.falloff(cos) * cap / solid_angle)
                }
                _ => (uniform_sphere(way), 1.0),
            };
            let flux = point.intensity * (solid_angle * weight * share);
            let direction = direction.normalize().into();
            return EmittedPhoton { origin: point.position, direction, flux, from_moving, distant: false };
        }
        let light = light - e.points.len();
        let disc_area = std::f32::consts::PI * self.radius * self.radius;
        let (towards, irradiance) = self.from_afar(light, way);
        let flux = irradiance * (disc_area * share);
        let (x, y) = frame(towards.into());
        let on_disc = concentric_disc(place) * self.radius;
        let origin = self.center + towards * (self.radius * 1.01) + Vec3A::from(x * on_disc.x + y * on_disc.y);
        EmittedPhoton { origin, direction: -towards, flux, from_moving, distant: true }
    }

    /// A direction towards light number `light` of those infinitely far away, drawn with `way`, and the irradiance from it.
    fn from_afar(&self, light: usize, way: Vec2) -> (Vec3A, Vec3) {
        match self.emitters.suns.get(light) {
            Some(sun) => (sun.direction(way), sun.irradiance),
            None => {
                let sky = self.scene.sky.as_ref().expect("the last power is the sky's");
                let SkySample { direction, pdf } = sky.sample(way);
                (direction.into(), sky.radiance(direction) / pdf)
            }
        }
    }

    /// One of the lights close by with the chance that `which` (0…1) gives it, half by power and half evenly; and all lights
    /// that are infinitely far away.
    pub(crate) fn some_lights(&self, which: f32) -> impl Iterator<Item = (usize, f64)> + use<> {
        let near = self.near_lights();
        let power: f64 = (0..near).map(|light| self.choice.probability(light)).sum();
        let count = near as f64;
        let chance = |light: usize| {
            0.5 / count + if power > 0.0 { 0.5 * self.choice.probability(light) / power } else { 0.5 / count }
        };
        let (mut left, mut chosen) = (f64::from(which), None);
        for light in 0..near {
            chosen = Some((light, chance(light)));
            left -= chance(light);
            if left < 0.0 {
                break;
            }
        }
        chosen.into_iter().chain((near..self.powers.len()).map(|light| (light, 1.0)))
    }

    /// How `light` lights a place with this position and unit normal, by a point or direction drawn with two pairs of numbers in
    /// 0…1; `None` if it does not.
    pub(crate) fn towards(
        &self,
        surfaces: &Surfaces,
        light: usize,
        (position, normal): (Vec3A, Vec3A),
        (place, way): (Vec2, Vec2),
    ) -> Option<SeenLight> {
        let e = self.emitters;
        let facing = |towards: Vec3A| Some(towards.dot(normal)).filter(|cosine| *cosine > 0.0);
        if let Some(area) = e.areas.get(light) {
            let sample = area.sample(surfaces, area.point(f64::from(way.x), place), way.y, 0.0);
            let (distance, towards) =
                ((sample.position - position).length(), (sample.position - position).try_normalize()?);
            let cosines = facing(towards)? * sample.normal.dot(-towards).max(0.0);
            // Bounded, as a point close by would outshine all others.
            let irradiance = sample.intensity * cosines / (distance * distance + area.area / std::f32::consts::PI);
            return Some(SeenLight { irradiance, towards, end: Some(sample.position), start: Vec4::ZERO });
        }
        if let Some(point) = e.points.get(light - e.areas.len()) {
            let way = point.position - position;
            let towards = way.try_normalize()?;
            let least = (1e-3 * self.radius).powi(2);
            let irradiance = point.intensity_towards(position) * (facing(towards)? / (way.length_squared() + least));
            return Some(SeenLight { irradiance, towards, end: Some(point.position), start: Vec4::ZERO });
        }
        let (towards, irradiance) = self.from_afar(light - self.near_lights(), way);
        let irradiance = irradiance * facing(towards)?;
        // The inverse of the way that a photon starts.
        let (x, y) = frame(towards.into());
        let to = position - self.center;
        let on_disc = Vec2::new(to.dot(x.into()), to.dot(y.into())) / self.radius;
        let place = disc_to_square(on_disc).clamp(Vec2::ZERO, Vec2::splat(1.0 - f32::EPSILON));
        Some(SeenLight { irradiance, towards, end: None, start: Vec4::new(place.x, place.y, way.x, way.y) })
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

impl AreaLight {
    fn new(surfaces: &Surfaces, instance: usize) -> Option<Self> {
        let scene = surfaces.scene();
        let mesh = &scene.meshes[scene.instances[instance].mesh];
        let material = &scene.materials[mesh.material];
        if !material.emits() || material.unlit {
            return None;
        }
        let mut patches: Vec<Patch> = Vec::new();
        for t in 0..mesh.triangles.len() {
            let [a, b, c] = surfaces.corners(instance, t);
            let area = (b - a).cross(c - a).length() / 2.0;
            // The mean over a few points of the triangle: emission textures are smooth at that scale.
            let texture = material.emission_texture.map(|slot| {
                let texture = &scene.textures[slot.texture];
                let at = |u, v| mesh_interpolate(&mesh.uvs[slot.uv_set], mesh.triangles[t], u, v);
                let sum: Vec3 = (0..64)
                    .map(|i| {
                        let (u, v) = triangle(hammersley(i, 64));
                        at(u, v).map_or(Vec3::ONE, |uv| texture.sample(slot.map(uv), texture.size().x / 16.0).color)
                    })
                    .sum();
                sum / 64.0
            });
            let emission = material.emission * texture.unwrap_or(Vec3::ONE);
            let completes = patches.last().is_some_and(|last| {
                // Corners p q r and p r s with q − p = r − s, as exporters split a rectangle.
                let [p, q, r] = surfaces.corners(instance, last.triangle);
                let tolerance = 1e-4 * (r - p).length();
                !last.parallelogram
                    && last.triangle + 1 == t
                    && (a - p).length() <= tolerance
                    && (b - r).length() <= tolerance
                    && ((q - p) - (r - c)).length() <= tolerance
            });
            match patches.last_mut() {
                Some(last) if completes => {
                    last.parallelogram = true;
                    last.emission =
                        (last.emission * last.area + emission * area) / (last.area + area).max(f32::MIN_POSITIVE);
                    last.area += area;
                }
                _ => patches.push(Patch { triangle: t, parallelogram: false, area, emission }),
            }
        }
        let choice = Distribution::new(patches.iter().map(|p| f64::from(p.area * luminance(p.emission))))?;
        let area = patches.iter().map(|patch| patch.area).sum();
        let (emission, textured) = (material.emission, material.emission_texture.is_some());
        Some(Self { instance, patches, choice, area, double_sided: material.double_sided, emission, textured })
    }

    /// Radiant flux of all its glowing sides \[W\], linear RGB.
    #[must_use]
    pub fn power(&self) -> Vec3 {
        let one_side: Vec3 = self.patches.iter().map(|p| p.emission * p.area * std::f32::consts::PI).sum();
        if self.double_sided { one_side * 2.0 } else { one_side }
    }

    /// The sample at `point`, standing for the whole light. `side` (0…1) chooses one of two sides. A texture is averaged over
    /// the share `blur` of the light's area around it.
    fn sample(&self, surfaces: &Surfaces, point: LightPoint, side: f32, blur: f32) -> AreaSample {
        let LightPoint { triangle: t, u, v, density } = point;
        let [a, b, c] = surfaces.corners(self.instance, t);
        let mirrored = if surfaces.world(self.instance).matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let sides = if self.double_sided { 2.0 } else { 1.0 };
        let turn = if self.double_sided && side >= 0.5 { -mirrored } else { mirrored };
        let normal = ((b - a).cross(c - a) * turn).normalize_or_zero();
        let share = sides / density;
        let position = a + (b - a) * u + (c - a) * v;
        let emission = if self.textured {
            let hit = Hit { distance: 0.0, instance: self.instance as u32, triangle: t as u32, u, v };
            surfaces.at(&hit, -normal, (blur * share).sqrt()).emission
        } else {
            self.emission
        };
        let offset = position.abs().max_element().max((b - a).length()) * 1e-5;
        AreaSample { position: position + normal * offset, offset, normal, intensity: emission * share, area: share }
    }

    /// The pieces that glow, as shapes.
    pub(crate) fn polygons(&self, surfaces: &Surfaces) -> Vec<Polygon> {
        let mirrored = if surfaces.world(self.instance).matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let polygon = |patch: &Patch| {
            let [a, b, c] = surfaces.corners(self.instance, patch.triangle);
            Polygon {
                corners: [a, b, c, if patch.parallelogram { a + c - b } else { c }],
                normal: ((b - a).cross(c - a) * mirrored).normalize_or_zero(),
                double_sided: self.double_sided,
                radiance: patch.emission,
            }
        };
        self.patches.iter().map(polygon).collect()
    }

    /// A point of the surface drawn about in proportion to emitted power. `which` chooses the piece, `place` the point on it.
    pub(crate) fn point(&self, which: f64, place: Vec2) -> LightPoint {
        let Pick { index, probability, .. } = self.choice.pick(which);
        let Patch { triangle: t, parallelogram, area, .. } = self.patches[index];
        let density = probability as f32 / area;
        if !parallelogram {
            let (u, v) = triangle(place);
            return LightPoint { triangle: t, u, v, density };
        }
        // Corner p, then `x` along the side from p to q and `y` along that from q to r: the triangles p q r and p r s
        // meet in the diagonal x = y.
        let Vec2 { x, y } = place;
        let (triangle, u, v) = if y <= x { (t, x - y, y) } else { (t + 1, x, y - x) };
        LightPoint { triangle, u, v, density }
    }

    /// For each triangle of the mesh, the density over area with which [`AreaLight::point`] draws from it \[m⁻²\].
    pub(crate) fn densities(&self, triangles: usize) -> Vec<f32> {
        let mut densities = vec![0.0; triangles];
        for (index, patch) in self.patches.iter().enumerate() {
            let density = (self.choice.probability(index) / f64::from(patch.area)) as f32;
            densities[patch.triangle] = if patch.area > 0.0 { density } else { 0.0 };
            if patch.parallelogram {
                densities[patch.triangle + 1] = densities[patch.triangle];
            }
        }
        densities
    }

    /// How many separate pieces glow: rectangles, or triangles that belong to none.
    #[must_use]
    pub fn patch_count(&self) -> usize {
        self.patches.len()
    }

    /// Whether a texture makes it glow unevenly.
    pub(crate) fn is_textured(&self) -> bool {
        self.textured
    }

    /// Largest side of the box around the glowing triangles, meters.
    #[must_use]
    pub fn extent(&self, surfaces: &Surfaces) -> f32 {
        let mut corners = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        for patch in &self.patches {
            let [a, b, c] = surfaces.corners(self.instance, patch.triangle);
            // The fourth corner of a parallelogram lies across from the second.
            for corner in [a, b, c, if patch.parallelogram { a + c - b } else { a }] {
                corners = (corners.0.min(corner), corners.1.max(corner));
            }
        }
        (corners.1 - corners.0).max_element()
    }

    /// `count` points that together stand for the light, spread evenly by emitted power.
    #[must_use]
    pub fn samples(&self, surfaces: &Surfaces, count: usize) -> Vec<AreaSample> {
        // Strata of power choose piece and side, in an order that spreads any first few of the points over the whole light.
        let strata: Vec<f64> =
            (0..count as u64).map(|i| (f64::from(radical_inverse(3, i)) + 0.5 / count as f64).min(1.0)).collect();
        let face = |which: f64| {
            let Pick { index, rest, .. } = self.choice.pick(which);
            2 * index + usize::from(self.double_sided && rest >= 0.5)
        };

        // Each face has points of its own: one sequence for all of them would tie the place to the choice of the face.
        let mut counts = vec![0; 2 * self.patches.len()];
        strata.iter().for_each(|&which| counts[face(which)] += 1);
        let shares = self.shares_of_points(&counts);
        let mut places: Vec<_> = counts.into_iter().map(centered_sobol).collect();

        let mut samples = Vec::with_capacity(count);
        for which in strata {
            let face = face(which);
            let place = places[face].next().expect("one place for each point of the face");
            let side = (face % 2) as f32;
            let mut sample = self.sample(surfaces, self.point(which, place), side, 1.0 / count as f32);
            sample.intensity *= shares[face];
            sample.area *= shares[face];
            samples.push(sample);
        }
        samples
    }

    /// Share of the light's power that each point of a face has, by the number of points of each face: two for a piece.
    ///
    /// ```text
    /// p / n           of a face with n ≥ 2 points and the share p of the power, which it then sends out to the last bit
    /// Σ p / Σ n       of the points of all others, which stand for each other
    /// ```
    fn shares_of_points(&self, counts: &[usize]) -> Vec<f32> {
        let sides = if self.double_sided { 2.0 } else { 1.0 };
        let power = |face: usize| self.choice.probability(face / 2) / sides;
        let has_sides = |face: usize| face.is_multiple_of(2) || self.double_sided;
        let (mut rest, mut points) = (0.0, 0);
        for (face, &count) in counts.iter().enumerate().filter(|(face, count)| has_sides(*face) && **count < 2) {
            rest += power(face);
            points += count;
        }
        // Densities hold p already: what is left is the factor that makes them these shares.
        let share = |(face, &count): (usize, &usize)| match count {
            0 => 0.0,
            1 => rest / points as f64,
            _ => power(face) / count as f64,
        };
        counts.iter().enumerate().map(share).map(|share| share as f32).collect()
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

/// The sky as `count` points of a dome far outside of the scene; none without a sky.
///
/// Each stands for about the same luminance: where the sky is bright they are dense, so that a sun in an image becomes
/// many lights and not the luck of one.
#[must_use]
pub fn dome_lights(scene: &Scene, units: &Units, count: usize) -> Vec<DomeLight> {
    let Some(sky) = &scene.sky else { return Vec::new() };
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
