//! `render2mpeg serve` over real connections: pictures, inputs, refusals, and the end.

use mpeg2dec::{Decoder, SampleComponent};
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use tests::{cornell, ended, program};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::{Error, Message, WebSocket};

const OPTIONS: &str = "--size 64x64 --threads 2 --qscale 8";
/// Limit of a wait for a message.
pub const DEADLINE: Duration = Duration::from_secs(60);
/// Length of the header before a picture \[bytes\].
const HEADER: usize = 64;

/// Server on a free port, killed on drop.
pub struct Server {
    child: Child,
    pub host: String,
    pub link: String,
}

impl Server {
    fn start(options: &str) -> Self {
        Self::with_log(&format!("--vpls 100 --viewers 4 --quiet {options}"), Stdio::inherit())
    }

    /// Starts a server that writes its log to `log`.
    pub fn with_log(options: &str, log: impl Into<Stdio>) -> Self {
        let mut child = Command::new(program())
            .arg("serve")
            .arg(cornell())
            .args(OPTIONS.split_whitespace())
            .args(options.split_whitespace())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .expect("render2mpeg starts");
        let mut link = String::new();
        let output = child.stdout.take().expect("a pipe");
        BufReader::new(output).read_line(&mut link).expect("a link");
        let link = link.trim().to_owned();
        let host = link.strip_prefix("http://").and_then(|rest| rest.split('/').next()).expect("a link").to_owned();
        Self { child, host, link }
    }

