//! `--display-server`: pictures in progress, shown by the image viewer tev.
//!
//! A thread of its own connects and sends. Rendering never waits for the viewer: pictures of a film that the viewer is
//! too slow for are replaced by later ones.

mod packets;

use plane::Plane;
use std::io::{self, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::str::FromStr;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time in which a viewer must accept a connection.
const CONNECTING: Duration = Duration::from_secs(2);
/// Time in which a viewer must read some bytes.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time at the end of the run in which a viewer may read the last pictures.
const ENDING: Duration = Duration::from_secs(3);
/// Maximum number of pictures with different names that wait for the viewer.
const QUEUE: usize = 4;

/// Address of a viewer, HOST:PORT.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ViewerAddress {
    host: String,
    port: u16,
}

impl FromStr for ViewerAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.rsplit_once(':').and_then(|(host, port)| {
            // Numeric addresses with colons have brackets.
            let inner = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
            let is_host = |host: &str| !host.is_empty() && !host.contains(|c: char| c.is_whitespace() || c == '/');
            let host = inner.or_else(|| (!host.contains(':')).then_some(host)).filter(|host| is_host(host))?;
            let port = port.parse().ok().filter(|&port| port > 0)?;
            Some(Self { host: host.to_owned(), port })
        });
        parts.ok_or_else(|| format!("\"{text}\" is not HOST:PORT, such as localhost:14158"))
    }
}

impl std::fmt::Display for ViewerAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.host.contains(':') {
            true => write!(f, "[{}]:{}", self.host, self.port),
            false => write!(f, "{}:{}", self.host, self.port),
        }
    }
}

impl ViewerAddress {
    /// Connects to the first of the host's addresses that accepts.
    fn connect(&self) -> io::Result<TcpStream> {
        let mut last = io::Error::from(io::ErrorKind::AddrNotAvailable);
        for address in (self.host.as_str(), self.port).to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, CONNECTING) {
                Ok(stream) => {
                    stream.set_write_timeout(Some(PATIENCE))?;
                    return Ok(stream);
                }
                Err(error) => last = error,
            }
        }
        Err(last)
    }
}

/// Connection to a viewer.
pub(crate) struct DisplayServer {
    pending: Arc<Pending>,
    address: ViewerAddress,
    warn: Arc<Warn>,
}

/// Function that prints a warning.
type Warn = dyn Fn(&str) + Send + Sync;

/// Pictures that wait for the viewer.
#[derive(Default)]
struct Pending {
    state: Mutex<PendingState>,
    changed: Condvar,
}

#[derive(Default)]
struct PendingState {
    pictures: Vec<NamedPicture>,
    /// Whether no picture follows, or the viewer is gone.
    is_closed: bool,
    /// Whether the thread has ended.
    has_ended: bool,
}

struct NamedPicture {
    name: String,
    radiance: Plane<[f32; 3]>,
}

impl Pending {
    fn lock(&self) -> MutexGuard<'_, PendingState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a picture. It replaces a waiting picture of the same name, or the oldest one of a full queue.
    fn add(&self, name: &str, radiance: &Plane<[f32; 3]>) {
        let mut state = self.lock();
        if state.is_closed {
            return;
        }
        state.pictures.retain(|picture| picture.name != name);
        if state.pictures.len() == QUEUE {
            state.pictures.remove(0);
        }
        state.pictures.push(NamedPicture { name: name.to_owned(), radiance: radiance.clone() });
        self.changed.notify_all();
    }

