//! Coding of one picture (vectors, slices, headers), with or without look-ahead.

use crate::{
    CoefficientTable, Config, Picture, PictureStatistics, PictureType, Standard,
    bits::BitWriter,
    block::places,
    decide::Tools,
    effort::Effort,
    frame::{copy, psnr_of},
    header::{self, PictureHeader},
    motion::{Candidates, CoarseSearch, Estimate},
    picture::{CodedPicture, MacroblockKind, PictureCoder},
    pool::Pool,
    predict::References,
    pulldown::shown,
    quant::{QuantiserParameters, Quantisers},
    quantiser_scale::quantiser_scale_code,
    vector::{HalfSample, f_code},
};
use mpeg2::scan::{ALTERNATE, ZIGZAG};
use plane::Plane;
use std::sync::Arc;

/// One coded picture.
#[derive(Clone, Debug)]
#[must_use = "the packets form the stream"]
#[non_exhaustive]
pub struct Packet {
    /// Bytes of the stream; an I picture begins with sequence and group headers.
    pub data: Vec<u8>,
    /// Index of the frame in display order, from 0.
    pub display_index: u64,
    /// Picture type: I, P or B.
    pub picture_type: PictureType,
    /// Requested quantiser_scale.
    pub quantiser_scale: u32,
    /// quantiser_scale at every macroblock; all values are equal unless settings or weights vary them.
    pub quantiser_scales: Plane<u8>,
    /// quantiser_scale that produced the levels of every macroblock. The stream omits it if all levels are zero.
    scales_of_levels: Plane<u8>,
    /// Coding of every macroblock.
    pub macroblock_kinds: Plane<MacroblockKind>,
    /// Positions of non-zero levels of each macroblock's luma blocks, in transmission order.
    levels: Plane<[u64; 4]>,
    alternate_scan: bool,
    /// Number of bits of `data`.
    pub bits: u64,
    /// Decoded picture, except for the mismatch of inverse transforms that the standard allows.
    pub reconstruction: Arc<Picture>,
    /// PSNR of luma against the source frame, in dB; infinite if they are equal.
    pub psnr_y: f64,
    /// Numbers of macroblocks, and bits by purpose.
    pub statistics: PictureStatistics,
}

/// Reference picture of one direction, with known motion.
#[derive(Clone, Copy)]
pub(crate) struct Direction<'a> {
    pub reference: &'a Picture,
    /// Candidate vectors of every macroblock, or an empty list.
    pub candidates: &'a [Candidates],
    pub before: &'a [HalfSample],
    pub coarse: Option<CoarseSearch<'a>>,
}

/// Parameters for coding one picture.
pub(crate) struct PictureJob<'a> {
    pub picture_type: PictureType,
    pub display_index: u64,
    pub temporal_reference: u32,
    pub vbv_delay: u32,
    /// Picture extended to whole macroblocks.
    pub source: &'a Picture,
    /// Forward and backward direction.
    pub directions: [Option<Direction<'a>>; 2],
    pub quantiser_scale: u32,
    /// Requested quantiser_scale of every macroblock, in sixteenths.
    pub scales_x16: &'a [u32],
}

/// Numbers of macroblocks across and down.
struct Macroblocks {
    coded: (usize, usize),
    /// Numbers of macroblocks that cover the requested picture; less than `coded` if the standard requires more.
    shown: (usize, usize),
}

impl Macroblocks {
    /// Makes a plane of the shown macroblocks from one sample per coded macroblock.
    fn plane<T: Copy>(&self, samples: Vec<T>) -> Plane<T> {
        let coded = Plane::from_vec(self.coded.0, self.coded.1, samples);
        if self.shown == self.coded {
            return coded;
        }
        Plane::from_fn(self.shown.0, self.shown.1, |x, y| coded.get(x, y))
    }
}

/// A packet without sequence and group headers, and data for coding the next picture.
pub(crate) struct CodedPacket {
    pub packet: Packet,
    /// Reconstruction extended to whole macroblocks; `None` for a B picture, because no picture predicts from it.
    pub reference: Option<Arc<Picture>>,
    /// Forward and backward vectors.
    pub vectors: [Vec<HalfSample>; 2],
    /// Length in bytes of the picture header and its extension, after which user data may follow.
    header_bytes: usize,
}

impl CodedPacket {
    /// Pads the packet to at least `bits` bits.
    pub fn fill_to(&mut self, bits: i64) {
        let missing = (bits - self.packet.bits as i64).max(0) as u64;
        if missing > 0 {
            // Insert user data, which may follow only the picture header.
            let filling = header::filling(missing.div_ceil(8) as usize);
            self.packet.data.splice(self.header_bytes..self.header_bytes, filling);
            self.packet.bits = 8 * self.packet.data.len() as u64;
        }
    }
}

/// Codes single pictures with common settings.
pub(crate) struct Coder {
    pub config: Config,
    quantisers: Quantisers,
    pool: Pool,
}

