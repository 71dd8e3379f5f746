//! Films rendered by several ranks: as threads here, with `mpirun` in the module `mpirun`.

use pipeline::Run;
use pipeline::checkpoint::Checkpoints;
use pipeline::observe::{Observer, OnFrame};
use pipeline::report::FrameReport;
use pipeline::stage::Shaded;
use pipeline::team::Team;
use render_core::ranks::{ThreadMail, ThreadRanks};
use render_core::scene::Scene;
use render2mpeg::job::job_of;
use render2mpeg::report::Report;
use render2mpeg::settings::Settings;
use render2mpeg::{Error, Options, Render};
use renderer::plan::Plan;
use renderer::settings::{SampleCount, Stopping};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tests::{Exchange, Moving, checkered_room, cornell, load};

/// Creates teams of `count` ranks in this process.
fn teams(count: usize) -> Vec<Team> {
    let (prepare, shade) = (ThreadRanks::new(count), ThreadRanks::new(count));
    let ranks = prepare.into_iter().zip(shade).zip(ThreadMail::new(count));
    let team =
        |((prepare, shade), mail)| Team { prepare: Arc::new(prepare), shade: Arc::new(shade), mail: Arc::new(mail) };
    ranks.map(team).collect()
}

/// A scene and the settings of its film.
struct Film {
    scene: Scene,
    settings: Settings,
}

impl Film {
    /// Loads a scene with few lights and pixels; `change` adjusts the options.
    fn new(scene: &Path, output: PathBuf, change: impl Fn(&mut Options)) -> Self {
        let mut options = Options {
            output: Some(output),
            frames: Some(5),
            size: "64x48".parse().ok(),
            vpls: Some(200),
            photons: Some(40_000),
            ..Options::default()
        };
        change(&mut options);
        let (scene, settings) = load(scene, options);
        Self { scene, settings }
    }

    /// Renders or resumes the film on `count` ranks; returns the report of rank 0 and the results of the other ranks.
    fn made(&self, count: usize, run: Run<'_>) -> (Result<Report, Error>, Vec<Result<(), Error>>) {
        let plan = Plan::new(&self.scene, &self.settings.render);
        let job = job_of(&self.scene, &self.settings).unwrap();
        let checkpoints = Checkpoints::resume(&job, Some(Duration::ZERO)).unwrap();
        let mut teams = teams(count);
        std::thread::scope(|scope| {
            let plan = &plan;
            let follow = |team: Team| scope.spawn(move || Render::follow(&self.scene, &self.settings, plan, &team));
            let others: Vec<_> = teams.split_off(1).into_iter().map(follow).collect();
            let lead = || {
                let mut film = Render::among(&self.scene, &self.settings, plan, &checkpoints, &teams[0])?;
                film.write_to(&self.settings.output)?;
                film.finish(run)
            };
            let report = lead();
            (report, others.into_iter().map(|other| other.join().expect("no rank panics")).collect())
        })
    }

    /// Renders the whole film on `count` ranks, and returns it with its report; no rank may fail.
    fn whole(&self, count: usize) -> (Vec<u8>, Report) {
        let (report, others) = self.made(count, Run::default());
        assert!(others.iter().all(Result::is_ok), "{others:?}");
        let film = std::fs::read(&self.settings.output).expect("the film is there");
        let _ = std::fs::remove_file(pipeline::checkpoint::path_for(&self.settings.output));
        (film, report.expect("a report"))
    }
}

#[test]
fn films_of_several_ranks_are_those_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let moving = folder.path().join("moving.glb");
    checkered_room(Moving::Box).write(&moving);
    type Change = fn(&mut Options);
    let kinds: [(&str, &Path, Change); 7] = [
        ("default", &cornell(), |_| ()),
        ("a box that moves", &moving, |_| ()),
        ("samples", &moving, |options| options.samples = Some(SampleCount::Each(3))),
        ("no cache", &moving, |options| (options.cache, options.frames) = ("off".parse().ok(), Some(3))),
        ("calibrated", &moving, |options| options.stopping = Some(Stopping::Calibrated)),
        ("chunks", &moving, |options| options.chunk = Some(2)),
        ("fixed", &moving, |options| options.thresholds = "fixed:0.02".parse().ok()),
    ];
    for (name, scene, change) in kinds {
        let film = Film::new(scene, folder.path().join("film.m2v"), change);
        let (alone, report) = film.whole(1);
        for count in [2, 3] {
            let (together, shared) = film.whole(count);
            assert!(together == alone, "{name}: {count} ranks make another film");
            for (a, b) in report.frames.iter().zip(&shared.frames) {
                // Counts cover all ranks.
                let counts = |frame: &FrameReport| {
                    (frame.figures.shadow_rays, frame.figures.photons_traced, frame.figures.cut_size_max)
                };
                assert_eq!(counts(a), counts(b), "{name}: frame {}", a.index);
            }
        }
        // A different seed must change the film, or equality would prove nothing.
        let seeded = Film::new(scene, folder.path().join("film.m2v"), |options| {
            change(options);
            options.seed = Some(7);
        });
        assert!(seeded.whole(2).0 != alone, "{name}: the seed changes nothing");
    }
}

/// Sets a flag when frame `at` is coded.
fn stop_at(at: u32, stop: &AtomicBool) -> OnFrame<impl FnMut(&FrameReport)> {
    OnFrame::new(move |frame: &FrameReport| {
        if frame.index == at {
            stop.store(true, Ordering::Relaxed);
        }
    })
}

