//! Next event estimation: sampling of all lights, and the sampling densities.

use super::vertex::{Points, Vertex, power_heuristic};
use crate::accel::Hit;
use crate::clear::ClearWalls;
use crate::light::{DistantSample, Emitters, LightPoint, PointLight};
use crate::media::Media;
use crate::sampling::{Distribution, Pick};
use crate::surface::{Surface, Surfaces};
use crate::{PosedScene, luminance};
use glam::{Vec3, Vec3A};

/// Lights prepared for sampling.
pub(super) struct Lights<'a> {
    emitters: &'a Emitters,
    /// Distribution of emissive surfaces by power.
    choice: Option<Distribution>,
    /// Density over area of the points on each triangle of each emissive instance \[m⁻²\].
    densities: Vec<Option<Vec<f32>>>,
    /// Index in [`Emitters::areas`] and probability of each emissive instance.
    places: Vec<Option<(usize, f32)>>,
    /// Distance between the end of a shadow ray and the light \[m\].
    epsilon: f32,
    walls: ClearWalls<'a>,
}

impl<'a> Lights<'a> {
    pub(super) fn new(posed: PosedScene<'a>, emitters: &'a Emitters, epsilon: f32) -> Self {
        let scene = posed.surfaces.scene();
        let choice = Distribution::new(emitters.areas.iter().map(|area| f64::from(luminance(area.power()))));
        // Index densities by instance and triangle, for rays that hit a light.
        let mut densities = vec![None; scene.instances.len()];
        let mut places = vec![None; scene.instances.len()];
        for (place, area) in emitters.areas.iter().enumerate() {
            // A point's density is the density on its light times the probability of the light.
            let share = choice.as_ref().map_or(0.0, |choice| choice.probability(place)) as f32;
            let triangles = scene.meshes[scene.instances[area.instance].mesh].triangles.len();
            let own: Vec<f32> = area.densities(triangles).into_iter().map(|density| density * share).collect();
            densities[area.instance] = Some(own);
            places[area.instance] = Some((place, share));
        }
        Self { emitters, choice, densities, places, epsilon, walls: ClearWalls::new(posed, epsilon) }
    }

    /// Returns the density over solid angle \[sr⁻¹\] of sampling the light that a ray has hit. Returns `None` if the
    /// surface is not a light.
    pub(super) fn pdf_of(&self, hit: &Hit, direction: Vec3A, surface: &Surface) -> Option<f32> {
        let triangle = hit.triangle as usize;
        let even = self.densities[hit.instance as usize].as_ref()?[triangle];
        let (place, share) = self.places[hit.instance as usize]?;
        // With an uneven texture, the cells of a triangle have different densities.
        let density =
            self.emitters.areas[place].density(triangle, hit.u, hit.v).map_or(even, |density| density * share);
        let cos = surface.geometric_normal.dot(direction).abs();
        Some(density * hit.distance * hit.distance / cos.max(f32::MIN_POSITIVE))
    }

    /// Returns the reflected radiance of direct light at `vertex` \[W·m⁻²·sr⁻¹\]. The volume of `media` attenuates light
    /// from nearby lights.
    pub(super) fn gather(&self, scene: PosedScene, vertex: &Vertex, media: &Media, points: &mut Points) -> Vec3 {
        let surfaces = scene.surfaces;
        let mut sum = Vec3::ZERO;
        // Sample one point of all surfaces, one point light, and one direction per distant light.
        if self.choice.is_some() {
            sum += self.surface_light(surfaces, vertex, media, points);
        }
        if !self.emitters.points.is_empty() {
            sum += self.point_light(vertex, media, points);
        }
        for light in self.emitters.distant(surfaces.scene().sky.as_ref()) {
            let DistantSample { towards, radiance, pdf } = light.draw(points.next());
            let (reflected, other) = vertex.reflect(towards);
            if reflected == Vec3::ZERO {
                continue;
            }
            let passed = self.walls.passed_towards(vertex.origin(towards), towards);
            if passed != Vec3::ZERO {
                // Paths cannot hit a light without a density, so its sample has the full weight.
                let weight = pdf.map_or(1.0, |pdf| power_heuristic(pdf, other) / pdf);
                sum += passed * (reflected * radiance * weight);
            }
        }
        sum
    }

    fn surface_light(&self, surfaces: &Surfaces, vertex: &Vertex, media: &Media, points: &mut Points) -> Vec3 {
        // Draw a point of an emissive surface.
        let (which, place) = (points.next(), points.next());
        let Some(pick) = self.choice.as_ref().map(|choice| choice.pick(f64::from(which.x))) else {
            return Vec3::ZERO;
        };
        let light = &self.emitters.areas[pick.index];
        let LightPoint { triangle, u, v, density, .. } = light.point(pick.rest, place);

        // Skip the shadow ray if the surface reflects nothing from this direction.
        let [a, b, c] = surfaces.corners(light.instance, triangle);
        let way = a + (b - a) * u + (c - a) * v - vertex.position;
        let distance = way.length();
        let Some(direction) = way.try_normalize() else { return Vec3::ZERO };
        let (reflected, other) = vertex.reflect(direction);
        if reflected == Vec3::ZERO {
            return Vec3::ZERO;
        }

        // Evaluate the light's emission and the density over solid angle.
        let hit = Hit { distance, instance: light.instance as u32, triangle: triangle as u32, u, v };
        let surface = surfaces.at(&hit, direction, 0.0);
        let cos = surface.geometric_normal.dot(direction).abs();
        let pdf = pick.probability as f32 * density * distance * distance / cos;
        if surface.emission == Vec3::ZERO || !pdf.is_finite() {
            return Vec3::ZERO;
        }

        // Test visibility up to a point slightly off the light.
        let end = surface.position + surface.geometric_normal * self.epsilon;
        let passed = self.walls.passed(vertex.origin(direction), end) * media.transmittance(distance);
        passed * (reflected * surface.emission * (power_heuristic(pdf, other) / pdf))
    }

    /// Returns the reflected radiance of one point light, drawn in proportion to unshadowed contributions
    /// \[W·m⁻²·sr⁻¹\].
    fn point_light(&self, vertex: &Vertex, media: &Media, points: &mut Points) -> Vec3 {
        let unshadowed = |light: &PointLight| {
            let way = light.position - vertex.position;
            let r2 = way.length_squared();
            let Some(direction) = way.try_normalize() else { return Vec3::ZERO };
            vertex.reflect(direction).0 * light.intensity_towards(vertex.position) / r2
        };
        // Choose a light by its unshadowed contribution, so that one shadow ray suffices.
        let lights = &self.emitters.points;
        let which = points.next().x;
        let Some(choice) = Distribution::new(lights.iter().map(|light| f64::from(luminance(unshadowed(light))))) else {
            return Vec3::ZERO;
        };
        let Pick { index: light, probability, .. } = choice.pick(f64::from(which));
        let end = lights[light].position;
        let way = end - vertex.position;
        let passed = self.walls.passed(vertex.origin(way), end);
        if passed == Vec3::ZERO {
            return Vec3::ZERO;
        }
        passed * media.transmittance(way.length()) * (unshadowed(&lights[light]) / probability as f32)
    }
}
