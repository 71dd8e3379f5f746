//! The session as threads share it: viewers' messages in, orders for pictures out.

use super::budget::Budget;
use super::rest::Rest;
use super::stage::LiveStage;
use super::viewers::{Outgoing, ViewerId, Viewers};
use crate::controls::Controls;
use crate::flow::{FlowLimits, PictureKind, SentPicture};
use crate::message::{PictureHeader, PictureState, ViewerMessage};
use crate::picture::{Detail, LivePicture, PictureRequest};
use axum::body::Bytes;
use render_core::scene::Scene;
use render2mpeg::Settings;
use renderer::Moment;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, watch};

/// Time after which an unresponsive controller loses control, if others watch.
const PATIENCE: Duration = Duration::from_secs(3);
/// Time after which a viewer without an acknowledgement is disconnected.
const GONE: Duration = Duration::from_secs(30);
/// Longest wait without a look at the session.
const LONGEST_WAIT: Duration = Duration::from_secs(1);
/// Wait between looks at a session that has something to do.
const SHORT_WAIT: Duration = Duration::from_millis(4);
/// Time without input before all light of a static view is computed again. Such a picture takes long.
const CALM: Duration = Duration::from_millis(200);
/// Coarsest quantiser at which pictures in motion have smooth outlines.
const FINE_MOTION: u32 = 3;

/// Settings of a session.
#[derive(Clone, Copy, Debug)]
pub struct SessionSettings {
    /// Maximum number of viewers.
    pub viewers: usize,
    /// Maximum number of pictures per second.
    pub pictures_per_second: f64,
    /// Maximum bit rate \[bits/s\]; `None` for no limit.
    pub bits_per_second: Option<u32>,
    /// Quantiser of finished static views. Pictures in motion are at most half as fine.
    pub best: u32,
}

impl SessionSettings {
    fn limits(&self) -> FlowLimits {
        let Self { pictures_per_second, bits_per_second, .. } = *self;
        FlowLimits { bits_per_second, pictures_per_second }
    }
}

/// Reason why a viewer cannot join.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The session has the maximum number of viewers.
    Full,
    /// The session ends.
    Ended,
}

/// New viewer, and the queue of its messages.
#[derive(Debug)]
pub struct Joined {
    /// Number of the viewer.
    pub id: ViewerId,
    /// Messages for the viewer.
    pub messages: mpsc::Receiver<Outgoing>,
}

/// Session of viewers in one scene, shared by the server and the thread that renders.
#[derive(Debug)]
pub struct Session {
    state: Mutex<SessionState>,
    changed: Condvar,
    /// True if an input should end the picture in work.
    interruption: Arc<AtomicBool>,
    /// True after the end.
    ended: watch::Sender<bool>,
    begin: Instant,
    width: usize,
    height: usize,
}

#[derive(Debug)]
struct SessionState {
    settings: SessionSettings,
    stage: LiveStage,
    viewers: Viewers,
    rest: Rest,
    budget: Budget,
    /// Moment of the last picture.
    shown: Option<Moment>,
    /// Earliest time of the next picture.
    due: Duration,
    /// Number of the last input.
    input: u32,
    /// Arrival of the first input that no picture contains.
    input_at: Option<Duration>,
    /// Time from which long pictures may be rendered.
    calm: Duration,
    sequence: u32,
    has_ended: bool,
}

/// Order for a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    pub request: PictureRequest,
    kind: PictureKind,
    /// Number of the last input in the picture.
    input: u32,
    /// Time from the first input in the picture to the order.
    waited: Duration,
    at: Duration,
}

impl Session {
    /// Creates a session in `scene`.
    #[must_use]
    pub fn new(scene: Arc<Scene>, settings: &Settings, session: SessionSettings) -> Self {
        let state = SessionState {
            settings: session,
            stage: LiveStage::new(scene, &settings.render),
            viewers: Viewers::default(),
            rest: Rest::default(),
            budget: Budget::default(),
            shown: None,
            due: Duration::ZERO,
            input: 0,
            input_at: None,
            calm: Duration::ZERO,
            sequence: 0,
            has_ended: false,
        };
        let (width, height) = (settings.render.size.width, settings.render.size.height);
        Self {
            state: Mutex::new(state),
            changed: Condvar::new(),
            interruption: Arc::default(),
            ended: watch::Sender::new(false),
            begin: Instant::now(),
            width,
            height,
        }
    }

