//! Writes the shipped scenes.
