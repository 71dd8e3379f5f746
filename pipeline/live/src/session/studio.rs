//! The thread that renders: takes orders of a session, and publishes pictures.

use super::shared::{Order, Session};
use crate::error::{LiveError, LiveResult};
use crate::picture::{Detail, LiveLoop, LivePlans, PictureRequest};
use mpeg2enc::{AccessUnit, Container, Multiplexer};
use pipeline::output::Output;
use rayon::{ThreadPool, ThreadPoolBuilder};
use render_core::scene::Scene;
use render2mpeg::Settings;
use render2mpeg::settings::unknown_ending;
use renderer::settings::RenderSettings;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// sequence_end_code (13818-2, Table 6-1).
const SEQUENCE_END: [u8; 4] = [0, 0, 1, 0xb7];

/// quantiser_scale of the first picture of each loop, which nobody receives.
const WARM_QUANTISER: u32 = 8;
/// Time after which viewers see direct light if the light of the scene is not ready.
const SOON: Duration = Duration::from_millis(400);
/// Permitted error of the first picture's light, relative to luminance. In `conference`, 0.02 takes twice the time and
/// looks the same, except for a few dark pixels.
const FIRST_ERROR: f64 = 0.2;

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

/// Recording that any thread may finish, so that its file is complete even while a picture is rendered.
type SharedRecording = Arc<Mutex<Option<Recording>>>;

fn lock(recording: &SharedRecording) -> MutexGuard<'_, Option<Recording>> {
    recording.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Renderer of a session.
#[derive(Debug)]
pub struct Studio {
    session: Arc<Session>,
    recording: SharedRecording,
    /// Threads of the work; `None` for the threads of the process.
    threads: Option<ThreadPool>,
}

/// First order of the loop with all light, and number of its first picture.
type Handover = (Order, u64);

impl Studio {
    /// Creates the renderer of `session`, which writes its pictures to a `recording`, if any.
    #[must_use]
    pub fn new(session: Arc<Session>, recording: Option<Recording>) -> Self {
        Self { session, recording: Arc::new(Mutex::new(recording)), threads: None }
    }

    /// Renders pictures until the session ends. Blocks the thread. At the end, the recording is complete; other
    /// threads may still compute a picture or the light of the scene, which nobody receives.
    ///
    /// # Errors
    /// If the encoder does not support the settings, or the recording cannot be written. The session then ends.
    pub fn run(self, scene: &Arc<Scene>, settings: &Settings) -> LiveResult<()> {
        let result = self.render(scene, settings);
        self.session.end();
        let recorded = lock(&self.recording).take().map_or(Ok(()), Recording::finish);
        result.and(recorded)
    }

    fn render(&self, scene: &Arc<Scene>, settings: &Settings) -> LiveResult<()> {
        // Wait for the end of the session, without waiting for any light.
        let (failed, failures) = mpsc::channel();
        let (scene, settings) = (scene.clone(), settings.clone());
        let first = self.on(None);
        start(Ending::new(&self.session, failed), move |ending| first.begin(&scene, &settings, ending))?;
        self.session.wait_for_end();
        failures.try_recv().map_or(Ok(()), Err)
    }

    /// Returns a renderer of the same session on other `threads`.
    fn on(&self, threads: Option<ThreadPool>) -> Self {
        Self { session: self.session.clone(), recording: self.recording.clone(), threads }
    }

    /// Renders with direct light until another thread has made the light of the scene.
    fn begin(&self, scene: &Arc<Scene>, settings: &Settings, ending: &Ending) -> LiveResult<()> {
        // Light the first view with direct light before all other work: viewers wait for it.
        let begin = Instant::now();
        let direct = with_direct_light(settings);
        let plans = LivePlans::new(scene, &direct);
        let mut live = LiveLoop::new(scene, &direct, &plans)?;
        live.permit_first_error(FIRST_ERROR);
        live.picture(PictureRequest::new(self.session.moment(), WARM_QUANTISER))?;
        live.continue_after(0)?;
        if self.session.has_ended() {
            return Ok(());
        }

        // Make the light of the scene on another thread, which then renders the pictures.
        let is_ready = Arc::new(AtomicBool::new(false));
        let (hand_over, orders) = mpsc::channel();
        let lit = LitStudio { studio: self.on(Some(further_threads()?)), is_ready: is_ready.clone(), orders };
        let (lit_scene, lit_settings) = (scene.clone(), settings.clone());
        start(ending.another(), move |_| lit.run(&lit_scene, &lit_settings))?;

        // Show direct light if that takes long.
        let is_ready = || is_ready.load(Ordering::Acquire);
        while !is_ready() && !self.session.has_ended() && begin.elapsed() < SOON {
            std::thread::sleep(Duration::from_millis(5));
        }
        let first = if is_ready() { None } else { self.serve(&mut live, is_ready)? };
        let _ = hand_over.send(first.map(|order| (order, live.pictures())));
        Ok(())
    }

