//! Importance maps from files: of another attention model, or of an eye tracker.
//!
//! A folder contains one map for all frames, or one map for each frame, whose name ends in the frame number. All files
//! are read and checked before the film begins. A map is then decoded again for its frame, because decoded maps of a
//! long film need more memory than its files.

use super::Size;
use pipeline::error::{Error, Result};
use plane::Plane;
use render_core::image_file::decode_gray;
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest relative difference between the aspect ratios of a map and of the film. It permits rounded sizes.
const MOST_DISTORTION: f32 = 0.01;

/// Importance maps of a film, and their weight.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportanceFiles {
    weight: f32,
    folder: PathBuf,
    /// CRC-32 of all files in the folder.
    sum: u32,
    maps: Arc<Maps>,
}

/// Checked content of the files.
#[derive(Debug, PartialEq)]
enum Maps {
    /// The files are not read.
    Unread,
    /// One map for all frames.
    One(MapFile),
    /// Maps by frame number.
    Each(BTreeMap<u32, MapFile>),
}

/// A file that can be decoded.
#[derive(Debug, PartialEq)]
struct MapFile {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl ImportanceFiles {
    /// Parses `FOLDER` or `W:FOLDER`. The default weight is 1.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (weight, folder) = match text.split_once(':') {
            Some((weight, folder)) if weight.parse::<f32>().is_ok() => (parse_weight(weight)?, folder),
            _ => (1.0, text),
        };
        (!folder.is_empty()).then(|| Self { weight, folder: folder.into(), sum: 0, maps: Arc::new(Maps::Unread) })
    }

    /// Returns the weight of the maps, 0…1.
    #[must_use]
    pub fn weight(&self) -> f32 {
        self.weight
    }

    /// Reads and checks the maps of the film frames `frames`, whose pictures have this `size` and `pixel_aspect`.
    ///
    /// # Errors
    /// If the folder or a file cannot be read, the map of a frame is missing, or a map has another aspect ratio than the
    /// film. If a map has colors, or values outside of 0…1.
    pub fn read(&mut self, frames: Range<u32>, size: Size, pixel_aspect: f32) -> Result<()> {
        // Read all maps, since the sum identifies the film of all frames, and keep those of the range.
        let mut sum = crc32fast::Hasher::new();
        let mut read = Vec::new();
        for path in self.paths()? {
            let bytes = fs::read(&path).map_err(Error::file(&path, "cannot be read"))?;
            sum.update(&bytes);
            read.push(MapFile { path, bytes });
        }
        let maps = match read.len() {
            0 => return Err(Error::content(&self.folder, ": the folder has no .png or .exr file")),
            1 => Maps::One(read.remove(0)),
            _ => {
                let mut files = by_frame(read)?;
                files.retain(|frame, _| frames.contains(frame));
                if let Some(frame) = frames.into_iter().find(|frame| !files.contains_key(frame)) {
                    let text = format!(": no map for frame {frame}; names end in the frame number, counted from 0");
                    return Err(Error::content(&self.folder, text));
                }
                Maps::Each(files)
            }
        };

        // Decode each map once, so that no file can fail later.
        let displayed = Size { width: (size.width as f32 * pixel_aspect).round() as usize, ..size };
        for file in maps.files() {
            let map = file.decode()?;
            let fits = [size, displayed].into_iter().any(|size| has_aspect_of(&map, size));
            if !fits {
                let (width, height) = (map.width(), map.height());
                let text = format!(": {width}x{height} pixels have another aspect ratio than the film's {size}");
                return Err(Error::content(&file.path, text));
            }
        }
        (self.sum, self.maps) = (sum.finalize(), Arc::new(maps));
        Ok(())
    }

    /// Returns the paths of all maps in the folder, sorted by name.
    fn paths(&self) -> Result<Vec<PathBuf>> {
        let unreadable = "is no readable folder of importance maps";
        let mut paths = Vec::new();
        for entry in fs::read_dir(&self.folder).map_err(Error::file(&self.folder, unreadable))? {
            let path = entry.map_err(Error::file(&self.folder, unreadable))?.path();
            let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
            if ["png", "exr"].contains(&ending.as_str()) {
                paths.push(path);
            }
        }
        paths.sort();
        Ok(paths)
    }

    /// Returns the map of a frame, averaged or interpolated to `width` × `height` pixels.
    ///
    /// # Panics
    /// If the maps are not [`read`](Self::read).
    pub(crate) fn map(&self, frame: u32, width: usize, height: usize) -> Plane<f32> {
        let file = match &*self.maps {
            Maps::Unread => panic!("the importance maps of {} are not read", self.folder.display()),
            Maps::One(file) => file,
            Maps::Each(files) => &files[&frame],
        };
        resampled(&file.decode().expect("the map was decoded before"), width, height)
    }

    /// Returns the CRC-32 of all files in the folder.
    #[must_use]
    pub fn sum(&self) -> u32 {
        self.sum
    }
}

impl fmt::Display for ImportanceFiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.weight, self.folder.display())
    }
}

