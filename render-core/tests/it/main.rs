//! Tests of scenes, rays and light through the public interface, in one program with a module per subject.

mod accelerator;
mod atlas;
mod coincidence;
mod common;
mod coverage;
mod cut_outs;
mod deform;
mod direct;
mod glass;
mod gltf;
mod light;
mod materials;
mod motion;
mod outline;
mod path;
mod sheets;
mod studio;
