//! Surface with a coat, seen from one direction.

use crate::shade::visibility::receiver;
use glam::{Vec2, Vec3, Vec3A};
use render_core::sampling::{frame, owen_sobol_point};
use render_core::{Bsdf, GBuffer, Hit, Media, NOTHING, PixelSurface, ShadingPoint, Surface, SurfaceLobes, Surfaces};

/// Minimum perceptual roughness of a coat without sharp reflections: half of its reflection is more than 2° off the
/// mirror direction.
pub(super) const ROUGH: f32 = 0.2;
/// Maximum perceptual roughness of a mirror: its lobe is about as wide as a pixel.
const MIRROR: f32 = 0.05;

/// Number of rays that show the reflections of a rough clearcoat, which reflects little light.
const CLEARCOAT_RAYS: u32 = 8;

/// Surface that may have a coat, seen from one direction.
pub(super) struct Coated {
    pub receiver: ShadingPoint,
    /// World-space axes of the shading frame; z is the normal.
    axes: [Vec3; 3],
    /// Unit vector toward the viewer, in the shading frame.
    pub outgoing: Vec3,
    pub bsdf: Bsdf,
    roughness: f32,
    /// Further lobes; `None` for a plain material.
    lobes: Option<Box<SurfaceLobes>>,
    /// Whether the viewer is on the front's side.
    is_front: bool,
    /// Index of the instance, or [`NOTHING`].
    instance: u32,
    /// Offset of rays from the surface \[m\].
    epsilon: f32,
}

/// Reflection of a surface, with the axes of its shading frame.
struct Finish {
    axes: [Vec3; 3],
    bsdf: Bsdf,
    roughness: f32,
    lobes: Option<Box<SurfaceLobes>>,
    is_front: bool,
    instance: u32,
}

impl Finish {
    /// Creates the reflection of a surface of an instance with the given shading normal. `eta` is the index of refraction
    /// on the far side divided by the index on the near side; `None` in air.
    fn new(surface: &Surface, instance: u32, normal: Vec3, eta: Option<f32>) -> Self {
        let &Surface { albedo, specular, roughness, front: is_front, .. } = surface;
        let Some(lobes) = &surface.lobes else {
            let bsdf = Bsdf::new(albedo, specular, roughness);
            return Self { axes: around(normal), bsdf, roughness, lobes: None, is_front, instance };
        };
        let axes = lobes.axes(normal);
        let bsdf = Bsdf::layered(lobes, axes, eta.unwrap_or_else(|| lobes.eta(is_front)));
        // Several lobes of different width are never a mirror.
        let roughness = if lobes.has_several_widths() { lobes.roughness.max(MIRROR) } else { lobes.roughness };
        Self { axes, bsdf, roughness, lobes: Some(lobes.clone()), is_front, instance }
    }
}

/// Returns orthonormal axes with the unit `normal` as z.
fn around(normal: Vec3) -> [Vec3; 3] {
    let (x, y) = frame(normal);
    [x, y, normal]
}

impl Coated {
    /// Returns the surface of a pixel; `None` if it has no coat. Rays start `epsilon` meters off the surface.
    pub fn of_pixel(pixel: &PixelSurface, seen: &GBuffer, surfaces: &Surfaces, epsilon: f32) -> Option<Self> {
        if pixel.instance == NOTHING || pixel.specular == [0.0; 3] {
            return None;
        }
        let place = seen.view.project(pixel.position.into())?.pixel;
        let (origin, direction) = seen.view.ray(place);
        let receiver = receiver(pixel, epsilon);
        // Evaluate the lobes of few materials again: pixels contain only base and coat.
        if surfaces.material(pixel.instance as usize).lobes.is_some() {
            let hit = surfaces.hit_at(pixel.instance, pixel.triangle, pixel.position.into(), origin);
            let surface = surfaces.at(&hit, direction, seen.view.pixel_width(pixel.depth));
            let finish = Finish::new(&surface, pixel.instance, receiver.normal.into(), None);
            return Some(Self::new(receiver, finish, direction, epsilon));
        }
        let bsdf = Bsdf::new(pixel.albedo.into(), pixel.specular.into(), pixel.roughness);
        let axes = around(receiver.normal.into());
        let (roughness, instance) = (pixel.roughness, pixel.instance);
        let finish = Finish { axes, bsdf, roughness, lobes: None, is_front: true, instance };
        Some(Self::new(receiver, finish, direction, epsilon))
    }