    /// Waits for the oldest picture; returns `None` after the last one.
    fn next(&self) -> Option<NamedPicture> {
        let mut state = self.lock();
        while state.pictures.is_empty() {
            if state.is_closed {
                return None;
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        Some(state.pictures.remove(0))
    }

    fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_all();
    }

    /// Notes that the thread ends.
    fn end(&self) {
        let mut state = self.lock();
        (state.is_closed, state.has_ended) = (true, true);
        self.changed.notify_all();
    }

    /// Waits for the end of the thread, but not longer than `patience`. Returns whether it has ended.
    fn wait_for_end(&self, patience: Duration) -> bool {
        let waiting = self.changed.wait_timeout_while(self.lock(), patience, |state| !state.has_ended);
        waiting.unwrap_or_else(PoisonError::into_inner).0.has_ended
    }
}

impl DisplayServer {
    /// Connects to the viewer on another thread. A failure is passed to `warn`, and the run continues without viewer.
    pub fn start(address: &ViewerAddress, warn: impl Fn(&str) + Send + Sync + 'static) -> Self {
        let (pending, warn): (_, Arc<Warn>) = (Arc::<Pending>::default(), Arc::new(warn));
        let server = Self { pending: pending.clone(), address: address.clone(), warn: warn.clone() };
        let address = address.clone();
        let work = move || {
            if let Err(error) = send_all(&address, &pending) {
                pending.close();
                warn(&format!("no pictures are shown at {address}: {}; the run continues", reason(&error)));
            }
            pending.end();
        };
        if let Err(error) = std::thread::Builder::new().name("viewer".into()).spawn(work) {
            server.pending.end();
            (server.warn)(&format!("cannot start a thread for {}: {error}", server.address));
        }
        server
    }

    /// Shows a picture of linear radiance \[W·m⁻²·sr⁻¹\]. A later picture of the same name replaces it.
    pub fn show(&self, name: &str, radiance: &Plane<[f32; 3]>) {
        self.pending.add(name, radiance);
    }

    /// Waits a moment until the viewer has the last pictures.
    pub fn finish(self) {
        self.pending.close();
        if !self.pending.wait_for_end(ENDING) {
            (self.warn)(&format!("the last picture is not shown at {}: the viewer does not read it", self.address));
        }
    }
}

/// Connects, and sends pictures until no further picture follows.
fn send_all(address: &ViewerAddress, pending: &Pending) -> io::Result<()> {
    let mut stream = address.connect()?;
    let mut created: Option<(String, usize, usize)> = None;
    while let Some(NamedPicture { name, radiance }) = pending.next() {
        // A film is one image, whose content changes.
        let image = (name, radiance.width(), radiance.height());
        if created.as_ref() != Some(&image) {
            stream.write_all(&packets::create_image(&image.0, image.1, image.2))?;
        }
        for packet in packets::update_image(&image.0, &radiance) {
            stream.write_all(&packet)?;
        }
        created = Some(image);
    }
    Ok(())
}

/// Returns the text for an error of a connection.
fn reason(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::ConnectionRefused => "no viewer listens there".into(),
        io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock => "the viewer does not answer".into(),
        io::ErrorKind::BrokenPipe | io::ErrorKind::ConnectionReset => "the viewer closed the connection".into(),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_have_a_host_and_a_port() {
        for text in ["localhost:14158", "127.0.0.1:1", "[::1]:14158", "viewer.example:65535"] {
            assert_eq!(text.parse::<ViewerAddress>().unwrap().to_string(), text);
        }
        for text in
            ["", "localhost", ":14158", "localhost:", "localhost:0", "localhost:65536", "::1:80", "a b:1", "x/y:1"]
        {
            assert!(text.parse::<ViewerAddress>().is_err(), "{text}");
        }
    }

    #[test]
    fn later_pictures_replace_waiting_ones() {
        let pending = Pending::default();
        let picture = |value: f32| Plane::from_fn(1, 1, |_, _| [value; 3]);
        for (name, value) in [("a", 0.0), ("b", 1.0), ("a", 2.0)] {
            pending.add(name, &picture(value));
        }
        pending.close();
        pending.add("late", &picture(9.0));
        let next = || pending.next().map(|picture| (picture.name, picture.radiance.row(0)[0][0]));
        assert_eq!([next(), next(), next()], [Some(("b".into(), 1.0)), Some(("a".into(), 2.0)), None]);
    }
}
