//! The paper's estimate of a lightcut: M · G · V of each representative times its cluster's intensity. The clusters can
//! be kept and summed again with other intensities.

use glam::{Vec3, Vec4};

use super::{Cluster, KeptCluster, Lightcut, Scratch};
use crate::lanes::Vector3;
use crate::light::{Light, unshadowed};
use crate::receiver::Receiver;
use crate::tree::LightTree;

/// Shadow ray between the receiver and a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShadowRay {
    /// Index of the light.
    pub light: u32,
    /// Whether the light is visible. It is false before the ray is traced.
    pub visible: bool,
}

impl LightTree {
    /// Sums the estimates of the nodes in `scratch.selected`, traces all shadow rays together, and stores the clusters
    /// in the scratch.
    #[inline(always)]
    pub(super) fn evaluate<R: Receiver>(
        &self,
        receiver: &R,
        mut visible: impl FnMut(&Light, usize) -> bool,
        scratch: &mut Scratch,
        mut cut: Lightcut,
    ) -> Lightcut {
        scratch.begin_estimate();
        self.estimate_selected(receiver, scratch);
        let Scratch { rays, ray_count, terms, kept, .. } = scratch;
        let rays = &mut rays[..*ray_count];
        for ray in &mut *rays {
            ray.visible = visible(&self.lights[ray.light as usize], ray.light as usize);
        }
        // Scale M · G of a visible representative by the intensity of the whole cluster.
        for (ray, &(unit, node)) in rays.iter().zip(&*terms) {
            let unit = if ray.visible { unit.truncate() } else { Vec3::ZERO };
            cut.radiance += unit * self.nodes[node as usize].intensity;
            kept.push(KeptCluster { cluster: Cluster { node, light: ray.light }, transport: unit });
        }
        cut.shadow_rays = rays.len() as u32;
        cut
    }

    /// Computes M · G of the representatives of the nodes in `scratch.selected`, four at a time. Representatives that
    /// contribute are appended to `rays` and `terms`. Clusters with a dark representative are appended directly to
    /// `kept`.
    #[inline(always)]
    fn estimate_selected<R: Receiver>(&self, receiver: &R, scratch: &mut Scratch) {
        let Scratch { selected, selected_count, rays, ray_count, terms, kept, .. } = scratch;
        let mut own = 0;
        let (position, geometry_term_bound) =
            (Vector3::splat(receiver.position()), Vec4::splat(self.geometry_term_bound));
        for four in selected[..*selected_count].chunks(4) {
            // Repeat the last node to fill four lanes.
            let nodes: [u32; 4] = std::array::from_fn(|k| four[k.min(four.len() - 1)]);
            let lights = nodes.map(|index| self.nodes[index as usize].representative);
            let sites = self.sites.four(nodes.map(|node| node as usize));
            let units = unshadowed(receiver, position, &sites, geometry_term_bound);
            for ((&node, &light), unit) in four.iter().zip(&lights).zip(units.rows()) {
                // Write the entry first, and advance past it only if it contributes.
                rays[*ray_count] = ShadowRay { light, visible: false };
                terms[own] = (unit, node);
                let lit = unit.w > 0.0;
                *ray_count += usize::from(lit);
                own += usize::from(lit);
                if !lit {
                    kept.push(KeptCluster { cluster: Cluster { node, light }, transport: Vec3::ZERO });
                }
            }
        }
    }
}

impl Scratch {
    /// Clears the estimate and reserves room for the largest lightcut.
    pub(super) fn begin_estimate(&mut self) {
        let room = self.max_size as usize + 8;
        self.ray_count = 0;
        self.rays.resize(self.rays.len().max(room), ShadowRay { light: 0, visible: false });
        self.radiance.resize(self.radiance.len().max(room), Vec4::ZERO);
        self.terms.resize(self.terms.len().max(room), (Vec4::ZERO, 0));
    }
}
