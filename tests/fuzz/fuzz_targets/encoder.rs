//! Each configuration of the encoder is refused, or encodes any pictures with any motion.
#![no_main]

use arbitrary::{Arbitrary, Unstructured};
use libfuzzer_sys::fuzz_target;
use mpeg2enc::{
    CoefficientTable, Config, Container, Effort, Picture, FrameRate, SuppliedMotion, Level, Multiplexer, Packet,
    Rate, Standard,
};
use plane::{Correspondence, Plane};

#[derive(Arbitrary, Debug)]
struct Wishes {
    width: u16,
    height: u16,
    frame_rate: u8,
    mpeg1: bool,
    gop: u8,
    quantiser_scale: u8,
    dc_bits: u8,
    level: Option<u8>,
    effort: u8,
    b_pictures: u8,
    closed_gop: bool,
    scene_cuts: bool,
    uniform: bool,
    adaptive: bool,
    alternate_scan: bool,
    table_zero: bool,
    matrices: Option<(u8, u8)>,
    rate: u8,
    bits_per_second: u32,
    buffer_bits: u32,
    container: u8,
    lookahead: u8,
    frames: u8,
    motion: Option<[f32; 2]>,
    /// Whether motion comes from the input's bytes in 1/64 pixel, as in files.
    motion_64ths: bool,
}

/// Maximum width and height \[pixels\]; larger pictures would only be slower.
const LARGEST: u16 = 80;

/// Returns a size, occasionally an invalid one.
fn size(wishes: &Wishes) -> (usize, usize) {
    let side = |side: u16| usize::from(if side > 65_500 { side } else { side % LARGEST });
    (side(wishes.width), side(wishes.height))
}

fn config(wishes: &Wishes) -> Option<Config> {
    const RATES: [f64; 8] = [23.976, 24.0, 25.0, 29.97, 30.0, 50.0, 59.94, 60.0];
    let frame_rate = FrameRate::from_fps(RATES[usize::from(wishes.frame_rate % 8)]).ok()?;
    let (width, height) = size(wishes);
    let (bits_per_second, buffer_bits) = (wishes.bits_per_second, wishes.buffer_bits);
    let mut config = Config::new(width, height, frame_rate)
        .with_standard(if wishes.mpeg1 { Standard::Mpeg1 } else { Standard::Mpeg2 })
        .with_gop(wishes.gop.into())
        .with_quantiser_scale(wishes.quantiser_scale.into())
        .with_intra_dc_precision(8 + u32::from(wishes.dc_bits % 5))
        .with_effort([Effort::Fast, Effort::Balanced, Effort::Best][usize::from(wishes.effort % 3)])
        .with_b_pictures((wishes.b_pictures % 9).into())
        .with_closed_gop(wishes.closed_gop)
        .with_scene_cuts(wishes.scene_cuts)
        .with_uniform_quantiser(wishes.uniform)
        .with_adaptive_quantisation(wishes.adaptive)
        .with_alternate_scan(wishes.alternate_scan)
        .with_intra_table(if wishes.table_zero { CoefficientTable::Zero } else { CoefficientTable::One })
        .with_rate(match wishes.rate % 3 {
            0 => Rate::ConstantQuantiser,
            1 => Rate::Constant { bits_per_second, buffer_bits },
            _ => Rate::Capped { bits_per_second, buffer_bits },
        })
        .with_lookahead((wishes.lookahead % 32).into());
    // A requested level and custom matrices are optional.
    if let Some(level) = wishes.level {
        config = config.with_level([Level::Low, Level::Main, Level::High1440, Level::High][usize::from(level % 4)]);
    }
    if let Some((intra, non_intra)) = wishes.matrices {
        let mut matrix = [intra; 64];
        matrix[0] = 8;
        config = config.with_matrices(matrix, [non_intra; 64]);
    }
    Some(config)
}

/// Builds a picture from the input's bytes, repeated.
fn frame(width: usize, height: usize, bytes: &[u8], number: usize) -> Picture {
    let at = |stride: usize, start: usize| {
        move |x: usize, y: usize| match bytes {
            [] => 128,
            _ => bytes[(start + 17 * number + y * stride + x) % bytes.len()],
        }
    };
    let (chroma_width, chroma_height) = (width.div_ceil(2), height.div_ceil(2));
    let chroma = |start| Plane::from_fn(chroma_width, chroma_height, at(chroma_width, start));
    Picture::new(Plane::from_fn(width, height, at(width, 0)), chroma(5), chroma(11)).expect("planes that belong together")
}

/// Builds motion from two bytes of the input per component.
fn motion_64ths(width: usize, height: usize, bytes: &[u8]) -> Correspondence {
    let at = |k: usize| match bytes {
        [] => 0,
        _ => i16::from_le_bytes([bytes[2 * k % bytes.len()], bytes[(2 * k + 1) % bytes.len()]]),
    };
    // The smallest value means no correspondence.
    let pixels = |k| Some(at(k)).filter(|&part| part != i16::MIN).map_or(f32::NAN, |part| f32::from(part) / 64.0);
    Correspondence::from_motion(Plane::from_fn(width, height, |x, y| {
        let k = 2 * (y * width + x);
        [pixels(k), pixels(k + 1)]
    }))
}

fuzz_target!(|data: &[u8]| {
    let mut input = Unstructured::new(data);
    let Ok(wishes) = Wishes::arbitrary(&mut input) else { return };
    let bytes = input.take_rest();
    let Some(config) = config(&wishes) else { return };
    let containers = [Container::Elementary, Container::Program, Container::Transport, Container::Disc];
    let container = containers[usize::from(wishes.container) % containers.len()];
    let mut multiplexer = Multiplexer::new(container, &config);
    let (width, height) = size(&wishes);
    let count = 1 + usize::from(wishes.frames % 12);
    let field = |width, height| match wishes.motion_64ths {
        true => Some(motion_64ths(width, height, bytes)),
        false => wishes.motion.map(|motion| Correspondence::from_motion(Plane::filled(width, height, motion))),
    };
    let mut seen = 0;
    let mut take = |packets: Vec<Packet>| {
        for packet in packets {
            assert!(packet.bits > 0 && packet.bits == 8 * packet.data.len() as u64 && !packet.psnr_y.is_nan());
            seen += 1;
            multiplexer.push(packet);
        }
    };
    let Ok(mut encoder) = config.clone().encoder() else { return };
    let field = field(width, height);
    let motion = SuppliedMotion { to_previous: field.as_ref(), to_next: field.as_ref() };
    for n in 0..count {
        if n == count / 2 {
            let state = encoder.state().clone();
            encoder = config.clone().encoder().expect("it was made before");
            encoder.restore(state).expect("its own state");
        }
        take(encoder.push(&frame(width, height, bytes, n), motion));
    }
    take(encoder.finish().packets);
    assert_eq!(seen, count, "a packet for each frame");
});