    fn lock(&self) -> MutexGuard<'_, SessionState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        self.begin.elapsed()
    }

    /// Adds a viewer. A viewer with the `name` of the last controller regains control.
    ///
    /// # Errors
    /// If the session is full or ends.
    pub fn join(&self, name: String) -> Result<Joined, Refusal> {
        let mut state = self.lock();
        if state.has_ended {
            return Err(Refusal::Ended);
        }
        if state.viewers.count() >= state.settings.viewers {
            return Err(Refusal::Full);
        }
        let limits = state.settings.limits();
        let (id, messages) = state.viewers.join(self.now(), name, limits);
        self.tell_roles(&state);
        self.changed.notify_all();
        Ok(Joined { id, messages })
    }

    /// Removes a viewer.
    pub fn leave(&self, id: ViewerId) {
        let mut state = self.lock();
        if state.viewers.leave(id) {
            state.stage.release();
        }
        self.tell_roles(&state);
        self.changed.notify_all();
    }

    /// Applies a message of a viewer. Only the controller steers.
    pub fn receive(&self, id: ViewerId, message: ViewerMessage) {
        let (mut state, now) = (self.lock(), self.now());
        let state = &mut *state;
        let has_control = state.viewers.has_control(id);
        match message {
            ViewerMessage::Hello => state.viewers.answered(now, id),
            ViewerMessage::Seen { sequence, held } => {
                if let Some(flow) = state.viewers.flow(id) {
                    flow.acknowledged(now, sequence, Duration::from_micros(held.into()));
                }
            }
            ViewerMessage::Control { number, controls } if has_control => {
                state.control(now, number, controls);
                self.interruption.store(true, Ordering::Relaxed);
            }
            ViewerMessage::Limits { bits_per_second, best } if has_control => {
                state.set_limits(id, bits_per_second, best);
            }
            ViewerMessage::Control { .. } | ViewerMessage::Limits { .. } => {}
        }
        self.changed.notify_all();
    }

    /// Ends the session: viewers are disconnected, and the thread that renders returns.
    pub fn end(&self) {
        let mut state = self.lock();
        state.has_ended = true;
        state.viewers = Viewers::default();
        self.ended.send_replace(true);
        self.changed.notify_all();
    }

    /// Waits for the end of the session.
    pub async fn ended(&self) {
        let _ = self.ended.subscribe().wait_for(|ended| *ended).await;
    }

    /// Waits for the end of the session. Blocks the thread.
    pub fn wait_for_end(&self) {
        let waiting = self.changed.wait_while(self.lock(), |state| !state.has_ended);
        drop(waiting.unwrap_or_else(PoisonError::into_inner));
    }

    /// Returns whether the session has ended.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.lock().has_ended
    }

    /// Returns the maximum number of viewers.
    #[must_use]
    pub fn max_viewers(&self) -> usize {
        self.lock().settings.viewers
    }

    /// Returns the moment of the last picture, or of the next one before the first.
    pub(super) fn moment(&self) -> Moment {
        let (mut state, now) = (self.lock(), self.now());
        state.shown.unwrap_or_else(|| state.stage.step(now))
    }

    /// Requests a picture with new light from the thread that renders, even of a finished static view.
    pub(super) fn improve(&self) {
        self.lock().shown = None;
        self.changed.notify_all();
    }

    /// Waits until a picture is due; returns `None` when the session ends.
    pub(super) fn order(&self) -> Option<Order> {
        let mut state = self.lock();
        while !state.has_ended {
            let now = self.now();
            let is_without_control = state.viewers.remove_stalled(now, GONE);
            if state.viewers.replace_stalled(now, PATIENCE) || is_without_control {
                state.stage.release();
                self.tell_roles(&state);
            }
            if let Some(order) = state.next(now) {
                self.interruption.store(false, Ordering::Relaxed);
                return Some(order);
            }
            // Look again soon while something moves or a picture is on its way.
            let waits = state.stage.is_moving() || state.due.max(state.calm) > now || state.viewers.needs_time();
            let wait = if waits { SHORT_WAIT } else { LONGEST_WAIT };
            state = self.changed.wait_timeout(state, wait).unwrap_or_else(PoisonError::into_inner).0;
        }
        None
    }

    /// Returns the flag that becomes true when an input follows the last order.
    pub(super) fn interruption(&self) -> Arc<AtomicBool> {
        self.interruption.clone()
    }

    /// Sends a picture to the viewers.
    pub(super) fn publish(&self, order: &Order, picture: &LivePicture) {
        let (mut state, now) = (self.lock(), self.now());
        let state = &mut *state;
        state.note(now, order, picture);
        let PictureRequest { moment, quantiser_scale, .. } = order.request;
        state.shown = Some(moment);
        let sent = SentPicture {
            sequence: state.sequence,
            bits: picture.packet.bits,
            quantiser_scale: picture.packet.quantiser_scale.max(quantiser_scale),
            kind: order.kind,
        };
        let message = state.message(now, order, picture);
        state.viewers.send(now, sent, picture.is_intra(), &message);
        state.sequence = state.sequence.wrapping_add(1);
    }

    /// Sends every viewer its role.
    fn tell_roles(&self, state: &SessionState) {
        for id in state.viewers.ids() {
            let role = if state.viewers.has_control(id) { "controller" } else { "viewer" };
            let SessionSettings { best, bits_per_second, .. } = state.settings;
            let text = serde_json::json!({
                "role": role, "width": self.width, "height": self.height, "best": best,
                "bits_per_second": bits_per_second, "is_animated": state.stage.is_animated(),
            });
            state.viewers.tell(id, text.to_string());
        }
    }
}

