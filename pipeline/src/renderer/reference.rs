//! One frame as exactly as wanted, linear and uncompressed: what the fast ways are measured against.

use super::{Preparation, Shading};
#[cfg(feature = "exr")]
use crate::error::{Error, Result};
use crate::parts::{LastThresholds, Shade};
use crate::plan::Plan;
use crate::settings::{Lighting, RenderSettings, Size};
use plane::Plane;
use render_core::scene::Scene;
use render_core::{PathOptions, path_traced};

/// How a reference is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "command-line", derive(clap::ValueEnum))]
pub enum ReferenceMethod {
    /// Every virtual light at every pixel, and four times as many gather rays as films take: what a cut approximates.
    AllLights,
    /// Path tracing without virtual lights: what all lights approximate.
    Path,
}

/// A frame, and how far it can be trusted.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Reference {
    /// Linear RGB \[W·m⁻²·sr⁻¹\].
    pub radiance: Plane<[f32; 3]>,
    /// Variance of each mean, where the method has noise.
    pub variance: Option<Plane<[f32; 3]>>,
}

/// Frame `frame` of `scene` by paths.
///
/// `progress` is called from any thread with the work done and the work there is.
pub fn by_paths(
    scene: &Scene,
    settings: &RenderSettings,
    frame: u32,
    options: &PathOptions,
    progress: impl Fn(usize, usize) + Sync,
) -> Reference {
    let Size { width, height } = settings.size;
    let estimate = path_traced(scene, settings.time(frame), (width, height), options, progress);
    Reference { radiance: estimate.mean, variance: Some(estimate.variance_of_mean) }
}

/// Frame `frame` of `scene` by all lights, through the parts that films go through.
#[must_use]
pub fn by_all_lights(scene: &Scene, settings: &RenderSettings, frame: u32) -> Reference {
    let settings = RenderSettings { lighting: Lighting::AllLights, ..settings.clone() };
    let plan = Plan::new(scene, &settings);
    let prepared = Preparation::new(scene, &settings, &plan).frame(frame);
    let shaded = Shading::new(&settings, &plan).step(&prepared, LastThresholds::none());
    Reference { radiance: shaded.radiance, variance: None }
}

#[cfg(feature = "exr")]
impl Reference {
    /// Writes OpenEXR: channels R, G, B and, where there is noise, variance.R, variance.G, variance.B.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &std::path::Path) -> Result<()> {
        let layers = [("", Some(&self.radiance)), ("variance.", self.variance.as_ref())];
        let channels = layers.into_iter().flat_map(|(prefix, plane)| plane.map(|plane| (prefix, plane))).flat_map(
            |(prefix, plane)| {
                ["R", "G", "B"].into_iter().enumerate().map(move |(c, name)| {
                    (format!("{prefix}{name}"), plane.samples().iter().map(|rgb| rgb[c]).collect::<Vec<f32>>())
                })
            },
        );
        let (width, height) = (self.radiance.width(), self.radiance.height());
        render_core::image_file::write_layers(path, width, height, channels.collect()).map_err(Error::other)
    }
}
