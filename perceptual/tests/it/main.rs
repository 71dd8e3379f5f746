//! Tests of masking, tone curves and metrics as their users see them, in one program: a module for each subject.

mod dynamics;
mod feedback;
mod masking;
mod metric;
mod saliency;
mod thresholds;
mod tone_map;
mod ycbcr;
