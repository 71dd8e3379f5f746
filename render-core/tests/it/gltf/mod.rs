//! glTF files: every valid one is drawn, or a note names what is left out.

mod blender;
mod cameras;
mod extensions;
mod file;
mod material_pointers;
mod packed;
mod parts;
mod pointers;
mod strokes;
mod valid;
