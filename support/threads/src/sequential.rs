//! Loops with the names of `rayon` on the calling thread, in order.

/// Calls both functions, the first one first, and returns their results.
pub fn join<A, B>(first: impl FnOnce() -> A, second: impl FnOnce() -> B) -> (A, B) {
    (first(), second())
}

/// Traits for `use threads::prelude::*`.
pub mod prelude {
    use std::slice::{Chunks, ChunksMut, Iter};

    /// Values that give an iterator.
    pub trait IntoLoop: IntoIterator + Sized {
        /// Returns an iterator over the items.
        fn into_par_iter(self) -> Self::IntoIter {
            self.into_iter()
        }
    }

    impl<I: IntoIterator> IntoLoop for I {}

    /// Loops over slices.
    pub trait SliceLoop<T> {
        /// Returns an iterator over the items.
        fn par_iter(&self) -> Iter<'_, T>;

        /// Returns an iterator over chunks of `size` items. The last chunk may be shorter.
        ///
        /// # Panics
        /// If `size` is 0.
        fn par_chunks(&self, size: usize) -> Chunks<'_, T>;

        /// Returns an iterator over mutable chunks of `size` items. The last chunk may be shorter.
        ///
        /// # Panics
        /// If `size` is 0.
        fn par_chunks_mut(&mut self, size: usize) -> ChunksMut<'_, T>;
    }

    impl<T> SliceLoop<T> for [T] {
        fn par_iter(&self) -> Iter<'_, T> {
            self.iter()
        }

        fn par_chunks(&self, size: usize) -> Chunks<'_, T> {
            self.chunks(size)
        }

        fn par_chunks_mut(&mut self, size: usize) -> ChunksMut<'_, T> {
            self.chunks_mut(size)
        }
    }

    /// Steps of loops that iterators of the standard library do not have.
    pub trait LoopSteps: Iterator + Sized {
        /// Returns the iterator itself. `rayon` divides loops into jobs of at least `_count` items.
        fn with_min_len(self, _count: usize) -> Self {
            self
        }

        /// Applies `f` to each item, with one value of `init` for all items.
        fn map_init<T, R>(
            self,
            init: impl FnOnce() -> T,
            mut f: impl FnMut(&mut T, Self::Item) -> R,
        ) -> impl Iterator<Item = R> {
            let mut scratch = init();
            self.map(move |item| f(&mut scratch, item))
        }

        /// Applies `f` to each item and joins the results.
        fn flat_map_iter<R: IntoIterator>(self, f: impl FnMut(Self::Item) -> R) -> impl Iterator<Item = R::Item> {
            self.flat_map(f)
        }

        /// Returns the first item that meets the condition.
        fn find_first(mut self, condition: impl FnMut(&Self::Item) -> bool) -> Option<Self::Item> {
            self.find(condition)
        }
    }

    impl<I: Iterator> LoopSteps for I {}
}

#[cfg(test)]
mod tests {
    use super::prelude::*;

    #[test]
    fn loops_run_in_order() {
        let numbered = (0..5).into_par_iter().with_min_len(2).map_init(
            || 0,
            |count, item| {
                *count += 1;
                (*count, item)
            },
        );
        assert_eq!(numbered.collect::<Vec<_>>(), [(1, 0), (2, 1), (3, 2), (4, 3), (5, 4)]);
        let joined: Vec<_> = (1..4).into_par_iter().flat_map_iter(|count| vec![count; count]).collect();
        assert_eq!(joined, [1, 2, 2, 3, 3, 3]);
        assert_eq!(joined.par_iter().find_first(|item| **item > 1), Some(&2));
        assert_eq!(super::join(|| 1, || 2), (1, 2));
    }

    #[test]
    fn the_last_chunk_may_be_shorter() {
        let mut items = [1, 2, 3, 4, 5];
        assert_eq!(items.par_chunks(2).map(|chunk| chunk.len()).collect::<Vec<_>>(), [2, 2, 1]);
        items.par_chunks_mut(3).for_each(|chunk| chunk.reverse());
        assert_eq!(items, [3, 2, 1, 5, 4]);
    }
}
