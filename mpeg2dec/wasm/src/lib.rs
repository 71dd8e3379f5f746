//! WebAssembly module of `mpeg2dec`: plain functions over one decoder.
//!
//! A caller writes bytes at [`input`] and calls [`push`]. Then it calls [`next`] until that returns 0. After each call that
//! returns 1, the other functions describe one picture. Its samples remain valid until the next call of [`next`].
#![deny(unsafe_op_in_unsafe_fn)]

#[cfg(target_arch = "wasm32")]
mod allocator; // memory

use mpeg2dec::{DecodedPicture, DecoderOptions, Input, SampleComponent};
use std::{cell::Cell, collections::VecDeque};

#[cfg(target_arch = "wasm32")]
#[global_allocator]
static ALLOCATOR: allocator::ClassAllocator = allocator::ClassAllocator::new();

/// Decoder and its pictures.
#[derive(Default)]
struct Module {
    input: Input,
    bytes: Vec<u8>,
    waiting: VecDeque<DecodedPicture>,
    picture: Option<DecodedPicture>,
}

thread_local! {
    static MODULE: Cell<Option<Box<Module>>> = const { Cell::new(None) };
}

/// Returns the decoder, or a new one in the first call. Not inlined, because the module should be small.
#[inline(never)]
fn take() -> Box<Module> {
    MODULE.take().unwrap_or_default()
}

/// Calls a function with the decoder.
fn with<T>(f: impl FnOnce(&mut Module) -> T) -> T {
    let mut module = take();
    let result = f(&mut module);
    MODULE.set(Some(module));
    result
}

/// Evaluates a function of the current picture; returns the default without one.
fn of_picture<T: Default>(f: impl FnOnce(&DecodedPicture) -> T) -> T {
    with(|module| module.picture.as_ref().map(f).unwrap_or_default())
}

fn component(index: u32) -> SampleComponent {
    SampleComponent::ALL[index.min(2) as usize]
}

/// Starts a new stream. Incomplete pictures are shown if `show_incomplete` is not 0.
#[unsafe(no_mangle)]
pub extern "C" fn reset(show_incomplete: u32) {
    let options = DecoderOptions { show_incomplete: show_incomplete != 0, ..DecoderOptions::default() };
    with(|module| *module = Module { input: Input::new(options), ..Module::default() });
}

/// Returns the address of a buffer for `length` bytes.
#[unsafe(no_mangle)]
pub extern "C" fn input(length: usize) -> *mut u8 {
    with(|module| {
        module.bytes.resize(length.max(module.bytes.len()), 0);
        module.bytes.as_mut_ptr()
    })
}

/// Decodes the first `length` bytes of the buffer.
#[unsafe(no_mangle)]
pub extern "C" fn push(length: usize) {
    with(|module| {
        let bytes = &module.bytes[..length.min(module.bytes.len())];
        module.input.push(bytes, |picture| module.waiting.push_back(picture));
    });
}

/// Ends the stream.
#[unsafe(no_mangle)]
pub extern "C" fn flush() {
    with(|module| module.input.flush(|picture| module.waiting.push_back(picture)));
}

/// Moves to the next picture. Returns 1, or 0 if more bytes are needed.
#[unsafe(no_mangle)]
pub extern "C" fn next() -> u32 {
    with(|module| {
        module.picture = module.waiting.pop_front();
        module.picture.is_some().into()
    })
}

/// Returns the number of columns of luma (0) or chroma (1, 2).
#[unsafe(no_mangle)]
pub extern "C" fn width(index: u32) -> usize {
    of_picture(|picture| picture.plane(component(index)).width)
}

/// Returns the number of rows of luma (0) or chroma (1, 2).
#[unsafe(no_mangle)]
pub extern "C" fn height(index: u32) -> usize {
    of_picture(|picture| picture.plane(component(index)).height)
}

/// Returns the distance between rows of luma (0) or chroma (1, 2).
#[unsafe(no_mangle)]
pub extern "C" fn stride(index: u32) -> usize {
    of_picture(|picture| picture.plane(component(index)).stride)
}

/// Returns the address of the samples of luma (0) or chroma (1, 2).
#[unsafe(no_mangle)]
pub extern "C" fn plane(index: u32) -> usize {
    of_picture(|picture| picture.plane(component(index)).samples.as_ptr() as usize)
}

/// Returns flags: 1 top field first, 2 repeat first field, 4 progressive frame, 8 field pictures; from bit 4 the picture
/// type, from bit 8 matrix_coefficients.
#[unsafe(no_mangle)]
pub extern "C" fn flags() -> u32 {
    of_picture(|picture| {
        let flags = picture.flags();
        let matrix = picture.sequence().color.map_or(2, |color| u32::from(color.matrix));
        u32::from(flags.top_field_first)
            | u32::from(flags.repeat_first_field) << 1
            | u32::from(flags.progressive_frame) << 2
            | u32::from(flags.is_field_pair) << 3
            | (flags.kind as u32) << 4
            | matrix << 8
    })
}

/// Returns the presentation time in seconds; NaN if the container has none for the picture.
#[unsafe(no_mangle)]
pub extern "C" fn time() -> f64 {
    of_picture(|picture| picture.time().map_or(f64::NAN, |time| time as f64 / 90_000.0))
}

/// Returns the number of frames per second.
#[unsafe(no_mangle)]
pub extern "C" fn frame_rate() -> f64 {
    of_picture(|picture| {
        let (numerator, denominator) = picture.sequence().frame_rate;
        f64::from(numerator) / f64::from(denominator)
    })
}

/// Returns the width of a sample divided by its height.
#[unsafe(no_mangle)]
pub extern "C" fn sample_aspect() -> f64 {
    of_picture(|picture| picture.sequence().sample_aspect())
}

/// Returns the number of concealed macroblocks of the picture.
#[unsafe(no_mangle)]
pub extern "C" fn concealed() -> u32 {
    of_picture(|picture| picture.damage().macroblocks)
}
