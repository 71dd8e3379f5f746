//! Streams of any format, in pieces.
//!
//! The first byte selects the size of the pieces and the options.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mpeg2dec::{DecoderOptions, Input, SampleComponent};

fuzz_target!(|data: &[u8]| {
    let Some((&kind, bytes)) = data.split_first() else { return };
    let options = DecoderOptions { show_incomplete: kind & 1 == 1, samples_max: 1 << 18 };
    let (mut input, mut rows, mut captions) = (Input::new(options), 0, 0);
    let mut show = |picture: mpeg2dec::DecodedPicture| {
        rows += SampleComponent::ALL.map(|component| picture.plane(component).rows().count()).iter().sum::<usize>();
        captions += picture.captions().count();
    };
    for piece in bytes.chunks(1 + 30 * usize::from(kind >> 1)) {
        input.push(piece, &mut show);
    }
    input.flush(&mut show);
    assert!(rows > 0 || input.counts().pictures == 0);
});
