//! Codes each picture immediately, as I or P.

use super::weighted::scales_x16;
use crate::{
    Config, Picture, PictureType, RestoreError,
    bounds::Bounds,
    coder::{Coder, Direction, Packet, PictureJob},
    header::VBV_DELAY_VARIABLE,
    motion::{CoarseSearch, all_candidates, quarter},
    restore::{ensure, is_whole},
    vector::HalfSample,
};
use plane::{Correspondence, Plane};
use std::sync::Arc;

/// State between two pictures.
#[derive(Clone, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Immediate {
    /// Number of pictures coded so far.
    count: u64,
    /// Reconstruction of the last picture, extended to whole macroblocks.
    reference: Option<Arc<Picture>>,
    /// Vectors of the last picture, or an empty list.
    vectors: Vec<HalfSample>,
    bounds: Bounds,
}

impl Immediate {
    /// Codes the next frame, with `weights` as factors of quantiser_scale in 256ths; an I picture ignores `motion`.
    pub fn push(
        &mut self,
        coder: &mut Coder,
        frame: &Picture,
        motion: Option<&Correspondence>,
        weights: Option<Vec<u32>>,
    ) -> Packet {
        let config = &coder.config;
        let (columns, rows) = config.macroblock_counts();
        let place_in_group = self.count % u64::from(config.gop);
        // Pad the frame to whole macroblocks. A new group starts without a reference picture.
        let padded = (!is_whole(frame, columns, rows)).then(|| coder.whole(frame));
        let source = padded.as_deref().unwrap_or(frame);
        let reference = self.reference.take().filter(|_| place_in_group != 0);
        let candidates = match motion.filter(|_| reference.is_some()) {
            Some(field) => all_candidates(field, columns, rows),
            None => Vec::new(),
        };
        // Search for macroblocks without usable motion, coarsely at first.
        let quarters: Option<[Plane<u8>; 2]> = reference
            .as_ref()
            .filter(|_| motion.is_none() || candidates.iter().any(|candidates| candidates.is_uncovered))
            .map(|reference| [quarter(source.luma()), quarter(reference.luma())]);
        let forward = reference.as_ref().map(|reference| Direction {
            reference,
            candidates: &candidates,
            before: &self.vectors,
            coarse: quarters.as_ref().map(|[source, reference]| CoarseSearch { source, reference }),
        });
        // Coarsen the quantiser until the picture fits the buffer of the level.
        let mut settings = coder.config.clone();
        let headers = if forward.is_none() { coder.group_headers(self.count, true) } else { Vec::new() };
        let mut quantiser_scale = settings.quantiser_scale;
        let coded = loop {
            let scales_x16 = match weights.as_ref().filter(|_| !settings.uniform_quantiser) {
                Some(weights) => scales_x16(weights, columns, quantiser_scale, coder.q_scale_type()),
                None => vec![16 * quantiser_scale; columns * rows],
            };
            let coded = coder.code(&PictureJob {
                picture_type: if forward.is_some() { PictureType::P } else { PictureType::I },
                display_index: self.count,
                temporal_reference: place_in_group as u32,
                vbv_delay: VBV_DELAY_VARIABLE,
                source,
                directions: [forward, None],
                quantiser_scale,
                scales_x16: &scales_x16,
            });
            // The first picture selects the level; the buffer of this level then bounds all pictures.
            let bits = coded.packet.bits + 8 * headers.len() as u64;
            self.bounds.begin(&mut coder.config, bits);
            let coarser = self.bounds.coarser(256 * quantiser_scale, bits);
            let coarser = coarser.map(|coarser| settings.quantiser_at_least(coarser.div_ceil(256)));
            let Some(coarser) = coarser.filter(|&coarser| coarser > quantiser_scale) else { break coded };
            quantiser_scale = coarser;
            coder.set_config(coder.config.clone().with_quantiser_scale(coarser));
        };
        // The first picture has now determined the level; headers have the same length at every level.
        let headers = if forward.is_none() { coder.group_headers(self.count, true) } else { Vec::new() };
        // Restore the requested quantiser, but keep the selected level.
        settings.raised = coder.config.raised;
        coder.set_config(settings);
        let mut packet = coded.packet;
        packet.prepend(headers);
        self.bounds.take(packet.bits);
        // Keep the reconstruction and the vectors for the prediction of the next picture.
        let [vectors, _] = coded.vectors;
        self.vectors = vectors;
        self.reference = coded.reference;
        self.count += 1;
        packet
    }

    /// Codes the last picture's reconstruction again: a P picture then has no differences to code.
    pub fn push_again(&mut self, coder: &mut Coder) -> Packet {
        let last = self.reference.clone().expect("a previous picture");
        self.push(coder, &last, None, None)
    }

    /// Sets the level of `config` to the level in the stream's existing headers.
    pub fn restate(&self, config: &mut Config) {
        self.bounds.restate(config);
    }

    /// Checks that an encoder with these settings can continue from this state.
    pub fn check(&self, config: &Config) -> Result<(), RestoreError> {
        let (columns, rows) = config.macroblock_counts();
        let reference = self.reference.as_ref();
        ensure(reference.is_some() == (self.count > 0), "reference picture")?;
        let whole = reference.is_none_or(|reference| is_whole(reference, columns, rows));
        ensure(whole, "size of the reference picture")?;
        self.bounds.check(config, self.count > 0)?;
        let complete = self.vectors.is_empty() || self.vectors.len() == columns * rows;
        ensure(complete && self.vectors.iter().all(|vector| vector.is_plausible()), "vectors")
    }
}
