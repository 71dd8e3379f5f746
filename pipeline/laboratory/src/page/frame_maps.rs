//! Maps of one frame: thresholds, cut sizes and reused light.

use super::pictures::{factor, png, shrunk};
use super::scale::{CUT_SIZE, THRESHOLD, css_color, gradient};
use crate::false_color::false_color;
use minijinja::{Value, context};
use perceptual::luminance;
use pipeline::stage::Shaded;
use plane::Plane;
use renderer::settings::Aov;

/// Channels from which the maps are made.
pub const WATCHED: [Aov; 3] = [Aov::Threshold, Aov::CutSize, Aov::Shading];

/// Maximum side of a map \[pixels\].
const MOST_PIXELS: usize = 512;
/// Minimum fraction of pixels with a lightcut for drawing cut sizes per pixel, and side of the squares that are drawn
/// otherwise \[pixels\].
const SPARSE: (f64, usize) = (0.25, 4);
/// Kinds of pixels by reused light, with positions in the false colors.
const REUSED: [(&str, f32); 4] = [
    ("all computed", 0.92),
    ("direct light reprojected", 0.64),
    ("indirect light reprojected", 0.42),
    ("all reprojected", 0.12),
];

/// Data of a frame per pixel; `None` if not available.
#[derive(Clone, Debug)]
pub(super) struct FrameMaps {
    pub index: u32,
    /// Ratio of threshold to luminance.
    thresholds: Option<Plane<f32>>,
    /// Number of clusters in each pixel's lightcut; 0 for pixels without a lightcut.
    cuts: Option<Plane<f32>>,
    /// Reused light, in the encoding of [`Aov::Shading`].
    reused: Option<Plane<f32>>,
}

impl FrameMaps {
    /// Collects the maps of frame `index`. For pixels without a threshold, `elsewhere` is the permitted error as a
    /// fraction of luminance.
    pub fn new(index: u32, shaded: &Shaded, elsewhere: f32) -> Self {
        let (width, height) = (shaded.radiance.width(), shaded.radiance.height());
        let plane = |name: &str| {
            let (_, samples) = shaded.watched.iter().find(|(own, _)| own == name)?;
            // Omit a map of zeros, which contains no information.
            let is_told = samples.len() == width * height && samples.iter().any(|&value| value > 0.0);
            is_told.then(|| Plane::from_vec(width, height, samples.clone()))
        };
        let by_luminance = |thresholds: Plane<f32>| {
            let mut shares = Vec::with_capacity(width * height);
            for (&threshold, &rgb) in thresholds.samples().iter().zip(shaded.radiance.samples()) {
                shares.push(match luminance(rgb) {
                    light if light > 0.0 && threshold > 0.0 => threshold / light,
                    light if light > 0.0 => elsewhere,
                    // Black pixels have no relative threshold.
                    _ => 0.0,
                });
            }
            Plane::from_vec(width, height, shares)
        };
        let thresholds = plane("threshold.Y").map(by_luminance);
        Self { index, thresholds, cuts: plane("cut.size"), reused: plane("shading.reused") }
    }

    /// Returns the available maps, each with title, data URI and legend.
    pub fn drawn(&self) -> Vec<Value> {
        let mut drawn = Vec::new();
        if let Some(plane) = &self.thresholds {
            let small = fitting(plane, mean);
            // Exclude black pixels, which have no threshold, from the mean.
            let seen: Vec<f32> = plane.samples().iter().copied().filter(|&share| share > 0.0).collect();
            let about = format!("mean {:.1} %: smaller errors are invisible", 100.0 * mean(&seen));
            let map = png(&THRESHOLD.picture(&small));
            drawn.push(context! { name => "Thresholds", uri => map, about, scale => legend(&THRESHOLD) });
        }
        if let Some(plane) = &self.cuts {
            // Enlarge sparse lightcuts to squares, because single pixels are hard to see.
            let made = plane.samples().iter().filter(|&&size| size > 0.0).count();
            let is_sparse = (made as f64) < SPARSE.0 * plane.samples().len() as f64;
            let squares = if is_sparse { shrunk(plane, SPARSE.1, most) } else { plane.clone() };
            let about = match is_sparse {
                true => format!("{made} pixels have lightcuts; the others interpolate"),
                false => format!("mean {:.0}, largest {:.0}", mean(plane.samples()), most(plane.samples())),
            };
            let map = png(&CUT_SIZE.picture(&fitting(&squares, most)));
            drawn.push(context! { name => "Cut sizes", uri => map, about, scale => legend(&CUT_SIZE) });
        }
        if let Some(plane) = &self.reused {
            // Keep one pixel of each square, because kinds cannot be averaged.
            let first = |samples: &[f32]| samples[0];
            let color = |value: f32| false_color(REUSED[kind(value)].1);
            let map = png(&fitting(plane, first).map(color));
            drawn.push(context! { name => "Shading", uri => map, entries => entries(plane) });
        }
        drawn
    }
}

/// Returns the index in [`REUSED`] for a pixel's value.
fn kind(value: f32) -> usize {
    (value.max(0.0) as usize).min(REUSED.len() - 1)
}

/// Returns the kinds of pixels, with color and fraction of pixels.
fn entries(plane: &Plane<f32>) -> Vec<Value> {
    let mut counts = [0usize; REUSED.len()];
    plane.samples().iter().for_each(|&value| counts[kind(value)] += 1);
    let mut kinds = Vec::new();
    for ((name, place), count) in REUSED.iter().zip(counts) {
        // Omit kinds that do not occur.
        if count > 0 {
            let share = format!("{:.0} %", 100.0 * count as f64 / plane.samples().len() as f64);
            kinds.push(context! { name => *name, color => css_color(false_color(*place)), share });
        }
    }
    kinds
}

fn legend(scale: &super::Scale) -> Value {
    context! { about => scale.about, low => scale.ends.0, high => scale.ends.1, gradient => gradient() }
}

/// Returns a map reduced to sides of at most [`MOST_PIXELS`].
fn fitting(plane: &Plane<f32>, of: impl Fn(&[f32]) -> f32) -> Plane<f32> {
    shrunk(plane, factor(plane.width(), plane.height(), MOST_PIXELS), of)
}

fn mean(values: &[f32]) -> f32 {
    (values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len().max(1) as f64) as f32
}

fn most(values: &[f32]) -> f32 {
    values.iter().copied().fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_maps_that_say_something_are_drawn() {
        let light = Plane::filled(4, 2, [2.0f32; 3]);
        let channel = |name: &str, samples: [f32; 8]| (name.to_owned(), samples.to_vec());
        let shaded = Shaded {
            radiance: light,
            watched: vec![
                channel("threshold.Y", [0.2, 0.0, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2]),
                channel("cut.size", [0.0; 8]),
                channel("shading.reused", [0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0]),
            ],
            ..Shaded::default()
        };
        let maps = FrameMaps::new(7, &shaded, 0.02);
        let thresholds = maps.thresholds.as_ref().expect("there are some");
        assert!((thresholds.get(0, 0) - 0.1).abs() < 1e-6 && (thresholds.get(1, 0) - 0.02).abs() < 1e-6);
        let names: Vec<String> = maps.drawn().iter().map(|map| map.get_attr("name").unwrap().to_string()).collect();
        assert_eq!(names, ["Thresholds", "Shading"]);
        assert_eq!(entries(maps.reused.as_ref().unwrap()).len(), 4);
        assert!(FrameMaps::new(0, &Shaded::default(), 0.02).drawn().is_empty());
    }
}
