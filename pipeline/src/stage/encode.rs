//! Pictures into the stream, with the renderer's motion; and a line for the report from each.

use crate::checkpoint::{Checkpoints, NONSENSE, Part};
use crate::error::{Error, Result};
use crate::message::{Coding, Displayed, FrameFigures};
use crate::observe::Observer;
use crate::output::Output;
use crate::report::FrameReport;
use crate::settings::Settings;
use crate::video::{Coded, CodingOutcome, Video};
use crossbeam_channel::{Receiver, Sender};
use mpeg2enc::{MotionField, PictureType};
use perceptual::NextPicture;
use plane::Picture;
use render_core::{Busy, Correspondence};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Encodes frame after frame into `output`; adds the report of each to `reports`, in the order of coding, and shows it to
/// `observer`.
///
/// What is known of the coding of each frame when it has come in is sent to `codings`, where masking asks.
///
/// # Errors
/// The output or a checkpoint cannot be written, or the settings fit no encoder.
pub fn run(
    settings: &Settings,
    checkpoints: &Checkpoints,
    frames: &Receiver<Displayed>,
    codings: Option<&Sender<Coding>>,
    output: &mut Output,
    reports: &mut Vec<FrameReport>,
    observer: &dyn Observer,
) -> Result<()> {
    let pool = super::pool_of_one()?;
    let (mut stage, known) = known(settings, checkpoints)?;
    *reports = known;
    let mut last = None;
    for displayed in frames {
        let (frame, checkpoint) = (displayed.frame, displayed.checkpoint);
        let _span = tracing::debug_span!("encode", frame).entered();
        let (bytes, lines, outcome) = pool.install(|| stage.take(displayed))?;
        if let Some(codings) = codings {
            let begins_group = (frame + 1).is_multiple_of(settings.gop);
            let next = if begins_group { NextPicture::Intra { group: settings.gop } } else { NextPicture::Predicted };
            // Without thresholds nobody asks.
            let _ = codings.send(Coding { quantiser_scale: stage.video.quantiser_scale(), outcome, next });
        }
        hand_out(output, observer, reports, &bytes, lines)?;
        if checkpoint {
            stage.leave(checkpoints, frame, output, reports)?;
        }
        last = Some(frame);
    }
    if let Some(frame) = last.filter(|&frame| checkpoints.ends_behind(frame)) {
        // Before the end of the stream, which a film that goes on does not have here.
        stage.leave(checkpoints, frame, output, reports)?;
    }
    let (bytes, lines) = pool.install(|| stage.finish())?;
    hand_out(output, observer, reports, &bytes, lines)
}

/// Where the film is to go on, or begins, and the reports up to there.
pub(super) fn known<'a>(settings: &'a Settings, checkpoints: &Checkpoints) -> Result<(Stage<'a>, Vec<FrameReport>)> {
    let mut stage = Stage { settings, video: Video::new(settings)?, queue: Queue::default() };
    let Some((video, queue, reports)) = checkpoints.part::<(Vec<u8>, _, Vec<FrameReport>)>(Part::Encode)? else {
        return Ok((stage, Vec::new()));
    };
    stage.video.restore(&video)?;
    stage.queue = queue;
    // Each frame that is done has its line, or waits for it.
    let mut frames: Vec<u32> = reports.iter().map(|line| line.index).chain(stage.queue.frames()).collect();
    frames.sort_unstable();
    if !frames.into_iter().eq(0..checkpoints.first_frame()) {
        return Err(Error::Checkpoint(NONSENSE.into()));
    }
    Ok((stage, reports))
}

/// Bytes and lines go where they are wanted.
fn hand_out(
    output: &mut Output,
    observer: &dyn Observer,
    reports: &mut Vec<FrameReport>,
    bytes: &[u8],
    lines: Vec<FrameReport>,
) -> Result<()> {
    output.write(bytes)?;
    observer.bytes(bytes);
    for line in lines {
        let FrameReport { index, picture_type, bits, psnr_y, .. } = &line;
        let psnr_y = psnr_y.unwrap_or(f64::INFINITY);
        tracing::info!("frame {index}: {picture_type}, {bits} bits, {psnr_y:.2} dB");
        observer.frame(&line);
        reports.push(line);
    }
    Ok(())
}

