//! Light of a frame, which later frames reuse while nothing changes.

use super::fine::FinePixels;
use super::importance::ImportanceMap;
use super::layer::Lit;
use super::sample::Sample;
use crate::frame::Frame;
use glam::Vec3;
use lighttree::LightTree;
use perceptual::PixelFragment;
use pipeline::stage::Outline;
use plane::Plane;
use render_core::{
    Accelerator, Coverage, DirectLights, FinalGather, GBuffer, reconstruct, reconstruct_counted, sample_offsets,
};
use std::sync::Arc;

/// Stored light of a frame, from which a static film continues.
#[derive(serde::Serialize, serde::Deserialize)]
pub(super) struct StoredLight {
    pub samples: Vec<Sample>,
    /// Pixels with further samples of their own.
    pub fine: Option<FinePixels>,
    /// Surfaces of pixels that outlines cross, if outlines are blended.
    pub coverage: Option<Coverage>,
    /// Transparent layers within pixels, per sample, if every pixel has several samples.
    pub layers: Vec<Coverage>,
    pub cache_records: u64,
    /// Importance map; `None` if all pixels have equally many samples.
    pub importance: Option<ImportanceMap>,
}

impl StoredLight {
    /// Combines one kind of light of all samples into a frame. `blend` blends outlines.
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

        // Blend outlines in pixels with only one sample: coverage belongs to the first sample.
        let blended = self.coverage.as_ref().map(|coverage| triples(blend(coverage, &of(&self.samples[0]))));

        // Average the samples of each pixel; importance varies their number.
        let mut picture = match (&self.importance, blended) {
            (Some(map), blended) => {
                let alone = blended.as_ref().unwrap_or(&planes[0]);
                reconstruct_counted(alone, &planes, &places, &map.samples)
            }
            (None, Some(blended)) => blended,
            (None, None) => reconstruct(&planes, &places),
        };
        if let Some(fine) = &self.fine {
            fine.put(&of, &mut picture);
        }
        picture
    }

    /// Returns the light of all surfaces in pixels that outlines cross. Displays need it even with further samples,
    /// because the filter would spread bright light over thin objects.
    pub fn outlines(&self) -> Vec<Outline> {
        let mut outlines: Vec<Outline> = self.fine.iter().flat_map(FinePixels::outlines).collect();
        let Some(coverage) = &self.coverage else { return outlines };
        let light = self.samples[0].whole();
        for pixel in coverage.pixels() {
            // Omit transparent layers: a lamp behind glass outshines the glass.
            let is_fine = self.fine.as_ref().is_some_and(|fine| fine.contains(pixel.index));
            if pixel.is_layered || is_fine {
                continue;
            }
            let mut parts = Vec::new();
            for part in pixel.parts {
                parts.push(PixelFragment { share: part.share, radiance: part.radiance(&light).to_array() });
            }
            outlines.push(Outline { pixel: pixel.index, parts });
        }
        outlines
    }
}

/// Pixels with computed light, to distinguish them from pixels with reprojected light.
#[derive(Default)]
pub(super) struct Reused {
    /// Whether each pixel's direct light and indirect light were computed; `None` if a layer has no reprojection.
    computed: [Option<Plane<bool>>; 2],
    /// Number of pixels that reflect light.
    lit: usize,
}

impl Reused {
    /// Collects the pixels with computed light from the direct and indirect light of `matte` surfaces.
    pub fn new([direct, indirect]: [&Lit; 2], matte: &GBuffer) -> Self {
        let computed = [direct.computed.clone(), indirect.computed.clone()];
        let lit = if computed.iter().any(Option::is_some) {
            matte.pixels.samples().iter().filter(|pixel| pixel.reflects()).count()
        } else {
            0
        };
        Self { computed, lit }
    }

    /// Returns the fraction of lit pixels for which any light was computed.
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
        // Use only direct light if no layer reprojects indirect light.
        let indirect = indirect.as_ref().unwrap_or(direct);
        let mut channel = Vec::new();
        for (index, pixel) in seen.pixels.samples().iter().enumerate() {
            let is_reused = |computed: &Plane<bool>| u8::from(pixel.reflects() && !computed.samples()[index]);
            channel.push(f32::from(is_reused(direct) + 2 * is_reused(indirect)));
        }
        channel
    }
}

/// Light of a frame, and all data from which it was computed.
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
    /// Creates the stored light of `frame`.
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

    /// Returns whether `frame` shares all data by pointer; equal data is not sufficient.
    pub fn is_of(&self, frame: &Frame) -> bool {
        Arc::ptr_eq(&self.accelerator, &frame.accelerator)
            && Arc::ptr_eq(&self.lights, &frame.direct)
            && Arc::ptr_eq(&self.tree, &frame.tree)
            && Arc::ptr_eq(&self.gather, &frame.gather)
            && Arc::ptr_eq(&self.seen, &frame.seen)
    }
}
