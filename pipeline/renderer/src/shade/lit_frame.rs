//! Light of a frame, reused while nothing changes.

use super::importance::ImportanceMap;
use super::layer::Lit;
use crate::frame::Frame;
use glam::Vec3;
use lighttree::LightTree;
use perceptual::PixelPart;
use pipeline::parts::Outline;
use plane::Plane;
use render_core::{
    Accelerator, Coverage, DirectLights, FinalGather, GBuffer, MixedPixel, reconstruct, reconstruct_counted,
    sample_offsets,
};
use std::sync::Arc;

/// Light of all pixels through one sample position each, before outlines are blended \[W·m⁻²·sr⁻¹\].
#[derive(serde::Serialize, serde::Deserialize)]
pub(super) struct Sample {
    /// Emitted light, and light reflected directly from its source.
    pub direct: Plane<Vec3>,
    /// All other light.
    pub indirect: Plane<Vec3>,
}

impl Sample {
    /// Returns the sum of direct and indirect light.
    pub fn whole(&self) -> Plane<Vec3> {
        let Self { direct, indirect } = self;
        Plane::from_fn(direct.width(), direct.height(), |x, y| direct.get(x, y) + indirect.get(x, y))
    }
}

/// Stored light of a frame, which a static film continues with.
#[derive(serde::Serialize, serde::Deserialize)]
pub(super) struct StoredLight {
    pub samples: Vec<Sample>,
    /// Surfaces of pixels crossed by outlines, if these are blended.
    pub coverage: Option<Coverage>,
    /// Transparent layers within pixels, for each sample, if every pixel has several samples.
    pub layers: Vec<Coverage>,
    pub cache_records: u64,
    /// Importance map; `None` if all pixels have the same number of samples.
    pub importance: Option<ImportanceMap>,
}

impl StoredLight {
    /// Combines the samples of one kind of light into a frame, with outlines blended by `blend`.
    pub fn picture(
        &self,
        of: impl Fn(&Sample) -> Plane<Vec3>,
        blend: impl Fn(&Coverage, &Plane<Vec3>) -> Plane<Vec3>,
    ) -> Plane<[f32; 3]> {
        // Blend the transparent layers of each sample.
        let triples = |light: Plane<Vec3>| light.map(|rgb| rgb.to_array());
        let mut planes: Vec<Plane<[f32; 3]>> = Vec::new();
        for (index, sample) in self.samples.iter().enumerate() {
            let light = of(sample);
            let layers = self.layers.get(index).filter(|layers| layers.mixed_pixels() > 0);
            planes.push(triples(match layers {
                Some(layers) => blend(layers, &light),
                None => light,
            }));
        }
        let places = sample_offsets(planes.len());

        // Coverage belongs to the first sample, and is used for pixels without further ones.
        let blended = self.coverage.as_ref().map(|coverage| triples(blend(coverage, &of(&self.samples[0]))));
        match (&self.importance, blended) {
            (Some(map), blended) => {
                let alone = blended.as_ref().unwrap_or(&planes[0]);
                reconstruct_counted(alone, &planes, &places, &map.samples)
            }
            (None, Some(blended)) => blended,
            (None, None) => reconstruct(&planes, &places),
        }
    }

    /// Returns the light of all surfaces in pixels crossed by outlines. Displays need it even with further samples, because the
    /// filter would spread bright light over thin objects.
    pub fn outlines(&self) -> Vec<Outline> {
        let Some(coverage) = &self.coverage else { return Vec::new() };
        let light = self.samples[0].whole();
        let of = |pixel: MixedPixel| {
            let mut parts = Vec::new();
            for part in pixel.parts {
                parts.push(PixelPart { share: part.share, radiance: part.radiance(&light).to_array() });
            }
            Outline { pixel: pixel.index, parts }
        };
        // Omit transparent layers: a lamp behind glass outshines the glass.
        coverage.pixels().filter(|pixel| !pixel.is_layered).map(of).collect()
    }
}

/// Pixels with computed light, and pixels with reprojected light.
#[derive(Default)]
pub(super) struct Reused {
    /// Pixels with computed direct and computed indirect light; `None` if a layer has no reprojection.
    computed: [Option<Plane<bool>>; 2],
    /// Number of pixels that reflect light.
    lit: usize,
}

impl Reused {
    /// Collects these pixels from the direct and indirect light of `matte` surfaces.
    pub fn new([direct, indirect]: [&Lit; 2], matte: &GBuffer) -> Self {
        let computed = [direct.computed.clone(), indirect.computed.clone()];
        let lit = if computed.iter().any(Option::is_some) {
            matte.pixels.samples().iter().filter(|pixel| pixel.reflects()).count()
        } else {
            0
        };
        Self { computed, lit }
    }

    /// Returns the fraction of lit pixels with any computed light.
    pub fn shaded_share(&self) -> f64 {
        let [Some(first), others @ ..] = &self.computed else { return 1.0 };
        let mut shaded = 0;
        for (index, &direct) in first.samples().iter().enumerate() {
            let indirect = others[0].as_ref().is_some_and(|computed| computed.samples()[index]);
            shaded += usize::from(direct || indirect);
        }
        shaded as f64 / self.lit.max(1) as f64
    }

    /// Returns the channel [`Aov::Shading`](crate::settings::Aov::Shading) of a frame with the surfaces `seen`.
    pub fn channel(&self, seen: &GBuffer) -> Vec<f32> {
        let [Some(direct), indirect] = &self.computed else { return vec![0.0; seen.pixels.samples().len()] };
        // Without indirect light, only direct light counts.
        let indirect = indirect.as_ref().unwrap_or(direct);
        let mut channel = Vec::new();
        for (index, pixel) in seen.pixels.samples().iter().enumerate() {
            let is_reused = |computed: &Plane<bool>| u8::from(pixel.reflects() && !computed.samples()[index]);
            channel.push(f32::from(is_reused(direct) + 2 * is_reused(indirect)));
        }
        channel
    }
}

/// Light of a frame, and all data that it was computed from.
pub(super) struct LitFrame {
    accelerator: Arc<Accelerator>,
    lights: Arc<DirectLights>,
    tree: Arc<LightTree>,
    gather: Arc<FinalGather>,
    seen: Arc<GBuffer>,
    pub light: StoredLight,
    pub reused: Reused,
}

impl LitFrame {
    /// Creates the light of `frame`.
    pub fn new(frame: &Frame, light: StoredLight, reused: Reused) -> Self {
        let Frame { accelerator, direct, tree, gather, seen, .. } = frame;
        Self {
            accelerator: accelerator.clone(),
            lights: direct.clone(),
            tree: tree.clone(),
            gather: gather.clone(),
            seen: seen.clone(),
            light,
            reused,
        }
    }

    /// Returns whether `frame` shares the same data by pointer; equality is not sufficient.
    pub fn is_of(&self, frame: &Frame) -> bool {
        Arc::ptr_eq(&self.accelerator, &frame.accelerator)
            && Arc::ptr_eq(&self.lights, &frame.direct)
            && Arc::ptr_eq(&self.tree, &frame.tree)
            && Arc::ptr_eq(&self.gather, &frame.gather)
            && Arc::ptr_eq(&self.seen, &frame.seen)
    }
}
