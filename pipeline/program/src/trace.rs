//! `--trace`: timings of each stage and frame, as JSON for `chrome://tracing` and Perfetto.
//!
//! Every span of a stage becomes a bar, which is a "complete event" of the Trace Event Format.

use anyhow::Result;
use pipeline::output::Output;
use serde_json::{Value, json};
use std::cell::Cell;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tracing::Subscriber;
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id};
use tracing_subscriber::layer::{Context, Layer};
use tracing_subscriber::registry::LookupSpan;

/// Names of spans that cover whole stages. Between these spans, threads wait.
const STAGES: [&str; 5] = ["prepare", "shade", "display", "encode", "mask"];

/// Collector of finished spans.
#[derive(Clone)]
pub struct Trace {
    begin: Instant,
    bars: Arc<Mutex<Vec<Bar>>>,
}

/// Finished span.
struct Bar {
    name: &'static str,
    frame: Option<u64>,
    thread: u64,
    thread_name: String,
    start: Duration,
    length: Duration,
}

/// Time at which a span was entered, and the span's frame.
struct Entered {
    at: Option<Instant>,
    frame: Option<u64>,
}

impl Trace {
    /// Returns an empty trace. Times are measured from this call.
    pub fn new() -> Self {
        Self { begin: Instant::now(), bars: Arc::default() }
    }

    fn bars(&self) -> MutexGuard<'_, Vec<Bar>> {
        // Use the data of a poisoned lock, because each push adds a complete bar.
        self.bars.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Returns the time from the start of the first stage to the end of the last, and the sum over all stages \[s\].
    pub fn overlap(&self) -> (f64, f64) {
        let bars = self.bars();
        let stages = || bars.iter().filter(|bar| STAGES.contains(&bar.name));
        let first = stages().map(|bar| bar.start).min().unwrap_or_default();
        let last = stages().map(|bar| bar.start + bar.length).max().unwrap_or_default();
        ((last - first).as_secs_f64(), stages().map(|bar| bar.length.as_secs_f64()).sum())
    }

    /// Writes the trace as JSON.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let (wall, sum) = self.overlap();
        let bars = self.bars();
        let micros = |time: Duration| time.as_nanos() as f64 / 1000.0;
        // Collect each thread once, to name its row in the viewer.
        let mut threads: Vec<(u64, &str)> = bars.iter().map(|bar| (bar.thread, &bar.thread_name[..])).collect();
        threads.sort_unstable();
        threads.dedup();
        let names = threads.into_iter().map(|(thread, name)| {
            json!({ "name": "thread_name", "ph": "M", "pid": 1, "tid": thread, "args": { "name": name } })
        });

        // Write each bar as a complete event, with times in µs.
        let events = bars.iter().map(|bar| {
            json!({ "name": bar.name, "ph": "X", "pid": 1, "tid": bar.thread, "ts": micros(bar.start),
                "dur": micros(bar.length), "args": { "frame": bar.frame } })
        });
        let events: Vec<Value> = names.chain(events).collect();
        let about = json!({ "wall_seconds": wall, "stage_seconds": sum });
        let file = json!({ "traceEvents": events, "displayTimeUnit": "ms", "otherData": about });
        let mut output = Output::create(path)?;
        output.write(file.to_string().as_bytes())?;
        Ok(output.finish()?)
    }
}

/// Returns the number of the current thread; threads are numbered in order of first use.
fn thread_number() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    thread_local!(static NUMBER: Cell<u64> = Cell::new(NEXT.fetch_add(1, Ordering::Relaxed)));
    NUMBER.with(Cell::get)
}

/// Visitor that reads the frame of a span.
#[derive(Default)]
struct FrameOf(Option<u64>);

impl Visit for FrameOf {
    fn record_u64(&mut self, field: &Field, value: u64) {
        if field.name() == "frame" {
            self.0 = Some(value);
        }
    }

    fn record_debug(&mut self, _: &Field, _: &dyn std::fmt::Debug) {}
}

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Trace {
    fn on_new_span(&self, attributes: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        let mut frame = FrameOf::default();
        attributes.record(&mut frame);
        if let Some(span) = context.span(id) {
            span.extensions_mut().insert(Entered { at: None, frame: frame.0 });
        }
    }

    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id)
            && let Some(entered) = span.extensions_mut().get_mut::<Entered>()
        {
            entered.at = Some(Instant::now());
        }
    }

    fn on_exit(&self, id: &Id, context: Context<'_, S>) {
        let Some(span) = context.span(id) else { return };
        let extensions = span.extensions();
        let Some(Entered { at: Some(at), frame }) = extensions.get::<Entered>() else { return };
        self.bars().push(Bar {
            name: span.name(),
            frame: *frame,
            thread: thread_number(),
            thread_name: std::thread::current().name().unwrap_or("thread").to_owned(),
            start: at.duration_since(self.begin),
            length: at.elapsed(),
        });
    }
}