#[test]
fn films_of_several_ranks_end_early_and_go_on_with_another_number() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("moving.glb");
    checkered_room(Moving::Box).write(&scene);
    let film = |name: &str| Film::new(&scene, folder.path().join(name), |options| options.frames = Some(7));
    let (whole, _) = film("whole.m2v").whole(1);
    for (name, first, then) in [("a.m2v", 3, 1), ("b.m2v", 1, 2), ("c.m2v", 2, 3)] {
        let (film, stop) = (film(name), AtomicBool::new(false));
        let observer = stop_at(1, &stop);
        let (report, others) = film.made(first, Run { observer: &observer, stop: &stop });
        assert!(others.iter().all(Result::is_ok), "{others:?}");
        let report = report.expect("a report");
        assert!(report.summary.interrupted && report.frames.len() < 7, "{} frames", report.frames.len());
        let (film, report) = film.whole(then);
        assert_eq!(report.frames.len(), 7);
        assert!(film == whole, "begun on {first} ranks, ended on {then}");
    }
}

/// If a film cannot be written, all ranks end.
#[test]
fn all_ranks_end_when_the_first_fails() {
    let folder = tempfile::tempdir().unwrap();
    // A failure before the first frame.
    let film = Film::new(&cornell(), folder.path().join("no/such/folder/film.m2v"), |_| ());
    let (report, others) = film.made(3, Run::default());
    assert!(report.is_err_and(|error| error.chain().contains("cannot be written")));
    assert!(others.iter().all(Result::is_ok), "{others:?}");

    // A failure in the middle, in the display stage.
    struct Fails;
    impl Observer for Fails {
        fn shaded(&self, index: u32, _: &Shaded) {
            assert!(index < 2, "on purpose");
        }
    }
    let film = Film::new(&cornell(), folder.path().join("film.m2v"), |_| ());
    let (report, others) = film.made(3, Run { observer: &Fails, ..Run::default() });
    assert!(report.is_err_and(|error| error.chain().contains("the display stage failed")));
    assert!(others.iter().all(Result::is_ok), "{others:?}");
}

/// Ranks with different light end together, each with the same error.
#[test]
fn other_light_is_found_out() {
    let folder = tempfile::tempdir().unwrap();
    // Only antialiased outlines differ, which every rank computes separately. Both films exchange the same messages.
    let [film, other] = ["on", "off"].map(|smooth| {
        Film::new(&cornell(), folder.path().join("film.m2v"), |options| {
            options.antialiasing = smooth.parse().ok();
            options.samples = Some(SampleCount::Each(1));
        })
    });
    let checkpoints = Checkpoints::off();
    let teams = teams(2);
    let [plan, other_plan] = [&film, &other].map(|film| Plan::new(&film.scene, &film.settings.render.clone()));
    let (first, second) = std::thread::scope(|scope| {
        let follows = scope.spawn(|| Render::follow(&other.scene, &other.settings, &other_plan, &teams[1]));
        let film = Render::among(&film.scene, &film.settings, &plan, &checkpoints, &teams[0]).unwrap();
        (film.finish(Run::default()), follows.join().expect("no panic"))
    });
    let line = "rank 1 differs from rank 0 in the light of frame 0";
    for error in [first.map(drop).unwrap_err(), second.unwrap_err()] {
        assert!(matches!(&error, Error::Loop(pipeline::Error::Ranks(text)) if text.starts_with(line)), "{error}");
    }
}

/// Of several processes, only rank 0 runs a command that shares no work.
#[test]
fn commands_without_shared_work_run_once() {
    let folder = tempfile::tempdir().unwrap();
    checkered_room(Moving::Nothing).write(&folder.path().join("room.glb"));
    for (rank, is_run) in [("1", false), ("0", true)] {
        let mut command = std::process::Command::new(tests::program());
        command.args(["still", "room.glb", "-o", "room.png", "--size", "32x32", "--vpls", "50"]);
        command.current_dir(folder.path()).env("OMPI_COMM_WORLD_SIZE", "2").env("OMPI_COMM_WORLD_RANK", rank);
        let output = command.output().expect("it starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert_eq!(said.contains("rank 0 runs this command alone"), is_run, "{said}");
        assert_eq!(folder.path().join("room.png").exists(), is_run, "rank {rank}");
    }
}

/// A build without the feature reports it in one line, on one rank only.
#[test]
#[cfg(not(feature = "mpi"))]
fn a_build_without_ranks_says_so_under_mpirun() {
    for (rank, expected) in
        [("0", "this build lacks the feature mpi; build with cargo build --release --features mpi"), ("1", "")]
    {
        let mut command = std::process::Command::new(tests::program());
        command.args(["render", "scene.glb"]).env("OMPI_COMM_WORLD_SIZE", "2").env("OMPI_COMM_WORLD_RANK", rank);
        let output = command.output().expect("it starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(expected) && said.lines().count() == usize::from(rank == "0"), "{said}");
    }
}

/// All ranks exchange messages at the same time, including large ones; `mpirun` repeats it with processes.
#[test]
fn all_messages_arrive_in_the_order_of_their_sender() {
    for count in [1, 3] {
        std::thread::scope(|scope| {
            for mail in ThreadMail::new(count) {
                scope.spawn(move || Exchange { largest: 1 << 22 }.run(&mail));
            }
        });
    }
}

#[cfg(all(unix, feature = "mpi"))]
mod mpirun;
