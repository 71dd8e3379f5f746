//! The loop on every rank except 0: it prepares and shades the frames that rank 0 orders.

use super::stages::Shading;
use super::threads::{self, Stage, stage};
use crate::error::{Error, Result};
use crate::stage::{Prepare, Prepared, Shade};
use crate::team::{Order, Team};
use crossbeam_channel::{Receiver, Sender, bounded};
use ranks::Ranks;

/// Prepares and shades the frames of a film that rank 0 leads.
///
/// # Errors
/// If the ranks computed different light, or rank 0 sends invalid orders.
pub fn follow<P: Prepare, S: Shade<P::Frame>>(mut prepare: P, mut shade: S, team: &Team) -> Result<()> {
    let orders = &*team.shade;

    // Receive the common initial state of all ranks.
    let first = match Order::next(orders)? {
        Order::Start { first, restored } => {
            if let Some(state) = restored {
                let done = prepare.restore(&state.prepare, state.last)?;
                shade.restore(&state.shade, &done)?;
            }
            first
        }
        order => return ended(&order),
    };
    // Wait for the decision of rank 0 whether the first frame starts.
    let goes_on = loop {
        match Order::next(orders)? {
            Order::Ready => prepare.make_ready(),
            Order::Begin { goes_on } => break goes_on,
            order => return ended(&order),
        }
    };

    // Each message permits preparation of one frame: as on rank 0, preparation is one frame ahead.
    let (turns_out, turns_in) = bounded(1);
    let (prepared_out, prepared_in) = bounded(1);
    if goes_on {
        let _ = turns_out.send(());
    }
    let shading = Shading::new(shade, team.shade.clone());
    threads::run([
        stage("shade", move || shade_all(shading, orders, &prepared_in, turns_out)),
        stage("prepare", move || {
            for (index, ()) in (first..).zip(turns_in) {
                let Some(prepared) = prepare.step(index) else { break };
                // Ignore a closed channel: shading may have ended. This rank must still prepare every frame that rank 0
                // prepares.
                let _ = prepared_out.send(prepared);
            }
            Ok(())
        }),
    ])
}

/// Shades the frames that rank 0 orders, in order of preparation. An order may permit preparation of another frame.
fn shade_all<F, S: Shade<F>>(
    mut shading: Shading<S, F>,
    orders: &dyn Ranks,
    prepared: &Receiver<Prepared<F>>,
    turns: Sender<()>,
) -> Result<()> {
    let give_turn = |goes_on: bool| {
        if goes_on {
            let _ = turns.send(());
        }
    };

    // Follow the orders of rank 0 until it announces the end.
    let mut result = Ok(());
    loop {
        match Order::next(orders)? {
            Order::Frame { index, marked, goes_on, thresholds } if result.is_ok() => {
                give_turn(goes_on);
                let Ok(prepared) = prepared.recv() else {
                    return Err(Error::Fault(format!("frame {index} is not prepared here")));
                };
                // Store an error, but continue: if light differs, every rank detects it, and rank 0 orders the end.
                result = shading.step(index, (prepared, thresholds.map(Order::thresholds))).map(drop);
                // Compute the state at the same time as rank 0, which gathers data from all ranks.
                if marked && result.is_ok() {
                    let _ = shading.state()?;
                }
            }
            Order::End { state_wanted, goes_on } => {
                give_turn(goes_on);
                if state_wanted {
                    let _ = shading.state()?;
                }
                return result;
            }
            order => return Err(unexpected(&order)),
        }
    }
}

/// Returns the result of a film that rank 0 ends before its first frame.
fn ended(order: &Order) -> Result<()> {
    match order {
        Order::End { .. } => Ok(()),
        order => Err(unexpected(order)),
    }
}

fn unexpected(order: &Order) -> Error {
    let name = match order {
        Order::Start { .. } => "to start",
        Order::Ready => "to make the common state",
        Order::Begin { .. } => "to begin",
        Order::Frame { .. } => "to make a frame",
        Order::End { .. } => "to end",
    };
    Error::Fault(format!("rank 0 ordered {name} at the wrong time"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::LastThresholds;
    use crate::stage::Shaded;
    use crate::team::Lead;
    use ranks::{ThreadMail, ThreadRanks};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::time::Duration;

    /// Slow preparation that counts frames.
    struct Slow(Arc<AtomicU32>);

    impl Prepare for Slow {
        type Frame = ();

        fn step(&mut self, _: u32) -> Option<Prepared<()>> {
            std::thread::sleep(Duration::from_millis(100));
            self.0.fetch_add(1, Ordering::Relaxed);
            Some(Prepared::default())
        }

        fn restore(&mut self, _: &[u8], _: u32) -> Result<Prepared<()>> {
            unreachable!("a film that begins")
        }
    }

    /// Shading that computes nothing.
    struct Dark;

    impl Shade<()> for Dark {
        fn step(&mut self, _: &Prepared<()>, _: LastThresholds<'_>) -> Shaded {
            unreachable!("no frame is ordered")
        }

        fn restore(&mut self, _: &[u8], _: &Prepared<()>) -> Result<()> {
            unreachable!("a film that begins")
        }
    }

    /// Checks that a frame is prepared on all ranks although rank 0 fails while preparing it, and it is never shaded.
    #[test]
    fn frames_in_preparation_are_finished_after_the_end() {
        let prepared = Arc::new(AtomicU32::new(0));
        let [first, second]: [Arc<dyn Ranks>; 2] = ThreadRanks::new(2)
            .into_iter()
            .map(|rank| Arc::new(rank) as Arc<dyn Ranks>)
            .collect::<Vec<_>>()
            .try_into()
            .unwrap();
        let mut lead = Lead::of(first);
        lead.start(0, None);
        lead.begin(true);
        lead.notes(true);
        lead.end(false);
        let team = Team { prepare: second.clone(), shade: second, mail: Arc::new(ThreadMail::alone()) };
        follow(Slow(prepared.clone()), Dark, &team).expect("an end in order");
        assert_eq!(prepared.load(Ordering::Relaxed), 2);
    }
}
