//! Pictures into the stream, with the renderer's motion; and a line for the report from each.

use crate::message::{Displayed, FrameFigures};
use crate::output::Output;
use crate::report::FrameReport;
use crate::settings::Settings;
use anyhow::Result;
use crossbeam_channel::Receiver;
use mpeg2enc::{Frame, MotionField, PictureType};
use render_core::Busy;

/// Encodes frame after frame into `output`, and calls `done` with the report of each.
///
/// # Errors
/// The output cannot be written, or the settings fit no encoder.
pub fn run(
    settings: &Settings,
    frames: &Receiver<Displayed>,
    output: &mut Output,
    mut done: impl FnMut(FrameReport),
) -> Result<()> {
    let pool = super::pool_of_one()?;
    let mut encoder = settings.encoder_config()?.encoder()?;
    for Displayed { frame, picture, correspondence, mut figures } in frames {
        let busy = Busy::default();
        let known = correspondence.as_ref().filter(|_| settings.motion);
        let motion = known.map(|correspondence| MotionField::new(correspondence.motion.clone()));
        let coded = Frame::new(picture.y.clone(), picture.cb.clone(), picture.cr.clone())?;
        let packet = pool.install(|| busy.measure(|| encoder.push(&coded, motion.as_ref())));
        figures.encode = busy.seconds();
        output.write(&packet.data)?;
        let mut line = report(frame, &packet, figures);
        // Where cuts end by what errors turned out to be, that is the multiplier that tells.
        line.kappa = line.kappa.or(Some(settings.kappa.into()));
        done(line);
    }
    output.write(&encoder.finish())
}

fn report(index: u32, packet: &mpeg2enc::Packet, figures: FrameFigures) -> FrameReport {
    let picture_type = match packet.picture_type {
        PictureType::I => "I",
        PictureType::P => "P",
        PictureType::B => "B",
    };
    let psnr_y = packet.psnr_y.is_finite().then_some(packet.psnr_y);
    FrameReport::new(index, picture_type, packet.bits, packet.quantiser_scale, psnr_y, figures)
}
