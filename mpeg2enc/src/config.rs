//! The settings of an encoder: plain values, checked once.

mod fingerprint;
mod geometry;
mod stated;
mod validate;

use crate::{
    AspectRatio, CoefficientTable, ColorDescription, Effort, FrameRate, Level, Rate, Standard, limits::LOOKAHEAD_MAX,
};
pub(crate) use geometry::coded_size;
use plane::matrices::{DEFAULT_INTRA_MATRIX, DEFAULT_NON_INTRA_MATRIX};

/// Settings of an [`Encoder`](crate::Encoder); [`Config::validate`] checks them.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[must_use = "settings do nothing until an encoder is made of them"]
pub struct Config {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) frame_rate: FrameRate,
    pub(crate) standard: Standard,
    pub(crate) gop: u32,
    pub(crate) quantiser_scale: u32,
    /// In 256ths, in the place of `quantiser_scale`.
    mean_quantiser_x256: Option<u32>,
    pub(crate) intra_dc_precision: u32,
    pub(crate) level: Option<Level>,
    /// The level above those that size and rate need, which the first picture has required.
    pub(crate) raised: Option<Level>,
    pub(crate) effort: Effort,
    pub(crate) lookahead: u32,
    pub(crate) b_pictures: u32,
    pub(crate) closed_gop: bool,
    pub(crate) scene_cuts: bool,
    pub(crate) uniform_quantiser: bool,
    pub(crate) adaptive_quantisation: bool,
    pub(crate) alternate_scan: bool,
    pub(crate) intra_table: CoefficientTable,
    pub(crate) intra_matrix: [u8; 64],
    pub(crate) non_intra_matrix: [u8; 64],
    pub(crate) rate: Rate,
    /// Number of the first picture in time codes.
    pub(crate) first_number: u64,
    pub(crate) color: ColorDescription,
    pub(crate) aspect: AspectRatio,
    pub(crate) pulldown: bool,
}

impl Config {
    /// The most frames of [`Config::with_lookahead`].
    pub const LOOKAHEAD_MAX: u32 = LOOKAHEAD_MAX;

    /// Pictures of this size, in luma samples: an I picture every 15, quantiser_scale 8, intra DC of 8 bits, no look-ahead.
    ///
    /// Width and height go from 1 to 16383. A multiple of 4096 cannot be written as horizontal_size or vertical_size
    /// (6.3.3): it is coded as one sample more, which decoders that do not look at the display size will show.
    pub fn new(width: usize, height: usize, frame_rate: FrameRate) -> Self {
        Self {
            width,
            height,
            frame_rate,
            standard: Standard::default(),
            gop: 15,
            quantiser_scale: 8,
            mean_quantiser_x256: None,
            intra_dc_precision: 8,
            level: None,
            raised: None,
            effort: Effort::default(),
            lookahead: 0,
            b_pictures: 0,
            closed_gop: false,
            scene_cuts: true,
            uniform_quantiser: false,
            adaptive_quantisation: false,
            alternate_scan: false,
            intra_table: CoefficientTable::One,
            intra_matrix: DEFAULT_INTRA_MATRIX,
            non_intra_matrix: DEFAULT_NON_INTRA_MATRIX,
            rate: Rate::default(),
            first_number: 0,
            color: ColorDescription::default(),
            aspect: AspectRatio::default(),
            pulldown: false,
        }
    }

    /// The standard that the stream follows: MPEG-2 unless another is requested.
    pub fn with_standard(self, standard: Standard) -> Self {
        Self { standard, ..self }
    }

    /// Distance between I pictures, 1 to 132.
    pub fn with_gop(self, pictures: u32) -> Self {
        Self { gop: pictures, ..self }
    }

    /// Distance between I pictures.
    #[must_use]
    pub fn gop(&self) -> u32 {
        self.gop
    }

    /// Quantiser of every macroblock: 1 to 8, even values to 62, 64, multiples of 8 to 112.
    pub fn with_quantiser_scale(self, quantiser_scale: u32) -> Self {
        Self { quantiser_scale, mean_quantiser_x256: None, ..self }
    }

