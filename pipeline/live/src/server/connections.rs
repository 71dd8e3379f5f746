//! TCP connections: their maximum number, and the end of those without a request.
//!
//! A connection ends if no request, no byte of an answer and no WebSocket is seen on it for some seconds. Bytes of an
//! unfinished request do not extend this time.

use super::notes::Notes;
use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep_until};

/// Time without a request or a byte of an answer after which a connection ends.
const PATIENCE: Duration = Duration::from_secs(5);

/// Listener that refuses connections beyond a maximum number.
pub(super) struct Connections {
    listener: TcpListener,
    free: Arc<Semaphore>,
    notes: Arc<Notes>,
}

impl Connections {
    /// Creates a listener that has at most `most` connections.
    pub fn new(listener: TcpListener, most: usize, notes: Arc<Notes>) -> Self {
        Self { listener, free: Arc::new(Semaphore::new(most)), notes }
    }
}

impl Listener for Connections {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        loop {
            let (stream, address) = Listener::accept(&mut self.listener).await;
            let Ok(place) = self.free.clone().try_acquire_owned() else {
                self.notes.note(address, "too many connections");
                continue;
            };
            // Send small messages at once: each picture is awaited.
            let _ = stream.set_nodelay(true);
            let activity = Activity::new(address);
            let deadline = Box::pin(sleep_until(activity.deadline()));
            let notes = self.notes.clone();
            return (Connection { stream, activity, deadline, has_read: false, notes, _place: place }, address);
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// Requests on a connection, as the router sees them.
#[derive(Clone, Debug)]
pub(super) struct Activity(Arc<ActivityState>);

#[derive(Debug)]
struct ActivityState {
    address: SocketAddr,
    /// Time of the last request or byte of an answer.
    last: Mutex<Instant>,
    has_request: AtomicBool,
    is_viewer: AtomicBool,
}

impl Activity {
    fn new(address: SocketAddr) -> Self {
        let (has_request, is_viewer) = (AtomicBool::new(false), AtomicBool::new(false));
        Self(Arc::new(ActivityState { address, last: Mutex::new(Instant::now()), has_request, is_viewer }))
    }

    /// Returns the address of the other end.
    pub fn address(&self) -> SocketAddr {
        self.0.address
    }

    /// Notes a request.
    pub fn requested(&self) {
        self.0.has_request.store(true, Ordering::Relaxed);
        self.extend();
    }

    /// Notes that the connection is a WebSocket, which has limits of its own.
    pub fn becomes_viewer(&self) {
        self.0.is_viewer.store(true, Ordering::Relaxed);
    }

    fn extend(&self) {
        *self.0.last.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    fn deadline(&self) -> Instant {
        *self.0.last.lock().unwrap_or_else(PoisonError::into_inner) + PATIENCE
    }
}

impl Connected<IncomingStream<'_, Connections>> for Activity {
    fn connect_info(stream: IncomingStream<'_, Connections>) -> Self {
        stream.io().activity.clone()
    }
}

/// Connection that ends without requests.
pub(super) struct Connection {
    stream: TcpStream,
    activity: Activity,
    /// Time of the next check.
    deadline: Pin<Box<Sleep>>,
    /// Whether any byte has arrived.
    has_read: bool,
    notes: Arc<Notes>,
    _place: OwnedSemaphorePermit,
}

impl Connection {
    /// Waits, but not beyond the deadline.
    fn poll_deadline<T>(&mut self, context: &mut Context<'_>) -> Poll<io::Result<T>> {
        loop {
            if self.activity.0.is_viewer.load(Ordering::Relaxed) {
                return Poll::Pending;
            }
            ready!(self.deadline.as_mut().poll(context));
            let deadline = self.activity.deadline();
            if deadline <= Instant::now() {
                return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
            }
            self.deadline.as_mut().reset(deadline);
        }
    }

    /// Notes sent bytes, or waits for space.
    fn poll_sent(&mut self, context: &mut Context<'_>, sent: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        match sent {
            Poll::Ready(Ok(bytes)) => {
                if !self.activity.0.is_viewer.load(Ordering::Relaxed) {
                    self.activity.extend();
                }
                Poll::Ready(Ok(bytes))
            }
            Poll::Ready(Err(error)) => Poll::Ready(Err(error)),
            Poll::Pending => self.poll_deadline(context),
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, to: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = to.filled().len();
        match Pin::new(&mut self.stream).poll_read(context, to) {
            Poll::Ready(read) => {
                self.has_read |= to.filled().len() > before;
                Poll::Ready(read)
            }
            Poll::Pending => self.poll_deadline(context),
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, from: &[u8]) -> Poll<io::Result<usize>> {
        let sent = Pin::new(&mut self.stream).poll_write(context, from);
        self.poll_sent(context, sent)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        from: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let sent = Pin::new(&mut self.stream).poll_write_vectored(context, from);
        self.poll_sent(context, sent)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        // Browsers open connections in advance, without a byte.
        if self.has_read && !self.activity.0.has_request.load(Ordering::Relaxed) {
            self.notes.note(self.activity.address(), "no valid request");
        }
    }
}
