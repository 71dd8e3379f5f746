//! Pictures on demand, compared with a fine picture of the same view.

use live::pipeline::stage::{Display as _, LastThresholds, Shade};
use live::render_core::scene::{Scene, View};
use live::render2mpeg::stages::Display;
use live::render2mpeg::{Options, Settings};
use live::renderer::plan::Plan;
use live::renderer::{Moment, Preparation, Shading};
use live::session::Rest;
use live::{Detail, LiveLoop, LivePicture, LivePlans, PictureRequest};
use mpeg2dec::{Decoder, SampleComponent};
use perceptual::psnr;
use plane::Plane;
use render_core::glam::{Affine3A, Quat, Vec3};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Loads the Cornell box, with settings for small pictures.
fn cornell() -> (Scene, Settings) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell/cornell.glb");
    let scene = render_core::scene::load(&path).unwrap();
    let (size, vpls) = (Some("96x80".parse().unwrap()), Some(400));
    let options = Options { size, vpls, photons: Some(20_000), ..Options::default() };
    let settings = Settings::new(path, &scene, &options).unwrap();
    (scene, settings)
}

/// Returns the moment of a camera after `steps` of a walk with a turn.
fn moment(scene: &Scene, settings: &Settings, steps: u32) -> Moment {
    let size = settings.render.size;
    let view: View = scene.view(&scene.pose(0.0), size.width, size.height);
    let steps = steps as f32;
    let turn = Quat::from_rotation_y(0.02 * steps);
    let local = Affine3A::from_rotation_translation(turn, Vec3::new(0.02 * steps, 0.0, -0.02 * steps));
    Moment { time: 0.0, view: Some(view.moved_to(view.world_from_camera() * local)) }
}

/// Returns the luma of a moment, lit within 2 % of luminance, and not coded.
fn fine(scene: &Scene, settings: &Settings, moment: Moment) -> Plane<u8> {
    let plan = Plan::with_free_camera(scene, &settings.render);
    // Frame 0 would have the pose of the film's first frame.
    let prepared = Preparation::new(scene, &settings.render, &plan).everywhere().frame_at(1, moment);
    let shaded = Shading::new(&settings.render, &plan).step(&prepared, LastThresholds::none());
    let shown = Display::of(settings).unwrap().show(0, &shaded);
    shown.picture.picture.luma().clone()
}

/// Decodes pictures as the page does, and returns the luma of each.
#[derive(Default)]
struct Page(Decoder);

impl Page {
    fn show(&mut self, picture: &LivePicture) -> Plane<u8> {
        let mut shown = Vec::new();
        for bytes in [&picture.packet.data[..], &[0, 0, 1, 0xb2]] {
            self.0.push(bytes, |picture| {
                let luma = picture.plane(SampleComponent::Y);
                let samples = luma.rows().flatten().copied().collect();
                shown.push(Plane::from_vec(luma.width, luma.height, samples));
            });
        }
        assert_eq!(shown.len(), 1, "each message is one picture");
        shown.remove(0)
    }
}

/// A picture above its maximum is coded again. The stream continues as if it had been coded once, with the quantiser that
/// the picture has.
#[test]
fn large_pictures_are_coded_again_with_a_coarser_quantiser() {
    let (scene, settings) = cornell();
    let plans = LivePlans::new(&scene, &settings);
    let mut page = Page::default();
    let (mut limited, mut plain) = (Vec::new(), Vec::new());
    let mut live = LiveLoop::new(&scene, &settings, &plans).unwrap();
    for step in 0..4 {
        let request = PictureRequest::new(moment(&scene, &settings, 2 * step), 2);
        let most_bits = [None, Some(6_000), Some(4_000), Some(1)][step as usize];
        let picture = live.picture(PictureRequest { most_bits, ..request }).unwrap();
        assert_eq!(&page.show(&picture), picture.packet.reconstruction.luma());
        assert_eq!(picture.packet.display_index, u64::from(step));
        limited.push(picture.packet);
    }
    let mut live = LiveLoop::new(&scene, &settings, &plans).unwrap();
    for step in 0..4 {
        let quantiser = limited[step as usize].quantiser_scale;
        let request = PictureRequest::new(moment(&scene, &settings, 2 * step), quantiser);
        plain.push(live.picture(request).unwrap().packet);
    }
    let quantisers: Vec<u32> = limited.iter().map(|packet| packet.quantiser_scale).collect();
    assert!(quantisers[0] == 2 && quantisers[1] > 2 && quantisers[2] > 2 && quantisers[3] == 112, "{quantisers:?}");
    assert!(limited[1].bits <= 6_000 && limited[2].bits <= 4_000, "{} {}", limited[1].bits, limited[2].bits);
    // Light of the first two pictures has the same thresholds, so that these have the same bytes.
    for (limited, plain) in limited.iter().zip(&plain).take(2) {
        assert_eq!(limited.data, plain.data);
    }
}

