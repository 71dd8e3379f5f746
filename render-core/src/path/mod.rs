//! Path tracer without virtual lights: the reference for measuring the error of virtual lights.
//!
//! Paths start at the camera. At each surface, shadow rays sample one point of the emissive surfaces, one point light,
//! and one direction to each distant light. The path continues in a direction drawn from the BSDF. If shadow rays and
//! paths can both reach the same light, the power heuristic weights them \[Veach97, 9.2.4\]. Russian roulette ends
//! paths without bias.
//!
//! Visibility matches the rest of the program. Punctual lights are invisible. An unlit surface emits only towards the
//! camera. The back of a single-sided surface is invisible, but absorbs light.

mod film;
mod lights;
mod still;

pub use film::{PathEstimate, PathOptions, PixelSampling};
pub use still::{Still, path_traced};

use crate::accel::Hit;
use crate::bsdf::Bsdf;
use crate::gbuffer::CameraRay;
use crate::light::Emitters;
use crate::sampling::{frame, hash, owen_sobol_point};
use crate::scene::View;
use crate::surface::Surface;
use crate::{PosedScene, Units, luminance};
use glam::{Vec2, Vec3, Vec3A};
use lights::Lights;

/// Number of reflections before Russian roulette begins.
const SURE_BOUNCES: u32 = 4;
/// Maximum probability of survival in Russian roulette. It is below 1, so that paths end even in a room with white walls. At
/// reflectances above the square root of this probability, 0.995, the variance is unbounded.
const HIGHEST_SURVIVAL: f32 = 0.99;

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

/// Random numbers of one sample, as pairs. Each pair comes from a separate scrambled sequence.
struct Points {
    key: u64,
    index: u32,
    dimension: u64,
}

impl Points {
    fn next(&mut self) -> Vec2 {
        self.dimension += 1;
        owen_sobol_point(self.index, hash(self.key, self.dimension, 0))
    }
}

/// Surface on a path, with its reflection.
struct Vertex {
    /// Position slightly off the surface \[m\].
    position: Vec3A,
    geometric_normal: Vec3A,
    /// World-space axes of the shading frame. The z axis is the normal.
    axes: [Vec3; 3],
    /// Direction towards the previous vertex, in the shading frame.
    outgoing: Vec3,
    bsdf: Bsdf,
}

impl Vertex {
    fn new(surface: &Surface, direction: Vec3A, epsilon: f32) -> Self {
        // The BSDF is evaluated in the shading frame.
        let normal = Vec3::from(surface.shading_normal);
        let (x, y) = frame(normal);
        let back = -Vec3::from(direction);
        Self {
            position: surface.position + surface.geometric_normal * epsilon,
            geometric_normal: surface.geometric_normal,
            axes: [x, y, normal],
            outgoing: vector_in([x, y, normal], back),
            bsdf: Bsdf::new(surface.albedo, surface.specular, surface.roughness),
        }
    }

    /// Returns BRDF times cosine, and the sampling density, for light from the unit `direction`. Both are zero below
    /// the triangle's plane, regardless of the shading normal.
    fn reflect(&self, direction: Vec3A) -> (Vec3, f32) {
        if self.geometric_normal.dot(direction) <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let incoming = vector_in(self.axes, direction.into());
        (self.bsdf.evaluate(self.outgoing, incoming) * incoming.z.max(0.0), self.bsdf.pdf(self.outgoing, incoming))
    }
}

/// Returns the components of `v` along orthonormal axes.
fn vector_in(axes: [Vec3; 3], v: Vec3) -> Vec3 {
    Vec3::from_array(axes.map(|axis| axis.dot(v)))
}

/// Returns the weight of a sample with density `a`, if another strategy draws the same sample with density `b`.
fn power_heuristic(a: f32, b: f32) -> f32 {
    // The squared densities of narrow lobes exceed the range of f32, but their ratio does not.
    if a <= 0.0 {
        return 0.0;
    }
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}

impl<'a> PathTracer<'a> {
    /// Builds a path tracer for a scene with the lights `emitters`.
    #[must_use]
    pub fn new(scene: PosedScene<'a>, emitters: &'a Emitters, units: &Units) -> Self {
        Self { scene, lights: Lights::new(scene.surfaces, emitters, units.epsilon), epsilon: units.epsilon }
    }

