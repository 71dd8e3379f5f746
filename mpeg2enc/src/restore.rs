//! States that an encoder cannot continue from.

use crate::Picture;

/// A state that an encoder cannot continue from.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError {
    /// The state is of an encoder with other settings than quantiser_scale.
    #[error("the state is of an encoder with other settings")]
    OtherSettings,
    /// The state contradicts itself or its settings.
    #[error("the state of the encoder is damaged: {what}")]
    Damaged {
        /// The part that is wrong.
        what: &'static str,
    },
}

/// Refuses a state of which `holds` does not hold.
pub(crate) fn ensure(holds: bool, what: &'static str) -> Result<(), RestoreError> {
    if holds { Ok(()) } else { Err(RestoreError::Damaged { what }) }
}

/// Whether a frame consists of this many whole macroblocks.
pub(crate) fn is_whole(frame: &Picture, columns: usize, rows: usize) -> bool {
    (frame.width(), frame.height()) == (16 * columns, 16 * rows)
}
