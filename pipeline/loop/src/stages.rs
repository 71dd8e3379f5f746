//! Stages as the driver runs them: with spans, CPU seconds, and results for observers and the report.

use super::checkpoint::StageName;
use super::log::FilmLog;
use super::observe::Observer;
use super::threads::Stage;
use crate::error::{Context, Error, Result};
use crate::figures::{FrameFigures, RANK_FIGURES};
use crate::stage::{
    Coding, Display, Displayed, Encode, LastThresholds, LuminanceThresholds, Mask, Prepare, Prepared, Shade, Shaded,
};
use crate::state::encode;
use plane::Correspondence;
use ranks::{Busy, Portable, Ranks};
use rayon::ThreadPool;
use std::marker::PhantomData;
use std::sync::Arc;

pub(super) struct Preparing<P>(pub P);

impl<P: Prepare> Stage for Preparing<P> {
    const STAGE: StageName = StageName::Prepare;
    type In = ();
    type Out = Prepared<P::Frame>;

    fn step(&mut self, index: u32, (): ()) -> Result<Option<Self::Out>> {
        let _span = tracing::debug_span!("prepare", frame = index).entered();
        Ok(self.0.step(index))
    }

    fn state(&self) -> Result<Vec<u8>> {
        Ok(self.0.state())
    }
}

/// Motion of a frame, which bypasses shading on the way from preparation to the encoder.
pub(super) struct Motion {
    correspondence: Option<Arc<Correspondence>>,
    forward: Option<Arc<Correspondence>>,
}

pub(super) struct Shading<S, F> {
    part: S,
    ranks: Arc<dyn Ranks>,
    frames: PhantomData<fn(F)>,
}

impl<S, F> Shading<S, F> {
    /// Returns a stage that shades together with `ranks`.
    pub fn new(part: S, ranks: Arc<dyn Ranks>) -> Self {
        Self { part, ranks, frames: PhantomData }
    }
}

impl<F, S: Shade<F>> Stage for Shading<S, F> {
    const STAGE: StageName = StageName::Shade;
    type In = (Prepared<F>, Option<LuminanceThresholds>);
    type Out = (Shaded, Motion);

    fn step(&mut self, index: u32, (prepared, last): Self::In) -> Result<Option<Self::Out>> {
        let _span = tracing::debug_span!("shade", frame = index).entered();
        // Reproject the thresholds of the previous frame along this frame's motion.
        let thresholds = LastThresholds::new(index, last.as_ref(), prepared.correspondence.as_deref());
        let mut shaded = self.part.step(&prepared, thresholds);
        agree(&*self.ranks, index, &mut shaded)?;
        let Prepared { correspondence, forward, .. } = prepared;
        Ok(Some((shaded, Motion { correspondence, forward })))
    }

    fn state(&self) -> Result<Vec<u8>> {
        Ok(self.part.state())
    }
}

/// Checks that all ranks computed the same light, and adds up their figures.
///
/// # Errors
/// If the ranks computed different light.
fn agree(ranks: &dyn Ranks, index: u32, shaded: &mut Shaded) -> Result<()> {
    if ranks.count() == 1 {
        return Ok(());
    }

    // Send a checksum of the light, which is far smaller than the light, and this rank's figures.
    let mut sum = crc32fast::Hasher::new();
    let mut row = Vec::new();
    for y in 0..shaded.radiance.height() {
        row.clear();
        shaded.radiance.row(y).iter().for_each(|rgb| rgb.put(&mut row));
        sum.update(&row);
    }
    let figures = &mut shaded.figures;
    let mut own = Vec::new();
    sum.finalize().put(&mut own);
    figures.of_rank().put(&mut own);

    // Compare all sums with the first one on every rank, so either all ranks fail or none.
    let all = ranks.all_gather(own);
    let mut answers = Vec::with_capacity(all.len());
    for bytes in &all {
        let answer: Option<(u32, [f64; RANK_FIGURES])> = Portable::take(&mut &bytes[..]);
        answers.push(answer.ok_or_else(|| Error::Ranks("ranks run different programs".into()))?);
    }
    if let Some(other) = answers.iter().position(|(sum, _)| *sum != answers[0].0) {
        return Err(Error::Ranks(format!(
            "rank {other} differs from rank 0 in the light of frame {index}: use the same program, and processors that round alike"
        )));
    }
    figures.add_up_ranks(answers.iter().map(|(_, figures)| figures));
    Ok(())
}

pub(super) struct Displaying<'a, D> {
    display: D,
    observer: &'a dyn Observer,
    pool: ThreadPool,
}

impl<'a, D: Display> Displaying<'a, D> {
    pub fn new(display: D, observer: &'a dyn Observer) -> Result<Self> {
        Ok(Self { display, observer, pool: pool_of_one()? })
    }
}

