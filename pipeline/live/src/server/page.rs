//! Files of the page, embedded in the program.

use axum::body::{Body, Bytes};
use axum::http::HeaderValue;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, HeaderName};
use axum::response::Response;

/// File of the page.
pub(super) struct PageFile {
    pub path: &'static str,
    kind: &'static str,
    content: &'static [u8],
}

/// All files.
pub(super) const FILES: &[PageFile] = &[
    PageFile { path: "/", kind: "text/html; charset=utf-8", content: include_bytes!("../web/page.html") },
    PageFile { path: "/page.css", kind: "text/css; charset=utf-8", content: include_bytes!("../web/page.css") },
    PageFile { path: "/page.js", kind: SCRIPT, content: include_bytes!("../web/page.js") },
    PageFile { path: "/worker.js", kind: SCRIPT, content: include_bytes!("../web/worker.js") },
    PageFile { path: "/mpeg2dec.js", kind: SCRIPT, content: mpeg2dec::web::SCRIPT.as_bytes() },
    PageFile { path: "/mpeg2dec.wasm", kind: "application/wasm", content: mpeg2dec::web::MODULE },
];
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// Headers of all answers, without the policy of contents.
const HEADERS: [(&str, &str); 4] = [
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
];

impl PageFile {
    pub fn response(&self) -> Response {
        let mut response = Response::new(Body::from(Bytes::from_static(self.content)));
        response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(self.kind));
        response
    }
}

/// Adds the headers of all answers. The page may load from this server only, at `host`.
pub(super) fn with_headers(mut response: Response, host: &str) -> Response {
    let headers = response.headers_mut();
    for (name, value) in HEADERS {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    // Older browsers do not count WebSockets of the same address as 'self'.
    let policy = format!(
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' data: blob:; \
         connect-src 'self' ws://{host}; worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    );
    if let Ok(policy) = HeaderValue::from_str(&policy) {
        headers.insert(HeaderName::from_static("content-security-policy"), policy);
    }
    response
}
