//! Validation of an atlas read from a file.

use super::{Atlas, ChartTriangle, NONE};
use crate::scene::Scene;

/// Maximum position of a corner in its chart \[texels\].
const FARTHEST: f32 = 16384.0;

impl Atlas {
    /// Returns whether all indices are in range for this scene, so that no sample panics. A file may be malicious.
    ///
    /// The positions of triangles are not compared with the positions computed by [`Atlas::new`].
    #[must_use]
    pub fn validate(&self, scene: &Scene) -> bool {
        let has_density = self.texels_per_meter.is_finite() && self.texels_per_meter > 0.0;
        let has_counts = self.covered as usize <= self.len() && !self.is_empty();
        has_density && has_counts && self.has_sheets_of(scene) && self.has_places() && self.has_owners()
    }

    /// Returns whether the sheets match the scene's static lit surfaces, in order and with all triangles.
    fn has_sheets_of(&self, scene: &Scene) -> bool {
        let (moving, mut next, mut before) = (scene.moving_instances(), 0u32, None);
        for sheet in &self.sheets {
            let Some(instance) = scene.instances.get(sheet.instance as usize) else { return false };
            let mesh = &scene.meshes[instance.mesh];
            let material = &scene.materials[mesh.material];

            // Require order by instance, with each back after its front.
            let front = (sheet.instance, false);
            let follows = if sheet.back { before == Some(front) } else { before < Some(front) };
            // Require a static lit side with all triangles of the mesh, directly after the previous sheet.
            let is_baked =
                !moving[sheet.instance as usize] && !material.unlit && (material.double_sided || !sheet.back);
            if !follows || !is_baked || sheet.first != next || sheet.count as usize != mesh.triangles.len() {
                return false;
            }
            let Some(after) = next.checked_add(sheet.count) else { return false };
            (next, before) = (after, Some((sheet.instance, sheet.back)));
        }
        next as usize == self.triangles.len()
    }

    /// Returns whether charts and positions of triangles are within the atlas.
    fn has_places(&self) -> bool {
        if !self.tiles.is_valid() {
            return false;
        }
        let (width, height) = self.tiles.size();
        let is_within = |&[left, top]: &[u32; 2]| left < width && top < height;
        let is_placed = |placed: &ChartTriangle| {
            let has_chart = placed.chart == NONE || (placed.chart as usize) < self.charts.len();
            has_chart && placed.corners.as_flattened().iter().all(|place| (0.0..FARTHEST).contains(place))
        };
        self.charts.iter().all(is_within) && self.triangles.iter().all(is_placed)
    }

    /// Returns whether each texel in use has a triangle with a chart.
    fn has_owners(&self) -> bool {
        let is_triangle = |&owner: &u32| self.triangles.get(owner as usize).is_some_and(|placed| placed.chart != NONE);
        self.tiles.texels() == self.len() && self.owners.iter().all(is_triangle)
    }
}