#[test]
fn a_walk_has_exact_motion_and_rests_at_the_quality_of_a_film() {
    let (scene, settings) = cornell();
    let plans = LivePlans::new(&scene, &settings);
    let mut live = LiveLoop::new(&scene, &settings, &plans).unwrap();
    let mut page = Page::default();
    let (mut bits, mut rest) = (Vec::new(), Rest::default());
    for step in 0..8 {
        let request = PictureRequest::new(moment(&scene, &settings, step), 16);
        let is_intra = step == 5;
        let picture = live.picture(PictureRequest { is_intra, ..request }).unwrap();
        assert_eq!(picture.is_intra(), step == 0 || is_intra);
        assert_eq!(picture.packet.display_index, u64::from(step));
        // Decoders show the reconstruction of the encoder.
        assert_eq!(&page.show(&picture), picture.packet.reconstruction.luma());
        bits.push(picture.packet.bits);
        rest.moved(&picture);
    }
    assert!(2 * bits[2] < bits[0] && 2 * bits[7] < bits[5], "motion predicts pictures: {bits:?}");

    // At rest, pictures become finer until nothing is left to do.
    let at_rest = moment(&scene, &settings, 7);
    let truth = fine(&scene, &settings, at_rest);
    let (mut qualities, mut last) = (Vec::new(), u64::MAX);
    while let Some(step) = rest.next(4, 4) {
        let detail = Detail::Fine;
        let request = PictureRequest::new(at_rest, step.quantiser_scale);
        let picture = live.picture(PictureRequest { detail, is_fresh: step.is_fresh, ..request }).unwrap();
        rest.refined(&picture, detail, step.is_fresh);
        qualities.push(psnr(&page.show(&picture), &truth));
        last = picture.packet.bits;
        assert!(qualities.len() < 6, "{qualities:?}");
    }
    assert!(*qualities.last().unwrap() >= 40.0, "{qualities:?}");
    assert!(last < bits[0], "{last} of {}", bits[0]);

    // The same moment again costs next to nothing.
    let request = PictureRequest { detail: Detail::Fine, ..PictureRequest::new(at_rest, 4) };
    let picture = live.picture(request).unwrap();
    let (again, share) = (picture.packet.bits, picture.shaded_share);
    assert!(8 * again < bits[0] && share < 0.3, "{again} of {} bits, {share}", bits[0]);
}

#[test]
fn time_and_camera_are_free() {
    let (scene, settings) = cornell();
    let plans = LivePlans::new(&scene, &settings);
    let mut live = LiveLoop::new(&scene, &settings, &plans).unwrap();
    let mut page = Page::default();
    let view = moment(&scene, &settings, 0).view;
    let mut lumas = Vec::new();
    // The animation goes on, stops, and goes back.
    for frame in [0.0, 20.0, 20.0, 3.0] {
        let moment = Moment { time: (frame / settings.render.fps) as f32, view };
        let request = PictureRequest { detail: Detail::Fine, ..PictureRequest::new(moment, 4) };
        let picture = live.picture(request).unwrap();
        lumas.push((page.show(&picture), fine(&scene, &settings, moment)));
    }
    for (shown, truth) in &lumas {
        let quality = psnr(shown, truth);
        assert!(quality > 36.0, "{quality}");
    }
    assert!(psnr(&lumas[0].0, &lumas[1].0) < 36.0, "objects move");
}

