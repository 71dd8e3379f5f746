//! Damaged streams: no panic, bounded memory, and errors that are concealed and counted.

use crate::{
    common::{decoded, encoded},
    random,
};
use fastrand::Rng;
use mpeg2dec::{DecoderOptions, Input};
use std::time::Instant;

/// Small streams of all formats and with all syntax.
fn seeds() -> Vec<Vec<u8>> {
    let mut seeds = random::streams(1);
    for (ending, options) in [
        ("m2v", "-f mpeg2video"),
        ("m2v", "-f mpeg2video -flags +ildct+ilme -intra_vlc 1 -alternate_scan 1"),
        ("ts", ""),
        ("mpg", "-f mpeg"),
        ("mpg", "-f svcd"),
    ] {
        let options = format!("-pix_fmt yuv420p -c:v mpeg2video -bf 2 -q:v 8 -g 5 {options}");
        seeds.push(encoded("64x48", ending, &options));
    }
    seeds
}

/// Decodes a stream that may be damaged. Returns the number of pictures and of concealed macroblocks.
fn attempt(stream: &[u8], options: DecoderOptions, size: usize) -> [u64; 2] {
    let (mut input, mut rows) = (Input::new(options), 0);
    for piece in stream.chunks(size.max(1)) {
        input.push(piece, |picture| rows += picture.plane(mpeg2dec::SampleComponent::Y).rows().count());
    }
    input.flush(|picture| rows += picture.captions().count());
    [input.counts().pictures, input.counts().concealed_macroblocks]
}

/// Changes a few bytes of a stream.
fn mutate(stream: &mut Vec<u8>, random: &mut Rng) {
    for _ in 0..random.usize(1..8) {
        let place = random.usize(0..stream.len());
        match random.u32(0..6) {
            0 => stream[place] ^= 1 << random.u32(0..8),
            1 => stream[place] = random.u8(..),
            2 => stream.truncate(place.max(1)),
            3 => {
                let end = (place + random.usize(1..40)).min(stream.len());
                stream.drain(place..end);
                if stream.is_empty() {
                    stream.push(0);
                }
            }
            4 => {
                let end = (place + random.usize(1..60)).min(stream.len());
                let copy = stream[place..end].to_vec();
                let to = random.usize(0..=stream.len());
                stream.splice(to..to, copy);
            }
            _ => {
                // A start code, or the bytes of a header.
                let end = (place + 4).min(stream.len());
                stream.splice(place..end, [0, 0, 1, random.u8(..)]);
            }
        }
    }
}

#[test]
fn mutated_streams_do_not_panic() {
    let (seeds, mut random, start) = (seeds(), Rng::with_seed(69), Instant::now());
    let (mut pictures, mut concealed) = (0, 0);
    for number in 0..10_000 {
        let mut stream = seeds[number % seeds.len()].clone();
        // Short streams are enough; the damage is then denser.
        stream.truncate(random.usize(500..6000));
        mutate(&mut stream, &mut random);
        let options = DecoderOptions { show_incomplete: random.bool(), samples_max: 1 << 16 };
        let counts = attempt(&stream, options, random.usize(1..3000));
        pictures += counts[0];
        concealed += counts[1];
    }
    println!("{pictures} pictures with {concealed} concealed macroblocks in {:.1} s", start.elapsed().as_secs_f64());
    assert!(pictures > 10_000 && concealed > 10_000);
}

#[test]
fn random_bytes_do_not_panic() {
    let mut random = Rng::with_seed(7);
    for _ in 0..300 {
        let mut bytes: Vec<u8> = (0..random.usize(1..5000)).map(|_| random.u8(..)).collect();
        // Many start codes.
        for _ in 0..random.usize(0..40) {
            let place = random.usize(0..bytes.len());
            let end = (place + 4).min(bytes.len());
            bytes.splice(
                place..end,
                [0, 0, 1, *random.choice(&[0, 1, 2, 0xb3, 0xb5, 0xb8, 0xba, 0xe0]).expect("a code")],
            );
        }
        attempt(&bytes, DecoderOptions { show_incomplete: true, samples_max: 1 << 16 }, 100);
    }
}

#[test]
fn streams_cut_at_every_byte_of_a_picture() {
    let stream = encoded("64x48", "m2v", "-pix_fmt yuv420p -c:v mpeg2video -bf 1 -q:v 6 -g 4 -f mpeg2video");
    let starts: Vec<usize> = (0..stream.len() - 4).filter(|&i| stream[i..i + 4] == [0, 0, 1, 0]).collect();
    let whole = decoded(&stream, stream.len()).raw();
    for end in starts[3]..starts[4] {
        let found = decoded(&stream[..end], 1000);
        assert!((3..=4).contains(&found.pictures.len()), "{} pictures", found.pictures.len());
        // Complete pictures before the cut are equal.
        let size = whole.len() / 15;
        assert!(found.raw()[..2 * size] == whole[..2 * size], "cut at {end}");
        // The picture at the cut is missing, concealed or, without its last zero bits, complete.
        let damage = found.pictures.iter().map(|picture| picture.damage().macroblocks).sum::<u32>();
        assert!(found.pictures.len() == 3 || damage > 0 || end + 40 > starts[4], "{end} of {}", starts[4]);
    }
}

#[test]
fn concealment_keeps_pictures_similar() {
    // A slow pan, of which one slice per picture is lost.
    let stream = encoded("96x64", "m2v", "-pix_fmt yuv420p -c:v mpeg2video -bf 0 -q:v 3 -g 50 -f mpeg2video");
    let (mut damaged, mut pictures) = (stream.clone(), 0);
    for i in 0..stream.len() - 4 {
        pictures += usize::from(stream[i..i + 4] == [0, 0, 1, 0]);
        if stream[i..i + 4] == [0, 0, 1, 3] && pictures == 9 {
            damaged[i + 5..i + 12].fill(0);
        }
    }
    let (whole, found) = (decoded(&stream, 999), decoded(&damaged, 999));
    assert_eq!(whole.pictures.len(), found.pictures.len());
    assert_eq!((found.counts.damaged_slices, found.pictures[8].damage().slices), (1, 1));
    assert!((1..=6).contains(&found.counts.concealed_macroblocks), "{:?}", found.counts);
    let (size, whole, found) = (96 * 64 * 3 / 2, whole.raw(), found.raw());
    let error = |i: usize| {
        let pairs = whole[i * size..][..size].iter().zip(&found[i * size..][..size]);
        pairs.map(|(&a, &b)| f64::from(a.abs_diff(b)).powi(2)).sum::<f64>() / size as f64
    };
    assert_eq!(error(7), 0.0);
    assert!(error(8) > 0.0 && error(8) < 600.0, "{}", error(8));
}
