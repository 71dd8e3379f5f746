//! Properties of a frame's pixels, as channels of the frame's OpenEXR file.

use super::importance::ImportanceMap;
use super::layers::Layers;
use super::lit_frame::Reused;
use super::mattes;
use super::tolerance::Tolerance;
use crate::frame::PreparedFrame;
use crate::settings::{Aov, RenderSettings};
use pipeline::stage::Channels;
use plane::Plane;
use render_core::{InstanceShares, NOTHING, PixelSurface, Surfaces};

/// Returns `picture` as the channels R, G and B of the layer `name`.
pub(super) fn colors(name: &str, picture: &Plane<[f32; 3]>) -> Channels {
    triples(name, ["R", "G", "B"], picture.samples().iter().copied())
}

/// Properties of a frame's pixels, except light.
pub(super) struct Known<'a> {
    pub prepared: &'a PreparedFrame<'a>,
    pub tolerance: &'a Tolerance<'a>,
    pub layers: &'a Layers,
    pub reused: &'a Reused,
    pub importance: Option<&'a ImportanceMap>,
    pub settings: &'a RenderSettings,
    /// Coverage of pixels by instance; `None` unless mattes are requested.
    pub shares: Option<&'a InstanceShares>,
}

impl Known<'_> {
    /// Returns the channels of `aov`, evaluated at pixel centers; no channels if `aov` is light.
    pub fn channels(&self, aov: Aov) -> Channels {
        let frame = &self.prepared.frame;
        let pixels = &frame.seen.pixels;
        let (width, height) = (pixels.width(), pixels.height());
        let single = |name: &str, samples: Vec<f32>| vec![(name.to_owned(), samples)];
        let by_place = |of: &dyn Fn(usize, usize) -> f32| {
            let places = 0..width * height;
            places.map(|index| of(index % width, index / width)).collect()
        };
        match aov {
            Aov::Direct | Aov::Indirect => Channels::new(),
            Aov::Albedo => triples("albedo", ["R", "G", "B"], self.surfaces(|pixel| pixel.albedo)),
            Aov::Normal => triples("normal", ["X", "Y", "Z"], self.surfaces(|pixel| pixel.shading_normal)),
            Aov::Depth => single("depth.Z", pixels.samples().iter().map(|pixel| pixel.depth).collect()),
            Aov::Motion => {
                // Mark pixels that were not visible in the previous frame by A = 0.
                let known = self.prepared.correspondence.as_deref();
                let motion = |index: usize| {
                    let motion = known.and_then(|known| known.motion_of(index % width, index / width));
                    motion.map_or([0.0; 3], |[x, y]| [x, y, 1.0])
                };
                triples("motion", ["X", "Y", "A"], (0..width * height).map(motion))
            }
            Aov::Position => triples("position", ["X", "Y", "Z"], self.surfaces(|pixel| pixel.position)),
            Aov::Vector => self.vectors(),
            Aov::CryptoObject | Aov::CryptoMaterial => {
                let mattes = mattes::mattes(aov, frame.surfaces.scene());
                let both = mattes.as_ref().zip(self.shares);
                both.map_or_else(Channels::new, |(mattes, shares)| mattes::channels(mattes, shares))
            }
            // Write 0 for pixels without a threshold, to which the limit of 2 % applies.
            Aov::Threshold => single("threshold.Y", by_place(&|x, y| self.tolerance.threshold(x, y).unwrap_or(0.0))),
            Aov::CutSize => {
                let sizes = self.layers.channel(aov, frame);
                single("cut.size", sizes.unwrap_or_else(|| vec![0.0; width * height]))
            }
            Aov::Importance => {
                let Some(ImportanceMap { importance, samples }) = self.importance else { return Channels::new() };
                let counts = samples.samples().iter().map(|&count| f32::from(count)).collect();
                vec![("importance.V".into(), importance.samples().to_vec()), ("importance.N".into(), counts)]
            }
            Aov::Shading => single("shading.reused", self.reused.channel(&frame.seen)),
            // Write this channel only with a cache.
            Aov::Cache => match self.layers.channel(aov, frame) {
                None => Channels::new(),
                Some(records) => single("cache.records", records),
            },
        }
    }

    /// Returns the motion in pixels, y up, as in Blender's vector pass. Points behind the camera have no motion.
    ///
    /// ```text
    /// (X, Y) = p(n − 1) − p(n)      (Z, W) = p(n) − p(n + 1)      p(n)  position of the point in frame n
    /// ```
    /// The motion is computed from the scene, even if the film lacks the adjacent frames or hides the point in them.
    /// Cycles computes this motion in `primitive_motion_vector`.
    fn vectors(&self) -> Channels {
        let frame = &self.prepared.frame;
        let (seen, scene) = (&frame.seen, frame.surfaces.scene());
        let mut channels = Channels::new();
        for (after, sign, names) in [(-1, 1.0, ["Vector.X", "Vector.Y"]), (1, -1.0, ["Vector.Z", "Vector.W"])] {
            let pose = scene.pose(self.settings.time_beside(frame.index, after));
            let view = scene.view(&pose, seen.pixels.width(), seen.pixels.height());
            let view = view.with_pixel_aspect(self.settings.pixel_aspect);
            let motion = seen.motion_to(&Surfaces::new(scene, &pose), &view);
            for (c, name) in names.into_iter().enumerate() {
                // Reverse the sign for y: rows count from the top, but y points up.
                let sign = if c == 0 { sign } else { -sign };
                let value = |motion: &Option<[f32; 2]>| motion.map_or(0.0, |motion| sign * motion[c]);
                channels.push((name.to_owned(), motion.samples().iter().map(value).collect()));
            }
        }
        channels
    }

    /// Returns a property of each pixel's surface; 0 without a surface.
    fn surfaces(&self, value: fn(&PixelSurface) -> [f32; 3]) -> impl Iterator<Item = [f32; 3]> {
        let pixels = self.prepared.frame.seen.pixels.samples().iter();
        pixels.map(move |pixel| if pixel.instance == NOTHING { [0.0; 3] } else { value(pixel) })
    }
}

fn triples(name: &str, parts: [&str; 3], values: impl Iterator<Item = [f32; 3]>) -> Channels {
    let values: Vec<[f32; 3]> = values.collect();
    let mut channels = Channels::new();
    for (c, part) in parts.into_iter().enumerate() {
        channels.push((format!("{name}.{part}"), values.iter().map(|value| value[c]).collect()));
    }
    channels
}
