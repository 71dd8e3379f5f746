//! Tests of glTF files: every valid file is rendered, or a note names the omitted content.

mod blender;
mod cameras;
mod extensions;
mod file;
mod lobes;
mod material_pointers;
mod packed;
mod parts;
mod pointers;
mod strokes;
mod valid;