    /// Returns the status of a request, and its answer with headers.
    pub fn get(&self, path: &str, host: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.host).expect("the server listens");
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let answer = String::from_utf8_lossy(&answer).into_owned();
        (answer.split(' ').nth(1).and_then(|status| status.parse().ok()).expect("a status"), answer)
    }

    /// Opens a WebSocket, as a page of `origin` would.
    fn open(&self, query: &str, origin: &str) -> Result<Viewer, Error> {
        let mut request = format!("ws://{}/pictures{query}", self.host).into_client_request()?;
        request.headers_mut().insert("Origin", HeaderValue::from_str(origin).unwrap());
        let stream = TcpStream::connect(&self.host)?;
        stream.set_read_timeout(Some(DEADLINE))?;
        let (socket, _) = tungstenite::client(request, stream).map_err(|error| match error {
            tungstenite::HandshakeError::Failure(error) => error,
            tungstenite::HandshakeError::Interrupted(_) => panic!("a blocking stream"),
        })?;
        Ok(Viewer { socket, decoder: Decoder::default() })
    }

    pub fn viewer(&self, query: &str) -> Viewer {
        self.open(query, &format!("http://{}", self.host)).expect("a viewer")
    }

    pub fn refused(&self, query: &str, origin: &str) -> StatusCode {
        match self.open(query, origin) {
            Err(Error::Http(response)) => response.status(),
            other => panic!("not refused: {:?}", other.map(|_| ())),
        }
    }

    pub fn interrupt(mut self) -> ExitStatus {
        let pid = Pid::from_raw(self.child.id() as i32).expect("a process");
        kill_process(pid, Signal::INT).expect("the process takes signals");
        ended(&mut self.child, DEADLINE)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // No effect on an ended process.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Picture as a page shows it.
pub struct Shown {
    pub is_intra: bool,
    pub sequence: u32,
    input: u32,
    luma: Vec<u8>,
    /// Header and picture as received.
    pub message: Vec<u8>,
}

pub struct Viewer {
    pub socket: WebSocket<TcpStream>,
    decoder: Decoder,
}

impl Viewer {
    pub fn send(&mut self, text: &str) {
        self.socket.send(Message::text(text)).expect("the server reads");
    }

    /// Returns the next picture; `None` after `patience`, or at the end of the connection.
    pub fn try_next(&mut self, patience: Duration) -> Option<Shown> {
        let end = Instant::now() + patience;
        loop {
            let left = end.saturating_duration_since(Instant::now()).max(Duration::from_millis(1));
            self.socket.get_ref().set_read_timeout(Some(left)).unwrap();
            match self.socket.read() {
                Ok(Message::Binary(bytes)) => return Some(self.shown(&bytes)),
                Ok(Message::Text(_)) => self.send(r#"{"kind":"hello"}"#),
                Ok(_) => {}
                Err(_) => return None,
            }
        }
    }

    pub fn next(&mut self) -> Shown {
        self.try_next(DEADLINE).expect("a picture")
    }

    /// Decodes and acknowledges a picture.
    fn shown(&mut self, bytes: &[u8]) -> Shown {
        let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let mut lumas = Vec::new();
        for bytes in [&bytes[HEADER..], &[0, 0, 1, 0xb2]] {
            self.decoder.push(bytes, |picture| {
                lumas.push(picture.plane(SampleComponent::Y).rows().flatten().copied().collect());
            });
        }
        assert_eq!(lumas.len(), 1, "each message is one picture");
        let sequence = number(4);
        self.send(&format!(r#"{{"kind":"seen","sequence":{sequence},"held":0}}"#));
        Shown { is_intra: bytes[1] == 1, sequence, input: number(8), luma: lumas.remove(0), message: bytes.to_vec() }
    }

    /// Receives pictures until none comes for some time, and returns the last one.
    fn rest(&mut self) -> Option<Shown> {
        let mut last = None;
        while let Some(next) = self.try_next(Duration::from_millis(700)) {
            last = Some(next);
        }
        last
    }

    /// Sends an input, and returns the first picture that contains it.
    fn input(&mut self, number: u32, controls: &str) -> Shown {
        self.send(&format!(r#"{{"kind":"control","number":{number},"controls":{controls}}}"#));
        loop {
            let shown = self.next();
            if shown.input >= number {
                return shown;
            }
        }
    }
}

#[test]
fn a_viewer_sees_inputs_and_an_idle_scene_sends_nothing() {
    let server = Server::start("--listen 127.0.0.1:0");
    let mut viewer = server.viewer("?client=a");
    let first = viewer.next();
    assert!(first.is_intra && first.sequence == 0 && first.luma.len() == 64 * 64);
    let rest = viewer.rest().expect("finer pictures");
    assert!(rest.sequence >= 1 && viewer.try_next(Duration::from_millis(300)).is_none());

    // An input changes the picture, which comes to rest again.
    let turned = viewer.input(1, r#"{"orbit":[0.2,0.1]}"#);
    assert!(!turned.is_intra && turned.luma != rest.luma);
    viewer.rest();

    // A held key and the animation move it until they end.
    let walked = viewer.input(2, r#"{"keys":1}"#);
    let further = viewer.next();
    assert!(further.luma != walked.luma);
    viewer.input(3, r#"{"keys":0,"play":true}"#);
    let playing = viewer.next();
    assert!(viewer.next().luma != playing.luma);
    viewer.input(4, r#"{"play":false,"reset":true}"#);
    viewer.rest();

    // Others join at an I picture, and only watch.
    let mut other = server.viewer("?client=b");
    let joined = other.next();
    assert!(joined.is_intra && joined.sequence > 0);
    viewer.rest();
    other.rest();
    other.send(r#"{"kind":"control","number":9,"controls":{"orbit":[1,0]}}"#);
    assert!(other.try_next(Duration::from_millis(300)).is_none());

    // When the controller leaves, the next one controls; the first one regains control.
    drop(viewer);
    while other.input(10, r#"{"orbit":[0.1,0]}"#).input != 10 {}
    let mut viewer = server.viewer("?client=a");
    viewer.next();
    while viewer.input(11, r#"{"orbit":[0.1,0]}"#).input != 11 {}

    // Ctrl-C ends the connections and the program.
    assert_eq!(server.interrupt().code(), Some(130));
    while viewer.try_next(Duration::from_secs(5)).is_some() {}
}

#[test]
fn a_static_view_begins_in_direct_light_and_receives_all_light() {
    // The light of these lamps takes some seconds.
    let server = Server::with_log("--vpls 50000 --quiet --listen 127.0.0.1:0", Stdio::inherit());
    let mut viewer = server.viewer("?client=a");
    let mean = |shown: &Shown| shown.luma.iter().map(|&luma| u32::from(luma)).sum::<u32>() / shown.luma.len() as u32;
    let first = viewer.next();
    assert!(first.is_intra && first.sequence == 0);

    // Without an input, the lit view follows as an I picture, and is brighter.
    let lit = loop {
        let next = viewer.next();
        if next.is_intra {
            break next;
        }
        assert!(mean(&next).abs_diff(mean(&first)) < 3, "the view is static");
    };
    assert!(lit.sequence > 0 && mean(&lit) > mean(&first) + 5, "{} to {}", mean(&first), mean(&lit));
    viewer.rest();
    assert_eq!(server.interrupt().code(), Some(130));
}

#[test]
fn strangers_are_refused_and_disturb_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("walk.m2v");
    let server = Server::start(&format!("--listen 0.0.0.0:0 --token secret-42 --record {}", record.display()));
    assert!(server.link.ends_with("/?token=secret-42"), "{}", server.link);
    let own = format!("http://{}", server.host);

    // Pages need the token and an address of the server; all answers forbid foreign content.
    let (status, page) = server.get("/?token=secret-42", &server.host);
    assert!(status == 200 && page.contains("<canvas") && page.contains("default-src 'none'"), "{page}");
    assert!(!page.contains(env!("CARGO_MANIFEST_DIR")));
    assert_eq!(server.get("/", &server.host).0, 403);
    assert_eq!(server.get("/?token=secret-43", &server.host).0, 403);
    assert_eq!(server.get("/?token=secret-42", "evil.example").0, 421);
    assert_eq!(server.get("/../Cargo.toml", &server.host).0, 404);
    for file in ["/page.js", "/page.css", "/worker.js", "/mpeg2dec.js", "/mpeg2dec.wasm"] {
        assert_eq!(server.get(file, &server.host).0, 200, "{file}");
    }
    assert_eq!(server.refused("?token=secret-42", "http://evil.example"), 403);
    assert_eq!(server.refused("?token=wrong", &own), 403);
    assert_eq!(server.refused("", &own), 403);

    // Rubbish ends only its own connection.
    let mut viewer = server.viewer("?token=secret-42&client=a");
    viewer.next();
    for rubbish in [Message::text("{"), Message::binary(vec![0; 9]), Message::text("x".repeat(5000))] {
        let mut stranger = server.viewer("?token=secret-42");
        let _ = stranger.socket.send(rubbish);
        while stranger.try_next(DEADLINE).is_some() {}
        assert!(stranger.socket.read().is_err());
    }

    // A viewer that never reads holds up nobody, and no more viewers than permitted are admitted.
    let silent = [(); 3].map(|()| server.viewer("?token=secret-42"));
    assert_eq!(server.refused("?token=secret-42", &own), 503);
    viewer.rest();
    let mut before = viewer.input(1, r#"{"keys":64}"#).luma;
    for _ in 0..8 {
        let next = viewer.next().luma;
        assert!(next != before);
        before = next;
    }
    drop(silent);

    // The recording has all pictures.
    assert_eq!(server.interrupt().code(), Some(130));
    let mut pictures = 0;
    let (mut decoder, bytes) = (Decoder::default(), std::fs::read(record).unwrap());
    decoder.push(&bytes, |_| pictures += 1);
    decoder.flush(|_| pictures += 1);
    assert!(pictures > 10, "{pictures}");
}

#[test]
fn wrong_arguments_are_named() {
    let run = |words: &str| {
        let output = Command::new(program()).args(["serve", "scene.glb"]).args(words.split_whitespace()).output();
        let output = output.expect("render2mpeg starts");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, text) = run("--listen example.org");
    assert!(code == Some(2) && text.contains("example.org"), "{text}");
    let (code, text) = run("");
    assert!(code == Some(1) && text.contains("scene.glb"), "{text}");
}
