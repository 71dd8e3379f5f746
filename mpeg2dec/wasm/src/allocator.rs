//! A small allocator for one thread: free lists of size classes.
//!
//! A decoder allocates few sizes and uses their memory again. Blocks of a class are therefore never merged or divided.

use std::alloc::{GlobalAlloc, Layout};
use std::cell::UnsafeCell;
use std::ptr::null_mut;

/// Number of size classes: multiples of 16 to 64, then four classes per power of two.
const CLASSES: usize = 4 + 4 * 26;
/// Bytes of a page of WebAssembly memory.
const PAGE: usize = 1 << 16;
/// Alignment of all blocks.
const ALIGNMENT: usize = 16;

/// A class, and the size of its blocks.
struct SizeClass {
    index: usize,
    size: usize,
}

impl SizeClass {
    fn of(size: usize) -> Self {
        if size <= 64 {
            let index = size.max(1).div_ceil(ALIGNMENT) - 1;
            return Self { index, size: (index + 1) * ALIGNMENT };
        }
        let exponent = (size - 1).ilog2();
        let (base, step) = (1 << exponent, 1 << (exponent - 2));
        let quarter = (size - 1 - base) / step;
        Self { index: 4 + 4 * (exponent as usize - 6) + quarter, size: base + (quarter + 1) * step }
    }
}

/// Free blocks, and memory that was never used.
struct Heap {
    /// First free block of each class; a free block begins with the address of the next one.
    free: [*mut *mut u8; CLASSES],
    unused: usize,
    end: usize,
}

/// Allocator of the module.
pub struct ClassAllocator(UnsafeCell<Heap>);

impl ClassAllocator {
    pub const fn new() -> Self {
        Self(UnsafeCell::new(Heap { free: [null_mut(); CLASSES], unused: 0, end: 0 }))
    }
}

// SAFETY: the module has one thread.
unsafe impl Sync for ClassAllocator {}

// SAFETY: blocks are disjoint, at least as large as their class, and aligned to 16 bytes.
unsafe impl GlobalAlloc for ClassAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if layout.align() > ALIGNMENT || layout.size() > 1 << 30 {
            return null_mut();
        }
        // SAFETY: no other reference exists, because the module has one thread and this function calls no user code.
        let heap = unsafe { &mut *self.0.get() };
        let SizeClass { index, size } = SizeClass::of(layout.size());
        let block = heap.free[index];
        if !block.is_null() {
            // SAFETY: a free block begins with the address of the next one.
            heap.free[index] = unsafe { *block }.cast();
            return block.cast();
        }
        if heap.end - heap.unused < size {
            let pages = size.div_ceil(PAGE);
            let first = core::arch::wasm32::memory_grow(0, pages);
            if first == usize::MAX {
                return null_mut();
            }
            // Pages that do not continue the unused memory replace it.
            if first * PAGE != heap.end {
                heap.unused = first * PAGE;
            }
            heap.end = (first + pages) * PAGE;
        }
        let block = heap.unused;
        heap.unused += size;
        block as *mut u8
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        let index = SizeClass::of(layout.size()).index;
        // SAFETY: no other reference exists, as in `alloc`. The block has at least 16 bytes and belongs to nobody.
        unsafe {
            let heap = &mut *self.0.get();
            let block: *mut *mut u8 = block.cast();
            *block = heap.free[index].cast();
            heap.free[index] = block;
        }
    }
}
