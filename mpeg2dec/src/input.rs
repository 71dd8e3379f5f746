//! Decoder of streams in any supported container.

use crate::{DecodedPicture, Decoder, DecoderCounts, DecoderOptions, Demuxer, Sequence, StreamFormat};

/// A [`Demuxer`] with a [`Decoder`].
///
/// The format is recognized from the first bytes. See the example of the [crate].
#[derive(Default)]
pub struct Input {
    demuxer: Demuxer,
    decoder: Decoder,
}

impl Input {
    /// Returns an input with options of its decoder.
    #[must_use]
    pub fn new(options: DecoderOptions) -> Self {
        Self { demuxer: Demuxer::default(), decoder: Decoder::new(options) }
    }

    /// Decodes bytes, in pieces of any size, and passes complete pictures to `show`.
    pub fn push(&mut self, bytes: &[u8], mut show: impl FnMut(DecodedPicture)) {
        let Self { demuxer, decoder } = self;
        demuxer.push(bytes, |data| {
            if let Some(time) = data.time {
                decoder.set_time(time);
            }
            decoder.receive(data.bytes, &mut show);
        });
    }

    /// Ends the stream: passes the remaining pictures to `show`. The input then accepts another stream.
    pub fn flush(&mut self, mut show: impl FnMut(DecodedPicture)) {
        let Self { demuxer, decoder } = self;
        demuxer.flush(|data| {
            if let Some(time) = data.time {
                decoder.set_time(time);
            }
            decoder.receive(data.bytes, &mut show);
        });
        decoder.end(&mut show);
    }

    /// Returns the format of the stream, after its first bytes were recognized.
    #[must_use]
    pub fn format(&self) -> Option<StreamFormat> {
        self.demuxer.format()
    }

    /// Returns the current sequence, after its first picture has started.
    #[must_use]
    pub fn sequence(&self) -> Option<&Sequence> {
        self.decoder.sequence()
    }

    /// Returns the numbers of pictures and errors.
    #[must_use]
    pub fn counts(&self) -> DecoderCounts {
        DecoderCounts { lost_packets: self.demuxer.lost_packets(), ..self.decoder.counts() }
    }
}
