//! The thread that renders: takes orders of a session, and publishes pictures.

use super::shared::{Order, Session};
use crate::error::{LiveError, LiveResult};
use crate::picture::{LiveLoop, LivePlans};
use mpeg2enc::{AccessUnit, Container, Multiplexer};
use pipeline::output::Output;
use render_core::scene::Scene;
use render2mpeg::Settings;
use render2mpeg::settings::unknown_ending;
use renderer::settings::RenderSettings;
use std::path::Path;
use std::time::{Duration, Instant};

/// sequence_end_code (13818-2, Table 6-1).
const SEQUENCE_END: [u8; 4] = [0, 0, 1, 0xb7];

/// Time after which viewers see direct light if the light of the scene is not ready.
const SOON: Duration = Duration::from_millis(400);

/// Recording of all pictures in a file.
#[derive(Debug)]
pub struct Recording {
    output: Output,
    container: Container,
    multiplexer: Option<Multiplexer>,
}

/// Creates a file that records all pictures of a session, at the session's rate of pictures.
///
/// # Errors
/// If the ending of the file's name is unknown, or the file cannot be written.
pub fn record_file(path: &Path) -> LiveResult<Recording> {
    let container = Container::of(path).ok_or_else(|| unknown_ending(path))?;
    Ok(Recording { output: Output::create(path)?, container, multiplexer: None })
}

impl Recording {
    fn write(&mut self, config: &mpeg2enc::Config, unit: AccessUnit) -> LiveResult<()> {
        let container = self.container;
        let multiplexer = self.multiplexer.get_or_insert_with(|| Multiplexer::new(container, config));
        Ok(self.output.write(&multiplexer.push(unit))?)
    }

    fn finish(mut self) -> LiveResult<()> {
        if let Some(multiplexer) = self.multiplexer.take() {
            self.output.write(&multiplexer.finish(&SEQUENCE_END))?;
        }
        Ok(self.output.finish()?)
    }
}

/// Renderer of a session.
#[derive(Debug)]
pub struct Studio<'a> {
    session: &'a Session,
    recording: Option<Recording>,
}

impl<'a> Studio<'a> {
    /// Creates the renderer of `session`, which writes its pictures to a `recording`, if any.
    #[must_use]
    pub fn new(session: &'a Session, recording: Option<Recording>) -> Self {
        Self { session, recording }
    }

    /// Renders pictures until the session ends. Blocks the thread.
    ///
    /// # Errors
    /// If the encoder does not support the settings, or the recording cannot be written. The session then ends.
    pub fn run(mut self, scene: &Scene, settings: &Settings) -> LiveResult<()> {
        let result = self.render(scene, settings);
        self.session.end();
        let recorded = self.recording.map_or(Ok(()), Recording::finish);
        result.and(recorded)
    }

    fn render(&mut self, scene: &Scene, settings: &Settings) -> LiveResult<()> {
        let plans = LivePlans::new(scene, settings);
        let session = self.session;
        std::thread::scope(|scope| {
            // Make the light of the scene on another thread.
            let making = scope.spawn(|| -> LiveResult<LiveLoop> {
                let mut live = LiveLoop::new(scene, settings, &plans)?;
                live.make_ready();
                session.improve();
                Ok(live)
            });

            // Begin with direct light if that takes long.
            let begin = Instant::now();
            while !making.is_finished() && begin.elapsed() < SOON {
                std::thread::sleep(Duration::from_millis(5));
            }
            let mut next = None;
            if !making.is_finished() {
                let direct = with_direct_light(settings);
                let plans = LivePlans::new(scene, &direct);
                let mut live = LiveLoop::new(scene, &direct, &plans)?;
                next = self.serve(&mut live, || making.is_finished())?;
            }
            let mut live = making.join().map_err(|_| LiveError::Light)??;
            if let Some(order) = next {
                self.take(&mut live, &order)?;
            }
            self.serve(&mut live, || false).map(drop)
        })
    }

    /// Renders ordered pictures until the session ends. Returns an order that another loop should take, because `ends`
    /// is true.
    fn serve(&mut self, live: &mut LiveLoop, ends: impl Fn() -> bool) -> LiveResult<Option<Order>> {
        while let Some(order) = self.session.order() {
            if ends() {
                return Ok(Some(order));
            }
            self.take(live, &order)?;
        }
        Ok(None)
    }

    /// Renders and publishes an ordered picture.
    fn take(&mut self, live: &mut LiveLoop, order: &Order) -> LiveResult<()> {
        let picture = live.picture(order.request)?;
        self.session.publish(order, &picture);
        match &mut self.recording {
            Some(recording) => recording.write(live.encoder_config(), picture.packet.into()),
            None => Ok(()),
        }
    }
}

/// Returns the settings without indirect light, except that of the sky.
fn with_direct_light(settings: &Settings) -> Settings {
    let render = RenderSettings { bounces: Some(1), ..settings.render.clone() };
    Settings { render, ..settings.clone() }
}
