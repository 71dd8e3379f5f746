//! The loop with custom stages: thresholds, failures, checkpoints and reports.

use mpeg2enc::{Config, Container, FrameRate};
use perceptual::{DEFAULT_WEIGHT, Feedback, MaskingModel, ToneMap, YCbCr};
use pipeline::Result;
use pipeline::checkpoint::{Checkpoints, FilmJob};
use pipeline::observe::Observer;
use pipeline::report::FrameReport;
use pipeline::stage::{Displayed, Encode, Encoded, LastThresholds, Prepare, Prepared, Shade, Shaded};
use pipeline::{Run, Stages, couple};
use plane::{Correspondence, Plane};
use render2mpeg::stages::{Display, Video};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tests::decode_ffmpeg;

const SIZE: (usize, usize) = (64, 64);
const FRAMES: u32 = 8;

/// A static picture.
#[derive(Debug)]
struct Still;

impl Prepare for Still {
    type Frame = u32;

    fn step(&mut self, index: u32) -> Option<Prepared<u32>> {
        let correspondence = (index > 0).then(|| Arc::new(Correspondence::still(SIZE.0, SIZE.1)));
        (index < FRAMES).then(|| Prepared { frame: index, correspondence, ..Prepared::default() })
    }

    fn restore(&mut self, _: &[u8], last: u32) -> Result<Prepared<u32>> {
        Ok(self.step(last).expect("a frame of the film"))
    }
}

/// A pattern that depends on the number of frames so far, with a log of the thresholds received.
#[derive(Debug)]
struct Pattern {
    allowed: Arc<Mutex<Vec<Option<f32>>>>,
    panics_at: Option<u32>,
    /// Number of frames so far: the state of this renderer.
    count: u8,
}

impl Shade<u32> for Pattern {
    fn step(&mut self, prepared: &Prepared<u32>, thresholds: LastThresholds<'_>) -> Shaded {
        assert!(Some(prepared.frame) != self.panics_at, "as the test wants");
        let allowed = thresholds.map(SIZE.0, SIZE.1).get(20, 10);
        self.allowed.lock().unwrap().push(allowed);
        self.count += 1;
        // The error equals the threshold, so the threshold is visible in the film.
        let wrong = allowed.unwrap_or(0.0) + 0.01 * f32::from(self.count);
        let radiance = Plane::from_fn(SIZE.0, SIZE.1, |x, y| [0.3 + wrong + 0.2 * ((x * 7 + y * 3) as f32).sin(); 3]);
        Shaded { radiance, ..Shaded::default() }
    }

    fn state(&self) -> Vec<u8> {
        vec![self.count]
    }

    fn restore(&mut self, state: &[u8], last: &Prepared<u32>) -> Result<()> {
        self.count = state[0];
        assert_eq!(u32::from(self.count), last.frame + 1);
        Ok(())
    }
}

type Film<E> = Stages<Still, Pattern, Display, Feedback, E>;

fn film(quantiser_scale: u32, panics_at: Option<u32>) -> Film<Video> {
    let config = Config::new(SIZE.0, SIZE.1, FrameRate::FPS_25);
    let tone_map = ToneMap::default();
    Stages {
        prepare: Still,
        shade: Pattern { allowed: Arc::default(), panics_at, count: 0 },
        display: Display::new(tone_map),
        encode: Video::immediate(config, Container::Elementary, quantiser_scale).unwrap(),
        mask: Some(Feedback::new(MaskingModel::default(), tone_map, DEFAULT_WEIGHT)),
    }
}

/// Collects everything that an observer receives.
#[derive(Default)]
struct Seen {
    order: Mutex<String>,
    thresholds: Mutex<Vec<(u32, f32)>>,
    stream: Mutex<Vec<u8>>,
}

impl Observer for Seen {
    fn picture(&self, index: u32, _: &YCbCr) {
        self.order.lock().unwrap().push_str(&format!("p{index}"));
    }

    fn thresholds(&self, index: u32, delta: &Plane<f32>) {
        self.order.lock().unwrap().push_str(&format!("t{index}"));
        self.thresholds.lock().unwrap().push((index, delta.get(20, 10)));
    }

    fn bytes(&self, bytes: &[u8]) {
        self.stream.lock().unwrap().extend(bytes);
    }

    fn frame(&self, report: &FrameReport) {
        self.order.lock().unwrap().push_str(&format!("f{}", report.index));
    }
}

