//! Prints the documentation page of glTF extensions:
//! `cargo run -p render2mpeg-render-core --example gltf_table > docs/reference/gltf.md`.

fn main() {
    print!("{}", render_core::scene::extension_table());
}
