//! Writes the pictures of a stream as raw planar video: `raw_video INPUT OUTPUT`.
//!
//! Without an output it only decodes, and prints the time.

use mpeg2dec::{DecodedPicture, Input, SampleComponent};
use std::fs::File;
use std::io::{BufWriter, Error, Read, Write};
use std::time::Instant;

fn write(picture: &DecodedPicture, out: &mut impl Write) -> Result<(), Error> {
    for component in SampleComponent::ALL {
        for row in picture.plane(component).rows() {
            out.write_all(row)?;
        }
    }
    Ok(())
}

fn main() -> Result<(), Error> {
    let mut arguments = std::env::args().skip(1);
    let Some(path) = arguments.next() else {
        return Err(Error::other("usage: raw_video INPUT [OUTPUT]"));
    };
    let mut out = match arguments.next() {
        Some(path) => Some(BufWriter::new(File::create(path)?)),
        None => None,
    };
    let (mut file, mut input) = (File::open(&path)?, Input::default());
    let (mut piece, mut result) = (vec![0; 1 << 16], Ok(()));
    let start = Instant::now();
    let mut show = |picture: DecodedPicture| {
        if let (Some(out), Ok(())) = (&mut out, &result) {
            result = write(&picture, out);
        }
    };
    loop {
        match file.read(&mut piece)? {
            0 => break,
            count => input.push(&piece[..count], &mut show),
        }
    }
    input.flush(&mut show);
    let (counts, seconds) = (input.counts(), start.elapsed().as_secs_f64());
    eprintln!("{counts:?} in {seconds:.3} s, {:.1} pictures/s", counts.pictures as f64 / seconds);
    result
}
