//! HTTP server of a session: one page, and pictures over WebSockets.
//!
//! | module | contents |
//! |---|---|
//! | `connections` | the number of connections, and the end of those without a request |
//! | `guard` | which requests are answered: address, origin and token |
//! | `notes` | log lines about refusals |
//! | `page` | the files of the page, and the headers of all answers |
//! | `socket` | the WebSocket of a viewer |

mod connections;
mod guard;
mod notes;
mod page;
mod socket;

use crate::error::{LiveError, LiveResult};
use crate::session::Session;
use axum::Router;
use axum::extract::{ConnectInfo, Request, State};
use axum::http::StatusCode;
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use connections::{Activity, Connections};
use guard::Guard;
use notes::Notes;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

/// Time in which connections may end after the session.
const ENDING: Duration = Duration::from_millis(500);

/// Maximum number of connections in addition to two per viewer: browsers load the files of a page over several.
const FURTHER_CONNECTIONS: usize = 32;

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
    notes: Arc<Notes>,
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
        Ok(Self { listener, shared: Arc::new(Shared { session, guard, notes: Arc::new(Notes::new()) }) })
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
            let listener = tokio::net::TcpListener::from_std(listener).map_err(failed)?;
            let session = shared.session.clone();
            let most = 2 * session.max_viewers() + FURTHER_CONNECTIONS;
            let connections = Connections::new(listener, most, shared.notes.clone());
            let service = router(shared).into_make_service_with_connect_info::<Activity>();
            let serving = axum::serve(connections, service);
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
async fn check(
    State(shared): State<Arc<Shared>>,
    ConnectInfo(activity): ConnectInfo<Activity>,
    request: Request,
    next: Next,
) -> Response {
    activity.requested();
    let Some(host) = shared.guard.host(request.headers()) else {
        shared.notes.note(activity.address(), "wrong Host");
        return page::with_headers(refusal(StatusCode::MISDIRECTED_REQUEST, "wrong Host"), "");
    };
    let needs_token = ["/", "/pictures"].contains(&request.uri().path());
    if needs_token && !shared.guard.admits(request.uri().query()) {
        shared.notes.note(activity.address(), "wrong token");
        let text = "open the link that render2mpeg serve prints: it contains a token";
        return page::with_headers(refusal(StatusCode::FORBIDDEN, text), &host);
    }
    page::with_headers(next.run(request).await, &host)
}

fn refusal(status: StatusCode, text: &'static str) -> Response {
    (status, text).into_response()
}
