//! Input files: frames, and optionally their motion.

use super::{
    arguments::Arguments,
    y4m::{Format, MAKE, Reader},
};
use anyhow::{Context, Result, ensure};
use mpeg2enc::{Picture, SuppliedMotion};
use plane::{Correspondence, Plane};
use std::{
    fs::File,
    io::{BufReader, Read},
    path::{Path, PathBuf},
};

/// Size of the read buffer, in bytes.
const BUFFER: usize = 1 << 16;

/// Reads frames and motion, starting with the first frame.
pub struct Clip<'a> {
    name: String,
    reader: Reader<BufReader<Box<dyn Read + Send + 'a>>>,
    motion: [Option<Motion>; 2],
    /// The last frame read, and its motion to the previous and next frame.
    frame: Picture,
    known: [Option<Correspondence>; 2],
}

/// An open motion file.
struct Motion {
    path: PathBuf,
    file: File,
}

/// Returns whether `path` is standard input, under any of its names.
pub fn is_standard_input(path: &Path) -> bool {
    ["-", "/dev/stdin", "/dev/fd/0", "/proc/self/fd/0"].iter().any(|name| path == Path::new(name))
}

impl<'a> Clip<'a> {
    /// Opens the files and reads the header; `standard` is standard input.
    pub fn open(arguments: &Arguments, standard: &'a mut (dyn Read + Send)) -> Result<Self> {
        let open = |path: &PathBuf| File::open(path).with_context(|| format!("{} cannot be read", path.display()));
        let (name, input): (_, Box<dyn Read + Send>) = match &arguments.input {
            path if is_standard_input(path) => ("standard input".into(), Box::new(standard)),
            path => (path.display().to_string(), Box::new(open(path)?)),
        };
        let reader = Reader::new(BufReader::with_capacity(BUFFER, input)).with_context(|| name.clone())?;
        let motion = |path: &PathBuf| anyhow::Ok(Motion { path: path.clone(), file: open(path)? });
        let motion = [
            arguments.motion.as_ref().map(motion).transpose()?,
            arguments.motion_next.as_ref().map(motion).transpose()?,
        ];
        let frame = Picture::default();
        Ok(Self { name, reader, motion, frame, known: [None, None] })
    }

    pub fn format(&self) -> &Format {
        &self.reader.format
    }

    /// Returns the name of the clip for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Reads the next frame and its known motion; `None` after the last one. A clip without frames is an error.
    pub fn next(&mut self) -> Result<Option<(&Picture, SuppliedMotion<'_>)>> {
        let (number, size) = (self.reader.count(), (self.reader.format.width, self.reader.format.height));
        // Allocate the picture once; later frames reuse it.
        if number == 0 {
            self.frame = Picture::black(size.0, size.1);
        }
        if !self.reader.read(&mut self.frame).with_context(|| self.name.clone())? {
            ensure!(number > 0, "{} contains no frame after its header; {MAKE}", self.name);
            return Ok(None);
        }
        for (motion, known) in self.motion.iter_mut().zip(&mut self.known) {
            if let Some(motion) = motion {
                *known = Some(motion.read(number, size)?);
            }
        }
        let [to_previous, to_next] = self.known.each_ref().map(Option::as_ref);
        Ok(Some((&self.frame, SuppliedMotion { to_previous, to_next })))
    }
}

impl Motion {
    /// Reads the motion of a frame, in 64ths of a pixel. Motion from the first frame to a previous one has no effect, but must
    /// be in the file.
    fn read(&mut self, frame: u64, (width, height): (usize, usize)) -> Result<Correspondence> {
        let mut motion = Plane::filled(width, height, [0i16; 2]);
        let components = motion.samples_mut().as_flattened_mut();
        self.file
            .read_exact(bytemuck::cast_slice_mut(components))
            .with_context(|| format!("{} ends within the motion of frame {frame}", self.path.display()))?;
        if cfg!(target_endian = "big") {
            components.iter_mut().for_each(|component| *component = i16::from_le(*component));
        }
        Ok(Correspondence::from_motion(motion.map(in_pixels)))
    }
}

/// Converts a vector of a motion file to pixels; a component of `i16::MIN` means that the pixel was not visible.
fn in_pixels(vector_64ths: [i16; 2]) -> [f32; 2] {
    if vector_64ths.contains(&i16::MIN) { [f32::NAN; 2] } else { vector_64ths.map(|part| f32::from(part) / 64.0) }
}
