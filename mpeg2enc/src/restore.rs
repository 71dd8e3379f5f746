//! Errors of states that an encoder cannot continue from.

use crate::Picture;

/// Reason why an encoder cannot continue from a state.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError {
    /// The state belongs to settings that differ in more than quantiser_scale.
    #[error("the state belongs to an encoder with other settings")]
    OtherSettings,
    /// The state is inconsistent or contradicts its settings.
    #[error("the encoder state is damaged: invalid {what}")]
    Damaged {
        /// Name of the invalid element of the state.
        what: &'static str,
    },
}

/// Returns an error about `what` unless `holds`.
pub(crate) fn ensure(holds: bool, what: &'static str) -> Result<(), RestoreError> {
    if holds { Ok(()) } else { Err(RestoreError::Damaged { what }) }
}

/// Returns whether a frame consists of exactly this many whole macroblocks.
pub(crate) fn is_whole(frame: &Picture, columns: usize, rows: usize) -> bool {
    (frame.width(), frame.height()) == (16 * columns, 16 * rows)
}
