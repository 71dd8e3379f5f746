//! Units and sizes of lamps, for files that lack them.

use crate::scene::{Instance, LightSettings, Material, Mesh, PunctualKind, Scene};
use glam::Vec3;
use std::f32::consts::PI;

/// Lumens per watt in Blender's exporter, `PBR_WATTS_TO_LUMENS`: the maximum luminous efficacy of light \[lm·W⁻¹\].
const LUMENS_PER_WATT: f32 = 683.0;

/// Returns the factor on candela and lux for files by this `generator`, and a note if the factor is not 1.
///
/// In its default mode, "Standard", Blender's exporter converts the watts of lamps to candela and lux but leaves
/// emission unchanged. Division by the efficacy restores a common unit.
pub(super) fn scale(generator: Option<&str>, settings: LightSettings, has_lamps: bool) -> (f32, Option<String>) {
    let is_blender = generator.is_some_and(|name| name.contains("Blender") && name.contains("glTF"));
    match settings.lamps {
        Some(factor) => (factor, None),
        None if is_blender && has_lamps => (
            1.0 / LUMENS_PER_WATT,
            Some(
                "Blender's lamps, in candela and lux, are divided by 683 to match its emission; --set lamps=1 keeps them"
                    .into(),
            ),
        ),
        None => (1.0, None),
    }
}

/// Converts point lights to emitting spheres of this radius \[m\] and the same intensity. Spot lights are not
/// converted.
pub(super) fn give_radius(scene: &mut Scene, radius: f32) {
    if radius <= 0.0 {
        return;
    }
    let lights = std::mem::take(&mut scene.punctual_lights);
    for (index, light) in lights.into_iter().enumerate() {
        // A sphere's emission cannot be animated.
        let changes = scene.light_channels.iter().any(|channel| channel.light == index);
        if light.kind != PunctualKind::Point || light.color == Vec3::ZERO || changes {
            let place = scene.punctual_lights.len();
            scene.punctual_lights.push(light);
            // Indices only decrease, so an updated channel never matches again.
            for channel in scene.light_channels.iter_mut().filter(|channel| channel.light == index) {
                channel.light = place;
            }
            continue;
        }
        let mut ball = ball(radius);
        // A convex body of area A has the mean cross-section A / 4, so its mean intensity is L · A / 4.
        let mut area = 0.0;
        for triangle in &ball.triangles {
            let [a, b, c] = triangle.map(|vertex| ball.positions[vertex as usize]);
            area += (b - a).cross(c - a).length() / 2.0;
        }
        // Emit the radiance that preserves the intensity.
        ball.material = scene.materials.len();
        scene.materials.push(Material {
            name: "lamp".into(),
            base_color: Vec3::ZERO,
            emission: light.color * 4.0 / area,
            ..Material::default()
        });
        scene.instances.push(Instance { node: light.node, mesh: scene.meshes.len() });
        scene.meshes.push(ball);
    }
    if scene.punctual_lights.iter().any(|light| matches!(light.kind, PunctualKind::Spot { .. })) {
        scene.warnings.push("lamp_radius applies to points only: spots keep their hard shadows".into());
    }
}

/// Builds a sphere around the origin from columns of quads that span from pole to pole.
fn ball(radius: f32) -> Mesh {
    const COLUMNS: u32 = 12;
    const ROWS: u32 = 6;
    let mut mesh = Mesh { name: "lamp".into(), ..Mesh::default() };
    // Compute the vertices row by row, from pole to pole.
    for row in 0..=ROWS {
        let (sin, cos) = (PI * row as f32 / ROWS as f32).sin_cos();
        for column in 0..COLUMNS {
            let (x, z) = (2.0 * PI * column as f32 / COLUMNS as f32).sin_cos();
            mesh.positions.push(radius * Vec3::new(sin * x, cos, sin * z));
        }
    }
    // Split each quad into triangles, except at the poles.
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            let next = (column + 1) % COLUMNS;
            let [a, b] = [column, next].map(|column| row * COLUMNS + column);
            let [c, d] = [a + COLUMNS, b + COLUMNS];
            if row > 0 {
                mesh.triangles.push([a, c, b]);
            }
            if row + 1 < ROWS {
                mesh.triangles.push([b, c, d]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_is_closed_and_faces_outward() {
        let ball = ball(2.0);
        let mut volume = 0.0;
        for triangle in &ball.triangles {
            let [a, b, c] = triangle.map(|vertex| ball.positions[vertex as usize]);
            volume += a.dot(b.cross(c)) / 6.0;
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
        // A sphere of radius 2 has the volume 4/3 π 2³. The faceted sphere has a slightly smaller volume.
        let whole = 4.0 / 3.0 * PI * 8.0;
        assert!((0.85..1.0).contains(&(volume / whole)), "{volume} of {whole}");
    }
}
