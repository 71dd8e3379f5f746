//! Path tracer without virtual lights: the reference for measuring the error of virtual lights.
//!
//! Paths start at the camera. At each surface, shadow rays sample one point of the emissive surfaces, one point light,
//! and one direction to each distant light. The path continues in a direction drawn from the BSDF. If shadow rays and
//! paths can both reach the same light, the power heuristic weights them \[Veach97, 9.2.4\]. Russian roulette ends
//! paths without bias.
//!
//! Light passes straight through clear thin walls, also along shadow rays. Rough glass and volumes refract paths
//! ([`Media`](crate::Media)); shadow rays do not pass them.
//!
//! Visibility matches the rest of the program. Punctual lights are invisible. An unlit surface emits only towards the
//! camera. The back of a single-sided surface is invisible, but absorbs light.

mod film;
mod hue;
mod lights;
mod state;
mod still;
mod vertex;

pub use film::{PathEstimate, PathOptions, PixelSampling};
pub use still::{Still, path_traced};

use crate::accel::Hit;
use crate::gbuffer::CameraRay;
use crate::light::Emitters;
use crate::scene::View;
use crate::surface::Surface;
use crate::{PosedScene, Units};
use glam::{Vec2, Vec3, Vec3A};
use lights::Lights;
use state::PathState;
use vertex::{Points, Vertex, power_heuristic};

/// Number of reflections before Russian roulette begins.
const SURE_BOUNCES: u32 = 4;
/// Maximum number of rays on a path, including rays behind clear walls.
const MOST_SEGMENTS: u32 = 10_000;

/// Path tracer for a scene at one time.
pub struct PathTracer<'a> {
    scene: PosedScene<'a>,
    lights: Lights<'a>,
    epsilon: f32,
}

impl std::fmt::Debug for PathTracer<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("PathTracer").field("scene", &self.scene).finish_non_exhaustive()
    }
}

impl<'a> PathTracer<'a> {
    /// Builds a path tracer for a scene with the lights `emitters`.
    #[must_use]
    pub fn new(scene: PosedScene<'a>, emitters: &'a Emitters, units: &Units) -> Self {
        Self { scene, lights: Lights::new(scene, emitters, units.epsilon), epsilon: units.epsilon }
    }

    /// Returns the radiance along one path that starts at `pixel` \[W·m⁻²·sr⁻¹\].
    fn sample(&self, view: &View, pixel: Vec2, options: &PathOptions, points: &mut Points) -> Vec3 {
        let max_bounces = options.max_bounces.unwrap_or(u32::MAX);
        let (origin, direction) = view.ray(pixel);
        let (mut radiance, mut walk) = (Vec3::ZERO, PathState::new(origin, direction));
        for _ in 0..MOST_SEGMENTS {
            // A ray that leaves the scene hits the sky.
            let Some((hit, surface)) = self.next_surface(view, &walk, options) else {
                let scene = self.scene.surfaces.scene();
                if walk.bounces == 0 && scene.background.is_some() {
                    radiance += walk.throughput * scene.background(walk.direction.into());
                } else if let Some(sky) = &scene.sky {
                    let towards = walk.direction.into();
                    let weight = walk.drawn.map_or(1.0, |pdf| power_heuristic(pdf, sky.pdf(towards)));
                    radiance += walk.throughput * sky.radiance(towards) * weight;
                }
                break;
            };
            walk.advance(hit.distance);
            if walk.bounces == 0 {
                walk.throughput *= self.scene.surfaces.scene().camera_gain(hit.instance);
            }

            // Add emission. Weight it if a shadow ray could have sampled the same point of a light.
            match walk.drawn {
                None => radiance += walk.throughput * surface.emission,
                Some(pdf) if surface.emission != Vec3::ZERO => {
                    // Unlit surfaces do not act as lights. The shadow ray starts at the last vertex.
                    let hit = Hit { distance: walk.since_vertex, ..hit };
                    if let Some(light) = self.lights.pdf_of(&hit, walk.direction, &surface) {
                        radiance += walk.throughput * surface.emission * power_heuristic(pdf, light);
                    }
                }
                Some(_) => {}
            }

            // End the path at the maximum length, at a back, or at a black surface.
            let absorbed = walk.bounces > 0 && !surface.front && !surface.double_sided;
            if walk.bounces >= max_bounces || absorbed {
                break;
            }
            let Some(interface) = walk.interface(&hit, &surface, points) else {
                walk.pass(Vertex::new(&surface, walk.direction, 1.0, self.epsilon).far_side());
                continue;
            };
            let vertex = Vertex::new(&surface, walk.direction, interface.eta, self.epsilon);
            if vertex.bsdf.is_black() {
                break;
            }
            if walk.passes_wall(&vertex, points) {
                continue;
            }

            // Add direct light at the surface.
            radiance += walk.throughput * self.lights.gather(self.scene, &vertex, &walk.media, points);

            // Continue in a direction drawn from the BSDF, unless Russian roulette ends the path.
            let (choice, way) = (points.next(), points.next());
            let Some(next) = vertex.bsdf.sample(vertex.outgoing, choice.x, way) else { break };
            let [x, y, z] = vertex.axes;
            let direction: Vec3A =
                (x * next.direction.x + y * next.direction.y + z * next.direction.z).normalize().into();
            if vertex.is_above(direction) != (next.direction.z > 0.0) {
                break;
            }
            walk.reflect(&vertex, direction, &next);
            if next.direction.z < 0.0 {
                walk.cross(&hit, &surface, &interface);
            }
            if walk.bounces > SURE_BOUNCES && !walk.survives(choice.y) {
                break;
            }
        }
        radiance
    }

    /// Returns the next surface on a path; `None` for the sky.
    fn next_surface(&self, view: &View, walk: &PathState, options: &PathOptions) -> Option<(Hit, Surface)> {
        let &PathState { origin, direction, .. } = walk;
        let hit = self.scene.accelerator.closest(origin, direction);
        if walk.drawn.is_some() {
            return hit.map(|hit| (hit, self.scene.surfaces.at(&hit, direction, 0.0)));
        }

        // Only the camera ray applies the depth range and skips invisible backs. Behind clear walls, the near plane has
        // no effect.
        let ray = CameraRay { origin, direction };
        let (near, far) = if walk.since_vertex == 0.0 { view.distances(direction) } else { (0.0, f32::INFINITY) };
        let hit = ray.cut(near, far, hit, |origin| self.scene.accelerator.closest(origin, direction))?;

        // Filter textures at the visible surface only, and only for samples at the pixel's center.
        let sharp = options.pixel == PixelSampling::Area;
        let footprint = |hit: &Hit| self.footprint(view, origin + direction * hit.distance);
        let width = |hit: &Hit| if sharp { 0.0 } else { footprint(hit) };
        let shown = ray.shown_within((near, far), self.scene, hit, width);
        shown.map(|(hit, point)| (hit, point.surface()))
    }

    /// Returns the width of a pixel at a visible point \[m\].
    fn footprint(&self, view: &View, point: Vec3A) -> f32 {
        view.pixel_width(view.project(point).map_or(0.0, |seen| seen.depth))
    }
}