fn run<E: Encode>(mut film: Film<E>, seen: &Seen) -> Result<Vec<FrameReport>> {
    let checkpoints = Checkpoints::off();
    let start = film.begin(&checkpoints)?;
    couple(film, start, Run { observer: seen, ..Run::default() })
}

#[test]
fn a_renderer_gets_the_thresholds_of_the_frame_before() {
    let [fine, coarse] = [2, 40].map(|quantiser_scale| {
        let (film, seen) = (film(quantiser_scale, None), Seen::default());
        let allowed = film.shade.allowed.clone();
        let report = run(film, &seen).unwrap();
        assert_eq!(report.iter().map(|frame| frame.index).collect::<Vec<_>>(), (0..FRAMES).collect::<Vec<_>>());
        assert!(report.iter().all(|frame| frame.bits > 0 && frame.figures.seconds.encode > 0.0));
        let order: String = (0..FRAMES).map(|n| format!("p{n}f{n}t{n}")).collect();
        assert_eq!(*seen.order.lock().unwrap(), order);
        // None for the first frame, then the previous frame's thresholds.
        let (allowed, told) = (allowed.lock().unwrap(), seen.thresholds.lock().unwrap());
        assert_eq!(allowed[0], None);
        for (index, allowed) in allowed.iter().enumerate().skip(1) {
            assert_eq!((index as u32 - 1, allowed.unwrap()), told[index - 1]);
        }
        let folder = tempfile::tempdir().unwrap();
        let video = folder.path().join("film.m2v");
        std::fs::write(&video, &*seen.stream.lock().unwrap()).unwrap();
        assert_eq!(decode_ffmpeg(&video, SIZE).len(), FRAMES as usize);
        allowed[4].unwrap()
    });
    assert!(coarse > 2.0 * fine, "{coarse} at quantiser_scale 40, {fine} at 2");
}

/// An encoder that fails at a frame, like one on a full disk.
struct Full(Video, u32);

impl Encode for Full {
    fn step(&mut self, displayed: &Displayed) -> Result<Encoded> {
        if displayed.index == self.1 {
            return Err(pipeline::Error::other("the disk is full"));
        }
        self.0.step(displayed)
    }

    fn finish(self) -> Result<Encoded> {
        self.0.finish()
    }

    fn restore(&mut self, state: &[u8]) -> Result<()> {
        self.0.restore(state)
    }
}

#[test]
fn whatever_fails_the_loop_ends() {
    for at in [0, 2, 4] {
        let Stages { prepare, shade, display, encode, mask } = film(8, None);
        let full = Stages { prepare, shade, display, encode: Full(encode, at), mask };
        assert_eq!(run(full, &Seen::default()).unwrap_err().to_string(), "the disk is full");
    }
    let film = film(8, Some(2));
    let allowed = film.shade.allowed.clone();
    let error = run(film, &Seen::default()).unwrap_err().to_string();
    assert!(error.contains("shade") && error.contains("bug"), "{error}");
    assert_eq!(allowed.lock().unwrap().len(), 2);
}

/// Ends the film when frame `at` is displayed.
struct Interrupt<'a> {
    at: u32,
    stop: &'a AtomicBool,
}

impl Observer for Interrupt<'_> {
    fn picture(&self, index: u32, _: &YCbCr) {
        if index == self.at {
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}

/// A film with custom stages gives the same bytes and a complete report, rendered in one run or continued after an early end.
#[test]
fn a_renderer_of_ones_own_is_continued_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.m2v");
    make(&whole, None);
    for at in 0..4 {
        let path = folder.path().join(format!("{at}.m2v"));
        let first = make(&path, Some(at));
        assert!((first as u32) < FRAMES, "the film ended early");
        assert_eq!(make(&path, None), FRAMES as usize, "its report has every frame");
        assert!(std::fs::read(&path).unwrap() == std::fs::read(&whole).unwrap(), "ended after frame {at}");
    }
}

/// Renders or continues the film, up to frame `ends` if given. Returns the number of frames in the report.
fn make(path: &Path, ends: Option<u32>) -> usize {
    let mut film = film(16, None);
    let job = FilmJob::new(path, "a test", "{}", 0);
    let checkpoints = Checkpoints::resume(&job, Some(Duration::ZERO)).unwrap();
    let mut start = film.begin(&checkpoints).unwrap();
    start.write_to(path).unwrap();
    let stop = AtomicBool::new(false);
    let report = match ends {
        Some(at) => couple(film, start, Run { observer: &Interrupt { at, stop: &stop }, stop: &stop }),
        None => couple(film, start, Run::default()),
    };
    report.unwrap().len()
}
