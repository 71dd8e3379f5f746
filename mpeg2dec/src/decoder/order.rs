//! Reference pictures and display order (6.1.1.11).

use crate::{DecodedPicture, coding::References};

/// The last two I or P pictures.
#[derive(Default)]
pub(super) struct ReferencePictures {
    past: Option<DecodedPicture>,
    future: Option<DecodedPicture>,
    /// Whether `future` was passed to the caller.
    is_shown: bool,
}

impl ReferencePictures {
    /// Returns the reference frames of a B picture, or of an I or P picture.
    pub fn of(&self, is_b: bool) -> References<'_> {
        let future = self.future.as_ref().map(|picture| &*picture.frame);
        let past = self.past.as_ref().map(|picture| &*picture.frame);
        if is_b { References { past, future } } else { References { past: future, future: None } }
    }

    /// Returns whether there is a reference for P pictures.
    pub fn has_one(&self) -> bool {
        self.future.is_some()
    }

    /// Returns whether there are two references for B pictures.
    pub fn has_two(&self) -> bool {
        self.past.is_some() && self.future.is_some()
    }

    /// Passes the last reference picture to `show` unless this was done before.
    pub fn show_last(&mut self, show: &mut dyn FnMut(DecodedPicture)) {
        if let Some(picture) = self.future.as_ref().filter(|_| !self.is_shown) {
            show(picture.clone());
            self.is_shown = true;
        }
    }

    /// Adds a reference picture, which was shown if `is_shown`.
    pub fn add(&mut self, picture: DecodedPicture, is_shown: bool) {
        self.past = self.future.replace(picture);
        self.is_shown = is_shown;
    }

    /// Removes all references.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}
