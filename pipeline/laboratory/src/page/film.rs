//! Pictures and maps for a film's page, collected while the film is made, in bounded memory.

use super::frame_maps::FrameMaps;
use super::map::ImportanceSum;
use super::pictures::{Rgb, factor, jpeg, mean_color, shrunk};
use super::svg::Svg;
use minijinja::{Value, context};
use perceptual::{ColorMatrix, to_rgb8_by};
use pipeline::observe::Observer;
use pipeline::stage::Shaded;
use plane::{Picture, Plane};
use render2mpeg::error::Result;
use render2mpeg::settings::Settings;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum number of pictures in the strip, and maximum side of each picture \[pixels\].
const STRIP: (u32, usize) = (48, 320);
/// Maximum and minimum rate of the strip \[pictures per second\].
const PACE: (f64, f64) = (12.0, 2.0);
/// JPEG quality of the stills, and of the strip.
const QUALITY: (u8, u8) = (92, 80);

/// Observer that keeps the data of a film's page: the first, middle and last decoded frame, a strip of at most 48 small
/// frames, and maps of one frame.
#[derive(Debug)]
pub struct FilmWatch {
    frames: Range<u32>,
    fps: f64,
    matrix: ColorMatrix,
    /// Permitted error of a pixel without a threshold, as a fraction of its luminance.
    share_elsewhere: f32,
    held: Mutex<Held>,
    importance: ImportanceSum,
}

#[derive(Debug, Default)]
struct Held {
    first: Option<KeptPicture>,
    middle: Option<KeptPicture>,
    last: Option<KeptPicture>,
    strip: BTreeMap<u32, Rgb>,
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
        Self {
            frames: settings.frame_range(),
            fps: settings.render.fps,
            matrix: settings.matrix(),
            share_elsewhere: settings.render.thresholds.share_elsewhere(),
            held: Mutex::default(),
            importance: ImportanceSum::default(),
        }
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the interval between frames in the strip \[frames\].
    fn every(&self) -> u32 {
        (self.frames.len() as u32).div_ceil(STRIP.0).max(1)
    }

    /// Returns the distance of frame `index` from the middle of the film \[frames\].
    fn distance_to_middle(&self, index: u32) -> u32 {
        index.abs_diff(self.frames.start + self.frames.len() as u32 / 2)
    }

    /// Returns the distinct stills in order, with names and data URIs.
    pub(super) fn stills(&self) -> Result<Vec<Value>> {
        let held = self.held();
        let mut stills: Vec<(&str, &KeptPicture)> = Vec::new();
        let [first, last] = [held.first.as_ref(), held.last.as_ref()];
        for (name, still) in [("First", first), ("Middle", held.middle.as_ref()), ("Last", last)] {
            // Omit the middle frame if it is also the last, as in a film that ended early.
            let is_other = |still: &&KeptPicture| stills.iter().all(|(_, other)| other.index != still.index);
            let is_end = name == "Middle" && still.zip(last).is_some_and(|(still, last)| still.index == last.index);
            if let Some(still) = still.filter(is_other).filter(|_| !is_end) {
                stills.push((name, still));
            }
        }
        let shown = |(name, still): (&str, &KeptPicture)| {
            let uri = jpeg(&to_rgb8_by(&still.picture, self.matrix), QUALITY.0)?;
            Ok(context! { name, index => still.index, uri })
        };
        stills.into_iter().map(shown).collect()
    }

    /// Returns the strip as one picture of stacked frames, with figures for animating it; `None` with fewer than two frames.
    pub(super) fn strip(&self) -> Result<Option<Value>> {
        let held = self.held();
        let Some(first) = held.strip.values().next().filter(|_| held.strip.len() > 1) else { return Ok(None) };
        let (width, height, count) = (first.width(), first.height(), held.strip.len());
        let samples: Vec<[u8; 3]> = held.strip.values().flat_map(|frame| frame.samples().iter().copied()).collect();
        let uri = jpeg(&Plane::from_vec(width, height * count, samples), QUALITY.1)?;
        // Play in real time if the rate is within the limits, otherwise at the nearer limit.
        let own_pace = self.fps / f64::from(self.every());
        let pace = own_pace.clamp(PACE.1, PACE.0);
        let seconds = count as f64 / pace;
        Ok(Some(context! {
            uri, width, height, count,
            every => self.every(),
            // Show the speed if it differs from real time by 1 % or more.
            speed => if (pace / own_pace - 1.0).abs() < 0.01 { None } else { Some(format!("{:.2}", pace / own_pace)) },
            seconds => format!("{seconds:.2}"),
            first => held.strip.keys().next(),
            last => held.strip.keys().next_back(),
        }))
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
        let still = || Some(KeptPicture { index, picture: picture.clone() });
        // Shrink frames of the strip before locking, so that other threads wait less.
        let is_of_strip = index.wrapping_sub(self.frames.start).is_multiple_of(self.every());
        let small = is_of_strip.then(|| {
            let factor = factor(picture.width(), picture.height(), STRIP.1);
            shrunk(&to_rgb8_by(picture, self.matrix), factor, mean_color)
        });

        // For each still, keep the best matching frame so far.
        let mut held = self.held();
        if held.first.as_ref().is_none_or(|kept| index < kept.index) {
            held.first = still();
        }
        if held.last.as_ref().is_none_or(|kept| index > kept.index) {
            held.last = still();
        }
        if held.middle.as_ref().is_none_or(|kept| self.distance_to_middle(index) < self.distance_to_middle(kept.index))
        {
            held.middle = still();
        }
        held.strip.extend(small.map(|small| (index, small)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_core::scene::Scene;
    use render2mpeg::Options;

    fn watch(frames: u32) -> FilmWatch {
        let options = Options { frames: Some(frames), ..Options::default() };
        FilmWatch::new(&Settings::new("scene.glb".into(), &Scene::default(), &options).unwrap())
    }

    fn indices(watch: &FilmWatch) -> Vec<u32> {
        let index = |still: &Value| u32::try_from(still.get_attr("index").unwrap()).unwrap();
        watch.stills().unwrap().iter().map(index).collect()
    }

    #[test]
    fn three_frames_and_a_strip_stay_of_a_long_film() {
        let film = watch(1000);
        let picture = Picture::black(640, 480);
        // Pass the pictures in the coding order of a film with B pictures.
        for index in (0..1000).map(|place: u32| {
            if place % 3 == 1 {
                place + 1
            } else if place % 3 == 2 {
                place - 1
            } else {
                place
            }
        }) {
            film.decoded(index, &picture);
        }
        assert_eq!(indices(&film), [0, 500, 999]);
        let held = film.held();
        assert!(
            held.strip.len() <= 48 && held.strip.values().all(|frame| (frame.width(), frame.height()) == (320, 240))
        );
    }

    #[test]
    fn short_films_and_those_ended_early_show_each_frame_once() {
        let picture = Picture::black(16, 16);
        for (planned, made, expected) in [(1, 1, &[0][..]), (2, 2, &[0, 1]), (3, 3, &[0, 1, 2]), (100, 10, &[0, 9])] {
            let film = watch(planned);
            (0..made).for_each(|index| film.decoded(index, &picture));
            assert_eq!(indices(&film), expected, "{planned} {made}");
            assert_eq!(film.strip().unwrap().is_some(), film.held().strip.len() > 1);
        }
        assert!(watch(3).stills().unwrap().is_empty() && watch(3).strip().unwrap().is_none());
    }
}
