//! Frame memory and its reuse.

use std::sync::Arc;

/// Size of the memory of a frame: whole macroblocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameShape {
    /// Columns and rows of macroblocks.
    pub macroblocks: [usize; 2],
    /// Binary logarithms of the chroma subsampling factors.
    pub shifts: [u32; 2],
}

impl FrameShape {
    /// Returns the width and height of luma (0) or chroma (1, 2) in samples.
    pub fn plane(&self, component: usize) -> [usize; 2] {
        let [x, y] = if component == 0 { [0, 0] } else { self.shifts };
        [(16 * self.macroblocks[0]) >> x, (16 * self.macroblocks[1]) >> y]
    }
}

/// Lines of a frame: all of them, or one field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LineSet {
    /// First line.
    pub first: usize,
    /// Distance between lines: 1, or 2 for a field.
    pub step: usize,
}

impl LineSet {
    pub const ALL: Self = Self { first: 0, step: 1 };

    /// Returns the lines of one field.
    pub fn field(parity: usize) -> Self {
        Self { first: parity, step: 2 }
    }
}

/// Samples of one frame.
pub(crate) struct FrameMemory {
    pub shape: FrameShape,
    /// Luma and both chroma planes, without gaps between rows.
    pub planes: [Vec<u8>; 3],
    /// User data units of the picture, each with its start code.
    pub user_data: Vec<u8>,
}

impl FrameMemory {
    fn new(shape: FrameShape) -> Self {
        let plane = |component| {
            let [width, height] = shape.plane(component);
            vec![128; width * height]
        };
        Self { shape, planes: [plane(0), plane(1), plane(2)], user_data: Vec::new() }
    }

    /// Sets all samples to gray.
    pub fn fill_gray(&mut self) {
        for plane in &mut self.planes {
            plane.fill(128);
        }
    }

    /// Copies each line of one field to the other field.
    pub fn double_lines(&mut self, parity: usize) {
        for component in 0..3 {
            let [width, _] = self.shape.plane(component);
            for pair in self.planes[component].chunks_exact_mut(2 * width) {
                let (top, bottom) = pair.split_at_mut(width);
                let (from, to) = if parity == 0 { (top, bottom) } else { (bottom, top) };
                to.copy_from_slice(from);
            }
        }
    }
}

/// Maximum number of frames that a pool monitors. Frames beyond it are freed by their last user.
const POOL_MAX: usize = 32;

/// Frames of one shape, in use or free.
pub(crate) struct FramePool {
    frames: Vec<Arc<FrameMemory>>,
}

impl FramePool {
    pub fn new() -> Self {
        Self { frames: Vec::with_capacity(POOL_MAX) }
    }

    /// Returns a frame without other users; its samples are undefined.
    pub fn take(&mut self, shape: FrameShape) -> Arc<FrameMemory> {
        if self.frames.first().is_some_and(|frame| frame.shape != shape) {
            self.frames.clear();
        }
        let free = self.frames.iter_mut().position(|frame| Arc::get_mut(frame).is_some());
        let mut frame = free.map_or_else(|| Arc::new(FrameMemory::new(shape)), |index| self.frames.swap_remove(index));
        if let Some(frame) = Arc::get_mut(&mut frame) {
            frame.user_data.clear();
        }
        frame
    }

    /// Registers a frame, which becomes free when all other users have dropped it.
    pub fn give(&mut self, frame: Arc<FrameMemory>) {
        if self.frames.len() == POOL_MAX {
            self.frames.swap_remove(0);
        }
        self.frames.push(frame);
    }
}
