//! HTTP server of a session: one page, and pictures over WebSockets.
//!
//! | module | contents |
//! |---|---|
//! | `guard` | which requests are answered: address, origin and token |
//! | `page` | the files of the page, and the headers of all answers |
//! | `socket` | the WebSocket of a viewer |

mod guard;
mod page;
mod socket;

use crate::error::{LiveError, LiveResult};
use crate::session::Session;
use axum::Router;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::serve::ListenerExt;
use guard::Guard;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

/// Time in which connections may end after the session.
const ENDING: Duration = Duration::from_millis(500);

/// Server of a session. It listens, but answers only in [`run`](Self::run).
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    shared: Arc<Shared>,
}

/// State of all requests.
#[derive(Debug)]
struct Shared {
    session: Arc<Session>,
    guard: Guard,
}

impl Server {
    /// Listens at `address`. Addresses other than the loopback ones need a token; without a `token`, a random one is
    /// made.
    ///
    /// # Errors
    /// If the address is in use or invalid, or the token cannot be part of a link.
    pub fn bind(address: SocketAddr, token: Option<String>, session: Arc<Session>) -> LiveResult<Self> {
        let listen = |source| LiveError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let local = listener.local_addr().map_err(listen)?;
        let guard = Guard::new(local, token)?;
        Ok(Self { listener, shared: Arc::new(Shared { session, guard }) })
    }

    /// Returns the link that opens the page.
    #[must_use]
    pub fn link(&self) -> String {
        self.shared.guard.link()
    }

    /// Answers requests until the session ends. Blocks the thread.
    ///
    /// # Errors
    /// If the system refuses threads or sockets.
    pub fn run(self) -> LiveResult<()> {
        let failed = |source| LiveError::System { what: "the server", source };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
        let Self { listener, shared } = self;
        runtime.block_on(async {
            // Send small messages at once: each picture is awaited.
            let listener = tokio::net::TcpListener::from_std(listener).map_err(failed)?;
            let listener = listener.tap_io(|stream| {
                let _ = stream.set_nodelay(true);
            });
            let session = shared.session.clone();
            let serving = axum::serve(listener, router(shared));
            // Give connections a moment to end after the session.
            tokio::select! {
                served = serving => served.map_err(failed),
                () = async { session.ended().await; tokio::time::sleep(ENDING).await } => Ok(()),
            }
        })
    }
}

fn router(shared: Arc<Shared>) -> Router {
    let files = page::FILES
        .iter()
        .fold(Router::new(), |router, file| router.route(file.path, get(move || async move { file.response() })));
    files.route("/pictures", get(socket::upgrade)).layer(from_fn_with_state(shared.clone(), check)).with_state(shared)
}

/// Answers only requests to an address of this server, and adds the headers of all answers.
async fn check(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let Some(host) = shared.guard.host(request.headers()) else {
        return page::with_headers(refusal(StatusCode::MISDIRECTED_REQUEST, "wrong Host"), "");
    };
    let needs_token = ["/", "/pictures"].contains(&request.uri().path());
    if needs_token && !shared.guard.admits(request.uri().query()) {
        let text = "open the link that render2mpeg serve prints: it contains a token";
        return page::with_headers(refusal(StatusCode::FORBIDDEN, text), &host);
    }
    page::with_headers(next.run(request).await, &host)
}

fn refusal(status: StatusCode, text: &'static str) -> Response {
    (status, text).into_response()
}