impl Maps {
    /// Returns the files in the order of frames.
    fn files(&self) -> Vec<&MapFile> {
        match self {
            Self::Unread => Vec::new(),
            Self::One(file) => vec![file],
            Self::Each(files) => files.values().collect(),
        }
    }
}

impl MapFile {
    fn decode(&self) -> Result<Plane<f32>> {
        decode_gray(&self.path, &self.bytes).map_err(Error::other)
    }
}

/// Parses a weight from 0 to 1.
pub(super) fn parse_weight(text: &str) -> Option<f32> {
    text.parse::<f32>().ok().filter(|weight| (0.0..=1.0).contains(weight))
}

/// Sorts maps by the frame numbers at the ends of their names.
///
/// # Errors
/// If a name lacks a number, or two names have the same number.
fn by_frame(files: Vec<MapFile>) -> Result<BTreeMap<u32, MapFile>> {
    let mut by_frame = BTreeMap::new();
    for file in files {
        let Some(frame) = number_of(&file.path) else {
            return Err(Error::content(&file.path, ": the name must end in the frame number, such as frame_00007"));
        };
        if let Some(other) = by_frame.insert(frame, file) {
            return Err(Error::content(&other.path, format!(": two maps have the frame number {frame}")));
        }
    }
    Ok(by_frame)
}

/// Returns the number at the end of a file's name.
fn number_of(path: &Path) -> Option<u32> {
    let stem = path.file_stem()?.to_str()?;
    let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    stem[stem.len() - digits..].parse().ok()
}

/// Returns whether a map has the aspect ratio of pictures of this `size`.
fn has_aspect_of(map: &Plane<f32>, size: Size) -> bool {
    let ratio = (map.width() as f32 / map.height() as f32) / (size.width as f32 / size.height as f32);
    (ratio - 1.0).abs() <= MOST_DISTORTION
}

/// Returns a map with `width` × `height` pixels. Each pixel has the mean over its area.
fn resampled(map: &Plane<f32>, width: usize, height: usize) -> Plane<f32> {
    if (map.width(), map.height()) == (width, height) {
        return map.clone();
    }
    // Average along the rows, then down the columns.
    let (columns, rows) = (spans(map.width(), width), spans(map.height(), height));
    let narrow = Plane::from_fn(width, map.height(), |x, y| mean(&columns[x], |i| map.get(i, y)));
    Plane::from_fn(width, height, |x, y| mean(&rows[y], |i| narrow.get(x, i)))
}

/// Samples that a pixel covers along one axis.
struct Span {
    start: f32,
    end: f32,
    samples: Range<usize>,
}

/// Returns the samples covered by each of `wanted` pixels, which together cover `count` samples.
fn spans(count: usize, wanted: usize) -> Vec<Span> {
    let step = count as f32 / wanted as f32;
    let span = |i: usize| {
        let (start, end) = (i as f32 * step, ((i + 1) as f32 * step).min(count as f32));
        Span { start, end, samples: start as usize..(end.ceil() as usize).clamp(start as usize + 1, count) }
    };
    (0..wanted).map(span).collect()
}

/// Returns the mean of samples over a span.
fn mean(span: &Span, sample: impl Fn(usize) -> f32) -> f32 {
    let (mut sum, mut whole) = (0.0, 0.0);
    for i in span.samples.clone() {
        let share = span.end.min((i + 1) as f32) - span.start.max(i as f32);
        sum += share * sample(i);
        whole += share;
    }
    sum / whole
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes of maps and films: the mean stays equal, and a linear ramp stays linear.
    #[test]
    fn resampled_maps_keep_their_mean() {
        for (count, wanted) in [(8, 4), (7, 3), (3, 7), (5, 5), (1, 4), (1920, 256)] {
            let map = Plane::from_fn(count, 2 * count, |x, y| (x + 3 * y) as f32 / (8 * count) as f32);
            let found = resampled(&map, wanted, 2 * wanted);
            let mean = |map: &Plane<f32>| {
                map.samples().iter().copied().map(f64::from).sum::<f64>() / map.samples().len() as f64
            };
            assert!((mean(&found) - mean(&map)).abs() < 1e-6, "{count} to {wanted}");
        }
        let map = Plane::from_fn(8, 8, |x, _| x as f32);
        assert_eq!(resampled(&map, 4, 4).row(3), [0.5, 2.5, 4.5, 6.5]);
    }

    #[test]
    fn names_end_in_the_frame_number() {
        for (name, number) in [("frame_00007.png", Some(7)), ("12.exr", Some(12)), ("a.png", None), ("7b.png", None)] {
            assert_eq!(number_of(Path::new(name)), number, "{name}");
        }
        assert_eq!(number_of(Path::new("99999999999.png")), None);
        let file = |path: &str| MapFile { path: path.into(), bytes: Vec::new() };
        let twice = by_frame(vec![file("7.png"), file("07.png")]).unwrap_err().to_string();
        assert!(twice.contains("frame number 7"), "{twice}");
    }
}
