//! Motion compensation of macroblocks (7.6).

use crate::{
    frame::{FrameMemory, LineSet},
    kernel::{Origin, Target, predict},
};

/// Maximum number of samples of a macroblock: 4:4:4.
const SAMPLES_MAX: usize = 3 * 256;

/// Samples of one macroblock: 16×16 luma, then both chroma blocks.
pub(crate) struct MacroblockBuffer {
    pub samples: [u8; SAMPLES_MAX],
    /// Binary logarithms of the chroma subsampling factors.
    shifts: [u32; 2],
}

/// Plane within a macroblock buffer.
#[derive(Clone, Copy)]
pub(crate) struct BufferPlane {
    pub start: usize,
    pub width: usize,
    pub height: usize,
}

impl MacroblockBuffer {
    pub fn new(shifts: [u32; 2]) -> Self {
        Self { samples: [0; SAMPLES_MAX], shifts }
    }

    /// Returns the position of a component.
    #[inline]
    pub fn plane(&self, component: usize) -> BufferPlane {
        if component == 0 {
            return BufferPlane { start: 0, width: 16, height: 16 };
        }
        let (width, height) = (16 >> self.shifts[0], 16 >> self.shifts[1]);
        BufferPlane { start: 256 + (component - 1) * width * height, width, height }
    }

    /// Copies the samples to macroblock `at`, counted in macroblocks over the lines of `lines`.
    pub fn store(&self, frame: &mut FrameMemory, lines: LineSet, at: [usize; 2]) {
        for component in 0..3 {
            let plane = self.plane(component);
            let stride = frame.shape.plane(component)[0];
            let from = self.samples[plane.start..][..plane.width * plane.height].chunks_exact(plane.width);
            let first = (at[1] * plane.height * lines.step + lines.first) * stride + at[0] * plane.width;
            let step = stride * lines.step;
            let to = frame.planes[component][first..].chunks_mut(step);
            if plane.width == 16 {
                from.zip(to).for_each(|(from, to)| to[..16].copy_from_slice(&from[..16]));
            } else {
                from.zip(to).for_each(|(from, to)| to[..8].copy_from_slice(&from[..8]));
            }
        }
    }
}

/// Prediction of luma rows of one macroblock and of the corresponding chroma rows.
#[derive(Clone, Copy)]
pub(crate) struct BlockPrediction {
    /// Lines of the reference frame.
    pub lines: LineSet,
    /// Upper left luma sample, counted over these lines.
    pub at: [usize; 2],
    /// Vector in half luma samples, over these lines.
    pub vector: [i32; 2],
    /// Rows of the macroblock that are predicted.
    pub rows: LineSet,
    /// Number of luma rows.
    pub height: usize,
    /// Whether the result is averaged with the samples in the buffer.
    pub average: bool,
}

impl BlockPrediction {
    /// Predicts the samples of all components from a frame.
    pub fn run(&self, frame: &FrameMemory, buffer: &mut MacroblockBuffer) {
        for component in 0..3 {
            let plane = buffer.plane(component);
            let [shift_x, shift_y] = if component == 0 { [0, 0] } else { buffer.shifts };
            // Chroma vectors are truncated toward zero (7.6.3.7).
            let vector = [scaled(self.vector[0], shift_x), scaled(self.vector[1], shift_y)];
            let position: [i32; 2] = [(self.at[0] >> shift_x) as i32, (self.at[1] >> shift_y) as i32];
            let corner = [position[0] + (vector[0] >> 1), position[1] + (vector[1] >> 1)];
            let half = vector.map(|v| v & 1 == 1);
            // `rows.first` is a row of a field, or the row of the lower half of a macroblock.
            let first = if self.rows.step == 2 { self.rows.first } else { self.rows.first >> shift_y };
            let target = Target {
                samples: &mut buffer.samples[plane.start + first * plane.width..],
                stride: plane.width * self.rows.step,
                rows: self.height >> shift_y,
                average: self.average,
            };
            let reference = ReferencePlane::new(frame, component, self.lines);
            if plane.width == 16 {
                reference.predict::<16>(corner, half, target);
            } else {
                reference.predict::<8>(corner, half, target);
            }
        }
    }
}

/// Divides by a power of two and truncates toward zero.
#[inline(always)]
fn scaled(v: i32, shift: u32) -> i32 {
    (v + (v >> 31 & ((1 << shift) - 1))) >> shift
}

/// Lines of one plane of a reference frame.
struct ReferencePlane<'a> {
    samples: &'a [u8],
    stride: usize,
    size: [usize; 2],
}

impl<'a> ReferencePlane<'a> {
    fn new(frame: &'a FrameMemory, component: usize, lines: LineSet) -> Self {
        let [width, height] = frame.shape.plane(component);
        let samples = &frame.planes[component][lines.first * width..];
        Self { samples, stride: width * lines.step, size: [width, height / lines.step] }
    }

    #[inline]
    fn predict<const W: usize>(&self, corner: [i32; 2], half: [bool; 2], target: Target) {
        let size = [W + usize::from(half[0]), target.rows + usize::from(half[1])];
        let is_inside = |i: usize| corner[i] >= 0 && corner[i] as usize + size[i] <= self.size[i];
        if is_inside(0) && is_inside(1) {
            let samples = &self.samples[corner[1] as usize * self.stride + corner[0] as usize..];
            predict::<W>(Origin { samples, stride: self.stride, half }, target);
        } else {
            let window = self.clamped(corner);
            predict::<W>(Origin { samples: window.as_flattened(), stride: 17, half }, target);
        }
    }

    /// Returns the samples around a corner outside the plane. Only damaged streams have such vectors.
    #[cold]
    fn clamped(&self, corner: [i32; 2]) -> [[u8; 17]; 17] {
        let clamp = |i: usize, position: i32| position.max(0).min(self.size[i] as i32 - 1) as usize;
        std::array::from_fn(|y| {
            let row = &self.samples[clamp(1, corner[1] + y as i32) * self.stride..];
            std::array::from_fn(|x| row[clamp(0, corner[0] + x as i32)])
        })
    }
}
