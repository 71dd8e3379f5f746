//! Pictures and maps for a film's page, collected while the film is made, in bounded memory.

use super::film_file::coded_pictures;
use super::frame_maps::FrameMaps;
use super::map::ImportanceSum;
use super::pictures::{factor, jpeg, mean_color, shrunk};
use super::stream::{PageStream, Playback, player};
use super::svg::Svg;
use minijinja::{Value, context};
use mpeg2enc::AccessUnit;
use perceptual::{ColorMatrix, to_rgb8_by};
use pipeline::observe::Observer;
use pipeline::stage::{CodedUnit, Shaded};
use plane::{Picture, Plane};
use render2mpeg::error::Result;
use render2mpeg::settings::{CodedRate, Settings};
use std::ops::{Range, RangeInclusive};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum length of the embedded stream \[bytes\]. Browsers open pages of this size within a few seconds.
const STREAM_MAX: usize = 32 << 20;
/// Maximum side of the poster \[pixels\], and its JPEG quality.
const POSTER: (usize, u8) = (960, 85);

/// Observer that keeps the data of a film's page: the stream, the middle frame as a poster, and maps of one frame.
#[derive(Debug)]
pub struct FilmWatch {
    frames: Range<u32>,
    /// Number of pictures per second, and of pictures per frame.
    rate: (f64, u32),
    matrix: ColorMatrix,
    /// Permitted error of a pixel without a threshold, as a fraction of its luminance.
    share_elsewhere: f32,
    held: Mutex<Held>,
    importance: ImportanceSum,
}

#[derive(Debug)]
struct Held {
    stream: PageStream,
    /// Decoded frame nearest to the middle of the film.
    middle: Option<KeptPicture>,
    maps: Option<FrameMaps>,
}

/// Decoded frame with its index.
#[derive(Clone, Debug)]
struct KeptPicture {
    index: u32,
    picture: Picture,
}

impl FilmWatch {
    /// Returns the observer of a film with the given settings.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let fps = settings.render.fps;
        Self {
            frames: settings.frame_range(),
            rate: CodedRate::of(fps).map_or((fps, 1), |coded| (coded.rate.fps(), coded.pictures)),
            matrix: settings.matrix(),
            share_elsewhere: settings.render.thresholds.share_elsewhere(),
            held: Mutex::new(Held { stream: PageStream::new(STREAM_MAX), middle: None, maps: None }),
            importance: ImportanceSum::default(),
        }
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the distance of frame `index` from the middle of the film \[frames\].
    fn distance_to_middle(&self, index: u32) -> u32 {
        index.abs_diff(self.frames.start + self.frames.len() as u32 / 2)
    }

    /// Returns the middle frame as a small picture, with its index.
    pub(super) fn poster(&self) -> Result<Option<Value>> {
        let held = self.held();
        let Some(KeptPicture { index, picture }) = &held.middle else { return Ok(None) };
        let factor = factor(picture.width(), picture.height(), POSTER.0);
        let small = shrunk(&to_rgb8_by(picture, self.matrix), factor, mean_color);
        Ok(Some(context! { index, uri => jpeg(&small, POSTER.1)? }))
    }

    /// Returns the data of the player; `None` without pictures.
    pub(super) fn player(&self) -> Result<Option<Value>> {
        let held = self.held();
        let Some(shown) = self.shown(&held.stream) else { return Ok(None) };
        let (rate, repeats) = self.rate;
        let playback =
            Playback { rate, first: (*shown.start()).into(), repeats: repeats.into(), start: 0, plays: true };
        player(&[&held.stream], playback).map(Some)
    }

    /// Reads the frames that were not observed, as in a resumed film, from the film's file. MP4 and Matroska are not read.
    pub(super) fn add_earlier_frames(&self, film: &Path) {
        let mut held = self.held();
        if self.shown(&held.stream).is_some_and(|shown| *shown.start() == self.frames.start) {
            return;
        }
        let Some(pictures) = coded_pictures(film, STREAM_MAX) else { return };
        let first = u64::from(self.frames.start) * u64::from(self.rate.1);
        held.stream = PageStream::new(STREAM_MAX);
        for AccessUnit { data: bytes, display_index, picture_type } in pictures {
            held.stream.push(&CodedUnit { position: first + display_index, picture_type, bytes });
        }
    }

    /// Returns whether the player shows a frame.
    pub(super) fn plays(&self, index: u32) -> bool {
        self.shown(&self.held().stream).is_some_and(|shown| shown.contains(&index))
    }

