//! Pictures in, packets out.

use crate::{
    Config, ConfigError, Frame, MotionField,
    bits::BitWriter,
    config::quantiser_scale_code,
    frame::psnr,
    header::{self, PictureHeader, PictureType, macroblock_counts},
    motion::{Estimate, HalfSample, f_code},
    picture::{Picture, PictureStatistics},
    quant::Quantiser,
};

/// Encodes pictures one by one; made by [`Config::encoder`].
pub struct Encoder {
    config: Config,
    /// Pictures coded so far.
    count: u64,
    /// Reconstruction of the last picture, in whole macroblocks.
    reference: Option<Frame>,
    /// Vectors of the last picture, or empty.
    vectors: Vec<HalfSample>,
}

/// One coded picture.
#[derive(Clone, Debug)]
pub struct Packet {
    /// Its part of the stream; an I picture's begins with sequence and group headers.
    pub data: Vec<u8>,
    /// Intra or predicted.
    pub picture_type: PictureType,
    /// quantiser_scale of every macroblock.
    pub quantiser_scale: u32,
    /// Bits of `data`.
    pub bits: u64,
    /// What a decoder shows, to within the differences of inverse transforms that the standard allows.
    pub reconstruction: Frame,
    /// PSNR of luma against the frame that came in, dB; infinite if nothing was lost.
    pub psnr_y: f64,
    /// What the bits were spent on.
    pub statistics: PictureStatistics,
}

impl Encoder {
    pub(crate) fn new(config: Config) -> Self {
        Self { config, count: 0, reference: None, vectors: Vec::new() }
    }

    /// The settings it was made with.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Uses another quantiser from the next picture on.
    pub fn set_quantiser_scale(&mut self, quantiser_scale: u32) -> Result<(), ConfigError> {
        quantiser_scale_code(quantiser_scale)?;
        self.config.quantiser_scale = quantiser_scale;
        Ok(())
    }

    /// Encodes the next frame.
    ///
    /// `motion` tells where each pixel was in the frame before; without it, vectors are searched for.
    /// It changes what is tried, never what is correct, and is not looked at for an I picture.
    ///
    /// # Panics
    /// If frame or motion field have another size than the [`Config`].
    pub fn push(&mut self, frame: &Frame, motion: Option<&MotionField>) -> Packet {
        let size = (self.config.width, self.config.height);
        assert_eq!((frame.width(), frame.height()), size, "a frame of another size than the encoder's");
        frame.check().unwrap_or_else(|error| panic!("{error}"));
        if let Some(motion) = motion.map(MotionField::motion_px) {
            assert_eq!((motion.width(), motion.height()), size, "a motion field of another size than the encoder's");
        }
        let (columns, rows) = macroblock_counts(size.0, size.1);
        let source = frame.resized(16 * columns, 16 * rows);
        let quantiser_scale = self.config.quantiser_scale;
        let place_in_group = self.count % u64::from(self.config.gop);
        let reference = self.reference.take().filter(|_| place_in_group != 0);
        self.vectors = match &reference {
            None => Vec::new(),
            Some(reference) => {
                let limits = self.config.level().limits();
                let f_code_max = [limits.f_code_horizontal, limits.f_code_vertical];
                let before = &self.vectors;
                Estimate { source: &source, reference, field: motion, before, quantiser_scale, f_code_max }.vectors()
            }
        };
        let picture_type = if reference.is_some() { PictureType::P } else { PictureType::I };
        let header = PictureHeader {
            picture_type,
            temporal_reference: place_in_group as u32,
            f_code: [f_code(self.vectors.iter().map(|v| v.x)), f_code(self.vectors.iter().map(|v| v.y))],
            intra_dc_precision: self.config.intra_dc_precision,
            quantiser: quantiser_scale_code(quantiser_scale).expect("checked when it was set"),
        };
        let coded = Picture {
            header,
            source: &source,
            reference: reference.as_ref(),
            vectors: &self.vectors,
            quantiser: &Quantiser::new(quantiser_scale, self.config.intra_dc_precision),
            height: size.1,
        }
        .code();

        let mut writer = BitWriter::default();
        if picture_type == PictureType::I {
            header::put_sequence_header(&mut writer, &self.config);
            header::put_group_header(&mut writer, &self.config, self.count);
        }
        header::put_picture_header(&mut writer, &header);
        let mut data = writer.into_bytes();
        data.extend(coded.slices);
        let reconstruction = coded.reconstruction.resized(size.0, size.1);
        self.reference = Some(coded.reconstruction);
        self.count += 1;
        Packet {
            bits: 8 * data.len() as u64,
            data,
            picture_type,
            quantiser_scale,
            psnr_y: psnr(&frame.luma, &reconstruction.luma),
            reconstruction,
            statistics: coded.statistics,
        }
    }

    /// The end of the stream: sequence_end_code.
    pub fn finish(self) -> Vec<u8> {
        let mut writer = BitWriter::default();
        header::put_sequence_end(&mut writer);
        writer.into_bytes()
    }
}
