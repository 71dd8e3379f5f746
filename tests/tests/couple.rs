//! The loop with parts of one's own.

use mpeg2enc::{Config, Container, FrameRate};
use perceptual::{DEFAULT_WEIGHT, Feedback, MaskingModel, ThresholdMap, ToneMap, still_matches};
use pipeline::couple::{Event, Prepare, Shade, couple};
use pipeline::video::Video;
use pipeline::{Error, Result};
use plane::Plane;
use render_core::Correspondence;
use std::sync::{Arc, Mutex};
use tests::decode_ffmpeg;

const SIZE: (usize, usize) = (64, 64);
const FRAMES: u32 = 5;

/// A still picture.
struct Still;

impl Prepare for Still {
    type Frame = u32;

    fn prepare(&mut self, index: u32) -> Option<(u32, Option<Arc<Correspondence>>)> {
        let known = (index > 0).then(|| {
            let motion = Plane::filled(SIZE.0, SIZE.1, [0.0; 2]);
            Arc::new(Correspondence { motion, matches: still_matches(SIZE.0, SIZE.1) })
        });
        (index < FRAMES).then_some((index, known))
    }
}

/// A pattern, and a note of the thresholds it was asked to keep; panics at a frame if it shall.
struct Pattern {
    allowed: Arc<Mutex<Vec<Option<f32>>>>,
    panics_at: Option<u32>,
}

impl Shade<u32> for Pattern {
    fn shade(&mut self, frame: u32, thresholds: &ThresholdMap) -> Plane<[f32; 3]> {
        assert!(Some(frame) != self.panics_at, "as asked");
        self.allowed.lock().unwrap().push(thresholds.get(20, 10));
        Plane::from_fn(SIZE.0, SIZE.1, |x, y| [0.3 + 0.2 * ((x * 7 + y * 3) as f32).sin(); 3])
    }
}

type Allowed = Vec<Option<f32>>;

fn film(quantiser_scale: u32, panics_at: Option<u32>, out: impl FnMut(Event) -> Result<()>) -> (Result<()>, Allowed) {
    let config = Config::new(SIZE.0, SIZE.1, FrameRate::FPS_25);
    let video = Video::immediate(config, Container::Elementary, quantiser_scale).unwrap();
    let tone_map = ToneMap::default();
    let masking = Feedback::new(MaskingModel::default(), tone_map, DEFAULT_WEIGHT);
    let allowed: Arc<Mutex<Allowed>> = Arc::default();
    let pattern = Pattern { allowed: allowed.clone(), panics_at };
    let result = couple(Still, pattern, masking, video, SIZE, tone_map, out);
    let allowed = allowed.lock().unwrap().clone();
    (result, allowed)
}

#[test]
fn a_renderer_gets_the_thresholds_of_the_frame_before() {
    let [fine, coarse] = [2, 40].map(|quantiser_scale| {
        let (mut told, mut stream, mut order) = (Vec::new(), Vec::new(), String::new());
        let (result, allowed) = film(quantiser_scale, None, |event| {
            match event {
                Event::Picture { .. } => order.push('p'),
                Event::Bytes(bytes) => {
                    order.push('b');
                    stream.extend(bytes);
                }
                Event::Thresholds { of, delta } => {
                    order.push('t');
                    told.push((of, delta.get(20, 10)));
                }
            }
            Ok(())
        });
        result.unwrap();
        assert_eq!(order, "pbtpbtpbtpbtpbtb");
        // 2 % before anything was seen; then just what was told of the frame before.
        assert_eq!(allowed[0], None);
        for (index, allowed) in allowed.iter().enumerate().skip(1) {
            assert_eq!((index as u32 - 1, allowed.unwrap()), told[index - 1]);
        }
        let folder = tempfile::tempdir().unwrap();
        let video = folder.path().join("film.m2v");
        std::fs::write(&video, &stream).unwrap();
        assert_eq!(decode_ffmpeg(&video, SIZE).len(), FRAMES as usize);
        allowed[4].unwrap()
    });
    assert!(coarse > 2.0 * fine, "{coarse} at quantiser_scale 40, {fine} at 2");
}

#[test]
fn whatever_fails_the_loop_ends() {
    let mut count = 0;
    let (result, _) = film(8, None, |_| {
        count += 1;
        if count == 4 { Err(Error::other("the disk is full")) } else { Ok(()) }
    });
    assert_eq!(result.unwrap_err().to_string(), "the disk is full");
    let (result, allowed) = film(8, Some(2), |_| Ok(()));
    assert!(result.unwrap_err().to_string().contains("panicked"));
    assert_eq!(allowed.len(), 2);
}
