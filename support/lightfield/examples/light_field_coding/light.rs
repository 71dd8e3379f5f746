//! Computation of the light that leaves the texels of an object, as 8-bit codes.

use crate::scene::{Object, Point, Scene, Surface};
use glam::Vec3;
use lightfield::{Field, FieldError, Samples, Slot, TILE_SIDE, TILE_SLOTS, TexelTiles};
use rayon::prelude::*;

/// Number of directions per angle: θ from the normal and φ about the normal. Direction (i_θ, i_φ) has the index i_θ +
/// 20 · i_φ.
pub const PLACES: usize = 20;
/// Total number of directions of a texel.
pub const DIRECTIONS: usize = PLACES * PLACES;
/// Number of points along each side of a light's grid.
const POINTS: usize = 8;
/// Number of random light points per direction if the light is noisy.
const PICKS: usize = 16;
/// Radiance of the lights, chosen so that the brightest lobes just saturate.
const EMITTED: f32 = 9.0;

/// Mirrored light of one texel: the directions in the surface frame, and the irradiance from each direction.
#[derive(Default)]
struct Mirrored {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    irradiance: Vec<f32>,
}

/// Returns the directions over the hemisphere about +z.
fn directions() -> Vec<Vec3> {
    let direction = |k: usize| {
        let (theta, phi) = ((k % PLACES) as f32 + 0.5, (k / PLACES) as f32);
        let (sin, cos) = (theta / PLACES as f32 * std::f32::consts::FRAC_PI_2).sin_cos();
        let (y, x) = (phi / PLACES as f32 * std::f32::consts::TAU).sin_cos();
        Vec3::new(sin * x, sin * y, cos)
    };
    (0..DIRECTIONS).map(direction).collect()
}

/// Returns fixed points of a triangle. Each represents an equal fraction of its area.
fn points([a, b, c]: [Vec3; 3]) -> Vec<Vec3> {
    let at = |k: usize| {
        let (u, v) = ((k % POINTS) as f32 + 0.5, (k / POINTS) as f32 + 0.5);
        let (root, v) = ((u / POINTS as f32).sqrt(), v / POINTS as f32);
        a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v)
    };
    (0..POINTS * POINTS).map(at).collect()
}

/// Returns the mirrored light from each light point at a surface point. Occluded light points have zero irradiance.
fn mirrored(scene: &Scene, point: Point) -> Mirrored {
    let mut found = Mirrored::default();
    let bitangent = point.normal.cross(point.tangent);
    for &light in &scene.lights {
        let [a, b, c] = light;
        let area = (b - a).cross(c - a).length() / 2.0;
        for to in points(light) {
            let way = to - point.position;
            let direction = way.normalize();
            let cosines = point.normal.dot(direction).max(0.0) * direction.y.max(0.0);
            let hidden = cosines <= 0.0 || scene.occluders.iter().any(|one| one.hides(point.position, to));
            let share = area / (POINTS * POINTS) as f32;
            found.x.push(-point.tangent.dot(direction));
            found.y.push(-bitangent.dot(direction));
            found.z.push(point.normal.dot(direction));
            found.irradiance.push(if hidden { 0.0 } else { EMITTED * share * cosines / way.length_squared() });
        }
    }
    found
}

/// Returns two sums over all light points: irradiance, and lobe light in a direction.
fn sums(mirrored: &Mirrored, direction: Vec3, surface: Surface) -> [f32; 2] {
    let (mut irradiance, mut lobe) = (0.0, 0.0);
    for k in 0..mirrored.irradiance.len() {
        let cosine = mirrored.x[k] * direction.x + mirrored.y[k] * direction.y + mirrored.z[k] * direction.z;
        let mut power = cosine.max(0.0);
        for _ in 0..surface.shine {
            power *= power;
        }
        irradiance += mirrored.irradiance[k];
        lobe += mirrored.irradiance[k] * power;
    }
    [irradiance, lobe]
}

/// Estimates both sums of [`sums`] from random light points.
fn noisy_sums(mirrored: &Mirrored, direction: Vec3, surface: Surface, seed: u64) -> [f32; 2] {
    let count = mirrored.irradiance.len();
    let (mut picked, mut state) = (Mirrored::default(), seed);
    for _ in 0..PICKS {
        // Random numbers: SplitMix64 by Steele, Lea and Flood.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        let k = (bits >> 33) as usize % count;
        picked.x.push(mirrored.x[k]);
        picked.y.push(mirrored.y[k]);
        picked.z.push(mirrored.z[k]);
        picked.irradiance.push(mirrored.irradiance[k] * count as f32 / PICKS as f32);
    }
    sums(&picked, direction, surface)
}

/// Computes the codes of one texel in all directions. The codes are square roots of light, for displays with gamma 2.
fn shade(scene: &Scene, object: &Object, [x, y]: [usize; 2], noisy: bool, codes: &mut [u8]) {
    let mirrored = mirrored(scene, object.point(x, y));
    let surface = object.surface;
    let exponent = (1 << surface.shine) as f32;
    let [whole, _] = sums(&mirrored, Vec3::Z, Surface { shine: 0, ..surface });
    for (k, direction) in directions().into_iter().enumerate() {
        let [irradiance, lobe] = if noisy {
            noisy_sums(&mirrored, direction, surface, ((y * object.width + x) * DIRECTIONS + k) as u64 * 977)
        } else if surface.specular > 0.0 {
            sums(&mirrored, direction, surface)
        } else {
            [whole, 0.0]
        };
        let specular = surface.specular * (exponent + 2.0) / std::f32::consts::TAU * lobe;
        let light = surface.diffuse * (irradiance / std::f32::consts::PI) + specular;
        for c in 0..3 {
            codes[k * 3 + c] = (light[c].clamp(0.0, 1.0).sqrt() * 255.0).round() as u8;
        }
    }
}

/// Returns the texel (x, y) in a slot, in the picture of an object.
fn texel(object: &Object, Slot(slot): Slot) -> [usize; 2] {
    let (columns, tile, bit) = (object.width.div_ceil(TILE_SIDE), slot / TILE_SLOTS, slot % TILE_SLOTS);
    [tile % columns * TILE_SIDE + bit % TILE_SIDE, tile / columns * TILE_SIDE + bit / TILE_SIDE]
}

/// Returns the slot of a texel (x, y) of an object.
pub fn slot(object: &Object, [x, y]: [usize; 2]) -> Slot {
    Slot::in_picture(object.width, x, y)
}

/// Computes the light field of an object.
pub fn field(scene: &Scene, object: &Object, noisy: bool) -> Result<Field, FieldError> {
    let tiles = TexelTiles::of_picture(object.width, object.height);
    let slots: Vec<Slot> = tiles.slots().collect();
    let mut codes = vec![0; slots.len() * DIRECTIONS * 3];
    let texels = codes.par_chunks_mut(DIRECTIONS * 3).zip(&slots);
    texels.for_each(|(codes, &slot)| shade(scene, object, texel(object, slot), noisy, codes));
    Field::new(tiles, DIRECTIONS, Samples::Bytes(codes))
}
