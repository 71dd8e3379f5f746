//! Surface with a coat, seen from one direction.

use crate::shade::visibility::receiver;
use glam::{Vec2, Vec3, Vec3A};
use render_core::sampling::{frame, owen_sobol_point};
use render_core::{Bsdf, GBuffer, NOTHING, PixelSurface, ShadingPoint, Surface};

/// Minimum perceptual roughness of a coat without sharp reflections: half of its reflection is more than 2° off the
/// mirror direction.
const ROUGH: f32 = 0.2;
/// Maximum perceptual roughness of a mirror: its lobe is about as wide as a pixel.
const MIRROR: f32 = 0.05;

/// Surface that may have a coat, seen from one direction.
pub(super) struct Coated {
    pub receiver: ShadingPoint,
    /// World-space axes of the shading frame; z is the normal.
    axes: [Vec3; 3],
    /// Unit vector toward the viewer, in the shading frame.
    pub outgoing: Vec3,
    pub bsdf: Bsdf,
    roughness: f32,
}

impl Coated {
    /// Returns the surface of a pixel; `None` if it has no coat. Rays start `epsilon` meters off the surface.
    pub fn of_pixel(pixel: &PixelSurface, seen: &GBuffer, epsilon: f32) -> Option<Self> {
        if pixel.instance == NOTHING || pixel.specular == [0.0; 3] {
            return None;
        }
        let place = seen.view.project(pixel.position.into())?.pixel;
        let (_, direction) = seen.view.ray(place);
        let bsdf = Bsdf::new(pixel.albedo.into(), pixel.specular.into(), pixel.roughness);
        Some(Self::new(receiver(pixel, epsilon), bsdf, pixel.roughness, direction))
    }

    /// Creates the `surface` as hit by a ray in the unit `direction`.
    pub fn of_surface(surface: &Surface, direction: Vec3A, epsilon: f32) -> Self {
        let &Surface { position, geometric_normal, shading_normal, albedo, specular, roughness, .. } = surface;
        let receiver = ShadingPoint::off_surface(position, [shading_normal, geometric_normal], epsilon);
        Self::new(receiver, Bsdf::new(albedo, specular, roughness), roughness, direction)
    }

    /// Creates the `surface` at `receiver` as seen along its normal.
    #[cfg(feature = "bake")]
    pub fn at(receiver: ShadingPoint, surface: &Surface) -> Self {
        let &Surface { albedo, specular, roughness, .. } = surface;
        Self::new(receiver, Bsdf::new(albedo, specular, roughness), roughness, -receiver.normal)
    }

    /// Creates the surface at `receiver` as hit by a ray in the unit `direction`.
    fn new(receiver: ShadingPoint, bsdf: Bsdf, roughness: f32, direction: Vec3A) -> Self {
        let normal = Vec3::from(receiver.normal);
        let (x, y) = frame(normal);
        let axes = [x, y, normal];
        let mut coated = Self { receiver, axes, outgoing: Vec3::Z, bsdf, roughness };
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

    /// Returns the fraction of uniform light reflected by the base, and by multiple scattering in the coat.
    pub fn diffuse_albedo(&self) -> Vec3 {
        self.bsdf.diffuse_albedo(self.outgoing.z)
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