    /// Returns the radiance along one path that starts at `pixel` \[W·m⁻²·sr⁻¹\].
    fn sample(&self, view: &View, pixel: Vec2, options: &PathOptions, points: &mut Points) -> Vec3 {
        let sharp = options.pixel == PixelSampling::Area;
        let max_bounces = options.max_bounces.unwrap_or(u32::MAX);
        let (mut origin, mut direction) = view.ray(pixel);
        let (mut radiance, mut throughput) = (Vec3::ZERO, Vec3::ONE);

        // Density of the direction at the previous surface; `None` at the camera, because no other strategy samples
        // lights there.
        let mut drawn: Option<f32> = None;
        for bounce in 0.. {
            let hit = self.scene.accelerator.closest(origin, direction);
            let ray = CameraRay { origin, direction };
            let (near, far) = view.distances(direction);
            // Only the camera ray applies the depth range and skips invisible backs.
            let hit = match drawn {
                None => ray.cut(near, far, hit, |origin| self.scene.accelerator.closest(origin, direction)),
                Some(_) => hit,
            };

            // Filter textures at the visible surface only, and only for samples at the pixel's center.
            let met = match drawn {
                None => hit.and_then(|hit| {
                    let footprint = |hit: &Hit| self.footprint(view, origin + direction * hit.distance);
                    let width = |hit: &Hit| if sharp { 0.0 } else { footprint(hit) };
                    let shown = ray.shown_within((near, far), self.scene, hit, width);
                    shown.map(|(hit, point)| (hit, point.surface()))
                }),
                Some(_) => hit.map(|hit| (hit, self.scene.surfaces.at(&hit, direction, 0.0))),
            };

            // A ray that leaves the scene hits the sky.
            let Some((hit, surface)) = met else {
                if let Some(sky) = &self.scene.surfaces.scene().sky {
                    let weight = drawn.map_or(1.0, |pdf| power_heuristic(pdf, sky.pdf(direction.into())));
                    radiance += throughput * sky.radiance(direction.into()) * weight;
                }
                break;
            };

            // Add emission. Weight it if a shadow ray could have sampled the same point of a light.
            match drawn {
                None => radiance += throughput * surface.emission,
                Some(pdf) if surface.emission != Vec3::ZERO => {
                    // Unlit surfaces do not act as lights.
                    if let Some(light) = self.lights.pdf_of(&hit, direction, &surface) {
                        radiance += throughput * surface.emission * power_heuristic(pdf, light);
                    }
                }
                Some(_) => {}
            }

            // End the path at the maximum length, at a back, or at a black surface.
            let absorbed = bounce > 0 && !surface.front && !surface.double_sided;
            if bounce >= max_bounces || absorbed {
                break;
            }
            let vertex = Vertex::new(&surface, direction, self.epsilon);
            if vertex.bsdf.is_black() {
                break;
            }

            // Add direct light at the surface.
            radiance += throughput * self.lights.gather(self.scene, &vertex, points);

            // Continue in a direction drawn from the BSDF, unless Russian roulette ends the path.
            let (choice, way) = (points.next(), points.next());
            let Some(next) = vertex.bsdf.sample(vertex.outgoing, choice.x, way) else { break };
            let [x, y, z] = vertex.axes;
            direction = (x * next.direction.x + y * next.direction.y + z * next.direction.z).normalize().into();
            if direction.dot(vertex.geometric_normal) <= 0.0 {
                break;
            }
            throughput *= next.weight;
            if bounce >= SURE_BOUNCES {
                let survival = luminance(throughput).max(throughput.max_element() / 2.0).min(HIGHEST_SURVIVAL);
                if choice.y >= survival {
                    break;
                }
                throughput /= survival;
            }
            drawn = Some(next.pdf);
            origin = vertex.position;
        }
        radiance
    }

    /// Returns the width of a pixel at a visible point \[m\].
    fn footprint(&self, view: &View, point: Vec3A) -> f32 {
        view.pixel_width(view.project(point).map_or(0.0, |seen| seen.depth))
    }
}
