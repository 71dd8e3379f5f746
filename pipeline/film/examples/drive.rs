//! Runs the whole loop from code. Pictures, thresholds and bytes arrive through a channel while the film is made.
//!
//! ```text
//! cargo run --release -p render2mpeg --example drive -- scenes/cornell/cornell.glb
//! ```

use perceptual::YCbCr;
use pipeline::Run;
use pipeline::observe::Observer;
use pipeline::report::FrameReport;
use plane::Plane;
use render2mpeg::{Options, Settings};
use renderer::plan::Plan;
use std::path::PathBuf;
use std::sync::mpsc::Sender;

/// Messages sent by the stages' threads.
enum News {
    /// Frame number, and mean luma in code values above black.
    Picture(u32, f64),
    /// Frame number, and maximum luminance threshold ΔY.
    Thresholds(u32, f32),
    Bytes(usize),
    Coded(Box<FrameReport>),
}

/// Observer that sends everything through a channel, so that the stages continue without waiting.
struct Channel(Sender<News>);

impl Observer for Channel {
    fn picture(&self, index: u32, picture: &YCbCr) {
        let luma = picture.luma.samples();
        let mean = luma.iter().map(|&y| f64::from(y)).sum::<f64>() / luma.len() as f64;
        let _ = self.0.send(News::Picture(index, mean));
    }

    fn thresholds(&self, index: u32, delta: &Plane<f32>) {
        let largest = delta.samples().iter().copied().fold(0.0, f32::max);
        let _ = self.0.send(News::Thresholds(index, largest));
    }

    fn bytes(&self, bytes: &[u8]) {
        let _ = self.0.send(News::Bytes(bytes.len()));
    }

    fn frame(&self, report: &FrameReport) {
        let _ = self.0.send(News::Coded(Box::new(report.clone())));
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = PathBuf::from(std::env::args().nth(1).ok_or("usage: drive SCENE.glb")?);
    let scene = render_core::scene::load(&path)?;
    // Keep the film small, so that the example runs in seconds.
    let options = Options {
        output: Some("drive.mpg".into()),
        size: "128x128".parse().ok(),
        frames: Some(5),
        vpls: Some(200),
        photons: Some(20_000),
        ..Options::default()
    };

    // Fill in all defaults for this scene, and plan the stages that it needs.
    let settings = Settings::new(path, &scene, &options)?;
    let plan = Plan::new(&scene, &settings.render);

    // Print the messages on another thread until the observer, which owns the sender, is dropped.
    let (news_out, news) = std::sync::mpsc::channel();
    let report = std::thread::scope(|scope| {
        scope.spawn(move || {
            for told in news {
                match told {
                    News::Picture(index, mean) => println!("frame {index}: mean luma {mean:.1}"),
                    News::Thresholds(index, largest) => println!("frame {index}: ΔY up to {largest:.4}"),
                    News::Bytes(count) => println!("{count} bytes"),
                    News::Coded(frame) => println!("frame {}: coded as {}", frame.index, frame.picture_type),
                }
            }
        });
        let channel = Channel(news_out);
        render2mpeg::render(&scene, &settings, &plan, Run { observer: &channel, ..Run::default() })
    })?;
    println!("{} frames, {} bits: {}", report.summary.frames, report.summary.bits_total, settings.output.display());
    Ok(())
}
