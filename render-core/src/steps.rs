//! Counts of elementary steps, with which tests verify that work grows no faster than its input. Counting is disabled
//! outside of tests.

#[cfg(test)]
thread_local! {
    static TAKEN: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

/// Adds `steps` to the calling thread's count.
#[inline(always)]
pub(crate) fn count(steps: usize) {
    #[cfg(test)]
    TAKEN.set(TAKEN.get() + steps);
    let _ = steps;
}

/// Returns the number of steps that `work` needs on the calling thread.
#[cfg(test)]
pub(crate) fn taken(work: impl FnOnce()) -> usize {
    let before = TAKEN.get();
    work();
    TAKEN.get() - before
}
