//! Tests of the public API of masking, tone curves and metrics, in one program with a module per subject.

mod dynamics;
mod feedback;
mod masking;
mod metric;
mod saliency;
mod thresholds;
mod tone_map;
mod ycbcr;
