//! Events of the stages, as log lines (`-v`) and as bars for `--trace`.

use super::trace::Trace;
use anyhow::Result;
use std::path::PathBuf;

/// Log of the stages, with almost no cost while disabled.
pub struct Log {
    trace: Option<(PathBuf, Trace)>,
}

impl Log {
    /// Starts logging to standard error (`verbose` 1: frames, 2: every stage), and starts collecting bars for the file
    /// `trace`.
    pub fn start(verbose: u8, trace: Option<PathBuf>) -> Self {
        let trace = trace.map(|path| (path, Trace::new()));
        listen(verbose, trace.as_ref().map(|(_, trace)| trace.clone()));
        Self { trace }
    }

    /// Writes the bars to the file, and returns a summary line.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(&self) -> Result<Option<String>> {
        let Some((path, trace)) = &self.trace else { return Ok(None) };
        trace.write(path)?;
        let (wall, sum) = trace.overlap();
        Ok(Some(format!("{}: {wall:.2} s wall-clock time, {sum:.2} s summed over stages", path.display())))
    }
}

/// Installs the subscriber for log lines and trace.
fn listen(verbose: u8, trace: Option<Trace>) {
    use std::io::IsTerminal;
    use tracing_subscriber::filter::LevelFilter;
    use tracing_subscriber::fmt::format::FmtSpan;
    use tracing_subscriber::prelude::*;
    // Color the lines at a terminal, unless the user set NO_COLOR.
    let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    // Log frames at verbosity 1, and the end of each span at verbosity 2.
    let lines = (verbose > 0).then(|| {
        let level = if verbose > 1 { LevelFilter::DEBUG } else { LevelFilter::INFO };
        let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(color).with_target(false);
        lines.with_span_events(if verbose > 1 { FmtSpan::CLOSE } else { FmtSpan::NONE }).with_filter(level)
    });
    // Without a subscriber, events cost almost nothing.
    if lines.is_some() || trace.is_some() {
        tracing_subscriber::registry().with(lines).with(trace.with_filter(LevelFilter::DEBUG)).init();
    }
}
