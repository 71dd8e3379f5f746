//! Visible surface of each pixel, and the position of that surface in another frame.

mod coverage;
mod layers;
mod outline;
mod shares;
mod shown;
mod through;
mod vectors;

use crate::accel::{Hit, PACKET};
use crate::ranks::{Ranks, in_order, portable, share_each};
use crate::scene::{DeformedMesh, View};
use crate::surface::Interaction;
use crate::{Busy, PosedScene, Surfaces, Timed};
use glam::{Affine3A, Vec2, Vec3, Vec3A};
use layers::{Layer, Shown, center};
use plane::{Correspondence, NO_MATCH, Plane};
use rayon::prelude::*;
use std::sync::Arc;
use through::behind_panes;

pub use coverage::{Coverage, MixedPixel, SurfaceFragment};
pub use layers::LayeredPixel;
pub use shares::{InstanceShare, InstanceShares};
pub use through::SeenThrough;

/// Side of the tiles in which rays are traced \[pixels\]: an MPEG-2 macroblock.
pub const MACROBLOCK: usize = 16;

/// Value of [`PixelSurface::instance`] for a pixel without a surface.
pub const NOTHING: u32 = u32::MAX;

/// First surface that a pixel sees. Vectors are stored as arrays of three numbers, without padding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelSurface {
    /// Position in world space \[m\]; without a surface, the unit direction of the ray.
    pub position: [f32; 3],
    /// Geometric normal of the triangle, on the viewer's side, a unit vector.
    pub geometric_normal: [f32; 3],
    /// Shading normal, a unit vector.
    pub shading_normal: [f32; 3],
    /// Linear RGB reflectance of the diffuse base.
    pub albedo: [f32; 3],
    /// Linear RGB reflectance of the GGX coat at normal incidence; zero for a Lambert surface.
    pub specular: [f32; 3],
    /// Perceptual roughness of the coat.
    pub roughness: f32,
    /// Radiance independent of lighting \[W·m⁻²·sr⁻¹\]: emission, unlit color, or the sky.
    pub emission: [f32; 3],
    /// Depth along the camera's axis \[m\], infinite without a surface.
    pub depth: f32,
    /// Index into the scene's instances, or [`NOTHING`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
}

impl PixelSurface {
    /// Black background without a direction.
    pub const EMPTY: Self = Self {
        position: [0.0; 3],
        geometric_normal: [0.0; 3],
        shading_normal: [0.0; 3],
        albedo: [0.0; 3],
        specular: [0.0; 3],
        roughness: 1.0,
        emission: [0.0; 3],
        depth: f32::INFINITY,
        instance: NOTHING,
        triangle: 0,
    };

    /// Returns whether two pixels show the same surface. Emissive and dark regions of a mesh are different surfaces.
    #[must_use]
    pub fn shows_same(&self, other: &Self) -> bool {
        coverage::shows(other, self)
    }

    /// Returns whether the diffuse base reflects light.
    #[must_use]
    pub fn reflects(&self) -> bool {
        self.instance != NOTHING && self.albedo != [0.0; 3]
    }
}

/// Ray from the camera.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CameraRay {
    pub origin: Vec3A,
    /// Direction of the ray, a unit vector.
    pub direction: Vec3A,
}

impl CameraRay {
    /// Returns the ray through a position in the picture \[pixels\].
    fn through(place: Vec2, view: &View) -> Self {
        let (origin, direction) = view.ray(place);
        Self { origin, direction }
    }
}

/// Position and width of a ray sample, the same for every pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelSample {
    /// Position of the ray in the pixel, measured from the upper left corner. Each coordinate is in 0…1.
    pub offset: Vec2,
    /// Width of the region that the sample represents \[pixels\]. Textures are filtered over this width.
    pub width: f32,
}

impl PixelSample {
    /// Single sample of a pixel, through its center.
    pub const WHOLE: Self = Self { offset: Vec2::splat(0.5), width: 1.0 };

    /// Returns one of `count` samples of a pixel, at `offset`.
    #[must_use]
    pub fn one_of(count: usize, offset: Vec2) -> Self {
        Self { offset, width: (count.max(1) as f32).sqrt().recip() }
    }
}

