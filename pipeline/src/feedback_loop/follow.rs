//! The loop on a rank that follows: it prepares and shades what rank 0 says, and nothing else.

use super::stages::Shading;
use super::threads::{self, Stage, stage};
use crate::error::{Error, Result};
use crate::parts::{Prepare, Prepared, Shade};
use crate::ranks::{Order, Team};
use crossbeam_channel::{Receiver, Sender, bounded};
use render_core::ranks::Ranks;

/// Makes the frames of a film that rank 0 leads, up to their light.
///
/// # Errors
/// The ranks have found different light, or what rank 0 says makes no sense.
pub(crate) fn follow<P: Prepare, S: Shade<P::Frame>>(mut prepare: P, mut shade: S, team: &Team) -> Result<()> {
    let orders = &*team.shade;

    // The state that all begin with.
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
    let goes_on = match Order::next(orders)? {
        Order::Begin { goes_on } => goes_on,
        order => return ended(&order),
    };

    // Preparation works one frame ahead, as on rank 0: each turn lets it make one.
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
                if prepared_out.send(prepared).is_err() {
                    break;
                }
            }
            Ok(())
        }),
    ])
}

/// Shades the frames that rank 0 names, as they are prepared. Each order may give preparation a turn.
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
    let mut result = Ok(());
    loop {
        match Order::next(orders)? {
            Order::Frame { index, marked, goes_on, thresholds } if result.is_ok() => {
                give_turn(goes_on);
                let Ok(prepared) = prepared.recv() else {
                    return Err(Error::Fault(format!("frame {index} is not prepared here")));
                };
                // All ranks know if light differs, and rank 0 says that it ends.
                result = shading.step(index, (prepared, thresholds.map(Order::thresholds))).map(drop);
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

/// The result where rank 0 ends before the first frame.
fn ended(order: &Order) -> Result<()> {
    match order {
        Order::End { .. } => Ok(()),
        order => Err(unexpected(order)),
    }
}

fn unexpected(order: &Order) -> Error {
    let name = match order {
        Order::Start { .. } => "to start",
        Order::Begin { .. } => "to begin",
        Order::Frame { .. } => "to make a frame",
        Order::End { .. } => "to end",
    };
    Error::Fault(format!("rank 0 says {name} out of turn"))
}
