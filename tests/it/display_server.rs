//! `--display-server`: pictures in a viewer that parses the packets of tev, and viewers that fail.

use glam::{Vec3, vec3};
use render_core::image_file::read_layers;
use rustix::process::{Pid, Signal, kill_process};
use std::collections::HashMap;
use std::io::{BufReader, Read};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread::JoinHandle;
use std::time::Duration;
use tests::{Finished, Glb, Moving, checkered_room, ended, program, render2mpeg};

/// Limit of a wait that would otherwise not end.
const DEADLINE: Duration = Duration::from_secs(120);

/// Picture of a viewer after all its rows were updated.
#[derive(Clone, Debug, PartialEq)]
struct Shown {
    name: String,
    width: usize,
    height: usize,
    /// Red, green and blue of each pixel.
    samples: Vec<[f32; 3]>,
}

/// Reads fields of a packet in order.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> &'a [u8] {
        let (field, rest) = self.0.split_at(count);
        self.0 = rest;
        field
    }

    fn flag(&mut self) -> bool {
        match self.bytes(1) {
            [flag @ 0..=1] => *flag == 1,
            other => panic!("{other:?} is not a flag"),
        }
    }

    fn i32(&mut self) -> usize {
        usize::try_from(i32::from_le_bytes(self.bytes(4).try_into().unwrap())).expect("not negative")
    }

    fn i64(&mut self) -> usize {
        usize::try_from(i64::from_le_bytes(self.bytes(8).try_into().unwrap())).expect("not negative")
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&byte| byte == 0).expect("a zero byte");
        let text = String::from_utf8(self.bytes(end).to_vec()).unwrap();
        self.bytes(1);
        text
    }

    fn channels(&mut self) -> Vec<String> {
        let count = self.i32();
        (0..count).map(|_| self.text()).collect()
    }
}

/// Images of a viewer, as its packets describe them.
#[derive(Default)]
struct Images(HashMap<String, Shown>);

impl Images {
    /// Applies a packet, without its length. Returns a picture when its last row arrives.
    fn apply(&mut self, packet: &[u8]) -> Option<Shown> {
        let mut fields = Fields(packet);
        let kind = fields.bytes(1)[0];
        let (_, name) = (fields.flag(), fields.text());
        match kind {
            4 => {
                let (width, height) = (fields.i32(), fields.i32());
                assert_eq!(fields.channels(), ["R", "G", "B"]);
                let image = Shown { name: name.clone(), width, height, samples: vec![[f32::NAN; 3]; width * height] };
                assert!(self.0.insert(name, image).is_none(), "each image is created once");
            }
            6 => {
                let image = self.0.get_mut(&name).expect("a created image");
                let channels = fields.channels();
                let (x, y, width, height) = (fields.i32(), fields.i32(), fields.i32(), fields.i32());
                let offsets: Vec<usize> = channels.iter().map(|_| fields.i64()).collect();
                let strides: Vec<usize> = channels.iter().map(|_| fields.i64()).collect();
                let (samples, rest) = fields.0.as_chunks::<4>();
                assert!(rest.is_empty() && samples.len() == width * height * channels.len());
                for pixel in 0..width * height {
                    let place = (y + pixel / width) * image.width + x + pixel % width;
                    for (c, name) in channels.iter().enumerate() {
                        let channel = ["R", "G", "B"].iter().position(|known| known == name).expect("R, G or B");
                        let sample = samples[offsets[c] + pixel * strides[c]];
                        image.samples[place][channel] = f32::from_le_bytes(sample);
                    }
                }
                return (y + height == image.height).then(|| image.clone());
            }
            other => panic!("unexpected packet {other}"),
        }
        assert!(fields.0.is_empty(), "the packet has no further fields");
        None
    }
}

/// Viewer that listens on a free port, and passes each complete picture on.
fn viewer() -> (String, Receiver<Shown>, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (shown, pictures) = mpsc::channel();
    let thread = std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        let (mut stream, mut images) = (BufReader::new(stream), Images::default());
        let mut length = [0; 4];
        while stream.read_exact(&mut length).is_ok() {
            let mut packet = vec![0; u32::from_le_bytes(length) as usize - 4];
            stream.read_exact(&mut packet).unwrap();
            if let Some(picture) = images.apply(&packet) {
                let _ = shown.send(picture);
            }
        }
    });
    (address, pictures, thread)
}

/// Reads red, green and blue of a linear frame.
fn linear(path: &Path) -> Vec<[f32; 3]> {
    let layers = read_layers(path).unwrap();
    let [red, green, blue] = ["R", "G", "B"].map(|name| layers.channel(name).unwrap());
    (0..red.len()).map(|pixel| [red[pixel], green[pixel], blue[pixel]]).collect()
}

fn run(folder: &Path, words: &str) -> Finished {
    render2mpeg(folder, &words.split_whitespace().collect::<Vec<_>>())
}