pub(super) struct Stage<'a> {
    settings: &'a Settings,
    video: Video,
    queue: Queue,
}

/// What is not coded yet.
#[derive(Default, Serialize, Deserialize)]
struct Queue {
    /// Of the frames that the encoder has.
    figures: BTreeMap<u32, FrameFigures>,
    /// A frame whose motion into the next one is still to come.
    last: Option<Waiting>,
}

impl Queue {
    fn frames(&self) -> impl Iterator<Item = u32> {
        self.figures.keys().copied().chain(self.last.as_ref().map(|waiting| waiting.index))
    }
}

#[derive(Serialize, Deserialize)]
struct Waiting {
    index: u32,
    picture: Arc<Picture>,
    to_previous: Option<MotionField>,
    figures: FrameFigures,
}

impl Stage<'_> {
    /// What is carried behind `frame`, and how much of the film there is.
    fn leave(&self, checkpoints: &Checkpoints, frame: u32, output: &Output, reports: &[FrameReport]) -> Result<()> {
        output.sync()?;
        checkpoints.leave(frame, Part::Film, &output.len())?;
        checkpoints.leave(frame, Part::Encode, &(self.video.state(), &self.queue, reports))
    }

    fn take(&mut self, displayed: Displayed) -> Result<(Vec<u8>, Vec<FrameReport>, Option<CodingOutcome>)> {
        let Displayed { frame: index, picture, correspondence, forward, figures, .. } = displayed;
        let field = |known: &Correspondence| MotionField::new(known.motion.clone());
        let to_previous = correspondence.as_deref().filter(|_| self.settings.motion).map(field);
        let taken = Waiting { index, picture: picture.picture.clone(), to_previous, figures };
        if self.settings.bframes == 0 {
            return Ok(self.push(taken, None));
        }
        let to_next = forward.as_deref().map(field);
        let before = self.queue.last.replace(taken);
        Ok(before.map_or_else(Default::default, |before| self.push(before, to_next)))
    }

    fn push(
        &mut self,
        waiting: Waiting,
        to_next: Option<MotionField>,
    ) -> (Vec<u8>, Vec<FrameReport>, Option<CodingOutcome>) {
        let Waiting { index, picture, to_previous, figures } = waiting;
        let busy = Busy::default();
        let mut coded = busy.measure(|| self.video.push(&picture, to_previous.as_ref(), to_next.as_ref()));
        let outcome = coded.pictures.last_mut().and_then(|picture| picture.outcome.take());
        self.queue.figures.insert(index, FrameFigures { encode: busy.seconds(), ..figures });
        let (bytes, lines) = told(self.settings, &mut self.queue, coded);
        (bytes, lines, outcome)
    }

    fn finish(mut self) -> Result<(Vec<u8>, Vec<FrameReport>)> {
        let last = self.queue.last.take();
        let (mut bytes, mut lines, _) = last.map_or_else(Default::default, |last| self.push(last, None));
        let Self { settings, video, mut queue } = self;
        let busy = Busy::default();
        let coded = busy.measure(|| video.finish());
        if let Some(mut last) = queue.figures.last_entry() {
            last.get_mut().encode += busy.seconds();
        }
        let (more, told) = told(settings, &mut queue, coded);
        bytes.extend(more);
        lines.extend(told);
        Ok((bytes, lines))
    }
}

/// The bytes, and a line for each picture, which takes its figures from those that wait.
fn told(settings: &Settings, queue: &mut Queue, coded: Coded) -> (Vec<u8>, Vec<FrameReport>) {
    let lines = coded.pictures.into_iter().map(|picture| {
        let picture_type = match picture.picture_type {
            PictureType::I => "I",
            PictureType::P => "P",
            PictureType::B => "B",
        };
        let psnr_y = picture.psnr_y.is_finite().then_some(picture.psnr_y);
        let figures = queue.figures.remove(&picture.index).unwrap_or_default();
        let (bits, scale) = (picture.bits, picture.quantiser_scale);
        let mut line = FrameReport::new(picture.index, picture_type, bits, scale, psnr_y, figures);
        // Where cuts end by what errors turned out to be, that is the multiplier that tells.
        line.kappa = line.kappa.or(Some(settings.kappa.into()));
        line
    });
    (coded.bytes, lines.collect())
}
