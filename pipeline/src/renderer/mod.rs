//! What makes a frame's light: the plan of what a scene needs.

pub mod plan;
