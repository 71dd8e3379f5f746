//! One frame as exactly as wanted, linear and uncompressed: what the fast ways are measured against.

use super::{Preparation, Shading};
use crate::plan::Plan;
use crate::settings::{Lighting, RenderSettings, Size};
#[cfg(feature = "exr")]
use pipeline::error::{Error, Result};
use pipeline::parts::{LastThresholds, Shade};
use plane::Plane;
use render_core::image_file::FrameHeader;
#[cfg(feature = "exr")]
use render_core::image_file::{FrameChannel, SampleDepth, write_frame};
use render_core::scene::Scene;
use render_core::{PathOptions, Still, path_traced};

/// How a reference is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
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
    /// Facts for the header of its file.
    pub header: FrameHeader,
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
    let time = settings.time(frame);
    let estimate = path_traced(scene, Still { time, width, height }, options, progress);
    let view = scene.view(&scene.pose(time), width, height);
    let header = FrameHeader { camera: Some(view.frame_camera()), place: settings.place(frame), texts: Vec::new() };
    Reference { radiance: estimate.mean, variance: Some(estimate.variance_of_mean), header }
}

/// Frame `frame` of `scene` by all lights, through the parts that films go through.
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
    /// Writes OpenEXR in 32-bit floats: channels R, G, B and, where there is noise, variance.R, variance.G, variance.B.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &std::path::Path) -> Result<()> {
        let mut channels: Vec<FrameChannel> = Vec::new();
        for (prefix, plane) in [("", Some(&self.radiance)), ("variance.", self.variance.as_ref())] {
            let Some(plane) = plane else { continue };
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                let samples = plane.samples().iter().map(|rgb| rgb[c]).collect();
                // Others are compared with it.
                channels.push(FrameChannel { name: format!("{prefix}{name}"), samples, depth: SampleDepth::Float });
            }
        }
        let size = (self.radiance.width(), self.radiance.height());
        write_frame(path, size, &self.header, channels).map_err(Error::other)
    }
}