/// First hits of all pixels of a picture.
#[derive(Clone, Debug)]
pub struct GBuffer {
    /// Surface of each pixel.
    pub pixels: Plane<PixelSurface>,
    /// View of the picture.
    pub view: View,
    /// World transform of each instance.
    pub world: Vec<Affine3A>,
    /// Deformed mesh of each instance with a skin or morph targets. Empty if no instance is deformed.
    pub deformed: Vec<Option<Arc<DeformedMesh>>>,
    /// Pixels with several layers at their centers, in raster order.
    pub layered: Arc<[LayeredPixel]>,
    /// Surfaces seen through panes, in raster order.
    pub through: Arc<[SeenThrough]>,
}

impl GBuffer {
    /// Traces a ray through the center of every pixel of a picture of `size` = (width, height) \[pixels\].
    pub fn trace(scene: PosedScene, view: &View, size: (usize, usize)) -> Timed<Self> {
        Self::trace_at(PixelSample::WHOLE, scene, view, size)
    }

    /// Traces a ray through this sample of every pixel of a picture of `size` = (width, height) \[pixels\].
    pub fn trace_at(sample: PixelSample, scene: PosedScene, view: &View, size: (usize, usize)) -> Timed<Self> {
        let (shown, mut pixels) = (Shown::new(scene), Plane::filled(size.0, size.1, PixelSurface::EMPTY));
        let camera = Camera { shown: &shown, view, sample, wanted: None };
        let traced = Timed::of(|busy| camera.trace(&mut pixels, busy));
        traced.map(|further| further.of(Self::placed(pixels, scene.surfaces, view)))
    }

    /// Traces a ray through this sample of each `wanted` pixel. All other pixels are empty.
    pub fn trace_wanted(sample: PixelSample, scene: PosedScene, view: &View, wanted: &Plane<bool>) -> Timed<Self> {
        let mut pixels = Plane::filled(wanted.width(), wanted.height(), PixelSurface::EMPTY);
        let camera = Camera { shown: &Shown::new(scene), view, sample, wanted: Some(wanted) };
        let traced = Timed::of(|busy| camera.trace(&mut pixels, busy));
        traced.map(|further| further.of(Self::placed(pixels, scene.surfaces, view)))
    }

    /// Traces rays as [`trace_at`](Self::trace_at) does, with macroblocks shared among `ranks`. All ranks receive the
    /// whole G-buffer.
    pub fn trace_among(
        sample: PixelSample,
        scene: PosedScene,
        view: &View,
        (width, height): (usize, usize),
        ranks: &dyn Ranks,
    ) -> Timed<Self> {
        // Without other ranks, trace the rays into the plane directly.
        if ranks.count() == 1 && ranks.log().is_none() {
            return Self::trace_at(sample, scene, view, (width, height));
        }
        let shown = Shown::new(scene);
        let camera = Camera { shown: &shown, view, sample, wanted: None };
        let across = width.div_ceil(MACROBLOCK).max(1);
        let corner = |block: usize| (block % across * MACROBLOCK, block / across * MACROBLOCK);
        let blocks = in_order(across * height.div_ceil(MACROBLOCK));
        let trace = |(): &mut (), block: usize| camera.macroblock(corner(block), (width, height));
        let traced = share_each(ranks, &blocks, 1, || (), trace);

        // Assemble the macroblocks of all ranks.
        let mut pixels = Plane::filled(width, height, PixelSurface::EMPTY);
        let mut further = Further::default();
        for (block, traced) in traced.value.into_iter().enumerate() {
            let (left, top) = corner(block);
            let columns = MACROBLOCK.min(width - left);
            for (row, surfaces) in traced.pixels.chunks(columns).enumerate() {
                let begin = (top + row) * width + left;
                pixels.samples_mut()[begin..begin + columns].copy_from_slice(surfaces);
            }
            further.add(traced.further);
        }
        let value = further.of(Self::placed(pixels, scene.surfaces, view));
        Timed { value, seconds: traced.seconds }
    }

    /// Builds a G-buffer of `pixels` with the current transforms of `surfaces`.
    fn placed(pixels: Plane<PixelSurface>, surfaces: &Surfaces, view: &View) -> Self {
        let world = (0..surfaces.scene().instances.len()).map(|instance| *surfaces.world(instance)).collect();
        let (layered, through, deformed) = (Arc::default(), Arc::default(), surfaces.all_deformed().to_vec());
        Self { pixels, view: *view, world, deformed, layered, through }
    }
}

