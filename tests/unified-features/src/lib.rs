//! Empty. The package's manifest lists features of dependencies, so that `cargo test -p CRATE` and `cargo test --workspace`
//! share one build of them.
