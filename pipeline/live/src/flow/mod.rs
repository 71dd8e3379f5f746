//! Flow of pictures to one viewer: credit, budget and quantiser, from acknowledgements alone.
//!
//! ```text
//! send if fewer than 2 pictures are unacknowledged, and the oldest is not late
//!
//! excess d = round trip − shortest round trip
//! budget B ← B · 1.15                       d < D / 2 and the picture used most of B
//!        B ← B · clamp(b D / (B d), ½, 0.95)  d > D                b  bits of the picture
//!
//! quantiser q = c / B                       c = mean of b · q over pictures of the same kind
//! code again with a coarser quantiser if b > 1.5 B
//! ```
//! The excess contains the time on the line and in queues, so B approaches the bits that the line carries in D. The
//! state machine has no clock: callers pass the time since any fixed moment.

mod complexity;
mod rate;

pub use complexity::PictureKind;

use crate::picture::{COARSEST, nearest_quantiser};
use complexity::Complexities;
use rate::DeliveredBits;
use std::collections::VecDeque;
use std::time::Duration;

/// Maximum number of unacknowledged pictures.
const CREDIT: usize = 2;
/// Target D of a picture's time on the line and in queues \[s\].
const EXCESS: f64 = 0.08;
/// Factor by which the budget grows with each picture.
const GROWTH: f64 = 1.15;
/// Bounds of the factor by which a late picture reduces the budget.
const SHRINKING: (f64, f64) = (0.5, 0.95);
/// Fraction of the budget that a picture must use for growth.
const USED: f64 = 0.5;
/// Budget before the first acknowledgement \[bits\].
const BEGIN: f64 = 64_000.0;
/// Minimum and maximum budget \[bits\].
const BUDGETS: (f64, f64) = (1_000.0, 8e6);
/// Multiple of the budget for an I picture, which costs more bits than others and is rare.
const INTRA: f64 = 3.0;
/// Multiple of the budget that a picture may cost. A line delays a more costly picture, and all pictures after it.
const MOST: f64 = 1.5;
/// Fraction by which the shortest round trip approaches a longer one, so that changes of the route are noticed.
const FORGETTING: f64 = 1e-4;

/// Limits chosen by the user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowLimits {
    /// Maximum bit rate \[bits/s\]; `None` for no limit.
    pub bits_per_second: Option<u32>,
    /// Maximum number of pictures per second.
    pub pictures_per_second: f64,
}

/// Picture on its way to the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SentPicture {
    /// Number of the picture.
    pub sequence: u32,
    /// Size \[bits\].
    pub bits: u64,
    /// quantiser_scale.
    pub quantiser_scale: u32,
    /// Kind of picture, whose later pictures have similar sizes.
    pub kind: PictureKind,
}

/// State of the flow to one viewer.
#[derive(Clone, Debug)]
pub struct Flow {
    limits: FlowLimits,
    outstanding: VecDeque<Outstanding>,
    /// Budget of a picture \[bits\].
    budget: f64,
    /// Shortest round trip \[s\]; infinite before the first one.
    shortest: f64,
    /// Last round trip \[s\].
    round_trip: f64,
    complexities: Complexities,
    delivered: DeliveredBits,
}

/// Unacknowledged picture, and the time at which it was sent.
#[derive(Clone, Copy, Debug)]
struct Outstanding {
    at: Duration,
    picture: SentPicture,
}

impl Flow {
    /// Creates the state for a new viewer.
    #[must_use]
    pub fn new(limits: FlowLimits) -> Self {
        Self {
            limits,
            outstanding: VecDeque::new(),
            budget: BEGIN,
            shortest: f64::INFINITY,
            round_trip: 0.0,
            complexities: Complexities::default(),
            delivered: DeliveredBits::default(),
        }
    }

    /// Changes the limits.
    pub fn set_limits(&mut self, limits: FlowLimits) {
        self.limits = limits;
    }

    /// Returns whether a picture may be rendered and sent at time `now`.
    #[must_use]
    pub fn may_send(&self, now: Duration) -> bool {
        // Let no second picture follow one that is late.
        let patience = EXCESS + if self.shortest.is_finite() { self.shortest } else { 0.0 };
        let is_late = |sent: &Outstanding| now.saturating_sub(sent.at).as_secs_f64() > patience;
        self.outstanding.len() < CREDIT && !self.outstanding.front().is_some_and(is_late)
    }