impl GBuffer {
    /// Returns the world-space corners of the triangle that `pixel` sees, or `None` if the mesh is not deformed.
    fn bent_corners(&self, pixel: &PixelSurface) -> Option<[Vec3A; 3]> {
        let instance = pixel.instance as usize;
        let bent = self.deformed.get(instance)?.as_ref()?;
        Some(bent.corners(pixel.triangle as usize).map(|corner| self.world[instance].transform_point3a(corner.into())))
    }

    /// Returns the position and normal in `other` of the surface point that `pixel` sees, or `None` if the mesh is not
    /// deformed.
    fn bent_to(&self, pixel: &PixelSurface, other: &GBuffer) -> Option<(Vec3A, Vec3A)> {
        let [a, b, c] = self.bent_corners(pixel)?;
        // Locate the point in the triangle of this frame.
        let area = (b - a).cross(c - a);
        let at = Vec3A::from(pixel.position) - a;
        // Barycentric weights are fractions of the triangle's area, measured along its normal.
        let whole = area.length_squared();
        let (u, v) = (at.cross(c - a).dot(area) / whole, (b - a).cross(at).dot(area) / whole);

        // Place it at the same weights in the other frame's triangle.
        let [p, q, r] = other.bent_corners(pixel)?;
        let turned = (q - p).cross(r - p).normalize_or_zero();
        let side = area.dot(pixel.geometric_normal.into()).signum();
        Some((p + (q - p) * u + (r - p) * v, turned * side))
    }
}

/// Upper left corners of a macroblock's packets, relative to the macroblock \[pixels\].
const PACKET_CORNERS: [(usize, usize); 4] = [(0, 0), (PACKET_SIDE, 0), (0, PACKET_SIDE), (PACKET_SIDE, PACKET_SIDE)];
/// Side of a packet \[pixels\].
const PACKET_SIDE: usize = 8;
const _: () = assert!(PACKET_SIDE * PACKET_SIDE == PACKET && 2 * PACKET_SIDE == MACROBLOCK);

/// Returns the pixels of a packet, in groups of eight neighbors: four columns, two rows.
fn packet_places() -> impl Iterator<Item = (usize, usize)> {
    (0..PACKET).map(|i| (i / 8 % 2 * 4 + i % 4, i / 16 * 2 + i / 4 % 2))
}

#[rustfmt::skip]
portable!(PixelSurface {
    position, geometric_normal, shading_normal, albedo, specular, roughness, emission, depth, instance, triangle,
});

/// Traced pixels of a macroblock.
struct MacroblockSurfaces {
    /// Surfaces of the pixels, by rows.
    pixels: Vec<PixelSurface>,
    further: Further,
}

/// Further surfaces of some pixels.
#[derive(Default)]
struct Further {
    /// Pixels with several layers.
    layered: Vec<LayeredPixel>,
    /// Surfaces seen through panes.
    through: Vec<SeenThrough>,
}

portable!(MacroblockSurfaces { pixels, further });
portable!(Further { layered, through });

impl Further {
    fn add(&mut self, other: Self) {
        self.layered.extend(other.layered);
        self.through.extend(other.through);
    }

    /// Adds the surfaces to a G-buffer. Sorts them, because packets are not in raster order, which binary search
    /// requires.
    fn of(mut self, seen: GBuffer) -> GBuffer {
        self.layered.sort_unstable_by_key(|pixel| pixel.index);
        self.through.sort_unstable_by_key(|pixel| pixel.index);
        GBuffer { layered: self.layered.into(), through: self.through.into(), ..seen }
    }
}

/// Surfaces of a traced pixel.
struct TracedPixel {
    surface: PixelSurface,
    layers: Vec<Layer>,
    /// Surface behind panes.
    through: Option<PixelSurface>,
}

/// Camera that traces one sample of each pixel of a picture.
struct Camera<'a> {
    shown: &'a Shown<'a>,
    view: &'a View,
    sample: PixelSample,
    /// Pixels to trace; `None` for all.
    wanted: Option<&'a Plane<bool>>,
}

