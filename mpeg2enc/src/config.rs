//! Encoder settings: plain values, validated together.

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
#[must_use = "settings do nothing until they make an encoder"]
pub struct Config {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) frame_rate: FrameRate,
    pub(crate) standard: Standard,
    pub(crate) gop: u32,
    pub(crate) quantiser_scale: u32,
    /// Mean quantiser_scale in 256ths, which replaces `quantiser_scale`.
    mean_quantiser_x256: Option<u32>,
    pub(crate) intra_dc_precision: u32,
    pub(crate) level: Option<Level>,
    /// Level of the stream instead of the lowest one, if the first picture is too large for the lowest one.
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
    /// Maximum look-ahead in frames, for [`Config::with_lookahead`].
    pub const LOOKAHEAD_MAX: u32 = LOOKAHEAD_MAX;

    /// Returns default settings for pictures of this size in luma samples.
    ///
    /// The defaults are an I picture every 15 pictures, quantiser_scale 8, intra DC of 8 bits and no look-ahead.
    ///
    /// Width and height must be 1 to 16383. horizontal_size and vertical_size cannot represent a multiple of 4096 (6.3.3), so one
    /// more sample is coded. Decoders that ignore the display size will show this sample.
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

    /// Sets the standard that the stream follows; the default is MPEG-2.
    pub fn with_standard(self, standard: Standard) -> Self {
        Self { standard, ..self }
    }

    /// Sets the distance between I pictures, 1 to 132.
    pub fn with_gop(self, pictures: u32) -> Self {
        Self { gop: pictures, ..self }
    }

    /// Returns the distance between I pictures.
    #[must_use]
    pub fn gop(&self) -> u32 {
        self.gop
    }

    /// Sets the quantiser_scale of every macroblock: 1 to 8, even values to 62, 64, multiples of 8 to 112.
    pub fn with_quantiser_scale(self, quantiser_scale: u32) -> Self {
        Self { quantiser_scale, mean_quantiser_x256: None, ..self }
    }

    /// Returns the quantiser_scale of every macroblock, unless a mean is requested.
    #[must_use]
    pub fn quantiser_scale(&self) -> u32 {
        self.quantiser_scale
    }

    /// Sets a mean quantiser_scale, clamped to 1 to 112; fractions are allowed.
    ///
    /// If quantisers vary, each macroblock uses the existing value nearest to its target. Otherwise each row of macroblocks uses
    /// one of the two neighboring values, and the mean over the rows equals the request. A mean requires
    /// [`Config::with_lookahead`].
    pub fn with_mean_quantiser_scale(self, quantiser_scale: f64) -> Self {
        // Treat NaN as the finest quantiser.
        let within = if quantiser_scale > 1.0 { quantiser_scale.min(112.0) } else { 1.0 };
        let x256 = (256.0 * within).round() as u32;
        Self { mean_quantiser_x256: Some(x256), ..self }
    }

    /// Returns the base of the macroblocks' quantiser_scale, in 256ths.
    pub(crate) fn quantiser_x256(&self) -> u32 {
        self.mean_quantiser_x256.unwrap_or(256 * self.quantiser_scale)
    }

    /// Sets the bits of the DC coefficient of intra blocks, 8 to 11 (intra_dc_precision, 6.3.10). 11 bits make a stream of High
    /// Profile.
    pub fn with_intra_dc_precision(self, bits: u32) -> Self {
        Self { intra_dc_precision: bits, ..self }
    }

    /// Sets the level of the stream, instead of the lowest one that allows size and rate. At a constant quantiser, pictures that
    /// exceed the level's buffer are coded with a coarser quantiser.
    pub fn with_level(self, level: Level) -> Self {
        Self { level: Some(level), ..self }
    }

    /// Sets how much computation the encoder spends to save bits.
    pub fn with_effort(self, effort: Effort) -> Self {
        Self { effort, ..self }
    }

    /// Sets the maximum number of frames that wait for later frames before they are coded, 0 to 30.
    ///
    /// With 0 every frame is coded immediately, as an I or P picture with one quantiser or with given weights. A look-ahead
    /// allows B pictures, new groups at shot changes, mean quantisers and bit rates. It also allows finer quantisers in areas
    /// from which later pictures are predicted. 30 frames produce the best quality. At a constant quantiser, [`Effort::Fast`]
    /// shortens the look-ahead to the maximum number of consecutive B pictures.
    pub fn with_lookahead(self, frames: u32) -> Self {
        Self { lookahead: frames, ..self }
    }

    /// Returns the maximum number of frames that wait for later frames before they are coded.
    #[must_use]
    pub fn lookahead(&self) -> u32 {
        self.lookahead
    }

    /// Sets the maximum number of consecutive B pictures, 0 to 7. The [look-ahead](Config::with_lookahead) must be at least as
    /// long.
    pub fn with_b_pictures(self, pictures: u32) -> Self {
        Self { b_pictures: pictures, ..self }
    }

    /// Sets whether groups of pictures are closed. A closed group does not depend on the previous group, and begins with its I
    /// picture in display order too.
    pub fn with_closed_gop(self, closed: bool) -> Self {
        Self { closed_gop: closed, ..self }
    }

    /// Sets whether a shot change begins a new group of pictures; needs a look-ahead. The default is true.
    pub fn with_scene_cuts(self, scene_cuts: bool) -> Self {
        Self { scene_cuts, ..self }
    }

    /// Sets whether all macroblocks of an I or P picture have the same quantiser; the default is false. Without a look-ahead
    /// only [`Encoder::push_weighted`](crate::Encoder::push_weighted) varies quantisers, and this setting overrides its
    /// weights.
    pub fn with_uniform_quantiser(self, uniform: bool) -> Self {
        Self { uniform_quantiser: uniform, ..self }
    }

    /// Sets whether quantisers are finer in smooth areas and coarser in busy ones; needs a look-ahead. This improves perceived
    /// quality and SSIM but lowers PSNR. The default is false.
    pub fn with_adaptive_quantisation(self, adaptive: bool) -> Self {
        Self { adaptive_quantisation: adaptive, ..self }
    }

    /// Sets whether coefficients are coded in the order of Figure 7-3, intended for interlaced video, instead of zig-zag order.
    pub fn with_alternate_scan(self, alternate: bool) -> Self {
        Self { alternate_scan: alternate, ..self }
    }

    /// Sets the code table of intra coefficients (intra_vlc_format, 6.3.10). The default is Table B.15, which takes 1 to 3 %
    /// fewer bits on the clips of README.md.
    pub fn with_intra_table(self, table: CoefficientTable) -> Self {
        Self { intra_table: table, ..self }
    }

    /// Sets the weighting matrices in raster order (6.3.11). Weights are 1 to 255; the first intra weight is 8.
    pub fn with_matrices(self, intra: [u8; 64], non_intra: [u8; 64]) -> Self {
        Self { intra_matrix: intra, non_intra_matrix: non_intra, ..self }
    }

    /// Returns the weighting matrices of intra and non-intra blocks, in raster order.
    pub fn matrices(&self) -> ([u8; 64], [u8; 64]) {
        (self.intra_matrix, self.non_intra_matrix)
    }

    /// Returns the bits of the DC coefficient of intra blocks. The step of the DC is 8, 4, 2 or 1 for 8 to 11 bits (7.4.1).
    pub fn intra_dc_precision(&self) -> u32 {
        self.intra_dc_precision
    }

    /// Sets the rate control; all modes except [`Rate::ConstantQuantiser`] need a [look-ahead](Config::with_lookahead).
    pub fn with_rate(self, rate: Rate) -> Self {
        Self { rate, ..self }
    }

    /// Sets the number of the first picture in time codes (6.3.8); the default is 0. A stream that continues another one starts
    /// with the number of pictures before it. [`Packet::display_index`](crate::Packet::display_index) still counts from 0.
    pub fn with_first_number(self, number: u64) -> Self {
        Self { first_number: number, ..self }
    }

    /// Sets primaries, transfer characteristics and matrix of the color description (6.3.6); the default is BT.709. Samples are
    /// not converted. MPEG-1 has no color description.
    pub fn with_color(self, color: ColorDescription) -> Self {
        Self { color, ..self }
    }

    /// Sets the aspect ratio (6.3.3); the default is square samples. MPEG-1 codes the nearest sample aspect ratio.
    pub fn with_aspect(self, aspect: AspectRatio) -> Self {
        Self { aspect, ..self }
    }

    /// Sets whether 24 (or 24000/1001) pictures per second are shown in 30 (or 30000/1001) frames, as on DVD-Video. Every other
    /// picture is shown for three fields (repeat_first_field, 6.3.10). MPEG-1 has no pulldown.
    pub fn with_pulldown(self, pulldown: bool) -> Self {
        Self { pulldown, ..self }
    }

    /// Returns whether macroblocks may have different quantisers.
    pub(crate) fn varies(&self) -> bool {
        self.lookahead > 0 && !self.uniform_quantiser
    }

    /// Returns whether a mean quantiser is requested.
    pub(crate) fn has_mean_quantiser(&self) -> bool {
        self.mean_quantiser_x256.is_some()
    }

    /// Returns whether quantisers are finer in areas from which later pictures are predicted.
    pub(crate) fn uses_tree(&self) -> bool {
        self.varies() && self.effort != Effort::Fast
    }

    /// Returns whether picture types are chosen by content.
    pub(crate) fn adapts_types(&self) -> bool {
        self.effort != Effort::Fast
    }

    /// Returns the number of frames that wait before one is coded. Rate control plans over these frames. With only two or three
    /// of them, an I picture took all the bits: films with [`Effort::Fast`] at constant rates lost 5 dB.
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
