//! The renderer's motion and the encoder, outside of the pipeline.

use mpeg2enc::{MotionField, Packet, Picture};
use pipeline::feedback_loop::parts::Prepare;
use pipeline::renderer::Preparation;
use pipeline::{Options, Plan, Settings};
use plane::Plane;
use render_core::scene::{self, Scene};
use std::path::Path;

/// Loads a scene and fills in `options` for it.
pub fn load(path: &Path, options: Options) -> (Scene, Settings) {
    let scene = scene::load(path).expect("the scene loads");
    let settings = Settings::new(path.into(), &scene, &options).expect("the settings are right");
    (scene, settings)
}

/// What the renderer knows of each frame's motion; nothing for the first.
pub fn motion_fields(scene: &Scene, settings: &Settings) -> Vec<Option<MotionField>> {
    motion(scene, settings).into_iter().map(|motion_px| motion_px.map(MotionField::new)).collect()
}

/// The same as planes: where each pixel was in the frame before minus where it is, in pixels; NaN where it was not seen.
pub fn motion(scene: &Scene, settings: &Settings) -> Vec<Option<Plane<[f32; 2]>>> {
    let plan = Plan::new(scene, settings);
    let mut preparation = Preparation::new(scene, settings, &plan);
    let frames = (0..).map_while(|index| preparation.step(index));
    frames.map(|frame| frame.correspondence.map(|known| known.motion.clone())).collect()
}

/// Encodes `frames` with the encoder that `settings` ask for, each with its motion field if there is one.
pub fn encode(settings: &Settings, frames: &[Picture], motion: &[Option<MotionField>]) -> (Vec<u8>, Vec<Packet>) {
    let config = settings.encoder_config().expect("a valid rate");
    let mut encoder = config.encoder().expect("a valid configuration");
    let packets: Vec<Packet> =
        frames.iter().zip(motion).map(|(frame, motion)| encoder.push(frame, motion.as_ref())).collect();
    let mut stream: Vec<u8> = packets.iter().flat_map(|packet| packet.data.iter().copied()).collect();
    stream.extend(encoder.finish());
    (stream, packets)
}