impl<D: Display> Stage for Displaying<'_, D> {
    const STAGE: StageName = StageName::Display;
    type In = (Shaded, Motion);
    type Out = (Displayed, FrameFigures);

    fn step(&mut self, index: u32, (shaded, motion): Self::In) -> Result<Option<Self::Out>> {
        let _span = tracing::debug_span!("display", frame = index).entered();
        let Self { display, observer, pool } = self;

        // Measure the CPU time of the tone curve alone, without observers and files.
        let busy = Busy::default();
        let shown = pool.install(|| busy.measure(|| display.show(index, &shaded)));
        observer.shaded(index, &shaded);
        observer.picture(index, &shown.picture);
        if let Some(importance) = &shaded.importance {
            observer.importance(index, importance);
        }

        // Add the display's figures before `write` consumes the light.
        let mut figures = shaded.figures.clone();
        figures.non_finite = shown.picture.non_finite;
        figures.seconds.tone_map = busy.seconds();
        display.write(index, shaded, &shown.picture)?;

        // Attach the motion, which the display does not process.
        let Motion { correspondence, forward } = motion;
        Ok(Some((Displayed { correspondence, forward, ..shown }, figures)))
    }

    fn state(&self) -> Result<Vec<u8>> {
        self.display.state()
    }

    fn finish(self) -> Result<()> {
        self.display.finish()
    }
}

pub(super) struct Encoding<'a, E> {
    part: E,
    log: &'a mut FilmLog,
    observer: &'a dyn Observer,
    pool: ThreadPool,
}

impl<'a, E: Encode> Encoding<'a, E> {
    pub fn new(part: E, log: &'a mut FilmLog, observer: &'a dyn Observer) -> Result<Self> {
        log.end_with(part.ending())?;
        Ok(Self { part, log, observer, pool: pool_of_one()? })
    }
}

impl<E: Encode> Stage for Encoding<'_, E> {
    const STAGE: StageName = StageName::Encode;
    type In = (Displayed, FrameFigures);
    type Out = (Displayed, Coding);

    fn step(&mut self, index: u32, (displayed, mut figures): Self::In) -> Result<Option<Self::Out>> {
        let _span = tracing::debug_span!("encode", frame = index).entered();
        let Self { part, log, observer, pool } = self;
        let busy = Busy::default();
        let coded = pool.install(|| busy.measure(|| part.step(&displayed)))?;
        figures.seconds.encode = busy.seconds();
        // Store the figures first: the encoder may return this picture now or in a later step.
        log.expect(index, figures);
        let coding = log.hand_out(coded, part.ending(), *observer)?;
        Ok(Some((displayed, coding)))
    }

    fn state(&self) -> Result<Vec<u8>> {
        self.log.state(self.part.state())
    }

    fn finish(self) -> Result<()> {
        let Self { part, log, observer, pool } = self;
        let busy = Busy::default();
        let coded = pool.install(|| busy.measure(|| part.finish()))?;
        // Add the time to the last frame, because no further frame follows.
        log.spend_on_last(busy.seconds());
        log.hand_out(coded, Vec::new(), observer).map(drop)
    }
}

pub(super) struct Masking<'a, M> {
    part: M,
    /// Thresholds of the last frame, for a checkpoint.
    thresholds: Option<LuminanceThresholds>,
    /// Frame numbers, each with the CPU seconds of masking the frame.
    spent: &'a mut Vec<(u32, f64)>,
    observer: &'a dyn Observer,
    pool: ThreadPool,
}

impl<'a, M> Masking<'a, M> {
    pub fn new(part: M, spent: &'a mut Vec<(u32, f64)>, observer: &'a dyn Observer) -> Result<Self> {
        Ok(Self { part, thresholds: None, spent, observer, pool: pool_of_one()? })
    }
}

impl<M: Mask> Stage for Masking<'_, M> {
    const STAGE: StageName = StageName::Mask;
    type In = (Displayed, Coding);
    type Out = LuminanceThresholds;

    fn step(&mut self, index: u32, (displayed, coding): Self::In) -> Result<Option<Self::Out>> {
        let _span = tracing::debug_span!("mask", frame = index).entered();
        let Self { part, thresholds, spent, observer, pool } = self;
        let busy = Busy::default();
        let delta = pool.install(|| busy.measure(|| part.step(&displayed, &coding)));
        observer.thresholds(index, &delta);
        spent.push((index, busy.seconds()));
        // Keep a copy for checkpoints: the feedback edge receives the original.
        let known = LuminanceThresholds { of: index, delta, luminance: displayed.luminance };
        *thresholds = Some(known.clone());
        Ok(Some(known))
    }

    fn state(&self) -> Result<Vec<u8>> {
        let Self { part, thresholds, spent, .. } = self;
        let planes = thresholds.as_ref().map(|known| (&*known.delta, &*known.luminance));
        Ok(encode(&(part.state(), planes, spent)))
    }
}

/// Returns a pool of one thread for a stage with short work. In the common pool, the work would queue behind the
/// macroblocks of a picture, and its time could not be measured separately.
fn pool_of_one() -> Result<ThreadPool> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().context("cannot start a thread")
}
