//! Nothing. The manifest of this package names features of dependencies, so that every `cargo test -p CRATE` of the
//! workspace compiles them as `cargo test --workspace` does, once.
