//! Viewers with their queues. One of them is the controller, whose line steers the pictures of all.

use crate::flow::{Flow, FlowLimits, SentPicture};
use axum::body::Bytes;
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::sync::mpsc;

/// Maximum number of messages that wait for a viewer.
const QUEUE: usize = 6;
/// Maximum number of pictures that a watching viewer has not acknowledged.
const UNSEEN: usize = 4;
/// Shortest time between two I pictures for viewers that join or fell behind.
const BETWEEN_INTRA: Duration = Duration::from_millis(700);

/// Number of a viewer in a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ViewerId(u64);

/// Message for a viewer.
#[derive(Clone, Debug)]
pub enum Outgoing {
    /// Picture with its header.
    Picture(Bytes),
    /// Role and settings, as JSON.
    Text(String),
}

#[derive(Debug)]
struct Viewer {
    /// Random name of the page, by which a returning controller is recognized.
    name: String,
    queue: mpsc::Sender<Outgoing>,
    flow: Flow,
    /// Time at which the viewer joined.
    joined: Duration,
    /// Whether the viewer has no reference for P pictures.
    waits: bool,
}

/// All viewers of a session.
#[derive(Debug, Default)]
pub(super) struct Viewers {
    list: BTreeMap<ViewerId, Viewer>,
    controller: Option<ViewerId>,
    /// Name of the last controller, which regains control when it returns.
    last_controller: String,
    next: u64,
    /// Time of the last I picture; `None` before the first one.
    last_intra: Option<Duration>,
}

impl Viewers {
    /// Adds a viewer, which becomes the controller if there is none or if it was the last one.
    pub fn join(&mut self, now: Duration, name: String, limits: FlowLimits) -> (ViewerId, mpsc::Receiver<Outgoing>) {
        let (queue, receiver) = mpsc::channel(QUEUE);
        let id = ViewerId(self.next);
        self.next += 1;
        let returns = !name.is_empty() && name == self.last_controller;
        if self.controller.is_none() || returns {
            self.last_controller.clone_from(&name);
            self.controller = Some(id);
        }
        self.list.insert(id, Viewer { name, queue, flow: Flow::new(limits), joined: now, waits: true });
        (id, receiver)
    }

    /// Removes a viewer. Another one becomes the controller if needed. Returns whether the controller changed.
    pub fn leave(&mut self, id: ViewerId) -> bool {
        let gone = self.list.remove(&id);
        let had_control = self.controller == Some(id);
        if let Some(gone) = gone.filter(|_| had_control) {
            self.last_controller = gone.name;
            self.controller = self.list.keys().next().copied();
        }
        had_control
    }

    /// Removes viewers that have not acknowledged a picture for longer than `patience`; their connections then end.
    /// Returns whether the controller changed.
    pub fn remove_stalled(&mut self, now: Duration, patience: Duration) -> bool {
        let stalled = self.list.iter().filter(|(_, viewer)| viewer.flow.is_stalled(now, patience));
        let stalled: Vec<ViewerId> = stalled.map(|(id, _)| *id).collect();
        let before = self.controller;
        for id in stalled {
            self.leave(id);
        }
        self.controller != before
    }

    /// Gives control to another viewer if the controller has not acknowledged a picture for longer than `patience`.
    pub fn replace_stalled(&mut self, now: Duration, patience: Duration) -> bool {
        let stalled = self.controller.filter(|id| self.list[id].flow.is_stalled(now, patience));
        let Some(stalled) = stalled else { return false };
        // Choose a viewer that has acknowledged everything.
        let others = self.list.iter().find(|(id, viewer)| **id != stalled && viewer.flow.outstanding() == 0);
        let Some((next, _)) = others else { return false };
        self.controller = Some(*next);
        true
    }

    /// Returns the number of viewers.
    pub fn count(&self) -> usize {
        self.list.len()
    }

    /// Returns whether the viewer is the controller.
    pub fn has_control(&self, id: ViewerId) -> bool {
        self.controller == Some(id)
    }

    /// Returns the flow to a viewer.
    pub fn flow(&mut self, id: ViewerId) -> Option<&mut Flow> {
        self.list.get_mut(&id).map(|viewer| &mut viewer.flow)
    }

    /// Notes the answer of a viewer to its first message.
    pub fn answered(&mut self, now: Duration, id: ViewerId) {
        if let Some(viewer) = self.list.get_mut(&id) {
            viewer.flow.answered(now.saturating_sub(viewer.joined));
        }
    }

    /// Returns the flow to the controller.
    pub fn controller_flow(&self) -> Option<&Flow> {
        self.controller.map(|id| &self.list[&id].flow)
    }

    /// Returns whether some viewer needs an I picture that it can receive now.
    pub fn need_intra(&self, now: Duration) -> bool {
        let is_due = self.last_intra.is_none_or(|last| now.saturating_sub(last) >= BETWEEN_INTRA);
        is_due && self.list.values().any(|viewer| viewer.waits && viewer.can_receive())
    }

    /// Returns whether credit or an I picture becomes due without a message of a viewer.
    pub fn needs_time(&self) -> bool {
        self.list.values().any(|viewer| viewer.waits && viewer.can_receive())
    }

    /// Sends a text to a viewer; it is dropped if the queue is full.
    pub fn tell(&self, id: ViewerId, text: String) {
        if let Some(viewer) = self.list.get(&id) {
            let _ = viewer.queue.try_send(Outgoing::Text(text));
        }
    }

    /// Returns all viewers.
    pub fn ids(&self) -> Vec<ViewerId> {
        self.list.keys().copied().collect()
    }

    /// Sends a picture to every viewer that can decode it. A viewer with a full queue waits for the next I picture.
    pub fn send(&mut self, now: Duration, picture: SentPicture, is_intra: bool, message: &Bytes) {
        if is_intra {
            self.last_intra = Some(now);
        }
        for (id, viewer) in &mut self.list {
            let may = Some(*id) == self.controller || viewer.can_receive();
            if viewer.waits && !is_intra {
                continue;
            }
            let is_sent = may && viewer.queue.try_send(Outgoing::Picture(message.clone())).is_ok();
            viewer.waits = !is_sent;
            if is_sent {
                viewer.flow.sent(now, picture);
            }
        }
    }
}

impl Viewer {
    fn can_receive(&self) -> bool {
        self.queue.capacity() > 0 && self.flow.outstanding() < UNSEEN
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::PictureKind;

    #[test]
    fn viewers_that_acknowledge_nothing_are_removed() {
        let limits = FlowLimits { bits_per_second: None, pictures_per_second: 25.0 };
        let (mut viewers, second) = (Viewers::default(), Duration::from_secs);
        let [(silent, mut of_silent), (other, _of_other)] =
            ["a", "b"].map(|name| viewers.join(second(0), name.into(), limits));
        let picture = SentPicture { sequence: 0, bits: 800, quantiser_scale: 8, kind: PictureKind::Intra };
        viewers.send(second(1), picture, true, &Bytes::from_static(b"picture"));
        assert!(viewers.flow(other).unwrap().acknowledged(second(2), 0, Duration::ZERO));

        // The silent one is the controller, so control passes on, and its queue ends.
        assert!(!viewers.remove_stalled(second(31), second(30)) && viewers.has_control(silent));
        assert!(viewers.remove_stalled(second(32), second(30)) && viewers.has_control(other));
        assert_eq!(viewers.ids(), [other]);
        assert!(matches!(of_silent.try_recv(), Ok(Outgoing::Picture(_))) && of_silent.blocking_recv().is_none());
        assert!(!viewers.remove_stalled(second(1000), second(30)));
    }
}
