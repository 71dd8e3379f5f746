//! Camera of the film's first frame, bounds of the scene, and the sky.

use super::payload::Payload;
use glam::{Vec2, Vec3, vec3};
use lightfield::shared_exponent;
use render_core::Environment;
use render_core::scene::{Pose, Scene};
use serde_json::{Value, json};
use std::f32::consts::{PI, TAU};

/// Longer side of a picture with extreme proportions \[pixels\].
const LONG: usize = 1 << 12;
/// Size of the picture of a sky image \[texels\].
const SKY: [usize; 2] = [1024, 512];

/// Returns the filming camera at time 0: position, axes and field of view.
///
/// ```text
/// tan(v/2) = y              v  vertical field of view      y, x  slopes of the rays at the upper and right borders
/// tan(h/2) = x
/// ```
pub(super) fn camera(scene: &Scene, pose: &Pose) -> Value {
    // A wide picture has the camera's own height, and a narrow one its own width.
    let wide = scene.view(pose, LONG, 1);
    let narrow = scene.view(pose, 1, LONG);
    let (eye, forward) = wide.ray(wide.size() / 2.0);
    let up = {
        let (from, direction) = wide.ray(Vec2::new(LONG as f32 / 2.0, 0.0));
        direction / direction.dot(forward) - forward + (from - eye)
    };
    let half_height = up.length();
    let half_width = {
        let (from, direction) = narrow.ray(Vec2::new(1.0, LONG as f32 / 2.0));
        (direction / direction.dot(forward) - forward + (from - eye)).length()
    };
    let is_parallel = wide.ray(Vec2::ZERO).1 == forward;
    let (nearest, farthest) = wide.distances(forward);
    json!({
        "eye": eye.to_array(),
        "forward": forward.to_array(),
        "up": up.normalize_or_zero().to_array(),
        "halfHeight": half_height,
        "halfWidth": half_width,
        "parallel": is_parallel,
        "near": nearest,
        "far": if farthest.is_finite() { farthest } else { 0.0 },
    })
}

/// Returns the center of the scene, and the radius of a ball around it \[m\].
pub(super) fn bounds(scene: &Scene, pose: &Pose) -> Value {
    let (low, high) = scene.bounds(pose).unwrap_or_default();
    json!({
        "center": (0.5 * (low + high)).to_array(),
        "radius": (0.5 * (high - low).length()).max(1e-3),
        "low": low.to_array(),
        "high": high.to_array(),
    })
}

/// Returns the sky, multiplied by the exposure: the three colors of a gradient, or the size of a picture that is added
/// to the page. Returns `null` without a sky.
pub(super) fn sky(scene: &Scene, exposure: f32, payload: &mut Payload) -> Value {
    let Some(sky) = &scene.sky else { return Value::Null };
    if let Some(colors) = gradient(sky) {
        return json!({ "gradient": colors.map(|color| color * exposure).map(|color| color.to_array()) });
    }
    // Average four directions per texel: rows from straight up to straight down, −z in the middle.
    let [width, height] = SKY;
    let mut bytes = Vec::with_capacity(4 * width * height);
    for k in 0..width * height {
        let mut sum = Vec3::ZERO;
        for (dx, dy) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
            let (x, y) = ((k % width) as f32 + dx, (k / width) as f32 + dy);
            let (sine, cosine) = (y / height as f32 * PI).sin_cos();
            let (east, south) = ((x / width as f32 - 0.5) * TAU).sin_cos();
            sum += sky.radiance(vec3(sine * east, cosine, -sine * south));
        }
        bytes.extend(shared_exponent(sum * (0.25 * exposure)).to_le_bytes());
    }
    payload.add("sky", &bytes, 4);
    json!({ "width": width, "height": height })
}

/// Returns the colors of a gradient at zenith, horizon and ground; `None` for an image.
fn gradient(sky: &Environment) -> Option<[Vec3; 3]> {
    // The first number distinguishes gradients from images.
    let mut numbers: Vec<Vec<f32>> = Vec::new();
    sky.visit_numbers(&mut |found: &[f32]| {
        if numbers.len() < 4 {
            numbers.push(found.to_vec());
        }
    });
    let is_gradient = numbers.first().is_some_and(|first| first == &[0.0]);
    let color = |at: usize| numbers.get(at).filter(|color| color.len() == 3).map(|color| Vec3::from_slice(color));
    is_gradient.then_some([color(1)?, color(2)?, color(3)?])
}