impl Camera<'_> {
    /// Traces all `pixels` of a picture. Returns their further surfaces.
    fn trace(&self, pixels: &mut Plane<PixelSurface>, busy: &Busy) -> Further {
        let width = pixels.width();
        let strips = pixels.samples_mut().par_chunks_mut(MACROBLOCK * width).enumerate();
        let of_strips: Vec<Further> =
            strips.map(|(tile_row, strip)| busy.measure(|| self.strip(tile_row * MACROBLOCK, width, strip))).collect();
        let mut further = Further::default();
        of_strips.into_iter().for_each(|of_strip| further.add(of_strip));
        further
    }

    /// Traces a row of macroblocks, starting at line `top`, into `strip`. Returns the row's further surfaces.
    fn strip(&self, top: usize, width: usize, strip: &mut [PixelSurface]) -> Further {
        // Trace one macroblock after the other.
        let rows = strip.len() / width;
        let mut further = Further::default();
        for left in (0..width).step_by(MACROBLOCK) {
            let traced = self.macroblock((left, top), (width, top + rows));
            let columns = MACROBLOCK.min(width - left);
            for (row, surfaces) in traced.pixels.chunks(columns).enumerate() {
                strip[row * width + left..][..columns].copy_from_slice(surfaces);
            }
            further.add(traced.further);
        }
        further
    }

    /// Traces the pixels of the macroblock with this upper left corner, in a picture of this size.
    fn macroblock(&self, (left, top): (usize, usize), (width, height): (usize, usize)) -> MacroblockSurfaces {
        // Trace four packets. Packets at the border of the picture are smaller.
        let (columns, rows) = (MACROBLOCK.min(width - left), MACROBLOCK.min(height - top));
        let (mut pixels, mut further) = (vec![PixelSurface::EMPTY; columns * rows], Further::default());
        for (x0, y0) in PACKET_CORNERS {
            let places = packet_places().map(|(x, y)| (x0 + x, y0 + y)).filter(|&(x, y)| x < columns && y < rows);
            let places = places.map(|(x, y)| (left + x, top + y));
            let wanted = places.filter(|&(x, y)| self.wanted.is_none_or(|wanted| wanted.get(x, y)));
            self.see_together(wanted, |(x, y), traced| {
                let index = (y * width + x) as u32;
                pixels[(y - top) * columns + x - left] = traced.surface;
                if traced.layers.len() > 1 {
                    further.layered.push(LayeredPixel { index, layers: traced.layers });
                }
                further.through.extend(traced.through.map(|surface| SeenThrough { index, surface }));
            });
        }
        MacroblockSurfaces { pixels, further }
    }

    /// Traces the rays of a packet's pixels together.
    fn see_together(
        &self,
        places: impl Iterator<Item = (usize, usize)>,
        mut set: impl FnMut((usize, usize), TracedPixel),
    ) {
        let Self { shown, view, sample, .. } = *self;
        let (mut pixels, mut rays, mut count) = ([(0, 0); PACKET], [CameraRay::default(); PACKET], 0);
        for (x, y) in places {
            pixels[count] = (x, y);
            rays[count] = CameraRay::through(Vec2::new(x as f32, y as f32) + sample.offset, view);
            count += 1;
        }

        // Trace the rays as a packet, then evaluate the hits.
        let solid = shown.solid();
        let hits = first_hits(solid, &rays[..count], view);
        for i in 0..count {
            // If a ray has layers, one of them is the pixel's surface.
            let layers = shown.layers(rays[i], hits[i], view, sample.width);
            let (x, y) = pixels[i];
            let hit = if layers.is_empty() { hits[i] } else { center(&layers, x, y, sample) };
            let surface = see(hit, rays[i], solid, &|depth| sample.width * view.pixel_width(depth), view);

            // Find the surface behind panes.
            let is_met = shown.has_panes() && surface.instance != NOTHING;
            let behind = if is_met { behind_panes(&surface, rays[i], solid) } else { None };
            let through = behind.map(|(ray, hit)| {
                let hit = hit.and_then(|hit| ray.shown(solid, hit, |_| 0.0));
                surface_of(hit, ray, solid, view)
            });
            set(pixels[i], TracedPixel { surface, layers, through });
        }
    }
}

