//! The renderer's motion and the encoder, outside the pipeline.

use mpeg2enc::{Packet, Picture};
use pipeline::Run;
use pipeline::stage::Prepare;
use plane::Correspondence;
use render_core::scene::{self, Scene};
use render2mpeg::{Options, Report, Settings};
use renderer::Preparation;
use renderer::plan::Plan;
use std::path::Path;
use std::sync::Arc;

/// Loads a scene, and derives its settings from `options`.
pub fn load(path: &Path, options: Options) -> (Scene, Settings) {
    let scene = scene::load(path).expect("the scene loads");
    let settings = Settings::new(path.into(), &scene, &options).expect("the settings are right");
    (scene, settings)
}

/// Renders a film; the y4m file of the options receives the frames as the encoder's input.
pub fn render_as_coded(scene: &Scene, settings: &Settings) -> Report {
    let mut settings = settings.clone();
    settings.files.y4m_is_coded = true;
    let plan = Plan::new(scene, &settings.render);
    render2mpeg::render(scene, &settings, &plan, Run::default()).expect("the film is made")
}

/// Returns each frame's exact correspondence to the previous frame; none for the first.
pub fn correspondences(scene: &Scene, settings: &Settings) -> Vec<Option<Arc<Correspondence>>> {
    let plan = Plan::new(scene, &settings.render);
    let mut preparation = Preparation::new(scene, &settings.render, &plan);
    let frames = (0..).map_while(|index| preparation.step(index));
    frames.map(|frame| frame.correspondence).collect()
}

/// Encodes `frames` with the encoder of `settings`, each with its correspondence if it has one.
pub fn encode(
    settings: &Settings,
    frames: &[Picture],
    motion: &[Option<Arc<Correspondence>>],
) -> (Vec<u8>, Vec<Packet>) {
    let config = settings.encoder_config().expect("a valid rate");
    let mut encoder = config.encoder().expect("a valid configuration");
    let packets: Vec<Packet> =
        frames.iter().zip(motion).flat_map(|(frame, motion)| encoder.push(frame, motion.as_deref().into())).collect();
    let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
    stream.extend(encoder.finish().end);
    (stream, packets)
}