    /// Quantiser of every macroblock, where no mean is requested.
    #[must_use]
    pub fn quantiser_scale(&self) -> u32 {
        self.quantiser_scale
    }

    /// A quantiser between those that exist, from 1 to 112: each macroblock gets the nearest to what it would have, or, where they do
    /// not vary, each row of them one of the two around, so that their mean follows any fraction. Needs
    /// [`Config::with_lookahead`]; what is beyond 1 to 112 is brought there.
    pub fn with_mean_quantiser_scale(self, quantiser_scale: f64) -> Self {
        // What is no number counts as the finest.
        let within = if quantiser_scale > 1.0 { quantiser_scale.min(112.0) } else { 1.0 };
        let x256 = (256.0 * within).round() as u32;
        Self { mean_quantiser_x256: Some(x256), ..self }
    }

    /// First value of macroblocks' quantisers, in 256ths.
    pub(crate) fn quantiser_x256(&self) -> u32 {
        self.mean_quantiser_x256.unwrap_or(256 * self.quantiser_scale)
    }

    /// Bits of the DC coefficient of intra blocks, 8 to 11 (intra_dc_precision, 6.3.10). 11 are in High Profile only, which the
    /// stream states then.
    pub fn with_intra_dc_precision(self, bits: u32) -> Self {
        Self { intra_dc_precision: bits, ..self }
    }

    /// States this level instead of the lowest that holds size and rate. At a constant quantiser, pictures that its buffer does not hold
    /// are coded coarser.
    pub fn with_level(self, level: Level) -> Self {
        Self { level: Some(level), ..self }
    }

    /// How much is tried for few bits.
    pub fn with_effort(self, effort: Effort) -> Self {
        Self { effort, ..self }
    }

    /// The most frames that wait for later ones before they are coded, 0 to 30.
    ///
    /// At 0 every frame is coded as it comes, as an I or P picture with one quantiser or with those of given weights. A look-ahead
    /// allows B pictures, new groups at scene cuts, quantisers that follow what later pictures inherit, means of quantisers, and
    /// bit rates. 30 frames give the best quality. [`Effort::Fast`] at a constant quantiser waits only for as many as there are B
    /// pictures in a row.
    pub fn with_lookahead(self, frames: u32) -> Self {
        Self { lookahead: frames, ..self }
    }

    /// The most frames that wait for later ones before they are coded.
    #[must_use]
    pub fn lookahead(&self) -> u32 {
        self.lookahead
    }

    /// The most B pictures in a row, 0 to 7; they need a [look-ahead](Config::with_lookahead) of as many frames.
    pub fn with_b_pictures(self, pictures: u32) -> Self {
        Self { b_pictures: pictures, ..self }
    }

    /// Whether no group of pictures needs the group before: no B pictures in front of its I picture then.
    pub fn with_closed_gop(self, closed: bool) -> Self {
        Self { closed_gop: closed, ..self }
    }

    /// Whether an encoder that looks ahead begins a group of pictures where a new scene begins. On unless switched off.
    pub fn with_scene_cuts(self, scene_cuts: bool) -> Self {
        Self { scene_cuts, ..self }
    }

    /// Whether an encoder that looks ahead leaves the quantiser of I and P pictures the same everywhere. Without a look-ahead it is
    /// the same unless [`Encoder::push_weighted`](crate::Encoder::push_weighted) is given weights, which this switches off.
    pub fn with_uniform_quantiser(self, uniform: bool) -> Self {
        Self { uniform_quantiser: uniform, ..self }
    }

    /// Whether an encoder that looks ahead makes quantisers finer where the picture is smooth and coarser where it is busy,
    /// which eyes and SSIM prefer; PSNR falls. Off unless switched on.
    pub fn with_adaptive_quantisation(self, adaptive: bool) -> Self {
        Self { adaptive_quantisation: adaptive, ..self }
    }

    /// Whether coefficients are sent in the order of Figure 7-3, meant for interlace, instead of zig-zag.
    pub fn with_alternate_scan(self, alternate: bool) -> Self {
        Self { alternate_scan: alternate, ..self }
    }