impl Coder {
    pub fn new(config: Config) -> Self {
        let quantisers = Quantisers::new(parameters(&config));
        Self { config, quantisers, pool: Pool::default() }
    }

    /// Adopts other quantiser settings, which must be valid.
    pub fn set_config(&mut self, config: Config) {
        self.config = config;
        let parameters = parameters(&self.config);
        if parameters != self.quantisers.parameters {
            self.quantisers = Quantisers::new(parameters);
        }
    }

    /// Returns q_scale_type, which selects the table of quantiser_scale_code.
    pub fn q_scale_type(&self) -> bool {
        self.quantisers.parameters.q_scale_type
    }

    /// Returns a copy of a frame, extended to whole macroblocks.
    pub fn whole(&mut self, frame: &Picture) -> Arc<Picture> {
        let (columns, rows) = self.config.macroblock_counts();
        self.pool.filled(16 * columns, 16 * rows, |whole| copy(frame, whole)).0
    }

    /// Codes one picture on the current `rayon` pool.
    pub fn code(&mut self, job: &PictureJob) -> CodedPacket {
        let limits = self.config.level().limits();
        let standard = self.config.standard;
        let f_code_max = [limits.f_code_horizontal, limits.f_code_vertical].map(|max| max.min(standard.f_code_max()));
        let effort = self.config.effort;
        // Headers contain the f_code of the longest vectors, so search all vectors before writing.
        let find = |direction: &Option<Direction>| {
            direction.as_ref().map_or(Vec::new(), |direction| {
                Estimate {
                    source: job.source,
                    reference: direction.reference,
                    candidates: direction.candidates,
                    before: direction.before,
                    coarse: direction.coarse,
                    quantiser_scale: job.quantiser_scale,
                    f_code_max,
                    effort,
                }
                .vectors()
            })
        };
        let vectors = [find(&job.directions[0]), find(&job.directions[1])];
        // Choose the smallest f_code that suffices, because larger ones lengthen the codes of vectors.
        let reach = |vectors: &[HalfSample]| {
            let [x, y] = [f_code(vectors.iter().map(|v| v.x)), f_code(vectors.iter().map(|v| v.y))];
            match standard {
                Standard::Mpeg1 => [x.max(y); 2], // one f_code for both components
                Standard::Mpeg2 => [x, y],
            }
        };
        let references: References =
            [&job.directions[0], &job.directions[1]].map(|direction| direction.as_ref().map(|d| d.reference));
        // Count from the start of the film, so that pulldown continues across chunks.
        let number = self.config.first_number + job.display_index;
        let header = PictureHeader {
            picture_type: job.picture_type,
            temporal_reference: job.temporal_reference,
            vbv_delay: job.vbv_delay,
            f_code: [reach(&vectors[0]), reach(&vectors[1])],
            quantisers: self.quantisers.parameters,
            shown: self.config.pulldown.then(|| shown(number, self.config.reorder())),
        };
        let picture = PictureCoder {
            header,
            source: job.source,
            references,
            vectors: [&vectors[0], &vectors[1]],
            quantisers: &self.quantisers,
            scales_x16: job.scales_x16,
            tools: tools(effort, self.config.varies()),
            size: (self.config.width, self.config.height),
        };
        // Reconstruct into reused memory while the slices are coded.
        let (width, height) = (job.source.width(), job.source.height());
        let (whole, coded) = self.pool.filled(width, height, |out| picture.code(out));

        // Measure the header, because padding is inserted after it.
        let mut writer = BitWriter::default();
        header::put_picture_header(&mut writer, &header);
        let header = writer.into_bytes();
        let header_bytes = header.len();
        let packet = self.pack(job, header, &whole, coded);
        let reference = (job.picture_type != PictureType::B).then_some(whole);
        CodedPacket { packet, reference, vectors, header_bytes }
    }

    /// Makes the packet of a picture from the reconstruction `whole`, the coded `header` and the slices.
    fn pack(&mut self, job: &PictureJob, header: Vec<u8>, whole: &Arc<Picture>, coded: CodedPicture) -> Packet {
        let mut data = header;
        data.extend(coded.slices);
        let (width, height) = (self.config.width, self.config.height);
        let (columns, rows) = (job.source.width() / 16, job.source.height() / 16);
        let psnr_y = psnr_of(coded.luma_error, width * height);
        // Without padding, the packet shares the memory of the reference picture.
        let reconstruction = if (whole.width(), whole.height()) == (width, height) {
            whole.clone()
        } else {
            self.pool.filled(width, height, |shown| copy(whole, shown)).0
        };
        // Packets describe only macroblocks of the requested picture.
        let (kinds, levels) = coded.macroblocks.into_iter().unzip();
        let (in_force, of_levels) = coded.quantiser_scales.into_iter().unzip();
        let macroblocks = Macroblocks { coded: (columns, rows), shown: self.config.shown_macroblocks() };
        Packet {
            bits: 8 * data.len() as u64,
            data,
            display_index: job.display_index,
            picture_type: job.picture_type,
            quantiser_scale: job.quantiser_scale,
            quantiser_scales: macroblocks.plane(in_force),
            scales_of_levels: macroblocks.plane(of_levels),
            macroblock_kinds: macroblocks.plane(kinds),
            levels: macroblocks.plane(levels),
            alternate_scan: self.quantisers.parameters.alternate_scan,
            psnr_y,
            reconstruction,
            statistics: coded.statistics,
        }
    }

