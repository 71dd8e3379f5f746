//! One picture: vectors, slices, headers. What zero-delay and lookahead coding have in common.

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
    scan::{ALTERNATE, ZIGZAG},
    vector::{HalfSample, f_code},
};
use plane::Plane;
use std::sync::Arc;

/// One coded picture.
#[derive(Clone, Debug)]
#[must_use = "packets are the stream"]
#[non_exhaustive]
pub struct Packet {
    /// Its part of the stream; an I picture's begins with sequence and group headers.
    pub data: Vec<u8>,
    /// Place of the frame among those that came in, from 0: the order in which pictures are shown.
    pub display_index: u64,
    /// Intra, predicted, or predicted from both sides.
    pub picture_type: PictureType,
    /// The requested quantiser_scale.
    pub quantiser_scale: u32,
    /// quantiser_scale in force at every macroblock: all the same unless settings or weights vary it.
    pub quantiser_scales: Plane<u8>,
    /// quantiser_scale that made the levels of every macroblock. Where all became zero the stream does not write it.
    scales_of_levels: Plane<u8>,
    /// How every macroblock was coded.
    pub macroblock_kinds: Plane<MacroblockKind>,
    /// For every macroblock, places of the levels of its luma blocks in transmission order.
    levels: Plane<[u64; 4]>,
    alternate_scan: bool,
    /// Bits of `data`.
    pub bits: u64,
    /// The decoded picture, to within the differences of inverse transforms that the standard allows.
    pub reconstruction: Arc<Picture>,
    /// PSNR of luma against the frame that came in, dB; infinite if nothing was lost.
    pub psnr_y: f64,
    /// Use of the bits.
    pub statistics: PictureStatistics,
}

/// Where vectors of one direction are searched, and what is known of them.
#[derive(Clone, Copy)]
pub(crate) struct Direction<'a> {
    pub reference: &'a Picture,
    /// Candidates of every macroblock, or empty.
    pub candidates: &'a [Candidates],
    pub before: &'a [HalfSample],
    pub coarse: Option<CoarseSearch<'a>>,
}

/// The coding of one picture, as it is wanted.
pub(crate) struct PictureJob<'a> {
    pub picture_type: PictureType,
    pub display_index: u64,
    pub temporal_reference: u32,
    pub vbv_delay: u32,
    /// The picture in whole macroblocks.
    pub source: &'a Picture,
    /// Forward and backward.
    pub directions: [Option<Direction<'a>>; 2],
    pub quantiser_scale: u32,
    /// The requested quantiser_scale of every macroblock, in sixteenths.
    pub scales_x16: &'a [u32],
}

/// Counts of macroblocks across and down.
struct Macroblocks {
    coded: (usize, usize),
    /// Fewer than `coded` where the standard requires macroblocks outside of the requested picture.
    shown: (usize, usize),
}

impl Macroblocks {
    /// The samples of the shown macroblocks, of one sample for each coded macroblock.
    fn plane<T: Copy>(&self, samples: Vec<T>) -> Plane<T> {
        let coded = Plane::from_vec(self.coded.0, self.coded.1, samples);
        if self.shown == self.coded {
            return coded;
        }
        Plane::from_fn(self.shown.0, self.shown.1, |x, y| coded.get(x, y))
    }
}

/// A packet without sequence and group headers, and what the next picture needs.
pub(crate) struct CodedPacket {
    pub packet: Packet,
    /// In whole macroblocks; of a B picture, from which nothing is predicted, there is none.
    pub reference: Option<Arc<Picture>>,
    /// Forward and backward.
    pub vectors: [Vec<HalfSample>; 2],
    /// Bytes of the picture header and its extension, after which user data may follow.
    header_bytes: usize,
}

impl CodedPacket {
    /// Brings the packet to at least `bits` bits.
    pub fn fill_to(&mut self, bits: i64) {
        let missing = (bits - self.packet.bits as i64).max(0) as u64;
        if missing > 0 {
            let filling = header::filling(missing.div_ceil(8) as usize);
            self.packet.data.splice(self.header_bytes..self.header_bytes, filling);
            self.packet.bits = 8 * self.packet.data.len() as u64;
        }
    }
}