/// Returns the first hit of each ray, for at most [`PACKET`] rays.
fn first_hits(scene: PosedScene, rays: &[CameraRay], view: &View) -> [Option<Hit>; PACKET] {
    let mut hits = [None; PACKET];
    let Some(&CameraRay { origin, .. }) = rays.first() else { return hits };
    // Trace the rays of a perspective camera as one packet, because they share an origin.
    if rays.iter().all(|other| other.origin == origin) {
        let mut directions = [Vec3A::ZERO; PACKET];
        directions.iter_mut().zip(rays).for_each(|(direction, ray)| *direction = ray.direction);
        scene.accelerator.closest_packet(origin, &directions[..rays.len()], &mut hits[..rays.len()]);
    } else {
        // Trace the parallel rays of an orthographic camera one by one.
        hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = scene.accelerator.closest(ray.origin, ray.direction));
    }
    // Apply the depth range of the view.
    for (hit, ray) in hits.iter_mut().zip(rays) {
        let closest = |origin| scene.accelerator.closest(origin, ray.direction);
        let (near, far) = view.distances(ray.direction);
        *hit = ray.cut(near, far, *hit, closest);
    }
    hits
}

/// Returns the surface that a ray shows. Textures are filtered over the ray's cone, which is `width(depth)` meters
/// wide.
fn see(hit: Option<Hit>, ray: CameraRay, scene: PosedScene, width: &dyn Fn(f32) -> f32, view: &View) -> PixelSurface {
    // Filter textures over the cone at the depth of the hit.
    let width = |hit: &Hit| width(depth(hit, ray, view));
    let shown = hit.and_then(|hit| ray.shown_within(view.distances(ray.direction), scene, hit, width));
    surface_of(shown, ray, scene, view)
}

/// Returns the depth of a ray's hit along the camera's axis \[m\].
fn depth(hit: &Hit, CameraRay { origin, direction }: CameraRay, view: &View) -> f32 {
    view.project(origin + direction * hit.distance).map_or(hit.distance, |seen| seen.depth)
}

/// Returns the surface of the visible hit of a ray, or the sky.
fn surface_of(shown: Option<(Hit, Interaction)>, ray: CameraRay, scene: PosedScene, view: &View) -> PixelSurface {
    // Return the sky if no surface is visible. Its position is a direction.
    let Some((hit, surface)) = shown.map(|(hit, point)| (hit, point.surface())) else {
        let direction = Vec3::from(ray.direction);
        let sky = scene.surfaces.scene().background(direction);
        return PixelSurface { position: direction.into(), emission: sky.into(), ..PixelSurface::EMPTY };
    };
    PixelSurface {
        position: surface.position.into(),
        geometric_normal: surface.geometric_normal.into(),
        shading_normal: surface.shading_normal.into(),
        albedo: (surface.albedo * scene.surfaces.scene().camera_gain(hit.instance)).into(),
        specular: surface.specular.into(),
        roughness: surface.roughness,
        emission: surface.emission.into(),
        depth: depth(&hit, ray, view),
        instance: hit.instance,
        triangle: hit.triangle,
    }
}

/// Minimum cosine between two similar normals: 25°, as on a curved surface within a few pixels.
const ALIKE_COSINE: f32 = 0.9;
/// Maximum distance of a point from the plane of the same surface, relative to depth.
const ALIKE_DEPTH: f32 = 0.005;

impl GBuffer {
    /// Reprojects each pixel's surface point to `other`, with the transform of the instance, or with the triangle if
    /// the mesh is deformed. A pixel of a clear pane has the motion of the surface behind the pane.
    pub fn reproject(&self, other: &GBuffer) -> Timed<Correspondence> {
        Timed::of(|busy| self.reprojected(other, busy))
    }