    /// Creates the `surface` as hit by a ray in the unit `direction`. `eta` is the index of refraction on the far side
    /// divided by the index on the near side; `None` in air.
    pub fn of_hit(surface: &Surface, hit: &Hit, direction: Vec3A, eta: Option<f32>, epsilon: f32) -> Self {
        let &Surface { position, geometric_normal, shading_normal, .. } = surface;
        let receiver = ShadingPoint::off_surface(position, [shading_normal, geometric_normal], epsilon);
        let finish = Finish::new(surface, hit.instance, shading_normal.into(), eta);
        Self::new(receiver, finish, direction, epsilon)
    }

    /// Creates the `surface` at `receiver` as seen along its normal.
    #[cfg(feature = "bake")]
    pub fn at(receiver: ShadingPoint, surface: &Surface) -> Self {
        let finish = Finish::new(surface, NOTHING, receiver.normal.into(), None);
        Self::new(receiver, finish, -receiver.normal, 0.0)
    }

    /// Creates the surface at `receiver` as hit by a ray in the unit `direction`.
    fn new(receiver: ShadingPoint, finish: Finish, direction: Vec3A, epsilon: f32) -> Self {
        let Finish { axes, bsdf, roughness, lobes, is_front, instance } = finish;
        let mut coated =
            Self { receiver, axes, outgoing: Vec3::Z, bsdf, roughness, lobes, is_front, instance, epsilon };
        coated.outgoing = coated.to_frame(-direction);
        coated
    }

    /// Returns whether the coat has no sharp reflections.
    pub fn is_rough(&self) -> bool {
        self.roughness >= ROUGH
    }

    /// Returns whether the coat reflects only in the mirror direction.
    pub fn is_mirror(&self) -> bool {
        self.roughness < MIRROR
    }

    /// Returns α of the GGX distribution, about the half-width of the lobe \[rad\].
    pub fn alpha(&self) -> f32 {
        self.roughness * self.roughness
    }

    /// Returns the fraction of uniform light that the coat's single scattering reflects toward the viewer.
    pub fn albedo(&self) -> Vec3 {
        self.bsdf.coat_albedo(self.outgoing.z)
    }

    /// Returns the fraction of uniform light that coat and clearcoat reflect.
    pub fn mirror_albedo(&self) -> Vec3 {
        self.albedo() + self.clearcoat_albedo()
    }

    /// Returns the fraction of uniform light that a clearcoat reflects; zero without one.
    pub fn clearcoat_albedo(&self) -> f32 {
        self.bsdf.clearcoat_albedo(self.outgoing)
    }

    /// Returns the number of rays that show the reflections of the clearcoat.
    pub fn clearcoat_rays(&self) -> u32 {
        self.lobes.as_ref().map_or(0, |lobes| if lobes.clearcoat_roughness < MIRROR { 1 } else { CLEARCOAT_RAYS })
    }

    /// Returns a direction in world space that the clearcoat reflects, drawn with a random `point`.
    pub fn clearcoat_direction(&self, point: Vec2) -> Option<Vec3A> {
        self.to_world(self.bsdf.sample_clearcoat(self.outgoing, point)?)
    }

    /// Returns the fraction of uniform light reflected by the base, and by multiple scattering in the coat.
    pub fn diffuse_albedo(&self) -> Vec3 {
        self.bsdf.diffuse_albedo(self.outgoing.z)
    }

    /// Returns whether the surface has lobes beyond base and coat.
    pub fn has_lobes(&self) -> bool {
        self.lobes.is_some()
    }

    /// Returns whether light passes through the surface.
    pub fn transmits(&self) -> bool {
        self.bsdf.transmits()
    }

    /// Returns whether refracted light is not scattered.
    pub fn is_clear(&self) -> bool {
        self.lobes.as_ref().is_none_or(|lobes| lobes.roughness < MIRROR)
    }

    /// Returns whether the viewer is not inside a transparent volume.
    pub fn is_outside(&self) -> bool {
        self.is_front || self.lobes.as_ref().is_none_or(|lobes| lobes.glass.is_thin)
    }

    /// Returns the volumes on the far side of the surface, given the volumes on the near side.
    pub fn behind(&self, media: &Media) -> Media {
        let mut behind = media.clone();
        if let Some(glass) = self.lobes.as_ref().map(|lobes| &lobes.glass).filter(|glass| !glass.is_thin) {
            behind.cross(self.instance, self.is_front, glass, glass.ior);
        }
        behind
    }

    /// Returns the fraction of uniform light that refraction transmits toward the viewer.
    pub fn transmittance(&self) -> Vec3 {
        self.bsdf.refracted_albedo(self.outgoing.z)
    }

