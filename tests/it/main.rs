//! Tests across the crates, in one program with a module for each subject.
//!
//! `allocation` and `panic_hook` are separate programs, as they replace the allocator and the panic hook of a process.

mod bake;
mod bake_coats;
mod bake_dynamic;
mod bake_export;
mod bake_keys;
mod bake_run;
mod bake_view;
#[cfg(unix)]
mod chunks;
mod closed_loop;
mod codec_thresholds;
mod command_line;
mod compare;
mod compare_mpeg;
mod containers;
mod couple;
mod decode;
mod determinism;
#[cfg(target_os = "linux")]
mod disk;
#[cfg(unix)]
mod display_server;
mod errors;
mod extremes;
#[cfg(unix)]
mod faults;
mod feedback;
mod forged;
#[cfg(unix)]
mod fuzz;
mod glass;
mod importance;
mod importance_maps;
#[cfg(unix)]
mod inputs;
#[cfg(unix)]
mod interrupt;
mod layers;
mod light_transport;
mod linear_frames;
mod loader;
mod mitsuba;
mod motion;
mod page;
mod plan;
mod ranks;
mod reference;
mod regions;
mod report;
mod reprojected;
#[cfg(target_os = "linux")]
mod resume;
mod rooms;
mod samples;
mod scale;
#[cfg(unix)]
mod serve;
#[cfg(unix)]
mod serve_strangers;
mod shading_normals;
mod still;
mod structure;
mod sweep;
mod tiles;
mod tools;
mod truth_of_streams;
mod video;