    fn reprojected(&self, other: &GBuffer, busy: &Busy) -> Correspondence {
        // Start without motion and matches, which pixels keep if their surface is not visible in `other`.
        let (width, height) = (self.pixels.width(), self.pixels.height());
        // Compute the motion of each instance once, then locate the pixels row by row.
        let carry = self.carry_to(other);
        let mut motion = Plane::filled(width, height, [0.0; 2]);
        let mut matches = Plane::filled(width, height, NO_MATCH);
        let row_pixels = width.max(1);
        let rows =
            motion.samples_mut().par_chunks_mut(row_pixels).zip(matches.samples_mut().par_chunks_mut(row_pixels));
        rows.enumerate().for_each(|(y, (motion, matches))| {
            busy.measure(|| {
                for x in 0..width {
                    if let Some((place, index)) = locate(self.moving(y * width + x), self, &carry, other) {
                        let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                        motion[x] = (place - center).to_array();
                        matches[x] = index;
                    }
                }
            });
        });
        Correspondence::new(motion, matches).expect("both planes have the size of the picture")
    }

    /// Returns the world transform from this frame to `other` for each instance, which is the identity for static
    /// instances.
    fn carry_to(&self, other: &GBuffer) -> Vec<Affine3A> {
        let pairs = self.world.iter().zip(&other.world);
        pairs.map(|(now, then)| if now == then { Affine3A::IDENTITY } else { *then * now.inverse() }).collect()
    }
}

/// Surface point reprojected to another picture.
struct Moved {
    /// Position in the other picture \[pixels\].
    place: Vec2,
    /// Position in world space \[m\], zero for the sky.
    point: Vec3A,
    /// Normal, a unit vector; zero for the sky.
    normal: Vec3A,
}

/// Reprojects the surface point of a pixel to `other`. Returns `None` if the point is behind the other camera.
fn moved(pixel: &PixelSurface, current: &GBuffer, carry: &[Affine3A], other: &GBuffer) -> Option<Moved> {
    if pixel.instance == NOTHING {
        // The sky is infinitely distant, so only the rotation of the camera moves it.
        let place = other.view.project_direction(pixel.position.into())?;
        return Some(Moved { place, point: Vec3A::ZERO, normal: Vec3A::ZERO });
    }
    // Follow the triangle of a deformed mesh, otherwise the transform of the instance.
    let (point, normal) = current.bent_to(pixel, other).unwrap_or_else(|| {
        let then = &carry[pixel.instance as usize];
        let normal = then.transform_vector3a(pixel.geometric_normal.into()).normalize_or_zero();
        (then.transform_point3a(pixel.position.into()), normal)
    });
    Some(Moved { place: other.view.project(point)?.pixel, point, normal })
}

/// Returns the position of a surface point in `other`, and the nearest of the four surrounding pixels that shows the
/// same surface.
fn locate(pixel: PixelSurface, current: &GBuffer, carry: &[Affine3A], other: &GBuffer) -> Option<(Vec2, u32)> {
    let sky = pixel.instance == NOTHING;
    let Moved { place, point, normal } = moved(&pixel, current, carry, other)?;
    // Choose the nearest of the four pixel centers around the position that shows the same surface.
    let corner = place - 0.5;
    let (left, top) = (corner.x.floor(), corner.y.floor());
    let mut best: Option<(f32, u32)> = None;
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let (x, y) = (left + dx, top + dy);
        if x < 0.0 || y < 0.0 || x >= other.pixels.width() as f32 || y >= other.pixels.height() as f32 {
            continue;
        }
        let index = y as usize * other.pixels.width() + x as usize;
        let candidate = other.moving(index);
        // Sky matches sky; surfaces must agree in position and normal.
        let alike = if sky {
            candidate.instance == NOTHING
        } else {
            is_same_surface(&candidate, pixel.instance, point, normal)
        };
        let distance = (corner - Vec2::new(x, y)).length_squared();
        if alike && best.is_none_or(|(nearest, _)| distance < nearest) {
            best = Some((distance, index as u32));
        }
    }
    best.map(|(_, index)| (place, index))
}

/// Returns whether `candidate` shows the surface of `instance` at a `point` with the unit `normal`.
fn is_same_surface(candidate: &PixelSurface, instance: u32, point: Vec3A, normal: Vec3A) -> bool {
    candidate.instance == instance && {
        let apart = normal.dot(Vec3A::from(candidate.position) - point).abs();
        apart <= ALIKE_DEPTH * candidate.depth && normal.dot(candidate.geometric_normal.into()) >= ALIKE_COSINE
    }
}