    /// Returns the fraction of uniform light that the base transmits diffusely toward the viewer.
    pub fn diffuse_transmittance(&self) -> Vec3 {
        self.bsdf.below_albedo(self.outgoing.z)
    }

    /// Returns the direction of refraction in the shading frame; `None` at total reflection.
    pub fn refracted(&self) -> Option<Vec3> {
        self.bsdf.refract(self.outgoing, None)
    }

    /// Returns the direction of refraction at a facet drawn with a random `point`.
    pub fn refracted_at(&self, point: Vec2) -> Option<Vec3> {
        self.bsdf.refract(self.outgoing, Some(point))
    }

    /// Returns the position slightly off the far side of the surface \[m\].
    pub fn far_side(&self) -> Vec3A {
        self.receiver.position - self.receiver.geometric_normal * (2.0 * self.epsilon)
    }

    /// Transforms a direction from the shading frame to world space; returns `None` if it is above the triangle.
    pub fn to_far_side(&self, local: Vec3) -> Option<Vec3A> {
        let direction = self.direction(local);
        (direction.dot(self.receiver.geometric_normal) < 0.0).then_some(direction)
    }

    /// Transforms a world-space vector to the shading frame.
    pub fn to_frame(&self, v: Vec3A) -> Vec3 {
        Vec3::from_array(self.axes.map(|axis| axis.dot(v.into())))
    }

    /// Transforms a direction from the shading frame to world space; returns `None` if it is below the triangle.
    pub fn to_world(&self, local: Vec3) -> Option<Vec3A> {
        let direction = self.direction(local);
        (direction.dot(self.receiver.geometric_normal) > 0.0).then_some(direction)
    }

    /// Returns the mirror direction in world space; `None` if it is below the triangle.
    pub fn mirrored(&self) -> Option<Vec3A> {
        self.to_world(self.mirrored_in_frame())
    }

    /// Returns the center of the lobe in world space.
    pub fn middle(&self) -> Vec3A {
        self.direction(self.mirrored_in_frame())
    }

    fn mirrored_in_frame(&self) -> Vec3 {
        Vec3::new(-self.outgoing.x, -self.outgoing.y, self.outgoing.z)
    }

    /// Transforms a direction from the shading frame to world space, even if it is below the triangle.
    #[cfg(feature = "bake")]
    pub fn unclipped(&self, local: Vec3) -> Vec3A {
        self.direction(local)
    }

    fn direction(&self, local: Vec3) -> Vec3A {
        let [x, y, z] = self.axes;
        Vec3A::from((x * local.x + y * local.y + z * local.z).normalize())
    }
}

/// Random points of a pixel: a segment of a sequence that nearby pixels share. Each segment is evenly distributed, and
/// so is the union of all segments. The rays that neighbors share are therefore evenly distributed, too.
pub(super) struct Points {
    seed: u64,
    piece: u32,
}

impl Points {
    /// Side of the squares of pixels that share a sequence \[pixels\].
    const SIDE: usize = 4;
    const PIECES: u32 = (Self::SIDE * Self::SIDE) as u32;

    pub fn of_pixel(x: usize, y: usize) -> Self {
        let (column, row) = (x / Self::SIDE, y / Self::SIDE);
        Self { seed: (row as u64) << 32 | column as u64, piece: (y % Self::SIDE * Self::SIDE + x % Self::SIDE) as u32 }
    }

    /// Returns the points of a further `sample` of a pixel.
    pub fn of_sample(x: usize, y: usize, sample: usize) -> Self {
        let Self { seed, piece } = Self::of_pixel(x, y);
        // Rows of pixels leave the highest bits free.
        Self { seed: seed ^ (sample as u64) << 56, piece }
    }

    /// Returns the first `count` points; `count` is a power of two.
    pub fn first(self, count: u32) -> impl Iterator<Item = Vec2> {
        let seed = self.seed;
        (self.piece * count..).take(count as usize).map(move |i| owen_sobol_point(i, seed))
    }

    /// Returns points `known` to `count` of the pixel, which follow the [`first`](Self::first) `known` points. Both
    /// numbers are powers of two.
    pub fn rest(self, known: u32, count: u32) -> impl Iterator<Item = Vec2> {
        let (seed, more) = (self.seed, count - known);
        // Start after the first points of all pixels in the square.
        (Self::PIECES * known + self.piece * more..).take(more as usize).map(move |i| owen_sobol_point(i, seed))
    }
}