    /// Returns whether the oldest unacknowledged picture was sent more than `patience` ago.
    #[must_use]
    pub fn is_stalled(&self, now: Duration, patience: Duration) -> bool {
        self.outstanding.front().is_some_and(|sent| now.saturating_sub(sent.at) > patience)
    }

    /// Returns the number of unacknowledged pictures.
    #[must_use]
    pub fn outstanding(&self) -> usize {
        self.outstanding.len()
    }

    /// Returns the quantiser_scale for the next picture of a `kind`, no finer than `finest`.
    #[must_use]
    pub fn quantiser(&self, kind: PictureKind, finest: u32) -> u32 {
        let quantiser = self.complexities.of(kind).map_or(8.0, |complexity| complexity / self.budget_of(kind));
        nearest_quantiser(quantiser.max(finest.into())).min(COARSEST)
    }

    /// Returns the maximum size of the next picture of a `kind` \[bits\]: a more costly one should be coded again with a
    /// coarser quantiser. Pictures of a static view have no maximum.
    #[must_use]
    pub fn most_bits(&self, kind: PictureKind) -> Option<u64> {
        (kind != PictureKind::Resting).then(|| (MOST * self.budget_of(kind)) as u64)
    }

    /// Returns the budget of a picture of a `kind` \[bits\].
    fn budget_of(&self, kind: PictureKind) -> f64 {
        self.budget() * if kind == PictureKind::Intra { INTRA } else { 1.0 }
    }

    /// Returns the budget of a picture \[bits\].
    #[must_use]
    pub fn budget(&self) -> f64 {
        let limit = self.limits.bits_per_second.map(|rate| f64::from(rate) / self.limits.pictures_per_second);
        self.budget.min(limit.unwrap_or(f64::INFINITY))
    }

    /// Notes that a picture is on its way.
    pub fn sent(&mut self, now: Duration, picture: SentPicture) {
        self.complexities.add(picture.kind, picture.bits as f64 * f64::from(picture.quantiser_scale));
        self.outstanding.push_back(Outstanding { at: now, picture });
    }

    /// Notes the round trip of a message without content.
    pub fn answered(&mut self, round_trip: Duration) {
        self.shortest = self.shortest.min(round_trip.as_secs_f64());
    }

    /// Notes the acknowledgement of a picture and of all earlier ones. The viewer kept the picture for `held` before it
    /// sent the acknowledgement. Returns false for a picture that is not on its way.
    pub fn acknowledged(&mut self, now: Duration, sequence: u32, held: Duration) -> bool {
        let Some(place) = self.outstanding.iter().position(|sent| sent.picture.sequence == sequence) else {
            return false;
        };
        for _ in 0..place {
            self.outstanding.pop_front();
        }
        let Some(Outstanding { at, picture }) = self.outstanding.pop_front() else { return false };
        self.delivered.add(now, picture.bits);

        // Update the shortest round trip, without the time at the viewer.
        let whole = now.saturating_sub(at);
        self.round_trip = whole.saturating_sub(held.min(whole)).as_secs_f64();
        self.shortest = match self.shortest.is_finite() {
            true => self.round_trip.min(self.shortest + FORGETTING * (self.round_trip - self.shortest)),
            false => self.round_trip,
        };
        self.adapt(picture.bits as f64, self.round_trip - self.shortest);
        true
    }

    /// Adapts the budget to a picture of `bits` with an `excess` of its round trip \[s\].
    fn adapt(&mut self, bits: f64, excess: f64) {
        let (least, most) = BUDGETS;
        if excess > EXCESS {
            let factor = (bits * EXCESS / (self.budget * excess)).clamp(SHRINKING.0, SHRINKING.1);
            self.budget = (self.budget * factor).max(least);
        } else if excess < EXCESS / 2.0 && bits > USED * self.budget {
            self.budget = (self.budget * GROWTH).min(most);
        }
    }

    /// Returns the rate of acknowledged pictures over the last second \[bits/s\].
    #[must_use]
    pub fn rate(&self, now: Duration) -> f64 {
        self.delivered.rate(now)
    }

    /// Returns the last round trip \[s\].
    #[must_use]
    pub fn round_trip(&self) -> f64 {
        self.round_trip
    }
}
