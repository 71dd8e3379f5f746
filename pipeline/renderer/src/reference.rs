//! Reference frames: linear, uncompressed and of any requested accuracy.

use super::{Preparation, Shading};
use crate::plan::Plan;
use crate::settings::{Lighting, RenderSettings, Size};
#[cfg(feature = "exr")]
use pipeline::error::{Error, Result};
use pipeline::stage::{LastThresholds, Shade};
use plane::Plane;
use render_core::image_file::FrameHeader;
#[cfg(feature = "exr")]
use render_core::image_file::{FrameChannel, SampleDepth, write_frame};
use render_core::scene::Scene;
use render_core::{PathOptions, Still, path_traced};

/// Method that computes a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum ReferenceMethod {
    /// All virtual lights at every pixel, with four times the gather rays of films: the reference for lightcuts.
    AllLights,
    /// Path tracing without virtual lights: the reference for all lights.
    Path,
}

/// A reference frame and its variance.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Reference {
    /// Linear RGB radiance \[W·m⁻²·sr⁻¹\].
    pub radiance: Plane<[f32; 3]>,
    /// Variance of each pixel's mean \[W²·m⁻⁴·sr⁻²\]; `None` for methods without noise.
    pub variance: Option<Plane<[f32; 3]>>,
    /// Header of the reference frame's OpenEXR file.
    pub header: FrameHeader,
}

/// Path-traces frame `frame` of `scene`.
///
/// `progress` is called from any thread with the work done and the total work.
pub fn by_paths(
    scene: &Scene,
    settings: &RenderSettings,
    frame: u32,
    options: &PathOptions,
    progress: impl Fn(usize, usize) + Sync,
) -> Reference {
    let Size { width, height } = settings.size;
    let time = settings.time(frame);
    let estimate = path_traced(scene, Still { time, width, height }, options, progress);
    let view = scene.view(&scene.pose(time), width, height);
    let header = FrameHeader { camera: Some(view.frame_camera()), place: settings.place(frame), texts: Vec::new() };
    Reference { radiance: estimate.mean, variance: Some(estimate.variance_of_mean), header }
}

/// Renders frame `frame` of `scene` with all lights, by the stages of films.
#[must_use]
pub fn by_all_lights(scene: &Scene, settings: &RenderSettings, frame: u32) -> Reference {
    let settings = RenderSettings { lighting: Lighting::AllLights, ..settings.clone() };
    let plan = Plan::new(scene, &settings);
    let prepared = Preparation::new(scene, &settings, &plan).frame(frame);
    let shaded = Shading::new(&settings, &plan).step(&prepared, LastThresholds::none());
    Reference { radiance: shaded.radiance, variance: None, header: shaded.header }
}

#[cfg(feature = "exr")]
impl Reference {
    /// Writes an OpenEXR file in 32-bit floats: channels R, G, B and, with variance, variance.R, variance.G,
    /// variance.B.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &std::path::Path) -> Result<()> {
        let mut channels: Vec<FrameChannel> = Vec::new();
        for (prefix, plane) in [("", Some(&self.radiance)), ("variance.", self.variance.as_ref())] {
            let Some(plane) = plane else { continue };
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                let samples = plane.samples().iter().map(|rgb| rgb[c]).collect();
                // Write 32-bit floats: comparisons with a reference need full precision.
                channels.push(FrameChannel { name: format!("{prefix}{name}"), samples, depth: SampleDepth::Float });
            }
        }
        let size = (self.radiance.width(), self.radiance.height());
        write_frame(path, size, &self.header, channels).map_err(Error::other)
    }
}
