//! "Mode 1: triangles" and "Mode 2: indices".

use super::{Fault, LONG, SHORT};

/// Size of the table after the data of triangles: pairs of positions in the vertex queue \[bytes\].
const TABLE: usize = 16;
/// Size of the padding after the data of a sequence \[bytes\].
const PADDING: usize = 4;

/// Reader of the bytes that follow the codes.
struct CodeReader<'a>(&'a [u8]);

impl CodeReader<'_> {
    fn byte(&mut self) -> Result<u8, Fault> {
        let (&first, rest) = self.0.split_first().ok_or(SHORT)?;
        self.0 = rest;
        Ok(first)
    }

    /// Reads an unsigned LEB128 number of at most five bytes.
    fn number(&mut self) -> Result<u32, Fault> {
        let mut number = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err("has a number of more than five bytes")
    }
}

/// Decodes a zigzag code to a difference.
fn unfold(code: u32) -> u32 {
    (code >> 1) ^ (code & 1).wrapping_neg()
}

/// Last 16 items, with the newest at position 0. Unwritten items contain the largest index, which no mesh contains.
struct Queue<T> {
    items: [T; 16],
    next: usize,
}

impl<T: Copy> Queue<T> {
    fn new(empty: T) -> Self {
        Self { items: [empty; 16], next: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.next & 15] = item;
        self.next = self.next.wrapping_add(1);
    }

    fn get(&self, age: usize) -> T {
        self.items[self.next.wrapping_sub(1 + age) & 15]
    }
}

/// State of the triangle decoder.
struct Triangles<'a> {
    data: CodeReader<'a>,
    next: u32,
    last: u32,
    edges: Queue<(u32, u32)>,
    vertices: Queue<u32>,
}

/// Decodes `count` indices, a multiple of 3.
pub(super) fn triangles(data: &[u8], count: usize) -> Result<Vec<u32>, Fault> {
    if data.first().is_some_and(|&first| first != 0xe1) {
        return Err("has an unknown version");
    }
    // Each triangle has one code.
    let body = data.len().checked_sub(1 + TABLE).filter(|&body| body >= count / 3).ok_or(SHORT)?;
    let (codes, rest) = data[1..1 + body].split_at(count / 3);
    let table = &data[1 + body..];
    let mut state = Triangles {
        data: CodeReader(rest),
        next: 0,
        last: 0,
        edges: Queue::new((u32::MAX, u32::MAX)),
        vertices: Queue::new(u32::MAX),
    };
    let mut out = Vec::with_capacity(count);
    for &code in codes {
        out.extend(state.triangle(code, table)?);
    }
    if state.data.0.is_empty() { Ok(out) } else { Err(LONG) }
}

impl Triangles<'_> {
    fn triangle(&mut self, code: u8, table: &[u8]) -> Result<[u32; 3], Fault> {
        // A high nibble below 15 is the age of a shared edge.
        let (high, low) = (usize::from(code >> 4), usize::from(code & 15));
        if high < 15 {
            return self.beside_edge(high, low);
        }

        // Decode three separate corners: positions of the second and third corners are in the table or in the data.
        let is_listed = low < 14;
        let pair = if is_listed { table[low] } else { self.data.byte()? };
        if !is_listed && pair == 0 {
            self.next = 0;
        }
        let a = if low == 15 { self.stored()? } else { self.fresh() };
        let (second, third) = (usize::from(pair >> 4), usize::from(pair & 15));
        let b = self.corner(second)?;
        let c = self.corner(third)?;
        // Add the edges, and the vertices that are not in the queue.
        for edge in [(b, a), (c, b), (a, c)] {
            self.edges.push(edge);
        }
        self.vertices.push(a);
        for (place, corner) in [(second, b), (third, c)] {
            if place == 0 || place == 15 {
                self.vertices.push(corner);
            }
        }
        Ok([a, b, c])
    }

    /// Decodes a triangle that shares an edge with a recent triangle.
    fn beside_edge(&mut self, age: usize, third: usize) -> Result<[u32; 3], Fault> {
        // Read the third corner: new, recent, next to the last stored one, or stored.
        let (a, b) = self.edges.get(age);
        let c = match third {
            0 => self.fresh(),
            1..=12 => self.vertices.get(third),
            13 | 14 => {
                self.last = if third == 13 { self.last.wrapping_sub(1) } else { self.last.wrapping_add(1) };
                self.last
            }
            _ => self.stored()?,
        };
        if !(1..=12).contains(&third) {
            self.vertices.push(c);
        }
        self.edges.push((c, b));
        self.edges.push((a, c));
        Ok([a, b, c])
    }

    /// Decodes a corner from its position: 0 for a new vertex, 15 for a vertex in the data.
    fn corner(&mut self, place: usize) -> Result<u32, Fault> {
        match place {
            0 => Ok(self.fresh()),
            15 => self.stored(),
            _ => Ok(self.vertices.get(place - 1)),
        }
    }

    /// Returns the next new vertex.
    fn fresh(&mut self) -> u32 {
        let vertex = self.next;
        self.next = self.next.wrapping_add(1);
        vertex
    }

    /// Reads a vertex as the difference from the previous vertex in the data.
    fn stored(&mut self) -> Result<u32, Fault> {
        self.last = self.last.wrapping_add(unfold(self.data.number()?));
        Ok(self.last)
    }
}

/// Decodes `count` indices in any order.
pub(super) fn sequence(data: &[u8], count: usize) -> Result<Vec<u32>, Fault> {
    if data.first().is_some_and(|&first| first != 0xd1) {
        return Err("has an unknown version");
    }
    // Each index has at least one byte.
    let body = data.len().checked_sub(1 + PADDING).filter(|&body| body >= count).ok_or(SHORT)?;
    // The lowest bit of each code selects one of two bases.
    let mut reader = CodeReader(&data[1..1 + body]);
    let mut last = [0u32; 2];
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let code = reader.number()?;
        let base = &mut last[(code & 1) as usize];
        *base = base.wrapping_add(unfold(code >> 1));
        out.push(*base);
    }
    if reader.0.is_empty() { Ok(out) } else { Err(LONG) }
}
