//! Pulldown: 24 pictures per second in a stream of 30 frames per second, as on discs. Pictures are alternately displayed for
//! three and two fields (repeat_first_field, 13818-2, 6.3.10).

/// Returns the number of fields in the time of `periods` pictures, starting with a picture of three fields.
pub(crate) fn fields(periods: u64) -> u64 {
    (5 * periods).div_ceil(2)
}

/// Display of a picture, as coded in the picture coding extension.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ShownFields {
    /// Whether the top field is displayed first (top_field_first).
    pub top_field_first: bool,
    /// Whether the first field is displayed again after the second one (repeat_first_field).
    pub repeat_first_field: bool,
}

/// Returns the displayed fields of picture `number`, counted in display order. With B pictures, each picture is displayed at
/// least one period after decoding: `reorder` is then 1, otherwise 0. Decoding and display then have the same rhythm of fields.
pub(crate) fn shown(number: u64, reorder: u64) -> ShownFields {
    let before = fields_before(number, reorder);
    let own = fields_before(number + 1, reorder) - before;
    ShownFields { top_field_first: before.is_multiple_of(2), repeat_first_field: own == 3 }
}

/// Returns the number of fields displayed before picture `number`.
pub(crate) fn fields_before(number: u64, reorder: u64) -> u64 {
    fields(number + reorder) - fields(reorder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_pictures_make_five_frames() {
        for reorder in [0, 1] {
            assert_eq!(fields_before(4, reorder), 10);
            let flags = (0..4).map(|number| shown(number, reorder));
            assert_eq!(flags.filter(|shown| shown.repeat_first_field).count(), 2);
            // The next cycle begins with the same field.
            assert_eq!(shown(4, reorder), shown(0, reorder));
        }
        assert_eq!([0, 1, 2, 3].map(|number| fields_before(number, 0)), [0, 3, 5, 8]);
        assert_eq!([0, 1, 2, 3].map(|number| fields_before(number, 1)), [0, 2, 5, 7]);
    }
}
