//! Command `render2mpeg serve`: a live scene in a browser.

use crate::interrupt::{Interrupt, Reactions};
use crate::log::Log;
use crate::notes;
use crate::overwrite::Overwrite;
use crate::print::single_line;
use crate::source::{MemoryLimit, Reading};
use anyhow::{Context, Result};
use clap::Args;
use live::server::Server;
use live::session::{Session, SessionSettings, Studio, record_file};
use render2mpeg::Options;
use render2mpeg::places::FilePlaces;
use render2mpeg::settings::{BitRate, CodedRate, parse_fps};
use renderer::settings::Size;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::str::FromStr;
use std::sync::Arc;

/// Address without `--listen`.
const LISTEN: Address = Address(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), PORT));
/// Port without `--listen`.
const PORT: u16 = 8402;
/// Side of a square picture with as many pixels as pictures have by default.
const SIDE: usize = 384;

/// Scene, address, and limits of the stream.
#[derive(Args)]
pub(crate) struct ServeArguments {
    /// A glTF 2.0 scene, .glb or .gltf
    scene: PathBuf,
    /// Address of the server; addresses other than this machine's own need a token
    #[arg(long, value_name = "IP[:PORT]", default_value_t = LISTEN)]
    listen: Address,
    /// Token that viewers need, 8 to 64 letters and digits [default: none on this machine, else a random one]
    #[arg(long, value_name = "TEXT")]
    token: Option<String>,
    /// Open the page in the browser of this machine
    #[arg(long)]
    open: bool,
    /// Picture size in pixels [default: 384x384 pixels in the camera's shape, such as 512x288]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Maximum number of pictures per second [default: the scene's TOML file, else 25]
    #[arg(long, value_parser = parse_fps)]
    fps: Option<f64>,
    /// Maximum bit rate, such as 800k or 4M; viewers may change it [default: as much as the line carries]
    #[arg(long, value_name = "RATE")]
    bitrate: Option<BitRate>,
    /// Finest quantiser, for static views; viewers may change it
    #[arg(long, value_name = "Q", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=32))]
    qscale: u32,
    /// Maximum number of viewers
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u16).range(1..=200))]
    viewers: u16,
    /// Also record all pictures in a video file
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Number of anchor lights, the sources of indirect light [default: as for films]
    #[arg(long, value_name = "N")]
    vpls: Option<usize>,
    /// Number of threads [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Options for reading the scene.
    #[command(flatten)]
    reading: Reading,
    /// Limit on memory.
    #[command(flatten)]
    memory: MemoryLimit,
    /// Permission to replace the recording.
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print errors and the link only
    #[arg(short, long)]
    quiet: bool,
}

/// Address of a server, with an optional port in its text.
#[derive(Clone, Copy, Debug)]
struct Address(SocketAddr);

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let address = text.replace("localhost", "127.0.0.1");
        let with_port = address.parse().ok();
        let address = with_port.or_else(|| address.parse().ok().map(|ip: IpAddr| SocketAddr::new(ip, PORT)));
        address.map(Self).ok_or_else(|| format!("\"{text}\" is not an address such as 127.0.0.1:8402 or 0.0.0.0"))
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// Serves the scene until Ctrl-C.
pub fn run(arguments: ServeArguments) -> Result<ExitCode> {
    let ServeArguments { scene: path, listen, token, open, size, fps, bitrate, qscale, viewers, record, vpls, .. } =
        arguments;
    let (memory, overwrite, quiet) = (arguments.memory, arguments.overwrite, arguments.quiet);
    // Check scene, settings and files before the server listens.
    let scene = arguments.reading.load(&path)?;
    let size = size.or_else(|| Some(Size::of_camera(&scene, SIDE)));
    let mut options = Options { size, fps, vpls, ..Options::default() };
    let settings = options.fill_in(path, &scene)?;
    memory.check(&scene, &settings)?;
    CodedRate::of(settings.render.fps)?;
    if let Some(path) = &record {
        FilePlaces::of(&scene).writes("--record", Some(path)).check()?;
        overwrite.check(path)?;
    }
    let recording = record.as_deref().map(record_file).transpose()?;
    if !quiet {
        notes::before(&scene, &settings).iter().for_each(|note| tell!("note: {}", single_line(note)));
    }

    // Listen, and print the link.
    let scene = Arc::new(scene);
    let limits = SessionSettings {
        viewers: viewers.into(),
        pictures_per_second: settings.render.fps,
        bits_per_second: bitrate.map(|BitRate(bits)| bits),
        best: qscale,
    };
    let _log = Log::start(u8::from(!quiet), None);
    let session = Arc::new(Session::new(scene.clone(), &settings, limits));
    let server = Server::bind(listen.0, token, session.clone())?;
    let link = server.link();
    let ending = session.clone();
    let first = move || ending.end();
    let interrupt = Interrupt::watch(Reactions { first: Box::new(first), ..Reactions::default() })?;
    say!("{link}");
    if !quiet {
        tell!("serving {} pixels; Ctrl-C ends", settings.render.size);
    }
    if open {
        open_page(&link);
    }

    // Serve on another thread, and render on this one.
    let serving = std::thread::Builder::new().name("server".into()).spawn(move || server.run());
    let serving = serving.context("cannot start a thread")?;
    let rendered = Studio::new(session, recording).run(&scene, &settings);
    let served = serving.join().map_err(|_| anyhow::anyhow!("the server failed"))?;
    rendered?;
    served?;
    Ok(interrupt.exit_code())
}

/// Opens a page in the browser; without a browser, the printed link suffices.
fn open_page(link: &str) {
    let program = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };
    let mut command = match cfg!(windows) {
        true => Command::new("explorer"),
        false => Command::new(program),
    };
    let started = command.arg(link).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    if started.is_err() {
        tell!("note: cannot open a browser");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_have_a_default_port() {
        for (text, expected) in [
            ("127.0.0.1", "127.0.0.1:8402"),
            ("localhost:80", "127.0.0.1:80"),
            ("0.0.0.0:0", "0.0.0.0:0"),
            ("::1", "[::1]:8402"),
        ] {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), expected);
        }
        for text in ["", "example.org", "127.0.0.1:99999", "1.2.3"] {
            assert!(text.parse::<Address>().is_err(), "{text}");
        }
    }
}
