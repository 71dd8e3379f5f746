//! Files of the npm package, for programs that write web pages.
//!
//! ```
//! // A module in a page, which needs no other file.
//! let script = format!("<script type=\"module\">{}</script>", mpeg2dec::web::SCRIPT);
//! assert!(mpeg2dec::web::MODULE.starts_with(b"\0asm"));
//! # assert_eq!(script.matches("</script").count(), 1);
//! ```

/// JavaScript module with the classes `Decoder`, `Renderer` and `Player`.
pub const SCRIPT: &str = include_str!("../npm/mpeg2dec.js");
/// WebAssembly module of the decoder.
pub const MODULE: &[u8] = include_bytes!("../npm/mpeg2dec.wasm");
