//! `render2mpeg serve` among strangers: many viewers, hostile connections, and an early end.

use super::serve::{DEADLINE, Server, Viewer};
use mpeg2dec::Decoder;
use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};
use tests::{Random, sorted_names};

const VIEWERS: usize = 10;
const TOKEN: &str = "?token=secret-42";

/// Reads pictures of all viewers in rounds until no picture arrives any more.
fn rest(viewers: &mut [Viewer]) -> Vec<Option<u32>> {
    let mut last = vec![None; viewers.len()];
    let mut quiet = 0;
    while quiet < 2 {
        quiet += 1;
        for (viewer, last) in viewers.iter_mut().zip(&mut last) {
            while let Some(shown) = viewer.try_next(Duration::from_millis(60)) {
                (*last, quiet) = (Some(shown.sequence), 0);
            }
        }
    }
    last
}

/// Opens a connection and sends bytes. Errors are ignored: the server may close it early.
fn send(host: &str, bytes: &[u8]) -> TcpStream {
    let mut stream = TcpStream::connect(host).expect("the server listens");
    stream.set_read_timeout(Some(DEADLINE)).unwrap();
    let _ = stream.write_all(bytes);
    stream
}

/// Waits until the server closes a connection.
fn wait_for_close(mut stream: TcpStream) {
    let begin = Instant::now();
    let _ = stream.read_to_end(&mut Vec::new());
    assert!(begin.elapsed() < DEADLINE, "the connection stays open");
}

/// Sends bytes over the connection of a viewer, without a frame.
fn send_raw(viewer: &mut Viewer, bytes: &[u8]) {
    let _ = viewer.socket.get_mut().write_all(bytes);
}

fn random_bytes(seed: u64, count: usize) -> Vec<u8> {
    let mut random = Random::new(seed);
    (0..count).map(|_| random.below(256) as u8).collect()
}

/// Returns the lines of a log that report refusals.
fn refusals(log: &Path) -> Vec<String> {
    let log = std::fs::read_to_string(log).unwrap();
    log.lines().filter(|line| line.contains("refused")).map(str::to_owned).collect()
}

#[test]
fn ten_viewers_receive_the_same_pictures_whatever_strangers_do() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let options = "--vpls 100 --viewers 15 --listen 0.0.0.0:0 --token secret-42";
    let server = Server::with_log(options, File::create(&log).unwrap());
    let (host, own) = (server.host.clone(), format!("http://{}", server.host));
    let mut viewers: Vec<Viewer> = (0..VIEWERS).map(|k| server.viewer(&format!("{TOKEN}&client={k}"))).collect();
    let last = rest(&mut viewers);
    assert!(last[0].is_some() && last.iter().all(|sequence| *sequence == last[0]), "{last:?}");

    // While the controller turns the camera, a stranger acts before each picture.
    let half = format!("GET /pictures{TOKEN} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\n");
    let (mut open, mut strangers) = (Vec::new(), Vec::new());
    let first = last[0].unwrap() + 1;
    viewers[0].send(r#"{"kind":"control","number":1,"controls":{"keys":64}}"#);
    for step in 0..14 {
        match step {
            1 => open.push(send(&host, &random_bytes(1, 4096))),
            2 => open.push(send(&host, half.as_bytes())),
            // This viewer never reads.
            3 => strangers.push(server.viewer(TOKEN)),
            // A text frame of 2^40 bytes (RFC 6455, 5.2), and rubbish in place of frames
            4 => {
                let mut viewer = server.viewer(TOKEN);
                send_raw(&mut viewer, &[0x81, 0xff, 0, 0, 1, 0, 0, 0, 0, 0, 1, 2, 3, 4]);
                strangers.push(viewer);
            }
            5 => {
                let mut viewer = server.viewer(TOKEN);
                send_raw(&mut viewer, &[0xff; 600]);
                strangers.push(viewer);
            }
            6 => assert_eq!(server.refused(TOKEN, "http://evil.example"), 403),
            7 => assert_eq!(server.refused("?token=wrong-token", &own), 403),
            8 => assert_eq!(server.get(&format!("/{TOKEN}"), "evil.example").0, 421),
            9 => open.push(send(&host, format!("{half}X-Long: {}", "x".repeat(1 << 20)).as_bytes())),
            _ => {}
        }
        let messages: Vec<_> = viewers.iter_mut().rev().map(Viewer::next).collect();
        assert!(messages.iter().all(|shown| shown.sequence == first + step), "each viewer has each picture");
        assert!(messages.iter().all(|shown| shown.message == messages[0].message), "viewers have the same bytes");
    }

    // Each stranger costs one line, and all but the viewer that never reads are gone.
    open.into_iter().for_each(wait_for_close);
    for viewer in &mut strangers[1..] {
        while viewer.try_next(DEADLINE).is_some() {}
        assert!(viewer.socket.read().is_err());
    }
    let reasons = ["no valid request", "wrong Origin", "wrong token", "wrong Host", "too long", "invalid opcode"];
    assert_eq!(server.interrupt().code(), Some(130));
    let lines = refusals(&log);
    let count = |reason: &str| lines.iter().filter(|line| line.to_lowercase().contains(&reason.to_lowercase())).count();
    assert_eq!((lines.len(), reasons.map(count)), (8, [3, 1, 1, 1, 1, 1]), "{lines:#?}");
}

#[test]
fn connections_without_requests_are_few_and_short() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let server = Server::with_log("--vpls 100 --viewers 1 --listen 127.0.0.1:0", File::create(&log).unwrap());

    // Connections beyond 2 per viewer and 32 are refused.
    let mut idle: Vec<TcpStream> = (0..33).map(|_| send(&server.host, b"")).collect();
    let mut slow = send(&server.host, b"GET / HT");
    let mut further = send(&server.host, b"");
    assert_eq!(further.read(&mut [0]).unwrap_or(0), 0);
    assert!(refusals(&log).iter().any(|line| line.contains("too many connections")));

    // Idle connections end, and so does one that sends a byte now and then.
    let begin = Instant::now();
    while slow.write_all(b"T").is_ok() {
        assert!(begin.elapsed() < DEADLINE, "the connection stays open");
        std::thread::sleep(Duration::from_millis(100));
    }
    idle.drain(..).for_each(wait_for_close);
    assert_eq!(server.get("/", &server.host).0, 200);
    assert_eq!(server.interrupt().code(), Some(130));
    let lines = refusals(&log);
    assert!(lines.len() == 2 && lines[1].contains("no valid request"), "{lines:#?}");
}

#[test]
fn ctrl_c_ends_the_server_while_the_first_light_is_computed() {
    // The light of these lamps takes many minutes.
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("walk.m2v");
    let options = format!("--vpls 1000000 --quiet --listen 127.0.0.1:0 --record {}", record.display());
    let server = Server::with_log(&options, std::process::Stdio::inherit());
    let mut viewer = server.viewer("?client=a");
    assert!(viewer.next().is_intra);
    assert_eq!(server.interrupt().code(), Some(130));

    // The recording is complete.
    assert_eq!(sorted_names(folder.path()), ["walk.m2v"]);
    let bytes = std::fs::read(record).unwrap();
    assert!(bytes.ends_with(&[0, 0, 1, 0xb7]), "sequence_end_code");
    let (mut decoder, mut pictures) = (Decoder::default(), 0);
    decoder.push(&bytes, |_| pictures += 1);
    decoder.flush(|_| pictures += 1);
    assert!(pictures > 0);
}
