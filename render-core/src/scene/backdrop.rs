//! Unlit surfaces around a scene, such as a painted sky, which block distant light.

use super::{PointBox, PunctualKind, Scene};
use glam::Vec3A;

impl Scene {
    /// Returns a note if an unlit surface encloses all other surfaces, and a sun or a sky is outside.
    pub(super) fn backdrop_note(&self) -> Option<String> {
        // Without a distant light, an enclosing surface blocks nothing.
        let has_sun = self.punctual_lights.iter().any(|light| light.kind == PunctualKind::Directional);
        if !has_sun && self.sky.is_none() {
            return None;
        }
        // Bound all lit surfaces together, and each unlit surface alone.
        let pose = self.pose(0.0);
        let (mut lit, mut backdrops) = (PointBox::NOTHING, Vec::new());
        for (index, instance) in self.instances.iter().enumerate() {
            let mesh = &self.meshes[instance.mesh];
            let world = self.instance_world(&pose, index);
            let positions = pose.deformed(index).map_or(&mesh.positions, |shape| &shape.positions);
            let around = PointBox::of(positions.iter().map(|&p| world.transform_point3a(p.into())));
            if self.materials[mesh.material].unlit {
                backdrops.push((around, self.nodes[instance.node].name.as_str()));
            } else {
                lit.add(around.low);
                lit.add(around.high);
            }
        }
        // A backdrop has an extent along all three axes, unlike a flat wall or floor.
        let is_something = lit.low.cmple(lit.high).all();
        let encloses = |around: &PointBox| around.holds(&lit) && (around.high - around.low).cmpgt(Vec3A::ZERO).all();
        let (_, name) = backdrops.into_iter().find(|(around, _)| is_something && encloses(around))?;
        let source = if has_sun { "the sun" } else { "the sky" };
        Some(format!("the unlit surface \"{name}\" encloses the scene and blocks {source} wherever it is closed"))
    }
}