    /// The table that coefficients of intra blocks are coded with (intra_vlc_format, 6.3.10): Table B.15 unless another is
    /// requested, which takes 1 to 3 % fewer bits over the clips of README.md.
    pub fn with_intra_table(self, table: CoefficientTable) -> Self {
        Self { intra_table: table, ..self }
    }

    /// Weighting matrices in raster order (6.3.11): weights of 1 to 255, the first of the intra matrix 8.
    pub fn with_matrices(self, intra: [u8; 64], non_intra: [u8; 64]) -> Self {
        Self { intra_matrix: intra, non_intra_matrix: non_intra, ..self }
    }

    /// Weighting matrices of intra and of predicted blocks, in raster order.
    pub fn matrices(&self) -> ([u8; 64], [u8; 64]) {
        (self.intra_matrix, self.non_intra_matrix)
    }

    /// Bits of the DC coefficient of intra blocks; its step is 8, 4, 2, 1 for 8 to 11 (7.4.1).
    pub fn intra_dc_precision(&self) -> u32 {
        self.intra_dc_precision
    }

    /// How quantisers are chosen; all but [`Rate::ConstantQuantiser`] need a [look-ahead](Config::with_lookahead).
    pub fn with_rate(self, rate: Rate) -> Self {
        Self { rate, ..self }
    }

    /// Number of the first picture in time codes (6.3.8): that of a stream which is to follow `number` pictures. 0 unless another is
    /// requested. [`Packet::display_index`](crate::Packet::display_index) counts from 0 all the same.
    pub fn with_first_number(self, number: u64) -> Self {
        Self { first_number: number, ..self }
    }

    /// States these primaries, transfer characteristics and matrix (6.3.6): BT.709 unless others are requested. Samples are coded
    /// as they come. MPEG-1 states no color.
    pub fn with_color(self, color: ColorDescription) -> Self {
        Self { color, ..self }
    }

    /// States this shape (6.3.3): square samples unless another is requested. MPEG-1 states the nearest shape of a sample.
    pub fn with_aspect(self, aspect: AspectRatio) -> Self {
        Self { aspect, ..self }
    }

    /// Whether 24 pictures a second, or 24000/1001, are shown in 30 frames, or 30000/1001, as DVD-Video has them: every other picture
    /// for three fields (repeat_first_field, 6.3.10). Not in MPEG-1.
    pub fn with_pulldown(self, pulldown: bool) -> Self {
        Self { pulldown, ..self }
    }

    /// May macroblocks have quantisers of their own?
    pub(crate) fn varies(&self) -> bool {
        self.lookahead > 0 && !self.uniform_quantiser
    }

    /// Is the quantiser a mean of those that macroblocks have?
    pub(crate) fn has_mean_quantiser(&self) -> bool {
        self.mean_quantiser_x256.is_some()
    }

    /// Does quality follow what later pictures take over?
    pub(crate) fn uses_tree(&self) -> bool {
        self.varies() && self.effort != Effort::Fast
    }

    /// Are B pictures placed by content?
    pub(crate) fn adapts_types(&self) -> bool {
        self.effort != Effort::Fast
    }

    /// Frames that wait before one is coded. Within a rate they tell how bits will be spent: with two or three of them alone,
    /// an I picture among these took all bits, and fast films at constant rates were 5 dB worse.
    pub(crate) fn delay(&self) -> usize {
        let needed = match self.effort {
            Effort::Fast if self.rate == Rate::ConstantQuantiser => self.b_pictures,
            _ => LOOKAHEAD_MAX,
        };
        needed.min(self.lookahead) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_brought_within_what_exists() {
        for (requested, x256) in
            [(f64::NAN, 256), (-3.0, 256), (2.5, 640), (1e9, 112 * 256), (f64::INFINITY, 112 * 256)]
        {
            let config = Config::new(16, 16, FrameRate::FPS_25);
            assert_eq!(config.with_mean_quantiser_scale(requested).quantiser_x256(), x256, "{requested}");
        }
    }
}
