//! Tests of scenes, rays and light as their users see them, in one program: a module for each subject.

mod accelerator;
mod atlas;
mod coincidence;
mod common;
mod coverage;
mod cut_outs;
mod deform;
mod direct;
mod gltf;
mod light;
mod materials;
mod motion;
mod outline;
mod path;
mod sheets;
