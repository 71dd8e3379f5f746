//! Ranks with replicated state that share its work, as started by `mpirun`.

use crate::arguments::Arguments;
use pipeline::Run;
use pipeline::checkpoint::Checkpoints;
use pipeline::team::Team;
use render_core::ranks::{LoggedAlone, LoggedRun, LoopLog, Network, Ranks};
use render_core::{process_seconds, scene};
use render2mpeg::{Options, Render, Settings};
use renderer::plan::Plan;
use std::sync::Arc;

/// Numbers of simulated ranks.
const COUNTS: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];
/// The first is measured with two ranks of Open MPI 4.1 on an AMD Zen 5: an all-gather took 0.4 µs for 8 bytes per rank, 570
/// µs for 1 MiB.
pub const NETWORKS: [(&str, Network); 2] = [
    ("memory of one machine: 1 µs, 2 GB/s", Network { latency: 1e-6, bandwidth: 2e9 }),
    ("Ethernet: 50 µs, 1 Gbit/s", Network { latency: 50e-6, bandwidth: 1e9 / 8.0 }),
];

/// Renders the film, and prints the simulated times of ranks.
pub fn print(arguments: &Arguments) -> anyhow::Result<()> {
    // Both stages with shared work keep a log.
    let (prepare, shade) = (Arc::new(LoggedAlone::default()), Arc::new(LoggedAlone::default()));
    let mut team = Team::alone();
    if arguments.is_logged {
        team = Team { prepare: prepare.clone(), shade: shade.clone(), ..team };
    }
    let mut run = LoggedRun { of_first_rank: film(arguments, &team)?, ..LoggedRun::default() };
    run.cpu = process_seconds();
    println!("CPU time of one rank: {:.2} s", run.cpu);
    if !arguments.is_logged {
        return Ok(());
    }
    for one in [&prepare, &shade] {
        run.loops.extend(one.log().expect("it keeps one").loops());
    }

    // Print the terms of the time, then a table for each network.
    let logging: f64 = run.loops.iter().map(|one| one.logging).sum();
    println!(
        "not shared: {:.2} s, {:.2} s of it on rank 0 alone; {} loops; {logging:.2} s for the log",
        run.unshared(),
        run.of_first_rank,
        run.loops.len()
    );
    let megabytes = |of: fn(&LoopLog) -> usize| run.loops.iter().map(of).sum::<usize>() as f64 * 1e-6;
    let (items, sums) = (megabytes(|one| one.items.bytes), megabytes(|one| one.sums.bytes));
    let exchange = |of: fn(&LoopLog) -> f64| run.loops.iter().map(of).sum::<f64>();
    let (packing, unpacking) = (exchange(|one| one.items.packing), exchange(|one| one.items.unpacking));
    println!("results of items: {items:.1} MB, packed in {packing:.2} s, unpacked in {unpacking:.2} s");
    println!("sums of each rank: {sums:.1} MB");
    for (name, network) in &NETWORKS {
        println!("\n{name}\n\n| ranks | CPU s of the busiest | seconds | factor | efficiency |\n|---|---|---|---|---|");
        let one = run.on(1, network).seconds;
        for count in COUNTS {
            let simulated = run.on(count, network);
            let (busiest, seconds) = (simulated.busiest, simulated.seconds);
            let factor = one / seconds;
            let efficiency = 100.0 * factor / count as f64;
            println!("| {count} | {busiest:.2} | {seconds:.2} | × {factor:.2} | {efficiency:.0} % |");
        }
    }
    Ok(())
}

/// Renders the film, and returns the CPU time of rank 0's own work \[s\].
fn film(arguments: &Arguments, team: &Team) -> anyhow::Result<f64> {
    let folder = tempfile::tempdir()?;
    let options = Options { output: Some(folder.path().join("film.m2v")), ..arguments.options.clone() };
    let scene = scene::load(&arguments.scene)?;
    let settings = Settings::new(arguments.scene.clone(), &scene, &options)?;
    let plan = Plan::new(&scene, &settings.render);
    let checkpoints = Checkpoints::off();
    let mut render = Render::among(&scene, &settings, &plan, &checkpoints, team)?;
    render.write_to(&settings.output)?;
    let report = render.finish(Run::default())?;
    let of_frame = |seconds: &pipeline::figures::Seconds| seconds.tone_map + seconds.encode + seconds.thresholds;
    Ok(report.frames.iter().map(|frame| of_frame(&frame.figures.seconds)).sum())
}
