//! Other properties of the pixels of a frame, as channels of its OpenEXR file.

use super::cache::Cache;
use super::carry::Carry;
use super::cuts::Figures;
use crate::parts::Layers;
use crate::renderer::frame::{Frame, PreparedFrame};
use crate::settings::Aov;
use perceptual::ThresholdMap;
use plane::Plane;
use render_core::scene::Projected;
use render_core::{NOTHING, PixelSurface};

/// The channels R, G and B of layer `name`.
pub(super) fn colors(name: &str, picture: &Plane<[f32; 3]>) -> Layers {
    triples(name, ["R", "G", "B"], picture.samples().iter().copied())
}

/// Everything else that is known of a frame.
pub(super) struct Known<'a> {
    pub prepared: &'a PreparedFrame<'a>,
    pub map: &'a ThresholdMap,
    pub counts: &'a Figures,
    pub cache: Option<&'a Cache>,
    pub carry: Option<&'a Carry>,
}

impl Known<'_> {
    /// The channels of everything but light. They belong to the center of each pixel.
    pub fn layers(&self, aov: Aov) -> Layers {
        let &Self { prepared, map, counts, cache, carry } = self;
        let frame = &prepared.frame;
        let pixels = &frame.seen.pixels;
        let (width, height) = (pixels.width(), pixels.height());
        let single = |name: &str, samples: Vec<f32>| vec![(name.to_owned(), samples)];
        let surface = |value: fn(&PixelSurface) -> [f32; 3]| {
            pixels.samples().iter().map(move |pixel| if pixel.instance == NOTHING { [0.0; 3] } else { value(pixel) })
        };
        match aov {
            Aov::Direct | Aov::Indirect => Layers::new(),
            Aov::Albedo => triples("albedo", ["R", "G", "B"], surface(|pixel| pixel.albedo)),
            Aov::Normal => triples("normal", ["X", "Y", "Z"], surface(|pixel| pixel.shading_normal)),
            Aov::Depth => single("depth.Z", pixels.samples().iter().map(|pixel| pixel.depth).collect()),
            Aov::Motion => {
                let known = prepared.correspondence.as_deref();
                let motion = |index: usize| {
                    let motion = known.and_then(|known| known.motion_of(index % width, index / width));
                    motion.map_or([0.0; 3], |[x, y]| [x, y, 1.0])
                };
                triples("motion", ["X", "Y", "A"], (0..width * height).map(motion))
            }
            Aov::Threshold => {
                // Nothing where a pixel has no threshold of its own and 2 % of its luminance hold.
                let at = |index: usize| map.get(index % width, index / width).unwrap_or(0.0);
                single("threshold.Y", (0..width * height).map(at).collect())
            }
            Aov::CutSize => match cache {
                None => single("cut.size", counts.sizes_by_pixel().map(|size| size as f32).collect()),
                Some(cache) => single("cut.size", at_records(frame, cache, |cell, size| *cell = cell.max(size as f32))),
            },
            Aov::Shading => {
                let nothing = || vec![0.0; width * height];
                single("shading.reused", carry.map_or_else(nothing, |carry| carry.reused(&frame.seen)))
            }
            Aov::Cache => match cache {
                None => Layers::new(),
                Some(cache) => single("cache.records", at_records(frame, cache, |cell, _| *cell += 1.0)),
            },
        }
    }
}

/// A picture that `mark` changes at the pixel of each record in use, given the size of the record's cut.
fn at_records(frame: &Frame, cache: &Cache, mark: impl Fn(&mut f32, usize)) -> Vec<f32> {
    let (width, height) = (frame.seen.pixels.width(), frame.seen.pixels.height());
    let mut picture = vec![0.0; width * height];
    for (position, size) in cache.records() {
        let Some(Projected { pixel: place, .. }) = frame.seen.view.project(position) else { continue };
        if place.min_element() >= 0.0 && place.x < width as f32 && place.y < height as f32 {
            mark(&mut picture[place.y as usize * width + place.x as usize], size);
        }
    }
    picture
}

fn triples(layer: &str, names: [&str; 3], values: impl Iterator<Item = [f32; 3]>) -> Layers {
    let values: Vec<[f32; 3]> = values.collect();
    let channel = |(c, name): (usize, &str)| (format!("{layer}.{name}"), values.iter().map(|value| value[c]).collect());
    names.into_iter().enumerate().map(channel).collect()
}