#[test]
fn a_viewer_shows_frames_while_a_film_is_made() {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Camera).write(&folder.path().join("room.glb"));
    let (address, pictures, thread) = viewer();
    let words = "render room.glb -o film.m2v --size 48x32 --frames 5000 --vpls 60 --photons 3000 --quiet \
                 --exr frames --exr-depth float --display-server";
    let mut film = Command::new(program())
        .args(words.split_whitespace())
        .arg(address)
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .spawn()
        .expect("render2mpeg starts");

    // End the film after some pictures.
    let mut shown: Vec<Shown> = (0..4).map(|_| pictures.recv_timeout(DEADLINE).expect("a picture")).collect();
    assert_eq!(film.try_wait().unwrap(), None, "the film is unfinished");
    kill_process(Pid::from_raw(film.id() as i32).unwrap(), Signal::INT).unwrap();
    assert_eq!(ended(&mut film, DEADLINE).code(), Some(130));
    thread.join().unwrap();
    shown.extend(pictures.try_iter());

    // Each picture is a frame, in order, and the last one is the last frame.
    let frame = |index: usize| folder.path().join(format!("frames/frame_{index:05}.exr"));
    let mut index = 0;
    for picture in &shown {
        assert_eq!((picture.name.as_str(), picture.width, picture.height), ("film.m2v", 48, 32));
        while linear(&frame(index)) != picture.samples {
            index += 1;
        }
        index += 1;
    }
    assert!(shown.is_sorted_by(|a, b| a.samples != b.samples), "the camera moves");
    assert!(!frame(index).exists() && index >= shown.len());
}

#[test]
fn a_viewer_shows_each_still() {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Camera).write(&folder.path().join("room.glb"));
    let (address, pictures, thread) = viewer();
    let words = format!("still room.glb --frame 0,20 -o light.exr --size 48x32 --vpls 60 --display-server {address}");
    let finished = run(folder.path(), &words);
    assert!(finished.code == Some(0) && !finished.stderr.contains("warning"), "{}", finished.stderr);
    thread.join().unwrap();
    let shown: Vec<Shown> = pictures.try_iter().collect();
    assert_eq!(shown.iter().map(|picture| picture.name.as_str()).collect::<Vec<_>>(), ["light_00.exr", "light_20.exr"]);
    assert!(shown[0].samples != shown[1].samples);
    for picture in shown {
        // Files have halves; the tolerance is half of the last of eleven bits.
        let written = linear(&folder.path().join(&picture.name));
        let (shown, written) = (picture.samples.as_flattened(), written.as_flattened());
        assert!(shown.len() == 3 * 48 * 32 && shown.iter().any(|&sample| sample > 0.0));
        let off = |(a, b): (&f32, &f32)| (a - b).abs() <= b.abs() / 2048.0 + 6e-8;
        assert!(shown.iter().zip(written).all(off));
    }
}

/// Starts a viewer that fails: `act` uses its connection on another thread.
fn failing_viewer(act: impl FnOnce(TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || act(listener.accept().unwrap().0));
    address
}

#[test]
fn a_viewer_that_fails_costs_one_line() {
    // The picture exceeds the buffers of a connection, and its lamp needs no further light.
    let folder = tempfile::tempdir().unwrap();
    let mut glb = Glb::default();
    glb.add(&[[vec3(-2.0, -2.0, 0.0), 4.0 * Vec3::X, 4.0 * Vec3::Y]], Vec3::ZERO, Vec3::splat(0.5));
    glb.add_camera(vec3(0.0, 0.0, 3.0));
    glb.write(&folder.path().join("lamp.glb"));
    let words = "still lamp.glb --size 2000x1000 --samples 1 --vpls 10 --quiet --overwrite -o lamp.png";
    assert_eq!(run(folder.path(), words).stderr, "");
    let expected = std::fs::read(folder.path().join("lamp.png")).unwrap();

    // One viewer is absent, one closes at once, one later, and one never reads. The address of the
    // absent viewer is a client's end of a connection: nobody listens there, and nobody else gets it.
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let held = TcpStream::connect(other.local_addr().unwrap()).unwrap();
    let absent = held.local_addr().unwrap().to_string();
    let closing = failing_viewer(drop);
    let reading = failing_viewer(|mut stream| stream.read_exact(&mut [0; 5000]).unwrap());
    let (end, waiting) = mpsc::channel::<()>();
    let silent = failing_viewer(move |_stream| {
        let _ = waiting.recv();
    });
    for (address, reason) in [
        (absent.as_str(), "no viewer listens there"),
        (&closing, "closed the connection"),
        (&reading, "closed the connection"),
        (&silent, "does not read"),
        ("unknown.invalid:14158", "unknown.invalid:14158: "),
    ] {
        std::fs::remove_file(folder.path().join("lamp.png")).unwrap();
        let Finished { code, stderr, .. } = run(folder.path(), &format!("{words} --display-server {address}"));
        assert_eq!(code, Some(0), "{stderr}");
        assert!(stderr.starts_with("warning: ") && stderr.lines().count() == 1, "{address}: {stderr}");
        assert!(stderr.contains(address) && stderr.contains(reason), "{address}: {stderr}");
        assert!(std::fs::read(folder.path().join("lamp.png")).unwrap() == expected);
    }
    drop(end);
}

#[test]
fn wrong_addresses_of_viewers_are_refused_before_work() {
    let folder = tempfile::tempdir().unwrap();
    for address in ["localhost", "localhost:", ":14158", "localhost:0", "localhost:70000", "::1:14158"] {
        for command in ["render", "still"] {
            let finished = run(folder.path(), &format!("{command} absent.glb --display-server {address}"));
            assert_eq!(finished.code, Some(2), "{}", finished.stderr);
            let first = finished.stderr.lines().next().unwrap_or_default();
            assert!(first.contains("--display-server") && first.contains("HOST:PORT"), "{first}");
        }
    }
}