    /// Returns the sequence and group headers that precede an I picture. `number` is the index of the group's first picture in
    /// display order, from 0.
    pub fn group_headers(&self, number: u64, closed: bool) -> Vec<u8> {
        let mut writer = BitWriter::default();
        header::put_sequence_header(&mut writer, &self.config);
        header::put_group_header(&mut writer, &self.config, self.config.first_number + number, closed);
        writer.into_bytes()
    }
}

impl Packet {
    /// Returns the coded picture for the masking model; it refers to the samples of the reconstruction.
    ///
    /// A macroblock without levels has the quantiser_scale that set them to zero, not the current one of the stream.
    ///
    /// # Panics
    /// If a macroblock field was modified.
    #[must_use]
    pub fn coded(&self) -> plane::Coded {
        let intra = self.macroblock_kinds.map(|kind| kind == MacroblockKind::Intra);
        plane::Coded::new(self.reconstruction.clone(), self.luma_levels(), intra, self.scales_of_levels.clone())
            .expect("the planes belong to one picture")
    }

    /// Returns the coded coefficients of each 8×8 luma block, as a bit set; there are 2×2 blocks per macroblock. Bit 8·v + u
    /// represents horizontal frequency u and vertical frequency v. A set bit means a non-zero level, or the DC of an intra block.
    pub fn luma_levels(&self) -> Plane<u64> {
        let scan = if self.alternate_scan { &ALTERNATE } else { &ZIGZAG };
        // Convert positions in transmission order to raster positions.
        let raster = |set| places(set).fold(0, |raster, place| raster | 1 << scan[place]);
        let (width, height) = (2 * self.levels.width(), 2 * self.levels.height());
        Plane::from_fn(width, height, |x, y| raster(self.levels.get(x / 2, y / 2)[2 * (y % 2) + x % 2]))
    }

    /// Inserts headers before the picture.
    pub(crate) fn prepend(&mut self, mut headers: Vec<u8>) {
        headers.append(&mut self.data);
        self.bits = 8 * headers.len() as u64;
        self.data = headers;
    }
}

/// Returns sequence_end_code.
pub(crate) fn sequence_end() -> Vec<u8> {
    let mut writer = BitWriter::default();
    header::put_sequence_end(&mut writer);
    writer.into_bytes()
}

/// Returns the quantiser parameters. With a look-ahead quantisers vary, so the table with finer steps is used.
fn parameters(config: &Config) -> QuantiserParameters {
    let code = quantiser_scale_code(config.quantiser_scale).expect("the setting was validated");
    let is_mpeg2 = config.standard == Standard::Mpeg2;
    QuantiserParameters {
        standard: config.standard,
        q_scale_type: is_mpeg2 && (config.lookahead > 0 || code.q_scale_type),
        intra_dc_precision: config.intra_dc_precision,
        alternate_scan: config.alternate_scan,
        intra_table: if is_mpeg2 { config.intra_table } else { CoefficientTable::Zero },
        intra_matrix: config.intra_matrix,
        non_intra_matrix: config.non_intra_matrix,
    }
}

fn tools(effort: Effort, varies: bool) -> Tools {
    // For quick decisions a fixed threshold replaces the trellis. The thresholds were tuned on the clips of README.md. Without B
    // pictures, 80 quarters take 2 % more bits than 60 quarters, and 40 quarters take 2 % fewer. Each step changes the time by 3
    // to 5 %. With the trellis, 20 quarters take 0.1 % more bits, or no more bits if decisions are also quick.
    let (quick, thorough) = (60, 10);
    match effort {
        Effort::Fast => Tools {
            quick: true,
            trellis: false,
            predicts_more: false,
            trials: 1,
            intra_halves: 2,
            quantiser_choice: false,
            worth_a_transform_quarters: quick,
        },
        Effort::Balanced => Tools {
            quick: true,
            trellis: true,
            predicts_more: true,
            trials: 2,
            intra_halves: 1,
            quantiser_choice: false,
            worth_a_transform_quarters: 20,
        },
        Effort::Best => Tools {
            quick: false,
            trellis: true,
            predicts_more: true,
            trials: 6,
            intra_halves: 1,
            quantiser_choice: varies,
            worth_a_transform_quarters: thorough,
        },
    }
}