    /// Renders ordered pictures until the session ends. Returns an order that another loop should take, because `ends`
    /// is true.
    fn serve(&self, live: &mut LiveLoop, ends: impl Fn() -> bool) -> LiveResult<Option<Order>> {
        while let Some(order) = self.session.order() {
            if ends() {
                return Ok(Some(order));
            }
            self.take(live, &order)?;
        }
        Ok(None)
    }

    /// Runs work whose loops use the threads of this studio.
    fn on_threads<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.threads {
            Some(threads) => threads.install(work),
            None => work(),
        }
    }

    /// Renders and publishes an ordered picture.
    fn take(&self, live: &mut LiveLoop, order: &Order) -> LiveResult<()> {
        let stop = self.session.interruption();
        let Some(picture) = self.on_threads(|| live.picture_unless(order.request, &stop))? else { return Ok(()) };
        self.session.publish(order, &picture);
        match &mut *lock(&self.recording) {
            Some(recording) => recording.write(live.encoder_config(), picture.packet.into()),
            None => Ok(()),
        }
    }
}

/// The part of a studio that renders with all light, on a thread of its own.
struct LitStudio {
    studio: Studio,
    is_ready: Arc<AtomicBool>,
    /// Receives one message when the loop with direct light has ended.
    orders: Receiver<Option<Handover>>,
}

impl LitStudio {
    fn run(self, scene: &Scene, settings: &Settings) -> LiveResult<()> {
        let plans = LivePlans::new(scene, settings);
        let session = &self.studio.session;
        let mut live = self.studio.on_threads(|| -> LiveResult<LiveLoop> {
            let mut live = LiveLoop::new(scene, settings, &plans)?;
            live.make_ready();
            // Light the view while viewers see and move it in direct light. Later pictures reuse the light of this one.
            let request = PictureRequest::new(session.moment(), WARM_QUANTISER);
            live.picture(PictureRequest { detail: Detail::Fine, ..request })?;
            live.continue_after(0)?;
            Ok(live)
        })?;
        // Request a picture only after the flag is set: the loop with direct light must not take it.
        self.is_ready.store(true, Ordering::Release);
        session.improve();
        let Ok(first) = self.orders.recv() else { return Ok(()) };
        if let Some((order, pictures)) = first {
            live.continue_after(pictures)?;
            self.studio.take(&mut live, &order)?;
        }
        self.studio.serve(&mut live, || false).map(drop)
    }
}

/// Ends the session of a thread that fails or panics, after it has sent the error.
struct Ending {
    session: Arc<Session>,
    failed: Sender<LiveError>,
    /// Error of the thread; `None` if it has succeeded.
    error: Option<LiveError>,
}

impl Ending {
    fn new(session: &Arc<Session>, failed: Sender<LiveError>) -> Self {
        Self { session: session.clone(), failed, error: Some(LiveError::Light) }
    }

    /// Notes the result of the thread.
    fn note(&mut self, result: LiveResult<()>) {
        self.error = result.err();
    }

    /// Returns the same for another thread.
    fn another(&self) -> Self {
        Self::new(&self.session, self.failed.clone())
    }
}

impl Drop for Ending {
    fn drop(&mut self) {
        if let Some(error) = self.error.take() {
            let _ = self.failed.send(error);
            self.session.end();
        }
    }
}

/// Starts a thread with `work`, which nobody waits for.
fn start(mut ending: Ending, work: impl FnOnce(&Ending) -> LiveResult<()> + Send + 'static) -> LiveResult<()> {
    let work = move || {
        let result = work(&ending);
        ending.note(result);
    };
    let started = std::thread::Builder::new().name("live".into()).spawn(work);
    started.map(drop).map_err(|source| LiveError::System { what: "a thread", source })
}

/// Returns as many threads as the process has for its loops. Jobs of long work would delay pictures on the same threads.
fn further_threads() -> LiveResult<ThreadPool> {
    let threads = ThreadPoolBuilder::new().num_threads(rayon::current_num_threads()).build();
    threads.map_err(|error| LiveError::System { what: "threads", source: std::io::Error::other(error) })
}

/// Returns the settings without indirect light, except that of the sky.
fn with_direct_light(settings: &Settings) -> Settings {
    let render = RenderSettings { bounces: Some(1), ..settings.render.clone() };
    Settings { render, ..settings.clone() }
}