/// Codes pictures one after the other, each by itself.
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

    /// Uses other settings of quantisers, which were checked.
    pub fn set_config(&mut self, config: Config) {
        self.config = config;
        let parameters = parameters(&self.config);
        if parameters != self.quantisers.parameters {
            self.quantisers = Quantisers::new(parameters);
        }
    }

    /// q_scale_type: the table of quantiser_scale_code.
    pub fn q_scale_type(&self) -> bool {
        self.quantisers.parameters.q_scale_type
    }

    /// A copy of a frame in whole macroblocks.
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
        let reach = |vectors: &[HalfSample]| {
            let [x, y] = [f_code(vectors.iter().map(|v| v.x)), f_code(vectors.iter().map(|v| v.y))];
            match standard {
                Standard::Mpeg1 => [x.max(y); 2], // one for both
                Standard::Mpeg2 => [x, y],
            }
        };
        let references: References =
            [&job.directions[0], &job.directions[1]].map(|direction| direction.as_ref().map(|d| d.reference));
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
        let (width, height) = (job.source.width(), job.source.height());
        let (whole, coded) = self.pool.filled(width, height, |out| picture.code(out));

        let mut writer = BitWriter::default();
        header::put_picture_header(&mut writer, &header);
        let header = writer.into_bytes();
        let header_bytes = header.len();
        let packet = self.pack(job, header, &whole, coded);
        let reference = (job.picture_type != PictureType::B).then_some(whole);
        CodedPacket { packet, reference, vectors, header_bytes }
    }

    /// The packet of a picture, `whole` in its macroblocks, with this coded `header`.
    fn pack(&mut self, job: &PictureJob, header: Vec<u8>, whole: &Arc<Picture>, coded: CodedPicture) -> Packet {
        let mut data = header;
        data.extend(coded.slices);
        let (width, height) = (self.config.width, self.config.height);
        let (columns, rows) = (job.source.width() / 16, job.source.height() / 16);
        let psnr_y = psnr_of(coded.luma_error, width * height);
        let reconstruction = if (whole.width(), whole.height()) == (width, height) {
            whole.clone()
        } else {
            self.pool.filled(width, height, |shown| copy(whole, shown)).0
        };
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

    /// Sequence and group headers, which stand in front of an I picture; `number` is the first picture of the group to
    /// be shown, counted from the encoder's first.
    pub fn group_headers(&self, number: u64, closed: bool) -> Vec<u8> {
        let mut writer = BitWriter::default();
        header::put_sequence_header(&mut writer, &self.config);
        header::put_group_header(&mut writer, &self.config, self.config.first_number + number, closed);
        writer.into_bytes()
    }
}

impl Packet {
    /// The coded picture as masking sees it. It shares the samples of the reconstruction.
    ///
    /// A macroblock without levels has the quantiser_scale that made them zero, whichever was in force where it lies.
    ///
    /// # Panics
    /// If a field was changed that tells of the macroblocks.
    #[must_use]
    pub fn coded(&self) -> plane::Coded {
        let intra = self.macroblock_kinds.map(|kind| kind == MacroblockKind::Intra);
        plane::Coded::new(self.reconstruction.clone(), self.luma_levels(), intra, self.scales_of_levels.clone())
            .expect("planes of one picture")
    }

    /// Coefficients that were written of each 8×8 block of luma. Bit 8·v + u of a block's number is set where the level of
    /// the coefficient of frequency u across and v down is not zero, and for the DC of an intra block. Two blocks across and
    /// two down for every macroblock.
    pub fn luma_levels(&self) -> Plane<u64> {
        let scan = if self.alternate_scan { &ALTERNATE } else { &ZIGZAG };
        let raster = |set| places(set).fold(0, |raster, place| raster | 1 << scan[place]);
        let (width, height) = (2 * self.levels.width(), 2 * self.levels.height());
        Plane::from_fn(width, height, |x, y| raster(self.levels.get(x / 2, y / 2)[2 * (y % 2) + x % 2]))
    }

    /// Puts headers in front.
    pub(crate) fn prepend(&mut self, mut headers: Vec<u8>) {
        headers.append(&mut self.data);
        self.bits = 8 * headers.len() as u64;
        self.data = headers;
    }
}

/// sequence_end_code.
pub(crate) fn sequence_end() -> Vec<u8> {
    let mut writer = BitWriter::default();
    header::put_sequence_end(&mut writer);
    writer.into_bytes()
}

/// An encoder that looks ahead varies quantisers: it uses the table with finer steps.
fn parameters(config: &Config) -> QuantiserParameters {
    let code = quantiser_scale_code(config.quantiser_scale).expect("checked when it was set");
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
    // Where it shall be quick, a fixed bound does what the trellis does elsewhere. Tuned on the clips of README.md: without B
    // pictures 80 quarters take 2 % more bits than 60, and 40 take 2 % less; each step is 3 to 5 % of the time. With the trellis, 20 cost 0.1 %,
    // and nothing where decisions are quick.
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
