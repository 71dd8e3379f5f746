//! WebSocket of a viewer: pictures out, messages in.

use super::connections::Activity;
use super::guard::value;
use super::{Shared, page, refusal};
use crate::message::ViewerMessage;
use crate::session::{Joined, Outgoing, Refusal};
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade};
use axum::extract::{ConnectInfo, State};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::Response;
use std::fmt::Display;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Maximum length of a viewer's message \[bytes\].
const LONGEST: usize = 1024;
/// Maximum number of messages that a viewer may send at once, and per second.
const MESSAGES: f64 = 300.0;
/// Time in which the system must accept a picture.
const PATIENCE: Duration = Duration::from_secs(10);
/// Maximum length of the name of a page.
const NAME: usize = 32;
/// Close code for messages that no page sends (RFC 6455, 7.4.1).
const POLICY: u16 = 1008;

/// Accepts the WebSocket of a viewer.
pub(super) async fn upgrade(
    State(shared): State<Arc<Shared>>,
    ConnectInfo(activity): ConnectInfo<Activity>,
    uri: Uri,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    let host = shared.guard.host(&headers).unwrap_or_default();
    if !shared.guard.is_own_page(&headers, &host) {
        shared.notes.note(activity.address(), "wrong Origin");
        return page::with_headers(refusal(StatusCode::FORBIDDEN, "wrong Origin"), &host);
    }
    let name: String = value(uri.query(), "client").unwrap_or_default().chars().take(NAME).collect();
    let joined = match shared.session.join(name) {
        Ok(joined) => joined,
        Err(Refusal::Full) => {
            shared.notes.note(activity.address(), "too many viewers");
            return refusal(StatusCode::SERVICE_UNAVAILABLE, "all places are taken");
        }
        Err(Refusal::Ended) => return refusal(StatusCode::SERVICE_UNAVAILABLE, "the session has ended"),
    };
    // Leave even if the upgrade fails: then the guard is dropped without a call.
    let place = Place { shared, activity, id: joined.id };
    let upgrade = upgrade.max_message_size(LONGEST).max_frame_size(LONGEST);
    upgrade.on_upgrade(move |socket| serve(socket, joined, place))
}

/// Place of a viewer in the session, which it leaves when dropped.
struct Place {
    shared: Arc<Shared>,
    activity: Activity,
    id: crate::session::ViewerId,
}

impl Drop for Place {
    fn drop(&mut self) {
        self.shared.session.leave(self.id);
    }
}

impl Place {
    /// Logs why the viewer is disconnected.
    fn note(&self, reason: impl Display) {
        self.shared.notes.note(self.activity.address(), reason);
    }
}

/// Sends pictures and receives messages until either side ends.
async fn serve(mut socket: WebSocket, mut joined: Joined, place: Place) {
    place.activity.becomes_viewer();
    let mut allowance = Allowance::new(Instant::now());
    loop {
        tokio::select! {
            outgoing = joined.messages.recv() => {
                let Some(outgoing) = outgoing else {
                    if !place.shared.session.has_ended() {
                        place.note("a viewer did not answer");
                    }
                    break;
                };
                let message = match outgoing {
                    Outgoing::Picture(bytes) => Message::Binary(bytes),
                    Outgoing::Text(text) => Message::Text(text.into()),
                };
                match tokio::time::timeout(PATIENCE, socket.send(message)).await {
                    Ok(Ok(())) => {}
                    Ok(Err(_)) => break,
                    Err(_) => {
                        place.note("a viewer did not read");
                        break;
                    }
                }
            }
            incoming = socket.recv() => {
                let message = match incoming {
                    Some(Ok(message)) => message,
                    Some(Err(error)) => {
                        place.note(error);
                        break;
                    }
                    None => break,
                };
                if let Err(reason) = receive(&message, &place, &mut allowance) {
                    place.note(reason);
                    let frame = CloseFrame { code: POLICY, reason: reason.into() };
                    let _ = tokio::time::timeout(PATIENCE, socket.send(Message::Close(Some(frame)))).await;
                    break;
                }
            }
        }
    }
}

/// Applies a message of a viewer.
///
/// # Errors
/// If no page sends such a message, or a page sends fewer messages.
fn receive(message: &Message, place: &Place, allowance: &mut Allowance) -> Result<(), &'static str> {
    if !allowance.take(Instant::now()) {
        return Err("too many messages");
    }
    match message {
        Message::Text(text) => {
            let message: ViewerMessage = serde_json::from_str(text).map_err(|_| "unknown message")?;
            place.shared.session.receive(place.id, message);
            Ok(())
        }
        Message::Binary(_) => Err("unknown message"),
        Message::Ping(_) | Message::Pong(_) | Message::Close(_) => Ok(()),
    }
}

/// Number of messages that a viewer may send now.
struct Allowance {
    messages: f64,
    at: Instant,
}

impl Allowance {
    fn new(at: Instant) -> Self {
        Self { messages: MESSAGES, at }
    }

    /// Takes one message; returns false if none is left.
    fn take(&mut self, now: Instant) -> bool {
        let passed = now.saturating_duration_since(self.at).as_secs_f64();
        self.messages = (self.messages + passed * MESSAGES).min(MESSAGES) - 1.0;
        self.at = now;
        self.messages >= 0.0
    }
}