    /// Returns the frames of a stream.
    fn shown(&self, stream: &PageStream) -> Option<RangeInclusive<u32>> {
        let frame = |position: u64| u32::try_from(position / u64::from(self.rate.1)).unwrap_or(u32::MAX);
        stream.positions().map(|range| frame(*range.start())..=frame(*range.end()))
    }

    /// Describes the frames that the player does not show, if any.
    pub(super) fn omitted(&self) -> Option<String> {
        let held = self.held();
        let shown = self.shown(&held.stream);
        let frames = match &shown {
            Some(shown) => format!("The player has frames {} to {}", shown.start(), shown.end()),
            None => "The player has no frames".into(),
        };
        // A resumed film is observed from its first new frame on.
        let is_resumed = shown.map_or(held.middle.is_some(), |shown| *shown.start() > self.frames.start);
        if held.stream.is_cut() {
            Some(format!("{frames}: pages contain at most {} MiB of a film.", STREAM_MAX >> 20))
        } else {
            is_resumed.then(|| format!("{frames}: the film was resumed, and its format is not read."))
        }
    }

    /// Returns the maps, and the index of the frame they show.
    pub(super) fn maps(&self) -> Option<(u32, Vec<Value>)> {
        let held = self.held();
        held.maps.as_ref().map(|maps| (maps.index, maps.drawn()))
    }

    /// Returns the map of mean importance, if the film has importance.
    pub(super) fn importance(&self) -> Option<Svg> {
        self.importance.draw()
    }
}

/// Observes pictures in coding order, which differs from frame order with B pictures.
impl Observer for FilmWatch {
    fn shaded(&self, index: u32, shaded: &Shaded) {
        // Prefer the frame nearest to the middle of the film.
        let is_nearer = |kept: &FrameMaps| self.distance_to_middle(index) < self.distance_to_middle(kept.index);
        if self.held().maps.as_ref().is_none_or(is_nearer) {
            let maps = FrameMaps::new(index, shaded, self.share_elsewhere);
            self.held().maps = Some(maps);
        }
    }

    fn importance(&self, _index: u32, importance: &Plane<f32>) {
        self.importance.add(importance);
    }

    fn decoded(&self, index: u32, picture: &Picture) {
        let mut held = self.held();
        let is_nearer = |kept: &KeptPicture| self.distance_to_middle(index) < self.distance_to_middle(kept.index);
        if held.middle.as_ref().is_none_or(is_nearer) {
            held.middle = Some(KeptPicture { index, picture: picture.clone() });
        }
    }

    fn coded(&self, unit: &CodedUnit) {
        self.held().stream.push(unit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plane::PictureType;
    use render_core::scene::Scene;
    use render2mpeg::Options;

    fn watch(frames: u32, fps: f64) -> FilmWatch {
        let options = Options { frames: Some(frames), fps: Some(fps), ..Options::default() };
        FilmWatch::new(&Settings::new("scene.glb".into(), &Scene::default(), &options).unwrap())
    }

    #[test]
    fn the_poster_is_the_middle_frame() {
        for (planned, made, expected) in [(1, 1, 0), (3, 3, 1), (100, 10, 9), (1000, 1000, 500)] {
            let film = watch(planned, 24.0);
            assert!(film.poster().unwrap().is_none());
            (0..made).for_each(|index| film.decoded(index, &Picture::black(16, 16)));
            let poster = film.poster().unwrap().expect("a frame");
            assert_eq!(poster.get_attr("index").unwrap(), Value::from(expected), "{planned} {made}");
        }
    }

    /// Adds an I picture of a film.
    fn push(film: &FilmWatch, position: u64, length: usize) {
        film.coded(&CodedUnit { position, picture_type: PictureType::I, bytes: vec![0; length] });
    }

    #[test]
    fn frames_without_pictures_in_the_page_are_listed() {
        let film = watch(10, 12.0);
        assert!(film.player().unwrap().is_none() && film.omitted().is_none());
        // At 24 pictures per second, each frame has two pictures.
        (0..6).for_each(|position| push(&film, position, 100));
        assert!(film.player().unwrap().is_some() && film.omitted().is_none());
        push(&film, 6, STREAM_MAX);
        push(&film, 7, 100);
        let omitted = film.omitted().expect("a line");
        assert!(omitted.contains("frames 0 to 2: pages contain at most 32 MiB"), "{omitted}");

        let resumed = watch(10, 24.0);
        push(&resumed, 4, 100);
        assert!(resumed.omitted().expect("a line").contains("frames 4 to 4: the film was resumed"));
        let huge = watch(10, 24.0);
        push(&huge, 0, STREAM_MAX + 1);
        assert!(huge.player().unwrap().is_none() && huge.omitted().expect("a line").contains("no frames: pages"));
    }
}