impl SessionState {
    fn control(&mut self, now: Duration, number: u32, controls: Controls) {
        self.stage.control(now, controls);
        self.input = number;
        self.input_at.get_or_insert(now);
        self.calm = now + CALM;
    }

    fn set_limits(&mut self, id: ViewerId, bits_per_second: Option<u32>, best: Option<u32>) {
        let settings = &mut self.settings;
        settings.bits_per_second = bits_per_second.map(|bits| bits.max(LEAST_RATE));
        settings.best = best.map_or(settings.best, |best| best.clamp(1, 32));
        let limits = settings.limits();
        if let Some(flow) = self.viewers.flow(id) {
            flow.set_limits(limits);
        }
    }

    /// Returns the order for a picture at time `now`, if one is due.
    fn next(&mut self, now: Duration) -> Option<Order> {
        let flow = self.viewers.controller_flow()?;
        if !flow.may_send(now) || now < self.due {
            return None;
        }

        // Choose quantiser and detail by motion, credit and quality.
        let moment = self.stage.step(now);
        let is_intra = self.viewers.need_intra(now) || self.shown.is_none();
        let best = self.settings.best;
        let is_moving = self.shown != Some(moment);
        let step = self.rest.next(best, flow.quantiser(PictureKind::Resting, best)).filter(|_| !is_moving);
        let kind = match (is_intra, is_moving) {
            (true, _) => PictureKind::Intra,
            (false, true) => PictureKind::Moving,
            (false, false) => PictureKind::Resting,
        };
        let request = match step {
            Some(step) if step.is_fresh && now < self.calm && !is_intra => return None,
            Some(step) if !is_intra => PictureRequest {
                detail: if step.is_limited { Detail::Plain } else { Detail::Fine },
                is_fresh: step.is_fresh,
                budget: self.budget.at_rest().filter(|_| step.is_limited),
                ..PictureRequest::new(moment, step.quantiser_scale)
            },
            None if !is_moving && !is_intra => return None,
            _ => {
                let quantiser_scale = flow.quantiser(kind, if is_moving { 2 * best } else { best });
                let is_fine = !is_moving || quantiser_scale <= FINE_MOTION;
                let detail = if is_fine { Detail::Fine } else { Detail::Plain };
                // Moving objects change light, so that reprojected light would be wrong.
                let is_limited = is_moving && !self.stage.is_playing();
                let budget = is_limited.then(|| self.budget.in_motion());
                let most_bits = flow.most_bits(kind);
                PictureRequest { detail, is_intra, budget, most_bits, ..PictureRequest::new(moment, quantiser_scale) }
            }
        };
        self.due = now + Duration::from_secs_f64(1.0 / self.settings.pictures_per_second);
        let waited = self.input_at.take().map_or(Duration::ZERO, |at| now.saturating_sub(at));
        Some(Order { request, kind, input: self.input, waited, at: now })
    }

    /// Notes a picture for the refinement of static views, and for the budget of pictures in motion.
    fn note(&mut self, now: Duration, order: &Order, picture: &LivePicture) {
        let PictureRequest { moment, detail, is_fresh, budget, .. } = order.request;
        let seconds = now.saturating_sub(order.at).as_secs_f64();
        if self.shown == Some(moment) {
            self.rest.refined(picture, detail, is_fresh);
            if detail == Detail::Plain {
                self.budget.note_at_rest(seconds);
            }
            return;
        }
        self.rest.moved(picture);
        if budget.is_some() {
            self.budget.note_in_motion(seconds, picture.open_share);
        }
    }

    /// Returns the message with a picture.
    fn message(&self, now: Duration, order: &Order, picture: &LivePicture) -> Bytes {
        let flow = self.viewers.controller_flow();
        let header = PictureHeader {
            is_intra: picture.is_intra(),
            state: PictureState {
                is_playing: self.stage.is_playing(),
                is_moving: order.kind == PictureKind::Moving,
                viewers: self.viewers.count().min(255) as u8,
            },
            sequence: self.sequence,
            input: order.input,
            bits: picture.packet.bits,
            quantiser_scale: picture.packet.quantiser_scale,
            shaded_share: picture.shaded_share,
            threshold: picture.threshold_mean_relative,
            waited: order.waited,
            rendered: now.saturating_sub(order.at),
            seconds: picture.seconds.total,
            rate: flow.map_or(0.0, |flow| flow.rate(now)),
            round_trip: flow.map_or(0.0, |flow| flow.round_trip()),
            process_seconds: ranks::process_seconds(),
        };
        header.with(&picture.packet.data)
    }
}

/// Minimum of a bit rate's limit \[bits/s\].
const LEAST_RATE: u32 = 50_000;