#[test]
fn a_budget_limits_light_and_a_static_view_completes_it() {
    let (scene, settings) = cornell();
    let plans = LivePlans::new(&scene, &settings);
    let [mut limited, mut whole] = [(); 2].map(|()| LiveLoop::new(&scene, &settings, &plans).unwrap());
    let luma = |picture: &LivePicture| picture.packet.reconstruction.luma().clone();
    const BUDGET: f32 = 0.02;
    let (mut open, mut share) = (0.0f64, 0.0f64);
    for step in 0..8 {
        let request = PictureRequest::new(moment(&scene, &settings, 2 * step), 4);
        let budget = (step > 0).then_some(BUDGET);
        let picture = limited.picture(PictureRequest { budget, ..request }).unwrap();
        let truth = luma(&whole.picture(request).unwrap());
        // Each of three layers may light its own pixels.
        if step > 0 {
            assert!(picture.shaded_share <= 1.2 * 3.0 * f64::from(BUDGET), "{}", picture.shaded_share);
            open = open.max(picture.open_share);
        }
        let shown = luma(&picture);
        for (k, (&shown, &truth)) in shown.samples().iter().zip(truth.samples()).enumerate() {
            assert!(truth < 60 || shown > 30, "step {step}, pixel {k}: {shown} instead of {truth}");
        }
        let quality = psnr(&shown, &truth);
        assert!(quality > 28.0, "{quality} dB");
    }
    assert!(open > 0.02, "the budget is used up: {open}");

    // At rest, the budget soon lights all pixels.
    let at_rest = PictureRequest::new(moment(&scene, &settings, 14), 2);
    let mut pictures = 0;
    loop {
        let picture = limited.picture(PictureRequest { budget: Some(2.0 * BUDGET), ..at_rest }).unwrap();
        share = share.max(picture.shaded_share);
        pictures += 1;
        assert!(pictures < 40, "{}", picture.open_share);
        if picture.open_share == 0.0 {
            break;
        }
    }
    let [limited, whole] = [limited, whole].map(|mut live| {
        let request = PictureRequest { detail: Detail::Fine, ..at_rest };
        live.picture(request).unwrap();
        luma(&live.picture(request).unwrap())
    });
    let quality = psnr(&limited, &whole);
    assert!(quality >= 40.0, "{quality} dB after {pictures} pictures");
}

#[test]
fn a_stopped_picture_leaves_the_loop_as_it_was() {
    let (scene, settings) = cornell();
    let plans = LivePlans::new(&scene, &settings);
    let mut live = LiveLoop::new(&scene, &settings, &plans).unwrap();
    let fine = PictureRequest { detail: Detail::Fine, ..PictureRequest::new(moment(&scene, &settings, 0), 4) };
    live.picture(fine).unwrap();
    let before = live.picture(fine).unwrap();

    for is_fresh in [true, false] {
        let stop = Arc::new(AtomicBool::new(true));
        let stopped = live.picture_unless(PictureRequest { is_fresh, ..fine }, &stop).unwrap();
        assert!(stopped.is_none() && live.pictures() == 2 + u64::from(!is_fresh));
        let after = live.picture(fine).unwrap();
        assert!(after.shaded_share < 0.3, "light is reprojected: {}", after.shaded_share);
        let [before, after] = [&before, &after].map(|picture| picture.packet.reconstruction.luma().clone());
        assert!(psnr(&before, &after) >= 40.0);
    }

    // A picture in motion is shown despite the stop, because it contains the last input.
    let stop = Arc::new(AtomicBool::new(true));
    let moved = PictureRequest::new(moment(&scene, &settings, 1), 4);
    assert!(live.picture_unless(moved, &stop).unwrap().is_some());
    let fine = PictureRequest { detail: Detail::Fine, ..moved };
    live.picture(fine).unwrap();

    // Without a stop, all light is computed.
    let never = Arc::new(AtomicBool::new(false));
    let fresh = live.picture_unless(PictureRequest { is_fresh: true, ..fine }, &never).unwrap().unwrap();
    assert_eq!(fresh.shaded_share, 1.0);
}
