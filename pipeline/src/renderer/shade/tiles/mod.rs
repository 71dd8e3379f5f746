//! Tiles of a picture, each the work of one rank at a time.

#[cfg(test)]
mod cut;
